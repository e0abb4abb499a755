"""What a Record says of itself beside its samples: what was written down of the run, and one JSON text in every file.

The log holds the surface and what was done to it, the air, the load, a remark. Also a Record as the tables of others:
of pandas a DataFrame, of xarray a Dataset, of SDyPy the SEP 005 channel list; :mod:`stickslip.record.exchange` is the
way back.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import FormatError, RecordError, package
from stickslip.record.channels import Channel
from stickslip.units import parse_value

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from stickslip.record.record import Record

ZERO_CELSIUS = 273.15  # K
NUMBERS = {"run_in": "1", "temperature": "K", "humidity": "1", "normal": "N"}  # unit of those that are no words
TITLES = {
    "surface": "Surfaces", "lubrication": "Lubrication", "run_in": "Run-in cycles", "cleaning": "Cleaning",
    "temperature": "Temperature", "humidity": "Relative humidity", "normal": "Normal load", "operator": "Operator",
    "remark": "Remark", "photo": "Photo",
}  # fmt: skip

VERSION = 1
KEY = "stickslip record"  # of the HDF5 attribute, the Parquet entry, and the file beside a CSV
BEGINS = f'{{"{KEY}": '
OF, BEFORE = "of", "before"  # while a text file is replaced: the new one's checksum, and what was told of the old one
LONGEST = 1 << 26  # bytes of a description in a file of its own


@dataclass(frozen=True)
class Log:
    """The log of an experiment: what no sensor reads, and friction depends on.

    Every entry may be left out. Numbers may be given as text with their unit.

    Attributes
    ----------
    surface : str
        Materials and finish ("steel on steel, ground, 400-grit paper").
    lubrication : str
        "dry", or the lubricant.
    run_in : float or None
        Cycles of sliding before the measurement.
    cleaning : str
        How the surfaces were cleaned.
    temperature : float or None
        Of the contact or the air around it [K]; "23 °C" is understood.
    humidity : float or None
        Relative humidity of the air, from 0 to 1; "45 %" is understood.
    normal : float or None
        Normal load [N].
    operator, remark : str
        Who measured, and what they saw.
    photo : str
        Name of a picture's file; it is not opened.

    Raises
    ------
    RecordError
        A value without meaning.

    Examples
    --------
    >>> log = Log(surface="steel on steel", temperature="23 °C", humidity="45 %", run_in=9000)
    >>> log.temperature, log.humidity
    (296.15, 0.45)
    >>> dict(log.rows())["Temperature"]
    '23 °C'
    """

    surface: str = ""
    lubrication: str = ""
    run_in: float | str | None = None
    cleaning: str = ""
    temperature: float | str | None = None
    humidity: float | str | None = None
    normal: float | str | None = None
    operator: str = ""
    remark: str = ""
    photo: str = ""

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            if name in NUMBERS:
                object.__setattr__(self, name, None if value is None else _number(name, value))
            elif not isinstance(value, str):
                raise RecordError(f"{name} = {value!r} in the log", "it is told in words", "pass a text")

    @classmethod
    def of(cls, entries: Mapping[str, Any]) -> Log:
        """The log with these entries by name.

        Raises
        ------
        RecordError
            An entry that a log does not have, or a value without meaning.
        """
        known = [field.name for field in fields(cls)]
        if strange := [str(name) for name in entries if name not in known]:
            raise RecordError(f"'{strange[0][:40]}' in the log", f"a log has {', '.join(known)}", "choose one of them")
        return cls(**entries)

    def entries(self) -> dict[str, Any]:
        """What was written down, by name."""
        empty = Log()
        named = {field.name: getattr(self, field.name) for field in fields(self)} if self != empty else {}
        return {name: value for name, value in named.items() if value not in ("", None)}

    def rows(self) -> list[tuple[str, str]]:
        """What was written down, as a person reads it: title and value."""
        return [(TITLES[name], _text(name, value)) for name, value in self.entries().items()]


def _number(name: str, value: Any) -> float:
    step = f"correct {name} of the log"
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise RecordError(f"{name} = {value!r} in the log", "it is a number, or a text with its unit", step)
    number = parse_value(value, NUMBERS[name])
    if not (math.isfinite(number) and number >= 0 and (name != "humidity" or number <= 1)):
        rule = "relative humidity is from 0 to 100 %" if name == "humidity" else "it is finite and not below zero"
        raise RecordError(f"{name} = {value!r} in the log", rule, step)
    return number


def _text(name: str, value: Any) -> str:
    match name:
        case "temperature":
            return f"{value - ZERO_CELSIUS:.4g} °C"
        case "humidity":
            return f"{100 * value:.3g} %"
        case "normal":
            return f"{value:.4g} N"
        case "run_in":
            return f"{value:.10g}"
    return str(value)


def described_beside(path: Path) -> Path:
    """The file that holds what a text file can not: ``slide.csv.json`` beside ``slide.csv``."""
    return path.with_name(f"{path.name}.json")


def read_beside(path: Path) -> dict[str, Any]:
    """What stands in the file beside a text file; nothing where there is none, or one of somebody else's.

    While a text file is replaced, what is told of the old one stands there too: its bytes say which one it is.
    """
    beside = described_beside(path)
    if not beside.is_file():
        return {}
    with beside.open("rb") as file:
        if file.read(len(BEGINS)) != BEGINS.encode():
            return {}
        file.seek(0)
        metadata = parse_metadata(file.read(LONGEST))
    about = metadata.get(KEY)
    if BEFORE in metadata:
        about = about if checksum(path) == metadata.get(OF) else metadata[BEFORE]
    return about if isinstance(about, dict) else {}


def checksum(path: Path) -> str:
    """The sha256 of a file's bytes, by which a record's history knows it again.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    str
        In hexadecimal digits.

    Raises
    ------
    OSError
        The file can not be read.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.NamedTemporaryFile() as file:
    ...     checksum(Path(file.name))[:8]
    'e3b0c442'
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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
        "sha256": Digests({time_column(record): record.time, **record.samples}).sums(),
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

    def sums(self) -> dict[str, str]:
        """The digests in hexadecimal, by column."""
        return {name: total.hexdigest() for name, total in self._sums.items()}

    def changed(self, metadata: Mapping[str, Any]) -> list[str]:
        """The columns whose numbers are not those that the metadata tells; a journal's frames have their own sums."""
        with trusting():
            if metadata["sha256"] is None:
                return []
            return [name for name, digest in self.sums().items() if metadata["sha256"].get(name) != digest]


