"""The virtual rig: each fault of a sensor against what it should do."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import ModelError
from stickslip.record.channels import VOCABULARY
from stickslip.rig.sensor import SENSED, Digitiser, Mount, Noise, Sensor


@cache
def run() -> ss.solve.Trajectory:
    contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
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
    offset = ss.signals.clock_offset(one, two)
    assert abs(abs(offset.value) - 0.1234) < 1e-4


def test_a_unit_whose_clock_runs_fast_is_found() -> None:
    sensor = Sensor("x", noise=Noise(1e-8))
    true, fast = (ss.Rig((sensor,), rate=rate).measure(run(), fs=1000, rng=1) for rate in (0.0, 2e-3))
    assert len(fast) == pytest.approx(len(true) * 1.002, abs=2)
    assert 1 / ss.signals.clock_rate(true, fast).value - 1 == pytest.approx(2e-3, rel=0.01)


@pytest.mark.parametrize(("rig", "seen"), [(ss.Rig(), 0.0326), (ss.Rig().having("x", lag=1.461e-3), 0.0389)])
def test_the_lead_of_the_accelerometer_is_made_of_three_parts(rig: ss.Rig, seen: float) -> None:
    """Section 2.3, in a free vibration: the lag of x, less that of the mount, and 2 zeta of the decay."""
    natural, ratio = 30.91, 0.0008
    slider = ss.Oscillator(mass=1.0, stiffness=natural**2, damping=2 * ratio * natural, law=ss.laws.Coulomb(0.0))
    record = rig.measure(ss.simulate(slider, start={"x": 0.005}, duration=10), fs=4000, rng=2)
    turning = np.hanning(len(record)) * np.exp(-1j * natural * record.time)
    lead = np.angle(np.sum(turning * record["a"]) / np.sum(turning * -record["x"]))
    parts = natural * (rig.sensors[0].lag - 2 * 0.1 / (2 * math.pi * 125)) + 2 * ratio
    assert lead == pytest.approx(parts, abs=1e-4)
    assert lead == pytest.approx(seen, abs=1e-4)


def test_the_presets_are_the_rigs_of_the_thesis() -> None:
    """Sections 2.2, 2.3, 2.5 and 7.2, each figure in the unit in which it stands there."""
    pound, gravity = 4.4482216152605, 9.80665
    x, z, a, load = ss.Rig.air_track().sensors
    assert (x.digitiser.step, x.digitiser.limit) == (2.5e-6, 0.0127)
    assert x.lag * 30.91 == pytest.approx(0.0389)
    assert (z.digitiser, z.lag) == (x.digitiser, x.lag)
    assert a.mount is not None
    assert load.mount is not None
    assert (a.mount.frequency, load.mount.frequency) == (125, 250)
    assert (a.sensitivity, load.sensitivity) == ("1 V/g", "500 mV/lbf")
    assert load.digitiser.step == pytest.approx(0.0002 * pound)
    assert load.digitiser.limit == pytest.approx(10 * pound)
    assert (a.lag, load.lag, load.discharge) == (0, 0, 50)
    assert ss.Rig.air_track() == ss.Rig()
    *same, normal, sound = ss.Rig.linear_bearing().sensors
    assert [sensor.channel for sensor in same] == ["x", "z", "a", "load"]
    assert [sensor.mount for sensor in same] == [sensor.mount for sensor in ss.Rig().sensors]
    assert normal.sensitivity == "10 mV/g"
    assert normal.digitiser.limit == 500 * gravity
    assert 20 * np.log10(sound.noise.white / 20e-6) == pytest.approx(55)
    assert 20 * np.log10(abs(sound.response.at(5000.0))) == pytest.approx(-3.01, abs=0.01)


def test_the_normal_direction_of_a_structure_is_heard() -> None:
    block = ss.Structure(
        mass=np.diag([1.0, 1.0]),
        damping=np.diag([0.1, 0.1]),
        stiffness=np.diag([100.0, 400.0]),
        contacts=(),
        drive=ss.drives.Release(),
    )
    motion = ss.simulate(block, start={"x1": 1e-2, "x2": 1e-2}, duration=2.0)
    rig = ss.Rig.linear_bearing().having("ay", of="a2", white=0.0).having("a", of="a1")
    record = rig.measure(motion, fs=10_000, rng=1)
    assert list(record) == ["a", "ay"]
    assert np.array_equal(record["ay"], motion.sample(record.time, ("a",))[0][1])


def test_what_a_calibration_would_say_is_stated() -> None:
    rig = ss.Rig().having("x", gain=1.01)
    record = rig.stated(rig.measure(run(), fs=4000, rng=1, start=2.0))
    x, a, load = (record.channels[name] for name in ("x", "a", "load"))
    assert (x.delay, a.delay, a.mount) == (0.0389 / 30.91, 0, (125, 0.1))
    assert (load.mount, load.inertia, load.discharge) == ((250, 0.05), 0.05, 50)
    assert x.noise == pytest.approx(np.sqrt(1e-12 + 2.5e-6**2 / 12))
    assert load.sensitivity == "500 mV/lbf"
    perfect = ss.Rig.perfect()
    assert perfect.stated(perfect.measure(run(), fs=1000)).channels["x"].noise is None


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
        law=ss.laws.Stribeck(0.5, static=0.8, speed=0.01),
        drive=ss.drives.HarmonicBase(0.02, frequency=1.0),
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


def test_a_rigid_cell_feels_the_inertia_of_the_mass_that_it_names() -> None:
    contact = ss.Contact(ss.laws.CompliantContact(1.1, stiffness=240e3), [0, 1])
    link = 1e6 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    drive = ss.drives.HarmonicBase(1e-3, frequency=3.5)
    two = ss.Structure(
        np.diag([1.8, 0.6]), np.zeros((2, 2)), np.diag([2310.0, 0.0]) + link, contacts=[contact], drive=drive
    )
    run = ss.simulate(two, duration=1.0)
    cell = Sensor("load", of="friction", mount=Mount(math.inf, 0.0, mass=0.6, on="a2"))
    rig = ss.Rig((cell, Sensor("a", of="a1")))
    record = rig.stated(rig.measure(run, fs=2000))
    _, below, friction = run.sample(record.time, ("a", "friction"))[0]
    assert record["load"] == pytest.approx(friction + 0.6 * below)
    assert record.channels["load"].mount is None
    assert record.channels["load"].inertia == 0.6
    with pytest.raises(ModelError, match=r"moves as 'a'.*name the acceleration"):
        ss.Rig((cell.having(on="a"), Sensor("a", of="a1"))).measure(run, fs=2000)
