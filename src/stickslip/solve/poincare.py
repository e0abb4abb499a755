"""The map over periods of the drive, of linear tables and of curved laws alike, and a motion that repeats.

Between events a linear table has its derivative in closed form, with saltation at the events. A curved law's map is
differenced: four neighbours to each side of every entry of the state give a central difference of the fourth order.
With steps of `STEP` of the entry's size and runs to `FINE`, its error is some 1e-9 of the entry's size; where the
differences of the second and the fourth order part by more than `TORN`, an exit is met at a tangent within the step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.compiled import OPTIONS, compiled
from stickslip.errors import ModelError, SolveError
from stickslip.estimate import Estimate
from stickslip.laws.stribeck import TimeDelay
from stickslip.oscillator import Structure
from stickslip.solve.assembly import table_of
from stickslip.solve.curved import CurvedTrajectory, run_curved
from stickslip.solve.glide import Pieces
from stickslip.solve.kernel import follow, multiply
from stickslip.solve.simulate import opening, run, stops_of
from stickslip.solve.tables import System, Tables, is_curved, laws_of
from stickslip.solve.tape import Tape, tape
from stickslip.solve.trajectory import Event, Trajectory


@dataclass(frozen=True, eq=False)
class SteadyState:
    """A periodic orbit, or why there is none.

    Attributes
    ----------
    status : str
        "unique" (isolated and stable; from other starts there may be others), "unstable", "grazing" (an exit is met at
        a tangent: no derivative, no multipliers), "not unique" (a family of orbits: a multiplier is 1), "rest" (held
        all the time), "steady sliding" (on a belt or under a ramp: nothing else is left), "unbounded" (the amplitude
        grows without end), "quasi-periodic" (several frequencies without a common period), "chaotic" (neighbours part
        for good), "not periodic" (no orbit found, and neither of these).
    period : float
        Period [s]; of several periods of the drive where `order` is above 1.
    order : int
        Period over the drive's; 1 for a self-excited orbit.
    orbit : Trajectory
        One period, from phase zero of the drive; of a motion that does not repeat, as much of it.
    multipliers : ndarray of complex
        Eigenvalues of the map over one period, largest first; saltation at events included.
    exponent : Estimate or None
        Largest Lyapunov exponent [1/s] of a motion that does not repeat.
    frequencies : tuple of float
        Basic frequencies [Hz] of a quasi-periodic motion, the drive's first.
    lines : ndarray (n, 2) or None
        Strongest lines of its displacement: frequency [Hz] and amplitude [m].
    """

    status: str
    period: float
    order: int
    orbit: Trajectory
    multipliers: Complex
    exponent: Estimate | None = None
    frequencies: tuple[float, ...] = ()
    lines: Array | None = None

    @property
    def rotation_numbers(self) -> tuple[float, ...]:
        """The other basic frequencies over the first: irrational where the motion is quasi-periodic."""
        return tuple(frequency / self.frequencies[0] for frequency in self.frequencies[1:])

    @property
    def amplitude(self) -> float:
        """Largest displacement from zero [m]."""
        return self.largest("x")

    @property
    def events(self) -> tuple[Event, ...]:
        """The changes of mode within one period."""
        return self.orbit.events

    @property
    def stops(self) -> tuple[int, int]:
        """Sticks per period of the only contact, as :meth:`stops_at` counts them."""
        return self.stops_at(self._only_contact("stops"))

    @property
    def transition_speed(self) -> float:
        """V_s of the thesis [m/s], of the only contact, as :meth:`transition_speed_at` finds it."""
        return self.transition_speed_at(self._only_contact("transition_speed"))

    def stops_at(self, contact: int = 0) -> tuple[int, int]:
        """Sticks per period at a contact: normal (motion goes on in the other direction) and abnormal (in the same).

        A reversal without time at rest is no stop. In a compliant contact microsticks are counted. The time that a
        contact is lifted off counts for nothing.

        Parameters
        ----------
        contact : int
            Which one, from 0.

        Returns
        -------
        tuple of int
            Normal and abnormal stops.
        """
        parts = [part for part in self._modes_at(contact) if part.kind not in ("flight", "landing")]
        sides = [part.side for j, part in enumerate(parts) if j == 0 or part is not parts[j - 1]]
        if len(sides) > 1 and parts[0] is parts[-1]:
            sides.pop()
        moving = [j for j, side in enumerate(sides) if side]
        if not moving:
            return 0, 0
        turned = sides[moving[0] :] + sides[: moving[0] + 1]
        counts = [0, 0]
        for j in range(1, len(turned) - 1):
            if not turned[j]:
                after = next(side for side in turned[j + 1 :] if side)
                before = next(side for side in reversed(turned[:j]) if side)
                counts[int(before * after > 0)] += 1
        return counts[0], counts[1]

    def transition_speed_at(self, contact: int = 0) -> float:
        """Largest speed at which a microstick of a contact goes over into slip [m/s]; nan without microsticks.

        Parameters
        ----------
        contact : int
            Which one, from 0.

        Returns
        -------
        float
        """
        table, parts = self.orbit.table, self._modes_at(contact)
        form = np.atleast_2d(table.outputs["slip"])[contact]
        speeds = [
            abs(float(form @ self.orbit.states[j + 1]))
            for j in range(len(parts) - 1)
            if parts[j].kind == "microstick" and parts[j + 1].kind == "slip"
        ]
        return max(speeds, default=math.nan)

    def _modes_at(self, contact: int) -> list[Any]:
        """The mode of a contact in each piece of the orbit."""
        modes = self.orbit.table.modes
        if not isinstance(self.orbit.system, Structure):
            every: list[Any] = [modes]
        else:
            every = [[mode.parts[c] for mode in modes] for c in range(len(self.orbit.system.contacts))]  # type: ignore[attr-defined]
        if not 0 <= contact < len(every):
            raise ModelError(f"contact {contact}", f"the system has {len(every)}, counted from 0", "name one of them")
        return [every[contact][m] for m in self.orbit.modes]

    def _only_contact(self, question: str) -> int:
        count = len(self.orbit.system.contacts) if isinstance(self.orbit.system, Structure) else 1
        if count != 1:
            raise ModelError(
                f"{question} of {count} contacts", "each contact has its own", f"ask {question}_at(contact) of one"
            )
        return 0

    def largest(self, output: str, *, points: int = 65) -> float:
        """Largest modulus of an output over the orbit.

        Parameters
        ----------
        output : str
            As in :meth:`Trajectory.sample`.
        points : int
            Instants looked at in each piece before the largest is refined.

        Returns
        -------
        float
        """
        ends = np.append(self.orbit.starts, self.orbit.duration)
        inner = np.linspace(0.0, 1.0, points)[:-1] * (1 - 1e-12)
        times = np.append((ends[:-1, None] + np.diff(ends)[:, None] * inner).ravel(), self.orbit.duration)
        times = np.unique(np.concatenate([times, np.maximum(ends[1:] * (1 - 1e-13), 0.0)]))
        values, _ = self.orbit.sample(times, (output,))
        best = int(np.argmax(np.max(np.abs(values), axis=0)))
        low, high = times[max(best - 1, 0)], times[min(best + 1, len(times) - 1)]
        top = float(np.max(np.abs(values[:, best])))
        for _ in range(12):
            grid = np.linspace(low, high, 33)
            fine = np.max(np.abs(self.orbit.sample(grid, (output,))[0]), axis=0)
            peak = int(np.argmax(fine))
            top = max(top, float(fine[peak]))
            low, high = grid[max(peak - 1, 0)], grid[min(peak + 1, 32)]
        return top


def alike(one: SteadyState, other: SteadyState) -> bool:
    """Whether two steady motions are one: alike in status, order and modes, and the state of one at some period of the
    drive is that of the other."""
    if (one.status, one.order) != (other.status, other.order):
        return False
    if one.status == "rest":
        return True  # a set of equilibria counts once
    if cycle_of(one) != cycle_of(other):
        return False
    shape = one.orbit.table.physical
    points = other.orbit.section() if one.order > 1 else other.orbit.states[:1, :shape]
    gaps = np.abs(points - one.orbit.states[0, :shape])
    return bool(np.any(np.all(gaps <= 1e-8 * extent(one.orbit), axis=1)))


def cycle_of(orbit: SteadyState) -> tuple[str, ...]:
    """The modes around the orbit, wherever phase zero falls among them."""
    modes = [orbit.orbit.table.modes[m].name for m in orbit.orbit.modes]
    if len(modes) > 1 and modes[0] == modes[-1]:
        modes.pop()
    return min(tuple(modes[j:] + modes[:j]) for j in range(len(modes)))


@compiled(**OPTIONS)
def carry_tangents(linear, leap, pieces, after, tangents, work):
    """Carry small differences of the state through pieces and the events between them.

    At an event the difference jumps by the saltation matrix R + (f' - R f) q / (q f), where f = A S before and
    f' = A' R S after it: the neighbour meets the exit at another time.

    Parameters
    ----------
    linear : Linear
    leap : ndarray (M, M, N, N)
        Of :class:`stickslip.solve.tables.Tables`.
    pieces : Pieces
    after : int
        Mode that follows the last piece.
    tangents : ndarray (K, N)
        Differences of the state, updated.
    work : ndarray (8 or more, N)
        Scratch.

    Returns
    -------
    float
        Smallest speed of an exit through zero relative to its terms: near zero, the motion grazes and the derivative
        means nothing.
    """
    flow, series, target, reset = linear.flow, linear.series, linear.target, linear.reset
    modes, states, durations, exits = pieces.modes, pieces.states, pieces.durations, pieces.exits
    n = states.shape[1]
    least = 1.0
    scratch, end, begin, before, carried, fresh = work[:3], work[3], work[4], work[5], work[6], work[7]
    for j in range(modes.shape[0]):
        # Piece: the mode is linear, so that a difference moves as the state does.
        mode, e = modes[j], exits[j]
        for k in range(tangents.shape[0]):
            follow(linear, mode, tangents[k], durations[j], scratch)
        if e < 0:
            continue
        # Event: S and f = A S before it, S and f' behind it and the modes in which no time passes.
        following = modes[j + 1] if j + 1 < modes.shape[0] else after
        for i in range(n):
            end[i] = states[j, i]
        follow(linear, mode, end, durations[j], scratch)
        multiply(reset[e], end, scratch[0])
        multiply(leap[target[e], following], scratch[0], begin)
        multiply(flow[mode], end, before)
        # Graze: the derivative divides by q f.
        speed, size = 0.0, 0.0
        for i in range(n):
            term = series[e, 0, i] * before[i]
            speed += term
            size += abs(term)
        if size > 0.0:
            least = min(least, abs(speed) / size)
        # Saltation: R f and f', and the jump of each difference.
        multiply(reset[e], before, scratch[0])
        multiply(leap[target[e], following], scratch[0], carried)
        multiply(flow[following], begin, fresh)
        for k in range(tangents.shape[0]):
            shift = 0.0
            for i in range(n):
                shift += series[e, 0, i] * tangents[k, i]
            shift = shift / speed if speed != 0.0 else 0.0
            multiply(reset[e], tangents[k], scratch[0])
            multiply(leap[target[e], following], scratch[0], scratch[1])
            for i in range(n):
                tangents[k, i] = scratch[1, i] + (fresh[i] - carried[i]) * shift
    return least


Table = Tables | Tape

FINE = 1e-14  # tolerance of the runs that the map is made of
STEP = 1e-4  # of the size of an entry of the state: what its neighbours are apart
FORGOTTEN = 3e-9  # of the entry's size: a difference below this is rounding
TORN = 1e-2  # relative to the largest slope
CLOSED = 1e-12  # an orbit closes when it returns this close, relative to its own size


def tables(system: System) -> Table:
    """The flat tables of a system."""
    if not is_curved(system):
        return table_of(system)
    if any(isinstance(law, TimeDelay) for law in laws_of(system)):
        raise ModelError(
            "the law has a time lag",
            "this question needs a state of a few numbers, and that of a lag is the whole motion since",
            "simulate() many cycles and look at the last ones",
        )
    return tape(system)


def stretch(system: System, table: Table, state: Array, mode: int, *, span: tuple[float, float]) -> Trajectory:
    """The motion from a state at phase zero over a time (laps, offset)."""
    if isinstance(table, Tape):
        course = (span, stops_of(table, *span))
        return run_curved(table, state, mode, course=course, budget=10_000, rtol=FINE)
    return run(system, table, state, mode, span=span)


def lap(system: System, table: Table, state: Array, mode: int, laps: int) -> Trajectory:
    """The motion over whole periods of the drive from a state at phase zero."""
    return stretch(system, table, state, mode, span=(float(laps), 0.0))


def beat(system: System, table: Table) -> float:
    """Time from look to look [s]: the drive's period; of tones without one, that of the slowest; else the natural one.

    Infinite where nothing lasts: under a pulse, or without a drive or a spring.
    """
    motion = table.motion
    if np.isfinite(motion.period):
        return motion.period
    if motion.tones:
        return max(2 * np.pi / omega for _, _, omega, _ in motion.tones)
    return 1 / system.frequency if motion.rates and motion.knots is None and system.frequency else math.inf


def is_self_excited(table: Table) -> bool:
    """Whether nothing but the motion itself gives it a period."""
    return not math.isfinite(table.motion.period) and not table.motion.tones


def beats(system: System, table: Table, state: Array, mode: int, count: int) -> Trajectory:
    """The motion over so many beats, from a state that holds where the drive's signals are."""
    whole = np.isfinite(table.motion.period)
    return stretch(
        system, table, state, mode, span=(float(count), 0.0) if whole else (0.0, count * beat(system, table))
    )


def carried_on(orbit: Trajectory) -> tuple[Array, int]:
    """State and mode at the end of a motion, with the drive's signals as they are there."""
    table, (state, mode) = orbit.table, orbit.end()
    if np.isfinite(table.motion.period):
        return state, mode
    from scipy.linalg import expm

    place, motion, turned = table.names.index, table.motion, set[str]()
    for cosine, sine, omega, _ in motion.tones:
        turn = complex(state[place(cosine)], state[place(sine)]) * np.exp(1j * (omega * orbit.duration))
        state[place(cosine)], state[place(sine)] = turn.real, turn.imag
        turned |= {cosine, sine}
    others = ["1", *(name for name in motion.rates if name not in turned)]
    flow = np.array([[motion.rates.get(name, {}).get(other, 0.0) for other in others] for name in others])
    places = [place(name) for name in others]
    state[places] = expm(flow * orbit.duration) @ state[places]
    return state, mode


def closes(orbit: Trajectory, gap: float) -> bool:
    """Whether a return this close, relative to the orbit's size, is one to rounding."""
    return gap <= (10 * CLOSED if isinstance(orbit, CurvedTrajectory) else CLOSED)


def extent(orbit: Trajectory) -> Array:
    """Largest modulus of each physical entry of the state, as the pieces or steps begin."""
    return np.asarray(np.max(np.abs(orbit.corners[:, : orbit.table.physical]), axis=0))


def derivative(orbit: Trajectory, after: int) -> tuple[Array, float]:
    """Derivative of the map over an orbit, and the slowest crossing of an exit relative to its terms."""
    table, physical = orbit.table, orbit.table.physical
    if isinstance(orbit, CurvedTrajectory):
        sizes = extent(orbit)
        columns = [_differenced(orbit, direction) for direction in np.diag(sizes)]
        fine = np.array([column for column, _ in columns]).T
        torn = np.array([column for _, column in columns]).T
        with np.errstate(divide="ignore", invalid="ignore"):
            slope, gap = (np.nan_to_num(part / sizes[:, None], posinf=0.0) for part in (fine, torn))
            jacobian = np.nan_to_num(fine / sizes, posinf=0.0)
        return jacobian, float(np.max(np.abs(gap)) <= TORN * max(1.0, np.max(np.abs(slope))))
    size = len(table.names)
    tangents = np.eye(size)[:physical].copy()
    slowest = _carry(orbit, after, tangents)
    return tangents[:, :physical].T, slowest


def _carry(orbit: Trajectory, after: int, tangents: Array) -> float:
    """Carry small differences along an orbit; the slowest crossing of an exit."""
    table, pieces = orbit.table, (orbit.laps, orbit.offsets, orbit.modes, orbit.durations, orbit.states, orbit.exits)
    work = np.empty((9, len(table.names)))
    return float(carry_tangents(table.linear, table.leap, Pieces(*pieces), after, tangents, work))


def slowest_crossing(run: Trajectory) -> float:
    """The slowest crossing of an exit of a run under linear modes, relative to the terms of its rate."""
    return _carry(run, run.end()[1], np.empty((0, len(run.table.names))))


def carried(orbit: Trajectory, after: int, difference: Array) -> Array:
    """A small difference of the physical state, carried along an orbit."""
    if isinstance(orbit, CurvedTrajectory):
        sizes = extent(orbit)
        share = float(np.max(np.abs(difference[sizes > 0]) / sizes[sizes > 0], initial=0.0))
        return _differenced(orbit, difference / share)[0] * share if share else difference
    size = len(orbit.table.names)
    tangents = np.zeros((1, size))
    tangents[0, : len(difference)] = difference
    _carry(orbit, after, tangents)
    return tangents[0, : len(difference)]


def _differenced(orbit: CurvedTrajectory, direction: Array) -> tuple[Array, Array]:
    """Derivative of an orbit's end along a direction of its start, and by how much the second order differs."""
    table: Any = orbit.table
    mode, direction = int(orbit.modes[0]), direction.copy()
    direction[: table.physical] = table.free(mode) @ direction[: table.physical]
    if not np.any(direction):
        return direction, direction
    period = table.motion.period
    laps = round(orbit.duration / period) if np.isfinite(period) else 0
    span = (float(laps), 0.0 if laps else orbit.duration)
    ends = {}
    for steps in (-2, -1, 1, 2):
        state = orbit.states[0].copy()
        state[: table.physical] += steps * STEP * direction
        beside = stretch(orbit.system, table, state, mode, span=span)
        ends[steps] = beside.sample([beside.duration], ("state",))[0][:, 0]
    near, far = ends[1] - ends[-1], ends[2] - ends[-2]
    slope = (8 * near - far) / (12 * STEP)
    return np.where(np.abs(slope) > FORGOTTEN * extent(orbit), slope, 0.0), (2 * near - far) / (12 * STEP)


BATCHES = 25  # of which the scatter gives the interval
STUDENT = 2.064  # two-sided 95 % quantile at 24 degrees of freedom


def lyapunov(
    system: System, *, cycles: int = 5000, transient: int = 100, start: Mapping[str, float | str] | None = None
) -> Estimate:
    """Does the motion forget its beginning, or does it part from its neighbours (chaos)?

    The largest Lyapunov exponent that differs from the neutral one of time: the growth rate of a small difference of
    the state at fixed phase of the drive, carried along the exact motion, saltation at events included; of a curved
    law, by central differences of the map. A self-excited motion is looked at from natural period to natural period.

    A stick forgets the velocity and with it one direction; a rigid contact that sticks in every period may forget
    everything, and the exponent is minus infinity.

    Parameters
    ----------
    system : Oscillator or Structure
        What moves: with a periodic drive, one of several tones, or on a belt.
    cycles : int
        Periods over which the growth is averaged; of tones without a common one those of the slowest, on a belt the
        natural ones.
    transient : int
        Periods before that.
    start : mapping, optional
        As in ``simulate``.

    Returns
    -------
    Estimate
        In 1/s; positive for chaos.

    Raises
    ------
    SolveError
        The drive has neither period nor tones, and is no belt.

    Examples
    --------
    >>> from stickslip.drives.kinds import HarmonicForce
    >>> from stickslip.laws.coulomb import Coulomb
    >>> drive = HarmonicForce(1.0, frequency=0.6 / 6.283185307)
    >>> from stickslip.oscillator import Oscillator
    >>> slider = Oscillator(mass=1, stiffness=1, law=Coulomb(0.3), drive=drive)
    >>> lyapunov(slider, cycles=500).value < 0
    True
    """
    if cycles < BATCHES or transient < 0:
        raise ModelError(f"cycles = {cycles}", f"the interval needs {BATCHES} cycles at least", "raise cycles=")
    table = recurring(system)
    return growth(system, table, *opening(table, start or {}), cycles=cycles, transient=transient)


def recurring(system: System) -> Table:
    """The tables of a system whose growth can be counted from beat to beat; refused where there is none."""
    table = tables(system)
    if not math.isfinite(beat(system, table)):
        raise SolveError(
            "the drive has no period", "growth is counted from period to period", "use a periodic drive, or a belt"
        )
    return table


def growth(system: System, table: Table, state: Array, mode: int, *, cycles: int, transient: int = 0) -> Estimate:
    """The largest Lyapunov exponent [1/s] of the motion from a state on, but for the neutral one of time.

    A difference along a self-excited motion neither grows nor fades: its exponent, of all the one nearest to zero, is
    told from the others by carrying them all (Benettin et al., Meccanica 15, 1980).
    """
    free, period = is_self_excited(table), beat(system, table)
    how = "differences of the map" if isinstance(table, Tape) else "exact tangent"
    orbit = beats(system, table, state, mode, 1)
    weights = _weights(system, orbit)[:, None]
    fresh = (np.eye(table.physical) if free else np.linspace(1.0, 0.5, table.physical)[:, None]) / weights
    differences, rows = fresh, list[Array]()
    for number in range(transient + cycles):
        if number:
            orbit = beats(system, table, state, mode, 1)
        state, mode = carried_on(orbit)
        slope = derivative(orbit, mode)[0] if free else None
        differences = carried(orbit, mode, differences[:, 0])[:, None] if slope is None else slope @ differences
        directions, sizes = np.linalg.qr(differences * weights)
        lengths = np.abs(np.diag(sizes))
        kept = lengths > FORGOTTEN * np.max(lengths) if free else lengths > 0
        left = np.count_nonzero(kept) > free
        differences = (directions / weights)[:, kept]
        if number < transient:
            differences = differences if left else fresh  # a beginning may stick where later nothing is held
            continue
        if not left:
            forgotten = f"every difference was forgotten in lap {number}"
            none = (-math.inf, -math.inf)
            return Estimate("Lyapunov exponent", -math.inf, none, 0.0, "1/s", how, checks=(forgotten,))
        rows = rows if kept.all() else [row[kept] for row in rows]
        rows.append(np.log(lengths[kept]) / period)
    return _largest(np.array(rows), f"{how} over {cycles} periods, scatter of {BATCHES} batches", neutral=free)


def _largest(grown: Array, method: str, *, neutral: bool) -> Estimate:
    """Of growths by lap and direction the largest, where `neutral` but for the one of time."""
    means = grown.mean(axis=0)
    others = np.delete(np.arange(len(means)), np.argmin(np.abs(means))) if neutral else np.arange(len(means))
    largest = grown[:, others[np.argmax(means[others])]]
    batches = np.array([np.mean(part) for part in np.array_split(largest, BATCHES)])
    spread = float(np.std(batches, ddof=1) / math.sqrt(BATCHES))
    value = float(np.mean(largest))
    return Estimate.normal("Lyapunov exponent", value, sd=spread, unit="1/s", method=method, quantile=STUDENT)


def _weights(system: System, orbit: Trajectory) -> Array:
    """What makes the entries of the state comparable: their size, or a time for velocities."""
    if isinstance(orbit, CurvedTrajectory):
        sizes = extent(orbit)
        return np.asarray(1 / np.where(sizes > 0, sizes, 1.0))
    table = orbit.table
    weights = np.ones(table.physical)
    weights[table.degrees : 2 * table.degrees] = (
        1 / system.frequency / (2 * math.pi) if system.frequency else beat(system, table)
    )
    return weights
