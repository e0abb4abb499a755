"""A step at the rig: what to do, what the sensors read meanwhile, and what came of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip import bench
from stickslip.bench import Block, Input, Picture
from stickslip.bench.monitor import HEIGHTS
from stickslip.bench.replay import Playing, Replay
from stickslip.cli.program import main
from stickslip.errors import INTERRUPTED


def test_a_step_at_the_rig_is_asked_recorded_and_answered_at_once(tmp_path: Path) -> None:
    ss.write_record(bench.SimulatedBench(fs=1000).record("rest"), tmp_path / "rest.csv")
    rig = tmp_path / "rig.toml"
    rig.write_text('[devices.desk]\nkind = "file"\npath = "rest.csv"\nfast = true\n', encoding="utf-8")
    arguments = ["commission", "--device", "desk", "--config", str(rig), "--step", "rest", "--output", str(tmp_path)]
    done = CliRunner().invoke(main, arguments, input="y\n")
    assert done.exit_code == 0, done.output
    assert "Touch nothing while it records." in done.stderr
    assert "Record 10 s now?" in done.stderr
    assert "  noise of x 0.9" in done.stderr  # at once, and not in the report alone
    assert (tmp_path / "report" / "report.html").exists()


def test_a_step_that_is_interrupted_ends_the_walk_and_is_recorded_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ss.write_record(bench.SimulatedBench(fs=1000).record("rest"), tmp_path / "rest.csv")
    rig = tmp_path / "rig.toml"
    rig.write_text('[devices.desk]\nkind = "file"\npath = "rest.csv"\nfast = true\n', encoding="utf-8")
    read = Playing.read

    def until_interrupted(stream: Playing, timeout: float = 1.0) -> Block | None:
        if stream.sent > 4000:
            raise KeyboardInterrupt
        return read(stream, timeout)

    monkeypatch.setattr(Playing, "read", until_interrupted)
    arguments = ["commission", "--device", "desk", "--config", str(rig), "--step", "rest", "--output", str(tmp_path)]
    done = CliRunner().invoke(main, arguments, input="y\n")
    assert done.exit_code == INTERRUPTED
    records = tmp_path / "records"
    stay = f"the steps before stay in {records}, and the same command goes on there"
    assert done.stderr.endswith(f"stickslip: interrupted; {stay}.\n")
    assert not [*records.iterdir()]
    assert not (tmp_path / "report").exists()
    (records / "rest.h5.journal").write_bytes(b"of a second Ctrl-C")  # it kept the step from being recorded anew
    monkeypatch.undo()
    done = CliRunner().invoke(main, arguments, input="y\n")
    assert done.exit_code == 0, done.output
    assert "rest.h5.journal holds what came when it was cut short" in done.stderr
    assert [path.name for path in records.iterdir()] == ["rest.h5"]
    good = (records / "rest.h5").read_bytes()
    monkeypatch.setattr(Playing, "read", until_interrupted)
    done = CliRunner().invoke(main, [*arguments, "--again", "rest"], input="y\n")
    assert done.exit_code == INTERRUPTED
    assert [(path.name, path.read_bytes()) for path in records.iterdir()] == [("rest.h5", good)]


def test_no_answer_at_the_prompt_is_an_interruption(tmp_path: Path) -> None:
    """Ctrl-C there ended in `Aborted!` and code 1."""
    ss.write_record(bench.SimulatedBench(fs=1000).record("rest"), tmp_path / "rest.csv")
    rig = tmp_path / "rig.toml"
    rig.write_text('[devices.desk]\nkind = "file"\npath = "rest.csv"\nfast = true\n', encoding="utf-8")
    arguments = ["commission", "--device", "desk", "--config", str(rig), "--step", "rest"]
    done = CliRunner().invoke(main, [*arguments, "--output", str(tmp_path)], input="")
    assert (done.exit_code, "stickslip: interrupted; the steps before stay" in done.stderr) == (INTERRUPTED, True)
    done = CliRunner().invoke(main, [*arguments, "--json"])
    assert (done.exit_code, "name --output" in done.stderr) == (2, True)


def test_a_caution_of_all_numbers_of_a_step_is_said_once(tmp_path: Path) -> None:
    """A slip of 20 ms after a tap: the caution stood behind each of its numbers."""
    tap = bench.SimulatedBench(fs=4000).record("tap")
    slips = tap.with_channel("a", tap["a"] + np.where(abs(tap.time - 0.14) < 0.01, 1.5, 0.0), unit="m/s^2")
    ss.write_record(slips, tmp_path / "tap.csv")
    rig = tmp_path / "rig.toml"
    rig.write_text('[devices.desk]\nkind = "file"\npath = "tap.csv"\nfast = true\n', encoding="utf-8")
    arguments = ["commission", "--device", "desk", "--config", str(rig), "--step", "tap", "--output", str(tmp_path)]
    done = CliRunner().invoke(main, arguments, input="y\n")
    assert done.exit_code == 0, done.output
    said = " ".join(done.stderr.split())
    assert said.count("no sum of decaying oscillations") == 1
    assert said.count("Hz (95 %:") > 1


def test_the_picture_shows_what_a_channel_read_last() -> None:
    device = Replay(ss.Record.of({"x": np.zeros(10), "load": np.zeros(10)}, fs=1000), fast=True)
    vars(device)["inputs"] = (Input("x", "m", limit=1e-3), Input("load", "N"))
    seen = Picture(10.0)
    for number in range(60):  # a ramp of 1 mm in six seconds, of which four are kept; the other is not there
        x = np.full(100, (number + 1) / 60 * 1e-3)
        seen.add(device, Block(100 * number, 0.0, np.stack([x, np.full(100, np.nan)])))
    first, x_line, load_line = seen.lines(device)
    assert first == "6.0 of 10 s"
    trace = x_line[9:49]
    assert [*trace] == sorted(trace)
    assert set(trace) == {*HEIGHTS}
    assert x_line[49:] == " 0.3333 to 1 mm  at the end of its range"
    assert load_line == "load     gives no numbers"
