"""The regression of a joint's torque: which of its terms a log tells, of one log or of several together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.cycle.joint_data import JointData
from stickslip.cycle.regression import TURNING, UNITS
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Doubt, Estimate, Status
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
