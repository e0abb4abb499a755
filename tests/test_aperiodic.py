"""Motions that never repeat, or that repeat where no drive has a period: against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.drives.kinds import common_period
from stickslip.scenarios import forced

ROOT = math.sqrt(2)
LINEAR = ss.Oscillator(1.0, 1.0, ss.laws.LinearSlope(0.0, slope=0.0), damping=0.1)
LAWS = [ss.laws.Coulomb(0.4), ss.laws.Coulomb(0.4, static=0.6), ss.laws.CompliantContact(0.4, 20.0, 0.3)]


@pytest.mark.parametrize(
    ("frequencies", "period"),
    [
        ([2.0], 0.5),
        ([2.0, 3.0], 1.0),
        ([2.5, 2.5 * ROOT], math.inf),
        ([0.1, 0.25, 0.3], 20.0),
        ([1.0, 1e-5], math.inf),
        ([3.0, 1.0, 3.0], 1.0),
        ([100.0, 250.0], 0.02),
    ],
)
def test_tones_have_the_least_common_period(frequencies: list[float], period: float) -> None:
    assert common_period(frequencies) == pytest.approx(period, rel=1e-15)
    drive = ss.drives.MultiTone([(1.0, f, 0.0) for f in frequencies])
    assert drive.motion().period == pytest.approx(period, rel=1e-15)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("frequency", [0.07, 0.13])
def test_tones_of_irrational_ratio_are_quasi_periodic(law: object, frequency: float) -> None:
    tones = [(1.0, frequency, 0.0), (0.5, ROOT * frequency, 0.3)]
    orbit = ss.steady_state(ss.Oscillator(1.0, 1.0, law, ss.drives.MultiTone(tones, on="force"), damping=0.05))
    assert (orbit.status, orbit.order) == ("quasi-periodic", 0)
    assert orbit.rotation_numbers == pytest.approx((ROOT,), rel=1e-15)
    assert np.all(np.isnan(orbit.multipliers))
    assert orbit.exponent is not None
    assert orbit.exponent.value < 0
    first = orbit.frequencies[0]
    for line, _ in orbit.lines[:3]:  # each a whole combination of the two
        off = [abs(abs(j + k * ROOT) * first - line) for j in range(-9, 10) for k in range(-9, 10)]
        assert min(off) < 1e-3 * first


def test_lines_without_friction_are_the_linear_answer() -> None:
    tones = [(1.0, 0.07, 0.0), (0.5, 0.07 * ROOT, 0.3)]
    orbit = ss.steady_state(LINEAR.having(drive=ss.drives.MultiTone(tones, on="force")))
    known = sorted(
        ((f, size / abs(1 - w**2 + 0.1j * w)) for size, f, _ in tones for w in [2 * math.pi * f]),
        key=lambda row: -row[1],
    )
    np.testing.assert_allclose(orbit.lines, known, rtol=2e-3)
    np.testing.assert_allclose(orbit.lines[:, 0], [f for f, _ in known], rtol=1e-5)
    assert orbit.exponent.value == pytest.approx(-0.05, abs=0.002)  # half the damping over the mass


@pytest.mark.parametrize("law", LAWS[:2])
def test_tones_of_whole_ratio_repeat_with_their_common_period(law: object) -> None:
    tones = [(1.0, 0.1, 0.0), (0.5, 0.15, 0.3)]
    system = ss.Oscillator(1.0, 1.0, law, ss.drives.MultiTone(tones, on="force"), damping=0.05)
    orbit = ss.steady_state(system)
    assert (orbit.status, orbit.order) == ("unique", 1)
    assert orbit.period == pytest.approx(20.0)
    run = ss.simulate(system, duration=400.0)
    assert run.state(400.0)["x"] == pytest.approx(orbit.orbit.state(0.0)["x"], abs=1e-7)


def test_a_tone_beside_a_belt_locks_to_its_own_period() -> None:
    drive = ss.drives.Dithered(ss.drives.Belt(1.0), 0.4, 0.2, on="force")
    orbit = ss.steady_state(ss.Oscillator(1.0, 1.0, ss.laws.Coulomb(0.3), drive, damping=0.1))
    assert (orbit.status, orbit.order) == ("unique", 1)
    assert orbit.period == pytest.approx(5.0)
    w = 2 * math.pi * 0.2  # it never sticks: a linear answer about the pull of the belt
    assert np.ptp(orbit.orbit.sample(np.linspace(0, 5, 4001), ("x",))[0]) == pytest.approx(
        0.8 / abs(1 - w**2 + 0.1j * w), rel=1e-5
    )


def test_chaos_is_told_with_its_exponent() -> None:
    case = ss.scenarios.get("FM-1")
    orbit = ss.steady_state(case.system, start=case.start)
    assert (orbit.status, orbit.order) == ("chaotic", 0)
    period = case.system.drive.motion().period
    assert orbit.exponent.value * period == pytest.approx(0.596, abs=0.06)
    assert orbit.exponent.interval[0] > 0


@pytest.mark.parametrize("speed", [pytest.param(0.41, marks=pytest.mark.soak), 0.425])
def test_a_smooth_cycle_on_a_belt_has_the_averaged_amplitude(speed: float) -> None:
    """ST-2 (Thomsen and Fidlin 2003): A = 2 sqrt(vb1^2 - vb^2) for small friction, without sticks above vb0."""
    most, least, vm, damping = 0.4, 0.25, 0.5, 0.1
    slope, cubic = 1.5 * (most - least) / vm, 0.5 * (most - least) / vm**3
    first = vm * math.sqrt(1 - 2 * damping / 2 * vm / (1.5 * (most - least)))
    assert first == pytest.approx(0.44095855184409843, rel=1e-12)
    law = ss.laws.FrictionCurve(lambda v: most - slope * v + cubic * v**3)
    orbit = ss.steady_state(ss.Oscillator(1.0, 1.0, law, ss.drives.Belt(speed), damping=damping), start={"x": 0.5})
    assert (orbit.status, orbit.order, orbit.stops) == ("unique", 1, (0, 0))
    swing = np.ptp(orbit.orbit.sample(np.linspace(0, orbit.period * (1 - 1e-12), 2001), ("x",))[0]) / 2
    assert swing == pytest.approx(2 * math.sqrt(first**2 - speed**2), rel=0.02)
    assert abs(orbit.multipliers[0]) < 1


@pytest.mark.parametrize("load", [0.3, 0.78, 0.785, 0.7853, 0.78539])
def test_resonance_without_damper_is_unbounded_up_to_a_quarter_of_pi(load: float) -> None:
    assert ss.steady_state(forced(1.0, load)).status == "unbounded"


@pytest.mark.parametrize("load", [0.7855, 0.8])
def test_resonance_beyond_a_quarter_of_pi_is_bounded(load: float) -> None:
    assert ss.steady_state(forced(1.0, load)).status == "unique"


def test_near_resonance_is_not_called_unbounded() -> None:
    orbit = ss.steady_state(forced(1.0001, 0.5))
    assert orbit.status != "unbounded"
