"""Write under the blocks of a page what they print, where the page has the mark for it.

    python tools/fill_outputs.py README.md docs/start.md ...        (--mark: below every block of Python that prints)

A block of Python or of a shell that is followed by ``<!-- prints -->`` is run, in the page's order, in a folder with
the example file; what it prints becomes the block of text below. The tests of README and docs run them again.
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MARK = "<!-- prints -->"
BLOCK = re.compile(
    r"^```(?P<kind>python|sh|{code-block} python)\n(?P<code>.*?)^```\n"
    rf"(?P<shown>\n{MARK}\n(?:\n```text\n(?P<text>.*?)^```\n)?)?",
    flags=re.MULTILINE | re.DOTALL,
)


def printed(kind: str, code: str, names: dict[str, object]) -> str:
    """What a block prints: a program's output, or that of the commands."""
    said = io.StringIO()
    if kind != "sh":
        with contextlib.redirect_stdout(said):
            exec(compile(code, "page", "exec", dont_inherit=True), names)
        return said.getvalue()
    from click.testing import CliRunner

    from stickslip.cli.program import main

    lines = [shlex.split(line, comments=True) for line in code.splitlines()]
    runs = [CliRunner().invoke(main, words[1:]) for words in lines if words and words[0] == "stickslip"]
    if failed := [run.output for run in runs if run.exit_code]:
        raise SystemExit(failed[0])
    return runs[-1].stdout  # of several commands the last


def filled(page: str, *, mark: bool = False) -> Iterator[str]:
    """The page in pieces, with what its blocks print; all run, for later ones use their names."""
    import stickslip as ss

    end, names = 0, {"__name__": "__main__", "ss": ss}
    for block in BLOCK.finditer(page):
        yield page[end : block.end("code") + 4]
        end = block.end()
        wanted = block["shown"] is not None or (mark and block["kind"] == "python" and "print(" in block["code"])
        if wanted or block["kind"] != "sh":
            text = printed(block["kind"], block["code"], names)
        if wanted:
            yield f"\n{MARK}\n\n```text\n{text.strip()}\n```\n"
    yield page[end:]


if __name__ == "__main__":
    mark = "--mark" in sys.argv
    for path in (Path(each).resolve() for each in sys.argv[1:] if each != "--mark"):
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            shutil.copytree(ROOT / "examples", "examples")
            shutil.copy(ROOT / "examples" / "rig.csv", "rig.csv")
            path.write_text("".join(filled(path.read_text("utf-8"), mark=mark)), encoding="utf-8")
        print(path)
