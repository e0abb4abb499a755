"""Record from devices: streamed to disk, whole whatever happens, with what went wrong seen and named.

What begins a recording is a trigger that is waited for."""

from __future__ import annotations

import math
import shlex
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.bench.device import Block, Device, Input, Signal, Stream
from stickslip.bench.tape import Tape, journal_of, require_writable
from stickslip.errors import EstimateError, ModelError, RecordError, StickslipError
from stickslip.files.read import read_record
from stickslip.files.write import write_record
from stickslip.parameters import finite
from stickslip.record.metadata import Log
from stickslip.record.record import Record
from stickslip.signals.interpolate import clock_rate, synchronise

SILENCE = 10.0  # s without a sample after which a device is given up

Watch = Callable[[Device, Block], object]
Progress = Callable[[str, float], object]


@dataclass(frozen=True)
class Acquired:
    """What was recorded.

    Attributes
    ----------
    paths : tuple of Path
        The record; of several devices that could not be brought onto one clock, one for each.
    outcomes : mapping of str to str
        By device: samples, what was lost, what was clipped.
    ended : str
        Why it ended: "complete", "stopped", "the device ended", "interrupted".
    notes : tuple of str
        What else to know.
    """

    paths: tuple[Path, ...]
    outcomes: Mapping[str, str]
    ended: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Wanted:
    """What is to be recorded.

    Attributes
    ----------
    seconds : float or None
        How long, from the trigger where there is one; until it is stopped where None.
    trigger : Trigger or None
        What begins it.
    drive : mapping of str to Signal
        How the outputs move meanwhile, from the opening on; they rest again at the end.
    log : Log or None
        What is noted of the experiment.
    """

    seconds: float | None = None
    trigger: Trigger | None = None
    drive: Mapping[str, Signal] = field(default_factory=dict)
    log: Log | None = None


def acquire(
    device: Device | Sequence[Device],
    *,
    output: str | Path,
    wanted: Wanted | None = None,
    watch: Watch | None = None,
    progress: Progress | None = None,
    stop: threading.Event | None = None,
) -> Acquired:
    """Record from one device or several into a file.

    Samples go to a journal beside the file as they come, so that whatever ends the program costs the last block at
    most; at the end the journal becomes the file. A journal that was left is read as any record is, and
    ``stickslip convert`` makes a file of it.

    Parameters
    ----------
    device : Device or sequence of Device
        What measures. Several are brought onto the first one's clock by :func:`~stickslip.signals.synchronise`: by a
        displacement or velocity that both measure, otherwise by when their samples came.
    output : path
        The record, .h5, .csv or .parquet.
    wanted : Wanted, optional
        How long, from which trigger on, and what moves meanwhile; until `stop` where left out.
    watch : callable, optional
        Called with the device and each block as it comes.
    progress : callable, optional
        Called after every block with words, the trigger's readings while it is waited for, and with the part that is
        over; 0 where nothing says how long.
    stop : threading.Event, optional
        Ends it when it is set.

    Returns
    -------
    Acquired

    Raises
    ------
    ModelError, FormatError
        What is asked can not be, told before anything is measured.
    RecordError
        A device sends nothing, or the trigger does not come.
    KeyboardInterrupt
        Interrupted before anything was recorded.

    Examples
    --------
    >>> import tempfile
    >>> from stickslip.bench.sim import Sim
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     done = acquire(Sim(fast=True), output=folder + "/run.h5", wanted=Wanted(seconds=0.5))
    ...     record = read_record(done.paths[0])
    >>> record, done.ended
    (Record(x [m], z [m], a [m/s^2], load [N]; 2000 samples, 4000 Hz, from 0 s), 'complete')
    """
    wanted, output = wanted or Wanted(), Path(output)
    every = list(device) if isinstance(device, Sequence) else [device]
    _require(every, wanted)
    outputs = [output] if len(every) == 1 else [_beside(output, one.name) for one in every]
    for path in {output, *outputs}:
        require_writable(path)
    run = _Run(wanted, watch, progress, stop or threading.Event())
    heads = [_Head(one, path, run) for one, path in zip(every, outputs, strict=True)]
    try:
        return _recorded(run, heads, output)
    except KeyboardInterrupt as again:  # while it is made a file, or before anything came
        raise KeyboardInterrupt(_left(heads)) from again


