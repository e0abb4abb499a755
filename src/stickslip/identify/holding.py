"""The likeliest contact while it holds: its stiffness and damping from everything that the sensors read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.identify.force import FUSIONS
from stickslip.identify.fusion import Balance, Held, fuse
from stickslip.identify.motion import is_measured, stretches
from stickslip.record.record import Record

Array = NDArray[np.float64]
Stretches = list[tuple[int, int]]

STIFFNESS, DAMPING = "contact stiffness", "contact damping"
HELD = 0.9  # share of the sliding friction below which the contact certainly holds
FAST = 0.5  # share of the peak speed above which it certainly slides
LEAST = 3  # samples of one stick to draw a line through
FEW = 4  # sticks
MOST, PIECES = 1 << 17, 8  # samples that are looked at, and in how many stretches of a record that is longer
ROUGH = 0.1  # relative deviation above which the likelihood is no parabola, and is followed to its ends
NEAR = 0.03  # of the log likelihood: how near its peak a simplex goes before a parabola takes over
METHOD = "likeliest contact while it holds, by a Kalman filter"


@dataclass(frozen=True, eq=False)
class LikelyContact:
    """A contact that holds like a spring and a damper beside it.

    Attributes
    ----------
    stiffness, damping : Estimate
        K [N/m] and c [N s/m].
    covariance : ndarray (2, 2)
        Of log K and c.
    level : float
        Sliding friction [N].
    balance : Balance
        The mass on its spring.
    """

    stiffness: Estimate
    damping: Estimate
    covariance: Array
    level: float
    balance: Balance


def likely_contact(record: Record) -> LikelyContact:
    """The stiffness and the damping under which everything that the sensors read of a record is most likely."""
    balance, sensors, fused = _told(record)
    held, levels, sticks, guesses = [], [], 0, []
    for rows in _looked_at(len(record)):
        part = record.rows(rows.start, rows.stop)
        friction, velocity = (part["friction"], part["v"]) if fused else _fused(part, balance, sensors)
        level = sliding_level(friction, velocity)
        holds, found = held_steps(friction, velocity, level)
        if found:
            held.append(Held.of(part, balance, sensors, holds, level))
            change, way = np.diff(friction)[holds[:-1]], (velocity[:-1] / record.fs)[holds[:-1]]
            guesses.append((float(change @ way), float(way @ way)))
        levels.append(level)
        sticks += len(found)
    if sticks < FEW:
        raise EstimateError(
            f"{sticks} sticks of {LEAST} samples or more", f"{FEW} are needed", "sample faster, or longer"
        )
    across, along = np.sum(guesses, axis=0)
    start = max(balance.stiffness, across / along)
    level = float(np.mean(levels))
    said = (
        f"{sticks} sticks, in which the friction is below {HELD:g} of {level:.3g} N",
        f"from {', '.join(sensors)}; an error of a sensor's gain, lag or mount is not in the interval",
    )

    def likelihood(stiffness: float, damping: float) -> float:
        return sum(part.log_likelihood(stiffness, damping) for part in held)

    best, covariance = _peak(likelihood, start, math.sqrt(start * balance.mass))
    sd = np.sqrt(np.diag(covariance))
    stiffness = math.exp(best[0])
    return LikelyContact(
        Estimate.normal(STIFFNESS, stiffness, sd=stiffness * sd[0], unit="N/m", method=METHOD, checks=said),
        Estimate.normal(DAMPING, best[1], sd=sd[1], unit="N s/m", method=METHOD, checks=said),
        covariance,
        level,
        balance,
    )


def sliding_level(friction: Array, velocity: Array) -> float:
    """The friction's magnitude [N] where the contact certainly slides."""
    speed = np.abs(velocity)
    return float(np.median(np.abs(friction)[speed > FAST * np.quantile(speed, 0.99)]))


def held_steps(friction: Array, velocity: Array, level: float) -> tuple[NDArray[np.bool_], Stretches]:
    """Which steps, each from a sample to the next, lie within a stick; and the samples of each stick.

    A stick begins where the velocity turns, which is sharp, and is over when the friction is nearly back at the
    sliding level, which on a way of twice its deflection it reaches fast.
    """
    inside = np.abs(friction) < HELD * level
    holds, found = np.zeros(len(friction), dtype=bool), []
    for first, last in zip(*stretches(inside), strict=True):
        if last - first >= LEAST:
            way, back = np.sign(velocity[first]), first
            earliest = max(0, 2 * first - last)
            while back > earliest and way * velocity[back - 1] > 0:
                back -= 1
            holds[back : last - 1] = True
            found.append((back, last))
    return holds, found


