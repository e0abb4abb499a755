"""How much viscous and how much dry friction does a free decay show? The decrement method of the thesis, chapter 6."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array, Rows, stretches
from stickslip.decay import extremes as ex
from stickslip.decay.release import RingDown, find_releases, locate
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result, Status
from stickslip.record.record import Record, require_record
from stickslip.statistics import student, weighted_mean

LOCATIONS = ("fit", "sample")
NEEDED = {"immune": 4, "plain": 3}  # extremes
EQUATIONS = {"immune": ("6.13", "6.9"), "plain": ("6.12", "6.6")}  # of the thesis: for beta, and for x_k
SMEARED = 0.3  # samples by which the instant of an acceleration's jump is not known
GAINS = -0.002  # damping ratio below which a motion is no free decay
MOST = 60  # extremes, after which pairs are no longer tried one by one


@dataclass(frozen=True, eq=False)
class Bounds:
    """The largest errors that the extremes' own errors can cause, for each number m of half cycles.

    Attributes
    ----------
    i : int
        Middle of the first difference ``X_{i+1} - X_{i-1}`` (equation 6.13).
    m : ndarray of int, shape (k,)
        Half cycles to the second difference.
    error : float
        No extreme is off by more than this, in the channel's unit: noise, half a step of the digitiser, and the top
        missed between two samples.
    rate, dry : ndarray, shape (k,)
        Viscous rate ``beta = zeta / sqrt(1 - zeta^2)`` by (6.14), and x_k by (6.9) at i [m or rad].
    rate_first_order, rate_worst : ndarray, shape (k,)
        Largest error of beta: by (6.16), and exactly.
    dry_first_order, dry_worst : ndarray, shape (k,)
        Largest error of x_k: by (6.18) with the error of beta by (6.16), which is (6.19) for m = 1; and exactly.
    best : int
        The m whose exact bound on beta is least.
    """

    i: int
    m: Rows
    error: float
    rate: Array
    rate_first_order: Array
    rate_worst: Array
    dry: Array
    dry_first_order: Array
    dry_worst: Array
    best: int


@dataclass(frozen=True, eq=False)
class Scatter:
    """What the thesis quotes as standard deviation: the scatter of single estimates along one decay.

    It is not how far their mean is off: neighbouring estimates share extremes, and the mean of (6.11) over the trace is
    the estimate from its first and last difference alone.

    Attributes
    ----------
    damping_ratio : ndarray, shape (k,)
        By (6.11) from every four extremes (three by 6.8) whose differences alternate.
    dry_displacement : ndarray, shape (k,)
        By (6.9) from every three extremes (two by 6.6), in the unit of the displacement.
    """

    damping_ratio: Array
    dry_displacement: Array

    def __repr__(self) -> str:
        both = (self.damping_ratio, self.dry_displacement)
        parts = ", ".join(f"{values.mean():.4g} with a scatter of {values.std():.2g}" for values in both)
        return f"Scatter(damping ratio, dry friction displacement: {parts})"


@dataclass(frozen=True, eq=False, repr=False)
class Decrement(Result):
    """Viscous and dry friction from the extremes of a free decay.

    Attributes
    ----------
    damping_ratio : Estimate
        Viscous damping ratio zeta.
    dry_displacement : Estimate
        ``x_k = f_k / k`` [m or rad]: the dry friction over the spring's stiffness.
    frequency : Estimate
        Natural frequency of the undamped oscillator [Hz].
    bias : Estimate
        Where the spring is at rest, in the record's zero [unit of the channel].
    model : str
        "viscous and dry", "viscous", "dry" or "no friction": what the intervals hold apart from zero.
    time, extremes, sd : ndarray, shape (k,)
        Instants [s], values and standard deviations of the extremes used, in the channel's unit.
    differences : ndarray, shape (k - 2,), or (k - 1,) of the plain form
        Their amplitude differences, which dry friction does not touch; of the plain form the sums of neighbours.
    bounds : Bounds
        What the errors of the extremes can do.
    scatter : Scatter
        Within the record, as the thesis quotes it.
    ring_down : RingDown
        The release.
    parts : tuple of Decrement
        Of several releases, each on its own; then the fields above from `time` on are those of the surest.
    status : str
        "ok", or what to beware of.
    """

    damping_ratio: Estimate
    dry_displacement: Estimate
    frequency: Estimate
    bias: Estimate
    model: str
    time: Array
    extremes: Array
    sd: Array
    differences: Array
    bounds: Bounds
    scatter: Scatter
    ring_down: RingDown
    parts: tuple[Decrement, ...]
    status: str


def decrement(record: Record, *, channel: str | None = None, form: str = "immune", location: str = "fit") -> Decrement:
    r"""How much viscous and how much dry friction, by the decrements of a free decay?

    Successive extremes of a mass released over dry friction obey (thesis, equation 6.6)
    ``X_i = -e X_{i-1} + (-1)^(i-1) (1 + e) x_k``, ``e = exp(-pi beta)``, ``beta = zeta / sqrt(1 - zeta^2)``. The
    differences of every other extreme are free of x_k and of an offset, and shrink by e from one to the next:

    .. math:: \beta = -\frac{1}{m \pi} \ln \left( (-1)^m \frac{X_{i+m+1} - X_{i+m-1}}{X_{i+1} - X_{i-1}} \right)

    (6.13), at the i and m for which the exact worst-case error is least; then x_k by (6.9), averaged over the last
    extremes, as many as make it surest. With ``form="plain"`` the sums ``X_i + X_{i+1}`` stand for the differences
    (6.8, 6.12) and (6.6) for (6.9): one extreme less is needed, and the record's zero must be where the spring rests.
    Of a velocity or an acceleration the extremes obey the same recursion with another factor at x_k.

    The interval carries the error of each extreme (noise, quantisation, sampling) through the whole estimate, to first
    order. It knows no other friction than these two; ask :func:`fit_decay` which ones the record supports.

    Parameters
    ----------
    record : Record
        With ``x`` [m], ``theta`` [rad], ``v`` or ``a``, at rest but for one release or several; see
        :func:`find_releases`.
    channel : str, optional
        Which of them.
    form : {"immune", "plain"}
        Immune to a constant offset, or not.
    location : {"fit", "sample"}
        Extremes by a local fit to the samples around them, or the largest sample.

    Returns
    -------
    Decrement

    Raises
    ------
    EstimateError
        No free decay, too few extremes, or one that is missing.
    RecordError
        As :func:`find_releases`.

    Examples
    --------
    >>> w, zeta, dry, rate, x = 2 * np.pi, 0.03, 0.02, 400, 1.0
    >>> beta, fade = zeta / np.sqrt(1 - zeta**2), np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))
    >>> t, swings = np.arange(200) / rate, [np.ones(100)]
    >>> for side in (1, -1) * 6:  # half cycles of half a second
    ...     shape = np.exp(-zeta * w * t) * (np.cos(w * t) + beta * np.sin(w * t))
    ...     swings.append(side * (dry + (abs(x) - dry) * shape))
    ...     x = -fade * x + side * (1 + fade) * dry
    >>> decay = decrement(Record.of({"x": np.concatenate([*swings, np.full(300, x)])}, fs=rate))
    >>> round(decay.damping_ratio.value, 3), round(decay.dry_displacement.value, 3), decay.model
    (0.03, 0.02, 'viscous and dry')
    """
    require_record(record)
    for name, word, choices in (("form", form, ex.FORMS), ("location", location, LOCATIONS)):
        if word not in choices:
            raise EstimateError(f"{name} = '{word}'", f"it is {' or '.join(choices)}", "choose one of them")
    releases = find_releases(record, channel=channel)
    parts, refused = [], []
    for ring_down in releases.ring_downs:
        try:
            parts.append(_of_one(ring_down, form, location))
        except EstimateError as error:
            refused.append(error)
    if not parts:
        raise refused[0]
    return parts[0] if len(parts) == 1 and not refused else _together(parts, releases.notes, refused)


def _of_one(ring_down: RingDown, form: str, location: str) -> Decrement:
    """The decrements of one release: its extremes, the pair of differences that tells beta best, then x_k."""
    times, values, sd, errors = _used(ring_down, *locate(ring_down, location))
    if len(values) < NEEDED[form]:
        raise EstimateError(
            f"{len(values)} extremes can be used",
            f"{NEEDED[form]} are needed",
            "release from farther"
            + (
                ', or choose form="plain" if the record is zero where the spring rests'
                if form == "immune" and len(values) == 3
                else ""
            ),
        )
    side = math.copysign(1.0, values[0] - ring_down.rest)
    centre = ring_down.rest if form == "immune" else 0.0
    upright = side * (values - centre)
    count, cut = _alternating(upright, errors, form, times)
    times, values, sd, errors, upright = (part[:count] for part in (times, values, sd, errors, upright))
    i, m = _best_pair(upright, errors, form, straight=ring_down.isochronous)
    last = _surest_dry(upright, sd, i, m, form)
    frequency, notes = _frequency(times, values, ring_down)
    motion = (ring_down.order, frequency.value)
    status = Status(*ring_down.notes, *cut, *notes, *_few(len(values)))

    def answer(points: Array) -> Array:
        beta = ex.rate(points, i=i, m=m, form=form)
        pull = float(np.mean(ex.dry(points, beta, form=form)[-last:]))
        return np.array([ex.damping_ratio(beta), _displacement(pull, beta, *motion), ex.offset(points, beta)])

    solution = answer(upright)
    spread = _propagated(answer, upright, sd)
    spread[1] = math.hypot(spread[1], solution[1] * _scale_sd(ring_down, frequency))
    scatter = _scatter(upright, ex.rate(upright, i=i, m=m, form=form), form, *motion)
    of_rate, of_dry = EQUATIONS[form]
    methods = f"equation {of_rate} over {m} half cycles", f"equation {of_dry}, mean of the last {last}"
    damping_ratio, dry_displacement = _frictions(ring_down, solution, spread, scatter, status, methods)
    natural = frequency.scaled(1 / math.sqrt(1 - solution[0] ** 2), "Hz", "natural frequency")
    bias = _bias(ring_down, form, centre + side * solution[2], spread[2], status)
    return Decrement(
        damping_ratio,
        dry_displacement,
        natural,
        bias,
        ex.frictions_seen(damping_ratio, dry_displacement),
        times,
        values,
        sd,
        side * ex.differences(upright, form),
        _bounds(upright, errors, i, motion),
        scatter,
        ring_down,
        (),
        status,
    )


def _frictions(
    ring_down: RingDown, values: Array, spread: Array, scatter: Scatter, status: str, methods: tuple[str, str]
) -> tuple[Estimate, Estimate]:
    """Damping ratio and dry friction; a decay that gains energy is refused."""
    length = "rad" if ring_down.unit.startswith("rad") else "m"
    named = (
        ("damping ratio", "1", scatter.damping_ratio),
        ("dry friction displacement", length, scatter.dry_displacement),
    )
    damping_ratio, dry_displacement = (
        Estimate.normal(name, value, sd=sd, unit=unit, status=status, checks=_quoted(single), method=method)
        for (name, unit, single), value, sd, method in zip(named, values, spread, methods, strict=False)
    )
    if damping_ratio.value < GAINS and damping_ratio.interval[1] < 0:
        raise EstimateError(
            f"the damping ratio would be {damping_ratio.value:.2g}",
            "a free decay loses energy",
            "something caught or drove the mass: cut the record with record.between(first, last)",
        )
    return damping_ratio, dry_displacement.within(0.0)


def _bias(ring_down: RingDown, form: str, value: float, sd: float, status: str) -> Estimate:
    """Where the extremes are centred; the plain form takes that to be zero."""
    name, unit = "rest position" if ring_down.order == 0 else "sensor offset", ring_down.unit
    if form == "plain":
        return Estimate.normal(name, 0.0, sd=0.0, unit=unit, method="taken to be zero")
    common = "what alternating extremes have in common"
    return Estimate.normal(name, value, sd=sd, unit=unit, status=status, method=common)


def _used(ring_down: RingDown, times: Array, values: Array, sd: Array, errors: Array) -> tuple[Array, ...]:
    """The extremes that the recursion holds for: the longest stretch of sound ones."""
    keep = ring_down.sound.copy()
    if ring_down.order > 0:  # a derivative is zero where the motion begins and ends
        keep[0] &= not ring_down.held
        keep[-1] &= not ring_down.stopped
    first, last = max(zip(*stretches(keep), strict=True), key=lambda run: run[1] - run[0], default=(0, 0))
    return tuple(part[first:last] for part in (times, values, sd, errors))


def _alternating(x: Array, errors: Array, form: str, times: Array) -> tuple[int, tuple[str, ...]]:
    """How many extremes shrink in turn by more than their errors; refused where the first half does not."""
    differences = ex.differences(x, form)
    signs = np.sign(differences) * np.where(np.arange(len(differences)) % 2, -1.0, 1.0)
    wrong = np.flatnonzero((signs != signs[0]) & (np.abs(differences) > 2 * errors[: len(differences)]))
    if not len(wrong):
        return len(x), ()
    count = int(wrong[0]) + len(x) - len(differences)
    when = f"{times[min(int(wrong[0]) + 1, len(x) - 1)]:.4g} s"
    if count < max(NEEDED[form], len(x) / 2):
        raise EstimateError(
            f"the extremes near {when} do not shrink in turn{'' if form == 'immune' else ' about zero'}",
            "each extreme of a free decay lies inside the one before on its side",
            "an extreme is missing or disturbed there: cut the record with record.between(first, last)"
            if form == "immune"
            else 'form="plain" takes zero for the rest position: take the offset off, or choose form="immune"',
        )
    return count, (f"the extremes from {when} on do not shrink in turn and are left out",)


def _best_pair(x: Array, errors: Array, form: str, *, straight: bool) -> tuple[int, int]:
    """The i and m for which the exact worst-case error of beta is least; the relative one, where errors may hide it."""
    differences = np.abs(ex.differences(x, form))
    both = errors[2:] + errors[:-2] if form == "immune" else errors[1:] + errors[:-1]
    off = ex.relative(both, _even(differences, both) if straight else differences)
    best, chosen = math.inf, (0, 1)
    for first in range(min(len(differences) - 1, MOST)):
        m = np.arange(1, len(differences) - first)
        later = off[first + 1 :]
        alternate = ex.differences(x, form)[first + 1 :] * (-1.0) ** m * ex.differences(x, form)[first] > 0
        with np.errstate(invalid="ignore", divide="ignore"):
            worst = -np.log((1 - later) / (1 + off[first])) / (m * math.pi)
        jumps = np.where(alternate, 1e6 * (later + off[first]) / m, math.inf)
        worst = np.where(alternate & (later < 1) & (off[first] < math.inf), worst, jumps)
        if len(worst) and worst.min() < best:
            best, chosen = float(worst.min()), (first, int(m[np.argmin(worst)]))
    if not math.isfinite(best):
        raise EstimateError(
            "no two amplitude differences have the signs of a decay",
            "the extremes of a free decay shrink in turn by more than their errors",
            "release from farther, or ask fit_decay(record), which uses every sample",
        )
    return chosen[0] + (1 if form == "immune" else 0), chosen[1]


def _even(differences: Array, errors: Array) -> Array:
    """Amplitude differences of a straight spring as evenly as they shrink, each as heavy as it is sure.

    Other frictions bend their logarithm's line a little. A pair is chosen by these: by its own noise the choice fell on
    differences that were large by chance, and of 39 noisy accelerations the damping ratio was low by 1.3 standard
    deviations in the mean.
    """
    seen = differences > errors
    if np.count_nonzero(seen) < 4:
        return differences
    number, weight = np.arange(len(differences)), differences / np.maximum(errors, 1e-9 * differences.max())
    line = np.polyfit(number[seen], np.log(differences[seen]), 2, w=weight[seen])
    return np.asarray(np.exp(np.polyval(line, number)))


def _surest_dry(x: Array, sd: Array, i: int, m: int, form: str) -> int:
    """Over how many of the last single values of x_k their mean is surest, beta's error included."""
    count = len(x) - (2 if form == "immune" else 1)
    tried = np.unique(np.round(np.geomspace(1, count, min(count, 12))).astype(int))

    def means(points: Array) -> Array:
        dry = ex.dry(points, ex.rate(points, i=i, m=m, form=form), form=form)
        return np.array([dry[-int(last) :].mean() for last in tried])

    return int(tried[np.argmin(_propagated(means, x, sd))])


