"""A regime map beside general solvers and a floor in C, in one run; and how time and memory grow with the map.

Run with ``python benchmarks/sweep.py``. The map is 200 x 200 points of the rigid oscillator over forcing frequency and
friction, 250 periods each. The floor, heyoka and scipy run a part of its points; all are counted in oscillator-periods
per second of processor time.
"""

from __future__ import annotations

import argparse
import importlib.util
import resource
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

import engine
import numpy as np

import stickslip as ss

SETTLE, CYCLES = 200, 50
PULL = engine.SPRING * 0.65e-3  # N, of the spring's end on the mass
Run = Callable[[ss.Oscillator, int], engine.Run]


def grid(side: int) -> dict[str, Any]:
    """Forcing from 0.3 to 2 natural frequencies, friction from 0.05 to 0.95 of the pull."""
    frequency = engine.RIGID.frequency
    return {"frequency": np.linspace(0.3, 2, side) * frequency, "kinetic": np.linspace(0.05, 0.95, side) * PULL}


def mapped(values: dict[str, Any], name: str) -> tuple[Any, float, float]:
    """The map, and the processor and wall time it took [s]."""
    begin, clock = time.process_time(), time.perf_counter()
    swept = ss.sweep(engine.RIGID, values, measures=["stops"], settle=SETTLE, cycles=CYCLES, engine=name)
    return swept, time.process_time() - begin, time.perf_counter() - clock


def points(values: dict[str, Any], step: int) -> Iterator[tuple[int, int, ss.Oscillator]]:
    """Every `step`-th point along both axes, from the middle of the first step on."""
    for i in range(step // 2, len(values["frequency"]), step):
        for j in range(step // 2, len(values["kinetic"]), step):
            f, level = float(values["frequency"][i]), float(values["kinetic"][j])
            yield i, j, engine.RIGID.having(frequency=f, kinetic=level)


def stops(run: engine.Run, frequency: float) -> tuple[float, float]:
    """Normal and abnormal stops per period of the measured part of an event list."""
    counts, side, held = [0, 0], 0, False
    for instant, mode in zip(run.times, run.modes, strict=True):
        if mode == "stuck":
            held = True
            continue
        now = 1 if mode == "forward" else -1
        if held and side and instant * frequency >= SETTLE:
            counts[int(now == side)] += 1
        side, held = now, False
    return counts[0] / CYCLES, counts[1] / CYCLES


def speed(run: Run, values: dict[str, Any], step: int, cycles: int) -> float:
    """Oscillator-periods per second of processor time, over some points of the map."""
    seconds = [run(system, cycles).seconds for _, _, system in points(values, step)]
    return len(seconds) * cycles / sum(seconds)


def agreement(found: Any, values: dict[str, Any]) -> str:
    """How many of the floor's stops are those of the map."""
    same, total = 0, 0
    for i, j, system in points(values, 10):
        here = float(found.normal_stops[i, j]), float(found.abnormal_stops[i, j])
        same += here == stops(engine.floor(system, SETTLE + CYCLES), float(values["frequency"][i]))
        total += 1
    return f"{same} of {total}"


def growth(sizes: list[int]) -> None:
    """Time and memory as the map grows, 20 periods a point."""
    print("\npoints   microseconds a point (processor)   most memory [MB]")
    for size in sizes:
        side = round(size**0.5)
        begin = time.process_time()
        ss.sweep(engine.RIGID, grid(side), measures=["stops", "amplitude"], settle=15, cycles=5, engine="threads")
        seconds = time.process_time() - begin
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{side * side:8d}   {seconds / side**2 * 1e6:8.1f}   {memory:8.0f}", flush=True)


def main() -> None:
    """Print every figure."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--side", type=int, default=200, help="points along each axis of the map")
    options.add_argument("--rounds", type=int, default=3, help="interleaved rounds")
    options.add_argument("--largest", type=int, default=1_000_000, help="points of the largest map of the growth")
    asked = options.parse_args()
    values, total = grid(asked.side), asked.side**2 * (SETTLE + CYCLES)
    small = {name: column[:: asked.side // 4] for name, column in values.items()}
    mapped(small, "serial")
    engine.floor(engine.RIGID, 10)
    others: dict[str, tuple[Run, int, int]] = {
        "C floor": (engine.floor, asked.side // 20, SETTLE + CYCLES),
        "scipy DOP853": (engine.dop853, asked.side // 2, 20),
    }
    if importlib.util.find_spec("heyoka") is not None:
        others["heyoka"] = (engine.heyoka, asked.side // 3, SETTLE + CYCLES)
        for _, _, system in points(values, asked.side // 3):
            engine.heyoka(system, 1)  # compiled before it is timed
    rates: dict[str, list[float]] = {name: [] for name in ("one core", *others)}
    gains = []
    for _ in range(asked.rounds):
        one, seconds, wall = mapped(values, "serial")
        rates["one core"].append(total / seconds)
        two, _, both = mapped(values, "threads://2")
        gains.append(wall / both)
        for name, (run, step, cycles) in others.items():
            rates[name].append(speed(run, values, step, cycles))
    own = statistics.median(rates["one core"])
    print(f"{asked.side} x {asked.side} map, {SETTLE + CYCLES} periods each: {total / own:.2f} s of one processor")
    print("(the map skips and counts the laps that only repeat; the others march every lap, at a part of the points)")
    for name, found in rates.items():
        rate = statistics.median(found)
        print(f"{name:14s} {rate:12.4g} oscillator-periods/s; the map is {own / rate:.3g} times as fast")
    print(f"two threads: {statistics.median(gains):.2f} times as fast by the clock ({gains})")
    same = all(one[name].values.tobytes() == two[name].values.tobytes() for name in one.data_vars)
    print(f"one and two threads, byte by byte: {'equal' if same else 'DIFFERENT'}")
    print(f"stops as the floor counts them: {agreement(one, values)} points")
    growth([size for size in (1_000, 10_000, 100_000, 1_000_000) if size <= asked.largest])


if __name__ == "__main__":
    main()
