"""The one door to the terminal: nothing that a file holds is obeyed there, as an escape sequence or as markup."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from stickslip.printing import printable

if TYPE_CHECKING:
    from rich.console import RenderableType

WHOLE = 28  # letters of a name that is not broken


def say(text: object = "", *, err: bool = False) -> None:
    """Lines as they are."""
    click.echo(_shown(text, err=err), err=err)


def complain(sentence: object) -> None:
    """One line on the error stream, whatever line ends a file's name holds."""
    say(f"stickslip: {' '.join(str(sentence).split())}", err=True)


def say_json(told: Mapping[str, Any]) -> None:
    """Results for a machine; what can not be printed is spelled out, which leaves it JSON of the same value."""
    say(json.dumps(told, indent=2, ensure_ascii=False, allow_nan=False))


def paragraph(*parts: str | tuple[str, str]) -> None:
    """Text broken at the terminal's width; a part may have a style: ``("Title", "bold")``."""
    from rich.text import Text

    styled = ((part, "") if isinstance(part, str) else part for part in parts)
    _print(Text.assemble(*((_shown(text), style) for text, style in styled)))


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """A table under its headings; the first column is broken only where it is long."""
    from rich.table import Table
    from rich.text import Text

    rows = list(rows)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for place, heading in enumerate(headings):
        whole = place == 0 and max((len(row[0]) for row in rows), default=0) <= WHOLE
        table.add_column(Text(_shown(heading)), overflow="fold", no_wrap=whole)
    for row in rows:
        table.add_row(*(Text(_shown(cell)) for cell in row))
    _print(table)


def _print(what: RenderableType) -> None:
    from rich.console import Console

    Console(highlight=False, soft_wrap=False).print(what)


def _shown(text: object, *, err: bool = False) -> str:
    stream = sys.stderr if err else sys.stdout
    return printable(str(text), encoding=getattr(stream, "encoding", None) or "utf-8")
