"""CSV and other text: the layout is found from the file's beginning, the rows are streamed through pandas."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import FormatError
from stickslip.files.layout import (
    CLOCK,
    NOT_NUMBERS,
    WHITESPACE,
    Layout,
    encoding_of,
    find_layout,
    is_missing,
    is_number,
    lines_of,
    split,
)
from stickslip.files.table import FREE, Block, Column, Options, Table
from stickslip.record.metadata import read_beside

if TYPE_CHECKING:
    import pandas as pd

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
    judgement = judged(lines, layout.delimiter, layout.decimal, layout.comment)
    behind = len(lines[-1].encode(layout.encoding, "replace")) + (len(tail) % 2 if "16" in layout.encoding else 0)
    return (size - behind if judgement.torn else size), judgement.cut


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


NAME = "text"
SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn", ".log", ".out")

Array = NDArray[np.float64]

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

    stop, cut = ending(path, layout)

    def blocks(names: Sequence[str], size: int) -> Iterator[Block]:
        return _blocks(path, layout, stop, names, size)

    return Table(columns, blocks, {}, tuple(notes), read_beside(path), cut)


def _blocks(path: Path, layout: Layout, stop: int, names: Sequence[str], size: int) -> Iterator[Block]:
    indexes = {name: layout.names.index(name) for name in names}
    clocks = {index: _Seconds(path.name, layout.names[index]) for index in indexes.values() if index in layout.clocks}
    with path.open("rb") as file, _explained(path, layout, sorted(set(indexes.values()))):
        file.seek(layout.offset)
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
    exact: dict[str, Any] = {}
    if tuple(int(part) for part in pd.__version__.split(".")[:2]) < (3, 1):
        exact["float_precision"] = "round_trip"  # from 3.1 on this is the default, and asking for it warns
    between = " " if layout.delimiter == WHITESPACE else layout.delimiter
    titles = between.join(map(str, range(width + 1))) + "\n"
    with pd.read_csv(
        io.BufferedReader(_Headed(titles.encode(layout.encoding), file, stop)),
        sep=layout.delimiter,
        decimal=layout.decimal,
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
    import pandas as pd

    try:
        yield
    except (ValueError, OverflowError, pd.errors.ParserError) as error:
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
    year, month, day = numbers if numbers[0] > 31 else reversed(numbers)
    return date(year, month, day).toordinal()
