"""Where the fit of a ring-down begins: blocks, period, release and amplitudes, read off the record itself.

The fit of one release in white noise: blocks, start, every number of half cycles, intervals; all of it compiled.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.compiled import FAST, compiled
from stickslip.decay.profile import intervals, over_half_cycles, solve
from stickslip.decay.waveform import AMPLITUDE, DAMPING, DRY, RATE, RELEASE, REST, Array, Blocks, normal_equations
from stickslip.signals.pieces import turning_points
from stickslip.statistics import student

BLOCKS = 40  # a period; the variance of the answer rises by 0.3 % of itself
FIRST_SWINGS = 0.25  # of the range: what counts as a swing before the noise is averaged
LATER_SWINGS = 0.05
NOISES = 12.0  # standard deviations of the noise that a swing is larger than

ROUNDING = 1e-9  # of the range
AT_ONCE = 0.1  # samples after the first one, within which a turn is before it
CANDIDATES = 40  # numbers of half cycles kept


@compiled(**FAST)
def block_means(samples, size, means):
    """Mean of every `size` samples; of the rest the last."""
    total = samples.shape[0]
    for block in range(means.shape[0]):
        first, last = block * size, min(block * size + size, total)
        mean = 0.0
        for j in range(first, last):
            mean += samples[j]
        means[block] = mean / (last - first)


@compiled(**FAST)
def roughness(values):
    """Standard deviation of the noise, by fourth differences: of a motion of 20 samples a period 0.1 % is left."""
    total = 0.0
    for j in range(values.shape[0] - 4):
        fourth = values[j] - 4.0 * values[j + 1] + 6.0 * values[j + 2] - 4.0 * values[j + 3] + values[j + 4]
        total += fourth * fourth
    return math.sqrt(total / (70.0 * max(values.shape[0] - 4, 1)))


@compiled(**FAST)
def passages(values, rows, count, times):
    """When the motion passes half way between one extreme and the next, as the area under the swing has it.

    The same share of every half cycle, so that they lie half a period apart.
    """
    for k in range(count - 1):
        top, bottom = values[rows[k]], values[rows[k + 1]]
        area = 0.0
        for j in range(rows[k], rows[k + 1]):
            area += values[j] - bottom
        times[k] = rows[k] + area / (top - bottom)


@compiled(**FAST)
def half_period(values, rows, times, count):
    """Spacing and first of the passages, by least squares weighted with the swings squared; (0, 0) if there is one."""
    s0, s1, s2, t0, t1 = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(count - 1):
        swing = values[rows[k]] - values[rows[k + 1]]
        weight = swing * swing
        s0 += weight
        s1 += weight * k
        s2 += weight * k * k
        t0 += weight * times[k]
        t1 += weight * k * times[k]
    det = s0 * s2 - s1 * s1
    if count < 3 or det <= 0.0:
        return 0.0, 0.0
    return (s0 * t1 - s1 * t0) / det, (s2 * t0 - s1 * t1) / det


@compiled(**FAST)
def linear_step(p, n, blocks, hessian, gradient, work):
    """Best dry friction, rest and amplitude for the other three parameters: they enter linearly."""
    small, right, answer, factor = work[3, :3, :3], work[4, 0, :3], work[4, 1, :3], work[5, :3, :3]
    squares = normal_equations(p, n, blocks, hessian, gradient, work[:3])
    places = (DRY, REST, AMPLITUDE)
    for j in range(3):
        right[j] = gradient[places[j]]
        for k in range(3):
            small[j, k] = hessian[places[j], places[k]]
    if not solve(small, right, answer, factor, 1e-12):
        return squares
    for j in range(3):
        p[places[j]] += answer[j]
        squares -= answer[j] * right[j]
    return squares


@compiled(**FAST)
def guess(blocks, rows, times, p, work):
    """First parameters of the motion in `p`; the number of half cycles seen, 0 where there are fewer than two."""
    means, size, _, dt, order = blocks
    low, high = means[0], means[0]
    for j in range(means.shape[0]):
        low, high = min(low, means[j]), max(high, means[j])
    hessian, gradient, trial = work[8, :6], work[9, 0], work[9, 1]
    count = turning_points(means, max(LATER_SWINGS * (high - low), NOISES * roughness(means)), rows)
    passages(means, rows, count, times)
    spacing, first = half_period(means, rows, times, count)
    if spacing <= 0.0:
        return 0
    best, step = math.inf, size * dt
    half = spacing * step
    for shift in range(-4, 5 if order == 0 else 9, 4 if order == 0 else 1):  # quarters of a half period, backwards
        release = (first + 0.5) * step - (0.5 + 0.25 * shift) * half - 0.5 * dt
        for damping in (0.001, 0.01, 0.03, 0.08, 0.2):
            trial[DAMPING], trial[RELEASE] = damping, release
            trial[RATE] = math.pi / (half * math.sqrt(1.0 - damping * damping))
            trial[DRY], trial[REST] = 0.0, means[means.shape[0] - 1]
            trial[AMPLITUDE] = means[rows[0]] - trial[REST] if order == 0 else high - low
            n = max(1, count - 1 + shift // 4)
            squares = linear_step(trial, n, blocks, hessian, gradient, work)
            if squares < best and trial[AMPLITUDE] != 0.0:
                best = squares
                for k in range(6):
                    p[k] = trial[k]
    return count - 1


@compiled(**FAST)
def block_size(samples, rows, times):
    """Samples a block, for about `BLOCKS` of them a period; 0 where no period is seen."""
    low, high = samples[0], samples[0]
    for j in range(samples.shape[0]):
        low, high = min(low, samples[j]), max(high, samples[j])
    count = turning_points(samples, FIRST_SWINGS * (high - low), rows)
    passages(samples, rows, count, times)
    spacing, _ = half_period(samples, rows, times, count)
    return max(1, int(2.0 * spacing / BLOCKS)) if spacing > 0.0 else 0


class Search:
    """Fits of one release after another, in memory that is laid out once."""

    def __init__(self, longest: int = 2000) -> None:
        self.work = np.empty((10, 7, 6))
        self.fits = np.empty((CANDIDATES, 9))
        self.ends = np.empty((6, 2))
        self.rows = np.empty(longest, dtype=np.int64)
        self.times = np.empty(longest)
        self.start = np.empty(6)

    def blocks(self, samples: Array, dt: float, order: int = 0) -> Blocks | None:
        """The samples' block means, or None where no period is seen."""
        size = int(block_size(samples, self.rows, self.times))
        if size == 0:
            return None
        means = np.empty(-(-len(samples) // size))
        block_means(samples, size, means)
        return Blocks(means, size, len(samples), dt, order)

    def candidates(self, blocks: Blocks) -> Array:
        """For each number of half cycles that may be: it, the sum of squares, log det J'J, and six parameters."""
        first = guess(blocks, self.rows, self.times, self.start, self.work)
        kept = over_half_cycles(self.start, first, blocks, self.fits, self.work) if first else 0
        fits = np.array(self.fits[:kept])
        for row in fits:
            _begin_late(row, blocks.dt, blocks.order)
        return fits

    def intervals(self, blocks: Blocks, fits: Array) -> Array:
        """Ends (6, 2) of the 95 % profile likelihood of each parameter, the noise's level unknown."""
        level = fits[:, 1].min() + variance(fits, blocks) * student(blocks.freedom) ** 2
        intervals(fits, len(fits), level, blocks, self.ends, self.work)
        return self.ends


def _begin_late(row: Array, dt: float, order: int) -> None:
    """Let a motion begin at its last turn before the first sample: half cycles that no sample shows are none."""
    w, damping, dry, _, amplitude, release = row[3:]
    half = math.pi / (w * math.sqrt(1 - damping**2))
    fade = math.exp(-math.pi * damping / math.sqrt(1 - damping**2))
    while row[0] > 1 and release + half <= (AT_ONCE if order < 2 else 1.0) * dt:
        amplitude = math.copysign(1 + fade, amplitude) * dry - fade * amplitude
        release = release + half if order < 2 else min(release + half, 0.0)  # an acceleration that is held is zero
        row[0] -= 1
    row[7], row[8] = amplitude, release


def variance(fits: Array, blocks: Blocks) -> float:
    """Of a block's noise, that of rounding at least."""
    return max(float(fits[:, 1].min()) / blocks.freedom, (ROUNDING * float(np.ptp(blocks.means))) ** 2)


def weights(fits: Array, blocks: Blocks) -> Array:
    """Likelihood of each number of half cycles, summing to one."""
    share = np.exp(-0.5 * (fits[:, 1] - fits[:, 1].min()) / variance(fits, blocks))
    return np.asarray(share / share.sum())
