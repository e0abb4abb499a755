"""The regression of a force: simulated truth with correlated noise, invariances, and two rigs' records."""

import numpy as np
import pytest
from scipy.signal import lfilter

from stickslip.cycle.regression import regress_friction
from stickslip.errors import EstimateError, RecordError
from stickslip.files.read import read_record
from stickslip.record.record import Record

FS = 1000.0
TRUTH = {"inertia": 3.0, "viscous": 5.0, "coulomb": 2.0, "offset": -0.4}


def motion(fs=FS, seconds=12.0):
    t = np.arange(round(seconds * fs)) / fs
    parts = [(0.05, 0.5, 0.0), (0.02, 1.3, 1.0), (0.004, 3.1, 2.0)]
    turns = [(size, 2 * np.pi * f, phase) for size, f, phase in parts]
    x = sum(size * np.sin(w * t + p) for size, w, p in turns)
    v = sum(size * w * np.cos(w * t + p) for size, w, p in turns)
    a = -sum(size * w**2 * np.sin(w * t + p) for size, w, p in turns)
    return x, v, a


def record_of(*, fs=FS, noise=0.3, rho=0.9, seed=0, forward=(5.0, 2.0), back=(5.0, 2.0), more=0.0, sensor=1e-7):
    x, v, a = motion(fs)
    rng = np.random.default_rng(seed)
    error = noise * np.sqrt(1 - rho**2) * lfilter([1], [1, -rho], rng.standard_normal(x.size + 500))[500:]
    dry = np.where(v > 0, forward[0] * v + forward[1], back[0] * v - back[1])
    force = TRUTH["inertia"] * a + dry + TRUTH["offset"] + more * x + error
    return Record.of({"x": x + sensor * rng.standard_normal(x.size), "force": force}, fs=fs)


def test_truth_without_noise():
    regression = regress_friction(record_of(noise=0.0, sensor=0.0))
    for name, value in TRUTH.items():
        assert getattr(regression, name).value == pytest.approx(value, rel=2e-3), name
    assert regression.residual < 0.01
    assert regression.status == "ok"
    assert regression.explained == pytest.approx(regression.measured, abs=0.2)
    assert [regression.inertia.unit, regression.viscous.unit, regression.coulomb.unit, regression.offset.unit] == [
        "kg",
        "N s/m",
        "N",
        "N",
    ]


@pytest.mark.parametrize(("trials", "least"), [(15, 0.78), pytest.param(40, 0.85, marks=pytest.mark.soak)])
@pytest.mark.parametrize("rho", [0.0, 0.9, 0.99])
def test_intervals_hold_the_truth(rho, trials, least):
    held = []
    for seed in range(trials):
        regression = regress_friction(record_of(rho=rho, seed=seed))
        held.append([getattr(regression, name).includes(value) for name, value in TRUTH.items()])
    assert np.all(np.mean(held, axis=0) >= least)  # 3 binomial standard deviations below 0.95


def test_a_stated_delay_is_taken_out():
    record, rows = record_of(noise=0.0), 25
    late = Record.of({"x": record["x"][rows:], "force": record["force"][:-rows]}, fs=FS)
    assert abs(regress_friction(late).inertia.value - 3) > 0.3
    regression = regress_friction(late.with_details("force", delay=rows / FS))
    for name, value in TRUTH.items():
        assert getattr(regression, name).value == pytest.approx(value, rel=0.01), name


@pytest.mark.parametrize(("position", "unit"), [("x", "N m"), ("theta", "N")])
def test_units_that_do_not_belong_together_are_refused(position, unit):
    record = record_of()
    with pytest.raises(RecordError, match=f"force is in {unit}, the motion in"):
        regress_friction(Record.of({position: record["x"], "force": record["force"]}, fs=FS, units={"force": unit}))


