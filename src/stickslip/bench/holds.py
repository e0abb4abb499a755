"""A record that stands on one level after another: where the levels are, and how high each is."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.record.record import Record
from stickslip.statistics import mean_uncertainty

Array = NDArray[np.float64]

BLOCKS = 400  # into which a record is reduced before its levels are looked for
LEAST = 4  # blocks of a level
MARGIN = 0.2  # of a level, at each of its ends, in which the hand still works


@dataclass(frozen=True)
class Hold:
    """A level that was held.

    Attributes
    ----------
    first, last : float
        Instants [s] between which it is read, the margins left out.
    level : float
        Its mean [unit of the channel].
    slope : float
        How fast it changes [unit / s].
    sd : float
        Standard deviation of the mean.
    middle : float
        Instant [s] at which a straight line through it has its mean.
    """

    first: float
    last: float
    level: float
    slope: float
    sd: float

    @property
    def middle(self) -> float:
        """Instant [s] at which a straight line through it has its mean."""
        return (self.first + self.last) / 2

    def at(self, time: float) -> float:
        """The straight line through it, at another instant [s]."""
        return self.level + self.slope * (time - self.middle)


def find_holds(record: Record, channel: str, count: int, *, question: str) -> tuple[Hold, ...]:
    """The `count` levels on which a channel stands one after another.

    The record is reduced to the medians of 400 blocks and cut where straight lines through the parts leave least, by
    dynamic programming; a fifth of each part at either end is left to the hand that changes the level.

    Parameters
    ----------
    record : Record
    channel : str
    count : int
        How many levels there are.
    question : str
        For the message.

    Returns
    -------
    tuple of Hold

    Raises
    ------
    RecordError
        The channel is missing or not finite.
    EstimateError
        The record is too short for that many levels.

    Examples
    --------
    >>> levels = np.repeat([0.0, 2.0, 5.0], 400) + 0.01 * np.random.default_rng(1).standard_normal(1200)
    >>> [round(hold.level, 1) for hold in find_holds(Record.of({"x": levels}, fs=100), "x", 3, question="an example")]
    [-0.0, 2.0, 5.0]
    """
    record.require_clean(channel, question=question, samples=2 * LEAST * count)
    values = record[channel]
    size = max(1, len(values) // BLOCKS)
    blocks = np.median(values[: len(values) // size * size].reshape(-1, size), axis=1)
    if len(blocks) < LEAST * count:
        raise EstimateError(
            f"{len(values)} samples for {count} levels", f"{question} needs a second or more at each", "hold longer"
        )
    edges = [edge * size for edge in _cuts(blocks, count)]
    edges[-1] = len(values)
    return tuple(_hold(record, values, first, last) for first, last in itertools.pairwise(edges))


def _cuts(blocks: Array, count: int) -> list[int]:
    """Where `count` straight lines part, the ends included: least squares by dynamic programming."""
    cost = _line_costs(blocks)
    size = len(blocks)
    best = np.full((count + 1, size + 1), math.inf)
    back = np.zeros((count + 1, size + 1), dtype=int)
    best[0, 0] = 0.0
    for part in range(1, count + 1):
        total = best[part - 1][:, None] + cost  # [from, to]
        back[part] = total.argmin(axis=0)
        best[part] = total.min(axis=0)
    edges = [size]
    for part in range(count, 0, -1):
        edges.append(int(back[part, edges[-1]]))
    return edges[::-1]


def _line_costs(values: Array) -> Array:
    """What a straight line leaves of each stretch, [from, to]; infinite where it is too short."""
    size = len(values)
    time = np.arange(size, dtype=float)

    def sums(each: Array) -> Array:
        return np.concatenate([[0.0], np.cumsum(each)])

    values = values - values.mean()
    n, t, y = (sums(each) for each in (np.ones(size), time, values))
    tt, ty, yy = (sums(each) for each in (time * time, time * values, values * values))

    def over(total: Array) -> Array:
        return total[None, :] - total[:, None]

    with np.errstate(divide="ignore", invalid="ignore"):
        count = over(n)
        stt, sty = over(tt) - over(t) ** 2 / count, over(ty) - over(t) * over(y) / count
        left = over(yy) - over(y) ** 2 / count - sty**2 / stt
    left[over(n) < LEAST] = math.inf
    return np.where(np.isfinite(left), np.maximum(left, 0.0), math.inf)


def _hold(record: Record, values: Array, first: int, last: int) -> Hold:
    margin = round(MARGIN * (last - first))
    part = values[first + margin : last - margin]
    time = (np.arange(len(part)) - (len(part) - 1) / 2) / record.fs
    slope = float(time @ part / (time @ time))
    sd = mean_uncertainty(part - part.mean() - slope * time)[0]
    start = record.start + (first + margin) / record.fs
    return Hold(start, start + (len(part) - 1) / record.fs, float(part.mean()), slope, sd)


def jumps(holds: Sequence[Hold]) -> Array:
    """How far each level lies above the one before, both drawn on to the instant between them."""
    pairs = itertools.pairwise(holds)
    return np.array(
        [
            after.at(middle) - before.at(middle)
            for before, after in pairs
            for middle in [(before.last + after.first) / 2]
        ]
    )
