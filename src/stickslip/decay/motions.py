"""The motions that a free decay may follow: one equation, and which of its terms are at work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.decay.half_cycles import decay

Array = NDArray[np.float64]
Restoring = Literal["linear", "pendulum"]
RESTORING: tuple[str, ...] = get_args(Restoring)

PARAMETERS = (
    "angular_frequency", "damping_ratio", "dry_displacement", "rest", "amplitude", "release",
    "quadratic", "rise", "stribeck_speed", "micro_slip", "exponent", "curvature",
)  # fmt: skip
ALWAYS = ("angular_frequency", "rest", "amplitude", "release")


@dataclass(frozen=True)
class Motion:
    """A candidate: the terms at work beside inertia and spring.

    Attributes
    ----------
    name : str
        As the choice among candidates calls it.
    terms : tuple of str
        The parameters that are free beside natural frequency, rest position, amplitude and release.
    words : str
        What it is, for a table.
    sticks_early : bool
        Whether it may stay at a turning point from which its kinetic friction would let it go on.
    """

    name: str
    terms: tuple[str, ...]
    words: str
    sticks_early: bool = False

    @property
    def free(self) -> tuple[str, ...]:
        """Every free parameter."""
        return (*ALWAYS, *self.terms)

    @property
    def size(self) -> int:
        """How many terms it is made of."""
        return len(self.terms) + self.sticks_early


MOTIONS = {
    motion.name: motion
    for motion in (
        Motion("viscous", ("damping_ratio",), "viscous damping alone"),
        Motion("dry", ("dry_displacement",), "dry friction alone"),
        Motion("both", ("damping_ratio", "dry_displacement"), "viscous damping and dry friction"),
        Motion(
            "static",
            ("damping_ratio", "dry_displacement"),
            "viscous damping and dry friction, static above kinetic",
            sticks_early=True,
        ),
        Motion("air", ("damping_ratio", "quadratic"), "viscous and quadratic (air) damping, no dry friction"),
        Motion(
            "quadratic",
            ("damping_ratio", "dry_displacement", "quadratic"),
            "viscous damping, dry friction and quadratic (air) damping",
        ),
        Motion(
            "stribeck",
            ("damping_ratio", "dry_displacement", "rise", "stribeck_speed"),
            "viscous damping and dry friction that rises towards rest (Stribeck)",
        ),
        Motion(
            "micro-slip",
            ("damping_ratio", "micro_slip", "exponent"),
            "viscous damping and a joint in micro-slip, no dry friction",
        ),
        Motion(
            "curved spring",
            ("damping_ratio", "dry_displacement", "curvature"),
            "viscous damping and dry friction, spring that is not straight",
        ),
    )
}


def free_decay(
    times: ArrayLike,
    parameters: ArrayLike,
    *,
    free: tuple[str, ...] = (),
    restoring: Restoring = "linear",
    half_cycles: int | None = None,
    spread: ArrayLike | None = None,
) -> tuple[Array, Array, int]:
    r"""Where is a released mass, and how does that depend on the parameters?

    ``x'' = -w^2 [r(x) + g x^3] - 2 zeta w v - w^2 x_k (1 + sigma exp(-|v| / v_s)) sgn v - q v |v| - w^2 joint``, with
    ``r = x`` or ``sin x``, released at rest, until the spring is no stronger than the friction. The joint is in
    micro-slip: its branch is Masing's, of the backbone ``-kappa x^(1 + p)`` (Segalman 2005), so the energy that it
    takes per cycle goes with the amplitude to the power 2 + p, and with it the natural frequency falls.

    Parameters
    ----------
    times : array_like, shape (n,)
        Instants [s], rising.
    parameters : array_like, shape (12,)
        In the order of ``PARAMETERS``: w [rad/s], zeta, x_k, rest position, first amplitude from there (signed),
        release [s], q [1/length], sigma, v_s, kappa [length^-p], p, g [1/length^2].
    free : tuple of str
        Parameters whose sensitivities are wanted.
    restoring : {"linear", "pendulum"}
        The spring's law: x, or sin x.
    half_cycles : int, optional
        It stays at the turning point after so many, whatever drives it from there (static above kinetic friction).
    spread : array_like, shape (n,), optional
        Each value is the mean over a block of samples of this standard deviation in time [s] (to fourth order).

    Returns
    -------
    x : ndarray, shape (n,)
        Displacement.
    jacobian : ndarray, shape (n, len(free))
        Its derivatives.
    half_cycles : int
        Half cycles begun up to the last instant.

    Examples
    --------
    >>> dry = [2 * np.pi, 0.0, 0.05, 0.0, 1.0, 0.0, 0, 0, 0, 0, 0.5, 0]
    >>> free_decay([0.0, 0.5, 1.0], dry)[0].round(6).tolist()  # each half cycle loses 2 x_k
    [1.0, -0.9, 0.8]
    """
    instants = np.ascontiguousarray(times, dtype=float)
    if spread is not None:
        apart = np.asarray(spread, dtype=float)
        instants = np.stack([instants - apart, instants + apart], axis=1).ravel()
    active = np.array([PARAMETERS.index(name) for name in free], dtype=np.int64)
    work = np.empty((13, 2 + 2 * len(active)))
    x, jacobian = np.empty(len(instants)), np.empty((len(instants), len(active)))
    most = -1 if half_cycles is None else half_cycles
    values = np.ascontiguousarray(parameters, dtype=float)
    begun = decay(instants, values, active, restoring == "pendulum", most, work, x, jacobian)
    if spread is not None:
        x, jacobian = 0.5 * (x[::2] + x[1::2]), 0.5 * (jacobian[::2] + jacobian[1::2])
    return x, jacobian, int(begun)
