"""Intervals of means and regressions, by their coverage of the truth under correlated noise."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from stickslip.errors import EstimateError
from stickslip.statistics import correlation_time, least_squares, mean_of_cycles, mean_uncertainty, student


def autoregression(rng, count, rho):
    return lfilter([1], [1, -rho], rng.standard_normal(count + 500))[500:]


@pytest.mark.parametrize(("count", "rho"), [(10, 0.0), (20, 0.0), (50, 0.3), (200, 0.5), (200, 0.9), (5000, 0.98)])
def test_interval_of_a_mean_holds_the_truth_in_95_of_100(count, rho):
    rng = np.random.default_rng(count)
    trials = 600
    held = 0
    for _ in range(trials):
        series = autoregression(rng, count, rho)
        sd, freedom = mean_uncertainty(series)
        held += abs(series.mean()) <= student(freedom) * sd
    assert 0.91 <= held / trials <= 0.98  # 3 binomial standard deviations are 0.027; short strongly correlated: -0.015


def test_ignoring_the_correlation_would_not_hold():
    rng = np.random.default_rng(3)
    series = [autoregression(rng, 1000, 0.9) for _ in range(300)]
    naive = np.mean([abs(s.mean()) <= 1.96 * s.std(ddof=1) / math.sqrt(len(s)) for s in series])
    assert naive < 0.5


def test_with_every_cosine_it_is_the_textbook_standard_error():
    series = np.array([1.0, 3.0, 2.0])  # the two cosines of three values are all there are
    sd, freedom = mean_uncertainty(series)
    assert freedom == 2
    assert sd == pytest.approx(series.std(ddof=1) / math.sqrt(3), rel=1e-12)


def test_correlation_time_of_an_autoregression():
    series = autoregression(np.random.default_rng(0), 400_000, 0.8)
    assert correlation_time(series) == pytest.approx((1 + 0.8) / (1 - 0.8), rel=0.1)


def test_interval_does_not_depend_on_the_sampling_rate():
    slow = autoregression(np.random.default_rng(1), 2000, 0.9)
    fast = np.interp(np.arange(0, 1999, 0.1), np.arange(2000), slow)
    assert mean_uncertainty(fast)[0] == pytest.approx(mean_uncertainty(slow)[0], rel=0.1)


@pytest.mark.parametrize("rho", [0.5, 0.9, 0.98])
def test_interval_of_regression_coefficients_holds_the_truth(rho):
    count, trials = 2000, 300
    rng = np.random.default_rng(7)
    t = np.arange(count)
    speed = np.sin(2 * np.pi * t / 100) + 0.3 * np.sin(2 * np.pi * t / 77)
    design = np.column_stack([np.gradient(speed), speed, np.sign(speed), np.ones(count)])
    truth = np.array([3.0, 0.2, 1.0, -0.4])
    held = np.zeros(4)
    for _ in range(trials):
        fit = least_squares(design, design @ truth + autoregression(rng, count, rho))
        half = np.array([student(q) for q in fit.freedom]) * fit.sd
        held += np.abs(fit.coefficients - truth) <= half
    assert np.all(held / trials >= 0.90)  # 4 binomial standard deviations below 0.95


def test_regression_scales_with_its_units():
    rng = np.random.default_rng(2)
    design = rng.standard_normal((300, 3))
    data = design @ [1.0, 2.0, 3.0] + rng.standard_normal(300)
    scale = np.array([1e-6, 1.0, 1e5])
    plain, scaled = least_squares(design, data), least_squares(design * scale, 7 * data)
    assert scaled.coefficients == pytest.approx(7 * plain.coefficients / scale, rel=1e-9)
    assert scaled.sd == pytest.approx(7 * plain.sd / scale, rel=1e-9)
    assert scaled.condition == pytest.approx(plain.condition, rel=1e-9)


def test_columns_that_can_not_be_told_apart_are_refused():
    column = np.arange(50.0)
    with pytest.raises(EstimateError, match="condition number"):
        least_squares(np.column_stack([column, column * 2]), column)
    with pytest.raises(EstimateError, match="column of zeros"):
        least_squares(np.column_stack([column, column * 0]), column)
    with pytest.raises(EstimateError, match="2 samples for 2 coefficients"):
        least_squares(np.eye(2), np.ones(2))


def test_few_cycles_are_said():
    one = mean_of_cycles("level", [1.2, np.nan], unit="N", method="mean of cycles")
    assert one.interval == (-math.inf, math.inf)
    assert one.status == "only 1 cycle: the interval is crude"
    two = mean_of_cycles("level", [1.0, 1.2], unit="N", method="mean of cycles")
    assert two.interval[1] - two.value == pytest.approx(12.706 * 0.1, rel=1e-3)  # Student, one degree of freedom
    assert mean_of_cycles("level", np.ones(5), unit="N", method="mean of cycles").status == "ok"
    with pytest.raises(EstimateError, match="no cycle gives a level"):
        mean_of_cycles("level", [np.nan], unit="N", method="mean of cycles")
