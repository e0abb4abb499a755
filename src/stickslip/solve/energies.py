"""Where the energy goes, and how good a run is: what it took, how near it grazed, the error that is left."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.errors import ModelError
from stickslip.oscillator import Structure
from stickslip.solve.curved import CurvedTrajectory, run_curved
from stickslip.solve.poincare import slowest_crossing
from stickslip.solve.simulate import stops_of
from stickslip.solve.trajectory import Trajectory

ORDER = 12  # Gauss points on each cell; exact to rounding where no rate turns more than a radian


@dataclass(frozen=True)
class Energy:
    """Energy over a run; all in joule.

    Attributes
    ----------
    kinetic : float
        Change of the mass's kinetic energy.
    drive : float
        Work on the mass by everything but friction: spring, damper, applied force.
    friction : float
        Work taken from the mass by friction.
    turnover : float
        Sum of the moduli of all work.
    """

    kinetic: float
    drive: float
    friction: float
    turnover: float

    @property
    def residual(self) -> float:
        """What the balance leaves, relative to the turnover; rounding for a sound run."""
        return abs(self.kinetic - self.drive + self.friction) / self.turnover if self.turnover > 0 else 0.0


@dataclass(frozen=True, eq=False)
class EnergyFlow:
    """Energy that each displacement is given over a run (n,) [J]; negative where it is taken.

    Attributes
    ----------
    friction : ndarray (n,)
        By friction. Of a belt it comes from the drive: it can be positive.
    contacts : ndarray (n,)
        By the loads' change, through the normal stiffness of the contacts: what they carry from one motion to another.
    springs, damping : ndarray (n,)
        By the structure's springs and dampers, as if the base were at rest.
    drive : ndarray (n,)
        By the moving base or the applied force: what the others leave. A belt drives by friction alone: none.
    kinetic : ndarray (n,)
        What its kinetic energy has gained: the sum of all others.
    """

    friction: Array
    contacts: Array
    springs: Array
    damping: Array
    drive: Array
    kinetic: Array


def energy_flow(run: Trajectory) -> EnergyFlow:
    r"""Which motion does friction feed, and which one loses it again?

    Each displacement is given the work :math:`\oint F_i\,\dot q_i\,dt` of every force on it; contacts and springs carry
    energy from one displacement to another, so that friction along a surface can feed a motion across it. Integrated
    as in :func:`energy`.

    Parameters
    ----------
    run : Trajectory
        Any run; over a whole cycle nothing is stored.

    Returns
    -------
    EnergyFlow

    Examples
    --------
    >>> from stickslip import Oscillator, simulate
    >>> from stickslip.laws import Coulomb
    >>> decay = simulate(Oscillator(mass=1, stiffness=4, law=Coulomb(1.0)), duration=10, start={"x": 1.25})
    >>> flow = energy_flow(decay)
    >>> round(float(flow.friction[0]), 12), round(float(flow.springs[0]), 12)
    (-3.0, 3.0)
    """
    system = run.system
    count = run.table.degrees
    mass, damping, stiffness = (_matrix(part, count) for part in (system.mass, system.damping, system.stiffness))
    w, values = _gauss(run, ("x", "v", "a", "friction"))
    x, v, a, friction = np.split(values, [count, 2 * count, 3 * count])
    pressed = np.zeros_like(x)
    if isinstance(system, Structure):
        friction = system.tangents.T @ friction
        for contact, load in zip(system.contacts, _gauss(run, ("load",))[1], strict=True):
            if contact.normal is not None:
                pressed += np.outer(np.asarray(contact.normal), contact.preload - load)
    forces = {
        "friction": -friction, "contacts": pressed, "springs": -stiffness @ x, "damping": -damping @ v,
        "kinetic": mass @ a,
    }  # fmt: skip
    works = {name: np.asarray((force * v) @ w) for name, force in forces.items()}
    own = np.sum([work for name, work in works.items() if name != "kinetic"], axis=0)
    return EnergyFlow(**works, drive=works["kinetic"] - own)


def energy(run: Trajectory) -> Energy:
    """Where does the energy go?

    :math:`m v^2/2` changes by the work of the drive less the work against friction. The works are integrated by
    Gauss's rule on the cells of the closed form, or on the Taylor steps of a curved law.

    Parameters
    ----------
    run : Trajectory
        Any run.

    Returns
    -------
    Energy

    Examples
    --------
    >>> from stickslip import Oscillator, simulate
    >>> from stickslip.laws import Coulomb
    >>> decay = simulate(Oscillator(mass=1, stiffness=4, law=Coulomb(1.0)), duration=10, start={"x": 1.25})
    >>> round(energy(decay).friction, 12)  # 1 N along 2 m and 1 m
    3.0
    """
    mass = _matrix(run.system.mass, run.table.degrees)
    tangents = run.system.tangents if isinstance(run.system, Structure) else np.eye(len(mass))
    w, values = _gauss(run, ("v", "a", "friction"))
    v, a, friction = np.split(values, [len(mass), 2 * len(mass)])
    taken = np.sum(tangents.T @ friction * v, axis=0)
    given = np.sum(mass @ a * v, axis=0) + taken
    first = run.states[0, len(mass) : 2 * len(mass)]
    last = run.sample([run.duration], ("v",))[0][:, 0]
    kinetic = float(last @ mass @ last - first @ mass @ first) / 2
    given_, taken_ = float(np.sum(w * given)), float(np.sum(w * taken))
    return Energy(kinetic, given_, taken_, float(np.sum(w * (np.abs(given) + np.abs(taken)))) + abs(kinetic))


def _matrix(part: ArrayLike, size: int) -> Array:
    """A matrix as it is; a number for every degree of freedom, or one for all, on the diagonal."""
    values = np.asarray(part, dtype=np.float64)
    return values if values.ndim == 2 else values * np.eye(size)


def _gauss(run: Trajectory, outputs: tuple[str, ...]) -> tuple[Array, Array]:
    """Weights of Gauss's rule on the cells of a run, and outputs at its nodes."""
    begins, widths = run.cells
    nodes, weights = np.polynomial.legendre.leggauss(ORDER)
    times = begins[:, None] + widths[:, None] * (nodes + 1) / 2
    # a cell shorter than the clock's rounding may begin a rounding before the one ahead of it ends
    values, _ = run.sample(np.maximum.accumulate(np.minimum(times.ravel(), run.duration)), outputs)
    return (widths[:, None] * weights / 2).ravel(), values


FINEST = 1e-15  # the least tolerance that a run takes: beside it the run's own is judged


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
    fine = run_curved(table, run.states[0], int(run.modes[0]), course=course, budget=100_000, rtol=FINEST)
    times = np.linspace(0.0, min(run.duration, fine.duration), looked)
    mine, truth = (one.sample(times, ("state",))[0] for one in (run, fine))
    size = np.maximum(np.max(np.abs(truth), axis=1, keepdims=True), 1e-300)
    apart = np.abs(mine - truth) / size
    own, other = (np.array([event.time for event in one.events]) for one in (run, fine))
    same = [event.mode for event in run.events] == [event.mode for event in fine.events]
    return GlobalError(
        apart[:, -1], np.max(apart, axis=1), float(np.max(np.abs(own - other), initial=0.0)) if same else math.inf
    )
