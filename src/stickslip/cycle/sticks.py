"""When does a contact stick, for how long, and how often?

When it takes hold and when it lets go is found to a fraction of a sample, from its friction and its velocity."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.force import FUSIONS
from stickslip.balance.likely_contact import sliding_level
from stickslip.balance.motion import (
    AUDIBLE,
    CREEP,
    Cycles,
    Motion,
    contact_motion,
    find_cycles,
    motion_channels,
    slid_on,
    stretches,
)
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.record.record import Record, require_record
from stickslip.signals.interpolate import without_delays
from stickslip.statistics import mean_of_cycles
from stickslip.units import parse_value

Array = NDArray[np.float64]

HELD = 0.9  # share of the sliding friction below which the contact certainly holds
LEAST = 4  # samples of one hold from which its spring is told
BEFORE, AFTER = (-20, -3), (4, 20)  # samples before a hold and after it that tell the sliding friction there
SURE = 4.0  # standard deviations that a reversal of the velocity, and the friction's fall in it, must have
ALIKE = 8.0  # samples over which the friction's error keeps
FEW = 4  # holds
LONGEST = 400  # samples in which a hold ends after the friction was last below its limit
QUESTION = "sticks and slips"
METHODS = ("fusion", "speed")
SLIPPED = 3.0  # times the threshold: a motion that never gets there is creep or noise within a stick
DWELL = 2.5  # times the duration of a passage through zero, from which on it is a stick
SHORT = 8.0  # samples of a hold below which others are likely missed
FASTEST = 3  # samples: nothing shorter is told from a reversal


@dataclass(frozen=True)
class Hold:
    """One hold of the contact.

    Attributes
    ----------
    begin, end : float
        When the velocity turns and the contact takes hold, and when the friction reaches its limit and it lets go [s].
    begin_sd, end_sd : float
        Standard deviations of both [s].
    """

    begin: float
    end: float
    begin_sd: float
    end_sd: float


@dataclass(frozen=True, eq=False)
class Trace:
    """Friction and velocity of a contact with their standard deviations, from all its sensors together."""

    friction: Array
    friction_sd: Array
    velocity: Array
    velocity_sd: Array
    fs: float
    start: float

    @classmethod
    def of(cls, record: Record) -> Trace:
        """From a record to which the friction was added with its band."""
        sd = record["v_sd"] if "v_sd" in record else np.full(len(record), record.channels["v"].noise or 0.0)
        return cls(record["friction"], record["friction_sd"], record["v"], sd, record.fs, record.start)


@dataclass(frozen=True, eq=False)
class Spring:
    """How the friction follows the motion while the contact holds: K x + c v.

    `rest` is what that leaves of the friction, `miss` by how much it misses the sliding friction at a hold's begin [N].
    """

    stiffness: float
    damping: float
    rest: float
    miss: float
    travel: Array

    def carried(self, trace: Trace, rows: slice, core: slice) -> Array:
        """The friction in some samples, carried on from those in which the contact certainly holds."""
        follows = [self.stiffness * self.travel[part] + self.damping * trace.velocity[part] for part in (rows, core)]
        return np.asarray(follows[0] + np.mean(trace.friction[core] - follows[1]))


def find_holds(trace: Trace) -> tuple[Hold, ...]:
    """When does the contact hold?

    It takes hold where its velocity turns, at the sliding friction, and from then on the friction falls: there a
    cubic through four samples of the velocity crosses zero. While it holds the friction follows a spring and a damper,
    the same in all holds, found by least squares; it lets go where that friction, carried on, reaches the
    friction with which it then slides. So neither time depends on how the smoother rounds the friction's corners.

    Parameters
    ----------
    trace : Trace

    Returns
    -------
    tuple of Hold
        Those that begin and end in the record; none, if fewer than four are resolved.
    """
    level, middle = sliding_level(trace.friction, trace.velocity)
    trace = replace(trace, friction=trace.friction - middle)
    turns = np.flatnonzero(trace.velocity[:-1] * trace.velocity[1:] < 0)
    turns = turns[(turns > -BEFORE[0]) & (turns < len(trace.velocity) - AFTER[1])]
    cores = _cores(trace, level, turns)
    if len(cores) < FEW:
        return ()
    spring = _spring(trace, cores)
    return tuple(_hold_at_each_turn(trace, spring, level, turns, dict(cores)))


def _cores(trace: Trace, level: float, turns: NDArray[np.intp]) -> list[tuple[int, slice]]:
    """For each turn of the velocity out of sliding, the samples after it in which the contact certainly holds."""
    begins, ends = stretches(np.abs(trace.friction) < HELD * level)
    first_and_core: dict[int, tuple[int, slice]] = {}
    for turn in turns:
        at = int(np.searchsorted(ends, turn, side="right"))
        side = math.copysign(1.0, trace.velocity[turn])
        # the friction is where it slides to that side, and falls after the turn
        if at == len(begins) or side * trace.friction[turn] < HELD * HELD * level:
            continue
        first, last = max(int(begins[at]), turn + 1), int(ends[at])
        if last - first >= LEAST and last < len(trace.velocity) and at not in first_and_core:
            between = trace.velocity[turn + 1 : first + 1] * side
            if np.all(between <= 0):
                first_and_core[at] = (int(turn), slice(first, last))
    return list(first_and_core.values())


def _spring(trace: Trace, cores: list[tuple[int, slice]]) -> Spring:
    """K and c of all holds together, each with its own rest; those fitting thrice worse than most are left out."""
    travel = np.concatenate([[0.0], np.cumsum((trace.velocity[1:] + trace.velocity[:-1]) / 2)]) / trace.fs
    parts = [
        (np.column_stack([_centred(travel[rows]), _centred(trace.velocity[rows])]), _centred(trace.friction[rows]))
        for _, rows in cores
    ]
    for _ in range(2):
        designs, forces = zip(*parts, strict=True)
        answer, *_ = np.linalg.lstsq(np.vstack(designs), np.concatenate(forces), rcond=None)
        rests = np.array([np.sqrt(np.mean((force - design @ answer) ** 2)) for design, force in parts])
        parts = [part for part, rest in zip(parts, rests, strict=True) if rest <= 3 * np.median(rests)]
    spring = Spring(float(answer[0]), float(answer[1]), float(np.median(rests)), 0.0, travel)
    misses = [
        _sliding(trace, 1.0, turn + BEFORE[0], turn + BEFORE[1], 0, 0.0)
        - spring.carried(trace, slice(turn, turn + 1), rows)[0]
        for turn, rows in cores
    ]
    return replace(spring, miss=float(np.median(np.abs(misses))))


def _centred(values: Array) -> Array:
    return np.asarray(values - values.mean())


def _hold_at_each_turn(
    trace: Trace, spring: Spring, level: float, turns: NDArray[np.intp], cores: dict[int, slice]
) -> Iterator[Hold]:
    """Hold after hold; turns of the velocity within one are passed over."""
    free = 0  # where the last hold ended, in samples
    for turn in turns:
        if turn < free:
            continue
        side = math.copysign(1.0, trace.velocity[turn])
        before = _sliding(trace, side, turn + BEFORE[0], turn + BEFORE[1], free, level)
        if side * trace.friction[turn] < HELD * HELD * before:
            continue
        begin, slope = _crossing(trace.velocity, turn)
        hold = _end(trace, spring, int(turn), {1.0: before, -1.0: level}, cores.get(int(turn)))
        if hold is None or slope == 0:
            continue
        end, end_sd = hold
        yield Hold(
            trace.start + begin / trace.fs,
            trace.start + end / trace.fs,
            float(trace.velocity_sd[turn]) / abs(slope * trace.fs),
            end_sd / trace.fs,
        )
        free = math.ceil(end)


def _sliding(trace: Trace, side: float, first: int, last: int, free: float, level: float) -> float:
    """The sliding friction in some samples, as far as they lie in one slip."""
    part = side * trace.friction[max(first, math.ceil(free) + 2) : last]
    return float(part.mean()) if len(part) >= 3 else level


def _crossing(values: Array, row: int) -> tuple[float, float]:
    """Where the cubic through four samples crosses zero between the middle ones, in samples, and its slope there."""
    a, b, c, d = values[row - 1 : row + 3]
    cubic = np.array([(d - a) / 6 + (b - c) / 2, (a + c) / 2 - b, c - b / 2 - a / 3 - d / 6, b])
    at = b / (b - c)
    for _ in range(3):  # Newton
        slope = float(np.polyval(np.polyder(cubic), at))
        at = float(np.clip(at - np.polyval(cubic, at) / slope, 0.0, 1.0)) if slope else at
    return row + at, float(np.polyval(np.polyder(cubic), at))


def _end(
    trace: Trace, spring: Spring, turn: int, limits: dict[float, float], core: slice | None
) -> tuple[float, float] | None:
    """When the hold after a turn ends, in samples, and its standard deviation; None if there is no hold, or no end.

    `limits` is the sliding friction to either side of the velocity before the turn.
    """
    side = math.copysign(1.0, trace.velocity[turn])
    near = slice(turn, min(len(trace.velocity), (core.stop if core else turn) + LONGEST))
    known = core or slice(turn, turn + 1)
    carried = side * spring.carried(trace, near, known)
    if core is None:
        carried += limits[1.0] - carried[0]
    turned = side * trace.velocity[near] < -SURE * trace.velocity_sd[near]
    stuck = np.flatnonzero(turned & (limits[1.0] - carried > SURE * trace.friction_sd[near]))
    if not len(stuck):
        return None
    begun = int(stuck[0])
    end, doubt = math.nan, 0.0
    for _ in range(2):
        over = np.flatnonzero((carried[begun:] >= limits[1.0]) | (-carried[begun:] >= limits[-1.0]))
        if not len(over) or over[0] == 0:
            return None
        row = begun + int(over[0])
        way = math.copysign(1.0, carried[row])
        slope = way * float(carried[row] - carried[row - 1])
        end = turn + row - (way * float(carried[row]) - limits[way]) / slope
        first, last = math.ceil(end) + AFTER[0], math.ceil(end) + AFTER[1]
        limits = {**limits, way: _sliding(trace, side * way, first, last, 0, limits[way])}
        there = float(np.median(trace.friction_sd[first:last]) * math.sqrt(ALIKE / (AFTER[1] - AFTER[0])))
        alone = spring.rest * math.sqrt(min(1.0, ALIKE / (known.stop - known.start)))
        doubt = math.hypot(alone, there, spring.miss / 2) / slope
    return end, doubt


@dataclass(frozen=True)
class StickEvent:
    """One stick or slip.

    Attributes
    ----------
    time : float
        When it begins [s].
    kind : str
        "stick", "slip", "microslip" (within the stick before it), or "microstick" (the contact holds while the motion
        only reverses: too short for a stick).
    duration : float
        How long it lasts [s]; a stick with the micro-slips in it.
    whole : bool
        False where the record begins or ends within it.
    time_sd, duration_sd : float
        Standard deviations of both [s].
    """

    time: float
    kind: str
    duration: float
    whole: bool = True
    time_sd: float = math.nan
    duration_sd: float = math.nan


@dataclass(frozen=True, eq=False, repr=False)
class Sticks(Result):
    """Sticks and slips of a contact.

    Attributes
    ----------
    share : Estimate
        Share of the time that the contact holds. By fusion: all holds, those at a mere reversal too; a micro-slip
        within a stick is no hold (so does a simulated record's truth count). By speed, which sees neither micro-slips
        nor short holds: the time that the speed is below the threshold, as such records are commonly counted; at most
        so much of it sticks. The interval's low end is then what is left if every slip began and ended when its speed,
        carried on to zero, did: linearly before a stick, and after it as a square (with static friction above the
        sliding one linearly too, so that the low end errs to the low side). `sd` is that of a normal law as wide as
        the interval.
    per_cycle : Estimate
        Stops per cycle.
    microslips : Estimate or None
        Micro-slips per stick; None where they can not be seen.
    kind : str
        "double stick-slip" where most sticks hold a micro-slip, "stick-slip", or "sliding" where nothing sticks.
    events : tuple of StickEvent
        Sticks and slips in turn, each stick followed by the micro-slips within it.
    threshold : float
        Speed [m/s or rad/s] below which the contact may stick.
    noise : float
        Standard deviation of the velocity's noise [m/s or rad/s].
    frequency : Estimate
        Cycles per second [Hz].
    method : str
        "fusion": onsets from the friction of all sensors together, to a part of a sample; or "speed".
    lost : tuple of str
        What could not be told, and why.
    status : str
        "ok", or in words what to beware of.
    """

    share: Estimate
    per_cycle: Estimate
    microslips: Estimate | None
    kind: str
    events: tuple[StickEvent, ...]
    threshold: float
    noise: float
    frequency: Estimate
    method: str
    lost: tuple[str, ...]
    status: str


def find_sticks(
    record: Record,
    *,
    contact: str | None = None,
    threshold: float | str | None = None,
    frequency: float | str | None = None,
    method: str | None = None,
) -> Sticks:
    """When does the contact stick, for what share of the time, how often per cycle?

    By "fusion" a stick begins where the velocity turns and the friction leaves its sliding value, and ends where the
    friction, carried on with the contact's spring, reaches it again (see
    :func:`~stickslip.cycle.sticks.find_holds`); where the mass gives way a little and holds again, it is a micro-slip
    within the stick. On a rig like the thesis's (4 kHz) sticks begin within 0.015 ms and slips within 0.03 ms, by
    motion sensors alone within 0.1 ms and 0.2 ms; an error of a sensor's lag is not in that.

    By "speed" alone:

    The contact may stick where its speed is below a threshold: five standard deviations of the velocity's noise, or 4
    % of the typical peak speed where that is larger, for below that creep and presliding of a compliant contact are
    not told from sticking. A motion that stays below three thresholds is part of the stick around it. A passage
    through zero is not a stick: at the acceleration with which the speed falls to the threshold before, and rises
    from it after, it would last ``(t_in + t_out) / 2``, with t_in and t_out the times between one and three
    thresholds; a stick lasts 2.5 times that at least, and longer than the smoothing of the velocity spreads a jump.

    Parameters
    ----------
    record : Record
        With ``x`` (or ``theta``, or ``v``); ``z`` for a contact on the base. Stated delays are taken out first. Onsets
        to a part of a sample, and micro-slips, need ``friction_force(record, ..., method="fusion")`` before, or
        "motion".
    contact : {"ground", "base"}, optional
        What the mass slides on, the speed being that against it; as :func:`friction_force` was told, or the ground,
        when not given.
    threshold : float or str, optional
        Speed [m/s or rad/s] below which the contact may stick; found from the record when not given.
    frequency : float or str, optional
        Forcing frequency [Hz]; found from the record when not given.
    method : {"fusion", "speed"}, optional
        By fusion where the record's friction allows it, when not given.

    Returns
    -------
    Sticks
        Where the method falls back, `lost` says what is lost by it.

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
    require_record(record)
    if method not in (None, *METHODS):
        raise EstimateError(f"method = '{method}'", f"it is one of {', '.join(METHODS)}", "choose one of them")
    record = without_delays(record, *motion_channels(record, contact), question=QUESTION)
    motion = contact_motion(record, contact=contact, question=QUESTION)
    holds, lost = ((), ()) if method == "speed" else _fused_holds(record, contact)
    if holds:
        noise = float(np.median(record["v_sd"])) if "v_sd" in record else motion.noise
        motion = replace(motion, velocity=record["v"], noise=noise, bandwidth=record.fs / 2)
    cycles = find_cycles(record, motion, frequency=frequency)
    limit, rule = _threshold(motion, cycles, threshold)
    stuck, certain = _stuck(motion, limit)
    if holds:
        events = _events_of(holds, stuck, motion, SLIPPED * limit)
        share = _share_of(events, cycles, motion)
    else:
        events = _events(stuck, certain, motion)
        share = _share(stuck, certain, cycles, rule, (f"the velocity's noise is {_words(motion.noise, motion)}",))
    sticks = [event for event in events if event.kind == "stick"]
    microslips = _microslips(events) if holds and any(event.whole for event in sticks) else None
    how = f"sticks begun in each cycle; {rule}"
    stops = mean_of_cycles("stops per cycle", _counted(sticks, cycles, motion), unit="1", method=how).within(0.0)
    status, used = _within_noise(limit, motion) or cycles.status, "fusion" if holds else "speed"
    kind, forcing = _kind(sticks, microslips), cycles.frequency
    return Sticks(share, stops, microslips, kind, events, limit, motion.noise, forcing, used, lost, status)


