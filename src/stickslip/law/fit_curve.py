"""Which friction curve, with which numbers, do loops of friction follow; and how does friction grow with the load?"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.cycle.loops import LEAST_SPREAD, Loops
from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import NORMAL_95, Estimate, Result, Status
from stickslip.law import curves
from stickslip.law.data import Samples, require_resisting, require_reversals, require_speeds, samples_of
from stickslip.law.family import Family, Member, best_member, model_error
from stickslip.laws.base import Law
from stickslip.laws.curved import CurvedLaw
from stickslip.parameters import finite
from stickslip.record.record import Record
from stickslip.settings import nearest
from stickslip.statistics import student
from stickslip.units import parse_value

LEAVES = 0.3  # of the friction's norm: more than that is worth a word
MISSES = 0.1  # of the friction that is missed beyond noise and scatter, from which on it does not follow the curve
FILLED = 0.1  # of the samples, that were not measured: more than that is worth a word
LOST = 7.0  # half an interval of a logarithm from which on nothing is known of its number
TIED = 0.99  # correlation of two parameters from which on they are told together alone
ONE_WAY = "motion goes one way: a constant force is not told from friction"
TOO_NOISY = "the friction's noise is above the friction: give more cycles, or a quieter sensor"
NOT_FOLLOWED = "of a curve that the friction does not follow"
OVER_WAY = ("dahl", "jenkins", "iwan", "maxwell")
POSITIVE = ("speed", "exponent", "width", "distance")  # found by their logarithm: so is their interval
NAMES = {
    "kinetic": "sliding friction", "static": "static friction", "viscous": "viscous friction",
    "offset": "constant force", "speed": "Stribeck speed", "exponent": "exponent",
    "kinetic_forward": "sliding friction forward", "kinetic_back": "sliding friction back",
    "viscous_forward": "viscous friction forward", "viscous_back": "viscous friction back",
    "friction": "coefficient of friction", "direct": "direct effect a", "evolution": "evolution effect b",
    "rate_dependence": "rate dependence a - b", "distance": "slip that renews the contact Dc",
}  # fmt: skip
LEAST_REACH = 1.05  # ratio of the largest load to the smallest
LATE = "the line goes below zero, which no friction does: it begins late, or grows by more than the load"
FAR = 0.5  # of the range of loads: further outside it the line is not known to hold


@dataclass(frozen=True, eq=False, repr=False)
class CurveFit(Result):
    """A curve of friction, with its numbers.

    Attributes
    ----------
    curve : str
        Which one.
    parameters : dict of str to Estimate
        Its parameters by name.
    law : Law or None
        The friction law of these values, to simulate with; None where there is none (an uneven contact, or values
        that no law can have: `status` says why).
    formula : str
        The curve, in the parameters' names.
    unit : str
        Of the friction: "N", "N m", or "1" for a coefficient.
    residual : float
        Root mean square of what is left, in that unit.
    unexplained : float
        Norm of what is left over the norm of the friction.
    model_error : float
        Share of the friction's norm that the curve misses beyond noise: what repeats in every cycle and is not in the
        curve; where the motion does not repeat, what stands above the sensor's noise.
    correlations : ndarray, shape (p, p)
        Of the parameters, in their order.
    along : str
        What `at` is: "v" (velocity), "x" (displacement) or "t" (time).
    at, measured, fitted : ndarray, shape (n,)
        Where friction was compared, what it was, and what the curve says.
    status : str
        "ok", or in words what to beware of, and what experiment would tell.
    """

    curve: str
    parameters: dict[str, Estimate]
    law: Law | CurvedLaw | None
    formula: str
    unit: str
    residual: float
    unexplained: float
    model_error: float
    correlations: Array
    along: str
    at: Array
    measured: Array
    fitted: Array
    status: str

    @property
    def follows(self) -> bool:
        """Whether friction follows the curve."""
        return self.model_error < MISSES

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found."""
        return tuple(self.parameters.values())

    @property
    def name(self) -> str:
        """Of the curve, with its formula."""
        return f"{self.curve}, {self.formula}"


