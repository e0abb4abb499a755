"""Sensors that lie: lag, resonance, discharge, noise, digitiser."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Mask
from stickslip.errors import ModelError
from stickslip.parameters import finite
from stickslip.signals.response import Response, leak, resonance

SENSED = {"load": "friction"}  # what a channel's sensor sits on, where the run calls it otherwise


@dataclass(frozen=True)
class Mount:
    r"""What a sensor stands on: :math:`H = w^2/(s^2 + 2\zeta w s + w^2)` between the motion or force and its reading.

    Attributes
    ----------
    frequency : float
        Resonance w / 2 pi [Hz]; infinite where it is rigid, or where the system that moves has this motion itself.
    damping : float
        Damping ratio zeta.
    mass : float
        Of a load cell's mount: mass [kg] between contact and cell, whose inertia the cell measures too: f + mass a.
    on : str
        The acceleration of this mass among the run's: "a", or of a structure "a2" ...

    Raises
    ------
    ModelError
        A value has no meaning.

    Examples
    --------
    >>> Mount(frequency=125, damping=0.1)
    Mount(frequency=125, damping=0.1, mass=0.0, on='a')
    """

    frequency: float
    damping: float
    mass: float = 0.0
    on: str = "a"

    def __post_init__(self) -> None:
        if self.frequency != math.inf:
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
        for name in ("white", "corner", "band", "low"):
            finite(name, getattr(self, name), unit="Hz" if name in ("corner", "low") else "(channel's unit)")
        if not self.low < self.high:
            raise ModelError(
                f"a band from {self.low} to {self.high} Hz", "a band has a low and a high edge", "swap them"
            )

    @property
    def level(self) -> float:
        """Standard deviation of a sample, that of 1/f noise left out [unit of the channel]."""
        return math.hypot(self.white, self.band)

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


@dataclass(frozen=True, eq=False)
class MeasuredNoise(Noise):
    """Gaussian noise of any colour, by its measured spectrum.

    Attributes
    ----------
    density : ndarray, shape (m,)
        One-sided spectral density, that of the white part in it [square of the channel's unit / Hz], at `m` evenly
        spaced frequencies.
    spacing : float
        Of those frequencies [Hz], from one spacing on.

    Examples
    --------
    >>> flat = MeasuredNoise(density=np.full(500, 2 * 3.0**2 / 1000), spacing=1.0)
    >>> bool(abs(np.std(flat.samples(10_000, fs=1000, rng=np.random.default_rng(1))) - 3) < 0.1)
    True
    """

    density: Array = field(default_factory=lambda: np.zeros(1))
    spacing: float = 1.0

    @property
    def level(self) -> float:
        """Standard deviation of a sample [unit of the channel]."""
        return math.sqrt(self.spacing * float(np.sum(self.density)))

    def at(self, frequency: ArrayLike) -> Array:
        """Spectral density at frequencies [Hz]."""
        own = self.spacing * np.arange(1, len(self.density) + 1)
        return np.asarray(np.interp(np.asarray(frequency, dtype=float), own, self.density))

    def samples(self, count: int, *, fs: float, rng: np.random.Generator) -> Array:
        """Samples of the noise, as :meth:`Noise.samples`."""
        frequency = np.fft.rfftfreq(count, 1 / fs)
        gain = np.sqrt(fs / 2 * self.at(frequency))
        gain[0] = 0.0
        return _shaped(rng.standard_normal(count), gain)


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

    def lost(self, count: int, *, fs: float, rng: np.random.Generator) -> Mask:
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
        mount = Response()
        if self.mount and math.isfinite(self.mount.frequency):
            mount = resonance(self.mount.frequency, self.mount.damping)
        return mount.then(leak(self.discharge)) if math.isfinite(self.discharge) else mount

    @property
    def certificate(self) -> dict[str, Any]:
        """What a calibration would say of it, as :meth:`Record.with_details` takes it; of its gain it knows nothing."""
        noise = math.hypot(self.noise.level, self.digitiser.step / math.sqrt(12))
        details: dict[str, Any] = {"delay": self.lag, "noise": noise or None}
        if self.mount:
            swings = math.isfinite(self.mount.frequency)
            details |= {"mount": (self.mount.frequency, self.mount.damping)} if swings else {}
            details["inertia"] = self.mount.mass
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
            owners = [part for part, thing in parts.items() if name in getattr(thing, "__dataclass_fields__", ())]
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
