"""One device's samples on their way to the disk, and what was lost or clipped of them."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.bench.device import Block, Device, Input
from stickslip.errors import FormatError, ModelError, RecordError
from stickslip.files import journal
from stickslip.files.read import read_record
from stickslip.files.table import Options
from stickslip.files.write import WRITERS, require_free, write_record, write_table
from stickslip.record.metadata import Log, record_to_metadata
from stickslip.record.record import Record, Step

SYNC = 1.0  # s between two times that the journal is put on the disk itself
EDGE = 1e-9  # of the range: a reading nearer to its end than this stands at it
LONG_ENOUGH, OFF_PACE = 2.0, 0.1  # s, and part of the rate: buffers and a busy computer make less of a difference
TOLD = 3  # gaps and clipped stretches that a sentence names


class Seen:
    """What went wrong while one device was recorded; grows with every block."""

    def __init__(self, inputs: Sequence[Input]) -> None:
        self.inputs, self.samples, self.lost = inputs, 0, 0
        self.gaps: list[tuple[int, int]] = []  # first lost sample and how many, the first thousand
        self.clipped: dict[str, tuple[int, int]] = {}  # how many, and the first one's counter
        self.after: int | None = None  # counter of the sample that should come
        self.came: list[tuple[int, float]] = []  # counter and clock after the first block, and after the last
        counts = [min(one.limit / one.scale, 1e300) for one in inputs]
        self.edges = np.array(counts)[:, None] * (1 - EDGE)

    def look(self, block: Block) -> None:
        """Count what a block lacks, and what of it stands at the end of a range.

        Raises
        ------
        RecordError
            The counter runs back.
        """
        self.skip(block.first)
        self.after = block.after
        self.came = [*self.came[:1], (block.after, block.clock)]
        self.samples += block.samples.shape[1]
        high, low = np.fmax.reduce(block.samples, axis=1), np.fmin.reduce(block.samples, axis=1)
        for row in np.flatnonzero((high >= self.edges[:, 0]) | (low <= -self.edges[:, 0])).tolist():
            at = np.flatnonzero(np.abs(block.samples[row].astype(np.float64)) >= self.edges[row, 0])
            count, first = self.clipped.get(self.inputs[row].name, (0, block.first + int(at[0]) if len(at) else 0))
            self.clipped[self.inputs[row].name] = (count + len(at), first)

    def skip(self, first: int) -> None:
        """Count as lost what did not come before this sample.

        Raises
        ------
        RecordError
            The counter runs back.
        """
        missing = 0 if self.after is None else first - self.after
        if missing < 0:
            raise RecordError(
                f"sample {first} came after sample {first - missing - 1}",
                "a device counts its samples upwards",
                "check its driver",
            )
        self.lost += missing
        if missing:
            self.gaps += [(first - missing, missing)] if len(self.gaps) < 1000 else []
            self.after = first

    def outcome(self, fs: float, begin: int) -> str:
        """In words."""
        parts = [f"{self.samples} samples at {fs:g} Hz"]
        if self.lost:
            gaps = [f"{count} at {(first - begin) / fs:.3f} s" for first, count in self.gaps[:TOLD]]
            more = f" and {len(self.gaps) - TOLD} gaps more" if len(self.gaps) > TOLD else ""
            parts.append(f"{self.lost} samples lost ({', '.join(gaps)}{more})")
        parts += self._pace(fs)
        for name, (count, first) in self.clipped.items():
            parts.append(f"{name} clipped in {count} samples, first at {(first - begin) / fs:.3f} s")
        return "; ".join(parts)

    def _pace(self, fs: float) -> list[str]:
        """At which rate the samples came by this computer's clock, where that is another than the device states.

        Where some were lost the computer was late, and its clock tells no rate.
        """
        (first, began), (last, ended) = self.came[0], self.came[-1]
        if self.lost or ended - began < LONG_ENOUGH:
            return []
        pace = float(f"{(last - first) / (ended - began):.3g}")
        off = [f"they came at {pace:g} Hz by this computer's clock: correct fs"]
        return [] if abs(pace / fs - 1) < OFF_PACE else off


class Tape:
    """One device's samples on their way to the disk.

    Parameters
    ----------
    device : Device
        What measures.
    output : Path
        The record to be; the journal stands beside it until then, as ``NAME.journal``.
    begin : int
        Counter of the sample that is row 0.
    start : float
        Time [s] of that row.
    log : Log, optional
        What is noted of the experiment.
    notes : mapping
        What else the history should hold of how it was asked.

    Raises
    ------
    FormatError
        The record, or its journal, is there already, or is of a format that is not written.
    """

    def __init__(
        self,
        device: Device,
        output: Path,
        *,
        begin: int = 0,
        start: float = 0.0,
        log: Log | None = None,
        notes: Mapping[str, Any] | None = None,
    ) -> None:
        require_writable(output)
        self.device, self.output, self.begin = device, output, begin
        self.seen, self.due = Seen(device.inputs), time.monotonic() + SYNC
        self.path = journal_of(output)
        self.journal: journal.Journal | None = None
        self.about: dict[str, Any] = {"start": start, "log": log, "notes": notes or {}}

    def write(self, block: Block) -> None:
        """Keep a block; what goes before row 0 is cut off.

        Raises
        ------
        RecordError
            The device's counter runs back.
        OSError
            The disk takes no more.
        """
        if block.first < self.begin:
            block = block._replace(first=self.begin, samples=block.samples[:, self.begin - block.first :])
        if not block.samples.shape[1]:
            return
        if self.journal is None:
            self.begin = block.first
            self.journal = journal.Journal(self.path, _about(self.device, block.samples.dtype, **self.about))
        self.seen.look(block)
        self.journal.append(block.samples, first=block.first, clock=block.clock)
        if time.monotonic() > self.due:
            self.journal.sync()
            self.due = time.monotonic() + SYNC

    def mark(self, text: str) -> None:
        """Note something of this instant, in the history of the record."""
        if self.journal is not None:
            self.journal.tell(journal.MARK, {"text": text}, first=self.seen.after or self.begin)

    def close(self) -> str:
        """Close the journal; returns what was seen, in words.

        Raises
        ------
        RecordError
            There was no sample.
        """
        if self.journal is None:
            raise RecordError(f"no sample came from {self.device.name}", "a record has samples", "check the device")
        outcome = self.seen.outcome(self.device.fs, self.begin)
        self.journal.tell(journal.DONE, {"outcome": outcome})
        self.journal.sync()
        self.journal.__exit__()
        return outcome

    def finish(self) -> Path:
        """The journal, closed, as the record that was asked for; the journal goes when the record stands."""
        try:
            if self.output.suffix in (".h5", ".hdf5"):
                write_table(journal.read(self.path, Options()), self.output)
            else:
                write_record(read_record(self.path), self.output)
        except FormatError as error:
            step = f"{error.next_step}; {self.path.name} holds all of it: stickslip convert makes a record of that"
            raise FormatError(error.value, error.rule, step) from error
        self.path.unlink()
        return self.output


def journal_of(output: Path) -> Path:
    """Where the samples of a record stand until it is whole.

    Examples
    --------
    >>> journal_of(Path("run.h5")).name
    'run.h5.journal'
    """
    return output.with_name(f"{output.name}.journal")


def require_writable(output: Path) -> None:
    """Refuse a record that can not be written, before anything is measured.

    Raises
    ------
    ModelError
        The ending is of no format that is written, or the folder is not there.
    FormatError
        A record, or the journal of one, is there already.
    """
    if output.suffix.lower() not in WRITERS:
        raise ModelError(
            f"'{output.name}' ends in '{output.suffix}'", f"a record ends in {', '.join(WRITERS)}", "choose one"
        )
    if not output.parent.is_dir():
        raise ModelError(
            f"there is no folder '{output.parent}'", "a record goes into a folder that is there", "make it"
        )
    require_free(output)
    if (left := journal_of(output)).exists():
        raise FormatError(
            f"'{left.name}' is there already",
            "it holds what came of a recording that was cut short",
            f"stickslip convert {left.name} {output.name} makes a record of it; or choose another name",
        )


def _about(
    device: Device, kind: np.dtype[Any], start: float, log: Log | None, notes: Mapping[str, Any]
) -> dict[str, Any]:
    """The description of a record to be."""
    ranges = {one.name: one.limit for one in device.inputs if math.isfinite(one.limit)}
    serials = {one.name: one.serial for one in device.inputs if one.serial}
    arguments = {
        "device": device.name,
        "kind": device.kind,
        "model": device.model,
        "fs": device.fs,
        "ranges": ranges,
        "serials": serials,
        "began": datetime.now(UTC).isoformat(timespec="milliseconds"),
        **notes,
    }
    channels = {one.name: one.channel for one in device.inputs}
    samples, history = {name: np.zeros(1) for name in channels}, (Step("acquire", arguments),)
    blank = Record(samples, channels, device.fs, start, history, log=log)
    scales = [one.scale for one in device.inputs]
    return {**record_to_metadata(blank), "type": kind.newbyteorder("<").str, "scales": scales}
