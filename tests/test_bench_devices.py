"""Devices: what streams is what the rig would have recorded, for hours, and whatever is asked of the shaker."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import stickslip as ss
from stickslip.bench import Block, Fault, Output, Sim, Tone, blocks, devices, find_device
from stickslip.bench.device import Signal
from stickslip.bench.march import March
from stickslip.bench.sim import SimStream, air_track

QUIET = ss.Rig.air_track()
for _channel in ("x", "z", "a", "load"):
    QUIET = QUIET.having(_channel, white=0.0, step=0.0)


def streamed(device: Sim, count: int) -> np.ndarray:
    with device.open() as stream:
        return np.concatenate([block.samples for block in blocks(stream, count=count)], axis=1)


@pytest.mark.parametrize(
    "system",
    [
        air_track(),
        air_track().having(frequency=11.1),
        replace(air_track(), drive=ss.drives.MultiTone([(5e-4, 2.5, 0.3), (5e-5, 2.5 * 2**0.5, 0.1)])),
        replace(air_track(), drive=ss.drives.Ramp(1e-3)),
        ss.Oscillator(mass=1, stiffness=400, law=ss.laws.Coulomb(1.0, static=1.5), drive=ss.drives.Belt(0.02)),
        replace(air_track(), drive=ss.drives.SpeedProfile([0, 0.4, 0.7, 1.3], [0, 0.004, -0.002, 0.001])),
        ss.Oscillator(
            mass=1,
            stiffness=400,
            law=ss.laws.LuGre(1.0, 1.3, speed=0.01, stiffness=2e4, damping=20.0),
            drive=ss.drives.HarmonicBase(5e-3, frequency=3.0),
        ),
    ],
    ids=["compliant", "11.1 Hz", "no period", "ramp", "belt", "profile", "curved"],
)
def test_a_stream_is_what_the_rig_records_of_one_run(system: ss.Oscillator) -> None:
    """The motion goes on leg by leg and the sensors block by block; neither shows."""
    record = QUIET.measure(ss.simulate(system, duration=2.5), fs=2000)
    got = streamed(Sim(system, rig=QUIET, fs=2000.0, fast=True), 4800)
    for row, one in zip(got, Sim(system, rig=QUIET).inputs, strict=True):
        if one.name in record:
            np.testing.assert_allclose(row, record[one.name][:4800], atol=1e-7 * np.abs(record[one.name]).max())
        else:
            assert not row.any()  # a base that stands still


def test_after_hours_the_phase_is_still_the_first_ones() -> None:
    march = March(air_track().having(frequency=2.5000001), {})
    march._begin(march.system, 0.0)
    march.laps = 90_000  # ten hours, as if they had been marched
    march.ahead(36_001.0)
    times = 36_000.5 + np.arange(10) / 20
    expected = 0.65e-3 * np.cos(2 * np.pi * np.array([math.fmod(2.5000001 * t, 1.0) for t in times]))
    np.testing.assert_allclose(march.values("z", times), expected, atol=1e-12)


def test_the_base_goes_where_it_is_told_without_a_jump() -> None:
    system, signal = (
        replace(air_track(), drive=ss.drives.Release()),
        1e-3 * np.sin(np.linspace(0, 7, 2000) * np.pi) ** 2,
    )
    parts = []
    with Sim(system, rig=ss.Rig.perfect("z"), fs=2000.0, fast=True).open() as stream:
        for end, order in ((1000, Tone(1e-3, 5.0, 0.4)), (3000, Tone(5e-4, 3.0)), (5000, signal), (8000, None)):
            parts += [block.samples[0] for block in blocks(stream, count=end)]
            stream.drive("base", order)
        parts += [block.samples[0] for block in blocks(stream, count=9000)]
    z, t = np.concatenate(parts), np.arange(9000) / 2000
    np.testing.assert_allclose(z[1500:3000], 1e-3 * np.cos(10 * np.pi * (t[1500:3000] - 0.5) + 0.4), atol=1e-10)
    np.testing.assert_allclose(z[5500:7500], signal, atol=1e-9)
    assert np.all(np.abs(z[7500:8000] - signal[-1]) < 1e-9)
    assert np.abs(z[8500:]).max() < 1e-9
    assert np.abs(np.diff(z, 2)).max() * 2000**2 < 1.0 + 1e-3 * (2 * np.pi * 5) ** 2  # as a ramp of 0.25 s bends


def test_a_shaker_is_asked_for_no_more_than_it_can() -> None:
    device = Sim(shaker=Output("base", "m", stroke=5e-3, highest=50.0, acceleration=20.0), fast=True)
    with device.open() as stream:
        for tone, said in ((Tone(6e-3, 1.0), "stroke"), (Tone(1e-3, 60.0), "60 Hz"), (Tone(1e-3, 40.0), "force")):
            with pytest.raises(ss.errors.ModelError, match=said):
                stream.drive("base", tone)
        with pytest.raises(ss.errors.ModelError, match="from 0 to 2000 Hz"):
            Sim(fast=True).open().drive("base", Tone(1e-3, 1e9))
        with pytest.raises(ss.errors.ModelError, match="its outputs: base"):
            stream.drive("table", Tone(1e-3, 1.0))


def test_faults_come_when_they_are_ordered() -> None:
    faults = (Fault("drop", 0.5, 0.1), Fault("saturation", 1.0, 0.2, "load"), Fault("cable", 1.5, channel="a"))
    with Sim(faults=faults, fast=True).open() as stream:
        got = [*blocks(stream, count=8000)]
    gaps = [(a.after, b.first) for a, b in pairwise(got) if a.after != b.first]
    assert gaps == [(2000, 2400)]
    x, _, a, load = np.concatenate([block.samples for block in got], axis=1)
    limit = Sim().inputs[3].limit
    assert np.mean(np.abs(load[3600:4400]) == limit) > 0.9
    assert np.std(a[5600:]) < 0.05 < 2 * np.std(a[:5600])
    assert np.std(x[5600:]) > 1e-4


def test_a_unit_keeps_time_by_the_clock() -> None:
    with Sim(fs=1000.0).open() as stream:
        stream.began -= 3.0  # as if nobody had read for so long
        first = stream.read()
        assert first is not None
        assert 0 < first.samples.shape[1] <= 200
        stream.began -= 20.0
        late = stream.read()
    assert late is not None
    assert late.first >= first.after + 10_000  # older than the unit's buffer: lost, and the counter says so


def test_a_unit_that_keeps_time_compiles_before_its_clock_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its first recording on a computer lost whatever came while kernels were compiled, 20 s of it."""
    read, times = SimStream.read, []

    def noted(stream: SimStream, timeout: float = 1.0) -> Block | None:
        times.append((stream.device.fast, stream.sent / stream.device.fs))
        return read(stream, timeout)

    monkeypatch.setattr(SimStream, "read", noted)
    with Sim().open() as stream:
        assert times[0] == (True, 0.0)
        assert times[-1] == (True, pytest.approx(2.98))
        assert (stream.sent, stream.device.fast) == (0, False)
        times.clear()
        opened = time.monotonic()
        stream.drive("base", Tone(0.5e-3, 5.61))
        driven = time.monotonic()
        stream.read()
        assert [times[0], times[-2]] == [(True, 0.0), (True, pytest.approx(2.98))]
        assert opened < stream.began < driven


