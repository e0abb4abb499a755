"""The one door to the terminal: nothing that a file holds is obeyed there, as an escape sequence or as markup."""

from __future__ import annotations

import itertools
import json
import shutil
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import click

from stickslip.printing import printable

WIDEST = 110  # columns: longer lines are hard to read
GAP, NARROW = 2, 6  # columns between two, and of the narrowest that is broken
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


def say_styled(line: str, **style: Any) -> None:
    """A line in a style of :func:`click.style`, where it is a terminal that shows styles."""
    click.echo(click.style(_shown(line), **style) if style else _shown(line))


def wrapped(text: str, begin: str = "") -> list[str]:
    """A paragraph as lines of the terminal's width; the further ones stand under the first behind `begin`."""
    return textwrap.wrap(_shown(text), _width(), initial_indent=begin, subsequent_indent=" " * len(begin))


def aligned(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A table under its headings as lines; the widest columns are broken until it fits the terminal."""
    table = [[_shown(cell) for cell in row] for row in (headings, *rows)]
    widths = [max(1, *map(len, column)) for column in zip(*table, strict=True)]
    breakable = range(widths[0] <= WHOLE, len(widths))
    while sum(widths) + GAP * (len(widths) - 1) > _width():
        widest = max(breakable, key=lambda place: widths[place], default=0)
        if widths[widest] <= NARROW:
            break
        widths[widest] -= 1
    broken = ((textwrap.wrap(cell, width) for cell, width in zip(row, widths, strict=True)) for row in table)
    parts = (part for cells in broken for part in itertools.zip_longest(*cells, fillvalue=""))
    return [(GAP * " ").join(map(str.ljust, part, widths)).rstrip() for part in parts]


def _width() -> int:
    return min(WIDEST, shutil.get_terminal_size().columns)


def _shown(text: object, *, err: bool = False) -> str:
    stream = sys.stderr if err else sys.stdout
    return printable(str(text), encoding=getattr(stream, "encoding", None) or "utf-8")