def _propagated(answer: Callable[[Array], Array], x: Array, sd: Array) -> Array:
    """Standard deviations of what `answer` makes of points with independent errors, to first order."""
    total = np.zeros_like(answer(x))
    for j in np.flatnonzero(sd > 0):
        step = np.zeros_like(x)
        step[j] = 1e-3 * sd[j]
        total += ((answer(x + step) - answer(x - step)) / 2e-3) ** 2
    return np.asarray(np.sqrt(total))


def _displacement(pull: float, beta: float, order: int, frequency: float) -> float:
    """x_k from what stands for it in the recursion of the extremes of x, v or a, `frequency` that of the motion."""
    if order == 0:
        return pull
    zeta, fade = ex.damping_ratio(beta), math.exp(-math.pi * beta)
    w = 2 * math.pi * frequency / math.sqrt(1 - zeta**2)
    if order == 1:  # V = d w exp(-beta acos zeta), d less by 2 x_k from one half cycle to the next
        return pull * (1 + fade) / (2 * w * math.exp(-beta * math.acos(zeta)))
    return pull * (1 + fade) / (2 * fade * w**2)  # the largest acceleration lies just before a turn


def _scale_sd(ring_down: RingDown, frequency: Estimate) -> float:
    """Relative uncertainty of the factor from a velocity or an acceleration to x_k."""
    jump = SMEARED * 2 * ring_down.frequency / ring_down.fs if ring_down.order == 2 else 0.0
    return math.hypot(ring_down.order * frequency.sd / frequency.value, jump)