class Request(NamedTuple):
    """What is asked: a curve by name, of all samples or of those that slide, of how many elements, under which load."""

    curve: str
    whole: Samples
    sliding: Samples
    elements: int
    normal: float


def fit_curve(
    data: Record | Loops,
    *,
    curve: str = "stribeck",
    contact: str | None = None,
    frequency: float | str | None = None,
    elements: int = 8,
    normal: float | str | None = None,
) -> CurveFit:
    r"""Which numbers of a friction curve explain a measured friction best?

    By least squares. Over the velocity, of every sample that slides, away from the reversals:

    * ``"coulomb"``: :math:`f = f_k\,\mathrm{sgn}\,v`;
    * ``"viscous"``: :math:`f = f_k\,\mathrm{sgn}\,v + \sigma v`;
    * ``"stribeck"``: :math:`f = (f_k + (f_s-f_k)\,e^{-(|v|/v_s)^\delta})\,\mathrm{sgn}\,v + \sigma v`
      (Bo and Pavelescu, Wear 82, 1982), the exponent free, begun from 36 pairs of speed and exponent;
      without :math:`\sigma` where it comes out below zero;
    * ``"asymmetric"``: Coulomb and viscous friction of their own in each direction;
    * ``"tabulated"``: a polygon that rises, or falls, all the way.

    Over the displacement, of all samples but those of the first cycle, which sets the contact's memory:

    * ``"dahl"``: :math:`df/dx = \sigma_0 (1 - (f/f_k)\,\mathrm{sgn}\,v)^n` (Dahl 1968), n free;
    * ``"jenkins"``: a spring that slips at :math:`f_k`; ``"iwan"``: classes of them, alike in stiffness, yielding
      evenly up to a width; ``"maxwell"``: elements that yield at given deflections, those kept that bear something.

    A constant force beside these is fitted too, where motion both ways tells it. After a step of the driving velocity,
    where ``x`` is the drive's and friction is felt through a spring:

    * ``"aging"``, ``"slip"``: :math:`f = N [\mu_0 + a \ln(v/V_1) + b \ln(V_1\theta/D_c)]`, with the age of either law
      (Dieterich 1979, Ruina 1983), the spring's stiffness and a trend along the way.

    The intervals admit the error of the model: they are as wide as the scatter between cycles says, or as the residuals
    along the mean cycle, which repeat, and which no scatter shows; whichever is wider.

    Parameters
    ----------
    data : Record or Loops
        With ``friction``, or the ``coefficient`` of friction, and the motion, as for :func:`friction_loops`; or its
        answer, whose mean cycle is then fitted.
    curve : str
        One of the names above.
    contact : {"ground", "base"}, optional
        What the mass slides on; as :func:`friction_force` was told, or the ground, when not given.
    frequency : float or str, optional
        Forcing frequency [Hz]; found from the record when not given.
    elements : int
        Points of a tabulated curve; classes of Iwan's; elements of Maxwell's to begin with.
    normal : float or str, optional
        Normal load N [N], by which a coefficient becomes a force. Where it is not given, the numbers
        are those of the coefficient, and the law is that under 1 N.

    Returns
    -------
    CurveFit

    Raises
    ------
    RecordError
        A channel is missing, broken or too short, or the units of friction and motion do not belong together.
    EstimateError
        The record can not tell: no sliding, one speed alone, no reversal; no such curve; or contact, frequency or
        normal load of loops, which were told these.

    Examples
    --------
    >>> t = np.arange(20000) / 2000
    >>> v = 0.1 * np.sin(2 * np.pi * t)
    >>> f = np.sign(v) * (1.0 + 0.4 * np.exp(-np.abs(v) / 0.02)) + np.random.default_rng(0).normal(0, 0.02, t.size)
    >>> fit = fit_curve(Record.of({"v": v, "friction": f}, fs=2000), curve="stribeck")
    >>> round(fit.parameters["kinetic"].value, 2), fit.parameters["exponent"].includes(1.0)
    (1.0, True)
    """
    if curve not in CURVES:
        raise EstimateError(f"curve = '{curve}'", f"it is one of {', '.join(CURVES)}", nearest(str(curve), CURVES))
    if not isinstance(elements, (int, np.integer)) or not 2 <= elements <= 50:
        raise EstimateError(f"elements = {elements}", "points of a table, or elements, are 2 to 50", "leave it at 8")
    load = None if normal is None else finite("normal", parse_value(normal, "N"), unit="N", positive=True)
    whole, sliding = samples_of(data, contact=contact, frequency=frequency, smoothed=curve in OVER_WAY, normal=load)
    family, member = best_member(*CURVES[curve](Request(curve, whole, sliding, int(elements), load or 1.0)))
    return _answer(curve, family, member, filled=_filled(data))


