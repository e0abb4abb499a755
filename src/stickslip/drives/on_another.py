"""A drive on another one: a fast tone on top of it, its motion imposed on the mass, the same from later on, or one
across it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.drives.kinds import Drive, Motion, Row, check_frequency, common_period, require, require_drive
from stickslip.errors import ModelError
from stickslip.parameters import parameter, parametric


@parametric
class Imposed:
    r"""The mass itself moves as a drive would move the spring's end: what a contact does under it, and no more.

    The friction of a motion that is known beforehand (thesis, sections 3.3 and 4.5): :math:`x(t)` is imposed, mass,
    spring and damper play no part, and the law gives :math:`f(t)`. It takes a law whose contact gives way, of linear
    modes or curved; one that holds the mass would hold the motion.

    Raises
    ------
    ModelError
        A drive that moves no base, or one whose velocity jumps.

    Examples
    --------
    >>> from stickslip.drives.kinds import HarmonicBase
    >>> Imposed(HarmonicBase(1e-3, frequency=2.5)).motion().imposed
    {'cos0': 0.001}
    """

    label = "Motion of the mass, imposed"

    drive: Drive = parameter("", "whose motion of the base the mass has")

    def __post_init__(self) -> None:
        require_drive(self.drive)
        own = self.drive.motion()
        require(
            bool(own.base) and not own.force and not own.face,
            f"{type(self.drive).__name__} imposed",
            "a motion that is imposed is one of a base alone",
            'give a drive with on="base" and contact="ground", as HarmonicBase(1e-3, frequency=2.5)',
            of="drive",
        )
        rates = {name for name in own.base for name in own.rates.get(name, {})}
        jumps = own.knots is not None and any(name in own.knotted and not own.rates[name] for name in rates)
        require(
            not jumps,
            f"{type(self.drive).__name__} of straight pieces, imposed",
            "a mass has no jumps of its velocity",
            "use order=3",
            of="drive",
        )

    def motion(self) -> Motion:
        """The drive's signals, its base's displacement as the mass's own."""
        own = self.drive.motion()
        return replace(own, base={}, imposed=own.base)


@parametric
class Dithered:
    r"""Any drive, with a fast small tone along the contact on top: :math:`a \cos(2\pi F t + \varphi)`.

    Examples
    --------
    >>> from stickslip.drives.kinds import HarmonicBase
    >>> Dithered(HarmonicBase(1e-3, frequency=2.5), amplitude=1e-5, frequency=250.0).motion().period
    0.4
    """

    label = "Drive with dither"

    drive: Drive = parameter("", "what moves the system besides")
    amplitude: float = parameter(
        "m", "amplitude", signed=True, note="a, of the counter-face or of the spring's end; in N of a force on the mass"
    )
    frequency: float = parameter("Hz", "frequency", positive=True, note="F")
    phase: float = parameter("rad", "phase", default=0.0, signed=True)
    on: str = parameter(
        "",
        "what the tone moves",
        default="face",
        choices=("face", "base", "force"),
        note="the counter-face, the spring's end, or the mass (a force)",
    )

    def __post_init__(self) -> None:
        require_drive(self.drive)
        refusal = "dither on a dithered drive", "one tone is put on top", "leave one out"
        require(not isinstance(self.drive, Dithered), *refusal)
        self.motion()

    def motion(self) -> Motion:
        """The drive's signals and a turning pair; it repeats where the drive holds a whole number of its cycles."""
        own, omega = self.drive.motion(), 2 * math.pi * self.frequency
        check_frequency(self.frequency)
        moved = {part: dict(getattr(own, part)) for part in ("force", "base", "face")}
        moved[self.on]["dither"] = self.amplitude
        cycles = own.period * self.frequency
        whole = math.isfinite(cycles) and abs(cycles - round(cycles)) <= 1e-9 * cycles
        still = not own.rates and own.knots is None
        return replace(
            own,
            rates={**own.rates, "dither": {"dither'": -omega}, "dither'": {"dither": omega}},
            start={**own.start, "dither": math.cos(self.phase), "dither'": math.sin(self.phase)},
            tones=(*own.tones, ("dither", "dither'", omega, self.phase)),
            period=1 / self.frequency if still else own.period if whole else math.inf,
            force=moved["force"],
            base=moved["base"],
            face=moved["face"],
        )


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
        shifted = ((c, s, omega, phase + omega * self.time) for c, s, omega, phase in own.tones)
        tones = tuple((c, s, omega, math.remainder(phase, 2 * math.pi)) for c, s, omega, phase in shifted)
        start = _moved(own.rates, own.start, self.time)
        for cosine, sine, _, phase in tones:
            start |= {cosine: math.cos(phase), sine: math.sin(phase)}
        knots = own.knots
        if knots is not None:
            last = int(np.searchsorted(knots[:, 0], self.time, side="right")) - 1
            rates = {name: own.rates.get(name, {}) for name in own.knotted}
            values = dict(zip(own.knotted, map(float, knots[last, 1:]), strict=True))
            now = _moved(rates, values, self.time - knots[last, 0])
            ahead = knots[last + 1 :] - np.append(self.time, np.zeros(len(own.knotted)))
            knots = np.vstack([[0.0, *(now[name] for name in own.knotted)], ahead])
        return replace(own, start=start, tones=tones, knots=knots, end=own.end - self.time)


