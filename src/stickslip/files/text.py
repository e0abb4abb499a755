"""CSV and other text: the layout is found from the file's beginning, the rows are streamed through pandas."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import FormatError
from stickslip.files.ending import ending
from stickslip.files.layout import (
    CLOCK,
    NOT_NUMBERS,
    WHITESPACE,
    Layout,
    encoding_of,
    find_layout,
    is_missing,
    is_number,
    split,
)
from stickslip.files.table import FREE, Block, Column, Options, Table
from stickslip.record.metadata import KEY, parse_metadata

if TYPE_CHECKING:
    import pandas as pd

NAME = "text"
SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn", ".log", ".out")

Array = NDArray[np.float64]

HEAD = 1 << 18  # bytes looked at to find the layout
LONGEST_COMMENT = 1 << 26  # bytes of a record's own description
LONGEST_ROW = 1 << 24  # bytes; the parser holds a whole row, and a disk that was full leaves holes of any length
DAY = 86400.0
_OURS = f"# {KEY} ".encode()


def recognise(path: Path, head: bytes) -> bool:
    """Whatever decodes as text; the last format to be asked."""
    return encoding_of(head) is not None


def read(path: Path, options: Options) -> Table:
    """The columns of a text file; its rows are read block by block when asked for."""
    with path.open("rb") as file:
        described = file.readline(LONGEST_COMMENT) if file.read(len(_OURS)) == _OURS else b""
        begin = len(_OURS) + len(described) if described else 0
        file.seek(begin)
        head = file.read(HEAD)
        whole = not file.read(1)
    layout = find_layout(head, whole, options, path.name)
    layout = replace(layout, offset=layout.offset + begin, header=layout.header + (1 if begin else 0))
    columns = tuple(Column(layout.names[index], layout.units[index]) for index in layout.used)
    notes = [f"decimal sign '{layout.decimal}'"] if layout.decimal != "." else []
    notes += [f"clock times in {layout.names[index]} as seconds since the first" for index in sorted(layout.clocks)]

    stop, cut = ending(path, layout)

    def blocks(names: Sequence[str], size: int) -> Iterator[Block]:
        return _blocks(path, layout, stop, names, size)

    return Table(columns, blocks, {}, tuple(notes), parse_metadata(described) if described else {}, cut)


def _blocks(path: Path, layout: Layout, stop: int, names: Sequence[str], size: int) -> Iterator[Block]:
    indexes = {name: layout.names.index(name) for name in names}
    clocks = {index: _Seconds(path.name, layout.names[index]) for index in indexes.values() if index in layout.clocks}
    with path.open("rb") as file, _explained(path, layout, sorted(set(indexes.values()))):
        file.seek(layout.offset)
        for frame in _frames(file, layout, stop, sorted(set(indexes.values())), size):
            if frame[str(len(layout.names))].notna().any():
                raise ValueError(f"a row has more than {len(layout.names)} cells")
            values = {
                index: clocks[index].of(frame[str(index)])
                if index in clocks
                else frame[str(index)].to_numpy(dtype=np.float64)
                for index in set(indexes.values())
            }
            yield {name: values[index] for name, index in indexes.items()}


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
        found = f"row {fault[0]} of '{path.name}' reads '{fault[1]}'" if fault else f"'{path.name}': {str(error)[:100]}"
        raise FormatError(
            found,
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
            fits = all(is_number(c, layout.decimal) or is_missing(c) or CLOCK.fullmatch(c) for c in wanted)
            if not fits or any(cells[len(layout.names) :]) or line.count('"') % 2:
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
