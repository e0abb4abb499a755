"""What does a new user wait for? Whole processes where nothing is compiled yet, and once it is.

    python benchmarks/first_runs.py [NAME ...]

Seconds of the processor. Each cold process begins with an empty folder of compiled kernels; beside it stands by the
clock how long another process, which it does not wait for, went on to compile.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from stickslip.compiled import LOCK

RUN = """
import stickslip as ss
from stickslip import drives, laws
ss.simulate(ss.Oscillator(2.42, 2310.0, {law}, drives.HarmonicBase(2e-3, 2.5), 0.1), cycles=10)
"""
LAWS = {
    "Coulomb": "laws.Coulomb(1.1)",
    "CompliantContact": "laws.CompliantContact(1.1, 192000, 24.0)",
    "ElastoSlip": "laws.ElastoSlip.iwan(192000, width=1e-4, elements=6)",
    "StateVariable": "laws.StateVariable(1.1, 1e4)",
    "Stribeck": "laws.Stribeck(1.1, 1.5, speed=0.01)",
    "LuGre": "laws.LuGre(1.1, 1.5, 0.01, 1e5, 100.0)",
    "LuGre, stiff": "laws.LuGre(1.1, 1.5, 0.01, 1e8, 1e4)",
    "RateState": "laws.RateState(1.8, 0.6, 0.01, 0.012, 1e-4, 1e-3)",
    "TimeDelay": "laws.TimeDelay(laws.LinearSlope(1.1, slope=0.5), 0.01)",
}
MAP = """
import numpy as np, stickslip as ss
system = ss.Oscillator(2.42, 2310.0, ss.laws.Coulomb(1.1), ss.drives.HarmonicBase(1e-3, 2.5), 0.1)
ss.sweep(system, {"frequency": np.linspace(2, 9, 20), "amplitude": np.linspace(5e-4, 2e-3, 20)})
"""
JOBS = {"import": "import stickslip", **{name: RUN.format(law=law) for name, law in LAWS.items()}, "map": MAP}


def seconds(job: str, kept: str) -> float:
    """Of the processor, that a process takes beside a folder of compiled kernels."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", job], env={**os.environ, "NUMBA_CACHE_DIR": kept}, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def beside(kept: str) -> float:
    """How long another process goes on to compile [s]."""
    began = time.perf_counter()
    while (Path(kept) / "kernels" / LOCK).exists():
        time.sleep(0.05)
    return time.perf_counter() - began


if __name__ == "__main__":
    print(f"{'whole process':20}{'cold [s]':>10}{'beside [s]':>12}{'warm [s]':>10}")
    for name in sys.argv[1:] or JOBS:
        with tempfile.TemporaryDirectory() as kept:
            cold, rest, warm = seconds(JOBS[name], kept), beside(kept), seconds(JOBS[name], kept)
        print(f"{name:20}{cold:10.2f}{rest:12.1f}{warm:10.2f}", flush=True)
