"""The motion that repeats: periodic orbits by Newton on the exact map, their stability, and what they do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from stickslip.errors import ModelError, SolveError
from stickslip.solve.aperiodic import aperiodic, tonal
from stickslip.solve.orbit import SteadyState, alike
from stickslip.solve.poincare import CLOSED, Table, closes, derivative, extent, lap, tables
from stickslip.solve.self_excited import self_excited
from stickslip.solve.simulate import opening
from stickslip.solve.tables import Array, System
from stickslip.solve.tape import Tape
from stickslip.solve.trajectory import Trajectory

UNIT = 1e-7  # a multiplier this close to 1 is 1: its rounding grows with the square root of a double eigenvalue
GRAZING = 1e-9  # an exit crossed this slowly, relative to the terms of its rate, is a tangency
RESONANT = 2**17  # periods of a system without damping in resonance, before its growth is told from its beginning
EVEN = 0.02  # by which growth may differ from twice as much in twice the time
RUNAWAY = 1e30  # of the first period's size: what grows so far has no bound


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
    on a belt are alike. Tones have the least common multiple of their periods for one; where there is none, and where
    no orbit closes, neighbours of the motion and its spectrum tell what it is: quasi-periodic, with its basic
    frequencies, or chaotic, with its largest Lyapunov exponent.

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
    >>> from stickslip.drives.kinds import HarmonicForce
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
        raise ModelError(
            f"{', '.join(f'{name} = {count}' for name, count in counts.items())}",
            "they are whole numbers of periods, at least 1",
            "correct them",
        )
    table = tables(system)
    if not math.isfinite(table.motion.period):
        if table.motion.tones and table.motion.knots is None and not table.motion.base.get("way"):
            return tonal(system, table, start or {}, (transient, patience))
        return self_excited(system, table, start or {}, transient)
    state, mode = opening(table, start or {})
    laps, sizes, first = 0, [], _iterate(system, table, state, mode, 1)[2]
    count, passed = transient, None
    resonant = _repeats_freely(table)
    while laps < (max(patience, RESONANT) if resonant else patience):
        state, mode, size = _iterate(system, table, state, mode, count)
        laps += count
        sizes.append(size)
        if size > RUNAWAY * first or (resonant and _grows_evenly(sizes)):
            break
        orbit = _closed(system, table, state, mode, orders) if laps <= 2 * patience else None
        if orbit is None and resonant:
            orbit = _family(system, table, state, mode, size, orders)
        if orbit is not None and orbit.status != "unstable":
            return orbit
        passed = passed or orbit  # an unstable orbit, which Newton's method closes where a motion only passes
        count = laps
    growing = (
        sizes[-1] > RUNAWAY * first
        or (resonant and _grows_evenly(sizes))
        or (len(sizes) > 3 and all(later > 1.5 * sooner for sooner, later in pairwise(sizes[1:])))
    )
    if growing:
        none = np.full(table.physical, np.nan, dtype=np.complex128)
        return passed or SteadyState("unbounded", math.nan, 0, lap(system, table, state, mode, 1), none)
    found = aperiodic(system, table, state, mode)
    return passed if passed is not None and found.status == "not periodic" else found


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
    >>> from stickslip.drives.kinds import HarmonicForce
    >>> from stickslip.laws.coulomb import Coulomb
    >>> from stickslip.oscillator import Oscillator
    >>> drive = HarmonicForce(1.0, frequency=0.8 / 6.283185307)
    >>> slider = Oscillator(mass=1, stiffness=1, law=Coulomb(0.7, static=1.05), drive=drive)
    >>> [orbit.status for orbit in attractors(slider, starts=[{}, {"x": 3.0}])]
    ['rest', 'unique']
    """
    attractors: list[SteadyState] = []
    for start in starts:
        orbit = steady_state(system, start=start, transient=transient, orders=orders)
        if not any(alike(orbit, other) for other in attractors):
            attractors.append(orbit)
    return tuple(attractors)


def _iterate(system: System, table: Table, state: Array, mode: int, laps: int) -> tuple[Array, int, float]:
    orbit = lap(system, table, state, mode, laps)
    return *orbit.end(), _size(orbit)


def _grows_evenly(sizes: list[float]) -> bool:
    """Whether each of the last doublings of the time has added twice what the one before did."""
    added = np.diff(sizes[-4:])
    return len(added) == 3 and bool(np.all(added > 0) and np.all(np.abs(added[1:] / added[:-1] - 2) < EVEN))


def _size(orbit: Trajectory) -> float:
    """Largest displacement of late."""
    return float(np.max(np.abs(orbit.corners[-64:, 0])))


def _closed(system: System, table: Table, state: Array, mode: int, orders: int) -> SteadyState | None:
    """The orbit near a state, of the least order that closes; None where Newton finds none."""
    for order in range(1, orders + 1):
        orbit = closed_orbit(system, table, state, mode, order)
        if orbit is not None:
            return orbit
    return None


def closed_orbit(system: System, table: Table, state: Array, mode: int, order: int) -> SteadyState | None:
    """The orbit of so many periods of the drive near a state; None where Newton finds none."""
    best: tuple[float, Trajectory | None, int] = (math.inf, None, 0)
    point, where = state, mode
    for _ in range(12):
        try:
            orbit = lap(system, table, point, where, order)
        except SolveError:
            break  # Newton's method left what moves; the motion itself goes on
        end, after = orbit.end()
        size = extent(orbit)
        if point is not state and all(table.modes[held].friction is None for held in orbit.modes):
            break  # Newton's method stepped to where the contact would rest; the motion itself does not
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
            gap = np.abs(part.end()[0] - orbit.states[0])[: table.physical]
            if np.all(gap <= 1e3 * CLOSED * extent(orbit)):
                return judged(part, fewer, *derivative(part, part.end()[1]))
    return judged(orbit, order, *derivative(orbit, after))


def _repeats_freely(table: Table) -> bool:
    """Whether free motion in every slip mode repeats after one period of the drive: b = 1/2n without damping."""
    if isinstance(table, Tape):
        return False
    from scipy.linalg import expm

    own = 2 * table.degrees
    free = [flow[:own, :own] for flow, mode in zip(table.flow, table.modes, strict=True) if mode.kind == "slip"]
    turns = [expm(flow * table.motion.period) for flow in free]
    return bool(turns) and all(np.allclose(turn, np.eye(own), rtol=0, atol=1e-9) for turn in turns)


def _family(system: System, table: Table, state: Array, mode: int, size: float, orders: int) -> SteadyState | None:
    """An orbit inside a family whose edge is approached forever: a push off the edge closes at once."""
    for push in (0.05, 0.1, 0.2):
        pushed = state.copy()
        pushed[0] += math.copysign(push * size, state[0])
        point, where, _ = _iterate(system, table, pushed, mode, 32)
        orbit = _closed(system, table, point, where, orders)
        if orbit is not None and orbit.status == "not unique":
            return orbit
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
