"""The rig as it is watched: each fault of a sensor is named within two cycles or so, and none where there is none."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip.bench import Cycle, Device, Fault, Monitor, Sim, Tone, answers, blocks
from stickslip.bench.replay import Replay
from stickslip.bench.sim import air_track
from stickslip.squeak.sound import squeak_record
from stickslip.squeak.stability import HEAVY, squeak_rig

RIG = {"mass": 2.42, "stiffness": 2310.0, "damping": air_track().damping}
PULLED = 3.0  # s


def watched(device: Device, seconds: float) -> tuple[Monitor, list[Cycle]]:
    monitor, cycles = Monitor(device, RIG), []
    with device.open() as stream:
        for block in blocks(stream, count=int(seconds * device.fs)):
            cycles += monitor.feed(block)
    return monitor, cycles


@pytest.mark.parametrize("frequency", [2.5, 5.61, 11.1])
def test_nothing_is_wrong_with_sensors_that_are_stated(frequency: float) -> None:
    monitor, cycles = watched(Sim(air_track().having(frequency=frequency), fast=True, stated=True, seed=7), 4.0)
    assert abs(len(cycles) - 4.0 * frequency) < 3
    assert not [flaw for cycle in cycles for flaw in cycle.flaws]
    window = monitor.window()
    assert window is not None
    (level, *_), untold = answers(window, RIG)
    assert not untold
    assert level.name == "sliding friction"
    assert abs(level.value - 1.1) < 0.05
    fastest = [float(np.abs(cycle.v).max()) for cycle in cycles]
    assert fastest[0] < 1.2 * fastest[-1]  # the first cycle does not repeat: its ends are no jump


@pytest.mark.parametrize("channel", ["x", "z", "a", "load"])
def test_a_cable_that_is_pulled_is_named(channel: str) -> None:
    device = Sim(fast=True, stated=True, faults=(Fault("cable", PULLED, channel=channel),), seed=5)
    _, cycles = watched(device, PULLED + 1.0)
    flaws = [(cycle.first / device.fs + cycle.period, flaw) for cycle in cycles for flaw in cycle.flaws]
    assert {(flaw.channel, flaw.kind) for _, flaw in flaws} == {(channel, "flat")}
    assert flaws[0][0] < PULLED + 2 / 2.5


@pytest.mark.parametrize("channel", ["x", "z", "a", "load"])
def test_noise_that_comes_is_named(channel: str) -> None:
    device = Sim(fast=True, stated=True, faults=(Fault("noise", PULLED, channel=channel),), seed=6)
    _, cycles = watched(device, PULLED + 1.0)
    flaws = [(cycle.first / device.fs + cycle.period, flaw) for cycle in cycles for flaw in cycle.flaws]
    assert {(flaw.channel, flaw.kind) for _, flaw in flaws} == {(channel, "noisy")}
    assert flaws[0][0] < PULLED + 2 / 2.5


def test_a_sensor_without_noise_has_none_to_be_heard() -> None:
    with pytest.raises(ss.errors.ModelError, match="noise of x; its sensor has none"):
        Sim(rig=ss.Rig.perfect(), faults=(Fault("noise", 1.0, channel="x"),))


def test_a_range_that_is_passed_is_named() -> None:
    _, cycles = watched(
        Sim(fast=True, stated=True, faults=(Fault("saturation", PULLED, channel="load"),)), PULLED + 0.5
    )
    assert {(flaw.channel, flaw.kind) for cycle in cycles for flaw in cycle.flaws} == {("load", "clipped")}


@pytest.mark.parametrize(("channel", "late"), [("x", ("x", "z")), ("load", ("load",))])
def test_a_sensor_that_is_late_is_named(channel: str, late: tuple[str, ...]) -> None:
    rig = ss.Rig.perfect()
    for name in late:
        rig = rig.having(name, lag=3e-3)
    _, cycles = watched(Sim(rig=rig, fast=True), 3.0)
    assert {flaw.channel for cycle in cycles for flaw in cycle.flaws} == {channel}
    assert cycles[1].flaws  # as soon as two cycles are there, though the motion does not repeat yet
    for flaw in (flaw for cycle in cycles for flaw in cycle.flaws):  # while the motion settles, too
        late_by, doubt = map(float, re.findall(r"[\d.]+(?= ±| ms)", flaw.words))
        assert abs(late_by - 3.0) <= min(doubt, 0.08), flaw.words


@pytest.mark.parametrize("lag", [0.0, 3e-3, 0.03])
def test_where_nothing_is_said_to_be_late_it_is_said_from_when_on_it_would_be(lag: float) -> None:
    """Below 1.8 Hz the acceleration is small beside its noise: nothing was said to be wrong with an x 3 ms late."""
    rig = ss.Rig.perfect().having("x", white=2e-6).having("a", white=0.05).having("x", lag=lag)
    system = air_track().having(frequency=1.2, amplitude=2e-3)
    _, cycles = watched(Sim(system, rig=rig, fs=1000, fast=True, seed=3), 6.0)
    assert not [flaw for cycle in cycles for flaw in cycle.flaws if flaw.kind == "late" and not lag]
    for cycle in cycles[2:]:
        assert bool(cycle.flaws) == (lag > cycle.least_late)
        assert 1e-3 < cycle.least_late < 0.03


@pytest.mark.parametrize(("channel", "frequency", "amplitude"), [("load", 11.1, 5e-3), ("a", 1.5, 0.65e-3)])
def test_a_sensor_that_the_spring_hides_is_named(channel: str, frequency: float, amplitude: float) -> None:
    """By the balance of forces a load was not where friction is below a fifth of the spring's, nor a by a slow x."""
    rig = ss.Rig.perfect().having("x", white=2e-6).having("a", white=0.05).having(channel, lag=4e-3)
    system = air_track().having(frequency=frequency, amplitude=amplitude)
    _, cycles = watched(Sim(system, rig=rig, fs=1000, fast=True, seed=3), 8 / frequency)
    assert {(flaw.channel, flaw.kind) for cycle in cycles for flaw in cycle.flaws} == {(channel, "late")}
    assert cycles[1].flaws


