"""Text files: every dialect gives the numbers that were written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.files import table, text
from stickslip.files.select import split_name
from stickslip.files.table import Options
from stickslip.files.text import find_layout

T = np.arange(40) / 250
X = np.round(np.sin(9 * T), 4)
F = np.round(np.cos(9 * T) * 30, 3)


def test_numbers_are_the_same_with_pandas_and_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A short file of numbers numpy reads; of random bits, as they are written, it keeps every one."""
    drawn = np.random.default_rng(0).integers(0, 2**63, size=(3000, 2)).view(np.float64)
    drawn = drawn[np.isfinite(drawn).all(axis=1)]
    path = tmp_path / "run.csv"
    path.write_text("a,b\n" + "".join(f"{one!r}, {other:.25g}\n" for one, other in drawn.tolist()), "utf-8")
    (block,) = text.read(path, Options()).blocks(["b", "a"], 10_000)
    monkeypatch.setattr(table, "SHORT", 0)
    (again,) = text.read(path, Options()).blocks(["b", "a"], 10_000)
    for name, written in zip("ab", drawn.T, strict=True):
        assert block[name].tobytes() == again[name].tobytes() == written.tobytes()


def rows(delimiter: str = ",", decimal: str = ".", tail: str = "") -> str:
    lines = (delimiter.join(f"{value:.4f}" for value in row) + tail for row in zip(T, X, F, strict=True))
    return "\n".join(lines).replace(".", decimal) + "\n"


DIALECTS = {
    "comma": "t,x [mm],force [N]\n" + rows(),
    "semicolon": "t;x [mm];force [N]\n" + rows(";"),
    "tab": "t\tx [mm]\tforce [N]\n" + rows("\t"),
    "pipe": "t|x [mm]|force [N]\n" + rows("|"),
    "blanks": "t  x [mm]  force [N]\n" + rows("   "),
    "aligned": "t   x   force\ns  mm   N\n" + rows("   "),
    "padded": "t , x [mm] , force [N]\n" + rows(" , "),
    "decimal comma": "t;x [mm];force [N]\n" + rows(";", ","),
    "tab and decimal comma": "t\tx [mm]\tforce [N]\n" + rows("\t", ","),
    "round brackets": "Time (s),x (mm),force (N)\n" + rows(),
    "comma before the unit": '"t, s","x, mm","force, N"\n' + rows(),
    "unit row": "Time,x,force\ns,mm,N\n" + rows(),
    "bracketed unit row": "Time,x,force\n[s],[mm],[N]\n" + rows(),
    "title and remarks": 'Rig 3, run "12"\nOperator: one\n\nt,x [mm],force [N]\n' + rows(),
    "odd quote in the title": 'a disc of 12" and more\nt,x [mm],force [N]\n' + rows(),
    "line of dashes": "t,x [mm],force [N]\n-----------\n" + rows(),
    "header in a comment": "# made by hand\n# t, x [mm], force [N]\n" + rows(),
    "trailing delimiter": "t,x [mm],force [N],\n" + rows(tail=","),
    "trailing delimiter in the rows alone": "t,x [mm],force [N]\n" + rows(tail=","),
    "quoted numbers": "t,x [mm],force [N]\n" + "".join(f'"{t}","{x}","{f}"\n' for t, x, f in zip(T, X, F, strict=True)),
    "quoted names": '"t","x [mm]","force [N]"\n' + rows(),
    "units after slashes": "t / s,x / mm,force / N\n" + rows(),
    "units after slashes without blanks": "t/s,x/mm,force/N\n" + rows(),
    "units behind words": "t_s,x_mm,force_N\n" + rows(),
    "units in words": "t in s,x in mm,force in N\n" + rows(),
    "words below the rows": "t,x [mm],force [N]\n" + rows() + "\nEnd of data\nMean,0.1,2.0\n",
    "comments between the rows": "t,x [mm],force [N]\n# start\n" + rows() + "# stop\n",
    "empty lines between the rows": "t,x [mm],force [N]\n" + rows().replace("\n", "\n\n"),
}


