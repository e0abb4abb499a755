"""The binary formats: real files against other programs and closed forms, damage refused, blocks equal to the whole."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
import pytest
import pyuff
import scipy.io
import soundfile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsFile, TdmsWriter

from stickslip.errors import FormatError, StickslipError
from stickslip.files import audio, hdf5, matlab, parquet, tdms, uff
from stickslip.files.table import Options, Table

FORMATS = (matlab, tdms, uff, audio, hdf5, parquet)
Formats = Callable[[str], Path]


def recognised(path: Path) -> ModuleType | None:
    with path.open("rb") as file:
        head = file.read(1 << 16)
    found = [module for module in FORMATS if module.recognise(path, head)]
    assert len(found) < 2
    return found[0] if found else None


def read(path: Path) -> Table:
    module = recognised(path)
    assert module is not None, path
    return module.read(path, Options())


def whole(table: Table, size: int = 10**7) -> dict[str, np.ndarray]:
    """Every column by itself, so that columns of different length come whole."""
    return {
        column.name: np.concatenate([block[column.name] for block in table.blocks([column.name], size)])
        for column in table.columns
    }


def units(table: Table) -> dict[str, str | None]:
    return {column.name: column.unit for column in table.columns}


# ---- a small file of each format, with what is in it

X = np.random.default_rng(3).standard_normal((400, 2)) * 0.1


def write_tdms(path: Path) -> None:
    waveform = {"wf_increment": 0.01, "wf_start_offset": 0.5, "wf_samples": 200, "unit_string": "mm"}
    with TdmsWriter(path) as writer:
        for part in (X[:200], X[200:]):
            channels = [ChannelObject("Rig", name, part[:, i], waveform) for i, name in enumerate(("x", "z"))]
            writer.write_segment(channels)


def write_mat4(path: Path) -> None:
    scipy.io.savemat(path, {"x": X[:, 0], "z": X[:, 1], "gain": 35.15}, format="4")


def write_mat5(path: Path, compressed: bool = False) -> None:
    content = {"x": X[:, 0], "z": X[:, 1:], "rig": {"both": X, "mass": 2.42}, "gain": 35.15}
    scipy.io.savemat(path, content, do_compression=compressed)


def write_mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("x", X[:, :1]), ("both", X), ("gain", np.array([[35.15]]))):
            file.create_dataset(name, data=values.T).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("x", data=X[:, 0], chunks=(64,), compression="gzip").attrs["units"] = "mm"
        file.create_dataset("group/both", data=X, chunks=(100, 2))
        file.create_dataset("raw", data=np.rec.fromarrays([X[:, 0], X[:, 1]], names="a,b"))
        file["group"].attrs["dt"] = 0.001
        file.attrs["fs"] = 50.0
        file["mass"] = 2.42


def write_parquet(path: Path) -> None:
    table = pyarrow.table({"x": X[:, 0], "z": X[:, 1].astype(np.float32), "n": np.arange(400)})
    pyarrow.parquet.write_table(table, path, row_group_size=128)


def write_sound(path: Path) -> None:
    soundfile.write(path, X, 8000)


def write_uff(path: Path) -> None:
    sets = [
        pyuff.prepare_58(
            binary=0, func_type=1, rsp_node=node + 1, rsp_dir=3, ref_dir=0, ref_node=0, data=X[:, node],
            x=np.arange(400) / 512, id1="NONE", rsp_ent_name="NONE", ref_ent_name="NONE", abscissa_spacing=1,
            abscissa_spec_data_type=17, abscissa_axis_units_lab="s", ordinate_spec_data_type=12,
            ordinate_axis_units_lab="g", orddenom_spec_data_type=0, z_axis_spec_data_type=0,
        )
        for node in (0, 1)
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, mode="add")


def write_binary_uff(path: Path) -> None:
    """The same sets, the numbers as float64 behind the header (pyuff leaves its file open when it writes these)."""
    ascii_file = path.with_suffix(".ascii")
    write_uff(ascii_file)
    lines = ascii_file.read_bytes().splitlines(keepends=True)
    each = len(lines) // 2
    parts = []
    for node in (0, 1):
        header = lines[node * each : node * each + 13]
        header[1] = b"    58b     1     2          11        3200     0     0           0           0\n"
        parts += [*header, X[:, node].astype("<f8").tobytes(), b"    -1\n"]
    path.write_bytes(b"".join(parts))


SMALL: dict[str, Callable[[Path], None]] = {
    "a.tdms": write_tdms,
    "four.mat": write_mat4,
    "five.mat": write_mat5,
    "packed.mat": lambda path: write_mat5(path, compressed=True),
    "seven.mat": write_mat73,
    "a.h5": write_hdf5,
    "a.parquet": write_parquet,
    "a.wav": write_sound,
    "a.flac": write_sound,
    "a.ogg": write_sound,
    "ascii.uff": write_uff,
    "binary.uff": write_binary_uff,
}


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
    [("formats", "raw1.tdms"), ("formats", "Digital_Input.tdms"), ("formats", "v7.mat"), ("formats", "v73.mat"),
     ("formats", "testhdf5_7.4_GLNX86.mat"), ("frame_base_excited", "s_b_250g_x.mat"), ("emps", "DATA_EMPS.mat"),
     ("audio", "canary_01.ogg"), ("formats", "Sample_UFF58b_bin.uff"), ("formats", "Sample_UFF58_ascii.uff")],
)  # fmt: skip
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


# ---- MATLAB


def test_v7_and_v73_hold_the_same(dataset: Formats) -> None:
    older, newer = (read(dataset("formats") / name) for name in ("v7.mat", "v73.mat"))
    assert dict(older.constants) == dict(newer.constants)
    columns = whole(older), whole(newer)
    assert set(columns[0]) == set(columns[1])
    assert len(columns[0]) == 300
    for name, values in columns[0].items():
        assert np.array_equal(values, columns[1][name])
    other = scipy.io.loadmat(dataset("formats") / "v7.mat", simplify_cells=True)
    assert np.array_equal(columns[1]["a_struct.matrix_7"], other["a_struct"]["matrix"][:, 6])
    assert newer.constants["a_struct.second_level.float"] == other["a_struct"]["second_level"]["float"]
    for table in (older, newer):
        assert "a_cell_array (a cell array)" in table.notes[0]
        assert "a_complex_matrix (complex)" in table.notes[0]
        assert "a_string (text)" in table.notes[0]


def test_rig_records_of_matlab(dataset: Formats) -> None:
    emps = read(dataset("emps") / "DATA_EMPS.mat")
    assert {column.name: column.rows for column in emps.columns} == dict.fromkeys(("qg", "qm", "t", "vir"), 24841)
    assert emps.constants["gtau"] == pytest.approx(35.1507, abs=5e-5)  # published
    old = whole(read(dataset("formats") / "testhdf5_7.4_GLNX86.mat"))
    assert np.allclose(old["testdouble"], np.arange(9) * np.pi / 4)


def test_matlab_shapes(tmp_path: Path) -> None:
    path = tmp_path / "shapes.mat"
    content = {
        "row": np.arange(5.0)[None, :], "wide": np.arange(10.0).reshape(2, 5), "square": np.arange(9.0).reshape(3, 3),
        "flags": np.array([[True], [False]]), "long": np.arange(3, dtype=np.int16)[:, None],
        "empty": np.zeros((0, 3)), "cube": np.zeros((2, 2, 2)), "words": "abc", "image": np.zeros((600, 600)),
        "many": np.array([{"a": 1.0}, {"a": 2.0}], dtype=object),
    }  # fmt: skip
    scipy.io.savemat(path, content)
    table = read(path)
    columns = whole(table)
    assert np.array_equal(columns["row"], np.arange(5.0))
    assert np.array_equal(columns["wide_2"], [5, 6, 7, 8, 9])  # time runs along the longer side
    assert np.array_equal(columns["square_1"], [0, 3, 6])  # and down the columns
    assert np.array_equal(columns["flags"], [1, 0])
    assert {c.name: c.rows for c in table.columns}["long"] == 3
    for word in ("empty (empty)", "cube (of 3 dimensions)", "words (text)", "image (a matrix of 600 x 600)", "many ("):
        assert word in table.notes[0]


@pytest.mark.parametrize(("word", "number"), [("fs", 250.0), ("Fs", 250.0), ("dt", 0.004)])
def test_a_rate_beside_the_vectors_is_taken(tmp_path: Path, word: str, number: float) -> None:
    old, new = tmp_path / "rate.mat", tmp_path / "rate.h5"
    scipy.io.savemat(old, {"x": X[:, 0], word: number})
    with h5py.File(new, "w") as file:
        file["x"], file[word] = X[:, 0], number
    assert [column.fs for path in (old, new) for column in read(path).columns] == [250.0, 250.0]


def opaque(name: str, of: str) -> bytes:
    """An object of MATLAB (table, datetime), as version 5 files hold it."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    ids = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"")
    ids = element(14, ids + element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1)))
    parts = element(6, struct.pack("<II", 17, 0)) + element(1, name.encode())
    return element(14, parts + element(1, b"MCOS") + element(1, of.encode()) + ids)


