"""The motion under a curved law: Taylor series, and long implicit steps where the contact is stiff.

Between events the motion is analytic, so each step is the Taylor polynomial of the state itself: the dense output is
the step, and exits are searched on it with the same certificate as in the exact engine. Steps are as long as the
tolerance allows: the last two terms of every entry's series, relative to the largest value that the entry has had.

Where a rate of the contact is far above the motion's own (stiff bristles, rate-and-state friction at creep speed),
Taylor steps are about order/3 over that rate, however smooth the motion. After some hundreds of them a leap by
collocation is tried, to the same tolerance and with the same exits; leaps go on while each is worth its cost.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import ModelError, SolveError
from stickslip.solve import collocation, march
from stickslip.solve.interrupts import held_back
from stickslip.solve.refusal import chatter, named, require_budget, require_numbers, unproved
from stickslip.solve.series import expansion
from stickslip.solve.tape import Tape
from stickslip.solve.trajectory import Trajectory

Array = NDArray[np.float64]
March = Callable[..., tuple[int, int, int, int]]  # of clock, state, mode, until, and what follows in `march.march`
Stops = Iterable[tuple[tuple[float, float], tuple[Any, Any]]]

LOW, HIGH = 14, 18  # orders: few, since each is compiled, and near the best for any tolerance
SHARE = 0.02  # of the tolerance is what a step may take: a hundred periods then stay within the tolerance
CHUNK, LEAPS = 4096, 256  # steps and leaps between two looks at the clock and the keyboard
PATIENCE, STEPS = 200_000, 200_000_000  # steps before a run's number of steps is foretold, and the most there may be


@dataclass(frozen=True, eq=False, repr=False)
class CurvedTrajectory(Trajectory):
    """A simulated motion under a curved law: Taylor polynomials between events.

    Attributes
    ----------
    step_starts, step_lengths : ndarray (S,)
        Start and length of each step [s].
    step_modes : ndarray (S,)
        Number of each step's mode.
    step_states : ndarray (S, N)
        State at the start of each step.
    step_leaps : ndarray (S,)
        Number of the step among the leaps; -1 for a Taylor step.
    leaps : ndarray (L, N, 10)
        Each leap's state as polynomials of w, -1 at its start and 1 after `reach`.
    reach : ndarray (L,)
        Time from w = -1 to w = 1 [s].
    order : int
        Degree of the Taylor polynomials.
    """

    step_starts: Array
    step_lengths: Array
    step_modes: NDArray[np.int64]
    step_states: Array
    step_leaps: NDArray[np.int64]
    leaps: Array
    reach: Array
    order: int

    @property
    def corners(self) -> Array:
        """State at the start of each step (S, N)."""
        return self.step_states

    def end(self) -> tuple[Array, int]:
        """State and mode at the end; returns as of :meth:`Trajectory.end`."""
        table: Any = self.table
        last, leaving = self.states[0].copy(), int(self.exits[-1])
        last[: table.physical] = self.sample([self.duration], ("state",))[0][:, 0]
        return last, int(self.modes[-1]) if leaving < 0 else int(table.exits[1][leaving])

    @property
    def cells(self) -> tuple[Array, Array]:
        """Start and length [s] of the steps."""
        return self.step_starts, self.step_lengths

    def sample(self, times: ArrayLike, outputs: tuple[str, ...]) -> tuple[Array, NDArray[np.int64]]:
        """Values at increasing instants; parameters and returns as of :meth:`Trajectory.sample`."""
        times = np.ascontiguousarray(times, dtype=np.float64)
        if len(times) and not (times[0] >= 0 and times[-1] <= self.duration * (1 + 1e-12)):
            raise SolveError(
                f"instants from {times[0]:g} to {times[-1]:g} s",
                f"the motion is known from 0 to {self.duration:g} s",
                "simulate longer, or ask within it",
            )
        table: Any = self.table
        names = [n for name in outputs for n in (table.names[: table.physical] if name == "state" else (name,))]
        nodes = np.column_stack([table.places[name] for name in names])
        out, step = np.empty((len(names), len(times))), np.empty(len(times), dtype=np.int64)
        count = int(np.max(np.diff(table.watched[8])))
        march.sample(
            *_viewed(table, self.order), self.order, self.step_starts, self.step_lengths, self.step_modes,
            self.step_states, self.step_leaps, self.leaps, self.reach, times, nodes, out, step,
            (np.empty(count * (self.order + 1)), np.empty(self.step_states.shape[1]), np.empty(count)),
        )  # fmt: skip
        piece = np.searchsorted(self.starts, self.step_starts[step], side="right") - 1
        return out, piece

    def labels(self, name: str) -> tuple[str, ...]:
        """What the rows of an output are called: its name."""
        return (name,)


def degree(rtol: float) -> int:
    """Degree of the polynomials for a tolerance."""
    if not 1e-15 <= rtol <= 1e-2:
        raise ModelError(f"rtol = {rtol}", "the tolerance lies between 1e-15 and 1e-2", "give rtol=1e-12, or 1e-8")
    return LOW if rtol > 1e-10 else HIGH


class Code(NamedTuple):
    """Code of a system, by address: Taylor coefficients with their numbers, rates alone; and the leaps' method."""

    series: int
    numbers: Array
    rates: int
    scheme: tuple[Array, Array, Array]


