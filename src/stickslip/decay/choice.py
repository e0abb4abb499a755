"""Which motion was it? Candidates fitted to one free decay, tested against each other, and what is left undecided."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.decay.candidates import (
    ALWAYS,
    EXPONENT,
    HOPELESS,
    NUMBERS,
    STIFFER,
    STRIBECK_SPEEDS,
    BlockMeans,
    Fitted,
    first_speed,
    fit_candidates,
    fit_motion,
    highest,
    yielding,
)
from stickslip.decay.motions import MOTIONS, Restoring
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate
from stickslip.statistics import mean_uncertainty, student

SIZE = 0.05  # of each candidate's test: how often a true one is rejected
STRIBECK = "stribeck"  # the candidate
COLOURED = 0.01  # p-value of the best residual's whiteness below which its correlation counts
DRAWS = 20000  # of the greatest of correlated Student variables
NEAR = 2.0  # times the least residual: what counts where no candidate is true
APART = 1e-4  # share of a direction that the fitted parameters must leave for it to be seen
SEEN = {
    "damping_ratio": "viscous damping",
    "dry_displacement": "dry friction",
    "quadratic": "quadratic (air) damping",
    "rise": "friction that rises towards rest (Stribeck)",
    "micro_slip": "a joint in micro-slip",
    "curvature": "a spring that is not straight",
    "static": "static above kinetic friction",
    "presliding": "a contact that yields before it slides",
}


@dataclass(frozen=True, eq=False)
class Noise:
    """What the residual of the best fit says about the noise.

    Attributes
    ----------
    residual : ndarray, shape (n,)
        Of the candidate that leaves least.
    terms : int
        Parameters that it freed.
    floor : float
        Below which a residual is rounding.
    """

    residual: Array
    terms: int
    floor: float

    @cached_property
    def whiteness(self) -> float:
        """p-value of its being white."""
        return _whiteness(self.residual, self.floor)

    def along(self, row: Array) -> tuple[float, float]:
        """Standard deviation of the noise's product with a row, and its degrees of freedom."""
        count = len(self.residual)
        freedom = max(1, count - self.terms)
        if self.whiteness >= COLOURED:
            variance = max(float(self.residual @ self.residual) / freedom, self.floor**2)
            return math.sqrt(variance * float(row @ row)), float(freedom)
        sd, effective = mean_uncertainty(count * row * self.residual)
        return sd * math.sqrt(count / freedom), effective


