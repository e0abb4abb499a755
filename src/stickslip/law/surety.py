"""How sure the parameters of a fitted law are, and which of them the records can not tell.

Which of several fitted laws the records leave possible, where none of them leaves noise alone.

What a law leaves over is mostly error of the model: a gain that is 1 % off, a surface that is not even. Its variance is
taken from what is left of each channel of each record, and what lies between two reversals counts as one story, so that
no sample is taken for a proof of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.law.search import Knob, Point, Problem, Slopes, descend, rows_of, without_starts
from stickslip.law.start import thinned_out
from stickslip.law.stretch import Sensor
from stickslip.laws.guessing import family_of
from stickslip.statistics import correlation_time, mean_uncertainty, student

Array = NDArray[np.float64]

UNSURE = 0.25  # of a coordinate: a wider deviation is looked at by the likelihood itself
REACH = (0.7, 1.6, 3.2, 7.0)  # steps of the coordinate that the look takes, to three decades away
FAINT = 1e-12  # of the sharpest direction: below it a direction is not seen at all
HALVINGS = 3
CLOSE = 10  # passes of a descent that starts near its end, damper, spring and gains among what is turned
Key = tuple[str, int]


@dataclass(frozen=True, eq=False)
class Surety:
    """Standard deviation, freedom and ends of each knob's coordinate, and the correlations between them."""

    sd: Array
    freedom: Array
    ends: Array  # (p, 2)
    correlations: Array


def surety(problem: Problem, point: Point, tell: Callable[[], None]) -> Surety:
    """Intervals that hold when residuals are correlated: the sandwich, summed over time as neighbours are alike.

    On a rough surface neighbours are also those that pass the same place.

    Each row's influence on the parameters is ``G^-1 A' r``, G = A'A, A the derivatives less what the starts take over;
    the parameters vary as its sum does. A parameter that is hardly seen gets the ends of its likelihood instead.
    """
    size = len(problem.knobs)
    slopes = problem.slopes(point) if size else None
    if slopes is None:
        wide = np.full(size, math.inf)
        return Surety(wide, np.ones(size), np.column_stack([-wide, wide]), np.eye(size))
    seen = sum((np.sum(s.shared**2, axis=0) for s in slopes), np.zeros(size)) > 0
    sd, freedom, widths, correlations = np.full(size, math.inf), np.ones(size), np.ones(size), np.eye(size)
    if seen.any():
        few = [Slopes(s.shared[:, seen], s.own) for s in slopes]
        covariance, sd[seen], freedom[seen] = _sandwich(problem, point, few)
        widths[seen] = np.sqrt(np.diag(covariance))
        correlations[np.ix_(seen, seen)] = covariance / np.outer(widths[seen], widths[seen])
    quantile = np.array([student(max(1.0, f)) for f in freedom])
    ends = point.u[:, None] + np.outer(quantile * sd, [-1.0, 1.0])
    strays = float(np.median((sd[seen] / widths[seen]) ** 2)) if seen.any() else 1.0
    excess = max(1.0, point.chi2 / sum(map(len, point.residuals)), strays)
    faint = [k for k, knob in enumerate(problem.knobs) if sd[k] > UNSURE and knob.kind in ("log", "above")]
    if faint:
        part = thinned_out(problem)
        near = descend(part, part.at(point.u, part.own(point.starts)), passes=CLOSE, tell=tell)
        allowed = 3.84 * excess * sum(map(len, near.residuals)) / sum(map(len, point.residuals))
        for k in faint:
            low, high = (_end(part, near, k, side, allowed, tell) for side in (-1.0, 1.0))
            apart = float(point.u[k] - near.u[k])  # what thinning moved: the ends are to hold about either peak
            ends[k] = max(problem.knobs[k].least, low + min(0.0, apart)), high + max(0.0, apart)
    return Surety(sd, freedom, ends, correlations)


