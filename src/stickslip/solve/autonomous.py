"""Orbits that repeat without a drive's period: Newton's method on state and period at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stickslip.solve.poincare import Table, closes, derivative, stretch
from stickslip.solve.simulate import opening
from stickslip.solve.tables import Array, System
from stickslip.solve.trajectory import Trajectory

ROUNDS = 16
RANK = 1e-9  # of the largest singular value: below it a direction is free
LOOKED = 96  # samples of a lag, of the shortest period looked for
MOST, ALIKE = 64, 1e-4  # turns of an orbit that may be alike, and how alike, relative to its spread
NEAR = 0.3  # of the spread: a state this close to an earlier one may repeat it


def settled_cycle(motion: Trajectory, shortest: float) -> tuple[Trajectory, NDArray[np.complex128]] | None:
    """The orbit that a motion ends in, closed to rounding, with its multipliers; None where it does not repeat.

    Of each orbit tried the period is first guessed from when the motion was last where it is now.
    """
    for begin, period in _returns(motion, shortest):
        physical = motion.table.physical
        state, _ = opening(motion.table, {})
        values, piece = motion.sample([begin], ("state",))
        state[:physical] = values[:, 0]
        found = closed(motion.system, motion.table, state, int(motion.modes[piece[0]]), period)
        if found is not None:
            return _shortest(*found)
    return None


def _shortest(orbit: Trajectory, multipliers: NDArray[np.complex128]) -> tuple[Trajectory, NDArray[np.complex128]]:
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


def closed(
    system: System, table: Table, state: Array, mode: int, period: float
) -> tuple[Trajectory, NDArray[np.complex128]] | None:
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


def _across(jacobian: Array) -> NDArray[np.complex128]:
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
    held = np.array(["stick" in kind or "landing" in kind for kind in kinds])
    free = np.flatnonzero(~held[motion.modes] & (motion.durations > 0))
    piece = int(free[-1]) if len(free) else len(motion.modes) - 1
    return float(motion.starts[piece] + motion.durations[piece] / 2)
