"""Damaged and hostile files: read_record gives a Record that can be checked up, or a StickslipError."""

from __future__ import annotations

import json
import os
import pickle
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import stickslip as ss
from format_files import SMALL
from test_read import LVM
from test_text import DIALECTS

KEPT = ss.Record.of({"x": np.sin(np.arange(60) / 5), "load": np.arange(60.0)}, fs=250, units={"x": "mm"})


def write_json(path: Path) -> None:
    rows = [[i / 250, float(np.sin(i / 5)), None if i == 7 else i] for i in range(60)]
    path.write_text(json.dumps({"fs": 250, "columns": ["t", "x [mm]", "n"], "data": rows}))


FILES: dict[str, Callable[[Path], object]] = {
    **SMALL,
    "comma.csv": lambda path: path.write_text(DIALECTS["title and remarks"]),
    "quoted.csv": lambda path: path.write_text(DIALECTS["quoted numbers"]),
    "wide.txt": lambda path: path.write_bytes(DIALECTS["tab and decimal comma"].encode("utf-16")),
    "clock.txt": lambda path: path.write_text("".join(f"10:00:{s:02d}.5, {s}, 1.5\n" for s in range(60))),
    "kept.csv": lambda path: ss.write_record(KEPT, path),
    "kept.h5": lambda path: ss.write_record(KEPT, path),
    "kept.parquet": lambda path: ss.write_record(KEPT, path),
    "rows.json": write_json,
    "rig.lvm": lambda path: path.write_text(LVM.replace("{decimal}", ".")),
}
CLOCKLESS = {"four.mat", "five.mat", "packed.mat", "seven.mat", "a.parquet", "clock.txt", "any", "any.txt"}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], bytes]:
    folder = tmp_path_factory.mktemp("whole")
    known: dict[str, bytes] = {}

    def contents(name: str) -> bytes:
        if name not in known:
            FILES[name](folder / name)
            known[name] = (folder / name).read_bytes()
            if (beside := folder / f"{name}.json").exists():
                known[beside.name] = beside.read_bytes()
        return known[name]

    return contents


def read_or_refuse(path: Path) -> ss.Record | None:
    """The record, or None for a refusal in one sentence; any other end, a warning too, fails the test.

    What could be read is also checked up.
    """
    began = time.process_time()
    record, sentence = None, ""
    try:
        record = ss.read_record(path, fs=250 if path.name in CLOCKLESS else None)
        record.check()
    except ss.StickslipError as error:
        sentence = str(error)
    assert "\n" not in sentence
    assert len(sentence) < 1500
    assert time.process_time() - began < 20
    return record


@pytest.mark.parametrize("name", FILES)
def test_the_whole_files_are_read(tmp_path: Path, whole: Callable[[str], bytes], name: str) -> None:
    path = tmp_path / name
    path.write_bytes(whole(name))
    record = read_or_refuse(path)
    assert record is not None
    assert len(record) >= 3


@pytest.mark.parametrize("name", FILES)
@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    edits=st.lists(
        st.tuples(
            st.floats(0, 1, exclude_max=True), st.sampled_from(["set", "insert", "delete"]), st.binary(max_size=4)
        ),
        min_size=1,
        max_size=5,
    ),
    near=st.sampled_from([200, 2000, 10**9]),
    cut=st.floats(0, 1),
)
def test_a_mutated_file_is_a_record_or_a_refusal(
    tmp_path: Path,
    whole: Callable[[str], bytes],
    name: str,
    edits: list[tuple[float, str, bytes]],
    near: int,
    cut: float,
) -> None:
    data = bytearray(whole(name))
    for where, what, piece in edits:
        at = int(where * min(near, len(data)))
        end = at + (0 if what == "insert" else len(piece))
        data[at:end] = b"" if what == "delete" else piece
    path = tmp_path / name
    path.write_bytes(bytes(data) if cut > 0.5 else bytes(data[: int(2 * cut * len(data))]))
    record = read_or_refuse(path)
    assert record is None or all(len(record[channel]) == len(record) > 0 for channel in record)


@pytest.mark.parametrize("name", ["a.tdms", "four.mat", "five.mat", "packed.mat"])
def test_cut_at_any_byte(tmp_path: Path, whole: Callable[[str], bytes], name: str) -> None:
    data = whole(name)
    path = tmp_path / name
    ends = {*range(0, 400, 3), *range(400, len(data), 97), *range(len(data) - 9, len(data))}
    for end in sorted(ends):
        path.write_bytes(data[:end])
        read_or_refuse(path)


