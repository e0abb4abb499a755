"""What a record does not tell is said in the status of every number that rests on it."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import stepped
import stickslip as ss
from rigs import LAG, RIG, measured, told
from stickslip.answers.preparation import _doubt
from stickslip.estimate import UNTRIED, Status, kinds, stands

SHAKEN = stepped.Rig("static", 2.42, 2310.0, 3.0, 2e-3, 3.0, kinetic=1.1, static=1.4)


@cache
def settled(frequency: float = 8.7) -> ss.Record:
    """Three seconds of the rig, its sensors stated."""
    return told(measured(frequency, seconds=3.0)[0])


@cache
def with_a_wrong_mass() -> ss.answers.Findings:
    return ss.analyze(settled(), **{**RIG, "mass": 2.9})


@cache
def of_the_demo() -> ss.answers.Findings:
    demo = ss.datasets.demo()
    return ss.analyze(demo, **{name: demo.truth[name] for name in ("mass", "stiffness", "damping")})


def of(*names: str, stated: bool = False, **instead: np.ndarray) -> ss.Record:
    """Some of the channels; of the sensors' mounts nothing known unless `stated`."""
    whole = settled()
    record = ss.Record.of({name: instead.get(name, whole[name]) for name in names}, fs=whole.fs)
    for name in names:
        if name in "xz":
            record = record.with_details(name, delay=LAG)
        elif stated:
            record = record.with_details(name, mount=whole.channels[name].mount, inertia=whole.channels[name].inertia)
    return record


def words(found: ss.answers.Findings) -> str:
    story = ss.summary(found)
    return " ".join([*story.headline, *story.cautions, *story.notes])


def test_a_displacement_and_a_load_cell_are_enough() -> None:
    bare = ss.Record.of({name: settled()[name] for name in ("x", "load")}, fs=4000)
    findings = ss.analyze(bare, **RIG)
    assert findings.level is not None
    assert findings.level.value == pytest.approx(1.1, rel=0.05)
    assert "nothing is stated" in words(findings)


def test_a_displacement_that_does_not_change_is_named() -> None:
    still = of("x", "z", "a", "load", x=np.full(len(settled()), 1e-3))
    with pytest.raises(ss.errors.EstimateError, match=r"x does not change, it reads 0\.001 m throughout"):
        ss.analyze(still, **RIG)


def test_no_mount_is_told_by_forces_that_differ_from_the_start() -> None:
    still = of("x", "z", "a", "load", stated=True, z=np.full(len(settled()), 1e-8))
    findings = ss.analyze(still, **RIG)
    assert findings.comparison is None
    assert "z does not change" in words(findings)
    assert not [estimate.name for estimate in findings.estimates if "mount" in estimate.name]
    assert "wrong sign" not in words(findings)
    assert ss.balance.compare_force(still, **RIG).resonances == ()


def test_a_contact_that_holds_at_its_turns_alone_does_not_never_stick() -> None:
    findings = ss.analyze(settled(), **RIG)
    assert findings.sticks is not None
    assert findings.sticks.share.value == pytest.approx(0.0638, abs=0.001)
    assert not [event for event in findings.sticks.events if event.kind == "stick"]
    assert re.search(r"rests only briefly as it turns round, 6\.\d+ % of the time", words(findings))
    assert "never sticks" not in words(findings)
    assert "a rigid contact read without lag leaves" in words(findings)


def test_a_mount_that_is_not_stated_is_told_beside_the_friction() -> None:
    for names in (("x", "z", "a", "load"), ("x", "z", "a")):
        findings = ss.analyze(of(*names), **RIG)
        assert findings.level is not None
        assert "not stated" in findings.level.status
        assert "which the interval leaves out" in findings.level.status
        assert "none shows" not in words(findings)


def test_a_mount_found_is_said_of_its_own_sensor() -> None:
    """It read "how a (found in this record) and load are mounted", where the load cell was left aside too."""
    given = of("x", "z", "a", "load")
    record = given.with_details("a", mount=(125.0, 0.1))
    for method, others in (("fusion", "and load are"), ("smoother", "is")):
        used = replace(record, rig=ss.friction_force(given, method=method, **RIG).rig)
        doubt = _doubt(used, given, ss.rig.rig_settings(RIG), aligned=False)
        assert doubt is not None
        assert doubt.words.startswith(f"how a (its mount found in this record) {others} mounted is not stated")


def test_sensors_that_are_not_there_or_left_out_are_not_missed() -> None:
    for names in (("x", "z"), ("x", "z", "load")):
        findings = ss.analyze(of(*names, stated=True), **RIG)
        assert "mounted" not in words(findings)
        assert findings.level is not None
        assert kinds(findings.level.status) == {UNTRIED}
        assert stands(findings.level.status)


def test_a_mass_that_contradicts_the_record_is_told_in_the_headline() -> None:
    findings = with_a_wrong_mass()
    assert findings.level is not None
    assert re.search(r"a mass of 2\.4\d* kg", findings.level.status)
    assert "not to be trusted" in " ".join(ss.summary(findings).headline)
    assert findings.sticks is not None
    assert findings.sticks.share.status != "ok"


