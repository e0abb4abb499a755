"""A family of curves, linear in its forces and not in its shape, and its best member for some samples.

Nonlinear least squares: Levenberg's and Marquardt's step, with derivatives by differences of fourth order.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Rows
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.law.data import BLOCKS, Samples
from stickslip.laws.base import Law
from stickslip.laws.curved import CurvedLaw
from stickslip.statistics import FEW_CYCLES, INSEPARABLE, correlation_time, mean_uncertainty, student

SETTLED = 1e-8  # of a parameter: far below what any record tells
MOST = 60  # steps: more are taken along a valley that has no lowest point
FEW, RUN = 4000, 20000  # samples that a start is sought with: of all, or in a row
WANDERS = 0.1  # of the velocity's square, that differs between cycles: more is no motion that repeats
QUARTERS = 4  # of a cycle: the parts whose scatter tells, where cycles are few

STEP = 3e-4  # of a parameter, in a difference of fourth order: its error meets that of rounding
STEPS = 5000  # steps
SHARP = 1e-13  # of every parameter: what numbers can tell
BENT, STRAIGHT = 0.1, 0.375  # part of a step that shows how it bends; most of a step that the bend may add to it
STIFF = 1e10  # damping from which on steps are too short to bend
GREATEST = 1e20  # damping at which no step lowers the squares: the end of what numbers can tell


@dataclass(frozen=True)
class Family:
    """Friction as a sum of columns, each by its coefficient; the columns' shape by logarithms of lengths and powers.

    Attributes
    ----------
    formula : str
        In words and letters.
    along : str
        What it is drawn over: "v", "x" or "t".
    columns : callable
        Takes samples and the shape's logarithms, gives an array (n, q).
    parameters : callable
        Takes the coefficients and the shape (no logarithms), gives each parameter by name.
    units : mapping
        Unit of each parameter along a path.
    law : callable
        Takes the parameters by name, gives the law, or raises ModelError where there is none of these values.
    starts : callable
        Takes samples, gives for each part of the shape the logarithms to begin with.
    beware : callable
        Takes the estimates by name and the samples, gives which of them are not told, and why.
    instead : Family or None
        What is fitted where a parameter in `positive` comes out below zero.
    positive : tuple of str
        Parameters that mean nothing below zero.
    fitted : callable or None
        Solves for the coefficients where they are bound; None: by least squares.
    """

    formula: str
    along: str
    columns: Callable[[Samples, Array], Array]
    parameters: Callable[[Array, Array], dict[str, float]]
    units: Mapping[str, str]
    law: Callable[[dict[str, float]], Law | CurvedLaw | None]
    starts: Callable[[Samples], Sequence[Array]] = lambda samples: ()
    beware: Callable[[dict[str, Estimate], Samples], list[tuple[tuple[str, ...], str]]] = lambda estimates, samples: []
    instead: Family | None = None
    positive: tuple[str, ...] = ()
    fitted: Callable[[Array, Array], Array] | None = None


@dataclass(frozen=True, eq=False)
class Member:
    """The best member of a family.

    Attributes
    ----------
    values : dict
        Parameters by name.
    sd, freedom : ndarray, shape (p,)
        Their standard deviations, and the degrees of freedom of these.
    correlations : ndarray, shape (p, p)
        Of the parameters.
    samples : Samples
        What it was held against.
    fitted : ndarray, shape (n,)
        The curve at the samples.
    """

    values: dict[str, float]
    sd: Array
    freedom: Array
    correlations: Array
    samples: Samples
    fitted: Array


def best_member(family: Family, samples: Samples) -> tuple[Family, Member]:
    """The best of a family, or of the one that stands in where its parameters come out below zero."""
    member = _least_squares(family, samples)
    if family.instead is not None and any(member.values[name] < 0 for name in family.positive):
        return family.instead, _least_squares(family.instead, samples)
    return family, member


def _least_squares(family: Family, samples: Samples) -> Member:
    """The least squares of a family, from the best of its starts; how sure by what the residuals do."""
    skip, compared = samples.skipped, samples.compared
    friction, logs = compared.friction, _start(family, samples)
    columns = family.columns(samples, logs)[skip:]
    count = columns.shape[1]
    coefficients = _coefficients(family, columns, friction)
    if len(logs):
        minimum = minimise(
            lambda raw: family.columns(samples, raw[count:])[skip:] @ raw[:count],
            friction,
            np.concatenate([coefficients, logs]),
            settled_at=SETTLED,
            most=MOST,
        )
        raw, jacobian, residual = minimum.parameters, minimum.jacobian, minimum.residual
    else:
        raw, jacobian, residual = coefficients, columns, friction - columns @ coefficients

    def physical(values: Array) -> Array:
        return np.array(list(family.parameters(values[:count], np.exp(values[count:])).values()))

    _require_separable(jacobian, family)
    values = {name: float(value) for name, value in family.parameters(raw[:count], np.exp(raw[count:])).items()}
    turned = slopes(physical, raw)
    bread = inverse_normal(jacobian) @ turned.T
    covariance = turned @ bread
    lengths = np.sqrt(np.diag(covariance))
    alone = lengths * float(np.sqrt(np.mean(residual**2)))
    sd, freedom = scatter((jacobian * residual[:, None]) @ bread, alone, residual, compared)
    if family.along == "x":
        _require_hold(values, sd, freedom)
    correlations = covariance / np.outer(lengths, lengths)
    return Member(values, sd, freedom, correlations, compared, friction - residual)


def _coefficients(family: Family, columns: Array, friction: Array) -> Array:
    if family.fitted is not None:
        return family.fitted(columns, friction)
    return np.asarray(np.linalg.lstsq(columns, friction, rcond=None)[0])


def _start(family: Family, samples: Samples) -> Array:
    """The start whose columns leave least, of every combination."""
    grids = family.starts(samples)
    if not grids:
        return np.empty(0)
    few = _few(samples, family.along)
    friction = few.compared.friction
    best, least = np.empty(0), np.inf
    for logs in itertools.product(*grids):
        columns = family.columns(few, np.array(logs))[few.skipped :]
        if not np.isfinite(columns).all():
            continue
        left = friction - columns @ _coefficients(family, columns, friction)
        if float(left @ left) < least:
            best, least = np.array(logs), float(left @ left)
    if not len(best):
        raise EstimateError(
            f"no start of {family.formula.partition(',')[0]} gives finite friction",
            "a fit begins at one",
            "give a record that slides more steadily",
        )
    return best


def _few(samples: Samples, along: str) -> Samples:
    """Fewer samples to begin with: some of all, or, where the way is remembered, the first."""
    if along == "v":
        return samples.rows(slice(None, None, max(1, len(samples.friction) // FEW)))
    return samples.rows(slice(samples.skipped + RUN)) if along == "x" else samples


def _require_separable(jacobian: Array, family: Family) -> None:
    lengths = np.linalg.norm(jacobian, axis=0)
    condition = np.linalg.cond(jacobian / np.where(lengths > 0, lengths, 1.0)) if np.all(lengths > 0) else np.inf
    if condition > INSEPARABLE and family.along == "x":
        raise _sliding_alone()
    if condition > INSEPARABLE:
        raise EstimateError(
            f"this record can not tell the parameters of {family.formula.partition(',')[0]} from each other",
            "other values of them would leave as little",
            "choose a curve with fewer parameters, or give a record of slower and faster motion",
        )


def _require_hold(values: dict[str, float], sd: Array, freedom: Array) -> None:
    """Refuse a stiffness that might as well be none: the friction is the same whatever it is, but for rounding."""
    which = list(values).index("stiffness")
    if not student(freedom[which]) * sd[which] < abs(values["stiffness"]):
        raise _sliding_alone()


def _sliding_alone() -> EstimateError:
    return EstimateError(
        "the contact's stiffness does not show in this record: its friction is that of sliding alone",
        "a stiffness is told by readings in which the contact holds, next to the reversals",
        "measure smaller strokes, or sample faster and x more finely, or fit a curve over the speed",
    )


def scatter(influence: Array, alone: Array, residual: Array, samples: Samples) -> tuple[Array, Array]:
    """Standard deviation of each parameter, and its freedom, by what each sample does to it (n, p).

    Of three, the widest counts. What differs from cycle to cycle (of quarters, where cycles are few) is noise and
    drift. What the curve can not follow repeats in every cycle: it shows in how residuals stray along the mean cycle,
    whose neighbours are alike. Both are the long-run deviation of the influences in order. Where few samples tell a
    parameter, that knows little: no less than `alone`, the deviation if residuals were independent and alike, for as
    many as they are worth.
    """
    parts = samples.cycle
    if samples.cycle.max(initial=0) + 1 < FEW_CYCLES:
        parts = samples.cycle * QUARTERS + samples.block * QUARTERS // BLOCKS
    independent = len(residual) / correlation_time(residual)
    terms = influence.shape[1]
    left = max(1.0, independent - terms)
    shrinkage = np.sqrt(independent / left)
    sd, freedom = np.empty(terms), np.empty(terms)
    for index in range(terms):
        pairs = [_of_parts(influence[:, index], group) for group in (parts, samples.block)]
        pairs = [(pair * shrinkage, q) for pair, q in pairs] + [(alone[index] * np.sqrt(len(residual) / left), left)]
        sd[index], freedom[index] = max(pairs, key=lambda pair: student(pair[1]) * pair[0])
    return sd, freedom


def model_error(residual: Array, samples: Samples) -> float:
    """Root mean square of what a curve leaves and noise does not explain [N].

    Where the motion repeats, what is left of the mean cycle, less what the scatter between cycles lets it be; else what
    stands above the broadband noise.
    """
    cells = np.unique(samples.cycle * BLOCKS + samples.block, return_inverse=True)[1]
    block = samples.block[np.unique(cells, return_index=True)[1]]
    count = np.bincount(block, minlength=BLOCKS)
    several = count > 1

    def between(values: Array) -> tuple[Array, Array]:
        """Mean over the cycles of each block's mean, and its variance between them."""
        means = np.bincount(cells, values) / np.bincount(cells)
        mean = np.bincount(block, means, BLOCKS) / np.maximum(count, 1)
        squares = np.bincount(block, (means - mean[block]) ** 2, BLOCKS)
        return mean, squares / np.maximum(count - 1, 1)

    weight = np.bincount(samples.block, minlength=BLOCKS) * several
    _, wander = between(samples.velocity)
    if weight.sum() < len(residual) / 2 or weight @ wander > WANDERS * weight.sum() * np.mean(samples.velocity**2):
        return math.sqrt(max(0.0, float(np.mean(residual**2)) - samples.noise**2))
    mean, scatter_ = between(residual)
    repeats = weight @ (mean**2 - scatter_ / np.maximum(count, 1)) / weight.sum()
    return math.sqrt(max(0.0, float(repeats)))