def test_what_a_mount_rings_is_no_noise() -> None:
    """Of a load sampled at 1 kHz it hid a noise thirty times the usual, and was called noise when the motion grew."""
    device = Sim(air_track().having(frequency=11.1), fs=1000, stated=True, fast=True, seed=4)
    noisy = replace(device, faults=(Fault("noise", PULLED, channel="load"),))
    _, cycles = watched(noisy, PULLED + 0.5)
    assert {(flaw.channel, flaw.kind) for cycle in cycles for flaw in cycle.flaws} == {("load", "noisy")}
    monitor = Monitor(device, RIG)
    with device.open() as stream:
        for amplitude in (1.5e-3, 3e-3):
            stream.drive("base", Tone(amplitude, 11.1))
            for block in blocks(stream, count=2000):
                assert not [flaw for cycle in monitor.feed(block) for flaw in cycle.flaws]


def test_a_range_that_is_passed_is_named_though_it_cuts_a_cycle_short() -> None:
    """A short cycle at the moment of the fault was taken for the length of all, and the next ones for a stall."""
    device = Sim(air_track().having(frequency=11.1), fs=1000, stated=True, fast=True, seed=4)
    for part in np.arange(0, 1, 0.125):
        at = PULLED + part / 11.1
        _, cycles = watched(replace(device, faults=(Fault("saturation", at, channel="z"),)), at + 0.5)
        flaws = [(cycle.first / device.fs + cycle.period, flaw) for cycle in cycles for flaw in cycle.flaws]
        assert {(flaw.channel, flaw.kind) for _, flaw in flaws} == {("z", "clipped")}
        assert flaws[0][0] < at + 2 / 11.1


