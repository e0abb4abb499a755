"""One second of the squeaking rig: the exact engine beside scipy's DOP853 with events, and how right both are.

    python benchmarks/squeak_model.py [rounds]

The wet, heavily loaded rig has three degrees of freedom and two contacts that slide, stick, lift off and close again
some hundred times a second while it squeaks. The engine's time is that of ``simulate``, the making of its tables
included; compiled code is loaded before the clock runs. DOP853 has each mode of the contacts as a matrix, made
beforehand, and is restarted at every event; it looks for one change of sign in a step, so that with long steps it jumps
over short flights whatever its tolerance. Both are compared with a third, slow run of the same rules: Taylor series of
30 terms in extended precision, in steps of 5 us. Errors are at the end, relative to the state there. Times are
processor time, one thread, medians of interleaved rounds.
"""

from __future__ import annotations

import itertools
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import stickslip as ss

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from squeak_peer import Modes, Rig, dop853, taylor

DURATION = 1.0  # s
PEERS = ((1e-6, 2e-4), (1e-12, 2e-4), (1e-8, 4e-5), (1e-8, 3e-5), (1e-12, 2e-5))  # tolerance, longest step [s]
WANTED = 50


def engine(rig: ss.Structure) -> tuple[list[Modes], np.ndarray]:
    run = ss.simulate(rig, duration=DURATION)
    names = [tuple(mode.name.split(" + ")) for mode in run.table.modes]
    return [names[m] for m in run.modes], run.sample([run.duration], ("x", "v"))[0][:, 0]


def clocked(work: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.process_time()
    result = work()
    return time.process_time() - begin, result


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    rig = ss.squeak.squeak_rig("wet", load=6.13)
    peer = Rig(rig)
    order, truth = taylor(Rig(rig, np.longdouble), DURATION)
    end = np.asarray(truth[:6], dtype=float)
    candidates: dict[str, Callable[[], Any]] = {"stickslip": lambda: engine(rig)}
    for rtol, longest in PEERS:
        name = f"DOP853, rtol {rtol:.0e}, steps to {1e6 * longest:.0f} us"
        candidates[name] = lambda r=rtol, s=longest: dop853(peer, DURATION, rtol=r, longest=s)
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    found = {"stickslip": engine(rig)}
    for _, (name, work) in itertools.product(range(rounds), candidates.items()):
        spent, found[name] = clocked(work)
        seconds[name].append(spent)
    own = statistics.median(seconds["stickslip"])
    print(f"{DURATION:g} s of the wet rig under 6.13 N: {len(order) - 1} changes of mode")
    print(f"{'':40} {'time':>9} {'ratio':>7}  error    changes of mode")
    right = {}
    for name, (modes, state) in found.items():
        spent, error = statistics.median(seconds[name]), np.max(np.abs((state[:6] - end) / end))
        missed = "all" if modes == order else f"others from {sum(1 for _ in matching(modes, order))} on"
        print(f"{name:40} {1e3 * spent:6.1f} ms {spent / own:6.1f}x  {error:.1e}  {missed}")
        if modes == order and name != "stickslip":
            right[name] = spent / own
    least = min(right.values())
    print(f"at equal accuracy: {least:.0f} times faster (wanted: {WANTED})")


def matching(modes: list[Modes], order: list[Modes]) -> Any:
    return itertools.takewhile(lambda pair: pair[0] == pair[1], zip(modes, order, strict=False))


if __name__ == "__main__":
    main()
