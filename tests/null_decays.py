"""Free decays without any dry friction, closed form, seen by sensors that are not clean; and of other motions."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
NOISES = ("white", "pink", "12 bit", "16 bit", "mains", "drift")
PERIODS = 12, 60  # fewest and most that a record has


def null_decay(seed: int, noise: str, *, dry: float = 0.0) -> tuple[Array, float, dict[str, float]]:
    """A mass on a spring with a viscous damper, let go: displacement [m], rate [Hz], truth.

    `dry` is the dry friction displacement over the first amplitude, where there is to be some.
    """
    rng = np.random.default_rng([seed, NOISES.index(noise)])
    frequency, zeta = float(np.exp(rng.uniform(math.log(1), math.log(30)))), float(np.exp(rng.uniform(-6.2, -3.0)))
    length = float(rng.uniform(*PERIODS)) / frequency
    fs = frequency * float(rng.choice([40, 100, 250]))
    amplitude = float(np.exp(rng.uniform(math.log(1e-3), math.log(2e-2))))
    held = float(rng.choice([0.0, 2.0])) / frequency
    t = np.arange(int((held + length) * fs)) / fs - held
    moved = let_go(np.maximum(t, 0.0), 2 * math.pi * frequency, zeta, dry)
    ratio = 10 ** -rng.uniform(1.5, 3.5)  # noise over the first amplitude
    sensed = amplitude * (moved + ratio * _noise(rng, noise, t, frequency, ratio)) + rng.uniform(-1, 1) * amplitude
    if noise.endswith("bit"):
        step = amplitude * 5 / 2 ** int(noise.split()[0])  # of a range of five amplitudes
        sensed = step * np.round(sensed / step)
    return sensed, fs, {"damping_ratio": zeta, "dry_displacement": dry * amplitude, "frequency": frequency}


def let_go(t: Array, w: float, zeta: float, dry: float, rise: float = 0.0) -> Array:
    """From one, half cycle by half cycle: about +dry or -dry, each as long, till it stays; `dry` rises in each."""
    turn = w * math.sqrt(1 - zeta**2)
    half, ratio = math.pi / turn, zeta / math.sqrt(1 - zeta**2)
    x, begin, swing, side = np.zeros(len(t)), 0.0, 1.0, 1.0
    while begin <= t[-1]:
        rows = (t >= begin) & ((t < begin + half) if swing > dry else True)
        if swing <= dry:
            x[rows] = side * swing
            break
        since = t[rows] - begin
        wave = np.exp(-zeta * w * since) * (np.cos(turn * since) + ratio * np.sin(turn * since))
        x[rows] = side * (dry + (swing - dry) * wave)
        swing, side, begin = (swing - dry) * math.exp(-math.pi * ratio) - dry, -side, begin + half
        dry += rise
    return x


def on_a_cubic_spring(
    t: Array,
    w: float,
    zeta: float,
    dry: float,
    cubic: float = 0.0,
    *,
    air: float = 0.0,
    rise: float = 0.0,
    power: float = 2.0,
) -> Array:
    """From one on a spring ``x + cubic x^3``, half cycle by half cycle, by scipy's eighth-order rule.

    A drag `air` v^2 may slow it too, and its dry friction `rise` towards rest, as exp(-|10 v/w|^power).
    """
    x, begin, at = np.ones(len(t)), 0.0, 1.0

    def turning(_: float, state: Array) -> float:
        return float(state[1])

    turning.terminal = True  # type: ignore[attr-defined]
    while begin <= t[-1] and abs(at + cubic * at**3) > dry * (1 + rise):
        side = math.copysign(1.0, at)

        def rates(_: float, state: Array, side: float = side) -> list[float]:
            u, v = state
            rubbing = side * dry * (1 + rise * math.exp(-(abs(10 * v / w) ** power)))
            return [v, -w * w * (u + cubic * u**3 - rubbing) - 2 * zeta * w * v - air * v * abs(v)]

        turning.direction = side  # type: ignore[attr-defined]
        span, begun = (begin, begin + 4 * math.pi / w), [at, -1e-12 * side * w]
        run = solve_ivp(rates, span, begun, "DOP853", events=turning, dense_output=True, rtol=1e-9, atol=1e-12)
        rows = (t >= begin) & (t < run.t[-1])
        if rows.any():
            x[rows] = run.sol(t[rows])[0]
        begin, at = float(run.t[-1]), float(run.y[0, -1])
        x[t >= begin] = at
    return x


def _noise(rng: np.random.Generator, noise: str, t: Array, frequency: float, ratio: float) -> Array:
    """Of unit size."""
    white = rng.standard_normal(len(t))
    if noise == "pink":
        spectrum = np.fft.rfft(white)
        spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
        pink = np.fft.irfft(spectrum, len(t))
        return np.asarray(pink / pink.std())
    if noise == "12 bit":
        return white * 10 ** -rng.uniform(0, 2)  # from well above a count to far below it
    if noise == "mains":
        return np.asarray(
            0.3 * white + math.sqrt(2) * np.sin(2 * math.pi * rng.choice([50, 60]) * t + rng.uniform(0, 6))
        )
    if noise == "drift":
        way = np.cumsum(rng.standard_normal(len(t)))
        slow = (way - way.mean()) / way.std() if rng.random() < 0.5 else np.linspace(-1.7, 1.7, len(t))
        return np.asarray(0.3 * white + rng.uniform(1, 3) * slow)
    return white
