"""What an analysis says of rigs by another integrator, quick and tried on its twins: how often it holds, and is true.

    python benchmarks/twins.py [--draws 20] [--twins 20] [--seed 1] [--off 0.005]

Each kind of contact is drawn with fresh masses, springs, dampers, motions and noise. An interval counts where its
status carries no grave doubt; a claim of static friction counts where its interval lies above 1, of a stick where it
lies above 0.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import stepped
import stickslip as ss
from stickslip.estimate import stands

NAMES = ("sliding friction", "slope of friction against speed", "stuck share of the time", "stops per cycle")
CLAIMS = ("dry friction", "static", "sticks", "gives way")
RATIO, GIVES = "static over sliding friction", "presliding stiffness"
COMPARED = {  # what has a true value of its own
    "Stribeck": (NAMES[0], *NAMES[2:], RATIO),
    "compliant": (NAMES[0], NAMES[1], RATIO),
    "LuGre": (NAMES[0], RATIO),
    "state variable": (NAMES[0],),
}


def counted(findings: ss.answers.Findings, rig: stepped.Rig, tally: dict[str, list[bool]]) -> None:
    """Whether intervals without a doubt hold, and claims are true."""
    truth = findings.record.truth
    for estimate in findings.estimates:
        if not estimate.known or not stands(estimate.status):
            continue
        if estimate.name in COMPARED.get(rig.kind, (*NAMES, RATIO)) and np.isfinite(truth[estimate.name]):
            tally[estimate.name].append(estimate.includes(truth[estimate.name]))
        if estimate.name == GIVES:
            tally["claim: gives way"].append(rig.kind in stepped.SOFT)
            if rig.contact:
                tally[GIVES].append(estimate.includes(rig.contact))
        if estimate.name == RATIO and estimate.interval[0] > 1:
            tally["claim: static"].append(truth[RATIO] > 1)
        if estimate.name == NAMES[2] and estimate.interval[0] > 0 and rig.kind not in stepped.SOFT:
            tally["claim: sticks"].append(truth[NAMES[2]] > 0)
        if estimate.name == NAMES[0] and estimate.interval[0] > 0:
            tally["claim: dry friction"].append(rig.kinetic > 0)


def main() -> None:
    """Draw, ask, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20, help="of each kind")
    parser.add_argument("--twins", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--off", type=float, default=0.0, help="by which gains and constants are off, as is stated")
    parser.add_argument("--kinds", default=",".join(stepped.KINDS))
    options = parser.parse_args()
    for kind in options.kinds.split(","):
        tallies: dict[str, dict[str, list[bool]]] = {"quick": defaultdict(list), "tried": defaultdict(list)}
        lost, unlike, spent = 0, 0, [0.0, 0.0]
        for seed in np.random.SeedSequence([options.seed, stepped.KINDS.index(kind)]).spawn(options.draws):
            rng = np.random.default_rng(seed)
            rig = stepped.drawn(kind, rng)
            record = stepped.record(rig, rng, noise=10 ** rng.uniform(-4, -2.3), off=options.off)
            stated: dict[str, float | tuple[float, float]] = dict(rig.stated)
            if options.off:
                record = record.with_details("x", gain_sd=options.off).with_details("z", gain_sd=options.off)
                for name, value in rig.stated.items():
                    written = value * (1 + options.off * rng.standard_normal())
                    stated[name] = (written, options.off * written)
            begun = time.process_time()
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    quick = ss.analyze(record, **stated)
                    spent[0] += time.process_time() - begun
                    begun = time.process_time()
                    tried = ss.tried(quick, twins=options.twins)
                    spent[1] += time.process_time() - begun
            except ss.errors.StickslipError as error:
                print(f"  {kind}: {error}")
                lost += 1
                continue
            unlike += tried.trial.unlike
            counted(quick, rig, tallies["quick"])
            counted(tried, rig, tallies["tried"])
        asked = max(1, options.draws - lost)
        print(f"{kind}: {options.draws} rigs, {lost} refused, {unlike} unlike their twins; "
              f"{spent[0] / asked:.2f} s quick, {spent[1] / asked:.2f} s on twins")  # fmt: skip
        for name in (*NAMES, RATIO, GIVES, *(f"claim: {what}" for what in CLAIMS)):
            row = [f"{sum(held):3d} of {len(held):3d}" for held in (tallies[way][name] for way in ("quick", "tried"))]
            print(f"    {name:34s} quick {row[0]}   tried {row[1]}", flush=True)


if __name__ == "__main__":
    main()