def test_matlab_table_is_refused_by_name_with_a_way_out(tmp_path: Path) -> None:
    path = tmp_path / "table.mat"
    scipy.io.savemat(path, {"comment": "run 7"})
    with path.open("ab") as file:
        file.write(opaque("T", "table") + opaque("when", "datetime"))
    with pytest.raises(FormatError, match=r"T \(an object, such as a table or datetime\), when \(an object"):
        read(path)
    scipy.io.savemat(path, {"x": np.arange(4.0)})
    with path.open("ab") as file:
        file.write(opaque("T", "table"))
    table = read(path)
    assert [column.name for column in table.columns] == ["x"]
    assert "T (an object" in table.notes[0]


def test_matlab_v73_table_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "table73.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        data = file.create_dataset("T", data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype=np.uint32))
        data.attrs["MATLAB_class"], data.attrs["MATLAB_object_decode"] = np.bytes_("table"), np.int32(3)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    with pytest.raises(FormatError, match=r"T \(an object.*plain arrays"):
        read(path)


# ---- TDMS


@pytest.mark.parametrize("name", ["raw1.tdms", "big_endian.tdms", "Digital_Input.tdms", "raw_timestamps.tdms"])
def test_real_tdms_equals_nptdms(dataset: Formats, name: str) -> None:
    path = dataset("formats") / name
    table = read(path)
    with TdmsFile.read(path) as file:
        expected = {f"{g.name}/{c.name}": c[:] for g in file.groups() for c in g.channels() if len(c)}
    columns = whole(table, size=777)
    assert list(columns) == list(expected)
    for column, values in expected.items():
        assert np.array_equal(columns[column], np.asarray(values, dtype=float))


