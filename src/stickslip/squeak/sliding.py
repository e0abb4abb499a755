"""What slides steadily, made linear: masses, dampers and springs, and what its contacts' friction adds to them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.drives.kinds import Belt
from stickslip.errors import ModelError
from stickslip.laws.base import Exit
from stickslip.laws.curved import lifted, symbol
from stickslip.oscillator import Oscillator
from stickslip.parameters import finite
from stickslip.structure import Contact, Structure

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array]
System = Oscillator | Structure


@dataclass(frozen=True, eq=False)
class Rubbing:
    """A contact that slides steadily: its friction is level (N_0 + k_n w_n q) + slope (w_t q' - face)."""

    tangent: Array
    normal: Array
    stiffness: float
    preload: float
    level: float
    slope: float
    velocity: float

    @property
    def follows(self) -> Array:
        """What the friction adds to K because it follows the load."""
        return self.level * self.stiffness * np.outer(self.tangent, self.normal)

    @property
    def constant(self) -> float:
        """Friction force at q = 0 [N]."""
        return self.level * self.preload + self.slope * self.velocity


def sliding_matrices(system: System, speed: float | None) -> Matrices:
    """M, C, K of small motions about steady sliding."""
    mass, damping, stiffness, rubbing = sliding_parts(system, speed)
    for r in rubbing:
        damping = damping + r.slope * np.outer(r.tangent, r.tangent)
        stiffness = stiffness + r.stiffness * np.outer(r.normal, r.normal) + r.follows
    return mass, damping, stiffness


def sliding_parts(system: System, speed: float | None) -> tuple[Array, Array, Array, list[Rubbing]]:
    """M, C, K without contacts, and the contacts."""
    if not isinstance(system, Oscillator | Structure):
        raise ModelError(f"a system {system!r}", "what slides is an Oscillator or a Structure", "give one")
    if speed is None:
        if not isinstance(system.drive, Belt):
            raise ModelError(
                f"a system driven by {type(system.drive).__name__}",
                "steady sliding needs a counter-face that runs at a steady speed",
                "give it drive=Belt(speed), or say speed=",
            )
        speed = system.drive.speed
    if finite("speed", speed, unit="m/s", signed=True) == 0:
        raise ModelError(
            f"speed = {speed} m/s", "a counter-face that slides has a speed", "give a number that is not 0"
        )
    if isinstance(system, Oscillator):
        numbers = (np.array([[value]]) for value in (system.mass, system.damping, system.stiffness))
        level, slope = _curve(system.law, -speed)
        one, none = np.ones(1), np.zeros(1)
        return *numbers, [Rubbing(one, none, 0.0, 1.0, level, slope, -speed)]  # type: ignore[return-value]
    if not system.contacts:
        raise ModelError("a structure without contacts", "something has to rub", "give it contacts=[...]")
    matrices = (np.asarray(part, dtype=np.float64) for part in (system.mass, system.damping, system.stiffness))
    return *matrices, [_rubbing(contact, speed) for contact in system.contacts]  # type: ignore[return-value]


def _rubbing(contact: Contact, speed: float) -> Rubbing:
    tangent = np.asarray(contact.tangent)
    normal = np.zeros_like(tangent) if contact.normal is None else np.asarray(contact.normal)
    velocity = -contact.carried * speed
    if velocity == 0:
        raise ModelError(
            "a contact whose counter-face is at rest (carried = 0)",
            "every contact slides while sliding is steady",
            "give carried=, or leave that contact out",
        )
    level, slope = _row(contact, velocity)
    return Rubbing(tangent, normal, contact.stiffness, contact.preload, level, slope, velocity)


def _row(part: Any, velocity: float) -> tuple[float, float]:
    """Friction of the slip that lasts at a relative velocity: its share of the load, and its slope."""
    side = 1 if velocity > 0 else -1
    for mode in part.modes() if hasattr(part, "modes") else ():
        if mode.kind == "slip" and mode.side == side and all(_lasts(exit_, velocity) for exit_ in mode.exits):
            if mode.rates or mode.friction is None or set(mode.friction) - {"1", "v"}:
                break
            return mode.friction.get("1", 0.0), mode.friction.get("v", 0.0)
    law = part.law if isinstance(part, Contact) else part
    raise ModelError(
        f"{type(law).__name__}, which remembers",
        "steady sliding is told of friction that follows speed and load alone",
        "use Coulomb, LinearSlope, Tabulated, CompliantContact or a curve; of a mass on a belt ask steady_sliding()",
    )


def _lasts(exit_: Exit, velocity: float) -> bool:
    """Whether an exit that is about the speed stays shut."""
    if "v" not in exit_.quantity or set(exit_.quantity) - {"v", "1", "always"}:
        return True
    bound = exit_.quantity.get("1", 0.0) + exit_.quantity.get("always", 0.0)
    return exit_.quantity["v"] * velocity + bound <= 0


def _curve(law: Any, velocity: float) -> tuple[float, float]:
    """Friction force at rest of the tangent to the law's curve at a relative velocity, and the tangent's slope."""
    if not hasattr(law, "branches"):
        return _row(law, velocity)
    side, fast = math.copysign(1.0, velocity), abs(velocity)
    curve = max((branch for branch in law.branches() if branch[0] <= fast), key=lambda branch: branch[0])[1]
    friction = lifted(curve(symbol("v")))
    slope = friction.slope("v").at(v=fast)
    return side * (friction.at(v=fast) - slope * fast), slope
