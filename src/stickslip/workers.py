"""Other processes to ask, where one would take too long."""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING, Any

from stickslip.errors import StickslipError

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor

FEW = 2  # tasks left, above which each process has its next one waiting while this one works
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
    from concurrent.futures import BrokenExecutor

    processes = pool(count - among, module)
    try:
        yield partial(_shared, processes, count - 1, processes.submit(_load, module)) if among else processes.map
    except BrokenExecutor as error:
        raise StickslipError(
            "another process ended before its work was done",
            "each of them imports the script that asks for them, and needs its own memory",
            'ask under if __name__ == "__main__":, or for fewer processes',
        ) from error
    finally:
        processes.shutdown(wait=False, cancel_futures=True)


def _shared(
    processes: ProcessPoolExecutor, count: int, ready: Future[None], function: Callable[[Any], Any], over: Iterable[Any]
) -> Iterator[Any]:
    """`map` over so many processes, once they are ready, and this one, which takes the last of what they have not.

    Nothing is taken back from them: of a pool that breaks the end would be waited for for ever.
    """
    from concurrent.futures import FIRST_COMPLETED, wait

    waiting, number, done = deque(enumerate(over)), 0, dict[int, Any]()
    running: dict[int, Future[Any]] = {}
    while waiting or running or done:
        while waiting and ready.done() and len(running) < count + (len(waiting) > FEW):
            place, one = waiting.popleft()
            running[place] = processes.submit(function, one)
        for place in [place for place, future in running.items() if future.done()]:
            done[place] = running.pop(place).result()
        while number in done:
            yield done.pop(number)
            number += 1
        if waiting:
            place, one = waiting.pop()
            done[place] = function(one)
        elif running:
            wait(running.values(), return_when=FIRST_COMPLETED)


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
