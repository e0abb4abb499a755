"""What moves the spring's end, the counter-face or the mass itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import ModelError

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


def _require(condition: bool, value: str, rule: str, next_step: str) -> None:
    if not condition:
        raise ModelError(value, rule, next_step)


def require_drive(drive: object) -> None:
    """Refuse what does not drive."""
    _require(
        hasattr(drive, "motion") and not isinstance(drive, type), f"drive = {drive!r}", "a drive says what moves",
        "give one, as drive=HarmonicBase(1e-3, frequency=2.5), or leave it out",
    )  # fmt: skip


def _finite(value: object) -> bool:
    try:
        return math.isfinite(value)  # type: ignore[arg-type]
    except TypeError:
        return False  # no number at all


def _check_frequency(frequency: float) -> None:
    _require(
        _finite(frequency) and 0 < frequency <= LARGEST_FREQUENCY,
        f"frequency = {frequency} Hz",
        f"a drive repeats between 0 and {LARGEST_FREQUENCY:g} times a second",
        "give frequency= in Hz",
    )


def _check_finite(**values: float) -> None:
    for name, value in values.items():
        _require(_finite(value), f"{name} = {value}", f"{name} is a finite number", f"correct {name}=")


def _check_speed(speed: float, *, rule: str) -> None:
    _check_finite(speed=speed)
    _require(speed != 0, "speed = 0 m/s", rule, "give its speed=, or use Release() for a mass at rest")


def _check_contact(contact: str) -> None:
    _require(
        contact in ("ground", "base"),
        f"contact = '{contact}'",
        "the mass rubs on the 'ground' or on the 'base'",
        "choose one of the two",
    )


def _tones(tones: Sequence[tuple[float, float, float]]) -> tuple[Motion, Row]:
    """Signals of a sum of cosines (amplitude, frequency [Hz], phase [rad]) and the sum as a linear form."""
    rates: dict[str, Row] = {}
    start: dict[str, float] = {}
    turning = []
    row = {}
    for j, (amplitude, frequency, phase) in enumerate(tones):
        _check_frequency(frequency)
        _check_finite(amplitude=amplitude, phase=phase)
        cosine, sine, omega = f"cos{j}", f"sin{j}", 2 * math.pi * frequency
        rates |= {cosine: {sine: -omega}, sine: {cosine: omega}}
        start |= {cosine: math.cos(phase), sine: math.sin(phase)}
        turning.append((cosine, sine, omega, phase))
        row[cosine] = amplitude
    period = 1 / tones[0][1] if len(tones) == 1 else math.inf
    return Motion(rates, start, tuple(turning), period), row


@dataclass(frozen=True)
class Release:
    """Nothing moves: free decay from wherever the mass is let go.

    Examples
    --------
    >>> Release().motion().period
    inf
    """

    def motion(self) -> Motion:
        """No signals."""
        return Motion()


@dataclass(frozen=True)
class HarmonicBase:
    r"""The spring's end moves as :math:`z = Z \cos(2\pi F t + \varphi)` (thesis, equation 3.8).

    Attributes
    ----------
    amplitude : float
        Z [m].
    frequency : float
        F [Hz].
    phase : float
        Phase [rad].
    contact : {"ground", "base"}
        Whether the mass rubs on the ground or on the moving base.

    Examples
    --------
    >>> HarmonicBase(0.65e-3, frequency=2.5).motion().period
    0.4
    """

    amplitude: float
    frequency: float
    phase: float = 0.0
    contact: str = "ground"

    def __post_init__(self) -> None:
        _check_contact(self.contact)
        self.motion()

    def motion(self) -> Motion:
        """One turning pair."""
        motion, row = _tones([(self.amplitude, self.frequency, self.phase)])
        return _moved(motion, base=row, face=row if self.contact == "base" else {})


@dataclass(frozen=True)
class HarmonicForce:
    r"""A force :math:`P \cos(2\pi F t + \varphi)` on the mass.

    Attributes
    ----------
    amplitude : float
        P [N].
    frequency : float
        F [Hz].
    phase : float
        Phase [rad].

    Examples
    --------
    >>> HarmonicForce(1.5, frequency=2.0).motion().period
    0.5
    """

    amplitude: float
    frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        self.motion()

    def motion(self) -> Motion:
        """One turning pair."""
        motion, row = _tones([(self.amplitude, self.frequency, self.phase)])
        return _moved(motion, force=row)


@dataclass(frozen=True)
class MultiTone:
    """Several tones at once: a drive with dither, two shakers.

    Attributes
    ----------
    tones : sequence of (float, float, float)
        Amplitude [m or N], frequency [Hz] and phase [rad] of each.
    on : {"base", "force", "face"}
        What they move: the spring's end, the mass (a force), or the counter-face.
    contact : {"ground", "base"}
        For ``on="base"``: what the mass rubs on.

    Examples
    --------
    >>> len(MultiTone([(1e-3, 2.0, 0.0), (1e-5, 180.0, 0.0)]).motion().tones)
    2
    """

    tones: Sequence[tuple[float, float, float]]
    on: str = "base"
    contact: str = "ground"

    def __post_init__(self) -> None:
        _check_contact(self.contact)
        _require(len(self.tones) > 0, "no tones", "at least one tone is needed", "give (amplitude, frequency, phase)")
        _require(
            self.on in ("base", "force", "face"),
            f"on = '{self.on}'",
            "tones move the 'base', the 'face' or act as 'force'",
            "choose one of the three",
        )
        object.__setattr__(self, "tones", tuple(map(tuple, self.tones)))
        _require(
            all(len(tone) == 3 for tone in self.tones),
            f"tones = {self.tones}",
            "a tone is its amplitude, frequency [Hz] and phase [rad]",
            "give three numbers for each",
        )
        self.motion()

    def motion(self) -> Motion:
        """A turning pair for each tone."""
        motion, row = _tones(self.tones)
        if self.on == "base":
            return _moved(motion, base=row, face=row if self.contact == "base" else {})
        return _moved(motion, force=row) if self.on == "force" else _moved(motion, face=row)


@dataclass(frozen=True)
class Belt:
    """The counter-face runs at a steady speed under a mass whose spring is held.

    Attributes
    ----------
    speed : float
        Speed of the belt [m/s]; not zero.

    Examples
    --------
    >>> Belt(0.01).motion().face
    {'way': 0.01}
    """

    speed: float

    def __post_init__(self) -> None:
        _check_speed(self.speed, rule="a belt runs")

    def motion(self) -> Motion:
        """The time that has passed, as the belt's way."""
        return Motion({"way": {"1": 1.0}}, {"way": 0.0}, face={"way": self.speed})


