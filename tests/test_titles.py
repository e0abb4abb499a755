"""Titles such as ``acc [m/s^2]`` are name and unit in every format."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import nptdms
import numpy as np
import pandas as pd
import pytest
import scipy.io

import stickslip as ss
from stickslip.files.select import last_part

ROWS = np.arange(64)
COLUMNS = {
    "t [s]": ROWS / 200,
    "plate [mm]": np.sin(0.2 * ROWS),
    "rig acc [m/s^2]": np.cos(0.3 * ROWS),
    "drive [counts/rev]": 3.0 * ROWS,
}


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for title, values in COLUMNS.items():
            file[title] = values


def write_mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for title, values in COLUMNS.items():
            file.create_dataset(title, data=values[None]).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def write_tdms(path: Path) -> None:
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("rig", title, values) for title, values in COLUMNS.items()])


WRITERS: dict[str, Callable[[Path], object]] = {
    "run.csv": lambda path: pd.DataFrame(COLUMNS).to_csv(path, index=False),
    "run.parquet": lambda path: pd.DataFrame(COLUMNS).to_parquet(path),
    "run.json": lambda path: path.write_text(json.dumps({title: list(v) for title, v in COLUMNS.items()})),
    "run.h5": write_hdf5,
    "v5.mat": lambda path: scipy.io.savemat(path, COLUMNS),
    "v73.mat": write_mat73,
    "run.tdms": write_tdms,
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_title_is_name_and_unit_in_every_format(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    record = ss.read_record(tmp_path / name)
    assert {one: record.channels[one].unit for one in record} == {
        "plate": "m",
        "rig_acc": "m/s^2",
        "drive": "counts/rev",
    }
    assert record.fs == pytest.approx(200)
    np.testing.assert_allclose(record["plate"], 1e-3 * COLUMNS["plate [mm]"], rtol=1e-12)
    np.testing.assert_allclose(record["rig_acc"], COLUMNS["rig acc [m/s^2]"], rtol=1e-12)


@pytest.mark.parametrize("spec", ["rig acc", "rig acc [m/s^2]", "`rig acc [m/s^2]`", "`rig acc`", "rig_acc", "#3"])
def test_a_column_is_called_by_any_name_that_it_is_shown_under(tmp_path: Path, spec: str) -> None:
    WRITERS["run.parquet"](tmp_path / "run.parquet")
    record = ss.read_record(tmp_path / "run.parquet", channels={"a": spec}, time="t")
    np.testing.assert_array_equal(record["a"], COLUMNS["rig acc [m/s^2]"])


def test_dates_leave_the_other_columns_their_units(tmp_path: Path) -> None:
    dates = pd.to_datetime("2024-01-01") + pd.to_timedelta(ROWS * 5, unit="ms")
    pd.DataFrame({"time": dates, "plate [mm]": COLUMNS["plate [mm]"]}).to_parquet(tmp_path / "run.parquet")
    record = ss.read_record(tmp_path / "run.parquet")
    assert record.fs == pytest.approx(200)
    np.testing.assert_allclose(record["plate"], 1e-3 * COLUMNS["plate [mm]"], rtol=1e-12)


def test_a_unit_stated_beside_the_title_counts(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["t [s]"] = ROWS / 200
        file.create_dataset("plate [mm]", data=np.ones(64)).attrs["unit"] = "um"
    record = ss.read_record(tmp_path / "run.h5")
    np.testing.assert_allclose(record["plate"], 1e-6)
    assert "plate is titled in mm, stated in um" in record.history[-1].outcome


def test_a_near_name_is_suggested_as_it_must_be_written(tmp_path: Path) -> None:
    WRITERS["run.csv"](tmp_path / "run.csv")
    with pytest.raises(ss.errors.RecordError, match="did you mean '`rig acc`'"):
        ss.read_record(tmp_path / "run.csv", channels={"a": "rig_ac * 2"})
    with pytest.raises(ss.errors.RecordError, match="did you mean 'plate'"):
        ss.read_record(tmp_path / "run.csv", channels={"a": "plat"})


@pytest.mark.parametrize(
    ("name", "last"),
    [("a/b/x", "x"), ("Data\\acc [m/s^2]", "acc [m/s^2]"), ("acc (m/s)", "acc (m/s)"), ("x/y [m/s]", "y [m/s]")],
)
def test_a_path_is_parted_outside_of_brackets(name: str, last: str) -> None:
    assert last_part(name) == last
