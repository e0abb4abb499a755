"""Sticks and slips: closed forms, reversals that are none, invariances, and a rig's record."""

import math
from itertools import pairwise

import numpy as np
import pytest

from stickslip import datasets
from stickslip.cycle.sticks import find_sticks
from stickslip.errors import EstimateError, RecordError, StickslipError
from stickslip.files.read import read_record
from stickslip.record.record import Record

FS, PEAK = 1000.0, 0.05


def record_of(v, *, fs=FS, noise=1e-6, seed=0, **more):
    x = np.cumsum(v) / fs + noise * np.random.default_rng(seed).standard_normal(len(v))
    return Record.of({"x": x, **more}, fs=fs)


def stick_slip(level, *, seconds=12.0, fs=FS):
    """Velocity that rests wherever the drive is below `level` of its peak: stuck 2 asin(level) / pi of the time."""
    drive = np.sin(2 * np.pi * np.arange(round(seconds * fs)) / fs)
    return PEAK / (1 - level) * np.maximum(np.abs(drive) - level, 0) * np.sign(drive)


@pytest.mark.parametrize("level", [0.2, 0.5, 0.8])
def test_share_by_closed_form(level):
    sticks = find_sticks(record_of(stick_slip(level)))
    truth = 2 * math.asin(level) / math.pi
    assert sticks.share.value == pytest.approx(truth, abs=0.03)  # within the threshold of 4 % of the peak speed
    assert sticks.share.interval[0] <= truth <= sticks.share.interval[1]
    assert 3.9 * sticks.share.sd == pytest.approx(np.diff(sticks.share.interval)[0], rel=0.01)  # no surer than that
    assert sticks.per_cycle.value == 2
    assert sticks.threshold == pytest.approx(0.04 * PEAK, rel=0.05)
    assert sticks.status == "ok"


def test_times_and_durations():
    sticks = find_sticks(record_of(stick_slip(0.5)))
    stops = [event for event in sticks.events if event.kind == "stick" and event.whole]
    edge = math.asin(0.5) / (2 * math.pi)  # stuck from k/2 - edge to k/2 + edge
    begins = np.array([event.time for event in stops])
    assert begins == pytest.approx(np.arange(1, len(stops) + 1) / 2 - edge, abs=0.01)
    assert np.array([event.duration for event in stops]) == pytest.approx(2 * edge, abs=0.015)
    kinds = [event.kind for event in sticks.events]
    assert all(a != b for a, b in pairwise(kinds))
    assert sum(event.duration for event in sticks.events) == pytest.approx(12.0)
    assert not sticks.events[0].whole
    assert not sticks.events[-1].whole


@pytest.mark.parametrize("noise", [1e-8, 1e-6, 2e-5])
@pytest.mark.parametrize("jump", [0.0, 0.5, 3.0])
def test_a_reversal_is_not_a_stick(noise, jump):
    """Pure sliding: zero speed is passed with an acceleration that jumps from 1 to 1 + jump at the reversal."""
    t = np.arange(12000) / FS
    phase = (2 * t) % 1.0  # half cycles of half a second
    # speed rises from 0 with slope (1 + jump), falls to 0 with slope 1: s = (1 + jump) p (1 - p) / (1 + jump p)
    speed = (1 + jump) * phase * (1 - phase) / (1 + jump * phase)
    v = PEAK * speed / speed.max() * np.where((2 * t) % 2 < 1, 1, -1)
    sticks = find_sticks(record_of(v, noise=noise))
    assert sticks.per_cycle.value == 0
    assert sticks.share.value == 0
    assert not [event for event in sticks.events[1:-1] if event.kind == "stick"]


def test_a_stop_without_reversal_counts():
    t = np.arange(12000) / FS
    v = PEAK * np.sin(2 * np.pi * t)
    v[(np.abs((t % 1) - 0.25) < 0.05)] = 0.0  # a rest of 0.1 s in the middle of every slip forward
    sticks = find_sticks(record_of(v))
    assert sticks.per_cycle.value == 1
    assert sticks.share.value == pytest.approx(0.1, abs=0.02)


def test_creep_within_a_stick_is_part_of_it():
    v = stick_slip(0.5)
    t = np.arange(v.size) / FS
    v = v + 0.07 * PEAK * np.exp(-(((t % 1.0) - 0.0) ** 2) / 0.0004)  # a slow movement early in every other stick
    sticks = find_sticks(record_of(v))
    assert sticks.per_cycle.value == 2
    assert sticks.share.value == pytest.approx(1 / 3, abs=0.04)


def test_threshold_follows_the_noise():
    quiet, noisy = (find_sticks(record_of(stick_slip(0.5), noise=noise)) for noise in (1e-6, 4e-4))
    assert "4 % of its peak, to pass over creep" in quiet.share.method
    assert "five deviations of its noise" in noisy.share.method
    assert noisy.threshold == pytest.approx(5 * noisy.noise)
    assert noisy.share.value == pytest.approx(1 / 3, abs=0.08)


