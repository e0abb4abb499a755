"""The virtual rig: what real sensors would have written of a simulated motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.laws.base import finite
from stickslip.oscillator import Oscillator
from stickslip.record.channels import Channel, described
from stickslip.record.record import Record, Step
from stickslip.signals.response import Response, leak, resonance, respond
from stickslip.solve.trajectory import Trajectory

Array = NDArray[np.float64]

SENSED = {"load": "friction"}  # what a channel's sensor sits on, where the run calls it otherwise
POUND, GRAVITY = 4.4482216152605, 9.80665  # force [N], acceleration [m/s^2]


@dataclass(frozen=True)
class Mount:
    r"""What a sensor stands on: :math:`H = w^2/(s^2 + 2\zeta w s + w^2)` between the motion or force and its reading.

    Attributes
    ----------
    frequency : float
        Resonance w / 2 pi [Hz].
    damping : float
        Damping ratio zeta.
    mass : float
        Of a load cell's mount: mass [kg] between contact and cell, whose inertia the cell feels too: f + mass a.

    Raises
    ------
    ModelError
        A value has no meaning.

    Examples
    --------
    >>> Mount(frequency=125, damping=0.1)
    Mount(frequency=125, damping=0.1, mass=0.0)
    """

    frequency: float
    damping: float
    mass: float = 0.0

    def __post_init__(self) -> None:
        finite("frequency", self.frequency, unit="Hz", positive=True)
        finite("damping", self.damping, unit="(ratio)")
        finite("mass", self.mass, unit="kg", signed=True)


@dataclass(frozen=True)
class Noise:
    r"""Gaussian noise of a sensor: white, 1/f, and a band (the sound of an air track).

    Its one-sided spectral density is :math:`2\sigma^2/f_s\,(1 + f_c/f)`, and that of the band.

    Attributes
    ----------
    white : float
        Standard deviation sigma of the white part in a sample [unit of the channel].
    corner : float
        Frequency f_c [Hz] below which the 1/f part is the larger one; zero: none.
    band : float
        Standard deviation of the band's part [unit of the channel].
    low, high : float
        Edges of the band [Hz].

    Raises
    ------
    ModelError
        A value has no meaning.

    Examples
    --------
    >>> bool(abs(np.std(Noise(white=2.0).samples(10_000, fs=1000, rng=np.random.default_rng(1))) - 2) < 0.05)
    True
    """

    white: float = 0.0
    corner: float = 0.0
    band: float = 0.0
    low: float = 0.0
    high: float = math.inf

    def __post_init__(self) -> None:
        for name, unit in (
            ("white", "(channel's unit)"),
            ("corner", "Hz"),
            ("band", "(channel's unit)"),
            ("low", "Hz"),
        ):
            finite(name, getattr(self, name), unit=unit)
        if not self.low < self.high:
            raise ModelError(
                f"a band from {self.low} to {self.high} Hz", "a band has a low and a high edge", "swap them"
            )

    def samples(self, count: int, *, fs: float, rng: np.random.Generator) -> Array:
        """Samples of the noise.

        Parameters
        ----------
        count : int
            How many.
        fs : float
            Sampling rate [Hz].
        rng : numpy.random.Generator
            Where chance comes from.

        Returns
        -------
        ndarray (count,)
        """
        total = self.white * rng.standard_normal(count)
        frequency = np.fft.rfftfreq(count, 1 / fs)
        if self.white and self.corner:
            gain = np.sqrt(self.corner / np.maximum(frequency, fs / count))
            gain[0] = 0.0
            total += self.white * _shaped(rng.standard_normal(count), gain)
        inside = (frequency >= self.low) & (frequency <= self.high) & (frequency > 0)
        if self.band and inside.any():
            share = inside.sum() / max(1, len(frequency) - 1)
            total += self.band / math.sqrt(share) * _shaped(rng.standard_normal(count), inside.astype(float))
        return total


def _shaped(white: Array, gain: Array) -> Array:
    return np.fft.irfft(np.fft.rfft(white) * gain, len(white))


@dataclass(frozen=True)
class Digitiser:
    """How readings become numbers.

    Attributes
    ----------
    step : float
        Least step [unit of the channel]; zero: none.
    limit : float
        Largest reading of either sign [unit of the channel]; beyond it the sensor clips.
    offset : float
        What it reads at zero [unit of the channel].
    dropouts : float
        Gaps per second, each `gap` long, in which nothing is written (NaN).
    gap : float
        Length of a gap [s].

    Raises
    ------
    ModelError
        A value has no meaning.

    Examples
    --------
    >>> Digitiser(step=0.5, limit=2).counts(np.array([0.2, 0.3, 9.0]))
    array([0. , 0.5, 2. ])
    """

    step: float = 0.0
    limit: float = math.inf
    offset: float = 0.0
    dropouts: float = 0.0
    gap: float = 0.01

    def __post_init__(self) -> None:
        finite("step", self.step, unit="(channel's unit)")
        finite("offset", self.offset, unit="(channel's unit)", signed=True)
        finite("dropouts", self.dropouts, unit="1/s")
        finite("gap", self.gap, unit="s", positive=True)
        if not self.limit > 0:
            raise ModelError(f"limit = {self.limit}", "a sensor reads up to a positive limit", "correct limit=")

    def counts(self, readings: Array) -> Array:
        """The numbers written for readings.

        Parameters
        ----------
        readings : ndarray (n,)
            What the sensor says [unit of the channel].

        Returns
        -------
        ndarray (n,)
        """
        clipped = np.clip(readings + self.offset, -self.limit, self.limit)
        return np.round(clipped / self.step) * self.step if self.step else clipped

    def lost(self, count: int, *, fs: float, rng: np.random.Generator) -> NDArray[np.bool_]:
        """Which of `count` samples at `fs` [Hz] fall into gaps, by chance from `rng`."""
        lost = np.zeros(count, dtype=bool)
        if self.dropouts:
            length = max(1, round(self.gap * fs))
            for first in rng.integers(0, count, rng.poisson(self.dropouts * count / fs)):
                lost[first : first + length] = True
        return lost


@dataclass(frozen=True)
class Sensor:
    """One sensor, from the motion to its column in a file.

    Attributes
    ----------
    channel : str
        Name of the channel it writes ("x", "z", "a", "load" ...).
    of : str
        What of the run it senses ("x", "v", "a", "friction", "z", "force", of a structure "x1" ...); as the channel's
        name says where left out, a "load" being the friction.
    gain : float
        Reading over truth; 1 for a sensor whose calibration is right.
    lag : float
        Time [s] by which it is late.
    mount : Mount or None
        What it stands on; None: rigid.
    discharge : float
        Time constant [s] at which a piezoelectric sensor forgets; infinite: never.
    noise : Noise
        What is added.
    digitiser : Digitiser
        How readings become numbers.
    sensitivity : str
        Nominal, in words ("500 mV/lbf"), for the channel; the samples have it applied.

    Raises
    ------
    ModelError
        A value has no meaning.

    Examples
    --------
    >>> Sensor("x", lag=1.26e-3, noise=Noise(1e-6), digitiser=Digitiser(step=2.5e-6)).source
    'x'
    """

    channel: str
    of: str = ""
    gain: float = 1.0
    lag: float = 0.0
    mount: Mount | None = None
    discharge: float = math.inf
    noise: Noise = field(default_factory=Noise)
    digitiser: Digitiser = field(default_factory=Digitiser)
    sensitivity: str = ""

    def __post_init__(self) -> None:
        finite("gain", self.gain, unit="(ratio)", signed=True)
        finite("lag", self.lag, unit="s", signed=True)
        if self.gain == 0:
            raise ModelError("gain = 0", "a sensor that reads nothing is none", "leave the sensor out")
        if not self.discharge > 0:
            raise ModelError(f"discharge = {self.discharge} s", "a time constant is positive", "correct discharge=")

    @property
    def source(self) -> str:
        """What of the run it senses."""
        return self.of or SENSED.get(self.channel, self.channel)

    @property
    def response(self) -> Response:
        """Its mount and its discharge as one filter."""
        mount = resonance(self.mount.frequency, self.mount.damping) if self.mount else Response()
        return mount.then(leak(self.discharge)) if math.isfinite(self.discharge) else mount

    @property
    def certificate(self) -> dict[str, Any]:
        """What a calibration would say of it, as :meth:`Record.with_details` takes it; of its gain it knows nothing."""
        noise = math.hypot(self.noise.white, self.noise.band, self.digitiser.step / math.sqrt(12))
        details: dict[str, Any] = {"delay": self.lag, "noise": noise or None}
        if self.mount:
            details |= {"mount": (self.mount.frequency, self.mount.damping), "inertia": self.mount.mass}
        return details | ({"discharge": self.discharge} if math.isfinite(self.discharge) else {})

    def having(self, **changes: Any) -> Sensor:
        """The same sensor with other values; a name is looked for in the sensor, its mount, noise and digitiser.

        Parameters
        ----------
        **changes
            New values by name (``gain=1.01, white=0``).

        Returns
        -------
        Sensor
        """
        parts: dict[str, Any] = {"mount": self.mount, "noise": self.noise, "digitiser": self.digitiser}
        own = {f.name for f in fields(self)}
        for name, value in changes.items():
            if name in own:
                parts[name] = value
                continue
            owners = [part for part, thing in parts.items() if _has(thing, name)]
            if not owners and name in {f.name for f in fields(Mount)}:
                raise ModelError(
                    f"the sensor for {self.channel} stands on no mount whose '{name}' could be changed",
                    "a mount has a frequency and a damping",
                    f'state one first: having("{self.channel}", mount=Mount(125, 0.1)), or take another preset',
                )
            if not owners:
                raise ModelError(f"a sensor has no '{name}'", f"it has {', '.join(sorted(own))}", "correct the name")
            parts[owners[0]] = replace(parts[owners[0]], **{name: value})
        return replace(self, **parts)


def _has(thing: Any, name: str) -> bool:
    return thing is not None and hasattr(thing, "__dataclass_fields__") and name in thing.__dataclass_fields__


def _air_track() -> tuple[Sensor, ...]:
    """Section 2.2: two LVDTs, late by 1.26 ms; an accelerometer; a load cell."""
    lvdt = Sensor("x", lag=0.0389 / 30.91, noise=Noise(1e-6), digitiser=Digitiser(step=2.5e-6, limit=12.7e-3))
    return (
        lvdt,
        replace(lvdt, channel="z"),
        Sensor(
            "a",
            mount=Mount(125.0, 0.1),
            noise=Noise(0.04),
            digitiser=Digitiser(limit=5 * GRAVITY),
            sensitivity="1 V/g",
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
    ...     mass=2.42, stiffness=2310, law=ss.CompliantContact(1.1, stiffness=192000, damping=23.9),
    ...     drive=ss.HarmonicBase(0.65e-3, frequency=2.5),
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
        begin = start + self.offset
        count = math.floor((run.duration - begin) * fs * (1 + self.rate) * (1 + 1e-12)) + 1
        if not 0 <= begin < run.duration or count < 2:
            raise ModelError(
                f"a record from {begin:g} s on", f"the run lasts from 0 to {run.duration:g} s", "start within it"
            )
        chance = np.random.default_rng(rng)
        times = begin + np.arange(count) / (fs * (1 + self.rate))
        signals = _signals(run)
        samples: dict[str, Array] = {}
        channels: dict[str, Channel] = {}
        for sensor in self.sensors:
            own = np.random.default_rng(chance.integers(2**63))  # a sensor's noise does not hang on the others
            if sensor.source not in signals:
                continue
            samples[sensor.channel] = _read(sensor, signals, run.starts, times, own)
            unit = signals[sensor.source].unit
            words = described(sensor.channel, unit)
            channels[sensor.channel] = Channel(sensor.channel, unit, words, "Rig", sensor.sensitivity)
        if not samples:
            raise ModelError(
                f"sensors of {', '.join(s.source for s in self.sensors)}",
                f"the run has {', '.join(signals)}",
                "choose sensors of these",
            )
        settings = {"rig": repr(self), "fs": fs, "rng": rng if isinstance(rng, int) else None, "start": start}
        history = (
            Step("simulate", {"system": repr(run.system)}, f"{len(run.modes)} pieces, {run.status}"),
            Step("Rig.measure", settings, f"{count} samples of {', '.join(samples)}"),
        )
        return Record(samples, channels, float(fs), 0.0, history, None, _truth(run, begin, float(times[-1])))


@dataclass(frozen=True)
class _Signal:
    """One thing a sensor may sit on: its values at increasing instants, and its unit."""

    values: Callable[[Array], Array]
    unit: str


def _signals(run: Trajectory) -> dict[str, _Signal]:
    """Everything of a run that a sensor may sit on, by name."""
    units = {"x": "m", "v": "m/s", "a": "m/s^2", "friction": "N", "z": "m", "force": "N"}
    moved = {"z": bool(run.table.motion.base), "force": bool(run.table.motion.force)}
    return {
        label: _Signal(_picked(run, name, j), unit)
        for name, unit in units.items()
        if moved.get(name, True)
        for j, label in enumerate(run.labels(name))
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
        mass = sensor.mount.mass if sensor.mount else 0.0
        return values + mass * signals["a"].values(at) if mass else values

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
        truth |= {said: getattr(law, name) for name, said in names.items() if getattr(law, name, None) is not None}
        if frequency := getattr(system.drive, "frequency", None):
            truth["forcing frequency"] = frequency
    kinds = np.array([mode.kind for mode in run.table.modes])[run.modes]
    first = np.clip(run.starts, begin, end)
    last = np.clip(run.starts + run.durations, begin, end)
    stuck = np.isin(kinds, ("stick", "microstick"))
    truth["stuck share of the time"] = float(np.sum((last - first)[stuck]) / (end - begin))
    truth["events"] = [[event.time - begin, event.kind] for event in run.events if begin <= event.time <= end]
    return truth
