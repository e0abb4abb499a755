"""How a text ends: one that was cut has a last line without its end, which may hold the beginning of a number.

A number that stands last is whole where it has the decimals that all others of its column have; it is torn where they
differ from these. In a column of varying decimals or of whole numbers the last one is taken as torn where it has fewer
significant digits than any other of n: of n + 1 numbers without trend that happens to the last by chance once at most.
Otherwise nothing tells, and that is said.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stickslip.files.layout import CLOCK, Layout, is_missing, is_number, lines_of, split

TAIL = 1 << 16  # bytes at the end that are looked at
FEWEST = 3  # other rows by which a last one can be judged
PIECE = re.compile(r"[-+0-9.,:eETZ/ ]*")  # what the beginning of a number or a clock time consists of


@dataclass(frozen=True)
class Ending:
    """Whether the last line is to be left out, and what of the text is missing or in doubt, in words."""

    torn: bool = False
    cut: str = ""


def ending(path: Path, layout: Layout) -> tuple[int, str]:
    """The byte at which the whole rows of a text file end, and what is missing behind it, in words."""
    size = path.stat().st_size
    first = max(layout.offset, size - TAIL + size % 2)
    with path.open("rb") as file:
        file.seek(first)
        tail = file.read()
    lines = lines_of(tail, layout.encoding, whole=True)
    if first > layout.offset:
        lines = lines[1:]  # it may begin within its line
    found = judged(lines, layout.delimiter, layout.decimal, layout.comment)
    behind = len(lines[-1].encode(layout.encoding, "replace")) + (len(tail) % 2 if "16" in layout.encoding else 0)
    return (size - behind if found.torn else size), found.cut


def judged(lines: Sequence[str], delimiter: str, decimal: str, comment: str | None = None) -> Ending:
    """Whether the last of these lines is whole."""
    last = lines[-1] if lines else ""
    if not last.strip("\x1a\f\0 \t") or last.endswith(("\n", "\r")) or (comment and last.lstrip().startswith(comment)):
        return Ending()
    cells = split(last, delimiter)
    rows = [row for row in (split(line, delimiter) for line in lines[:-1] if line.strip()) if _is_row(row, decimal)]
    if len(rows) < FEWEST or not _is_row(cells[:-1], decimal) or not PIECE.fullmatch(cells[-1]):
        doubted = len(cells) > 0 and _is_row(cells, decimal)
        return Ending(cut=_in_doubt(cells[-1])) if doubted else Ending()
    others = [row[len(cells) - 1] for row in rows if len(row) >= len(cells) and row[len(cells) - 1]]
    if len(cells) < min(map(len, rows)) or last.count('"') % 2 or (not cells[-1] and others):
        return Ending(True, f"the last line ends after {len(cells)} of {min(map(len, rows))} cells and was left out")
    if not cells[-1] or last.rstrip().endswith('"'):
        return Ending()
    whole = _is_whole(cells[-1], others, decimal)
    if whole is None:
        return Ending(cut=_in_doubt(cells[-1]))
    return Ending() if whole else Ending(True, f"the last line ends within a number, '{cells[-1]}', and was left out")


def _in_doubt(cell: str) -> str:
    return f"the last line has no end: whether its last number, {cell}, is whole can not be told"


def _is_row(cells: Sequence[str], decimal: str) -> bool:
    return all(is_number(cell, decimal) or is_missing(cell) or CLOCK.fullmatch(cell) for cell in cells)


def _is_whole(cell: str, others: Sequence[str], decimal: str) -> bool | None:
    """Whether a cell is as long as the others of its column show; None where they do not."""
    forms = {_form(other, decimal) for other in others}
    if len(forms) == 1 and (form := forms.pop()) != (0, 0):
        return _form(cell, decimal) == form
    if not is_number(cell, decimal):
        return False
    counts = [_digits(other) for other in others if is_number(other, decimal)]
    return False if counts and _digits(cell) < min(counts) else None


def _form(cell: str, decimal: str) -> tuple[int, int] | str:
    """What all numbers of a column written alike share: decimals, and length of the exponent."""
    if not is_number(cell, decimal):
        return re.sub(r"\d", "0", cell)
    mantissa, _, exponent = cell.lower().partition("e")
    return len(mantissa.partition(decimal)[2]), len(exponent)


def _digits(cell: str) -> int:
    """Significant digits of a number."""
    return len(re.sub(r"\D", "", cell.lower().partition("e")[0]).lstrip("0"))
