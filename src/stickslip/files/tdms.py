"""TDMS, as LabVIEW and DAQmx log it: every channel is a column "Group/Channel", read in slices."""

from __future__ import annotations

import logging
import math
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import FormatError
from stickslip.files.table import Block, Column, Options, Table, optional, reading, unique

NAME = "TDMS"
SUFFIXES = (".tdms",)

LEAD_IN = 28  # bytes: tag, contents, version, length of the segment, length of its description
BIG_ENDIAN = 1 << 6
MOST_SCALES = 1000  # of one channel; npTDMS looks for as many as the file states, one by one
UNFINISHED = 0xFFFFFFFFFFFFFFFF
NOT_CLOSED = "the program that wrote the file stopped without closing it; its last values may be lost"


def recognise(path: Path, head: bytes) -> bool:
    """By the tag of the first segment."""
    return head.startswith(b"TDSm")


def read(path: Path, options: Options) -> Table:
    """The numeric channels, with the clock and unit that their waveform properties state."""
    notes: list[str] = []
    cut = NOT_CLOSED if _check_segments(path) else ""
    kept: dict[str, tuple[str, str]] = {}
    columns: list[Column] = []
    left_out: list[str] = []
    with _opened(path, notes) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        _check_scales(path, [file, *file.groups(), *channels])
        names = unique([f"{channel.group_name}/{channel.name}" for channel in channels])
        for name, channel in zip(names, channels, strict=True):
            if len(channel) == 0 or channel.dtype.kind not in "fiubM":
                reason = "raw DAQmx data without its scaling" if channel.dtype.kind == "V" else channel.dtype
                left_out.append(f"{name} ({reason if len(channel) else 'empty'})")
                continue
            kept[name] = (channel.group_name, channel.name)
            columns.append(_column(name, channel))
    if left_out:
        notes.append(f"not columns of numbers, left out: {', '.join(left_out)}")
    if not columns:
        raise FormatError(
            f"'{path.name}' holds no channel with numbers ({', '.join(left_out) or 'no channels at all'})",
            "a record needs at least one",
            "export the channels from the program that wrote the file",
        )
    lengths = {column.name: column.rows or 0 for column in columns}

    def blocks(names: Sequence[str], size: int) -> Iterator[Block]:
        rows = min((lengths[name] for name in names), default=0)
        origins: dict[str, np.datetime64] = {}
        with _opened(path, []) as file:
            for first in range(0, rows, size):
                count = min(size, rows - first)
                part = {}
                for name in names:
                    group, channel = kept[name]
                    values = file[group][channel].read_data(offset=first, length=count)
                    part[name] = _seconds(values, origins.setdefault(name, values[0]))
                    _require(path, name, len(part[name]) == count)
                yield part

    return Table(tuple(columns), blocks, notes=tuple(notes), cut=cut)


def _column(name: str, channel: Any) -> Column:
    properties = channel.properties
    step, offset = properties.get("wf_increment"), properties.get("wf_start_offset", 0.0)
    timed = _positive(step) and properties.get("wf_xunit_string", "s") in ("s", "")
    unit = properties.get("unit_string") or properties.get("NI_UnitDescription")
    if channel.dtype.kind == "M":
        return Column(name, "s", len(channel))
    start = float(offset) if isinstance(offset, (int, float)) and math.isfinite(offset) else 0.0
    rate = float(f"{1.0 / float(step):.12g}") if timed else None  # 1.9999999999999998e-05 s is 50 kHz
    return Column(name, str(unit) if unit else None, len(channel), rate, start)


def _check_scales(path: Path, objects: Sequence[Any]) -> None:
    for stated in (thing.properties.get("NI_Number_Of_Scales", 0) for thing in objects):
        if not isinstance(stated, (int, np.integer)) or not 0 <= stated <= MOST_SCALES:
            raise FormatError(
                f"'{path.name}' states {str(stated)[:20]} scales for a channel",
                f"a channel has at most {MOST_SCALES}",
                "the file is damaged: copy it again from its source",
            )


def _positive(step: object) -> bool:
    return isinstance(step, (int, float)) and math.isfinite(step) and step > 0


def _seconds(values: NDArray[Any], origin: Any) -> Array:
    """Numbers as they are; dates as seconds since the first."""
    if values.dtype.kind == "M":
        return np.asarray((values - origin) / np.timedelta64(1, "ns"), dtype=np.float64) * 1e-9
    return np.asarray(values, dtype=np.float64)


def _require(path: Path, name: str, whole: bool) -> None:
    if not whole:
        raise FormatError(
            f"channel '{name}' of '{path.name}' ends early",
            "the file promises more values than it holds",
            "copy the file again from its source",
        )


def _check_segments(path: Path) -> bool:
    """Walk the segments by the lengths they state; refuse a file that ends inside one. Whether the last is open.

    npTDMS reads what is left of a truncated file without saying so in its answer.
    """
    size, position = path.stat().st_size, 0
    with path.open("rb") as file:
        while position < size:
            file.seek(position)
            head = file.read(LEAD_IN)
            if len(head) < LEAD_IN or not head.startswith(b"TDSm"):
                raise _cut_off(path, position, size)
            order = ">" if struct.unpack("<I", head[4:8])[0] & BIG_ENDIAN else "<"
            length, description = struct.unpack(f"{order}QQ", head[12:28])
            if length == UNFINISHED and position + LEAD_IN + description < size:
                return True
            if position + LEAD_IN + length > size or description > length:
                raise _cut_off(path, position, size)
            position += LEAD_IN + length
    return False


def _cut_off(path: Path, position: int, size: int) -> FormatError:
    return FormatError(
        f"'{path.name}' is cut off or damaged: the segment at byte {position} does not end within its {size} bytes",
        "a TDMS file is read whole or not at all",
        "copy the file again from the machine that wrote it",
    )


@contextmanager
def _opened(path: Path, notes: list[str]) -> Iterator[Any]:
    """The file by npTDMS; what it doubts, as a last chunk with fewer values than it states, becomes notes.

    It is given the open file, not the path: an index file beside it might belong to another recording.
    """
    nptdms = optional("nptdms")
    doubts = _Doubts()
    with doubts, reading(path, NAME), path.open("rb") as handle, nptdms.TdmsFile.open(handle) as file:
        yield file
    notes += [f"npTDMS: {doubt}" for doubt in dict.fromkeys(doubts.said)]


class _Doubts(logging.Handler):
    """Listens to npTDMS's loggers, which otherwise write to the terminal."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []

    def emit(self, entry: logging.LogRecord) -> None:
        self.said.append(entry.getMessage())

    def __enter__(self) -> _Doubts:
        from nptdms.log import log_manager

        self.loggers = list(log_manager.loggers.values())
        self.console = log_manager.console_handler
        for logger in self.loggers:
            logger.removeHandler(self.console)
            logger.addHandler(self)
        return self

    def __exit__(self, *unused: object) -> None:
        for logger in self.loggers:
            logger.removeHandler(self)
            logger.addHandler(self.console)
