"""The engine beside general solvers, in one run: interleaved rounds, medians, accuracy printed with every figure.

Run with ``python benchmarks/engine.py``. Peers that are not installed (heyoka, numbalsoda) are named as absent.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

import stickslip as ss

MASS, SPRING = 2.42, 2310.0
RIGID = ss.Oscillator(
    mass=MASS, stiffness=SPRING, damping=2 * 0.0008 * math.sqrt(MASS * SPRING), law=ss.Coulomb(1.1),
    drive=ss.HarmonicBase(0.65e-3, 2.5),
)  # fmt: skip
CONTACT = ss.CompliantContact(1.1, 192000, 2 * 0.0174 * math.sqrt(MASS * (SPRING + 192000)))
CASES = {
    "W1a rigid 5.61 Hz": RIGID.having(frequency=5.61, amplitude=0.6e-3),
    "W1b rigid 2.5 Hz": RIGID,
    "W1c rigid 8.7 Hz": RIGID.having(frequency=8.7, amplitude=1.1e-3),
    "W2a compliant 5.61 Hz": RIGID.having(frequency=5.61, amplitude=0.6e-3, law=CONTACT),
    "W2b compliant 2.5 Hz": RIGID.having(law=CONTACT),
}


@dataclass(frozen=True)
class Run:
    """Events [s] with the mode entered, and the CPU time it took [s]."""

    times: list[float]
    modes: list[str]
    seconds: float


def engine(system: ss.Oscillator, cycles: int) -> Run:
    begin = time.process_time()
    run = ss.simulate(system, cycles=cycles)
    seconds = time.process_time() - begin
    names = [mode.name for mode in run.table.modes]
    return Run(list(run.starts[1:]), [names[m] for m in run.modes[1:]], seconds)


def dop853(system: ss.Oscillator, cycles: int, tolerance: float = 1e-10) -> Run:
    """scipy's DOP853, restarted at every event of the same law, written out by hand.

    At 5.61 Hz its free steps jump over a stick on the rigid contact (it looks for one sign change in a step), so there
    a step is held below a twentieth of the period.
    """
    jumps = isinstance(system.law, ss.Coulomb) and system.drive.frequency == 5.61
    longest = 0.05 / system.drive.frequency if jumps else math.inf
    m, k, c, w = system.mass, system.stiffness, system.damping, 2 * math.pi * system.drive.frequency
    z, level = system.drive.amplitude, system.law.kinetic
    stiff = getattr(system.law, "stiffness", None)
    loss = getattr(system.law, "damping", 0.0)
    end = cycles / system.drive.frequency
    begin = time.process_time()

    def pull(t: float, x: float, v: float) -> float:
        return k * (z * math.cos(w * t) - x) - c * v

    def slope(t, s, friction):
        return [s[1], (pull(t, s[0], s[1]) - friction(s)) / m]

    def terminal(function, direction):
        function.terminal, function.direction = True, direction
        return function

    t, x, v, anchor, times, modes = 0.0, 0.0, 0.0, 0.0, [], []
    needed = pull(0.0, 0.0, 0.0)
    side = 0 if stiff or abs(needed) <= level else int(math.copysign(1, needed))
    while t < end:
        if side:
            friction, exits = (lambda s, f=side * level: f), [terminal(lambda t, s: s[1], -side)]
        elif stiff is None:
            exits = [terminal(lambda t, s, j=j: j * pull(t, s[0], 0.0) - level, 1) for j in (1, -1)]
            friction = None
        else:

            def friction(s, a=anchor):
                return stiff * (s[0] - a) + loss * s[1]

            exits = [terminal(lambda t, s, j=j, f=friction: j * f(s) - level, 1) for j in (1, -1)]
        field = (lambda t, s: [0.0, 0.0]) if friction is None else (lambda t, s, f=friction: slope(t, s, f))
        ahead = solve_ivp(field, (t, end), [x, v], method="DOP853", rtol=tolerance, atol=tolerance * 1e-4, events=exits,
                          max_step=longest)  # fmt: skip
        t, (x, v) = float(ahead.t[-1]), ahead.y[:, -1]
        if ahead.status != 1:
            break
        if side:
            anchor, v = x - side * level / stiff if stiff else 0.0, 0.0
            needed = pull(t, x, 0.0)
            side = 0 if stiff or abs(needed) <= level else int(math.copysign(1, needed))
        else:
            side = 1 if len(ahead.t_events[0]) else -1
        times.append(t)
        held = "stuck" if stiff is None else "microstuck"
        modes.append({0: held, 1: "forward", -1: "back"}[side])
    return Run(times, modes, time.process_time() - begin)


def distance(run: Run, reference: Run, period: float) -> str:
    """Sequence first, then the largest difference of an event's time over the period."""
    count = min(len(run.times), len(reference.times))
    if run.modes[:count] != reference.modes[:count]:
        first = next(j for j in range(count) if run.modes[j] != reference.modes[j])
        return f"sequence parts at event {first}"
    gap = np.max(np.abs(np.subtract(run.times[:count], reference.times[:count]))) / period
    return f"{count} events equal, times within {gap:.0e} T"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--cycles", type=int, default=200_000, help="of the engine; scipy runs 20")
    options = parser.parse_args()
    solvers: dict[str, tuple[Callable[[ss.Oscillator, int], Run], int]] = {
        "stickslip": (engine, options.cycles), "scipy DOP853 1e-10": (dop853, 20)
    }  # fmt: skip
    for absent in ("heyoka", "numbalsoda"):
        if importlib.util.find_spec(absent) is None:
            print(f"{absent} is not installed: not compared")
    speeds = {case: {solver: [] for solver in solvers} for case in CASES}
    for case, system in CASES.items():
        engine(system, 100)
        for _ in range(options.rounds):
            for solver, (run, cycles) in solvers.items():
                speeds[case][solver].append(cycles / run(system, cycles).seconds)
    print(f"{'':24}{'stickslip':>16}{'scipy DOP853':>16}{'ratio':>10}   cycles/s per core, medians of {options.rounds}")
    for case, system in CASES.items():
        fast, slow = (statistics.median(speeds[case][solver]) for solver in solvers)
        check = distance(engine(system, 20), dop853(system, 20, 1e-12), 1 / system.drive.frequency)
        print(f"{case:24}{fast:16,.0f}{slow:16,.1f}{fast / slow:10,.0f}   against DOP853 1e-12: {check}")


if __name__ == "__main__":
    main()
