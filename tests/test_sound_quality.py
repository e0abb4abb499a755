"""Loudness, sharpness and roughness against what defines their units; pulses against closed forms."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import stickslip as ss

pytestmark = pytest.mark.loudness
FS = 48_000


def tone(level: float, *, frequency: float = 1000.0, modulation: float = 0.0, duration: float = 0.8) -> ss.Record:
    """A tone of a level [dB], modulated 100 % at a frequency [Hz] where that is given."""
    t = np.arange(int(duration * FS)) / FS
    swing = 1 + np.sin(2 * np.pi * modulation * t) if modulation else np.ones(len(t))
    wave = swing * np.sin(2 * np.pi * frequency * t) + 1e-4 * np.random.default_rng(0).standard_normal(len(t))
    return ss.Record.of({"sound": 20e-6 * 10 ** (level / 20) * wave / np.sqrt(np.mean(wave**2))}, fs=FS)


@pytest.mark.parametrize(("level", "sone"), [(40.0, 1.0), (60.0, 4.0), (80.0, 16.0)])
def test_a_tone_of_1_khz_doubles_its_loudness_every_ten_decibel(level: float, sone: float) -> None:
    pytest.importorskip("mosqito", reason="the extra sound is not installed")
    assert ss.squeak.sound_quality(tone(level, duration=0.3)).loudness == pytest.approx(sone, rel=0.05)


def test_roughness_and_sharpness_have_their_units() -> None:
    pytest.importorskip("mosqito", reason="the extra sound is not installed")
    rough = ss.squeak.sound_quality(tone(60.0, modulation=70.0))  # 1 asper: 60 dB at 1 kHz, 100 % at 70 Hz
    assert rough.roughness == pytest.approx(1.0, rel=0.17)  # a listener tells 17 % apart
    smooth = ss.squeak.sound_quality(tone(60.0))
    assert smooth.roughness < 0.1
    low, high = (ss.squeak.sound_quality(tone(60.0, frequency=f, duration=0.3)).sharpness for f in (500.0, 6000.0))
    assert low < smooth.sharpness < high
    assert smooth.sharpness == pytest.approx(1.0, rel=0.1)


def test_bursts_in_noise_sound_as_the_program_itself_says() -> None:
    metrics = pytest.importorskip("mosqito.sq_metrics", reason="the extra sound is not installed")
    t, rng = np.arange(int(0.5 * FS)) / FS, np.random.default_rng(0)
    wave = (np.abs(t - 0.3) < 0.1) * (np.sin(2 * np.pi * 2300 * t) + 0.3 * np.sin(2 * np.pi * 4600 * t))
    record = ss.Record.of({"sound": 0.1 * wave + 0.01 * rng.standard_normal(len(t))}, fs=FS)
    quality, sound = ss.squeak.sound_quality(record), record["sound"] - record["sound"].mean()
    total, specific, _, time = metrics.loudness_zwtv(sound, FS)
    assert quality.loudness_over_time == pytest.approx(total, rel=1e-9, abs=1e-12)
    assert quality.time == pytest.approx(time)
    sharp = np.average(metrics.sharpness_din_from_loudness(total, specific), weights=np.where(total > 0.01, total, 0.0))
    assert quality.sharpness == pytest.approx(sharp, rel=1e-9)
    assert quality.roughness == pytest.approx(np.mean(metrics.roughness_dw(sound, FS)[0]), rel=1e-9)


def test_a_recording_at_another_rate_is_as_loud() -> None:
    pytest.importorskip("mosqito", reason="the extra sound is not installed")
    t = np.arange(5000) / 10_000
    slow = ss.Record.of({"sound": np.sqrt(2) * 0.02 * np.sin(2 * np.pi * 1000 * t)}, fs=10_000)
    quality = ss.squeak.sound_quality(slow)
    assert quality.loudness == pytest.approx(ss.squeak.sound_quality(tone(60.0, duration=0.5)).loudness, rel=0.01)
    assert quality.to_dict()["method"] == "MoSQITo, of what lies below 5000 Hz"
    short = ss.squeak.sound_quality(slow.rows(0, 1000))
    assert np.isnan(short.roughness)
    assert short.to_dict()["roughness"] is None


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (ss.Record.of({"sound": np.sin(np.arange(9000.0))}, fs=FS, units={"sound": "1"}), "full scale"),
        (ss.Record.of({"sound": np.clip(np.sin(0.05 * np.arange(9000.0)), -0.5, 0.5)}, fs=FS), "clipped"),
        (ss.Record.of({"sound": np.sin(np.arange(900.0))}, fs=FS), "0.0187 s"),
        (ss.Record.of({"a": np.sin(np.arange(900.0))}, fs=FS), "channel sound is missing"),
    ],
)
def test_what_has_no_loudness_is_refused(record: ss.Record, words: str) -> None:
    with pytest.raises(ss.errors.RecordError, match=words):
        ss.squeak.sound_quality(record)


def test_without_the_program_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mosqito", None)
    with pytest.raises(ss.errors.FormatError, match=r"\.\[sound\]"):
        ss.squeak.sound_quality(tone(60.0, duration=0.2))


@pytest.mark.parametrize(
    ("values", "crest", "kurtosis"),
    [
        (np.sin(2 * np.pi * np.arange(10_000) / 20), np.sqrt(2), 1.5),
        (np.random.default_rng(0).standard_normal(100_000), np.sqrt(2 * np.log(100_000)), 3.0),
    ],
    ids=["sine", "noise"],
)
def test_crest_factor_and_kurtosis(values: np.ndarray, crest: float, kurtosis: float) -> None:
    impulsiveness = ss.squeak.impulsiveness(ss.Record.of({"a": values}, fs=10_000))
    assert impulsiveness.crest_factor == pytest.approx(crest, rel=0.07)  # of n normal samples about sqrt(2 ln n)
    assert impulsiveness.kurtosis == pytest.approx(kurtosis, rel=0.03)


@pytest.mark.parametrize("rate", [5, 20, 60])
def test_pulses_are_counted(rate: int) -> None:
    t = np.arange(40_000) / 20_000
    rng = np.random.default_rng(rate)
    since = np.mod(t - 0.003, 1 / rate)
    pulses = np.exp(-since / 0.001) * np.sin(2 * np.pi * 3000 * since) + 0.01 * rng.standard_normal(len(t))
    impulsiveness = ss.squeak.impulsiveness(ss.Record.of({"sound": 3 * pulses}, fs=20_000))
    assert impulsiveness.rate == pytest.approx(rate, abs=0.51)
    assert np.diff(impulsiveness.pulses) == pytest.approx(1 / rate, abs=2e-3)
    assert impulsiveness.kurtosis > 10


def test_what_has_no_pulses_is_refused() -> None:
    with pytest.raises(ss.errors.RecordError, match="never changes"):
        ss.squeak.impulsiveness(ss.Record.of({"a": np.ones(1000)}, fs=FS))
    with pytest.raises(ss.errors.RecordError, match="clipped"):
        ss.squeak.impulsiveness(ss.Record.of({"a": np.clip(np.sin(0.01 * np.arange(9000)), -0.5, 0.5)}, fs=FS))


def test_noise_has_no_pulses_and_a_slow_record_tells_none() -> None:
    noise = np.random.default_rng(0).standard_normal(50_000)
    assert ss.squeak.impulsiveness(ss.Record.of({"a": noise}, fs=20_000)).rate == 0
    slow = ss.squeak.impulsiveness(ss.Record.of({"a": noise}, fs=2_000))
    assert np.isnan(slow.rate)
    assert slow.to_dict()["rate"] is None
