"""The check-up: what is wrong with a record, in words, with row numbers and the function that mends it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array, Mask, Rows
from stickslip.record import flaws
from stickslip.record.clock import BRIDGED, Stamps, fit_line, inspect, is_uniform
from stickslip.record.flaws import Runs

if TYPE_CHECKING:
    from stickslip.record.record import Record


SHORTEST = 32  # samples below which no question about friction can be answered
NAMED = 8  # constant channels named in one sentence
DRIFT = 0.3  # rise of the trend, in amplitudes of the oscillation, from which it is told
COMPUTED = ("friction_force", "analyze_joint")  # sources of a friction that no sensor felt, which could clip
SHARP_UNITS = ("m/s", "rad/s", "N", "N m")  # what may have plateaus with corners by nature: sticking, saturation


@dataclass(frozen=True)
class Fault:
    """One thing wrong with a record.

    Attributes
    ----------
    kind : str
        "short", "unit", "clock", "rate", "backwards", "repeated stamps", "jitter", "gap", "missing", "constant",
        "clipped", "frozen", "spike", "drift", "coarse" or "cut".
    channel : str or None
        The channel it is in; None for the clock, and for three or more channels that are all constant.
    rows : tuple of (first, last)
        All runs of rows concerned, both ends included, counted from 0.
    message : str
        One sentence: what, where, how much, and what mends it.
    severity : str
        "error" where questions are refused until it is mended, "warning" where they are answered with less trust.
    repair : str
        The name by which :func:`~stickslip.answers.mend` and ``--repair`` know what mends it; empty where nothing does.

    Examples
    --------
    >>> from stickslip.record.record import Record
    >>> wave = np.sin(0.2 * np.arange(400))
    >>> wave[100:103] = np.nan
    >>> print(Record.of({"x": wave}, fs=100.0).check()[0])
    channel x has 3 values that are not numbers (rows 100 to 102); fill them with fill_missing(record).
    """

    kind: str
    channel: str | None
    rows: Runs
    message: str
    severity: str = "warning"
    repair: str = ""

    def __str__(self) -> str:
        return self.message

    def __repr__(self) -> str:
        where = f" in {self.channel}" if self.channel else ""
        return f"Fault({self.severity}: {self.kind}{where}, {in_words(self.rows)})"


def find_faults(record: Record) -> list[Fault]:
    """What is wrong with a record; empty when nothing is.

    A unit that nobody stated is told with what the channel spans in the one taken, and what a file was found to lack
    when it was read. The clock is checked for stamps that stand still and jump, go back, repeat, jitter, are lost, or
    leave gaps; each channel for values that are no numbers, a constant, clipping, frozen samples, spikes, drift, and
    too few levels. A plateau of a stuck mass, a friction force's square wave, a sensor's steps, and rest at the end of
    a decay are no faults.

    Parameters
    ----------
    record : Record

    Returns
    -------
    list of Fault
        Errors first, the clock before the channels.

    Examples
    --------
    >>> from stickslip.record.record import Record
    >>> [fault.kind for fault in find_faults(Record.of({"x": [1.0] * 100}, fs=50.0))]
    ['constant']
    """
    faults = [*_short(record), *_unstated(record), *_cut(record)]
    with np.errstate(over="ignore", invalid="ignore"):  # a damaged file holds 1e300: its square is no news
        if record.stamps is not None and not is_uniform(record.stamps):
            faults += _clock_faults(record.stamps)
        for name in record:
            channel = record.channels[name]
            felt = name != "friction" or channel.source not in COMPUTED
            faults += _channel_faults(name, channel.unit, record[name], felt=felt)
    return sorted(_folded(record, faults), key=lambda fault: fault.severity != "error")


def _folded(record: Record, faults: list[Fault]) -> list[Fault]:
    """The faults, with three or more constant channels as one."""
    names = [fault.channel for fault in faults if fault.kind == "constant" and fault.channel]
    if len(names) < 3:
        return faults
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    message = (
        f"{len(names)} of {len(record.channels)} channels are constant throughout ({', '.join(names[:NAMED])}{more}); "
        "look at their cables, ranges and columns."
    )
    folded = Fault("constant", None, ((0, len(record) - 1),), message)
    return [*(fault for fault in faults if fault.kind != "constant"), folded]


def in_words(runs: Runs, most: int = 5) -> str:
    """Rows for a sentence: the first few runs, and how many more there are.

    Examples
    --------
    >>> in_words(((3, 3), (7, 9)))
    'rows 3, 7 to 9'
    """
    parts = [f"{first}" if first == last else f"{first} to {last}" for first, last in runs[:most]]
    more = f" and {len(runs) - most} more places" if len(runs) > most else ""
    single = len(runs) == 1 and runs[0][0] == runs[0][1]
    return f"{'row' if single else 'rows'} {', '.join(parts)}{more}"


def _short(record: Record) -> list[Fault]:
    if len(record) >= SHORTEST:
        return []
    message = f"the record has {len(record)} samples, too few for any question about friction; record for longer."
    return [Fault("short", None, ((0, len(record) - 1),), message, "error")]


def _cut(record: Record) -> list[Fault]:
    """What the files that were read were found to lack."""
    last = len(record) - 1
    files = [file for step in record.history for file in step.arguments.get("files", ()) if file.get("cut")]
    return [Fault("cut", None, ((last, last),), f"'{file['name']}': {file['cut']}.") for file in files]


# ---- the clock


def _clock_faults(stamps: Array) -> list[Fault]:
    clock, mended = inspect(stamps), ("clock", "repair_clock(record)")
    filled = ("gaps", _filling(stamps, clock))
    usual = f"{1e3 * clock.step:.4g} ms"
    known = np.flatnonzero(np.isfinite(stamps))
    intervals, rows = np.full(len(stamps), np.nan), np.ones(len(stamps))  # from each stamp to the next that is a number
    intervals[known[:-1]], rows[known[:-1]] = np.diff(stamps[known]), np.diff(known)
    faults: list[Fault] = []
    if len(clock.missing):
        what = _several(len(clock.missing), "time stamp is not a number", "time stamps are not numbers")
        faults.append(_clock_fault("missing", _pairs(clock.missing, 0), what, mended))
    if clock.held:
        what = _standing_still(stamps)
        faults.append(_clock_fault("clock", _pairs(clock.repeated), what, mended, verb="relabel them"))
    elif len(clock.repeated):
        what = _several(len(clock.repeated), "time stamp repeats", "time stamps repeat") + " the one before"
        faults.append(_clock_fault("repeated stamps", _pairs(clock.repeated), what, mended))
    if len(clock.backward):
        back = float(np.min(intervals[clock.backward]))
        what = f"the time goes back {_several(len(clock.backward), 'time', 'times')}, by up to {-back:.4g} s"
        faults.append(_clock_fault("backwards", _pairs(clock.backward), what, mended))
    if len(clock.slower):
        slow = float(np.median(intervals[clock.slower]))
        what = f"{len(clock.slower)} intervals of {1e3 * slow:.4g} ms where the others are {usual} long"
        longer = f"fill_gaps(record, longest={2 * slow:.2g}), or cut them off with record.rows()"
        faults.append(_clock_fault("rate", _pairs(clock.slower), what, ("gaps", longer)))
    if len(clock.gaps):
        lengths = intervals[clock.gaps]
        lost = float(np.sum(np.maximum(1, np.round(lengths / clock.step) - rows[clock.gaps])))
        many = _several(int(lost), "sample", "samples") if lost < 1e9 else f"{lost:.2g} samples"
        what = (
            f"{_several(len(clock.gaps), 'gap', 'gaps')} of up to {1e3 * np.max(lengths):.4g} ms "
            f"where samples come every {usual}, about {many} lost"
        )
        faults.append(_clock_fault("gap", _pairs(clock.gaps), what, filled))
    if len(clock.uneven):
        off = 100 * np.max(np.abs(intervals[clock.uneven] / clock.step - 1))
        many = _several(len(clock.uneven), "interval is uneven", "intervals are uneven")
        what = f"{many}, off by up to {off:.2g} % of {usual}"
        faults.append(_clock_fault("jitter", _pairs(clock.uneven), what, filled if len(clock.gaps) else mended))
    return faults


def _standing_still(stamps: Array) -> str:
    jumps = np.flatnonzero(np.diff(stamps) > 0)
    block = np.diff(jumps)
    low, high = np.percentile(block, [10, 90]) if len(block) else (len(stamps), len(stamps))
    line = fit_line(stamps)
    return (
        f"the time stamps stand still for {low:.0f} to {high:.0f} rows and then jump by "
        f"{1e3 * float(np.median(np.diff(stamps)[jumps])):.3g} ms; the true rate is about {line.fs:.4g} Hz"
    )


def _clock_fault(kind: str, runs: Runs, what: str, cure: tuple[str, str], *, verb: str = "mend the clock") -> Fault:
    """A fault of the clock; `cure` is the repair's name and how it is called."""
    repair, call = cure
    return Fault(kind, None, runs, f"{what} ({in_words(runs)}); {verb} with {call}.", "error", repair)


