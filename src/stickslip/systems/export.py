"""A system and its run written for another day, a page or a colleague: TOML, JSON or Python."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from stickslip.errors import ModelError
from stickslip.laws.export import plain
from stickslip.laws.formula import Formula
from stickslip.oscillator import Structure
from stickslip.parameters import PARTS
from stickslip.scenarios import DRIVES, LAWS
from stickslip.settings import nearest, toml_lines
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
    tables = {name: table for name, table in _tables(case).items() if table or format != "toml"}
    if format == "json":
        return json.dumps(tables, ensure_ascii=False, allow_nan=False)
    return "\n".join(toml_lines(tables) if format == "toml" else _python(case, tables)) + "\n"


def _tables(case: Case) -> dict[str, Any]:
    """The tables of a system's file."""
    system = case.system
    tables: dict[str, Any] = {"about": case.about, "system": _values(system)}
    if isinstance(system, Structure):
        tables["contacts"] = [{**_values(contact), "law": _part_text(contact.law)} for contact in system.contacts]
    else:
        tables["law"] = _part_text(system.law)
    tables["drive"] = _part_text(system.drive)
    run = case.run if case.fs is None else {**case.run, "fs": case.fs}
    for name, values in (("start", case.start), ("run", run)):
        tables[name] = {key: value if isinstance(value, str) else float(value) for key, value in values.items()}
    return tables


def _part_text(part: Any) -> dict[str, Any]:
    """A law or a drive, with its name."""
    inner = part
    while is_dataclass(inner):
        name = type(inner).__name__
        if name not in LAWS and name not in DRIVES:
            raise ModelError(
                f"a {name}", f"a system's file names one of {', '.join(LAWS | DRIVES)}", "run it from Python"
            )
        if any(callable(value) and not isinstance(value, Formula) for value in vars(inner).values()):
            raise ModelError("a law that holds a Python function", "a file holds text", "write the curve as a Formula")
        inner = getattr(inner, "law", getattr(inner, "drive", None))
    text: dict[str, Any] = plain(part)
    return text


def _values(part: Any) -> dict[str, Any]:
    """What a system or a contact holds itself, as plain data."""
    own = {field.name: getattr(part, field.name) for field in fields(part) if field.name not in PARTS}
    return {name: plain(value) for name, value in own.items() if value is not None}


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
