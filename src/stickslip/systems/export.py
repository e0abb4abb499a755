"""A system and its run written down again: as a TOML file, read back to the same numbers, as JSON, as Python."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from stickslip.errors import ModelError
from stickslip.laws.formula import Formula, quoted
from stickslip.parameters import PARTS
from stickslip.scenarios import DRIVES, LAWS
from stickslip.settings import nearest
from stickslip.structure import Structure
from stickslip.systems.file import Case

FORMATS = ("toml", "json", "python")


def export_system(case: Case, *, format: str = "toml") -> str:
    """How is a system, with its start and run, written for another day, a page or a colleague?

    * ``"toml"``: a file that :func:`read_system` reads back to the same numbers, to the last digit;
    * ``"json"``: the same tables, which :func:`read_system` takes too;
    * ``"python"``: a program that makes the system, runs it and prints what happened.

    Parameters
    ----------
    case : Case
        As :func:`read_system` or :func:`scenario_case` gives it.
    format : str
        One of the names above.

    Returns
    -------
    str

    Raises
    ------
    ModelError
        There is no such format, or the law holds a Python function, or is not one that a file may name.

    Examples
    --------
    >>> from stickslip.systems.file import scenario_case
    >>> print(export_system(scenario_case("FD-4")))
    about = "free decay with viscous and dry friction (Lorenz 1924, Watari, Feeny and Liang 1996)"
    <BLANKLINE>
    [system]
    mass = 1.0
    ...
    """
    if format not in FORMATS:
        raise ModelError(f"format = '{format}'", f"it is one of {', '.join(FORMATS)}", nearest(str(format), FORMATS))
    tables = _tables(case)
    if format == "json":
        return json.dumps(tables, ensure_ascii=False, allow_nan=False)
    return "\n".join(_toml(tables) if format == "toml" else _python(case, tables)) + "\n"


def _tables(case: Case) -> dict[str, Any]:
    """The tables of a system's file."""
    system = case.system
    tables: dict[str, Any] = {"about": case.about, "system": _values(system)}
    if isinstance(system, Structure):
        tables["contacts"] = [{**_values(contact), "law": _part(contact.law, LAWS)} for contact in system.contacts]
    else:
        tables["law"] = _part(system.law, LAWS)
    tables["drive"] = _part(system.drive, DRIVES)
    run = case.run if case.fs is None else {**case.run, "fs": case.fs}
    for name, values in (("start", case.start), ("run", run)):
        tables[name] = {key: value if isinstance(value, str) else float(value) for key, value in values.items()}
    return tables


def _part(part: Any, known: Mapping[str, Any]) -> dict[str, Any]:
    """A law or a drive, with its name."""
    name = type(part).__name__
    if name not in known:
        raise ModelError(f"a {name}", f"a system's file names one of {', '.join(known)}", "run it from Python")
    return {"name": name, **_values(part), **{
        inner: _part(getattr(part, inner), register)
        for inner, register in (("law", LAWS), ("drive", DRIVES)) if is_dataclass(getattr(part, inner, None))
    }}  # fmt: skip


def _values(part: Any) -> dict[str, Any]:
    """What a part holds itself, as plain data."""
    own = {field.name: getattr(part, field.name) for field in fields(part) if field.name not in PARTS}
    return {name: _plain(value) for name, value in own.items() if value is not None}


def _plain(value: Any) -> Any:
    if isinstance(value, Formula):
        return value.text
    if callable(value):
        raise ModelError("a law that holds a Python function", "a file holds text", "write the curve as a Formula")
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _toml(tables: Mapping[str, Any]) -> Iterator[str]:
    if tables["about"]:
        yield f"about = {_toml_value(tables['about'])}"
    for name, table in tables.items():
        for table_row in table if isinstance(table, list) else [table]:
            if name != "about" and table_row:
                yield ""
                yield f"[[{name}]]" if isinstance(table, list) else f"[{name}]"
                yield from (f"{key} = {_toml_value(value)}" for key, value in table_row.items())


def _toml_value(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {_toml_value(item)}' for key, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_toml_value, value))}]"
    return quoted(value) if isinstance(value, str) else json.dumps(value)


def _python(case: Case, tables: Mapping[str, Any]) -> Iterator[str]:
    yield "import stickslip as ss"
    yield ""
    if _has_formula(tables.get("law", {})):  # a formula is text
        yield f"case = ss.systems.read_system({tables!r})"
    else:
        yield from _system(tables)
        known = f"{case.name!r}, {case.about!r}, system, start={tables['start']!r}, run={tables['run']!r}"
        yield f"case = ss.systems.Case({known})"
    yield "result = ss.story.outcome(case)"
    yield "print(*result.sentences, sep='\\n')"
    yield "for name, value in result.rows:"
    yield "    print(f'{name}: {value}')"


def _has_formula(law: Mapping[str, Any]) -> bool:
    return "curve" in law or ("law" in law and _has_formula(law["law"]))


def _system(tables: Mapping[str, Any]) -> Iterator[str]:
    """The system from its parts, each on a line of its own."""
    yield f"drive = {_call(tables['drive'])}"
    if "contacts" in tables:
        yield "contacts = ["
        for contact in tables["contacts"]:
            yield f"    ss.Contact({_call(contact['law'])}, {_arguments(contact, without=('law',))}),"
        yield "]"
        yield f"system = ss.Structure({_arguments(tables['system'])}, contacts=contacts, drive=drive)"
    else:
        yield f"law = {_call(tables['law'])}"
        yield f"system = ss.Oscillator({_arguments(tables['system'])}, law=law, drive=drive)"


def _call(part: Mapping[str, Any]) -> str:
    room = "laws" if part["name"] in LAWS else "drives"
    return f"ss.{room}.{part['name']}({_arguments(part, without=('name',))})"


def _arguments(values: Mapping[str, Any], without: tuple[str, ...] = ()) -> str:
    return ", ".join(
        f"{name}={_call(value) if isinstance(value, Mapping) else repr(value)}"
        for name, value in values.items()
        if name not in without
    )
