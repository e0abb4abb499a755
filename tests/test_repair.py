"""A repair brings a damaged record closer to the truth, changes nothing in a clean one, and says what it did."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from corpus import FS, Damaged, clean_records, damaged_records
from stickslip import Record, friction_force
from stickslip.answers import mend
from stickslip.errors import RecordError
from stickslip.record.flaws import runs_of
from stickslip.signals import (
    fill_gaps,
    fill_missing,
    remove_drift,
    remove_spikes,
    repair_clock,
    resample,
    restore_clipped,
)
from stickslip.signals.interpolate import band_limited, bridge
from test_check import read_pendulum, read_seal

DAMAGED = list(damaged_records())
UNMENDED = ("coarse", "constant", "frozen")  # the check-up names no repair: what was not measured is not known
SMOOTH = ("sine", "sine, noise", "sine, LVDT steps", "sum of sines", "chirp", "noise of a band")


def planted(kind: str) -> list[Damaged]:
    return [each for each in DAMAGED if each.kind == kind]


def named(damaged: Damaged) -> str:
    return damaged.name


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def held(record: Record, channel: str) -> np.ndarray:
    """The plain remedy: the last number before a missing one."""
    rows = np.where(np.isfinite(record[channel]), np.arange(len(record)), 0)
    return record[channel][np.maximum.accumulate(rows)]


# ---- by the name that the check-up gives


@pytest.mark.parametrize("damaged", {damaged.kind: damaged for damaged in reversed(DAMAGED)}.values(), ids=named)
def test_the_repair_that_a_fault_names_mends_it(damaged: Damaged):
    faults = [fault for fault in damaged.record.check() if fault.kind == damaged.kind]
    assert [bool(fault.repair) for fault in faults] == [damaged.kind not in UNMENDED] * len(faults)
    for repair in {fault.repair for fault in faults} - {""}:
        mended = mend(damaged.record, repairs=[repair])
        assert damaged.kind not in {fault.kind for fault in mended.check()}
        assert [step.repair for step in mended.history if step.repair] == [repair]


# ---- closer to the truth


@pytest.mark.parametrize("damaged", [each for each in planted("missing") if each.channel], ids=named)
def test_filling_is_better_than_holding(damaged: Damaged):
    truth = damaged.clean[damaged.channel]
    filled = fill_missing(damaged.record)
    assert np.isfinite(filled[damaged.channel]).all()
    assert rms(filled[damaged.channel] - truth) < rms(held(damaged.record, damaged.channel) - truth)
    known = np.isfinite(damaged.record[damaged.channel])
    assert np.array_equal(filled[damaged.channel][known], truth[known])
    assert "filled (row" in filled.history[-1].outcome


def test_nothing_is_made_up_beyond_the_ends_or_in_a_gap_too_long():
    wave = np.sin(2 * np.pi * np.arange(4000) / 400)
    spoilt = wave.copy()
    spoilt[:30] = spoilt[500:600] = spoilt[1000:1101] = spoilt[3000] = spoilt[3950:] = np.nan
    record = Record.of({"x": spoilt}, fs=FS)
    filled = fill_missing(record)
    assert runs_of(np.isnan(filled["x"])) == ((0, 29), (1000, 1100), (3950, 3999))
    assert np.max(np.abs(filled["x"] - wave)[np.isfinite(filled["x"])]) < 1e-3
    assert filled.history[-1].outcome == (
        "101 values of x filled (rows 500 to 599, 3000); rows 1000 to 1100 stay NaN, being longer than 100; longest= "
        "says otherwise; rows 0 to 29, 3950 to 3999 stay NaN, being at the end; record.rows() cuts them off"
    )
    assert runs_of(np.isnan(fill_missing(record, longest=101)["x"])) == ((0, 29), (3950, 3999))
    assert runs_of(np.isnan(fill_missing(record, "x", longest=1)["x"]))[1] == (500, 599)


@pytest.mark.parametrize("damaged", planted("spike"), ids=named)
def test_spikes_are_replaced_by_what_was_there(damaged: Damaged):
    truth, spoilt = damaged.clean[damaged.channel], damaged.record[damaged.channel]
    mended = remove_spikes(damaged.record)
    assert rms(mended[damaged.channel] - truth) < 0.05 * rms(spoilt - truth)
    assert mended.check() == []


@pytest.mark.parametrize("damaged", planted("clipped"), ids=named)
def test_clipped_tops_come_closer_to_the_truth(damaged: Damaged):
    truth, spoilt = damaged.clean[damaged.channel], damaged.record[damaged.channel]
    mended = restore_clipped(damaged.record, damaged.channel)
    share = 0.65 if damaged.name.split(" in ")[1] in SMOOTH else 1.0
    assert rms(mended[damaged.channel] - truth) <= share * rms(spoilt - truth)
    assert "a guess" in mended.history[-1].outcome
    marked = restore_clipped(damaged.record, damaged.channel, method="mark")[damaged.channel]
    assert np.array_equal(marked[np.isfinite(marked)], spoilt[np.isfinite(marked)])
    assert not np.isfinite(marked).all()


@pytest.mark.parametrize("damaged", planted("drift"), ids=named)
def test_drift_is_taken_off(damaged: Damaged):
    truth, spoilt = damaged.clean[damaged.channel], damaged.record[damaged.channel]
    mended = remove_drift(damaged.record, damaged.channel)
    assert rms(mended[damaged.channel] - truth) < 0.05 * rms(spoilt - truth)
    assert mended.check() == []


@pytest.mark.parametrize("damaged", planted("gap"), ids=named)
def test_samples_beside_a_gap_return_to_their_instants(damaged: Damaged):
    (channel,) = damaged.clean
    filled = fill_gaps(damaged.record)
    assert filled.stamps is None
    assert filled.fs == pytest.approx(FS, rel=1e-9)
    assert len(filled) == len(damaged.clean)
    there = np.isin(damaged.clean.time.round(6), damaged.record.stamps.round(6))
    assert np.allclose(
        filled[channel][there], damaged.clean[channel][there], rtol=0, atol=1e-9 * np.ptp(filled[channel][there])
    )
    whole = fill_gaps(damaged.record, longest=1.0)
    assert np.isfinite(whole[channel]).all()
    assert rms(whole[channel] - damaged.clean[channel]) < 0.3 * np.std(damaged.clean[channel])


def test_long_gaps_stay_open_and_are_told():
    (damaged,) = (each for each in DAMAGED if each.name == "gap in sine, noise")
    filled = fill_gaps(damaged.record)
    lost = np.flatnonzero(np.isnan(filled["x"]))
    assert len(lost) > 10
    assert f"{len(lost)} samples in gaps over 6 ms are NaN" in filled.history[-1].outcome
    assert [fault.kind for fault in filled.check()] == ["missing"]


# ---- clocks


@pytest.mark.parametrize(
    "damaged", [each for kind in ("clock", "backwards", "repeated stamps") for each in planted(kind)], ids=named
)
def test_even_samples_get_their_clock_back(damaged: Damaged):
    mended = repair_clock(damaged.record)
    assert mended.stamps is None
    assert mended.fs == pytest.approx(FS, rel=1e-3)
    assert all(np.array_equal(mended[name], damaged.clean[name]) for name in mended)


def test_the_rate_behind_host_stamps_lies_in_its_interval():
    hits = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        host = np.cumsum(rng.normal(0.062, 0.006, 500))
        stamps = np.round(host[np.searchsorted(host, np.arange(4000) / 260.0)], 3)
        record = replace(Record.of({"theta": np.sin(np.arange(4000) / 30)}, fs=260.0), stamps=stamps)
        step = repair_clock(record).history[-1]
        low, high = step.arguments["fs_interval"]
        assert low < step.arguments["fs"] < high
        hits += low <= 260.0 <= high
    assert 50 <= hits <= 60  # of 60 intervals of 95 %, fewer than 50 hold the truth with probability 1e-4


@pytest.mark.parametrize("name", ["60.txt", "100.txt"])
def test_the_true_rate_of_the_pendulum(dataset, name):
    mended = repair_clock(read_pendulum(dataset("pendulum_bad_clock") / name))
    assert mended.fs == pytest.approx(260.0, rel=0.01)
    assert mended.check() == []
    # the ring-down itself is evenly paced on the new clock: its period from start to end is one number
    crossings = np.flatnonzero(np.diff(np.sign(mended["theta"][:2000] - np.mean(mended["theta"]))) > 0)
    periods = np.diff(mended.time[crossings])
    assert np.std(periods) < 0.02 * np.mean(periods)


def test_jitter_is_decided_by_the_record():
    rng = np.random.default_rng(1)
    instants = np.arange(3000) / 200 + rng.uniform(-1.5e-3, 1.5e-3, 3000)

    def wave(t):
        return np.sin(2 * np.pi * 5 * t)

    wrong = replace(Record.of({"x": wave(np.arange(3000) / 200)}, fs=200.0), stamps=instants)
    right = replace(Record.of({"x": wave(instants)}, fs=200.0), stamps=instants)
    relabelled, interpolated = repair_clock(wrong), repair_clock(right)
    assert np.array_equal(relabelled["x"], wrong["x"])
    assert relabelled.fs == pytest.approx(200.0, rel=1e-4)
    assert interpolated.history[-1].arguments["trust"] == "stamps"
    error = rms(interpolated["x"] - wave(interpolated.time))
    assert error < 0.1 * rms(right["x"] - wave(np.arange(3000) / 200))


def test_a_clock_with_gaps_is_not_relabelled():
    (damaged,) = (each for each in DAMAGED if each.name == "gap in sine, noise")
    with pytest.raises(RecordError, match="use fill_gaps"):
        repair_clock(damaged.record)
    (held_clock,) = (each for each in DAMAGED if each.name == "clock in sine, noise")
    with pytest.raises(RecordError, match="use repair_clock"):
        fill_gaps(held_clock.record)


@pytest.mark.parametrize(("lost", "cure"), [(3, "with fill_gaps(record)."), (50, "and fill_missing(record).")])
def test_a_gap_is_mended_by_what_is_said_of_it(lost: int, cure: str) -> None:
    """Of a long one half of the cure was said, and what was left had no numbers."""
    kept = np.delete(np.arange(2000), np.arange(700, 700 + lost))
    sampled = Record.of({"x": np.sin(0.02 * kept)}, fs=1000.0)
    record = Record(sampled.samples, sampled.channels, 1000.0, stamps=kept / 1000)
    (fault,) = record.check()
    assert str(fault).endswith(cure)
    filled = fill_gaps(record) if lost < 10 else fill_missing(fill_gaps(record))
    assert filled.check() == []


def test_lost_samples_of_the_seal_rig(dataset):
    record = read_seal(dataset("rubber_seal") / "O-ring_1bar.csv")
    filled = fill_gaps(record)
    assert filled.fs == pytest.approx(98.9, rel=2e-3)
    assert filled.duration == pytest.approx(record.stamps[-1] - record.stamps[0], abs=0.02)
    assert {fault.kind for fault in filled.check()} == {"missing"}
    whole = fill_missing(filled)
    assert whole.check() == []
    assert [step.action for step in whole.history[-2:]] == ["fill_gaps", "fill_missing"]


# ---- nothing in a clean record


@pytest.mark.parametrize("name", [name for name, record in clean_records().items() if record.stamps is None])
def test_a_clean_record_stays_as_it_is(name):
    record = clean_records()[name]
    (channel,) = record
    for mended in (
        repair_clock(record),
        fill_gaps(record),
        fill_missing(record),
        remove_spikes(record),
        remove_drift(record, channel),
        resample(record, record.fs),
    ):
        assert np.array_equal(mended[channel], record[channel])
        assert (mended.fs, mended.start) == (record.fs, record.start)
        assert len(mended.history) == len(record.history) + 1


@pytest.mark.parametrize("name", ["sine, noise", "sticking, LVDT steps", "dry decay to rest", "square wave, load cell"])
def test_tops_that_were_not_cut_stay(name):
    record = clean_records()[name]
    (channel,) = record
    kept = restore_clipped(record, channel)
    assert np.array_equal(kept[channel], record[channel])
    assert kept.history[-1].outcome == "no sample was clipped"


def test_the_record_given_is_not_touched():
    (damaged,) = (each for each in DAMAGED if each.name == "missing in sine")
    before = damaged.record["x"].copy()
    fill_missing(damaged.record)
    assert np.array_equal(damaged.record["x"], before, equal_nan=True)


# ---- resampling


@pytest.mark.parametrize("fs", [400.0, 937.3, 2500.0])
def test_a_band_limited_signal_survives_another_rate(fs):
    def wave(t):
        return np.sin(2 * np.pi * 31.7 * t + 1) + 0.3 * np.cos(2 * np.pi * 120 * t)

    record = Record.of({"x": wave(np.arange(4000) / FS)}, fs=FS, start=2.0)
    fresh = resample(record, fs)
    inside = slice(int(0.1 * fs), -int(0.1 * fs))
    assert fresh.start == record.start
    assert np.max(np.abs(fresh["x"] - wave(fresh.time - 2.0))[inside]) < 2e-4


def test_what_the_lower_rate_can_not_hold_is_filtered_off():
    record = Record.of({"a": np.sin(2 * np.pi * 330 * np.arange(4000) / FS)}, fs=FS)
    slow = resample(record, 500.0)
    assert rms(slow["a"][50:-50]) < 1e-4


def test_band_limited_interpolation_at_the_samples_gives_the_samples():
    values = np.random.default_rng(0).normal(size=300)
    assert np.allclose(band_limited(values, np.arange(300.0)), values, atol=1e-12)


def test_an_oscillation_goes_on_over_lost_samples():
    wave = np.sin(0.21 * np.arange(2000)) * np.exp(-np.arange(2000) / 900)
    lost = np.zeros(2000, dtype=bool)
    lost[700:760] = True
    assert np.max(np.abs(bridge(np.where(lost, 0.0, wave), lost) - wave)) < 1e-4


# ---- refusals


def test_refusals_say_what_to_do():
    record = Record.of({"x": np.arange(100.0)}, fs=FS)
    with pytest.raises(RecordError, match="choose one of them"):
        repair_clock(record, trust="luck")
    with pytest.raises(RecordError, match="pass fs= in Hz"):
        resample(record, -3.0)
    with pytest.raises(RecordError, match="use 'rebuild' or 'mark'"):
        restore_clipped(record, "x", method="magic")
    with pytest.raises(RecordError, match="leave the channel out"):
        fill_missing(Record.of({"x": np.full(100, np.nan)}, fs=FS))
    still = replace(record, stamps=np.zeros(100))
    with pytest.raises(RecordError, match="pass fs= when reading"):
        repair_clock(still)


def test_many_scattered_losses_are_bridged_in_their_time():
    rng = np.random.default_rng(4)
    rows = np.arange(300_000)
    wave = np.sin(0.05 * rows) + 0.3 * np.sin(0.131 * rows)
    lost = np.zeros(len(rows), dtype=bool)
    lost[rng.choice(len(rows), 600, replace=False)] = True
    begun = time.process_time()
    filled = bridge(np.where(lost, np.nan, wave), lost)
    assert time.process_time() - begun < 2.0  # as one problem of all rows it took several times that
    assert np.max(np.abs(filled - wave)) < 1e-3


def test_a_channel_that_was_filtered_does_not_claim_its_old_noise():
    rows = np.arange(4000)
    record = Record.of({"x": np.sin(rows / 30)}, fs=250.0).with_details("x", noise=1e-3)
    dropped = replace(record.rows(0, 3999), stamps=np.delete(rows, 1000) / 250)
    assert resample(record, 100.0).channels["x"].noise is None
    assert fill_gaps(dropped).channels["x"].noise is None
    assert remove_drift(record, "x").channels["x"].noise == 1e-3


def test_a_repair_drops_what_was_derived_from_the_old_samples():
    x = np.sin(np.arange(2000) / 30) + 1e-3 * np.arange(2000)
    x[700] = 9.0
    made = friction_force(Record.of({"x": x, "load": x}, fs=250.0), mass=1.0, stiffness=10.0)
    mended = remove_spikes(made, "x")
    assert set(mended) == {"x", "load"}
    assert mended.history[-1].outcome.endswith("derived from what was mended: a, friction, friction_sd, v")
    assert set(remove_spikes(made, "load")) == set(made)
    assert set(remove_drift(made, "x")) == {"x", "load"}