def _within_noise(limit: float, motion: Motion) -> str:
    noisy = AUDIBLE * motion.noise
    if limit >= noisy:
        return ""
    return f"the threshold is within the velocity's noise ({_words(noisy, motion)} is five deviations)"


def _kind(sticks: Sequence[StickEvent], microslips: Estimate | None) -> str:
    if microslips is not None and microslips.value > 0.5:
        return "double stick-slip"
    return "stick-slip" if sticks else "sliding"


def _threshold(motion: Motion, cycles: Cycles, threshold: float | str | None) -> tuple[float, str]:
    """Speed below which the contact may stick, and the rule in words."""
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
    rule = "five deviations of its noise" if noisy >= creep else f"{100 * CREEP:g} % of its peak, to pass over creep"
    return limit, f"time with the speed below {_words(limit, motion)} ({'given' if threshold is not None else rule})"


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


def _per_cycle(stuck: NDArray[np.bool_], cycles: Cycles) -> Array:
    """Share of each cycle in which `stuck` holds; a sample counts for the time around it."""
    total = np.concatenate([[0.0], np.cumsum(stuck)])
    at = np.interp(cycles.edges + 0.5, np.arange(len(total)), total)
    return np.asarray(np.diff(at) / np.diff(cycles.edges))


def _counted(sticks: Sequence[StickEvent], cycles: Cycles, motion: Motion) -> Array:
    middle = np.array([event.time + event.duration / 2 for event in sticks])
    counts, _ = np.histogram((middle - motion.start) * motion.fs, cycles.edges)
    return counts.astype(float)


