"""Curved laws against scipy, their equations written from the literature: turns of the sliding first, then the end."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stickslip as ss
from stickslip import laws

Array = NDArray[np.float64]
Rates = Callable[[float, Array], list[float]]  # of x, v and the memory
END = 14.0  # about two periods of the drive, and of the mass alone


class Drawn:
    """One mass under a harmonic force with numbers drawn at random; `pull` is all that moves it but friction."""

    def __init__(self, seed: int) -> None:
        draw = np.random.default_rng(seed)
        self.mass, self.spring, self.loss = draw.uniform(0.7, 1.5), draw.uniform(0.7, 1.5), draw.uniform(0.0, 0.1)
        self.force, self.rate = draw.uniform(0.8, 1.6), draw.uniform(0.5, 1.2)
        self.level, self.excess, self.speed = draw.uniform(0.2, 0.5), draw.uniform(0.1, 0.5), draw.uniform(0.2, 0.6)
        self.stiffness, self.damping = draw.uniform(20.0, 60.0), draw.uniform(2.0, 4.0)

    def pull(self, t: float, x: float, v: float) -> float:
        return self.force * math.cos(self.rate * t) - self.spring * x - self.loss * v

    def system(self, law: Any) -> ss.Oscillator:
        drive = ss.drives.HarmonicForce(self.force, self.rate / (2 * math.pi))
        return ss.Oscillator(self.mass, self.spring, law, drive, self.loss)


def lugre(d: Drawn) -> tuple[Any, Rates, list[float]]:
    """Canudas de Wit and others, 1995."""
    law = laws.LuGre(d.level, d.level * (1 + d.excess), d.speed, d.stiffness, 0.5 * d.damping, 0.1)

    def rates(t: float, s: Array) -> list[float]:
        x, v, z = s
        g = d.level + d.level * d.excess * math.exp(-((v / d.speed) ** 2))
        turning = v - d.stiffness * abs(v) * z / g
        force = d.stiffness * z + 0.5 * d.damping * turning + 0.1 * v
        return [v, (d.pull(t, x, v) - force) / d.mass, turning]

    return law, rates, [0.0, 0.0, 0.0]


def dahl(d: Drawn) -> tuple[Any, Rates, list[float]]:
    """Dahl, 1968."""

    def rates(t: float, s: Array) -> list[float]:
        x, v, f = s
        return [v, (d.pull(t, x, v) - f) / d.mass, d.stiffness * v * (1 - f * np.sign(v) / d.level)]

    return laws.Dahl(d.level, d.stiffness), rates, [0.0, 0.0, 0.0]


def state_variable(d: Drawn) -> tuple[Any, Rates, list[float]]:
    """The thesis's equations 4.1 and 4.2."""

    def rates(t: float, s: Array) -> list[float]:
        x, v, f = s
        return [v, (d.pull(t, x, v) - f) / d.mass, -d.level * 30.0 * (f - d.level * math.tanh(20.0 * v))]

    return laws.SmoothStateVariable(d.level, 30.0, 20.0), rates, [0.0, 0.0, 0.0]


def rate_state(d: Drawn) -> tuple[Any, Rates, list[float]]:
    """Dieterich 1979, Ruina 1983, regular at rest."""
    a, b, way, speed = 0.06, 0.04, 0.1 * d.speed, 0.1
    law = laws.RateState(d.level, 0.6, a, b, way, speed)

    def rates(t: float, s: Array) -> list[float]:
        x, v, age = s
        force = a * d.level * math.asinh(v / (2 * speed) * math.exp((0.6 + b * math.log(speed * age / way)) / a))
        return [v, (d.pull(t, x, v) - force) / d.mass, 1 - abs(v) * age / way]

    return law, rates, [0.0, 0.0, way / speed]


def dahl_in_series(d: Drawn) -> tuple[Any, Rates, list[float]]:
    """Dahl's law at a slider without mass: the damper tells its speed."""

    def rates(t: float, s: Array) -> list[float]:
        x, v, y, f = s
        w = v + (d.stiffness * (x - y) - f) / d.damping
        return [v, (d.pull(t, x, v) - f) / d.mass, w, 30.0 * w * (1 - f * np.sign(w) / d.level)]

    return laws.InSeries(laws.Dahl(d.level, 30.0), d.stiffness, d.damping), rates, [0.0] * 4


def rate_state_in_series(d: Drawn) -> tuple[Any, Rates, list[float]]:
    """Rate and state at a slider on a spring: the force tells its speed."""
    a, b, way, speed = 0.06, 0.04, 0.1 * d.speed, 0.1
    law = laws.InSeries(laws.RateState(d.level, 0.6, a, b, way, speed), d.stiffness)

    def rates(t: float, s: Array) -> list[float]:
        x, v, y, age = s
        f = d.stiffness * (x - y)
        grip = (0.6 + b * math.log(speed * age / way)) / a
        w = 2 * speed * math.exp(-grip) * math.sinh(f / (a * d.level))
        return [v, (d.pull(t, x, v) - f) / d.mass, w, 1 - abs(w) * age / way]

    return law, rates, [0.0, 0.0, 0.0, way / speed]


KINDS = [lugre, dahl, state_variable, rate_state, dahl_in_series, rate_state_in_series]


def _turns(velocity: Callable[[float], float], times: Array) -> list[float]:
    """Instants at which a velocity changes its sign."""
    signs = np.sign([velocity(t) for t in times])
    return [
        float(brentq(velocity, times[j], times[j + 1], xtol=1e-12)) for j in np.flatnonzero(signs[:-1] * signs[1:] < 0)
    ]


def _compare(kind: Any, seed: int) -> None:
    d = Drawn(seed)
    law, rates, start = kind(d)
    truth = solve_ivp(rates, (0.0, END), start, "LSODA", rtol=1e-11, atol=1e-13, dense_output=True, max_step=0.02)
    run = ss.simulate(d.system(law), duration=END, rtol=1e-11)
    times = np.linspace(0.01, END, 1500)
    mine = _turns(lambda t: float(run.sample([t], ("v",))[0][0, 0]), times)
    theirs = _turns(lambda t: float(truth.sol(t)[1]), times)
    assert len(mine) == len(theirs) > 2
    np.testing.assert_allclose(mine, theirs, atol=2e-6)
    looked = np.linspace(0, END, 60)
    np.testing.assert_allclose(run.sample(looked, ("x",))[0][0], truth.sol(looked)[0], atol=2e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_a_curved_law_moves_as_a_general_solver_has_it(kind: Any) -> None:
    _compare(kind, 0)


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_twenty_systems_of_a_curved_law_move_as_a_general_solver_has_them(kind: Any) -> None:
    for seed in range(1, 21):
        _compare(kind, seed)
