"""What a command prints: the answer and a short table for people, JSON for machines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import stickslip as ss
from stickslip.cli.terminal import aligned, say, say_json, say_styled, spoken, wrapped

if TYPE_CHECKING:
    from stickslip.story import Caution, Line, Story

MOST_LINES = 40  # unless --all is asked for
MOST_ROWS = 8  # of all tables together
OF_TABLES = 4  # of these rows, where a result has tables beside its quantities
MOST_PARTS = 4  # records of a comparison, a sentence each
END = 3  # lines kept for what is left out and where the page lies
TITLE: Mapping[str, Any] = {"bold": True}
FAINT: Mapping[str, Any] = {"dim": True}
PLURALS = {"quantity": "quantities"}


def print_json(results: Mapping[str, Any]) -> None:
    """Results for a machine, which begin as results.json does: with what made them."""
    say_json({"program": "stickslip", "version": ss.__version__, **results})


def publish(result: Any, folder: Path | None, **context: Any) -> Path | None:
    """The folder of a result, whose page names options as the terminal does; none where none is asked for."""
    return None if folder is None else ss.publish(result, folder=folder, wording=spoken, **context)


def show(result: Any, written: Path | None, *, as_json: bool, everything: bool = False, **context: Any) -> None:
    """A result as its story tells it, in short or with `everything`; `context` as in ``publish``."""
    story = ss.summary(result, **context)
    if as_json:
        print_json(story.data())
        return
    if everything:
        for part in (*story.parts, story):
            _print_all(part)
    else:
        _print_short(story)
    if written is not None:
        say(f"Report: {written / 'report.html'}")


def _print_short(story: Story) -> None:
    """At most MOST_LINES lines: the answer, the rows that lead, their cautions, and what else there is."""
    in_tables = sum(len(table.rows) for table in story.tables if not table.folded)
    rows, lines = story.lines[: MOST_ROWS - min(in_tables, OF_TABLES)], []
    sentences = [] if story.lines or story.tables else story.others  # without rows the sentences are all
    for text in (*story.opening, *sentences, *(f"{part.title}: {part.answer}" for part in story.parts[:MOST_PARTS])):
        lines += _lines(text)
    lines += [*_remedy(story), *_numbers(story, rows)]
    left, hidden = MOST_ROWS - len(rows), 0
    for table in story.tables:
        shown = () if table.folded else table.rows[:left]
        lines += [*_table(table.title, table.headings, shown), *(_lines(table.note) if shown else ())]
        left, hidden = left - len(shown), hidden + len(table.rows) - len(shown)
    cautions: list[Caution] = []
    lines.append("")
    for caution in story.concerned(rows):
        caution_lines = _caution(story, caution)
        if len(lines) + len(caution_lines) <= MOST_LINES - END:
            lines += caution_lines
            cautions.append(caution)
    _print(story.title, lines)
    more = {
        "quantity": len(story.lines) - len(rows), "row": hidden, "caution": len(story.notices) - len(cautions),
        "sentence": len(story.others) - len(sentences), "note": len(story.notes),
        "record": max(0, len(story.parts) - MOST_PARTS),
    }  # fmt: skip
    counted = [
        f"{count} {PLURALS.get(name, name + 's') if count > 1 else name}" for name, count in more.items() if count
    ]
    if counted:
        say_styled(f"More with --all: {', '.join(counted)}.", **FAINT)


def _print_all(story: Story) -> None:
    """Everything that the page tells in words, each sentence once."""
    lines = [line for text in story.headline for line in _lines(text)]
    lines += [*_remedy(story), *_numbers(story, story.lines), ""]
    said = {str(sentence) for sentence in (*story.headline, *story.notices)} | {
        notice.reason for notice in story.notices
    }
    lines += [line for caution in story.notices for line in _caution(story, caution)]
    lines += [line for fault in story.faults or () if fault not in said for line in _lines(fault, "- ")]
    for table in story.tables:
        lines += [*_table(table.title, table.headings, table.rows), *_lines(table.note)]
    lines += [line for note in story.notes if note not in said for line in _lines(note, "Note: ")]
    _print(story.title, lines)


def _print(title: str, lines: Sequence[str]) -> None:
    say()
    for line in wrapped(title):
        say_styled(line, **TITLE)
    for line, before in zip(lines, ["", *lines], strict=False):
        if line or before:
            say(line)


def _remedy(story: Story) -> list[str]:
    """The command that mends what is wrong, on a line that can be copied."""
    return ["To mend it:", story.remedy] if story.remedy else []


def _lines(text: object, begin: str = "") -> list[str]:
    """A paragraph in the terminal's own words."""
    return wrapped(spoken(text), begin)


def _table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """A table under its title and headings; nothing without rows."""
    if rows:
        yield from ("", *wrapped(title), *aligned(headings, [[spoken(cell) for cell in row] for row in rows]))


def _numbers(story: Story, lines: Sequence[Line]) -> list[str]:
    """The rows of quantities, each with the numbers of the cautions that concern it."""
    columns = [
        ("quantity", [line.name for line in lines]), ("", [story.marks(line) for line in lines]),
        ("value", [line.value for line in lines]), ("95 % interval", [line.interval for line in lines]),
        ("true value", [line.true or "-" for line in lines] if story.has_truth else []),
    ]  # fmt: skip
    columns = [(heading, cells) for heading, cells in columns if any(cells)]
    rows = list(zip(*(cells for _, cells in columns), strict=True))
    return ["", *aligned([heading for heading, _ in columns], rows)] if rows else []


def _caution(story: Story, caution: Caution) -> list[str]:
    """A caution behind its number, or in words of its own."""
    mark = story.mark(caution)
    return _lines(caution.reason, f"{mark:<3}") if mark else _lines(caution)
