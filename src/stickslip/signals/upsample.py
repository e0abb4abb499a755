"""Values between the samples of a narrow band: weighted sums of the samples around, turned to its frequency."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import FAST, compiled

Array = NDArray[np.float64]

TILE = 64  # samples gone through at once, so that what they make stays in the processor's cache
MOST_PHASES = 64  # values made of one sample
SHIFT = math.pi / TILE  # [rad a sample] a band's middle may lie from zero
WIDEST = 2.4  # [rad a sample] half of a band, which is pi where nothing is to spare
MANY = 2  # phases a byte of a number, from which on they are gone through sample by sample
LANES = 64  # values made at once there, at least
STEPS = 8  # widths an octave that there are weights for
MOST_TAPS = 40
LEAD = MOST_TAPS // 2 - 1  # samples before the first that values are made of
TAIL = MOST_TAPS // 2 + 4  # and after the last


def upsampled(
    samples: NDArray[np.complexfloating],
    out: NDArray[np.complexfloating],
    phases: int,
    *,
    turns: int,
    half: float,
    reach: float,
    accuracy: float,
) -> None:
    """Fill `out` with a band's values, so many for each of its samples.

    Parameters
    ----------
    samples : ndarray (LEAD + s + TAIL,)
        The band, moved to zero frequency but for :data:`SHIFT`; the first value lies on the sample after `LEAD`, and s
        is a multiple of `TILE`.
    out : ndarray (n,)
        At most ``phases s`` values.
    phases : int
        Values a sample, a power of two up to `MOST_PHASES`.
    turns : int
        The band is moved up by so many cycles in `TILE` samples.
    half : float
        Half of the band's width [rad a sample].
    reach : float
        The same in standard deviations of its Gaussian.
    accuracy : float
        Of the weights, where the spectrum is highest.
    """
    weights = _weights(math.ceil(STEPS * math.log2(half / WIDEST)), reach, accuracy)[:: MOST_PHASES // phases]
    around = samples[LEAD + 1 - weights.shape[1] // 2 :]
    kind = out.real.dtype
    if phases < MANY * kind.itemsize:
        places = turns * (np.arange(TILE) * phases + np.arange(phases)[:, None]) % (TILE * phases)
        turn = np.exp(2j * np.pi / (TILE * phases) * places).astype(out.dtype)
        _few(around.view(kind), weights.astype(kind), turn.view(kind), np.empty(2 * TILE, dtype=kind), out.view(kind))
        return
    together = max(1, LANES // phases)  # samples whose values are made at once
    taps = -(-(weights.shape[1] + together - 1) // 4) * 4
    wide = np.zeros((taps, together * phases), dtype=kind)
    for number in range(together):
        wide[number : number + weights.shape[1], number * phases : (number + 1) * phases] = weights.T
    swing = np.exp(2j * np.pi * (turns * np.arange(TILE) % TILE) / TILE).astype(out.dtype)
    turn = np.exp(2j * np.pi * turns / (TILE * phases) * np.arange(together * phases)).astype(out.dtype)
    parts = np.array([turn.real, turn.imag])
    _many(around, wide, swing, together, parts, np.empty_like(parts), out)


@lru_cache(maxsize=256)
def _weights(step: int, reach: float, accuracy: float) -> Array:
    """Weights (phases, neighbours), best in the mean over a Gaussian spectrum whose middle is within SHIFT of zero."""
    half = WIDEST * 2.0 ** (max(step, -4 * STEPS) / STEPS)
    angles = np.linspace(0, half, 160)
    spread = (half - SHIFT) / reach
    height = np.exp(-0.5 * (np.maximum(angles - SHIFT, 0) / spread) ** 2)
    height = np.concatenate([height, height])[:, None]

    def waves(places: Array) -> Array:
        turn = np.outer(angles, places)
        return np.asarray(np.vstack([np.cos(turn), np.sin(turn)]) * height)

    target = waves(np.arange(MOST_PHASES) / MOST_PHASES)
    for taps in range(4, MOST_TAPS + 1, 4):
        design = waves(np.arange(taps, dtype=float) - (taps // 2 - 1))
        weights = np.linalg.lstsq(design, target, rcond=1e-15)[0]
        if np.abs(design @ weights - target).max() < accuracy:
            break
    return np.ascontiguousarray(weights.T)


@compiled(**FAST)
def _few(around, weights, turn, sums, out):
    """Phase by phase over a tile. Real and imaginary parts stand side by side; the taps are a multiple of four."""
    phases, taps = weights.shape
    tile = sums.size
    for first in range(0, out.size // phases + 1, tile):
        for phase in range(phases):
            if phase == 0:  # the samples themselves
                window = around[first + taps - 2 : first + taps - 2 + tile]
                for i in range(tile):
                    sums[i] = window[i]
            else:
                for j in range(0, taps, 4):
                    a, b, c, d = weights[phase, j], weights[phase, j + 1], weights[phase, j + 2], weights[phase, j + 3]
                    window = around[first + 2 * j : first + 2 * j + tile + 6]
                    if j == 0:
                        for i in range(tile):
                            sums[i] = a * window[i] + b * window[i + 2] + c * window[i + 4] + d * window[i + 6]
                    else:
                        for i in range(tile):
                            sums[i] += a * window[i] + b * window[i + 2] + c * window[i + 4] + d * window[i + 6]
            kept = min(tile // 2, (out.size // 2 - phase - 1) // phases + 1 - first // 2)
            for k in range(kept):
                place = 2 * ((first // 2 + k) * phases + phase)
                out[place] = turn[phase, 2 * k] * sums[2 * k] - turn[phase, 2 * k + 1] * sums[2 * k + 1]
                out[place + 1] = turn[phase, 2 * k] * sums[2 * k + 1] + turn[phase, 2 * k + 1] * sums[2 * k]


@compiled(**FAST)
def _many(around, weights, swing, together, turn, sums, out):
    """Sample by sample, all phases of some samples at once; the taps are a multiple of four."""
    taps, lanes = weights.shape
    (cosine, sine), (real, imaginary) = (turn[0], turn[1]), (sums[0], sums[1])
    for number in range(-(-out.size // lanes)):
        first, to = number * together, swing[number * together % swing.size]
        row = out[number * lanes : min((number + 1) * lanes, out.size)]
        for i in range(lanes):
            real[i] = imaginary[i] = 0.0
        for j in range(0, taps, 4):
            a, b = to * around[first + j], to * around[first + j + 1]
            c, d = to * around[first + j + 2], to * around[first + j + 3]
            ar, br, cr, dr, ai, bi, ci, di = a.real, b.real, c.real, d.real, a.imag, b.imag, c.imag, d.imag
            e, f, g, h = weights[j], weights[j + 1], weights[j + 2], weights[j + 3]
            if j < taps - 4:
                for i in range(lanes):
                    real[i] += ar * e[i] + br * f[i] + cr * g[i] + dr * h[i]
                    imaginary[i] += ai * e[i] + bi * f[i] + ci * g[i] + di * h[i]
            else:
                for i in range(row.size):
                    x = real[i] + (ar * e[i] + br * f[i] + cr * g[i] + dr * h[i])
                    y = imaginary[i] + (ai * e[i] + bi * f[i] + ci * g[i] + di * h[i])
                    row[i] = complex(cosine[i] * x - sine[i] * y, sine[i] * x + cosine[i] * y)
