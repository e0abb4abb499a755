"""Curved laws: from a system to a tape of operations, and its motion by Taylor series.

Between events the motion is analytic, so each step is the Taylor polynomial of the state itself: the dense output is
the step, and exits are searched on it with the same certificate as in the exact engine. Steps are as long as the
tolerance allows: the last two terms of every entry's series, relative to the largest value that the entry has had.

The method is explicit. A contact whose fastest rate is far above the motion's own (rate-and-state friction at creep
speed under a light mass) takes steps of about order/3 over that rate; where that foretells more than `STEPS` steps,
the run ends with an error that says so instead of crawling.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.drives import Motion
from stickslip.errors import ModelError, SolveError
from stickslip.laws.curved import CurvedLaw, CurvedMode, Expression
from stickslip.oscillator import Oscillator
from stickslip.solve import taylor
from stickslip.solve.trajectory import Trajectory

Array = NDArray[np.float64]
Form = tuple[dict[int, float], float]  # weights of nodes, and a constant

Scaled = tuple[int, float]  # a node and a factor
March = Callable[..., tuple[int, int, int]]  # of clock, state, mode, until, and what follows in `taylor.march`
Stops = Iterable[tuple[tuple[float, float], tuple[Any, Any]]]

DTYPES = (np.int64, np.float64)
CHUNK = 4096  # steps between two looks at the clock and the keyboard
PATIENCE, STEPS = 200_000, 200_000_000  # steps before a run's number of steps is foretold, and the most there may be


@dataclass(frozen=True, eq=False)
class Tape:
    """A curved system as flat arrays.

    Attributes
    ----------
    system : Oscillator
        The system.
    names : tuple of str
        What each entry of the state is.
    modes : tuple of CurvedMode
        The law's modes.
    motion : Motion
        The drive.
    physical : int
        Number of leading entries that belong to the oscillator and its law.
    entry : tuple of int
        Modes in which motion starts with negative, zero and positive relative velocity.
    opening : ndarray (physical, N)
        Each physical entry at the start, where it is not given, as a linear form of the entries before it.
    tones : ndarray (J, 4)
        Index of cosine, index of sine, angular frequency, phase.
    outputs : mapping of str to ndarray (N,)
        Linear forms of the state.
    nodes : tuple of ndarray
        Operation, left, right, exponent, first weight, weights, their nodes, constant, first node of each mode, and
        node and factor of each state entry's rate, for the march.
    watched : tuple of ndarray
        As `nodes`, with the nodes of all outputs as well.
    exits : tuple of ndarray
        Node, target, crossing, held, first exit of each mode, the counter-face's velocity, and the node's factor.
    guards : tuple of ndarray
        Nodes that fall asleep (exponentials, powers near 0), and the first of each mode.
    places : mapping of str to ndarray (M,)
        Node of each output in each mode of `watched`.
    """

    system: Oscillator
    names: tuple[str, ...]
    modes: tuple[CurvedMode, ...]
    motion: Motion
    physical: int
    entry: tuple[int, int, int]
    opening: Array
    tones: Array
    outputs: Mapping[str, Array]
    nodes: tuple[NDArray[Any], ...]
    watched: tuple[NDArray[Any], ...]
    exits: tuple[NDArray[Any], ...]
    guards: tuple[NDArray[Any], ...]
    places: Mapping[str, NDArray[np.int64]]

    @property
    def first(self) -> NDArray[np.int64]:
        """Exits of mode j are ``first[j]`` to ``first[j + 1]``."""
        return np.asarray(self.exits[4])

    def index(self, mode: str) -> int:
        """Number of the mode of that name."""
        names = [m.name for m in self.modes]
        if mode not in names:
            raise ModelError(f"no mode is called '{mode}'", f"the law has {', '.join(names)}", "choose one of them")
        return names.index(mode)


class _Nodes:
    """Nodes of one mode's tape; equal formulas share a node."""

    def __init__(self, size: int, symbols: Mapping[str, Form]) -> None:
        self.size, self.symbols = size, symbols
        self.rows: list[tuple[int, int, int, float, Form]] = []
        self.known: dict[Any, int] = {}

    def put(self, kind: int, left: int = 0, right: int = 0, power: float = 0.0, form: Form = ({}, 0.0)) -> int:
        """A node's number; a new one only where no equal one is there."""
        key = (kind, left, right, power, tuple(sorted(form[0].items())), form[1])
        if key not in self.known:
            self.known[key] = self.size + len(self.rows)
            self.rows.append((kind, left, right, power, form))
        return self.known[key]

    def node(self, form: Form) -> int:
        """The node that has a linear form's value."""
        weights, constant = form
        if constant == 0.0 and len(weights) == 1 and next(iter(weights.values())) == 1.0:
            return next(iter(weights))
        return self.put(taylor.LINEAR, form=form)

    def scaled(self, form: Form) -> Scaled:
        """A linear form as a node and a factor: a multiple of a node needs none of its own."""
        weights, constant = form
        if constant == 0.0 and len(weights) == 1:
            return next(iter(weights.items()))
        return self.node(form), 1.0

    def form(self, expression: Expression) -> Form:
        """An expression as a linear form of nodes."""
        kind, parts = expression.kind, expression.parts
        if kind == "number":
            return {}, expression.value
        if kind == "symbol":
            if expression.name not in self.symbols:
                raise ModelError(
                    f"a law speaks of '{expression.name}'",
                    f"the state has {', '.join(self.symbols)}",
                    "correct the law",
                )
            return self.symbols[expression.name]
        forms = [self.form(part) for part in parts]
        if kind == "sum":
            return combined((1.0, form) for form in forms)
        if kind == "product":
            return self.product(*forms)
        if kind == "quotient":
            if not forms[1][0]:
                return combined([(1 / forms[1][1], forms[0])])
            return {self.put(taylor.QUOTIENT, self.node(forms[0]), self.node(forms[1])): 1.0}, 0.0
        if kind == "power":
            return self.power(forms[0], expression.value)
        return self.function(kind, forms[0])

    def product(self, a: Form, b: Form) -> Form:
        """a b; a number only scales."""
        if not a[0] or not b[0]:
            return combined([(a[1], b)] if not a[0] else [(b[1], a)])
        left, right = self.node(a), self.node(b)
        if left == right:
            return {self.put(taylor.SQUARE, left): 1.0}, 0.0
        return {self.put(taylor.PRODUCT, min(left, right), max(left, right)): 1.0}, 0.0

    def power(self, base: Form, exponent: float) -> Form:
        """base ** exponent; whole exponents are products."""
        if not base[0]:
            return {}, float(base[1] ** exponent)
        if exponent == int(exponent) and 0 <= exponent <= 64:
            result: Form = ({}, 1.0)
            square, left = base, int(exponent)
            while left:
                result = self.product(result, square) if left % 2 else result
                left //= 2
                square = self.product(square, square) if left else square
            return result
        return {self.put(taylor.POWER, self.node(base), power=exponent): 1.0}, 0.0

    def function(self, kind: str, of: Form) -> Form:
        """A function, with the node its derivative needs."""
        if not of[0]:
            return {}, float(getattr(math, kind)(of[1]))
        at = self.node(of)
        if kind == "sqrt":
            return self.power(of, 0.5)
        if kind == "exp":
            return {self.put(taylor.EXP, at): 1.0}, 0.0
        if kind == "log":
            return {self.put(taylor.LOG, at, at): 1.0}, 0.0
        if kind == "asinh":
            root = self.power(combined([(1.0, self.product(of, of)), (1.0, ({}, 1.0))]), 0.5)
            return {self.put(taylor.ASINH, at, self.node(root)): 1.0}, 0.0
        known = self.known.get((taylor.TANH, at))
        if known is None:
            known = self.known[(taylor.TANH, at)] = self.put(taylor.TANH, at, power=float(at))
            slope = self.put(taylor.SLOPE, at, self.put(taylor.SQUARE, known))
            row = self.rows[known - self.size]
            self.rows[known - self.size] = (row[0], row[1], slope, row[3], row[4])
        return {known: 1.0}, 0.0


