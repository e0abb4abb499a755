"""CSV and other text: the layout is found from the file's beginning, long ones stream through pandas."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import MISSTATED, FormatError
from stickslip.files.select import is_unit, split_name
from stickslip.files.table import FREE, Block, Column, Options, Table, plain_numbers, slices, unique
from stickslip.record.metadata import read_beside

if TYPE_CHECKING:
    import pandas as pd

TAIL = 1 << 16  # bytes at the end that are looked at
FEWEST = 3  # other rows by which a last one can be judged
PIECE = re.compile(r"[-+0-9.,:eETZ/ ]*")  # what the beginning of a number or a clock time consists of
NOT_NUMBERS = ("OL", "Ol", "overload", "Overload", "OVERLOAD", "over", "----", "--", "-", "?", "*", "INVALID")
WHITESPACE = r"\s+"
LONGEST_HEADER = 2000  # lines looked at

MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
DELIMITERS = {"tab": "\t", "\\t": "\t", "comma": ",", "semicolon": ";", "pipe": "|"} | dict.fromkeys(
    ("space", " "), WHITESPACE
)
_EMPTY = frozenset(["", "nan", "na", "n/a", "#n/a", "null", "none", "inf", "-inf", "+inf", "infinity", "-infinity"])
_DECIMAL_POINT = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+|\d{1,3}(?:,\d{3})+\.\d+)(?:[eE][-+]?\d+)?")
_DECIMAL_COMMA = re.compile(r"[-+]?(?:\d+,?\d*|,\d+|\d{1,3}(?:\.\d{3})+,\d+)(?:[eE][-+]?\d+)?")
_DAY = r"\d{4}[-/]\d{1,2}[-/]\d{1,2}|\d{1,2}\.\d{1,2}\.\d{4}"
DATE = re.compile(rf"{_DAY}|\d{{1,2}}/\d{{1,2}}/\d{{4}}")
CLOCK = re.compile(rf"(?:(?P<date>{_DAY})[ T])?\d{{1,2}}:\d\d:\d\d(?:[.,]\d+)?(?:Z|[-+]\d\d:?\d\d)?")
WRITTEN = re.compile(f"(?:{CLOCK.pattern})|{DATE.pattern}")


@dataclass(frozen=True)
class Ending:
    """Whether the last line is to be left out, and what of the text is missing or in doubt, in words."""

    torn: bool = False
    cut: str = ""


def ending(path: Path, layout: Layout) -> tuple[int, str, str]:
    """The byte at which the whole rows of a text file end, what is missing behind it, and what else stands there."""
    size = path.stat().st_size
    first = max(layout.offset, size - TAIL + size % 2)
    with path.open("rb") as file:
        file.seek(first)
        tail = file.read()
    lines = lines_of(tail, layout.encoding, whole=True)
    if not lines:
        return size, "", ""
    if first > layout.offset:
        lines = lines[1:]  # it may begin within its line
    if words := _footer(lines, layout):
        left_out = sum(len(line.encode(layout.encoding, "replace")) for line in lines[-len(words) :])
        return size - left_out, "", f"left out what stands below the rows: '{' '.join(' '.join(words).split())[:60]}'"
    judgement = judged(lines, layout.delimiter, layout.decimal, layout.comment)
    behind = len(lines[-1].encode(layout.encoding, "replace")) + (len(tail) % 2 if "16" in layout.encoding else 0)
    return (size - behind if judgement.torn else size), judgement.cut, ""


def _footer(lines: Sequence[str], layout: Layout) -> list[str]:
    """The lines below the last row, where they are words: statistics, "End of data"."""
    numbers = (_numbers(split(line, layout.delimiter), layout.decimal) for line in reversed(lines))
    count = next((count for count, row in enumerate(numbers) if row), 0)
    words = [line.strip(" \"'*=-") for line in lines[len(lines) - count :] if line.strip()]
    return list(lines[-count:]) if words and words[0][:1].isalpha() and not is_missing(words[0]) else []


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
    return all(is_number(cell, decimal) or is_missing(cell) or WRITTEN.fullmatch(cell) for cell in cells)


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


NAME = "text"
SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn", ".log", ".out")

HEAD = 1 << 18  # bytes looked at to find the layout
LONGEST_ROW = 1 << 24  # bytes; the parser holds a whole row, and a disk that was full leaves holes of any length
DAY = 86400.0


def recognise(path: Path, head: bytes) -> bool:
    """Whatever decodes as text; the last format to be asked."""
    return encoding_of(head) is not None


def read(path: Path, options: Options) -> Table:
    """The columns of a text file; its rows are read block by block when asked for."""
    with path.open("rb") as file:
        head = file.read(HEAD)
        whole = not file.read(1)
    layout = find_layout(head, whole, options, path.name)
    columns = tuple(Column(layout.names[index], layout.units[index]) for index in layout.used)
    notes = [f"decimal sign '{layout.decimal}'"] if layout.decimal != "." else []
    notes += [f"clock times in {layout.names[index]} as seconds since the first" for index in sorted(layout.clocks)]
    notes += [f"another column is called {title}: it is {name}" for name, title in layout.again.items()]
    stop, cut, below = ending(path, layout)
    notes += [below] if below else []

    def blocks(names: Sequence[str], size: int) -> Iterator[Block]:
        return _blocks(path, layout, stop, names, size)

    return Table(columns, blocks, {}, tuple(notes), read_beside(path), cut)


def _blocks(path: Path, layout: Layout, stop: int, names: Sequence[str], size: int) -> Iterator[Block]:
    indexes = {name: layout.names.index(name) for name in names}
    clocks = {index: _Seconds(path.name, layout.names[index]) for index in indexes.values() if index in layout.clocks}
    with path.open("rb") as file, _explained(path, layout, sorted(set(indexes.values()))):
        file.seek(layout.offset)
        between = None if layout.delimiter == WHITESPACE else layout.delimiter
        plain = layout.decimal == "." and not (layout.clocks or layout.comment or layout.thousands)
        whole = plain_numbers(file, stop - layout.offset, between=between, width=len(layout.names)) if plain else None
        if whole is not None:
            yield from slices({name: whole[index] for name, index in indexes.items()})(names, size)
            return
        for frame in _frames(file, layout, stop, sorted(set(indexes.values())), size):
            if frame[str(len(layout.names))].notna().any():
                raise ValueError(f"a row has more than {len(layout.names)} cells")
            values = {index: frame[str(index)] for index in set(indexes.values())}
            numbers = {i: clocks[i].of(v) if i in clocks else v.to_numpy(dtype=np.float64) for i, v in values.items()}
            yield {name: numbers[index] for name, index in indexes.items()}


def _frames(file: BinaryIO, layout: Layout, stop: int, indexes: Sequence[int], size: int) -> Iterator[pd.DataFrame]:
    import pandas as pd

    width = len(layout.names)
    types: dict[str, Any] = {str(index): str if index in layout.clocks else np.float64 for index in indexes}
    types[str(width)] = str
    known = tuple(int(part) for part in pd.__version__.split(".")[:2]) < (3, 1)  # later it is so, and asking warns
    exact: dict[str, Any] = {"float_precision": "round_trip"} if known else {}
    between = " " if layout.delimiter == WHITESPACE else layout.delimiter
    titles = between.join(map(str, range(width + 1))) + "\n"
    with pd.read_csv(
        io.BufferedReader(_Headed(titles.encode(layout.encoding), file, stop)),
        sep=layout.delimiter,
        decimal=layout.decimal,
        thousands=layout.thousands,
        comment=layout.comment,
        header=0,
        usecols=[str(index) for index in [*indexes, width]],
        index_col=False,
        dtype=types,
        na_values=list(NOT_NUMBERS),
        skipinitialspace=True,
        encoding=layout.encoding,
        encoding_errors="replace",
        engine="c",
        chunksize=max(1, min(size, FREE // width)),
        **exact,
    ) as frames:
        yield from frames


class _Headed(io.RawIOBase):
    """A file up to byte `stop` with a header line of one cell more than its rows have: rows too long are seen by it."""

    def __init__(self, header: bytes, file: BinaryIO, stop: int) -> None:
        self.header, self.file, self.stop = header, file, stop
        self.row = 0  # bytes since the last end of a line

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        piece = self.header[: len(buffer)] or self.file.read(max(0, min(len(buffer), self.stop - self.file.tell())))
        self.header = self.header[len(buffer) :]
        ended = max(piece.rfind(b"\n"), piece.rfind(b"\r"))
        self.row = self.row + len(piece) if ended < 0 else len(piece) - ended
        if self.row > LONGEST_ROW:
            raise ValueError(f"a row has more than {LONGEST_ROW} bytes")
        buffer[: len(piece)] = piece
        return len(piece)


@contextmanager
def _explained(path: Path, layout: Layout, indexes: Sequence[int]) -> Iterator[None]:
    """Turn the parser's complaint into a sentence with the row at fault."""
    try:
        yield
    except (ValueError, OverflowError) as error:  # a ParserError of pandas is a ValueError
        fault = _first_fault(path, layout, indexes)
        place = f"row {fault[0]} of '{path.name}' reads '{fault[1]}'" if fault else f"'{path.name}': {str(error)[:100]}"
        raise FormatError(
            place,
            f"rows have {len(layout.names)} cells, numbers with the decimal sign '{layout.decimal}'",
            "mend that row, or pass delimiter= and decimal= if they were mistaken",
        ) from error


