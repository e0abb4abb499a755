"""A sensor against what is known: weights, gauge steps, gravity. A spring by weights."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import Doubt, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.statistics import correlation_time, mean_uncertainty, student

QUESTION = "the sensitivity of a sensor"
LEAST = 3  # levels
BLOCKS = 400  # into which a record is reduced before its levels are looked for
SHORTEST = 4  # blocks of a level
MARGIN = 0.2  # of a level, at each of its ends, in which the hand still works
BENT = 0.01  # of the range, from which a sensor is not called straight


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Result):
    """A sensor's readings against known values.

    Attributes
    ----------
    channel : str
        Its channel.
    gain : Estimate
        Reading over truth; 1 where the stated sensitivity is right.
    zero : Estimate or None
        Reading at the value zero [unit of the channel]; None where it leaks away.
    nonlinearity : Estimate
        Largest deviation from the straight line, as a share of the range.
    reference, levels : ndarray (n,)
        The known values and what was read [unit of the channel]; of a leaking sensor with the leak put back.
    status : str
        "ok", or in words what to beware of.
    """

    channel: str
    gain: Estimate
    zero: Estimate | None
    nonlinearity: Estimate
    reference: Array
    levels: Array
    status: str

    @property
    def correction(self) -> float:
        """What readings are to be multiplied with."""
        return 1 / self.gain.value


def calibrate(
    record: Record, *, channel: str, reference: Sequence[float], reference_sd: float = 0.0, leaks: bool = False
) -> Calibration:
    r"""By which factor, and from which zero, does a sensor read what is put on it?

    The record stands on one level after another: weights on a load cell, gauge blocks before a displacement sensor, an
    accelerometer turned over in gravity. The levels are found in it (:func:`find_holds`); a straight
    line through them against the known values gives gain and zero, its scatter how sure they are, with
    Student's quantile for few levels; scatter that grows with the level counts as HC3 (MacKinnon and White 1985).

    A charge that leaks away with the time constant T, :math:`\dot y = \dot u - y / T`, is put back,
    :math:`u = y + \frac{1}{T} \int y\, dt`, with the 1/T under which the levels are flat, and a drift beside it.

    Parameters
    ----------
    record : Record
        With the levels, a second or more each.
    channel : str
        The sensor's.
    reference : sequence of float
        What it stood on, in order, in SI units of the channel.
    reference_sd : float
        How sure these are, as a part of them.
    leaks : bool
        Whether the sensor is piezoelectric, and forgets.

    Returns
    -------
    Calibration

    Raises
    ------
    RecordError
        The channel is missing or not finite.
    EstimateError
        Fewer than three levels, levels that are all alike, or a reading that does not follow them.

    Examples
    --------
    >>> weights = np.array([0.0, 1.0, 2.0, 3.0, 0.0])
    >>> rng = np.random.default_rng(1)
    >>> read = np.repeat(0.1 + 1.02 * weights, 2000) + 0.002 * rng.standard_normal(10000)
    >>> calibration = calibrate(Record.of({"load": read}, fs=1000), channel="load", reference=weights)
    >>> calibration.gain.includes(1.02), calibration.zero.includes(0.1)
    (True, True)
    """
    values = np.asarray(reference, dtype=float)
    _require_reference(values, reference_sd)
    holds = find_holds(record, channel, len(values), question=QUESTION)
    unit, shared = record.channels[channel].unit, np.zeros((len(values), 0))
    if leaks:
        record, shared = _without_leak(record, channel, holds)
        holds = find_holds(record, channel, len(values), question=QUESTION)
    read, level_sd = np.array([hold.level for hold in holds]), np.array([hold.sd for hold in holds])
    fit, sd, residual, quantile = _line(values, read, level_sd, shared)
    gain_sd = math.hypot(sd[0], reference_sd * fit[0])
    if not abs(fit[0]) > 3 * sd[0]:
        raise EstimateError(
            f"{channel} changes by {np.ptp(read):.3g} {unit} over levels that differ by {np.ptp(values):.3g}",
            f"{QUESTION} needs readings that follow what is put on it",
            "check the cable, the channel and the list of levels",
        )
    method = f"{len(read)} levels against known values{', what leaked away put back' if leaks else ''}"
    gain = Estimate.normal(f"gain of {channel}", fit[0], sd=gain_sd, unit="1", method=method, quantile=quantile)
    zero = (
        None
        if leaks
        else Estimate.normal(f"zero of {channel}", fit[1], sd=sd[1], unit=unit, method=method, quantile=quantile)
    )
    largest = float(np.abs(residual).max() / np.ptp(fit[0] * values))
    nonlinearity = Estimate.normal(
        f"nonlinearity of {channel}, share of its range",
        largest,
        sd=float(level_sd.max() / np.ptp(fit[0] * values)),
        unit="1",
        method=method,
    ).within(0.0)
    bent = [Doubt(f"{channel} is off a straight line by {100 * largest:.2g} % of the range", "bent")]
    return Calibration(channel, gain, zero, nonlinearity, values, read, Status(*bent * (largest > BENT)))


def _require_reference(values: Array, sd: float) -> None:
    if len(values) < LEAST or not np.all(np.isfinite(values)) or np.ptp(values) == 0:
        raise EstimateError(
            f"{len(values)} levels", f"{QUESTION} needs {LEAST} finite levels, two of them apart", "give more"
        )
    if not 0 <= sd < 1:
        raise ModelError(f"reference_sd = {sd}", "it is a part of the known values, from 0 to 1", "0.001 is 0.1 %")


def _without_leak(record: Record, channel: str, holds: Sequence[Hold]) -> tuple[Record, Array]:
    """The record with what leaked away put back; and by how much a deviation of leak and drift moves each level."""
    values, time = record[channel], record.time - record.start
    passed = np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)]) / record.fs
    columns, rows = np.column_stack([passed, time]), [hold.rows(record) for hold in holds]
    design, read = (np.concatenate([part[row] - part[row].mean(axis=0) for row in rows]) for part in (columns, values))
    fit = np.linalg.lstsq(design, read)[0]
    residual = read - design @ fit
    variance = float(residual @ residual) / len(residual) * max(1.0, correlation_time(residual))
    spread, axes = np.linalg.eigh(variance * np.linalg.pinv(design.T @ design))
    flat = record.with_channel(channel, values - columns @ fit, unit=record.channels[channel].unit)
    return flat, np.array([columns[row].mean(axis=0) for row in rows]) @ (axes * np.sqrt(np.maximum(spread, 0.0)))


def _line(known: Array, read: Array, read_sd: Array, shared: Array) -> tuple[Array, Array, Array, float]:
    """Slope and zero, their deviations, what is left, and Student's quantile; levels count alike.

    The scatter may by chance be less than what noise alone leaves of a level: then that counts. A block or a weight
    may be wrong by a part of itself: then the highest level, which the line follows most, says least of it (HC3).
    """
    design = np.column_stack([known, np.ones(len(known))])
    inverse = np.linalg.inv(design.T @ design)
    weights = design @ inverse
    fit = read @ weights
    residual = read - design @ fit
    freedom = max(1, len(read) - 2)
    scatter, chance = math.sqrt(float(residual @ residual) / freedom), math.sqrt(float(np.mean(read_sd**2)))
    free = np.maximum(1 - np.sum(weights * design, axis=1), 1e-9)  # of each level, that the line does not follow
    sd = np.maximum(max(scatter, chance) * np.sqrt(np.diag(inverse)), np.sqrt((residual / free) ** 2 @ weights**2))
    sd = np.sqrt(sd**2 + np.sum((weights.T @ shared) ** 2, axis=1))
    return np.asarray(fit, dtype=float), sd, residual, student(float(freedom))


@dataclass(frozen=True, eq=False, repr=False)
class SpringByWeights(Result):
    """A spring's stiffness by what it gives under weights.

    Attributes
    ----------
    stiffness : Estimate
        [N/m].
    force, displacement : ndarray (n,)
        Weights [N] and displacements [m].
    status : str
        "ok", or in words what to beware of.
    """

    stiffness: Estimate
    force: Array
    displacement: Array
    status: str


def spring_by_weights(
    record: Record, *, weights: Sequence[float], weights_sd: float = 0.0, channel: str = "x"
) -> SpringByWeights:
    """How stiff is the spring, by the displacement under known weights?

    As :func:`calibrate`, the other way round: the displacement against the force is the compliance 1/k. What is not
    known of the displacement's gain (``gain_sd`` of the channel) goes into the interval; the contact has to be off, or
    its friction holds part of the weight.

    Parameters
    ----------
    record : Record
        With the displacement, a second or more under each weight.
    weights : sequence of float
        Force along the displacement, in order [N].
    weights_sd : float
        How sure these are, as a part of them.
    channel : str
        The displacement's.

    Returns
    -------
    SpringByWeights

    Raises
    ------
    RecordError, EstimateError
        As :func:`calibrate`.

    Examples
    --------
    >>> weights = np.array([0.0, 2.0, 4.0, 6.0, 0.0])
    >>> x = np.repeat(weights / 2310, 2000) + 1e-6 * np.random.default_rng(1).standard_normal(10000)
    >>> spring_by_weights(Record.of({"x": x}, fs=1000), weights=weights).stiffness.includes(2310)
    True
    """
    calibration = calibrate(record, channel=channel, reference=weights, reference_sd=weights_sd)
    compliance, gain_sd = calibration.gain, record.channels[channel].gain_sd
    if compliance.value <= 0:
        raise EstimateError(
            "a spring that gives against the weight", "displacement and weight have one sign", "turn one of them round"
        )
    # an even interval of the logarithm: a stiffness is never below zero
    part = math.hypot(compliance.spread / compliance.value, gain_sd)
    stiffness = Estimate(
        "spring stiffness",
        1 / compliance.value,
        (math.exp(-1.96 * part) / compliance.value, math.exp(1.96 * part) / compliance.value),
        part / compliance.value,
        "N/m",
        f"displacement under {len(calibration.levels)} weights",
        checks=(f"off a straight line by {100 * calibration.nonlinearity.value:.2g} %",),
    )
    stiffness, status = replace(stiffness, status=calibration.status), calibration.status
    return SpringByWeights(stiffness, calibration.reference, calibration.levels, status)


@dataclass(frozen=True)
class Hold:
    """A level that was held.

    Attributes
    ----------
    first, last : float
        Instants [s] between which it is read, the margins left out.
    level : float
        Its mean [unit of the channel].
    sd : float
        Standard deviation of the mean.
    """

    first: float
    last: float
    level: float
    sd: float

    def rows(self, record: Record) -> slice:
        """Where it lies in its record."""
        first, last = (round((time - record.start) * record.fs) for time in (self.first, self.last))
        return slice(first, last + 1)


def find_holds(record: Record, channel: str, count: int, *, question: str) -> tuple[Hold, ...]:
    """The `count` levels on which a channel stands one after another.

    The record is reduced to the medians of 400 blocks and cut where straight lines through the parts leave least, by
    dynamic programming; a fifth of each part at either end is left to the hand that changes the level.

    Parameters
    ----------
    record : Record
    channel : str
    count : int
        How many levels there are.
    question : str
        For the message.

    Returns
    -------
    tuple of Hold

    Raises
    ------
    RecordError
        The channel is missing or not finite.
    EstimateError
        The record is too short for that many levels.

    Examples
    --------
    >>> levels = np.repeat([0.0, 2.0, 5.0], 400) + 0.01 * np.random.default_rng(1).standard_normal(1200)
    >>> [round(hold.level, 1) for hold in find_holds(Record.of({"x": levels}, fs=100), "x", 3, question="an example")]
    [-0.0, 2.0, 5.0]
    """
    record.require_clean(channel, question=question, samples=2 * SHORTEST * count)
    values = record[channel]
    size = max(1, len(values) // BLOCKS)
    blocks = np.median(values[: len(values) // size * size].reshape(-1, size), axis=1)
    if len(blocks) < SHORTEST * count:
        raise EstimateError(
            f"{len(values)} samples for {count} levels", f"{question} needs a second or more at each", "hold longer"
        )
    edges = [edge * size for edge in _cuts(blocks, count)]
    edges[-1] = len(values)
    return tuple(_hold(record, values, first, last) for first, last in itertools.pairwise(edges))


def _cuts(blocks: Array, count: int) -> list[int]:
    """Where `count` straight lines part, the ends included: least squares by dynamic programming."""
    cost = _line_costs(blocks)
    size = len(blocks)
    best = np.full((count + 1, size + 1), math.inf)
    back = np.zeros((count + 1, size + 1), dtype=int)
    best[0, 0] = 0.0
    for part in range(1, count + 1):
        total = best[part - 1][:, None] + cost  # [from, to]
        back[part] = total.argmin(axis=0)
        best[part] = total.min(axis=0)
    edges = [size]
    for part in range(count, 0, -1):
        edges.append(int(back[part, edges[-1]]))
    return edges[::-1]


def _line_costs(values: Array) -> Array:
    """What a straight line leaves of each stretch, [from, to]; infinite where it is too short."""
    size = len(values)
    time = np.arange(size, dtype=float)

    def sums(row: Array) -> Array:
        return np.concatenate([[0.0], np.cumsum(row)])

    values = values - values.mean()
    n, t, y = (sums(row) for row in (np.ones(size), time, values))
    tt, ty, yy = (sums(row) for row in (time * time, time * values, values * values))

    def over(total: Array) -> Array:
        return total[None, :] - total[:, None]

    with np.errstate(divide="ignore", invalid="ignore"):
        count = over(n)
        stt, sty = over(tt) - over(t) ** 2 / count, over(ty) - over(t) * over(y) / count
        left = over(yy) - over(y) ** 2 / count - sty**2 / stt
    left[over(n) < SHORTEST] = math.inf
    return np.where(np.isfinite(left), np.maximum(left, 0.0), math.inf)


def _hold(record: Record, values: Array, first: int, last: int) -> Hold:
    margin = round(MARGIN * (last - first))
    part = values[first + margin : last - margin]
    time = (np.arange(len(part)) - (len(part) - 1) / 2) / record.fs
    slope = float(time @ part / (time @ time))
    sd = mean_uncertainty(part - part.mean() - slope * time)[0]
    start = record.start + (first + margin) / record.fs
    return Hold(start, start + (len(part) - 1) / record.fs, float(part.mean()), sd)
