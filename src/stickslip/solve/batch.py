"""Many oscillators at once, one to a thread of a GPU or one after another on the CPU: the same compiled march."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import OPTIONS, compiled
from stickslip.errors import ModelError, SolveError
from stickslip.oscillator import Oscillator
from stickslip.solve.kernel import CHATTER, march, measure, settle
from stickslip.solve.phasors import phasors_of
from stickslip.solve.simulate import opening
from stickslip.solve.tables import DEGREE, Array, kind_of_drive, kind_of_law, opened, systems_of, tables_of

TIRELESS = 2**62  # cells: a batch is not interrupted
LAP = 64  # pieces remembered of each oscillator, a power of two; a lap of the drive with more has no fast path


@dataclass(frozen=True, eq=False)
class Batch:
    """The pieces of many motions; row i belongs to motion i.

    Attributes
    ----------
    counts : ndarray (B,)
        Number of pieces; what stands after them in a row has no meaning.
    statuses : ndarray (B,)
        DONE of :mod:`stickslip.solve.kernel`, or why a motion ended early: FULL, CHATTER, LOST, UNPROVED.
    laps, offsets, modes, durations : ndarray (B, P)
        Start of each piece as full periods and time within the period [s], number of its mode, length [s].
    states : ndarray (B, P, N)
        State at the start of each piece.
    exits : ndarray (B, P)
        Exit that ended each piece; -1 where the time was over.
    final : ndarray (B, N)
        State at the end.
    """

    counts: NDArray[np.int64]
    statuses: NDArray[np.int64]
    laps: NDArray[np.int32]
    offsets: Array
    modes: NDArray[np.int16]
    durations: Array
    states: Array
    exits: NDArray[np.int16]
    final: Array

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Everything the march writes."""
        return (self.counts, self.statuses, self.laps, self.offsets, self.modes, self.durations, self.states,
                self.exits, self.final)  # fmt: skip


def simulate_batch(
    systems: Sequence[Oscillator],
    *,
    cycles: float,
    starts: Sequence[Mapping[str, float | str]] | None = None,
    room: int = 1024,
    gpu: bool = False,
) -> Batch:
    """How do many oscillators with one kind of law move?

    Parameters
    ----------
    systems : sequence of Oscillator
        One for all starts, or one for each; their laws have the same modes, their drives at most one tone.
    cycles : float
        Time in periods of each one's drive; without a drive, in natural periods.
    starts : sequence of mapping, optional
        As in :func:`stickslip.solve.simulate.simulate`, one for each motion.
    room : int
        Most pieces of one motion.
    gpu : bool
        On an NVIDIA GPU, by numba-cuda, one motion to a thread.

    Returns
    -------
    Batch

    Raises
    ------
    ModelError
        The systems do not have one kind of law, or their number does not fit the starts.
    SolveError
        The GPU is wanted and not there.

    Examples
    --------
    >>> from stickslip.laws.coulomb import Coulomb
    >>> slider = Oscillator(mass=1, stiffness=4, law=Coulomb(1.0))
    >>> batch = simulate_batch([slider], cycles=2, starts=[{"x": 1.25}, {"x": 0.9}])
    >>> batch.counts, batch.final[:, 0].round(12)
    (array([3, 3]), array([ 0.25, -0.1 ]))
    """
    starts = list(starts) if starts is not None else [{}] * len(systems)
    if len(systems) not in (1, len(starts)):
        raise ModelError(f"{len(systems)} systems for {len(starts)} starts", "one for all, or one each", "match them")
    laws, drives = {kind_of_law(system.law) for system in systems}, {kind_of_drive(system.drive) for system in systems}
    if len(laws) > 1 or len(drives) > 1:
        raise ModelError("the systems have different modes", "a batch has one kind of law and drive", "split it")
    if None in laws or None in drives:
        raise ModelError("a law is curved, or a drive has knots or several tones",
                         "a batch runs through linear modes without stops", "run them one by one")  # fmt: skip
    tables = tables_of(systems_of(systems))
    size, count = len(tables.names), len(starts)
    which = np.zeros(count, np.int64) if len(systems) == 1 else np.arange(count)
    if any(starts):
        begun = [opening(tables.of(int(j)), start) for j, start in zip(which, starts, strict=True)]
        states, modes = np.array([state for state, _ in begun]), np.array([mode for _, mode in begun])
    else:
        states, modes = (part[which] for part in opened(tables, {}))
    ends = np.empty((len(systems), 2))
    for j, (period, system) in enumerate(zip(tables.period, systems, strict=True)):
        laps = float(math.floor(cycles)) if math.isfinite(period) else 0.0
        unit = period if math.isfinite(period) else 1 / system.frequency if system.frequency else math.nan
        ends[j] = laps, (cycles - laps) * unit
    if not np.all(np.isfinite(ends)):
        raise ModelError(f"cycles = {cycles}", "a system without period has no cycles", "give it a drive or a spring")
    given = which, modes, states, tables.period, ends, tables.linear, phasors_of(tables).tables
    out = Batch(
        np.zeros(count, np.int64), np.zeros(count, np.int64), np.empty((count, room), np.int32),
        np.empty((count, room)), np.empty((count, room), np.int16), np.empty((count, room)),
        np.empty((count, room, size)), np.empty((count, room), np.int16), np.empty((count, size)),
    )  # fmt: skip
    scratch = (np.zeros((count, 16, max(size, DEGREE + 1, 16))), np.full((2, count, LAP), -1), np.zeros((count, LAP)),
               np.ones((count, LAP), np.int64), np.zeros((count, 3), np.int64), np.zeros((count, 3)))  # fmt: skip
    (_on_gpu if gpu else _on_cpu)(given, out.arrays, scratch)
    return out


