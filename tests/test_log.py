"""The experiment's log: what is written down goes with the record through files, settings, questions and the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.record import Log

ENTRIES = {
    "surface": "steel on steel, 400-grit", "lubrication": "dry", "run_in": 9000, "cleaning": "degreaser CSM-1",
    "temperature": "23 °C", "humidity": "45 %", "normal": "2.45 N", "operator": "J. W.", "remark": "squeaks at 5 Hz",
    "photo": "surface-17.jpg",
}  # fmt: skip


@pytest.fixture
def record() -> ss.Record:
    return ss.Record.of({"x": np.linspace(0, 1, 9), "a": np.zeros(9)}, fs=10.0).with_log(ENTRIES)


@pytest.mark.parametrize("ending", ["csv", "h5", "parquet"])
def test_every_format_carries_the_whole_log(record: ss.Record, ending: str, tmp_path: Path) -> None:
    back = ss.read_record(ss.write_record(record, tmp_path / f"run.{ending}"))
    assert back.equals(record)
    assert back.log == Log.of(ENTRIES)
    assert len(back.log.entries()) == len(ENTRIES)


def test_other_tables_carry_it_too(record: ss.Record) -> None:
    assert ss.record.from_pandas(record.to_pandas()).log == record.log
    assert ss.record.from_xarray(record.to_xarray()).log == record.log
    assert ss.record.from_sep005(record.to_sep005()).log == record.log


def test_what_is_derived_keeps_it(record: ss.Record) -> None:
    assert record.rows(1, 5).log == record.log
    assert record.with_details("x", delay=0.1).log == record.log


@pytest.mark.parametrize(
    ("entry", "value", "said"),
    [
        ("humidity", "140 %", "0 to 100 %"),
        ("temperature", "-300 °C", "not below zero"),
        ("surface", 3, "in words"),
        ("weather", "fine", "a log has surface"),
    ],
)
def test_what_has_no_meaning_is_refused(entry: str, value: object, said: str) -> None:
    with pytest.raises(ss.errors.RecordError, match=said):
        Log.of({entry: value})


def test_a_rig_file_states_it_and_a_file_of_its_own_goes_before(record: ss.Record, tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('[log]\nlubrication = "oil"\ntemperature = "20 °C"\noperator = "A. B."\n', "utf-8")
    settings = ss.rig.read_rig(path)
    bare = ss.Record.of({"x": np.zeros(9)}, fs=10.0).with_log({"lubrication": "dry"})
    assert settings.logged(bare).log == Log(lubrication="dry", temperature="20 °C", operator="A. B.")
    assert ss.rig.rig_settings(settings.model_dump(exclude_unset=True)).log == settings.log
    path.write_text('[log]\nhumidity = "wet"\n', "utf-8")
    with pytest.raises(ss.errors.ModelError, match="log"):
        ss.rig.read_rig(path)


def test_the_load_logged_makes_a_coefficient_and_the_page_has_the_log() -> None:
    demo = ss.datasets.demo().rows(0, 8000).with_log(ENTRIES)
    findings = ss.analyze(demo, mass=2.42, stiffness=2310)
    assert findings.normal.value == 2.45
    story = ss.summary(findings)
    rows = next(table.rows for table in story.tables if table.title.startswith("What was logged"))
    assert ("Surfaces", "steel on steel, 400-grit") in rows
    assert story.data()["log"]["humidity"] == 0.45
