"""Names, units and cells of others: none speaks to the terminal or the page, and any can be written out."""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import subprocess
import sys
import unicodedata
from pathlib import Path

import numpy as np
import pytest
import scipy.io.wavfile

import stickslip as ss
from format_files import SMALL
from limits import Outcome, civil, limited, program

EVIL = "a\x1b[31m\x1b]0;owned\x07\x9b2J\r\u202egnp\u2066\x08"
BYTES = os.fsdecode(b"caf\xe9\xff")
NAMES = [f"two\nlines{EVIL}", BYTES, "[/x]", "[bold]", "-o", ":smile:", "\U0001f600\U000e0041"]
ROWS = "".join(f"{i / 100},{i % 7},{(-1) ** (i // 9)}\n" for i in range(90))


def hidden(text: str) -> list[str]:
    """The signs of a text that steer what shows it."""
    return [sign for sign in text if sign not in "\n\t" and unicodedata.category(sign)[0] == "C"]


def quiet(outcome: Outcome) -> Outcome:
    assert not hidden(civil(outcome).out + outcome.err)
    return outcome


def write(folder: Path, name: str, text: str = f"t [s],x [mm],friction [N]\n{ROWS}") -> str:
    path = folder / f"{name}.csv"
    path.parent.mkdir(exist_ok=True)  # "[/x].csv" stands in a folder "["
    path.write_text(text, "utf-8")
    return path.name


@pytest.mark.parametrize("name", NAMES[:3], ids=ascii)
def test_a_name_does_not_speak(tmp_path: Path, name: str) -> None:
    write(tmp_path, name)
    ended = quiet(limited(_convert_and_check, name, folder=tmp_path))
    assert ended.code == 0, ended.err
    assert "Record(x [m], friction [N]; 90 samples, 100 Hz" in ended.out


def _convert_and_check(name: str) -> None:
    from stickslip.cli.program import main

    for suffix in ("csv", "h5", "parquet"):
        Path(f"kept/{name}").parent.mkdir(exist_ok=True, parents=True)
        main(["convert", f"./{name}.csv", f"kept/{name}.{suffix}"], standalone_mode=False)
        main(["check", f"kept/{name}.{suffix}"], standalone_mode=False)
        for step in ss.read_record(f"kept/{name}.{suffix}").history:
            assert not hidden(str(step.to_dict()))


@pytest.mark.parametrize("name", [*SMALL, "tone.wav"])
def test_every_format_is_read_whatever_bytes_name_it(tmp_path: Path, name: str) -> None:
    if name == "tone.wav":
        scipy.io.wavfile.write(tmp_path / name, 8000, np.arange(400, dtype=np.int16))
    else:
        SMALL[name](tmp_path / name)
    fs = None if name == "tone.wav" else 250
    known = ss.read_record(tmp_path / name, fs=fs)
    moved = (tmp_path / name).rename(tmp_path / f"{BYTES}{Path(name).suffix}")
    record = ss.read_record(moved, fs=fs)
    assert {key: list(record[key]) for key in record} == {key: list(known[key]) for key in known}


def test_what_is_refused_is_named_in_one_line(tmp_path: Path) -> None:
    for name in NAMES:
        write(tmp_path, name, f"no numbers {EVIL}\n")
    ended = quiet(limited(_refused, folder=tmp_path))
    assert ended.code == 0, ended.err
    assert ended.err.count("\n") == ended.err.count("stickslip: ") == 5 * len(NAMES)
    assert not ended.out


def _refused() -> None:
    from stickslip.cli.program import main

    for name in NAMES:
        file, nowhere, option = f"./{name}.csv", f"./{name}.txt", f"--{name}"
        for asked in (["check", file], ["check", nowhere], ["analyze", nowhere], ["check", option, "x"], [option]):
            with pytest.raises(SystemExit) as ended:
                main(asked, prog_name="stickslip")
            assert ended.value.code in (1, 2)


def test_titles_units_and_cells_do_not_speak(tmp_path: Path) -> None:
    units = {"q": f'q{EVIL},"\n'}
    told = {"fs": 100, f"x{EVIL}": [0.0] * 90, "q": list(range(90)), "units": units, f"unit{EVIL}": EVIL}
    (tmp_path / "run.json").write_text(json.dumps(told))
    write(tmp_path, "cell", f"t [s],x [mm]\n{ROWS}0.9,{EVIL.replace(chr(13), '')},1\n")
    ended = quiet(program("check", "run.json", folder=tmp_path))
    assert "[qa\\u001b 31m" in ended.out
    ended = quiet(limited(_kept, folder=tmp_path))
    assert ended.code == 0, ended.err
    quiet(program("check", "cell.csv", folder=tmp_path))
    quiet(program("check", "run.json", "--units", f"q=q{EVIL}", folder=tmp_path))
    quiet(program("check", "run.json", "--channels", f"v=q [m/s{EVIL}]", folder=tmp_path))


def _kept() -> None:
    record = ss.read_record("run.json")
    for suffix in ("csv", "h5", "parquet"):
        assert ss.read_record(ss.write_record(record, f"kept.{suffix}")).equals(record)