def _recorded(run: _Run, heads: Sequence[_Head], output: Path) -> Acquired:
    """Record with every head, and make a file of it."""
    ended = run.all(heads)
    if not any(head.tape for head in heads):
        raise run.nothing(heads)
    outcomes = {head.device.name: head.tape.close() if head.tape else "no samples" for head in heads}
    paths = tuple(head.tape.finish() for head in heads if head.tape is not None)
    done = Acquired(paths, outcomes, ended, tuple(head.short for head in heads if head.short))
    return done if len(paths) == 1 else _together(paths, output, done)


def _left(heads: Sequence[_Head]) -> str:
    """What an interruption leaves, in words: the files that are whole, and how the journals become files."""
    parts = []
    for path in (head.path for head in heads):
        journal = journal_of(path)
        if path.exists():
            parts.append(f"{path} is whole")
        elif journal.exists():
            command = shlex.join(["stickslip", "convert", str(journal), str(path)])
            parts.append(f"{journal} holds what came: {command} makes a record of it")
    return "; ".join(parts)


def _beside(output: Path, name: str) -> Path:
    return output.with_name(f"{output.stem}-{name}{output.suffix}")


def _require(devices: Sequence[Device], wanted: Wanted) -> None:
    """Refuse what can not be, before anything is measured."""
    if not devices or len({one.name for one in devices}) < len(devices):
        raise ModelError(f"{len(devices)} devices", "each has a name of its own", "name them in [devices.NAME]")
    if wanted.seconds is not None and not 0 < wanted.seconds < math.inf:
        raise ModelError(f"seconds = {wanted.seconds}", "a recording lasts some time", "give more")
    if wanted.trigger is not None:
        wanted.trigger.require({one.name: one for device in devices for one in device.inputs})
    known = {output.name: output for device in devices for output in device.outputs}
    for name, signal in wanted.drive.items():
        if name not in known:
            raise ModelError(f"a drive of '{name}'", f"the outputs: {', '.join(known) or 'none'}", "name one of them")
        known[name].require(signal, fs=devices[0].fs)


