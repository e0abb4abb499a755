"""The command line: what it prints, what it writes, and how it refuses."""

from __future__ import annotations

import hashlib
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import pytest
import scipy.io
from click.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.program import main
from stickslip.cli.terminal import ARGUMENTS, spoken

PROGRAM = Path(sys.executable).with_name("stickslip")
FS = 500.0
TIME = np.arange(4000) / FS
RIG = ["--mass", "2", "--stiffness", "1 N/mm"]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, list(arguments))


def slide(path: str, *, friction: float = 1.5, rows: int = 4000) -> Path:
    """A file of a mass that slides on the ground against a measured friction."""
    force = friction * np.sign(np.cos(2 * np.pi * TIME)) + np.random.default_rng(1).normal(0, 0.02, TIME.size)
    columns = {"t [s]": TIME, "pos [mm]": 10 * np.sin(2 * np.pi * TIME), "fr [N]": force}
    lines = [
        ",".join(columns),
        *(",".join(f"{value:.6f}" for value in row) for row in zip(*columns.values(), strict=True)),
    ]
    Path(path).write_text("\n".join(lines[: rows + 1]) + "\n", encoding="utf-8")
    return Path(path)


MAP = ["--channels", "x=pos [mm]", "--channels", "friction=fr [N]"]


@pytest.mark.figures
def test_one_file_gives_a_table_and_a_folder() -> None:
    slide("run.csv")
    result = run("analyze", "run.csv", *MAP)
    assert result.exit_code == 0, result.output
    assert "sliding friction" in result.stdout
    assert "1.50" in result.stdout
    assert result.stdout.rstrip().endswith("Report: run-stickslip/report.html")
    assert {path.name for path in Path("run-stickslip").iterdir()} == {"report.html", "results.json", "figures"}
    assert run("analyze", "run.csv", *MAP).exit_code == 0, "its own results are replaced"


@pytest.mark.figures
def test_a_pattern_gives_one_report_with_the_coefficient() -> None:
    for load in (1, 2, 4):
        slide(f"load_{load}N.csv", friction=0.3 * load)
    loads = [part for load in (1, 2, 4) for part in ("--normal", f"*{load}N*={load}")]
    result = run("analyze", "load_*.csv", *MAP, *loads, "--output", "all")
    assert result.exit_code == 0, result.output
    data = json.loads(Path("all/results.json").read_text(encoding="utf-8"))
    assert [record["name"] for record in data["records"]] == ["load_1N.csv", "load_2N.csv", "load_4N.csv"]
    coefficient = data["comparison"]["estimates"][0]
    assert coefficient["name"] == "friction coefficient"
    assert coefficient["value"] == pytest.approx(0.3, rel=0.01)
    assert Path("all/figures/0-3-records-compared-friction-load.svg").is_file()


def test_files_of_one_name_are_told_apart_by_their_folders() -> None:
    for load in (1, 2):
        for kind in ("dry", "wet"):
            Path(f"{kind}/{load}N").mkdir(parents=True)
            slide(f"{kind}/{load}N/run.csv", friction=0.3 * load)
    files = ["dry/1N/run.csv", "dry/2N/run.csv", "wet/2N/run.csv"]
    Path("dry/1N/run.csv").rename("dry/1N/first.csv")
    files[0] = "dry/1N/first.csv"
    result = run("analyze", *files, *MAP, "--normal", "first.csv=1", "--normal", "*/2N/run.csv=2", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)["records"]
    names = ["first.csv", "dry/2N/run.csv", "wet/2N/run.csv"]
    assert [record["name"] for record in told] == names
    assert [record["history"][0]["arguments"]["files"][0]["name"] for record in told] == names
    assert [record["normal_load"] for record in told] == [1, 2, 2]
    Path("wet/2N/run.csv").write_text("no numbers")
    assert "left out: wet/2N/run.csv" in run("analyze", *files, *MAP, "--json").stderr