@dataclass(frozen=True)
class Ramp:
    """The spring's end is pulled at a steady speed over a counter-face at rest.

    Attributes
    ----------
    speed : float
        Speed of the spring's end [m/s]; not zero.

    Examples
    --------
    >>> Ramp(1e-4).motion().base
    {'way': 0.0001}
    """

    speed: float

    def __post_init__(self) -> None:
        _check_speed(self.speed, rule="a ramp moves")

    def motion(self) -> Motion:
        """The time that has passed, as the ramp's way."""
        return Motion({"way": {"1": 1.0}}, {"way": 0.0}, base={"way": self.speed})


@dataclass(frozen=True, eq=False)
class RecordedBase:
    """A recorded base motion: between samples a linear or a cubic (natural spline) piece, solved in closed form.

    After the last sample there is no motion to follow: a longer run is refused.

    Attributes
    ----------
    samples : array_like
        Displacement of the spring's end [m], n values, at least two (four for cubic).
    fs : float
        Sampling rate [Hz]; the first sample is at time 0.
    order : {3, 1}
        Degree of the pieces. Linear pieces kick the base's velocity at every sample: use them with the contact and
        the damper on the ground only.
    contact : {"ground", "base"}
        Whether the mass rubs on the ground or on the moving base.

    Examples
    --------
    >>> RecordedBase([0.0, 1e-3, 0.0, -1e-3], fs=10.0).motion().knots.shape
    (3, 5)
    """

    samples: ArrayLike
    fs: float
    order: int = 3
    contact: str = "ground"

    def __post_init__(self) -> None:
        _check_contact(self.contact)
        _require(_finite(self.fs) and self.fs > 0, f"fs = {self.fs} Hz", "the rate is positive", "give fs= in Hz")
        _require(self.order in (1, 3), f"order = {self.order}", "pieces are linear (1) or cubic (3)", "choose one")
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


@dataclass(frozen=True)
class SpeedProfile:
    """The spring's end or the counter-face follows a profile of speeds, straight between given instants.

    A motor's trapezoid, a start and a stop, or dither of any shape: triangles, near squares. The displacement starts at
    zero and is a parabola between two instants; after the last one the speed stays.

    Attributes
    ----------
    times : sequence of float
        Instants [s], increasing from 0.
    speeds : sequence of float
        Speed at each [m/s].
    on : {"base", "face"}
        What they move: the spring's end or the counter-face.

    Examples
    --------
    >>> SpeedProfile([0.0, 1.0, 3.0, 4.0], [0.0, 0.5, 0.5, 0.0]).motion().knots[:, 1]
    array([0.  , 0.25, 1.25, 1.5 ])
    """

    times: Sequence[float]
    speeds: Sequence[float]
    on: str = "base"

    def __post_init__(self) -> None:
        _require(self.on in ("base", "face"), f"on = '{self.on}'", "speeds move the 'base' or the 'face'", "choose one")
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


@dataclass(frozen=True)
class Dithered:
    r"""Any drive, with a fast small tone along the contact on top: :math:`a \cos(2\pi F t + \varphi)`.

    Attributes
    ----------
    drive : Drive
        What moves the system besides.
    amplitude : float
        a [m] of the counter-face or of the spring's end, or [N] of a force on the mass.
    frequency : float
        F [Hz].
    phase : float
        Phase [rad].
    on : {"face", "base", "force"}
        What the tone moves: the counter-face, the spring's end, or the mass (a force).

    Examples
    --------
    >>> Dithered(HarmonicBase(1e-3, frequency=2.5), amplitude=1e-5, frequency=250.0).motion().period
    0.4
    """

    drive: Drive
    amplitude: float
    frequency: float
    phase: float = 0.0
    on: str = "face"

    def __post_init__(self) -> None:
        require_drive(self.drive)
        _require(self.on in ("face", "base", "force"), f"on = '{self.on}'",
                 "dither moves the 'face', the 'base' or acts as 'force'", "choose one of the three")  # fmt: skip
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
        _check_finite(amplitude=self.amplitude, phase=self.phase)
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
