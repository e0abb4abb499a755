"""How a motion changes with its parameters: derivatives of what it is at any instant, events included.

Beside the state S, S' = A S, runs its derivative D by a parameter p, D' = A D + (dA/dp) S. At an event that ends a mode
where q S = 0, the neighbour's exit comes later by t = -(q D + (dq/dp) S) / (q A S), and with S+ = R S the derivative
goes on as D+ = R (D + A S t) + (dR/dp) S - A+ S+ t. The tables are smooth in their parameters and cheap, so that their
own derivatives are differences of two tables; the motion is never differenced.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.compiled import OPTIONS, compiled
from stickslip.errors import ModelError
from stickslip.laws.stribeck import TimeDelay
from stickslip.oscillator import Oscillator
from stickslip.parameters import find, places
from stickslip.solve.assembly import tables_of
from stickslip.solve.cells import DEGREE
from stickslip.solve.curved import CurvedTrajectory
from stickslip.solve.kernel import multiply
from stickslip.solve.settling import settled_alike
from stickslip.solve.tables import Tables, systems_of
from stickslip.solve.trajectory import Trajectory
from stickslip.solve.variation import Variation, opening_moved, variation

TERMS = 40  # of a Taylor series over a cell at most
OUTPUTS = ("x", "v", "a", "friction")
# Of a parameter, for differences of tables to either side: what is left of the curve and rounding are alike. What is
# zero may not be less, and is moved to one side, by less.
STEP, FROM_ZERO = 1e-4, 1e-3
RATES_STEP = 1e-5  # of a curved law's rates, which round less than tables do, and bend more


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of a motion by K parameters.

    Attributes
    ----------
    run : Trajectory
        The motion.
    flow : ndarray (K, M, N, N)
        Derivatives of the tables' flows.
    rows : mapping of str to ndarray (K, M, N)
        Derivatives of the outputs as linear forms of the state, by name.
    begun : ndarray (n, K, N)
        Derivatives of the state at the start of each piece.
    later : ndarray (n, K)
        Derivatives of the instant [s] at which each piece begins.
    hops : ndarray (M, 1 + K, N, N)
        The state after a cell of each mode that lasts longer, by that before, and its derivatives.
    """

    run: Trajectory
    flow: Array
    rows: dict[str, Array]
    begun: Array
    later: Array
    hops: Array

    def sample(self, times: Array, name: str) -> Array:
        """Derivatives of an output at increasing instants (K, T), each within the piece that it falls in."""
        run, linear = self.run, self.run.table.linear
        size, count = run.states.shape[1], len(self.flow)
        used = np.bincount(run.modes, minlength=len(run.table.modes)) > 0
        forms = np.ascontiguousarray(run.rows(name)[:, 0]), self.rows[name]
        series, work = np.zeros((len(used), DEGREE + 1, 1 + count, size)), np.empty((2, 1 + count, size))
        series_of(linear, self.flow, forms, used, series, work)
        out, pieces = np.empty((count, len(times))), (run.starts, run.modes, run.states, self.begun)
        sample_tangents(linear, self.hops, series, pieces, times, out, work, np.empty((DEGREE + 1, count)))
        return out

    def jumps(self, name: str) -> Array:
        """By how much an output jumps where each piece but the first begins."""
        run, forms = self.run, self.run.rows(name)[:, 0]
        after = np.einsum("jn,jn->j", forms[run.modes[1:]], run.states[1:])
        ends = np.empty_like(run.states[1:])
        pieces = run.modes, run.states, run.durations
        _ends(run.table.linear, self.flow[:0], self.hops[:, :1], pieces, ends, np.empty((3, 1, run.states.shape[1])))
        return np.asarray(after - np.einsum("jn,jn->j", forms[run.modes[:-1]], ends))


