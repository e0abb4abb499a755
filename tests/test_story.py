"""Who tells of which result, and what a story leaves to its reader."""

from __future__ import annotations

import importlib
import inspect
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip.estimate import Doubt, Status
from stickslip.story.story import ABOVE, TELLERS, Line, Story

LEVEL = ss.Estimate.normal("sliding friction", 1.318, sd=0.004, unit="N", method="by hand")


@pytest.mark.parametrize("kind", sorted(TELLERS.keys() - {"Dataset", "list", "tuple"}))
def test_the_register_names_the_function_that_tells(kind: str) -> None:
    file, name = TELLERS[kind].split(".")
    teller = getattr(importlib.import_module(f"stickslip.story.{file}"), name)
    first = next(iter(inspect.signature(teller).parameters.values()))
    assert first.annotation == kind


def test_figures_are_drawn_when_they_are_looked_at() -> None:
    drawn: list[str] = []
    story = Story("slow", draw=lambda: drawn.append("once") or ())  # type: ignore[func-returns-value]
    assert not drawn
    assert story.plates == story.plates == ()
    assert drawn == ["once"]


def test_results_json_of_a_record_keeps_its_keys() -> None:
    way = np.linspace(0, 6 * np.pi, 600)
    findings = ss.analyze(ss.Record.of({"x": np.sin(way), "friction": np.sign(np.cos(way))}, fs=100))
    assert set(ss.summary(findings).data()) == {
        "name",
        "faults",
        "contradiction",
        "settings",
        "normal_load",
        "log",
        "estimates",
        "regression_residual",
        "truth",
        "notes",
        "history",
    }
    assert set(ss.summary([LEVEL]).data()) == {"estimates"}


def test_the_marks_of_the_leading_rows_are_counted_from_one() -> None:
    """What few cycles leave crude was numbered last, so that a table began at 3."""
    crude = LEVEL.doubted(Status(Doubt.few(5, "cycle")))
    later = [replace(LEVEL, name=f"quantity {j}", status="ok" if j < 8 else "by eye") for j in range(9)]
    story = ss.summary([crude, *later])
    assert [story.marks(line) for line in story.lines] == ["1", *[""] * 8, "2"]


def test_a_mark_is_explained_beside_the_answer() -> None:
    """Every row of a decay bore a mark whose reason stood in a sentence that only --all printed."""
    line = Line.of(LEVEL.doubted(Status("the residual is 27 times the noise")), None)
    told = Story("slow", ["It slides.", "The residual is 27 times the noise.", "It was warm."], lines=[line])
    assert told.marks(line) == ABOVE
    assert told.explaining([line]) == ["The residual is 27 times the noise."]
