"""How a periodic orbit changes with a parameter: pseudo-arclength on the exact map, through folds and corners."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ModelError
from stickslip.parameters import find, places
from stickslip.solve.periodic import closed_orbit, judged
from stickslip.solve.poincare import SteadyState, alike, closes, cycle_of, derivative, extent, lap, tables
from stickslip.solve.simulate import opening
from stickslip.solve.tables import System

NUDGE = 1e-6  # of the parameter, relative to the way ahead: the map is differenced across twice this
FLOOR = 1e-11  # a step shorter than this, relative to the way ahead, has met a jump of the map
SLACK = 1e-9  # a corrector may always move this far; beyond it, no farther than the step was long
PUSHES = (0.01, 0.03, 0.1, 0.3, 0.003)  # of the orbit's size, along the direction that turns over in each period
LAPS = 64  # periods of the new orbit in which the motion itself goes near it, where it is stable
KINDS = ("fold", "grazing", "doubling")
SHARPEST = 1e-9  # of the way of the branch: so near is a change known
ROUNDS = 60  # halvings at most: `SHARPEST` is reached in 30, unless the branch goes far in one step


@dataclass(frozen=True, eq=False)
class Branch:
    """A periodic orbit along a parameter.

    Attributes
    ----------
    parameter : str
        What was varied.
    values : ndarray (K,)
        The parameter at each orbit, in the order of the branch: after a fold it runs back.
    orbits : tuple of SteadyState
        The orbit at each value, with status, events and multipliers of its own.
    folds : tuple of int
        Which orbits are at a smooth fold: the branch turns, a multiplier is 1.
    changes : tuple of int
        Which orbits are the first with another cycle of modes than the one before.
    status : str
        "complete" (the far value was reached), "returned" (back at the first value after a fold), "jump" (the map
        jumps there: the orbit ends, and motion goes over to another one), "unfinished" (the most orbits were found).
    """

    parameter: str
    values: Array
    orbits: tuple[SteadyState, ...]
    folds: tuple[int, ...]
    changes: tuple[int, ...]
    status: str

    @property
    def amplitudes(self) -> Array:
        """Largest displacement of each orbit [m], (K,)."""
        return np.array([orbit.amplitude for orbit in self.orbits])

    def __repr__(self) -> str:
        low, high = float(np.min(self.values)), float(np.max(self.values))
        return f"Branch({self.parameter} {low:g} to {high:g}, {len(self.orbits)} orbits, {self.status})"


@dataclass(frozen=True, eq=False)
class _Look:
    """The map at one point (state over its size, parameter over the way ahead): where it leads, and how steeply."""

    point: Array
    mode: int
    gap: Array
    slope: Array
    orbit: SteadyState
    after: int

    @property
    def miss(self) -> float:
        return float(np.max(np.abs(self.gap), initial=0.0))

    @property
    def turn(self) -> float:
        """Determinant that is zero at a fold."""
        return float(np.linalg.det(self.slope[:, :-1]))


_Map = Callable[[Array, int, Array | None], _Look]


def continue_orbit(orbit: SteadyState, parameter: str, *, to: float, step: float = 0.1, most: int = 400) -> Branch:
    """How does a periodic orbit change with a parameter, stable or not, around folds?

    Newton's method closes the orbit in the plane across the branch's tangent; the derivative by the state is exact, by
    the parameter a central difference of the exact map. The order of events is free to change: the mode at phase zero
    is the one the lap ends in, and the branch keeps its orientation (the sign of the determinant of map and tangent,
    which corners keep too). Where no step however short closes, the tangent of the far side of a corner is tried;
    where that fails as well, the map jumps and the branch ends.

    Parameters
    ----------
    orbit : SteadyState
        Where the branch starts.
    parameter : str
        What varies, a name that ``having`` takes.
    to : float
        Value at which the branch ends.
    step : float
        Longest step: a part of the way in the parameter, or of the orbit's size in the state.
    most : int
        Most orbits.

    Returns
    -------
    Branch

    Raises
    ------
    ModelError
        The orbit does not close, has no drive's period, or the parameter's values have no meaning.

    Examples
    --------
    >>> from stickslip.scenarios import forced
    >>> from stickslip.solve.periodic import steady_state
    >>> branch = continue_orbit(steady_state(forced(0.8, 0.5)), "kinetic", to=0.3)
    >>> branch.status, round(float(branch.amplitudes[-1]), 6)
    ('complete', 2.626105)
    """
    first = _start(orbit, parameter, to)
    if not (0 < step <= 1 and most > 1):
        raise ModelError(f"step = {step}, most = {most}", "0 < step <= 1 and at least 2 orbits", "correct them")
    orbit.orbit.system.having(**{parameter: to})  # refuses a value without meaning
    map_ = _family(orbit, parameter, first, to - first)
    begin = _correct(map_, np.append(_scaled(orbit), 0.0), int(orbit.orbit.modes[0]), _along(orbit))
    if begin is None:
        raise ModelError(f"the orbit at {first}", "does not close where a branch starts", "find it anew")
    tangent = _tangent(begin, _along(orbit), 0.0)
    side = _side(begin, tangent)
    orbits, folds, status, length, clean = [begin], [], "unfinished", step, True
    while len(orbits) < most:
        last = orbits[-1]
        rest = (float(tangent[-1] > 0) - last.point[-1]) / tangent[-1] if tangent[-1] else math.inf
        ahead = _step(map_, last, tangent, min(length, rest), _along(orbit) if rest <= length else tangent)
        if ahead is None and length <= FLOOR:
            tangent, ahead = _corner(map_, last, tangent, side, step)
            length = step / 16
            if ahead is None:
                status = "jump"
                break
        if ahead is None:
            length, clean = max(min(length, rest) / 2, FLOOR), False
            continue
        turned, same = last.turn * ahead.turn < 0, cycle_of(last.orbit) == cycle_of(ahead.orbit)
        if turned and not same and length > step / 64:
            length, clean = length / 2, False  # a fold and a corner in one step are told apart
            continue
        if turned and same:
            fold = _fold(map_, last, tangent, length)
            if fold is not None:
                folds.append(len(orbits))
                orbits.append(fold)
        orbits.append(ahead)
        if rest <= length:
            status = "complete" if tangent[-1] > 0 else "returned"
            break
        tangent = _tangent(ahead, tangent, side)
        length, clean = min(step, 1.4 * length if clean else length), True
    cycles = [cycle_of(look.orbit) for look in orbits]
    return Branch(
        parameter,
        np.array([first + look.point[-1] * (to - first) for look in orbits]),
        tuple(look.orbit for look in orbits),
        tuple(folds),
        tuple(j for j in range(1, len(orbits)) if cycles[j] != cycles[j - 1]),
        status,
    )


def _start(orbit: SteadyState, parameter: str, to: float) -> float:
    """The parameter's value where the branch starts."""
    if orbit.order < 1 or orbit.status == "rest" or not math.isfinite(orbit.orbit.table.motion.period):
        raise ModelError(
            f"the orbit is '{orbit.status}'", "a branch starts at an orbit with the period of a drive", "find one"
        )
    first = value_of(orbit.orbit.system, parameter)
    if not (math.isfinite(to) and to != first):
        raise ModelError(f"to = {to}", f"the far value is finite and not the first one, {first}", "give another")
    return first