def test_what_stands_below_the_rows_is_told(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(DIALECTS["words below the rows"])
    assert "left out what stands below the rows: 'End of data Mean,0.1,2.0'" in ss.read_record(path).history[0].outcome
    path.write_text("t,x [mm],force [N]\n" + rows() + "nothing,1.0,2.0\n" + rows())
    with pytest.raises(ss.errors.FormatError, match=r"row 42 of 'rig\.csv' reads 'nothing,1\.0,2\.0'"):
        ss.read_record(path)


@pytest.mark.parametrize("day", ["2024-05-01", "01.05.2024", "5/1/2024"])
def test_a_date_may_stand_beside_its_clock(tmp_path: Path, day: str) -> None:
    lines = [f"{day},12:00:{row / 50:06.3f},{x}" for row, x in enumerate(X)]
    path = tmp_path / "rig.csv"
    path.write_text("Date,Time,x [mm]\n" + "\n".join(lines))
    record = ss.read_record(path)
    assert list(record) == ["x"]
    assert record.fs == pytest.approx(50.0, rel=1e-12)
    assert record["x"] == pytest.approx(X / 1e3, rel=1e-12)


@pytest.mark.parametrize("decimal", [".", ","])
def test_thousands_may_be_set_apart(tmp_path: Path, decimal: str) -> None:
    force = np.round(1e4 * np.sin(9 * T), 2)
    texts = [f"{t:.4f};{f:,.2f}" for t, f in zip(T, force, strict=True)]
    swap = str.maketrans(",.", ".,") if decimal == "," else {}
    path = tmp_path / "rig.csv"
    path.write_text("t;force [N]\n" + "\n".join(text.translate(swap) for text in texts) + "\n")
    assert ss.read_record(path)["force"] == pytest.approx(force, rel=1e-12)


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_gives_the_numbers(tmp_path: Path, dialect: str, encoding: str, ending: str) -> None:
    path = tmp_path / "rig.csv"
    path.write_bytes(DIALECTS[dialect].replace("\n", ending).encode(encoding))
    record = ss.read_record(path)
    assert list(record) == ["x", "force"]
    assert record.fs == 250
    assert record.stamps is None
    np.testing.assert_array_equal(record["x"], X * 1e-3)
    np.testing.assert_array_equal(record["force"], F)


def test_lone_carriage_returns_end_lines_too(tmp_path: Path) -> None:
    path = tmp_path / "old.txt"
    path.write_bytes(DIALECTS["comma"].replace("\n", "\r").encode())
    np.testing.assert_array_equal(ss.read_record(path)["force"], F)


def test_degree_sign_of_an_old_code_page(tmp_path: Path) -> None:
    path = tmp_path / "angle.csv"
    path.write_bytes("t [s];theta [°]\n0;0\n0,5;90\n1;180\n".encode("latin-1"))
    np.testing.assert_allclose(ss.read_record(path)["theta"], [0, np.pi / 2, np.pi], rtol=1e-15)


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (["16:18:34.582", "16:18:34.682", "16:18:34.782"], [0.0, 0.1, 0.2]),
        (["23:59:59.9", "00:00:00.0", "00:00:00.1"], [0.0, 0.1, 0.2]),
        (["2024-02-29 23:59:59.9", "2024-03-01 00:00:00.0", "2024-03-01 00:00:00.1"], [0.0, 0.1, 0.2]),
        (["2024-02-29T10:00:00Z", "2024-02-29T10:00:01Z", "2024-02-29T10:00:02Z"], [0.0, 1.0, 2.0]),
        (["29.02.2024 10:00:00", "29.02.2024 10:00:01", "29.02.2024 10:00:02"], [0.0, 1.0, 2.0]),
    ],
)
@pytest.mark.parametrize("size", [1, 2, 100])
def test_clock_times_become_seconds(tmp_path: Path, cells: list[str], seconds: list[float], size: int) -> None:
    path = tmp_path / "clock.csv"
    path.write_text("when,x [m]\n" + "".join(f"{cell},{i}\n" for i, cell in enumerate(cells)))
    blocks = list(ss.read_blocks(path, size=size, channels={"clock": "when", "x": "x"}, fs=1))
    np.testing.assert_array_equal(np.concatenate([block["clock"] for block in blocks]), seconds)
    assert ss.read_record(path, time="when").fs == 1 / seconds[1]


