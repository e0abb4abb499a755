"""Two sensors of one motion: the delay between them, and the mount of the second, by the phases of all lines."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Complex, Mask
from stickslip.errors import EstimateError
from stickslip.signals.response import derivative_spectra, window

BLOCK = 1 << 16  # samples under one window of a long record
QUICK = 4 * BLOCK  # samples in which delays are told apart
HIGHEST = 0.4  # of the sampling rate, up to which lines are used
CLEAR = 20.0  # power of a line over its noise, of which noise alone has 1
TELLING = 0.999  # of what all lines tell of a mount: the rest is left out
NEAR = 64  # lines over which the noise around a line is averaged
EXACT = 1e-10  # of the largest curvature: a smaller one is none
FARTHEST = 0.25  # s: longer delays are not looked for
TRIED = 5  # delays from which a fit begins, of two kinds
ROUNDS = 3  # in which the windows are moved to the delay and the noise is found anew
# Of the least-squares fits of 43 pairs (the demonstration, 13 real ones, 29 of virtual rigs) these leave delays within
# 0.005 deviations of where steps by differences ended after up to 1600 trials; a flat valley takes up to 95 steps.
STEPS = 100  # of a fit
DAMPED = 1e-3  # of the slopes' products, the first damping of a step that made it worse
SETTLED = 1e-4  # by which a step betters the misfit, in units of its chance, when nothing more matters
CHANCE = 3.0  # deviations by which noise alone may leave more than its power
SAME = 6.0  # deviations of a misfit by which another delay's may be worse and still not be told from the best


@dataclass(frozen=True, eq=False)
class Pair:
    """Two sensors of one motion u, each about its mean.

    Attributes
    ----------
    first, second : ndarray (n,)
        Samples; the second follows the derivative of `order` of the first.
    fs : float
        Sampling rate [Hz].
    noise : tuple of float
        Standard deviation of each one's noise in a sample.
    order : int
        0, 1 or 2.
    highest : float
        Part of the sampling rate up to which lines are used.
    """

    first: Array
    second: Array
    fs: float
    noise: tuple[float, float]
    order: int
    highest: float = HIGHEST

    def stretches(self, delay: float, room: int = 0) -> Iterator[Lines]:
        """All of it, one window each, with the first later by `delay` [s]; `room` samples at both ends are left out."""
        whole = round(delay * self.fs)
        begin, end = max(room, whole), len(self.second) - max(room, -whole)
        blocks = max(1, (end - begin) // BLOCK)
        step = (end - begin) // blocks
        count = step - step % (1 << max(0, step.bit_length() - 8))  # few prime factors: fast to transform
        for j in range(blocks):
            yield self._lines(begin + j * step, count, delay, whole)

    def _lines(self, begin: int, count: int, delay: float, whole: int) -> Lines:
        before, shift = self.first[begin - whole : begin - whole + count], delay - whole / self.fs
        first = derivative_spectra(before, fs=self.fs, orders=[self.order], shift=shift)[0]
        second = derivative_spectra(self.second[begin : begin + count], fs=self.fs, orders=[0, 1, 2])
        turn = np.asarray(2 * math.pi * np.fft.rfftfreq(count, 1 / self.fs), dtype=np.float64)
        flat = window(count)
        noise = [self.noise[0] ** 2 * turn ** (2 * self.order), np.full_like(turn, self.noise[1] ** 2)]
        power = float(np.sum(flat**2)) * np.array(noise)
        return Lines(turn, first, second, power, np.fft.rfft(flat), turn < 2 * math.pi * self.highest * self.fs)


@dataclass(frozen=True, eq=False)
class Lines:
    """Spectral lines of a pair, the first as late as the second.

    Attributes
    ----------
    turn : ndarray (n,)
        w [1/s].
    first : ndarray (n,)
        Derivative of the first.
    second : ndarray (3, n)
        The second with its first two derivatives.
    noise : ndarray (2, n)
        Power of the noise in the first one's derivative and in the second.
    constant : ndarray (n,)
        What the window makes of an offset.
    inside : ndarray (n,) of bool
        Whether it may be used.
    """

    turn: Array
    first: Complex
    second: Complex
    noise: Array
    constant: Complex
    inside: Mask

    @property
    def clear(self) -> Mask:
        """Lines above the noise in either sensor, whatever the phase between them: the choice favours no delay."""
        loud = np.any(np.abs([self.first, self.second[0]]) ** 2 > CLEAR * self.noise, axis=0)
        return np.asarray(loud & self.inside & (self.turn > 0))

    @property
    def information(self) -> Array:
        """Power of a line over its noise, as far as both sensors show it."""
        powers = np.abs([self.first, self.second[0]]) ** 2 / self.noise
        return np.asarray(np.prod(powers, axis=0) / np.sum(powers, axis=0))

    @property
    def rate(self) -> float:
        """Of the lines' phases with the delay [1/s]."""
        return float(np.sqrt(np.average(self.turn**2, weights=self.information)))

    @property
    def gain(self) -> float:
        """Of the second over the first, without delay."""
        weight = self.information / np.abs(self.first) ** 2
        return float(np.sum(weight * (self.first.conj() * self.second[0]).real) / np.sum(self.information))

    def chosen(self, which: Mask) -> Lines:
        """Some of the lines."""
        return Lines(*(getattr(self, field.name)[..., which] for field in fields(self)))

    @property
    def telling(self) -> Lines:
        """The lines that tell nearly all that these tell of a mount."""
        curvature = self.information * self.turn**4
        ordered = np.sort(curvature)
        least = np.searchsorted(np.cumsum(ordered), (1 - TELLING) * ordered.sum())
        return self.chosen(curvature >= ordered[least]) if len(curvature) else self

    def without_offset(self, gain: float) -> Lines:
        """The second less its offset, which is all that the relation leaves at frequency zero."""
        offset = (self.second[0, 0] - gain * self.first[0]).real / self.constant[0].real
        return replace(self, second=self.second - offset * np.outer([1, 0, 0], self.constant))

    def residual(self, theta: Array) -> Complex:
        """Of the relation, over its standard deviation; theta is (delay [s], gain, 2 zeta/w_m [s], 1/w_m^2 [s^2])."""
        delay, gain, damped, squared = theta
        residual = self.second[0] + damped * self.second[1] + squared * self.second[2]
        factor = 1 + 1j * damped * self.turn - squared * self.turn**2
        spread = np.abs(factor) ** 2 * self.noise[1] + gain**2 * self.noise[0]
        return np.asarray((residual - gain * np.exp(-1j * self.turn * delay) * self.first) / np.sqrt(spread))

    def expansion(self, theta: Array) -> tuple[float, Array, Array, Array]:
        """Sum of squares of :meth:`residual`, half its slopes and curvatures by theta, and the slopes' products."""
        delay, gain, damped, squared = theta
        w, (of_first, of_second), none = self.turn, self.noise, np.zeros_like(self.turn)
        stiff, turned = 1 - squared * w**2, np.exp(-1j * w * delay) * self.first
        residual = self.second[0] + damped * self.second[1] + squared * self.second[2] - gain * turned
        spread = (stiff**2 + (damped * w) ** 2) * of_second + gain**2 * of_first
        by_theta = np.array([1j * w * gain * turned, -turned, self.second[1], self.second[2]])
        widened = np.array([none, gain * of_first, damped * w**2 * of_second, -stiff * w**2 * of_second]) / spread
        power = np.abs(residual) ** 2 / spread
        slopes = (residual.conj() * by_theta).real / spread
        mixed = 2 * slopes @ widened.T
        curvature = ((by_theta.conj() / spread) @ by_theta.T).real - mixed - mixed.T + 4 * (power * widened) @ widened.T
        twice = np.array([gain * w**2, 1j * w]) * turned * residual.conj() / spread  # delay and delay, delay and gain
        curvature[0, 0] += np.sum(twice[0].real)
        curvature[[0, 1], [1, 0]] += np.sum(twice[1].real)
        widest = np.array([none, of_first, w**2 * of_second, w**4 * of_second]) / spread
        curvature -= np.diag(widest @ power)
        of_residual = (by_theta - residual * widened) / np.sqrt(spread)
        products = (of_residual.conj() @ of_residual.T).real
        return float(np.sum(power)), np.sum(slopes - power * widened, axis=1), curvature, products

    def noise_slopes(self, theta: Array) -> tuple[Array, Array]:
        """What noise alone adds to the products of the residual's slopes by theta, and how much of that only turns.

        At a delay of zero. The misfit of noise does not change with theta, though its residuals do.
        """
        _, gain, damped, squared = theta
        none, w = np.zeros_like(self.turn), self.turn
        factor = 1 + 1j * damped * w - squared * w**2
        left = np.array([none, none, 1j * w, -(w**2)])
        right = np.array([-1j * w * gain, none + 1, none, none])
        of_first, of_second = self.noise / (np.abs(factor) ** 2 * self.noise[1] + gain**2 * self.noise[0])
        along = left * factor.conj() * of_second + right * gain * of_first
        products = np.real(left * of_second @ left.conj().T + right * of_first @ right.conj().T)
        return products - along.real @ along.real.T, along.imag @ along.imag.T

    def weighed(self, theta: Array) -> Lines:
        """The same with the noise that is found around each line, between the clear ones."""
        from scipy.ndimage import uniform_filter1d

        some = self.turn > 0
        power, between = np.zeros(len(some)), some & ~self.clear
        power[some] = np.abs(self.chosen(some).residual(theta)) ** 2
        if between.sum() < NEAR:
            between = some
        share = uniform_filter1d(between.astype(float), NEAR, mode="constant")
        near = uniform_filter1d(power * between, NEAR, mode="constant") / np.maximum(share, 1 / NEAR)
        return replace(self, noise=self.noise * np.where(share > 0.25, near, power[between].mean()))


