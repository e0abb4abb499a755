"""Jumps that lie between two samples, as of an acceleration that no filter smoothed before it was sampled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.signals.noise import quantisation_step

CLEAR = 4.0  # standard deviations of noise alone from which a change counts as a jump
NOISE = 1.8  # of a change less the mean of the four around it, over that of a sample: sqrt(2 (1 + 1/4)^2 + 2/4^2)
BESIDE = 4  # samples on each side of a jump in which its highest frequencies are looked for
REACH = 32  # samples on each side over which a band-limited step swings
NORMAL = 1.4826  # standard deviations of a normal distribution in its median distance from zero


class Jumps(NamedTuple):
    """Jumps between samples.

    Attributes
    ----------
    sizes : ndarray (n - 1,)
        Between each sample and the next, as far as sampling did not resolve it; zero nearly everywhere.
    unresolved : float
        Share of all jumps that sampling did not resolve; zero where there are none.
    """

    sizes: Array
    unresolved: float


def unresolved_jumps(values: Array) -> Jumps:
    r"""How much the values jump between each sample and the next, as far as sampling did not resolve it.

    A jump is a change that stands out of those around it. Its changes :math:`D_k` have at half the sampling rate, by
    a window :math:`w_k` that keeps slower motion out,

    .. math:: \rho = \sum_k (-1)^k w_k D_k / \sum_k D_k

    of what they have at zero: all of it where the jump lies between two samples, 0.13 where a filter without phase at
    0.4 of the rate was before the sampling, 0.03 behind Butterworth's of eighth order at 0.3 of it. A filter falls
    from half the rate on at least as it fell up to there, and what is folded back to zero stood at the whole rate:
    :math:`\rho^2` is the share of all jumps that is taken for unresolved.

    Parameters
    ----------
    values : ndarray (n,)
        Samples, n >= 16; counts of a digitiser are no jumps.

    Returns
    -------
    Jumps

    Examples
    --------
    >>> n = np.arange(100)
    >>> jumps = unresolved_jumps(n // 50 + 0.2 * np.sin(n / 10))
    >>> np.flatnonzero(jumps.sizes).tolist(), round(float(jumps.sizes.max()), 2), round(jumps.unresolved, 2)
    ([49], 0.96, 0.95)
    """
    changes = np.diff(values)
    above = changes - np.convolve(changes, [0.25, 0.25, 0.0, 0.25, 0.25], mode="same")
    height = np.abs(above)
    height[:BESIDE] = height[-BESIDE:] = 0.0
    level = CLEAR * max(NOISE * quantisation_step(values) / math.sqrt(12), NORMAL * float(np.median(height)))
    highest = np.lib.stride_tricks.sliding_window_view(np.pad(height, BESIDE), 2 * BESIDE + 1).max(axis=1)
    at = np.flatnonzero((height > level) & (height == highest))
    jumps, share = np.zeros_like(changes), 0.0
    if len(at):
        beside = np.arange(-BESIDE, BESIDE + 1)
        swing = np.cos(math.pi * beside) * np.hanning(2 * BESIDE + 3)[1:-1]
        around = changes[at[:, None] + beside]
        sizes, weights = around[:, np.abs(beside) <= 2].sum(axis=1), above[at]
        share = float(np.clip(weights @ (around @ swing) / max(weights @ sizes, weights @ weights), 0.0, 1.0)) ** 2
        jumps[at] = share * weights
    return Jumps(jumps, share)


def band_limited(values: Array, jumps: Array, sooner: float = 0.0) -> Array:
    """The values as a filter up to half the sampling rate would have left them about these jumps.

    Where in its interval a jump lies is not known: it is put into the middle.

    Parameters
    ----------
    values : ndarray (n,)
        Samples.
    jumps : ndarray (n - 1,)
        Between each sample and the next.
    sooner : float
        Part of an interval by which every jump is put before the middle.

    Returns
    -------
    ndarray (n,)

    Examples
    --------
    >>> values = np.arange(100) // 50 * 1.0
    >>> band_limited(values, np.diff(values))[48:52].round(2).tolist()
    [-0.01, 0.06, 0.94, 1.01]
    """
    if not jumps.any():
        return values
    from scipy.fft import irfft, next_fast_len, rfft  # half a second sooner there than scipy.signal, which convolves
    from scipy.special import sici

    times = np.arange(1 - REACH, REACH + 1) - 0.5
    step = 0.5 + sici(math.pi * (times + sooner))[0] / math.pi
    swing = (step - (times > 0)) * np.cos(math.pi * times / (2 * REACH)) ** 2
    size = next_fast_len(len(jumps) + len(swing) - 1, real=True)
    swung = irfft(rfft(jumps, size) * rfft(swing, size), size)
    return np.asarray(values + swung[REACH - 1 : REACH - 1 + len(values)])
