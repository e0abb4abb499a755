"""Why a run is given up, in the same words for tables of linear modes and for curved laws; and when Ctrl-C ends it:
between two chunks of a march, not within one.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

import numpy as np

from stickslip.errors import SolveError
from stickslip.solve.tables import Array


def named(names: Sequence[str], state: Array) -> str:
    """The first entries of a state, by name."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in zip(names, state, strict=False))


class Endless(SolveError):
    """A law's modes follow one another without end while no time passes: what fails is the law, not a motion."""


def chatter(modes: Sequence[str], place: str) -> Endless:
    """Modes that follow one another without end while no time passes."""
    return Endless(
        f"transitions without time between the modes {_listed(modes)}, {place}",
        "a law leaves every state in one direction, or has a mode that holds the mass there",
        "check the law's exits there; a mode with friction=None holds the mass",
    )


def _listed(modes: Sequence[str]) -> str:
    return " and ".join(f"'{mode}'" for mode in dict.fromkeys(modes))


def unproved(place: str) -> SolveError:
    """A first exit without its certificate."""
    return SolveError(
        f"an exit that can not be told from a tangency, {place}",
        "the first exit of a mode is certified",
        "check the law's exits there, or start a little beside",
    )


def require_numbers(state: Array, place: str) -> None:
    """Refuse a motion that has outgrown the numbers."""
    if not np.all(np.isfinite(state)):
        raise SolveError(
            f"motion beyond the largest number, {place}",
            "a motion is finite",
            "simulate a shorter time; a negative damping or slope makes it grow",
        )


def require_budget(events: int, *, passed: float, scale: float, budget: int, state: str, modes: Sequence[str]) -> None:
    """Refuse more than `budget` events in a period of `scale` [s], counted over the time `passed` [s]; the `modes` of
    the last pieces are named."""
    if events > budget * max(1.0, passed / scale):
        raise SolveError(
            f"{events} events within {passed:g} s, the last between {_listed(modes)}, at {state}",
            f"a period of {scale:g} s has at most {budget} events",
            "check the law there (chatter), or raise budget=",
        )


@contextmanager
def held_back() -> Iterator[Callable[[], None]]:
    """A first Ctrl-C waits until the block is done, or calls what it is given; a second comes at once.

    While numba hands one compiled function to another it takes an interrupt for an error of its own.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield lambda: None
        return
    heard: list[tuple[int, FrameType | None]] = []

    def hear(number: int, frame: FrameType | None) -> None:
        if heard:
            handler(number, frame)
        heard.append((number, frame))

    def heed() -> None:
        if heard:
            handler(*heard.pop())

    signal.signal(signal.SIGINT, hear)
    try:
        yield heed
    finally:
        signal.signal(signal.SIGINT, handler)
    heed()
