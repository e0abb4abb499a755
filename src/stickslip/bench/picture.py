"""What sensors read while they are recorded, drawn by letters: for a person at the rig, whose hands are busy."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from stickslip.bench.device import Block, Device, Input, in_si
from stickslip.units import prefixed

COLUMNS, SPAN = 40, 4.0  # letters of a trace, and the s that they hold
HEIGHTS = "▁▂▃▄▅▆▇█"


class Picture:
    """The last seconds of every channel: lowest and highest reading of each column.

    Parameters
    ----------
    seconds : float
        That will be recorded.

    Examples
    --------
    >>> from stickslip.bench import Sim
    >>> device, seen = Sim(fast=True), Picture(5.0)
    >>> with device.open() as stream:
    ...     seen.add(device, stream.read())
    >>> seen.lines(device)[0]
    '0.0 of 5 s'
    """

    def __init__(self, seconds: float) -> None:
        self.seconds, self.after = seconds, 0
        self.parts: deque[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = deque()

    def add(self, device: Device, block: Block) -> None:
        """One more block."""
        values = in_si(device, block)
        self.after = block.after
        self.parts.append((block.after, np.fmin.reduce(values, axis=1), np.fmax.reduce(values, axis=1)))
        while self.parts[0][0] < self.after - SPAN * device.fs:
            self.parts.popleft()

    def lines(self, device: Device) -> list[str]:
        """How far it is, and a line for each channel."""
        ends = np.array([after for after, _, _ in self.parts])
        columns = np.floor((ends - self.after) * COLUMNS / (SPAN * device.fs)).astype(int) + COLUMNS - 1
        lows, tops = (np.array([part[k] for part in self.parts]).T for k in (1, 2))
        traces = zip(device.inputs, lows, tops, strict=True)
        told = [_line(one, low, top, np.maximum(columns, 0)) for one, low, top in traces]
        return [f"{self.after / device.fs:.1f} of {self.seconds:g} s", *told]


def _line(one: Input, low: NDArray[np.float64], top: NDArray[np.float64], columns: NDArray[np.int_]) -> str:
    """Name, trace, and between which readings it lies; what stands at the range's end is said."""
    ends = float(np.fmin.reduce(low)), float(np.fmax.reduce(top))
    if not np.all(np.isfinite(ends)):
        return f"{one.name:<8} gives no numbers"
    factor, unit = prefixed(np.array(ends), one.unit)
    letters = [" "] * COLUMNS
    for column in np.unique(columns[np.isfinite(top)]):
        share = (np.fmax.reduce(top[columns == column]) - ends[0]) / ((ends[1] - ends[0]) or 1.0)
        letters[column] = HEIGHTS[min(len(HEIGHTS) - 1, int(share * len(HEIGHTS)))]
    clipped = "  at the end of its range" if max(map(abs, ends)) >= one.limit * (1 - 1e-9) else ""
    return f"{one.name:<8} {''.join(letters)} {ends[0] * factor:.4g} to {ends[1] * factor:.4g} {unit}{clipped}"
