"""The motion under a law with a time lag, by the method of steps: the past is a function of time, piece by piece."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array, Index
from stickslip.compiled import compiled
from stickslip.errors import SolveError
from stickslip.laws.base import Rigid, Row
from stickslip.laws.curved import CurvedMode, lifted, symbol
from stickslip.laws.stribeck import DELAYED, TimeDelay
from stickslip.oscillator import Oscillator
from stickslip.solve import march
from stickslip.solve.curved import CHUNK, STEPS, CurvedTrajectory, degree, model_of, room_for, run_curved
from stickslip.solve.march import DONE, DUE, LAPS, TIME, TRY, Steps, Work
from stickslip.solve.tables import Stops
from stickslip.solve.tape import Tape, tape
from stickslip.solve.taylor import EXACT, GROWTH, coded, length

PAST = 2  # where the chain of the past stands in the state: behind x and v
REACH = 4.0  # longest look ahead of a step of the past, in lags


class Recalled(NamedTuple):
    """What is known of the past: lag [s], sliding speed as a linear form, side of each mode; where the piece recalled
    ends (laps, time); the step that comes next, and whether it is due."""

    lag: float
    slip: Array
    sides: Array
    edge: Array
    cursor: Index


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
    places = {**built.places, "state": built.places["state"][:, :PAST]}  # what is recalled is no state
    return replace(built, system=system, physical=PAST, opening=built.opening[:PAST], places=places)


def run_delayed(
    table: Tape, state: Array, mode: int, *, course: tuple[tuple[float, float], Stops], rtol: float, **rest: Any
) -> CurvedTrajectory:
    """As :func:`run_curved`, from a state before which the speed was what it is."""
    assert isinstance(table.system, Oscillator)
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
    past = _Past(table, law, rtol)
    return run_curved(table, state, past.opening(state, mode), course=course, rtol=rtol, follow=past, **rest)


class _Past:
    """The march of a system with a time lag; remembers the steps of the last lag. Lives for one run."""

    def __init__(self, table: Tape, law: TimeDelay, rtol: float) -> None:
        period = table.motion.period
        self.recalled = Recalled(
            law.lag,
            table.outputs["slip"],
            np.array([mode.side for mode in table.modes], dtype=np.float64),
            np.array(divmod(law.lag, period) if math.isfinite(period) else (0.0, law.lag)),
            np.array([0, 0]),
        )
        self.order, self.lows = degree(rtol), [low for low, _ in law.law.branches()]
        self.columns = room_for(2 * CHUNK, len(table.names))
        self.known = 0
        self.model = model_of(table, rtol)

    def opening(self, state: Array, mode: int) -> int:
        """Set the delayed speed to that at the start; the mode, on that speed's branch."""
        state[PAST] = abs(float(self.recalled.slip @ state))
        return mode % 3 + 3 * (int(np.searchsorted(self.lows, state[PAST], side="right")) - 1)

    def __call__(
        self, clock: Array, state: Array, big: Array, mode: int, until: tuple[float, float], steps: Steps, work: Work
    ) -> tuple[int, int, int, int]:
        """As :func:`march`; without leaps, whose polynomials are no Taylor steps."""
        clock[DUE] = math.inf
        big[PAST + 1 : PAST + self.order + 1] = np.inf  # a polynomial's own chain is exact at any step
        count = len(steps.laps)
        self._forget(count)
        before = self.known
        known = Steps._make(column[: before + count] for column in self.columns)
        outcome, self.known, mode = _march(
            self.model, self.recalled, clock, state, big, mode, np.array(until), known, before, work.step
        )
        written = self.known - before
        columns: Any = zip(steps, self.columns, strict=True)
        for column, own in columns:
            column[:written] = own[before : self.known]
        return outcome, written, 0, mode

    def _forget(self, count: int) -> None:
        """Make room for steps: drop those before the lag, grow where the lag is longer than the room."""
        if self.known + count <= len(self.columns[0]):
            return
        first = int(self.recalled.cursor[0])
        kept = self.known - first
        grown = room_for(2 * (kept + count), self.columns.states.shape[1])
        columns: Any = zip(grown, self.columns, strict=True)
        for new, old in columns:
            new[:kept] = old[first : self.known]
        self.columns, self.known = grown, kept
        self.recalled.cursor[0] = 0


