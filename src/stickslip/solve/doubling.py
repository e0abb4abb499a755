"""Where a periodic orbit doubles its period: a multiplier leaves through -1, and a branch twice as long begins."""

from __future__ import annotations

import numpy as np

from stickslip.errors import ModelError
from stickslip.solve.continuation import Branch
from stickslip.solve.orbit import SteadyState, alike
from stickslip.solve.periodic import closed_orbit
from stickslip.solve.poincare import derivative, lap, tables

PUSHES = (0.01, 0.03, 0.1, 0.3, 0.003)  # of the orbit's size, along the direction that turns over in each period
LAPS = 64  # periods of the new orbit in which the motion itself goes near it, where it is stable


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
            found = closed_orbit(run.system, table, place, mode, 2 * orbit.order)
            if found is not None and found.order == 2 * orbit.order and not alike(found, orbit):
                return found
    raise ModelError(
        f"no orbit of {2 * orbit.order} periods beside the one of {orbit.order}",
        "a period doubling sends one off, to one side",
        "take an orbit nearer to the doubling, or one on its other side",
    )
