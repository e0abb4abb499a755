"""How often static over sliding friction holds the truth, on the virtual rig at 2.5 Hz, by what is known of it.

A rigid contact and a compliant one, each with static friction 1 and 1.3 times the sliding one; seen by displacements
alone, with an accelerometer, with a load cell too, nothing stated of any, and all stated. Told are the share of draws
whose interval holds the truth, the refusals, the mean value and the median width of the interval.

    python benchmarks/breakaway.py --draws 10
"""

from __future__ import annotations

import argparse

import numpy as np
from rig import FS, MOTIONS, RIG, SECONDS, SETTLED

import stickslip as ss
from stickslip.errors import EstimateError

CASES = (("xz", "smoother"), ("xz", "fusion"), ("xza", "smoother"), ("all", "fusion"), ("stated", "fusion"))
RATIOS = (1.0, 1.3)


def motion(ratio: float, rigid: bool) -> ss.solve.Trajectory:
    amplitude, kinetic = MOTIONS[2.5]
    law: ss.laws.Coulomb | ss.laws.CompliantContact = (
        ss.laws.Coulomb(kinetic, static=ratio * kinetic)
        if rigid
        else ss.laws.CompliantContact(kinetic, stiffness=192000.0, damping=23.9, static=ratio * kinetic)
    )
    slider = ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(amplitude, frequency=2.5), **RIG)
    return ss.simulate(slider, duration=SETTLED + SECONDS)


def found(run: ss.solve.Trajectory, seed: int, names: str, method: str) -> ss.Estimate | None:
    """The ratio by some sensors, or None where it is refused."""
    record = ss.Rig().measure(run, fs=FS, rng=seed, start=SETTLED)
    if names == "stated":
        record = ss.Rig().stated(record)
    elif names != "all":
        record = ss.Record.of({name: record[name] for name in names}, fs=FS)
    try:
        return ss.cycle.breakaway(ss.friction_force(record, method=method, **RIG)).ratio
    except EstimateError:
        return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=5, help="records a condition")
    draws = parser.parse_args().draws
    for rigid in (False, True):
        for ratio in RATIOS:
            run = motion(ratio, rigid)
            for names, method in CASES:
                each = [one for seed in range(draws) if (one := found(run, 100 + seed, names, method))]
                held = sum(one.includes(ratio) for one in each)
                value, width = ([one.value for one in each], [np.ptp(one.interval) for one in each])
                said = f"value {np.mean(value):.3f}, width {np.median(width):.3f}" if each else "refused"
                kind = "rigid" if rigid else "compliant"
                print(f"{kind:9} {ratio:3g} {names:>6} {method:8}: {held} of {len(each)} hold it, {said}", flush=True)


if __name__ == "__main__":
    main()
