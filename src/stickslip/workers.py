"""Other processes to ask, where one would take too long."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

Map = Callable[..., Iterator[Any]]


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def unheard() -> None:
    """Leave Ctrl-C, which a terminal sends to every process, to the one that asks: it ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def workers(count: int, module: str) -> Iterator[Map]:
    """`map` over so many processes, or in this one with fewer than two; results in order.

    The processes begin at once, with the import of `module`. What is mapped, and over what, must be picklable. On an
    error or an interrupt what was not begun is dropped.
    """
    if count < 2:
        yield map
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    # begun afresh and not forked: a fork of a process with compiled threads may hang
    pool = ProcessPoolExecutor(count, get_context("spawn"), initializer=unheard)
    with _silent():
        for _ in range(count):
            pool.submit(_load, module)  # a process begins with its first task
    try:
        yield pool.map
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _load(module: str) -> None:
    import_module(module)


@contextmanager
def _silent() -> Iterator[None]:
    """A Ctrl-C waits, and processes begun meanwhile are born without an ear for it, where the system has that."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
