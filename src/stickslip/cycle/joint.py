"""Which friction, inertia and gravity explain the torque of a robot's joint, or of a servo axis?"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.cycle.joint_fall import (
    FALL,
    Fall,
    Misfit,
    bends,
    borne_by_teeth,
    damps_error,
    falling,
    feasible,
    loaded,
    misfits,
    possible,
    too_early,
    worries,
)
from stickslip.cycle.joint_fit import (
    ADVICE,
    LOOP,
    SURELY,
    WARM,
    WORDS,
    JointData,
    about_load,
    coefficient,
    cogged,
    damped,
    fitted,
    joint_data,
    punctual,
    seating,
    turning,
    warmed,
)
from stickslip.cycle.joint_slides import COGS
from stickslip.cycle.regression import TURNING, UNITS
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Constant, Doubt, Estimate, Result, Status, stands
from stickslip.record.record import Record
from stickslip.signals.noise import noise_level
from stickslip.statistics import LeastSquares, mixture

LATEST = 0.1  # s that a torque may be late
# Times the power of noise in the torque's rate: noise alone had 0.9 to 1.2 on 10 logs, 41 others 1.4 at least.
HEARD = 1.5
STRAYS = 1.6  # times its chance that a delay strays: so it did on 60 joints of 15 ms, seeds 70100 to 70225
# Deviations by which a torque is surely too early for the motion that it makes: of 33 joints without play none came to
# 1.7, of 15 with play that was not stated four to more (seeds 300 to 325 of tests/joints.py, which set it).
EARLY = 2.5
NEARER, NEAR = 8, 1e-3  # steps towards the delay, and the last one's size in samples
WAYS = ((1.0, "forward"), (-1.0, "back"))
CONFOUNDED, SHIFTED = "confounded", "shifted"  # kinds of doubt
BARELY = 0.5  # of a value: an interval that is wider on either side hardly tells it
PERHAPS = ("load", "sine", "cosine", "damping", "warming", "thinning")  # terms that not every log tells
LAWS = ("M1", "M2", "M3", "M4", "M5", "M6")
RICHER = {"load", "uneven", *WARM}  # what Coulomb and viscous friction of both directions alike do not have


@dataclass(frozen=True, eq=False, repr=False)
class JointFriction(Result):
    """Friction, inertia and gravity of a joint.

    Attributes
    ----------
    level : Estimate
        Sliding friction [N m] at vanishing speed under the mean load of the log, the mean of both directions; of
        friction that falls with the speed the kinetic part of it.
    forward, back : Estimate
        Coulomb friction either way [N m], without load.
    viscous : Estimate
        Torque per speed [N m s/rad], the mean of both directions.
    viscous_forward, viscous_back : Estimate or None
        Of each direction, where they differ surely.
    load : Estimate or None
        Friction per torque that gravity puts on the joint, or its teeth bear; None where the log does not tell it.
    inertia : Estimate
        Moment of inertia [kg m^2]; as stated where it was.
    sine, cosine : Estimate or None
        Gravity's torque [N m] over the sine and the cosine of the angle.
    damping : Estimate or None
        Of the control loop [N m s/rad], where it was neither stated nor in the torque: a controller that holds its
        output for a time h damps by kp h / 2 less than its kd says.
    warming, thinning : Estimate or None
        By how much Coulomb friction [N m/K] and viscous friction [N m s/rad/K] grow per kelvin, negative where they
        fall; None where no temperature was logged, or it hardly changes.
    temperature : float or None
        Mean of the log while it slides [K], at which all friction is told.
    torque : ndarray, shape (n,)
        The motor's torque [N m] at each sample.
    gain : float
        Torque per angle that enters it [N m/rad]: of a controller whose torque is not measured its kp, else 0.
    carried : float
        Mean of that torque [N m] while it slides.
    residual : float
        Norm of what is left over the norm of the torque.
    condition : float
        Condition number of the columns against their instruments.
    time, speed, measured, explained : ndarray, shape (m,)
        Time [s] and speed [rad/s] of each instant at which it slides, the smoothed torque there, and what is made of
        it.
    friction : ndarray, shape (m,)
        The torque less inertia and gravity, smoothed as that.
    left_out : tuple of str
        What the motion can not tell, and which motion would.
    source : str
        "force", "current", or "reference" where the torque is that of the stated controller.
    status : str
        "ok", or in words what to beware of.
    static, stribeck_speed : Estimate or None
        Of friction that falls with the speed: the mean of both directions at rest under the mean load [N m], and the
        speed within which it falls to `level` [rad/s]; None where no fall is surely there.
    exponent : float or None
        Of that Stribeck curve, the likeliest; the intervals count 1, 1.5 and 2.
    delay : Estimate or None
        By how much the measured torque comes later [s] than the position, or a controller's than the error that it is
        made of; taken out where it is surely there. None where the motion does not tell it.
    stated : mapping of str to Estimate
        The constants that were stated, by name.
    cogging : Estimate or None
        Amplitude of a torque that goes up and down along the way [N m], as a motor's teeth make it; None where none is
        surely there.
    waves : (float, float)
        How often it does in a radian, and its phase [rad].
    moving : mapping of str to float
        What the numbers are all together where none is below zero, by which the joint can be moved: each by itself may
        lie beyond what the others allow. Empty where they are as told.
    by_teeth : bool
        Whether friction surely grows with what a gear's teeth bear, the mean of the motor's torque and of gravity's.
    """

    level: Estimate
    forward: Estimate
    back: Estimate
    viscous: Estimate
    viscous_forward: Estimate | None
    viscous_back: Estimate | None
    load: Estimate | None
    inertia: Estimate
    sine: Estimate | None
    cosine: Estimate | None
    damping: Estimate | None
    warming: Estimate | None
    thinning: Estimate | None
    temperature: float | None
    torque: Array
    gain: float
    carried: float
    residual: float
    condition: float
    time: Array
    speed: Array
    measured: Array
    explained: Array
    friction: Array
    left_out: tuple[str, ...]
    source: str
    status: str
    static: Estimate | None = None
    stribeck_speed: Estimate | None = None
    exponent: float | None = None
    delay: Estimate | None = None
    stated: Mapping[str, Estimate] = field(default_factory=dict)
    cogging: Estimate | None = None
    waves: tuple[float, float] = (0.0, 0.0)
    moving: Mapping[str, float] = field(default_factory=dict)
    by_teeth: bool = False

    @property
    def laws(self) -> tuple[str, ...]:
        """Which of the laws M1 to M6 of servos (Duclusaud and others 2024, arXiv:2410.08650) the log leaves possible.

        M1 is Coulomb and viscous friction, M2 falls with the speed too, M3 grows with the load, M4 to M6 do both. Any
        that has not what is surely there is denied; of the others a log tells only by how little they differ.
        """
        load, falls = self.load, self.static is not None
        grows = load is not None and load.known and stands(load.status) and load.value > SURELY * load.sd
        denied = {"M1": grows or falls, "M2": grows, "M3": falls}
        return tuple(law for law in LAWS if not denied.get(law, False))

    def cogs(self, position: Array) -> Array:
        """The torque [N m] that goes up and down along the way, at positions."""
        size = 0.0 if self.cogging is None else self.cogging.value
        return np.asarray(size * np.sin(2 * np.pi * self.waves[0] * position + self.waves[1]))

    def weight(self, position: Array) -> Array:
        """Gravity's torque [N m] at positions."""
        if self.sine is None or self.cosine is None:
            return np.zeros_like(position)
        return np.asarray(self.sine.value * np.sin(position) + self.cosine.value * np.cos(position))

    def sliding_at(self, place: float) -> float:
        """Sliding friction [N m] at vanishing speed, at a place."""
        share = 0.0 if self.load is None or not self.load.known else self.load.value
        carried = abs(float(self.weight(np.array([place]))[0]))
        return self.level.value + share * (carried - self.carried)


