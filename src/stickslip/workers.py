"""Other processes to ask, where one would take too long."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

Map = Callable[..., Iterator[Any]]


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def unheard() -> None:
    """Leave Ctrl-C, which a terminal sends to every process, to the one that asks: it ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def workers(count: int, module: str, *, among: bool = False) -> Iterator[Map]:
    """`map` over so many processes, or in this one with fewer than two; results in order.

    The processes begin at once, with the import of `module`; `among` them this one works too, which saves it what
    another takes to begin. What is mapped, and over what, must be picklable. On an error or an interrupt what was not
    begun is dropped.
    """
    if count < 2:
        yield map
        return
    processes = pool(count - among, module)
    try:
        yield partial(_shared, processes) if among else processes.map
    finally:
        processes.shutdown(wait=False, cancel_futures=True)


def _shared(processes: ProcessPoolExecutor, function: Callable[[Any], Any], over: Iterable[Any]) -> Iterator[Any]:
    """`map` over these processes and this one, which takes the last that none has begun while the next is not done."""
    asked = list(over)
    futures, own, end = [processes.submit(function, one) for one in asked], dict[int, Any](), len(asked)
    for number, future in enumerate(futures):
        while number < end and not future.done() and futures[end - 1].cancel():
            end -= 1
            own[end] = function(asked[end])
        yield own.pop(number) if number >= end else future.result()


def pool(count: int, module: str) -> ProcessPoolExecutor:
    """So many processes, which begin at once with the import of `module`, and end with this one whatever ends it."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    # begun afresh and not forked: a fork of a process with compiled threads may hang
    processes = ProcessPoolExecutor(count, get_context("spawn"), initializer=_begin)
    with _silent():
        for _ in range(count):
            processes.submit(_load, module)  # a process begins with its first task
    return processes


def _begin() -> None:
    unheard()
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A process of a pool holds both ends of its queue: that the other side was killed it would never read there."""
    from multiprocessing import parent_process

    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


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