def test_files_joined_by_plus_are_one_record(dataset: Callable[[str], Path]) -> None:
    folder = dataset("frame_base_excited")
    Path("rig.toml").write_text(
        'mass = "3.0799 kg"\nstiffness = 1191\ndamping = 0.669\ndamper = "base"\n'
        '[channels]\nx = "x [mm]"\nz = "y [mm]"\n[normal]\n"*250g*" = "0.25 kg"\n"*450g*" = "0.45 kg"\n'
    )
    result = run("analyze", f"{folder}/s_b_*_x.mat+{folder}/s_b_*_y.mat", "--config", "rig.toml", "--json")
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)
    assert [record["name"] for record in data["records"]] == [
        "s_b_250g_x.mat + s_b_250g_y.mat",
        "s_b_450g_x.mat + s_b_450g_y.mat",
    ]
    levels = [{e["name"]: e["value"] for e in record["estimates"]}["sliding friction"] for record in data["records"]]
    assert levels == pytest.approx([0.682, 1.318], rel=0.04)
    assert not [path for path in Path().iterdir() if path.name != "rig.toml"], "--json alone writes nothing"


def test_options_go_before_the_file_of_the_rig() -> None:
    slide("run.csv")
    Path("rig.toml").write_text('mass = 2\nstiffness = 7\nrows = "0:1000"\n[channels]\nx = "pos [mm]"\n')
    result = run("analyze", "run.csv", "--config", "rig.toml", "--mass", "3 kg", "--rows", "500:", "--json")
    data = json.loads(result.stdout)
    assert (data["settings"]["mass"], data["settings"]["stiffness"]) == (3.0, 7.0)
    assert data["history"][0]["arguments"]["rows"] == [500, None]


def test_a_load_on_the_command_line_goes_before_those_of_the_file() -> None:
    for name in ("one", "two", "three"):
        slide(f"{name}.csv")
    Path("rig.toml").write_text('[normal]\n"one*" = 1\n"two*" = 2\n"*" = 9\n')
    result = run(
        "analyze", "one.csv", "two.csv", "three.csv", *MAP, "--config", "rig.toml", "--normal", "two*=5", "--json"
    )
    assert result.exit_code == 0, result.stderr
    assert [record["normal_load"] for record in json.loads(result.stdout)["records"]] == [1.0, 5.0, 9.0]


def test_a_load_is_stated_with_its_uncertainty() -> None:
    slide("run.csv")
    widths = []
    for load in ("10 N", "10 ± 0.5 N"):
        result = run("analyze", "run.csv", *MAP, "--normal", load, "--json")
        assert result.exit_code == 0, result.stderr
        estimates = {estimate["name"]: estimate for estimate in json.loads(result.stdout)["estimates"]}
        low, high = estimates["friction coefficient"]["interval"]
        widths.append((high - low) / estimates["friction coefficient"]["value"])
    assert widths[1] == pytest.approx(np.hypot(widths[0], 2 * 1.96 * 0.05), rel=1e-3)


def test_a_file_that_can_not_answer_is_named_and_left_out() -> None:
    slide("run_1.csv")
    slide("run_2.csv")
    slide("run_3.csv", rows=10)
    Path("run_4.csv").write_text("")
    result = run("analyze", "run_*.csv", *MAP)
    assert result.exit_code == 0, result.stderr
    lines = result.stderr.splitlines()
    assert [line.split(":")[1].strip() for line in lines] == ["left out", "left out"]
    assert "run_3.csv" in lines[0]
    assert "run_4.csv" in lines[1]
    data = json.loads(Path("comparison-stickslip/results.json").read_text(encoding="utf-8"))
    assert [record["name"] for record in data["records"]] == ["run_1.csv", "run_2.csv"]
    assert [note for note in data["comparison"]["notes"] if "run_4.csv" in note]
    assert "run_4.csv" in Path("comparison-stickslip/report.html").read_text(encoding="utf-8")
    alone = run("analyze", "run_1.csv", "run_4.csv", *MAP, "--json")
    assert json.loads(alone.stdout)["name"] == "run_1.csv"
    assert "run_4.csv" in json.loads(alone.stdout)["notes"][-1]
    before = sorted(Path().rglob("*"))
    none = run("analyze", "run_3.csv", "run_4.csv", *MAP)
    assert none.exit_code == 1
    assert none.stdout == ""
    first, second, last = none.stderr.splitlines()
    assert "run_3.csv" in first
    assert "run_4.csv" in second
    assert "none of 2 records answers" in last
    assert sorted(Path().rglob("*")) == before
    refused(run("analyze", "run_1.csv", "run_4.csv", *MAP, "--mass", "-1"), code=2)


