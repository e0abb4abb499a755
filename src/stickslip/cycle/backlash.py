"""How much play have the teeth between a joint's motor and its link?"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import away_from
from stickslip.cycle.joint import JointFriction
from stickslip.cycle.joint_data import sliding, turning
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result
from stickslip.record.record import Record, require_record
from stickslip.signals.derivatives import differentiate
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import quantisation_step
from stickslip.statistics import least_squares

Array = NDArray[np.float64]

QUESTION = "the backlash of a joint"
LEAST = 40  # instants, on either side of the teeth
CHANCE = 0.01  # of joints without play, that would show as much as is claimed
SURE = 3.0  # deviations of gravity's torque, below which nobody knows which way it pushes the teeth
COUNTS = 0.1  # of a count of its encoder, that rounding may shift one side against the other


@dataclass(frozen=True, eq=False, repr=False)
class JointBacklash(Result):
    """Play between a joint's motor and its link.

    Attributes
    ----------
    backlash : Estimate
        Angle [rad] that the motor turns, at the joint, while no tooth touches; of an axis that moves straight in m.
    ratio : float
        What the motor's channel turns by in a radian of the joint, found beside: that of the gear, in rad.
    felt : float
        The least backlash [rad] that fewer than one in a hundred joints without any would have shown.
    """

    backlash: Estimate
    ratio: float
    felt: float

    @property
    def claimed(self) -> bool:
        """Whether joints without play would not have shown as much."""
        return self.backlash.value > self.felt


def joint_backlash(record: Record, *, joint: JointFriction) -> JointBacklash:
    r"""How far does the motor turn before the link follows?

    Of a joint with an encoder before its gear and one behind, while the link slides,

    .. math:: q = q_m / N - q_0 - \tfrac{b}{2}\,\mathrm{sgn}\,T - T / k - v\,t_0,

    with the torque :math:`T` that the teeth carry, their play :math:`b`, the stiffness :math:`k` between the encoders,
    and a time :math:`t_0` by which one is read later. How inertia and friction are shared between motor and link is
    not known: used are instants at which every share gives :math:`T` the same sign. The coefficients are those of
    :func:`~stickslip.statistics.least_squares`, whose intervals hold for the slow errors of encoders and teeth.

    Parameters
    ----------
    record : Record
        With ``theta`` [rad] (or ``x`` [m]) of the link, and ``motor``, before the gear, in any unit.
    joint : JointFriction
        What :func:`regress_joint` tells of that.

    Returns
    -------
    JointBacklash

    Raises
    ------
    RecordError
        No encoder on the motor.
    EstimateError
        The teeth were hardly pushed both ways while the link slid.

    Examples
    --------
    >>> from stickslip.cycle.joint import regress_joint
    >>> t = np.arange(12000) / 400
    >>> q = 1.2 * np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t)
    >>> v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    >>> torque = 0.002 * a + 0.06 * np.sign(v) + 0.03 * v + np.random.default_rng(0).normal(0, 0.003, t.size)
    >>> turned = np.round((100 * (q + 0.002 * np.sign(v))) / 0.01) * 0.01
    >>> log = Record.of({"theta": q, "motor": turned, "force": torque}, fs=400, units={"motor": "rad", "force": "N m"})
    >>> found = joint_backlash(log, joint=regress_joint(log, gravity=False))
    >>> found.claimed, found.backlash.includes(0.004), round(found.ratio, 1)
    (True, True, 100.0)
    """
    require_record(record)
    name, unit = ("theta", "rad") if turning(record) else ("x", "m")
    record.require_clean(name, "motor", question=QUESTION, samples=LEAST)
    record = without_delays(record, name, "motor", question=QUESTION)
    link, motor = record[name], record["motor"]
    if np.ptp(motor) == 0 or np.ptp(link) == 0:
        raise EstimateError("an encoder never changes", f"{QUESTION} needs motion of both", "check their columns")
    ahead = motor / np.polyfit(link, motor, 1)[0]  # the motor's motion knows nothing of the link's counts
    velocity, acceleration = (differentiate(ahead, record.fs, order=order).values for order in (1, 2))
    rubbing = joint.level.value * np.sign(velocity) + joint.viscous.value * velocity
    torque, side = _carried(joint, link, rubbing, joint.inertia.value * acceleration)
    slides = sliding(link, record.fs)
    touching = away_from(np.append(False, np.diff(side) != 0), slides.window.half)
    rows = slides.rows[(side[slides.rows] != 0) & touching[slides.rows]]
    ways = [int(np.sum(side[rows] == way)) for way in (1, -1)]
    if min(ways) < LEAST:
        raise EstimateError(
            f"the teeth are surely pushed forward at {ways[0]} instants and back at {ways[1]}",
            f"{QUESTION} is told from {LEAST} of each",
            "swing it back and forth where gravity pulls little, or to both sides of where it hangs",
        )
    columns = np.column_stack([motor, np.ones(len(link)), torque, side / 2, velocity])
    fit = least_squares(columns[rows], link[rows])
    # friction winds the gear up with the sign of the teeth: how much of it passes them, none to all, is not known
    wound = 2 * abs(float(fit.coefficients[2])) * joint.level.value / math.sqrt(12)
    beside = math.hypot(wound, COUNTS * quantisation_step(link))
    backlash = fit.combined([0, 0, 0, -1, 0], "backlash", unit, "link against motor while it slides", beside=beside)
    felt = float(NormalDist().inv_cdf(1 - CHANCE)) * backlash.sd
    return JointBacklash(backlash.within(0.0), 1 / float(fit.coefficients[0]), felt)


def _carried(joint: JointFriction, place: Array, rubbing: Array, inertial: Array) -> tuple[Array, Array]:
    """The torque that the teeth carry, half of friction and inertia taken as the link's; its sign, 0 if not sure.

    It is sure where it is that of every share: of none, of one alone, and of both.
    """
    weight = joint.weight(place)
    unsure = max(part.sd for part in (joint.sine, joint.cosine) if part is not None) if joint.sine is not None else 0.0
    bare = np.where(np.abs(weight) > SURE * unsure, weight, 0.0)
    signs = np.sign([bare, weight + rubbing, weight + inertial, weight + rubbing + inertial])
    total = signs.sum(axis=0)
    alike = np.abs(total) == np.abs(signs).sum(axis=0)
    return weight + (rubbing + inertial) / 2, np.where(alike, np.sign(total), 0.0)
