"""Small files that ask for much: each is tried in a process of its own and ends in an answer or in one sentence."""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import click
import h5py
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
import scipy.io
import soundfile

import stickslip as ss
from format_files import write_uff
from limits import civil, limited, program
from stickslip.cli.records import groups_of
from stickslip.files.table import unique
from stickslip.settings import read_toml
from test_read import LVM

# ---- settings


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[" * 100_000, "not TOML"),
        ("mass = " + "[" * 100_000, "nested"),
        ("mass = " + "1" * 5000, "digits"),
        ("# " + "x" * 1_100_000, "1 MB"),
    ],
    ids=["tables in tables", "lists in lists", "a long number", "a long file"],
)
def test_settings_that_no_one_wrote_by_hand_are_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(ss.errors.ModelError, match=sentence) as refused:
        read_toml(path, what="a rig's settings are")
    assert len(str(refused.value)) < 400


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_settings_are_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "rig.toml")
    outcome = civil(program("check", "x.csv", "--config", "rig.toml", folder=tmp_path))
    assert outcome.code != 0
    for read in (ss.rig.read_rig, ss.systems.read_system, ss.maps.read_sweep):
        with pytest.raises(ss.errors.ModelError, match="no file of its own"):
            read(tmp_path / "rig.toml")


# ---- patterns


