"""Nothing moves: what does each sensor read, how noisy is it, what is a count worth, does it drift or leak?"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Mask
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Doubt, Estimate, Result, Status, plain
from stickslip.record.record import Record
from stickslip.signals.noise import quantisation_step
from stickslip.statistics import correlation_time, mean_uncertainty, student

QUESTION = "what sensors read at rest"
LEAST = 500  # samples of a record at rest
COARSE = 3.0  # standard deviations of the noise in a count, up to which the counts themselves are fitted
MOVES = 6.0  # deviations from chance of a slow swing, from which the rig was not at rest
TONE, FEWEST = 0.5, 4  # of what is left, that one tone carries; and cycles of it: less may be a slow walk
HUM = 45.0  # Hz: a tone from here on is the mains' as likely as the rig's
WIDE = 1e-2  # of the logarithm: wide enough for rounding, narrow against what 500 samples tell
UNSEEN = 3.0  # samples: so few or fewer stand on a count on which none was seen (95 %)
HELD = 0.02  # of the samples off the one count, below which the noise is only bounded


@dataclass(frozen=True, repr=False)
class SensorAtRest(Result):
    """One sensor while nothing moves.

    Attributes
    ----------
    channel : str
        Its channel.
    zero : Estimate
        What it reads [unit of the channel].
    drift : Estimate
        How fast that changes [unit of the channel / s].
    noise : Estimate
        Standard deviation of its noise, before it was rounded to counts [unit of the channel].
    count : float
        What a count of the digitiser is worth [unit of the channel]; zero where no steps show.
    status : str
        "ok", or in words what to beware of.
    """

    channel: str
    zero: Estimate
    drift: Estimate
    noise: Estimate
    count: float
    status: str


@dataclass(frozen=True, repr=False)
class AtRest(Result):
    """Every sensor while nothing moves.

    Attributes
    ----------
    sensors : mapping of str to SensorAtRest
        By channel.
    duration : float
        Of the record [s].
    """

    sensors: Mapping[str, SensorAtRest]
    duration: float

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Zero, noise and drift of each."""
        return tuple(number for sensor in self.sensors.values() for number in (sensor.zero, sensor.noise, sensor.drift))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {name: dict(plain(vars(sensor))) for name, sensor in self.sensors.items()}


def at_rest(record: Record) -> AtRest:
    r"""What does each sensor read while nothing moves, how noisy is it, and does it drift?

    The zero is the mean, the drift the slope of a straight line, with the uncertainty that correlated noise leaves
    (see :func:`~stickslip.statistics.mean_uncertainty`). The noise is what is left of the line. Where a count is not
    small beside it, mean and deviation before rounding are those under which the counts are most likely,

    .. math:: \sum_n N_n \log \left[ \Phi\left(\frac{c_n + q/2 - \mu}{\sigma}\right)
              - \Phi\left(\frac{c_n - q/2 - \mu}{\sigma}\right) \right] \to \max ,

    with N_n samples at the count c_n and counts of q.

    Parameters
    ----------
    record : Record
        Of a rig at rest, ten seconds or more: contact off or unloaded, base held, air on.

    Returns
    -------
    AtRest

    Raises
    ------
    RecordError
        A channel that is not finite, a broken clock, fewer than 500 samples.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal((2, 20000))
    >>> readings = np.round((3e-6 + 1e-6 * noise[0]) / 2.5e-6) * 2.5e-6
    >>> sensors = at_rest(Record.of({"x": readings, "a": 0.2 + 0.04 * noise[1]}, fs=2000)).sensors
    >>> sensors["x"].zero.includes(3e-6), sensors["x"].noise.includes(1e-6), sensors["a"].noise.includes(0.04)
    (True, True, True)
    """
    record.require_clean(*record, question=QUESTION, samples=LEAST)
    sensors = {name: _sensor(name, record) for name in record}
    return AtRest(sensors, record.duration)


