"""What the README and the pages of docs tell a reader to type works, block by block, in order."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from printed import alike
from stickslip.cli.program import main

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text("utf-8")
PAGES = sorted([*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "extending").glob("*.md")])


def blocks(text: str, language: str) -> list[str]:
    """The fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def typed(page: Path) -> list[str]:
    """What a page tells a reader to type in a shell, line by line."""
    return [line for block in blocks(page.read_text("utf-8"), "sh") for line in block.splitlines() if line.strip()]


BLOCK = re.MULTILINE | re.DOTALL
PYTHON = blocks(README, "python")
TARGETS = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text("utf-8"), flags=re.MULTILINE))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where a reader sits: a folder with a rig's file in it and the examples of the checkout."""
    folder = tmp_path_factory.mktemp("reader")
    shutil.copy(ROOT / "examples" / "rig.csv", folder)
    shutil.copytree(ROOT / "examples", folder / "examples")
    for page in PAGES:
        for block in blocks(page.read_text("utf-8"), "toml"):
            if named := re.match(r"# (\w+\.toml)\n", block):
                (folder / named[1]).write_text(block, encoding="utf-8")
    return folder


def test_the_readme_has_what_it_promises() -> None:
    assert {"make demo", "make test"} <= {line.partition("#")[0].strip() for line in typed(ROOT / "README.md")}
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    assert len(pictures) == 1
    assert (ROOT / pictures[0]).is_file()
    assert len(PYTHON[0].splitlines()) < 15, "the first use in under fifteen lines"


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.name)
def test_the_python_blocks_run(folder: Path, page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where the extra `sound` is not installed: its loudness takes five seconds at each second of a squeak."""
    monkeypatch.chdir(folder)
    monkeypatch.setitem(sys.modules, "mosqito", None)
    names: dict[str, object] = {"__name__": "__main__"}
    text = page.read_text("utf-8")
    for block in re.finditer(r"^```python\n(.*?)^```\n(?:\n<!-- prints -->\n\n```text\n(.*?)^```\n)?", text, BLOCK):
        with contextlib.redirect_stdout(io.StringIO()) as said:
            exec(compile(block[1], page.name, "exec", dont_inherit=True), names)
        if block[2] is not None:
            assert alike(block[2], said.getvalue()), "python tools/fill_outputs.py writes it again"


def test_the_first_use_leaves_a_report(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    exec(compile(PYTHON[0], "README.md", "exec", dont_inherit=True), {})
    assert (folder / "report.html").stat().st_size > 10_000


@pytest.mark.parametrize(
    "page", [page for page in (ROOT / "README.md", *PAGES) if typed(page)], ids=lambda page: page.name
)
def test_the_commands_run(folder: Path, page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One page after the other, for its lines build on each other; `make smoke` types such in a shell."""
    monkeypatch.chdir(folder)
    monkeypatch.setitem(sys.modules, "mosqito", None)
    for line in typed(page):
        run(line)


def test_the_readme_shows_what_the_command_prints(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    ((commands, shown),) = re.findall(r"^```sh\n([^`]*?)```\n\n<!-- prints -->\n\n```text\n(.*?)^```", README, BLOCK)
    (line,) = [each for each in commands.splitlines() if each.startswith("stickslip analyze")]
    assert alike(shown, CliRunner().invoke(main, shlex.split(line)[1:]).stdout)
    assert len(README.splitlines()) <= 120


def run(line: str) -> None:
    """A line ends well, and says and leaves what its page promises."""
    command = shlex.split(line, comments=True)
    if command[0] == "make":
        assert set(command[1:]) <= TARGETS
        return
    if command[0] != "stickslip":
        assert command[:3] == ["pip", "install", ".[io]"], f"a command that no test runs: {line}"
        return
    result = CliRunner().invoke(main, command[1:])
    assert result.exit_code == 0, result.output
    told = result.stdout
    if command[1] == "check":
        assert "samples" in told
        assert "nothing wrong was found" in told
    elif command[1:] == ["simulate", "--list"]:
        assert "FD-4" in told
    elif command[1] == "simulate":
        assert Path(told.split()[-1]).with_name("results.json").is_file(), "the page's folder is there"
    elif command[1] in ("decay", "squeak"):
        assert {"decay": "damping ratio", "squeak": "It squeaks"}[command[1]] in told
        assert Path(told.split()[-1]).stat().st_size > 10_000, "the report that it names is there"
    elif command[1] == "rig":
        assert ("Root-mean-square errors" if "--plan" in command else "what is true") in told
        assert Path(told.split()[-1]).with_name("results.json").is_file(), "the page's folder is there"
    elif command[1] == "wavelet":
        assert "jumps or kinks" in told
    else:
        assert command[1] == "analyze", f"a command whose answer no test looks at: {line}"
        assert "sliding friction" in told
        assert Path(told.split()[-1]).stat().st_size > 10_000, "the report that it names is there"
