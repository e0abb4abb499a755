"""The whole experiment on simulated benches: how often does the law's part of the report hold its truth?

``python benchmarks/tour.py [--seeds 16] [--first 1]`` draws gains, zeros and noise anew for each, and commissions it.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import defaultdict

from stickslip.bench import SimulatedBench, tour


def truth() -> dict[str, float]:
    """By the names of the law's estimates."""
    system = SimulatedBench().system
    contact = {"sliding friction": "kinetic", "contact stiffness": "stiffness", "contact damping": "damping"}
    own = {name: getattr(system, name) for name in ("damping", "stiffness")}
    return {name: getattr(system.law, field) for name, field in contact.items()} | own


def main() -> None:
    """Tell each number's intervals and how far off it was, in standard deviations."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--first", type=int, default=1)
    asked = parser.parse_args()
    off, began, true = defaultdict(list), time.process_time(), truth()
    for seed in range(asked.first, asked.first + asked.seeds):
        with tempfile.TemporaryDirectory() as folder:
            laws = tour(folder, seed=seed, fast=True).laws
        for estimate in laws.estimates:
            if estimate.name in true:
                error = (estimate.value - true[estimate.name]) / estimate.spread
                off[estimate.name].append((estimate.includes(true[estimate.name]), round(float(error), 1)))
        print(f"seed {seed}: {laws.candidates[0].name}", flush=True)
    for name, pairs in off.items():
        print(f"{name:20s} {sum(held for held, _ in pairs)} of {len(pairs)}; off by {[error for _, error in pairs]}")
    print(f"{(time.process_time() - began) / asked.seeds:.0f} s of processor each")


if __name__ == "__main__":
    main()
