"""A sweep written down: system, grid, measures and lengths of run, in a TOML file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from stickslip.errors import ModelError, RecordError
from stickslip.maps.grid import MOST, unit
from stickslip.settings import STRICT, checked, line_of, read_toml
from stickslip.solve.tables import System
from stickslip.systems.file import Case, read_system, scenario_case
from stickslip.units import parse_value


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
    columns = [
        _values(system, part, list(own), source, lines)
        for part, own in zip(names, zip(*rows, strict=True), strict=True)
    ]
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
