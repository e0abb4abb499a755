"""How good a run is: what it took, how near it grazed, and, of a curved law, the error that is left at its end."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.errors import ModelError
from stickslip.solve.curved import CurvedTrajectory, run_curved
from stickslip.solve.poincare import slowest_crossing
from stickslip.solve.simulate import stops_of
from stickslip.solve.tables import Array
from stickslip.solve.trajectory import Trajectory

FINEST = 1e-15


@dataclass(frozen=True)
class Statistics:
    """What a run took.

    Attributes
    ----------
    pieces, events : int
        Stretches in one mode, and changes of mode.
    steps : int
        Stretches on which the motion is one closed form or one polynomial.
    leaps : int
        Of them, implicit steps: where the contact is far faster than the motion. Taylor steps are never rejected, their
        length is known beforehand.
    shortest : float
        The shortest step [s].
    slowest_exit : float
        Slowest crossing of an exit, relative to the terms of its rate: near 0 the motion grazes, and small changes part
        it. nan under a curved law.
    """

    pieces: int
    events: int
    steps: int
    leaps: int
    shortest: float
    slowest_exit: float


def statistics(run: Trajectory) -> Statistics:
    """What did a run take, and how near did it come to grazing?

    Parameters
    ----------
    run : Trajectory
        Any run.

    Returns
    -------
    Statistics

    Examples
    --------
    >>> from stickslip import Oscillator, laws, simulate
    >>> decay = simulate(Oscillator(mass=1, stiffness=4, law=laws.Coulomb(1.0)), duration=10, start={"x": 1.25})
    >>> told = statistics(decay)
    >>> told.pieces, told.events, told.slowest_exit
    (3, 2, 1.0)
    """
    _, widths = run.cells
    leaps, slowest = 0, math.nan
    if isinstance(run, CurvedTrajectory):
        leaps = int(np.count_nonzero(run.steps.leaps >= 0))
    else:
        slowest = slowest_crossing(run)
    events = sum(run.event_counts().values())
    return Statistics(len(run.modes), events, len(widths), leaps, float(np.min(widths)), slowest)


@dataclass(frozen=True, eq=False)
class GlobalError:
    """By how much a run differs from the same run to the finest tolerance.

    Attributes
    ----------
    end : ndarray (K,)
        Difference of each physical entry of the state at the end, relative to its largest value.
    along : ndarray (K,)
        The same, the largest at any instant of `looked`.
    events : float
        Largest difference of an event's instant [s]; infinite where the events are not the same.
    """

    end: Array
    along: Array
    events: float


def global_error(run: Trajectory, *, looked: int = 200) -> GlobalError:
    """How far from the truth is a run under a curved law at its end?

    ``rtol`` bounds what a step may add; what all steps leave is measured: the same start is run again to 1e-15, and
    both are compared. Tolerances below 1e-13 are compared with their own rounding.

    Parameters
    ----------
    run : Trajectory
        Under a curved law, without a time lag.
    looked : int
        Instants compared.

    Returns
    -------
    GlobalError

    Raises
    ------
    ModelError
        The law is linear between its events: such a run has no error but rounding; or it has a time lag.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(1.0, 4.0, ss.laws.Stribeck(1.0, 1.5, speed=0.1))
    >>> run = ss.simulate(slider, duration=4.0, start={"x": 2.0}, rtol=1e-8)
    >>> bool(global_error(run).end.max() < 1e-8)
    True
    """
    table: Any = run.table
    if not isinstance(run, CurvedTrajectory) or table.physical != table.nodes.rate.shape[1] - 1 - len(
        table.motion.rates
    ):
        raise ModelError(
            "a run without a tolerance, or with a time lag",
            "linear modes are closed forms, exact to rounding; a lag's past is no state",
            "ask of a curved law without a lag; of others, compare runs from starts a rounding apart",
        )
    period = table.motion.period
    laps = math.floor(run.duration / period) if math.isfinite(period) else 0
    span = (float(laps), run.duration - (laps * period if laps else 0.0))
    course = (span, stops_of(table, *span))
    fine = run_curved(
        table, run.states[0], int(run.modes[0]), course=course, budget=100_000, rtol=FINEST, tell=lambda _: None
    )
    times = np.linspace(0.0, min(run.duration, fine.duration), looked)
    mine, truth = (one.sample(times, ("state",))[0] for one in (run, fine))
    size = np.maximum(np.max(np.abs(truth), axis=1, keepdims=True), 1e-300)
    apart = np.abs(mine - truth) / size
    own, other = (np.array([event.time for event in one.events]) for one in (run, fine))
    same = [event.mode for event in run.events] == [event.mode for event in fine.events]
    return GlobalError(
        apart[:, -1], np.max(apart, axis=1), float(np.max(np.abs(own - other), initial=0.0)) if same else math.inf
    )
