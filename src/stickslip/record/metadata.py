"""What a Record says of itself beside its samples: one JSON text, the same in every file and exchange format."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import FormatError
from stickslip.record.channels import Channel
from stickslip.record.log import Log
from stickslip.record.record import Record, StatedRig, Step

Array = NDArray[np.float64]

VERSION = 1
KEY = "stickslip record"  # of the HDF5 attribute and the Parquet entry; begins the CSV comment


def record_to_metadata(record: Record) -> dict[str, Any]:
    """Everything of the record but its samples, as plain data for JSON."""
    return {
        "version": VERSION,
        "fs": record.fs,
        "start": record.start,
        "rows": len(record),
        "time": time_column(record),
        "stamps": record.stamps is not None,
        "channels": [_plain(vars(channel)) for channel in record.channels.values()],
        "history": [_plain(step.to_dict()) for step in record.history],
        "truth": _plain(record.truth),
        "rig": None if record.rig is None else _plain(vars(record.rig)),
        "log": None if record.log is None else record.log.entries(),
        "sha256": Digests({time_column(record): record.time, **record.samples}).told(),
    }


class Digests:
    """The sha256 of each column's numbers, row after row: whether samples are still those that were described."""

    def __init__(self, columns: Mapping[str, Array] | None = None) -> None:
        self._sums: dict[str, hashlib._Hash] = {}
        self.add(columns or {})

    def add(self, columns: Mapping[str, Array]) -> None:
        """Go on with the next rows."""
        for name, values in columns.items():
            # one bit pattern for each number: NaN has many, zero has two
            same = np.where(np.isnan(values), np.nan, np.asarray(values, dtype="<f8") + 0.0)
            self._sums.setdefault(name, hashlib.sha256()).update(same.tobytes())

    def told(self) -> dict[str, str]:
        """The digests in hexadecimal, by column."""
        return {name: total.hexdigest() for name, total in self._sums.items()}

    def changed(self, metadata: Mapping[str, Any]) -> list[str]:
        """The columns whose numbers are not those that the metadata tells; a journal's frames have their own sums."""
        with _trusting():
            if metadata["sha256"] is None:
                return []
            return [name for name, digest in self.told().items() if metadata["sha256"].get(name) != digest]


def time_column(record: Record) -> str:
    """The name under which time is written beside the channels."""
    name, number = "time", 1
    while name in record.samples:
        number += 1
        name = f"time_{number}"
    return name


def metadata_to_record(metadata: Mapping[str, Any], samples: Mapping[str, Array], first: int = 0) -> Record:
    """The record that `metadata` and the samples tell.

    The samples begin at row `first`, and include the time column where stamps were kept.

    Raises
    ------
    FormatError
        The metadata is of a later version, damaged, or does not fit the samples.
    """
    with _trusting():
        _require_version(metadata)
        channels = {entry["name"]: Channel(**_restored(entry)) for entry in metadata["channels"]}
        if not isinstance(metadata["stamps"], bool):
            raise TypeError("stamps are kept or not")
        stamps = samples[metadata["time"]] if metadata["stamps"] else None
        start = float(metadata["start"])
        if first:
            start = start + first / float(metadata["fs"]) if stamps is None else float(stamps[0])
        return Record(
            {name: samples[name] for name in channels},
            channels,
            float(metadata["fs"]),
            start,
            history_of(metadata),
            stamps,
            _restored(metadata["truth"]),
            StatedRig(**_restored(rig)) if (rig := metadata.get("rig")) else None,
            Log.of(log) if (log := metadata.get("log")) is not None else None,
        )


def channels_told(metadata: Mapping[str, Any]) -> dict[str, Channel]:
    """The channels that were written, by name; none without metadata."""
    with _trusting():
        return {entry["name"]: Channel(**_restored(entry)) for entry in metadata.get("channels", ())}


def units_told(metadata: Mapping[str, Any]) -> dict[str, str]:
    """The columns that were written, the channels and then time, each with its unit.

    Raises
    ------
    FormatError
        The metadata is of a later version or damaged.
    """
    with _trusting():
        _require_version(metadata)
        units = {str(entry["name"]): str(entry["unit"]) for entry in metadata["channels"]}
        return {**units, str(metadata["time"]): "s"}


def require_columns(metadata: Mapping[str, Any], there: Collection[str]) -> None:
    """Refuse a file that lacks a column which its description names."""
    missing = [name[:40] for name in units_told(metadata) if name not in there]
    if missing:
        raise FormatError(
            f"the description of the record is damaged (it names {', '.join(missing)})",
            f"the file has the columns {', '.join(there)}",
            "write the file again from its source",
        )


def require_rows(metadata: Mapping[str, Any], found: int) -> None:
    """Refuse a file that was cut short: its last number may be cut too."""
    if metadata.get("rows") != found:
        raise FormatError(
            f"{found} rows where the description of the record says {str(metadata.get('rows'))[:20]}",
            "a file written by write_record is whole",
            "copy it again, or read what is there by naming channels=",
        )


def history_of(metadata: Mapping[str, Any]) -> tuple[Step, ...]:
    """The history that the metadata tells; empty where there is none."""
    with _trusting():
        steps = tuple(Step(**_restored(step)) for step in metadata.get("history", ()))
        for step in steps:
            for file in step.arguments.get("files", ()):
                if not isinstance(file["name"], str):
                    raise TypeError("a file without name")
        return steps


def _require_version(metadata: Mapping[str, Any]) -> None:
    if metadata["version"] != VERSION:
        raise FormatError(
            f"the file is of version {str(metadata['version'])[:20]}",
            f"this program reads version {VERSION}",
            "update stickslip",
        )


@contextmanager
def _trusting() -> Iterator[None]:
    """Around the use of a description: what does not fit becomes one sentence."""
    try:
        yield
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise FormatError(
            f"the description of the record is damaged ({type(error).__name__}: {str(error)[:80]})",
            "a record that stickslip wrote tells its channels, clock and history",
            "write it again from its source",
        ) from error


def parse_metadata(text: str | bytes) -> dict[str, Any]:
    """Read the JSON text; FormatError where it is damaged."""
    try:
        metadata = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(
            f"the description of the record is damaged ({str(error)[:80]})",
            "a file written by write_record carries it as JSON",
            "write the file again from its source",
        ) from error
    return metadata if isinstance(metadata, dict) else {}


def _plain(value: Any) -> Any:
    """JSON has no tuples, and its numbers no numpy type."""
    match value:
        case Mapping():
            return {str(key): _plain(item) for key, item in value.items()}
        case tuple():
            return {"__tuple__": [_plain(item) for item in value]}
        case list():
            return [_plain(item) for item in value]
        case np.ndarray() | np.generic():
            return _plain(value.tolist())
        case None | bool() | int() | float() | str():
            return value
    return str(value)


def _restored(value: Any) -> Any:
    if isinstance(value, dict):
        if list(value) == ["__tuple__"]:
            return tuple(_restored(item) for item in value["__tuple__"])
        return {key: _restored(item) for key, item in value.items()}
    return [_restored(item) for item in value] if isinstance(value, list) else value