class _Run:
    """What the devices of one recording share: when it begins and why it ended."""

    def __init__(self, wanted: Wanted, watch: Watch | None, progress: Progress | None, stop: threading.Event) -> None:
        self.wanted, self.watch, self.progress, self.stop = wanted, watch, progress, stop
        self.began: float | None = None  # by this computer's clock [s], of the trigger or the first sample
        self.ended = "complete"
        self.failure: StickslipError | None = None

    def all(self, heads: Sequence[_Head]) -> str:
        """Record with every head at once; returns why it ended."""
        with ExitStack() as stack:
            streams = [stack.enter_context(_open(head.device)) for head in heads]
            for head, stream in zip(heads, streams, strict=True):
                _move(head.device, stream, self.wanted.drive)
            if len(heads) == 1:
                self._one(heads[0], streams[0])
            else:
                pairs = zip(heads, streams, strict=True)
                threads = [threading.Thread(target=self._one, args=pair, daemon=True) for pair in pairs]
                for thread in threads:
                    thread.start()
                self._wait(threads)
            for head, stream in zip(heads, streams, strict=True):
                _move(head.device, stream, dict.fromkeys(self.wanted.drive))
        if self.failure is not None:
            raise _with_journals(self.failure, [head.tape for head in heads if head.tape and head.tape.journal])
        return self.ended

    def nothing(self, heads: Sequence[_Head]) -> KeyboardInterrupt | RecordError:
        """Why there is no sample of any head."""
        if self.ended == "interrupted":
            return KeyboardInterrupt()
        awaited = next((head.awaited for head in heads if head.awaited), None)
        if awaited is not None:
            return awaited.refusal()
        return RecordError(f"{self.ended} before a sample came", "a record has samples", "check the device")

    def _wait(self, threads: Sequence[threading.Thread]) -> None:
        try:
            for thread in threads:
                while thread.is_alive():
                    thread.join(0.1)
        except KeyboardInterrupt:
            self.ended = "interrupted"
            self.stop.set()
            for thread in threads:
                thread.join()

    def _one(self, head: _Head, stream: Stream) -> None:
        """Record with one, until it has what is wanted."""
        heard = time.monotonic()
        try:
            while not head.done:
                if self.stop.is_set():
                    self.ended = self.ended if self.ended != "complete" else "stopped"
                    return
                block = _read(head.device, stream)
                if block is None:
                    self.ended = "the device ended"
                    if head.tape is None:  # nothing begins with it any more, nor with those that wait for it
                        self.stop.set()
                    return
                if block.samples.shape[1]:
                    heard = time.monotonic()
                    if self.watch:
                        self.watch(head.device, block)
                    self._keep(head, block)
                    if self.progress and (stage := head.stage(block.after)):
                        self.progress(*stage)
                elif time.monotonic() - heard > SILENCE:
                    raise RecordError(
                        f"{head.device.name} sent nothing for {SILENCE:g} s",
                        "a device that measures sends samples",
                        "check cable, power and clock",
                    )
        except KeyboardInterrupt:
            self.ended = "interrupted"
        except StickslipError as failure:
            self.failure = failure
            self.stop.set()

    @staticmethod
    def _keep(head: _Head, block: Block) -> None:
        try:
            head.take(block)
        except OSError as error:
            raise RecordError(
                f"{journal_of(head.path).name} can not be written ({error.strerror or error})",
                "samples go to the disk as they come",
                "make room, or name a file on another disk",
            ) from error


def _open(device: Device) -> Stream:
    try:
        return device.open()
    except OSError as error:  # nothing is plugged in, or another program has it
        raise RecordError(
            f"{device.name} can not be opened ({error})",
            "a device is there, and no other program has it",
            "check plug, cable and power",
        ) from error


def _read(device: Device, stream: Stream) -> Block | None:
    try:
        return stream.read(0.2)
    except OSError as error:  # a plug that was pulled
        raise RecordError(
            f"{device.name} can not be read any more ({error})",
            "a device stays there while it records",
            "check plug, cable and power",
        ) from error


def _with_journals(failure: StickslipError, tapes: Sequence[Tape]) -> StickslipError:
    """A failure that says where what came until then stays, as journals."""
    for tape in tapes:
        assert tape.journal is not None
        tape.journal.__exit__()
    kept = ", ".join(tape.path.name for tape in tapes)
    if not kept:
        return failure
    step = f"{failure.next_step}; {kept} holds what came until then: stickslip convert makes a record of that"
    return type(failure)(failure.value, failure.rule, step, kind=failure.kind)


def _move(device: Device, stream: Stream, drive: Mapping[str, Signal]) -> None:
    for name, signal in drive.items():
        if name in [output.name for output in device.outputs]:
            stream.drive(name, signal)


