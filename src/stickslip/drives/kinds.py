"""What moves the spring's end, the counter-face or the mass itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import ModelError
from stickslip.parameters import finite, parameter, parametric

Row = Mapping[str, float]
LARGEST_FREQUENCY = 1e10  # Hz; more is a wrong unit


@dataclass(frozen=True)
class Motion:
    """A drive as the solver reads it: signals with linear rates, and what each of them moves.

    Attributes
    ----------
    rates : mapping of str to mapping
        Each signal's time derivative as a linear form of the signals and "1".
    start : mapping of str to float
        Value of each signal at time 0.
    tones : tuple of (str, str, float, float)
        Pairs of signals that turn: cosine, sine, angular frequency [rad/s], phase [rad].
    period : float
        Period [s]; infinite where the drive does not repeat.
    force, base, face : mapping of str to float
        Force on the mass [N], displacement of the spring's end [m], displacement of the counter-face [m].
    knots : ndarray or None
        Times [s] (first column) at which the signals in `knotted` take new values (further columns).
    knotted : tuple of str
        The signals of `knots`.
    end : float
        Time [s] up to which the drive is known.
    """

    rates: Mapping[str, Row] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    tones: tuple[tuple[str, str, float, float], ...] = ()
    period: float = math.inf
    force: Row = field(default_factory=dict)
    base: Row = field(default_factory=dict)
    face: Row = field(default_factory=dict)
    knots: NDArray[np.float64] | None = None
    knotted: tuple[str, ...] = ()
    end: float = math.inf


class Drive(Protocol):
    """What the solver asks of a drive."""

    def motion(self) -> Motion:
        """The drive as signals with linear rates."""


def _require(condition: bool, value: str, rule: str, next_step: str, *, of: str = "") -> None:
    if not condition:
        raise ModelError(value, rule, next_step).of(of)


def require_drive(drive: object) -> None:
    """Refuse what does not drive."""
    if isinstance(drive, type) or not hasattr(drive, "motion"):
        raise ModelError(
            f"drive = {drive!r}", "a drive says what moves",
            "give one, as drive=HarmonicBase(1e-3, frequency=2.5), or leave it out",
        ).of("drive")  # fmt: skip


def _check_frequency(frequency: float) -> None:
    _require(
        0 < finite("frequency", frequency, unit="Hz", signed=True) <= LARGEST_FREQUENCY,
        f"frequency = {frequency} Hz",
        f"a drive repeats between 0 and {LARGEST_FREQUENCY:g} times a second",
        "give frequency= in Hz",
        of="frequency",
    )


def _check_speed(speed: float, *, rule: str) -> None:
    _require(speed != 0, "speed = 0 m/s", rule, "give its speed=, or use Release() for a mass at rest", of="speed")


def _tones(tones: Sequence[tuple[float, float, float]]) -> tuple[Motion, Row]:
    """Signals of a sum of cosines (amplitude, frequency [Hz], phase [rad]) and the sum as a linear form."""
    rates: dict[str, Row] = {}
    start: dict[str, float] = {}
    turning = []
    row = {}
    for j, (amplitude, frequency, phase) in enumerate(tones):
        _check_frequency(frequency)
        finite("amplitude", amplitude, unit="m or N", signed=True)
        finite("phase", phase, unit="rad", signed=True)
        cosine, sine, omega = f"cos{j}", f"sin{j}", 2 * math.pi * frequency
        rates |= {cosine: {sine: -omega}, sine: {cosine: omega}}
        start |= {cosine: math.cos(phase), sine: math.sin(phase)}
        turning.append((cosine, sine, omega, phase))
        row[cosine] = amplitude
    period = 1 / tones[0][1] if len(tones) == 1 else math.inf
    return Motion(rates, start, tuple(turning), period), row


@parametric
class Release:
    """Nothing moves: free decay from wherever the mass is let go.

    Examples
    --------
    >>> Release().motion().period
    inf
    """

    label = "Nothing: free decay"

    def motion(self) -> Motion:
        """No signals."""
        return Motion()


@parametric
class HarmonicBase:
    r"""The spring's end moves as :math:`z = Z \cos(2\pi F t + \varphi)` (thesis, equation 3.8).

    Examples
    --------
    >>> HarmonicBase(0.65e-3, frequency=2.5).motion().period
    0.4
    """

    label = "Base moves harmonically"

    amplitude: float = parameter("m", "amplitude", signed=True, note="Z")
    frequency: float = parameter("Hz", "frequency", positive=True, note="F")
    phase: float = parameter("rad", "phase", default=0.0, signed=True)
    contact: str = parameter("", "what the mass rubs on", default="ground", choices=("ground", "base"))

    def __post_init__(self) -> None:
        self.motion()

    def motion(self) -> Motion:
        """One turning pair."""
        motion, row = _tones([(self.amplitude, self.frequency, self.phase)])
        return _moved(motion, base=row, face=row if self.contact == "base" else {})


@parametric
class HarmonicForce:
    r"""A force :math:`P \cos(2\pi F t + \varphi)` on the mass.

    Examples
    --------
    >>> HarmonicForce(1.5, frequency=2.0).motion().period
    0.5
    """

    label = "Harmonic force"

    amplitude: float = parameter("N", "amplitude", signed=True, note="P")
    frequency: float = parameter("Hz", "frequency", positive=True, note="F")
    phase: float = parameter("rad", "phase", default=0.0, signed=True)

    def __post_init__(self) -> None:
        self.motion()

    def motion(self) -> Motion:
        """One turning pair."""
        motion, row = _tones([(self.amplitude, self.frequency, self.phase)])
        return _moved(motion, force=row)


@parametric
class MultiTone:
    """Several tones at once: a drive with dither, two shakers.

    Examples
    --------
    >>> len(MultiTone([(1e-3, 2.0, 0.0), (1e-5, 180.0, 0.0)]).motion().tones)
    2
    """

    label = "Several tones"

    tones: Sequence[tuple[float, float, float]] = parameter(
        "", "tones", note="amplitude [m or N], frequency [Hz] and phase [rad] of every one"
    )
    on: str = parameter(
        "",
        "what the tones move",
        default="base",
        choices=("base", "force", "face"),
        note="the spring's end, the mass (a force), or the counter-face",
    )
    contact: str = parameter(
        "", "what the mass rubs on", default="ground", choices=("ground", "base"), note='for ``on="base"``'
    )

    def __post_init__(self) -> None:
        _require(len(self.tones) > 0, "no tones", "at least one tone is needed", "give (amplitude, frequency, phase)")
        object.__setattr__(self, "tones", tuple(map(tuple, self.tones)))
        _require(
            all(len(tone) == 3 for tone in self.tones),
            f"tones = {self.tones}",
            "a tone is its amplitude, frequency [Hz] and phase [rad]",
            "give three numbers for each",
            of="tones",
        )
        self.motion()

    def motion(self) -> Motion:
        """A turning pair for each tone."""
        motion, row = _tones(self.tones)
        if self.on == "base":
            return _moved(motion, base=row, face=row if self.contact == "base" else {})
        return _moved(motion, force=row) if self.on == "force" else _moved(motion, face=row)


@parametric
class Belt:
    """The counter-face runs at a steady speed under a mass whose spring is held.

    Examples
    --------
    >>> Belt(0.01).motion().face
    {'way': 0.01}
    """

    label = "Belt at a steady speed"

    speed: float = parameter("m/s", "speed of the belt", signed=True, note="not zero")

    def __post_init__(self) -> None:
        _check_speed(self.speed, rule="a belt runs")

    def motion(self) -> Motion:
        """The time that has passed, as the belt's way."""
        return Motion({"way": {"1": 1.0}}, {"way": 0.0}, face={"way": self.speed})