def sensitivity(
    run: Trajectory,
    neighbours: Sequence[Oscillator],
    *,
    step: float,
    starts: Mapping[str, float],
    scaled: Sequence[float],
    outputs: Sequence[str],
    opening: bool = False,
) -> Sensitivity:
    """Derivatives of a run of linear modes: by parameters, by what scales its drive, and by its start.

    Parameters
    ----------
    run : Trajectory
        Of an oscillator, its start given entry by entry.
    neighbours : sequence of Oscillator
        For each parameter the same oscillator with that parameter larger by `step` in its own unit.
    step : float
        Of the differences of tables.
    starts : mapping of str to float
        Entries of the state whose values at time 0 come last, and the unit of each.
    scaled : sequence of float
        For each unit by which a recorded motion of the base may be larger: the share of it that one is.
    outputs : sequence of str
        What will be asked for, as :meth:`Trajectory.sample` names them.
    opening : bool
        Whether what of the start is as the system opens by itself moves with the parameters, too.

    Returns
    -------
    Sensitivity
    """
    table = run.table
    size, first, last = len(table.names), len(neighbours), len(neighbours) + len(scaled)
    count, signals = last + len(starts), slice(table.physical + 1, size)
    changes = _Changes.none(table, count, outputs, run)
    begun, later = np.zeros((len(run.modes), count, size)), np.zeros((len(run.modes), count))
    if neighbours:
        near = settled_alike(tables_of(systems_of(list(neighbours))), table)
        changes.take(near, run, step)
        begun[0, :first, signals] = (near.begin - run.states[0])[:, signals] / step
        if opening:
            openings = np.concatenate([table.opening[None], near.opening])
            begun[0, :first] = opening_moved(openings, begun[0, :first].T, run.states[0], step).T
    knotted = np.array([table.names.index(name) for name in table.motion.knotted], dtype=np.int64)
    grown = np.concatenate([np.zeros(first), scaled, np.zeros(len(starts))])
    begun[0, first:last, signals] += np.outer(scaled, run.states[0, signals])
    for k, (name, unit) in enumerate(starts.items(), start=last):
        begun[0, k, table.names.index(name)] = unit
    pieces, work = (run.modes, run.states, run.durations, run.exits), np.empty((4, 1 + count, size))
    longest, hops = np.zeros(len(table.modes)), np.zeros((len(table.modes), 1 + count, size, size))
    np.maximum.at(longest, run.modes, run.durations)
    hops_of(table.linear, changes.flow, longest, hops, work)
    passing = hops, table.leap
    carry_parameters(table.linear, changes.of_events, passing, pieces, (knotted, grown), begun, later, work)
    return Sensitivity(run, changes.flow, changes.rows, begun, later, hops)


@dataclass(frozen=True, eq=False)
class _Changes:
    """Derivatives of tables by parameters (K, ...)."""

    flow: Array
    quantity: Array
    reset: Array
    leap: Array
    rows: dict[str, Array]

    @classmethod
    def none(cls, table: Tables, count: int, outputs: Sequence[str], run: Trajectory) -> _Changes:
        """Of tables that do not change."""
        shapes = table.flow.shape, table.series[:, 0].shape, table.reset.shape, table.leap.shape
        rows = {name: np.zeros((count, *run.rows(name)[:, 0].shape)) for name in outputs}
        flow, quantity, reset, leap = (np.zeros((count, *shape)) for shape in shapes)
        return cls(flow, quantity, reset, leap, rows)

    def take(self, near: Tables, run: Trajectory, step: float) -> None:
        """Fill in those of the first parameters from neighbouring tables."""
        table, first = run.table, slice(len(near.flow))
        self.flow[first] = (near.flow - table.flow) / step
        self.quantity[first] = (near.series[:, :, 0] - table.series[:, 0]) / step
        self.reset[first] = (near.reset - table.reset) / step
        self.leap[first] = (near.leap - table.leap) / step
        beside = [replace(run, table=near.of(k)) for k in range(len(near.flow))]
        for name, rows in self.rows.items():
            rows[first] = [(one.rows(name) - run.rows(name))[:, 0] / step for one in beside]

    @property
    def of_events(self) -> tuple[Array, ...]:
        """What an event's derivative is made of."""
        return self.flow, self.quantity, self.reset, self.leap


@compiled(**OPTIONS)
def _turned(matrix, change, scale, both):
    """A matrix and its derivatives applied to a state and its derivatives, times a factor: ``both[0]`` becomes those
    of the product, ``both[1]`` is scratch."""
    count, n = both.shape[1:]
    for p in range(count):
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += matrix[i, j] * both[0, p, j]
                if p > 0:
                    total += change[p - 1, i, j] * both[0, 0, j]
            both[1, p, i] = total * scale
    for p in range(count):
        for i in range(n):
            both[0, p, i] = both[1, p, i]


