"""read_record and read_blocks: which format a file is of, and which of its columns are wanted."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import NO_RATE, FormatError, RecordError
from stickslip.files.select import Columns, Source, TimeColumn, Wanted, titled
from stickslip.files.table import FREE, Block, Budget, Options, supplied
from stickslip.printing import printable
from stickslip.record.channels import Channel
from stickslip.record.clock import Clock, fit_clock, resolution
from stickslip.record.exchange import history_of, metadata_to_record
from stickslip.record.metadata import Digests, require_columns, require_rows, stated_channels, units_of
from stickslip.record.record import DETAILS, Record, Step

# Asked in this order whether a file is theirs; each is a module beside this one, imported when it is its turn.
FORMATS = (
    "journal", "tdms", "matlab", "hdf5", "parquet", "uff", "audio", "lvm", "rosbag", "mdf",
    "json_table", "oscilloscope", "text",
)  # fmt: skip

HEAD = 1 << 16  # bytes shown to `recognise`

ROWS_AT_ONCE = 1_000_000  # of a few columns; of many so many fewer that a block stays within what any file may become


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

    Formats: CSV and other text, what oscilloscopes write, MATLAB v5 to v7.3, TDMS, UFF 58, WAV/FLAC/OGG, HDF5, Parquet,
    LVM, JSON, MCAP, bags of ROS 1 and 2, MDF, the journal of `stickslip acquire`. A file that write_record wrote, read
    without arguments, is the same record again, history included.

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
    source = _open(path, channels, fs, units, time, rows, Options(delimiter, decimal))
    try:
        return source.whole()
    except MemoryError as error:
        raise RecordError(
            f"{source.names} does not fit in memory",
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
    given = {
        "channels": dict(channels) if channels is not None else None,
        "fs": fs,
        "units": dict(units) if units else None,
        "time": time,
        "rows": list(rows) if rows is not None else None,
        "delimiter": options.delimiter,
        "decimal": options.decimal,
    }
    arguments = {name: value for name, value in given.items() if value is not None}
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
        room = _room(name)
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


# ---- from the columns of files to a Record


@dataclass(frozen=True)
class Reading:
    """What is to be read: the files, the channels made of their columns, the clock."""

    sources: tuple[Source, ...]
    wanted: tuple[Wanted, ...]
    times: Mapping[int, TimeColumn]
    fs: float | None
    rows: tuple[int | None, int | None]
    arguments: Mapping[str, Any]
    notes: tuple[str, ...]

    @property
    def metadata(self) -> Mapping[str, Any]:
        """What write_record left in the file, if it is one and nothing else is asked for."""
        return self.sources[0].table.record if len(self.sources) == 1 and not self.arguments else {}

    @cached_property
    def restores(self) -> bool:
        """Whether columns and units are those that write_record left, to be given back as it was."""
        if not self.metadata:
            return False
        units = {column.name: column.unit for column in self.sources[0].table.columns}
        stated = units_of(self.metadata)
        require_columns(self.metadata, units)
        return len(stated) == len(units) and all(units[name] in (None, unit) for name, unit in stated.items())

    def whole(self) -> Record:
        """All rows at once."""
        parts: dict[tuple[int, str], list[Array]] = {}
        self._require_budget()
        rows = 0
        for block in self._raw(max(1, min(ROWS_AT_ONCE, FREE // max(1, sum(map(len, self._needed)))))):
            rows += len(next(iter(block.values())))
            self._require_budget(rows)
            for key, values in block.items():
                parts.setdefault(key, []).append(values)
        data = {key: arrays[0] if len(arrays) == 1 else np.concatenate(arrays) for key, arrays in parts.items()}
        length = len(next(iter(data.values()))) if data else 0
        first, last, _ = slice(*self.rows).indices(length)
        if first >= last:
            raise RecordError(
                f"rows {self.rows} of {self.names} hold nothing" if length else f"{self.names} has no rows",
                f"the file has {length} rows and at least one is needed",
                "check rows= and the file",
            )
        if self.restores:
            require_rows(self.metadata, length)
            if not Digests(_by_column(data)).changed(self.metadata):
                return metadata_to_record(self.metadata, _by_column(data))
        if (first, last) != (0, length):
            data = {key: values[first:last] for key, values in data.items()}
        _require_equal_ends(data, first)
        return self._record(data, self._clock(data, first), "read_record")

    def blocks(self, size: int) -> Iterator[Record]:
        """Block after block."""
        first, fs, digests = 0, None, Digests()
        self._require_budget(most=size)
        for data in self._raw(size):
            if self.restores:
                digests.add(_by_column(data))
                record = metadata_to_record(self.metadata, _by_column(data), first)
            else:
                clock = self._clock(data, first, fs)
                record = self._record(data, clock, "read_blocks", {"size": size, "first": first})
                fs = record.fs if fs is None and record.stamps is None else fs
            first += len(record)
            yield record
        if self.restores:
            require_rows(self.metadata, first)
            if changed := digests.changed(self.metadata):
                raise FormatError(
                    f"{', '.join(changed)} of {self.names} was changed since write_record wrote it",
                    "a record is given back in blocks as it was",
                    "read what is there by naming channels=",
                )
        if not first:
            raise RecordError(f"{self.names} has no rows", "at least one is needed", "check the file")

    def _require_budget(self, rows: int = 0, most: int | None = None) -> None:
        """Refuse more rows than each file is good for: those that it states, at most so many of them, or those read."""
        for source, names in zip(self.sources, self._needed, strict=True):
            stated = [column.rows or 0 for column in source.table.columns if column.name in set(names)]
            rows = max([rows, *stated])
            Budget.of(source.path).require_rows(rows if most is None else min(rows, most), len(names))

    @property
    def names(self) -> str:
        """The files' names, for sentences."""
        return ", ".join(source.path.name for source in self.sources)

    @cached_property
    def _needed(self) -> list[list[str]]:
        """The columns to read of each file."""
        if self.restores:
            return [list(units_of(self.metadata))]
        keys = [key for wanted in self.wanted for key in wanted.scales]
        if self.fs is None:
            keys += [key for time in self.times.values() for key in (time.key, *time.twins)]
        return [list(dict.fromkeys(n for number, n in keys if number == i)) for i in range(len(self.sources))]

    def _raw(self, size: int) -> Iterator[dict[tuple[int, str], Array]]:
        """Blocks of the columns of all files, row beside row."""
        pairs = zip(self.sources, self._needed, strict=True)
        streams = [_even(_blocks(source, names, size), size) for source, names in pairs if names]
        numbers = [number for number, names in enumerate(self._needed) if names]
        rows = [0] * len(streams)
        while True:
            blocks = [next(stream, {}) for stream in streams]
            lengths = [len(next(iter(block.values()), ())) for block in blocks]
            rows = [before + more for before, more in zip(rows, lengths, strict=True)]
            if len(set(lengths)) > 1:
                raise RecordError(
                    f"the files {self.names} differ in rows, after {min(rows)} of them",
                    "files that are read together share one clock, row by row",
                    "read them apart and join them with synchronise()",
                )
            if not lengths or not lengths[0]:
                return
            parts = zip(numbers, blocks, strict=True)
            yield {(number, name): values for number, block in parts for name, values in block.items()}

    def _clock(self, data: Mapping[tuple[int, str], Array], first: int, known: float | None = None) -> Clock:
        """The one clock of these rows, which begin at row `first` of the files."""
        length = len(next(iter(data.values())))
        if self.fs is not None:
            return Clock(self.fs, first / self.fs)
        clocks: list[tuple[Clock, float]] = []
        for number in range(len(self.sources)):
            rate = self._stated_rate(number)
            if number in self.times:
                time = self.times[number]
                _require_twins(self.sources[number].path.name, time, data)
                with np.errstate(over="ignore", invalid="ignore"):
                    fitted = fit_clock(data[time.key], time.scale, known)
                    finite = data[time.key][np.isfinite(data[time.key])]
                    clocks.append((fitted, resolution(finite) * time.scale))
            elif rate is not None:
                clocks.append((Clock(rate[0], rate[1] + first / rate[0]), 0.0))
        if not clocks:
            names = [column.name for source in self.sources for column in source.table.columns]
            raise RecordError(
                f"{self.names} tells neither time nor sampling rate",
                "a record has a clock",
                f"pass fs= in Hz, or the time column in time= (columns: {', '.join(names[:20])})",
                kind=NO_RATE,
            )
        clock, rounding = clocks[0]
        for other, its_rounding in clocks[1:]:
            apart = float(np.nanmax(np.abs(_seconds(clock, length) - _seconds(other, length))))
            # rounding explains a difference, but not one of a tenth of a sample
            if not apart <= min(max(rounding + its_rounding, 0.01 / clock.fs), 0.1 / clock.fs):
                raise RecordError(
                    f"the clocks of {self.names} are up to {apart:.3g} s apart",
                    "files that are read together share one clock",
                    "read them apart and join them with synchronise()",
                )
        return clock

    def _stated_rate(self, number: int) -> tuple[float, float] | None:
        """Rate and start that the format states for the columns wanted of a file."""
        names = self._needed[number]
        stated = {(c.fs, c.start) for c in self.sources[number].table.columns if c.name in names}
        fs, start = next(iter(stated), (None, 0.0))
        return (fs, start) if fs is not None else None

    def _record(
        self, data: Mapping[tuple[int, str], Array], clock: Clock, action: str, extra: Mapping[str, Any] | None = None
    ) -> Record:
        samples = {wanted.channel.name: _combined(wanted, data) for wanted in self.wanted}
        files = [source.entry for source in self.sources]
        for number, time in self.times.items():
            if time.assumed and self.fs is None:
                files[number]["seconds"] = printable(time.key[1])
        arguments = {**self.arguments, **(extra or {}), "files": files}
        length = len(next(iter(samples.values())))
        outcome = f"{length} samples at {clock.fs:g} Hz"
        outcome += "" if clock.stamps is None else ", the time stamps not uniform and kept"
        outcome += f", the time stamps within {clock.wander:.2g} s of uniform" if clock.wander else ""
        outcome += "; changed since write_record wrote it" if self.metadata else ""
        cut = [f"'{source.path.name}': {source.table.cut}" for source in self.sources if source.table.cut]
        step = Step(action, arguments, "; ".join([outcome, *cut, *self.notes]))
        table = self.sources[0].table.record if len(self.sources) == 1 else {}
        channels = {wanted.channel.name: _detailed(wanted, stated_channels(table)) for wanted in self.wanted}
        return Record(samples, channels, clock.fs, clock.start, (*history_of(table), step), clock.stamps)


