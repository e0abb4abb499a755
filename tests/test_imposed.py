"""Laws under imposed motion, against closed forms: hysteresis loops and friction under dither."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

import stickslip as ss

HEAVY = 1e21  # kg: a mass that the contact can not move, so that start and counter-face impose the motion
ORDER = 40  # Gauss points on each half of a piece


def imposed(law: Any, drive: Any, *, mass: float = 1.0, stiffness: float = 0.0) -> ss.Oscillator:
    """A mass that moves as a drive says, whatever its spring and the law do."""
    return ss.Oscillator(mass=mass, stiffness=stiffness, law=law, drive=ss.drives.Imposed(drive))


@pytest.mark.parametrize(("mass", "stiffness"), [(1.0, 0.0), (2.42, 2310.0)])
def test_an_imposed_motion_is_had_and_its_loop_is_the_jenkins_elements(mass: float, stiffness: float) -> None:
    law, drive = ss.laws.CompliantContact(1.1, stiffness=192_000.0), ss.drives.HarmonicBase(20e-6, frequency=2.5)
    run = ss.simulate(imposed(law, drive, mass=mass, stiffness=stiffness), cycles=3)
    times = np.linspace(0.4, 0.8, 40_001)
    (x, v, friction), _ = run.sample(times, ("x", "v", "friction"))
    assert x == pytest.approx(20e-6 * np.cos(5 * math.pi * times), abs=1e-18)
    assert v == pytest.approx(-1e-4 * math.pi * np.sin(5 * math.pi * times), abs=1e-16)
    assert np.trapezoid(friction, x) == pytest.approx(4 * 1.1 * (20e-6 - 1.1 / 192_000), rel=1e-7)
    assert ss.steady_state(imposed(law, drive)).amplitude == pytest.approx(20e-6, rel=1e-12)


def test_a_chain_under_an_imposed_motion_is_that_on_a_moving_face_under_a_heavy_mass() -> None:
    law = ss.laws.InSeries(ss.laws.Tabulated([0.0, 0.1, 0.2], [1.25, 1.0, 1.0]), stiffness=1e5, damping=50.0)
    moved = ss.Oscillator(mass=HEAVY, stiffness=0, law=law, drive=ss.drives.MultiTone([(-2e-5, 2.5, 0.0)], on="face"))
    times = np.linspace(0.4, 1.2, 5001)
    both = [
        ss.simulate(system, cycles=3).sample(times, ("friction",))[0][0]
        for system in (moved, imposed(law, ss.drives.HarmonicBase(2e-5, frequency=2.5)))
    ]
    assert both[0] == pytest.approx(both[1], abs=1e-12)


def test_dahl_s_loop_under_an_imposed_motion_is_its_closed_form() -> None:
    """Friction at the turns is Fc tanh(s0 X / Fc), and the loop holds 4 Fc (X - (Fc/s0) tanh(s0 X / Fc))."""
    level, stiffness, reach = 1.1, 192_000.0, 20e-6
    run = ss.simulate(
        imposed(ss.laws.Dahl(level, stiffness=stiffness), ss.drives.HarmonicBase(reach, frequency=2.5)), cycles=6
    )
    (x, friction), _ = run.sample(np.linspace(2.0, 2.4, 40_001), ("x", "friction"))
    assert x == pytest.approx(reach * np.cos(5 * math.pi * np.linspace(2.0, 2.4, 40_001)), abs=1e-15)
    full = level * math.tanh(stiffness * reach / level)
    assert friction[0] == pytest.approx(full, rel=1e-9)
    assert np.trapezoid(friction, x) == pytest.approx(4 * level * (reach - full / stiffness), rel=1e-6)


@pytest.mark.parametrize("law", [ss.laws.Dahl(1.1, stiffness=5e5), ss.laws.StateVariable(1.1, rate=300.0)])
def test_memory_behind_a_spring_is_that_on_a_moving_face_under_a_heavy_mass(law: Any) -> None:
    """What remembers the friction's rate counts that the slider rides on the counter-face."""
    law = ss.laws.InSeries(law, stiffness=1e5, damping=50.0)
    moved = ss.Oscillator(mass=HEAVY, stiffness=0, law=law, drive=ss.drives.MultiTone([(-2e-5, 2.5, 0.0)], on="face"))
    times = np.linspace(0.4, 1.2, 501)
    both = [
        ss.simulate(system, cycles=3).sample(times, ("friction",))[0][0]
        for system in (moved, imposed(law, ss.drives.HarmonicBase(2e-5, frequency=2.5)))
    ]
    assert both[0] == pytest.approx(both[1], abs=1e-8)


