"""From a system with a curved law to a tape of operations and flat arrays."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.drives.kinds import Motion
from stickslip.errors import ModelError
from stickslip.laws.base import Exit
from stickslip.laws.curved import Creeping, CurvedLaw, CurvedMode, Expression
from stickslip.laws.filippov import with_sliding_modes
from stickslip.oscillator import Oscillator
from stickslip.solve import taylor
from stickslip.solve.series import Nodes
from stickslip.solve.tables import by_value, mode_number
from stickslip.solve.taylor import Array, Exits, Guards, Sums

Form = tuple[dict[int, float], float]  # weights of nodes, and a constant
Scaled = tuple[int, float]  # a node and a factor

DTYPES = (np.int64, np.float64)
LEAST = 1e-13  # some hundred roundings of the motion's own speed: below it a velocity that falls can not be followed


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
    nodes : Nodes
        The operations, for the march.
    kept : tuple of tuple of int
        Nodes of each mode whose series the march looks at.
    sums : Sums
        What rounds each rate and each exit.
    watched : Nodes
        As `nodes`, with the nodes of all outputs as well.
    exits : Exits
        How each mode may end.
    guards : Guards
        Functions that fall asleep.
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
    nodes: Nodes
    kept: tuple[tuple[int, ...], ...]
    sums: Sums
    watched: Nodes
    exits: Exits
    guards: Guards
    places: Mapping[str, NDArray[np.int64]]

    @property
    def shown(self) -> tuple[tuple[int, ...], ...]:
        """Nodes of each mode that outputs have."""
        size = len(self.names)
        columns = np.array(list(self.places.values())).T
        return tuple(tuple(sorted({*row[row >= size].tolist()})) for row in columns)

    @property
    def settling(self) -> frozenset[int]:
        """Exits that are no event: none."""
        return frozenset()

    @property
    def first(self) -> NDArray[np.int64]:
        """Exits of mode j are ``first[j]`` to ``first[j + 1]``."""
        return self.exits.first

    @property
    def target(self) -> NDArray[np.int64]:
        """The mode behind each exit."""
        return self.exits.target

    def index(self, mode: str) -> int:
        """Number of the mode of that name."""
        return mode_number(self.modes, mode)


class _Operations:
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
            (over, a), (under, b) = (self.scaled(form) for form in forms)
            return {self.put(taylor.QUOTIENT, over, under): a / b}, 0.0
        if kind == "power":
            return self.power(forms[0], expression.value)
        return self.function(kind, forms[0])

    def product(self, a: Form, b: Form) -> Form:
        """a b; a number only scales."""
        if not a[0] or not b[0]:
            return combined([(a[1], b)] if not a[0] else [(b[1], a)])
        (left, one), (right, other) = self.scaled(a), self.scaled(b)
        if left == right:
            return {self.put(taylor.SQUARE, left): one * other}, 0.0
        return {self.put(taylor.PRODUCT, min(left, right), max(left, right)): one * other}, 0.0

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
    return _known(system) if by_value(system) else _built(system)


def _built(system: Oscillator) -> Tape:
    return _Builder(system).build()


_known = lru_cache(maxsize=32)(_built)


class _Builder:
    """Turns a law's expressions into nodes; lives for one call of :func:`tape`."""

    def __init__(self, system: Oscillator) -> None:
        law = system.law
        assert isinstance(law, CurvedLaw)
        self.system, self.law, self.motion, self.entry = system, law, system.drive.motion(), law.entry
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
        self.modes, self.least = with_sliding_modes(law.rates()), 0.0
        if isinstance(law, Creeping):
            self.least = self.standstill(law)
            stop = {side: (Exit({"v": -float(side), "1": 0.5 * self.least}, "held"),) for side in (-1, 1)}
            sliding = (replace(mode, exits=stop[mode.side]) for mode in self.modes)
            self.modes, self.entry = (*sliding, law.holding(self.least)), (self.entry[0], "held", self.entry[2])

    def standstill(self, law: Creeping) -> float:
        """The speed [m/s] that is as good as none: what friction takes from the mass in a part `LEAST` of a period."""
        system, forward = self.system, law.rates()[-1]
        assert forward.friction is not None
        memory = {name: row.get("1", 0.0) for name, row in self.law.memory.items()}
        period = self.motion.period
        time = period if math.isfinite(period) else 1 / system.frequency if system.stiffness else 1.0
        face = sum(abs(weight) for weight in self.face[1][0].values()) + abs(self.face[1][1])
        return LEAST * (forward.friction.at(x=0.0, v=1.0, **memory) / system.mass * time + face)

    def left(self, mode: CurvedMode, exit_: Exit, to: CurvedMode) -> float:
        """The speed [m/s] that an exit leaves against the counter-face; nan where it leaves what there is.

        Exactly none where the contact holds, or stops: rounding must not decide what follows.
        """
        if to.friction is None or set(exit_.quantity) == {"v"}:
            return to.speed
        return to.side * self.least if mode.creep is not None else math.nan

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

    def mode(self, mode: CurvedMode) -> tuple[_Operations, _Operations, list[Scaled], list[Scaled], dict[str, int]]:
        """Nodes for the march and with outputs, rates of the entries, nodes of the exits and of the outputs."""
        symbols = self.symbols()
        moving = _Operations(self.size, symbols)
        if mode.friction is None:
            friction = combined([(1.0, self.push), (-self.system.mass, self.face[2])])
            symbols["f"] = friction
            symbols["v"] = moving.form(mode.creep) if mode.creep is not None else symbols["v"]
            creep: Form = symbols["v"] if mode.creep is not None else ({}, 0.0)
            rates = {0: combined([(1.0, self.face[1]), (1.0, creep), (1.0, ({}, mode.speed))]), 1: self.face[2]}
        else:
            friction = moving.form(mode.friction)
            rates = {0: ({1: 1.0}, 0.0), 1: combined([(1.0, self.push), (-1.0, friction)])}
            rates[1] = combined([(1 / self.system.mass, rates[1])])
        for j, name in enumerate(self.memory):
            rates[2 + j] = moving.form(mode.rates[name]) if name in mode.rates else ({}, 0.0)
        rates |= self.signal
        still: Form = ({}, 0.0)
        entries = [moving.scaled(rates[j]) if rates.get(j, still) != still else (-1, 0.0) for j in range(self.size)]
        known = {**symbols, "f": friction} | {name: moving.form(level) for name, level in mode.levels.items()}
        exits = [
            moving.scaled(combined((value, known[name]) for name, value in exit_.quantity.items()))
            for exit_ in mode.exits
        ]
        watched = _Operations(self.size, symbols)
        watched.rows, watched.known = list(moving.rows), dict(moving.known)
        outputs = {
            "a": rates[1], "friction": friction, "z": self.base, "slip": symbols["v"], "force": self.force,
            **{name: ({j: 1.0}, 0.0) for j, name in enumerate(self.names)},
            **({"v": rates[0]} if mode.creep is not None else {}),
        }  # fmt: skip
        return moving, watched, entries, exits, {name: watched.node(form) for name, form in outputs.items()}

    def build(self) -> Tape:
        order = {mode.name: j for j, mode in enumerate(self.modes)}
        parts = [self.mode(mode) for mode in self.modes]
        rate = tuple(np.array([[r[c] for r in part[2]] for part in parts], dtype=d) for c, d in enumerate(DTYPES))
        leaving = [(mode, exit_) for mode in self.modes for exit_ in mode.exits]
        exits = Exits(
            node=np.array([node for part in parts for node, _ in part[3]], dtype=np.int64),
            factor=np.array([factor for part in parts for _, factor in part[3]], dtype=np.float64),
            target=np.array([order[e.to] for _, e in leaving], dtype=np.int64),
            crossing=np.array([e.crossing for _, e in leaving], dtype=np.bool_),
            speed=np.array([self.left(mode, exit_, self.modes[order[exit_.to]]) for mode, exit_ in leaving]),
            first=np.cumsum([0, *(len(mode.exits) for mode in self.modes)]),
        )
        nodes = Nodes(*_flat([part[0] for part in parts]), *rate)
        guards = _guards([part[0] for part in parts])
        sums = _sums([part[0] for part in parts], [part[2] for part in parts], [part[3] for part in parts])
        tones = [(self.names.index(c), self.names.index(s), w, phase) for c, s, w, phase in self.motion.tones]
        return Tape(
            system=self.system,
            names=self.names,
            modes=self.modes,
            motion=self.motion,
            physical=self.one,
            entry=(order[self.entry[0]], order[self.entry[1]], order[self.entry[2]]),
            opening=np.array(
                [
                    np.zeros(self.size),
                    self.row(self.face[1]),
                    *(
                        self.row(combined((value, self.symbols()[name]) for name, value in row.items()))
                        for row in self.law.memory.values()
                    ),
                ]
            ),
            tones=np.array(tones, dtype=np.float64).reshape(len(tones), 4),
            outputs={"face_rate": self.row(self.face[1]), "slip": self.row(self.symbols()["v"])},
            nodes=nodes,
            kept=_kept(self.size, sums, exits, guards),
            sums=sums,
            watched=Nodes(*_flat([part[1] for part in parts]), *rate),
            exits=exits,
            guards=guards,
            places={name: np.array([part[4][name] for part in parts], dtype=np.int64) for name in parts[0][4]},
        )


