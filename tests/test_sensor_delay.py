"""The delay between two sensors: at its bound, without bias between samples, and with intervals that hold."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import stickslip as ss
from stickslip.balance.lag import band_limited, unresolved_jumps
from stickslip.errors import EstimateError, RecordError
from stickslip.signals.alignment import Lines
from stickslip.signals.response import derivative_spectra, window

Array = NDArray[np.float64]
FS = 1000.0
T = np.arange(6000) / FS
RATE, DECAY, SIZE = 30.91, 0.025, 8e-3  # 1/s, 1/s, m: the air track's free vibration
NOISE = {"x": 2e-6, "a": 0.04}


def ring_down(delay: float, seed: int, mount: tuple[float, float] | None = None) -> ss.Record:
    """x and a of a free vibration, x later by `delay` than a, which may stand on a mount."""
    pole = complex(-DECAY, RATE)
    response = 1.0 + 0j
    if mount:
        w = 2 * math.pi * mount[0]
        response = w * w / (pole**2 + 2 * mount[1] * w * pole + w * w)
    rng = np.random.default_rng(seed)
    x = (SIZE * np.exp(pole * (T - delay))).real + NOISE["x"] * rng.standard_normal(T.size)
    a = (SIZE * pole**2 * response * np.exp(pole * T)).real + NOISE["a"] * rng.standard_normal(T.size)
    return ss.Record.of({"x": x, "a": a + 0.3}, fs=FS)


def bound() -> float:
    """Cramer-Rao, of a motion that neither channel knows: var(d) = (s_a^2 + w^4 s_x^2) / sum of (da/dt)^2."""
    slope = (SIZE * complex(-DECAY, RATE) ** 3 * np.exp(complex(-DECAY, RATE) * T)).real
    return math.sqrt((NOISE["a"] ** 2 + RATE**4 * NOISE["x"] ** 2) / np.sum(slope**2))


@pytest.mark.parametrize(("order", "channel"), [(0, "x"), (1, "v"), (2, "a")])
@pytest.mark.parametrize("shift", [0.0, 0.37e-3])
def test_the_spectrum_of_a_derivative_is_that_of_the_measured_one(order: int, channel: str, shift: float) -> None:
    """Of a chirp that begins and ends anyhow, against its derivative in closed form."""

    def motion(times: Array) -> dict[str, Array]:
        phase, rate = 20 * times + 15 * times**2, 20 + 30 * times
        return {
            "x": np.sin(phase), "v": rate * np.cos(phase), "a": 30 * np.cos(phase) - rate**2 * np.sin(phase),
        }  # fmt: skip

    found = derivative_spectra(motion(T)["x"], fs=FS, orders=[order], shift=shift)[0]
    true = np.fft.rfft(window(T.size) * motion(T - shift)[channel])
    assert np.abs(found - true).max() < 1e-6 * np.abs(true).max()


def test_the_misfit_is_expanded_as_its_residuals_change() -> None:
    """Against central differences of the residuals, and of the slopes that they confirm."""
    rng, n = np.random.default_rng(1), 50
    waves = rng.standard_normal((5, n)) + 1j * rng.standard_normal((5, n))
    noise = rng.uniform(0.5, 2.0, (2, n))
    lines = Lines(rng.uniform(1.0, 3.0, n), waves[0], waves[1:4], noise, waves[4], np.ones(n, dtype=bool))
    theta, steps = np.array([0.1, 1.3, 0.2, 0.15]), 1e-5 * np.eye(4)
    value, slopes, curvature, products = lines.expansion(theta)
    by_theta = np.array([lines.residual(theta + d) - lines.residual(theta - d) for d in steps]) / 2e-5
    residual = lines.residual(theta)
    bent = np.array([lines.expansion(theta + d)[1] - lines.expansion(theta - d)[1] for d in steps]) / 2e-5
    assert value == pytest.approx(np.sum(np.abs(residual) ** 2))
    bound = {"rtol": 1e-8, "atol": 1e-6}  # what differences of such steps leave
    np.testing.assert_allclose(slopes, (by_theta.conj() @ residual).real, **bound)
    np.testing.assert_allclose(products, (by_theta.conj() @ by_theta.T).real, **bound)
    np.testing.assert_allclose(curvature, bent, **bound)


@pytest.mark.parametrize("part", [0.0, 0.25, 0.5, 0.75])
@pytest.mark.parametrize("whole", [1, -7])
def test_no_lag_between_samples_is_favoured(part: float, whole: int) -> None:
    delay = (whole + part) / FS
    delays = [ss.balance.sensor_delay(ring_down(delay, seed)).delay for seed in range(5)]
    errors = np.array([estimate.value + delay for estimate in delays])
    assert abs(errors.mean()) < 3.5 * bound() / math.sqrt(len(errors))
    assert delays[0].sd < 1.1 * bound()


def test_it_reaches_its_bound_and_the_interval_holds() -> None:
    delays = [ss.balance.sensor_delay(ring_down(1.2585e-3, seed)).delay for seed in range(100, 125)]
    errors = np.array([estimate.value + 1.2585e-3 for estimate in delays])
    assert np.sqrt(np.mean(errors**2)) < 1.1 * bound() * (1 + 2 / math.sqrt(2 * len(errors)))
    assert np.mean([estimate.sd for estimate in delays]) < 1.1 * bound()
    assert np.mean([estimate.includes(-1.2585e-3) for estimate in delays]) > 0.8  # of 25; 95 % less three deviations


@pytest.mark.parametrize("channels", [("x", "z"), ("x", "v"), ("v", "a")])
@pytest.mark.parametrize("delay", [25e-3, -3.21e-3])
def test_any_two_channels_of_one_motion_are_aligned(channels: tuple[str, str], delay: float) -> None:
    """Two tones, in units of their own."""
    rng, order = np.random.default_rng(6), {"x": 0, "z": 0, "v": 1, "a": 2}

    def reading(channel: str, times: Array) -> Array:
        motion = sum(a * (1j * w) ** order[channel] * np.exp(1j * w * times) for a, w in ((1e-3, 31.0), (4e-4, 77.7)))
        clean = np.real(motion)
        return np.asarray(clean + 1e-3 * np.std(clean) * rng.standard_normal(times.size))

    first, second = channels
    found = ss.balance.sensor_delay(
        ss.Record.of({first: reading(first, T), second: reading(second, T - delay)}, fs=FS), channels=channels
    )
    assert "more than noise" not in found.status
    assert found.delay.value == pytest.approx(delay, abs=5 * found.delay.sd)
    assert found.delay.sd < 3e-6


def test_the_least_residual_is_drawn_half_way_between_samples() -> None:
    errors = [
        ss.balance.sensor_delay(ring_down(5.1 / FS, seed), method="residual").delay.value + 5.1 / FS
        for seed in range(4)
    ]
    assert max(errors) < -0.05 / FS  # the phase is 1e-6 s off
    assert "interpolation" in ss.balance.sensor_delay(ring_down(5.1 / FS, 1), method="residual").status
    with pytest.raises(EstimateError, match="2 records"):
        ss.balance.sensor_delay([ring_down(0.0, 1), ring_down(0.0, 2)], method="residual")


def test_the_least_residual_at_a_few_samples_a_second() -> None:
    t, rng = np.arange(400) / 8, np.random.default_rng(0)
    x, a = (sign * np.sin(t) + 1e-6 * rng.standard_normal(t.size) for sign in (1, -1))
    delay = ss.balance.sensor_delay(ss.Record.of({"x": x, "a": a}, fs=8.0), method="residual")
    assert delay.delay.includes(0.0)


def test_a_stated_mount_is_held_and_a_hidden_one_is_said() -> None:
    record = ring_down(1.2585e-3, 3, mount=(125.0, 0.1))
    blind = ss.balance.sensor_delay(record)
    assert blind.delay.value + 1.2585e-3 == pytest.approx(2 * 0.1 / (2 * math.pi * 125), rel=0.02)
    assert "mount of a delays" in blind.status
    delay = ss.balance.sensor_delay(record.with_details("a", mount=(125.0, 0.1)))
    assert abs(delay.delay.value + 1.2585e-3) < 4 * bound()
    assert delay.mount_frequency is None
    assert "held at 125 Hz" in delay.delay.checks[0]


def test_a_whole_cycle_more_is_named() -> None:
    delay = ss.balance.sensor_delay(ring_down(1.2585e-3, 3))
    assert "repeats itself" in delay.status
    assert any(abs(other + 1.2585e-3 - 2 * math.pi / RATE) < 2e-3 for other in delay.others)


def test_a_sensor_of_the_wrong_sign_is_found() -> None:
    record = ring_down(1.2585e-3, 3)
    turned = record.with_channel("a", -record["a"], unit="m/s^2")
    delay = ss.balance.sensor_delay(turned)
    assert delay.gain.value == pytest.approx(-1, abs=1e-3)
    assert "wrong sign" in delay.status


FRICTION = ((11.1, 2e-3, 1.1), (8.7, 1.1e-3, 1.1), (0.0, 8e-3, 0.0))
LAG = 0.0389 / 30.91


@cache
def moved(frequency: float, amplitude: float, kinetic: float) -> ss.solve.Trajectory:
    contact = ss.laws.CompliantContact(kinetic, stiffness=192000, damping=23.9) if kinetic else ss.laws.Coulomb(0.0)
    drive = ss.drives.HarmonicBase(amplitude, frequency=frequency) if frequency else ss.drives.Release()
    slider = ss.Oscillator(mass=2.42, stiffness=2310, damping=0.1196, law=contact, drive=drive)
    return ss.simulate(slider, duration=10.0, start={} if frequency else {"x": amplitude})


@cache
def measured(frequency: float, amplitude: float, kinetic: float, seed: int = 1) -> ss.Record:
    run = moved(frequency, amplitude, kinetic)
    return ss.Rig().measure(run, fs=4000, rng=seed, start=4.0 if frequency else 0.1)


def test_runs_with_friction_tell_the_mount_and_the_delay() -> None:
    delay = ss.balance.sensor_delay(measured(*FRICTION[0]))
    assert delay.mount_frequency is not None
    assert delay.mount_damping is not None
    assert delay.mount_frequency.includes(125)
    assert delay.mount_damping.includes(0.1)
    assert delay.delay.includes(-LAG)
    assert delay.mount_frequency.sd < 2.0


def test_several_runs_are_answered_together() -> None:
    runs = [measured(*each) for each in FRICTION]
    alone, joint = ss.balance.sensor_delay(runs[0]), ss.balance.sensor_delay(runs)
    assert joint.status == "ok"  # no delay of whole cycles fits all of them
    assert joint.delay.sd < alone.delay.sd
    assert abs(joint.delay.value + LAG) < 3 * joint.delay.sd
    assert joint.mount_frequency is not None


def test_what_is_found_is_used() -> None:
    """The whole way: the delay and the mount found in one run, stated for another, and the friction of that."""
    runs = [measured(*each) for each in FRICTION]
    delay = ss.balance.sensor_delay([runs[0], runs[2]])
    assert delay.mount_frequency is not None
    assert delay.mount_damping is not None
    record = runs[1].with_details("a", mount=(delay.mount_frequency.value, delay.mount_damping.value))
    for channel in ("x", "z"):
        record = record.with_details(channel, delay=-delay.delay.value)
    force = ss.friction_force(record, mass=2.42, stiffness=2310, damping=0.1196, method="motion")
    true = moved(*FRICTION[1]).sample(4.0 + force.time, ("friction",))[0][0]
    assert np.sqrt(np.mean((force["friction"] - true)[400:-400] ** 2)) < 0.03
    late = runs[1].with_details("a", mount=(delay.mount_frequency.value, delay.mount_damping.value))
    raw = ss.friction_force(late, mass=2.42, stiffness=2310, damping=0.1196, method="motion")
    true = moved(*FRICTION[1]).sample(4.0 + raw.time, ("friction",))[0][0]
    assert np.sqrt(np.mean((raw["friction"] - true)[400:-400] ** 2)) > 0.05


def test_swapped_channels_are_found() -> None:
    record = ring_down(1.2585e-3, 3)
    swapped = ss.Record.of({"x": record["a"], "a": record["x"]}, fs=FS)
    with pytest.raises(EstimateError, match="swapped"):
        ss.balance.sensor_delay(swapped)
    friction = measured(*FRICTION[0])
    swapped = ss.Record.of({"x": friction["a"], "a": friction["x"]}, fs=4000)
    with pytest.raises(EstimateError, match="swapped"):
        ss.balance.sensor_delay(swapped)


def test_a_wrong_unit_is_named() -> None:
    record = ring_down(1.2585e-3, 3)
    delay = ss.balance.sensor_delay(record.with_channel("a", record["a"] / 9.80665, unit="m/s^2"))
    assert "0.102 times" in delay.status
    assert delay.delay.includes(-1.2585e-3)


def test_noise_that_is_not_white_widens_the_interval() -> None:
    rng = np.random.default_rng(1)
    record = ring_down(1.2585e-3, 3)
    slow = np.fft.rfft(rng.standard_normal(T.size))
    slow *= 10 / np.maximum(np.fft.rfftfreq(T.size, 1 / FS), 0.5)
    louder = record.with_channel("a", record["a"] + 0.04 * np.fft.irfft(slow, T.size), unit="m/s^2", noise=0.04)
    delay = ss.balance.sensor_delay(louder).delay
    assert 1.5 < delay.sd / bound() < 4  # (1 + (10/5)^2)^(1/2) = 2.2 at the line
    assert delay.includes(-1.2585e-3)


def test_a_long_record_in_blocks_says_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    record = ring_down(1.2585e-3, 3)
    whole = ss.balance.sensor_delay(record).delay
    monkeypatch.setattr("stickslip.signals.alignment.BLOCK", 2000)
    parts = ss.balance.sensor_delay(record).delay
    assert abs(parts.value - whole.value) < 2 * bound()
    assert parts.sd == pytest.approx(whole.sd, rel=0.15)


def square(offset: float, delay: float, *, filtered: bool, cycle: float = 40.0) -> ss.Record:
    """x and a of an acceleration of +-1 m/s^2, jumping twice in `cycle` samples, `offset` after one; a is late."""
    rng, turn = np.random.default_rng(1), 2 * math.pi * FS / cycle
    waves = turn * np.arange(1, 16 if filtered else 400, 2)[:, None]  # up to 0.375 of the rate
    times = T - offset / FS
    x = np.sum(-4 * turn / math.pi / waves**3 * np.sin(waves * times), axis=0)
    a = np.sign(np.sin(turn * (times - delay)))
    if filtered:
        a = np.sum(4 * turn / math.pi / waves * np.sin(waves * (times - delay)), axis=0)
    noise = {"x": 2e-7, "a": 0.01}
    return ss.Record.of(
        {name: v + noise[name] * rng.standard_normal(T.size) for name, v in (("x", x), ("a", a))}, fs=FS
    )


@pytest.mark.parametrize(("offset", "delay"), [(0.1, 0.0), (0.5, 0.0), (0.8, 0.0), (0.5, 1.7e-3)])
def test_jumps_sampled_without_a_filter_leave_a_delay_unknown_by_half_a_sample(offset: float, delay: float) -> None:
    """Each comes at the same instant between two samples: from there to either of them no reading differs."""
    raw = ss.balance.sensor_delay(square(offset, delay, filtered=False))
    assert raw.delay.includes(delay)
    assert 0.2 < raw.delay.sd * FS < 0.35  # 1/sqrt(12) where nothing but jumps tells the delay
    assert raw.mount_frequency is None
    assert raw.gain.includes(1.0)
    assert "between two samples" in raw.delay.checks[0]
    filtered = ss.balance.sensor_delay(square(offset, delay, filtered=True)).delay
    assert filtered.includes(delay)
    assert filtered.sd * FS < 0.02


@pytest.mark.parametrize("cycle", [40.0, 37.3, 203.7, 1013.1])
def test_jumps_sampled_without_a_filter_are_no_difference_of_the_sensors(cycle: float) -> None:
    """Put into the middle of their intervals they left 2.6 to 17 times the power of the noise of exact sensors."""
    lag = ss.balance.sensor_delay(square(0.3, 0.0, filtered=False, cycle=cycle))
    assert lag.delay.includes(0.0)
    assert "more than noise" not in lag.status


def test_unresolved_jumps_are_those_that_no_sample_lies_on() -> None:
    steps = np.where(np.arange(400) // 50 % 2, 1.0, -1.0)
    noise = 0.01 * np.random.default_rng(1).standard_normal(400)
    jumps = unresolved_jumps(steps + noise).sizes
    assert np.flatnonzero(jumps).tolist() == [49, 99, 149, 199, 249, 299, 349]
    np.testing.assert_allclose(np.abs(jumps[jumps != 0]), 2.0, atol=0.06)
    assert unresolved_jumps(np.sin(np.arange(400) / 9)).unresolved < 1e-3
    lines = np.arange(1, 39, 2)[:, None]  # of a square wave of 100 samples: up to 0.39 of the rate
    smooth = np.sum(np.sin(lines * 2 * np.pi * (np.arange(400) - 49.3) / 100) / lines, axis=0) * 4 / np.pi
    assert unresolved_jumps(smooth + noise).unresolved < 0.03
    limited = np.fft.rfft(band_limited(steps, np.diff(steps))[100:300]) * np.exp(2j * np.pi * np.arange(101) / 400)
    np.testing.assert_allclose(np.abs(limited[2:80:4]), 400 / (np.pi * np.arange(1, 40, 2)), rtol=0.02)


def test_channels_that_do_not_follow_one_motion_are_told() -> None:
    rng = np.random.default_rng(2)
    record = ss.Record.of({"x": np.sin(30 * T), "a": np.sin(47 * T) + 0.01 * rng.standard_normal(T.size)}, fs=FS)
    with pytest.raises(EstimateError, match="does not follow"):
        ss.balance.sensor_delay(record)
    other = ring_down(0.0, 1)
    other = other.with_channel("a", other["a"] + 0.5 * np.sin(40 * T), unit="m/s^2")
    assert "more than noise" in ss.balance.sensor_delay(other).status


@pytest.mark.parametrize(
    ("channels", "match"), [(("x", "load"), "one motion"), (("a", "x"), "turn them round"), (("x", "x"), "one motion")]
)
def test_what_can_not_be_compared_is_refused(channels: tuple[str, str], match: str) -> None:
    record = ring_down(0.0, 1)
    record = record.with_channel("load", record["a"], unit="N")
    with pytest.raises(EstimateError, match=match):
        ss.balance.sensor_delay(record, channels=channels)


def test_what_can_not_be_answered_is_refused() -> None:
    rng = np.random.default_rng(1)
    silent = ss.Record.of({"x": rng.standard_normal(6000), "a": rng.standard_normal(6000)}, fs=FS)
    with pytest.raises(EstimateError, match="no line"):
        ss.balance.sensor_delay(silent)
    with pytest.raises(EstimateError, match="does not change"):
        ss.balance.sensor_delay(ss.Record.of({"x": np.zeros(6000), "a": rng.standard_normal(6000)}, fs=FS))
    with pytest.raises(EstimateError, match="magic"):
        ss.balance.sensor_delay(silent, method="magic")
    with pytest.raises(EstimateError, match="no record"):
        ss.balance.sensor_delay([])
    with pytest.raises(RecordError, match="missing"):
        ss.balance.sensor_delay(ss.Record.of({"x": T}, fs=FS))