def value_of(system: System, parameter: str) -> float:
    """The parameter's value now, found where `having` would put it."""
    known = places(system)
    value, *others = [getattr(known[path], path[-1]) for path in find(system, parameter)]
    if isinstance(value, int | float) and all(other == value for other in others):
        return float(value)
    raise ModelError(f"'{parameter}' has no single value", "a branch follows one number", "choose another parameter")


def _along(orbit: SteadyState) -> Array:
    """The direction of the parameter alone."""
    direction = np.zeros(orbit.orbit.table.physical + 1)
    direction[-1] = 1.0
    return direction


def _scaled(orbit: SteadyState) -> Array:
    """The state at phase zero over its size."""
    return orbit.orbit.states[0, : orbit.orbit.table.physical] / _size(orbit)


def _size(orbit: SteadyState) -> Array:
    """Largest modulus of each entry of the state; 1 where it is always zero."""
    sizes = extent(orbit.orbit)
    sizes[0] = max(sizes[0], orbit.amplitude)
    return np.where(sizes > 0, sizes, 1.0)


def _family(orbit: SteadyState, parameter: str, first: float, way: float) -> _Map:
    """The map over the orbit's period with its slope, for every scaled point and mode at phase zero."""
    system, order, size = orbit.orbit.system, orbit.order, _size(orbit)

    def end(point: Array, mode: int) -> tuple[Array, int, SteadyState, Array]:
        varied = system.having(**{parameter: first + point[-1] * way})
        table = tables(varied)
        state, _ = opening(table, {})
        state[: table.physical] = point[:-1] * size
        motion = lap(varied, table, state, mode, order)
        last, after = motion.end()
        slope, slowest = derivative(motion, after)
        return last[: table.physical] / size, after, judged(motion, order, slope, slowest), slope

    def scaled(slope: Array) -> Array:
        return slope * size / size[:, None] - np.eye(len(size))

    def look(point: Array, mode: int, change: Array | None) -> _Look:
        last, after, closed, slope = end(point, mode)
        if change is not None:
            return _Look(point, mode, last - point[:-1], np.column_stack([scaled(slope), change]), closed, after)
        places, ends, alike = [point[-1]], [last], []
        for nudge in (-NUDGE, NUDGE):
            place = float(np.clip(point[-1] + nudge, min(0.0, point[-1]), max(1.0, point[-1])))
            there, _, beside, _ = end(np.append(point[:-1], place), mode)
            alike.append(cycle_of(beside) == cycle_of(closed))
            places.append(place)
            ends.append(there)
        # across a corner the map has two slopes: only a side with the point's own order of events counts
        low = 0 if alike[1] and not alike[0] and places[2] != places[0] else 1
        high = 0 if alike[0] and not alike[1] and places[1] != places[0] else 2
        change = (ends[high] - ends[low]) / (places[high] - places[low])
        return _Look(point, mode, last - point[:-1], np.column_stack([scaled(slope), change]), closed, after)

    return look


