"""Which friction, inertia and gravity explain the torque of a robot's joint, or of a servo axis?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import require_fit
from stickslip.cycle.joint_columns import Sliding, Told, sliding
from stickslip.cycle.regression import TURNING, UNITS
from stickslip.errors import EstimateError, ModelError, RecordError
from stickslip.estimate import NORMAL_95, Constant, Doubt, Estimate, Result, Status
from stickslip.record.record import Record, Step, require_record
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_level
from stickslip.statistics import FEW_INDEPENDENT, LeastSquares, least_squares

Array = NDArray[np.float64]

QUESTION = "the friction of a joint"
LEAST = 200  # samples
ROWS = 20  # instants at which it slides
ROUNDS = 25  # of the regression about a load part: six are enough where the log tells it
SETTLED = 1e-6  # of the load part between two rounds
STARTS = (0.0, 0.3)  # of the load part: from none alone one joint in a hundred ended where gravity has the wrong sign
SURELY = 4.0  # deviations, by which the viscous friction of both directions differs: chance gives that once in 15000
BARELY = 0.5  # of a value: an interval that is wider on either side hardly tells it
BIASED = 0.01  # share of noise in the power of the acceleration above which the inertia is visibly low
WAYS = ((1.0, "forward"), (-1.0, "back"))
CONFOUNDED, NOISY, LOADED = "confounded", "noisy", "loaded"  # kinds of doubt
WORDS = {
    "inertia": "inertia", "viscous": "viscous friction", "uneven": "uneven viscous friction",
    "forward": "Coulomb friction forward", "back": "Coulomb friction back", "load": "friction per load",
    "sine": "gravity, sine part", "cosine": "gravity, cosine part", "damping": "damping of the control loop",
}  # fmt: skip
ADVICE = {
    "inertia": "accelerate harder, by steps or faster swings",
    "viscous": "slide at several speeds, slow ones and fast ones",
    "uneven": "slide at several speeds either way, slow ones and fast ones",
    "forward": "pass the same places both ways, slowly and fast",
    "back": "pass the same places both ways, slowly and fast",
    "load": "carry another payload, or turn farther, so that gravity's torque changes",
    "sine": "turn farther, a quarter turn at least",
    "cosine": "turn farther, a quarter turn at least",
    "damping": "log the torque or the motor's current, or state kd",
}
OPTIONAL: tuple[tuple[str, ...], ...] = (
    ("load",),
    ("sine", "cosine"),
)  # left out in this order where the motion can not tell all of them apart


@dataclass(frozen=True, eq=False, repr=False)
class JointFriction(Result):
    """Friction, inertia and gravity of a joint.

    Attributes
    ----------
    level : Estimate
        Sliding friction [N m] at vanishing speed under the mean load of the log, the mean of both directions.
    forward, back : Estimate
        Coulomb friction either way [N m], without load.
    viscous : Estimate
        Torque per speed [N m s/rad], the mean of both directions.
    viscous_forward, viscous_back : Estimate or None
        Of each direction, where they differ surely.
    load : Estimate or None
        Friction per torque that gravity puts on the joint; None where the log does not tell it.
    inertia : Estimate
        Moment of inertia [kg m^2]; as stated where it was.
    sine, cosine : Estimate or None
        Gravity's torque [N m] over the sine and the cosine of the angle.
    damping : Estimate or None
        Of the control loop [N m s/rad], where it was neither stated nor in the torque: a controller that holds its
        output for a time h damps by kp h / 2 less than its kd says.
    torque : ndarray, shape (n,)
        The motor's torque [N m] at each sample.
    gain : float
        Torque per angle that enters it [N m/rad]: of a controller whose torque is not measured its kp, else 0.
    carried : float
        Mean torque [N m] that gravity puts on the joint while it slides.
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