def _told(record: Record) -> tuple[Balance, list[str], bool]:
    """The rig as the record's history tells it, the sensors that speak of it, and whether they were put together."""
    record.require_clean("x", "friction", question=STIFFNESS)
    told = [step for step in record.history if step.action == "friction_force"]
    if not told or told[-1].arguments.get("contact") == "base":
        raise EstimateError(
            "no friction_force in the record's history" if not told else "a contact on the moving base",
            "the likeliest contact is found from a mass that rubs on the ground, by its balance of forces",
            'call friction_force(record, ..., method="fusion") first, or take method="slope"',
        )
    rig = told[-1].arguments
    if rig["mass"] is None:
        raise EstimateError(
            "friction without mass and stiffness of the oscillator",
            "the likeliest contact is found by the balance of forces on the mass",
            'give friction_force mass= or stiffness=, or take method="slope"',
        )
    named = FUSIONS.get(rig["method"], FUSIONS["fusion"])
    balance = Balance(rig["mass"], rig["stiffness"], rig["damping"], rig["damper"])
    fused = rig["method"] in FUSIONS and not is_measured(record, "v")
    return balance, [name for name in named if is_measured(record, name)], fused


def _fused(record: Record, balance: Balance, sensors: Sequence[str]) -> tuple[Array, Array]:
    """Friction and velocity by all sensors together."""
    fused = fuse(record, balance, sensors)
    return fused.friction, fused.velocity


def _looked_at(size: int) -> Iterator[slice]:
    """Rows of a record: all of them, or some stretches spread evenly over a long one."""
    count, length = (1, size) if size <= MOST else (PIECES, MOST // PIECES)
    for first in np.linspace(0, size - length, count).round().astype(int):
        yield slice(int(first), int(first) + length)


def _peak(likelihood: Callable[[float, float], float], stiffness: float, damping: float) -> tuple[Array, Array]:
    """Where the likelihood is largest, in (log K, c), by simplex from a first guess; and its covariance there."""
    from scipy.optimize import minimize

    unit = np.array([1e-2, 0.01 * damping])
    at = np.array([math.log(stiffness), 0.03 * damping])

    def cost(step: Array) -> float:
        log_stiffness, resisting = at + unit * step
        return -likelihood(math.exp(log_stiffness), resisting)

    simplex = np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]])
    near = minimize(
        cost, np.zeros(2), method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": np.inf, "fatol": NEAR}
    ).x
    slope, curved = _derivatives(cost, near, _widths(cost, near))
    if not np.all(np.linalg.eigvalsh(curved) > 0):
        raise EstimateError(
            "the likelihood has no peak in stiffness and damping",
            "the sticks must say something of the contact",
            "sample faster, or use better sensors",
        )
    inverse = np.asarray(np.linalg.inv(curved), dtype=np.float64)
    return at + unit * (near - inverse @ slope), inverse * np.outer(unit, unit)


def _widths(cost: Callable[[Array], float], at: Array) -> Array:
    """Steps along each axis over which the cost rises by about one."""
    widths = np.ones(2)
    for axis in range(2):
        for _ in range(8):
            rise = cost(at + widths[axis] * np.eye(2)[axis]) - cost(at)
            if 0.3 < rise < 3:
                break
            widths[axis] /= math.sqrt(max(rise, 1e-4)) if rise > 0 else 0.5
    return widths


def _derivatives(cost: Callable[[Array], float], at: Array, width: Array) -> tuple[Array, Array]:
    """Slope and curvature by central differences."""
    value = {(i, j): cost(at + width * (i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1)}
    slope = np.array([value[1, 0] - value[-1, 0], value[0, 1] - value[0, -1]]) / (2 * width)
    own = [(value[1, 0] + value[-1, 0] - 2 * value[0, 0]), (value[0, 1] + value[0, -1] - 2 * value[0, 0])]
    cross = (value[1, 1] + value[-1, -1] - value[1, -1] - value[-1, 1]) / 4
    return slope, np.array([[own[0], cross], [cross, own[1]]]) / np.outer(width, width)
