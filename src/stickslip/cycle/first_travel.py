"""When a slip begins, by its first travel, and what pulls just then."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.cycle.slips import Stroke

LEAST = 8  # samples in which a stick's end and a slip's start can be told
TRAVEL = 0.02  # of a stroke: how far the start of a slip is followed; farther on Stribeck's curves bend
BEFORE = 5  # a stick's last fifth tells what it bears at its end
ROWS = 256  # of the start of a slip that are looked at
MODELS = ("at once", "with the speed", "both")  # how friction falls as a slip begins


class Begun(NamedTuple):
    """The start of a slip, by each of the models."""

    pull: Array  # what pulls then [N]; NaN where a model finds none
    change: Array  # by how much that changes from a sample to the next
    misfit: Array  # logarithm of the sum of squares that the model leaves of the travel; infinite where it finds none


def begun(stroke: Stroke, pull: Array, mass: float, fs: float) -> Begun | None:
    r"""What pulls when the slip of a stroke begins; None where its first travel is too short, or no model finds it.

    The mass rests up to an instant :math:`t_0`, at which friction is what pulls, and then moves by

    .. math:: m\ddot x = p - f + b\dot x

    with f constant, no larger than the pull at :math:`t_0` (friction falls at once, b = 0), or equal to it (friction
    falls with the speed, as along a Stribeck curve), or both; by least squares over :math:`t_0`, f and b.
    """
    if stroke.slip < LEAST:
        return None
    first = stroke.slip // 2
    way = stroke.displacement - np.median(stroke.displacement[first : stroke.slip + 1])
    last = int(np.argmax(way > TRAVEL * np.ptp(way))) + 1
    if last - first < LEAST:
        return None
    force = stroke.way * pull[stroke.first + first : stroke.first + last]
    found = [(np.nan, np.nan, np.inf)] * len(MODELS)
    for place, (begins, misfit) in enumerate(_starts(way[first:last], force, mass, fs)):
        if not np.isfinite(misfit):
            continue
        rows = np.arange(max(0, int(begins) - max(4, (first + int(begins)) // BEFORE)), int(begins) + 1)
        slope, value = np.polyfit(rows - begins, force[rows], 1) if len(rows) > 1 else (0.0, force[rows[0]])
        found[place] = (float(value), float(abs(slope)), misfit)
    return Begun(*np.transpose(found)) if np.isfinite(found[0][2]) or np.isfinite(found[1][2]) else None


def _starts(travel: Array, pull: Array, mass: float, fs: float) -> list[tuple[float, float]]:
    """When, in samples, a slip begins of which the first travel is known, and the misfit: by each of the models."""
    every = len(travel) // ROWS + 1
    travel, pull, count = travel[::every], pull[::every], len(travel[::every])
    begins: Any = np.arange(1, count - 3)
    since = np.maximum(np.arange(count) - begins[:, None], 0.0)
    once, moved = _summed(pull), _summed(travel)
    twice, rest = _summed(once), np.cumsum(travel) / np.arange(1, count + 1)
    step = every**2 / (mass * fs**2)
    # what moves the mass from each begin on: the pull, a force of 1 N, and one in proportion to the speed
    pulled = step * np.where(since > 0, twice - twice[begins, None] - once[begins, None] * since, 0.0)
    unit = step * since**2 / 2
    driven = np.where(since > 0, moved - moved[begins, None] - rest[begins, None] * since, 0.0)
    left, first = travel - pulled, pull[begins, None]
    fits = [(left, [unit]), (left + first * unit, [driven]), (left, [unit, driven])]
    results = []
    for place, (wanted, columns) in enumerate(fits):
        cost, factors = _left(wanted, columns)
        if place != 1:
            cost[pull[begins] < -factors[0]] = np.inf
        if place:
            cost[factors[-1] < 0] = np.inf  # friction that grows with the speed
        results.append(_least(begins, cost, every))
    return results


def _left(wanted: Array, columns: list[Array]) -> tuple[Array, Array]:
    """What columns leave of each row by least squares, all of them about their means, and the factors."""
    wanted, *columns = (part - part.mean(axis=1, keepdims=True) for part in (wanted, *columns))
    products = np.array([[np.sum(one * other, axis=1) for one in columns] for other in columns])
    sides = np.array([np.sum(column * wanted, axis=1) for column in columns])
    factors = np.linalg.solve(np.moveaxis(products, 2, 0), sides.T[:, :, None])[:, :, 0].T
    rest = wanted - sum(factor[:, None] * column for factor, column in zip(factors, columns, strict=True))
    return np.sum(rest**2, axis=1), factors


def _least(begins: Any, cost: Array, every: int) -> tuple[float, float]:
    """Where the cost is least, between samples too, and its logarithm."""
    best = int(np.argmin(cost))
    if not np.isfinite(cost[best]):
        return np.nan, np.inf
    around = cost[max(best - 1, 0) : best + 2]
    moved = 0.0
    if len(around) == 3 and np.isfinite(around).all() and (curved := around[0] - 2 * around[1] + around[2]) > 0:
        moved = (around[0] - around[2]) / (2 * curved)
    return float(every * (begins[best] + moved)), float(np.log(max(cost[best], np.finfo(float).tiny)))


def _summed(values: Array) -> Array:
    """The integral, by trapezoids of one sample."""
    return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)])