def time_column(record: Record) -> str:
    """The name under which time is written beside the channels."""
    name, number = "time", 1
    while name in record.samples:
        number += 1
        name = f"time_{number}"
    return name


def stated_channels(metadata: Mapping[str, Any]) -> dict[str, Channel]:
    """The channels that were written, by name; none without metadata."""
    with trusting():
        return {entry["name"]: Channel(**restored(entry)) for entry in metadata.get("channels", ())}


def units_of(metadata: Mapping[str, Any]) -> dict[str, str]:
    """The columns that were written, the channels and then time, each with its unit.

    Raises
    ------
    FormatError
        The metadata is of a later version or damaged.
    """
    with trusting():
        require_version(metadata)
        units = {str(entry["name"]): str(entry["unit"]) for entry in metadata["channels"]}
        return {**units, str(metadata["time"]): "s"}


def require_columns(metadata: Mapping[str, Any], there: Collection[str]) -> None:
    """Refuse a file that lacks a column which its description names."""
    missing = [name[:40] for name in units_of(metadata) if name not in there]
    if missing:
        raise FormatError(
            f"the description of the record is damaged (it names {', '.join(missing)})",
            f"the file has the columns {', '.join(there)}",
            "write the file again from its source",
        )


def require_rows(metadata: Mapping[str, Any], rows: int) -> None:
    """Refuse a file that was cut short: its last number may be cut too."""
    if metadata.get("rows") != rows:
        raise FormatError(
            f"{rows} rows where the description of the record says {str(metadata.get('rows'))[:20]}",
            "a file written by write_record is whole",
            "copy it again, or read what is there by naming channels=",
        )


def require_version(metadata: Mapping[str, Any]) -> None:
    if metadata["version"] != VERSION:
        raise FormatError(
            f"the file is of version {str(metadata['version'])[:20]}",
            f"this program reads version {VERSION}",
            "update stickslip",
        )


