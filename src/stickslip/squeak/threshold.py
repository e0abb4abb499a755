"""Where steady sliding ceases to be stable: along a parameter, and over several."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import ModelError
from stickslip.squeak.sliding import Array, Matrices, System, sliding_matrices
from stickslip.squeak.stability import ROUNDING, Stability, margin, modes_of, stability

if TYPE_CHECKING:
    import xarray as xr

FINEST = 4 * float(np.finfo(float).eps)
SCANNED = 256  # values between which a threshold is looked for before it is closed in on


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
    frequency = 0.0 if beyond.frequency == 0 else _marginal_frequency(sliding_matrices(at(value), speed))
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
    >>> from stickslip import Oscillator
    >>> from stickslip.drives import Belt
    >>> from stickslip.laws import LinearSlope
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
