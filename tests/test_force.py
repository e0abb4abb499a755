"""The friction force, against an exact stick-slip motion and a real rig's published friction."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import loadmat

from motions import stick_slip
from stickslip.balance.force import friction_force
from stickslip.errors import EstimateError, ModelError, RecordError, StickslipError
from stickslip.record.record import Record

RIG = {"mass": 3.0, "stiffness": 1200.0, "damping": 0.7, "damper": "base"}
UNITS = {"x": "m", "z": "m", "v": "m/s", "a": "m/s^2", "force": "N"}


def noisy_record(motion, fs, sd, names=("x", "z"), seed=0):
    rng = np.random.default_rng(seed)
    arrays = {name: motion[name] + sd * np.std(motion[name]) * rng.standard_normal(motion["t"].size) for name in names}
    return Record.of(arrays, fs=fs, units={name: UNITS[name] for name in names})


def away_from_jumps(motion, fs, seconds):
    jumps = np.abs(np.diff(motion["f"], prepend=motion["f"][0])) > 0.1
    return np.convolve(jumps, np.ones(2 * round(seconds * fs) + 1), mode="same") < 0.5


@pytest.fixture(scope="module")
def motion():
    return stick_slip(1000.0, 10)


def test_the_motion_itself_obeys_its_equation(motion):
    w = 2 * np.pi
    base = 1.8e-3 * w * np.cos(w * motion["t"])
    force = 3 * motion["a"] + 0.7 * (motion["v"] - base) + 1200 * (motion["x"] - motion["z"]) + motion["f"]
    assert np.abs(force).max() < 1e-12
    assert 0.3 < np.mean(motion["v"] == 0) < 0.7


@pytest.mark.parametrize("fs", [250.0, 1000.0])
@pytest.mark.parametrize("sd", [1e-4, 1e-3, 5e-3])
def test_smoother_errs_less_than_five_points_and_knows_its_error(fs, sd):
    motion = stick_slip(fs, 10)
    record = noisy_record(motion, fs, sd)
    ours = friction_force(record, **RIG)
    theirs = friction_force(record, **RIG, method="five-point")
    error = ours["friction"] - motion["f"]
    assert np.std(error) < 0.1
    assert np.std(error) < np.std(theirs["friction"] - motion["f"])
    far = away_from_jumps(motion, fs, 1 / ours.history[-1].arguments["bandwidth"])
    assert far.mean() > 0.2
    assert np.mean(np.abs(error[far]) < 2 * ours["friction_sd"][far]) > 0.93
    assert np.median(ours["friction_sd"][far]) < 1.5 * np.std(error[far])  # and does not claim too much either


def test_five_point_uncertainty_is_that_of_the_noise(motion):
    made = friction_force(noisy_record(motion, 1000.0, 1e-3), **RIG, method="five-point")
    far = away_from_jumps(motion, 1000.0, 0.02)
    error = (made["friction"] - motion["f"])[far]
    assert np.mean(np.abs(error) < 2 * made["friction_sd"][far]) == pytest.approx(0.954, abs=0.015)


def test_uncertainty_is_the_spread_of_repeats(motion):
    repeats = [friction_force(noisy_record(motion, 1000.0, 1e-3, seed=s), **RIG, bandwidth=30.0) for s in range(60)]
    spread = np.std([made["friction"] for made in repeats], axis=0)
    stated = np.median([made["friction_sd"] for made in repeats], axis=0)
    quiet = away_from_jumps(motion, 1000.0, 0.08)  # where smoothing does not bias
    assert np.median(stated[quiet] / spread[quiet]) == pytest.approx(1, abs=0.15)
    for row in (0, -1):  # the ends are less certain, and it is stated by how much
        assert stated[row] == pytest.approx(spread[row], rel=0.5)
        assert stated[row] > 2 * np.median(stated[quiet])


def test_measured_acceleration_and_velocity_are_used_as_they_are(motion):
    clean = noisy_record(motion, 1000.0, 0.0, names=("x", "z", "v", "a"))
    made = friction_force(clean, mass="3 kg", stiffness="1.2 N/mm", damping=0.0)
    w = 2 * np.pi
    damper = 0.7 * (motion["v"] - 1.8e-3 * w * np.cos(w * motion["t"]))
    assert np.abs(made["friction"] - damper - motion["f"]).max() < 1e-9
    assert "v and a as measured" in made.history[-1].outcome
    noisy = noisy_record(motion, 1000.0, 1e-3, names=("x", "z", "a"))
    made = friction_force(noisy, **RIG)
    error = made["friction"] - motion["f"]
    assert np.mean(np.abs(error) < 2 * made["friction_sd"]) == pytest.approx(0.954, abs=0.02)
    assert made.channels["v"].source == "friction_force"
    assert made["a"] is not None
    assert np.array_equal(made["a"], noisy["a"])


def test_the_forces_of_damper_base_and_hand_are_told_apart():
    fs, w = 1000.0, 9.0
    t = np.arange(4000) / fs
    x, z, push = 1e-3 * np.sin(w * t), 2e-3 * np.cos(w * t), 0.3 * np.sin(5 * t)
    v, a, dz = w * 1e-3 * np.cos(w * t), -(w**2) * x, -w * 2e-3 * np.sin(w * t)
    inside = slice(400, -400)
    fixed = Record.of({"x": x, "force": push}, fs=fs, units=UNITS)
    moved = Record.of({"x": x, "z": z}, fs=fs, units=UNITS)
    rig = {"mass": 2.0, "stiffness": 100.0, "damping": 5.0, "bandwidth": 80.0}
    balances = [
        (friction_force(fixed, **rig), -100 * x - 5 * v - 2 * a + push),
        (friction_force(moved, **rig), 100 * (z - x) - 5 * v - 2 * a),
        (friction_force(moved, **rig, damper="base"), 100 * (z - x) - 5 * (v - dz) - 2 * a),
    ]
    for made, exact in balances:
        assert np.allclose(made["friction"][inside], exact[inside], atol=2e-5)
    assert "the base is taken to be fixed" in balances[0][0].history[-1].outcome
    assert "the applied force is added" in balances[0][0].history[-1].outcome


@pytest.mark.parametrize("delay", [1.2585e-3, -0.6e-3, 5e-3])
def test_stated_delays_are_taken_out(delay):
    fs, w = 2000.0, 60.0
    t = np.arange(4000) / fs
    x, late = 1e-3 * np.sin(w * t), -1e-3 * w**2 * np.sin(w * (t - delay))
    record = Record.of({"x": x, "a": late}, fs=fs, units=UNITS).with_details("a", delay=delay, noise=1e-6)
    made = friction_force(record, mass=1.0, stiffness=w**2)
    assert np.abs(made["friction"][100:-100]).max() < 2e-5  # in balance at every moment
    assert made.channels["a"].delay == 0
    assert any("delays" in step.arguments for step in made.history)
    assert len(made) == len(record) - int(np.ceil(abs(delay) * fs))
    assert made.start == pytest.approx(max(0.0, np.ceil(-delay * fs) / fs))


def test_a_second_balance_takes_nothing_from_the_first(motion):
    record = noisy_record(motion, 1000.0, 1e-3)
    first = friction_force(record, **RIG)
    second = friction_force(first, **RIG)
    assert np.array_equal(second["friction"], first["friction"])
    assert "as measured" not in second.history[-1].outcome
    other = friction_force(first, **RIG, method="five-point")
    assert np.array_equal(other["friction"], friction_force(record, **RIG, method="five-point")["friction"])
    shifted = first.with_channel("x", 2 * first["x"], unit="m")  # v and a of the first balance are stale now
    direct = friction_force(record.with_channel("x", 2 * record["x"], unit="m"), **RIG)
    assert np.array_equal(friction_force(shifted, **RIG)["friction"], direct["friction"])


def test_a_torque_is_no_part_of_a_balance_of_forces(motion):
    turned = Record.of({"x": motion["x"], "force": motion["f"]}, fs=1000.0, units={"x": "m", "force": "N m"})
    with pytest.raises(RecordError, match="force is in N m"):
        friction_force(turned, **RIG)


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"mass": 0.0}, ModelError),
        ({"mass": -1.0}, ModelError),
        ({"stiffness": -5}, ModelError),
        ({"mass": float("nan")}, StickslipError),
        ({"mass": "3 mm"}, StickslipError),
        ({"damper": "wall"}, ModelError),
        ({"contact": "wall"}, ModelError),
        ({"method": "spline"}, EstimateError),
        ({"bandwidth": 1e4}, EstimateError),
        ({"bandwidth": "x"}, RecordError),
        ({"bandwidth": [3]}, RecordError),
    ],
)
def test_wrong_constants_are_refused_in_a_sentence(wrong, error):
    record = Record.of({"x": np.sin(np.arange(200.0))}, fs=100.0, units=UNITS)
    with pytest.raises(error) as caught:
        friction_force(record, **{"mass": 1.0, "stiffness": 10.0, **wrong})
    assert str(caught.value).count("\n") == 0


def test_records_that_can_not_answer_are_refused():
    rig = {"mass": 1.0, "stiffness": 10.0}
    wave = np.sin(np.arange(200.0))
    broken = np.where(np.arange(200) == 17, np.nan, wave)
    with pytest.raises(RecordError, match="x is missing"):
        friction_force(Record.of({"z": wave}, fs=100.0, units=UNITS), **rig)
    with pytest.raises(RecordError, match="row 17"):
        friction_force(Record.of({"x": wave, "z": broken}, fs=100.0, units=UNITS), **rig)
    with pytest.raises(RecordError, match="10 samples"):
        friction_force(Record.of({"x": wave[:10]}, fs=100.0, units=UNITS), **rig)
    late = Record.of({"x": wave}, fs=100.0, units=UNITS).with_details("x", delay=1.9)
    with pytest.raises(RecordError, match="delays"):
        friction_force(late, **rig)


@pytest.mark.parametrize(("load", "published", "stuck"), [("250g", 0.682, 0.52), ("450g", 1.318, 0.56)])
@pytest.mark.parametrize("method", ["smoother", "five-point"])
def test_a_frame_on_a_shaken_base_slides_against_its_published_friction(dataset, load, published, stuck, method):
    folder = dataset("frame_base_excited")
    x, z = loadmat(folder / f"s_b_{load}_x.mat")["x"].ravel(), loadmat(folder / f"s_b_{load}_y.mat")["y"].ravel()
    record = Record.of({"x": x, "z": z}, fs=250.0, units={"x": "mm", "z": "mm"})
    made = friction_force(record, mass=3.0799, stiffness=1191, damping=0.669, damper="base", method=method)
    v, f = made["v"], made["friction"]
    levels = [np.mean(f[v > 0.008]), -np.mean(f[v < -0.008])]
    assert np.mean(levels) == pytest.approx(published, rel=0.04)
    assert np.mean(np.abs(v) < 0.002) == pytest.approx(stuck, abs=0.05)
    # A clean step: level on either side, and from side to side while the mass rests.
    for side, level in ((v > 0.008, levels[0]), (v < -0.008, -levels[1])):
        assert np.std(f[side]) < 0.1 * sum(levels)
        assert np.all(np.abs(np.quantile(f[side], [0.02, 0.98]) - level) < 0.2 * sum(levels))
    between = (f > -0.5 * levels[1]) & (f < 0.5 * levels[0])
    assert np.mean(between & (np.abs(v) > 0.004)) < 0.01
    # The stated uncertainty is the scatter from cycle to cycle (1 Hz, 250 samples) at one phase of the sliding.
    speed, force, sd = (made[name][250:2250].reshape(8, 250) for name in ("v", "friction", "friction_sd"))
    sliding = (np.abs(speed) > 0.008).all(axis=0)
    scatter = np.sqrt(force[:, sliding].var(axis=0, ddof=1).mean())
    assert 0.5 < scatter / np.sqrt(np.mean(sd[:, sliding] ** 2)) < 2
    assert np.median(sd[np.abs(speed) > 0.008]) > 2 * np.median(sd[np.abs(speed) < 0.0005])  # noise comes with motion


def test_a_million_samples_take_a_moment():
    import time

    t = np.arange(1_000_000) / 4000
    noise = np.random.default_rng(0).standard_normal((2, t.size)) * 1e-6
    record = Record.of(
        {"x": 1e-3 * np.sin(9 * t) + noise[0], "z": 1e-3 * np.sin(8 * t) + noise[1]}, fs=4000.0, units=UNITS
    )
    started = time.process_time()
    friction_force(record, **RIG)
    assert time.process_time() - started < 5
