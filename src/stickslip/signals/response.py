"""What a linear sensor makes of a motion that is known at every instant: its poles' answer, by compiled quadrature.

Spectra of a channel's derivatives without differencing: the window is differentiated, not the samples.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.compiled import FAST, compiled

TURN = 1.5  # radians that no pole turns further in a stretch of the quadrature
NODES = 6  # of Gauss in a stretch
BLOCK = 1 << 16  # samples at a time
CRITICAL = 1e-7  # a damping ratio as near to 1 is moved away from it: a double pole has no partial fractions
ALIKE = 1e-9  # of its length: an interval that differs by less from the one before has the same factors

TAPER = 0.05  # of the stretch, at each of its ends


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

    def at(self, frequency: Array | float) -> Complex:
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
        poles, direct = (*self.poles, *other.poles), self.direct * other.direct
        return Response(poles, (*own, *others), direct, self.leak + other.leak)


def resonance(frequency: float, damping: float) -> Response:
    r"""A mount that rings: :math:`H = w^2/(s^2 + 2\zeta w s + w^2)`, w = 2 pi `frequency` [Hz]."""
    if abs(damping - 1) < CRITICAL:
        damping = 1 + CRITICAL
    w = 2 * math.pi * frequency
    root = cmath.sqrt(damping**2 - 1.0)
    first, second = w * (-damping + root), w * (-damping - root)
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
        The input at increasing instants [s], none below 0; or several inputs, a row for each.
    breaks : ndarray
        Instants at which the input may jump, increasing.
    times : ndarray (n,)
        Equally spaced instants [s]; the input before 0 is what it is at 0.
    response : Response
    nodes : int
        Of the quadrature; fewer are enough where the poles turn little between two samples.

    Returns
    -------
    ndarray (n,), or a row for each input
    """
    after = np.maximum(times, 0.0)
    if not response.poles or len(times) < 2:
        return response.direct * values(after)
    step = float(times[-1] - times[0]) / (len(times) - 1)
    ahead = max(0, math.ceil(times[0] / step)) + 1
    grid = times[0] + step * np.arange(-ahead, len(times))
    pieces = max(1, math.ceil(max(abs(pole) for pole in response.poles) * step / TURN))
    finer = step * np.arange(pieces) / pieces
    rule, factors = gauss(nodes), np.empty(nodes, dtype=complex)
    poles, residues = np.array(response.poles), np.array(response.residues)
    for first in range(0, len(grid) - 1, BLOCK):
        part = grid[first : first + BLOCK + 1]
        inside = breaks[slice(*np.searchsorted(breaks, part[[0, -1]]))]
        parts = (part[:-1, None] + finer).ravel(), part[-1:], inside, np.zeros(int(part[0] < 0 < part[-1]))
        edges = np.sort(np.concatenate(parts))
        at = edges[:-1, None] + np.diff(edges)[:, None] * rule[0]
        forced = np.asarray(values(np.maximum(at, 0.0).ravel()))
        lead, forced = forced.shape[:-1], forced.reshape(-1, *at.shape)
        inputs = len(forced)
        if not first:
            states, answer = np.zeros((inputs, len(poles)), dtype=complex), np.zeros((inputs, len(grid)))
            began = forced[:, 0, :1].copy()  # the grid starts before 0
        ends = np.searchsorted(edges, part[1:])
        for k in range(inputs):
            filter_ = poles, residues, states[k]
            follow(filter_, edges, ends, forced[k] - began[k], rule, factors, answer[k, first + 1 :])
    out = answer[:, ahead:] + began * np.exp(-response.leak * after)
    if response.direct:
        out += response.direct * (np.asarray(values(after)).reshape(inputs, -1) - began)
    return out.reshape(*lead, -1)


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss's quadrature from 0 to 1."""
    roots, weights = np.polynomial.legendre.leggauss(count)
    return (roots + 1) / 2, weights / 2


@compiled(**FAST)
def follow(filter_: Any, edges: Array, ends: Any, forced: Array, rule: Any, factors: Any, out: Array) -> None:
    """Add to `out` what the poles answer at the edges numbered `ends`.

    `filter_` holds poles, residues, and the poles' states at the first edge, which become those at the last end;
    `forced` (K, n) the input in each interval between edges, at the nodes of the `rule`: shares of its length, and
    weights. `factors` (n,) is scratch. Edges are in s, poles in rad/s.
    """
    poles, residues, states = filter_
    nodes, weights = rule
    for p in range(len(poles)):
        pole, residue, state = poles[p], residues[p], states[p]
        if pole.imag < 0.0:
            continue  # its conjugate speaks for both
        if pole.imag > 0.0:
            residue *= 2.0
        known, decay, k = -1.0, state, 0
        for e in range(len(ends)):
            # s' = pole s + u, exactly over an interval: what was decays, what came in decays from its node on
            while k < ends[e]:
                length = edges[k + 1] - edges[k]
                if abs(length - known) > ALIKE * known:
                    known, decay = length, cmath.exp(pole * length)
                    for q in range(len(nodes)):
                        factors[q] = weights[q] * length * cmath.exp(pole * (length * (1.0 - nodes[q])))
                state *= decay
                for q in range(len(nodes)):
                    state += factors[q] * forced[k, q]
                k += 1
            out[e] += (residue * state).real
        states[p] = state