def regress_joint(
    record: Record,
    *,
    inertia: Constant | None = None,
    kp: Constant | None = None,
    kd: Constant | None = None,
    torque_constant: Constant | None = None,
    gravity: bool | None = None,
    play: Constant | None = None,
) -> JointFriction:
    r"""Which friction, inertia and gravity explain the torque of a joint?

    While it slides, the torque of the motor is

    .. math:: \tau = J \ddot q + F_v \dot q \pm F_c^\pm + g(q) + \mu\,|g(q)|\,\mathrm{sgn}\,\dot q,\qquad
        g(q) = g_s \sin q + g_c \cos q

    (Swevers, Verdonck and De Schutter 2007, for a joint without load part; friction in proportion to the load is that
    of a gear's teeth; where what these bear, :math:`|\tau + g| / 2`, surely explains it better, it stands in place of
    :math:`|g|`). The torque is measured (``force``), that of a current with its constant, or that of the
    controller, :math:`k_p e(t - d) + k_d \dot e(t - d)` of its error :math:`e = r - q`, whose `kd` is regressed too
    where it is not stated, and its delay d: what controllers usually have of that, 1 ms to 2 ms, is known beforehand.
    The balance is weighed by windows that lie within a stroke, so that sticking, and friction that differs near rest,
    do not enter, and is solved by least squares; where the log has the reference, its columns are the instruments
    (Gautier, Janot and Vandanjon 2013), so that the noise of the encoder pulls nothing towards zero; of a log without
    it what the encoder's counts and noise add to the power of the columns is taken off (Fuller 1987).
    Intervals hold for correlated residuals, and hold the stated constants' uncertainty. Where the motor has an encoder
    of its own, inertia and viscous friction go with the mean of both motions, :math:`(q_m/N + q)/2`, which part where
    teeth with play change sides; that nobody knows which share of them is the motor's is in the intervals. Where the
    temperature T of the joint was logged, Coulomb and viscous friction are straight lines over it,
    :math:`F_c + b (T - \bar T)` and :math:`F_v + b_v (T - \bar T)`.

    Where friction surely falls with the speed, :math:`(F_s - F_c)\,e^{-(|\dot q|/v_s)^\delta}\,\mathrm{sgn}\,\dot q`
    stands beside (Stribeck's curve; Armstrong-Helouvry, Dupont and Canudas de Wit 1994), and every number is the mean
    over all curves that the log allows, each by its likelihood. Friction that surely bends otherwise bears a doubt. So
    does what changes along the way, as what is left in two halves of the log repeats with the place (by Fisher's z,
    1921); the intervals count it.

    Parameters
    ----------
    record : Record
        With ``theta`` [rad] (or ``x`` [m], of an axis that moves straight: its force is then in N) and one of
        ``force``, ``current`` [A] or ``reference``; with ``motor``, the angle before the gear in any unit, it is that
        of the link; with ``temperature`` [K], friction is told over it; with ``bodies`` [N m], what a robot's bodies
        take of the torque is taken off. Delays stated for them are taken out first.
    inertia : float, str, tuple or Estimate, optional
        Moment of inertia [kg m^2]; regressed where it is not stated.
    kp, kd : float, str, tuple or Estimate, optional
        Gains of the controller [N m/rad, N m s/rad], for a log without torque and current.
    torque_constant : float, str, tuple or Estimate, optional
        Torque per current [N m/A], at the joint.
    gravity : bool, optional
        Whether gravity may act: of an angle yes, of a displacement or beside `bodies` no, where left out.
    play : float, str, tuple or Estimate, optional
        Of the teeth between the encoder and the link [rad], where the motor alone has an encoder: while the motor
        crosses it the link is left out of the balance, and gravity acts half of it beside.

    Returns
    -------
    JointFriction

    Raises
    ------
    RecordError
        A channel is missing, broken or too short, or the units of torque and motion do not belong together.
    ModelError
        A constant without meaning, gravity of an axis that moves straight, or play that two encoders tell.
    EstimateError
        No sliding both ways, or columns that the motion does not tell apart: the sentence says which motion would.

    Examples
    --------
    >>> t = np.arange(6000) / 200
    >>> q = 1.2 * np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t)
    >>> v, a = np.gradient(q, 1 / 200), np.gradient(np.gradient(q, 1 / 200), 1 / 200)
    >>> torque = 0.02 * a + 0.03 * v + 0.5 * np.sin(q) + (0.06 + 0.1 * abs(0.5 * np.sin(q))) * np.sign(v)
    >>> torque += np.random.default_rng(0).normal(0, 0.01, t.size)
    >>> regression = regress_joint(Record.of({"theta": q, "force": torque}, fs=200, units={"force": "N m"}))
    >>> regression.forward.includes(0.06), regression.load.includes(0.1), round(regression.inertia.value, 3)
    (True, True, 0.02)
    """
    given = {"inertia": inertia, "kp": kp, "kd": kd, "torque_constant": torque_constant, "play": play}
    teeth = seating(record, gravity, **given)
    record, data = joint_data(record, gravity, False, teeth, **given)
    (data,) = cogged(warmed([data]))
    delay = delay_of(data)
    data = punctual(data, delay)
    data = loaded(data)
    fit, terms, pull, left_out = fitted(data)
    (slow,) = warmed([joint_data(record, gravity, True, teeth, **given)[1]])
    slow = punctual(slow.alike(data), delay)
    slow = slow if data.by_gravity else borne_by_teeth(slow, fit, terms, pull)
    bent = bends(slow, fit, terms, pull)
    fall = falling(slow, fit, terms, pull) if bent else None
    data = slow if fall else data
    if delay is None:
        left_out = (*left_out, f"{WORDS['lag' if data.source == 'reference' else 'late']}: {ADVICE['late']}")
    if fall is not None:
        fit, terms, pull = fall.fits[fall.best], fall.terms, fall.pull
    beside = misfits(data, fit, terms, bent and fall is None, turning(record), delay)
    answer = _answer(record, data, fit, terms, pull, left_out, fall, beside)
    return replace(answer, delay=possible(delay, data.source))


