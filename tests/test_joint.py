"""Joints of an integrator of our own, and a real axis: friction, load, gravity, breakaway, and what can not be told."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import joints
import stickslip as ss
from stickslip.answers import analyze_joint, axis_record
from stickslip.cli.program import main
from stickslip.cycle import joint_backlash, joint_breakaway, regress_joint, regress_joint_logs
from stickslip.cycle.joint_fit import SURELY, is_late
from stickslip.errors import EstimateError, ModelError, RecordError
from stickslip.estimate import kinds, stands
from stickslip.figures.contact import plot_joint
from stickslip.units import parse_unit

TRUTH = {"inertia": 0.02, "forward": 0.07, "back": 0.05, "load": 0.15, "viscous": 0.03, "sine": 0.5, "cosine": -0.2}


def motion(seconds=30.0, fs=200.0):
    t = np.arange(round(seconds * fs)) / fs
    q = 1.2 * np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t) + 0.3
    v = 2 * np.pi * (0.24 * np.cos(2 * np.pi * 0.2 * t) + 0.28 * np.cos(2 * np.pi * 0.7 * t))
    a = -((2 * np.pi) ** 2) * (0.048 * np.sin(2 * np.pi * 0.2 * t) + 0.196 * np.sin(2 * np.pi * 0.7 * t))
    return q, v, a


def torque(q, v, a, **changes):
    true = {**TRUTH, **changes}
    weight = true["sine"] * np.sin(q) + true["cosine"] * np.cos(q)
    level = np.where(v > 0, true["forward"], true["back"]) + true["load"] * np.abs(weight)
    return true["inertia"] * a + true["viscous"] * v + np.sign(v) * level + weight


def log(noise=0.0, seed=0, **changes):
    q, v, a = motion()
    force = torque(q, v, a, **changes) + noise * np.random.default_rng(seed).standard_normal(q.size)
    return ss.Record.of({"theta": q, "force": force}, fs=200.0, units={"force": "N m"})


def test_truth_without_noise():
    regression = regress_joint(log())
    for name, value in TRUTH.items():
        assert getattr(regression, name).value == pytest.approx(value, rel=2e-3), name
    weight = np.abs(regression.weight(log()["theta"]))
    assert regression.carried == pytest.approx(weight.mean(), rel=0.1)
    assert regression.level.value == pytest.approx(0.06 + 0.15 * regression.carried, rel=1e-3)
    assert regression.residual < 1e-3
    columns = ("level", "viscous", "load", "inertia", "sine")
    assert [getattr(regression, name).unit for name in columns] == ["N m", "N m s/rad", "1", "kg m^2", "N m"]


@pytest.mark.parametrize("kind", ["torque", "controller", "play"])
@pytest.mark.parametrize(("draws", "least"), [(8, 0.71), pytest.param(250, 0.91, marks=pytest.mark.soak)])
def test_intervals_hold_on_joints_of_another_integrator(kind, draws, least):
    """Of 250 each 93 to 97 % held; `least` is three binomial deviations below 95 %."""
    held = []
    for seed in range(draws):
        joint = joints.drawn(seed, torque=kind != "controller", play=kind == "play")
        try:
            regression = regress_joint(joint.record, **({"kp": joint.kp} if kind == "controller" else {}))
        except EstimateError:
            continue
        true = joint.truth
        pairs = [
            (regression.level, joint.level(regression.time)),
            (regression.load, true["load"]),
            (regression.viscous, true["viscous"]),
        ]
        held += [each.includes(value) for each, value in pairs if each is not None and stands(each.status)]
    assert len(held) > 2 * draws
    assert np.mean(held) >= least


@pytest.mark.parametrize(("draws", "least"), [(8, 0.71), pytest.param(250, 0.91, marks=pytest.mark.soak)])
def test_friction_over_the_temperature_is_told_or_left_alone(draws, least):
    """Of joints that warm up, with friction that falls or does not; `least` is three binomial deviations below 95 %."""
    held, claimed = [], []
    for seed in range(draws):
        joint = joints.drawn(seed, torque=True, warming=True)
        try:
            regression = regress_joint(joint.record)
        except EstimateError:
            continue
        if regression.warming is None:
            continue
        for name in ("warming", "thinning"):
            estimate, true = getattr(regression, name), joint.truth[name]
            held.append(estimate.includes(true))
            if not true:
                claimed.append(abs(estimate.value) > SURELY * estimate.sd)
    assert np.mean(held) > least
    assert np.mean(claimed) <= 0.01


def warmed(seed=0, *, falls=(0.0, 0.0), begins=25.0, ends=45.0, name="temperature", unit="degC"):
    """A log whose joint warms up, its friction told at 35 degrees."""
    q, v, a = motion()
    hot = np.linspace(begins, ends, q.size)
    force = torque(q, v, a) + (falls[0] * np.sign(v) + falls[1] * v) * (hot - 35.0)
    force += 0.01 * np.random.default_rng(seed).standard_normal(q.size)
    samples = {"theta": q, "force": force, name: np.round(hot, 1)}
    return ss.Record.of(samples, fs=200.0, units={"force": "N m", **({name: unit} if unit else {})})


def test_friction_over_a_temperature_in_degrees_celsius():
    log = warmed(falls=(-0.001, -0.0004))
    assert log.channels["temperature"].unit == "K"
    regression = regress_joint(log)
    assert regression.temperature == pytest.approx(308.15, abs=0.5)
    assert regression.warming.unit == "N m/K"
    assert regression.warming.includes(-0.001)
    assert regression.thinning.includes(-0.0004)
    assert regression.forward.includes(0.07)
    assert regression.viscous.includes(0.03)
    story = "\n".join(line for line in map(str, ss.summary(analyze_joint(log)).headline))
    assert "With the temperature its Coulomb friction changes by -0.00097 N m/K" in story
    steady = "\n".join(map(str, ss.summary(analyze_joint(warmed())).headline))
    assert "No change of its Coulomb friction with the temperature is told" in steady


def test_a_temperature_that_hardly_changes_tells_nothing():
    assert regress_joint(warmed(begins=35.0, ends=35.1)).warming is None
    assert regress_joint(warmed(begins=35.0, ends=35.0)).warming is None


def test_a_cold_log_and_a_warm_one_tell_the_temperature_together():
    cold, warm = (warmed(seed, falls=(-0.001, -0.0004), begins=at, ends=at) for seed, at in enumerate((20.0, 50.0)))
    together = regress_joint_logs([cold, warm])
    assert together.warming.includes(-0.001)
    assert together.warming.sd < 1e-4
    assert together.thinning.includes(-0.0004)


def test_a_robots_temperature_is_in_degrees_celsius_unless_it_says():
    q, v, a = motion()
    samples = {"position": q, "effort": torque(q, v, a), "present_temperature": np.linspace(30, 40, q.size)}
    written = axis_record(ss.Record.of(samples, fs=200.0, units={"position": "rad", "effort": "N m"}))
    assert written["temperature"][0] == pytest.approx(303.15)
    two = axis_record(
        ss.Record.of(
            {**samples, "motor_temperature": np.linspace(30, 50, q.size)},
            fs=200.0,
            units={"position": "rad", "effort": "N m"},
        )
    )
    assert "temperature" not in two


def test_constants_that_are_stated_go_through():
    q, v, a = motion()
    force = torque(q, v, a)
    known = regress_joint(log(noise=0.01), inertia="0.02 ± 0.001 kg m^2")
    assert (known.inertia.value, known.inertia.sd) == (0.02, 0.001)
    assert known.level.includes(0.06 + 0.15 * known.carried)
    by_current = ss.Record.of({"theta": q, "current": force / 0.8}, fs=200.0)
    regression = regress_joint(by_current, torque_constant="0.8 ± 0.04 N m/A")
    assert regression.source == "current"
    assert regression.forward.value == pytest.approx(0.07, rel=2e-3)
    assert regression.level.sd == pytest.approx(0.05 * regression.level.value, rel=0.05)
    reference = q + force / 18.0
    record = ss.Record.of({"theta": q, "reference": reference}, fs=200.0, units={"reference": "rad"})
    controlled = regress_joint(record, kp="18 N m/rad", kd=0.0)
    assert controlled.source == "reference"
    assert controlled.damping is None
    assert controlled.forward.value == pytest.approx(0.07, rel=0.02)


@pytest.mark.parametrize(("draws", "least"), [(8, 0.71), pytest.param(30, 0.86, marks=pytest.mark.soak)])
def test_a_load_part_is_not_made_up(draws, least):
    """Without one its interval holds zero, as often as it should."""
    loads = [regress_joint(log(noise=0.02, seed=seed, load=0.0)).load for seed in range(draws)]
    assert np.mean([load.interval[0] <= 0 for load in loads]) >= least


def test_what_the_log_can_not_tell_is_said_with_the_motion_that_would():
    t = np.arange(6000) / 200.0
    q = 0.02 * np.sin(2 * np.pi * 0.5 * t)
    v, a = np.gradient(q, 1 / 200), np.gradient(np.gradient(q, 1 / 200), 1 / 200)
    small = ss.Record.of({"theta": q, "force": torque(q, v, a)}, fs=200.0, units={"force": "N m"})
    regression = regress_joint(small)
    assert regression.left_out
    assert "turn farther" in " ".join(regression.left_out)
    assert "turn farther" in regression.level.status, "gravity acts: that none is felt is not so"
    one_way = ss.Record.of({"theta": t, "force": np.sin(t)}, fs=200.0, units={"force": "N m"})
    with pytest.raises(EstimateError, match="back and forth"):
        regress_joint(one_way)
    with pytest.raises(RecordError, match="torque_constant"):
        regress_joint(ss.Record.of({"theta": motion()[0], "current": motion()[1]}, fs=200.0))
    with pytest.raises(RecordError, match="force is missing"):
        regress_joint(ss.Record.of({"theta": motion()[0]}, fs=200.0))
    with pytest.raises(ModelError, match="kp"):
        regress_joint(log(), kp=-1.0)
    with pytest.raises(ModelError, match="N m/A"):
        regress_joint(log(), torque_constant="3 kg")
    with pytest.raises(RecordError, match="force is in N,"):
        regress_joint(ss.Record.of({"theta": motion()[0], "force": motion()[1]}, fs=200.0))


def test_breakaway_of_a_joint_that_creeps_away():
    """Ten times it is pulled at 7 N m/s until it moves: static friction is 1.4 times the sliding one."""
    t, rng = np.arange(0, 40 * 20_000 + 1) / 20_000, np.random.default_rng(4)
    within, number = t % 4, np.floor(t / 4)
    way = np.where(number % 2 == 0, 1.0, -1.0)
    moved = 0.01 * np.minimum(within, 2.0) + 0.3 * np.clip(within - 2.2, 0, 1.6) / 1.6
    reference = np.where(way > 0, 0.0, 0.32) + way * moved
    p = np.array([0.7, 3.4, 3.5, 0.0, 1.2, 0.0, 0.0, 700.0, 20.0, 1.4, 0.02])
    angle, motor = joints.march(p, reference, np.gradient(reference, t), 20, 20, 1000.0)
    size = 2 * np.pi / 2**18
    written = {"theta": np.round(angle / size) * size, "force": motor + 0.02 * rng.standard_normal(len(motor))}
    joint = analyze_joint(ss.Record.of(written, fs=1000.0, units={"force": "N m"}), gravity=False)
    assert joint.joint.level.value == pytest.approx(3.45, rel=0.02)
    assert joint.breakaway.ratio.value == pytest.approx(1.4, rel=0.05)
    assert joint.breakaway.ratio.includes(1.4)
    assert joint.breakaway.static.value == pytest.approx(1.4 * 3.45, rel=0.05)


def test_breakaway_is_not_told_of_a_fast_joint():
    with pytest.raises(EstimateError, match="rests tell"):
        joint_breakaway(log(), joint=regress_joint(log()))


def with_play(size, seed=0, gravity=0.0):
    """A joint of an integrator of our own, 12 bit on either side, 60 turns of the motor in one of the link."""
    t = np.arange(20 * 500 * 40 + 1) / 20_000
    reference = 0.6 * np.sin(2 * np.pi * 0.3 * t) + 0.3 * np.sin(2 * np.pi * 0.9 * t)
    p = np.array([0.03, 0.05, 0.06, 0.1, 0.03, gravity, 0.0, 30.0, 1.0, 1.2, 0.02])
    slack, way = np.array([size, 0.5, 0.6]), np.gradient(reference, t)
    turned, angle, motor = joints.march_slack(p, slack, reference, way, 40, 20, 500.0)
    count, noise = 2 * np.pi / 2**12, 0.01 * np.random.default_rng(seed).standard_normal(len(motor))
    written = {
        "joint_position": np.round(angle / count) * count,
        "motor_position": np.round(60 * turned / count) * count,
    }
    units = {"joint_position": "rad", "motor_position": "rad", "effort": "N m"}
    return ss.Record.of({**written, "effort": motor + noise}, fs=500.0, units=units)


def test_without_play_two_masses_are_one():
    t = np.arange(5 * 500 * 40 + 1) / 20_000
    reference = 0.6 * np.sin(2 * np.pi * 0.9 * t)
    p = np.array([0.03, 0.05, 0.06, 0.1, 0.03, 0.3, 0.1, 30.0, 1.0, 1.0, 0.02])
    one = joints.march(p, reference, np.gradient(reference, t), 40, 20, 500.0)
    two = joints.march_slack(p, np.array([0.0, 0.5, 0.6]), reference, np.gradient(reference, t), 40, 20, 500.0)
    for alone, geared in zip(one, (two[0], two[2]), strict=True):
        assert geared == pytest.approx(alone, abs=1e-9)


@pytest.mark.parametrize("size", [0.0, 0.002, 0.01])
def test_play_between_two_encoders_is_told_or_what_would_be_felt(size):
    backlash = analyze_joint(with_play(size)).backlash
    assert backlash.backlash.includes(size)
    assert backlash.claimed == (size > 0)
    assert backlash.felt < 0.001
    assert backlash.ratio == pytest.approx(60, rel=1e-3)


def test_teeth_that_gravity_keeps_on_one_side_tell_no_play():
    log = axis_record(with_play(0.01, gravity=0.0))
    joint = regress_joint(log)
    heavy = replace(joint, cosine=replace(joint.cosine, value=5.0, interval=(4.9, 5.1), sd=0.05))
    with pytest.raises(EstimateError, match="surely pushed"):
        joint_backlash(log, joint=heavy)


def two_masses(share, ratio=60.0, ahead=0.01):
    """A motor that goes ahead of its link to and fro, and has a share of inertia and viscous friction."""
    t = np.arange(6000) / 200
    q, v, a = motion()
    w = 2 * np.pi * 0.7
    lead = ahead * np.sin(w * t), ahead * w * np.cos(w * t), -ahead * w**2 * np.sin(w * t)
    turned = q + lead[0], v + share * lead[1], a + share * lead[2]
    force = torque(q, v, a) + TRUTH["viscous"] * (turned[1] - v) + TRUTH["inertia"] * (turned[2] - a)
    written = {"theta": q, "motor": ratio * turned[0] - 3.0, "force": force}
    return ss.Record.of(written, fs=200.0, units={"motor": "rad", "force": "N m"})


def test_motor_and_link_move_apart():
    """Where each has half of the inertia the numbers are exact; where one has a fifth, that is in the intervals."""
    regression = regress_joint(two_masses(0.5))
    for name, value in TRUTH.items():
        assert getattr(regression, name).value == pytest.approx(value, rel=2e-3), name
    for share in (0.2, 0.8):
        apart = regress_joint(two_masses(share))
        assert apart.inertia.value != pytest.approx(TRUTH["inertia"], rel=3e-3)
        assert all(getattr(apart, name).includes(TRUTH[name]) for name in ("inertia", "viscous", "load"))
    stiff = regress_joint(two_masses(0.0, ahead=1e-9))
    assert stiff.inertia.sd < 0.1 * apart.inertia.sd


def test_a_motor_that_turns_with_something_else_is_left_alone():
    """An encoder that begins anew with each turn, say."""
    log = two_masses(0.0)
    wrapped = log.with_channel("motor", log["motor"] % (2 * np.pi), unit="rad")
    alone = ss.Record.of({name: log[name] for name in ("theta", "force")}, fs=200.0, units={"force": "N m"})
    assert regress_joint(wrapped).inertia.interval == regress_joint(alone).inertia.interval
    told = analyze_joint(wrapped)
    assert told.backlash is None
    assert "do not turn together" in " ".join(told.notes)


def test_the_motors_encoder_alone_is_the_position():
    log = with_play(0.0)
    record = ss.Record.of({name: log[name] for name in ("motor_position", "effort")}, fs=500.0)
    with pytest.raises(RecordError, match="runs from -39"):  # of many turns: no angle in rad, unless that is stated
        axis_record(record)
    stated = ss.Record.of(dict(record.samples), fs=500.0, units={"motor_position": "rad"})
    assert list(axis_record(stated)) == ["theta", "force"]


def emps(dataset, **channels):
    named = {"x": "qm [m]", "reference": "qg [m]", "force": "vir * 35.1507 [N]", **channels}
    return ss.read_record(dataset("emps") / "DATA_EMPS.mat", channels=named, fs=1000.0)


def test_emps(dataset):
    """Published of all samples: 95.1089 kg; of each direction 166.706 and 240.424 N s/m, 20.144 and 20.628 N.

    While it surely slides it rubs against 1 N more, and less by the speed: friction is no straight line near rest.
    """
    regression = regress_joint(emps(dataset))
    assert regression.inertia.value == pytest.approx(95.1089, rel=0.01)
    assert regression.level.value == pytest.approx(20.386, rel=0.06)
    assert regression.viscous_forward.value == pytest.approx(166.706, rel=0.09)
    assert regression.viscous_back.value == pytest.approx(240.424, rel=0.05)
    assert regression.sine is None
    assert {"bent", "placed"} <= kinds(regression.level.status)  # and its ball screw is not the same along the way
    assert regression.level.unit == "N"
    assert regression.residual < 0.02  # published: 0.0311


def test_emps_is_predicted_inside_its_loop(dataset):
    """The controller makes ``gtau kv (kp (qg - qm) - v)``: a spring to the reference and a damper to the ground."""
    regression = regress_joint(emps(dataset))
    law = ss.laws.Geared(
        regression.forward.value, regression.back.value, regression.viscous_forward.value, regression.viscous_back.value
    )
    damping = 35.1507 * 243.45
    loop = ss.Oscillator(mass=regression.inertia.value, stiffness=160.18 * damping, damping=damping, law=law)
    channels = {"x": "qm [m]", "z": "qg [m]"}
    record = ss.read_record(dataset("emps") / "DATA_EMPS.mat", channels=channels, fs=1000.0)
    (part,) = ss.answers.predict(record, loop, plain=False).parts
    assert 100 - part.follows["x"] < 0.01  # per cent of its spread; with the published numbers as much


@pytest.mark.parametrize(
    ("columns", "axis", "expected"),
    [
        (("position", "velocity", "effort"), None, ["theta", "force"]),
        (("shoulder/position", "elbow/position", "elbow/effort"), "elbow", ["theta", "force"]),
        (("observation.state.0", "observation.state.1", "action.0", "action.1"), "1", ["theta", "reference"]),
        (("qpos", "qvel", "ctrl", "actuator_force"), None, ["theta", "reference", "force"]),
        (
            ("present_position", "goal_position", "present_current", "goal_current", "present_load"),
            None,
            ["theta", "reference", "current"],
        ),
    ],
)
def test_columns_are_known_by_the_names_that_tools_write(tmp_path, columns, axis, expected):
    path = tmp_path / "log.csv"
    rows = [",".join(["time", *columns]), *(",".join([str(i / 100)] + [str(i % 7)] * len(columns)) for i in range(50))]
    path.write_text("\n".join(rows))
    record = axis_record(ss.read_record(path), axis=axis)
    assert list(record) == expected
    assert record.channels["theta"].unit == "rad"
    assert record.channels["theta"].assumed


def test_several_axes_are_asked_for_one():
    record = ss.Record.of({"a_position": [0.0, 1.0], "b_position": [0.0, 1.0]}, fs=10.0)
    with pytest.raises(RecordError, match="--axis a"):
        axis_record(record)
    with pytest.raises(RecordError, match="fits 0 of a, b"):
        axis_record(record, axis="c")
    with pytest.raises(RecordError, match="no column is called a position"):
        axis_record(ss.Record.of({"speed": [0.0, 1.0]}, fs=10.0))


@pytest.mark.parametrize(
    ("text", "scale", "si"),
    [
        ("N m/A", 1.0, "N m/A"),
        ("mNm/A", 1e-3, "N m/A"),
        ("Nm s/rad", 1.0, "N m s/rad"),
        ("g cm^2", 1e-7, "kg m^2"),
        ("rev/min", np.pi / 30, "rad/s"),
        ("oz in", 7.0615518e-3, "N m"),
        ("kgf cm", 0.0980665, "N m"),
    ],
)
def test_units_of_what_turns(text, scale, si):
    unit = parse_unit(text)
    assert unit.scale == pytest.approx(scale, rel=1e-7)
    assert unit.si == si


@pytest.fixture
def written(tmp_path):
    joint = joints.drawn(5, torque=True)
    path = tmp_path / "shoulder.csv"
    names = {"theta": "position [rad]", "reference": "goal_position [rad]", "force": "effort [N m]"}
    columns = [joint.record.time, *(joint.record[name] for name in names)]
    header = ",".join(["time [s]", *names.values()])
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
    return joint, path


@pytest.mark.figures
def test_command(written, tmp_path, monkeypatch):
    joint, path = written
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke(main, ["joint", str(path)])
    assert run.exit_code == 0, run.output
    assert "The joint slides against" in run.output
    folder = Path("shoulder-joint")
    assert (folder / "report.html").is_file()
    data = json.loads((folder / "results.json").read_text())
    levels = {each["name"]: each for each in data["estimates"]}
    assert levels["Coulomb friction forward"]["interval"][0] <= joint.truth["forward"]
    assert (
        levels["friction per load"]["interval"][0] <= joint.truth["load"] <= levels["friction per load"]["interval"][1]
    )
    level = levels["sliding friction"]["value"]
    assert f'type="hinge" frictionloss="{level!r}"' in (folder / "joint/mujoco.xml").read_text()
    assert f'friction="{level!r}"' in (folder / "joint/dynamics.urdf").read_text()
    assert "Rotational.Components.BearingFriction" in (folder / "joint/friction.mo").read_text()


def test_command_by_the_gains_alone(written, tmp_path, monkeypatch):
    joint, path = written
    monkeypatch.chdir(tmp_path)
    channels = ["--channels", "theta=position", "--channels", "reference=goal_position"]
    run = CliRunner().invoke(main, ["joint", str(path), "--json", "--kp", f"{joint.truth['kp']} N m/rad", *channels])
    assert run.exit_code == 0, run.output
    data = json.loads(run.stdout)
    assert data["source"] == "reference"
    assert not Path("shoulder-joint").exists()
    lacking = CliRunner().invoke(main, ["joint", str(path), "--json", *channels])
    assert lacking.exit_code == 1
    assert "--kp" in lacking.output


def test_the_motion_proposed_tells_what_the_log_did_not(written, tmp_path, monkeypatch):
    """A joint that swung too little is followed on the motion that is proposed for a wider range."""
    q = 0.9 * np.sin(2 * np.pi * 0.4 * np.arange(4000) / 200)
    motion = ss.cycle.telling_motion(ss.Record.of({"theta": q}, fs=200.0), fs=1000.0)
    reference = motion["reference"]
    assert np.abs(reference).max() <= 0.9
    assert np.abs(np.gradient(reference, 1e-3)).max() <= 2 * np.pi * 0.4 * 0.9
    fine = np.interp(np.arange(20 * (len(reference) - 1) + 1) / 20, np.arange(len(reference)), reference)
    p = np.array([0.03, 0.05, 0.06, 0.2, 0.03, 0.3, 0.1, 30.0, 1.0, 1.0, 0.02])
    angle, motor = joints.march(p, fine, np.gradient(fine, 5e-5), 20, 20, 1000.0)
    size = 2 * np.pi / 2**14
    followed = ss.Record.of(
        {"theta": np.round(angle / size) * size, "force": motor, "reference": reference[:-1]},
        fs=1000.0,
        units={"force": "N m", "reference": "rad"},
    )
    regression = regress_joint(followed)
    assert not regression.left_out
    for name, value in {"forward": 0.05, "back": 0.06, "load": 0.2, "viscous": 0.03, "inertia": 0.03}.items():
        assert getattr(regression, name).value == pytest.approx(value, rel=0.05), name
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke(main, ["joint", str(written[1]), "--json", "--propose", "next.csv"])
    assert run.exit_code == 0, run.output
    assert list(ss.read_record("next.csv")) == ["reference"]


def test_a_unit_that_nobody_stated_is_flagged():
    q, v, a = motion()
    record = ss.Record.of({"position": q, "effort": torque(q, v, a)}, fs=200.0)
    joint = analyze_joint(record)
    assert "nobody stated a unit" in joint.joint.level.status
    assert not stands(joint.joint.level.status)
    assert kinds(joint.joint.level.status) == {""}


@pytest.mark.parametrize(
    ("scale", "size", "remedy"),
    [
        (180 / np.pi, 0.0, "=deg"),
        (180 / np.pi, 360 / 4096, "=deg"),
        (4 / np.pi, 360 / 4096, "=deg"),
        (4096 / (2 * np.pi), 1.0, "/ 4096 [turn]"),
    ],
    ids=["degrees", "degrees of an encoder", "few of them", "counts"],
)
def test_an_angle_without_a_unit_that_is_not_in_rad_is_named(scale, size, remedy):
    q, v, a = motion()
    position = scale * q if not size else np.round(scale * q / size) * size
    with pytest.raises(RecordError, match=re.escape(remedy)):
        analyze_joint(ss.Record.of({"position": position, "effort": torque(q, v, a)}, fs=200.0))
    stated = ss.Record.of({"position": 4 * q, "effort": torque(q, v, a)}, fs=200.0, units={"position": "rad"})
    assert list(axis_record(stated)) == ["theta", "force"]


def test_an_encoder_in_rad_is_no_mistake():
    q, v, a = motion()
    size = 2 * np.pi / 4096
    log = ss.Record.of({"position": np.round(q / size) * size, "effort": torque(q, v, a)}, fs=200.0)
    assert analyze_joint(log).joint.forward.value == pytest.approx(0.07, rel=0.02)


def test_a_log_of_lerobot(tmp_path):
    """Parquet whose cells hold a number for each joint, at 30 Hz: positions, and actions as reference."""
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    q, v, a = motion(fs=30.0)
    reference = q + torque(q, v, a) / 18.0
    cells = {"observation.state": np.stack([0 * q, q], axis=1), "action": np.stack([0 * q, reference], axis=1)}
    lists = {name: pyarrow.array(list(values.astype(np.float32))) for name, values in cells.items()}
    path = tmp_path / "episode_000000.parquet"
    parquet.write_table(pyarrow.table({**lists, "timestamp": np.arange(len(q)) / 30.0}), path)
    record = axis_record(ss.read_record(path), axis="1")
    assert list(record) == ["theta", "reference"]
    assert record["theta"] == pytest.approx(q, abs=1e-6)
    regression = regress_joint(record, kp=18.0, kd=0.0)
    assert regression.forward.value == pytest.approx(0.07, rel=0.1)
    assert regression.load.value == pytest.approx(0.15, rel=0.1)


def test_cells_that_are_not_alike_are_refused_in_a_sentence(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    path = tmp_path / "ragged.parquet"
    parquet.write_table(pyarrow.table({"q": [[1.0, 2.0], [1.0]], "timestamp": [0.0, 0.1]}), path)
    with pytest.raises(ss.StickslipError, match=r"ragged\.parquet"):
        ss.read_record(path)


def test_a_joint_that_never_rests_is_not_told_to_stand_still() -> None:
    sticks = analyze_joint(log(noise=0.005)).sticks
    assert not stands(sticks.share.status)
    assert not stands(sticks.per_cycle.status)


def test_the_figure_draws_either_direction_by_its_own_friction() -> None:
    joint = regress_joint(log(noise=0.005, forward=0.12, back=0.03))
    _, back, forward, _ = plot_joint(joint).lines
    share = joint.load.value * joint.carried
    assert back.get_ydata()[0] == pytest.approx(-joint.back.value - share)
    assert forward.get_ydata()[0] == pytest.approx(joint.forward.value + share)


@pytest.mark.parametrize("seed", [70100, 70109, 70119])
def test_a_torque_that_comes_late_is_no_friction_of_the_load(seed: int) -> None:
    """Read as it was logged, its load part missed the truth by up to 9 deviations, and its viscous friction by 20."""
    joint = joints.drawn(seed, torque=True)
    record = joints.delayed(joint, 0.015)
    regression = regress_joint(record)
    assert is_late(regression.delay)
    assert regression.delay.value == pytest.approx(0.015, abs=1.5e-3)
    for name in ("load", "viscous", "inertia"):
        assert getattr(regression, name).includes(joint.truth[name])
    assert regression.level.includes(joint.level(regression.time))
    headline = ss.summary(analyze_joint(record)).headline
    assert any("later than the position" in sentence for sentence in headline)
    assert not is_late(regress_joint(record.with_details("force", delay=0.015)).delay)


@pytest.mark.parametrize(("seed", "late"), [(773097, 0.03), (773002, 0.003)])
def test_a_delay_is_told_where_no_load_part_settles_beside_it(seed: int, late: float) -> None:
    """None was told, and viscous friction stood 3 to 6 deviations off, as if the torque came in time."""
    joint = joints.drawn(seed, torque=True)
    found = regress_joint(joints.delayed(joint, late))
    assert found.delay is not None
    assert found.delay.includes(late)
    assert found.viscous.includes(joint.truth["viscous"])


def test_a_torque_that_comes_in_time_is_not_told_to_be_late() -> None:
    for seed in (70100, 70109, 70119):
        joint = joints.drawn(seed, torque=True)
        record = joints.delayed(joint, 0.0)
        regression = regress_joint(record)
        assert not is_late(regression.delay)
        assert abs(regression.load.value - joint.truth["load"]) < 4 * regression.load.sd
    controlled = ss.Record.of({name: joint.record[name] for name in ("theta", "reference")}, fs=joint.record.fs)
    assert regress_joint(controlled, kp=joint.kp).delay is None


def test_a_joint_without_dry_friction_is_told_what_would_be_felt() -> None:
    record = log(noise=0.005, forward=0.0, back=0.0, load=0.0)
    headline = " ".join(ss.summary(analyze_joint(record)).headline)
    assert re.match(r"No dry friction .*is felt; more than [\d.]+ µN m would be", headline)
