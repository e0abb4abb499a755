"""Two clocks on one motion: the offset is found below a tenth of a sample, its interval holds the truth."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip import Record, read_record
from stickslip.errors import EstimateError, RecordError
from stickslip.signals import clock_offset, clock_rate, synchronise

FS_A, FS_B = 1000.0, 730.0


def motion(t: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A displacement that never repeats, and its velocity."""
    rng = np.random.default_rng(seed)
    f, p = rng.uniform(0.5, 18, 12), rng.uniform(0, 2 * np.pi, 12)
    size = 1e-3 / (1 + f / 4) ** 2
    angle = 2 * np.pi * np.outer(t, f) + p
    return np.sin(angle) @ size, np.cos(angle) @ (2 * np.pi * f * size)


def pair(offset: float, noise: float, seed: int, *, velocity: bool = False, skew: float = 0.0) -> tuple[Record, Record]:
    """Instrument a has the displacement; b, whose clock reads `offset` too little, the same or the velocity."""
    rng = np.random.default_rng(10_000 + seed)
    t_a, t_b = np.arange(4000) / FS_A, np.arange(2800) / FS_B
    true_b = (t_b - 1.9178) * (1 + skew) + 1.9178 + offset
    x, _ = motion(t_a, seed)
    seen = motion(true_b, seed)[1 if velocity else 0]
    a = Record.of({"x": x + noise * np.std(x) * rng.normal(size=len(x))}, fs=FS_A)
    name = "v" if velocity else "x"
    b = Record.of({name: seen + noise * np.std(seen) * rng.normal(size=len(seen))}, fs=FS_B)
    return a, b


@pytest.mark.parametrize(
    ("noise", "velocity"),
    [(0.0, False), (1e-3, False), (1e-2, False), (5e-2, False), (0.0, True), (1e-3, True), (1e-2, True), (2e-2, True)],
)
def test_no_bias_and_an_interval_that_holds(noise, velocity):
    errors, hits = [], 0
    for seed in range(40):
        offset = 0.05 + (seed + 0.5) / 40 / FS_A  # all fractions of a sample
        a, b = pair(offset, noise, seed, velocity=velocity)
        found = clock_offset(a, b, on=("x", "v") if velocity else "x")
        errors.append((found.value - offset) * FS_A)
        hits += found.includes(offset)
    assert abs(np.mean(errors)) < 0.1  # samples
    assert abs(np.mean(errors)) < 4 * np.std(errors) / np.sqrt(40) + 1e-3
    if noise:
        assert hits >= 33  # of 40 intervals of 95 %, fewer hold the truth with probability 1e-3


def test_no_pull_towards_half_samples():
    """Minimising the residual of an interpolated signal is pulled to half samples; the error must not follow them."""
    fractions = (np.arange(60) + 0.5) / 60
    errors = []
    for seed, fraction in enumerate(fractions):
        t = np.arange(4000) / FS_A
        rng = np.random.default_rng(seed)
        offset = 0.02 + fraction / FS_A
        records = [motion(shift, 7)[0] for shift in (t, t + offset)]
        noisy = [x + 0.05 * np.std(x) * rng.normal(size=len(x)) for x in records]
        a, b = (Record.of({"x": x}, fs=FS_A) for x in noisy)
        errors.append((clock_offset(a, b).value - offset) * FS_A)
    pull = np.polyfit(np.sin(2 * np.pi * fractions), errors, 1)[0]
    assert abs(pull) < 4 * np.std(errors) * np.sqrt(2 / 60) + 1e-3
    assert np.max(np.abs(errors)) < 0.5


def test_synchronised_channels_lie_on_each_other():
    a, b = pair(-0.3137, 1e-4, 3)
    both = synchronise(a, b)
    assert set(both) == {"x", "x_b"}
    assert (both.fs, both.stamps) == (FS_A, None)
    inside = slice(100, -100)
    assert np.std((both["x"] - both["x_b"])[inside]) < 5e-4 * np.std(both["x"])
    step = both.history[-1]
    low, high = step.arguments["offset_interval"]
    assert low < step.arguments["offset"] < high
    assert step.arguments["offset"] == pytest.approx(-0.3137, abs=1e-4)
    given = synchronise(a, b, offset=-0.3137)
    assert np.allclose(given["x_b"][inside], both["x_b"][inside][: len(given["x_b"][inside])], atol=1e-5)


def test_only_the_time_both_recorded_is_kept():
    a, b = pair(0.75, 0.0, 5)
    both = synchronise(a, b)
    assert both.start == pytest.approx(0.75, abs=1 / FS_A)
    assert both.time[-1] == pytest.approx(min(3.999, 0.75 + 2799 / FS_B), abs=2 / FS_A)


