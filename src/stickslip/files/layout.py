"""How a text file is laid out, found from its beginning: encoding, delimiter, decimal sign, header, first numbers."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from stickslip.errors import MISSTATED, FormatError
from stickslip.files.select import is_unit, split_name
from stickslip.files.table import Options, unique

NOT_NUMBERS = ("OL", "Ol", "overload", "Overload", "OVERLOAD", "over", "----", "--", "-", "?", "*", "INVALID")
WHITESPACE = r"\s+"
LONGEST_HEADER = 2000  # lines looked at

MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
DELIMITERS = {"tab": "\t", "\\t": "\t", "comma": ",", "semicolon": ";", "pipe": "|"} | dict.fromkeys(
    ("space", " "), WHITESPACE
)
_EMPTY = frozenset(["", "nan", "na", "n/a", "#n/a", "null", "none", "inf", "-inf", "+inf", "infinity", "-infinity"])
_DECIMAL_POINT = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_DECIMAL_COMMA = re.compile(r"[-+]?(?:\d+,?\d*|,\d+)(?:[eE][-+]?\d+)?")
CLOCK = re.compile(
    r"(?:(?P<date>\d{4}[-/]\d{1,2}[-/]\d{1,2}|\d{1,2}\.\d{1,2}\.\d{4})[ T])?"
    r"\d{1,2}:\d{2}:\d{2}(?:[.,]\d+)?(?:Z|[-+]\d{2}:?\d{2})?"
)


@dataclass(frozen=True)
class Layout:
    """Where the numbers of a text file stand, and what its header calls them.

    Attributes
    ----------
    encoding : str
        Of the bytes after the byte order mark.
    delimiter, decimal : str
        As found or as asked for; the delimiter may be the pattern of any white space.
    comment : str or None
        The sign that begins comment lines, where there are some.
    offset : int
        Byte at which the first row of numbers begins.
    header : int
        Lines before it.
    names : tuple of str
        One per column, unique.
    units : tuple of str or None
        One per column.
    clocks : frozenset of int
        Columns that hold clock times or dates.
    used : tuple of int
        Columns that hold anything.
    """

    encoding: str
    delimiter: str
    decimal: str
    comment: str | None
    offset: int
    header: int
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    clocks: frozenset[int]
    used: tuple[int, ...]


def encoding_of(head: bytes) -> tuple[str, int] | None:
    """The encoding of a text and the length of its byte order mark; None where the bytes are no text."""
    for mark, name in MARKS.items():
        if head.startswith(mark):
            return name, len(mark)
    if b"\0" in head:
        even, odd = head[0::2].count(0), head[1::2].count(0)
        half = len(head) // 2
        if half and odd > 0.9 * half and even == 0:
            return "utf-16-le", 0
        return ("utf-16-be", 0) if half and even > 0.9 * half and odd == 0 else None
    controls = sum(head.count(code) for code in range(32) if code not in b"\t\n\r\f\x1a")
    if controls > len(head) / 200:
        return None
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
        return "utf-8", 0
    except UnicodeDecodeError:
        high = sum(byte > 127 for byte in head)
        return ("latin-1", 0) if high < len(head) / 5 else None


def lines_of(body: bytes, encoding: str, *, whole: bool) -> list[str]:
    """The lines of a text, each with its end; of a beginning alone those that are complete."""
    body = body[: len(body) // 2 * 2] if encoding.startswith("utf-16") else body
    text = codecs.getincrementaldecoder(encoding)("replace").decode(body)
    lines = [line for line in re.split(r"(?<=\n)|(?<=\r)(?!\n)", text) if line]
    return lines[:-1] if not whole and len(lines) > 1 else lines


def find_layout(head: bytes, whole: bool, options: Options, name: str) -> Layout:
    """Find the layout of a text file from its first bytes.

    Parameters
    ----------
    head : bytes
        The beginning of the file.
    whole : bool
        Whether that is all of it.
    options : Options
        The delimiter and decimal sign, where the user states them.
    name : str
        The file's name, for the error.

    Raises
    ------
    FormatError
        There is no row of numbers, or no text.
    """
    codec = encoding_of(head)
    if codec is None:
        raise FormatError(f"'{name}' is not text", "rows of numbers are needed", "check the file")
    encoding, mark = codec
    lines = lines_of(head[mark:], encoding, whole=whole)[:LONGEST_HEADER]
    cells, delimiter, decimal = _best_split(lines, options)
    widths = Counter(len(row) for row in cells if row)
    if not widths:
        _require_as_stated(lines, options, name)
        first = next(((number, line.strip()) for number, line in enumerate(lines, 1) if line.strip()), (1, ""))
        raise FormatError(
            f"row {first[0]} of '{name}' reads '{first[1][:40]}', and none of the first {len(lines)} holds numbers",
            "a text file of measurements has rows of numbers with one delimiter and one decimal sign",
            "check the file, or pass delimiter= and decimal=",
        )
    width = max(widths, key=lambda size: (widths[size], size))
    start = next(index for index, row in enumerate(cells) if row and len(row) == width)
    rows = [row for row in cells[start:] if row and len(row) == width]
    comments = [line.lstrip()[0] for line in lines if line.lstrip().startswith(("#", "%"))]
    names, units = _header(lines[:start], delimiter, width)
    used = tuple(i for i in range(width) if names[i] or any(row[i] for row in rows))
    clocks = frozenset(i for i in used if any(CLOCK.fullmatch(row[i]) for row in rows))
    return Layout(
        encoding,
        delimiter,
        decimal,
        comments[0] if comments else None,
        mark + sum(len(line.encode(encoding, "replace")) for line in lines[:start]),
        start,
        tuple(unique([name or f"c{index + 1}" for index, name in enumerate(names)])),
        tuple("s" if index in clocks else unit for index, unit in enumerate(units)),
        clocks,
        used,
    )


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell holds a number with that decimal sign."""
    return (_DECIMAL_COMMA if decimal == "," else _DECIMAL_POINT).fullmatch(cell) is not None


