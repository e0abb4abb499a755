"""What a fit of a friction law tells: its parameters, and how sure they are."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Mask
from stickslip.errors import ModelError
from stickslip.estimate import Doubt, Estimate, Result, Status, doubts_of
from stickslip.law.driven import Sampled, Tones
from stickslip.law.search import (
    OF_MOUNTS,
    OF_SENSORS,
    SHARE,
    Knob,
    Point,
    Problem,
    Slopes,
    descend,
    rows_of,
    without_starts,
)
from stickslip.law.start import (
    Shown,
    thinned_out,
    too_few,
    value_of,
)
from stickslip.law.stretch import Sensor
from stickslip.laws.base import Law
from stickslip.laws.curved import CurvedLaw
from stickslip.oscillator import Oscillator
from stickslip.parameters import named
from stickslip.parameters import unit as unit_of
from stickslip.statistics import mean_uncertainty, student

REMAINDER = "remainder"  # the kind of doubt where a law leaves more than noise
MISFIT = 1.2  # times its noise that a law may leave of any channel and yet explain it: readings alone stray by 1 or 2 %
METHOD = "least squares of what the sensors read, the motion simulated"
STRAYED = 16  # draws of the noise of what drives the mass: a variance within a third
UNTOLD = 0.5  # of what is known of a bounded parameter beforehand: one that is no surer is hardly told by the record
UNSURE = 0.25  # of a coordinate: a wider deviation is looked at by the likelihood itself
REACH = (0.7, 1.6, 3.2, 7.0)  # steps of the coordinate that the look takes, to three decades away
FAINT = 1e-12  # of the sharpest direction: below it a direction is not seen at all
PARTAKES = 0.01  # in a direction that is not seen: rounding leaves 1e-7 of it in the others
HALVINGS = 3
CLEAR = 0.05  # of what chi squared may rise by: a step that lowers it by less decides no end
CLOSE = 10  # passes of a descent that starts near its end, damper, spring and gains among what is turned


@dataclass(frozen=True, eq=False)
class Traces:
    """What was measured and what the fitted law predicts, by channel.

    Attributes
    ----------
    time : mapping of str to ndarray
        Time [s] of the rows that were fitted, on the record's clock.
    measured, fitted : mapping of str to ndarray
        Readings, and what the sensor would have read.
    """

    time: Mapping[str, Array]
    measured: Mapping[str, Array]
    fitted: Mapping[str, Array]


@dataclass(frozen=True, eq=False, repr=False)
class LawFit(Result):
    """A fitted law.

    Attributes
    ----------
    oscillator : Oscillator
        The oscillator with the fitted values.
    parameters : mapping of str to Estimate
        What was fitted, by the names of :meth:`Oscillator.having`; of a sensor ``x.gain`` and ``x.delay``, of its
        mount ``a.frequency`` and ``a.damping`` over those stated, of several records ``x.gain.1``, ``x.gain.2`` ...
    correlations : ndarray (p, p)
        Between the parameters, in their order; of a rough surface without its sliding friction.
    noise : mapping of str to float
        Standard deviation of each channel's noise, as stated or found.
    residual : mapping of str to float
        Root mean square of what is left of each channel.
    chi2 : float
        Sum of squares of what is left, in units of the noise.
    samples : int
        Number of readings.
    count : int
        Number of parameters, those of the starts and the sensors' offsets left out.
    traces : tuple of Traces
        One for each record.
    surface : str
        "even", or "rough" with the profile of a ``RoughSurface``.
    status : str
        "ok", or why the fit should not be trusted.
    checks : tuple of str
        What was checked, with the numbers.
    """

    oscillator: Oscillator
    parameters: Mapping[str, Estimate]
    correlations: Array
    noise: Mapping[str, float]
    residual: Mapping[str, float]
    chi2: float
    samples: int
    count: int
    traces: tuple[Traces, ...]
    surface: str
    status: str = "ok"
    checks: tuple[str, ...] = field(default=())

    @property
    def law(self) -> Law | CurvedLaw:
        """The fitted law."""
        return self.oscillator.law

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every parameter fitted."""
        return tuple(self.parameters.values())

    @property
    def misfit(self) -> Mapping[str, float]:
        """Residual of each channel over its noise; 1 where the law explains everything but the noise."""
        return {name: self.residual[name] / self.noise[name] for name in self.residual}

    def doubted(self, *reasons: Doubt | str) -> LawFit:
        """The fit with what speaks against its parameters, each that bears no doubt yet."""
        status = Status(*reasons)
        return replace(self, parameters={key: one.doubted(status) for key, one in self.parameters.items()})

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "law": type(self.law).__name__,
            "values": {key: value for key, value in vars(self.law).items() if isinstance(value, float)},
            "surface": self.surface,
            "misfit": dict(self.misfit),
            "status": self.status,
            "checks": list(self.checks),
            "estimates": [estimate.to_dict() for estimate in self.estimates],
        }


