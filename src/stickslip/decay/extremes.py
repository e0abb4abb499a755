"""The extremes of a free decay: where they lie, the recursion that they follow, and what errors in them do.

With ``e = exp(-beta pi)``, ``beta = zeta / sqrt(1 - zeta^2)``, the extremes X_0, X_1, ... of a mass released over dry
friction obey (thesis, equation 6.6) ``X_i = -e X_{i-1} + (-1)^(i-1) (1 + e) x_k``, X_0 positive. Everything here takes
them as an array and counts as the thesis does: `i` is the middle of the first difference ``X_{i+1} - X_{i-1}``, and `m`
the number of half cycles to the second.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.decay.release import RingDown
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate

Array = NDArray[np.float64]

FORMS = ("immune", "plain")  # equations 6.11 and 6.8
WINDOW = 0.8  # radians on either side of an extreme that the local fit uses
CERTAIN = 3.0  # standard deviations taken as the bound of a noise
HIGHEST = 4.0  # the same for the largest of several samples


def differences(extremes: ArrayLike, form: str = "immune") -> Array:
    """The amplitude differences that shrink by -e from one to the next, free of dry friction.

    ``X_{i+1} - X_{i-1}`` for i = 1, 2, ... (equation 6.10, a constant offset cancels), or ``X_i + X_{i+1}`` for
    i = 0, 1, ... (equation 6.7).

    Examples
    --------
    >>> differences([1.0, -0.8, 0.7, -0.6]).round(3).tolist()
    [-0.3, 0.2]
    """
    x = np.asarray(extremes, dtype=float)
    return np.asarray(x[2:] - x[:-2] if form == "immune" else x[1:] + x[:-1])


def damping_ratio(beta: float) -> float:
    """The damping ratio zeta of the viscous rate ``beta = zeta / sqrt(1 - zeta^2)``."""
    return beta / math.sqrt(1 + beta**2)


def frictions_seen(damping: Estimate | None, dry_friction: Estimate | None) -> str:
    """The frictions that the intervals hold apart from zero, in words."""
    both = (("viscous", damping), ("dry", dry_friction))
    return (
        " and ".join(word for word, friction in both if friction is not None and friction.interval[0] > 0)
        or "no friction"
    )


def rate(extremes: ArrayLike, *, i: int, m: int, form: str = "immune") -> float:
    """The viscous rate beta from two differences m half cycles apart (equations 6.14, 6.12).

    Raises
    ------
    EstimateError
        The differences have signs that no decay gives: an extreme is missing, or lost in its error.
    """
    swings = differences(extremes, form)
    first = i - 1 if form == "immune" else i
    ratio = (-1) ** m * swings[first + m] / swings[first]
    if not ratio > 0:
        raise EstimateError(
            f"the differences {swings[first]:.4g} and {swings[first + m]:.4g} have signs that no decay gives",
            f"over {m} half cycles their sign changes {m} times",
            "an extreme is missing between them, or its error is larger than the difference: choose a smaller m",
        )
    return -math.log(ratio) / (m * math.pi)


def dry(extremes: ArrayLike, beta: float, *, form: str = "immune") -> Array:
    """The dry-friction displacement x_k from each pair (6.6) or triple (6.9, from i = 1) of extremes, given beta."""
    x, e = np.asarray(extremes, dtype=float), math.exp(-math.pi * beta)
    if form == "immune":
        signs = np.where(np.arange(1, len(x) - 1) % 2, -1.0, 1.0)
        return np.asarray(signs * (np.diff(x)[1:] + e * np.diff(x)[:-1]) / (2 * (1 + e)))
    signs = np.where(np.arange(len(x) - 1) % 2, -1.0, 1.0)
    return np.asarray(signs * (x[1:] + e * x[:-1]) / (1 + e))


def offset(extremes: ArrayLike, beta: float) -> float:
    """The constant that the extremes carry: what is left of ``X_i + e X_{i-1}`` where neighbours cancel x_k."""
    x, e = np.asarray(extremes, dtype=float), math.exp(-math.pi * beta)
    centres = (x[1:] + e * x[:-1]) / (1 + e)
    return float(np.mean((centres[1:] + centres[:-1]) / 2))


def rate_bound(extremes: ArrayLike, *, i: int, m: int, error: float, beta: float | None = None) -> float:
    """To first order, the largest error of beta if no extreme is off by more than `error` (equation 6.16).

    ``alpha = 2 (1 + e^m) error / (m pi e^m |X_{i+1} - X_{i-1}|)``.
    """
    beta = rate(extremes, i=i, m=m) if beta is None else beta
    fade = math.exp(-beta * m * math.pi)
    return 2 * (1 + fade) * error / (m * math.pi * fade * abs(float(differences(extremes)[i - 1])))


def relative(errors: Array, values: Array) -> Array:
    """Errors over the sizes of differences; infinite where extremes read in counts are equal, which tells nothing."""
    return np.divide(errors, values, out=np.full_like(values, math.inf), where=values > 0)


def rate_worst(extremes: ArrayLike, *, i: int, m: int, error: float | Array) -> float:
    """The largest error of beta itself, not to first order: the later difference smaller, the earlier one larger.

    ``-ln((1 - 2 error / |later|) / (1 + 2 error / |earlier|)) / (m pi)``; infinite where the error may hide the later
    difference. With one error for each extreme, the two of each difference are added.
    """
    swings = np.abs(differences(extremes))
    errors = np.broadcast_to(np.asarray(error, dtype=float), np.shape(extremes))
    off = relative(errors[2:] + errors[:-2], swings)
    if off[i - 1 + m] >= 1:
        return math.inf
    return -math.log((1 - off[i - 1 + m]) / (1 + off[i - 1])) / (m * math.pi)


def effective_rate_bound(extremes: ArrayLike, *, errors: ArrayLike, i: int, m: int) -> float:
    """By how much can the viscous rate be off, if the errors of the extremes are known?

    To first order, by the larger error of the two differences (thesis, equation 6.25): ``alpha_e = 2 (1 + e^m) d /
    (m pi e^m |X_{i+1} - X_{i-1}|)`` with ``2 d`` the larger of ``|delta_{i+m+1} - delta_{i+m-1}|`` and
    ``|delta_{i+1} - delta_{i-1}|``, and ``e = exp(-beta pi)``. The thesis prints it without ``e^m`` in the denominator,
    which its tables hold, and with ``(-1)^(m+1)`` before ``e^m``, which is too small for even m.

    Parameters
    ----------
    extremes, errors : array_like, shape (n,)
        X_0, X_1, ... as measured, and how far each is off, in the same unit.
    i, m : int
        The middle of the first difference, and the half cycles from it to the second.

    Returns
    -------
    float
        Largest error of beta.

    Raises
    ------
    EstimateError
        The two differences have signs that no decay gives.

    Examples
    --------
    >>> x = [1.0, -0.86, 0.74, -0.63, 0.54]
    >>> round(effective_rate_bound(x, errors=[0.001, 0.001, -0.001, -0.001, 0.001], i=1, m=1), 4)
    0.0052
    """
    x = np.asarray(extremes, dtype=float)
    off = np.abs(differences(np.asarray(errors, dtype=float)))
    return rate_bound(x, i=i, m=m, error=max(float(off[i - 1 + m]), float(off[i - 1])) / 2)


def dry_bound(
    extremes: ArrayLike, *, i: int, beta: float, dry_displacement: float, error: float, rate_error: float
) -> float:
    """To first order, the largest error of x_k by (6.9) at i, given that of beta (equation 6.18)."""
    x, e = np.asarray(extremes, dtype=float), math.exp(-math.pi * beta)
    span = abs(float(x[i] - x[i - 1])) + 2 * dry_displacement
    return math.pi * e * span / (2 * (1 + e)) * rate_error + error


def dry_bound_of_four(extremes: ArrayLike, *, i: int, dry_displacement: float, error: float) -> float:
    """The same where beta is of the four extremes at i, m = 1 (equation 6.19)."""
    x = np.asarray(extremes, dtype=float)
    span = abs(float(x[i] - x[i - 1])) + 2 * dry_displacement
    return (1 + span / abs(float(x[i + 1] - x[i - 1]))) * error


def dry_worst(extremes: ArrayLike, *, i: int, m: int, error: float) -> float:
    """The largest error of x_k itself, by (6.14) and (6.9) at i, over every way that extremes can be off.

    x_k is monotonous in each extreme, or nearly: the largest of the corners ``X_j +- error`` of those used is taken.
    """
    x = np.asarray(extremes, dtype=float)

    def quantity(values: Array) -> float:
        return float(dry(values, rate(values, i=i, m=m))[i - 1])

    return _largest_at_corners(quantity, x, sorted({i - 1, i, i + 1, i + m - 1, i + m + 1}), error)


def _largest_at_corners(quantity: Callable[[Array], float], x: Array, used: list[int], error: float) -> float:
    middle, largest = quantity(x), 0.0
    for signs in itertools.product((-error, error), repeat=len(used)):
        moved = x.copy()
        moved[used] += signs
        try:
            largest = max(largest, abs(quantity(moved) - middle))
        except EstimateError:
            return math.inf
    return largest


def locate(ring_down: RingDown, how: str) -> tuple[Array, Array, Array, Array]:
    """Times [s in the record], values, standard deviations and largest errors of a decay's extremes.

    Parameters
    ----------
    ring_down : RingDown
        As :func:`~stickslip.decay.release.find_releases` gives it.
    how : {"fit", "sample"}
        By least squares on the samples near each extreme, ``X + c (cos w t - 1)`` with a c of its own on either side,
        for friction makes the curvature jump at a turn; or the largest sample.
    """
    turns = ring_down.turns.astype(float)
    if how == "fit":
        turns = np.array([_turn(ring_down, number) for number in range(len(turns))])
        even = _evenly_spaced(turns, ring_down)
        fits = np.array([_fitted(ring_down, number, turn) for number, turn in enumerate(even)])
    else:
        fits = np.array([_sampled(ring_down, number) for number in range(len(turns))])
        turns = fits[:, 0]
    times = ring_down.first + turns / ring_down.fs
    quantised = ring_down.step if ring_down.noise < ring_down.step else 0.0
    sd = np.sqrt(fits[:, 2] ** 2 + quantised**2 / 12)
    return times, fits[:, 1], sd, fits[:, 3] + quantised / 2


def _sampled(ring_down: RingDown, number: int) -> tuple[float, float, float, float]:
    """Row, value, standard deviation and bound of the largest sample near an extreme."""
    turn, half = int(ring_down.turns[number]), ring_down.fs / ring_down.frequency / 2
    reach = max(1, round(half / 4))
    first = max(0, turn - reach)
    part = ring_down.samples[first : turn + reach + 1]
    top = (number % 2 == 0) == (ring_down.amplitude > 0)  # the last extreme may lie on the side of the one before
    row = first + int(np.argmax(part) if top else np.argmin(part))
    value = float(ring_down.samples[row])
    bend = abs(value - float(ring_down.samples[ring_down.turns[max(0, number - 1)]])) / 2 or abs(ring_down.amplitude)
    missed = bend * (math.pi / half) ** 2 / 8  # of a top between two samples
    # the noise alone of a digitiser is its step's twelfth
    noise = math.sqrt(max(0.0, ring_down.noise**2 - ring_down.step**2 / 12))
    return row, value, math.hypot(noise, missed / math.sqrt(3)), HIGHEST * noise + missed


def _half(ring_down: RingDown) -> float:
    """Samples in half a cycle."""
    return ring_down.fs / ring_down.frequency / 2


def _window(ring_down: RingDown, turn: float) -> NDArray[np.intp]:
    reach = max(2.0, WINDOW / math.pi * _half(ring_down))
    return np.arange(max(0, math.ceil(turn - reach)), min(len(ring_down.samples), math.floor(turn + reach) + 1))


def _turn(ring_down: RingDown, number: int) -> float:
    """Row, with its fraction, of an extreme by a local fit; of the release and the stop as they were found."""
    turn, turning = float(ring_down.turns[number]), math.pi / _half(ring_down)
    if _at_rest(ring_down, number):
        return turn
    if ring_down.order == 2:  # the last sample before the jump at a turn is the largest
        return _sampled(ring_down, number)[0] + 0.5
    first = turn
    for _ in range(4):
        rows = _window(ring_down, turn)
        bend = np.cos(turning * (rows - turn)) - 1
        shift = np.sin(turning * (rows - turn))
        columns = (np.ones(len(rows)), bend * (rows < turn), bend * (rows > turn), shift)
        solution = np.linalg.lstsq(np.column_stack(columns), ring_down.samples[rows], rcond=None)[0]
        mean = (solution[1] + solution[2]) / 2
        step = float(solution[3] / (mean * turning)) if mean else 0.0
        turn += min(max(step, -0.1 * _half(ring_down)), 0.1 * _half(ring_down))
        if abs(step) < 1e-4:
            break
    return turn if abs(turn - first) < _half(ring_down) / 4 else first


def _at_rest(ring_down: RingDown, number: int) -> str:
    """On which side of this extreme nothing moves."""
    if ring_down.held and number == 0:
        return "before"
    return "after" if ring_down.stopped and number == len(ring_down.turns) - 1 else ""


def _evenly_spaced(turns: Array, ring_down: RingDown) -> Array:
    """The turns on one even spacing, each counting by its amplitude: where noise hides a turn, its neighbours tell.

    Of a spring that is not linear the later half alone, where the amplitude is small.
    """
    if len(turns) < 4:
        return turns
    number = np.arange(len(turns))
    weights = np.abs(ring_down.samples[ring_down.turns] - ring_down.rest)
    weights[[0, -1]] *= 1e-3  # release and stop are known less well than turns
    weights[~ring_down.sound] *= 1e-3
    first = 0 if ring_down.isochronous else len(turns) // 2
    line = np.polyfit(number[first:], turns[first:], 1, w=weights[first:])
    return np.concatenate([turns[:first], np.polyval(line, number[first:])])


def _fitted(ring_down: RingDown, number: int, turn: float) -> tuple[float, float, float, float]:
    """Row, value, standard deviation and bound of an extreme by a local fit at its instant."""
    rows, turning, still = _window(ring_down, turn), math.pi / _half(ring_down), _at_rest(ring_down, number)
    if ring_down.order == 2:
        rows = rows[rows < turn]
    bend = np.cos(turning * (rows - turn)) - 1
    columns = [np.ones(len(rows))]
    columns += [bend * (rows < turn)] if still != "before" else []
    if ring_down.order == 2:
        columns += [np.sin(turning * (rows - turn))]
    elif still != "after":
        columns += [bend * (rows > turn)]
    design = np.column_stack(columns)
    if len(rows) <= design.shape[1]:
        return _sampled(ring_down, number)
    solution = np.linalg.lstsq(design, ring_down.samples[rows], rcond=None)[0]
    residual = ring_down.samples[rows] - design @ solution
    spread = float(np.sqrt(np.linalg.pinv(design.T @ design)[0, 0]))
    noise = max(ring_down.noise, float(np.sqrt(residual @ residual / (len(rows) - design.shape[1]))))
    return turn, float(solution[0]), noise * spread, CERTAIN * noise * spread


def motion(times: Array, start: float, *, damping_ratio: float, dry_displacement: float, frequency: float) -> Array:
    """The displacement from the spring's rest at `times` [s] after a release (thesis, equations 6.4, 6.5).

    Parameters
    ----------
    times : ndarray, shape (n,)
        Since the release; before it the mass is held.
    start : float
        First extreme, from the rest position.
    damping_ratio, dry_displacement, frequency : float
        zeta, x_k, and the undamped natural frequency [Hz]. It stops where an extreme lies within x_k.

    Examples
    --------
    >>> at = motion(np.array([0.0, 0.5, 1.0, 1.5]), 1.0, damping_ratio=0.0, dry_displacement=0.2, frequency=1.0)
    >>> at.round(6).tolist()
    [1.0, -0.6, 0.2, 0.2]
    """
    zeta, w = damping_ratio, 2 * math.pi * frequency
    damped, beta = w * math.sqrt(1 - zeta**2), zeta / math.sqrt(1 - zeta**2)
    fade, half = math.exp(-math.pi * beta), math.pi / damped
    turns = [start]
    while abs(turns[-1]) > dry_displacement * (1 + 1e-9) and len(turns) * half <= times[-1] + half:
        turns.append(-fade * turns[-1] + math.copysign(1 + fade, turns[-1]) * dry_displacement)
    number = np.clip(np.floor(times / half + 1e-9), 0, max(0, len(turns) - 2)).astype(int)
    before = np.array(turns)[number]
    since = np.clip(times - number * half, 0, half)
    shape = np.exp(-zeta * w * since) * (np.cos(damped * since) + beta * np.sin(damped * since))
    if len(turns) == 1:
        return np.full_like(times, turns[0])
    return np.asarray(np.sign(before) * (dry_displacement + (np.abs(before) - dry_displacement) * shape))
