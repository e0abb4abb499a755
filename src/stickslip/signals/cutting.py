"""The dynamic programme behind :mod:`~stickslip.signals.pieces`: where signals are best cut; compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import OPTIONS, compiled

GLIDE, RING = 0, 1
SHORTEST = 4  # samples of a glide: a parabola has three coefficients


class Sums(NamedTuple):
    """Sums over the samples up to each: what every ring costs is found from.

    Attributes
    ----------
    power : ndarray, shape (m, n + 1)
        Of the squared samples y^2 of each signal.
    waves : ndarray, shape (3, n + 1)
        Of c^2, c s and s^2, of the ring's cosine c and its sine s; zero where nothing rings.
    products : ndarray, shape (2, m, n + 1)
        Of c y and s y.
    """

    power: NDArray[np.float64]
    waves: NDArray[np.float64]
    products: NDArray[np.float64]


@compiled(**OPTIONS)
def cut(lengths, glides, sums, least, variance, penalty, best, came):
    """Least cost of each signal's first samples by the kind of their last piece, and where that piece begins.

    Parameters
    ----------
    lengths : ndarray of int, shape (m,)
        Samples of each signal.
    glides : ndarray, shape (m, n + 1, n + 1)
        Cost of each stretch as a glide.
    sums : Sums
        Of the samples, and of what rings.
    least : int
        Samples of a ring.
    variance, penalty : float
        Of the noise, and for a piece.
    best, came : ndarray, shape (m, 2, n + 1)
        Written.
    """
    for k in range(lengths.shape[0]):
        best[k] = math.inf
        best[k, RING, 0] = 0.0  # so that a glide comes first
        for last in range(SHORTEST, lengths[k] + 1):
            for kind in range(2):
                low, where = math.inf, 0
                for first in range(last - (SHORTEST if kind == GLIDE else least) + 1):
                    total = best[k, 1 - kind, first]
                    if total >= low:  # no stretch costs less than nothing
                        continue
                    if kind == GLIDE:
                        total += glides[k, first, last]
                    else:
                        total += _ring(sums, k, first, last) / variance
                    if total < low:
                        low, where = total, first
                best[k, kind, last], came[k, kind, last] = low + penalty, where


@compiled(**OPTIONS)
def _ring(sums, k, first, last):
    """Sum of squares that the best ring leaves of signal k from `first` up to, not including, `last`."""
    waves, products = sums.waves, sums.products
    cc, cs, ss = waves[0, last] - waves[0, first], waves[1, last] - waves[1, first], waves[2, last] - waves[2, first]
    cy, sy = products[0, k, last] - products[0, k, first], products[1, k, last] - products[1, k, first]
    determinant = max(cc * ss - cs * cs, 1e-12 * cc * ss + 1e-300)
    explained = (ss * cy * cy - 2 * cs * cy * sy + cc * sy * sy) / determinant
    return max(sums.power[k, last] - sums.power[k, first] - explained, 0.0)