def _of_parts(influence: Array, part: Rows) -> tuple[float, float]:
    sums = np.bincount(part, influence)[np.bincount(part) > 0]
    return mean_uncertainty(len(sums) * sums)


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the sum of squares is least.

    Attributes
    ----------
    parameters : ndarray, shape (p,)
        The parameters.
    residual : ndarray, shape (n,)
        Data minus model.
    jacobian : ndarray, shape (n, p)
        Derivative of the model by each parameter.
    settled : bool
        Whether the last step changed no parameter.
    """

    parameters: Array
    residual: Array
    jacobian: Array
    settled: bool

    @property
    def squares(self) -> float:
        """The sum of squares."""
        return float(self.residual @ self.residual)

    @property
    def sd(self) -> Array:
        """Standard deviation of each parameter, for residuals that are independent and alike."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def covariance(self) -> Array:
        """Of the parameters, for residuals that are independent and alike."""
        freedom = max(1, len(self.residual) - len(self.parameters))
        return inverse_normal(self.jacobian) * (self.squares / freedom)


def inverse_normal(jacobian: Array) -> Array:
    """(J'J)^-1 by the factor R of J, its columns scaled to unit length."""
    lengths = np.linalg.norm(jacobian, axis=0)
    lengths[lengths == 0] = 1.0
    back = np.linalg.pinv(np.linalg.qr(jacobian / lengths, mode="r"))
    return np.asarray(back @ back.T / np.outer(lengths, lengths))


