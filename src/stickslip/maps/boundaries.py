"""Where one kind of motion ends and another begins, to a set precision.

A map that is fine where the answer changes and coarse where it does not: borders with far fewer runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.arrays import Array, Mask
from stickslip.errors import ModelError, SolveError
from stickslip.maps.basins import Attractor, Start, numbers, require_number, require_period, settled
from stickslip.maps.grid import START, read_grid, unit
from stickslip.maps.measures import COUNTS, FAILED, NO_SYSTEM, STATUS, Variable, variables
from stickslip.maps.plan import required
from stickslip.maps.sweep import NoSystem, require_memory, sweep
from stickslip.parameters import find
from stickslip.record.metadata import labelled_arrays
from stickslip.solve.tables import System

if TYPE_CHECKING:
    import xarray as xr

Kind = Callable[[Attractor], object]


def sticking(attractor: Attractor) -> str:
    """Whether a contact ever holds."""
    modes = attractor.orbit.orbit.table.modes
    stops = any(modes[m].friction is None or modes[m].side == 0 for m in attractor.orbit.orbit.modes)
    return "stops" if stops else "no stops"


KINDS: dict[str, Kind] = {
    "sticking": sticking,
    "regime": lambda attractor: attractor.regime,
    "period": lambda attractor: attractor.orbit.order,
    "held": lambda attractor: "held" if attractor.status == "rest" else "moves",
}


@dataclass(frozen=True, eq=False)
class Boundary:
    """Where one kind of motion ends and another begins.

    Attributes
    ----------
    parameter : str
        What was bisected.
    along : str
        What it was followed along; "" where at one place.
    places : ndarray (n,)
        Values of `along`; NaN at one place.
    values : ndarray (n,)
        The parameter on the boundary; NaN where none lies in the range.
    errors : ndarray (n,)
        How far off each may be.
    low, high : tuple of Attractor
        The motions on either side, a hair's breadth below and above; None where there is no boundary.
    kinds : tuple of tuple
        What they are, as the chosen question answers.
    """

    parameter: str
    along: str
    places: Array
    values: Array
    errors: Array
    low: tuple[Attractor | None, ...]
    high: tuple[Attractor | None, ...]
    kinds: tuple[tuple[object, object], ...]

    @property
    def value(self) -> float:
        """The parameter on the boundary, at the first place."""
        return float(self.values[0])

    @property
    def multipliers(self) -> Array:
        """Largest modulus of the orbit's multipliers on either side (n, 2): below 1 it is stable."""
        return np.array(
            [
                [math.nan if motion is None else float(np.max(np.abs(motion.orbit.multipliers))) for motion in pair]
                for pair in zip(self.low, self.high, strict=True)
            ]
        )

    @property
    def data(self) -> xr.Dataset:
        """The curve as an xarray.Dataset."""
        xarray = labelled_arrays("boundaries")
        along = self.along or "place"
        result: xr.Dataset = xarray.Dataset(
            {
                self.parameter: (along, self.values),
                "error": (along, self.errors),
                "multiplier": ((along, "side"), self.multipliers),
                "kind": ((along, "side"), np.array([[str(kind) for kind in pair] for pair in self.kinds])),
            },
            coords={along: self.places, "side": ["low", "high"]},
        )
        return result

    def __repr__(self) -> str:
        known = np.isfinite(self.values)
        if not self.along:
            kinds = " | ".join(map(str, self.kinds[0]))
            return f"Boundary({self.parameter} = {self.value:.10g} +- {self.errors[0]:.1g}: {kinds})"
        return f"Boundary({self.parameter} over {self.along}, found at {known.sum()} of {len(known)} places)"


