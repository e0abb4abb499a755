"""read_record: channels by expression, units, clocks, merging; all files of the public sets."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import stickslip as ss
from stickslip.files.expression import linear, split_spec
from stickslip.files.read import FORMATS
from stickslip.units import POUND_FORCE

AUDIO = (
    "canary_01", "chalk_screech_01", "chalk_write_01", "chalk_write_02", "chalk_write_03", "church_bells_01",
    "door_creak", "rain_light", "scrape_01", "scrape_02", "scrape_03", "scrape_04", "whistle",
)  # fmt: skip

CALLED = {
    "tdms": "TDMS",
    "matlab": "MAT",
    "hdf5": "HDF5",
    "parquet": "Parquet",
    "uff": "UFF|universal file format",
    "audio": "WAV",
    "lvm": "LVM",
    "rosbag": "MCAP, .*[Bb]ags|bags, MCAP",
    "mdf": "MDF",
    "json_table": "JSON",
    "oscilloscope": "oscilloscopes",
    "text": "CSV",
}


def test_every_format_is_named_where_users_read_of_it() -> None:
    """But the journal, which is the bench's own."""
    root, listed = Path(__file__).parents[1], set(FORMATS) - {"journal"}
    assert listed == set(CALLED), "give CALLED of this test what users call the format"
    texts = {place: (root / place).read_text("utf-8") for place in ("README.md", "src/stickslip/lab/page/data.js")}
    texts["read_record's docstring"] = ss.read_record.__doc__ or ""
    missing = [f"{word} in {place}" for word in CALLED.values() for place in texts if not re.search(word, texts[place])]
    assert not missing, f"name the format there: {', '.join(missing)}"


@pytest.fixture
def csv(tmp_path: Path) -> Callable[..., Path]:
    def write(text: str, name: str = "rig.csv") -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


# ---- the channel grammar


@pytest.mark.parametrize(
    ("text", "scales", "offset"),
    [
        ("F", {"F": 1.0}, 0.0),
        ("vir * 35.1507", {"vir": 35.1507}, 0.0),
        ("-200 * (F + 0.115)", {"F": -200.0}, -23.0),
        ("-(F - x) / 4 + 2*F - +1", {"F": 1.75, "x": 0.25}, -1.0),
        ("`Servo motor speed` * -20/60/1000", {"Servo motor speed": -20 / 60 / 1000}, 0.0),
        ("Servo motor speed", {"Servo motor speed": 1.0}, 0.0),
        ("#2 * 3 + `a-b`", {"F": 3.0, "a-b": 1.0}, 0.0),
        ("a-b", {"a-b": 1.0}, 0.0),
        ("gain * F + gain", {"F": 2.5}, 2.5),
    ],
)
def test_arithmetic_is_linear_in_the_columns(text: str, scales: dict[str, float], offset: float) -> None:
    names = {"x": "x", "F": "F", "vir": "vir", "Servo motor speed": "Servo motor speed", "a-b": "a-b", "#2": "F"}
    found = linear(text, names, {"gain": 2.5})
    assert dict(found.scales) == pytest.approx(scales)
    assert found.offset == pytest.approx(offset)


@pytest.mark.parametrize(
    "text",
    [
        "F * x",
        "F ** 2",
        "1 / F",
        "F / 0",
        "3 + 4",
        "F(2)",
        "F.real",
        "x[0] + F",
        "__import__('os')",
        "lambda: F",
        "F if F else x",
        "F +",
        "'F'",
        "1or 2",
        "F == x",
        "[F]",
        "F * 1e400",
        "(" * 240 + "F" + ")" * 240,
        "F * True",
        "F, x",
        "x := 3",
        "\0",
        "F * 1e200 * 1e200",
        "9" * 400 + " * F",
    ],
)
def test_anything_else_is_refused_in_one_sentence(text: str) -> None:
    with pytest.raises(ss.errors.RecordError, match=r"a channel is|did you mean|choose one|names no column"):
        linear(split_spec(text).arithmetic, {"x": "x", "F": "F"}, {})


@given(st.text(max_size=60))
def test_no_text_gets_past_the_grammar(text: str) -> None:
    try:
        found = linear(split_spec(text).arithmetic, {"x": "x", "F": "F"}, {})
    except ss.errors.RecordError:
        return
    assert set(found.scales) <= {"x", "F"}
    assert all(np.isfinite([*found.scales.values(), found.offset]))


