"""Coupling: coherence, phase, delay and energy against closed forms and the virtual rig."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import stickslip as ss


@cache
def virtual() -> tuple[ss.Record, ss.squeak.Coupling]:
    record = ss.squeak.squeak_record(ss.simulate(ss.squeak.squeak_rig(), duration=1.6), snr=30, rng=1)
    return record, ss.squeak.coupling(record)


def tones(lag: float, *, noise: float = 0.1, seed: int = 0) -> tuple[ss.Record, ss.squeak.Squeaks]:
    """Two channels with one tone at 500 Hz between 0.3 and 0.7 s, the second `lag` seconds later, and their noise."""
    t = np.arange(10_000) / 10_000
    rng = np.random.default_rng(seed)
    inside = np.exp(-((np.maximum(0, np.abs(t - 0.5) - 0.2) / 0.01) ** 2))
    sound = inside * sum(np.sin(2 * np.pi * k * 500 * (t - lag)) / k**2 for k in (1, 2, 3))
    shaken = inside * np.sin(2 * np.pi * 500 * t)
    channels = {"a": shaken, "sound": sound}
    record = ss.Record.of({n: v + noise * rng.standard_normal(len(t)) for n, v in channels.items()}, fs=10_000)
    return record, ss.find_squeaks(record)


def joined(record: ss.Record, found: ss.squeak.Squeaks) -> ss.squeak.Coupling:
    return ss.squeak.coupling(record, squeaks=found)


@pytest.mark.parametrize("lag", [-3e-4, 0.0, 2e-4, 8e-4])
def test_a_delay_is_found_with_its_interval(lag: float) -> None:
    pair = joined(*tones(lag)).of("a", "sound")
    assert pair.delay.value == pytest.approx(lag, abs=2e-5)
    assert pair.phase.value == pytest.approx(2 * math.pi * 500 * lag, abs=0.06)
    assert lag == 0 or pair.leads == ("a" if lag > 0 else "sound")
    assert pair.inside > 0.95
    assert pair.coupled


@pytest.mark.parametrize(("lag", "told"), [(9.6e-4, True), (9.95e-4, False), (1e-3, False), (1.005e-3, False)])
def test_a_delay_that_can_not_be_told_from_half_a_period_is_not_told(lag: float, told: bool) -> None:
    pair = joined(*tones(lag, noise=0.02)).of("a", "sound")
    assert (pair.delay is not None) == told
    assert abs(pair.phase.value) == pytest.approx(2 * math.pi * 500 * lag, abs=0.05)
    assert pair.leads == ("a" if told else "neither")
    assert not pair.tied


def test_what_moves_together_all_along_gains_nothing_by_the_squeak() -> None:
    """Both channels shake with one noise throughout; in a second record each with its own."""
    record, found = tones(0.0, noise=0.0)
    rng = np.random.default_rng(4)
    for shared in (True, False):
        one, other = rng.standard_normal((2, len(record)))
        shaken = {"a": record["a"] + one, "sound": record["sound"] + 0.5 * (one if shared else other)}
        pair = joined(ss.Record.of(shaken, fs=10_000), found).of("a", "sound")
        assert pair.coupled
        assert pair.adds != shared
        assert (pair.added.interval[0] > 0.1) != shared
        assert pair.added.value == pytest.approx(pair.inside - pair.outside)


def test_a_squeak_is_said_to_add_by_chance_as_seldom_as_told() -> None:
    record, found = tones(0.0)
    added = []
    for seed in range(60):
        own, shared = np.random.default_rng(seed).standard_normal((2, len(record)))
        record = record.with_channel("a", own + shared, unit="m/s^2").with_channel("load", shared, unit="N")
        record = record.with_channel("friction", shared, unit="N")
        added.append(joined(record, found).of("a", "friction").adds)
    assert sum(added) <= 5  # of 60; one and a half by chance


def test_without_a_rest_what_a_squeak_adds_is_not_told() -> None:
    record, found = tones(0.0)
    inside = record.between(0.35, 0.65)
    within = replace(found, record=inside, bursts=tuple(replace(b, start=0.35, duration=0.3) for b in found.bursts))
    pair = joined(inside, within).of("a", "sound")
    assert pair.added is None
    assert math.isnan(pair.outside)
    assert not pair.adds


def test_intervals_hold_the_delay_as_often_as_they_say() -> None:
    held = [joined(*tones(2e-4, seed=seed)).of("a", "sound").delay.includes(2e-4) for seed in range(40)]
    assert sum(held) >= 34


def test_outside_of_squeaks_noise_does_not_cohere() -> None:
    pair = joined(*tones(0.0)).of("a", "sound")
    assert pair.outside < 0.3 < pair.inside


def test_channels_that_have_nothing_to_do_with_each_other_are_not_coupled() -> None:
    record, found = tones(0.0)
    coupled = []
    for seed in range(40):
        noise = np.random.default_rng(seed).standard_normal(len(record))
        coupled.append(
            ss.squeak.coupling(record.with_channel("a", noise, unit="m/s^2"), squeaks=found).of("a", "sound").coupled
        )
    assert sum(coupled) <= 6  # 2 of 40 by chance


def test_the_sound_comes_after_the_surface_by_its_way_through_the_air() -> None:
    _, found = virtual()
    assert found.of("normal_acceleration", "sound").delay.value == pytest.approx(0.1 / 343.2, rel=0.01)


def test_friction_is_against_the_mass_that_it_accelerates() -> None:
    pair = virtual()[1].of("a", "friction")  # m a = ... - f
    assert abs(pair.phase.value) == pytest.approx(math.pi, abs=0.02)
    assert pair.inside > 0.99
    assert pair.tied
    assert pair.delay is None
    assert not pair.adds


def test_friction_computed_from_the_acceleration_tells_of_no_coupling() -> None:
    record, found = tones(2e-4)
    force = record.with_channel("friction", -record["sound"], unit="N", source="friction_force")
    assert joined(force, found).of("a", "friction").tied
    assert not joined(force, found).of("a", "sound").tied


def test_an_energy_that_may_be_nothing_is_not_ok() -> None:
    _, found = virtual()
    assert found.energy_per_cycle.includes(0.0)
    assert "whether friction feeds or damps can not be told" in found.energy_per_cycle.status
    assert "can not be told" not in found.dissipated_per_cycle.status


def test_normal_and_torsional_motion_couple_while_it_squeaks() -> None:
    pair = virtual()[1].of("normal_acceleration", "torsion_velocity")
    assert pair.coupled
    assert pair.leads == "torsion_velocity"


def test_friction_takes_energy_from_the_sliding_motion() -> None:
    record, found = virtual()
    taken = np.mean(record["friction"] * record["v"]) / found.frequency
    assert found.dissipated_per_cycle is not None
    assert found.dissipated_per_cycle.value == pytest.approx(taken, rel=0.2)


def test_it_is_plain_data() -> None:
    import json

    data = json.loads(json.dumps(virtual()[1].to_dict(), allow_nan=False))
    assert len(data["pairs"]) == 10
    (tied,) = (pair for pair in data["pairs"] if pair["tied"])
    assert (tied["first"], tied["second"], tied["delay"], tied["adds"]) == ("a", "friction", None, False)


def test_what_holds_no_coupling_is_refused() -> None:
    record, found = tones(0.0)
    with pytest.raises(ss.errors.EstimateError, match="between two channels"):
        ss.squeak.coupling(ss.Record.of({"sound": record["sound"]}, fs=record.fs), squeaks=found)
    quiet = ss.find_squeaks(ss.Record.of({"sound": np.random.default_rng(0).standard_normal(5000)}, fs=10_000))
    with pytest.raises(ss.errors.EstimateError, match="no squeak"):
        ss.squeak.coupling(record, squeaks=quiet)
    with pytest.raises(ss.errors.EstimateError, match="no pair"):
        ss.squeak.coupling(record, squeaks=found).of("x", "v")


def test_the_work_on_torsion_and_normal_motion_is_that_of_the_closed_form() -> None:
    fs, frequency, lag = 20_000, 500.0, 0.7
    t = np.arange(2 * fs) / fs
    turn = 2 * np.pi * frequency * t
    inside = np.exp(-((np.maximum(0, np.abs(np.mod(t, 0.5) - 0.25) - 0.15) / 0.005) ** 2))
    rng = np.random.default_rng(0)
    sound = inside * sum(np.sin(k * turn) / k**2 for k in (1, 2, 3)) + 1e-4 * rng.standard_normal(len(t))
    channels = {
        "sound": sound, "friction": 5.0 + 2.0 * inside * np.cos(turn), "v": 0.3 + 0.01 * inside * np.cos(turn + 2.0),
        "torsion_velocity": 0.4 * inside * np.cos(turn + lag), "normal": 6.0 + 1.5 * inside * np.cos(turn),
        "normal_acceleration": -0.02 * 2 * np.pi * frequency * inside * np.sin(turn + lag),
    }  # fmt: skip
    coupled = ss.squeak.coupling(ss.Record.of(channels, fs=fs), lever="3 mm")
    share = float(np.mean([np.mean(inside[(t >= b.start) & (t < b.end)] ** 2) for b in found_bursts(channels, fs)]))
    expected = {
        "energy_per_cycle": -2.0 * 0.01 * math.cos(2.0), "energy_to_torsion": -0.003 * 2.0 * 0.4 * math.cos(lag),
        "energy_to_normal": -1.5 * 0.02 * math.cos(lag),
    }  # fmt: skip
    for name, amplitude in expected.items():
        assert getattr(coupled, name).value == pytest.approx(0.5 * share * amplitude / frequency, rel=0.02)
    assert coupled.energy_per_cycle.value > 0 > coupled.energy_to_torsion.value
    assert ss.squeak.coupling(ss.Record.of(channels, fs=fs)).energy_to_torsion is None


def found_bursts(channels: dict[str, np.ndarray], fs: float) -> tuple[ss.squeak.Squeak, ...]:
    return ss.find_squeaks(ss.Record.of(channels, fs=fs)).bursts


def test_friction_feeds_the_torsion_of_the_virtual_rig() -> None:
    """The exact work of both contacts, each by its own lever; one lever for the total force is near it."""
    run = ss.simulate(ss.squeak.squeak_rig(), duration=1.6)
    record = ss.squeak.squeak_record(run, snr=40, rng=1)
    levers = [contact.tangent[2] for contact in run.system.contacts]
    coupled = ss.squeak.coupling(record, lever=float(np.mean(levers)))
    motion, _ = run.sample(record.time, ("v", "friction"))
    bursts = ss.find_squeaks(record).of("squeak", "squeal")
    spinning = motion[2]
    work = [
        -np.mean(sum(lever * force[rows] for lever, force in zip(levers, motion[3:], strict=True)) * spinning[rows])
        for rows in (slice(*np.searchsorted(record.time, [b.start, b.end])) for b in bursts)
    ]
    exact = float(np.mean(work)) / coupled.frequency
    assert coupled.energy_to_torsion.value == pytest.approx(exact, rel=0.25)
    assert coupled.energy_to_torsion.interval[0] > 0
    assert coupled.energy_to_torsion.value > 50 * abs(coupled.energy_per_cycle.value)