def _flat(modes: list[_Operations]) -> tuple[NDArray[Any], ...]:
    """The nodes of all modes, one after the other."""
    blank: tuple[int, int, int, float, Form] = (taylor.LINEAR, 0, 0, 0.0, ({}, 0.0))
    kinds, left, right, power, forms = zip(*(row for m in modes for row in [blank] * m.size + m.rows), strict=True)
    weights = np.array([weight for form, _ in forms for weight in form.values()], dtype=np.float64)
    low = [0, *itertools.accumulate(len(form) for form, _ in forms)]
    index = [node for form, _ in forms for node in form]
    first = [0, *itertools.accumulate(m.size + len(m.rows) for m in modes)]
    whole = (np.array(column, dtype=np.int64) for column in (kinds, left, right, low, index, first))
    kinds_, left_, right_, low_, index_, first_ = whole
    constant = np.array([value for _, value in forms])
    return kinds_, left_, right_, np.array(power), low_, weights, index_, constant, first_


def _guards(modes: list[_Operations]) -> Guards:
    """The nodes whose series may know nothing of what is ahead: what they are, and of what; and the first by mode."""
    kinds = (taylor.EXP, taylor.TANH, taylor.POWER)
    guarded = [[row[:2] for row in mode.rows if row[0] in kinds] for mode in modes]
    pairs = np.array([row for rows in guarded for row in rows], dtype=np.int64).reshape(-1, 2)
    return Guards(pairs[:, 0].copy(), pairs[:, 1].copy(), np.cumsum([0, *map(len, guarded)]))


