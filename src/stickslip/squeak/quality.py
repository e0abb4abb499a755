"""How a sound is heard: loudness, sharpness and roughness by MoSQITo; and how much it is made of pulses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from types import ModuleType
from typing import Any, cast

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import FormatError, RecordError, package
from stickslip.estimate import Plain, plain
from stickslip.record.record import Record
from stickslip.squeak.bursts import LOWEST
from stickslip.squeak.hearing import PULSE, chosen_channel, clipped_rows, filtered, short_time_level

NEEDED = 48_000  # Hz, of the methods
ROUGH = 0.2  # s, of a roughness's window
SHORTEST = 0.05  # s, of which a loudness over time can be told
EXCEEDED = 5.0  # % of the time: N5
ABOVE = 10.0  # dB over the valleys beside it that a pulse rises
RESOLVED = 20  # samples in a window, below which noise has pulses
DEAF = 1e-2  # sone: quieter has no sharpness


@dataclass(frozen=True, eq=False)
class SoundQuality:
    """How loud, sharp and rough a sound is heard, as models of hearing say; no claim of conformity is made.

    Attributes
    ----------
    loudness : float
        N5 [sone]: the loudness over time (Zwicker's method of ISO 532-1 for sounds that change, free field) that is
        exceeded 5 % of the time. 1 sone is a tone of 1 kHz at 40 dB.
    loudest : float
        The largest loudness [sone].
    sharpness : float
        Of the mean specific loudness, with the weighting of DIN 45692 [acum]; NaN of what is hardly heard.
    roughness : float
        Daniel and Weber's [asper], the mean of windows of 0.2 s; NaN of a shorter sound.
    time, loudness_over_time : ndarray, shape (n,)
        Time [s] and loudness [sone].
    duration : float
        Length of the sound [s].
    method : str
        By which program, and from which band.
    """

    loudness: float
    loudest: float
    sharpness: float
    roughness: float
    time: Array
    loudness_over_time: Array
    duration: float
    method: str

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, without the curve over time."""
        names = ("loudness", "loudest", "sharpness", "roughness", "duration", "method")
        return dict(plain({name: getattr(self, name) for name in names}))


@dataclass(frozen=True, eq=False)
class Impulsiveness(Plain):
    """How much a sound or a vibration is made of pulses. These are no standardised metrics.

    Attributes
    ----------
    crest_factor : float
        Largest magnitude over the RMS about the mean; 1.41 of a sine.
    kurtosis : float
        Fourth moment over the square of the second; 3 of normal noise, 1.5 of a sine, large of pulses.
    rate : float
        Pulses in a second [1/s]: maxima of the level of what lies above 50 Hz, in windows of 2 ms, that rise over the
        level of the whole, stand 10 dB above the valleys beside them, and are 2 ms apart. NaN below 10 kHz: there such
        a window holds too few samples, and noise has pulses.
    pulses : ndarray, shape (p,)
        When they come [s].
    channel : str
        Where they were heard.
    """

    crest_factor: float
    kurtosis: float
    rate: float
    pulses: Array
    channel: str


def sound_quality(record: Record, *, channel: str = "sound") -> SoundQuality:
    r"""How loud, sharp and rough is a calibrated sound heard?

    By MoSQITo (Apache 2.0, the extra ``sound``): the loudness over time of Zwicker's method (ISO 532-1:2017, method for
    sounds that change, free field), of which N5 is told; the sharpness

    .. math:: S = 0.11\,\frac{\int N'(z)\,g(z)\,z\,dz}{\int N'(z)\,dz}

    of the mean specific loudness N' with the weighting g of DIN 45692; and the roughness of Daniel and Weber (Acustica
    83, 1997). The sound is brought to 48 kHz first; what lies above half of the record's rate is not in it.

    Parameters
    ----------
    record : Record
        With a sound in Pa, 0.05 s long at least.
    channel : str
        Which channel.

    Returns
    -------
    SoundQuality

    Raises
    ------
    FormatError
        MoSQITo is not installed.
    RecordError
        The channel is missing, broken, clipped, too short, or not in Pa.

    Examples
    --------
    A tone of 1 kHz at 60 dB has 4 sone:

    >>> import importlib.util
    >>> t = np.arange(24_000) / 48_000
    >>> record = Record.of({"sound": np.sqrt(2) * 0.02 * np.sin(2 * np.pi * 1000 * t)}, fs=48_000)
    >>> told = round(sound_quality(record).loudness) if importlib.util.find_spec("mosqito") else 4
    >>> told
    4
    """
    record.require_clean(channel, question="the loudness of a sound")
    unit = record.channels[channel].unit
    if unit != "Pa":
        raise RecordError(
            f"channel {channel} is in {'units of full scale' if unit == '1' else unit}",
            "loudness, sharpness and roughness are those of a sound pressure in Pa",
            'state its sensitivity when reading, as in channels={"sound": "sound * 2.5 [Pa]"}',
        )
    _require_peaks(record, channel)
    if record.duration < SHORTEST:
        raise RecordError(
            f"a sound of {record.duration:.3g} s",
            f"its loudness is told from {SHORTEST:g} s on",
            "give a longer record",
        )
    metrics = _mosqito()
    sound = _at_needed_rate(record[channel] - record[channel].mean(), record.fs)
    total, specific, _, time = metrics.loudness_zwtv(sound, NEEDED)
    sharp = np.asarray(metrics.sharpness_din_from_loudness(total, specific))
    heard = total > DEAF
    rough = metrics.roughness_dw(sound, NEEDED)[0] if len(sound) >= ROUGH * NEEDED + 1 else [math.nan]
    return SoundQuality(
        loudness=float(np.percentile(total, 100 - EXCEEDED)),
        loudest=float(np.max(total)),
        sharpness=float(np.average(sharp[heard], weights=total[heard])) if heard.any() else math.nan,
        roughness=float(np.mean(rough)),
        time=record.start + np.asarray(time, dtype=float),
        loudness_over_time=np.asarray(total, dtype=float),
        duration=record.duration,
        method=f"MoSQITo, of what lies below {min(record.fs, NEEDED) / 2:g} Hz",
    )


def impulsiveness(record: Record, *, channel: str | None = None) -> Impulsiveness:
    """How much is a sound or a vibration made of pulses?

    Its crest factor, its kurtosis, and the pulses in a second, each as the result's attributes define it.

    Parameters
    ----------
    record : Record
        With a sound or a vibration.
    channel : str, optional
        Which; the first of sound, normal_acceleration, a, friction, ch1, or any other.

    Returns
    -------
    Impulsiveness

    Raises
    ------
    RecordError
        The channel is missing, broken, clipped, constant or too short.

    Examples
    --------
    >>> t = np.arange(10_000) / 10_000
    >>> peaks = impulsiveness(Record.of({"sound": np.sin(2 * np.pi * 500 * t)}, fs=10_000))
    >>> round(peaks.crest_factor, 2), round(peaks.kurtosis, 2), peaks.rate
    (1.41, 1.5, 0.0)
    """
    from scipy.signal import find_peaks

    name = chosen_channel(record, channel)
    record.require_clean(name, question="pulses", samples=64)
    _require_peaks(record, name)
    if np.ptp(record[name]) == 0:
        raise RecordError(f"channel {name} never changes", "pulses are told in what changes", "name another channel=")
    values = record[name] - record[name].mean()
    power = float(np.mean(values**2))
    resolved = PULSE * record.fs >= RESOLVED
    heard = filtered(values, record.fs, (LOWEST, 0.45 * record.fs)) if resolved else np.zeros(len(values))
    loud = 10 * math.log10(max(float(np.mean(heard**2)), np.finfo(float).tiny))
    apart = max(1, round(PULSE * record.fs))
    peaks, _ = find_peaks(short_time_level(heard, record.fs), prominence=ABOVE, height=loud, distance=apart)
    return Impulsiveness(
        crest_factor=float(np.max(np.abs(values)) / math.sqrt(power)),
        kurtosis=float(np.mean(values**4) / power**2),
        rate=len(peaks) / record.duration if resolved else math.nan,
        pulses=record.time[peaks],
        channel=name,
    )


def _require_peaks(record: Record, channel: str) -> None:
    if clipped_rows(record, channel):
        raise RecordError(
            f"channel {channel} is clipped",
            "loudness and pulses are told by what was cut off",
            "record it at a lower gain",
        )


def _at_needed_rate(values: Array, fs: float) -> Array:
    """The sound at the rate that the methods need."""
    from scipy.signal import resample_poly

    ratio = Fraction(NEEDED / fs).limit_denominator(1000)
    return values if ratio == 1 else np.asarray(resample_poly(values, ratio.numerator, ratio.denominator))


def _mosqito() -> ModuleType:
    package("mosqito", extra="sound", rule="it computes loudness, sharpness and roughness", error=FormatError)
    from mosqito import sq_metrics

    return cast(ModuleType, sq_metrics)
