"""An axis of an arm: what bodies take of the torque, by closed form and MuJoCo, and the friction that is left."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip.arrays import Array
from stickslip.cli.program import main

pytest.importorskip("pinocchio", reason="the extra arm is not installed")

UPPER, FORE, HAND = (2.0, 0.4, 0.18, 0.03), (1.2, 0.3, 0.14, 0.012), 0.5  # mass, length, centre, inertia about it
URDF = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="{0[2]} 0 0"/><mass value="{0[0]}"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="{0[3]}" iyz="0" izz="{0[3]}"/></inertial></link>
  <link name="fore"><inertial><origin xyz="{1[2]} 0 0"/><mass value="{1[0]}"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="{1[3]}" iyz="0" izz="{1[3]}"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0 0 0"/><mass value="{2}"/>
    <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>
  <joint name="shoulder_joint" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
  <joint name="elbow_joint" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="{0[1]} 0 0"/>
    <axis xyz="0 -1 0"/></joint>
  <joint name="slide_joint" type="prismatic"><parent link="fore"/><child link="hand"/><origin xyz="{1[1]} 0 0"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.2" effort="100" velocity="1"/></joint>
</robot>"""
G = 9.81
FS = 500.0


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    file = tmp_path / "arm.urdf"
    file.write_text(URDF.format(UPPER, FORE, HAND), encoding="utf-8")
    return file


def moved(seconds: float = 20.0) -> tuple[Array, Array, Array, Array]:
    """Time, and angles, speeds and accelerations of shoulder and elbow, shape (2, n)."""
    t = np.arange(round(seconds * FS)) / FS
    tones = [[(0.5, 0.23, 0.4), (0.25, 0.71, 1.0)], [(0.7, 0.31, 2.0), (0.2, 0.83, 0.1)]]
    at = [
        [
            sum(s * (2 * np.pi * f) ** k * np.sin(2 * np.pi * f * t + p + k * np.pi / 2) for s, f, p in own)
            for own in tones
        ]
        for k in range(3)
    ]
    q, v, a = (np.array(part) for part in at)
    return t, q + np.array([[0.6], [-0.4]]), v, a


def bodies(q: Array, v: Array, a: Array) -> Array:
    """Torques of two bars in a vertical plane, with a point at the end of the second (Lagrange's equations)."""
    (m1, l1, c1, i1), (m2, l2, c2, i2) = UPPER, FORE
    # the hand belongs to the forearm, at its end, where its slide rests
    first = m2 * c2 + HAND * l2
    second = i2 + m2 * c2**2 + HAND * l2**2 + 1e-4
    h = l1 * first
    m11 = i1 + m1 * c1**2 + (m2 + HAND) * l1**2 + second + 2 * h * np.cos(q[1])
    m12 = second + h * np.cos(q[1])
    turned = np.cos(q[0] + q[1])
    return np.array(
        [
            m11 * a[0]
            + m12 * a[1]
            - h * np.sin(q[1]) * (2 * v[0] * v[1] + v[1] ** 2)
            + G * ((m1 * c1 + (m2 + HAND) * l1) * np.cos(q[0]) + first * turned),
            m12 * a[0] + second * a[1] + h * np.sin(q[1]) * v[0] ** 2 + G * first * turned,
        ]
    )


FRICTION = {"shoulder": (0.9, 0.7, 0.4, 0.08), "elbow": (0.5, 0.55, 0.2, 0.03)}  # forward, back, viscous, rotor


def log(seed: int = 1, *, noise: float = 0.05, counts: int = 2**16, load: float = 0.0) -> ss.Record:
    """What a robot writes: positions in counts, and torques that move bodies, rotors and friction, partly of a load."""
    _, q, v, a = moved()
    chance, count = np.random.default_rng(seed), 2 * np.pi / counts
    taken, written, units = bodies(q, v, a), dict[str, Array](), dict[str, str]()
    for j, (name, (forward, back, viscous, rotor)) in enumerate(FRICTION.items()):
        own = np.where(v[j] > 0, forward, -back) + viscous * v[j] + rotor * a[j]
        own += load * np.abs(taken[j]) * np.sign(v[j])
        written[f"position_{name}_joint"] = np.round(q[j] / count) * count
        written[f"effort_{name}_joint"] = taken[j] + own + noise * chance.standard_normal(q.shape[1])
        units |= {f"position_{name}_joint": "rad", f"effort_{name}_joint": "N m"}
    return ss.Record.of(written, fs=FS, units=units)


@pytest.mark.parametrize("axis", ["shoulder_joint", "elbow"])
def test_bodies_take_what_lagranges_equations_say(urdf: Path, axis: str) -> None:
    _, q, v, a = moved()
    exact = bodies(q, v, a)[0 if axis.startswith("shoulder") else 1]
    record = ss.answers.without_bodies(log(noise=0.0, counts=2**26), urdf=urdf, axis=axis)
    missed = (record["bodies"] - exact)[100:-100] / np.ptp(exact)
    assert np.sqrt(np.mean(missed**2)) < 1e-3, "what smoothing leaves"
    assert np.max(np.abs(missed)) < 4e-3
    assert any("slide_joint taken to rest" in step.outcome for step in record.history)