def test_a_missing_column_lists_what_there_is(csv: Callable[..., Path]) -> None:
    path = csv("t,servo speed,force\n0,1,2\n1,2,3\n")
    with pytest.raises(
        ss.errors.RecordError, match=r"no column 'forse'; the file has t, servo speed, force; did you mean 'force'"
    ):
        ss.read_record(path, channels={"force": "forse * 2 [N]"})


# ---- units and sensitivities


def test_units_from_header_call_and_expression(csv: Callable[..., Path]) -> None:
    path = csv("t [ms],x [mm],cell [V],acc\n0,1,0.5,1\n4,2,1,2\n8,3,2,3\n")
    record = ss.read_record(
        path,
        channels={"x": "x", "z": "x * 2 [um]", "load": "cell @ 500 mV/lbf", "a": "acc"},
        units={"acc": "g"},
    )
    assert record.fs == 250
    np.testing.assert_allclose(record["x"], [1e-3, 2e-3, 3e-3], rtol=1e-15)
    np.testing.assert_allclose(record["z"], [2e-6, 4e-6, 6e-6], rtol=1e-15)
    np.testing.assert_allclose(record["load"], np.array([1, 2, 4]) * POUND_FORCE, rtol=1e-15)
    np.testing.assert_allclose(record["a"], np.array([1, 2, 3]) * 9.80665, rtol=1e-15)
    assert record.channels["load"].sensitivity == "500 mV/lbf"
    assert record.channels["load"].unit == "N"


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("ch1 [V] @ 100 mV/g", "a", 2 / 0.1 * 9.80665),
        ("ch1 [mV] @ 100 mV/g", "a", 2e-3 / 0.1 * 9.80665),
        ("ch1 [V] @ 10.2 mV/(m/s2)", "a", 2 / 0.0102),
        ("ch1 [V] @ 0.5 mm/V", "x", 1e-3),
        ("ch1 [V] @ 2.5 V/kN", "load", 800.0),
        ("ch1 [V] @ 50 mV/Pa", "sound", 40.0),
        ("(ch1 - 1) * 2 [V] @ 4 mV/lb", "load", 500 * POUND_FORCE),
    ],
)
def test_a_sensitivity_turns_volts_into_the_quantity(
    csv: Callable[..., Path], text: str, name: str, value: float
) -> None:
    record = ss.read_record(csv("ch1\n2\n2\n"), channels={name: text}, fs=10)
    assert record[name][0] == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("channels", "units", "words"),
    [
        ({"x": "F [N]"}, None, "x is displacement|measured in N"),
        ({"x": "F [furlongs per]"}, None, "not known"),
        ({"x": "F"}, {"x": "kg"}, "measured in kg"),
        ({"x": "F"}, {"y": "mm"}, "no channel or column 'y'"),
        ({"load": "F @ 500 mV/lbf"}, None, "no unit"),
        ({"load": "F [m] @ 500 mV/lbf"}, None, "one of the sensitivity's units"),
        ({"load": "F [V] @ 500"}, None, "a number and two units"),
        ({"load": "F [V] @ 0 mV/lbf"}, None, "a number and two units"),
        ({"x": ""}, None, "names no column"),
        ({"x-1": "F [m]"}, None, "letters, digits"),
        ({}, None, "no column beside time"),
    ],
)
def test_a_wrong_unit_or_name_is_one_sentence(
    csv: Callable[..., Path], channels: dict[str, str], units: dict[str, str] | None, words: str
) -> None:
    with pytest.raises(ss.errors.RecordError, match=words):
        ss.read_record(csv("t,F\n0,1\n1,2\n"), channels=channels, units=units)


def test_without_a_map_names_that_fit_become_channels(csv: Callable[..., Path]) -> None:
    record = ss.read_record(
        csv("Time (s),x [V],Force [kN],Friction,flow rate [l/min],2nd,n [blips]\n0,1,2,3,4,5,6\n1,1,1,1,1,1,1\n")
    )
    assert {name: channel.unit for name, channel in record.channels.items()} == {
        "x_V": "V",
        "force": "N",
        "Friction": "1",
        "flow_rate": "m^3/s",
        "c_2nd": "1",
        "n": "blips",
    }
    assert record["force"][0] == 2000


