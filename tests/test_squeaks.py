"""Bursts of sound: found, named and measured, against closed forms, virtual recordings and real ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import stickslip as ss
from scripts import loaded

Heard = Callable[[str], ss.squeak.Squeaks]
FS = 20_000.0
REAL = {
    "chalk_screech_01.ogg": {"squeal", "tonal"},
    "door_creak.ogg": {"creak"},
    "church_bells_01.ogg": {"tonal"},
    "canary_01.ogg": {"tonal"},
    "whistle.ogg": {"tonal"},
    "rain_light.ogg": {"noise"},
    "scrape_01.ogg": {"scrape"},
    "chalk_write_01.ogg": {"scrape"},
    "chalk_write_02.ogg": {"scrape"},
}


@pytest.fixture
def heard(dataset: Callable[[str], Path]) -> Heard:
    return lambda name: ss.find_squeaks(ss.read_record(dataset("audio") / name))


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    return loaded("benchmarks/squeak.py")


def burst(frequency: float = 2500.0, *, begin: float = 0.4, growth: float = 0.02, fs: float = FS) -> np.ndarray:
    """Grows by e in `growth` seconds, keeps for 0.2 s and falls as it grew; 1 s long, 1 Pa high."""
    t = np.arange(int(fs)) / fs
    envelope = np.exp(-np.maximum(0, np.maximum(begin - t, t - begin - 0.2)) / growth)
    wave = sum(share * np.sin(2 * np.pi * order * frequency * t) for order, share in ((1, 1.0), (2, 0.3), (3, 0.1)))
    return envelope * wave + 1e-3 * np.random.default_rng(0).standard_normal(len(t))


def test_a_burst_of_sound_is_measured() -> None:
    (found,) = ss.find_squeaks(ss.Record.of({"sound": burst()}, fs=FS)).bursts
    assert (found.kind, found.friction, found.status) == ("squeal", "likely", "ok")
    assert found.frequency == pytest.approx(2500, rel=1e-3)
    assert [round(f / found.frequency) for f, _ in found.harmonics[:2]] == [2, 3]
    assert found.harmonics[0][1] == pytest.approx(20 * math.log10(0.3), abs=0.5)
    assert found.start == pytest.approx(0.4 - 0.02 * math.log(10), abs=0.015)
    assert found.end == pytest.approx(0.6 + 0.02 * math.log(10), abs=0.015)


def test_levels_are_those_of_a_calibrated_tone() -> None:
    t = np.arange(20_000) / 20_000
    tone = np.sqrt(2) * np.sin(2 * np.pi * 1000 * t) * ((t > 0.2) & (t < 0.8))
    (found,) = ss.find_squeaks(ss.Record.of({"sound": tone}, fs=20_000)).bursts
    assert found.level == pytest.approx(94.0, abs=0.4)  # 1 Pa
    assert found.weighted_level == pytest.approx(found.level, abs=0.1)  # A-weighting is 0 dB at 1 kHz


@pytest.mark.parametrize(
    ("frequency", "weighting"), [(100, -19.1), (500, -3.2), (1000, 0.0), (4000, 1.0), (8000, -1.1)]
)
def test_the_weighting_is_that_of_the_standard(frequency: float, weighting: float) -> None:
    from stickslip.squeak.sound import a_weighting

    assert 20 * math.log10(a_weighting(frequency)) == pytest.approx(weighting, abs=0.06)  # IEC 61672-1, table 3


@pytest.mark.parametrize("gain", [0.01, 30.0])
def test_louder_or_fainter_changes_the_level_alone(gain: float) -> None:
    first, second = (ss.find_squeaks(ss.Record.of({"sound": g * burst()}, fs=FS)).bursts[0] for g in (1.0, gain))
    assert second.level - first.level == pytest.approx(20 * math.log10(gain), abs=1e-6)
    assert second.kind == first.kind or second.level < 50  # what nobody hears is no squeak
    assert (second.start, second.duration) == (first.start, first.duration)


@pytest.mark.parametrize("fs", [18_000.0, 44_100.0])
def test_the_sampling_rate_does_not_matter(fs: float) -> None:
    (found,) = ss.find_squeaks(ss.Record.of({"sound": burst(fs=fs)}, fs=fs)).bursts
    assert (found.kind, found.frequency) == ("squeal", pytest.approx(2500, rel=2e-3))
    assert found.start == pytest.approx(0.354, abs=0.015)


@pytest.mark.parametrize(
    ("orders", "pitch", "length", "words"),
    [
        ((1,), 2700, 0.4, "no overtone in a whole ratio"),
        ((1, 2), 2700, 0.4, "one overtone in a whole ratio"),
        ((1, 2, 3), 2700, 0.4, "2 overtones in whole ratios"),
        ((1, 2, 3), 700, 0.4, "at 700 Hz it may be a voice, an instrument or a machine"),
        ((1, 2, 3), 700, 0.08, "cycles of its tone; 100 are needed to tell overtones in whole ratios"),
    ],
)
def test_a_tone_says_which_reason_it_was(orders: tuple[int, ...], pitch: float, length: float, words: str) -> None:
    t = np.arange(20_000) / FS
    envelope = np.exp(-((np.maximum(0, np.abs(t - 0.5) - length / 2) / 0.01) ** 2))
    wave = sum(np.sin(2 * np.pi * order * pitch * t) / order**2 for order in orders)
    sound = envelope * wave + 1e-4 * np.random.default_rng(0).standard_normal(len(t))
    (found,) = ss.find_squeaks(ss.Record.of({"sound": sound}, fs=FS)).bursts
    assert words in found.evidence
    assert found.kind == ("squeal" if words.startswith("2") else "tonal")


@pytest.mark.parametrize(("centre", "words"), [(1.25, "nothing slides meanwhile"), (1.36, "% of it, less than")])
def test_what_sounds_while_the_motion_dwells_says_how_much_of_it_slides(centre: float, words: str) -> None:
    t = np.arange(60_000) / FS
    ring = np.exp(-(((t - centre) / 0.06) ** 8)) * np.sin(2 * np.pi * 900 * t)
    record = ss.Record.of({"x": 3e-3 * np.clip(2 * np.sin(2 * np.pi * t), -1, 1), "sound": ring}, fs=FS)
    (found,) = ss.find_squeaks(record).bursts
    assert words in found.evidence
    assert (found.kind, found.friction) == ("tonal", "no")


def test_a_ring_that_fades_into_a_lower_hum_is_named_by_what_is_loud() -> None:
    t = np.arange(20_000) / FS
    ring = np.where(t > 0.2, np.exp(-(t - 0.2) / 0.02), 0.0) * np.sin(2 * np.pi * 415 * t)
    hum = 0.12 * np.sin(2 * np.pi * 345 * t) * ((t > 0.2) & (t < 0.45))
    record = ss.Record.of({"sound": ring + hum + 1e-5 * np.random.default_rng(0).standard_normal(t.size)}, fs=FS)
    largest = max(ss.find_squeaks(record).bursts, key=lambda each: each.level)
    assert largest.frequency == pytest.approx(415, rel=0.01)
    assert largest.duration > 0.2


def test_pulses_whose_rate_wanders_are_a_creak() -> None:
    t = np.arange(20_000) / 20_000
    rng = np.random.default_rng(3)
    since = np.mod(20 * t + 10 * t**2, 1) / (20 + 20 * t)  # 20 to 40 in a second
    creak = np.exp(-since / 0.002) * rng.standard_normal(len(t)) * (np.abs(t - 0.5) < 0.4)
    record = ss.find_squeaks(ss.Record.of({"sound": creak}, fs=20_000)).of("creak")
    assert len(record) == 1
    assert record[0].rate == pytest.approx(30, rel=0.05)  # that of the middle


def test_what_is_struck_is_no_squeak() -> None:
    t = np.arange(20_000) / FS
    ring = np.where(t > 0.3, np.exp(-(t - 0.3) / 0.1), 0.0) * np.sin(2 * np.pi * 500 * t)
    (found,) = ss.find_squeaks(ss.Record.of({"sound": ring + 0.5 * ring**2}, fs=FS)).bursts
    assert (found.kind, found.friction) == ("tonal", "no")
    assert "struck" in found.evidence


def test_a_microphone_without_calibration_gives_relative_levels() -> None:
    record = ss.Record.of({"sound": burst()}, fs=FS, units={"sound": "1"})
    squeaks = ss.find_squeaks(record)
    assert (squeaks.reference, squeaks.bursts[0].kind) == ("1", "squeal")
    assert squeaks.bursts[0].level < 0
    assert math.isnan(squeaks.bursts[0].weighted_level)
    assert "not calibrated" in squeaks.notes[0]
    assert squeaks.to_dict()["bursts"][0]["weighted_level"] is None


def test_a_clipped_burst_has_no_level() -> None:
    found = ss.find_squeaks(ss.Record.of({"sound": np.clip(burst(), -0.5, 0.5)}, fs=FS)).bursts[0]
    assert math.isnan(found.level)
    assert found.harmonics == ()
    assert "clipped" in found.status
    assert found.frequency == pytest.approx(2500, rel=2e-3)
    printed = repr(ss.find_squeaks(ss.Record.of({"sound": np.clip(burst(), -0.5, 0.5)}, fs=FS)))
    assert "clipped, no level" in printed
    assert "nan" not in printed


def test_a_burst_cut_by_the_end_says_so() -> None:
    found = ss.find_squeaks(ss.Record.of({"sound": burst()[:9000]}, fs=FS)).bursts[-1]
    assert "cut by the end of the record" in found.status


@pytest.mark.parametrize(
    ("record", "options", "error", "words"),
    [
        (ss.Record.of({"sound": np.zeros(1000)}, fs=FS), {}, ss.errors.EstimateError, "silent"),
        (ss.Record.of({"sound": burst()}, fs=FS), {"channel": "a"}, ss.errors.RecordError, "channel a is missing"),
        (ss.Record.of({"sound": burst()[:200]}, fs=FS), {}, ss.errors.RecordError, "200 samples"),
        (ss.Record.of({"sound": burst()}, fs=100.0), {}, ss.errors.RecordError, "two octaves"),
        (
            ss.Record.of({"sound": burst()}, fs=FS),
            {"frequencies": (100, 18_000)},
            ss.errors.RecordError,
            "half the rate",
        ),
        (ss.Record.of({"sound": burst()}, fs=FS), {"span": -1.0}, ss.errors.RecordError, "span = -1"),
    ],
)
def test_what_can_not_be_heard_is_refused(record: ss.Record, options: dict, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        ss.find_squeaks(record, **options)


@pytest.mark.parametrize("name", REAL)
def test_real_sounds_are_called_what_they_are(heard: Heard, name: str) -> None:
    squeaks = heard(name)
    assert {burst.kind for burst in squeaks.bursts} == REAL[name]
    if name not in ("chalk_screech_01.ogg", "door_creak.ogg"):
        assert {burst.friction for burst in squeaks.bursts} <= {"no", "not told"}


def test_the_chalk_squeals_near_three_kilohertz(heard: Heard) -> None:
    (squeal,) = heard("chalk_screech_01.ogg").of("squeal")
    assert squeal.frequency == pytest.approx(2950, rel=0.01)
    assert (squeal.start, squeal.end) == (pytest.approx(0.30, abs=0.05), pytest.approx(0.7, abs=0.1))


@pytest.mark.parametrize("name", ["scrape_03.ogg", "scrape_04.ogg", "chalk_write_03.ogg"])
def test_scraping_is_no_squeal(heard: Heard, name: str) -> None:
    assert not heard(name).squeaking


def test_squeaks_of_the_virtual_rig_are_found_and_told_from_ringing(benchmark: ModuleType) -> None:
    score = benchmark.measured(10)
    assert (score.recall, score.precision, score.wrong_conditions) == (1.0, 1.0, 0)
    assert score.true > 15
    assert max(score.frequencies) < 0.01


def test_a_squeak_says_where_in_the_cycle_it_is() -> None:
    record = ss.squeak.squeak_record(ss.simulate(ss.squeak.squeak_rig(), duration=2.4), snr=40, rng=1)
    found = ss.find_squeaks(record)
    assert not found.of("creak")  # many squeaks at even intervals are no pulses
    squeaks = [burst for burst in found.of("squeak") if burst.status == "ok"]
    assert found.forcing == pytest.approx(5, rel=0.01)
    assert np.std([burst.phase for burst in squeaks[1:]]) < 0.05
    for burst in squeaks:
        at = np.argmax(np.abs(record["sound"]) * ((record.time >= burst.start) & (record.time < burst.end)))
        assert burst.speed == pytest.approx(record["v"][at], abs=0.06)
        assert {"sound", "normal_acceleration", "a", "friction", "v"} <= set(burst.levels)


# ---- sound


def test_the_sound_of_a_point_source() -> None:
    t = np.arange(8000) / 8000
    shaken = ss.Record.of({"a": 100 * np.sin(2 * np.pi * 400 * t)}, fs=8000)
    near, far = (ss.squeak.sound_pressure(shaken, area=1e-3, distance=r)["sound"] for r in (1.0, 2.0))
    expected = 1.204 * 1e-3 * 100 / (4 * np.pi) * np.sin(2 * np.pi * 400 * (t - 1 / 343.2))
    assert near[800:7000] == pytest.approx(expected[800:7000], abs=1e-6)
    assert np.std(near[800:7000]) == pytest.approx(2 * np.std(far[800:7000]), rel=1e-3)


def test_a_run_sounds_as_its_record_does() -> None:
    run = ss.simulate(ss.squeak.squeak_rig(), duration=0.3)
    exact = ss.squeak.sound_pressure(run, fs=40_000)["sound"]
    record = run.record(fs=40_000)
    sampled = ss.squeak.sound_pressure(record, normal="a2")["sound"]
    assert sampled[200:-200] == pytest.approx(exact[200:-200], abs=0.02 * np.max(np.abs(exact)))


def test_a_disk_in_a_wall_is_exact_near_and_twice_the_point_far() -> None:
    fs, frequency = 50_000.0, 500.0
    w, c = 2 * np.pi * frequency, 343.2
    time = np.arange(50_000) / fs
    shaken = ss.Record.of({"a": np.sin(w * time)}, fs=fs)

    def heard(area: float, distance: float, *, baffled: bool) -> float:
        sound = ss.squeak.sound_pressure(shaken, area=area, distance=distance, baffled=baffled)["sound"]
        return float(np.sqrt(2) * np.std(sound[10_000:40_000]))

    area, near = 0.02, 0.0254  # Rayleigh's integral of a harmonic disk on its axis (Pierce, "Acoustics", 5-7)
    edge = np.hypot(near, np.sqrt(area / np.pi))
    assert heard(area, near, baffled=True) == pytest.approx(
        2 * 1.204 * c / w * abs(np.sin(w / c * (edge - near) / 2)), rel=1e-3
    )
    assert heard(area, 5.0, baffled=True) == pytest.approx(2 * heard(area, 5.0, baffled=False), rel=5e-3)


def test_the_disk_of_a_run_is_that_of_its_record() -> None:
    run = ss.simulate(ss.squeak.squeak_rig("wet", 6.13), duration=0.4)
    kept = ss.squeak.squeak_record(run, fs=50_000, baffled=True, area=0.02, distance=0.0254)
    again = ss.squeak.sound_pressure(kept, area=0.02, distance=0.0254, baffled=True)
    inner = slice(2000, -2000)
    assert np.std((again["sound"] - kept["sound"])[inner]) < 0.02 * np.std(kept["sound"][inner])


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"area": -1.0}, ss.errors.ModelError, "area = -1"),
        ({"distance": 1e-3}, ss.errors.ModelError, "point source"),
        ({"normal": "y"}, ss.errors.RecordError, "channel y is missing"),
    ],
)
def test_a_source_without_meaning_is_refused(options: dict, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        ss.squeak.sound_pressure(ss.Record.of({"a": [0.0, 1.0]}, fs=10), **options)


def test_noise_is_as_loud_as_asked() -> None:
    run = ss.simulate(ss.squeak.squeak_rig(), duration=0.5)
    clean, noisy = (ss.squeak.squeak_record(run, snr=snr, rng=1) for snr in (math.inf, 20.0))
    for name in clean:
        assert np.std(noisy[name] - clean[name]) == pytest.approx(0.1 * np.std(clean[name]), rel=0.05)
