"""stickslip simulate: what it prints, what it writes, and how it refuses."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

import stickslip as ss
from stickslip.cli.program import main
from stickslip.files.write import WRITERS
from stickslip.story import folder as folder_module
from stickslip.story import simulation

SLIDER = """
system = { mass = "2.42 kg", stiffness = 2310 }
law = { name = "Coulomb", kinetic = 1.1 }
[drive]
name = "HarmonicBase"
amplitude = "0.65 mm"
frequency = 2.5
[run]
cycles = 30
fs = 1000
"""
SQUEAL = """
about = "a mass pressed on a belt, sprung along it and across it"
[system]
mass = [["1 kg", 0], [0, 1]]
stiffness = [[23.25, 3.9], [3.9, 7.75]]
[[contacts]]
tangent = [1, 0]
normal = [0, 1]
stiffness = 11.0
preload = 5.0
law = { name = "Coulomb", kinetic = 0.6 }
[drive]
name = "Belt"
speed = 0.8
[start]
x1 = 0.3
v1 = 0
[run]
duration = 25
"""
FIGURES = {"whole-run", "motion", "friction-displacement", "friction-velocity", "phase-portrait"}


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("slider.toml").write_text(SLIDER)


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["simulate", *arguments])


def told(*arguments: str) -> dict[str, Any]:
    result = run(*arguments, "--json")
    assert result.exit_code == 0, result.output
    data: dict[str, Any] = json.loads(result.stdout)
    return data


def quantities(found: dict[str, Any]) -> dict[str, float]:
    return {quantity["name"]: quantity["value"] for quantity in found["quantities"]}


def test_a_scenario_is_shown_with_its_known_answers() -> None:
    result = run("FD-4", "--all")
    assert result.exit_code == 0, result.output
    assert "comes to rest after 3.142 s, at a displacement of 250 mm" in result.stdout
    assert "3.14159265  stick" in result.stdout
    assert result.stdout.rstrip().endswith("Report: FD-4-stickslip/report.html")
    for answer in told("FD-4")["known_answers"].values():
        assert answer["found"] == pytest.approx(answer["known"], rel=1e-12)


@pytest.mark.figures
def test_a_file_gives_a_folder_that_holds_the_motion() -> None:
    result = run("slider.toml")
    assert result.exit_code == 0, result.output
    folder = Path("slider-stickslip")
    held = {"report.html", "results.json", "events.csv", "record.csv", "record.csv.json", "figures"}
    assert {path.name for path in folder.iterdir()} == held
    assert {path.stem for path in (folder / "figures").iterdir()} == FIGURES
    record = ss.read_record(folder / "record.csv")
    motion = ss.simulate(ss.systems.read_system("slider.toml").system, cycles=30)
    assert record.equals(motion.record(fs=1000))
    events = np.genfromtxt(folder / "events.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    known = [(*event[:4], event.contact + 1) for event in motion.events]
    assert [tuple(event) for event in events] == known, "to the last bit; contacts are counted from 1"
    assert run("slider.toml").exit_code == 0, "its own results are replaced"


def test_the_loops_of_the_written_record_give_the_friction_back() -> None:
    run("slider.toml", "--format", "parquet")
    record = ss.read_record("slider-stickslip/record.parquet")
    assert ss.friction_loops(record, frequency=2.5).level.value == pytest.approx(1.1, rel=1e-3)


@pytest.mark.parametrize("form", ["csv", "h5", "parquet"])
def test_every_format_holds_the_same_record(form: str) -> None:
    assert f".{form}" in WRITERS
    assert run("slider.toml", "--format", form, "--output", "out", "--cycles", "2").exit_code == 0
    record = ss.read_record(f"out/record.{form}")
    assert record.equals(ss.simulate(ss.systems.read_system("slider.toml").system, cycles=2).record(fs=1000))


def test_the_json_is_the_folder_s_and_alone_writes_nothing() -> None:
    found = told("slider.toml")
    assert {path.name for path in Path().iterdir()} == {"slider.toml"}
    run("slider.toml")
    kept = json.loads(Path("slider-stickslip/results.json").read_text())
    assert {key: kept[key] for key in found} == found
    assert (found["system"]["mass"], found["law"]["name"]) == (2.42, "Coulomb")
    assert found["drive"]["amplitude"] == pytest.approx(0.65e-3, rel=1e-15)


def test_work_and_shares_are_those_of_the_exact_motion() -> None:
    found = quantities(told("DH-3 b=0.25 r=0.9", "--cycles", "100"))
    orbit = ss.steady_state(ss.systems.scenario_case("DH-3 b=0.25 r=0.9").system)
    assert found["displacement, to"] == pytest.approx(orbit.amplitude, rel=1e-9)
    stuck = sum(piece.duration for piece in orbit.orbit.pieces if piece.mode == "stuck") / orbit.period
    assert found["share of time in stick"] == pytest.approx(stuck, abs=0.01)
    assert found["energy unaccounted for, relative"] < 1e-12
    decay = quantities(told("FD-4"))
    assert decay["work against friction"] == pytest.approx(3.0, rel=1e-12), "1 N along 2 m and 1 m"


@pytest.mark.figures
def test_several_masses_are_told_shown_and_written() -> None:
    Path("squeal.toml").write_text(SQUEAL)
    result = run("squeal.toml", "--all")
    assert result.exit_code == 0, result.output
    for words in ("x1 between", "and x2 between", "13 × flight", "share of time in flight", "normal load, to"):
        assert words in result.stdout.replace("\n", " ")
    shown = {path.stem for path in Path("squeal-stickslip/figures").iterdir()}
    assert shown == FIGURES - {"phase-portrait"} | {"friction-load", "phase-portrait-x1", "phase-portrait-x2"}
    found = told("squeal.toml")
    assert found["contacts"][0]["law"] == {"name": "Coulomb", "kinetic": 0.6, "static": None}
    assert (found["system"]["mass"], found["drive"]["speed"]) == ([[1.0, 0.0], [0.0, 1.0]], 0.8)
    numbers = quantities(found)
    assert numbers["normal load, from"] == 0
    motion = ss.simulate(ss.systems.read_system("squeal.toml").system, duration=25, start={"x1": 0.3, "v1": 0.0})
    flown = sum(piece.duration for piece in motion.pieces if piece.mode == "lifted") / 25
    assert numbers["share of time in flight"] == pytest.approx(flown, rel=1e-12)
    assert numbers["energy unaccounted for, relative"] < 1e-12
    other = told("squeal.toml", "--set", "contacts.1.law.kinetic=0.1", "--set", "preload=6 N")
    assert (other["contacts"][0]["law"]["kinetic"], other["contacts"][0]["preload"]) == (0.1, 6.0)


def test_options_change_the_run() -> None:
    found = told("slider.toml", "--set", "kinetic=2 N", "--set", "mass=3", "--duration", "500 ms")
    assert (found["law"]["kinetic"], found["system"]["mass"], found["run"]) == (2.0, 3.0, {"duration": 0.5})
    assert run("slider.toml", "--fs", "2 kHz", "--cycles", "1").exit_code == 0
    assert ss.read_record("slider-stickslip/record.csv").fs == 2000


def test_a_run_shorter_than_a_cycle_counts_the_part_that_it_is() -> None:
    assert quantities(told("slider.toml", "--cycles", "0.25"))["cycles"] == pytest.approx(0.25)


def test_without_a_name_the_scenarios_are_listed() -> None:
    short = run()
    assert len(short.stdout.splitlines()) <= 40
    result = run("--all")
    assert result.exit_code == 0
    assert all(f'"{name}"' in result.stdout for name in ss.scenarios.names())
    assert "thesis, figures 3.16 and 3.19" in result.stdout
    assert "known: status, amplitude" in result.stdout
    assert max(len(line) for line in result.stdout.splitlines()) <= 120
    assert run("--list").stdout == short.stdout
    assert list(told()) == list(ss.scenarios.names())


def test_the_moving_picture_shows_what_the_contact_does() -> None:
    result = run("slider.toml", "--animate", "gif")
    assert result.exit_code == 0, result.output
    with Image.open("slider-stickslip/animation.gif") as picture:
        assert picture.n_frames == 150
        colours = set()
        for frame in range(0, 150, 5):
            picture.seek(frame)
            shown = np.asarray(picture.convert("RGB"))[30:150]
            colours |= {
                name
                for name, colour in {"slip": (213, 94, 0), "stick": (0, 114, 178)}.items()
                if (np.abs(shown - np.array(colour)).max(axis=2) < 12).sum() > 1000
            }
    assert colours == {"slip", "stick"}


def test_the_squeak_rig_is_heard_and_its_sensors_are_read_again() -> None:
    result = run("SQUEAK wet 6.13 N", "--sound", "--output", "rig", "--fs", "10 kHz")
    assert result.exit_code == 0, result.output
    heard, sensors = ss.read_record("rig/sound.wav"), ss.read_record("rig/sensors.csv")
    assert (heard.fs, len(heard)) == (sensors.fs, len(sensors)) == (10_000, 10_001)
    scale = np.max(np.abs(sensors["sound"])) / np.max(np.abs(heard[next(iter(heard))]))
    assert np.allclose(heard[next(iter(heard))] * scale, sensors["sound"], atol=1e-4 * np.ptp(sensors["sound"]))
    assert ss.find_squeaks(sensors).of("squeak")


def test_any_mass_is_heard_by_its_acceleration() -> None:
    assert run("slider.toml", "--sound", "--output", "slider", "--cycles", "1").exit_code == 0
    assert ss.read_record("slider/sound.wav").fs >= 8000
    assert not Path("slider/sensors.csv").exists()


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_an_mp4_is_written_by_ffmpeg() -> None:
    assert run("FD-4", "--animate", "mp4").exit_code == 0
    assert Path("FD-4-stickslip/animation.mp4").read_bytes()[4:8] == b"ftyp"


def test_an_mp4_without_ffmpeg_is_refused_and_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    result = run("FD-4", "--animate", "mp4")
    assert (result.exit_code, "ffmpeg is not installed" in result.stderr) == (2, True)
    assert {path.name for path in Path().iterdir()} == {"slider.toml"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["FD"], "perhaps FD-"),
        (["fd-4"], "perhaps FD-4 is meant"),
        (["none like it"], "--list' names the scenarios"),
        (["absent.toml"], "can not be read"),
        (["FD-4", "--cycles", "0"], "--cycles"),
        (["FD-4", "--cycles", "1", "--duration", "1"], "one of the two"),
        (["FD-4", "--duration", "1 m"], "measured in s"),
        (["FD-4", "--set", "kinetik=1"], "perhaps kinetic is meant"),
        (["FD-4", "--set", "mass=-1"], "mass"),
        (["FD-4", "--set", "mass"], "NAME=VALUE"),
        (["FD-4", "--fs", "1e12"], "at most 1e+08 rows"),
        (["FD-4", "--format", "xls"], "--format"),
    ],
)
def test_wrong_use_is_one_sentence_and_leaves_nothing(arguments: list[str], words: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("stickslip: ")
    assert len(result.stderr.splitlines()) == 1
    assert words in result.stderr
    assert {path.name for path in Path().iterdir()} == {"slider.toml"}


def test_a_run_that_can_not_be_trusted_ends_with_1(monkeypatch: pytest.MonkeyPatch) -> None:
    def trembling(*_: object, **__: object) -> None:
        raise ss.errors.SolveError("too many events", "a period has at most 10000", "check the law")

    monkeypatch.setattr(simulation, "simulate", trembling)
    result = run("FD-4")
    assert (result.exit_code, result.stderr) == (
        1,
        "stickslip: too many events; a period has at most 10000; check the law.\n",
    )


@pytest.mark.figures
def test_an_error_while_writing_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(folder_module, "write_figures", full)
    result = run("slider.toml")
    assert result.exit_code == 1
    assert "No space left on device" in result.stderr
    assert {path.name for path in Path().iterdir()} == {"slider.toml"}


def test_a_folder_of_someone_else_is_left_alone() -> None:
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("x")
    result = run("FD-4", "--output", "mine")
    assert result.exit_code == 2
    assert "thesis.tex" in result.stderr
    assert [path.name for path in Path("mine").iterdir()] == ["thesis.tex"]


def test_an_interrupted_run_keeps_what_was_done_marked_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    whole = simulation.simulate

    def interrupted(*arguments: Any, **options: Any) -> ss.solve.Trajectory:
        return replace(whole(*arguments, **options), status="interrupted")

    monkeypatch.setattr(simulation, "simulate", interrupted)
    result = run("slider.toml")
    assert result.exit_code == 130
    assert "Interrupted" in result.stdout
    assert json.loads(Path("slider-stickslip/results.json").read_text())["status"] == "interrupted"


def test_the_program_starts_and_simulates_as_a_process() -> None:
    program = [sys.executable, "-m", "stickslip", "simulate", "slider.toml", "--json"]
    result = subprocess.run(program, capture_output=True, text=True, env=os.environ, check=False)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["status"] == "complete"
    assert result.stderr == ""


@pytest.mark.parametrize(
    ("cycles", "words"),
    [(20, "In the last 4 cycles the mass sticks twice a cycle, 26 %"), (0.5, "The mass sticks once in 200 ms, ")],
)
def test_the_headline_says_of_which_time_it_is(cycles: float, words: str) -> None:
    drive = ss.drives.HarmonicBase(6.5e-4, frequency=2.5)
    run = ss.simulate(ss.Oscillator(2.42, 2310, ss.laws.Coulomb(1.1), drive), cycles=cycles)
    assert simulation.holding(run).startswith(words)