@pytest.mark.parametrize("name", ["kept.csv", "comma.csv", "rows.json", "kept.h5", "kept.parquet"])
def test_a_record_that_was_cut_is_never_taken_as_whole(
    tmp_path: Path, whole: Callable[[str], bytes], name: str
) -> None:
    data = whole(name)
    path = tmp_path / name
    if name == "kept.csv":  # what it should hold stands beside it
        (tmp_path / "kept.csv.json").write_bytes(whole("kept.csv.json"))
    for end in range(1, len(data), max(1, len(data) // 60)):
        path.write_bytes(data[:end])
        record = read_or_refuse(path)
        assert record is None or (name == "comma.csv" and len(record) <= 40)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    text=st.text(st.sampled_from("0123456789.,;:\t -+eE\n\r\"'#%[]()nNaAxt/\\\x00é"), max_size=200),
    suffix=st.sampled_from([".csv", ".txt", ".json", ".lvm", ".dat", ""]),
)
def test_any_text_is_a_record_or_a_refusal(tmp_path: Path, text: str, suffix: str) -> None:
    path = tmp_path / f"any{suffix}"
    path.write_text(text, newline="")
    read_or_refuse(path)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    head=st.sampled_from(
        [b"", b"TDSm", b"MATLAB 5.0 MAT-file", b"\x89HDF\r\n\x1a\n", b"PAR1", b"RIFF", b"fLaC", b"OggS"]
    ),
    body=st.binary(max_size=300),
)
def test_any_bytes_are_a_record_or_a_refusal(tmp_path: Path, head: bytes, body: bytes) -> None:
    path = tmp_path / "any"
    path.write_bytes(head + body)
    read_or_refuse(path)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-(10**400), 10**400) | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["data", "fs", "dt", "t", "x", "unit_str", "units", "columns"]), inner, max_size=4
        )
    ),
    max_leaves=30,
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(contents=json_values)
def test_any_json_is_a_record_or_a_refusal(tmp_path: Path, contents: object) -> None:
    path = tmp_path / "any.json"
    path.write_text(json.dumps(contents))
    read_or_refuse(path)


@pytest.mark.parametrize(
    ("contents", "name", "words"),
    [
        (b"", "rig.csv", "'rig.csv' is empty"),
        (b"\n\n\n", "rig.csv", "none of the first 3 holds numbers"),
        (b"The slider was dry.\nWe then oiled it.\n", "note.txt", "row 1 of 'note.txt' reads 'The slider was dry.'"),
        (bytes(range(256)) * 40, "rig.bin", "of no known format"),
        (b"\x7fELF\x02\x01\x01" + bytes(500), "rig", "of no known format"),
        (b"[" * 100_000, "rig.json", "'rig.json'"),
        (b'{"t": [0, 1], "x": ["a", "b"]}', "rig.json", "neither|no column"),
        (b"t,x [m]\n0,\n1,\n2,\n", "rig.csv", None),
    ],
)
def test_what_is_no_measurement_is_one_sentence(tmp_path: Path, contents: bytes, name: str, words: str | None) -> None:
    path = tmp_path / name
    path.write_bytes(contents)
    if words is None:
        assert np.isnan(ss.read_record(path, units={"x": "m"})["x"]).all()
        return
    with pytest.raises(ss.StickslipError, match=words):
        ss.read_record(path)


def test_a_folder_and_nothing_at_all(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere.csv", "a\0b"):
        with pytest.raises(ss.errors.FormatError, match=r"there is no file|can not be opened"):
            ss.read_record(path)
    with pytest.raises(ss.errors.FormatError, match="no file is named"):
        ss.read_record([])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(ss.errors.FormatError, match="there is no file"):
        ss.read_record(tmp_path / "pipe.csv")


class Trap:
    """Leaves a mark when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[object, tuple[str, int]]:
        return os.mkdir, (str(self.mark), 0o700)


@pytest.mark.parametrize("name", ["a.pkl", "a.npy", "a.npz", "a.csv", "a.h5", "a.mat", "a.tdms", "rig.lvm.pkl"])
def test_nothing_is_unpickled(tmp_path: Path, name: str) -> None:
    mark = tmp_path / "mark"
    path = tmp_path / name
    if name.endswith(".npy"):
        np.save(path, np.array([Trap(mark)], dtype=object), allow_pickle=True)
    elif name.endswith(".npz"):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("x.npy", pickle.dumps(Trap(mark)))
    else:
        path.write_bytes(pickle.dumps(Trap(mark)))
    if name == "rig.lvm.pkl":
        path = tmp_path / "rig.lvm"
        path.write_text(LVM.replace("{decimal}", "."))
        os.utime(path, (0, 0))  # the pickle beside it is the newer one
        assert len(ss.read_record(path)) == 3
    else:
        with pytest.raises(ss.errors.FormatError):
            ss.read_record(path)
    assert not mark.exists()