def test_the_check_goes_on_after_a_file_that_can_not_be_read() -> None:
    Path("run_1.csv").write_text("")
    slide("run_2.csv")
    result = run("check", "run_*.csv", *MAP)
    assert result.exit_code == 1
    assert "nothing wrong" in result.stdout
    assert "run_1.csv" in result.stderr
    refused(run("check", "run_1.csv"), code=1)


def test_the_faults_are_told_in_the_terminal_and_in_its_own_words() -> None:
    lines = slide("run.csv").read_text().splitlines()
    stamps = [f"{(row // 8) * 8 / FS:.3f}" for row in range(len(lines) - 1)]  # the host stamped late
    late = [",".join([stamp, *line.split(",")[1:]]) for stamp, line in zip(stamps, lines[1:], strict=True)]
    Path("late.csv").write_text("\n".join([lines[0], *late]))
    result = run("analyze", "late.csv", *MAP)
    assert result.exit_code == 1
    assert "see stickslip check and mend the clock with --repair clock" in result.stderr
    Path("numbers.csv").write_text("\n".join(line.split(",", 1)[1] for line in lines))
    assert "pass --fs in Hz" in run("analyze", "numbers.csv", *MAP).stderr
    lines[700] = lines[700].rsplit(",", 1)[0] + ",30"
    Path("run.csv").write_text("\n".join(lines))
    told = " ".join(run("analyze", "run.csv", *MAP).stdout.split())
    assert "1 fault" in told
    assert "row 699" in told
    assert "--repair spikes:friction" in told


def test_a_bare_text_file_is_read_as_told() -> None:
    lines = slide("run.csv").read_text().splitlines()[1:]
    Path("bare.txt").write_text("\n".join(line.replace(".", ";").replace(",", "|").replace(";", ",") for line in lines))
    channels = ["--channels", "x=#2 [mm]", "--channels", "friction=#3 [N]"]
    result = run("analyze", "bare.txt", *channels, "--time", "#1 [s]", "--delimiter", "|", "--decimal", ",", "--json")
    assert result.exit_code == 0, result.stderr
    levels = {estimate["name"]: estimate["value"] for estimate in json.loads(result.stdout)["estimates"]}
    assert levels["sliding friction"] == pytest.approx(1.5, rel=0.01)


def test_repairs_are_made_in_order_and_logged() -> None:
    path = slide("run.csv")
    lines = path.read_text().splitlines()
    lines[700] = lines[700].split(",")[0] + ",nan,nan"
    path.write_text("\n".join(lines))
    assert "--repair missing" in run("check", "run.csv", *MAP).stdout
    assert "nothing wrong" in run("check", "run.csv", *MAP, "--repair", "missing").stdout
    result = run("analyze", "run.csv", *MAP, "--repair", "missing", "--json")
    assert "fill_missing" in [step["action"] for step in json.loads(result.stdout)["history"]]


def test_the_demonstration_needs_nothing_and_shows_the_truth() -> None:
    result = run("demo")
    assert result.exit_code == 0, result.output
    assert "true value" in result.stdout
    assert "True value" in Path("stickslip-demo/report.html").read_text(encoding="utf-8")
    data = json.loads(run("demo", "--json").stdout)
    assert data["truth"]["sliding friction"] == 1.1


def test_a_record_converted_is_the_same_record() -> None:
    slide("run.csv")
    result = run("convert", "run.csv", "run.parquet", *MAP)
    assert result.exit_code == 0, result.output
    expected = ss.read_record("run.csv", channels={"x": "pos [mm]", "friction": "fr [N]"})
    assert np.array_equal(ss.read_record("run.parquet")["x"], expected["x"])