def _frequency(times: Array, values: Array, ring_down: RingDown) -> tuple[Estimate, tuple[str, ...]]:
    """The frequency of the motion from its turns, each counting by how sharp it is; and whether they are even."""
    number = np.arange(len(times))
    inner = slice(1 if ring_down.held and len(times) > 4 else 0, -1 if ring_down.stopped and len(times) > 5 else None)
    at, when = number[inner], times[inner]
    sharp = np.abs(values - ring_down.rest)[inner] + ring_down.noise
    half, first = np.polyfit(at, when, 1, w=sharp)
    freedom = max(1, len(at) - 2)
    share = sharp**2 / np.sum(sharp**2)
    spread = float(share @ (at - share @ at) ** 2)
    residual = math.sqrt(float(share @ (when - first - half * at) ** 2) * len(at) / freedom)
    sd = max(residual, 0.1 / ring_down.fs) / math.sqrt(len(at) * spread)
    notes: tuple[str, ...] = ()
    if not ring_down.isochronous:
        longer = "longer" if ring_down.unevenness > 0 else "shorter"
        change = 100 * abs(ring_down.unevenness)
        notes = (f"the first cycles are {change:.2g} % {longer} than the middle ones: the spring is not linear",)
    method = f"straight line through {len(times)} turns"
    return Estimate.normal(
        "frequency",
        1 / (2 * half),
        sd=sd / (2 * half**2),
        unit="Hz",
        method=method,
        quantile=student(freedom),
        status=notes[0] if notes else "ok",
    ), notes