def minimise(
    model: Callable[[Array], Array], data: ArrayLike, start: ArrayLike, *, settled_at: float = SHARP, most: int = STEPS
) -> Minimum:
    r"""The parameters of a model that leave the least sum of squares, from a start.

    Steps :math:`(J^T J + \lambda D^2)\,\delta = J^T r` by the factors of J, D the largest length that each column has
    had (Marquardt 1963, More 1978), lambda by the gain of the step before (Nielsen 1999), bent along the model's
    curvature (Transtrum and Sethna 2012). A step to where the model has no finite value, or that the curvature does
    not trust, is no step.

    Parameters
    ----------
    model : callable
        Takes the parameters, gives n values.
    data : array_like, shape (n,)
        What they are to be.
    start : array_like, shape (p,)
        Where to begin.
    settled_at : float
        Share of every parameter: a step that changes none by more ends the search.
    most : int
        Steps after which it ends in any case.

    Returns
    -------
    Minimum

    Raises
    ------
    EstimateError
        Fewer data than parameters, or the model has no finite value at the start.

    Examples
    --------
    >>> x = np.linspace(0, 3, 50)
    >>> minimum = minimise(lambda b: b[0] * np.exp(-b[1] * x), 2 * np.exp(-0.7 * x), [1.0, 1.0])
    >>> minimum.parameters.round(9).tolist()
    [2.0, 0.7]
    """
    data, place = np.asarray(data, dtype=float), np.array(start, dtype=float)
    if len(data) <= len(place):
        raise EstimateError(
            f"{len(data)} samples for {len(place)} parameters", "there are more samples", "give a longer record"
        )
    residual = data - model(place)
    if not np.isfinite(residual).all():
        raise EstimateError("the model has no finite value at the start", "a fit begins at one", "start it elsewhere")
    damping, growth, settled, fresh = 1e-3, 2.0, False, True
    scale = np.zeros(len(place))
    for _ in range(most):
        if fresh:
            jacobian = slopes(model, place)
            scale = np.maximum(scale, np.linalg.norm(jacobian, axis=0))
            scale[scale == 0] = 1.0
        step = _step(jacobian, residual, scale * np.sqrt(damping))
        expected = float(step @ (damping * scale**2 * step + jacobian.T @ residual))
        with np.errstate(all="ignore"):
            bend = _bend(model(place + BENT * step), data - residual, jacobian @ step)
            second = _step(jacobian, -bend, scale * np.sqrt(damping)) / 2 if np.isfinite(bend).all() else np.inf * step
            trusted = np.linalg.norm(scale * second) <= STRAIGHT * np.linalg.norm(scale * step)
            step = step + second if trusted else step
            after = data - model(place + step)
            gained = float(residual @ residual - after @ after) if np.isfinite(after).all() else -np.inf
        settled = bool(np.all(np.abs(step) <= settled_at * np.abs(place)))
        fresh = gained > 0 and (trusted or damping > STIFF)
        if fresh:
            place, residual = place + step, after
            damping *= max(1 / 3, 1 - (2 * gained / expected - 1) ** 3) if expected > 0 else 1.0
            growth = 2.0
        else:
            damping, growth = damping * growth, growth * 2
        if settled or damping > GREATEST:
            break
    return Minimum(place, residual, slopes(model, place), settled or damping > GREATEST)