@pytest.mark.parametrize(
    ("titles", "name", "note"),
    [
        ("t [s],x [N]", "x_N", "'x' is x_N: N is no unit of x"),
        ("t [s],x [mm],x [mm]", "x_2", "another column is called x: it is x_2"),
    ],
)
def test_a_title_that_is_not_what_it_seems_is_in_the_history(
    csv: Callable[..., Path], titles: str, name: str, note: str
) -> None:
    rows = [",".join([f"{row / 100}"] + [f"{row % 7}"] * titles.count("x")) for row in range(20)]
    record = ss.read_record(csv("\n".join([titles, *rows, ""])))
    assert name in record
    assert record.history[0].outcome == f"20 samples at 100 Hz; {note}"


@pytest.mark.parametrize("title", ["Stroke (mm)", "Stroke(mm)", "Stroke", "2 * `Stroke (mm)` - Stroke"])
def test_a_column_is_found_by_its_title_as_it_stands_in_the_file(csv: Callable[..., Path], title: str) -> None:
    record = ss.read_record(csv("t (s),Stroke (mm)\n0,1\n0.1,2\n0.2,4\n"), channels={"x": title})
    assert record["x"] == pytest.approx([1e-3, 2e-3, 4e-3])


def test_a_unit_nobody_states_is_taken_as_si_and_said(csv: Callable[..., Path]) -> None:
    record = ss.read_record(csv("t,x\n0,1\n1,2\n"))
    assert record["x"][0] == 1
    assert record.channels["x"].source == "x (no unit stated, taken as m)"


# ---- clocks


def test_neither_time_nor_rate(csv: Callable[..., Path]) -> None:
    path = csv("x [m],v [m/s]\n1,2\n3,4\n")
    with pytest.raises(ss.errors.RecordError, match=r"neither time nor sampling rate; .* fs= in Hz.*columns: x, v"):
        ss.read_record(path)
    assert ss.read_record(path, fs=100).fs == 100
    with pytest.raises(ss.errors.RecordError, match="positive and finite"):
        ss.read_record(path, fs=-1)


def test_a_given_rate_overrides_the_time_column(csv: Callable[..., Path]) -> None:
    assert ss.read_record(csv("t,x [m]\n0,1\n0,2\n9,3\n"), fs=8).time.tolist() == [0, 0.125, 0.25]


def test_rows_are_cut_before_the_clock_is_read(csv: Callable[..., Path]) -> None:
    path = csv("t,x [m]\n" + "".join(f"{t},{i}\n" for i, t in enumerate([0, 5, 6, 7, 8, 9, 99])))
    record = ss.read_record(path, rows=(1, -1))
    assert (record.stamps, record.fs, record.start) == (None, 1.0, 5.0)
    assert ss.read_record(path, rows=(2, None), fs=2).start == 1.0
    with pytest.raises(ss.errors.RecordError, match="hold nothing"):
        ss.read_record(path, rows=(10, None))


# ---- several files


def test_files_on_one_clock_merge(dataset: Callable[[str], Path]) -> None:
    folder = dataset("frame_base_excited")
    record = ss.read_record(
        [folder / "s_b_450g_x.mat", folder / "s_b_450g_y.mat"], channels={"x": "x [mm]", "z": "y [mm]"}
    )
    assert (record.fs, record.start, len(record), record.stamps) == (250.0, 17.0, 2501, None)
    assert [entry["name"] for entry in record.history[0].arguments["files"]] == ["s_b_450g_x.mat", "s_b_450g_y.mat"]
    assert 1e-4 < np.ptp(record["z"]) < 0.1


def test_columns_of_one_name_are_told_apart_by_file(csv: Callable[..., Path]) -> None:
    paths = [csv("t,x\n0,1\n1,2\n", "top.csv"), csv("t,x\n0,5\n1,6\n", "base.csv")]
    record = ss.read_record(paths, channels={"x": "top.csv:x [m]", "z": "`base.csv:#2` - `top.csv:x` [m]"})
    assert record["x"].tolist() == [1, 2]
    assert record["z"].tolist() == [4, 4]
    with pytest.raises(ss.errors.RecordError, match=r"no column 'x'.*top.csv:x"):
        ss.read_record(paths, channels={"x": "x [m]"})


@pytest.mark.parametrize("other", ["t,z [m]\n0,1\n1,2\n", "t,z [m]\n0,1\n1.1,2\n2.2,3\n", "t,z [m]\n5,1\n6,2\n7,3\n"])
def test_files_with_clocks_of_their_own_are_refused(csv: Callable[..., Path], other: str) -> None:
    paths = [csv("t,x [m]\n0,1\n1,2\n2,3\n"), csv(other, "other.csv")]
    with pytest.raises(ss.errors.RecordError, match=r"share one clock.*synchronise"):
        ss.read_record(paths)


