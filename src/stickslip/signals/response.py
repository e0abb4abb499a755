"""What a linear sensor makes of a motion that is known at every instant."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TURN = 1.5  # radians that no pole turns further in a stretch of the quadrature
NODES = 6  # of Gauss in a stretch
BLOCK = 1 << 16  # samples at a time
CRITICAL = 1e-7  # a damping ratio as near to 1 is moved away from it: a double pole has no partial fractions


@dataclass(frozen=True)
class Response:
    r"""A linear filter in partial fractions, :math:`H(s) = d + \sum_i r_i/(s - p_i)`.

    Attributes
    ----------
    poles, residues : tuple of complex
        p_i [rad/s] and r_i, conjugates included.
    direct : float
        d.
    leak : float
        Rate [1/s] at which a constant leaks away; zero where none does.
    """

    poles: tuple[complex, ...] = ()
    residues: tuple[complex, ...] = ()
    direct: float = 1.0
    leak: float = 0.0

    def at(self, frequency: Array | float) -> NDArray[np.complex128]:
        """H at frequencies [Hz]."""
        s = 2j * np.pi * np.asarray(frequency, dtype=float)
        total = np.full(s.shape, self.direct, dtype=complex)
        for pole, residue in zip(self.poles, self.residues, strict=True):
            total += residue / (s - pole)
        return total

    def then(self, other: Response) -> Response:
        """This filter, and the other behind it; they share no pole."""

        def value(filter_: Response, s: complex) -> complex:
            parts = zip(filter_.poles, filter_.residues, strict=True)
            return filter_.direct + sum(residue / (s - pole) for pole, residue in parts)

        own = [r * value(other, p) for p, r in zip(self.poles, self.residues, strict=True)]
        others = [r * value(self, p) for p, r in zip(other.poles, other.residues, strict=True)]
        return Response(
            (*self.poles, *other.poles), (*own, *others), self.direct * other.direct, self.leak + other.leak
        )


def resonance(frequency: float, damping: float) -> Response:
    r"""A mount that rings: :math:`H = w^2/(s^2 + 2\zeta w s + w^2)`, w = 2 pi `frequency` [Hz]."""
    if abs(damping - 1) < CRITICAL:
        damping = 1 + CRITICAL
    w = 2 * math.pi * frequency
    root = np.emath.sqrt(damping**2 - 1.0)
    first, second = complex(w * (-damping + root)), complex(w * (-damping - root))
    residue = w * w / (first - second)
    return Response((first, second), (residue, -residue), 0.0)


def leak(time_constant: float) -> Response:
    r"""A charge that leaks away: :math:`H = s/(s + 1/T)`, T the time constant [s]."""
    rate = 1 / time_constant
    return Response((complex(-rate),), (complex(-rate),), 1.0, rate)


def respond(
    values: Callable[[Array], Array], *, breaks: Array, times: Array, response: Response, nodes: int = NODES
) -> Array:
    """What does a linear sensor read at equally spaced instants?

    Before time 0 its input was what it is at time 0, and nothing had leaked away. The convolution with each pole is
    taken by Gauss's quadrature between the samples and the breaks, so that a jump of the input rings as it should.

    Parameters
    ----------
    values : callable
        The input at increasing instants [s], none below 0.
    breaks : ndarray
        Instants at which the input may jump, increasing.
    times : ndarray (n,)
        Equally spaced instants [s]; the input before 0 is what it is at 0.
    response : Response
    nodes : int
        Of the quadrature; fewer are enough where the poles turn little between two samples.

    Returns
    -------
    ndarray (n,)
    """
    after = np.maximum(times, 0.0)
    if not response.poles or len(times) < 2:
        return response.direct * values(after)
    began = float(values(np.zeros(1))[0])
    out = began * np.exp(-response.leak * after)
    if response.direct:
        out += response.direct * (values(after) - began)
    step = float(times[-1] - times[0]) / (len(times) - 1)
    ahead = max(0, math.ceil(times[0] / step))
    grid = times[0] + step * np.arange(-ahead - 1, len(times))
    kept = [np.zeros(1, dtype=complex) for _ in response.poles]
    for first in range(0, len(grid) - 1, BLOCK):
        part = grid[first : first + BLOCK + 1]
        written = _convolved(values, began, breaks, part, response, kept, nodes)
        low, high = max(first, ahead), first + len(written)
        if low < high:
            out[low - ahead : high - ahead] += written[low - first :]
    return out


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss's quadrature from -1 to 1."""
    roots, weights = np.polynomial.legendre.leggauss(count)
    return roots, weights


def _convolved(
    values: Callable[[Array], Array],
    began: float,
    breaks: Array,
    grid: Array,
    response: Response,
    kept: list[NDArray[np.complex128]],
    count: int,
) -> Array:
    """The poles' part of the response at ``grid[1:]``; `kept` holds their states, and is updated."""
    from scipy.signal import lfilter

    roots, weights = gauss(count)
    step = float(grid[1] - grid[0])
    pieces = max(1, math.ceil(max(abs(pole) for pole in response.poles) * step / TURN))
    at = (step / pieces) * (np.arange(pieces)[:, None] + (roots + 1) / 2).ravel()
    nodes = np.maximum(grid[:-1, None] + at, 0.0)
    changed = (values(nodes.ravel()).reshape(nodes.shape) - began) * np.tile(weights * step / (2 * pieces), pieces)
    inside = np.append(breaks[(breaks > grid[0]) & (breaks < grid[-1])], np.zeros(int(grid[0] < 0 < grid[-1])))
    split = np.unique(np.searchsorted(grid, inside, side="right") - 1)
    changed[split] = 0.0
    fine = grid[split][:, None] + step * np.arange(pieces) / pieces
    edges = np.unique(np.concatenate([fine.ravel(), grid[split + 1], inside]))
    length, middle = np.diff(edges), (edges[:-1] + edges[1:]) / 2
    into = np.searchsorted(grid, middle) - 1
    own = np.isin(into, split) & (middle > 0)
    length, into = length[own], into[own]
    finer = edges[:-1][own, None] + length[:, None] * (roots + 1) / 2
    beside = (
        (values(finer.ravel()).reshape(finer.shape) - began) * (weights / 2) * length[:, None] if len(length) else finer
    )
    total = np.zeros(len(grid) - 1)
    for j, (pole, residue) in enumerate(zip(response.poles, response.residues, strict=True)):
        if pole.imag < 0:
            continue  # its conjugate speaks for both
        driven = changed @ np.exp(pole * (step - at))
        np.add.at(driven, into, (beside * np.exp(pole * (grid[into + 1][:, None] - finer))).sum(axis=1))
        state, kept[j] = lfilter([1.0], [1.0, -np.exp(pole * step)], driven, zi=kept[j])
        total += (1 + (pole.imag > 0)) * (residue * state).real
    return total
