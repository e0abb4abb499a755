"""Hunting of a servo loop: against another integrator, closed forms, no hunting where none is, what is refused."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from stickslip.errors import ModelError
from stickslip.laws import CompliantContact, Coulomb, LinearSlope
from stickslip.squeak import servo_hunting as hunting

JOINT = {"inertia": 0.02, "kp": 18.0}


@numba.njit(cache=True)
def rests(loop, kinetic, static, start, dt, steps, most=np.inf, fastest=np.inf):  # type: ignore[no-untyped-def]
    """Times and places at which a loop comes to rest, by short steps in which friction takes off what it can.

    Its drive saturates, and its torque follows what the controller asks for at a limited rate.
    """
    inertia, kp, ki, kd = loop
    times, places = [0.0], [start]
    x, v, integral, held, torque = start, 0.0, 0.0, True, -loop[1] * start
    for i in range(steps):
        integral += dt * x
        asked = min(max(-kp * x - ki * integral - kd * v, -most), most)
        torque += min(max(asked - torque, -fastest * dt), fastest * dt)
        level = static if held else kinetic
        free = v + dt * torque / inertia
        taken = dt * level / inertia
        v = free - taken if free > taken else free + taken if free < -taken else 0.0
        x += dt * v
        if v == 0.0 and not held:
            times.append(i * dt)
            places.append(x)
        held = v == 0.0
    return times, places


@pytest.mark.parametrize(("static", "ki", "kd"), [(0.08, 60.0, 0.1), (0.12, 40.0, 0.3)])
def test_an_integrator_of_another_kind_hunts_alike(static, ki, kd) -> None:
    found = hunting(Coulomb(0.06, static=static), **JOINT, ki=ki, kd=kd)
    start = 1.2 * found.amplitude
    times, places = rests((*JOINT.values(), ki, kd), 0.06, static, start, 2e-6, round(40 / 2e-6))
    assert found.lasts
    assert np.abs(places[-2:]) == pytest.approx(found.amplitude, rel=0.02)
    assert places[-1] * places[-2] < 0
    assert times[-1] - times[-3] == pytest.approx(1 / found.frequency, rel=0.02)


def test_a_drive_with_limits_hunts_the_same_until_it_can_not_break_away() -> None:
    law, gains = Coulomb(0.06, static=0.08), {**JOINT, "ki": 60.0, "kd": 0.1}
    free = hunting(law, **gains)
    assert free.torque == pytest.approx(0.08, rel=1e-6)  # static friction, as it breaks away
    limits = {"most": 1.02 * free.torque, "fastest": 1.05 * free.torque_rate}
    assert hunting(law, **gains, **limits) == free
    settings = ((*JOINT.values(), 60.0, 0.1), 0.06, 0.08, 1.2 * free.amplitude, 2e-6, round(40 / 2e-6))
    times, places = rests(*settings, *limits.values())
    assert np.abs(places[-2:]) == pytest.approx(free.amplitude, rel=0.02)
    assert times[-1] - times[-3] == pytest.approx(1 / free.frequency, rel=0.02)
    weak = 0.99 * 0.08
    assert not hunting(law, **gains, most=weak).lasts
    assert rests(*settings, weak)[1] == [1.2 * free.amplitude]  # where it began
    with pytest.raises(ModelError, match=r"fastest = .* simulate the drive"):
        hunting(law, **gains, fastest=0.5 * free.torque_rate)


def test_without_damping_a_slip_has_a_closed_form() -> None:
    """A weak integral hardly changes while it slips: the mass swings by twice what static friction exceeds."""
    found = hunting(Coulomb(0.06, static=0.08), **JOINT, ki=1e-3, kd=1e-5)
    assert 2 * found.amplitude == pytest.approx(2 * 0.02 / JOINT["kp"], rel=1e-3)
    wound = 2 * (0.08 - 0.06 + 0.06) / 1e-3  # the integral from one side's level to the other's, less what x has
    rest = (wound - 2 * JOINT["kp"] * found.amplitude / 1e-3) / found.amplitude
    assert found.frequency == pytest.approx(0.5 / rest, rel=1e-2)


@pytest.mark.parametrize("law", [Coulomb(0.06), LinearSlope(0.06, slope=0.1)])
def test_it_does_not_hunt_without_static_friction_above_the_kinetic(law) -> None:
    found = hunting(law, **JOINT, ki=40.0, kd=0.2)
    assert (found.amplitude, found.lasts) == (0.0, False)


def test_damping_makes_it_smaller_and_more_integral_faster() -> None:
    law = Coulomb(0.06, static=0.08)
    some, damped, faster = (hunting(law, **JOINT, ki=ki, kd=kd) for ki, kd in ((20, 0.1), (20, 0.5), (40, 0.1)))
    assert damped.amplitude < some.amplitude
    assert faster.frequency > 1.8 * some.frequency


@pytest.mark.parametrize(
    ("law", "changes", "words"),
    [
        (Coulomb(0.06, static=0.08), {"ki": 1e4}, "unstable"),
        (Coulomb(0.06, static=0.08), {"ki": 0.0}, "positive"),
        (CompliantContact(0.06, stiffness=1e3), {}, "Coulomb or LinearSlope"),
    ],
)
def test_what_has_no_answer_is_refused(law, changes, words) -> None:
    with pytest.raises(ModelError, match=words):
        hunting(law, **{**JOINT, "ki": 40.0, "kd": 0.1, **changes})
