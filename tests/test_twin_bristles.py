"""A contact of bristles, told from one that gives way as a spring, by twins of records of another integrator."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import stepped
import stickslip as ss
from stickslip.twin.belief import EXCESS, HELD, KINETIC, SLOPE
from stickslip.twin.descent import _damped_step, _downhill, linearised, misfit

PULL = 800 * 4e-3  # N: what shakes these rigs


def test_a_contact_that_is_bent_as_the_record_begins_is_no_contact_of_bristles() -> None:
    """It was begun relaxed: bristles with eight times the static friction were nearer, 32 % too stiff and sure of it.

    And the search ended in the valley of stiffness and damping, where it bends, 13 of chi-squared above its floor.
    """
    rig = stepped.Rig("compliant", 4.7, 2646.0, 4.4, 1.17e-3, 5.15, kinetic=1.383, contact=5.393e4, loss=39.3)
    record = stepped.record(rig, np.random.default_rng(11), noise=5e-4)
    tried = ss.tried(ss.analyze(record, **rig.stated), twins=8)
    assert isinstance(tried.trial.belief.law, ss.laws.CompliantContact)
    assert not tried.trial.unlike
    stiffness = tried.presliding.stiffness
    assert stiffness.includes(rig.contact)
    assert stiffness.value == pytest.approx(rig.contact, rel=0.1)


def test_a_contact_is_no_surer_than_the_laws_that_explain_x_as_well() -> None:
    """A spring was told to a thousandth, and bristles that fit as well leave it a twentieth: 5225 to 5958 for 6079."""
    rng = np.random.default_rng(np.random.SeedSequence([281129, 4]).spawn(1)[0])
    rig = stepped.drawn("LuGre", rng)
    record = stepped.record(rig, rng, noise=10 ** rng.uniform(-4, -2.3))
    tried = ss.tried(ss.analyze(record, **rig.stated), twins=8)
    stiffness = tried.presliding.stiffness
    assert stiffness.includes(rig.contact)
    assert stiffness.interval[0] > rig.contact / 2


@cache
def bristled() -> ss.answers.Findings:
    """What is found of a contact of bristles."""
    falls = {"static": 1.3, "speed": 8e-3, "exponent": 2.0}
    rig = stepped.Rig("LuGre", 2.0, 800.0, 1.0, 4e-3, 2.4, kinetic=0.96, contact=8000.0, **falls)
    record = stepped.record(rig, np.random.default_rng(11), noise=1e-4)
    return ss.tried(ss.analyze(record, **rig.stated), twins=8)


def test_a_draw_without_sliding_friction_is_a_twin_too() -> None:
    """Half of the twins of a record whose sliding friction is unsure were lost, and the trial with them."""
    belief = bristled().trial.belief
    faint = belief.at(**{KINETIC: 0.0})
    assert 0 < faint.law.kinetic < 0.02 * faint.law.static
    assert len(faint.twin(np.random.default_rng(1))) == len(belief.record)
    assert belief.at(**{KINETIC: 0.0, EXCESS: 0.0}).law.kinetic == 0.0


def test_bristles_are_found_with_their_stiffness() -> None:
    tried = bristled()
    assert isinstance(tried.trial.belief.law, ss.laws.LuGre)
    assert tried.loops.level.value == pytest.approx(0.96, rel=0.01)
    assert tried.presliding.stiffness.value == pytest.approx(8000.0, rel=0.05)


@pytest.mark.parametrize("share", [0.2, pytest.param(0.5, marks=pytest.mark.soak)])
def test_bristles_with_a_damping_of_their_own_are_told(share: float) -> None:
    """Searched without it, the stiffness of four of four was 30 to 360 % too large, and sure."""
    falls = {"static": 1.25, "speed": 6e-3, "exponent": 2.0}
    loss = share * math.sqrt(2e4 * 2.0)
    rig = stepped.Rig("LuGre", 2.0, 800.0, 1.0, 4e-3, 2.4, kinetic=0.96, contact=2e4, loss=loss, **falls)
    tried = ss.tried(ss.analyze(stepped.record(rig, np.random.default_rng(11), noise=1e-4), **rig.stated), twins=8)
    assert tried.loops.level.includes(0.96)
    stiffness = tried.presliding.stiffness
    assert stiffness.includes(rig.contact)
    assert stiffness.interval[1] < 2 * rig.contact
    law = tried.trial.belief.law
    assert isinstance(law, ss.laws.LuGre)
    assert law.damping == pytest.approx(loss, rel=0.3)


def test_bristles_whose_friction_does_not_fall_are_no_damped_spring() -> None:
    # which was believed in with a quarter of their stiffness
    level = 0.3 * PULL
    rig = stepped.Rig(
        "LuGre", 2.0, 800.0, 1.0, 4e-3, 2.4, kinetic=level, static=level, speed=1.0, contact=33e3, exponent=2.0
    )
    tried = ss.tried(ss.analyze(stepped.record(rig, np.random.default_rng(7), noise=2e-4), **rig.stated), twins=8)
    assert isinstance(tried.trial.belief.law, ss.laws.Dahl)
    assert tried.presliding.stiffness.includes(rig.contact)
    assert tried.presliding.stiffness.value == pytest.approx(rig.contact, rel=0.02)


def test_a_value_at_its_end_stays_and_the_search_goes_on_without_it() -> None:
    # a slope that may not fall below zero, and was drawn there, had ended the search with a step that led nowhere
    belief = bristled().trial.belief
    doubled = {EXCESS: 2 * belief.values[EXCESS], SLOPE: 0.0, HELD: 1.0}
    far = linearised(replace(belief.at(**doubled), held=EXCESS))
    step = dict(zip(far.fit.names, _damped_step(far, far.fit), strict=True))
    assert all(step[name] == 0 or not far.pinned(name, step[name]) for name in step)
    nearer = _downhill(far)
    assert nearer is not None
    assert misfit(nearer) < misfit(far)


@pytest.mark.soak
def test_bristles_whose_static_friction_x_does_not_show_leave_it_open() -> None:
    rig = stepped.Rig(
        "LuGre", 2.0, 800.0, 1.0, 4e-3, 3.9, kinetic=0.2 * PULL, static=0.3 * PULL, speed=2e-3, contact=2e4
    )
    quick = ss.analyze(stepped.record(rig, np.random.default_rng(11)), **rig.stated)
    tried = ss.tried(quick, twins=10)
    answer = tried.breakaway.ratio
    assert not answer.known or answer.includes(tried.record.truth[answer.name])


@pytest.mark.soak
def test_the_stiffness_of_bristles_counts_what_x_does_not_show_of_their_fall() -> None:
    # a spring that slides leaves x as well explained, with a stiffness a fifth too low and sure within a per cent
    rig = stepped.Rig(
        "LuGre", 2.594, 4513.0, 3.15, 3.875e-3, 5.01, kinetic=5.79, static=9.24, speed=0.0341, contact=1.173e5
    )
    record = stepped.record(rig, np.random.default_rng(11), noise=5e-3)
    tried = ss.tried(ss.analyze(record, **rig.stated), twins=8)
    assert tried.presliding.stiffness.includes(rig.contact)
    ratio = tried.breakaway.ratio  # of which the soak asks bristles whose static friction shows even less
    assert not ratio.known or ratio.includes(record.truth[ratio.name])
