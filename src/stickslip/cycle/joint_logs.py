"""What logs of one joint tell beside its friction: the torque that it bears before it moves, and the play of its teeth;
and several together, with how far each is predicted by the others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from stickslip.arrays import Array, stretches
from stickslip.balance.motion import away_from
from stickslip.cycle.joint import PERHAPS, RICHER, JointFriction, Telling, delay_of
from stickslip.cycle.joint_fall import bends, misfits, possible
from stickslip.cycle.joint_fit import (
    JointData,
    about_load,
    cogged,
    fitted,
    joint_data,
    pooled,
    punctual,
    seating,
    turning,
    warmed,
)
from stickslip.cycle.joint_slides import COGS, motor_lead, sliding
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import NORMAL_95, Constant, Estimate, Result
from stickslip.parameters import finite
from stickslip.record.record import Record, require_record
from stickslip.signals.derivatives import differentiate
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_level, quantisation_step
from stickslip.statistics import least_squares, mean_of_cycles, student

PLAY_QUESTION = "the backlash of a joint"
LEAST_SIDE = 40  # instants, on either side of the teeth
CHANCE = 0.01  # of joints without play, that would show as much as is claimed
SURE = 3.0  # deviations of gravity's torque, below which nobody knows which way it pushes the teeth
COUNTS = 0.1  # of a count of its encoder, that rounding may shift one side against the other
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
    >>> backlash = joint_backlash(log, joint=regress_joint(log, gravity=False))
    >>> backlash.claimed, backlash.backlash.includes(0.004), round(backlash.ratio, 1)
    (True, True, 100.0)
    """
    require_record(record)
    name, unit = ("theta", "rad") if turning(record) else ("x", "m")
    record.require_clean(name, "motor", question=PLAY_QUESTION, samples=LEAST_SIDE)
    record = without_delays(record, name, "motor", question=PLAY_QUESTION)
    link, motor = record[name], record["motor"]
    lead = motor_lead(link, motor)
    if lead is None:
        raise EstimateError(
            "motor and link do not turn together, or one encoder never changes",
            f"{PLAY_QUESTION} needs the motion of both, without jumps at each turn",
            "check their columns",
        )
    ahead = link + lead  # the motor's motion knows nothing of the link's counts
    velocity, acceleration = (differentiate(ahead, record.fs, order=order).values for order in (1, 2))
    rubbing = joint.level.value * np.sign(velocity) + joint.viscous.value * velocity
    torque, side = _carried(joint, link, rubbing, joint.inertia.value * acceleration)
    slides = sliding(link, record.fs)
    touching = away_from(np.append(False, np.diff(side) != 0), slides.window.half)
    rows = slides.rows[(side[slides.rows] != 0) & touching[slides.rows]]
    ways = [int(np.sum(side[rows] == way)) for way in (1, -1)]
    if min(ways) < LEAST_SIDE:
        raise EstimateError(
            f"the teeth are surely pushed forward at {ways[0]} instants and back at {ways[1]}",
            f"{PLAY_QUESTION} is told from {LEAST_SIDE} of each",
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
    >>> breakaway = joint_breakaway(log, joint=regress_joint(log, gravity=False))
    >>> 1.35 < breakaway.ratio.value < 1.45
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
    pull = joint.torque - joint.weight(position) - joint.cogs(position)
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


@dataclass(frozen=True, eq=False)
class JointPrediction:
    """How far the torque of a log is predicted by what the other logs tell.

    Attributes
    ----------
    error, plain : float
        Norm of what the prediction misses over that of the torque about its mean, by all that the other logs tell; and
        by Coulomb and viscous friction alone, fitted to the same logs with inertia and gravity.
    time : ndarray, shape (m,)
        Times [s] at which the joint slides.
    measured, predicted : ndarray, shape (m,)
        As it was, smoothed by windows within strokes, and as it is predicted [N m].
    """

    error: float
    plain: float
    time: Array
    measured: Array
    predicted: Array


@dataclass(frozen=True, eq=False, repr=False)
class JointLogs(Result):
    """What several logs of one joint tell together.

    Attributes
    ----------
    forward, back, viscous, load, inertia, sine, cosine, damping, warming, thinning : Estimate or None
        As of :class:`JointFriction`, of all logs at once; None where they do not tell it, or where it was stated.
    predictions : tuple of JointPrediction
        Of each log by the others.
    left_out : tuple of str
        What all logs together can not tell, and which motion would.
    status : str
        "ok", or in words what to beware of.
    delay : Estimate or None
        As of :class:`JointFriction`, of all logs at once.
    """

    forward: Estimate
    back: Estimate
    viscous: Estimate
    load: Estimate | None
    inertia: Estimate | None
    sine: Estimate | None
    cosine: Estimate | None
    damping: Estimate | None
    warming: Estimate | None
    thinning: Estimate | None
    predictions: tuple[JointPrediction, ...]
    left_out: tuple[str, ...]
    status: str = "ok"
    delay: Estimate | None = None


def regress_joint_logs(
    records: Sequence[Record], *, gravity: bool | None = None, **constants: Constant | None
) -> JointLogs:
    r"""What do several logs of one joint tell together, and does what some tell hold in the others?

    The balance of :func:`regress_joint` is solved for all logs at once, so that one may tell gravity and another
    viscous friction. Each log is then left out in turn: the others' solution predicts its torque :math:`\tau` from its
    motion, and told is

    .. math:: \frac{|\tau - \hat\tau|}{|\tau - \bar\tau|},

    the normalised root of the mean square (Ljung, System Identification, 1999, section 16.4), while the joint slides;
    beside it stands that of Coulomb and viscous friction, fitted to the same logs.

    Parameters
    ----------
    records : sequence of Record
        Two or more, each as :func:`regress_joint` takes it, all with a torque of the same source.
    gravity : bool, optional
        As of :func:`regress_joint`.
    **constants : float, str, tuple or Estimate
        `inertia`, `kp`, `kd`, `torque_constant` and `play`, as of :func:`regress_joint`.

    Returns
    -------
    JointLogs

    Raises
    ------
    RecordError
        Fewer than two logs, or logs whose torques have different sources.
    ModelError
        A constant without meaning.
    EstimateError
        What a log, or all but one, can not tell: the sentence says which motion would.

    Examples
    --------
    >>> def moved(seed, speed):
    ...     t = np.arange(4000) / 200
    ...     q = np.sin(2 * np.pi * speed * t) + 0.4 * np.sin(2 * np.pi * 3.1 * speed * t)
    ...     v, a = np.gradient(q, 1 / 200), np.gradient(np.gradient(q, 1 / 200), 1 / 200)
    ...     torque = 0.02 * a + 0.03 * v + (0.06 + 0.1 * abs(0.5 * np.sin(q))) * np.sign(v) + 0.5 * np.sin(q)
    ...     torque += np.random.default_rng(seed).normal(0, 0.01, t.size)
    ...     return Record.of({"theta": q, "force": torque}, fs=200, units={"force": "N m"})
    >>> together = regress_joint_logs([moved(0, 0.2), moved(1, 0.3), moved(2, 0.5)])
    >>> together.load.includes(0.1)
    True
    >>> [bool(one.error < one.plain) for one in together.predictions]
    [True, True, True]
    """
    teeth = [seating(record, gravity, **constants) for record in records]
    data, slow = (
        warmed(
            [joint_data(record, gravity, slowly, at, **constants)[1] for record, at in zip(records, teeth, strict=True)]
        )
        for slowly in (False, True)
    )
    if len(data) < 2 or len({(one.source, one.terms) for one in data}) > 1:
        raise RecordError(
            f"{len(data)} log{'s' * (len(data) != 1)}, with torque by {', '.join(one.source for one in data)}",
            "several logs are told together by torques of one source",
            "give two logs or more, of one robot and one kind",
        )
    data = cogged(data)
    slow = [one.alike(data[0]) for one in slow]
    delay = delay_of(pooled(data))
    data, slow = [punctual(one, delay) for one in data], [punctual(one, delay) for one in slow]
    fit, terms, pull, left_out = fitted(pooled(data))
    beside = misfits(pooled(data), fit, terms, bends(pooled(slow), fit, terms, pull), turning(records[0]), delay)
    tell = Telling(pooled(data), fit, terms, turning(records[0]), "ok", beside)
    known = {term: tell.one(term) for term in terms if term not in ("uneven", *COGS)}
    perhaps: dict[str, Any] = {name: known.get(name) for name in PERHAPS}
    predictions = [
        _predicted(log, pooled(data[:place] + data[place + 1 :]), record)
        for place, (log, record) in enumerate(zip(data, records, strict=True))
    ]
    return JointLogs(
        *tell.ways(),
        known["viscous"],
        inertia=known.get("inertia"),
        **perhaps,
        predictions=tuple(predictions),
        left_out=left_out,
        delay=possible(delay, data[0].source),
    )


def _predicted(log: JointData, others: JointData, record: Record) -> JointPrediction:
    """A log's torque by the regression of the others, and by a plain one."""
    fit, terms, pull, _ = fitted(others)
    predicted = log.model(fit, terms, pull)
    plain = tuple("coulomb" if term == "forward" else term for term in terms if term not in {*RICHER, *COGS, "back"})
    fit, pull = about_load(replace(others, terms=plain), plain)
    spread = float(np.linalg.norm(log.torque - log.torque.mean()))
    if spread == 0:
        raise EstimateError("the torque of a log never changes", "a prediction is of a torque", "check its column")
    error, simple = (
        float(np.linalg.norm(log.torque - torque)) / spread for torque in (predicted, log.model(fit, plain, pull))
    )
    time = record.start + log.logs[0].sliding.rows / record.fs
    return JointPrediction(error, simple, time, log.torque, predicted)
