"""How far a sweep is and how long it will take: on a terminal and in a notebook, silent anywhere else."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from threading import Timer
from typing import TYPE_CHECKING, Any

from stickslip.maps.plan import Arrays, Keep

if TYPE_CHECKING:
    from rich.console import Console

PATIENCE = 2.0  # s of silence before anything is shown
WIDTH = 30  # characters of a notebook's bar


@contextmanager
def told(keep: Keep, done: int, count: int) -> Iterator[Keep]:
    """`keep`, which also moves a bar of `count` blocks on, with the time left."""
    from rich.console import Console

    console = Console(stderr=True)
    if not (console.is_terminal or console.is_jupyter):
        yield keep
        return
    with _in_notebook(done, count) if console.is_jupyter else _on_terminal(console, done, count) as advance:

        def kept(number: int, arrays: Arrays, events: Arrays | None) -> None:
            keep(number, arrays, events)
            advance()

        yield kept


@contextmanager
def _on_terminal(console: Console, done: int, count: int) -> Iterator[Callable[[], object]]:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("blocks"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    bar = Progress(*columns, console=console, transient=True)
    task = bar.add_task("mapping", total=count, completed=done)
    patience = Timer(PATIENCE, bar.start)
    patience.daemon = True
    patience.start()
    try:
        yield lambda: bar.advance(task)
    finally:
        patience.cancel()
        bar.stop()


@contextmanager
def _in_notebook(done: int, count: int) -> Iterator[Callable[[], object]]:
    """One line of text under the cell that is written anew after each block, and cleared at the end."""
    from IPython.display import display

    begun, before, line = time.monotonic(), done, None

    def show(text: str) -> Any:
        data = {"text/plain": text}
        return display(data, raw=True, display_id=True) if line is None else line.update(data, raw=True)

    def advance() -> None:
        nonlocal done, line
        done, passed = done + 1, time.monotonic() - begun
        if passed >= PATIENCE:
            text = progress_line(done, count, passed=passed, left=passed * (count - done) / (done - before))
            line = show(text) or line

    try:
        yield advance
    finally:
        if line is not None:
            show("")


def progress_line(done: int, count: int, *, passed: float, left: float) -> str:
    """A bar of characters, the blocks done, and the time passed and left [s]."""
    full = WIDTH * done // count
    since, until = (str(timedelta(seconds=round(seconds))) for seconds in (passed, left))
    return f"mapping {'━' * full}{'─' * (WIDTH - full)} {done}/{count} blocks {since} left {until}"