def teller(progress: Callable[[float], object] | None, expected: float) -> Callable[[], None]:
    """Progress that comes nearer to its end with each call, as nobody knows how many there will be."""
    calls = 0

    def tell() -> None:
        nonlocal calls
        calls += 1
        if progress:
            progress(1 - math.exp(-calls / expected))

    return tell


def answered(
    problem: Problem,
    point: Point,
    sure: Surety | None,
    shown: Sequence[Shown],
    noise_of: Callable[[str], float] | None = None,
) -> LawFit:
    """What a search has found, as it is told; `noise_of` a channel, where it was weighed by more."""
    system = replace(problem, profile=None).system(point.u)
    traces, sums, counts, noise = [], dict[str, float](), dict[str, int](), dict[str, float]()
    for j in range(len(problem.stretches)):
        stretch, time, measured, fitted = point.stretches[j], {}, {}, {}
        gains = problem.sensor_knobs(point.u, "gain", j)
        for sensor, raw, passed in zip(stretch.sensors, point.raw[j], point.passed[j], strict=True):
            name = sensor.channel.name
            beside = sensor.readings - gains.get(name, 1.0) * raw
            left = sensor.noise * sensor.freed(beside, passed)
            time[name] = shown[stretch.record].record.time[sensor.rows]
            measured[name] = sensor.readings
            fitted[name] = sensor.readings - sensor.less_known(beside, passed)
            sums[name] = sums.get(name, 0.0) + float(left @ left)
            counts[name] = counts.get(name, 0) + len(left)
            noise[name] = math.hypot(noise.get(name, 0.0), sensor.noise * math.sqrt(len(left)))
        traces.append(Traces(time, measured, fitted))
    residual = {name: math.sqrt(sums[name] / counts[name]) for name in sums}
    noise = {name: noise_of(name) if noise_of else noise[name] / math.sqrt(counts[name]) for name in sums}
    parameters = _parameters(problem, point, sure, system)
    if problem.profile:
        level = _mean_friction(problem, point, value_of(system, "kinetic"))
        parameters = {"kinetic": level, **parameters}
        system = system.having(kinetic=level.value)
    over = {name: residual[name] / noise[name] for name in residual}
    checks = tuple(f"{name} is left with {times:.3g} times its noise" for name, times in over.items())
    worries: list[Doubt | str] = [too_few(shown, sum(math.isinf(knob.prior) for knob in problem.knobs))]
    if not explained(over.values()):
        worst = max(over, key=lambda name: over[name])
        worries.append(
            Doubt(
                f"{worst} is left with {over[worst]:.3g} times its noise: the law is not the whole of it, or mass=, "
                "stiffness= or a unit is wrong",
                REMAINDER,
            )
        )
    system, surface = replace(system, drive=problem.oscillator.drive), "rough" if problem.profile else "even"
    size, count, correlations = sum(counts.values()), len(problem.knobs), _between(problem, sure)
    fit = LawFit(system, parameters, correlations, noise, residual, point.chi2, size, count, tuple(traces), surface)
    return replace(fit, status=Status(*worries), checks=checks)


def remainders(status: str) -> list[Doubt]:
    """Of the doubts behind a status those of what a law leaves."""
    return [doubt for doubt in doubts_of(status) if doubt.kind == REMAINDER]


def explained(over: Iterable[float]) -> bool:
    """Whether a law leaves no channel with more than noise, by how many times its noise each is left with."""
    return all(times <= MISFIT for times in over)


def _between(problem: Problem, sure: Surety | None) -> Array:
    """Correlations of what is reported."""
    kept = [k for k, knob in enumerate(problem.knobs) if knob.kind != "profile"]
    return sure.correlations[np.ix_(kept, kept)] if sure else np.eye(len(kept))


def _mean_friction(problem: Problem, point: Point, level: float) -> Estimate:
    """The mean of the profile; how sure, by how the profile varies along the surface."""
    values = level * np.array([k.value(u) for k, u in zip(problem.knobs, point.u, strict=True) if k.kind == "profile"])
    sd, freedom = mean_uncertainty(values[1:-1])
    mean, method = float(values[1:-1].mean()), "mean of the friction along the surface"
    checks = (f"it varies by {100 * np.std(values[1:-1]) / values[1:-1].mean():.2g} % along the surface",)
    quantile = student(freedom)
    return Estimate.normal("sliding friction", mean, sd=sd, unit="N", quantile=quantile, method=method, checks=checks)