def test_any_motion_without_jumps_of_its_velocity_can_be_imposed() -> None:
    law, way = ss.laws.CompliantContact(1.1, stiffness=192_000.0), 2e-5 * np.sin(np.arange(60) / 5)
    times = np.arange(50) / 50
    for drive, expected in (
        (ss.drives.Recorded(way, fs=50.0), way[:50]),
        (ss.drives.Ramp(1e-4), 1e-4 * times),
        (ss.drives.SpeedProfile([0.0, 1.0], [0.0, 1e-4]), 5e-5 * times**2),
        (ss.drives.MultiTone([(1e-5, 2.0, 0.0), (1e-6, 30.0, 0.0)]), None),
    ):
        x = ss.simulate(imposed(law, drive), duration=1.0).sample(times, ("x",))[0][0]
        if expected is None:
            expected = 1e-5 * np.cos(4 * math.pi * times) + 1e-6 * np.cos(60 * math.pi * times)
        assert x == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: imposed(ss.laws.Coulomb(1.0), ss.drives.Ramp(1.0)), "Coulomb.*rigid contact.*CompliantContact"),
        (lambda: imposed(ss.laws.Stribeck(1.0, 1.2, speed=0.1), ss.drives.Ramp(1.0)), "Stribeck.*rigid contact"),
        (lambda: ss.drives.Imposed(ss.drives.Belt(1.0)), "Belt imposed.*base alone"),
        (lambda: ss.drives.Imposed(ss.drives.HarmonicBase(1.0, 1.0, contact="base")), "base alone"),
        (lambda: ss.drives.Imposed(ss.drives.Recorded([0.0, 1, 0, 1], fs=1.0, order=1)), "jumps.*order=3"),
        (lambda: ss.Structure([[1]], [[0]], [[0]], drive=ss.drives.Imposed(ss.drives.Ramp(1.0))), "one mass"),
    ],
)
def test_what_can_not_be_imposed_is_refused(make: Any, words: str) -> None:
    with pytest.raises(ss.errors.ModelError, match=words):
        make()


def means(law: Any, amplitude: float, *, speed: float = 0.0) -> tuple[float, float, float]:
    """Mean friction [N], its part along the way (f cos) and energy [J] over a cycle of dither of angular rate 1.

    The counter-face moves as A cos t, the mass steadily at `speed`; the second cycle counts.
    """
    drive = ss.drives.MultiTone([(amplitude, 1 / (2 * math.pi), 0.0)], on="face")
    run = ss.simulate(ss.Oscillator(mass=HEAVY, stiffness=0, law=law, drive=drive), cycles=3, start={"v": speed})
    nodes, weights = np.polynomial.legendre.leggauss(ORDER)
    turn = 2 * math.pi
    cuts = np.unique(np.concatenate([run.starts, np.arange(9, 17) * turn / 8, [turn, 2 * turn]]))
    cuts = cuts[(cuts >= turn) & (cuts <= 2 * turn)]
    total = np.zeros(3)
    for low, high in itertools.pairwise(cuts):
        times = low + (high - low) * (nodes + 1) / 2
        (friction, slip), _ = run.sample(times, ("friction", "slip"))
        parts = [friction, -friction * np.cos(times), friction * slip]  # the slip is -A cos t
        total += [(high - low) / 2 * float(weights @ part) for part in parts]
    return total[0] / turn, total[1] / math.pi, total[2]


