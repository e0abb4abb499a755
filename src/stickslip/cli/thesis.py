"""stickslip thesis"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from operator import itemgetter
from pathlib import Path
from typing import Any

import click

from stickslip.cli.records import result_options
from stickslip.cli.terminal import aligned, progress, say, say_json, wrapped

_ROW = ("place", "quantity", "verdict", "why")


@click.command()
@click.argument("chapters", nargs=-1, metavar="[CHAPTER]...")
@result_options("thesis-stickslip")
def thesis(chapters: tuple[str, ...], output: Path | None, as_json: bool, everything: bool) -> None:
    """Reproduce the thesis: every printed number beside ours with a verdict, every figure beside its caption.

    All chapters, or those named: numbers and figures are computed from the printed parameters, and one page is
    written with results.json and the figures. Each number has one of seven verdicts (same, put in,
    corrected, ambiguous, contradicts itself, not printed, ours differs), with why.

    \b
    stickslip thesis
    stickslip thesis 6 --output chapter6

    Beside each figure stands what the text says that one should see, ticked where a number of ours shows it. The exit
    code is 1 where a verdict no longer holds, or something is no longer seen.
    """
    import stickslip_thesis.page as pages  # the chapters compute and draw: they take a second to load

    wanted = chapters or tuple(pages.CHAPTERS)
    if strangers := [name for name in wanted if name not in pages.CHAPTERS]:
        raise click.BadParameter(f"'{strangers[0]}' is none of {', '.join(pages.CHAPTERS)}", param_hint="CHAPTER")
    folder = output or (None if as_json else Path("thesis-stickslip"))
    with progress(len(wanted) + 1) as tell:
        done = pages.reproduce(wanted, folder=folder, tell=tell)
    results = pages.results(done)
    if as_json:
        say_json(results)
    else:
        _show(results, done, folder, everything=everything)
    if not pages.holds(results):
        raise SystemExit(1)


def _show(results: dict[str, Any], done: tuple[Any, ...], folder: Path | None, *, everything: bool) -> None:
    verdicts = {verdict: count for verdict, count in results["verdicts"].items() if count}
    say("\n".join(wrapped(f"{sum(verdicts.values())} printed numbers: {_counted(verdicts)}.")))
    unseen = [entry for entry in results["seen"] if not entry["seen"]]
    if results["seen"]:
        count = len(results["seen"])
        say(f"Of {count} things that the text says one should see, {count - len(unseen)} are seen.")
    say("")
    counts = [[chapter.name, str(sum(chapter.counts.values())), _counted(chapter.counts)] for chapter in done]
    say("\n".join(aligned(("chapter", "numbers", "verdicts"), counts)))
    for entry in unseen:
        say("\n".join(wrapped(f"Not seen: {entry['says']} ({entry['section']}): {entry['why']}")))
    others = [entry for entry in results["numbers"] if entry["verdict"] != "same"]
    if everything and others:
        say("")
        say("\n".join(aligned(("number", "printed", "ours", "verdict", "why"), list(_rows(others)))))
    elif others:
        say(f"More with --all: the {len(others)} numbers that are not the same, each with why.")
    if folder is not None:
        say(f"Report: {folder / 'thesis.html'}")


def _counted(verdicts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items() if count)


def _rows(numbers: Iterable[Mapping[str, Any]]) -> Iterator[list[str]]:
    """A row for those of one place that have one verdict for one reason."""
    for (place, quantity, verdict, why), group in itertools.groupby(numbers, key=itemgetter(*_ROW)):
        first, *more = group
        entry, others = f", {first['entry']}" * bool(first["entry"]), f" and {len(more)} more" * bool(more)
        ours = "-" if first["ours"] is None else f"{first['ours']:.4g}"
        yield [f"{place}: {quantity}{entry}{others}", first["printed"], ours, verdict, why]
