"""A Record from a pandas DataFrame, an xarray Dataset or SDyPy's SEP 005 channel list.

What stickslip wrote comes back exactly: units, clock, history and truth travel beside the samples as JSON. What
others wrote comes in through the same door as a file: units are parsed, the clock is found in the time axis, and
the first Step of the history says where it came from.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import RecordError
from stickslip.record.channels import Channel
from stickslip.record.clock import Clock, fit_clock
from stickslip.record.metadata import (
    KEY,
    Digests,
    Log,
    labelled_arrays,
    parse_metadata,
    require_version,
    restored,
    trusting,
    units_of,
)
from stickslip.record.record import Record, StatedRig, Step
from stickslip.units import parse_unit

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


def from_pandas(
    frame: pd.DataFrame, *, fs: float | None = None, units: Mapping[str, str] | None = None, time: str | None = None
) -> Record:
    """A record from a DataFrame, of stickslip's making or anyone's.

    Parameters
    ----------
    frame : pandas.DataFrame
        One column a channel. The index is the clock: seconds, timedeltas or dates (then time counts from the
        first). Stamps that are not uniform are kept, for ``repair_clock``.
    fs : float, optional
        Sampling rate [Hz]; needed where the index only numbers the rows. It overrides the index.
    units : mapping of str to str, optional
        Unit of each column; otherwise from headers like "x [mm]", from ``attrs["units"]``, else SI.
    time : str, optional
        The column that holds the time, in place of the index.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        No clock, a column that is not numbers, an unknown unit.

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"x [mm]": [1.0, 2.0, 4.0]}, index=[0.0, 0.01, 0.02])
    >>> from_pandas(frame)
    Record(x [m]; 3 samples, 100 Hz, from 0 s)
    """
    import pandas as pd

    if not isinstance(frame, pd.DataFrame):
        raise _not_a("a pandas DataFrame", frame)
    if time is not None and time not in frame.columns:
        raise RecordError(
            f"there is no column '{time}'",
            "time= names a column",
            f"choose one of {', '.join(map(str, frame.columns))}",
        )
    axis: Any = frame.index if time is None else frame[time]
    numbered = time is None and isinstance(axis, pd.RangeIndex) and axis.name is None
    if not frame.columns.is_unique:
        raise RecordError("two columns have one name", "each column names a channel", "rename one of them")
    stated = frame.attrs.get("units")
    return _received(
        {str(name): frame[name].to_numpy() for name in frame.columns if name != time},
        None if numbered else _seconds("index" if time is None else time, axis.to_numpy()),
        fs=fs,
        units=units or {},
        stated={str(name): str(unit) for name, unit in stated.items()} if isinstance(stated, Mapping) else {},
        described=frame.attrs.get(KEY),
        step=Step("from_pandas", _stated(fs=fs, units=units, time=time)),
    )


def from_xarray(
    dataset: xr.Dataset | xr.DataArray, *, fs: float | None = None, units: Mapping[str, str] | None = None
) -> Record:
    """A record from an xarray Dataset or DataArray of one dimension, of stickslip's making or anyone's.

    Parameters
    ----------
    dataset : xarray.Dataset or xarray.DataArray
        Each variable is a channel; the dimension's coordinate is the clock (numbers in its ``units``, timedeltas
        or dates).
    fs : float, optional
        Sampling rate [Hz]; needed where the dimension has no coordinate.
    units : mapping of str to str, optional
        Unit of each variable, before its attribute ``units`` (or ``unit``).

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        Several dimensions, no clock, a variable that is not numbers, an unknown unit.

    Examples
    --------
    >>> import xarray as xr
    >>> data = xr.DataArray([1.0, 2.0, 4.0], coords={"t": [0.0, 1.0, 2.0]}, dims="t", name="x", attrs={"units": "mm"})
    >>> data["t"].attrs["units"] = "ms"
    >>> from_xarray(data)
    Record(x [m]; 3 samples, 1000 Hz, from 0 s)
    """
    xarray = labelled_arrays()
    if isinstance(dataset, xarray.DataArray):
        dataset = dataset.to_dataset(name=str(dataset.name or "value"), promote_attrs=False)
    if not isinstance(dataset, xarray.Dataset):
        raise _not_a("an xarray Dataset or DataArray", dataset)
    dimensions = {dimension for variable in dataset.data_vars.values() for dimension in variable.dims}
    if len(dimensions) != 1 or any(variable.ndim != 1 for variable in dataset.data_vars.values()):
        raise RecordError(
            f"the variables lie over {', '.join(sorted(map(str, dimensions))) or 'no dimension'}",
            "a record's channels lie over one dimension, time",
            "select along the others first, as in dataset.isel(...)",
        )
    axis = dimensions.pop()
    clock = dataset.coords[axis] if axis in dataset.indexes else None
    scale = 1.0 if clock is None else parse_unit(str(clock.attrs.get("units", "s")), expect="s").scale
    stated = {
        str(name): str(variable.attrs.get("units", variable.attrs.get("unit")))
        for name, variable in dataset.data_vars.items()
        if {"units", "unit"} & set(variable.attrs)
    }
    return _received(
        {str(name): variable.to_numpy() for name, variable in dataset.data_vars.items()},
        None if clock is None else _seconds(str(axis), clock.to_numpy(), scale),
        fs=fs,
        units=units or {},
        stated=stated,
        described=dataset.attrs.get(KEY),
        step=Step("from_xarray", _stated(fs=fs, units=units)),
    )


def from_sep005(channels: Sequence[Mapping[str, Any]] | Mapping[str, Any]) -> Record:
    """A record from SDyPy's unified time series (SEP 005), of stickslip's making or anyone's.

    Parameters
    ----------
    channels : sequence of dict, or one dict
        Each with ``name``, ``data`` (one-dimensional), ``unit_str`` (may be empty: SI) and ``fs`` [Hz] or
        ``time`` [s]; all on one clock, with one ``start_timestamp`` if any.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        A field is missing, or the channels have different clocks.

    Examples
    --------
    >>> from_sep005([{"name": "x", "data": [1.0, 2.0], "unit_str": "mm", "fs": 50}])
    Record(x [m]; 2 samples, 50 Hz, from 0 s)
    """
    channels = [channels] if isinstance(channels, Mapping) else list(channels)
    for number, channel in enumerate(channels):
        _check_sep005(number, channel)
    names = [str(channel["name"]) for channel in channels]
    if len(set(names)) < len(names):
        raise RecordError(f"the names are {', '.join(names)}", "SEP 005 asks for unique names", "rename a channel")
    begins = {_begin(channel) for channel in channels}
    clocks = {_clock_of(channel) for channel in channels}
    if len(begins) > 1 or len(clocks) != 1:
        raise RecordError(
            f"the {len(channels)} channels have {len(clocks)} clocks and {len(begins)} start times",
            "one record has one clock",
            "convert channels of one clock at a time and join them with synchronise",
        )
    time = channels[0].get("time")
    begin = begins.pop()
    return _received(
        {name: np.asarray(channel["data"]) for name, channel in zip(names, channels, strict=True)},
        None if time is None else _seconds("time", np.asarray(time)),
        fs=channels[0].get("fs") if time is None else None,
        units={},
        stated={str(c["name"]): str(c["unit_str"]) for c in channels if c.get("unit_str")},
        described=channels[0].get(KEY),
        step=Step("from_sep005", {"start_timestamp": begin} if begin else {}),
    )


def _check_sep005(number: int, channel: Mapping[str, Any]) -> None:
    missing = {"name", "data", "unit_str"} - set(channel)
    if missing or (channel.get("fs") is None and channel.get("time") is None):
        raise RecordError(
            f"channel {channel.get('name', number)} lacks {', '.join(sorted(missing)) or 'fs and time'}",
            "SEP 005 asks for name, data, unit_str, and fs or time",
            "add the field",
        )


def _clock_of(channel: Mapping[str, Any]) -> tuple[Any, ...]:
    time = channel.get("time")
    return channel.get("fs"), None if time is None else np.asarray(time).tobytes(), len(channel["data"])


def _begin(channel: Mapping[str, Any]) -> str:
    """The absolute start in ISO 8601, or nothing."""
    text, pattern = channel.get("start_timestamp"), channel.get("start_timestamp_format")
    if not text:
        return ""
    try:
        moment = datetime.strptime(str(text), str(pattern)) if pattern else datetime.fromisoformat(str(text))
    except ValueError as error:
        raise RecordError(
            f"start_timestamp '{text}' of channel {channel['name']} can not be read",
            "SEP 005 asks for ISO 8601, or a start_timestamp_format",
            "write it like 2023-06-29T15:00:00",
        ) from error
    return moment.isoformat()


# ---- what all three share


def _received(
    columns: Mapping[str, NDArray[Any]],
    axis: Array | None,
    *,
    fs: float | None,
    units: Mapping[str, str],
    stated: Mapping[str, str],
    described: Any,
    step: Step,
) -> Record:
    """The record exactly as it left, if it is still what it was; otherwise a new one, through the door.

    `units` are the user's, `stated` those that came with the data; both by column.
    """
    if unknown := set(units) - set(columns):
        raise RecordError(
            f"units= names {', '.join(sorted(unknown))}", "it names columns", f"choose among {', '.join(columns)}"
        )
    arrays = {name: _numbers(name, values) for name, values in columns.items()}
    metadata = parse_metadata(described) if isinstance(described, str) else {}
    if metadata and not units and fs in (None, metadata.get("fs")):
        record = _unchanged(metadata, arrays, stated, axis)
        if record is not None:
            return record
    return _anew(arrays, axis, fs, {**stated, **units}, metadata, step)


def _anew(
    arrays: Mapping[str, Array],
    axis: Array | None,
    fs: float | None,
    units: Mapping[str, str],
    metadata: Mapping[str, Any],
    step: Step,
) -> Record:
    """A new record of columns; `units` by column go before what their headers say ("x [mm]")."""
    headers = {name: re.fullmatch(r"(.*?)\s*\[([^\]]*)\]\s*", name) for name in arrays}
    names = {name: _identifier(match[1] if match else name) for name, match in headers.items()}
    chosen = {name: match[2] for name, match in headers.items() if match} | dict(units)
    _require_distinct(names)
    _require_one_length(arrays, axis)
    clock = _clock(axis, fs)
    record = Record.of(
        {names[column]: values for column, values in arrays.items()},
        fs=clock.fs,
        units={names[column]: chosen[column] for column in arrays if column in chosen},
        start=clock.start,
    )
    sources = {names[column]: f"{column} [{chosen.get(column, 'SI')}]" for column in arrays}
    sources |= {names[column]: column for column, match in headers.items() if match}
    outcome = f"{len(arrays)} channels of {len(record)} samples at {record.fs:g} Hz"
    if clock.stamps is not None:
        outcome += "; the time stamps are not uniform and were kept"
    outcome += "; not as it left stickslip: rows, samples or units were changed" if metadata else ""
    before = history_of(metadata) if metadata else ()
    return replace(
        record,
        channels={name: replace(channel, source=sources[name]) for name, channel in record.channels.items()},
        stamps=clock.stamps,
        history=(*before, Step(step.action, step.arguments, outcome)),
    )


def _require_distinct(names: Mapping[str, str]) -> None:
    if len(set(names.values())) < len(names):
        raise RecordError(
            f"columns {', '.join(names)} give channels {', '.join(names.values())}",
            "channels have different names of letters, digits and _",
            "rename the columns",
        )


def _require_one_length(arrays: Mapping[str, Array], axis: Array | None) -> None:
    lengths = {len(values) for values in arrays.values()} | ({len(axis)} if axis is not None else set())
    if len(lengths) > 1:
        raise RecordError(
            f"columns and time axis have {', '.join(map(str, sorted(lengths)))} values",
            "one record has one clock",
            "cut them to the same rows",
        )


def _unchanged(
    metadata: Mapping[str, Any], arrays: Mapping[str, Array], stated: Mapping[str, str], axis: Array | None
) -> Record | None:
    """The record that was described, where channels, units, samples and clock are still its own."""
    units = units_of(metadata)
    *channels, time = units
    columns = dict(arrays) if axis is None else {**arrays, time: axis}
    relabelled = any(units[name] != stated.get(name, units[name]) for name in channels)
    if channels != list(arrays) or relabelled or Digests(columns).changed(metadata):
        return None
    return None if axis is None and metadata.get("stamps") else metadata_to_record(metadata, columns)


def _clock(axis: Array | None, fs: float | None) -> Clock:
    if fs is not None:
        if isinstance(fs, bool) or not isinstance(fs, (int, float, np.number)):
            raise RecordError(f"fs = {fs!r}", "a sampling rate is a number in Hz", "pass fs= in Hz")
        return Clock(float(fs), 0.0 if axis is None or not len(axis) else float(axis[0]))
    if axis is None:
        raise RecordError(
            "the rows are numbered, not timed", "a record has a sampling rate", "pass fs= in Hz, or give a time axis"
        )
    return fit_clock(axis)


def _numbers(name: str, values: NDArray[Any]) -> Array:
    if values.dtype.kind not in "fiubO" or values.ndim != 1:
        raise RecordError(
            f"column '{name}' holds {values.dtype} of shape {values.shape}",
            "a channel is one row of real numbers",
            "leave it out or convert it",
        )
    try:
        return values.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise RecordError(
            f"column '{name}' holds values that are not numbers ({error})",
            "a channel is one row of real numbers",
            "leave it out or convert it",
        ) from error


def _seconds(name: str, values: NDArray[Any], scale: float = 1.0) -> Array:
    """A time axis in seconds; dates count from the first."""
    if values.dtype.kind == "M" and len(values):
        return np.asarray((values - values[0]) / np.timedelta64(1, "ns"), dtype=np.float64) * 1e-9
    if values.dtype.kind == "m":
        return np.asarray(values / np.timedelta64(1, "ns"), dtype=np.float64) * 1e-9
    return _numbers(name, values) * scale


def _identifier(name: str) -> str:
    """`name` as a channel's name: letters, digits and _."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", name.strip()).strip("_") or "channel"
    return f"_{name}" if name[0].isdigit() else name


