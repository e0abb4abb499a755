"""A 200 MB TDMS file in the lab: how fast it is taken and analysed, and how long the lab is silent meanwhile.

python benchmarks/lab_data.py [--megabytes 200]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2 as httpx
import numpy as np
from nptdms import ChannelObject, TdmsWriter

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from labs import Lab, running_lab

FS, SEGMENT = 1000.0, 1_000_000


def write_large(path: Path, megabytes: int) -> None:
    """A contact that slides to and fro against 1.5 N, in two channels of doubles."""
    turns = 2 * np.pi * np.arange(SEGMENT) / FS
    friction = 1.5 * np.sign(np.cos(turns)) + np.random.default_rng(1).normal(0, 0.01, SEGMENT)
    channels = [
        ChannelObject("rig", name, values, properties={"wf_increment": 1 / FS, "unit_string": unit})
        for name, values, unit in (("x", np.sin(turns) / (2 * np.pi), "m"), ("friction", friction, "N"))
    ]
    with TdmsWriter(path) as writer:
        while path.stat().st_size < megabytes * 1e6:
            writer.write_segment(channels)


def pieces(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while some := file.read(1 << 20):
            yield some


def resident(lab: Lab) -> float:
    """The most memory that the server itself has held [MB]."""
    status = Path(f"/proc/{lab.process.pid}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1e3


def watched(lab: Lab, silences: list[float], stop: threading.Event) -> None:
    """How long the lab takes to say that it is there, over and over."""
    with httpx.Client(base_url=lab.base, headers=lab.headers, timeout=60) as client:
        while not stop.is_set():
            begun = time.perf_counter()
            client.get("/alive")
            silences.append(time.perf_counter() - begun)
            time.sleep(0.02)


def asked(client: httpx.Client, key: str, question: str) -> tuple[float, Any]:
    begun = time.perf_counter()
    job = client.post("/jobs", json={"question": question, "records": [[key]]}).json()["id"]
    while (told := client.get(f"/jobs/{job}").json())["state"] in ("waiting", "running"):
        time.sleep(0.1)
    return time.perf_counter() - begun, told


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--megabytes", type=int, default=200)
    megabytes = options.parse_args().megabytes
    with tempfile.TemporaryDirectory() as folder, running_lab() as lab:
        path = Path(folder) / "long.tdms"
        write_large(path, megabytes)
        before, silences, stop = resident(lab), list[float](), threading.Event()
        watcher = threading.Thread(target=watched, args=(lab, silences, stop))
        watcher.start()
        try:
            with httpx.Client(base_url=lab.base, headers=lab.headers, timeout=600) as client:
                begun = time.perf_counter()
                key = client.post("/files", params={"name": path.name}, content=pieces(path)).json()["id"]
                print(f"taken: {path.stat().st_size / 1e6:.0f} MB in {time.perf_counter() - begun:.2f} s")
                for question in ("describe", "analyze"):
                    took, told = asked(client, key, question)
                    words = told["answer"]["headline"][0] if question == "analyze" and told["answer"] else ""
                    print(f"{question}: {told['state']} in {took:.1f} s {told['message'] or words}")
        finally:
            stop.set()
            watcher.join()
        late = np.array(silences) * 1e3
        print(
            f"the lab answered meanwhile: median {np.median(late):.1f} ms, 95 % {np.percentile(late, 95):.1f} ms, "
            f"longest {late.max():.0f} ms ({len(late)} times)"
        )
        print(f"memory of the server: {before:.0f} MB before, {resident(lab):.0f} MB at most")


if __name__ == "__main__":
    main()