def _sensor(name: str, record: Record) -> SensorAtRest:
    values, unit = record[name], record.channels[name].unit
    time = (np.arange(len(values)) - (len(values) - 1) / 2) / record.fs
    slope = float(time @ values / (time @ time))
    residual = values - values.mean() - slope * time
    worth = len(values) / max(1.0, correlation_time(residual))
    of = f"{len(values)} samples at rest"
    sd, freedom = mean_uncertainty(time * residual / float(np.mean(time**2)))
    drift = Estimate.normal(
        f"drift of {name}", slope, sd=sd, unit=f"{unit}/s", method=f"slope of {of}", quantile=student(freedom)
    )
    levels = np.unique(values)
    count = float(np.ptp(levels)) if len(levels) == 2 else quantisation_step(values)
    zero, noise = (
        replace(estimate, name=f"{what} of {name}", unit=unit, method=f"{estimate.method} of {of}")
        for what, estimate in zip(("zero", "noise"), _read(values - slope * time, residual, count, worth), strict=True)
    )
    status = _status(name, values, residual, worth, drift, _tone(residual, record.fs))
    return SensorAtRest(name, zero, drift, noise, count, status)


def _read(values: Array, residual: Array, count: float, worth: float) -> tuple[Estimate, Estimate]:
    """The level, and the noise before it was rounded to counts."""
    sd, (zero_sd, freedom) = float(residual.std()), mean_uncertainty(residual)
    zero = Estimate.normal("", values.mean(), sd=zero_sd, unit="", method="mean", quantile=student(freedom))
    if not count or sd > COARSE * count:
        own = math.sqrt(sd**2 - count**2 / 12)  # without what rounding adds
        noise = Estimate.normal("", own, sd=own / math.sqrt(2 * max(1.0, worth - 2)), unit="", method="deviation")
        return zero, noise.within(0.0)
    counts, times = np.unique(np.round(values / count), return_counts=True)
    weights = times * worth / len(values)
    if len(counts) < 3 or times.max() > (1 - HELD) * len(values):
        return _bounded(counts * count, weights, count)
    return _rounded(counts * count, weights, count, zero.value, sd)


def _bounded(levels: Array, weights: Array, count: float) -> tuple[Estimate, Estimate]:
    """Level and noise by what stands on one count, or two: bounds, for a share of the two tells one number alone.

    With a share p on the upper count, the level is Phi^-1(p) deviations above the edge between both; and the deviation
    is so small that nothing stands on the next count.
    """
    from scipy.special import ndtri

    often = levels[np.argmax(weights)]
    if len(levels) != 2:
        low, high, wide, middle = often - count / 2, often + count / 2, count / 2, often
    else:
        edge, size = levels.mean(), weights.sum()
        share, least = weights[1] / size, 1 / (size + 2)
        unsure = NORMAL_95 * math.sqrt(max(share * (1 - share), least) / size)
        ends = ndtri(np.clip([share - unsure, share, share + unsure], least, 1 - least))
        wide = count / (abs(ends[1]) - ndtri(max(least, UNSEEN / size)))
        low, high = min(edge, edge + wide * ends[0]), max(edge, edge + wide * ends[2])
        middle = edge + wide / 2 * ends[1]
    method = "share of two counts" if len(levels) == 2 else "the one count"
    zero = Estimate("", float(middle), (float(low), float(high)), float(high - low) / (2 * NORMAL_95), "", method)
    return zero, Estimate("", 0.0, (0.0, float(wide)), float(wide) / 2, "", method)


def _rounded(levels: Array, weights: Array, count: float, level: float, sd: float) -> tuple[Estimate, Estimate]:
    """Level and deviation before rounding, by the likelihood of the counts; as sure as it bends, in both together."""
    from scipy.optimize import minimize
    from scipy.special import ndtr

    def cost(at: Array) -> float:
        spread = count * math.exp(at[1])
        shift = count * at[0]
        ends = (levels + count / 2 - level - shift) / spread, (levels - count / 2 - level - shift) / spread
        return -float(weights @ np.log(np.maximum(ndtr(ends[0]) - ndtr(ends[1]), 1e-300)))

    start = np.array([0.0, math.log(max(0.2, math.sqrt(max(0.0, (sd / count) ** 2 - 1 / 12))))])
    best = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-6}).x
    steps = WIDE * np.eye(2)
    bend = [
        [cost(best + a + b) - cost(best + a - b) - cost(best - a + b) + cost(best - a - b) for b in steps]
        for a in steps
    ]
    sds = np.sqrt(np.maximum(0.0, np.diag(np.linalg.pinv(np.array(bend) / (4 * WIDE**2)))))
    method = "likelihood of the counts"
    zero = Estimate.normal("", level + count * best[0], sd=count * sds[0], unit="", method=method)
    noise = count * math.exp(best[1])
    return zero, Estimate.normal("", noise, sd=noise * sds[1], unit="", method=method).within(0.0)


