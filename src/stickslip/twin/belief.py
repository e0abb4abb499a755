"""The rig that a record is believed to come from, and what it would write."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import driving
from stickslip.errors import StickslipError
from stickslip.law.driven import DriveFrom, Sampled, Tones
from stickslip.laws.compliant import CompliantContact, Dahl, LuGre
from stickslip.laws.coulomb import Coulomb, LinearSlope
from stickslip.laws.state_variable import StateVariable
from stickslip.laws.stribeck import Stribeck
from stickslip.oscillator import Oscillator
from stickslip.parameters import declaration
from stickslip.record.record import Record
from stickslip.rig.rig import Rig
from stickslip.rig.sensor import Digitiser, MeasuredNoise, Noise, Sensor
from stickslip.solve.curved import CurvedTrajectory
from stickslip.solve.sensitivity import sensitivity
from stickslip.solve.simulate import simulate
from stickslip.solve.trajectory import Trajectory

Values = Mapping[str, float]

# Names of what is believed: parts of a law, and constants that may be off.
KINETIC, SLOPE, EXCESS, GIVE, LOSS, SPEED, POWER, RATE = (
    "kinetic", "slope", "excess", "stiffness", "loss", "speed", "exponent", "rate"
)  # fmt: skip
HELD, BENT = "friction at the start", "deflection at the start"  # of bristles or a lag, and of a spring that slides
MASS, SPRING, DAMPER, GAIN, LATE = "mass", "spring", "damper", "gain of x", "x late"
DRIVE = ("drive 0", "drive 1", "drive 2")  # ways in which the measured drive may be off
SLIPS = (LATE, GAIN, SPRING, MASS)  # what may be off by more than anybody stated
LOGARITHMS = (
    GIVE,
    SPEED,
    POWER,
    RATE,
    MASS,
    SPRING,
    GAIN,
)  # whose values are logarithms: of positive numbers, or of a ratio
POSITIVE = (KINETIC, EXCESS, LOSS)
# What is known beforehand: the logarithm of a Stribeck curve's exponent (Tustin's is 1, Gauss's 2), and that a
# deflection is no more than that of sliding: one that x does not tell would be drawn far, a velocity balancing it.
KNOWN = {POWER: (0.35, 0.35), BENT: (0.0, 1.0)}
POWERS = (math.log(0.5), math.log(4.0))  # between which the logarithm of the exponent is looked for
FALLS = (3e-3, 10.0)  # Stribeck speed over the largest speed: below it is static friction, above a line
STEEP = 1e-3  # of the largest speed, at which the backbone of a friction that lags has turned over: as good as a jump
GAUSS = 2.0  # exponent of the bristles' curve
FAINT = 0.01  # of the static friction: bristles have no law without a sliding one, which a draw may leave at none
ALIKE = 0.25  # of c/k, within which a late x is what a damper on the base does
SLIDES = 0.2  # of the largest speed, above which friction is that of sliding: below, sticks and smoothing are in it
FALL = 0.02  # of friction, over the speeds at which it slides
EVENTS = 1000  # in a cycle, beyond which a rig that is tried is given up
FOLLOWED = 1e-12  # tolerance to which curved laws are followed: the error of a difference is this over its step
NEAR = 1.1  # times a sensor's noise, that a search may leave to have come to its end
TINY = 1e-9  # of the motion: noise below is rounding
FURTHEST = 30.0  # step of a logarithm: beyond it nothing is told
REACH = 3.0  # standard deviations by which a search may move a constant at once
FINELY = 4  # instants in a sample, at which the power of friction is looked at: where it is held it bends
# Of a value, by which it is moved to see what x does. With 1e-3 the bend of x over that step made x tell the scale of
# all forces, which it can not: intervals of rigs whose constants are off were a third as wide as they had to be.
NUDGE = 1e-5


@dataclass(frozen=True, eq=False)
class Belief:
    """A rig that would have written a record much like this one.

    Attributes
    ----------
    record : Record
        The record, with the friction by which the law was first guessed.
    stated : Oscillator
        With the constants as stated.
    values : mapping of str to float
        What is believed: where the mass begins ("x" [m], "v" [m/s]), the law's parts ("kinetic" [N], "slope" [N s/m],
        "excess" of static over sliding friction [N], logarithms of contact "stiffness" [N/m], of Stribeck "speed"
        [m/s] and "exponent", or of the "rate" [1/s] at which friction follows; the contact's "loss" c / sqrt(K m); the
        "friction at the start" over the sliding one, or the "deflection at the start" over that of sliding), and by
        how much a constant is off, or x late [s].
    drive : DriveFrom
        The motion of the base, or the force, as it was recorded.
    rig : Rig
        Sensors with the noise, the counts, the mounts and the delays of the record's.
    unsure : mapping of str to float
        Standard deviation of each constant that may be off.
    fit : Fit or None
        How the values were found.
    rivals : tuple of Belief
        Other laws, or the same with other values, that leave no more of the displacement than chance would.
    held : str
        A value that is not moved, where it is asked what the others make of it.
    """

    record: Record
    stated: Oscillator
    values: Values
    drive: DriveFrom
    rig: Rig
    unsure: Values = field(default_factory=dict)
    fit: Fit | None = None
    rivals: tuple[Belief, ...] = ()
    held: str = ""

    @property
    def law(self) -> LinearSlope | CompliantContact | Stribeck | StateVariable | LuGre | Dahl:
        """The contact's law: rigid and linear in speed, giving way, falling as Stribeck's, with bristles, lagging."""
        values = self.values
        kinetic = values.get(KINETIC, 0.0)
        static = kinetic + values[EXCESS] if EXCESS in values else None
        if RATE in values and kinetic > 0:
            steepness = 1 / (STEEP * _sizes(self.record).fastest)
            return StateVariable(kinetic, rate=math.exp(values[RATE]) / kinetic, steepness=steepness)
        loss = values.get(LOSS, 0.0) * math.sqrt(self.contact * self.stated.mass) if LOSS in values else 0.0
        if GIVE in values and HELD in values and (static or kinetic) > 0:
            if static is None:
                return Dahl(kinetic, stiffness=self.contact)
            fall = math.exp(values.get(SPEED, self.ends(SPEED)[0]))
            return LuGre(max(kinetic, FAINT * static), static, speed=fall, stiffness=self.contact, damping=loss)
        if GIVE in values:
            return CompliantContact(kinetic, stiffness=self.contact, damping=loss, static=static)
        if SPEED in values:
            speed, exponent = math.exp(values[SPEED]), math.exp(values[POWER])
            return Stribeck(kinetic, static or kinetic, speed=speed, exponent=exponent)
        return LinearSlope(kinetic, slope=self.slope, static=static)

    def __getstate__(self) -> dict[str, Any]:
        """Without its motion: what one process sends another is short."""
        return {name: value for name, value in vars(self).items() if name != "_motion"}

    def __str__(self) -> str:
        numbers = {own: getattr(self.law, own.name) for own in fields(self.law)}
        parts = [
            f"{declaration(own).name} {value:.4g} {declaration(own).unit}".removesuffix(" 1")
            for own, value in numbers.items()
            if isinstance(value, float) and value
        ]
        return f"{self.called} ({', '.join(parts)})" if parts else "no friction"

    @property
    def called(self) -> str:
        """The law without its numbers, whose digits nothing rounds by how sure they are."""
        law = self.law
        label = Coulomb.label if isinstance(law, LinearSlope) and not law.slope else law.label
        return label.partition(":")[0]

    @property
    def slope(self) -> float:
        """Of friction against speed [N s/m]."""
        return self.values.get(SLOPE, 0.0)

    @property
    def mean_slope(self) -> float:
        """Of the line nearest to friction over the speeds at which it slides [N s/m]."""
        speed = self._sliding_speeds
        about = speed - speed.mean()
        return self.slope + float(about @ self._fall(speed) / (about @ about))

    @property
    def kinetic(self) -> float:
        """Friction at the mean speed at which it slides [N]; a slope that rises is a damper's and no dry friction."""
        speed = self.sliding_speed
        return self.values.get(KINETIC, 0.0) + float(self._fall(speed)) + min(0.0, self.slope) * speed

    def _fall(self, speed: Array | float) -> Array | float:
        """What is left of a Stribeck curve's static excess at a speed [N]."""
        if SPEED not in self.values:
            return 0.0 * speed
        exponent = math.exp(self.values[POWER]) if POWER in self.values else GAUSS
        return self.values.get(EXCESS, 0.0) * np.exp(-((speed / math.exp(self.values[SPEED])) ** exponent))

    @property
    def falls(self) -> bool:
        """Whether friction falls with speed by so much that a line and a curve would differ."""
        return -self.slope * self.sliding_speed > FALL * self.kinetic

    @property
    def fall_speed(self) -> float:
        """The speed about which friction falls from its static level to its sliding one [m/s]; NaN where none does."""
        return math.exp(self.values[SPEED]) if SPEED in self.values else math.nan

    @property
    def static(self) -> float:
        """Friction that the contact bears before it slides [N]."""
        return self.values.get(KINETIC, 0.0) + self.values.get(EXCESS, 0.0)

    @property
    def ratio(self) -> float:
        """Static over sliding friction, that of a line at no speed; NaN without friction."""
        kinetic = self.kinetic if SPEED in self.values else self.values.get(KINETIC, 0.0)
        return self.static / kinetic if kinetic else math.nan

    @property
    def contact(self) -> float:
        """Stiffness of the contact [N/m]; infinite of a rigid one."""
        return math.exp(self.values[GIVE]) if GIVE in self.values else math.inf

    @property
    def priors(self) -> Mapping[str, tuple[float, float]]:
        """Mean and standard deviation of the values of which something is known beforehand."""
        constants = {name: (0.0, sd) for name, sd in self.unsure.items()}
        return {**constants, **{name: known for name, known in KNOWN.items() if name in self.values}}

    @property
    def oscillator(self) -> Oscillator:
        """With the law, and the constants as they are believed to be."""
        stated, values, law = self.stated, self.values, self.law
        return replace(  # thousands are made in a search, for which `having` looks up each name in the whole system
            stated,
            law=law,
            mass=stated.mass * math.exp(values.get(MASS, 0.0)),
            stiffness=stated.stiffness * math.exp(values.get(SPRING, 0.0)),
            damping=stated.damping + values.get(DAMPER, 0.0) + (0.0 if isinstance(law, LinearSlope) else self.slope),
        )

    @property
    def sliding_speed(self) -> float:
        """The mean speed at which it slides [m/s]."""
        return float(self._sliding_speeds.mean())

    @property
    def _sliding_speeds(self) -> Array:
        speed = np.abs(self.record["v"])
        return np.asarray(speed[speed > SLIDES * speed.max()])

    def at(self, **values: float) -> Belief:
        """The same with other values."""
        return replace(self, values={**self.values, **values})

    def by(self, names: Iterable[str], steps: Array) -> Belief:
        """The same with values moved by steps; what can not be negative stays at zero."""
        moved = {
            name: self.values[name] + (min(max(step, -FURTHEST), FURTHEST) if name in LOGARITHMS else step)
            for name, step in zip(names, steps, strict=True)
        }
        ends = {name: self.ends(name) for name in moved}
        return self.at(**{name: min(max(value, ends[name][0]), ends[name][1]) for name, value in moved.items()})

    def ends(self, name: str) -> tuple[float, float]:
        """Between which a value lies."""
        if name in (HELD, BENT):
            return -1.0, 1.0
        if name == SPEED:
            fastest = _sizes(self.record).fastest
            return math.log(FALLS[0] * fastest), math.log(FALLS[1] * fastest)
        if name == POWER:
            return POWERS
        positive = (*POSITIVE, SLOPE) if SPEED in self.values else POSITIVE  # what falls with speed is Stribeck's part
        return (0.0 if name in positive else -math.inf), math.inf

    def pinned(self, name: str, towards: float) -> bool:
        """Whether a value is at its end and can not move that way."""
        low, high = self.ends(name)
        return self.values[name] <= low if towards < 0 else self.values[name] >= high

    def as_stated(self) -> Belief:
        """The same with every constant as it was stated, and the drive as it was measured."""
        return self.at(**dict.fromkeys(self.unsure, 0.0))

    @property
    def slipped(self) -> tuple[str, ...]:
        """Which of the constants, and the clock of x, it takes to be off by more than was stated."""
        return tuple(name for name in SLIPS if name in self.values and name not in self.unsure)

    @property
    def slip(self) -> str:
        """The same in words, with by how much, and what would look alike."""
        return " and ".join(self._off_by(name) for name in self.slipped)

    def _off_by(self, name: str) -> str:
        if name == LATE:
            words = f"x {1e3 * abs(self.late):.2g} ms {'late' if self.late > 0 else 'early'}"
            rig = self.stated
            # a damper that ends on the base moves the spring's end by c/k times its velocity: as a clock would
            base, shift = rig.damper == "base", rig.damping / rig.stiffness
            alike = shift > 0 and abs(self.late - (shift if base else -shift)) < ALIKE * shift
            return f"{words}, or the damper on the {'ground' if base else 'base'}" if alike else words
        off = 100 * math.expm1(self.values[name])
        words = f"a {name} {abs(off):.2g} % {'larger' if off > 0 else 'smaller'} than stated"
        moves = driving(self.record)
        return f"{words}, or that of {moves} as much the other way" if name == GAIN and moves else words

    @property
    def slips(self) -> list[Belief]:
        """The nearest rig of each kind of slip, where it has one itself."""
        nearest: dict[tuple[str, ...], Belief] = {}
        for rig in (self, *sorted(self.rivals, key=lambda rival: rival.left)) if self.slipped else ():
            nearest.setdefault(rig.slipped, rig)
        return [rig for rig in nearest.values() if rig.slipped]

    @property
    def strain(self) -> float:
        """The largest number of standard deviations by which it takes a constant to be off."""
        return max((abs(self.values[name]) / sd for name, sd in self.unsure.items()), default=0.0)

    def without(self, part: str) -> Belief:
        """The same without a part."""
        return replace(self, values={name: value for name, value in self.values.items() if name != part})

    def size(self, name: str) -> float:
        """About how large a value is."""
        if name in ("x", "v"):
            return _sizes(self.record).x if name == "x" else _sizes(self.record).v
        if name in self.unsure:
            return max(NUDGE, self.unsure[name])
        if name in (*LOGARITHMS, LOSS, HELD, BENT):
            return 1.0
        if name == LATE:
            return 1 / self.record.fs
        sizes = _sizes(self.record)
        return sizes.friction / sizes.v if name == SLOPE else sizes.friction

    def reach(self, name: str) -> float:
        """As far as a value may be moved at once: further away its slope tells nothing."""
        return REACH * self.unsure[name] if name in self.unsure else self.size(name)

    def first_detectable(self, parts: Iterable[Values], deviations: float) -> Values | None:
        """The first of ever larger parts that moves x by more deviations than the other values could take up."""
        fit, still = self.fit, self.moved
        assert fit is not None
        for part in parts:
            try:
                apart = self.at(**part).moved - still
            except StickslipError:
                return None
            apart = levelled(apart)
            apart -= fit.jacobian @ (fit.gain @ apart)
            if float(apart @ apart) > deviations**2 * fit.weight:
                return part
        return None

    @cached_property
    def moved(self) -> Array:
        """The displacement x that its sensor would read without noise and counts [m]."""
        sensor, run = self.sensor, self._motion
        if sensor.mount or math.isfinite(sensor.discharge):
            quiet = replace(sensor, noise=Noise(), digitiser=Digitiser(limit=sensor.digitiser.limit), gain=self.gain)
            return np.asarray(self._written((quiet,), run, 0)["x"])
        limit = sensor.digitiser.limit
        return np.asarray(np.clip(self.gain * run.sample(self._instants(run), ("x",))[0][0], -limit, limit))

    @cached_property
    def residual(self) -> Array:
        """What it leaves of the measured displacement, levelled [m]."""
        return levelled(self.record["x"] - self.moved)

    @property
    def sensor(self) -> Sensor:
        """The displacement's."""
        return next(sensor for sensor in self.rig.sensors if sensor.channel == "x")

    @property
    def late(self) -> float:
        """Time by which x is late to the other channels [s]; negative where it is early."""
        return self.values.get(LATE, 0.0)

    @property
    def gain(self) -> float:
        """Of that sensor."""
        return math.exp(self.values.get(GAIN, 0.0))

    @property
    def noise(self) -> float:
        """Standard deviation of white noise as dense as the displacement's noise and counts at the drive's tone [m]."""
        own = self.sensor.noise
        level = own.white
        if isinstance(own, MeasuredNoise) and isinstance(self.drive, Tones):
            level = math.sqrt(own.at(self.drive.tones[0][1]) * self.record.fs / 2)
        return self._with_counts(level)

    def _with_counts(self, level: float) -> float:
        """A noise and its counts [m]; never less than rounding."""
        return max(math.hypot(level, self.sensor.digitiser.step / 12**0.5), TINY * _sizes(self.record).x)

    @property
    def left(self) -> float:
        """The part of the displacement that it leaves."""
        moved = float(np.std(levelled(self.record["x"])))
        return float(np.std(self.residual)) / moved if moved > 0 else 0.0

    @property
    def like_noise(self) -> bool:
        """Whether it leaves no more of the displacement than its noise, and the constants within their uncertainty."""
        return self.over_noise < NEAR and self.strain < REACH

    @property
    def over_noise(self) -> float:
        """What it leaves of the displacement, over its noise."""
        return float(np.std(self.residual)) / self._with_counts(self.sensor.noise.level)

    @property
    def start(self) -> dict[str, float]:
        """The state in which the record begins."""
        values, law = self.values, self.law
        begun = {"x": values["x"], "v": values["v"]}
        held = values.get(HELD, 0.0) * values.get(KINETIC, 0.0)
        if isinstance(law, StateVariable):
            begun["theta"] = held
        elif isinstance(law, LuGre):
            begun["bristle"] = held / self.contact
        elif isinstance(law, Dahl):
            begun["force_state"] = held
        elif isinstance(law, CompliantContact):
            begun["anchor"] = values["x"] - values.get(BENT, 0.0) * law.kinetic / self.contact
        return begun

    @property
    def _system(self) -> Oscillator:
        """As it moves from the first instant that x or another channel shows to the last."""
        last, late = (len(self.record) - 1) / self.record.fs, self.late
        off = [self.values[name] for name in DRIVE if name in self.values]
        return replace(self.oscillator, drive=self.drive(min(0.0, -late), last + max(0.0, -late), off))

    @cached_property
    def _motion(self) -> Trajectory:
        """Of that system."""
        duration = (len(self.record) - 1) / self.record.fs + abs(self.late)
        return simulate(self._system, duration=duration, start=self.start, budget=EVENTS, rtol=FOLLOWED)

    def tangents(self) -> dict[str, Array]:
        """How `moved` changes with each value, carried along the motion and through its events.

        Only of laws of linear modes, read by a sensor without memory; not by the time that x is late.
        """
        sensor, run = self.sensor, self._motion
        if isinstance(run, CurvedTrajectory) or sensor.mount or math.isfinite(sensor.discharge):
            return {}
        scaled = {DRIVE[0]: 1 / (1 + self.values[DRIVE[0]])} if isinstance(self.drive, Sampled) else {}
        names = [name for name in self.values if name not in (LATE, GAIN, *scaled)]
        near = [self.at(**{name: self.values[name] + NUDGE * self.size(name)}) for name in names]
        if any(type(belief.law) is not type(self.law) for belief in near):  # a memory of no friction is a line
            return {}
        motion = sensitivity(
            run,
            [belief._system for belief in near],
            step=NUDGE,
            starts=dict.fromkeys(self.start, 1.0),
            scaled=list(scaled.values()),
            outputs=("x",),
        )
        times = self._instants(run)
        columns, begun = self.gain * motion.sample(times, "x"), np.array(list(self.start.values()))
        by_start = columns[len(names) + len(scaled) :]
        read = np.abs(self.moved) < sensor.digitiser.limit  # what is beyond its range, it does not see move
        out = {GAIN: self.moved * read}
        for name, belief, column in zip(names, near, columns, strict=False):
            moved = (np.array(list(belief.start.values())) - begun) / NUDGE
            out[name] = (column + moved @ by_start) * read / self.size(name)
        return out | {name: column * read for name, column in zip(scaled, columns[len(names) :], strict=False)}

    def strayed(self, rng: np.random.Generator) -> Array:
        """How else it would move [m], were its drive read by a sensor with other noise of the same size.

        A record's own is in its belief's motion: a random drive's was in no interval, and three of its levels missed.
        """
        if not isinstance(self.drive, Sampled | Tones):
            return np.zeros(len(self.record))
        return np.asarray(replace(self, drive=self.drive.strayed(rng)).moved - self.moved)

    def _instants(self, run: Trajectory) -> Array:
        """When x is read, on the run's clock [s]."""
        first = max(0.0, -self.late) - self.sensor.lag
        return np.clip(first + np.arange(len(self.record)) / self.record.fs, 0.0, run.duration)

    def _written(self, sensors: Iterable[Sensor], run: Trajectory, rng: int | np.random.Generator) -> Record:
        """What sensors write of the motion, x as late to the others as it is believed to be."""
        late = self.late
        behind = (replace(s, lag=s.lag + max(0.0, late if s.channel == "x" else -late)) for s in sensors)
        return Rig(tuple(behind)).measure(run, fs=self.record.fs, rng=rng, start=abs(late))

    def work(self, duration: float) -> float:
        """Work of the friction in so long a time [J]."""
        times = np.linspace(0.0, duration, round(duration * self.record.fs * FINELY) + 1)
        run = self._motion
        (friction, slip), _ = run.sample(np.minimum(times, run.duration), ("friction", "slip"))
        if not isinstance(self.law, LinearSlope):  # the slope is with the damper then
            friction = friction + self.slope * slip
        power = friction * slip
        return float(np.sum((power[1:] + power[:-1]) / 2 * np.diff(times)))

    def twin(self, rng: np.random.Generator) -> Record:
        """What the rig writes: as long as the record, begun from its state, with what is known of its sensors.

        Raises
        ------
        SolveError
            The rig's motion can not be followed.
        """
        channels = self.record.channels
        gains = {
            name: 1 + channels[name].gain_sd * rng.standard_normal() for name in ("v", "a", "load") if name in channels
        }
        gains["x"] = self.gain
        if (moves := driving(self.record)) is not None:  # what it wrote, it writes again
            gains[moves] = 1 / (1 + self.values.get(DRIVE[0], 0.0))
        # Where a rest lies between two counts is chance, and that error stands as long as the mass does.
        zeros = {s.channel: s.digitiser.step * rng.uniform(-0.5, 0.5) for s in self.rig.sensors if s.digitiser.step}
        sensors = (
            replace(
                s,
                gain=gains.get(s.channel, 1.0),
                digitiser=replace(s.digitiser, offset=zeros.get(s.channel, 0.0)),
            )
            for s in self.rig.sensors
        )
        written = self._written(sensors, self._motion, rng)
        for name, zero in zeros.items():
            written = replace(written, samples={**written.samples, name: written[name] - zero})
        for name in written:
            known = channels[name]
            details = {"delay": known.delay, "mount": known.mount, "inertia": known.inertia}
            written = written.with_details(name, **details, discharge=known.discharge, noise=known.noise)
        return written


