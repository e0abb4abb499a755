"""How noisy a channel is: the standard deviation of its broadband noise, and the step of its digitiser.

The smoother at the bottom of every derivative: penalised least squares on the samples, in n log n operations.
"""

from __future__ import annotations

import math
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Complex
from stickslip.errors import EstimateError
from stickslip.record.flaws import quantum

ORDERS = (2, 3, 4, 6, 8, 10)  # of differencing, tried in turn
BLOCK = 12  # differences per block: short against the time between two friction events
SPAN = 5  # blocks over which a varying level is averaged
LEAST_CYCLES = 4  # over which a spectrum is seen beside its harmonics: six lines about each
LOG_SD = math.pi / math.sqrt(6)  # standard deviation of the logarithm of a line of a periodogram
LEVELLED = 0.9  # the next order's answer over this one's when the motion no longer shows

# A jump in acceleration has the spectrum 1/w; a displacement with jumps in its acceleration at random 1/w^3. The best
# linear filter of such a signal in white noise (Wiener's) is 1/(1 + lambda w^6): a penalty on third differences.
ROUGHNESS = 3


def noise_level(values: ArrayLike, fs: float, *, step: float | None = None) -> float:
    """How large is the broadband noise of a channel?

    The differences of order k of white noise of standard deviation s have the variance ``s^2 C(2k, k)``, while a
    motion of w radians per sample is left with ``(2 sin(w/2))^k`` of its amplitude: differencing removes trends and
    oscillation and keeps the noise. The variance is taken in blocks of 12 differences, and their median counts, so that
    impacts, slip onsets and other events that fill less than half of the blocks do not. The order is the lowest after
    which the answer no longer falls. An ideal digitiser of step q adds an error of ``q / sqrt(12)``, which
    differences miss where the signal rests on one level; the answer is never below it.

    Parameters
    ----------
    values : array_like, shape (n,)
        Samples, finite, n >= 24.
    fs : float
        Sampling rate [Hz]. White noise up to fs/2 is assumed; noise that was filtered before sampling is rated by what
        is left of it near fs/2.
    step : float, optional
        That of the digitiser where it is known already, 0 for none.

    Returns
    -------
    float
        Standard deviation, in the unit of `values`.

    Raises
    ------
    EstimateError
        Fewer than 24 samples, a value that is not finite, or a rate that is not positive.

    Examples
    --------
    >>> t = np.arange(5000) / 1000
    >>> noisy = np.sin(2 * np.pi * t) + 0.01 * np.random.default_rng(1).standard_normal(t.size)
    >>> bool(0.0095 < noise_level(noisy, 1000) < 0.0105)
    True
    """
    samples = checked_samples(values, fs, least=2 * BLOCK)
    step = quantisation_step(samples) if step is None else step
    return max(_levelled(samples)[0], step / math.sqrt(12))


