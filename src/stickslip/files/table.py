"""Table: what every format gives to read_record: named columns, read in blocks when they are asked for."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import FormatError, StickslipError, package

Block = dict[str, Array]


FREE = 1 << 24  # cells, 134 MB as numbers: what a file of any size may become
PER_BYTE = 8  # cells that each byte of a larger file may become; speech in OGG, the tightest of honest files, has 4
A_COLUMN = 1 << 12  # cells that a column counts as at least: what its name, unit and check-up cost
SHORT = 1 << 22  # bytes of text that are read at once: tenths of a second
PLAIN = re.compile(rb"[-+.\deE\s,;|]*")  # what such a text has: numbers, and what stands between them
LISTED = 256  # numbers in a cell or in a message: the joints of a robot; more are a picture


@dataclass(frozen=True)
class Budget:
    """How many cells may be made of one file at once: asked before they are allocated, by whoever allocates them.

    Attributes
    ----------
    path : Path
        The file.
    cells : int
        ``max(FREE, PER_BYTE * bytes of the file)``.
    """

    path: Path
    cells: int

    @classmethod
    def of(cls, path: Path) -> Budget:
        """The budget of a file that is there."""
        return cls(path, max(FREE, PER_BYTE * path.stat().st_size))

    @property
    def bytes(self) -> int:
        """The same, of numbers in double precision."""
        return 8 * self.cells

    def require(self, cells: int, remedy: str = "save it again without compression, or as CSV") -> None:
        """Refuse what is out of all proportion to the file."""
        if cells > self.cells:
            raise FormatError(
                f"'{self.path.name}' has {self.path.stat().st_size} bytes and would become {cells} cells or more",
                f"{FREE} are held of any file at once, and {PER_BYTE} for each byte of a larger one, where a column "
                f"counts as {A_COLUMN} at least",
                remedy,
            )

    def require_columns(self, columns: int) -> None:
        """Refuse a file of so many columns."""
        self.require(columns * A_COLUMN, "keep fewer columns in a file")

    def require_rows(self, rows: int, columns: int) -> None:
        """Refuse so many rows at once of columns that are read in blocks."""
        self.require(rows * columns, "go through it with read_blocks() in a smaller size=, or name fewer channels=")


@dataclass(frozen=True)
class Options:
    """What the user said about a text file; None where it is to be found out."""

    delimiter: str | None = None
    decimal: str | None = None


@dataclass(frozen=True)
class Column:
    """A column of numbers in a file.

    Attributes
    ----------
    name : str
        Its name, unique in the file.
    unit : str or None
        Its unit as the file writes it; None where the file states none.
    rows : int or None
        Its length, where known before reading.
    fs : float or None
        Its sampling rate [Hz], where the format states one.
    start : float
        Time [s] of its first sample, where the format states it.
    """

    name: str
    unit: str | None = None
    rows: int | None = None
    fs: float | None = None
    start: float = 0.0


@dataclass(frozen=True)
class Table:
    """The columns of one file.

    Attributes
    ----------
    columns : tuple of Column
        In the file's order.
    blocks : callable
        ``blocks(names, size)`` opens the file and yields dictionaries of equally long float64 arrays, at most
        `size` rows each, of the named columns alone. Clock strings and dates become seconds since the first row.
    constants : mapping of str to float
        Numbers found beside the columns (a gain, a mass), usable in channel expressions.
    notes : tuple of str
        What the reader met and decided, in words, for the history.
    record : mapping
        The metadata that write_record left, of a file that it wrote; empty otherwise.
    cut : str
        What of the file is known to be missing, in words, where it was cut; empty otherwise.
    """

    columns: tuple[Column, ...]
    blocks: Callable[[Sequence[str], int], Iterator[Block]]
    constants: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    record: Mapping[str, Any] = field(default_factory=dict)
    cut: str = ""


def slices(arrays: Mapping[str, Array]) -> Callable[[Sequence[str], int], Iterator[Block]]:
    """The `blocks` of a Table whose columns are in memory already."""

    def blocks(names: Sequence[str], size: int) -> Iterator[Block]:
        rows = min((len(arrays[name]) for name in names), default=0)
        for first in range(0, rows, size):
            yield {name: np.asarray(arrays[name][first : min(first + size, rows)], dtype=np.float64) for name in names}

    return blocks


def plain_numbers(file: BinaryIO, length: int, *, between: str | None, width: int) -> Array | None:
    """The columns of the next bytes of a short text of nothing but numbers, `width` in each row; None of any other.

    What numpy refuses is for pandas to read, or to complain of: its import takes half a second, which a short file
    need not wait for. What both read is the same to the last bit.
    """
    if length > SHORT:
        return None
    begin = file.tell()
    text = file.read(length)
    file.seek(begin)
    if not text.strip() or not PLAIN.fullmatch(text):
        return None
    try:
        rows = np.loadtxt(io.StringIO(text.decode("ascii")), delimiter=between, comments=None, ndmin=2)
    except (TypeError, ValueError):  # an empty cell, rows of unequal length
        return None
    return rows.T.copy() if rows.shape[1] == width else None


def unique(names: Sequence[str]) -> list[str]:
    """The names with "_2", "_3" ... after those that came before."""
    last: dict[str, int] = {}  # the number that a name had when it came last: thousands may be alike
    result = []
    for name in names:
        candidate, number = name, last.get(name, 1)
        while candidate in last:
            number += 1
            candidate = f"{name}_{number}"
        last[name] = number
        last.setdefault(candidate, 1)
        result.append(candidate)
    return result


@contextmanager
def supplied(path: Path) -> Iterator[None]:
    """Around all reading of a file: memory or disk that fail become one sentence; an error of the program stays one."""
    try:
        yield
    except MemoryError as error:
        raise FormatError(
            f"'{path.name}' asks for more memory than there is",
            "columns are held whole unless they are read in blocks; a damaged file may state absurd sizes",
            "name fewer channels=, or go through the file with read_blocks()",
        ) from error
    except OSError as error:
        raise FormatError(
            f"'{path.name}' can not be read ({error})", "the file stays there while it is read", "check disk and rights"
        ) from error


@contextmanager
def reading(path: Path, kind: str) -> Iterator[None]:
    """Around a call into a format's library: whatever it raises on a damaged file becomes one sentence."""
    try:
        yield
    except (StickslipError, MemoryError):
        raise
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise FormatError(
            f"'{path.name}' can not be read as {kind} ({reason})",
            "the file is damaged, cut off, or of another format",
            "copy it again from its source, or export it as CSV",
        ) from error


def optional(module: str, *, extra: str = "io") -> Any:
    """Import a package that only some formats need, or say how to install it."""
    return package(module, extra=extra, rule="it reads and writes this format", error=FormatError)
