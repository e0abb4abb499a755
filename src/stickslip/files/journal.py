"""Journal: samples as they are acquired, frame after frame, whole up to the last frame whatever ends the program.

A frame is a head (kind, length, checksum, counter of its first sample, clock) and its contents; the first one describes
the record as write_record would. Nothing is written twice, so that a kill can cost the last frame alone.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array, Index
from stickslip.errors import FormatError
from stickslip.files.table import Block, Column, Options, Table
from stickslip.record.metadata import parse_metadata, units_of
from stickslip.record.record import Step

NAME = "journal"
SUFFIXES = (".journal",)

MAGIC = b"STICKSLIP JOURNAL 1\n"
HEAD = struct.Struct("<4sIIqd")  # kind, length of the contents, their checksum with the rest, counter, clock
ABOUT, DATA, MARK, DONE = b"ABOU", b"DATA", b"MARK", b"DONE"
TYPES = ("<f8", "<f4", "<i2", "<i4", "|i1", "|u1")
LARGEST = 1 << 26  # bytes of a frame


class Frame(NamedTuple):
    """Where the contents of a frame lie in the file, and what its head says."""

    kind: bytes
    at: int
    length: int
    first: int
    clock: float


class Journal:
    """A journal that is being written.

    Parameters
    ----------
    path : Path
        A file that is not there yet.
    about : mapping
        The record's description, as ``record_to_metadata`` gives it; with ``type``, of the numbers, and ``scales``.

    Raises
    ------
    FileExistsError
        The file is there.
    OSError
        The disk takes no more.
    """

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        self.path, self.type = path, np.dtype(about["type"])
        self.file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        self._put(MAGIC)
        self._frame(ABOUT, json.dumps(about).encode())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        """Close the file."""
        if self.file >= 0:
            os.close(self.file)
            self.file = -1

    def append(self, samples: NDArray[Any], *, first: int, clock: float) -> None:
        """Samples (channels, n), in order of time within the file; `first` counts them from the device's opening."""
        rows = np.ascontiguousarray(samples.T, dtype=self.type)
        self._frame(DATA, rows.tobytes(), first, clock)

    def tell(self, kind: bytes, contents: Mapping[str, Any], *, first: int = 0, clock: float = 0.0) -> None:
        """A mark, or how it ended."""
        self._frame(kind, json.dumps(contents).encode(), first, clock)

    def sync(self) -> None:
        """Have what was written stand on the disk itself, against a failure of power."""
        getattr(os, "fdatasync", os.fsync)(self.file)

    def _frame(self, kind: bytes, contents: bytes, first: int = 0, clock: float = 0.0) -> None:
        self._put(HEAD.pack(kind, len(contents), _sum(kind, contents, first, clock), first, clock) + contents)

    def _put(self, data: bytes) -> None:
        left = memoryview(data)
        while left:
            left = left[os.write(self.file, left) :]


def _sum(kind: bytes, contents: bytes, first: int, clock: float) -> int:
    return zlib.crc32(contents, zlib.crc32(HEAD.pack(kind, len(contents), 0, first, clock)))


def recognise(path: Path, head: bytes) -> bool:
    """By its first bytes."""
    return head.startswith(MAGIC)


def frames(path: Path) -> Iterator[tuple[Frame, bytes]]:
    """The frames that are whole, from the first to the first that is not."""
    with path.open("rb") as file:
        at = len(file.read(len(MAGIC)))
        while len(head := file.read(HEAD.size)) == HEAD.size:
            kind, length, checksum, first, clock = HEAD.unpack(head)
            contents = file.read(length) if length <= LARGEST else b""
            if len(contents) < length or _sum(kind, contents, first, clock) != checksum:
                return
            at += HEAD.size
            yield Frame(kind, at, length, first, clock), contents
            at += length


