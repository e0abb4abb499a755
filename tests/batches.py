"""The compiled march of many oscillators, piece by piece: on the CPU, or one to a thread of a GPU."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import OPTIONS, compiled
from stickslip.errors import ModelError
from stickslip.maps.crowd import pasts
from stickslip.maps.watch import TIRELESS, model_of, past_of
from stickslip.oscillator import Oscillator
from stickslip.solve.assembly import tables_of
from stickslip.solve.glide import Clock, Model, Past, Pieces
from stickslip.solve.kernel import CHATTER, begin, march, scratch
from stickslip.solve.phasors import phasors_of
from stickslip.solve.simulate import opening
from stickslip.solve.tables import Array, kind_of_drive, kind_of_law, opened, systems_of


class Batch(NamedTuple):
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
    """
    starts = list(starts) if starts is not None else [{}] * len(systems)
    if len(systems) not in (1, len(starts)):
        raise ModelError(f"{len(systems)} systems for {len(starts)} starts", "one for all, or one each", "match them")
    laws, drives = {kind_of_law(system.law) for system in systems}, {kind_of_drive(system.drive) for system in systems}
    if len(laws) > 1 or len(drives) > 1:
        raise ModelError("the systems have different modes", "a batch has one kind of law and drive", "split it")
    if None in laws or None in drives:
        raise ModelError(
            "a law is curved, or a drive has knots or several tones",
            "a batch runs through linear modes without stops",
            "run them one by one",
        )
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
    given = Given(which, modes, states, ends, Model(tables.linear, phasors_of(tables), tables.period))
    out = Batch(
        np.zeros(count, np.int64),
        np.zeros(count, np.int64),
        np.empty((count, room), np.int32),
        np.empty((count, room)),
        np.empty((count, room), np.int16),
        np.empty((count, room)),
        np.empty((count, room, size)),
        np.empty((count, room), np.int16),
        np.empty((count, size)),
    )
    works = np.zeros((count, *scratch(size).shape))
    if gpu:
        from batches_gpu import march_all  # where numba-cuda is
    else:
        march_all = _on_cpu
    march_all(given, out, Rooms(works, pasts(count)))
    return out


class Given(NamedTuple):
    """What a batch is asked: of each motion its system, mode and state at the start, of each system the laps and time
    within the lap at its end, and what moves, with a leading axis."""

    which: NDArray[np.int64]
    modes: NDArray[np.int64]
    states: Array
    ends: Array
    models: Model


class Rooms(NamedTuple):
    """Scratch and past of each motion that is under way, with a leading axis."""

    works: Array
    pasts: Past


@compiled(**OPTIONS)
def march_one(i, given, out, rooms):
    """Settle motion i and march it to its end."""
    j = given.which[i]
    model, past, work, state = model_of(given.models, j), past_of(rooms.pasts, i), rooms.works[i], out.final[i]
    pieces = Pieces(out.laps[i], out.offsets[i], out.modes[i], out.durations[i], out.states[i], out.exits[i])
    limit = Clock(given.ends[j, 0], given.ends[j, 1], 0.0)
    total = limit.time + (limit.laps * model.period if limit.laps > 0.0 else 0.0)
    for k in range(state.shape[0]):
        state[k] = given.states[i, k]
    status, count, mode = CHATTER, 0, begin(model.linear, given.modes[i], state, total, 0.0, work)
    if mode >= 0:
        clock = Clock(0.0, 0.0, 0.0)
        status, count, mode, clock = march(model, clock, state, mode, limit, past, pieces, work, TIRELESS)
    out.statuses[i], out.counts[i] = status, count


@compiled(**OPTIONS)
def _on_cpu(given, out, rooms):
    for i in range(given.which.shape[0]):
        march_one(i, given, out, rooms)
