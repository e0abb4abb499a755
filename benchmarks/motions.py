"""Which motion a free decay follows: how often a true one is rejected, and how small a wrong one is seen.

For each candidate: the share of records of that motion in which it is rejected (wanted: 5 +- 2 %), in which it is the
model chosen, and in which the interval over all motions not rejected holds the true dry friction. For each term that
viscous damping with dry friction lacks: the strength that biases an estimate by three standard errors, the power there,
the greatest that any test of this size can have (Neyman and Pearson), the bias from which it can be 99 %, and how often
the intervals of viscous damping with dry friction, and those over all motions not rejected, hold the true dry friction.

Run: ``python benchmarks/motions.py [trials]``.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np
from scipy.special import ndtr

from stickslip.decay.candidates import EXPONENT, NUMBERS, BlockMeans, fit_motion
from stickslip.decay.choice import choose
from stickslip.decay.motions import MOTIONS, PARAMETERS, free_decay

W, FS, NOISE = 2 * math.pi, 40.0, 1e-3
TIMES = np.arange(480) / FS
BOTH = {"damping_ratio": 0.02, "dry_displacement": 0.02}
TRUTHS = {
    "viscous": {"damping_ratio": 0.02},
    "dry": {"dry_displacement": 0.02},
    "both": BOTH,
    "static": BOTH,
    "air": {"damping_ratio": 0.01, "quadratic": 0.05},
    "quadratic": {**BOTH, "quadratic": 0.02},
    "stribeck": {**BOTH, "rise": 0.3, "stribeck_speed": 0.05 * W},
    "micro-slip": {"damping_ratio": 0.005, "micro_slip": 0.05, "exponent": 0.5},
    "curved spring": {**BOTH, "curvature": -0.02},
    "elastic contact": {**BOTH, "presliding": 2e-3, "relaxation": 0.01},
}
TERMS = {
    "quadratic": {},
    "rise at 0.05 of the first speed": {"stribeck_speed": 0.05 * W},
    "rise at 0.3 of the first speed": {"stribeck_speed": 0.3 * W},
    "micro_slip": {"exponent": EXPONENT},
    "curvature": {},
}


def motion(**values: float) -> np.ndarray:
    given = {"angular_frequency": W, "rest": 0.01, "amplitude": 1.0, "release": 0.27, "exponent": EXPONENT, **values}
    return np.array([given.get(name, 0.0) for name in PARAMETERS])


def noisy(values: np.ndarray, rng: np.random.Generator, half_cycles: int | None = None) -> np.ndarray:
    return free_decay(TIMES, values, half_cycles=half_cycles)[0] + NOISE * rng.standard_normal(TIMES.size)


def candidates(trials: int) -> None:
    print(f"{'truth':>14}  rejected  chosen  dry friction held  ms a record")
    for seed, (name, truth) in enumerate(TRUTHS.items()):
        rng, values = np.random.default_rng(seed), motion(**truth)
        rejected = chosen = held = 0
        began = time.process_time()
        for _ in range(trials):
            x = noisy(values, rng, 13 if name == "static" else None)
            choice = choose(TIMES, x, fs=FS, start=values[:6])
            rejected += not choice.candidate(name).kept
            chosen += choice.model == name
            low, high = choice.interval("dry_displacement")
            held += low <= values[NUMBERS["dry_displacement"]] <= high
        spent = (time.process_time() - began) / trials
        print(
            f"{name:>14}  {rejected / trials:8.3f}  {chosen / trials:6.3f}  {held / trials:17.3f}  {1e3 * spent:11.0f}"
        )


def power(trials: int) -> None:
    print(f"{'term':>31}  strength  power  limit  bias seen at 99 % [standard errors]  held by both  by all motions")
    values = motion(**BOTH)
    blocks = BlockMeans(TIMES, free_decay(TIMES, values)[0], np.ones(TIMES.size), np.ones(TIMES.size), FS)
    fitted = fit_motion(MOTIONS["both"], blocks, values)
    inverse = np.linalg.pinv(fitted.jacobian)
    spread = NOISE * np.linalg.norm(inverse, axis=1)
    rows = [fitted.motion.free.index(name) for name in BOTH]
    for term, shape in TERMS.items():
        name = term.split()[0]
        direction = blocks.motion(motion(**BOTH, **shape), free=(name,), half_cycles=fitted.half_cycles)[1][:, 0]
        bias = max(abs(inverse[row] @ direction) / spread[row] for row in rows)
        seen = np.linalg.norm(direction - fitted.jacobian @ (inverse @ direction)) / NOISE
        strength = 3 / bias
        limit = ndtr(seen * strength - 1.959964) + ndtr(-seen * strength - 1.959964)
        rng, rejected, alone, held = np.random.default_rng(2), 0, 0, 0
        truth = motion(**BOTH, **shape, **{name: strength})
        for _ in range(trials):
            choice = choose(TIMES, noisy(truth, rng), fs=FS, start=values[:6])
            both = choice.candidate("both")
            rejected += not both.kept
            alone += both.estimate("dry_displacement").includes(BOTH["dry_displacement"])
            low, high = choice.interval("dry_displacement")
            held += low <= BOTH["dry_displacement"] <= high
        needed = bias / seen * (1.96 + 2.33)
        shares = (
            f"{rejected / trials:5.2f}  {limit:5.2f}  {needed:36.1f}  {alone / trials:12.2f}  {held / trials:14.2f}"
        )
        print(f"{term:>31}  {strength:8.2g}  {shares}")


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    candidates(number)
    power(number)
