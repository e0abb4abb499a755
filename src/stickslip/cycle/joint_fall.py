"""Friction of a joint that falls with the speed: which Stribeck curves its log allows, and whether it surely does.

With which load it grows, and what no term follows: bends, what changes along the way, a loop that damps the speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.cycle.joint_fit import ADVICE, JointData, about_load, coefficient, separable
from stickslip.cycle.joint_slides import Log, Sliding
from stickslip.cycle.regression import TURNING, UNITS
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Doubt, Estimate, doubts_of, stands
from stickslip.signals.derivatives import differentiate
from stickslip.statistics import FEW_INDEPENDENT, LeastSquares, correlation_time, least_squares

AGES = "ages"  # kind of doubt: friction that changes along the log
# Of the Coulomb friction: of three sweeps that hid a rise by half 0.45 to 0.7 were unseen, of five others 0.06 to 0.3.
UNSEEN = 0.4
EXPONENTS = (1.0, 1.5, 2.0)  # Tustin's, Gauss's and one between: a log hardly tells them apart, so all are counted
SPEEDS = 12  # of each exponent
POWERS = ((0.0, 1.5), (0.0, 2.0), (0.0, 3.0))  # of the speed, by which drag may grow: grease's, air's, and one beyond
BENT = 0.5  # of the fastest sliding: a likeliest curve that falls slower is a bend of the line, as rising friction has
LEAST = 2.0  # deviations of the speed's noise
ALONG = 200  # speeds at which friction along a curve is compared
ROUNDS = 2  # about the load part and gravity's torque that the likeliest curve leaves
LIKELY = 8.0  # halves of chi squared above the least, within which curves are told apart finer
NEGLIGIBLE = 1e-3  # of the likeliest curve's weight
SAME = 1e-3  # of the largest: a singular value below it is one instrument counted twice
NOWHERE = 1e-150  # size of a column, below which its square vanishes: a curve that falls where nothing slides
# Of the power that is left, what a curve explains: 0.24 of a real axis, 0.03 at most of six joints whose counts recur.
MUCH = 0.1
ROUNDING = 1e-5  # of the torque: of a log without noise derivatives leave some 1e-9
# Deviations of the excess at rest, above none for a fall and either way for a bend: of 95 joints without one, seeds
# 6000 to 8042, no fall came to 3; of 230 others, which did not set it, 4 bends came to more.
SURELY = 3.5
METHOD = "likelihood over Stribeck curves"
FINER = 3  # rounds of likely curves closer together: three make 12 speeds of one step of the first
# Kinds of doubt.
CURVED, PLACE, SPEEDY, BORNE, WOUND, AHEAD = "bent", "placed", "speedy", "borne", "wound", "ahead"
LOADED, NOISY = "loaded", "noisy"
SPEED = ("viscous", "uneven", "inertia")  # terms in which a controller's damping of the speed stands, and its delay
RUBS = ("forward", "back", "viscous")  # terms by which friction is a line over the speed
PLACED = ("forward", "back", "load", "sine", "cosine")  # terms that friction or torque of the place passes for
# Of a stated kd, chosen: 1 is not damped at all; of 15 sound joints, seeds 93000 to 94020, it was 0.46 at most.
HARDLY = 0.8
# Share of noise in the power of the acceleration: up to it the inertias of 96 of 99 joints without a reference held,
# seeds 91000 to 94117; above it one of 5 was low by 85 %.
DROWNED = 0.5
SLIGHT = 0.05  # of the friction, chosen: gravity that is less can not make it grow by more
RESISTING = ("inertia", "forward", "back", "viscous_forward", "viscous_back", "load")  # never below zero
LOOPED = ("damping", "late", "wound")  # terms of a controller, and not of what its torque moves
BEARINGS = 4  # rounds of what the teeth bear, each by the regression on the last
FALL = ("fall", "fall of load")  # the excess at rest under the mean load, and what each N m of load adds to it


@dataclass(frozen=True)
class Fall:
    """The Stribeck curves that a log allows.

    Attributes
    ----------
    terms : tuple of str
        Of the regressions, of `FALL` last.
    fits : tuple of LeastSquares
        One for each curve that is likely enough.
    curves : ndarray, shape (m, 2)
        Stribeck speed and exponent of each.
    weights : ndarray, shape (m,)
        How likely each is, of sum one.
    spans : ndarray, shape (m,)
        Of the logarithm of the speed, what each stands for.
    pull : (float, float)
        Gravity's sine and cosine part.
    """

    terms: tuple[str, ...]
    fits: tuple[LeastSquares, ...]
    curves: Array
    weights: Array
    spans: Array
    pull: tuple[float, float]

    @property
    def best(self) -> int:
        """The likeliest curve."""
        return int(np.argmax(self.weights))

    @property
    def exponent(self) -> float:
        """The likeliest exponent."""
        exponents = self.curves[:, 1]
        return float(max(EXPONENTS, key=lambda one: float(self.weights[exponents == one].sum())))

    def speed(self, name: str, unit: str) -> Estimate:
        """The Stribeck speed: the quantiles of what all curves make likely, each evenly over its span."""
        logs = np.log(self.curves[:, 0])
        reach = np.linspace(np.min(logs - self.spans), np.max(logs + self.spans), 2000)
        below = np.clip((reach[:, None] - logs) / self.spans + 0.5, 0.0, 1.0) @ self.weights
        low, middle, high = np.exp(np.interp((0.025, 0.5, 0.975), below, reach))
        spread = (logs - self.weights @ logs) ** 2 + self.spans**2 / 12
        sd = float(middle) * math.sqrt(float(self.weights @ spread))
        return Estimate(name, float(middle), (float(low), float(high)), sd, unit, METHOD)


@dataclass(frozen=True)
class _Balance:
    """The balance about a load part and gravity's torque, to be solved with any curve beside its terms.

    Its instruments are those of all curves that may be seen: of a few alike they would tell nothing apart.
    """

    data: JointData
    terms: tuple[str, ...]
    share: float
    pull: tuple[float, float]
    speeds: tuple[tuple[Array, Array], ...]
    seen: Array

    def about(self, solution: Array) -> _Balance:
        """The same about what was found."""
        known = dict(zip(self.terms, solution.tolist(), strict=False))
        share, *pull = (known.get(term, 0.0) for term in ("load", "sine", "cosine"))
        return replace(self, share=share, pull=(pull[0], pull[1]))

    @property
    def richer(self) -> tuple[str, ...]:
        return (*self.terms, *FALL[: 1 + ("load" in self.terms)])

    def columns(self, curves: Array, *, steered: bool = False) -> tuple[Array, list[Array]]:
        """Those of the terms, and those of each curve."""
        steered = steered and self.data.followed
        base = self.data.columns(self.terms, self.share, self.pull, steered=steered)
        speeds = (pair[steered] for pair in self.speeds)
        parts = [self._falls(*log, curves, steered) for log in zip(self.data.logs, speeds, strict=True)]
        return base, list(np.concatenate(parts, axis=1))

    def _falls(self, log: Log, speed: Array, curves: Array, steered: bool) -> Array:
        """Columns of a log for each curve: of the excess, and of what of it goes with the load."""
        slides = log.sliding
        place = log.reference if steered and log.reference is not None else log.position
        carried = np.abs(self.pull[0] * np.sin(place) + self.pull[1] * np.cos(place))
        excess = [slides.side * _shape(speed, curve) for curve in curves]
        columns = [[slides.at(one)] for one in excess]
        if "load" in self.terms and log.borne is not None:
            borne = np.abs(log.borne[steered]) / slides.weights
            columns = [[column, column * (borne - borne.mean())] for (column,) in columns]
        elif "load" in self.terms:
            carried = carried - carried[slides.rows].mean()
            columns = [[column, slides.at(one * carried)] for one, (column,) in zip(excess, columns, strict=True)]
        return np.stack([np.column_stack(pair) for pair in columns])

    def drop(self, fit: LeastSquares, curve: Array) -> float:
        """By how many deviations friction along a curve is lower at some speed than at a slower one."""
        logs = zip(self.data.logs, self.speeds, strict=True)
        seen = np.concatenate([speed[log.sliding.rows] for log, (speed, _) in logs])
        speed = np.linspace(seen.min(), seen.max(), ALONG)
        row, parts = np.zeros(len(fit.coefficients)), [len(self.terms), self.terms.index("viscous")]
        columns = np.column_stack([_shape(speed, curve), speed])
        rubs = columns @ fit.coefficients[parts]
        low = int(np.argmin(rubs - np.maximum.accumulate(rubs)))
        row[parts] = columns[int(np.argmax(rubs[: low + 1]))] - columns[low]
        lower = fit.combined(row, "", "", "")
        return lower.value / lower.sd if row.any() else 0.0

    def rises(self) -> bool:
        """Whether drag, that grows with a power of the speed, explains as much as any curve that falls: beside a line
        that is too steep it looks like an excess at rest.
        """
        solved, place = self.solved(np.concatenate([self.seen, POWERS])), len(self.seen)
        best, left = solved.likeliest(self.terms)
        _, variance = _sureness(solved.fit(best), len(self.terms))
        return bool(min(left[place:]) < min(left[:place]) + SURELY**2 * variance)

    def solved(self, curves: Array) -> _Solved:
        """The balance solved with each curve, and without any."""
        base, falls = self.columns(curves)
        torque = self.data.torque - self.data.known
        if "load" in self.terms and self.data.by_gravity:  # linear about `share`: it stands in gravity's columns
            torque = torque + self.share * base[:, self.terms.index("load")]
        known, shapes = self.columns(self.seen, steered=True) if self.data.followed else (base, falls)
        basis = _basis(known, np.hstack(shapes), SAME if self.data.followed else 0.0)
        return _Solved([np.column_stack([base, one]) for one in falls], torque, basis, self.data.noise(self.richer))


@dataclass(frozen=True)
class _Solved:
    """Designs, the torque that they explain, an orthonormal basis of all that the instruments tell, and the noise."""

    designs: list[Array]
    torque: Array
    basis: Array
    noise: Array

    def left(self, design: Array) -> tuple[Array, float]:
        """The coefficients, and the square of what they leave of that of the torque which the instruments tell."""
        sizes = np.maximum(np.linalg.norm(design, axis=0), NOWHERE)
        told = self.basis.T @ self.torque
        columns = self.basis.T @ (design / sizes)
        solution, *_ = np.linalg.lstsq(columns, told, rcond=None)
        return solution / sizes, float(np.sum((told - columns @ solution) ** 2))

    def likeliest(self, terms: tuple[str, ...]) -> tuple[int, Array]:
        """The one that leaves least, and what all leave: infinitely much where it does not fall, or to below none."""
        solutions, left = zip(*(self.left(design) for design in self.designs), strict=True)
        rubs = [terms.index("forward"), terms.index("back")]
        falls = [one[len(terms)] > 0 and one[rubs].sum() > 0 for one in solutions]
        if not any(falls):
            raise EstimateError("no curve falls", "friction falls with the speed, to a positive level", "slide slower")
        squares = np.where(falls, left, np.inf)
        return int(np.argmin(squares)), squares

    def fit(self, number: int) -> LeastSquares:
        """One of them, with all that makes its intervals (two-stage least squares)."""
        design = self.designs[number]
        known = self.basis @ (self.basis.T @ design)
        return replace(least_squares(design, self.torque, instruments=known, noise=self.noise), cyclic=True)


def _shape(speed: Array, curve: Array) -> Array:
    """How the excess goes with the speed: it falls, or of no Stribeck speed grows by that power."""
    fall, exponent = curve
    return np.asarray(np.exp(-((speed / fall) ** exponent)) if fall else speed**exponent)


def speed_of(log: Log, *, steered: bool = False) -> tuple[Array, float]:
    """Speed of a log, or of its reference, and the deviation of its noise."""
    position = log.reference if steered and log.reference is not None else log.turned
    velocity = differentiate(position, log.sliding.window.fs)
    return np.abs(velocity.values), float(np.median(velocity.sd))


def _basis(base: Array, shapes: Array, same: float) -> Array:
    """An orthonormal basis of columns, and of what others have beside them."""
    first, _ = np.linalg.qr(base / np.linalg.norm(base, axis=0))
    others = shapes / np.maximum(np.linalg.norm(shapes, axis=0), NOWHERE)
    beside, sizes, _ = np.linalg.svd(others - first @ (first.T @ others), full_matrices=False)
    return np.column_stack([first, beside[:, sizes > same * sizes[0]]])


def falling(data: JointData, fit: LeastSquares, terms: tuple[str, ...], pull: tuple[float, float]) -> Fall | None:
    r"""Whether the friction falls with the speed, surely, and along which curves it may.

    Beside the terms of the regression stands the excess of Stribeck's curve,
    :math:`e\,\mathrm{sgn}(\dot q)\,\exp(-(|\dot q|/v_s)^\delta)`, linear for a given speed and exponent (the variable
    projection of Golub and Pereyra 1973, over a grid); where friction grows with the load the excess may too. What a
    curve leaves of the torque, as far as the instruments tell it, makes its weight: a log that hardly tells speed and
    exponent is answered by all curves that it allows.
    """
    try:
        return _allowed(_balance(data, fit, terms, pull))
    except EstimateError:  # the motion tells no curve from the other terms
        return None


def bends(data: JointData, fit: LeastSquares, terms: tuple[str, ...], pull: tuple[float, float]) -> bool:
    """Whether friction is surely no line over the speed: a curve beside it, or drag, is surely there."""
    balance = _balance(data, fit, terms, pull)
    return any(_curved(balance, curves) for curves in (balance.seen, np.array(POWERS)))


def _curved(balance: _Balance, curves: Array) -> bool:
    """Whether the likeliest of some curves, that falls or rises, is surely there."""
    solved, place = balance.solved(curves), len(balance.terms)
    for number in np.argsort([solved.left(design)[1] for design in solved.designs]):
        try:
            curved = solved.fit(int(number))
        except EstimateError:  # the motion does not tell this curve from the other terms
            continue
        part = solved.designs[number][:, place:] @ curved.coefficients[place:]
        seen = np.linalg.norm(part) > ROUNDING * np.linalg.norm(solved.torque)
        much = float(part @ part) > MUCH * float(curved.residual @ curved.residual)
        # what counts leave recurs with the motion: a curve is to be more than one cycle of it shows, or large beside it
        asked = replace(curved, cyclic=not much)
        return bool(seen and abs(_sureness(asked, place)[0]) > SURELY)
    return False


def _balance(data: JointData, fit: LeastSquares, terms: tuple[str, ...], pull: tuple[float, float]) -> _Balance:
    """The balance about a regression, and the curves that may be seen beside it."""
    moved = [speed_of(log) for log in data.logs]
    steered = [
        speed_of(log, steered=True)[0] if data.followed else speed
        for log, (speed, _) in zip(data.logs, moved, strict=True)
    ]
    speeds = tuple((speed, along) for (speed, _), along in zip(moved, steered, strict=True))
    curves = _visible([(*one, log.sliding) for one, log in zip(moved, data.logs, strict=True)])
    return _Balance(data, terms, coefficient(fit, terms, "load"), pull, speeds, curves)


def _allowed(balance: _Balance) -> Fall | None:
    """The curves that the log allows, where one surely falls and is no bend."""
    curves, rises = balance.seen, balance.rises()
    place, fastest = len(balance.terms), curves.max(axis=0)[0]
    for finer in (False,) * ROUNDS + (True,) * FINER:
        solved = balance.solved(curves)
        best, left = solved.likeliest(balance.terms)
        fit = solved.fit(best)
        sure, variance = _sureness(fit, place)
        if sure < SURELY or curves[best, 0] > BENT * fastest:
            return None
        if rises and balance.drop(fit, curves[best]) < SURELY:
            return None
        balance = balance.about(solved.left(solved.designs[best])[0])
        curves = _finer(curves, left / variance) if finer else curves
    solved = balance.solved(curves)
    _, left = solved.likeliest(balance.terms)
    return _weighed(balance, solved, curves, left / variance)


def _visible(moved: list[tuple[Array, float, Sliding]]) -> Array:
    """Curves that fall within the speeds at which it slides, evenly in their logarithms."""
    slowest = min(max(slides.slowest / 2, LEAST * noise) for _, noise, slides in moved)
    fastest = max(float(speed[slides.rows].max()) for speed, _, slides in moved)
    speeds = np.geomspace(min(slowest, fastest / 2), fastest, SPEEDS)
    return np.array([(speed, exponent) for exponent in EXPONENTS for speed in speeds])


def _sureness(fit: LeastSquares, place: int) -> tuple[float, float]:
    """By how many deviations the excess is above none, and the variance that a residual counts for.

    Few cosines may give too small a variance by chance; it is at least that of residuals that are correlated, and come
    again with the motion, as these.
    """
    excess, form = fit.coefficients[place], float(np.linalg.norm(fit.projection[place]))
    sd = fit.combined(np.eye(len(fit.coefficients))[place], "", "", "").sd
    noise = float(fit.residual @ fit.residual) / (len(fit.residual) - len(fit.coefficients))
    variance = max((sd / form) ** 2, noise * correlation_time(fit.residual) * fit.recurring)
    return float(excess) / (form * math.sqrt(variance)), variance


def _finer(curves: Array, halves: Array) -> Array:
    """Of each exponent those speeds that are likely, closer together."""
    finer = []
    for exponent in dict.fromkeys(curves[:, 1]):
        speeds, left = curves[curves[:, 1] == exponent, 0], halves[curves[:, 1] == exponent]
        if np.isfinite(left.min()):  # its own least: that of a coarse grid may seem unlikely beside another exponent's
            likely = np.flatnonzero(left < left.min() + 2 * LIKELY)
            low, high = speeds[max(likely[0] - 1, 0)], speeds[min(likely[-1] + 1, len(speeds) - 1)]
            finer += [(speed, exponent) for speed in np.geomspace(low, high, SPEEDS)]
    return np.array(finer)


def _weighed(balance: _Balance, solved: _Solved, curves: Array, halves: Array) -> Fall:
    """The likely curves, each by its weight: how well it explains the torque, times how much of the range it is."""
    spans = _spans(curves)
    weights = np.exp((halves.min() - halves) / 2) * spans
    fits = {}
    for number in np.flatnonzero(weights > NEGLIGIBLE * weights.max()):
        try:
            fits[int(number)] = solved.fit(int(number))
        except EstimateError:  # a curve that the motion does not tell from the other terms is none that it tells
            continue
    rows = list(fits)
    shares = weights[rows] / weights[rows].sum()
    return Fall(balance.richer, tuple(fits.values()), curves[rows], shares, spans[rows], balance.pull)


def _spans(curves: Array) -> Array:
    """How much of the logarithm of the speed each curve stands for."""
    speeds = [curves[curves[:, 1] == exponent, 0] for exponent in dict.fromkeys(curves[:, 1])]
    return np.concatenate([np.gradient(np.log(speed)) for speed in speeds])


# ---- with which load it grows


def loaded(data: JointData) -> JointData:
    """The data with the load by which friction surely grows: that of gravity, or of what the gear's teeth bear.

    Each leaves some of what the other's column would tell (the test of Davidson and MacKinnon 1981): of that the noise
    of encoders, which residuals are full of, is hardly any.
    """
    fit, terms, pull, _ = separable(data)
    if "load" not in terms:
        return data
    try:
        borne = borne_by_teeth(data, fit, terms, pull)
        other, about = about_load(borne, terms)
    except EstimateError:  # the motion does not tell it from the other terms
        return data
    known = data.columns(terms, coefficient(fit, terms, "load"), pull, steered=data.followed)
    basis = _basis(known, borne.columns(("load",), 0.0, about, steered=data.followed), 0.0)
    left = [float(np.sum((basis.T @ one.residual) ** 2)) for one in (fit, other)]
    explained = (left[0] - left[1]) / float(other.residual @ other.residual)
    return borne if other.independent * explained > SURELY**2 else data


def borne_by_teeth(data: JointData, fit: LeastSquares, terms: tuple[str, ...], pull: tuple[float, float]) -> JointData:
    """With friction that grows with what the gear's teeth bear: the mean of the motor's torque and of gravity's.

    That of the motor is what a regression makes of it, as the measured one would explain itself.
    """
    own = tuple(term for term in terms if term not in LOOPED)
    for _ in range(BEARINGS):
        share, values = coefficient(fit, terms, "load"), [coefficient(fit, terms, term) for term in own]
        if data.by_gravity:  # its column stands in gravity's already
            values[own.index("load")] = 0.0
        logs = [replace(log, borne=None if data.by_gravity else log.borne) for log in data.logs]
        both = [[_borne(log, own, values, share, pull, steered) for steered in (False, True)] for log in logs]
        begins = np.cumsum([0, *(len(log.sliding.rows) for log in logs)])
        knowns = [data.known[begin:end] for begin, end in pairwise(begins)]
        logs = [
            replace(log, borne=(moved + known / 2, steered + known / 2))
            for log, (moved, steered), known in zip(logs, both, knowns, strict=True)
        ]
        data = replace(data, logs=tuple(logs))
        fit, pull = about_load(data, terms)
    return data


def _borne(
    log: Log, own: tuple[str, ...], values: list[float], share: float, pull: tuple[float, float], steered: bool
) -> Array:
    """Half of the motor's torque and of gravity's at the rows."""
    weight = log.columns(("sine", "cosine"), 0.0, pull, steered=steered) @ pull
    return np.asarray(log.columns(own, share, pull, steered=steered) @ values + weight) / 2


def feasible(data: JointData, terms: tuple[str, ...]) -> dict[str, float]:
    """Coefficients of a balance in which no friction drives: if need be without a load part, and alike both ways."""
    bare = tuple(term for term in terms if term != "load")
    alike = tuple("coulomb" if term == "forward" else term for term in bare if term not in ("back", "uneven"))
    for some in dict.fromkeys((terms, bare, alike)):
        try:
            fit, _ = about_load(data, some)
        except EstimateError:
            continue
        values = {"load": 0.0, **dict(zip(some, map(float, fit.coefficients), strict=True))}
        both, uneven = values.pop("coulomb", 0.0), values.pop("uneven", 0.0)
        values = {"forward": both, "back": both, **values}
        values |= {f"viscous_{way}": values["viscous"] + by * uneven for way, by in (("forward", 1), ("back", -1))}
        if all(value >= 0 for name, value in values.items() if name in RESISTING):
            return values
    return {}


# ---- what no term follows


class Misfit(NamedTuple):
    """What no term follows: the terms that it passes for, what is told of it, and what it may make of the torque."""

    terms: tuple[str, ...]
    doubt: Doubt
    strays: Array = np.zeros((1, 1))


def damps_error(data: JointData, fit: LeastSquares, terms: tuple[str, ...]) -> bool:
    """Whether a controller surely damps its error; of a stated kd, whether that is damped by what kd says."""
    if "damping" in terms:
        return fit.combined(np.eye(len(terms))[terms.index("damping")], "", "", "").interval[0] > 0
    lacks, sd = _beside(data, terms, "damping")
    return data.stated["kd"].value == 0 or lacks - NORMAL_95 * sd > -HARDLY * data.stated["kd"].value


def _beside(data: JointData, terms: tuple[str, ...], term: str) -> tuple[float, float]:
    """The coefficient of a term beside the others, and its deviation; infinite where the motion does not tell it."""
    richer = (*(one for one in terms if one not in (*FALL, "late")), term)  # a delay is in what the torque is unsure by
    try:
        fit, _ = about_load(data, richer)
    except EstimateError:
        return 0.0, math.inf
    row = np.eye(len(richer))[-1]
    unsure = math.hypot(*(float(row @ fit.projection @ column) for column in data.unsure), 0.0)
    # a doubt is raised by all cycles: of a fault that recurs with the motion each tells the same
    part = replace(fit, cyclic=False).combined(row, "", "", "", beside=unsure)
    return part.value, part.sd


def _ages(data: JointData, fit: LeastSquares, terms: tuple[str, ...]) -> str:
    """What is told of Coulomb friction that changes evenly along the log, as of a joint that warms up; empty of none.

    Of a sweep the speed rises all along, as such friction does: there it passes for viscous friction unseen.
    """
    logs = [replace(log, temperature=np.linspace(-0.5, 0.5, len(log.position)), about=0.0) for log in data.logs]
    change, sd = _beside(replace(data, logs=tuple(logs)), terms, "warming")
    both = fit.combined([float(term in ("forward", "back")) / 2 for term in terms], "", "", "")
    level = both.value
    if both.interval[0] <= 0 or not math.isfinite(sd):  # none that could change
        return ""
    if _surely(change, sd):
        way = "grows" if change > 0 else "falls"
        return f"friction surely {way} along the log, by {100 * abs(change) / level:.2g} %: this is a mean over that"
    if NORMAL_95 * sd > UNSEEN * level:
        most = 100 * (abs(change) + NORMAL_95 * sd) / level
        return f"friction that changes along the log by {most:.2g} % might pass for it: vary the speed all along"
    return ""


def _winds(data: JointData, terms: tuple[str, ...]) -> bool:
    """Whether a controller surely integrates its error, or that of its speed, for which load part and damping may pass.

    Of 20 that integrate that of the speed seven are seen beside all terms, 13 without either or both; of 80 that do not
    none (benchmarks/joint_loops.py and tests/joints.py, seeds from 150000, which set this).
    """
    without = (set[str](), {"load"}, {"damping"}, {"load", "damping"})
    kept = dict.fromkeys(tuple(term for term in terms if term not in passing) for passing in without)
    return any(_surely(*_beside(data, some, "wound")) for some in kept)


def _surely(value: float, sd: float) -> bool:
    return abs(value) > SURELY * sd


def too_early(ahead: float, stated: bool) -> Doubt:
    """What a torque means that seems to come before the motion that it makes, where play was stated or was not."""
    play = "there may be more play than is stated" if stated else 'there may be play (state it: --play "1 deg")'
    words = (
        f"the torque seems to come {1e3 * ahead:.2g} ms before the motion that it makes: between encoder and link "
        f"{play}, or the position comes late"
    )
    return Doubt(words, AHEAD)


def possible(delay: Estimate | None, source: str) -> Estimate | None:
    """A delay as it can be: no controller's is below none, and no torque comes after the motion that it makes."""
    if delay is None or source == "reference":
        return None if delay is None else delay.within(0.0)
    return delay if stands(delay.status) else delay.unknown(delay.status)