def test_directions_may_differ():
    record = record_of(forward=(4.0, 1.5), back=(6.0, 2.5), noise=0.05)
    regression = regress_friction(record, symmetric=False)
    # the constant force is shared: forward Coulomb friction gains it, backward loses it
    assert regression.viscous_forward.value == pytest.approx(4.0, abs=0.2)
    assert regression.viscous_back.value == pytest.approx(6.0, abs=0.2)
    assert regression.coulomb_forward.value == pytest.approx(1.5 - 0.4, abs=0.05)
    assert regression.coulomb_back.value == pytest.approx(2.5 + 0.4, abs=0.05)
    assert regression.coulomb.value == pytest.approx(2.0, abs=0.05)
    assert regression.offset is None
    assert regression.residual < regress_friction(record).residual


def test_stiffness_is_a_term_if_asked_for():
    record = record_of(more=40.0, noise=0.05)
    regression = regress_friction(record, stiffness=True)
    assert regression.stiffness.value == pytest.approx(40.0, rel=0.02)
    assert regression.stiffness.unit == "N/m"
    assert regression.inertia.value == pytest.approx(3.0, rel=0.01)
    assert regress_friction(record).residual > 2 * regression.residual


def test_sign_scale_and_sampling():
    record = record_of(noise=0.05)
    plain = regress_friction(record)
    mirrored = regress_friction(Record.of({"x": -record["x"], "force": -record["force"]}, fs=FS))
    assert mirrored.coulomb.value == pytest.approx(plain.coulomb.value, rel=1e-6)
    assert mirrored.offset.value == pytest.approx(-plain.offset.value, rel=1e-6)
    scaled = regress_friction(Record.of({"x": 1e3 * record["x"], "force": 1e-2 * record["force"]}, fs=FS))
    assert scaled.inertia.value == pytest.approx(1e-5 * plain.inertia.value, rel=1e-4)
    assert scaled.inertia.sd == pytest.approx(1e-5 * plain.inertia.sd, rel=1e-2)
    assert scaled.residual == pytest.approx(plain.residual, rel=1e-3)
    for fs in (200.0, 5000.0):
        other = regress_friction(record_of(fs=fs, noise=0.05, rho=0.0))
        for name, value in TRUTH.items():
            assert getattr(other, name).value == pytest.approx(value, rel=0.05), (fs, name)


def test_measured_velocity_and_acceleration_are_used():
    x, v, a = motion()
    rng = np.random.default_rng(1)
    force = record_of(noise=0.05)["force"]
    accelerometer = a + 0.05 * rng.standard_normal(a.size)
    coarse = np.round(x / 2e-3) * 2e-3  # a displacement far too coarse to be differentiated twice
    regression = regress_friction(Record.of({"x": coarse, "v": v, "a": accelerometer, "force": force}, fs=FS))
    for name, value in TRUTH.items():
        assert getattr(regression, name).value == pytest.approx(value, rel=0.02), name
    alone = regress_friction(Record.of({"v": v, "force": force}, fs=FS))
    assert alone.inertia.value == pytest.approx(3.0, rel=0.01)


def test_an_angle_gives_a_moment_of_inertia():
    record = record_of(noise=0.05)
    turning = Record.of({"theta": record["x"], "force": record["force"]}, fs=FS, units={"force": "N m"})
    regression = regress_friction(turning)
    assert regression.inertia.unit == "kg m^2"
    assert regression.inertia.value == pytest.approx(3.0, rel=0.01)


def test_noise_in_the_acceleration_is_said():
    regression = regress_friction(record_of(noise=0.05, sensor=3e-4), bandwidth=25.0)
    assert "noise in the acceleration lowers the inertia" in regression.status
    assert regression.inertia.value < 2.8
    assert regression.inertia.status == regression.status


def test_choice_of_the_signal():
    record = record_of(noise=0.05)
    both = Record.of({"x": record["x"], "load": record["force"], "friction": 0 * record["force"] + 1}, fs=FS)
    assert regress_friction(both).signal == "load"
    with pytest.raises(EstimateError, match="channel friction never changes"):
        regress_friction(both, signal="friction")
    with pytest.raises(EstimateError, match="signal = 'x'"):
        regress_friction(record, signal="x")


