"""The flat tables of many oscillators at once: each law and each drive is read once, however many share it.

What :func:`stickslip.solve.automaton.automaton` makes of one oscillator is made here of all, entry by entry along a
leading axis; the closed forms of a mode are worked out once for all that differ in a constant force alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import OPTIONS, compiled
from stickslip.drives import Drive
from stickslip.laws.base import Law, Mode
from stickslip.oscillator import Oscillator
from stickslip.solve.automaton import CANCELLED, DEGREE, SETTLED, Array, halved
from stickslip.solve.phasors import Phasors, distinct, phasors

Index = NDArray[np.int64]
TERMS = 26  # of a Taylor series whose flow turns half a radian at most: the rest is below the last digit
PART = 4  # a cell turns one radian; its exponential is summed over a fourth of it, and squared twice


@dataclass(frozen=True, eq=False)
class Fleet:
    """Oscillators of one kind: their laws name the same modes and their drives the same signals.

    Attributes
    ----------
    laws : tuple of Law
        The different ones.
    drives : tuple of Drive
        The different ones.
    law, drive : ndarray (B,)
        Which law and which drive each oscillator has.
    mass, stiffness, damping : ndarray (B,)
        In kg, N/m and N s/m.
    on_base : ndarray (B,)
        Whether the damper is fixed to the base.
    """

    laws: tuple[Law, ...]
    drives: tuple[Drive, ...]
    law: Index
    drive: Index
    mass: Array
    stiffness: Array
    damping: Array
    on_base: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Tables:
    """The tables of a fleet; B oscillators, M modes, E exits, N entries of the state.

    The arrays are those of :class:`stickslip.solve.automaton.Automaton` with a leading axis, but for ``target``,
    ``crossing`` and ``first``, which all share.
    """

    names: tuple[str, ...]
    modes: tuple[Mode, ...]
    flow: Array
    cell: Array
    hop: Array
    series: Array
    target: Index
    crossing: NDArray[np.bool_]
    reset: Array
    first: Index
    tones: Array
    friction: Array
    slip: Array
    gap: Array
    period: Array
    opening: Array
    begin: Array
    entry: tuple[int, int, int]
    physical: int

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """The arrays that the kernels read, in their order."""
        return (self.flow, self.cell, self.hop, self.series, self.target, self.crossing, self.reset, self.first,
                self.tones)  # fmt: skip

    @property
    def phasors(self) -> Phasors:
        """The tables of the fast path."""
        return phasors(
            self.flow, self.series[:, :, 0], self.reset, self.tones, first=self.first, physical=self.physical
        )


def kind_of_law(law: Any) -> Any:
    """What laws of one fleet have in common; None for a law without linear modes."""
    if hasattr(law, "rates") or not hasattr(law, "modes"):
        return None
    modes = law.modes()
    exits = [tuple((e.to, e.crossing, set(e.quantity) == {"v"}, *e.reset) for e in mode.exits) for mode in modes]
    parts = [(mode.name, mode.kind, mode.side, mode.friction is None) for mode in modes]
    return tuple(parts), tuple(exits), tuple(law.memory), tuple(law.places), law.entry


def kind_of_drive(drive: Drive) -> Any:
    """What drives of one fleet have in common; None for a drive with knots or several tones."""
    motion = drive.motion()
    if motion.knots is not None or len(motion.tones) > 1:
        return None
    return tuple(motion.rates), tuple(tone[:2] for tone in motion.tones), math.isfinite(motion.period)


def fleet_of(systems: Sequence[Oscillator]) -> Fleet:
    """A fleet of oscillators given one by one."""
    each = np.arange(len(systems))
    laws: Any = tuple(s.law for s in systems)
    mass, stiffness, damping = np.array([[s.mass, s.stiffness, s.damping] for s in systems], dtype=np.float64).T
    on_base = np.array([s.damper == "base" for s in systems])
    return Fleet(laws, tuple(s.drive for s in systems), each, each, mass, stiffness, damping, on_base)


class _Builder:
    """Rows over names turned into rows over the state, (B, N); lives for one call of :func:`fleet_tables`."""

    def __init__(self, fleet: Fleet) -> None:
        self.fleet, self.motions = fleet, [drive.motion() for drive in fleet.drives]
        law, motion = fleet.laws[0], self.motions[0]
        self.tables = [law.modes() for law in fleet.laws]
        self.memory, self.places = tuple(law.memory), law.places
        self.names = ("x", "v", *self.memory, "1", *motion.rates)
        self.size, self.count = len(self.names), len(fleet.law)
        self.x, self.v = self.entry("x"), self.entry("v")
        self.base = self.driven([m.base for m in self.motions])
        self.signals = np.zeros((self.count, self.size, self.size))
        for name in motion.rates:
            self.signals[:, self.names.index(name)] = self.driven([m.rates[name] for m in self.motions])
        self.face = [self.driven([m.face for m in self.motions])]
        self.face.append(_through(self.face[0], self.signals))
        self.face.append(_through(self.face[1], self.signals))
        damper = np.where(fleet.on_base[:, None], _through(self.base, self.signals), 0.0)
        self.push = (
            self.driven([m.force for m in self.motions])
            + fleet.stiffness[:, None] * (self.base - self.x)
            - fleet.damping[:, None] * (self.v - damper)
        )

    def entry(self, name: str) -> Array:
        """The row that reads one entry of the state."""
        return np.tile(np.eye(self.size)[self.names.index(name)], (self.count, 1))

    def rows(self, forms: Sequence[Mapping[str, float]]) -> Array:
        """Linear forms over the state's own names."""
        rows = np.zeros((len(forms), self.size))
        for row, form in zip(rows, forms, strict=True):
            for name, value in form.items():
                row[self.names.index(name)] += value
        return rows

    def driven(self, forms: Sequence[Mapping[str, float]]) -> Array:
        """One form of each drive."""
        return np.asarray(self.rows(forms)[self.fleet.drive])

    def relative(self, forms: Sequence[Mapping[str, float]], friction: Array, slope: Array | None = None) -> Array:
        """One form of each law: x and v relative to the counter-face, f the friction of the mode, df its rate."""
        own = [{name: value for name, value in form.items() if name not in ("f", "df")} for form in forms]
        moving = [[sum(v for n, v in form.items() if n == "x" or n in self.places), form.get("v", 0.0)] for form in own]
        carried, speed = np.array(moving)[self.fleet.law].T[:, :, None]
        f, df = np.array([[form.get("f", 0.0), form.get("df", 0.0)] for form in forms])[self.fleet.law].T[:, :, None]
        rows: Array = self.rows(own)[self.fleet.law] - carried * self.face[0] - speed * self.face[1] + f * friction
        return rows if slope is None else rows + df * slope

    def moved(self, name: str, order: int) -> Array:
        """What a place owes to the counter-face: its displacement (order 0) or velocity (1)."""
        return self.face[order] if name in self.places else np.zeros((self.count, self.size))

    def motion_in(self, number: int) -> tuple[Array, Array]:
        """Friction and flow of a mode."""
        modes = [table[number] for table in self.tables]
        flow = self.signals.copy()
        flow[:, 0, 1] = 1.0
        if modes[0].friction is None:
            friction = self.push - self.fleet.mass[:, None] * self.face[2]
            flow[:, 0], flow[:, 1] = self.face[1], self.face[2]
        else:
            friction = self.relative([mode.friction or {} for mode in modes], np.zeros((self.count, self.size)))
            flow[:, 1] = (self.push - friction) / self.fleet.mass[:, None]
        slope = _through(friction, flow)
        for name in self.memory:
            rate = self.relative([mode.rates.get(name, {}) for mode in modes], friction, slope)
            flow[:, self.names.index(name)] = rate + self.moved(name, 1)
        return friction, flow

    def carry(self, mode: int, number: int, friction: Array, held: bool, carry: Array) -> None:
        """R of an exit, written over the unit matrices of `carry`."""
        exits = [table[mode].exits[number] for table in self.tables]
        for name in exits[0].reset:
            row = self.relative([e.reset[name] for e in exits], friction) + self.moved(name, 0)
            carry[:, self.names.index(name)] = row
        if held:
            carry[:, 1] = _through(self.face[1], carry)

    def build(self) -> Tables:
        modes, law, motion = self.tables[0], self.fleet.laws[0], self.motions[0]
        order = {mode.name: j for j, mode in enumerate(modes)}
        frictions, flows = (
            np.stack(rows, axis=1) for rows in zip(*map(self.motion_in, range(len(modes))), strict=True)
        )
        exits = [(j, e, exit_) for j, mode in enumerate(modes) for e, exit_ in enumerate(mode.exits)]
        first = np.cumsum([0] + [len(mode.exits) for mode in modes])
        target = np.array([order[exit_.to] for *_, exit_ in exits], dtype=np.int64)
        quantities = np.empty((self.count, len(exits), self.size))
        reset = np.empty((self.count, len(exits), self.size, self.size))
        reset[...] = np.eye(self.size)
        slopes = np.einsum("bmi,bmij->bmj", frictions, flows)
        for row, (j, e, exit_) in enumerate(exits):
            forms = [table[j].exits[e].quantity for table in self.tables]
            quantities[:, row] = self.relative(forms, frictions[:, j], slopes[:, j])
            # an exit at zero velocity leaves exactly none: rounding must not decide what follows
            stopped = set(exit_.quantity) == {"v"}
            self.carry(j, e, frictions[:, j], stopped or modes[target[row]].friction is None, reset[:, row])
        series = np.empty((self.count, len(exits), DEGREE + 1, self.size))
        _derive(quantities, flows, first, series, np.empty((2, self.size**2), np.int64), np.empty(self.size**2))
        cell, hop = _cells(flows, self.names.index("1"))
        none = np.zeros((self.count, self.size))
        opening = [none, self.face[1]]
        for name in self.memory:
            forms = [law.memory[name] for law in self.fleet.laws]
            opening += [self.relative(forms, none) + self.moved(name, 0)]
        begin = self.driven([m.start for m in self.motions])
        begin[:, self.names.index("1")] = 1.0
        places = [(self.names.index(c), self.names.index(s)) for c, s, *_ in motion.tones]
        tones = np.array([[(*p, *t[2:]) for p, t in zip(places, m.tones, strict=True)] for m in self.motions])
        return Tables(
            names=self.names, modes=modes, flow=flows, cell=cell, hop=hop, series=series, target=target,
            crossing=np.array([exit_.crossing for *_, exit_ in exits], dtype=np.bool_), reset=reset, first=first,
            tones=tones.reshape(len(self.motions), len(places), 4)[self.fleet.drive],
            friction=frictions, slip=self.v - self.face[1], gap=self.x - self.face[0],
            period=np.array([m.period for m in self.motions])[self.fleet.drive], opening=np.stack(opening, axis=1),
            begin=begin, entry=(order[law.entry[0]], order[law.entry[1]], order[law.entry[2]]),
            physical=2 + len(self.memory),
        )  # fmt: skip


