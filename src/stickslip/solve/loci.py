"""Where a branch of orbits changes: doubled periods, and curves of changes in the plane of two parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.errors import ModelError
from stickslip.solve.continuation import Branch, continue_orbit, value_of
from stickslip.solve.orbit import SteadyState, alike, cycle_of
from stickslip.solve.periodic import closed_orbit
from stickslip.solve.poincare import derivative, lap, tables
from stickslip.solve.tables import Array

PUSHES = (0.01, 0.03, 0.1, 0.3, 0.003)  # of the orbit's size, along the direction that turns over in each period
LAPS = 64  # periods of the new orbit in which the motion itself goes near it, where it is stable
KINDS = ("fold", "grazing", "doubling")
SHARPEST = 1e-9  # of the way of the branch: so near is a change known
ROUNDS = 60


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
