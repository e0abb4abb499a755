"""What a fit of viscous and dry friction to a free decay answers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.decay.release import RingDown
from stickslip.decay.which_motion import DecayMotion
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Estimate, Result
from stickslip.record.record import Step

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class DecayFit(Result):
    """Viscous and dry friction of a free decay.

    Attributes
    ----------
    damping_ratio : Estimate
        Viscous damping over the critical one.
    dry_displacement : Estimate
        Dry friction over the stiffness [m or rad]: half the width of the band in which the mass can rest.
    frequency : Estimate
        Undamped natural frequency [Hz].
    bias : Estimate
        Of the first release, as the two that follow: rest position in the record's zero [m or rad]; for velocity and
        acceleration the sensor's offset.
    release_time : Estimate
        When the mass was let go [s]. Where the motion is under way when the record begins, or its first swings are left
        out, the turn that it is fitted from, and named so.
    amplitude : Estimate
        From the rest position [m or rad], at that time.
    static_displacement : Estimate
        Static friction over the stiffness [m or rad]: the interval from where the mass stayed to where it last turned,
        in all releases.
    dry_force : Estimate or None
        Dry friction [N or N m], where the stiffness or the mass is known.
    damping_ratio_any, dry_displacement_any : Estimate or None
        The same two with the interval that holds whichever of the candidates not rejected is the motion: the model's
        form counted. None where no candidates were asked for.
    half_cycles : tuple of int
        Half cycles until rest of each release, the likeliest number.
    alternatives : tuple of (tuple of int, float)
        Every number of half cycles (of each release) that may be, with its weight by likelihood.
    model : str
        The motion fitted, in words.
    noise : str
        The noise found, in words; where releases differ, of each.
    noise_level : float
        Its standard deviation a sample in the first release, in the channel's unit.
    channel : str
        The channel fitted.
    ring_downs : tuple of RingDown
        The releases found: hold, motion and tail.
    time, measured, fitted : tuple of ndarray
        For each release: time [s] of each block's centre, the block means and those of the model.
    status : str
        "ok", or in words what to beware of.
    notes : tuple of str
        What was noticed when the releases were sought.
    history : tuple of Step
        What was done to the records, and this fit.
    motions : tuple of DecayMotion
        Which motion each release followed, of the candidates asked for.
    """

    damping_ratio: Estimate
    dry_displacement: Estimate
    frequency: Estimate
    bias: Estimate
    release_time: Estimate
    amplitude: Estimate
    static_displacement: Estimate
    dry_force: Estimate | None
    damping_ratio_any: Estimate | None
    dry_displacement_any: Estimate | None
    half_cycles: tuple[int, ...]
    alternatives: tuple[tuple[tuple[int, ...], float], ...]
    model: str
    noise: str
    noise_level: float
    channel: str
    ring_downs: tuple[RingDown, ...]
    time: tuple[Array, ...]
    measured: tuple[Array, ...]
    fitted: tuple[Array, ...]
    status: str
    notes: tuple[str, ...]
    history: tuple[Step, ...]
    motions: tuple[DecayMotion, ...] = ()

    @property
    def residual(self) -> tuple[Array, ...]:
        """Measured minus fitted block means of each release."""
        return tuple(m - f for m, f in zip(self.measured, self.fitted, strict=True))


def beginning(released: bool) -> tuple[str, str]:
    """What the time and the amplitude are called where a fit begins."""
    return ("release time", "amplitude at release") if released else ("time of the first turn", "first amplitude")


def rig_units(channel: str) -> dict[str, str]:
    """Units of mass and stiffness: of an angle those of a moment of inertia, and of a torque over the angle."""
    return {"mass": "kg m^2", "stiffness": "N m/rad"} if channel == "theta" else {"mass": "kg", "stiffness": "N/m"}


def constants(mass: Constant | None, stiffness: Constant | None, name: str) -> tuple[float | None, float | None]:
    """Mass and stiffness as numbers, in the units of the channel."""
    values = []
    for (word, unit), given in zip(rig_units(name).items(), (mass, stiffness), strict=True):
        value = None if given is None else Estimate.stated(word, given, unit).value
        if value is not None and not (math.isfinite(value) and value > 0):
            raise EstimateError(f"{word} = {given}", f"a {word} is positive", f"correct {word}=, or leave it out")
        values.append(value)
    return values[0], values[1]


def spring_of(known: tuple[float | None, float | None], angular_frequency: float) -> float | None:
    """The stiffness that is stated, or that of the stated mass; None where neither is."""
    mass, stiffness = known
    return stiffness if stiffness is not None or mass is None else mass * angular_frequency**2
