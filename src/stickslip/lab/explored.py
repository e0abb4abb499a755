"""What a map asks of a system, part by part: a grid of its parameters, or one cell on finer and finer grids.

A sweep asks nobody whether to go on: the worker interrupts it where no one waits any more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.lab import drawn
from stickslip.lab.drawn import read_case
from stickslip.lab.forms import Answer, first_state

GoOn = Callable[[float], None]

SETTLE, CYCLES = 60, 12  # periods before and while it is measured
SHOWN = {
    "stops": ("normal_stops", "abnormal_stops"), "micro_slips": ("micro_slips",), "period": ("order",),
    "stick_share": ("stick_share",), "amplitude": ("amplitude",),
}  # fmt: skip
NO_SYSTEM, AT_REST = -1.0, -2.0  # in place of a value
MOST = 2000  # points of one part


def sweep(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """One value at each point of a grid of two parameters."""
    system, grid, options = _read(request)
    atlas = ss.sweep(system, grid, measures=[request["measure"]], **options)
    return _values(atlas, request["measure"])


def refine(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """The same between two values of each parameter, halved where the answer changes."""
    system, grid, options = _read(request)
    atlas = ss.maps.refine(system, grid, measure=request["measure"], halvings=int(request["halvings"]), **options)
    return _values(atlas, request["measure"])


def warm(request: Mapping[str, Any], go_on: GoOn) -> Answer:
    """Load what a first map needs, or compile it: the smallest one of what plays when the page opens."""
    state = first_state()
    drawn.run({"state": state}, go_on)
    kinetic = float(state["law"]["kinetic"])
    grid = {"drive.frequency": [2.5, 2.6], "law.kinetic": [kinetic, 1.1 * kinetic]}
    asked = {"state": state, "measure": "stops", "grid": grid, "halvings": 1}
    sweep(asked, go_on)
    return refine(asked, go_on)


ANSWERS: dict[str, Callable[[Mapping[str, Any], GoOn], Answer]] = {"sweep": sweep, "refine": refine, "warm": warm}


def _read(request: Mapping[str, Any]) -> tuple[Any, dict[str, list[float]], dict[str, Any]]:
    """System, grid and options, if a map can be made of them."""
    case = read_case(request["state"])
    grid = {str(name): [float(value) for value in values] for name, values in request["grid"].items()}
    if request["measure"] not in SHOWN:
        raise ss.errors.ModelError(f"a map of '{request['measure']}'", f"there are {', '.join(SHOWN)}", "choose one")
    size = int(np.prod([len(values) for values in grid.values()]))
    if len(grid) != 2 or not 0 < size <= MOST:
        raise ss.errors.ModelError(
            f"{size} points over {len(grid)} parameters", f"a part has two and up to {MOST}", "ask less"
        )
    return case.system, grid, {"cycles": CYCLES, "settle": SETTLE, "start": case.start, "engine": "serial"}


def _values(atlas: Any, measure: str) -> Answer:
    """Rows over the second parameter; nan where there is no answer, -1 where no such system, -2 where it rests."""
    values = sum(atlas[name].values.astype(float) for name in SHOWN[measure])
    status, meanings = atlas.status.values, atlas.status.attrs["flag_meanings"].split()
    for word, shown in (("no_such_system", NO_SYSTEM), ("at_rest", AT_REST)):
        values = np.where(status == meanings.index(word) + atlas.status.attrs["flag_values"][0], shown, values)
    return {"shape": list(values.shape)}, {"values": values.ravel()}
