"""Derivatives of a motion by its parameters, events included: closed forms, and differences of two exact runs."""

from __future__ import annotations

import functools

import mpmath
import numpy as np
import pytest

import stickslip as ss
from stickslip.parameters import find, places

DRIVE = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
LAWS = {
    "sticks": ss.laws.Coulomb(1.1, static=1.2),
    "gives way": ss.laws.CompliantContact(1.1, stiffness=192e3, damping=23.86),
    "falls": ss.laws.LinearSlope(1.1, slope=-0.05, static=1.3),
}


def test_a_free_slide_and_its_turn_have_the_closed_form() -> None:
    m, k, f, x0 = mpmath.mpf("1.3"), mpmath.mpf(4), mpmath.mpf(1), mpmath.mpf(2)

    def x(m: mpmath.mpf, k: mpmath.mpf, f: mpmath.mpf, t: mpmath.mpf) -> mpmath.mpf:
        w = mpmath.sqrt(k / m)
        if t < mpmath.pi / w:
            return (x0 - f / k) * mpmath.cos(w * t) + f / k
        turned = -(x0 - 2 * f / k)
        return (turned + f / k) * mpmath.cos(w * t - mpmath.pi) - f / k

    run = ss.simulate(ss.Oscillator(mass=1.3, stiffness=4.0, law=ss.laws.Coulomb(1.0)), duration=3.0, start={"x": 2.0})
    by = ss.solve.sensitivities(run, "mass", "stiffness", "kinetic")
    times = [0.4, 1.1, 2.3, 2.9]
    order = {0: (1, 0, 0), 1: (0, 1, 0), 2: (0, 0, 1)}
    with mpmath.workdps(50):
        for t, values in zip(times, by.sample(times).T, strict=True):
            at = functools.partial(x, t=mpmath.mpf(t))
            true = [float(mpmath.diff(at, (m, k, f), order[number])) for number in range(3)]
            assert values == pytest.approx(true, rel=1e-7)
        turn = [float(mpmath.diff(lambda m, k: mpmath.pi * mpmath.sqrt(m / k), (m, k), n)) for n in ((1, 0), (0, 1))]
    assert by.events[:, 0] == pytest.approx([*turn, 0.0], rel=1e-7, abs=1e-12)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(
    "parameter", ["mass", "stiffness", "damping", "kinetic", "drive.amplitude", "drive.frequency", "drive.phase"]
)
def test_it_is_the_limit_of_differences(name: str, parameter: str) -> None:
    system = ss.Oscillator(mass=2.42, stiffness=2310, damping=0.5, law=LAWS[name], drive=DRIVE)
    path = find(system, parameter)[0]
    if name == "gives way" and parameter == "damping":
        parameter, path = "law.damping", ("law", "damping")
    value = float(getattr(places(system)[path], path[-1]))
    run, step = ss.simulate(system, duration=2.3), 1e-5 * (value or 1.0)
    by, times = ss.solve.sensitivities(run, parameter), np.linspace(0.013, 2.283, 40)
    low, high = (ss.simulate(system.having(**{parameter: value + side}), duration=2.3) for side in (-step, step))
    for output in ("x", "v"):
        near = [other.sample(times, (output,))[0][0] for other in (low, high)]
        true = (near[1] - near[0]) / (2 * step)
        assert np.abs(by.sample(times, output)[0] - true).max() < 1e-5 * np.abs(true).max()
    moved = np.subtract(*([event.time for event in other.events] for other in (high, low))) / (2 * step)
    assert by.events[0] == pytest.approx(moved, abs=1e-5 * np.abs(moved).max())


def test_what_has_no_derivative_is_refused() -> None:
    run = ss.simulate(ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.Coulomb(1.0)), duration=3.0, start={"x": 2.0})
    assert ss.solve.sensitivities(run, "damping").sample([1.0])[0, 0] > 0
    with pytest.raises(ss.errors.ModelError, match="static = None; a derivative is by a number"):
        ss.solve.sensitivities(run, "static")
    with pytest.raises(ss.errors.ModelError, match="no parameter is called 'sliding'"):
        ss.solve.sensitivities(run, "sliding")
    late = ss.laws.TimeDelay(ss.laws.Stribeck(1.0, 1.2, speed=0.1), lag=0.01)
    lagging = ss.simulate(ss.Oscillator(mass=1.0, stiffness=4.0, law=late), duration=3.0, start={"x": 2.0})
    with pytest.raises(ss.errors.ModelError, match="under a law without time lag"):
        ss.solve.sensitivities(lagging, "lag")