def test_real_tdms_clocks(dataset: Formats) -> None:
    raw = read(dataset("formats") / "raw1.tdms")
    assert [(c.fs, c.unit, c.rows) for c in raw.columns] == [(50_000.0, "Volts", 2000)] * 7
    digital = read(dataset("formats") / "Digital_Input.tdms")
    assert [(c.fs, c.rows) for c in digital.columns] == [(2000.0, 20000), (40.0, 400), (0.8, 8)]
    sine = whole(read(dataset("formats") / "raw_timestamps.tdms"))["Untitled/Untitled"]
    assert np.allclose(sine, np.sin(2 * np.pi * np.arange(128) / 128), atol=1e-12)


def test_scenarios_of_nptdms(tmp_path: Path) -> None:
    """Every layout that npTDMS tests itself with: interleaved, text between, cut by a crash, reused headers."""
    scenarios = pytest.importorskip("nptdms.test.scenarios").get_scenarios()
    assert len(scenarios) > 20
    path = tmp_path / "scenario.tdms"
    for scenario in scenarios:
        generated, expected = scenario.values
        path.write_bytes(generated.get_bytes_io_file().read())
        plain = {f"{group}/{name}": np.asarray(values) for (group, name), values in expected.items()}
        plain = {name: values for name, values in plain.items() if values.dtype.kind in "fiub" and len(values)}
        if not plain:  # text and complex numbers alone
            continue
        table = read(path)
        for name, values in plain.items():
            got = np.concatenate([block[name] for block in table.blocks([name], 3)])
            assert np.array_equal(got, values.astype(float)), scenario.id
        if "less_data" in scenario.id or "incomplete" in scenario.id:
            assert table.notes, scenario.id


