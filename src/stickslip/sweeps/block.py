"""One block of a sweep: every motion of it run and measured, the same bytes wherever it is run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from stickslip.errors import ModelError, SolveError
from stickslip.solve.simulate import simulate
from stickslip.sweeps.measures import AT_REST, CROWDED, MOVING, NO_SYSTEM
from stickslip.sweeps.plan import Arrays, Plan
from stickslip.sweeps.trajectory import measured


def run_block(plan: Plan, number: int) -> tuple[Arrays, Arrays | None]:
    """The answers of one block, by the names of the plan's variables, and its events where they are asked for."""
    shape = tuple(part.stop - part.start for part in plan.slices(number))
    points = plan.points(number)
    found: Arrays = {name: np.full(len(points), v.fill, v.dtype) for name, v in plan.variables.items()}
    for row, steps in enumerate(points):
        values = _point(plan, steps)
        for name in found.keys() & values.keys():
            found[name][row] = values[name]
    return {name: values.reshape(shape) for name, values in found.items()}, None


def _point(plan: Plan, steps: tuple[int, ...]) -> Mapping[str, Any]:
    try:
        system, start = plan.at(steps)
        run = simulate(system, cycles=plan.settle + plan.cycles, start=start)
    except ModelError:
        return {"status": NO_SYSTEM}
    except SolveError:
        return {"status": CROWDED}
    return {
        "status": AT_REST if run.status == "at rest" else MOVING,
        **measured(run, plan, start),
    }