def test_no_reading_is_nan_and_check_may_speak(tmp_path: Path) -> None:
    path = tmp_path / "holes.csv"
    path.write_text("t,x [m],load [N]\n0,1,5\n1,,OL\n2,nan,\n3,4,Overload\n4,5,----\n5,6,7\n")
    record = ss.read_record(path)
    np.testing.assert_array_equal(record["x"], [1, np.nan, np.nan, 4, 5, 6])
    np.testing.assert_array_equal(np.isnan(record["load"]), [False, True, True, True, True, False])


def test_columns_of_unequal_length_are_refused_with_the_rows_that_all_have(tmp_path: Path) -> None:
    path = tmp_path / "short.csv"
    path.write_text("t,x [m],load [N]\n0,1,5\n1,2,6\n2,3\n3,4\n")
    with pytest.raises(ss.errors.RecordError, match=r"column load has values in 2 rows, others in 4; .* rows=\(0, 2\)"):
        ss.read_record(path)
    np.testing.assert_array_equal(ss.read_record(path, rows=(0, 2))["load"], [5, 6])


@pytest.mark.parametrize(
    ("text", "row"),
    [
        ("t,x\n0,1\n1,2\n2,three\n3,4\n", 4),
        ("t,x\n0,1\n1,2\n2,3,99\n3,4\n", 4),
        ('t,x\n0,1\n1,2\n2,"3\n3,4\n', 4),
        ("a title\n\nt,x\n0,1\n1,2\nEnd of run\n2,3\n", 6),
        ("Dear reader,\nnothing here is measured.\n", 1),
        ("\n\nDear reader\n", 3),
    ],
)
def test_a_fault_is_named_by_its_row(tmp_path: Path, text: str, row: int) -> None:
    path = tmp_path / "fault.csv"
    path.write_text(text)
    with pytest.raises(ss.errors.FormatError, match=rf"row {row} of 'fault.csv' reads"):
        ss.read_record(path)


def test_a_decimal_comma_met_late_is_named(tmp_path: Path) -> None:
    path = tmp_path / "late.csv"
    path.write_text("t;x\n" + "".join(f"{i};1\n" for i in range(3000)) + "3000;0,5\n")
    with pytest.raises(ss.errors.FormatError, match=r"row 3002 .* pass delimiter= and decimal="):
        ss.read_record(path)
    assert ss.read_record(path, decimal=",")["x"][-1] == 0.5


def test_options_are_checked(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(DIALECTS["comma"])
    with pytest.raises(ss.errors.FormatError, match="same sign"):
        ss.read_record(path, delimiter=",", decimal=",")
    with pytest.raises(ss.errors.FormatError, match="one character"):
        ss.read_record(path, delimiter="<>")
    assert len(ss.read_record(path, delimiter="comma")) == len(T)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("x [mm]", ("x", "mm")),
        ("Time(s)", ("Time", "s")),
        ("Normal_stress(MPa)", ("Normal_stress", "MPa")),
        ("a, m/s^2", ("a", "m/s^2")),
        ("Droop pulses (by 1 pls.)", ("Droop pulses (by 1 pls.)", None)),
        ("Sampling time interval(ms)", ("Sampling time interval", "ms")),
        ("mu [-]", ("mu", "-")),
        ("F", ("F", None)),
    ],
)
def test_names_and_units_part(text: str, parts: tuple[str, str | None]) -> None:
    assert split_name(text) == parts


def test_numbers_alone_are_named_by_their_place(tmp_path: Path) -> None:
    path = tmp_path / "bare.txt"
    path.write_text(rows("\t"))
    record = ss.read_record(path, channels={"x": "#2 [mm]", "force": "c3 [N]"}, time="#1")
    np.testing.assert_array_equal(record["x"], X * 1e-3)
    assert record.fs == 250


def test_names_that_occur_twice_stay_apart() -> None:
    layout = find_layout(b"x,x,x\n1,2,3\n4,5,6\n", True, Options(), "twice.csv")
    assert layout.names == ("x", "x_2", "x_3")


def test_key_and_value_headers_over_pairs_of_columns(dataset: Callable[[str], Path]) -> None:
    folder = dataset("rack_two_daq")
    record = ss.read_record(
        folder / "24072020-sym_br_r0_ni.csv",
        channels={"force": "-200 * (F + 0.115) [N]", "x": "(x + 1.973275807313881) / 55.4 [m]"},
    )
    assert record.fs == 2000
    assert len(record) == 5569
    assert record["force"][0] == pytest.approx(-200 * (0.10933719727002415 + 0.115), rel=1e-15)
    assert record["x"][1] == pytest.approx((1.973275807313881 - 1.9716661698073106) / 55.4, rel=1e-12)


