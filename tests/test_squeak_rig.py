"""The virtual squeak rig shows the four observations of chapter 7, and why."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

import stickslip as ss
from squeak_peer import Rig, dop853, taylor
from stickslip.figures.trajectory import plot_motion, plot_phase

CASES = [("dry", 6.13), ("wet", 6.13), ("dry", 1.23), ("wet", 1.23)]
SQUEAKS = ("wet", 6.13)


@cache
def driven(surface: str, load: float) -> ss.solve.Trajectory:
    return ss.simulate(ss.squeak.squeak_rig(surface, load), duration=2.0)


def normal_acceleration(run: ss.solve.Trajectory) -> np.ndarray:
    """Of the beam's tip over the last second, at 10 kHz."""
    return run.sample(1.0 + np.arange(10_000) / 1e4, ("a",))[0][1]


@pytest.mark.parametrize(("surface", "load"), CASES)
def test_it_slides_steadily_unless_wet_and_heavily_loaded(surface: str, load: float) -> None:
    stabilities = [ss.stability(ss.squeak.squeak_rig(surface, load), speed=speed) for speed in (-0.1, 0.1)]
    assert [one.mechanism == "mode coupling" for one in stabilities] == [(surface, load) == SQUEAKS, False]
    assert all(one.stable == (one.mechanism == "stable") and one.status == "ok" for one in stabilities)


def test_falling_friction_alone_does_not_squeak() -> None:
    rig = ss.squeak.squeak_rig(*SQUEAKS)
    assert rig.contacts[0].law.slope < 0 < ss.squeak.squeak_rig("dry", 6.13).contacts[0].law.slope
    stability = ss.stability(rig, speed=-0.1)
    assert stability.without_coupling < 0 < stability.without_slope < stability.growth
    assert 475 < stability.frequency < 500


@pytest.mark.parametrize(("surface", "load"), CASES)
def test_driven_at_five_hertz_it_sounds_as_it_should(surface: str, load: float) -> None:
    run = driven(surface, load)
    level = np.std(normal_acceleration(run))
    friction = run.sample(1.0 + np.arange(10_000) / 1e4, ("friction",))[0].sum(axis=0)
    assert (level > 30) == ((surface, load) == SQUEAKS)  # m/s^2
    assert np.mean(np.abs(friction)) == pytest.approx({"dry": 20, "wet": 8}[surface] * load / 6.13, rel=0.15)


def uncoupled(rig: ss.Structure) -> ss.Structure:
    """The same springs, but friction that does not follow the load."""
    pressed = sum(contact.stiffness * np.outer(contact.normal, contact.normal) for contact in rig.contacts)
    contacts = [ss.Contact(one.law, one.tangent, preload=one.preload) for one in rig.contacts]
    return rig.having(stiffness=np.asarray(rig.stiffness) + pressed, contacts=contacts)


def test_driven_it_squeaks_without_the_slope_but_not_without_the_coupling() -> None:
    rig = ss.squeak.squeak_rig(*SQUEAKS)
    stability = ss.stability(rig, speed=-0.1)
    for other, growth, squeaks in (
        (rig.having(slope=0.0), stability.without_slope, True),
        (uncoupled(rig), stability.without_coupling, False),
    ):
        assert ss.stability(other, speed=-0.1).growth == pytest.approx(growth, rel=1e-9)
        assert (np.std(normal_acceleration(ss.simulate(other, duration=2.0))) > 30) == squeaks


def test_it_squeaks_at_the_frequency_that_bending_and_torsion_share() -> None:
    frequencies, power = welch(normal_acceleration(driven(*SQUEAKS)), 1e4, nperseg=4096)
    assert 475 < frequencies[np.argmax(power)] < 500


def test_where_it_begins_to_squeak_is_where_sliding_ceases_to_be_stable() -> None:
    critical = ss.squeak.critical_value(
        ss.squeak.squeak_rig(), lambda load: ss.squeak.squeak_rig("wet", load), between=(1.23, 6.13), speed=-0.1
    )
    assert (critical.mechanism, critical.stable_below) == ("mode coupling", True)
    for load, begins in ((0.99 * critical.value, False), (1.01 * critical.value, True)):
        rig = ss.squeak.squeak_rig("wet", load).having(drive=ss.drives.Belt(-0.1), acts_on=None)
        rest = dict(zip(("x1", "x2", "x3"), ss.stability(rig).place, strict=True))
        late = ss.simulate(rig, duration=6.0, start={**rest, "v1": 0.0, "v2": 1e-6, "v3": 0.0})
        moments = np.array([0.5, 5.5])[:, None] + np.arange(200) / 2e4
        swings = np.abs(late.sample(moments.ravel(), ("v",))[0][1]).reshape(2, -1)
        assert late.events == ()
        assert (swings[1].max() > swings[0].max()) == begins


