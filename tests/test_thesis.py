"""The thesis's chapters: every verdict holds, numbers follow from the parameters, and the page shows them."""

from __future__ import annotations

import doctest
import functools
import json
import re
import types
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from stickslip.cli.program import main
from stickslip_thesis import measures, page, printed

CHAPTERS = pytest.mark.parametrize("chapter", page.CHAPTERS)
MOVED = {  # a parameter, and a number that has to follow it
    "2": ("rig", "mass", "natural frequency"),
    "3": ("sliding", "mass", "base"),
    "4": ("stick_slip", "stiffness", "coupled frequency"),
    "5": ("stick_slip", "stiffness", "local maximum"),
    "6": ("decay", "damping", "extremes"),
    "7": ("bearing", "kinetic", "friction over the bearing's"),
    "appendices": ("discharge", "hold", "drift"),
}


def moved(section: str, name: str) -> dict[str, dict[str, float]]:
    """What the chapters start from, with one parameter three per cent larger."""
    start = deepcopy(printed.given())
    start[section][name] *= 1.03
    return start


@functools.cache
def numbers(chapter: str) -> printed.Ours:
    """Ours, of what the thesis prints."""
    found: printed.Ours = page.CHAPTERS[chapter].numbers(printed.given())
    return found


@CHAPTERS
def test_every_verdict_holds(chapter: str) -> None:
    wrong = [
        (table.name, row.quantity, number, value, verdict)
        for table in printed.tables()
        if table.chapter == chapter
        for row, entries in zip(table.rows, printed.judged(table, numbers(chapter)), strict=True)
        for number, (value, verdict) in zip(row.numbers, entries, strict=True)
        if verdict != number.expected
    ]
    assert not wrong


@CHAPTERS
def test_every_number_of_a_chapter_is_shown(chapter: str) -> None:
    shown = {row.ours for table in printed.tables() if table.chapter == chapter for row in table.rows}
    assert shown == set(numbers(chapter))


@pytest.mark.parametrize("chapter", MOVED)
def test_numbers_follow_from_the_parameters(chapter: str) -> None:
    section, name, number = MOVED[chapter]
    before, after = numbers(chapter)[number], page.CHAPTERS[chapter].numbers(moved(section, name))[number]
    assert abs(np.ravel(after)[-1] / np.ravel(before)[-1] - 1) > 1e-4


def test_every_chapter_with_numbers_is_moved() -> None:
    assert {table.chapter for table in printed.tables()} == set(MOVED)


@pytest.mark.parametrize("module", [printed, page])
def test_the_examples_run(module: types.ModuleType) -> None:
    results = doctest.testmod(module)
    assert results.attempted
    assert not results.failed


def test_what_differs_says_why() -> None:
    for table in printed.tables():
        for row in table.rows:
            for number in row.numbers:
                assert number.expected in printed.MEANINGS
                widened = number.tolerance > printed.half_unit(number.printed)
                assert bool(number.why) >= (number.expected != printed.SAME), (table.name, row.quantity, number)
                assert bool(number.why) <= (number.expected != printed.SAME or widened), (table.name, row.quantity)
                instead = number.expected in (printed.CORRECTED, printed.DIFFERS)
                assert (number.instead is not None) >= instead, (table.name, row.quantity)


def test_what_is_printed_twice_counts_once() -> None:
    rows = {(table.name, row.ours): row for table in printed.tables() for row in table.rows}
    again = [row for row in rows.values() if row.again]
    assert len(again) == 13
    for row in again:
        first = rows[row.again, row.ours.partition(",")[0] if row.again == "Table 6.4" else row.ours]
        assert {number.printed for number in row.numbers} <= {number.printed for number in first.numbers}