def _events(stuck: NDArray[np.bool_], certain: NDArray[np.bool_], motion: Motion) -> tuple[StickEvent, ...]:
    """Sticks and slips by speed; a stick begins between where the speed is low and where it would reach zero."""
    turns = np.flatnonzero(np.diff(stuck)) + 1
    edges = np.concatenate([[0], turns, [len(stuck)]])
    sure, ends = stretches(certain & stuck)
    sds = np.zeros(len(edges))
    for j, turn in enumerate(turns, start=1):
        near = sure if stuck[turn] else ends  # a stick begins, or ends
        apart = float(np.min(np.abs(near - turn))) if len(near) else 0.0
        sds[j] = math.hypot(apart, motion.blur) / math.sqrt(3) / motion.fs
    return tuple(
        StickEvent(
            float(motion.start + first / motion.fs),
            "stick" if stuck[first] else "slip",
            float((last - first) / motion.fs),
            bool(first > 0 and last < len(stuck)),
            float(begin_sd),
            math.hypot(begin_sd, end_sd),
        )
        for first, last, begin_sd, end_sd in zip(edges[:-1], edges[1:], sds[:-1], sds[1:], strict=True)
    )


# ---- from the holds of the contact


def _fused_holds(record: Record, contact: str | None) -> tuple[tuple[Hold, ...], tuple[str, ...]]:
    """The holds of a contact whose friction was found by all sensors together; and what is lost where it was not."""
    rig = record.rig
    unseen = "onsets are told to the threshold only and micro-slips not at all"
    if "friction" not in record or rig is None or rig.method not in FUSIONS:
        return (), (f'{unseen}: for them call friction_force(record, ..., method="fusion") first',)
    if slid_on(record, contact) == "base":
        return (), (
            f"{unseen}: the contact is on the moving base, and the sensors together tell what rubs on the ground",
        )
    holds = find_holds(Trace.of(record))
    if not holds:
        return (), (
            f"{unseen}: the contact's holds are shorter than four samples at {record.fs:g} Hz, or there are none",
        )
    cell = "load" in record and rig.method != "motion"
    lost = [] if cell else ["without a load cell onsets are three to ten times less sure"]
    shortest = record.fs * min(hold.end - hold.begin for hold in holds)
    if shortest < SHORT:
        lost.append(f"holds last {shortest:.0f} samples at {record.fs:g} Hz, and shorter ones are missed")
    return holds, (*lost, *rig.lost)


