"""The rig that a record is believed to come from, and what it would write."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import is_measured
from stickslip.drives.kinds import HarmonicBase
from stickslip.errors import EstimateError, StickslipError
from stickslip.law.drive import DriveFrom, measured_drive
from stickslip.laws.compliant import CompliantContact
from stickslip.laws.linear_slope import LinearSlope
from stickslip.laws.stribeck import Stribeck
from stickslip.oscillator import Oscillator
from stickslip.parameters import declaration
from stickslip.record.flaws import saturated
from stickslip.record.record import Record
from stickslip.rig.rig import Rig
from stickslip.rig.sensor import Digitiser, Mount, Noise, Sensor
from stickslip.signals.noise import noise_level, quantisation_step
from stickslip.solve.simulate import simulate
from stickslip.solve.trajectory import Trajectory
from stickslip.statistics import correlation_time, least_squares

Array = NDArray[np.float64]
Values = Mapping[str, float]

QUESTION = "the twin of a record"
STARTS = (
    3  # of a grid, the nearest, from which the search goes on: some end in a valley of their own, then thrice as many
)
NEAR = 1.1  # times a sensor's noise, that a search may leave to have come to its end
SLIDES = 0.2  # of the largest speed, above which friction is that of sliding: below, sticks and smoothing are in it
PASSES = 8  # of the descent: the first two do nearly all of it
SEARCHED = 4000  # samples in which it is searched where a law's valley lies
LOOK = 2  # passes of it, after which it is seen which of several starts leads nearer
FALL = 0.02  # of friction, over the speeds at which it slides
HALVINGS = 6  # of a step that leads away, before the descent ends
SETTLED = 0.999  # of what is left, from which a further pass gains nothing
TINY = 1e-9  # of the motion: noise below is rounding
NUDGE = 1e-3  # of a value, by which it is moved to see what the displacement does: well above rounding
SENSED = ("x", "z", "v", "a", "load")  # channels that a virtual rig writes
LAWS = 3  # that are tried beside the simplest
CHANCE = 0.01  # that a part which is not there is believed in
KINETIC, SLOPE, EXCESS, GIVE, LOSS, SPEED, POWER = (
    "kinetic", "slope", "excess", "stiffness", "loss", "speed", "exponent"
)  # fmt: skip
MASS, SPRING, DAMPER, GAIN = "mass", "spring", "damper", "gain of x"  # constants that may be off
DRIVE = ("drive 0", "drive 1", "drive 2")  # ways in which the measured drive may be off
LOGARITHMS = (
    GIVE,
    SPEED,
    POWER,
    MASS,
    SPRING,
    GAIN,
)  # of these the values are logarithms: of positive numbers, or of a ratio
POSITIVE = (KINETIC, EXCESS, LOSS)
# Where the search for a part begins: static over sliding friction less 1; deflection before slip over the largest
# displacement; Stribeck speed over the largest speed. The nearest of them is taken.
EXCESSES = (0.02, 0.1, 0.25, 0.5, 0.8)
DEFLECTIONS = (0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
LOSSES = (0.02, 0.1, 0.5)  # of a contact: its damping over the root of its stiffness times the mass
SPEEDS = (0.03, 0.1, 0.3)
LEVELS = (0.8, 0.9, 1.0)  # of the friction that a law without a fall in speed would have
EXPONENT = (0.35, 0.35)  # logarithm of a Stribeck curve's, and its uncertainty: Tustin's is 1, Gauss's 2


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
        "excess" of static over sliding friction [N], logarithms of contact "stiffness" [N/m] or Stribeck "speed"
        [m/s] and "exponent", the contact's "loss" c / sqrt(K m)), and by how much a constant is off.
    drive : DriveFrom
        The motion of the base, or the force, as it was recorded.
    rig : Rig
        Sensors with the noise, the counts, the mounts and the delays of the record's.
    unsure : mapping of str to float
        Standard deviation of each constant that may be off.
    fit : Fit or None
        How the values were found.
    """

    record: Record
    stated: Oscillator
    values: Values
    drive: DriveFrom
    rig: Rig
    unsure: Values = field(default_factory=dict)
    fit: Fit | None = None

    @property
    def law(self) -> LinearSlope | CompliantContact | Stribeck:
        """The contact's law: rigid and linear in speed, or one that gives way, or that falls as Stribeck's does."""
        values = self.values
        kinetic = values.get(KINETIC, 0.0)
        static = kinetic + values[EXCESS] if EXCESS in values else None
        if GIVE in values:
            loss = values.get(LOSS, 0.0) * math.sqrt(math.exp(values[GIVE]) * self.stated.mass)
            return CompliantContact(kinetic, stiffness=math.exp(values[GIVE]), damping=loss, static=static)
        if SPEED in values:
            speed, exponent = math.exp(values[SPEED]), math.exp(values[POWER])
            return Stribeck(kinetic, static or kinetic, speed=speed, exponent=exponent)
        return LinearSlope(kinetic, slope=self.slope, static=static)

    def __str__(self) -> str:
        law = self.law
        numbers = {own: getattr(law, own.name) for own in fields(law)}
        parts = [
            f"{declaration(own).name} {value:.4g} {declaration(own).unit}".removesuffix(" 1")
            for own, value in numbers.items()
            if isinstance(value, float) and value
        ]
        return f"the law {type(law).__name__} ({', '.join(parts)})" if parts else "no friction"

    @property
    def slope(self) -> float:
        """Of friction against speed [N s/m]."""
        return self.values.get(SLOPE, 0.0)

    @property
    def kinetic(self) -> float:
        """Friction at the mean speed at which it slides [N]; a slope that rises is a damper's and no dry friction."""
        return self.values.get(KINETIC, 0.0) + min(0.0, self.slope) * self.sliding_speed

    @property
    def falls(self) -> bool:
        """Whether friction falls with speed by so much that a line and a curve would differ."""
        return -self.slope * self.sliding_speed > FALL * self.kinetic

    @property
    def static(self) -> float:
        """Friction that the contact bears before it slides [N]."""
        return self.values.get(KINETIC, 0.0) + self.values.get(EXCESS, 0.0)

    @property
    def ratio(self) -> float:
        """Static over sliding friction; NaN without friction."""
        kinetic = self.values.get(KINETIC, 0.0)
        return self.static / kinetic if kinetic else math.nan

    @property
    def contact(self) -> float:
        """Stiffness of the contact [N/m]; infinite of a rigid one."""
        return math.exp(self.values[GIVE]) if GIVE in self.values else math.inf

    @property
    def priors(self) -> Mapping[str, tuple[float, float]]:
        """Mean and standard deviation of the values of which something is known beforehand."""
        constants = {name: (0.0, sd) for name, sd in self.unsure.items()}
        return {**constants, POWER: EXPONENT} if POWER in self.values else constants

    @property
    def oscillator(self) -> Oscillator:
        """With the law, and the constants as they are believed to be."""
        stated, values, law = self.stated, self.values, self.law
        return stated.having(
            law=law,
            mass=stated.mass * math.exp(values.get(MASS, 0.0)),
            stiffness=stated.stiffness * math.exp(values.get(SPRING, 0.0)),
            damping=stated.damping + values.get(DAMPER, 0.0) + (0.0 if isinstance(law, LinearSlope) else self.slope),
        )

    @property
    def sliding_speed(self) -> float:
        """The mean speed at which it slides [m/s]."""
        speed = np.abs(self.record["v"])
        return float(speed[speed > SLIDES * speed.max()].mean())

    def at(self, **values: float) -> Belief:
        """The same with other values."""
        return replace(self, values={**self.values, **values})

    def by(self, names: Iterable[str], steps: Array) -> Belief:
        """The same with values moved by steps; what can not be negative stays at zero."""
        moved = {name: self.values[name] + step for name, step in zip(names, steps, strict=True)}
        positive = (*POSITIVE, SLOPE) if SPEED in self.values else POSITIVE  # what falls with speed is Stribeck's part
        return self.at(**{name: max(0.0, value) if name in positive else value for name, value in moved.items()})

    def without(self, part: str) -> Belief:
        """The same without a part."""
        return replace(self, values={name: value for name, value in self.values.items() if name != part})

    def drawn(self, rng: np.random.Generator) -> Belief:
        """A rig that the record leaves possible as well, by chance."""
        if self.fit is None:
            return self
        return self.by(self.fit.names, self.fit.root @ rng.standard_normal(len(self.fit.names)))

    def size(self, name: str) -> float:
        """About how large a value is."""
        if name in ("x", "v"):
            return float(np.std(self.record[name]))
        if name in self.unsure:
            return max(NUDGE, self.unsure[name])
        if name in LOGARITHMS or name == LOSS:
            return 1.0
        friction = float(np.std(self.record["friction"]))
        return friction / float(np.std(self.record["v"])) if name == SLOPE else friction

    def first_felt(self, parts: Iterable[Values], deviations: float) -> Values | None:
        """The first of ever larger parts that moves x by more deviations than the other values could take up."""
        fit, still = self.fit, self.moved
        assert fit is not None
        for part in parts:
            try:
                apart = self.at(**part).moved - still
            except StickslipError:
                return None
            apart -= apart.mean()
            apart -= fit.jacobian @ (fit.gain @ apart)
            if float(apart @ apart) > deviations**2 * fit.weight:
                return part
        return None

    def told_by(self, record: Record) -> Belief:
        """The rig that a record of a twin would have been believed to come from, by the same linear fit."""
        if self.fit is None:
            return self
        left = record["x"] - self.moved
        return self.by(self.fit.names, self.fit.gain @ (left - left.mean()))

    @cached_property
    def moved(self) -> Array:
        """The displacement x that its sensor would read without noise and counts [m]."""
        sensor, run = self.sensor, self._run()
        if sensor.mount or math.isfinite(sensor.discharge):
            quiet = replace(sensor, noise=Noise(), digitiser=Digitiser(limit=sensor.digitiser.limit), gain=self.gain)
            return np.asarray(Rig((quiet,)).measure(run, fs=self.record.fs, rng=0)["x"])
        times = np.clip(np.arange(len(self.record)) / self.record.fs - sensor.lag, 0.0, run.duration)
        limit = sensor.digitiser.limit
        return np.asarray(np.clip(self.gain * run.sample(times, ("x",))[0][0], -limit, limit))

    @cached_property
    def residual(self) -> Array:
        """What it leaves of the measured displacement, but for its mean [m]."""
        left = self.record["x"] - self.moved
        return np.asarray(left - left.mean())

    @property
    def sensor(self) -> Sensor:
        """The displacement's."""
        return next(sensor for sensor in self.rig.sensors if sensor.channel == "x")

    @property
    def gain(self) -> float:
        """Of that sensor."""
        return math.exp(self.values.get(GAIN, 0.0))

    @property
    def noise(self) -> float:
        """Standard deviation of the displacement's noise and counts [m]."""
        noise = math.hypot(self.sensor.noise.white, self.sensor.digitiser.step / 12**0.5)
        return max(noise, TINY * float(np.std(self.record["x"])))

    @property
    def like_noise(self) -> bool:
        """Whether it leaves no more of the displacement than its noise."""
        return float(np.std(self.residual)) < NEAR * self.noise

    def beginning(self) -> Belief:
        """Of the record's beginning alone, that is long enough to search in."""
        return replace(self, record=self.record.rows(0, SEARCHED))

    def _run(self) -> Trajectory:
        """The motion."""
        last = (len(self.record) - 1) / self.record.fs
        off = [self.values[name] for name in DRIVE if name in self.values]
        moved = self.oscillator.having(drive=self.drive(0.0, last, off))
        return simulate(moved, duration=last, start={"x": self.values["x"], "v": self.values["v"]})

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
        gains |= {"x": self.gain, "z": 1 / (1 + self.values.get(DRIVE[0], 0.0))}  # what z wrote, it writes again
        rig = Rig(tuple(replace(s, gain=gains.get(s.channel, 1.0)) for s in self.rig.sensors))
        written = rig.measure(self._run(), fs=self.record.fs, rng=rng)
        for name in written:
            known = channels[name]
            details = {"delay": known.delay, "mount": known.mount, "inertia": known.inertia}
            written = written.with_details(name, **details, discharge=known.discharge, noise=known.noise)
        return written


