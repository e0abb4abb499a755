"""Why a run is given up, in the same words for tables of linear modes and for curved laws; and when Ctrl-C ends it:
between two chunks of a march, not within one.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import SolveError

if TYPE_CHECKING:
    from stickslip.solve.tables import Tables
    from stickslip.solve.tape import Tape


def named(names: Sequence[str], state: Array) -> str:
    """The first entries of a state, by name."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in zip(names, state, strict=False))


LISTED = 4  # modes that an error names
LARGEST = 1e150  # of an entry of the state, whose square is a number still


class Endless(SolveError):
    """A law's modes follow one another without end while no time passes: what fails is the law, not a motion."""


def chatter(modes: Sequence[str], place: str) -> Endless:
    """Modes that follow one another without end while no time passes."""
    return Endless(
        f"transitions without time between the modes {_listed(modes)}, {place}",
        "a law leaves every state in one direction, or has a mode that holds the mass there",
        "check the law's exits there; a mode with friction=None holds the mass, and two slips that end in each other "
        "at one velocity, without a reset, are given one",
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


class Outgrown(SolveError):
    """A motion that has outgrown the numbers."""


def require_numbers(state: Array, place: str) -> None:
    """Refuse a motion that has outgrown the numbers."""
    if not np.all(np.abs(state) < LARGEST):
        raise Outgrown(
            f"motion beyond the largest number that has a square, {place}",
            "a motion is finite",
            "simulate a shorter time; a negative damping or slope makes it grow",
        )


class Budget:
    """Events that a run may still have: `most` in each period of `scale` [s], and as many ahead of the time.

    Lives for one run. A change of mode that is no event to the contact, as from one line of a table of speeds to the
    next, takes a small part of one, so that a run that does nothing else ends as well.
    """

    SILENT = 1e-3

    def __init__(self, table: Tables | Tape, *, scale: float, most: int) -> None:
        self.table, self.scale, self.most = table, scale, most
        self.owed = self.since = 0.0

    def spend(self, exits: NDArray[np.int16], *, passed: float, state: Array) -> None:
        """Take the events by which a stretch of `passed` [s] went on; refuse the run where they are too many."""
        income = self.most * passed / self.scale
        if not self.owed and np.count_nonzero(exits >= 0) <= income:
            return
        numbers, counts = np.unique(exits[exits >= 0], return_counts=True)
        weights = [self.SILENT if self._silent(int(leaving)) else 1.0 for leaving in numbers]
        self.owed, self.since = max(0.0, self.owed + float(counts @ weights) - income), self.since + passed
        if self.owed > self.most:
            entered = self.table.target[exits[exits >= 0][-LISTED:]]
            raise SolveError(
                f"{self.owed + self.most * self.since / self.scale:.0f} events within {self.since:g} s, the last into "
                f"{_listed([self.table.modes[int(mode)].name for mode in entered])}, at "
                f"{named(self.table.names[: self.table.physical], state)}",
                f"a period of {self.scale:g} s has at most {self.most} events",
                "check the law there (chatter), or raise budget=",
            )
        self.since = self.since if self.owed else 0.0

    def _silent(self, leaving: int) -> bool:
        """Whether an exit changes neither the kind nor the side of any contact."""
        table = self.table
        left = int(np.searchsorted(table.first, leaving, side="right")) - 1
        before: Any = table.modes[left]
        after: Any = table.modes[int(table.target[leaving])]
        changes = after.changes(before, leaving - int(table.first[left]))
        return all((old.kind, old.side) == (new.kind, new.side) for _, old, new in changes)


_work = threading.local()


def ended_by(ended: threading.Event) -> None:
    """Have :func:`heed` end what this thread works on: Ctrl-C is heard by the main thread alone."""
    _work.ended = ended


def heed() -> None:
    """End the work of this thread where it is wanted no more."""
    if hasattr(_work, "ended") and _work.ended.is_set():
        raise KeyboardInterrupt


@contextmanager
def held_back() -> Iterator[Callable[[], None]]:
    """A first Ctrl-C waits until the block is done, or calls what it is given; a second comes at once.

    While numba hands one compiled function to another it takes an interrupt for an error of its own.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield heed
        return
    heard: list[tuple[int, FrameType | None]] = []

    def hear(number: int, frame: FrameType | None) -> None:
        if heard:
            handler(number, frame)
        heard.append((number, frame))

    def pass_on() -> None:
        if heard:
            handler(*heard.pop())

    signal.signal(signal.SIGINT, hear)
    try:
        yield pass_on
    finally:
        signal.signal(signal.SIGINT, handler)
        pass_on()  # though the block ended in an error, which the next block may get over