def combined(terms: Any) -> Form:
    """A weighted sum of linear forms."""
    weights: dict[int, float] = {}
    constant = 0.0
    for factor, (part, value) in terms:
        constant += factor * value
        for node, weight in part.items():
            weights[node] = weights.get(node, 0.0) + factor * weight
    return {node: weight for node, weight in weights.items() if weight != 0.0}, constant


def tape(system: Oscillator) -> Tape:
    """The flat arrays of a system with a curved law."""
    return _Builder(system).build()


class _Builder:
    """Turns a law's expressions into nodes; lives for one call of :func:`tape`."""

    def __init__(self, system: Oscillator) -> None:
        law = system.law
        assert isinstance(law, CurvedLaw)
        self.system, self.law, self.motion, self.modes = system, law, system.drive.motion(), law.rates()
        self.memory = tuple(law.memory)
        self.names = ("x", "v", *self.memory, "1", *self.motion.rates)
        self.size, self.one = len(self.names), 2 + len(self.memory)
        motion = self.motion
        self.base, self.force = self.form(motion.base), self.form(motion.force)
        self.signal = {self.names.index(name): self.form(rate) for name, rate in motion.rates.items()}
        face = self.form(motion.face)
        self.face = [face, self.moved(face), self.moved(self.moved(face))]
        damper = self.moved(self.base) if system.damper == "base" else ({}, 0.0)
        self.push = combined([
            (1.0, self.force), (system.stiffness, self.base), (-system.stiffness, ({0: 1.0}, 0.0)),
            (-system.damping, ({1: 1.0}, 0.0)), (system.damping, damper),
        ])  # fmt: skip

    def form(self, row: Mapping[str, float]) -> Form:
        """A drive's linear form over the state."""
        weights = {self.names.index(name): value for name, value in row.items() if name != "1"}
        return weights, row.get("1", 0.0)

    def moved(self, form: Form) -> Form:
        """The rate of a form of the drive's signals."""
        return combined((weight, self.signal[node]) for node, weight in form[0].items())

    def symbols(self) -> dict[str, Form]:
        """What a law's symbols are: x and v relative to the counter-face."""
        own = {name: ({j: 1.0}, 0.0) for j, name in enumerate(self.names[: self.one])}
        own["x"] = combined([(1.0, own["x"]), (-1.0, self.face[0])])
        own["v"] = combined([(1.0, own["v"]), (-1.0, self.face[1])])
        return {**own, "1": ({}, 1.0)}

    def row(self, form: Form) -> Array:
        """A linear form of the state as an array."""
        row = np.zeros(self.size)
        row[list(form[0])] = list(form[0].values())
        row[self.one] += form[1]
        return row

    def mode(self, mode: CurvedMode) -> tuple[_Nodes, _Nodes, list[Scaled], list[Scaled], dict[str, int]]:
        """Nodes for the march and with outputs, rates of the entries, nodes of the exits and of the outputs."""
        symbols = self.symbols()
        march = _Nodes(self.size, symbols)
        if mode.friction is None:
            friction = combined([(1.0, self.push), (-self.system.mass, self.face[2])])
            rates = {0: self.face[1], 1: self.face[2]}
        else:
            friction = march.form(mode.friction)
            rates = {0: ({1: 1.0}, 0.0), 1: combined([(1.0, self.push), (-1.0, friction)])}
            rates[1] = combined([(1 / self.system.mass, rates[1])])
        for j, name in enumerate(self.memory):
            rates[2 + j] = march.form(mode.rates[name]) if name in mode.rates else ({}, 0.0)
        rates |= self.signal
        still: Form = ({}, 0.0)
        entries = [march.scaled(rates[j]) if rates.get(j, still) != still else (-1, 0.0) for j in range(self.size)]
        known = {**symbols, "f": friction}
        exits = [
            march.scaled(combined((value, known[name]) for name, value in exit_.quantity.items()))
            for exit_ in mode.exits
        ]
        watched = _Nodes(self.size, symbols)
        watched.rows, watched.known = list(march.rows), dict(march.known)
        outputs = {
            "a": rates[1], "friction": friction, "z": self.base, "slip": symbols["v"], "force": self.force,
            **{name: ({j: 1.0}, 0.0) for j, name in enumerate(self.names)},
        }  # fmt: skip
        return march, watched, entries, exits, {name: watched.node(form) for name, form in outputs.items()}

    def build(self) -> Tape:
        order = {mode.name: j for j, mode in enumerate(self.modes)}
        parts = [self.mode(mode) for mode in self.modes]
        rate = tuple(np.array([[r[c] for r in part[2]] for part in parts], dtype=d) for c, d in enumerate(DTYPES))
        leaving = [exit_ for mode in self.modes for exit_ in mode.exits]
        # an exit at zero velocity leaves exactly none: rounding must not decide what follows
        held = [set(e.quantity) == {"v"} or self.modes[order[e.to]].friction is None for e in leaving]
        exits = (
            np.array([node for part in parts for node, _ in part[3]], dtype=np.int64),
            np.array([order[e.to] for e in leaving], dtype=np.int64),
            np.array([e.crossing for e in leaving], dtype=np.bool_),
            np.array(held, dtype=np.bool_),
            np.cumsum([0, *(len(mode.exits) for mode in self.modes)]),
            self.row(self.face[1]),
            np.array([factor for part in parts for _, factor in part[3]]),
        )
        tones = [(self.names.index(c), self.names.index(s), w, phase) for c, s, w, phase in self.motion.tones]
        entry = self.law.entry
        return Tape(
            system=self.system,
            names=self.names,
            modes=self.modes,
            motion=self.motion,
            physical=self.one,
            entry=(order[entry[0]], order[entry[1]], order[entry[2]]),
            opening=np.array([
                np.zeros(self.size),
                self.row(self.face[1]),
                *(
                    self.row(combined((value, self.symbols()[name]) for name, value in row.items()))
                    for row in self.law.memory.values()
                ),
            ]),
            tones=np.array(tones, dtype=np.float64).reshape(len(tones), 4),
            outputs={"face_rate": self.row(self.face[1]), "slip": self.row(self.symbols()["v"])},
            nodes=(*_flat([part[0] for part in parts]), *rate),
            watched=(*_flat([part[1] for part in parts]), *rate),
            exits=exits,
            guards=_guards([part[0] for part in parts]),
            places={name: np.array([part[4][name] for part in parts], dtype=np.int64) for name in parts[0][4]},
        )  # fmt: skip