def _pairs(first: Rows, width: int = 1) -> Runs:
    """Runs that cover each row and the `width` rows after it, merged where they touch."""
    if not len(first):
        return ()
    mask = np.zeros(int(first[-1]) + width + 1, dtype=bool)
    for shift in range(width + 1):
        mask[first + shift] = True
    return flaws.runs_of(mask)


# ---- the channels


def _unstated(record: Record) -> list[Fault]:
    """The clock and the channels whose unit nobody stated, with what they span in the one that was taken."""
    finite = {name: record[name][np.isfinite(record[name])] for name, entry in record.channels.items() if entry.assumed}
    spans = {name: (record.channels[name].unit, float(np.ptp(v))) for name, v in finite.items() if len(v)}
    if not spans:
        return _clock_unstated(record)
    names, units = list(spans), _listed([unit for unit, _ in spans.values()])
    spanned = _listed([_number(span, ".3g", unit) for unit, span in spans.values()])
    several = len(names) > 1
    read = f"state no unit: read as {units} they span" if several else f"states no unit: read as {units} it spans"
    message = (
        f"{_listed(names)} {read} {spanned}; if {'they are in others' if several else 'it is in another'}, say which, "
        f'as in channels={{"{names[0]}": "COLUMN [UNIT]"}}.'
    )
    channel = None if several else names[0]
    return [*_clock_unstated(record), Fault("unit", channel, ((0, len(record) - 1),), message)]


