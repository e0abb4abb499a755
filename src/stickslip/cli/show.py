"""What a command prints: a table for people, JSON for machines."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import stickslip as ss
from stickslip.cli.terminal import paragraph, print_table, say, say_json
from stickslip.cli.words import spoken

if TYPE_CHECKING:
    from typing import TypeAlias

    from stickslip.answers import (
        Comparison,
        DecayComparison,
        DecayFindings,
        Findings,
        SqueakComparison,
        SqueakFindings,
        TimeFrequency,
    )
    from stickslip.story import Outcome

    Asked: TypeAlias = (
        Findings | Comparison | TimeFrequency | DecayFindings | DecayComparison | SqueakFindings | SqueakComparison
    )


SHOWN_EVENTS = 12


def print_json(told: Mapping[str, Any]) -> None:
    """Results for a machine, which begin as results.json does: with what made them."""
    say_json({"program": "stickslip", "version": ss.__version__, **told})


def show(
    results: Asked,
    written: Path | None,
    *,
    as_json: bool,
) -> None:
    if as_json:
        print_json(results.to_dict())
        return
    parts = getattr(results, "findings", ())
    if isinstance(results, ss.answers.SqueakComparison):  # a line each: the page has the rest
        _print_lines(parts)
        parts = ()
    for part in (*parts, results):
        _print_table(part)
    if written is not None:
        say(f"Report: {written / 'report.html'}")


def _print_lines(parts: Sequence[Asked]) -> None:
    for part in parts:
        told = ss.summary(part)
        paragraph((told.title, "bold"), f": {spoken(told.headline[0])}")


def _print_table(results: Asked) -> None:
    summary = ss.summary(results)
    paragraph((f"\n{summary.title}", "bold"))
    faults = [f"- {fault}" for fault in summary.faults or () if fault not in summary.headline]
    for sentence in (*summary.headline, *summary.cautions, *faults):
        paragraph(spoken(sentence))
    truth = summary.has_truth
    headings = ("quantity", "value", "95 % interval", *(["true value"] if truth else []), "how sure")
    rows = [
        [line.name, line.value, line.interval, *([line.true or "-"] if truth else []), line.status]
        for line in summary.lines
    ]
    if rows:
        print_table(headings, rows)
    for each in summary.tables:
        paragraph(f"\n{each.title}")
        print_table(each.headings, each.rows)
        if each.note:
            paragraph((each.note, "dim"))
    if summary.verdicts:
        print_table(("motion tried", "verdict"), summary.verdicts)
    for note in summary.notes:
        paragraph((f"Note: {spoken(note)}", "dim"))


def show_run(result: Outcome, written: Path | None, *, as_json: bool) -> None:
    if as_json:
        print_json(result.to_dict())
        return
    paragraph((f"\n{result.case.name}", "bold"), f"  {result.case.about}")
    for sentence in result.sentences:
        paragraph(sentence)
    print_table(("quantity", "value"), result.rows)
    if result.known:
        answers = [(name, str(pair["known"]), str(pair["found"])) for name, pair in result.known.items()]
        paragraph("\nKnown of this scenario, and what the engine finds:")
        print_table(("answer", "known", "found"), answers)
    count, events = result.run.event_counts().total(), list(itertools.islice(result.run.each_event(), SHOWN_EVENTS))
    if events:
        several = any(event.contact for event in events)
        rows = [
            (f"{event.time:.9g}", event.kind, *([str(event.contact + 1)] if several else []), event.mode)
            for event in events
        ]
        headings = ("time [s]", "event", *(["contact"] if several else []), "mode that begins")
        say()
        print_table(headings, rows)
        if count > len(rows):
            say(f"... and {count - len(rows)} more{', in events.csv' if written is not None else ''}")
    if written is not None:
        say(f"Results: {written}")
