"""The engine against closed forms and 40-digit references: every scenario, every known answer."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip import scenarios
from stickslip.solve.periodic import steady_state
from stickslip.solve.simulate import simulate


def agree(found: object, known: object, tolerance: float) -> None:
    """Words and counts are equal, numbers within the tolerance; of durations each known one is among those found."""
    if isinstance(known, str | int):
        assert found == known
    elif isinstance(known, float):
        assert found == pytest.approx(known, rel=tolerance)
    else:
        raise AssertionError(f"nothing is known of {known!r}")


@pytest.mark.parametrize("name", scenarios.names())
def test_a_scenario_has_its_known_answers(name: str) -> None:
    scenario = scenarios.get(name)
    for question, found in scenarios.answers(scenario).items():
        known = scenario.known[question]
        if question in ("slips", "sticks"):
            # the reference lists half of a symmetric cycle: each duration occurs, and nothing else does
            scale = max(known)
            for duration in known:
                assert min(abs(duration - other) for other in found) <= 1e-10 * scale, question
            for duration in found:
                assert min(abs(duration - other) for other in known) <= 1e-10 * scale, question
        elif isinstance(known, list) and question != "stops":
            scale = max(map(abs, known))
            assert np.allclose(found[: len(known)], known, rtol=0, atol=scenario.tolerance * scale), question
        elif question == "multiplier":
            # over the half cycle the reference states 9 to 12 digits
            assert found == pytest.approx(known, rel=1e-9), question
        elif isinstance(known, list):
            assert found == known, question
        else:
            agree(found, known, scenario.tolerance)


def test_the_whole_grid_of_stops() -> None:
    grid = scenarios.grid("HL-1")
    for i, ratio in enumerate(grid["ratios"]):
        for j, load in enumerate(grid["loads"]):
            orbit = steady_state(scenarios.forced(ratio, load))
            assert orbit.stops == (grid["normal"][i][j], grid["abnormal"][i][j]), (ratio, load)


@pytest.mark.parametrize("row", scenarios.grid("DH-2")["boundary"], ids=str)
@pytest.mark.parametrize("side", [-1, 1])
def test_the_non_stop_boundary_at_1e_12(row: list[float], side: int) -> None:
    ratio, damping, boundary = row
    system = scenarios.forced(ratio, boundary * (1 + side * 1e-12), damping_ratio=damping)
    if damping == 0 and abs(1 / ratio / 2 - round(1 / ratio / 2)) < 1e-12:
        pytest.skip("a family of orbits: no boundary of its own")
    orbit = steady_state(system, start={"x": 2.0})
    stopped = sum(orbit.stops) > 0
    assert stopped == (side > 0), (orbit.stops, orbit.status)


def test_the_limits_of_the_boundary() -> None:
    """DH-4: pi/4 at resonance, 1 / sqrt(1 + pi^2/4) at high frequency."""
    for ratio, limit, close in ((1 + 1e-4, math.pi / 4, 1e-3), (50.0, 1 / math.sqrt(1 + math.pi**2 / 4), 1e-3)):
        systems = [scenarios.forced(ratio, limit * (1 + side * close)) for side in (-1, 1)]
        below, above = (steady_state(system, start={"x": 1.0}) for system in systems)
        assert sum(below.stops) == 0
        assert sum(above.stops) > 0 or above.status == "rest"


@pytest.mark.parametrize(
    ("ratio", "static_ratio", "critical"), [(1.3, 1.2, 0.67439793790955632), (0.8, 1.5, 0.72697564257968176)]
)
def test_static_friction_moves_the_boundary(ratio: float, static_ratio: float, critical: float) -> None:
    """SHAW-1: r_c = V / sqrt(U^2 + (rho_s / b^2)^2), from a sliding start (rest attracts as well)."""
    for side in (-1, 1):
        system = scenarios.forced(ratio, critical * (1 + side * 1e-10), static_ratio=static_ratio)
        x0 = math.sqrt((1 / (1 - ratio**2)) ** 2 - (math.tan(math.pi / 2 / ratio) / ratio * critical) ** 2)
        motion = simulate(system, cycles=2000, start=sliding(ratio, critical, x0))
        sticks = sum(event.kind == "stick" for event in motion.events)
        assert (sticks > 0) == (side > 0)


def sliding(ratio: float, load: float, amplitude: float) -> dict[str, float]:
    """A state on the sliding orbit at phase 0: marched there from its turning point by the orbit of lower static."""
    orbit = steady_state(scenarios.forced(ratio, load), start={"x": amplitude})
    state = orbit.orbit.states[0]
    return {"x": float(state[0]), "v": float(state[1])}


def test_negative_damping_loses_stability() -> None:
    """SHAW-3: det J = 1 at zeta_c = -0.0722590314..."""
    critical = -0.072259031436387934
    for side, status in ((-1, "unstable"), (1, "unique")):
        near = scenarios.forced(1.3, 0.4, damping_ratio=critical * (1 - side * 1e-3))
        start = steady_state(scenarios.forced(1.3, 0.4, damping_ratio=-0.05), start={"x": 1.2}).orbit.states[0]
        orbit = steady_state(near, start={"x": float(start[0]), "v": float(start[1])}, transient=1)
        assert orbit.status == status
    law = [abs(steady_state(scenarios.forced(1.3, 0.4, damping_ratio=critical * f), start={"x": 1.2, "v": 0.0},
                            transient=1).multipliers[0]) for f in (0.999, 1.0)]  # fmt: skip
    assert law[0] < 1
    assert law[1] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_fast_belt_is_not_stuck_to_again(side: int) -> None:
    """BS-4: from break-away, with a damper, stick is met again below V_c = 0.549046312057... alone."""
    speed = 0.54904631205793635 * (1 + side * 1e-10)
    system = ss.Oscillator(mass=1, stiffness=1, damping=0.1, law=ss.Coulomb(1.0, 1.5), drive=ss.Belt(speed))
    run = simulate(system, duration=100, start={"x": 1.5 - 0.1 * speed, "v": speed})
    assert any(event.kind == "stick" for event in run.events) == (side < 0)
