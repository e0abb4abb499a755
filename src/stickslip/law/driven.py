"""What moves the oscillator during a record: the motion of the base that was measured, or the force applied."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.balance.motion import DRIVES, driving
from stickslip.drives.kinds import Belt, Drive, HarmonicBase, MultiTone, Recorded
from stickslip.errors import EstimateError
from stickslip.laws.coulomb import Coulomb
from stickslip.oscillator import Oscillator
from stickslip.record.record import Record
from stickslip.signals.derivatives import LEAST, Filter, best_bandwidth
from stickslip.signals.noise import density_beside, noise_level, quantisation_step
from stickslip.solve.simulate import simulate

HARMONICS = 5
EXACT = 1e-6  # of a motion's range: what is left below is rounding
SLOWLY = 0.1  # of a measured motion, that slow noise of its sensor may be
AS_GOOD = 1.15  # times its noise that a sum of tones may stray from what was measured
COARSE = (128, 64, 32, 16, 8, 4, 2)  # samples from knot to knot of a motion without tones, tried in turn
NEAR = 0.3  # of its noise by which the knots may miss it
DRIFT = 0.1  # of a tone: what a sensor may drift in a record; more of it is a motion
SURE = 1e-9  # of a drive, that is never surer


class DriveFrom(Protocol):
    """A drive from any instant of the record on; its measurement may be off in the ways of `unsure`."""

    @property
    def unsure(self) -> tuple[float, ...]:
        """Standard deviation of each way in which the measured drive may be off."""

    @property
    def gain_sd(self) -> float:
        """That of its sensor's gain."""

    def calibrated(self, gain_sd: float) -> DriveFrom:
        """The drive by a sensor whose gain is no surer than that."""

    def as_measured(self) -> DriveFrom:
        """The drive off by the gain of its sensor alone."""

    def held(self) -> DriveFrom:
        """The drive by a sensor whose gain is as stated."""

    def __call__(self, begin: float, end: float, off: ArrayLike = ()) -> Drive:
        """The drive whose time 0 is `begin` [s] on the record's clock."""


@dataclass(frozen=True, eq=False)
class Measured:
    """A drive that a sensor measured: off by a share first of all, of which `gain_sd` is its gain's.

    Of one record a wrong gain of the base scales every length and the friction alike. Of several, each with its own, it
    is in none of what else is fitted: held, a damper was told up to 6 % off, and held in 26 of 40 pairs of records
    whose gains were 0.5 % off.
    """

    unsure: tuple[float, ...]
    gain_sd: float = field(default=0.0, kw_only=True)

    def calibrated(self, gain_sd: float) -> Self:
        """The drive by a sensor whose gain is no surer than that."""
        return replace(self, unsure=(math.hypot(self.unsure[0], gain_sd), *self.unsure[1:]), gain_sd=gain_sd)

    def as_measured(self) -> Self:
        """The drive off by the gain of its sensor alone."""
        return replace(self, unsure=(self.gain_sd,) if self.gain_sd else ())

    def held(self) -> Self:
        """The drive by a sensor whose gain is as stated."""
        noise = self.unsure[0] ** 2 - self.gain_sd**2 if self.unsure else 0.0
        unsure = (math.sqrt(noise), *self.unsure[1:]) if noise > 0 else self.unsure[1:]
        return replace(self, unsure=unsure, gain_sd=0.0)


@dataclass(frozen=True, eq=False)
class Tones(Measured):
    """``sum A cos(2 pi F t + phase)``, t on the record's clock; off by a share, an angle, and turns in the record.

    What was measured `beside` it is the sensor's, as its noise.
    """

    tones: tuple[tuple[float, float, float], ...]
    on: str
    contact: str
    middle: float
    length: float
    beside: Array

    def __call__(self, begin: float, end: float, off: ArrayLike = ()) -> Drive:
        """The drive whose time 0 is `begin`."""
        share, angle, turns = (*np.ravel(off).tolist(), 0.0, 0.0, 0.0)[:3]
        slower = turns / self.length
        moved = []
        for order, (size, f, phase) in enumerate(self.tones, start=1):
            then = phase + 2 * np.pi * (f * begin + order * slower * (begin - self.middle)) + order * angle
            moved.append((size * (1 + share), f + order * slower, float(then % (2 * np.pi))))
        if len(moved) == 1 and self.on == "base":
            size, frequency, phase = moved[0]
            return HarmonicBase(size, frequency=frequency, phase=phase, contact=self.contact)
        return MultiTone(moved, on=self.on, contact=self.contact)

    def strayed(self, chance: np.random.Generator) -> Tones:
        """The motion as its harmonics would seem under other noise of the same size; of the first it is fitted."""
        first, *others = self.tones
        moved = [first]
        for size, frequency, phase in others:
            wave = cmath.rect(size, phase) + self.unsure[1] * first[0] * complex(*chance.standard_normal(2))
            moved.append((abs(wave), frequency, cmath.phase(wave)))
        return replace(self, tones=tuple(moved))