@lru_cache(maxsize=32)
def code(table: Tape, order: int) -> Code:
    """The code that steps of an order need."""
    rates, _ = expansion(table.nodes, table.kept, 1)
    return Code(*expansion(table.nodes, table.kept, order), rates, collocation.method())


@lru_cache(maxsize=32)
def _viewed(table: Tape, order: int) -> tuple[int, Array, int, Array]:
    """The code that values between the steps need, and that of the outputs."""
    series, numbers, *_ = code(table, order)
    return series, numbers, *expansion(table.watched, table.shown, 0)


def _march(table: Tape, order: int) -> March:
    own = code(table, order)

    def follow(clock: Array, state: Array, mode: int, at: tuple[float, float], *rest: Any) -> tuple[int, int, int, int]:
        return march.march(  # type: ignore[no-any-return]
            *own, table.sums, table.exits, table.guards, table.tones, clock, state, mode, at, table.motion.period, *rest
        )  # fmt: skip

    return follow


def run_curved(
    table: Tape,
    state: Array,
    mode: int,
    *,
    course: tuple[tuple[float, float], Stops],
    budget: int,
    rtol: float,
    tell: Callable[[float], None],
    follow: March | None = None,
) -> CurvedTrajectory:
    """March from a state at time 0 to the end of the course's time (laps, offset), in chunks."""
    (laps, offset), stops = course
    order = degree(rtol)
    follow = follow or _march(table, order)
    system, size, period = table.system, len(table.names), table.motion.period
    count = int(np.max(np.diff(table.nodes[8])))
    work = (np.zeros(count * (order + 1)), np.zeros(order + 1), np.zeros(order + 1))
    long_work = collocation.room(count, size, table.physical)
    total = offset + (laps * period if math.isfinite(period) else 0.0)
    scale = min(period if math.isfinite(period) else 1 / system.frequency if system.stiffness else total, total)
    clock = np.array([0.0, 0.0, 1e-6 * scale, 0.0, 0.0, march.PATIENCE])
    state, big = state.copy(), np.abs(state)
    kept: list[tuple[NDArray[Any], ...]] = []
    leaps: list[tuple[Array, Array]] = []
    status = "complete"
    try:
        for at, (signals, values) in stops:
            state[signals] = values
            clock[2] = min(clock[2], scale)  # at rest steps would grow for ever
            outcome = march.FULL
            while outcome == march.FULL:
                room, (polys, reach) = room_for(CHUNK, size), _room_of_leaps(size)
                before = clock.copy()
                with held_back() if kept else nullcontext():  # the first call may compile for long
                    outcome, written, leapt, mode = follow(
                        clock, state, mode, at, table.physical, SHARE * rtol, order, big, room, polys, reach, work,
                        long_work,
                    )  # fmt: skip
                if written:
                    room[6][:written][room[6][:written] >= 0] += sum(len(part[1]) for part in leaps)
                    kept.append(tuple(column[:written] for column in room))
                    leaps.append((polys[:leapt].copy(), reach[:leapt].copy()))
                passed = clock[1] - before[1] + ((clock[0] - before[0]) * period if clock[0] != before[0] else 0.0)
                ahead = total - clock[1] - (clock[0] * period if clock[0] else 0.0)
                _refuse(outcome, table, state, clock, passed, ahead, CHUNK * len(kept))
                require_budget(
                    int(np.sum(room[5][:written] >= 0)), passed=passed, scale=scale, budget=budget,
                    state=named(table.names[: table.physical], state),
                )  # fmt: skip
                tell(1.0 - ahead / total)
    except KeyboardInterrupt:
        if not kept:
            raise
        status = "interrupted"
        lap, offset, length = (float(column[-1]) for column in kept[-1][:3])
        total = offset + length + (lap * period if math.isfinite(period) else 0.0)
    if status == "complete":
        tell(1.0)
        own = code(table, order)
        status = "at rest" if march.rests(own.series, own.numbers, mode, state, order, work[0]) else status
    return _assembled(table, kept, leaps, total, status, order)


