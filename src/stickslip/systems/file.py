"""A system and its run written down and read back to the same numbers: TOML, JSON, Python, or a named scenario."""

from __future__ import annotations

import dataclasses
import functools
import typing
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, BeforeValidator, Field, create_model

from stickslip import scenarios
from stickslip.drives.kinds import Drive
from stickslip.errors import ModelError
from stickslip.files.read import read_record
from stickslip.laws.base import Law
from stickslip.laws.curved import CurvedLaw
from stickslip.laws.formula import Formula
from stickslip.laws.stribeck import Curve, SpeedCurve
from stickslip.oscillator import Contact, Oscillator, Structure
from stickslip.parameters import PARTS, changed, declared, find, places, unit
from stickslip.scenarios import DRIVES, LAWS
from stickslip.settings import STRICT, checked, line_of, nearest, quantity, read_toml
from stickslip.solve.tables import System, numbered
from stickslip.units import parse_constant

CYCLES = 20.0  # of a run where nothing is said
MOST_CYCLES = 1e9  # more would not end, nor be counted


@dataclasses.dataclass(frozen=True)
class Case:
    """A system with what is needed to run it.

    Attributes
    ----------
    name, about : str
        What it is called, and what it is.
    system : Oscillator or Structure
        What moves.
    start : mapping
        State at time 0, as :func:`simulate` takes it.
    run : mapping
        ``duration=`` or ``cycles=``.
    fs : float or None
        Sampling rate of the record [Hz]; None: fine enough for the system.
    known : mapping
        Answers known beforehand, of a scenario.
    """

    name: str
    about: str
    system: System
    start: Mapping[str, float | str]
    run: Mapping[str, float]
    fs: float | None = None
    known: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Time that is run [s]."""
        period = self.system.drive.motion().period
        cycle = period if np.isfinite(period) else 1 / self.system.frequency if self.system.frequency else np.nan
        return self.run["duration"] if "duration" in self.run else self.run["cycles"] * cycle

    @property
    def parts(self) -> str:
        """What it is made of, in a few words: its laws and its drive."""
        laws = [c.law for c in self.system.contacts] if isinstance(self.system, Structure) else [self.system.law]
        counts = Counter(type(law).__name__ for law in laws)
        counted = [f"{count} x {name}" if count > 1 else name for name, count in counts.items()]
        return f"{' and '.join(counted)}, {type(self.system.drive).__name__}"

    def having(self, **changes: Any) -> Case:
        """The same case with other values of its system, as text with units or SI numbers; nothing is known of it then.

        Parameters
        ----------
        **changes
            New values by name, as in :meth:`Oscillator.having`: "kinetic", or with its place "contacts.2.law.kinetic".

        Returns
        -------
        Case
        """
        if not changes:
            return self
        known = places(self.system)
        values: dict[str, Any] = {}
        for name, value in changes.items():
            path = find(self.system, name)[0]
            kind = _kind(type(known[path]), path[-1])
            if path[-1] in PARTS or kind in (ArrayLike, ArrayLike | None):
                others = [".".join(other) for other in known if other[-1] == path[-1] and other != path]
                step = f"or name {', '.join(others)}" if others and path[-1] not in PARTS else "there"
                raise ModelError(f"'{name}' is no single number", "a part or a matrix is changed in the file", step)
            models = create_model("Changes", __config__=STRICT, **{"value": (kind, ...)})  # type: ignore[call-overload]
            values[name] = _checked_change(models, name, value)
        return dataclasses.replace(self, system=changed(self.system, values), known={})

    def number(self, parameter: str, text: str | float) -> float:
        """A value of one of the system's parameters in SI; text may have its unit.

        Parameters
        ----------
        parameter : str
            As in :meth:`having`.
        text : str or float
            "0.7 mm", or a number in SI.

        Returns
        -------
        float

        Raises
        ------
        ModelError
            No such parameter, or a value without meaning.
        """
        return float(parse_constant(parameter, text, unit(self.system, parameter)))

    def lasting(
        self, *, duration: str | float | None = None, cycles: float | None = None, fs: str | float | None = None
    ) -> Case:
        """The same case, run for another time or sampled at another rate; text may have its unit.

        Parameters
        ----------
        duration : str or float, optional
            Time [s].
        cycles : float, optional
            Time in periods; this or `duration`.
        fs : str or float, optional
            Sampling rate [Hz].

        Returns
        -------
        Case
        """
        given = {"duration": duration, "cycles": cycles, "fs": fs}
        values = checked(_Run, {name: value for name, value in given.items() if value is not None}, source="the run")
        run = {name: value for name, value in (("duration", values.duration), ("cycles", values.cycles)) if value}
        case = dataclasses.replace(self, run=run or self.run, fs=values.fs or self.fs)
        _check_run(case)
        return case


Kilograms = Annotated[float, quantity("kg")]
Stiffness = Annotated[float, quantity("N/m")]
Damping = Annotated[float, quantity("N s/m")]


class _Oscillator(BaseModel):
    model_config = STRICT

    mass: Annotated[Kilograms, Field(gt=0)]
    stiffness: Annotated[Stiffness, Field(ge=0)]
    damping: Damping = 0.0
    damper: Literal["ground", "base"] = "ground"


class _Structure(BaseModel):
    model_config = STRICT

    mass: list[list[Kilograms]]
    stiffness: list[list[Stiffness]]
    damping: list[list[Damping]] | None = None
    acts_on: list[float] | None = None
    damper: Literal["ground", "base"] = "ground"
    rotations: list[int] = []


class _Contact(BaseModel):
    model_config = STRICT

    tangent: list[float]
    law: dict[str, Any]
    normal: list[float] | None = None
    stiffness: Stiffness | None = None
    preload: Annotated[float, quantity("N")] | None = None
    power: float | None = None
    carried: float | None = None


class _Run(BaseModel):
    model_config = STRICT

    duration: Annotated[float, quantity("s"), Field(gt=0)] | None = None
    cycles: Annotated[float, Field(gt=0, le=MOST_CYCLES)] | None = None
    fs: Annotated[float, quantity("Hz"), Field(gt=0)] | None = None


class _File(BaseModel):
    model_config = STRICT

    about: str = ""
    system: dict[str, Any]
    law: dict[str, Any] | None = None
    contacts: list[dict[str, Any]] | None = None
    drive: dict[str, Any] = Field(default_factory=lambda: {"name": "Release"})
    start: dict[str, Any] = Field(default_factory=dict)
    run: dict[str, Any] = Field(default_factory=dict)


class _Source(NamedTuple):
    """Where values come from: the file's name, lines and folder."""

    name: str
    lines: Sequence[str]
    folder: Path | None