def _correct(map_: _Map, point: Array, mode: int, normal: Array) -> _Look | None:
    """The orbit in the plane through a point across `normal`; None where Newton finds none."""
    best: _Look | None = None
    for _ in range(12):
        # the column of the parameter hardly changes from one iteration to the next
        look = map_(point, mode, None if best is None or best.mode != mode else best.slope[:, -1])
        if not np.all(np.isfinite(look.gap)) or (best is not None and look.miss >= best.miss):
            break
        best = look
        matrix = np.vstack([look.slope, normal])
        if not np.all(np.isfinite(matrix)) or np.linalg.matrix_rank(matrix) < len(matrix):
            break
        move = np.linalg.solve(matrix, np.append(-look.gap, 0.0))
        if np.max(np.abs(move)) > 1.0:
            break
        point, mode = look.point + move, look.after
    if best is None or best.after != best.orbit.orbit.modes[0] or not closes(best.orbit.orbit, best.miss):
        return None
    return best


def _step(map_: _Map, last: _Look, tangent: Array, length: float, normal: Array) -> _Look | None:
    """The orbit one step along the tangent, if it is near where the tangent leads."""
    aim = last.point + length * tangent
    try:
        orbit = _correct(map_, aim, last.after, normal)
    except ModelError:
        return None  # the parameter has no meaning there: a shorter step does
    if orbit is None or np.linalg.norm(orbit.point - aim) > max(0.5 * length, SLACK):
        return None
    return orbit


def _side(look: _Look, tangent: Array) -> float:
    return float(np.sign(np.linalg.det(np.vstack([look.slope, tangent]))))


def _tangent(look: _Look, before: Array, side: float) -> Array:
    """The branch's unit tangent, on the given side of the map."""
    tangent: Array = np.linalg.svd(look.slope)[2][-1]
    ahead = _side(look, tangent) == side if side else tangent @ before > 0
    return tangent if ahead else -tangent


def _corner(map_: _Map, last: _Look, tangent: Array, side: float, step: float) -> tuple[Array, _Look | None]:
    """The way on from a corner: with the tangent that the order of events just ahead has."""
    for length in (1e-9, 1e-6, step / 16):
        beyond = _tangent(map_(last.point + length * tangent, last.after, None), tangent, side)
        orbit = _step(map_, last, beyond, step / 16, beyond)
        if orbit is not None:
            return beyond, orbit
    return tangent, None


