"""The fit of one release in white noise: blocks, start, every number of half cycles, intervals; all of it compiled."""

from __future__ import annotations

import math

import numpy as np

from stickslip.decay.profile import intervals, over_half_cycles
from stickslip.decay.start import block_means, block_size, guess
from stickslip.decay.waveform import Array, Blocks
from stickslip.statistics import student

ROUNDING = 1e-9  # of the range
AT_ONCE = 0.1  # samples after the first one, within which a turn is before it
CANDIDATES = 40  # numbers of half cycles kept


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