@dataclass(frozen=True, eq=False)
class Candidate:
    """One motion tried on a free decay, and whether the record speaks against it.

    Attributes
    ----------
    fitted : Fitted
        Its least squares.
    noise : Noise
        Of the record.
    p_value : float
        Of the greatest of its test statistics.
    against : str
        The named term seen most clearly, in words; empty where none could be looked for.
    """

    fitted: Fitted
    noise: Noise
    p_value: float
    against: str

    @property
    def name(self) -> str:
        """As in ``MOTIONS``."""
        return self.fitted.motion.name

    @property
    def kept(self) -> bool:
        """Whether no named term that it lacks is seen."""
        return self.p_value >= SIZE

    @cached_property
    def whiteness(self) -> float:
        """p-value of its residual being white."""
        return _whiteness(self.fitted.residual, self.noise.floor)

    @property
    def level(self) -> float:
        """Standard deviation of what it leaves of a sample."""
        return math.sqrt(self.fitted.cost / max(1, len(self.fitted.residual) - self.fitted.jacobian.shape[1]))

    @property
    def verdict(self) -> str:
        """In words; the term named is most like what is left over, and need not be at work."""
        if self.kept:
            return f"kept (p = {self.p_value:.2g})"
        likely = "p < 1e-6" if self.p_value < 1e-6 else f"p = {self.p_value:.1g}"
        return f"rejected ({likely}): something like {self.against} is missing"

    @cached_property
    def _influences(self) -> dict[str, Array]:
        """How each parameter follows the data, the added term held."""
        columns = self.fitted.settled
        rows = np.linalg.pinv(self.fitted.jacobian[:, columns])
        return {self.fitted.motion.free[column]: row for column, row in zip(columns, rows, strict=True)}

    @cached_property
    def _term(self) -> tuple[Array, float, float]:
        """The added term's direction, and how far it may lie below and above its value: never below zero."""
        fitted, added = self.fitted, self.fitted.added
        if added is None:
            return np.zeros(len(fitted.residual)), 0.0, 0.0
        direction = fitted.jacobian[:, fitted.motion.free.index(added)]
        others = fitted.jacobian[:, fitted.settled]
        residual = direction - others @ (np.linalg.pinv(others) @ direction)
        power, value = float(residual @ residual), fitted.value(added)
        room = highest(added, self.fitted.parameters) - value
        if power <= (APART * np.linalg.norm(direction)) ** 2:
            return direction, -value, room if math.isfinite(room) else 0.0
        sd, freedom = self.noise.along(residual / power)
        reach = student(freedom) * sd
        return direction, -min(reach, value), min(reach, room)

    @cached_property
    def _yielding(self) -> float:
        """How far the dry friction ``x_k`` gives way, over itself, to a rise ``sigma`` by one.

        Their product is at work: ``x_k (1 + sigma s)`` stays, so ``x_k`` falls as a hyperbola and never to zero.
        """
        row, dry = self._influences.get("dry_displacement"), self.fitted.value("dry_displacement")
        if self.fitted.added != "rise" or row is None or dry <= 0:
            return 0.0
        return max(0.0, float(row @ self._term[0])) / dry

    def estimate(
        self, parameter: str, *, name: str | None = None, unit: str = "1", factor: float = 1.0, offset: float = 0.0
    ) -> Estimate:
        """One of its parameters with the interval that holds if this is the motion; exactly zero where it has none."""
        row = self._influences.get(parameter)
        value = self.fitted.value(parameter)
        if parameter == self.fitted.added:
            _, below, above = self._term
            low, high, sd = value + below, value + above, (above - below) / (2 * NORMAL_95)
        elif row is None:
            low = high = value
            sd = 0.0
        else:
            sd, freedom = self.noise.along(row)
            direction, below, above = self._term
            above /= 1 + above * self._yielding
            moves = [-float(row @ direction) * end for end in (below, above)]
            reach = student(freedom) * sd
            low, high = value - math.hypot(reach, min(0.0, *moves)), value + math.hypot(reach, max(0.0, *moves))
            sd = (high - low) / (2 * NORMAL_95)
        value, low, high = (factor * number + offset for number in (value, low, high))
        method = f"least squares, {self.fitted.motion.words}"
        return Estimate(name or parameter, value, (low, high), factor * sd, unit, method, self._status)

    @cached_property
    def damping_per_drift(self) -> float:
        """By how much the damping ratio is misread where dry friction rises over the decay, over that rise.

        To first order: of a rise that goes with the way slid, what least squares takes for more or less damping.
        """
        fitted = self.fitted
        count = fitted.half_cycles if fitted.forced else None
        motion, slope, _ = fitted.blocks.motion(fitted.parameters, free=("wear",), half_cycles=count)
        way = float(np.abs(np.diff(motion)).sum()) / abs(fitted.value("amplitude"))
        moved = np.linalg.pinv(fitted.jacobian) @ fitted.blocks.weighted(slope[:, 0])
        return float(moved[fitted.motion.free.index("damping_ratio")]) / way

    @property
    def _status(self) -> str:
        return "ok" if self.kept else f"{self.against} is seen beside it"


