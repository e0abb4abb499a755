"""What does a new user wait for? Whole processes on a machine that has compiled nothing, and once it has.

    python benchmarks/first_runs.py [NAME ...]

Each cold process begins with an empty folder of compiled kernels; the warm one begins when everything that it had
compiled elsewhere is there. Seconds of the clock, and of the processor with all children.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from stickslip.whole import locked

RUN = """
import stickslip as ss
from stickslip import drives, laws
ss.simulate(ss.Oscillator(2.42, 2310.0, {law}, drives.HarmonicBase(2e-3, 2.5), 0.1), cycles=10)
"""
LAWS = {
    "Coulomb": "laws.Coulomb(1.1)",
    "CompliantContact": "laws.CompliantContact(1.1, 192000, 24.0)",
    "InertialContact": "laws.InertialContact(1.1, 192000, 0.01, 10.0)",
    "ElastoSlip": "laws.ElastoSlip.iwan(192000, width=1e-4, elements=6)",
    "Stribeck": "laws.Stribeck(1.1, 1.5, speed=0.01)",
    "LuGre": "laws.LuGre(1.1, 1.5, 0.01, 1e5, 100.0)",
    "Dahl": "laws.Dahl(1.1, 192000)",
    "StateVariable": "laws.StateVariable(1.1, 1e4)",
    "RateState": "laws.RateState(1.8, 0.6, 0.01, 0.012, 1e-4, 1e-3)",
    "TimeDelay": "laws.TimeDelay(laws.LinearSlope(1.1, slope=0.5), 0.01)",
}
JOBS = {
    "import": ["-c", "import stickslip"],
    **{name: ["-c", RUN.format(law=law)] for name, law in LAWS.items()},
    "a map of 20 x 20": [
        "-c",
        "import numpy as np, stickslip as ss\n"
        "s = ss.Oscillator(2.42, 2310.0, ss.laws.Coulomb(1.1), ss.drives.HarmonicBase(1e-3, 2.5), 0.1)\n"
        "ss.sweep(s, frequency=np.linspace(2, 9, 20), amplitude=np.linspace(5e-4, 2e-3, 20))",
    ],
    "stickslip demo": ["-m", "stickslip", "demo"],
}


def process(arguments: list[str], kept: Path) -> tuple[float, float]:
    """Seconds of the clock and of the processor that a process takes in a folder of its own."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as place:
        began = time.perf_counter()
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(kept), "MPLBACKEND": "Agg"}
        done = subprocess.run([sys.executable, *arguments], cwd=place, env=environment, capture_output=True)
        seconds = time.perf_counter() - began
    if done.returncode:
        sys.exit(done.stderr.decode())
    now = resource.getrusage(resource.RUSAGE_CHILDREN)
    return seconds, now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime


def quiet(kept: Path) -> None:
    """Wait until nothing is compiled any more."""
    time.sleep(3.0)  # by then the compiler's process has begun
    (kept / "kernels").mkdir(exist_ok=True)
    while (lock := locked(kept / "kernels")) is None:
        time.sleep(0.2)
    lock.close()


def main() -> None:
    chosen = sys.argv[1:] or list(JOBS)
    print(f"{'whole process':<20}{'cold [s]':>10}{'processor':>11}{'warm [s]':>10}{'processor':>11}")
    for name in chosen:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            kept = Path(folder)
            cold = process(JOBS[name], kept)
            quiet(kept)
            warm = process(JOBS[name], kept)
            quiet(kept)
        print(f"{name:<20}{cold[0]:10.2f}{cold[1]:11.2f}{warm[0]:10.2f}{warm[1]:11.2f}", flush=True)


if __name__ == "__main__":
    main()