def _sums(modes: list[_Operations], rates: Any, exits: Any) -> Sums:
    """What rounds each rate (by mode and entry) and each exit: sizes of the weights of a sum, and their nodes."""
    low, weights, constant = [0], list[float](), list[float]()
    index: list[int] = []
    for kind in (rates, exits):
        for mode, pairs in zip(modes, kind, strict=True):
            for node, factor in pairs:
                row = mode.rows[node - mode.size] if node >= mode.size else None
                form = row[4] if row and row[0] == taylor.LINEAR else ({} if node < 0 else {node: 1.0}, 0.0)
                weights.extend(abs(factor * weight) for weight in form[0].values())
                index.extend(form[0])
                low.append(len(weights))
                constant.append(abs(factor * form[1]))
    return Sums(np.array(low), np.array(weights), np.array(index, dtype=np.int64), np.array(constant))


def _kept(size: int, sums: Sums, exits: Exits, guards: Guards) -> tuple[tuple[int, ...], ...]:
    """Nodes of each mode that are exits, are guarded, or make up a rate or an exit."""
    count, kept, low, first = len(exits.first) - 1, [], sums.first, exits.first
    for mode in range(count):
        rates = sums.node[low[mode * size] : low[(mode + 1) * size]]
        terms = sums.node[low[count * size + first[mode]] : low[count * size + first[mode + 1]]]
        leaving = exits.node[first[mode] : first[mode + 1]]
        asleep = guards.argument[guards.first[mode] : guards.first[mode + 1]]
        looked = {*rates.tolist(), *terms.tolist(), *leaving.tolist(), *asleep.tolist()}
        kept.append(tuple(sorted(node for node in looked if node >= size)))
    return tuple(kept)