def test_daqmx_with_and_without_its_scaling(tmp_path: Path) -> None:
    daqmx, made = pytest.importorskip("nptdms.test.test_daqmx"), pytest.importorskip("nptdms.test.util")

    def text(words: str) -> tuple[int, str]:
        return 0x20, made.hexlify_value("<I", len(words)) + made.string_hexlify(words)

    scaling = {
        "NI_Number_Of_Scales": (3, made.hexlify_value("<i", 2)),
        "NI_Scale[1]_Scale_Type": text("Linear"),
        "NI_Scale[1]_Linear_Slope": (10, made.hexlify_value("<d", 0.5)),
        "NI_Scale[1]_Linear_Y_Intercept": (10, made.hexlify_value("<d", -1.0)),
        "NI_Scale[1]_Linear_Input_Source": (3, made.hexlify_value("<i", 0)),
    }
    path = tmp_path / "daqmx.tdms"
    for properties in (scaling, None):
        channels = [
            daqmx.daqmx_channel_metadata(f"ai{n}", 4, [4], [daqmx.daqmx_scaler_metadata(0, 3, 2 * n)], properties)
            for n in (0, 1)
        ]
        file = made.GeneratedFile()
        metadata = made.segment_objects_metadata(made.root_metadata(), made.group_metadata(), *channels)
        file.add_segment(daqmx.segment_toc(), metadata, "01 00 11 00 02 00 12 00 03 00 13 00 04 00 14 00")
        path.write_bytes(file.get_bytes_io_file().read())
        if properties:
            assert np.array_equal(whole(read(path), size=3)["Group/ai1"], 0.5 * np.arange(17, 21) - 1)
        else:
            with pytest.raises(FormatError, match="raw DAQmx data without its scaling"):
                read(path)


def test_tdms_dates_become_seconds_and_text_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "dates.tdms"
    dates = np.datetime64("2024-01-24T01:48:43.068614") + np.arange(6) * np.timedelta64(2500, "us")
    with TdmsWriter(path) as writer:
        channels = [ChannelObject("g", "when", dates), ChannelObject("g", "word", ["a"] * 6)]
        writer.write_segment(
            [*channels, ChannelObject("g", "c/d", np.arange(6.0)), ChannelObject("h/i", "x", np.ones(6))]
        )
    table = read(path)
    assert units(table) == {"g/when": "s", "g/c/d": None, "h/i/x": None}
    assert np.allclose(whole(table, size=4)["g/when"], np.arange(6) * 0.0025, atol=1e-12)
    assert "g/word" in table.notes[0]


def test_tdms_never_closed_by_its_writer_is_read_with_a_note(tmp_path: Path) -> None:
    path = tmp_path / "crashed.tdms"
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("g", "x", np.arange(100.0))])
    data = bytearray(path.read_bytes())
    data[12:20] = b"\xff" * 8  # LabVIEW states the length when it closes the segment
    path.write_bytes(bytes(data[:-80]))
    table = read(path)
    assert "without closing" in table.cut
    assert np.array_equal(whole(table)["g/x"], np.arange(90.0))


def test_tdms_ignores_the_index_beside_it(tmp_path: Path) -> None:
    path, other = tmp_path / "run.tdms", tmp_path / "other.tdms"
    for target, rows in ((path, 50), (other, 20)):
        with TdmsWriter(str(target), index_file=True) as writer:
            writer.write_segment([ChannelObject("g", "x", np.arange(float(rows)))])
    (tmp_path / "run.tdms_index").write_bytes((tmp_path / "other.tdms_index").read_bytes())
    assert len(whole(read(path))["g/x"]) == 50


# ---- UFF


