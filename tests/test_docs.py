"""The documentation's pages: nothing from a network, names that exist, every extension point with its example."""

from __future__ import annotations

import ast
import dataclasses
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import stickslip as ss
from printed import alike
from stickslip.cli.program import main

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
LISTED_ELSEWHERE = {"`convert`", "`datasets`", "`demo`", "`thesis`"}  # commands that answer no question
EXAMPLES = sorted((DOCS / "examples").glob("*.py"))
sys.path.insert(0, str(DOCS))

from offline import loaded_from_network  # noqa: E402


def blocks(page: Path, fence: str) -> list[str]:
    return re.findall(rf"^```{re.escape(fence)}\n(.*?)^```", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize(
    ("text", "loaded"),
    [
        ('<script async="async" src="https://cdn.org/m.js"></script>', ["https://cdn.org/m.js"]),
        ('<img alt="a" src="//a.org/b.png">', ["//a.org/b.png"]),
        ('<link href="https://a.org/a.css" rel="stylesheet" />', ["https://a.org/a.css"]),
        ("@import url('https://a.org/a.css');", ["https://a.org/a.css"]),
        ('<a href="https://a.org">a</a> <img src="_static/a.png"> <link rel="canonical" href="https://a.org">', []),
        ('<math xmlns="http://www.w3.org/1998/Math/MathML"></math>', []),
    ],
)
def test_what_a_page_would_load_from_a_network_is_found(text: str, loaded: list[str]) -> None:
    assert loaded_from_network(text) == loaded


def test_no_page_that_was_built_loads_anything_from_a_network() -> None:
    built = [path for path in (DOCS / "_build" / "html").rglob("*") if path.suffix in (".html", ".css")]
    if not built:
        pytest.skip("the pages are not built here: make docs, which looks for it too")
    assert not {path.name: found for path in built if (found := loaded_from_network(path.read_text("utf-8")))}


def test_the_symbols_are_of_names_that_exist() -> None:
    page = (DOCS / "symbols.md").read_text("utf-8")
    of_classes = re.findall(r"`(\w+)\.(\w+)`", page)
    assert len(of_classes) > 30
    rooms = [ss, *(getattr(ss, room.parent.name) for room in Path(ss.__file__).parent.glob("*/__init__.pyi"))]
    for owner, name in of_classes:
        there = next(getattr(room, owner) for room in rooms if owner in room.__all__)
        assert hasattr(there, name) or name in {field.name for field in dataclasses.fields(there)}, f"{owner}.{name}"


def test_each_symbol_stands_for_one_thing() -> None:
    page = (DOCS / "symbols.md").read_text("utf-8")
    rows = re.findall(r"^\| (\$.*?) \|", page, flags=re.MULTILINE)
    letters = [letter for row in rows for letter in re.findall(r"\$(.*?)\$", row)]
    assert len(letters) > 40
    assert [letter for letter in set(letters) if letters.count(letter) > 1] == []


@pytest.mark.parametrize("page", sorted(DOCS.glob("extending/*.md")), ids=lambda page: page.name)
def test_every_extension_point_has_an_example_and_a_place(page: Path) -> None:
    listed = (DOCS / "extending" / "index.md").read_text("utf-8")
    if page.name != "index.md":
        assert f"({page.name})" in listed
        assert any("assert" in block for block in blocks(page, "python")), "an example that shows that it works"
    for path in re.findall(r"`(?:src/stickslip/)?((?:\w+/)*\w+\.(?:py|toml))`", page.read_text("utf-8")):
        own = (page.name == "question.md" and path == "cycle/travels.py") or path == "laws/grain.py"
        assert own or any(root.joinpath(path).is_file() for root in (ROOT / "src" / "stickslip", ROOT)), path


def test_the_registers_named_are_there() -> None:
    rows = re.findall(r"`([A-Z_]+)` in `([\w/]+\.py)`", (DOCS / "extending" / "index.md").read_text("utf-8"))
    assert len(rows) >= 6
    for name, path in rows:
        assert re.search(rf"^{name}\b", (ROOT / "src" / "stickslip" / path).read_text("utf-8"), flags=re.MULTILINE)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.stem)
def test_an_example_of_the_gallery_is_short_and_uses_public_names(example: Path) -> None:
    tree = ast.parse(example.read_text("utf-8"))
    assert len(example.read_text("utf-8").splitlines()) <= 45
    assert re.match(r"\n?.+\n=+\n\n.+", ast.get_docstring(tree) or "")
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert not {name for name in imported if name and name.startswith("stickslip")}
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "ss"}
    assert used <= set(ss.__all__)


def test_the_gallery_has_what_a_visitor_looks_for() -> None:
    assert 8 <= len(EXAMPLES) <= 15


def test_the_tutorial_on_a_real_record(dataset: Callable[[str], Path]) -> None:
    dataset("frame_base_excited")
    (code,) = blocks(DOCS / "tutorial.md", "{code-block} python")
    names: dict[str, object] = {"ss": ss}
    exec(compile(code, "tutorial.md", "exec", dont_inherit=True), names)
    levels = [findings.level.value for findings in names["findings"].values()]  # type: ignore[attr-defined]
    assert levels == pytest.approx([0.69, 1.31], abs=0.02)
    assert "not the whole of it" in names["law"].status  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("number", "name"),
    [*enumerate(["frame_base_excited", "paper_stick_slip", "band_brake_damper", "pendulum_decay", "audio"])],
)
def test_the_real_records_are_answered_as_their_page_shows(
    number: int, name: str, dataset: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    dataset(name)
    page = (DOCS / "real.md").read_text("utf-8")
    form = r"^```{code-block} python\n(.*?)^```\n\n<!-- prints -->\n\n```text\n(.*?)^```"
    code, shown = re.findall(form, page, flags=re.MULTILINE | re.DOTALL)[number]
    assert f'fetch("{name}")' in code
    exec(compile(code, "real.md", "exec", dont_inherit=True), {"ss": ss})
    assert alike(shown, capsys.readouterr().out), "python tools/fill_outputs.py docs/real.md writes it again"


def test_every_command_stands_on_the_page_of_questions() -> None:
    page = (DOCS / "commands.md").read_text("utf-8")
    assert {f"`{name}`" for name in main.commands} - set(re.findall(r"`\w+`", page)) == LISTED_ELSEWHERE