def test_a_conversion_writes_over_nothing_unless_told_to() -> None:
    path = slide("run.csv")
    before = path.read_bytes()
    Path("kept.csv").write_text("mine")
    refused(run("convert", "run.csv", "kept.csv", *MAP), code=2)
    assert Path("kept.csv").read_text() == "mine"
    for out in ("run.csv", "./run.csv"):
        refused(run("convert", "run.csv", out, "--force", *MAP), code=2)
    assert path.read_bytes() == before
    assert run("convert", "run.csv", "kept.csv", "--force", *MAP).exit_code == 0
    assert ss.read_record("kept.csv").equals(
        ss.read_record("run.csv", channels={"x": "pos [mm]", "friction": "fr [N]"})
    )


def test_a_record_that_comes_back_whole_is_named_by_its_file() -> None:
    slide("run.csv")
    run("convert", "run.csv", "kept.parquet", *MAP)
    data = json.loads(run("analyze", "kept.parquet", "--normal", "kept*=3", "--json").stdout)
    assert (data["name"], data["normal_load"]) == ("kept.parquet", 3.0)
    digests = [file["sha256"] for step in data["history"] for file in step["arguments"].get("files", ())]
    assert hashlib.sha256(Path("kept.parquet").read_bytes()).hexdigest() in digests


def test_the_sets_are_listed_with_licence_and_fetched_by_name(dataset: Callable[[str], Path]) -> None:
    listed = run("datasets").stdout
    assert all(name in listed for name in ss.datasets.names())
    assert "licence" in listed
    folder = dataset("emps")
    assert str(folder / "DATA_EMPS.mat") in run("datasets", "emps").stdout


