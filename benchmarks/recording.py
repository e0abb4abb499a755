"""Record 8 channels at 50 kHz: is anything lost, does memory grow, how much of a core does it take?

``python benchmarks/recording.py [SECONDS]`` records as many seconds of an hour's stream, by the clock, into a journal
(60 where nothing is said; 3600 is the whole), then makes the file of it. ``--kills N`` kills as many recordings of half
a second by SIGKILL at random instants, some of them while the file is made, and says what that cost.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import stickslip as ss
from bench_devices import Counter, counts
from stickslip.bench import Device, Tape
from stickslip.bench.device import blocks

CHANNELS, FS, SIZE = 8, 50_000.0, 1000
RECORDER = f"""
import sys
from bench_devices import Counter
from stickslip.bench import Wanted, acquire
device, wanted = Counter({CHANNELS}, {FS}, size={SIZE}, pace=1.0), Wanted(seconds=0.5)
acquire(device, output=sys.argv[1], wanted=wanted, watch=lambda device, block: print(block.first, flush=True))
"""


def resident() -> float:
    """Memory in use now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def main(seconds: float) -> None:
    device: Device = Counter(CHANNELS, FS, size=SIZE, pace=1.0)
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as folder:
        tape = Tape(device, Path(folder, "run.h5"))
        begun, own, generated = time.monotonic(), time.process_time(), 0.0
        early = 0.0
        with device.open() as stream:
            for block in blocks(stream, count=int(seconds * FS)):
                tape.write(block)
                if not early and block.after > 5 * FS:
                    early = resident()
        wall, own = time.monotonic() - begun, time.process_time() - own
        late = resident()
        generated = time.process_time()
        for first in range(0, int(min(seconds, 10) * FS), SIZE):
            counts(first, first + SIZE, CHANNELS)
        generated = (time.process_time() - generated) * seconds / min(seconds, 10)
        said = tape.close()
        size = tape.path.stat().st_size
        closing = time.process_time()
        tape.finish()
        closing = time.process_time() - closing
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        whole = checked(Path(folder, "run.h5"), int(seconds * FS))
    print(f"{said}; {wall:.1f} s by the clock; every sample {'right' if whole else 'WRONG'}")
    print(f"recording: {100 * (own - generated) / wall:.1f} % of a core; the device {100 * generated / wall:.1f} %")
    print(f"memory: {early:.0f} MB after 5 s, {late:.0f} MB at the end, peak with the file made {peak:.0f} MB")
    print(f"journal {size / 1e6:.0f} MB; made into the file in {closing:.1f} s of processor time")
    print(f"an hour of it: {size / seconds * 3600 / 1e9:.1f} GB, {closing / seconds * 3600:.0f} s")


def checked(path: Path, rows: int) -> bool:
    """Whether every sample of the file is what was sent."""
    import h5py

    with h5py.File(path) as file:
        for first in range(0, rows, 500_000):
            expected = counts(first, min(first + 500_000, rows), CHANNELS) * 1e-6
            if any(not np.array_equal(file[f"c{j}"][first : first + 500_000], row) for j, row in enumerate(expected)):
                return False
        return len(file["c0"]) == rows


def killed(kills: int) -> None:
    """What each kill costs: samples of those that the device had given, and whether the others are right."""
    chance, files, lost, right = random.Random(1), 0, [], True
    for _ in range(kills):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "run.h5")
            command = [sys.executable, "-c", RECORDER, str(path)]
            with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=sys.path[0]) as run:
                assert run.stdout is not None
                firsts = [run.stdout.readline()]
                time.sleep(chance.uniform(0.0, 0.8))
                run.kill()
                firsts += run.stdout.readlines()
            files += path.exists()
            length = 0
            with suppress(ss.errors.FormatError):  # killed before the first block was written: the journal is empty
                record = ss.read_record(path if path.exists() else f"{path}.journal")
                rows, length = counts(0, len(record), CHANNELS) * 1e-6, len(record)
                right &= all(np.array_equal(record[f"c{j}"], row) for j, row in enumerate(rows))
            lost.append(int(firsts[-1]) + SIZE - length)
    print(f"{kills} recordings killed, {files} of them whole by then; every sample that is there is", end=" ")
    print(f"{'right' if right else 'WRONG'}; lost of what had come: {max(lost)} at the most, blocks of {SIZE}")


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("seconds", type=float, nargs="?", default=60.0)
    asked.add_argument("--kills", type=int, default=0)
    given = asked.parse_args()
    if given.kills:
        killed(given.kills)
    else:
        main(given.seconds)
