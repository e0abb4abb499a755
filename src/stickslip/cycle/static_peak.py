"""The friction's peak after a reversal, as a sensor shows it, the static coefficient of a contact that slides to and
fro, and when a slip begins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import is_measured
from stickslip.cycle.slips import FALL, Cut, Stroke, cut_at_reversals
from stickslip.cycle.tribometer import Coefficients
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.record.record import Record
from stickslip.signals.noise import noise_level
from stickslip.statistics import mean_of_cycles

TIMED = 0.8  # of the level, up to which the friction's rise is timed: from there on a filter rounds it
TWICE = 2.0  # times the level, beyond which a cell that rings passes its level in a small part of its rise
STEP, QUIET = 0.05, 6.0  # of a peak, and deviations of noise: steps in which its sides are followed
# How far a load cell swings beyond the friction when the contact lets go: as far as the peak lies below the line of its
# rise where friction falls at once (parabola), 1.75 times as far where it falls slowly (sine); 0.64 of a sample's rise
# where that is not resolved. By 80 simulated tests and 60 without a static friction.
SWING, UNSEEN = 1.75, 0.64
FLAT = 0.01  # of the peak: friction and cell are not told apart closer: of those 80, one lay off by 0.1 %
ALIKE = 3.0  # times the other, within which the time of a peak's fall is that of the rise before it
OVERSHOOT = 0.09  # of the level, by which a Butterworth filter of order two overshoots a jump from it to its opposite


class Peak(NamedTuple):
    """A peak of the friction in a stroke, by forces [N] and samples."""

    height: float
    level: float  # of the sliding friction
    rise: float  # samples from the level of the other way to that of this one; in proportion for a peak above twice it
    fall: float  # samples until half of what is above the level is gone
    before: float  # rise in the sample before
    after: float  # fall in the sample after
    slope: float  # steepest rise before it, a sample
    swing: float  # of a cell that rises so and is let go, at most

    @classmethod
    def at(cls, row: int, force: Array, level: float, noise: float) -> Peak:
        """The peak at a row of a stroke's friction."""
        height, after = float(force[row]), np.append(force[row + 1 :], level)
        slope, swing = _swing(force, row, max(STEP * height, QUIET * noise))
        return cls(
            height,
            level,
            (1.0 + np.count_nonzero(np.abs(force[:row]) < TIMED * level)) * max(height / (TWICE * level), 1.0),
            1.0 + int(np.argmax(after <= (height + level) / 2)),
            max(height - float(force[row - 1]), 0.0) if row else math.inf,
            height - float(after[0]),
            slope,
            max(swing, FLAT * height),
        )

    @classmethod
    def median(cls, peaks: Sequence[Peak]) -> Peak:
        """The median of each of its numbers."""
        return cls._make(np.median(peaks, axis=0).tolist())


def unseen(peak: Peak) -> tuple[float, float]:
    """How much less and more than a measured peak the contact may have borne [N], by samples and sensor.

    A cell that is let go swings on; a filter overshoots a jump by 9 % of the level, and cuts a peak as brief as the
    jump before it, which may as well be its overshoot. It bore no less than its level. Between two samples friction
    goes on as it rose, or fell.
    """
    excess, beyond = peak.height - peak.level, min(peak.before, peak.after)
    if excess < 0:  # still on its way to the level, or held back by what follows the speed
        return 0.0, max(peak.after, -excess)
    if peak.fall > ALIKE * peak.rise:  # longer than what a filter would make of the jump
        return min(peak.swing, OVERSHOOT * peak.level), beyond
    if peak.fall >= peak.rise / ALIKE and peak.swing >= excess:
        return excess, max(peak.after, excess)
    return min(peak.swing, excess), beyond