@pytest.mark.parametrize(
    ("number", "ours", "verdict"),
    [
        (printed.Number("", "0.0197", "same", None, 5e-5, ""), 0.01974, "same"),
        (printed.Number("", "0.0197", "same", None, 5e-5, ""), 0.01976, "changed"),
        (printed.Number("", "0.0197", "same", None, 5e-5, ""), None, "changed"),
        (printed.Number("", "5.3", "corrected", "5.4", 0.05, "."), 5.38, "corrected"),
        (printed.Number("", "5.3", "corrected", "5.4", 0.05, "."), 5.31, "changed"),
        (printed.Number("", "5.3", "corrected", "5.4", 0.05, "."), 5.5, "changed"),
        (printed.Number("", "0.49", "contradicts itself", "0.335", 0.005, "."), 0.3352, "contradicts itself"),
        (printed.Number("", "0.49", "contradicts itself", "0.335", 0.005, "."), 0.49, "changed"),
        (printed.Number("", "0.49", "not printed", None, 0.005, "."), None, "not printed"),
        (printed.Number("", "0.49", "not printed", None, 0.005, "."), 0.52, "changed"),
        (printed.Number("", "0.49", "put in", None, 0.005, "."), None, "changed"),
        (printed.Number("", "0", "ambiguous", None, 0.5, "."), 0.0, "ambiguous"),
        (printed.Number("", "0", "ambiguous", None, 0.5, "."), 2.0, "changed"),
    ],
)
def test_a_verdict_is_borne_out_or_changed(number: printed.Number, ours: float | None, verdict: str) -> None:
    assert number.verdict(ours) == verdict


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("thesis") / "six"
    done = CliRunner().invoke(main, ["thesis", "6", "--output", str(folder)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert "183 same" in done.output
    return folder


def test_the_page_shows_tables_and_figures(folder: Path) -> None:
    text = (folder / "thesis.html").read_text("utf-8")
    assert text.count("<svg") == len(list((folder / "figures").glob("*.svg"))) > 10
    assert "what successive extremes lose in that ring-down" in text.lower()
    rows = re.findall(r'<tr><th scope="row">(.*?)</th><td>(.*?)</td><td class="method">(.*?)</td></tr>', text)
    assert {("damping", "0.2", ""), ("resolution", "10 µm", ""), ("release", "6 mm", "ours")} <= set(rows)
    assert re.search(r"0\.86728.*?0\.867277", text, flags=re.DOTALL)
    assert len(text) < 800_000, "nine such chapters make a page that a phone opens"
    assert "http" not in re.sub(r"http-equiv|http://www\.w3\.org[\w/.]*", "", text), "it asks nothing of a network"


def test_the_results_hold_every_number(folder: Path) -> None:
    data = json.loads((folder / "results.json").read_text("utf-8"))
    six = [table for table in printed.tables() if table.chapter == "6"]
    assert len(data["numbers"]) == sum(len(row.numbers) for table in six for row in table.rows)
    assert data["verdicts"]["changed"] == 0
    first = next(entry for entry in data["numbers"] if entry["place"] == "Table 6.1" and entry["entry"] == "i = 1")
    assert {"printed": "-0.86728", "verdict": "same"}.items() <= first.items()
    assert first["ours"] == pytest.approx(-0.86727678404443999)


def test_chapters_in_other_processes_are_the_same(tmp_path: Path) -> None:
    def nothing(words: str, done: float) -> None:
        pass

    apart = page.reproduce(["6", "appendices"], folder=tmp_path / "apart", tell=nothing)
    here = page.run_chapter("appendices")
    assert [chapter.name for chapter in apart] == ["6", "appendices"]
    assert list(apart[1].entries()) == list(here.entries())
    assert [plate.svg() for plate in apart[1].plates] == [plate.svg() for plate in here.plates]
    assert len(list((tmp_path / "apart" / "figures").glob("*.png"))) == sum(len(one.plates) for one in apart)


def test_a_verdict_that_no_longer_holds_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "given", lambda: moved("decay", "damping"))
    done = CliRunner().invoke(main, ["thesis", "6", "--json"], catch_exceptions=False)
    assert done.exit_code == 1
    assert json.loads(done.output)["verdicts"]["changed"] > 10


def test_a_chapter_that_is_not_there_is_refused() -> None:
    done = CliRunner().invoke(main, ["thesis", "9"])
    assert done.exit_code == 2
    assert "'9' is none of" in done.output


def test_the_docs_tell_how_many_there_are() -> None:
    chapters = [page.run_chapter(name, draw=False) for name in page.CHAPTERS]
    counts = page.results(chapters)["verdicts"]
    told = (Path(__file__).parent.parent / "docs" / "thesis.md").read_text("utf-8")
    rows = dict(re.findall(r"^\| ([a-z ]+) \| .* \| (\d+) \|$", told, re.MULTILINE))
    assert {verdict: int(count) for verdict, count in rows.items()} == {k: v for k, v in counts.items() if v}
    seen = [one.why == "" for one in measures.observations()]
    assert f"{sum(seen)} of {len(seen)} are seen" in " ".join(told.split())