@pytest.mark.parametrize(
    ("amplitude", "energy", "stiffness", "loss"),
    [
        (10e-6, 1.8791666666666667e-5, 113761.96748009386, 59815.732778703997),
        (20e-6, 6.2791666666666667e-5, 45430.674338500731, 49968.020674892973),
        (485e-6, 0.0021087916666666667, 416.99379733432271, 2853.6475094143603),
    ],
)
@pytest.mark.parametrize("law", [ss.laws.ElastoSlip([192000], [1.1]), ss.laws.CompliantContact(1.1, 192000)], ids=repr)
def test_a_jenkins_loop(law: Any, amplitude: float, energy: float, stiffness: float, loss: float) -> None:
    """HY-2: energy W, first-harmonic stiffness k_eq = (k/pi)(th - sin(2 th)/2) and loss W / (pi X^2)."""
    _, along, taken = means(law, amplitude)
    assert taken == pytest.approx(energy, rel=1e-10)
    assert along / amplitude == pytest.approx(stiffness, rel=1e-10)
    assert taken / (math.pi * amplitude**2) == pytest.approx(loss, rel=1e-10)


@pytest.mark.parametrize(("amplitude", "energy"), [(20e-6, 1.7777777777777778e-4), (50e-6, 0.0018)])
def test_iwans_loop_is_the_limit_of_many_elements(amplitude: float, energy: float) -> None:
    """HY-3: classes of an even density miss W by a term in 1 / n^2, which two counts remove."""
    coarse, fine = (means(ss.laws.ElastoSlip.iwan(1e6, width=30e-6, elements=n), amplitude)[2] for n in (15, 45))
    assert fine + (fine - coarse) / 8 == pytest.approx(energy, rel=1e-9)


def segalman(strength: float, power: float, width: float, count: int) -> ss.laws.ElastoSlip:
    """Elements of the density R phi^chi of yield displacements, one at the mean of each class of squared width."""
    edges = width * (np.arange(count + 1) / count) ** 2
    stiffness = strength * np.diff(edges ** (power + 1)) / (power + 1)
    force = strength * np.diff(edges ** (power + 2)) / (power + 2)
    return ss.laws.ElastoSlip(list(stiffness), list(force))


def test_segalmans_loop_is_the_limit_of_many_elements() -> None:
    """HY-4: W = 4 R X^(chi + 3) / ((chi + 2)(chi + 3)), approached at second order."""
    known = 0.033730961708462713
    errors = [abs(means(segalman(1e6, -0.5, 1e-3, n), 1e-3)[2] / known - 1) for n in (6, 12, 24)]
    assert errors[2] < 2e-3
    assert math.log2(errors[0] / errors[2]) / 2 == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 2.0])
def test_dither_smooths_coulomb_friction(ratio: float) -> None:
    """DI-1: <f> / f_k = (2 / pi) asin(v / a w), whole above a w."""
    mean, *_ = means(ss.laws.Coulomb(1.1), 0.3, speed=0.3 * ratio)
    assert mean == pytest.approx(1.1 * (2 / math.pi * math.asin(min(ratio, 1.0))), rel=1e-11, abs=1e-12)


@pytest.mark.parametrize(
    ("speed", "known"),
    [(0.05, 0.02426530323049094), (0.1, 0.050238758375514184), (0.2, 0.11682362175901599), (0.4, 0.2908)],
)
def test_dither_smooths_a_stribeck_curve(speed: float, known: float) -> None:
    """DI-3: mu_s (2/pi) asin(v/U) - k1 v + k3 (v^3 + 1.5 v U^2) for a cubic curve with its minimum 0.25 at 0.5."""
    fall = 1.5 * (0.4 - 0.25) / 0.5
    law = ss.laws.FrictionCurve(lambda v: 0.4 - fall * v + fall / (3 * 0.5**2) * v * v * v)
    mean, *_ = means(law, 0.3, speed=speed)
    assert mean == pytest.approx(known, rel=1e-10)


