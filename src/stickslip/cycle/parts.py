"""Records longer than memory: stretches with their surroundings, and what was found in them put together."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.cycle.sticks import StickEvent, Sticks
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import FEW, NORMAL_95, Estimate, Status, kinds
from stickslip.record.record import Record, Step

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