def _swing(force: Array, row: int, step: float) -> tuple[float, float]:
    """The steepest rise before a peak, and how far a cell that rises so swings beyond what lets it go.

    By what the peak lacks to the line of that rise, and by how fast it falls; without a bound where not resolved.
    """
    height = force[row]
    marks = height - step * np.arange(0.5, max(2.5, 0.9 * height / step), 0.5)
    before = np.array([_since(force[row::-1], mark) for mark in marks])
    spans = before[2:] - before[:-2]
    if not np.isfinite(spans).any():
        return (float(height - force[row - 1]) if row else math.inf), math.inf
    slopes = (marks[:-2] - marks[2:]) / spans
    steepest = int(np.nanargmax(slopes))
    slope = float(slopes[steepest])
    lacks = (marks[steepest] + marks[steepest + 2] + slope * (before[steepest] + before[steepest + 2])) / 2 - height
    swings = SWING * max(float(lacks), 0.0) + UNSEEN * slope
    falls = _since(force[row:], height - step) + 0.5  # the peak lies half a sample off at most, on average
    return slope, min(swings, (slope * falls) ** 2 / (2 * step))


def _since(force: Array, mark: float) -> float:
    """Samples, with parts, until a force falls below a mark; NaN where it does not."""
    below = np.flatnonzero(force < mark)
    if not len(below) or below[0] == 0:
        return math.nan
    row = int(below[0])
    return row - 1 + float((force[row - 1] - mark) / (force[row - 1] - force[row]))


STATIC, NAME = "the static coefficient", "coefficient of friction, static"
AUDIBLE = 5.0  # deviations of its noise, by which a peak's fall is seen
NEAR = 0.5  # of the sliding friction: the static one's peak is looked for from here on
MOSTLY = 2 / 3  # of the strokes that show a peak
COARSE = 0.5  # of the sliding friction: what rises by more from a sample to the next may peak anywhere


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


class _Turn(NamedTuple):
    """What a stroke begins with: its row of the record, that of the friction's first peak, and the peak."""

    start: int
    row: int
    peak: Peak
    shown: bool  # whether the friction falls after it by what would be seen


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
        As of :func:`~stickslip.cycle.friction_coefficients`, its friction measured.
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
    >>> from stickslip.cycle.tribometer import friction_coefficients
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
            f"{STATIC} needs one that was measured: smoothing takes off its peak",
            "give the load cell's channel as friction",
        )
    cut = cut_at_reversals(record, contact="ground", question=STATIC)
    noise = record.channels["friction"].noise or noise_level(record["friction"], record.fs)
    begin = coefficients.time[coefficients.steady] if coefficients.steady else -math.inf
    turns = _turns(cut, noise, begin)
    middle = Peak.median([turn.peak for turn in turns])
    _require_fine(middle, record.fs)
    below, above = unseen(middle)
    loads = _loads(record, coefficients, turns)
    of_strokes = (np.array([turn.peak.height for turn in turns]) + (above - below) / 2) / loads
    load = float(np.median(loads))
    static = mean_of_cycles(NAME, of_strokes, unit="1", method="peak after each reversal, mean of strokes", of="stroke")
    relative = math.hypot(record.channels["friction"].gain_sd, coefficients.load.sd / coefficients.load.value)
    half = ((above + below) / 2 + noise) / load
    low, high = static.interval
    static = replace(static, interval=(low - half, high + half), sd=math.hypot(static.sd, half / NORMAL_95))
    if static.interval[0] * load <= middle.level:
        raise EstimateError(
            f"the friction peaks at {middle.height:.3g} N, {middle.height - middle.level:.2g} N above its level",
            f"a load cell that is let go may swing {below + noise:.2g} N beyond it, by how the peak rises and falls",
            "turn round more slowly, take a stiffer or lighter holder, or sample faster",
        )
    starts = np.array([turn.start for turn in turns])
    return StaticCoefficient(static.widened(relative).within(0.0), of_strokes, record.start + starts / record.fs)


