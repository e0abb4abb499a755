"""Many records: one row each, on several processes, kept through a kill, as a table."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner, Result

import stickslip as ss
from motions import free_decay
from stickslip.answers.many import Batch, Kept, Row
from stickslip.cli import option, records
from stickslip.cli.program import main

COUNT = 7
TIME = np.arange(1500) / 250


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(option, "MANY", 5)


def written(count: int = COUNT) -> None:
    """Records whose friction is 1 N, 1.1 N, ...; the last but one is a copy of the first, the last too short."""
    for number in range(count):
        rng = np.random.default_rng(number)
        force = (1 + number / 10) * np.sign(np.cos(2 * np.pi * TIME)) + 0.01 * rng.standard_normal(TIME.size)
        rows = np.column_stack([TIME, 0.01 * np.sin(2 * np.pi * TIME), force])
        np.savetxt(
            f"run_{number:02d}.csv",
            rows[: 19 if number == count - 1 else None],
            delimiter=",",
            header="t [s],x [m],friction [N]",
            comments="",
            fmt="%.7g",
        )
    shutil.copy("run_00.csv", f"run_{count - 2:02d}.csv")


def ask(*words: str) -> Result:
    return CliRunner().invoke(main, list(words))


@pytest.mark.figures
def test_one_row_a_record_copies_and_refusals_named() -> None:
    written()
    result = ask("analyze", "run_*.csv", "--workers", "1", "--table", "all.xlsx", "--output", "out")
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80
    text = " ".join(result.stdout.split())
    assert (
        "5 of 7 records answer: sliding friction 0.99" in text or "5 of 7 records answer: sliding friction 1.0" in text
    )
    assert "1 is a copy of another: run_05.csv of run_00.csv." in text
    assert "1 gives no answer: run_06.csv is too short: 19 samples" in text
    assert text.count("not tried on twins") <= 1
    for table in (pd.read_excel("all.xlsx"), pd.read_csv("out/table.csv")):
        assert list(table["file"]) == [f"run_{number:02d}.csv" for number in range(COUNT)]
        known = table["sliding friction [N]"].iloc[:5]
        assert known.to_numpy() == pytest.approx(1 + np.arange(5) / 10, rel=0.01)
        assert (table["sliding friction, low [N]"].iloc[:5] <= known).all()
    data = json.loads(Path("out/results.json").read_text())
    assert [each["same_as"] for each in data["records"]][-2] == "run_00.csv"
    page = Path("out/report.html").read_text()
    assert page.count("<svg") >= 2
    assert not Path("out.rows").exists()


def test_several_processes_answer_as_one_does(monkeypatch: pytest.MonkeyPatch) -> None:
    written()
    one, two = (
        ask("analyze", "run_0*.csv", "--table", f"{count}.csv", "--workers", count, "--json") for count in ("1", "2")
    )
    assert one.exit_code == two.exit_code == 0
    assert one.stdout == two.stdout
    assert Path("1.csv").read_text() == Path("2.csv").read_text()


def test_a_cluster_answers_as_this_machine_does() -> None:
    pytest.importorskip("distributed")
    written()
    here, there = (
        ask("analyze", "run_0[0-1].csv", "--table", f"{name}.csv", "--engine", name, "--workers", "1", "--json")
        for name in ("processes", "cluster")
    )
    assert there.exit_code == 0, there.output
    assert json.loads(here.stdout)["records"] == json.loads(there.stdout)["records"]


def test_a_run_that_was_killed_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    written()
    asked: list[str] = []
    real = records.answered

    def watched(task: records.Task) -> Row:
        if len(asked) == 3:
            raise KeyboardInterrupt
        asked.append(task.names[0])
        return real(task)

    monkeypatch.setattr(records, "answered", watched)
    words = ("analyze", "run_*.csv", "--workers", "1", "--output", "out")
    assert ask(*words).exit_code == 130
    kept = Path("out.rows")
    assert len(kept.read_text().splitlines()) == 4
    with kept.open("a") as file:  # the kill fell into a line
        file.write('{"name": "run_')
    first = list(asked)
    asked[:] = [""]  # counts from here
    monkeypatch.setattr(records, "answered", lambda task: (asked.append(task.names[0]), real(task))[1])
    result = ask(*words)
    assert result.exit_code == 0, result.output
    assert not set(first) & set(asked)
    assert "5 of 7 records answer" in " ".join(result.stdout.split())
    assert not kept.exists()
    whole = pd.read_csv("out/table.csv")
    assert len(whole) == COUNT


def test_what_was_asked_otherwise_is_asked_again(tmp_path: Path) -> None:
    kept = Kept(tmp_path / "out.rows", {"question": "analyze", "method": "auto"})
    kept.add(Row("a.csv", "1" * 64, "It slides."))
    kept.file.close()
    again = Kept(tmp_path / "out.rows", {"question": "analyze", "method": "auto"})
    assert again.rows["1" * 64].answer == "It slides."
    again.file.close()
    other = Kept(tmp_path / "out.rows", {"question": "analyze", "method": "motion"})
    assert not other.rows
    other.file.close()


def test_the_coefficient_stands_over_the_rows_where_loads_are_known() -> None:
    written()
    loads = [word for n in range(5) for word in ("--normal", f"run_0{n}.csv={2 * (1 + n / 10)}")]
    result = ask("analyze", "run_0*.csv", "--workers", "1", "--table", "t.csv", *loads)
    assert result.exit_code == 0, result.output
    row = next(line for line in result.stdout.splitlines() if line.startswith("friction coefficient"))
    assert "0.50" in row


def test_decays_and_squeaks_have_rows_too() -> None:
    values, fs, _ = free_decay()
    for seed in range(2):
        noisy = values + 1e-3 * np.random.default_rng(seed).standard_normal(len(values))
        ss.write_record(ss.Record.of({"x": noisy}, fs=fs), f"release_{seed}.csv")
        time = np.arange(4000) / 500
        tone = np.where((time > 2) & (time < 5), np.sin(2 * np.pi * 120 * time), 0.0)
        sound = tone + 0.01 * np.random.default_rng(seed).standard_normal(time.size)
        ss.write_record(ss.Record.of({"sound": sound}, fs=500), f"sound_{seed}.csv")
    words = ("--table", "t.csv", "--workers", "1")
    assert "damping ratio" in ask("decay", "release_*.csv", "--method", "thesis", *words).stdout
    assert len(pd.read_csv("t.csv")) == 2
    result = ask("squeak", "sound_*.csv", "--channel", "sound", *words)
    assert result.exit_code == 0, result.output
    assert "2 of 2 records answer" in result.stdout


@pytest.mark.parametrize(
    ("words", "told"),
    [(("--table", "t.doc"), ".csv, .parquet, .xlsx"), (("--table", "t.csv", "--engine", "gpu"), "cluster://HOST:PORT")],
)
def test_what_can_not_be_is_refused_before_the_work(words: tuple[str, ...], told: str) -> None:
    written(3)
    result = ask("analyze", "run_*.csv", *words)
    assert result.exit_code == 2
    assert told in result.stderr


def test_a_batch_is_told_as_other_results_are() -> None:
    level = ss.Estimate.normal("sliding friction", 1.3, sd=0.1, unit="N", method="by hand")
    rows = tuple(Row(name, name, "It slides.", (level,), level, picture=([0.0, 1.0], [0.0, 1.0])) for name in "ab")
    story = ss.summary(Batch("analyze", rows, ("time", "friction")))
    assert story.answer == "2 of 2 records answer: sliding friction 1.3 N to 1.3 N, median 1.3 N, in 2."
    assert [plate.name for plate in story.plates] == ["over-records-sliding-friction", "records-1"]
