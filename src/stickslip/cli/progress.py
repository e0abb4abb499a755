"""A progress bar for work that lasts."""

from __future__ import annotations

import contextlib
import logging
import sys
import threading
from collections.abc import Callable, Iterator

from stickslip.cli.terminal import complain
from stickslip.printing import printable

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
        yield lambda words, done=None: None
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
        yield lambda words, done=None: bar.update(task, completed=done, description=printable(words), refresh=True)
    finally:
        patience.cancel()
        bar.stop()