@contextmanager
def trusting() -> Iterator[None]:
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


def restored(value: Any) -> Any:
    if isinstance(value, dict):
        if list(value) == ["__tuple__"]:
            return tuple(restored(item) for item in value["__tuple__"])
        return {key: restored(item) for key, item in value.items()}
    return [restored(item) for item in value] if isinstance(value, list) else value


# ---- to the tables of others


def to_pandas(record: Record) -> pd.DataFrame:
    """The record as a DataFrame: one column a channel [SI], indexed by time [s].

    Parameters
    ----------
    record : Record
        The record; its history, units and clock go into ``.attrs``.

    Returns
    -------
    pandas.DataFrame
        n rows; ``attrs["units"]`` maps columns to units, and :func:`from_pandas` gives the record back exactly.

    Examples
    --------
    >>> from stickslip.record.exchange import from_pandas
    >>> from stickslip.record.record import Record
    >>> record = Record.of({"x": [0.0, 1.0, 3.0]}, fs=10.0, units={"x": "mm"})
    >>> frame = to_pandas(record)
    >>> frame.attrs["units"], from_pandas(frame).equals(record)
    ({'x': 'm'}, True)
    """
    import pandas as pd

    frame = pd.DataFrame(dict(record.samples), index=pd.Index(record.time, name="time"), copy=True)
    frame.attrs = {"units": {name: channel.unit for name, channel in record.channels.items()}, KEY: _described(record)}
    return frame


def to_xarray(record: Record) -> xr.Dataset:
    """The record as an xarray Dataset over the coordinate ``time`` [s].

    Parameters
    ----------
    record : Record
        The record.

    Returns
    -------
    xarray.Dataset
        One variable a channel with attributes ``units`` and ``long_name``; :func:`from_xarray` gives the record
        back exactly. (Arithmetic in xarray does not carry units: "m" squared stays "m".)

    Examples
    --------
    >>> from stickslip.record.exchange import from_xarray
    >>> from stickslip.record.record import Record
    >>> record = Record.of({"x": [0.0, 1.0, 3.0]}, fs=10.0, units={"x": "mm"})
    >>> dataset = to_xarray(record)
    >>> dataset["x"].attrs["units"], from_xarray(dataset).equals(record)
    ('m', True)
    """
    xarray = labelled_arrays()
    axis = time_column(record)
    variables = {
        name: (axis, values.copy(), {"units": record.channels[name].unit, "long_name": record.channels[name].quantity})
        for name, values in record.samples.items()
    }
    dataset: xr.Dataset = xarray.Dataset(variables, coords={axis: (axis, np.array(record.time), {"units": "s"})})
    dataset.attrs = {"fs": record.fs, KEY: _described(record)}
    return dataset


def to_sep005(record: Record) -> list[dict[str, Any]]:
    """The record as SDyPy's unified time series (SEP 005): one dictionary a channel.

    Parameters
    ----------
    record : Record
        The record.

    Returns
    -------
    list of dict
        ``name``, ``data`` [SI], ``unit_str``, ``fs`` [Hz] (or ``time`` [s] where the clock is broken), and what
        :func:`from_sep005` needs to give the record back exactly.

    Examples
    --------
    >>> from stickslip.record.exchange import from_sep005
    >>> from stickslip.record.record import Record
    >>> record = Record.of({"x": [0.0, 1.0, 3.0]}, fs=10.0, units={"x": "mm"})
    >>> [channel["unit_str"] for channel in to_sep005(record)], from_sep005(to_sep005(record)).equals(record)
    (['m'], True)
    """
    described = _described(record)
    clock: dict[str, Any] = {"fs": record.fs} if record.stamps is None else {"time": record.stamps.copy()}
    return [
        {
            "name": name,
            "data": values.copy(),
            "unit_str": record.channels[name].unit,
            **clock,
            "quantity": record.channels[name].quantity,
            KEY: described,
        }
        for name, values in record.samples.items()
    ]


def _described(record: Record) -> str:
    return json.dumps(record_to_metadata(record))


def labelled_arrays(asker: str = "to_xarray and from_xarray") -> Any:
    """The package xarray, or a refusal that says how to get it."""
    return package("xarray", extra="io", rule=f"{asker} need it", error=FormatError)
