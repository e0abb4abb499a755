"""Where the fit of a ring-down begins: blocks, period, release and amplitudes, read off the record itself.

The fit of one release in white noise: blocks, start, every number of half cycles, intervals; all of it compiled.

The swings of a motion from one turning point to the next, and the chains of them that are a free decay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stickslip.arrays import Array, Mask, Rows, stretches
from stickslip.compiled import FAST, compiled
from stickslip.decay.profile import intervals, over_half_cycles, solve
from stickslip.decay.waveform import AMPLITUDE, DAMPING, DRY, RATE, RELEASE, REST, Blocks, normal_equations
from stickslip.errors import EstimateError
from stickslip.signals.pieces import crossings, turning_points
from stickslip.statistics import student

BLOCKS = 40  # a period; the variance of the answer rises by 0.3 % of itself
FIRST_SWINGS = 0.25  # of the range: what counts as a swing before the noise is averaged
LATER_SWINGS = 0.05  # the same of block means, where it is
NOISES = 12.0  # standard deviations of the noise that a swing is larger than

NO_TURNS: Rows = np.empty(0, dtype=np.intp)
ROUNDING = 1e-9  # of the range
AT_ONCE = 0.1  # samples after the first one, within which a turn is before it
CANDIDATES = 40  # numbers of half cycles kept


COARSE, FINE = 8192, 12  # points of the record, and per half cycle, in which turning points are sought
SEEN = 5.0  # standard deviations that a swing must rise above the noise
LARGE = 0.3  # of the record's range: swings from which the period is first read
RISE = 3.0  # half periods in the time that a cosine takes from a quarter to three quarters of its swing
PACE = (0.7, 1.4)  # a half cycle over the one before; a pendulum from near the top shortens by a third
GROWN = 1.05  # a swing over the one before from which it is not the same decay
RISEN = 1.01  # a swing over the one before that may be a rise
CUT_SHORT = 0.08  # less than the half period that the swing before tells: a last swing that was cut off
STEEPNESS = 1.1  # three standard deviations of a half period told by steepness, times the swing over the least seen
STEADY = 0.01  # of the swings: a smaller decrease over many cycles is none


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
        times[k], area = 0.5 * (rows[k] + rows[k + 1]), 0.0
        if top == bottom:
            continue
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
def guess(blocks, turns, rows, times, p, work):
    """First parameters of the motion in `p`; its number of half cycles, 0 where fewer than two are seen.

    It turns where the block means do, or at the blocks `turns` where noise hides some of these. `p` is (6,); `rows` and
    `times` (as many as turns are looked for) and `work` (10, 7, 6) are scratch.
    """
    means, size, _, dt, order = blocks
    low, high = means[0], means[0]
    for j in range(means.shape[0]):
        low, high = min(low, means[j]), max(high, means[j])
    hessian, gradient, trial = work[8, :6], work[9, 0], work[9, 1]
    # Period: spacing of the passages between turns, whatever the damping.
    count = turning_points(means, max(LATER_SWINGS * (high - low), NOISES * roughness(means)), rows)
    if turns.shape[0] > count:
        count, rows = turns.shape[0], turns
    passages(means, rows, count, times)
    spacing, first = half_period(means, rows, times, count)
    if spacing <= 0.0:
        return 0
    best, likeliest, step = math.inf, 0, size * dt
    half = spacing * step
    # Trials: release and damping on a grid; dry friction, rest and amplitude enter linearly and are solved for.
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
                best, likeliest = squares, n
                for k in range(6):
                    p[k] = trial[k]
    return likeliest


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

    def candidates(self, blocks: Blocks, turns: Rows = NO_TURNS) -> Array:
        """For each number of half cycles that may be: it, the sum of squares, log det J'J, and six parameters.

        `turns` are the samples at which the motion is known to turn.
        """
        seen = np.minimum(turns[: len(self.rows)] // blocks.size, len(blocks.means) - 1)
        first = guess(blocks, seen, self.rows, self.times, self.start, self.work)
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


@dataclass(frozen=True, eq=False)
class Swings:
    """Motions from one turning point to the next: rows (fractions allowed) and sizes."""

    edges: Array  # (k + 1,) turning points
    levels: Array  # (k + 1,) values there
    middles: Array  # (k,) where each swing passes its middle
    halves: Array  # (k,) half period that each swing's own steepness tells
    seen: float  # least swing that is told from noise

    @property
    def sizes(self) -> Array:
        return np.abs(np.diff(self.levels))

    @classmethod
    def of(cls, values: Array, noise: float, step: float, fs: float) -> Swings:
        span = float(np.ptp(values))
        if span <= max(2 * SEEN * noise, 3 * step):
            raise EstimateError(
                f"the channel moves by {span:.3g}, its noise is {noise:.3g}",
                "a free decay rises above its noise",
                "check the sensor and its column, or release from farther",
            )
        rough = cls._within(values, max(1, len(values) // COARSE), LARGE * span)
        half = _weighted_median(rough.halves, rough.sizes)
        if half < 2:
            raise EstimateError(
                f"the oscillation has {2 * half:.2g} samples a cycle",
                "its extremes are seen from four samples a cycle on",
                f"sample faster than {fs:g} Hz",
            )
        block = max(1, math.floor(half / FINE))
        seen = max(2 * SEEN * noise / math.sqrt(block), 1.5 * step, 1e-3 * span)
        return cls._within(values, block, min(seen, LARGE * span))

    @classmethod
    def _within(cls, values: Array, block: int, seen: float) -> Swings:
        count = len(values) // block
        means = values[: count * block].reshape(count, block).mean(axis=1)
        turns = np.empty(count, dtype=np.intp)
        turns = turns[: turning_points(means, seen, turns)]
        levels, places = means[turns], np.empty((max(0, len(turns) - 1), 3))
        crossings(means, turns, places)
        quarter, middle, three = places.T

        def rows(at: Array) -> Array:
            return (at + 0.5) * block - 0.5

        return cls(rows(turns.astype(float)), levels, rows(middle), RISE * block * (three - quarter), seen)


@dataclass(frozen=True)
class Run:
    """Swings of one free decay."""

    first: int
    end: int
    inside: bool  # it follows on swings that keep pace with it: no release begins it
    parted: bool = False  # an extreme was lost before or after it


def _weighted_median(values: Array, weights: Array) -> float:
    if not len(values):
        return math.inf
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


def free_decays(swings: Swings, order: int) -> list[Run]:
    """First swing, and the one after the last, of each free decay."""
    if len(swings.middles) < 2:
        raise EstimateError(
            f"the motion turns {max(0, len(swings.levels) - 2)} times",
            "a free decay swings past its rest and back; an overdamped one creeps there and tells no decrement",
            "lessen the damping, or release from farther",
        )
    runs: list[Run] = []
    for first, last in _paced(swings):
        sizes = swings.sizes[first:last]
        grown = sizes[1:] > GROWN * sizes[:-1] + swings.seen
        _refuse_growth(sizes, grown, swings)
        starts = [0, *(int(i) + 1 for i in np.flatnonzero(grown)), len(sizes)]
        runs += [Run(first + a, first + b, a > 0) for a, b in pairwise(starts) if b - a >= 2]
    if order == 0:  # the last swing of a velocity or an acceleration ends in a jump of its own
        runs = [run for run in (_uncut(run, swings) for run in runs) if run.end - run.first >= 2]
    if not runs:
        raise EstimateError(
            "no two swings keep pace and shrink",
            "a free decay is a chain of swings that each take as long as the one before",
            "give the record of a release, or cut it out with record.between(first, last)",
        )
    least = max(0.05 * max(float(swings.sizes[run.first]) for run in runs), 3 * swings.seen)
    return _mended([run for run in runs if swings.sizes[run.first] > least] or runs, swings)


def _uncut(run: Run, swings: Swings) -> Run:
    """The run without a last swing that was cut short, by a hand or the record's end: it is steeper at its middle."""
    last = run.end - 1
    doubt = max(CUT_SHORT, STEEPNESS * swings.seen / float(swings.sizes[last]))
    return replace(run, end=last) if swings.halves[last] < (1 - doubt) * swings.halves[last - 1] else run


