"""Wavelet maps by closed forms, by scipy's plain transform, and by what must not change."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.fft import fft, ifft, next_fast_len
from scipy.special import wofz

import stickslip as ss
from stickslip.errors import ModelError, RecordError, StickslipError
from stickslip.signals.morlet import normalised_gain, transform

CENTRE = 4.5
RNG = np.random.default_rng(6)


def of(values: np.ndarray, fs: float = 1000.0, **more: float) -> ss.Record:
    return ss.Record.of({"a": values}, fs=fs, **more)


def worst(found: np.ndarray, true: np.ndarray) -> float:
    """Largest error of each row over the row's largest value; the worst row counts."""
    return float((np.abs(found - true).max(axis=1) / np.abs(true).max(axis=1)).max())


def plain(values: np.ndarray, fs: float, scales: np.ndarray, normalisation: str) -> np.ndarray:
    """The definition in the frequency domain, with nothing left out."""
    size = (
        next_fast_len(len(values) + math.ceil(10 * scales.max() * fs)) | 1
    )  # odd: half the rate is no frequency of it
    spectrum, turn = fft(values, size), 2 * np.pi * np.fft.fftfreq(size, 1 / fs)
    return np.array(
        [
            ifft(spectrum * normalised_gain(a, normalisation) * np.exp(-0.5 * (a * turn - CENTRE) ** 2))[: len(values)]
            for a in scales
        ]
    )


@pytest.mark.parametrize("normalisation", ["energy", "amplitude"])
@pytest.mark.parametrize(("precision", "right"), [("double", 1e-9), ("single", 1e-5)])
@pytest.mark.parametrize("size", [30011, 50021, 90107], ids=["plain", "interpolated", "in blocks"])
def test_the_fast_transform_is_the_transform(normalisation: str, precision: str, right: float, size: int) -> None:
    values, scales = RNG.normal(size=size), CENTRE / (2 * np.pi * np.geomspace(1.0, 200.0, 57))
    transformed = transform(values, 1000.0, scales, centre=CENTRE, normalisation=normalisation, precision=precision)
    assert worst(transformed, plain(values, 1000.0, scales, normalisation)) < right


@pytest.mark.parametrize("seed", [6, 11, 29])
def test_wavelets_that_half_the_rate_cuts_off_reach_further(seed: int) -> None:
    """A spectrum that ends at half the rate rings for long: the parts of a long record hold too little of that."""
    values = np.random.default_rng(seed).normal(size=90107)
    scales = CENTRE / (2 * np.pi * np.array([205.0, 215.0, 225.0]))
    transformed = transform(values, 1000.0, scales, centre=CENTRE, normalisation="amplitude")
    inner = slice(20_000, -20_000)  # it rings round the ends of both transforms
    assert worst(transformed[:, inner], plain(values, 1000.0, scales, "amplitude")[:, inner]) < 1e-9


def test_a_tone_is_its_closed_form() -> None:
    """MO-1; the thesis's phase runs backwards, ours forwards."""
    fs, f0, phase = 2000.0, 47.0, 0.3
    t = np.arange(16000) / fs
    wavelets = ss.wavelet_map(of(np.cos(2 * np.pi * f0 * t + phase), fs), "a", frequencies=np.linspace(30, 80, 26))
    a, turn = wavelets.scale.values[:, None], 2 * np.pi * f0
    true = (
        np.sqrt(a)
        * np.pi**-0.25
        * np.sqrt(np.pi / 2)
        * (
            np.exp(1j * (turn * t + phase)) * np.exp(-((a * turn - CENTRE) ** 2) / 2)
            + np.exp(-1j * (turn * t + phase)) * np.exp(-((a * turn + CENTRE) ** 2) / 2)
        )
    )
    inside = (t > 0.5) & (t < 7.5)
    assert worst(wavelets.values[:, inside], true[:, inside]) < 1e-9


def test_the_modulus_at_the_thesis_scale() -> None:
    t = np.arange(8000) / 2000.0
    tone = of(np.sin(2 * np.pi * 47 * t), 2000.0)
    wavelets = ss.wavelet_map(tone, "a", frequencies=[46.0, 47.0, 48.0], corrected=False)
    assert float(abs(wavelets.sel(frequency=47.0, time=2.0))) == pytest.approx(0.11620902677532686, rel=1e-9)


