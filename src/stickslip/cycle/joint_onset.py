"""How much torque does a joint bear before it moves; and which motion would tell all of its friction?"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import stretches
from stickslip.cycle.joint import JointFriction
from stickslip.cycle.joint_data import sliding
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.parameters import finite
from stickslip.record.record import Record, require_record
from stickslip.signals.derivatives import differentiate
from stickslip.signals.noise import noise_level, quantisation_step
from stickslip.statistics import mean_of_cycles, student

Array = NDArray[np.float64]

QUESTION = "the friction of a joint at breakaway"
LEAST = 8  # samples of rest
EVENTS = 8  # of four to seven one joint in a hundred was told 6 % wrong
TOLD = 0.05  # of the sliding friction: what is less sure is not told
MOST = 0.1  # of the sliding friction, by which the torque may rise while the encoder moves by a count
LEAST_BORNE = 0.5  # of the sliding friction: what moves under less was never at rest
DEVIATIONS = 6.0  # of an encoder's noise, by which a joint at rest hardly strays
LAST = 0.2  # of a rest, that tells how the torque rises at its end
WITHIN = 0.95  # of the range that the log has
SLOW, FAST, STROKE = 0.2, 0.9, 0.5  # of its fastest speed: the speed of each part of the motion
CREEP = 0.002  # of it, before a joint breaks away: at 0.01 the torque rose too fast in 40 of 42 simulated joints
CYCLES, RESTS = (2, 6), 10  # slow and fast ones, and how often it creeps away
PAUSE, CREEPS = 0.5, 3.0  # s
THIRD = 1.8  # speed of 0.6 cos(w t) + 0.4 cos(3 w t) over w, at most


@dataclass(frozen=True, eq=False, repr=False)
class JointBreakaway(Result):
    """The friction at which a joint breaks away.

    Attributes
    ----------
    ratio : Estimate
        Static over sliding friction, of both directions and at the same load.
    static : Estimate
        Static friction [N m] under the mean load of the log.
    count : int
        Rests whose end tells it.
    """

    ratio: Estimate
    static: Estimate
    count: int


def joint_breakaway(record: Record, *, joint: JointFriction) -> JointBreakaway:
    r"""How much torque does a joint bear before it moves, over what it slides against?

    At rest the friction is the torque less gravity's, whatever the inertia. It breaks away between the first count that
    its encoder moves by and :math:`(6 \delta J / \dot\tau)^{1/3}` before, the time that a torque rising at
    :math:`\dot\tau` needs to move it by a count :math:`\delta` where friction does not fall at all: how fast it falls
    is not known. Used are rests at whose end the torque rises by less than a tenth of the friction in that time; the
    answer is told where it is sure to 5 %, half of that rise, which all rests share, included.

    Parameters
    ----------
    record : Record
        With ``theta`` (or ``x``), as for :func:`regress_joint`.
    joint : JointFriction
        What that returned.

    Returns
    -------
    JointBreakaway

    Raises
    ------
    EstimateError
        Fewer than eight rests tell it, or they do not agree to 5 %.

    Examples
    --------
    >>> from stickslip.cycle.joint import regress_joint
    >>> t = np.arange(40000) / 1000
    >>> v = 0.2 * np.where(t % 4 < 3, 0.0, np.sin(np.pi * (t % 4 - 3)) * np.where(t % 8 < 4, 1.0, -1.0))
    >>> q = np.round(np.cumsum(v) / 1000 / 1e-5) * 1e-5
    >>> moving, way = v != 0, np.where(t % 8 < 4, 1.0, -1.0)
    >>> torque = np.where(moving, 3.0 * way + 0.01 * np.gradient(v, t), way * 1.4 * (t % 4))
    >>> torque += np.random.default_rng(0).normal(0, 0.02, t.size)
    >>> log = Record.of({"theta": q, "force": torque}, fs=1000, units={"force": "N m"})
    >>> found = joint_breakaway(log, joint=regress_joint(log, gravity=False))
    >>> 1.35 < found.ratio.value < 1.45
    True
    """
    require_record(record)
    ends = list(_ends(record, joint))
    if len(ends) < EVENTS:
        raise EstimateError(
            f"{len(ends)} rests tell the torque at which it breaks away",
            f"{QUESTION} needs {EVENTS}, before which the torque rises slowly enough for the encoder",
            "let the reference rest and then creep, by ramps of a few seconds, with a finer encoder or a faster log",
        )
    ratios, method = [ratio for ratio, _ in ends], "torque at rest as the encoder first moves"
    mean = mean_of_cycles("static over sliding friction", ratios, unit="1", of="rest", method=method)
    shared = float(np.mean([spread for _, spread in ends])) / math.sqrt(12)
    inexact = math.hypot(shared, joint.level.sd / joint.level.value)
    half = (mean.interval[1] - mean.interval[0]) / 2
    sd = math.hypot(half / NORMAL_95, inexact)
    if not NORMAL_95 * sd <= TOLD * mean.value or mean.value < 1 - TOLD:  # static friction is not below the sliding one
        raise EstimateError(
            f"{len(ends)} rests give {mean.value:.2f} times the sliding friction, "
            f"to {100 * NORMAL_95 * sd / mean.value:.0f} %",
            f"{QUESTION} is told where it is known to {100 * TOLD:.0f} %",
            "let it rest and creep away more often",
        )
    ratio = replace(mean, interval=_about(mean.value, sd), sd=sd)
    size = joint.level.value
    static = replace(ratio.scaled(size, joint.level.unit, "static friction"), sd=size * sd)
    return JointBreakaway(ratio, static, len(ends))


def _about(value: float, sd: float) -> tuple[float, float]:
    return value - NORMAL_95 * sd, value + NORMAL_95 * sd


def _ends(record: Record, joint: JointFriction) -> Iterator[tuple[float, float]]:
    """Of each rest that tells it: the friction at its end over the sliding one there, and its rise in a count."""
    position = record["theta" if "theta" in record else "x"]
    count = max(quantisation_step(position), DEVIATIONS * noise_level(position, record.fs))
    side = sliding(position, record.fs).side
    begins, ends = stretches(side == 0)
    pull = joint.torque - joint.weight(position)
    for begin, end in zip(begins, ends, strict=True):
        way = side[end] if end < len(side) else 0.0
        if way == 0 or end - begin < LEAST:
            continue
        rest = float(np.median(position[begin : (begin + end) // 2]))
        still = np.abs(position[begin:end] - rest) <= count * 1.01
        first = begin + int(np.argmax(still))
        moved = np.flatnonzero(np.abs(position[first:end] - rest) > count * 1.01)
        onset = first + (int(moved[0]) if len(moved) else end - first)
        if onset - first >= LEAST:
            yield from _told(way * pull[first:onset], position[onset - 1], count, joint, record.fs)


def _told(pull: Array, place: float, count: float, joint: JointFriction, fs: float) -> Iterator[tuple[float, float]]:
    """The friction at the end of one rest, where it is sure enough."""
    last = pull[-max(LEAST, int(LAST * len(pull))) :]
    time = np.arange(1 - len(last), 1) / fs
    rate, level = np.polyfit(time, last, 1)
    scatter = float(np.std(last - level - rate * time, ddof=2))
    slides = joint.sliding_at(place)
    if rate <= 0 or slides <= 0:
        return
    before = (6 * count * joint.inertia.value / rate) ** (1 / 3) + 1 / fs
    spread = rate * before + joint.gain * count
    noise = scatter / np.sqrt(len(last)) * student(len(last) - 2)
    if spread < MOST * slides and noise < MOST * slides and level > LEAST_BORNE * slides:
        yield float((level - spread / 2) / slides), float(spread / slides)


# ---- the motion that would tell it


def telling_motion(record: Record, *, fs: float = 200.0) -> Record:
    """Which motion would tell all of a joint's friction, within the range and the speed that its log has?

    Slow swings through the whole range (Coulomb friction, gravity, and friction that grows with it), fast ones of two
    tones (viscous friction and inertia), then strokes from rests out of which it creeps (breakaway).

    Parameters
    ----------
    record : Record
        A log of the joint, with ``theta`` (or ``x``): where it may go, and how fast.
    fs : float
        Samples of the motion in a second [Hz].

    Returns
    -------
    Record
        With ``reference``, to be written by :func:`write_record` and followed by the controller.

    Raises
    ------
    EstimateError
        The log does not move.

    Examples
    --------
    >>> t = np.arange(2000) / 100
    >>> log = Record.of({"theta": 0.5 + 0.8 * np.sin(2 * t)}, fs=100)
    >>> motion = telling_motion(log)
    >>> bool(0.5 - 0.8 < motion["reference"].min() < motion["reference"].max() < 0.5 + 0.8)
    True
    """
    require_record(record)
    finite("fs", fs, unit="Hz")
    name = "theta" if "theta" in record else "x"
    record.require_clean(name, question="a motion that tells friction", samples=200)
    low, high = np.quantile(record[name], [0.005, 0.995])
    fastest = float(np.quantile(np.abs(differentiate(record[name], record.fs).values), 0.99))
    if not (high > low and fastest > 0):
        raise EstimateError("the joint never moves in this log", "its range and speed bound the motion", "move it once")
    size = WITHIN * float(high - low) / 2
    moved = np.concatenate(_parts(size, fastest, fs)) + float(low + high) / 2
    unit = record.channels[name].unit
    return Record.of({"reference": moved}, fs=fs, units={"reference": unit})


def _parts(size: float, fastest: float, fs: float) -> list[Array]:
    """Swings about zero, each from an extreme on, and strokes between rests, joined by strokes."""
    rate = SLOW * fastest / size
    slow = size * np.cos(rate * np.arange(0, CYCLES[0] * 2 * np.pi / rate, 1 / fs))
    rate = FAST * fastest / (THIRD * size)
    turned = rate * np.arange(0, CYCLES[1] * 2 * np.pi / rate, 1 / fs)
    fast = size * (0.6 * np.cos(turned) + 0.4 * np.cos(3 * turned))
    parts, place = [_stroke(0.0, size, fastest, fs), slow, fast, _stroke(size, 0.0, fastest, fs)], 0.0
    for number in range(RESTS):
        way = 1.0 if place <= 0 else -1.0
        crept = place + way * CREEP * fastest * CREEPS
        goal = way * size * (0.5 + 0.4 * number / RESTS)
        rest, creep = np.full(round(PAUSE * fs), place), np.linspace(place, crept, round(CREEPS * fs))
        parts += [rest, creep, _stroke(crept, goal, fastest, fs)]
        place = goal
    return parts


def _stroke(start: float, goal: float, fastest: float, fs: float) -> Array:
    """From one place to another with the least jerk (Flash and Hogan 1985)."""
    share = np.linspace(0, 1, max(2, round(1.875 * abs(goal - start) / (STROKE * fastest) * fs)))
    return np.asarray(start + (goal - start) * (10 * share**3 - 15 * share**4 + 6 * share**5))