def test_ascii_and_binary_uff_agree(dataset: Formats) -> None:
    tables = [read(dataset("formats") / name) for name in ("Sample_UFF58_ascii.uff", "Sample_UFF58b_bin.uff")]
    assert tables[0].columns == tables[1].columns
    column = tables[0].columns[0]
    assert (column.name, column.unit, column.rows, column.fs) == ("Mic 01", "Pa", 79292, 65536.0)
    text, binary = (whole(table)["Mic 01"] for table in tables)
    assert np.max(np.abs(text - binary) / np.maximum(np.abs(binary), 1e-30)) < 5.1e-6  # six digits


def test_four_accelerometers(dataset: Formats) -> None:
    table = read(dataset("formats") / "MPSTD#Set001_2024_10_08_10_27_07.uff")
    assert [column.name for column in table.columns] == [f"MPS set1 Dof{n}" for n in (1, 2, 3, 4)]  # two are "1+Z"
    assert {(c.fs, c.unit, c.rows) for c in table.columns} == {(3200.0, "m/s2", 222400)}
    expected = pyuff.UFF(str(dataset("formats") / "MPSTD#Set001_2024_10_08_10_27_07.uff")).read_sets(2)["data"]
    assert np.array_equal(whole(table)["MPS set1 Dof3"], expected)


def test_awkward_uff_files(dataset: Formats) -> None:
    folder = dataset("formats")
    sine = read(folder / "binary8byte.uff")
    assert units(sine) == {"sine 5 Hz": "g0"}
    assert np.allclose(whole(sine)["sine 5 Hz"], np.sin(2 * np.pi * 5 * np.arange(250) / 100), atol=1e-5)
    ragged = read(folder / "time-history-not-all-columns-filled.uff")
    assert (ragged.columns[0].rows, ragged.columns[0].fs, ragged.columns[0].unit) == (13, 20_000.0, "m/s²")
    assert whole(ragged)["1x"][-1] == -5.84096
    excerpt = read(folder / "dataset_milestone_in_header.uff")  # its sender kept 42 of 2.5 million values
    assert (excerpt.columns[0].name, excerpt.columns[0].rows, excerpt.columns[0].fs) == ("PWL Mic", 42, 51_200.0)
    assert "promises 2508876 values" in excerpt.cut


@pytest.mark.parametrize(
    ("name", "words"),
    [("sample_dataset58_psd.uff", "power spectral density"), ("non_ascii_header.uff", "frequency response function")],
)
def test_spectra_are_no_record(dataset: Formats, name: str, words: str) -> None:
    with pytest.raises(FormatError, match=words):
        read(dataset("formats") / name)


def test_uff_keeps_time_histories_beside_spectra_and_uneven_time(tmp_path: Path, small: Formats) -> None:
    path = tmp_path / "mixed.uff"
    path.write_bytes(small("ascii.uff").read_bytes())
    common: dict[str, Any] = {
        "rsp_node": 7, "rsp_dir": 1, "ref_dir": 0, "ref_node": 0, "id1": "NONE", "rsp_ent_name": "NONE",
        "ref_ent_name": "NONE", "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0, "binary": 0,
    }  # fmt: skip
    frequency = np.arange(8.0)
    spectrum = pyuff.prepare_58(
        **common, func_type=4, data=np.ones(8) + 1j, x=frequency, abscissa_spacing=1, abscissa_spec_data_type=18,
        ordinate_spec_data_type=12,
    )  # fmt: skip
    stamps = np.array([0.0, 0.1, 0.3, 0.6])
    uneven = pyuff.prepare_58(
        **common, func_type=1, data=stamps**2, x=stamps, abscissa_spacing=0, abscissa_spec_data_type=17,
        ordinate_spec_data_type=8, ordinate_axis_units_lab="mm",
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets([spectrum, uneven], mode="add")
    table = read(path)
    assert [column.name for column in table.columns] == ["1+Z", "2+Z", "7+X time", "7+X"]
    assert "frequency response function" in table.notes[0]
    assert units(table)["7+X"] == "mm"
    assert np.allclose(whole(table)["7+X time"], stamps)


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