def test_an_impulse_is_its_closed_form() -> None:
    """MO-2, for wavelets whose spectrum ends below half the rate."""
    fs, n, at = 4000.0, 8000, 4111
    impulse = np.zeros(n)
    impulse[at] = fs  # of area one
    t, scales = np.arange(n) / fs, CENTRE / (2 * np.pi * np.geomspace(10, 600, 20))
    transformed = transform(impulse, fs, scales, centre=CENTRE, normalisation="energy")
    a, apart = scales[:, None], t - at / fs
    true = a**-0.5 * np.pi**-0.25 * np.exp(1j * CENTRE * apart / a - (apart / a) ** 2 / 2)
    assert worst(transformed, true) < 1e-9


def test_a_decaying_sine_is_its_closed_form() -> None:
    """MO-3: exp(-s t) sin(w t) from t = 0 on, by the complex erfc."""
    w, s = 2 * np.pi * 47.0, 5.0
    scales = CENTRE / (2 * np.pi * np.linspace(30, 70, 9))
    a = scales[:, None]

    def one_sided(rate: complex, b: np.ndarray) -> np.ndarray:
        """a^(-1/2) pi^(-1/4) integral from 0 of exp(rate u - i w (u - b) / a - (u - b)^2 / (2 a^2)) du."""
        slope = rate * a - 1j * CENTRE
        z = (-b / a - slope) / math.sqrt(2)
        far = np.exp(rate * b + slope**2 / 2)
        near = np.exp(-((b / a) ** 2) / 2 + 1j * CENTRE * b / a) * wofz(1j * np.where(z.real < 0, -z, z))
        value = np.where(z.real < 0, 2 * far - near, near)
        return np.asarray(a**0.5 * np.pi**-0.25 * math.sqrt(np.pi / 2) * value)

    def apart(fs: float, first: float, last: float) -> float:
        t = np.arange(round(1.5 * fs)) / fs - 0.5
        values = np.where(t >= 0, np.exp(-s * np.maximum(t, 0)) * np.sin(w * t), 0.0)
        chosen = (t > first) & (t < last)
        found = transform(values, fs, scales, centre=CENTRE, normalisation="energy")[:, chosen]
        b = t[chosen]
        return worst(found, (one_sided(-s + 1j * w, b) - one_sided(-s - 1j * w, b)) / 2j)

    reach = float(scales.max())
    assert apart(16000.0, 7 * reach, 0.7) < 1e-9  # away from the onset, whose kink samples do not tell exactly
    near = {fs: apart(fs, -reach, reach) for fs in (8000.0, 16000.0)}
    assert near[16000.0] < 3e-5
    assert near[8000.0] / near[16000.0] == pytest.approx(4, rel=0.02)  # the error of summing over a kink


def test_a_chirp_is_right_to_1e_10() -> None:
    fs = 2000.0
    t = np.arange(8192) / fs
    chirp = np.cos(2 * np.pi * (20 * t + 20 * t**2)) * np.exp(-(((t - 2) / 0.8) ** 2))
    scales = CENTRE / (2 * np.pi * np.geomspace(10, 400, 60))
    transformed = transform(chirp, fs, scales, centre=CENTRE, normalisation="energy")
    true = plain(chirp, fs, scales, "energy")
    assert np.abs(transformed - true).max() < 1e-10 * np.abs(true).max()


@pytest.mark.parametrize("centre", [4.5, 6.0, 20.0])
@pytest.mark.parametrize("normalisation", ["energy", "amplitude"])
def test_a_tone_reads_its_own_frequency(centre: float, normalisation: str) -> None:
    t = np.arange(40000) / 2000.0
    tone = of(0.7 * np.sin(2 * np.pi * 47 * t + 1), 2000.0)
    near = 47 * np.linspace(0.98, 1.02, 401)
    found = abs(ss.wavelet_map(tone, "a", frequencies=near, wavelet_frequency=centre, normalisation=normalisation)).sel(
        time=10.0
    )
    assert float(found.idxmax()) == pytest.approx(47, rel=2e-4)
    if normalisation == "amplitude":
        assert float(found.max()) == pytest.approx(0.7, rel=1e-6)


