"""The motion that repeats where no drive gives it a period: from stick to stick, or from turn to turn.

Its orbit is closed by Newton's method on state and period at once.

Also steady sliding on a belt under a curved law, and whether it lasts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.drives.kinds import Belt
from stickslip.errors import ModelError, SolveError
from stickslip.laws.curved import CurvedLaw
from stickslip.oscillator import Oscillator
from stickslip.solve.curved import CurvedTrajectory
from stickslip.solve.march import Dense
from stickslip.solve.poincare import SteadyState, Table, closes, derivative, stretch
from stickslip.solve.simulate import opening
from stickslip.solve.tables import System, require_oscillator
from stickslip.solve.tape import Tape
from stickslip.solve.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class SteadySliding:
    """A mass that slides steadily on a belt.

    Attributes
    ----------
    state : mapping of str to float
        x [m], v [m/s] (zero) and the law's memory.
    friction : float
        Friction force [N].
    eigenvalues : ndarray (N,)
        Of the motion near it [1/s], the fastest growing first; it lasts where all real parts are negative.
    status : str
        "stable" or "unstable".
    """

    state: Mapping[str, float]
    friction: float
    eigenvalues: Complex
    status: str


def steady_sliding(system: Oscillator) -> SteadySliding:
    """Does steady sliding on a belt last?

    The linear motion near it has the exact derivatives of the law's friction and rates.

    Parameters
    ----------
    system : Oscillator
        A mass with a curved law on a :class:`~stickslip.drives.kinds.Belt`.

    Returns
    -------
    SteadySliding

    Raises
    ------
    ModelError
        The system has no belt, no spring, or no curved law.
    SolveError
        The law's memory does not settle.

    Examples
    --------
    >>> from stickslip.laws.stribeck import Stribeck
    >>> law = Stribeck(1.0, 1.5, speed=0.1, exponent=1.0, viscous=0.2)
    >>> slider = Oscillator(mass=1, stiffness=1, law=law, drive=Belt(0.2), damping=0.3)
    >>> steady_sliding(slider).status, steady_sliding(slider.having(drive=Belt(0.3))).status
    ('unstable', 'stable')
    """
    require_oscillator(system, "steady sliding is asked")
    law, drive = system.law, system.drive
    if not (isinstance(law, CurvedLaw) and isinstance(drive, Belt) and system.stiffness > 0):
        raise ModelError(
            f"{type(law).__name__} on {type(drive).__name__}, {system.stiffness:g} N/m",
            "steady sliding needs a curved law, a belt and a spring",
            "give them (a polygon's slope is that of its piece)",
        )
    name = law.entry[0] if drive.speed > 0 else law.entry[2]
    mode = next(mode for mode in law.rates() if mode.name == name)
    assert mode.friction is not None
    memory = tuple(law.memory)
    at = {"x": 0.0, "v": -drive.speed, **_settled(law, mode.rates, -drive.speed)}
    friction = mode.friction.at(**at)
    names = ("x", "v", *memory)
    flow = np.zeros((len(names), len(names)))
    flow[0, 1] = 1.0
    flow[1] = [-mode.friction.slope(n).at(**at) / system.mass for n in names]
    flow[1, :2] -= [system.stiffness / system.mass, system.damping / system.mass]
    for j, own in enumerate(memory):
        flow[2 + j] = [mode.rates[own].slope(n).at(**at) for n in names]
    scale = np.array([1.0, abs(drive.speed), *(abs(at[own]) or 1.0 for own in memory)])
    values = np.linalg.eigvals(flow * scale / scale[:, None])
    values = values[np.argsort(-values.real, kind="stable")]
    state = {**at, "x": -friction / system.stiffness, "v": 0.0}
    return SteadySliding(state, friction, values, "stable" if values[0].real < 0 else "unstable")


def _settled(law: CurvedLaw, rates: Mapping[str, object], speed: float) -> dict[str, float]:
    """The memory that no longer moves at a steady speed: Newton's method, from several sizes of the opening memory."""
    memory = tuple(law.memory)
    opening = np.array([row.get("1", 0.0) for row in law.memory.values()])
    for decade in (0, *(s * d for d in range(1, 13) for s in (1, -1))):
        guess = opening * 10.0**decade
        for _ in range(100):
            at = {"x": 0.0, "v": speed, **dict(zip(memory, map(float, guess), strict=True))}
            try:
                value = np.array([rates[n].at(**at) for n in memory])  # type: ignore[attr-defined]
                slope = np.array([[rates[n].slope(o).at(**at) for o in memory] for n in memory])  # type: ignore[attr-defined]
                step = np.linalg.solve(slope, value) if memory else value
            except (ModelError, np.linalg.LinAlgError):
                break
            if np.all(np.abs(step) <= 1e-14 * np.abs(guess)):
                return dict(zip(memory, map(float, guess), strict=True))
            guess = guess - step
    raise SolveError(
        f"the memory {', '.join(memory)} does not settle at {speed:g} m/s",
        "steady sliding needs a memory that comes to rest",
        "simulate the sliding instead",
    )


