"""stickslip thesis"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import click

from stickslip.cli.options import result_options
from stickslip.cli.terminal import aligned, progress, say, say_json, wrapped

_ROW = ("place", "quantity", "verdict", "why")


@click.command()
@click.argument("chapters", nargs=-1, metavar="[CHAPTER]...")
@result_options("thesis-stickslip", short=False)
def thesis(chapters: tuple[str, ...], output: Path | None, as_json: bool) -> None:
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
        _show(results, done, folder)
    if not pages.holds(results):
        raise SystemExit(1)


def _show(results: dict[str, Any], done: tuple[Any, ...], folder: Path | None) -> None:
    rows = []
    others = (entry for entry in results["numbers"] if entry["verdict"] != "same")
    for key, group in itertools.groupby(others, key=lambda entry: [entry[name] for name in _ROW]):
        entries = list(group)
        label = f", {entries[0]['entry']}" * bool(entries[0]["entry"]) + f" and {len(entries) - 1} more" * (
            len(entries) > 1
        )
        ours = entries[0]["ours"]
        rows.append(
            [f"{key[0]}: {key[1]}{label}", entries[0]["printed"], "-" if ours is None else f"{ours:.4g}", *key[2:]]
        )
    if rows:
        say("\n".join(aligned(("number", "printed", "ours", "verdict", "why"), rows)))
    counts = [[chapter.name, *(str(chapter.counts[verdict]) for verdict in results["verdicts"])] for chapter in done]
    say("\n".join(aligned(("chapter", *results["verdicts"]), counts)))
    total = ", ".join(f"{count} {verdict}" for verdict, count in results["verdicts"].items() if count)
    say("\n".join(wrapped(f"{sum(results['verdicts'].values())} printed numbers: {total}.")))
    if results["seen"]:
        ticked = sum(one["seen"] for one in results["seen"])
        say(f"Of {len(results['seen'])} things that the text says one should see, {ticked} are seen.")
        unseen = [
            f"not seen: {one['says']} ({one['section']}): {one['why']}" for one in results["seen"] if not one["seen"]
        ]
        say("\n".join(line for text in unseen for line in wrapped(text)))
    if folder is not None:
        say(f"Report: {folder / 'thesis.html'}")