def scenario_case(name: str) -> Case:
    """A named scenario, ready to run.

    Parameters
    ----------
    name : str
        One of ``scenarios.names()``.

    Returns
    -------
    Case

    Raises
    ------
    ModelError
        No scenario has that name.

    Examples
    --------
    >>> scenario_case("FD-4").run
    {'duration': 126.0}
    """
    if name not in scenarios.names():
        alike = nearest(name.upper(), scenarios.names())
        raise ModelError(
            f"no scenario is called '{name}'",
            "a file of a system ends in .toml",
            alike if alike.startswith("perhaps") else "'stickslip simulate --list' names the scenarios",
        )
    scenario = scenarios.get(name)
    return Case(
        name, scenario.about, scenario.system, scenario.start, scenario.run or {"cycles": CYCLES}, None, scenario.known
    )


def read_system(path: str | Path | Mapping[str, Any]) -> Case:
    """Read a system and its run from a TOML file, or from its tables as plain data.

    Parameters
    ----------
    path : path or mapping
        The tables, as from JSON, or a file such as::

            [system]
            mass = "2.42 kg"              # a bare number is SI
            stiffness = "2.31 N/mm"
            [law]
            name = "CompliantContact"     # any of scenarios.LAWS, with its parameters
            kinetic = 1.1
            stiffness = 192000
            damping = 23.9
            [drive]
            name = "HarmonicBase"         # any of scenarios.DRIVES
            amplitude = "0.65 mm"
            frequency = 2.5
            [start]                       # at rest at 0 where left out
            x = "0.1 mm"
            [run]
            cycles = 40                   # or duration, in seconds
            fs = 4000                     # of the record; chosen where left out

        A drive ``Recorded`` takes its samples from ``record = "file.csv"`` and ``channel = "column [mm]"``; in
        plain data they stand themselves.

    Returns
    -------
    Case

    Raises
    ------
    ModelError
        The file can not be read, is not TOML, has a key that is not known or a value without meaning.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "slider.toml"
    >>> _ = path.write_text("system = {mass = 1, stiffness = '4 N/m'}\\nlaw = {name = 'Coulomb', kinetic = 1}")
    >>> read_system(path).system.law
    Coulomb(kinetic=1.0, static=None)
    """
    if isinstance(path, Mapping):
        return _case("system", dict(path), _Source("the system", (), None))
    path = Path(path)
    values, lines = read_toml(path, what="a system is")
    return _case(path.stem, values, _Source(path.name, lines, path.parent))


