"""Record 8 channels at 50 kHz: is anything lost, does memory grow, how much of a core does it take?

``python benchmarks/recording.py [SECONDS]`` records as many seconds of an hour's stream, by the clock, into a journal
(60 where nothing is said; 3600 is the whole), then makes the file of it.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from bench_devices import Counter, counts
from stickslip.bench import Device, Tape
from stickslip.bench.device import blocks

CHANNELS, FS = 8, 50_000.0


def resident() -> float:
    """Memory in use now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def main(seconds: float) -> None:
    device: Device = Counter(CHANNELS, FS, size=1000, pace=1.0)
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
        for first in range(0, int(min(seconds, 10) * FS), 1000):
            counts(first, first + 1000, CHANNELS)
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


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
