"""The motion that repeats where no drive gives it a period: from stick to stick, or from turn to turn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.errors import SolveError
from stickslip.solve.autonomous import settled_cycle
from stickslip.solve.curved import CurvedTrajectory
from stickslip.solve.orbit import SteadyState
from stickslip.solve.poincare import Table, derivative, stretch
from stickslip.solve.simulate import opening
from stickslip.solve.tables import Array, System
from stickslip.solve.tape import Tape
from stickslip.solve.trajectory import Trajectory

ROUNDS = 16  # transients of a self-excited motion before no orbit is expected any more


def self_excited(system: System, table: Table, start: Mapping[str, float | str], transient: int) -> SteadyState:
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