def test_two_time_columns_of_one_title_must_agree(csv: Callable[..., Path]) -> None:
    head = 'Unit,"V",Unit,"V"\nChannel name,"F",Channel name,"x"\n'
    assert len(ss.read_record(csv(head + "0,1,0,2\n1,2,1,3\n"))) == 2
    with pytest.raises(ss.errors.RecordError, match="one record has one clock"):
        ss.read_record(csv(head + "0,1,0.5,2\n1,2,1.5,3\n"))


# ---- history


def test_the_history_names_the_source(csv: Callable[..., Path]) -> None:
    path = csv("t [s],x [mm]\n0,1\n1,2\n")
    step = ss.read_record(path, channels={"x": "x"}, rows=(0, None)).history[0]
    assert step.action == "read_record"
    assert step.arguments["channels"] == {"x": "x"}
    assert step.arguments["files"] == [
        {
            "name": "rig.csv",
            "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            "bytes": path.stat().st_size,
            "format": "text",
        }
    ]
    assert str(path.parent) not in json.dumps(step.to_dict())


def test_the_history_names_a_folder_as_it_was_typed(csv: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    path = csv("t [s],x [mm]\n0,1\n1,2\n")
    monkeypatch.chdir(path.parent.parent)
    (file,) = ss.read_record(f"{path.parent.name}/{path.name}").history[0].arguments["files"]
    assert file["folder"] == path.parent.name


# ---- JSON and LVM


@pytest.mark.parametrize(
    "contents",
    [
        {"t": [0, 0.1, 0.2], "x [mm]": [1, None, 3]},
        {"fs": 10, "x": [1, None, 3], "units": {"x": "mm"}},
        {"dt": 0.1, "columns": ["x [mm]", "n"], "data": [[1, 4], [None, 5], [3, 6]]},
        {"data": {"x [mm]": [1, None, 3]}, "sampling rate [Hz]": 10},
        [{"t": 0, "x [mm]": 1}, {"t": 0.1}, {"t": 0.2, "x [mm]": 3}],
        [{"data": [1, None, 3], "fs": 10, "name": "x", "unit_str": "mm"}],
    ],
)
def test_json_whatever_way_round(csv: Callable[..., Path], contents: object) -> None:
    record = ss.read_record(csv(json.dumps(contents), "rig.json"))
    np.testing.assert_array_equal(record["x"], [1e-3, np.nan, 3e-3])
    assert record.fs == 10


def test_friction_damper_rows(dataset: Callable[[str], Path]) -> None:
    folder = dataset("band_brake_damper")
    paths = sorted(folder.glob("*.json"))
    assert len(paths) >= 8
    for path in paths:
        record = ss.read_record(path, channels={"x": "#2 [in]", "friction": "c3 [kip]", "v": "#4 [in/s]"}, time="#1")
        first = json.loads(path.read_text())["data"][0]
        assert record.fs == 1024
        assert record["x"][0] == pytest.approx(first[1] * 0.0254, rel=1e-15)
        assert record["friction"][0] == pytest.approx(first[2] * 1000 * POUND_FORCE, rel=1e-15)


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t{decimal}
Multi_Headings\tNo
X_Columns\tOne
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t3\t3\t
Y_Unit_Label\tmm\tN\t
X_Dimension\tTime\tTime\t
X0\t0{decimal}0\t0{decimal}0\t
Delta_X\t0{decimal}004\t0{decimal}004\t
***End_of_Header***\t\t\t
X_Value\tx\tforce\tComment
0{decimal}000\t1{decimal}5\t10\t
0{decimal}004\t2{decimal}5\t20\t
0{decimal}008\t3{decimal}5\t30\t
"""


@pytest.mark.parametrize("decimal", [".", ","])
def test_lvm(csv: Callable[..., Path], decimal: str) -> None:
    path = csv(LVM.replace("{decimal}", decimal), "rig.lvm")
    path.with_name("rig.lvm.pkl").write_bytes(b"cos\nsystem\n(S'false'\ntR.")  # a pickle that must not be loaded
    record = ss.read_record(path)
    assert record.fs == 250
    np.testing.assert_allclose(record["x"], [1.5e-3, 2.5e-3, 3.5e-3], rtol=1e-15)
    np.testing.assert_array_equal(record["force"], [10, 20, 30])
    assert path.with_name("rig.lvm.pkl").read_bytes().startswith(b"cos")


# ---- all files of the public sets


def test_emps_force_by_the_gain_in_the_file(dataset: Callable[[str], Path]) -> None:
    path = dataset("emps") / "DATA_EMPS.mat"
    record = ss.read_record(path, channels={"x": "qm [m]", "force": "vir * 35.1507 [N]", "gain": "vir * gtau [N]"})
    assert (record.fs, len(record)) == (1000.0, 24841)
    np.testing.assert_allclose(record["gain"], record["force"], rtol=2e-6)  # the file holds the gain itself


def test_paper_and_pendulum(dataset: Callable[[str], Path]) -> None:
    for name in ("k168Nm_v42", "k168Nm_v1100", "k168Nm_v4300"):
        record = ss.read_record(
            dataset("paper_stick_slip") / f"{name}.mat", channels={"friction": "Fnorm * 0.30117 [N]"}
        )
        assert record.fs == 2000
    path = dataset("pendulum_decay") / "pend1.csv"
    record = ss.read_record(path, channels={"theta": "#2 [rad]"}, time="#1")
    assert record.stamps is None
    assert record.fs == pytest.approx(150, rel=1e-3)
    assert "of uniform" in record.history[0].outcome
    assert ss.read_record(path, channels={"theta": "#2 [rad]"}, fs=150).fs == 150


@pytest.mark.parametrize("name", AUDIO)
def test_recordings(dataset: Callable[[str], Path], name: str) -> None:
    path = dataset("audio") / f"{name}.ogg"
    if not path.exists():
        pytest.skip(f"{path.name} is not in this copy of the set")
    record = ss.read_record(path)
    assert record.fs == 44100
    assert 0.01 < max(np.ptp(record[channel]) for channel in record) <= 2.2


def test_instrument_files_agree_in_pairs(dataset: Callable[[str], Path]) -> None:
    folder = dataset("formats")
    text, binary = (ss.read_record(folder / f"Sample_UFF58{kind}.uff") for kind in ("_ascii", "b_bin"))
    np.testing.assert_allclose(text["Mic_01"], binary["Mic_01"], rtol=5.1e-6)  # six digits in ASCII
    assert text.fs == binary.fs == 65536
    older, newer = (ss.read_record(folder / f"v{version}.mat", fs=1) for version in ("7", "73"))
    assert list(older) == list(newer)
    for name in older:
        np.testing.assert_array_equal(older[name], newer[name])


@pytest.mark.parametrize(
    ("name", "fs", "rows", "first"),
    [
        ("MPSTD#Set001_2024_10_08_10_27_07.uff", 3200, 222400, "MPS_set1_Dof1"),
        ("binary8byte.uff", 100, 250, "sine_5_Hz"),
        ("time-history-not-all-columns-filled.uff", 20000, 13, "c_1x"),
        ("dataset_milestone_in_header.uff", 51200, 42, "PWL_Mic"),
        ("raw1.tdms", 50000, 2000, "First_Channel"),
        ("big_endian.tdms", 1000, 3500, "Amplitude_sweep"),
        ("raw_timestamps.tdms", 1000, 128, "Untitled"),
        ("Digital_Input.tdms", 2000, 20000, "Dev1_port3_line7_line_0"),
    ],
)
def test_instrument_files(dataset: Callable[[str], Path], name: str, fs: float, rows: int, first: str) -> None:
    record = ss.read_record(dataset("formats") / name)
    assert (record.fs, len(record), next(iter(record))) == (fs, rows, first)


@pytest.mark.parametrize("name", ["non_ascii_header.uff", "sample_dataset58_psd.uff"])
def test_spectra_are_no_records(dataset: Callable[[str], Path], name: str) -> None:
    with pytest.raises(ss.errors.FormatError, match="no function over time"):
        ss.read_record(dataset("formats") / name)


def test_a_matlab_file_without_a_clock_reads_with_a_rate(dataset: Callable[[str], Path]) -> None:
    record = ss.read_record(dataset("formats") / "testhdf5_7.4_GLNX86.mat", fs=1)
    np.testing.assert_allclose(record["testdouble"], np.arange(9) * np.pi / 4, rtol=1e-14)


@pytest.mark.parametrize("title", ["acc", "Accel X", "frame_acc_z", "acc2", "Beschleunigung"])
def test_g_of_an_acceleration_is_gravity_whatever_its_name(tmp_path: Path, title: str) -> None:
    (tmp_path / "run.csv").write_text(f"t [s],{title} [g]\n0,1\n1,2\n2,-1\n")
    record = ss.read_record(tmp_path / "run.csv")
    (name,) = record
    assert record.channels[name].unit == "m/s^2"
    np.testing.assert_allclose(record[name], 9.80665 * np.array([1, 2, -1]))


def test_g_of_anything_else_is_gram_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("t [s],top [g],ch [V]\n0,1,1\n1,2,1\n2,-1,2\n")
    record = ss.read_record(tmp_path / "run.csv")
    assert record.channels["top"].unit == "kg"
    assert "top: g read as a mass; call the channel a or acc if it is gravity" in record.history[-1].outcome
    spec = {"acc": "ch @ 100 mV/g", "top": "ch @ 100 mV/g", "a": "top [g]"}
    record = ss.read_record(tmp_path / "run.csv", channels=spec)
    assert [record.channels[name].unit for name in spec] == ["m/s^2", "kg", "m/s^2"]
    assert "top: g read as a mass" in record.history[-1].outcome


def test_an_error_of_the_program_is_not_taken_for_a_damaged_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.csv").write_text("t [s],x [m]\n0,1\n1,2\n2,-1\n")

    def broken(*_: object) -> None:
        raise TypeError("a slip of the program")

    monkeypatch.setattr("stickslip.files.text.find_layout", broken)
    with pytest.raises(TypeError, match="a slip of the program"):
        ss.read_record(tmp_path / "run.csv")


def test_a_number_too_large_for_a_float_is_no_column(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text('{"t": [0, 1, 2], "x": [1, 2, 3], "y": [1, 2, 1' + "0" * 400 + "]}")
    assert list(ss.read_record(tmp_path / "run.json")) == ["x"]


@pytest.mark.parametrize("unit", ["(m", "m(", 'm"""'])
def test_a_unit_that_is_no_unit_is_a_sentence(tmp_path: Path, unit: str) -> None:
    (tmp_path / "run.csv").write_text("t [s],x\n0,1\n1,2\n2,-1\n")
    with pytest.raises(ss.errors.RecordError, match="is not known"):
        ss.read_record(tmp_path / "run.csv", units={"x": unit})


@pytest.mark.parametrize(
    "title", ["Temps (s)", "时间 (s)", "Zeit [s]", "Tiempo", "tempo", "Czas [s]", "Temps écoulé (s)", "时间"]
)
def test_time_is_known_in_several_languages(csv: Callable[..., Path], title: str) -> None:
    time = np.arange(100) / 250
    rows = "\n".join(f"{second:.3f},{np.sin(second):.6f}" for second in time)
    record = ss.read_record(csv(f"{title},x [mm]\n{rows}\n"))
    assert list(record) == ["x"]
    assert record.fs == pytest.approx(250)


@pytest.mark.parametrize("title", ["Temps", "Temps [°C]", "Dauer"])
def test_what_may_be_no_time_is_refused_with_the_columns_that_there_are(csv: Callable[..., Path], title: str) -> None:
    rows = "\n".join(f"{second / 250:.3f},{np.sin(second / 250):.6f}" for second in range(100))
    path = csv(f"{title},x [mm]\n{rows}\n")
    with pytest.raises(ss.errors.RecordError, match=rf"time= \(columns: {title.partition(' ')[0]}, x\)"):
        ss.read_record(path)
    assert ss.read_record(path, time=title.partition(" ")[0] + " [s]").fs == pytest.approx(250)


def test_the_columns_of_one_struct_go_by_its_fields(tmp_path: Path) -> None:
    from scipy.io import savemat

    time = np.arange(200) / 500
    one, other = {"t": time, "x": np.sin(time)}, {"t": time + 1, "x": np.cos(time)}
    savemat(tmp_path / "one.mat", {"data": one, "about": "text"})
    record = ss.read_record(tmp_path / "one.mat")
    assert list(record) == ["x"]
    assert record.fs == pytest.approx(500)
    by_name = ss.read_record(tmp_path / "one.mat", channels={"x": "data.x [mm]"})
    assert np.allclose(by_name["x"], np.sin(time) / 1000)
    savemat(tmp_path / "two.mat", {"first": one, "second": other})
    with pytest.raises(ss.errors.RecordError, match=r"first\.t"):
        ss.read_record(tmp_path / "two.mat")
