"""How fast neighbouring motions part for good."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from stickslip.errors import ModelError, SolveError
from stickslip.estimate import Estimate
from stickslip.solve.curved import CurvedTrajectory
from stickslip.solve.poincare import Table, beat, beats, carried, carried_on, extent, tables
from stickslip.solve.simulate import opening
from stickslip.solve.tables import Array, System
from stickslip.solve.tape import Tape
from stickslip.solve.trajectory import Trajectory

BATCHES = 25  # of which the scatter gives the interval
STUDENT = 2.064  # two-sided 95 % quantile at 24 degrees of freedom


def lyapunov(
    system: System,
    *,
    cycles: int = 5000,
    transient: int = 100,
    start: Mapping[str, float | str] | None = None,
) -> Estimate:
    """Does the motion forget its beginning, or does it part from its neighbours (chaos)?

    The largest Lyapunov exponent that differs from the neutral one of time: the growth rate of a small difference of
    the state at fixed phase of the drive, carried along the exact motion, saltation at events included; of a curved
    law, by central differences of the map.

    A stick forgets the velocity and with it one direction; a rigid contact that sticks in every period may forget
    everything, and the exponent is minus infinity.

    Parameters
    ----------
    system : Oscillator or Structure
        What moves, with a periodic drive or one of several tones.
    cycles : int
        Periods over which the growth is averaged; of tones without a common one, those of the slowest.
    transient : int
        Periods before that.
    start : mapping, optional
        As in ``simulate``.

    Returns
    -------
    Estimate
        In 1/s; positive for chaos.

    Raises
    ------
    SolveError
        The drive has neither period nor tones.

    Examples
    --------
    >>> from stickslip.drives.kinds import HarmonicForce
    >>> from stickslip.laws.coulomb import Coulomb
    >>> drive = HarmonicForce(1.0, frequency=0.6 / 6.283185307)
    >>> from stickslip.oscillator import Oscillator
    >>> slider = Oscillator(mass=1, stiffness=1, law=Coulomb(0.3), drive=drive)
    >>> lyapunov(slider, cycles=500).value < 0
    True
    """
    if cycles < BATCHES or transient < 0:
        raise ModelError(f"cycles = {cycles}", f"the interval needs {BATCHES} cycles at least", "raise cycles=")
    table = tables(system)
    if not math.isfinite(beat(table)):
        raise SolveError("the drive has no period", "growth is counted from period to period", "use a periodic drive")
    return growth(system, table, *opening(table, start or {}), cycles=cycles, transient=transient)


def growth(system: System, table: Table, state: Array, mode: int, *, cycles: int, transient: int = 0) -> Estimate:
    """The largest Lyapunov exponent [1/s] of the motion from a state on."""
    period = beat(table)
    difference = np.linspace(1.0, 0.5, table.physical)
    weights = np.ones(table.physical)
    grown: list[float] = []
    how = "differences of the map" if isinstance(table, Tape) else "exact tangent"
    for number in range(transient + cycles):
        orbit = beats(system, table, state, mode, 1)
        state, mode = carried_on(orbit)
        if number == 0:
            weights = _weights(system, orbit)
            difference /= weights
        difference = carried(orbit, mode, difference)
        length = float(np.linalg.norm(difference * weights))
        if length == 0.0:
            return Estimate(
                "Lyapunov exponent",
                -math.inf,
                (-math.inf, -math.inf),
                0.0,
                "1/s",
                how,
                checks=(f"every difference was forgotten in lap {number}",),
            )
        difference /= length
        if number >= transient:
            grown.append(math.log(length) / period)
    batches = np.array([np.mean(part) for part in np.array_split(grown, BATCHES)])
    spread = float(np.std(batches, ddof=1) / math.sqrt(BATCHES))
    method = f"{how} over {cycles} periods, scatter of {BATCHES} batches"
    return Estimate.normal(
        "Lyapunov exponent", float(np.mean(grown)), sd=spread, unit="1/s", method=method, quantile=STUDENT
    )


def _weights(system: System, orbit: Trajectory) -> Array:
    """What makes the entries of the state comparable: their size, or a time for velocities."""
    if isinstance(orbit, CurvedTrajectory):
        sizes = extent(orbit)
        return np.asarray(1 / np.where(sizes > 0, sizes, 1.0))
    table = orbit.table
    weights = np.ones(table.physical)
    weights[table.degrees : 2 * table.degrees] = (
        1 / system.frequency / (2 * math.pi) if system.frequency else beat(table)
    )
    return weights