def _stated(**arguments: Any) -> dict[str, Any]:
    """The arguments that were given, for the history."""
    stated = {key: value for key, value in arguments.items() if value is not None}
    return {key: dict(value) if isinstance(value, Mapping) else value for key, value in stated.items()}


def _not_a(wanted: str, value: object) -> RecordError:
    return RecordError(f"what was given is of type {type(value).__name__}", f"this reads {wanted}", "convert it first")


def metadata_to_record(metadata: Mapping[str, Any], samples: Mapping[str, Array], first: int = 0) -> Record:
    """The record that `metadata` and the samples tell.

    The samples begin at row `first`, and include the time column where stamps were kept.

    Raises
    ------
    FormatError
        The metadata is of a later version, damaged, or does not fit the samples.
    """
    with trusting():
        require_version(metadata)
        channels = {entry["name"]: Channel(**restored(entry)) for entry in metadata["channels"]}
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
            restored(metadata["truth"]),
            StatedRig(**restored(rig)) if (rig := metadata.get("rig")) else None,
            Log.of(log) if (log := metadata.get("log")) is not None else None,
        )


def history_of(metadata: Mapping[str, Any]) -> tuple[Step, ...]:
    """The history that the metadata tells; empty where there is none."""
    with trusting():
        steps = tuple(Step(**restored(step)) for step in metadata.get("history", ()))
        for step in steps:
            for file in step.arguments.get("files", ()):
                if not isinstance(file["name"], str):
                    raise TypeError("a file without name")
        return steps
