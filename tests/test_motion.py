"""The motion of a contact and its cycles."""

import math

import numpy as np
import pytest

from stickslip.arrays import stretches
from stickslip.balance.motion import away_from, contact_motion, find_cycles, forcing_frequency
from stickslip.errors import EstimateError, RecordError
from stickslip.record.record import Record

FS = 500.0


def cycles_of(samples, *, contact="ground", **options):
    record = Record.of(samples, fs=FS)
    return find_cycles(record, contact_motion(record, contact=contact, question="this test"), **options)


def test_interval_of_the_frequency_holds_the_truth():
    rng = np.random.default_rng(0)
    t = np.arange(2000) / FS
    found = [
        forcing_frequency(np.sin(2 * np.pi * 2.37 * t + phase) + 0.5 * rng.standard_normal(t.size), FS)
        for phase in rng.uniform(0, 6, 100)
    ]
    assert np.mean([each.includes(2.37) for each in found]) >= 0.88  # 3 binomial standard deviations below 0.95
    assert np.std([each.value for each in found]) == pytest.approx(np.mean([each.sd for each in found]), rel=0.3)


def test_frequency_reaches_the_bound():
    """No estimator of a tone's frequency beats sd^2 = 24 s^2 / (A^2 (2 pi)^2 n T^2) (Rife and Boorstyn 1974)."""
    rng = np.random.default_rng(1)
    t = np.arange(2000) / FS
    values = [
        forcing_frequency(np.sin(2 * np.pi * 2.37 * t) + 0.5 * rng.standard_normal(t.size), FS).value
        for _ in range(100)
    ]
    bound = math.sqrt(24) * 0.5 / (2 * math.pi * math.sqrt(2000) * 4.0)
    assert np.std(values) < 1.25 * bound


def test_long_records_are_averaged_first():
    t = np.arange(400_000) / 2000
    x = np.sin(2 * np.pi * 2.5 * t) + 0.1 * np.random.default_rng(0).standard_normal(t.size)
    assert forcing_frequency(x, 2000.0).value == pytest.approx(2.5, abs=1e-5)


def test_forcing_is_taken_from_the_base_not_from_its_harmonics():
    t = np.arange(5000) / FS
    rng = np.random.default_rng(3)
    x = 1e-3 * np.sin(2 * np.pi * 2 * t) + 3e-3 * np.sin(2 * np.pi * 6 * t) + 1e-7 * rng.standard_normal(t.size)
    z = 1e-3 * np.sin(2 * np.pi * 2 * t + 0.3) + 1e-7 * rng.standard_normal(t.size)
    assert cycles_of({"x": x, "z": z}).frequency.value == pytest.approx(2, rel=1e-4)


def test_cycles_begin_where_the_motion_passes_its_mean_upwards():
    t = np.arange(5000) / FS
    x = 0.3 + np.sin(2 * np.pi * 2 * (t - 0.1)) + 1e-6 * np.random.default_rng(0).standard_normal(t.size)
    cycles = cycles_of({"x": x})
    assert cycles.edges / FS == pytest.approx(0.1 + 0.5 * np.arange(len(cycles.edges)), abs=1e-3)
    assert len(cycles.edges) == 20
    assert cycles.peak == pytest.approx(4 * np.pi, rel=0.01)
    label = cycles.labels(5000)
    assert label.min() == -1
    assert label.max() == 18
    assert np.all(np.bincount(label[label >= 0]) == 250)


def test_a_frequency_out_of_range_or_a_line_is_refused():
    t = np.arange(5000) / FS
    x = np.sin(2 * np.pi * 2 * t)
    with pytest.raises(EstimateError, match="frequency = 400 Hz"):
        cycles_of({"x": x}, frequency=400)
    with pytest.raises(EstimateError, match="no complete cycle"):
        cycles_of({"x": t})
    for frequency in (0.05, 0.0, -1.0):
        with pytest.raises(EstimateError, match=r"gives no complete cycle in 10 s"):
            cycles_of({"x": x}, frequency=frequency)
    with pytest.raises(RecordError, match="'nan'"):
        cycles_of({"x": x}, frequency=math.nan)


def test_stretches_and_margins():
    inside = np.array([1, 1, 0, 0, 1, 0, 1], dtype=bool)
    begins, ends = stretches(inside)
    assert begins.tolist() == [0, 4, 6]
    assert ends.tolist() == [2, 5, 7]
    events = np.zeros(9, dtype=bool)
    events[4] = True
    assert np.flatnonzero(~away_from(events, 2)).tolist() == [2, 3, 4, 5, 6]
