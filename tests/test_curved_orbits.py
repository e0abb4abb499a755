"""Steady orbits, multipliers and exponents of curved laws, against variational equations by a general solver and the
exact engine."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stickslip as ss

DRIVE = ss.drives.HarmonicBase(0.6e-3, 2.5)
SMOOTH = ss.Oscillator(
    mass=2.42, stiffness=2310, law=ss.laws.SmoothStateVariable(1.1, rate=100.0, steepness=3000.0), drive=DRIVE
)
LUGRE = SMOOTH.having(law=ss.laws.LuGre(1.1, 1.3, speed=1e-3, stiffness=192000, damping=24, viscous=0.4))


def smooth_flow(t: float, s: np.ndarray) -> tuple[list[float], np.ndarray]:
    """Rates and their derivative of the thesis's state variable."""
    x, v, theta = s
    base = 0.6e-3 * math.cos(2 * math.pi * 2.5 * t)
    level = math.tanh(3000 * v)
    rate = [v, (2310 * (base - x) - theta) / 2.42, 110.0 * (1.1 * level - theta)]
    return rate, np.array([[0, 1, 0], [-2310 / 2.42, 0, -1 / 2.42], [0, 110 * 1.1 * 3000 * (1 - level**2), -110.0]])


def lugre_flow(t: float, s: np.ndarray) -> tuple[list[float], np.ndarray]:
    x, v, z = s
    base, side = 0.6e-3 * math.cos(2 * math.pi * 2.5 * t), math.copysign(1.0, v)
    fall = 0.2 * math.exp(-((v / 1e-3) ** 2))
    level, falls = 1.1 + fall, fall * -2 * v / 1e-6
    rate = v - 192000 * abs(v) * z / level
    by_v = 1 - 192000 * z * (side / level - abs(v) * falls / level**2)
    by_z = -192000 * abs(v) / level
    push = 2310 * (base - x) - 192000 * z - 24 * rate - 0.4 * v
    row = [-2310 / 2.42, -(24 * by_v + 0.4) / 2.42, -(192000 + 24 * by_z) / 2.42]
    return [v, push / 2.42, rate], np.array([[0, 1, 0], row, [0, by_v, by_z]])


@pytest.mark.parametrize(("system", "flow"), [(SMOOTH, smooth_flow), (LUGRE, lugre_flow)], ids=["smooth", "lugre"])
def test_multipliers_are_those_of_the_variational_equations(system: ss.Oscillator, flow: object) -> None:
    orbit = ss.steady_state(system)
    assert (orbit.status, orbit.order, orbit.period) == ("unique", 1, 0.4)

    def rates(t: float, s: np.ndarray) -> np.ndarray:
        rate, slope = flow(t, s[:3])  # type: ignore[operator]
        return np.concatenate([rate, (slope @ s[3:].reshape(3, 3)).ravel()])

    begin = np.concatenate([orbit.orbit.states[0, :3], np.eye(3).ravel()])
    turns = [0.0, *(event.time for event in orbit.events), 0.4]
    for low, high in itertools.pairwise(turns):
        step = solve_ivp(rates, (low, high), begin, method="DOP853", rtol=1e-11, atol=1e-14, max_step=2e-3)
        begin = step.y[:, -1]
    assert begin[:3] == pytest.approx(orbit.orbit.states[0, :3], rel=1e-7, abs=1e-10)
    known = np.linalg.eigvals(begin[3:].reshape(3, 3))
    known = known[np.argsort(-np.abs(known))]
    assert orbit.multipliers == pytest.approx(known, abs=2e-7)
    assert ss.solve.energy(orbit.orbit).residual < 1e-12


@pytest.mark.parametrize("frequency", [2.5, 8.7])
@pytest.mark.parametrize(
    ("curved", "linear"),
    [
        (ss.laws.Stribeck(1.1, 1.1, speed=1.0), ss.laws.Coulomb(1.1)),
        (ss.laws.FrictionCurve(lambda v: 1.1 - 2.0 * v, static=1.2), ss.laws.LinearSlope(1.1, slope=-2.0, static=1.2)),
    ],
)
def test_a_curve_without_curvature_has_the_exact_engines_orbit(
    curved: object, linear: object, frequency: float
) -> None:
    known = ss.steady_state(SMOOTH.having(law=linear, frequency=frequency))
    orbit = ss.steady_state(SMOOTH.having(law=curved, frequency=frequency))
    assert (orbit.status, orbit.order, orbit.stops) == (known.status, known.order, known.stops)
    assert [event.time for event in orbit.events] == pytest.approx([event.time for event in known.events], rel=1e-10)
    assert orbit.amplitude == pytest.approx(known.amplitude, rel=1e-11)
    assert orbit.multipliers == pytest.approx(known.multipliers, abs=1e-8)


def test_sliding_without_stops_keeps_its_complex_multipliers() -> None:
    """An orbit that never sticks: the determinant of the map is that of the damping and the slope alone."""
    system = ss.Oscillator(
        mass=1, stiffness=1, law=ss.laws.Stribeck(0.3, 0.3, speed=1.0), drive=ss.drives.HarmonicForce(1.0, 0.1)
    )
    orbit = ss.steady_state(system)
    known = ss.steady_state(system.having(law=ss.laws.Coulomb(0.3)))
    assert orbit.multipliers == pytest.approx(known.multipliers, abs=1e-8)
    assert np.prod(orbit.multipliers) == pytest.approx(np.prod(known.multipliers), abs=1e-8)


