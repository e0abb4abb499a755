"""The motion under a curved law: Taylor series, and long implicit steps where the contact is stiff."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Index
from stickslip.errors import ModelError, SolveError
from stickslip.laws.curved import Creeping
from stickslip.oscillator import Structure
from stickslip.solve import collocation, march, taylor
from stickslip.solve.collocation import Implicit, Model
from stickslip.solve.march import LAPS, TIME, TRY, Dense, Leaps, Shown, Steps, Work
from stickslip.solve.refusal import Budget, chatter, heed, held_back, named, require_numbers, unproved
from stickslip.solve.tables import Stops, numbered
from stickslip.solve.tape import Tape
from stickslip.solve.taylor import expansion
from stickslip.solve.trajectory import Trajectory

March = Callable[..., tuple[int, int, int, int]]  # of clock, state, `big`, mode, end, steps and room for a series

LOW, HIGH = 14, 18  # orders: few, since each is compiled, and near the best for any tolerance
SHARE = 0.02  # of the tolerance is what a step may take: a hundred periods then stay within the tolerance
CHUNK, LEAPS = 4096, 256  # steps and leaps between two looks at the clock and the keyboard
PATIENCE, STEPS = 200_000, 200_000_000  # steps before a run's number of steps is foretold, and the most there may be


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
        series, numbers, table.sums, table.exits, table.guards, table.tones, table.motion.period, SHARE * rtol, order
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
    tell: Callable[[float], None] | None = None,
    follow: March | None = None,
) -> CurvedTrajectory:
    """March from a state at time 0 to the end of the course's time (laps, offset), in chunks.

    An interrupted run is returned as by :func:`stickslip.solve.simulate.run`.
    """
    (laps, offset), stops = course
    run = _Run(table, state, mode, total=offset + _lasting(laps, table.motion.period), budget=budget, rtol=rtol)
    status = "complete"
    heed()
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
                if tell:
                    tell(run.share)
    except KeyboardInterrupt:
        if tell is None or not run.kept:
            raise
        status, last = "interrupted", run.kept[-1]
        run.total = last.offsets[-1] + last.lengths[-1] + _lasting(last.laps[-1], table.motion.period)
    if status == "complete":
        if tell:
            tell(1.0)
        rests = march.rests(run.model.series, run.model.numbers, run.mode, run.state, run.work.step)
        status = "at rest" if rests else status
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