@dataclass(frozen=True, eq=False)
class Fit:
    """How the values of a belief were found: linear in their neighbourhood.

    Attributes
    ----------
    names : tuple of str
        What was moved.
    jacobian : ndarray, shape (samples, values)
        How x, less its mean, changes with each value.
    gain : ndarray, shape (values, samples)
        By how much each value changes with each sample of x.
    pull : ndarray, shape (values,)
        By how much constants' uncertainties draw each value back to what was stated.
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
    root: Array
    weight: float
    freedom: float

    def sd(self, name: str) -> float:
        """Standard deviation of a value; infinite of one that moves nothing."""
        return float(np.linalg.norm(self.root[self.names.index(name)])) if name in self.names else math.inf


def believe(record: Record) -> Belief:
    r"""Which rig would have written this record?

    The law is the simplest that the record leaves possible. It begins as :math:`f = f_k\,\mathrm{sgn}\,v + s\,v`, by
    least squares where the mass slides faster than a fifth of its largest speed; its values, the state in which the
    record begins, and the constants within their stated uncertainty are moved to where the simulated displacement is
    nearest to the measured one, by Gauss's and Newton's method. A part that does not stand out of chance (one in a
    hundred) is left out; a static friction above the sliding one, a contact that gives way or a friction that falls as
    Stribeck's does is believed in where it leaves less of the displacement than chance would (by an F test, at one in a
    hundred for all of them together).

    Parameters
    ----------
    record : Record
        With x, what moved it (z or force), and the friction by :func:`~stickslip.friction_force` from a stated mass and
        spring.

    Returns
    -------
    Belief

    Raises
    ------
    EstimateError
        There is no balance of forces behind the friction, or nothing in the record tells what moved the mass.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=2.0, stiffness=800, law=ss.laws.Coulomb(1.0),
    ...                        drive=ss.drives.HarmonicBase(4e-3, frequency=2.0))
    >>> record = ss.Rig.perfect("x", "z").having("x", white=1e-6).measure(ss.simulate(slider, cycles=8), fs=1000, rng=1)
    >>> belief = believe(ss.friction_force(record, mass=2.0, stiffness=800))
    >>> bool(abs(belief.kinetic - 1.0) < 0.01), len(belief.twin(np.random.default_rng(1))) == len(record)
    (True, True)
    """
    stated = record.rig
    if stated is None or stated.mass is None or stated.stiffness is None or is_measured(record, "friction"):
        raise EstimateError(
            "a friction without a balance of forces behind it",
            f"{QUESTION} needs the mass and the spring that moved",
            "state mass and stiffness",
        )
    record.require("x", "v", question=QUESTION)
    if not any(name in record and np.ptp(record[name]) > 0 for name in ("z", "force")):
        raise EstimateError(
            "neither a motion z of the base nor an applied force",
            f"{QUESTION} is moved as the record was",
            "record what moves the mass",
        )
    oscillator = Oscillator(
        mass=stated.mass,
        stiffness=stated.stiffness,
        damping=stated.damping,
        damper=stated.damper,
        law=LinearSlope(0.0, slope=0.0),
    )
    drive = measured_drive(record, HarmonicBase(0.0, frequency=1.0, contact=stated.contact))
    unsure = _unsure(record, drive)
    start = {"x": float(record["x"][0]), "v": float(record["v"][0])}
    values = {**start, **dict.fromkeys(unsure, 0.0), **_sliding(record, stated.contact)}
    begun = Belief(record, oscillator, values, drive, Rig(tuple(_sensors(record))), unsure)
    return _needed(_richer(_needed(_nearest(begun), SLOPE, KINETIC)), SLOPE)


def _needed(belief: Belief, *parts: str) -> Belief:
    """Without those parts, asked in turn, that chance would have shown too."""
    for part in parts:
        if part in belief.values and not _stands_out(belief, part):
            belief = _nearest(belief.without(part))
    return belief


def _stands_out(belief: Belief, part: str) -> bool:
    """Whether a value is further from zero than chance would bring it."""
    from scipy.special import stdtrit  # half a second, where nothing else of an analysis loads it

    fit = belief.fit
    if fit is None or part not in fit.names:
        return False
    return abs(belief.values[part]) > float(stdtrit(fit.freedom, 1 - CHANCE / 2)) * fit.sd(part)


def _richer(simple: Belief) -> Belief:
    """With the parts that leave the least of the displacement, where that is less than chance would leave."""
    best, least = simple, CHANCE
    for starts in _parts(simple.beginning()):
        richer = _best(starts, simple.record)
        chance = _by_chance(simple, richer)
        if chance < least or (chance == least and _left(richer) < _left(best)):
            best, least = richer, chance
    if GIVE in best.values:  # a contact's own damping matters less than its stiffness: it is looked for last
        damped = _best([best.beginning().at(**{LOSS: loss}) for loss in LOSSES], simple.record)
        best = damped if _by_chance(best, damped) < CHANCE else best
    return best


def _best(starts: list[Belief], record: Record) -> Belief:
    """The nearest to a record of those that the nearest starts lead to on its beginning."""
    starts = sorted(starts, key=_left)
    best = starts[0]
    for number, begun in enumerate(starts[: 3 * STARTS]):
        if number >= STARTS and best.like_noise:
            break
        best = min(best, _tried(begun, LOOK), key=_left)
    return _tried(replace(best, record=record), PASSES)


def _tried(begun: Belief, passes: int) -> Belief:
    """The nearest from there; as it was of a law that can not be followed."""
    try:
        return _nearest(begun, passes)
    except StickslipError:
        return begun


def _parts(simple: Belief) -> list[list[Belief]]:
    """Beginnings of the richer laws, of each a grid."""
    record = simple.record
    furthest, fastest = (float(np.max(np.abs(record[name]))) for name in "xv")
    # a slope is what static friction, and dry friction through a spring, look like to a fit without them
    level = float(np.mean(np.abs(record["friction"])[np.abs(record["v"]) > SLIDES * fastest]))
    levels = [level, simple.values[KINETIC]] if KINETIC in simple.values else [level]
    static = [{KINETIC: a * level, EXCESS: b * level, SLOPE: 0.0} for a in LEVELS for b in EXCESSES]
    give = [
        {KINETIC: level, GIVE: math.log(level / (share * furthest)), SLOPE: 0.0}
        for share in DEFLECTIONS
        for level in levels
    ]
    falls = [
        {**start, SPEED: math.log(share * fastest), POWER: power}
        for share in SPEEDS
        for power in (0.0, 0.7)
        for start in static
    ]
    return [[simple.at(**start) for start in starts] for starts in (static, give, falls)]


def _by_chance(simple: Belief, richer: Belief) -> float:
    """Probability that the richer law leaves so much less by chance alone, for as many laws as are tried."""
    from scipy.special import fdtrc  # as above

    less, more = simple.fit, richer.fit
    if less is None or more is None:  # a law that could not be followed explains nothing
        return 1.0
    added = len(more.names) - len(less.names)
    gained = _left(simple) / _left(richer) - 1
    if added < 1 or gained <= 0:
        return 1.0
    return min(1.0, LAWS * float(fdtrc(added, more.freedom, gained * more.freedom / added)))


def _left(belief: Belief) -> float:
    """What the simulated displacement leaves of the measured one, and constants that are off [m^2].

    Infinite where the rig can not be followed.
    """
    try:
        residual = belief.residual
    except StickslipError:
        return math.inf
    off = sum(((belief.values[name] - middle) / sd) ** 2 for name, (middle, sd) in belief.priors.items())
    with np.errstate(over="ignore"):  # a step that leads far away
        return float(residual @ residual) + belief.noise**2 * off


def _nearest(belief: Belief, passes: int = PASSES) -> Belief:
    """The belief whose displacement is nearest to the record's, where that is near; else as it was begun."""
    belief = _linearised(belief)
    for _ in range(passes):
        fit = belief.fit
        assert fit is not None
        before = _left(belief)
        step = fit.gain @ belief.residual - fit.pull
        step /= max(1.0, *(abs(s) for n, s in zip(fit.names, step, strict=True) if n in LOGARITHMS), 1.0)
        for halving in range(HALVINGS):
            moved = belief.by(fit.names, step / 2**halving)
            nearer = _left(moved)
            if nearer < before:
                break
        else:
            break
        belief = _linearised(moved)
        if nearer > SETTLED * before:
            break
    return belief