def boundary(
    system: System,
    parameter: str,
    *,
    between: tuple[float, float],
    along: Mapping[str, ArrayLike] | None = None,
    kind: str | Kind = "sticking",
    start: Start | None = None,
    precision: float = 1e-9,
    transient: int = 64,
) -> Boundary:
    """At which value of a parameter does the motion begin to stick, or change its kind in another way?

    The steady motion is exact, and so are its stops, the shortest too: bisection of the range finds the boundary to the
    precision asked for. Each motion begins at the same start, so that of two attractors the same one is asked. Without
    viscous damping and with equal static friction the boundary of sliding without stops under a harmonic force is Den
    Hartog's, :math:`r_b = V / \\sqrt{S^2 + U^2}`, with :math:`V = 1/(1-b^2)`, :math:`U = \\tan(\\pi/2b)/b` and S the
    largest of q(t)/p(t) (Den Hartog 1931; Shaw 1986).

    Parameters
    ----------
    system : Oscillator or Structure
        What moves, with a periodic drive.
    parameter : str
        What is bisected, a name that ``having`` takes.
    between : tuple of float
        Range in which the boundary lies.
    along : mapping, optional
        One other parameter with its values: the boundary as a curve.
    kind : str or callable
        What differs on either side: "sticking" (stops or none), "regime" (stops per period, period), "period", "held",
        or a function of an :class:`Attractor`.
    start : mapping, optional
        Where motions begin, as in ``simulate``.
    precision : float
        Width left of the range, relative to the value.
    transient : int
        As in ``steady_state``.

    Returns
    -------
    Boundary

    Raises
    ------
    ModelError
        A parameter or its values have no meaning, or the drive does not repeat.
    SolveError
        Both ends of the range are of one kind, at every place.

    Examples
    --------
    >>> from stickslip.scenarios import forced
    >>> border = boundary(forced(0.8, 0.5), "kinetic", between=(0.5, 0.95))
    >>> round(border.value, 8), border.kinds[0], border.multipliers.round(3)
    (0.81740639, ('no stops', 'stops'), array([[0.5, 0.5]]))
    """
    find(system, parameter)
    require_number(parameter)
    require_period(system, "a boundary")
    low, high = map(float, between)
    if not (math.isfinite(low) and math.isfinite(high) and low < high and 0 < precision < 1):
        raise ModelError(
            f"between = {between}, precision = {precision}",
            "a range has two different values, the lower one first, and 0 < precision < 1",
            "correct them",
        )
    name, places = _along(system, parameter, along)
    ask = _question(kind)

    def row(place: float) -> Row:
        there = system.having(**{name: place}) if name else system

        def at(value: float) -> Attractor:
            return settled(there.having(**{parameter: value}), start or {}, transient=transient, orders=4)

        return _bisected(at, low, high, ask, precision)

    rows = [row(float(place)) for place in places]
    if all(below is None for _, _, below, _, _ in rows):
        raise SolveError(
            f"at {parameter} = {low:g} and {high:g} the motion is '{rows[0][4][0]}'",
            "a boundary lies between two kinds of motion",
            "widen between=, or give another start= or kind=",
        )
    values, errors, lows, highs, kinds = zip(*rows, strict=True)
    return Boundary(parameter, name, places, np.array(values), np.array(errors), lows, highs, kinds)


def _along(system: System, parameter: str, along: Mapping[str, ArrayLike] | None) -> tuple[str, Array]:
    if along is None:
        return "", np.array([math.nan])
    if len(along) != 1:
        raise ModelError(f"along = {', '.join(along)}", "a boundary is followed along one parameter", "name one")
    [(name, values)] = along.items()
    find(system, name)
    require_number(name)
    places = numbers(name, values)
    if name == parameter:
        raise ModelError(f"along = {name}", "that is what is bisected", "name another parameter, or leave it out")
    return name, places


def _question(kind: str | Kind) -> Kind:
    if callable(kind):
        return kind
    if kind not in KINDS:
        raise ModelError(f"kind = '{kind}'", f"there are {', '.join(KINDS)}, or a function", "choose one")
    return KINDS[kind]


Row = tuple[float, float, Attractor | None, Attractor | None, tuple[object, object]]