@pytest.mark.parametrize("channels", [("sound",), ("x", "friction", "sound")], ids=["a microphone", "the whole rig"])
def test_the_pitch_of_a_squeak_is_told(channels: tuple[str, ...]) -> None:
    whole = squeak_record(ss.simulate(squeak_rig("wet", load=HEAVY), duration=2.5), snr=30, rng=3)
    record = ss.Record({n: whole[n] for n in channels}, {n: whole.channels[n] for n in channels}, whole.fs)
    monitor, cycles = watched(Replay(record, fast=True), 2.5)
    assert not [flaw for cycle in cycles for flaw in cycle.flaws]
    window = monitor.window()
    assert window is not None
    rows, untold = answers(window, {})
    assert not untold
    assert [row.name for row in rows[:-1]] == (
        ["sliding friction", "stops per cycle", "stuck share of the time"] if "x" in channels else []
    )
    power = np.abs(np.fft.rfft(window["sound"] * np.hanning(len(window))))
    loudest = float(np.fft.rfftfreq(len(window), 1 / record.fs)[power.argmax()])
    assert rows[-1].name.startswith("pitch in sound")
    assert abs(rows[-1].value - loudest) < 0.03 * loudest  # it wanders so far with the speed


@pytest.mark.parametrize("squeaking", [slice(3 * 8000, None), slice(0, 3 * 8000)], ids=["then loud", "then quiet"])
def test_a_quiet_room_is_no_broken_microphone(squeaking: slice) -> None:
    sound = 0.002 * np.random.default_rng(0).standard_normal(6 * 8000)
    sound[squeaking] += 0.3 * np.sin(2 * np.pi * 800 * np.arange(3 * 8000) / 8000)
    device = Replay(ss.Record.of({"sound": sound}, fs=8000, units={"sound": "Pa"}), fast=True)
    _, cycles = watched(device, 6.0)
    assert len(cycles) == 11
    assert not [flaw for cycle in cycles for flaw in cycle.flaws]


@pytest.mark.parametrize("left", ["nothing", "a count"])
def test_a_microphone_that_is_pulled_is_flat(left: str) -> None:
    chance = np.random.default_rng(1)
    sound = np.round(0.3 * chance.standard_normal(6 * 8000), 3)  # Pa, in counts of 1 mPa
    sound[3 * 8000 :] = 0.001 * chance.integers(0, 2, 3 * 8000) if left == "a count" else 0.0
    _, cycles = watched(Replay(ss.Record.of({"sound": sound}, fs=8000, units={"sound": "Pa"}), fast=True), 6.0)
    assert [[flaw.kind for flaw in cycle.flaws] for cycle in cycles] == [[]] * 6 + [["flat"]] * 5


@pytest.mark.parametrize("fs", [100.0, 1000.0, 8000.0])
@pytest.mark.parametrize("count", [0.0, 4e-6], ids=["noise", "in counts"])
def test_noise_is_no_motion(fs: float, count: float) -> None:
    """A rig that stood still moved by noise alone: four times a second every sensor of it was said to be flat."""
    noise = np.random.default_rng(5).standard_normal((2, int(40 * fs))) * 1e-6
    noise = np.round(noise / count) * count if count else noise
    _, cycles = watched(Replay(ss.Record.of({"x": noise[0], "a": 1e4 * noise[1]}, fs=fs), fast=True), 40.0)
    assert not cycles


def test_a_loop_is_that_of_the_motion() -> None:
    _, cycles = watched(Sim(rig=ss.Rig.perfect(), fast=True), 3.0)
    last = cycles[-1]
    assert abs(last.period - 0.4) < 1e-3
    assert abs(last.friction.max() - 1.1) < 0.06
    assert abs(abs(last.x).max() - 0.714e-3) < 0.02e-3


def test_lost_samples_begin_it_anew() -> None:
    monitor, cycles = watched(Sim(fast=True, stated=True, faults=(Fault("drop", 1.0, 0.1),)), 4.0)
    assert monitor.lost == 400
    assert not [flaw for cycle in cycles for flaw in cycle.flaws]


def test_a_base_that_is_moved_otherwise_is_followed() -> None:
    device = Sim(fast=True, stated=True)
    monitor, cycles = Monitor(device, RIG), []
    with device.open() as stream:
        for block in blocks(stream, count=8000):
            monitor.feed(block)
        stream.drive("base", Tone(0.65e-3, 6.0))
        for block in blocks(stream, count=20_000):
            cycles += monitor.feed(block)
    assert abs(cycles[-1].period - 1 / 6) < 1e-3