def _fold(map_: _Map, last: _Look, tangent: Array, length: float) -> _Look | None:
    """The orbit between two steps at which the determinant is zero, by the rule of false position, kept bracketed."""
    low, high, best = 0.0, length, None
    at_low, at_high = last.turn, math.nan
    for turn in range(80):
        halved = turn % 3 == 0 or at_high != at_high
        middle = (low + high) / 2 if halved else low + (high - low) * at_low / (at_low - at_high)
        look = _correct(map_, last.point + middle * tangent, last.after, tangent)
        if look is None:
            return best
        best = look if best is None or abs(look.turn) < abs(best.turn) else best
        if look.turn * at_low > 0:
            low, at_low = middle, look.turn
        else:
            high, at_high = middle, look.turn
        if high - low < FLOOR or look.turn == 0:
            break
    return best


# ---- where the period doubles, and where a change goes on in two parameters


def period_doublings(branch: Branch) -> tuple[int, ...]:
    """Which orbits of a branch are the first behind a period doubling?

    Parameters
    ----------
    branch : Branch
        From :func:`continue_orbit`.

    Returns
    -------
    tuple of int
        Orbits whose number of real multipliers below -1 is another than that of the one before, on one cycle of modes.

    Examples
    --------
    Feeny and Moon's oscillator on its way to chaos:

    >>> import math
    >>> import stickslip as ss
    >>> drive = ss.drives.HarmonicForce(1.28, frequency=1.25 / (2 * math.pi))
    >>> moon = ss.Oscillator(1.0, 1.0, ss.laws.PositionLoad(1.0, 1.5), drive, 0.03)
    >>> branch = ss.solve.continue_orbit(ss.steady_state(moon, orders=1), "amplitude", to=1.3)
    >>> [branch.orbits[j].status for j in period_doublings(branch)]
    ['unstable']
    """
    counts = [_turning(orbit) for orbit in branch.orbits]
    return tuple(j for j in range(1, len(counts)) if counts[j] != counts[j - 1] and j not in branch.changes)


def _turning(orbit: SteadyState) -> int:
    own = orbit.multipliers
    return int(np.count_nonzero((np.abs(own.imag) < 1e-9 * np.abs(own)) & (own.real < -1)))


def doubled(orbit: SteadyState) -> SteadyState:
    """The orbit of twice the period that has come off an orbit at a period doubling, stable or not.

    Newton's method closes two periods from starts beside the orbit, along the eigenvector of the multiplier below -1.

    Parameters
    ----------
    orbit : SteadyState
        Behind a period doubling, as :func:`period_doublings` tells; near it, where the new orbit is small.

    Returns
    -------
    SteadyState
        A start for :func:`continue_orbit`.

    Examples
    --------
    >>> import math
    >>> import stickslip as ss
    >>> drive = ss.drives.HarmonicForce(1.28, frequency=1.25 / (2 * math.pi))
    >>> moon = ss.Oscillator(1.0, 1.0, ss.laws.PositionLoad(1.0, 1.5), drive, 0.03)
    >>> branch = ss.solve.continue_orbit(ss.steady_state(moon, orders=1), "amplitude", to=1.3)
    >>> doubled(branch.orbits[-1]).order
    2

    Raises
    ------
    ModelError
        No multiplier is below -1, or no orbit of twice the period was found beside it: it lies on the other side of
        the doubling, or far away.
    """
    if orbit.order < 1 or not _turning(orbit):
        raise ModelError(
            "an orbit without a multiplier below -1",
            "one leaves through -1 where the period doubles",
            "take another orbit",
        )
    run, table = orbit.orbit, tables(orbit.orbit.system)
    jacobian, _ = derivative(run, run.end()[1])
    values, vectors = np.linalg.eig(jacobian)
    direction = vectors[:, np.argmin(values.real)].real
    size = np.max(np.abs(run.corners[:, : table.physical]), axis=0)
    direction = direction / np.max(np.abs(direction) / np.maximum(size, 1e-300))
    for push in (sign * push for push in PUSHES for sign in (1, -1)):
        state = run.states[0].copy()
        state[: table.physical] += push * direction
        near = lap(run.system, table, state, int(run.modes[0]), 2 * orbit.order * LAPS).end()
        for place, mode in ((state, int(run.modes[0])), near):
            closed = closed_orbit(run.system, table, place, mode, 2 * orbit.order)
            if closed is not None and closed.order == 2 * orbit.order and not alike(closed, orbit):
                return closed
    raise ModelError(
        f"no orbit of {2 * orbit.order} periods beside the one of {orbit.order}",
        "a period doubling sends one off, to one side",
        "take an orbit nearer to the doubling, or one on its other side",
    )


