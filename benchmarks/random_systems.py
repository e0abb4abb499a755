"""How many systems drawn at random over laws and drives are refused, take long, or do not keep their energy?

    python benchmarks/random_systems.py [SEED [COUNT [LAW ...]]]

A third of them is extreme: numbers that are drawn over decades are drawn over three times as many. Wrong is a run whose
work does not balance to 1e-6, or that ends in anything but a SolveError. What numba compiles does not count as time.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Callable

import numpy as np

import stickslip as ss
import stickslip.compiler
from stickslip import drives, laws

SLOW = 10.0  # s of processor
BALANCED = 1e-6

Scales = tuple[float, float, float]  # friction [N], spring [N/m], mass [kg]


class Draw(np.random.Generator):
    """Random numbers, with decades as many times as wide as `wide`."""

    wide = 1.0


def _log(draw: Draw, low: float, high: float) -> float:
    middle, half = (low + high) / 2, (high - low) / 2 * draw.wide
    return float(10.0 ** draw.uniform(middle - half, middle + half))


def _compliant(draw: Draw, force: float, spring: float, mass: float) -> laws.CompliantContact:
    stiffness = spring * _log(draw, 0.5, 3)
    damping = _log(draw, -2, 0) * math.sqrt(stiffness * mass)
    static = force * float(draw.uniform(1, 1.5))
    return laws.CompliantContact(force, stiffness, damping, static, rule=str(draw.choice(["literal", "consistent"])))


def _rock(draw: Draw, force: float, spring: float, mass: float) -> laws.RateState:
    # the law takes no smaller one: its exponential is a number
    direct, speed = 0.6 / min(_log(draw, 0.5, 2), 300.0), force / math.sqrt(spring * mass)
    distance = force / spring * _log(draw, -4, -1)
    which = str(draw.choice(["aging", "slip"]))
    return laws.RateState(
        force / 0.6, 0.6, direct, direct * float(draw.uniform(0.5, 2)), distance, speed * _log(draw, -4, -1), law=which
    )


def _behind(draw: Draw, force: float, spring: float, mass: float) -> laws.InSeries:
    curve = laws.Stribeck(force, force * 1.4, speed=force / math.sqrt(spring * mass) * _log(draw, -2, 0))
    steepest = math.sqrt(2 / math.e) * 0.4 * force / curve.speed  # of Gauss's curve: it is the least damping
    return laws.InSeries(curve, spring * _log(draw, 0.5, 3), steepest * (1.1 + _log(draw, -1, 1)))


def _line(draw: Draw, force: float, spring: float, mass: float) -> laws.LinearSlope:
    return laws.LinearSlope(force, slope=math.sqrt(spring * mass) * float(draw.uniform(-0.05, 0.5)))


def _table(draw: Draw, force: float, spring: float, mass: float) -> laws.Tabulated:
    speeds = np.append(0.0, np.cumsum([_log(draw, -2, 0) for _ in range(6)])) * force / math.sqrt(spring * mass)
    return laws.Tabulated(tuple(speeds), tuple(force * draw.uniform(0.5, 1.5, 7)))


def _rough(draw: Draw, force: float, spring: float, mass: float) -> laws.RoughSurface:
    span = force / spring * _log(draw, 0, 1)
    return laws.RoughSurface(
        laws.Coulomb(force), float(draw.uniform(0.01, 0.1)), span / 20, span, int(draw.integers(99))
    )


def _recorded(draw: Draw, size: float, frequency: float) -> drives.Recorded:
    count = math.ceil(13 / frequency * 20 * frequency)
    return drives.Recorded(size * np.cumsum(draw.normal(0, 0.2, count)), fs=20 * frequency, on="base")


def _profile(draw: Draw, speed: float, frequency: float) -> drives.SpeedProfile:
    times = np.append(0.0, np.cumsum(draw.uniform(0.2, 2.0, 6))) / frequency
    return drives.SpeedProfile(times, speed * draw.normal(0, 1, 7), on=str(draw.choice(["base", "face"])))


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
    "Tabulated": _table,
    "FrictionCurve": lambda d, f, k, m: laws.FrictionCurve(
        laws.formula.Formula(f"{f} * (1 + 0.5 / (1 + v / {f / math.sqrt(k * m) * _log(d, -2, 0)}))"), f * 1.5
    ),
    "RoughSurface": _rough,
    "InSeries": lambda d, f, k, m: laws.InSeries(_line(d, f, k, m), k * _log(d, 0.5, 3), math.sqrt(k * m)),
    "InSeries Stribeck": _behind,
    "InSeries Dahl": lambda d, f, k, m: laws.InSeries(
        laws.Dahl(f, k * _log(d, 0.5, 3)), k * _log(d, 0.5, 3), math.sqrt(k * m) * float(d.choice([0.0, 1.0]))
    ),
    "InSeries state variable": lambda d, f, k, m: laws.InSeries(
        laws.SmoothStateVariable(f, _log(d, 0, 2) * math.sqrt(k / m) / f, _log(d, 1, 3) * math.sqrt(k * m) / f),
        k * _log(d, 0.5, 3),
        math.sqrt(k * m),
    ),
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
        drives.HarmonicBase(force / spring * far, fast, contact="base"),
        drives.MultiTone([(force / spring * far, fast, 0.3), (force / spring, math.sqrt(2) * fast, 0.0)], on="base"),
        drives.Dithered(drives.Belt(speed), force / spring * 0.01, fast * 20),
        _recorded(draw, force / spring, natural),
        _profile(draw, speed, natural),
    )[draw.integers(11)]


def system(name: str, seed: int) -> tuple[ss.Oscillator, dict[str, float], float]:
    """A system under a law, its start, and twelve of its natural periods [s]."""
    draw = Draw(np.random.PCG64([seed, list(LAWS).index(name)]))
    draw.wide = 3.0 if seed % 3 == 0 else 1.0
    scales = force, spring, mass = _log(draw, -1, 2), _log(draw, 1, 5), _log(draw, -1, 1)
    drive = _drive(draw, *scales)
    damping = 2 * math.sqrt(spring * mass) * float(draw.choice([0.0, 0.01, 0.1]))
    start = {"x": force / spring * _log(draw, 0, 1.5)} if isinstance(drive, drives.Release) else {}
    made = ss.Oscillator(mass, spring, LAWS[name](draw, *scales), drive, damping)  # type: ignore[arg-type]
    return made, start, 12 * 2 * math.pi * math.sqrt(mass / spring)


def outcome(made: ss.Oscillator, start: dict[str, float], duration: float) -> tuple[str, str]:
    """What became of a system, in a word, and why."""
    begun = time.process_time()
    known = ss.compiler.compilation.seconds

    def stop(share: float) -> None:
        spent = time.process_time() - begun - (ss.compiler.compilation.seconds - known)
        if spent > SLOW and share < 1.0:
            raise InterruptedError(f"{spent / max(share, 1e-12):.1e} s in all, foretold")

    try:
        run = ss.simulate(made, duration=duration, start=start, progress=stop)
    except InterruptedError as error:
        return "slow", str(error)
    except ss.errors.SolveError as error:
        return "refused", str(error)
    except (ArithmeticError, LookupError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        return "wrong", f"{type(error).__name__}: {error}"
    spent = time.process_time() - begun - (ss.compiler.compilation.seconds - known)
    left = ss.solve.energy(run).residual
    if not left < BALANCED:
        return "wrong", f"energy balances to {left:.1e}"
    return ("slow", f"{spent:.1f} s") if spent > SLOW else ("well", "")


def main() -> None:
    given = [int(word) for word in sys.argv[1:3]]
    seed, count = given + [1, 20][len(given) :]
    for name in sys.argv[3:] or LAWS:
        counts: Counter[str] = Counter()
        for own in range(seed * 100_000, seed * 100_000 + count):
            word, why = outcome(*system(name, own))
            counts[word] += 1
            if word != "well":
                print(f"  {name} {own}: {word}, {why[:160]}", flush=True)
        print(f"{name}: {dict(counts)}", flush=True)


if __name__ == "__main__":
    main()
