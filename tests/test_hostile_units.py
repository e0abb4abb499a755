"""Hostile units, numbers and names: nothing from outside is evaluated, and none speaks to the terminal or the page."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from limits import civil, limited, program
from stickslip.errors import RecordError, StickslipError
from stickslip.units import Unit, dimensions, parse_unit, parse_value

BOMBS = [
    "9^9^9^9", "m^9^9^9^9", "m/0", "km^200", "km^1e300", "m^(9^9^9)", "m cubed cubed cubed cubed cubed", "m⁹⁹⁹⁹⁹⁹",
    "Ym^9 Ym^9 Ym^9 Ym^9", "ym^9 ym^9 ym^9 ym^9", "V^9 V^9", "0 m", "2 mm", "nan", "inf", "m//s", "((((m))))",
    "x" * 100_000, " " * 100_000 + "m" + "(" * 9, "m.__class__", "__import__('os')",
    "degC", "°C", "degF", "dB", "dBm", "degC/m", "m degC", "degC^2",
]  # fmt: skip
ROWS = "0,1\n0.01,2\n0.02,1\n0.03,3\n0.04,1\n"


def test_what_is_no_unit_is_refused_in_a_sentence(tmp_path: Path) -> None:
    ended = limited(_refused, BOMBS, folder=tmp_path)
    assert ended.code == 0, ended.err


def _refused(units: list[str]) -> None:
    for unit, read in itertools.product(units, (parse_unit, lambda text: parse_value(f"1 {text}", "kg"))):
        with pytest.raises(StickslipError) as caught:
            read(unit)
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) < 500


@pytest.mark.parametrize(
    ("text", "scale", "si"),
    [
        ("1/min", 1 / 60, "1/s"),
        ("N/(m/s)", 1.0, "N s/m"),
        ("mV/(m/s^2)", 1e-3, "V s^2/m"),
        ("mm s^-2", 1e-3, "m/s^2"),
        ("N.m", 1.0, "N m"),
        ("N·mm", 1e-3, "N m"),
        ("kN*m", 1e3, "N m"),
        ("mm per s", 1e-3, "m/s"),
        ("kg m²/s³", 1.0, "kg m^2/s^3"),
        ("N/mm^1.5", 10**4.5, "kg/m^0.5/s^2"),
        ("N/m^(3/2)", 1.0, "kg/m^0.5/s^2"),
        ("µm/m", 1e-6, "1"),
        ("kΩ", 1e3, "kg m^2/A^2/s^3"),
        ("K", 1.0, "K"),
        ("delta_degC", 1.0, "K"),
        ("in.", 0.0254, "m"),
    ],
)
def test_what_instruments_write_is_read(text: str, scale: float, si: str) -> None:
    unit = parse_unit(text)
    assert unit.scale == pytest.approx(scale, rel=1e-12)
    assert unit.si == si
    again = parse_unit(si)
    assert (again.scale, again.si) == (1.0, si)


def test_units_by_the_thousand_are_not_kept() -> None:
    from stickslip.units import _by_pint

    for number in range(3000):
        with pytest.raises(RecordError):
            parse_unit(f"q{number}")
    bound = _by_pint.cache_info().maxsize
    assert bound is not None
    assert _by_pint.cache_info().currsize <= bound < 3000


@pytest.mark.parametrize("scale", [0.0, float("inf"), float("-inf"), float("nan")])
def test_a_unit_without_a_scale_can_not_be_built(scale: float) -> None:
    with pytest.raises(RecordError, match="finite part or multiple"):
        Unit("q", scale, "m")


def test_what_is_no_finite_quantity_is_refused_at_once(tmp_path: Path) -> None:
    numbers = ["1e308 t", "9" * 400, "1" * 100_000 + "\nx", "1" + " " * 100_000 + "\nx", "1 9^9^9^9", "nan kg", "1e999"]
    ended = limited(_no_mass, numbers, folder=tmp_path)
    assert ended.code == 0, ended.err


def _no_mass(texts: list[str]) -> None:
    for text in texts:
        with pytest.raises(ss.errors.ModelError) as caught:
            ss.rig.rig_settings({"mass": text}, source="the form")
        assert len(str(caught.value)) < 1000


def _headed(folder: Path, unit: str) -> Path:
    (folder / "run.csv").write_text(f"t [s],x [{unit}]\n{ROWS}", "utf-8")
    return folder / "run.csv"


def _as_json(folder: Path, unit: str) -> Path:
    told = {"fs": 100, "t": [0, 0.01, 0.02], "x": [1, 2, 1], "units": {"x": unit}}
    (folder / "run.json").write_text(json.dumps(told), "utf-8")
    return folder / "run.json"


def _as_hdf5(folder: Path, unit: str) -> Path:
    import h5py

    with h5py.File(folder / "run.h5", "w") as file:
        file["t"], file["x"] = np.arange(5) / 100, np.arange(5.0)
        file["x"].attrs["unit"] = unit
    return folder / "run.h5"


def _as_parquet(folder: Path, unit: str) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields = [pa.field("t", pa.float64()), pa.field("x", pa.float64(), metadata={b"unit": unit.encode()})]
    pq.write_table(pa.table([np.arange(5) / 100, np.arange(5.0)], schema=pa.schema(fields)), folder / "run.parquet")
    return folder / "run.parquet"


def _as_mat(folder: Path, unit: str) -> Path:
    from scipy.io import savemat

    savemat(folder / "run.mat", {"t": np.arange(5) / 100, "x": np.arange(5.0), "x_unit": unit, "units": {"x": unit}})
    return folder / "run.mat"


@pytest.mark.parametrize("unit", ["9^9^9^9", "km^200"])
@pytest.mark.parametrize("write", [_headed, _as_json, _as_hdf5, _as_parquet, _as_mat], ids=lambda write: write.__name__)
def test_a_file_with_such_a_unit_is_checked(tmp_path: Path, write: object, unit: str) -> None:
    assert callable(write)
    ended = civil(program("check", write(tmp_path, unit), folder=tmp_path))
    assert "samples, 100 Hz" in ended.out or ended.err.count("\n") == 1


def test_a_column_of_temperatures_stays_as_it_was_written(tmp_path: Path) -> None:
    record = ss.read_record(_headed(tmp_path, "°C").rename(tmp_path / "warm.csv"), channels={"T": "x"})
    assert record.channels["T"].unit == "°C"
    np.testing.assert_array_equal(record["T"], [1, 2, 1, 3, 1])


OPTIONS = [
    ["--units", "x=9^9^9^9"],
    ["--units", "x=m/0"],
    ["--channels", "x=x [9^9^9^9]"],
    ["--channels", "x=x * 9**9**9 [m]"],
    ["--channels", "x=x * 9e999 [m]"],
    ["--channels", "x=x * 1" + "0" * 450 + " [m]"],
    ["--channels", "x=x / 1e-308 / 1e-308 [m]"],
    ["--channels", "x=x [V] @ 9 9^9^9^9/V"],
    ["--channels", "x=x [V] @ 1e-323 nV/m"],
    ["--channels", "x=x [V] @ 1e308 km/V"],
    ["--channels", "x=" + "(" * 240 + "x" + ")" * 240],
    ["--channels", "x=x [dB]"],
    ["--time", "t [9^9^9^9]"],
    ["--fs", "9^9^9^9"],
    ["--fs", "1e308 GHz"],
    ["--fs", "1" + "0" * 5000],
]


def test_an_option_is_not_evaluated(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(f"t,x\n{ROWS}")
    ended = limited(_refused_options, folder=tmp_path)
    assert ended.code == 0, ended.err
    assert [line[:10] for line in ended.err.splitlines()] == ["stickslip:"] * len(OPTIONS)


def _refused_options() -> None:
    from stickslip.cli.program import main

    for options in OPTIONS:
        with pytest.raises(SystemExit) as ended:
            main(["check", "run.csv", *options], prog_name="stickslip")
        assert ended.value.code in (1, 2), options


@pytest.mark.parametrize("line", ['mass = "1 9^9^9^9"', 'units = { x = "9^9^9^9" }', 'channels = { x = "x [m/0]" }'])
def test_a_rig_file_is_not_evaluated(tmp_path: Path, line: str) -> None:
    (tmp_path / "rig.toml").write_text(f"{line}\n")
    (tmp_path / "run.csv").write_text(f"t,x\n{ROWS}")
    ended = civil(program("check", "run.csv", "--config", "rig.toml", folder=tmp_path))
    assert ended.code != 0
    assert ended.err.count("\n") == 1


LONG_TITLES = [
    "x" + " " * 50_000 + "y (m" + " " * 50_000, "x" + "(a" * 50_000, "x" + "/" * 100_000, "x[" * 50_000 + "]",
    "x," * 9 + " " * 90_000,
]  # fmt: skip


def test_long_titles_are_read_at_once(tmp_path: Path) -> None:
    told = [{"fs": 10, "data": [1, 2, 3], "name": title, "unit_str": ""} for title in LONG_TITLES]
    (tmp_path / "run.json").write_text(json.dumps(told))
    civil(program("check", "run.json", folder=tmp_path))


@pytest.mark.parametrize("name", ["#1", "Zeit Kanal", "Zeit_Kanal"])
def test_a_unit_is_stated_by_any_name_of_a_column(tmp_path: Path, name: str) -> None:
    (tmp_path / "run.csv").write_text("Zeit Kanal,x\n0,1\n10,2\n20,1\n30,3\n")
    record = ss.read_record(tmp_path / "run.csv", time="#1", units={name: "ms", "#2": "mm"})
    assert record.fs == pytest.approx(100)
    np.testing.assert_allclose(record["x"], [1e-3, 2e-3, 1e-3, 3e-3])


def test_a_unit_is_stated_for_a_column_of_one_file(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,x\n0,1\n10,2\n20,1\n30,3\n")
    (tmp_path / "b.csv").write_text("t,z\n0,1\n0.01,2\n0.02,1\n0.03,3\n")
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    record = ss.read_record(paths, units={"a.csv:#1": "ms", "b.csv:z": "mm"})
    assert record.fs == pytest.approx(100)
    np.testing.assert_allclose(record["z"] * 1e3, record["x"])


def test_a_unit_stated_for_a_channel_is_not_that_of_a_column_with_its_name(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("t,Group/y,Group/x\n0,1,1\n0.01,2,2\n0.02,1,1\n0.03,3,3\n")
    record = ss.read_record(tmp_path / "run.csv", channels={"x": "`Group/y`", "q": "`Group/x`"}, units={"x": "mm"})
    assert record.channels["q"].unit == "1"
    np.testing.assert_allclose(record["q"], 1e3 * record["x"])


@pytest.mark.parametrize("name", ["#4", "q"])
def test_a_unit_of_nothing_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "run.csv").write_text(f"t,x\n{ROWS}")
    with pytest.raises(RecordError, match="there is no channel or column"):
        ss.read_record(tmp_path / "run.csv", units={name: "mm"})


@pytest.mark.parametrize("unit", ["1", "kg", "N", "N/m", "N s/m", "1/(N s)", "s/m", "m/s^2", "N m/rad", "N/m/s", "V/N"])
def test_dimensions_of_a_unit_are_those_of_another_program(unit: str) -> None:
    import pint

    of = pint.UnitRegistry().Quantity(1.0, unit.replace(" ", "*")).dimensionality
    assert dimensions(unit) == {name.strip("[]"): power for name, power in of.items()}