def _first_fault(path: Path, layout: Layout, indexes: Sequence[int]) -> tuple[int, str] | None:
    """Line number and text of the first row that does not fit the layout."""
    with path.open("rb") as file:
        file.seek(layout.offset)
        lines = io.TextIOWrapper(file, layout.encoding, errors="replace")
        for number, line in enumerate(lines, layout.header + 1):
            text = line.split(layout.comment)[0] if layout.comment else line
            cells = split(text, layout.delimiter)
            wanted = [cells[index] for index in indexes if index < len(cells)]
            if not _is_row(wanted, layout.decimal) or any(cells[len(layout.names) :]) or line.count('"') % 2:
                return number, line.strip()[:60]
    return None


class _Seconds:
    """Clock times of one column as seconds since its first, block after block."""

    def __init__(self, file: str, column: str) -> None:
        self.file, self.column = file, column
        self.first: float | None = None
        self.day: float | None = None
        self.last = -np.inf
        self.days = 0.0

    def of(self, cells: pd.Series[str]) -> Array:
        """Seconds since the column's first time; NaN where a cell is empty."""
        text = cells.str.strip().str.replace(",", ".", regex=False)
        parts = text.str.extract(r"^(?:(\S+)[ T])?(\d+):(\d+):([\d.]+)(?:Z|[-+]\d{2}:?\d{2})?$")
        seconds = parts[[1, 2, 3]].to_numpy(dtype=np.float64) @ np.array([3600.0, 60.0, 1.0])
        wrong = np.flatnonzero(text.notna().to_numpy() & np.isnan(seconds))
        if len(wrong):
            raise ValueError(f"'{text.iloc[wrong[0]]}' is no clock time")
        if parts[0].notna().any():
            days = parts[0].map(_day_number, na_action="ignore").to_numpy(dtype=np.float64)
            if self.day is None:
                self.day = float(days[np.isfinite(days)][0])
            seconds = seconds + DAY * (days - self.day)
        else:
            seconds = self._past_midnight(seconds)
        if self.first is None:
            known = seconds[np.isfinite(seconds)]
            self.first = float(known[0]) if len(known) else None
        # nine decimals: the difference of two clock times is the decimal number that it stands for
        return np.asarray(np.round(seconds - (self.first or 0.0), 9), dtype=np.float64)

    def _past_midnight(self, seconds: Array) -> Array:
        known = np.flatnonzero(np.isfinite(seconds))
        steps = np.diff(seconds[known], prepend=self.last if np.isfinite(self.last) else seconds[known[:1]])
        days = self.days + DAY * np.cumsum(steps < -DAY / 2)
        if len(known):
            self.last, self.days = float(seconds[known[-1]]), float(days[-1])
        result = seconds.copy()
        result[known] += days
        return result


