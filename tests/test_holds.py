"""Stick and slip onsets by all sensors together, against the simulated rig's own events."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import stickslip as ss
from rigs import CASES, RIG, SETTLED, measured, motion, told
from stickslip.cycle.sticks import StickEvent, Sticks
from stickslip.errors import EstimateError

NEAR = 3e-3  # s: an onset that is further from every true one is false
ENDS = 0.03  # s at the record's ends that do not count


def found(frequency: float, method: str = "fusion", rough: float = 0.0, seed: int = 7) -> Sticks:
    record, _ = measured(frequency, rough, seed=seed)
    return ss.find_sticks(ss.friction_force(told(record), method=method, **RIG))


def onsets(events: tuple[StickEvent, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(time, sd) of each onset of a hold, and of each of a slip: a micro-slip is both, at its end and its begin."""
    sticks, slips = [], []
    for event in events:
        begin, end = (event.time, event.time_sd), (event.time + event.duration, event.duration_sd)
        if event.kind == "microslip":
            slips.append(begin)
            sticks.append(end)
        elif event.kind in ("stick", "microstick"):
            sticks.append(begin)
        else:
            slips.append(begin)
    return np.array(sticks), np.array(slips)


def true_onsets(frequency: float, rough: float) -> tuple[np.ndarray, np.ndarray]:
    events = [(event.time - SETTLED, event.kind) for event in motion(frequency, rough).events]
    inside = [(time, kind) for time, kind in events if ENDS < time < 1.0 - ENDS]
    return (
        np.array([time for time, kind in inside if "stick" in kind]),
        np.array([time for time, kind in inside if kind == "slip"]),
    )


def compared(ours: np.ndarray, true: np.ndarray) -> tuple[int, int, np.ndarray, np.ndarray]:
    """How many true onsets are missed, how many of ours are false, the errors, and the errors over their sd."""
    ours = ours[(ours[:, 0] > ENDS) & (ours[:, 0] < 1.0 - ENDS)]
    apart = ours[:, :1] - true
    hits = np.abs(apart).min(axis=0) < NEAR
    nearest = np.abs(apart).argmin(axis=0)[hits]
    errors = apart[nearest, np.flatnonzero(hits)]
    false = int(np.sum(np.abs(apart).min(axis=1) > NEAR))
    return int(np.sum(~hits)), false, errors, errors / ours[nearest, 1]


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("rough", [0.0, 0.03])
@pytest.mark.parametrize("frequency", list(CASES))
def test_all_onsets_are_found_and_none_is_false(frequency: float, rough: float) -> None:
    ours, true = onsets(found(frequency, rough=rough).events), true_onsets(frequency, rough)
    assert len(true[0]) > 10
    for which, limit in ((0, 0.02e-3 if rough == 0 else 0.06e-3), (1, 0.3e-3)):
        missed, false, errors, _ = compared(ours[which], true[which])
        assert (missed, false) == (0, 0)
        assert rms(errors) < limit


def test_onsets_are_as_sure_as_they_say() -> None:
    """Deviations over their stated sd, from three draws of the noise: one, within what so few can tell."""
    ratios = [[], []]
    for seed in (1, 2, 3):
        ours, true = onsets(found(2.5, seed=seed).events), true_onsets(2.5, 0.0)
        for which in (0, 1):
            ratios[which] += list(compared(ours[which], true[which])[3])
    assert len(ratios[0]) > 40
    for ratio in ratios:
        assert 0.5 < rms(np.array(ratio)) < 1.4
        assert np.mean(np.abs(ratio) < 2) > 0.9


@pytest.mark.parametrize("frequency", [2.5, 11.1])
def test_motion_sensors_alone_find_them_less_surely(frequency: float) -> None:
    answer = found(frequency, "motion")
    ours, true = onsets(answer.events), true_onsets(frequency, 0.0)
    for which, limit in ((0, 0.2e-3), (1, 0.4e-3)):
        missed, false, errors, ratios = compared(ours[which], true[which])
        assert (missed, false) == (0, 0)
        assert rms(errors) < limit
        assert rms(ratios) < 1.8
    assert any("without a load cell" in said for said in answer.lost)