@compiled(**OPTIONS)
def grow(flow, change, time, both, term):
    """Carry a state and its derivatives through a time [s] within one cell: `both` is (1 + K, N), the state first;
    `flow` (N, N) and its derivatives `change` (K, N, N) are in 1/s; `term` (2, 1 + K, N) is scratch."""
    count, n = both.shape
    for p in range(count):
        for i in range(n):
            term[0, p, i] = both[p, i]
    # term k of exp(A time) and its derivatives is term k - 1 turned by A and its derivatives
    for k in range(1, TERMS):
        _turned(flow, change, time / k, term)
        small = True
        for p in range(count):
            for i in range(n):
                before = both[p, i]
                both[p, i] += term[0, p, i]
                small = small and both[p, i] == before
        # as in `kernel.advance`: near rest an early term may be lost, and the next one not
        if small and k > 4:
            break


@compiled(**OPTIONS)
def _only(entry, both):
    """A state of one entry alone, that does not change with the parameters."""
    for p in range(both.shape[0]):
        for i in range(both.shape[1]):
            both[p, i] = 1.0 if p == 0 and i == entry else 0.0


@compiled(**OPTIONS)
def hops_of(linear, change, longest, hops, work):
    """exp(A cell) of each mode that lasts longer than a cell, and its derivatives: (M, 1 + K, N, N).

    Each column is where a state of one entry alone has come to, and how that changes.
    """
    for mode in range(hops.shape[0]):
        if longest[mode] <= linear.cell[mode]:
            continue
        for column in range(hops.shape[3]):
            _only(column, work[0])
            grow(linear.flow[mode], change[:, mode], linear.cell[mode], work[0], work[1:])
            for p in range(hops.shape[1]):
                for i in range(hops.shape[3]):
                    hops[mode, p, i, column] = work[0, p, i]


@compiled(**OPTIONS)
def through(linear, change, hops, mode, time, both):
    """As `grow`, however long the time, of ``both[0]``: whole cells at once; the rest of `both` is scratch."""
    cell = linear.cell[mode]
    whole = int(time / cell) if cell < np.inf and time > cell else 0
    for _ in range(whole):
        _turned(hops[mode, 0], hops[mode, 1:], 1.0, both)
    grow(linear.flow[mode], change[:, mode], time - whole * cell if whole else time, both[0], both[1:])


@compiled(**OPTIONS)
def _ends(linear, none, hops, pieces, out, work):
    """The state at the end of each piece but the last; `none` are the derivatives by no parameter."""
    modes, states, durations = pieces
    for j in range(out.shape[0]):
        for i in range(states.shape[1]):
            work[0, 0, i] = states[j, i]
        through(linear, none, hops, modes[j], durations[j], work)
        for i in range(states.shape[1]):
            out[j, i] = work[0, 0, i]


@compiled(**OPTIONS)
def carry_parameters(linear, changes, passing, pieces, signals, begun, later, work):
    """Derivatives of the state at the start of each piece, and of that instant, from those at the first.

    `changes` are the derivatives of flow, exits' quantities, resets and leaps; `passing` whole cells and modes passed
    through at once; `signals` the entries that are set anew where each piece begins, and by what share of themselves
    each parameter makes them larger. `begun` is (n, K, N), `later` (n, K) [s a unit], `work` (4, 1 + K, N).
    """
    knotted, scaled = signals
    hops, leap = passing
    flow, quantity, reset, passage = changes
    modes, states, durations, exits = pieces
    count, n = begun.shape[1], states.shape[1]
    both, spare = work[0], work[3]
    for j in range(modes.shape[0] - 1):
        mode, e, following = modes[j], exits[j], modes[j + 1]
        # Piece: state and derivatives to its end.
        for i in range(n):
            both[0, i] = states[j, i]
            for p in range(count):
                both[1 + p, i] = begun[j, p, i]
        through(linear, flow, hops, mode, durations[j], work[:3])
        # Event: the neighbour's exit comes later by `late`, by the formula at the top of this file.
        if e >= 0:
            multiply(linear.flow[mode], both[0], spare[0])
            speed = 0.0
            for i in range(n):
                speed += linear.series[e, 0, i] * spare[0, i]
            passed = leap[linear.target[e], following]
            for p in range(count):
                late = 0.0
                for i in range(n):
                    late -= linear.series[e, 0, i] * both[1 + p, i] + quantity[p, e, i] * both[0, i]
                late = late / speed if speed != 0.0 else 0.0
                later[j + 1, p] = late
                # R (D + A S t) + dR S, then the modes passed through at once
                multiply(linear.reset[e], both[0], work[1, 0])
                multiply(reset[p, e], both[0], work[1, 1])
                for i in range(n):
                    both[1 + p, i] += spare[0, i] * late
                multiply(linear.reset[e], both[1 + p], work[2, 0])
                for i in range(n):
                    work[2, 0, i] += work[1, 1, i]
                multiply(passed, work[2, 0], both[1 + p])
                multiply(passage[p, linear.target[e], following], work[1, 0], work[2, 1])
                multiply(linear.flow[following], states[j + 1], work[1, 1])
                for i in range(n):
                    both[1 + p, i] += work[2, 1, i] - work[1, 1, i] * late
        # Start of the next: signals set anew there do not remember what was carried.
        for p in range(count):
            for i in range(n):
                begun[j + 1, p, i] = both[1 + p, i]
            for i in knotted:
                begun[j + 1, p, i] = scaled[p] * states[j + 1, i]


