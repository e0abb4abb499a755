"""The whole analysis on the virtual rig, from its file to the truth."""

from __future__ import annotations

import gc
import json
import weakref
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip.answers.findings import LEVELS
from stickslip.cli.program import main

TRUE = {"sliding friction": 1.1, "contact stiffness": 192000.0, "contact damping": 23.9}
KNOWN = """
mass = 2.42
stiffness = "2.31 N/mm"
damping = 0.0
[sensors.x]
delay = "1.2585 ms"
[sensors.z]
delay = "1.2585 ms"
[sensors.a]
mount = ["125 Hz", 0.1]
[sensors.load]
mount = ["250 Hz", 0.05]
inertia = "50 g"
discharge = "50 s"
"""
COLUMNS = ("x=plate [mm]", "z=base [mm]", "a=acc [g]", "load=cell [N]")


@pytest.fixture(scope="module")
def readings() -> ss.Record:
    """What the air-track rig reads of four seconds of stick-slip at 2.5 Hz."""
    contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    slider = ss.Oscillator(2.42, 2310, law=contact, drive=ss.drives.HarmonicBase(0.65e-3, frequency=2.5))
    return ss.Rig().measure(ss.simulate(slider, cycles=12), fs=4000, rng=1, start=0.8)


@pytest.fixture(scope="module")
def short(readings: ss.Record) -> ss.Record:
    """Its first four cycles: enough for what is said, and less than half of the work."""
    return readings.rows(0, 6400)


def written(readings: ss.Record, path: Path, **turned: float) -> Path:
    """Its file in the units of its instruments, some columns turned round."""
    scale = {"x": 1e3, "z": 1e3, "a": 1 / 9.80665, "load": 1.0}
    columns = [np.arange(len(readings)) / readings.fs]
    columns += [scale[name] * turned.get(name, 1.0) * readings[name] for name in scale]
    header = "t [s],plate [mm],base [mm],acc [g],cell [N]"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def told(path: Path, *arguments: str) -> dict[str, dict[str, object]]:
    """The estimates by name, and the notes, that `stickslip analyze` prints."""
    channels = [part for column in COLUMNS for part in ("--channels", column)]
    run = CliRunner().invoke(main, ["analyze", str(path), *channels, "--json", *arguments], catch_exceptions=False)
    assert run.exit_code == 0, run.output
    data = json.loads(run.stdout)
    return {each["name"]: each for each in data["estimates"]} | {"notes": {"all": " ".join(data["notes"])}}


