"""When does a contact stick, for how long, and how often?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.identify.motion import (
    AUDIBLE,
    CREEP,
    Cycles,
    Motion,
    contact_motion,
    find_cycles,
    motion_channels,
    stretches,
)
from stickslip.record.record import Record
from stickslip.signals.delay import without_delays
from stickslip.statistics import mean_of_cycles
from stickslip.units import parse_value

Array = NDArray[np.float64]

SLIPPED = 3.0  # times the threshold: a motion that never gets there is creep or noise within a stick
DWELL = 2.5  # times the duration of a passage through zero, from which on it is a stick
FASTEST = 3  # samples: nothing shorter is told from a reversal


@dataclass(frozen=True)
class StickEvent:
    """One stick or slip.

    Attributes
    ----------
    time : float
        When it begins [s].
    kind : str
        "stick" or "slip".
    duration : float
        How long it lasts [s].
    whole : bool
        False where the record begins or ends within it.
    """

    time: float
    kind: str
    duration: float
    whole: bool = True


@dataclass(frozen=True, eq=False, repr=False)
class Sticks(Result):
    """Sticks and slips of a contact.

    Attributes
    ----------
    share : Estimate
        Share of the time that the speed is below the threshold, as such records are commonly counted: at most so much
        of it sticks. The interval's low end is what is left if every slip began and ended when its speed, carried on
        to zero, did: linearly before a stick, and after it as a square (with static friction above the sliding one
        linearly too, so that the low end errs to the low side). `sd` is that of a normal law as wide as the interval.
    per_cycle : Estimate
        Stops per cycle.
    events : tuple of StickEvent
        Sticks and slips in turn.
    threshold : float
        Speed [m/s or rad/s] below which the contact may stick.
    noise : float
        Standard deviation of the velocity's noise [m/s or rad/s].
    frequency : Estimate
        Cycles per second [Hz].
    status : str
        "ok", or in words what to beware of.
    """

    share: Estimate
    per_cycle: Estimate
    events: tuple[StickEvent, ...]
    threshold: float
    noise: float
    frequency: Estimate
    status: str


def find_sticks(
    record: Record,
    *,
    contact: str | None = None,
    threshold: float | str | None = None,
    frequency: float | str | None = None,
) -> Sticks:
    """When does the contact stick, for what share of the time, how often per cycle?

    The contact may stick where its speed is below a threshold: five standard deviations of the velocity's noise, or 4
    % of the typical peak speed where that is larger, for below that creep and presliding of a compliant contact are
    not told from sticking. A motion that stays below three thresholds is part of the stick around it. A passage
    through zero is not a stick: at the acceleration with which the speed falls to the threshold before, and rises
    from it after, it would last ``(t_in + t_out) / 2``, with t_in and t_out the times between one and three
    thresholds; a stick lasts 2.5 times that at least, and longer than the smoothing of the velocity spreads a jump.

    Parameters
    ----------
    record : Record
        With ``x`` (or ``theta``, or ``v``); ``z`` for a contact on the base. Stated delays are taken out first.
    contact : {"ground", "base"}, optional
        What the mass slides on, the speed being that against it; as :func:`friction_force` was told, or the ground,
        when not given.
    threshold : float or str, optional
        Speed [m/s or rad/s] below which the contact may stick; found from the record when not given.
    frequency : float or str, optional
        Forcing frequency [Hz]; found from the record when not given.

    Returns
    -------
    Sticks

    Raises
    ------
    RecordError
        A channel is missing, broken or too short.
    EstimateError
        No motion, no complete cycle, or a threshold without meaning.

    Examples
    --------
    >>> t = np.arange(8000) / 1000
    >>> drive = np.sin(2 * np.pi * t)
    >>> v = np.maximum(np.abs(drive) - 0.5, 0) * np.sign(drive)  # stuck a third of the time
    >>> x = np.cumsum(v) / 1000 + 1e-6 * np.random.default_rng(0).standard_normal(t.size)
    >>> sticks = find_sticks(Record.of({"x": x}, fs=1000), threshold=0.01)
    >>> round(sticks.share.value, 1), round(sticks.per_cycle.value)
    (0.3, 2)
    """
    question = "sticks and slips"
    record = without_delays(record, *motion_channels(record, contact), question=question)
    motion = contact_motion(record, contact=contact, question=question)
    cycles = find_cycles(record, motion, frequency=frequency)
    noisy, creep = AUDIBLE * motion.noise, CREEP * cycles.peak
    limit = max(noisy, creep) if threshold is None else parse_value(threshold, f"{motion.unit}/s")
    if not 0 < limit < cycles.peak and threshold is not None:
        raise EstimateError(
            f"threshold = {_words(limit, motion)}",
            f"it lies between 0 and the typical peak speed, {_words(cycles.peak, motion)}",
            "leave it out to have it found",
        )
    if SLIPPED * limit >= cycles.peak:
        raise EstimateError(
            f"the typical peak speed is {_words(cycles.peak, motion)}, the threshold {_words(limit, motion)}",
            "slips are told from sticks where they are three times as fast as the threshold",
            "give a record with less noise or more motion",
        )
    stuck, certain = _stuck(motion, limit)
    told = "five deviations of its noise" if noisy >= creep else f"{100 * CREEP:g} % of its peak, to pass over creep"
    rule = f"time with the speed below {_words(limit, motion)} ({'given' if threshold is not None else told})"
    stated = (
        f"the velocity's noise is {_words(motion.noise, motion)}",
        *_sensitivity(motion, cycles, limit),
    )
    status = cycles.status
    if limit < noisy:
        status = f"the threshold is within the velocity's noise ({_words(noisy, motion)} is five deviations)"
    per_cycle = mean_of_cycles(
        "stops per cycle", _counted(stuck, cycles), unit="1", method=f"sticks begun in each cycle; {rule}"
    )
    return Sticks(
        share=_share(stuck, certain, cycles, rule, stated),
        per_cycle=per_cycle,
        events=_events(stuck, motion),
        threshold=limit,
        noise=motion.noise,
        frequency=cycles.frequency,
        status=status,
    )


def _words(speed: float, motion: Motion) -> str:
    return f"{1e3 * speed:.3g} mm/s" if motion.unit == "m" else f"{speed:.3g} rad/s"


def _stuck(motion: Motion, limit: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where the contact sticks; and where it still does if each slip's speed is carried on to zero."""
    speed = np.abs(motion.velocity)
    size = len(speed)
    slow = speed < limit
    begins, ends = stretches(~slow)
    slips = np.maximum.reduceat(np.append(speed, 0.0), np.column_stack([begins, ends]).ravel())[::2] >= SLIPPED * limit
    begins, ends = begins[slips], ends[slips]
    stuck, certain = np.ones(size, dtype=bool), np.ones(size, dtype=bool)
    # from one slip to the next: when the one falls from three thresholds to one, and the next rises back
    fast = np.flatnonzero(speed >= SLIPPED * limit)
    before = fast[np.searchsorted(fast, ends) - 1] if len(ends) else ends
    after = fast[np.searchsorted(fast, begins)] if len(begins) else begins
    for first, last in zip(begins, ends, strict=True):
        stuck[first:last] = False
    certain[:] = stuck
    rising, falling = after - begins, ends - 1 - before
    for index in range(len(begins) - 1):
        first, last = ends[index], begins[index + 1]
        passage = (falling[index] + rising[index + 1]) / 2
        if last - first < max(DWELL * passage, FASTEST, motion.blur):
            stuck[first:last] = certain[first:last] = False
            continue
        # deceleration is steady into a stick (v ~ t), acceleration grows out of it (v ~ t^2)
        certain[first : min(last, first + falling[index] // 2)] = False
        certain[max(first, last - round(rising[index + 1] / (math.sqrt(SLIPPED) - 1))) : last] = False
    return stuck, certain


def _share(
    stuck: NDArray[np.bool_], certain: NDArray[np.bool_], cycles: Cycles, rule: str, stated: tuple[str, ...]
) -> Estimate:
    name = "stuck share of the time"
    above, below = (
        mean_of_cycles(name, _per_cycle(part, cycles), unit="1", method=f"mean of cycles; {rule}", checks=stated)
        for part in (stuck, certain)
    )
    low, high = max(0.0, below.interval[0]), min(1.0, above.interval[1])
    sd = (high - low) / (2 * NORMAL_95)
    return Estimate(name, above.value, (low, high), sd, "1", above.method, above.status, above.checks)


def _sensitivity(motion: Motion, cycles: Cycles, limit: float) -> tuple[str, ...]:
    shares = []
    for factor in (0.5, 2.0):
        if SLIPPED * factor * limit < cycles.peak and (factor > 1 or factor * limit > motion.noise):
            stuck, _ = _stuck(motion, factor * limit)
            share = float(np.mean(_per_cycle(stuck, cycles)))
            shares.append(f"at {'half' if factor < 1 else 'twice'} the threshold the share is {share:.2f}")
    return tuple(shares)


def _per_cycle(stuck: NDArray[np.bool_], cycles: Cycles) -> Array:
    """Share of each cycle in which `stuck` holds; a sample counts for the time around it."""
    total = np.concatenate([[0.0], np.cumsum(stuck)])
    at = np.interp(cycles.edges + 0.5, np.arange(len(total)), total)
    return np.asarray(np.diff(at) / np.diff(cycles.edges))


def _counted(stuck: NDArray[np.bool_], cycles: Cycles) -> Array:
    begins, ends = stretches(stuck)
    middle = (begins + ends) / 2
    counts, _ = np.histogram(middle, cycles.edges)
    return counts.astype(float)


def _events(stuck: NDArray[np.bool_], motion: Motion) -> tuple[StickEvent, ...]:
    turns = np.flatnonzero(np.diff(stuck)) + 1
    begins = np.concatenate([[0], turns])
    ends = np.concatenate([turns, [len(stuck)]])
    return tuple(
        StickEvent(
            float(motion.start + first / motion.fs),
            "stick" if stuck[first] else "slip",
            float((last - first) / motion.fs),
            whole=bool(first > 0 and last < len(stuck)),
        )
        for first, last in zip(begins, ends, strict=True)
    )
