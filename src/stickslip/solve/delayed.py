"""A law with a time lag, by the method of steps: the past is a known function of time, piece by piece.

Friction asks for the sliding speed of one lag ago. That speed is a polynomial, the Taylor step that was made then, so
it joins the state as a chain of its own scaled derivatives, U_k = u^(k) lag^k / k! with U_k' = (k + 1) U_(k+1) / lag,
which any piece of the past sets anew. The march, its certified exits and its dense output are those of every curved
law.

A piece of the past ends where its polynomial no longer tells the speed to the tolerance: at the events of one lag
ago, and at what is left of earlier ones, which each lag smooths by one derivative. A step ends there too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import compiled
from stickslip.errors import SolveError
from stickslip.laws.base import Rigid, Row
from stickslip.laws.curved import CurvedMode, lifted, symbol
from stickslip.laws.time_delay import DELAYED, TimeDelay
from stickslip.oscillator import Oscillator
from stickslip.solve import march, taylor
from stickslip.solve.curved import CHUNK, STEPS, Array, CurvedTrajectory, Stops, code, degree, room_for, run_curved
from stickslip.solve.tape import Tape, tape

PAST = 2  # where the chain of the past stands in the state: behind x and v
REACH = 4.0  # longest look ahead of a step of the past, in lags


@dataclass(frozen=True)
class _Unrolled(Rigid):
    """A law with a time lag as one whose memory is the chain of the delayed speed's derivatives."""

    law: TimeDelay
    order: int

    @property
    def chain(self) -> tuple[str, ...]:
        return (DELAYED, *(f"{DELAYED}_{k}" for k in range(1, self.order + 1)))

    @property
    def memory(self) -> Mapping[str, Row]:
        return {name: {} for name in self.chain}

    @property
    def entry(self) -> tuple[str, str, str]:
        return self.law.entry

    def rates(self) -> tuple[CurvedMode, ...]:
        chain = self.chain
        moving = {low: symbol(high) * ((k + 1) / self.law.lag) for k, (low, high) in enumerate(pairwise(chain))}
        return tuple(replace(mode, rates={**moving, chain[-1]: lifted(0.0)}) for mode in self.law.rates())


def delayed_tape(system: Oscillator, order: int) -> Tape:
    """The flat arrays of a system whose law has a time lag; steps of the past are polynomials of this order."""
    assert isinstance(system.law, TimeDelay)
    built = tape(replace(system, law=_Unrolled(system.law, order)))
    return replace(built, system=system, physical=PAST, opening=built.opening[:PAST])


def run_delayed(
    table: Tape, state: Array, mode: int, *, course: tuple[tuple[float, float], Stops], rtol: float, **rest: Any
) -> CurvedTrajectory:
    """As :func:`run_curved`, from a state before which the speed was what it is."""
    period, law = table.motion.period, table.system.law
    assert isinstance(law, TimeDelay)
    (laps, offset), _ = course
    total = offset + (laps * period if math.isfinite(period) else 0.0)
    if total / law.lag > STEPS:
        raise SolveError(
            f"lag = {law.lag:g} s in a run of {total:g} s",
            f"a step is no longer than the lag, and a run takes at most {STEPS:g} steps",
            "take a longer lag=, a shorter time, or the law without its lag",
        )
    past = _Past(table, law, degree(rtol))
    return run_curved(table, state, past.opening(state, mode), course=course, rtol=rtol, follow=past, **rest)


class _Past:
    """The march of a system with a time lag; remembers the steps of the last lag. Lives for one run."""

    def __init__(self, table: Tape, law: TimeDelay, order: int) -> None:
        self.lag, self.table, self.code = law.lag, table, code(table, order)
        self.slip = table.outputs["slip"]
        self.sides = np.array([mode.side for mode in table.modes], dtype=np.float64)
        self.lows = [low for low, _ in law.law.branches()]
        self.columns, self.known = room_for(2 * CHUNK, len(table.names)), 0
        period = table.motion.period
        self.edge = np.array(divmod(law.lag, period) if math.isfinite(period) else (0.0, law.lag))
        self.cursor = np.array([0, 0])  # the step of the past that comes next, and whether it is due

    def opening(self, state: Array, mode: int) -> int:
        """Set the delayed speed to that at the start; the mode, on that speed's branch."""
        state[PAST] = abs(float(self.slip @ state))
        return mode % 3 + 3 * (int(np.searchsorted(self.lows, state[PAST], side="right")) - 1)

    def __call__(
        self, clock: Array, state: Array, mode: int, at: tuple[float, float], physical: int, tolerance: float,
        order: int, big: Array, room: tuple[NDArray[Any], ...], *work: Any,
    ) -> tuple[int, int, int, int]:  # fmt: skip
        """As :func:`march.march`; without leaps, whose polynomials are no Taylor steps."""
        table = self.table
        clock[5] = math.inf
        big[PAST + 1 : PAST + order + 1] = np.inf  # a polynomial's own chain is exact at any step
        self._forget(len(room[0]))
        before = self.known
        outcome, self.known, mode = _march(
            *self.code, table.sums, table.exits, table.guards, table.tones, clock, state, mode, np.array(at),
            table.motion.period, physical, tolerance, order, big,
            tuple(column[: before + len(room[0])] for column in self.columns), *work,
            self.lag, self.slip, self.sides, self.edge, self.cursor, before,
        )  # fmt: skip
        written = self.known - before
        for column, own in zip(room, self.columns, strict=True):
            column[:written] = own[before : self.known]
        return outcome, written, 0, mode

    def _forget(self, count: int) -> None:
        """Make room for steps: drop those before the lag, grow where the lag is longer than the room."""
        if self.known + count <= len(self.columns[0]):
            return
        first, kept = int(self.cursor[0]), self.known - int(self.cursor[0])
        grown = room_for(2 * (kept + count), self.columns[4].shape[1])
        for new, old in zip(grown, self.columns, strict=True):
            new[:kept] = old[first : self.known]
        self.columns, self.known = grown, kept
        self.cursor[0] = 0