def _bisected(at: Callable[[float], Attractor], low: float, high: float, ask: Kind, precision: float) -> Row:
    """The boundary at one place: value, error, the motions on both sides, their kinds."""
    below, above = at(low), at(high)
    kinds = (ask(below), ask(above))
    if kinds[0] == kinds[1]:
        return math.nan, math.nan, None, None, kinds
    while high - low > precision * max(abs(low), abs(high)):
        middle = (low + high) / 2
        if not low < middle < high:
            break
        motion = at(middle)
        if ask(motion) == kinds[0]:
            low, below = middle, motion
        else:
            high, above = middle, motion
    return (low + high) / 2, (high - low) / 2, below, above, (kinds[0], ask(above))


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
    >>> refined = refine(slider, {"kinetic": [0.5, 0.7, 0.9]}, halvings=6, settle=60, cycles=10)
    >>> border = refined.kinetic[refined.normal_stops > 0][0]  # Den Hartog: 0.8174
    >>> bool(0.8174 <= border <= 0.8174 + 0.2 / 2**6), int(refined.run.sum()), refined.run.size
    (True, 9, 129)
    """
    _require_borders(system, grid, measure, halvings)
    step = 2**halvings
    known = _Refinement(grid, variables((measure,)), step)
    ask = partial(sweep, system, measures=[measure], cycles=cycles, settle=settle, start=start, engine=engine)
    while known.ask(ask) and step > 1:
        step //= 2
        known.wanted = _halved(known.arrays, step)
    return known.labelled(system)


class _Refinement:
    """The finest grid, with the answers known so far: which points were run, and which are wanted next."""

    def __init__(self, grid: Mapping[str, Sequence[float]], kept: Mapping[str, Variable], step: int) -> None:
        shape = tuple((len(column) - 1) * step + 1 for column in grid.values())
        require_memory(math.prod(shape), kept)
        self.kept = kept
        self.values = {name: _finer(np.asarray(column, dtype=np.float64), step) for name, column in grid.items()}
        self.arrays = {name: np.full(shape, variable.fill, variable.dtype) for name, variable in kept.items()}
        self.run, self.wanted = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        self.wanted[tuple(slice(None, None, step) for _ in shape)] = True
        self.last: Any = None  # the answers of the last level
        self.whole = True

    def ask(self, sweep: Callable[..., Any]) -> bool:
        """Run the points that are wanted; whether none was lost to an interrupt."""
        self._forget(self.wanted)
        places = np.argwhere(self.wanted)
        columns = self.values.values()
        points = [
            dict(zip(self.values, (v[j] for v, j in zip(columns, place, strict=True)), strict=True)) for place in places
        ]
        try:
            if points:
                self.last = sweep(points)
                for name, array in self.arrays.items():
                    array[tuple(places.T)] = self.last[name].values
                self.run |= self.wanted & (self.arrays["status"] != STATUS.fill)
                self.whole = self.last.attrs["status"] == "complete"
        except NoSystem:  # of the points beside a border of what is a system
            if self.last is None:
                raise
            self.arrays["status"][self.wanted] = NO_SYSTEM
            self.run |= self.wanted
        except KeyboardInterrupt:  # before a block of this level was done
            if self.last is None:
                raise
            self.whole = False
        return self.whole

    def _forget(self, places: Mask) -> None:
        for name, variable in self.kept.items():
            self.arrays[name][places] = variable.fill

    def labelled(self, system: System) -> Any:
        """All of it as an xarray.Dataset."""
        # between two runs that failed: that tells of no third
        self._forget((self.arrays["status"] == FAILED) & ~self.run)
        known = {name: (name, column, {"units": unit(system, name)}) for name, column in self.values.items()}
        names = tuple(self.values)
        data = {name: (names, array, self.last[name].attrs) for name, array in self.arrays.items()}
        status = "complete" if self.whole else f"interrupted: {self.run.sum()} points were run"
        attributes = {**self.last.attrs, "status": status}
        return required("xarray").Dataset({**data, "run": (names, self.run)}, coords=known, attrs=attributes)


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


def _finer(column: Array, step: int) -> Array:
    """Each interval cut into `step` equal parts."""
    places = np.arange((len(column) - 1) * step + 1) / step
    return np.interp(places, np.arange(len(column)), column)


def _halved(arrays: dict[str, NDArray[Any]], step: int) -> Mask:
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