def _parameters(problem: Problem, point: Point, sure: Surety | None, system: Oscillator) -> dict[str, Estimate]:
    parameters = {}
    for k, turned in enumerate(problem.knobs):
        if turned.kind == "profile":
            continue
        values = [valued(turned, u, system) for u in ((point.u[k], *sure.ends[k]) if sure else (point.u[k],) * 3)]
        of_sensor = turned.kind in OF_SENSORS
        unit = ("s" if turned.kind == "delay" else "1") if of_sensor else unit_of(system, turned.name)
        sd = abs(valued(turned, point.u[k] + 1e-6, system) - values[0]) / 1e-6 * float(sure.sd[k]) if sure else math.nan
        interval = (values[1], values[2]) if sure else (math.nan, math.nan)
        word = _label_of(turned, system)
        parameters[keyed(turned)] = Estimate(
            word, values[0], interval, sd, unit, METHOD, _status_of(turned, word, values, unit, sure)
        )
    return parameters


def keyed(knob: Knob) -> str:
    """The name of a parameter in a fit."""
    return knob.name if knob.stretch is None else f"{knob.name}.{knob.stretch + 1}"


def _label_of(knob: Knob, system: Oscillator) -> str:
    """What a parameter is called."""
    if knob.kind not in OF_SENSORS:
        return named(system, knob.name).name or knob.name
    kind = f"{knob.kind} over stated of the mount" if knob.kind in OF_MOUNTS else knob.kind
    return f"{kind} of {knob.channel}" + (f" in record {knob.stretch + 1}" if knob.stretch is not None else "")


def valued(knob: Knob, u: float, system: Oscillator) -> float:
    """The parameter at a coordinate, also where that is infinite; of an "above" the level itself."""
    if knob.kind == "log" and math.isinf(u):
        return math.inf if u > 0 else 0.0
    value = knob.value(u)
    return float(getattr(system.law, "kinetic", 1.0)) * (1 + value) if knob.kind == "above" else value


def _status_of(knob: Knob, word: str, values: Sequence[float], unit: str, sure: Surety | None) -> str:
    """What the records can say of a parameter, in words."""
    if sure is None:
        return "not asked how sure"
    _, low, high = values
    if knob.kind == "within" and low <= knob.value(knob.least) and high >= knob.value(knob.most):
        return f"{word} can not be told from these records: any from {low:.2g} to {high:.2g} does as well"
    if not math.isinf(high) and not math.isinf(low) and (low > 0 or knob.kind != "log"):
        return "ok"
    if low > 0 and math.isinf(high):
        return f"{word} above {low:.2g} {unit} can not be told from infinite here"
    if math.isfinite(high):
        return f"{word} below {high:.2g} {unit} can not be told from none here"
    return f"{word} can not be told from these records"


