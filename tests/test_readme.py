"""What the README tells a reader to type works, block by block, in the order in which it stands."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)
PYTHON = [code for language, code in BLOCKS if language == "python"]
SHELL = [line for language, code in BLOCKS if language == "sh" for line in code.splitlines() if line.strip()]
TARGETS = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text("utf-8"), flags=re.MULTILINE))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where a reader sits: a folder with a rig's file in it, written by the project from its own record."""
    import stickslip as ss

    folder = tmp_path_factory.mktemp("reader")
    ss.write_record(ss.datasets.demo(), folder / "rig.csv")
    return folder


def test_the_readme_has_what_it_promises() -> None:
    assert {"make demo", "make test"} <= {line.partition("#")[0].strip() for line in SHELL}
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    assert len(pictures) == 1
    assert (ROOT / pictures[0]).is_file()
    assert len(PYTHON[0].splitlines()) < 15, "the first use in under fifteen lines"


def test_the_python_blocks_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    names: dict[str, object] = {}
    for code in PYTHON:
        exec(compile(code, "README.md", "exec"), names)
    assert (folder / "report.html").stat().st_size > 10_000


@pytest.mark.parametrize("line", SHELL)
def test_the_commands_run(folder: Path, line: str) -> None:
    command = shlex.split(line, comments=True)
    if command[0] == "make":
        assert set(command[1:]) <= TARGETS
        return
    if command[0] == "stickslip":
        program = [sys.executable, "-m", "stickslip.cli", *command[1:]]
        run = subprocess.run(program, cwd=folder, capture_output=True, text=True, timeout=120, env=os.environ)
        assert run.returncode == 0, run.stderr
        return
    assert command[:3] == ["pip", "install", "stickslip[io]"], f"a command that no test runs: {line}"