def damaged(kind: str) -> list[str]:
    """The arguments of a run that can not succeed."""
    wave = np.sin(2 * np.pi * TIME)
    folder = Path(os.environ["STICKSLIP_DATA"])
    if kind == "wrong unit":
        return [str(slide("run.csv")), "--channels", "x=pos [N]"]
    if kind == "unknown unit":
        return [str(slide("run.csv")), "--channels", "x=pos [furlongs per fortnight]"]
    if kind == "missing channel":
        return [str(slide("run.csv")), "--channels", "x=displacement [mm]"]
    if kind in ("truncated TDMS", "truncated MAT"):
        whole = folder / {"truncated TDMS": "formats/raw1.tdms", "truncated MAT": "emps/DATA_EMPS.mat"}[kind]
        if not whole.is_file():
            pytest.skip(f"{whole.name} is not on this machine")
        path = Path(f"cut{whole.suffix}")
        path.write_bytes(whole.read_bytes()[: whole.stat().st_size // 3])
        return [str(path), "--channels", "x=qm [m]"]
    if kind == "unequal columns":
        scipy.io.savemat("uneven.mat", {"x": wave, "f": wave[:1000]})
        return ["uneven.mat", "--fs", "500", "--channels", "x=x [m]", "--channels", "force=f [N]"]
    if kind == "unequal columns of text":
        cells = [f"{t:.3f},{x:.4f},{'' if t > 2 else round(x, 3)}" for t, x in zip(TIME, wave, strict=False)]
        Path("uneven.csv").write_text("t [s],x [mm],force [N]\n" + "\n".join(cells), encoding="utf-8")
        return ["uneven.csv"]
    text = {
        "prose": "It was the best of times,\nit was the worst of times,\n" * 30,
        "empty": "",
        "all NaN": "t [s],x [mm]\n" + "\n".join(f"{t:.3f},nan" for t in TIME),
        "constant": "t [s],x [mm]\n" + "\n".join(f"{t:.3f},1.0" for t in TIME),
        "ten samples": "t [s],x [mm]\n" + "\n".join(f"{t:.3f},{x:.4f}" for t, x in zip(TIME[:10], wave, strict=False)),
    }[kind]
    Path("bad.csv").write_text(text, encoding="utf-8")
    return ["bad.csv"]


@pytest.mark.parametrize(
    "kind",
    [
        "wrong unit",
        "unknown unit",
        "missing channel",
        "prose",
        "empty",
        "truncated TDMS",
        "truncated MAT",
        "unequal columns",
        "unequal columns of text",
        "all NaN",
        "constant",
        "ten samples",
    ],
)
def test_bad_data_end_in_one_sentence_and_nothing_is_written(kind: str) -> None:
    arguments = damaged(kind)
    before = sorted(Path().iterdir())
    result = run("analyze", *arguments, *RIG)
    refused(result, code=2 if kind == "missing channel" else 1)
    assert sorted(Path().iterdir()) == before


ABSENT = [*MAP[:2], "--channels", "friction=force [N]"]
NAMED = {  # the commands that read columns, and what each names that is not there
    "analyze": (ABSENT, [*MAP, "--time", "clock [s]"], [*MAP, "--repair", "drift:z"]),
    "check": (ABSENT, [*MAP, "--sensor", "z.delay=1 ms"], [*MAP, "--repair", "drift:z"]),
    "convert": (["out.csv", *ABSENT], ["out.csv", *MAP, "--sensor", "z.delay=1 ms"]),
    "decay": (ABSENT, [*MAP, "--channel", "v"], [*MAP, "--channel", "swing"], [*MAP, "--sensor", "z.delay=1 ms"]),
    "fit": (ABSENT, [*MAP, *RIG, "--sensor", "z.delay=1 ms"]),
    "impact": (ABSENT, [*MAP, "--sensor", "z.delay=1 ms"]),
    "init": ([*ABSENT, "--yes", "--output", "new.toml"],),
    "joint": (ABSENT, [*MAP, "--axis", "elbow"]),
    "predict": (ABSENT,),
    "rig join": (["run.csv", *ABSENT], ["run.csv", *MAP, "--on", "z"], ["run.csv", *MAP, "--on", "x,z"]),
    "squeak": (ABSENT, [*MAP, "--channel", "sound"]),
    "tribometer": (ABSENT,),
    "wavelet": (ABSENT, [*MAP, "--channel", "a"], [*MAP, "--sensor", "z.delay=1 ms"]),
}


@pytest.mark.parametrize(("command", "named"), [(name, named) for name, every in NAMED.items() for named in every])
def test_a_column_or_channel_that_is_not_there_is_wrong_use(command: str, named: list[str]) -> None:
    """It ended with 1, as data that can not answer do; a sensor of none was read over by three commands."""
    slide("run.csv", rows=1000)
    Path("slider.toml").write_text('[system]\nmass = 2.0\nstiffness = 1000\n[law]\nname = "Coulomb"\nkinetic = 1.5\n')
    law = ["slider.toml"] if command == "predict" else []
    result = run(*command.split(), *law, "run.csv", *named)
    refused(result, code=2)
    assert sorted(path.name for path in Path().iterdir()) == ["run.csv", "slider.toml"]


def test_a_column_that_a_step_s_file_does_not_have_is_wrong_use() -> None:
    slide("run.csv", rows=1000)
    refused(run("commission", "tap=run.csv", "--config", "absent.toml"), code=2)
    Path("rig.toml").write_text('[channels]\na = "acceleration [g]"\n')
    refused(run("commission", "tap=run.csv", "--config", "rig.toml"), code=2)
    lacking = run("commission", "tap=run.csv")
    assert (lacking.exit_code, "channel a is missing" in " ".join(lacking.stdout.split())) == (1, True)


def test_files_of_which_none_has_the_column_are_wrong_use() -> None:
    slide("run.csv", rows=1000)
    slide("r2.csv", rows=1000)
    result = run("analyze", "run.csv", "r2.csv", *ABSENT)
    assert (result.exit_code, "none of 2 records answers" in result.stderr) == (2, True)


@pytest.mark.parametrize(
    "arguments",
    [
        ["analyze"],
        ["analyse", "run.csv"],
        ["analyze", "absent.csv"],
        ["analyze", "run_*.csv"],
        ["analyze", "run.csv+absent.csv"],
        ["analyze", "run.csv", "--mass", "-1"],
        ["analyze", "run.csv", "--mass", "heavy"],
        ["analyze", "run.csv", "--mass", "2 N"],
        ["analyze", "run.csv", "--damper", "wall"],
        ["analyze", "run.csv", "--channels", "x"],
        ["analyze", "run.csv", "--repair", "clok"],
        ["analyze", "run.csv", "--rows", "a:b"],
        ["analyze", "run.csv", "--fs", "0"],
        ["analyze", "run.csv", "--normal", "-3"],
        ["analyze", "run.csv", *MAP, "--normal", "walk*=3"],
        ["analyze", "mine"],
        ["analyze", "run.csv", "--config", "absent.toml"],
        ["analyze", "run.csv", "--config", "typo.toml"],
        ["analyze", "run.csv", *MAP, "--output", "mine"],
        ["convert", "r*.csv", "out.csv"],
    ],
)
def test_wrong_use_ends_in_one_sentence_and_exit_code_2(arguments: list[str]) -> None:
    slide("run.csv", rows=1000)
    slide("r2.csv", rows=1000)
    Path("typo.toml").write_text("mas = .3")
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("years of work")
    before = sorted(Path().rglob("*"))
    refused(run(*arguments), code=2)
    assert sorted(Path().rglob("*")) == before


@pytest.mark.parametrize("command", ["analyze", "decay", "joint"])
def test_a_sensor_that_the_record_does_not_have_is_named(command: str) -> None:
    slide("run.csv", rows=1000)
    result = run(command, "run.csv", *MAP, "--sensor", "banana.delay=15 ms")
    refused(result, code=2)
    assert "'banana' is no channel of the record, which has x, friction" in result.stderr


def test_a_load_that_is_none_is_named_by_its_option() -> None:
    slide("run.csv", rows=1000)
    for load in ("-3", "run*=heavy"):
        stderr = run("analyze", "run.csv", "--normal", load).stderr
        assert "--normal: " in stderr
        assert "normal.*" not in stderr


def refused(result: Result, code: int) -> None:
    assert result.exit_code == code, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert result.stdout == ""
    assert result.stderr.startswith("stickslip: ")
    assert result.stderr.count("\n") == 1, result.stderr
    assert "Traceback" not in result.stderr


def test_a_true_process_keeps_the_table_and_the_trouble_apart() -> None:
    slide("run.csv")
    told = subprocess.run([PROGRAM, "analyze", "run.csv", *MAP, "--json"], capture_output=True, text=True, check=True)
    assert json.loads(told.stdout)["name"] == "run.csv"
    assert told.stderr == ""
    bad = subprocess.run([PROGRAM, "analyze", "run.csv", "--mass", "0"], capture_output=True, text=True, check=False)
    assert (bad.returncode, bad.stdout) == (2, "")
    assert "Traceback" not in bad.stderr


WATCHED = """
import sys
from stickslip.cli import program, terminal
terminal.PATIENCE = 0.0
program.main()
"""


def test_work_that_lasts_is_told_to_who_watches() -> None:
    """The error stream is a terminal here; the table stays alone on the other stream."""
    pty = pytest.importorskip("pty", reason="a terminal to watch at")
    slide("run.csv")
    slide("two.csv")
    watching, watched = pty.openpty()
    command = [sys.executable, "-c", WATCHED, "analyze", "run.csv", "two.csv", *MAP]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=watched, env={**os.environ, "TERM": "xterm"}) as told:
        os.close(watched)
        shown = b""
        while True:
            try:
                shown += (part := os.read(watching, 4096))
            except OSError:  # the last writer is gone
                break
            if not part:
                break
        assert told.stdout is not None
        table = told.stdout.read().decode()
    os.close(watching)
    assert told.returncode == 0
    for words in ("reading run.csv", "checking and analysing two.csv", "drawing and writing", "0/4", "3/4"):
        assert words in shown.decode(), words
    assert "drawing" not in table
    assert "sliding friction" in table


INTERRUPTED_WHILE_WRITING = """
import os, signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
from stickslip.story import folder
write = folder.write_figures
def interrupted(*arguments):
    write(*arguments)
    os.kill(os.getpid(), signal.SIGINT)
folder.write_figures = interrupted
from stickslip.cli.program import main
from stickslip.cli.terminal import ARGUMENTS, spoken
main()
"""


def test_an_interrupted_run_leaves_nothing_and_exits_130() -> None:
    slide("run.csv")
    before = sorted(Path().iterdir())
    command = [sys.executable, "-c", INTERRUPTED_WHILE_WRITING, "analyze", "run.csv", *MAP]
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    assert told.returncode == 130
    assert told.stderr == "stickslip: interrupted; nothing was written.\n"
    assert "sliding friction" in told.stdout  # the answer is shown before the figures are drawn
    assert sorted(Path().iterdir()) == before


def test_a_reader_that_goes_early_gets_the_folder() -> None:
    slide("run.csv")
    command = [sys.executable, "-m", "stickslip", "analyze", "run.csv", *MAP, "--output", "there"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as program:
        assert program.stdout is not None
        program.stdout.close()
    assert {path.name for path in Path("there").iterdir()} == {"figures", "report.html", "results.json"}


def test_help_is_there_before_the_heavy_libraries_are() -> None:
    start = "import sys; from stickslip.cli.program import main"
    code = f"{start}; main(['--help'], standalone_mode=False); print(*sys.modules)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "analyze" in told.stdout
    loaded = set(told.stdout.split())
    assert not loaded & {"numpy", "scipy", "pandas", "matplotlib", "pydantic", "jinja2", "rich"}
    # 0.12 to 0.15 s on a quiet machine, where Python with click alone takes 0.06: on a busy one both take longer
    commands = [PROGRAM, "--help"], [sys.executable, "-c", "import click, importlib.resources"]
    ours, least = np.min([[_processor_seconds([*command]) for command in commands] for _ in range(6)], axis=0)
    assert ours < 3 * least


def test_the_quick_questions_are_there_without_compiler_and_solver() -> None:
    """They took half a second of every quick answer, for a question of the record's channels."""
    code = "import sys, stickslip.answers.questions; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not [name for name in loaded if name == "numba" or name.startswith(("stickslip.solve.", "stickslip.twin."))]


def test_figures_and_fits_are_there_before_the_compiler_is() -> None:
    """numba took half a second of every quick answer, whose figures know what a fit of a law is."""
    code = "import sys, stickslip.figures.friction, stickslip.law.which_law; print('numba' in sys.modules)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "False"


def _processor_seconds(command: list[object]) -> float:
    """Of a program that has nothing to wait for; another program's load does not add to them."""
    begun = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(part) for part in command], capture_output=True, check=True)
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return ended.ru_utime + ended.ru_stime - begun.ru_utime - begun.ru_stime