def _listed(parts: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(parts[:-1]), parts[-1])))


def _clock_unstated(record: Record) -> list[Fault]:
    """The time column whose unit nobody stated: the same for milliseconds and seconds."""
    files = [file for step in record.history for file in step.arguments.get("files", ()) if file.get("seconds")]
    if not files:
        return []
    name = files[0]["seconds"]
    message = (
        f"{name} states no unit: read as s it gives {record.fs:.4g} samples a second for {record.duration:.4g} s; "
        f'if it is in another, say which, as in time="{name} [ms]".'
    )
    return [Fault("unit", None, ((0, len(record) - 1),), message)]


def _channel_faults(name: str, unit: str, values: Array, *, felt: bool) -> list[Fault]:
    lost = ~np.isfinite(values)
    faults = []
    if lost.any():
        what = _several(int(lost.sum()), "value that is not a number", "values that are not numbers")
        repair = "missing" if flaws.missing(values)[0] else ""
        faults.append(_fault("missing", name, flaws.runs_of(lost), what, cure(values), repair, "error"))
    if lost.all() or len(values) < 3:
        return faults
    if lost.any():
        values = flaws.held_over(values, lost)
    if flaws.constant(values):
        message = (
            f"channel {name} is constant at {_number(values[0], '.6g', unit)} throughout; "
            "look at its cable, range and column."
        )
        return [*faults, Fault("constant", name, ((0, len(values) - 1),), message)]
    return faults + [fault for fault in _shape_faults(name, unit, values, felt=felt) if not _inside(fault.rows, lost)]


def cure(values: Array) -> str:
    """What to do about values that are not numbers: fill short runs, cut off those at an end, keep a part else."""
    numbers = np.flatnonzero(np.isfinite(values))
    if not len(numbers):
        return "look at its cable, range and column, or leave it out"
    short, long, ends = flaws.missing(values)
    cures = [f"cut those at the ends off with record.rows({numbers[0]}, {numbers[-1] + 1})"] if ends else []
    if long:
        cures.append(
            f"{in_words(long)} are too many in a row to be told by what lies around them "
            f"(more than {flaws.bridgeable(values)}): keep a part without them with record.rows()"
        )
    if short:
        cures.append(("fill the others" if cures else "fill them") + " with fill_missing(record)")
    return "; ".join(cures)