def read(path: Path, options: Options) -> Table:
    """Time and the channels, lost samples as NaN; its marks and its end in the history of the record."""
    about: dict[str, Any] = {}
    data: list[Frame] = []
    entries: list[tuple[Frame, Mapping[str, Any]]] = []
    end = 0
    for frame, contents in frames(path):
        end = frame.at + frame.length
        if frame.kind == DATA:
            data.append(frame)
        elif frame.kind == ABOUT:
            about = parse_metadata(contents)
        else:
            entries.append((frame, parse_metadata(contents)))
    kind, scales = _layout(path, about)
    names = [name for name in units_of(about) if name != about["time"]]
    width = kind.itemsize * len(names)
    firsts = np.array([frame.first for frame in data], dtype=np.int64)
    counts = np.array([frame.length // width for frame in data], dtype=np.int64)
    if not len(data) or np.any(firsts[1:] < (firsts + counts)[:-1]) or any(f.length % width for f in data):
        raise FormatError(
            f"'{path.name}' holds {'blocks that run back' if data else 'no sample yet'}",
            "a journal holds blocks of samples in the order of their counter",
            "acquire again",
        )
    rows = int(firsts[-1] + counts[-1] - firsts[0])
    cut = "" if any(frame.kind == DONE for frame, _ in entries) else "it was not closed: what came until then is there"
    record = _described(about, entries, int(firsts[0]), rows, cut)
    if rest := path.stat().st_size - end:
        cut = f"{cut}; its last {rest} bytes are no whole frame".removeprefix("; ")
    units, fs = units_of(record), float(about["fs"])
    columns = tuple(Column(name, unit, rows, fs, float(about["start"])) for name, unit in units.items())
    reader = _Reader(path, tuple(names), kind, scales, data, firsts, counts, fs, float(about["start"]))
    return Table(columns, reader.blocks, record=record, cut=cut)


class _Reader(NamedTuple):
    """The samples of a journal."""

    path: Path
    names: tuple[str, ...]
    kind: np.dtype[Any]
    scales: Array
    data: Sequence[Frame]
    firsts: Index
    counts: Index
    fs: float
    start: float

    def blocks(self, names: Sequence[str], size: int) -> Iterator[Block]:
        """Rows in turn; those that were lost are NaN."""
        begin, end = int(self.firsts[0]), int(self.firsts[-1] + self.counts[-1])
        frame = 0
        with self.path.open("rb") as file:
            for first in range(begin, end, size):
                last = min(first + size, end)
                rows = np.full((last - first, len(self.names)), np.nan)
                while frame < len(self.data) and self.firsts[frame] < last:
                    file.seek(self.data[frame].at)
                    raw = np.frombuffer(file.read(self.data[frame].length), self.kind).reshape(-1, len(self.names))
                    low, high = max(first, int(self.firsts[frame])), min(last, int(self.firsts[frame] + len(raw)))
                    taken = raw[low - int(self.firsts[frame]) : high - int(self.firsts[frame])]
                    np.multiply(taken, self.scales, out=rows[low - first : high - first])
                    if self.firsts[frame] + self.counts[frame] > last:
                        break  # its rest is of the next rows
                    frame += 1
                time = self.start + np.arange(first - begin, last - begin) / self.fs
                places = {name: place for place, name in enumerate(self.names)}
                yield {name: rows[:, places[name]].copy() if name in places else time for name in names}


def _layout(path: Path, about: Mapping[str, Any]) -> tuple[np.dtype[Any], Array]:
    """The type of the numbers and what one is worth in each channel."""
    try:
        kind, scales = str(about["type"]), np.array(about["scales"], dtype=np.float64)
        start, fs = float(about["start"]), float(about["fs"])
        fits = kind in TYPES and scales.shape == (len(about["channels"]),)
        whole = bool(np.all(np.isfinite([*scales, start, fs])) and fs > 0)
    except (KeyError, TypeError, ValueError) as error:
        raise _damaged(path, f"{type(error).__name__}: {str(error)[:80]}") from error
    if not (fits and whole):
        raise _damaged(path, f"numbers of type {kind[:10]}, {scales.size} scales")
    return np.dtype(kind), scales


def _damaged(path: Path, reason: str) -> FormatError:
    return FormatError(
        f"the description in '{path.name}' is damaged ({reason})", "a journal begins with one", "acquire again"
    )


def _described(
    about: Mapping[str, Any], entries: Sequence[tuple[Frame, Mapping[str, Any]]], begin: int, rows: int, cut: str
) -> dict[str, Any]:
    """The description of the record, with what was marked and how it ended."""
    history = list(about.get("history", ()))
    for frame, contents in entries:
        if frame.kind == MARK:
            time = float(about["start"]) + (frame.first - begin) / float(about["fs"])
            history.append(Step("mark", {"time": time}, str(contents.get("text", ""))).to_dict())
        else:
            history.append(Step("acquire: end", {}, str(contents.get("outcome", ""))).to_dict())
    if cut:
        history.append(Step("acquire: end", {}, cut).to_dict())
    kept = {name: value for name, value in about.items() if name not in ("type", "scales")}
    return {**kept, "history": history, "rows": rows, "sha256": None}
