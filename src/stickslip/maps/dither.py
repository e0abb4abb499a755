"""How much dither keeps a contact from sticking, and what it makes of the friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.contact.frequency_transition import Transition
from stickslip.drives.kinds import Belt
from stickslip.drives.on_another import Dithered
from stickslip.errors import ModelError, SolveError
from stickslip.estimate import Doubt, Estimate, Result, Status
from stickslip.maps.basins import Start
from stickslip.oscillator import Oscillator
from stickslip.solve.poincare import tables
from stickslip.solve.simulate import simulate
from stickslip.solve.tables import require_oscillator
from stickslip.solve.trajectory import Trajectory

FAST = 20.0  # dither periods in one of the slow motion, at least, where no frequency is given
SPLIT = 4.0  # dither periods in the longest stick, at least, where no frequency is given
FORGET = 0.4  # of the run: what is not looked at
LADDER = np.geomspace(0.01, 1000.0, 64)  # amplitudes tried, in those whose force is the friction
MARGIN = 1.05  # times the smallest amplitude: at the very edge a stick comes now and then
BEYOND = 1.1  # times the smallest amplitude, that must do as well: no lucky one
PATIENT = 3  # times longer: the run with the margin
RELEASED = (1.0, -1.0, 0.5, -0.5, 0.0)  # of the largest displacement: where dither is switched on as well
PROBED = (0.1, 0.25, 0.5, 0.75, 0.9)  # sliding speeds over the dither's at which the friction is averaged
LARGE = 10  # times the dither: where the averaged law should hold if friction is small beside inertia
TRUSTED = 0.05  # of the friction: where the averaged law is off by more it is said
SLOW = 40.0  # dither periods in one of the probe's own, so that it averages
UNITS = {"face": "m", "base": "m", "force": "N"}


@dataclass(frozen=True, eq=False, repr=False)
class Dither(Result):
    """The smallest dither that removes stick-slip.

    Attributes
    ----------
    frequency : float
        Of the dither [Hz].
    amplitude : Estimate
        Smallest one that removes macroscopic sticks, and 5 % [m, of a force N]; the interval's low end does not.
    on : {"face", "base", "force"}
        What it moves.
    speed : float
        Amplitude of the velocity that it gives the contact [m/s].
    system : Oscillator
        The system with this dither.
    sticks : tuple of float
        Longest stick without and with it [s].
    tried : tuple of (float, float)
        Every frequency tried, with its smallest amplitude; NaN where none was found.
    scan : ndarray (n, 2)
        Amplitudes tried at the frequency, and the longest stick with each [s]; NaN where it is not known, because runs
        could not be followed.
    averaged : ndarray (n, 4)
        Sliding speed over the dither's; mean friction over sliding friction by the averaged law, by simulation with
        this dither, and with one ten times as large; NaN where a run did not end.
    checks : tuple of str
        What was looked at, and where the averaged law does not hold.
    """

    frequency: float
    amplitude: Estimate
    on: str
    speed: float
    system: Oscillator
    sticks: tuple[float, float]
    tried: tuple[tuple[float, float], ...]
    scan: Array
    averaged: Array
    checks: tuple[str, ...]

    def __repr__(self) -> str:
        return "\n  ".join([f"Dither on the {self.on} at {self.frequency:g} Hz:", str(self.amplitude), *self.checks])


def dithered_friction(velocity: ArrayLike, *, speed: float) -> Array:
    r"""Which share of Coulomb friction is left on average, where fast dither is put on top of sliding?

    .. math:: \bar f / F = \frac{2}{\pi} \arcsin \frac{v}{a w}, \quad |v| < a w

    and all of it above: the contact slides to and fro within a period of the dither, and only the difference of both
    times is left (Thomsen 1999). It holds where dither is fast, and where its inertia m a w^2 is much more than the
    friction, so that friction does not move the mass within a period.

    Parameters
    ----------
    velocity : array_like
        Sliding velocity v without the dither [m/s].
    speed : float
        Velocity amplitude a w of the dither [m/s].

    Returns
    -------
    ndarray
        Mean friction over sliding friction, signed as the velocity.

    Raises
    ------
    ModelError
        The speed is not positive.

    Examples
    --------
    >>> dithered_friction([0.1, 0.5, 2.0], speed=1.0).round(6)
    array([0.063769, 0.333333, 1.      ])
    """
    if not (speed > 0 and math.isfinite(speed)):
        raise ModelError(f"speed = {speed} m/s", "dither moves", "give its velocity amplitude, 2 pi F a")
    return 2 / math.pi * np.arcsin(np.clip(np.asarray(velocity, dtype=np.float64) / speed, -1.0, 1.0))


def dither(
    system: Oscillator,
    *,
    frequency: float | Sequence[float] | None = None,
    transition: Transition | None = None,
    on: str = "face",
    start: Start | None = None,
    cycles: int = 40,
    precision: float = 0.02,
) -> Dither:
    """Which is the smallest dither along the contact that removes stick-slip?

    A tone is put on top of the drive. A stick is macroscopic if it outlasts a period of the dither: none may, once two
    fifths of the run are over, whether it begins at the start, where stick-slip is fastest, or from rest in five
    places: dithered motions with and without sticks can stand beside each other. Amplitudes are tried from small to
    large, a step of 20 %, by exact simulation, and the first that does it is bisected to the precision. At the very
    edge a stick comes now and then: the answer is 5 % above, where a run three times as long must have none, and 10 %
    must do it too. Of several frequencies that of the smallest amplitude is taken.

    How a contact rings while it sticks says where dither works (thesis, section 8.2): below the ring's frequency the
    mass follows the dither, above it the mass stands still and the contact must give way. With a `transition` the
    dither is at least an octave above the ring.

    Parameters
    ----------
    system : Oscillator
        What sticks and slips, with its drive (harmonic, belt, ramp).
    frequency : float or sequence of float, optional
        Of the dither [Hz]; where left out, from the transition, or 20 times the slow motion's and fast enough for four
        periods within the longest stick.
    transition : Transition, optional
        What :func:`transition` found in a record of the contact.
    on : {"face", "base", "force"}
        What the dither moves: the counter-face, the spring's end, or the mass (a force).
    start : mapping, optional
        As in ``simulate``.
    cycles : int
        Length of a run, in periods of the slow motion: the drive's or the oscillator's own, whichever is longer.
    precision : float
        Relative width left of the amplitude's range.

    Returns
    -------
    Dither

    Raises
    ------
    ModelError
        An argument has no meaning.
    SolveError
        The system never sticks, or never slips, or no amplitude is enough.

    Examples
    --------
    >>> from stickslip.laws.coulomb import Coulomb
    >>> slider = Oscillator(mass=1, stiffness=1, law=Coulomb(1.0, static=1.5), drive=Belt(0.5), damping=0.02)
    >>> dithered = dither(slider, frequency=5.0)
    >>> print(dithered.amplitude, dithered.sticks[1] < 1 / 5.0)
    dither amplitude 0.000391 m (95 %: 0.000368 to 0.000391) True
    """
    _require(system, on, cycles, precision)
    period = _slow_period(system)
    duration = cycles * period
    plain = simulate(system, duration=duration, start=start)
    stick = longest_stick(plain, FORGET * duration)
    if stick == 0.0:
        raise SolveError(
            "the system never sticks",
            "dither removes sticks, and there is nothing to remove",
            "take a system that sticks and slips, or leave the dither out",
        )
    if stick >= 0.999 * (1 - FORGET) * duration:
        raise SolveError(
            "the mass is held all the time",
            "dither removes stick-slip, and nothing slips here",
            "raise the drive's amplitude or speed, or start= it sliding",
        )
    search = _Search(system, on, (start or {}, *_moments(plain)), duration)
    friction = float(np.max(np.abs(plain.sample(np.linspace(0, plain.duration, 4001), ("friction",))[0])))
    candidates = _frequencies(frequency, transition, period, stick)
    amplitudes = [search.smallest(f, friction, stick, precision) for f in candidates]
    reached = [amplitude for amplitude in amplitudes if amplitude is not None]
    lost = sum(search.lost.values())
    if not reached and lost:
        raise SolveError(
            f"at {lost} amplitudes a run could not be followed, and at no other the stick of {stick:.3g} s goes",
            "an amplitude is found by runs that can be followed",
            "simulate() the system with this dither to see why one can not, or give another frequency=",
        )
    if not reached:
        raise SolveError(
            f"no dither of {', '.join(f'{f:g}' for f in candidates)} Hz removes the stick of {stick:.3g} s",
            "its period is shorter than the stick, and its force a thousand times the friction at most",
            f"give frequency= more than {1 / stick:.3g} Hz, or dither on= something else",
        )
    best = min(reached, key=lambda amplitude: amplitude.amplitude)
    return _designed(search, best, stick, friction, tuple(zip(candidates, amplitudes, strict=True)), transition)


def _moments(plain: Trajectory) -> list[Start]:
    """Where dither may be switched on: stick-slip at its fastest, and released from anywhere as far as it goes."""
    times = np.linspace(FORGET * plain.duration, plain.duration, 4001)
    x, v = plain.sample(times, ("x", "v"))[0]
    fastest = int(np.argmax(np.abs(v)))
    return [
        {"x": float(x[fastest]), "v": float(v[fastest])},
        *({"x": share * float(np.max(np.abs(x))), "v": 0.0} for share in RELEASED),
    ]


def longest_stick(run: Trajectory, after: float) -> float:
    """Longest stretch in which the contact does not slip [s], of what happens after an instant."""
    stuck = np.array([mode.kind in ("stick", "microstick") for mode in run.table.modes])[run.modes]
    ends = run.starts + run.durations
    begun = np.flatnonzero(stuck & ~np.append(False, stuck[:-1]))
    over = np.flatnonzero(stuck & ~np.append(stuck[1:], False))
    return float(np.max(ends[over] - np.maximum(run.starts[begun], after), initial=0.0))


@dataclass(frozen=True, eq=False)
class _Found:
    """The smallest amplitude at a frequency, the largest below it that leaves a stick, and all that were tried."""

    frequency: float
    amplitude: float
    too_small: float
    scan: Array


@dataclass(frozen=True, eq=False)
class _Search:
    """A system, and how long it is watched."""

    system: Oscillator
    on: str
    starts: tuple[Start, ...]
    duration: float
    lost: dict[float, int] = field(default_factory=dict)  # amplitudes of which nothing is known, by frequency

    def having(self, amplitude: float, frequency: float) -> Oscillator:
        return self.system.having(drive=Dithered(self.system.drive, amplitude, frequency, on=self.on))

    def stick(self, amplitude: float, frequency: float, *, longer: float = 1.0) -> float:
        """Longest stick with a dither [s], of the first start where it is macroscopic, or of all.

        NaN where none is macroscopic, but a run could not be followed: it may have stuck, or not.
        """
        longest, duration, dithered = 0.0, longer * self.duration, self.having(amplitude, frequency)
        lost = False
        for start in self.starts:
            try:
                run = simulate(dithered, duration=duration, start=start)
            except SolveError:
                lost = True
                continue
            longest = max(longest, longest_stick(run, FORGET * duration))
            if longest * frequency >= 1.0:
                return longest
        return math.nan if lost else longest

    def smallest(self, frequency: float, friction: float, stick: float, precision: float) -> _Found | None:
        """The smallest amplitude that removes sticks, and its margin; None where there is none."""
        if stick * frequency <= 1.0:
            return None  # the period of the dither is longer than the stick: that is no macroscopic one
        tried: list[tuple[float, float]] = []

        def removes(amplitude: float, longer: float = 1.0) -> bool:
            tried.append((amplitude, self.stick(amplitude, frequency, longer=longer)))
            return tried[-1][1] * frequency < 1.0

        low = 0.0
        for high in map(float, self._unit(frequency, friction) * LADDER):
            if not removes(high):
                low = high
                continue
            top = high
            while top - low > precision * top:
                middle = math.sqrt(low * top) if low > 0 else top / 2
                low, top = (low, middle) if removes(middle) else (middle, top)
            while top <= high:
                if removes(MARGIN * top, PATIENT) and removes(BEYOND * top):
                    scan = np.array(sorted(tried))
                    below = scan[(scan[:, 1] * frequency >= 1.0) & (scan[:, 0] < MARGIN * top), 0]
                    return _Found(frequency, MARGIN * top, float(np.max(below, initial=0.0)), scan)
                low, top = top, (1 + precision) * top
            low = high
        self.lost[frequency] = int(np.count_nonzero(np.isnan([stick for _, stick in tried])))
        return None

    def _unit(self, frequency: float, friction: float) -> float:
        """The amplitude whose force on a mass that stands still is the friction."""
        inertia = self.system.mass * (2 * math.pi * frequency) ** 2
        return friction / {"face": inertia, "base": max(self.system.stiffness, 1e-300), "force": 1.0}[self.on]


def _require(system: Oscillator, on: str, cycles: int, precision: float) -> None:
    require_oscillator(system, "dither is sought")
    if isinstance(system.drive, Dithered):
        raise ModelError("the drive is dithered already", "the dither is what is sought", "give the drive without it")
    if on not in UNITS:
        raise ModelError(f"on = '{on}'", f"dither moves one of {', '.join(UNITS)}", "choose one")
    if not (cycles >= 10 and 0 < precision < 0.5):
        raise ModelError(
            f"cycles = {cycles}, precision = {precision}", "at least 10 cycles, and 0 < precision < 0.5", "correct them"
        )
    motion = tables(system).motion
    if not motion.rates and motion.knots is None:
        raise SolveError("nothing drives the system", "only a driven mass sticks and slips for good", "give a drive=")


def _slow_period(system: Oscillator) -> float:
    own = 1 / system.frequency if system.frequency else 0.0
    drive = tables(system).motion.period
    period = max(own, drive if math.isfinite(drive) else 0.0)
    if not period:
        raise ModelError(
            "a mass without a spring and a drive without a period",
            "a run is counted in cycles",
            "give a stiffness= or a periodic drive",
        )
    return period


def _frequencies(
    given: float | Sequence[float] | None, transition: Transition | None, period: float, stick: float
) -> list[float]:
    if given is None and transition is not None:
        given = max(2 * transition.frequency.value, SPLIT / stick)
    try:
        values = np.unique(
            np.atleast_1d(np.asarray(max(FAST / period, SPLIT / stick) if given is None else given, float))
        )
    except (TypeError, ValueError) as no_numbers:
        raise ModelError(f"frequency = {given!r}", "a frequency is a number", "give it in Hz") from no_numbers
    if not (len(values) and np.all(np.isfinite(values)) and np.all(values > 1 / period)):
        raise ModelError(
            f"frequency = {values.tolist()} Hz",
            f"dither is faster than the slow motion, {1 / period:.3g} Hz",
            f"give {FAST / period:.3g} Hz or more",
        )
    return [float(value) for value in values]


def _designed(
    search: _Search,
    best: _Found,
    stick: float,
    friction: float,
    tried: tuple[tuple[float, _Found | None], ...],
    transition: Transition | None,
) -> Dither:
    system, unit = search.having(best.amplitude, best.frequency), UNITS[search.on]
    angular = 2 * math.pi * best.frequency
    with_it = search.stick(best.amplitude, best.frequency)
    inertia = search.system.mass * angular
    speeds = {"face": angular, "base": search.system.stiffness / inertia, "force": 1 / inertia}
    speed = best.amplitude * speeds[search.on]
    small, large = (averaged_friction(search.system, frequency=best.frequency, speed=n * speed) for n in (1, LARGE))
    averaged = np.column_stack([small, large[:, 2]])
    checks = [
        f"longest stick {with_it:.3g} s of a dither period of {1 / best.frequency:.3g} s; without dither {stick:.3g} s",
        f"5 % more removes it too; {100 * (1 - best.too_small / best.amplitude):.1f} % less leaves one",
        _limits(averaged, inertia * speed, friction),
    ]
    if transition is not None:
        ring = transition.frequency.value
        checks.append(
            f"the contact rings at {ring:.3g} Hz: below, the mass follows the dither; at {best.frequency:.3g} Hz it "
            "stands still"
        )
    low, high = best.too_small, best.amplitude
    sd, method = (high - low) / math.sqrt(12), f"bisection of exact runs of {search.duration:.4g} s, and 5 %"
    amplitude = Estimate("dither amplitude", high, (low, high), sd, unit, method, Status(*_lost(best)))
    rows = tuple((f, math.nan if amplitude is None else amplitude.amplitude) for f, amplitude in tried)
    return Dither(
        best.frequency, amplitude, search.on, speed, system, (stick, with_it), rows, best.scan, averaged, tuple(checks)
    )


def _lost(best: _Found) -> list[Doubt]:
    """The doubt that runs leave which could not be followed: each amplitude between may be enough."""
    between = best.scan[(best.scan[:, 0] > best.too_small) & (best.scan[:, 0] < best.amplitude)]
    count = int(np.count_nonzero(np.isnan(between[:, 1])))
    if not count:
        return []
    return [Doubt(f"at {count} smaller amplitudes runs could not be followed: one of them may be enough")]


def averaged_friction(system: Oscillator, *, frequency: float, speed: float) -> Array:
    """Mean friction of a mass that slides on a dithered face: speeds, by the averaged law, by simulation.

    The mass is held by a soft spring and its critical damper: what they bear on average is the friction.
    """
    rate = 2 * math.pi * frequency / SLOW
    probe = Oscillator(system.mass, system.mass * rate**2, system.law, Belt(speed), damping=2 * system.mass * rate)
    level = _mean_friction(probe, frequency)
    rows = []
    for share in PROBED:
        drive = Dithered(Belt(share * speed), speed / (2 * math.pi * frequency), frequency)
        law = float(dithered_friction(share, speed=1.0))
        rows.append((share, law, _mean_friction(probe.having(drive=drive), frequency) / level))
    return np.array(rows)


def _mean_friction(probe: Oscillator, frequency: float) -> float:
    """Mean of the friction that drags a mass along [N], over whole periods of the dither, from momentum."""
    settle, watch = 3 * SLOW / frequency, SLOW / frequency
    try:
        run = simulate(probe, duration=settle + watch)
    except SolveError:
        return math.nan  # the checks say that the law could not be compared
    times = np.linspace(settle, settle + watch, 64 * int(SLOW) + 1)
    x, v = run.sample(times, ("x", "v"))[0]
    gained = probe.mass * (v[-1] - v[0]) + probe.damping * (x[-1] - x[0])
    return float(probe.stiffness * np.mean((x[1:] + x[:-1]) / 2) + gained / watch)


def _limits(averaged: Array, force: float, friction: float) -> str:
    """Whether the averaged law tells what the simulation does."""
    off, off_large = (float(np.max(np.abs(averaged[:, column] - averaged[:, 1]))) for column in (2, 3))
    if math.isnan(off):
        return "the averaged law (2/pi) asin(v/aw) could not be compared: a run of steady sliding did not end"
    size = f"m a w^2 is {force / friction:.1f} of the friction"
    if off <= TRUSTED:
        return f"the averaged law (2/pi) asin(v/aw) holds to {off:.3f} of the friction: {size}"
    why = "friction moves the mass within a period" if force < 3 * friction else "the contact gives way within a period"
    return (
        f"the averaged law (2/pi) asin(v/aw) is off by {off:.2f} of the friction ({off_large:.3f} with {LARGE} times "
        f"the dither): {size}, and {why}"
    )
