"""Where a decay begins: at any moment of a swing, behind a dropout, or with the release."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss

HALF, NOISY = 78.5, 3e-5  # samples in half a cycle, standard deviation [m]


@pytest.fixture(scope="module")
def swinging() -> np.ndarray:
    """zeta 0.02, x_k 1 mm, released from 30 mm at the first sample."""
    slider = ss.Oscillator(mass=2.0, stiffness=800.0, damping=1.6, law=ss.laws.Coulomb(0.8))
    return np.asarray(ss.simulate(slider, duration=5.0, start={"x": 0.03}).record(fs=500)["x"])


def covered(motion: np.ndarray, trials: int = 20) -> tuple[int, int]:
    """How often of so many records the intervals hold the damping ratio and the dry friction of `swinging`."""
    random = np.random.default_rng(5)
    noises = NOISY * random.standard_normal((trials, len(motion)))
    decays = [ss.fit_decay(ss.Record.of({"x": motion + noise}, fs=500)) for noise in noises]
    return sum(decay.damping_ratio.includes(0.02) for decay in decays), sum(
        decay.dry_displacement.includes(1e-3) for decay in decays
    )


@pytest.mark.parametrize("phase", [0.0, 0.12, 0.5, 0.7, 0.8, 0.9, 0.95, 5.73, 5.92])
def test_a_record_may_begin_at_any_moment_of_a_swing(swinging: np.ndarray, phase: float) -> None:
    """A swing that turns soon after the record begins is no hold, however near its turn is."""
    motion = swinging[round(phase * HALF) :]
    (ring,) = ss.decay.find_releases(ss.Record.of({"x": motion}, fs=500)).ring_downs
    assert ring.held == (phase == 0.0)
    assert min(covered(motion)) >= 16


@pytest.mark.parametrize("value", ["held", "zero"])
def test_what_follows_a_dropout_is_read_as_motion(swinging: np.ndarray, value: str) -> None:
    motion = np.concatenate([np.full(400, swinging[0]), swinging])
    motion[761:847] = motion[761] if value == "held" else 0.0
    assert min(covered(motion)) >= 16


@pytest.mark.parametrize("damping", [0.0, 1.6])
@pytest.mark.parametrize("start", [0.0055, 0.0251, 0.03])
def test_no_half_cycle_is_added_before_a_record_that_begins_with_the_release(damping: float, start: float) -> None:
    slider = ss.Oscillator(mass=2.0, stiffness=800.0, damping=damping, law=ss.laws.Coulomb(0.8))
    motion = ss.simulate(slider, duration=4.0, start={"x": start}).record(fs=500)["x"]
    for seed in (0, 1, 49):
        noise = np.random.default_rng(seed).standard_normal(len(motion))
        for level in (1e-5, 2e-4):
            decay = ss.fit_decay(ss.Record.of({"x": motion + level * noise}, fs=500))
            assert decay.release_time.value == pytest.approx(0.0, abs=0.004)
            assert decay.amplitude.value == pytest.approx(start, abs=5 * level)