TRANSIENTS = 16  # transients of a self-excited motion before no orbit is expected any more
ROUNDS = 16  # of Newton's method; one that comes no nearer is given up before
RANK = 1e-9  # of the largest singular value: below it a direction is free
LOOKED = 96  # samples of a lag, of the shortest period looked for
MOST, ALIKE = 64, 1e-4  # turns of an orbit that may be alike, and how alike, relative to its spread
SHORTEST = 0.2  # of the natural period: the shortest cycle looked for under a curved law
STEADY = 1e-6  # of the sliding speed: what moves by no more slides steadily
NEAR = 0.3  # of the spread: a state this close to an earlier one may repeat it


def self_excited(system: System, table: Table, start: Mapping[str, float | str], transient: int) -> SteadyState:
    """The orbit between two equal ends of a stick, or, without sticks, the one that closes."""
    if not table.motion.rates:
        raise SolveError("nothing drives the system", "only a driven motion repeats", "give a drive=")
    state, mode = opening(table, start)
    scale = 1 / system.frequency if system.frequency else 1.0
    if isinstance(table, Tape) and table.degrees == 1 and all(mode.friction is not None for mode in table.modes):
        return _between_turns(system, table, state, mode, transient * scale)
    # the way of the belt moves on, so the relative coordinate is compared, not the signals
    duration = transient * scale
    for _ in range(8):
        motion = stretch(system, table, state, mode, span=(0.0, duration))
        held = [table.modes[mode].friction is None for mode in motion.modes]
        ends = [j for j in range(1, len(motion.modes)) if held[j - 1] and motion.exits[j - 1] >= 0]
        if len(ends) > 2:
            first, last = ends[-2], ends[-1]
            own = slice(0, table.physical if isinstance(table, Tape) else 2 * table.degrees)
            gap = np.abs(motion.states[last, own] - motion.states[first, own])
            if np.all(gap <= 1e-9 * np.max(np.abs(motion.states[first : last + 1, own]), axis=0)):
                return _between(motion, first, last, _multipliers(motion, first, last))
        if not ends or motion.starts[ends[-1]] < duration / 2:
            orbit = _slid_on(motion) or _without_sticks(motion)
            if orbit is not None:
                return orbit
        duration *= 2
    none = np.full(table.physical, np.nan, dtype=np.complex128)
    steady = len(motion.modes) == 1 or motion.durations[-1] > 0.5 * duration
    status = "rest" if steady and table.modes[motion.modes[-1]].side == 0 else "not periodic"
    return SteadyState(status, math.nan, 0, motion, none)


def _slid_on(motion: Trajectory) -> SteadyState | None:
    """Steady sliding, where nothing else is left of a motion in its last natural period."""
    system, mode = motion.system, motion.table.modes[motion.modes[-1]]
    if not system.frequency or mode.side == 0 or motion.durations[-1] < 1 / system.frequency:
        return None
    times = motion.duration - np.linspace(1.0, 0.0, LOOKED) / system.frequency
    v, slip = motion.sample(times, ("v", "slip"))[0]
    if np.ptp(v) > STEADY * np.max(np.abs(slip)):
        return None
    lasting = stretch(system, motion.table, *motion.end(), span=(0.0, 1 / system.frequency))
    none = np.full(motion.table.physical, np.nan, dtype=np.complex128)
    return SteadyState("steady sliding", math.nan, 0, lasting, none)


def _without_sticks(motion: Trajectory) -> SteadyState | None:
    """The orbit that a motion ends in which does not stick; one of linear modes has events: nothing else bounds it."""
    curved, system = isinstance(motion, CurvedTrajectory), motion.system
    if curved and not system.frequency:
        return None
    shortest = SHORTEST / system.frequency if curved else 2 * math.pi * float(np.min(motion.table.cell))
    cycle = settled_cycle(motion, shortest)
    if cycle is None or (len(cycle[0].modes) == 1 and not curved):
        return None
    orbit, across = cycle
    multipliers = np.append(across, 0.0)  # along the orbit nothing grows: its phase is free
    return SteadyState("unique" if abs(across[0]) < 1 else "unstable", orbit.duration, 1, orbit, multipliers)


