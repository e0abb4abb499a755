"""stickslip thesis"""

from __future__ import annotations

import importlib
import itertools
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import click

import stickslip as ss
from stickslip.cli.options import result_options
from stickslip.cli.progress import progress
from stickslip.cli.terminal import aligned, say, say_json, wrapped

CHECKOUT = Path(ss.__file__).parents[2]
_ROW = ("place", "quantity", "verdict", "why")


@click.command()
@click.argument("chapters", nargs=-1, metavar="[CHAPTER]...")
@click.option(
    "--source",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Checkout of stickslip's source, whose thesis/ holds the chapters; needed where stickslip was not installed "
    "from one.",
)
@result_options("thesis-stickslip", short=False)
def thesis(chapters: tuple[str, ...], source: Path | None, output: Path | None, as_json: bool) -> None:
    """Reproduce the thesis: every printed number beside ours with a verdict, every figure beside its caption.

    All chapters, or those named: numbers and figures are computed from the printed parameters, and one page is
    written with results.json and the figures. Each number is the same, corrected, or not reproducible, with why.

    \b
    stickslip thesis
    stickslip thesis 6 --output chapter6

    The exit code is 1 where a verdict no longer holds.
    """
    pages = _pages(source or CHECKOUT)
    wanted = chapters or pages.CHAPTERS
    if strangers := [name for name in wanted if name not in pages.CHAPTERS]:
        raise click.BadParameter(f"'{strangers[0]}' is none of {', '.join(pages.CHAPTERS)}", param_hint="CHAPTER")
    folder = output or (None if as_json else Path("thesis-stickslip"))
    with progress(len(wanted) + 1) as tell:
        done = pages.reproduce(wanted, folder=folder, tell=tell)
    found = pages.results(done)
    if as_json:
        say_json(found)
    else:
        _show(found, done, folder)
    if found["verdicts"][pages.CHANGED]:
        raise SystemExit(1)


def _pages(source: Path) -> ModuleType:
    """The module that runs the chapters, of a checkout."""
    if not (source / "thesis" / "page.py").is_file():
        raise ss.errors.ModelError(
            f"{source} holds no thesis/",
            "the chapters stand in stickslip's source and are not installed with it",
            "get the source and name it with --source",
        )
    sys.path.insert(0, str(source.resolve()))
    return importlib.import_module("thesis.page")


def _show(found: dict[str, Any], done: tuple[Any, ...], folder: Path | None) -> None:
    rows = []
    others = (entry for entry in found["numbers"] if entry["verdict"] != "same")
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
    counts = [[chapter.name, *(str(chapter.counts[verdict]) for verdict in found["verdicts"])] for chapter in done]
    say("\n".join(aligned(("chapter", *found["verdicts"]), counts)))
    total = ", ".join(f"{count} {verdict}" for verdict, count in found["verdicts"].items() if count)
    say("\n".join(wrapped(f"{len(found['numbers'])} printed numbers: {total}.")))
    if folder is not None:
        say(f"Report: {folder / 'thesis.html'}")
