"""The regression of a joint's torque: which of its terms a log tells, of one log or of several together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.cycle.joint_data import JointData, joint_data, pooled, turning
from stickslip.cycle.regression import TURNING, UNITS
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import NORMAL_95, Constant, Doubt, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.statistics import LeastSquares, least_squares

Array = NDArray[np.float64]

ROUNDS = 25  # of the regression about a load part: six are enough where the log tells it
SETTLED = 1e-6  # of the load part between two rounds
STARTS = (0.0, 0.3)  # of the load part: from none alone one joint in a hundred ended where gravity has the wrong sign
SURELY = 4.0  # deviations, by which the viscous friction of both directions differs: chance gives that once in 15000
BARELY = 0.5  # of a value: an interval that is wider on either side hardly tells it
CONFOUNDED = "confounded"  # a kind of doubt
WORDS = {
    "inertia": "inertia", "viscous": "viscous friction", "uneven": "uneven viscous friction",
    "forward": "Coulomb friction forward", "back": "Coulomb friction back",
    "coulomb": "Coulomb friction", "load": "friction per load",
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


Fitted = tuple[LeastSquares, tuple[str, ...], tuple[float, float]]  # with its terms and gravity's sine and cosine part
RICHER = {"load", "uneven"}  # what Coulomb and viscous friction of both directions alike do not have


def fitted(data: JointData) -> tuple[LeastSquares, tuple[str, ...], tuple[float, float], tuple[str, ...]]:
    """The regression, with viscous friction of each direction where these differ surely."""
    fit, terms, pull, left_out = _separable(data)
    try:
        richer = (*terms, "uneven")
        fit_both, pull_both = about_load(data, richer)
    except EstimateError:
        return fit, terms, pull, left_out
    uneven = fit_both.combined(np.eye(len(richer))[-1], "", "", "")
    sure = abs(uneven.value) > SURELY * uneven.sd
    return (fit_both, richer, pull_both, left_out) if sure else (fit, terms, pull, left_out)


def _separable(data: JointData) -> tuple[LeastSquares, tuple[str, ...], tuple[float, float], tuple[str, ...]]:
    """The regression with as many terms as the motion tells apart, and what was left out."""
    terms, left_out = data.terms, list[str]()
    for optional in (*OPTIONAL, ()):
        try:
            fit, pull = about_load(data, terms)
            return fit, terms, pull, tuple(left_out)
        except EstimateError:
            if not set(optional) & set(terms):
                if optional:
                    continue
                raise _inseparable(data, terms) from None
            terms = tuple(term for term in terms if term not in optional)
            left_out.append(f"{' and '.join(WORDS[term] for term in optional)}: {ADVICE[optional[0]]}")
    raise _inseparable(data, terms)


def about_load(data: JointData, terms: tuple[str, ...]) -> tuple[LeastSquares, tuple[float, float]]:
    """The regression, linear about its own load part: of those that settle the one that leaves least."""
    if "load" not in terms:
        fit = _solved(data, terms, 0.0, (0.0, 0.0))
        return fit, _pull(fit, terms)
    settled = [one for start in STARTS if (one := _settled(data, terms, start)) is not None]
    if not settled:
        raise EstimateError(
            "the load part does not settle", "gravity's torque is known while it slides", ADVICE["load"]
        )
    return min(settled, key=lambda one: float(np.linalg.norm(one[0].residual)))


def _settled(data: JointData, terms: tuple[str, ...], start: float) -> tuple[LeastSquares, tuple[float, float]] | None:
    """From a load part that is guessed; gravity's torque is first that of a joint with just so much of it."""
    bare = tuple(term for term in terms if term != "load")
    pull = _pull(_solved(data, bare, 0.0, (0.0, 0.0)), bare)
    for _ in range(2 if start else 0):
        pull = _pull(_solved(data, bare, start, pull), bare)
    share = start
    for _ in range(ROUNDS):
        fit = _solved(data, terms, share, pull)
        before, share, pull = share, float(fit.coefficients[terms.index("load")]), _pull(fit, terms)
        if abs(share - before) < SETTLED:
            return fit, pull
    return None


