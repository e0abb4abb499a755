"""Commands for what Python does: stability, bifurcation, dither, impact, rig join."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.program import main

SLIDER = """
[system]
mass = 1.0
stiffness = 1.0
damping = 0.02

[law]
name = "Coulomb"
kinetic = 1.0
static = 1.5

[drive]
name = "Belt"
speed = 0.5
"""


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")


def ask(*words: str) -> Result:
    result = CliRunner().invoke(main, list(words))
    assert result.exit_code == 0, result.output
    assert len(result.stdout.splitlines()) <= 40 or "--json" in words
    return result


def test_stability_names_what_feeds_the_vibration() -> None:
    data = json.loads(ask("stability", "MC-2 eta=0.02,0.06", "--json").stdout)
    scenario = ss.scenarios.get("MC-2 eta=0.02,0.06")
    stability = ss.stability(scenario.system)
    assert (data["stable"], data["mechanism"]) == (stability.stable, stability.mechanism)
    assert data["growth"] == pytest.approx(stability.growth)
    text = ask("stability", "MC-2 eta=0.02,0.06", "--output", "out").stdout
    assert "Steady sliding is at the border of stability" in text, "the scenario has its critical friction"
    less = ask("stability", "MC-2 eta=0.02,0.06", "--set", "contacts.1.law.kinetic=0.2", "--output", "less").stdout
    assert "Steady sliding is stable" in less
    assert Path("out/report.html").is_file()


@pytest.mark.figures
@pytest.mark.parametrize("case", ["DH-1 b=0.6", pytest.param("DH-3 b=0.5 r=0.8", marks=pytest.mark.soak)])
def test_a_bifurcation_has_its_changes_where_python_has_them(case: str) -> None:
    """Between two periodic motions; the longer way goes through one that is not periodic."""
    words = ("bifurcation", case, "law.kinetic", "--from", "200 mN", "--to", "0.8", "--steps", "4")
    text = ask(*words, "--output", "out").stdout
    data = json.loads(Path("out/results.json").read_text("utf-8"))
    diagram = ss.bifurcation(ss.scenarios.get(case).system, "law.kinetic", values=np.linspace(0.2, 0.8, 4))
    assert diagram.changes
    assert [each["value"] for each in data["changes"]] == pytest.approx([change.value for change in diagram.changes])
    assert "the motion changes its kind" in text
    assert "no stops" in text
    assert Path("out/figures/bifurcation.svg").is_file()


def test_dither_gives_the_smallest_amplitude() -> None:
    Path("slider.toml").write_text(SLIDER)
    data = json.loads(ask("dither", "slider.toml", "--frequency", "5", "--json").stdout)
    assert data["amplitude"]["value"] == pytest.approx(0.000391, rel=0.05)  # as ss.dither's own example
    assert data["sticks"][1] < 1 / 5


def test_a_tap_tells_whose_resonance_each_is() -> None:
    time = np.arange(4000) / 4000 - 0.2

    def ring(frequency: float, damping: float) -> np.ndarray:
        w = 2 * np.pi * frequency
        return np.where(time > 0, np.exp(-damping * w * time) * np.sin(w * np.sqrt(1 - damping**2) * time), 0.0)

    noise = np.random.default_rng(1).standard_normal((2, time.size))
    a = ring(47.0, 0.02) + 0.5 * ring(125.0, 0.1) + 1e-3 * noise[0]
    load = -2.42 * ring(47.0, 0.02) + 0.2 * ring(250.0, 0.05) + 1e-3 * noise[1]
    ss.write_record(ss.Record.of({"a": a, "load": load}, fs=4000), "tap.csv")
    text = " ".join(ask("impact", "tap.csv", "--mass", "2.42 kg").stdout.split())
    assert "3 resonances ring after the tap: coupled contact at 47.0" in text
    assert "mount of the accelerometer at 12" in text
    data = json.loads(ask("impact", "tap.csv", "--mass", "2.42", "--json").stdout)
    assert data["resonances"][0]["name"] == "coupled contact"


@pytest.mark.parametrize("stated", [(), ("--offset", "-100 ms")])
def test_two_recorders_are_joined(stated: tuple[str, ...]) -> None:
    time = np.arange(4000) / 1000
    late = time + 0.1  # the second recorder began so much later

    def rows(name: str, header: str, *columns: np.ndarray) -> None:
        np.savetxt(name, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g")

    rows("daq.csv", "t [s],pos [mm]", time, 1e3 * (np.sin(9 * time) + np.sin(23 * time)))
    rows("logger.csv", "t [s],speed [m/s]", time, 9 * np.cos(9 * late) + 23 * np.cos(23 * late))
    ask(
        "rig",
        "join",
        "daq.csv",
        "logger.csv",
        "--first-channels",
        "x=pos [mm]",
        "--second-channels",
        "v=speed [m/s]",
        "--output",
        "out",
        *(("--offset", "100 ms") if stated else ()),
    )
    joined = ss.read_record("out/record.csv")
    inner = slice(200, -200)
    expected = 9 * np.cos(9 * joined.time) + 23 * np.cos(23 * joined.time)
    assert joined["v"][inner] == pytest.approx(expected[inner], abs=0.05)


def test_rig_alone_measures_as_before() -> None:
    result = CliRunner().invoke(main, ["rig", "--help"])
    assert "Measure a simulated motion" in result.output
    result = CliRunner().invoke(main, ["rig", "no such scenario"])
    assert result.exit_code == 2
