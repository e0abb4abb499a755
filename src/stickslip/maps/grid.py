"""The grid of a sweep: which parameters take which values, along which dimensions.

Points spread over ranges of parameters, and which parameter an answer depends on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import Estimate
from stickslip.parameters import changed, find
from stickslip.parameters import unit as unit_of
from stickslip.solve.tables import System

MOST = 10_000_000  # values along an axis; more fit no memory
START = "start."  # before the name of an entry of the start: "start.x", "start.mode"
Grid = Mapping[Any, Any] | Sequence[Mapping[str, Any]]

DESIGNS = ("sobol", "random")
KINDS = ("first", "total")  # the indices, in the order of _indices
RESAMPLES = 400  # of the bootstrap: a standard deviation from it is good to 4 %


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
    pairs = zip(axes, steps, strict=True)
    given = dict(pair for axis, step in pairs for pair in zip(axis.names, axis.values[step], strict=True))
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


def design(
    bounds: Mapping[str, tuple[float, float]], *, count: int, kind: str = "sobol", seed: int = 0
) -> list[dict[str, float]]:
    """Which points tell how an answer depends on several parameters?

    Parameters
    ----------
    bounds : mapping
        Lowest and highest value by parameter.
    count : int
        Of a Sobol design the number of base samples, a power of two: it has ``count * (k + 2)`` points for k
        parameters, as :func:`sensitivity` needs them. Of a random one the number of points.
    kind : {"sobol", "random"}
        Saltelli's extension of Sobol's sequence (Saltelli et al. 2010), or independent uniform numbers.
    seed : int
        The same seed, the same points.

    Returns
    -------
    list of dict
        A grid for :func:`sweep`.

    Raises
    ------
    ModelError
        A range has no width, the kind is unknown, or the count is none.

    Examples
    --------
    >>> points = design({"kinetic": (0.5, 1.5), "mass": (1.0, 2.0)}, count=8)
    >>> len(points), sorted(points[0])
    (32, ['kinetic', 'mass'])
    """
    names = list(bounds)
    ranges = np.array([tuple(bounds[name]) for name in names], dtype=np.float64).reshape(len(names), -1)
    if not names or ranges.shape[1] != 2 or not np.all(ranges[:, 0] < ranges[:, 1]) or not np.all(np.isfinite(ranges)):
        raise ModelError(
            f"bounds = {dict(bounds)}", "each parameter has a lowest and a higher finite value", "give both"
        )
    if kind not in DESIGNS:
        raise ModelError(f"no design is called '{kind}'", f"there are {', '.join(DESIGNS)}", "choose one of them")
    if not (isinstance(count, int | np.integer) and count >= 1):
        raise ModelError(f"count = {count}", "a design has one point at least", "raise count=")
    if kind == "random":
        rows = np.random.default_rng(seed).uniform(ranges[:, 0], ranges[:, 1], (count, len(names)))
    elif count & (count - 1):
        raise ModelError(f"count = {count}", "a Sobol design has a power of two base samples", "take 64, 128, 256 ...")
    else:
        rows = _saltelli(ranges, count=count, seed=seed)
    return [dict(zip(names, map(float, row), strict=True)) for row in rows]


def sensitivity(atlas: Any, *, variable: str, seed: int = 0) -> dict[str, dict[str, Estimate]]:
    """How much of an answer's variance is each parameter's?

    Sobol's indices: the share of the variance that a parameter has alone ("first") and with all others together
    ("total"), estimated as in Saltelli et al. 2010 (Computer Physics Communications 181, table 2, b and f), with
    intervals by a bootstrap over the base samples.

    Parameters
    ----------
    atlas : xarray.Dataset
        A sweep over the points of a Sobol :func:`design`.
    variable : str
        Which of its variables.
    seed : int
        Of the bootstrap that gives the intervals.

    Returns
    -------
    dict
        By parameter, the Estimates "first" and "total" with their 95 % intervals.

    Raises
    ------
    EstimateError
        The sweep was not over a Sobol design, the answer is not known at every point, or it is the same at all.

    Examples
    --------
    >>> from stickslip import scenarios, sweep
    >>> points = design({"kinetic": (0.1, 0.4), "mass": (0.9, 1.1)}, count=16)
    >>> atlas = sweep(scenarios.forced(0.6, 0.2), points, measures=["energy"], settle=40, cycles=4)
    >>> shares = sensitivity(atlas, variable="energy")
    >>> shares["kinetic"]["total"].value > shares["mass"]["total"].value
    True
    """
    names = [str(name) for name in atlas.coords]
    answers = np.asarray(atlas[variable].values, dtype=np.float64) if variable in atlas else np.zeros(0)
    if atlas.sizes.keys() != {"point"} or not len(answers) or not _is_sobol(atlas, names):
        raise EstimateError(
            f"{len(answers)} points of '{variable}' over {', '.join(names)}",
            "the indices need the points of a Sobol design",
            "sweep over design(...)",
        )
    if not np.all(np.isfinite(answers)) or np.ptp(answers) == 0:
        raise EstimateError(
            f"{variable} is not known at every point, or the same at all",
            "a share of a variance needs one",
            "narrow the bounds, or ask another",
        )
    rows = answers.reshape(-1, len(names) + 2)
    rng = np.random.default_rng(seed)
    again = [_indices(rows[rng.integers(len(rows), size=len(rows))]) for _ in range(RESAMPLES)]
    values, sds = _indices(rows), np.std(again, axis=0, ddof=1)
    return {
        name: {kind: _share(f"{kind} Sobol index of {name}", values[i, j], sds[i, j]) for i, kind in enumerate(KINDS)}
        for j, name in enumerate(names)
    }


def _saltelli(ranges: Array, *, count: int, seed: int) -> Array:
    """For each base sample a row of A, A but for each parameter in turn from B, and B's row."""
    from scipy.stats import qmc

    parameters = len(ranges)
    base = qmc.Sobol(2 * parameters, seed=seed).random(count)  # rng=seed is another stream: kept stores have this one
    a, b = base[:, None, :parameters], base[:, None, parameters:]
    swapped = np.where(np.eye(parameters, dtype=bool), b, a)
    unit = np.concatenate((a, swapped, b), axis=1).reshape(-1, parameters)
    return np.asarray(ranges[:, 0] + unit * (ranges[:, 1] - ranges[:, 0]), dtype=np.float64)


def _indices(rows: Array) -> Array:
    """First and total indices, a column for each parameter, of answers in a row for each base sample."""
    from scipy.stats import sobol_indices

    parts = {"f_A": rows[:, 0], "f_B": rows[:, -1], "f_AB": rows.T[1:-1, None]}
    shares = sobol_indices(func=parts, n=len(rows))
    return np.stack((np.ravel(shares.first_order), np.ravel(shares.total_order)))


def _is_sobol(atlas: Any, names: list[str]) -> bool:
    """Whether the points are Saltelli's: a row of A, A but for each parameter in turn from B, and B's row."""
    base, rest = divmod(atlas.sizes["point"], len(names) + 2)
    if rest or base < 2 or base & (base - 1):
        return False
    rows = np.column_stack([atlas[name].values for name in names]).reshape(base, len(names) + 2, len(names))
    ours = np.eye(len(names), dtype=bool)
    return bool(np.all(rows[:, 1:-1] == np.where(ours, rows[:, -1:], rows[:, :1])))


def _share(name: str, value: float, sd: float) -> Estimate:
    return Estimate.normal(name, value, sd=sd, unit="1", method="Saltelli's design, bootstrap")
