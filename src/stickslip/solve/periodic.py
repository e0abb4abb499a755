"""The motion that repeats: periodic orbits by Newton on the exact map, their stability, and what they do.

Of motions that never repeat the exponent tells chaos from what is quasi-periodic, and that has its frequencies: a drive
of several tones without a common period forces a motion with all of them; a torus beside one tone has one of its own.
Lines of a spectrum tell them, by a window of Blackman and Harris (Harris, Proc. IEEE 66, 1978).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ModelError, SolveError
from stickslip.solve.poincare import (
    CLOSED,
    SteadyState,
    Table,
    alike,
    beat,
    beats,
    carried_on,
    closes,
    derivative,
    extent,
    growth,
    lap,
    tables,
)
from stickslip.solve.refusal import Outgrown
from stickslip.solve.self_excited import self_excited
from stickslip.solve.simulate import opening
from stickslip.solve.tables import System
from stickslip.solve.tape import Tape
from stickslip.solve.trajectory import Trajectory

COUNTED, COUNTED_CURVED = 500, 125  # beats over which neighbours are followed; of a curved law each takes five runs
PARTED = 20.0  # e-foldings by which neighbours part, or come together, before that is more than a torus's drift
LOOKED, POINTS = 256, 64  # beats of a spectrum, and points in the period of the fastest tone
FAINT, NEAR = 1e-4, 2.0  # of the largest line; bins, within which two lines are one
MOST = 32  # lines kept
STILL = 1e-9  # of its displacement: what moves by no more has no lines
LASTING = 0.02  # of a bin, and of its size, by which a torus's line may differ from one look to the next
RETURN = 1e-9  # of the motion's size: a return this close, from beat to beat, is one


def aperiodic(system: System, table: Table, state: Array, mode: int) -> SteadyState:
    """What a motion does that was not found to repeat: "chaotic", "quasi-periodic", or "not periodic" where neither is
    seen: its neighbours come together, and it only repeats later than was looked."""
    orbit = beats(system, table, state, mode, 1)
    none = np.full(table.physical, np.nan, dtype=np.complex128)
    answer = SteadyState("not periodic", math.nan, 0, orbit, none)
    count = COUNTED_CURVED if isinstance(table, Tape) else COUNTED
    exponent = growth(system, table, state, mode, cycles=count)
    parted = exponent.value * count * beat(system, table)
    if parted > PARTED and exponent.interval[0] > 0:
        return replace(answer, status="chaotic", exponent=exponent)
    known = tuple(omega / (2 * math.pi) for _, _, omega, _ in table.motion.tones)
    tonal = not math.isfinite(table.motion.period) and len(known) > 1
    if parted < -PARTED and not tonal:
        return replace(answer, exponent=exponent)
    lines, again = [], (state, mode)
    for _ in range(2 if len(known) == 1 else 1):
        motion = beats(system, table, *again, LOOKED)
        again = carried_on(motion)
        lines.append(spectrum(motion, max(known, default=1 / beat(system, table))))
    basic = (*known, *_own(lines, known[0], 1 / motion.duration)) if len(known) == 1 else known
    status = "quasi-periodic" if len(basic) > 1 else "not periodic"
    return replace(answer, status=status, exponent=exponent, lines=lines[-1], frequencies=basic)


def tonal(system: System, table: Table, start: Mapping[str, float | str], counts: tuple[int, int]) -> SteadyState:
    """What tones without a period of their own leave: beside a belt, or beside each other.

    `counts` are the beats of the transient, and those after which nothing is expected to repeat any more.
    """
    (transient, patience), (state, mode) = counts, opening(table, start)
    laps, count = 0, transient
    while laps < patience:
        motion = beats(system, table, state, mode, count)
        before = state, mode
        state, mode = carried_on(motion)
        laps += count
        if len(motion.modes) == 1 and table.modes[motion.modes[0]].friction is None:
            none = np.full(table.physical, np.nan, dtype=np.complex128)
            return SteadyState("rest", math.nan, 0, motion, none)
        orbit = _returned(system, table, before, motion, count) if len(table.motion.tones) == 1 else None
        if orbit is not None:
            return orbit
        if len(table.motion.tones) > 1 and laps >= 4 * transient:
            break  # these never repeat: what is forgotten by now is forgotten
        count = laps
    return aperiodic(system, table, state, mode)


def _returned(
    system: System, table: Table, before: tuple[Array, int], motion: Trajectory, count: int
) -> SteadyState | None:
    """The orbit that ends a motion of so many beats, where it is now what it was some beats ago."""
    times = np.arange(count + 1) * beat(system, table)
    points = motion.sample(np.minimum(times, motion.duration), ("state",))[0][: table.physical]
    size = extent(motion)
    gaps = np.max(np.abs(points - points[:, -1:]) / np.where(size > 0, size, 1.0)[:, None], axis=0)
    alike = np.flatnonzero(gaps[:-1] <= RETURN)
    if not len(alike):
        return None
    order = count - int(alike[-1])
    if count - order:
        before = carried_on(beats(system, table, *before, count - order))
    orbit = beats(system, table, *before, order)
    state, mode = carried_on(orbit)
    gap = np.abs(state - before[0])[: table.physical] / np.where(size > 0, size, 1.0)
    if np.max(gap) > RETURN or mode != before[1]:
        return None
    multipliers = np.linalg.eigvals(derivative(orbit, mode)[0]).astype(np.complex128)
    multipliers = multipliers[np.argsort(-np.abs(multipliers))]
    return SteadyState("unique" if abs(multipliers[0]) < 1 else "unstable", orbit.duration, order, orbit, multipliers)


def spectrum(motion: Trajectory, fastest: float) -> Array:
    """Lines of the displacement, strongest first: frequency [Hz] and amplitude [m]; `fastest` is the fastest tone."""
    from scipy.signal.windows import blackmanharris

    count = min(int(POINTS * fastest * motion.duration), 2**18)
    x = motion.sample(np.arange(count) * (motion.duration / count), ("x",))[0][0]
    if np.ptp(x) <= STILL * np.max(np.abs(x)):
        return np.empty((0, 2))
    window = blackmanharris(count, sym=False)
    size = 2 * np.abs(np.fft.rfft((x - np.mean(x)) * window)) / np.sum(window)
    inner = np.arange(2, len(size) - 1)
    peaks = inner[(size[inner] > size[inner - 1]) & (size[inner] >= size[inner + 1])]
    peaks = peaks[size[peaks] > FAINT * np.max(size[peaks], initial=0.0)]
    peaks = peaks[np.argsort(-size[peaks])][:MOST]
    # the window's own top is a parabola of the logarithm to a thousandth of a bin
    low, top, high = (np.log(size[peaks + j]) for j in (-1, 0, 1))
    off = 0.5 * (low - high) / (low - 2 * top + high)
    return np.column_stack([(peaks + off) / motion.duration, np.exp(top - 0.25 * (low - high) * off)])


def _own(lines: list[Array], tone: float, bin_: float) -> tuple[float, ...]:
    """Frequency of the strongest line that is no multiple of a tone, where it lasts: a beginning fades or grows."""
    strongest = []
    for part in lines:
        beside = np.abs(part[:, 0] - tone * np.round(part[:, 0] / tone)) > NEAR * bin_
        strongest.append(part[np.argmax(beside)] if np.any(beside) else np.full(2, np.nan))
    (before, was), (after, now) = strongest
    return (float(after),) if abs(after - before) < LASTING * bin_ and abs(now - was) < LASTING * was else ()


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
    orbit, passed = settled_on(system, start or {}, transient=transient, orders=orders, patience=patience)
    table = orbit.orbit.table
    if orbit.status != "not periodic" or not math.isfinite(beat(system, table)) or _is_tonal(table):
        return orbit
    motion = aperiodic(system, table, *carried_on(orbit.orbit))
    return passed if passed is not None and motion.status == "not periodic" else motion


def settled_on(
    system: System, start: Mapping[str, float | str], *, transient: int, orders: int, patience: int
) -> tuple[SteadyState, SteadyState | None]:
    """As :func:`steady_state`; of a motion that repeats with no period of the drive it is not looked which it is.

    Beside it an unstable orbit, which Newton's method closes where a motion only passes.
    """
    table = tables(system)
    if _is_tonal(table):
        return tonal(system, table, start, (transient, patience)), None
    if not math.isfinite(table.motion.period):
        return self_excited(system, table, start, transient), None
    state, mode = opening(table, start)
    laps, sizes, first = 0, [], _iterate(system, table, state, mode, 1)[2]
    count, passed = transient, None
    resonant = _repeats_freely(table)
    while laps < (max(patience, RESONANT) if resonant else patience):
        try:
            state, mode, size = _iterate(system, table, state, mode, count)
        except Outgrown:
            size = math.inf
        laps += count
        sizes.append(size)
        if size > RUNAWAY * first or (resonant and _grows_evenly(sizes)):
            break
        orbit = _closed(system, table, state, mode, orders) if laps <= 2 * patience else None
        if orbit is None and resonant:
            orbit = _family(system, table, state, mode, size, orders)
        if orbit is not None and orbit.status != "unstable":
            return orbit, passed
        passed = passed or orbit
        count = laps
    growing = (
        sizes[-1] > RUNAWAY * first
        or (resonant and _grows_evenly(sizes))
        or (len(sizes) > 3 and all(later > 1.5 * sooner for sooner, later in pairwise(sizes[1:])))
    )
    none = np.full(table.physical, np.nan, dtype=np.complex128)
    if growing:
        return passed or SteadyState("unbounded", math.nan, 0, lap(system, table, state, mode, 1), none), passed
    return SteadyState("not periodic", math.nan, 0, beats(system, table, state, mode, 1), none), passed


def _is_tonal(table: Table) -> bool:
    """Whether tones without a common period are all that moves what does not stay where it is."""
    motion = table.motion
    return (
        bool(motion.tones) and not math.isfinite(motion.period) and motion.knots is None and not motion.base.get("way")
    )


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
        if point is not state and all(table.modes[mode].friction is None for mode in orbit.modes):
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
