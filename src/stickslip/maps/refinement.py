"""A map that is fine where the answer changes and coarse where it does not: borders with far fewer runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.maps.grid import START, read_grid, unit
from stickslip.maps.measures import COUNTS, FAILED, NO_SYSTEM, STATUS, variables
from stickslip.maps.plan import required
from stickslip.maps.sweep import NoSystem, require_memory, sweep
from stickslip.solve.tables import System


def refine(
    system: System,
    grid: Mapping[str, Sequence[float]],
    *,
    measure: str = "stops",
    halvings: int = 4,
    cycles: int = 50,
    settle: int = 200,
    start: Mapping[str, float | str] | None = None,
    engine: str = "threads",
) -> Any:
    """Where does the answer change, to a set precision?

    The grid is run, then halved again and again, but only between neighbours whose answers differ: a border over two
    parameters takes a number of runs that grows with its length, not with the area. An island smaller than the first
    grid can be missed.

    Parameters
    ----------
    system : Oscillator or Structure
        What moves.
    grid : mapping
        Numbers by parameter, the first and coarsest grid, two at least along each.
    measure : str
        A measure of :func:`sweep` that counts ("stops", "micro_slips", "period", "events"): two points differ where
        the rounded number or the status does.
    halvings : int
        How often each interval is halved: a border is known to that part of it.
    cycles, settle, start, engine
        As in :func:`sweep`.

    Returns
    -------
    xarray.Dataset
        The variables of the measure on the finest grid, what lies between equal neighbours filled in from them, with
        ``run``: whether a point was run; between two runs that failed nothing is filled in. Where the user interrupts
        (Ctrl-C), what is known until then, with the status "interrupted" and the points that are not known marked as
        not run.

    Raises
    ------
    ModelError
        An axis has fewer than two numbers, the measure counts nothing, `halvings` is none, or the finest grid fits no
        memory.

    Examples
    --------
    >>> from stickslip import scenarios
    >>> slider = scenarios.forced(0.8, 0.5)
    >>> found = refine(slider, {"kinetic": [0.5, 0.7, 0.9]}, halvings=6, settle=60, cycles=10)
    >>> border = found.kinetic[found.normal_stops > 0][0]  # Den Hartog: 0.8174
    >>> bool(0.8174 <= border <= 0.8174 + 0.2 / 2**6), int(found.run.sum()), found.run.size
    (True, 9, 129)
    """
    _require_borders(system, grid, measure, halvings)
    step, kept = 2**halvings, variables((measure,))
    shape = tuple((len(column) - 1) * step + 1 for column in grid.values())
    require_memory(math.prod(shape), kept)
    values = [_finer(np.asarray(column, dtype=np.float64), step) for column in grid.values()]
    arrays = {name: np.full(shape, variable.fill, variable.dtype) for name, variable in kept.items()}
    run, wanted = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    wanted[tuple(slice(None, None, step) for _ in shape)] = True
    whole = True
    last: Any = None  # the answers of the last level
    while True:
        for name, variable in kept.items():
            arrays[name][wanted] = variable.fill
        places = np.argwhere(wanted)
        points = [dict(zip(grid, (v[j] for v, j in zip(values, p, strict=True)), strict=True)) for p in places]
        try:
            if points:
                last = sweep(
                    system, points, measures=[measure], cycles=cycles, settle=settle, start=start, engine=engine
                )
                for name, array in arrays.items():
                    array[tuple(places.T)] = last[name].values
                run |= wanted & (arrays["status"] != STATUS.fill)
                whole = last.attrs["status"] == "complete"
        except NoSystem:  # of the points beside a border of what is a system
            if last is None:
                raise
            arrays["status"][wanted] = NO_SYSTEM
            run |= wanted
        except KeyboardInterrupt:  # before a block of this level was done
            if last is None:
                raise
            whole = False
        if step == 1 or not whole:
            break
        step //= 2
        wanted = _halved(arrays, step)
    unknown = (arrays["status"] == FAILED) & ~run  # between two runs that failed: that tells of no third
    for name, variable in kept.items():
        arrays[name][unknown] = variable.fill
    known = {name: (name, column, {"units": unit(system, name)}) for name, column in zip(grid, values, strict=True)}
    data = {name: (tuple(grid), array, last[name].attrs) for name, array in arrays.items()}
    attributes = {**last.attrs, "status": "complete" if whole else f"interrupted: {run.sum()} points were run"}
    return required("xarray").Dataset({**data, "run": (tuple(grid), run)}, coords=known, attrs=attributes)


def _require_borders(system: System, grid: Mapping[str, Sequence[float]], measure: str, halvings: int) -> None:
    """Refuse what has no borders, or none that halving finds."""
    if not (isinstance(halvings, int | np.integer) and 1 <= halvings <= 20):
        raise ModelError(f"halvings = {halvings}", "an interval is halved 1 to 20 times", "correct it")
    if measure not in COUNTS:
        raise ModelError(
            f"measure = '{measure}'",
            f"borders are of what counts: {', '.join(COUNTS)}",
            "choose one of them, or sweep() the whole grid",
        )
    for axis in read_grid(system, grid):
        if len(axis.names) != 1 or len(axis.values) < 2 or f"{START}mode" in axis.names:
            raise ModelError(
                f"{axis.dim} has {len(axis.values)} values",
                "between two there is something to halve",
                "give two numbers at least along each parameter",
            )


def _finer(column: NDArray[np.float64], step: int) -> NDArray[np.float64]:
    """Each interval cut into `step` equal parts."""
    places = np.arange((len(column) - 1) * step + 1) / step
    return np.interp(places, np.arange(len(column)), column)


def _halved(arrays: dict[str, NDArray[Any]], step: int) -> NDArray[np.bool_]:
    """The points between those known that lie between different neighbours; the others are filled in, axis by axis."""
    first = next(iter(arrays.values()))
    wanted = np.zeros(first.shape, dtype=bool)
    for axis in range(first.ndim):
        # along this axis every second point of the new spacing is new; those before it have the new spacing already
        place = [slice(None, None, step if a <= axis else 2 * step) for a in range(first.ndim)]
        new, low, high = list(place), list(place), list(place)
        new[axis] = slice(step, None, 2 * step)
        low[axis], high[axis] = slice(None, -1, 2 * step), slice(2 * step, None, 2 * step)
        unlike = wanted[tuple(low)] | wanted[tuple(high)]
        for array in arrays.values():
            below, above = np.round(array[tuple(low)].real), np.round(array[tuple(high)].real)
            unlike |= (below != above) & ~(np.isnan(below) & np.isnan(above))
            array[tuple(new)] = array[tuple(low)]
        wanted[tuple(new)] = unlike
    return wanted
