"""More sounds whose truth is known, drawn after the rules of hearing were set and by other means than `sound_sources`.

Each is heard in a room that answers (echoes that die away). The squeaks are of two modes that friction couples, after
Hoffmann and others 2002, whose contact lifts off; what is none are sounds that are near to them: whines of servo
drives, flutes and whistles, birds, crickets, kettles and sirens.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sound_sources import FS, LENGTH, Sound, background

Array = NDArray[np.float64]
Truth = tuple[tuple[float, float, float], ...]
Drawn = tuple[Array, Truth]
FINER = 4  # steps in a sample


def draw(kind: str, seed: int, *, snr: tuple[float, float] = (0.0, 30.0)) -> Sound:
    """A sound of a kind in a room with noise; `snr` [dB] is the RMS while it sounds over that of the noise."""
    rng = np.random.default_rng([seed, 77, *map(ord, kind)])
    dry, squeaks = KINDS[kind](rng)
    values = echoing(rng, dry)
    ratio = float(rng.uniform(*snr))
    power = np.sort(values**2)[::-1].cumsum()
    sounding = power[-1] * 0.95 / max(1, np.searchsorted(power, 0.95 * power[-1]))
    noise = background(rng, len(values)) * math.sqrt(sounding) * 10 ** (-ratio / 20)
    return Sound(kind, (values + noise) * 10 ** rng.uniform(-2, 0), FS, ratio, squeaks)


def echoing(rng: np.random.Generator, values: Array) -> Array:
    """With the echoes of a room: it comes back from all sides, and dies away in 0.1 to 0.6 s by 60 dB."""
    from scipy.signal import fftconvolve

    dies, share = rng.uniform(0.1, 0.6), rng.uniform(0.0, 0.5)
    t = np.arange(int(dies * FS)) / FS
    answer = rng.standard_normal(len(t)) * np.exp(-6.9 * t / dies)
    answer *= math.sqrt(share) / math.sqrt(float(np.sum(answer**2)))
    answer[0] += 1.0
    return np.asarray(fftconvolve(values, answer)[: len(values)])


def _time() -> Array:
    return np.arange(int(LENGTH * FS)) / FS


def _overtones(pitch: Array, shape: Array, strengths: Array) -> Array:
    """A tone of a pitch [Hz] that moves, with overtones where the rate takes them."""
    turns = 2 * math.pi * np.cumsum(pitch) / FS
    orders = enumerate(strengths, start=1)
    return shape * sum((a * np.sin(n * turns) * (n * pitch < 0.47 * FS) for n, a in orders), np.zeros(len(pitch)))


def couplings(rng: np.random.Generator) -> Drawn:
    """Squeaks of two modes that friction couples; the load comes and goes, and the pad lifts off at its largest."""
    base = float(np.exp(rng.uniform(math.log(600), math.log(5000))))
    values, truth, at = np.zeros(len(_time())), [], float(rng.uniform(0.05, 0.3))
    for _ in range(rng.integers(1, 5)):
        length = float(rng.uniform(0.08, 0.35))
        if at + length + 0.1 > LENGTH:
            break
        burst = _coupled(rng, base * rng.uniform(0.99, 1.01), length)
        loud = np.flatnonzero(np.abs(burst) > 0.1 * np.abs(burst).max())
        row = round(at * FS)
        burst = burst[: len(values) - row]
        values[row : row + len(burst)] += burst * rng.uniform(0.5, 1.0)
        spectrum = np.abs(np.fft.rfft(burst * np.hanning(len(burst)), 8 * len(burst)))
        grid = np.fft.rfftfreq(8 * len(burst), 1 / FS)
        near = np.flatnonzero(np.abs(grid / base - 1) < 0.25)
        pitch = float(grid[near[np.argmax(spectrum[near])]])
        truth.append((at + loud[0] / FS, at + (loud[-1] + 1) / FS, pitch))
        at += length + float(rng.uniform(0.12, 0.4))
    return values, tuple(truth)


def _coupled(rng: np.random.Generator, base: float, length: float) -> Array:
    """Sound of a mass on two skew springs and a contact spring: x along the belt, y onto it, in units of the period."""
    count = int((length + 0.08) * FS) * FINER
    step = 2 * math.pi * base / (FS * FINER)
    t = np.arange(count) / (FS * FINER)
    load = np.clip(np.minimum(t / 0.02, (length + 0.06 - t) / 0.02), 0, 1)
    skew, friction = rng.uniform(0.3, 0.45), rng.uniform(0.9, 1.4)
    damping, contact = rng.uniform(0.004, 0.012), 0.6
    x, y, u, w, told = 0.0, 0.0, 1e-4, 0.0, np.zeros(count)
    for i in range(count):
        press = max(0.0, load[i] + contact * y)  # lifts off where the spring would pull
        engaged = load[i]  # light loads couple little
        u += step * (-x - skew * y - 2 * damping * u + friction * engaged * (press - load[i]))
        w += step * (-(1.05 - contact) * y - skew * x - 2 * damping * w - (press - load[i]))
        x, y = x + step * u, y + step * w
        told[i] = press + 0.3 * u
    told = np.diff(told, prepend=told[0])
    spectrum = np.fft.rfft(told - told.mean())
    spectrum[np.fft.rfftfreq(count, 1 / (FS * FINER)) > 0.48 * FS] = 0
    heard = np.fft.irfft(spectrum, count)[::FINER]
    return np.asarray(heard / np.abs(heard).max())


def whines(rng: np.random.Generator) -> Drawn:
    """A servo or stepping motor, a drill, a turbine: the pitch follows the speed, up and down or held for moves."""
    t = _time()
    knots = np.sort(rng.uniform(0, LENGTH, 6))
    speeds = np.concatenate([[0.0], rng.uniform(0.2, 1.0, 4), [0.0]]) if rng.random() < 0.5 else rng.uniform(0.6, 1, 6)
    speed = np.interp(t, knots, speeds)
    speed = np.convolve(speed, np.hanning(1201) / np.hanning(1201).sum(), "same")
    top = float(np.exp(rng.uniform(math.log(500), math.log(6000))))
    strengths = 1 / np.arange(1, 7) ** rng.uniform(0.7, 2.5) * rng.uniform(0.2, 1, 6)
    values = _overtones(top * speed, np.sqrt(np.clip(speed, 0, 1)), strengths)
    return values + 0.05 * rng.uniform(0, 1) * background(rng, len(t)) * speed, ()


def flutes(rng: np.random.Generator) -> Drawn:
    """Flutes, recorders and whistles from C5 to C8: a breath that swells, vibrato, noise of the breath."""
    t, values, at = _time(), np.zeros(len(_time())), 0.05
    strengths = 10 ** (-np.array([0, rng.uniform(6, 25), rng.uniform(12, 35), rng.uniform(20, 45)]) / 20)
    lowest, vibrato = rng.integers(72, 97), rng.choice([0.0, 0.003, 0.01])
    while at < LENGTH - 0.2:
        pitch = 440 * 2 ** ((min(lowest + rng.integers(0, 13), 108) - 69) / 12)
        length, swell = rng.uniform(0.12, 0.6), rng.uniform(0.005, 0.04)
        near = t - at
        shape = 1 / (1 + np.exp(-(near - 3 * swell) / swell * 2) + np.exp((near - length) / swell * 2))
        blown = pitch * (1 + vibrato * np.sin(2 * math.pi * 5.3 * near)) * (1 - 0.01 * rng.random() * (1 - shape))
        values += _overtones(blown, shape, strengths)
        values += 0.03 * rng.random() * shape * rng.standard_normal(len(t))
        at += length + rng.uniform(0.0, 0.2)
    return values, ()


def birds(rng: np.random.Generator) -> Drawn:
    """Chirps, each a glide or a trill from 1.5 to 7 kHz, with a faint overtone or two."""
    t, values, at = _time(), np.zeros(len(_time())), float(rng.uniform(0.05, 0.3))
    strengths = 10 ** (-np.array([0, rng.uniform(15, 45), rng.uniform(25, 60)]) / 20)
    begin, end = np.exp(rng.uniform(math.log(1500), math.log(7000), 2))
    length, trill = rng.uniform(0.03, 0.2), rng.choice([0.0, rng.uniform(10, 40)])
    while at < LENGTH - 0.25:
        share = np.clip((t - at) / length, 0, 1)
        pitch = begin * (end / begin) ** share * (1 + 0.05 * np.sin(2 * math.pi * trill * t))
        inside = (t > at) & (t < at + length)
        values += _overtones(pitch, np.where(inside, np.sin(math.pi * share) ** 2, 0.0), strengths)
        at += length * rng.uniform(1.1, 2.0)
    return values, ()


def crickets(rng: np.random.Generator) -> Drawn:
    """A file drawn over a scraper, yet no rig's: even syllables of 2 to 6 kHz."""
    t, pitch = _time(), float(np.exp(rng.uniform(math.log(2000), math.log(6000))))
    rate, inside = rng.uniform(15, 60), rng.uniform(2, 5)
    chirps = np.clip(np.sin(2 * math.pi * rate * t), 0, 1) * (np.sin(2 * math.pi * inside * t) > rng.uniform(-0.7, 0.7))
    strengths = 10 ** (-np.array([0, rng.uniform(15, 40)]) / 20)
    return _overtones(np.full(len(t), pitch), chirps, strengths), ()


