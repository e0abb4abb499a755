"""Signals in pieces: here they ring, there they glide. Where does each piece begin?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.signals.cutting import GLIDE, Sums, cut

Array = NDArray[np.float64]

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
        self.glides = _glide_costs(self.values) / variance

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
        wave = np.exp(pole * np.arange(count)) if pole else np.zeros(count, dtype=complex)
        c, s = wave.real, wave.imag
        best, came = np.full((many, 2, count + 1), np.inf), np.zeros((many, 2, count + 1), dtype=np.intp)
        products = np.array([c * self.values, s * self.values])
        sums = Sums(_sums(self.values**2), _sums(np.array([c * c, c * s, s * s])), _sums(products))
        cut(self.lengths, self.glides, sums, shortest, self.variance, self.penalty, best, came)
        return best, came


def _traced(came: NDArray[np.intp], length: int) -> tuple[Piece, ...]:
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
    resting = rest > TOLD
    extra = np.where(resting, (tty - tq * ty / tt) ** 2 / np.where(resting, rest, 1.0), 0.0)
    return np.asarray(np.maximum(_between(values**2) - n * (y**2 + ty**2 / tt + extra), 0.0))
