"""One block of a sweep: every motion of it run and measured, the same bytes wherever it is run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from stickslip.errors import ModelError, SolveError
from stickslip.maps.crowd import Watch, crowds, on_cpu, watched
from stickslip.maps.measures import FAILED, LOG, NO_SYSTEM, own_name
from stickslip.maps.plan import Arrays, Plan
from stickslip.maps.trajectory import logged, measured, outcome
from stickslip.solve.simulate import simulate
from stickslip.solve.trajectory import Event

KEPT = {"time": np.float64, "kind": np.str_, "mode": np.str_}  # of an event; the rest are whole numbers
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
    found: Arrays = {name: np.full(len(points), v.fill, v.dtype) for name, v in plan.variables.items()}
    left = set(range(len(points)))
    logs: list[list[Any]] = []
    for rows, systems, known in crowds(plan, number):
        values = known if systems is None else watched(plan, systems, known, watch)
        for name in found.keys() & values.keys():
            found[name][rows] = values[name]
        left -= set(rows.tolist())
    own = [measure for measure in plan.measures if callable(measure)]
    for row in range(len(points)) if own else sorted(left):
        steps = points[row]
        if row in left or found["status"][row] not in (NO_SYSTEM, FAILED):
            told: Mapping[str, Any]
            told = (alone or _alone)(plan, steps) if row in left else {own_name(m): m(_run(plan, steps)) for m in own}
            for name in found.keys() & told.keys():
                found[name][row] = told[name]
            logs += [[*steps, *event] for event in told.get("log", ())]
    arrays = {name: values.reshape(shape) for name, values in found.items()}
    return arrays, _columns(plan, logs) if LOG in plan.measures else None


def _columns(plan: Plan, logs: list[list[Any]]) -> Arrays:
    """The events of a block, column by column: which step along each dimension, and what an event is."""
    names = [*plan.dims, *Event._fields]
    return {name: np.array([row[j] for row in logs], KEPT.get(name, np.int64)) for j, name in enumerate(names)}


def _run(plan: Plan, steps: tuple[int, ...]) -> Any:
    system, start = plan.at(steps)
    return simulate(system, cycles=plan.settle + plan.cycles, start=start)


def _alone(plan: Plan, steps: tuple[int, ...]) -> Mapping[str, Any]:
    """One motion simulated, and its Trajectory measured."""
    try:
        run = _run(plan, steps)
    except ModelError:
        return {"status": NO_SYSTEM}
    except SolveError:
        return {"status": FAILED}
    try:
        told = {"status": outcome(run), **measured(run, plan, plan.at(steps)[1])}
    except SolveError:  # a measure's ModelError ends the sweep
        return {"status": FAILED}
    if LOG in plan.measures:
        log = logged(run, plan.settle)
        told |= {LOG: len(log), "log": log}
    return told