@dataclass(frozen=True, eq=False)
class Alignment:
    """A delay between two sensors, and what was fitted with it.

    Attributes
    ----------
    theta : ndarray (4,)
        Delay [s] of the second behind the first, gain, 2 zeta/w_m [s] and 1/w_m^2 [s^2] of the second one's mount.
    covariance : ndarray (4, 4)
        Of theta; zero where it was held.
    misfit : float
        Sum of squares of the residual over its deviation, real and imaginary parts apart.
    lines : Lines
        Those used.
    moved : array_like (4,)
        How far theta may lie away, as likely anywhere up to there, for what the samples did not resolve.
    """

    theta: Array
    covariance: Array
    misfit: float
    lines: Lines
    moved: Array | tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    @property
    def delay(self) -> float:
        """Of the second behind the first [s]."""
        return float(self.theta[0])

    @property
    def unexplained(self) -> float:
        """Power of the residual at the lines over that of the noise between them."""
        return self.misfit / max(1, 2 * len(self.lines.turn) - 4)

    @property
    def widening(self) -> float:
        """Factor on the variances: one, unless more is left than chance lets noise leave."""
        return self.unexplained if self.unexplained > 1 + CHANCE / math.sqrt(len(self.lines.turn)) else 1.0

    def sd(self, slope: Sequence[float]) -> float:
        """Standard deviation of what changes with theta by `slope`."""
        variance = float(np.dot(slope, self.covariance @ slope))
        beyond = float(np.dot(slope, self.moved)) ** 2 / 3
        return math.sqrt(max(0.0, variance) * self.widening + beyond)  # rounding may leave less than none

    def unsure_by(self, other: Alignment) -> Alignment:
        """The same, where it may lie as far away as another."""
        return replace(self, moved=other.theta - self.theta)