@compiled(**OPTIONS)
def slow_of(slow, j):
    """The tables of system j as :func:`stickslip.solve.kernel.march` reads them."""
    return (slow[0][j], slow[1][j], slow[2][j], slow[3][j], slow[4], slow[5], slow[6][j], slow[7], slow[8][j])


@compiled(**OPTIONS)
def fast_of(fast, j):
    """The tables of system j as :func:`stickslip.solve.phasors.glide` reads them."""
    return fast[0][j], fast[1][j], fast[2][j], fast[3][j], fast[4][j], fast[5][fast[6][j, 0] : fast[6][j, 1]]


@compiled(**OPTIONS)
def march_one(i, given, out, scratch):
    """Settle motion i and march it to its end."""
    which, modes, opened, periods, ends, slow, fast = given
    counts, statuses, laps, offsets, entered, durations, states, exits, final = out
    works, names, times, parts, rings, clocks = scratch
    j = which[i]
    tables, quick = slow_of(slow, j), fast_of(fast, j)
    past = (names[0, i], names[1, i], times[i], parts[i], rings[i])
    room = (laps[i], offsets[i], entered[i], durations[i], states[i], exits[i])
    work, state = works[i], final[i]
    n, degree = state.shape[0], tables[3].shape[1]
    limit = (ends[j, 0], ends[j, 1])
    total = limit[1] + (limit[0] * periods[j] if limit[0] > 0.0 else 0.0)
    for k in range(n):
        state[k] = opened[i, k]
    measure(tables[8], state, work[3], 0.0)
    cell = min(tables[1][modes[i]], total)
    mode = settle(tables, modes[i], state, work[3, :n], cell, work[:2, :n], work[4, :degree], work[5, :degree])
    status, count = CHATTER, 0
    if mode >= 0:
        clock, period = clocks[i], periods[j]
        status, count, mode = march(tables, quick, clock, state, mode, limit, period, past, room, work, TIRELESS)
    statuses[i], counts[i] = status, count


@compiled(**OPTIONS)
def _on_cpu(given, out, scratch):
    for i in range(given[0].shape[0]):
        march_one(i, given, out, scratch)


def _on_gpu(given: Any, out: Any, scratch: Any) -> None:
    try:
        from stickslip.solve.gpu import march_all
    except ImportError as absent:
        raise SolveError(
            "numba-cuda is not installed", "a GPU is driven by numba-cuda", 'pip install ".[gpu]" in the checkout'
        ) from absent
    march_all(given, out, scratch)