def _tone(residual: Array, fs: float) -> float | None:
    """Frequency [Hz] of the tone that is most of what is left; None where none is."""
    power = np.abs(np.fft.rfft(residual * np.hanning(len(residual)))) ** 2
    peak = FEWEST + int(np.argmax(power[FEWEST:]))
    around = power[peak - 2 : peak + 3]  # as wide as the window makes a line
    return peak * fs / len(residual) if around.sum() > TONE * power.sum() > 0 else None


def _status(name: str, values: Array, residual: Array, worth: float, drift: Estimate, tone: float | None) -> str:
    blocks = residual[: len(residual) // 20 * 20].reshape(20, -1).mean(axis=1)
    expected = residual.std() / math.sqrt(max(1.0, len(residual) / 20))
    doubts: list[Doubt | str] = []
    if np.ptp(values) == 0:
        doubts.append(Doubt(f"{name} reads one number throughout: is it plugged in?", "dead"))
    elif np.abs(blocks).max() > MOVES * expected and worth < len(residual) / 20:
        doubts.append(Doubt(f"{name} swings slowly: the rig moves, or its sensor warms up", "moves"))
    elif tone is not None and tone < HUM:
        doubts.append(Doubt(f"{name} swings at {tone:.3g} Hz, which is most of its noise: the rig moves", "moves"))
    elif tone is not None:
        doubts.append(Doubt(f"{name} hums at {tone:.4g} Hz, which is most of its noise", "hums", lesser=True))
    if drift.known and not drift.includes(0.0):
        doubts.append(Doubt(f"{name} drifts", "drifts", lesser=True))
    return Status(*doubts)


DISCHARGE = "a discharge test"
BLOCKS = 300  # to which the record is reduced
EDGE = 0.01  # of the record, after the step, left to the hand and the ringing
LOUD = 20.0  # deviations of a block's mean that the step has to be high
LEAST_BEFORE = 10  # blocks before the step, which tell the zero


@dataclass(frozen=True, repr=False)
class DischargeTest(Result):
    """How a sensor forgets.

    Attributes
    ----------
    time_constant : Estimate
        In which a held level falls to 37 % [s]; its upper end is infinite where no leak was seen.
    step : Estimate
        Height of the step [unit of the channel].
    zero : Estimate
        To which it leaks [unit of the channel].
    at : float
        Instant of the step [s].
    status : str
        "ok", or in words what to beware of.
    """

    time_constant: Estimate
    step: Estimate
    zero: Estimate
    at: float
    status: str


def discharge_test(record: Record, *, channel: str = "load") -> DischargeTest:
    r"""With which time constant does a held step leak away?

    The thesis's appendix B. Some seconds of rest, then a weight is put on the cell and left there:
    :math:`y = y_0` before and :math:`y = y_0 + A e^{-(t - t_0)/T}` after, fitted to means over blocks by least squares,
    with the zero shared by both sides; so that a fraction of T is long enough. The interval is the one of the rate 1/T,
    widened by what neighbouring blocks have in common.

    Parameters
    ----------
    record : Record
        With the cell; a twentieth of it or more before the step.
    channel : str
        The cell's.

    Returns
    -------
    DischargeTest

    Raises
    ------
    RecordError
        The channel is missing or not finite.
    EstimateError
        No step, or no rest before it.

    Examples
    --------
    >>> t = np.arange(60_000) / 1000
    >>> load = np.where(t > 10, 5 * np.exp(-(t - 10) / 50), 0)
    >>> noise = 0.002 * np.random.default_rng(1).standard_normal(t.size)
    >>> discharge_test(Record.of({"load": load + noise}, fs=1000)).time_constant.includes(50)
    True
    """
    record.require_clean(channel, question=DISCHARGE, samples=4 * BLOCKS)
    size = len(record) // BLOCKS
    blocks = record[channel][: size * BLOCKS].reshape(BLOCKS, size).mean(axis=1)
    time = record.start + (size * (np.arange(BLOCKS) + 0.5) - 0.5) / record.fs
    row = _step(record[channel], size)
    before = np.arange(BLOCKS) < row // size - 1
    after = np.arange(BLOCKS) > row // size + max(1, round(EDGE * BLOCKS))
    at = record.start + row / record.fs
    if before.sum() < LEAST_BEFORE or after.sum() < LEAST_BEFORE:
        raise EstimateError(
            f"a step {row / record.fs:.3g} s after the record's begin of {record.duration:.3g} s",
            f"{DISCHARGE} needs rest before the step and the level held after it",
            "begin ten seconds before, and leave the weight on",
        )
    return _fitted(np.asarray(time - at, dtype=float), blocks, before, after, at, record.channels[channel].unit)


def _step(values: Array, size: int) -> int:
    """The row of the largest jump, between means of a block on either side."""
    total = np.concatenate([[0.0], np.cumsum(values - values.mean())])
    means = (total[size:] - total[:-size]) / size
    return int(np.abs(means[size:] - means[:-size]).argmax()) + size


def _fitted(time: Array, blocks: Array, before: Mask, after: Mask, at: float, unit: str) -> DischargeTest:
    from scipy.optimize import least_squares

    used = before | after
    t, y, behind = time[used], blocks[used], after[used]

    def model(p: Array) -> Array:
        return np.asarray(p[0] + np.where(behind, p[1] * np.exp(-p[2] * np.maximum(t, 0.0)), 0.0))

    zero, high = float(y[~behind].mean()), float(y[behind][:3].mean())
    noise = max(float(np.std(np.diff(y[~behind]))) / math.sqrt(2), 1e-12 * abs(high - zero))
    if abs(high - zero) < LOUD * noise:
        raise EstimateError(
            f"a step of {high - zero:.3g} {unit} in noise of {noise:.2g} {unit}",
            f"{DISCHARGE} needs a step {LOUD:g} times as high as the noise",
            "put a heavier weight on",
        )
    span = float(t[behind][-1] - t[behind][0])
    rate = math.log(abs(high - zero) / max(noise, abs(y[-1] - zero))) / span
    begin = np.array([zero, high - zero, max(1e-3 / span, rate)])
    solve: Any = least_squares
    fit = solve(lambda p: (model(p) - y) / noise, begin, x_scale=[noise, abs(begin[1]), 1 / span])
    residual = y - model(fit.x)
    factor = _correlated(residual[behind])
    sd = factor * float(np.std(residual)) / noise * np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    quantile = student(max(3.0, len(y) / factor**2 - 3))
    rate, rate_sd = float(fit.x[2]), float(sd[2])
    return DischargeTest(
        _time_constant(rate, quantile * rate_sd, span),
        Estimate.normal("step of the discharge test", fit.x[1], sd=sd[1], unit=unit, method="least squares"),
        Estimate.normal("zero of the discharge test", fit.x[0], sd=sd[0], unit=unit, method="least squares"),
        at,
        "ok",
    )


def _correlated(residual: Array) -> float:
    """By how much the mean of the residual is less sure than of white noise; 1 at least."""
    white = float(residual.std()) / math.sqrt(len(residual))
    return max(1.0, mean_uncertainty(residual)[0] / white) if white > 0 else 1.0


def _time_constant(rate: float, reach: float, span: float) -> Estimate:
    """T = 1/rate; open upwards where the rate may be nothing."""
    name, method = "discharge time constant", f"held step fitted over {span:.3g} s"
    low, high = rate - reach, rate + reach
    if rate <= 0 or low <= 0:
        value = math.inf if rate <= 0 else 1 / rate
        return Estimate(name, value, (1 / max(high, 1e-300), math.inf), math.inf, "s", method)
    return Estimate(name, 1 / rate, (1 / high, 1 / low), reach / NORMAL_95 / rate**2, "s", method)
