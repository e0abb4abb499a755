"""The motion that repeats: periodic orbits by Newton on the exact map, their stability, and what they do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError, SolveError
from stickslip.solve.automaton import Array, System, exponential
from stickslip.solve.autonomous import settled_cycle
from stickslip.solve.curved import CurvedTrajectory
from stickslip.solve.poincare import CLOSED, Table, closes, derivative, end_of, extent, lap, stretch, tables
from stickslip.solve.simulate import opening
from stickslip.solve.tape import Tape
from stickslip.solve.trajectory import Event, Trajectory
from stickslip.structure import Structure

UNIT = 1e-7  # a multiplier this close to 1 is 1: its rounding grows with the square root of a double eigenvalue
ROUNDS = 16  # transients of a self-excited motion before no orbit is expected any more
RUNAWAY = 1e30  # of the first period's size: what grows so far has no bound
GRAZING = 1e-9  # an exit crossed this slowly, relative to the terms of its rate, is a tangency


@dataclass(frozen=True, eq=False)
class SteadyState:
    """A periodic orbit, or why there is none.

    Attributes
    ----------
    status : str
        "unique" (isolated and stable; from other starts there may be others), "unstable", "grazing" (an
        exit is met at a tangent: no derivative, no multipliers), "not unique" (a family of orbits: a
        multiplier is 1), "rest" (held all the time), "unbounded" (the amplitude grows without end), "not
        periodic" (no orbit found).
    period : float
        Period [s]; of several periods of the drive where `order` is above 1.
    order : int
        Period over the drive's; 1 for a self-excited orbit.
    orbit : Trajectory
        One period, from phase zero of the drive.
    multipliers : ndarray of complex
        Eigenvalues of the map over one period, largest first; saltation at events included.
    """

    status: str
    period: float
    order: int
    orbit: Trajectory
    multipliers: NDArray[np.complex128]

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


def steady_state(
    system: System,
    *,
    start: Mapping[str, float | str] | None = None,
    transient: int = 64,
    orders: int = 4,
    patience: int = 4096,
) -> SteadyState:
    """Which motion is left when the beginning is forgotten?

    The exact map over a period of the drive is iterated through a transient, then closed by Newton's method with its
    exact derivative; that of a curved law is differenced, and its multipliers are known to some 1e-9. A system without
    a periodic drive (a belt, a ramp) is followed until a stick ends as the one before did; where contacts lift off and
    none sticks, until Newton's method closes the cycle; where the law never holds the mass, until two turns of the mass
    on a belt are alike.

    Parameters
    ----------
    system : Oscillator or Structure
        What moves.
    start : mapping, optional
        Where the transient starts, as in ``simulate``; another start can lead to another orbit.
    transient : int
        Periods before the first attempt to close the orbit.
    orders : int
        Longest orbit looked for, in periods of the drive.
    patience : int
        Periods after which no orbit is expected any more.

    Returns
    -------
    SteadyState

    Raises
    ------
    SolveError
        No motion repeats because nothing drives the system.
    ModelError
        The law has a time lag, or a number of periods is none.

    Examples
    --------
    >>> from stickslip.drives import HarmonicForce
    >>> from stickslip.laws.coulomb import Coulomb
    >>> drive = HarmonicForce(1.0, frequency=0.8 / 6.283185307)
    >>> from stickslip.oscillator import Oscillator
    >>> slider = Oscillator(mass=1, stiffness=1, law=Coulomb(0.5), drive=drive)
    >>> orbit = steady_state(slider)
    >>> orbit.status, round(orbit.amplitude, 6), orbit.stops
    ('unique', 2.332235, (0, 0))
    """
    counts = {"transient": transient, "orders": orders, "patience": patience}
    if not all(isinstance(count, int | np.integer) and count >= 1 for count in counts.values()):
        raise ModelError(f"{', '.join(f'{name} = {count}' for name, count in counts.items())}",
                         "they are whole numbers of periods, at least 1", "correct them")  # fmt: skip
    table = tables(system)
    if not math.isfinite(table.motion.period):
        return _self_excited(system, table, start or {}, transient)
    state, mode = opening(table, start or {})
    laps, sizes, first = 0, [], _iterate(system, table, state, mode, 1)[2]
    count = transient
    while laps < patience:
        state, mode, size = _iterate(system, table, state, mode, count)
        laps += count
        sizes.append(size)
        if size > RUNAWAY * first:
            break
        found = _closed(system, table, state, mode, orders)
        if found is None and _repeats_freely(table):
            found = _family(system, table, state, mode, size, orders)
        if found is not None:
            return found
        count = laps
    orbit = lap(system, table, state, mode, 1)
    growing = sizes[-1] > RUNAWAY * first or (
        len(sizes) > 3 and all(later > 1.5 * sooner for sooner, later in pairwise(sizes[1:]))
    )
    none = np.full(table.physical, np.nan, dtype=np.complex128)
    return SteadyState("unbounded" if growing else "not periodic", math.nan, 0, orbit, none)


def attractors(
    system: System, *, starts: Sequence[Mapping[str, float | str]], transient: int = 64, orders: int = 4
) -> tuple[SteadyState, ...]:
    """Which steady motions exist beside each other?

    Parameters
    ----------
    system : Oscillator
        What moves.
    starts : sequence of mapping
        Where the transients start, as in ``simulate``; each leads to one motion.
    transient, orders : int
        As in :func:`steady_state`.

    Returns
    -------
    tuple of SteadyState
        The different ones among them, in the order they were found.

    Examples
    --------
    >>> from stickslip.drives import HarmonicForce
    >>> from stickslip.laws.coulomb import Coulomb
    >>> from stickslip.oscillator import Oscillator
    >>> drive = HarmonicForce(1.0, frequency=0.8 / 6.283185307)
    >>> slider = Oscillator(mass=1, stiffness=1, law=Coulomb(0.7, static=1.05), drive=drive)
    >>> [orbit.status for orbit in attractors(slider, starts=[{}, {"x": 3.0}])]
    ['rest', 'unique']
    """
    found: list[SteadyState] = []
    for start in starts:
        orbit = steady_state(system, start=start, transient=transient, orders=orders)
        if not any(alike(orbit, other) for other in found):
            found.append(orbit)
    return tuple(found)


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


def _iterate(system: System, table: Table, state: Array, mode: int, laps: int) -> tuple[Array, int, float]:
    orbit = lap(system, table, state, mode, laps)
    return *end_of(orbit), _size(orbit)


def _size(orbit: Trajectory) -> float:
    """Largest displacement of late."""
    states = orbit.step_states if isinstance(orbit, CurvedTrajectory) else orbit.states
    return float(np.max(np.abs(states[-64:, 0])))


def _closed(system: System, table: Table, state: Array, mode: int, orders: int) -> SteadyState | None:
    """The orbit near a state, of the least order that closes; None where Newton finds none."""
    for order in range(1, orders + 1):
        best: tuple[float, Trajectory | None, int] = (math.inf, None, 0)
        point, where = state, mode
        for _ in range(12):
            orbit = lap(system, table, point, where, order)
            end, after = end_of(orbit)
            size = extent(orbit)
            gap = (end - point)[: table.physical]
            relative = float(np.max(np.abs(gap) / np.maximum(size, 1e-300), initial=0.0, where=size > 0))
            if relative >= best[0]:
                break
            best = (relative, orbit, after)
            jacobian, _ = derivative(orbit, after)
            step, *_ = np.linalg.lstsq(np.eye(table.physical) - jacobian, gap, rcond=UNIT)
            if np.any(np.abs(step) > 2 * size):
                break
            point, where = point.copy(), int(orbit.modes[0])
            point[: table.physical] += step
        if best[1] is not None and closes(best[1], best[0]):
            return _least(system, table, best[1], best[2], order)
    return None


def _least(system: System, table: Table, orbit: Trajectory, after: int, order: int) -> SteadyState:
    """An orbit that closes, over no more laps than it needs: Newton may have closed several turns of it alone."""
    for fewer in range(1, order):
        if order % fewer == 0:
            part = lap(system, table, orbit.states[0], int(orbit.modes[0]), fewer)
            gap = np.abs(end_of(part)[0] - orbit.states[0])[: table.physical]
            if np.all(gap <= 1e3 * CLOSED * extent(orbit)):
                return judged(part, fewer, *derivative(part, end_of(part)[1]))
    return judged(orbit, order, *derivative(orbit, after))


def _repeats_freely(table: Table) -> bool:
    """Whether free motion in every slip mode repeats after one period of the drive: b = 1/2n without damping."""
    if isinstance(table, Tape):
        return False
    own = 2 * table.degrees
    free = [flow[:own, :own] for flow, mode in zip(table.flow, table.modes, strict=True) if mode.kind == "slip"]
    turns = [exponential(flow, table.motion.period) for flow in free]
    return bool(turns) and all(np.allclose(turn, np.eye(own), rtol=0, atol=1e-9) for turn in turns)


def _family(system: System, table: Table, state: Array, mode: int, size: float, orders: int) -> SteadyState | None:
    """An orbit inside a family whose edge is approached forever: a push off the edge closes at once."""
    for push in (0.05, 0.1, 0.2):
        pushed = state.copy()
        pushed[0] += math.copysign(push * size, state[0])
        point, where, _ = _iterate(system, table, pushed, mode, 32)
        found = _closed(system, table, point, where, orders)
        if found is not None and found.status == "not unique":
            return found
    return None


def judged(orbit: Trajectory, order: int, jacobian: Array, slowest: float) -> SteadyState:
    """An orbit that closes, with what its multipliers say; where it grazes they say nothing."""
    table = orbit.table
    multipliers = np.linalg.eigvals(jacobian).astype(np.complex128)
    multipliers = multipliers[np.argsort(-np.abs(multipliers))]
    if slowest < GRAZING:
        multipliers[:] = np.nan
    sides = {table.modes[m].side for m in orbit.modes}
    if sides == {0}:
        status = "rest" if all(table.modes[m].friction is None for m in orbit.modes) else "unique"
    elif slowest < GRAZING:
        status = "grazing"
    elif np.any(np.abs(multipliers - 1) < UNIT):
        status = "not unique"
    else:
        status = "unique" if abs(multipliers[0]) < 1 else "unstable"
    return SteadyState(status, order * table.motion.period, order, orbit, multipliers)


def _self_excited(system: System, table: Table, start: Mapping[str, float | str], transient: int) -> SteadyState:
    """The orbit between two equal ends of a stick, or, without sticks, the one that closes."""
    if not table.motion.rates:
        raise SolveError("nothing drives the system", "only a driven motion repeats", "give a drive=")
    state, mode = opening(table, start)
    scale = 1 / system.frequency if system.frequency else 1.0
    if isinstance(table, Tape) and all(mode.friction is not None for mode in table.modes):
        return _between_turns(system, table, state, mode, transient * scale)
    # the way of the belt moves on, so the relative coordinate is compared, not the signals
    duration = transient * scale
    for _ in range(8):
        motion = stretch(system, table, state, mode, span=(0.0, duration))
        ends = [
            j
            for j in range(1, len(motion.modes))
            if table.modes[motion.modes[j - 1]].friction is None and motion.exits[j - 1] >= 0
        ]
        if len(ends) > 2:
            first, last = ends[-2], ends[-1]
            own = slice(0, table.physical if isinstance(table, Tape) else 2 * table.degrees)
            gap = np.abs(motion.states[last, own] - motion.states[first, own])
            if np.all(gap <= 1e-9 * np.max(np.abs(motion.states[first : last + 1, own]), axis=0)):
                return _between(motion, first, last)
        if not isinstance(table, Tape) and (not ends or motion.starts[ends[-1]] < duration / 2):
            found = _without_sticks(motion)
            if found is not None:
                return found
        duration *= 2
    none = np.full(table.physical, np.nan, dtype=np.complex128)
    steady = len(motion.modes) == 1 or motion.durations[-1] > 0.5 * duration
    return SteadyState("rest" if steady and table.modes[motion.modes[-1]].side == 0 else "not periodic",
                       math.nan, 0, motion, none)  # fmt: skip


def _without_sticks(motion: Trajectory) -> SteadyState | None:
    """The orbit that a motion of linear modes ends in; between events nothing bounds it, so it has some."""
    found = settled_cycle(motion, 2 * math.pi * float(np.min(motion.table.cell)))
    if found is None or len(found[0].modes) == 1:
        return None
    orbit, across = found
    multipliers = np.append(across, 0.0)  # along the orbit nothing grows: its phase is free
    return SteadyState("unique" if abs(across[0]) < 1 else "unstable", orbit.duration, 1, orbit, multipliers)


def _between_turns(system: System, table: Tape, state: Array, mode: int, duration: float) -> SteadyState:
    """The orbit of a law that never holds the mass, from one turn of the mass to the next."""
    physical = table.physical
    for _ in range(ROUNDS):
        motion = stretch(system, table, state, mode, span=(0.0, duration))
        assert isinstance(motion, CurvedTrajectory)
        turns = _turns(motion)
        if len(turns) < 2 or table.motion.base or table.motion.tones:
            break
        values, pieces = motion.sample(turns, ("state",))
        state, mode = state.copy(), int(motion.modes[pieces[1]])
        state[:physical] = values[:, 1]
        sizes = np.max(np.abs(motion.step_states[motion.step_starts > turns[0], :physical]), axis=0)
        if np.all(np.abs(values[:, 1] - values[:, 0]) <= 1e-9 * sizes):
            period = turns[1] - turns[0]
            orbit = stretch(system, table, state, mode, span=(0.0, period))
            multipliers = np.linalg.eigvals(derivative(orbit, mode)[0]).astype(np.complex128)
            multipliers[np.argmin(np.abs(multipliers - 1))] = 0.0  # along the orbit nothing grows: its phase is free
            multipliers = multipliers[np.argsort(-np.abs(multipliers))]
            return SteadyState("unique" if abs(multipliers[0]) < 1 else "unstable", period, 1, orbit, multipliers)
    none = np.full(physical, np.nan, dtype=np.complex128)
    return SteadyState("not periodic", math.nan, 0, motion, none)


def _turns(motion: CurvedTrajectory) -> list[float]:
    """The last two instants at which the velocity rises through zero."""
    from scipy.optimize import brentq

    v, ends = motion.step_states[:, 1], motion.step_starts
    rises = np.flatnonzero((v[:-1] < 0) & (v[1:] >= 0))[-2:]
    return [
        float(brentq(lambda t: motion.sample([t], ("v",))[0][0, 0], ends[j], ends[j + 1], xtol=1e-15 * ends[j + 1]))
        for j in rises
    ]


def _between(motion: Trajectory, first: int, last: int) -> SteadyState:
    """The orbit from one piece to another where it begins anew."""
    part, begin, end = slice(first, last), motion.starts[first], motion.starts[last]
    own: dict[str, Any] = {}
    if isinstance(motion, CurvedTrajectory):
        steps = slice(*np.searchsorted(motion.step_starts, [begin, end]))
        own = {name: getattr(motion, name)[steps] for name in ("step_lengths", "step_modes", "step_states")}
        own["step_starts"] = motion.step_starts[steps] - begin
    orbit = replace(
        motion, laps=np.zeros(last - first, np.int32), offsets=motion.starts[part] - begin, modes=motion.modes[part],
        durations=motion.durations[part], kept=motion.states[part], exits=motion.exits[part],
        duration=float(end - begin), status="complete", **own,
    )  # fmt: skip
    # a stick ends in one state alone: whatever came before is forgotten
    return SteadyState("unique", orbit.duration, 1, orbit, np.zeros(motion.table.physical, dtype=np.complex128))