def test_a_folder_of_results_is_clean_of_the_name(tmp_path: Path) -> None:
    name = NAMES[0] + BYTES
    slide = np.sin(np.arange(600) / 20)
    rows = zip(np.arange(600) / 100, np.gradient(slide), 0.3 * np.tanh(50 * np.gradient(slide)), strict=True)
    text = "t [s],v [m/s],friction [N]\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows)
    write(tmp_path, name, text)
    ended = quiet(program("fit", f"{name}.csv", "--curve", "coulomb", folder=tmp_path))
    assert ended.code == 0, ended.err
    (folder,) = tmp_path.glob("*-fit")
    assert folder.name.isprintable()
    assert not hidden((folder / "report.html").read_text("utf-8"))
    assert json.loads((folder / "results.json").read_text("utf-8"))["program"] == "stickslip"


def test_the_page_shows_what_it_is_told(tmp_path: Path) -> None:
    estimate = ss.Estimate.normal(f"friction {EVIL}<b>", 1.0, sd=0.1, unit=f"N{EVIL}", method=f"by {EVIL}{BYTES}")
    record = ss.Record.of({"x": np.arange(9.0)}, fs=10).with_channel("q", np.arange(9.0), unit=f"q{EVIL}")
    page = ss.report([estimate], tmp_path / "page.html", record=record).read_text("utf-8")
    assert not hidden(page)
    assert "\\u001b[31m" in page
    assert "&lt;b&gt;" in page


def test_json_stays_json_of_the_same_value(capsys: pytest.CaptureFixture[str]) -> None:
    from stickslip.cli.terminal import say_json

    told = {"name": EVIL + BYTES, "µ": "\U0001f600\U000e0041 \u00a0é", "low\ud800": "\\u001b"}
    say_json(told)
    printed = capsys.readouterr().out
    assert json.loads(printed) == told
    assert not hidden(printed)
    assert "µ" in printed


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp437", "utf-8"])
def test_any_output_takes_any_text(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from stickslip.cli.terminal import aligned, say, say_json, say_styled, wrapped

    out, err = io.BytesIO(), io.BytesIO()
    for name, stream in (("stdout", out), ("stderr", err)):
        monkeypatch.setattr(sys, name, io.TextIOWrapper(stream, encoding=encoding, newline="", write_through=True))
    told = "Größe µ² Ω \U0001f600 " + EVIL + BYTES
    say(told)
    say(told, err=True)
    say_styled(told, bold=True)
    for line in (*wrapped(told), *aligned((told, "b"), [[told, "[/x]"]])):
        say(line)
    say_json({"a": told})
    shown = out.getvalue().decode(encoding)
    assert not hidden(shown + err.getvalue().decode(encoding))
    assert json.loads(shown[shown.index("{") :]) == {"a": told}
    assert "[/x]" in shown


def test_help_and_results_fit_into_ascii(tmp_path: Path) -> None:
    write(tmp_path, "Größe")
    ended = limited(_in_ascii, folder=tmp_path)
    assert civil(ended).code == 0, ended.err
    assert "Gr\\u00f6\\u00dfe" in ended.out


def _in_ascii() -> None:
    from stickslip.cli.program import main

    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(encoding="ascii")  # type: ignore[union-attr]
    for arguments in (["--help"], ["rig", "--help"], ["convert", "Größe.csv", "Größe2.csv"], ["simulate", "--list"]):
        with contextlib.suppress(SystemExit):
            main(arguments, prog_name="stickslip")


class Terminal(io.StringIO):
    """A stream that says that it is one."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_a_line_of_progress_does_not_speak(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from stickslip.cli import terminal

    monkeypatch.setattr(terminal, "PATIENCE", 0.0)
    monkeypatch.setenv("COLUMNS", "300")
    monkeypatch.setenv("TERM", "xterm")
    sent = Terminal()
    monkeypatch.setattr(sys, "stderr", sent)
    with terminal.progress(2) as tell:
        tell(f"reading {name}.csv", 1)
    shown = sent.getvalue()
    assert "reading" in shown
    assert not [part for part in ("\x1b[31m", "\x1b]0", "\x9b", "\u202e", "\x07", "\x08") if part in shown]


def test_all_that_the_program_says_goes_through_one_door() -> None:
    """One file alone may print, or draw a bar."""
    folder = Path(ss.__file__).parent / "cli"
    speaking = {
        path.name
        for path in folder.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if (isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rich"))
        or (isinstance(node, ast.Attribute) and node.attr in ("echo", "secho"))
        or (isinstance(node, ast.Name) and node.id == "print")
    }
    assert speaking == {"terminal.py"}


@pytest.mark.parametrize("name", ["click", "stickslip.cli.simulate", "pandas", "pyarrow"])
def test_ctrl_c_while_something_is_imported(tmp_path: Path, name: str) -> None:
    code = (
        "import signal, sys\n"
        "class Key:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        name == {name!r} and signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Key())\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from stickslip.__main__ import main\n"
        "main()\n"
    )
    write(tmp_path, "run")
    command = [sys.executable, "-c", code, "convert", "run.csv", "out.parquet"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (130, "stickslip: interrupted; nothing was written.\n")
    assert not (tmp_path / "out.parquet").exists()
