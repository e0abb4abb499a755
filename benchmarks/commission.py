"""Commission simulated rigs whose truth is known: how often does each interval hold it, and how far off is each number?

    python benchmarks/commission.py --rigs 100
    python benchmarks/commission.py --rigs 100 --steps rest,gauge-x,added

Every rig has mass, spring, damper, contact, gains, zeros, lags, noise, mounts and discharge of its own, at random.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import defaultdict
from collections.abc import Iterator

import numpy as np

import stickslip as ss
from stickslip.bench import STEPS, Commissioned, SimulatedBench, commission, step_named


def random_rig(seed: int, fs: float = 4000.0) -> SimulatedBench:
    """A rig like the thesis's, and unlike it in everything."""
    chance = np.random.default_rng([20261125, seed])

    def spread(middle: float, factor: float) -> float:
        return float(middle * factor ** chance.uniform(-1, 1))

    mass, stiffness, kinetic = spread(2.4, 1.6), spread(2300, 1.6), spread(1.1, 1.5)
    ratio, contact = spread(2e-3, 3), spread(190e3, 1.5)
    law = ss.laws.CompliantContact(
        kinetic, stiffness=contact, damping=2 * spread(0.02, 1.5) * math.sqrt(contact * mass)
    )
    system = ss.Oscillator(mass=mass, stiffness=stiffness, damping=2 * ratio * math.sqrt(stiffness * mass), law=law)
    rig, lag = ss.Rig(), spread(1.2e-3, 2)
    for channel in ("x", "z"):
        rig = rig.having(
            channel,
            gain=chance.normal(1, 0.02),
            lag=spread(lag, 1.1),
            white=spread(1e-6, 1.5),
            offset=chance.normal(0, 5e-5),
            limit=15e-3,
        )
    rig = rig.having(
        "a",
        gain=chance.normal(1, 0.02),
        white=spread(0.03, 1.5),
        offset=chance.normal(0, 0.05),
        frequency=spread(140, 1.2),
        damping=spread(0.08, 1.4),
    )
    rig = rig.having(
        "load",
        gain=chance.normal(1, 0.02),
        white=spread(2e-3, 1.5),
        offset=chance.normal(0, 0.02),
        discharge=spread(50, 2),
        frequency=spread(270, 1.15),
        damping=spread(0.05, 1.4),
        mass=spread(0.05, 1.5),
    )
    return SimulatedBench(system, rig, fs, seed)


def numbers(done: Commissioned) -> Iterator[tuple[str, ss.Estimate]]:
    """Every number with the step that it is of; the rig's constants of none."""
    constants = done.known.constants
    for each in (*(constants.estimates if constants else ()), *([done.known.damping] if done.known.damping else ())):
        yield "rig", each
    for step, result in done.results.items():
        for each in result.estimates:
            yield step, each


def row(pairs: list[tuple[ss.Estimate, float]]) -> dict[str, object]:
    """How often the interval held the truth, the median error, and that of its share of a truth that is never zero."""
    errors = np.array([abs(number.value - true) for number, true in pairs])
    truths = np.abs([true for _, true in pairs])
    return {
        "inside": sum(bool(number.includes(true)) for number, true in pairs),
        "of": len(pairs),
        "error": float(np.median(errors)),
        "unit": pairs[0][0].unit,
        "share": float(np.median(errors / truths)) if truths.all() else None,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=int, default=100)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--steps", default=",".join(step.name for step in STEPS), metavar="NAME,NAME")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    steps = [step_named(name) for name in asked.steps.split(",")]
    drawn, refused, missed, began = defaultdict(list), defaultdict(int), [], time.process_time()
    for seed in range(asked.first, asked.first + asked.rigs):
        bench = random_rig(seed)
        truth = bench.truth
        done = commission(bench.step, steps=steps, truth=truth)
        for name, why in done.refused.items():
            refused[name] += 1
            print(f"rig {seed}: {name} refused: {why}", flush=True)
        for step, number in numbers(done):
            true = done.true_value(number.name, step)
            if true is not None:
                name = f"{step}: {number.name}"
                drawn[name].append((number, true))
                if not number.includes(true):
                    missed.append((seed, name, round((number.value - true) / (number.spread or math.inf), 1)))
    rows = {name: row(pairs) for name, pairs in drawn.items()}
    everything = [sum(one["inside"] for one in rows.values()), sum(one["of"] for one in rows.values())]
    seconds = time.process_time() - began
    if asked.json:
        answer = {"rows": rows, "all": everything, "refused": dict(refused), "missed": missed, "seconds": seconds}
        print(json.dumps(answer))
        return
    for name, one in rows.items():
        share = "" if one["share"] is None else f" ({100 * one['share']:.2g} %)"
        print(f"{name:55s} {one['inside']:4d} of {one['of']}, median error {one['error']:.2g} {one['unit']}{share}")
    print(f"all: {everything[0]} of {everything[1]}; refused {dict(refused)}; {seconds:.0f} s of processor")
    print(missed)


if __name__ == "__main__":
    main()
