"""From the columns of files to a Record: read block after block, scaled, and put on one clock."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import NO_RATE, FormatError, RecordError
from stickslip.files.select import Source, TimeColumn, Wanted
from stickslip.files.table import FREE, Block, Budget, supplied
from stickslip.printing import printable
from stickslip.record.channels import Channel
from stickslip.record.clock import Clock, fit_clock, resolution
from stickslip.record.exchange import history_of, metadata_to_record
from stickslip.record.metadata import Digests, channels_told, require_columns, require_rows, units_told
from stickslip.record.record import DETAILS, Record, Step

Array = NDArray[np.float64]

ROWS_AT_ONCE = 1_000_000  # of a few columns; of many so many fewer that a block stays within what any file may become


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
    def told(self) -> Mapping[str, Any]:
        """What write_record left in the file, if it is one and nothing else is asked for."""
        return self.sources[0].table.record if len(self.sources) == 1 and not self.arguments else {}

    @cached_property
    def restores(self) -> bool:
        """Whether columns and units are those that write_record left, to be given back as it was."""
        if not self.told:
            return False
        units = {column.name: column.unit for column in self.sources[0].table.columns}
        stated = units_told(self.told)
        require_columns(self.told, units)
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
            require_rows(self.told, length)
            if not Digests(_by_column(data)).changed(self.told):
                return metadata_to_record(self.told, _by_column(data))
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
                record = metadata_to_record(self.told, _by_column(data), first)
            else:
                clock = self._clock(data, first, fs)
                record = self._record(data, clock, "read_blocks", {"size": size, "first": first})
                fs = record.fs if fs is None and record.stamps is None else fs
            first += len(record)
            yield record
        if self.restores:
            require_rows(self.told, first)
            if changed := digests.changed(self.told):
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
            return [list(units_told(self.told))]
        keys = [key for wanted in self.wanted for key in wanted.scales]
        if self.fs is None:
            keys += [key for time in self.times.values() for key in (time.key, *time.twins)]
        return [list(dict.fromkeys(n for number, n in keys if number == i)) for i in range(len(self.sources))]

    def _raw(self, size: int) -> Iterator[dict[tuple[int, str], Array]]:
        """Blocks of the columns of all files, row beside row."""
        streams = [
            _even(_blocks(source, names, size), size)
            for source, names in zip(self.sources, self._needed, strict=True)
            if names
        ]
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
            yield {
                (number, name): v for number, block in zip(numbers, blocks, strict=True) for name, v in block.items()
            }

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
                    clocks.append((fitted, resolution(_finite(data[time.key])) * time.scale))
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
        files = [source.to_dict() for source in self.sources]
        for number, time in self.times.items():
            if time.assumed and self.fs is None:
                files[number]["seconds"] = printable(time.key[1])
        arguments = {**self.arguments, **(extra or {}), "files": files}
        length = len(next(iter(samples.values())))
        outcome = f"{length} samples at {clock.fs:g} Hz"
        outcome += "" if clock.stamps is None else ", the time stamps not uniform and kept"
        outcome += f", the time stamps within {clock.wander:.2g} s of uniform" if clock.wander else ""
        outcome += "; changed since write_record wrote it" if self.told else ""
        cut = [f"'{source.path.name}': {source.table.cut}" for source in self.sources if source.table.cut]
        step = Step(action, arguments, "; ".join([outcome, *cut, *self.notes]))
        table = self.sources[0].table.record if len(self.sources) == 1 else {}
        channels = {wanted.channel.name: _detailed(wanted, channels_told(table)) for wanted in self.wanted}
        return Record(samples, channels, clock.fs, clock.start, (*history_of(table), step), clock.stamps)


def _detailed(wanted: Wanted, channels: Mapping[str, Channel]) -> Channel:
    """The channel, with what was stated of its sensor where it is that sensor's column as it was written."""
    columns = [name for _, name in wanted.scales]
    known = channels.get(columns[0]) if len(columns) == 1 else None
    if known is None or known.unit != wanted.channel.unit or wanted.offset != 0:
        return wanted.channel
    if wanted.scale * next(iter(wanted.scales.values())) != 1:
        return wanted.channel
    return replace(wanted.channel, **{name: getattr(known, name) for name in DETAILS})


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


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]


def _seconds(clock: Clock, length: int) -> Array:
    return clock.stamps if clock.stamps is not None else clock.start + np.arange(length) / clock.fs
