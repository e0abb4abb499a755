"""What a command prints: a table for people, JSON for machines."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import stickslip as ss
from stickslip.cli.terminal import paragraph, print_table, say, say_json
from stickslip.cli.words import spoken

if TYPE_CHECKING:
    from stickslip.story import Story


def print_json(told: Mapping[str, Any]) -> None:
    """Results for a machine, which begin as results.json does: with what made them."""
    say_json({"program": "stickslip", "version": ss.__version__, **told})


def show(result: Any, written: Path | None, *, as_json: bool, **context: Any) -> None:
    """A result as its story tells it; `context` as in ``publish``."""
    story = ss.summary(result, **context)
    if as_json:
        print_json(story.data())
        return
    for part in story.parts:
        if story.brief:
            paragraph((part.title, "bold"), f": {spoken(part.headline[0])}")
        else:
            _print_story(part)
    _print_story(story)
    if written is not None:
        say(f"Report: {written / 'report.html'}")


def _print_story(story: Story) -> None:
    paragraph((f"\n{story.title}", "bold"))
    faults = [f"- {fault}" for fault in story.faults or () if fault not in story.headline]
    for sentence in (*story.headline, *story.cautions, *faults):
        paragraph(spoken(sentence))
    _print_lines(story)
    for table in story.tables:
        if table.folded:
            paragraph((f"{table.title}: {len(table.rows)} rows, on the page", "dim"))
            continue
        paragraph(f"\n{table.title}")
        print_table(table.headings, table.rows)
        if table.note:
            paragraph((table.note, "dim"))
    for note in story.notes:
        paragraph((f"Note: {spoken(note)}", "dim"))


def _print_lines(story: Story) -> None:
    """The numbers."""
    truth = story.has_truth
    headings = ("quantity", "value", "95 % interval", *(["true value"] if truth else []), "how sure")
    rows = []
    for line in story.lines:
        true = [line.true or "-"] if truth else []
        rows.append([line.name, line.value, line.interval, *true, story.how_sure(line)])
    if rows:
        print_table(headings, rows)