def is_missing(cell: str) -> bool:
    """Whether a cell is empty or holds a word that instruments write for no reading."""
    return cell.lower() in _EMPTY or cell in NOT_NUMBERS


def _require_as_stated(lines: Sequence[str], options: Options, name: str) -> None:
    """Refuse a delimiter or a decimal sign without which the text can be read."""
    stated = [f"{key} '{getattr(options, key)}'" for key in ("delimiter", "decimal") if getattr(options, key)]
    cells, delimiter, decimal = _best_split(lines, Options())
    if stated and any(cells):
        signs = {"\t": "tabs", WHITESPACE: "spaces"}
        raise FormatError(
            f"the {' and the '.join(stated)} {'do' if len(stated) > 1 else 'does'} not fit '{name}'",
            f"its columns are separated by {signs.get(delimiter, repr(delimiter))}, with the decimal sign '{decimal}'",
            "leave delimiter= and decimal= out, or give these",
            kind=MISSTATED,
        )


def split(line: str, delimiter: str) -> list[str]:
    """The cells of one line, without quotes and outer blanks."""
    line = line.strip("\r\n\x1a\f")
    if delimiter == WHITESPACE:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error:
        return [line]


def _best_split(lines: Sequence[str], options: Options) -> tuple[list[list[str] | None], str, str]:
    """The delimiter and decimal sign that make rows of numbers of most lines; rows that are none are None."""
    best: tuple[tuple[int, bool], list[list[str] | None], str, str] | None = None
    delimiters = [_named_delimiter(options.delimiter)] if options.delimiter else ["\t", ";", ",", "|", WHITESPACE]
    for delimiter in delimiters:
        for decimal in [options.decimal] if options.decimal else [".", ","]:
            if decimal == delimiter:
                continue
            cells = [_numbers(split(line, delimiter), decimal) for line in lines]
            sizes = Counter(len(row) for row in cells if row)
            size, count = max(sizes.items(), key=lambda item: (item[1], item[0])) if sizes else (0, 0)
            score = (count, size > 1)
            if best is None or score > best[0]:
                best = (score, cells, delimiter, decimal)
    if best is None:
        raise FormatError(
            f"delimiter '{options.delimiter}' and decimal '{options.decimal}' are the same sign",
            "cells and decimals are told apart by two signs",
            "pass another delimiter= or decimal=",
        )
    return best[1], best[2], best[3]


