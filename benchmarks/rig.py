"""What the virtual rig's records tell of the contact: ``make bench`` prints error and coverage of each figure.

The thesis's air-track rig, its four motions, on an even surface and on one whose friction fluctuates by 3 %; each draw
has its own noise, and its own surface. ``--draws`` records of 3 s a condition: with 200 a coverage of 95 % is sure to
1.5 points. With ``--keep FILE`` every draw is written down as it is done, and a second call goes on from there.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from collections import defaultdict
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.balance.likely_contact import likely_contact, sliding_level
from stickslip.contact.contact import branch_slopes

MOTIONS = {2.5: (0.65e-3, 1.1), 5.61: (0.6e-3, 1.05), 8.7: (1.1e-3, 1.1), 11.1: (2e-3, 1.1)}
"""Frequency [Hz] of the base: its amplitude [m], and the friction [N]."""
RIG = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.1196}
STIFFNESS, DAMPING = 192000.0, 23.9
ROUGHNESS = (0.0, 0.03)
FS, SECONDS, SETTLED = 4000.0, 3.0, 8.0
LAG = 0.0389 / 30.91


@lru_cache(maxsize=8)
def motion(frequency: float, rough: float, surface: int) -> ss.solve.Trajectory:
    amplitude, kinetic = MOTIONS[frequency]
    law: Any = ss.laws.CompliantContact(kinetic, stiffness=STIFFNESS, damping=DAMPING)
    if rough:
        law = ss.laws.RoughSurface(law, share=rough, length=2e-4, span=2e-3, seed=surface)
    slider = ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(amplitude, frequency=frequency), **RIG)
    return ss.simulate(slider, duration=SETTLED + SECONDS)


def measured(frequency: float, rough: float, seed: int) -> ss.Record:
    """The record, with what its user knows of the sensors."""
    run = motion(frequency, rough, seed if rough else 0)
    record = ss.Rig().measure(run, fs=FS, rng=1000 + seed, start=SETTLED)
    for name in ("x", "z"):
        record = record.with_details(name, delay=LAG)
    record = record.with_details("a", mount=(125.0, 0.1))
    return record.with_details("load", mount=(250.0, 0.05), inertia=0.05, discharge=50.0)


def slopes(record: ss.Record, method: str) -> list[float]:
    """The thesis's way: mean and scatter of the slopes of all branches, with its friction F1 or F2."""
    found = ss.friction_force(record, method=method, **RIG)
    level, middle = sliding_level(found["friction"], np.gradient(found["x"]))
    each = branch_slopes(found["x"], found["friction"] - middle, level)
    return [float(each.mean()), float(each.std(ddof=1))]


def draw(frequency: float, rough: float, seed: int) -> dict[str, list[float]]:
    """Value, low and high end of each figure of one record; of slopes mean and scatter."""
    record = measured(frequency, rough, seed)
    fused = ss.friction_force(record, method="fusion", **RIG)
    contact = likely_contact(fused)
    told = {"stiffness": contact.stiffness, "damping": contact.damping}
    figures = {name: [each.value, *each.interval] for name, each in told.items()}
    return figures | {method: slopes(record, method) for method in ("F1", "F2")}


Draws = dict[tuple[float, float], dict[int, dict[str, list[float]]]]


def kept(path: Path | None) -> Draws:
    """The draws that an earlier call has written down."""
    found: Draws = defaultdict(dict)
    for line in path.read_text("utf-8").splitlines() if path and path.exists() else ():
        each = json.loads(line)
        found[each["frequency"], each["rough"]][each["seed"]] = each["figures"]
    return found


def run(draws: int, frequencies: list[float], path: Path | None) -> Draws:
    found, begin = kept(path), time.perf_counter()
    conditions = list(itertools.product(frequencies, ROUGHNESS))
    for seed in range(draws):
        for frequency, rough in conditions:
            if seed in found[frequency, rough]:
                continue
            figures = draw(frequency, rough, seed)
            found[frequency, rough][seed] = figures
            if path:
                with path.open("a", encoding="utf-8") as file:
                    told = {"frequency": frequency, "rough": rough, "seed": seed, "figures": figures}
                    file.write(json.dumps(told) + "\n")
        if sys.stderr.isatty() or seed % 10 == 9:
            print(f"draw {seed + 1} of {draws}, {time.perf_counter() - begin:.0f} s", file=sys.stderr, flush=True)
    return found


def tell(found: Draws, frequencies: list[float]) -> None:
    print(f"records of {SECONDS:g} s at {FS:g} Hz; errors in % of the truth, coverage of the 95 % intervals in %")
    print("motion           draws |  stiffness: bias   rms  largest  coverage |  damping: bias   rms  coverage | slope")
    for condition in itertools.product(frequencies, ROUGHNESS):
        figures = list(found[condition].values())
        stiffness, damping = (np.array([figure[name] for figure in figures]) for name in ("stiffness", "damping"))
        error, resisting = 100 * (stiffness[:, 0] / STIFFNESS - 1), 100 * (damping[:, 0] / DAMPING - 1)
        inside = 100 * np.mean((stiffness[:, 1] <= STIFFNESS) & (stiffness[:, 2] >= STIFFNESS))
        damped = 100 * np.mean((damping[:, 1] <= DAMPING) & (damping[:, 2] >= DAMPING))
        slope = []
        for method in ("F1", "F2"):
            mean, scatter = np.array([figure[method] for figure in figures]).T
            off = 100 * (np.mean(mean) / STIFFNESS - 1)
            slope.append(f"{method} {off:+.0f} %, scatter {100 * np.mean(scatter / mean):.0f} %")
        print(
            f"{condition[0]:5g} Hz, rough {condition[1]:4g} {len(figures):4d} |"
            f"         {error.mean():+8.3f} {rms(error):6.3f} {np.abs(error).max():7.3f} {inside:8.1f}  |"
            f" {resisting.mean():+12.2f} {rms(resisting):6.2f} {damped:7.1f}  | {'; '.join(slope)}"
        )


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20, help="records a condition")
    parser.add_argument("--frequencies", default="2.5,5.61,8.7,11.1", help="of the base [Hz]")
    parser.add_argument("--keep", type=Path, help="file in which every draw is written down")
    asked = parser.parse_args()
    frequencies = [float(each) for each in asked.frequencies.split(",")]
    tell(run(asked.draws, frequencies, asked.keep), frequencies)


if __name__ == "__main__":
    main()
