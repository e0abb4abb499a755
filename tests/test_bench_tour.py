"""What to measure next, run lists, and the whole experiment on the simulated bench."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip import bench
from stickslip.bench import through
from stickslip.cli.program import main
from stickslip.story.bench import _stuck_runs

SLIDER = ss.Oscillator(mass=2.42, stiffness=2310, damping=0.12, law=ss.laws.Coulomb(1.1))
SOFT = replace(SLIDER, law=ss.laws.CompliantContact(1.1, stiffness=60e3, damping=10.0))
LAWS = {"rigid": SLIDER, "compliant": SOFT}


@pytest.fixture(scope="module")
def found() -> tuple[bench.Proposal, ...]:
    return bench.next_runs(LAWS, shaker=ss.rig.Shaker(highest=9.0, force=5.0, moving_mass=1.0), done=[(5.4, 1.9e-3)])


def test_proposals_are_within_the_shaker_apart_and_new(found: tuple[bench.Proposal, ...]) -> None:
    shaker = ss.rig.Shaker(highest=9.0, force=5.0, moving_mass=1.0)
    assert len(found) == 3
    for each in found:
        shaker.require(each.frequency, each.amplitude * 0.999)
        assert abs(each.frequency / 5.4 - 1) > 0.1 or abs(each.amplitude / 1.9e-3 - 1) > 0.1
    assert found[0].separation >= found[1].separation >= found[2].separation


def test_the_best_run_tells_the_laws_apart_where_a_small_one_does_not(
    found: tuple[bench.Proposal, ...],
) -> None:
    """The difference is looked at as it is, on a motion simulated here: no parameter is fitted anew."""

    def apart(frequency: float, amplitude: float) -> float:
        drive = ss.drives.HarmonicBase(amplitude, frequency=frequency)
        runs = [ss.simulate(replace(each, drive=drive), cycles=30) for each in LAWS.values()]
        times = np.linspace(25, 29, 400) / frequency
        one, other = (run.sample(times, ("x",))[0][0] for run in runs)
        return float(np.std(one - other))

    assert apart(found[0].frequency, found[0].amplitude) >= found[0].separation * 1e-6 * 0.9
    assert found[0].separation > 10 * apart(2.0, 0.1e-3) / 1e-6 or apart(2.0, 0.1e-3) < 1e-5


def test_what_can_not_be_chosen_is_refused() -> None:
    with pytest.raises(ss.errors.EstimateError, match="two laws"):
        bench.next_runs({"rigid": SLIDER})
    with pytest.raises(ss.errors.EstimateError, match="shaker from 40"):
        bench.next_runs(LAWS, shaker=ss.rig.Shaker(lowest=40.0, highest=50.0))


def test_a_static_friction_that_a_fit_leaves_at_the_kinetic_is_told_apart_too() -> None:
    """More kinetic than static friction is refused: every motion was left out, and the shaker blamed."""
    alike = replace(SLIDER, law=ss.laws.Coulomb(1.1, static=1.1 * (1 + 1e-13)))
    assert bench.next_runs({**LAWS, "static": alike}, count=1)[0].separation >= 0.0


def test_a_run_list_is_read_back_and_acquired(tmp_path: Path) -> None:
    runs = bench.RunList(
        run=(
            bench.Run(name="slow", frequency=2.5, amplitude=0.65e-3, seconds=0.5),
            bench.Run(name="fast", frequency=8.7, amplitude=1e-3, seconds=0.5, why="sliding"),
        )
    )
    path = tmp_path / "runs.toml"
    path.write_text(runs.toml(), "utf-8")
    assert bench.read_runs(path) == runs
    config = tmp_path / "rig.toml"
    config.write_text('[devices.desk]\nkind = "sim"\nfast = true\nfs = 1000\n[log]\nsurface = "steel"\n', "utf-8")
    asked = ["acquire", "--device", "desk", "--config", config, "--runs", path, "--output", tmp_path / "records"]
    result = CliRunner().invoke(main, [str(each) for each in asked])
    assert result.exit_code == 0, result.output
    record = ss.read_record(tmp_path / "records" / "fast.h5")
    assert record.log == ss.record.Log(surface="steel")
    assert record.duration == pytest.approx(0.5)
    path.write_text('[[run]]\nname = "x y"\nfrequency = 2.5\namplitude = 1e-3\n', "utf-8")
    with pytest.raises(ss.errors.ModelError, match="x y"):
        bench.read_runs(path)


def test_an_amplitude_has_its_own_unit_and_a_wrong_one_names_its_line(tmp_path: Path) -> None:
    path, run = tmp_path / "runs.toml", '[[run]]\nname = "{}"\nfrequency = "2.5 Hz"\namplitude = {}\non = "{}"\n'
    path.write_text(run.format("a", '"1.5 mm"', "base") + run.format("b", '"20 mN"', "force"), "utf-8")
    assert [each.amplitude for each in bench.read_runs(path).run] == pytest.approx([1.5e-3, 0.02])
    path.write_text(run.format("a", 1e-3, "base") + run.format("b", '"1.5 mm"', "force"), "utf-8")
    with pytest.raises(ss.errors.ModelError, match=r"runs.toml, line 9,.*1.5 mm"):
        bench.read_runs(path)


def test_a_run_list_is_refused_whole_before_its_first_run(tmp_path: Path) -> None:
    path, config, records = tmp_path / "runs.toml", tmp_path / "rig.toml", tmp_path / "records"
    config.write_text('[shaker]\nstroke = "1 mm"\n[devices.desk]\nkind = "sim"\nfast = true\nfs = 1000\n', "utf-8")
    asked = ["acquire", "--device", "desk", "--config", str(config), "--output", str(records)]
    run = '[[run]]\nname = "{}"\nfrequency = 2.5\namplitude = {}\nseconds = 0.1\n'
    path.write_text(run.format("small", 5e-4) + run.format("large", 2e-3), "utf-8")
    for more in (["--runs", str(path)], ["--drive", "base=2e-3@2.5", "--seconds", "0.1"]):
        result = CliRunner().invoke(main, [*asked, *more])
        assert result.exit_code == 2
        assert "stroke allows 1 mm" in result.output
        assert not records.exists()
    assert CliRunner().invoke(main, [*asked, "--runs", str(path), "--seconds", "3"]).exit_code == 2
    path.write_text(2 * run.format("small", 5e-4), "utf-8")
    with pytest.raises(ss.errors.ModelError, match="two runs are called small"):
        bench.read_runs(path)


def test_a_plan_refuses_what_the_shaker_can_not_move() -> None:
    run = ss.simulate(replace(SLIDER, drive=ss.drives.HarmonicBase(9e-3, frequency=2.5)), cycles=2)
    with pytest.raises(ss.errors.ModelError, match="stroke allows 8 mm"):
        ss.answers.plan_experiment(run, shaker=ss.rig.Shaker(), draws=1)


def test_the_command_proposes_runs_for_two_systems(tmp_path: Path) -> None:
    soft = "name = 'CompliantContact'\nkinetic = 1.1\nstiffness = 60000\ndamping = 10"
    for name, law in (("rigid", "name = 'Coulomb'\nkinetic = 1.1"), ("soft", soft)):
        (tmp_path / f"{name}.toml").write_text(f"[law]\n{law}\n", "utf-8")
    (tmp_path / "rig.toml").write_text("mass = 2.42\nstiffness = 2310\n[shaker]\nstroke = '1 mm'\nhighest = '3 Hz'\n")
    asked = [
        tmp_path / "rigid.toml",
        tmp_path / "soft.toml",
        "--config",
        tmp_path / "rig.toml",
        "--count",
        "1",
        "--json",
    ]
    result = CliRunner().invoke(main, ["bench", "next", *map(str, asked)])
    assert result.exit_code == 0, result.output
    (run,) = json.loads(result.output)["runs"]
    assert run["frequency"] <= 3.0
    assert run["amplitude"] <= 1e-3


def test_a_short_tour_reports_what_it_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every part of the tour once, with as little as answers: two seconds of two runs."""
    little = {
        "RUNS": (through.RUNS[0], through.RUNS[2]), "SECONDS": 2.0, "SETTLE": 1.0, "OF_LAWS": 0.9, "FS": 1000.0,
        "LAWS": ("Coulomb", "compliant"), "OF": (0,),
    }  # fmt: skip
    for name, value in little.items():
        monkeypatch.setattr(through, name, value)
    left_out = ("added", "sweep", "discharge")
    monkeypatch.setattr(through, "STEPS", [step for step in bench.STEPS if step.name not in left_out])
    tour = bench.tour(tmp_path / "tour", fast=True)
    assert tour.laws.law == "compliant"
    assert tour.commissioned.known.require_constants().mass.includes(2.42)
    story = ss.summary(tour)
    assert story.headline[0].startswith("The friction is that of a compliant contact: it slides at 1.")
    assert [part.title for part in story.parts][:2] == ["The rig", "The base at 2.5 Hz"]
    assert story.lines[0].true == "2.4200 kg" or story.lines[0].true is not None
    assert (tmp_path / "tour" / "next.toml").exists()
    assert json.dumps(story.data())


