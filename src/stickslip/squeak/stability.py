"""Does steady sliding last, or do motions couple, or friction that falls with speed feeds them, until it squeals?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from stickslip.squeak.sliding import Array, Matrices, Rubbing, System, sliding_parts

ROUNDING = 1e-11  # of the largest eigenvalue: growth below it is none
JAMS, ITSELF = "jamming", "the structure itself"


@dataclass(frozen=True, eq=False)
class SlidingMode:
    """One way in which a sliding structure vibrates.

    Attributes
    ----------
    frequency : float
        [Hz]; 0 where the motion does not oscillate.
    growth : float
        Real part of the eigenvalue [1/s]; positive where it grows.
    shape : ndarray of complex, shape (n,)
        Displacements against the largest one, which is 1: what their angles differ by is the phase between them.
    """

    frequency: float
    growth: float
    shape: NDArray[np.complex128]

    @property
    def damping_ratio(self) -> float:
        """Share of critical damping; negative where the motion grows."""
        size = math.hypot(self.growth, 2 * math.pi * self.frequency)
        return -self.growth / size if size and self.growth else 0.0


@dataclass(frozen=True, eq=False)
class Stability:
    """Whether steady sliding lasts, and what ends it.

    Attributes
    ----------
    stable : bool
        Whether every small vibration dies away (or, without any damping, does not grow).
    modes : tuple of SlidingMode
        Those that grow fastest first.
    mechanism : str
        "stable", or what feeds the growth: "mode coupling", "falling friction", "mode coupling and falling friction
        together" (neither alone is enough), "mode coupling, and falling friction too" (each alone is enough),
        "jamming" (the contact draws itself in without oscillating, as a sprag does), or "the structure itself" (it
        grows without any friction: dampers that feed it, springs that buckle).
    growth : float
        Fastest growth [1/s].
    without_coupling, without_slope : float
        The same where friction does not follow the load, and where it does not change with the speed [1/s].
    place : tuple of float
        Displacements while it slides steadily [m, or rad of an angle].
    loads : tuple of float
        Load on each contact there [N].
    status : str
        "ok", or why steady sliding is not what the contacts would do.
    """

    stable: bool
    modes: tuple[SlidingMode, ...]
    mechanism: str
    growth: float
    without_coupling: float
    without_slope: float
    place: tuple[float, ...]
    loads: tuple[float, ...]
    status: str

    @property
    def frequency(self) -> float:
        """Frequency of the mode that grows fastest, or dies away slowest [Hz]."""
        return self.modes[0].frequency

    def __repr__(self) -> str:
        change = "grows" if self.growth > 0 else "dies away"
        head = f"Stability: {self.mechanism}, {self.frequency:.4g} Hz {change} by {abs(self.growth):.4g} 1/s"
        rows = [f"{mode.frequency:.5g} Hz, damping ratio {mode.damping_ratio:.3g}" for mode in self.modes]
        return "\n  ".join([head if self.status == "ok" else f"{head} [{self.status}]", *rows])


def stability(system: System, *, speed: float | None = None) -> Stability:
    r"""Does steady sliding last, and if not, what feeds the vibration?

    Small motions about steady sliding obey

    .. math:: M\ddot q + \Big(C + \sum s\,w_t w_t^T\Big)\dot q
        + \Big(K + \sum k_n\,w_n w_n^T + \sum \pm\mu\,k_n\,w_t w_n^T\Big)\,q = 0

    with s the slope of friction against sliding speed [N s/m]. The last sum is not symmetric: through it two motions
    of like frequency couple and one takes up energy, whatever the slope (Hoffmann, Fischer, Allgaier and Gaul, "A
    minimal model for studying properties of the mode-coupling type instability", 2002). A negative s feeds the motion
    by itself (Stribeck). Each is switched off in turn to tell which it was. A contact with a stiffness of its own
    (CompliantContact) slides as a rigid one does.

    Parameters
    ----------
    system : Structure or Oscillator
        What slides: on a belt, or at the speed given.
    speed : float, optional
        Of the counter-face [m/s]; that of the system's Belt where left out.

    Returns
    -------
    Stability

    Raises
    ------
    ModelError
        Nothing slides, no speed is known, or the law's memory has a part in the vibration.

    Examples
    --------
    A pad pressed on a belt, sprung along it and across it (the minimal model of Hoffmann and others):

    >>> from stickslip import Contact, Structure

    >>> from stickslip.drives import Belt

    >>> from stickslip.laws import Coulomb
    >>> pad = Contact(Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
    >>> springs, none = [[23.25, 3.9], [3.9, 7.75]], [[0, 0], [0, 0]]
    >>> found = stability(Structure([[1, 0], [0, 1]], none, springs, contacts=[pad], drive=Belt(1.0)))
    >>> found.mechanism, round(found.frequency, 3)
    ('mode coupling', 0.73)
    """
    mass, damping, stiffness, rubbing = sliding_parts(system, speed)
    pressed = stiffness + sum((r.stiffness * np.outer(r.normal, r.normal) for r in rubbing), np.zeros_like(mass))
    follows = sum((r.follows for r in rubbing), np.zeros_like(mass))
    falls = sum((r.slope * np.outer(r.tangent, r.tangent) for r in rubbing), np.zeros_like(mass))
    whole = (mass, damping + falls, pressed + follows)
    uncoupled, unsloped = (mass, damping + falls, pressed), (mass, damping, pressed + follows)
    bare = (mass, damping, pressed)
    modes = modes_of(whole)
    place, loads, status = _rest(pressed + follows, rubbing)
    return Stability(
        stable=margin(whole) <= ROUNDING,
        modes=modes,
        mechanism=_mechanism(whole, bare, uncoupled, unsloped, modes),
        growth=modes[0].growth,
        without_coupling=modes_of(uncoupled)[0].growth,
        without_slope=modes_of(unsloped)[0].growth,
        place=place,
        loads=loads,
        status=status,
    )


def margin(matrices: Matrices) -> float:
    """Negative where small motions die away; it passes through zero, with a slope, where one begins to grow.

    Without damping, minus the least square of the difference of two squared frequencies, or the least squared
    frequency, over their size; else the fastest growth over the largest eigenvalue.
    """
    mass, damping, stiffness = matrices
    if damping.any():
        values = np.linalg.eigvals(_flow(matrices))
        return float(np.max(values.real) / np.max(np.abs(values)))
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).astype(complex)
    size = float(np.max(np.abs(squares))) or 1.0
    apart = [float(((a - b) ** 2).real) / size**2 for a, b in combinations(squares, 2)]
    return max(-min(apart, default=math.inf), -float(np.min(squares.real)) / size)


def _flow(matrices: Matrices) -> Array:
    """A of the state (q, q')."""
    mass, damping, stiffness = matrices
    count = len(mass)
    flow = np.zeros((2 * count, 2 * count))
    flow[:count, count:] = np.eye(count)
    flow[count:] = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    return flow


def modes_of(matrices: Matrices) -> tuple[SlidingMode, ...]:
    """One for each pair of eigenvalues and each real one, those that grow fastest first."""
    values, vectors = np.linalg.eig(_flow(matrices))
    largest, count = float(np.max(np.abs(values))), len(matrices[0])
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag < -ROUNDING * largest:
            continue
        shape = vector[:count] / vector[np.argmax(np.abs(vector[:count]))]
        growth = float(value.real) if abs(value.real) > ROUNDING * largest else 0.0
        frequency = float(value.imag) if value.imag > ROUNDING * largest else 0.0
        found.append(SlidingMode(frequency / (2 * math.pi), growth, shape))
    return tuple(sorted(found, key=lambda mode: (-mode.growth, mode.frequency)))


def _mechanism(
    whole: Matrices, bare: Matrices, uncoupled: Matrices, unsloped: Matrices, modes: Sequence[SlidingMode]
) -> str:
    if margin(whole) <= ROUNDING:
        return "stable"
    if margin(bare) > ROUNDING:
        return ITSELF
    grows_by_slope, grows_by_coupling = margin(uncoupled) > ROUNDING, margin(unsloped) > ROUNDING
    if modes[0].frequency == 0 and grows_by_coupling:
        return JAMS
    if grows_by_slope and grows_by_coupling:
        return "mode coupling, and falling friction too"
    if not grows_by_slope and not grows_by_coupling:
        return "mode coupling and falling friction together"
    return "falling friction" if grows_by_slope else "mode coupling"


def _rest(stiffness: Array, rubbing: Sequence[Rubbing]) -> tuple[tuple[float, ...], tuple[float, ...], str]:
    """Place and loads of steady sliding, and whether it can be."""
    if np.linalg.cond(stiffness) > 1 / np.finfo(float).eps:
        loads = tuple(r.preload for r in rubbing)
        return (math.nan,) * len(stiffness), loads, "no spring holds it: the loads are those before it slides"
    place = -np.linalg.solve(stiffness, sum((r.constant * r.tangent for r in rubbing), np.zeros(len(stiffness))))
    loads = tuple(float(r.preload + r.stiffness * (r.normal @ place)) for r in rubbing)
    lifting = [str(j) for j, load in enumerate(loads, start=1) if load <= 0]
    status = f"contact {', '.join(lifting)} would lift off before it slides steadily" if lifting else "ok"
    return tuple(map(float, place)), loads, status