def _detailed(wanted: Wanted, channels: Mapping[str, Channel]) -> Channel:
    """The channel, with what was stated of its sensor where it is that sensor's column as it was written."""
    columns = [name for _, name in wanted.scales]
    known = channels.get(columns[0]) if len(columns) == 1 else None
    if known is None or known.unit != wanted.channel.unit or wanted.offset != 0:
        return wanted.channel
    if wanted.scale * next(iter(wanted.scales.values())) != 1:
        return wanted.channel
    details = {name: getattr(known, name) for name in DETAILS}
    if wanted.channel.gain_sd:  # stated anew
        details["gain_sd"] = wanted.channel.gain_sd
    return replace(wanted.channel, **details)


@contextmanager
def quietly(path: Path) -> Iterator[None]:
    """Without the parsers' warnings: what they warn of either fails or shows in the numbers."""
    with warnings.catch_warnings(), supplied(path):
        warnings.simplefilter("ignore")
        yield


def _blocks(source: Source, names: Sequence[str], size: int) -> Iterator[Block]:
    """The table's blocks, its failures as FormatError."""
    with quietly(source.path):
        blocks = source.table.blocks(names, size)
    while True:
        with quietly(source.path):
            try:
                block = next(blocks)
            except StopIteration:
                return
        yield block


