"""Sticks as real sensors write them: a mount that rings, noise, sensors that come late. Right, or undecided."""

from __future__ import annotations

import functools
import re

import numpy as np
import pytest

import stickslip as ss
from stickslip.contact.ringing import UNTOLD

RIG = {"mass": 2.42, "stiffness": 2310.0}
TRUE = 45.0914  # Hz: sqrt((k + K)/m (1 - zeta^2)) / 2 pi
PERFECT = ss.Rig.perfect()
FEW = np.array([20.0, 40.0, 80.0])  # Hz: of the map, about which nothing is asked here


@functools.cache
def motion() -> ss.solve.Trajectory:
    contact = ss.laws.CompliantContact(kinetic=1.1, stiffness=192000, damping=23.9)
    drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    return ss.simulate(ss.Oscillator(law=contact, drive=drive, damping=0.12, **RIG), cycles=11)


def measured(rig: ss.Rig, seed: int = 1) -> ss.Record:
    return rig.measure(motion(), fs=4000, rng=seed, start=2.0)


@pytest.mark.parametrize(
    "rig",
    [
        ss.Rig(),
        ss.Rig(tuple(sensor for sensor in ss.Rig().sensors if sensor.channel != "load")),
        PERFECT.having("a", mount=ss.rig.Mount(125, 0.1)),
        PERFECT.having("a", mount=ss.rig.Mount(1000, 0.02)),
        PERFECT.having("a", white=0.04),
    ],
    ids=["the thesis's", "without its load cell", "mount of 125 Hz", "mount of 1000 Hz", "noise alone"],
)
def test_what_the_sensors_are_known_to_add_is_taken_out(rig: ss.Rig) -> None:
    record = rig.stated(measured(rig))
    maps = ss.answers.time_frequency(record, frequencies=FEW, **RIG)
    assert maps.mechanism.name == "double stick-slip"
    slips, mode = maps.microslips, maps.transition
    assert mode.status == "ok"
    assert (slips.status == "ok") == (record.channels["load"].mount is not None if "load" in record else False)
    assert slips.per_stick.value == pytest.approx(2, abs=0.3)
    assert mode.frequency.value == pytest.approx(TRUE, abs=3 * mode.frequency.sd)
    assert mode.stiffness is not None
    assert mode.stiffness.value == pytest.approx(192000, rel=0.06)


@pytest.mark.parametrize(
    ("rig", "told", "why"),
    [
        (
            PERFECT.having("a", mount=ss.rig.Mount(125, 0.1)),
            {},
            "a mount of 12[56].* Hz shows in a, and none is stated",
        ),
        (
            PERFECT.having("a", mount=ss.rig.Mount(1000, 0.02)),
            {},
            "a mount of (999.*|100.) Hz shows in a, and none is stated",
        ),
        (PERFECT.having("a", white=0.04), {}, "the noise of a is 1. % of its standard deviation"),
        (ss.Rig(), RIG, "x comes 1.* ms after a: state the delays.*; a mount of 12.* Hz shows in a"),
    ],
    ids=["mount of 125 Hz", "mount of 1000 Hz", "noise", "the thesis's"],
)
def test_what_is_not_stated_is_named_and_nothing_told_surely(rig: ss.Rig, told: dict[str, float], why: str) -> None:
    maps = ss.answers.time_frequency(measured(rig), frequencies=FEW, **told)
    assert maps.mechanism is not None
    assert maps.mechanism.name == UNTOLD
    assert np.isnan(maps.mechanism.probability)
    assert re.match(why, maps.mechanism.reason)
    assert maps.estimates or "no transition" in maps.notes[0]
    assert all(estimate.status != "ok" for estimate in maps.estimates)


def test_a_stated_mount_is_not_taken_for_the_contact_where_it_can_not_be_taken_out() -> None:
    record = ss.Rig().stated(measured(ss.Rig()))
    mechanism = ss.contact.mechanism(record)
    assert mechanism.name == UNTOLD
    assert mechanism.reason.startswith("a stands on a mount of 125 Hz")
    assert ss.contact.find_microslips(record).per_stick.status.startswith("a stands on a mount of 125 Hz")


def test_a_mount_faster_than_the_record_is_none() -> None:
    record = measured(PERFECT)
    same = ss.contact.transition(record.with_details("a", mount=(3500.0, 0.02)), **RIG)
    assert same.status == "ok"
    assert same.frequency.value == ss.contact.transition(record, **RIG).frequency.value


def test_an_acceleration_alone_that_swings_may_be_its_mount() -> None:
    record = measured(PERFECT.having("a", mount=ss.rig.Mount(125, 0.1)))
    mechanism = ss.contact.mechanism(ss.Record.of({"a": record["a"]}, fs=record.fs))
    assert mechanism.name == UNTOLD or "an accelerometer whose mount rings looks alike" in mechanism.reason


def test_a_clean_record_from_rest_on_has_no_mount_and_no_offset() -> None:
    contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    slider = ss.Oscillator(mass=2.42, stiffness=2310, damping=0.1196, law=contact, drive=drive)
    clean = ss.simulate(slider, duration=4).record(fs=4000)
    maps = ss.answers.time_frequency(clean, frequencies=FEW)
    assert maps.mechanism.name == "double stick-slip"
    assert maps.transition.frequency.status == "ok"
    assert maps.transition.frequency.value == pytest.approx(TRUE, rel=1e-4)
    # its start from rest is no offset: the first two sticks hold one micro-slip, all others two
    assert maps.microslips.counts == (1, 1, *[2] * 18)
