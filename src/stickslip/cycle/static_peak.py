"""The static coefficient of friction of a contact that slides to and fro: the peak after each reversal."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import is_measured
from stickslip.cycle.peak import Peak, unseen
from stickslip.cycle.slips import FALL, Cut, cut_at_reversals
from stickslip.cycle.tribometer import Coefficients
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.record.record import Record
from stickslip.signals.noise import noise_level
from stickslip.statistics import mean_of_cycles

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