def align(
    pairs: Sequence[Pair],
    delay: float,
    *,
    mount: tuple[float, float] | None = None,
    free: bool = False,
    room: int = 0,
    rounds: int = ROUNDS,
) -> Alignment:
    """The delay under which two sensors' readings are most likely, from near a first guess on.

    Parameters
    ----------
    pairs : sequence of Pair
        Runs of the same two sensors.
    delay : float
        First guess [s], good to half a cycle of the fastest lines.
    mount : tuple of (float, float), optional
        Resonance [Hz] and damping ratio of the second one's mount; rigid where left out.
    free : bool
        Whether the mount is fitted.
    room : int
        Samples at both ends that are left out.
    rounds : int
        Of fitting; in the first, and where there are two, all noise is taken for white.

    Returns
    -------
    Alignment

    Raises
    ------
    EstimateError
        No line stands above the noise.
    """
    theta = np.array([0.0, math.nan, *_terms(mount)])
    used = [0, 1, 2, 3] if free else [0, 1]
    for done in range(rounds):
        if not done:
            theta[1] = merged([next(pairs[0].stretches(delay, room))]).gain or 1.0
        parts = (part.without_offset(theta[1]) for pair in pairs for part in pair.stretches(delay, room))
        lines = merged(part.weighed(theta) if done and rounds > 2 else part for part in parts)
        theta, misfit = _likeliest(lines, theta, used)
        delay, theta[0] = float(np.clip(delay + theta[0], -FARTHEST, FARTHEST)), 0.0
    square = window(1 << 12) ** 2
    overlap = float(np.mean(square**2) / np.mean(square) ** 2)  # neighbouring lines share some noise
    covariance = np.zeros((4, 4))
    covariance[np.ix_(used, used)] = misfit.covariance(*lines.noise_slopes(theta)) * overlap
    return Alignment(np.array([delay, *theta[1:]]), covariance, misfit.value, lines)


