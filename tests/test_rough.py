"""Friction that fluctuates along the surface."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import ModelError

SURFACE = {"share": 0.03, "length": 1e-4, "span": 2e-3, "seed": 3}


def slider(law: object, amplitude: float = 0.65e-3) -> ss.Oscillator:
    drive = ss.drives.HarmonicBase(amplitude, frequency=2.5)
    return ss.Oscillator(mass=2.42, stiffness=2310, damping=0.12, law=law, drive=drive)  # type: ignore[arg-type]


def test_sliding_friction_is_the_profile_of_the_place() -> None:
    law = ss.laws.RoughSurface(ss.laws.Coulomb(1.1), **SURFACE)
    record = ss.simulate(slider(law), cycles=10).record(fs=2000)
    slides = np.abs(record["v"]) > 1e-4
    expected = 1.1 * np.interp(record["x"], *law.knots.T) * np.sign(record["v"])
    assert np.abs(record["friction"] - expected)[slides].max() < 1e-12


def test_an_even_surface_is_the_contact_itself() -> None:
    contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    even = ss.simulate(slider(ss.laws.RoughSurface(contact, **{**SURFACE, "share": 0.0})), cycles=6)
    plain = ss.simulate(slider(contact), cycles=6)
    assert [event.kind for event in even.events] == [event.kind for event in plain.events]
    times = np.array([[event.time for event in run.events] for run in (even, plain)])
    assert np.abs(times[0] - times[1]).max() < 1e-10
    assert even.state(2.2)["x"] == pytest.approx(plain.state(2.2)["x"], abs=1e-13)


def test_the_fluctuation_has_the_share_that_was_asked() -> None:
    profiles = [ss.laws.RoughSurface(ss.laws.Coulomb(1.0), **{**SURFACE, "seed": seed}) for seed in range(40)]
    places = np.linspace(-2e-3, 2e-3, 801)
    spread = np.std([np.interp(places, *surface.knots.T) for surface in profiles])
    assert spread == pytest.approx(0.03, rel=0.05)


def test_energy_is_balanced() -> None:
    for contact in (ss.laws.Coulomb(1.1, static=1.3), ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)):
        balance = ss.solve.energy(ss.simulate(slider(ss.laws.RoughSurface(contact, **SURFACE)), cycles=10))
        assert abs(balance.residual) < 1e-12 * balance.turnover


def test_a_start_far_out_finds_its_cell() -> None:
    law = ss.laws.RoughSurface(ss.laws.Coulomb(1.1), **SURFACE)
    free = ss.Oscillator(mass=2.42, stiffness=2310, law=law)
    run = ss.simulate(free, duration=0.01, start={"x": 5e-3, "v": 0.01})
    assert run.state(0.0)["friction"] == pytest.approx(1.1 * law.profile(5e-3), rel=1e-12)


@pytest.mark.parametrize("static", [1.1, 1.4])
def test_rest_is_held_by_the_friction_of_its_place_alone(static: float) -> None:
    law = ss.laws.RoughSurface(ss.laws.Coulomb(1.1, static), **{**SURFACE, "share": 0.2})
    knots = law.knots[::3, 0]
    for x in (*knots, *np.random.default_rng(0).uniform(1.2 * knots[0], 1.2 * knots[-1], 20)):
        free = ss.Oscillator(mass=2.42, stiffness=2310, law=law)
        run = ss.simulate(free, duration=2.0, start={"x": float(x)})
        rest = run.state(2.0)
        assert (len(run.events) == 0) == (2310 * abs(x) <= static * law.profile(x))
        assert abs(rest["friction"]) <= static * law.profile(rest["x"]) * (1 + 1e-12)


@pytest.mark.parametrize(
    "wrong",
    [
        {"share": -0.1},
        {"share": 0.5},
        {"length": 0.0},
        {"span": np.nan},
        {"length": 1e-6},
        {"contact": ss.laws.LinearSlope(1.0, slope=0.1)},
        {"contact": ss.laws.CompliantContact(1.1, stiffness=1e5, damping=10, rule="consistent")},
    ],
)
def test_what_makes_no_sense_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ModelError):
        ss.laws.RoughSurface(**{"contact": ss.laws.Coulomb(1.1), **SURFACE, **wrong})