class Smoothed(NamedTuple):
    """How a measured motion was smoothed: its readings, their rate [Hz] and noise [m], and the bandwidth [Hz] kept."""

    readings: int
    fs: float
    noise: float
    bandwidth: float

    def apply(self, values: Array) -> Array:
        """The motion behind readings."""
        return Filter("smoother", self.fs, self.bandwidth).apply(values, {0: 1.0})


@dataclass(frozen=True, eq=False)
class Sampled(Measured):
    """A motion or force of any shape, smoothed, at instants as dense as its bandwidth asks for."""

    values: Array
    fs: float
    late: float
    on: str
    contact: str
    smoothed: Smoothed

    def strayed(self, chance: np.random.Generator) -> Sampled:
        """The motion as it would seem under other noise of the same size."""
        of = self.smoothed
        noise = of.apply(chance.normal(scale=of.noise, size=of.readings))
        own = np.arange(len(self.values)) / self.fs
        return replace(self, values=self.values + np.interp(own, np.arange(of.readings) / of.fs, noise))

    def coarser(self, share: float) -> Sampled:
        """At fewer instants, a share of the motion's deviation away: each instant costs the engine a new start."""
        knots, rate = _knots(self.values, self.fs, share * float(np.std(self.values)) / NEAR)
        return replace(self, values=knots, fs=rate)

    def __call__(self, begin: float, end: float, off: ArrayLike = ()) -> Drive:
        """The drive whose time 0 is `begin`."""
        share = float(np.sum(off))
        from scipy.interpolate import CubicSpline

        own = np.arange(len(self.values)) / self.fs - self.late
        count = max(4, int(np.ceil((end - begin) * self.fs)) + 1)
        step = max((end - begin) / (count - 1), 1e-12)
        samples = (1 + share) * CubicSpline(own, self.values)(begin + step * np.arange(count + 1))
        return Recorded(samples, fs=1 / step, on=self.on, contact=self.contact)


def measured_drive(record: Record, given: Drive) -> DriveFrom:
    """What moves the oscillator during a record, from any instant on.

    The base's motion z, or the applied force, is a tone with its harmonics where these reach its noise; any other is
    smoothed and followed as it was recorded. A record of neither is driven as `given`.
    """
    channel = driving(record)
    return Known(given) if channel is None else next(_driven(record, channel, getattr(given, "contact", "ground")))


def possible_drives(record: Record, given: Drive) -> list[DriveFrom]:
    """The same, and for a motion that strays from its tones the tones alone: x tells whether that was slow noise."""
    channel = driving(record)
    return [Known(given)] if channel is None else list(_driven(record, channel, getattr(given, "contact", "ground")))


def as_driven(record: Record, given: Drive) -> Record:
    """The record with the base's motion z that a known drive makes, where none was measured."""
    if {"z", "force"} & set(record) or not given.motion().base:
        return record
    still = Oscillator(mass=1.0, stiffness=0.0, law=Coulomb(1.0), drive=given)
    time = np.arange(len(record)) / record.fs
    values, _ = simulate(still, duration=float(time[-1]) or 1.0, start={}).sample(time, ("z",))
    return record.with_channel("z", values[0], unit="m")


def face_of(given: Drive, record: Record) -> tuple[Array | float, Array | float]:
    """Displacement and velocity of the counter-face at each row."""
    if getattr(given, "contact", "ground") == "base" and "z" in record:
        return record["z"], np.asarray(np.gradient(record["z"]) * record.fs, dtype=np.float64)
    speed = given.speed if isinstance(given, Belt) else 0.0
    return speed * np.arange(len(record), dtype=np.float64) / record.fs, speed


def _driven(record: Record, channel: str, contact: str) -> Iterator[DriveFrom]:
    """What moves the mass as it was measured; then, where that is no tone with its harmonics, the nearest of these."""
    on, values, late = DRIVES[channel], record[channel], record.channels[channel].delay
    record.require_clean(channel, question="a fitted law", samples=LEAST)
    stated = record.channels[channel].noise  # before the counts, which are in what is measured
    noise = math.hypot(stated, quantisation_step(values) / 12**0.5) if stated else noise_level(values, record.fs)
    time = np.arange(len(values)) / record.fs - late
    tones, beside = _tones(values, time)
    left, noisy = float(np.std(beside)), max(AS_GOOD * noise, EXACT * float(np.ptp(values)))
    if left > noisy:
        smoothed = Smoothed(len(values), record.fs, noise, best_bandwidth(values, record.fs))
        knots, rate = _knots(smoothed.apply(values - values.mean()), record.fs, noise)
        share = max(SURE, noise * np.sqrt(2 / len(values))) / (2**0.5 * float(np.std(values)))
        yield Sampled((share,), knots, rate, late, on, contact, smoothed)
    if tones and left <= max(noisy, SLOWLY * float(np.std(values))):
        size, frequency, _ = tones[0]
        spectrum = density_beside(beside, record.fs, frequency=frequency, white=noise)
        if spectrum is not None:
            density, spacing = spectrum
            noise = math.sqrt(float(density[round(frequency / spacing) - 1]) * record.fs / 2)
        share, length = max(SURE, noise * np.sqrt(2 / len(values))) / size, time[-1] - time[0]
        unsure = (share, share, share * np.sqrt(12) / (2 * np.pi))
        yield Tones(unsure, tones, on, contact, float(time[0] + length / 2), length, beside)


