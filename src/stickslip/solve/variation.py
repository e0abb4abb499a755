r"""How a motion under a curved law changes with its parameters: the variational equation along the known motion.

Along the steps of a run, the derivative D of the state by a parameter p follows the linear equation
:math:`\dot D = J D + \partial F/\partial p`, J the derivative of the rates F by the state. Gauss's collocation
solves it for all steps at once, since the motion is known: nothing of it waits for the step before but a product of
small matrices. At an event the saltation of :mod:`~stickslip.solve.sensitivity` carries D on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray

from stickslip.arrays import Array, Index
from stickslip.laws.curved import Creeping
from stickslip.oscillator import Oscillator
from stickslip.solve.curved import CurvedTrajectory
from stickslip.solve.tape import Tape, tape
from stickslip.solve.taylor import ASINH, EXP, LINEAR, LOG, POWER, PRODUCT, QUOTIENT, SQUARE, STILL, TANH, Nodes

POINTS = 10  # of Gauss in a step, exact to order 20: the motion's own steps are of order 14 or 18
ASIDE = 1e-30  # a step along the imaginary axis: the derivative is exact, since no difference is taken
BATCH = 256  # steps whose stages are solved at once: some 20 MB
BRIEF = 1e-9  # of a natural period: as long before and behind a turn of creep nothing but the slip changes
ROUNDED = 1e-13  # of an entry of the start, within which it is as the system opens by itself


def weights_until(shares: Array) -> Array:
    """What each of Gauss's points counts in an integral from 0 to these shares (T,) of a step: (T, POINTS)."""
    points = np.polynomial.legendre.leggauss(POINTS)[0]
    basis = [Legendre.basis(j) for j in range(POINTS)]
    areas = np.column_stack([part.integ(lbnd=-1)(2 * shares - 1) / 2 for part in basis])
    values = np.column_stack([part(points) for part in basis])
    return np.asarray(np.linalg.solve(values.T, areas.T).T, dtype=np.float64)


AT = (np.polynomial.legendre.leggauss(POINTS)[0] + 1) / 2
MATRIX = weights_until(AT)
WEIGHTS = np.polynomial.legendre.leggauss(POINTS)[1] / 2


def values(nodes: Nodes, mode: int, state: NDArray[Any]) -> NDArray[Any]:
    """All nodes of a mode at states (N, T), real or complex."""
    begin, end = nodes.first[mode : mode + 2]
    out = np.zeros((end - begin, state.shape[1]), dtype=state.dtype)
    out[: len(state)] = state
    for j in range(len(state), end - begin):
        g = begin + j
        kind, a, b, power = nodes.kinds[g], out[nodes.left[g]], out[nodes.right[g]], nodes.power[g]
        if kind == LINEAR:
            own = slice(nodes.low[g], nodes.low[g + 1])
            out[j] = nodes.weights[own] @ out[nodes.terms[own]] + nodes.constant[g]
        elif kind in (PRODUCT, SQUARE):
            out[j] = a * (b if kind == PRODUCT else a)
        elif kind == QUOTIENT:
            out[j] = a / b
        elif kind == POWER:  # of nothing it is nothing, as the march has it
            some = a.real > STILL
            out[j, some] = a[some] ** power
        elif kind in FUNCTIONS:
            out[j] = FUNCTIONS[kind](a)
        else:
            out[j] = 1 - np.tanh(a) ** 2
    return out


FUNCTIONS = {EXP: np.exp, TANH: np.tanh, LOG: np.log, ASINH: np.arcsinh}


class _Along(NamedTuple):
    """Nodes of a mode along states: values (R, T), derivatives by state (R, N, T) and by neighbours (R, K, T)."""

    value: Array
    slope: Array
    change: Array


