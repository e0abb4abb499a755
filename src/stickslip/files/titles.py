"""Titles of columns: ``"Group/acc [m/s^2]"`` is a name, below a path, and a unit, in whatever format it stands."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from stickslip.errors import StickslipError
from stickslip.files.table import Block, Table, unique
from stickslip.units import parse_unit

_SLASH = re.compile(r"[\[(][^\[(\])]*[\])]|([/\\])")  # one in brackets belongs to a unit


def titled(table: Table) -> Table:
    """The table with the units that stand in its columns' titles taken out of them; what the file states counts."""
    if table.record:  # written by write_record: the names are names
        return table
    parts = [split_name(column.name) for column in table.columns]
    parts = [
        (name, unit) if column.unit is None or column.name.rstrip().endswith("]") else (column.name, None)
        for column, (name, unit) in zip(table.columns, parts, strict=True)
    ]
    names = unique([name for name, _ in parts])
    written = dict(zip(names, (column.name for column in table.columns), strict=True))
    columns, notes = [], list(table.notes)
    for name, (_, unit), column in zip(names, parts, table.columns, strict=True):
        columns.append(replace(column, name=name, unit=column.unit or unit))
        if unit and column.unit not in (None, unit):
            notes.append(f"{name} is titled in {unit}, stated in {column.unit}")
    if names == list(written.values()):
        return table

    def blocks(wanted: Sequence[str], size: int) -> Iterator[Block]:
        for block in table.blocks([written[name] for name in wanted], size):
            yield {name: block[written[name]] for name in wanted}

    return replace(table, columns=tuple(columns), blocks=blocks, notes=tuple(notes))


def split_name(text: str) -> tuple[str, str | None]:
    """Part ``"x [mm]"``, ``"x (mm)"`` or ``"x, mm"`` into name and unit."""
    text = text.strip()
    name, bracket, unit = text[:-1].rpartition("[") if text.endswith("]") else ("", "", "")
    if bracket and name.strip() and "]" not in unit:
        return name.strip(), unit.strip()
    # no two parts that fit the same signs: a title of any length is read in one pass
    match = re.fullmatch(r"(.*?)(?:\(([^()]*(?:\([^()]*\)[^()]*)?)\)|,([^,]+))", text)
    if match and match[1].strip():
        unit = (match[2] or match[3] or "").strip()
        if is_unit(unit):
            return match[1].strip(), unit
    return text, None


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known."""
    if not text or len(text) > 20:
        return False
    try:
        parse_unit(text)
    except StickslipError:
        return False
    return True


def last_part(name: str) -> str:
    """The name without the path before it."""
    return path_parts(name)[-1]


def path_parts(name: str) -> list[str]:
    """A name's parts between slashes of either kind."""
    slashes = [match.start() for match in _SLASH.finditer(name) if match[1]]
    return [name[before + 1 : after] for before, after in itertools.pairwise([-1, *slashes, len(name)])]
