"""Sound: how loud a vibrating surface is at a distance, levels, how it is heard, and what a squeaking rig records."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.compiled import OPTIONS, compiled
from stickslip.errors import FormatError, ModelError, RecordError, package
from stickslip.estimate import Plain, plain
from stickslip.oscillator import Structure
from stickslip.parameters import finite
from stickslip.record.channels import Channel, described
from stickslip.record.record import Record, Step
from stickslip.squeak.hearing import LOWEST, PULSE, chosen_channel, clipped_rows, filtered, short_time_level

if TYPE_CHECKING:
    from stickslip.solve.trajectory import Trajectory

AIR, SPEED_OF_SOUND = 1.204, 343.2  # kg/m^3 and m/s, dry air at 20 C and 101.325 kPa
REFERENCES = {"Pa": 20e-6, "m/s^2": 1e-6, "m/s": 1e-9, "N": 1e-6}  # ISO 1683
TIP = 2e-3  # m^2: chosen, the radiating area of the pinching beam's tip
MICROPHONE = 0.1  # m: chosen; the thesis's stood an inch away, nearer than a point source of this area allows
A_POLES = (20.598997, 107.65265, 737.86223, 12194.217)  # Hz, IEC 61672-1


def sound_pressure(
    run: Trajectory | Record,
    *,
    fs: float | None = None,
    area: float = TIP,
    distance: float = MICROPHONE,
    normal: ArrayLike | str | None = None,
    baffled: bool = False,
) -> Record:
    r"""How loud is a vibrating surface at a distance?

    A small surface in a free field is a point source (Morse and Ingard, "Theoretical Acoustics", 1968, section 7.1):

    .. math:: p(t) = \frac{\rho\,S\,a_n(t - r/c)}{4\pi r}

    with S its area, a_n its acceleration towards the outside, r the distance, and air of 20 C: 1.204 kg/m^3, 343.2 m/s.
    Nothing is heard before the first wave arrives. A flat disk in a wall is exact on its axis at any distance, near too
    (Stepanishen, J. Acoust. Soc. Am. 49, 1971): what its middle and its edge send,

    .. math:: p(t) = \rho c\,[v_n(t - r/c) - v_n(t - R/c)], \quad R = \sqrt{r^2 + S/\pi}

    which far away is twice the point source, as the wall gives half of the sound back.

    Parameters
    ----------
    run : Trajectory or Record
        What vibrates; a Trajectory is sampled when the sound left it, a Record is delayed by its spectrum.
    fs : float, optional
        Sampling rate of the sound [Hz]; of a Trajectory alone, and needed there.
    area : float
        S [m^2].
    distance : float
        r [m].
    normal : array_like or str, optional
        Of a Trajectory: the share of each degree of freedom in a_n; the second alone of a structure where left out. Of
        a Record: the channel, "normal_acceleration" or "a" where left out.
    baffled : bool
        Whether it is a flat disk in a wall, and not a small surface in a free field.

    Returns
    -------
    Record
        With "sound" [Pa]: alone, or beside the channels of the Record given.

    Raises
    ------
    ModelError
        An area, distance or direction without meaning, or a surface so near or so large that it is no point.
    RecordError
        No rate for a Trajectory, or a Record without the acceleration.

    Examples
    --------
    A surface of 10 cm^2 that shakes with 100 m/s^2 (amplitude), heard one metre away:

    >>> t = np.arange(2000) / 8000
    >>> shaken = Record.of({"a": 100 * np.sin(2 * np.pi * 400 * t)}, fs=8000)
    >>> heard = sound_pressure(shaken, area=1e-3, distance=1.0)
    >>> round(float(np.sqrt(2) * np.std(heard["sound"][400:1600])), 5), round(1.204 * 1e-3 * 100 / (4 * np.pi), 5)
    (0.00958, 0.00958)
    """
    finite("area", area, unit="m^2", positive=True)
    finite("distance", distance, unit="m", positive=True)
    if distance < math.sqrt(area / math.pi) and not baffled:
        raise ModelError(
            f"distance = {distance:g} m from a surface of {area:g} m^2",
            "a point source is heard from farther away than its radius",
            "give a larger distance= or a smaller area=, or ask for a disk in a wall: baffled=True",
        )
    paths = _disk(area, distance) if baffled else [(AIR * area / (4 * math.pi * distance), distance / SPEED_OF_SOUND)]
    lag, arguments = paths[0][1], {"area": area, "distance": distance, "baffled": baffled}
    step = Step("sound_pressure", arguments, f"{lag * 1e3:.3g} ms later")
    if isinstance(run, Record):
        name = normal if isinstance(normal, str) else "normal_acceleration" if "normal_acceleration" in run else "a"
        run.require_clean(name, question="the sound of a surface")
        sent = _velocity(run[name], run.fs) if baffled else run[name]
        heard = sum((gain * _later(sent, lag * run.fs) for gain, lag in paths), np.zeros(len(run)))
        return run.with_channel("sound", heard, unit="Pa", source=name, step=step)
    if fs is None or not (math.isfinite(fs) and fs > 0):
        raise RecordError(f"fs = {fs}", "the sound of a simulated run is sampled at a positive rate", "give fs= in Hz")
    times = np.arange(int(np.floor(run.duration * fs * (1 + 1e-12))) + 1) / fs
    share, signal = _share(run, normal), "v" if baffled else "a"
    heard = sum((gain * _leaving(run, times - lag, share, signal) for gain, lag in paths), np.zeros(len(times)))
    samples = {"sound": heard}
    channels = {"sound": Channel("sound", "Pa", described("sound", "Pa"), source="sound_pressure")}
    return Record(samples, channels, float(fs), 0.0, (step,), None, {"system": repr(run.system)})


def squeak_record(
    run: Trajectory,
    *,
    fs: float = 10_000.0,
    snr: float = math.inf,
    rng: int | np.random.Generator | None = None,
    area: float = TIP,
    distance: float = MICROPHONE,
    baffled: bool = False,
) -> Record:
    """What the sensors of a squeak rig would have written of a run of :func:`squeak_rig`.

    The channels of the thesis's section 7.2 (2): displacement, velocity and acceleration of the mass, the base,
    friction, normal acceleration and angular velocity of the beam's tip, and the sound.

    Parameters
    ----------
    run : Trajectory
        Of a Structure of three degrees of freedom: tangential, normal, rotational.
    fs : float
        Sampling rate [Hz].
    snr : float
        Signal to noise [dB]: each channel's RMS about its mean over that of its white noise; none where infinite.
    rng : int or Generator, optional
        Where the noise comes from.
    area, distance, baffled : float, bool
        As in :func:`sound_pressure`.

    Returns
    -------
    Record
        Channels x, v, a, z, friction, normal_acceleration, torsion_velocity, sound.

    Raises
    ------
    ModelError
        A run of something else, or as in :func:`sound_pressure`.

    Examples
    --------
    >>> from stickslip.solve.simulate import simulate
    >>> from stickslip.squeak.stability import squeak_rig
    >>> record = squeak_record(simulate(squeak_rig(), duration=0.4), snr=30, rng=1)
    >>> list(record)
    ['x', 'v', 'a', 'z', 'friction', 'normal_acceleration', 'torsion_velocity', 'sound']
    """
    if not isinstance(run.system, Structure) or run.system.size != 3 or not run.table.motion.base:
        raise ModelError(
            f"a run of {type(run.system).__name__}",
            "the rig's record is of a tangential, a normal and a rotational motion on a moving base",
            "simulate squeak_rig()",
        )
    if math.isnan(snr):
        raise ModelError("snr = nan", "a signal-to-noise ratio is a number of decibel", "give snr= in dB")
    heard = sound_pressure(run, fs=fs, area=area, distance=distance, baffled=baffled)
    times = np.minimum(heard.time, run.duration)
    motion, _ = run.sample(times, ("x", "v", "a", "friction", "z"))
    rows = {
        "x": (motion[0], "m"), "v": (motion[3], "m/s"), "a": (motion[6], "m/s^2"), "z": (motion[-1], "m"),
        "friction": (motion[9:-1].sum(axis=0), "N"), "normal_acceleration": (motion[7], "m/s^2"),
        "torsion_velocity": (motion[5], "rad/s"), "sound": (heard["sound"], "Pa"),
    }  # fmt: skip
    generator = np.random.default_rng(rng)
    samples, channels = {}, {}
    for name, (values, unit) in rows.items():
        noise = float(np.std(values)) * 10 ** (-snr / 20)
        samples[name] = values + noise * generator.standard_normal(len(values))
        channels[name] = Channel(name, unit, described(name, unit), "squeak_record", noise=noise)
    step = Step("squeak_record", {"fs": fs, "snr": str(snr), "area": area, "distance": distance}, "virtual sensors")
    return Record(samples, channels, float(fs), 0.0, (step,), None, {"system": repr(run.system)})


def a_weighting(frequency: ArrayLike) -> Array:
    """The A-weighting of IEC 61672-1 as a factor of the amplitude; 1 at 1 kHz."""

    def weight(f: Array) -> Array:
        first, second, third, fourth = (pole * pole for pole in A_POLES)
        square = f * f
        root = np.sqrt((square + second) * (square + third))
        return np.asarray(fourth * square**2 / ((square + first) * root * (square + fourth)))

    return weight(np.asarray(frequency, dtype=float)) / weight(np.asarray(1000.0))


def level(values: Array, reference: float, *, fs: float, weighted: bool = False) -> float:
    """RMS in dB re `reference`; A-weighted if asked."""
    power = float(np.mean(values**2))
    if weighted:
        spectrum = np.abs(np.fft.rfft(values)) ** 2
        gain = a_weighting(np.fft.rfftfreq(len(values), 1 / fs)) ** 2
        power *= float(gain @ spectrum / max(spectrum.sum(), np.finfo(float).tiny))
    return 10 * math.log10(max(power, np.finfo(float).tiny) / reference**2)


def reference_of(unit: str) -> str:
    """What a level of this unit is told against."""
    named = {"Pa": "20 µPa", "m/s^2": "1 µm/s^2", "m/s": "1 nm/s", "N": "1 µN", "1": "1"}
    return named.get(unit, f"1 {unit}")


def _share(run: Trajectory, normal: ArrayLike | str | None) -> Array:
    size = run.rows("a").shape[1]
    share = np.zeros(size)
    share[min(1, size - 1)] = 1.0
    given = share if normal is None or isinstance(normal, str) else np.asarray(normal, dtype=float)
    if given.shape != (size,) or not np.all(np.isfinite(given)) or isinstance(normal, str):
        raise ModelError(f"normal = {normal!r}", f"it has {size} finite numbers", "correct normal=")
    return given


def _disk(area: float, distance: float) -> list[tuple[float, float]]:
    """What a disk's middle and edge send: pressure over velocity [Pa s/m], and how late [s]."""
    edge = math.hypot(distance, math.sqrt(area / math.pi))
    resistance = AIR * SPEED_OF_SOUND
    return [(resistance, distance / SPEED_OF_SOUND), (-resistance, edge / SPEED_OF_SOUND)]


