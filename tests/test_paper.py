"""The manuscript: no number of it is typed, and it is written from what is computed."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

PAPER = Path(__file__).parent.parent / "docs" / "paper"


def test_no_number_is_typed_by_hand() -> None:
    text = (PAPER / "paper.md.jinja").read_text("utf-8")
    text = re.sub(r"\{\{.*?\}\}|\{%.*?%\}", "", text, flags=re.DOTALL)
    text = re.sub(r"\$\$?[^$]*\$\$?", "", text)  # formulas
    text = re.sub(r"Equation \(\d\.\d\)", "", text)
    assert not re.findall(r"[^\n]*\d[^\n]*", text)


def test_it_is_written_from_computed_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(PAPER))
    make = __import__("make")
    values = make.numbers()
    text = make.manuscript(values)
    sys.modules.pop("make")
    assert values["mean_of_singles"] == pytest.approx(values["of_the_ends"], rel=1e-12), "the mean telescopes"
    assert abs(values["stiffness_by_likelihood"] / values["true_stiffness"] - 1) < 0.01
    assert values["stiffness_by_slopes"] < 0.97 * values["true_stiffness"], "sensors and smoothing tilt the sticks"
    assert not values["failed_with_more"]
    assert 2500 < len(text.split()) < 3500, "with its four figures some eight pages"
    assert f"| same | {values['verdicts']['same']} |" in text
    assert len(re.findall(r"\| (?:corrected|contradicts itself) \|$", text, re.MULTILINE)) == len(values["corrected"])
    assert "{{" not in text
    assert "nan" not in text