@compiled(**OPTIONS)
def series_of(linear, change, forms, used, series, work):
    """Taylor coefficients over a cell of a linear form of the state, as forms of the state where the cell begins, and
    their derivatives: `series` (M, DEGREE + 1, 1 + K, N), of the modes that are used. `forms` are rows (M, N) and their
    derivatives (K, M, N), `change` (K, M, N, N) those of the flows [1/s], `work` (2, 1 + K, N)."""
    rows, moved = forms
    _, degrees, count, n = series.shape
    for mode in range(series.shape[0]):
        if not used[mode]:
            continue
        cell = linear.cell[mode]
        unit = cell if cell < np.inf else 1.0
        # by columns: what becomes of each entry alone, term by term, seen through the row
        for column in range(n):
            _only(column, work[0])
            for k in range(degrees):
                for p in range(count):
                    total = 0.0
                    for i in range(n):
                        # product rule: the row times the moved state, the moved row times the state
                        total += rows[mode, i] * work[0, p, i]
                        if p > 0:
                            total += moved[p - 1, mode, i] * work[0, 0, i]
                    series[mode, k, p, column] = total
                _turned(linear.flow[mode], change[:, mode], unit / (k + 1), work)


@compiled(**OPTIONS)
def sample_tangents(linear, hops, series, pieces, times, out, work, c):
    """Derivatives of a linear form of the state at increasing `times` (T,) [s], `out` (K, T), one polynomial of time
    for each cell. `hops` is (M, 1 + K, N, N), `series` of :func:`series_of`, `work` (2, 1 + K, N), `c`
    (DEGREE + 1, K)."""
    begin, modes, states, begun = pieces
    count, n, last = begun.shape[1], states.shape[1], begin.shape[0] - 1
    both = work[0]
    j, cells, known = -1, 0, False
    for t in range(times.shape[0]):
        # Piece: the state and its derivatives where it begins.
        if j < 0 or (j < last and begin[j + 1] <= times[t]):
            j = max(j, 0)
            while j < last and begin[j + 1] <= times[t]:
                j += 1
            cells, known = 0, False
            for i in range(n):
                both[0, i] = states[j, i]
                for p in range(count):
                    both[1 + p, i] = begun[j, p, i]
        mode = modes[j]
        cell = linear.cell[mode]
        # where nothing turns one cell lasts for ever, and any unit of time serves
        unit = cell if cell < np.inf else 1.0
        time = times[t] - begin[j]
        # Cell: carried through those that are over, and its polynomials.
        while cell < np.inf and time - cells * cell > cell:
            _turned(hops[mode, 0], hops[mode, 1:], 1.0, work)
            cells += 1
            known = False
        if not known:
            known = True
            for k in range(c.shape[0]):
                for p in range(count):
                    total = 0.0
                    for i in range(n):
                        total += series[mode, k, 0, i] * both[1 + p, i] + series[mode, k, 1 + p, i] * both[0, i]
                    c[k, p] = total
        # Instant.
        at = (time - cells * cell if cells else time) / unit
        for p in range(count):
            total = 0.0
            for k in range(c.shape[0] - 1, -1, -1):
                total = total * at + c[k, p]
            out[p, t] = total


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """How a motion changes with parameters of its system.

    Attributes
    ----------
    names : tuple of str
        The parameters.
    events : ndarray, shape (parameters, events)
        By how much each of the run's events comes later [s] for each unit of a parameter.
    motion : Sensitivity or Variation
        Derivatives by neighbours of the system, two a parameter.
    shares : ndarray, shape (2, parameters)
        With which each of the two counts.
    """

    names: tuple[str, ...]
    events: Array
    motion: Sensitivity | Variation = field(repr=False)
    shares: Array = field(repr=False)

    def sample(self, times: ArrayLike, output: str = "x") -> Array:
        """Derivatives of an output at increasing instants, (parameters, instants), in units of one over the other.

        Parameters
        ----------
        times : array_like
            Instants [s], none at an event, where a velocity or a force may jump.
        output : str
            "x", "v", "a" or "friction".

        Returns
        -------
        ndarray

        Raises
        ------
        SolveError
            An instant lies outside the simulated time.
        """
        return _joined(self.motion.sample(self.motion.run.instants(times), output), self.shares)