def _velocity(acceleration: Array, fs: float) -> Array:
    """Its integral without mean, by the trapezoidal rule."""
    steps = (acceleration[1:] + acceleration[:-1]) / (2 * fs)
    summed = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(summed - np.mean(summed))


def _leaving(run: Trajectory, times: Array, share: Array, signal: str) -> Array:
    """Normal acceleration or velocity at instants, 0 before the run begins."""
    begun = times >= 0
    values = np.zeros(len(times))
    values[begun] = share @ run.sample(np.minimum(times[begun], run.duration), (signal,))[0]
    return values


def _later(values: Array, samples: float) -> Array:
    """`values` delayed by a number of samples that need not be whole; zero before."""
    whole, part = divmod(samples, 1.0)
    padded = np.concatenate([values, np.zeros(len(values))])
    spectrum = np.fft.rfft(padded) * np.exp(-2j * np.pi * part * np.fft.rfftfreq(len(padded)))
    shifted = np.fft.irfft(spectrum, len(padded))
    return np.concatenate([np.zeros(int(whole)), shifted])[: len(values)]


NEEDED = 48_000  # Hz, of the methods
ROUGH = 0.2  # s, of a roughness's window
SHORTEST = 0.05  # s, of which a loudness over time can be told
EXCEEDED = 5.0  # % of the time: N5
ABOVE = 10.0  # dB over the valleys beside it that a pulse rises
RESOLVED = 20  # samples in a window, below which noise has pulses
DEAF = 1e-2  # sone: quieter has no sharpness
# Of MoSQITo's models, which it keeps in its functions:
DECAY_RATE, STEPS, TOLD = 2000, 24, 4  # Hz of the loudness, its steps in each sample, and samples for one that is told
SHORT, LONG, VAR = 0.005, 0.015, 0.075  # s, of ISO 532-1's decay after short and long sounds
CHANNELS, LOWER, UPPER, SILENT = 47, -27.0, -24.0, 2e-12  # half a bark apart; dB a bark of an excitation's slopes; Pa


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
    package("mosqito", extra="sound", rule="it computes loudness, sharpness and roughness", error=FormatError)
    from mosqito.sq_metrics import sharpness_din_from_loudness

    sound = _at_needed_rate(record[channel] - record[channel].mean(), record.fs)
    total, specific, time = _loudness(sound)
    sharp = np.asarray(sharpness_din_from_loudness(total, specific))
    heard = total > DEAF
    rough = _roughness(sound) if len(sound) >= ROUGH * NEEDED + 1 else [math.nan]
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


