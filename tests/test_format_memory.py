"""Each streaming format by itself, in a process whose address space is smaller than the file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
import soundfile
from nptdms import ChannelObject, TdmsWriter

STREAM = """
import resource, sys
from pathlib import Path
import numpy as np
from stickslip.files import {module} as format
from stickslip.files.table import Options
table = format.read(Path(sys.argv[1]), Options())
names = [column.name for column in table.columns]
blocks = table.blocks(names, 100_000)
first = next(blocks)  # whatever the library sets up once is set up now
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {room}, used + {room}))
try:
    bytearray({size})
except MemoryError:
    rows = len(first[names[0]]) + sum(len(block[names[0]]) for block in blocks)
    print(rows)
"""

ROWS, ROOM = 12_000_000, 48 * 2**20


def write_large(path: Path, kind: str) -> None:
    part = np.random.default_rng(1).standard_normal(ROWS // 40)
    if kind == "tdms":
        with TdmsWriter(path) as writer:
            for _ in range(40):
                writer.write_segment([ChannelObject("g", "x", part)])
    elif kind == "audio":
        with soundfile.SoundFile(path, "w", 48_000, 1, "DOUBLE", format="WAV") as file:
            for _ in range(40):
                file.write(part)
    elif kind == "hdf5":
        with h5py.File(path, "w") as file:
            data = file.create_dataset("x", (ROWS,), float, chunks=(100_000,))
            for number in range(40):
                data[number * len(part) : (number + 1) * len(part)] = part
    else:
        table = pyarrow.table({"x": part})
        with pyarrow.parquet.ParquetWriter(path, table.schema) as writer:
            for _ in range(40):
                writer.write_table(table)


@pytest.mark.skipif(sys.platform != "linux", reason="address space can be capped and read on Linux alone")
@pytest.mark.parametrize("kind", ["tdms", "audio", "hdf5", "parquet"])
def test_a_file_larger_than_memory_is_streamed(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "large"
    write_large(path, kind)
    size = path.stat().st_size
    assert size > 1.9 * ROOM
    program = STREAM.format(module=kind, room=ROOM, size=size)
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == (str(ROWS), "")