def test_without_the_correction_a_tone_reads_low() -> None:
    t = np.arange(40000) / 2000.0
    near = 47 * np.linspace(0.95, 1.02, 701)
    size = abs(ss.wavelet_map(of(np.sin(2 * np.pi * 47 * t), 2000.0), "a", frequencies=near, corrected=False))
    assert float(size.sel(time=10.0).idxmax()) / 47 == pytest.approx(0.97645754712735858, abs=2e-4)


def test_the_stated_bandwidth_is_that_at_half_power() -> None:
    t = np.arange(40000) / 2000.0
    row = ss.wavelet_map(of(np.zeros(40000), 2000.0), "a", frequencies=[46.0, 47.0, 48.0], normalisation="amplitude")
    edge = 47 + float(row.bandwidth.sel(frequency=47.0)) / 2
    wavelets = ss.wavelet_map(
        of(np.sin(2 * np.pi * edge * t), 2000.0), "a", frequencies=[46.0, 47.0, 48.0], normalisation="amplitude"
    )
    assert float(abs(wavelets.sel(frequency=47.0, time=10.0))) == pytest.approx(math.sqrt(0.5), rel=1e-6)


def test_the_cone_is_where_a_jump_at_the_end_has_fallen_to_1_over_e() -> None:
    t = np.arange(4000) / 1000.0
    wavelets = ss.wavelet_map(of(np.sin(2 * np.pi * 30 * t)), "a", frequencies=(10, 100))
    cone = ss.signals.cone_of_influence(wavelets)
    for frequency in (10.0, 50.0):
        row = cone.sel(frequency=frequency, method="nearest")
        assert (~row).sum() / 1000 == pytest.approx(4.0 - 2 * float(row.cone), abs=3e-3)
    assert bool(cone.isel(time=0).all())
    assert not bool(cone.sel(time=2.0).any())


def test_the_inverse_gives_the_signal_back() -> None:
    t = np.arange(16384) / 1000.0
    burst = 3.0 + np.exp(-(((t - 8) / 1.5) ** 2)) * (np.cos(2 * np.pi * 40 * t) + 0.5 * np.sin(2 * np.pi * 90 * t))
    for normalisation in ("energy", "amplitude"):
        inverse = ss.signals.inverse_wavelet(
            ss.wavelet_map(of(burst), "a", frequencies=(5, 250), normalisation=normalisation)
        )
        assert np.abs(inverse - burst).max() < 1e-10


@pytest.mark.parametrize("normalisation", ["energy", "amplitude"])
@pytest.mark.parametrize(("lowest", "highest"), [(22.5, 90), (45, 180), (5, 1000)])
def test_the_inverse_is_right_within_a_record_that_begins_and_ends_in_motion(
    lowest: float, highest: float, normalisation: str
) -> None:
    t = np.arange(16000) / 4000
    tone = 3 * np.sin(2 * np.pi * 45 * t + 0.3)
    wavelets = ss.wavelet_map(of(tone, 4000.0), "a", frequencies=(lowest, highest), normalisation=normalisation)
    off = np.abs(ss.signals.inverse_wavelet(wavelets) - tone)
    assert off[4000:12000].max() < 3 * 5e-3  # what the steps at the ends have below 5 Hz is not in the map
    assert off[7000:9000].max() < 3 * 1e-4


def test_scaling_and_shift() -> None:
    values = RNG.normal(size=4000)
    one = ss.wavelet_map(of(values), "a", frequencies=(10, 200), voices=4)
    two = ss.wavelet_map(of(-3 * values + 7), "a", frequencies=(10, 200), voices=4)
    np.testing.assert_allclose(two.values, -3 * one.values, atol=1e-12)
    faster = ss.wavelet_map(of(values, 5000.0, start=2.0), "a", frequencies=(50, 1000), voices=4)
    np.testing.assert_allclose(faster.values * math.sqrt(5), one.values, atol=1e-12)
    assert float(faster.time[0]) == 2.0


def test_blocks_equal_the_whole() -> None:
    values = RNG.normal(size=20000)
    record = of(values - values.mean())
    whole = ss.wavelet_map(record, "a", frequencies=(5, 200), voices=4)
    for size in (700, 3000, 50000):
        parts = list(ss.signals.wavelet_blocks(record, "a", frequencies=(5, 200), voices=4, size=size))
        assert worst(np.hstack([part.values for part in parts]), whole.values) < 1e-9
        np.testing.assert_allclose(np.concatenate([part.time for part in parts]), whole.time)


