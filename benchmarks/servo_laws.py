"""Which friction law it is, on rigs of an integrator with nothing of the engine in it (`tests/servo.py`).

Servo drives, x and z alone in counts of 12 or 16 bits, stated dampers a tenth to ten times the true one, constants and
gains 0.5 % off, rough surfaces. Told are each rig's laws kept with the confidence, how often the truth was left out,
the lowest odds that a true law had (of them `LOWEST` in `law/verdict.py` is made), and how often intervals held.

    python benchmarks/servo_laws.py --draws 10 --first 300 --keep servo.jsonl

With ``--cell`` the rigs are others (`tests/stepped.py`): shaken in one tone, an accelerometer and a load cell beside x
and z, gains 0.3 % off, each second one on a surface that is 2 % rough; Stribeck's curve has an exponent of 0.5, 1 or 2.
With ``--keep FILE`` every rig is written down as it is done, and a second call goes on from there.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import servo
import stepped
import stickslip as ss

SAID = (0.0, 0.9, 0.95, 0.98, 0.99)  # confidences from which on the answers are counted
TRUE = {
    "kinetic": "level", "static": "static", "damping": "damping", "stiffness": "stiffness", "speed": "fall",
    "law.stiffness": "contact", "law.damping": "loss", "rate": "rate", "steepness": "steep", "exponent": "exponent",
}  # fmt: skip
"""Of each parameter that is fitted, what it is called among the rig's numbers."""
FELT = ("Coulomb", "static", "Stribeck 0.5", "Stribeck 1", "Stribeck 2", "LuGre")  # laws of rigs with a load cell


def felt(name: str, seed: int) -> servo.Servo:
    """A rig with a load cell whose law is `name`, with its exponent."""
    law, _, exponent = name.partition(" ")
    rng = np.random.default_rng([seed, FELT.index(name)])
    rig = replace(stepped.drawn(law, rng), rough=0.02 * (seed % 2))
    rig = replace(rig, exponent=float(exponent)) if exponent else rig
    record = stepped.record(rig, rng, off=3e-3, felt=True, dirty=False)
    mean = stepped.passed(record["x"], rig)
    numbers = {
        **rig.stated, "kinetic": rig.kinetic, "static": max(rig.static, rig.kinetic), "fall": rig.speed,
        "contact": rig.contact, "exponent": rig.exponent, "level": rig.kinetic * mean,
    }  # fmt: skip
    return servo.Servo(law, {key: float(value) for key, value in numbers.items()}, rig.stated, (record,))


def asked(law: str, seed: int, *, cell: bool) -> dict[str, Any]:
    """What is said of one rig, and what is true."""
    rig = felt(law, seed) if cell else servo.drawn(law, np.random.default_rng([seed, servo.LAWS.index(law)]))
    stated = ss.Oscillator(law=ss.laws.Coulomb(1.0), drive=ss.drives.Release(), **rig.stated)
    begun = time.process_time()
    row: dict[str, Any] = {"seed": seed, "law": law, "truth": rig.law}
    try:
        comparison = ss.compare_laws(rig.records, stated)
    except ss.StickslipError as error:
        return {**row, "error": str(error), "seconds": time.process_time() - begun}
    standings = [candidate.standing for candidate in comparison.candidates]
    true = {**rig.numbers, "static": rig.numbers["static"] * rig.numbers["level"] / rig.numbers["kinetic"]}
    return {
        **row, "seconds": time.process_time() - begun,
        "kept": list(comparison.kept), "confidence": comparison.confidence,
        "limits": [standing.name for standing in standings if standing.limit],
        "best": comparison.best.name, "status": comparison.status,
        "odds": {standing.name: 1.0 if standing.limit else standing.odds for standing in standings},
        "said": {key: [true[TRUE[key]], one.value, *one.interval, one.status == "ok"]
                 for key, one in comparison.fit.parameters.items() if TRUE.get(key) in true},
    }  # fmt: skip


def told(row: dict[str, Any]) -> str:
    """One rig, in a line."""
    said = row.get("error") or f"{', '.join(row['kept'])}, {row['confidence']:.3f}"
    return f"{row['seed']} {row['law']}: {said}, {row['seconds']:.1f} s"


def summed(rows: list[dict[str, Any]]) -> list[str]:
    """What all rigs say together."""
    answered = [row for row in rows if "error" not in row]
    lines = []
    for least in SAID:
        right = [row["truth"] in {*row["kept"], *row["limits"]} for row in answered if row["confidence"] >= least]
        lines.append(f"said at {least:.0%} or more: the truth left out in {right.count(False)} of {len(right)}")
    described = [row for row in answered if row["confidence"]]
    odds = sorted(row["odds"][row["truth"]] for row in described)
    lines.append(f"lowest odds of the true law, of {len(odds)}: {', '.join(f'{value:.3g}' for value in odds[:12])}")
    for key in TRUE:
        own = [row["said"][key] for row in described if row["best"] == row["truth"] and key in row["said"]]
        if own:
            true, value, low, high, sure = np.array(own, dtype=float).T
            off, half = np.abs(value / true - 1), np.where(true < value, value - low, high - value)
            strays = np.abs(true - value) / np.maximum(half, 1e-300)
            lines.append(
                f"{key}: {np.mean(strays <= 1):.0%} of {len(own)} intervals hold, 95 % of them would at "
                f"{np.quantile(strays, 0.95):.2f} times their width; off by {np.median(off):.2%} (median); "
                f"without a doubt {np.sum((strays <= 1) * sure):.0f} of {sure.sum():.0f}"
            )
    return lines + [told(row) for row in rows if "error" in row]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=10, help="rigs of each law")
    parser.add_argument("--first", type=int, default=300, help="seed of the first")
    parser.add_argument("--cell", action="store_true", help="rigs with an accelerometer and a load cell")
    parser.add_argument("--laws", help="of these rigs alone, with commas")
    parser.add_argument("--keep", type=Path, metavar="FILE")
    options = parser.parse_args()
    kept = options.keep and options.keep.exists()
    rows = [json.loads(line) for line in options.keep.read_text("utf-8").splitlines()] if kept else []
    done = {(row["seed"], row["law"]) for row in rows}
    for seed in range(options.first, options.first + options.draws):
        for law in options.laws.split(",") if options.laws else FELT if options.cell else servo.LAWS:
            if (seed, law) in done:
                continue
            rows.append(asked(law, seed, cell=options.cell))
            print(told(rows[-1]), flush=True)
            if options.keep:
                with options.keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
    print("\n".join(summed(rows)))


if __name__ == "__main__":
    main()
