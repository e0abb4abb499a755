"""What a motion settles on: an orbit that attracts, or points that never repeat, with what it does in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import ModelError
from stickslip.parameters import PARTS
from stickslip.solve.orbit import SteadyState, alike
from stickslip.solve.periodic import steady_state
from stickslip.solve.poincare import Table, lap, tables
from stickslip.solve.tables import Array, System
from stickslip.solve.trajectory import Trajectory
from stickslip.structure import Structure

Start = Mapping[str, float | str]

LOOKS = 256  # periods at which a motion that never repeats is looked at
PATIENCE = 60  # times 256 periods that a motion is given which still comes nearer to an orbit
ENDLESS = ("quasi-periodic", "chaotic", "not periodic")  # statuses of what does not repeat
STILL = 1e-5  # of its displacement: what moves by no more is held at its very limit
PUSH = 1e-6  # of its size: what keeps a carried motion from staying on an orbit that has become unstable


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
    orbit = steady_state(system, start=start, transient=transient, orders=orders)
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
            return Attractor(orbit, points[:-1])
        else:
            onwards = as_start(table, *course.end())
            orbit = steady_state(system, start=onwards, transient=LOOKS, orders=orders, patience=LOOKS)
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