@dataclass(frozen=True)
class _Asked:
    """What is regressed: the torque at the rows, and what was stated, each with its standard deviation's column."""

    told: Told
    torque: Array
    terms: tuple[str, ...]
    source: str
    raw: Array
    known: Array
    unsure: tuple[Array, ...] = ()
    stated: dict[str, Estimate] = field(default_factory=dict)


def regress_joint(
    record: Record,
    *,
    inertia: Constant | None = None,
    kp: Constant | None = None,
    kd: Constant | None = None,
    torque_constant: Constant | None = None,
    gravity: bool | None = None,
) -> JointFriction:
    r"""Which friction, inertia and gravity explain the torque of a joint?

    While it slides, the torque of the motor is

    .. math:: \tau = J \ddot q + F_v \dot q \pm F_c^\pm + g(q) + \mu\,|g(q)|\,\mathrm{sgn}\,\dot q,\qquad
        g(q) = g_s \sin q + g_c \cos q

    (Swevers, Verdonck and De Schutter 2007, for a joint without load part; friction in proportion to the load is that
    of a gear's teeth). The torque is measured (``force``), that of a current with its constant, or that of the
    controller, :math:`k_p (r - q) + k_d (\dot r - \dot q)`, whose `kd` is regressed too where it is not stated.
    The balance is weighed by windows that lie within a stroke, so that sticking, and friction that differs near rest,
    do not enter, and is solved by least squares; where the log has the reference, its columns are the instruments
    (Gautier, Janot and Vandanjon 2013), so that the noise of the encoder pulls nothing towards zero.
    Intervals hold for correlated residuals, and hold the stated constants' uncertainty.

    Parameters
    ----------
    record : Record
        With ``theta`` [rad] (or ``x`` [m], of an axis that moves straight: its force is then in N) and one of
        ``force``, ``current`` [A] or ``reference``. Delays stated for them are taken out first.
    inertia : float, str, tuple or Estimate, optional
        Moment of inertia [kg m^2]; regressed where it is not stated.
    kp, kd : float, str, tuple or Estimate, optional
        Gains of the controller [N m/rad, N m s/rad], for a log without torque and current.
    torque_constant : float, str, tuple or Estimate, optional
        Torque per current [N m/A], at the joint.
    gravity : bool, optional
        Whether gravity may act: of an angle yes, of a displacement no, where left out.

    Returns
    -------
    JointFriction

    Raises
    ------
    RecordError
        A channel is missing, broken or too short, or the units of torque and motion do not belong together.
    ModelError
        A constant without meaning.
    EstimateError
        No sliding both ways, or columns that the motion does not tell apart: the sentence says which motion would.

    Examples
    --------
    >>> t = np.arange(6000) / 200
    >>> q = 1.2 * np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t)
    >>> v, a = np.gradient(q, 1 / 200), np.gradient(np.gradient(q, 1 / 200), 1 / 200)
    >>> torque = 0.02 * a + 0.03 * v + 0.5 * np.sin(q) + (0.06 + 0.1 * abs(0.5 * np.sin(q))) * np.sign(v)
    >>> torque += np.random.default_rng(0).normal(0, 0.01, t.size)
    >>> found = regress_joint(Record.of({"theta": q, "force": torque}, fs=200, units={"force": "N m"}))
    >>> found.forward.includes(0.06), found.load.includes(0.1), round(found.inertia.value, 3)
    (True, True, 0.02)
    """
    require_record(record)
    constants = _constants(record, inertia=inertia, kp=kp, kd=kd, torque_constant=torque_constant)
    record = _torqued(record, constants)
    asked = _asked(record, constants, _turning(record) if gravity is None else gravity)
    fit, terms, pull, left_out = _fitted(asked)
    return _answer(record, asked, fit, terms, pull, left_out)


def _turning(record: Record) -> bool:
    return "theta" in record or "x" not in record