def _sandwich(problem: Problem, point: Point, slopes: Sequence[Slopes]) -> tuple[Array, Array, Array]:
    left = without_starts(slopes)
    normal = sum((a.T @ a for a in left), np.zeros((left[0].shape[1],) * 2))
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    values = np.maximum(values, FAINT)
    bread = (vectors / values) @ vectors.T / np.outer(scale, scale)
    variance, square = np.zeros(len(scale)), np.zeros(len(scale))
    places: dict[int, Array] = {}
    for stretch, a, r in zip(problem.stretches, left, point.residuals, strict=True):
        drive = a[sum(len(sensor.time) for sensor in stretch.sensors) :] @ bread
        scores = _over_time(stretch.sensors, a * r[:, None]) @ bread
        if problem.profile:
            for place, total in _over_places(stretch.sensors, scores, problem.profile.length).items():
                places[place] = places.get(place, np.zeros(len(scale))) + total
        for k, series in enumerate(scores.T):
            sd, worth = mean_uncertainty(len(series) * series)
            variance[k] += sd**2 + float(drive[:, k] @ drive[:, k])
            square[k] += sd**4 / worth
    freedom = np.where(square > 0, variance**2 / np.maximum(square, 1e-300), 1.0)
    if len(places) > 1:
        again = np.sum(np.square(list(places.values())), axis=0) * len(places) / (len(places) - 1)
        freedom = np.where(again > variance, np.minimum(freedom, len(places) - 1), freedom)
        variance = np.maximum(variance, again)
    return bread, np.sqrt(np.maximum(variance, 1e-300)), freedom


def _over_time(sensors: Sequence[object], scores: Array) -> Array:
    """The sum over the sensors of the rows of one instant."""
    rows = rows_of(sensors)  # type: ignore[arg-type]
    total = np.zeros((max(part.stop - part.start for part in rows), scores.shape[1]))
    for part in rows:
        total[: part.stop - part.start] += scores[part]
    return total


def _over_places(sensors: Sequence[Sensor], scores: Array, length: float) -> dict[int, Array]:
    """The sum over all passes of each part of a surface, where what a profile leaves comes back each time."""
    moved = next((sensor.readings for sensor in sensors if sensor.channel.name == "x"), None)
    if moved is None:
        return {}
    size = min(len(moved), len(scores))
    part = np.floor((moved[:size] - moved.mean()) / length).astype(int)
    return {int(place): scores[:size][part == place].sum(axis=0) for place in np.unique(part)}


def _end(problem: Problem, point: Point, k: int, side: float, allowed: float, tell: Callable[[], None]) -> float:
    """Where the likelihood, the others fitted anew, leaves the 95 % interval; infinite where it does not."""
    others = tuple(knob for j, knob in enumerate(problem.knobs) if j != k)
    least, most = problem.knobs[k].least, problem.knobs[k].most

    def rise(u: float) -> float:
        tell()
        try:
            held = _held(problem, k, u)
        except ModelError:  # a kinetic friction above a static one that is held, where the releases tell it
            return math.inf
        rest = np.delete(point.u, k)
        start = replace(held.at(rest, point.starts), u=rest)
        return descend(replace(held, knobs=others), start, passes=CLOSE).chi2 - point.chi2 if start.raw else math.inf

    inside = float(point.u[k])
    for reach in REACH:
        outside = min(most, max(least, float(point.u[k]) + side * reach))
        if rise(outside) > allowed:
            break
        inside = outside
        if outside == least:
            return least
        if outside == most:
            return math.inf
    else:
        return side * math.inf
    for _ in range(HALVINGS):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if rise(middle) <= allowed else (inside, middle)
    return (inside + outside) / 2


def _held(problem: Problem, k: int, u: float) -> Problem:
    """The problem with one knob held at a coordinate."""
    every = np.zeros(len(problem.knobs))
    every[k] = u
    only: Sequence[Knob] = (problem.knobs[k],)
    held = replace(problem, knobs=tuple(only))
    others = tuple(knob for j, knob in enumerate(problem.knobs) if j != k)
    return replace(problem, oscillator=held.system(np.array([u])), knobs=others)


"""A channel, and the number of its record."""

FEIGNED = 1.5  # times, geometric mean over the stories, that a rough surface may make a rigid law leave more
CALIBRATIONS = 3.0  # times the calibration's error, below which an effect is not to be told from it
CERTAIN = 0.999  # the most that is said: nobody knows what was not tried
BLUNT = 4.0  # of the criterion, by which the odds between families fall e-fold; 2 were the stories Gaussian
NOISY = 2.5  # times the noise's variance, geometric mean over the stories, that a law may leave and yet explain all
SUPPORTED = 0.95  # the most then said; set by hand: of 29 such servo rigs three left the truth out, at 0.945 to 0.993
UNLIKELY = 0.05  # odds to the best law, below which another is rejected


