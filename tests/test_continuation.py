"""Orbits along a parameter: closed forms on both sides of a fold, corners where the order of events changes."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.scenarios import forced


def den_hartog(ratio: float, damping: float) -> tuple[float, float, float]:
    """V, G, H of the closed form x0 = -G r +- sqrt(V^2 - H^2 r^2)."""
    d = math.sqrt(1 - damping**2)
    half = math.pi / ratio
    below = math.cosh(damping * half) + math.cos(d * half)
    response = 1 / math.hypot(1 - ratio**2, 2 * damping * ratio)
    slow = (math.sinh(damping * half) - damping / d * math.sin(d * half)) / below
    return response, slow, math.sin(d * half) / (d * ratio * below)


def test_the_response_curve_is_den_hartogs_through_resonance() -> None:
    begin = ss.steady_state(forced(0.8, 0.5, damping_ratio=0.2))
    branch = ss.solve.continue_orbit(begin, "frequency", to=1.6 / (2 * math.pi))
    assert branch.status == "complete"
    assert branch.values[-1] == 1.6 / (2 * math.pi)
    assert branch.folds == branch.changes == ()
    for value, amplitude in zip(branch.values, branch.amplitudes, strict=True):
        response, slow, half = den_hartog(2 * math.pi * value, 0.2)
        assert amplitude == pytest.approx(-slow * 0.5 + math.sqrt(response**2 - (half * 0.5) ** 2), rel=1e-12)


def test_a_fold_is_followed_around_to_the_other_orbit() -> None:
    """Negative damping makes both roots of the closed form motions; they meet at r = V / |H|, x0 = -G r."""
    response, slow, half = den_hartog(1.3, -0.1)
    stable = ss.steady_state(forced(1.3, 0.6), start={"x": 1.2})
    start = ss.solve.continue_orbit(stable, "damping", to=-0.2).orbits[-1]
    branch = ss.solve.continue_orbit(start, "kinetic", to=0.8)
    fold, *_ = branch.folds
    assert branch.values[fold] == pytest.approx(response / abs(half), rel=1e-12)
    assert branch.orbits[fold].amplitude == pytest.approx(-slow * response / abs(half), rel=1e-9)
    assert branch.orbits[fold].multipliers[0] == pytest.approx(1.0, abs=1e-7)
    for j, (value, orbit) in enumerate(zip(branch.values, branch.orbits, strict=True)):
        if sum(orbit.stops) == 0 and j != fold:
            root = math.copysign(math.sqrt(response**2 - (half * value) ** 2), fold - j)
            assert orbit.amplitude == pytest.approx(-slow * value + root, rel=1e-11)
    assert branch.orbits[fold - 1].status == "unique"
    assert branch.orbits[fold + 1].status == "unstable"
    assert sum(branch.orbits[branch.changes[0]].stops) > 0  # the lower root ends where its motion stops


def test_the_branch_turns_at_the_corner_where_sliding_begins_to_stick() -> None:
    """SHAW-1: sliding lasts while the static friction stays below b^2 x0 P; the unstable orbit meets it there."""
    ratio, load = 1.3, 0.4
    begin = ss.steady_state(forced(ratio, load, static_ratio=2.2), start={"x": 2.0}, transient=300)
    branch = ss.solve.continue_orbit(begin, "static", to=2.5, most=50)
    response, *_ = den_hartog(ratio, 0.0)
    corner = ratio**2 * math.sqrt(response**2 - (math.tan(math.pi / 2 / ratio) / ratio * load) ** 2)
    first = branch.changes[0]
    assert np.max(branch.values) == pytest.approx(corner, rel=1e-10)
    assert np.argmax(branch.values) == first - 1
    assert {orbit.status for orbit in branch.orbits[:first]} == {"unique"}
    assert {orbit.status for orbit in branch.orbits[first:]} == {"unstable"}
    assert np.all(np.diff(branch.values[first - 1 :]) < 0)


def test_sliding_goes_over_into_sticking_at_the_known_load() -> None:
    """DH-2, b = 2: the first stop at r_b = 0.596284793999..., without a jump of the amplitude."""
    begin = ss.steady_state(forced(2.0, 0.5))
    branch = ss.solve.continue_orbit(begin, "kinetic", to=0.7, step=0.02)
    assert branch.status == "complete"
    (first,) = branch.changes
    assert branch.values[first - 1] <= 0.59628479399994392 * (1 + 1e-12) <= branch.values[first]
    assert np.max(np.abs(np.diff(branch.amplitudes))) < 0.03 * branch.amplitudes[0]


@pytest.mark.parametrize(
    ("parameter", "to"), [("kinetic", math.nan), ("kinetic", -1.0), ("colour", 1.0), ("mass", 1.0), ("damper", 1.0)]
)
def test_a_branch_without_meaning_is_refused(parameter: str, to: float) -> None:
    with pytest.raises(ss.errors.ModelError):
        ss.solve.continue_orbit(ss.steady_state(forced(0.8, 0.5)), parameter, to=to)


def test_rest_of_a_belt_is_no_start() -> None:
    belt = ss.Oscillator(mass=1, stiffness=1, law=ss.laws.Coulomb(1.0, 1.5), drive=ss.drives.Belt(0.5))
    with pytest.raises(ss.errors.ModelError):
        ss.solve.continue_orbit(ss.steady_state(belt), "speed", to=1.0)


def test_a_branch_ends_where_another_order_of_events_begins_steeply() -> None:
    """At 0.595944 mm the compliant contact grazes a new pair of stops: no tangent leads over, the branch says so."""
    case = ss.systems.scenario_case("THESIS compliant c=0 5.61Hz")
    branch = ss.solve.continue_orbit(ss.steady_state(case.system), "amplitude", to=0.59e-3, step=0.5)
    end = float(branch.values[-1])
    assert branch.status == "jump"
    assert 0.59e-3 < end < 0.6e-3
    assert {orbit.stops for orbit in branch.orbits} == {(2, 0)}
    before, after = (ss.steady_state(case.system.having(amplitude=end * factor)) for factor in (1 + 1e-6, 1 - 1e-6))
    assert before.stops == (2, 0)
    assert after.stops == (2, 2)
    # a millionth beyond the end the orbit is ten times less like the last one than a millionth before it
    second = [orbit.multipliers[1].real for orbit in (branch.orbits[-1], before, after)]
    assert abs(second[0] - second[1]) < 0.1 * abs(second[0] - second[2])
