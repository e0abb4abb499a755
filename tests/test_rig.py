"""The virtual rig: each fault of a sensor against what it should do."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import ModelError
from stickslip.record.channels import VOCABULARY
from stickslip.rig import SENSED, Digitiser, Mount, Noise, Sensor


@cache
def run() -> ss.Trajectory:
    contact = ss.CompliantContact(1.1, stiffness=192000, damping=23.9)
    drive = ss.HarmonicBase(0.65e-3, frequency=2.5)
    return ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), cycles=10)


def test_what_is_sensed_writes_channels_of_the_vocabulary() -> None:
    assert set(SENSED) <= set(VOCABULARY)


def test_perfect_sensors_write_the_truth() -> None:
    record, truth = ss.Rig.perfect().measure(run(), fs=1000), run().record(fs=1000)
    for channel, name in {"x": "x", "z": "z", "a": "a", "load": "friction"}.items():
        assert np.array_equal(record[channel], truth[name])
    assert len(record) == len(truth)


def test_a_seed_gives_the_same_record_and_another_one_another() -> None:
    rig = ss.Rig()
    one, same, other = (rig.measure(run(), fs=2000, rng=seed) for seed in (1, 1, 2))
    assert one.equals(same)
    assert not one.equals(other)


def test_a_sensor_keeps_its_noise_when_another_is_left_out() -> None:
    rig = ss.Rig()
    alone = ss.Rig(rig.sensors[:2]).measure(run(), fs=2000, rng=4)
    assert np.array_equal(alone["z"], rig.measure(run(), fs=2000, rng=4)["z"])


def test_lag_is_exact_between_samples() -> None:
    late = ss.Rig((Sensor("x", lag=0.3333e-3),)).measure(run(), fs=1000)
    times = np.maximum(np.arange(len(late)) / 1000 - 0.3333e-3, 0)
    assert np.array_equal(late["x"], run().sample(times, ("x",))[0][0])


def test_the_cell_feels_the_inertia_of_what_it_carries() -> None:
    sensor = Sensor("load", mount=Mount(20_000, 0.7, mass=0.05))
    record, truth = ss.Rig((sensor,)).measure(run(), fs=1000), run().record(fs=1000)
    felt = truth["friction"] + 0.05 * truth["a"]
    assert np.abs(record["load"] - felt)[10:].max() < 0.2 * np.abs(0.05 * truth["a"]).max()  # 11 us late at jumps
    assert np.median(np.abs(record["load"] - felt)) < 1e-5


def test_noise_has_its_spectrum() -> None:
    rng = np.random.default_rng(5)
    white = np.mean([Noise(2.0).samples(4096, fs=100, rng=rng).var() for _ in range(50)])
    assert white == pytest.approx(4.0, rel=0.02)
    power = np.mean(
        [np.abs(np.fft.rfft(Noise(1.0, corner=10.0).samples(4096, fs=100, rng=rng))) ** 2 for _ in range(300)], axis=0
    )
    frequency = np.fft.rfftfreq(4096, 0.01)
    for f in (0.5, 2.0, 10.0, 40.0):
        near = np.abs(frequency - f) < 0.1 * f
        assert np.mean(power[near]) == pytest.approx(4096 * np.mean(1 + 10 / frequency[near]), rel=0.1)
    band = Noise(band=3.0, low=5.0, high=15.0).samples(1 << 15, fs=100, rng=rng)
    assert band.std() == pytest.approx(3.0, rel=0.05)
    spectrum = np.abs(np.fft.rfft(band))
    outside = np.abs(np.fft.rfftfreq(len(band), 0.01) - 10) > 5.01
    assert spectrum[outside].max() < 1e-9 * spectrum.max()


def test_counts_clips_offsets_and_gaps() -> None:
    digitiser = Digitiser(step=0.1, limit=0.45, offset=0.02, dropouts=5.0, gap=0.004)
    record = ss.Rig((Sensor("load", digitiser=digitiser),)).measure(run(), fs=2000, rng=1)
    known = record["load"][np.isfinite(record["load"])]
    assert np.allclose(known, np.round(known / 0.1) * 0.1)
    assert np.abs(known).max() == pytest.approx(0.4)
    lost = np.isnan(record["load"])
    assert 0.005 < lost.mean() < 0.06
    assert record.check()


@pytest.mark.parametrize("limit", [0.9, 1.05, 1.09])
def test_a_saturated_load_cell_is_seen(limit: float) -> None:
    """Its friction has plateaus by nature, of 1.1 N here: what tells a limit is that no noise moves it."""
    cut = ss.Rig().having("load", limit=limit).measure(run(), fs=4000, rng=1, start=2.0)
    assert [(fault.kind, fault.channel) for fault in cut.check()] == [("clipped", "load")]
    assert not ss.Rig().measure(run(), fs=4000, rng=1, start=2.0).check()


def test_a_unit_with_its_own_clock_is_found_by_synchronise() -> None:
    amplitude = {"noise": Noise(1e-7)}
    one = ss.Rig((Sensor("x", **amplitude),)).measure(run(), fs=1000, rng=1)  # type: ignore[arg-type]
    two = ss.Rig((Sensor("x", **amplitude),), offset=0.1234).measure(run(), fs=500, rng=2)  # type: ignore[arg-type]
    offset = ss.clock_offset(one, two)
    assert abs(abs(offset.value) - 0.1234) < 1e-4


def test_the_truth_stands_beside_the_record() -> None:
    record = ss.Rig().measure(run(), fs=2000, rng=1, start=2.0)
    truth = record.truth
    assert (truth["mass"], truth["contact stiffness"], truth["sliding friction"]) == (2.42, 192000, 1.1)
    expected = [(e.time - 2.0, e.kind) for e in run().events if e.time >= 2.0]
    assert len(truth["events"]) == len(expected)
    assert all(
        t == pytest.approx(e[0]) and kind == e[1] for (t, kind), e in zip(truth["events"], expected, strict=True)
    )
    assert 0 < truth["stuck share of the time"] < 1


def test_any_run_can_be_measured() -> None:
    curved = ss.Oscillator(
        mass=1,
        stiffness=100,
        law=ss.Stribeck(0.5, static=0.8, speed=0.01),
        drive=ss.HarmonicBase(0.02, frequency=1.0),
    )
    record = ss.Rig().measure(ss.simulate(curved, cycles=3), fs=1000, rng=1)
    assert list(record) == ["x", "z", "a", "load"]


def test_the_friction_of_a_measured_record_is_found() -> None:
    rig = ss.Rig.perfect("x", "z", "a")
    record = rig.having("x", white=1e-7).having("a", white=1e-3).measure(run(), fs=2000, rng=3)
    record = ss.friction_force(record, **{name: record.truth[name] for name in ("mass", "stiffness", "damping")})
    assert ss.friction_loops(record).level.value == pytest.approx(1.1, rel=0.02)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Mount(0.0, 0.1),
        lambda: Noise(-1.0),
        lambda: Noise(band=1.0, low=5.0, high=2.0),
        lambda: Digitiser(limit=0.0),
        lambda: Sensor("x", gain=0.0),
        lambda: Sensor("x", discharge=-1.0),
        lambda: Sensor("x").having(colour=3),
        lambda: ss.Rig(()),
        lambda: ss.Rig((Sensor("x"), Sensor("x"))),
        lambda: ss.Rig(rate=-0.9),
        lambda: ss.Rig().having("w", gain=1),
        lambda: ss.Rig().measure(run(), fs=0.0),
        lambda: ss.Rig().measure(run(), fs=1000, start=100.0),
        lambda: ss.Rig((Sensor("normal"),)).measure(run(), fs=1000),
    ],
)
def test_what_makes_no_sense_is_refused(wrong: object) -> None:
    with pytest.raises(ModelError):
        wrong()  # type: ignore[operator]
