"""What a command prints: a table for people, JSON for machines."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli.words import spoken

if TYPE_CHECKING:
    from typing import TypeAlias

    from stickslip import (
        Comparison,
        DecayComparison,
        DecayFindings,
        Findings,
        Outcome,
        SqueakComparison,
        SqueakFindings,
        TimeFrequency,
    )

    Asked: TypeAlias = (
        Findings | Comparison | TimeFrequency | DecayFindings | DecayComparison | SqueakFindings | SqueakComparison
    )


SHOWN_EVENTS = 12
WHOLE = 28  # letters of a name that is not broken


def print_json(told: Mapping[str, Any]) -> None:
    """Results for a machine, which begin as results.json does: with what made them."""
    made = {"program": "stickslip", "version": ss.__version__, **told}
    click.echo(json.dumps(made, indent=2, ensure_ascii=False, allow_nan=False))


def show(
    results: Asked,
    written: Path | None,
    *,
    as_json: bool,
) -> None:
    if as_json:
        print_json(results.to_dict())
        return
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=False)
    parts = getattr(results, "findings", ())
    if isinstance(results, ss.SqueakComparison):  # a line each: the page has the rest
        _print_lines(console, parts)
        parts = ()
    for part in (*parts, results):
        _print_table(console, part)
    if written is not None:
        click.echo(f"Report: {written / 'report.html'}")


def _print_lines(console: Any, parts: Sequence[Asked]) -> None:
    from rich.markup import escape

    for part in parts:
        told = ss.summary(part)
        console.print(f"[bold]{escape(told.title)}[/bold]: {escape(spoken(told.headline[0]))}")


def _print_table(console: Any, results: Asked) -> None:
    from rich.markup import escape

    summary = ss.summary(results)
    console.print(f"\n[bold]{escape(summary.title)}[/bold]")
    faults = [f"- {fault}" for fault in summary.faults or () if fault not in summary.headline]
    for sentence in (*summary.headline, *summary.cautions, *faults):
        console.print(escape(spoken(sentence)))
    truth = summary.has_truth
    headings = ("quantity", "value", "95 % interval", *(["true value"] if truth else []), "how sure")
    rows = [
        [line.name, line.value, line.interval, *([line.true or "-"] if truth else []), line.status]
        for line in summary.lines
    ]
    if rows:
        console.print(table(headings, rows))
    for each in summary.tables:
        console.print(f"\n{escape(each.title)}")
        console.print(table(each.headings, each.rows))
        if each.note:
            console.print(f"[dim]{escape(each.note)}[/dim]")
    if summary.verdicts:
        console.print(table(("motion tried", "verdict"), summary.verdicts))
    for note in summary.notes:
        console.print(f"[dim]Note: {escape(spoken(note))}[/dim]")


def show_run(result: Outcome, written: Path | None, *, as_json: bool) -> None:
    if as_json:
        print_json(result.to_dict())
        return
    from rich.console import Console
    from rich.markup import escape

    console = Console(highlight=False, soft_wrap=False)
    console.print(f"\n[bold]{escape(result.case.name)}[/bold]  {escape(result.case.about)}")
    for sentence in result.sentences:
        console.print(escape(sentence))
    console.print(table(("quantity", "value"), result.rows))
    if result.known:
        answers = [(name, str(pair["known"]), str(pair["found"])) for name, pair in result.known.items()]
        console.print("\nKnown of this scenario, and what the engine finds:")
        console.print(table(("answer", "known", "found"), answers))
    count, events = result.run.event_counts().total(), list(itertools.islice(result.run.each_event(), SHOWN_EVENTS))
    if events:
        several = any(event.contact for event in events)
        rows = [
            (f"{event.time:.9g}", event.kind, *([str(event.contact + 1)] if several else []), event.mode)
            for event in events
        ]
        headings = ("time [s]", "event", *(["contact"] if several else []), "mode that begins")
        console.print("")
        console.print(table(headings, rows))
        if count > len(rows):
            click.echo(f"... and {count - len(rows)} more{', in events.csv' if written is not None else ''}")
    if written is not None:
        click.echo(f"Results: {written}")


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Any:
    from rich.markup import escape
    from rich.table import Table

    rows = list(rows)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for place, heading in enumerate(headings):
        whole = place == 0 and max((len(row[0]) for row in rows), default=0) <= WHOLE
        table.add_column(escape(heading), overflow="fold", no_wrap=whole)
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    return table