@dataclass(frozen=True, eq=False)
class Choice:
    """Which motion a free decay followed, and which others it may have followed.

    Attributes
    ----------
    model : str
        The simplest candidate that the record does not speak against.
    candidates : tuple of Candidate
        All that were tried, the simplest first.
    lack_of_fit : float
        p-value of the chosen motion's residual being white (cumulative periodogram).
    status : str
        "ok", or in words what to beware of.
    worn : str
        That friction which changes with the way slid explains the decay as well, in words; empty where it does not.
    """

    model: str
    candidates: tuple[Candidate, ...]
    lack_of_fit: float
    status: str
    worn: str = ""

    @property
    def chosen(self) -> Candidate:
        """The candidate of that name."""
        return self.candidate(self.model)

    @property
    def kept(self) -> tuple[Candidate, ...]:
        """Those not rejected; where all are, those that leave at most twice the residual of the best."""
        return tuple(self.candidate(name) for name in kept_by_all((self,)))

    def interval(self, parameter: str) -> tuple[float, float]:
        """95 % interval of a parameter, whichever of the candidates not rejected is the motion."""
        return interval_of((self,), parameter)

    def seen_beside(self, *names: str) -> str:
        """What is seen beside the motions of these names, in words; empty where one of them is not rejected."""
        tried = [candidate for candidate in self.candidates if candidate.name in names]
        if not tried or any(tested.kept for tested in tried):
            return ""
        best = min(tried, key=lambda tested: tested.fitted.motion.size)
        return self.worn or f"{self._missing(best)} is seen beside {best.fitted.motion.words}"

    def _missing(self, poor: Candidate) -> str:
        """What a candidate lacks, in words: by the one with more terms that leaves least, if that is less than half.

        The term seen most clearly is named to first order: of a contact that yields, air damping.
        """
        terms = set(poor.fitted.motion.terms)
        richer = [candidate for candidate in self.candidates if terms < set(candidate.fitted.motion.terms)]
        nearest = min(richer, key=lambda candidate: candidate.fitted.cost, default=poor)
        if nearest.fitted.cost * NEAR**2 > poor.fitted.cost:
            return poor.against
        return next((SEEN[name] for name in nearest.fitted.motion.terms if name not in terms), poor.against)

    def candidate(self, name: str) -> Candidate:
        """The candidate of a name in ``MOTIONS``."""
        return next(candidate for candidate in self.candidates if candidate.name == name)


def choose(
    times: ArrayLike,
    values: ArrayLike,
    *,
    fs: float,
    start: ArrayLike,
    counts: ArrayLike | None = None,
    restoring: Restoring = "linear",
    candidates: tuple[str, ...] = tuple(MOTIONS),
    weights: ArrayLike | None = None,
) -> Choice:
    """Which motion does a free decay follow?

    Every candidate is fitted by least squares. Each is then tested against every named term that it lacks, with the
    noise of the candidate that leaves least: a true one is rejected once in twenty. The simplest that is not rejected
    is the model; all that are not rejected give the interval that counts the model's form.

    Parameters
    ----------
    times, values : array_like, shape (n,)
        Instants [s], rising, and displacements; or centres and means of blocks of samples.
    fs : float
        Sampling rate [Hz] within a block.
    start : array_like, shape (6,)
        Rough angular frequency [rad/s], damping ratio, dry friction displacement, rest position, first amplitude from
        there (signed) and release [s].
    counts : array_like, shape (n,), optional
        Samples in each block; one when not given.
    restoring : {"linear", "pendulum"}
        The spring's law: x, or sin x.
    candidates : tuple of str
        Names in ``MOTIONS``.
    weights : array_like, shape (n,), optional
        Independent readings in each block, where they are not as many as its samples.

    Returns
    -------
    Choice

    Raises
    ------
    EstimateError
        A name that is no candidate's, or fewer samples than a fit needs.

    Examples
    --------
    >>> from stickslip.decay.motions import free_decay
    >>> t, rng = np.arange(480) / 40, np.random.default_rng(1)
    >>> x, _, _ = free_decay(t, [6.28, 0.02, 0.02, 0, 1, 0.3, 0, 0, 0, 0, 0.5, 0])
    >>> choice = choose(t, x + 1e-3 * rng.standard_normal(480), fs=40, start=[6.2, 0.02, 0.02, 0, 1, 0.3])
    >>> choice.model
    'both'
    """
    unknown = [name for name in candidates if name not in MOTIONS]
    if unknown or not candidates:
        raise EstimateError(
            f"candidates = {', '.join(unknown) or 'none'}",
            f"each is one of {', '.join(MOTIONS)}",
            "name one of them at least",
        )
    instants, data = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    sizes = np.ones(len(instants)) if counts is None else np.asarray(counts, dtype=float)
    most = max(len(MOTIONS[name].free) for name in candidates)
    if len(instants) < 3 * most:
        raise EstimateError(
            f"{len(instants)} samples", f"{most} parameters need three times as many", "give a longer record"
        )
    independent = sizes if weights is None else np.asarray(weights, dtype=float)
    blocks = BlockMeans(instants, data, sizes, independent, fs, restoring)
    return choose_fitted(fit_candidates(candidates, blocks, np.asarray(start, float)), candidates)


