"""The virtual rig: what real sensors would have written of a simulated motion, and what its shaker can do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ModelError
from stickslip.oscillator import Oscillator
from stickslip.parameters import finite
from stickslip.record.channels import Channel, described
from stickslip.record.record import Record, Step
from stickslip.rig.sensor import Digitiser, Mount, Noise, Sensor
from stickslip.rig.settings import ShakerSettings
from stickslip.signals.response import respond
from stickslip.solve.trajectory import Trajectory

MOST_ROWS = 10_000_000  # of a record: with its sensors' convolutions some hundred bytes each

UNITS = {"x": "m", "v": "m/s", "a": "m/s^2", "friction": "N", "z": "m", "force": "N"}  # of what a sensor sits on


POUND, GRAVITY = 4.4482216152605, 9.80665  # force [N], acceleration [m/s^2]


@dataclass(frozen=True)
class Shaker:
    r"""The limits of a shaker that moves the base as :math:`A \cos 2 \pi f t`.

    A is at most the stroke, :math:`2\pi f A` the velocity, and :math:`M (2\pi f)^2 A` with the pull of the spring the
    force. The thesis's (LDS 400, section 2.2) has 8 mm of amplitude, and a clean sine from 1 Hz on.

    Attributes
    ----------
    stroke : float
        Largest amplitude [m].
    lowest, highest : float
        Frequencies [Hz] between which its motion is a sine.
    velocity : float
        Largest velocity [m/s].
    force : float
        Largest force [N].
    moving_mass : float
        Of armature, table and base [kg].

    Raises
    ------
    ModelError
        A value without meaning.

    Examples
    --------
    >>> shaker = Shaker(force=20.0, moving_mass=1.5)
    >>> round(1e3 * shaker.largest(11.1), 2), shaker.bound(11.1)
    (2.74, 'force')
    """

    stroke: float = 8e-3
    lowest: float = 1.0
    highest: float = math.inf
    velocity: float = math.inf
    force: float = math.inf
    moving_mass: float = 0.0

    def __post_init__(self) -> None:
        finite("stroke", self.stroke, unit="m", positive=True)
        finite("lowest", self.lowest, unit="Hz")
        finite("moving_mass", self.moving_mass, unit="kg")
        for name in ("highest", "velocity", "force"):
            if not getattr(self, name) > 0:
                raise ModelError(f"{name} = {getattr(self, name)}", "a limit is positive", "leave it out where unknown")
        if not self.lowest < self.highest:
            raise ModelError(f"from {self.lowest} to {self.highest} Hz", "a range goes upwards", "swap them")

    @classmethod
    def of(cls, settings: ShakerSettings | None) -> Shaker:
        """The shaker of a rig's settings; the thesis's where they say nothing."""
        if settings is None:
            return cls()
        return cls(**{name: value for name, value in settings.model_dump().items() if value is not None})

    def demands(self, frequency: float, amplitude: float, *, pull: float = 0.0) -> Mapping[str, float]:
        """What a motion asks of it, each as a part of the limit.

        Parameters
        ----------
        frequency : float
            [Hz].
        amplitude : float
            [m].
        pull : float
            Largest force of the spring on the base [N].

        Returns
        -------
        mapping of str to float
            "stroke", "velocity" and "force"; more than 1 can not be.
        """
        turn = 2 * math.pi * frequency
        force = self.moving_mass * turn**2 * amplitude + pull
        velocity = turn * amplitude
        return {"stroke": amplitude / self.stroke, "velocity": velocity / self.velocity, "force": force / self.force}

    def largest(self, frequency: float, *, pull: float = 0.0) -> float:
        """The largest amplitude [m] at a frequency [Hz], the spring pulling so much [N]; 0 where there is none."""
        turn = 2 * math.pi * frequency
        if not self.lowest <= frequency <= self.highest or pull >= self.force:
            return 0.0
        by_force = (self.force - pull) / (self.moving_mass * turn**2) if self.moving_mass else math.inf
        return min(self.stroke, self.velocity / turn, by_force)

    def bound(self, frequency: float, *, pull: float = 0.0) -> str:
        """Which limit the largest amplitude at a frequency reaches."""
        demands = self.demands(frequency, max(self.largest(frequency, pull=pull), 1e-12), pull=pull)
        return max(demands, key=lambda name: demands[name])

    def require(self, frequency: float, amplitude: float, *, pull: float = 0.0) -> None:
        """Refuse, in one sentence, a motion that it can not make.

        Raises
        ------
        ModelError
            The frequency lies outside its range, or the amplitude is too large.
        """
        if not self.lowest <= frequency <= self.highest:
            raise ModelError(
                f"{frequency:g} Hz",
                f"the shaker's motion is a sine from {self.lowest:g} to {self.highest:g} Hz",
                "choose a frequency between",
            )
        demands = self.demands(frequency, amplitude, pull=pull)
        worst = max(demands, key=lambda name: demands[name])
        if demands[worst] > 1:
            raise ModelError(
                f"an amplitude of {1e3 * amplitude:.3g} mm at {frequency:g} Hz",
                f"the shaker's {worst} allows {1e3 * self.largest(frequency, pull=pull):.3g} mm there",
                "ask for less",
            )


def _air_track() -> tuple[Sensor, ...]:
    """Section 2.2: two LVDTs, late by 1.26 ms; an accelerometer; a load cell."""
    lvdt = Sensor("x", lag=0.0389 / 30.91, noise=Noise(1e-6), digitiser=Digitiser(step=2.5e-6, limit=12.7e-3))
    return (
        lvdt,
        replace(lvdt, channel="z"),
        Sensor(
            "a", mount=Mount(125.0, 0.1), noise=Noise(0.04), digitiser=Digitiser(limit=5 * GRAVITY), sensitivity="1 V/g"
        ),
        Sensor(
            "load",
            mount=Mount(250.0, 0.05, mass=0.05),
            discharge=50.0,
            noise=Noise(0.002),
            digitiser=Digitiser(step=0.0002 * POUND, limit=10 * POUND),
            sensitivity="500 mV/lbf",
        ),
    )


def _linear_bearing() -> tuple[Sensor, ...]:
    """Section 7.2: the same, and what listens to the normal direction and to the sound."""
    calm = (sensor.having(white=sensor.noise.white / 2) for sensor in _air_track())
    normal = Sensor("ay", noise=Noise(0.1), digitiser=Digitiser(limit=500 * GRAVITY), sensitivity="10 mV/g")
    microphone = Sensor("sound", mount=Mount(5000.0, math.sqrt(0.5)), noise=Noise(20e-6 * 10 ** (55 / 20)))
    return (*calm, normal, microphone)


@dataclass(frozen=True)
class Rig:
    """Sensors on one data-acquisition unit; the thesis's air-track rig where nothing is said.

    Attributes
    ----------
    sensors : tuple of Sensor
        One for each channel.
    offset : float
        Time [s] of the unit's first sample on the run's clock, as the unit does not know it.
    rate : float
        By how much its clock runs fast, relative to 1: 1e-4 takes 100 samples too many in a million.

    Raises
    ------
    ModelError
        No sensor, two sensors for one channel, or a clock without meaning.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(
    ...     mass=2.42, stiffness=2310, law=ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9),
    ...     drive=ss.drives.HarmonicBase(0.65e-3, frequency=2.5),
    ... )
    >>> record = Rig().measure(ss.simulate(slider, cycles=4), fs=4000, rng=1)
    >>> list(record), record.truth["contact stiffness"]
    (['x', 'z', 'a', 'load'], 192000)
    """

    sensors: tuple[Sensor, ...] = field(default_factory=_air_track)
    offset: float = 0.0
    rate: float = 0.0

    def __post_init__(self) -> None:
        finite("offset", self.offset, unit="s", signed=True)
        finite("rate", self.rate, unit="(ratio)", signed=True)
        names = [sensor.channel for sensor in self.sensors]
        if not names or len(set(names)) < len(names):
            raise ModelError(
                f"sensors for {', '.join(names) or 'nothing'}", "a rig has one sensor for each channel", "correct them"
            )
        if not self.rate > -0.5:
            raise ModelError(f"rate = {self.rate}", "a clock is fast or slow by a small part", "correct rate=")

    @classmethod
    def air_track(cls) -> Rig:
        """The rig of the thesis's chapters 2 to 5.

        Two LVDTs (Robinson-Halpern 210A-0500: half an inch of either sign) with 2.5 um counts (section 2.2) that come
        1.26 ms late, the time shift of section 2.3 (0.0389 rad over 30.91 rad/s); an accelerometer of 1 V/g (PCB 393C)
        on a mount that rings at 125 Hz; a load cell (PCB 208B) of 500 mV/lb with 0.0002 lb resolution, 10 lb range and
        a discharge of 50 s (section 2.2) behind a flange that rings at 250 Hz (section 2.5).

        The thesis gives the displacement sensors the whole of the phase by which the accelerometer led in a free
        vibration. So does this rig, on which it leads by less, 0.0326 rad: the accelerometer's mount makes it
        0.25 ms late, and twice the damping ratio of the lead is the decay's. Sensors that are 1.46 ms late,
        ``having("x", lag=1.461e-3)``, show the measured phase.

        Not in the thesis, and assumed: the noise (1 um, 0.04 m/s^2, 2 mN), the mounts' damping (0.10, 0.05), the
        flange's 50 g, the accelerometer's range of 5 g. In the thesis, and left out: the sensors' own resonances of
        3.5 and 70 kHz, far above the mounts', and that the accelerometer reads from 0.025 Hz on only
        (``having("a", discharge=20.0)`` adds that: 0.2 ms of lead at 2.5 Hz), and 5 % of the transverse acceleration.
        """
        return cls()

    @classmethod
    def linear_bearing(cls) -> Rig:
        """The rig of the thesis's chapter 7: the same on a linear bearing, and sensors of what squeaks.

        The air track's sound is gone, and the noise of chapter 2's sensors is assumed to be half as large. An
        accelerometer of 10 mV/g (PCB 303A02; noise of 0.1 m/s^2 and range of 500 g assumed) reads the normal direction
        as ``ay``, and a microphone in 55 dB of noise the sound, low-passed at 5 kHz (section 7.2). They write what a
        run has: ``having("ay", of="a2")`` where the second coordinate of a structure is the normal one. The thesis
        sampled at 10 kHz. The bearing's own 0.413 N and damping ratio of 0.0177 (section 6.5) belong to the system.
        """
        return cls(_linear_bearing())

    @classmethod
    def perfect(cls, *channels: str) -> Rig:
        """Sensors without any fault.

        Parameters
        ----------
        *channels : str
            What they write; x, z, a and load where none is named.
        """
        return cls(tuple(Sensor(channel) for channel in channels or ("x", "z", "a", "load")))

    def having(self, channel: str, /, **changes: Any) -> Rig:
        """The same rig with one sensor changed.

        Parameters
        ----------
        channel : str
            The sensor's channel.
        **changes
            New values by name, see :meth:`Sensor.having`.

        Returns
        -------
        Rig
        """
        names = [sensor.channel for sensor in self.sensors]
        if channel not in names:
            raise ModelError(f"no sensor writes '{channel}'", f"the rig has {', '.join(names)}", "choose one of them")
        changed = [s.having(**changes) if s.channel == channel else s for s in self.sensors]
        return replace(self, sensors=tuple(changed))

    def stated(self, record: Record) -> Record:
        """A record of this rig with what a calibration of its sensors would say, stated in the channels.

        Parameters
        ----------
        record : Record
            From :meth:`measure`.

        Returns
        -------
        Record
            With each channel's delay, noise, mount, inertia and discharge; wrong gains remain, as nobody knows them.
        """
        for sensor in self.sensors:
            if sensor.channel in record:
                record = record.with_details(sensor.channel, **sensor.certificate)
        return record

    def measure(
        self, run: Trajectory, *, fs: float, rng: int | np.random.Generator | None = None, start: float = 0.0
    ) -> Record:
        """What would this rig have recorded of a simulated motion?

        Each sensor's reading is the exact convolution of the motion with its mount and its discharge, taken at its
        own late instants; then gain, noise, clipping, counts and gaps. A sensor of what the run does not have (z where
        the base stands still) is left out.

        Parameters
        ----------
        run : Trajectory
            From :func:`~stickslip.simulate`.
        fs : float
            Sampling rate that the unit states [Hz].
        rng : int or numpy.random.Generator, optional
            Where chance comes from: a seed gives the same record again.
        start : float
            Instant of the run [s] at which the record begins.

        Returns
        -------
        Record
            With the truth in :attr:`Record.truth`: the oscillator's constants, the law's, the share of the time in
            which the contact sticks, and each change of mode as (time on the record's clock, kind).

        Raises
        ------
        ModelError
            A rate that is not positive, or a start outside the run.
        """
        finite("fs", fs, unit="Hz", positive=True)
        begin = finite("start", start, unit="s", signed=True) + self.offset
        count = math.floor((run.duration - begin) * fs * (1 + self.rate) * (1 + 1e-12)) + 1
        if not 0 <= begin < run.duration or count < 2:
            raise ModelError(
                f"a record from {begin:g} s on", f"the run lasts from 0 to {run.duration:g} s", "start within it"
            )
        if count > MOST_ROWS:
            raise ModelError(
                f"fs = {fs:g} Hz over {run.duration - begin:g} s",
                f"a rig writes at most {MOST_ROWS:g} rows",
                "give a lower fs= or a shorter run",
            )
        chance = np.random.default_rng(rng)
        times = begin + np.arange(count) / (fs * (1 + self.rate))
        samples, channels = self._read_all(_signals(run), run.starts, times, chance)
        settings = {"rig": repr(self), "fs": fs, "rng": rng if isinstance(rng, int) else None, "start": start}
        history = (
            Step("simulate", {"system": repr(run.system)}, f"{len(run.modes)} pieces, {run.status}"),
            Step("Rig.measure", settings, f"{count} samples of {', '.join(samples)}"),
        )
        return Record(samples, channels, float(fs), 0.0, history, None, _truth(run, begin, float(times[-1])))

    def read(
        self,
        signals: Mapping[str, Callable[[Array], Array]],
        *,
        duration: float,
        fs: float,
        rng: int | np.random.Generator | None = None,
    ) -> Record:
        """What would this rig have recorded of motions and forces that are given as functions of time?

        Weights on a load cell, gauge blocks before a displacement sensor, a rig at rest: what no oscillator does.

        Parameters
        ----------
        signals : mapping of str to callable
            By what is sensed ("x", "z", "v", "a", "friction", "force"): its values [SI] at increasing instants [s],
            none below 0; what is not given is zero.
        duration : float
            Of the record [s].
        fs : float
            Sampling rate [Hz].
        rng : int or numpy.random.Generator, optional
            Where chance comes from.

        Returns
        -------
        Record

        Raises
        ------
        ModelError
            A rate or a duration that is not positive, or a signal that no sensor can sit on.

        Examples
        --------
        >>> record = Rig().read({"friction": lambda time: np.where(time < 1, 0.0, 5.0)}, duration=2, fs=1000, rng=1)
        >>> round(float(record["load"][-1]), 1)
        4.9
        """
        finite("fs", fs, unit="Hz", positive=True)
        finite("duration", duration, unit="s", positive=True)
        if strange := [name for name in signals if name not in UNITS]:
            raise ModelError(f"a signal '{strange[0]}'", f"there are {', '.join(UNITS)}", "choose one of them")
        count = round(duration * fs)
        if not 2 <= count <= MOST_ROWS:
            raise ModelError(f"{count} samples", f"a rig writes 2 to {MOST_ROWS:g} rows", "change fs= or duration=")
        known = {name: _Signal(signals.get(name, np.zeros_like), unit) for name, unit in UNITS.items()}
        times = np.arange(count) / (fs * (1 + self.rate))
        samples, channels = self._read_all(known, np.zeros(0), times, np.random.default_rng(rng))
        settings = {"rig": repr(self), "fs": fs, "rng": rng if isinstance(rng, int) else None}
        step = Step("Rig.read", settings, f"{count} samples of {', '.join(samples)}")
        return Record(samples, channels, float(fs), 0.0, (step,))

    def _read_all(
        self, signals: Mapping[str, _Signal], breaks: Array, times: Array, chance: np.random.Generator
    ) -> tuple[dict[str, Array], dict[str, Channel]]:
        """Samples and channels of every sensor that sits on one of the signals."""
        samples: dict[str, Array] = {}
        channels: dict[str, Channel] = {}
        for sensor in self.sensors:
            own = np.random.default_rng(chance.integers(2**63))  # a sensor's noise does not hang on the others
            if sensor.source not in signals:
                continue
            if sensor.mount and sensor.mount.mass and sensor.mount.on not in signals:
                raise ModelError(
                    f"the mount of {sensor.channel} moves as '{sensor.mount.on}'",
                    f"the run has {', '.join(signals)}",
                    "name the acceleration of its mass: Mount(..., on=...)",
                )
            samples[sensor.channel] = _read(sensor, signals, breaks, times, own)
            unit = signals[sensor.source].unit
            label = described(sensor.channel, unit)
            channels[sensor.channel] = Channel(sensor.channel, unit, label, "Rig", sensor.sensitivity)
        if not samples:
            raise ModelError(
                f"sensors of {', '.join(s.source for s in self.sensors)}",
                f"the run has {', '.join(signals)}",
                "choose sensors of these",
            )
        return samples, channels


class _Signal(NamedTuple):
    """One thing a sensor may sit on: its values at increasing instants, and its unit."""

    values: Callable[[Array], Array]
    unit: str


def _signals(run: Trajectory) -> dict[str, _Signal]:
    """Everything of a run that a sensor may sit on, by name."""
    moved = {"z": bool(run.table.motion.base), "force": bool(run.table.motion.force)}
    return {
        label: _Signal(_picked(run, name, j), unit)
        for name in UNITS
        if moved.get(name, True)
        for j, (label, unit) in enumerate(zip(run.labels(name), run.units(name), strict=True))
    }


def _picked(run: Trajectory, name: str, row: int) -> Callable[[Array], Array]:
    return lambda times: run.sample(np.clip(times, 0.0, run.duration), (name,))[0][row]


def _read(
    sensor: Sensor, signals: Mapping[str, _Signal], breaks: Array, times: Array, rng: np.random.Generator
) -> Array:
    """What one sensor writes at equally spaced instants."""
    fs = (len(times) - 1) / float(times[-1] - times[0])

    def sensed(at: Array) -> Array:
        values = signals[sensor.source].values(at)
        if not (sensor.mount and sensor.mount.mass):
            return values
        return values + sensor.mount.mass * signals[sensor.mount.on].values(at)

    ideal = respond(sensed, breaks=breaks, times=times - sensor.lag, response=sensor.response)
    noisy = sensor.gain * ideal + sensor.noise.samples(len(times), fs=fs, rng=rng)
    written = sensor.digitiser.counts(noisy)
    written[sensor.digitiser.lost(len(times), fs=fs, rng=rng)] = np.nan
    return written


def _truth(run: Trajectory, begin: float, end: float) -> Mapping[str, Any]:
    """What is true of a run between two instants [s]; event times count from the first."""
    system, truth = run.system, {}
    if isinstance(system, Oscillator):
        truth = {name: getattr(system, name) for name in ("mass", "stiffness", "damping")}
        names = {
            "kinetic": "sliding friction", "static": "static friction", "stiffness": "contact stiffness",
            "damping": "contact damping",
        }  # fmt: skip
        law = system.law
        truth |= {title: getattr(law, name) for name, title in names.items() if getattr(law, name, None) is not None}
        if frequency := getattr(system.drive, "frequency", None):
            truth["forcing frequency"] = frequency
    kinds = np.array([mode.kind for mode in run.table.modes])[run.modes]
    first = np.clip(run.starts, begin, end)
    last = np.clip(run.starts + run.durations, begin, end)
    stuck = np.isin(kinds, ("stick", "microstick"))
    truth["stuck share of the time"] = float(np.sum((last - first)[stuck]) / (end - begin))
    truth["events"] = [[event.time - begin, event.kind] for event in run.events if begin <= event.time <= end]
    return truth
