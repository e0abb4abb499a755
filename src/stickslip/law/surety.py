"""How sure the parameters of a fitted law are, and which of them the records can not tell."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.law.search import SHARE, Knob, Point, Problem, Slopes, descend, rows_of, without_starts
from stickslip.law.start import thinned_out
from stickslip.law.stretch import Sensor
from stickslip.statistics import mean_uncertainty, student

Array = NDArray[np.float64]

UNSURE = 0.25  # of a coordinate: a wider deviation is looked at by the likelihood itself
REACH = (0.7, 1.6, 3.2, 7.0)  # steps of the coordinate that the look takes, to three decades away
FAINT = 1e-12  # of the sharpest direction: below it a direction is not seen at all
HALVINGS = 3
CLEAR = 0.05  # of what chi squared may rise by: a step that lowers it by less decides no end
CLOSE = 10  # passes of a descent that starts near its end, damper, spring and gains among what is turned


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
    # over static friction the likelihood is a stair, whose slopes tell nothing of its width
    faint = [
        k for k, knob in enumerate(problem.knobs) if knob.kind == "above" or (sd[k] > UNSURE and knob.kind == "log")
    ]
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
    least, most = problem.knobs[k].least, problem.knobs[k].most

    def holds(u: float) -> bool:
        tell()
        try:
            fixed = _held(problem, k, u)
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
            return math.inf
    else:
        return side * math.inf
    for _ in range(HALVINGS):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return (inside + outside) / 2


def _held(problem: Problem, k: int, u: float) -> Problem:
    """The problem with one knob held at a coordinate."""
    every = np.zeros(len(problem.knobs))
    every[k] = u
    only: Sequence[Knob] = (problem.knobs[k],)
    fixed = replace(problem, knobs=tuple(only))
    others = tuple(knob for j, knob in enumerate(problem.knobs) if j != k)
    return replace(problem, oscillator=fixed.system(np.array([u])), knobs=others)
