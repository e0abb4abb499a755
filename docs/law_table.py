"""The table of the friction laws in the pages, as each class declares them."""

from __future__ import annotations

from dataclasses import Field, fields
from typing import Any

from stickslip.parameters import declaration
from stickslip.scenarios import LAWS


def table() -> str:
    """A row for each law, in Markdown."""
    rows = [f"| `{name}` | {law.label} | `{_cell(law.formula)}` | {_parameters(law)} |" for name, law in LAWS.items()]
    return "\n".join(["| law | what it is | friction | parameters |", "|---|---|---|---|", *rows])


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


def _parameters(law: type[Any]) -> str:
    return ", ".join(map(_parameter, fields(law)))


def _parameter(field: Field[Any]) -> str:
    unit = declaration(field).unit
    return f"`{field.name}`" if unit in ("", "1") else f"`{field.name}` [{unit}]"