def _between_turns(system: System, table: Tape, state: Array, mode: int, duration: float) -> SteadyState:
    """The orbit of a law that never holds the mass, from one turn of the mass to the first that is alike."""
    physical = table.physical
    for _ in range(TRANSIENTS):
        motion = stretch(system, table, state, mode, span=(0.0, duration))
        assert isinstance(motion, CurvedTrajectory)
        turns = _turns(motion)
        if (steady := _slid_on(motion)) is not None:
            return steady
        if len(turns) < 2 or table.motion.base or table.motion.tones:
            break
        values, pieces = motion.sample(turns, ("state",))
        state, mode = state.copy(), int(motion.modes[pieces[-1]])
        state[:physical] = values[:, -1]
        sizes = np.max(np.abs(motion.steps.states[motion.steps.starts > turns[0], :physical]), axis=0)
        gaps = np.abs(values[:, :-1] - values[:, -1:])
        alike = np.flatnonzero(np.all(gaps <= 1e-9 * sizes[:, None], axis=0))
        if len(alike):
            period = turns[-1] - turns[alike[-1]]
            orbit = stretch(system, table, state, mode, span=(0.0, period))
            multipliers = _phase_free(orbit)
            return SteadyState("unique" if abs(multipliers[0]) < 1 else "unstable", period, 1, orbit, multipliers)
    none = np.full(physical, np.nan, dtype=np.complex128)
    return SteadyState("not periodic", math.nan, 0, motion, none)


def _turns(motion: CurvedTrajectory) -> list[float]:
    """The last instants at which the velocity rises through zero, in order."""
    from scipy.optimize import brentq

    v, ends = motion.steps.states[:, 1], motion.steps.starts
    rises = np.flatnonzero((v[:-1] < 0) & (v[1:] >= 0))[-MOST - 1 :]
    spans = [(ends[j], ends[j + 1]) for j in rises]
    return [float(brentq(lambda t: motion.sample([t], ("v",))[0][0, 0], *span, xtol=1e-15 * span[1])) for span in spans]


def _multipliers(motion: Trajectory, first: int, last: int) -> Complex:
    """Multipliers of the orbit from the end of a stick to the next, largest first."""
    table = motion.table
    if getattr(table, "degrees", 1) == 1:  # its stick ends in one state alone: whatever came before is forgotten
        return np.zeros(table.physical, dtype=np.complex128)
    begin = motion.starts[first] + motion.durations[first] / 2
    return _phase_free(_from(motion, begin, motion.starts[last] - motion.starts[first]))


def _phase_free(orbit: Trajectory) -> Complex:
    """All multipliers of a closed orbit, largest first; along it nothing grows, for its phase is free."""
    return np.append(_across(derivative(orbit, int(orbit.modes[0]))[0]), 0.0)


def _between(motion: Trajectory, first: int, last: int, multipliers: Complex) -> SteadyState:
    """The orbit from one piece to another where it begins anew."""
    part, begin, end = slice(first, last), motion.starts[first], motion.starts[last]
    own: dict[str, Any] = {}
    if isinstance(motion, CurvedTrajectory):
        steps = motion.steps
        inside = slice(*np.searchsorted(steps.starts, [begin, end]))
        columns = [column[inside] for column in steps[:-2]]
        own = {"steps": Dense._make([columns[0] - begin, *columns[1:], steps.polys, steps.reach])}
    orbit = replace(
        motion,
        laps=np.zeros(last - first, np.int32),
        offsets=motion.starts[part] - begin,
        modes=motion.modes[part],
        durations=motion.durations[part],
        kept=motion.states[part],
        exits=motion.exits[part],
        duration=float(end - begin),
        status="complete",
        **own,
    )
    return SteadyState("unique", orbit.duration, 1, orbit, multipliers)


def _from(motion: Trajectory, begin: float, duration: float) -> Trajectory:
    """The motion anew from an instant on, so long."""
    state, _ = opening(motion.table, {})
    values, piece = motion.sample([begin], ("state",))
    state[: motion.table.physical] = values[:, 0]
    return stretch(motion.system, motion.table, state, int(motion.modes[piece[0]]), span=(0.0, duration))


def settled_cycle(motion: Trajectory, shortest: float) -> tuple[Trajectory, Complex] | None:
    """The orbit that a motion ends in, closed to rounding, with its multipliers; None where it does not repeat.

    Of each orbit tried the period is first guessed from when the motion was last where it is now.
    """
    for begin, period in _returns(motion, shortest):
        physical = motion.table.physical
        state, _ = opening(motion.table, {})
        values, piece = motion.sample([begin], ("state",))
        state[:physical] = values[:, 0]
        orbit = closed(motion.system, motion.table, state, int(motion.modes[piece[0]]), period)
        if orbit is not None:
            return _shortest(*orbit)
    return None


