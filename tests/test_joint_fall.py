"""Friction of a joint that falls with the speed: told where the log shows it, by all curves that it allows."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import joints
import scripts
import stickslip as ss
from stickslip.answers import analyze_joint, joint_law
from stickslip.cli.program import main
from stickslip.cycle import regress_joint, regress_joint_logs
from stickslip.errors import EstimateError
from stickslip.estimate import kinds, stands
from stickslip.figures.contact import plot_joint
from stickslip.laws import LinearSlope, Stribeck
from stickslip.statistics import mixture


def log(
    static: float = 0.12, exponent: float = 2.0, speed: float = 0.4, seed: int = 0, noise: float = 0.01
) -> ss.Record:
    """A joint that slides against 0.06 N m when fast and `static` when slow, under a load that rubs too."""
    t = np.arange(6000) / 200
    q = 0.3 + 1.2 * np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    weight = 0.5 * np.sin(q) - 0.2 * np.cos(q)
    level = 0.06 + (static - 0.06) * np.exp(-((abs(v) / speed) ** exponent)) + 0.1 * abs(weight)
    torque = 0.02 * a + 0.03 * v + weight + np.sign(v) * level
    torque += noise * np.random.default_rng(seed).standard_normal(t.size)
    return ss.Record.of({"theta": q, "force": torque}, fs=200, units={"force": "N m"})


@pytest.mark.parametrize(("exponent", "speed"), [(2.0, 0.4), (1.0, 0.4), (2.0, 0.2)])
def test_a_fall_is_told_with_its_level_at_rest_and_its_speed(exponent: float, speed: float) -> None:
    """By a straight line it was 0.08 N m at vanishing speed, of 0.12 that there are."""
    joint = regress_joint(log(exponent=exponent, speed=speed))
    assert joint.static is not None
    assert joint.stribeck_speed is not None
    load = 0.1 * joint.carried
    truth = {"static": 0.12 + load, "level": 0.06 + load, "stribeck_speed": speed, "viscous": 0.03, "load": 0.1}
    for name, value in (truth | {"inertia": 0.02, "forward": 0.06, "back": 0.06}).items():
        told = getattr(joint, name)
        assert abs(told.value - value) < 3 * told.sd, name  # of 24 numbers one is beyond two deviations
    assert joint.static.value - joint.level.value > 4 * joint.static.sd or speed < 0.4
    assert (joint.static.unit, joint.stribeck_speed.unit) == ("N m", "rad/s")


def test_without_noise_the_curve_is_found() -> None:
    joint = regress_joint(log(noise=0.0))
    assert joint.static.value == pytest.approx(0.12 + 0.1 * joint.carried, rel=0.01)
    assert joint.stribeck_speed.value == pytest.approx(0.4, rel=0.02)
    assert joint.exponent == 2.0


def test_friction_that_rises_or_stays_falls_nowhere() -> None:
    for static in (0.03, 0.06):
        for seed in range(4):
            joint = regress_joint(log(static=static, seed=seed))
            assert joint.static is None
            assert isinstance(joint_law(joint), LinearSlope)


@pytest.mark.parametrize(("static", "speed"), [(0.03, 2.0), (0.12, 2.0), (0.03, 0.4)])
def test_friction_that_bends_over_the_speed_is_doubted(static: float, speed: float) -> None:
    """Of the nearest line stood a level that was off by up to 90 %, as sure as noise alone leaves it."""
    joint = regress_joint(log(static=static, speed=speed, noise=0.005))
    assert joint.static is None
    for name in ("level", "forward", "back", "viscous"):
        assert "bent" in kinds(getattr(joint, name).status), name
    assert "bent" not in kinds(joint.inertia.status)
    together = regress_joint_logs([log(static=static, speed=speed, noise=0.005, seed=seed) for seed in (1, 2)])
    assert {"bent"} <= kinds(together.forward.status) & kinds(together.viscous.status) - kinds(together.inertia.status)


@pytest.mark.parametrize(("drag", "power"), [(0.0015, 2.0), (0.001, 3.0)])
@pytest.mark.parametrize("viscous", [0.0, 0.045])
def test_drag_that_grows_with_a_power_of_the_speed_falls_nowhere(drag: float, power: float, viscous: float) -> None:
    """An upward bend was told as a fall beside a line too steep, with sliding friction 2 to 3 times too small."""
    t = np.arange(7500) / 250
    phase = 2 * np.pi * (0.1 * t + 0.015 * t**2)
    rate = 2 * np.pi * (0.1 + 0.03 * t)
    q, v = 0.1 + np.sin(phase), rate * np.cos(phase)
    a = 2 * np.pi * 0.03 * np.cos(phase) - rate**2 * np.sin(phase)
    level = 0.09 + drag * np.abs(v) ** power + 0.1 * np.abs(0.8 * np.sin(q))
    torque = 0.022 * a + viscous * v + 0.8 * np.sin(q) + np.sign(v) * level
    torque += 0.005 * np.random.default_rng(int(1e4 * drag)).standard_normal(t.size)
    findings = analyze_joint(ss.Record.of({"theta": q, "force": torque}, fs=250, units={"force": "N m"}))
    assert findings.joint.static is None
    assert all("bent" in kinds(getattr(findings.joint, name).status) for name in ("level", "forward", "viscous"))
    assert not any(words in " ".join(ss.summary(findings).headline) for words in ("falls with", "M3"))


def test_friction_along_a_line_is_not_said_to_bend() -> None:
    assert not any("bent" in kinds(regress_joint(log(static=0.06, seed=seed)).level.status) for seed in range(6))


def by_teeth(seed: int, share: float = 0.12, excess: float = 0.0) -> ss.Record:
    """A joint whose friction is 0.06 N m and a share of what motor and gravity both press on its teeth with."""
    t = np.arange(6000) / 200
    q = 1.2 * np.sin(2 * np.pi * 0.2 * t) + 0.5 * np.sin(2 * np.pi * 0.9 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    weight, torque = 0.5 * np.sin(q), np.zeros_like(q)
    level = 0.06 + excess * np.exp(-((abs(v) / 0.4) ** 2))
    for _ in range(60):  # it is part of its own load, by less than half
        torque = 0.02 * a + 0.03 * v + weight + np.sign(v) * (level + share * np.abs(weight + torque))
    torque += 0.005 * np.random.default_rng(seed).standard_normal(t.size)
    return ss.Record.of({"theta": q, "force": torque}, fs=200, units={"force": "N m"})


def test_friction_that_grows_with_what_the_teeth_bear_falls_nowhere() -> None:
    """Beside a load part of gravity alone the motor's share passed for viscous friction and a fall with the speed."""
    for seed in range(4):
        joint = regress_joint(by_teeth(seed))
        assert joint.by_teeth
        assert joint.static is None
        truth = {"load": 0.24, "forward": 0.06, "back": 0.06, "viscous": 0.03, "inertia": 0.02, "sine": 0.5}
        for name, value in truth.items():
            told = getattr(joint, name)
            assert abs(told.value - value) < 3.5 * told.sd, name
        assert joint.laws == ("M3", "M4", "M5", "M6")
        assert not regress_joint(log(static=0.06, seed=seed)).by_teeth
    fallen = regress_joint(by_teeth(0, excess=0.06))
    assert fallen.laws == ("M4", "M5", "M6")
    assert fallen.static.includes(0.12 + 0.24 * fallen.carried)