class _Head:
    """One device of a recording: what it holds until it begins, then its tape."""

    def __init__(self, device: Device, path: Path, run: _Run) -> None:
        self.device, self.path, self.run = device, path, run
        self.tape: Tape | None = None
        self.held: deque[Block] = deque()
        self.end = math.inf
        self.short = ""  # what is missing before the trigger, in words
        trigger, names = run.wanted.trigger, [one.name for one in device.inputs]
        self.awaited = Awaited(trigger, device) if trigger is not None and trigger.channel in names else None

    @property
    def done(self) -> bool:
        """Whether it has all that is wanted."""
        return self.tape is not None and (self.tape.seen.after or 0) >= self.end

    def stage(self, after: int) -> tuple[str, float] | None:
        """What it does in words, and which part is over as its counter comes to `after`; None where others say so."""
        if self.tape is None:
            return self.awaited.stage() if self.awaited else None
        passed = after - self.tape.begin
        share = 1.0 if self.done else passed / (self.end - self.tape.begin)
        return f"recording, {passed / self.device.fs:.1f} s", share

    def take(self, block: Block) -> None:
        """A block: held, or kept."""
        if self.tape is None:
            self.held.append(block)
            self._begin(block)
            return
        self._write(block)

    def _begin(self, block: Block) -> None:
        """Whether the recording begins with what is held."""
        run, fs, trigger = self.run, self.device.fs, self.run.wanted.trigger
        at: float | None = None  # the counter of time 0
        if trigger is None:
            if run.began is None:
                run.began, at = block.clock - (block.after - block.first) / fs, block.first
        elif self.awaited is not None:
            at = self.awaited.look(block)
            if at is not None:
                run.began = block.clock - (block.after - at) / fs
        if at is None and run.began is not None and self.awaited is None:
            at = block.after - (block.clock - run.began) * fs  # as good as the time at which blocks come
        before = trigger.before if trigger else 0.0
        if at is None:
            while len(self.held) > 1 and block.after - self.held[1].first > (before + 1.0) * fs:
                self.held.popleft()  # a second more: another device may have the trigger
            return
        begin = max(self.held[0].first, math.ceil(at - before * fs - 1e-6))
        kept = max(0.0, (at - begin) / fs)
        if before and begin > math.ceil(at - before * fs - 1e-6):
            self.short = f"{self.device.name} kept {kept:.3g} s before the trigger, not {before:g} s: it came too early"
        self.end = math.ceil(at + run.wanted.seconds * fs - 1e-6) if run.wanted.seconds else math.inf
        start, notes = (begin - at) / fs, _notes(run.wanted, kept)
        self.tape = Tape(self.device, self.path, begin=begin, start=start, log=run.wanted.log, notes=notes)
        while self.held:
            self._write(self.held.popleft())

    def _write(self, block: Block) -> None:
        assert self.tape is not None
        if block.after > self.end:
            block = block._replace(samples=block.samples[:, : max(0, int(self.end) - block.first)])
            self.tape.write(block)
            self.tape.seen.skip(int(self.end))  # the last samples may be those that were lost
            self.end = min(self.end, self.tape.seen.after or 0)
            return
        self.tape.write(block)


def _notes(wanted: Wanted, kept: float) -> dict[str, Any]:
    """How it was asked, for the history; of the time before the trigger what was there."""
    notes: dict[str, Any] = {}
    if (trigger := wanted.trigger) is not None:
        notes["trigger"] = f"{trigger}, {kept:.4g} s before it kept"
    for name, signal in wanted.drive.items():
        notes[f"drive {name}"] = (
            str(signal) if isinstance(signal, tuple) else f"{0 if signal is None else len(signal)} samples"
        )
    return notes


def _together(paths: Sequence[Path], output: Path, done: Acquired) -> Acquired:
    """The records of several devices as one, on the first one's clock; as they are where that can not be."""
    first, *others = [read_record(path) for path in paths]
    try:
        for other in others:
            first = _joined(first, other)
        write_record(first, output)
    except StickslipError as error:
        note = f"the devices' records stay apart: {error}"
        return replace(done, notes=(*done.notes, note))
    for path in paths:
        path.unlink()
    return replace(done, paths=(output,))


def _joined(first: Record, other: Record) -> Record:
    pairs = [(a, b) for a in ("x", "v") for b in ("x", "v") if a in first and b in other]
    for on in pairs[:1]:
        try:
            rate = clock_rate(first, other, on=on)
            return synchronise(first, other, on=on, rate=1.0 if rate.includes(1.0) else rate)
        except EstimateError:
            break  # they did not move alike: by when their samples came
    return synchronise(first, other, offset=0.0)