def fleet_tables(fleet: Fleet) -> Tables:
    """The flat tables of a fleet."""
    return _Builder(fleet).build()


def _through(rows: Array, flow: Array) -> Array:
    """Each row times its own matrix."""
    return np.asarray(np.einsum("bi,bij->bj", rows, flow))


@compiled(**OPTIONS, nogil=True)
def _derive(quantities, flows, first, out, places, work):
    """q A^k of every exit; where terms cancel but for their rounding, nothing is left."""
    count, modes, n, _ = flows.shape
    for b in range(count):
        for m in range(modes):
            filled = 0  # entries of the flow, column by column
            for j in range(n):
                for i in range(n):
                    if flows[b, m, i, j] != 0.0:
                        places[0, filled], work[filled] = i, flows[b, m, i, j]
                        filled += 1
                places[1, j] = filled
            for e in range(first[m], first[m + 1]):
                for j in range(n):
                    out[b, e, 0, j] = quantities[b, e, j]
                for k in range(out.shape[2] - 1):
                    f = 0
                    for j in range(n):
                        total, size = 0.0, 0.0
                        while f < places[1, j]:
                            term = out[b, e, k, places[0, f]] * work[f]
                            total += term
                            size += abs(term)
                            f += 1
                        out[b, e, k + 1, j] = total if abs(total) > CANCELLED * size else 0.0


