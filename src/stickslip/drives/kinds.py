"""What moves the spring's end, the counter-face or the mass itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.errors import ModelError
from stickslip.parameters import finite, parameter, parametric

Row = Mapping[str, float]
LARGEST_FREQUENCY = 1e10  # Hz; more is a wrong unit
LONGEST = 1000  # cycles of a tone in a period; by more, any two numbers nearly have one
MOST_SAMPLES = 2**20  # of a signal that is given as a function
CRANKED = 256  # places of a turn from which a crank's cosines come: of the shortest rod the 256th is below 1e-100
FAINTEST = 1e-10  # of a crank's length: fainter cosines are left out
SHORTEST_ROD = 1.5  # times the crank: a shorter one nearly stops at its dead centre, and has cosines without end
SAME = 1e-9  # of a frequency: so near a ratio of whole numbers is one


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
    imposed : mapping of str to float
        Displacement that the mass itself has [m], whatever acts on it.
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
    imposed: Row = field(default_factory=dict)
    knots: Array | None = None
    knotted: tuple[str, ...] = ()
    end: float = math.inf


class Drive(Protocol):
    """What the solver asks of a drive."""

    def motion(self) -> Motion:
        """The drive as signals with linear rates."""


def require(condition: bool, value: str, rule: str, next_step: str, *, of: str = "") -> None:
    """Refuse a value of a drive, with its rule and the next step, where a condition does not hold."""
    if not condition:
        raise ModelError(value, rule, next_step).of(of)


def require_drive(drive: object) -> None:
    """Refuse what does not drive."""
    if isinstance(drive, type) or not hasattr(drive, "motion"):
        raise ModelError(
            f"drive = {drive!r}",
            "a drive says what moves",
            "give one, as drive=HarmonicBase(1e-3, frequency=2.5), or leave it out",
        ).of("drive")


def check_frequency(frequency: float) -> None:
    """Refuse a frequency [Hz] that no drive has."""
    require(
        0 < finite("frequency", frequency, unit="Hz", signed=True) <= LARGEST_FREQUENCY,
        f"frequency = {frequency} Hz",
        f"a drive repeats between 0 and {LARGEST_FREQUENCY:g} times a second",
        "give frequency= in Hz",
        of="frequency",
    )


def _check_speed(speed: float, *, rule: str) -> None:
    require(speed != 0, "speed = 0 m/s", rule, "give its speed=, or use Release() for a mass at rest", of="speed")


def _tones(tones: Sequence[tuple[float, float, float]]) -> tuple[Motion, Row]:
    """Signals of a sum of cosines (amplitude, frequency [Hz], phase [rad]) and the sum as a linear form."""
    rates: dict[str, Row] = {}
    start: dict[str, float] = {}
    turning = []
    row = {}
    for j, (amplitude, frequency, phase) in enumerate(tones):
        check_frequency(frequency)
        finite("amplitude", amplitude, unit="m or N", signed=True)
        finite("phase", phase, unit="rad", signed=True)
        cosine, sine, omega = f"cos{j}", f"sin{j}", 2 * math.pi * frequency
        rates |= {cosine: {sine: -omega}, sine: {cosine: omega}}
        start |= {cosine: math.cos(phase), sine: math.sin(phase)}
        turning.append((cosine, sine, omega, phase))
        row[cosine] = amplitude
    return Motion(rates, start, tuple(turning), common_period([frequency for _, frequency, _ in tones])), row


def common_period(frequencies: Sequence[float]) -> float:
    """Least time [s] in which each frequency [Hz] has whole cycles; infinite where there is none.

    Examples
    --------
    >>> common_period([2.0, 3.0]), common_period([2.5, 2.5 * 2**0.5])
    (1.0, inf)
    """
    if len(frequencies) == 1:
        return 1 / frequencies[0]
    ratios = [Fraction(frequency / frequencies[0]).limit_denominator(LONGEST) for frequency in frequencies]
    exact = [abs(f - r * frequencies[0]) <= SAME * f for f, r in zip(frequencies, ratios, strict=True)]
    if not all(exact):
        return math.inf
    cycles = math.lcm(*(ratio.denominator for ratio in ratios))  # of the first tone, in which each has whole ones
    spare = math.gcd(*(int(ratio * cycles) for ratio in ratios))
    return cycles / spare / frequencies[0] if cycles // spare <= LONGEST else math.inf


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
        require(len(self.tones) > 0, "no tones", "at least one tone is needed", "give (amplitude, frequency, phase)")
        object.__setattr__(self, "tones", tuple(map(tuple, self.tones)))
        require(
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
class Crank:
    r"""A motor turns a crank whose rod moves the spring's end: strokes that no shaker has (thesis, section 8.2).

    .. math:: z = r \cos\theta + \sqrt{l^2 - r^2 \sin^2\theta} - \bar z, \qquad \theta = 2\pi F t + \varphi

    less its mean, as a sum of cosines up to a ten-thousand-millionth of the crank. Without a rod it is a Scotch yoke,
    whose motion is one cosine.

    Raises
    ------
    ModelError
        A rod that is too short to pass over the crank evenly.

    Examples
    --------
    >>> len(Crank(0.05, frequency=2.0).motion().tones), len(Crank(0.05, frequency=2.0, rod=0.2).motion().tones)
    (1, 6)
    """

    label = "Crank, or Scotch yoke"

    radius: float = parameter("m", "length of the crank", positive=True, note="r: half of the stroke")
    frequency: float = parameter("Hz", "turns in a second", positive=True, note="F")
    rod: float | None = parameter(
        "m", "length of the connecting rod", default=None, positive=True, note="l; left out: a Scotch yoke"
    )
    phase: float = parameter("rad", "phase", default=0.0, signed=True)

    def __post_init__(self) -> None:
        require(
            self.rod is None or self.rod >= SHORTEST_ROD * self.radius,
            f"rod = {self.rod} m on a crank of {self.radius:g} m",
            f"a rod is at least {SHORTEST_ROD:g} times as long as its crank",
            "give a longer rod=, or none for a Scotch yoke",
            of="rod",
        )
        self.motion()

    def tones(self) -> list[tuple[float, float, float]]:
        """Amplitude [m], frequency [Hz] and phase [rad] of every cosine."""
        turned = 2 * math.pi * np.arange(CRANKED) / CRANKED
        z = self.radius * np.cos(turned)
        if self.rod is not None:
            z = z + np.sqrt(self.rod**2 - (self.radius * np.sin(turned)) ** 2)
        cosines = 2 * np.fft.rfft(z).real / CRANKED
        kept = [k for k in range(1, CRANKED // 2) if abs(cosines[k]) > FAINTEST * self.radius]
        return [(float(cosines[k]), k * self.frequency, k * self.phase) for k in kept]

    def motion(self) -> Motion:
        """A turning pair for every cosine."""
        motion, row = _tones(self.tones())
        return _moved(motion, base=row)


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
class Recorded:
    """A recorded or any other force, or motion of the spring's end or the counter-face, in pieces between its samples.

    A chirp, a step, a pulse, a ramp, a shaker's table. Each piece is a polynomial, which the solver takes in closed
    form: cubic (spline through all samples, its third derivative continuous at the second from either end; de Boor, A
    Practical Guide to Splines, 1978), linear, or of a force level. After the last sample nothing is known: a longer run
    is refused.

    Examples
    --------
    >>> Recorded([0.0, 1e-3, 0.0, -1e-3], fs=10.0).motion().knots.shape
    (3, 5)
    >>> pulse = Recorded([0.0, 5.0, 0.0, 0.0], times=[0.0, 1.0, 1.2, 3.0], on="force", order=0)
    >>> pulse.motion().knots[:, :2].tolist()
    [[0.0, 0.0], [1.0, 5.0], [1.2, 0.0]]
    """

    label = "Recorded motion or force"

    samples: ArrayLike = parameter(
        "m", "displacement", size="array", note="in N of a force; two values at least, four for cubic pieces"
    )
    fs: float | None = parameter(
        "Hz", "sampling rate", default=None, positive=True, note="the first sample is at time 0"
    )
    times: Sequence[float] | None = parameter(
        "s", "instants of the samples", default=None, size="array", note="in place of fs, increasing from 0"
    )
    on: str = parameter(
        "",
        "what it moves",
        default="base",
        choices=("base", "force", "face"),
        note="the spring's end, the mass (a force), or the counter-face",
    )
    order: int = parameter(
        "",
        "degree of the pieces",
        default=3,
        note="3, 1 or, of a force, 0: each sample holds until the next; linear pieces kick the base's velocity at "
        "every sample: use them with the contact and the damper on the ground only",
    )
    contact: str = parameter(
        "", "what the mass rubs on", default="ground", choices=("ground", "base"), note='for ``on="base"``'
    )

    def __post_init__(self) -> None:
        degrees = {"force": (0, 1, 3), "base": (1, 3), "face": (3,)}[self.on]
        require(
            self.order in degrees,
            f"order = {self.order} on the {self.on}",
            f"pieces of a {self.on} are of degree {' or '.join(map(str, degrees))}",
            "choose one",
            of="order",
        )
        require(
            self.order == 3 or self.contact == "ground",
            "linear pieces under a contact on the base",
            "the base's acceleration must be finite there",
            "use order=3",
        )
        values, least = np.array(self.samples, dtype=np.float64), max(self.order, 1) + 1
        require(
            values.ndim == 1 and len(values) >= least and bool(np.all(np.isfinite(values))),
            f"samples of shape {values.shape}",
            f"at least {least} finite numbers in one row are needed",
            "cut or mend the record",
        )
        require(
            (self.fs is None) != (self.times is None),
            f"fs = {self.fs}, times = {'None' if self.times is None else 'given'}",
            "samples have one rate or their instants",
            "give one of the two",
            of="fs",
        )
        if self.times is not None:
            _require_increasing(self.times, len(values))
            object.__setattr__(self, "times", tuple(map(float, self.times)))
        values.flags.writeable = False
        object.__setattr__(self, "samples", values)

    @classmethod
    def of(
        cls,
        signal: Callable[[float], float],
        *,
        duration: float,
        error: float,
        on: str = "base",
        contact: str = "ground",
    ) -> Recorded:
        """A smooth function of time, sampled so densely that its cubic pieces are as near as asked for.

        Parameters
        ----------
        signal : callable
            Displacement [m], or force [N], at a time [s].
        duration : float
            How long it lasts [s].
        error : float
            Largest distance of the pieces from it, at seven instants in each piece [m or N].
        on, contact : str
            As of the class.

        Returns
        -------
        Recorded

        Raises
        ------
        ModelError
            No million of samples comes as near.

        Examples
        --------
        >>> chirp = Recorded.of(lambda t: math.cos(math.pi * t * (1 + 3 * t)), duration=2.0, error=1e-6, on="force")
        >>> len(chirp.samples), chirp.error < 1e-6
        (2049, True)
        """
        finite("duration", duration, unit="s")
        from scipy.interpolate import CubicSpline

        count = 8
        while count < MOST_SAMPLES:
            count *= 2
            fine = np.arange(8 * count + 1) * (duration / (8 * count))
            values = np.array([float(signal(time)) for time in fine])
            if not np.max(np.abs(CubicSpline(fine[::8], values[::8])(fine) - values)) > error:
                return cls(values[::8], count / duration, on=on, contact=contact)
        raise ModelError(
            f"error = {error} of a signal of {duration:g} s",
            f"{MOST_SAMPLES} samples come as near to a smooth signal",
            "allow more, or give samples= at the times= where it jumps, with order=0 or 1",
        )

    @property
    def error(self) -> float:
        """How far between samples the pieces may be from what was sampled [m or N]; NaN of few samples.

        What every second sample misses of the others, over what half the distance gains: 15 for cubic pieces, 3 for
        linear ones (Richardson). Level pieces, and instants that are stated, are the signal itself: 0.
        """
        values, degree = np.asarray(self.samples), self.order
        if degree == 0 or self.times is not None:
            return 0.0
        known = np.arange(0, len(values), 2)
        if len(known) <= degree:
            return math.nan
        coarse = self._curve(known.astype(np.float64), values[known])(np.arange(known[-1] + 1))
        return float(np.max(np.abs(coarse - values[: known[-1] + 1])) / (2.0 ** (degree + 1) - 1))

    def _curve(self, times: Array, values: Array) -> Any:
        """The pieces as a function of time, and what its derivatives are."""
        from scipy.interpolate import CubicSpline, make_interp_spline

        return CubicSpline(times, values) if self.order == 3 else make_interp_spline(times, values, k=self.order)

    def motion(self) -> Motion:
        """The signal and its derivatives, set anew at every sample."""
        values = np.asarray(self.samples)
        times = np.arange(len(values)) / self.fs if self.fs is not None else np.array(self.times)
        if self.order == 3:
            slopes = self._curve(times, values).c
            columns = [values[:-1], slopes[2], 2 * slopes[1], 6 * slopes[0]]
        else:
            columns = [values[:-1], *([np.diff(values) / np.diff(times)] if self.order else [])]
        motion = _pieces(times[:-1], columns, self.on, end=float(times[-1]))
        return replace(motion, face=motion.base) if self.contact == "base" and self.on == "base" else motion


def _require_increasing(times: Sequence[float], count: int) -> None:
    """Refuse instants that are not those of so many values, increasing from 0."""
    values = np.asarray(times, dtype=np.float64)
    require(
        values.shape == (count,) and bool(np.all(np.isfinite(values))),
        f"{values.size} times of {count} values",
        "each value has its instant, a finite number",
        "give as many of one as of the other",
        of="times",
    )
    require(
        values[0] == 0 and bool(np.all(np.diff(values) > 0)),
        f"times from {values[0]:g} to {values[-1]:g} s",
        "instants increase from 0",
        "sort them, and leave out the same instant twice",
        of="times",
    )


def _pieces(times: Array, columns: Sequence[ArrayLike], on: str, *, end: float = math.inf) -> Motion:
    """A drive of polynomials, whose value and derivatives are set anew at each instant."""
    names = tuple(f"z{j}" for j in range(len(columns)))
    knots = np.column_stack([times, *columns])
    rates: dict[str, Row] = {name: {after: 1.0} for name, after in pairwise(names)}
    rates[names[-1]] = {}
    start = dict(zip(names, map(float, knots[0, 1:]), strict=True))
    row = {names[0]: 1.0}
    force, base, face = (row if on == part else {} for part in ("force", "base", "face"))
    return Motion(rates, start, force=force, base=base, face=face, knots=knots, knotted=names, end=end)


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
        require(
            len(self.times) == len(self.speeds) >= 2 and bool(np.all(np.isfinite(values))),
            f"{len(self.times)} times and {len(self.speeds)} speeds",
            "both are finite numbers, as many of one as of the other, at least two",
            "give a speed for each instant",
        )
        _require_increasing(self.times, len(self.speeds))

    def motion(self) -> Motion:
        """Displacement, speed and acceleration, set anew at every instant."""
        times, speeds = np.array(self.times), np.array(self.speeds)
        steps = np.diff(times)
        ways = np.cumsum([0.0, *(steps * (speeds[1:] + speeds[:-1]) / 2)])
        return _pieces(times, [ways, speeds, [*(np.diff(speeds) / steps), 0.0]], self.on)


def _moved(motion: Motion, *, force: Row | None = None, base: Row | None = None, face: Row | None = None) -> Motion:
    return Motion(motion.rates, motion.start, motion.tones, motion.period, force or {}, base or {}, face or {})
