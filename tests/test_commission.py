"""The whole of commissioning: a rig.toml that analyze reads, a walk that goes on where it ended, steps on files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip import bench
from stickslip.cli.program import main
from stickslip.figures.traces import plot_calibrations

RIG = ss.Rig().having("x", gain=1.02, offset=3e-5).having("load", gain=0.97, offset=0.02)
BENCH = bench.SimulatedBench(rig=RIG, fs=1000, seed=4)


def some(*names: str) -> list[bench.BenchStep]:
    return [bench.step_named(name) for name in names]


@pytest.fixture(scope="module")
def done() -> bench.Commissioned:
    return bench.commission(BENCH.step, steps=some("rest", "gauge-x", "weigh", "spring", "free"), truth=BENCH.truth)


def run(*arguments: str | Path) -> str:
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result.output


def test_constants_are_found_in_spite_of_gains_and_zeros(done: bench.Commissioned) -> None:
    constants = done.known.require_constants()
    assert constants.mass.includes(2.42)
    assert constants.stiffness.includes(2310)
    assert constants.stiffness.sd < 5  # an uncorrected gain would be 2 %, 46 N/m
    assert not done.refused


def test_rig_toml_is_read_back_and_sets_records_right(done: bench.Commissioned, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(done.known.toml(), "utf-8")
    rig = ss.rig.read_rig(tmp_path / "rig.toml")
    assert isinstance(rig.mass, ss.Estimate)
    assert rig.mass.includes(2.42)
    weighed = RIG.read({"friction": lambda t: np.where(t < 1, 0.0, 5.0)}, duration=2, fs=1000, rng=9)
    written = ss.write_record(weighed, tmp_path / "weighed.csv")
    right = ss.read_record(written, channels=rig.channels)
    assert np.mean(right["load"][:900]) == pytest.approx(0.0, abs=2e-3)
    assert np.mean(right["load"][1200:1300]) == pytest.approx(5.0, rel=0.01)
    assert 0 < right.channels["load"].gain_sd < 0.01
    assert rig.sensors["x"].noise == pytest.approx(1e-6, rel=0.05)


def test_what_was_stated_before_stays_in_the_file() -> None:
    rig = ss.rig.rig_settings({"contact": "base", "log": {"surface": "steel"}, "channels": {"load": "F [mN]"}})
    known = bench.commission(BENCH.step, rig=rig, steps=some("rest", "weigh")).known
    told = ss.rig.rig_settings(known.settings())
    assert (told.contact, told.log) == ("base", rig.log)
    assert told.channels["load"].startswith("(F - ")  # the zero in mN, as the column is
    assert abs(float(told.channels["load"].split()[2].rstrip(")")) - 20.0) < 1.0


def test_a_contact_that_does_not_give_way_refuses_two_steps_only() -> None:
    rigid = bench.SimulatedBench(
        ss.Oscillator(mass=2.42, stiffness=2310, damping=1.0, law=ss.laws.Coulomb(1.0)), fs=500
    )
    walked = bench.commission(rigid.step, steps=some("rest", "tap", "stick"))
    assert set(walked.refused) == {"tap", "stick"}
    assert "rest" in walked.results


def test_a_tap_that_is_not_to_be_trusted_is_said_to_be_and_writes_no_mount() -> None:
    """A slip of 20 ms after it, which is no decaying oscillation."""
    tap = bench.SimulatedBench(fs=4000).record("tap")
    slips = tap.with_channel("a", tap["a"] + np.where(abs(tap.time - 0.14) < 0.01, 1.5, 0.0), unit="m/s^2")
    sound, doubted = (bench.commission(lambda step, one=one: one, steps=some("tap")) for one in (tap, slips))
    assert sound.known.mounts.keys() == {"a", "load"}
    assert doubted.known.mounts == {}
    assert "mount" not in doubted.known.toml()
    story = ss.summary(doubted)
    assert [caution.reason for caution in story.notices] == [doubted.results["tap"].status]
    assert all(story.marks(line) == "1" for line in story.lines)
    assert "not to be trusted: frequency" in story.tables[0].rows[0][2]
    assert not ss.summary(sound).notices


def test_a_record_without_a_tap_is_refused_by_the_command(tmp_path: Path) -> None:
    file = ss.write_record(BENCH.record("sweep"), tmp_path / "sweep.csv")
    told = CliRunner().invoke(main, ["commission", f"tap={file}"])
    text = " ".join(told.output.split())
    assert told.exit_code == 1
    assert "0 steps answered, 1 refused" in text
    assert "Which mounts ring? a moves before it rings, by" in text
    assert "Hz" not in text


def test_a_file_answers_its_step_without_the_rigs_other_channels(tmp_path: Path) -> None:
    """A commissioned rig names x, z, a and load; a hammer's file may hold a alone."""
    tap = BENCH.record("tap")
    file = ss.write_record(ss.Record.of({"a": tap["a"]}, fs=tap.fs), tmp_path / "tap.csv")
    rig = tmp_path / "rig.toml"
    rig.write_text('[channels]\nx = "x [m]"\nz = "z [m]"\na = "a [m/s^2]"\nload = "load [N]"\n')
    assert "1 step answered." in run("commission", f"tap={file}", "--config", rig)
    refused = CliRunner().invoke(main, ["commission", f"free={file}", "--config", str(rig)])
    assert refused.exit_code == 2
    assert "there is no column 'x'" in refused.output


