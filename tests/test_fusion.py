"""Friction by all sensors together, on a rig whose mounts ring, whose cell forgets and whose LVDTs come late."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import stickslip as ss
from rigs import CASES, RIG, SETTLED, measured, motion, told
from stickslip.errors import EstimateError
from stickslip.signals.kalman import Motion, Seen, smooth_motion


def error(record: ss.Record, truth: NDArray[np.float64], method: str) -> tuple[float, float]:
    """Root mean square of the error [N], and the share of samples within two deviations; without the ends."""
    found = ss.friction_force(record, method=method, **RIG)
    inside = slice(200, -200)
    true = truth[round(found.start * 4000) :][: len(found)][inside]
    off = np.abs(found["friction"][inside] - true)
    return float(np.sqrt(np.mean(off**2))), float(np.mean(off < 2 * found["friction_sd"][inside]))


@pytest.mark.parametrize("rough", [0.0, 0.03])
def test_all_sensors_together_find_the_friction_and_its_band(rough: float) -> None:
    errors = [error(told(measured(f, rough)[0]), measured(f, rough)[1], "fusion") for f in CASES]
    assert max(rms for rms, _ in errors) < 0.012
    assert 0.93 < np.mean([share for _, share in errors]) < 0.97
    assert all(0.9 < share < 0.99 for _, share in errors)


def test_motion_sensors_alone_come_near() -> None:
    errors = [error(told(measured(f)[0]), measured(f)[1], "motion") for f in CASES]
    assert max(rms for rms, _ in errors) < 0.026
    assert 0.93 < np.mean([share for _, share in errors]) < 0.97


@pytest.mark.parametrize("frequency", list(CASES))
def test_the_velocity_is_as_sure_as_it_says(frequency: float) -> None:
    record, _ = measured(frequency)
    found = ss.friction_force(told(record), method="fusion", **RIG)
    true = motion(frequency).sample(SETTLED + found.time[200:-200], ("v",))[0][0]
    share = np.mean(np.abs(found["v"][200:-200] - true) < 2 * found["v_sd"][200:-200])
    assert 0.87 < share < 0.98  # one second: the error in the base's motion is common to many samples


@pytest.mark.parametrize(("channel", "limit"), [("load", 1.0), ("load", 0.7), ("load", 0.2), ("a", 0.5)])
def test_a_sensor_at_the_end_of_its_range_is_left_out_there(channel: str, limit: float) -> None:
    rig = ss.Rig().having(channel, limit=limit)
    record = told(rig.measure(motion(2.5), fs=4000, rng=7, start=SETTLED))
    assert error(record, measured(2.5)[1], "fusion")[0] < 0.026
    said = ss.friction_force(record, method="fusion", **RIG).history[-1].outcome
    assert f"{channel} is at the end of its range" in said


def test_gaps_of_one_sensor_are_filled_by_the_others() -> None:
    record, truth = measured(2.5)
    load = np.array(record["load"])
    load[1000:1400] = np.nan
    gappy = ss.Record.of({**{n: record[n] for n in record}, "load": load}, fs=4000)
    assert error(told(gappy), truth, "fusion")[0] < 0.012
    said = ss.friction_force(told(gappy), method="fusion", **RIG).history[-1].outcome
    assert "load is missing in 400 of" in said


@pytest.mark.parametrize("frequency", list(CASES))
def test_sensors_a_little_wrong_do_little_harm(frequency: float) -> None:
    assert error(told(measured(frequency)[0], wrong=True), measured(frequency)[1], "fusion")[0] < 0.02


@pytest.mark.parametrize("frequency", list(CASES))
def test_the_cell_alone_is_deconvolved(frequency: float) -> None:
    record, truth = measured(frequency)
    assert error(told(record), truth, "load")[0] < 0.012


def test_sensors_without_noise_are_taken_at_their_word() -> None:
    drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    law = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    run = ss.simulate(ss.Oscillator(law=law, drive=drive, **RIG), cycles=5)
    record = ss.Rig.perfect().measure(run, fs=4000)
    found = ss.friction_force(record, method="fusion", **RIG)
    assert np.sqrt(np.mean((found["friction"] - record["load"]) ** 2)) < 1e-3


def test_the_five_point_average_leaves_the_mount_ringing() -> None:
    record, truth = measured(8.7)
    assert error(told(record), truth, "five-point")[0] > 0.1


def test_blocks_leave_no_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    record = told(measured(2.5)[0])
    whole = ss.friction_force(record, method="fusion", **RIG)
    monkeypatch.setattr("stickslip.balance.fusion.BLOCK", 1500)
    parts = ss.friction_force(record, method="fusion", **RIG)
    assert np.sqrt(np.mean((whole["friction"] - parts["friction"]) ** 2)) < 2e-3
    assert np.abs(whole["friction"] - parts["friction"]).max() < 0.1


def test_what_it_lacks_is_said() -> None:
    record = measured(2.5)[0]
    few = ss.Record.of({"x": record["x"], "z": record["z"]}, fs=4000)
    assert "without a load cell" in ss.friction_force(few, method="load", **RIG).history[-1].outcome
    with pytest.raises(EstimateError, match="fusion"):
        ss.friction_force(few, method="magic", **RIG)
    assert "no mounts stated" in ss.friction_force(few, method="motion", **RIG).history[-1].outcome


def test_the_smoother_is_the_least_squares_of_all_readings() -> None:
    """Against the dense normal equations of a small case, states and unknowns solved for at once."""
    rng = np.random.default_rng(1)
    size, count = 3, 12
    transition = np.eye(size) + 0.1 * rng.standard_normal((size, size))
    motion = Motion(
        transition[None],
        rng.standard_normal((1, size)),
        rng.standard_normal((2, size)),
        np.array([0.3, 0.5]),
        rng.standard_normal(size),
        np.array([1.0, 2.0, 3.0]),
        np.array([0.0, 0.4, 0.0]),
    )
    readings, inputs = rng.standard_normal((count, 2)), rng.standard_normal((count, size))
    readings[4, 1] = np.nan
    unknown = rng.uniform(0.1, 2.0, count)
    # everything is linear in (s_0, w_0 ... w_{n-2}) and in how the second state strays
    free = size + 2 * (count - 1)
    effect, known = np.zeros((count, size, free)), np.zeros((count, size))
    effect[0, :, :size] = np.eye(size)
    for t in range(count - 1):
        effect[t + 1] = transition @ effect[t]
        effect[t + 1][:, size + t] += motion.spread[0]
        effect[t + 1][1, size + count - 1 + t] += 1.0
        known[t + 1] = transition @ known[t] + inputs[t]
    prior = np.diag(1 / np.concatenate([motion.doubt, unknown[:-1], np.full(count - 1, 0.4)]))
    mean = np.concatenate([motion.start, np.zeros(2 * (count - 1))])
    seen = [(t, k) for t in range(count) for k in range(2) if np.isfinite(readings[t, k])]
    rows = np.array([motion.readings[k] @ effect[t] for t, k in seen])
    target = np.array([readings[t, k] - motion.readings[k] @ known[t] for t, k in seen])
    weight = np.diag([1 / motion.noise[k] for _, k in seen])
    covariance = np.linalg.inv(prior + rows.T @ weight @ rows)
    best = covariance @ (prior @ mean + rows.T @ weight @ target)
    smoothed = smooth_motion(
        motion, Seen(readings, inputs, np.zeros(count, dtype=np.intp)), unknown=unknown, forms=np.eye(size)
    )
    for t in range(count):
        assert np.allclose(smoothed.values[:, t], effect[t] @ best + known[t], atol=1e-9)
        assert np.allclose(smoothed.variance[:, t], np.diag(effect[t] @ covariance @ effect[t].T), atol=1e-9)
    assert np.allclose(unknown[:-1] * smoothed.score[:-1], best[size : size + count - 1], atol=1e-9)


def test_turns_held_within_a_sensors_step_are_no_end_of_its_range() -> None:
    run = ss.simulate(
        ss.Oscillator(law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(0.65e-3, frequency=2.5), **RIG), cycles=8
    )
    record = ss.Rig().having("x", white=1e-8, lag=0.0).measure(run, fs=4000, rng=1, start=1.0)
    assert "end of its range" not in ss.friction_force(record, method="fusion", **RIG).history[-1].outcome