def _even(blocks: Iterator[Block], size: int) -> Iterator[Block]:
    """Blocks of exactly `size` rows, the last one shorter, out of blocks of any size."""
    kept: list[Block] = []
    count = 0
    for block in blocks:
        while block:
            length = len(next(iter(block.values())))
            take = min(length, size - count)
            kept.append({name: values[:take] for name, values in block.items()})
            count += take
            if count == size:
                yield _joined(kept)
                kept, count = [], 0
            block = {name: values[take:] for name, values in block.items()} if take < length else {}
    if count:
        yield _joined(kept)


def _joined(blocks: Sequence[Block]) -> Block:
    if len(blocks) == 1:
        return blocks[0]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def _combined(wanted: Wanted, data: Mapping[tuple[int, str], Array]) -> Array:
    (first, scale), *others = wanted.scales.items()
    with np.errstate(over="ignore", invalid="ignore"):
        values = data[first] * scale
        for key, scale in others:
            values += data[key] * scale
        values += wanted.offset
        values *= wanted.scale
    values.flags.writeable = False  # nobody else holds it: the record need not copy
    return values


def _by_column(data: Mapping[tuple[int, str], Array]) -> dict[str, Array]:
    """The columns of one file by their names."""
    return {name: values for (_, name), values in data.items()}


def _require_twins(file: str, time: TimeColumn, data: Mapping[tuple[int, str], Array]) -> None:
    """Refuse a file whose columns of time differ from each other."""
    mine = data[time.key]
    for twin in time.twins:
        apart = float(np.max(np.abs(data[twin] - mine)))
        if apart > 0.1 * np.ptp(mine) / len(mine):
            raise RecordError(
                f"columns {time.key[1]} and {twin[1]} of '{file}' are up to {apart * time.scale:.3g} s apart",
                "one record has one clock",
                "name the one meant in time= and read the columns of the other apart",
            )


def _require_equal_ends(data: Mapping[tuple[int, str], Array], first: int) -> None:
    """Refuse columns of unequal length, which a table fills up with empty cells at its end."""
    ends = {}
    for (_, name), values in data.items():
        backwards = np.isfinite(values[::-1])
        if backwards.any():
            ends[name] = first + len(values) - int(np.argmax(backwards))
    if ends and min(ends.values()) < max(ends.values()):
        shortest = min(ends, key=lambda name: ends[name])
        raise RecordError(
            f"column {shortest} has values in {ends[shortest]} rows, others in {max(ends.values())}",
            "the columns of one record are equally long",
            f"keep the rows that all have with rows=({first}, {ends[shortest]})",
        )


def _seconds(clock: Clock, length: int) -> Array:
    return clock.stamps if clock.stamps is not None else clock.start + np.arange(length) / clock.fs
