"""When does a contact stick, for how long, and how often? Of records longer than memory, too, part by part."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stickslip.arrays import Array, Mask, stretches
from stickslip.balance.motion import AUDIBLE, CREEP, Cycles, Motion, contact_motion, find_cycles, motion_channels
from stickslip.cycle.holds import Hold, fused_holds
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import FEW, NORMAL_95, Estimate, Result, Status, kinds
from stickslip.record.record import Record, Step, require_record
from stickslip.signals.interpolate import without_delays
from stickslip.statistics import mean_of_cycles
from stickslip.units import parse_value

QUESTION = "sticks and slips"
METHODS = ("fusion", "speed")
SLIPPED = 3.0  # times the threshold: a motion that never gets there is creep or noise within a stick
DWELL = 2.5  # times the duration of a passage through zero, from which on it is a stick
# Of the typical peak speed, where nothing creeps: far below, what the smoother leaves at a rest is taken for motion.
STILL = 0.005
FASTEST = 3  # samples: nothing shorter is told from a reversal


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
    creeps: bool = True,
) -> Sticks:
    """When does the contact stick, for what share of the time, how often per cycle?

    By "fusion" a stick begins where the velocity turns and the friction leaves its sliding value, and ends where the
    friction, carried on with the contact's spring, reaches it again (see
    :func:`~stickslip.cycle.holds.find_holds`); where the mass gives way a little and holds again, it is a micro-slip
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
    creeps : bool, optional
        Whether what sticks may creep, or give way, faster than 0.5 % of the typical peak speed; a gear does not.

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
    holds, lost = ((), ()) if method == "speed" else fused_holds(record, contact)
    if holds:
        noise = float(np.median(record["v_sd"])) if "v_sd" in record else motion.noise
        motion = replace(motion, velocity=record["v"], noise=noise, bandwidth=record.fs / 2)
    cycles = find_cycles(record, motion, frequency=frequency)
    limit, rule = _threshold(motion, cycles, threshold, CREEP if creeps else STILL)
    stuck, certain = _stuck(motion, limit)
    if holds:
        events = _events_of(holds, stuck, motion, SLIPPED * limit)
        share = _share_of(events, cycles, motion)
    else:
        events = _events(stuck, certain, motion)
        share = _share(stuck, certain, cycles, rule, (f"the velocity's noise is {_words(motion.noise, motion)}",))
    sticks = [event for event in events if event.kind == "stick"]
    microslips = _microslips(events) if holds and any(event.whole for event in sticks) else None
    short = sum(event.kind == "microstick" for event in events)
    stops = mean_of_cycles(
        "stops per cycle",
        _counted(sticks, cycles, motion),
        unit="1",
        method=f"sticks begun in each cycle; {rule}",
        checks=(f"{short} holds at a mere reversal, which the share of the time counts, are no stop",) * (short > 0),
    ).within(0.0)
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


def _threshold(motion: Motion, cycles: Cycles, threshold: float | str | None, share: float) -> tuple[float, str]:
    """Speed below which the contact may stick, and the rule in words."""
    noisy, creep = AUDIBLE * motion.noise, share * cycles.peak
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
    rule = "five deviations of its noise" if noisy >= creep else f"{100 * share:g} % of its peak, to pass over creep"
    return limit, f"time with the speed below {_words(limit, motion)} ({'given' if threshold is not None else rule})"


def _words(speed: float, motion: Motion) -> str:
    return f"{1e3 * speed:.3g} mm/s" if motion.unit == "m" else f"{speed:.3g} rad/s"


def _stuck(motion: Motion, limit: float) -> tuple[Mask, Mask]:
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


def _share(stuck: Mask, certain: Mask, cycles: Cycles, rule: str, stated: tuple[str, ...]) -> Estimate:
    name = "stuck share of the time"
    above, below = (
        mean_of_cycles(name, _per_cycle(part, cycles), unit="1", method=f"mean of cycles; {rule}", checks=stated)
        for part in (stuck, certain)
    )
    low, high = max(0.0, below.interval[0]), min(1.0, above.interval[1])
    sd = (high - low) / (2 * NORMAL_95)
    return Estimate(name, above.value, (low, high), sd, "1", above.method, above.status, above.checks)


def _per_cycle(stuck: Mask, cycles: Cycles) -> Array:
    """Share of each cycle in which `stuck` holds; a sample counts for the time around it."""
    total = np.concatenate([[0.0], np.cumsum(stuck)])
    at = np.interp(cycles.edges + 0.5, np.arange(len(total)), total)
    return np.asarray(np.diff(at) / np.diff(cycles.edges))


