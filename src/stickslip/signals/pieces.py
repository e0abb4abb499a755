"""Signals in pieces: here they ring, there they glide. Where does each piece begin?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GLIDE, RING = 0, 1
SHORTEST = 4  # samples of a glide: a parabola has three coefficients
TOLD = 1e-13  # variance of the squared time within a stretch, below which a line explains it


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
        self.squares = _between(self.values**2)
        self.glides = _glide_costs(self.values, self.squares) / variance

    def cost(self, pole: complex, shortest: int) -> Array:
        """The least cost of each signal; `pole` per sample, rings of at least `shortest` samples."""
        best, _ = self._programme(pole, shortest)
        return np.asarray(best[np.arange(len(self.lengths)), GLIDE, self.lengths])

    def split(self, pole: complex, shortest: int) -> list[tuple[Piece, ...]]:
        """The pieces of each signal."""
        _, came = self._programme(pole, shortest)
        return [_traced(origin, length) for origin, length in zip(came, self.lengths.tolist(), strict=True)]

    def _programme(self, pole: complex, shortest: int) -> tuple[Array, NDArray[np.intp]]:
        many, count = self.values.shape
        costs, least = (self.glides, self._ring_costs(pole)), (SHORTEST, shortest)
        best = np.full((many, 2, count + 1), np.inf)
        came = np.zeros((many, 2, count + 1), dtype=np.intp)
        best[:, RING, 0] = 0.0  # so that a glide comes first
        rows = np.arange(many)
        for last in range(SHORTEST, count + 1):
            for kind in (GLIDE, RING):
                firsts = last - least[kind] + 1
                if firsts > 0:
                    total = best[:, 1 - kind, :firsts] + costs[kind][:, :firsts, last]
                    where = total.argmin(axis=1)
                    came[:, kind, last] = where
                    best[:, kind, last] = total[rows, where] + self.penalty
        return best, came

    def _ring_costs(self, pole: complex) -> Array:
        """Sum of squares, in variances, that the best ring leaves of each stretch [i, j)."""
        if pole == 0:
            return self.squares / self.variance
        wave = np.exp(pole * np.arange(self.values.shape[1]))
        c, s = wave.real, wave.imag
        cc, cs, ss = _between(c * c), _between(c * s), _between(s * s)
        cy, sy = _between(c * self.values), _between(s * self.values)
        determinant = np.maximum(cc * ss - cs * cs, 1e-12 * cc * ss + 1e-300)
        explained = (ss * cy * cy - 2 * cs * cy * sy + cc * sy * sy) / determinant
        return np.asarray(np.maximum(self.squares - explained, 0.0) / self.variance)


def _traced(came: NDArray[np.intp], length: int) -> tuple[Piece, ...]:
    pieces, kind, last = [], GLIDE, length
    while last > 0:
        first = int(came[kind, last])
        pieces.append(Piece(first, last, kind))
        kind, last = 1 - kind, first
    return tuple(pieces[::-1])


def _between(values: Array) -> Array:
    """Sums over the samples i up to, not including, j: shape (..., n + 1, n + 1), of use where i < j."""
    total = np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(values, axis=-1)], axis=-1)
    return np.asarray(total[..., None, :] - total[..., :, None])


def _glide_costs(values: Array, squares: Array) -> Array:
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
    resting = rest > TOLD
    extra = np.where(resting, (tty - tq * ty / tt) ** 2 / np.where(resting, rest, 1.0), 0.0)
    return np.asarray(np.maximum(squares - n * (y**2 + ty**2 / tt + extra), 0.0))
