"""The engine beside general solvers and a floor in C, in one run: interleaved rounds, medians, accuracy printed too.

Run with ``python benchmarks/engine.py``. heyoka and numbalsoda are compared where they are installed (numbalsoda is
built from source, with gfortran: ``pip install scikit-build cmake ninja``, then ``pip install numbalsoda
--no-build-isolation``); the floor, one contact written out by hand, is compiled here. Then come the long random tests:
``--cases`` of energy, ``--replays`` in 40 digits.
"""

from __future__ import annotations

import argparse
import ctypes
import functools
import importlib.util
import math
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.solve.energies import energy

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-ffp-contract=fast", "-shared", "-fPIC")
MASS, SPRING = 2.42, 2310.0
RIGID = ss.Oscillator(
    mass=MASS,
    stiffness=SPRING,
    damping=2 * 0.0008 * math.sqrt(MASS * SPRING),
    law=ss.laws.Coulomb(1.1),
    drive=ss.drives.HarmonicBase(0.65e-3, 2.5),
)
CONTACT = ss.laws.CompliantContact(1.1, 192000, 2 * 0.0174 * math.sqrt(MASS * (SPRING + 192000)))
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
    jumps = isinstance(system.law, ss.laws.Coulomb) and system.drive.frequency == 5.61
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
        ahead = solve_ivp(
            field,
            (t, end),
            [x, v],
            method="DOP853",
            rtol=tolerance,
            atol=tolerance * 1e-4,
            events=exits,
            max_step=longest,
        )
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


@functools.cache
def taylor_integrators(system: ss.Oscillator, tolerance: float) -> dict[int, Any]:
    """heyoka's compiled integrators with terminal events: forward (1), back (-1) and held (0)."""
    import heyoka as hy

    m, k, c, w = system.mass, system.stiffness, system.damping, 2 * math.pi * system.drive.frequency
    level, up, down = system.law.kinetic, hy.event_direction.positive, hy.event_direction.negative
    x, v = hy.make_vars("x", "v")
    pull = k * (system.drive.amplitude * hy.cos(w * hy.time) - x)
    built = {
        side: hy.taylor_adaptive(
            [(x, v), (v, (pull - c * v - side * level) / m)],
            [0.0, 0.0],
            tol=tolerance,
            t_events=[hy.t_event(v, direction=down if side > 0 else up)],
        )
        for side in (1, -1)
    }
    compliant = isinstance(system.law, ss.laws.CompliantContact)
    force = system.law.stiffness * (x - hy.par[0]) + system.law.damping * v if compliant else pull
    field = [(x, v), (v, (pull - c * v - force) / m)] if compliant else [(x, 0.0 * v), (v, 0.0 * v)]
    exits = [hy.t_event(force - level, direction=up), hy.t_event(force + level, direction=down)]
    built[0] = hy.taylor_adaptive(field, [0.0, 0.0], tol=tolerance, pars=[0.0] * compliant, t_events=exits)
    return built


def heyoka(system: ss.Oscillator, cycles: int, tolerance: float = 1e-10) -> Run:
    """heyoka's Taylor method, restarted at every event; compilation is not counted.

    A released mass starts at 1e-15 m/s: from an exact double zero of the velocity the event finder stops at once.
    """
    integrators = taylor_integrators(system, tolerance)
    k, w, z, level = system.stiffness, 2 * math.pi * system.drive.frequency, system.drive.amplitude, system.law.kinetic
    stiff = getattr(system.law, "stiffness", None)
    end = cycles / system.drive.frequency
    t, x, v, anchor, times, modes = 0.0, 0.0, 0.0, 0.0, [], []
    side = 0 if stiff or abs(k * z) <= level else 1
    begin = time.process_time()
    while True:
        integrator = integrators[side]
        integrator.time = t
        integrator.state[:] = [x, v if v or not side else side * 1e-15]
        if stiff and not side:
            integrator.pars[0] = anchor
        integrator.reset_cooldowns()
        outcome = int(integrator.propagate_until(end)[0])
        t, x, v = integrator.time, float(integrator.state[0]), float(integrator.state[1])
        if t >= end:
            return Run(times, modes, time.process_time() - begin)
        if side:
            anchor, v = x - side * level / stiff if stiff else 0.0, 0.0
            needed = k * (z * math.cos(w * t) - x)
            side = 0 if stiff or abs(needed) <= level else int(math.copysign(1, needed))
        else:
            side = 1 if outcome == -1 else -1
        times.append(t)
        modes.append({0: "microstuck" if stiff else "stuck", 1: "forward", -1: "back"}[side])