def _constants(record: Record, **given: Constant | None) -> dict[str, Estimate]:
    """The stated constants, in the units of the motion."""
    torque = "N m" if _turning(record) else "N"
    stiff, damped, heavy = ("N m/rad", "N m s/rad", "kg m^2") if _turning(record) else ("N/m", "N s/m", "kg")
    units = {"inertia": heavy, "kp": stiff, "kd": damped, "torque_constant": f"{torque}/A"}
    stated = {name: Estimate.stated(name, value, units[name]) for name, value in given.items() if value is not None}
    for name, constant in stated.items():
        if constant.value < 0 or (constant.value == 0 and name != "kd") or not math.isfinite(constant.value):
            raise ModelError(
                f"{name} = {constant.value:g} {constant.unit}", f"a joint's {name} is positive", f"correct {name}="
            )
    return stated


def _torqued(record: Record, constants: dict[str, Estimate]) -> Record:
    """The record with a torque, from a current where it has none; delays taken out."""
    position = "theta" if _turning(record) else "x"
    used = [name for name in (position, "reference", "force", "current") if name in record]
    record.require_clean(position, *used, question=QUESTION, samples=LEAST)
    record = without_delays(record, *used, question=QUESTION, samples=LEAST)
    if "force" not in record and "current" in record and "torque_constant" in constants:
        constant = constants["torque_constant"]
        step = Step("regress_joint", {"torque_constant": constant.value}, "torque of the current")
        unit = "N m" if _turning(record) else "N"
        record = record.with_channel(
            "force", constant.value * record["current"], unit=unit, source="current", step=step
        )
    if "force" in record:
        require_fit(record, "force", length="rad" if position == "theta" else "m", question=QUESTION)
        return record
    if not ("reference" in record and "kp" in constants):
        lacks = "the current's torque_constant" if "current" in record else "kp" if "reference" in record else "force"
        raise RecordError(
            f"no torque: the record has {', '.join(record)}, and {lacks} is missing",
            f"{QUESTION} needs a torque: measured, of a current with its constant, or of a controller with its gains",
            "name the column of the torque (force=), give --torque-constant of a current, or --kp with the reference",
        )
    return record


def _asked(record: Record, constants: dict[str, Estimate], gravity: bool) -> _Asked:
    position = record["theta" if _turning(record) else "x"]
    followed = "reference" in record
    reference = record["reference"] if followed else None
    if np.ptp(position) == 0:
        raise EstimateError("the position never changes", f"{QUESTION} needs motion", "check the column")
    slides = sliding(position, record.fs)
    _refuse_still(slides, record)
    told = Told(position, reference, slides)
    window, rows = slides.window, slides.rows
    terms = ["viscous", "forward", "back", *(("sine", "cosine", "load") if gravity else ())]
    known, unsure = np.zeros(len(rows)), []
    if "inertia" in constants:
        column = window.apply(position, 2)[rows]
        known, unsure = known + constants["inertia"].value * column, [constants["inertia"].sd * column]
    else:
        terms.insert(0, "inertia")
    if "force" in record:
        raw = record["force"]
        torque = window.apply(raw)[rows]
        scale = constants.get("torque_constant") if record.channels["force"].source == "current" else None
        source = "current" if scale else "force"
    else:
        assert reference is not None
        scale, source = constants["kp"], "reference"
        raw = scale.value * (reference - position)
        torque = window.apply(raw)[rows]
        if "kd" in constants:
            rate = window.apply(reference - position, 1)[rows]
            raw = raw + constants["kd"].value * window.apply(reference - position, 1)
            torque, unsure = torque + constants["kd"].value * rate, [*unsure, constants["kd"].sd * rate]
        else:
            terms.append("damping")
    if scale is not None:
        unsure.append(scale.sd / scale.value * torque)
    gain_sd = max((record.channels[name].gain_sd for name in ("force", "current") if name in record), default=0.0)
    unsure.append(gain_sd * torque)
    moving = tuple(column for column in unsure if np.any(column))
    return _Asked(told, torque, tuple(terms), source, np.asarray(raw), known, moving, constants)


