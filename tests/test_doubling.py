"""Where orbits double their period, branch off, and how such places move in the plane of two parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip import drives, laws, solve

MOON = ss.Oscillator(1.0, 1.0, laws.PositionLoad(1.0, 1.5), drives.HarmonicForce(1.2, 1.25 / (2 * math.pi)), 0.03)


@pytest.fixture(scope="module")
def branch() -> solve.Branch:
    """Feeny and Moon's oscillator on its way to chaos."""
    return solve.continue_orbit(ss.steady_state(MOON, orders=1), "amplitude", to=1.35)


def test_a_branch_of_twice_the_period_comes_off(branch: solve.Branch) -> None:
    """Near the doubling the new orbit's multiplier is 1 - 2 (mu^2 - 1), mu that of the old one: the normal form."""
    (j,) = solve.period_doublings(branch)
    old = branch.orbits[j]
    assert (branch.orbits[j - 1].status, old.status) == ("unique", "unstable")
    new = solve.doubled(old)
    assert (new.order, new.status) == (2, "unique")
    assert new.multipliers[0].real == pytest.approx(1 - 2 * (old.multipliers[0].real ** 2 - 1), abs=0.01)
    state, _ = new.orbit.end()
    np.testing.assert_allclose(state, new.orbit.states[0], atol=1e-11)
    on = solve.continue_orbit(new, "amplitude", to=1.32)
    assert on.status == "complete"
    assert on.orbits[-1].order == 2
    with pytest.raises(ss.errors.ModelError, match="below -1"):
        solve.doubled(branch.orbits[0])


def test_the_doubling_moves_with_the_damping(branch: solve.Branch) -> None:
    curve = solve.locus(branch, kind="doubling", parameter="damping", values=[0.03, 0.05])
    assert curve.parameters == ("amplitude", "damping")
    for (amplitude, damping), orbit in zip(curve.points, curve.orbits, strict=True):
        assert orbit is not None
        assert orbit.multipliers[0].real == pytest.approx(-1.0, abs=1e-6)
        assert orbit.orbit.system.drive.amplitude == pytest.approx(amplitude, abs=1e-8)
        assert orbit.orbit.system.damping == damping
    assert curve.points[1, 0] > curve.points[0, 0]
    with pytest.raises(ss.errors.ModelError, match="without a fold"):
        solve.locus(branch, kind="fold", parameter="damping", values=[0.03])


def test_grazing_moves_as_den_hartogs_boundary() -> None:
    """Where the slips of Den Hartog's motion begin to stop: r_b of 'DH-2' at b = 0.8 and 0.9, to its digits."""
    first = ss.steady_state(ss.scenarios.forced(0.8, 0.7))
    branch = solve.continue_orbit(first, "kinetic", to=0.9)
    curve = solve.locus(
        branch, kind="grazing", parameter="drive.frequency", values=[0.8 / (2 * math.pi), 0.9 / (2 * math.pi)]
    )
    np.testing.assert_allclose(curve.points[:, 0], [0.81740638571088274, 0.81965037767283014], atol=1e-8)