def _flat(modes: list[_Nodes]) -> tuple[NDArray[Any], ...]:
    """The nodes of all modes, one after the other."""
    kinds, left, right, power, constant, low, first = [], [], [], [], [], [0], [0]
    weights: list[float] = []
    index: list[int] = []
    none: Form = ({}, 0.0)
    for mode in modes:
        blank = [(taylor.LINEAR, 0, 0, 0.0, none)] * mode.size
        for kind, a, b, exponent, form in [*blank, *mode.rows]:
            kinds.append(kind)
            left.append(a)
            right.append(b)
            power.append(exponent)
            weights.extend(form[0].values())
            index.extend(form[0])
            low.append(len(weights))
            constant.append(form[1])
        first.append(len(kinds))
    whole = (np.array(column, dtype=np.int64) for column in (kinds, left, right, low, index, first))
    kinds_, left_, right_, low_, index_, first_ = whole
    return kinds_, left_, right_, np.array(power), low_, np.array(weights), index_, np.array(constant), first_


def _guards(modes: list[_Nodes]) -> tuple[NDArray[Any], ...]:
    """The nodes whose series may know nothing of what is ahead."""
    kinds = (taylor.EXP, taylor.TANH, taylor.POWER)
    found = [[mode.size + j for j, row in enumerate(mode.rows) if row[0] in kinds] for mode in modes]
    return np.array([node for nodes in found for node in nodes], dtype=np.int64), np.cumsum([0, *map(len, found)])


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
    order : int
        Degree of the polynomials.
    """

    step_starts: Array
    step_lengths: Array
    step_modes: NDArray[np.int64]
    step_states: Array
    order: int

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
        taylor.sample(
            table.watched, self.order, self.step_starts, self.step_lengths, self.step_modes, self.step_states, times,
            nodes, out, step,
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
    return int(np.clip(round(3 - 0.55 * math.log(rtol)), 8, 24))


def _march(table: Tape) -> March:
    def march(clock: Array, state: Array, mode: int, at: tuple[float, float], *rest: Any) -> tuple[int, int, int]:
        return taylor.march(  # type: ignore[no-any-return]
            table.nodes, table.exits, table.guards, table.tones, clock, state, mode, at, table.motion.period, *rest
        )  # fmt: skip

    return march


def run_curved(
    table: Tape,
    state: Array,
    mode: int,
    *,
    course: tuple[tuple[float, float], Stops],
    budget: int,
    rtol: float,
    tell: Callable[[float], None],
    march: March | None = None,
) -> CurvedTrajectory:
    """March from a state at time 0 to the end of the course's time (laps, offset), in chunks."""
    (laps, offset), stops = course
    order, march = degree(rtol), march or _march(table)
    system, size, period = table.system, len(table.names), table.motion.period
    count = int(np.max(np.diff(table.nodes[8])))
    work = (np.zeros(count * (order + 1)), np.zeros(order + 1), np.zeros(order + 1))
    total = offset + (laps * period if math.isfinite(period) else 0.0)
    scale = min(period if math.isfinite(period) else 1 / system.frequency if system.stiffness else total, total)
    clock, state, big = np.array([0.0, 0.0, 1e-6 * scale]), state.copy(), np.abs(state)
    kept: list[tuple[NDArray[Any], ...]] = []
    status = "complete"
    try:
        for at, (signals, values) in stops:
            state[signals] = values
            clock[2] = min(clock[2], scale)  # at rest steps would grow for ever
            outcome = taylor.FULL
            while outcome == taylor.FULL:
                room = room_for(CHUNK, size)
                before = clock.copy()
                outcome, written, mode = march(clock, state, mode, at, 0.1 * rtol, order, big, room, work)
                if written:
                    kept.append(tuple(column[:written] for column in room))
                passed = clock[1] - before[1] + ((clock[0] - before[0]) * period if clock[0] != before[0] else 0.0)
                ahead = total - clock[1] - (clock[0] * period if clock[0] else 0.0)
                _refuse(outcome, table, state, clock, passed, ahead, CHUNK * len(kept))
                left = int(np.sum(room[5][:written] >= 0))
                if outcome == taylor.FULL and left > budget * max(1.0, passed / scale):
                    raise SolveError(
                        f"{left} events within {passed:g} s at {_named(table, state)}",
                        f"a period of {scale:g} s has at most {budget} events",
                        "check the law there (chatter), or raise budget=",
                    )
                tell(1.0 - ahead / total)
    except KeyboardInterrupt:
        if not kept:
            raise
        status = "interrupted"
        lap, offset, length = (float(column[-1]) for column in kept[-1][:3])
        total = offset + length + (lap * period if math.isfinite(period) else 0.0)
    if status == "complete":
        tell(1.0)
        status = "at rest" if _at_rest(table, state, mode, work[0]) else status
    return _assembled(table, kept, total, status, order)


