"""Derivatives of a motion and of its events by any parameter of its system."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import ModelError
from stickslip.oscillator import Oscillator
from stickslip.parameters import find, places
from stickslip.solve.sensitivity import Sensitivity, sensitivity
from stickslip.solve.tables import Array, Tables
from stickslip.solve.trajectory import Trajectory

OUTPUTS = ("x", "v", "a", "friction")
# Of a parameter, for differences of tables to either side: what is left of the curve and rounding are alike. What is
# zero may not be less, and is moved to one side, by less.
STEP, FROM_ZERO = 1e-4, 1e-3


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """How a motion changes with parameters of its system.

    Attributes
    ----------
    names : tuple of str
        The parameters.
    events : ndarray, shape (parameters, events)
        By how much each of the run's events comes later [s] for each unit of a parameter.
    motion : Sensitivity
        Derivatives by neighbours of the system, two a parameter.
    shares : ndarray, shape (2, parameters)
        With which each of the two counts.
    """

    names: tuple[str, ...]
    events: Array
    motion: Sensitivity = field(repr=False)
    shares: Array = field(repr=False)

    def sample(self, times: ArrayLike, output: str = "x") -> Array:
        """Derivatives of an output at increasing instants, (parameters, instants), in units of one over the other.

        Parameters
        ----------
        times : array_like
            Instants [s], none at an event, where a velocity or a force may jump.
        output : str
            "x", "v", "a" or "friction".

        Returns
        -------
        ndarray

        Raises
        ------
        SolveError
            An instant lies outside the simulated time.
        """
        return _joined(self.motion.sample(self.motion.run.instants(times), output), self.shares)


def sensitivities(run: Trajectory, *names: str) -> Sensitivities:
    r"""How does a motion change with the parameters of its system, its events included?

    Between events the derivative :math:`s = \partial y / \partial p` follows
    :math:`\dot s = A s + (\partial A / \partial p) y`. At an event :math:`q y = 0` the instant moves by
    :math:`\partial t / \partial p = -(q s + (\partial q / \partial p) y) / (q \dot y)`, and the derivative jumps by the
    saltation matrix (Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7).
    The motion itself is never differenced.

    Parameters
    ----------
    run : Trajectory
        Of an oscillator whose law has linear modes, from :func:`~stickslip.simulate`.
    *names : str
        Parameters of the system by name ("stiffness", "kinetic", "drive.amplitude").

    Returns
    -------
    Sensitivities

    Raises
    ------
    ModelError
        No parameter has that name, its value is no number, or the law has curved modes.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.Coulomb(1.0))
    >>> run = ss.simulate(slider, duration=4.0, start={"x": 2.0})
    >>> by = sensitivities(run, "kinetic")
    >>> by.sample([1.5]).round(6).tolist()  # x = (x0 - f/k) cos(2 t) + f/k
    [[0.497498]]
    """
    system = run.system
    if not isinstance(system, Oscillator) or not isinstance(run.table, Tables):
        raise ModelError(
            f"derivatives of {type(system).__name__} with {type(getattr(system, 'law', system)).__name__}",
            "they are carried through the modes of one mass whose law is linear between its events",
            "take differences of two runs",
        )
    values = np.array([_value(system, name) for name in names])
    scales = np.where(values == 0, FROM_ZERO, np.abs(values))
    sides = np.array([np.ones(len(names)), np.where(values == 0, 1.0, -1.0)])
    moved = [
        system.having(**{name: value + step})
        for side in sides
        for name, value, step in zip(names, values, STEP * side * scales, strict=True)
    ]
    motion = sensitivity(run, moved, step=STEP, starts={}, scaled=(), outputs=OUTPUTS)
    shares = sides / (2 * scales)
    begun = np.flatnonzero(run.exits[:-1] >= 0) + 1
    return Sensitivities(names, _joined(motion.later[begun].T, shares), motion, shares)


def _joined(derivatives: Array, shares: Array) -> Array:
    """Of derivatives by neighbours to either side, (2 parameters, ...), those by the parameters."""
    apart = derivatives.reshape(2, shares.shape[1], -1)
    return np.asarray(np.einsum("sk,skt->kt", shares, apart))


def _value(system: Oscillator, name: str) -> float:
    path = find(system, name)[0]
    value = getattr(places(system)[path], path[-1])
    if isinstance(value, bool) or not isinstance(value, (int, float, np.floating)):
        raise ModelError(f"{name} = {value!r}", "a derivative is by a number", "name another parameter")
    return float(value)
