"""The older ways to read a free decay, from its extremes or its envelope alone, with what each gets wrong.

The recursion that extremes follow, and what errors in them do."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.decay.release import RingDown, find_releases
from stickslip.errors import EstimateError
from stickslip.estimate import Doubt, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.statistics import least_squares, student

FORMS = ("immune", "plain")  # equations 6.11 and 6.8
LEAST = 5  # extremes
CLEAR = 5.0  # times the noise that an extreme must stand out
FREE = 4  # what the recursion is fitted by: first swing, beta, x_k, rest
PERIODS = 6  # of a Hilbert envelope: one is lost at each end

# what each way gets wrong
LOGARITHMIC = "dry friction is read as viscous damping, the more the smaller the swings"
LINEAR = "viscous damping is read as dry friction, the more the larger the swings"
EXTREMES = (
    "noise lengthens every extreme, and a sample seldom falls on one: some times less sure than the whole waveform"
)
HILBERT = "the transform's ends and the averaging bend the envelope: its interval does not hold that"


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
    shown = [word for word, friction in both if friction is not None and friction.interval[0] > 0]
    return " and ".join(shown) or "no friction"


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


@dataclass(frozen=True, eq=False, repr=False)
class EnvelopeDecay(Result):
    """What a free decay's extremes or envelope say of its friction.

    Attributes
    ----------
    damping_ratio, dry_displacement : Estimate or None
        Damping ratio, and dry friction over the stiffness [m or rad]; None where the method knows no such friction.
    frequency : Estimate
        Undamped natural frequency [Hz].
    method : str
        In words.
    bias : str
        What it gets wrong, in words.
    status : str
        "ok", or in words what to beware of.
    """

    damping_ratio: Estimate | None
    dry_displacement: Estimate | None
    frequency: Estimate
    method: str
    bias: str
    status: str

    @property
    def model(self) -> str:
        """The frictions that the intervals hold apart from zero, in words."""
        return frictions_seen(self.damping_ratio, self.dry_displacement)


def log_decrement(record: Record, *, channel: str | None = None) -> EnvelopeDecay:
    r"""Which damping ratio explains a free decay, if all of its damping were viscous?

    The logarithmic decrement: a line through ``ln |X_i|`` of all extremes falls by ``pi zeta / sqrt(1 - zeta^2)`` each
    half cycle. Dry friction is read as viscous damping, ``(2 / pi) x_k / X`` too much at the amplitude X.

    Parameters
    ----------
    record : Record
        With a release in ``x`` or ``theta``; of several the first is read.
    channel : str, optional
        Which of them.

    Returns
    -------
    EnvelopeDecay

    Raises
    ------
    RecordError
        A channel is missing or broken.
    EstimateError
        No free decay, or fewer than five extremes that stand clear of the noise.

    Examples
    --------
    >>> t = np.arange(4000) / 200
    >>> decay = log_decrement(Record.of({"x": np.exp(-0.1 * t) * np.cos(2 * np.pi * t)}, fs=200))
    >>> round(decay.damping_ratio.value * 2 * np.pi, 3)
    0.1
    """
    ring_down, sizes, numbers = _extremes(record, channel)
    line = least_squares(np.column_stack([numbers, np.ones(len(numbers))]), np.log(sizes))
    method = f"logarithmic decrement over {len(sizes)} extremes"
    slope = line.estimate(0, "damping ratio", "1", method)
    damping = slope.scaled(-1 / math.pi, "1")
    excess = 2 / math.pi * float(_dry(sizes, numbers)) / float(np.median(sizes))
    biased = "the amplitudes do not fall as a power: dry friction is read as viscous"
    status = "ok" if excess < 0.1 * damping.value else biased
    return EnvelopeDecay(damping, None, _frequency(ring_down, damping.value, method), method, LOGARITHMIC, status)


def linear_decrement(record: Record, *, channel: str | None = None) -> EnvelopeDecay:
    r"""Which dry friction explains a free decay, if all of its damping were dry?

    A line through ``|X_i|`` of all extremes falls by ``2 x_k`` each half cycle. Viscous damping is read as dry
    friction, ``(pi / 2) zeta X`` too much at the amplitude X.

    Parameters
    ----------
    record : Record
        With a release in ``x`` or ``theta``; of several the first is read.
    channel : str, optional
        Which of them.

    Returns
    -------
    EnvelopeDecay

    Raises
    ------
    RecordError
        A channel is missing or broken.
    EstimateError
        No free decay, or fewer than five extremes that stand clear of the noise.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> half = np.minimum(np.floor(2 * t), 9)
    >>> x = (0.1 - 0.01 * half - 0.005) * np.cos(2 * np.pi * t) + 0.005 * (-1) ** half
    >>> decay = linear_decrement(Record.of({"x": np.where(t < 4.5, x, 0.0)}, fs=200))
    >>> round(decay.dry_displacement.value, 4)
    0.005
    """
    ring_down, sizes, numbers = _extremes(record, channel)
    line = least_squares(np.column_stack([numbers, np.ones(len(numbers))]), sizes)
    method = f"linear decrement over {len(sizes)} extremes"
    dry = line.estimate(0, "dry friction displacement", ring_down.unit, method).scaled(-0.5, ring_down.unit)
    bent = np.polyfit(numbers, sizes, 2)[0] * numbers[-1] ** 2
    biased = "the amplitudes do not fall on a line: viscous damping is read as dry"
    status = "ok" if abs(bent) < 0.1 * sizes[0] else biased
    return EnvelopeDecay(None, dry, _frequency(ring_down, 0.0, method), method, LINEAR, status)


def extreme_decay(
    record: Record, *, channel: str | None = None, restoring: Literal["linear", "pendulum"] = "linear"
) -> EnvelopeDecay:
    r"""Which viscous and dry friction explain the extremes of a free decay, whatever its clock did?

    Least squares over all extremes, about a free rest position, on ``|X_(i+1)| = E |X_i| - (1 + E) x_k`` with ``E =
    exp(-pi zeta / sqrt(1 - zeta^2))`` (Feeny and Liang, JSV 195, 149, 1996). A pendulum's swings fall by the energy
    that each takes, ``2 x_k A + 16 zeta [E(k) - (1 - k^2) K(k)]`` with ``k = sin(A / 2)``, over ``sin A``, A its mean
    amplitude. Times do not enter: it is the method for records whose clock can not be trusted. It uses two samples of
    each cycle: its scatter is a few times the least possible, and noise lengthens every extreme.

    Parameters
    ----------
    record : Record
        With a release in ``x`` or ``theta``; of several the first is read.
    channel : str, optional
        Which of them.
    restoring : {"linear", "pendulum"}
        The spring's law: x, or sin x (`theta` in rad from the vertical).

    Returns
    -------
    EnvelopeDecay

    Raises
    ------
    RecordError
        A channel is missing or broken.
    EstimateError
        No free decay, or fewer than five extremes that stand clear of the noise.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> half = np.minimum(np.floor(2 * t), 9)
    >>> x = (0.1 - 0.01 * half - 0.005) * np.cos(2 * np.pi * t) + 0.005 * (-1) ** half
    >>> decay = extreme_decay(Record.of({"x": np.where(t < 4.5, x, 0.0)}, fs=200))
    >>> round(decay.dry_displacement.value, 4), abs(decay.damping_ratio.value) < 1e-4
    (0.005, True)
    """
    ring_down, sizes, numbers = _extremes(record, channel)
    signs = math.copysign(1.0, ring_down.amplitude) * (-1.0) ** numbers
    (beta, dry), (beta_sd, dry_sd) = _fitted_swings(sizes, numbers, signs, restoring)
    method, quantile = f"least squares over {len(sizes)} extremes", student(max(1, len(sizes) - FREE))
    common: dict[str, Any] = {"method": method, "quantile": quantile}
    sd = beta_sd / (1 + beta**2) ** 1.5
    damping = Estimate.normal("damping ratio", damping_ratio(beta), sd=sd, unit="1", **common)
    name = "dry friction displacement"
    displacement = Estimate.normal(name, dry, sd=dry_sd, unit=ring_down.unit, **common).within(0.0)
    return EnvelopeDecay(
        damping,
        displacement,
        _frequency(ring_down, damping.value, common["method"]),
        common["method"],
        EXTREMES,
        Status(*([Doubt.few(len(sizes), "extreme")] if len(sizes) < 8 else [])),
    )


def hilbert_decay(record: Record, *, channel: str | None = None) -> EnvelopeDecay:
    r"""Which viscous and dry friction explain the envelope of a free decay?

    FREEVIB (Feldman 2011): the envelope A of the analytic signal obeys ``-dA/dt = zeta w A + (2 / pi) w x_k``, a line
    in A, fitted by least squares to the envelope averaged over a period. Half a period is lost at each end, and the
    averaging and the transform's ends bend the envelope.

    Parameters
    ----------
    record : Record
        With a release in ``x`` or ``theta``; of several the first is read.
    channel : str, optional
        Which of them.

    Returns
    -------
    EnvelopeDecay

    Raises
    ------
    RecordError
        A channel is missing or broken.
    EstimateError
        No free decay, or fewer than six periods of it.

    Examples
    --------
    >>> t = np.arange(8000) / 200
    >>> decay = hilbert_decay(Record.of({"x": np.exp(-0.1 * t) * np.cos(2 * np.pi * t)}, fs=200))
    >>> round(decay.damping_ratio.value * 2 * np.pi, 2)
    0.1
    """
    from scipy.signal import hilbert

    ring_down = _displacement(record, channel)
    size = max(3, round(ring_down.fs / ring_down.frequency))
    moved = ring_down.samples[ring_down.motion] - ring_down.rest
    moved = moved[: len(moved) // size * size]
    if len(moved) < PERIODS * size:
        raise EstimateError(
            f"{len(moved) // size} periods", f"an envelope needs {PERIODS}", "use log_decrement or fit_decay instead"
        )
    envelope = np.convolve(np.abs(hilbert(moved)), np.full(size, 1 / size), mode="valid")[
        size // 2 : -(size // 2) or None
    ]
    fall = (envelope[size:] - envelope[:-size]) * ring_down.fs / size
    level = envelope[size // 2 : size // 2 + len(fall)]
    clear = level > max(CLEAR * ring_down.noise, 0.02 * float(level.max()))
    line = least_squares(np.column_stack([level, np.ones(len(level))])[clear], -fall[clear])
    method = "Hilbert envelope (FREEVIB)"
    w = 2 * math.pi * ring_down.frequency
    damping = line.estimate(0, "damping ratio", "1", method).scaled(1 / w, "1")
    dry = line.estimate(1, "dry friction displacement", ring_down.unit, method)
    dry, frequency = dry.scaled(math.pi / (2 * w), ring_down.unit), _frequency(ring_down, damping.value, method)
    return EnvelopeDecay(damping, dry, frequency, method, HILBERT, "ok")


def _fitted_swings(sizes: Array, numbers: Array, signs: Array, restoring: str) -> tuple[Array, Array]:
    """beta and x_k for which the recursion leaves least of the extremes, and their standard deviations."""
    from scipy.optimize import least_squares as search

    def left_by(free: Array) -> Array:
        first, beta, dry, rest = map(float, free)
        swings = [first]
        for _ in range(int(numbers[-1])):
            swings.append(_next_swing(swings[-1], beta, dry, restoring))
        return np.asarray(signs * sizes - (rest + signs * np.array(swings)[numbers.astype(int)]))

    dry = _dry(sizes, numbers)
    scale = np.array([sizes[0], 1e-2, max(dry, 1e-3 * sizes[0]), 1e-2 * sizes[0]])
    fitted = search(left_by, [sizes[0], 1e-3, dry, 0.0], x_scale=scale, method="lm")
    slopes, residual = np.asarray(fitted.jac, dtype=float), np.asarray(fitted.fun, dtype=float)
    covariance = np.linalg.pinv(slopes.T @ slopes) * float(residual @ residual) / max(1, len(sizes) - FREE)
    return np.asarray(fitted.x[1:3]), np.sqrt(np.diag(covariance)[1:3])


def _next_swing(swing: float, fall: float, dry: float, restoring: str) -> float:
    """The next extreme's distance from rest; `fall` is beta."""
    from scipy.special import ellipe, ellipk

    if restoring == "linear":
        ratio = math.exp(-math.pi * fall)
        return ratio * swing - (1 + ratio) * dry
    lost = 0.0
    for _ in range(3):
        mean = swing - lost / 2
        square = math.sin(mean / 2) ** 2
        energy = 2 * dry * mean + 16 * fall * (float(ellipe(square)) - (1 - square) * float(ellipk(square)))
        lost = energy / math.sin(mean) if mean else 0.0
    return swing - lost


