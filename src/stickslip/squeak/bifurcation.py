"""How a vibration begins as a parameter changes, and whether it ends where it began.

Where steady sliding ceases to be stable: along a parameter, and over several.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.arrays import Array
from stickslip.drives.kinds import Belt
from stickslip.errors import ModelError
from stickslip.squeak.cycles import LimitCycle, limit_cycle, separating_cycle
from stickslip.squeak.stability import (
    ROUNDING,
    Matrices,
    Stability,
    System,
    margin,
    modes_of,
    sliding_matrices,
    stability,
)

if TYPE_CHECKING:
    import xarray as xr


SMALL, HALF, LARGE = 1e-3, 0.5, 1.5  # `push`: mostly, close to the threshold, and where no small one lasts
LEAST = 3  # values of a parameter
UNTOLD = "cannot be told"
NEARBY = (1e-3, 1e-2)  # of the range: how far from the threshold the kind of the bifurcation is looked at
ROOT, JUMP = (0.35, 0.65), 0.2  # powers of the distance: an amplitude that starts like a root, and one that jumps
FINEST = 4 * float(np.finfo(float).eps)
SCANNED = 256  # values between which a threshold is looked for before it is closed in on


@dataclass(frozen=True, eq=False)
class CycleBranches:
    """Limit cycles over a parameter, followed up and down.

    Attributes
    ----------
    values : ndarray (K,)
        Of the parameter, rising.
    up, down : tuple of LimitCycle
        At each value, in the order of the values: each started from the motion at the value before, going up and going
        down, and from a small vibration where that had died away.
    threshold : Threshold or None
        Where steady sliding ceases to be stable; None where it does not.
    kind : str
        "supercritical" (the vibration ends where it began), "subcritical" (it lasts beside stable sliding too),
        "cannot be told".
    exponent : float
        Power of the distance from the threshold with which the amplitude starts: 1/2 for a smooth law, 0 where it
        jumps; nan where unknown.
    both : tuple of float or None
        Lowest and highest value at which vibration and stable sliding were both found.
    evidence : str
        Why it is called so.
    between : tuple of LimitCycle or None
        At each value the unstable cycle that separates the vibration from stable sliding: None where not both last, or
        where nothing but whether a contact just sticks or lifts separates them.
    """

    values: Array
    up: tuple[LimitCycle, ...]
    down: tuple[LimitCycle, ...]
    threshold: Threshold | None
    kind: str
    exponent: float
    both: tuple[float, float] | None
    evidence: str
    between: tuple[LimitCycle | None, ...]

    def amplitudes(self, direction: str = "up") -> Array:
        """Of the contact that slides to and fro most [m], (K,).

        Parameters
        ----------
        direction : {"up", "down", "between"}
            Of which way, or of the unstable cycles between: nan where there is none.

        Returns
        -------
        ndarray
        """
        if direction == "between":
            return np.array([math.nan if cycle is None else cycle.amplitude for cycle in self.between])
        return np.array([cycle.amplitude for cycle in (self.up if direction == "up" else self.down)])

    def __repr__(self) -> str:
        return f"CycleBranches({self.values[0]:g} to {self.values[-1]:g}): {self.kind}; {self.evidence}"


def limit_cycles(
    system: System, parameter: str | Callable[[float], System], *, values: ArrayLike, speed: float | None = None
) -> CycleBranches:
    """How does the vibration begin as a parameter changes, and does it end where it began?

    The motion is followed up and down, each time from the one at the value before; where steady sliding is stable and a
    vibration lasts all the same, the bifurcation is subcritical. Where no small vibration lasts, going down begins with
    one that lifts or stops a contact. Close to the threshold it is looked at anew:
    at a thousandth and a hundredth of the range on either side of it.

    Parameters
    ----------
    system : Structure or Oscillator
        What slides.
    parameter : str or callable
        As in :func:`critical_value`.
    values : array_like
        Values of the parameter (K,), rising, at least three.
    speed : float, optional
        As in :func:`limit_cycle`.

    Returns
    -------
    CycleBranches

    Raises
    ------
    ModelError
        Values that do not rise, or as in :func:`limit_cycle`.

    Examples
    --------
    Friction that is larger at rest: a mass that sticks and slips goes on so at speeds at which it may slide as well.

    >>> from stickslip import Oscillator

    >>> from stickslip.drives import Belt

    >>> from stickslip.laws import Coulomb
    >>> block = Oscillator(1.0, 1.0, Coulomb(1.0, static=1.5), Belt(0.5), damping=0.1)
    >>> cycles = limit_cycles(block, "drive.speed", values=[0.3, 0.4, 0.5, 0.6])
    >>> {one.status for one in cycles.up}, [one.status for one in cycles.down], cycles.both
    ({'steady sliding'}, ['periodic', 'periodic', 'periodic', 'steady sliding'], (0.3, 0.5))
    """
    places = numbers("values", values)
    if places.ndim != 1 or len(places) < LEAST or np.any(np.diff(places) <= 0):
        few = places.ndim != 1 or len(places) < LEAST
        step = "give a row of them, as from np.linspace" if few else "sort them, and leave out what is there twice"
        raise ModelError(f"values = {values!r}", f"they are at least {LEAST} numbers that rise", step)

    def at(value: float) -> System:
        changed = parameter(value) if callable(parameter) else system.having(**{parameter: value})
        return changed if speed is None else changed.having(drive=Belt(speed))

    up = _along(at, places, SMALL)
    down = _along(at, places[::-1], SMALL if any(one.vibrates for one in up) else LARGE)[::-1]
    lasting = [next(filter(_lasts_beside, two), None) for two in zip(down, up, strict=True)]
    beside = [float(v) for v, one in zip(places, lasting, strict=True) if one is not None]
    between = tuple(one and separating_cycle(at(float(v)), one) for v, one in zip(places, lasting, strict=True))
    ends, width = (float(places[0]), float(places[-1])), float(np.ptp(places))
    try:
        threshold = critical_value(at(ends[0]), at, between=ends)
    except ModelError:
        status = f"steady sliding is {'' if up[0].sliding.stable else 'un'}stable at every value"
        if beside:
            status += f"; a vibration lasts beside it from {beside[0]:.4g} to {beside[-1]:.4g}"
        both = (beside[0], beside[-1]) if beside else None
        return CycleBranches(places, up, down, None, UNTOLD, math.nan, both, status, between)
    return CycleBranches(places, up, down, threshold, *_called(at, threshold, beside, width), between)


def _lasts_beside(cycle: LimitCycle) -> bool:
    """Whether a vibration lasts where steady sliding is stable."""
    return cycle.sliding.stable and cycle.status in ("periodic", "not periodic")


def _along(at: Callable[[float], System], values: Array, push: float) -> tuple[LimitCycle, ...]:
    """The motions at values in turn, each from the one before where that vibrates."""
    cycles: list[LimitCycle] = []
    for value in values:
        cycles.append(_from(at(float(value)), cycles[-1] if cycles else None, push))
    return tuple(cycles)


def _from(system: System, before: LimitCycle | None, push: float) -> LimitCycle:
    """The limit cycle of a system, started from a motion of its neighbour: the same deviation from steady sliding."""
    if before is None or not before.vibrates:
        return limit_cycle(system, push=push)
    count = len(before.sliding.place)
    names = before.motion.table.names[: 2 * count]
    old, new = (np.append(one.place, np.zeros(count)) for one in (before.sliding, stability(system)))
    state = before.motion.states[0, : 2 * count] - old + new
    return limit_cycle(system, start=dict(zip(names, map(float, state), strict=True)))


def _called(
    at: Callable[[float], System], threshold: Threshold, beside: Sequence[float], width: float
) -> tuple[str, float, tuple[float, float] | None, str]:
    """Kind, exponent, range of both, and evidence: what lasts close to the threshold, beyond it and on the way back."""
    ahead = width if threshold.stable_below else -width
    beyond = [limit_cycle(at(threshold.value + share * ahead), push=HALF) for share in NEARBY]
    before = [threshold.value - share * ahead for share in NEARBY]
    back: list[LimitCycle] = []
    for value in before:
        back.append(_from(at(value), back[-1] if back else beyond[0], LARGE))
    near, far = (one.amplitude for one in beyond)
    exponent = math.log(far / near) / math.log(NEARBY[1] / NEARBY[0]) if near and far else math.nan
    begins = _begins(exponent, beyond[0])
    both = sorted([*beside, *(value for value, one in zip(before, back, strict=True) if _lasts_beside(one))])
    if both:
        status = f"{begins}; a vibration lasts beside stable sliding from {both[0]:.4g} to {both[-1]:.4g}"
        return "subcritical", exponent, (both[0], both[-1]), status
    if back[0].status == "steady sliding" and all(one.vibrates for one in beyond):
        status = f"{begins}; on the way back it has died away {abs(before[0] - threshold.value):.2g} past the threshold"
        return "supercritical", exponent, None, status
    return UNTOLD, exponent, None, f"{beyond[0].status} beyond the threshold, {back[0].status} before it"


def _begins(exponent: float, cycle: LimitCycle) -> str:
    """How the amplitude begins, in words."""
    if ROOT[0] < exponent < ROOT[1]:
        return f"the amplitude grows with the power {exponent:.2f} of the distance from the threshold"
    if abs(exponent) < JUMP:
        limit = "a contact lifts off" if any(cycle.separation_share) else "a contact sticks"
        bounded = any(cycle.separation_share + cycle.stick_share)
        return f"the amplitude jumps to {cycle.amplitude:.3g} m" + f": the motion grows until {limit}" * bounded
    return f"close to the threshold the amplitude changes with the power {exponent:.2f} of the distance"


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
    >>> from stickslip import Oscillator
    >>> from stickslip.drives import Belt
    >>> from stickslip.laws import LinearSlope
    >>> block = Oscillator(1.0, 100.0, LinearSlope(1.0, slope=-0.1), Belt(0.2), damping=0.3)
    >>> round(critical_value(block, "slope", between=(-1, 0)).value, 9)
    -0.3
    """
    from scipy.optimize import brentq

    def at(value: float) -> System:
        return parameter(value) if callable(parameter) else system.having(**{parameter: value})

    def excess(value: float) -> float:
        return margin(sliding_matrices(at(value), speed))

    bounds = numbers("between", between)
    if bounds.shape != (2,) or not bounds[0] < bounds[1]:
        step = "turn them round" if bounds.shape == (2,) and bounds[0] > bounds[1] else "give between=(lowest, highest)"
        raise ModelError(f"between = {between}", "it is two values, the lower one first", step)
    low, high = map(float, bounds)
    grows = excess(low) > ROUNDING
    after = low
    for value in map(float, np.linspace(low, high, SCANNED + 1)[1:]):
        ends, after = (after, value), value
        if (excess(value) > ROUNDING) != grows:
            break
    else:
        raise ModelError(
            f"steady sliding is {'un' * grows}stable at {SCANNED + 1} values from {low:g} to {high:g}",
            "a threshold lies where that changes",
            "widen between=",
        )
    # where nothing dies away on the stable side there is no sign to change
    signed = all(abs(excess(end)) > ROUNDING for end in ends) and excess(ends[0]) * excess(ends[1]) < 0
    value = float(brentq(excess, *ends, xtol=1e-300, rtol=FINEST)) if signed else _bisected(excess, *ends)
    beyond = stability(at(ends[0] if grows else ends[1]), speed=speed)
    frequency = 0.0 if beyond.frequency == 0 else _marginal_frequency(sliding_matrices(at(value), speed))
    return Threshold(value, frequency, beyond.mechanism, not grows)


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
    >>> from stickslip import Oscillator
    >>> from stickslip.drives import Belt
    >>> from stickslip.laws import LinearSlope
    >>> block = Oscillator(1.0, 100.0, LinearSlope(1.0, slope=-0.1), Belt(0.2), damping=0.3)
    >>> chart = stability_map(block, grid={"slope": [-0.5, -0.1], "stiffness": [50.0, 100.0]})
    >>> chart.mechanism.values.tolist()
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
    answers = np.empty(shape, dtype=object)
    for place in np.ndindex(*shape):
        values = {name: float(axes[name][i]) for name, i in zip(axes, place, strict=True)}
        answers[place] = stability(system(**values) if callable(system) else system.having(**values), speed=speed)

    def mapped(what: Callable[[Stability], Any], kind: Any) -> tuple[list[str], NDArray[Any]]:
        return list(axes), np.array([what(one) for one in answers.ravel()], dtype=kind).reshape(shape)

    data = {
        "growth": mapped(lambda one: one.growth, float),
        "frequency": mapped(lambda one: one.frequency, float),
        "mechanism": mapped(lambda one: one.mechanism, str),
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
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.array([math.nan])
    if not np.all(np.isfinite(array)):
        raise ModelError(f"{name} = {values!r}", "the values of a parameter are finite numbers", "correct them")
    return array


def _marginal_frequency(matrices: Matrices) -> float:
    """Of the motion that neither grows nor dies away [Hz]; without damping, where two meet, of their mean square."""
    mass, damping, stiffness = matrices
    if damping.any() or len(mass) == 1:
        return modes_of(matrices)[0].frequency
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).astype(complex)
    a, b = min(combinations(squares, 2), key=lambda pair: abs(pair[0] - pair[1]))
    return math.sqrt(abs((a + b).real) / 2) / (2 * math.pi)


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