@dataclass(frozen=True, eq=False)
class Locus:
    """A curve on which a branch of orbits changes.

    Attributes
    ----------
    kind : str
        "fold", "grazing" (the cycle of modes changes) or "doubling".
    parameters : tuple of str
        The one along the branch, and the second one.
    points : ndarray (K, 2)
        Values of both, in the order of the second; the first is nan where the change was not met.
    orbits : tuple of SteadyState or None
        The orbit at, or just before, each change.
    """

    kind: str
    parameters: tuple[str, str]
    points: Array
    orbits: tuple[SteadyState | None, ...]


def locus(branch: Branch, *, kind: str, parameter: str, values: Sequence[float], number: int = 0) -> Locus:
    """How does a change of a branch move with a second parameter?

    The branch's first orbit is carried to each value of the second parameter in turn, and continued along the first
    parameter over the same range; the change there is closed in on to 1e-9 of the way.

    Parameters
    ----------
    branch : Branch
        From :func:`continue_orbit`, with a change of that kind.
    kind : str
        "fold", "grazing" or "doubling".
    parameter : str
        The second parameter, a name that ``having`` takes.
    values : sequence of float
        Its values, each near the one before.
    number : int
        Which change of that kind along the branch, from 0.

    Returns
    -------
    Locus

    Raises
    ------
    ModelError
        The kind is none of the three, or the branch has no such change.

    Examples
    --------
    The boundary beyond which Den Hartog's motion has stops:

    >>> import stickslip as ss
    >>> branch = ss.solve.continue_orbit(ss.steady_state(ss.scenarios.forced(0.8, 0.7)), "kinetic", to=0.9)
    >>> curve = locus(branch, kind="grazing", parameter="drive.frequency", values=[0.8 / 6.283185307179586])
    >>> curve.points.round(6).tolist()
    [[0.817406, 0.127324]]
    """
    if kind not in KINDS:
        raise ModelError(f"kind = '{kind}'", f"a change is one of {', '.join(KINDS)}", "choose one of them")
    if _change(branch, kind, number) is None:
        raise ModelError(
            f"{branch!r} without a {kind}", "a curve begins at a change that is known", "continue it farther"
        )
    low, high = float(branch.values[0]), float(branch.values[-1])
    orbit = branch.orbits[0]
    points, orbits = [], list[SteadyState | None]()
    for value in map(float, values):
        if value != value_of(orbit.orbit.system, parameter):
            orbit = continue_orbit(orbit, parameter, to=value, step=0.5).orbits[-1]
        own = continue_orbit(orbit, branch.parameter, to=high)
        change = _change(own, kind, number)
        place, at = (np.nan, None) if change is None else _sharpened(own, kind, change, high - low)
        points.append((place, value))
        orbits.append(at)
    return Locus(kind, (branch.parameter, parameter), np.array(points).reshape(-1, 2), tuple(orbits))


def _change(branch: Branch, kind: str, number: int) -> int | None:
    """Which orbit of a branch is the first behind a change, or at it."""
    changes = {"fold": branch.folds, "grazing": branch.changes, "doubling": period_doublings(branch)}[kind]
    return changes[number] if number < len(changes) else None


def _sharpened(branch: Branch, kind: str, j: int, way: float) -> tuple[float, SteadyState]:
    """The value of the parameter at a change, and the orbit there or just before; a fold is there already."""
    if kind == "fold":
        return float(branch.values[j]), branch.orbits[j]
    before, low, high = branch.orbits[j - 1], float(branch.values[j - 1]), float(branch.values[j])
    for _ in range(ROUNDS):
        if abs(high - low) <= SHARPEST * abs(way):
            break
        middle = (low + high) / 2
        there = continue_orbit(before, branch.parameter, to=middle, step=1.0).orbits[-1]
        if _changed(kind, before, there):
            high = middle
        else:
            low, before = middle, there
    return (low + high) / 2, before


def _changed(kind: str, before: SteadyState, there: SteadyState) -> bool:
    if kind == "grazing":
        return cycle_of(before) != cycle_of(there)
    return bool(np.min(there.multipliers.real) < -1.0)
