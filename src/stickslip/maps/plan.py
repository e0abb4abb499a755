"""What a sweep is to do, with everything that decides its answer, cut into blocks; and the labelled map it ends as.

A sweep written down: system, grid, measures and lengths of run, in a TOML file.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from stickslip import __version__
from stickslip.errors import ModelError, RecordError, package
from stickslip.maps.grid import MOST, Axis, coordinates, placed, unit
from stickslip.maps.measures import Measure, Variable, own_name, variables
from stickslip.parameters import PARTS
from stickslip.settings import STRICT, checked, line_of, read_toml
from stickslip.solve.tables import System
from stickslip.systems.file import Case, read_system, scenario_case
from stickslip.units import parse_value

BLOCK = 4096  # points at most that are run together
LEAST = 16  # blocks, where there are points enough: so that several workers share the work and progress is seen
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Plan:
    """A sweep before it is run; everything that decides the answer, and nothing else.

    Attributes
    ----------
    system : Oscillator or Structure
        What moves.
    axes : tuple of Axis
        What changes.
    measures : tuple of str or callable
        What is asked of each motion.
    cycles, settle : int
        Periods of the drive that are measured, and those before that are not.
    start : mapping
        State at time 0, as :func:`simulate` takes it.
    chunks : tuple of int
        Points of a block along each axis.
    """

    system: System
    axes: tuple[Axis, ...]
    measures: tuple[Measure, ...]
    cycles: int
    settle: int
    start: Mapping[str, float | str] = field(default_factory=dict)
    chunks: tuple[int, ...] = ()

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions."""
        return tuple(axis.dim for axis in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each dimension."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def size(self) -> int:
        """Points of the grid."""
        return math.prod(self.shape)

    @property
    def tiles(self) -> tuple[int, ...]:
        """Blocks along each dimension."""
        return tuple(-(-count // chunk) for count, chunk in zip(self.shape, self.chunks, strict=True))

    @property
    def blocks(self) -> range:
        """Numbers of the blocks."""
        return range(math.prod(self.tiles))

    def slices(self, number: int) -> tuple[slice, ...]:
        """Where a block lies in the grid."""
        tile = np.unravel_index(number, self.tiles)
        spans = zip(tile, self.chunks, self.shape, strict=True)
        return tuple(slice(int(t) * chunk, min((int(t) + 1) * chunk, count)) for t, chunk, count in spans)

    def points(self, number: int) -> list[tuple[int, ...]]:
        """The steps along each axis of every point of a block, in its own order."""
        return list(itertools.product(*(range(part.start, part.stop) for part in self.slices(number))))

    def at(self, steps: Sequence[int]) -> tuple[System, dict[str, float | str]]:
        """System and start at one point."""
        return placed(self.system, self.start, self.axes, steps)

    @property
    def variables(self) -> dict[str, Variable]:
        """What the answer holds of each point."""
        return variables(self.measures)

    @property
    def coordinates(self) -> dict[str, tuple[str, NDArray[Any], str]]:
        """Coordinates of the answer: dimension, values, unit."""
        return coordinates(self.system, self.axes)

    @cached_property
    def attributes(self) -> dict[str, Any]:
        """The settings, in plain data."""
        return {
            "system": repr(self.system),
            "start": json.dumps(dict(self.start), default=repr, sort_keys=True),
            "measures": [_named(measure) for measure in self.measures],
            "cycles": self.cycles,
            "settle": self.settle,
            "version": __version__,
        }

    @cached_property
    def checksum(self) -> str:
        """A sha256 of everything that decides the answer."""
        text = [self.attributes, self.chunks, [(axis.dim, axis.names) for axis in self.axes]]
        digest = hashlib.sha256(json.dumps(text, sort_keys=True).encode())
        for value in (self.system, *(axis.values for axis in self.axes), *(_source(m) for m in self.measures)):
            digest.update(_content(value).encode())
        return digest.hexdigest()


def chunked(shape: Sequence[int]) -> tuple[int, ...]:
    """Points of a block along each axis: much the same along each, `BLOCK` points at most, some `LEAST` blocks.

    The motions of a square block share more of their laws and drives than those of a row.
    """
    room = max(1, min(BLOCK, math.prod(shape) // LEAST))
    chunks = [0] * len(shape)
    for left, axis in zip(range(len(shape), 0, -1), np.argsort(shape, kind="stable"), strict=True):
        chunks[axis] = min(shape[axis], max(1, round(room ** (1 / left))))
        room = max(1, room // chunks[axis])
    return tuple(chunks)


def blank(plan: Plan) -> Arrays:
    """The arrays of the answer before anything is known."""
    return {name: np.full(plan.shape, variable.fill, variable.dtype) for name, variable in plan.variables.items()}


def assemble(plan: Plan, arrays: Mapping[str, NDArray[Any]], *, status: str = "complete") -> Any:
    """The labelled map: an xarray.Dataset with the settings, the version and the checksum in its attributes."""
    xarray = required("xarray")
    data = {
        name: (plan.dims, arrays[name], {"units": variable.unit, "long_name": variable.words, **variable.attributes})
        for name, variable in plan.variables.items()
        if name in arrays
    }
    known = {
        name: (dim, values, {"units": unit} if unit else {}) for name, (dim, values, unit) in plan.coordinates.items()
    }
    attributes = {**plan.attributes, "checksum": plan.checksum, "status": status}
    return xarray.Dataset(data, coords=known, attrs=attributes)


def required(module: str) -> Any:
    """A package of the extra `maps`."""
    return package(module, extra="maps", rule="maps are made with the extra 'maps'")


def _named(measure: Measure) -> str:
    return measure if isinstance(measure, str) else str(getattr(measure, "__qualname__", own_name(measure)))


def _source(value: Any, above: tuple[FunctionType, ...] = ()) -> Any:
    """What decides a user's function: its code, its defaults, and what it holds or asks by name of its own module."""
    if isinstance(value, partial):
        return "partial", _source(value.func, above), value.args, value.keywords
    if not isinstance(value, FunctionType):
        own = callable(value) and not isinstance(value, type | ModuleType | BuiltinFunctionType)
        if own and isinstance(call := type(value).__call__, FunctionType):
            return type(value).__qualname__, _source(call, above), getattr(value, "__dict__", repr(value))
        return getattr(value, "__name__", value)
    if value in above or (above and value.__module__ != above[0].__module__):
        return value.__module__, value.__qualname__
    code = value.__code__
    known = {name: value.__globals__[name] for name in _asked(code) if name in value.__globals__}
    known |= {name: cell.cell_contents for name, cell in zip(code.co_freevars, value.__closure__ or (), strict=True)}
    rows = [(name, _source(known[name], (*above, value))) for name in sorted(known)]
    return value.__qualname__, _bytecode(code), value.__defaults__, value.__kwdefaults__, rows


def _asked(code: CodeType) -> set[str]:
    """Names that a function asks for, also within it."""
    return {*code.co_names}.union(*(_asked(inner) for inner in code.co_consts if isinstance(inner, CodeType)))


def _bytecode(code: CodeType) -> tuple[Any, ...]:
    own = (_bytecode(c) if isinstance(c, CodeType) else c for c in code.co_consts)
    return (code.co_code.hex(), *code.co_names, *own)


def _content(value: Any) -> str:
    """A text in which two values that differ in a bit differ."""
    if isinstance(value, np.ndarray):
        return f"array{value.shape}{value.dtype}{hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
    if isinstance(value, float | np.floating):
        return float(value).hex()
    if isinstance(value, tuple | list):
        return f"({','.join(_content(item) for item in value)})"
    if isinstance(value, set | frozenset):
        return f"{{{','.join(sorted(map(_content, value)))}}}"  # in whatever order this process has them
    if isinstance(value, Mapping):
        return f"{{{','.join(f'{key}:{_content(item)}' for key, item in value.items())}}}"
    if hasattr(value, "__dataclass_fields__"):
        own = {name: getattr(value, name) for name in value.__dataclass_fields__}
        return f"{type(value).__qualname__}{_content(own)}"
    return repr(value)


Keep = Callable[[int, Arrays, "Arrays | None"], None]


class _File(BaseModel):
    model_config = STRICT
    system: str
    grid: dict[str, Any]
    measures: list[str] = ["stops", "amplitude"]
    cycles: int = Field(50, ge=1)
    settle: int = Field(200, ge=0)


class _Range(BaseModel):
    model_config = STRICT
    begin: float | str = Field(alias="from")
    end: float | str = Field(alias="to")
    points: int = Field(ge=1, le=MOST)
    scale: str = Field("linear", pattern="^(linear|log)$")


@dataclass(frozen=True)
class SweepFile:
    """What a file of a sweep says.

    Attributes
    ----------
    case : Case
        The system, with its start.
    grid : dict
        Values by parameter.
    measures : tuple of str
        What is asked of each motion.
    cycles, settle : int
        Periods that are measured, and those before.
    """

    case: Case
    grid: dict[str, Any]
    measures: tuple[str, ...]
    cycles: int
    settle: int


def read_sweep(path: str | Path) -> SweepFile:
    """Read a sweep from a TOML file.

    Parameters
    ----------
    path : path
        A file such as::

            system = "slider.toml"        # a file of a system beside this one, or the name of a scenario
            measures = ["stops", "amplitude"]
            cycles = 50                   # periods that are measured
            settle = 200                  # periods before those
            [grid]
            frequency = { from = "2 Hz", to = "9 Hz", points = 200 }   # scale = "log" where wanted
            kinetic = [0.9, "1.1 N", 1.3] # a bare number is SI
            "mass, stiffness" = [[1, 4], ["2 kg", 8]]              # they change together: one axis
            # law = [{ name = "Coulomb", kinetic = 1 }, ...]       # whole laws, instead of kinetic

    Returns
    -------
    SweepFile

    Raises
    ------
    ModelError
        The file can not be read, is not TOML, has a key that is not known or a value without meaning.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "grid.toml"
    >>> _ = path.write_text("system = 'DH-1 b=0.6'\\n[grid]\\nkinetic = {from = 0.1, to = 0.5, points = 5}")
    >>> read_sweep(path).grid["kinetic"].round(3)
    array([0.1, 0.2, 0.3, 0.4, 0.5])
    """
    path = Path(path)
    values, lines = read_toml(path, what="a sweep is")
    for key in (key for key in values if key in (*PARTS, "start", "run")):
        raise ModelError(
            f"{path.name}{line_of([key], lines)} has the key '{key}'",
            "a system's parts stand in the file that system = names",
            f'move it there, as system = "slider.toml"{", or vary laws as law = [...] under [grid]" * (key == "law")}',
        )
    whole = checked(_File, values, source=path.name, lines=lines)
    beside = path.parent / whole.system
    case = read_system(beside) if whole.system.endswith(".toml") else scenario_case(whole.system)
    if not whole.grid:
        raise ModelError(
            f"{path.name}{line_of(['grid'], lines)} has an empty grid",
            "a sweep changes one parameter at least",
            "add one, as kinetic = [1.0, 1.1]",
        )
    grid = dict(_axis(case.system, name, column, path.name, lines) for name, column in whole.grid.items())
    return SweepFile(case, grid, tuple(whole.measures), whole.cycles, whole.settle)


def _axis(system: System, name: str, column: Any, source: str, lines: list[str]) -> tuple[Any, Any]:
    """What an axis is called in a grid, and its values: of one parameter, or of several that change together."""
    names = tuple(part.strip() for part in name.split(","))
    if len(names) == 1:
        return name, _values(system, name, column, source, lines)
    rows = column if isinstance(column, list) else []
    if not rows or any(not isinstance(row, list) or len(row) != len(names) for row in rows):
        raise ModelError(
            f"{source}{line_of(['grid', name], lines)} sets {name} = {column!r}",
            f"{len(names)} parameters that change together have as many values at each step",
            "write a list of lists",
        )
    pairs = zip(names, zip(*rows, strict=True), strict=True)
    columns = [_values(system, part, list(own), source, lines) for part, own in pairs]
    return names, list(zip(*columns, strict=True))


def _values(system: System, name: str, column: Any, source: str, lines: list[str]) -> Any:
    """The values along one axis, in SI."""
    own = unit(system, name)
    place = f"{source}{line_of(['grid', name], lines)}"

    def number(value: Any) -> Any:
        if name == "law" and isinstance(value, dict):
            return read_system({"system": {"mass": 1.0, "stiffness": 1.0}, "law": value}).system.law  # type: ignore[union-attr]
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ModelError(f"{place} sets {name} = {value!r}", "an axis has numbers or words", "correct it")
        try:
            return parse_value(value, own) if own else value
        except RecordError as error:
            raise ModelError(
                f"{place} sets {name} = {value!r}", f"{error.value}; {error.rule}", "correct it"
            ) from error

    if isinstance(column, dict) and name != "law":
        part = checked(_Range, column, source=source, lines=lines, table=f"grid.{name}")
        begin, end = number(part.begin), number(part.end)
        if part.scale == "log" and not (begin > 0 and end > 0):
            raise ModelError(f"{place} runs from {begin} to {end}", "a logarithmic axis is positive", "correct it")
        return (np.geomspace if part.scale == "log" else np.linspace)(begin, end, part.points)
    if not isinstance(column, list):
        raise ModelError(f"{place} sets {name} = {column!r}", "an axis is a list, or { from, to, points }", "write one")
    return [number(value) for value in column]