def without_load(fit: LeastSquares, terms: tuple[str, ...]) -> Doubt:
    """What a load part that the log does not tell means: of gravity that is hardly there it is hardly any."""
    rows = [np.eye(len(terms))[terms.index(term)] for term in ("sine", "cosine") if term in terms]
    pulls = [fit.combined(row, "", "", "") for row in rows]
    if not pulls or any(abs(pull.value) > SURELY * pull.sd for pull in pulls):
        return Doubt(f"friction may grow with the load, which this log does not tell: {ADVICE['load']}", LOADED)
    most, rubs = sum(abs(pull.value) + 2 * pull.sd for pull in pulls), coefficient(fit, terms, "forward")
    words = (
        "no gravity is felt, with which friction may grow: where none acts, state that by --no-gravity (gravity=False)"
    )
    return Doubt(words, LOADED, lesser=most < SLIGHT * rubs)


def worries(data: JointData, fit: LeastSquares, terms: tuple[str, ...]) -> list[Doubt | str]:
    """What of a log leaves its numbers in doubt, whatever they are."""
    worries: list[Doubt | str] = []
    if "load" in data.terms and "load" not in terms:
        worries.append(without_load(fit, terms))
    if fit.independent < FEW_INDEPENDENT * len(terms):
        worries.append(f"only {fit.independent:.0f} independent samples for {len(terms)} coefficients")
    if data.logs[0].reference is None and "inertia" in terms:
        column = data.columns(("inertia",), 0.0, (0.0, 0.0))
        noisy = float(data.noise(("inertia",))[0, 0] / np.sum(column**2))
        if noisy > DROWNED:
            doubt = f"{100 * noisy:.2g} % of the acceleration is noise of the encoder: log the reference too"
            worries.append(Doubt(doubt, NOISY))
    return worries


