"""Delays are taken out of the channels named, to the accuracy of the interpolation, and of no other."""

import numpy as np
import pytest

from stickslip.errors import RecordError
from stickslip.record.record import Record
from stickslip.signals.interpolate import without_delays

FS = 1000.0
T = np.arange(4000) / FS


def late(**delays):
    """Sines of 30 Hz, each late by its delay."""
    record = Record.of({name: np.sin(2 * np.pi * 30 * (T - delay)) for name, delay in delays.items()}, fs=FS)
    for name, delay in delays.items():
        record = record.with_details(name, delay=delay)
    return record


@pytest.mark.parametrize("delay", [1.2585e-3, -0.6e-3, 5e-3])
def test_a_delayed_channel_agrees_with_the_others_afterwards(delay):
    record = without_delays(late(p=0.0, q=delay))
    assert np.abs(record["q"] - record["p"])[40:-40].max() < 1e-4
    assert len(record) == len(T) - np.ceil(abs(delay) * FS)
    assert record.start == pytest.approx(max(0.0, np.ceil(-delay * FS) / FS))
    assert record.channels["q"].delay == 0
    assert record.history[-1].arguments == {"delays": {"q": delay}}


def test_only_the_channels_named_are_moved():
    before = late(p=0.0, q=2.5e-3, r=-7.5e-3)
    values = before["r"].copy()
    values[100] = np.nan
    before = before.with_samples({**before.samples, "r": values}, before.history[-1])
    record = without_delays(before, "p", "q")
    assert np.flatnonzero(np.isnan(record["r"])).tolist() == [100]
    assert np.array_equal(record["r"], values[: len(record)], equal_nan=True)
    assert record.channels["r"].delay == -7.5e-3


def test_without_a_delay_the_record_is_returned_as_it_is():
    record = late(p=0.0, q=1e-3)
    assert without_delays(record, "p") is record


def test_refusals():
    with pytest.raises(RecordError, match="delays"):
        without_delays(late(p=0.0, q=3.99), samples=24)
    with pytest.raises(RecordError, match="missing"):
        without_delays(late(p=0.0), "q")
    broken = late(q=1e-3)
    broken = broken.with_samples({"q": np.where(np.arange(4000) == 7, np.nan, broken["q"])}, broken.history[-1])
    with pytest.raises(RecordError, match="row 7"):
        without_delays(broken)


def test_counts_that_are_no_longer_seen_are_in_the_noise() -> None:
    """A commissioned rig's own record was "not to be trusted": its twins had the noise before the counts alone."""
    time, step = np.arange(4000) / 1000, 2.5e-6
    noisy = 1e-3 * np.sin(9 * time) + 1e-6 * np.random.default_rng(1).standard_normal(4000)
    record = Record.of({"x": np.round(noisy / step) * step}, fs=1000.0).with_details("x", delay=1.25e-3, noise=1e-6)
    moved = without_delays(record).channels["x"]
    assert moved.noise == pytest.approx(np.hypot(1e-6, step / 12**0.5), rel=1e-6)
    assert without_delays(record.with_details("x", noise=None)).channels["x"].noise is None