@pytest.mark.parametrize(
    ("draws", "named"), [(1, 2), pytest.param(20, 60, marks=pytest.mark.soak)], ids=["short", "long"]
)
def test_no_law_of_servos_that_is_true_is_denied(draws: int, named: int) -> None:
    """Load tests of the six laws by another integrator; of the five that are no plain friction some are named."""
    program, simplest = scripts.loaded("benchmarks/joint_loops.py"), 0
    for model in range(1, 7):
        for seed in range(330_000, 330_000 + draws):
            record, truth = program.loaded(seed, model)
            joint = regress_joint(record, **({} if "force" in record else {"kp": truth["kp"]}))
            assert f"M{model}" in joint.laws, seed
            simplest += joint.laws[0] == f"M{min(model, 4)}"
    assert simplest >= named


def test_friction_that_is_told_at_rest_alone_is_felt() -> None:
    """Of 10 N m at rest it was said that no dry friction is felt, as the kinetic part may be none."""
    record, _ = scripts.loaded("benchmarks/joint_loops.py").loaded(310_000, 4)
    findings = analyze_joint(record)
    assert findings.joint.level.interval[0] == 0 < findings.joint.static.interval[0]
    said = " ".join(ss.summary(findings).headline)
    assert "No dry friction" not in said
    assert "Its friction but the viscous part falls with the speed" in said
    assert "M1, M2 and M3 are denied; M4 is the simplest" in said