def test_a_belt_under_falling_friction_has_its_stick_slip_cycle() -> None:
    popp = ss.laws.FrictionCurve(lambda v: 10 * (0.3 / (1 + 1.42 * v) + 0.1 + 0.01 * v * v))
    system = ss.Oscillator(mass=1, stiffness=1, law=popp, drive=ss.drives.Belt(0.5))
    orbit = ss.steady_state(system)
    run = ss.simulate(system, duration=60)
    ends = [event.time for event in run.events if event.kind == "slip"]
    assert (orbit.status, orbit.stops) == ("unique", (0, 1))
    assert orbit.period == pytest.approx(ends[-1] - ends[-2], rel=1e-11)
    assert ss.solve.energy(orbit.orbit).residual < 1e-12
    assert orbit.orbit.state(orbit.period / 3)["x"] == pytest.approx(run.state(ends[-2] + orbit.period / 3)["x"])


def test_a_belt_under_a_law_that_never_holds_has_its_cycle_too() -> None:
    law = ss.laws.LuGre(1.0, 1.5, speed=1e-3, stiffness=1e5, damping=math.sqrt(1e5), viscous=0.4)
    system = ss.Oscillator(mass=1, stiffness=2, law=law, drive=ss.drives.Belt(0.1))
    orbit = ss.steady_state(system, transient=16)
    assert (orbit.status, orbit.period) == ("unique", pytest.approx(6.36271982, abs=1e-8))
    assert np.max(np.abs(orbit.multipliers)) < 1e-6
    assert ss.solve.energy(orbit.orbit).residual < 1e-12
    assert ss.steady_state(system.having(drive=ss.drives.Ramp(0.1)), transient=4).status == "not periodic"


def test_what_is_put_off_a_belts_cycle_returns_by_its_multiplier() -> None:
    law = ss.laws.LuGre(1.0, 1.2, speed=0.5, stiffness=400.0, damping=5.0)
    system = ss.Oscillator(mass=1, stiffness=2, law=law, drive=ss.drives.Belt(0.6))
    orbit = ss.steady_state(system)
    x, _, bristle = orbit.orbit.states[0, :3]
    mode = orbit.orbit.table.modes[orbit.orbit.modes[0]].name
    run = ss.simulate(
        system,
        duration=3.5 * orbit.period,
        rtol=1e-14,
        start={"x": x + 1e-5, "v": 0.0, "bristle": bristle, "mode": mode},
    )
    offs = []
    for lap in (1, 2, 3):  # where the velocity rises through zero, near the end of each lap
        near = (lap - 0.05) * orbit.period, (lap + 0.05) * orbit.period
        offs.append(run.state(brentq(lambda t: run.state(t)["v"], *near, xtol=1e-14))["x"] - x)
    assert offs[1] / offs[0] == pytest.approx(orbit.multipliers[0].real, rel=1e-4)
    assert offs[2] / offs[1] == pytest.approx(orbit.multipliers[0].real, rel=1e-4)


def test_a_branch_of_a_curved_law_ends_at_the_orbit_found_there() -> None:
    system = SMOOTH.having(law=ss.laws.Stribeck(1.1, 1.3, speed=1e-3, viscous=0.4))
    branch = ss.solve.continue_orbit(ss.steady_state(system), "frequency", to=2.6, step=0.5)
    assert branch.status == "complete"
    there = ss.steady_state(system.having(frequency=2.6))
    assert branch.amplitudes[-1] == pytest.approx(there.amplitude, rel=1e-9)


def test_the_exponent_of_a_stable_orbit_is_the_logarithm_of_its_multiplier() -> None:
    system = SMOOTH.having(law=ss.laws.Stribeck(1.1, 1.3, speed=1e-3, viscous=0.4), frequency=8.7)
    exponent = ss.solve.lyapunov(system, cycles=50, transient=20)
    multiplier = abs(ss.steady_state(system).multipliers[0])
    assert exponent.value == pytest.approx(math.log(multiplier) * 8.7, rel=1e-6)


def test_starts_that_lead_to_one_orbit_find_it_once() -> None:
    assert len(ss.solve.attractors(LUGRE, starts=[{}, {"x": 3e-4}])) == 1


@pytest.mark.parametrize("question", [ss.steady_state, ss.solve.lyapunov])
def test_a_law_with_a_lag_is_refused_in_words(question: object) -> None:
    law = ss.laws.TimeDelay(ss.laws.LinearSlope(1.0, slope=1.0), lag=0.1)
    with pytest.raises(ss.errors.ModelError, match="time lag"):
        question(SMOOTH.having(law=law))  # type: ignore[operator]


@pytest.mark.parametrize("start", [{}, {"x": 8e-3}], ids=["from the belt's start", "from equilibrium"])
@pytest.mark.parametrize(
    "law",
    [
        ss.laws.Coulomb(2.0),
        ss.laws.Coulomb(2.0, static=3.0),
        ss.laws.FrictionCurve(lambda v: 2.0 + 0.0 * v, static=3.0),
        ss.laws.LuGre(2.0, 2.0, speed=0.1, stiffness=1e5, damping=300.0),
    ],
    ids=lambda law: type(law).__name__,
)
def test_a_belt_that_is_fast_enough_leaves_steady_sliding(law: object, start: dict[str, float]) -> None:
    """It was said not to be periodic, with the displacement of the beginning for an amplitude."""
    system = ss.Oscillator(1.3, 250.0, law, ss.drives.Belt(0.16), damping=0.721)
    orbit = ss.steady_state(system, start=start)
    assert orbit.status == "steady sliding"
    assert orbit.amplitude == pytest.approx(2.0 / 250.0, rel=1e-5)