@pytest.mark.parametrize("peer", ["extended precision", "scipy"])
def test_sticks_and_flights_of_two_contacts_are_those_of_the_rules_written_out(peer: str) -> None:
    rig, duration = ss.squeak.squeak_rig(*SQUEAKS), 0.28
    if peer == "scipy":
        order, end = dop853(Rig(rig), duration, rtol=1e-10, longest=2e-5)
    else:
        order, end = taylor(Rig(rig, np.longdouble), duration)
    run = ss.simulate(rig, duration=duration)
    assert [tuple(run.table.modes[m].name.split(" + ")) for m in run.modes] == order
    assert {"stuck", "lifted", "back", "forward"} == {part for each in order for part in each}
    assert len(order) > 50
    assert np.allclose(run.sample([duration], ("x", "v"))[0][:, 0], end[:6].astype(float), rtol=1e-9, atol=0)


@pytest.mark.parametrize(("surface", "load"), CASES)
def test_the_scenario_is_the_rig(surface: str, load: float) -> None:
    known, rig = ss.scenarios.get(f"SQUEAK {surface} {load} N").system, ss.squeak.squeak_rig(surface, load)
    for name in ("mass", "damping", "stiffness", "acts_on"):
        assert np.array_equal(getattr(known, name), getattr(rig, name))
    assert known.drive == rig.drive
    for one, other in zip(known.contacts, rig.contacts, strict=True):
        assert (one.law, one.stiffness, one.preload) == (other.law, other.stiffness, other.preload)
        assert np.array_equal(one.tangent, other.tangent)
        assert np.array_equal(one.normal, other.normal)


@pytest.mark.parametrize(
    ("change", "words"),
    [({"surface": "oily"}, "surface = 'oily'"), ({"load": -1.0}, "load = -1"), ({"amplitude": 0.0}, "amplitude = 0")],
)
def test_what_has_no_meaning_is_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(ss.errors.ModelError, match=words):
        ss.squeak.squeak_rig(**change)  # type: ignore[arg-type]


def test_the_angle_is_told_in_radians() -> None:
    run = ss.simulate(ss.squeak.squeak_rig("wet"), duration=0.05)
    record = run.record(fs=1000.0)
    assert [record.channels[name].unit for name in ("x2", "x3", "v3", "a3")] == ["m", "rad", "rad/s", "rad/s^2"]
    assert record.channels["v3"].quantity == "angular velocity"
    drawn = [axes.get_ylabel().replace("\n", " ") for axes in plot_motion(run).axes]
    assert drawn[2:4] == ["angle [rad]", "angular velocity [rad/s]"]
    assert plot_phase(run, mass=2).get_xlabel() == "angle x3 [rad]"
    story = ss.story.outcome(ss.systems.scenario_case("SQUEAK wet 6.13 N"))
    assert "rad, at up to" in story.sentences[0]
    assert story.values["largest angular speed v3"][1] == "rad/s"


def test_what_is_no_rig_is_refused_in_words() -> None:
    assert ss.squeak.squeak_rig("wet", "6").contacts[0].preload == 3.0  # type: ignore[arg-type]
    for surface, load in (("wet", "heavy"), ("wet", [1, 2]), (["wet"], 6.0)):
        with pytest.raises(ss.errors.ModelError, match=r"load|surface"):
            ss.squeak.squeak_rig(surface, load)  # type: ignore[arg-type]


@pytest.mark.parametrize("rotations", [[0], [4], ["x3"], 2.5])
def test_an_angle_that_is_no_degree_of_freedom_is_refused(rotations: Any) -> None:
    with pytest.raises(ss.errors.ModelError, match=r"rotations = .*from 1 to 3"):
        ss.squeak.squeak_rig().having(rotations=rotations)


@pytest.mark.parametrize(("load", "answer"), [(1.4, "does not squeak"), (1.7, "can not be told"), (2.0, "squeaks")])
def test_just_below_the_threshold_it_can_not_be_told_whether_it_squeaks(load: float, answer: str) -> None:
    """Sliding is stable up to 1.797 N, and what is struck at a reversal hardly dies away just below."""
    run = ss.simulate(ss.squeak.squeak_rig("wet", load), duration=1.7)
    squeaks = ss.find_squeaks(ss.squeak.squeak_record(run, snr=30, rng=1).between(0.4, 1.4))
    assert squeaks.answer == answer
    assert all("near the threshold" in burst.evidence for burst in squeaks.untold)