def test_a_drive_that_changes_in_mid_run_begins_once_it_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its samples were lost while the reader compiled; now they go on, under the motion before."""
    compiled, rehearse = threading.Event(), Sim.rehearse

    def slow(device: Sim, drive: Mapping[str, Signal]) -> None:
        rehearse(device, drive)
        if drive:
            assert compiled.wait(60.0)

    monkeypatch.setattr(Sim, "rehearse", slow)
    system = replace(air_track(), drive=ss.drives.Release())
    with Sim(system, rig=ss.Rig.perfect("z"), fs=1000.0).open() as stream:

        def read(seconds: float) -> np.ndarray:
            stream.began -= seconds  # as if so long had passed
            block = stream.read()
            assert block is not None
            assert block.after == stream.sent
            return block.samples[0]

        assert len(read(0.1)) >= 100
        stream.drive("base", Tone(2e-3, 5.0))
        stream.drive("base", Tone(1e-3, 5.0))
        assert not read(0.15).any()
        compiled.set()
        assert stream.ordered is not None
        stream.ordered.rehearsal.join()
        for _ in range(4):
            moved = read(0.15)
        assert 0.9e-3 < np.abs(moved).max() < 1.1e-3


def test_devices_are_found_by_name() -> None:
    assert {device.kind for device in devices()} >= {"sim"}
    device = find_device("rig", {"rig": {"kind": "sim", "system": "FD-4", "rig": "perfect", "fs": "500 Hz"}})
    assert (device.name, device.kind, device.fs) == ("rig", "sim", 500.0)
    with pytest.raises(ss.errors.ModelError, match="perhaps sim"):
        find_device("simm")
    with pytest.raises(ss.errors.ModelError, match="has the key 'fast_'"):
        find_device("sim", {"sim": {"fast_": True}})