class Misfit(NamedTuple):
    """The misfit of lines to second order about a theta whose entries `free` are fitted, those in units of `scale`."""

    value: float
    gradient: Array
    curvature: Array
    products: Array
    free: list[int]
    scale: Array

    @classmethod
    def of(cls, lines: Lines, theta: Array, free: list[int]) -> Misfit:
        """About this theta; real and imaginary part of a residual have half of its power each."""
        unit = 1 / lines.rate
        scale = np.array([unit, abs(theta[1]), unit, unit**2])[free]
        value, gradient, *matrices = lines.expansion(theta)
        curvature, products = (2 * matrix[np.ix_(free, free)] * np.outer(scale, scale) for matrix in matrices)
        return cls(2 * value, 2 * gradient[free] * scale, curvature, products, free, scale)

    def step(self, damping: float) -> Array:
        """Newton's, or Gauss's where the misfit is no bowl, held short by Marquardt's damping."""
        size = 1 / np.sqrt(np.diag(self.products))
        bent, along = np.linalg.eigh(self.curvature * np.outer(size, size))
        if bent[0] <= 0:
            bent, along = np.linalg.eigh(self.products * np.outer(size, size))
        return np.asarray(-size * (along @ (along.T @ (size * self.gradient) / (np.maximum(bent, EXACT) + damping))))

    def covariance(self, noise: Array, turned: Array) -> Array:
        """Of the parameters: the curvature of the misfit is what the slopes have beyond those of noise alone.

        Noise adds to the spread of the slope of the misfit, but for what only turns, and nothing to its curvature.
        """
        units = np.outer(self.scale, self.scale)
        noise, turned = (2 * matrix[np.ix_(self.free, self.free)] * units for matrix in (noise, turned))
        curvature = self.products - noise
        if np.linalg.eigvalsh(curvature)[0] < EXACT * np.linalg.eigvalsh(self.products)[-1]:  # not all of them are told
            return np.asarray(np.linalg.pinv(self.products) * units)
        inverse = np.linalg.inv(curvature)
        return np.asarray(inverse @ (self.products - turned) @ inverse * units)


def _likeliest(lines: Lines, theta: Array, free: list[int]) -> tuple[Array, Misfit]:
    """The theta of the least misfit, found downhill, and the misfit about it."""
    misfit, damping = Misfit.of(lines, theta, free), 0.0
    for _ in range(STEPS):
        step, tried = misfit.step(damping), theta.copy()
        tried[free] += step * misfit.scale
        moved, gain = Misfit.of(lines, tried, free), float(-step @ misfit.gradient)
        if moved.value < misfit.value:
            gain = min(gain, misfit.value - moved.value)
            theta, misfit, damping = tried, moved, damping / 10 if damping > DAMPED else 0.0
        else:
            damping = max(10 * damping, DAMPED)
        if gain < SETTLED * max(1.0, misfit.value / (2 * len(lines.turn))):
            break
    return theta, misfit