def _cells(flow: Array, constant: int) -> tuple[Array, Array]:
    """Length of a Taylor cell [s] of each flow (B, M, N, N), and exp(A cell) as `hop` has it.

    The column of the constant stands for a force that does not change: the exponential is linear in it, and that of
    the rest is the same for all flows that differ in that force alone.
    """
    count, modes, size, _ = flow.shape
    whole = flow.reshape(-1, size, size)
    core = whole.copy()
    core[:, :, constant] = 0.0
    where, which = np.empty((2, len(core)), np.int64)
    found = distinct(core.reshape(len(core), -1), where, which)
    where = where[:found]
    core, rate = core[where], np.zeros(found)
    for mode in range(modes):
        own = where % modes == mode
        rate[own] = _fastest(core[own])
    cell = np.divide(1.0, rate, out=np.full(found, np.inf), where=rate > 0)
    turned, integral = _exponentials(core, np.where(np.isfinite(cell), cell, 0.0))
    hop = np.ascontiguousarray(np.moveaxis(halved(turned), 0, 1))[which]
    pushed = np.einsum("bij,bj->bi", integral[which], whole[:, :, constant].astype(np.longdouble))
    hop[:, :, :, constant] = np.moveaxis(halved(turned[:, :, constant][which] + pushed), 0, 1)
    return cell[which].reshape(count, modes), hop.reshape(count, modes, 3, size, size)