def _few(count: int) -> tuple[str, ...]:
    return (f"only {count} extremes: nothing is left to check the method by",) if count < 6 else ()


def _scatter(x: Array, beta: float, form: str, order: int, frequency: float) -> Scatter:
    differences = ex.differences(x, form)
    falls = differences[1:] * differences[:-1] < 0
    rates = -np.log(-differences[1:][falls] / differences[:-1][falls]) / math.pi
    dry = np.array([_displacement(float(force), beta, order, frequency) for force in ex.dry(x, beta, form=form)])
    return Scatter(rates / np.sqrt(1 + rates**2), dry)


def _quoted(values: Array) -> tuple[str, ...]:
    if len(values) < 2:
        return ()
    return (
        f"{len(values)} single values along the decay: mean {values.mean():.4g}, scatter {values.std(ddof=1):.2g}"
        " (not the uncertainty)",
    )


def _bounds(x: Array, errors: Array, i: int, motion: tuple[int, float]) -> Bounds:
    """Worst cases at this i for every m that the extremes allow; `motion` is what was derived, and its frequency."""
    i = min(max(i, 1), len(x) - 3) if len(x) >= 4 else 0
    error = float(np.max(errors))
    rows = []
    for m in range(1, len(x) - i - 1 if i else 0):
        try:
            beta = ex.rate(x, i=i, m=m)
        except EstimateError:
            break
        alpha = ex.rate_bound(x, i=i, m=m, error=error)
        pull = float(ex.dry(x, beta)[i - 1])
        psi = ex.dry_bound(x, i=i, beta=beta, dry_displacement=pull, error=error, rate_error=alpha)
        worst = (ex.rate_worst(x, i=i, m=m, error=error), ex.dry_worst(x, i=i, m=m, error=error))
        shown = [_displacement(force, beta, *motion) for force in (pull, psi, worst[1])]
        rows.append((m, beta, alpha, worst[0], *shown))
    table = np.array(rows).reshape(-1, 7)
    best = int(table[np.argmin(table[:, 3]), 0]) if len(table) else 0
    steps, *rest = (np.asarray(column) for column in table.T)
    names = ("rate", "rate_first_order", "rate_worst", "dry", "dry_first_order", "dry_worst")
    return Bounds(i=i, m=steps.astype(np.intp), error=error, best=best, **dict(zip(names, rest, strict=True)))


def _together(parts: Sequence[Decrement], notes: tuple[str, ...], refused: Sequence[EstimateError]) -> Decrement:
    """One answer of several releases: their weighted means, widened where they disagree."""
    notes = (*notes, *(f"a release is left out: {error.value}" for error in refused))
    surest = min(parts, key=lambda part: part.damping_ratio.sd)
    status = Status(*notes)
    ratio, dry, frequency, bias = (
        weighted_mean([getattr(part, name) for part in parts], of="releases", status=status)
        for name in ("damping_ratio", "dry_displacement", "frequency", "bias")
    )
    return replace(
        surest,
        damping_ratio=ratio,
        dry_displacement=dry,
        frequency=frequency,
        bias=bias,
        model=ex.frictions_seen(ratio, dry),
        parts=tuple(parts),
        status=status,
    )
