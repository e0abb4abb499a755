"""Releases are found where they are, and what is no free decay is refused in one sentence."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from motions import free_decay
from stickslip.decay.release import find_releases
from stickslip.signals.pieces import turning_points


def of(values, fs, name="x", **more):
    return ss.Record.of({name: values}, fs=fs, **more)


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.03])
@pytest.mark.parametrize("per_cycle", [20, 100, 400])
@pytest.mark.parametrize(("damping_ratio", "dry"), [(0.0008, 0.005), (0.0177, 0.02), (0.0631, 0.06), (0.0, 0.02)])
def test_a_release_is_found_where_it_is(damping_ratio, dry, per_cycle, noise):
    values, fs, turns = free_decay(damping_ratio=damping_ratio, dry=dry, per_cycle=per_cycle)
    values = values + noise * np.random.default_rng(1).standard_normal(len(values)) + 0.4
    (found,) = find_releases(of(values, fs)).ring_downs
    cycle = per_cycle / fs
    assert found.release == pytest.approx(round(0.25 * per_cycle) / fs, abs=0.03 * cycle)
    assert found.held
    assert found.stopped
    assert found.frequency == pytest.approx(1.0, rel=0.02)
    assert found.rest == pytest.approx(0.4, abs=max(0.3 * dry, 2 * noise))
    assert found.amplitude == pytest.approx(1.0, abs=0.03 + 4 * noise)
    if noise == 0:
        assert len(found.turns) == len(turns)
        assert np.abs(values[found.turns] - 0.4 - turns).max() < 0.001 + 2 * (np.pi / per_cycle) ** 2


@pytest.mark.parametrize("name", ["x", "v", "a"])
def test_the_derivatives_of_a_displacement_serve_too(name):
    values, fs, turns = free_decay(order="xva".index(name))
    (found,) = find_releases(of(values, fs, name)).ring_downs
    assert (found.channel, found.order) == (name, "xva".index(name))
    assert found.frequency == pytest.approx(1.0, rel=0.01)
    assert abs(len(found.turns) - len(turns)) <= 2


def test_the_sign_does_not_matter():
    values, fs, _ = free_decay()
    up, down = (find_releases(of(sign * values, fs)).ring_downs[0] for sign in (1, -1))
    assert np.array_equal(up.turns, down.turns)
    assert up.amplitude == -down.amplitude
    assert up.rest == pytest.approx(-down.rest)


def test_several_releases_are_split_and_the_pull_belongs_to_none():
    values, fs, _ = free_decay(tail=2, hold=0.5)
    pull, less = (np.linspace(values[-1], share * values[0], 300) for share in (1.0, 0.6))
    record = of(np.concatenate([values, pull, values, less, 0.6 * values]), fs)
    first, second, third = find_releases(record).ring_downs
    lag = (len(values) + len(pull)) / fs
    assert second.release - first.release == pytest.approx(lag, abs=0.01)
    assert third.amplitude == pytest.approx(0.6 * first.amplitude, rel=0.02)
    for each in (first, second, third):
        assert len(each.samples) <= len(values) + 20
    assert len(second.turns) == len(first.turns)


def test_a_record_of_the_middle_of_a_decay_says_so():
    values, fs, _ = free_decay()
    (found,) = find_releases(of(values[45:700], fs)).ring_downs
    assert not found.held
    assert not found.stopped


def test_a_record_that_begins_at_the_release_knows_its_first_extreme():
    values, fs, turns = free_decay(hold=0)
    (found,) = find_releases(of(values, fs)).ring_downs
    assert found.held
    assert len(found.turns) == len(turns)


def test_clipped_peaks_are_told():
    values, fs, _ = free_decay()
    (found,) = find_releases(of(np.clip(values, -0.7, 0.7)[30:], fs)).ring_downs
    assert not found.sound[0]
    assert found.sound[-1]
    assert "clipped" in found.status


def test_a_lost_extreme_is_told():
    values, fs, _ = free_decay(dry=0.005)
    gone = values.copy()
    gone[360:395] = gone[360]
    status = find_releases(of(gone, fs)).status
    assert "an extreme was lost" in status
    status = find_releases(of(np.delete(values, slice(420, 470)), fs)).status
    assert "an extreme was lost" in status


def test_drift_is_told():
    values, fs, _ = free_decay(dry=0.005)
    assert "drifts" in find_releases(of(values + np.linspace(0, 0.3, len(values)), fs)).status
    assert find_releases(of(values, fs)).status == "ok"


def no_decay(kind: str):
    t = np.arange(0, 20, 0.01)
    wave = np.sin(2 * np.pi * t)
    rng = np.random.default_rng(2)
    return {
        "forced": wave,
        "growing": np.exp(0.1 * t) * wave,
        "beats": wave + 0.7 * np.sin(2 * np.pi * 1.15 * t),
        "overdamped": np.exp(-t) * (1 + t),
        "nothing": np.zeros_like(t),
        "noise": rng.standard_normal(t.size),
        "ramp": t,
    }[kind]


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("forced", "shrink by"),
        ("growing", "grow from"),
        ("beats", "two modes beat"),
        ("overdamped", "overdamped"),
        ("nothing", "its noise"),
        ("noise", "its noise"),
        ("ramp", "overdamped"),
    ],
)
def test_what_is_no_free_decay_is_refused_in_one_sentence(kind, words):
    with pytest.raises(ss.errors.EstimateError, match=words) as error:
        find_releases(of(no_decay(kind), 100.0))
    assert str(error.value).count(". ") == 0


def test_a_driven_record_is_refused():
    values, fs, _ = free_decay()
    base = 0.1 * np.sin(np.arange(len(values)) / 10)
    with pytest.raises(ss.errors.EstimateError, match="channel z moves"):
        find_releases(ss.Record.of({"x": values, "z": base}, fs=fs))
    still = ss.Record.of({"x": values, "z": 1e-4 * np.random.default_rng(0).standard_normal(len(values))}, fs=fs)
    assert find_releases(still).ring_downs


def test_a_record_without_motion_channels_is_refused():
    values, fs, _ = free_decay()
    with pytest.raises(ss.errors.RecordError, match="read from x, theta, v or a"):
        find_releases(of(values, fs, "pressure"))
    with pytest.raises(ss.errors.RecordError, match="not a motion"):
        find_releases(of(values, fs), channel="pressure")
    broken = values.copy()
    broken[50] = np.nan
    with pytest.raises(ss.errors.RecordError, match="no number"):
        find_releases(of(broken, fs))


def test_turning_points_alternate():
    rng = np.random.default_rng(3)
    values = np.cumsum(rng.standard_normal(2000))
    turns = np.empty(2000, dtype=np.intp)
    turns = turns[: turning_points(values, 5.0, turns)]
    steps = np.diff(values[turns])
    assert np.all(steps[1:] * steps[:-1] < 0)
    assert np.all(np.abs(steps[:-1]) >= 5.0)


def test_the_pendulums(dataset):
    record = ss.read_record(dataset("pendulum_decay") / "pend1.csv", channels={"theta": "#2 [rad]"}, time="#1")
    (found,) = find_releases(record).ring_downs
    assert found.rest == pytest.approx(np.pi, abs=0.002)  # the file counts from the top
    assert found.stopped
    assert found.held
    for name, frequency in (("60.txt", 4.73), ("100.txt", 2.76)):
        path = dataset("pendulum_bad_clock") / name
        mended = ss.signals.repair_clock(ss.read_record(path, channels={"theta": "Angle [deg]"}, time="Time_Elapsed"))
        (found,) = find_releases(mended).ring_downs
        assert found.frequency == pytest.approx(frequency, rel=0.01)
        assert found.stopped


@pytest.mark.parametrize("height", [8.0, 1.0, 30.0])
def test_a_spike_is_refused_with_what_takes_it_out(height):
    values, fs, _ = free_decay()
    values = values + 1e-3 * np.random.default_rng(1).standard_normal(len(values))
    spiked = values.copy()
    spiked[355] += height
    with pytest.raises(ss.errors.RecordError, match=r"spikes \(row 355\).*remove_spikes"):
        find_releases(of(spiked, fs))
    assert ss.fit_decay(ss.signals.remove_spikes(of(spiked, fs), "x")).damping_ratio.value == pytest.approx(
        0.0316, abs=1e-3
    )


@pytest.mark.parametrize("moment", [55, 90, 160, 215])
def test_a_motion_that_is_caught_and_held_ends_there(moment):
    """A hand catches it mid-swing, holds it and lets it go again: both are read, and neither as it is not."""
    values, fs, _ = free_decay()
    begin = int(np.flatnonzero(values != values[0])[0])
    caught = values[: begin + moment]
    hold = np.full(300, caught[-1])
    again, _, _ = free_decay(amplitude=caught[-1])
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(caught) + 300 + len(again))
    record = of(np.concatenate([caught, hold, again]) + noise, fs)
    releases = find_releases(record)
    assert releases.ring_downs[-1].stopped
    assert not any(ring_down.stopped for ring_down in releases.ring_downs[:-1])
    decay = ss.fit_decay(record)
    assert decay.damping_ratio.value == pytest.approx(0.0316, abs=max(1e-3, 4 * decay.damping_ratio.sd))
    assert decay.dry_displacement.value == pytest.approx(0.02, abs=1e-3)


def test_drift_that_spoils_the_decrements_is_told():
    values, fs, _ = free_decay()
    values = values + 1e-3 * np.random.default_rng(1).standard_normal(len(values))
    drifting = values + 0.002 * np.arange(len(values)) / fs  # 1.4 % of the first amplitude in all
    assert "the rest position drifts" in ss.decrement(of(drifting, fs)).status
    assert "drift" in ss.fit_decay(of(drifting, fs)).status
    for zeta in (0.0177, 0.0316, 0.15, 0.25):
        steady, fs, _ = free_decay(damping_ratio=zeta, dry=0.03, amplitude=1.0)
        assert "drifts" not in find_releases(of(steady, fs)).status


def test_a_release_s_window_begins_with_its_hold_and_not_with_the_hand_s_pull():
    rng = np.random.default_rng(3)
    values, fs, _ = free_decay(tail=4, hold=1.5)
    values = values + 0.4
    ramp = np.linspace(0, 1, 240)
    pull = values[-1] + (values[0] - values[-1]) * ramp**2 * (3 - 2 * ramp)
    whole = np.concatenate([values, pull, values, pull, values])
    record = of(whole + 1e-3 * rng.standard_normal(len(whole)), fs)
    ring_downs = find_releases(record).ring_downs
    assert len(ring_downs) == 3
    for ring_down in ring_downs:
        assert ring_down.held
        assert np.abs(ring_down.samples[ring_down.hold] - values[0]).max() < 6e-3
        assert ring_down.hold.stop > 100
    fit = ss.fit_decay(record)
    assert fit.status == "ok"
    alone = ss.fit_decay(of(values + 1e-3 * rng.standard_normal(len(values)), fs))
    assert fit.damping_ratio.sd < 0.75 * alone.damping_ratio.sd