class Both(NamedTuple):
    """Two drives at once, along the first axis of a plane and along the second.

    Raises
    ------
    ModelError
        One of them is none, imposes a motion, or both are recorded.
    """

    first: Drive
    second: Drive

    @property
    def motions(self) -> tuple[Motion, Motion]:
        """The signals of either, which bear the number of their axis."""
        for drive in self:
            require_drive(drive)
        return _numbered(self.first.motion(), 1), _numbered(self.second.motion(), 2)

    def motion(self) -> Motion:
        """The signals of both as one motion's."""
        first, second = self.motions
        require(
            not (first.imposed or second.imposed or (first.knots is not None and second.knots is not None)),
            f"drives = {tuple(self)}",
            "in a plane no motion is imposed on the mass, and what is recorded moves it along one axis",
            "give a drive of tones, or a belt",
            of="drives",
        )
        periods = [motion.period for motion in (first, second) if motion.rates]
        endless = not all(map(math.isfinite, periods)) or not periods
        known = second if first.knots is None else first
        return Motion(
            rates={**first.rates, **second.rates},
            start={**first.start, **second.start},
            tones=(*first.tones, *second.tones),
            period=math.inf if endless else common_period([1 / period for period in periods]),
            force={**first.force, **second.force},
            base={**first.base, **second.base},
            face={**first.face, **second.face},
            knots=known.knots,
            knotted=known.knotted,
            end=min(first.end, second.end),
        )


def _numbered(motion: Motion, axis: int) -> Motion:
    """A motion whose signals bear the number of their axis."""

    def of(row: Row) -> dict[str, float]:
        return {name if name == "1" else f"{name} {axis}": value for name, value in row.items()}

    return replace(
        motion,
        rates={f"{name} {axis}": of(row) for name, row in motion.rates.items()},
        start=of(motion.start),
        tones=tuple((f"{c} {axis}", f"{s} {axis}", omega, phase) for c, s, omega, phase in motion.tones),
        force=of(motion.force),
        base=of(motion.base),
        face=of(motion.face),
        knotted=tuple(f"{name} {axis}" for name in motion.knotted),
    )


def _moved(rates: Mapping[str, Row], start: Mapping[str, float], time: float) -> dict[str, float]:
    """Signals after a time [s]."""
    names: Sequence[str] = ["1", *start]
    flow: Array = np.array([[rates.get(name, {}).get(other, 0.0) for other in names] for name in names])
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