def choose_fitted(fits: Mapping[str, Fitted], candidates: tuple[str, ...]) -> Choice:
    """:func:`choose` among candidates that are fitted, `ALWAYS` among them."""
    fits = {name: fitted for name, fitted in fits.items() if name in {*candidates, *ALWAYS}}
    best = min(fits.values(), key=lambda fitted: fitted.cost)
    if STRIBECK in fits and _whiteness(best.residual, best.blocks.floor) < COLOURED:
        # a rise beyond the highest where it leaves noise alone: a broad one stood for the air drag of a real pendulum
        steeper = fits[STRIBECK].steeper
        if _whiteness(steeper.residual, steeper.blocks.floor) >= COLOURED:
            fits[STRIBECK] = best = steeper
    noise = Noise(best.residual, best.jacobian.shape[1], best.blocks.floor)
    tried = tuple(_tested(fitted, noise, best) for name, fitted in fits.items() if name in candidates)
    choice = _chosen(tried)
    worn = _worn(choice.chosen, fits["both"], best)
    return replace(choice, status=worn, worn=worn) if worn else choice


def _worn(chosen: Candidate, plain: Fitted, best: Fitted) -> str:
    """That friction which changes with the way slid explains the decay too, in words; empty where it does not.

    It is asked where more than viscous damping and dry friction is seen: decays of an independent integrator whose
    friction drifted by 5 to 40 % were told as quadratic damping, or as friction that rises towards rest.
    """
    plainly = chosen.kept and set(chosen.fitted.motion.terms) <= set(plain.motion.terms)
    if plainly and chosen.whiteness >= COLOURED:
        return ""
    worn = plain.worn
    least = min(worn, best, key=lambda fitted: fitted.cost)
    tested = _tested(worn, Noise(least.residual, least.jacobian.shape[1], plain.blocks.floor), least)
    if not tested.kept or tested.whiteness < COLOURED:
        return ""
    words = (
        f"dry friction that changes with the way slid (wear), by {100 * worn.value('wear'):.2g} % in a first amplitude,"
    )
    better = worn.cost < chosen.fitted.cost
    return f"{words} explains it {'better than' if better else 'as well as'} {chosen.fitted.motion.words}"


def kept_by_all(choices: Sequence[Choice]) -> tuple[str, ...]:
    """Names of the candidates that no release speaks against; where there is none, those that leave least.

    A true candidate is rejected once in twenty, however many releases look for it (Bonferroni). Least is up to twice
    the best residual of all releases together.
    """
    names = [candidate.name for candidate in choices[0].candidates]
    tried = {name: [choice.candidate(name) for choice in choices] for name in names}
    least = {name: min(one.p_value for one in candidates) for name, candidates in tried.items()}
    kept = tuple(name for name, p_value in least.items() if len(choices) * p_value >= SIZE)
    costs = {name: sum(one.fitted.cost for one in candidates) for name, candidates in tried.items()}
    return kept or tuple(name for name, cost in costs.items() if cost <= NEAR**2 * min(costs.values()))


