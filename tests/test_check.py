"""The check-up finds every planted fault, and none where nothing is wrong."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from corpus import FS, Damaged, clean_records, damaged_records
from stickslip import Record, read_record
from stickslip.errors import RecordError
from stickslip.record.check import Fault
from stickslip.record.clock import fit_clock
from stickslip.record.flaws import spikes
from stickslip.signals import repair_clock

SEEDS = (0, 2)
DAMAGED = [(seed, damaged_record) for seed in SEEDS for damaged_record in damaged_records(seed)]
CLEAN = [(seed, *clean_record) for seed in SEEDS for clean_record in clean_records(seed).items()]


def test_the_corpus_is_large_enough():
    names = {each.name for _, each in DAMAGED}
    assert len(names) >= 40
    assert len({name for _, name, _ in CLEAN}) >= 15


@pytest.mark.parametrize(("seed", "damaged"), DAMAGED, ids=[f"{each.name}, seed {seed}" for seed, each in DAMAGED])
def test_finds_a_planted_fault_and_no_other(seed: int, damaged: Damaged):
    faults = damaged.record.check()
    assert [(fault.kind, fault.channel) for fault in faults] == [(damaged.kind, damaged.channel)]
    for first, last in damaged.rows:
        assert any(low <= last and first <= high for low, high in faults[0].rows), (first, last)


@pytest.mark.parametrize(("seed", "name", "record"), CLEAN, ids=[f"{name}, seed {seed}" for seed, name, _ in CLEAN])
def test_finds_nothing_in_a_clean_record(seed: int, name: str, record: Record):
    assert record.check() == []


def test_says_where_and_what_mends_it():
    (damaged,) = (each for seed, each in DAMAGED if seed == 0 and each.name == "missing in sine")
    (first, last), (fault,) = damaged.rows[0], damaged.record.check()
    assert fault.message == (
        f"channel x has 15 values that are not numbers (rows {first} to {last}); fill them with fill_missing(record)."
    )
    assert fault.severity == "error"


def test_short_and_empty_records_are_told_in_words():
    short = Record.of({"x": np.arange(10.0)}, fs=FS)
    assert [fault.kind for fault in short.check()] == ["short"]
    nothing = Record.of({"x": np.full(100, np.nan)}, fs=FS)
    assert [(fault.kind, fault.rows) for fault in nothing.check()] == [("missing", ((0, 99),))]


def test_what_is_advised_for_missing_values_can_be_done():
    wave = np.sin(2 * np.pi * np.arange(4000) / 400)
    wave[:30] = wave[3950:] = np.nan
    (fault,) = Record.of({"x": wave}, fs=FS).check()
    assert fault.message.endswith("; cut those at the ends off with record.rows(30, 3950).")
    assert Record.of({"x": wave}, fs=FS).rows(30, 3950).check() == []
    wave[1000:1101] = wave[2000] = np.nan
    (fault,) = Record.of({"x": wave}, fs=FS).check()
    assert fault.message.endswith(
        "; cut those at the ends off with record.rows(30, 3950); rows 1000 to 1100 are too many in a row to be told by "
        "what lies around them (more than 100): keep a part without them with record.rows(); "
        "fill the others with fill_missing(record)."
    )
    (fault,) = Record.of({"x": np.full(100, np.nan)}, fs=FS).check()
    assert "fill_missing" not in fault.message


def test_many_rows_are_counted_not_listed():
    values = np.sin(np.arange(4000) / 30)
    values[::100] = np.nan
    (fault,) = Record.of({"x": values}, fs=FS).check()
    assert len(fault.rows) == 40
    assert "and 35 more places" in fault.message


def test_faults_of_several_channels_are_told_apart():
    clean = clean_records()
    x, force = clean["sticking, noise"]["x"].copy(), clean["square wave, noise"]["force"].copy()
    x[3000:3010], force[1234] = np.nan, 40.0
    both = Record.of({"x": x, "force": force}, fs=FS)
    assert {(fault.kind, fault.channel) for fault in both.check()} == {("missing", "x"), ("spike", "force")}


def test_a_million_samples_are_checked_within_seconds():
    import time

    rng = np.random.default_rng(0)
    wave = np.tile(clean_records()["sticking, noise"]["x"], 170)
    record = Record.of({"x": wave + 1e-6 * rng.normal(size=len(wave))}, fs=FS)
    began = time.process_time()
    assert record.check() == []
    assert time.process_time() - began < 5.0


def test_a_clock_without_a_unit_is_told_with_the_rate_that_it_gives(tmp_path):
    rows = "".join(f"{i},{math.sin(i * 0.05):.5f}\n" for i in range(500))
    path = tmp_path / "run.csv"
    path.write_text(f"time,x [mm]\n{rows}", "utf-8")
    (fault,) = read_record(path).check()
    assert (fault.kind, fault.channel) == ("unit", None)
    assert "1 samples a second" in fault.message
    assert read_record(path, time="time [ms]").check() == read_record(path, fs=1000).check() == []
    path.write_text(f"time [ms],x [mm]\n{rows}", "utf-8")
    assert read_record(path).check() == []


def test_real_records_without_fault(dataset):
    channels = {"x": "qm [m]", "force": "gtau * vir [N]"}
    emps = read_record(dataset("emps") / "DATA_EMPS.mat", channels=channels, time="t [s]")
    assert emps.check() == []
    folder = dataset("frame_base_excited")
    for weight in ("250g", "450g"):
        files = [folder / f"s_b_{weight}_{letter}.mat" for letter in "xy"]
        assert read_record(files, channels={"x": "x [mm]", "z": "y [mm]"}, units={"t": "s"}).check() == []


def test_real_record_with_host_stamps(dataset):
    for name in ("60.txt", "100.txt"):
        record = read_pendulum(dataset("pendulum_bad_clock") / name)
        (fault,) = record.check()
        assert (fault.kind, fault.channel) == ("clock", None)
        assert "259.5 Hz" in fault.message
        assert "jump by 62 ms" in fault.message


def test_real_record_with_lost_samples(dataset):
    record = read_seal(dataset("rubber_seal") / "O-ring_1bar.csv")
    faults = {fault.kind: fault for fault in record.check()}
    assert set(faults) == {"gap", "jitter"}
    assert faults["gap"].rows[0] == (12, 13)  # 126 ms is followed by 391 ms
    assert "up to 265 ms" in faults["gap"].message


def read_pendulum(path: Path) -> Record:
    return read_record(path, channels={"theta": "Angle [deg]"}, time="Time_Elapsed")


def read_seal(path: Path) -> Record:
    return read_record(path, channels={"x": "#5 [mm]", "force": "#7 [N]"}, time="#1 [ms]")


def test_stamps_by_clock_strings_are_seen_through_too(dataset):
    lines = (dataset("pendulum_bad_clock") / "100.txt").read_text().splitlines()[2:]
    clock = [line.split(",")[0].split(":") for line in lines if line.strip()]
    stamps = np.array([3600 * float(h) + 60 * float(m) + float(s) for h, m, s in clock])
    record = replace(Record.of({"x": np.sin(np.arange(len(stamps)) / 50)}, fs=260.0), stamps=stamps)
    (fault,) = record.check()
    assert fault.kind == "clock"
    assert "259.5 Hz" in fault.message


# ---- stamps are kept where the check-up names a fault of the clock, and nowhere else


CLOCK_KINDS = {"clock", "rate", "backwards", "repeated stamps", "jitter", "gap", "missing"}


def clock_faults(stamps: np.ndarray) -> list[Fault]:
    record = replace(Record.of({"x": np.sin(np.arange(len(stamps)) / 30)}, fs=250.0), stamps=stamps)
    return [fault for fault in record.check() if fault.channel is None and fault.kind in CLOCK_KINDS]


@settings(deadline=None, max_examples=150, derandomize=True)
@given(
    jitter=st.sampled_from([0, 1e-5, 1e-4, 5e-4, 2e-3, 5e-3, 1e-2, 3e-2, 0.1, 0.4]),
    odd=st.sampled_from([0, 0.02, 0.3, 0.8, 1.0, 5.0, -0.5, -1.0, -3.0]),
    digits=st.sampled_from([3, 4, 6, 9]),
    drift=st.sampled_from([0, 1e-6, 1e-4]),
    seed=st.integers(0, 99),
)
def test_stamps_are_kept_where_the_check_up_says_why(
    jitter: float, odd: float, digits: int, drift: float, seed: int
) -> None:
    rows = np.arange(600)
    late = jitter * np.random.default_rng(seed).normal(size=600) + odd * (rows > 300) + drift * rows**2 / 600
    stamps = np.round((rows + late) / 250, digits)
    faults = clock_faults(stamps)
    assert (fit_clock(stamps).stamps is not None) == bool(faults)
    assert all(fault.severity == "error" and "(record" in fault.message for fault in faults)


@pytest.mark.parametrize("jitter", [2e-3, 5e-3, 1e-2])
def test_a_small_jitter_is_told_and_mended(jitter: float):
    rows = np.arange(2000)
    stamps = (rows + jitter * np.random.default_rng(3).uniform(-1, 1, 2000)) / 250
    (fault,) = clock_faults(stamps)
    assert fault.kind == "jitter"
    record = replace(Record.of({"x": np.sin(rows / 30)}, fs=250.0), stamps=stamps)
    repair_clock(record).require_clean("x")


def test_one_long_interval_is_told():
    stamps = (np.arange(2000) + 0.3 * (np.arange(2000) > 1200)) / 250
    (fault,) = clock_faults(stamps)
    assert (fault.kind, fault.rows) == ("jitter", ((1200, 1201),))


@pytest.mark.parametrize(("share", "found"), [(0.002, 1.0), (0.012, 1.0), (0.05, 0.0)])
def test_spikes_are_found_up_to_one_sample_in_sixty(share: float, found: float):
    rng = np.random.default_rng(8)
    rows = np.arange(20, 3980, 20)[rng.permutation(198)[: round(4000 * share)]]  # two within ten rows may hide
    values = np.sin(np.arange(4000) / 60)
    values[rows] += 5.0
    assert sum(last - first + 1 for first, last in spikes(values)) >= found * 0.95 * len(rows)
    if not found:
        assert not spikes(values)


def test_a_fault_is_shown_briefly_and_told_in_full():
    values = np.sin(np.arange(4000) / 30)
    values[7:9] = np.nan
    (fault,) = Record.of({"x": values}, fs=FS).check()
    assert repr(fault) == "Fault(error: missing in x, rows 7 to 8)"
    assert str(fault) == fault.message


def test_constant_channels_are_told_once_and_without_a_unit_that_says_nothing():
    moving = {"x": np.sin(np.arange(4000) / 30)}
    (fault,) = Record.of({**moving, "trigger": np.zeros(4000)}, fs=FS).check()
    assert fault.message.startswith("channel trigger is constant at 0 throughout;")
    (fault,) = Record.of({**moving, **{f"ch{n}": np.full(4000, n) for n in range(12)}}, fs=FS).check()
    assert (fault.kind, fault.channel, fault.rows) == ("constant", None, ((0, 3999),))
    assert fault.message.startswith(
        "12 of 13 channels are constant throughout (ch0, ch1, ch2, ch3, ch4, ch5, ch6, ch7 and 4 more); look at"
    )


def test_one_value_is_told_as_one():
    values = np.sin(np.arange(4000) / 30)
    values[7] = np.nan
    with pytest.raises(RecordError, match="channel x has a value that is no number at row 7;"):
        Record.of({"x": values}, fs=FS).require_clean("x", question="a loop")


@pytest.mark.parametrize("rows", range(2, 22))
def test_few_stamps_are_checked_too(rows: int):
    stamps = np.cumsum(np.where(np.arange(rows) % 3 == 1, 0.0, 1.0 + np.arange(rows)))
    record = replace(Record.of({"x": np.arange(float(rows))}, fs=FS), stamps=stamps)
    assert record.check()[0].severity == "error"


def test_a_measured_friction_at_the_end_of_its_range_is_clipped() -> None:
    """A square wave with noise on its levels has none; a friction that was computed has no sensor that could."""
    chance = np.random.default_rng(0)
    v = 0.1 * np.cos(0.02 * np.pi * np.arange(2000))
    friction = np.sign(v) * (2 + 0.8 * np.exp(-np.abs(v) / 0.02)) + chance.normal(0, 0.02, v.size)
    record = Record.of({"v": v, "friction": friction}, fs=1000.0)
    assert not [fault for fault in record.check() if fault.kind == "clipped"]
    cut = record.with_channel("friction", np.clip(friction, -2.4, 2.4), unit="N", source="load cell")
    assert [fault.channel for fault in cut.check() if fault.kind == "clipped"] == ["friction"]
    computed = record.with_channel("friction", cut["friction"], unit="N", source="friction_force")
    assert not [fault for fault in computed.check() if fault.kind == "clipped"]


def test_a_joint_that_turns_round_on_static_friction_is_not_clipped() -> None:
    """It arrives with its speed gone and leaves at once: what followed the rest looked like a top that was cut."""
    slow, rest, fast = np.arange(200.0, 0.0, -1.0), np.zeros(36), np.arange(1.0, 806.0)
    there = np.concatenate([-6e-5 * slow**2, rest, -3e-3 * (fast - 5 * (1 - np.exp(-fast / 5)))])
    x = np.concatenate([there, -4.8 - there] * 3)
    counted = np.round(x / 1.534e-3) * 1.534e-3
    assert not [fault for fault in Record.of({"x": counted}, fs=200.0).check() if fault.kind == "clipped"]
    cut = np.clip(counted, -4.5, -0.3)
    assert [fault for fault in Record.of({"x": cut}, fs=200.0).check() if fault.kind == "clipped"]