def delay_of(data: JointData) -> Estimate | None:
    """By how much a torque comes late, measured or a controller's; None where the motion can not tell.

    A torque that was filtered, or logged after the position, passes for friction that grows with the load. A controller
    that holds its output, computes for a while and is heard late damps less, and by what its damping lags its joint
    seems to be lighter. The delay is where its own column of the balance, :math:`-d\\,\\dot\\tau`, has nothing left to
    explain.
    """
    fs = data.logs[0].sliding.window.fs
    bare = tuple(term for term in data.terms if term not in RICHER)
    loop = data.source == "reference"

    def left(count: int) -> float:
        return float(np.linalg.norm(about_load(data.earlier(count / fs), bare)[0].residual))

    def beside(there: JointData) -> tuple[LeastSquares, tuple[str, ...]]:
        """The balance with what is left of a delay: without a load part where that does not settle beside it."""
        try:
            return about_load(there, (*data.terms, "late"))[0], (*data.terms, "late")
        except EstimateError:
            return about_load(there, (*bare, "late"))[0], (*bare, "late")

    most = int(LATEST * fs)
    counts = [0, *(sign * 2**k for k in range(most.bit_length()) for sign in (1, -1))]
    try:
        late = LOOP[0] if loop else min(counts, key=left) / fs
        there = damped(data.earlier(late), late)
        for _ in range(NEARER):
            fit, terms = beside(there)
            step = coefficient(fit, terms, "late")
            late += min(max(step, -LATEST), LATEST)
            there = damped(data.earlier(late), late, coefficient(fit, terms, "damping"))
            if abs(step) < NEAR / fs:
                break
    except EstimateError:  # what else it can not tell is said where nothing is asked of a delay
        return None
    if not loop and not _heard(data.earlier(late), fit, terms):
        return None
    name, strays = (WORDS["lag"], 1.0) if loop else (WORDS["late"], STRAYS)
    sd = math.hypot(strays * Telling(data, fit, terms, True, "ok", ()).sum({"late": 1.0}, name).sd, NEAR / fs)
    late, sd = (late, sd) if abs(late) <= LATEST else (0.0, LATEST)  # beyond that it is some other fault's
    if loop and (sd > LOOP[1] or not damps_error(punctual(data, None), fit, terms)):  # as much is known of any
        return None
    borne = any(log.bodies is not None for log in data.logs)  # friction that grows with their torque passes for that
    early = not (loop or borne) and late + 1 / fs < -EARLY * sd  # what is set at a sample and held is early by half
    status = Status(too_early(-late, "play" in data.stated)) if early else Status()
    return Estimate.normal(name, late, sd=sd, unit="s", method="the balance of torque, read later", status=status)


