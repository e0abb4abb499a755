"""Which start leads to which motion.

What a motion settles on: an orbit that attracts, or points that never repeat, with what it does in words.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Index
from stickslip.errors import ModelError, SolveError
from stickslip.estimate import Doubt, Estimate, Status
from stickslip.oscillator import Structure
from stickslip.parameters import PARTS
from stickslip.record.metadata import labelled_arrays
from stickslip.solve.periodic import aperiodic, settled_on
from stickslip.solve.poincare import SteadyState, Table, alike, extent, lap, tables
from stickslip.solve.simulate import opening
from stickslip.solve.tables import System
from stickslip.solve.trajectory import Trajectory

if TYPE_CHECKING:
    import xarray as xr

NEAR = 1e-6  # of an orbit's size: what comes this near, with the orbit's own events, and nearer still, belongs to it

Start = Mapping[str, float | str]

LOOKS = 256  # periods at which a motion that never repeats is looked at
PATIENCE = 60  # times 256 periods that a motion is given which still comes nearer to an orbit
ENDLESS = ("quasi-periodic", "chaotic", "not periodic")  # statuses of what does not repeat
STILL = 1e-5  # of its displacement: what moves by no more is held at its very limit
PUSH = 1e-6  # of its size: what keeps a carried motion from staying on an orbit that has become unstable


@dataclass(frozen=True, eq=False, repr=False)
class Basins:
    """Which start leads to which motion.

    Attributes
    ----------
    names : tuple of str
        The two start coordinates.
    axes : tuple of ndarray
        Their values.
    attractors : tuple of Attractor
        The motions, that of most starts first.
    which : ndarray (n, m)
        Number of the attractor to which each start leads; the first coordinate runs down the rows. -1: not followed.
    shares : tuple of Estimate
        Share of the starts that lead to each, of those that could be followed.
    lost : tuple of str
        Why starts could not be followed, a sentence for each.
    """

    names: tuple[str, str]
    axes: tuple[Array, Array]
    attractors: tuple[Attractor, ...]
    which: Index
    shares: tuple[Estimate, ...]
    lost: tuple[str, ...]

    @property
    def data(self) -> xr.DataArray:
        """The map as an xarray.DataArray with the starts as coordinates; the attractors in words in its attributes."""
        xarray = labelled_arrays("basins")
        result: xr.DataArray = xarray.DataArray(
            self.which,
            dims=self.names,
            coords=dict(zip(self.names, self.axes, strict=True)),
            name="attractor",
            attrs={
                "attractors": [attractor.regime for attractor in self.attractors],
                "shares": [share.value for share in self.shares],
                "system": repr(self.attractors[0].orbit.orbit.system),
            },
        )
        return result

    def __repr__(self) -> str:
        head = f"Basins({' x '.join(self.names)}, {' x '.join(map(str, self.which.shape))} starts)"
        lost = [f"{len(self.lost)} starts could not be followed"] if self.lost else []
        return "\n  ".join([head, *map(str, self.shares), *lost])


def basins(
    system: System, *, grid: Mapping[str, ArrayLike], start: Start | None = None, transient: int = 64, orders: int = 4
) -> Basins:
    """To which motion does each start lead?

    Every start is followed through a transient. It belongs to an attractor that is known if its next period has the
    attractor's own events in their order, ends nearer to it than it began, and begins within a millionth of the orbit's
    size; else its steady motion is found by ``steady_state`` and is compared, or is a new one. No distance in a picture
    decides. Equilibria count as one attractor, and so does a family of orbits.

    Parameters
    ----------
    system : Oscillator or Structure
        What moves, with a periodic drive.
    grid : mapping
        Two start coordinates by name, as ``simulate`` takes them ("x" [m], "v" [m/s], ...), with their values.
    start : mapping, optional
        The rest of the start.
    transient, orders : int
        As in ``steady_state``.

    Returns
    -------
    Basins

    Raises
    ------
    ModelError
        The grid has no meaning, or the drive does not repeat.
    SolveError
        No start could be followed.

    Examples
    --------
    >>> import numpy as np
    >>> from stickslip.scenarios import forced
    >>> bistable = forced(0.8, 0.7, static_ratio=1.5)
    >>> found = basins(bistable, grid={"x": np.linspace(-3, 3, 7), "v": np.linspace(-3, 3, 7)})
    >>> [(each.regime, round(share.value, 2)) for each, share in zip(found.attractors, found.shares)]
    [('no stops', 0.96), ('held', 0.04)]
    """
    require_period(system, "a basin")
    names, axes = _axes(grid)
    table = tables(system)
    attractors: list[Attractor] = []
    lost: list[str] = []
    which = np.full((len(axes[0]), len(axes[1])), -1, dtype=np.int64)
    for (i, j), _ in np.ndenumerate(which):
        begin = {**(start or {}), names[0]: float(axes[0][i]), names[1]: float(axes[1][j])}
        try:
            which[i, j] = _number(system, table, attractors, begin, (transient, orders))
        except SolveError as stopped:
            lost.append(f"{names[0]} = {begin[names[0]]:g}, {names[1]} = {begin[names[1]]:g}: {stopped}")
    if not attractors:
        raise SolveError("no start of the grid could be followed", lost[0], "see which motion is meant")
    counts = np.bincount(which[which >= 0], minlength=len(attractors))
    order = np.argsort(-counts, kind="stable")
    shares = tuple(_share(attractors[k].regime, int(counts[k]), which.size, len(lost)) for k in order)
    ranks = np.append(np.argsort(order), -1)  # the last for those that were not followed
    return Basins(names, axes, tuple(attractors[k] for k in order), ranks[which], shares, tuple(lost))


def _axes(grid: Mapping[str, ArrayLike]) -> tuple[tuple[str, str], tuple[Array, Array]]:
    if len(grid) != 2:
        raise ModelError(
            f"a grid of {', '.join(grid) or 'nothing'}",
            "two start coordinates are needed",
            'give grid={"x": np.linspace(-1, 1, 50), "v": np.linspace(-1, 1, 50)}',
        )
    axes = [numbers(name, values) for name, values in grid.items()]
    first, second = grid
    return (first, second), (axes[0], axes[1])


def _number(system: System, table: Table, attractors: list[Attractor], start: Start, patience: tuple[int, int]) -> int:
    """Which of the attractors found so far a start leads to; a new one is added."""
    transient, orders = patience
    state, mode = lap(system, table, *opening(table, start), transient).end()
    for number, attractor in enumerate(attractors):
        if _belongs(system, table, state, mode, attractor):
            return number
    new = settled(system, as_start(table, state, mode), transient=transient, orders=orders)
    for number, attractor in enumerate(attractors):
        if same(new, attractor):
            return number
    attractors.append(new)
    return len(attractors) - 1


def _belongs(system: System, table: Table, state: Array, mode: int, attractor: Attractor) -> bool:
    """Whether a motion is on its last way to an attractor."""
    if attractor.status in (*ENDLESS, "unbounded", "not unique", "grazing"):
        return False
    if attractor.status == "rest":
        course = lap(system, table, state, mode, 1)
        return len(course.modes) == 1 and table.modes[mode].friction is None and table.modes[mode].side == 0
    physical, size = table.physical, extent(attractor.orbit.orbit)
    gaps = np.max(np.abs(attractor.points - state[:physical]) / np.where(size > 0, size, 1.0), axis=1)
    if np.min(gaps) > NEAR:
        return False
    course = lap(system, table, state, mode, attractor.orbit.order)
    after = np.abs(course.end()[0][:physical] - attractor.points[int(np.argmin(gaps))]) / np.where(size > 0, size, 1)
    if np.max(after) > max(np.min(gaps), 1e-12):
        return False
    return attractor.orbit.order > 1 or list(course.modes) == list(attractor.orbit.orbit.modes)


def _share(name: str, count: int, total: int, lost: int) -> Estimate:
    """A share of what was followed, with Wilson's interval: as of starts drawn at random, which scatter more than a
    grid. Starts that were not followed may belong to it or not: the interval holds both."""
    from scipy.stats import binomtest

    share = count / (total - lost)
    ends = [binomtest(most, total).proportion_ci(method="wilson") for most in (count, count + lost)]
    interval = (float(ends[0].low), float(ends[1].high))
    doubts = [Doubt(f"{lost} of {total} starts could not be followed")] if lost else []
    method = f"count of {total - lost} starts, Wilson's interval"
    sd = math.sqrt(share * (1 - share) / total)
    return Estimate(f"share of '{name}'", share, interval, sd, "1", method, Status(*doubts))


@dataclass(frozen=True, eq=False)
class Attractor:
    """What a motion settles on.

    Attributes
    ----------
    orbit : SteadyState
        One period of it; of a motion that does not repeat, its last lap.
    points : ndarray (n, K)
        The state once in each period of the drive, at its phase zero: as many points as the orbit has periods, 256 of
        a motion that does not repeat.
    """

    orbit: SteadyState
    points: Array

    @property
    def status(self) -> str:
        """As of a :class:`SteadyState`, but never "unstable": that attracts nothing."""
        return self.orbit.status

    @property
    def regime(self) -> str:
        """What it does, in words: "held", "no stops", "2 + 4 stops", "2 + 0 stops, period 3", "chaotic"."""
        return regime(self.orbit)


def regime(orbit: SteadyState) -> str:
    """What a steady motion does, in words: stops per period (normal + abnormal), and its period in those of the drive.

    Examples
    --------
    >>> from stickslip.scenarios import forced
    >>> from stickslip import steady_state
    >>> regime(steady_state(forced(0.1, 0.4)))
    '2 + 4 stops'
    """
    if orbit.order < 1:
        return orbit.status
    if orbit.status == "rest" or {orbit.orbit.table.modes[m].side for m in orbit.orbit.modes} == {0}:
        return "held"
    system = orbit.orbit.system
    stops = [orbit.stops_at(c) for c in range(len(system.contacts) if isinstance(system, Structure) else 1)]
    counts = " and ".join(f"{normal} + {abnormal}" for normal, abnormal in stops)
    counts = f"{counts} stops" if any(map(any, stops)) else "no stops"
    return counts if orbit.order == 1 else f"{counts}, period {orbit.order}"


def settled(system: System, start: Start, *, transient: int, orders: int) -> Attractor:
    """What a start leads to."""
    orbit, _ = settled_on(system, start, transient=transient, orders=orders, patience=16 * LOOKS)
    if orbit.status == "unstable":
        orbit = replace(orbit, status="not periodic", order=0, period=math.nan)
    for turn in range(PATIENCE + 1):
        if orbit.status not in ENDLESS:
            break
        table = orbit.orbit.table
        course = lap(system, table, *orbit.orbit.end(), LOOKS)
        points = course.section()
        if orbit.status != "not periodic":
            return Attractor(orbit, points[:-1])
        if _is_still(course):
            orbit = replace(orbit, status="rest", order=1, period=table.motion.period)
        elif turn == PATIENCE or not _approaches(points):
            return Attractor(aperiodic(system, table, *course.end()), points[:-1])
        else:
            onwards = as_start(table, *course.end())
            orbit, _ = settled_on(system, onwards, transient=LOOKS, orders=orders, patience=LOOKS)
    return Attractor(orbit, orbit.orbit.section()[: max(orbit.order, 1)])


def _is_still(course: Trajectory) -> bool:
    """Whether a motion is held but for rounding, at the very limit of what is held."""
    x = course.states[:, 0]
    return bool(np.ptp(x) <= STILL * np.max(np.abs(x)))


def _approaches(points: Array) -> bool:
    """Whether a motion still comes nearer to something: its steps from one period to the next shorten, or all point one
    way."""
    steps = np.diff(points, axis=0) / np.maximum(np.max(np.abs(points), axis=0), 1e-300)
    lengths, turns = (np.max(np.abs(part), axis=1) for part in (steps, np.diff(steps, axis=0)))
    quarter = len(lengths) // 4
    early, late = lengths[:quarter], lengths[-quarter:]
    shortens = np.max(late) < 0.99 * np.max(early) and np.mean(late) < 0.99 * np.mean(early)
    return bool(shortens or np.max(turns) < 0.1 * np.min(lengths))


def as_start(table: Table, state: Array, mode: int) -> dict[str, float | str]:
    """A state and a mode as ``simulate`` takes them; what is held starts at rest on its counter-face."""
    own = zip(table.names[: table.physical], map(float, state), strict=False)
    start: dict[str, float | str] = dict(own)
    if table.modes[mode].friction is None:
        start.pop("v", None)
    return {**start, "mode": table.modes[mode].name}


def onward(attractor: Attractor) -> Start:
    """Where a motion begins that was on an attractor until its parameter changed, and was pushed a little."""
    if attractor.status == "unbounded":
        return {}
    table = attractor.orbit.orbit.table
    state, mode = attractor.orbit.orbit.end()
    if attractor.status != "rest":
        state[0] += PUSH * attractor.orbit.amplitude
    return as_start(table, state, mode)


def same(one: Attractor, other: Attractor) -> bool:
    """Whether two are one: by their events and their orbit; those that never repeat can not be told apart."""
    if one.status in (*ENDLESS, "unbounded", "not unique"):
        return one.regime == other.regime
    return alike(one.orbit, other.orbit)


def require_period(system: System, question: str) -> None:
    """Refuse a system whose drive does not repeat."""
    if not math.isfinite(tables(system).motion.period):
        raise ModelError(
            f"drive = {type(system.drive).__name__}",
            f"{question} looks once in each period of a drive",
            "give drive= a period, as HarmonicBase(1e-3, frequency=2.5)",
        )


def require_number(parameter: str) -> None:
    """Refuse a part where a number is wanted."""
    if parameter.rpartition(".")[2] in PARTS:
        raise ModelError(f"'{parameter}' is a part", "one number is varied", "name what varies in it, as kinetic")


def numbers(name: str, values: ArrayLike) -> Array:
    """Different finite numbers, sorted; at least two."""
    try:
        distinct = np.unique(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError) as no_numbers:
        raise ModelError(f"{name} = {values!r}", "a range is made of numbers", "give numbers") from no_numbers
    if len(distinct) < 2 or not np.all(np.isfinite(distinct)):
        raise ModelError(
            f"{name} = {distinct.tolist()}", "a range has two different finite values at least", "give more"
        )
    return distinct