def test_curves_of_which_one_exponent_falls_nowhere_are_answered() -> None:
    record, truth = scripts.loaded("benchmarks/joint_loops.py").loaded(300_005, 4)
    assert regress_joint(record, **({} if "force" in record else {"kp": truth["kp"]})).static is not None


@pytest.mark.parametrize(("kind", "places"), [("friction", 2), ("friction", 8), ("torque", 2)])
def test_what_changes_along_the_way_is_doubted(kind: str, places: int) -> None:
    """A tenth of the friction, as a gear's teeth make it: the load part was 17 % off without a doubt."""
    logs = [log(static=0.06, seed=seed) for seed in (0, 1)]
    for number, record in enumerate(logs):
        ripple = 0.006 * np.sin(places * record["theta"])
        ripple *= np.sign(np.gradient(record["theta"])) if kind == "friction" else 1.0
        logs[number] = record.with_channel("force", record["force"] + ripple, unit="N m")
    joint, together = regress_joint(logs[0]), regress_joint_logs(logs)
    for name in ("level", "forward", "back", "load", "sine", "cosine"):
        assert f"{kind} changes along the way" in getattr(joint, name).status, name
        assert name == "level" or "placed" in kinds(getattr(together, name).status)
    assert (joint.inertia.status, joint.viscous.status) == ("ok", "ok")
    assert stands(joint.level.status), "a mean over the way, whose interval counts that"
    assert not stands(joint.load.status)
    assert joint.level.sd > 1.5 * regress_joint(log(static=0.06)).level.sd
    assert "placed" not in kinds(regress_joint(log(static=0.06)).level.status)


@pytest.mark.parametrize("teeth", [8, 23, 50])
def test_cogging_is_told_and_biases_nothing(teeth: int) -> None:
    """It passed for a delay of the torque, which was taken out, for a load part, and for viscous friction."""
    ripple, records = 0.02, [log(static=0.06, seed=seed) for seed in (0, 1)]
    force = [record["force"] + ripple * np.sin(teeth * record["theta"] + 0.5) for record in records]
    cogging = [record.with_channel("force", one, unit="N m") for record, one in zip(records, force, strict=True)]
    joint, plain = regress_joint(cogging[0]), regress_joint(records[0])
    assert plain.cogging is None
    assert joint.cogging is not None
    assert joint.cogging.includes(ripple)
    assert 2 * np.pi * joint.waves[0] == pytest.approx(teeth, abs=0.05)
    place = cogging[0]["theta"]
    assert np.max(np.abs(joint.cogs(place) - (force[0] - records[0]["force"]))) < 0.15 * ripple
    for name in ("level", "load", "viscous", "inertia", "sine", "cosine", "delay"):
        one, without = getattr(joint, name), getattr(plain, name)
        assert stands(one.status), name
        assert abs(one.value - without.value) < 3 * without.sd, name
    together = regress_joint_logs(cogging)
    assert "placed" not in kinds(together.load.status)
    assert abs(together.inertia.value - joint.inertia.value) < 3 * joint.inertia.sd