def _knots(smooth: Array, fs: float, noise: float) -> tuple[Array, float]:
    """As few instants as follow a smooth motion within a part of its noise, and their rate [Hz]."""
    from scipy.interpolate import CubicSpline

    time, allowed = np.arange(len(smooth)) / fs, max(NEAR * noise, 1e-6 * float(np.ptp(smooth)))
    for step in COARSE:
        at = np.linspace(0.0, time[-1], max(4, math.ceil(len(smooth) / step) + 1))
        knots = np.interp(at, time, smooth)
        if np.sqrt(np.mean((CubicSpline(at, knots)(time) - smooth) ** 2)) <= allowed:
            return knots, (len(at) - 1) / float(time[-1])
    return smooth, fs


def _tones(values: Array, time: Array) -> tuple[tuple[tuple[float, float, float], ...], Array]:
    """Amplitude, frequency and phase of a tone and as many harmonics as it needs, and what they leave of the values.

    No tone, and all of the values, where there is no whole cycle, or more of a drift than a sensor has.
    """
    from scipy.optimize import minimize_scalar

    size, span = len(values), time[-1] - time[0]
    centred = values - values.mean()
    spectrum = np.abs(np.fft.rfft(centred * np.hanning(size), 4 * size))
    coarse = float(np.argmax(spectrum)) / (4 * size) * size / span
    nearest: tuple[tuple[tuple[float, float, float], ...], Array] = ((), centred)
    least, worth = EXACT * float(np.ptp(values)), math.inf
    for count in range(1, HARMONICS + 1) if coarse * span >= 1.0 else ():

        def left(frequency: float, count: int = count) -> float:
            return float(np.std(_fitted(values, time, frequency, count)[1]))

        best = minimize_scalar(
            left, bounds=(coarse - 0.5 / span, coarse + 0.5 / span), method="bounded", options={"xatol": 1e-9 * coarse}
        )
        solution, beside = _fitted(values, time, float(best.x), count)
        cosines, sines = solution[1:-1:2], solution[2:-1:2]
        sizes, angles = np.hypot(cosines, sines), np.arctan2(-sines, cosines)
        # a harmonic below the noise moves the mass all the same: Schwarz's criterion tells it from noise
        criterion = 2 * size * math.log(max(float(np.std(beside)), least)) + 2 * count * math.log(size)
        if abs(solution[-1]) <= DRIFT * sizes[0] and criterion < worth:
            worth = criterion
            waves = enumerate(zip(sizes, angles, strict=True), start=1)
            nearest = tuple((float(a), order * float(best.x), float(p)) for order, (a, p) in waves), beside
    return nearest


def _fitted(values: Array, time: Array, frequency: float, count: int) -> tuple[Array, Array]:
    """Coefficients of a tone and its harmonics on a line, and what they leave."""
    waves = np.cumprod(np.tile(np.exp(2j * np.pi * frequency * time)[:, None], count), axis=1)
    columns = np.ones((len(time), 2 * count + 2))
    columns[:, 1:-1:2], columns[:, 2:-1:2] = waves.real, waves.imag
    columns[:, -1] = np.linspace(-0.5, 0.5, len(time))
    solution = np.linalg.solve(columns.T @ columns, columns.T @ values)
    return np.asarray(solution), np.asarray(values - columns @ solution)


@dataclass(frozen=True, eq=False)
class Known:
    """The oscillator's own drive, that nobody has measured."""

    drive: Drive
    unsure: tuple[float, ...] = ()
    gain_sd: float = 0.0

    def held(self) -> Known:
        """The same."""
        return self

    def calibrated(self, gain_sd: float) -> Known:
        """The same: no sensor tells of it."""
        return self

    def as_measured(self) -> Known:
        """The same."""
        return self

    def __call__(self, begin: float, end: float, off: ArrayLike = ()) -> Drive:
        """The drive whose time 0 is `begin`."""
        return self.drive if begin == 0 else _Later(self.drive, begin)


@dataclass(frozen=True, eq=False)
class _Later:
    """A drive that has gone on for `begin` seconds when the run starts."""

    drive: Drive
    begin: float

    def motion(self) -> Any:
        """The same signals from then on."""
        motion = self.drive.motion()
        if motion.knots is not None:
            raise EstimateError(
                "a drive with knots that starts before the record's first slide",
                "a run begins with its drive",
                "give the base's motion as channel z",
            )
        values = {name: motion.start[name] for name in motion.rates}
        turned: dict[str, float] = {}
        for cosine, sine, omega, phase in motion.tones:
            angle = phase + omega * self.begin
            turned |= {cosine: float(np.cos(angle)), sine: float(np.sin(angle))}
        for name, rate in motion.rates.items():
            if name not in turned:
                values[name] += self.begin * rate.get("1", 0.0)
        tones = tuple((c, s, w, phase + w * self.begin) for c, s, w, phase in motion.tones)
        return replace(motion, start={**values, **turned}, tones=tones)