def _case(name: str, values: dict[str, Any], source: _Source) -> Case:
    """The system of a file's tables."""
    if "law" in values and "system" not in values:
        raise ModelError(
            f"{source.name} holds a law alone",
            "a law is simulated in a system",
            "add [system] with mass = and stiffness =, and a [drive]; a fit that is told the mass writes them itself",
        )
    values = {key: value for key, value in values.items() if key != "joint"}  # a prediction's, beside a joint's law
    whole = checked(_File, values, source=source.name, lines=source.lines)
    drive = _built("drive", DRIVES, whole.drive, source)
    several = whole.contacts is not None or isinstance(whole.system.get("mass"), list)
    system = _structure(whole, drive, source) if several else _oscillator(whole, drive, source)
    start = _part(_start_of(system), "start", whole.start, source)
    run = _part(_Run, "run", whole.run, source)
    fs = run.pop("fs", None)
    case = Case(name, whole.about, system, start, run or _whole_run(system), fs)
    with _placed("run", source):
        _check_run(case)
    return case


def _oscillator(whole: _File, drive: Any, source: _Source) -> Oscillator:
    if whole.law is None:
        raise ModelError(
            f"{source.name} has no law",
            "a mass rubs under one, a structure under one at each contact",
            "add a table [law], or tables [[contacts]]",
        )
    values = _part(_Oscillator, "system", whole.system, source)
    law = _built("law", LAWS, whole.law, source)
    with _placed("system", source):
        return Oscillator(**values, law=law, drive=drive)


def _structure(whole: _File, drive: Any, source: _Source) -> Structure:
    if whole.law is not None:
        where = f"{source.name}{line_of(['law'], source.lines)}"
        raise ModelError(
            f"{where} has a law beside a structure's matrices",
            "each contact of a structure has its own",
            "write it into [[contacts]], as law = {name = ...}",
        )
    values = _part(_Structure, "system", whole.system, source)
    contacts = []
    for number, entry in enumerate(whole.contacts or [], start=1):
        table = f"contacts.{number}"
        given = _part(_Contact, table, entry, source)
        given["law"] = _built(f"{table}.law", LAWS, given["law"], source)
        with _placed(table, source):
            contacts.append(Contact(**given))
    damping = values.pop("damping", [[0.0] * len(values["mass"])] * len(values["mass"]))
    with _placed("system", source):
        return Structure(**values, damping=damping, contacts=contacts, drive=drive)


def _whole_run(system: System) -> dict[str, float]:
    """What is run where nothing is said: the whole recorded motion, else some cycles."""
    end = system.drive.motion().end
    return {"duration": end} if np.isfinite(end) else {"cycles": CYCLES}


def _check_run(case: Case) -> None:
    if len(case.run) > 1:
        raise ModelError("duration and cycles are given", "a run has one of the two", "leave one out")
    if not np.isfinite(case.duration):
        raise ModelError(
            "a system without spring or periodic drive has no cycles", "it is run for a time", "give a duration"
        )
    end = case.system.drive.motion().end
    if case.duration > end * (1 + 1e-9):
        raise ModelError(
            f"duration = {case.duration:g} s", f"the recorded drive ends at {end:g} s", "run it no longer"
        ).of("duration")


def _part(model: type[BaseModel], table: str, values: Mapping[str, Any], source: _Source) -> dict[str, Any]:
    part = checked(model, values, source=source.name, lines=source.lines, table=table)
    given = {name: getattr(part, name) for name in values}
    return {name: value for name, value in given.items() if value is not None}


def _checked_change(model: type[BaseModel], name: str, value: Any) -> Any:
    """One value, as a file would give it; a refusal calls it by its name."""
    try:
        return checked(model, {"value": value}, source="the change").value  # type: ignore[attr-defined]
    except ModelError as error:
        texts = (text.replace(" value", f" {name}", 1) for text in (error.value, error.rule, error.next_step))
        raise ModelError(*texts) from error


def _built(table: str, register: Mapping[str, Callable[..., Any]], values: Mapping[str, Any], source: _Source) -> Any:
    """The law or drive named in a table, with its parameters."""
    name = values.get("name")
    if not isinstance(name, str) or name not in register:
        where = f"{source.name}{line_of([*table.split('.'), 'name'], source.lines)}"
        sentence = f"sets {table}.name = {name!r}" if "name" in values else f"has no {table}.name"
        next_step = nearest(str(name), register) if "name" in values else "add name = NAME"
        raise ModelError(
            f"{where} {sentence}", f"a {table.rpartition('.')[2]} is one of {', '.join(register)}", next_step
        )
    factory = register[name]
    parameters = {key: value for key, value in values.items() if key != "name"}
    for part, known in (("law", LAWS), ("drive", DRIVES)):  # a law on a law, a tone on a drive
        if isinstance(parameters.get(part), Mapping):
            parameters[part] = _built(f"{table}.{part}", known, parameters[part], source)
    if name == "Recorded" and "record" in parameters:
        parameters |= _recorded(parameters, source)
        parameters = {key: value for key, value in parameters.items() if key not in ("record", "channel")}
    given = _part(_model_of(factory, str(values.get("on", ""))), table, parameters, source)
    with _placed(table, source):
        return factory(**given)


