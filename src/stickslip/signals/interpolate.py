"""Channels between their samples, and two instruments on one clock, by the motion that both saw."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array, Mask
from stickslip.errors import ABSENT, EstimateError, RecordError
from stickslip.estimate import Estimate, Status
from stickslip.record.channels import Channel
from stickslip.record.flaws import quantum, runs_of
from stickslip.record.record import Record, Step
from stickslip.statistics import least_squares, student

LOBES = 32  # zero crossings of the sinc kept on each side
KAISER = 9.0  # window parameter: stop band below -90 dB
SAME = 1e-9  # samples: distances that differ by less are one
BLOCK = 4096  # samples found at a time
ORDER = 32  # of the autoregression that bridges lost samples
WIDTH = 3.0  # standard deviation of the smoothing kernel, in samples of the slower instrument
REACH = 5.0  # the kernel's half length, in standard deviations: 1e-5 of its weight lies beyond
LEAST_POWER = 0.05  # of the motion's mean power that an overlap must hold
LEAST_OVERLAP = 0.25  # share of the shorter record that must lie within the other
ALIKE = 0.9  # correlation from which two channels are taken to have seen one motion
DERIVATIVE = {"m": ("m/s", 0), "m/s": ("m/s", 1), "rad": ("rad/s", 0), "rad/s": ("rad/s", 1)}


def band_limited(values: Array, times: Array, *, cutoff: float = 1.0) -> Array:
    """The band-limited signals through uniform samples, at other times.

    ``y(t) = sum_k x_k c sinc(c (t - k)) w((t - k) c / 32)`` with Kaiser's window w and cut-off c, normalised to unit
    gain at zero frequency (Smith and Gossett 1984, "A flexible sampling-rate conversion method", ICASSP). Beyond its
    ends the record is continued by odd reflection.

    Parameters
    ----------
    values : ndarray, shape (..., n)
        Uniform samples, of one signal or of several.
    times : ndarray, shape (m,)
        Where the signals are wanted, in samples from the first; within 0 and n - 1.
    cutoff : float
        Upper end of the band relative to the samples' Nyquist frequency, at most 1.

    Returns
    -------
    ndarray, shape (..., m)

    Examples
    --------
    >>> wave = np.sin(0.3 * np.arange(200))
    >>> float(np.abs(band_limited(wave, np.array([100.5])) - np.sin(0.3 * 100.5))[0]) < 1e-4
    True
    """
    reach = int(np.ceil(LOBES / cutoff))
    n = values.shape[-1]
    if n <= reach:
        raise RecordError(
            f"a channel of {n} samples", f"interpolation at this rate needs {reach + 1}", "give a longer record"
        )
    before = 2 * values[..., :1] - values[..., reach:0:-1]
    after = 2 * values[..., -1:] - values[..., -2 : -reach - 2 : -1]
    around = np.lib.stride_tricks.sliding_window_view(np.concatenate([before, values, after], axis=-1), 2 * reach, -1)
    result = np.empty((*values.shape[:-1], len(times)))
    taps = np.arange(-reach + 1, reach + 1)
    for first in range(0, len(times), BLOCK):
        block = times[first : first + BLOCK]
        base = np.minimum(np.floor(block).astype(int), n - 1)
        past = block - base
        if np.ptp(past) < SAME and np.all(np.diff(base) == 1):  # a plain delay: the same weights everywhere
            weights = _weights(past[0] - taps, cutoff)
            products = around[..., base[0] + 1 : base[-1] + 2, :] @ weights
        else:
            weights = _weights(past[:, None] - taps, cutoff)
            products = np.einsum("...ij,ij->...i", around[..., base + 1, :], weights)
        result[..., first : first + BLOCK] = products / np.sum(weights, axis=-1)
    return result


def _weights(distance: Array, cutoff: float) -> Array:
    inside = np.clip(1 - (distance * cutoff / LOBES) ** 2, 0, None)
    from scipy.special import i0

    return np.asarray(np.sinc(cutoff * distance) * i0(KAISER * np.sqrt(inside)) * (inside > 0))


def bridge(values: Array, lost: Mask) -> Array:
    """Put values in place of lost samples, so that an autoregression of the rest is kept as well as possible.

    Minimises ``sum_i (x_i - sum_j a_j x_{i-j})^2`` over the lost samples, in both directions of time (Janssen,
    Veldhuis and Vries, IEEE Trans. ASSP 34, 1986, eq. 8; the coefficients a come from the complete stretches).
    A record too short, or too broken, for that is bridged by straight lines.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples; what they hold where `lost` is ignored.
    lost : ndarray of bool, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
    """
    rows = np.arange(len(values))
    result = np.array(values, dtype=float)
    if not lost.any():
        return result
    result[lost] = np.interp(rows[lost], rows[~lost], values[~lost])
    # outside the first and last known sample nothing can be bridged: the last known value is held there
    inner = lost & (rows > rows[~lost][0]) & (rows < rows[~lost][-1])
    for first, last in _neighbourhoods(inner):
        part = slice(first, last)
        result[part] = _bridged(result[part], inner[part])
    return result


def _neighbourhoods(lost: Mask) -> list[tuple[int, int]]:
    """Stretches around lost samples, wide enough to learn from, merged where they meet."""
    rows = np.flatnonzero(lost)
    margin = 40 * ORDER
    merged: list[tuple[int, int]] = []
    for row in rows:
        first, last = max(0, int(row) - margin), min(len(lost), int(row) + margin + 1)
        if merged and first <= merged[-1][1]:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    return merged


def _bridged(values: Array, lost: Mask) -> Array:
    mean = float(np.mean(values[~lost]))
    signal = values - mean
    order = min(ORDER, int(np.sum(~lost)) // 6)
    coefficients = _autoregression(signal, lost, order) if order >= 2 else None
    if coefficients is None:
        return values
    result = values.copy()
    # lost samples further apart than the order do not meet in any prediction: each group is a problem of its own
    near = np.convolve(lost, np.ones(2 * order + 1), "same") > 0.5
    for first, last in runs_of(near):
        part = slice(first, last + 1)
        result[part][lost[part]] = _solved(signal[part], lost[part], coefficients) + mean
    return result


def _solved(signal: Array, lost: Mask, coefficients: Array) -> Array:
    """The lost samples by least squares of all predictions that they are part of."""
    from scipy.sparse import diags
    from scipy.sparse.linalg import spsolve

    n, order = len(signal), len(coefficients)
    backward = np.concatenate([[1.0], -coefficients])
    predictors = [diags(list(f), list(range(order + 1)), shape=(n - order, n)) for f in (backward, backward[::-1])]
    normal = (predictors[0].T @ predictors[0] + predictors[1].T @ predictors[1]).tocsc()
    unknown, known = np.flatnonzero(lost), np.flatnonzero(~lost)
    rows = normal[unknown]
    return np.atleast_1d(spsolve(rows[:, unknown].tocsc(), -(rows[:, known] @ signal[known])))


def _autoregression(signal: Array, lost: Mask, order: int) -> Array | None:
    """Coefficients of the forward-backward least-squares autoregression over complete stretches; None if too few."""
    windows = np.lib.stride_tricks.sliding_window_view(signal, order + 1)
    complete = ~np.lib.stride_tricks.sliding_window_view(lost, order + 1).any(axis=1)
    rows = windows[complete][:: max(1, int(complete.sum()) // 20_000)]
    if len(rows) < 2 * order:
        return None
    past = np.concatenate([rows[:, -2::-1], rows[:, 1:]])
    present = np.concatenate([rows[:, -1], rows[:, 0]])
    gram = past.T @ past
    gram[np.diag_indices(order)] += 1e-10 * np.trace(gram) / order + 1e-300
    solution: Array = np.linalg.solve(gram, past.T @ present)
    return solution


def without_delays(record: Record, *channels: str, question: str = "taking delays out", samples: int = 2) -> Record:
    """What would the channels read, had none of them come late?

    Each named channel whose delay is stated is moved by band-limited interpolation, ``y(t) = x(t + delay)``; then all
    channels are cut to the rows that every moved one reaches. Channels not named keep their values and their delay.

    Parameters
    ----------
    record : Record
        Delays [s] stated in its channels, see :meth:`~stickslip.record.record.Record.with_details`.
    *channels : str
        Those to move; all where none is named.
    question : str
        Who asks, for the words of a refusal.
    samples : int
        Least number of rows that must be left.

    Returns
    -------
    Record
        The same record where no named channel is delayed; else with the step in its history and delays of zero. A
        channel's stated noise is kept: white noise loses 2 % at most to the interpolation. Its counts, which are no
        longer seen, are in it.

    Raises
    ------
    RecordError
        A delayed channel that is missing or not finite, a broken clock, or too few rows left.

    Examples
    --------
    >>> t = np.arange(1000) / 1000
    >>> late = Record.of({"x": np.sin(9 * t), "v": 9 * np.cos(9 * (t - 0.0125))}, fs=1000.0)
    >>> record = without_delays(late.with_details("v", delay=0.0125), "x", "v")
    >>> len(record), bool(np.allclose(record["v"][50:-50], 9 * np.cos(9 * record.time[50:-50]), atol=1e-4))
    (987, True)
    """
    record.require(*channels, question=question)
    delays = {name: record.channels[name].delay for name in channels or record if record.channels[name].delay}
    if not delays:
        return record
    record.require_clean(*delays, question=question)
    shifts = {name: delay * record.fs for name, delay in delays.items()}
    first = max(0, math.ceil(-min(shifts.values())))
    last = len(record) - max(0, math.ceil(max(shifts.values())))
    if last - first < samples or len(record) <= LOBES:
        raise RecordError(
            f"delays of {', '.join(f'{name} {delay:g} s' for name, delay in delays.items())}",
            f"{question} needs {max(samples, LOBES + 1)} rows that every channel reaches, "
            f"and {max(0, last - first)} of {len(record)} are left",
            "correct the delays, in seconds, or give a longer record",
        )
    rows = np.arange(first, last, dtype=float)
    kept = {name: values[first:last] for name, values in record.samples.items()}
    moved = kept | {name: band_limited(record.samples[name], rows + shift) for name, shift in shifts.items()}
    outcome = f"delays taken out; {last - first} of {len(record)} rows reached by all"
    step = Step("without_delays", {"delays": delays}, outcome)
    result = record.with_samples(moved, step, start=record.start + first / record.fs)
    punctual = {name: _counted(record.channels[name], record[name]) for name in delays}
    return replace(result, channels={**record.channels, **punctual})


def _counted(channel: Channel, values: Array) -> Channel:
    """A channel moved in time: what was stated of its noise is before the counts, whose own is in it now."""
    noise = None if channel.noise is None else math.hypot(channel.noise, quantum(values) / 12**0.5)
    return replace(channel, delay=0.0, noise=noise)


def clock_offset(a: Record, b: Record, *, on: str | tuple[str, str] | None = None) -> Estimate:
    """How many seconds must be added to b's clock for it to agree with a's?

    Both channels are smoothed by one Gaussian kernel, wide enough that neither rate matters any more, and a
    displacement is differentiated by that kernel's derivative where the other instrument has the velocity. The
    correlation over all lags gives a first offset; least squares of ``A(t) = g B(t - offset) + c`` refines it.
    Smoothed signals are interpolated without losing noise between samples, so that nothing pulls the offset towards
    half samples. The interval allows for correlated residuals.

    Parameters
    ----------
    a, b : Record
        Two records of one run, each with its own rate and start.
    on : str or (str, str), optional
        The channel both have, or a's and b's names for it: a displacement, a velocity, or one of each. Where left
        out, x or v: of both, or one of each.

    Returns
    -------
    Estimate
        In seconds. Its checks hold residual, gain and the ratio of the rates; its status says if the motion repeats
        so that other offsets fit as well, or if the clocks run at different rates.

    Raises
    ------
    EstimateError
        The channels do not look like one motion, or overlap too little.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> a = Record.of({"x": np.sin(9 * t) + np.sin(23 * t)}, fs=1000.0)
    >>> b = Record.of({"x": np.sin(9 * t + 0.9) + np.sin(23 * t + 2.3)}, fs=1000.0)
    >>> round(clock_offset(a, b).value, 6)
    0.1
    """
    return _match(a, b, on)[0]


def clock_rate(a: Record, b: Record, *, on: str | tuple[str, str] | None = None) -> Estimate:
    """How many seconds of a's clock pass in one second of b's?

    The stretch between the two smoothed motions by least squares, about the middle of b's record.

    Parameters
    ----------
    a, b : Record
    on : str or (str, str), optional
        As for :func:`clock_offset`, which tells where the rates differ.

    Returns
    -------
    Estimate
        Without unit; 1 for clocks of one rate.

    Raises
    ------
    EstimateError
        The channels do not look like one motion, or overlap too little.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> a, b = (Record.of({"x": np.sin(9 * s) + np.sin(23 * s)}, fs=1000.0) for s in (t, 1.001 * t))
    >>> round(clock_rate(a, b).value, 4)
    1.001
    """
    return _match(a, b, on)[1]


def synchronise(
    a: Record,
    b: Record,
    *,
    on: str | tuple[str, str] | None = None,
    offset: float | Estimate | None = None,
    rate: float | Estimate = 1.0,
) -> Record:
    """Bring b's channels onto a's clock: one record, over the time that both recorded.

    Parameters
    ----------
    a, b : Record
        Two records of one run; a's clock is kept.
    on : str or (str, str), optional
        The channels that saw the same motion, see :func:`clock_offset`.
    offset : float or Estimate, optional
        Seconds to add to b's clock; found with :func:`clock_offset` where left out.
    rate : float or Estimate
        Seconds of a's clock in one of b's, about the middle of b's record; see :func:`clock_rate`.

    Returns
    -------
    Record
        a's channels, and b's interpolated band-limited (b's name with ``_b`` behind where a has that name too).

    Raises
    ------
    EstimateError
        No offset can be found.
    RecordError
        The records do not overlap.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> a = Record.of({"x": np.sin(9 * t) + np.sin(23 * t)}, fs=1000.0)
    >>> b = Record.of({"v": 9 * np.cos(9 * t + 0.9) + 23 * np.cos(23 * t + 2.3)}, fs=1000.0)
    >>> sorted(synchronise(a, b))
    ['v', 'x']
    """
    a.require_clean(*a, question="synchronise")
    b.require_clean(*b, question="synchronise")
    names = _shared_motion(a, b, on) if offset is None or on is not None else None
    estimate = clock_offset(a, b, on=names) if offset is None else offset
    seconds = estimate.value if isinstance(estimate, Estimate) else float(estimate)
    ratio = rate.value if isinstance(rate, Estimate) else float(rate)
    middle = float(b.time[0]) + 0.5 * b.duration
    rows = ((a.time - seconds - middle) / ratio + middle - b.start) * b.fs
    shared = np.flatnonzero((rows >= 0) & (rows <= len(b) - 1))
    if len(shared) < 2:
        raise RecordError(
            f"the records do not overlap with an offset of {seconds:g} s",
            "only time that both recorded can be shared",
            "check offset= and the records' starts",
        )
    part = a.rows(int(shared[0]), int(shared[-1]) + 1)
    samples, channels = dict(part.samples), dict(a.channels)
    cutoff = min(1.0, 0.9 * a.fs / b.fs)
    for name in b:
        mine = f"{name}_b" if name in samples else name
        samples[mine] = band_limited(b[name], rows[shared], cutoff=cutoff)
        channels[mine] = replace(b.channels[name], name=mine, noise=None)  # the filter took part of it
    interval = list(estimate.interval) if isinstance(estimate, Estimate) else [seconds, seconds]
    known = f"found on {' and '.join(dict.fromkeys(names))}" if names and offset is None else "given"
    outcome = (
        f"b's clock moved by {seconds:.6g} s ({known}; 95 %: {interval[0]:.6g} to {interval[1]:.6g}), "
        f"{len(b)} samples at {b.fs:g} Hz interpolated onto {len(shared)} at {a.fs:g} Hz"
    )
    if isinstance(estimate, Estimate) and estimate.status != "ok":
        outcome += f"; {estimate.status}"
    step = Step("synchronise", {"on": names, "offset": seconds, "offset_interval": interval, "rate": ratio}, outcome)
    theirs = tuple(Step(s.action, {**s.arguments, "record": "b"}, s.outcome) for s in b.history)
    history, truth = (*part.history, *theirs, step), {**b.truth, **a.truth}
    return Record(samples, channels, a.fs, part.start, history, None, truth, part.rig, a.log or b.log)


def _shared_motion(a: Record, b: Record, on: str | tuple[str, str] | None) -> tuple[str, str]:
    """The names of the motion that both saw, a's and b's."""
    if on is not None:
        return (on, on) if isinstance(on, str) else on
    for names in (("x", "x"), ("v", "v"), ("x", "v"), ("v", "x")):
        if names[0] in a and names[1] in b:
            return names
    raise RecordError(
        f"the records have {', '.join(a)} and {', '.join(b)}",
        "clocks are compared by a motion x or v that both recorded",
        'name the channels that saw the same motion, a\'s and b\'s: on=("x", "plate")',
    )


def _match(a: Record, b: Record, on: str | tuple[str, str] | None) -> tuple[Estimate, Estimate]:
    """Offset and rate of b's clock against a's."""
    names = _shared_motion(a, b, on)
    for record, name in zip((a, b), names, strict=True):
        record.require(name, question="clock_offset", kind=ABSENT)
    a.require_clean(names[0], question="clock_offset", samples=64)
    b.require_clean(names[1], question="clock_offset", samples=64)
    orders = _orders(a.channels[names[0]].unit, b.channels[names[1]].unit)
    width = WIDTH / min(a.fs, b.fs)
    mine, theirs = _smoothed(a, names[0], width, orders[0]), _smoothed(b, names[1], width, orders[1])
    first, alike, others = _coarse(mine, theirs)
    if alike < ALIKE:
        raise EstimateError(
            f"{names[0]} and {names[1]} correlate by {alike:.2f} at best",
            f"two instruments on one motion correlate by {ALIKE} and more",
            "name the channels that saw the same motion in on=, or pass offset= in seconds",
        )
    return _refined(mine, theirs, first, others)


def _orders(unit_a: str, unit_b: str) -> tuple[int, int]:
    """How often each channel is differentiated, so that both are the same quantity."""
    if unit_a == unit_b:
        return 0, 0
    if unit_a in DERIVATIVE and unit_b in DERIVATIVE and DERIVATIVE[unit_a][0] == DERIVATIVE[unit_b][0]:
        return 1 - DERIVATIVE[unit_a][1], 1 - DERIVATIVE[unit_b][1]
    raise RecordError(
        f"the channels are in {unit_a} and {unit_b}",
        "the shared motion is one quantity, or a displacement and its velocity",
        "name such channels in on=",
    )


@dataclass(frozen=True)
class _Motion:
    time: Array
    values: Array

    @property
    def step(self) -> float:
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)


def _smoothed(record: Record, name: str, width: float, order: int) -> _Motion:
    """The channel, or its derivative, under a Gaussian kernel of `width` [s], without the ends it can not reach."""
    from scipy.signal import oaconvolve

    half = int(np.ceil(REACH * width * record.fs))
    if len(record) < 4 * half:
        raise EstimateError(
            f"{len(record)} samples of {name}", f"an offset needs {4 * half} at this rate", "give a longer record"
        )
    along = np.arange(-half, half + 1) / record.fs
    kernel = np.exp(-0.5 * (along / width) ** 2)
    kernel /= kernel.sum()
    if order:
        kernel *= along / np.sum(kernel * along**2)
    inside = slice(half, len(record) - half)
    # removing the mean first leaves the convolution's rounding at the scale of the motion
    mean = float(np.mean(record[name]))
    values = oaconvolve(record[name] - mean, kernel[::-1], "valid") + (0.0 if order else mean)
    return _Motion(np.asarray(record.time[inside]), values)


def _coarse(a: _Motion, b: _Motion) -> tuple[float, float, list[float]]:
    """Offset of the highest correlation, that correlation, and other offsets that correlate about as well.

    Among nearly equal peaks, as a periodic motion has, the one with the longest overlap is taken.
    """
    from scipy.signal import correlate, find_peaks

    grid = np.arange(b.time[0], b.time[-1], a.step)
    x, y = a.values - a.values.mean(), np.interp(grid, b.time, b.values)
    y -= y.mean()
    one_x, one_y = np.ones_like(x), np.ones_like(y)

    def sums(first: Array, second: Array) -> Array:
        return np.asarray(correlate(first, second, "full", method="fft"), dtype=float)

    count = np.maximum(np.round(sums(one_x, one_y)), 1)
    sum_x, sum_y = sums(x, one_y), sums(one_x, y)
    power_x, power_y = sums(x**2, one_y) - sum_x**2 / count, sums(one_x, y**2) - sum_y**2 / count
    # where one of them hardly moves within the overlap, correlation says nothing
    usable = (count >= LEAST_OVERLAP * min(len(x), len(y))) & (power_x > LEAST_POWER * count * np.mean(x**2))
    usable &= power_y > LEAST_POWER * count * np.mean(y**2)
    power = np.sqrt(np.where(usable, power_x * power_y, 1.0))
    likeness = np.where(usable, (sums(x, y) - sum_x * sum_y / count) / power, 0.0)
    best = int(np.argmax(likeness))
    peaks = np.unique(np.append(find_peaks(likeness)[0], best))
    near = peaks[likeness[peaks] > likeness[best] - max(0.002, 0.2 * (1 - likeness[best]))]
    chosen = near[np.argmax(count[near])]
    offsets = (np.arange(len(likeness)) - (len(y) - 1)) * a.step + (a.time[0] - grid[0])
    return float(offsets[chosen]), float(likeness[chosen]), [float(offsets[k]) for k in near if k != chosen]


def _refined(a: _Motion, b: _Motion, first: float, others: list[float]) -> tuple[Estimate, Estimate]:
    from scipy.interpolate import CubicSpline

    motion = CubicSpline(b.time, b.values)

    def linearised(offset: float) -> tuple[Array, Array, Array]:
        """Derivatives of ``g B(t - offset) + c`` by g, c and g offset; the data; the time about b's middle."""
        inside = (a.time - offset >= b.time[0]) & (a.time - offset <= b.time[-1])
        at = a.time[inside] - offset
        design = np.column_stack([motion(at), np.ones_like(at), -motion(at, 1)])
        return design, a.values[inside], at - 0.5 * (b.time[0] + b.time[-1])

    offset = first
    for _ in range(50):
        design, data, along = linearised(offset)
        (gain, _, shift), *_ = np.linalg.lstsq(design, data, rcond=None)
        offset += float(np.clip(shift / gain, -2 * a.step, 2 * a.step))
        if abs(shift / gain) < 1e-10:
            break
    design, data, along = linearised(offset)
    fit = least_squares(design, data)
    gain, residual = float(fit.coefficients[0]), fit.residual
    estimate = Estimate.normal(
        "clock offset",
        offset,
        sd=float(fit.sd[2]) / abs(gain),
        quantile=student(float(fit.freedom[2])),
        unit="s",
        method="least squares between the smoothed motions",
    )
    stretch = least_squares(np.column_stack([design, design[:, 2] * along]), data)
    rate = Estimate.normal(
        "clock rate ratio",
        1 + float(stretch.coefficients[3]) / gain,
        sd=float(stretch.sd[3]) / abs(gain),
        unit="1",
        quantile=student(float(stretch.freedom[3])),
        method="least squares of the stretch between the smoothed motions",
    )
    rest = float(np.std(residual) / np.std(data))
    return _judged(estimate, gain, rest, rate, len(data) * a.step, others), rate


def _judged(
    offset: Estimate, gain: float, rest: float, rate: Estimate, overlap: float, others: list[float]
) -> Estimate:
    """The offset with what was checked, and in words why it may be wrong."""
    doubts = []
    if others:
        nearest = ", ".join(f"{other:.4g} s" for other in sorted(others, key=abs)[:3])
        doubts.append(f"the motion repeats: {nearest} fit about as well, and the longest overlap was taken")
    if not rate.includes(1.0) and abs(rate.value - 1) * overlap > 4 * offset.sd:
        doubts.append(f"the clocks run at different rates, {rate.value:.6f} to 1: pass rate=clock_rate(a, b)")
    checks = (
        f"residual {100 * rest:.2g} % of the motion over {overlap:.3g} s",
        f"gain {gain:.4f}",
        f"rate ratio {rate.value:.6f} (95 %: {rate.interval[0]:.6f} to {rate.interval[1]:.6f})",
    )
    return replace(offset, status=Status(*doubts), checks=checks)
