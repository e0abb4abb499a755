"""Nonlinear least squares: Levenberg's and Marquardt's step, with derivatives by differences of fourth order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import EstimateError

Array = NDArray[np.float64]

STEP = 3e-4  # of a parameter, in a difference of fourth order: its error meets that of rounding
MOST = 5000  # steps
SETTLED = 1e-13  # of every parameter: what numbers can tell
BENT, STRAIGHT = 0.1, 0.375  # part of a step that shows how it bends; most of a step that the bend may add to it
STIFF = 1e10  # damping from which on steps are too short to bend
GREATEST = 1e20  # damping at which no step lowers the squares: the end of what numbers can tell


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
    model: Callable[[Array], Array],
    data: ArrayLike,
    start: ArrayLike,
    *,
    settled_at: float = SETTLED,
    most: int = MOST,
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
    >>> found = minimise(lambda b: b[0] * np.exp(-b[1] * x), 2 * np.exp(-0.7 * x), [1.0, 1.0])
    >>> found.parameters.round(9).tolist()
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
