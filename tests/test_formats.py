"""The binary formats: real files against other programs and closed forms, damage refused, blocks equal to the whole."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import soundfile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter

from format_files import SMALL, Formats, X, read, recognised, units, whole
from stickslip.errors import FormatError, StickslipError


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    folder = tmp_path_factory.mktemp("formats")

    def made(name: str) -> Path:
        path = folder / name
        if not path.exists():
            SMALL[name](path)
        return path

    return made


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("size", [1, 7, 128, 399, 400, 5000])
def test_blocks_are_the_whole_in_pieces(small: Formats, name: str, size: int) -> None:
    table = read(small(name))
    lengths = {column.rows for column in table.columns}
    assert lengths == {400}
    names = [column.name for column in table.columns]
    blocks = list(table.blocks(names, size))
    assert all(0 < len(values) <= size and values.dtype == np.float64 for b in blocks for values in b.values())
    for column, values in whole(table).items():
        assert len(values) == 400
        assert np.array_equal(np.concatenate([block[column] for block in blocks]), values)


@pytest.mark.parametrize("name", SMALL)
def test_only_the_named_columns_are_given(small: Formats, name: str) -> None:
    table = read(small(name))
    last = table.columns[-1].name
    assert [list(block) for block in table.blocks([last], 300)] == [[last], [last]]


@pytest.mark.parametrize(
    ("name", "column", "samples", "rtol"),
    [
        ("a.tdms", "Rig/z", X[:, 1], 0),
        ("four.mat", "x", X[:, 0], 0),
        ("five.mat", "rig.both_2", X[:, 1], 0),
        ("packed.mat", "z", X[:, 1], 0),
        ("seven.mat", "both_1", X[:, 0], 0),
        ("a.h5", "group/both_2", X[:, 1], 0),
        ("a.h5", "raw.b", X[:, 1], 0),
        ("a.parquet", "x", X[:, 0], 0),
        ("a.wav", "ch2", X[:, 1], 2e-4),  # 16 bits: 3e-5 of full scale
        ("ascii.uff", "2+Z", X[:, 1], 1e-10),  # twelve digits
        ("binary.uff", "1+Z", X[:, 0], 0),
    ],
)
def test_samples_come_back(small: Formats, name: str, column: str, samples: np.ndarray, rtol: float) -> None:
    assert np.allclose(whole(read(small(name)))[column], samples, rtol=rtol, atol=rtol)


def test_clocks_units_and_constants(small: Formats) -> None:
    columns = {column.name: column for column in read(small("a.tdms")).columns}
    assert (columns["Rig/x"].fs, columns["Rig/x"].start, columns["Rig/x"].unit) == (100.0, 0.5, "mm")
    table = read(small("a.h5"))
    columns = {column.name: column for column in table.columns}
    assert (columns["x"].fs, columns["x"].unit, columns["group/both_1"].fs) == (50.0, "mm", 1000.0)
    assert table.constants == {"fs": 50.0, "mass": 2.42}
    assert read(small("packed.mat")).constants == {"gain": 35.15, "rig.mass": 2.42}
    assert read(small("four.mat")).constants == {"gain": 35.15}
    sound = read(small("a.flac"))
    assert {(c.name, c.unit, c.fs) for c in sound.columns} == {("ch1", "FS", 8000.0), ("ch2", "FS", 8000.0)}
    assert any("relative to full scale" in note for note in sound.notes)
    assert [(c.fs, c.unit) for c in read(small("binary.uff")).columns] == [(512.0, "g0")] * 2  # g, of an acceleration


# ---- damage

CUTS = 60


@pytest.mark.parametrize("name", SMALL)
def test_a_file_cut_anywhere_is_refused(small: Formats, tmp_path: Path, name: str) -> None:
    data = small(name).read_bytes()
    rng = np.random.default_rng(len(data))
    end = len(data.rstrip(b"\n")) if name.endswith("uff") else len(data)
    cuts = {*range(0, 40, 5), end - 1, end - 2, *rng.integers(40, end, CUTS).tolist()}
    if name == "a.tdms":  # a cut between two segments leaves a whole file of the first: no byte tells it apart
        second = data.index(b"TDSm", 4)
        cuts.discard(second)
    path = tmp_path / name
    for cut in sorted(cuts):
        path.write_bytes(data[:cut])
        if recognised(path) is None:
            assert cut < 1024
            continue
        with pytest.raises(FormatError):
            whole(read(path))


def test_real_tdms_cut_at_every_byte_is_refused(dataset: Formats, tmp_path: Path) -> None:
    data = (dataset("formats") / "raw_timestamps.tdms").read_bytes()
    path = tmp_path / "cut.tdms"
    path.write_bytes(data)
    for cut in range(len(data) - 1, 3, -1):
        os.truncate(path, cut)
        with pytest.raises(FormatError, match="cut off"):
            read(path)


@pytest.mark.parametrize(
    ("folder", "name"),
    [
        ("formats", "raw1.tdms"),
        ("formats", "Digital_Input.tdms"),
        ("formats", "v7.mat"),
        ("formats", "v73.mat"),
        ("formats", "testhdf5_7.4_GLNX86.mat"),
        ("frame_base_excited", "s_b_250g_x.mat"),
        ("emps", "DATA_EMPS.mat"),
        ("audio", "canary_01.ogg"),
        ("formats", "Sample_UFF58b_bin.uff"),
        ("formats", "Sample_UFF58_ascii.uff"),
    ],
)
def test_real_file_cut_is_refused(dataset: Formats, tmp_path: Path, folder: str, name: str) -> None:
    data = (dataset(folder) / name).read_bytes()
    path = tmp_path / name
    for cut in [*np.linspace(600, len(data) - 4, 15).astype(int), len(data) - 3]:
        path.write_bytes(data[:cut])
        if recognised(path) is not None:
            with pytest.raises(FormatError):
                whole(read(path))


@pytest.mark.parametrize("name", SMALL)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    edits=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=6),
    near=st.sampled_from([200, 2000, 10**9]),
)
def test_mutated_file_is_read_or_refused(
    small: Formats, tmp_path: Path, name: str, edits: list[tuple[float, int]], near: int
) -> None:
    data = bytearray(small(name).read_bytes())
    for where, value in edits:
        data[int(where * min(near, len(data)))] = value
    path = tmp_path / name
    path.write_bytes(bytes(data))
    if recognised(path) is None:
        return
    try:
        columns = whole(read(path))
    except StickslipError:
        return
    assert all(values.dtype == np.float64 and values.ndim == 1 for values in columns.values())


def test_damaged_tag_of_a_mat_file_is_refused_before_scipy_sees_it(small: Formats, tmp_path: Path) -> None:
    """An unknown element type makes scipy read past its own table and end the process."""
    for name in ("five.mat", "packed.mat"):
        data = bytearray(small(name).read_bytes())
        data[data.index(b"\x09\x00\x00\x00") if name == "five.mat" else 128] = 155
        path = tmp_path / name
        path.write_bytes(bytes(data))
        with pytest.raises(FormatError, match="type"):
            read(path)


def test_tdms_that_states_a_million_scales_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "scales.tdms"
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("g", "c", np.arange(9.0), {"NI_Number_Of_Scales": 10_000_000})])
    with pytest.raises(FormatError, match="10000000 scales"):
        read(path)


# ---- sound


def test_real_sounds(dataset: Formats) -> None:
    for path in sorted(dataset("audio").glob("*.ogg")):
        table = read(path)
        expected, rate = soundfile.read(path, always_2d=True)
        assert {column.fs for column in table.columns} == {float(rate)}
        assert np.array_equal(np.stack(list(whole(table).values()), axis=1), expected)
        assert table.columns[0].name == ("sound" if expected.shape[1] == 1 else "ch1")


@pytest.mark.parametrize("subtype", ["PCM_16", "PCM_24", "FLOAT", "DOUBLE"])
def test_full_scale_is_one(tmp_path: Path, subtype: str) -> None:
    path = tmp_path / "tone.wav"
    tone = 0.5 * np.sin(2 * np.pi * 440 * np.arange(4000) / 44100)
    soundfile.write(path, tone, 44100, subtype=subtype)
    step = {"PCM_16": 2**-15, "PCM_24": 2**-23, "FLOAT": 2**-24, "DOUBLE": 0.0}[subtype]
    assert np.max(np.abs(whole(read(path))["sound"] - tone)) <= step


def test_wav_of_a_recorder_that_did_not_close_it_is_read_with_a_note(small: Formats, tmp_path: Path) -> None:
    data = bytearray(small("a.wav").read_bytes())
    place = data.index(b"data") + 4
    data[place : place + 4] = b"\xff" * 4
    path = tmp_path / "open.wav"
    path.write_bytes(bytes(data))
    table = read(path)
    assert "did not close" in table.cut
    assert len(whole(table)["ch1"]) == 400


# ---- HDF5


def test_nothing_outside_an_hdf5_file_is_opened(tmp_path: Path) -> None:
    secret, path = tmp_path / "secret.h5", tmp_path / "links.h5"
    with h5py.File(secret, "w") as file:
        file["x"] = np.arange(50.0)
    np.arange(50.0).tofile(tmp_path / "raw.bin")
    layout = h5py.VirtualLayout((50,), dtype=float)
    layout[:] = h5py.VirtualSource(str(secret), "x", shape=(50,))
    with h5py.File(path, "w") as file:
        file["own"] = np.arange(3.0)
        file["alias"] = h5py.SoftLink("/own")
        file["link"] = h5py.ExternalLink(str(secret), "/x")
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("external", (50,), float, external=[(str(tmp_path / "raw.bin"), 0, 400)])
        file["zone/back"] = file["/"]
    table = read(path)
    assert [column.name for column in table.columns] == ["own"]
    assert sum("another file" in note for note in table.notes) == 3


def test_hdf5_that_claims_more_than_it_stores_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "claims.h5"
    with h5py.File(path, "w") as file:
        file["own"] = np.arange(3.0)
        file.create_dataset("huge", (10**15,), float, chunks=(1000,))
    table = read(path)
    assert [column.name for column in table.columns] == ["own"]
    assert "claims 1000000000000000 values but stores 0 bytes" in table.notes[0]


def test_hdf5_without_numbers_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "words.h5"
    with h5py.File(path, "w") as file:
        file["words"] = ["a", "b"]
        file["complex"] = np.array([1j, 2j])
    with pytest.raises(FormatError, match="holds text"):
        read(path)


# ---- Parquet


def test_parquet_dates_gaps_and_text(tmp_path: Path) -> None:
    path = tmp_path / "mixed.parquet"
    frame = pd.DataFrame(
        {
            "when": pd.date_range("2024-05-01", periods=6, freq="20ms"),
            "x": [1.0, None, 3.0, 4.0, 5.0, 6.0],
            "count": pd.array([1, None, 3, 4, 5, 6], dtype="Int64"),
            "word": list("abcdef"),
        }
    )
    frame.to_parquet(path, row_group_size=4)
    table = read(path)
    columns = whole(table, size=5)
    assert units(table) == {"when": "s", "x": None, "count": None}
    assert np.allclose(columns["when"], np.arange(6) * 0.02, atol=1e-12)
    assert np.array_equal(columns["count"], [1, np.nan, 3, 4, 5, 6], equal_nan=True)
    assert np.isnan(columns["x"][1])
    assert "word" in table.notes[0]