def test_blocks_of_a_stream_equal_the_whole() -> None:
    values = np.concatenate([np.tile([1.0, -1.0], 250), RNG.normal(size=9500)])  # the first block's mean is zero
    record = of(values - np.where(np.arange(10000) < 500, 0.0, values[500:].mean()))
    whole = ss.wavelet_map(record, "a", frequencies=(10, 200), voices=4)

    def stream() -> Iterator[ss.Record]:
        for first in range(0, 10000, 500):
            yield record.rows(first, first + 500)

    parts = list(ss.signals.wavelet_blocks(stream(), "a", frequencies=(10, 200), voices=4, size=1234))
    assert worst(np.hstack([part.values for part in parts]), whole.values) < 1e-9
    with pytest.raises(RecordError, match="in order"):
        list(ss.signals.wavelet_blocks(iter([record.rows(0, 500), record.rows(0, 500)]), "a", frequencies=(10, 200)))


def test_an_overview_of_blocks_is_that_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns are joined two by two on the way, of odd numbers too, and no peak is moved."""
    monkeypatch.setattr("stickslip.signals.wavelet.BLOCK_BYTES", 16 * 13 * 701)
    spikes = np.zeros(9000)
    spikes[[700, 2900, 4300, 8888]] = 1.0
    record = of(spikes)
    seen = ss.signals.wavelet_overview(record, "a", frequencies=(50, 200), voices=6, columns=30)
    width = round(float(seen.time[1] - seen.time[0]) * record.fs)
    whole = np.abs(ss.wavelet_map(record, "a", frequencies=(50, 200), voices=6).values)
    starts = np.arange(0, len(record), width)
    assert 15 <= seen.sizes["time"] == len(starts) <= 31
    assert seen.values == pytest.approx(np.maximum.reduceat(whole, starts, axis=1), rel=1e-6, abs=1e-9)


def test_an_overview_keeps_the_largest() -> None:
    values = np.zeros(50000)
    values[31234] = 1.0
    record = of(values)
    whole = abs(ss.wavelet_map(record, "a", frequencies=(20, 200), voices=4))
    seen = ss.signals.wavelet_overview(record, "a", frequencies=(20, 200), voices=4, columns=300)
    assert 150 <= seen.sizes["time"] <= 300
    np.testing.assert_allclose(seen.values.max(axis=1), whole.values.max(axis=1), rtol=1e-9)
    assert float(seen.sel(frequency=200, method="nearest").idxmax()) == pytest.approx(31.234, abs=0.2)
    assert (seen.attrs["start"], seen.attrs["end"]) == (0.0, 49.999)


def test_a_day_in_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """The memory does not grow with the record's length."""
    monkeypatch.setattr("stickslip.signals.wavelet.BLOCK_BYTES", 8 << 20)
    block = of(np.sin(2 * np.pi * 0.05 * np.arange(40000)), 4000.0)

    def stream(blocks: int) -> Iterator[ss.Record]:
        for number in range(blocks):
            yield ss.Record.of({"a": block["a"]}, fs=4000.0, start=number * 10.0)

    def peak(blocks: int) -> int:
        tracemalloc.start()
        seen = ss.signals.wavelet_overview(stream(blocks), "a", frequencies=(100, 400), voices=2, columns=100)
        taken = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert float(seen.max()) > 0
        return taken

    assert peak(80) < 1.2 * peak(20)


