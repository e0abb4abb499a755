"""A sound card's inputs; through sounddevice."""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from stickslip.bench.device import Block, Input, Listening, Output, Wire, Wires, columns, inputs, vendors
from stickslip.errors import ModelError
from stickslip.settings import STRICT, checked, quantity

NAME, NEEDS = "sound", "sounddevice"
FULL = 1 << 15  # counts of 16 bits at full scale


@dataclass(frozen=True)
class Card:
    """A sound card.

    Attributes
    ----------
    fs : float
        Sampling rate [Hz].
    inputs : tuple of Input
        Each at the number of its channel; a number is worth a part of full scale.
    device : int, str or None
        Which card, as sounddevice calls it; None: the system's own choice.
    name : str
        What it is called.
    """

    fs: float
    inputs: tuple[Input, ...]
    device: int | str | None = None
    name: str = NAME

    kind = NAME
    outputs: tuple[Output, ...] = ()

    @property
    def model(self) -> str:
        """Which card."""
        return f"sound card {'of the system' if self.device is None else self.device}"

    def open(self) -> Hearing:
        """Begin to listen.

        Raises
        ------
        ModelError
            There is no such card, or it does not take this rate.
        """
        return Hearing(self)


class Hearing(Listening):
    """An open card. Its driver calls from a thread of its own, and what it brings waits in a line."""

    def __init__(self, device: Card) -> None:
        sound = vendors("sounddevice")
        self.device, self.columns = device, columns(device.inputs)
        self.line: queue.SimpleQueue[tuple[int, float, np.ndarray[Any, np.dtype[np.int16]]]] = queue.SimpleQueue()
        self.next, self.due = 0, math.nan  # counter, and time by the card's clock, of the sample that should come
        try:
            self.stream = sound.InputStream(
                device=device.device,
                channels=max(self.columns) + 1,
                samplerate=device.fs,
                dtype="int16",
                callback=self._called,
            )
            self.stream.start()
        except (sound.PortAudioError, ValueError) as error:
            raise ModelError(
                f"{device.model} can not be opened at {device.fs:g} Hz ({error})",
                "a card is there, and takes this rate and so many channels",
                "see stickslip devices",
            ) from error

    def __exit__(self, *raised: object) -> None:
        """Close the card."""
        self.stream.close()

    def read(self, timeout: float = 1.0) -> Block | None:
        """What the card has brought; see :class:`Stream`."""
        try:
            first, clock, samples = self.line.get(timeout=max(timeout, 1e-3))
        except queue.Empty:
            return Block(self.next, time.monotonic(), np.empty((len(self.columns), 0), dtype=np.int16))
        return Block(first, clock, samples)

    def _called(self, data: Any, frames: int, times: Any, status: Any) -> None:
        """The driver's call: samples, and whether some before them were lost; how many the card's clock tells."""
        began = float(times.inputBufferAdcTime)
        if status.input_overflow and not math.isnan(self.due):
            self.next += max(1, round((began - self.due) * self.device.fs))
        self.line.put((self.next, time.monotonic(), np.ascontiguousarray(data.T[self.columns])))
        self.next += frames
        self.due = began + frames / self.device.fs


class _Settings(BaseModel):
    """A table ``[devices.NAME]`` of kind "sound"."""

    model_config = STRICT

    device: int | str | None = None
    fs: Annotated[float, quantity("Hz"), Field(gt=0)] = 48000.0
    channels: Wires = {"sound": Wire(at="#1 [1]")}


def listed() -> Sequence[str]:
    """The cards of this computer that hear."""
    cards = vendors("sounddevice").query_devices()
    inputs = "max_input_channels"
    return tuple(f"{card['name']} ({card[inputs]} inputs)" for card in cards if card[inputs])


def build(name: str, settings: Mapping[str, Any], folder: Path) -> Card:
    """A card from a table: device, fs, channels (``sound = "#1 [1]"``, full scale being 1).

    Raises
    ------
    ModelError
        A setting without meaning.
    """
    given = checked(_Settings, settings, source=f"devices.{name}")
    wired = inputs(given.channels, unit="1", count=1 / FULL, limit=1 - 1 / FULL)
    columns(wired)
    return Card(given.fs, wired, given.device, name)