def _heard(data: JointData, fit: LeastSquares, terms: tuple[str, ...]) -> bool:
    """Whether the torque changes, beside what the other terms explain of that, by more than its noise makes of it."""
    columns = data.columns(terms, coefficient(fit, terms, "load"), (0.0, 0.0))
    others, late = columns[:, :-1], columns[:, -1]
    beside = late - others @ np.linalg.lstsq(others, late, rcond=None)[0]
    torques = [(log.torque, log.sliding.window) for log in data.logs if log.torque is not None and log.sliding.window]
    noises = [noise_level(torque, window.fs) * window.noise_of_derivative(1) for torque, window in torques]
    return float(np.mean(beside**2)) > HEARD * float(np.mean(np.square(noises)))


def is_wide(estimate: Estimate) -> bool:
    """Whether its interval hardly tells it."""
    return NORMAL_95 * estimate.sd > BARELY * abs(estimate.value)


def _answer(
    record: Record,
    data: JointData,
    fit: LeastSquares,
    terms: tuple[str, ...],
    pull: tuple[float, float],
    left_out: tuple[str, ...],
    fall: Fall | None,
    beside: tuple[Misfit, ...],
) -> JointFriction:
    status = Status(*worries(data, fit, terms))
    tell = Telling(data, fit, terms, turning(record), status, beside)
    if fall is not None:
        tell = Averaged(data, fit, terms, turning(record), status, beside, fall)
    known = {term: tell.one(term) for term in terms if term not in ("uneven", *FALL, *COGS)}
    if "load" in known:
        known["load"] = known["load"].within(0.0)
    forward, back = tell.ways()
    level = _level(tell, pull, known.get("load"))
    moving = feasible(data, terms) if fall is None else {}
    ways: list[Estimate | None] = [None, None]
    if "uneven" in terms:
        ways = [tell.sum({"viscous": 1, "uneven": by}, f"viscous friction {way}") for by, way in WAYS]
    inertia = replace(data.stated["inertia"], name="inertia") if "inertia" in data.stated else known["inertia"]
    perhaps: dict[str, Any] = {name: known.get(name) for name in PERHAPS}
    damped = np.zeros(len(data.raw))
    if "damping" in known and (log := data.logs[0]).reference is not None:
        damped = known["damping"].value * log.sliding.window.apply(log.reference - log.position, 1)
    return JointFriction(
        level=level.within(0.0),
        forward=forward,
        back=back,
        viscous=known["viscous"],
        viscous_forward=ways[0],
        viscous_back=ways[1],
        **perhaps,
        inertia=inertia.within(0.0),
        temperature=data.logs[0].about if "warming" in known else None,
        torque=data.raw + damped,
        gain=data.stated["kp"].value if data.source == "reference" else 0.0,
        carried=_carried(data, pull),
        residual=float(np.linalg.norm(fit.residual) / np.linalg.norm(data.torque)),
        condition=fit.condition,
        left_out=left_out,
        source=data.source,
        stated=data.stated,
        status=status,
        moving=moving,
        by_teeth=not data.by_gravity and "load" in terms,
        **_rows(record, data, fit, terms, pull, inertia.value, damped),
        **_stribeck(tell, fall, pull, known.get("load")),
        **_cogging(tell),
    )


