"""A Record goes to pandas, xarray and SEP 005 and comes back; what others made comes in through the same door."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from stickslip.errors import FormatError, RecordError
from stickslip.record.exchange import from_pandas, from_sep005, from_xarray
from stickslip.record.record import Record, StatedRig, Step

WAYS = [
    pytest.param(Record.to_pandas, from_pandas, id="pandas"),
    pytest.param(Record.to_xarray, from_xarray, id="xarray"),
    pytest.param(Record.to_sep005, from_sep005, id="sep005"),
]


def rich_record() -> Record:
    rng = np.random.default_rng(5)
    samples = {"x": rng.standard_normal(300), "load": rng.standard_normal(300), "ch1": np.full(300, np.nan)}
    record = Record.of(samples, fs=150.3, units={"x": "mm", "load": "kip"}, start=17.2, truth={"level": 0.68})
    record = record.with_details("load", sensitivity="500 mV/lbf", delay=1.5e-3, noise=0.02, gain_sd=0.005)
    step = Step("repair", {"rows": (3, 9), "how": [1, 2.5]}, "mended")
    return replace(record, history=(*record.history, step), rig=StatedRig("smoother", mass=2.42, sd={"mass": 0.02}))


def broken_clock() -> Record:
    stamps = np.repeat(np.arange(20) * 0.062, 5)
    return replace(rich_record().rows(0, 100), stamps=stamps, start=0.0)


@pytest.mark.parametrize(("out", "back"), WAYS)
@pytest.mark.parametrize("record", [rich_record(), broken_clock()], ids=["uniform", "broken clock"])
def test_round_trip_is_exact(out: Any, back: Any, record: Record) -> None:
    assert back(out(record)).equals(record)


@pytest.mark.parametrize(("out", "back"), WAYS)
@given(fs=st.floats(1e-3, 1e7), start=st.floats(-1e6, 1e6), rows=st.integers(1, 9))
def test_any_clock_survives(out: Any, back: Any, fs: float, start: float, rows: int) -> None:
    record = Record.of({"v": np.arange(rows)}, fs=fs, start=start)
    assert back(out(record)).equals(record)


@pytest.mark.parametrize(("out", "back"), WAYS)
def test_what_leaves_is_a_copy(out: Any, back: Any) -> None:
    record = rich_record()
    given_out = out(record)
    channel = given_out[0]["data"] if isinstance(given_out, list) else given_out["x"]
    channel[:] = 0.0
    assert np.all(record["x"] != 0.0)


def test_a_channel_called_time_keeps_its_place() -> None:
    record = Record.of({"time": [3.0, 1.0, 2.0], "x": [0.0, 1.0, 2.0]}, fs=10.0, units={"time": "s"})
    assert from_xarray(record.to_xarray()).equals(record)
    assert from_pandas(record.to_pandas()).equals(record)


def test_a_frame_that_was_cut_keeps_units_and_history_and_says_so() -> None:
    record = rich_record()
    part = from_pandas(record.to_pandas().iloc[100:200][["x"]])
    assert np.array_equal(part["x"], record["x"][100:200])
    assert part.fs == pytest.approx(record.fs, rel=1e-6)
    assert part.start == pytest.approx(record.time[100])
    assert [step.action for step in part.history] == ["Record.of", "with_details", "repair", "from_pandas"]


# ---- what was changed outside


def rescale(made: Any, factor: float) -> None:
    """The channel x times `factor`, in place."""
    if isinstance(made, list):
        made[0]["data"] = made[0]["data"] * factor
    else:
        attributes = dict(made["x"].attrs)
        made["x"] = made["x"] * factor
        made["x"].attrs.update(attributes)


def relabel(made: Any, unit: str) -> None:
    """The channel x stated in another unit, in place."""
    if isinstance(made, list):
        made[0]["unit_str"] = unit
    elif isinstance(made, pd.DataFrame):
        made.attrs["units"]["x"] = unit
    else:
        made["x"].attrs["units"] = unit


@pytest.mark.parametrize(("out", "back"), WAYS)
def test_a_channel_turned_into_mm_outside_comes_back_the_same_size(out: Any, back: Any) -> None:
    record = rich_record()
    made = out(record)
    rescale(made, 1000.0)
    relabel(made, "mm")
    again = back(made)
    assert np.allclose(again["x"], record["x"], rtol=1e-15, atol=0)
    assert again.history[-1].action == back.__name__
    assert "not as it left" in again.history[-1].outcome
    assert list(again.history[:-1]) == list(record.history)


@pytest.mark.parametrize(("out", "back"), WAYS)
def test_values_changed_outside_are_logged(out: Any, back: Any) -> None:
    made = out(rich_record())
    rescale(made, 2.0)
    again = back(made)
    assert np.array_equal(again["x"], 2 * rich_record()["x"])
    assert again.history[-1].action == back.__name__


@pytest.mark.parametrize(("out", "back"), WAYS)
def test_a_unit_corrected_outside_counts(out: Any, back: Any) -> None:
    made = out(rich_record())
    relabel(made, "mm")
    assert np.allclose(back(made)["x"], 1e-3 * rich_record()["x"], rtol=1e-15, atol=0)


def test_a_time_axis_changed_outside_counts() -> None:
    frame = rich_record().to_pandas()
    frame.index = pd.Index(2 * frame.index.to_numpy(), name="time")
    assert from_pandas(frame).fs == pytest.approx(rich_record().fs / 2)


# ---- foreign


def test_foreign_frame_with_header_units_and_dates() -> None:
    index = pd.date_range("2024-01-24", periods=5, freq="4ms")
    record = from_pandas(pd.DataFrame({"x [mm]": range(5), "Load Cell [kN]": range(5)}, index=index))
    assert record.fs == 250.0
    assert record.start == 0.0
    assert np.allclose(record["x"], np.arange(5) * 1e-3, rtol=1e-15)
    assert record["Load_Cell"][1] == 1000.0
    assert record.channels["Load_Cell"].unit == "N"
    assert record.history[-1].action == "from_pandas"


@pytest.mark.parametrize(
    "index",
    [pd.to_timedelta(np.arange(4) * 0.5, unit="s"), pd.Index([0.0, 0.5, 1.0, 1.5])],
    ids=["timedelta", "numbers"],
)
def test_foreign_frame_clock(index: pd.Index) -> None:
    record = from_pandas(pd.DataFrame({"a": [1.0, 2.0, 3.0, 4.0]}, index=index), units={"a": "g"})
    assert record.fs == 2.0
    assert record["a"][0] == 9.80665  # an acceleration: g is gravity, not gram


def test_irregular_stamps_are_kept() -> None:
    stamps = [0.0, 0.1, 0.2, 0.5, 0.6]
    record = from_pandas(pd.DataFrame({"x": range(5)}, index=stamps))
    assert np.array_equal(record.time, stamps)
    assert record.stamps is not None
    assert record.fs == pytest.approx(10.0)
    assert "not uniform" in record.history[-1].outcome


def test_time_may_be_a_column_or_a_rate() -> None:
    frame = pd.DataFrame({"t": [0.0, 0.01, 0.02], "x": [1.0, 2.0, 3.0]})
    assert from_pandas(frame, time="t").fs == 100.0
    assert list(from_pandas(frame[["x"]], fs=40).time) == [0.0, 0.025, 0.05]


def test_foreign_dataset() -> None:
    dataset = xr.Dataset(
        {"x": ("t", [1.0, 2.0, 4.0], {"units": "um"}), "v": ("t", [1.0, 2.0, 4.0], {"unit": "mm/s"})},
        coords={"t": ("t", [5.0, 6.0, 7.0], {"units": "ms"})},
    )
    record = from_xarray(dataset)
    assert (record.fs, record.start) == (1000.0, 0.005)
    assert record["x"][2] == pytest.approx(4e-6, rel=1e-15)
    assert record["v"][0] == 1e-3


def test_foreign_sep005() -> None:
    channels = [
        {
            "name": "acc 1",
            "data": np.array([1.0, 2.0]),
            "unit_str": "m/s²",
            "fs": 125,
            "start_timestamp": "2023-06-29T15:00",
        },
        {
            "name": "temp",
            "data": np.array([3.0, 4.0]),
            "unit_str": "",
            "fs": 125,
            "start_timestamp": "2023-06-29T15:00",
        },
    ]
    record = from_sep005(channels)
    assert record.fs == 125
    assert list(record) == ["acc_1", "temp"]
    assert record.channels["acc_1"].unit == "m/s^2"
    assert record.history[-1].arguments == {"start_timestamp": "2023-06-29T15:00:00"}
    timed = from_sep005({"name": "x", "data": np.arange(4.0), "unit_str": "mm", "time": np.array([1.0, 2.0, 3.0, 4.0])})
    assert (timed.fs, timed.start, timed["x"][3]) == (1.0, 1.0, 3e-3)


def test_sep005_keeps_to_the_standard() -> None:
    """Compulsory and prohibited fields of the text of SEP 005 (draft of 2023-07-07)."""
    for record, clock in ((rich_record(), "fs"), (broken_clock(), "time")):
        channels = record.to_sep005()
        names = [channel["name"] for channel in channels]
        assert len(set(names)) == len(names)
        for channel in channels:
            assert type(channel["data"]) is np.ndarray
            assert {"data", "name", "unit_str", clock} <= set(channel)
            assert not {"unit", "timestamp", "signal", "sample_frequency", "Fs", "starttimestamp"} & set(channel)
            if clock == "time":
                assert len(channel["time"]) == len(channel["data"])


# ---- what can not be a record


def sep(**changes: Any) -> dict[str, Any]:
    return {"name": "x", "data": np.arange(3.0), "unit_str": "mm", "fs": 10, **changes}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: from_pandas(pd.DataFrame({"x": [1.0, 2.0]})), "pass fs="),
        (lambda: from_pandas(pd.DataFrame({"x": ["a", "b"]}), fs=1), "not numbers"),
        (lambda: from_pandas(pd.DataFrame({"x": [1.0]}), fs=1, units={"y": "m"}), "units= names y"),
        (lambda: from_pandas(pd.DataFrame({"x": [1.0]}), fs=1, units={"x": "furlongx"}), "not known"),
        (lambda: from_pandas(pd.DataFrame({"x": [1.0]}), fs=1, time="t"), "no column 't'"),
        (lambda: from_pandas(pd.DataFrame([[1.0, 2.0]], columns=["x", "x"]), fs=1), "one name"),
        (lambda: from_pandas(pd.DataFrame({"a b": [1.0], "a-b": [1.0]}), fs=1), "different names"),
        (lambda: from_pandas(pd.DataFrame(), fs=1), "at least one channel"),
        (lambda: from_pandas([1.0]), "of type list"),
        (lambda: from_pandas(pd.DataFrame({"x": [1.0, 2.0]}, index=[5.0, 5.0])), "does not advance"),
        (lambda: from_xarray(xr.Dataset({"x": (("t", "k"), np.zeros((2, 2)))})), "one dimension"),
        (lambda: from_xarray(xr.Dataset({"x": ("t", [1.0, 2.0])})), "pass fs="),
        (lambda: from_xarray(xr.Dataset()), "no dimension"),
        (lambda: from_xarray(3), "of type int"),
        (lambda: from_xarray(xr.Dataset({"x": ("t", [1 + 1j])}), fs=1.0), "complex128"),
        (lambda: from_sep005([sep(), sep()]), "unique"),
        (lambda: from_sep005([sep(), sep(name="v", fs=11)]), "2 clocks"),
        (lambda: from_sep005([sep(), sep(name="v", data=np.arange(4.0))]), "2 clocks"),
        (lambda: from_sep005([sep(fs=None)]), "lacks fs and time"),
        (lambda: from_sep005([{"name": "x", "data": np.arange(3.0), "fs": 1}]), "lacks unit_str"),
        (lambda: from_sep005([sep(start_timestamp="yesterday")]), "ISO 8601"),
        (lambda: from_sep005([sep(data=np.zeros((2, 2)))]), "one row of real numbers"),
        (lambda: from_sep005([sep(fs="fast")]), "fs"),
        (lambda: from_sep005([sep(time=np.arange(2.0), fs=None)]), "2, 3 values"),
        (lambda: from_sep005([]), "0 clocks"),
    ],
)
def test_refused_in_one_sentence(call: Any, words: str) -> None:
    with pytest.raises((RecordError, FormatError), match=words) as caught:
        call()
    assert len(caught.value.args) == 3
    assert "\n" not in str(caught.value)


def test_damaged_description_is_refused() -> None:
    frame = rich_record().to_pandas()
    key = next(key for key in frame.attrs if key != "units")
    for text in ("{", '{"version": 1}', '{"version": 99, "channels": []}'):
        frame.attrs[key] = text
        with pytest.raises(FormatError):
            from_pandas(frame)