def _fastest(flow: Array) -> Array:
    """The fastest rate of each flow [1/s], from the strongly connected parts that any of them has."""
    size = flow.shape[1]
    reach = np.any(flow != 0, axis=0) | np.eye(size, dtype=bool)
    for _ in range(max(1, size.bit_length())):
        reach = reach @ reach
    parts = {tuple(np.flatnonzero(reach[j] & reach[:, j])) for j in range(size)}
    rates = np.zeros(len(flow))
    for part in parts:
        own = flow[:, part][:, :, part]
        values = own[:, :, 0] if len(part) == 1 else np.linalg.eigvals(own)
        rates = np.maximum(rates, np.max(np.abs(values), axis=1))
    return rates


def _exponentials(flow: Array, time: Array) -> tuple[Any, Any]:
    """exp(A t) of each flow in extended precision, and its integral over the time, in which it turns one radian."""
    part = time.astype(np.longdouble)[:, None, None] / PART
    step = flow.astype(np.longdouble) * part
    unit = np.broadcast_to(np.eye(flow.shape[1], dtype=np.longdouble), flow.shape)
    term, turned, integral = unit, unit.copy(), unit.copy()
    for k in range(1, TERMS):
        term = term @ step / k
        before = turned.copy()
        turned += term
        integral += term / (k + 1)
        if k >= SETTLED and np.array_equal(turned, before):
            break
    integral *= part
    for _ in range(int(math.log2(PART))):
        integral = integral + turned @ integral
        turned = turned @ turned
    return turned, integral


def opened(tables: Tables, start: Mapping[str, Array]) -> tuple[Array, Index]:
    """State of each oscillator at time 0 and its mode, before any exit that is due at once."""
    state = tables.begin.copy()
    for j, name in enumerate(tables.names[: tables.physical]):
        given = start.get(name)
        state[:, j] = np.einsum("bi,bi->b", tables.opening[:, j], state) if given is None else given
    if len(set(tables.entry)) == 1:
        return state, np.full(len(state), tables.entry[1])
    return state, np.array(tables.entry)[np.sign(np.einsum("bi,bi->b", tables.slip, state)).astype(np.int64) + 1]