def _rows(
    record: Record,
    data: JointData,
    fit: LeastSquares,
    terms: tuple[str, ...],
    pull: tuple[float, float],
    inertia: float,
    damped: Array,
) -> dict[str, Any]:
    """Speed, torque and friction wherever it slides."""
    slides, position = data.logs[0].sliding, data.logs[0].link
    speed, acceleration = (slides.at(data.logs[0].turned, order) for order in (1, 2))
    weight = pull[0] * slides.at(np.sin(position)) + pull[1] * slides.at(np.cos(position))
    if COGS[0] in terms:
        weight = weight + data.columns(COGS, 0.0, (0.0, 0.0)) @ [coefficient(fit, terms, term) for term in COGS]
    if "bodies" in record:
        weight = weight + slides.at(record["bodies"])
    return {
        "time": record.start + slides.rows / record.fs,
        "speed": speed / slides.weights,
        "measured": data.torque / slides.weights,
        "explained": (data.torque - fit.residual) / slides.weights,
        "friction": (data.torque - inertia * acceleration - weight) / slides.weights + damped[slides.rows],
    }


def _stribeck(tell: Telling, fall: Fall | None, pull: tuple[float, float], load: Estimate | None) -> dict[str, Any]:
    """What is told of friction that falls: at rest, and within which speed."""
    if fall is None:
        return {}
    unit = "rad/s" if tell.turning else "m/s"
    speed = fall.speed("Stribeck speed", unit)
    static = _level(tell, pull, load, rest=True).within(0.0)
    if is_wide(static):
        unseen = Doubt(f"the log slides too fast to tell it: {ADVICE[FALL[0]]}", CONFOUNDED, lesser=True)
        static = replace(static, status=Status(static.status, unseen))
    return {"static": static, "stribeck_speed": speed, "exponent": fall.exponent}