def _over_speed(family: Family) -> Callable[[Request], tuple[Family, Samples]]:
    def chosen(request: Request) -> tuple[Family, Samples]:
        require_speeds(request.sliding, request.curve)
        return family, request.sliding

    return chosen


def _uneven(request: Request) -> tuple[Family, Samples]:
    require_reversals(request.sliding, request.curve)
    return _over_speed(curves.UNEVEN)(request)


def _table(request: Request) -> tuple[Family, Samples]:
    return _over_speed(curves.table(request.sliding, request.elements))(request)


def _over_way(family: Callable[[Samples, int], Family]) -> Callable[[Request], tuple[Family, Samples]]:
    def chosen(request: Request) -> tuple[Family, Samples]:
        require_reversals(request.whole, request.curve)
        require_resisting(request.whole)
        return family(request.whole, request.elements), request.whole

    return chosen


def _step(law: str) -> Callable[[Request], tuple[Family, Samples]]:
    def chosen(request: Request) -> tuple[Family, Samples]:
        return curves.velocity_step(request.whole, law=law, normal=request.normal), request.whole

    return chosen


CURVES: dict[str, Callable[[Request], tuple[Family, Samples]]] = {
    "coulomb": lambda request: (curves.COULOMB, request.sliding),
    "viscous": _over_speed(curves.VISCOUS),
    "stribeck": _over_speed(curves.STRIBECK),
    "asymmetric": _uneven,
    "tabulated": _table,
    "dahl": _over_way(lambda samples, elements: curves.DAHL),
    "jenkins": _over_way(lambda samples, elements: curves.JENKINS),
    "iwan": _over_way(lambda samples, elements: curves.iwan(elements)),
    "maxwell": _over_way(curves.maxwell_slip),
    "aging": _step("aging"),
    "slip": _step("slip"),
}


def _filled(data: Record | Loops) -> float:
    """Share of the friction's samples that were filled in for measured ones."""
    if isinstance(data, Loops):
        return 0.0
    filled = sum(max(step.arguments.get("filled", {}).values(), default=0) for step in data.history)
    return min(1.0, filled / len(data))


def _answer(curve: str, family: Family, member: Member, *, filled: float) -> CurveFit:
    samples = member.samples
    left = samples.friction - member.fitted
    missed = model_error(left, samples) / float(np.sqrt(np.mean(samples.friction**2)))
    method = f"least squares of '{curve}'"
    checks = (f"{len(left)} samples in {samples.cycles} cycles",)
    parameters = {
        name: _estimate(name, value, sd, freedom, samples.in_units(family.units[name]), method, checks)
        for (name, value), sd, freedom in zip(member.values.items(), member.sd, member.freedom, strict=True)
    }
    worries = _worries(member, samples, family.along, missed)
    for name, estimate in parameters.items():
        if not all(map(math.isfinite, estimate.interval)):
            parameters[name] = replace(estimate, status="the record tells nothing of it")
    if missed > MISSES:
        parameters = {name: replace(estimate, status=NOT_FOLLOWED) for name, estimate in parameters.items()}
    if TOO_NOISY in worries:
        parameters = {name: estimate.doubted(TOO_NOISY) for name, estimate in parameters.items()}
    if filled > FILLED:
        worries.append(f"{100 * filled:.0f} % of the samples were not measured, but filled in between others")
    for names, word in family.beware(parameters, samples):
        worries.append(word)
        parameters |= {name: replace(parameters[name], status=word) for name in names}
    if family.along != "t" and not samples.reverses:
        forces = [name for name, unit in family.units.items() if unit == "N" and name in parameters]
        parameters |= {name: parameters[name].doubted(ONE_WAY) for name in forces}
    try:
        law = family.law(member.values)
    except ModelError as refused:
        law = None
        rounded = re.sub(r"\d+\.\d{6,}", lambda number: f"{float(number[0]):.6g}", refused.value)
        worries.append(f"no law has these values: {rounded}")
    return CurveFit(
        curve=curve,
        parameters=parameters,
        law=law,
        formula=family.formula,
        unit=samples.force,
        residual=float(np.sqrt(np.mean(left**2))),
        unexplained=float(np.linalg.norm(left) / np.linalg.norm(samples.friction)),
        model_error=missed,
        correlations=member.correlations,
        along=family.along,
        at={"v": samples.velocity, "x": samples.displacement, "t": samples.time}[family.along],
        measured=samples.friction,
        fitted=member.fitted,
        status=Status(*worries),
    )