def test_mujoco_says_the_same(urdf: Path) -> None:
    mujoco: Any = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(urdf))
    data = mujoco.MjData(model)
    _, q, v, a = moved(2.0)
    exact = bodies(q, v, a)
    for row in range(0, q.shape[1], 97):
        data.qpos[:2], data.qvel[:2], data.qacc[:2] = q[:, row], v[:, row], a[:, row]
        mujoco.mj_inverse(model, data)
        assert np.allclose(data.qfrc_inverse[:2], exact[:, row], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("axis", list(FRICTION))
def test_the_friction_of_each_axis_is_what_is_left(urdf: Path, axis: str) -> None:
    forward, back, viscous, rotor = FRICTION[axis]
    findings = ss.answers.analyze_joint(ss.answers.without_bodies(log(), urdf=urdf, axis=axis))
    joint = findings.joint
    assert joint.forward.includes(forward)
    assert joint.back.includes(back)
    assert joint.viscous.includes(viscous)
    assert joint.inertia.includes(rotor)
    assert joint.level.interval[1] - joint.level.interval[0] < 0.05 * joint.level.value
    sliding = np.abs(moved()[2][list(FRICTION).index(axis)]) > 0.3
    left = findings.record["friction"][sliding]
    assert abs(np.median(np.abs(left)) - np.median(np.abs(joint.friction))) < 0.1


@pytest.mark.parametrize("axis", list(FRICTION))
def test_friction_that_grows_with_the_torque_of_the_bodies_is_said(urdf: Path, axis: str) -> None:
    """Either direction's, and the viscous part, took it in without a word; else nothing is said."""
    doubted, sure = (
        ss.answers.analyze_joint(ss.answers.without_bodies(log(load=load), urdf=urdf, axis=axis)).joint
        for load in (0.1, 0.0)
    )
    assert "0.1 of it" in doubted.forward.status
    for estimate in (doubted.forward, doubted.back, doubted.viscous):
        assert not ss.estimate.stands(estimate.status)
    for estimate in (sure.forward, sure.back, sure.viscous, sure.level, doubted.level):
        assert ss.estimate.stands(estimate.status)
    row = list(FRICTION).index(axis)
    _, q, v, a = moved()
    carried = np.abs(bodies(q, v, a)[row])[np.abs(v[row]) > 0.1].mean()
    assert doubted.level.value == pytest.approx(sum(FRICTION[axis][:2]) / 2 + 0.1 * carried, rel=0.1)


def test_without_its_bodies_an_arm_is_told_wrongly(urdf: Path) -> None:
    """Gravity of one angle alone does not tell what the elbow's motion pulls at the shoulder."""
    alone = ss.answers.analyze_joint(log(), axis="shoulder").joint
    whole = ss.answers.analyze_joint(ss.answers.without_bodies(log(), urdf=urdf, axis="shoulder")).joint
    assert alone.residual > 10 * whole.residual


def test_how_unsure_the_bodies_are_is_in_the_intervals(urdf: Path) -> None:
    """Masses 2 % too heavy in the URDF: without a word of that the shoulder's friction would be told too small."""
    heavy = urdf.with_name("heavy.urdf")
    heavier = [(1.02 * part[0], *part[1:3], 1.02 * part[3]) for part in (UPPER, FORE)]
    heavy.write_text(URDF.format(*heavier, 1.02 * HAND), encoding="utf-8")
    told = ss.answers.analyze_joint(ss.answers.without_bodies(log(), urdf=f"{heavy} ± 2 %", axis="shoulder")).joint
    sure = ss.answers.analyze_joint(ss.answers.without_bodies(log(), urdf=heavy, axis="shoulder")).joint
    forward, back, viscous, rotor = FRICTION["shoulder"]
    for estimate, truth in ((told.forward, forward), (told.back, back), (told.viscous, viscous), (told.inertia, rotor)):
        assert estimate.includes(truth)
    assert not sure.inertia.includes(rotor)


def test_the_command_tells_one_joint(urdf: Path, tmp_path: Path) -> None:
    ss.write_record(log(), tmp_path / "log.csv")
    asked = ["joint", str(tmp_path / "log.csv"), "--urdf", str(urdf), "--output", str(tmp_path / "out")]
    lacking = CliRunner().invoke(main, asked)
    assert lacking.exit_code == 2
    assert "name it by --axis" in lacking.output
    done = CliRunner().invoke(main, [*asked, "--axis", "elbow"])
    assert done.exit_code == 0, done.output
    assert "0.5" in done.output


@pytest.mark.parametrize(
    ("text", "axis", "rule"),
    [
        ("<robot", "elbow", "read from its URDF"),
        ('<robot name="r"><link name="l"/></robot>', "elbow", "one axis"),
        (URDF.format(UPPER, FORE, HAND), "wrist", "one joint is asked for at a time"),
        (URDF.format(UPPER, FORE, HAND), "joint", "one joint is asked for at a time"),
        (URDF.format(UPPER, FORE, HAND), "slide", "it is that joint's"),
    ],
)
def test_a_robot_that_does_not_fit_is_refused(tmp_path: Path, text: str, axis: str, rule: str) -> None:
    file = tmp_path / "robot.urdf"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ss.StickslipError, match=rule):
        ss.answers.without_bodies(log(), urdf=file, axis=axis)
