"""The decrement method on virtual twins of the thesis's rigs (sections 6.4, 6.5): scatter, and how far it is off.

Released from 5 mm at an unknown instant, read in steps of 0.01 mm at 1 kHz. Run as
``python benchmarks/decrement.py [releases]``.
"""

from __future__ import annotations

import sys

import numpy as np

import stickslip as ss

STEP, FS, FIRST = 1e-5, 1000.0, 5e-3  # m, Hz, m
MASS, STIFFNESS = 1.92, 2310.0
RIGS = {"6.4, case 1": (0.0269, 0.1309e-3), "6.4, case 2": (0.0632, 0.1086e-3), "6.5": (0.0177, 0.413 / STIFFNESS)}


def twin(ratio: float, dry: float, rng: np.random.Generator) -> ss.Record:
    """One release as the rig's displacement sensor would have written it."""
    damping = 2 * ratio * float(np.sqrt(MASS * STIFFNESS))
    rig = ss.Oscillator(mass=MASS, stiffness=STIFFNESS, damping=damping, law=ss.laws.Coulomb(dry * STIFFNESS))
    run = ss.simulate(rig, duration=4.0, start={"x": FIRST})
    hold = rng.uniform(0.1, 0.4)
    times = np.arange(0, hold + 3.5, 1 / FS) - hold
    moved = np.array([run.state(max(0.0, float(time)))["x"] for time in times]) + rng.uniform(-0.5, 0.5) * STEP
    return ss.Record.of({"x": np.round(moved / STEP) * STEP}, fs=FS)


def main(releases: int = 20) -> None:
    """Print a line for each rig and way of finding the extremes."""
    print(f"{'rig':12} {'extremes':8} {'true':>7} {'scatter':>8} {'off RMS':>8} {'own sd':>8} {'95 % hold':>10}")
    for name, (ratio, dry) in RIGS.items():
        rng = np.random.default_rng(1)
        records = [twin(ratio, dry, rng) for _ in range(releases)]
        for location in ("sample", "fit"):
            decrements = [ss.decrement(record, location=location) for record in records]
            off = np.array([decrement.damping_ratio.value - ratio for decrement in decrements])
            scatter = np.mean([decrement.scatter.damping_ratio.std(ddof=1) for decrement in decrements])
            own = np.median([decrement.damping_ratio.sd for decrement in decrements])
            held = np.mean([decrement.damping_ratio.includes(ratio) for decrement in decrements])
            rms = float(np.sqrt(np.mean(off**2)))
            print(f"{name:12} {location:8} {ratio:7.4f} {scatter:8.5f} {rms:8.5f} {own:8.5f} {held:10.2f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
