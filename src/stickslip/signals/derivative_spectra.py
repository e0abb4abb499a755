"""Spectra of a channel's derivatives without differencing: the window is differentiated, not the samples."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

TAPER = 0.05  # of the stretch, at each of its ends


def derivative_spectra(values: Array, *, fs: float, orders: Sequence[int], shift: float = 0.0) -> Complex:
    r"""What are the windowed Fourier integrals of a channel's derivatives?

    By parts, with the modulating function :math:`\varphi = w(t)\,e^{-i\omega t}` that vanishes at both ends with its
    derivatives (Shinbrot 1957, "On the analysis of linear and nonlinear systems", Trans. ASME 79),

    .. math:: \int \varphi\,x^{(n)}(t - d)\,dt = (-1)^n \int \varphi^{(n)}(t + d)\,x(t)\,dt ,

    so that neither a derivative nor a value between samples is ever made of noisy samples: the shift d moves the
    window. A relation that is linear in derivatives thus holds line by line, whatever the motion, with no leakage.

    Parameters
    ----------
    values : ndarray (n,)
        Samples.
    fs : float
        Sampling rate [Hz].
    orders : sequence of int
        Orders n of the derivatives wanted, 0 to 2.
    shift : float
        d [s], of a sample at most.

    Returns
    -------
    ndarray (len(orders), n // 2 + 1)
        At the frequencies ``np.fft.rfftfreq(n, 1 / fs)``, in samples of the channel's unit times 1/s^n.

    Examples
    --------
    >>> t = np.arange(4096) / 1000
    >>> x, a = np.cos(50 * t), -2500 * np.cos(50 * t)
    >>> of_x, of_a = derivative_spectra(x, fs=1000, orders=[2])[0], derivative_spectra(a, fs=1000, orders=[0])[0]
    >>> bool(np.abs(of_x - of_a).max() < 1e-6 * np.abs(of_a).max())
    True
    """
    count = len(values)
    windows = _windows(np.arange(0.5, count) / fs + shift, count / fs)
    transformed = [np.fft.rfft(window * values) for window in windows[: max(orders) + 1]]
    turn = 2j * math.pi * np.fft.rfftfreq(count, 1 / fs)
    later = np.exp(-turn * shift)
    spectra = np.empty((len(orders), len(turn)), dtype=complex)
    for row, order in zip(spectra, orders, strict=True):
        row[:] = later * sum(
            math.comb(order, j) * (-1) ** j * turn ** (order - j) * transformed[j] for j in range(order + 1)
        )
    return spectra


def window(count: int) -> Array:
    """The window, over `count` samples."""
    return _windows(np.arange(0.5, count), float(count))[0]


def _windows(times: Array, length: float) -> tuple[Array, Array, Array]:
    """The window and its first two derivatives: flat, with ends of u^4 (35 - 84 u + 70 u^2 - 20 u^3)."""
    taper = TAPER * length
    flat, first, second = np.ones_like(times), np.zeros_like(times), np.zeros_like(times)
    low, high = np.searchsorted(times, [taper, length - taper])
    for rows, side in ((slice(None, low), 1.0), (slice(high, None), -1.0)):
        inside = times[rows] if side > 0 else length - times[rows]
        u = np.clip(inside / taper, 0.0, 1.0)
        flat[rows] = u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)
        first[rows] = 140 * u**3 * (1 - u) ** 3 * side / taper
        second[rows] = 420 * u**2 * (1 - u) ** 2 * (1 - 2 * u) / taper**2
    return flat, first, second