@parametric
class Ramp:
    """The spring's end is pulled at a steady speed over a counter-face at rest.

    Examples
    --------
    >>> Ramp(1e-4).motion().base
    {'way': 0.0001}
    """

    label = "Spring pulled steadily"

    speed: float = parameter("m/s", "speed of the spring's end", signed=True, note="not zero")

    def __post_init__(self) -> None:
        _check_speed(self.speed, rule="a ramp moves")

    def motion(self) -> Motion:
        """The time that has passed, as the ramp's way."""
        return Motion({"way": {"1": 1.0}}, {"way": 0.0}, base={"way": self.speed})


@parametric(eq=False)
class RecordedBase:
    """A recorded base motion: between samples a linear or a cubic (natural spline) piece, solved in closed form.

    After the last sample there is no motion to follow: a longer run is refused.

    Examples
    --------
    >>> RecordedBase([0.0, 1e-3, 0.0, -1e-3], fs=10.0).motion().knots.shape
    (3, 5)
    """

    label = "Recorded base motion"

    samples: ArrayLike = parameter(
        "m", "displacement of the spring's end", size="array", note="two values at least, four for cubic pieces"
    )
    fs: float = parameter("Hz", "sampling rate", positive=True, note="the first sample is at time 0")
    order: int = parameter(
        "",
        "degree of the pieces",
        default=3,
        note="3 or 1; linear pieces kick the base's velocity at every sample: use them with the contact and the damper "
        "on the ground only",
    )
    contact: str = parameter("", "what the mass rubs on", default="ground", choices=("ground", "base"))

    def __post_init__(self) -> None:
        _require(
            self.order in (1, 3),
            f"order = {self.order}",
            "pieces are linear (1) or cubic (3)",
            "choose one",
            of="order",
        )
        _require(
            self.order == 3 or self.contact == "ground",
            "linear pieces under a contact on the base",
            "the base's acceleration must be finite there",
            "use order=3",
        )
        values = np.array(self.samples, dtype=np.float64)
        _require(
            values.ndim == 1 and len(values) >= self.order + 1 and bool(np.all(np.isfinite(values))),
            f"samples of shape {values.shape}",
            f"at least {self.order + 1} finite numbers in one row are needed",
            "cut or mend the record",
        )
        values.flags.writeable = False
        object.__setattr__(self, "samples", values)

    def motion(self) -> Motion:
        """Displacement and its derivatives, set anew at every sample."""
        values = np.asarray(self.samples)
        names = ("z0", "z1", "z2", "z3")
        knots = np.zeros((len(values) - 1, 5))
        knots[:, 0] = np.arange(len(values) - 1) / self.fs
        knots[:, 1] = values[:-1]
        if self.order == 1:
            knots[:, 2] = np.diff(values) * self.fs
        else:
            from scipy.interpolate import CubicSpline

            spline = CubicSpline(np.arange(len(values)) / self.fs, values, bc_type="natural")
            knots[:, 2:] = np.column_stack([spline.c[2], 2 * spline.c[1], 6 * spline.c[0]])
        rates = {"z0": {"z1": 1.0}, "z1": {"z2": 1.0}, "z2": {"z3": 1.0}, "z3": {}}
        row = {"z0": 1.0}
        return Motion(
            rates,
            dict(zip(names, knots[0, 1:], strict=True)),
            base=row,
            face=row if self.contact == "base" else {},
            knots=knots,
            knotted=names,
            end=(len(values) - 1) / self.fs,
        )