def _loudness(sound: Array) -> tuple[Array, Array, Array]:
    """Loudness [sone], that of each tenth of a bark, and time [s], as MoSQITo's `loudness_zwtv` by its own stages.

    The decay alone is compiled: MoSQITo steps through it with arrays, which takes three times as long as the sound.
    """
    from mosqito.sq_metrics.loudness.loudness_zwst._calc_slopes import _calc_slopes
    from mosqito.sq_metrics.loudness.loudness_zwst._main_loudness import _main_loudness
    from mosqito.sq_metrics.loudness.loudness_zwtv._temporal_weighting import _temporal_weighting
    from mosqito.sq_metrics.loudness.loudness_zwtv._third_octave_levels import _third_octave_levels

    levels, time, _ = _third_octave_levels(sound, NEEDED)
    core = np.ascontiguousarray(_main_loudness(levels, "free"))
    remains = np.empty_like(core)
    _decaying(core, _decay(1 / (DECAY_RATE * STEPS)), remains)
    total, specific = _calc_slopes(remains)
    return _temporal_weighting(total)[::TOLD], specific[:, ::TOLD], time[::TOLD]


def _decay(step: float) -> Array:
    """Of two capacitors that discharge into each other: their matrix over a step [s], and what each alone keeps."""
    middle, distance = (VAR + LONG) / (2 * VAR * SHORT), 1 / (SHORT * VAR)
    rates = [-middle + side * math.sqrt(middle**2 - distance) for side in (1, -1)]
    (one, other), (grown, faded) = (VAR * rate + 1 for rate in rates), (math.exp(rate * step) for rate in rates)
    matrix = [grown - faded, other * grown - one * faded, one * grown - other * faded, one * other * (grown - faded)]
    kept = [math.exp(-step / LONG), math.exp(-step / VAR)]
    return np.array([entry / (VAR * (rates[0] - rates[1])) for entry in matrix] + kept)


