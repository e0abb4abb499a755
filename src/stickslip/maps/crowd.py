"""Many motions of a block together: their tables made at once, marched and counted by the compiled watch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.maps import measures as log
from stickslip.maps.grid import START
from stickslip.maps.measures import FAILED, LOG, NO_SYSTEM, ORDERS
from stickslip.maps.plan import BLOCK, Arrays, Plan
from stickslip.maps.watch import CONSTANT, LAP, MARK, ROOM, VARIES, Counted, Given, Look, Rooms, repeats, watch_all
from stickslip.oscillator import Oscillator
from stickslip.parameters import changed, find
from stickslip.solve.assembly import tables_of
from stickslip.solve.glide import Model, Past, blank_pieces
from stickslip.solve.kernel import scratch
from stickslip.solve.phasors import phasors_of
from stickslip.solve.tables import Array, Systems, Tables, by_value, kind_of_drive, kind_of_law, opened, oscillators

Index = NDArray[np.int64]
Watch = Callable[[Given, Counted, int, int], None]  # march what is given into what is left; modes and physical entries
KINDS = {"stick": log.STICK, "microstick": log.MICROSTICK}
PARTS = ("law", "drive")
PATHS = {"micro_slips", "transition_speed", "energy"}  # measures of how far and how fast the contact slips


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
    kinds = [s and kind_of_law(s.law) for s in laws], [s and kind_of_drive(s.drive) for s in drives]
    which = np.array([_numbers(kinds[0])[law], _numbers(kinds[1])[drive]])
    which[:, ~real] = -1
    pairs = np.unique(which[:, np.all(which >= 0, axis=0)], axis=1).T
    values = np.array([[s.mass, s.stiffness, s.damping, s.damper == "base"] if s else [0.0] * 4 for s in owners])
    for pair in pairs:
        rows = np.flatnonzero(np.all(which == pair[:, None], axis=0))
        used, its = np.unique(law[rows], return_inverse=True)
        moved, whose = np.unique(drive[rows], return_inverse=True)
        *numbers, base = values[own[rows]].T
        systems = oscillators(
            [laws[j].law for j in used],
            its,
            [drives[j].drive for j in moved],
            whose,
            numbers=np.array(numbers),
            on_base=base == 1.0,
        )
        yield rows, systems, {**plan.start, **_starts(plan, steps[rows])}


def _numbers(kinds: Sequence[Any]) -> Index:
    """A number for each kind, the same for equal ones; -1 for none."""
    known = {kind: number for number, kind in enumerate(dict.fromkeys(kinds)) if kind is not None}
    return np.array([known.get(kind, -1) for kind in kinds], dtype=np.int64)


def _different(plan: Plan, steps: Index, part: str) -> tuple[list[Any], Index]:
    """The systems that differ in one part (the law, the drive, or the oscillator's own), and which each point has."""
    own = [
        [j for j, name in enumerate(axis.names) if not name.startswith(START) and _part(plan, name) == part]
        for axis in plan.axes
    ]
    columns = [number for number, names in enumerate(own) if names]
    shape = [plan.shape[number] for number in columns]
    keys, which = np.unique(_flat(steps[:, columns], shape), return_inverse=True)
    system: Any = plan.system
    distinct: list[Any] = []
    for key in np.stack(np.unravel_index(keys, shape), axis=-1) if shape else [()]:
        axes = [(plan.axes[number], own[number], step) for number, step in zip(columns, key, strict=True)]
        changes = tuple((axis.names[j], axis.values[step][j]) for axis, names, step in axes for j in names)
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
    grown, turned = driven and "lyapunov" in named, driven and "multipliers" in named
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
    answers = _answers(plan, out, units, table.period)
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


def _answers(plan: Plan, out: Counted, units: Array, period: Array) -> Arrays:
    """The variables from what was counted."""
    sums, sections, jacobians, cycles = out.sums, out.sections, out.jacobians, plan.cycles
    with np.errstate(invalid="ignore"):
        answers = {
            "normal_stops": sums[:, log.NORMAL] / cycles, "abnormal_stops": sums[:, log.ABNORMAL] / cycles,
            "stick_share": sums[:, log.HELD] / (units * cycles), "micro_slips": sums[:, log.SHORT] / cycles,
            "transition_speed": np.where(sums[:, log.FASTEST] > 0, sums[:, log.FASTEST], np.nan),
            "amplitude": sums[:, log.REACH], "energy": sums[:, log.WORK] / cycles,
            "lyapunov": np.where(np.isfinite(period), out.growths / (units * cycles), np.nan),
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
    watch_all(given, out, rooms(1, size, physical))


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