def _displacement(record: Record, channel: str | None) -> RingDown:
    ring_down = find_releases(record, channel=channel).ring_downs[0]
    if ring_down.order:
        raise EstimateError(
            f"channel '{ring_down.channel}'",
            "extremes and envelopes of displacements are read",
            "use fit_decay(record), which reads velocities and accelerations too",
        )
    return ring_down


def _extremes(record: Record, channel: str | None) -> tuple[RingDown, Array, Array]:
    """The release, its extremes' distances from rest and their numbers, as far as they stand clear of the noise."""
    ring_down = _displacement(record, channel)
    turns = np.asarray(ring_down.turns)
    last = len(turns) - 1 if ring_down.stopped else len(turns)  # the mass rests somewhere within the band
    sizes = np.abs(ring_down.samples[turns[:last]] - ring_down.rest)
    least = max(CLEAR * ring_down.noise, 2 * ring_down.step)
    low = np.flatnonzero(sizes < least)
    count = int(low[0]) if len(low) else last
    numbers = np.flatnonzero(ring_down.sound[:count])
    if len(numbers) < LEAST:
        raise EstimateError(
            f"{len(numbers)} extremes stand clear of the noise",
            f"{LEAST} are needed",
            "use fit_decay, or a longer record",
        )
    return ring_down, np.asarray(sizes[numbers], dtype=float), numbers.astype(float)


def _dry(sizes: Array, numbers: Array) -> float:
    """Roughly the dry friction: half of what the last third of the extremes lose in each half cycle."""
    third = max(3, len(sizes) // 3)
    return max(0.0, -0.5 * float(np.polyfit(numbers[-third:], sizes[-third:], 1)[0]))


def _frequency(ring_down: RingDown, damping: float, method: str) -> Estimate:
    """From the times between like extremes."""
    turns = np.asarray(ring_down.turns)
    times = np.diff(turns[: len(turns) - ring_down.stopped])[1:] / ring_down.fs
    half = float(times.mean()) * math.sqrt(max(0.0, 1 - damping**2))
    sd = float(times.std(ddof=1)) / len(times) / half if len(times) > 1 else math.inf
    value = 1 / (2 * half)
    return Estimate.normal("natural frequency", value, sd=value * sd, unit="Hz", method=method)
