"""The noise level of a channel, against levels that were put there."""

from __future__ import annotations

import time

import numpy as np
import pytest

from motions import stick_slip
from stickslip.errors import EstimateError
from stickslip.signals.noise import local_noise, noise_level, quantisation_step

FS = 1000.0


@pytest.mark.parametrize("sd", [1e-6, 1e-3, 1.0])
def test_white_noise_is_rated_without_bias(sd):
    levels = [noise_level(sd * np.random.default_rng(seed).standard_normal(2000), FS) for seed in range(60)]
    assert np.mean(levels) == pytest.approx(sd, rel=0.02)
    assert np.std(levels) < 0.06 * sd


@pytest.mark.parametrize("cycle", [30, 100, 1000])
def test_motion_and_trend_do_not_count(cycle):
    rows = np.arange(20000)
    noise = 0.01 * np.random.default_rng(2).standard_normal(rows.size)
    assert noise_level(10 * np.sin(2 * np.pi * rows / cycle) + 1e-3 * rows + noise, FS) == pytest.approx(0.01, rel=0.05)


def test_sharp_events_do_not_count():
    rng = np.random.default_rng(3)
    values = 0.01 * rng.standard_normal(20000)
    values[rng.choice(20000, 300, replace=False)] += 5.0
    assert noise_level(values, FS) == pytest.approx(0.01, rel=0.15)


@pytest.mark.parametrize("sd", [3e-7, 1e-6, 1e-5])
def test_stick_slip_does_not_count(sd):
    motion = stick_slip(FS, 10)
    noisy = motion["x"] + sd * np.random.default_rng(4).standard_normal(motion["x"].size)
    assert noise_level(noisy, FS) == pytest.approx(sd, rel=0.06)
    assert np.allclose(local_noise(noisy, FS), sd, rtol=0.06)


def test_a_digitiser_adds_its_own_error_and_sets_the_floor():
    rows = np.arange(20000)
    noise = np.random.default_rng(5).standard_normal(rows.size)
    digitised = np.round((np.sin(rows / 500) + 1e-3 * noise) / 1e-3) * 1e-3
    assert noise_level(digitised, FS) == pytest.approx(1e-3 * np.sqrt(1 + 1 / 12), rel=0.03)
    resting = np.round(np.where(rows % 4000 < 3000, 0.2, np.sin(rows / 500)) / 1e-3) * 1e-3
    assert noise_level(resting, FS) >= 1e-3 / np.sqrt(12)


@pytest.mark.parametrize("step", [1e-6, 0.088, 3.0])
def test_the_step_is_found_where_there_is_one(step):
    wave = 200 * step * np.sin(np.arange(30000) / 700)
    assert quantisation_step(np.round(wave / step) * step) == pytest.approx(step, rel=1e-6)
    assert quantisation_step(wave) == 0
    assert quantisation_step(np.zeros(100)) == 0


def test_noise_that_comes_with_motion_is_followed():
    rows = np.arange(12000)
    true = np.where((rows // 2000) % 2 == 0, 1.0, 6.0)
    level = local_noise(true * np.random.default_rng(6).standard_normal(rows.size), FS)
    inside = np.abs(rows % 2000 - 1000) < 800
    assert np.median(level[inside & (true == 1)]) == pytest.approx(1.0, rel=0.15)
    assert np.median(level[inside & (true == 6)]) == pytest.approx(6.0, rel=0.15)


def test_a_million_samples_take_a_moment():
    values = np.random.default_rng(7).standard_normal(1_000_000)
    started = time.process_time()
    noise_level(values, FS)
    assert time.process_time() - started < 0.5


@pytest.mark.parametrize(
    ("values", "fs"), [(np.zeros(23), FS), (np.full(100, np.nan), FS), (np.zeros((50, 2)), FS), (np.zeros(100), 0.0)]
)
def test_what_can_not_be_rated_is_refused(values, fs):
    with pytest.raises(EstimateError):
        noise_level(values, fs)