@pytest.mark.parametrize("ratio", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("slanted", [1.0, 0.6, 1e-3, 1e-12])
def test_dither_of_other_shapes(ratio: float, slanted: float) -> None:
    """DI-2: a triangle of velocity gives <f> / f_k = v / U, a square none; a trapezoid its slanted part of v / U."""
    top, cycles = 0.3, 4
    edge = slanted / 4
    one = np.array([0.0, edge, 0.5 - edge, 0.5 + edge, 1 - edge])
    times = (np.arange(cycles)[:, None] + one).ravel()
    speeds = np.tile(top * np.array([0.0, 1.0, 1.0, -1.0, -1.0]), cycles)
    if slanted == 1.0:  # the level parts have no length
        times, first = np.unique(times, return_index=True)
        speeds = speeds[first]
    drive = ss.drives.SpeedProfile([*times, cycles], [*speeds, 0.0], on="face")
    system = ss.Oscillator(mass=HEAVY, stiffness=0, law=ss.laws.Coulomb(1.0), drive=drive)
    run = ss.simulate(system, duration=float(cycles), start={"v": ratio * top})
    sides = np.array([run.table.modes[m].side for m in run.modes])
    inside = np.clip(run.starts + run.durations, 1.0, None) - np.clip(run.starts, 1.0, None)
    assert float(sides @ inside) / (cycles - 1) == pytest.approx(slanted * ratio, rel=1e-12, abs=2e-15)


def test_a_trapezoid_of_the_base_moves_as_its_closed_form() -> None:
    """A frictionless mass on a spring whose end starts, runs and stops: three ramps of speed superposed."""
    times, speeds, omega = [0.0, 0.7, 2.0, 2.3], [0.0, 0.5, 0.5, 0.0], 3.0
    drive = ss.drives.SpeedProfile(times, speeds)
    run = ss.simulate(ss.Oscillator(mass=1, stiffness=omega**2, law=ss.laws.Coulomb(0.0), drive=drive), duration=5.0)
    kinks = np.diff([0.0, *(np.diff(speeds) / np.diff(times)), 0.0])
    after = np.clip(5.0 - np.array(times), 0, None)
    known = kinks @ (after**2 / 2 - (1 - np.cos(omega * after)) / omega**2)
    assert run.state(5.0)["x"] == pytest.approx(known, rel=1e-13)


@pytest.mark.parametrize("rod", [None, 0.2, 0.076])
def test_a_crank_moves_as_its_closed_form(rod: float | None) -> None:
    radius, frequency, phase = 0.05, 2.0, 0.3
    drive = ss.drives.Crank(radius, frequency=frequency, rod=rod, phase=phase)
    slider = ss.Oscillator(mass=1.0, stiffness=1e3, law=ss.laws.Coulomb(1.0), drive=drive)
    times = np.linspace(0, 1 / frequency, 501)
    z = ss.simulate(slider, cycles=1).sample(times, ("z",))[0][0]
    turned = 2 * math.pi * frequency * times + phase
    expected = radius * np.cos(turned)
    if rod is not None:
        reach = np.sqrt(rod**2 - (radius * np.sin(turned)) ** 2)
        expected = expected + reach - np.mean(reach[:-1])
    assert z == pytest.approx(expected, abs=1e-8 * radius)
    assert drive.motion().period == pytest.approx(1 / frequency)


def test_a_rod_that_is_too_short_is_refused() -> None:
    with pytest.raises(ss.errors.ModelError, match="longer rod"):
        ss.drives.Crank(0.05, frequency=2.0, rod=0.06)


@pytest.mark.parametrize(
    ("times", "speeds"),
    [([0.0, 1.0], [0.0]), ([0.1, 1.0], [0.0, 1.0]), ([0.0, 1.0, 1.0], [0, 1, 2]), ([0, 1], [0, math.nan])],
)
def test_a_profile_without_meaning_is_refused(times: list[float], speeds: list[float]) -> None:
    with pytest.raises(ss.errors.ModelError):
        ss.drives.SpeedProfile(times, speeds)
