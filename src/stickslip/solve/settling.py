"""Modes in which a part of the motion dies far sooner than the rest moves: followed until it is dead, then left out.

The rates of such a mode fall into two groups: fast ones, which all decay, and those of the motion. Its state is the sum
of its parts in the two invariant subspaces, S = P S + (1 - P) S, with P the spectral projector on the slow one, which
commutes with the flow A. After `DEAD` time constants the fast part is below rounding whatever it was, and from then on

    S' = (P A - r (1 - P)) S,    S = P S,

to e^-DEAD times the condition of P: with r the fastest of the slow rates this flow has no fast one, so its cells are
long, and what rounding, or a neighbour's state, brings in beside the slow subspace dies as well. The mode becomes two:
one that ends by a clock, whose exit drops the fast part (S -> P S), and one that follows, with the same exits.

P is the matrix sign function of A + rho, with rho between the two groups (Higham, Functions of Matrices, chapter 5):
(1 + sign) / 2, by Newton's iteration. It is summed in many digits, since P A is the difference of numbers that are as
much larger as the fast rates are.
"""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import Decimal, localcontext
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import SolveError
from stickslip.solve.cells import DEGREE, cells_of, derivatives, eigenvalues
from stickslip.solve.tables import OWN, Tables

APART = 1e4  # fastest over slow rates from which a mode is split: the fast part is followed for 60 cells and more
FARTHEST = 1e13  # fast over slow rates: beyond, rounding of the state takes part in the speed that the contact has
DEAD = 60.0  # time constants after which it is dead: e^-60 = 1e-26
WORTH = 0.1  # of the slow part's cells, that following the fast part until it is dead may take
DAMPED = 10.0  # times the middle of the gap, at which all of the fast part decays
NEIGHBOUR = 0.9  # of what is asked of a mode, that is asked of one of a system next to it
DIGITS = 80  # the square of the ratio of rates may take 30 of them, a double has 16
Split = tuple[Any, Array, float]
CLOCK = "age"  # s since the mode began


def settled(table: Tables) -> Tables:
    """The tables of one system, with every mode split whose fast rates are far apart from the others; the same where
    none is. A drive with knots begins a fast part anew at each: its systems are left as they are.

    Raises
    ------
    SolveError
        The rates are further apart than a state of 16 digits can tell.
    """
    if table.motion.knots is not None:
        return table
    splits = {j: split for j, flow in enumerate(table.flow) if (split := _split(flow)) is not None}
    return _Splitting(table, splits).build() if splits else table


def settled_alike(tables: Tables, like: Tables) -> Tables:
    """The tables of systems next to one, split as that one's are."""
    if not like.settling:
        return tables
    split = np.searchsorted(like.first, sorted(like.settling), side="right") - 1
    members = [_neighbour(tables.of(k), split.tolist()) for k in range(len(tables.flow))]
    own: Any = {name: np.array([getattr(one, name) for one in members]) for name in OWN}
    outputs = {name: np.array([one.outputs[name] for one in members]) for name in tables.outputs}
    return replace(members[0], **own, outputs=outputs, motions=tables.motions)


def _neighbour(table: Tables, split: list[int]) -> Tables:
    """One of them, with those modes split."""
    splits = {}
    for j in split:
        own = _split(table.flow[j], NEIGHBOUR)
        if own is None:
            raise SolveError(
                f"a contact whose fast part is split off, next to one whose is not (mode {table.modes[j].name})",
                "a derivative needs neighbours that are solved alike",
                "take differences of whole runs",
            )
        splits[j] = own
    return _Splitting(table, splits).build()


def _split(flow: Array, share: float = 1.0) -> Split | None:
    """P in many digits, its flow and the time until the fast part is dead; None where there is no such part.

    Of what is asked of such a part a `share` is enough.
    """
    values = eigenvalues(flow)
    rates = np.sort(np.abs(values))
    rates = rates[rates > 0]
    apart = rates[1:] >= share * (DEAD / WORTH) * rates[:-1]  # else the fast part outlives the slow one's cell
    gaps = np.flatnonzero(apart & (rates[-1:] >= share * APART * rates[:-1]))
    if not len(gaps):
        return None
    slow, fast = rates[gaps[-1] : gaps[-1] + 2]
    middle, decay = math.sqrt(slow * fast), -np.max(values.real[np.abs(values) >= fast])
    # the clock runs for so many cells of the fast rates; the slow ones must be worth that
    if decay < share * DAMPED * middle or DEAD / decay > WORTH / (share * slow):
        return None
    if share * fast > FARTHEST * slow:
        raise SolveError(
            f"a part of the motion that dies at {fast:.1e}/s beside one of {slow:.1e}/s",
            f"a rate of the contact is far above the motion's own: 16 digits tell no more than {FARTHEST:g} times",
            "leave out the damping or the mass that makes it so fast",
        )
    with localcontext() as context:
        context.prec = DIGITS
        exact = np.vectorize(Decimal, otypes=[object])(flow)
        unit = np.vectorize(Decimal, otypes=[object])(np.eye(len(flow)))
        keep = (unit + _sign(exact + unit * Decimal(middle), unit)) / 2
        follows = _rounded(keep @ exact - (unit - keep) * Decimal(slow))
    follows[~flow.any(axis=1)] = 0.0  # what is constant stays so, whatever the iteration left
    return keep, follows, DEAD / decay


