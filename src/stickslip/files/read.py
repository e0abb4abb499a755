"""read_record and read_blocks: which format a file is of, and which of its columns are wanted."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np

from stickslip.errors import FormatError, RecordError
from stickslip.files.reading import ROWS_AT_ONCE, Reading, quietly
from stickslip.files.select import Columns, Source, TimeColumn, Wanted, titled
from stickslip.files.table import Budget, Options
from stickslip.record.record import Record

# Asked in this order whether a file is theirs; each is a module beside this one, imported when it is its turn.
FORMATS = ("journal", "tdms", "matlab", "hdf5", "parquet", "uff", "audio", "lvm", "json_table", "text")

HEAD = 1 << 16  # bytes shown to `recognise`


def read_record(
    path: str | Path | Sequence[str | Path],
    *,
    channels: Mapping[str, str] | None = None,
    fs: float | None = None,
    units: Mapping[str, str] | None = None,
    time: str | None = None,
    rows: tuple[int | None, int | None] | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Record:
    """Read a file, or several on one clock, as a Record in SI.

    Formats: CSV and other text, MATLAB v5 to v7.3, TDMS, UFF 58, WAV/FLAC/OGG, HDF5, Parquet, LVM, JSON, the journal of
    `stickslip acquire`. A file
    that write_record wrote, read without arguments, is the same record again, history included.

    Parameters
    ----------
    path : str, Path or sequence of these
        The file, or files that share a clock (equal time stamps within their rounding).
    channels : mapping of str to str, optional
        For each channel the column it comes from: ``"qm [m]"``, ``"vir * 35.1507 [N]"``,
        ``"-200 * (F + 0.115) [N]"``, ```"`Servo motor speed` * -20/60/1000 [m/s]"``` (backticks around names
        that are not one word), ``"#3 [mm]"`` (the third column), ``"ch1 [V] @ 500 mV/lbf"`` (a sensor's
        sensitivity), ``"base.csv:x [mm]"`` (a column that several files have). Without it every column becomes a
        channel, under a name of the vocabulary where name and unit fit one.
    fs : float, optional
        Sampling rate [Hz]; overrides the file's time column.
    units : mapping of str to str, optional
        Units of channels, or of columns by any of their names (``"#1"``), for which neither the file nor `channels`
        states one. SI is assumed, and said in the channel's source, where nobody states a unit.
    time : str, optional
        The time column, with its unit where it is not s: ``"#1 [ms]"``. Otherwise recognised by name.
    rows : (int or None, int or None), optional
        The rows to keep, as in a slice: ``(15, None)`` drops the first fifteen.
    delimiter, decimal : str, optional
        Of a text file, where they are mistaken otherwise.

    Returns
    -------
    Record
        With ``stamps`` where the time column is not uniform within its own rounding. The history names each
        file with its sha256.

    Raises
    ------
    FormatError
        The file is missing, empty, damaged, of no known format, or would become out of proportion to its size.
    RecordError
        A column, unit or clock is missing or contradicts the others.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import stickslip as ss
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "rig.csv")
    ...     _ = path.write_text("t [ms];x [mm];cell [V]\\n0;1,5;0,1\\n4;1,6;0,3\\n8;1,4;0,2\\n")
    ...     record = ss.read_record(path, channels={"x": "x", "load": "cell @ 500 mV/N"})
    >>> record
    Record(x [m], load [N]; 3 samples, 250 Hz, from 0 s)
    """
    asked = _open(path, channels, fs, units, time, rows, Options(delimiter, decimal))
    try:
        return asked.whole()
    except MemoryError as error:
        raise RecordError(
            f"{asked.names} does not fit in memory",
            "a Record holds all its samples",
            "name fewer channels=, or go through the file with read_blocks()",
        ) from error


def read_blocks(
    path: str | Path | Sequence[str | Path],
    *,
    size: int = ROWS_AT_ONCE,
    channels: Mapping[str, str] | None = None,
    fs: float | None = None,
    units: Mapping[str, str] | None = None,
    time: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Iterator[Record]:
    """Read files that are larger than memory as a sequence of Records, each of at most `size` rows.

    CSV, WAV, HDF5, Parquet and TDMS are streamed; the other formats are held in memory once.

    Parameters
    ----------
    path : str, Path or sequence of these
        As in read_record.
    size : int, optional
        Rows of each Record; the last may have fewer.
    channels, fs, units, time, delimiter, decimal
        As in read_record. The sampling rate is found from the first block.

    Returns
    -------
    iterator of Record
        In order; ``start`` continues from block to block.

    Raises
    ------
    FormatError, RecordError
        As read_record, with the block at fault.

    Examples
    --------
    >>> import tempfile
    >>> import stickslip as ss
    >>> record = ss.Record.of({"a": range(10)}, fs=2.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = ss.write_record(record, folder + "/long.csv")
    ...     [(block.start, len(block)) for block in ss.read_blocks(path, size=4)]
    [(0.0, 4), (2.0, 4), (4.0, 2)]
    """
    if size < 1:
        raise RecordError(f"size = {size} rows", "a block has at least one row", "pass a larger size=")
    return _open(path, channels, fs, units, time, None, Options(delimiter, decimal)).blocks(size)


def _open(
    path: str | Path | Sequence[str | Path],
    channels: Mapping[str, str] | None,
    fs: float | None,
    units: Mapping[str, str] | None,
    time: str | None,
    rows: tuple[int | None, int | None] | None,
    options: Options,
) -> Reading:
    paths = [Path(path)] if isinstance(path, (str, Path)) else [Path(one) for one in path]
    if not paths:
        raise FormatError("no file is named", "a record is read from one file or several", "pass a path")
    if fs is not None and not (np.isfinite(fs) and fs > 0):
        raise RecordError(f"fs = {fs} Hz", "a sampling rate is positive and finite", "pass fs= in Hz")
    sources = tuple(_source(one, options) for one in paths)
    columns = Columns(sources, units, channels or ())
    times = columns.time(time) if fs is None or time is not None else {}
    notes = [note for source in sources for note in source.table.notes]
    if channels is not None:
        wanted = columns.asked(channels)
        _require_equal_length(columns, wanted, times if fs is None else {})
    else:
        wanted, more = columns.every(times)
        notes += more
    notes += columns.notes
    columns.check_units([one.channel.name for one in wanted])
    if not wanted:
        raise RecordError(
            f"{', '.join(one.name for one in paths)} has no column beside time",
            "a record needs one channel at least",
            "check the file, or name columns in channels=",
        )
    said = {
        "channels": dict(channels) if channels is not None else None,
        "fs": fs,
        "units": dict(units) if units else None,
        "time": time,
        "rows": list(rows) if rows is not None else None,
        "delimiter": options.delimiter,
        "decimal": options.decimal,
    }
    arguments = {name: value for name, value in said.items() if value is not None}
    return Reading(sources, tuple(wanted), times, fs, rows or (None, None), arguments, tuple(notes))


def _source(path: Path, options: Options) -> Source:
    """Find the format of a file and open its table."""
    try:
        if not path.is_file():
            raise FormatError(f"there is no file '{path}'", "a record is read from a file", "check the path")
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(HEAD)
    except (OSError, ValueError) as error:
        raise FormatError(
            f"'{path}' can not be opened ({error})", "the file can be read", "check path and rights"
        ) from error
    if not size:
        raise FormatError(f"'{path.name}' is empty", "a record has rows of numbers", "copy or record the file again")
    for name in FORMATS:
        room = importlib.import_module(f"stickslip.files.{name}")
        if room.recognise(path, head):
            with quietly(path):
                table = room.read(path, options)
                Budget.of(path).require_columns(len(table.columns))
                return Source(path, room.NAME, titled(table), size)
    raise FormatError(
        f"'{path.name}' is of no known format",
        f"these are read: {', '.join(_room(name).NAME for name in FORMATS)}",
        "export it as CSV, HDF5 or MATLAB",
    )


def _room(name: str) -> ModuleType:
    return importlib.import_module(f"stickslip.files.{name}")


def _require_equal_length(columns: Columns, wanted: Sequence[Wanted], times: Mapping[int, TimeColumn]) -> None:
    """Refuse columns whose length or rate the format states to differ."""
    keys = [key for one in wanted for key in one.scales]
    keys += [times[number].key for number in dict.fromkeys(number for number, _ in keys) if number in times]
    for number in dict.fromkeys(number for number, _ in keys):
        mine = {name: columns.columns[number, name] for n, name in keys if n == number}
        rows = {name: column.rows for name, column in mine.items() if column.rows is not None}
        rates = {name: (column.fs, column.start) for name, column in mine.items() if column.fs is not None}
        if len(set(rows.values())) > 1:
            counts = ", ".join(f"{name} {count}" for name, count in rows.items())
            raise RecordError(
                f"columns of unequal length ({counts})", "one record has one clock", "read them as separate records"
            )
        if len(set(rates.values())) > 1 and number not in times:
            shown = ", ".join(f"{name} {fs:g} Hz from {start:g} s" for name, (fs, start) in rates.items() if fs)
            raise RecordError(
                f"columns with clocks of their own ({shown})",
                "one record has one clock",
                "read them as separate records and join them with synchronise()",
            )
