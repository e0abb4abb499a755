"""How well ``fit_law`` finds a compliant contact: error and coverage of each parameter; ``make bench`` prints them.

The thesis's air-track rig, 3 s of it a record, on an even surface and on one whose friction fluctuates by 3 %; each
draw has its own noise, and its own surface; base and mass are as stated. The search starts 10 to 60 % off. With 200
draws a coverage of 95 % is sure to 1.5 points, with 60 to 2.8.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time

import numpy as np
from rig import DAMPING, MOTIONS, RIG, STIFFNESS, measured

import stickslip as ss

UNSURE = ["damping", "stiffness", "x.gain", "a.gain", "load.gain", "x.delay", "z.delay"]
UNSURE += [f"{name}.{part}" for name in ("a", "load") for part in ("frequency", "damping")]
START = ss.laws.CompliantContact(1.3, stiffness=120000, damping=10.0)


def draw(frequency: float, rough: float, seed: int) -> dict[str, tuple[float, float, float, float]]:
    """Truth, value, low and high end of each parameter of one record."""
    record = measured(frequency, rough, seed)
    rig, law = ss.Oscillator(law=START, **RIG), ss.laws.RoughSurface if rough else None
    fit = ss.fit_law(record, rig, law=law, nuisance=UNSURE)
    truth = {"kinetic": MOTIONS[frequency][1], "law.stiffness": STIFFNESS, "law.damping": DAMPING}
    return {name: (true, fit.parameters[name].value, *fit.parameters[name].interval) for name, true in truth.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20, help="records a condition")
    parser.add_argument("--first", type=int, default=0, help="number of the first draw")
    parser.add_argument("--frequencies", default="2.5,8.7", help="of the base [Hz]")
    parser.add_argument("--rough", default="0,0.03", help="fluctuation of the friction")
    asked = parser.parse_args()
    frequencies, shares = ([float(each) for each in text.split(",")] for text in (asked.frequencies, asked.rough))
    for frequency, rough in itertools.product(frequencies, shares):
        begin, found = time.process_time(), []
        for seed in range(asked.first, asked.first + asked.draws):
            found.append(draw(frequency, rough, seed))
            print(f"draw {seed}", file=sys.stderr, flush=True)
        each = (time.process_time() - begin) / asked.draws
        print(f"{frequency:g} Hz, rough {rough:g}, {asked.draws} records of 3 s, {each:.1f} s of processor time a fit")
        for name in found[0]:
            true, value, low, high = np.array([one[name] for one in found]).T
            error, inside = 100 * (value / true - 1), 100 * np.mean((low <= true) & (true <= high))
            rms, width = np.sqrt(np.mean(error**2)), 100 * np.median((high - low) / true / 2)
            print(
                f"  {name:14s} bias {error.mean():+8.4f} %  rms {rms:8.4f} %  largest {np.abs(error).max():8.4f} %"
                f"  half width {width:8.4f} %  covers {inside:5.1f} %",
                flush=True,
            )


if __name__ == "__main__":
    main()
