"""Where the energy goes: work of every force along a trajectory, and what the balance leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stickslip.solve.trajectory import Trajectory
from stickslip.structure import Structure

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
    >>> from stickslip import Coulomb, Oscillator, simulate
    >>> decay = simulate(Oscillator(mass=1, stiffness=4, law=Coulomb(1.0)), duration=10, start={"x": 1.25})
    >>> round(energy(decay).friction, 12)  # 1 N along 2 m and 1 m
    3.0
    """
    mass = np.atleast_2d(run.system.mass)
    tangents = run.system.tangents if isinstance(run.system, Structure) else np.ones((1, 1))
    begins, widths = run.cells
    nodes, weights = np.polynomial.legendre.leggauss(ORDER)
    times = begins[:, None] + widths[:, None] * (nodes + 1) / 2
    values, _ = run.sample(np.minimum(times.ravel(), run.duration), ("v", "a", "friction"))
    v, a, friction = np.split(values, [len(mass), 2 * len(mass)])
    w = (widths[:, None] * weights / 2).ravel()
    taken = np.sum(tangents.T @ friction * v, axis=0)
    given = np.sum(mass @ a * v, axis=0) + taken
    first = run.states[0, len(mass) : 2 * len(mass)]
    last = run.sample([run.duration], ("v",))[0][:, 0]
    kinetic = float(last @ mass @ last - first @ mass @ first) / 2
    return Energy(
        kinetic,
        float(np.sum(w * given)),
        float(np.sum(w * taken)),
        float(np.sum(w * (np.abs(given) + np.abs(taken)))) + abs(kinetic),
    )