def local_noise(values: ArrayLike, fs: float) -> Array:
    """How large is the broadband noise of a channel, at each sample?

    Many sensors are noisier in motion than at rest (an encoder's interpolation, a jittering clock). The mean squares of
    blocks as in :func:`noise_level` are followed by a running median of three and a running mean of five blocks. Where
    they spread no more than a constant level of white noise would let them, that level is returned throughout.

    Parameters
    ----------
    values : array_like, shape (n,)
        Samples, finite, n >= 24.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray, shape (n,)
        Standard deviation at each sample, in the unit of `values`.

    Raises
    ------
    EstimateError
        As for :func:`noise_level`.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(6000)
    >>> noise[3000:] *= 5
    >>> level = local_noise(noise, 1000)
    >>> bool(0.8 < level[1500] < 1.2 and 4 < level[4500] < 6)
    True
    """
    samples = checked_samples(values, fs, least=2 * BLOCK)
    floor = quantisation_step(samples) / math.sqrt(12)
    level, order = _levelled(samples)
    squares = _block_squares(samples, order)
    if len(squares) < 2 * SPAN:
        return np.full(samples.size, max(level, floor))
    correction = _median_over_mean(order)
    padded = np.pad(squares, 1, mode="edge")
    running = np.median(np.lib.stride_tricks.sliding_window_view(padded, 3), axis=1) / correction
    padded = np.pad(running, SPAN // 2, mode="edge")
    running = np.convolve(padded, np.full(SPAN, 1 / SPAN), mode="valid")
    spread = np.std(running) / np.mean(running) if running.any() else 0.0
    if spread < 2 * np.sqrt(2 / (SPAN * _freedom(order))):  # twice what chance explains
        return np.full(samples.size, max(level, floor))
    centres = (np.arange(len(running)) + 0.5) * BLOCK + order / 2
    return np.asarray(np.maximum(np.sqrt(np.interp(np.arange(samples.size), centres, running)), floor))


def density_beside(values: ArrayLike, fs: float, *, frequency: float, white: float) -> tuple[Array, float] | None:
    r"""The spectrum of a noise in which something periodic is left, which is at the harmonics alone.

    Over whole cycles a harmonic is one line of the periodogram; there the noise is what it is beside it, the mean of
    the logarithms on either side (that of a power law, too, is then right), where that stands out of white noise.

    Parameters
    ----------
    values : array_like, shape (n,)
        Noise, and what repeats with each cycle.
    fs, frequency : float
        Sampling rate, and that of the cycles [Hz].
    white : float
        Standard deviation of the white noise that there is at least [unit of the values].

    Returns
    -------
    density : ndarray, shape (m,)
        One-sided [square of the unit / Hz].
    spacing : float
        Of its frequencies, from one spacing on [Hz].

    None is returned of fewer than four cycles, beside whose harmonics there is too little to see.

    Examples
    --------
    >>> t, noise = np.arange(8000) / 1000, np.random.default_rng(1).standard_normal(8000)
    >>> density, spacing = density_beside(noise + np.sin(4 * np.pi * t), 1000, frequency=2.0, white=1.0)
    >>> bool(abs(spacing * density.sum() - 1) < 0.05)
    True
    """
    samples = np.asarray(values, dtype=float)
    cycles = math.floor(len(samples) / fs * frequency + 1e-9)
    if cycles < LEAST_CYCLES:
        return None
    samples = samples[: round(cycles / frequency * fs)]
    density = 2 / (fs * len(samples)) * np.abs(np.fft.rfft(samples)[1:]) ** 2
    flat, harmonics = 2 * white**2 / fs, len(density) // cycles
    rows = density[: harmonics * cycles].reshape(harmonics, cycles)  # of each the last is a harmonic
    below = np.log(np.maximum(rows[:, :-1], np.finfo(float).tiny)).mean(axis=1)
    beside = np.exp((below + np.append(below[1:], below[-1])) / 2 + np.euler_gamma)
    surely = flat * math.exp(2 * LOG_SD / math.sqrt(2 * (cycles - 1)))
    rows[:, -1] = np.where(beside > surely, beside, flat)
    return density, fs / len(samples)


def quantisation_step(values: ArrayLike) -> float:
    """The step between the levels that the values lie on, or 0 where they lie on none.

    Parameters
    ----------
    values : array_like, shape (n,)
        Samples, finite.

    Returns
    -------
    float
        Step of a digitiser, encoder or of rounded text, in the unit of `values`.

    Examples
    --------
    >>> t = np.arange(5000) / 1000
    >>> round(quantisation_step(np.round(np.sin(t) / 0.002) * 0.002), 6), quantisation_step(np.sin(t))
    (0.002, 0.0)
    """
    return quantum(np.asarray(values, dtype=float))


def checked_samples(values: ArrayLike, fs: float, *, least: int) -> Array:
    """`values` as float64, if there are at least `least` of them, all finite, on a rate that is positive."""
    samples = np.asarray(values, dtype=float)
    if samples.ndim != 1 or samples.size < least:
        raise EstimateError(
            f"samples of shape {samples.shape}", f"one row of at least {least} is needed", "give a longer record"
        )
    if not np.isfinite(fs) or fs <= 0:
        raise EstimateError(f"fs = {fs} Hz", "a sampling rate is positive and finite", "pass fs in Hz")
    if not np.isfinite(samples).all():
        row = int(np.flatnonzero(~np.isfinite(samples))[0])
        raise EstimateError(
            f"the value at row {row} is not a number",
            "numbers are needed throughout",
            "fill it with fill_missing(record)",
        )
    return samples


def _levelled(samples: Array) -> tuple[float, int]:
    """The noise by differences of the lowest order after which it no longer falls, and that order."""
    orders = [order for order in ORDERS if samples.size - order >= BLOCK]
    level, used = _level(samples, orders[0]), orders[0]
    for order in orders[1:]:
        lower = _level(samples, order)
        if lower > LEVELLED * level:
            break
        level, used = lower, order
    return level, used


def _level(samples: Array, order: int) -> float:
    return float(np.sqrt(np.median(_block_squares(samples, order)) / _median_over_mean(order)))


def _block_squares(samples: Array, order: int) -> Array:
    """Mean square of each block of differences of one order, as the variance of the white noise behind it."""
    differences = np.diff(samples, order)
    blocks = differences[: differences.size // BLOCK * BLOCK].reshape(-1, BLOCK)
    return np.asarray(np.einsum("ij,ij->i", blocks, blocks) / (BLOCK * comb(2 * order, order)))


def _freedom(order: int) -> float:
    """Degrees of freedom of a block's mean square: its differences are correlated."""
    lags = np.arange(-min(order, BLOCK - 1), min(order, BLOCK - 1) + 1)
    correlation = np.array([comb(2 * order, order + int(lag)) for lag in np.abs(lags)]) / comb(2 * order, order)
    return float(BLOCK**2 / np.sum((BLOCK - np.abs(lags)) * correlation**2))


def _median_over_mean(order: int) -> float:
    return float((1 - 2 / (9 * _freedom(order))) ** 3)  # of chi-square (Wilson and Hilferty 1931)


def penalised(values: Array, penalty: float) -> Array:
    """The u that minimises ``sum (y - u)^2 + penalty sum (third difference of u)^2``, along the first axis.

    The equations of the inside are solved on a circle by FFT, which keeps full accuracy however large the penalty
    (the banded matrix loses it as penalty * eps); what the two ends change is a sum of the six decaying solutions
    of the homogeneous equation, fitted by least squares to the same minimum.
    """
    from scipy import fft

    size = len(values)
    line = np.linspace(0, 1, size).reshape(-1, *[1] * (values.ndim - 1))
    trend = values[0] + (values[-1] - values[0]) * line
    y = values - trend
    half = np.sin(np.pi * np.arange(size // 2 + 1) / size)
    gain = (1 / (1 + penalty * (2 * half) ** (2 * ROUGHNESS))).reshape(-1, *[1] * (values.ndim - 1))
    u = fft.irfft(fft.rfft(y, axis=0) * gain, size, axis=0)

    z = end_modes(penalty)
    z = z[np.imag(z) > -1e-12]
    length = min(size, 8 + math.ceil(math.log(1e-17) / math.log(np.abs(z).max())))
    powers = z ** np.arange(length)[:, None]
    scale = math.sqrt(penalty)
    weights = scale * (z - 1) ** ROUGHNESS  # third difference of z^n, exactly
    left = _real(powers)
    left_rough = _real(powers[: length - ROUGHNESS] * weights)
    if length == size or 2 * length > size:
        modes = np.hstack([_embed(left, size), _embed(left, size)[::-1]])
        rough = np.hstack([_embed(left_rough, size - ROUGHNESS), -_embed(left_rough, size - ROUGHNESS)[::-1]])
        target = np.concatenate([y - u, -scale * np.diff(u, ROUGHNESS, axis=0)])
        u = u + modes @ _least_squares(np.vstack([modes, rough]), target)
        return np.asarray(u + trend)
    u = u.copy()
    corrections = []
    for side in (slice(None), slice(None, None, -1)):
        near, part = y[side][:length], u[side][:length]
        target = np.concatenate([near - part, -scale * np.diff(part, ROUGHNESS, axis=0)])
        corrections.append(left @ _least_squares(np.vstack([left, left_rough]), target))
    u[:length] += corrections[0]
    u[::-1][:length] += corrections[1]
    return np.asarray(u + trend)


def end_modes(penalty: float) -> Complex:
    """Roots z, |z| < 1, of ``1 + lambda (2 - z - 1/z)^3 = 0``: how the effect of an end dies out."""
    angles = np.pi * (2 * np.arange(ROUGHNESS) + 1) / ROUGHNESS
    q = penalty ** (-1 / ROUGHNESS) * np.exp(1j * angles)
    root = np.sqrt(q * q - 4 * q)
    z = 1 + np.stack([-q + root, -q - root]) / 2
    return np.asarray(np.where(np.abs(z[0]) < 1, z[0], z[1]))


def _real(modes: Complex) -> Array:
    """Real and imaginary parts of complex modes as columns, without the empty ones."""
    columns = np.hstack([modes.real, modes.imag])
    return columns[:, np.abs(columns).max(axis=0) > 1e-9 * np.abs(columns).max()]


def _embed(block: Array, size: int) -> Array:
    return np.vstack([block, np.zeros((size - len(block), block.shape[1]))])


def _least_squares(matrix: Array, target: Array) -> Array:
    """By QR: the few modes that die out at different rates are told apart, and their many targets share one factor."""
    scales = np.linalg.norm(matrix, axis=0)
    factor, triangle = np.linalg.qr(matrix / scales)
    solution = np.linalg.solve(triangle, factor.T @ target)
    return np.asarray(solution / scales.reshape(-1, *[1] * (target.ndim - 1)))


def noise_along(samples: Array, fs: float, noise: ArrayLike | None) -> Array:
    """The noise's standard deviation at every sample: as given, or estimated."""
    if noise is None:
        return local_noise(samples, fs)
    try:
        level = np.asarray(noise, dtype=float)
    except (TypeError, ValueError):
        level = np.array(np.nan)
    if level.shape not in ((), samples.shape) or not np.isfinite(level).all() or (level < 0).any():
        raise EstimateError(
            f"noise = {np.array2string(np.asarray(noise), threshold=4)}",
            "a noise level is one number, or one per sample, finite and not negative",
            "pass noise= in the unit of the samples, or leave it out",
        )
    return np.broadcast_to(level, samples.shape)
