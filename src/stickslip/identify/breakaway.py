"""How large is the friction just before a contact slips, against the friction while it slides?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result
from stickslip.identify.force import FUSIONS
from stickslip.identify.fusion import Balance
from stickslip.identify.motion import is_measured
from stickslip.identify.slip_ringing import ringing_of
from stickslip.identify.strokes import FAST, Stroke, find_strokes
from stickslip.record.record import Record
from stickslip.signals.noise import noise_level
from stickslip.statistics import mean_of_cycles

Array = NDArray[np.float64]

QUESTION = "the friction at breakaway"
SIDES = ((1, "forward"), (-1, "back"))
TRAVEL = 0.05  # of a stroke: how far the start of a slip is followed
BEFORE = 5  # a stick's last fifth tells what it bears at its end
ROWS = 256  # of the start of a slip that are looked at
LEAST = 8  # samples in which a stick's end and a slip's start can be told
STEADY = 0.3  # of the sliding friction: one that swings by more is no friction to be quoted
QUARTILE = 0.6744897501960817  # of the normal distribution


@dataclass(frozen=True, eq=False, repr=False)
class Breakaway(Result):
    """The friction at which a contact breaks away.

    Attributes
    ----------
    forward, back : Estimate or None
        Static friction: what the contact bears just before it slips, in either direction.
    ratio : Estimate
        That over the sliding friction of the same stroke, of both directions.
    ringing_forward, ringing_back : Estimate or None
        Frequency [Hz] at which the friction rings after slip has begun, where it was measured and does; more of it
        tells :func:`slip_ringing`.
    ringing_difference : Estimate or None
        Forward less back [Hz].
    swing_forward, swing_back : Estimate or None
        How much the friction swings about its level while it slides, over that level; a friction that is steady enough
        to be called one does so by less than 30 %.
    count : int
        Strokes looked at.
    status : str
        "ok", or in words what to beware of.
    """

    forward: Estimate | None
    back: Estimate | None
    ratio: Estimate
    ringing_forward: Estimate | None
    ringing_back: Estimate | None
    ringing_difference: Estimate | None
    swing_forward: Estimate | None
    swing_back: Estimate | None
    count: int
    status: str


def breakaway(record: Record, *, contact: str | None = None) -> Breakaway:
    r"""How large is the friction just before the contact slips, against the friction while it slides?

    A mass at rest has no inertia force: the contact bears exactly what pulls, :math:`p = k (z - x) + c\,\dot z + P`
    (the second term for a damper on the base), which is known without any differentiation. When the slip begins is
    found, to a sample, from its first travel, :math:`m\ddot x = p - f` with f constant so early, by least squares over
    the instant and f; the pull can not be less than f then. Static friction is the pull at that instant, from a line
    through the stick's last fifth. Of a friction that was measured, or found by all sensors together, it is the largest
    value before the contact moves, which noise makes too large by two of its deviations at most: the interval's low end
    goes as far down. Of a contact that gives way before it slips it is the first peak once friction is near its level,
    which the ring that follows raises.

    Parameters
    ----------
    record : Record
        With ``friction`` and ``x`` (or ``theta``, or ``v``), as for :func:`friction_loops`.
    contact : {"ground", "base"}, optional
        What the mass slides on; as :func:`friction_force` was told, or the ground, when not given.

    Returns
    -------
    Breakaway

    Raises
    ------
    RecordError
        A channel is missing, broken or too short, or the units of friction and motion do not belong together.
    EstimateError
        No motion, or no stroke in which the contact turns round and slides.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(3.0, 1200, law=ss.Coulomb(1.0, static=1.3), drive=ss.HarmonicBase(3e-3, frequency=1.0))
    >>> record = ss.simulate(slider, cycles=12).record(fs=500)
    >>> found = breakaway(ss.friction_force(record.rows(1000, 6000), mass=3.0, stiffness=1200))
    >>> bool(abs(found.ratio.value - 1.3) < 0.03)
    True
    """
    strokes = find_strokes(record, contact=contact, question=QUESTION)
    balance = _balance(record)
    pull, mass = (None, np.nan) if balance is None else (balance.pull(record), balance.mass)
    fs = record.fs
    chosen = strokes.strokes
    borne = [(each, _borne(each, pull, mass, fs)) for each in chosen]
    found = [(each, *answer) for each, answer in borne if answer is not None]
    if not found:
        raise EstimateError(
            f"the first travel of none of {len(chosen)} slips can be followed",
            "the start of a slip takes 4 samples at least",
            "sample faster, or give a longer record",
        )
    unsure = float(np.median([change for *_, change in found]))  # the instant is known to a sample
    above = 0.0 if pull is not None else 2 * (record.channels["friction"].noise or noise_level(record["friction"], fs))
    rested = sum(each.rests for each, *_ in found)
    method = "pull at the start of the slip" if pull is not None and 2 * rested > len(found) else "peak before the slip"
    how = f"{method}, mean of strokes"
    levels = [
        _widened(
            mean_of_cycles(f"static friction {side}", values, unit=strokes.unit, method=how), unsure + above, unsure
        )
        if (values := [friction for each, friction, _ in found if each.way == way])
        else None
        for way, side in SIDES
    ]
    ratio = mean_of_cycles(
        "static over sliding friction", [friction / each.level for each, friction, _ in found], unit="1",
        method=f"{method} over the median of the stroke, mean of strokes",
    )  # fmt: skip
    sliding = float(np.median([each.level for each, *_ in found]))
    ratio = _widened(ratio, (unsure + above) / sliding, unsure / sliding)
    rings = ringing_of(strokes.strokes, fs) if is_measured(record, "friction") else None  # a balance rings by itself
    heard = (None, None, None) if rings is None else (rings.forward, rings.back, rings.difference)
    swings = [_swing([each for each, *_ in found if each.way == way], side) for way, side in SIDES]
    gives = "the contact gives way before it slips: the first peak holds the ring that follows"
    status = "ok" if 2 * rested > len(found) else gives
    if status == "ok" and pull is not None and ratio.interval[1] < 1:
        status = (
            "below the sliding friction: either that grows with speed, or the mass still rings on its contact when it "
            'slips, and the pull is not what it bears: take friction_force(record, ..., method="fusion")'
        )
    flagged = [replace(each, status=status) if each is not None and each.status == "ok" else each for each in levels]
    return Breakaway(
        flagged[0], flagged[1], replace(ratio, status=status) if ratio.status == "ok" else ratio, *heard,
        swings[0], swings[1], len(found), status,
    )  # fmt: skip


def _widened(estimate: Estimate, below: float, above: float) -> Estimate:
    """The estimate, its interval as far as noise and the instant of a sample may have moved it."""
    low, high = estimate.interval
    return replace(estimate, interval=(low - below, high + above), sd=float(np.hypot(estimate.sd, (below + above) / 4)))


def _balance(record: Record) -> Balance | None:
    """By which friction was found, where no sensor did better than that and the mass rests on the ground."""
    told = [step.arguments for step in record.history if step.action == "friction_force"]
    made = record.channels["friction"].source == "friction_force"
    if not (made and told and told[-1].get("mass") and told[-1].get("contact") == "ground"):
        return None
    return None if told[-1]["method"] in FUSIONS else Balance.told(told[-1])


def _borne(stroke: Stroke, pull: Array | None, mass: float, fs: float) -> tuple[float, float] | None:
    """What the contact bears just before it slips, and by how much that changes from a sample to the next."""
    if pull is None or not stroke.rests:
        return float(stroke.friction[stroke.slip]), 0.0
    if stroke.slip < LEAST:
        return None
    first = stroke.slip // 2
    way = stroke.displacement - np.median(stroke.displacement[first : stroke.slip + 1])
    last = int(np.argmax(way > TRAVEL * np.ptp(way))) + 1
    if last - first < LEAST:
        return None
    force = stroke.way * pull[stroke.first + first : stroke.first + last]
    begins = _start(way[first:last], force, mass, fs)
    if begins is None:
        return None
    rows = np.arange(max(0, int(begins) - max(4, (first + int(begins)) // BEFORE)), int(begins) + 1)
    slope, value = np.polyfit(rows - begins, force[rows], 1) if len(rows) > 1 else (0.0, force[rows[0]])
    return float(value), float(abs(slope))


def _start(travel: Array, pull: Array, mass: float, fs: float) -> float | None:
    """When, in samples, a slip begins of which the first travel is known."""
    every = len(travel) // ROWS + 1
    travel, pull, count = travel[::every], pull[::every], len(travel[::every])
    begins = np.arange(1, count - 3)
    since = np.maximum(np.arange(count) - begins[:, None], 0.0)
    once = _summed(pull)
    twice = _summed(once)
    # by the pull alone, and by a force of 1 N, from each begin on
    pulled = np.where(since > 0, twice - twice[begins, None] - once[begins, None] * since, 0.0)
    step = every**2 / (mass * fs**2)
    held, rest = step * since**2 / 2, travel - step * pulled
    held_about, rest_about = (each - each.mean(axis=1, keepdims=True) for each in (held, rest))
    friction = -np.sum(held_about * rest_about, axis=1) / np.sum(held_about**2, axis=1)
    cost = np.sum((rest_about + friction[:, None] * held_about) ** 2, axis=1)
    cost[pull[begins] < friction] = np.inf
    best = int(np.argmin(cost))
    if not np.isfinite(cost[best]):
        return None
    around = cost[max(best - 1, 0) : best + 2]
    moved = 0.0
    if len(around) == 3 and np.isfinite(around).all() and (curved := around[0] - 2 * around[1] + around[2]) > 0:
        moved = (around[0] - around[2]) / (2 * curved)
    return float(every * (begins[best] + moved))


def _summed(values: Array) -> Array:
    """The integral, by trapezoids of one sample."""
    return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)])


def _swing(strokes: Sequence[Stroke], side: str) -> Estimate | None:
    """Median deviation of the friction from its median while it slides, as a normal law's standard deviation."""
    shares = []
    for stroke in strokes:
        speed = np.gradient(stroke.displacement)
        friction = stroke.friction[stroke.slip :][speed[stroke.slip :] > FAST * speed.max()]
        if len(friction):
            shares.append(float(np.median(np.abs(friction - np.median(friction)))) / QUARTILE / stroke.level)
    if not shares:
        return None
    found = mean_of_cycles(
        f"swing of the friction while sliding {side}", shares, unit="1", method="median deviation from the median"
    )
    swings = f"the friction swings by {100 * found.value:.0f} % of its level while it slides: a vibration of the rig"
    return found if found.value < STEADY else replace(found, status=f"{swings} or a faulty record, no steady friction")
