"""Modes with a rate far above the motion's: split into what dies and what goes on, without approximation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip import drives, laws
from stickslip.errors import SolveError
from stickslip.solve import assembly, settling
from stickslip.solve.assembly import table_of

MASS, SPRING, DAMPING, FORCE, STIFFNESS = 2.42, 2310.0, 0.1, 1.1, 192000.0
AMPLITUDE, FREQUENCY = 0.65e-3, 2.5


def contact(damping: float) -> ss.Oscillator:
    law = laws.CompliantContact(FORCE, STIFFNESS, damping, rule="consistent")
    return ss.Oscillator(MASS, SPRING, law, drives.HarmonicForce(SPRING * AMPLITUDE, FREQUENCY), DAMPING)


def by_radau(damping: float, until: float) -> tuple[list[tuple[float, int]], list[float]]:
    """Events (time, side entered) and the state (x, v, deflection y) at the end.

    Microstick: f = K_y y + c y', y' = v. Slip: f = +-f_k, K_y y + c y' = +-f_k, until the slider has no
    speed: v - y' = 0.
    """
    omega, events = 2 * math.pi * FREQUENCY, list[tuple[float, int]]()
    time, state, side = 0.0, [0.0, 0.0, 0.0], 0

    def moved(t: float, s: np.ndarray) -> list[float]:
        friction = side * FORCE if side else STIFFNESS * s[2] + damping * s[1]
        push = SPRING * AMPLITUDE * math.cos(omega * t) - SPRING * s[0] - DAMPING * s[1]
        return [s[1], (push - friction) / MASS, (side * FORCE - STIFFNESS * s[2]) / damping if side else s[1]]

    def gives_way(sign: int):  # type: ignore[no-untyped-def]
        def event(t: float, s: np.ndarray) -> float:
            if side:
                return float(-side * (s[1] - (side * FORCE - STIFFNESS * s[2]) / damping)) if sign > 0 else -1.0
            return float(sign * (STIFFNESS * s[2] + damping * s[1]) - FORCE)

        event.terminal, event.direction = True, 1  # type: ignore[attr-defined]
        return event

    while time < until:
        ways = [gives_way(1), gives_way(-1)]
        small = [1e-15, 1e-13, 1e-17]
        part = solve_ivp(moved, (time, until), state, "Radau", events=ways, rtol=1e-11, atol=small, first_step=1e-9)
        time, state = part.t[-1], list(part.y[:, -1])
        if part.status != 1:
            break
        side = 0 if side else (1 if len(part.t_events[0]) else -1)
        events.append((time, side))
    return events, state


@pytest.mark.parametrize("damping", [1e-2, 1e-6])
def test_a_contact_with_next_to_no_damping_moves_as_radau_has_it(damping: float) -> None:
    system = contact(damping)
    run = ss.simulate(system, cycles=1)
    events, state = by_radau(damping, 1 / FREQUENCY)
    assert len(events) > 3
    assert [event.side for event in run.events] == [side for _, side in events]
    np.testing.assert_allclose([event.time for event in run.events], [time for time, _ in events], rtol=0, atol=1e-10)
    end = run.state(run.duration)
    assert end["x"] == pytest.approx(state[0], abs=1e-9 * AMPLITUDE)
    assert end["v"] == pytest.approx(state[1], abs=1e-9 * AMPLITUDE * 2 * math.pi * FREQUENCY)
    assert abs(ss.solve.energy(run).residual) < 1e-9


def test_a_contact_mass_with_two_fast_rates_is_split_where_both_are_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """5e10/s and 3e7/s beside 8e3/s: neither gap is 1e4 wide, both together are; 150 s of cells were foretold.

    It moves as it does unsplit; and as one without mass does, but for the mass that it has.
    """
    force, stiffness, damping = 26.555645105020904, 2297261522527.2607, 81806.7746916635
    light = laws.InertialContact(force, stiffness, 1.564546886139168e-06, damping)
    system = ss.Oscillator(
        0.40396298776840983,
        24642310.779102024,
        light,
        drives.HarmonicForce(120.11152897477314, 9.748099098479683),
        damping=631.0176380369647,
    )
    run = ss.simulate(system, duration=0.0096)
    assert run.table.settling
    assert ss.solve.energy(run).residual < 1e-9
    massless = laws.InSeries(laws.Coulomb(force), stiffness, damping)
    other = ss.simulate(system.having(law=massless), duration=0.0096)
    times = np.linspace(0, 0.0096, 500)
    ours, theirs = (each.sample(times, ("x",))[0][0] for each in (run, other))
    assert ours == pytest.approx(theirs, abs=light.mass / system.mass * np.max(np.abs(theirs)))
    monkeypatch.setattr(settling, "APART", math.inf)
    assembly._known.cache_clear()
    whole = ss.simulate(system, duration=5e-5)
    times = np.linspace(0, 5e-5, 500)
    ours, theirs = (each.sample(times, ("x",))[0][0] for each in (run, whole))
    assembly._known.cache_clear()
    assert not whole.table.settling
    assert ours == pytest.approx(theirs, abs=1e-9 * np.max(np.abs(theirs)))


def test_it_takes_few_pieces_and_no_event_of_its_own() -> None:
    run = ss.simulate(contact(1e-6), cycles=10)
    rough = ss.simulate(contact(1.0), cycles=10)
    assert [event.kind for event in run.events] == [event.kind for event in rough.events]
    assert len(run.durations) < 2 * len(run.events) + 2


def test_split_and_whole_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    system = contact(3.0)
    whole = ss.simulate(system, cycles=2)
    assert not whole.table.settling
    monkeypatch.setattr(settling, "APART", 100.0)
    assembly._known.cache_clear()
    split = ss.simulate(system, cycles=2)
    assembly._known.cache_clear()
    assert split.table.settling
    assert [event[1:] for event in split.events] == [event[1:] for event in whole.events]
    times = [event.time for event in split.events], [event.time for event in whole.events]
    np.testing.assert_allclose(*times, rtol=0, atol=1e-13)
    grid = np.linspace(0.0, whole.duration, 500)
    for name in ("x", "v", "friction"):
        wanted = whole.sample(grid, (name,))[0]
        np.testing.assert_allclose(split.sample(grid, (name,))[0], wanted, rtol=0, atol=1e-11 * np.max(np.abs(wanted)))


def test_the_steady_state_and_the_derivatives_are_those_of_the_whole() -> None:
    # ratios of rates on both sides of the limit: what is split and what is not go over into each other
    near, far = contact(STIFFNESS / (0.98e4 * 30.9)), contact(STIFFNESS / (1.02e4 * 31.0))
    assert [bool(table_of(system).settling) for system in (near, far)] == [False, True]
    one, other = ss.steady_state(near), ss.steady_state(far)
    assert other.status == one.status
    np.testing.assert_allclose(np.abs(other.multipliers), np.abs(one.multipliers), rtol=0.1, atol=1e-3)
    slopes = [ss.simulate(system, cycles=2) for system in (near, far)]
    grid = np.linspace(0.01, 0.8, 50)
    a, b = (ss.solve.sensitivities(run, "kinetic").sample(grid, "x") for run in slopes)
    np.testing.assert_allclose(b, a, rtol=0, atol=1e-3 * np.max(np.abs(a)))


def test_a_fast_mass_in_the_contact() -> None:
    law = laws.InertialContact(FORCE, STIFFNESS, 1e-9, 1e-3)
    run = ss.simulate(
        ss.Oscillator(MASS, SPRING, law, drives.HarmonicForce(SPRING * AMPLITUDE, FREQUENCY), DAMPING), cycles=1
    )
    assert abs(ss.solve.energy(run).residual) < 1e-9


def test_what_16_digits_can_not_tell_is_refused_for_its_rates() -> None:
    with pytest.raises(SolveError, match="far above the motion's own"):
        ss.simulate(contact(1e-14), cycles=1)