def _shortest(orbit: Trajectory, multipliers: Complex) -> tuple[Trajectory, Complex]:
    """The part of an orbit that already repeats, where it is several times the same."""
    state, _ = opening(orbit.table, {})
    state[: orbit.table.physical] = orbit.states[0, : orbit.table.physical]
    spread = np.ptp(orbit.sample(np.linspace(0.0, orbit.duration * (1 - 1e-12), LOOKED), ("x", "v"))[0], axis=1)
    for parts in range(MOST, 1, -1):
        begin, end = orbit.sample([0.0, orbit.duration / parts], ("x", "v"))[0].T
        if np.all(np.abs(end - begin) < ALIKE * spread):
            part = closed(orbit.system, orbit.table, state, int(orbit.modes[0]), orbit.duration / parts)
            if part is not None:
                return _shortest(*part)
    return orbit, multipliers


def closed(system: System, table: Table, state: Array, mode: int, period: float) -> tuple[Trajectory, Complex] | None:
    """The orbit near a state and a period, with the multipliers across it, largest first; None where Newton finds none.

    Without a drive the phase is free: the correction is taken across the flow, and the multiplier along it is left out.
    The memory of a contact counts for nothing where it slides, and is not compared: begin where every contact does.
    """
    count = 2 * getattr(table, "degrees", 1)
    best = np.inf
    for _ in range(ROUNDS):
        orbit = stretch(system, table, state, mode, span=(0.0, period))
        end, after = orbit.end()
        path = orbit.sample(np.linspace(0.0, period, LOOKED) * (1 - 1e-12), ("x", "v"))[0]
        size, spread = np.max(np.abs(path), axis=1), np.ptp(path, axis=1)
        gap = (end - state)[:count]
        miss = float(np.max(np.abs(gap) / np.maximum(size, 1e-300), initial=0.0, where=size > 0))
        jacobian = derivative(orbit, after)[0][:count, :count]
        if closes(orbit, miss) and after == orbit.modes[0]:
            return orbit, _across(jacobian)
        if not miss < best or not np.all(spread > 0):
            return None
        best = 4 * miss if best == np.inf else miss
        flow = orbit.sample([period], ("v", "a"))[0][:, 0] * period / spread
        slope = (jacobian - np.eye(count)) * spread / spread[:, None]
        phase = np.eye(count)[int(np.argmax(np.abs(flow)))]
        matrix = np.block([[slope, flow[:, None]], [phase, np.zeros(1)]])
        step, *_ = np.linalg.lstsq(matrix, np.append(-gap / spread, 0.0), rcond=RANK)
        if np.any(np.abs(step[:-1]) * spread > 2 * size) or abs(step[-1]) > 0.3:
            return None
        state, mode = state.copy(), int(orbit.modes[0])
        state[:count] += step[:-1] * spread
        period *= 1 + step[-1]
    return None


def _across(jacobian: Array) -> Complex:
    """Multipliers without the one along the orbit, which is 1."""
    values = np.linalg.eigvals(jacobian).astype(np.complex128)
    values = np.delete(values, np.argmin(np.abs(values - 1)))
    return values[np.argsort(-np.abs(values))]


def _returns(motion: Trajectory, shortest: float) -> list[tuple[float, float]]:
    """Instants from which the motion may repeat, with the period: the shortest few first."""
    end = _sliding(motion)
    times = end - np.arange(min(8192, int(LOOKED * end / shortest * 0.8)))[::-1] * shortest / LOOKED
    path = motion.sample(times, ("x", "v"))[0]
    spread = np.ptp(path[:, -16 * LOOKED :], axis=1)
    if not np.all(spread > 0):
        return []
    apart = np.max(np.abs(path - path[:, -1:]) / spread[:, None], axis=0)[::-1]
    away = int(np.argmax(apart > NEAR))
    valley = (apart[1:-1] <= apart[:-2]) & (apart[1:-1] <= apart[2:]) & (apart[1:-1] < NEAR)
    lags = [j for j in np.flatnonzero(valley) + 1 if away and j > away][:4]
    return [(end - lag * shortest / LOOKED, lag * shortest / LOOKED) for lag in lags]


def _sliding(motion: Trajectory) -> float:
    """The last instant in the middle of a piece in which no contact holds."""
    kinds = [mode.kind for mode in motion.table.modes]
    stuck = np.array(["stick" in kind or "landing" in kind for kind in kinds])
    free = np.flatnonzero(~stuck[motion.modes] & (motion.durations > 0))
    piece = int(free[-1]) if len(free) else len(motion.modes) - 1
    return float(motion.starts[piece] + motion.durations[piece] / 2)
