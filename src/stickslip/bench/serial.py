"""Lines of numbers from a serial port, as an Arduino sends them; through pyserial."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from stickslip.bench.device import Block, Input, Listening, Output, Wires, columns, inputs, vendors
from stickslip.errors import ModelError, RecordError
from stickslip.printing import printable
from stickslip.settings import SHOWN, STRICT, checked, quantity

NAME, NEEDS = "serial", "serial"
BLOCK = 0.02  # s of lines that are handed on together, as by the other drivers: one alone costs a watcher as much
SEPARATOR = re.compile(rb"[,;\s]+")
LONGEST = 4096  # bytes of a line; what is longer is none
# Lines in a row of which none can be read, and s of them, after which a port is given up; and s after which it is with
# fewer lines. Of lines of which half came damaged, at 1 and 10 a second for 100 hours, at 100 for 5, none was given up;
# noise in place of lines, as of a wrong rate, is told after 2 s at 115200 baud, after 8 to 12 s at 9600.
MANY, UNREAD, PATIENCE = 40, 2.0, 8.0
LARGEST_GAP = 1 << 24  # samples: a counter that jumps further was not read rightly


@dataclass(frozen=True)
class Lines:
    """A port whose lines are samples.

    Attributes
    ----------
    port : str
        "COM3", "/dev/ttyACM0".
    fs : float
        How many lines a second [Hz].
    inputs : tuple of Input
        Each at the number of its column.
    baud : int
        Bits a second.
    counter : int
        The column, from 1, that counts the lines; 0: none, and lost lines are seen only where they are damaged.
    wrap : int
        Where that counter begins again at 0.
    name : str
        What it is called.
    """

    port: str
    fs: float
    inputs: tuple[Input, ...]
    baud: int = 115200
    counter: int = 0
    wrap: int = 1 << 32
    name: str = NAME

    kind = NAME
    outputs: tuple[Output, ...] = ()

    @property
    def model(self) -> str:
        """Where it is."""
        return f"lines at {self.port}, {self.baud} baud"

    def open(self) -> OpenPort:
        """Open the port.

        Raises
        ------
        ModelError
            It is not there, or another program has it.
        """
        return OpenPort(self)


class OpenPort(Listening):
    """An open port."""

    def __init__(self, device: Lines) -> None:
        serial = vendors("serial")
        try:
            self.port = serial.Serial(device.port, device.baud, timeout=0.05)
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise ModelError(
                f"{device.port} can not be opened ({error})",
                "a port is there, and no other program has it",
                "see stickslip devices",
            ) from error
        self.device, self.columns = device, columns(device.inputs)
        self.rest, self.begun = b"", False
        self.next = 0  # counter of the line that should come
        self.origin: int | None = None  # of the device's own counter
        self.waiting: list[tuple[int, list[float]]] = []  # lines with their counters, not yet handed on
        self.damaged, self.last = 0, b""  # lines in a row of which none could be read, and the last of them
        self.heard = time.monotonic()  # when a line could last be read

    def __exit__(self, *raised: object) -> None:
        """Close the port."""
        self.port.close()

    def read(self, timeout: float = 1.0) -> Block | None:
        """The lines that have come, up to the first gap among them; see :class:`Stream`."""
        until, few = time.monotonic() + timeout, BLOCK * self.device.fs
        while len(self.waiting) < max(1, few) and time.monotonic() < until:
            data = self.rest + self.port.read(max(1, self.port.in_waiting))
            *lines, self.rest = data.split(b"\n")
            if len(self.rest) > LONGEST:
                self.damaged, self.last, self.rest = self.damaged + 1, self.rest, b""
            if lines and not self.begun:  # the first line began before we listened
                lines, self.begun = lines[1:], True
            for line in lines:
                self._take(line)
            self._require_readable()
        clock = time.monotonic()
        if not self.waiting:
            return Block(self.next, clock, np.empty((len(self.columns), 0)))
        first = self.waiting[0][0]
        count = next((j for j, (at, _) in enumerate(self.waiting) if at != first + j), len(self.waiting))
        taken, self.waiting = self.waiting[:count], self.waiting[count:]
        return Block(first, clock, np.array([values for _, values in taken]).T)

    def _take(self, line: bytes) -> None:
        """One line: its numbers with its counter; a damaged one is a sample that was lost."""
        cells = SEPARATOR.split(line.strip())
        device, at = self.device, self.next
        try:
            values = [float(cells[column]) for column in self.columns]
            counted = int(cells[device.counter - 1]) if device.counter else None
        except (ValueError, IndexError):
            self.next += 1
            self.damaged, self.last = self.damaged + 1, line
            return
        self.damaged, self.heard = 0, time.monotonic()
        if counted is not None:
            if self.origin is None:
                self.origin = counted - at
            ahead = (counted - self.origin - at) % device.wrap
            at += ahead if ahead < LARGEST_GAP else 0
        self.waiting.append((at, values))
        self.next = at + 1

    def _require_readable(self) -> None:
        """Refuse what has been no line of numbers for too long."""
        device, silent = self.device, time.monotonic() - self.heard
        many = self.damaged > MANY and (silent > UNREAD or self.damaged > UNREAD * device.fs)
        if not many and not (silent > max(PATIENCE, MANY / device.fs) and (self.damaged or self.rest)):
            return
        came = printable((self.last or self.rest).strip()[:SHOWN].decode("utf-8", "replace"))
        last = max(device.counter, *(column + 1 for column in self.columns))
        lines = f"{self.damaged} lines of which none could be read, the last one"
        raise RecordError(
            f"{device.name} sent {lines if self.damaged else 'no end of a line after'} '{came}'",
            f"a line holds {last} numbers or more, between commas, semicolons or blanks",
            f"correct channels, counter and baud = {device.baud}",
        )


class _Settings(BaseModel):
    """A table ``[devices.NAME]`` of kind "serial"."""

    model_config = STRICT

    port: str
    fs: Annotated[float, quantity("Hz"), Field(gt=0)]
    channels: Wires
    baud: Annotated[int, Field(gt=0)] = 115200
    counter: Annotated[int, Field(ge=0)] = 0
    wrap: Annotated[int, Field(gt=1)] = 1 << 32


def listed() -> Sequence[str]:
    """The ports of this computer."""
    vendors("serial")
    ports = vendors("serial.tools.list_ports").comports()
    return tuple(f"{port.device} ({port.description})" for port in ports)


def build(name: str, settings: Mapping[str, Any], folder: Path) -> Lines:
    """A port from a table: port, fs, channels (``x = "#2 [mm]"``), baud, counter, wrap.

    Raises
    ------
    ModelError
        A setting without meaning.
    """
    given = checked(_Settings, settings, source=f"devices.{name}")
    wired = inputs(given.channels, unit="1")
    columns(wired)
    return Lines(given.port, given.fs, wired, given.baud, given.counter, given.wrap, name)