def _linearised(belief: Belief) -> Belief:
    """With how its values follow from x, in their neighbourhood."""
    residual = belief.residual
    slopes = {name: _slope_of(belief, name) for name in belief.values}
    names = tuple(name for name, slope in slopes.items() if slope.any())  # what moves nothing can not be told
    if not names:
        raise EstimateError("a displacement that nothing moves", f"{QUESTION} moves as its law does", "see the record")
    jacobian = np.column_stack([slopes[name] for name in names])
    jacobian -= jacobian.mean(axis=0)
    independent = len(residual) / correlation_time(residual)
    freedom = max(1.0, independent - len(names))
    weight = float(residual @ residual) / freedom
    # what is known beforehand counts against the sensor's noise: a misfit must not hold values to it
    known = [belief.priors.get(name, (0.0, math.inf)) for name in names]
    prior = np.array([belief.noise**2 / sd**2 for _, sd in known])
    scale = np.sqrt(np.sum(jacobian**2, axis=0) + prior)
    unit = jacobian / scale
    seen = unit.T @ unit
    inverse = np.linalg.pinv(seen + np.diag(prior / scale**2))
    covariance = inverse @ (weight * seen + np.diag(belief.noise**2 * prior / scale**2)) @ inverse
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    inverse /= np.outer(scale, scale)
    pull = inverse @ (prior * [belief.values[n] - middle for n, (middle, _) in zip(names, known, strict=True)])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return replace(belief, fit=Fit(names, jacobian, inverse @ jacobian.T, pull, root, weight, freedom))