def interval_of(choices: Sequence[Choice], parameter: str) -> tuple[float, float]:
    """95 % interval of what several releases share, whichever of the candidates not rejected is the motion."""
    ends = [
        _pooled([choice.candidate(name).estimate(parameter) for choice in choices]) for name in kept_by_all(choices)
    ]
    return min(low for low, _ in ends), max(high for _, high in ends)


def _pooled(estimates: Sequence[Estimate]) -> tuple[float, float]:
    """Interval of the mean of estimates, each as heavy as it is sure."""
    sd = np.array([estimate.sd for estimate in estimates])
    share = 1.0 * (sd == 0) if (sd == 0).any() else sd.min() ** 2 / sd**2
    share /= share.sum()
    value = share @ [estimate.value for estimate in estimates]
    low, high = (np.array([estimate.interval[side] - estimate.value for estimate in estimates]) for side in (0, 1))
    return float(value - np.linalg.norm(share * low)), float(value + np.linalg.norm(share * high))


def _chosen(tried: tuple[Candidate, ...]) -> Choice:
    """The simplest candidate kept, or the nearest of all."""
    kept = [candidate for candidate in tried if candidate.kept]
    fewest = min((candidate.fitted.motion.size for candidate in kept), default=0)
    simplest = [candidate for candidate in kept if candidate.fitted.motion.size == fewest] or tried
    best = min(simplest, key=lambda candidate: candidate.fitted.cost)
    seen = f"no candidate fits: {best.against} is seen beside {best.fitted.motion.words}"
    status = lack_of_fit(best) if kept else seen
    return Choice(best.name, tried, best.whiteness, status or "ok")


def lack_of_fit(candidate: Candidate) -> str:
    """What is left unexplained, in words; empty where the residual is white."""
    if candidate.whiteness >= COLOURED:
        return ""
    return f"the residual of {candidate.fitted.motion.words} is not white (p = {candidate.whiteness:.1g})"