def _refuse_still(slides: Sliding, record: Record) -> None:
    """Refuse a log that does not slide both ways for long enough."""
    ways = [int(np.sum(slides.side[slides.rows] == side)) for side in (1, -1)]
    if min(ways) >= ROWS // 2 and sum(ways) >= ROWS:
        return
    raise EstimateError(
        f"it slides steadily faster than {slides.slowest:.2g} rad/s at {ways[0]} instants forward and {ways[1]} back",
        f"friction is told from gravity by strokes both ways, {ROWS // 2} instants each at least",
        "swing it back and forth, farther or faster, through the same places",
    )


def _fitted(asked: _Asked) -> tuple[LeastSquares, tuple[str, ...], tuple[float, float], tuple[str, ...]]:
    """The regression, with viscous friction of each direction where these differ surely."""
    fit, terms, pull, left_out = _separable(asked)
    try:
        richer = (*terms, "uneven")
        fit_both, pull_both = _about_load(asked, richer)
    except EstimateError:
        return fit, terms, pull, left_out
    uneven = fit_both.combined(np.eye(len(richer))[-1], "", "", "")
    sure = abs(uneven.value) > SURELY * uneven.sd
    return (fit_both, richer, pull_both, left_out) if sure else (fit, terms, pull, left_out)


def _separable(asked: _Asked) -> tuple[LeastSquares, tuple[str, ...], tuple[float, float], tuple[str, ...]]:
    """The regression with as many terms as the motion tells apart, and what was left out."""
    terms, left_out = asked.terms, list[str]()
    for optional in (*OPTIONAL, ()):
        try:
            fit, pull = _about_load(asked, terms)
            return fit, terms, pull, tuple(left_out)
        except EstimateError:
            if not set(optional) & set(terms):
                if optional:
                    continue
                raise _inseparable(asked, terms) from None
            terms = tuple(term for term in terms if term not in optional)
            left_out.append(f"{' and '.join(WORDS[term] for term in optional)}: {ADVICE[optional[0]]}")
    raise _inseparable(asked, terms)


def _about_load(asked: _Asked, terms: tuple[str, ...]) -> tuple[LeastSquares, tuple[float, float]]:
    """The regression, linear about its own load part: of those that settle the one that leaves least."""
    if "load" not in terms:
        fit = _solved(asked, terms, 0.0, (0.0, 0.0))
        return fit, _pull(fit, terms)
    settled = [one for start in STARTS if (one := _settled(asked, terms, start)) is not None]
    if not settled:
        raise EstimateError(
            "the load part does not settle", "gravity's torque is known while it slides", ADVICE["load"]
        )
    return min(settled, key=lambda one: float(np.linalg.norm(one[0].residual)))


def _settled(asked: _Asked, terms: tuple[str, ...], start: float) -> tuple[LeastSquares, tuple[float, float]] | None:
    """From a load part that is guessed; gravity's torque is first that of a joint with just so much of it."""
    bare = tuple(term for term in terms if term != "load")
    pull = _pull(_solved(asked, bare, 0.0, (0.0, 0.0)), bare)
    for _ in range(2 if start else 0):
        pull = _pull(_solved(asked, bare, start, pull), bare)
    share = start
    for _ in range(ROUNDS):
        fit = _solved(asked, terms, share, pull)
        before, share, pull = share, float(fit.coefficients[terms.index("load")]), _pull(fit, terms)
        if abs(share - before) < SETTLED:
            return fit, pull
    return None


def _solved(asked: _Asked, terms: tuple[str, ...], share: float, pull: tuple[float, float]) -> LeastSquares:
    columns = asked.told.columns(terms, share, pull)
    data = asked.torque - asked.known
    if "load" in terms:  # linear about `share`: its column stands in gravity's already
        data = data + share * columns[:, terms.index("load")]
    instruments = None if asked.told.reference is None else asked.told.columns(terms, share, pull, told=True)
    return least_squares(columns, data, instruments=instruments)


