"""Friction curves of records of known friction: how often their 95 % intervals hold the truth, and how far they err.

Each row: a parameter, the share of intervals that hold the truth, mean error and root-mean-square error over the truth,
and half the median interval over the truth. Displacement and friction are noisy; the velocity is differentiated. Run as
``python benchmarks/curves.py [draws]``.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import stickslip as ss

FS, CYCLES, HZ, PEAK = 1000, 20, 1.0, 0.1


def motion(rng: np.random.Generator, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, displacement and velocity of a sine that begins anywhere."""
    t = np.arange(CYCLES * FS) / FS
    turn = 2 * np.pi * HZ * t + rng.uniform(0, 2 * np.pi)
    return t, amplitude * np.sin(turn), amplitude * 2 * np.pi * HZ * np.cos(turn)


def over_speed(rng: np.random.Generator, truth: dict[str, float]) -> ss.Record:
    """Stribeck's curve, or a viscous one where there is no Stribeck speed; 1 um and 2 % of noise."""
    _, x, v = motion(rng, PEAK / (2 * np.pi * HZ))
    fall = np.exp(-((np.abs(v) / truth["speed"]) ** truth["exponent"])) if "speed" in truth else 0.0
    level = truth["kinetic"] + (truth.get("static", truth["kinetic"]) - truth["kinetic"]) * fall
    f = np.sign(v) * level + truth["viscous"] * v + truth["offset"]
    return ss.Record.of({"x": x + rng.normal(0, 1e-6, x.size), "friction": f + rng.normal(0, 0.02, x.size)}, fs=FS)


def over_way(rng: np.random.Generator, truth: dict[str, float]) -> ss.Record:
    """A Jenkins element; 2 % of its give and of its friction as noise."""
    _, x, _ = motion(rng, 1e-4)
    f = np.zeros_like(x)
    for i in range(1, x.size):
        f[i] = np.clip(f[i - 1] + truth["stiffness"] * (x[i] - x[i - 1]), -truth["kinetic"], truth["kinetic"])
    noise = 0.02 * truth["kinetic"] / truth["stiffness"], 0.02 * truth["kinetic"]
    f = f + truth["offset"] + rng.normal(0, noise[1], x.size)
    return ss.Record.of({"x": x + rng.normal(0, noise[0], x.size), "friction": f}, fs=FS)


STRIBECK = {"kinetic": 1.0, "static": 1.4, "viscous": 0.5, "offset": 0.05, "speed": 0.02, "exponent": 1.0}
CASES = [
    ("viscous", over_speed, {"kinetic": 1.0, "viscous": 0.5, "offset": 0.05}),
    ("stribeck", over_speed, STRIBECK),
    ("stribeck", over_speed, STRIBECK | {"exponent": 2.0}),
    ("jenkins", over_way, {"kinetic": 1.1, "stiffness": 1e5, "offset": 0.02}),
]


def main(draws: int) -> None:
    for curve, made, truth in CASES:
        begun = time.process_time()
        fits = [ss.fit_curve(made(np.random.default_rng(seed), truth), curve=curve) for seed in range(draws)]
        print(f"{curve}, {draws} records of {CYCLES} cycles, {(time.process_time() - begun) / draws:.2f} s each")
        for name, value in truth.items():
            found = [fit.parameters[name] for fit in fits if name in fit.parameters]
            errors = np.array([each.value for each in found]) / value - 1
            half = np.median([each.interval[1] - each.interval[0] for each in found]) / 2 / value
            held = np.mean([each.includes(value) for each in found])
            print(
                f"  {name:10} {100 * held:5.1f} % held  mean {errors.mean():+.1e}  rms "
                f"{np.sqrt(np.mean(errors**2)):.1e}  half interval {half:.1e}"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