@dataclass(frozen=True)
class Trigger:
    """What begins a recording.

    Attributes
    ----------
    channel : str
        The input that is watched.
    level : float
        Reading [SI] that it passes.
    rising : bool
        Whether upwards.
    before : float
        Time [s] before it that is kept.
    timeout : float
        For how long [s], by the device's clock, it is waited for.

    Raises
    ------
    ModelError
        A level that is no number, a time before it that is negative, a timeout that is not positive.

    Examples
    --------
    >>> print(Trigger("load", 0.5))
    load rising through 0.5
    """

    channel: str
    level: float
    rising: bool = True
    before: float = 0.0
    timeout: float = math.inf

    def __post_init__(self) -> None:
        finite("level", self.level, unit="", signed=True)
        if not 0 <= self.before < math.inf:
            raise ModelError(f"before = {self.before} s", "what is kept before a trigger is a time", "correct it")
        if not self.timeout > 0:
            raise ModelError(f"timeout = {self.timeout} s", "a trigger is waited for some time", "give more")

    def __str__(self) -> str:
        return f"{self.channel} {'rising' if self.rising else 'falling'} through {self.level:g}"

    def require(self, inputs: Mapping[str, Input]) -> None:
        """Refuse a level that no input of these can pass.

        Raises
        ------
        ModelError
            No such channel, or a level beyond its range.
        """
        if self.channel not in inputs:
            raise ModelError(f"a trigger on '{self.channel}'", f"the inputs are {', '.join(inputs)}", "name one")
        one = inputs[self.channel]
        if abs(self.level) > one.limit:
            raise ModelError(
                f"a trigger at {self.level:g} {one.unit}",
                f"{self.channel} reads {one.limit:g} {one.unit} at most, of either sign",
                "choose a level in its range",
            )


class Awaited:
    """A trigger that is waited for at a device: what its channel has read until now."""

    def __init__(self, trigger: Trigger, device: Device) -> None:
        self.trigger, self.fs = trigger, device.fs
        self.row = [one.name for one in device.inputs].index(trigger.channel)
        self.input = device.inputs[self.row]
        self.last = self.low = self.high = math.nan  # the last reading, and between which all of them lay
        self.first: int | None = None  # counter since which it is waited for
        self.waited = 0.0  # s

    def look(self, block: Block) -> int | None:
        """The counter of the sample with which the level is passed; None where a block does not.

        Readings that are not there are passed over.

        Raises
        ------
        RecordError
            It was waited for long enough.
        """
        values = block.samples[self.row] * self.input.scale
        there = np.flatnonzero(~np.isnan(values))
        seen = np.append(self.last, values[there])
        self.last, self.low, self.high = seen[-1], np.fmin.reduce([self.low, *seen]), np.fmax.reduce([self.high, *seen])
        side = 1.0 if self.trigger.rising else -1.0
        height = side * (seen - self.trigger.level)
        passed = np.flatnonzero((height[1:] >= 0) & (height[:-1] < 0))
        if len(passed):
            return block.first + int(there[passed[0]])
        self.first = block.first if self.first is None else self.first
        self.waited = (block.after - self.first) / self.fs
        if self.waited >= self.trigger.timeout:
            raise self.refusal()
        return None

    def stage(self) -> tuple[str, float]:
        """How it stands in words, and which part of the time is over."""
        return f"waiting for {self.trigger}: {self._range()} so far", min(1.0, self.waited / self.trigger.timeout)

    def refusal(self) -> RecordError:
        """That it did not come."""
        return RecordError(
            f"{self.trigger.channel} read {self._range()} in {self.waited:.3g} s",
            f"the recording begins with {self.trigger} {self.input.unit}",
            "choose a level between them, or wait longer; nothing was written",
        )

    def _range(self) -> str:
        return "nothing" if math.isnan(self.low) else f"{self.low:.4g} to {self.high:.4g} {self.input.unit}"