def test_a_contact_that_only_turns_round_is_not_said_to_stick() -> None:
    """It holds for 4 % of the time, and stops at no time: both were told side by side, as sticking."""
    findings, runs = [], through.RUNS[:2]
    for run in runs:
        moved = replace(
            through.thesis_oscillator(), drive=ss.drives.HarmonicBase(run.amplitude, frequency=run.frequency)
        )
        record = ss.Rig().measure(ss.simulate(moved, cycles=40), fs=4000, rng=1).between(2.0, 5.0)
        findings.append(ss.analyze(record, mass=2.42, stiffness=2310, damping=moved.damping))
    sticks = findings[1].sticks
    assert sticks is not None
    assert sticks.share.value == pytest.approx(0.0397, abs=3e-3)
    assert (sticks.per_cycle.value, sticks.kind) == (0.0, "sliding")
    assert any("at a mere reversal" in check for check in sticks.per_cycle.checks)
    told = _stuck_runs(SimpleNamespace(comparison=SimpleNamespace(findings=findings), runs=runs))  # type: ignore[arg-type]
    first, second = told.split("; ")
    assert first.startswith("At 2.5 Hz it s")
    assert "with 2 stops in each cycle" in first
    assert second.startswith("at 5.61 Hz it rests only briefly as it turns round, ")