def test_bad_input_ends_in_a_sentence():
    record = record_of()
    x, force = np.array(record["x"]), np.array(record["force"])
    with pytest.raises(RecordError, match="channel force is missing"):
        regress_friction(Record.of({"x": x}, fs=FS))
    with pytest.raises(RecordError, match="channel x is missing"):
        regress_friction(Record.of({"force": force}, fs=FS))
    with pytest.raises(EstimateError, match="channel x never changes"):
        regress_friction(Record.of({"x": 0 * x, "force": force}, fs=FS))
    with pytest.raises(EstimateError, match="channel force never changes"):
        regress_friction(Record.of({"x": x, "force": 0 * force}, fs=FS))
    with pytest.raises(RecordError, match="10 samples"):
        regress_friction(record.rows(0, 10))
    with pytest.raises(RecordError, match="not numbers"):
        regress_friction(Record.of({"x": x, "force": np.where(x > 0.06, np.nan, force)}, fs=FS))
    t = np.arange(x.size) / FS
    with pytest.raises(EstimateError, match="does not reverse"):
        regress_friction(Record.of({"x": t + 0.02 * np.sin(9 * t), "force": force}, fs=FS))
    with pytest.raises(EstimateError, match="bandwidth = 900"):
        regress_friction(record, bandwidth=900.0)
    one_tone = Record.of({"x": np.sin(6 * t), "force": np.cos(6 * t)}, fs=FS)  # displacement and acceleration alike
    with pytest.raises(EstimateError, match="condition number"):
        regress_friction(one_tone, stiffness=True)


def emps(dataset):
    return read_record(
        dataset("emps") / "DATA_EMPS.mat", channels={"x": "qm [m]", "force": "vir * 35.1507 [N]"}, fs=1000.0
    )


def test_emps_symmetric(dataset):
    regression = regress_friction(emps(dataset))
    assert regression.inertia.value == pytest.approx(95.1089, rel=0.01)
    assert regression.viscous.value == pytest.approx(203.5034, rel=0.01)
    assert regression.coulomb.value == pytest.approx(20.3935, rel=0.01)
    assert regression.offset.value == pytest.approx(-3.1648, rel=0.02)
    assert regression.residual <= 0.042
    for name, value in (("inertia", 95.1089), ("viscous", 203.5034), ("coulomb", 20.3935), ("offset", -3.1648)):
        assert getattr(regression, name).includes(value)


def test_emps_asymmetric(dataset):
    regression = regress_friction(emps(dataset), symmetric=False)
    assert regression.viscous_forward.value == pytest.approx(166.706, rel=0.02)
    assert regression.viscous_back.value == pytest.approx(240.424, rel=0.02)
    assert regression.coulomb_forward.value == pytest.approx(20.144, rel=0.02)
    assert regression.coulomb_back.value == pytest.approx(20.628, rel=0.02)
    assert regression.residual <= 0.0320  # published: 0.0311


def test_rack_of_two_instruments(dataset):
    from stickslip.signals.interpolate import synchronise

    folder = dataset("rack_two_daq")
    force = read_record(
        folder / "24072020-sym_br_r0_ni.csv", channels={"force": "-200 * (F + 0.115) [N]", "x": "x / 55.4 [m]"}
    )
    speed = read_record(folder / "24072020-sym_br_r0_mr.csv", channels={"v": "`Servo motor speed` * -20/60/1000 [m/s]"})
    together = synchronise(force, speed, on=("x", "v"))
    regression = regress_friction(together)
    assert regression.inertia.value == pytest.approx(61.4, rel=0.02)
    assert regression.inertia.includes(61.4)
    assert "independent samples" in regression.status  # three strokes of the rack in two seconds