def _pull(fit: LeastSquares, terms: Sequence[str]) -> tuple[float, float]:
    if "sine" not in terms:
        return 0.0, 0.0
    return float(fit.coefficients[terms.index("sine")]), float(fit.coefficients[terms.index("cosine")])


def _inseparable(asked: _Asked, terms: tuple[str, ...]) -> EstimateError:
    """Which terms are one column to this motion, by the weakest singular vector of the columns."""
    columns = asked.told.columns(terms, 0.0, (0.0, 0.0))
    lengths = np.linalg.norm(columns, axis=0)
    if not np.all(lengths > 0):
        mixed = [term for term, length in zip(terms, lengths, strict=True) if length == 0]
    else:
        weakest = np.abs(np.linalg.svd(columns / lengths)[2][-1])
        mixed = [term for term, weight in zip(terms, weakest, strict=True) if weight > 0.3 * weakest.max()]
    return EstimateError(
        f"{' and '.join(WORDS[term] for term in mixed)} can not be told apart in this log",
        "every term needs motion that shows it alone",
        "; ".join(dict.fromkeys(ADVICE[term] for term in mixed)),
    )


# ---- the answer


def _answer(
    record: Record, asked: _Asked, fit: LeastSquares, terms: tuple[str, ...], pull: tuple[float, float],
    left_out: tuple[str, ...],
) -> JointFriction:  # fmt: skip
    slides = asked.told.sliding
    rows, window = slides.rows, slides.window
    carried = _carried(asked, pull)
    status = Status(*_worries(asked, fit, terms, record))
    tell = _Telling(asked, fit, terms, _turning(record), status)
    known = {term: tell.one(term) for term in terms if term != "uneven"}
    if "load" in known:
        known["load"] = known["load"].within(0.0)
    forward, back = known["forward"].within(0.0), known["back"].within(0.0)
    level = _level(tell, pull, known.get("load"))
    ways: list[Estimate | None] = [None, None]
    if "uneven" in terms:
        ways = [tell.sum({"viscous": 1, "uneven": by}, f"viscous friction {way}") for by, way in WAYS]
    inertia = replace(asked.stated["inertia"], name="inertia") if "inertia" in asked.stated else known["inertia"]
    speed, acceleration = (window.apply(asked.told.position, order)[rows] for order in (1, 2))
    weight = pull[0] * window.apply(np.sin(asked.told.position))[rows]
    weight += pull[1] * window.apply(np.cos(asked.told.position))[rows]
    damped = known["damping"].value * _error_rate(asked) if "damping" in known else np.zeros(len(asked.raw))
    return JointFriction(
        level=level.within(0.0), forward=forward, back=back, viscous=known["viscous"], viscous_forward=ways[0],
        viscous_back=ways[1], load=known.get("load"),
        inertia=inertia.within(0.0), sine=known.get("sine"), cosine=known.get("cosine"), damping=known.get("damping"),
        torque=asked.raw + damped, gain=asked.stated["kp"].value if asked.source == "reference" else 0.0,
        carried=carried, residual=float(np.linalg.norm(fit.residual) / np.linalg.norm(asked.torque)),
        condition=fit.condition, time=record.start + rows / record.fs, speed=speed, measured=asked.torque,
        explained=asked.torque - fit.residual,
        friction=asked.torque + damped[rows] - inertia.value * acceleration - weight,
        left_out=left_out, source=asked.source, status=status,
    )  # fmt: skip


def _carried(asked: _Asked, pull: tuple[float, float]) -> float:
    """Mean size of gravity's torque while it slides."""
    place = asked.told.position[asked.told.sliding.rows]
    return float(np.mean(np.abs(pull[0] * np.sin(place) + pull[1] * np.cos(place))))