def _counted(sticks: Sequence[StickEvent], cycles: Cycles, motion: Motion) -> Array:
    middle = np.array([event.time + event.duration / 2 for event in sticks])
    counts, _ = np.histogram((middle - motion.start) * motion.fs, cycles.edges)
    return counts.astype(float)


def _events(stuck: Mask, certain: Mask, motion: Motion) -> tuple[StickEvent, ...]:
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


def _events_of(holds: tuple[Hold, ...], stuck: Mask, motion: Motion, fast: float) -> tuple[StickEvent, ...]:
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
    sd = math.hypot(begin[1], end[1])
    return StickEvent(float(begin[0]), kind, float(end[0] - begin[0]), bool(whole), float(begin[1]), sd)


def _share_of(events: tuple[StickEvent, ...], cycles: Cycles, motion: Motion) -> Estimate:
    """Share of each cycle's time in which the contact holds; a micro-slip is taken off the stick it lies in."""
    stuck = _time_in(("stick", "microstick"), events, cycles, motion) - _time_in(("microslip",), events, cycles, motion)
    return mean_of_cycles(
        "stuck share of the time",
        stuck / np.diff(cycles.edges),
        unit="1",
        method="mean of cycles; the contact holds from where the velocity turns to where the friction reaches its "
        "limit, at a mere reversal too; a micro-slip within a stick is taken off",
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


TOGETHER = 0.5  # of a stretch: a rest that is shorter goes with the one before


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a long record, with surroundings that settle its ends.

    Attributes
    ----------
    record : Record
        The part and its surroundings.
    first, last : float
        The time that is its own [s]; the last stretch ends with the record.
    """

    record: Record
    first: float
    last: float


def overlapping(parts: Record | Iterable[Record], *, seconds: float = 60.0, overlap: float = 1.0) -> Iterator[Stretch]:
    """Cut a record, or its parts in order, into stretches that overlap.

    Parameters
    ----------
    parts : Record or iterable of Record
        A record, or its parts in order, as :func:`read_blocks` yields them: no more than a stretch and a part of it
        is held at a time.
    seconds : float
        Length of a stretch [s].
    overlap : float
        What is added to either side of it [s]: longer than an event, and than the sensors take to settle.

    Yields
    ------
    Stretch

    Raises
    ------
    RecordError
        Parts that do not follow each other, or a broken clock.
    EstimateError
        A length that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> record = Record.of({"x": np.arange(1000.0)}, fs=100)
    >>> [(each.first, each.last, len(each.record)) for each in overlapping(record, seconds=4, overlap=0.5)]
    [(0.0, 4.0, 450), (4.0, 8.0, 500), (8.0, 10.0, 250)]
    """
    if not (seconds > 0 and 0 <= overlap < math.inf):
        raise EstimateError(
            f"stretches of {seconds} s that overlap by {overlap} s", "lengths are positive", "pass seconds"
        )
    gathered: Record | None = None
    first = math.nan
    for part in [parts] if isinstance(parts, Record) else parts:
        if part.stamps is not None:
            part.require_clean(question="a record in parts")
        gathered = part if gathered is None else _joined(gathered, part)
        first = gathered.start if math.isnan(first) else first
        while gathered.start + gathered.duration >= first + seconds + max(overlap, TOGETHER * seconds):
            yield Stretch(gathered.rows(0, _row(gathered, first + seconds + overlap)), first, first + seconds)
            first += seconds
            gathered = gathered.rows(max(0, _row(gathered, first - overlap)))
    if gathered is None:
        raise RecordError("no parts of a record", "one at least is needed", "check the file")
    yield Stretch(gathered, first, gathered.start + gathered.duration)


def _row(record: Record, time: float) -> int:
    return round((time - record.start) * record.fs)


def _joined(before: Record, after: Record) -> Record:
    gap = (after.start - before.start) * before.fs - len(before)
    if list(before) != list(after) or before.fs != after.fs or abs(gap) > 0.5:
        raise RecordError(
            f"a part from {after.start:g} s on after one up to {before.start + before.duration:g} s",
            "the parts of a record follow each other, with the same channels at the same rate",
            "give them in order, as read_blocks yields them",
        )
    samples = {name: np.concatenate([before[name], after[name]]) for name in before}
    joined = replace(before, history=before.history[:1])  # not a step for every part
    return joined.with_samples(samples, Step("overlapping", {}, "parts of a long record put together"))


def join_sticks(parts: Iterable[tuple[Stretch, Sticks]]) -> Sticks:
    """What was found in the stretches of a record, as if it had been found in the whole.

    Parameters
    ----------
    parts : iterable of (Stretch, Sticks)
        In order, what :func:`find_sticks` reason of each.

    Returns
    -------
    Sticks
        Its estimates are means over the stretches, weighed by their length.

    Raises
    ------
    EstimateError
        No stretch.

    Examples
    --------
    >>> import numpy as np
    >>> from stickslip.cycle.sticks import find_sticks
    >>> t = np.arange(40000) / 1000
    >>> drive = np.sin(2 * np.pi * t)
    >>> x = np.cumsum(np.maximum(np.abs(drive) - 0.5, 0) * np.sign(drive)) / 1000
    >>> record = Record.of({"x": x + 1e-6 * np.random.default_rng(0).standard_normal(t.size)}, fs=1000)
    >>> joined = join_sticks((each, find_sticks(each.record)) for each in overlapping(record, seconds=10))
    >>> len(joined.events) == len(find_sticks(record).events)
    True
    """
    events: list[StickEvent] = []
    kept: list[Sticks] = []
    spans: list[float] = []
    for stretch, sticks in parts:
        _extend(events, sticks.events, stretch)
        kept.append(replace(sticks, events=()))
        spans.append(stretch.last - stretch.first)
    if not kept:
        raise EstimateError("no stretch of a record", "one at least is needed", "check the file")
    microslips = [(pair.microslips, span) for pair, span in zip(kept, spans, strict=True) if pair.microslips]
    lost = {reason: sum(reason in part.lost for part in kept) for part in kept for reason in part.lost}
    kinds = [part.kind for part in kept]
    method = "fusion" if all(part.method == "fusion" for part in kept) else "speed"
    return Sticks(
        share=_pooled([part.share for part in kept], spans, shared=method == "speed"),
        per_cycle=_pooled([part.per_cycle for part in kept], spans),
        microslips=_pooled(*(list(part) for part in zip(*microslips, strict=True))) if microslips else None,
        kind=max(kinds, key=lambda kind: sum(s for k, s in zip(kinds, spans, strict=True) if k == kind)),
        events=tuple(events),
        threshold=float(np.median([part.threshold for part in kept])),
        noise=float(np.median([part.noise for part in kept])),
        frequency=_pooled([part.frequency for part in kept], spans),
        method=method,
        lost=tuple(_often(reason, count, len(kept)) for reason, count in lost.items()),
        status=_together([part.status for part in kept], len(kept)),
    )


def _extend(events: list[StickEvent], more: Sequence[StickEvent], stretch: Stretch) -> None:
    """Add the events that begin in a stretch's own time; one that a stretch's end had cut goes on in the next."""
    for event in more:
        last = next((event for event in reversed(events) if event.kind != "microslip"), None)
        end = event.time + event.duration
        cut = last is not None and not last.whole and last.time + last.duration < end
        if last is not None and cut and event.kind == last.kind and event.time <= last.time + last.duration:
            at = len(events) - 1 - events[::-1].index(last)
            events[at] = replace(last, duration=end - last.time, whole=event.whole, duration_sd=event.duration_sd)
        elif stretch.first <= event.time < stretch.last:
            events.append(event)


def _together(statuses: Sequence[str], all_: int) -> str:
    """Every status that is not ok, with how many stretches say so."""
    bad = Counter(reason for reason in statuses if reason != "ok")
    return Status(*(_often(reason, count, all_) for reason, count in bad.items()))


def _often(reason: str, count: int, all_: int) -> str:
    return reason if count == all_ else f"{reason} (in {count} of {all_} stretches)"


def _pooled(parts: list[Estimate], spans: list[float], *, shared: bool = False) -> Estimate:
    """The mean weighed by length, as sure as the stretches are, or as their scatter lets it be.

    With `shared` all of them are unsure for one reason (a threshold), which no mean takes away.
    """
    weights = np.array(spans) / np.sum(spans)
    values, sds = np.array([part.value for part in parts]), np.array([part.sd for part in parts])
    value = float(weights @ values)
    scatter = math.sqrt(float(weights @ (values - value) ** 2) / max(1, len(parts) - 1))
    sd = max(float(np.sqrt(weights**2 @ sds**2)), scatter)
    # that few cycles carry one stretch is healed by the others, unless there are few in all
    few = len(parts) > 1 and not all(FEW in kinds(part.status) for part in parts)
    status = _together([part.status for part in parts if not (few and FEW in kinds(part.status))], len(parts))
    name, unit, method = parts[0].name, parts[0].unit, f"{parts[0].method}; mean of {len(parts)} stretches"
    if shared:
        low, high = (float(weights @ ends) for ends in np.transpose([part.interval for part in parts]))
        return Estimate(name, value, (low, high), (high - low) / (2 * NORMAL_95), unit, method, status)
    return Estimate.normal(name, value, sd=sd, unit=unit, method=method, status=status)
