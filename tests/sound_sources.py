"""Sounds whose truth is known, drawn without anything of the package: squeaks, and what is none.

A squeak is either the sound of a pad on a belt, whose friction falls with speed (a fixed-step integration; its load
comes and goes), or a burst of overtones in whole ratios that grows and fades exponentially and may glide. The rest is
what people, machines and instruments do near a rig.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FS = 22_050.0
LENGTH = 2.1  # s
OVERSAMPLED = 4


@dataclass(frozen=True)
class Sound:
    """Samples at a rate, and each squeak in it: begin, end [s] and frequency [Hz]."""

    kind: str
    values: Array
    fs: float
    snr: float
    squeaks: tuple[tuple[float, float, float], ...] = ()


def draw(kind: str, seed: int, *, snr: tuple[float, float] = (0.0, 30.0)) -> Sound:
    """A sound of a kind in noise; `snr` [dB] is the RMS while it sounds over that of the noise."""
    rng = np.random.default_rng([seed, sum(map(ord, kind))])
    values, squeaks = KINDS[kind](rng)
    ratio = float(rng.uniform(*snr))
    power = np.sort(values**2)[::-1].cumsum()
    sounding = power[-1] * 0.95 / max(1, np.searchsorted(power, 0.95 * power[-1]))
    noise = background(rng, len(values)) * math.sqrt(sounding) * 10 ** (-ratio / 20)
    return Sound(kind, (values + noise) * 10 ** rng.uniform(-2, 0), FS, ratio, squeaks)


def background(rng: np.random.Generator, count: int) -> Array:
    """Noise of a room: white, or falling with frequency; of RMS one."""
    spectrum = np.fft.rfft(rng.standard_normal(count))
    slope = rng.choice([0.0, 0.0, 0.25, 0.5])
    noise = np.fft.irfft(spectrum * np.maximum(np.fft.rfftfreq(count, 1 / FS), 50.0) ** -slope, count)
    return np.asarray(noise / noise.std())


def _time() -> Array:
    return np.arange(int(LENGTH * FS)) / FS


def _harmonics(phase: Array, strengths: Array) -> Array:
    return sum((a * np.sin(n * phase) for n, a in enumerate(strengths, start=1)), np.zeros(len(phase)))


def _places(rng: np.random.Generator, lengths: Array, pause: float) -> Array:
    """When things of these lengths [s] begin, with pauses between them."""
    free = LENGTH - 0.1 - float(np.sum(lengths)) - pause * len(lengths)
    shares = rng.dirichlet(np.ones(len(lengths) + 1))[:-1]
    return 0.05 + np.cumsum(shares * free + np.concatenate([[0.0], lengths[:-1] + pause]))


def squeaks(rng: np.random.Generator) -> tuple[Array, tuple[tuple[float, float, float], ...]]:
    """One to four squeaks of one contact: a pad on a belt, or bursts of overtones."""
    lengths = rng.uniform(0.08, 0.35, rng.integers(1, 5))
    base = float(np.exp(rng.uniform(math.log(600), math.log(5000))))
    pad = rng.random() < 0.3
    values, truth = np.zeros(len(_time())), []
    strengths = 10 ** (-rng.uniform([0, 4, 8, 12, 16], [0.01, 16, 24, 30, 40]) / 20)
    for begin, length in zip(_places(rng, lengths, 0.12), lengths, strict=True):
        burst, frequency, (first, last) = (
            _pad(rng, base, length) if pad else _glide(rng, base * rng.uniform(0.98, 1.02), length, strengths)
        )
        row = round(begin * FS)
        burst = burst[: len(values) - row]
        values[row : row + len(burst)] += burst * rng.uniform(0.5, 1.0)
        truth.append((begin + first, begin + last, frequency))
    return values, tuple(truth)


def _loud(envelope: Array) -> tuple[float, float]:
    """From when to when it is within twenty decibel of its peak [s]."""
    rows = np.flatnonzero(envelope > 0.1 * envelope.max())
    return rows[0] / FS, (rows[-1] + 1) / FS


def _glide(
    rng: np.random.Generator, base: float, length: float, strengths: Array
) -> tuple[Array, float, tuple[float, float]]:
    growth, fall = rng.uniform(10, 60, 2) / base  # s in which it grows or falls by e
    t = np.arange(int((length + 3 * (growth + fall)) * FS)) / FS
    envelope = 1 / (1 + np.exp(-(t - 3 * growth) / growth * 2) + np.exp((t - 3 * growth - length) / fall * 2))
    turns = rng.uniform(-0.04, 0.04) * rng.choice([0, 1]) * np.sin(math.pi * (t / t[-1]) ** rng.uniform(0.5, 2))
    phase = 2 * math.pi * np.cumsum(base * (1 + turns)) / FS
    audible = strengths * (base * np.arange(1, len(strengths) + 1) < 0.45 * FS)
    frequency = base * (1 + float(np.median(turns[envelope > 0.5 * envelope.max()])))
    return envelope * _harmonics(phase, audible), frequency, _loud(envelope)


def _pad(rng: np.random.Generator, base: float, length: float) -> tuple[Array, float, tuple[float, float]]:
    """Acceleration of a pad on a belt, m x'' + c x' + k x = mu(v - x') N(t), in units of its period and the speed."""
    zeta, fall = rng.uniform(0.002, 0.006), rng.uniform(0.5, 1.0)
    count = int((length + 0.06) * FS) * OVERSAMPLED
    step = 2 * math.pi * base / (FS * OVERSAMPLED)
    t = np.arange(count) / (FS * OVERSAMPLED)
    load = np.clip(np.minimum(t / 0.02, (length + 0.05 - t) / 0.02), 0, 1)
    excess = rng.uniform(0.02, 0.06) + 2 * zeta  # negative damping of the full load
    x, v, told = 0.0, 1e-3, np.zeros(count)

    def rate(x: float, v: float, n: float) -> float:
        slip = 1 - v
        mu = math.copysign(1 - math.exp(-((slip / 0.02) ** 2)), slip) * (0.4 + 0.6 * math.exp(-abs(slip) / fall))
        slope = 0.6 / fall * math.exp(-1 / fall)
        return -2 * zeta * v - x + excess / slope * n * (mu - 0.4)

    for i in range(count):
        first = rate(x, v, load[i])
        half = v + step / 2 * first
        second = rate(x + step / 2 * v, half, load[i])
        x, v = x + step * half, v + step * second
        told[i] = second
    tone = np.fft.rfft(told * np.hanning(count))
    grid = np.fft.rfftfreq(count, 1 / (FS * OVERSAMPLED))
    near = np.abs(grid / base - 1) < 0.2
    frequency = float(np.average(grid[near], weights=np.abs(tone[near]) ** 2))
    low = np.fft.rfft(told)
    low[grid > 0.48 * FS] = 0
    heard = np.fft.irfft(low, count)[::OVERSAMPLED]
    heard -= heard.mean()
    width = max(3, int(2 * FS / base))
    envelope = np.sqrt(np.convolve(heard**2, np.ones(width) / width, "same"))
    return heard / np.abs(heard).max(), frequency, _loud(envelope)


def beeps(rng: np.random.Generator) -> tuple[Array, tuple[()]]:
    """An electronic buzzer: one or two constant pitches, switched on and off within 3 ms at most."""
    t = _time()
    on, off = rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.5)
    since = np.mod(t - rng.uniform(0, on + off), on + off)
    ramp = rng.uniform(1e-4, 3e-3)
    envelope = np.clip(np.minimum(since / ramp, (on - since) / ramp), 0, 1)
    form = [[1.0], [1, 0, 1 / 3, 0, 1 / 5], [1, 0.5, 0.4, 0.3, 0.2], [1, 0.3, 0.1, 0.03]][rng.integers(4)]
    pitches = np.exp(rng.uniform(math.log(400), math.log(4500), rng.choice([1, 1, 2])))
    pitch = pitches[np.mod((t // (on + off)).astype(int), len(pitches))]
    strengths = np.array(form) * (np.max(pitches) * np.arange(1, len(form) + 1) < 0.48 * FS)
    return envelope * _harmonics(2 * math.pi * np.cumsum(pitch) / FS, strengths), ()


def beats(rng: np.random.Generator) -> tuple[Array, tuple[()]]:
    """Two partials a few hertz apart, or several such pairs: whistling machines, mistuned strings."""
    t = _time()
    apart = np.exp(rng.uniform(math.log(3), math.log(60)))
    low = np.exp(rng.uniform(math.log(200), math.log(4000)))
    orders = np.arange(1, rng.integers(2, 6))
    pairs = low * (orders if rng.random() < 0.5 else orders ** rng.uniform(1.02, 1.3))
    values = np.zeros(len(t))
    for order, frequency in zip(orders, pairs, strict=True):
        if frequency < 0.45 * FS:
            second = frequency + apart * (order if rng.random() < 0.5 else 1)
            one, other = np.sin(2 * math.pi * frequency * t), np.sin(2 * math.pi * second * t + rng.uniform(0, 6))
            values += (one + rng.uniform(0.6, 1.0) * other) / order ** rng.uniform(0.5, 2)
    if rng.random() < 0.5:
        values *= np.clip((t - 0.2) / 0.05, 0, 1)
    return values, ()


def fans(rng: np.random.Generator) -> tuple[Array, tuple[()]]:
    """Blade tone and overtones whose speed wanders a little, on broad noise; may start up meanwhile."""
    t = _time()
    blade = rng.uniform(60, 700)
    wander = np.cumsum(rng.standard_normal(len(t))) / math.sqrt(len(t))
    phase = 2 * math.pi * np.cumsum(blade * (1 + rng.uniform(0, 0.01) * wander)) / FS
    values = _harmonics(phase, 1 / np.arange(1, 9) ** rng.uniform(0.5, 2)) * rng.uniform(0.1, 3)
    values += background(rng, len(t)) * (1 + 0.3 * np.sin(phase / rng.integers(3, 9)))
    return values * (np.clip((t - 0.3) / 0.5, 0, 1) if rng.random() < 0.3 else 1.0), ()


def clicks(rng: np.random.Generator) -> tuple[Array, tuple[()]]:
    """Ticks, keys, relays: struck and ringing, at even or at uneven times."""
    t = _time()
    rate = np.exp(rng.uniform(math.log(2), math.log(40)))
    even = rng.random() < 0.6
    jitter = rng.uniform(0, 0.03) if even else 0.0
    count = int(1.9 * rate)
    times = 0.1 + (np.arange(count) + jitter * rng.standard_normal(count)) / rate
    if not even:
        times = np.sort(rng.uniform(0.05, 2.0, count))
    rings = np.exp(rng.uniform(math.log(800), math.log(7000), rng.integers(1, 4)))
    dies = np.exp(rng.uniform(math.log(5e-4), math.log(1e-2)))
    noisy = rng.random() < 0.4
    values = np.zeros(len(t))
    for begin in times:
        row = max(0, round(begin * FS))
        since = np.arange(min(int(8 * dies * FS) + 1, len(t) - row)) / FS
        ring = sum((np.sin(2 * math.pi * f * since) for f in rings), np.zeros(len(since)))
        click = rng.standard_normal(len(since)) if noisy else ring
        values[row : row + len(since)] += click * np.exp(-since / dies) * rng.uniform(0.6, 1)
    return values, ()


FORMANTS = ((730, 1090, 2440), (270, 2290, 3010), (300, 870, 2240), (530, 1840, 2480), (570, 840, 2410))  # Hz, Peterson
# and Barney 1952: a, i, u, e, o of men


def speech(rng: np.random.Generator) -> tuple[Array, tuple[()]]:
    """Vowels of a voice whose pitch glides, with hisses between them: pulses of the glottis through three formants."""
    from scipy.signal import butter, lfilter, sosfilt

    values = np.zeros(len(_time()))
    voice = float(np.exp(rng.uniform(math.log(80), math.log(420))))
    size = 1.0 + 0.35 * math.log(voice / 80) / math.log(420 / 80)
    at = 0.05
    while at < LENGTH - 0.4:
        length = rng.uniform(0.08, 0.35)
        t = np.arange(int(length * FS)) / FS
        pitch = voice * (1 + rng.uniform(-0.2, 0.2) * t / length + rng.uniform(0, 0.1) * np.sin(math.pi * t / length))
        knots = np.arange(0.0, length + 0.02, 0.01)
        pitch = pitch * (1 + 0.01 * np.interp(t, knots, rng.standard_normal(len(knots))))
        turns = np.cumsum(pitch) / FS
        part = np.diff(np.floor(turns), prepend=0.0)
        part = lfilter([1.0], [1.0, -0.96], part)  # falls by 12 dB an octave with what follows
        for formant in FORMANTS[rng.integers(len(FORMANTS))]:
            f, width = formant * size, 60 + 0.03 * formant
            r = math.exp(-math.pi * width / FS)
            part = lfilter([1 - r], [1.0, -2 * r * math.cos(2 * math.pi * f / FS), r * r], part)
        ramp = rng.uniform(0.01, 0.05)
        part *= np.clip(np.minimum(t / ramp, (length - t) / ramp), 0, 1)
        row = round(at * FS)
        values[row : row + len(part)] += part / max(np.abs(part).max(), 1e-12) * rng.uniform(0.4, 1)
        at += length
        if rng.random() < 0.4:
            hiss = rng.uniform(0.04, 0.12)
            above = butter(2, rng.uniform(2000, 5000), "highpass", fs=FS, output="sos")
            noise = sosfilt(above, rng.standard_normal(int(hiss * FS)))
            row = round(at * FS)
            values[row : row + len(noise)] += 0.2 * (noise * np.hanning(len(noise)))[: len(values) - row]
            at += hiss
        at += rng.uniform(0.0, 0.15)
    return values, ()


def music(rng: np.random.Generator) -> tuple[Array, tuple[()]]:
    """Notes from C2 to C7: struck or plucked ones that die away, blown or sung ones that last, some with vibrato."""
    values, at = np.zeros(len(_time())), 0.05
    lasts, vibrato = rng.random() < 0.6, rng.choice([0.0, 0.0, 0.005, 0.015])
    strengths = 1 / np.arange(1, 9) ** rng.uniform(0.7, 2.5) * rng.uniform(0.3, 1, 8)
    beat, attack = rng.uniform(0.12, 0.6), rng.uniform(0.002, 0.1)
    lowest = rng.integers(36, 84)
    while at < LENGTH - 0.1:
        pitch = 440 * 2 ** ((min(lowest + rng.integers(0, 13), 96) - 69) / 12)
        length = beat * rng.choice([1, 1, 2, 0.5])
        t = np.arange(min(int(length * FS), len(values) - round(at * FS))) / FS
        phase = 2 * math.pi * pitch * (t + vibrato * np.sin(2 * math.pi * 5.5 * t) / (2 * math.pi * 5.5))
        shape = np.clip(t / attack, 0, 1) * (
            np.clip((length - t) / 0.03, 0, 1) if lasts else np.exp(-t / rng.uniform(0.1, 0.6))
        )
        audible = strengths * (pitch * np.arange(1, 9) < 0.45 * FS)
        values[round(at * FS) :][: len(t)] += shape * _harmonics(phase, audible)
        at += length
    return values, ()


def hum(rng: np.random.Generator) -> tuple[Array, tuple[()]]:
    """Mains hum and buzz, throughout or switched on and off."""
    t = _time()
    mains = rng.choice([50.0, 60.0]) * (1 + rng.uniform(-0.002, 0.002))
    strengths = rng.uniform(0, 1, 20) / np.arange(1, 21) ** rng.uniform(0.3, 2)
    switched = (np.mod(t - rng.uniform(0, 1), 1.0) < rng.uniform(0.3, 0.8)) if rng.random() < 0.3 else 1.0
    return _harmonics(2 * math.pi * mains * t, strengths) * switched, ()


def creaks(rng: np.random.Generator) -> tuple[Array, tuple[()]]:
    """A hinge turned by hand: pulses of stick-slip through the modes of a door, at a rate that follows the hand."""
    t = _time()
    rate = np.exp(rng.uniform(math.log(8), math.log(35)))
    begin, end = rng.uniform(0.05, 0.4), rng.uniform(1.4, 2.0)
    hand = np.interp(t, np.linspace(0, LENGTH, 5), np.exp(rng.uniform(-0.6, 0.6, 5)))
    turns = np.cumsum(rate * hand) / FS
    values = np.zeros(len(t))
    modes = np.exp(rng.uniform(math.log(300), math.log(6000), 8))
    dies = rng.uniform(1e-3, 4e-3)
    for number in range(1, int(turns[-1])):
        row = int(np.searchsorted(turns, number * 1.0 + 0.04 * rng.standard_normal()))
        since = np.arange(min(int(8 * dies * FS), len(t) - row)) / FS
        pulse = rng.standard_normal(len(since))
        for mode in modes:
            pulse += rng.uniform(0.5, 1) * np.sin(2 * math.pi * mode * since + rng.uniform(0, 0.5))
        if begin < row / FS < end:
            values[row : row + len(since)] += pulse * np.exp(-since / dies) * rng.uniform(0.5, 1)
    return values, ()


RUBS = ("squeaks", "creaks")
KINDS: dict[str, Callable[[np.random.Generator], tuple[Array, tuple[tuple[float, float, float], ...]]]] = {
    "squeaks": squeaks,
    "creaks": creaks,
    "beeps": beeps,
    "beats": beats,
    "fans": fans,
    "clicks": clicks,
    "speech": speech,
    "music": music,
    "hum": hum,
}