def _estimate(
    name: str, value: float, sd: float, freedom: float, unit: str, method: str, checks: tuple[str, ...]
) -> Estimate:
    label = NAMES.get(name, name.replace("_", " "))
    made = Estimate.normal(label, value, sd=sd, unit=unit, method=method, quantile=student(freedom), checks=checks)
    if name not in POSITIVE:
        return made
    log_half = (made.interval[1] - value) / value
    times = math.exp(log_half) if log_half < LOST else math.inf
    return replace(made, interval=(value / times, value * times))


def _worries(member: Member, samples: Samples, along: str, missed: float) -> list[str]:
    """What the samples can not bear."""
    names, worries = list(member.values), []
    cyclic = along != "t"
    if cyclic and samples.cycles < len(names):
        many = f"{samples.cycles} cycle{'s' * (samples.cycles > 1)}"
        worries.append(f"{many} for {len(names)} parameters: give more of them")
    if samples.noise > float(np.sqrt(np.mean(member.fitted**2))):
        worries.append(TOO_NOISY)
    if cyclic and not samples.reverses:
        worries.append(f"{ONE_WAY}; let it reverse")
    if along == "v" and samples.speed_spread < LEAST_SPREAD:
        worries.append("one speed alone: whether friction changes with speed is not told; let the speed vary")
    if cyclic and samples.drives:
        worries.append("friction drives the motion: the sign of the force or of the displacement is wrong")
    left = float(np.linalg.norm(samples.friction - member.fitted) / np.linalg.norm(samples.friction))
    if missed > MISSES:
        worries.append(
            f"the friction does not follow the curve: {100 * missed:.0f} % of it is neither in the curve nor noise; "
            "another curve may leave less, or another mass"
        )
    elif left > LEAVES:
        worries.append(
            f"the curve leaves {100 * left:.0f} % of the friction: another one, or less noise, may leave less"
        )
    for i, j in zip(*np.nonzero(np.triu(np.abs(member.correlations), 1) > TIED), strict=True):
        worries.append(
            f"{names[i]} and {names[j]} can only be told together (correlation {member.correlations[i, j]:.3f})"
        )
    return worries


@dataclass(frozen=True, eq=False, repr=False)
class LoadLine(Result):
    """Friction against load: a straight line.

    Attributes
    ----------
    coefficient : Estimate
        Friction per load, the slope of the line.
    adhesion : Estimate
        Friction [N] without load: adhesion, or a preload; zero at least, and without a value where the line surely goes
        below, friction beginning late.
    coefficients : tuple of Estimate
        Friction over load, of each load alone; alike where the adhesion is none.
    loads : ndarray, shape (n,)
        Loads [N].
    line : ndarray, shape (2,)
        Where the line meets no load [N], be it below zero, and its slope.
    covariance : ndarray, shape (2, 2)
        Of these.
    quantile : float
        Of Student's t, for 95 %.
    status : str
        "ok", or in words what to beware of.
    """

    coefficient: Estimate
    adhesion: Estimate
    coefficients: tuple[Estimate, ...]
    loads: Array
    line: Array
    covariance: Array
    quantile: float
    status: str

    def friction(self, load: float | str) -> Estimate:
        """The friction under another load.

        Parameters
        ----------
        load : float or str
            Load [N].

        Returns
        -------
        Estimate
            Flagged where the load is further outside those measured than half their range.
        """
        newtons = finite("load", parse_value(load, "N"), unit="N")
        row = np.array([1.0, newtons])
        low, high = self.loads.min(), self.loads.max()
        outside = max(low - newtons, newtons - high)
        far = (
            f"{newtons:.3g} N is far from the loads measured, {low:.3g} to {high:.3g} N"
            if outside > FAR * (high - low)
            else "ok"
        )
        return Estimate.normal(
            f"friction under {newtons:.3g} N",
            float(row @ self.line),
            sd=math.sqrt(float(row @ self.covariance @ row)),
            unit="N",
            method="line through friction over load",
            quantile=self.quantile,
            status=far,
        ).within(0.0, otherwise=LATE)