@dataclass(frozen=True, eq=False)
class Misfit:
    """What a law leaves of the records.

    Attributes
    ----------
    name : str
        The law.
    count : int
        Its parameters.
    squares : mapping of (str, int) to float
        Mean square of what is left of each channel of each record [unit of the channel, squared].
    stiff : bool
        Whether its contact gives way so little that it is a rigid one's limit.
    moved : float
        Sum of squares of how far it moved what was stated, in units of how unsure that is.
    """

    name: str
    count: int
    squares: Mapping[Key, float]
    stiff: bool = False
    moved: float = 0.0

    @property
    def family(self) -> str:
        """Rigid laws are one family; each other law is its own."""
        return family_of(self.name).name


@dataclass(frozen=True)
class Standing:
    """How a law stands among those tried.

    Attributes
    ----------
    name, family : str
        The law.
    misfit : float
        Mean square of what it leaves over the least that any law leaves, the mean over channels and records: 1 or more.
    criterion : float
        Schwarz's information criterion less that of the best law; more is worse.
    kept : bool
        Whether the records leave it possible.
    verdict : str
        In words.
    limit : bool
        Whether its contact is so stiff that a rigid law says the same.
    """

    name: str
    family: str
    misfit: float
    criterion: float
    kept: bool
    verdict: str
    limit: bool = False


@dataclass(frozen=True, eq=False)
class Evidence:
    """How much each channel counts: samples that tell a story of their own, and the noise [unit of the channel].

    `squares` is what the nearest law has left so far.
    """

    counts: Mapping[Key, float]
    noise: Mapping[Key, float]
    squares: Mapping[Key, float] = field(default_factory=dict)

    def weight(self, key: Key, samples: int) -> float:
        """The deviation by which so many samples of a channel count as its stories do."""
        variance = max(self.squares.get(key, 0.0), self.noise[key] ** 2)
        return math.sqrt(variance * max(1.0, samples / self.counts[key])) if key in self.counts else math.inf

    def criterion(self, law: Misfit) -> float:
        """Schwarz's, the variance of each channel unknown but for its noise: ``sum n log S + p log(sum n)``.

        With it counts how far the law had to move what was stated of springs and sensors.
        """
        left = law.squares
        likely = math.fsum(n * math.log(max(left[name], self.noise[name] ** 2)) for name, n in self.counts.items())
        return likely + law.moved + law.count * math.log(max(2.0, math.fsum(self.counts.values())))

    @property
    def supported(self) -> float:
        """The most that may be said: where the nearest law leaves more than noise, what else moved is not known."""
        total = math.fsum(self.counts.values())
        beyond = math.fsum(
            n * math.log(max(1.0, self.squares[name] / self.noise[name] ** 2)) for name, n in self.counts.items()
        )
        return SUPPORTED if beyond > total * math.log(NOISY) else CERTAIN

    @property
    def allowance(self) -> float:
        """Of the criterion, by which a rigid law may be worse and yet true: rough surfaces end strokes elsewhere."""
        return math.log(FEIGNED) * math.fsum(self.counts.values())

    def over(self, squares: Mapping[Key, float], best: Mapping[Key, float]) -> float:
        """What is left over what another law, or any law, leaves: the mean over channels and records."""
        floors = {name: noise**2 for name, noise in self.noise.items()}
        return float(np.mean([max(squares[n], low) / max(best[n], low) for n, low in floors.items()]))


def independent(residual: Array) -> float:
    """How many samples that tell each a story of their own a residual holds."""
    return len(residual) / correlation_time(residual)