@compiled(**OPTIONS)
def _decaying(core: Array, decay: Array, remains: Array) -> None:
    """What remains of each band's core loudness: it rises at once, and falls fast after what was short."""
    for band in range(core.shape[0]):
        count = core.shape[1]
        heard, stored = core[band, count - 1] / STEPS, 0.0  # before the first step MoSQITo has what the last one left
        for row in range(count):
            driven = core[band, row]
            rise = ((core[band, row + 1] if row + 1 < count else 0.0) - driven) / STEPS
            for step in range(STEPS):
                # the first capacitor discharges into the second, or both together; never below what drives it
                falls = heard * decay[2] - stored * decay[3] if heard > stored else heard * decay[4]
                now = max(falls, driven)
                # the second one follows the first, from below, and drives it where the sound has ended
                follows = now
                if driven < heard:
                    if heard > stored:
                        follows = min(now, heard * decay[0] - stored * decay[1])
                elif not (abs(driven - heard) < 1e-5 and now <= stored):
                    follows = (stored - driven) * decay[5] + driven
                heard, stored = now, follows
                if step == 0:
                    remains[band, row] = now
                driven += rise


def _roughness(sound: Array) -> Array:
    """Roughness [asper] of windows of 0.2 s, each half over the next, as MoSQITo's `roughness_dw`.

    All channels of a window at once, and their envelopes' power and agreement by their spectra: MoSQITo goes through
    every line of every channel by itself, which takes five times as long as the sound.
    """
    from mosqito.sq_metrics.roughness.roughness_dw._ear_filter_coeff import _ear_filter_coeff
    from mosqito.sq_metrics.roughness.roughness_dw._gzi_weighting import _gzi_weighting
    from mosqito.sq_metrics.roughness.roughness_dw._H_weighting import _H_weighting
    from mosqito.utils import bark2freq, db2amp, freq2bark
    from mosqito.utils.LTQ import LTQ
    from scipy.fft import irfft, rfft

    size = round(ROUGH * NEEDED)
    half, channel = size // 2, np.arange(CHANNELS)
    window = 1.42 * np.blackman(size) / np.blackman(size).sum()
    frequency = np.arange(1, half + 1) * (NEEDED / size)
    bark = freq2bark(frequency)
    ear, quiet = db2amp(_ear_filter_coeff(bark)), LTQ(bark, reference="roughness")
    least = np.interp(bark2freq((channel + 1) / 2), frequency, quiet)
    envelope, depths = _H_weighting(size, NEEDED)[:, :half], _gzi_weighting((channel + 1) / 2)
    below, above = np.minimum(channel + 1, CHANNELS - 1), np.maximum(channel - 1, 0)
    rough = []
    for begin in range(0, len(sound) - size + 1, half):
        spectrum = rfft(window * sound[begin : begin + size])[:half] * ear
        level = 20 * np.log10(np.maximum(np.abs(spectrum), SILENT) / REFERENCES["Pa"])
        heard = np.flatnonzero(level > quiet)
        at, loud = bark[heard, None], level[heard, None]
        # what a line excites in the channel next to each, on its own side: down by the slopes of Terhardt's triangle
        low, high = np.floor(2 * at) - 1, np.ceil(2 * at) - 1
        upper = np.minimum(UPPER - 230 / frequency[heard, None] + 0.2 * loud, 0.0)
        down = np.where(channel < low, LOWER * (at - (below + 1) / 2), upper * ((above + 1) / 2 - at))
        excites = loud + down > np.where(channel < low, least[below], least[above])
        share = np.where((channel == low) | (channel == high), 1.0, np.where(excites, 10 ** (down / 20), 0.0))
        lines = np.zeros((CHANNELS, half + 1), dtype=complex)
        lines[:, heard] = share.T * spectrum[heard]
        lines[:, 1:] /= 2
        # how deep each channel's excitation is modulated, at the rates that sound rough
        excitation = np.abs(size * irfft(lines, size))
        mean = excitation.mean(axis=1)
        swing = rfft(excitation - mean[:, None])[:, :half] * envelope
        power = np.sum(np.abs(swing) ** 2, axis=1)
        depth = np.minimum(np.sqrt(2 * power) / (size * np.maximum(mean, np.finfo(float).tiny)), 1.0)
        # channels a bark apart are rough together as far as their modulations agree
        shared = np.sum(swing[:-2] * np.conj(swing[2:]), axis=1).real
        alike = shared / np.sqrt(np.maximum(power[:-2] * power[2:], np.finfo(float).tiny))
        both = np.concatenate([alike, [1.0, 1.0]]) * np.concatenate([[1.0, 1.0], alike])
        rough.append(0.25 * np.sum(depths * (depth * both) ** 2))
    return np.array(rough)