def test_micro_slips_are_not_sure_where_the_load_strays_from_every_contact() -> None:
    findings = ss.analyze(told(measured(2.5, seconds=3.0)[0]), **{**RIG, "mass": 2.9})
    assert findings.sticks is not None
    assert findings.sticks.microslips is not None
    assert "likeliest contact" in findings.sticks.microslips.status


@cache
def shaken(what: str) -> ss.answers.Findings:
    """Of a rig by another integrator, some of its channels otherwise; gains as sure as stated."""
    record = stepped.record(SHAKEN, np.random.default_rng(3), felt=True, noise=3e-4, cycles=15)
    x, far = record["x"], 0.8 * np.abs(record["x"]).max()
    changed = {"zero": {"x": x + 3e-3}, "cut": {"x": np.clip(x, -far, far)}, "gain": {"x": 1.03 * x}}
    channels = {"x": x, "z": record["z"], "a": record["a"]}
    sensed = ss.Record.of({**channels, **changed.get(what, {})}, fs=record.fs)
    for name in channels:
        sensed = sensed.with_details(name, gain_sd=0.004)
    return ss.analyze(sensed, **SHAKEN.stated)


def test_a_zero_of_a_displacement_is_called_so() -> None:
    """It was called a force or a displacement of the wrong sign, or a drive that is not read."""
    for what, off in (("zero", True), ("", False)):
        findings = shaken(what)
        first = ss.summary(findings).headline[0]
        assert ("zero of x or z is off by 3 mm" in first) == off
        assert findings.loops.forward.known != off
        assert findings.level.includes(1.1)
        assert not findings.consistency.failed
    assert "drives the motion" not in " ".join(e.status for e in shaken("zero").estimates)


def test_one_column_for_mass_and_base_is_told_in_one_sentence() -> None:
    record = ss.Record.of(dict.fromkeys("xz", shaken("").record["x"]), fs=shaken("").record.fs)
    story = ss.summary(ss.analyze(record, **SHAKEN.stated))
    assert "x and z are read from the same column" in story.headline[0]
    assert not story.remedies


def test_a_displacement_that_is_cut_is_told_first() -> None:
    story = ss.summary(shaken("cut"))
    assert "x has 2550 samples clipped" in story.headline[0]
    assert not [caution for caution in story.cautions if "check-up" in caution]


def test_a_gain_is_held_against_how_sure_it_is_stated_to_be() -> None:
    """Of 400 rigs whose gains were as stated one was called so."""
    assert [check.name for check in shaken("gain").consistency.failed] == ["acceleration is that of the displacement"]


def test_a_base_that_is_not_measured_is_told_and_negative_friction_is_never_sure() -> None:
    found = ss.analyze(of("x", "a"), **RIG)
    assert found.loops is not None
    assert "no channel z" in found.loops.level.status
    alone = ss.friction_loops(ss.friction_force(of("x", "a"), **RIG))
    assert alone.level.known != ("friction drives the motion" in alone.level.status)
    time = np.arange(4000) / 1000
    driven = ss.Record.of({"x": np.sin(30 * time), "friction": -np.sign(np.cos(30 * time))}, fs=1000)
    findings = ss.analyze(driven)
    assert findings.level is None
    assert "friction drives the motion" in findings.loops.level.status  # type: ignore[union-attr]


def test_a_mass_found_in_the_record_is_told_beside_the_contact() -> None:
    findings = ss.analyze(settled(2.5), stiffness=2310, damping=RIG["damping"])
    assert findings.stiffness is not None
    assert "the mass (found in this record) is not stated" in findings.stiffness.status
    doubted = findings.having(stiffness=replace(findings.stiffness, status=Status("as good as rigid")))
    line = next(line for line in ss.summary(doubted).headline if "While it holds the contact" in line)
    assert line.endswith(", which is not to be trusted (as good as rigid).")


def test_advice_holds_on_the_page_too() -> None:
    findings = with_a_wrong_mass()
    assert "record.with_details(" not in words(findings)
    assert "[sensors]" in words(findings)


def test_a_sound_record_of_sensors_that_are_not_described_is_trusted_with_a_caution() -> None:
    findings = of_the_demo()
    story = ss.summary(findings)
    assert "not to be trusted" not in " ".join(story.headline)
    assert "which the interval leaves out" in " ".join(story.cautions)
    assert findings.level is not None
    assert "delay" not in findings.level.status  # one was looked for, and none was taken out


def test_how_far_a_contact_gives_is_told_in_readable_units() -> None:
    findings = of_the_demo()
    assert re.search(r"up to 1\.1\d* N it moves -?\d+(\.\d+)? [µn]?m forward", words(findings))
    assert "e-0" not in words(findings).split("it moves", 1)[1].split("would be seen", 1)[0]