def clock_cure(stamps: Array) -> str:
    """What to do about time stamps that are not uniform."""
    clock = inspect(stamps)
    if clock.held or len(clock.missing) or len(clock.repeated) or len(clock.backward):
        return "mend the clock with repair_clock(record)"
    if len(clock.slower):
        edges = np.concatenate([[0], clock.slower + 1, [len(stamps)]])
        longest = int(np.argmax(np.diff(edges)))
        one_rate = f"record.rows({edges[longest]}, {edges[longest + 1]})"
        return f"keep those of one rate with {one_rate}, or fill in with fill_gaps(record) and fill_missing(record)"
    if len(clock.gaps):
        return f"fill the gaps with {_filling(stamps, clock)}"
    return "mend the clock with repair_clock(record)"


def _filling(stamps: Array, clock: Stamps) -> str:
    """How gaps are filled; the stamps leave long ones without numbers."""
    long = bool(np.any(np.diff(stamps)[clock.gaps] > BRIDGED * clock.step))
    return f"fill_gaps(record){' and fill_missing(record)' * long}"


def _shape_faults(name: str, unit: str, values: Array, *, felt: bool) -> list[Fault]:
    everywhere = ((0, len(values) - 1),)
    few = flaws.levels_used(values)
    if few is not None:
        what = f"only {few} steps of the sensor across its whole motion"
        return [_fault("coarse", name, everywhere, what, "choose a finer range of the instrument")]
    faults = []
    spikes = flaws.spikes(values)
    if spikes:
        what = _several(_count(spikes), "sample that stands off as a spike", "samples that stand off as spikes")
        cure = f'replace them with remove_spikes(record, "{name}")'
        faults.append(_fault("spike", name, spikes, what, cure, "spikes"))
        values = flaws.held_over(values, flaws.rows_of(spikes, len(values)))
    cut = _clipped(name, unit, values) if felt else None
    if cut is not None:
        faults.append(cut)
    top = flaws.rows_of(cut.rows if cut is not None else (), len(values))
    frozen = tuple(run for run in flaws.frozen(values) if not top[run[0] : run[1] + 1].any())
    if frozen and name != "friction":  # at rest it bears what pulls, which may stand still
        longest = max(last - first + 1 for first, last in frozen)
        what = f"samples frozen while the signal moved on, for up to {longest} rows"
        faults.append(_fault("frozen", name, frozen, what, f'make them NaN and use fill_missing(record, "{name}")'))
    rise = flaws.drift(values)
    if rise > DRIFT:
        what = f"a drift of {rise:.2g} times the oscillation's amplitude over the record"
        cure = f'take it off with remove_drift(record, "{name}")'
        faults.append(_fault("drift", name, everywhere, what, cure, "drift"))
    return faults


def find_clipping(record: Record, name: str) -> Fault | None:
    """Where a channel of numbers alone stands at the end of its sensor's range; the one fault, without the others."""
    clipped = (fault for fault in record.check() if fault.kind == "clipped" and fault.channel == name)
    return next(clipped, None)


def _clipped(name: str, unit: str, values: Array) -> Fault | None:
    cut = flaws.clipped(values, plateaus=unit in SHARP_UNITS)
    if not cut:
        return None
    what = _several(_count(cut), "sample", "samples") + f" clipped near {_number(values[cut[0][0]], '.4g', unit)}"
    cure = f'mark or rebuild them with restore_clipped(record, "{name}")'
    return _fault("clipped", name, cut, what, cure, "clipping")


def _number(value: float, digits: str, unit: str) -> str:
    """A number with its unit, where it has one."""
    return f"{value:{digits}} {'' if unit == '1' else unit}".rstrip()


def _several(count: int, one: str, many: str) -> str:
    return f"{count} {one if count == 1 else many}"


def _count(runs: Runs) -> int:
    return sum(last - first + 1 for first, last in runs)


def _fault(
    kind: str, name: str, runs: Runs, what: str, cure: str, repair: str = "", severity: str = "warning"
) -> Fault:
    return Fault(kind, name, runs, f"channel {name} has {what} ({in_words(runs)}); {cure}.", severity, repair)


def _inside(runs: Runs, lost: Mask) -> bool:
    """Whether all runs lie where values were missing anyway."""
    return all(lost[first : last + 1].any() for first, last in runs) and bool(runs)