def test_the_second_pattern_is_looked_for_where_the_first_one_is(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    for name in ("a_x.csv", "a_y.csv", "b_x.csv", "b_y.csv"):
        (folder / name).touch()
    paired = [[folder / "a_x.csv", folder / "a_y.csv"], [folder / "b_x.csv", folder / "b_y.csv"]]
    assert groups_of(f"{folder}/*_x.csv+*_y.csv") == paired
    assert groups_of(f"{folder}/a_x.csv+a_y.csv") == paired[:1]
    assert groups_of(f"{folder}/*_x.csv+{folder}/*_y.csv") == paired
    with pytest.raises(click.BadParameter, match=r"no file is called, or fits, '\*_z.csv'"):
        groups_of(f"{folder}/*_x.csv+*_z.csv")


# ---- small files that would become large


def array_of(mat_class: int, dimensions: tuple[int, int], rest: bytes) -> bytes:
    """A variable "s" of a MAT file of version 5."""
    flags = struct.pack("<IIII", 6, 8, mat_class, 0)
    sizes = struct.pack("<IIii", 5, 8, *dimensions)
    inner = flags + sizes + struct.pack("<HH4s", 1, 1, b"s") + rest
    return struct.pack("<II", 14, len(inner)) + inner


def mat(variable: bytes, *, packed: bool = False) -> bytes:
    if packed:
        variable = zlib.compress(variable, 9)
        variable = struct.pack("<II", 15, len(variable)) + variable
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + variable


ONE_FIELD = struct.pack("<HHi", 5, 4, 8) + struct.pack("<II8s", 1, 8, b"f")
EMPTY = struct.pack("<II", 14, 0)
NO_TEXT = struct.pack("<II", 4, 0)


def write_zeros_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("x", (30_000_000,), np.int8, chunks=(5_000_000,), compression="gzip")
        for first in range(0, 30_000_000, 5_000_000):
            file["x"][first : first + 5_000_000] = np.zeros(5_000_000, np.int8)


def write_large_chunk(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("x", (140_000_000,), np.int8, chunks=(140_000_000,), compression="gzip")
        file["x"][:] = np.zeros(140_000_000, np.int8)


def write_zeros_parquet(path: Path) -> None:
    columns = [np.zeros(1_000_000)] * 30
    pyarrow.parquet.write_table(
        pyarrow.table({f"x{n}": column for n, column in enumerate(columns)}), path, compression="zstd"
    )


def write_ragged_lvm(path: Path) -> None:
    head = LVM.replace("{decimal}", ".").split("X_Value")[0]
    path.write_text(head + "X_Value\tx\n" + "\t1" * 20_000 + "\n" + "1\t1\n" * 20_000)


def write_uff_sets(path: Path) -> None:
    path.write_bytes(b"    -1\n    58\nNONE\n    -1\n" * 20_000)


SMALL: dict[str, Callable[[Path], object]] = {
    "long.mat": lambda path: path.write_bytes(mat(array_of(2, (1, 65_537), ONE_FIELD + EMPTY))),
    "struct.mat": lambda path: path.write_bytes(mat(array_of(2, (1, 300_000_000), ONE_FIELD))),
    "text.mat": lambda path: path.write_bytes(mat(array_of(4, (30_000, 30_000), NO_TEXT))),
    "cells.mat": lambda path: path.write_bytes(mat(array_of(1, (1, 1_000_000), EMPTY * 1_000_000), packed=True)),
    "zeros.mat": lambda path: scipy.io.savemat(path, {"x": np.zeros(20_000_000)}, do_compression=True),
    "bytes.mat": lambda path: scipy.io.savemat(path, {"x": np.zeros(90_000_000, np.uint8)}, do_compression=True),
    "zeros.h5": write_zeros_hdf5,
    "chunk.h5": write_large_chunk,
    "zeros.parquet": write_zeros_parquet,
    "zeros.flac": lambda path: soundfile.write(path, np.zeros(30_000_000, np.int16), 48_000),
    "rows.json": lambda path: path.write_text(json.dumps([[1.0] * 20_000] + [[1.0]] * 10_000)),
    "keys.json": lambda path: path.write_text(json.dumps([{f"k{n}": 1} for n in range(10_000)])),
    "ragged.csv": lambda path: path.write_text(("1," * 1000 + "1\n") * 150 + "1\n" * 30_000),
    "rows.lvm": write_ragged_lvm,
    "units.csv": lambda path: path.write_text(
        ",".join(f"c{n} [blorb{n}]" for n in range(5000)) + ("\n" + ",".join(["1.5"] * 5000)) * 5 + "\n"
    ),
    "alike.csv": lambda path: path.write_text(",".join(["x"] * 20_000) + ("\n" + "1," * 19_999 + "1") * 3 + "\n"),
    "sets.uff": write_uff_sets,
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    folder = tmp_path_factory.mktemp("small")

    def path_of(name: str) -> Path:
        if not (folder / name).exists():
            SMALL[name](folder / name)
        return folder / name

    return path_of


def read_and_check(path: Path) -> None:
    """Print the refusal of a file, or how long its record is."""
    try:
        record = ss.read_record(path, fs=250)
        record.check()
        print("read", len(record))
    except ss.StickslipError as error:
        print(error)


@pytest.mark.parametrize("name", SMALL)
def test_a_small_file_does_not_become_a_large_one(made: Callable[[str], Path], name: str) -> None:
    path = made(name)
    assert path.stat().st_size < 2_000_000
    outcome = civil(limited(read_and_check, path, folder=path.parent))
    assert outcome.out.count("\n") == 1
    assert not outcome.out.startswith("read")
    assert outcome.peak < 600e6  # of which importing needs a half


def test_the_budget_is_said_and_blocks_are_the_way_out(made: Callable[[str], Path]) -> None:
    with pytest.raises(
        ss.errors.FormatError, match=r"30000000 cells or more; 16777216 are held .*, and 8 .*read_blocks"
    ):
        ss.read_record(made("zeros.flac"))
    with pytest.raises(ss.errors.FormatError, match="smaller size="):
        next(ss.read_blocks(made("zeros.flac"), size=30_000_000))
    assert sum(map(len, ss.read_blocks(made("zeros.flac")))) == 30_000_000


def test_a_large_file_may_become_as_much_larger_as_honest_ones_do(tmp_path: Path) -> None:
    """Bytes become numbers of eight bytes; the file is larger than what any file may become."""
    rng = np.random.default_rng(1)
    scipy.io.savemat(tmp_path / "rig.mat", {"x": rng.integers(-99, 99, 17_000_000, np.int8), "fs": 1e4})
    assert len(ss.read_record(tmp_path / "rig.mat")) == 17_000_000


def test_names_alike_are_told_apart_at_once() -> None:
    assert unique(["x", "x_2", "x", "x", "y"]) == ["x", "x_2", "x_3", "x_4", "y"]
    names = unique(["x"] * 300_000)
    assert (len(set(names)), names[-1]) == (300_000, "x_300000")


def test_what_is_of_no_format_is_not_hashed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*arguments: object) -> None:
        raise AssertionError("a file was hashed that can not be read")

    monkeypatch.setattr("hashlib.file_digest", never)
    with (tmp_path / "rig.bin").open("wb") as file:
        file.truncate(5 << 30)
    with pytest.raises(ss.errors.FormatError, match="of no known format"):
        ss.read_record(tmp_path / "rig.bin")


def test_a_hole_in_a_text_is_not_held(tmp_path: Path) -> None:
    with (tmp_path / "rig.csv").open("wb") as file:
        file.write(b"t,x [m]\n" + b"".join(b"%d,%d\n" % (n, n % 7) for n in range(20_000)))
        file.truncate(3 << 30)
    outcome = civil(limited(read_and_check, tmp_path / "rig.csv", folder=tmp_path))
    assert "rig.csv" in outcome.out


# ---- texts that were cut


def text_of(cells: list[str], end: str = "") -> str:
    return "t [s],x [m]\n" + "\n".join(f"{n / 100:.2f},{cell}" for n, cell in enumerate(cells)) + end


VARYING = ["0.0123456", "0.51", "-1.25", "0.0047592"] * 10
WHOLE = ["2047", "2051", "1998", "2003"] * 10
FIXED = ["0.120", "12.500", "-0.031", "4.759"] * 10


@pytest.mark.parametrize(
    ("cells", "rows", "words"),
    [
        ([*FIXED, "0.004"], 41, None),  # three decimals, as all others
        ([*FIXED, "0.0"], 40, "within a number, '0.0'"),
        ([*FIXED, "12"], 40, "within a number, '12'"),
        ([*FIXED, "12."], 40, "within a number, '12.'"),
        ([*FIXED, "-"], 40, "within a number, '-'"),
        ([*VARYING, "4"], 40, "within a number, '4'"),
        ([*VARYING, "0.0047"], 41, "whether its last number, 0.0047, is whole can not be told"),
        ([*WHOLE, "204"], 40, "within a number, '204'"),
        ([*WHOLE, "2048"], 41, "whether its last number, 2048, is whole can not be told"),
        ([*(f"{float(cell):.4e}" for cell in FIXED), "1.2000e-0"], 40, "within a number, '1.2000e-0'"),
        ([*(f"{float(cell):.4e}" for cell in FIXED), "1.2000e-01"], 41, None),
        ([*FIXED, ""], 40, "ends after 2 of 2 cells"),
        ([f'"{cell}"' for cell in [*FIXED, "1.0"]], 41, None),
    ],
)
def test_a_text_without_its_end_keeps_what_is_surely_whole(
    tmp_path: Path, cells: list[str], rows: int, words: str | None
) -> None:
    path = tmp_path / "rig.csv"
    for encoding in ("utf-8", "utf-16"):
        path.write_bytes(text_of(cells).encode(encoding))
        record = ss.read_record(path)
        assert len(record) == rows
        faults = [fault.message for fault in record.check() if fault.kind == "cut"]
        assert len(faults) == (words is not None)
        if words:
            assert words in faults[0]
            assert words in record.history[-1].outcome
    path.write_text(text_of(cells[:-1], end="\n"))
    assert not [fault for fault in ss.read_record(path).check() if fault.kind == "cut"]


def test_a_text_cut_at_any_byte_never_gives_another_number(tmp_path: Path) -> None:
    """A column of fixed decimals: every number that is read is one that was written, and a cut is told or left none."""
    path = tmp_path / "rig.csv"
    data = text_of(FIXED, end="\n").encode()
    written = np.array([float(cell) for cell in FIXED])
    for end in range(len(data) - 60, len(data)):
        path.write_bytes(data[:end])
        record = ss.read_record(path)
        np.testing.assert_array_equal(record["x"], written[: len(record)])
        whole = data[:end].endswith(b"\n") or data[end : end + 1] == b"\n"
        assert whole == (not [fault for fault in record.check() if fault.kind == "cut"])
        assert [len(block) for block in ss.read_blocks(path, size=7)] == [
            min(7, len(record) - first) for first in range(0, len(record), 7)
        ]


@pytest.mark.parametrize("tail", ["", "\t0.1"])
def test_lvm_that_holds_less_than_it_states(tmp_path: Path, tail: str) -> None:
    path = tmp_path / "rig.lvm"
    head = LVM.replace("{decimal}", ".").split("0.000\t")[0].replace("Samples\t3\t3", "Samples\t40\t40")
    path.write_text(head + "".join(f"{n / 250:.3f}\t{n / 8:.3f}\t{n}\t\n" for n in range(25)) + tail)
    record = ss.read_record(path)
    assert len(record) == 25
    (fault,) = [fault for fault in record.check() if fault.kind == "cut"]
    assert "states 40 samples of each channel and 25 are there" in fault.message
    assert ("was left out" in fault.message) == bool(tail)
    assert "states 40 samples" in record.history[-1].outcome


def test_other_formats_that_hold_less_than_they_state(tmp_path: Path) -> None:
    uff = tmp_path / "rig.uff"
    write_uff(uff)
    lines = uff.read_text().splitlines(keepends=True)
    uff.write_text("".join(lines[:20] + [line for line in lines[-1:] if line == "    -1\n"]))
    rows = tmp_path / "rig.json"
    rows.write_text(json.dumps({"fs": 250, "samples": 40, "x": list(range(25))}))
    for path, words in ((uff, "promises 400 values"), (rows, "states 40 samples and 25 are there")):
        (fault,) = [fault for fault in ss.read_record(path).check() if fault.kind == "cut"]
        assert words in fault.message


def test_more_than_a_file_states_is_no_cut(tmp_path: Path) -> None:
    path = tmp_path / "rig.uff"
    write_uff(path)
    path.write_text(path.read_text().replace("       400", "       398"))
    record = ss.read_record(path)
    assert len(record) == 398
    assert "promises 398 values but its lines hold 400" in record.history[-1].outcome
    assert not [fault for fault in record.check() if fault.kind == "cut"]


def test_a_record_that_was_written_remembers_what_its_file_lacked(tmp_path: Path) -> None:
    (tmp_path / "rig.csv").write_text(text_of([*FIXED, "0.0"]))
    kept = ss.read_record(ss.write_record(ss.read_record(tmp_path / "rig.csv"), tmp_path / "kept.h5"))
    assert [fault.kind for fault in kept.check() if fault.kind == "cut"] == ["cut"]


# ---- what twenty thousand mutated files brought up (tools/mutate_files.py)


def test_a_heap_of_hdf5_that_leads_nowhere_is_not_followed(tmp_path: Path) -> None:
    """The library takes a free piece of no length for the next one, for ever."""
    path = tmp_path / "kept.h5"
    ss.write_record(ss.Record.of({"x": np.arange(60.0)}, fs=250), path)
    data = bytearray(path.read_bytes())
    free = data.index(b"GCOL") + 16
    while data[free : free + 2] != b"\0\0":  # the free piece follows those that are in use, each padded to eight bytes
        free += 16 + -(-int.from_bytes(data[free + 8 : free + 16], "little") // 8) * 8
    data[free + 8 : free + 16] = bytes(8)
    path.write_bytes(bytes(data))
    outcome = civil(limited(read_and_check, path, folder=tmp_path))
    assert "'kept.h5' is damaged near byte" in outcome.out


@pytest.mark.parametrize("huge", [1e200, 1.7e308])
def test_a_clock_of_huge_numbers_is_checked_without_a_warning(huge: float) -> None:
    stamps = np.arange(60) / 250
    stamps[-1] = huge
    record = ss.Record({"x": np.sin(np.arange(60) / 9)}, {"x": ss.record.Channel("x", "m")}, 250.0, stamps=stamps)
    assert record.check()


def test_a_gap_beside_a_missing_stamp_has_a_length() -> None:
    stamps = np.arange(200) / 250
    stamps[100:] += 0.2
    stamps[100] = np.nan
    record = ss.Record({"x": np.sin(np.arange(200) / 9)}, {"x": ss.record.Channel("x", "m")}, 250.0, stamps=stamps)
    (gap,) = [fault for fault in record.check() if fault.kind == "gap"]
    assert "gap of up to 208 ms" in gap.message
    assert "about 50 samples lost" in gap.message