def white_noise_test(residual: ArrayLike) -> float:
    """Is a residual white?

    Bartlett's cumulative periodogram: the greatest distance between the running share of its power and a straight line,
    by Kolmogorov and Smirnov's distribution (Stephens 1970 for short series).

    Parameters
    ----------
    residual : array_like, shape (n,)
        In order of time.

    Returns
    -------
    float
        p-value.

    Examples
    --------
    >>> white_noise_test(np.random.default_rng(0).standard_normal(400)) > 0.05
    True
    >>> white_noise_test(np.sin(np.arange(400.0))) < 1e-6
    True
    """
    from scipy.special import kolmogorov

    values = np.asarray(residual, dtype=float)
    power = np.abs(np.fft.rfft(values - values.mean())[1 : (len(values) + 1) // 2]) ** 2
    if len(power) < 3 or power.sum() == 0:
        return 1.0
    share = np.cumsum(power)[:-1] / power.sum()
    steps = np.arange(1, len(power))
    last = len(power) - 1
    # Sums of exponentials over their total are uniform order statistics.
    distance = max(float((steps / last - share).max()), float((share - (steps - 1) / last).max()))
    root = math.sqrt(last)
    return float(kolmogorov((root + 0.12 + 0.11 / root) * distance))


def _whiteness(residual: Array, floor: float) -> float:
    """p-value of a residual's being white; rounding is not asked."""
    return 1.0 if float(residual @ residual) <= floor**2 * len(residual) else white_noise_test(residual)


def _tested(fitted: Fitted, noise: Noise, best: Fitted) -> Candidate:
    """Does the record speak against this candidate: is a named term seen that it lacks?

    Each term gives a direction ``d``, in which the motion would move if it were at work; ``M d`` is what of it the
    fitted parameters can not imitate. ``t = (M d) r / sd`` is Student's where the candidate is true. The greatest
    ``|t|`` is set against the distribution of the greatest of so correlated variables (Hothorn, Bretz and Westfall
    2008), so that a true candidate is rejected once in twenty, however many terms are looked for.
    """
    basis, _ = np.linalg.qr(fitted.jacobian)
    names, rows = [], []
    for name, direction in _directions(fitted, best):
        rest = direction - basis @ (basis.T @ direction)
        rest -= basis @ (basis.T @ rest)
        length = np.linalg.norm(rest)
        if length > APART * np.linalg.norm(direction):
            names.append(name)
            rows.append(rest / length)
    if not names:
        return Candidate(fitted, noise, 1.0, "")
    spreads = [noise.along(row) for row in rows]
    statistics = [
        abs(float(row @ fitted.residual)) / sd if sd > 0 else 0.0 for row, (sd, _) in zip(rows, spreads, strict=True)
    ]
    greatest = int(np.argmax(statistics))
    matrix = np.array(rows)
    p_value = _greatest_p(statistics[greatest], matrix @ matrix.T, min(freedom for _, freedom in spreads))
    return Candidate(fitted, noise, p_value, SEEN[names[greatest]])


def _greatest_p(statistic: float, correlation: Array, freedom: float) -> float:
    """How often the greatest of correlated Student variables exceeds this."""
    from scipy.special import stdtr

    bound = 2 * float(stdtr(freedom, -statistic)) * len(correlation)
    if bound < SIZE / 10:
        return bound  # Bonferroni's: far out it is sharp enough
    rng = np.random.default_rng(0)
    values, vectors = np.linalg.eigh(correlation)
    normal = rng.standard_normal((DRAWS, len(values))) @ (vectors * np.sqrt(np.maximum(values, 0))).T
    greatest = np.abs(normal).max(axis=1) / np.sqrt(rng.chisquare(freedom, DRAWS) / freedom)
    return float((1 + np.count_nonzero(greatest >= statistic)) / (1 + DRAWS))


def _directions(fitted: Fitted, best: Fitted) -> list[tuple[str, Array]]:
    """How the weighted motion would move with each named term that the candidate lacks."""
    terms, blocks = fitted.motion.terms, fitted.blocks
    dry = "dry_displacement" in terms
    half_cycles = fitted.half_cycles if fitted.motion.stops else None

    def column(name: str, **shape: float) -> Array:
        parameters = fitted.parameters.copy()
        for other, value in shape.items():
            parameters[NUMBERS[other]] = value
        jacobian = blocks.motion(parameters, free=(name,), half_cycles=half_cycles)[1]
        return blocks.weighted(jacobian)[:, 0]

    wanted = ("damping_ratio", "dry_displacement", "quadratic", "curvature")
    directions = [(name, column(name)) for name in wanted if name not in terms]
    if "micro_slip" not in terms:
        directions.append(("micro_slip", column("micro_slip", exponent=EXPONENT)))
    if dry and "rise" not in terms:
        speed = first_speed(fitted.parameters)
        directions += [("rise", column("rise", stribeck_speed=share * speed)) for share in STRIBECK_SPEEDS]
    near = fitted.cost < HOPELESS * best.cost
    if fitted.motion.stops and fitted.value("dry_displacement") > 0:
        # no derivative: from rigid on, a motion goes with the root of the pre-sliding displacement
        rigid = blocks.motion(fitted.parameters, half_cycles=half_cycles)[0]
        for stiffer in STIFFER:
            moved = blocks.motion(yielding(fitted.parameters, stiffer))[0] - rigid
            directions.append(("presliding", blocks.weighted(moved)))
    if fitted.motion.stops and near and fitted.half_cycles > 1 and not fitted.motion.sticks_early:
        earlier = fit_motion(fitted.motion, blocks, fitted.parameters, half_cycles=fitted.half_cycles - 1)
        directions.append(("static", fitted.residual - earlier.residual))
    return directions