def test_clocks_of_different_rate_are_told_and_mended():
    a, b = pair(0.1, 1e-3, 8, skew=2e-3)
    found, rate = clock_offset(a, b), clock_rate(a, b)
    assert rate.value == pytest.approx(1.002, abs=2e-4)
    assert "different rates" in found.status
    assert any("rate ratio" in check for check in found.checks)
    plain, mended = synchronise(a, b), synchronise(a, b, rate=rate)
    inside = slice(50, -50)
    left = [np.std((both["x"] - both["x_b"])[inside]) for both in (plain, mended)]
    assert left[1] < 0.3 * left[0]


def test_a_motion_that_repeats_is_told():
    t = np.arange(4000) / FS_A
    a, b = (Record.of({"x": np.sin(2 * np.pi * 3 * s)}, fs=FS_A) for s in (t, t + 0.05))
    offset = clock_offset(a, b)
    assert offset.value == pytest.approx(0.05, abs=1e-6)
    assert "the motion repeats" in offset.status


def test_channels_that_saw_different_things_are_refused():
    rng = np.random.default_rng(0)
    a, b = (Record.of({"x": rng.normal(size=3000)}, fs=FS_A) for _ in range(2))
    with pytest.raises(EstimateError, match="name the channels that saw the same motion"):
        clock_offset(a, b)
    load = Record.of({"load": np.sin(np.arange(3000) / 50)}, fs=FS_A)
    with pytest.raises(RecordError, match="a displacement and its velocity"):
        clock_offset(a, load, on=("x", "load"))
    with pytest.raises(RecordError, match="do not overlap"):
        synchronise(a, b, offset=1e4)


# ---- the rack and pinion rig


def rack(folder, ni: str, mr: str, columns: tuple[str, str]) -> tuple[Record, Record]:
    force, x = columns
    a = read_record(folder / ni, channels={"force": f"-200 * ({force} + 0.115) [N]", "x": f"{x} / 55.4 [m]"})
    b = read_record(folder / mr, channels={"v": "`Servo motor speed` * -20/60/1000 [m/s]"})
    return a, b


def test_the_two_instruments_of_the_rack(dataset):
    """Inertia by least squares of force = M a + F_v v + F_c sign v + offset over the strokes; published: 61.35 kg."""
    from scipy.ndimage import gaussian_filter1d

    a, b = rack(dataset("rack_two_daq"), "24072020-sym_br_r0_ni.csv", "24072020-sym_br_r0_mr.csv", ("#2", "#4"))
    offset = clock_offset(a, b, on=("x", "v"))
    assert offset.value == pytest.approx(0.0248, abs=3e-4)
    assert offset.sd < 1e-4
    both = synchronise(a, b, on=("x", "v"))
    sigma = 8  # samples: 4 ms, far below the time of a stroke
    force, v = gaussian_filter1d(both["force"], sigma), gaussian_filter1d(both["v"], sigma)
    acceleration = gaussian_filter1d(both["v"], sigma, order=1) * both.fs
    moving = np.abs(v) > 0.02
    moving[:100] = moving[-100:] = False
    design = np.column_stack([acceleration, v, np.sign(v), np.ones_like(v)])[moving]
    (mass, viscous, coulomb, _), *_ = np.linalg.lstsq(design, force[moving], rcond=None)
    assert mass == pytest.approx(61.4, rel=0.02)
    assert viscous == pytest.approx(92, rel=0.1)
    assert coulomb == pytest.approx(49, rel=0.1)


def test_the_short_stroke_of_the_rack(dataset):
    a, b = rack(dataset("rack_two_daq"), "a3NI.csv", "a3MR.csv", ("#2", "#4"))
    offset = clock_offset(a, b, on=("x", "v"))
    assert offset.value == pytest.approx(-0.0060, abs=3e-4)
    both = synchronise(a, b, on=("x", "v"), offset=offset)
    position = np.cumsum(both["v"]) / both.fs
    fit = np.polyfit(both["x"], position, 1)
    assert fit[0] == pytest.approx(1.0, abs=0.01)
    assert np.std(position - np.polyval(fit, both["x"])) < 2e-4  # m, over a stroke of 0.15 m


def test_the_shared_motion_is_found_by_its_names():
    a, b = pair(0.05, 0.0, 1, velocity=True)
    assert clock_offset(a, b) == clock_offset(a, b, on=("x", "v"))
    assert clock_offset(b, a) == clock_offset(b, a, on=("v", "x"))
    step = synchronise(a, b).history[-1]
    assert step.arguments["on"] == ("x", "v")
    assert "found on x and v" in step.outcome
    plate = Record.of({"plate": a["x"]}, fs=a.fs)
    with pytest.raises(RecordError, match=r"have plate and v;.*on=\("):
        synchronise(plate, b)
