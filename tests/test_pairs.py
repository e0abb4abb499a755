"""Materials by name: Hertz and Mindlin in closed form, and a sphere's loop by Masing's rule."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss

LOAD, RADIUS = 3.53, 5e-3


def test_equal_materials_have_mindlin_s_stiffness() -> None:
    """Of one material on itself K over the normal stiffness 2 E* a is 2 (1 - nu)/(2 - nu)."""
    steel = ss.laws.pair("steel on steel")
    radius = (0.75 * LOAD * RADIUS / steel.modulus) ** (1 / 3)
    ratio = steel.stiffness(LOAD, radius=RADIUS) / (2 * steel.modulus * radius)
    assert ratio == pytest.approx(2 * (1 - 0.31) / (2 - 0.31), rel=1e-12)


def test_a_sphere_s_loop_loses_what_mindlin_and_deresiewicz_say() -> None:
    """Energy of a cycle between -F and F, F a part of f_k (Mindlin and Deresiewicz 1953), and the curve from rest."""
    kinetic, stiffness, share = 1.1, 192e3, 0.6
    slip = 1.5 * kinetic / stiffness
    reach = slip * (1 - (1 - share) ** (2 / 3))
    law = ss.laws.ElastoSlip.mindlin(kinetic, stiffness=stiffness, elements=80)
    drive = ss.drives.Imposed(ss.drives.HarmonicBase(reach, frequency=1.0, phase=-math.pi / 2))
    run = ss.simulate(ss.Oscillator(1.0, 1.0, law, drive), cycles=2)
    times = np.linspace(1.0, 2.0, 20001)
    x, friction = run.sample(times, ("x", "friction"))[0]
    lost = np.trapezoid(friction, x)
    left = 1 - share
    deresiewicz = 6 / 5 * (1 - left ** (5 / 3)) - share * (1 + left ** (2 / 3))
    assert np.max(friction) == pytest.approx(share * kinetic, rel=2e-3)
    assert lost == pytest.approx(4 * kinetic * slip * deresiewicz, rel=0.02)


def test_a_loss_factor_is_twice_the_damping_ratio_of_what_rings() -> None:
    rubber = ss.laws.pair("wet rubber on steel")
    contact = rubber.contact(LOAD, radius=RADIUS, mass=2.42)
    ratio = contact.damping / (2 * math.sqrt(contact.stiffness * 2.42))
    assert ratio == pytest.approx(rubber.loss / 2, rel=1e-12)
    assert rubber.loss == pytest.approx(0.1, rel=1e-3), "steel gives way a hundred thousandth of what rubber does"


def test_every_pair_says_where_its_numbers_are_from() -> None:
    for name in ("steel on steel", "aluminium on steel", "Teflon on steel", "rubber on steel", "wet rubber on steel"):
        pair = ss.laws.pair(name)
        assert pair.static >= pair.kinetic > 0
        assert all(len(source) > 10 for source in pair.sources)


def test_an_unknown_pair_is_refused() -> None:
    with pytest.raises(ss.errors.ModelError, match=r"a pair 'ice on steel'.*known are steel on steel"):
        ss.laws.pair("ice on steel")