def sensitivities(run: Trajectory, *names: str) -> Sensitivities:
    r"""How does a motion change with the parameters of its system, its events included?

    Between events the derivative :math:`s = \partial y / \partial p` follows
    :math:`\dot s = A s + (\partial A / \partial p) y`. At an event :math:`q y = 0` the instant moves by
    :math:`\partial t / \partial p = -(q s + (\partial q / \partial p) y) / (q \dot y)`, and the derivative jumps by the
    saltation matrix (Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7).
    Under a curved law :math:`A` is the rates' derivative along the motion, and collocation takes the place of the
    closed form. The motion itself is never differenced. What of its start is as the system opens by itself (at the
    belt's speed, say) moves with the parameters; what was given stays.

    Parameters
    ----------
    run : Trajectory
        Of an oscillator, its law one without a time lag, from :func:`~stickslip.simulate`.
    *names : str
        Parameters of the system by name ("stiffness", "kinetic", "drive.amplitude").

    Returns
    -------
    Sensitivities

    Raises
    ------
    ModelError
        No parameter has that name, its value is no number, or the law has a time lag.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.Coulomb(1.0))
    >>> run = ss.simulate(slider, duration=4.0, start={"x": 2.0})
    >>> by = sensitivities(run, "kinetic")
    >>> by.sample([1.5]).round(6).tolist()  # x = (x0 - f/k) cos(2 t) + f/k
    [[0.497498]]
    """
    system = run.system
    if not isinstance(system, Oscillator) or isinstance(system.law, TimeDelay):
        raise ModelError(
            f"derivatives of {type(system).__name__} with {type(getattr(system, 'law', system)).__name__}",
            "they are carried through the modes of one mass under a law without time lag",
            "take differences of two runs",
        )
    values = np.array([_value(system, name) for name in names])
    scales = np.where(values == 0, FROM_ZERO, np.abs(values))
    sides = np.array([np.ones(len(names)), np.where(values == 0, 1.0, -1.0)])
    step = RATES_STEP if isinstance(run, CurvedTrajectory) else STEP
    moved = [
        system.having(**{name: value + own})
        for side in sides
        for name, value, own in zip(names, values, step * side * scales, strict=True)
    ]
    motion: Sensitivity | Variation = (
        variation(run, moved, step=step)
        if isinstance(run, CurvedTrajectory)
        else sensitivity(run, moved, step=step, starts={}, scaled=(), outputs=OUTPUTS, opening=True)
    )
    shares = sides / (2 * scales)
    return Sensitivities(names, _joined(motion.later[run.event_pieces].T, shares), motion, shares)


def _joined(derivatives: Array, shares: Array) -> Array:
    """Of derivatives by neighbours to either side, (2 parameters, ...), those by the parameters."""
    apart = derivatives.reshape(2, shares.shape[1], -1)
    return np.asarray(np.einsum("sk,skt->kt", shares, apart))


def _value(system: Oscillator, name: str) -> float:
    path = find(system, name)[0]
    value = getattr(places(system)[path], path[-1])
    if isinstance(value, bool) or not isinstance(value, (int, float, np.floating)):
        raise ModelError(f"{name} = {value!r}", "a derivative is by a number", "name another parameter")
    return float(value)