class _Sizes(NamedTuple):
    """Standard deviations of a record's displacement [m], velocity [m/s] and friction [N], and its largest speed."""

    x: float
    v: float
    friction: float
    fastest: float


@lru_cache(maxsize=32)  # asked for in every step of a search, of the few beginnings over which it is led
def _sizes(record: Record) -> _Sizes:
    x, v, friction = (float(np.std(record[name])) for name in ("x", "v", "friction"))
    return _Sizes(x, v, friction, fastest=float(np.max(np.abs(record["v"]))))


def levelled(values: Array) -> Array:
    """Columns less their means and straight lines: the offset and the drift of a sensor are no motion."""
    line = np.linspace(-1.0, 1.0, len(values))
    return np.asarray(values - values.mean(axis=0) - np.multiply.outer(line, line @ values / (line @ line)))


@dataclass(frozen=True, eq=False)
class Fit:
    """How the values of a belief were found: linear in their neighbourhood.

    Attributes
    ----------
    names : tuple of str
        What was moved.
    jacobian : ndarray, shape (samples, values)
        How x, levelled, changes with each value.
    gain : ndarray, shape (values, samples)
        By how much each value changes with each sample of x.
    pull : ndarray, shape (values,)
        By how much constants' uncertainties draw each value back to what was stated.
    normal : ndarray, shape (values, values)
        Of the least squares, with what is known beforehand.
    root : ndarray, shape (values, values)
        Square root of the values' covariance.
    weight : float
        Squared residual of an independent sample [m^2].
    freedom : float
        Independent samples less values.
    """

    names: tuple[str, ...]
    jacobian: Array
    gain: Array
    pull: Array
    normal: Array
    root: Array
    weight: float
    freedom: float

    def sd(self, name: str) -> float:
        """Standard deviation of a value; infinite of one that moves nothing."""
        return float(np.linalg.norm(self.root[self.names.index(name)])) if name in self.names else math.inf
