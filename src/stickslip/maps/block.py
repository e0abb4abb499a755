"""One block of a sweep: every motion of it run and measured, the same bytes wherever it is run.

The measures of a Trajectory are the slow way, for any law, and the truth of the compiled one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from stickslip.errors import ModelError, SolveError
from stickslip.maps import measures as log
from stickslip.maps.crowd import Watch, crowds, on_cpu, watched
from stickslip.maps.measures import AT_REST, EVENTS, FAILED, LOG, MOVING, NO_SYSTEM, ORDERS, own_name
from stickslip.maps.plan import Arrays, Plan
from stickslip.maps.watch import repeats
from stickslip.solve.poincare import derivative, lap, lyapunov, tables
from stickslip.solve.simulate import simulate
from stickslip.solve.tables import Array, System, Tables
from stickslip.solve.trajectory import Event, Trajectory

KEPT = {"time": np.float64, "kind": np.str_, "mode": np.str_}  # of an event; the rest are whole numbers
ORDER = 12  # Gauss points of a cell
SEEN = 8  # looks at a cell for a turn
KINDS = {"stick": log.STICK, "microstick": log.MICROSTICK}
Alone = Callable[[Plan, tuple[int, ...]], Mapping[str, Any]]  # the measures of one point by itself


def run_block(
    plan: Plan, number: int, watch: Watch = on_cpu, *, alone: Alone | None = None
) -> tuple[Arrays, Arrays | None]:
    """The answers of one block, by the names of the plan's variables, and its events where they are asked for.

    Oscillators under laws of linear modes and simple drives are marched together and counted as they go; any other
    system is simulated, and its Trajectory measured. Both give the same answers; a test holds them together.
    """
    shape = tuple(part.stop - part.start for part in plan.slices(number))
    points = plan.points(number)
    columns: Arrays = {name: np.full(len(points), v.fill, v.dtype) for name, v in plan.variables.items()}
    left = set(range(len(points)))
    logs: list[list[Any]] = []
    for rows, systems, known in crowds(plan, number):
        values = known if systems is None else watched(plan, systems, known, watch)
        for name in columns.keys() & values.keys():
            columns[name][rows] = values[name]
        left -= set(rows.tolist())
    own = [measure for measure in plan.measures if callable(measure)]
    for row in range(len(points)) if own else sorted(left):
        steps = points[row]
        if row in left or columns["status"][row] not in (NO_SYSTEM, FAILED):
            answers = (alone or _alone)(plan, steps) if row in left else _owns(plan, steps, own)
            for name in columns.keys() & answers.keys():
                columns[name][row] = answers[name]
            logs += [[*steps, *event] for event in answers.get("log", ())]
    arrays = {name: values.reshape(shape) for name, values in columns.items()}
    return arrays, _columns(plan, logs) if LOG in plan.measures else None


def _columns(plan: Plan, logs: list[list[Any]]) -> Arrays:
    """The events of a block, column by column: which step along each dimension, and what an event is."""
    names = [*plan.dims, *Event._fields]
    return {name: np.array([row[j] for row in logs], KEPT.get(name, np.int64)) for j, name in enumerate(names)}


def _run(plan: Plan, steps: tuple[int, ...]) -> Any:
    system, start = plan.at(steps)
    return simulate(system, cycles=plan.settle + plan.cycles, start=start)


def _owns(plan: Plan, steps: tuple[int, ...], own: Sequence[Callable[..., float]]) -> Mapping[str, Any]:
    """A user's measures of a motion that was marched with others; where it fails by itself nothing of it is known."""
    try:
        return {own_name(measure): measure(_run(plan, steps)) for measure in own}
    except SolveError:
        return {name: variable.fill for name, variable in plan.variables.items()} | {"status": FAILED}


def _alone(plan: Plan, steps: tuple[int, ...]) -> Mapping[str, Any]:
    """One motion simulated, and its Trajectory measured."""
    try:
        run = _run(plan, steps)
    except ModelError:
        return {"status": NO_SYSTEM}
    except SolveError:
        return {"status": FAILED}
    try:
        answers = {"status": outcome(run), **measured(run, plan, plan.at(steps)[1])}
    except SolveError:  # a measure's ModelError ends the sweep
        return {"status": FAILED}
    if LOG in plan.measures:
        log = logged(run, plan.settle)
        answers |= {LOG: len(log), "log": log}
    return answers


def measured(run: Trajectory, plan: Plan, start: Mapping[str, float | str]) -> dict[str, Any]:
    """The variables of a plan's measures, of what the run does after the periods in which it settles."""
    measures, settle, cycles = plan.measures, plan.settle, plan.cycles
    begin = settle * period(run.system, run)
    values: dict[str, Any] = {}
    if set(measures) & EVENTS:
        sums = counted(run, begin)
        values |= {
            "normal_stops": sums[log.NORMAL] / cycles,
            "abnormal_stops": sums[log.ABNORMAL] / cycles,
            "stick_share": sums[log.HELD] / (run.duration - begin),
            "micro_slips": sums[log.SHORT] / cycles,
            "transition_speed": sums[log.FASTEST] if sums[log.FASTEST] > 0 else math.nan,
        }
    if "amplitude" in measures:
        values["amplitude"] = farthest(run, begin)
    if "energy" in measures:
        values["energy"] = work(run, begin) / cycles
    if "period" in measures:
        values["order"] = order(run, settle)
    if "multipliers" in measures:
        values["multiplier"] = multiplier(run, settle)
    if "lyapunov" in measures and math.isfinite(run.table.motion.period):
        values["lyapunov"] = lyapunov(run.system, cycles=cycles, transient=settle, start=start).value
    return values | {own_name(measure): measure(run) for measure in measures if callable(measure)}