def test_the_longest_wavelets_take_no_more_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a range, the lowest wavelet reaches farther than a part of the record is long."""
    monkeypatch.setattr("stickslip.signals.wavelet.BLOCK_BYTES", 8 << 20)
    record = of(RNG.normal(size=60000), 4000.0)
    tracemalloc.start()
    seen = ss.signals.wavelet_overview(
        (record.rows(first, first + 20000) for first in range(0, 60000, 20000)), "a", voices=8
    )
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken < 5 * (8 << 20)
    whole = ss.wavelet_map(record, "a", frequencies=seen.frequency.values)
    assert float(seen.max()) == pytest.approx(float(abs(whole).max()), rel=0.01)  # the means taken off differ


def test_the_thesis_grid() -> None:
    t = np.arange(4096) / 1000.0
    record = of(np.sin(2 * np.pi * 30 * t))
    points = ss.signals.dyadic_map(record, "a")
    level = points.where(points.m == 4, drop=True)
    assert level.sizes["point"] == 4096 // 16
    np.testing.assert_allclose(np.diff(level.time), 0.016)
    whole = ss.wavelet_map(record, "a", frequencies=np.sort(np.unique(points.frequency)), corrected=False)
    row = whole.sel(frequency=float(level.frequency[0]), time=level.time.values, method="nearest")
    np.testing.assert_allclose(level.values, row.values, atol=1e-12)


def test_the_short_time_transform_reads_a_tone() -> None:
    record = of(0.3 * np.sin(2 * np.pi * 50 * np.arange(4000) / 1000) + 5)
    size = abs(ss.signals.stft_map(record, "a", nperseg=200))
    assert float(size.sel(frequency=50.0, time=2.0)) == pytest.approx(0.3, rel=1e-3)
    assert float(size.sel(frequency=200.0, time=2.0)) < 1e-3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frequencies": (10, 600)}, "nothing is known above half the rate, 500 Hz"),
        ({"frequencies": (0.1, 100)}, "the lowest frequency that it allows is"),
        ({"frequencies": (0, 100)}, "positive and rise"),
        ({"frequencies": (100, 10)}, "positive and rise"),
        ({"frequencies": (10, np.nan)}, "positive and rise"),
        ({"voices": 0}, "1 to 512"),
        ({"wavelet_frequency": 1.0}, "3 to 100"),
        ({"normalisation": "loud"}, "energy, amplitude"),
        ({"precision": "half"}, "double, single"),
        ({"voices": 512, "frequencies": (0.1, 500)}, "wavelet_blocks"),
    ],
)
def test_what_can_not_be_mapped_is_refused(change: dict, words: str) -> None:
    count = 500_000 if change.get("voices") == 512 else 4000
    with pytest.raises(StickslipError, match=words):
        ss.wavelet_map(of(np.sin(0.3 * np.arange(count))), "a", **change)


def test_bad_records_are_refused() -> None:
    with pytest.raises(RecordError, match="fill_missing"):
        ss.wavelet_map(of(np.array([0.0, np.nan, 1.0] * 100)), "a")
    with pytest.raises(RecordError, match="needs at least 16"):
        ss.wavelet_map(of(np.arange(10.0)), "a")
    with pytest.raises(RecordError, match="channel b is missing"):
        ss.wavelet_map(of(np.arange(100.0)), "b")


def test_a_constant_holds_no_frequency() -> None:
    assert np.abs(ss.wavelet_map(of(np.full(1000, 3.7)), "a").values).max() < 1e-14


def test_the_chalk_screech_rings_at_2950_hz(dataset: Callable[[str], Path]) -> None:
    record = ss.read_record(dataset("audio") / "chalk_screech_01.ogg", channels={"sound": "#1"})
    size = abs(
        ss.wavelet_map(record, "sound", frequencies=(1000, 8000), wavelet_frequency=20, normalisation="amplitude")
    )
    power = (size.sel(time=slice(0.30, 0.65)) ** 2).mean("time")
    assert float(power.idxmax()) == pytest.approx(2950, rel=0.03)


def test_it_can_be_drawn() -> None:
    record = of(np.sin(0.3 * np.arange(2000)))
    maps = (ss.wavelet_map(record, "a"), ss.signals.dyadic_map(record, "a"), ss.signals.stft_map(record, "a"),
            ss.signals.wavelet_overview(record, "a", columns=100), ss.wavelet_map(of(np.zeros(2000)), "a"))  # fmt: skip
    for found in maps:
        for style in ("filled", "lines"):
            figure = ss.figures.plot_wavelet(found, record=record, style=style)
            assert [ax.get_ylabel() for ax in figure.axes][1] == "frequency [Hz]"
    with pytest.raises(RecordError, match="spans some decibel"):
        ss.figures.plot_wavelet(maps[0], span=-3)


def test_no_frequency_is_refused_and_a_single_one_is_drawn() -> None:
    record = ss.Record.of({"a": np.sin(0.3 * np.arange(1000))}, fs=1000)
    with pytest.raises(ModelError, match="positive and rise"):
        ss.wavelet_map(record, "a", frequencies=[])
    single = ss.wavelet_map(record, "a", frequencies=[45.0])
    assert len(ss.figures.plot_wavelet(single, record=record).axes) == 3
    with pytest.raises(RecordError, match="two frequencies"):
        ss.figures.plot_wavelet(single, style="lines")