def _terms(mount: tuple[float, float] | None) -> tuple[float, float]:
    """2 zeta/w_m and 1/w_m^2 of a mount's frequency [Hz] and damping ratio."""
    if mount is None:
        return 0.0, 0.0
    turn = 2 * math.pi * mount[0]
    return 2 * mount[1] / turn, 1 / turn**2


def merged(parts: Iterable[Lines]) -> Lines:
    """The clear lines of all stretches that tell something of a delay or a mount, of what their own stretch tells."""
    clear = [part.chosen(part.clear).telling for part in parts]
    columns = ([getattr(chosen, field.name) for chosen in clear] for field in fields(Lines))
    lines = Lines(*(np.concatenate(column, axis=-1) for column in columns))
    if len(lines.turn) < 2:
        raise EstimateError(
            "no line of the spectra stands above the noise of either channel",
            "a delay between sensors needs a motion that both see",
            "record a livelier motion",
        )
    return lines


def likely_delays(pairs: Sequence[Pair], mount: tuple[float, float] | None) -> list[Alignment]:
    """Every delay that explains the pairs as well as any, the shortest first.

    Parameters
    ----------
    pairs : sequence of Pair
        Runs of the same two sensors.
    mount : tuple of (float, float) or None
        Of the second sensor, where known; else it is fitted.

    Returns
    -------
    list of Alignment
        Quick ones, all of the same samples.
    """
    pairs = [_middle(pair, QUICK) for pair in pairs]
    tried = sorted({delay for pair in pairs for delay in _peaks(pair)}, key=abs)
    room = math.ceil(abs(tried[-1]) * max(pair.fs for pair in pairs)) + 2
    fits = [align(pairs, delay, mount=mount, free=mount is None, room=room, rounds=2) for delay in tried]
    best = min(fits, key=lambda fit: fit.misfit)
    limit = best.misfit + SAME * math.sqrt(4 * len(best.lines.turn)) * best.widening
    alike: list[Alignment] = []
    for fit in sorted((fit for fit in fits if fit.misfit <= limit), key=lambda fit: abs(fit.delay)):
        if all(abs(fit.delay - other.delay) > 0.5 / pairs[0].fs for other in alike):
            alike.append(fit)
    return alike


def _middle(pair: Pair, most: int) -> Pair:
    """So many samples of it at most."""
    skip = max(0, (len(pair.first) - most + 1) // 2)
    rows = slice(skip, len(pair.first) - skip)
    return replace(pair, first=pair.first[rows], second=pair.second[rows])


def _peaks(pair: Pair) -> list[float]:
    """Delays [s], to a sample, at which a pair correlates most, fast lines first: the highest and the nearest."""
    part = next(_middle(pair, BLOCK).stretches(0.0))
    lines, step = merged([part]), float(part.turn[1])
    count = round(2 * math.pi * pair.fs / step)
    spectrum = np.zeros(count // 2 + 1, dtype=complex)
    across = lines.first.conj() * lines.second[0]
    spectrum[np.round(lines.turn / step).astype(int)] = lines.information * lines.turn**2 * across / np.abs(across)
    reach = min(round(FARTHEST * pair.fs), count // 4)
    lags = np.arange(-reach, reach + 1)
    height = np.abs(np.fft.irfft(spectrum, count))[lags]
    inner = height[1:-1]
    peaks = 1 + np.flatnonzero((inner >= height[:-2]) & (inner > height[2:]) & (inner > height.max() / 2))
    chosen = {*peaks[np.argsort(-height[peaks])][:TRIED], *peaks[np.argsort(np.abs(lags[peaks]))][:TRIED]}
    return [float(lags[i]) / pair.fs for i in chosen] or [0.0]
