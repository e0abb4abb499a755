"""The rig that a record is believed to come from, and what it would write."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import is_measured
from stickslip.drives.kinds import HarmonicBase
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95
from stickslip.law.drive import DriveFrom, measured_drive
from stickslip.laws.linear_slope import LinearSlope
from stickslip.oscillator import Oscillator
from stickslip.record.flaws import saturated
from stickslip.record.record import Record
from stickslip.rig.rig import Rig
from stickslip.rig.sensor import Digitiser, Mount, Noise, Sensor
from stickslip.signals.noise import noise_level, quantisation_step
from stickslip.solve.simulate import simulate
from stickslip.statistics import least_squares

Array = NDArray[np.float64]

QUESTION = "the twin of a record"
SLIDES = 0.2  # of the largest speed, above which friction is that of sliding: below, sticks and smoothing are in it
PASSES = 6  # of the descent: the first two do nearly all of it
SETTLED = 0.999  # of what is left, from which a further pass gains nothing
NUDGE = 1e-3  # of a value, by which it is moved to see what the displacement does: well above rounding
SENSED = ("x", "z", "v", "a", "load")  # channels that a virtual rig writes


@dataclass(frozen=True, eq=False)
class Belief:
    """A rigid contact with dry and viscous friction that would have written a record much like this one.

    Attributes
    ----------
    record : Record
        The record, with the friction by which the law was found.
    oscillator : Oscillator
        With the constants as stated and the likeliest law; its drive is taken from `drive`.
    start : tuple of float
        Displacement [m] and velocity [m/s] of the mass as the record begins.
    root : ndarray, shape (5, 5)
        Square root of the covariance of start, dry part [N], slope [N s/m], and static over dry part.
    drive : DriveFrom
        The motion of the base, or the force, as it was recorded.
    rig : Rig
        Sensors with the noise, the counts, the mounts and the delays of the record's.
    """

    record: Record
    oscillator: Oscillator
    start: tuple[float, float]
    root: Array
    drive: DriveFrom
    rig: Rig

    @property
    def law(self) -> LinearSlope:
        """The contact's law."""
        law = self.oscillator.law
        assert isinstance(law, LinearSlope)
        return law

    def bearing(self, ratio: float) -> Belief:
        """The same, with a static friction about so many times the sliding one: moved to the nearest again."""
        law = replace(self.law, static=max(1.0, ratio) * self.law.kinetic)
        return _nearest(replace(self, oscillator=self.oscillator.having(law=law)))

    def drawn(self, rng: np.random.Generator) -> Belief:
        """A rig that the record leaves possible as well, by chance."""
        return self.at(self.values + self.root @ rng.standard_normal(len(self.root)))

    @property
    def values(self) -> Array:
        """Start, dry part, slope, and static over dry part, as one array."""
        ratio = self.law.breakaway / self.law.kinetic if self.law.kinetic else 1.0
        return np.array([*self.start, self.law.kinetic, self.law.slope, ratio])

    def at(self, values: Array) -> Belief:
        """The same with other values."""
        x, v, kinetic, slope, ratio = (float(value) for value in values)
        kinetic = max(0.0, kinetic)
        static = None if self.law.static is None else max(1.0, ratio) * kinetic
        oscillator = self.oscillator.having(law=LinearSlope(kinetic, slope=slope, static=static))
        return replace(self, oscillator=oscillator, start=(x, v))

    @property
    def sliding_speed(self) -> float:
        """The mean speed at which it slides [m/s]."""
        speed = np.abs(self.record["v"])
        return float(speed[speed > SLIDES * speed.max()].mean())

    def moved(self) -> Array:
        """The displacement x that its sensor would read without noise [m]."""
        return np.asarray(self.quiet().twin(np.random.default_rng(0))["x"])

    def quiet(self) -> Belief:
        """The same rig with sensors that have no noise and count nothing."""
        sensors = (replace(s, noise=Noise(), digitiser=Digitiser()) for s in self.rig.sensors)
        return replace(self, rig=Rig(tuple(sensors)))

    def twin(self, rng: np.random.Generator) -> Record:
        """What the rig writes: as long as the record, begun from its state, with what is known of its sensors.

        Raises
        ------
        SolveError
            The rig's motion can not be followed.
        """
        last = (len(self.record) - 1) / self.record.fs
        moved = self.oscillator.having(drive=self.drive(0.0, last))
        run = simulate(moved, duration=last, start={"x": self.start[0], "v": self.start[1]})
        written = self.rig.measure(run, fs=self.record.fs, rng=rng)
        for name in written:
            known = self.record.channels[name]
            details = {"delay": known.delay, "mount": known.mount, "inertia": known.inertia}
            written = written.with_details(name, **details, discharge=known.discharge, noise=known.noise)
        return written


