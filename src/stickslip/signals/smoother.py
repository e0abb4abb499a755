"""The smoother at the bottom of every derivative: penalised least squares on the samples, in n log n operations."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A jump in acceleration has the spectrum 1/w; a displacement with jumps in its acceleration at random 1/w^3. The best
# linear filter of such a signal in white noise (Wiener's) is 1/(1 + lambda w^6): a penalty on third differences.
ROUGHNESS = 3


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


def end_modes(penalty: float) -> NDArray[np.complex128]:
    """Roots z, |z| < 1, of ``1 + lambda (2 - z - 1/z)^3 = 0``: how the effect of an end dies out."""
    angles = np.pi * (2 * np.arange(ROUGHNESS) + 1) / ROUGHNESS
    q = penalty ** (-1 / ROUGHNESS) * np.exp(1j * angles)
    root = np.sqrt(q * q - 4 * q)
    z = 1 + np.stack([-q + root, -q - root]) / 2
    return np.asarray(np.where(np.abs(z[0]) < 1, z[0], z[1]))


def _real(modes: NDArray[np.complex128]) -> Array:
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
