"""How many systems drawn at random over laws and drives are refused, take long, or do not keep their energy?

    python benchmarks/random_systems.py [SEED [COUNT]]

Wrong is a run whose work does not balance to 1e-6. What numba compiles does not count as time.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Callable

import numpy as np

import stickslip as ss
import stickslip.compiled
from stickslip import drives, laws

SLOW = 10.0  # s of processor
BALANCED = 1e-6

Draw = np.random.Generator
Scales = tuple[float, float, float]  # friction [N], spring [N/m], mass [kg]


def _log(draw: Draw, low: float, high: float) -> float:
    return float(10.0 ** draw.uniform(low, high))


def _compliant(draw: Draw, force: float, spring: float, mass: float) -> laws.CompliantContact:
    stiffness = spring * _log(draw, 0.5, 3)
    damping = _log(draw, -2, 0) * math.sqrt(stiffness * mass)
    static = force * float(draw.uniform(1, 1.5))
    return laws.CompliantContact(force, stiffness, damping, static, rule=str(draw.choice(["literal", "consistent"])))


def _rock(draw: Draw, force: float, spring: float, mass: float) -> laws.RateState:
    direct, speed = 0.6 / _log(draw, 0.5, 2), force / math.sqrt(spring * mass)
    distance = force / spring * _log(draw, -4, -1)
    which = str(draw.choice(["aging", "slip"]))
    return laws.RateState(
        force / 0.6, 0.6, direct, direct * float(draw.uniform(0.5, 2)), distance, speed * _log(draw, -4, -1), law=which
    )


def _line(draw: Draw, force: float, spring: float, mass: float) -> laws.LinearSlope:
    return laws.LinearSlope(force, slope=math.sqrt(spring * mass) * float(draw.uniform(-0.05, 0.5)))


LAWS: dict[str, Callable[[Draw, float, float, float], object]] = {
    "Coulomb": lambda d, f, k, m: laws.Coulomb(f, static=f * float(d.uniform(1, 2))),
    "LinearSlope": _line,
    "Stribeck": lambda d, f, k, m: laws.Stribeck(f, f * 1.4, speed=f / math.sqrt(k * m) * _log(d, -2, 0)),
    "CompliantContact": _compliant,
    "InertialContact": lambda d, f, k, m: laws.InertialContact(
        f, k * _log(d, 0.5, 3), m * _log(d, -3, 0), _log(d, -2, 0) * math.sqrt(k * m)
    ),
    "StateVariable": lambda d, f, k, m: laws.StateVariable(f, _log(d, 0, 3) * math.sqrt(k / m) / f),
    "ElastoSlip": lambda d, f, k, m: laws.ElastoSlip.iwan(k * _log(d, 0.5, 2), width=f / k, elements=6),
    "PositionLoad": lambda d, f, k, m: laws.PositionLoad(f, gradient=k * float(d.uniform(-0.8, 0.8))),
    "Dahl": lambda d, f, k, m: laws.Dahl(f, k * _log(d, 0.5, 3)),
    "LuGre": lambda d, f, k, m: laws.LuGre(
        f, f * 1.3, f / math.sqrt(k * m) * _log(d, -2, 0), k * _log(d, 1, 3), math.sqrt(k * m)
    ),
    "RateState": _rock,
    "SmoothStateVariable": lambda d, f, k, m: laws.SmoothStateVariable(
        f, _log(d, 0, 2) * math.sqrt(k / m) / f, _log(d, 1, 3) * math.sqrt(k * m) / f
    ),
    "TimeDelay": lambda d, f, k, m: laws.TimeDelay(_line(d, f, k, m), _log(d, -2, 0) * math.sqrt(m / k)),
}


def _drive(draw: Draw, force: float, spring: float, mass: float) -> drives.Drive:
    natural, speed, far = math.sqrt(spring / mass) / (2 * math.pi), force / math.sqrt(spring * mass), _log(draw, 0, 1)
    fast = natural * _log(draw, -1, 0.5)
    return (
        drives.HarmonicForce(force * far, fast),
        drives.HarmonicBase(force / spring * far, fast),
        drives.MultiTone([(force / spring * far, fast, 0.0)], on="face"),
        drives.Belt(speed * _log(draw, -2, 0.5)),
        drives.Ramp(speed * _log(draw, -2, 0.5)),
        drives.Release(),
    )[draw.integers(6)]


def system(name: str, seed: int) -> tuple[ss.Oscillator, dict[str, float], float]:
    """A system under a law, its start, and twelve of its natural periods [s]."""
    draw = np.random.default_rng([seed, list(LAWS).index(name)])
    scales = force, spring, mass = _log(draw, -1, 2), _log(draw, 1, 5), _log(draw, -1, 1)
    drive = _drive(draw, *scales)
    damping = 2 * math.sqrt(spring * mass) * float(draw.choice([0.0, 0.01, 0.1]))
    start = {"x": force / spring * _log(draw, 0, 1.5)} if isinstance(drive, drives.Release) else {}
    made = ss.Oscillator(mass, spring, LAWS[name](draw, *scales), drive, damping)  # type: ignore[arg-type]
    return made, start, 12 * 2 * math.pi * math.sqrt(mass / spring)


def outcome(made: ss.Oscillator, start: dict[str, float], duration: float) -> tuple[str, str]:
    """What became of a system, in a word, and why."""
    begun = time.process_time()
    known = ss.compiled.compilation.seconds
    try:
        run = ss.simulate(made, duration=duration, start=start)
    except ss.errors.SolveError as error:
        return "refused", str(error)
    spent = time.process_time() - begun - (ss.compiled.compilation.seconds - known)
    left = ss.solve.energy(run).residual
    if not left < BALANCED:
        return "wrong", f"energy balances to {left:.1e}"
    return ("slow", f"{spent:.1f} s") if spent > SLOW else ("well", "")


def main() -> None:
    given = [int(word) for word in sys.argv[1:3]]
    seed, count = given + [1, 20][len(given) :]
    for name in LAWS:
        counts: Counter[str] = Counter()
        for own in range(seed * 100_000, seed * 100_000 + count):
            word, why = outcome(*system(name, own))
            counts[word] += 1
            if word != "well":
                print(f"  {name} {own}: {word}, {why[:160]}", flush=True)
        print(f"{name}: {dict(counts)}", flush=True)


if __name__ == "__main__":
    main()
