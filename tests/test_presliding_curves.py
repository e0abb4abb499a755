"""Curves with memory of the way: known elements come back from their loops, and loops of simulated laws too."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip import Record, fit_curve, friction_loops
from stickslip.errors import EstimateError
from stickslip.laws import Dahl, ElastoSlip

FS, STROKE = 1000, 1e-4


def moved(friction, *, noise: float = 0.01, cycles: int = 10, seed: int = 0, stroke: float = STROKE):
    """A sine of displacement and the friction that a function of it gives."""
    t = np.arange(FS * cycles) / FS
    x = stroke * np.sin(2 * np.pi * t)
    scatter = np.random.default_rng(seed).normal(0, noise, t.size)
    return Record.of({"x": x, "friction": friction(x) + 0.02 + scatter}, fs=FS)


def jenkins(x, stiffness: float = 1e5, kinetic: float = 1.1):
    """Masing's rules, written out: friction runs at the stiffness from each reversal, and no higher than its level."""
    force = np.zeros_like(x)
    for i in range(1, len(x)):
        force[i] = np.clip(force[i - 1] + stiffness * (x[i] - x[i - 1]), -kinetic, kinetic)
    return force


def iwan(x, stiffness: float = 1e5, width: float = 3e-5, elements: int = 8):
    yields = width * (np.arange(elements) + 0.5) / elements
    return sum(jenkins(x, stiffness / elements, stiffness / elements * each) for each in yields)


def test_a_jenkins_element_comes_back() -> None:
    fit = fit_curve(moved(jenkins), curve="jenkins")
    assert fit.parameters["kinetic"].value == pytest.approx(1.1, rel=2e-3)
    assert fit.parameters["stiffness"].value == pytest.approx(1e5, rel=2e-3)
    assert fit.parameters["offset"].value == pytest.approx(0.02, abs=1e-3)
    assert fit.law == ElastoSlip([fit.parameters["stiffness"].value], [fit.parameters["kinetic"].value])
    assert fit.status == "ok"


def test_intervals_hold_the_truth() -> None:
    held = 0
    for seed in range(30):
        parameters = fit_curve(moved(jenkins, seed=seed, noise=0.05), curve="jenkins").parameters
        held += (
            parameters["kinetic"].includes(1.1)
            + parameters["stiffness"].includes(1e5)
            + parameters["offset"].includes(0.02)
        )
    assert held >= 0.88 * 90


def test_a_displacement_that_trembles_makes_nothing_softer() -> None:
    """Noise of 2 % of the give would let the element slip and hold at each reversal: 2 % of its stiffness."""
    clean = moved(jenkins, cycles=20)
    x = clean["x"] + np.random.default_rng(1).normal(0, 2e-7, len(clean))
    parameters = fit_curve(Record.of({"x": x, "friction": clean["friction"]}, fs=FS), curve="jenkins").parameters
    assert parameters["stiffness"].value == pytest.approx(1e5, rel=3e-3)
    assert parameters["stiffness"].includes(1e5)


def test_iwans_classes_come_back() -> None:
    fit = fit_curve(moved(iwan), curve="iwan", elements=8)
    for name, value in (("stiffness", 1e5), ("width", 3e-5), ("kinetic", 1.5)):
        assert fit.parameters[name].value == pytest.approx(value, rel=3e-3)
    assert len(fit.law.forces) == 8


def test_dahls_law_as_another_solver_has_it() -> None:
    """Under an imposed sine, by Runge and Kutta; the curve goes step by step in closed form."""
    level, stiffness, power = 1.1, 5e4, 1.5
    t = np.arange(6000) / 1000

    def rate(time, f):
        v = 2 * np.pi * STROKE * np.cos(2 * np.pi * time)
        return stiffness * v * np.abs(1 - f / level * np.sign(v)) ** power

    solved = solve_ivp(rate, (0, t[-1]), [0.0], t_eval=t, rtol=1e-8, atol=1e-9, max_step=2e-3).y[0]
    record = Record.of({"x": STROKE * np.sin(2 * np.pi * t), "friction": solved}, fs=1000)
    fit = fit_curve(record, curve="dahl")
    for name, value in (("kinetic", level), ("stiffness", stiffness), ("exponent", power)):
        assert fit.parameters[name].value == pytest.approx(value, rel=2e-3)
    assert fit.law == Dahl(**{name: fit.parameters[name].value for name in ("kinetic", "stiffness", "exponent")})


def test_maxwell_elements_follow_a_smooth_loop() -> None:
    record = moved(lambda x: iwan(x, elements=50))
    fit = fit_curve(record, curve="maxwell", elements=16)
    assert fit.unexplained < 0.02
    assert fit.parameters["stiffness"].value == pytest.approx(1e5, rel=0.15)
    assert fit.parameters["kinetic"].value == pytest.approx(1.5, rel=0.02)
    assert all(force > 0 for force in fit.law.forces)


def test_loops_are_fitted_by_their_mean_cycle() -> None:
    parameters = fit_curve(friction_loops(moved(jenkins)), curve="jenkins").parameters
    assert parameters["kinetic"].value == pytest.approx(1.1, rel=0.01)
    assert parameters["stiffness"].value == pytest.approx(1e5, rel=0.02)


def test_what_strokes_and_samples_can_not_tell_is_flagged() -> None:
    short = fit_curve(moved(jenkins, stroke=5e-6), curve="jenkins")  # yields at 1.1e-5 m
    assert "larger strokes" in short.status
    assert "larger strokes" in short.parameters["kinetic"].status
    rigid = fit_curve(moved(lambda x: jenkins(x, stiffness=1e9)), curve="jenkins")
    assert "sample faster" in rigid.status
    assert "sample faster" in rigid.parameters["stiffness"].status
    assert rigid.parameters["kinetic"].value == pytest.approx(1.1, rel=0.01)


def test_what_can_not_be_fitted_is_refused() -> None:
    record = moved(jenkins)
    for curve in ("dahl", "jenkins", "iwan", "maxwell"):
        with pytest.raises(EstimateError, match="sign of the force"):
            fit_curve(Record.of({"x": record["x"], "friction": -record["friction"]}, fs=FS), curve=curve)
    t = np.arange(4000) / FS
    with pytest.raises(EstimateError, match="needs motion both ways"):
        fit_curve(Record.of({"x": t + 0.01 * np.sin(9 * t), "friction": 1 + 0.1 * np.sin(t)}, fs=FS), curve="dahl")
    x = 5e-3 * np.sin(2 * np.pi * t)
    slides = Record.of({"x": x, "friction": 1.1 * np.sign(np.cos(2 * np.pi * t)) + 1e-2 * np.sin(977 * t)}, fs=FS)
    with pytest.raises(EstimateError, match="the contact's stiffness does not show in this record"):
        fit_curve(slides, curve="dahl")
