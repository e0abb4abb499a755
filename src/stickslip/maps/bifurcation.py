"""How the motion changes with a parameter: attractors followed up and down, and those that exist beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.arrays import Array
from stickslip.errors import ModelError
from stickslip.maps.basins import Attractor, Start, numbers, onward, require_number, require_period, same, settled
from stickslip.parameters import find
from stickslip.record.metadata import labelled_arrays
from stickslip.solve.continuation import Branch, continue_orbit
from stickslip.solve.tables import System

if TYPE_CHECKING:
    import xarray as xr

DIRECTIONS = ("up", "down")
MOST_CHANGES = 4  # looked for between two values
MOST_ORBITS = 60  # of a branch


@dataclass(frozen=True)
class Change:
    """Where an attractor that is followed goes over into another kind of motion.

    Attributes
    ----------
    direction : {"up", "down"}
        Which way the parameter went.
    value : float
        The parameter at the change.
    error : float
        How far off it may be.
    before, after : str
        What the motion did and does, as :attr:`Attractor.regime` says it.
    """

    direction: str
    value: float
    error: float
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.direction} at {self.value:.10g}: {self.before} -> {self.after}"


@dataclass(frozen=True, eq=False, repr=False)
class Bifurcation:
    """Attractors along a parameter.

    Attributes
    ----------
    parameter : str
        What was varied.
    values : ndarray (V,)
        Its values, increasing.
    up, down : tuple of Attractor
        What a motion settles on that is carried from value to value, upwards and downwards.
    beside : tuple of tuple of Attractor
        What the starts lead to besides, at each value.
    changes : tuple of Change
        Where the motion that is followed changes its kind, in the order met.
    branches : tuple of Branch
        Periodic orbits continued from both ends, stable or not; empty unless asked for.
    """

    parameter: str
    values: Array
    up: tuple[Attractor, ...]
    down: tuple[Attractor, ...]
    beside: tuple[tuple[Attractor, ...], ...]
    changes: tuple[Change, ...]
    branches: tuple[Branch, ...]

    def at(self, index: int) -> tuple[Attractor, ...]:
        """The different attractors at one value.

        Parameters
        ----------
        index : int
            Which of the values.

        Returns
        -------
        tuple of Attractor
        """
        return _different((self.up[index], self.down[index], *self.beside[index]))

    @property
    def coexisting(self) -> Array:
        """The values at which more than one attractor was found."""
        return self.values[[len(self.at(j)) > 1 for j in range(len(self.values))]]

    @property
    def data(self) -> xr.Dataset:
        """All numbers, labelled by direction and value, as an xarray.Dataset.

        Stroboscopic points stand along "point", as many as the longest motion has, and multipliers along "multiplier";
        what a shorter one does not have is NaN.
        """
        xarray = labelled_arrays("bifurcation diagrams")
        passes = (self.up, self.down)
        names = self.up[0].orbit.orbit.table.names[: self.up[0].points.shape[1]]
        longest = max(len(attractor.points) for way in passes for attractor in way)
        points = np.full((2, len(self.values), longest, len(names)), np.nan)
        for number, way in enumerate(passes):
            for j, attractor in enumerate(way):
                points[number, j, : len(attractor.points)] = attractor.points
        place = ("direction", self.parameter)
        columns = {
            "regime": [[attractor.regime for attractor in way] for way in passes],
            "status": [[attractor.status for attractor in way] for way in passes],
            "order": [[attractor.orbit.order for attractor in way] for way in passes],
            "period": [[attractor.orbit.period for attractor in way] for way in passes],
            "displacement": [[attractor.orbit.amplitude for attractor in way] for way in passes],
            "attractors": [[len(self.at(j)) for j in range(len(self.values))]] * 2,
        }
        variables: dict[str, tuple[tuple[str, ...], NDArray[Any]]] = {
            name: (place, np.array(column)) for name, column in columns.items()
        }
        multipliers = np.array([[attractor.orbit.multipliers for attractor in way] for way in passes])
        variables["multipliers"] = ((*place, "multiplier"), multipliers)
        variables["points"] = ((*place, "point", "state"), points)
        result: xr.Dataset = xarray.Dataset(
            variables,
            coords={"direction": list(DIRECTIONS), self.parameter: self.values, "state": list(names)},
            attrs={"system": repr(self.up[0].orbit.orbit.system), "changes": [str(change) for change in self.changes]},
        )
        return result

    def __repr__(self) -> str:
        low, high = self.values[[0, -1]]
        head = f"Bifurcation({self.parameter} {low:g} to {high:g}, {len(self.values)} values,"
        return "\n  ".join([f"{head} {len(self.coexisting)} with more than one attractor)", *map(str, self.changes)])


def bifurcation(
    system: System,
    parameter: str,
    *,
    values: ArrayLike,
    starts: Sequence[Start] = ({},),
    transient: int = 64,
    orders: int = 4,
    precision: float = 1e-6,
    branches: bool = False,
) -> Bifurcation:
    """How does the motion that a system settles on change with a parameter, and which ones exist beside each other?

    The first start is followed upwards, each value beginning where the one before has settled, pushed by a millionth
    of its size; then downwards from the top. Where both ways differ there is hysteresis. At each value every other
    start is tried as well. Two attractors are one if their events and, to rounding, their orbits are. Where the kind of
    motion (stops per period, period, rest) changes between two values, the change is found by bisection; of more than
    four between two values, as in chaos, the first four.

    Parameters
    ----------
    system : Oscillator or Structure
        What moves, with a periodic drive.
    parameter : str
        What varies, a name that ``having`` takes.
    values : array_like
        Its values, two at least; they are sorted.
    starts : sequence of mapping
        Where motions begin, as in ``simulate``; the first is the one that is followed.
    transient, orders : int
        As in ``steady_state``.
    precision : float
        How exactly changes are found, relative to the range of values.
    branches : bool
        Whether periodic orbits are continued from both ends too, by ``continue_orbit``: the unstable ones between.

    Returns
    -------
    Bifurcation

    Raises
    ------
    ModelError
        The parameter or its values have no meaning, or the drive does not repeat.

    Examples
    --------
    >>> from stickslip.scenarios import forced
    >>> diagram = bifurcation(forced(0.8, 1.0, static_ratio=1.5), "amplitude", values=[1.2, 1.3, 1.4, 1.45, 1.6])
    >>> for change in diagram.changes:
    ...     print(change.direction, round(change.value, 5), change.before, "->", change.after)
    up 1.5 held -> no stops
    down 1.37556 no stops -> 2 + 0 stops
    >>> diagram.coexisting
    array([1.2 , 1.3 , 1.4 , 1.45])
    """
    find(system, parameter)
    require_number(parameter)
    require_period(system, "a bifurcation diagram")
    places = numbers("values", values)
    if not (0 < precision < 1 and len(starts) > 0):
        raise ModelError(
            f"precision = {precision}, {len(starts)} starts", "0 < precision < 1 and a start at least", "correct them"
        )
    way = _Way(system, parameter, transient, orders, precision * (places[-1] - places[0]))
    up, changes_up = way.followed(places, starts[0])
    down, changes_down = way.followed(places[::-1], onward(up[-1]))
    down = down[::-1]
    beside = []
    for j, value in enumerate(places):
        others = [way.settled(value, start) for start in starts[1:]]
        beside.append(_different((up[j], down[j], *others))[len(_different((up[j], down[j]))) :])
    orbits = _branches(parameter, places, up[0], down[-1]) if branches else ()
    return Bifurcation(parameter, places, up, down, tuple(beside), (*changes_up, *changes_down), orbits)


@dataclass(frozen=True)
class _Way:
    """A system along its parameter."""

    system: System
    parameter: str
    transient: int
    orders: int
    width: float

    def settled(self, value: float, start: Start) -> Attractor:
        system = self.system.having(**{self.parameter: float(value)})
        return settled(system, start, transient=self.transient, orders=self.orders)

    def followed(self, values: Array, start: Start) -> tuple[tuple[Attractor, ...], list[Change]]:
        """The attractors at values in turn, each beginning where the one before has settled."""
        attractors, changes = [self.settled(values[0], start)], []
        for before, value in pairwise(values):
            attractors.append(self.settled(value, onward(attractors[-1])))
            changes += self._changes(before, value, attractors[-2], attractors[-1])
        return tuple(attractors), changes

    def _changes(self, first: float, last: float, before: Attractor, after: Attractor) -> list[Change]:
        """The changes between two values, in turn, each by bisection."""
        changes: list[Change] = []
        while before.regime != after.regime and len(changes) < MOST_CHANGES:
            low, high, other = first, last, after
            while abs(high - low) > self.width:
                middle = (low + high) / 2
                between = self.settled(middle, onward(before))
                if between.regime == before.regime:
                    low, before = middle, between
                else:
                    high, other = middle, between
            direction, value, error = DIRECTIONS[int(last < first)], (low + high) / 2, abs(high - low) / 2
            changes.append(Change(direction, float(value), float(error), before.regime, other.regime))
            first, before = high, other
        return changes


def _different(attractors: Sequence[Attractor]) -> tuple[Attractor, ...]:
    distinct: list[Attractor] = []
    for attractor in attractors:
        if not any(same(attractor, other) for other in distinct):
            distinct.append(attractor)
    return tuple(distinct)


def _branches(parameter: str, values: Array, first: Attractor, last: Attractor) -> tuple[Branch, ...]:
    """Orbits continued from the one end to the other, and back from there."""
    ends = ((first, values[-1]), (last, values[0]))
    return tuple(
        continue_orbit(end.orbit, parameter, to=float(to), most=MOST_ORBITS)
        for end, to in ends
        if end.orbit.order >= 1 and end.status not in ("rest", "grazing") and math.isfinite(end.orbit.period)
    )
