"""The rig of chapter 2 with the flange as a mass of its own: friction enters there, and the cell passes it on.

Section 2.4 takes the flange's inertia off the cell's reading, so that the flange stands between contact and cell;
section 2.5 gives the cell with its mounting 250 Hz. Contact and mounting are two springs in series, and in series they
have the stiffness of section 3.5. What the cell feels is then the force on the slider, and the flange shakes the
slider: its 250 Hz are heard in the acceleration too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.errors import ModelError


@dataclass(frozen=True)
class Flange:
    """Mass [kg] of the flange, stiffness [N/m] of the contact before it and of the cell's mounting behind it."""

    mass: float
    contact: float
    mounting: float

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Flange:
        """From the series stiffness, the share of its give that is the mounting's, and the frequency when engaged.

        At w the pencil of slider and flange is singular, a quadratic in the flange's mass; the lighter one is meant.

        Raises
        ------
        ModelError
            No flange rings so low, or a share that is none.
        """
        if not 0 < told["mounting_share"] < 1:
            raise ModelError(f"mounting_share = {told['mounting_share']}", "a share is between 0 and 1", "correct it")
        contact = told["stiffness"] / (1 - told["mounting_share"])
        mounting = told["stiffness"] / told["mounting_share"]
        square = (2 * math.pi * told["mounting_frequency"]) ** 2
        slider, flange = told["spring"] + mounting - square * told["mass"], mounting + contact
        roots = np.roots([square**2, square * (slider - flange), mounting**2 - slider * flange])
        if np.iscomplex(roots).any():
            raise ModelError(
                f"mounting_share = {told['mounting_share']:g} at {told['mounting_frequency']:g} Hz",
                "no flange on so stiff a mounting rings so low",
                "give the mounting a larger share",
            )
        return cls(float(np.min(roots.real)), contact, mounting)


def slider(told: Mapping[str, Any], drive: Any) -> ss.Structure:
    """Slider and flange on the air track, the friction contact at the flange, the base on the slider's spring."""
    flange = Flange.of(told)
    track = 2 * told["damping_ratio"] * math.sqrt(told["mass"] * told["spring"])
    lost = told["contact_damping"] * (flange.contact / told["stiffness"]) ** 2  # in series, what the slider feels
    law = ss.laws.CompliantContact(told["kinetic"], stiffness=flange.contact, damping=lost)
    between = 2 * told["mounting_damping"] * math.sqrt(flange.mounting * flange.mass)
    link = np.array([[1.0, -1.0], [-1.0, 1.0]])
    return ss.Structure(
        np.diag([told["mass"] - flange.mass, flange.mass]),
        np.diag([track, 0.0]) + between * link,
        np.diag([told["spring"], 0.0]) + flange.mounting * link,
        contacts=[ss.Contact(law, [0, 1])],
        drive=drive,  # moves both alike: the link between them does not feel it
    )


def coupled(told: Mapping[str, Any]) -> tuple[float, float]:
    """Frequencies [Hz] of slider and flange with the contact engaged."""
    flange, system = Flange.of(told), slider(told, ss.drives.Release())
    stiffness = np.asarray(system.stiffness) + np.diag([0.0, flange.contact])
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(np.asarray(system.mass), stiffness)).real)
    slow, fast = np.sqrt(squares) / (2 * math.pi)
    return float(slow), float(fast)


def sensors(told: Mapping[str, Any], rig: ss.Rig) -> ss.Rig:
    """A rig whose cell feels the friction and the flange's inertia, its mounting being the structure's own."""
    mount = ss.rig.Mount(math.inf, 0.0, mass=Flange.of(told).mass, on="a2")
    return rig.having("load", of="friction", mount=mount).having("x", of="x1").having("a", of="a1")
