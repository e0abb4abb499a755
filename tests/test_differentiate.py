"""Derivatives, against closed forms: the thesis's average, tones, polynomials, dense algebra, exact stick-slip."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from motions import stick_slip
from stickslip.errors import EstimateError, RecordError
from stickslip.signals.derivatives import (
    Filter,
    best_bandwidth,
    differentiate,
    five_point_average,
    five_point_response,
    smooth,
)
from stickslip.signals.noise import penalised

METHODS = ("smoother", "five-point")


def test_five_point_average_is_equation_a1():
    y = np.random.default_rng(0).standard_normal(12)
    mean, n = five_point_average(y), 11
    assert mean[5] == pytest.approx(y[3:8].mean())
    assert mean[0] == pytest.approx((3 * y[0] + 2 * y[1] + y[2] - y[4]) / 5)
    assert mean[1] == pytest.approx((4 * y[0] + 3 * y[1] + 2 * y[2] + y[3]) / 10)
    assert mean[n - 1] == pytest.approx((y[n - 3] + 2 * y[n - 2] + 3 * y[n - 1] + 4 * y[n]) / 10)
    assert mean[n] == pytest.approx((-y[n - 4] + y[n - 2] + 2 * y[n - 1] + 3 * y[n]) / 5)


def test_its_ends_are_the_line_through_five_points():
    y = np.random.default_rng(1).standard_normal(5)
    assert np.allclose(five_point_average(y), np.polyval(np.polyfit(np.arange(5), y, 1), np.arange(5)))


def test_five_point_response_is_equation_a2():
    gain = five_point_response([250, 500, 750, 800, 1600], 4000)
    # cos(pi/8) and cos(pi/4) in closed form; the zeros are at fs/5 and 2 fs/5
    exact = (1 + np.sqrt(2 + np.sqrt(2)) + np.sqrt(2)) / 5
    assert np.allclose(gain, [exact, (1 + np.sqrt(2)) / 5, 0.07023, 0, 0], atol=1e-5)
    half_power = brentq(lambda f: float(five_point_response(f, 4000)) - np.sqrt(0.5), 100, 700)
    assert half_power == pytest.approx(360.63, abs=0.01)
    lowest = minimize_scalar(lambda f: float(five_point_response(f, 4000)), bounds=(900, 1500), method="bounded")
    assert lowest.x == pytest.approx(1160.86, abs=0.05)
    assert lowest.fun == pytest.approx(-0.25, abs=1e-9)


@pytest.mark.parametrize("frequency", [5.0, 40.0, 90.0])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("method", METHODS)
def test_a_tone_keeps_its_phase_and_meets_the_stated_gain(method, order, frequency):
    fs, w = 1000.0, 2 * np.pi * frequency
    t = np.arange(4000) / fs
    bandwidth = 60.0 if method == "smoother" else None
    derivative = differentiate(np.cos(w * t), fs, order=order, method=method, bandwidth=bandwidth)
    inside = slice(1000, 3000)  # whole cycles
    exact = (1j * w) ** order
    found = 2 * np.mean(derivative.values[inside] * np.exp(-1j * w * t[inside])) / exact
    assert found.real == pytest.approx(float(derivative.response(frequency)), abs=1e-8)
    assert abs(found.imag) < 1e-8  # no delay
    assert float(derivative.response(0.0)) == 1


def test_the_bandwidth_is_where_the_smoothing_passes_half_the_power():
    smoothed = smooth(np.random.default_rng(2).standard_normal(500), 1000.0, bandwidth=80.0)
    assert float(smoothed.response(80.0)) == pytest.approx(np.sqrt(0.5))
    penalty = Filter("smoother", 1000.0, 80.0).penalty
    w = 2 * np.pi * 33.0 / 1000
    assert float(smoothed.response(33.0)) == pytest.approx(1 / (1 + penalty * (2 - 2 * np.cos(w)) ** 3))


@pytest.mark.parametrize(
    ("size", "penalty"),
    [
        (24, 3.0),
        (25, 1e4),
        (60, 1e3),
        (301, 1e5),
        (800, 1e6),
        (501, 1e-6),
        (24, 1e-3),
        (100, 1e9),
        pytest.param(2000, 1e6, marks=pytest.mark.soak),
    ],
)
def test_the_smoother_is_the_minimum_of_its_criterion_to_the_ends(size, penalty):
    y = np.random.default_rng(size).standard_normal(size).cumsum()
    rough = np.sqrt(penalty) * np.diff(np.eye(size), 3, axis=0)
    exact = np.linalg.lstsq(np.vstack([np.eye(size), rough]), np.concatenate([y, np.zeros(size - 3)]), rcond=None)[0]
    assert np.abs(penalised(y, penalty) - exact).max() < 1e-9


def test_a_parabola_passes_unchanged_to_the_last_sample():
    t = np.arange(5000) / 1000
    for bandwidth in (2.0, 20.0, 200.0):
        values = 3 + 40 * t - 7 * t**2
        assert np.allclose(differentiate(values, 1000, bandwidth=bandwidth).values, 40 - 14 * t, atol=1e-6)
        assert np.allclose(differentiate(values, 1000, order=2, bandwidth=bandwidth).values, -14, atol=1e-4)


@pytest.mark.parametrize("terms", [{1: 1.0}, {2: 1.0}, {0: -1.0, 1: 3.0, 2: -20.0}])
@pytest.mark.parametrize(("size", "bandwidth"), [(24, 0.1), (60, 0.05), (400, 0.03), (400, 0.2), (800, 0.01)])
@pytest.mark.parametrize("method", METHODS)
def test_noise_gain_is_the_norm_of_the_filters_rows(method, size, bandwidth, terms):
    made = Filter(method, 1.0, bandwidth)
    rows = np.linalg.norm(made.apply(np.eye(size), terms), axis=1)
    assert np.allclose(made.noise_gain(size, terms), rows, rtol=0.005)


@pytest.mark.parametrize("noise", [1e-7, 1e-6, 5e-6, 2e-5])
@pytest.mark.parametrize("fs", [250.0, 1000.0])
def test_the_smoother_beats_five_points_and_is_near_the_best_bandwidth(fs, noise):
    motion = stick_slip(fs, 10)
    x = motion["x"] + noise * np.random.default_rng(5).standard_normal(motion["x"].size)
    for order, truth in ((1, motion["v"]), (2, motion["a"])):
        ours = np.std(differentiate(x, fs, order=order).values - truth)
        theirs = np.std(differentiate(x, fs, order=order, method="five-point").values - truth)
        grid = np.geomspace(4, 0.3 * fs, 40)
        best = min(np.std(Filter("smoother", fs, width).apply(x, {order: 1.0}) - truth) for width in grid)
        assert ours < theirs
        assert ours < 1.25 * best


def test_uncertainty_covers_smooth_truths():
    fs, t = 500.0, np.arange(4000) / 500.0
    tones = 2 * np.pi * np.array([0.7, 1.3, 2.1])
    for order in (0, 1, 2):
        covered = []
        for seed in range(12):
            rng = np.random.default_rng(seed)
            waves = np.exp(1j * (np.outer(t, tones) + rng.uniform(0, 2 * np.pi, 3)))
            x, truth = waves.real.sum(axis=1), (waves * (1j * tones) ** order).real.sum(axis=1)
            noisy = x + 1e-3 * rng.standard_normal(t.size)
            made = smooth(noisy, fs) if order == 0 else differentiate(noisy, fs, order=order)
            covered.append(np.mean(np.abs(made.values - truth) < 2 * made.sd))
        assert 0.93 < np.mean(covered) <= 0.995


def test_five_point_uncertainty_covers_its_noise():
    t = np.arange(20000) / 1000
    noisy = np.sin(3 * t) + 1e-3 * np.random.default_rng(8).standard_normal(t.size)
    made = differentiate(noisy, 1000, order=2, method="five-point")
    assert np.mean(np.abs(made.values + 9 * np.sin(3 * t)) < 2 * made.sd) == pytest.approx(0.954, abs=0.01)


def test_a_stated_noise_is_taken():
    values = np.random.default_rng(9).standard_normal(300)
    one, two = (differentiate(values, 100.0, method="five-point", noise=level).sd for level in (1.0, np.full(300, 2.0)))
    assert np.allclose(two, 2 * one)


def test_a_million_samples_take_a_second():
    values = np.sin(np.arange(1_000_000) / 100) + 1e-3 * np.random.default_rng(10).standard_normal(1_000_000)
    started = time.process_time()
    made = differentiate(values, 1000.0, order=2)
    assert time.process_time() - started < 2
    assert np.std(made.values + 100 * np.sin(np.arange(1_000_000) / 100)) < 0.1 * 100 / np.sqrt(2)


def test_a_low_bandwidth_at_a_high_rate_stays_exact():
    # lambda is 3e15 here: a banded solve would have lost every digit
    t = np.arange(200_000) / 50_000
    made = differentiate(np.sin(20 * t), 50_000, bandwidth=20.0)
    inside = slice(50_000, 150_000)
    gain = float(made.response(20 / (2 * np.pi)))
    assert np.allclose(made.values[inside], gain * 20 * np.cos(20 * t[inside]), atol=1e-5)


def test_a_record_at_rest_has_no_derivative():
    assert np.all(differentiate(np.full(100, 0.3), 100.0).values == pytest.approx(0, abs=1e-12))
    assert best_bandwidth(np.zeros(100), 100.0) == 45.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"order": 3},
        {"method": "spline"},
        {"noise": -1.0},
        {"noise": "x"},
        {"noise": np.ones(7)},
        {"bandwidth": 0.0},
        {"bandwidth": 80.0},
        {"bandwidth": 10.0, "method": "five-point"},
    ],
)
def test_wrong_use_is_refused(wrong):
    with pytest.raises(EstimateError):
        differentiate(np.random.default_rng(0).standard_normal(200), 100.0, **wrong)
    with pytest.raises(RecordError, match="'x' is not a finite number"):
        differentiate(np.zeros(200), 100.0, bandwidth="x")
    with pytest.raises(EstimateError):
        differentiate(np.zeros(10), 100.0)