def misfits(
    data: JointData,
    fit: LeastSquares,
    terms: tuple[str, ...],
    bent: bool,
    turning: bool,
    delay: Estimate | None,
) -> tuple[Misfit, ...]:
    """What of the friction the terms do not follow."""
    early = () if delay is None else [doubt for doubt in doubts_of(delay.status) if doubt.kind == AHEAD]
    seen = [Misfit((*PLACED, *SPEED), doubt) for doubt in early]
    if bent:
        line = "friction bends with the speed: this is of the line nearest to it, as its interval is"
        seen.append(Misfit(RUBS, Doubt(line, CURVED)))
    if data.source == "reference" and not damps_error(data, fit, terms):
        line = "the controller may damp the speed and not its error, like viscous friction: log its torque"
        wrong = SPEED if "damping" in terms else (*SPEED, *PLACED)  # a stated kd is taken for that of the error
        seen.append(Misfit(wrong, Doubt(line, SPEEDY)))
    if data.source == "reference" and _winds(data, terms):
        line = "the controller seems to integrate its error, which kp and kd do not tell: log its torque"
        seen.append(Misfit((*SPEED, *PLACED, "damping"), Doubt(line, WOUND)))
    grows = _beside(data, terms, "borne") if all(log.bodies is not None for log in data.logs) else (0.0, math.inf)
    if _surely(*grows):
        line = f"friction surely grows with the torque of the bodies, by {grows[0]:.2g} of it: this is a mean over that"
        seen.append(Misfit(RUBS, Doubt(line, BORNE, lesser=True)))
    if "warming" not in terms and (line := _ages(data, fit, terms)):
        seen.append(Misfit(RUBS, Doubt(line, AGES, lesser=True)))
    what, size, elsewhere = data.ripple(fit)
    if size > ROUNDING * float(np.sqrt(np.mean(data.torque**2))):
        unit = (TURNING if turning else UNITS)["coulomb"]
        doubt = Doubt(f"{what} changes along the way, by {size:.2g} {unit} r.m.s.", PLACE, lesser=True)
        seen.append(Misfit(PLACED, doubt, elsewhere))
    return tuple(seen)