def believe(record: Record) -> Belief:
    r"""Which rig would have written this record?

    The law is the simplest that a sliding contact leaves possible, :math:`f = f_k\,\mathrm{sgn}\,v + s\,v` and an
    offset of the sensors: first by least squares where it slides faster than a fifth of its largest speed; then, with
    the state in which the record begins, by what brings the simulated displacement nearest to the measured one, by
    Gauss's and Newton's method. A part that its own 95 % interval does not tell from zero is left out.

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
    >>> bool(abs(belief.law.kinetic - 1.0) < 0.01), len(belief.twin(np.random.default_rng(1))) == len(record)
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
    law, sd = _law(record, stated.contact)
    oscillator = Oscillator(
        mass=stated.mass, stiffness=stated.stiffness, damping=stated.damping, damper=stated.damper, law=law
    )
    drive = measured_drive(record, HarmonicBase(0.0, frequency=1.0, contact=stated.contact))
    start = float(record["x"][0]), float(record["v"][0])
    begun = Belief(record, oscillator, start, np.diag([0.0, 0.0, *sd, 0.0]), drive, Rig(tuple(_sensors(record))))
    return _nearest(begun)


def _nearest(belief: Belief) -> Belief:
    """The belief whose displacement is nearest to the record's, where that is near; else as it was begun."""
    measured = belief.record["x"]
    best, apart = belief, _apart(belief, measured)
    covariance = np.zeros((5, 5))
    for _ in range(PASSES):
        law = best.law
        told = {2: law.kinetic > 0, 3: law.slope != 0, 4: law.static is not None and law.breakaway > law.kinetic}
        kept = [0, 1, *(part for part, there in told.items() if there)]
        covariance[:] = 0.0
        slopes = {part: _slope_of(best, part) for part in kept}
        kept = [part for part, slope in slopes.items() if slope.any()]  # what moves nothing can not be told
        jacobian = np.column_stack([*(slopes[part] for part in kept), np.ones(len(measured))])
        fit = least_squares(jacobian, measured - best.moved())
        covariance[np.ix_(kept, kept)] = _covariance(jacobian, fit.residual, fit.independent)[:-1, :-1]
        step = np.zeros(5)
        step[kept] = fit.coefficients[:-1]
        tried = best.at(best.values + step)
        nearer = _apart(tried, measured)
        if not nearer < apart:
            break
        settled = nearer > SETTLED * apart
        best, apart = tried, nearer
        if settled:
            break
    values, vectors = np.linalg.eigh(covariance)
    return replace(best, root=vectors * np.sqrt(np.maximum(values, 0.0)))


def _apart(belief: Belief, measured: Array) -> float:
    """Standard deviation of what the simulated displacement leaves of the measured one."""
    return float(np.std(measured - belief.moved()))


def _slope_of(belief: Belief, part: int) -> Array:
    """How the displacement changes with one value, by a central difference."""
    values, step = belief.values, np.zeros(5)
    size = float(np.std(belief.record["v" if part == 1 else "x"])) if part < 2 else abs(values[part])
    step[part] = NUDGE * size
    return np.asarray((belief.at(values + step).moved() - belief.at(values - step).moved()) / (2 * step[part]))


def _covariance(jacobian: Array, residual: Array, independent: float) -> Array:
    """Of the coefficients, for a residual that is worth so many independent samples."""
    freedom = max(1.0, min(independent, len(residual)) - jacobian.shape[1])
    power = float(residual @ residual) / len(residual) * min(independent, len(residual)) / freedom
    scale = np.linalg.norm(jacobian, axis=0)
    unit = jacobian / scale
    inverse = np.linalg.pinv(unit.T @ unit) / np.outer(scale, scale)
    return np.asarray(inverse * power * len(residual) / min(independent, len(residual)))


def _law(record: Record, contact: str) -> tuple[LinearSlope, tuple[float, float]]:
    """Dry friction and slope against speed while it slides, and their standard deviations."""
    velocity = record["v"]
    if contact == "base" and "z" in record:
        velocity = velocity - np.gradient(record["z"]) * record.fs
    slides = np.abs(velocity) > SLIDES * float(np.max(np.abs(velocity)))
    columns = np.column_stack([np.sign(velocity), velocity, np.ones(len(velocity))])[slides]
    friction = record["friction"][slides]
    kept = [0, 1, 2]
    fit = least_squares(columns, friction)
    for part in (1, 0):  # the slope is the first to go: dry friction is what the record is asked for
        value, sd = fit.coefficients[kept.index(part)], fit.sd[kept.index(part)]
        if abs(value) < NORMAL_95 * sd or (part == 0 and value < 0):
            kept.remove(part)
            fit = least_squares(columns[:, kept], friction)
    values = {part: (float(fit.coefficients[at]), float(fit.sd[at])) for at, part in enumerate(kept)}
    (kinetic, kinetic_sd), (slope, slope_sd) = (values.get(part, (0.0, 0.0)) for part in (0, 1))
    return LinearSlope(max(0.0, kinetic), slope=slope), (kinetic_sd, slope_sd)


def _sensors(record: Record) -> list[Sensor]:
    """Sensors with the noise, counts, range, mount and delay of the record's own."""
    sensors = []
    for name in SENSED:
        if name in record and is_measured(record, name):
            channel, values = record.channels[name], record[name]
            step = quantisation_step(values)
            limit = float(np.max(np.abs(values))) if saturated(values).any() else np.inf
            mount = None if channel.mount is None else Mount(*channel.mount, mass=channel.inertia)
            noise = Noise(channel.noise if channel.noise is not None else noise_level(values, record.fs))
            discharge = np.inf if channel.discharge is None else channel.discharge
            digitiser = Digitiser(step=step, limit=limit)
            sensors.append(
                Sensor(name, lag=channel.delay, mount=mount, discharge=discharge, noise=noise, digitiser=digitiser)
            )
    return sensors