@compiled(**FAST)
def ring(filter_: Any, times: Array, struck: Any, states: Complex, out: Array) -> None:
    """Add to `out` (n, K) what the poles answer at increasing `times` to impulses: `struck` are their instants, and how
    large each is in each of K inputs (J, K); `states` (K,) is scratch."""
    poles, residues = filter_
    instants, impulses = struck
    for p in range(len(poles)):
        pole, residue, j = poles[p], residues[p], 0
        if pole.imag < 0.0:
            continue  # its conjugate speaks for both
        if pole.imag > 0.0:
            residue *= 2.0
        states[:] = 0.0
        for i in range(len(times)):
            decay = cmath.exp(pole * (times[i] - times[i - 1])) if i else 0.0 * pole
            for k in range(len(states)):
                states[k] *= decay
            while j < len(instants) and instants[j] < times[i]:
                decay = cmath.exp(pole * (times[i] - instants[j]))
                for k in range(len(states)):
                    states[k] += decay * impulses[j, k]
                j += 1
            for k in range(len(states)):
                out[i, k] += (residue * states[k]).real


def derivative_spectra(values: Array, *, fs: float, orders: Sequence[int], shift: float = 0.0) -> Complex:
    r"""What are the windowed Fourier integrals of a channel's derivatives?

    By parts, with the modulating function :math:`\varphi = w(t)\,e^{-i\omega t}` that vanishes at both ends with its
    derivatives (Shinbrot 1957, "On the analysis of linear and nonlinear systems", Trans. ASME 79),

    .. math:: \int \varphi\,x^{(n)}(t - d)\,dt = (-1)^n \int \varphi^{(n)}(t + d)\,x(t)\,dt ,

    so that neither a derivative nor a value between samples is ever made of noisy samples: the shift d moves the
    window. A relation that is linear in derivatives thus holds line by line, whatever the motion, with no leakage.

    Parameters
    ----------
    values : ndarray (n,)
        Samples.
    fs : float
        Sampling rate [Hz].
    orders : sequence of int
        Orders n of the derivatives wanted, 0 to 2.
    shift : float
        d [s], of a sample at most.

    Returns
    -------
    ndarray (len(orders), n // 2 + 1)
        At the frequencies ``np.fft.rfftfreq(n, 1 / fs)``, in samples of the channel's unit times 1/s^n.

    Examples
    --------
    >>> t = np.arange(4096) / 1000
    >>> x, a = np.cos(50 * t), -2500 * np.cos(50 * t)
    >>> of_x, of_a = derivative_spectra(x, fs=1000, orders=[2])[0], derivative_spectra(a, fs=1000, orders=[0])[0]
    >>> bool(np.abs(of_x - of_a).max() < 1e-6 * np.abs(of_a).max())
    True
    """
    count = len(values)
    windows = _windows(np.arange(0.5, count) / fs + shift, count / fs)
    transformed = [np.fft.rfft(window * values) for window in windows[: max(orders) + 1]]
    turn = 2j * math.pi * np.fft.rfftfreq(count, 1 / fs)
    later = np.exp(-turn * shift)
    spectra = np.empty((len(orders), len(turn)), dtype=complex)
    for row, order in zip(spectra, orders, strict=True):
        row[:] = later * sum(
            math.comb(order, j) * (-1) ** j * turn ** (order - j) * transformed[j] for j in range(order + 1)
        )
    return spectra


def window(count: int) -> Array:
    """The window, over `count` samples."""
    return _windows(np.arange(0.5, count), float(count))[0]


def _windows(times: Array, length: float) -> tuple[Array, Array, Array]:
    """The window and its first two derivatives: flat, with ends of u^4 (35 - 84 u + 70 u^2 - 20 u^3)."""
    taper = TAPER * length
    flat, first, second = np.ones_like(times), np.zeros_like(times), np.zeros_like(times)
    low, high = np.searchsorted(times, [taper, length - taper])
    for rows, side in ((slice(None, low), 1.0), (slice(high, None), -1.0)):
        inside = times[rows] if side > 0 else length - times[rows]
        u = np.clip(inside / taper, 0.0, 1.0)
        flat[rows] = u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)
        first[rows] = 140 * u**3 * (1 - u) ** 3 * side / taper
        second[rows] = 420 * u**2 * (1 - u) ** 2 * (1 - 2 * u) / taper**2
    return flat, first, second
