"""The motion under a curved law: Taylor series, and long implicit steps where the contact is stiff.

A law with a time lag goes by the method of steps: the past is a known function of time, piece by piece."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Index
from stickslip.compiled import compiled
from stickslip.errors import ModelError, SolveError
from stickslip.laws.base import Rigid, Row
from stickslip.laws.curved import Creeping, CurvedMode, lifted, symbol
from stickslip.laws.stribeck import DELAYED, TimeDelay
from stickslip.oscillator import Oscillator, Structure
from stickslip.solve import collocation, march, taylor
from stickslip.solve.collocation import Implicit, Model
from stickslip.solve.march import DONE, DUE, LAPS, TIME, TRY, Dense, Leaps, Shown, Steps, Work
from stickslip.solve.refusal import Budget, chatter, held_back, named, require_numbers, unproved
from stickslip.solve.tables import Stops, numbered
from stickslip.solve.tape import Tape, tape
from stickslip.solve.taylor import EXACT, GROWTH, coded, expansion, length
from stickslip.solve.trajectory import Trajectory

March = Callable[..., tuple[int, int, int, int]]  # of clock, state, `big`, mode, end, steps and room for a series

LOW, HIGH = 14, 18  # orders: few, since each is compiled, and near the best for any tolerance
SHARE = 0.02  # of the tolerance is what a step may take: a hundred periods then stay within the tolerance
CHUNK, LEAPS = 4096, 256  # steps and leaps between two looks at the clock and the keyboard
PATIENCE, STEPS = 200_000, 200_000_000  # steps before a run's number of steps is foretold, and the most there may be
PAST = 2  # where the chain of the past stands in the state: behind x and v
REACH = 4.0  # longest look ahead of a step of the past, in lags


@dataclass(frozen=True, eq=False, repr=False)
class CurvedTrajectory(Trajectory):
    """A simulated motion under a curved law: Taylor polynomials between events.

    Attributes
    ----------
    steps : Dense
        Start and length [s], mode and state at the start of each step, its number among the leaps (-1: a Taylor step);
        of each leap its state as polynomials of w, -1 at its start and 1 after its `reach` [s].
    order : int
        Degree of the Taylor polynomials.
    """

    steps: Dense
    order: int

    @property
    def corners(self) -> Array:
        """State at the start of each step (S, N)."""
        return self.steps.states

    def end(self) -> tuple[Array, int]:
        """State and mode at the end; returns as of :meth:`Trajectory.end`."""
        table: Any = self.table
        last, leaving = self.states[0].copy(), int(self.exits[-1])
        last[: table.physical] = self.sample([self.duration], ("state",))[0][:, 0]
        return last, int(self.modes[-1]) if leaving < 0 else int(table.exits.target[leaving])

    @property
    def cells(self) -> tuple[Array, Array]:
        """Start and length [s] of the steps."""
        return self.steps.starts, self.steps.lengths

    def sample(self, times: ArrayLike, outputs: tuple[str, ...]) -> tuple[Array, Index]:
        """Values at increasing instants; parameters and returns as of :meth:`Trajectory.sample`."""
        times = self.instants(times)
        table: Any = self.table
        for name in outputs:
            if name not in table.places:
                raise SolveError(
                    f"no output is called '{name}'", f"there are {', '.join(table.places)}", "name one of them"
                )
        nodes = np.concatenate([table.places[name] for name in outputs], axis=1)
        out, step = self._told(times, nodes)
        if self._crept and {"a", "friction"} & set(outputs):
            self._balance(times, step, outputs, out)
        piece = np.searchsorted(self.starts, self.steps.starts[step], side="right") - 1
        return out, piece

    def _told(self, times: Array, nodes: Index) -> tuple[Array, Index]:
        """Values of nodes (by mode) at increasing instants, and the step that each one falls in."""
        table: Any = self.table
        out, step = np.empty((nodes.shape[1], len(times))), np.empty(len(times), dtype=np.int64)
        count = table.watched.most
        work = np.empty(count * (self.order + 1)), np.empty(self.steps.states.shape[1]), np.empty(count)
        plain = bool(np.all(nodes < len(work[1])))
        march.sample(_shown(table, self.order), self.steps, times, nodes, plain, out, step, work)
        return out, step

    @cached_property
    def _crept(self) -> bool:
        """Whether leaps went through creep."""
        whole: Any = self.system
        contacts = whole.contacts if isinstance(whole, Structure) else (whole,)
        return bool(np.any(self.steps.leaps >= 0)) and any(isinstance(own.law, Creeping) for own in contacts)

    def _balance(self, times: Array, step: Index, outputs: tuple[str, ...], out: Array) -> None:
        """The acceleration in a leap as its polynomials have it, and the friction that balances it.

        Of creep the law knows neither between the points of a leap: friction is the logarithm of a slip that is below
        the tolerance of the velocity.
        """
        steps, whole = self.steps, self.system
        table: Any = self.table
        n, parts = table.degrees, [getattr(mode, "parts", (mode,)) for mode in table.modes]
        slides = np.array([all(part.friction is not None for part in own) for own in parts])
        own = np.flatnonzero((steps.leaps[step] >= 0) & slides[steps.modes[step]])
        leaps, begun = steps.leaps[step[own]], steps.starts[step[own]]
        reach = steps.reach[leaps]
        w = 2 * np.minimum(times[own] - begun, steps.lengths[step[own]]) / reach - 1
        powers = np.vander(w, collocation.STAGES, increasing=True) * np.arange(1, collocation.WIDTH)
        rate = 2 / reach * np.einsum("pik,pk->ip", steps.polys[leaps, n : 2 * n, 1:], powers)
        less = self._told(times[own], table.places["a"])[0] - rate
        mass = np.asarray(whole.mass, dtype=np.float64).reshape(n, n)
        across = np.linalg.pinv(whole.tangents.T if isinstance(whole, Structure) else np.eye(n))
        change = {"a": -less, "friction": across @ mass @ less}
        row = 0
        for name in outputs:
            count = table.places[name].shape[1]
            if name in change:
                out[row : row + count, own] += change[name]
            row += count

    def labels(self, name: str) -> tuple[str, ...]:
        """What the rows of an output are called: the name alone where there is one, else name1, name2 ..."""
        table: Any = self.table
        return numbered(name, table.places[name].shape[1])


def degree(rtol: float) -> int:
    """Degree of the polynomials for a tolerance."""
    if not 1e-15 <= rtol <= 1e-2:
        raise ModelError(f"rtol = {rtol}", "the tolerance lies between 1e-15 and 1e-2", "give rtol=1e-12, or 1e-8")
    return LOW if rtol > 1e-10 else HIGH


@lru_cache(maxsize=32)
def _code(table: Tape, order: int) -> tuple[int, Array]:
    """The code of steps of an order, with its numbers."""
    return expansion(table.nodes, table.kept, order)


@lru_cache(maxsize=32)
def _shown(table: Tape, order: int) -> Shown:
    return Shown(*_code(table, order), *expansion(table.watched, table.shown, 0), order)


def model_of(table: Tape, rtol: float) -> Model:
    """A system as the march reads it."""
    order = degree(rtol)
    series, numbers = _code(table, order)
    return Model(
        series,
        numbers,
        table.sums,
        table.exits,
        table.guards,
        table.tones,
        table.motion.period,
        SHARE * rtol,
        order,
    )


def implicit_of(table: Tape, model: Model) -> Implicit:
    """The system as leaps read it."""
    rates, _ = _code(table, 1)
    faces = np.ascontiguousarray(table.opening[table.degrees : 2 * table.degrees])
    return Implicit(model, rates, collocation.method(), faces, table.physical)


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
    run = _Run(table, state, mode, total=offset + _lasting(laps, table.motion.period), budget=budget, rtol=rtol)
    status = "complete"
    try:
        with ExitStack() as holding:
            run.state[stops.places] = stops.values[0]
            outcome = march.FULL
            while outcome == march.FULL:
                if run.fresh:  # the first call may compile for long
                    holding.close()
                    run.heed = None
                elif run.heed is None:
                    run.heed = holding.enter_context(held_back())
                outcome = run.chunk(stops, follow)
                tell(run.share)
    except KeyboardInterrupt:
        if not run.kept:
            raise
        status, last = "interrupted", run.kept[-1]
        run.total = last.offsets[-1] + last.lengths[-1] + _lasting(last.laps[-1], table.motion.period)
    if status == "complete":
        tell(1.0)
        status = (
            "at rest"
            if march.rests(run.model.series, run.model.numbers, run.mode, run.state, run.work.step)
            else status
        )
    return _assembled(table, run, status)


def _lasting(laps: float, period: float) -> float:
    """Time of whole laps [s], of which a motion without period has none."""
    return laps * period if math.isfinite(period) else 0.0


class _Run:
    """A motion under way. Lives for one run."""

    def __init__(self, table: Tape, state: Array, mode: int, *, total: float, budget: int, rtol: float) -> None:
        system, size, period, count = table.system, len(table.names), table.motion.period, table.nodes.most
        self.table, self.mode, self.total, self.stop = table, mode, total, 0
        self.model = model_of(table, rtol)
        longest = period if math.isfinite(period) else 1 / system.frequency if system.frequency else total
        self.scale = min(longest, total)
        self.events = Budget(table, scale=self.scale, most=budget)
        self.clock = np.array([0.0, 0.0, 1e-6 * self.scale, 0.0, 0.0, march.PATIENCE])
        self.state, self.big = state.copy(), np.abs(state)
        self.kept: list[Steps] = []
        self.leapt = [Leaps(np.empty((0, size, collocation.WIDTH)), np.empty(0))]
        self.room = room_for(CHUNK, size)
        self.work = Work(
            taylor.room(count, self.model.order, size),
            collocation.room(count, size, table.physical),
            Leaps(np.empty((LEAPS, size, collocation.WIDTH)), np.empty(LEAPS)),
        )
        self.heed: Callable[[], None] | None = None  # lets a Ctrl-C through that came within a chunk
        self.fresh, self.stiff = True, False  # whether the march was not called yet, and whether it leaps

    @property
    def ahead(self) -> float:
        """Time that is left [s]."""
        laps = self.clock[LAPS]
        return float(self.total - self.clock[TIME] - (laps * self.model.period if laps else 0.0))

    @cached_property
    def implicit(self) -> Implicit:
        """The system as leaps read it."""
        return implicit_of(self.table, self.model)

    @property
    def share(self) -> float:
        """Of the time that is over."""
        return 1.0 - self.ahead / self.total

    def chunk(self, stops: Stops, follow: March | None) -> int:
        """March for so many steps at the most, keep them, and say why it ended; refuse what gets nowhere."""
        steps, before, self.fresh = self.room, self.clock.copy(), False
        if follow is None and len(stops.ends) > 1:
            outcome, written, leapt, self.mode, self.stop = march.course(
                self.implicit,
                self.clock,
                self.state,
                self.big,
                self.mode,
                stops,
                self.stop,
                self.scale,
                steps,
                self.work,
            )
        else:
            outcome, written, leapt, self.mode, self.stop = self._to_stop(stops, follow or self._freely)
        if written:
            steps.leaps[:written][steps.leaps[:written] >= 0] += sum(len(part.reach) for part in self.leapt)
            self.kept.append(Steps._make(column[:written].copy() for column in steps))
            self.leapt.append(Leaps._make(column[:leapt].copy() for column in self.work.leaps))
        if self.heed:
            self.heed()
        laps = self.clock[LAPS] - before[LAPS]
        passed = self.clock[TIME] - before[TIME] + (laps * self.model.period if laps else 0.0)
        if outcome != march.DONE or not np.isfinite(self.state).all():
            self._refuse(outcome, passed)
        self.events.spend(steps.ends[:written], passed=passed, state=self.state)
        return int(outcome)

    def _to_stop(self, stops: Stops, follow: March) -> tuple[int, int, int, int, int]:
        """As :func:`stickslip.solve.march.course`, by a march that ends at each stop."""
        until, stop = tuple(stops.ends[self.stop]), self.stop
        outcome, *rest = follow(self.clock, self.state, self.big, self.mode, until, self.room, self.work)
        if outcome == march.DONE and stop + 1 < len(stops.ends):
            outcome, stop = march.FULL, stop + 1
            self.state[stops.places] = stops.values[stop]
            self.clock[TRY] = min(self.clock[TRY], self.scale)
        return outcome, *rest, stop  # type: ignore[return-value]

    def _freely(
        self, clock: Array, state: Array, big: Array, mode: int, until: tuple[float, float], steps: Steps, work: Work
    ) -> tuple[int, int, int, int]:
        """Taylor steps, until the contact turns out stiff: what leaps takes seconds to compile."""
        if self.stiff:
            return march.strides(  # type: ignore[no-any-return]
                self.implicit, clock, state, big, mode, until, steps, 0, 0, work
            )
        outcome, written, mode = march.march(self.model, clock, state, big, mode, until, steps, 0, work.step)
        if outcome == march.STIFF:
            outcome, self.stiff, self.fresh = march.FULL, True, True
        return outcome, written, 0, mode

    def _refuse(self, outcome: int, passed: float) -> None:
        laps, time = self.clock[LAPS], self.clock[TIME]
        place = f"lap {laps:g}, {time:g} s, at {named(self.table.names[: self.table.physical], self.state)}"
        if outcome == march.CHATTER:
            first, exits = self.table.exits.first, self.table.exits
            targets = exits.target[first[self.mode] : first[self.mode + 1]]
            raise chatter([self.table.modes[j].name for j in (self.mode, *targets)], place)
        if outcome == march.UNPROVED:
            raise unproved(place)
        if outcome == march.STALL:
            raise SolveError(
                f"a step of no length, {place}",
                "friction and its rates are finite and smooth within a mode",
                "check the law there (a logarithm or a power of nothing; in series, damping= too small)",
            )
        long = CHUNK * len(self.kept) >= PATIENCE and passed * STEPS < CHUNK * self.ahead
        if outcome == march.FULL and long:
            raise SolveError(
                f"steps of {passed / CHUNK:.1e} s with {self.ahead:g} s ahead, {place}",
                f"a run takes at most {STEPS:g} steps; the contact is far faster here than the motion",
                "take a larger mass, a larger rtol=, or a shorter time",
            )
        require_numbers(self.state, place)


def room_for(count: int, size: int) -> Steps:
    """Room for steps."""
    return Steps(
        laps=np.empty(count),
        offsets=np.empty(count),
        lengths=np.empty(count),
        modes=np.empty(count, np.int64),
        states=np.empty((count, size)),
        ends=np.empty(count, np.int16),
        leaps=np.empty(count, np.int64),
    )


def _assembled(table: Tape, run: _Run, status: str) -> CurvedTrajectory:
    """Steps gathered, and pieces from event to event."""
    steps = Steps._make(map(np.concatenate, zip(*run.kept, strict=True)))
    leaps = Leaps._make(map(np.concatenate, zip(*run.leapt, strict=True)))
    first = np.flatnonzero(np.concatenate([[True], steps.ends[:-1] >= 0]))
    last = np.append(first[1:], len(steps.ends)) - 1
    period = table.motion.period
    starts = steps.offsets + (steps.laps * period if math.isfinite(period) else 0.0)
    return CurvedTrajectory(
        system=table.system,
        table=table,  # type: ignore[arg-type]
        laps=steps.laps[first].astype(np.int32),
        offsets=steps.offsets[first],
        modes=steps.modes[first].astype(np.int16),
        durations=np.add.reduceat(steps.lengths, first),
        kept=steps.states[first],
        exits=steps.ends[last],
        duration=float(run.total),
        status=status,
        steps=Dense(starts, steps.lengths, steps.modes, steps.states, steps.leaps, *leaps),
        order=run.model.order,
    )


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

    The polynomial of a step that was cut short may hold over the steps that follow it.
    """
    s, width, period, slip = step.s, step.order + 1, model.period, past.slip
    j = past.cursor[0]
    side = past.sides[steps.modes[j]]
    holds, h = _holds(model, past, steps, big, step)
    scale = model.tolerance * big[PAST]
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
    edge = past.edge
    if e < count:
        edge[0], edge[1] = steps.laps[e], steps.offsets[e] + past.lag
    else:
        edge[0], edge[1] = clock[LAPS], clock[TIME] + past.lag
    while edge[1] >= period:
        edge[0] += 1.0
        edge[1] -= period
    past.cursor[0] = e
    power = 1.0
    for k in range(step.order + 1):
        state[PAST + k] = side * _coefficient(slip, s, width, k) * power
        power *= past.lag / h
    big[PAST] = max(big[PAST], abs(state[PAST]))


@compiled(**EXACT)
def _march(model, past, clock, state, big, mode, until, steps, count, step):
    """As `march`, from edge to edge of the past; `count` steps are known, and new ones are put behind them."""
    edge, cursor = past.edge, past.cursor
    while True:
        if cursor[1]:
            _recall(model, past, steps, count, clock, state, big, step)
            cursor[1] = 0
        first = _apart((edge[0], edge[1]), (until[0], until[1]), model.period) <= 0.0
        aim = (edge[0], edge[1]) if first else (until[0], until[1])
        clock[TRY] = min(clock[TRY], past.lag)  # at rest steps would grow for ever
        outcome, count, mode = march.march(model, clock, state, big, mode, aim, steps, count, step)
        if outcome != DONE:
            return outcome, count, mode
        if first:
            clock[LAPS], clock[TIME] = edge[0], edge[1]
            cursor[1] = 1
        if not first or _apart((edge[0], edge[1]), (until[0], until[1]), model.period) >= 0.0:
            return outcome, count, mode
