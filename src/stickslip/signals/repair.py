"""Repairs, each asked for by name, each logged with what it did; the record given stays as it was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from stickslip.arrays import Array, Rows
from stickslip.errors import RecordError
from stickslip.record import flaws
from stickslip.record.check import SHARP_UNITS, in_words
from stickslip.record.clock import BRIDGED, Line, fit_line, inspect
from stickslip.record.record import Record, Step, require_record
from stickslip.signals.interpolate import band_limited, bridge

DERIVED = "friction_force"  # the source of channels that were computed from
SOURCES = ("x", "z", "v", "a", "force")
MOST_DEGREE = 6


def repair_clock(record: Record, *, fs: float | None = None, trust: str | None = None) -> Record:
    """Give a record one sampling rate where its stamps stand still and jump, repeat, go back or jitter.

    An instrument samples evenly; the host stamps late. The uniform clock ``start + k / fs`` is fitted to the stamps
    (Huber's line, see :func:`stickslip.record.clock.fit_line`) and the samples are kept as they are, on that clock.
    Where intervals jitter, the stamps may be right and the sampling uneven: the record itself tells, by which of the
    two clocks makes its channels smoother, and then the samples are interpolated from the stamps onto a uniform clock.

    Parameters
    ----------
    record : Record
    fs : float, optional
        The true rate [Hz] where it is known; fitted otherwise.
    trust : {"samples", "stamps"}, optional
        Whether the sampling is even ("samples": new stamps) or the stamps are right ("stamps": new, interpolated
        samples). Found from the record where left out.

    Returns
    -------
    Record
        On a uniform clock. Its last history step holds ``fs`` and ``fs_interval`` (95 %) [Hz].

    Raises
    ------
    RecordError
        Samples are missing (use :func:`fill_gaps`), or the stamps hold no rate.

    Examples
    --------
    >>> rows = np.arange(2000)
    >>> late = Record.of({"x": np.sin(0.1 * rows)}, fs=250.0)
    >>> late = Record(late.samples, late.channels, 250.0, stamps=np.ceil(rows / 250 / 0.062) * 0.062)
    >>> abs(repair_clock(late).fs - 250) < 1
    True
    """
    if trust not in (None, "samples", "stamps"):
        raise RecordError(f"trust = {trust!r}", "what can be trusted is 'samples' or 'stamps'", "choose one of them")
    if record.stamps is None:
        return _restated(record, fs)
    clock = inspect(record.stamps)
    gaps = np.sort(np.concatenate([clock.gaps, clock.slower]))
    if len(gaps) and trust != "samples":
        raise RecordError(
            f"the clock has {len(gaps)} gaps ({in_words(_runs(gaps))})",
            "a clock is repaired where all samples are there",
            "use fill_gaps(record), or trust='samples' if only the stamps jumped",
        )
    if np.sum(np.isfinite(record.stamps)) < 3 or not np.nanmax(np.diff(record.stamps)) > 0:
        raise RecordError(
            "the time stamps never advance", "a rate is found from stamps that do", "pass fs= when reading, in Hz"
        )
    line = fit_line(record.stamps)
    orderly = not (clock.held or len(clock.repeated) or len(clock.backward) or len(clock.missing))
    reason = "as asked"
    if trust is None:
        disorder = "samples", "the stamps stand still, repeat or go back"
        trust, reason = _trusted(record, record.stamps) if orderly else disorder
    if trust == "stamps":
        return _from_stamps(record, fs or 1 / clock.step, reason)
    if not clock.held and np.ptp(line.late) > 4 * clock.step:  # a clock set anew while recording
        step = clock.step
        line = Line(1 / step, (1 / step, 1 / step), float(record.stamps[np.isfinite(record.stamps)][0]), line.late)
    return _relabelled(record, line, fs, reason)


def _restated(record: Record, fs: float | None) -> Record:
    rate = record.fs if fs is None else float(fs)
    outcome = (
        "the clock was uniform already" if fs is None else f"the rate is {rate:g} Hz, not {record.fs:g} Hz, as stated"
    )
    return record.with_samples(record.samples, Step("repair_clock", {"fs": rate}, outcome, "clock"), fs=rate)


def _relabelled(record: Record, line: Line, fs: float | None, reason: str) -> Record:
    rate = line.fs if fs is None else float(fs)
    interval = line.fs_interval if fs is None else (rate, rate)
    arguments = {"fs": rate, "fs_interval": list(interval), "trust": "samples"}
    late = 1e3 * float(np.ptp(line.late))
    quoted = f"{rate:.5g} Hz (95 %: {interval[0]:.5g} to {interval[1]:.5g})"
    outcome = (
        f"{len(record)} samples put on a uniform clock of {quoted}; "
        f"the stamps lay within {late:.3g} ms of each other about it ({reason})"
    )
    step = Step("repair_clock", arguments, outcome, "clock")
    return record.with_samples(record.samples, step, fs=rate, start=line.start)


def _trusted(record: Record, stamps: Array) -> tuple[str, str]:
    """What is even: the sampling or the stamps, by which clock leaves the channels smoother."""
    ratios = []
    for name in record:
        values = record[name]
        if np.isfinite(values).all():
            rows = np.arange(len(values), dtype=float)
            by_stamps, by_rows = (_unsmoothness(values, times) for times in (stamps, rows))
            if min(by_stamps, by_rows) > 0:
                ratios.append(by_stamps / by_rows)
    ratio = float(np.exp(np.mean(np.log(ratios)))) if ratios else 1.0
    if ratio < 0.95:
        return "stamps", f"the channels are {1 / ratio:.2g} times as smooth on the stamps as on an even clock"
    if ratio > 1.05:
        return "samples", f"the channels are {ratio:.2g} times as smooth on an even clock as on the stamps"
    wander = float(np.std(fit_line(stamps).late)) > 3 * float(np.std(np.diff(stamps)))
    if wander:
        return "stamps", "the lateness adds up over the record, as an uneven loop's does"
    return "samples", "the lateness does not add up over the record, as an even clock's does not"


def _unsmoothness(values: Array, times: Array) -> float:
    """RMS of what the cubic through four neighbours, at the given times, leaves of each sample."""
    order = [0, 1, 3, 4]
    windows = np.lib.stride_tricks.sliding_window_view(times, 5)
    centre = windows[:, 2:3]
    rest = values[2:-2].copy()
    for k in order:
        others = [j for j in order if j != k]
        weight = np.prod((centre - windows[:, others]) / (windows[:, k : k + 1] - windows[:, others]), axis=1)
        rest -= weight * values[k : len(values) - 4 + k]
    return float(np.sqrt(np.mean(rest**2)))


def fill_gaps(record: Record, *, fs: float | None = None, longest: float | None = None) -> Record:
    """Put samples with lost or uneven instants onto a uniform clock, by their stamps.

    Between samples a local cubic (modified Akima) is followed. In a gap longer than `longest` nothing is known: the new
    samples there are NaN, so that the check-up still tells, unless `longest` says otherwise.

    Parameters
    ----------
    record : Record
        With stamps that are right where they exist; repeated ones are dropped, with their samples.
    fs : float, optional
        Rate of the new clock [Hz]; the usual one of the record where left out.
    longest : float, optional
        Longest gap [s] to bridge; six sampling intervals where left out.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        The stamps stand still and jump (use :func:`repair_clock`).

    Examples
    --------
    >>> kept = np.delete(np.arange(500), [100, 101, 102])
    >>> dropped = Record.of({"x": np.sin(0.1 * kept)}, fs=100.0)
    >>> dropped = Record(dropped.samples, dropped.channels, 100.0, stamps=kept / 100)
    >>> len(fill_gaps(dropped)), fill_gaps(dropped).fs
    (500, 100.0)
    """
    if record.stamps is None:
        step = Step("fill_gaps", {"fs": record.fs, "longest": longest}, "the clock was uniform already", "gaps")
        return record.with_samples(record.samples, step) if fs is None else resample(record, fs)
    clock = inspect(record.stamps)
    if clock.held or len(clock.backward):
        raise RecordError(
            "the time stamps stand still and jump, or go back",
            "gaps are filled by stamps that advance",
            "use repair_clock(record) first",
        )
    return _from_stamps(record, fs or 1 / clock.step, "gaps filled", longest, "gaps")


def _from_stamps(record: Record, fs: float, reason: str, longest: float | None = None, repair: str = "clock") -> Record:
    from scipy.interpolate import Akima1DInterpolator

    stamps = record.time
    keep = np.isfinite(stamps) & np.concatenate([[True], np.diff(stamps) > 0])
    times = stamps[keep]
    limit = BRIDGED / fs if longest is None else float(longest)
    grid = times[0] + np.arange(int(np.floor((times[-1] - times[0]) * fs * (1 + 1e-12) + 1e-6)) + 1) / fs
    grid = np.minimum(grid, times[-1])
    nearest = np.clip(np.searchsorted(times, grid), 1, len(times) - 1)
    on_sample = np.minimum(np.abs(grid - times[nearest]), np.abs(grid - times[nearest - 1])) < 1e-6 / fs
    unknown = (times[nearest] - times[nearest - 1] > limit) & ~on_sample
    samples = {}
    for name in record:
        values = record[name][keep]
        finite = np.isfinite(values)
        if finite.sum() < 4:
            raise RecordError(
                f"channel {name} has {int(finite.sum())} numbers",
                "a channel is interpolated between four or more",
                "leave it out",
            )
        filled = Akima1DInterpolator(times[finite], values[finite], method="makima")(grid, extrapolate=False)
        beside = ~finite[nearest] | ~finite[nearest - 1]
        samples[name] = np.where(unknown | beside, np.nan, filled)
    count = int(np.sum(unknown))
    runs = in_words(flaws.runs_of(unknown))
    left = f"; {count} samples in gaps over {1e3 * limit:.4g} ms are NaN ({runs})" if count else ""
    dropped = int(np.sum(~keep))
    left += f"; {dropped} samples with repeated or missing stamps dropped" if dropped else ""
    outcome = f"{len(record)} samples interpolated onto {len(grid)} at {fs:.6g} Hz by their stamps ({reason}){left}"
    step = Step("repair_clock", {"fs": fs, "fs_interval": [fs, fs], "trust": "stamps"}, outcome, "clock")
    if repair == "gaps":
        step = Step("fill_gaps", {"fs": fs, "longest": limit}, outcome, "gaps")
    return record.with_samples(samples, step, fs=fs, start=float(times[0]), filtered=True)


def fill_missing(record: Record, *channels: str, longest: int | None = None) -> Record:
    """Fill values that are not numbers from the samples around them.

    An autoregression of the channel bridges each gap (:func:`stickslip.signals.interpolate.bridge`), so that an
    oscillation goes on inside. What lies before the first or after the last number of a channel stays NaN: nothing is
    known there, and ``record.rows()`` cuts it off.

    Parameters
    ----------
    record : Record
    *channels : str
        Which channels; all where left out.
    longest : int, optional
        Longest run of rows to fill; longer ones stay NaN. Where left out, a quarter of the period of the channel's
        strongest oscillation, and at least 16 rows: what is longer is not told by what lies around it.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        A channel without any number.

    Examples
    --------
    >>> wave = np.sin(0.1 * np.arange(500))
    >>> wave[200:205] = np.nan
    >>> print(fill_missing(Record.of({"x": wave}, fs=100.0)).history[-1].outcome)
    5 values of x filled (rows 200 to 204)
    """
    names = channels or tuple(record)
    record.require(*names, question="fill_missing")
    samples, parts, counts = dict(record.samples), [], {}
    for name in names:
        lost = ~np.isfinite(record[name])
        if lost.all():
            raise RecordError(
                f"channel {name} holds no number", "values are filled from others", "leave the channel out"
            )
        if not lost.any():
            continue
        limit = flaws.bridgeable(record[name]) if longest is None else longest
        short, long, ends = flaws.missing(record[name], limit)
        stay = [f"{in_words(long)} stay NaN, being longer than {limit}; longest= says otherwise"] if long else []
        stay += [f"{in_words(ends)} stay NaN, being at the end; record.rows() cuts them off"] if ends else []
        samples[name] = np.where(flaws.rows_of((*long, *ends), len(record)), np.nan, bridge(record[name], lost))
        filled = sum(last - first + 1 for first, last in short)
        where = f" ({in_words(short)})" if short else ""
        counts[name] = filled
        parts.append("; ".join([f"{filled} {'value' if filled == 1 else 'values'} of {name} filled{where}", *stay]))
    outcome = "; ".join(parts) or "no value was missing"
    arguments = {"channels": list(names), "longest": longest, "filled": counts}
    return _mended(record, samples, Step("fill_missing", arguments, outcome, "missing"))


def remove_spikes(record: Record, *channels: str) -> Record:
    """Replace spikes, samples that stand off from all around them, by what an autoregression of the rest expects.

    What counts as a spike is what :func:`stickslip.record.flaws.spikes` and the check-up find.

    Parameters
    ----------
    record : Record
    *channels : str
        Which channels; all where left out.

    Returns
    -------
    Record
        With the spikes replaced, and the history saying how many and how high.

    Raises
    ------
    RecordError
        A channel is missing or holds values that are not numbers.

    Examples
    --------
    >>> wave = np.sin(0.1 * np.arange(500))
    >>> wave[77] = 9.0
    >>> bool(abs(remove_spikes(Record.of({"x": wave}, fs=100.0))["x"][77] - np.sin(7.7)) < 1e-6)
    True
    """
    names = channels or tuple(record)
    record.require_clean(*names, question="remove_spikes")
    samples, parts = dict(record.samples), []
    for name in names:
        runs = flaws.spikes(record[name])
        if runs:
            spiked = flaws.rows_of(runs, len(record))
            samples[name] = bridge(record[name], spiked)
            height = float(np.max(np.abs(samples[name] - record[name])))
            unit = record.channels[name].unit
            parts.append(
                f"{int(spiked.sum())} samples of {name} replaced, by up to {height:.3g} {unit} ({in_words(runs)})"
            )
    outcome = "; ".join(parts) or "no spike was found"
    return _mended(record, samples, Step("remove_spikes", {"channels": list(names)}, outcome, "spikes"))


def restore_clipped(record: Record, channel: str, *, method: str = "rebuild", level: float | None = None) -> Record:
    """Rebuild the tops that an instrument's range cut off, or mark them as missing.

    The tops are bridged by an autoregression of the rest, and kept at or beyond the level of clipping. It is a guess
    that holds for signals of few frequencies and short cuts; take no peak force from it. Marked samples are NaN.

    Parameters
    ----------
    record : Record
    channel : str
    method : {"rebuild", "mark"}
    level : float, optional
        Size [SI] at and beyond which both signs are taken as clipped; found from the plateaus where left out.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        Values that are not numbers, or a method that is none.

    Examples
    --------
    >>> wave = np.sin(0.05 * np.arange(2000))
    >>> clipped = Record.of({"x": np.clip(wave, -0.8, 0.8)}, fs=100.0)
    >>> rebuilt = restore_clipped(clipped, "x")
    >>> bool(np.std(rebuilt["x"] - wave) < 0.3 * np.std(clipped["x"] - wave))
    True
    """
    record.require_clean(channel, question="restore_clipped")
    if method not in ("rebuild", "mark"):
        raise RecordError(f"method = {method!r}", "clipped samples are rebuilt or marked", "use 'rebuild' or 'mark'")
    values, unit = record[channel], record.channels[channel].unit
    if level is None:
        runs = flaws.clipped(values, plateaus=unit in SHARP_UNITS)
    else:
        runs = flaws.runs_of(np.abs(values) >= level)
    arguments = {"channel": channel, "method": method, "level": level}
    if not runs:
        step = Step("restore_clipped", arguments, "no sample was clipped", "clipping")
        return record.with_samples(record.samples, step)
    cut = flaws.rows_of(runs, len(record))
    count = f"{int(cut.sum())} clipped samples of {channel} ({in_words(runs)})"
    if method == "mark":
        marked = {**record.samples, channel: np.where(cut, np.nan, values)}
        return _mended(record, marked, Step("restore_clipped", arguments, f"{count} marked as NaN", "clipping"))
    sign = np.sign(values - np.median(values))
    rebuilt = np.where(cut, sign * np.maximum(sign * bridge(values, cut), sign * values), values)
    beyond = float(np.max(np.abs(rebuilt - values)))
    outcome = f"{count} rebuilt by autoregression, by up to {beyond:.3g} {unit}: a guess, not a measurement"
    step = Step("restore_clipped", arguments, outcome, "clipping")
    return _mended(record, {**record.samples, channel: rebuilt}, step)


def remove_drift(record: Record, channel: str, *, order: int | None = None) -> Record:
    """Take a sensor's slow drift off: a polynomial fitted to the means over one period, zero at the first sample.

    Parameters
    ----------
    record : Record
    channel : str
    order : int, optional
        Order of the polynomial, 1 to 6. Where left out: the order, up to 3, that Schwarz's criterion prefers, and
        nothing is taken off where the check-up finds no drift.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        Values that are not numbers, a record too short, or an order outside 1 to 6.

    Examples
    --------
    >>> rows = np.arange(4000)
    >>> drifting = Record.of({"x": np.sin(0.05 * rows) + 5e-4 * rows}, fs=100.0)
    >>> bool(np.std(remove_drift(drifting, "x")["x"] - np.sin(0.05 * rows)) < 0.01)
    True
    """
    record.require_clean(channel, question="remove_drift", samples=flaws.SHORTEST_TREND)
    values, unit = record[channel], record.channels[channel].unit
    if order is not None and not 1 <= order <= 6:
        raise RecordError(f"order = {order}", "a drift is a polynomial of order 1 to 6", "choose a lower order")
    if order is None and flaws.drift(values) == 0:
        step = Step("remove_drift", {"channel": channel, "order": None}, "no drift was found", "drift")
        return record.with_samples(record.samples, step)
    rows, slow = flaws.trend(values)
    order = order or _best_order(rows, slow)
    fit = np.polynomial.Polynomial.fit(rows, slow, order)
    along = fit(np.arange(len(values)))
    drifted = along - along[0]
    outcome = f"a polynomial of order {order} taken off {channel}, {float(np.ptp(drifted)):.3g} {unit} over the record"
    step = Step("remove_drift", {"channel": channel, "order": order}, outcome, "drift")
    return _mended(record, {**record.samples, channel: values - drifted}, step)


def remove_trend(record: Record, *channels: str, degree: int = 1) -> Record:
    """Take off a straight line (degree 0: the mean; up to 6) fitted to all samples by least squares.

    What oscillates over few periods bends such a line: :func:`remove_drift` looks at means over whole periods.

    Parameters
    ----------
    record : Record
        With one clock.
    *channels : str
        Which ones; all where none is named.
    degree : int
        Of the polynomial.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        A degree outside 0 to 6, or values that are not numbers.

    Examples
    --------
    >>> record = remove_trend(Record.of({"load": [3.0, 4.0, 5.0, 6.0]}, fs=10.0))
    >>> bool(np.abs(record["load"]).max() < 1e-12), record.history[-1].action
    (True, 'remove_trend')
    """
    if not 0 <= degree <= MOST_DEGREE:
        raise RecordError(f"degree = {degree}", f"a trend is a polynomial of degree 0 to {MOST_DEGREE}", "choose one")
    require_record(record)
    names = list(channels or record)
    record.require_clean(*names, question="remove_trend", samples=degree + 2)
    rows = np.linspace(-1, 1, len(record))
    off = {n: np.polynomial.Polynomial.fit(rows, record[n], degree)(rows) for n in names}
    step = Step("remove_trend", {"channels": names, "degree": degree}, f"a polynomial of degree {degree} taken off")
    return record.with_samples({**record.samples, **{n: record[n] - off[n] for n in names}}, step)


def _best_order(rows: Array, slow: Array) -> int:
    # the means over one period overlap: there are about as many independent ones as periods
    count = max(8, len(slow) // max(1, int(len(rows) and rows[0] + 1)))

    def criterion(order: int) -> float:
        rest = slow - np.polynomial.Polynomial.fit(rows, slow, order)(rows)
        return count * float(np.log(np.mean(rest**2) + 1e-12 * np.var(slow))) + (order + 1) * float(np.log(count))

    return min((1, 2, 3), key=criterion)


def resample(record: Record, fs: float) -> Record:
    """The record at another rate, band-limited: what the lower rate can not hold is filtered off first.

    A Kaiser-windowed sinc without delay (:func:`stickslip.signals.interpolate.band_limited`): flat within 0.1 % up to
    0.4 of the lower rate, below -80 dB from 0.5 of it on where the rate is lowered.

    Parameters
    ----------
    record : Record
    fs : float
        New rate [Hz].

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        Values that are not numbers, a record too short, or a rate that is none.

    Examples
    --------
    >>> record = Record.of({"x": np.sin(0.1 * np.arange(1000))}, fs=1000.0)
    >>> resample(record, 500.0)
    Record(x [m]; 500 samples, 500 Hz, from 0 s)
    """
    record.require_clean(*record, question="resample")
    if not (np.isfinite(fs) and fs > 0):
        raise RecordError(f"fs = {fs} Hz", "a sampling rate is positive", "pass fs= in Hz")
    if fs == record.fs:
        return record.with_samples(record.samples, Step("resample", {"fs": fs}, "the rate was that already"))
    ratio = fs / record.fs
    times = np.arange(int(np.floor((len(record) - 1) * ratio + 1e-9)) + 1) / ratio
    # the filter's transition lies below the new Nyquist frequency: nothing folds back into the band
    cutoff = 1.0 if ratio >= 1 else 0.9 * ratio
    samples: Mapping[str, Array] = {name: band_limited(record[name], times, cutoff=cutoff) for name in record}
    outcome = f"{len(record)} samples at {record.fs:g} Hz became {len(times)} at {fs:g} Hz"
    return record.with_samples(samples, Step("resample", {"fs": float(fs)}, outcome), fs=float(fs), filtered=True)


def _runs(rows: Rows) -> flaws.Runs:
    return tuple((int(row), int(row) + 1) for row in rows)


def _mended(record: Record, samples: Mapping[str, Array], step: Step) -> Record:
    """The record with the samples mended, on its clock, without what was derived from samples that were not yet."""
    changed = {name for name in record if samples[name] is not record[name]}
    derived = {name for name in record if record.channels[name].source == DERIVED}
    stale = derived if changed & set(SOURCES) - derived else set()
    kept = {name: values for name, values in samples.items() if name not in stale}
    if stale:
        outcome = f"{step.outcome}; dropped, being derived from what was mended: {', '.join(sorted(stale))}"
        step = replace(step, outcome=outcome)
    return record.with_samples(kept, step, stamps=record.stamps)