def _events_of(
    holds: tuple[Hold, ...], stuck: NDArray[np.bool_], motion: Motion, fast: float
) -> tuple[StickEvent, ...]:
    """Sticks, the micro-slips within them, short holds and slips, in turn; a slip is micro where it never gets fast."""

    def rows(begin: float, end: float) -> slice:
        return slice(max(0, math.ceil((begin - motion.start) * motion.fs)), math.ceil((end - motion.start) * motion.fs))

    spells: list[list[Hold]] = [[holds[0]]]
    for hold in holds[1:]:
        between = np.abs(motion.velocity[rows(spells[-1][-1].end, hold.begin)])
        if between.max(initial=0.0) < fast:
            spells[-1].append(hold)
        else:
            spells.append([hold])
    first, last = motion.start, motion.start + len(stuck) / motion.fs
    begins, ends = (motion.start + stretch / motion.fs for stretch in stretches(stuck))
    unseen = motion.blur / motion.fs
    edges = [  # a stick that the record cuts has no hold of its own
        [Hold(begin, end, unseen, unseen)]
        for begin, end in zip(begins, ends, strict=True)
        if not any(spell[0].begin < end and begin < spell[-1].end for spell in spells)
    ]
    events: list[StickEvent] = []
    free = Hold(first, first, 0.0, 0.0)
    for spell in sorted(spells + edges, key=lambda event: event[0].begin):
        events += _slip(free, spell[0], first, last)
        begin, end = spell[0], spell[-1]
        kind = "stick" if stuck[rows(begin.begin, end.end)].any() else "microstick"
        whole = begin.begin > first and end.end < last
        events.append(_event(kind, (begin.begin, begin.begin_sd), (end.end, end.end_sd), whole))
        events += [
            _event("microslip", (one.end, one.end_sd), (next_.begin, next_.begin_sd), True)
            for one, next_ in pairwise(spell)
        ]
        free = end
    return (*events, *_slip(free, Hold(last, last, 0.0, 0.0), first, last))