def _sign(matrix: Any, unit: Any) -> Any:
    """The matrix sign function, by Newton's iteration."""
    for _ in range(40 + int(math.log2(float(np.max(np.abs(matrix)))))):
        after = (matrix + _inverse(matrix, unit)) / 2
        if np.max(np.abs(after - matrix)) <= np.max(np.abs(after)) * Decimal(10) ** (12 - DIGITS // 2):
            break
        matrix = after
    return after


def _inverse(matrix: Any, unit: Any) -> Any:
    """By Gauss and Jordan, rows scaled."""
    size = len(matrix)
    work = np.concatenate([matrix, unit], axis=1)
    work = work / np.max(np.abs(matrix), axis=1)[:, None]
    for j in range(size):
        best = j + int(np.argmax(np.abs(work[j:, j])))
        work[[j, best]] = work[[best, j]]
        work[j] = work[j] / work[j, j]
        for i in range(size):
            if i != j and work[i, j]:
                work[i] = work[i] - work[i, j] * work[j]
    return work[:, size:]


def _rounded(matrix: Any) -> Array:
    """In doubles; what is far below the digits of its row is none."""
    least = np.max(np.abs(matrix), axis=1, keepdims=True) * Decimal(10) ** (-DIGITS // 3)
    return np.asarray(np.where(np.abs(matrix) > least, matrix, 0), np.float64)


class _Splitting:
    """Lives for one call of :func:`settled`. The clock is the last entry of the state; modes that follow a split one
    stand behind those of the law."""

    def __init__(self, table: Tables, splits: dict[int, Split]) -> None:
        self.table, self.splits = table, splits
        self.size, self.count = len(table.names) + 1, len(table.modes)
        self.behind = {j: self.count + k for k, j in enumerate(splits)}
        # by mode: which of the law's it is, and what leaves the slow part of the state alone
        self.own = [*range(self.count), *splits]
        self.keep = [None] * self.count + [keep for keep, _, _ in splits.values()]

    def build(self) -> Tables:
        table, exits = self.table, self.exits()
        flow = self.flows()
        rows = np.array([row for _, _, row, _, _ in exits])
        modes = np.array([mode for mode, *_ in exits])
        first = np.searchsorted(modes, np.arange(len(self.own) + 1))
        series = np.zeros((len(exits), DEGREE + 1, self.size))
        for j in range(len(self.own)):
            part = slice(first[j], first[j + 1])
            if first[j] < first[j + 1]:
                series[part] = derivatives(rows[None, part], flow[j])[0]
        cell, hop = cells_of(flow[None], table.physical)
        load = {name: self.by_mode(rows) for name, rows in table.outputs.items() if name == "load"}
        return replace(
            table,
            names=(*table.names, CLOCK),
            modes=tuple(table.modes[j] for j in self.own),
            flow=flow,
            cell=cell[0],
            hop=hop[0],
            series=series,
            target=np.array([target for _, target, *_ in exits], dtype=np.int64),
            crossing=np.array([crossing for *_, crossing in exits], dtype=np.bool_),
            reset=np.array([reset for _, _, _, reset, _ in exits]),
            first=first.astype(np.int64),
            friction=self.by_mode(table.friction),
            outputs={name: np.pad(rows, _last(rows.ndim)) for name, rows in table.outputs.items()} | load,
            begin=np.append(table.begin, 0.0),
            opening=np.pad(table.opening, _last(2)),
            settling=frozenset(e for e, (mode, target, *_) in enumerate(exits) if target == self.behind.get(mode)),
        )

    def flows(self) -> Array:
        """A of each mode, with the clock where it runs."""
        flow = np.zeros((len(self.own), self.size, self.size))
        flow[:, :-1, :-1] = [*self.table.flow, *(slow for _, slow, _ in self.splits.values())]
        flow[list(self.splits), -1, self.table.physical] = 1.0
        return flow

    def exits(self) -> list[tuple[int, int, Array, Array, bool]]:
        """Mode, target, quantity, reset and whether it is crossed, of each exit in turn."""
        table, exits = self.table, []
        for mode, own in enumerate(self.own):
            for e in range(table.first[own], table.first[own + 1]):
                reset = np.zeros((self.size, self.size))  # every mode begins with its clock at 0
                reset[:-1, :-1] = table.reset[e]
                quantity = np.append(self.seen(table.series[e, 0], mode), 0.0)
                exits.append((mode, int(table.target[e]), quantity, reset, bool(table.crossing[e])))
            if mode in self.splits:
                keep, _, dead = self.splits[mode]
                clock, reset = np.zeros(self.size), np.zeros((self.size, self.size))
                clock[-1], clock[table.physical] = 1.0, -dead
                reset[:-1, :-1] = _rounded(keep)
                exits.append((mode, self.behind[mode], clock, reset, False))
        return exits

    def by_mode(self, rows: Array) -> Array:
        """Linear forms (M, ..., N) of the modes."""
        seen = np.array([self.seen(rows[own], mode) for mode, own in enumerate(self.own)])
        return np.pad(seen, _last(seen.ndim))

    def seen(self, rows: Array, mode: int) -> Array:
        """Linear forms as a mode has them: of the slow part alone, where large terms of fast ones would cancel."""
        keep = self.keep[mode]
        if keep is None:
            return rows
        with localcontext() as context:
            context.prec = DIGITS
            return _rounded(np.atleast_2d(np.vectorize(Decimal, otypes=[object])(rows)) @ keep).reshape(rows.shape)


def _last(dimensions: int) -> list[tuple[int, int]]:
    return [(0, 0)] * (dimensions - 1) + [(0, 1)]
