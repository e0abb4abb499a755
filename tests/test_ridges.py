"""What stands out in a map: ridges that do not jump, peaks with prominence, spikes to the sample."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import RecordError
from stickslip.signals.pieces import GLIDE, RING, Splitter

RNG = np.random.default_rng(11)
FS = 1000.0


def of(values: np.ndarray) -> ss.Record:
    return ss.Record.of({"a": values}, fs=FS)


def test_two_crossing_chirps_do_not_make_a_ridge_jump() -> None:
    t = np.arange(8000) / FS
    signal = np.sin(2 * np.pi * (30 * t + 6 * t**2)) + 0.7 * np.sin(2 * np.pi * (140 * t - 7 * t**2))
    wavelets = ss.wavelet_map(of(signal + RNG.normal(0, 0.2, t.size)), "a", frequencies=(10, 240), wavelet_frequency=10)
    step = float(wavelets.frequency[1] / wavelets.frequency[0])
    ridges = ss.signals.find_ridges(wavelets, span=30)
    assert len(ridges) >= 2
    for ridge in ridges:
        ratio = ridge.frequency[1:] / ridge.frequency[:-1]
        assert max(ratio.max(), 1 / ratio.min()) < step**2.01  # one frequency of the map and what is refined of both
        assert (np.diff(ridge.time) > 0).all()
    rising = ridges[0]
    at = (rising.time > 1) & (rising.time < 3)
    np.testing.assert_allclose(rising.frequency[at], 30 + 12 * rising.time[at], rtol=0.03)


def test_a_ridge_reads_a_tone_between_the_frequencies_of_the_map() -> None:
    t = np.arange(8000) / FS
    wavelets = ss.wavelet_map(of(np.sin(2 * np.pi * 47.3 * t)), "a", frequencies=(20, 100), voices=12)
    ridge = ss.signals.find_ridges(wavelets)[0]
    inside = (ridge.time > 1) & (ridge.time < 7)
    np.testing.assert_allclose(ridge.frequency[inside], 47.3, rtol=2e-3)


def test_the_chalk_screech_is_a_ridge(dataset: Callable[[str], Path]) -> None:
    record = ss.read_record(dataset("audio") / "chalk_screech_01.ogg", channels={"sound": "#1"})
    part = record.between(record.start + 0.25, record.start + 0.7)
    wavelets = ss.wavelet_map(part, "sound", frequencies=(1500, 6000), wavelet_frequency=20)
    ridge = ss.signals.find_ridges(wavelets, span=25)[0]
    assert ridge.duration > 0.05
    assert float(np.average(ridge.frequency, weights=ridge.modulus**2)) == pytest.approx(2950, rel=0.03)


def test_peaks_have_the_prominence_that_their_saddle_leaves() -> None:
    t = np.arange(6000) / FS

    def burst(at: float, frequency: float, height: float) -> np.ndarray:
        return height * np.exp(-(((t - at) / 0.15) ** 2)) * np.sin(2 * np.pi * frequency * t)

    signal = burst(1, 40, 1.0) + burst(3, 40, 0.5) + burst(5, 90, 0.25)
    maxima = ss.signals.local_maxima(ss.wavelet_map(of(signal), "a", frequencies=(10, 240), normalisation="amplitude"))
    assert [(round(peak.time, 1), round(peak.frequency, -1)) for peak in maxima] == [
        (1.0, 40.0),
        (3.0, 40.0),
        (5.0, 90.0),
    ]
    assert maxima[0].prominence > maxima[1].prominence > maxima[2].prominence > 20
    assert maxima[0].modulus / maxima[1].modulus == pytest.approx(2, rel=0.01)
    low = ss.signals.local_maxima(ss.wavelet_map(of(signal), "a", frequencies=(10, 240)), prominence=200)
    assert low == ()
    with pytest.raises(RecordError, match="more than 0 dB"):
        ss.signals.local_maxima(ss.wavelet_map(of(signal), "a"), prominence=0)


@pytest.mark.parametrize("shape", ["impulse", "jump", "kink"])
def test_spikes_are_found_to_the_sample(shape: str) -> None:
    """In a slow motion with noise; a jump lies between two samples."""
    count, at = 6000, np.array([1000, 1050, 3000, 3050, 3100, 5000])
    t = np.arange(count) / FS
    signal = np.sin(2 * np.pi * 2 * t)
    for number, row in enumerate(at):
        sign = 1 - 2 * (number % 2)
        if shape == "impulse":
            signal[row] += 2 * sign
        elif shape == "jump":
            signal[row:] += sign
        else:
            signal[row:] += 0.2 * sign * (np.arange(count - row))
    spikes = ss.signals.find_spikes(of(signal + RNG.normal(0, 3e-3, count)), "a", frequencies=(100, 250), threshold=15)
    rows = np.array([spike.time for spike in spikes]) * FS
    assert len(rows) == len(at)
    assert np.abs(rows - at).max() <= 1.0001
    assert [spike.group for spike in spikes] == [0, 0, 1, 1, 1, 2]


def test_noise_and_tones_have_no_spikes() -> None:
    t = np.arange(20000) / FS
    assert ss.signals.find_spikes(of(RNG.normal(size=t.size)), "a") == ()
    assert (
        ss.signals.find_spikes(
            of(np.sin(2 * np.pi * 150 * t) * (np.sin(2 * np.pi * t) > 0.99) + RNG.normal(0, 0.2, t.size)),
            "a",
            frequencies=(15, 60),
        )
        == ()
    )
    assert ss.signals.find_spikes(of(np.zeros(1000)), "a") == ()


def test_a_signal_is_cut_where_it_was_put_together() -> None:
    fs, pole = 2000.0, complex(-8.0, 2 * np.pi * 45)
    n = np.arange(60)
    ring = np.exp(pole * np.arange(90) / fs).real * 0.3
    parts = [0.4 - 0.01 * n, ring, 0.2 + 0.002 * n[:20] + 1e-4 * n[:20] ** 2, -0.8 * ring[10:70], 0.01 * n]
    signal = np.concatenate(parts) + RNG.normal(0, 0.004, sum(map(len, parts)))
    splitter = Splitter([signal, signal[:-20]], 0.004**2, 30.0)
    pieces, shorter = splitter.split(pole / fs, 9)
    assert [piece.kind for piece in pieces] == [GLIDE, RING, GLIDE, RING, GLIDE]
    assert np.abs(np.array([piece.first for piece in pieces]) - np.array([0, 60, 150, 170, 230])).max() <= 2
    assert [piece.first for piece in shorter] == [piece.first for piece in pieces]
    # the cost is that of its own pieces, each fitted by numpy
    cost = 0.0
    for piece in pieces:
        rows = np.arange(piece.first, piece.last)
        wave = np.exp(pole * rows / fs)
        design = np.vander(rows / 100, 3) if piece.kind == GLIDE else np.column_stack([wave.real, wave.imag])
        left = signal[rows] - design @ np.linalg.lstsq(design, signal[rows], rcond=None)[0]
        cost += float(left @ left) / 0.004**2 + 30.0
    assert splitter.cost(pole / fs, 9)[0] == pytest.approx(cost, rel=1e-6)
    assert splitter.cost(pole / fs * 1.1, 9)[0] > cost


def test_no_other_cut_costs_less() -> None:
    """Against every way to cut a short signal."""
    pole = complex(-0.02, 0.9)
    signal = np.concatenate([[0.5, 0.4, 0.3, 0.2], np.exp(pole * np.arange(7)).real, [0.1, 0.2, 0.3, 0.4, 0.5]])
    signal = signal + RNG.normal(0, 0.05, len(signal))
    splitter = Splitter([signal], 0.05**2, 3.0)

    def left(first: int, last: int, ring: bool) -> float:
        rows = np.arange(first, last)
        wave = np.exp(pole * rows)
        design = np.column_stack([wave.real, wave.imag]) if ring else np.vander(rows, 3)
        rest = signal[rows] - design @ np.linalg.lstsq(design, signal[rows], rcond=None)[0]
        return float(rest @ rest) / 0.05**2 + 3.0

    best = left(0, len(signal), False)
    for a in range(4, len(signal) - 8):
        for b in range(a + 5, len(signal) - 3):
            best = min(best, left(0, a, False) + left(a, b, True) + left(b, len(signal), False))
    assert splitter.cost(pole, 5)[0] == pytest.approx(best, rel=1e-9)


def test_a_band_brake_rings_after_slip_begins(dataset: Callable[[str], Path]) -> None:
    """At 41 to 56 Hz, and higher one way than the other: the strong peaks of the map of its friction."""
    path = dataset("band_brake_damper") / "0.5Hz35lbtension.json"
    record = ss.read_record(path, channels={"friction": "c3 [kip]", "v": "#4 [in/s]"}, time="#1")
    wavelets = ss.wavelet_map(record, "friction", frequencies=(20, 120), wavelet_frequency=6)
    peaks = [peak for peak in ss.signals.local_maxima(wavelets, prominence=20, span=30) if peak.frequency > 30]
    velocity = np.convolve(record["v"], np.full(64, 1 / 64), "same")
    ways = np.sign(np.interp([peak.time for peak in peaks], record.time, velocity))
    forward, back = (
        np.median([peak.frequency for peak, way in zip(peaks, ways, strict=True) if way == sign]) for sign in (1, -1)
    )
    assert 41 < forward < 50
    assert 50 < back < 58


def test_a_steady_tone_is_a_line_and_no_island() -> None:
    """The ends of the record bend the map near them: they belong to no ridge, and rounding makes no peak."""
    t = np.arange(16000) / 4000
    tone = ss.Record.of({"a": 3 * np.sin(2 * np.pi * 45 * t)}, fs=4000)
    wavelets = ss.wavelet_map(tone, "a", frequencies=(5, 1000))
    (ridge,) = ss.signals.find_ridges(wavelets)
    np.testing.assert_allclose(ridge.frequency, 45, rtol=3e-3)
    assert ss.signals.local_maxima(wavelets) == ()