def friction_over_load(levels: Sequence[Estimate], *, loads: Sequence[float | str]) -> LoadLine:
    r"""How does friction depend on the load?

    The line :math:`F = F_0 + \mu N` by least squares, each friction by the width of its interval; where they scatter
    about the line more than these allow, the intervals are wider by as much. Amontons's law is a line through zero: it
    holds where the interval of :math:`F_0` does.

    Parameters
    ----------
    levels : sequence of Estimate
        Sliding friction [N] under each load, as of :func:`friction_loops` (``.level``) or :func:`fit_curve`.
    loads : sequence of float or str
        The loads [N].

    Returns
    -------
    LoadLine

    Raises
    ------
    EstimateError
        Fewer than two loads that differ, or not one friction for each.

    Examples
    --------
    >>> levels = [Estimate.normal("friction", f, sd=0.01, unit="N", method="") for f in (0.62, 1.19)]
    >>> line = friction_over_load(levels, loads=[2.0, 4.0])
    >>> print(line.friction(3.0))
    friction under 3 N 0.905 N (95 %: 0.891 to 0.919)
    """
    weights = np.array([finite("loads", parse_value(load, "N"), unit="N") for load in loads])
    if len(levels) != len(weights) or len(levels) < 2:
        raise EstimateError(
            f"{len(levels)} frictions, {len(weights)} loads",
            "a line needs a friction for each of two loads at least",
            "give one of each",
        )
    if weights.min() <= 0 or weights.max() < LEAST_REACH * weights.min():
        raise EstimateError(
            f"loads from {weights.min():.3g} to {weights.max():.3g} N",
            f"they are above zero, and the largest is {LEAST_REACH:g} times the smallest at least",
            "give records under loads that differ",
        )
    values = np.array([level.value for level in levels])
    sds = np.array([(level.interval[1] - level.interval[0]) / 2 / NORMAL_95 for level in levels])
    sds = np.maximum(sds, 1e-9 * np.abs(values).max())
    columns = np.column_stack([np.ones(len(weights)), weights]) / sds[:, None]
    covariance = np.linalg.inv(columns.T @ columns)
    line = covariance @ (columns.T @ (values / sds))
    freedom = len(values) - 2
    left = values / sds - columns @ line
    excess = float(left @ left) / freedom if freedom else 1.0
    quantile = student(freedom) if excess > 1 else NORMAL_95
    covariance = covariance * max(1.0, excess)
    method = f"line through friction under {len(values)} loads"
    checks = (f"frictions stray from the line by {math.sqrt(excess):.2g} times their deviations",) if freedom else ()
    named = (("friction without load", "N", LATE), ("coefficient of friction", "1", "friction falls with the load"))
    adhesion, coefficient = (
        Estimate.normal(
            name,
            line[row],
            sd=math.sqrt(covariance[row, row]),
            unit=unit,
            method=method,
            quantile=quantile,
            checks=checks,
        ).within(0.0, otherwise=why)
        for row, (name, unit, why) in enumerate(named)
    )
    ratios = tuple(
        level.scaled(1 / float(load), "1", f"friction over load of {load:.3g} N")
        for level, load in zip(levels, weights, strict=True)
    )
    doubtful = [level.status for level in levels if level.status != "ok"]
    status = Status(*doubtful)
    return LoadLine(coefficient, adhesion, ratios, weights, line, covariance, quantile, status)
