"""MDF 3 and 4, as drives and vehicles log: every group of channels has its own clock."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np

from stickslip.errors import FormatError
from stickslip.files.rosbag import Stream, joined
from stickslip.files.table import Budget, Options, Table, optional, reading

NAME = "MDF"
SUFFIXES = (".mf4", ".mdf", ".dat")
HEADER = 64  # bytes before it


def recognise(path: Path, head: bytes) -> bool:
    """By the mark at the start; a file that was not closed has another."""
    return head.startswith((b"MDF     ", b"UnFinMF "))


def read(path: Path, options: Options) -> Table:
    """The channels of numbers; those of slower groups are read as last heard."""
    streams, budget, cells = [], Budget.of(path), 0
    library = optional("asammdf", extra="mdf")
    with reading(path, NAME), _whole(path) as handle, library.MDF(handle) as file:
        for number, group in enumerate(file.groups):
            budget.require(cells := cells + group.channel_group.cycles_nr * len(group.channels))
            signals = [
                signal
                for place, channel in enumerate(group.channels)
                if place != file.masters_db.get(number)
                and (signal := file.get(channel.name, group=number, index=place)).samples.dtype.kind in "fiub"
                and signal.samples.ndim == 1
            ]
            if signals:
                columns = {one.name: np.asarray(one.samples, dtype=np.float64) for one in signals}
                units = {one.name: one.unit for one in signals if one.unit}
                name = group.channel_group.acq_name or f"group {number + 1}"
                times = np.asarray(signals[0].timestamps, dtype=np.float64)
                streams.append(Stream(name, times, columns, named=False, units=units))
    return joined(path, streams)


def _whole(path: Path) -> BinaryIO:
    """The file, unless its header points beyond its end (version 4): asammdf would fail on it twice, once unheard."""
    with path.open("rb") as file:
        head = file.read(1 << 12)[HEADER:]
    links = struct.iter_unpack("<Q", head[24 : 24 + 8 * min(int.from_bytes(head[16:24], "little"), 64)])
    if head.startswith(b"##HD") and any(link >= path.stat().st_size for (link,) in links):
        raise FormatError(
            f"'{path.name}' was cut off", "a file is read whole or not at all", "copy it again from its source"
        )
    return path.open("rb")