def _bend(ahead: Array, here: Array, along: Array) -> Array:
    """The second derivative of the model along a step, from its value a part of the step ahead."""
    return np.asarray(2 / BENT * ((ahead - here) / BENT - along))


def _step(jacobian: Array, residual: Array, damping: Array) -> Array:
    """The damped step, by orthogonal factors of the columns, which keep the digits that normal equations lose."""
    tall = np.vstack([jacobian, np.diag(damping)])
    lengths = np.linalg.norm(tall, axis=0)
    wanted = np.concatenate([residual, np.zeros(len(damping))])
    return np.asarray(np.linalg.lstsq(tall / lengths, wanted, rcond=None)[0] / lengths)


def slopes(model: Callable[[Array], Array], place: Array) -> Array:
    """The derivative of a model by each parameter, (n, p), by central differences of fourth order."""
    columns = []
    with np.errstate(all="ignore"):
        for index, value in enumerate(place):
            width = STEP * (abs(value) if value else 1.0)
            near, far = (_difference(model, place, index, times * width) for times in (1, 2))
            column = (4 * near - far) / 3
            columns.append(column if np.isfinite(column).all() else near)
    return np.column_stack(columns)


def _difference(model: Callable[[Array], Array], place: Array, index: int, width: float) -> Array:
    up, down = place.copy(), place.copy()
    up[index] += width
    down[index] -= width
    return np.asarray((model(up) - model(down)) / (up[index] - down[index]))
