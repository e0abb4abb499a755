"""What begins a recording, and how it is waited for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from stickslip.bench.device import Block, Device, Input
from stickslip.errors import ModelError, RecordError
from stickslip.parameters import finite


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