# ---- how sure a fit is


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
    the parameters vary as its sum does. A parameter that is hardly seen gets the ends of its likelihood instead; one
    that others can undo without a residual (two levels whose difference is a sensor's zero) has none.
    """
    size = len(problem.knobs)
    slopes = problem.slopes(point) if size else None
    if slopes is None:
        wide = np.full(size, math.inf)
        return Surety(wide, np.ones(size), np.column_stack([-wide, wide]), np.eye(size))
    seen = sum((np.sum(s.shared**2, axis=0) for s in slopes), np.zeros(size)) > 0
    sd, freedom, widths, correlations = np.full(size, math.inf), np.ones(size), np.ones(size), np.eye(size)
    undone = np.zeros(size, dtype=bool)
    if seen.any():
        few = [Slopes(s.shared[:, seen], s.own) for s in slopes]
        covariance, sd[seen], freedom[seen], undone[seen] = _sandwich(problem, point, few)
        widths[seen] = np.sqrt(np.diag(covariance))
        correlations[np.ix_(seen, seen)] = covariance / np.outer(widths[seen], widths[seen])
    quantile = np.array([student(max(1.0, f)) for f in freedom])
    ends = point.u[:, None] + np.outer(quantile * sd, [-1.0, 1.0])
    ends[undone] = -math.inf, math.inf
    strays = float(np.median((sd[seen] / widths[seen]) ** 2)) if seen.any() else 1.0
    excess = max(1.0, point.chi2 / sum(map(len, point.residuals)), strays)
    # over static friction the likelihood is a stair, whose slopes tell nothing of its width
    faint = [
        k
        for k, knob in enumerate(problem.knobs)
        if knob.kind == "above"
        or (sd[k] > UNSURE and knob.kind == "log" and not undone[k])
        or (knob.kind == "within" and sd[k] > UNTOLD * knob.prior)
    ]
    if faint:
        part = thinned_out(problem)
        near = descend(part, part.at(point.u, part.own(point.starts)), passes=CLOSE, tell=tell)
        allowed = 3.84 * excess * sum(map(len, near.residuals)) / sum(map(len, point.residuals))
        for k in faint:
            low, high = (_end(part, near, k, side, allowed, tell) for side in (-1.0, 1.0))
            apart = float(point.u[k] - near.u[k])  # what thinning moved: the ends are to hold about either peak
            ends[k] = max(problem.knobs[k].least, low + min(0.0, apart)), high + max(0.0, apart)
    for k, knob in enumerate(problem.knobs):
        if knob.kind == "within":
            ends[k] = np.clip(ends[k], knob.least, knob.most) + np.array([-1e-12, 1e-12])  # no end is rounded away
    return Surety(sd, freedom, ends, correlations)


def _sandwich(problem: Problem, point: Point, slopes: Sequence[Slopes]) -> tuple[Array, Array, Array, Mask]:
    left = without_starts(slopes)
    normal = sum((a.T @ a for a in left), np.zeros((left[0].shape[1],) * 2))
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    # what leaves no residual has no scores either, whose sum would call it certain
    undone = np.sqrt(np.sum(vectors[:, values < FAINT] ** 2, axis=1)) > PARTAKES
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
    variance += _of_drives(problem, point, [a @ bread for a in left])
    freedom = np.where(square > 0, variance**2 / np.maximum(square, 1e-300), 1.0)
    if len(places) > 1:
        again = np.sum(np.square(list(places.values())), axis=0) * len(places) / (len(places) - 1)
        freedom = np.where(again > variance, np.minimum(freedom, len(places) - 1), freedom)
        variance = np.maximum(variance, again)
    return bread, np.sqrt(np.maximum(variance, 1e-300)), freedom, undone


def _of_drives(problem: Problem, point: Point, influences: Sequence[Array]) -> Array:
    """The parameters' variance by the noise of a base's motion of any shape, or of its harmonics: the mass follows it.

    It is slow, and too small to be seen in how the residuals are correlated: without it 71 of 126 intervals of kinetic
    friction and damping held where x and z had 0.2 % of noise, on rigs of another integrator.
    """
    chance, totals = np.random.default_rng(0), []
    drives = [stretch.drive for stretch in problem.stretches]
    follow = any(isinstance(one, Sampled) or (isinstance(one, Tones) and len(one.tones) > 1) for one in drives)
    for _ in range(STRAYED if follow else 0):
        stretches = tuple(
            replace(one, drive=one.drive.strayed(chance)) if isinstance(one.drive, Sampled | Tones) else one
            for one in problem.stretches
        )
        strayed = replace(problem, stretches=stretches).at(point.u, point.starts)
        if strayed.residuals:  # the engine follows it
            pairs = zip(influences, strayed.residuals, point.residuals, strict=True)
            totals.append(np.sum([part.T @ (moved - r) for part, moved, r in pairs], axis=0))
    return np.mean(np.square(totals), axis=0) if totals else np.zeros(influences[0].shape[1])


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
    least, most = problem.knobs[k].least, problem.knobs[k].most

    def holds(u: float) -> bool:
        tell()
        try:
            fixed = _held(problem, point.u, k, u)
        except ModelError:  # a kinetic friction above a static one that is held, where the releases tell it
            return False
        ceiling = point.chi2 + allowed
        near = fixed.at(np.delete(point.u, k), point.starts)
        if ceiling < near.chi2 < math.inf:
            near = descend(fixed, near, passes=CLOSE, settled=CLEAR * allowed, share=2 * SHARE, enough=ceiling)
        return near.chi2 <= ceiling

    inside = float(point.u[k])
    for reach in REACH:
        outside = min(most, max(least, float(point.u[k]) + side * reach))
        if not holds(outside):
            break
        inside = outside
        if outside == least:
            return least
        if outside == most:
            return most if problem.knobs[k].kind == "within" else math.inf
    else:
        return side * math.inf
    for _ in range(HALVINGS):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return (inside + outside) / 2


def _held(problem: Problem, end: Array, k: int, u: float) -> Problem:
    """The problem with one knob held at a coordinate: of an "above" at that over the sliding friction of the `end`."""
    values = np.where(np.arange(len(end)) == k, u, end)
    others = tuple(knob for j, knob in enumerate(problem.knobs) if j != k)
    return replace(problem, oscillator=replace(problem, profile=None).system(values), knobs=others)