@functools.cache
def soda_march() -> Callable[..., int]:
    """numbalsoda's DOP853 with events, restarted at every event, all of it compiled by numba."""
    import numba
    from numbalsoda import lsoda_sig, solve_ivp

    void = numba.types.void
    doubles = numba.types.CPointer(numba.types.double)

    # p: m, k, c, w, Z, level, K_y (0: rigid), its damping, side, anchor
    @numba.cfunc(lsoda_sig)
    def rate(t, u, du, p):
        force = p[8] * p[5] if p[8] != 0.0 else p[6] * (u[0] - p[9]) + p[7] * u[1]
        held = p[8] == 0.0 and p[6] == 0.0
        du[0] = 0.0 if held else u[1]
        du[1] = 0.0 if held else (p[1] * (p[4] * math.cos(p[3] * t) - u[0]) - p[2] * u[1] - force) / p[0]

    @numba.cfunc(void(numba.types.double, doubles, doubles, doubles))
    def exits(t, u, g, p):
        pull = p[1] * (p[4] * math.cos(p[3] * t) - u[0])
        force = p[6] * (u[0] - p[9]) + p[7] * u[1] if p[6] != 0.0 else pull
        g[0] = u[1] if p[8] != 0.0 else force - p[5]
        g[1] = 1.0 if p[8] != 0.0 else force + p[5]

    field, events = rate.address, exits.address

    @numba.njit
    def march(p, end, longest, tolerance, times, modes):
        state, t, count = np.zeros(2), 0.0, 0
        p[8] = 1.0 if p[6] == 0.0 and p[1] * p[4] > p[5] else 0.0
        while True:
            step = longest if p[8] == 0.0 and p[6] == 0.0 else longest * (p[10] == 1.0)
            solution = solve_ivp(
                field,
                np.array([t, end]),
                state,
                np.empty(0),
                "DOP853",
                2,
                events,
                p.ctypes.data,
                0.0,
                step,
                tolerance,
                tolerance * 1e-4,
            )
            if not solution.event_found:
                return count
            t = solution.t_event
            state[0], state[1] = solution.y_event[0], solution.y_event[1]
            if p[8] != 0.0:
                if p[6] != 0.0:
                    # a hair below the level: its event finder takes a crossing downwards as well
                    p[9] = state[0] - p[8] * p[5] / p[6] * (1.0 - 1e-12)
                pull = p[1] * (p[4] * math.cos(p[3] * t) - state[0])
                p[8] = 0.0 if p[6] != 0.0 or abs(pull) <= p[5] else math.copysign(1.0, pull)
                state[1] = 0.0
            else:
                p[8] = 1.0 if solution.ind_event == 0 else -1.0
            times[count], modes[count] = t, p[8]
            count += 1

    return march


def soda(system: ss.Oscillator, cycles: int, tolerance: float = 1e-10) -> Run:
    """The same march through numbalsoda; compilation is not counted. Steps are held where :func:`dop853` holds them."""
    law, drive = system.law, system.drive
    stiff, loss = getattr(law, "stiffness", 0.0), getattr(law, "damping", 0.0)
    jumps = not stiff and drive.frequency == 5.61
    p = np.array([system.mass, system.stiffness, system.damping, 2 * math.pi * drive.frequency, drive.amplitude,
                  law.kinetic, stiff, loss, 0.0, 0.0, float(jumps)])  # fmt: skip
    times, modes = np.zeros(24 * cycles), np.zeros(24 * cycles)
    march, end = soda_march(), cycles / drive.frequency
    begin = time.process_time()
    count = march(p, end, 0.05 / drive.frequency, tolerance, times, modes)
    seconds = time.process_time() - begin
    names = {0: "microstuck" if stiff else "stuck", 1: "forward", -1: "back"}
    return Run(list(times[:count]), [names[int(m)] for m in modes[:count]], seconds)


@functools.cache
def library() -> ctypes.CDLL:
    """The floor, compiled for this processor."""
    built = Path(tempfile.mkdtemp()) / "floor.so"
    source = Path(__file__).with_name("floor.c")
    subprocess.run(["cc", *FLAGS, "-o", str(built), str(source), "-lm"], check=True)
    loaded = ctypes.CDLL(str(built))
    loaded.run.restype = ctypes.c_long
    loaded.run.argtypes = [ctypes.c_double] * 9 + [ctypes.c_long] + [ctypes.c_void_p] * 2
    return loaded


def floor(system: ss.Oscillator, cycles: int) -> Run:
    """The same motion in C, for these contacts alone; every event's time and mode are kept."""
    law, drive, room = system.law, system.drive, 24 * cycles
    contact, loss = getattr(law, "stiffness", 0.0), getattr(law, "damping", 0.0)
    times, modes = np.zeros(room), np.zeros(room, np.int32)
    begin = time.process_time()
    count = library().run(
        system.mass,
        system.stiffness,
        system.damping,
        drive.amplitude,
        2 * math.pi * drive.frequency,
        law.kinetic,
        contact,
        loss,
        cycles,
        room,
        times.ctypes.data,
        modes.ctypes.data,
    )
    seconds = time.process_time() - begin
    if not 0 <= count <= room:
        raise RuntimeError(f"the floor found {count} events")
    names = {0: "microstuck" if contact else "stuck", 1: "forward", -1: "back"}
    kept = min(count, 50_000)
    return Run(list(times[:kept]), [names[int(m)] for m in modes[:kept]], seconds)


