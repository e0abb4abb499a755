"""Steady sliding on a belt under a curved law, and whether it lasts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.drives.kinds import Belt
from stickslip.errors import ModelError, SolveError
from stickslip.laws.curved import CurvedLaw
from stickslip.oscillator import Oscillator


@dataclass(frozen=True, eq=False)
class SteadySliding:
    """A mass that slides steadily on a belt.

    Attributes
    ----------
    state : mapping of str to float
        x [m], v [m/s] (zero) and the law's memory.
    friction : float
        Friction force [N].
    eigenvalues : ndarray (N,)
        Of the motion near it [1/s], the fastest growing first; it lasts where all real parts are negative.
    status : str
        "stable" or "unstable".
    """

    state: Mapping[str, float]
    friction: float
    eigenvalues: NDArray[np.complex128]
    status: str


def steady_sliding(system: Oscillator) -> SteadySliding:
    """Does steady sliding on a belt last?

    The linear motion near it has the exact derivatives of the law's friction and rates.

    Parameters
    ----------
    system : Oscillator
        A mass with a curved law on a :class:`~stickslip.drives.kinds.Belt`.

    Returns
    -------
    SteadySliding

    Raises
    ------
    ModelError
        The system has no belt, no spring, or no curved law.
    SolveError
        The law's memory does not settle.

    Examples
    --------
    >>> from stickslip.laws.stribeck import Stribeck
    >>> law = Stribeck(1.0, 1.5, speed=0.1, exponent=1.0, viscous=0.2)
    >>> slider = Oscillator(mass=1, stiffness=1, law=law, drive=Belt(0.2), damping=0.3)
    >>> steady_sliding(slider).status, steady_sliding(slider.having(drive=Belt(0.3))).status
    ('unstable', 'stable')
    """
    law, drive = system.law, system.drive
    if not (isinstance(law, CurvedLaw) and isinstance(drive, Belt) and system.stiffness > 0):
        raise ModelError(
            f"{type(law).__name__} on {type(drive).__name__}, {system.stiffness:g} N/m",
            "steady sliding needs a curved law, a belt and a spring",
            "give them (a polygon's slope is that of its piece)",
        )
    name = law.entry[0] if drive.speed > 0 else law.entry[2]
    mode = next(mode for mode in law.rates() if mode.name == name)
    assert mode.friction is not None
    memory = tuple(law.memory)
    at = {"x": 0.0, "v": -drive.speed, **_settled(law, mode.rates, -drive.speed)}
    friction = mode.friction.at(**at)
    names = ("x", "v", *memory)
    flow = np.zeros((len(names), len(names)))
    flow[0, 1] = 1.0
    flow[1] = [-mode.friction.slope(n).at(**at) / system.mass for n in names]
    flow[1, :2] -= [system.stiffness / system.mass, system.damping / system.mass]
    for j, own in enumerate(memory):
        flow[2 + j] = [mode.rates[own].slope(n).at(**at) for n in names]
    scale = np.array([1.0, abs(drive.speed), *(abs(at[own]) or 1.0 for own in memory)])
    values = np.linalg.eigvals(flow * scale / scale[:, None])
    values = values[np.argsort(-values.real, kind="stable")]
    state = {**at, "x": -friction / system.stiffness, "v": 0.0}
    return SteadySliding(state, friction, values, "stable" if values[0].real < 0 else "unstable")


def _settled(law: CurvedLaw, rates: Mapping[str, object], speed: float) -> dict[str, float]:
    """The memory that no longer moves at a steady speed: Newton's method, from several sizes of the opening memory."""
    memory = tuple(law.memory)
    opening = np.array([row.get("1", 0.0) for row in law.memory.values()])
    for decade in (0, *(s * d for d in range(1, 13) for s in (1, -1))):
        guess = opening * 10.0**decade
        for _ in range(100):
            at = {"x": 0.0, "v": speed, **dict(zip(memory, map(float, guess), strict=True))}
            try:
                value = np.array([rates[n].at(**at) for n in memory])  # type: ignore[attr-defined]
                slope = np.array([[rates[n].slope(o).at(**at) for o in memory] for n in memory])  # type: ignore[attr-defined]
                step = np.linalg.solve(slope, value) if memory else value
            except (ModelError, np.linalg.LinAlgError):
                break
            if np.all(np.abs(step) <= 1e-14 * np.abs(guess)):
                return dict(zip(memory, map(float, guess), strict=True))
            guess = guess - step
    raise SolveError(
        f"the memory {', '.join(memory)} does not settle at {speed:g} m/s",
        "steady sliding needs a memory that comes to rest",
        "simulate the sliding instead",
    )