def _named_delimiter(text: str) -> str:
    delimiter = DELIMITERS.get(text, text)
    if len(delimiter) != 1 and delimiter != WHITESPACE:
        raise FormatError(
            f"delimiter '{text}'",
            "cells are divided by one character",
            f"pass one of {', '.join(repr(n) for n in DELIMITERS if n.isalpha())} or the character itself",
        )
    return delimiter


def _numbers(row: list[str], decimal: str) -> list[str] | None:
    """The row, if every cell is a number, a clock time or empty, and one is not empty."""
    full = False
    for cell in row:
        if is_number(cell, decimal) or CLOCK.fullmatch(cell):
            full = True
        elif not is_missing(cell):
            return None
    return row if full else None


def _header(lines: Sequence[str], delimiter: str, width: int) -> tuple[list[str], list[str | None]]:
    """Names and units from the lines before the first row of numbers."""
    rows = []
    for line in lines:
        if not line.strip() or re.fullmatch(r"[-=+_*|#\s]+", line):
            continue
        row = _header_cells(line.strip("\r\n").lstrip("#%").strip(" "), delimiter, width)
        if row is not None:
            rows.append(row)
    if not rows:
        return [""] * width, [None] * width
    if width % 2 == 0 and len(rows) > 1 and all(row[0] and len(set(row[0::2])) == 1 for row in rows):
        return _paired(rows)
    return _stacked(rows[-2] if len(rows) > 1 else [""] * width, rows[-1])


def _header_cells(line: str, delimiter: str, width: int) -> list[str] | None:
    """The cells of a header line as wide as the rows of numbers; None for a title or a remark."""
    row = split(line, delimiter)
    if delimiter == WHITESPACE and len(row) != width:
        row = [cell for cell in re.split(r"\s{2,}|\t", line) if cell]
    if len(row) > width and not any(row[width:]):
        row = row[:width]
    if len(row) == width - 1 and width > 2:  # rows of numbers that end in a delimiter
        row = [*row, ""]
    return row if len(row) == width and sum(bool(cell) for cell in row) > width // 3 else None


def _paired(rows: Sequence[list[str]]) -> tuple[list[str], list[str | None]]:
    """Headers of key and value over pairs of columns, time and reading: ``Unit,"V",Unit,"V"``."""
    names: list[str] = []
    units: list[str | None] = []
    by_key = {row[0].lower(): row[1::2] for row in rows}
    titles = next((values for key, values in by_key.items() if "name" in key), [""] * (len(rows[0]) // 2))
    written = next((values for key, values in by_key.items() if "unit" in key), [""] * (len(rows[0]) // 2))
    for title, unit in zip(titles, written, strict=True):
        names += ["Time", title]
        units += ["s", unit or None]
    return names, units


def _stacked(upper: Sequence[str], lower: Sequence[str]) -> tuple[list[str], list[str | None]]:
    """Headers of one row of names, or of names over units; a unit may stand in the name's own cell."""
    named = [cell for cell in lower if cell]
    unit_row = any(upper) and all(is_unit(_bare(cell)) for cell in named)
    names: list[str] = []
    units: list[str | None] = []
    for above, below in zip(upper, lower, strict=True):
        if above and below and (unit_row or below in ("s", "ms", "us", "min")):
            names.append(split_name(above)[0])
            units.append(_bare(below))
        else:
            name, unit = split_name((above if unit_row else below) or above)
            names.append(name)
            units.append(unit)
    return names, units


def _bare(cell: str) -> str:
    return cell.strip().strip("[]()").strip()
