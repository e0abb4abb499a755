"""A progress bar for work that lasts."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Callable, Iterator

from stickslip.printing import printable

PATIENCE = 2.0  # seconds of silence before a progress bar is shown


@contextlib.contextmanager
def progress(steps: int) -> Iterator[Callable[[str, float], None]]:
    """What is being done, on the error stream, for work that lasts; silent where nobody watches."""
    if not sys.stderr.isatty():
        yield lambda words, done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    words = TextColumn("{task.description}", markup=False)  # a file may be called "[/x].csv"
    columns = (SpinnerColumn(), words, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    task = bar.add_task("", total=steps)
    patience = threading.Timer(PATIENCE, bar.start)
    patience.daemon = True
    patience.start()
    if PATIENCE <= 0:
        patience.join()
    try:
        yield lambda words, done: bar.update(task, completed=done, description=printable(words), refresh=True)
    finally:
        patience.cancel()
        bar.stop()
