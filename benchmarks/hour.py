"""An hour of four channels at 4 kHz in bounded memory: sticks minute after minute, or all of `stickslip analyze`.

``python benchmarks/hour.py [--minutes 60] [--analyze]``: the thesis's rig in stick-slip at 2.5 Hz, the same minute
again and again with new noise, never more than a stretch of it in memory. With ``--analyze`` it is written to Parquet
first, and analysed by the command line in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import stickslip as ss

RIG = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.1196}
LAG = 0.0389 / 30.91
FS, PART = 4000, 60.0
CONFIG = """
mass = 2.42
stiffness = 2310
damping = 0.1196
[channels]
x = "x [m]"
z = "z [m]"
a = "a [m/s^2]"
load = "load [N]"
[sensors]
x = { delay = "1.2585 ms" }
z = { delay = "1.2585 ms" }
a = { mount = ["125 Hz", 0.1] }
load = { mount = ["250 Hz", 0.05], inertia = "50 g", discharge = "50 s" }
"""
COMMAND = """
import re, sys
from stickslip.cli.program import main
try:
    main()
finally:
    print(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1], file=sys.stderr)
"""


def parts(minutes: int) -> Iterator[ss.Record]:
    """Minute after minute: whole cycles, so that each goes on where the one before ended."""
    contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    slider = ss.Oscillator(law=contact, drive=ss.drives.HarmonicBase(0.65e-3, frequency=2.5), **RIG)
    run = ss.simulate(slider, duration=8.0 + PART + 0.01)
    quiet = ss.Rig()
    for name in ("x", "z", "a", "load"):
        quiet = quiet.having(name, white=0.0, step=0.0)
    minute = quiet.measure(run, fs=FS, start=8.0).rows(0, round(PART * FS))
    noise = {"x": 1e-6, "z": 1e-6, "a": 0.04, "load": 0.002}
    steps = {"x": 2.5e-6, "z": 2.5e-6, "load": 0.0002 * 4.448}
    rng = np.random.default_rng(1)
    for number in range(minutes):
        noisy = {name: minute[name] + noise[name] * rng.standard_normal(len(minute)) for name in minute}
        counted = {n: np.round(v / steps[n]) * steps[n] if n in steps else v for n, v in noisy.items()}
        record = replace(minute, samples=counted, start=number * PART, truth={})
        for name in ("x", "z"):
            record = record.with_details(name, delay=LAG)
        record = record.with_details("a", mount=(125.0, 0.1))
        yield record.with_details("load", mount=(250.0, 0.05), inertia=0.05, discharge=50.0)


def analyzed(minutes: int) -> None:
    """Write it, analyse it by the command line, and print seconds, the peak of memory and some answers."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with tempfile.TemporaryDirectory() as folder:
        path, config = Path(folder) / "hour.parquet", Path(folder) / "rig.toml"
        config.write_text(CONFIG)
        schema = pa.schema([(name, pa.float64()) for name in ("x", "z", "a", "load")])
        with pq.ParquetWriter(path, schema) as writer:
            for part in parts(minutes):
                writer.write_table(pa.table({name: part[name] for name in schema.names}, schema=schema))
        options = ["--config", str(config), "--fs", str(FS), "--json", "--output", f"{folder}/results"]
        began = time.perf_counter()
        run = subprocess.run(
            [sys.executable, "-c", COMMAND, "analyze", str(path), *options], capture_output=True, text=True, check=True
        )
        seconds = time.perf_counter() - began
        size = path.stat().st_size / 2**20
    data = json.loads(run.stdout)
    values = {each["name"]: each["value"] for each in data["estimates"]}
    print(f"{minutes * 60 * FS / 1e6:.1f} million samples of four channels, {size:.0f} MB of Parquet")
    print(f"{seconds:.0f} s, {int(run.stderr.split()[-1]) / 1024:.0f} MB at most")
    print({name: values[name] for name in ("sliding friction", "contact stiffness", "stuck share of the time")})
    print(data["notes"][0])


def main() -> None:
    """Go through it and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=int, default=60)
    parser.add_argument("--analyze", action="store_true")
    asked = parser.parse_args()
    minutes = asked.minutes
    if asked.analyze:
        analyzed(minutes)
        return
    began, used = time.perf_counter(), time.process_time()

    def found() -> Iterator[tuple[ss.cycle.Stretch, ss.cycle.Sticks]]:
        for stretch in ss.cycle.overlapping(parts(minutes)):
            yield stretch, ss.find_sticks(ss.friction_force(stretch.record, method="fusion", **RIG))
            print(f"\r{stretch.last:6.0f} of {60 * minutes} s", end="", file=sys.stderr)

    sticks = ss.cycle.join_sticks(found())
    kinds = [event.kind for event in sticks.events]
    print(sticks)
    print({kind: kinds.count(kind) for kind in sorted(set(kinds))}, sticks.kind, sticks.status, sticks.lost)
    print(
        f"{time.perf_counter() - began:.0f} s, {time.process_time() - used:.0f} s of the processor, the rig's with it"
    )
    print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GB at most")


if __name__ == "__main__":
    main()