def test_a_next_step_names_what_the_command_at_hand_has() -> None:
    """`simulate --set mass=-1` asked to correct --mass, and `analyze` for a frequency= that it does not take."""
    assert 'correct --set "mass=VALUE"' in run("simulate", "FD-1", "--set", "mass=-1").stderr
    assert 'raise --set "static=VALUE"' in run("simulate", "FD-1", "--set", "law.static=0.1").stderr
    Path("short.csv").write_text("".join(f"{t:.4f},{np.sin(t):.6f}\n" for t in TIME[:200]))
    short = run("analyze", "short.csv", "--time", "#1 [s]", "--channels", "x=#2 [m]", "--channels", "z=#2 [m]", *RIG)
    assert "or frequency= in Python" in short.stderr


NAMES = ("mass", "stiffness", "frequency", "channel", "fs", "static", "budget", "torque_constant", "normal", "rows")


@pytest.mark.parametrize("command", [name for name, one in main.commands.items() if not isinstance(one, click.Group)])
def test_no_command_is_told_of_an_option_that_it_has_not(command: str) -> None:
    own = {option for parameter in main.commands[command].params for option in parameter.opts}
    with main.make_context("stickslip", [command, "--help"], resilient_parsing=True) as context:
        context.meta[ARGUMENTS] = [command]
        told = [spoken(f"correct {name}=, or leave it out") for name in NAMES]
    assert {word.strip(",") for text in told for word in text.split() if word.startswith("--")} <= own
    assert spoken("correct mass=") == "correct --mass", "outside of a command"
