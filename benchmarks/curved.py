"""Curved laws beside general solvers, in one run: interleaved rounds, medians of CPU time, accuracy beside each.

Run with ``python benchmarks/curved.py``. Every solver runs at the loosest of its tolerances that keeps the error of
the state after 100 cycles, relative to the drive's amplitude, below 1e-8. All restart where the velocity turns if the
law has a kink there. heyoka (if installed) needs a guard on its step where an exponential sleeps: 1 ms.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import statistics
import time
from collections.abc import Callable

import numpy as np
from scipy.integrate import DOP853, LSODA, solve_ivp

import stickslip as ss

M, K, CYCLES, GOAL = 2.42, 2310.0, 100, 1e-8
SLIDER = ss.Oscillator(
    mass=M,
    stiffness=K,
    law=ss.laws.SmoothStateVariable(1.1, rate=100.0, steepness=3000.0),
    drive=ss.drives.HarmonicBase(0.6e-3, 2.5),
)
CASES = {
    "state variable, 2.5 Hz": SLIDER,
    "LuGre, 2.5 Hz": SLIDER.having(law=ss.laws.LuGre(1.1, 1.3, speed=1e-3, stiffness=192000, damping=24, viscous=0.4)),
    "Stribeck, 8.7 Hz": SLIDER.having(
        law=ss.laws.Stribeck(1.1, 1.3, speed=1e-3, viscous=0.4), frequency=8.7, amplitude=1.5e-3
    ),
}
TOLERANCES = {"stickslip": (1e-5, 1e-6, 1e-7, 1e-8, 1e-9), "scipy LSODA": (1e-8, 1e-9, 1e-10, 1e-11, 1e-12),
              "scipy DOP853": (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11), "heyoka": (1e-8, 1e-9, 1e-10, 1e-12)}  # fmt: skip
Solver = Callable[[ss.Oscillator, float], tuple[float, np.ndarray]]


def engine(system: ss.Oscillator, tolerance: float) -> tuple[float, np.ndarray]:
    begin = time.process_time()
    run = ss.simulate(system, cycles=CYCLES, rtol=tolerance)
    end = run.state(run.duration)
    return time.process_time() - begin, np.array([end["x"], end["v"]])


def rates(system: ss.Oscillator) -> Callable[[float, np.ndarray, float], list[float]]:
    """The equations written out by hand, as a user of a general solver would."""
    law, w, z = system.law, 2 * math.pi * system.drive.frequency, system.drive.amplitude
    cos, exp, tanh = math.cos, math.exp, math.tanh
    if isinstance(law, ss.laws.SmoothStateVariable):
        f, pull, steep = law.kinetic, law.kinetic * law.rate, law.steepness
        return lambda t, s, side: [
            s[1],
            (K * (z * cos(w * t) - s[0]) - s[2]) / M,
            -pull * (s[2] - f * tanh(steep * s[1])),
        ]
    if isinstance(law, ss.laws.LuGre):
        stiff, loss, oil = law.stiffness, law.damping, law.viscous

        def bristles(t: float, s: np.ndarray, side: float) -> list[float]:
            x, v, b = s
            level = law.kinetic + (law.static - law.kinetic) * exp(-((v / law.speed) ** 2))
            rate = v - stiff * side * v * b / level
            return [v, (K * (z * cos(w * t) - x) - stiff * b - loss * rate - oil * v) / M, rate]

        return bristles

    def stribeck(t: float, s: np.ndarray, side: float) -> list[float]:
        x, v = s
        level = law.kinetic + (law.static - law.kinetic) * exp(-((v / law.speed) ** 2))
        return [v, (K * (z * cos(w * t) - x) - side * level - law.viscous * v) / M]

    return stribeck


def general(method: type) -> Solver:
    def solve(system: ss.Oscillator, tolerance: float) -> tuple[float, np.ndarray]:
        slope, end = rates(system), CYCLES / system.drive.frequency
        size = 2 if isinstance(system.law, ss.laws.Stribeck) else 3
        kink = not isinstance(system.law, ss.laws.SmoothStateVariable)

        def turn(t: float, s: np.ndarray, side: float) -> float:
            return s[1] if t > since[0] else side  # a zero at the very start of a step breaks solve_ivp

        turn.terminal = True
        since = [1e-9]
        begin = time.process_time()
        t, state, side = 0.0, np.zeros(size), 1.0
        while t < end:
            turn.direction = -side
            run = solve_ivp(
                slope,
                (t, end),
                state,
                method=method,
                rtol=tolerance,
                atol=tolerance * 1e-6,
                args=(side,),
                events=turn if kink else None,
            )
            t, state = run.t[-1], run.y[:, -1]
            if t < end:
                state[1], side, since[0] = 0.0, -side, t + 1e-9
        return time.process_time() - begin, state[:2]

    return solve


def heyoka(system: ss.Oscillator, tolerance: float) -> tuple[float, np.ndarray]:
    import heyoka as hy

    key = (id(system), tolerance)
    if key not in COMPILED:
        law, w, z = system.law, 2 * math.pi * system.drive.frequency, system.drive.amplitude
        x, v, b = hy.make_vars("x", "v", "b")
        side = hy.par[0]
        pull = K * (z * hy.cos(w * hy.time) - x)
        if isinstance(law, ss.laws.SmoothStateVariable):
            rate = -law.kinetic * law.rate * (b - law.kinetic * hy.tanh(law.steepness * v))
            equations, force = [(b, rate)], b
        else:
            level = law.kinetic + (law.static - law.kinetic) * hy.exp(-(v * v) / law.speed**2)
            if isinstance(law, ss.laws.LuGre):
                rate = v - law.stiffness * side * v * b / level
                equations, force = [(b, rate)], law.stiffness * b + law.damping * rate + law.viscous * v
            else:
                equations, force = [], side * level + law.viscous * v

        def turned(ta: object, sign: int) -> bool:
            ta.pars[0] = -ta.pars[0]
            ta.state[1] = 1e-14 * ta.pars[0]  # a step from exactly zero under an event ends in NaN
            return True

        smooth = isinstance(law, ss.laws.SmoothStateVariable)
        extra = {} if smooth else {"t_events": [hy.t_event(v, callback=turned)], "pars": [1.0]}
        COMPILED[key] = hy.taylor_adaptive(
            [(x, v), (v, (pull - force) / M), *equations], [0.0] * (2 + len(equations)), tol=tolerance, **extra
        )
    stepper = COMPILED[key]
    stepper.time = 0.0
    stepper.state[:] = 0.0
    if stepper.with_events:
        stepper.pars[0], stepper.state[1] = 1.0, 1e-14
        stepper.reset_cooldowns()
    end = CYCLES / system.drive.frequency
    begin = time.process_time()
    stepper.propagate_until(end, max_delta_t=1e-3)
    return time.process_time() - begin, np.array(stepper.state[:2])


COMPILED: dict[tuple[int, float], object] = {}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    solvers: dict[str, Solver] = {
        "stickslip": engine, "scipy LSODA": general(LSODA), "scipy DOP853": general(DOP853), "heyoka": heyoka
    }  # fmt: skip
    if importlib.util.find_spec("heyoka") is None:
        print("heyoka is not installed: not compared")
        del solvers["heyoka"]
    print(f"{'':24}{'':14}{'tolerance':>10}{'error':>10}{'cycles/s':>12}{'stickslip is':>14}")
    for case, system in CASES.items():
        true = engine(system, 1e-14)[1]
        scale = system.drive.amplitude * np.array([1, 2 * math.pi * system.drive.frequency])
        chosen, errors = {}, {}
        for name, solve in solvers.items():
            for tolerance in TOLERANCES[name]:
                error = float(np.max(np.abs(solve(system, tolerance)[1] - true) / scale))
                chosen[name], errors[name] = tolerance, error
                if error < GOAL:
                    break
        speeds: dict[str, list[float]] = {name: [] for name in solvers}
        for _ in range(options.rounds):
            for name, solve in solvers.items():
                speeds[name].append(CYCLES / solve(system, chosen[name])[0])
        own = statistics.median(speeds["stickslip"])
        for name in solvers:
            speed = statistics.median(speeds[name])
            print(f"{case:24}{name:14}{chosen[name]:10.0e}{errors[name]:10.1e}{speed:12,.0f}{own / speed:13,.1f}x")


if __name__ == "__main__":
    main()