def opening_moved(openings: Array, signals: Array, state: Array, step: float) -> Array:
    """Derivatives of a state at time 0 by neighbours of its system (N, K).

    Parameters
    ----------
    openings : ndarray (1 + K, P, N)
        How the system and its neighbours open, as :class:`~stickslip.solve.tape.Tape` says.
    signals : ndarray (N, K)
        Derivatives of the drive's signals; zero elsewhere.
    state : ndarray (N,)
        At time 0. What is there as the system opens by itself moves with it; what is not was given, and stays.
    step : float
        By how much each parameter is larger in its neighbour.

    Returns
    -------
    ndarray (N, K)
    """
    begun = signals.copy()
    for j, row in enumerate(openings[0]):
        if abs(row @ state - state[j]) <= ROUNDED * abs(state[j]):
            begun[j] = (openings[1:, j] - row) @ state / step + row @ begun
    return begun


@dataclass(frozen=True, eq=False)
class Variation:
    """Derivatives of a motion by K neighbours, as :class:`~stickslip.solve.sensitivity.Sensitivity` of a linear law.

    Attributes
    ----------
    run : CurvedTrajectory
        The motion.
    near : tuple of Tape
        The neighbours' tapes.
    step : float
        By how much each parameter is larger there, in its own unit.
    begun : ndarray (S, N, K)
        Derivatives of the state at the start of each step.
    later : ndarray (n, K)
        Derivatives of the instant [s] at which each piece begins.
    """

    run: CurvedTrajectory
    near: tuple[Tape, ...]
    step: float
    begun: Array
    later: Array

    def sample(self, times: Array, name: str) -> Array:
        """Derivatives of an output at increasing instants (K, T), each within the step that it falls in."""
        steps, count = self.run.steps, len(self.near)
        at = np.maximum(np.searchsorted(steps.starts, times, side="right") - 1, 0)
        tangents = self._within(at, times)
        out = np.empty((count, len(times)))
        states = _states(self.run, times)
        for mode in np.unique(steps.modes[at]):
            here = steps.modes[at] == mode
            places = [(int(one.places[name][mode, 0]), 1.0) for one in self.tapes]
            along = self.along([[place] for place in places], int(mode), states[:, here])
            out[:, here] = np.einsum("nt,tnk->kt", along.slope[0], tangents[here]) + along.change[0]
        return out

    def _within(self, at: Index, times: Array) -> Array:
        """Derivatives of the state at instants within steps (T, N, K): the polynomial through Gauss's points."""
        steps, tangents = self.run.steps, self.begun[at]
        shares = weights_until(np.clip((times - steps.starts[at]) / steps.lengths[at], 0.0, 1.0))
        for rows, stages in _stages(self, np.unique(at)):
            here = np.flatnonzero(np.isin(at, rows))
            size, own = len(self.run.table.names), np.searchsorted(rows, at[here])
            rates = stages[..., :size] @ self.begun[rows][:, None] + stages[..., size:]
            tangents[here] += np.einsum("t,ti,tink->tnk", steps.lengths[at[here]], shares[here], rates[own])
        return tangents

    @property
    def tapes(self) -> tuple[Tape, ...]:
        """The run's own tape and the neighbours'."""
        own: Any = self.run.table
        return own, *self.near

    def along(self, wanted: Sequence[Sequence[tuple[int, float]]], mode: int, state: Array) -> _Along:
        """Nodes with their factors, as each tape numbers them (the run's own first), along states of a mode."""
        own, *near = self.tapes
        with np.errstate(all="ignore"):  # what divides by nothing at rest is not asked for
            value = _picked(own, wanted[0], mode, state)
            slope = np.empty((len(value), *state.shape))
            for i in range(len(state)):
                aside = state.astype(np.complex128)
                aside[i] += 1j * ASIDE
                slope[:, i] = _picked(own, wanted[0], mode, aside).imag / ASIDE
            pairs = zip(near, wanted[1:], strict=True)
            change = [(_picked(one, rows, mode, state) - value) / self.step for one, rows in pairs]
        return _Along(value, slope, np.stack(change, axis=1))

    def rates(self, mode: int, state: Array) -> _Along:
        """The rates of a mode along states."""
        rows = [(one.watched.rate[mode].tolist(), one.watched.factor[mode].tolist()) for one in self.tapes]
        wanted = [list(zip(*pair, strict=True)) for pair in rows]
        return self.along(wanted, mode, state)