def _level(tell: _Telling, pull: tuple[float, float], load: Estimate | None) -> Estimate:
    """Sliding friction under the mean load, which gravity's torque is part of, so that it is as unsure as that too."""
    weights = {"forward": 0.5, "back": 0.5}
    if load is None or not load.known:
        return tell.sum(weights, "sliding friction")
    place = tell.asked.told.position[tell.asked.told.sliding.rows]
    side = np.sign(pull[0] * np.sin(place) + pull[1] * np.cos(place))
    carried, share = _carried(tell.asked, pull), load.value
    weights |= {"load": carried, "sine": share * float(np.mean(side * np.sin(place)))}
    level = tell.sum(weights | {"cosine": share * float(np.mean(side * np.cos(place)))}, "sliding friction")
    more = share * carried  # its product counts twice in a sum of both factors
    low, high = level.interval
    return replace(level, value=level.value - more, interval=(low - more, high - more))


def _error_rate(asked: _Asked) -> Array:
    """How the error of the position changes."""
    assert asked.told.reference is not None
    return asked.told.sliding.window.apply(asked.told.reference - asked.told.position, 1)


@dataclass(frozen=True)
class _Telling:
    """Coefficients and their sums as Estimates."""

    asked: _Asked
    fit: LeastSquares
    terms: tuple[str, ...]
    turning: bool
    status: str

    def one(self, term: str) -> Estimate:
        """A coefficient, with a doubt where its interval hardly tells it."""
        estimate = self.sum({term: 1.0}, WORDS[term])
        wide = NORMAL_95 * estimate.sd > BARELY * abs(estimate.value)
        if not wide:
            return estimate
        partner = self._partner(self.terms.index(term))
        doubt = Doubt(f"hardly told from the {WORDS[partner]}: {ADVICE[term]}", CONFOUNDED, lesser=True)
        return replace(estimate, status=Status(self.status, doubt))

    def sum(self, weights: dict[str, float], name: str) -> Estimate:
        """A sum of coefficients."""
        row = np.array([weights.get(term, 0.0) for term in self.terms])
        beside = math.hypot(*(float(row @ self.fit.projection @ column) for column in self.asked.unsure), 0.0)
        units = {**(TURNING if self.turning else UNITS), "load": "1"}
        kind = {"forward": "coulomb", "back": "coulomb", "sine": "coulomb", "cosine": "coulomb", "damping": "viscous"}
        unit = units[kind.get(next(iter(weights)), next(iter(weights)))]
        how = "instruments of the reference" if self.asked.told.reference is not None else "least squares"
        checks = (
            f"condition number {self.fit.condition:.3g}",
            f"residuals are worth {self.fit.independent:.0f} independent samples",
        )
        return self.fit.combined(
            row, name, unit, f"{how}, windows within strokes", beside=beside, status=self.status, checks=checks
        )

    def _partner(self, index: int) -> str:
        """The term whose coefficient goes with this one most."""
        forms = self.fit.projection
        alike = np.abs(forms @ forms[index]) / np.linalg.norm(forms, axis=1)
        alike[index] = -1.0
        return self.terms[int(np.argmax(alike))]


def _worries(asked: _Asked, fit: LeastSquares, terms: tuple[str, ...], record: Record) -> list[Doubt | str]:
    worries: list[Doubt | str] = []
    if "load" in asked.terms and "load" not in terms:
        worries.append(
            Doubt(f"friction may grow with the load, which this log does not tell: {ADVICE['load']}", LOADED)
        )
    if fit.independent < FEW_INDEPENDENT * len(terms):
        worries.append(f"only {fit.independent:.0f} independent samples for {len(terms)} coefficients")
    if asked.told.reference is None and "inertia" in terms:
        window, rows = asked.told.sliding.window, asked.told.sliding.rows
        column = window.apply(asked.told.position, 2)[rows]
        noise = noise_level(asked.told.position, record.fs) * window.noise_of_acceleration
        noisy = float(noise**2 / np.mean(column**2))
        if noisy > BIASED:
            words = f"noise in the acceleration lowers the inertia by about {100 * noisy:.2g} %: log the reference too"
            worries.append(Doubt(words, NOISY))
    return worries
