"""The friction's peak after a reversal, as a sensor shows it: how far what the contact bore may lie from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array

NEAR = 0.8  # of the level, up to which the friction's rise is timed: from there on a filter rounds it
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
            (1.0 + np.count_nonzero(np.abs(force[:row]) < NEAR * level)) * max(height / (TWICE * level), 1.0),
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