def test_the_story_says_the_constants_first_and_the_truth_beside(done: bench.Commissioned) -> None:
    story = ss.summary(done)
    assert story.headline[0].startswith("The rig is a mass of 2.4")
    assert story.lines[0].true is not None
    assert next(table.title for table in story.tables) == "What was done"
    assert {plate.name for plate in story.plates} == {"calibration"}
    assert story.settings["sensors.a.noise"] == f"{done.known.settings()['sensors']['a']['noise']}"
    assert not any("{" in value for value in story.settings.values())


@pytest.mark.figures
def test_a_sensor_without_a_zero_is_drawn_about_its_line() -> None:
    record, known = BENCH.record("weigh"), BENCH.hand.weights
    calibration = bench.calibrate(record, channel="load", reference=known, leaks=True)
    assert calibration.zero is None
    [ax] = plot_calibrations({"load": calibration}).axes
    drawn = np.abs(ax.lines[0].get_ydata())
    assert drawn.max() == pytest.approx(100 * calibration.nonlinearity.value, rel=1e-9)


@pytest.mark.figures
def test_the_command_writes_goes_on_and_answers_single_files(tmp_path: Path) -> None:
    folder, config = tmp_path / "commission", tmp_path / "devices.toml"
    config.write_text('[devices.desk]\nkind = "sim"\nfs = 1000\n', "utf-8")
    steps = ("--step", "rest", "--step", "weigh")
    told = run("commission", "--device", "desk", "--config", config, *steps, "--output", folder)
    assert "2 steps answered" in told
    assert (folder / "report" / "report.html").exists()
    assert ss.rig.read_rig(folder / "rig.toml").channels["load"]
    kept = {path: path.stat().st_mtime_ns for path in (folder / "records").iterdir()}
    told = run("commission", *steps, "--output", folder, "--json")  # without a device: what is there is enough
    assert len(json.loads(told)["steps"]) == 2
    assert kept == {path: path.stat().st_mtime_ns for path in (folder / "records").iterdir()}
    record = next(path for path in kept if path.stem == "weigh")
    alone = json.loads(run("commission", f"weigh={record}", "--json"))
    assert alone["steps"]["weigh"][0]["name"] == "gain of load"
    run("commission", "--step", "rest", "--output", folder)  # one step more leaves the others' answers in rig.toml
    assert "±" in ss.rig.read_rig(folder / "rig.toml").channels["load"]


def test_a_rig_file_names_its_devices_files_from_its_own_folder(tmp_path: Path) -> None:
    config, folder = tmp_path / "lab" / "devices.toml", tmp_path / "out"
    config.parent.mkdir()
    system = '[system]\nmass = 2.0\nstiffness = 2000\n[law]\nname = "Coulomb"\nkinetic = 1.0\n'
    (config.parent / "slider.toml").write_text(system, "utf-8")
    config.write_text('[devices.desk]\nkind = "sim"\nfs = 1000\nsystem = "slider.toml"\n', "utf-8")
    run("commission", "--device", "desk", "--config", config, "--step", "rest", "--output", folder, "--json")
    again = ("commission", "--device", "desk", "--config", folder / "rig.toml", "--step", "rest", "--json")
    assert json.loads(run(*again, "--again", "rest", "--output", tmp_path / "next"))["steps"]


def test_steps_are_listed_and_unknown_ones_refused() -> None:
    assert "Tap the mass once" in run("commission", "--list", "--step", "tap").replace("\n", " ")
    for wrong in (["--step", "nap", "--device", "sim"], []):
        assert CliRunner().invoke(main, ["commission", *wrong]).exit_code == 2
