"""The one door to the terminal: nothing that a file holds is obeyed there, as an escape sequence or as markup.

Also how the command line says what a sentence says to a Python user, and a bar for work that lasts.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import logging
import re
import shutil
import sys
import textwrap
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import click

from stickslip.printing import printable

WIDEST = 110  # columns: longer lines are hard to read
GAP, NARROW = 2, 6  # columns between two, and of the narrowest that is broken
WHOLE = 28  # letters of a name that is not broken


def say(text: object = "", *, err: bool = False) -> None:
    """Lines as they are."""
    click.echo(_shown(text, err=err), err=err)


def complain(sentence: object) -> None:
    """One line on the error stream, whatever line ends a file's name holds."""
    say(f"stickslip: {' '.join(str(sentence).split())}", err=True)


def say_json(results: Mapping[str, Any]) -> None:
    """Results for a machine; what can not be printed is spelled out, which leaves it JSON of the same value."""
    say(json.dumps(results, indent=2, ensure_ascii=False, allow_nan=False))


def say_styled(line: str, **style: Any) -> None:
    """A line in a style of :func:`click.style`, where it is a terminal that shows styles."""
    click.echo(click.style(_shown(line), **style) if style else _shown(line))


def wrapped(text: str, begin: str = "") -> list[str]:
    """A paragraph as lines of the terminal's width; the further ones stand under the first behind `begin`."""
    return textwrap.wrap(_shown(text), _width(), initial_indent=begin, subsequent_indent=" " * len(begin))


def aligned(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A table under its headings as lines; the widest columns are broken until it fits the terminal."""
    table = [[_shown(cell) for cell in row] for row in (headings, *rows)]
    widths = [max(1, *map(len, column)) for column in zip(*table, strict=True)]
    breakable = range(widths[0] <= WHOLE, len(widths))
    while sum(widths) + GAP * (len(widths) - 1) > _width():
        widest = max(breakable, key=lambda place: widths[place], default=0)
        if widths[widest] <= NARROW:
            break
        widths[widest] -= 1
    broken = ((textwrap.wrap(cell, width) for cell, width in zip(row, widths, strict=True)) for row in table)
    parts = (part for cells in broken for part in itertools.zip_longest(*cells, fillvalue=""))
    return [(GAP * " ").join(map(str.ljust, part, widths)).rstrip() for part in parts]


def _width() -> int:
    return min(WIDEST, shutil.get_terminal_size().columns)


def _shown(text: object, *, err: bool = False) -> str:
    stream = sys.stderr if err else sys.stdout
    return printable(str(text), encoding=getattr(stream, "encoding", None) or "utf-8")


PATIENCE = 2.0  # seconds of silence before a progress bar is shown


class _Spoken(logging.Handler):
    """What the package has to say of itself, on the error stream."""

    def emit(self, record: logging.LogRecord) -> None:
        """One line."""
        complain(record.getMessage())


@contextlib.contextmanager
def compiling() -> Iterator[None]:
    """Says to who watches that kernels are compiled, as it begins, and how long it took."""
    log, spoken = logging.getLogger("stickslip"), _Spoken(logging.INFO)
    if sys.stderr.isatty():
        log.addHandler(spoken)
        log.setLevel(logging.INFO)
    try:
        yield
    finally:
        kernels = sys.modules.get("stickslip.compiled")  # not imported for this: a command without kernels starts light
        if kernels is not None and kernels.compilation.seconds >= 1:
            log.info("compiled in %.0f s; the next run finds it", kernels.compilation.seconds)
        log.removeHandler(spoken)


@contextlib.contextmanager
def progress(steps: int) -> Iterator[Callable[..., None]]:
    """What is being done, on the error stream, for work that lasts; silent where nobody watches."""
    if not sys.stderr.isatty():
        yield lambda stage, done=None: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    column = TextColumn("{task.description}", markup=False)  # a file may be called "[/x].csv"
    columns = (SpinnerColumn(), column, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    task = bar.add_task("", total=steps)
    patience = threading.Timer(PATIENCE, bar.start)
    patience.daemon = True
    patience.start()
    if PATIENCE <= 0:
        patience.join()
    try:
        yield lambda stage, done=None: bar.update(task, completed=done, description=printable(stage), refresh=True)
    finally:
        patience.cancel()
        bar.stop()


@contextlib.contextmanager
def redrawn() -> Iterator[Callable[[Sequence[str]], None] | None]:
    """What draws lines in place of those before, on the error stream; None where nobody watches."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    with Live(console=Console(stderr=True), auto_refresh=False, transient=True) as live:
        yield lambda lines: live.update(Text("\n".join(lines), overflow="crop", no_wrap=True), refresh=True)


REPAIRS = {
    "repair_clock": "clock",
    "fill_gaps": "gaps",
    "fill_missing": "missing",
    "remove_spikes": "spikes",
    "restore_clipped": "clipping",
    "remove_drift": "drift",
}  # a function's name, and what --repair calls it
_SPOKEN = (
    (r"\b(the command line|the run) sets (\w+)", r"\1 sets --\2"),
    (r"\brecord\.check\(\)", "stickslip check"),
    (r"\brecord\.rows\(\)", "--rows"),
    (r"\brecord\.between\([^)]*\)", "--rows"),
    (r", or trust='samples'[^;.]*", ""),
    (r"\bask friction_loops\(record\)", "ask stickslip analyze"),
    (r", or ask (?:extreme|fit)_decay\(record\)[^;.]*", ""),
    (r', or choose form="plain"[^;.]*', ""),
    (r" \(see choose_motion\)", ""),
    (r"; use log_decrement or fit_decay instead", ""),
    (r'\brestoring="pendulum"', "--restoring pendulum"),
    (r"\brecord\.rows\((\d+), (\d+)\)", r"--rows \1:\2"),
    (r'\bchannel="(\w+)"', r"--channel \1"),
    (r'\bchannels=\{"(\w+)": "([^"]*)"\}', r'--channels "\1=\2"'),
    (r'\btime="([^"]*)"', r'--time "\1"'),
    (r'\bfriction_force\(record, \.\.\., method="(\w+)"\)', r"--method \1"),
    (
        r"\b(channels|channel|frequencies|normal|rows|units|fs|time|delimiter|decimal|method|damper|contact|mass|stiffness|lever|calibration)=(?=\W|$)",
        r"--\1",
    ),
)


def spoken(sentence: object) -> str:
    """A sentence with the options of the command line for what it says of Python."""

    def repair(call: re.Match[str]) -> str:
        word = REPAIRS.get(call[1])
        return call[0] if word is None else f"--repair {word}" + (f":{call[2]}" if call[2] else "")

    text = re.sub(r"\bfill_gaps\(record\) and fill_missing\(record\)", "--repair gaps,missing", str(sentence))
    text = re.sub(r'\b(\w+)\(record(?:, "(\w+)")?\)', repair, text)
    for said, option in _SPOKEN:
        text = re.sub(said, option, text)
    return text