def period(system: System, run: Trajectory) -> float:
    """The drive's period [s]; without one, the natural period."""
    driven = run.table.motion.period
    return driven if math.isfinite(driven) else 1 / system.frequency


def counted(run: Trajectory, begin: float) -> Array:
    """The event log counted from a time on."""
    modes = run.table.modes
    parts = [getattr(mode, "parts", (mode,))[0] for mode in modes]
    kinds = np.array([KINDS.get(part.kind, log.SLIP) for part in parts])
    sides = np.array([part.side for part in parts], dtype=np.float64)
    slip = run.sample(run.starts, ("slip",))[0][0]
    sums = np.zeros(log.ENTRIES)
    log.tally(kinds, sides, run.modes, run.starts - begin, run.durations, _paths(run), np.abs(slip), sums)
    return sums


def logged(run: Trajectory, settle: int) -> list[Event]:
    """Every event after the periods in which the motion settles."""
    begin = settle * period(run.system, run)
    return [event for event in run.each_event() if event.time >= begin]


def farthest(run: Trajectory, begin: float) -> float:
    """Largest displacement from zero after a time, of any degree of freedom [m]."""
    starts, widths = _cells(run, begin)
    inner = np.linspace(0.0, 1.0, SEEN, endpoint=False)
    times = np.append((starts[:, None] + widths[:, None] * inner).ravel(), run.duration)
    (x, v, _), count = _moved(run, times)
    best = float(np.max(np.abs(x)))
    for degree in range(count):
        turns = np.flatnonzero(v[degree, :-1] * v[degree, 1:] < 0)
        if not len(turns):
            continue
        low, high = times[turns], times[turns + 1]
        near = low + (high - low) * v[degree, turns] / (v[degree, turns] - v[degree, turns + 1])
        for _ in range(4):
            (x, slope, rate), _ = _moved(run, near)
            best = max(best, float(np.max(np.abs(x[degree]))))
            step = np.divide(slope[degree], rate[degree], out=np.zeros_like(near), where=rate[degree] != 0)
            near = np.clip(near - step, low, high)
    return best


def _moved(run: Trajectory, times: Array) -> tuple[Array, int]:
    values, _ = run.sample(times, ("x", "v", "a"))
    return values.reshape(3, -1, len(times)), len(values) // 3


def _paths(run: Trajectory) -> Array:
    """How far the contact slips in each piece [m]."""
    starts, widths = run.cells
    (slip,), weights = _on_cells(run, starts, widths, ("slip",))
    piece = np.searchsorted(run.starts, starts + widths / 2, side="right") - 1
    return np.abs(np.bincount(piece, np.sum((slip * weights).reshape(-1, ORDER), axis=1), len(run.starts)))


def work(run: Trajectory, begin: float) -> float:
    """Work that friction takes from the motion after a time [J]."""
    values, weights = _on_cells(run, *_cells(run, begin), ("friction", "slip"))
    force, slip = np.split(values, 2)
    return float(np.sum(np.sum(force * slip, axis=0) * weights))


def _on_cells(run: Trajectory, starts: Array, widths: Array, outputs: tuple[str, ...]) -> tuple[Array, Array]:
    """Outputs at the Gauss points of cells, and what each point weighs [s]."""
    nodes, weights = np.polynomial.legendre.leggauss(ORDER)
    times = np.minimum(starts[:, None] + widths[:, None] * (nodes + 1) / 2, run.duration)
    return run.sample(times.ravel(), outputs)[0], (widths[:, None] * weights / 2).ravel()


def _cells(run: Trajectory, begin: float) -> tuple[Array, Array]:
    """Start and length of the stretches after a time on which the motion is one short polynomial."""
    starts, widths = run.cells
    ends = starts + widths
    late = ends > begin
    starts = np.maximum(starts[late], begin)
    return starts, ends[late] - starts


def order(run: Trajectory, settle: int) -> int:
    """Periods of the drive after which the motion repeats; 0 where it does not up to 8."""
    if not math.isfinite(run.table.motion.period):
        return 0
    return int(repeats(run.section()[settle + 1 :][-2 * ORDERS :]))


def outcome(run: Trajectory) -> int:
    """Whether the run still moves at its end: not where it is held through a whole period of the drive, or for good."""
    table, mode = run.table, int(run.modes[-1])
    still = not np.any(table.flow[mode][: table.physical]) if isinstance(table, Tables) else False
    resting = still and math.isfinite(table.motion.period) and run.durations[-1] >= (1 - 1e-9) * table.motion.period
    return AT_REST if resting or run.status == "at rest" else MOVING


def multiplier(run: Trajectory, settle: int) -> complex:
    """The largest Floquet multiplier of the orbit at the end; nan where none repeats."""
    steps = order(run, settle)
    if not steps:
        return complex(math.nan, math.nan)
    table = tables(run.system)
    end = run.states[0].copy()
    end[: table.physical] = run.section()[-1]
    orbit = lap(run.system, table, end, int(run.modes[-1]), steps)
    eigenvalues = np.linalg.eigvals(derivative(orbit, orbit.end()[1])[0])
    return complex(eigenvalues[np.argmax(np.abs(eigenvalues))])