def standings(
    misfits: Sequence[Misfit], evidence: Evidence, *, likely: Mapping[str, float] | None = None
) -> tuple[list[Standing], float]:
    """The laws, the best one first, those kept that the records leave possible; and how likely the truth is among them.

    `likely` is how probable each rigid law is by the friction around rest.
    """
    order = sorted(misfits, key=lambda each: evidence.criterion(each))
    limits = _limits(order, evidence)
    order.sort(key=lambda each: each.name in limits)
    inner, sure = _within([each for each in order if each.family == order[0].family], evidence, likely)
    best = next(each for each in order if each.name == next(iter(inner)))
    order.sort(key=lambda each: each is not best)
    least = {key: min(each.squares[key] for each in order) for key in evidence.noise}
    ratios = {each.name: evidence.over(each.squares, least) for each in order}
    odds = _odds([each for each in order if each.name not in limits], best, evidence)
    near = {name for name, each in odds.items() if each > UNLIKELY}
    level = evidence.criterion(best)
    told = []
    for each in order:
        worse = evidence.criterion(each) - level
        kept = each.name in inner or each.name in near
        words = inner.get(each.name) or ("not rejected" if kept else f"rejected: {_why(each, best, ratios, worse)}")
        limit = each.name in limits
        if limit:
            words = "so stiff that it is a rigid contact, and explains nothing more"
        told.append(Standing(each.name, each.family, ratios[each.name], worse, kept, words, limit))
    families = [max(odds[each.name] for each in order if each.family == name and each.name in odds)
                for name in dict.fromkeys(each.family for each in order if each.name in odds)]  # fmt: skip
    right = sure + math.fsum(each for each in families if each > UNLIKELY)
    return told, min(CERTAIN, right / (1 + math.fsum(families)))


def _odds(order: Sequence[Misfit], best: Misfit, evidence: Evidence) -> dict[str, float]:
    """Of the laws of other families against the best law's family, by the criterion."""
    worth = {each.name: evidence.criterion(each) for each in order}
    least = min(worth[each.name] for each in order if each.family == best.family)
    found = {}
    for each in order:
        if each.family != best.family:
            worse = max(0.0, worth[each.name] - least - (evidence.allowance if each.family == "rigid" else 0.0))
            found[each.name] = math.exp(-worse / BLUNT)
    return found


def _limits(order: Sequence[Misfit], evidence: Evidence) -> set[str]:
    """Laws whose contact is next to rigid, where a rigid law leaves as little: what they say is said by that."""
    worth = {each.name: evidence.criterion(each) for each in order}
    rigid = min((worth[each.name] for each in order if each.family == "rigid"), default=math.inf)
    return {each.name for each in order if each.stiff and rigid - worth[each.name] <= evidence.allowance}


def _why(law: Misfit, best: Misfit, ratios: Mapping[str, float], worse: float) -> str:
    """What speaks against a law: its parameters, its misfit, or the criterion that weighs what tells a story."""
    if law.count > best.count and ratios[law.name] <= 1.1 * ratios[best.name]:
        return "its further parameters explain nothing more"
    if ratios[law.name] <= ratios[best.name]:
        return f"it leaves more where the records tell most, its criterion {worse:.3g} worse"
    return f"misfit {times(ratios[law.name])}"


def times(ratio: float) -> str:
    """ "2.31 times", "40 times"."""
    return f"{ratio:.2f} times" if ratio < 10 else f"{ratio:.0f} times"


def _within(
    family: Sequence[Misfit], evidence: Evidence, likely: Mapping[str, float] | None
) -> tuple[dict[str, str], float]:
    """The laws of one family that are not rejected, the likeliest first, with words; and how likely they are together.

    How likely each is by what else was seen; its misfit counts where it is larger than a rough surface makes it.
    """
    worse = {each.name: evidence.criterion(each) for each in family}
    beyond = min(worse.values()) + evidence.allowance
    worth = {
        name: (likely or {}).get(name, 1.0) * math.exp(-max(0.0, each - beyond) / BLUNT) for name, each in worse.items()
    }
    total = math.fsum(worth.values()) or 1.0
    order = sorted(worth, key=lambda name: -worth[name])
    kept = [name for name in order if worth[name] > UNLIKELY * total] or order[:1]
    words = "best" if len(kept) == 1 else "not rejected"
    return dict.fromkeys(kept, words), math.fsum(worth[name] for name in kept) / total


def undescribed(told: Sequence[Standing]) -> list[Standing]:
    """The laws where even the best one does not describe the records: none of them is rejected by such a misfit."""
    return [replace(each, kept=True, verdict=f"misfit {times(each.misfit)}") for each in told]
