"""What becomes of a map on disk whose process is killed, and of a map on a cluster whose worker is killed.

    python benchmarks/kills.py --points 1000000 --kills 20

Three figures: whether a map that was killed at random moments by SIGKILL ends with the bytes of an undisturbed one; the
wall time on two local Dask workers over that of two threads; and whether the answer is the same after a worker was
killed at random.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

import stickslip as ss

SLIDER = ss.Oscillator(
    mass=2.42,
    stiffness=2310,
    damping=0.1196,
    law=ss.laws.Coulomb(1.1),
    drive=ss.drives.HarmonicBase(6e-4, frequency=5.6),
)
MEASURES = ["stops", "amplitude", "stick_share"]


def grid(points: int) -> dict[str, Any]:
    side = round(points**0.5)
    return {"kinetic": np.linspace(0.1, 1.5, side), "frequency": np.linspace(2.0, 12.0, side)}


def run(points: int, cycles: int, engine: str, store: str | None = None) -> Any:
    return ss.sweep(
        SLIDER, grid(points), measures=MEASURES, settle=cycles // 2, cycles=cycles // 2, engine=engine, store=store
    )


def digest(folder: Path) -> str:
    """Of every file's name and bytes."""
    found = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            found.update(str(path.relative_to(folder)).encode() + path.read_bytes())
    return found.hexdigest()


def done(store: Path) -> int:
    """Blocks that stand on disk."""
    return sum(path.is_file() and path.suffix != ".partial" for path in (store / "amplitude" / "c").rglob("*"))


def killed(points: int, cycles: int, kills: int, chance: random.Random) -> None:
    """A map undisturbed, and one that is killed on its way."""
    with tempfile.TemporaryDirectory() as folder:
        calm, harmed = Path(folder, "calm.zarr"), Path(folder, "harmed.zarr")
        begin = time.perf_counter()
        run(points, cycles, "threads", str(calm))
        whole = time.perf_counter() - begin
        command = [sys.executable, __file__, "--points", str(points), "--cycles", str(cycles), "--into", str(harmed)]
        ended, blocks = 0, done(calm)
        for _ in range(kills):
            until = done(harmed) + chance.randint(1, max(1, 2 * blocks // (kills + 1)))
            with subprocess.Popen(command) as work:
                while done(harmed) < until and work.poll() is None:
                    time.sleep(0.001)
                if work.poll() is None:
                    time.sleep(chance.uniform(0, 0.05))
                    work.send_signal(signal.SIGKILL)
                ended += work.wait() < 0
        subprocess.run(command, check=True)
        same = "byte-identical" if digest(calm) == digest(harmed) else "NOT identical"
    print(f"{points} oscillators, {cycles} cycles: {whole:.0f} s undisturbed; killed {ended} times: {same}")


def clustered(points: int, cycles: int, chance: random.Random) -> None:
    """Two local workers beside two threads, and once more with a worker killed."""
    from distributed import Client, LocalCluster

    begin = time.perf_counter()
    threads = run(points, cycles, "threads")
    wall = time.perf_counter() - begin
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster,
        Client(cluster) as client,
    ):
        address = "dask://" + cluster.scheduler_address.removeprefix("tcp://")
        run(400, 2, address)  # kernels loaded
        begin = time.perf_counter()
        found = run(points, cycles, address)
        ours = time.perf_counter() - begin
        victim = chance.choice(list(client.run(os.getpid).values()))
        threading.Timer(chance.uniform(0.2, 0.8) * ours, os.kill, (victim, signal.SIGKILL)).start()
        again = run(points, cycles, address)
    print(f"Dask, two workers: {ours:.1f} s, threads {wall:.1f} s: {ours / wall - 1:+.0%}")
    print(f"the same map: {found.equals(threads)}; with a worker killed: {again.equals(threads)}")


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--points", type=int, default=40_000)
    asked.add_argument("--cycles", type=int, default=250)
    asked.add_argument("--kills", type=int, default=5)
    asked.add_argument("--into", help=argparse.SUPPRESS)
    given = asked.parse_args()
    if given.into:
        run(given.points, given.cycles, "threads", given.into)
        return
    chance = random.Random(7)
    killed(given.points, given.cycles, given.kills, chance)
    clustered(given.points, given.cycles, chance)


if __name__ == "__main__":
    main()
