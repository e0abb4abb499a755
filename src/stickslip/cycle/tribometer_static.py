"""The static coefficient of a tribometer: the friction's peak at each reversal, over the load."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import is_measured
from stickslip.cycle.slips import FALL, Cut, cut_at_reversals
from stickslip.cycle.tribometer import Coefficients
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.record.record import Record
from stickslip.signals.noise import noise_level
from stickslip.statistics import mean_of_cycles

Array = NDArray[np.float64]

QUESTION, NAME = "the static coefficient", "coefficient of friction, static"
AUDIBLE = 5.0  # deviations of its noise, by which a peak's fall is seen
NEAR = 0.5  # of the sliding friction: a first peak is looked for from here on
MOSTLY = 2 / 3  # of the strokes that show a peak
STEP, QUIET = 0.05, 6.0  # of a peak, and deviations of noise: steps in which its sides are followed
COARSE = 0.5  # of the sliding friction: what rises by more from a sample to the next may peak anywhere
# How far a load cell swings beyond the friction when the contact lets go: as far as the peak lies below the line of its
# rise where friction falls at once (parabola), 1.75 times as far where it falls slowly (sine); 0.64 of a sample's rise
# where that is not resolved. By 80 simulated tests and 60 without a static friction.
SWING, UNSEEN = 1.75, 0.64
FLAT = 0.01  # of the peak: friction and cell are not told apart closer: of those 80, one lay off by 0.1 %


@dataclass(frozen=True, eq=False, repr=False)
class StaticCoefficient(Result):
    """The static coefficient of friction.

    Attributes
    ----------
    static : Estimate
        The mean over the strokes.
    of_strokes : ndarray, shape (m,)
        Of each stroke that shows a peak.
    time : ndarray, shape (m,)
        When each of these begins [s].
    """

    static: Estimate
    of_strokes: Array
    time: Array


class _Peak(NamedTuple):
    """The first peak of a stroke: its height, the level after it, and what its sides tell [N, samples]."""

    start: int
    row: int
    height: float
    level: float
    falls: float  # 1 where the friction falls after it by what would be seen
    last: float  # rise in the sample before it
    slope: float  # steepest rise
    lacks: float  # what it lacks to the line of that rise
    swing: float  # of a cell that falls as fast as this one, at most


def static_coefficient(record: Record, *, coefficients: Coefficients) -> StaticCoefficient:
    r"""How large is the coefficient of friction at which the contact lets go, after each reversal?

    After a reversal the force rises, as far as load cell and holder give way, until the contact slips: its first peak
    there, over the load, is the static coefficient. A cell that is let go swings on, by what its ring makes of the
    rise at that instant: by the sides of the peak, from nothing to 1.75 times what the peak lacks to the line of its
    rise, or :math:`(\dot f t)^2 / 2h` where it falls by h in t, whichever is less. Between two samples the force rises
    farther, by as much as in the sample before. Both are in the interval, and the value is the middle. What a filter
    of the cell or an amplifier takes off is not.

    Parameters
    ----------
    record : Record
        As of :func:`friction_coefficients`, its friction measured.
    coefficients : Coefficients
        What that told of it: the load, and from when on it has worn in.

    Returns
    -------
    StaticCoefficient

    Raises
    ------
    RecordError
        A channel is missing or broken, or the friction comes from a balance of forces.
    EstimateError
        No peak, one that is sampled too slowly, or one that the swing of the cell would make as well.

    Examples
    --------
    >>> from stickslip.cycle import friction_coefficients
    >>> n = np.arange(20000)
    >>> along, way = n % 1000, np.where(n // 1000 % 2 == 0, 1, -1)
    >>> force = np.where(along < 50, 0.09 * along - 1.8, 1.8 + 0.7 * np.exp(-np.maximum(along - 50, 0) / 20))
    >>> force = way * force + np.random.default_rng(0).normal(0, 0.01, n.size)
    >>> test = Record.of({"x": way * 1e-6 * (along - 500), "friction": force}, fs=1000)
    >>> static_coefficient(test, coefficients=friction_coefficients(test, normal=10.0)).static.includes(0.25)
    True
    """
    if not is_measured(record, "friction"):
        raise RecordError(
            "friction came from a balance of forces",
            f"{QUESTION} needs one that was measured: smoothing takes off its peak",
            "give the load cell's channel as friction",
        )
    cut = cut_at_reversals(record, contact="ground", question=QUESTION)
    noise = record.channels["friction"].noise or noise_level(record["friction"], record.fs)
    begin = coefficients.time[coefficients.steady] if coefficients.steady else -math.inf
    peaks = _peaks(cut, noise, begin)
    middle = _Peak._make(np.median(peaks, axis=0))
    _require_fine(middle, record.fs)
    beyond = max(min(SWING * max(middle.lacks, 0.0) + UNSEEN * middle.slope, middle.swing), FLAT * middle.height)
    loads = _loads(record, coefficients, peaks)
    of_strokes = (np.array([peak.height for peak in peaks]) + (middle.last - beyond) / 2) / loads
    load = float(np.median(loads))
    static = mean_of_cycles(NAME, of_strokes, unit="1", method="peak after each reversal, mean of strokes", of="stroke")
    relative = math.hypot(record.channels["friction"].gain_sd, coefficients.load.sd / coefficients.load.value)
    half = ((middle.last + beyond) / 2 + noise) / load
    low, high = static.interval
    static = replace(static, interval=(low - half, high + half), sd=math.hypot(static.sd, half / NORMAL_95))
    if static.interval[0] * load <= middle.level:
        raise EstimateError(
            f"the friction peaks at {middle.height:.3g} N, {middle.height - middle.level:.2g} N above its level",
            f"a load cell that is let go may swing {beyond + noise:.2g} N beyond it, by how the peak rises and falls",
            "turn round more slowly, take a stiffer or lighter holder, or sample faster",
        )
    starts = np.array([peak.start for peak in peaks])
    return StaticCoefficient(static.widened(relative).within(0.0), of_strokes, record.start + starts / record.fs)


def _peaks(cut: Cut, noise: float, begin: float) -> list[_Peak]:
    """The first peak of each stroke, where most of them show one."""
    start, fs = cut.motion.start, cut.motion.fs
    strokes = zip(cut.ways, cut.levels, strict=True)
    peaks = [_peak(cut, stroke, level, noise) for stroke, level in strokes if start + stroke[0] / fs >= begin]
    turned = [peak for peak in peaks if peak is not None]
    shown = [peak for peak in turned if peak.falls]
    if not turned or len(shown) < MOSTLY * len(turned):
        lacking = (
            f"in {len(turned) - len(shown)} of {len(turned)} strokes the friction comes to its level without a peak"
        )
        fall = f" of {max(FALL * turned[0].level, AUDIBLE * noise):.2g} N" if turned else ""
        raise EstimateError(
            f"{lacking}{fall}",
            "a static coefficient above the kinetic one shows as a peak of the friction after a reversal",
            "quote the plateau; a peak may be shorter than a sample, or lie in the noise: sample faster",
        )
    return shown


def _peak(cut: Cut, stroke: tuple[int, int, int], level: float, noise: float) -> _Peak | None:
    """The first peak after a reversal; None where the friction does not turn round."""
    first, last, way = stroke
    begin = max(0, first - cut.motion.blur)  # a differentiated speed turns round so much later at most
    force = way * (cut.friction[begin:last] - cut.offset)
    lowest = int(np.argmin(force[: max(2, len(force) // 2)]))
    near = np.flatnonzero(force[lowest:] >= NEAR * level)
    if level <= 0 or not len(near):
        return None
    near_row = lowest + int(near[0])
    highest = np.maximum.accumulate(force[near_row:])
    fallen = np.flatnonzero(highest - force[near_row:] > max(FALL * level, AUDIBLE * noise))
    end = near_row + int(fallen[0]) if len(fallen) else len(force) - 1
    row = near_row + int(np.argmax(force[near_row : end + 1]))
    rise = float(force[row] - force[row - 1]) if row else math.inf
    sides = _sides(force, row, max(STEP * force[row], QUIET * noise)) or (rise, 0.0, math.inf)
    return _Peak(begin, begin + row, float(force[row]), level, float(bool(len(fallen))), max(rise, 0.0), *sides)


def _sides(force: Array, row: int, step: float) -> tuple[float, float, float] | None:
    """The steepest rise before a peak, what the peak lacks to its line, and the swing by its fall; None unresolved."""
    height = force[row]
    marks = height - step * np.arange(0.5, max(2.5, 0.9 * height / step), 0.5)
    before = np.array([_since(force[row::-1], mark) for mark in marks])
    spans = before[2:] - before[:-2]
    if not np.isfinite(spans).any():
        return None
    slopes = (marks[:-2] - marks[2:]) / spans
    steepest = int(np.nanargmax(slopes))
    slope = float(slopes[steepest])
    lacks = (marks[steepest] + marks[steepest + 2] + slope * (before[steepest] + before[steepest + 2])) / 2 - height
    falls = _since(force[row:], height - step) + 0.5  # the peak lies half a sample off at most, on average
    return slope, float(lacks), (slope * falls) ** 2 / (2 * step)


def _since(force: Array, mark: float) -> float:
    """Samples, with parts, until a force falls below a mark; NaN where it does not."""
    below = np.flatnonzero(force < mark)
    if not len(below) or below[0] == 0:
        return math.nan
    row = int(below[0])
    return row - 1 + float((force[row - 1] - mark) / (force[row - 1] - force[row]))


def _require_fine(peak: _Peak, fs: float) -> None:
    """Refuse a peak that so few samples rise to that it may have been anywhere between them."""
    rise = max(peak.last, peak.slope)
    if not rise < COARSE * peak.level:
        faster = f"sample it at {2 * fs * rise / (COARSE * peak.level):.0f} Hz or more" if rise < math.inf else ""
        raise EstimateError(
            f"the friction rises by {rise:.2g} N from a sample to the next, to a level of {peak.level:.2g} N",
            f"a peak is told where it rises by less than {100 * COARSE:.0f} % of that",
            faster or "sample faster",
        )


def _loads(record: Record, coefficients: Coefficients, peaks: list[_Peak]) -> Array:
    """The load while each peak is come to: as stated, or the mean of what was measured."""
    if not coefficients.measured:
        return np.full(len(peaks), coefficients.load.value)
    load = np.abs(record["normal"])
    return np.array([load[peak.start : peak.row + 1].mean() for peak in peaks])
