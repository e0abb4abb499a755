"""Rate-and-state friction from a step of the driving velocity, against scipy's solution of the same law."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip import Record, fit_curve
from stickslip.errors import EstimateError
from stickslip.laws import RateState

A, B, DC, MU, V1, V2, K, NORMAL = 0.010, 0.007, 8e-6, 0.6, 3e-6, 1e-5, 2e5, 50.0


def stepped(law: str, *, noise: float = 0.0, seed: int = 0, fs: float = 50.0, step: float = 8.0, end: float = 30.0):
    """Friction behind a spring whose far end goes at V1, then at V2: log speed and log age by an implicit solver."""

    def rates(t, y, drive):
        speed = V1 * np.exp(y[0])
        way = speed * np.exp(y[1]) / V1
        age = (V1 * np.exp(-y[1]) * (1 - way)) / DC if law == "aging" else -speed / DC * np.log(way)
        return [(K / (A * NORMAL)) * (drive - speed) - B / A * age, age]

    t = np.arange(round(end * fs)) / fs
    after = t[t > step]
    solution = solve_ivp(
        rates, (step, end), [0.0, 0.0], args=(V2,), t_eval=after, method="Radau", rtol=1e-9, atol=1e-11
    )
    z, w = np.zeros((2, t.size))
    z[t > step], w[t > step] = solution.y
    x = V1 * t + (V2 - V1) * np.maximum(t - step, 0)
    friction = NORMAL * (MU + A * z + B * w)
    friction = friction + np.random.default_rng(seed).normal(0, noise * NORMAL, t.size)
    return Record.of({"x": 1e-3 + x, "friction": friction}, fs=fs)


@pytest.mark.parametrize("law", ["aging", "slip"])
def test_the_law_comes_back(law: str) -> None:
    fit = fit_curve(stepped(law), curve=law, normal=NORMAL)
    truth = {"friction": MU, "direct": A, "evolution": B, "rate_dependence": A - B, "distance": DC, "stiffness": K}
    for name, value in truth.items():
        assert fit.parameters[name].value == pytest.approx(value, rel=1e-3)
    assert isinstance(fit.law, RateState)
    assert fit.law.law == law
    assert fit.law.steady(V2) / NORMAL == pytest.approx(MU + (A - B) * np.log(V2 / V1), rel=1e-4)
    assert fit.status == "ok"


def test_intervals_hold_the_truth() -> None:
    truth = {"direct": A, "evolution": B, "rate_dependence": A - B, "distance": DC}
    held = dict.fromkeys(truth, 0)
    for seed in range(12):
        fit = fit_curve(stepped("slip", noise=8e-4, seed=seed), curve="slip", normal=f"{NORMAL} N")
        for name, value in truth.items():
            held[name] += fit.parameters[name].includes(value)
    assert all(count >= 10 for count in held.values()), held


def test_the_other_law_leaves_more() -> None:
    record = stepped("slip", noise=1e-5)
    assert fit_curve(record, curve="slip").residual < 0.9 * fit_curve(record, curve="aging").residual


def test_what_is_no_step_is_refused() -> None:
    t = np.arange(2000) / 50
    with pytest.raises(EstimateError, match="changes the speed"):
        fit_curve(Record.of({"x": V1 * t, "friction": 1 + 0 * t + 1e-3 * np.sin(t)}, fs=50), curve="aging")
    with pytest.raises(EstimateError, match="goes forward"):
        fit_curve(Record.of({"x": 1e-3 * np.abs(t - 20), "friction": np.sign(t - 20)}, fs=50), curve="aging")
    with pytest.raises(EstimateError, match=r"the displacement goes to and fro; .*fit a curve over the speed"):
        fit_curve(Record.of({"x": 1e-3 * np.sin(t), "friction": np.sign(np.cos(t))}, fs=50), curve="aging")