def test_given_threshold_is_kept():
    sticks = find_sticks(record_of(stick_slip(0.5)), threshold=0.005)
    assert sticks.threshold == 0.005
    assert "given" in sticks.share.method
    within = find_sticks(record_of(stick_slip(0.5), noise=1e-5), threshold=1e-5)
    assert "within the velocity's noise" in within.status


def test_contact_on_the_base_sticks_while_carried():
    v = stick_slip(0.5)
    t = np.arange(v.size) / FS
    base = 0.02 * np.sin(2 * np.pi * t + 0.7)
    x = np.cumsum(v) / FS + base
    rng = np.random.default_rng(2)
    record = Record.of(
        {"x": x + 1e-6 * rng.standard_normal(x.size), "z": base + 1e-6 * rng.standard_normal(x.size)}, fs=FS
    )
    assert find_sticks(record, contact="base").share.value == pytest.approx(1 / 3, abs=0.03)
    assert find_sticks(record, contact="ground").share.value < 0.1


def test_a_stated_delay_is_taken_out():
    v, rows = stick_slip(0.5), 100
    base = 0.02 * np.sin(2 * np.pi * np.arange(v.size) / FS + 0.7)
    x = record_of(v, noise=0)["x"] + base
    late = Record.of({"x": x[rows:], "z": base[:-rows]}, fs=FS)
    assert find_sticks(late, contact="base").share.value < 0.2
    sticks = find_sticks(late.with_details("z", delay=rows / FS), contact="base")
    assert sticks.share.value == pytest.approx(1 / 3, abs=0.03)


def test_slider_pulled_one_way():
    t = np.arange(12000) / FS
    v = np.maximum(np.sin(2 * np.pi * t) - 0.5, 0)  # slips forward, never back, a third of the time
    sticks = find_sticks(record_of(v))
    assert sticks.share.value == pytest.approx(2 / 3, abs=0.05)
    assert sticks.per_cycle.value == 1
    assert "not periodic" in sticks.status


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_scale_does_not_matter(scale):
    plain = record_of(stick_slip(0.5))
    scaled = find_sticks(Record.of({"x": scale * plain["x"]}, fs=FS))
    assert scaled.share.value == pytest.approx(find_sticks(plain).share.value, abs=1e-4)


def test_sampling_does_not_matter():
    shares = [find_sticks(record_of(stick_slip(0.5, fs=fs), fs=fs)).share.value for fs in (200.0, 1000.0, 5000.0)]
    assert max(shares) - min(shares) < 0.02


def test_bad_input_ends_in_a_sentence():
    good = record_of(stick_slip(0.5))
    x = np.array(good["x"])
    with pytest.raises(RecordError, match="channel x is missing"):
        find_sticks(Record.of({"friction": x}, fs=FS))
    with pytest.raises(EstimateError, match="never changes"):
        find_sticks(Record.of({"x": 0 * x}, fs=FS))
    with pytest.raises(RecordError, match="10 samples"):
        find_sticks(good.rows(0, 10))
    with pytest.raises(RecordError, match="no number"):
        find_sticks(Record.of({"x": np.where(np.arange(x.size) == 7, np.nan, x)}, fs=FS))
    with pytest.raises(EstimateError, match="above its noise"):
        find_sticks(Record.of({"x": np.random.default_rng(0).standard_normal(x.size)}, fs=FS))
    with pytest.raises(EstimateError, match="no complete cycle"):
        find_sticks(Record.of({"x": 1e-3 * np.arange(x.size)}, fs=FS))
    for threshold in (-1.0, 0.0, 1.0, math.nan):
        with pytest.raises(StickslipError, match=r"threshold = |'nan'"):
            find_sticks(good, threshold=threshold)
    with pytest.raises(RecordError, match="'slow'"):
        find_sticks(good, threshold="slow")
    assert find_sticks(good, threshold="5 mm/s").threshold == 0.005
    with pytest.raises(EstimateError, match="three times as fast"):
        find_sticks(good, threshold=0.8 * PEAK)


@pytest.mark.parametrize(("weight", "share"), [("250g", 0.52), ("450g", 0.56)])
def test_frame_on_a_shaken_base(dataset, weight, share):
    folder = dataset("frame_base_excited")
    record = read_record(
        [folder / f"s_b_{weight}_x.mat", folder / f"s_b_{weight}_y.mat"], channels={"x": "x [mm]", "z": "y [mm]"}
    )
    sticks = find_sticks(record)
    assert sticks.share.value == pytest.approx(share, abs=0.05)
    assert sticks.per_cycle.value == 2
    assert sticks.per_cycle.interval == (2, 2)
    at_2_mm_s = find_sticks(record, threshold=0.002)  # how the reference was counted
    assert at_2_mm_s.share.value == pytest.approx(share, abs=0.01)


def test_demonstration_record_holds_its_truth():
    record = datasets.demo()
    sticks = find_sticks(record)
    truth = record.truth["stuck share of the time"]
    assert sticks.share.interval[0] <= truth <= sticks.share.interval[1]
    assert sticks.share.value == pytest.approx(truth, abs=0.06)
    assert sticks.per_cycle.value == record.truth["stops per cycle"]