def kettles(rng: np.random.Generator) -> Drawn:
    """A whistle that swells slowly and rises, as that of a kettle or of air through a gap."""
    t = _time()
    pitch = float(np.exp(rng.uniform(math.log(700), math.log(5000))))
    rise, wander = rng.uniform(0.0, 0.3), np.cumsum(rng.standard_normal(len(t))) / math.sqrt(len(t))
    shape = 1 / (1 + np.exp(-(t - rng.uniform(0.2, 1.2)) / rng.uniform(0.02, 0.2)))
    strengths = 10 ** (-np.array([0, rng.uniform(10, 40), rng.uniform(15, 50)]) / 20)
    values = _overtones(pitch * (1 + rise * t / LENGTH + 0.005 * wander), shape, strengths)
    return values + shape * rng.uniform(0.01, 0.2) * background(rng, len(t)), ()


def sirens(rng: np.random.Generator) -> Drawn:
    """Alarms whose pitch sweeps, and signals that are faded in and out within some tens of milliseconds."""
    t = _time()
    pitch = float(np.exp(rng.uniform(math.log(500), math.log(4500))))
    form = np.array([[1, 0, 1 / 3, 0, 1 / 5], [1, 0.5, 1 / 3, 0.25, 0.2], [1, 0.2, 0.1, 0.03, 0.01]][rng.integers(3)])
    swept = 1 + rng.choice([0.0, rng.uniform(0.02, 0.4)]) * np.mod(t * rng.uniform(0.5, 8), 1)
    on, off, ramp = rng.uniform(0.08, 0.5), rng.uniform(0.08, 0.5), rng.uniform(5e-3, 40e-3)
    since = np.mod(t - rng.uniform(0, on + off), on + off)
    shape = np.clip(np.minimum(since / ramp, (on - since) / ramp), 0, 1)
    shape = (1 - np.cos(math.pi * shape)) / 2
    return _overtones(pitch * swept, shape, form), ()


RUBS = ("couplings",)
KINDS: dict[str, Callable[[np.random.Generator], Drawn]] = {
    "couplings": couplings, "whines": whines, "flutes": flutes, "birds": birds, "crickets": crickets,
    "kettles": kettles, "sirens": sirens,
}  # fmt: skip