def _turns(cut: Cut, noise: float, begin: float) -> list[_Turn]:
    """The first peak of each stroke, where most of them show one."""
    start, fs = cut.motion.start, cut.motion.fs
    strokes = zip(cut.ways, cut.levels, strict=True)
    turns = [_turn(cut, stroke, level, noise) for stroke, level in strokes if start + stroke[0] / fs >= begin]
    turned = [turn for turn in turns if turn is not None]
    shown = [turn for turn in turned if turn.shown]
    if not turned or len(shown) < MOSTLY * len(turned):
        lacking = (
            f"in {len(turned) - len(shown)} of {len(turned)} strokes the friction comes to its level without a peak"
        )
        fall = f" of {max(FALL * turned[0].peak.level, AUDIBLE * noise):.2g} N" if turned else ""
        raise EstimateError(
            f"{lacking}{fall}",
            "a static coefficient above the kinetic one shows as a peak of the friction after a reversal",
            "quote the plateau; a peak may be shorter than a sample, or lie in the noise: sample faster",
        )
    return shown


def _turn(cut: Cut, stroke: tuple[int, int, int], level: float, noise: float) -> _Turn | None:
    """The first peak after a reversal; None where the friction does not turn round."""
    first, last, way = stroke
    begin = max(0, first - cut.motion.blur)  # a differentiated speed turns round so much later at most
    force = way * (cut.friction[begin:last] - cut.offset)
    lowest = int(np.argmin(force[: max(2, len(force) // 2)]))
    rising = force[lowest:]
    near = np.flatnonzero(rising >= NEAR * level)
    if level <= 0 or not len(near):
        return None
    highest = np.maximum.accumulate(rising[near[0] :])
    fallen = np.flatnonzero(highest - rising[near[0] :] > max(FALL * level, AUDIBLE * noise))
    end = int(near[0] + fallen[0]) if len(fallen) else len(rising) - 1
    row = int(near[0] + np.argmax(rising[near[0] : end + 1]))
    return _Turn(begin, begin + lowest + row, Peak.at(row, rising, level, noise), bool(len(fallen)))


def _require_fine(peak: Peak, fs: float) -> None:
    """Refuse a peak that so few samples rise to that it may have been anywhere between them."""
    rise = max(peak.before, peak.slope)
    if not rise < COARSE * peak.level:
        faster = f"sample it at {2 * fs * rise / (COARSE * peak.level):.0f} Hz or more" if rise < math.inf else ""
        raise EstimateError(
            f"the friction rises by {rise:.2g} N from a sample to the next, to a level of {peak.level:.2g} N",
            f"a peak is told where it rises by less than {100 * COARSE:.0f} % of that",
            faster or "sample faster",
        )


def _loads(record: Record, coefficients: Coefficients, turns: list[_Turn]) -> Array:
    """The load while each peak is come to: as stated, or the mean of what was measured."""
    if not coefficients.measured:
        return np.full(len(turns), coefficients.load.value)
    load = np.abs(record["normal"])
    return np.array([load[turn.start : turn.row + 1].mean() for turn in turns])


# When a slip begins, by its first travel, and what pulls just then.
LEAST = 8  # samples in which a stick's end and a slip's start can be told
TRAVEL = 0.02  # of a stroke: how far the start of a slip is followed; farther on Stribeck's curves bend
BEFORE = 5  # a stick's last fifth tells what it bears at its end
ROWS = 256  # of the start of a slip that are looked at
MODELS = ("at once", "with the speed", "both")  # how friction falls as a slip begins


class Begun(NamedTuple):
    """The start of a slip, by each of the models."""

    pull: Array  # what pulls then [N]; NaN where a model finds none
    change: Array  # by how much that changes from a sample to the next
    misfit: Array  # logarithm of the sum of squares that the model leaves of the travel; infinite where it finds none


def begun(stroke: Stroke, pull: Array, mass: float, fs: float) -> Begun | None:
    r"""What pulls when the slip of a stroke begins; None where its first travel is too short, or no model finds it.

    The mass rests up to an instant :math:`t_0`, at which friction is what pulls, and then moves by

    .. math:: m\ddot x = p - f + b\dot x

    with f constant, no larger than the pull at :math:`t_0` (friction falls at once, b = 0), or equal to it (friction
    falls with the speed, as along a Stribeck curve), or both; by least squares over :math:`t_0`, f and b.
    """
    if stroke.slip < LEAST:
        return None
    first = stroke.slip // 2
    way = stroke.displacement - np.median(stroke.displacement[first : stroke.slip + 1])
    last = int(np.argmax(way > TRAVEL * np.ptp(way))) + 1
    if last - first < LEAST:
        return None
    force = stroke.way * pull[stroke.first + first : stroke.first + last]
    onsets = [(np.nan, np.nan, np.inf)] * len(MODELS)
    for place, (begins, misfit) in enumerate(_starts(way[first:last], force, mass, fs)):
        if not np.isfinite(misfit):
            continue
        rows = np.arange(max(0, int(begins) - max(4, (first + int(begins)) // BEFORE)), int(begins) + 1)
        slope, value = np.polyfit(rows - begins, force[rows], 1) if len(rows) > 1 else (0.0, force[rows[0]])
        onsets[place] = (float(value), float(abs(slope)), misfit)
    return Begun(*np.transpose(onsets)) if np.isfinite(onsets[0][2]) or np.isfinite(onsets[1][2]) else None


def _starts(travel: Array, pull: Array, mass: float, fs: float) -> list[tuple[float, float]]:
    """When, in samples, a slip begins of which the first travel is known, and the misfit: by each of the models."""
    every = len(travel) // ROWS + 1
    travel, pull, count = travel[::every], pull[::every], len(travel[::every])
    begins: Any = np.arange(1, count - 3)
    since = np.maximum(np.arange(count) - begins[:, None], 0.0)
    once, moved = _summed(pull), _summed(travel)
    twice, rest = _summed(once), np.cumsum(travel) / np.arange(1, count + 1)
    step = every**2 / (mass * fs**2)
    # what moves the mass from each begin on: the pull, a force of 1 N, and one in proportion to the speed
    pulled = step * np.where(since > 0, twice - twice[begins, None] - once[begins, None] * since, 0.0)
    unit = step * since**2 / 2
    driven = np.where(since > 0, moved - moved[begins, None] - rest[begins, None] * since, 0.0)
    left, first = travel - pulled, pull[begins, None]
    fits = [(left, [unit]), (left + first * unit, [driven]), (left, [unit, driven])]
    results = []
    for place, (wanted, columns) in enumerate(fits):
        cost, factors = _left(wanted, columns)
        if place != 1:
            cost[pull[begins] < -factors[0]] = np.inf
        if place:
            cost[factors[-1] < 0] = np.inf  # friction that grows with the speed
        results.append(_least(begins, cost, every))
    return results


def _left(wanted: Array, columns: list[Array]) -> tuple[Array, Array]:
    """What columns leave of each row by least squares, all of them about their means, and the factors; infinite where a
    column does not change, as that in proportion to the speed does not within one count of the travel."""
    wanted, *columns = (part - part.mean(axis=1, keepdims=True) for part in (wanted, *columns))
    products = np.array([[np.sum(one * other, axis=1) for one in columns] for other in columns])
    sides = np.array([np.sum(column * wanted, axis=1) for column in columns])
    matrices = np.moveaxis(products, 2, 0)
    still = np.linalg.matrix_rank(matrices, hermitian=True) < len(columns)
    matrices[still] = np.eye(len(columns))
    factors = np.linalg.solve(matrices, sides.T[:, :, None])[:, :, 0].T
    rest = wanted - sum(factor[:, None] * column for factor, column in zip(factors, columns, strict=True))
    return np.where(still, np.inf, np.sum(rest**2, axis=1)), factors


def _least(begins: Any, cost: Array, every: int) -> tuple[float, float]:
    """Where the cost is least, between samples too, and its logarithm."""
    best = int(np.argmin(cost))
    if not np.isfinite(cost[best]):
        return np.nan, np.inf
    around = cost[max(best - 1, 0) : best + 2]
    moved = 0.0
    if len(around) == 3 and np.isfinite(around).all() and (curved := around[0] - 2 * around[1] + around[2]) > 0:
        moved = (around[0] - around[2]) / (2 * curved)
    return float(every * (begins[best] + moved)), float(np.log(max(cost[best], np.finfo(float).tiny)))


def _summed(values: Array) -> Array:
    """The integral, by trapezoids of one sample."""
    return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)])
