"""The older ways to read a free decay, and what each gets wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.decay.motions import free_decay
from test_check import read_pendulum

W, TIMES = 2 * np.pi, np.arange(4000) / 200


def released(
    damping: float, dry: float, *, noise: float = 0.0, pendulum: bool = False, first: float = 1.0
) -> ss.Record:
    given = [W, damping, dry, 0.02, first, 0.5, 0, 0, 0, 0, 0.5, 0]
    x = free_decay(TIMES, given, restoring="pendulum" if pendulum else "linear")[0]
    x += noise * np.random.default_rng(0).standard_normal(TIMES.size)
    return ss.Record.of({"theta" if pendulum else "x": x}, fs=200)


def test_each_reads_the_friction_it_knows() -> None:
    assert ss.decay.log_decrement(released(0.02, 0.0)).damping_ratio.value == pytest.approx(0.02, rel=0.01)
    assert ss.decay.linear_decrement(released(0.0, 0.02)).dry_displacement.value == pytest.approx(0.02, rel=0.01)
    for method in (ss.decay.extreme_decay, ss.decay.hilbert_decay):
        found = method(released(0.0177, 0.005))
        assert found.damping_ratio.value == pytest.approx(0.0177, rel=0.03)
        assert found.dry_displacement.value == pytest.approx(0.005, rel=0.06)


def test_each_takes_the_other_friction_for_its_own_and_says_so() -> None:
    record = released(0.0177, 0.005)
    viscous, dry = ss.decay.log_decrement(record), ss.decay.linear_decrement(record)
    assert viscous.damping_ratio.value > 1.3 * 0.0177
    assert "read as viscous" in viscous.status
    assert dry.dry_displacement.value > 2 * 0.005
    assert "read as dry" in dry.status
    assert viscous.dry_displacement is None
    assert dry.damping_ratio is None


@pytest.mark.parametrize("pendulum", [False, True])
def test_extremes_alone_tell_both(pendulum: bool) -> None:
    record = released(0.01, 0.01, noise=1e-4, pendulum=pendulum, first=2.0 if pendulum else 1.0)
    decay = ss.decay.extreme_decay(record, restoring="pendulum" if pendulum else "linear")
    assert decay.damping_ratio.value == pytest.approx(0.01, rel=0.02)
    assert decay.dry_displacement.value == pytest.approx(0.01, rel=0.02)


def test_extremes_do_not_ask_the_clock() -> None:
    record = released(0.0177, 0.005)
    rate = 200 * (1 + 0.05 * np.sin(TIMES))  # a clock that runs fast and slow
    warped = np.interp(np.cumsum(1 / rate), TIMES, record["x"])
    decay = ss.decay.extreme_decay(ss.Record.of({"x": warped}, fs=200))
    assert decay.damping_ratio.value == pytest.approx(0.0177, rel=0.01)
    assert decay.dry_displacement.value == pytest.approx(0.005, rel=0.01)


READ = [("60.txt", 0.0063, 0.0169), ("100.txt", 0.0054, 0.0122)]


@pytest.mark.parametrize(("name", "ratio", "band"), READ)
def test_pendulums_whose_clock_is_broken(dataset: Callable[[str], Path], name: str, ratio: float, band: float) -> None:
    """Crude methods gave 0.0051 to 0.0065 and 0.011 to 0.016 deg, a sixth of the encoder's step."""
    record = ss.signals.repair_clock(read_pendulum(dataset("pendulum_bad_clock") / name))
    decay = ss.decay.extreme_decay(record, restoring="pendulum")
    assert decay.damping_ratio.value == pytest.approx(ratio, abs=1e-4)
    assert 0.0051 < decay.damping_ratio.value < 0.0065
    assert np.degrees(decay.dry_displacement.value) == pytest.approx(band, abs=3e-4)
    low, high = np.degrees(decay.dry_displacement.interval)
    assert low < 0.016
    assert high > 0.011


def test_too_few_extremes_and_speeds_are_refused() -> None:
    with pytest.raises(ss.errors.EstimateError, match="are needed"):
        ss.decay.log_decrement(released(0.0, 0.15))
    speed = np.gradient(released(0.02, 0.0)["x"], 0.005)
    with pytest.raises(ss.errors.EstimateError, match="displacements are read"):
        ss.decay.hilbert_decay(ss.Record.of({"v": speed}, fs=200))