def room_for(count: int, size: int) -> tuple[NDArray[Any], ...]:
    """Columns of steps: laps, offset, length, mode, state, exit, number among the leaps."""
    return (np.empty(count), np.empty(count), np.empty(count), np.empty(count, np.int64), np.empty((count, size)),
            np.empty(count, np.int16), np.empty(count, np.int64))  # fmt: skip


def _room_of_leaps(size: int) -> tuple[Array, Array]:
    return np.empty((LEAPS, size, collocation.WIDTH)), np.empty(LEAPS)


def _assembled(
    table: Tape,
    kept: list[tuple[NDArray[Any], ...]],
    leaps: list[tuple[Array, Array]],
    total: float,
    status: str,
    order: int,
) -> CurvedTrajectory:
    """Steps gathered, and pieces from event to event."""
    laps, offsets, lengths, modes, states, ends, which = (np.concatenate(column) for column in zip(*kept, strict=True))
    first = np.flatnonzero(np.concatenate([[True], ends[:-1] >= 0]))
    last = np.append(first[1:], len(ends)) - 1
    period = table.motion.period
    return CurvedTrajectory(
        system=table.system,
        table=table,  # type: ignore[arg-type]
        laps=laps[first].astype(np.int32),
        offsets=offsets[first],
        modes=modes[first].astype(np.int16),
        durations=np.add.reduceat(lengths, first),
        kept=states[first],
        exits=ends[last],
        duration=total,
        status=status,
        step_starts=offsets + (laps * period if math.isfinite(period) else 0.0),
        step_lengths=lengths,
        step_modes=modes,
        step_states=states,
        step_leaps=which,
        leaps=np.concatenate([part[0] for part in leaps]),
        reach=np.concatenate([part[1] for part in leaps]),
        order=order,
    )


def _refuse(outcome: int, table: Tape, state: Array, clock: Array, passed: float, ahead: float, done: int) -> None:
    place = f"lap {clock[0]:g}, {clock[1]:g} s, at {named(table.names[: table.physical], state)}"
    if outcome == march.CHATTER:
        raise chatter(place)
    if outcome == march.UNPROVED:
        raise unproved(place)
    if outcome == march.STALL:
        raise SolveError(
            f"a step of no length, {place}",
            "friction and its rates are finite and smooth within a mode",
            "check the law there (a logarithm or a power of nothing)",
        )
    if outcome == march.FULL and done >= PATIENCE and passed * STEPS < CHUNK * ahead:
        raise SolveError(
            f"steps of {passed / CHUNK:.1e} s with {ahead:g} s ahead, {place}",
            f"a run takes at most {STEPS:g} steps; the contact is far faster here than the motion",
            "take a larger mass, a larger rtol=, or a shorter time",
        )
    require_numbers(state, place)
