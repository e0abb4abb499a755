"""MATLAB, TDMS and UFF: real files against other programs, what their writers leave behind, what is refused."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import pyuff
import scipy.io
from nptdms import ChannelObject, TdmsFile, TdmsWriter

import stickslip as ss
from format_files import Formats, X, read, units, whole, write_uff
from stickslip.errors import FormatError

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


def test_uff_keeps_time_histories_beside_spectra_and_uneven_time(tmp_path: Path) -> None:
    path = tmp_path / "mixed.uff"
    write_uff(path)
    common: dict[str, Any] = {
        "rsp_node": 7, "rsp_dir": 1, "ref_dir": 0, "ref_node": 0, "id1": "NONE", "rsp_ent_name": "NONE",
        "ref_ent_name": "NONE", "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0, "binary": 0,
    }  # fmt: skip
    frequency = np.arange(8.0)
    spectrum = pyuff.prepare_58(
        **common,
        func_type=4,
        data=np.ones(8) + 1j,
        x=frequency,
        abscissa_spacing=1,
        abscissa_spec_data_type=18,
        ordinate_spec_data_type=12,
    )
    stamps = np.array([0.0, 0.1, 0.3, 0.6])
    uneven = pyuff.prepare_58(
        **common,
        func_type=1,
        data=stamps**2,
        x=stamps,
        abscissa_spacing=0,
        abscissa_spec_data_type=17,
        ordinate_spec_data_type=8,
        ordinate_axis_units_lab="mm",
    )
    pyuff.UFF(str(path)).write_sets([spectrum, uneven], mode="add")
    table = read(path)
    assert [column.name for column in table.columns] == ["1+Z", "2+Z", "7+X time", "7+X"]
    assert "frequency response function" in table.notes[0]
    assert units(table)["7+X"] == "mm"
    assert np.allclose(whole(table)["7+X time"], stamps)


# ---- oscilloscopes


def test_tektronix_has_its_settings_beside_the_first_rows(tmp_path: Path) -> None:
    settings = ["Record Length,6.0e+01", "Sample Interval,1e-3", "Trigger Point,3e1", ",", ",", "Source,CH2"]
    settings += ["Vertical Units,V", "Horizontal Units,s", *[","] * 52]
    times, volts = np.arange(60) / 1e3 - 0.03, np.round(np.sin(np.arange(60) / 4), 5)
    lines = [f"{text},,{t:018.12f},  {v:.5f}," for text, t, v in zip(settings, times, volts, strict=True)]
    path = tmp_path / "F0000CH2.CSV"
    path.write_text("\r\n".join(lines) + "\r\n")
    record = ss.read_record(path)
    assert list(record) == ["CH2"]
    assert (record.channels["CH2"].unit, record.start) == ("V", pytest.approx(-0.03))
    assert record.fs == pytest.approx(1000.0, rel=1e-9)
    assert record["CH2"] == pytest.approx(volts, rel=1e-12)
    path.write_text("\r\n".join(lines[:50]))
    assert "it has 50 of 60 rows" in str(ss.read_record(path).check()[0])


def test_rigol_states_start_and_increment_above_its_rows(tmp_path: Path) -> None:
    volts = np.round(np.sin(np.arange(60) / 4), 5)
    head = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-6.000000e-03,2.000000e-04\n"
    path = tmp_path / "NewFile1.csv"
    path.write_text(head + "".join(f"{row},{v:.5f},{-v:.5f},,\n" for row, v in enumerate(volts)))
    record = ss.read_record(path, channels={"x": "CH1 [V] @ 2 mm/V", "load": "CH2 [V] @ 10 N/V"})
    assert (record.fs, record.start) == (pytest.approx(5000.0), pytest.approx(-6e-3))
    assert record["x"] == pytest.approx(2e-3 * volts, rel=1e-12)
    assert record["load"] == pytest.approx(-10 * volts, rel=1e-12)
    path.write_text(head.replace("2.000000e-04", "0") + "0,1,2,,\n")
    with pytest.raises(FormatError, match="an increment of 0 s"):
        ss.read_record(path)
