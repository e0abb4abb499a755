"""A joint whose teeth have play, of which the motor's encoder alone tells: by that play where it is stated."""

import numpy as np
import pytest

import joints
import stickslip as ss
from stickslip.answers import analyze_joint
from stickslip.cycle import regress_joint
from stickslip.cycle.joint_logs import regress_joint_logs
from stickslip.cycle.joint_slides import seated
from stickslip.errors import ModelError


def by_motor(seed):
    """A drawn joint and its log, the motor's angle in place of the link's."""
    joint = joints.drawn(seed, torque=True, play=True)
    written = {"theta": joint.record["motor"] / joint.truth["ratio"]}
    written |= {name: joint.record[name] for name in ("reference", "force")}
    record = ss.Record.of(written, fs=joint.record.fs, units={"reference": "rad", "force": "N m"})
    return joint, record.with_details("force", gain_sd=joints.GAIN)


def test_teeth_carry_once_the_motor_has_crossed_their_play():
    place = np.concatenate([np.linspace(0, 1, 101), np.linspace(0.99, 0, 100)])
    torque = np.where(np.arange(201) <= 110, 1.0, -1.0)  # it falls after the turn, at 0.9
    side, carry = seated(place, torque, 2 * torque, 0.25)
    assert np.array_equal(side, np.sign(torque))
    assert np.array_equal(np.flatnonzero(~carry), [*range(25), *range(111, 136)])
    side, carry = seated(place, torque, -torque, 0.25)
    assert not carry.any(), "where its sign is not known, they may be anywhere"


@pytest.mark.parametrize("seed", [81041, 81067, 81071])
def test_play_that_is_stated_is_no_friction(seed):
    """The load part is wrong where the motor crosses the play without the link, and gravity acts half of it beside."""
    joint, record = by_motor(seed)
    plain, stated = regress_joint(record), regress_joint(record, play=(joint.truth["play"], 0.1 * joint.truth["play"]))
    assert "--play" in plain.load.status or not plain.load.includes(joint.truth["load"])
    for name in ("load", "forward", "back", "viscous", "inertia"):
        assert getattr(stated, name).includes(joint.truth[name]), name


@pytest.mark.parametrize("seed", [312, 323])
def test_play_that_nobody_stated_is_named_where_the_torque_seems_too_early(seed):
    """A torque that comes before the motion that it makes was told, and taken out, as a delay of less than none."""
    _, record = by_motor(seed)
    findings = analyze_joint(record)
    assert not findings.joint.delay.known
    for name in ("level", "sine", "inertia"):
        assert "--play" in getattr(findings.joint, name).status, name
    assert "earlier" not in " ".join(ss.summary(findings).headline)
    plain = joints.drawn(seed, torque=True).record
    assert "--play" not in regress_joint(plain).level.status


@pytest.mark.parametrize(("early", "named"), [(2.5e-3, False), (20e-3, True)])
def test_a_torque_that_is_logged_as_it_is_set_and_held_is_no_play(early, named):
    """It comes half of what it is held for early: 6 of 6 logs of another integrator were told to have play."""
    t = np.arange(6000) / 200
    (q, _, _), (place, v, a) = (
        [sum(s * (6.283 * f) ** k * np.sin(6.283 * f * at + k * np.pi / 2) for s, f in ((1.2, 0.2), (0.4, 0.7)))
         for k in range(3)] for at in (t, t + early)
    )  # fmt: skip
    torque = 0.02 * a + 0.03 * v + 1.5 * np.sin(place) + (0.06 + 0.1 * np.abs(1.5 * np.sin(place))) * np.sign(v)
    noise = np.random.default_rng(0).normal(0, 0.01, t.size)
    log = ss.Record.of({"theta": q, "force": torque + noise}, fs=200, units={"force": "N m"})
    assert ("--play" in regress_joint(log).level.status) == named
    stated = regress_joint(log, play="0.01 deg").level.status
    assert "--play" not in stated, "the advice led in a circle"
    assert ("more play than is stated" in stated) == named


def test_several_logs_are_told_by_it_too():
    joint, record = by_motor(81071)
    part = len(record) // 5
    parts = [record.rows(0, 4 * part), record.rows(part, len(record))]
    together = regress_joint_logs(parts, play=joint.truth["play"])
    assert together.load.includes(joint.truth["load"])
    assert not regress_joint_logs(parts).load.includes(joint.truth["load"])


def test_none_that_is_stated_changes_nothing():
    _, record = by_motor(81067)
    assert regress_joint(record, play=0.0).load.interval == regress_joint(record).load.interval
    told = analyze_joint(record, play="1 deg").joint.load
    assert told.interval == regress_joint(record, play=np.radians(1.0)).load.interval


@pytest.mark.parametrize("play", [-0.01, "1 N"])
def test_play_without_meaning_is_refused(play):
    with pytest.raises(ModelError):
        regress_joint(by_motor(81067)[1], play=play)


def test_play_beside_two_encoders_is_refused():
    with pytest.raises(ModelError, match="both tell where the teeth are"):
        regress_joint(joints.drawn(81067, torque=True, play=True).record, play=0.01)