def _picked(one: Tape, wanted: Sequence[tuple[int, float]], mode: int, state: NDArray[Any]) -> NDArray[Any]:
    """Some nodes of a mode with their factors; a node -1 is nothing."""
    every = values(one.watched, mode, state)
    return np.array([factor * every[node] if node >= 0 else 0 * state[0] for node, factor in wanted])


def _states(run: CurvedTrajectory, times: Array) -> Array:
    """The whole state at increasing instants (N, T)."""
    return run.sample(times, tuple(run.table.names))[0]


def _passages(motion: Variation) -> tuple[Array, Array]:
    """What carries derivatives over each step: D -> M D + q, as M (S, N, N) and q (S, N, K)."""
    size, count, lengths = len(motion.run.table.names), len(motion.near), motion.run.steps.lengths
    passage, own = np.empty((len(lengths), size, size)), np.empty((len(lengths), size, count))
    for rows, stages in _stages(motion, np.arange(len(lengths))):
        grown = np.einsum("s,i,simk->smk", lengths[rows], WEIGHTS, stages)
        passage[rows], own[rows] = np.eye(size) + grown[:, :, :size], grown[:, :, size:]
    return passage, own


def _stages(motion: Variation, steps: Index) -> Iterator[tuple[Index, Array]]:
    """Steps in turn, some of one mode at a time, and rates of derivatives at Gauss's points (s, POINTS, N, N + K): of
    those that begin as unit vectors, and of what parameters change alone."""
    modes = motion.run.steps.modes[steps]
    for mode in np.unique(modes):
        chosen = steps[modes == mode]
        for low in range(0, len(chosen), BATCH):
            rows = chosen[low : low + BATCH]
            yield rows, _solved(motion, int(mode), rows)


def _solved(motion: Variation, mode: int, rows: Index) -> Array:
    """As :func:`_stages`, of steps of one mode."""
    size, count, many = len(motion.run.table.names), len(motion.near), len(rows)
    begin, lengths = motion.run.steps.starts[rows], motion.run.steps.lengths[rows]
    times = begin[:, None] + lengths[:, None] * AT
    order = np.argsort(times, axis=None, kind="stable")  # instants in one step may be the same to rounding
    state = np.empty((size, times.size))
    state[:, order] = _states(motion.run, times.ravel()[order])
    along = motion.rates(mode, state)
    slope = along.slope.reshape(size, size, many, POINTS).transpose(2, 3, 0, 1)
    change = along.change.reshape(size, count, many, POINTS).transpose(2, 3, 0, 1)
    # The stages' rates: R_i = J_i (D + h sum_j a_ij R_j) + P_i, for D = each unit vector and for P alone
    spread = np.einsum("s,ij,simn->simjn", lengths, MATRIX, slope).reshape(many, POINTS * size, POINTS * size)
    right = np.concatenate([slope, change], axis=3).reshape(many, POINTS * size, size + count)
    return np.linalg.solve(np.eye(POINTS * size) - spread, right).reshape(many, POINTS, size, size + count)


