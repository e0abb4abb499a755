"""When a joint surely slides, and the windows within its strokes by which its torque is weighed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Mask, Rows, stretches
from stickslip.balance.motion import away_from
from stickslip.errors import EstimateError
from stickslip.signals.derivatives import differentiate, five_point_difference, smooth
from stickslip.signals.noise import noise_level, quantisation_step
from stickslip.statistics import BINS

# of a stroke's length, that the window has on either side: with 0.15 the accelerations of an axis fall out
SHARE = 0.08
SHORTEST = 4  # samples of the window on either side
REACH = 2  # samples that a difference adds to it
NOISY = 4.0  # deviations of the velocity's noise, below which it may be at rest
SLOW = 0.05  # of its fast speed (90 %): slower, static friction that falls with the speed would be taken for Coulomb's
SLOWER = 0.02  # where that fall is asked for
NARROW = 0.3  # of the window, near the ends of strokes
DRAWS = 4  # of an encoder's errors
APART = 4  # rows in the window's half: nearer ones tell the same


@dataclass(frozen=True)
class Window:
    """A smoothing window of compact support, so that nothing beyond a stroke enters what is told within it.

    The kernel is ``(1 - (t/T)^2)^4``: the balance is weighed by functions that vanish with three derivatives at their
    ends (the modulating functions of Shinbrot, 1957), so that derivatives fall on the window and not on the noise.

    Attributes
    ----------
    half : int
        Samples on either side.
    fs : float
        Sampling rate [Hz].
    """

    half: int
    fs: float

    @cached_property
    def weights(self) -> Array:
        """The kernel, of sum one."""
        shape = (1 - (np.arange(-self.half, self.half + 1) / (self.half + 1)) ** 2) ** 4
        return np.asarray(shape / shape.sum())

    def apply(self, values: Array, order: int = 0) -> Array:
        """The derivative of that order, smoothed."""
        from scipy.signal import fftconvolve

        return np.asarray(fftconvolve(five_point_difference(values, order) * self.fs**order, self.weights, mode="same"))

    def at(self, values: Array, rows: Rows, order: int = 0) -> Array:
        """The same at some rows: no other is computed."""
        rough = five_point_difference(values, order) * self.fs**order
        windows = np.lib.stride_tricks.sliding_window_view(rough, 2 * self.half + 1)
        return np.asarray(windows[rows - self.half] @ self.weights)

    def within(self, side: Array) -> Mask:
        """Where it lies within one stroke."""
        broken = (side == 0) | np.append(False, np.diff(side) != 0)
        within = away_from(broken, self.half + REACH)
        within[: self.half + REACH] = within[len(side) - self.half - REACH :] = False
        return within

    def noise_of_derivative(self, order: int) -> float:
        """Standard deviation of a derivative for white noise of unit standard deviation."""
        impulse = np.zeros(len(self.weights) + 8)
        impulse[len(impulse) // 2] = 1.0
        return float(np.linalg.norm(self.apply(impulse, order)))


@dataclass(frozen=True)
class Sliding:
    """When a joint slides, and which way.

    Attributes
    ----------
    side : ndarray, shape (n,)
        1 forward, -1 back, 0 at rest or too slow to be told from it.
    window : Window
        As wide as its strokes allow.
    rows : ndarray of int
        Instants whose window lies within one stroke.
    slowest : float
        Speed below which it may be at rest.
    near : ndarray of bool or None
        Rows near the ends of strokes, of a narrower window: there it slides slowly.
    narrow : Window or None
        Theirs.
    """

    side: Array
    window: Window
    rows: Rows
    slowest: float
    near: Mask | None = None
    narrow: Window | None = None

    @cached_property
    def weights(self) -> Array:
        """By which each row counts: a narrower window leaves more of the noise."""
        if self.near is None or self.narrow is None:
            return np.ones(len(self.rows))
        return np.where(self.near, math.sqrt(self.narrow.half / self.window.half), 1.0)

    def at(self, values: Array, order: int = 0) -> Array:
        """The derivative of that order at the rows, smoothed and weighed: no other row is computed."""
        if self.near is None or self.narrow is None:
            return self.window.at(values, self.rows, order)
        smoothed = np.empty(len(self.rows))
        smoothed[~self.near] = self.window.at(values, self.rows[~self.near], order)
        smoothed[self.near] = self.narrow.at(values, self.rows[self.near], order)
        return smoothed * self.weights


class Teeth(NamedTuple):
    """How a motor stands against its link, whose teeth have play.

    Attributes
    ----------
    lead : ndarray, shape (n,)
        By how much the motor is ahead: half of the play, to the side on which the teeth carry.
    carry : ndarray of bool
        Where they surely do.
    unsure : ndarray
        Standard deviation of gravity's torque, by that of the play.
    """

    lead: Array
    carry: Mask
    unsure: Array


def seated(position: Array, least: Array, most: Array, play: float) -> tuple[Array, Mask]:
    """On which side teeth carry, and where they surely do, by the bounds of their torque.

    Where it changes its sign the motor crosses the play, while the link may stay: until it has gone by all of it.
    """
    sure = np.where(np.minimum(least, most) > 0, 1.0, np.where(np.maximum(least, most) < 0, -1.0, 0.0))
    side, carry = np.zeros(len(position)), np.zeros(len(position), dtype=bool)
    last, begin, crosses = 0.0, float(position[0]), True
    for row, (place, now) in enumerate(zip(position, sure, strict=True)):
        if now not in (0.0, last):
            last, begin, crosses = now, float(place), True
        if crosses:
            begin = min(begin, place) if last > 0 else max(begin, place)
            crosses = last * (place - begin) < play
        side[row], carry[row] = last, not crosses and now == last
    return side, carry


def sliding(position: Array, fs: float, *, slowly: bool = False, carry: Mask | None = None) -> Sliding:
    """When does a joint surely slide, and where `carry` tells so, with its teeth seated?

    Where its speed is above four deviations of its noise, a twentieth of its fast speed, and one encoder count in half
    a window: slower, the error of the counts is a slope and no noise. With `slowly` the ends of strokes are seen too,
    by narrower windows.
    """
    velocity = differentiate(position, fs)
    speed, fast = np.abs(velocity.values), SLOWER if slowly else SLOW
    slowest = max(NOISY * float(np.median(velocity.sd)), fast * float(np.quantile(speed, 0.9)))
    begins, ends = stretches(speed > slowest)
    lengths = ends - begins
    if not len(lengths):
        raise EstimateError(
            "the joint never moves faster than its encoder's noise", "friction is told from sliding", "move it farther"
        )
    window = Window(max(SHORTEST, int(SHARE * float(lengths @ lengths) / float(lengths.sum()))), fs)
    count = quantisation_step(position) * fs
    side = np.where(speed > max(slowest, count / window.half), np.sign(velocity.values), 0.0)
    if carry is not None:
        side = np.where(carry, side, 0.0)
    slides = Sliding(side, window, _apart(window.within(side), window), max(slowest, count / window.half))
    if not slowly:
        return slides
    narrow = Window(max(SHORTEST, round(NARROW * window.half)), fs)
    slow = narrow.within(np.where(speed > max(slowest, count / narrow.half), side, 0.0)) & ~window.within(side)
    rows = np.concatenate([slides.rows, _apart(slow, narrow)])
    order, near = np.argsort(rows, kind="stable"), np.arange(len(rows)) >= len(slides.rows)
    return replace(slides, rows=rows[order], near=near[order], narrow=narrow)


def encoder_errors(position: Array, fs: float) -> list[Array]:
    """What an encoder's counts and noise may have made of its position, drawn a few times.

    The counts of a slow motion are no white noise: they are made again, of the smoothed motion, from other zeros. What
    is noisier than these alone has white noise beside.
    """
    count, place, chance = quantisation_step(position), smooth(position, fs).values, np.random.default_rng(0)
    power = noise_level(position, fs) ** 2
    errors = []
    for zero in (np.arange(DRAWS) + 0.5) / DRAWS * count:
        counted = np.round((place + zero) / count) * count - zero if count else place
        beside = max(power - noise_level(counted, fs) ** 2, 0.0)
        errors.append(counted - place + math.sqrt(beside) * chance.standard_normal(len(place)))
    return errors


def _apart(within: Mask, window: Window) -> Rows:
    """Rows that tell something of their own."""
    return np.flatnonzero(within)[:: max(1, window.half // APART)]


def places(place: Array) -> Rows:
    """Which of `BINS` along the way each row is at."""
    reach = float(np.ptp(place))
    along = (place - place.min()) * (BINS / reach if reach else 0.0)
    return np.asarray(np.minimum(along, BINS - 1), dtype=np.intp)
