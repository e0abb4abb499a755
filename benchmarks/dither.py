"""Does the dither found remove stick-slip, and is it the smallest?

    python benchmarks/dither.py [count] [folder]

Random oscillators that stick and slip: rigid and compliant contacts, on belts and ramps, with a shaken base or a force.
The dither of each is checked by four runs three times as long from random starts, and against brute force: amplitudes
from a fifth of the one found upwards, in steps of 10 % and, from a half, of 3 %, until one removes every macroscopic
stick from each of the starts that ``dither`` names. Each line is kept in the folder, and a second call goes on where
the first was stopped.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import stickslip as ss

GRID = np.append(np.geomspace(0.2, 0.5, 11)[:-1], np.geomspace(0.5, 1.0, 25)[:-1])
# amplitudes of the brute force over the one found: steps of 10 % up to a half, of 3 % from there


def random_system(number: int) -> ss.Oscillator:
    """An oscillator that may stick: the rest of its kind is left to chance."""
    rng = np.random.default_rng([8, 2, number])
    mass, frequency = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-0.3, 1.3)
    stiffness = mass * (2 * math.pi * frequency) ** 2
    kinetic, ratio = 10 ** rng.uniform(-1, 1), rng.uniform(1.1, 2.0)
    damping = 2 * rng.uniform(0.0, 0.05) * math.sqrt(stiffness * mass)
    natural = kinetic / math.sqrt(stiffness * mass)  # m/s: the speed at which friction acts
    kind = rng.integers(4)
    if kind == 0:
        law: Any = ss.laws.Coulomb(kinetic, static=ratio * kinetic)
        drive: Any = ss.drives.Belt(natural * 10 ** rng.uniform(-1.3, -0.2))
    elif kind == 1:
        law = ss.laws.Coulomb(kinetic, static=ratio * kinetic)
        drive = ss.drives.Ramp(natural * 10 ** rng.uniform(-1.3, -0.2))
    elif kind == 2:
        law = ss.laws.Coulomb(kinetic)
        drive = ss.drives.HarmonicForce(kinetic / rng.uniform(0.6, 0.95), frequency * rng.uniform(0.2, 0.8))
    else:
        law = ss.laws.CompliantContact(kinetic, stiffness=stiffness * 10 ** rng.uniform(1.3, 2.3), damping=damping)
        drive = ss.drives.HarmonicBase(kinetic / stiffness / rng.uniform(0.5, 0.9), frequency * rng.uniform(0.2, 0.8))
    return ss.Oscillator(mass, stiffness, law, drive, damping=damping)


@dataclass(frozen=True)
class Line:
    """What was found of one system."""

    number: int
    sticks: bool
    removed: bool = False
    ratio: float = math.nan
    kind: str = ""


def looked_at(number: int) -> Line:
    """The dither of one system, checked and compared with the smallest."""
    from stickslip.maps.dither import FORGET, longest_stick

    system = random_system(number)
    kind = f"{type(system.law).__name__} on {type(system.drive).__name__}"
    try:
        found = ss.dither(system)
    except ss.errors.SolveError as refusal:
        if "never sticks" in str(refusal) or "held all the time" in str(refusal):
            return Line(number, False, kind=kind)
        return Line(number, True, False, kind=kind)
    slow = system.drive.motion().period
    span = 40 * max(1 / system.frequency, slow if math.isfinite(slow) else 0.0)

    def removes(amplitude: float, longer: float, starts: Sequence[Mapping[str, float]]) -> bool:
        dithered = system.having(drive=ss.drives.Dithered(system.drive, amplitude, found.frequency, on=found.on))
        runs = (ss.simulate(dithered, duration=longer * span, start=start) for start in starts)
        return all(longest_stick(run, FORGET * span * longer) * found.frequency < 1 for run in runs)

    amplitude = found.amplitude.value
    x, v = ss.simulate(system, duration=span).sample(np.linspace(FORGET * span, span, 4001), ("x", "v"))[0]
    rng = np.random.default_rng([8, 3, number])
    far, fast = float(np.max(np.abs(x))), float(np.max(np.abs(v)))
    removed = removes(amplitude, 3.0, [{"x": far * rng.uniform(-1, 1), "v": fast * rng.uniform(-1, 1)} for _ in "1234"])
    at_rest = [{"x": share * far, "v": 0.0} for share in (1.0, -1.0, 0.5, -0.5, 0.0)]
    fastest = {name: float(row[np.argmax(np.abs(v))]) for name, row in (("x", x), ("v", v))}
    starts = [{}, fastest, *at_rest]
    smallest = next((share for share in GRID if removes(share * amplitude, 1.0, starts)), 1.0)
    return Line(number, True, removed, 1 / smallest, kind)


def measured(count: int, folder: Path | None = None) -> list[Line]:
    """The first `count` random systems that stick; with a folder, going on where it was stopped."""
    kept = folder / "dither.jsonl" if folder else None
    lines = [Line(**json.loads(row)) for row in kept.read_text().splitlines()] if kept and kept.exists() else []
    while sum(line.sticks for line in lines) < count:
        lines.append(looked_at(len(lines)))
        if kept:
            kept.parent.mkdir(parents=True, exist_ok=True)
            with kept.open("a") as file:
                file.write(json.dumps(vars(lines[-1])) + "\n")
    return [line for line in lines if line.sticks][:count]


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    lines = measured(count, Path(sys.argv[2]) if len(sys.argv) > 2 else None)
    ratios = np.array([line.ratio for line in lines])
    print(f"{len(lines)} random systems that stick")
    print(f"  dither found removes stick-slip in {100 * np.mean([line.removed for line in lines]):.1f} %")
    print(f"  its amplitude is within 10 % of the smallest by brute force in {100 * np.mean(ratios <= 1.1):.1f} %,")
    print(f"  {np.nanmedian(ratios):.3f} of it (median), {np.nanmax(ratios):.3f} (largest)")
    for kind in sorted({line.kind for line in lines}):
        own = [line for line in lines if line.kind == kind]
        print(
            f"  {kind}: {len(own)}, removed {sum(line.removed for line in own)}, "
            f"within 10 % {sum(line.ratio <= 1.1 for line in own)}"
        )