def _recorded(parameters: Mapping[str, Any], source: _Source) -> dict[str, Any]:
    """Samples and rate of the motion or force that stands in a file of its own."""
    path, channel = parameters["record"], parameters.get("channel")
    of = "force" if parameters.get("on") == "force" else "z"
    if source.folder is None:
        raise ModelError(f"record = {path!r}", "plain data hold the samples themselves", "give samples = and fs =")
    if not isinstance(path, str) or not isinstance(channel, str):
        where = f"{source.name}{line_of(['drive', 'record'], source.lines)}"
        raise ModelError(
            f"{where} names a record = {path!r}, channel = {channel!r}",
            "a recorded motion or force is a file and its column",
            'write record = "base.csv" and channel = "column [mm]"',
        )
    record = read_record(source.folder / path, channels={of: channel})
    return {"samples": record[of].tolist(), "fs": parameters.get("fs", record.fs)}


@contextmanager
def _placed(table: str, source: _Source) -> Iterator[None]:
    """What a law, a drive or the oscillator refuses, with the line it stands on."""
    try:
        yield
    except ModelError as error:
        where = line_of([*table.split("."), *filter(None, [error.parameter])], source.lines)
        raise ModelError(f"{source.name}{where} [{table}]: {error.value}", error.rule, error.next_step) from error


@functools.cache
def _model_of(factory: type, on: str) -> type[BaseModel]:
    """The parameters of a law or drive as a model: its fields, with their units."""
    known: dict[str, Any] = {}
    for field in dataclasses.fields(factory):
        default = ... if field.default is dataclasses.MISSING else field.default
        known[field.name] = (_kind(factory, field.name, on), default)
    return create_model(factory.__name__, __config__=STRICT, **known)


def _kind(factory: type, name: str, on: str = "") -> Any:
    """The type of a parameter, as a file may give it."""
    hint = typing.get_type_hints(factory)[name]
    if name == "tones":
        amplitude = Annotated[float, quantity("N" if on == "force" else "m")]
        return list[tuple[amplitude, Annotated[float, quantity("Hz")], Annotated[float, quantity("rad")]]]
    if hint == Curve:
        return Annotated[Any, BeforeValidator(_formula)]
    if hint in (Law, SpeedCurve):
        return Annotated[Any, BeforeValidator(functools.partial(_table_of, "law", "{name = 'Coulomb', kinetic = 1}"))]
    if hint is Drive:
        return Annotated[Any, BeforeValidator(functools.partial(_table_of, "drive", "{name = 'Belt', speed = 0.1}"))]
    unit = declared(factory, name).unit or "1"
    number = Annotated[float, quantity("N" if on == "force" and unit == "m" else unit)]
    if name == "samples" or hint in (Sequence[float], Sequence[float] | None):
        return list[number] if hint != Sequence[float] | None else list[number] | None
    return {float: number, float | None: number | None}.get(hint, hint)


def _formula(value: object) -> Formula:
    if not isinstance(value, str):
        raise ValueError("a curve is text, as in '1.0 + 0.5 * exp(-v / 0.1)', with the speed v in m/s")
    try:
        return Formula(value)
    except ModelError as error:
        raise ValueError(str(error).rstrip(".")) from error


def _table_of(part: str, example: str, value: object) -> object:
    if isinstance(value, str | int | float | list):
        raise ValueError(f"a {part} within a {part} is a table, as in {part} = {example}")
    return value


def _start_of(system: System) -> type[BaseModel]:
    """The state that a start may set: displacements, velocities, the laws' memory, and the mode."""
    names = {name: unit for letter, unit in (("x", "m"), ("v", "m/s")) for name in numbered(letter, _size(system))}
    laws = [contact.law for contact in system.contacts] if isinstance(system, Structure) else [system.law]
    for number, law in enumerate(laws, start=1):
        for name in law.memory:
            unit = "m" if name in law.places else getattr(law, "memory_units", {}).get(name, "1")
            names[f"{name}{number}" if len(laws) > 1 else name] = unit
    known: dict[str, Any] = {name: (Annotated[float, quantity(unit)] | None, None) for name, unit in names.items()}
    known["mode"] = (str | None if isinstance(system, Structure) else Literal[_modes(system)] | None, None)
    return create_model("Start", __config__=STRICT, **known)


def _size(system: System) -> int:
    return system.size if isinstance(system, Structure) else 1


def _modes(system: Oscillator) -> tuple[str, ...]:
    law = system.law
    return tuple(mode.name for mode in (law.rates() if isinstance(law, CurvedLaw) else law.modes()))