def distance(run: Run, reference: Run, period: float) -> str:
    """Sequence first, then the largest difference of an event's time over the period."""
    count = min(len(run.times), len(reference.times))
    if run.modes[:count] != reference.modes[:count]:
        first = next(j for j in range(count) if run.modes[j] != reference.modes[j])
        return f"sequence parts at event {first}"
    gap = np.max(np.abs(np.subtract(run.times[:count], reference.times[:count]))) / period
    return f"{count} events equal, times within {gap:.0e} T"


def progress(name: str, done: int, count: int) -> None:
    """One line that counts."""
    if sys.stderr.isatty() or done == count:
        print(f"\r{name}: {done} of {count}", end="\n" if done == count else "", file=sys.stderr, flush=True)


def random_energy(count: int) -> None:
    """Any law under any drive, scales over decades: what the energy balance leaves, and what does not run."""
    from test_engine import random_case

    residuals, refused = np.zeros(count), []
    begin = time.perf_counter()
    for seed in range(count):
        system, start, duration = random_case(seed)
        try:
            residuals[seed] = energy(ss.simulate(system, duration=duration, start=start)).residual
        except ss.errors.SolveError as error:
            refused.append((seed, str(error)))
        progress("random energy", seed + 1, count)
    above = np.flatnonzero(residuals >= 1e-12)
    print(
        f"energy of {count} random runs in {time.perf_counter() - begin:.0f} s: residual {np.median(residuals):.0e} in "
        f"the median, {np.max(residuals):.1e} at most, {len(above)} above 1e-12, {len(refused)} refused"
    )
    for seed in above[:10]:
        print(f"    seed {seed}: {residuals[seed]:.1e}, {random_case(int(seed))[0]}")
    for seed, reason in refused[:10]:
        print(f"    seed {seed}: {reason}")


def replays(count: int) -> None:
    """Random compliant contacts against a replay of 40 digits: the order of events first, then their times."""
    from test_engine import random_contact, replay

    wrong, gaps = [], []
    begin = time.perf_counter()
    for seed in range(count):
        system = random_contact(seed)
        run = ss.simulate(system, cycles=3)
        times, modes = replay(system, 3)
        names = [mode.name for mode in run.table.modes]
        if [names[m] for m in run.modes[1:]] != modes:
            wrong.append(seed)
        elif modes:
            gaps.append(float(np.max(np.abs(run.starts[1:] - times))) * system.drive.frequency)
        progress("40-digit replays", seed + 1, count)
    print(
        f"{count} replays of 40 digits in {time.perf_counter() - begin:.0f} s: {len(wrong)} of another sequence "
        f"{wrong[:10]}, times within {max(gaps, default=0.0):.0e} T"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--cycles", type=int, default=200_000, help="of the engine and the floor; scipy runs 20")
    parser.add_argument("--cases", type=int, default=10_000, help="random runs whose energy is balanced")
    parser.add_argument("--replays", type=int, default=200, help="random compliant runs replayed in 40 digits")
    options = parser.parse_args()
    speed(options.rounds, options.cycles)
    if options.cases:
        random_energy(options.cases)
    if options.replays:
        replays(options.replays)


def speed(rounds: int, cycles_: int) -> None:
    """Forcing cycles a second of each solver on each case."""
    solvers: dict[str, tuple[Callable[..., Run], int]] = {
        "stickslip": (engine, cycles_), "C floor": (floor, cycles_), "scipy DOP853": (dop853, 20),
        "heyoka": (heyoka, 400), "numbalsoda": (soda, 400),
    }  # fmt: skip
    if shutil.which("cc") is None:
        print("no C compiler (cc): no floor")
        del solvers["C floor"]
    for peer in ("heyoka", "numbalsoda"):
        if importlib.util.find_spec(peer) is None:
            print(f"{peer} is not installed: not compared")
            del solvers[peer]
    speeds = {case: {solver: [] for solver in solvers} for case in CASES}
    for case, system in CASES.items():
        for run, _ in solvers.values():
            run(system, 10)
        for _ in range(rounds):
            for solver, (run, cycles) in solvers.items():
                speeds[case][solver].append(cycles / run(system, cycles).seconds)
    print(f"forcing cycles a second of CPU time, medians of {rounds} interleaved rounds; peers at 1e-10")
    for case, system in CASES.items():
        medians = {solver: statistics.median(speeds[case][solver]) for solver in solvers}
        print(f"{case:24}" + "".join(f"{solver} {speed:,.0f}   " for solver, speed in medians.items()))
        for solver in list(solvers)[1:]:
            ratio = medians["stickslip"] / medians[solver]
            if solver == "C floor":
                check = distance(engine(system, 2000), floor(system, 2000), 1 / system.drive.frequency)
                print(f"{'':24}{ratio:8.2f} of the floor; {check}")
                continue
            tight = solvers[solver][0](system, 20, 1e-12 if solver == "scipy DOP853" else 1e-13)
            check = distance(engine(system, 20), tight, 1 / system.drive.frequency)
            print(f"{'':24}{ratio:8,.0f} times {solver}; against it run tight: {check}")


if __name__ == "__main__":
    main()
