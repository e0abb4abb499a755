"""A virtual squeak rig: rubber on steel, dry or wet, lightly or heavily loaded."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stickslip.drives.kinds import HarmonicBase
from stickslip.errors import ModelError
from stickslip.laws.linear_slope import LinearSlope
from stickslip.parameters import finite
from stickslip.structure import Contact, Structure
from stickslip.units import parse_constant

MASS, STIFFNESS, BEARING = 1.92, 2310.0, 0.0177  # kg, N/m and damping ratio of the linear bearing (sections 2.2, 6.5)
FORCING = 5.0  # Hz
HEAVY = 6.13  # N
BENDING, TORSION = 185.0, 250.0  # Hz, of the beam without its contacts (section 7.3)

# chosen: the thesis does not give them
BEAM, INERTIA = 0.02, 5e-6  # kg and kg m^2 that move at the beam's tip
BENDING_DAMPING, TORSION_DAMPING = 0.017, 0.01
ENGAGED = 484.0  # Hz of bending alone with both contacts engaged under the heavy load
HERTZ = 1 / 3  # contact stiffness grows with this power of the load, as that of a sphere does
ARM, OFFSET = 13.8e-3, -0.95e-3  # m: half the distance of the contacts, and how far their middle is from the axis
LEVER, SKEW = 1.7e-3, 2.3e-3  # m: height of the contacts over the axis, and how much they differ from it


@dataclass(frozen=True)
class Surface:
    """Friction coefficient of both contacts at vanishing speed, and its slope [s/m]."""

    friction: float
    slope: float


SURFACES = {
    "dry": Surface(20 / HEAVY, 2.3),
    "wet": Surface(8 / HEAVY, -0.26),
}  # 20 and 8 N (section 7.2); slopes chosen


def squeak_rig(surface: str = "wet", load: float | str = HEAVY, *, amplitude: float = 8e-3) -> Structure:
    r"""A rig that squeaks where it is wet and heavily loaded, and only there.

    A mass on a linear bearing is driven by its base at 5 Hz and rubs on two rubber hemispheres at the tip of a
    beam, which bends towards the mass and twists: three degrees of freedom (x of the mass, x2 of the tip across it,
    x3 its angle [rad]), tangential, normal and rotational, as section 8.2 of the thesis asks for. Of chapter 7 are the
    masses, springs, frequencies and friction levels; inertia, levers, slopes and damping of the beam are chosen so that
    its four observations hold together: the contacts stiffen with the load until bending and torsion, at 185 and 250 Hz
    without contact, meet near 490 Hz; water lowers friction to where they couple (dry, friction shifts torsion past
    bending), while its falling slope alone is too weak. Which of them decides, :func:`stability` says.

    Parameters
    ----------
    surface : {"wet", "dry"}
        Friction of 8 or 20 N under the heavy load, falling or rising with speed.
    load : float or str
        Normal load on both contacts together [N]; the thesis has 6.13 and 1.23.
    amplitude : float
        Of the mass's motion [m], roughly: the base moves as far as that takes against the friction (the thesis drove
        each case to a like motion).

    Returns
    -------
    Structure
        Driven by a :class:`HarmonicBase`; for steady sliding give it a Belt: ``rig.having(drive=Belt(0.1))``.

    Raises
    ------
    ModelError
        No such surface, or a load or an amplitude that is not positive.

    Examples
    --------
    >>> from stickslip.squeak.stability import stability
    >>> for surface, load in [("dry", 6.13), ("wet", 6.13), ("dry", 1.23), ("wet", 1.23)]:
    ...     print(surface, load, stability(squeak_rig(surface, load), speed=-0.1).mechanism)
    dry 6.13 stable
    wet 6.13 mode coupling
    dry 1.23 stable
    wet 1.23 stable
    """
    if surface not in tuple(SURFACES):
        raise ModelError(f"surface = '{surface}'", f"it is {' or '.join(SURFACES)}", "choose one of them")
    load = parse_constant("load", load, "N")
    amplitude = finite("amplitude", amplitude, unit="m", positive=True)
    rubber, turn = SURFACES[surface], 2 * math.pi
    bends, twists = BEAM * (turn * BENDING) ** 2, INERTIA * (turn * TORSION) ** 2
    stiffness = BEAM * turn**2 * (ENGAGED**2 - BENDING**2) * (load / HEAVY) ** HERTZ
    damping = [
        2 * BEARING * math.sqrt(MASS * STIFFNESS),
        2 * BENDING_DAMPING * math.sqrt(BEAM * bends),
        2 * TORSION_DAMPING * math.sqrt(INERTIA * twists),
    ]
    contacts = [
        Contact(
            LinearSlope(rubber.friction, slope=rubber.slope),
            [1, 0, LEVER + side * SKEW],
            normal=[0, 1, OFFSET + side * ARM],
            stiffness=stiffness / 2,
            preload=load / 2,
        )
        for side in (1, -1)
    ]
    return Structure(
        np.diag([MASS, BEAM, INERTIA]),
        np.diag(damping),
        np.diag([STIFFNESS, bends, twists]),
        contacts=contacts,
        drive=HarmonicBase(_base(rubber.friction * load, amplitude), frequency=FORCING),
        acts_on=[1, 0, 0],
        rotations=[3],
    )


def _base(friction: float, amplitude: float) -> float:
    """Amplitude of the base that moves the mass so far, by harmonic balance [m]."""
    detuned = 1 - (2 * math.pi * FORCING) ** 2 * MASS / STIFFNESS
    return math.hypot(amplitude * detuned, 4 * friction / (math.pi * STIFFNESS))