def test_two_microslips_in_each_stick() -> None:
    answer = found(2.5)
    assert answer.kind == "double stick-slip"
    assert answer.microslips is not None
    assert answer.microslips.value == 2.0
    durations = [event.duration for event in answer.events if event.kind == "microslip"]
    assert np.allclose(np.reshape(durations, (-1, 2)), [4.84e-3, 4.98e-3], atol=0.15e-3)  # by the simulation
    assert answer.share.value == pytest.approx((7.93 + 18.94 + 16.28) / 200, abs=0.001)
    assert answer.per_cycle.value == 2


@pytest.mark.parametrize("frequency", [2.5, 8.7])
def test_the_stuck_share_is_counted_as_the_truth_is(frequency: float) -> None:
    record = told(measured(frequency, seconds=3.0)[0])
    answer = ss.find_sticks(ss.friction_force(record, method="fusion", **RIG))
    assert answer.share.value == pytest.approx(record.truth["stuck share of the time"], abs=0.002)


def test_sticks_and_slips_fill_the_record() -> None:
    events = [event for event in found(2.5).events if event.kind != "microslip"]
    assert [event.kind for event in events[:4]] == ["slip", "stick", "slip", "stick"]
    assert all(np.isclose(a.time + a.duration, b.time) for a, b in pairwise(events))
    assert not events[0].whole


def test_a_reversal_is_a_short_hold_and_no_stick() -> None:
    answer = found(8.7)
    assert answer.kind == "sliding"
    assert answer.per_cycle.value == 0
    assert answer.microslips is None
    short = [event.duration for event in answer.events if event.kind == "microstick"]
    assert np.mean(short) == pytest.approx(3.68e-3, abs=0.05e-3)


def test_without_the_friction_of_all_sensors_it_says_what_is_lost() -> None:
    record = told(measured(2.5)[0])
    plain = ss.find_sticks(record)
    assert plain.method == "speed"
    assert "micro-slips not at all" in plain.lost[0]
    fused = ss.friction_force(record, method="fusion", **RIG)
    assert ss.find_sticks(fused, method="speed").method == "speed"
    assert "moving base" in ss.find_sticks(fused, contact="base").lost[0]
    fast, rate = told(measured(8.7)[0]), 500
    coarse = ss.Record.of({name: fast[name][:: 4000 // rate] for name in fast}, fs=rate)
    slow = ss.find_sticks(ss.friction_force(coarse, method="fusion", **RIG))
    assert "shorter than four samples at 500 Hz" in slow.lost[0]
    coarse = ss.Record.of({name: record[name][:: 4000 // rate] for name in record}, fs=rate)
    slow = ss.find_sticks(ss.friction_force(coarse, method="fusion", **RIG))
    assert any("shorter ones are missed" in said for said in slow.lost)
    with pytest.raises(EstimateError, match="fusion, speed"):
        ss.find_sticks(record, method="magic")


def test_by_speed_the_stated_deviation_holds_the_true_onset() -> None:
    plain = ss.find_sticks(told(measured(2.5)[0]), method="speed")
    sticks = [event for event in plain.events if event.kind == "stick" and event.whole]
    begins = np.arange(0.02357, 1.0, 0.2)  # of the macroscopic sticks, by the simulation
    ends = begins + 0.05297
    assert len(sticks) >= 4
    for event in sticks:
        assert np.abs(begins - event.time).min() < 3 * event.time_sd
        assert np.abs(ends - event.time - event.duration).min() < 3 * event.duration_sd


def test_a_sensor_whose_zero_is_off_changes_no_event() -> None:
    record = told(measured(2.5)[0])
    off = record.with_channel("x", record["x"] + 0.1e-3, unit="m").with_details("x", delay=record.channels["x"].delay)
    right, wrong = (ss.find_sticks(ss.friction_force(each, method="motion", **RIG)).events for each in (record, off))
    assert [each.kind for each in wrong] == [each.kind for each in right]
    assert [each.time for each in wrong] == pytest.approx([each.time for each in right], abs=1e-6)
