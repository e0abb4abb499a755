"""What the README and the pages of docs tell a reader to type works, block by block, in order."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import shutil
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


def lines(block: str) -> list[str]:
    """What is typed in a shell, command by command."""
    return [line for line in block.splitlines() if line.strip()]


# a block of Python or of the shell, and what the page says that it prints
BLOCK = re.compile(
    r"^```(python|sh)\n(.*?)^```\n(?:\n<!-- prints -->\n\n```text\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL
)
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
    typed = {line.partition("#")[0].strip() for block in blocks(README, "sh") for line in lines(block)}
    assert {"make demo", "make test"} <= typed
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    assert len(pictures) == 1
    assert (ROOT / pictures[0]).is_file()
    assert len(README.splitlines()) <= 120
    assert len(blocks(README, "python")[0].splitlines()) < 15, "the first use in under fifteen lines"


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.name)
def test_what_a_page_has_typed_works(folder: Path, page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process; `make smoke` types such lines in a shell."""
    monkeypatch.chdir(folder)
    if page.name == "README.md":  # its answers are those that a reader gets, tried on twins
        monkeypatch.delenv("STICKSLIP_TWINS", raising=False)
    names: dict[str, object] = {"__name__": "__main__"}
    for language, block, shown in BLOCK.findall(page.read_text("utf-8")):
        with contextlib.redirect_stdout(io.StringIO()) as said:
            if language == "python":
                exec(compile(block, page.name, "exec", dont_inherit=True), names)
            for line in lines(block) if language == "sh" else ():
                run(line)
        if shown:
            assert alike(shown, said.getvalue()), "python tools/fill_outputs.py writes it again"
    if page.name == "README.md":
        assert (folder / "report.html").stat().st_size > 10_000, "the first use leaves a report"


def run(line: str) -> None:
    """A line ends well, prints, and says and leaves what its page promises."""
    command = shlex.split(line, comments=True)
    if command[0] == "make":
        assert set(command[1:]) <= TARGETS
        return
    if command[0] != "stickslip":
        assert command[:3] == ["pip", "install", ".[io]"], f"a command that no test runs: {line}"
        return
    result = CliRunner().invoke(main, command[1:])
    assert result.exit_code == 0, result.output
    stdout = result.stdout
    print(stdout, end="")
    if command[1] == "check":
        assert "samples" in stdout
        assert "nothing wrong was found" in stdout
    elif command[1:] == ["simulate", "--list"]:
        assert "FD-4" in stdout
    elif command[1] == "simulate":
        assert Path(stdout.split()[-1]).with_name("results.json").is_file(), "the page's folder is there"
    elif command[1] in ("decay", "squeak"):
        assert {"decay": "damping ratio", "squeak": "It squeaks"}[command[1]] in stdout
        assert Path(stdout.split()[-1]).stat().st_size > 10_000, "the report that it names is there"
    elif command[1] == "rig":
        assert ("Root-mean-square errors" if "--plan" in command else "what is true") in stdout
        assert Path(stdout.split()[-1]).with_name("results.json").is_file(), "the page's folder is there"
    elif command[1] == "wavelet":
        assert "jumps or kinks" in stdout
    else:
        assert command[1] == "analyze", f"a command whose answer no test looks at: {line}"
        assert "sliding friction" in stdout
        assert Path(stdout.split()[-1]).stat().st_size > 10_000, "the report that it names is there"
