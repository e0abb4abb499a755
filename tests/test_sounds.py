"""Sounds drawn without anything of the package: squeaks are found, and nothing else is said to rub."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

import numpy as np
import pytest

import sound_strangers
import stickslip as ss
from scripts import loaded
from sound_sources import FS, KINDS, RUBS, background, draw

ELSE = sorted(set(KINDS) - set(RUBS))


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    return loaded("benchmarks/sounds.py")


def heard(values: np.ndarray) -> ss.squeak.Squeaks:
    return ss.find_squeaks(ss.Record.of({"sound": values}, fs=FS, units={"sound": "1"}))


def test_squeaks_are_found_from_nine_decibel_on(benchmark: ModuleType) -> None:
    score = benchmark.measured("squeaks", 12, 90_000)
    assert score.found >= score.squeaks - 1 > 10  # of so few one may be missed
    assert score.pitched == score.found
    assert not score.answers["does not squeak"]


@pytest.mark.parametrize("kind", ELSE)
def test_nothing_else_is_said_to_rub(benchmark: ModuleType, kind: str) -> None:
    score = benchmark.measured(kind, 8, 90_000)
    assert score.claims == 0
    assert score.answers["can not be told"] == 8 or kind == "clicks"  # what is struck and dies away does not squeak


@pytest.mark.parametrize(
    ("kind", "seed"),
    [("flutes", 1), ("flutes", 10), ("whines", 8), ("whines", 20), ("kettles", 12), ("sirens", 18), ("birds", 910_018)],
)
def test_what_sounds_like_a_squeak_without_any_friction_is_not_said_to_rub(kind: str, seed: int) -> None:
    sound = sound_strangers.draw(kind, seed)  # each was called a squeal by its overtones alone
    squeaks = heard(sound.values)
    assert squeaks.answer == "can not be told"
    assert any("of sound alone" in burst.evidence for burst in squeaks.bursts)


def test_a_level_that_holds_is_one_burst_and_one_overtone_is_enough_where_the_band_holds_no_more() -> None:
    t = np.arange(int(2 * FS)) / FS
    shapes = [1 / (1 + np.exp(-(t - at) / 0.004) + np.exp((t - at - 0.12) / 0.004)) for at in (0.3, 0.7, 1.5)]
    wave = sum(np.sin(2 * np.pi * order * 4200 * t) / order for order in (1, 2))
    noise = 0.02 * np.random.default_rng(6).standard_normal(len(t))
    squeaks = heard(sum(shapes) * wave + noise)  # two frames of one level were taken for two peaks
    assert [burst.start for burst in squeaks.of("squeak")] == pytest.approx([0.3, 0.7, 1.5], abs=0.02)
    assert len(squeaks.bursts) == 3


@pytest.mark.soak
@pytest.mark.parametrize("kind", sorted(set(sound_strangers.KINDS) - set(sound_strangers.RUBS)))
def test_of_many_strangers_hardly_any_is_said_to_rub(kind: str) -> None:
    answers = [heard(sound_strangers.draw(kind, 20_000 + seed).values).answer for seed in range(100)]
    assert sum(answer != "can not be told" for answer in answers) <= 3


@pytest.mark.soak
@pytest.mark.parametrize("kind", ELSE)
def test_of_many_sounds_hardly_any_is_said_to_rub(benchmark: ModuleType, kind: str) -> None:
    assert benchmark.measured(kind, 200, 91_000).claims <= 2


@pytest.mark.soak
def test_of_many_squeaks_hardly_any_is_missed(benchmark: ModuleType) -> None:
    score = benchmark.measured("squeaks", 200, 91_000)
    assert score.found >= 0.95 * score.squeaks


def test_three_faint_squeaks_above_every_instrument_squeak_three_times() -> None:
    t = np.arange(int(2 * FS)) / FS
    shapes = [1 / (1 + np.exp(-(t - at) / 0.004) + np.exp((t - at - 0.12) / 0.004)) for at in (0.3, 0.94, 1.5)]
    wave = sum(np.sin(2 * np.pi * order * 3000 * t) / order for order in (1, 2, 3))
    noise = 10 ** (-9 / 20) * np.std(wave) * np.random.default_rng(5).standard_normal(len(t))
    squeaks = heard(sum(shapes) * wave + noise)
    assert squeaks.answer == "squeaks"
    assert [burst.start for burst in squeaks.of("squeak")] == pytest.approx([0.3, 0.94, 1.5], abs=0.02)


def test_what_sound_alone_makes_likely_is_said_to_be_likely() -> None:
    sound = draw("squeaks", 78_011)
    record = ss.Record.of({"sound": sound.values}, fs=sound.fs, units={"sound": "1"})
    findings = ss.analyze_squeaks(record)
    assert {burst.friction for burst in findings.squeaks.of("squeak", "squeal")} == {"likely"}
    assert ss.summary(findings).headline[0].startswith(f"It likely {findings.squeaks.answer}")


def test_two_partials_that_beat_are_no_creak() -> None:
    t = np.arange(int(2 * FS)) / FS
    pairs = [(400, 415), (1100, 1115), (2600, 2615)]
    beating = sum(np.sin(2 * np.pi * f * t) for pair in pairs for f in pair)
    assert heard(beating).answer == "can not be told"


def test_a_clock_is_no_creak_and_a_tick_that_is_missed_changes_nothing() -> None:
    t = np.arange(int(2 * FS)) / FS
    ticks = (
        np.exp(-np.mod(t, 0.1) / 2e-3) * np.random.default_rng(1).standard_normal(len(t)) * (np.abs(t - 0.75) > 0.05)
    )
    squeaks = heard(ticks)
    assert squeaks.answer == "can not be told"
    assert not squeaks.of("creak")


@pytest.mark.parametrize("seed", [770012, 770050, 770097])
def test_chirps_that_swell_are_no_pulses_of_stick_slip(seed: int) -> None:
    """A slip is sudden: pulses of hinges are there within 6 ms, chirps of birds in 9 ms or more."""
    assert heard(sound_strangers.draw("birds", seed).values).answer == "can not be told"


def test_one_interval_at_the_end_is_no_rate_that_wanders() -> None:
    """Noise ended an even clock with one short interval, which counted three times at the edge."""
    assert heard(draw("clicks", 770142).values).answer != "creaks"


def test_a_tone_that_leaps_to_its_overtones_is_one_squeak() -> None:
    t = np.arange(int(FS)) / FS
    shape = 1 / (1 + np.exp(-(t - 0.3) / 0.004) + np.exp((t - 0.6) / 0.004))
    louder = [1 + 3 * (np.abs(t - at) < 0.03) for at in (0.2, 0.4, 0.5)]  # overtones come to the fore in turn
    wave = sum(share * np.sin(2 * np.pi * order * 2500 * t) / order for order, share in enumerate(louder, start=1))
    (found,) = heard(shape * wave + 1e-3 * np.random.default_rng(2).standard_normal(len(t))).bursts
    assert found.kind == "squeal"
    assert found.frequency == pytest.approx(2500, rel=1e-3)


def test_a_squeak_of_the_threshold_would_have_been_heard() -> None:
    found = []
    for seed in range(20):
        rng = np.random.default_rng([7, seed])
        noise = background(rng, int(1.5 * FS))
        quiet = heard(noise)
        assert quiet.answer == "can not be told"
        pitch = rng.uniform(1000, 4000)
        at = np.arange(round(0.1 * FS)) / FS
        tone = np.sqrt(2) * 10 ** (quiet.threshold / 20) * np.sin(2 * np.pi * pitch * at)
        first = rng.integers(3000, 20_000)
        noise[first : first + len(tone)] += tone
        bursts = heard(noise).of("tonal", "squeak", "squeal")
        found.append(any(abs(burst.frequency / pitch - 1) < 0.02 for burst in bursts))
    assert np.mean(found) >= 0.9  # 95 %, of twenty


@pytest.mark.parametrize(("fs", "mains"), [(8000.0, 60.02), (44100.0, 50.0), (44100.0, 49.97), (48000.0, 50.03)])
@pytest.mark.parametrize(
    ("amplitudes", "order"), [((1.0,), 1), ((0.2, 1.0, 0.1), 2), ((0.3, 0.2, 1.0), 3)], ids=["first", "second", "third"]
)
def test_a_hum_of_the_mains_is_called_so_at_its_pitch(fs, mains, amplitudes, order) -> None:
    """The bins of a window are 23 Hz wide at 48 kHz: the pitch was told 10 Hz off, by 34 to 47 Hz at 50."""
    chance, time = np.random.default_rng(round(100 * mains)), np.arange(2 * round(fs)) / fs
    tones = [
        amplitude * np.sin(2 * np.pi * (number + 1) * mains * time + chance.uniform(0, 6))
        for number, amplitude in enumerate(amplitudes)
    ]
    hum = 0.02 * (sum(tones) + 0.1 * chance.standard_normal(time.size))
    squeaks = ss.find_squeaks(ss.Record.of({"sound": hum}, fs=fs, units={"sound": "Pa"}))
    assert not squeaks.squeaking
    loudest = squeaks.loudest
    assert loudest.frequency == pytest.approx(order * mains, abs=0.1)
    times = f"{order} times " if order > 1 else ""
    assert f"{times}the {round(mains)} Hz of the mains" in loudest.evidence


def test_a_low_tone_that_begins_and_ends_is_no_hum() -> None:
    time = np.arange(88200) / 44100
    tone = np.where(np.abs(time - 1) < 0.5, 0.02 * np.sin(2 * np.pi * 100 * time), 0)
    noise = np.random.default_rng(0).normal(0, 2e-4, time.size)
    loudest = ss.find_squeaks(ss.Record.of({"sound": tone + noise}, fs=44100.0, units={"sound": "Pa"})).loudest
    assert loudest.frequency == pytest.approx(100, abs=0.5)
    assert "mains" not in loudest.evidence


@pytest.mark.parametrize("fs", [16000.0, 48000.0, 96000.0])
def test_white_noise_is_listened_to_at_any_rate(fs: float) -> None:
    """A short stretch at a low line was looked for at 0 Hz, and a filter refused that."""
    noise = 0.01 * np.random.default_rng(0).standard_normal(int(3 * fs))
    assert {burst.kind for burst in ss.find_squeaks(ss.Record.of({"sound": noise}, fs=fs)).bursts} == {"noise"}


@pytest.mark.parametrize(
    ("times", "count"),
    [([2.0], 1), (np.linspace(0.05, 3.9, 31), 31), (np.random.default_rng(2).uniform(0.1, 3.9, 20), 19)],
    ids=["one", "even", "random"],  # two of the random ones are 2 ms apart
)
def test_clicks_are_counted_and_are_no_burst(times: Sequence[float], count: int) -> None:
    """It was said that nothing sounds, of 31 clicks 44 dB above the noise; of 20 random ones three broad bursts."""
    fs = 44100
    values = 0.003 * np.random.default_rng(1).standard_normal(4 * fs)
    t = np.arange(1323) / fs
    for second in times:
        values[round(second * fs) :][: t.size] += 0.5 * np.exp(-t / 0.0014) * np.sin(2 * np.pi * 2100 * t)
    findings = ss.analyze_squeaks(ss.Record.of({"sound": values}, fs=fs))
    assert not findings.squeaks.bursts
    assert findings.squeaks.clicks == count
    assert (
        ss.summary(findings).answer == f"Nothing squeaks: {count} click{'s' if count > 1 else ''}, and no burst in 4 s."
    )
