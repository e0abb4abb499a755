"""A step that is held on a piezoelectric sensor: with which time constant does it leak away?"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.record.record import Record
from stickslip.statistics import mean_uncertainty, student

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

QUESTION = "a discharge test"
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
    record.require_clean(channel, question=QUESTION, samples=4 * BLOCKS)
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
            f"{QUESTION} needs rest before the step and the level held after it",
            "begin ten seconds before, and leave the weight on",
        )
    return _fitted(np.asarray(time - at, dtype=float), blocks, before, after, at, record.channels[channel].unit)


def _step(values: Array, size: int) -> int:
    """The row of the largest jump, between means of a block on either side."""
    total = np.concatenate([[0.0], np.cumsum(values - values.mean())])
    means = (total[size:] - total[:-size]) / size
    return int(np.abs(means[size:] - means[:-size]).argmax()) + size


def _fitted(time: Array, blocks: Array, before: Rows, after: Rows, at: float, unit: str) -> DischargeTest:
    from scipy.optimize import least_squares

    used = before | after
    t, y, behind = time[used], blocks[used], after[used]

    def model(p: Array) -> Array:
        return np.asarray(p[0] + np.where(behind, p[1] * np.exp(-p[2] * np.maximum(t, 0.0)), 0.0))

    zero, high = float(y[~behind].mean()), float(y[behind][:3].mean())
    noise = max(float(np.std(np.diff(y[~behind]))) / math.sqrt(2), 1e-12 * abs(high - zero))
    if abs(high - zero) < LOUD * noise:
        raise EstimateError(
            f"a step of {high - zero:.3g} {unit} in noise of {noise:.2g} {unit}", f"{QUESTION} needs a step {LOUD:g} "
            "times as high as the noise", "put a heavier weight on",
        )  # fmt: skip
    span = float(t[behind][-1] - t[behind][0])
    begin = np.array(
        [zero, high - zero, max(1e-3 / span, math.log(abs(high - zero) / max(noise, abs(y[-1] - zero))) / span)]
    )
    solve: Any = least_squares
    fit = solve(lambda p: (model(p) - y) / noise, begin, x_scale=[noise, abs(begin[1]), 1 / span])
    left = y - model(fit.x)
    factor = _correlated(left[behind])
    sd = factor * float(np.std(left)) / noise * np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    quantile = student(max(3.0, len(y) / factor**2 - 3))
    rate, rate_sd = float(fit.x[2]), float(sd[2])
    return DischargeTest(
        _time_constant(rate, quantile * rate_sd, span),
        Estimate.normal("step of the discharge test", fit.x[1], sd=sd[1], unit=unit, method="least squares"),
        Estimate.normal("zero of the discharge test", fit.x[0], sd=sd[0], unit=unit, method="least squares"),
        at,
        "ok",
    )


def _correlated(left: Array) -> float:
    """By how much the mean of the residual is less sure than of white noise; 1 at least."""
    white = float(left.std()) / math.sqrt(len(left))
    return max(1.0, mean_uncertainty(left)[0] / white) if white > 0 else 1.0


def _time_constant(rate: float, reach: float, span: float) -> Estimate:
    """T = 1/rate; open upwards where the rate may be nothing."""
    name, method = "discharge time constant", f"held step fitted over {span:.3g} s"
    low, high = rate - reach, rate + reach
    if rate <= 0 or low <= 0:
        value = math.inf if rate <= 0 else 1 / rate
        return Estimate(name, value, (1 / max(high, 1e-300), math.inf), math.inf, "s", method)
    return Estimate(name, 1 / rate, (1 / high, 1 / low), reach / NORMAL_95 / rate**2, "s", method)
