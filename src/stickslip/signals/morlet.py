"""The Morlet wavelet transform of an array: band by band, at the rate that the band needs, then interpolated."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

REACH = {"double": 7.0, "single": 5.2}  # standard deviations of the Gaussian kept: exp(-7^2 / 2) = 2e-11
ACCURACY = {"double": 2e-11, "single": 1e-6}  # of the interpolation, where the row's spectrum is highest
SPARE = 1.35  # samples per unit of bandwidth that a row is interpolated from
MOST_PHASES = 64  # samples made of one
FEWEST = 64  # samples that are interpolated from
SHORT = 1 << 15  # samples, below which a whole transform costs less than the weights of an interpolation
GROUP = 32  # outputs of one product of matrices, or more: fewer are slower than their inputs are copied
AT_ONCE = 1 << 16  # outputs in the processor's cache


def normalised_gain(scale: float, normalisation: str) -> float:
    """Height of the wavelet's spectrum: of unit energy, or such that a tone of amplitude A has the modulus A."""
    return 2.0 if normalisation == "amplitude" else math.pi**-0.25 * math.sqrt(2 * math.pi * scale)


def ridge_centre(centre: float, normalisation: str) -> float:
    """Angular frequency times scale where the modulus of a tone is largest.

    The factor sqrt(a) of the energy normalisation moves it from the wavelet's centre w up to (w + sqrt(w^2 + 2)) / 2.
    """
    return centre if normalisation == "amplitude" else (centre + math.sqrt(centre**2 + 2)) / 2


def transform(
    values: Array, fs: float, scales: Array, *, centre: float, normalisation: str, precision: str = "double"
) -> NDArray[np.complexfloating]:
    """W(a, b) of each scale (rows) at each sample (columns); the values are zero before and after."""
    from scipy.fft import rfft

    out = np.empty((len(scales), len(values)), dtype=np.complex128 if precision == "double" else np.complex64)
    reach, count = REACH[precision], len(values)
    pad = math.ceil(reach * float(scales.max()) * fs)  # no wavelet reaches round the end
    size = _length(count + pad)
    spectrum = rfft(values.astype(out.real.dtype, copy=False), size)
    for row, scale in zip(out, scales.tolist(), strict=True):
        width = size / (2 * math.pi * scale * fs)  # standard deviation of the row's spectrum, in bins
        band = _band(spectrum, size, centre * width, width, reach, normalised_gain(scale, normalisation))
        _fill(row, band, size, width, centre * width, precision)
    return out


def _length(least: int) -> int:
    """A length that the transform is fast for, divisible by the numbers of phases."""
    from scipy.fft import next_fast_len

    phases = MOST_PHASES if least > SHORT else 1
    return int(next_fast_len(-(-least // phases))) * phases


def _band(
    spectrum: NDArray[np.complexfloating], size: int, middle: float, width: float, reach: float, gain: float
) -> tuple[int, NDArray[np.complexfloating]]:
    """First bin (negative ones are negative frequencies) and the row's spectrum from there on."""
    first = max(math.ceil(middle - reach * width), -((size - 1) // 2))
    last = min(math.floor(middle + reach * width), size // 2)
    bins = np.arange(first, last + 1)
    window = gain * np.exp(-0.5 * ((bins - middle) / width) ** 2)
    kept = window.astype(spectrum.real.dtype)
    part = np.empty(len(bins), dtype=spectrum.dtype)
    below = max(0, -first)
    part[below:] = spectrum[max(first, 0) : last + 1] * kept[below:]
    part[:below] = np.conj(spectrum[1 : below + 1][::-1][: len(part[:below])]) * kept[:below]
    return first, part


def _fill(
    row: NDArray[np.complexfloating],
    band: tuple[int, NDArray[np.complexfloating]],
    size: int,
    width: float,
    middle: float,
    precision: str,
) -> None:
    from scipy.fft import ifft

    first, part = band
    reach = REACH[precision]
    phases = 1
    while (
        size > SHORT
        and phases < MOST_PHASES
        and size % (2 * phases) == 0
        and size // (2 * phases) >= max(FEWEST, SPARE * 2 * reach * width)
    ):
        phases *= 2
    short = size // phases
    folded = np.zeros(short, dtype=part.dtype)
    start = first % short
    head = min(len(part), short - start)
    folded[start : start + head] = part[:head]
    folded[: len(part) - head] += part[head:]
    samples = ifft(folded, overwrite_x=True)
    samples *= 1 / phases
    if phases == 1:
        row[:] = samples[: len(row)]
    else:
        _interpolate(row, samples, phases, 2 * math.pi * width / short, 2 * math.pi * middle / short, precision)


def _interpolate(
    row: NDArray[np.complexfloating],
    samples: NDArray[np.complexfloating],
    phases: int,
    width: float,
    middle: float,
    precision: str,
) -> None:
    """`phases` values for each sample: each a weighted sum of its neighbours, all of them as a product of matrices."""
    weights = _weights(width, REACH[precision], ACCURACY[precision], phases)
    taps = len(weights)
    before = taps // 2 - 1
    apart = np.arange(phases) / phases - (np.arange(taps) - before)[:, None]
    turned = weights * np.exp(1j * middle * apart)
    group = max(1, GROUP // phases)
    matrix = np.zeros((taps + group - 1, group * phases), dtype=row.dtype)
    for number in range(group):
        matrix[number : number + taps, number * phases : (number + 1) * phases] = turned
    block = group * phases
    blocks = -(-len(row) // block)
    around = np.take(samples, np.arange(-before, blocks * group + taps), mode="wrap")
    windows = np.lib.stride_tricks.sliding_window_view(around, taps + group - 1)[::group]
    whole, step = len(row) // block, max(1, AT_ONCE // block)
    shaped = row[: whole * block].reshape(whole, block)
    for begin in range(0, whole, step):
        end = min(begin + step, whole)
        np.matmul(np.ascontiguousarray(windows[begin:end]), matrix, out=shaped[begin:end])
    if whole < blocks:
        row[whole * block :] = (windows[whole] @ matrix)[: len(row) - whole * block]


def _weights(width: float, reach: float, accuracy: float, phases: int) -> Array:
    """Weights of the neighbours, shape (neighbours, phases), best in the mean over a Gaussian spectrum about zero."""
    angles = np.linspace(0, reach * width, 160)
    height = np.exp(-0.5 * (angles / width) ** 2)
    height = np.concatenate([height, height])[:, None]

    def waves(places: Array) -> Array:
        turn = np.outer(angles, places)
        return np.asarray(np.vstack([np.cos(turn), np.sin(turn)]) * height)

    target = waves(np.arange(phases) / phases)
    for taps in range(6, 33, 2):
        design = waves(np.arange(taps, dtype=float) - (taps // 2 - 1))
        weights = np.linalg.lstsq(design, target, rcond=1e-15)[0]
        if np.abs(design @ weights - target).max() < accuracy:
            break
    return np.asarray(weights)
