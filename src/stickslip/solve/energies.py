"""Where the energy goes: work of every force along a trajectory, and what the balance leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stickslip.solve.tables import Array
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
    >>> found = energy_flow(decay)
    >>> round(float(found.friction[0]), 12), round(float(found.springs[0]), 12)
    (-3.0, 3.0)
    """
    system = run.system
    mass, damping, stiffness = (np.atleast_2d(part) for part in (system.mass, system.damping, system.stiffness))
    count = len(mass)
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
    mass = np.atleast_2d(run.system.mass)
    tangents = run.system.tangents if isinstance(run.system, Structure) else np.ones((1, 1))
    w, values = _gauss(run, ("v", "a", "friction"))
    v, a, friction = np.split(values, [len(mass), 2 * len(mass)])
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


def _gauss(run: Trajectory, outputs: tuple[str, ...]) -> tuple[Array, Array]:
    """Weights of Gauss's rule on the cells of a run, and outputs at its nodes."""
    begins, widths = run.cells
    nodes, weights = np.polynomial.legendre.leggauss(ORDER)
    times = begins[:, None] + widths[:, None] * (nodes + 1) / 2
    # a cell shorter than the clock's rounding may begin a rounding before the one ahead of it ends
    values, _ = run.sample(np.maximum.accumulate(np.minimum(times.ravel(), run.duration)), outputs)
    return (widths[:, None] * weights / 2).ravel(), values
