"""Signals in pieces: here they ring, there they glide. Where does each piece begin?

The dynamic programme behind it: where signals are best cut; compiled.

Where an oscillation turns, and when it passes from one turning point to the next; compiled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Rows
from stickslip.compiled import FAST, OPTIONS, compiled

STRAIGHT = 1e-13  # variance of the squared time within a stretch, below which a line explains it

GLIDE, RING = 0, 1
SHORTEST = 4  # samples of a glide: a parabola has three coefficients

SHARES = (0.25, 0.5, 0.75)  # of a swing's way: a cosine takes a third of its half period from the first to the last
EQUAL = 1e-12  # of a swing: running means that differ by less are alike


@dataclass(frozen=True)
class Piece:
    """Samples ``first`` up to, not including, ``last`` of one kind."""

    first: int
    last: int
    kind: int


class Splitter:
    """Several signals, each to be cut into parabolas and rings of one decaying frequency, in turn.

    A ring is ``Re c exp(pole t)`` about zero, of any amplitude and phase (about rest, where the pole is 0: nothing
    moves); a glide is a parabola; the first piece and the last are glides. Among all ways to cut a signal the one is
    found that has the least ``sum of squares / variance + penalty * pieces``, by dynamic programming.

    Parameters
    ----------
    signals : sequence of ndarray
        At one rate, not necessarily equally long.
    variance : float
        Of the noise.
    penalty : float
        What a piece must spare to be made.
    """

    def __init__(self, signals: Sequence[Array], variance: float, penalty: float) -> None:
        self.lengths = np.array([len(values) for values in signals])
        self.penalty, self.variance = penalty, variance
        self.values = np.zeros((len(signals), self.lengths.max()))
        for row, values in zip(self.values, signals, strict=True):
            row[: len(values)] = values
        self.glides = _glide_costs(self.values) / variance

    def cost(self, pole: complex, shortest: int) -> Array:
        """The least cost of each signal; `pole` per sample, rings of at least `shortest` samples."""
        best, _ = self._programme(pole, shortest)
        return np.asarray(best[np.arange(len(self.lengths)), GLIDE, self.lengths])

    def split(self, pole: complex, shortest: int) -> list[tuple[Piece, ...]]:
        """The pieces of each signal."""
        _, came = self._programme(pole, shortest)
        return [_traced(origin, length) for origin, length in zip(came, self.lengths.tolist(), strict=True)]

    def _programme(self, pole: complex, shortest: int) -> tuple[Array, Rows]:
        many, count = self.values.shape
        wave = np.exp(pole * np.arange(count)) if pole else np.zeros(count, dtype=complex)
        c, s = wave.real, wave.imag
        best, came = np.full((many, 2, count + 1), np.inf), np.zeros((many, 2, count + 1), dtype=np.intp)
        products = np.array([c * self.values, s * self.values])
        sums = Sums(_sums(self.values**2), _sums(np.array([c * c, c * s, s * s])), _sums(products))
        cut(self.lengths, self.glides, sums, shortest, self.variance, self.penalty, best, came)
        return best, came


def _traced(came: Rows, length: int) -> tuple[Piece, ...]:
    pieces, kind, last = [], GLIDE, length
    while last > 0:
        first = int(came[kind, last])
        pieces.append(Piece(first, last, kind))
        kind, last = 1 - kind, first
    return tuple(pieces[::-1])


def _sums(values: Array) -> Array:
    """Sums over the samples up to, not including, each: shape (..., n + 1)."""
    return np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(values, axis=-1)], axis=-1)


def _between(values: Array) -> Array:
    """Sums over the samples i up to, not including, j: shape (..., n + 1, n + 1), of use where i < j."""
    total = _sums(values)
    return np.asarray(total[..., None, :] - total[..., :, None])


def _glide_costs(values: Array) -> Array:
    """Sum of squares that the best parabola leaves of each stretch [i, j)."""
    time = np.linspace(-1, 1, values.shape[-1])
    n = np.maximum(_between(np.ones(len(time))), 1.0)
    m = [_between(time**power) / n for power in range(1, 5)]
    y = _between(values) / n
    ty, tty = _between(time * values) / n - m[0] * y, _between(time**2 * values) / n - m[1] * y
    # moments of t and t^2 about the stretch's own means
    tt = np.maximum(m[1] - m[0] ** 2, 1e-15)
    tq, qq = m[2] - m[0] * m[1], m[3] - m[1] ** 2
    rest = qq - tq**2 / tt
    resting = rest > STRAIGHT
    extra = np.where(resting, (tty - tq * ty / tt) ** 2 / np.where(resting, rest, 1.0), 0.0)
    return np.asarray(np.maximum(_between(values**2) - n * (y**2 + ty**2 / tt + extra), 0.0))


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

    power: Array
    waves: Array
    products: Array


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


@compiled(**FAST)
def turning_points(values, least, rows):
    """Rows where `values` turn back by `least` or more, alternately up and down, with the first and last extreme.

    They are written to `rows` (m,), as many as it holds; returns how many there are. `least` is in the unit of `values`
    (n,).
    """
    count, low, high, direction = 0, 0, 0, 0
    for row in range(values.shape[0]):
        if count == rows.shape[0]:
            return count
        # Up, or not known yet: the highest is a turn once the values have come down from it.
        if direction >= 0:
            if values[row] >= values[high]:
                high = row
            elif values[high] - values[row] >= least:
                rows[count] = high
                count += 1
                direction, low = -1, row
                continue
        # Down, or not known yet.
        if direction <= 0:
            if values[row] <= values[low]:
                low = row
            elif values[row] - values[low] >= least:
                rows[count] = low
                count += 1
                direction, high = 1, row
    # the extreme since the last turn, which nothing comes back from
    if 0 < count < rows.shape[0]:
        rows[count] = high if direction > 0 else low
        count += 1
    return count


@compiled(**FAST)
def crossings(values, turns, places):
    """Rows, with fractions, where each swing passes `SHARES` of its way; the last time before it is through.

    `values` is (n,), `turns` are the k + 1 turning points, `places` is (k, 3).
    """
    for k in range(turns.shape[0] - 1):
        first, last = turns[k], turns[k + 1]
        begin, length = values[first], values[last] - values[first]
        # the first time it is through, then backwards: noise may pass a share to and fro
        through = first
        while (values[through] - begin) / length < SHARES[2]:
            through += 1
        for j in range(3):
            row = through
            while row > first and (values[row] - begin) / length >= SHARES[j]:
                row -= 1
            # straight between two samples
            rise = (values[min(row + 1, last)] - values[row]) / length
            places[k, j] = row + ((SHARES[j] - (values[row] - begin) / length) / rise if rise > 0.0 else 0.0)


@compiled(**FAST)
def extreme(values, first, last, side):
    """Row of the extreme, up (`side` 1) or down (-1), of running means over a sixth of `first` to `last`."""
    width = max(1, (last - first + 1) // 6) | 1
    reach, level = width // 2, values[first]
    total, span = 0.0, 0.0
    for row in range(first, last + 1):
        span = max(span, abs(values[row] - level))
    for row in range(first - reach, first + reach + 1):
        total += side * (values[min(max(row, first), last)] - level)
    best, best_row = total, first
    for row in range(first + 1, last + 1):
        total += side * (values[min(row + reach, last)] - values[max(row - reach - 1, first)])
        if total > best + EQUAL * width * span:
            best, best_row = total, row
    return best_row