def _mended(runs: list[Run], swings: Swings) -> list[Run]:
    """Of pieces of one decay, parted by an extreme that was lost, the longest; releases of their own, all."""
    kept = [runs[0]]
    for run in runs[1:]:
        last = kept[-1]
        gap = swings.middles[run.first] - swings.middles[last.end - 1]
        near = gap < 3.2 * float(np.median(np.diff(swings.middles[last.first : last.end])))
        if near and swings.sizes[run.first] < swings.sizes[last.first]:
            kept[-1] = replace(max(last, run, key=lambda piece: piece.end - piece.first), parted=True)
        else:
            kept.append(run)
    return kept


def _paced(swings: Swings) -> list[tuple[int, int]]:
    """Chains of swings that keep pace."""
    gaps, chains, first = np.diff(swings.middles), [], 0
    for i, gap in enumerate(gaps):
        before = gaps[i - 1 : i] if i > first else swings.halves[i : i + 2]
        slack = 1.0 if i > first else 1.5  # its own steepness tells a swing's length less well
        if not np.all((gap > PACE[0] / slack * before) & (gap < PACE[1] * slack * before)):
            chains.append((first, i + 1))
            first = i + 1
    return [*chains, (first, len(swings.middles))]


def _refuse_growth(sizes: Array, grown: Mask, swings: Swings) -> None:
    """Refuse a chain of swings that grows, beats or stays."""
    slowly = sizes[1:] > RISEN * sizes[:-1] + swings.seen / 2  # block means miss up to 0.9 % of a top
    rising = max((len(part) for part in "".join("r" if up else " " for up in slowly).split()), default=0)
    if len(sizes) >= 4 and (rising >= 3 or grown.sum() > len(sizes) / 3):
        top = int(np.argmax(sizes))
        again = len(stretches(slowly)[0])
        if top > 0.8 * (len(sizes) - 1) and sizes[0] < 0.9 * sizes[top]:
            raise EstimateError(
                f"the swings grow from {sizes[0]:.3g} to {sizes[top]:.3g}",
                "a free decay dies away",
                "look for what drives the motion: a feedback, a base, friction that falls with speed",
            )
        if again > 1:
            raise EstimateError(
                f"the swings fall and rise again {again} times: two modes beat, or something drives the motion",
                "a free decay has one mode and swings that shrink",
                "hold the other mode still, or filter it out before reading",
            )
    if len(sizes) >= 10:
        third = len(sizes) // 3
        fall = 1 - float(np.median(sizes[-third:]) / np.median(sizes[:third]))
        if fall < STEADY and float(np.median(sizes)) > 20 * swings.seen:
            raise EstimateError(
                f"{len(sizes)} swings shrink by {100 * max(0.0, fall):.2g} %",
                "a free decay dies away",
                "give a record of a release, or ask friction_loops(record) of a forced one",
            )


def bounds_of(swings: Swings, runs: Sequence[Run], number: int, size: int) -> tuple[int, int]:
    """Rows that belong to no other release."""
    before = 0 if number == 0 else round(swings.edges[runs[number - 1].end])
    after = size if number == len(runs) - 1 else round(swings.edges[runs[number + 1].first])
    return before, after
