"""The friction felt against the friction computed, on a rig whose mounts swing; and what a tap excites."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.signal import lsim, lti

import stickslip as ss
from rigs import CASES, RIG, measured, told
from stickslip import bench
from stickslip.balance.mounts import _MeanLines, _swinging
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import kinds
from stickslip.signals.response import resonance


@cache
def compared(frequency: float, seconds: float = 3.0) -> ss.balance.ForceComparison:
    record = told(measured(frequency, 0.0, seconds)[0])
    return ss.balance.compare_force(ss.friction_force(record, **RIG))  # the rig is taken from the history


@pytest.mark.parametrize("frequency", list(CASES))
def test_both_mounts_are_found_and_named(frequency: float) -> None:
    first, second = compared(frequency).resonances
    assert (first.name, second.name) == ("mount of the accelerometer", "mount of the load cell")
    assert first.frequency.value == pytest.approx(125, rel=0.006)
    assert first.damping.value == pytest.approx(0.10, abs=0.006)
    assert second.frequency.value == pytest.approx(250, rel=0.03)
    assert (first.channels, second.channels) == (("a",), ("load",))


def test_the_mounts_intervals_hold() -> None:
    rig, inside = ss.Rig(), []
    run = measured_run(11.1)
    for seed in range(4):
        record = told(rig.measure(run, fs=4000, rng=seed, start=6.0))
        first, second = ss.balance.compare_force(record, **RIG).resonances
        inside += [first.frequency.includes(125.0), first.damping.includes(0.1)]
        inside += [second.frequency.includes(250.0), second.damping.includes(0.05)]
    assert np.mean(inside) > 0.85


@pytest.mark.parametrize("seed", range(5))
def test_no_mounts_are_named_where_noise_explains_the_lines(seed: int) -> None:
    """Two mounts alike filter the pull, and with it noise that is a little larger than it seems."""
    rng, count, mass = np.random.default_rng(seed), np.arange(1, 86), 0.284
    load, pull = (0.05 * np.exp(2j * np.pi * rng.random(85)) / count**power for power in (1, 2))
    noises = {name: sd * rng.standard_normal((85, 2)) @ [1, 1j] for name, sd in {"a": 1e-4, "load": 2e-5}.items()}
    more = 1.2 * 2e-4 * rng.standard_normal((85, 2)) @ [1, 1j]
    sd = np.full(85, math.hypot(1e-4, 2e-4 / mass))
    acceleration = (pull - load) / mass + noises["a"]
    means = _MeanLines(7.75 * count, acceleration, load + noises["load"], pull + more, sd, np.full(85, 2e-5), mass, 0.0)
    assert not _swinging(means)


@cache
def measured_run(frequency: float) -> ss.solve.Trajectory:
    amplitude, kinetic = CASES[frequency]
    law = ss.laws.CompliantContact(kinetic, stiffness=192000, damping=23.9)
    slider = ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(amplitude, frequency=frequency), **RIG)
    return ss.simulate(slider, duration=7.5)


@pytest.mark.parametrize("frequency", list(CASES))
def test_they_agree_until_the_mounts_swing(frequency: float) -> None:
    """The ratio of the two readings is that of the mounts: 10 % off 1 in the complex plane at 33 Hz."""
    comparison = compared(frequency)
    grid = np.linspace(10, 60, 2000)
    off = np.abs(resonance(125.0, 0.1).at(grid) / resonance(250.0, 0.05).at(grid) - 1)
    assert comparison.agree_up_to.includes(grid[np.argmax(off > 0.1)])
    assert comparison.status == "ok"
    verdicts = [band.verdict for band in comparison.bands]
    assert verdicts[0] == "agree"
    assert "differ" in verdicts
    assert verdicts[-1] == "noise"  # nothing in common at 2 kHz
    for band in comparison.bands:
        if band.verdict != "noise" and band.low > 20 and band.high < 110:
            true = resonance(125.0, 0.1).at(band.centre) / resonance(250.0, 0.05).at(band.centre)
            assert band.gain * np.exp(1j * band.phase) == pytest.approx(complex(true), rel=0.15)


def test_sensors_without_fault_agree_everywhere() -> None:
    rig = ss.Rig.perfect().having("x", white=1e-7).having("z", white=1e-7).having("a", white=1e-3)
    record = rig.having("load", white=1e-3).measure(measured_run(8.7), fs=4000, rng=1, start=5.0)
    found = ss.balance.compare_force(record, **RIG)
    assert found.resonances == ()
    assert found.agree_up_to.value > 400
    assert found.difference.value < 0.01


def test_the_difference_in_time_is_that_of_the_traces() -> None:
    comparison = compared(8.7)
    assert comparison.difference.value == pytest.approx(float(np.std(comparison.direct - comparison.indirect)))
    total = np.sqrt(sum(band.difference**2 for band in comparison.bands))
    assert total == pytest.approx(comparison.difference.value, rel=0.02)  # Parseval: the bands leave nothing out
    assert comparison.difference.interval[0] < comparison.difference.value < comparison.difference.interval[1]


def test_unrelated_forces_have_nothing_in_common() -> None:
    record = told(measured(8.7)[0])
    noise = np.random.default_rng(1).standard_normal(len(record))
    found = ss.balance.compare_force(record.with_channel("load", noise, unit="N"), **RIG)
    assert sum(band.verdict != "noise" for band in found.bands) <= 2  # of 19, each by chance in one of 100


def test_a_wrong_sign_and_a_lag_are_said() -> None:
    record = told(measured(8.7)[0])
    turned = ss.balance.compare_force(record.with_channel("load", -record["load"], unit="N"), **RIG)
    assert "opposite signs" in turned.status
    assert turned.agree_up_to.value == 0
    late = ss.balance.compare_force(measured(8.7)[0], **RIG)
    assert "no delay of a sensor is stated" in late.status


def test_a_cell_at_the_end_of_its_range_is_said() -> None:
    record = told(measured(8.7, seconds=3.0)[0])
    cut = record.with_channel("load", np.clip(record["load"], -1, 1), unit="N")
    found = ss.balance.compare_force(cut, **RIG)
    assert "at the end of the range is load in" in found.status
    assert found.difference.status == found.agree_up_to.status != "ok"


def test_a_motion_that_does_not_repeat_is_compared_in_windows() -> None:
    rng = np.random.default_rng(2)
    drive = ss.drives.MultiTone(tuple((1e-3 / n, 2.0 + 1.37 * n, 6.28 * rng.random()) for n in range(1, 6)))
    slider = ss.Oscillator(law=ss.laws.Coulomb(1.5), drive=drive, **RIG)
    rig = ss.Rig().having("x", lag=0.0).having("z", lag=0.0)
    record = rig.measure(ss.simulate(slider, duration=20.0), fs=1000, rng=1, start=2.0)
    found = ss.balance.compare_force(record.with_details("load", inertia=0.05), **RIG)
    assert "windows" in found.agree_up_to.checks[0]
    assert 15 < found.agree_up_to.value < 60


def test_what_can_not_be_compared_is_refused() -> None:
    record = measured(8.7)[0]
    with pytest.raises(RecordError, match="load"):
        ss.balance.compare_force(ss.Record.of({"x": record["x"]}, fs=4000), **RIG)
    with pytest.raises(EstimateError, match="tolerance"):
        ss.balance.compare_force(record, tolerance=2.0, **RIG)
    with pytest.raises(EstimateError, match="give mass= or stiffness="):
        ss.balance.compare_force(record)


def test_the_figure_and_the_plain_data() -> None:
    comparison = compared(8.7)
    figure = ss.figures.plot_force_comparison(comparison)
    words = [text.get_text() for text in figure.axes[2].texts]
    assert any("accelerometer" in word for word in words)
    told_ = comparison.to_dict()
    assert len(told_["bands"]) == len(comparison.bands)
    assert told_["resonances"][0]["name"] == "mount of the accelerometer"


# ---- a hammer tap


@cache
def struck() -> tuple[np.ndarray, np.ndarray]:
    """The thesis's impact test: a contact that holds, a half sine of 2 ms on the mass, both mounts swinging."""
    fs, fine, mass, spring, inertia, damping, stiffness = 4000, 10, 2.42, 2310.0, 0.05, 23.9, 192000.0
    t = np.arange(fs * fine // 2) / (fs * fine)
    blow = np.where((t > 0.1) & (t < 0.102), 20 * np.sin(np.pi * (t - 0.1) / 2e-3), 0.0)
    whole = [mass, damping, spring + stiffness]
    x, v = (lsim(lti(numerator, whole), blow, t)[1] for numerator in ([1.0], [1.0, 0.0]))
    friction = stiffness * x + damping * v
    a = (blow - friction - spring * x) / mass

    def swung(values: np.ndarray, frequency: float, ratio: float) -> np.ndarray:
        w = 2 * np.pi * frequency
        read: np.ndarray = lsim(lti([w * w], [1, 2 * ratio * w, w * w]), values, t)[1][::fine]
        return read

    return swung(a, 125.0, 0.1), swung(friction + inertia * a, 250.0, 0.05)


def tap(seed: int = 1, noise: float = 1.0) -> ss.Record:
    """What accelerometer and load cell read of it."""
    rng = np.random.default_rng(seed)
    readings = [
        each + noise * level * rng.standard_normal(len(each))
        for each, level in zip(struck(), (0.04, 0.002), strict=True)
    ]
    return ss.Record.of(dict(zip(("a", "load"), readings, strict=True)), fs=4000)


TRUE = {
    "coupled contact": (np.sqrt(194310 / 2.42) / (2 * np.pi), 23.9 / 2 / np.sqrt(194310 * 2.42)),
    "mount of the accelerometer": (125.0, 0.1),
    "mount of the load cell": (250.0, 0.05),
}


@pytest.mark.parametrize("mass", [None, "2.42 kg"])
def test_a_tap_shows_the_contact_and_both_mounts(mass: str | None) -> None:
    mount = ss.balance.impact_test(tap(), mass=mass)
    assert [resonance.name for resonance in mount.resonances] == list(TRUE)
    assert [resonance.channels for resonance in mount.resonances] == [("a", "load"), ("a",), ("load",)]
    for each in mount.resonances:
        frequency, damping = TRUE[each.name]
        assert each.frequency.value == pytest.approx(frequency, rel=0.003)
        assert each.damping.value == pytest.approx(damping, rel=0.02)
    assert mount.status == "ok"
    assert 0.102 < mount.time < 0.12


def test_the_intervals_of_a_tap_hold() -> None:
    inside = []
    for seed in range(10):
        mount = ss.balance.impact_test(tap(seed, noise=3.0), mass=2.42)
        inside += [resonance.frequency.includes(TRUE[resonance.name][0]) for resonance in mount.resonances]
        inside += [
            resonance.damping.includes(TRUE[resonance.name][1])
            for resonance in mount.resonances
            if "mount" in resonance.name
        ]
    assert len(inside) == 50
    assert np.mean(inside) > 0.88


def test_without_a_tap_or_a_second_sensor_it_says_so() -> None:
    quiet = np.random.default_rng(1).standard_normal((2, 4000))
    with pytest.raises(EstimateError, match="tap"):
        ss.balance.impact_test(ss.Record.of({"a": quiet[0], "load": quiet[1]}, fs=4000))
    with pytest.raises(RecordError, match="a, load"):
        ss.balance.impact_test(ss.Record.of({"x": quiet[0]}, fs=4000))
    alone = ss.balance.impact_test(ss.Record.of({"a": tap()["a"]}, fs=4000))
    assert [resonance.name for resonance in alone.resonances] == [f"resonance seen by a, {k} of 2" for k in (1, 2)]
    assert "can not tell" in alone.resonances[0].evidence


def test_the_largest_of_several_modes_of_a_sensor_is_its_mount() -> None:
    """All were called its mount, and the one of the highest frequency was written into rig.toml."""
    struck_, time = tap(), np.arange(4000) / 4000 - 0.1
    fast = np.where(time > 0, 4 * np.exp(-120 * time) * np.sin(2 * np.pi * 700 * time), 0.0)
    two = struck_.with_channel("a", struck_["a"] + fast[: len(struck_)], unit="m/s^2")
    known = bench.commission(lambda step: two, steps=[bench.step_named("tap")]).known
    numbers = known.results["tap"].estimates
    assert [one.name for one in numbers[::2]] == [
        *(f"frequency of the {name}" for name in TRUE),
        "frequency of the resonance seen by a",
    ]
    assert known.settings()["sensors"]["a"]["mount"][0] == f"{numbers[2].value:.5g} Hz"
    assert len({one.name for one in numbers}) == len(numbers)


def test_what_moved_before_it_rang_is_no_tap() -> None:
    """A hum, a mass driven or let go as the record begins, and a tap of which the record keeps no rest."""
    time, noise = np.arange(4000) / 2000, np.random.default_rng(3).standard_normal((2, 4000))
    for frequency, decay in ((50.0, 0.0), (7.3, 0.0), (5.1, 0.3), (11.0, 4.0)):
        ring = np.exp(-decay * time) * np.cos(math.tau * frequency * time)
        record = ss.Record.of({"a": 5 * ring + 0.02 * noise[0], "load": -0.3 * ring + 2e-3 * noise[1]}, fs=2000)
        with pytest.raises(EstimateError, match=r"moves before it rings|rings begins|nothing that oscillates"):
            ss.balance.impact_test(record)
    with pytest.raises(EstimateError, match=r"begins 0\.00.* after the record.*rest before the tap"):
        ss.balance.impact_test(tap().between(0.1, 0.5))


def test_a_mass_that_was_let_go_is_told_from_one_that_was_tapped() -> None:
    """Held 8 mm out for a second; x goes on about 0, and a and load ring as after a tap."""
    time, noise = np.arange(6000) / 1000 - 1, np.random.default_rng(3).standard_normal((3, 6000))
    out = np.where(time > 0, np.exp(-0.1 * time) * np.cos(math.tau * 5.0 * time), 0.0)
    x = 8e-3 * np.where(time > 0, out, 1.0)
    readings = {"x": x + 1e-6 * noise[0], "a": -7.9 * out + 0.03 * noise[1], "load": -0.4 * out + 2e-3 * noise[2]}
    let_go = ss.balance.impact_test(ss.Record.of(readings, fs=1000))
    assert "no tap" in kinds(let_go.status)
    assert {one.status for one in let_go.estimates} == {let_go.status}
    assert ss.balance.impact_test(tap().with_channel("x", 1e-6 * noise[0][:2000], unit="m")).status == "ok"


def test_a_contact_that_slips_after_the_tap_is_told() -> None:
    record = tap()
    t = record.time
    slipping = record["a"] + np.where((t > 0.13) & (t < 0.145), 1.5, 0.0)
    mount = ss.balance.impact_test(ss.Record.of({"a": slipping, "load": record["load"]}, fs=4000))
    assert "no sum of decaying oscillations" in mount.status
    assert {one.status for one in mount.estimates} == {mount.status}
