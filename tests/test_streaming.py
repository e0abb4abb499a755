"""Files larger than memory go through read_blocks: the process's address space is capped below the file's size."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
import soundfile
from nptdms import ChannelObject, TdmsWriter

import stickslip as ss

PARTS, PART = 50, 100_000
RAMP = np.arange(PART) % 1000 / 1000
ROOM = 32 * 2**20  # bytes that the process may grow by

PROGRAM = """
import pathlib, resource, sys
import stickslip as ss
path, fs, room = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
blocks = ss.read_blocks(path, fs=fs, size=100_000)
first = next(blocks)  # what the libraries set up once is set up now
name = next(iter(first))
used = int(pathlib.Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + room, used + room))
rows, total, end = len(first), first[name].sum(), first.start + first.duration
for block in blocks:
    assert abs(block.start - end) < 1e-9, (block.start, end)
    rows, total, end = rows + len(block), total + block[name].sum(), block.start + block.duration
del block, first
try:
    ss.read_record(path, fs=fs)
    refusal = "none"
except ss.StickslipError as error:
    refusal = "memory" if "emory" in str(error) or "Unable to" in str(error) or "malloc" in str(error) else str(error)
print(rows, round(total, 3), refusal)
"""


def write_csv(path: Path) -> None:
    part = "".join(f"{value:.3f},1,0.123456789\n" for value in RAMP)
    with path.open("w") as file:
        file.write("x [m],v [m/s],a [m/s^2]\n")
        for _ in range(PARTS):
            file.write(part)


def write_wav(path: Path) -> None:
    with soundfile.SoundFile(path, "w", 48_000, 2, "DOUBLE", format="WAV") as file:
        for _ in range(PARTS):
            file.write(np.column_stack([RAMP, RAMP]))


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name in ("x", "v"):
            data = file.create_dataset(name, (PARTS * PART,), float, chunks=(PART,))
            for number in range(PARTS):
                data[number * PART : (number + 1) * PART] = RAMP


def write_parquet(path: Path) -> None:
    table = pyarrow.table({"x": RAMP, "v": np.random.default_rng(2).standard_normal(PART)})
    with pyarrow.parquet.ParquetWriter(path, table.schema, compression="none", use_dictionary=False) as writer:
        for _ in range(PARTS):
            writer.write_table(table)


def write_tdms(path: Path) -> None:
    with TdmsWriter(path) as writer:
        for _ in range(PARTS):
            writer.write_segment([ChannelObject("rig", name, RAMP) for name in ("x", "v")])


LARGE: dict[str, Callable[[Path], None]] = {
    "large.csv": write_csv,
    "large.wav": write_wav,
    "large.h5": write_hdf5,
    "large.parquet": write_parquet,
    "large.tdms": write_tdms,
}


@pytest.mark.skipif(sys.platform != "linux", reason="address space can be capped and read on Linux alone")
@pytest.mark.parametrize("name", LARGE)
def test_a_file_larger_than_the_address_space_goes_through(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    LARGE[name](path)
    assert path.stat().st_size > 2 * ROOM
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROGRAM, str(path), "48000", str(ROOM)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    rows, total, refusal = done.stdout.split(maxsplit=2)
    assert int(rows) == PARTS * PART
    assert float(total) == pytest.approx(PARTS * RAMP.sum(), rel=1e-9)
    assert refusal.strip() == "memory"


@pytest.mark.parametrize("size", [7, 100, 1000])
def test_blocks_join_to_the_record(tmp_path: Path, size: int) -> None:
    t = np.round(5 + np.arange(321) / 150, 5)
    path = tmp_path / "rig.csv"
    path.write_text("t,x [mm]\n" + "".join(f"{a},{i}\n" for i, a in enumerate(t)))
    whole = ss.read_record(path)
    blocks = list(ss.read_blocks(path, size=size))
    assert [len(block) for block in blocks[:-1]] == [size] * (len(blocks) - 1)
    np.testing.assert_array_equal(np.concatenate([block["x"] for block in blocks]), whole["x"])
    np.testing.assert_allclose(np.concatenate([block.time for block in blocks]), whole.time, atol=2e-5)
    assert all(block.stamps is None for block in blocks)


def test_two_files_go_through_side_by_side(tmp_path: Path) -> None:
    for name in "xz":
        (tmp_path / f"{name}.csv").write_text(
            f"t,{name} [m]\n" + "".join(f"{i},{i}{name == 'z':d}\n" for i in range(25))
        )
    blocks = list(ss.read_blocks([tmp_path / "x.csv", tmp_path / "z.csv"], size=10))
    assert [(len(block), block.start) for block in blocks] == [(10, 0), (10, 10), (5, 20)]
    assert blocks[2]["z"].tolist() == [201, 211, 221, 231, 241]


def test_a_gap_in_a_later_block_keeps_that_blocks_stamps(tmp_path: Path) -> None:
    t = np.arange(100) / 50
    t[60:] += 0.5
    path = tmp_path / "gap.csv"
    path.write_text("t,x [m]\n" + "".join(f"{a:.2f},1\n" for a in t))
    assert [block.stamps is None for block in ss.read_blocks(path, size=25)] == [True, True, False, True]


def test_a_fault_in_a_later_block_is_named(tmp_path: Path) -> None:
    path = tmp_path / "late.csv"
    path.write_text("t,x [m]\n" + "".join(f"{i},{'oops' if i == 80 else i}\n" for i in range(100)))
    blocks = ss.read_blocks(path, size=25)
    assert [next(blocks).start for _ in range(3)] == [0, 25, 50]
    with pytest.raises(ss.errors.FormatError, match=r"row 82 of 'late\.csv' reads '80,oops'"):
        next(blocks)


def test_a_block_has_rows(tmp_path: Path) -> None:
    with pytest.raises(ss.errors.RecordError, match="at least one row"):
        ss.read_blocks(tmp_path / "any.csv", size=0)