def test_the_command_line_tells_the_truth_of_a_rig_whose_sensors_are_known(readings: ss.Record, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(KNOWN)
    found = told(written(readings, tmp_path / "run.csv"), "--config", str(tmp_path / "rig.toml"))
    for name, within in (("sliding friction", 0.0005), ("contact stiffness", 0.001), ("contact damping", 0.03)):
        assert found[name]["value"] == pytest.approx(TRUE[name], rel=within), name
        assert found[name]["status"] in ("ok", LEVELS.words), name
    low, high = found["contact stiffness"]["interval"]  # type: ignore[misc]
    assert low - 100 < TRUE["contact stiffness"] < high + 100
    assert found["stops per cycle"]["value"] == pytest.approx(2, abs=0.1)
    assert found["static over sliding friction"]["value"] == pytest.approx(1.0, abs=0.02)
    assert "by the method fusion" in str(found["notes"]["all"])


def test_what_is_not_known_of_the_sensors_is_found_or_said(readings: ss.Record, tmp_path: Path) -> None:
    found = told(written(readings, tmp_path / "run.csv"), "--mass", "2.42", "--stiffness", "2310")
    assert found["sliding friction"]["value"] == pytest.approx(1.1, rel=0.005)
    assert found["contact stiffness"]["value"] == pytest.approx(192000, rel=0.06)
    assert found["contact stiffness"]["status"] != "ok"
    low, high = found["delay of a behind x"]["interval"]  # type: ignore[misc]
    assert low < -0.0389 / 30.91 < high
    assert "come 1." in str(found["notes"]["all"])


def test_without_accelerometer_or_load_cell_it_falls_back_and_says_so(readings: ss.Record) -> None:
    record = ss.Record.of({name: readings[name] for name in "xz"}, fs=readings.fs)
    findings = ss.analyze(record, mass=2.42, stiffness=2310)
    assert findings.settings["differentiation"] == "smoother"
    assert findings.stiffness is None
    assert any("neither an accelerometer nor a load cell" in note for note in findings.notes)
    assert findings.level is not None
    assert findings.level.value == pytest.approx(1.1, rel=0.05)


@pytest.mark.parametrize(
    ("turned", "words"),
    [
        ({"a": -1.0}, "x or a has the wrong sign"),
        ({"load": -1.0}, "opposite signs"),
        ({"x": -1.0, "z": -1.0}, "wrong sign"),
        ({"z": -1.0}, "the forces differ"),
    ],
)
def test_a_sensor_with_the_wrong_sign_is_named(short: ss.Record, turned: dict[str, float], words: str) -> None:
    samples = {name: turned.get(name, 1.0) * short[name] for name in short}
    findings = ss.analyze(ss.Record.of(samples, fs=short.fs), mass=2.42, stiffness=2310, damping=0)
    assert words in " ".join(ss.summary(findings).cautions)


def test_swapped_displacements_are_named(readings: ss.Record) -> None:
    samples = {**{name: readings[name] for name in readings}, "x": readings["z"], "z": readings["x"]}
    findings = ss.analyze(ss.Record.of(samples, fs=readings.fs), mass=2.42, stiffness=2310, damping=0)
    assert "differ by more than noise" in " ".join(ss.summary(findings).cautions)
    assert findings.stiffness is None or findings.stiffness.status != "ok"


def test_a_load_cell_at_the_end_of_its_range_is_named_and_left_out(short: ss.Record) -> None:
    samples = {**{name: short[name] for name in short}, "load": np.clip(short["load"], -0.6, 0.6)}
    findings = ss.analyze(ss.Record.of(samples, fs=short.fs), mass=2.42, stiffness=2310, damping=0)
    assert findings.level is not None
    assert findings.level.value == pytest.approx(1.1, rel=0.01)
    assert any(fault.channel == "load" and fault.kind == "clipped" for fault in findings.faults)
    assert findings.comparison is not None
    assert "end of the range" in findings.comparison.status
    stated = ss.Record.of(samples, fs=short.fs).with_details("load", mount=(250.0, 0.05))
    notes = " ".join(ss.analyze(stated, mass=2.42, stiffness=2310, damping=0).notes)
    assert "which are left to the others" in notes


@pytest.mark.parametrize("turned", ["x", "z"])
def test_a_sensor_with_the_wrong_sign_is_named_without_a_load_cell_too(short: ss.Record, turned: str) -> None:
    wrong = {name: (-1.0 if name == turned else 1.0) * short[name] for name in ("x", "z", "a")}
    units = {"x": "m", "z": "m", "a": "m/s^2"}
    findings = ss.analyze(ss.Record.of(wrong, fs=short.fs, units=units), mass=2.42, stiffness=2310)
    assert findings.consistency is not None
    assert f"{turned} has the wrong sign" in findings.consistency.status
    assert findings.loops is not None
    assert f"{turned} has the wrong sign" in findings.loops.level.status
    assert f"{turned} has the wrong sign" in ss.summary(findings).headline[0]
    assert "slides against" not in " ".join(ss.summary(findings).headline)
    assert "consistency" in [plate.name for plate in ss.summary(findings).plates]


def test_a_delay_longer_than_a_cycle_is_said(readings: ss.Record) -> None:
    record = ss.Record.of({name: readings[name] for name in ("x", "z")}, fs=readings.fs)
    record = record.with_details("x", delay=1.26).with_details("z", delay=1.26)
    findings = ss.analyze(record, mass=2.42, stiffness=2310)
    assert "the delay of x and z, 1.26 s (3.15 cycles" in " ".join(ss.summary(findings).cautions)


def test_the_page_shows_what_its_numbers_say(short: ss.Record) -> None:
    record = short.with_details("x", delay=0.0389 / 30.91).with_details("z", delay=0.0389 / 30.91)
    record = record.with_details("a", mount=(125.0, 0.1)).with_details("load", mount=(250.0, 0.05), inertia=0.05)
    plates = {
        plate.name: plate for plate in ss.summary(ss.analyze(record, mass=2.42, stiffness=2310, damping=0)).plates
    }
    assert {"breakaway", "transition", "micro-slips", "force-comparison"} <= set(plates)
    assert "not their sum" in plates["force-balance"].caption


def test_a_base_that_is_not_measured_is_taken_to_be_at_rest_and_a_spring_found(short: ss.Record) -> None:
    alone = ss.Record.of({"x": short["x"], "a": short["a"]}, fs=short.fs, units={"x": "m", "a": "m/s^2"})
    assert "taken to be at rest" in " ".join(ss.analyze(alone, mass=2.42, stiffness=2310).notes)
    findings = ss.analyze(short, mass=2.42)
    assert findings.settings["stiffness"] == pytest.approx(2310, rel=0.01)
    assert "is found from how the mass slides" in " ".join(findings.notes)


def plain(readings: ss.Record, *names: str, **instead: np.ndarray) -> ss.Record:
    """Of its channels those named, with nothing stated."""
    return ss.Record.of({name: instead.get(name, readings[name]) for name in names}, fs=readings.fs)


def test_without_mass_and_spring_both_are_weighed_by_the_load_cell(readings: ss.Record) -> None:
    findings = ss.analyze(plain(readings, "x", "z", "a", "load"))
    assert findings.level is not None
    assert findings.level.value == pytest.approx(1.1, rel=0.005)
    assert findings.settings["mass"] == pytest.approx(2.42, rel=0.02)
    assert "found from what the load cell measures" in " ".join(findings.notes)


def test_without_mass_spring_and_load_cell_the_friction_per_mass_is_said(short: ss.Record) -> None:
    notes = " ".join(ss.analyze(plain(short, "x", "z", "a")).notes)
    assert "Friction per mass: 0.4" in notes
    assert "k/m = 9" in notes


@pytest.mark.parametrize("stated", [False, True])
def test_a_base_that_moves_unseen_leaves_the_load_cell_alone(readings: ss.Record, stated: bool) -> None:
    record = plain(readings, "x", "load").with_details("x", delay=0.0389 / 30.91)
    if stated:
        record = record.with_details("load", mount=(250.0, 0.05), inertia=0.05)
    findings = ss.analyze(record, mass=2.42, stiffness=2310)
    assert "another force than the load cell measures" in " ".join(findings.notes)
    assert findings.level is not None
    assert findings.level.value == pytest.approx(1.1, rel=0.001 if stated else 0.01)
    assert findings.breakaway is not None
    low, high = findings.breakaway.ratio.interval
    assert (findings.breakaway.ratio.status == "ok" and low - 0.01 < 1 < high) or not stated
    assert stated or "not stated" in findings.breakaway.ratio.status


@pytest.mark.parametrize("name", ["a", "load", "z"])
def test_a_sensor_that_does_not_change_is_left_out_aloud(short: ss.Record, name: str) -> None:
    still = plain(short, "x", "z", "a", "load", **{name: np.full(len(short), 0.001)})
    findings = ss.analyze(still, mass=2.42, stiffness=2310)
    assert findings.level is not None
    assert findings.level.value == pytest.approx(1.1, rel=0.01)
    assert f"{name} does not change" in " ".join(findings.notes)


def test_blocks_tell_what_the_whole_tells(readings: ss.Record) -> None:
    record = readings.with_details("x", delay=0.0389 / 30.91).with_details("z", delay=0.0389 / 30.91)
    record = record.with_details("a", mount=(125.0, 0.1))
    record = record.with_details("load", mount=(250.0, 0.05), inertia=0.05, discharge=50.0)
    said: list[str] = []
    rig = ss.rig.rig_settings({"mass": 2.42, "stiffness": 2310, "damping": 0})
    halves = (record.rows(first, first + len(record) // 2) for first in (0, len(record) // 2))
    blocks = ss.answers.analyze_blocks(halves, rig=rig, progress=said.append)
    assert said == ["block 1, from 0 s", f"block 2, from {len(record) // 2 / 4000:.5g} s"]
    assert blocks.level is not None
    assert blocks.level.value == pytest.approx(1.1, rel=0.0005)
    assert blocks.stiffness is not None
    assert blocks.stiffness.value == pytest.approx(192000, rel=0.002)
    assert blocks.sticks is not None
    assert blocks.sticks.events[-1].time > len(record) / 4000 * 0.75
    assert "2 blocks" in blocks.notes[0]
    assert len(blocks.record) > 0.99 * len(record) // 2  # less what the delays take


def test_blocks_that_were_asked_are_not_kept() -> None:
    alive: list[weakref.ref[np.ndarray]] = []
    kept: list[int] = []
    time = np.arange(4000) / 500

    def blocks() -> Iterator[ss.Record]:
        for seed in range(4):
            friction = np.sign(np.cos(6 * time)) + np.random.default_rng(seed).normal(0, 0.01, time.size)
            block = ss.Record.of({"x": np.sin(6 * time), "friction": friction}, fs=500)
            gc.collect()
            kept.append(sum(each() is not None for each in alive))
            alive.append(weakref.ref(block["friction"]))
            yield block

    assert ss.answers.analyze_blocks(blocks()).level is not None
    assert max(kept) <= 2  # the last one, and the one that the figures show


def test_a_block_that_answers_nothing_is_named_and_left_out(short: ss.Record) -> None:
    still = ss.Record.of({name: np.zeros(4000) for name in ("x", "friction")}, fs=4000)
    time = np.arange(8000) / 4000
    moving = ss.Record.of(
        {"x": np.sin(20 * time), "friction": np.sign(np.cos(20 * time)) + 0.01 * np.sin(7919.0 * time)}, fs=4000
    )
    blocks = ss.answers.analyze_blocks([moving, still])
    assert any("Block 2" in note and "answers nothing" in note for note in blocks.notes)
    with pytest.raises(ss.errors.EstimateError, match="none of 1 blocks"):
        ss.answers.analyze_blocks([still])