def _cogging(tell: Telling) -> dict[str, Any]:
    """What is told of a torque that goes up and down along the way."""
    if COGS[0] not in tell.terms:
        return {}
    sine, cosine, grows, turns = (coefficient(tell.fit, tell.terms, term) for term in COGS)
    phase, (waves, middle) = math.atan2(cosine, sine), tell.data.logs[0].cogs
    waves += (sine * turns - cosine * grows) / (sine**2 + cosine**2) / (2 * math.pi)
    weights = dict(zip(COGS, (math.cos(phase), math.sin(phase)), strict=False))
    size = tell.sum(weights, "cogging torque" if tell.turning else "cogging force")
    return {"cogging": size, "waves": (waves, phase - 2 * math.pi * waves * middle)}


def _carried(data: JointData, pull: tuple[float, float]) -> float:
    """Mean size of what the teeth bear, or of gravity's torque, while it slides."""
    slides, borne = data.logs[0].sliding, data.logs[0].borne
    if borne is not None:
        return float(np.mean(np.abs(borne[0] / slides.weights)))
    place = data.logs[0].link[slides.rows]
    return float(np.mean(np.abs(pull[0] * np.sin(place) + pull[1] * np.cos(place))))


def _level(tell: Telling, pull: tuple[float, float], load: Estimate | None, *, rest: bool = False) -> Estimate:
    """Sliding friction under the mean load, which gravity's torque is part of, so that it is as unsure as that too."""
    name, weights = "friction at rest" if rest else "sliding friction", {"forward": 0.5, "back": 0.5}
    if rest:
        weights[FALL[0]] = 1.0
    if load is None or not load.known:
        return tell.sum(weights, name)
    if not tell.data.by_gravity:
        return tell.sum(weights | {"load": _carried(tell.data, pull)}, name)
    place = tell.data.logs[0].link[tell.data.logs[0].sliding.rows]
    side = np.sign(pull[0] * np.sin(place) + pull[1] * np.cos(place))
    carried, share = _carried(tell.data, pull), load.value
    weights |= {"load": carried, "sine": share * float(np.mean(side * np.sin(place)))}
    level = tell.sum(weights | {"cosine": share * float(np.mean(side * np.cos(place)))}, name)
    more = share * carried  # its product counts twice in a sum of both factors
    low, high = level.interval
    return replace(level, value=level.value - more, interval=(low - more, high - more))


