"""Devices without hardware or physics: what they send is known to the last count."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Self

import numpy as np

from stickslip.bench import Block, Input


def counts(first: int, after: int, channels: int) -> np.ndarray:
    """Every sample tells its channel and its counter."""
    at = np.arange(first, after)
    return np.array([(at * (channel + 3) + channel) % 30011 - 15000 for channel in range(channels)], dtype=np.int16)


@dataclass(frozen=True)
class Counter:
    """A unit of 16 bits that counts."""

    channels: int = 2
    fs: float = 50_000.0
    size: int = 1000
    lost: tuple[tuple[int, int], ...] = ()  # first and last of samples that are not delivered
    pace: float = 0.0  # of the clock; 0: as fast as it is read
    last: int = 1 << 60
    name: str = "counter"

    kind, model, outputs = "counter", "counts, serial 0815", ()

    @property
    def inputs(self) -> tuple[Input, ...]:
        return tuple(Input(f"c{j}", "m", limit=15_000e-6, scale=1e-6, serial=f"S{j}") for j in range(self.channels))

    def open(self) -> Counting:
        return Counting(self)


class Counting:
    def __init__(self, device: Counter) -> None:
        self.device, self.sent, self.began = device, 0, time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        pass

    def read(self, timeout: float = 1.0) -> Block | None:
        device, first = self.device, self.sent
        if first >= device.last:
            return None
        self.sent = after = min(first + device.size, device.last)
        if device.pace:
            time.sleep(max(0.0, self.began + after / device.fs / device.pace - time.monotonic()))
        clock = self.began + after / device.fs
        for begin, end in device.lost:
            if begin <= first < end:
                return Block(after, clock, np.empty((device.channels, 0), dtype=np.int16))
        return Block(first, clock, counts(first, after, device.channels))

    def drive(self, output: str, signal: object) -> None:
        raise AssertionError("it moves nothing")
