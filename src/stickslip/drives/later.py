"""A drive that has been on for a while: what a motion goes on under, from a state that was kept."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stickslip.drives.kinds import Drive, Motion, Row, require_drive
from stickslip.errors import ModelError
from stickslip.parameters import parameter, parametric


@parametric
class Later:
    """Another drive from an instant of its own on: what was its time `time` is now time 0.

    Raises
    ------
    ModelError
        The drive is none, or is not known at that instant.

    Examples
    --------
    >>> from stickslip.drives.kinds import HarmonicForce
    >>> start = Later(HarmonicForce(1.0, frequency=0.5), time=1.0).motion().start
    >>> round(start["cos0"], 12)
    -1.0
    """

    label = "Drive, from a later instant on"

    drive: Drive = parameter("", "what moves the system")
    time: float = parameter("s", "instant", note="of the drive, that is now time 0")

    def __post_init__(self) -> None:
        require_drive(self.drive)
        end = self.drive.motion().end
        if self.time >= end:
            raise ModelError(
                f"time = {self.time:g} s of a drive recorded for {end:g} s",
                "a drive goes on while it is known",
                "give an earlier time=",
            ).of("time")

    def motion(self) -> Motion:
        """The drive's signals as they are at that instant, and its knots ahead."""
        own = self.drive.motion()
        tones = tuple(
            (c, s, omega, math.remainder(phase + omega * self.time, 2 * math.pi)) for c, s, omega, phase in own.tones
        )
        start = _moved(own.rates, own.start, self.time)
        for cosine, sine, _, phase in tones:
            start |= {cosine: math.cos(phase), sine: math.sin(phase)}
        knots = own.knots
        if knots is not None:
            last = int(np.searchsorted(knots[:, 0], self.time, side="right")) - 1
            rates = {name: own.rates.get(name, {}) for name in own.knotted}
            now = _moved(
                rates, dict(zip(own.knotted, map(float, knots[last, 1:]), strict=True)), self.time - knots[last, 0]
            )
            ahead = knots[last + 1 :] - np.append(self.time, np.zeros(len(own.knotted)))
            knots = np.vstack([[0.0, *(now[name] for name in own.knotted)], ahead])
        return replace(own, start=start, tones=tones, knots=knots, end=own.end - self.time)


def _moved(rates: Mapping[str, Row], start: Mapping[str, float], time: float) -> dict[str, float]:
    """Signals after a time [s]."""
    names: Sequence[str] = ["1", *start]
    flow: NDArray[np.float64] = np.array([[rates.get(name, {}).get(other, 0.0) for other in names] for name in names])
    values = np.array([1.0, *start.values()])
    term, result = values, values.copy()
    if not np.any(np.linalg.matrix_power(flow, len(names))):  # powers of time end: the sum is exact
        for k in range(1, len(names)):
            term = flow @ term * (time / k)
            result += term
    else:
        from scipy.linalg import expm

        result = expm(flow * time) @ values
    return dict(zip(names[1:], map(float, result[1:]), strict=True))