def _day_number(text: str) -> int:
    numbers = [int(part) for part in re.split(r"[-/.]", text)]
    return date(*(numbers if numbers[0] > 31 else reversed(numbers))).toordinal()


# ---- how a text file is laid out, found from its beginning


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
    again : mapping of str to str
        Of those that had to be made unique, what the header calls them.
    units : tuple of str or None
        One per column.
    clocks : frozenset of int
        Columns that hold clock times or dates.
    used : tuple of int
        Columns that hold anything, but dates beside a clock.
    thousands : str or None
        The sign between thousands, where numbers have one.
    """

    encoding: str
    delimiter: str
    decimal: str
    comment: str | None
    offset: int
    header: int
    names: tuple[str, ...]
    again: Mapping[str, str]
    units: tuple[str | None, ...]
    clocks: frozenset[int]
    used: tuple[int, ...]
    thousands: str | None = None


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
        The file's name, for the error where there is no row of numbers, or no text.
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
    dates = {i for i in range(width) if any(DATE.fullmatch(row[i]) for row in rows)}  # beside them stands the clock
    used = tuple(i for i in range(width) if i not in dates and (names[i] or any(row[i] for row in rows)))
    grouping = "." if decimal == "," else ","
    grouped = any(grouping in row[i] for row in rows for i in used)
    own = unique([name or f"c{index + 1}" for index, name in enumerate(names)])
    clocks = frozenset(i for i in used if any(CLOCK.fullmatch(row[i]) for row in rows))
    return Layout(
        encoding,
        delimiter,
        decimal,
        comments[0] if comments else None,
        mark + sum(len(line.encode(encoding, "replace")) for line in lines[:start]),
        start,
        tuple(own),
        {name: title for name, title in zip(own, names, strict=True) if title and name != title},
        tuple("s" if index in clocks else unit for index, unit in enumerate(units)),
        clocks,
        used,
        grouping if grouped else None,
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
    """The row, if every cell is a number, a clock time, a date or empty, and one is a number or a clock time."""
    full = False
    for cell in row:
        if is_number(cell, decimal) or CLOCK.fullmatch(cell):
            full = True
        elif not is_missing(cell) and not DATE.fullmatch(cell):
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
    if _is_paired(rows, width):
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


def _is_paired(rows: Sequence[list[str]], width: int) -> bool:
    """Whether each line says one key over all pairs; of a single pair, that a unit is among the keys."""
    if width % 2 or len(rows) < 2 or not all(row[0] and len(set(row[0::2])) == 1 for row in rows):
        return False
    return width > 2 or any("unit" in row[0].lower() for row in rows)


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
    # one alone may be a path; what has no slash is not asked, as units that are not known are looked up at length
    if all(cell.count("/") == 1 and is_unit(cell.rpartition("/")[2].strip()) for cell in named):
        lower = [re.sub(r"\s*/\s*", " / ", cell) for cell in lower]
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