def _slope_of(belief: Belief, name: str) -> Array:
    """How the displacement changes with one value, by a difference forward: a part at zero has no other side."""
    step = NUDGE * belief.size(name)
    try:
        moved = belief.at(**{name: belief.values[name] + step}).moved
    except StickslipError:  # an exit that is a tangency just there
        step /= 3
        moved = belief.at(**{name: belief.values[name] + step}).moved
    return np.asarray((moved - belief.moved) / step)


def _unsure(record: Record, drive: DriveFrom) -> dict[str, float]:
    """Standard deviation of each constant that may be off: as stated, and as the drive was measured."""
    rig, gains = record.rig, {name: record.channels[name].gain_sd for name in record if name in "xz"}
    assert rig is not None
    stated = {MASS: ("mass", rig.mass), SPRING: ("stiffness", rig.stiffness), DAMPER: ("damping", 1.0)}
    unsure = {part: rig.sd[name] / scale for part, (name, scale) in stated.items() if rig.sd.get(name) and scale}
    if gains.get("x"):
        unsure[GAIN] = gains["x"]
    drives = dict(zip(DRIVE, drive.unsure, strict=False))
    if gains.get("z") and drives:  # the first way in which a drive may be off is its size
        drives[DRIVE[0]] = math.hypot(drives[DRIVE[0]], gains["z"])
    return {**unsure, **drives}


