"""A record can not be changed behind its back, and takes no detail that makes no sense."""

from __future__ import annotations

import contextlib
import copy
import json
import math
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.files import write
from stickslip.record.channels import Channel
from stickslip.record.exchange import metadata_to_record
from stickslip.record.metadata import record_to_metadata
from stickslip.record.record import Record, Step


@pytest.mark.parametrize(
    "shown", [lambda a: a, lambda a: a[:], lambda a: np.lib.stride_tricks.as_strided(a, writeable=False)]
)
def test_an_array_changed_afterwards_changes_no_record(shown: Callable[[np.ndarray], np.ndarray]) -> None:
    x = np.zeros(5)
    given = Record({"x": shown(x)}, {"x": Channel("x", "m")}, 10.0, stamps=shown(x))
    x[0] = 7
    assert given["x"][0] == 0
    assert given.time[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        given["x"][0] = 7


def test_rows_share_the_samples_of_their_record() -> None:
    record = Record.of({"x": np.zeros(50)}, fs=10.0)
    assert np.shares_memory(record.rows(3, 9)["x"], record["x"])


@pytest.mark.parametrize(
    "details",
    [
        {"delay": math.nan},
        {"delay": math.inf},
        {"delay": "x"},
        {"delay": None},
        {"delay": True},
        {"noise": -1.0},
        {"noise": math.nan},
        {"noise": "x"},
        {"sensitivity": 5},
        {"quantity": None},
        {"gain_sd": -0.01},
        {"gain_sd": math.nan},
        {"gain_sd": 1.0},
        {"gain_sd": "1 %"},
        {"foo": 1},
        {"name": "y"},
        {"unit": "mm"},
    ],
)
def test_details_that_make_no_sense_are_refused(details: dict[str, Any]) -> None:
    with pytest.raises(ss.errors.RecordError):
        Record.of({"x": [1.0, 2.0]}, fs=1.0).with_details("x", **details)


@pytest.mark.parametrize("sd", [{"mass": -0.02}, {"stiffness": math.nan}, {"damping": math.inf}, {"length": 0.1}])
def test_a_deviation_that_makes_no_sense_is_refused(sd: dict[str, float]) -> None:
    with pytest.raises(ss.errors.RecordError, match="standard deviation"):
        ss.record.StatedRig("smoother", mass=2.42, sd=sd)


def test_a_rig_with_deviations_is_one_key_and_no_other_rig() -> None:
    exact, unsure = (ss.record.StatedRig("smoother", mass=2.42, sd=sd) for sd in ({}, {"mass": 0.02}))
    assert exact != unsure
    assert len({exact, unsure, replace(unsure)}) == 2


def test_a_description_from_before_deviations_is_read() -> None:
    rig = ss.record.StatedRig("smoother", mass=2.42, stiffness=2310.0)
    record = replace(Record.of({"x": [1.0, 2.0]}, fs=1.0), rig=rig)
    told = record_to_metadata(record)
    del told["rig"]["sd"], told["channels"][0]["gain_sd"]
    assert metadata_to_record(told, record.samples).equals(record)


@pytest.mark.parametrize(
    ("name", "unit"), [("x", "furlong"), ("x", "N"), ("ch", ""), ("ch", 5), ("a b", "m"), (5, "m")]
)
def test_a_channel_has_a_name_and_a_unit_that_fit(name: Any, unit: Any) -> None:
    with pytest.raises(ss.errors.RecordError):
        Channel(name, unit)


@pytest.mark.parametrize("step", [("do", "abc", ""), ("do", {1: 2}, ""), (5, {}, ""), ("do", {}, None)])
def test_a_step_is_words_and_a_mapping(step: tuple[Any, Any, Any]) -> None:
    with pytest.raises(ss.errors.RecordError):
        Step(*step)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"arguments": {"fs": 10.0, "units": {"x": "m"}}', '"arguments": "abc"'),
        ('"arguments": {"fs": 10.0, "units": {"x": "m"}}', '"arguments": {"files": [1, 2]}'),
        ('"truth": {}', '"truth": "text"'),
        ('"truth": {}', '"truth": [["a", 1]]'),
        ('"unit": "m"', '"unit": 5'),
        ('"unit": "m"', '"unit": "furlong"'),
        ('"noise": null', '"noise": -1'),
        ('"delay": 0.0', '"delay": "x"'),
        ('"delay": 0.0', '"delay": NaN'),
        ('"history": [', '"history": [5, '),
        ('"sha256": {', '"sha256": {}, "rest": {'),
        ('"stamps": false', '"stamps": "yes"'),
    ],
)
@pytest.mark.parametrize("suffix", [".csv", ".h5"])
def test_a_poisoned_description_is_one_sentence(
    tmp_path: Path, suffix: str, old: str, new: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def poisoned(told: Any) -> str:
        text = json.dumps(told)
        assert old in text
        return text.replace(old, new, 1)

    record = Record.of({"x": [1.0, 2.0, 4.0]}, fs=10.0)
    monkeypatch.setattr(write, "json", SimpleNamespace(dumps=poisoned))
    path = ss.write_record(record, tmp_path / f"kept{suffix}")
    with contextlib.suppress(ss.StickslipError):  # what does not fit is refused, or not believed and read anew
        assert ss.read_record(path).history[-1].action == "read_record"


def test_a_record_is_pickled_and_copied_read_only() -> None:
    record = Record.of({"x": [0.0, 1.0, 0.0, -1.0]}, fs=4.0, truth={"mass": 1.0})
    for again in (pickle.loads(pickle.dumps(record)), copy.deepcopy(record)):
        assert (again["x"] == record["x"]).all()
        assert (dict(again.channels), again.history, again.truth) == (
            dict(record.channels),
            record.history,
            record.truth,
        )
        with pytest.raises(ValueError, match="read-only"):
            again["x"][0] = 1.0