def test_names_under_names_of_a_drive(dataset: Callable[[str], Path]) -> None:
    folder = dataset("rack_two_daq")
    record = ss.read_record(
        folder / "24072020-sym_br_r0_mr.csv",
        channels={"v": "`Servo motor speed` * -20/60/1000 [m/s]", "torque": "Torque"},
    )
    assert record.fs == 900
    assert record["torque"][:4].tolist() == [3.0, 3.1, 3.2, 3.0]
    rpm = ss.read_record(folder / "24072020-sym_br_r0_mr.csv", channels={"rpm": "#2"})["rpm"]
    np.testing.assert_allclose(record["v"], -rpm / 3000, rtol=1e-14)
    assert ss.read_record(folder / "a3MR.csv", channels={"v": "Servo motor speed [m/s]"}).fs == 1500


def test_the_european_dialect_equals_its_decimals(dataset: Callable[[str], Path], tmp_path: Path) -> None:
    path = dataset("rack_two_daq") / "european_dialect.csv"
    translated = tmp_path / "translated.csv"
    translated.write_text(path.read_text("utf-8-sig").replace(",", ".").replace(";", ","))
    european, plain = (ss.read_record(one, channels={"force": "F [V] @ 5 mV/N"}) for one in (path, translated))
    assert european.fs == plain.fs == 20
    np.testing.assert_array_equal(european["force"], plain["force"])
    assert european["force"][0] == pytest.approx(-0.00097920323409353134 / 0.005, rel=1e-14)


def test_stamps_that_jump_are_kept(dataset: Callable[[str], Path]) -> None:
    path = dataset("pendulum_bad_clock") / "100.txt"
    record = ss.read_record(path, channels={"theta": "Angle [deg]"})
    assert record.stamps is not None
    assert record.fs == pytest.approx(260, rel=0.01)
    assert record.start == 2332.308
    assert record["theta"][0] == pytest.approx(np.radians(56.87), rel=1e-15)
    by_clock = ss.read_record(path, channels={"theta": "Angle"}, time="Timestamp")
    assert by_clock.stamps is not None
    assert by_clock.stamps[:3].tolist() == [0.0, 0.001, 0.001]


def test_dropped_samples_keep_their_stamps(dataset: Callable[[str], Path]) -> None:
    path = dataset("rubber_seal") / "O-ring_5bar.csv"
    record = ss.read_record(path, channels={"x": "#5 [mm]", "load": "#7 [N]"}, time="#1 [ms]", rows=(15, None))
    assert record.stamps is not None
    assert record.fs == 100
    assert record["load"][0] == pytest.approx(256.091, abs=5)
    assert len(record) == 10321 - 15
    assert record.history[-1].arguments["rows"] == [15, None]


def test_a_change_of_rate_keeps_its_stamps(dataset: Callable[[str], Path]) -> None:
    path = dataset("rate_state_step") / "velstep4_BRAVA_expb819_basalt.txt"
    record = ss.read_record(path, channels={"x": "Displ", "normal_stress": "Normal_stress", "mu": "Friction"})
    assert record.stamps is not None
    assert record["x"][0] == pytest.approx(8503.602e-6, rel=1e-15)
    assert record["normal_stress"][0] == pytest.approx(19.969273e6, rel=1e-15)
    assert record["mu"][0] == 0.607016


@pytest.mark.parametrize("line", ["Sample rate,500", "Run,7", "Date,2026-11-26", "Name,plate"])
def test_a_line_of_two_cells_above_two_columns_is_no_header_of_pairs(tmp_path: Path, line: str) -> None:
    rows = "".join(f"{n / 100},{n % 7}\n" for n in range(50))
    (tmp_path / "run.csv").write_text(f"{line}\ntime [s],x [mm]\n{rows}")
    record = ss.read_record(tmp_path / "run.csv")
    assert list(record) == ["x"]
    assert record["x"].max() == pytest.approx(6e-3)
    assert record.fs == pytest.approx(100)


def test_titles_without_rows_are_told_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time [s],x [mm]\n")
    with pytest.raises(ss.StickslipError):
        ss.read_record(tmp_path / "run.csv")
