"""Does steady sliding last, or do motions couple, or friction that falls with speed feeds them, until it squeals?"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.drives import Belt
from stickslip.errors import ModelError
from stickslip.laws.base import Exit, finite
from stickslip.laws.curved import lifted, symbol
from stickslip.oscillator import Oscillator
from stickslip.structure import Contact, Structure

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array]
System = Oscillator | Structure

ROUNDING = 1e-11  # of the largest eigenvalue: growth below it is none
JAMS, ITSELF = "jamming", "the structure itself"
FINEST = 4 * float(np.finfo(float).eps)
SCANNED = 256  # values between which a threshold is looked for before it is closed in on


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


@dataclass(frozen=True)
class Threshold:
    """Where steady sliding ceases to be stable.

    Attributes
    ----------
    value : float
        Of the parameter.
    frequency : float
        Of the vibration that neither grows nor dies away there [Hz].
    mechanism : str
        What feeds it just beyond, as in :class:`Stability`.
    stable_below : bool
        Whether it is stable below the value.
    """

    value: float
    frequency: float
    mechanism: str
    stable_below: bool

    def __repr__(self) -> str:
        side = "below" if self.stable_below else "above"
        return f"Threshold: stable {side} {self.value:.6g}; beyond, {self.mechanism} at {self.frequency:.4g} Hz"


@dataclass(frozen=True, eq=False)
class _Rubbing:
    """A contact that slides steadily: its friction is level (N_0 + k_n w_n q) + slope (w_t q' - face)."""

    tangent: Array
    normal: Array
    stiffness: float
    preload: float
    level: float
    slope: float
    velocity: float

    @property
    def follows(self) -> Array:
        """What the friction adds to K because it follows the load."""
        return self.level * self.stiffness * np.outer(self.tangent, self.normal)

    @property
    def constant(self) -> float:
        """Friction force at q = 0 [N]."""
        return self.level * self.preload + self.slope * self.velocity


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

    >>> from stickslip import Belt, Contact, Coulomb, Structure
    >>> pad = Contact(Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
    >>> springs, none = [[23.25, 3.9], [3.9, 7.75]], [[0, 0], [0, 0]]
    >>> found = stability(Structure([[1, 0], [0, 1]], none, springs, contacts=[pad], drive=Belt(1.0)))
    >>> found.mechanism, round(found.frequency, 3)
    ('mode coupling', 0.73)
    """
    mass, damping, stiffness, rubbing = _parts(system, speed)
    pressed = stiffness + sum((r.stiffness * np.outer(r.normal, r.normal) for r in rubbing), np.zeros_like(mass))
    follows = sum((r.follows for r in rubbing), np.zeros_like(mass))
    falls = sum((r.slope * np.outer(r.tangent, r.tangent) for r in rubbing), np.zeros_like(mass))
    whole = (mass, damping + falls, pressed + follows)
    uncoupled, unsloped = (mass, damping + falls, pressed), (mass, damping, pressed + follows)
    bare = (mass, damping, pressed)
    modes = _modes(whole)
    place, loads, status = _rest(pressed + follows, rubbing)
    return Stability(
        stable=margin(whole) <= ROUNDING,
        modes=modes,
        mechanism=_mechanism(whole, bare, uncoupled, unsloped, modes),
        growth=modes[0].growth,
        without_coupling=_modes(uncoupled)[0].growth,
        without_slope=_modes(unsloped)[0].growth,
        place=place,
        loads=loads,
        status=status,
    )


def critical_value(
    system: System,
    parameter: str | Callable[[float], System],
    *,
    between: tuple[float, float],
    speed: float | None = None,
) -> Threshold:
    """At which friction, load, slope or speed does steady sliding cease to be stable?

    The first change between two values, closed in on to the last digits. Without any damping it is where two squared
    frequencies meet: the sign of the square of their difference changes there, which leaves no doubt where growth
    itself rises like a square root.

    Parameters
    ----------
    system : Structure or Oscillator
        What slides.
    parameter : str or callable
        Name of what is changed, as in ``system.having``, or a function that gives the system for a value;
        "drive.speed" is the belt's.
    between : tuple of float
        Lowest and highest value.
    speed : float, optional
        Of the counter-face, as in :func:`stability`.

    Returns
    -------
    Threshold

    Raises
    ------
    ModelError
        Nothing changes between both values, or as in :func:`stability`.

    Examples
    --------
    >>> from stickslip import Belt, LinearSlope, Oscillator
    >>> block = Oscillator(1.0, 100.0, LinearSlope(1.0, slope=-0.1), Belt(0.2), damping=0.3)
    >>> round(critical_value(block, "slope", between=(-1, 0)).value, 9)
    -0.3
    """
    from scipy.optimize import brentq

    def at(value: float) -> System:
        return parameter(value) if callable(parameter) else system.having(**{parameter: value})

    def excess(value: float) -> float:
        return margin(_whole(at(value), speed))

    bounds = numbers("between", between)
    if bounds.shape != (2,) or not bounds[0] < bounds[1]:
        step = "turn them round" if bounds.shape == (2,) and bounds[0] > bounds[1] else "give between=(lowest, highest)"
        raise ModelError(f"between = {between}", "it is two values, the lower one first", step)
    low, high = map(float, bounds)
    values = np.linspace(low, high, SCANNED + 1)
    signs = np.array([excess(value) > ROUNDING for value in values])
    changes = np.flatnonzero(signs[1:] != signs[:-1])
    if not len(changes):
        raise ModelError(
            f"steady sliding is {'un' * int(signs[0])}stable at {SCANNED + 1} values from {low:g} to {high:g}",
            "a threshold lies where that changes",
            "widen between=",
        )
    first = int(changes[0])
    ends = float(values[first]), float(values[first + 1])
    # where nothing dies away on the stable side there is no sign to change
    signed = all(abs(excess(end)) > ROUNDING for end in ends) and excess(ends[0]) * excess(ends[1]) < 0
    value = float(brentq(excess, *ends, xtol=1e-300, rtol=FINEST)) if signed else _bisected(excess, *ends)
    beyond = stability(at(ends[0] if signs[first] else ends[1]), speed=speed)
    frequency = 0.0 if beyond.frequency == 0 else _marginal_frequency(_whole(at(value), speed))
    return Threshold(value, frequency, beyond.mechanism, not signs[first])


def stability_map(
    system: System | Callable[..., System], *, grid: Mapping[str, Sequence[float]], speed: float | None = None
) -> xr.Dataset:
    """Where, over two or more parameters, does steady sliding last, and what ends it?

    Parameters
    ----------
    system : Structure, Oscillator or callable
        What slides; or a function that makes it of the values, which it takes by name.
    grid : mapping
        Values of each parameter by name, as in ``system.having`` ("preload", "slope", "kinetic" ...).
    speed : float, optional
        As in :func:`stability`.

    Returns
    -------
    xarray.Dataset
        "growth" [1/s], "frequency" [Hz] and "mechanism" over the parameters.

    Raises
    ------
    ModelError
        No grid, one whose names the function does not take, or as in :func:`stability`.

    Examples
    --------
    >>> from stickslip import Belt, LinearSlope, Oscillator
    >>> block = Oscillator(1.0, 100.0, LinearSlope(1.0, slope=-0.1), Belt(0.2), damping=0.3)
    >>> found = stability_map(block, grid={"slope": [-0.5, -0.1], "stiffness": [50.0, 100.0]})
    >>> found.mechanism.values.tolist()
    [['falling friction', 'falling friction'], ['stable', 'stable']]
    """
    import xarray

    axes = {name: numbers(name, values) for name, values in grid.items()}
    if not axes or not all(values.ndim == 1 and len(values) for values in axes.values()):
        raise ModelError(
            f"grid = {dict(grid)!r}", "a map has values for each of its parameters", "give lists of numbers"
        )
    for name, axis in axes.items():
        if np.any(np.diff(axis) <= 0):
            raise ModelError(f"{name} = {axis.tolist()}", "the values of a map rise", "sort them, each of them once")
    shape = tuple(len(values) for values in axes.values())
    if callable(system):
        _require_taken(system, axes)
    found = np.empty(shape, dtype=object)
    for place in np.ndindex(*shape):
        values = {name: float(axes[name][i]) for name, i in zip(axes, place, strict=True)}
        found[place] = stability(system(**values) if callable(system) else system.having(**values), speed=speed)

    def told(what: Callable[[Stability], Any], kind: Any) -> tuple[list[str], NDArray[Any]]:
        return list(axes), np.array([what(one) for one in found.ravel()], dtype=kind).reshape(shape)

    data = {
        "growth": told(lambda one: one.growth, float),
        "frequency": told(lambda one: one.frequency, float),
        "mechanism": told(lambda one: one.mechanism, str),
    }
    return xarray.Dataset(data, coords=axes)


def _require_taken(system: Callable[..., System], axes: Mapping[str, Array]) -> None:
    """Refuse a grid whose names are not what the function takes."""
    taken = inspect.signature(system)
    try:
        taken.bind(**axes)
    except TypeError as error:
        raise ModelError(
            f"a grid over {', '.join(axes)}",
            f"the function that makes the system takes {', '.join(taken.parameters) or 'nothing'}",
            "give the grid the function's names",
        ) from error


def numbers(name: str, values: ArrayLike) -> Array:
    """Values of a parameter; refused where they are no numbers."""
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.array([math.nan])
    if not np.all(np.isfinite(found)):
        raise ModelError(f"{name} = {values!r}", "the values of a parameter are finite numbers", "correct them")
    return found


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


def _modes(matrices: Matrices) -> tuple[SlidingMode, ...]:
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


def _marginal_frequency(matrices: Matrices) -> float:
    """Of the motion that neither grows nor dies away [Hz]; without damping, where two meet, of their mean square."""
    mass, damping, stiffness = matrices
    if damping.any() or len(mass) == 1:
        return _modes(matrices)[0].frequency
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).astype(complex)
    a, b = min(combinations(squares, 2), key=lambda pair: abs(pair[0] - pair[1]))
    return math.sqrt(abs((a + b).real) / 2) / (2 * math.pi)


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


def _rest(stiffness: Array, rubbing: Sequence[_Rubbing]) -> tuple[tuple[float, ...], tuple[float, ...], str]:
    """Place and loads of steady sliding, and whether it can be."""
    if np.linalg.cond(stiffness) > 1 / np.finfo(float).eps:
        loads = tuple(r.preload for r in rubbing)
        return (math.nan,) * len(stiffness), loads, "no spring holds it: the loads are those before it slides"
    place = -np.linalg.solve(stiffness, sum((r.constant * r.tangent for r in rubbing), np.zeros(len(stiffness))))
    loads = tuple(float(r.preload + r.stiffness * (r.normal @ place)) for r in rubbing)
    lifting = [str(j) for j, load in enumerate(loads, start=1) if load <= 0]
    status = f"contact {', '.join(lifting)} would lift off before it slides steadily" if lifting else "ok"
    return tuple(map(float, place)), loads, status


def _whole(system: System, speed: float | None) -> Matrices:
    mass, damping, stiffness, rubbing = _parts(system, speed)
    for r in rubbing:
        damping = damping + r.slope * np.outer(r.tangent, r.tangent)
        stiffness = stiffness + r.stiffness * np.outer(r.normal, r.normal) + r.follows
    return mass, damping, stiffness


def _parts(system: System, speed: float | None) -> tuple[Array, Array, Array, list[_Rubbing]]:
    """M, C, K without contacts, and the contacts."""
    if not isinstance(system, Oscillator | Structure):
        raise ModelError(f"a system {system!r}", "what slides is an Oscillator or a Structure", "give one")
    if speed is None:
        if not isinstance(system.drive, Belt):
            raise ModelError(
                f"a system driven by {type(system.drive).__name__}",
                "steady sliding needs a counter-face that runs at a steady speed",
                "give it drive=Belt(speed), or say speed=",
            )
        speed = system.drive.speed
    if finite("speed", speed, unit="m/s", signed=True) == 0:
        raise ModelError(
            f"speed = {speed} m/s", "a counter-face that slides has a speed", "give a number that is not 0"
        )
    if isinstance(system, Oscillator):
        numbers = (np.array([[value]]) for value in (system.mass, system.damping, system.stiffness))
        level, slope = _curve(system.law, -speed)
        one, none = np.ones(1), np.zeros(1)
        return *numbers, [_Rubbing(one, none, 0.0, 1.0, level, slope, -speed)]  # type: ignore[return-value]
    if not system.contacts:
        raise ModelError("a structure without contacts", "something has to rub", "give it contacts=[...]")
    matrices = (np.asarray(part, dtype=np.float64) for part in (system.mass, system.damping, system.stiffness))
    return *matrices, [_rubbing(contact, speed) for contact in system.contacts]  # type: ignore[return-value]


def _rubbing(contact: Contact, speed: float) -> _Rubbing:
    tangent = np.asarray(contact.tangent)
    normal = np.zeros_like(tangent) if contact.normal is None else np.asarray(contact.normal)
    velocity = -contact.carried * speed
    if velocity == 0:
        raise ModelError(
            "a contact whose counter-face is at rest (carried = 0)",
            "every contact slides while sliding is steady",
            "give carried=, or leave that contact out",
        )
    level, slope = _row(contact, velocity)
    return _Rubbing(tangent, normal, contact.stiffness, contact.preload, level, slope, velocity)


def _row(part: Any, velocity: float) -> tuple[float, float]:
    """Friction of the slip that lasts at a relative velocity: its share of the load, and its slope."""
    side = 1 if velocity > 0 else -1
    for mode in part.modes() if hasattr(part, "modes") else ():
        if mode.kind == "slip" and mode.side == side and all(_lasts(exit_, velocity) for exit_ in mode.exits):
            if mode.rates or mode.friction is None or set(mode.friction) - {"1", "v"}:
                break
            return mode.friction.get("1", 0.0), mode.friction.get("v", 0.0)
    law = getattr(part, "law", part)
    raise ModelError(
        f"{type(law).__name__}, which remembers",
        "steady sliding is told of friction that follows speed and load alone",
        "use Coulomb, LinearSlope, Tabulated, CompliantContact or a curve; of a mass on a belt ask steady_sliding()",
    )


def _lasts(exit_: Exit, velocity: float) -> bool:
    """Whether an exit that is about the speed stays shut."""
    if "v" not in exit_.quantity or set(exit_.quantity) - {"v", "1", "always"}:
        return True
    bound = exit_.quantity.get("1", 0.0) + exit_.quantity.get("always", 0.0)
    return exit_.quantity["v"] * velocity + bound <= 0


def _curve(law: Any, velocity: float) -> tuple[float, float]:
    """Friction force at rest of the tangent to the law's curve at a relative velocity, and the tangent's slope."""
    if not hasattr(law, "branches"):
        return _row(law, velocity)
    side, fast = math.copysign(1.0, velocity), abs(velocity)
    curve = max((branch for branch in law.branches() if branch[0] <= fast), key=lambda branch: branch[0])[1]
    friction = lifted(curve(symbol("v")))
    slope = friction.slope("v").at(v=fast)
    return side * (friction.at(v=fast) - slope * fast), slope


def _bisected(excess: Callable[[float], float], low: float, high: float) -> float:
    """Where growth begins beside values at which there is none at all, not even a decay."""
    began = excess(low) > ROUNDING
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        if (excess(middle) > ROUNDING) == began:
            low = middle
        else:
            high = middle