def test_strokes_of_even_speed_are_answered() -> None:
    """A stroke of even speed sees no slow sliding: curves that fall below its speed are there nowhere."""
    t = np.arange(6000) / 200
    speed = np.where(t % 8 < 4, 1.0, 2.0) * np.where(t % 2 < 1, 1.0, -1.0)
    chance = np.random.default_rng(0)
    q = np.cumsum(speed) / 200
    torque = 0.5 * np.sin(q) + 0.03 * speed + 0.06 * np.sign(speed) + chance.normal(0, 0.005, t.size)
    channels = {"theta": q + chance.normal(0, 1e-5, t.size), "force": torque}
    joint = regress_joint(ss.Record.of(channels, fs=200, units={"force": "N m"}), inertia=0.02)
    assert joint.static is None
    assert joint.level.includes(0.06)
    assert joint.viscous.includes(0.03)


@pytest.mark.parametrize(
    ("draws", "most"), [(8, 0), pytest.param(200, 2, marks=pytest.mark.soak)], ids=["short", "long"]
)
def test_no_fall_is_claimed_of_joints_without(draws: int, most: int) -> None:
    claimed = 0
    for seed in range(draws):
        try:
            claimed += regress_joint(joints.drawn(seed, torque=True, stribeck=False).record).static is not None
        except EstimateError:
            continue
    assert claimed <= most


@pytest.mark.parametrize(
    ("draws", "least"), [(10, 0.75), pytest.param(150, 0.91, marks=pytest.mark.soak)], ids=["short", "long"]
)
def test_intervals_hold_on_joints_of_another_integrator(draws: int, least: float) -> None:
    """Of those that are told to fall; `least` is three binomial deviations below 95 %, for their number."""
    held = []
    for seed in range(100, 100 + draws):
        joint = joints.drawn(seed, torque=True, stribeck=True)
        try:
            told = regress_joint(joint.record)
        except EstimateError:
            continue
        if told.static is None:
            continue
        truth = {
            "level": joint.level(told.time),
            "static": joint.static(told.time),
            "stribeck_speed": joint.truth["fall"],
        }
        estimates = {name: getattr(told, name) for name in truth}
        held += [one.includes(truth[name]) for name, one in estimates.items() if stands(one.status)]
    assert len(held) > draws / 2
    assert np.mean(held) >= least


def test_page_terminal_and_exports_have_the_curve(tmp_path, monkeypatch) -> None:
    ss.write_record(log(), tmp_path / "log.csv")
    monkeypatch.chdir(tmp_path)
    outcome = CliRunner().invoke(main, ["joint", "log.csv", "--output", "out", "--all"])
    assert outcome.exit_code == 0, outcome.output
    words = " ".join(outcome.output.split())
    assert "falls with the speed" in words
    assert "Stribeck speed" in words
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert "friction at rest" in json.dumps(results)
    assert "falls with the speed" in (tmp_path / "out" / "report.html").read_text()
    folder = tmp_path / "out" / "joint"
    assert 'name = "Stribeck"' in (folder / "law.toml").read_text()
    for file in ("friction.c", "friction.py", "friction.mo", "friction.m"):
        assert "static - kinetic" in (folder / file).read_text(), file
    for file in ("mujoco.xml", "dynamics.urdf"):
        assert "at rest" in (folder / file).read_text(), file
    assert (folder / "joint.fmu").exists()


def test_the_law_and_the_figure_are_those_of_the_answer() -> None:
    joint = analyze_joint(log()).joint
    law = joint_law(joint)
    assert isinstance(law, Stribeck)
    assert law.friction(0.0) == pytest.approx(joint.static.value)
    assert law.speed == joint.stribeck_speed.value
    _, back, forward, _ = plot_joint(joint).lines
    excess = joint.static.value - joint.level.value
    assert forward.get_ydata()[0] == pytest.approx(joint.forward.value + joint.load.value * joint.carried + excess)
    assert back.get_ydata()[0] == pytest.approx(-joint.back.value - joint.load.value * joint.carried - excess)


def test_a_mixture_of_one_is_itself() -> None:
    one = ss.Estimate.normal("friction", 1.0, sd=0.1, unit="N", method="")
    both = mixture([one, one], np.array([0.3, 0.7]))
    assert both.interval == pytest.approx(one.interval, abs=1e-3)
    assert both.sd == pytest.approx(0.1)