@parametric
class SpeedProfile:
    """The spring's end or the counter-face follows a profile of speeds, straight between given instants.

    A motor's trapezoid, a start and a stop, or dither of any shape: triangles, near squares. The displacement starts at
    zero and is a parabola between two instants; after the last one the speed stays.

    Examples
    --------
    >>> SpeedProfile([0.0, 1.0, 3.0, 4.0], [0.0, 0.5, 0.5, 0.0]).motion().knots[:, 1]
    array([0.  , 0.25, 1.25, 1.5 ])
    """

    label = "Profile of speeds"

    times: Sequence[float] = parameter("s", "instants", size="array", note="increasing from 0")
    speeds: Sequence[float] = parameter("m/s", "speeds", size="array", note="one at every instant")
    on: str = parameter(
        "", "what moves", default="base", choices=("base", "face"), note="the spring's end or the counter-face"
    )

    def __post_init__(self) -> None:
        for name in ("times", "speeds"):
            object.__setattr__(self, name, tuple(float(value) for value in getattr(self, name)))
        values = np.array([*self.times, *self.speeds])
        _require(
            len(self.times) == len(self.speeds) >= 2 and bool(np.all(np.isfinite(values))),
            f"{len(self.times)} times and {len(self.speeds)} speeds",
            "both are finite numbers, as many of one as of the other, at least two",
            "give a speed for each instant",
        )
        _require(
            self.times[0] == 0 and bool(np.all(np.diff(self.times) > 0)),
            f"times from {self.times[0]:g} to {self.times[-1]:g} s",
            "instants increase from 0",
            "sort them, and leave out the same instant twice",
        )

    def motion(self) -> Motion:
        """Displacement, speed and acceleration, set anew at every instant."""
        times, speeds = np.array(self.times), np.array(self.speeds)
        steps = np.diff(times)
        ways = np.cumsum([0.0, *(steps * (speeds[1:] + speeds[:-1]) / 2)])
        knots = np.column_stack([times, ways, speeds, [*(np.diff(speeds) / steps), 0.0]])
        names, row = ("z0", "z1", "z2"), {"z0": 1.0}
        return Motion(
            {"z0": {"z1": 1.0}, "z1": {"z2": 1.0}, "z2": {}},
            dict(zip(names, knots[0, 1:], strict=True)),
            base=row if self.on == "base" else {},
            face=row if self.on == "face" else {},
            knots=knots,
            knotted=names,
        )


@parametric
class Dithered:
    r"""Any drive, with a fast small tone along the contact on top: :math:`a \cos(2\pi F t + \varphi)`.

    Examples
    --------
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
        _require(
            not isinstance(self.drive, Dithered),
            "dither on a dithered drive",
            "one tone is put on top",
            "leave one out",
        )
        self.motion()

    def motion(self) -> Motion:
        """The drive's signals and a turning pair; it repeats where the drive holds a whole number of its cycles."""
        own, omega = self.drive.motion(), 2 * math.pi * self.frequency
        _check_frequency(self.frequency)
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


def _moved(motion: Motion, *, force: Row | None = None, base: Row | None = None, face: Row | None = None) -> Motion:
    return Motion(motion.rates, motion.start, motion.tones, motion.period, force or {}, base or {}, face or {})