def _slip(before: Hold, after: Hold, first: float, last: float) -> list[StickEvent]:
    if after.begin <= before.end:
        return []
    whole = before.end > first and after.begin < last
    return [_event("slip", (before.end, before.end_sd), (after.begin, after.begin_sd), whole)]


def _event(kind: str, begin: tuple[float, float], end: tuple[float, float], whole: bool) -> StickEvent:
    return StickEvent(
        float(begin[0]), kind, float(end[0] - begin[0]), bool(whole), float(begin[1]), math.hypot(begin[1], end[1])
    )


def _share_of(events: tuple[StickEvent, ...], cycles: Cycles, motion: Motion) -> Estimate:
    """Share of each cycle's time in which the contact holds; a micro-slip is taken off the stick it lies in."""
    stuck = _time_in(("stick", "microstick"), events, cycles, motion) - _time_in(("microslip",), events, cycles, motion)
    return mean_of_cycles(
        "stuck share of the time",
        stuck / np.diff(cycles.edges),
        unit="1",
        method="mean of cycles; the contact holds from where the velocity turns to where the friction reaches its "
        "limit, a micro-slip within a stick taken off",
    ).within(0.0, 1.0)


def _time_in(kinds: tuple[str, ...], events: tuple[StickEvent, ...], cycles: Cycles, motion: Motion) -> Array:
    """Samples of each cycle within events of some kinds, which do not overlap."""
    inside = [event for event in events if event.kind in kinds]
    begins = motion.fs * np.array([event.time - motion.start for event in inside])
    lengths = motion.fs * np.array([event.duration for event in inside])
    knots = np.column_stack([begins, begins + lengths]).ravel()
    total = np.column_stack([np.cumsum(lengths) - lengths, np.cumsum(lengths)]).ravel()
    return np.asarray(np.diff(np.interp(cycles.edges, [0.0, *knots], [0.0, *total])))


def _microslips(events: tuple[StickEvent, ...]) -> Estimate:
    """How many lie in each whole stick."""
    slips = np.array([event.time for event in events if event.kind == "microslip"])
    sticks = [event for event in events if event.kind == "stick" and event.whole]
    counts = [float(np.sum((stick.time < slips) & (slips < stick.time + stick.duration))) for stick in sticks]
    method = "turns of the velocity within a stick"
    return mean_of_cycles("micro-slips per stick", counts, unit="1", method=method).within(0.0)
