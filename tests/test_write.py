"""write_record: what is written is read back exactly, and appears whole or not at all."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import stickslip as ss
from stickslip.record.metadata import BEGINS, described_beside, time_column

SUFFIXES = [".csv", ".h5", ".hdf5", ".parquet"]


def example(rows: int = 500, **changes: object) -> ss.Record:
    rng = np.random.default_rng(7)
    samples = {
        "x": rng.normal(size=rows),
        "load": rng.normal(size=rows) * 1e-300,
        "time": rng.normal(size=rows) * 1e300,
    }
    record = ss.Record.of(samples, fs=1000 / 3, units={"x": "mm", "load": "lbf"}, start=0.1, truth={"level": 1 / 3})
    record = record.with_details("x", delay=1e-3, noise=2e-7, sensitivity="2 mm/V", gain_sd=0.01)
    step = ss.record.Step(
        "invented", {"rows": (1, None), "nested": {"list": [1, (2.5, "two")]}, "text": 'a "b", ü\n#'}, "done"
    )
    rig = ss.record.StatedRig("smoother", mass=2.42, stiffness=2310.0, sd={"mass": 0.02, "stiffness": 1 / 3})
    return replace(record, history=(*record.history, step), rig=rig, **changes)


def test_how_sure_a_gain_is_may_be_stated_anew(tmp_path: Path) -> None:
    path = ss.write_record(example(), tmp_path / "kept.csv")
    for spec, sd in (("x [m]", 0.01), ("x [m] ± 3 %", 0.03)):
        assert ss.read_record(path, channels={"x": spec}).channels["x"].gain_sd == sd


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_record_comes_back_exactly(tmp_path: Path, suffix: str) -> None:
    record = example()
    path = ss.write_record(record, tmp_path / f"kept{suffix}")
    again = ss.read_record(path)
    assert again.equals(record)
    assert again.history[-1].arguments["rows"] == (1, None)
    assert again.channels["x"].delay == 1e-3
    assert sorted(tmp_path.iterdir()) == sorted({path, described_beside(path)} if suffix == ".csv" else {path})


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_stamps_and_what_is_not_a_number_come_back(tmp_path: Path, suffix: str) -> None:
    x = np.array([1.0, np.nan, np.inf, -np.inf, -0.0, 5e-324])
    record = replace(example(6), samples={"x": x}, stamps=np.array([0.0, 0.1, 0.1, np.nan, 0.7, 0.2]))
    again = ss.read_record(ss.write_record(record, tmp_path / f"kept{suffix}"))
    assert again.equals(record)
    assert np.signbit(again["x"][4])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_long_history_comes_back(tmp_path: Path, suffix: str) -> None:
    record = replace(
        example(20), history=tuple(ss.record.Step("step", {"number": n, "text": "x" * 90}) for n in range(3000))
    )
    assert ss.read_record(ss.write_record(record, tmp_path / f"kept{suffix}")).equals(record)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_blocks_of_a_kept_record_join_to_it(tmp_path: Path, suffix: str) -> None:
    record = example(1000)
    path = ss.write_record(record, tmp_path / f"kept{suffix}")
    blocks = list(ss.read_blocks(path, size=300))
    assert [len(block) for block in blocks] == [300, 300, 300, 100]
    np.testing.assert_array_equal(np.concatenate([block["load"] for block in blocks]), record["load"])
    assert blocks[3].start == pytest.approx(record.time[900], abs=1e-12)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_other_programs_find_names_units_and_time(tmp_path: Path, suffix: str) -> None:
    record = ss.Record.of({"x": [1.0, 2.0, 4.0]}, fs=4, units={"x": "mm"})
    path = ss.write_record(record, tmp_path / f"kept{suffix}")
    again = ss.read_record(path, channels={"x": "x"}, time="time")
    np.testing.assert_array_equal(again["x"], record["x"])
    assert (again.fs, again.channels["x"].unit) == (4, "m")
    assert [step.action for step in again.history] == ["Record.of", "read_record"]


finite_or_not = st.floats(allow_nan=True, allow_infinity=True)


@settings(max_examples=40, deadline=None)
@given(
    values=st.lists(st.tuples(finite_or_not, finite_or_not), min_size=1, max_size=30),
    fs=st.floats(1e-3, 1e9),
    start=st.floats(-1e9, 1e9),
    words=st.text(max_size=30),
    suffix=st.sampled_from([".csv", ".h5", ".parquet"]),
)
def test_any_record_comes_back(
    values: list[tuple[float, float]], fs: float, start: float, words: str, suffix: str
) -> None:
    first, second = np.array(values).T
    record = ss.Record.of({"a": first, "normal": second}, fs=fs, start=start, truth={words: words})
    with tempfile.TemporaryDirectory() as folder:
        assert ss.read_record(ss.write_record(record, Path(folder) / f"kept{suffix}")).equals(record)


def test_an_unknown_ending_lists_those_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(ss.errors.ModelError, match=r"\.csv, \.h5, \.hdf5, \.parquet"):
        ss.write_record(example(), tmp_path / "kept.xls")


@pytest.mark.parametrize("suffix", [".csv", ".h5", ".parquet"])
def test_a_folder_that_is_not_there_is_one_sentence(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(ss.errors.FormatError, match="can not be written"):
        ss.write_record(example(), tmp_path / "nowhere" / f"kept{suffix}")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_that_is_there_is_replaced_only_when_asked(tmp_path: Path, suffix: str) -> None:
    path = ss.write_record(example(10), tmp_path / f"kept{suffix}")
    before = path.read_bytes()
    with pytest.raises(ss.errors.FormatError, match=r"is there already.*overwrite=True"):
        ss.write_record(example(20), path)
    assert path.read_bytes() == before
    assert len(ss.read_record(ss.write_record(example(20), path, overwrite=True))) == 20


@pytest.mark.parametrize("suffix", [".csv", ".h5", ".parquet"])
def test_a_failure_half_way_leaves_the_old_file(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = ss.write_record(example(10), tmp_path / f"kept{suffix}")
    before = path.read_bytes()
    broken = replace(example(10), truth={"level": 2.0})
    writer = {
        ".csv": "stickslip.files.write.checksum",
        ".h5": "h5py.Group.create_dataset",
        ".parquet": "pyarrow.parquet.write_table",
    }

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writer[suffix], full)
    with pytest.raises(ss.errors.FormatError, match="No space left"):
        ss.write_record(broken, path, overwrite=True)
    assert path.read_bytes() == before
    assert sorted(tmp_path.iterdir()) == sorted({path, described_beside(path)} if suffix == ".csv" else {path})


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"version": 1', '"version": 99', "version 99.*update"),
        ('"fs": 10.0', '"fs": "ten"', "damaged"),
        ('"fs": 10.0', '"fs": -1', "fs is positive"),
        ('"name": "x"', '"name": "w"', "damaged"),
        ('"channels": [', '"chanels": [', "damaged"),
        ('{"version"', '{{"version"', "damaged"),
        ('"rows": 3', '"rows": 4', "3 rows where .* says 4"),
    ],
)
def test_a_damaged_description_is_one_sentence(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = ss.write_record(ss.Record.of({"x": [1.0, 2.0, 3.0]}, fs=10.0), tmp_path / "kept.csv")
    beside = described_beside(path)
    assert beside.read_text().startswith(BEGINS)
    beside.write_text(beside.read_text().replace(old, new, 1))
    with pytest.raises(ss.StickslipError, match=words):
        ss.read_record(path)


# ---- what was changed outside


def edited(path: Path, old: str, new: str) -> Path:
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    return path


def kept(folder: Path) -> Path:
    return ss.write_record(ss.Record.of({"x": [1.0, 2.5, 3.0]}, fs=10.0), folder / "kept.csv")


@pytest.mark.parametrize(
    ("old", "new", "values", "fs"),
    [
        ("x [m]", "x [mm]", [1e-3, 2.5e-3, 3e-3], 10),
        ("2.5", "2.75", [1.0, 2.75, 3.0], 10),
        ("time [s]", "time [ms]", [1.0, 2.5, 3.0], 10_000),
        ("0.1,", "0.17,", [1.0, 2.5, 3.0], 10),
    ],
    ids=["unit", "value", "unit of time", "time"],
)
def test_an_edited_file_is_read_as_it_is_now(
    tmp_path: Path, old: str, new: str, values: list[float], fs: float
) -> None:
    record = ss.read_record(edited(kept(tmp_path), old, new))
    assert record["x"] == pytest.approx(values, rel=1e-15)
    assert record.history[-1].action == "read_record"
    assert "changed since" in record.history[-1].outcome
    assert record.fs == pytest.approx(fs)
    assert (record.stamps is not None) == (new == "0.17,")


def test_a_column_added_outside_is_read_too(tmp_path: Path) -> None:
    path = kept(tmp_path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([line + more for line, more in zip(lines, [",v [m/s]", ",1", ",2", ",3"], strict=True)]))
    assert list(ss.read_record(path)["v"]) == [1.0, 2.0, 3.0]


def test_blocks_of_an_edited_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ss.errors.FormatError, match=r"x .*changed.*channels="):
        list(ss.read_blocks(edited(kept(tmp_path), "2.5", "2.75"), size=2))


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("unit", ["counts", "N m", "m/s^2", "1", "kg^0.5 m", "V s^2/m"])
def test_any_unit_comes_back(tmp_path: Path, suffix: str, unit: str) -> None:
    record = ss.Record.of({"ch": [1.0, 2.0]}, fs=4.0).with_channel("ch", [1.0, 2.0], unit=unit)
    assert ss.read_record(ss.write_record(record, tmp_path / f"kept{suffix}")).equals(record)


def test_a_channel_map_keeps_what_was_stated_of_a_sensor(tmp_path: Path) -> None:
    record = ss.Record.of({"x": np.arange(40.0) ** 2, "a": np.sin(np.arange(40.0))}, fs=100)
    record = record.with_details("x", delay=1e-3).with_details("a", mount=(125.0, 0.1))
    path = ss.write_record(record, tmp_path / "run.csv")
    found = ss.read_record(path, channels={"x": "x [m]", "a": "2 * a [m/s^2]", "z": "x [mm]"})
    assert found.channels["x"].delay == 1e-3
    assert found.channels["a"].mount is None  # another quantity than the one that was described
    assert found.channels["z"].delay == 0


def test_a_csv_is_plain_for_excel_and_pandas_and_stands_alone(tmp_path: Path) -> None:
    import pandas as pd

    record = replace(example(20), truth={"level": 2.0})
    path = ss.write_record(record, tmp_path / "run.csv")
    frame = pd.read_csv(path)
    assert list(frame) == [f"{time_column(record)} [s]", *(f"{name} [{record.channels[name].unit}]" for name in record)]
    np.testing.assert_array_equal(frame.iloc[:, 1], record[next(iter(record))])
    assert ss.read_record(path).truth == {"level": 2.0}
    described_beside(path).unlink()
    alone = ss.read_record(path)
    assert not alone.truth
    np.testing.assert_array_equal(alone["load"], record["load"])


def test_a_file_of_somebody_elses_beside_a_csv_is_left_alone(tmp_path: Path) -> None:
    other = tmp_path / "run.csv.json"
    other.write_text('{"mine": 1}')
    with pytest.raises(ss.errors.FormatError, match=r"run\.csv\.json' is there already"):
        ss.write_record(example(10), tmp_path / "run.csv")
    (tmp_path / "run.csv").write_text("t [s],x [mm]\n0,1\n0.1,2\n0.2,3\n")
    assert len(ss.read_record(tmp_path / "run.csv")) == 3
    assert other.read_text() == '{"mine": 1}'
