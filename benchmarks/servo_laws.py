"""Which friction law it is, on rigs of an integrator with nothing of the engine in it (`tests/servo.py`).

Servo drives, x and z alone in counts, stated dampers a tenth to ten times the true one, constants and gains 0.5 % off,
rough surfaces. Told are each rig's laws kept with the confidence, and how often the truth was left out.

    python benchmarks/servo_laws.py --draws 10 --first 300
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import servo
import stickslip as ss

SAID = (0.0, 0.9, 0.95, 0.99)  # confidences from which on the answers are counted


def asked(law: str, seed: int) -> ss.law.LawComparison:
    """What is said of one rig."""
    rig = servo.drawn(law, np.random.default_rng([seed, servo.LAWS.index(law)]))
    stated = ss.Oscillator(law=ss.laws.Coulomb(1.0), drive=ss.drives.Release(), **rig.stated)
    return ss.compare_laws(rig.records, stated)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=10, help="rigs of each law")
    parser.add_argument("--first", type=int, default=300, help="seed of the first")
    options = parser.parse_args()
    answers: list[tuple[float, bool]] = []
    for seed in range(options.first, options.first + options.draws):
        for law in servo.LAWS:
            begun = time.process_time()
            try:
                found = asked(law, seed)
            except ss.StickslipError as error:
                print(f"{seed} {law}: refused, {error}", flush=True)
                continue
            possible = {each.name for each in found.candidates if each.standing.kept or each.standing.limit}
            answers.append((found.confidence, law in possible))
            spent = time.process_time() - begun
            print(f"{seed} {law}: {', '.join(found.kept)}, {found.confidence:.3f}, {spent:.1f} s", flush=True)
    for least in SAID:
        right = [held for said, held in answers if said >= least]
        print(f"said at {least:.0%} or more: the truth left out in {right.count(False)} of {len(right)}")


if __name__ == "__main__":
    main()