def _solved(data: JointData, terms: tuple[str, ...], share: float, pull: tuple[float, float]) -> LeastSquares:
    columns = data.columns(terms, share, pull)
    torque = data.torque - data.known
    if "load" in terms:  # linear about `share`: its column stands in gravity's already
        torque = torque + share * columns[:, terms.index("load")]
    instruments = None if not data.followed else data.columns(terms, share, pull, steered=True)
    return least_squares(columns, torque, instruments=instruments)


def _pull(fit: LeastSquares, terms: Sequence[str]) -> tuple[float, float]:
    if "sine" not in terms:
        return 0.0, 0.0
    return float(fit.coefficients[terms.index("sine")]), float(fit.coefficients[terms.index("cosine")])


def _inseparable(data: JointData, terms: tuple[str, ...]) -> EstimateError:
    """Which terms are one column to this motion, by the weakest singular vector of the columns."""
    columns = data.columns(terms, 0.0, (0.0, 0.0))
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


@dataclass(frozen=True)
class Telling:
    """Coefficients and their sums as Estimates."""

    data: JointData
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
        beside = math.hypot(*(float(row @ self.fit.projection @ column) for column in self.data.unsure), 0.0)
        units = {**(TURNING if self.turning else UNITS), "load": "1"}
        kind = {"forward": "coulomb", "back": "coulomb", "sine": "coulomb", "cosine": "coulomb", "damping": "viscous"}
        unit = units[kind.get(next(iter(weights)), next(iter(weights)))]
        how = "instruments of the reference" if self.data.followed else "least squares"
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


# ---- several logs of one joint


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
    forward, back, viscous, load, inertia, sine, cosine, damping : Estimate or None
        As of :class:`JointFriction`, of all logs at once; None where they do not tell it, or where it was stated.
    predictions : tuple of JointPrediction
        Of each log by the others.
    left_out : tuple of str
        What all logs together can not tell, and which motion would.
    status : str
        "ok", or in words what to beware of.
    """

    forward: Estimate
    back: Estimate
    viscous: Estimate
    load: Estimate | None
    inertia: Estimate | None
    sine: Estimate | None
    cosine: Estimate | None
    damping: Estimate | None
    predictions: tuple[JointPrediction, ...]
    left_out: tuple[str, ...]
    status: str = "ok"


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
        `inertia`, `kp`, `kd` and `torque_constant`, as of :func:`regress_joint`.

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
    data = [joint_data(record, gravity, **constants)[1] for record in records]
    if len(data) < 2 or len({(one.source, one.terms) for one in data}) > 1:
        raise RecordError(
            f"{len(data)} log{'s' * (len(data) != 1)}, with torque by {', '.join(one.source for one in data)}",
            "several logs are told together by torques of one source",
            "give two logs or more, of one robot and one kind",
        )
    fit, terms, _, left_out = fitted(pooled(data))
    tell = Telling(pooled(data), fit, terms, turning(records[0]), "ok")
    known = {term: tell.one(term) for term in terms if term != "uneven"}
    predictions = [
        _predicted(log, pooled(data[:place] + data[place + 1 :]), record)
        for place, (log, record) in enumerate(zip(data, records, strict=True))
    ]
    return JointLogs(
        known["forward"].within(0.0), known["back"].within(0.0), known["viscous"],
        load=known.get("load"), inertia=known.get("inertia"), sine=known.get("sine"), cosine=known.get("cosine"),
        damping=known.get("damping"), predictions=tuple(predictions), left_out=left_out,
    )  # fmt: skip


def _predicted(log: JointData, others: JointData, record: Record) -> JointPrediction:
    """A log's torque by the regression of the others, and by a plain one."""
    fit, terms, pull, _ = fitted(others)
    predicted = log.model(fit, terms, pull)
    plain = tuple("coulomb" if term == "forward" else term for term in terms if term not in {*RICHER, "back"})
    fit, pull = about_load(replace(others, terms=plain), plain)
    spread = float(np.linalg.norm(log.torque - log.torque.mean()))
    if spread == 0:
        raise EstimateError("the torque of a log never changes", "a prediction is of a torque", "check its column")
    error, simple = (
        float(np.linalg.norm(log.torque - torque)) / spread for torque in (predicted, log.model(fit, plain, pull))
    )
    time = record.start + log.logs[0].sliding.rows / record.fs
    return JointPrediction(error, simple, time, log.torque, predicted)
