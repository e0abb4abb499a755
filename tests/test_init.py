"""stickslip init: what it recognises, what it asks, and that the other commands need no option afterwards."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip.cli.program import main

TIME = np.arange(2000) / 500
X, FRICTION = 10 * np.sin(2 * np.pi * TIME), 1.5 * np.sign(np.cos(2 * np.pi * TIME))


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")


def written(header: str, name: str = "versuch.csv") -> None:
    """A German instrument's file: a title, semicolons, decimal commas, milliseconds, names of two words."""
    force = FRICTION + 0.01 * np.random.default_rng(1).standard_normal(TIME.size)
    rows = [";".join(f"{v:.6f}".replace(".", ",") for v in row) for row in zip(1e3 * TIME, X, force, strict=True)]
    Path(name).write_text("\n".join(["Messung 17;;", header, *rows]) + "\n", encoding="latin-1")


def test_without_a_question_all_is_recognised_and_analyze_needs_no_option() -> None:
    written("Zeit (ms);Weg Schlitten (mm);Reibkraft (N)")
    result = CliRunner().invoke(main, ["init", "versuch.csv", "--yes", "--mass", "2.0 ± 0.1 kg"])
    assert result.exit_code == 0, result.output
    assert "2000 samples at 500 Hz" in result.stdout
    assert re.search(r"Weg Schlitten.* mm .*x, displacement", result.stdout)
    assert "Next: stickslip analyze versuch.csv" in result.stdout
    rig = ss.rig.read_rig("rig.toml")
    assert rig.channels == {"x": "`Weg Schlitten` [mm]", "friction": "Reibkraft [N]"}
    assert (float(rig.mass), rig.mass.sd) == (2.0, 0.1)
    told = CliRunner().invoke(main, ["analyze", "versuch.csv", "--twins", "0"])
    assert told.exit_code == 0, told.output
    assert "The contact slides against 1.5" in told.stdout
    assert told.stderr.startswith("stickslip: columns and constants by rig.toml")


def test_a_sound_beside_it_has_channels_of_its_own() -> None:
    """Of a file that holds nothing but sound the columns of the rig's records were asked for."""
    Path("rig.toml").write_text('mass = "2 kg"\n[channels]\nx = "`Weg Schlitten` [mm]"\n')
    noise = 0.1 * np.random.default_rng(1).standard_normal(20000)
    ss.squeak.write_sound(ss.Record.of({"sound": noise}, units={"sound": "FS"}, fs=20000.0), "noise.wav")
    told = CliRunner().invoke(main, ["check", "noise.wav"])
    assert told.exit_code == 0, told.output
    assert "sound" in told.stdout
    refused = CliRunner().invoke(main, ["check", "noise.wav", "--config", "rig.toml"])
    assert "there is no column 'Weg Schlitten'" in refused.stderr


def test_what_nobody_states_is_called_a_guess() -> None:
    written("Zeit (ms);Weg Schlitten;Reibkraft (N)")
    result = CliRunner().invoke(main, ["init", "versuch.csv", "--yes"])
    assert "! `Weg Schlitten`: the file states no unit; mm is a guess." in result.stdout
    assert tomllib.loads(Path("rig.toml").read_text())["channels"]["x"] == "`Weg Schlitten` [mm]"


def test_what_is_there_is_not_written_over() -> None:
    written("Zeit (ms);Weg Schlitten (mm);Reibkraft (N)")
    Path("rig.toml").write_text("mass = 1\n")
    result = CliRunner().invoke(main, ["init", "versuch.csv", "--yes"])
    assert result.exit_code == 2
    assert "--force writes over it" in result.stderr
    assert CliRunner().invoke(main, ["init", "versuch.csv", "--yes", "--force"]).exit_code == 0


def test_files_that_are_not_like_the_first_are_named() -> None:
    written("Zeit (ms);Weg Schlitten (mm);Reibkraft (N)")
    written("Zeit (ms);Weg (mm);Kraft (N)", "anders.csv")
    result = CliRunner().invoke(main, ["init", "versuch.csv", "anders.csv", "--yes"])
    assert result.exit_code == 0
    assert "anders.csv is not like the first" in result.stderr


def test_sensors_and_loads_that_are_stated_are_written_too() -> None:
    written("Zeit (ms);Weg Schlitten (mm);Reibkraft (N)")
    stated = ["--sensor", "x.delay=3 ms", "--sensor", "friction.mount=125 Hz, 0.1"]
    assert CliRunner().invoke(main, ["init", "versuch.csv", "--yes", *stated]).exit_code == 0
    rig = ss.rig.read_rig("rig.toml")
    assert rig.sensors["x"].delay == pytest.approx(0.003)
    assert rig.sensors["friction"].mount == (125.0, 0.1)


def test_at_a_terminal_it_asks_and_takes_what_is_typed() -> None:
    """Through a pseudo terminal, as a person types; each answer is given when its question stands there."""
    written("Zeit (ms);Kanal A (mm);Kanal B")
    answers = [
        ("`Kanal A`:", ""), ("`Kanal B`:", "friction"), ("its unit", "N"), ("Mass", "2,0 kg"), ("Mass", "2 kg"),
        ("Stiffness", "2.31 N/mm"), ("damping", ""),
    ]  # fmt: skip
    text = typed([sys.executable, "-m", "stickslip", "init", "versuch.csv"], answers)
    assert "rig.toml is written." in text, text
    data = tomllib.loads(Path("rig.toml").read_text())
    assert data == {
        "mass": "2 kg",
        "stiffness": "2.31 N/mm",
        "channels": {"x": "`Kanal A` [mm]", "friction": "`Kanal B` [N]"},
    }


def typed(command: list[str], answers: list[tuple[str, str]], patience: float = 600.0) -> str:
    """What a program prints at a terminal, where it is answered question by question."""
    master, slave = pty.openpty()
    program = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env={**os.environ, "TERM": "dumb"})
    os.close(slave)
    seen, place, end = "", 0, time.monotonic() + patience
    left = list(answers)
    while time.monotonic() < end:
        if select.select([master], [], [], 0.2)[0]:
            try:
                seen += os.read(master, 4096).decode(errors="replace")
            except OSError:  # the program has ended
                break
        elif program.poll() is not None:
            break
        if left and left[0][0] in seen[place:]:
            place = len(seen)
            os.write(master, (left.pop(0)[1] + "\n").encode())
    program.wait(600)
    os.close(master)
    assert not left, seen
    return seen
