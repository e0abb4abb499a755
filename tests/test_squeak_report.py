"""A record of squeaks from the command line: findings, comparison, page, figures and sounds."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.program import main
from stickslip.cli.terminal import aligned, spoken

CONDITIONS = [("dry", 6.13), ("wet", 6.13), ("dry", 1.23), ("wet", 1.23)]
SLOPES = {"dry": 2.3, "wet": -0.26}  # s/m, of the rig's laws
FS = 10_000.0


@cache
def measured(surface: str, load: float) -> ss.Record:
    run = ss.simulate(ss.squeak.squeak_rig(surface, load), duration=2.4)
    return ss.squeak.squeak_record(run, snr=30, rng=1).between(0.4, 2.4)


@cache
def findings(surface: str, load: float) -> ss.answers.Findings:
    return ss.analyze_squeaks(measured(surface, load), name=f"{surface}, {load:g} N", normal=load)


def compared() -> ss.answers.Comparison:
    return ss.answers.compare_squeaks([findings(*each) for each in CONDITIONS])


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["squeak", *map(str, arguments)])


def tone(duration: float = 0.4, *, frequency: float = 500.0, fs: float = FS) -> np.ndarray:
    t = np.arange(int(fs)) / fs
    inside = np.exp(-((np.maximum(0, np.abs(t - 0.5) - duration / 2) / 0.01) ** 2))
    wave = sum(np.sin(2 * np.pi * order * frequency * t) / order**2 for order in (1, 2, 3))
    return inside * wave + 1e-3 * np.random.default_rng(0).standard_normal(len(t))


# ---- conditions, as the thesis's figures 7.3 and 7.6


def test_the_four_conditions_show_the_four_observations() -> None:
    found = {condition.name: condition for condition in compared().conditions}
    assert compared().squeaking == ("wet, 6.13 N",)
    assert {name: each.trend for name, each in found.items() if name != "wet, 6.13 N"} == {
        "dry, 6.13 N": "rises",
        "dry, 1.23 N": "rises",
        "wet, 1.23 N": "falls",
    }
    assert found["wet, 6.13 N"].slope.value < 0
    for load in ("6.13 N", "1.23 N"):  # water lowers friction
        assert found[f"wet, {load}"].level.value < 0.5 * found[f"dry, {load}"].level.value
    assert any("falling friction" in sentence and "wet, 1.23 N" in sentence for sentence in compared().verdicts)


@pytest.mark.parametrize(("surface", "load"), CONDITIONS)
def test_the_slope_against_speed_holds_the_truth(surface: str, load: float) -> None:
    found = findings(surface, load)
    assert found.slope_of_coefficient is not None
    assert found.slope_of_coefficient.includes(SLOPES[surface])
    assert found.loops.slope.includes(SLOPES[surface] * load)
    assert found.coefficient.value == pytest.approx({"dry": 20, "wet": 8}[surface] / 6.13, rel=0.15)


def test_a_condition_says_what_drove_it() -> None:
    each = compared().conditions[1]
    assert each.forcing == pytest.approx(5, rel=0.01)
    x = measured("wet", 6.13)["x"]
    assert each.stroke == pytest.approx((x.max() - x.min()) / 2)
    assert each.rate == pytest.approx(each.count / 2.0)
    assert ss.summary(compared()).data()["comparison"]["conditions"][1]["trend"] == each.trend


def of_sound(values: np.ndarray, name: str, fs: float = FS) -> ss.answers.Findings:
    return ss.analyze_squeaks(ss.Record.of({"sound": values}, fs=fs), name=name)


def test_what_creaks_or_whistles_is_not_called_silent() -> None:
    t = np.arange(int(FS)) / FS
    since = np.mod(20 * t + 6 * t**2, 1) / (20 + 12 * t)  # 20 to 32 in a second
    creak = np.exp(-since / 0.002) * np.random.default_rng(3).standard_normal(len(t))
    whistle = np.sin(2 * np.pi * 800 * t) * np.exp(-(((t - 0.5) / 0.2) ** 2)) + 1e-3 * creak
    chalk = of_sound(tone(frequency=2500, fs=20_000), "Chalk", 20_000)
    found = [chalk, of_sound(creak * (t > 0.1) * (t < 0.9), "Door"), of_sound(whistle, "Pipe")]
    together = ss.answers.compare_squeaks(found)
    assert [condition.answer for condition in together.conditions] == ["squeals", "creaks", "can not be told"]
    assert together.verdicts == ("Chalk squeals; Door creaks.", "Whether Pipe squeaks can not be told.")
    (table,) = ss.summary(together).tables
    assert table.headings == ["condition", "heard", "Hz", "dB"]  # no column of dashes
    heard = [row[1] for row in table.rows]
    assert heard[0] == "1 squeal (1 in a second)"
    assert heard[1].startswith("creak, 2")
    assert heard[1].endswith(" pulses in a second")
    assert heard[2] == "can not be told"
    assert ss.answers.compare_squeaks(found[1:2] * 2).verdicts == ("No condition squeaks.", "Door and Door creak.")
    assert ss.answers.compare_squeaks(found[2:] * 2).verdicts == ("Whether Pipe and Pipe squeak can not be told.",)


def test_pulses_of_a_creak_are_told_apart_from_sharp_ones_of_the_record() -> None:
    """One creak was told to have 32.7 pulses in a second, and 7.91."""
    t = np.arange(int(FS)) / FS
    since = np.mod(20 * t + 6 * t**2, 1) / (20 + 12 * t)
    creak = np.exp(-since / 0.002) * np.random.default_rng(3).standard_normal(len(t)) * (t > 0.1) * (t < 0.9)
    story = ss.summary(of_sound(creak, "Door"))
    assert "stick-slip pulses, 2" in story.answer
    names = [row[0] for table in story.tables for row in table.rows]
    assert "sharp pulses" in names
    assert "pulses" not in names


def test_no_squeak_is_said_with_what_sounds_instead() -> None:
    headline = ss.summary(findings("dry", 6.13)).headline
    count = len(findings("dry", 6.13).squeaks.bursts)
    assert headline[0] == f"No squeak. {count} bursts, tonal, with no sign of friction."


def test_friction_falls_too_only_where_it_is_known_to_fall_in_what_squeaks() -> None:
    pair = findings("wet", 6.13), findings("wet", 1.23)
    slope = pair[0].loops.slope
    for low, too in ((-3.0, True), (-4.0, False)):
        ends = replace(slope, value=-2.0, interval=(low, -4.0 - low))
        squeaking = pair[0].having(loops=replace(pair[0].loops, slope=ends))
        (told,) = (
            verdict for verdict in ss.answers.compare_squeaks([squeaking, pair[1]]).verdicts if "falls" in verdict
        )
        assert (" too," in told) == too
        assert "a falling friction alone is not enough" in told


def test_bursts_that_are_not_told_are_counted_among_all() -> None:
    t = np.arange(int(FS)) / FS
    ring = np.where(t > 0.1, np.exp(-(t - 0.1) / 0.02), 0.0) * np.sin(2 * np.pi * 900 * t)
    pipe = np.sin(2 * np.pi * 800 * t) * np.exp(-(((t - 0.65) / 0.1) ** 2))
    alone, both = (
        of_sound(each + 1e-4 * np.random.default_rng(0).standard_normal(t.size), "Pipe") for each in (pipe, ring + pipe)
    )
    assert ss.summary(alone).headline[0].endswith("one tonal burst may be friction's, or not.")
    assert ss.summary(both).headline[0].endswith("of 2 tonal bursts 1 may be friction's, or not; the other one is not.")


def test_one_record_is_no_comparison() -> None:
    with pytest.raises(ss.errors.EstimateError, match="two or more"):
        ss.answers.compare_squeaks([findings("wet", 1.23)])


def test_the_load_is_read_where_it_is_measured() -> None:
    record = measured("wet", 1.23)
    with_load = record.with_channel("normal", np.full(len(record), -1.23), unit="N", source="cell")
    assert ss.analyze_squeaks(with_load).normal.value == pytest.approx(1.23)
    with pytest.raises(ss.errors.ModelError, match="greater than 0"):
        ss.analyze_squeaks(record, normal=-1)


# ---- spectra


def test_the_tone_stands_in_the_bursts_alone() -> None:
    record = ss.Record.of({"sound": tone()}, fs=FS)
    spectra = ss.squeak.burst_spectra(record)
    place = int(np.argmax(spectra.inside["sound"]))
    assert spectra.frequency[place] == pytest.approx(500, abs=spectra.resolution)
    assert spectra.inside["sound"][place] > 1e4 * spectra.outside["sound"][place]
    assert "pauses" in spectra.compared


def test_the_spectrum_has_the_power_of_the_noise() -> None:
    rng = np.random.default_rng(0)
    noise = 0.3 * rng.standard_normal(60_000)
    loud = np.zeros(60_000)
    loud[20_000:40_000] = 10 * np.sin(2 * np.pi * 1000 * np.arange(20_000) / FS)
    spectra = ss.squeak.burst_spectra(ss.Record.of({"sound": noise + loud}, fs=FS))
    assert np.mean(spectra.outside["sound"][5:-5]) == pytest.approx(0.3**2 / (FS / 2), rel=0.1)
    assert spectra.inside["sound"].sum() * spectra.resolution == pytest.approx(50 + 0.09, rel=0.02)


def test_channels_without_a_tie_are_below_chance_as_often_as_said() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(40_000) / FS
    gate = (t > 1) & (t < 3)
    record = ss.Record.of(
        {
            "sound": gate * np.sin(2 * np.pi * 500 * t) + 0.1 * rng.standard_normal(t.size),
            "a": rng.standard_normal(t.size),
        },
        fs=FS,
    )
    spectra = ss.squeak.burst_spectra(record)
    beyond = np.mean(spectra.coherence["a", "sound"][2:-2] > spectra.significant)
    assert 0.02 < beyond < 0.09


def test_where_bursts_have_no_pauses_their_loud_parts_are_compared() -> None:
    found = findings("wet", 6.13)
    assert "loud parts" in found.spectra.compared
    assert set(found.spectra.outside) == set(found.spectra.inside)
    for burst in found.squeaks.bursts:
        assert burst.start <= burst.loud[0] < burst.loud[1] <= burst.end


def test_a_record_of_silence_between_clicks_has_no_spectra() -> None:
    record = ss.Record.of({"sound": np.r_[np.zeros(600), 1.0, np.zeros(600)] + 1e-9}, fs=FS)
    squeaks = ss.find_squeaks(record)
    assert not squeaks.squeaking


def test_names_of_a_usual_length_are_not_broken_in_the_terminal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = aligned(
        ["condition", *"abcdef"], [["sq_wet_6.13/sensors.csv", *["a cell of a table that is long"] * 6]] * 2
    )
    assert sum("sq_wet_6.13/sensors.csv" in line for line in lines) == 2
    assert max(map(len, lines)) <= 80


# ---- coupling in words


def told_of(pairs: tuple[ss.squeak.Pair, ...], found: ss.answers.Findings) -> list[str]:
    joined = replace(found.coupling, pairs=pairs)
    return list(ss.summary(found.having(coupling=joined)).headline)


def test_what_a_squeak_adds_is_said_and_not_what_is_there_without_it() -> None:
    found = findings("wet", 6.13)
    bare = tuple(replace(pair, outside=np.nan, added=None) for pair in found.coupling.pairs)
    assert any("nothing outside to tell what of that the squeak adds" in each for each in told_of(bare, found))
    same = tuple(
        replace(p, added=p.added and replace(p.added, value=0.0, interval=(-0.1, 0.1))) for p in found.coupling.pairs
    )
    assert any("that the squeak adds to any of them, against the rest, is not shown" in e for e in told_of(same, found))
    more = replace(same[0], inside=0.9, outside=0.3, added=replace(same[0].added, value=0.6, interval=(0.4, 0.8)))
    (said,) = (each for each in told_of((more, *same[1:]), found) if "more than outside" in each)
    assert said.startswith("While it squeaks, 1 of 9 pairs of channels move together more than outside")
    assert said.endswith("acceleration and normal acceleration: coherence 0.90 against 0.30.")


def test_half_a_period_is_no_delay_and_inertia_no_coupling() -> None:
    (table,) = (table for table in ss.summary(findings("wet", 6.13)).tables if table.title.startswith("What moves"))
    assert table.rows[-1][0] == "a, friction"
    assert table.rows[-1][-1] == "half a period"
    assert "it can not be told which leads" in table.note
    assert "m a = ... - f" in table.note


def test_where_the_energy_is_not_told_the_lever_is_asked_for() -> None:
    told = [spoken(each) for each in ss.summary(findings("wet", 6.13)).headline]
    assert any(
        "can not be told; what it gives the torsion is told where" in each and "--lever" in each for each in told
    )
    found = findings("wet", 6.13)
    stated = ss.squeak.coupling(found.record, squeaks=found.squeaks, lever="1.7 mm")
    told = list(ss.summary(found.having(coupling=stated)).headline)
    assert any(each.startswith("Friction feeds the torsion: ") for each in told)
    assert not any("lever" in each for each in told)


# ---- sounds


@pytest.mark.loudness
def test_a_calibrated_squeak_is_told_in_sone() -> None:
    pytest.importorskip("mosqito", reason="the extra sound is not installed")
    found = ss.analyze_squeaks(measured("wet", 6.13).between(0.4, 0.8))
    assert found.quality is not None
    rows = [row for table in ss.summary(found).tables for row in table.rows]
    assert ["loudness N5", f"{found.quality.loudness:.3g} sone"] in [row[:2] for row in rows]


def test_a_sound_comes_back_as_it_was(tmp_path: Path) -> None:
    record = ss.Record.of({"sound": 3 * tone()}, fs=FS)
    scale = ss.squeak.write_sound(record, tmp_path / "tone.wav")
    again = ss.read_record(tmp_path / "tone.wav", channels={"sound": f"sound * {scale} [Pa]"})
    assert again.fs == FS
    assert again["sound"] == pytest.approx(record["sound"], abs=0.51 * scale / 32768)
    with pytest.raises(ss.errors.FormatError, match="there already"):
        ss.squeak.write_sound(record, tmp_path / "tone.wav")
    with pytest.raises(ss.errors.FormatError, match=r"written as \.wav"):
        ss.squeak.write_sound(record, tmp_path / "tone.mp3")
    with pytest.raises(ss.errors.RecordError, match="full scale of 1"):
        ss.squeak.write_sound(record, tmp_path / "loud.wav", full_scale=1.0)


def test_a_slow_record_is_written_faster_and_sounds_alike(tmp_path: Path) -> None:
    record = ss.Record.of({"a": np.sin(2 * np.pi * 200 * np.arange(3000) / 1000.0)}, fs=1000)
    ss.squeak.write_sound(record, tmp_path / "slow.wav", full_scale=2.0)
    again = ss.read_record(tmp_path / "slow.wav")
    assert again.fs == 8000
    power = np.abs(np.fft.rfft(again["sound"]))
    assert np.argmax(power) * 8000 / len(again) == pytest.approx(200, abs=0.5)


def test_bursts_are_cut_out_in_proportion() -> None:
    quiet = np.concatenate([tone(), 0.1 * tone()])
    squeaks = ss.find_squeaks(ss.Record.of({"sound": quiet}, fs=FS))
    loud, soft = ss.squeak.burst_clips(squeaks)
    assert loud.full_scale == soft.full_scale == pytest.approx(np.max(np.abs(tone())), rel=0.05)
    assert loud.level > 50 * soft.level
    assert ss.squeak.burst_clips(squeaks, most=1) == (loud,)


# ---- the command


@pytest.mark.figures
def test_a_record_becomes_a_page_with_its_sounds(tmp_path: Path) -> None:
    ss.write_record(measured("wet", 6.13), tmp_path / "wet.csv")
    result = run(tmp_path / "wet.csv", "--normal", "6.13 N", "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "It squeaks" in result.output
    data = json.loads((tmp_path / "out" / "results.json").read_text("utf-8"))
    assert data["squeaks"]["squeaking"]
    assert data["normal_load"] == 6.13
    assert set(data["files"]) == {
        path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*") if path.is_file()
    }
    sounds = sorted((tmp_path / "out" / "sounds").iterdir())
    assert len(sounds) == len(data["squeaks"]["bursts"])
    assert ss.find_squeaks(ss.read_record(sounds[1])).bursts[0].frequency == pytest.approx(483, rel=0.02)
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert page.count("<audio") == len(sounds)
    assert not re.search(r'(src|href)="(?!data:|#)', page), "it asks nothing of a network"
    names = {path.stem for path in (tmp_path / "out" / "figures").glob("*.svg")}
    assert names == {"spectrogram", "spectra", "coherence", "forcing-cycle", "burst", "friction-velocity"}


def test_several_records_are_compared(tmp_path: Path) -> None:
    for surface, load in CONDITIONS[1::2]:
        ss.write_record(measured(surface, load), tmp_path / f"{surface}_{load}.csv")
    result = run(tmp_path / "*.csv", "--normal", "*6.13*=6.13", "--normal", "*1.23*=1.23", "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert len(result.stdout.splitlines()) < 30, "a line for each record, then the comparison"
    assert "wet_6.13.csv: It squeaks" in result.stdout
    data = json.loads((tmp_path / "out" / "results.json").read_text("utf-8"))
    rows = {each["name"]: each for each in data["comparison"]["conditions"]}
    assert rows["wet_6.13.csv"]["normal"] == 6.13
    assert rows["wet_6.13.csv"]["count"] > 5 > rows["wet_1.23.csv"]["count"] == 0


def test_conditions_that_are_compared_are_drawn() -> None:
    plates = {plate.name: plate for plate in ss.summary(compared()).plates}
    assert plates["conditions"].svg().startswith("<?xml")


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    for surface, load in CONDITIONS[1::2]:
        (tmp_path / surface / str(load)).mkdir(parents=True)
        part = measured(surface, load).between(0.4, 1.4)
        ss.write_record(part, tmp_path / surface / str(load) / "sensors.csv")
    heavy, light = (tmp_path / "wet" / str(load) / "sensors.csv" for load in (6.13, 1.23))
    result = run(heavy, light, "--normal", "6.13/*=6.13", "--normal", "sensors.csv=1.23", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)["comparison"]
    assert [each["name"] for each in told["conditions"]] == ["6.13/sensors.csv", "1.23/sensors.csv"]
    assert [each["normal"] for each in told["conditions"]] == [6.13, 1.23]
    assert "6.13/sensors.csv squeaks; 1.23/sensors.csv does not squeak." in told["verdicts"]
    wrong = run(heavy, light, "--normal", "*7*=7")
    assert wrong.exit_code == 2
    assert "no file fits '*7*': called 6.13/sensors.csv, 1.23/sensors.csv" in wrong.stderr


# ---- a seal: friction that grows with the pressure


RANGES = {1: 7.83, 3: 10.88, 5: 13.83}  # N, twice the friction's level, by bar


@pytest.fixture
def seal(dataset: Callable[[str], Path]) -> dict[int, ss.Record]:
    """The loops under each pressure: friction is the force less the pressure on the rod, dropped samples filled in."""
    area = np.pi * (0.0250 / 2) ** 2
    channels = {"x": "#5 [mm]", "pressure": "#6 [bar]", "friction": f"(#7 - #6 * 1e5 * {area}) [N]"}
    folder = dataset("rubber_seal")
    return {
        bar: ss.signals.fill_missing(
            ss.signals.fill_gaps(
                ss.read_record(folder / f"O-ring_{bar}bar.csv", channels=channels, time="#1 [ms]", rows=(15, None))
            )
        )
        for bar in RANGES
    }


def test_a_rubber_seals_friction_and_its_rise_with_the_pressure(seal: dict[int, ss.Record]) -> None:
    levels = {bar: ss.fit_curve(record, curve="coulomb").parameters["kinetic"] for bar, record in seal.items()}
    for bar, known in RANGES.items():
        assert 2 * levels[bar].value == pytest.approx(known, rel=0.03)
        assert levels[bar].includes(known / 2)
    pressures = [float(record["pressure"].mean()) / 1e5 for record in seal.values()]  # bar, in the place of a load
    line = ss.law.friction_over_load(list(levels.values()), loads=pressures)
    rise = line.coefficient.scaled(2, "N/bar")
    assert rise.includes((RANGES[5] - RANGES[1]) / 4)
    assert rise.value == pytest.approx(1.5, rel=0.05)
    assert rise.interval[0] > 0
    assert line.adhesion.interval[0] > 0  # it rubs without pressure too
    assert [line.friction(p).includes(known / 2) for p, known in zip(pressures, RANGES.values(), strict=True)] == [
        True
    ] * 3


# ---- bad input


def written(place: Path, values: np.ndarray, **options: object) -> Path:
    path = place / "sound.csv"
    return ss.write_record(ss.Record.of({"sound": values}, fs=FS, **options), path, overwrite=True)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.zeros(5000), "channel sound is silent"),
        (np.full(5000, 0.3), "channel sound is constant"),
        (tone()[:200], "the record has 200 samples"),
        (np.full(5000, np.nan), "5000 values that are not numbers"),
        (np.where(np.arange(10_000) == 77, np.nan, tone()), "--repair missing"),
    ],
    ids=["silent", "constant", "short", "without numbers", "one missing"],
)
def test_a_record_that_can_not_be_heard_ends_in_a_sentence(tmp_path: Path, values: np.ndarray, words: str) -> None:
    result = run(written(tmp_path, values), "--output", tmp_path / "out")
    assert result.exit_code == 1
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("scale", [1.2, 1.5, 4.0])
def test_clipped_sound_from_a_file_has_no_level(tmp_path: Path, scale: float) -> None:
    clipped = np.clip(scale * tone(), -1, 1)
    ss.squeak.write_sound(ss.Record.of({"sound": clipped}, fs=FS), tmp_path / "clipped.wav", full_scale=1.0)
    bursts = ss.find_squeaks(ss.read_record(tmp_path / "clipped.wav")).bursts
    assert bursts
    for burst in bursts:
        assert np.isnan(burst.level)
        assert "clipped" in burst.status
        assert burst.frequency == pytest.approx(500, rel=1e-3)


@pytest.mark.parametrize("frequency", [55.0, 440.0, 2000.0])
def test_a_tone_on_the_steps_of_16_bit_is_not_called_clipped(tmp_path: Path, frequency: float) -> None:
    wave = np.sin(2 * np.pi * frequency * np.arange(40_000) / 44_100)
    ss.squeak.write_sound(ss.Record.of({"sound": wave}, fs=44_100), tmp_path / "tone.wav", full_scale=1.2)
    assert np.isfinite(ss.find_squeaks(ss.read_record(tmp_path / "tone.wav")).bursts[0].level)


def test_channels_at_different_rates_are_refused(tmp_path: Path) -> None:
    sound = written(tmp_path, tone())
    ss.write_record(ss.Record.of({"x": np.sin(np.arange(1000.0))}, fs=1000), tmp_path / "motion.csv")
    result = run(f"{sound}+{tmp_path / 'motion.csv'}", "--output", tmp_path / "out")
    assert result.exit_code == 1
    assert "share one clock" in result.stderr


def test_a_burst_cut_by_the_end_is_said_on_the_page(tmp_path: Path) -> None:
    result = run(written(tmp_path, tone()[:5500]), "--output", tmp_path / "out")
    assert "cut by the end of the record" in result.output
    assert "can not be told" in result.output.splitlines()[2]
    assert "cut by the end of the record" in (tmp_path / "out" / "report.html").read_text("utf-8")


def test_reversals_of_dry_friction_are_no_creak() -> None:
    t = np.arange(20_000) / FS
    record = ss.Record.of({"x": 0.01 * np.sin(10 * np.pi * t), "friction": np.sign(np.cos(10 * np.pi * t))}, fs=FS)
    assert not ss.find_squeaks(record).of("creak")


def test_of_stereo_the_other_channel_is_named(tmp_path: Path) -> None:
    both = ss.Record.of({"ch1": 0.2 * tone(), "ch2": tone()}, fs=FS)
    assert any("ch2 too, 14 dB louder" in note and 'channel="ch2"' in note for note in ss.find_squeaks(both).notes)
    assert not any("ch1" in note for note in ss.find_squeaks(both, channel="ch2").notes if "alone" in note)
    cautions = ss.summary(ss.analyze_squeaks(both)).cautions
    assert [spoken(caution) for caution in cautions if "--channel ch2" in spoken(caution)]


def test_a_spike_may_be_a_contact() -> None:
    found = ss.analyze_squeaks(ss.Record.of({"sound": tone()}, fs=FS))
    spike = ss.record.Fault("spike", "a", ((3, 9),), "7 samples that stand off as spikes", "replace them")
    cautions = ss.summary(replace(found, faults=(spike,))).cautions
    assert any("lifts or lands" in caution for caution in cautions)
    assert not any("lifts or lands" in caution for caution in ss.summary(found).cautions)


def test_what_is_asked_in_vain_is_said() -> None:
    record = ss.Record.of({"sound": tone()}, fs=FS)
    assert any("no torsion is recorded" in note for note in ss.analyze_squeaks(record, lever=0.003).notes)
    with pytest.raises(ss.errors.RecordError, match="no kind of burst is called 'hiss'; there are squeak, squeal"):
        ss.find_squeaks(record).of("hiss")


def test_json_alone_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ss.squeak.write_sound(ss.Record.of({"sound": tone()}, fs=FS), tmp_path / "squeal.wav")
    data = json.loads(run("squeal.wav", "--json").output)
    assert (data["program"], data["version"], data["squeaks"]["reference"]) == ("stickslip", ss.__version__, "1")
    assert [path.name for path in tmp_path.iterdir()] == ["squeal.wav"]
