"""One block of a sweep, the same bytes wherever it is run: tables made at once, marched and counted by the watch."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from stickslip.arrays import Array, Index
from stickslip.drives.kinds import Drive
from stickslip.errors import ModelError, SolveError
from stickslip.maps import measures as log
from stickslip.maps.grid import START
from stickslip.maps.measures import AT_REST, EVENTS, FAILED, LOG, MOVING, NO_SYSTEM, ORDERS, own_name
from stickslip.maps.plan import BLOCK, Arrays, Plan
from stickslip.maps.watch import (
    CONSTANT,
    CYCLES,
    LAP,
    MARK,
    ROOM,
    SETTLE,
    VARIES,
    Counted,
    Given,
    Look,
    Rooms,
    repeats,
    watch_all,
)
from stickslip.oscillator import Oscillator
from stickslip.parameters import changed, find
from stickslip.solve.assembly import tables_of
from stickslip.solve.glide import Model, Past, blank_pieces
from stickslip.solve.kernel import scratch
from stickslip.solve.phasors import phasors_of
from stickslip.solve.poincare import beat, derivative, lap, lyapunov, tables
from stickslip.solve.refusal import heed
from stickslip.solve.simulate import simulate
from stickslip.solve.tables import System, Systems, Tables, by_value, kind_of_drive, kind_of_law, opened, oscillators
from stickslip.solve.trajectory import Event, Trajectory

Watch = Callable[[Given, Counted, int, int], None]  # march what is given into what is left: its modes and entries
KINDS = {"stick": log.STICK, "microstick": log.MICROSTICK}
PARTS = ("law", "drive")
PATHS = {"micro_slips", "transition_speed", "energy"}  # measures of how far and how fast the contact slips
KEPT = {"time": np.float64, "kind": np.str_, "mode": np.str_}  # of an event; the rest are whole numbers
ORDER = 12  # Gauss points of a cell
SEEN = 8  # looks at a cell for a turn
AT_ONCE = 16_384  # periods, of one motion at least, between two looks at the keyboard: some 0.02 s
Alone = Callable[[Plan, tuple[int, ...]], Mapping[str, Any]]  # the measures of one point by itself


def crowds(plan: Plan, number: int) -> Iterator[tuple[Index, Systems | None, dict[str, Any]]]:
    """The systems of one kind in a block: which of its points, the systems, and the start by name.

    Points with no system come with the status of it and without systems; those that only a run on its own can tell
    of come not at all.
    """
    named = {f"{START}{name}" for name in plan.start} | {name for axis in plan.axes for name in axis.names}
    if not isinstance(plan.system, Oscillator) or f"{START}mode" in named or LOG in plan.measures:
        return
    tile = plan.slices(number)
    steps = np.moveaxis(np.mgrid[tile], 0, -1).reshape(-1, len(tile))
    (laws, law), (drives, drive), (owners, own) = (_different(plan, steps, part) for part in (*PARTS, ""))
    real = np.array([s is not None for s in laws])[law] & np.array([s is not None for s in drives])[drive]
    real &= np.array([s is not None for s in owners])[own]
    yield np.flatnonzero(~real), None, {"status": NO_SYSTEM}
    kinds = [s and kind_of_law(s.law) for s in laws], [s and _kind_of_drive(plan, s.drive) for s in drives]
    which = np.array([_numbers(kinds[0])[law], _numbers(kinds[1])[drive]])
    which[:, ~real] = -1
    pairs = np.unique(which[:, np.all(which >= 0, axis=0)], axis=1).T
    values = np.array([[s.mass, s.stiffness, s.damping, s.damper == "base"] if s else [0.0] * 4 for s in owners])
    for pair in pairs:
        rows = np.flatnonzero(np.all(which == pair[:, None], axis=0))
        used, its = np.unique(law[rows], return_inverse=True)
        moved, whose = np.unique(drive[rows], return_inverse=True)
        *numbers, base = values[own[rows]].T
        law_list, drive_list = [laws[j].law for j in used], [drives[j].drive for j in moved]
        systems = oscillators(law_list, its, drive_list, whose, numbers=np.array(numbers), on_base=base == 1.0)
        yield rows, systems, {**plan.start, **_starts(plan, steps[rows])}


def _kind_of_drive(plan: Plan, drive: Drive) -> Any:
    """The kind of a drive; None also where an exponent is asked of what it leaves to itself: all directions tell it,
    and the watch carries one."""
    heed()
    alone = "lyapunov" in plan.measures and not math.isfinite(drive.motion().period)
    return None if alone else kind_of_drive(drive)


def _numbers(kinds: Sequence[Any]) -> Index:
    """A number for each kind, the same for equal ones; -1 for none."""
    known = {kind: number for number, kind in enumerate(dict.fromkeys(kinds)) if kind is not None}
    return np.array([known.get(kind, -1) for kind in kinds], dtype=np.int64)


def _different(plan: Plan, steps: Index, part: str) -> tuple[list[Any], Index]:
    """The systems that differ in one part (the law, the drive, or the oscillator's own), and which each point has."""
    named = [[(j, name) for j, name in enumerate(axis.names) if not name.startswith(START)] for axis in plan.axes]
    own = [[j for j, name in names if _part(plan, name) == part] for names in named]
    columns = [number for number, names in enumerate(own) if names]
    shape = [plan.shape[number] for number in columns]
    keys, which = np.unique(_flat(steps[:, columns], shape), return_inverse=True)
    system: Any = plan.system
    distinct: list[Any] = []
    for key in np.stack(np.unravel_index(keys, shape), axis=-1) if shape else [()]:
        axes = [(plan.axes[number], own[number], step) for number, step in zip(columns, key, strict=True)]
        changes = tuple((axis.names[j], axis.values[step][j]) for axis, names, step in axes for j in names)
        heed()
        plain = by_value(system) and all(isinstance(value, int | float | str) for _, value in changes)
        distinct.append((_known if plain else _made)(system, changes))
    return distinct, which


def _flat(steps: Index, shape: Sequence[int]) -> Index:
    """One number for the steps along some axes."""
    return np.ravel_multi_index(tuple(steps.T), tuple(shape)) if shape else np.zeros(len(steps), np.int64)


def _made(system: Oscillator, changes: tuple[tuple[str, Any], ...]) -> Oscillator | None:
    """The system with other values; None where there is no such system."""
    try:
        return changed(system, dict(changes))
    except ModelError:
        return None


_known = lru_cache(maxsize=BLOCK)(_made)  # the blocks of a map share most of theirs


def _part(plan: Plan, name: str) -> str:
    place = find(plan.system, name)[0][0]
    return place if place in PARTS else ""


def _starts(plan: Plan, steps: Index) -> dict[str, Array]:
    return {
        name.removeprefix(START): np.array([row[j] for row in axis.values])[steps[:, number]]
        for number, axis in enumerate(plan.axes)
        for j, name in enumerate(axis.names)
        if name.startswith(START)
    }


def watched(plan: Plan, systems: Systems, start: Mapping[str, Any], watch: Watch) -> Arrays:
    """The measures of systems of one kind."""
    heed()
    table = tables_of(systems)
    named = {measure for measure in plan.measures if isinstance(measure, str)}
    states, modes = opened(table, start)
    count, physical = len(states), table.physical
    driven = bool(np.all(np.isfinite(table.period)))
    natural = np.sqrt(systems.stiffness / systems.mass)[:, 0, 0]
    with np.errstate(divide="ignore"):
        units = np.where(np.isfinite(table.period), table.period, 2 * np.pi / natural)
        rest = np.where(natural > 0, 1 / natural, table.period)
    tangents = named & {"multipliers", "lyapunov"}
    grown, turned = "lyapunov" in named, driven and "multipliers" in named
    rows = min(2 * ORDERS, plan.cycles) if driven and named & {"period", "multipliers"} else 0
    leaps = table.leap if tangents else np.zeros((count, 1, 1, 1, 1))
    weights = np.ones((count, physical))
    weights[:, 1] = rest
    wants = np.array([plan.settle, plan.cycles, grown, turned, physical, bool(named & PATHS)], dtype=np.int64)
    models = Model(table.linear, phasors_of(table), table.period)
    given = Given(states, modes, units, models, _look(table, named), wants, leaps, weights)
    out = Counted(
        np.full(count, FAILED, np.int64),
        np.zeros((count, log.ENTRIES)),
        np.zeros((count, rows, physical)),
        np.zeros(count),
        np.full((count, physical, physical), np.nan),
    )
    watch(given, out, states.shape[1], physical)
    answers = _answers(plan, out, units)
    lost = out.statuses == FAILED
    for name, values in answers.items():
        values[lost] = plan.variables[name].fill if name in plan.variables else 0
    return {"status": out.statuses, **answers}


def _look(table: Tables, named: set[str]) -> Look:
    """What the watch looks at."""
    fixed = np.arange(len(table.names)) != 0
    gap = np.eye(len(table.names))[0] - table.outputs["face"]  # of the mass from the counter-face
    still_face = not np.any(gap[:, fixed])
    inner, works, still = [], [], []
    for j, mode in enumerate(table.modes):
        rests = not np.any(table.flow[:, j, : table.physical])
        quantities = table.series[:, table.first[j] : table.first[j + 1], 0]
        stops = np.any(np.all(np.delete(quantities, 1, axis=2) == 0, axis=(0, 2))) and still_face
        constant = not np.any(np.delete(table.friction[:, j, 0], table.physical, axis=1))
        inner.append("amplitude" in named and not rests and not stops)
        works.append(0 if "energy" not in named or mode.friction is None else CONSTANT if constant else VARIES)
        still.append(rests)
    kinds = [KINDS.get(mode.kind, log.SLIP) for mode in table.modes]
    return Look(
        np.array(kinds, dtype=np.int64),
        np.array([float(mode.side) for mode in table.modes]),
        np.array(inner),
        np.array(works, dtype=np.int64),
        np.array(still),
        table.outputs["slip"],
        gap,
        np.ascontiguousarray(table.friction[:, :, 0]),
    )


def _answers(plan: Plan, out: Counted, units: Array) -> Arrays:
    """The variables from what was counted."""
    sums, sections, jacobians, cycles = out.sums, out.sections, out.jacobians, plan.cycles
    with np.errstate(invalid="ignore"):
        answers = {
            "normal_stops": sums[:, log.NORMAL] / cycles, "abnormal_stops": sums[:, log.ABNORMAL] / cycles,
            "stick_share": sums[:, log.HELD] / (units * cycles), "micro_slips": sums[:, log.SHORT] / cycles,
            "transition_speed": np.where(sums[:, log.FASTEST] > 0, sums[:, log.FASTEST], np.nan),
            "amplitude": sums[:, log.REACH], "energy": sums[:, log.WORK] / cycles,
            "lyapunov": out.growths / (units * cycles),
        }  # fmt: skip
    answers["order"] = np.zeros(len(sums))
    if sections.shape[1]:
        answers["order"][:] = [repeats(section) for section in sections]
    known = np.all(np.isfinite(jacobians), axis=(1, 2))
    answers["multiplier"] = np.full(len(known), complex(np.nan, np.nan))
    if np.any(known):
        values = np.linalg.eigvals(jacobians[known])
        best = np.argmax(np.abs(values), axis=1)
        answers["multiplier"][known] = np.take_along_axis(values, best[:, None], axis=1)[:, 0]
    return answers


def on_cpu(given: Given, out: Counted, size: int, physical: int) -> None:
    """One motion after another, in one scratch."""
    room, count = rooms(1, size, physical), len(given.states)
    few = max(1, AT_ONCE // int(given.wants[SETTLE] + given.wants[CYCLES]))
    for first in range(0, count, few):
        heed()
        watch_all(given, out, room, first, min(first + few, count))


def rooms(count: int, size: int, physical: int) -> Rooms:
    """Room for what so many motions need while they are marched."""
    return Rooms(
        np.zeros((count, *scratch(size, 17).shape)),
        pasts(count),
        blank_pieces((count, ROOM), size),
        np.zeros((count, physical, size)),
        np.zeros((count, 4, max(size + MARK + 1, log.ENTRIES))),
    )


def pasts(count: int) -> Past:
    """The rings of motions before their first pieces."""
    none = np.full((2, count, LAP), -1, np.int64)
    return Past(
        none[0], none[1], np.zeros((count, LAP)), np.ones((count, LAP), np.int64), np.zeros((count, 3), np.int64)
    )


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
        heed()
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
    if "lyapunov" in measures and math.isfinite(beat(run.system, run.table)):
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