def _sliding(record: Record, contact: str) -> dict[str, float]:
    """Dry friction and slope against speed while it slides."""
    velocity = record["v"]
    if contact == "base" and "z" in record:
        velocity = velocity - np.gradient(record["z"]) * record.fs
    slides = np.abs(velocity) > SLIDES * float(np.max(np.abs(velocity)))
    columns = np.column_stack([np.sign(velocity), velocity, np.ones(len(velocity))])[slides]
    kinetic, slope, _ = least_squares(columns, record["friction"][slides]).coefficients
    return {KINETIC: max(0.0, float(kinetic)), SLOPE: float(slope)}


def _sensors(record: Record) -> list[Sensor]:
    """Sensors with the noise, counts, range, mount and delay of the record's own."""
    sensors = []
    for name in SENSED:
        if name in record and is_measured(record, name):
            channel, values = record.channels[name], record[name]
            step = quantisation_step(values)
            limit = float(np.max(np.abs(values))) if saturated(values).any() else np.inf
            mount = None if channel.mount is None else Mount(*channel.mount, mass=channel.inertia)
            level = noise_level(values, record.fs)  # counts are in what is measured, and not in what is stated
            white = math.sqrt(max(level**2 - step**2 / 12, 0.0)) if channel.noise is None else channel.noise
            discharge = np.inf if channel.discharge is None else channel.discharge
            digitiser = Digitiser(step=step, limit=limit)
            sensors.append(
                Sensor(
                    name, lag=channel.delay, mount=mount, discharge=discharge, noise=Noise(white), digitiser=digitiser
                )
            )
    return sensors
