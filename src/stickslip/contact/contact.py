"""How stiff is the contact before it slides?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.likely_contact import HELD, LEAST, NEGATIVE, STIFFNESS, likely_contact, sliding_level
from stickslip.balance.motion import stretches
from stickslip.cycle.loops import Loops
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, kinds
from stickslip.record.record import Record
from stickslip.statistics import mean_of_cycles

Array = NDArray[np.float64]


def contact_stiffness(record: Record | Loops, *, method: str | None = None) -> Estimate:
    r"""How stiff is the contact while it holds?

    While it holds, friction follows :math:`f = f_0 + K_y (x - x_0) + c\,\dot x` (thesis, equations 3.8 to 3.11). With
    "stick" the K_y and c are taken under which everything that the sensors read is most likely (a Kalman filter that
    lets the friction follow the contact where it holds, and do as it likes elsewhere): 0.012 % from 3 s of a rig like
    the thesis's in stick-slip, 0.2 % in sliding at 8.7 Hz, 0.4 % at 11.1 Hz. With "slope" a line is drawn through
    friction against displacement in each stick, as in the thesis's section 3.5; its answers scatter by 10 to 20 %
    between sticks on that rig, and are up to 30 % off, the more the faster the stick is over.

    Parameters
    ----------
    record : Record or Loops
        After :func:`~stickslip.friction_force`, whose rig is used, with the sensors' mounts stated; of
        :func:`~stickslip.friction_loops` the slope of the mean cycle is taken.
    method : {"stick", "slope"}, optional
        "stick" for a record, "slope" for loops, where left out.

    Returns
    -------
    Estimate
        K_y [N/m], or [N m/rad]; what its method can not see is in its checks.

    Raises
    ------
    RecordError
        The record has no friction.
    EstimateError
        Too few sticks, a contact on the moving base, or a method that does not fit.

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    >>> run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), cycles=5)
    >>> record = ss.Rig.perfect().having("x", white=1e-7).measure(run, fs=4000, rng=1)
    >>> record = ss.friction_force(record, mass=2.42, stiffness=2310, method="fusion")
    >>> bool(abs(contact_stiffness(record).value / 192000 - 1) < 0.01)
    True
    """
    methods = ("slope",) if isinstance(record, Loops) else ("stick", "slope")
    if method not in (None, *methods):
        raise EstimateError(f"method = '{method}'", f"it is one of {', '.join(methods)}", "choose one of them")
    if isinstance(record, Loops):
        friction = record.friction - record.offset.value
        return _slope(branch_slopes(record.displacement, friction, record.level.value), record.unit)
    if method == "slope":
        record.require_clean("x", "friction", question=STIFFNESS)
        level, middle = sliding_level(record["friction"], np.gradient(record["x"]))
        return _slope(branch_slopes(record["x"], record["friction"] - middle, level), "m")
    return likely_contact(record).stiffness


def contact_damping(record: Record) -> Estimate:
    r"""How much does the contact damp while it holds?

    The c of :math:`f = f_0 + K_y (x - x_0) + c\,\dot x`, from the same fit as :func:`contact_stiffness` with "stick".

    Parameters
    ----------
    record : Record
        After :func:`~stickslip.friction_force`, whose rig is used, with the sensors' mounts stated.

    Returns
    -------
    Estimate
        c [N s/m].

    Raises
    ------
    RecordError
        The record has no friction.
    EstimateError
        Too few sticks, a contact on the moving base, or a damping below zero, which no contact has: a sensor's lag or
        mount is not accounted for.

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    >>> run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), cycles=5)
    >>> record = ss.Rig.perfect().having("x", white=1e-7).measure(run, fs=4000, rng=1)
    >>> record = ss.friction_force(record, mass=2.42, stiffness=2310, method="fusion")
    >>> bool(abs(contact_damping(record).value - 23.9) < 1)
    True
    """
    damping = likely_contact(record).damping
    if NEGATIVE in kinds(damping.status):
        raise EstimateError(
            f"a contact damping of {damping.value:.3g} N s/m",
            "a contact takes energy from the motion, so that its damping is not below zero",
            "state the sensors' lags and mounts, by with_details or under [sensors] in the rig file",
        )
    return damping


def branch_slopes(displacement: Array, friction: Array, level: float) -> Array:
    """The slope of friction against displacement in each stick that goes from one side of `level` to the other."""
    slopes = []
    for first, last in zip(*stretches(np.abs(friction) < HELD * level), strict=True):
        way = displacement[first:last] - np.mean(displacement[first:last])
        whole = last - first >= LEAST and np.ptp(friction[first:last]) > level
        if whole and np.ptp(displacement[first:last]) > 0:
            slopes.append(float(way @ friction[first:last] / (way @ way)))
    return np.array(slopes)


def _slope(deflection: Array, unit: str) -> Estimate:
    if len(deflection) < 2:
        raise EstimateError(
            f"{len(deflection)} sticks with {LEAST} samples or more below the sliding friction",
            "a slope needs two at least",
            "sample faster, or give a longer record",
        )
    scatter = float(np.std(deflection, ddof=1) / abs(np.mean(deflection)))
    checks = (
        f"{len(deflection)} sticks, which scatter by {100 * scatter:.0f} %",
        "noise in the displacement and lags make a slope too low: 2 to 27 % on a rig like the thesis's",
    )
    unit, method = "N/m" if unit == "m" else "N m/rad", "mean slope of friction against displacement in each stick"
    return mean_of_cycles(STIFFNESS, deflection, unit=unit, method=method, checks=checks).within(0.0)