@dataclass(frozen=True)
class Telling:
    """Coefficients and their sums as Estimates."""

    data: JointData
    fit: LeastSquares
    terms: tuple[str, ...]
    turning: bool
    status: str
    misfits: tuple[Misfit, ...]

    @cached_property
    def unsure(self) -> tuple[Array, ...]:
        """What the torque is unsure by beside its residuals: by what was stated, and by what nobody stated."""
        stated = self.data.stated.get("inertia")
        inertia = stated.value if stated else coefficient(self.fit, self.terms, "inertia")
        return *self.data.unsure, *self.data.unshared(inertia, coefficient(self.fit, self.terms, "viscous"))

    def one(self, term: str) -> Estimate:
        """A coefficient, with a doubt where its interval hardly tells it."""
        estimate = self.sum({term: 1.0}, WORDS[term])
        if not is_wide(estimate):
            return estimate
        partner = self._partner(self.terms.index(term))
        doubt = Doubt(f"hardly told from the {WORDS[partner]}: {ADVICE[term]}", CONFOUNDED, lesser=True)
        return replace(estimate, status=Status(estimate.status, doubt))

    def ways(self) -> tuple[Estimate, Estimate]:
        """Coulomb friction forward and back, with a doubt where these differ: so does what a zero makes of them."""
        shift = self.sum({"forward": 0.5, "back": -0.5}, "")
        doubts = []
        if abs(shift.value) > SURELY * shift.sd:
            read = "torque" if self.turning else "force"
            what = f"a zero of the {read} that is off by {abs(shift.value):.3g} {shift.unit}"
            doubts = [Doubt(f"{what}, or a constant load, would look the same", SHIFTED, lesser=True)]
        forward, back = (self.one(way).within(0.0) for way in ("forward", "back"))
        forward, back = (replace(side, status=Status(side.status, *doubts)) for side in (forward, back))
        return forward, back

    def sum(self, weights: dict[str, float], name: str) -> Estimate:
        """A sum of coefficients."""
        row = np.array([weights.get(term, 0.0) for term in self.terms])
        form = row @ self.fit.projection
        misfits = [misfit for misfit in self.misfits if set(misfit.terms) & set(weights)]
        strays = [float(np.sqrt(np.mean((misfit.strays @ form) ** 2))) for misfit in misfits if misfit.strays.any()]
        beside = math.hypot(*(float(form @ column) for column in self.unsure), *strays, 0.0)
        heats = ("N m/K", "N m s/rad/K") if self.turning else ("N/K", "N s/m/K")
        heat = dict(zip(("warming", "thinning"), heats, strict=True))
        units = {**(TURNING if self.turning else UNITS), "load": "1", "late": "s", **heat}
        kind = {"forward": "coulomb", "back": "coulomb", "sine": "coulomb", "cosine": "coulomb", "damping": "viscous"}
        kind |= dict.fromkeys(COGS, "coulomb")
        unit = units[kind.get(next(iter(weights)), next(iter(weights)))]
        # a lesser one is less of the mean of both directions alone: any other term may have taken what it is about
        mean = {"forward", "back"} <= set(weights)
        doubts = [replace(misfit.doubt, lesser=misfit.doubt.lesser and mean) for misfit in misfits]
        status = Status(self.status, *doubts)
        how = "instruments of the reference" if self.data.followed else "least squares"
        checks = (
            f"condition number {self.fit.condition:.3g}",
            f"residuals are worth {self.fit.independent:.0f} independent samples",
        )
        method = f"{how}, windows within strokes"
        return self.fit.combined(row, name, unit, method, beside=beside, status=status, checks=checks)

    def _partner(self, index: int) -> str:
        """The term whose coefficient goes with this one most."""
        forms = self.fit.projection
        alike = np.abs(forms @ forms[index]) / np.linalg.norm(forms, axis=1)
        alike[index] = -1.0
        return self.terms[int(np.argmax(alike))]


@dataclass(frozen=True)
class Averaged(Telling):
    """The same over all Stribeck curves that a log allows."""

    fall: Fall

    @cached_property
    def parts(self) -> list[Telling]:
        """What each of them tells."""
        return [Telling(self.data, fit, self.terms, self.turning, self.status, self.misfits) for fit in self.fall.fits]

    def sum(self, weights: dict[str, float], name: str) -> Estimate:
        """A sum of coefficients: that of every curve by its weight."""
        return mixture([part.sum(weights, name) for part in self.parts], self.fall.weights)