def variation(run: CurvedTrajectory, neighbours: Sequence[Oscillator], *, step: float) -> Variation:
    """Derivatives of a curved motion, carried along its steps and through its events.

    Parameters
    ----------
    run : CurvedTrajectory
        Of an oscillator; what of its start is as the system opens by itself moves with the parameters.
    neighbours : sequence of Oscillator
        For each parameter the same oscillator with that parameter larger by `step` in its own unit.
    step : float
        Of the differences of rates.

    Returns
    -------
    Variation
    """
    table: Any = run.table
    near = tuple(tape(one) for one in neighbours)
    size, count, steps = len(table.names), len(near), run.steps
    motion = Variation(run, near, step, np.zeros((len(steps.starts), size, count)), np.zeros((len(run.modes), count)))
    signals = np.zeros((size, count))
    for name, value in table.motion.start.items():
        signals[table.names.index(name)] = [(one.motion.start[name] - value) / step for one in near]
    motion.begun[0] = opening_moved(np.array([one.opening for one in motion.tapes]), signals, steps.states[0], step)
    passage, own = _passages(motion)
    pieces = {int(row): j for j, row in enumerate(np.searchsorted(steps.starts, run.starts)) if j}
    behind = range(1)
    for s in range(1, len(steps.starts)):
        if s in pieces:
            row, behind = _at_once(run, s, pieces[s])
            if row == s:
                state = _states(run, np.nextafter(steps.starts[s : s + 1], 0))
                tangent = passage[s - 1] @ motion.begun[s - 1] + own[s - 1]
            else:
                state, tangent = steps.states[row][:, None], motion.begun[row]
            for b in behind:
                after = steps.states[b][:, None]
                motion.begun[b], motion.later[pieces[s]] = _through(motion, pieces[s], (state, after), tangent)
        elif s not in behind:
            motion.begun[s] = passage[s - 1] @ motion.begun[s - 1] + own[s - 1]
    return motion


def _at_once(run: CurvedTrajectory, s: int, piece: int) -> tuple[int, range]:
    """The step from whose start derivatives go through the event that begins a piece at step s, and the steps to whose
    starts: s and s alone, from its very end, but for creep.

    Friction that is a logarithm of the slip changes without end while the slip goes to nothing, and the slip is known
    to the tolerance of the velocity only. All that changes on so short a way is the slip: its derivative goes with its
    rate.
    """
    table, starts = run.table, run.steps.starts
    if not isinstance(getattr(run.system, "law", None), Creeping) or table.modes[run.modes[piece - 1]].friction is None:
        return s, range(s, s + 1)
    near = BRIEF / run.system.frequency if run.system.frequency else BRIEF * run.duration
    edges = np.append(run.starts, run.duration)
    begin, end = max(edges[piece] - near, edges[piece - 1]), min(edges[piece] + near, edges[piece + 1])
    first = min(int(np.searchsorted(starts, begin)), s - 1)
    held = table.modes[run.modes[piece]].friction is None
    return first, range(s, s + 1 if held else max(s + 1, int(np.searchsorted(starts, end))))


def _through(motion: Variation, piece: int, states: tuple[Array, Array], tangent: Array) -> tuple[Array, Array]:
    """Derivatives of the state behind the event that begins a piece, and of its instant, by those before it; `states`
    are those on either side."""
    run, table, (state, after) = motion.run, motion.tapes[0], states
    mode, following, e = int(run.modes[piece - 1]), int(run.modes[piece]), int(run.exits[piece - 1])
    before, behind = motion.rates(mode, state).value, motion.rates(following, after).value
    exits = [[(int(one.exits.node[e]), float(one.exits.factor[e]))] for one in motion.tapes]
    quantity = motion.along(exits, mode, state)
    speed = float(quantity.slope[0, :, 0] @ before[:, 0])
    late = (
        -(quantity.slope[0, :, 0] @ tangent + quantity.change[0, :, 0]) / speed if speed else np.zeros(len(motion.near))
    )
    resets = [one.exits.reset[e] for one in motion.tapes]
    target = int(table.exits.target[e])
    if target != following:  # passed through at once: what ends there first
        last = next(d for d in range(table.first[target], table.first[target + 1]) if int(table.target[d]) == following)
        resets = [one.exits.reset[last] @ reset for one, reset in zip(motion.tapes, resets, strict=True)]
    moved = np.column_stack([(reset - resets[0]) @ state[:, 0] / motion.step for reset in resets[1:]])
    return resets[0] @ (tangent + before * late) + moved - behind * late, late