@compiled(**EXACT)
def _apart(later, sooner, period):
    """Time between two instants (laps, offset)."""
    whole = (later[0] - sooner[0]) * period if later[0] != sooner[0] else 0.0
    return whole + (later[1] - sooner[1])


@compiled(**EXACT)
def _along(row, state):
    total = 0.0
    for i in range(len(row)):
        total += row[i] * state[i]
    return total


@compiled(**EXACT)
def _coefficient(row, s, width, k):
    """Coefficient k of a linear form of the state's entries."""
    total = 0.0
    for i in range(len(row)):
        total += row[i] * s[i * width + k]
    return total


@compiled(**EXACT)
def _holds(model, past, steps, big, step):
    """How long the series of the step at the cursor holds [s], and its unit; the series, in `step`."""
    series = coded(model.series)
    j = past.cursor[0]
    h, u = steps.lengths[j], 1.0
    for _ in range(40):
        series(model.numbers, steps.modes[j], steps.states[j], h, step.s)
        u = length(step.s, step.order, big, model.tolerance)
        if not (u >= GROWTH and h < REACH * past.lag):
            break
        h *= GROWTH
    return u * h if u > 0.0 else 0.0, h


@compiled(**EXACT)
def _recall(model, past, steps, count, clock, state, big, step):
    """Set the chain of the past to the step at the cursor, and its edge to where that step's polynomial ends to hold.

    The polynomial of a step that was cut short may hold over the steps that follow it. `state` and `big` are (N,); of
    `steps` the first `count` are known.
    """
    s, width, period, slip = step.s, step.order + 1, model.period, past.slip
    j = past.cursor[0]
    side = past.sides[steps.modes[j]]
    # Step: its polynomial, and how long that holds [s].
    holds, h = _holds(model, past, steps, big, step)
    scale = model.tolerance * big[PAST]
    # Reach: on over the steps at whose ends it is still true, for fewer edges; a change of side is a kink of the speed.
    e = j + 1
    while e < count and past.sides[steps.modes[e]] == side:
        end = (steps.laps[e + 1], steps.offsets[e + 1]) if e + 1 < count else (clock[LAPS], clock[TIME])
        over = _apart(end, (steps.laps[j], steps.offsets[j]), period)
        if over > holds:
            break
        total = 0.0
        for k in range(step.order, -1, -1):
            total = total * (over / h) + _coefficient(slip, s, width, k)
        if not abs(total - _along(slip, steps.states[e + 1] if e + 1 < count else state)) <= scale:
            break
        e += 1
    # Edge: where its reach ends, a lag later, in laps and time.
    edge = past.edge
    if e < count:
        edge[0], edge[1] = steps.laps[e], steps.offsets[e] + past.lag
    else:
        edge[0], edge[1] = clock[LAPS], clock[TIME] + past.lag
    while edge[1] >= period:
        edge[0] += 1.0
        edge[1] -= period
    past.cursor[0] = e
    # Chain: Taylor coefficients of the speed by time over the lag, whose first entry is the speed itself.
    power = 1.0
    for k in range(step.order + 1):
        state[PAST + k] = side * _coefficient(slip, s, width, k) * power
        power *= past.lag / h
    big[PAST] = max(big[PAST], abs(state[PAST]))


@compiled(**EXACT)
def _march(model, past, clock, state, big, mode, until, steps, count, step):
    """As `march`, from edge to edge of the past; `count` steps are known, and new ones are put behind them. `state` and
    `big` are (N,), `until` (2,): laps and time [s]."""
    edge, cursor = past.edge, past.cursor
    while True:
        if cursor[1]:
            _recall(model, past, steps, count, clock, state, big, step)
            cursor[1] = 0
        # whichever comes first, the edge or the end
        first = _apart((edge[0], edge[1]), (until[0], until[1]), model.period) <= 0.0
        aim = (edge[0], edge[1]) if first else (until[0], until[1])
        clock[TRY] = min(clock[TRY], past.lag)  # at rest steps would grow for ever
        outcome, count, mode = march.march(model, clock, state, big, mode, aim, steps, count, step)
        if outcome != DONE:
            return outcome, count, mode
        # onto the edge to the last digit, not to the sum of the steps; the next step of the past is due
        if first:
            clock[LAPS], clock[TIME] = edge[0], edge[1]
            cursor[1] = 1
        if not first or _apart((edge[0], edge[1]), (until[0], until[1]), model.period) >= 0.0:
            return outcome, count, mode
