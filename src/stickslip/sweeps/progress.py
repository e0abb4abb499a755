"""How far a sweep is and how long it will take: on a terminal and in a notebook, silent anywhere else."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

from stickslip.sweeps.plan import Arrays, Keep

PATIENCE = 2.0  # s of silence before anything is shown


@contextmanager
def told(keep: Keep, done: int, count: int) -> Iterator[Keep]:
    """`keep`, which also moves a bar of `count` blocks on, with the time left."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    if not (console.is_terminal or console.is_jupyter):
        yield keep
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("blocks"),
               TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())  # fmt: skip
    bar = Progress(*columns, console=console, transient=True)
    task = bar.add_task("mapping", total=count, completed=done)
    patience = Timer(PATIENCE, bar.start)
    patience.daemon = True
    patience.start()

    def kept(number: int, arrays: Arrays, events: Arrays | None) -> None:
        keep(number, arrays, events)
        bar.advance(task)

    try:
        yield kept
    finally:
        patience.cancel()
        bar.stop()