@compiled(**taylor.EXACT)
def _apart(later, sooner, period):
    """Time between two instants (laps, offset)."""
    whole = (later[0] - sooner[0]) * period if later[0] != sooner[0] else 0.0
    return whole + (later[1] - sooner[1])


@compiled(**taylor.EXACT)
def _along(row, state):
    total = 0.0
    for i in range(len(row)):
        total += row[i] * state[i]
    return total


@compiled(**taylor.EXACT)
def _coefficient(row, s, width, k):
    """Coefficient k of a linear form of the state's entries."""
    total = 0.0
    for i in range(len(row)):
        total += row[i] * s[i * width + k]
    return total


@compiled(**taylor.EXACT)
def _recall(
    series, numbers, steps, count, clock, state, period, tolerance, order, big, s, lag, slip, sides, edge, cursor
):
    """Set the chain of the past to the step at the cursor, and its edge to where that step's polynomial ends to hold.

    The polynomial of a step that was cut short may hold over the steps that follow it.
    """
    series = taylor.coded(series)
    laps, offsets, lengths, modes, states, _, _ = steps
    width, size = order + 1, len(state)
    j = cursor[0]
    mode, h, u = modes[j], lengths[j], 1.0
    side = sides[mode]
    for _ in range(40):
        series(numbers, mode, states[j], h, s)
        u = taylor.length(s, width, order, size, tolerance, big)
        if not (u >= taylor.GROWTH and h < REACH * lag):
            break
        h *= taylor.GROWTH
    holds = u * h if u > 0.0 else 0.0
    scale = tolerance * big[PAST]
    e = j + 1
    while e < count and sides[modes[e]] == side:
        end = (laps[e + 1], offsets[e + 1]) if e + 1 < count else (clock[0], clock[1])
        over = _apart(end, (laps[j], offsets[j]), period)
        if over > holds:
            break
        total = 0.0
        for k in range(order, -1, -1):
            total = total * (over / h) + _coefficient(slip, s, width, k)
        if not abs(total - _along(slip, states[e + 1] if e + 1 < count else state)) <= scale:
            break
        e += 1
    if e < count:
        edge[0], edge[1] = laps[e], offsets[e] + lag
    else:
        edge[0], edge[1] = clock[0], clock[1] + lag
    while edge[1] >= period:
        edge[0] += 1.0
        edge[1] -= period
    cursor[0] = e
    power = 1.0
    for k in range(order + 1):
        state[PAST + k] = side * _coefficient(slip, s, width, k) * power
        power *= lag / h
    big[PAST] = max(big[PAST], abs(state[PAST]))


@compiled(**taylor.EXACT)
def _march(
    series, numbers, rates, scheme, sums, exits, guards, tones, clock, state, mode, until, period, physical, tolerance,
    order, big, steps, polys, reach, work, long_work, lag, slip, sides, edge, cursor, count,
):  # fmt: skip
    """As `march.march`, from edge to edge of the past; `count` steps are known, and new ones are put behind them."""
    laps, offsets, lengths, modes, states, ends, leaps = steps
    _, target, _, _, bound, _, _ = exits
    while True:
        if cursor[1]:
            _recall(series, numbers, steps, count, clock, state, period, tolerance, order, big, work[0], lag, slip,
                    sides, edge, cursor)  # fmt: skip
            cursor[1] = 0
        first = _apart((edge[0], edge[1]), (until[0], until[1]), period) <= 0.0
        aim = (edge[0], edge[1]) if first else (until[0], until[1])
        clock[2] = min(clock[2], lag)  # at rest steps would grow for ever
        free = (laps[count:], offsets[count:], lengths[count:], modes[count:], states[count:], ends[count:],
                leaps[count:])  # fmt: skip
        outcome, written, _, mode = march.march(
            series, numbers, rates, scheme, sums, exits, guards, tones, clock, state, mode, aim, period, physical,
            tolerance, order, big, free, polys, reach, work, long_work,
        )  # fmt: skip
        if count > 0 and written > 0 and modes[count] != modes[count - 1] and ends[count - 1] < 0:
            for e in range(bound[modes[count - 1]], bound[modes[count - 1] + 1]):  # an exit due at the edge itself
                if target[e] == modes[count] or ends[count - 1] < 0:
                    ends[count - 1] = e
        count += written
        if outcome != march.DONE:
            return outcome, count, mode
        if first:
            clock[0], clock[1] = edge[0], edge[1]
            cursor[1] = 1
        if not first or _apart((edge[0], edge[1]), (until[0], until[1]), period) >= 0.0:
            return outcome, count, mode
