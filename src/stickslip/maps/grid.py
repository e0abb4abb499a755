"""The grid of a sweep: which parameters take which values, along which dimensions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.parameters import changed, find
from stickslip.parameters import unit as unit_of
from stickslip.solve.tables import System

MOST = 10_000_000  # values along an axis; more fit no memory
START = "start."  # before the name of an entry of the start: "start.x", "start.mode"
Grid = Mapping[Any, Any] | Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class Axis:
    """One dimension of a map: parameters that change together.

    Attributes
    ----------
    dim : str
        Name of the dimension.
    names : tuple of str
        The parameters.
    values : tuple of tuple
        For each step along the dimension, one value for each parameter.
    """

    dim: str
    names: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]


def read_grid(system: System, grid: Grid) -> tuple[Axis, ...]:
    """The axes that a grid means: each name, or tuple of names, a dimension; a list of mappings, one of points.

    Raises
    ------
    ModelError
        The grid is empty, or names a parameter that the system does not have, or one twice.
    """
    axes = _dimensions(grid) if isinstance(grid, Mapping) else _points(grid)
    if not axes:
        raise ModelError(
            "an empty grid", "a sweep changes one parameter at least", 'give one, as {"kinetic": [1.0, 1.1]}'
        )
    taken: dict[tuple[str, ...], str] = {}
    for name in (name for axis in axes for name in axis.names):
        for path in _paths(system, name):
            if path in taken:
                raise ModelError(
                    f"'{taken[path]}' and '{name}' are one parameter",
                    "a parameter lies along one axis",
                    "leave one out, or name the place, as in 'law.stiffness'",
                )
            taken[path] = name
    return axes


def apart(system: System, axes: tuple[Axis, ...], answers: Iterable[str]) -> tuple[Axis, ...]:
    """The axes, a parameter that is called as an answer of the map named by its place: "drive.amplitude".

    Raises
    ------
    ModelError
        The parameter is the system's own or several parts', and so has no such name.
    """
    taken = set(answers)

    def own(name: str) -> str:
        paths = _paths(system, name) if name in taken else ((name,),)
        if name in taken and (len(paths) > 1 or len(paths[0]) == 1):
            raise ModelError(
                f"'{name}' is a parameter and a measure", "a name stands for one of them", "rename the measure"
            )
        return ".".join(paths[0])

    named = [replace(axis, names=tuple(map(own, axis.names))) for axis in axes]
    return tuple(axis if axis.dim == "point" else replace(axis, dim="_".join(axis.names)) for axis in named)


def _dimensions(grid: Mapping[Any, Any]) -> tuple[Axis, ...]:
    return tuple(_axis(key, values) for key, values in grid.items())


def _axis(key: Any, values: Any) -> Axis:
    names = (key,) if isinstance(key, str) else tuple(key)
    if not names or not all(isinstance(name, str) for name in names):
        raise ModelError(
            f"the grid has {key!r}",
            "a parameter is a name, or several that change together a tuple",
            'write it as "kinetic"',
        )
    if isinstance(values, str) or not hasattr(values, "__len__"):
        raise ModelError(f"{key} = {values!r}", "along an axis stand several values", f"give a list, as [{values!r}]")
    if len(values) > MOST:
        raise ModelError(
            f"{key} has {len(values)} values", f"along an axis stand {MOST} at most", "take fewer, or several axes"
        )
    if len(values) == 0:
        raise ModelError(f"{key} has no values", "an empty grid has no map", "give at least one value")
    rows = tuple((value,) for value in values) if len(names) == 1 else tuple(tuple(row) for row in values)
    return _checked(Axis("_".join(names), names, rows))


def _points(points: Sequence[Mapping[str, Any]]) -> tuple[Axis, ...]:
    if len(points) == 0:
        return ()
    names = tuple(points[0])
    if not names:
        return ()
    if any(set(point) != set(names) for point in points):
        raise ModelError(
            "points with different parameters", "every point of a list names the same ones", "fill them in"
        )
    return (_checked(Axis("point", names, tuple(tuple(point[name] for name in names) for point in points))),)


def _checked(axis: Axis) -> Axis:
    for number, row in enumerate(axis.values):
        if len(row) != len(axis.names):
            raise ModelError(
                f"value {number + 1} of {', '.join(axis.names)} has {len(row)} entries",
                f"there is one for each of {len(axis.names)} parameters",
                "give as many",
            )
        for name, value in zip(axis.names, row, strict=True):
            if _is_number(value) and not np.isfinite(value):
                raise ModelError(f"{name} = {value} in the grid", "a parameter is a finite number", "leave it out")
    return axis


def _paths(system: System, name: str) -> tuple[tuple[str, ...], ...]:
    return ((name,),) if name.startswith(START) else find(system, name)


def placed(
    system: System, start: Mapping[str, float | str], axes: tuple[Axis, ...], steps: Sequence[int]
) -> tuple[System, dict[str, float | str]]:
    """The system and the start at one point of the grid."""
    given = {
        name: value
        for axis, step in zip(axes, steps, strict=True)
        for name, value in zip(axis.names, axis.values[step], strict=True)
    }
    own = {name: value for name, value in given.items() if not name.startswith(START)}
    begun = {name.removeprefix(START): value for name, value in given.items() if name.startswith(START)}
    return (changed(system, own) if own else system), {**start, **begun}


def coordinates(system: System, axes: tuple[Axis, ...]) -> dict[str, tuple[str, NDArray[Any], str]]:
    """The coordinates of the map by name: dimension, values (numbers, or what is not one in words) and unit."""
    coordinates = {}
    for axis in axes:
        for name, column in zip(axis.names, zip(*axis.values, strict=True), strict=True):
            numbers = all(_is_number(value) for value in column)
            values = np.array(column, dtype=np.float64) if numbers else np.array([_worded(value) for value in column])
            coordinates[name] = (axis.dim, values, unit(system, name) if numbers else "")
    return coordinates


def unit(system: System, name: str) -> str:
    """The unit of a parameter, as far as it is known."""
    if name.startswith(START):
        return {"x": "m", "v": "m/s"}.get(name.removeprefix(START)[:1], "")
    known = unit_of(system, name)
    return "" if known == "1" else known


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _worded(value: Any) -> str:
    return value if isinstance(value, str) else repr(value)
