"""Table: what every format gives to read_record: named columns, read in blocks when they are asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import FormatError, StickslipError

Array = NDArray[np.float64]
Block = dict[str, Array]


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
    """

    columns: tuple[Column, ...]
    blocks: Callable[[Sequence[str], int], Iterator[Block]]
    constants: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    record: Mapping[str, Any] = field(default_factory=dict)


def slices(arrays: Mapping[str, Array]) -> Callable[[Sequence[str], int], Iterator[Block]]:
    """The `blocks` of a Table whose columns are in memory already."""

    def blocks(names: Sequence[str], size: int) -> Iterator[Block]:
        rows = min((len(arrays[name]) for name in names), default=0)
        for first in range(0, rows, size):
            yield {name: np.asarray(arrays[name][first : min(first + size, rows)], dtype=np.float64) for name in names}

    return blocks


def unique(names: Sequence[str]) -> list[str]:
    """The names with "_2", "_3" ... after those that came before."""
    taken: set[str] = set()
    result = []
    for name in names:
        candidate, number = name, 1
        while candidate in taken:
            number += 1
            candidate = f"{name}_{number}"
        taken.add(candidate)
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


def optional(module: str) -> ModuleType:
    """Import a package that only some formats need, or say how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise FormatError(
            f"the package {module} is not installed",
            "it reads and writes this format",
            'install it with: pip install ".[io]" in the checkout',
        ) from error
