"""A sensor's response against closed forms and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from stickslip.signals.response import Response, leak, resonance, respond

NO_BREAKS = np.zeros(0)


def test_a_perfect_sensor_reads_the_truth() -> None:
    times = np.linspace(0, 1, 101)
    assert np.array_equal(respond(np.cos, breaks=NO_BREAKS, times=times, response=Response()), np.cos(times))


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.7, 1.0, 2.0])
def test_a_mount_driven_by_a_sine_settles_to_its_gain(damping: float) -> None:
    mount = resonance(30.0, damping)
    w, wn = 2 * np.pi * 7.0, 2 * np.pi * 30.0
    gain = wn**2 / (wn**2 - w**2 + 2j * damping * wn * w)
    assert mount.at(7.0) == pytest.approx(gain, rel=1e-6)
    if not damping:
        return
    times = np.arange(20_000) / 2000
    read = respond(lambda t: np.sin(w * t), breaks=NO_BREAKS, times=times, response=mount)
    late = times > 5
    assert np.abs(read - np.imag(gain * np.exp(1j * w * times)))[late].max() < 1e-6


def test_a_jump_rings_as_the_closed_form_says_wherever_it_falls_between_samples() -> None:
    wn, damping, at = 2 * np.pi * 125, 0.1, 0.012345678
    times = np.arange(400) / 4000
    read = respond(
        lambda t: (t >= at).astype(float), breaks=np.array([at]), times=times, response=resonance(125.0, damping)
    )
    tau, wd = np.maximum(times - at, 0), wn * np.sqrt(1 - damping**2)
    step = 1 - np.exp(-damping * wn * tau) * (np.cos(wd * tau) + damping * wn / wd * np.sin(wd * tau))
    assert np.abs(read - np.where(times >= at, step, 0)).max() < 1e-9


def test_a_constant_leaks_away_with_the_time_constant() -> None:
    times = np.arange(1000) / 10
    read = respond(lambda t: np.full_like(t, 2.0), breaks=NO_BREAKS, times=times, response=leak(50.0))
    assert np.allclose(read, 2 * np.exp(-times / 50), rtol=1e-12)


def test_a_chain_is_what_scipy_makes_of_its_product() -> None:
    wn, damping, constant = 2 * np.pi * 25, 0.05, 0.4
    chain = resonance(25.0, damping).then(leak(constant))
    rate = 20_000
    fine = np.arange(2 * rate) / rate

    def sensed(t: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.sin(11 * t) + 0.3 * np.sin(90 * t)

    numerator = wn**2 * np.array([1.0, 0.0])
    denominator = np.polymul([1, 2 * damping * wn, wn**2], [1, 1 / constant])
    expected = signal.lsim((numerator, denominator), sensed(fine), fine)[1][::20]
    read = respond(sensed, breaks=NO_BREAKS, times=fine[::20], response=chain)
    assert np.abs(read - expected).max() < 1e-5  # scipy joins the samples by straight lines


def test_blocks_and_a_late_start_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    times = 0.731 + np.arange(3000) / 1000
    arguments = {"breaks": np.array([1.0, 2.2]), "response": resonance(40.0, 0.02).then(leak(3.0))}
    whole = respond(lambda t: np.sign(np.sin(3 * t)) + t, times=times, **arguments)
    monkeypatch.setattr("stickslip.signals.response.BLOCK", 97)
    assert (
        np.abs(respond(lambda t: np.sign(np.sin(3 * t)) + t, times=times, **arguments) - whole).max() < 1e-10
    )  # the grids' rounding


def test_instants_before_the_beginning_read_the_first_value() -> None:
    times = -0.01 + np.arange(200) / 1000
    read = respond(np.cos, breaks=NO_BREAKS, times=times, response=resonance(50.0, 0.1))
    assert np.allclose(read[:10], 1.0, atol=1e-12)
