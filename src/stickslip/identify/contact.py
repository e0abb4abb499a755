"""How stiff is the contact before it slides?"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.identify.force import FUSIONS
from stickslip.identify.fusion import Balance, Held, fuse
from stickslip.identify.loops import Loops
from stickslip.identify.motion import is_measured, stretches
from stickslip.record.record import Record
from stickslip.statistics import mean_of_cycles

Array = NDArray[np.float64]

HELD = 0.9  # share of the sliding friction below which the contact certainly holds
FAST = 0.5  # share of the peak speed above which it certainly slides
LEAST = 3  # samples of one stick to draw a line through
FEW = 4  # sticks
STIFFNESS, DAMPING = "contact stiffness", "contact damping"


def contact_stiffness(record: Record | Loops, *, method: str | None = None) -> Estimate:
    r"""How stiff is the contact while it holds?

    While it holds, friction follows :math:`f = f_0 + K_y (x - x_0) + c\,\dot x` (thesis, equations 3.8 to 3.11). With
    "stick" the K_y and c are taken under which everything that the sensors read is most likely (a Kalman filter that
    lets the friction follow the contact where it holds, and do as it likes elsewhere): 0.05 % from 3 s of a rig like
    the thesis's in stick-slip, 0.5 % in sliding at 8.7 Hz. With "slope" a line is drawn through friction against
    displacement in each stick, as in the thesis's section 3.5; its answers scatter by 10 to 17 % between sticks on
    that rig, and are 2 to 27 % low, the more the faster the stick is over.

    Parameters
    ----------
    record : Record or Loops
        After :func:`~stickslip.friction_force`, whose rig is used, with the sensors' mounts stated; of
        :func:`~stickslip.friction_loops` the slope of the mean cycle is taken.
    method : {"stick", "slope"}, optional
        "stick" for a record, "slope" for loops, where left out.

    Returns
    -------
    Estimate
        K_y [N/m], or [N m/rad]; what its method can not see is in its checks.

    Raises
    ------
    RecordError
        The record has no friction.
    EstimateError
        Too few sticks, a contact on the moving base, or a method that does not fit.

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.HarmonicBase(0.65e-3, frequency=2.5)
    >>> run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), cycles=5)
    >>> record = ss.Rig.perfect().having("x", white=1e-7).measure(run, fs=4000, rng=1)
    >>> record = ss.friction_force(record, mass=2.42, stiffness=2310, method="fusion")
    >>> bool(abs(contact_stiffness(record).value / 192000 - 1) < 0.01)
    True
    """
    if isinstance(record, Loops):
        if method not in (None, "slope"):
            raise _no_method(method, ("slope",))
        return _slope(_branches(record.displacement, record.friction, record.level.value), record.unit)
    if method not in (None, "stick", "slope"):
        raise _no_method(method, ("stick", "slope"))
    if method == "slope":
        record.require_clean("x", "friction", question=STIFFNESS)
        level = _level(record["friction"], np.gradient(record["x"]))
        return _slope(_branches(record["x"], record["friction"], level), "m")
    return _likely(record)[0]


def contact_damping(record: Record) -> Estimate:
    r"""How much does the contact damp while it holds?

    The c of :math:`f = f_0 + K_y (x - x_0) + c\,\dot x`, from the same fit as :func:`contact_stiffness` with "stick".

    Parameters
    ----------
    record : Record
        After :func:`~stickslip.friction_force`, whose rig is used, with the sensors' mounts stated.

    Returns
    -------
    Estimate
        c [N s/m].

    Raises
    ------
    RecordError
        The record has no friction.
    EstimateError
        Too few sticks, or a contact on the moving base.

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.HarmonicBase(0.65e-3, frequency=2.5)
    >>> run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), cycles=5)
    >>> record = ss.Rig.perfect().having("x", white=1e-7).measure(run, fs=4000, rng=1)
    >>> record = ss.friction_force(record, mass=2.42, stiffness=2310, method="fusion")
    >>> bool(abs(contact_damping(record).value - 23.9) < 1)
    True
    """
    return _likely(record)[1]


def _no_method(method: str | None, methods: tuple[str, ...]) -> EstimateError:
    return EstimateError(f"method = '{method}'", f"it is one of {', '.join(methods)}", "choose one of them")


def _level(friction: Array, velocity: Array) -> float:
    speed = np.abs(velocity)
    return float(np.median(np.abs(friction)[speed > FAST * np.quantile(speed, 0.99)]))


# ---- by slope


def _branches(displacement: Array, friction: Array, level: float) -> Iterator[float]:
    """The slope of friction against displacement in each stick that goes from one side to the other."""
    for first, last in zip(*stretches(np.abs(friction) < HELD * level), strict=True):
        way = displacement[first:last] - np.mean(displacement[first:last])
        if last - first >= LEAST and np.ptp(friction[first:last]) > level and np.any(way):
            yield float(way @ friction[first:last] / (way @ way))


def _slope(slopes: Iterator[float], unit: str) -> Estimate:
    found = np.array(list(slopes))
    if len(found) < 2:
        raise EstimateError(
            f"{len(found)} sticks with {LEAST} samples or more below the sliding friction",
            "a slope needs two at least",
            "sample faster, or give a longer record",
        )
    scatter = float(np.std(found, ddof=1) / abs(np.mean(found)))
    said = (
        f"{len(found)} sticks, which scatter by {100 * scatter:.0f} %",
        "noise in the displacement and lags make a slope too low: 2 to 27 % on a rig like the thesis's",
    )
    return mean_of_cycles(
        STIFFNESS,
        found,
        unit="N/m" if unit == "m" else "N m/rad",
        method="mean slope of friction against displacement in each stick",
        checks=said,
    )


# ---- by likelihood


@dataclass(frozen=True, eq=False)
class _Fit:
    """Where the likelihood is largest, in (log K, c), and its covariance there."""

    best: Array
    covariance: Array


def _likely(record: Record) -> tuple[Estimate, Estimate]:
    record.require_clean("x", "friction", question=STIFFNESS)
    told = [step for step in record.history if step.action == "friction_force"]
    if not told or told[-1].arguments.get("contact") == "base":
        raise EstimateError(
            "no friction_force in the record's history" if not told else "a contact on the moving base",
            "the likeliest contact is found from a mass that rubs on the ground, by its balance of forces",
            'call friction_force(record, ..., method="fusion") first, or take method="slope"',
        )
    rig = told[-1].arguments
    balance = Balance(rig["mass"], rig["stiffness"], rig["damping"], rig["damper"])
    named = FUSIONS.get(rig["method"], FUSIONS["fusion"])
    sensors = [name for name in named if is_measured(record, name)]
    fused = fuse(record, balance, sensors)
    level = _level(fused.friction, fused.velocity)
    inside = np.abs(fused.friction) < HELD * level
    holds = np.append(inside[:-1] & inside[1:], False)
    sticks = [j for j, k in zip(*stretches(holds), strict=True) if k - j >= LEAST - 1]
    if len(sticks) < FEW:
        raise EstimateError(
            f"{len(sticks)} sticks of {LEAST} samples or more", f"{FEW} are needed", "sample faster, or longer"
        )
    held = Held.of(record, balance, sensors, holds, level)
    moved = np.diff(fused.friction)[holds[:-1]], (fused.velocity[:-1] / record.fs)[holds[:-1]]
    first = max(balance.stiffness, float(moved[0] @ moved[1] / (moved[1] @ moved[1])))
    fit = _maximum(held, first, math.sqrt(first * balance.mass))
    said = (
        f"{len(sticks)} sticks, in which the friction is below {HELD:g} of {level:.3g} N",
        f"from {', '.join(sensors)}; an error of a sensor's gain, lag or mount is not in the interval",
    )
    method = "likeliest contact while it holds, by a Kalman filter"
    sd = np.sqrt(np.diag(fit.covariance))
    stiffness = math.exp(fit.best[0])
    return (
        Estimate.normal(STIFFNESS, stiffness, sd=stiffness * sd[0], unit="N/m", method=method, checks=said),
        Estimate.normal(DAMPING, fit.best[1], sd=sd[1], unit="N s/m", method=method, checks=said),
    )


def _maximum(held: Held, stiffness: float, damping: float) -> _Fit:
    """By simplex from a first guess, and the curvature there."""
    from scipy.optimize import minimize

    unit = np.array([1e-2, 0.01 * damping])
    at = np.array([math.log(stiffness), 0.03 * damping])

    def cost(step: Array) -> float:
        log_stiffness, resisting = at + unit * step
        return -held.log_likelihood(math.exp(log_stiffness), resisting)

    simplex = np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]])
    found = minimize(
        cost, np.zeros(2), method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-2}
    )
    width = _widths(cost, found.x)
    curved = _curvature(cost, found.x, width)
    if not np.all(np.linalg.eigvalsh(curved) > 0):
        raise EstimateError(
            "the likelihood has no peak in stiffness and damping",
            "the sticks must say something of the contact",
            "sample faster, or use better sensors",
        )
    covariance = np.asarray(np.linalg.inv(curved) * np.outer(unit, unit), dtype=np.float64)
    return _Fit(at + unit * found.x, covariance)


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


def _curvature(cost: Callable[[Array], float], at: Array, width: Array) -> Array:
    """Second derivatives by central differences."""
    value = {(i, j): cost(at + width * (i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1)}
    own = [(value[1, 0] + value[-1, 0] - 2 * value[0, 0]), (value[0, 1] + value[0, -1] - 2 * value[0, 0])]
    cross = (value[1, 1] + value[-1, -1] - value[1, -1] - value[-1, 1]) / 4
    return np.array([[own[0], cross], [cross, own[1]]]) / np.outer(width, width)
