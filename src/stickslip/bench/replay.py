"""A record, at its own pace or faster: whatever read_record reads."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from stickslip.bench.device import Block, Input, Listening, Output
from stickslip.errors import ModelError
from stickslip.files.read import read_record
from stickslip.record.record import DETAILS, Record
from stickslip.settings import STRICT, checked, quantity

NAME, NEEDS = "file", ""
BLOCK = 0.02  # s of samples in a block


@dataclass(frozen=True)
class Replay:
    """A record that is played.

    Attributes
    ----------
    record : Record
        On a clock without breaks.
    fast : bool
        Whether it goes as fast as it is read.
    name : str
        What it is called.

    Raises
    ------
    ModelError
        Its clock is broken.

    Examples
    --------
    >>> device = Replay(Record.of({"x": np.arange(1000)}, fs=1000.0), fast=True)
    >>> with device.open() as stream:
    ...     [stream.read().samples.shape for _ in range(2)]
    [(1, 20), (1, 20)]
    """

    record: Record
    fast: bool = False
    name: str = NAME

    kind = NAME
    outputs: tuple[Output, ...] = ()

    def __post_init__(self) -> None:
        if self.record.stamps is not None:
            raise ModelError(
                "a record whose clock is broken", "samples are played at one rate", "repair its clock first"
            )

    @property
    def fs(self) -> float:
        """Rate [Hz] of the record."""
        return self.record.fs

    @property
    def model(self) -> str:
        """What is played."""
        return f"a record of {self.record.duration:.4g} s"

    @cached_property
    def inputs(self) -> tuple[Input, ...]:
        """Its channels, with what is stated of their sensors."""
        measured = []
        for one in self.record.channels.values():
            stated = {name: getattr(one, name) for name in DETAILS if name not in ("sensitivity", "quantity")}
            measured.append(Input(one.name, one.unit, sensitivity=one.sensitivity, terminal=one.source, details=stated))
        return tuple(measured)

    def open(self) -> Playing:
        """Begin to play."""
        return Playing(self)


class Playing(Listening):
    """A record, being played."""

    def __init__(self, device: Replay) -> None:
        self.device, self.sent, self.began = device, 0, time.monotonic()
        self.samples = np.array([device.record[one.name] for one in device.inputs])

    def read(self, timeout: float = 1.0) -> Block | None:
        """The next samples; see :class:`Stream`."""
        device, first, fs = self.device, self.sent, self.device.fs
        if first >= self.samples.shape[1]:
            return None
        after = min(first + max(1, round(BLOCK * fs)), self.samples.shape[1])
        if not device.fast:
            wait = self.began + after / fs - time.monotonic()
            time.sleep(min(max(0.0, wait), timeout))
            if wait > timeout:
                return Block(first, time.monotonic(), self.samples[:, :0])
        self.sent = after
        clock = self.began + after / fs if device.fast else time.monotonic()
        return Block(first, clock, self.samples[:, first:after])


class _Settings(BaseModel):
    """A table ``[devices.NAME]`` of kind "file"."""

    model_config = STRICT

    path: str
    channels: dict[str, str] | None = None
    fs: Annotated[float, quantity("Hz"), Field(gt=0)] | None = None
    fast: bool = False


def listed() -> Sequence[str]:
    """It is always there."""
    return ("any record that is read",)


def build(name: str, settings: Mapping[str, Any], folder: Path) -> Replay:
    """A player of the record that a table names: path, channels, fs, fast.

    Raises
    ------
    ModelError
        A setting without meaning.
    """
    given = checked(_Settings, settings, source=f"devices.{name}")
    return Replay(read_record(folder / given.path, channels=given.channels, fs=given.fs), given.fast, name)