def room_for(count: int, size: int) -> tuple[NDArray[Any], ...]:
    return (np.empty(count), np.empty(count), np.empty(count), np.empty(count, np.int64), np.empty((count, size)),
            np.empty(count, np.int16))  # fmt: skip


def _assembled(
    table: Tape, kept: list[tuple[NDArray[Any], ...]], total: float, status: str, order: int
) -> CurvedTrajectory:
    """Steps gathered, and pieces from event to event."""
    laps, offsets, lengths, modes, states, ends = (np.concatenate(column) for column in zip(*kept, strict=True))
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
        order=order,
    )


def _at_rest(table: Tape, state: Array, mode: int, series: Array) -> bool:
    taylor.expand(table.nodes, mode, state, 1.0, 1, 2, series)
    return bool(np.all(series[1 : 2 * len(state) : 2] == 0.0))


def _refuse(outcome: int, table: Tape, state: Array, clock: Array, passed: float, ahead: float, done: int) -> None:
    place = f"lap {clock[0]:g}, {clock[1]:g} s, at {_named(table, state)}"
    if outcome == taylor.CHATTER:
        raise SolveError(
            f"transitions without time between them, {place}",
            "a law leaves every state in one direction",
            "check the law's exits there",
        )
    if outcome == taylor.STALL:
        raise SolveError(
            f"a step of no length, {place}",
            "friction and its rates are finite and smooth within a mode",
            "check the law there (a logarithm or a power of nothing)",
        )
    if outcome == taylor.FULL and done >= PATIENCE and passed * STEPS < CHUNK * ahead:
        raise SolveError(
            f"steps of {passed / CHUNK:.1e} s with {ahead:g} s ahead, {place}",
            f"a run takes at most {STEPS:g} steps; the law is stiff here for an explicit method",
            "take a larger mass, a larger rtol=, or a shorter time",
        )


def _named(table: Tape, state: Array) -> str:
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(table.names[: table.physical], state, strict=False))
