"""The Morlet wavelet transform of an array: band by band, at the rate that the band needs, then interpolated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.signals.upsample import (
    LEAD,
    MANY,
    MOST_PHASES,
    MOST_TAPS,
    SHIFT,
    TAIL,
    TILE,
    WIDEST,
    WIDEST_OF_MANY,
    upsampled,
)

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating]

REACH = {"double": 7.0, "single": 4.9}  # standard deviations of the Gaussian kept: exp(-7^2 / 2) = 2e-11
ACCURACY = {"double": 2e-11, "single": 3e-6}  # of the interpolation, where the row's spectrum is highest
SHORT = 1 << 15  # samples, below which a whole transform costs less than the weights of an interpolation
BLOCKS = (1 << 11, 1 << 14)  # samples of one transform of many
MARGIN = 16  # of them at either end, one in so many, a wavelet of the neighbours may reach
MOST_IN_BLOCKS = 32  # values made of one sample there
FEWEST_BLOCKS = 4
AT_ONCE = 1 << 19  # bytes of the blocks gone through together, which the processor's cache holds


def normalised_gain(scale: float, normalisation: str) -> float:
    """Height of the wavelet's spectrum: of unit energy, or such that a tone of amplitude A has the modulus A."""
    return 2.0 if normalisation == "amplitude" else math.pi**-0.25 * math.sqrt(2 * math.pi * scale)


def ridge_centre(centre: float, normalisation: str) -> float:
    """Angular frequency times scale where the modulus of a tone is largest.

    The factor sqrt(a) of the energy normalisation moves it from the wavelet's centre w up to (w + sqrt(w^2 + 2)) / 2.
    """
    return centre if normalisation == "amplitude" else (centre + math.sqrt(centre**2 + 2)) / 2


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Spectra of a signal's blocks, which overlap by twice the margin; or that of the whole, as one block without."""

    spectra: Complex
    length: int
    margin: int
    most_phases: int

    def phases(self, width: float, precision: str) -> int:
        """The most values that one sample of a band so wide (standard deviation, in bins) can make."""
        phases = 1
        while phases < self.most_phases:
            half = _half(width, self.length // (2 * phases), precision)
            if half >= (WIDEST if 2 * phases < MANY else WIDEST_OF_MANY):
                break
            phases *= 2
        return phases

    def hold(self, samples: float, phases: int, middle: float, width: float, reach: float) -> bool:
        """Whether the margin holds what a wavelet reaches and the interpolation takes.

        It reaches further where half the rate cuts its spectrum off.
        """
        uncut = middle + reach * width <= self.length / 2
        return not self.margin or (uncut and reach * samples + MOST_TAPS // 2 * phases <= self.margin)


def transform(
    values: Array, fs: float, scales: Array, *, centre: float, normalisation: str, precision: str = "double"
) -> Complex:
    """W(a, b) of each scale (rows) at each sample (columns); the values are zero before and after."""
    out = np.empty((len(scales), len(values)), dtype=np.complex128 if precision == "double" else np.complex64)
    signal = values.astype(out.real.dtype, copy=False)
    ways = [partial(_blocks, signal, size) for size in BLOCKS if len(signal) > FEWEST_BLOCKS * size]
    ways.append(partial(_whole, signal, math.ceil(REACH[precision] * float(scales.max()) * fs)))
    made: dict[int, _Blocks] = {}
    for row, scale in zip(out, scales.tolist(), strict=True):
        for number, way in enumerate(ways):
            if number not in made:
                made[number] = way()
            blocks, width = made[number], _width(made[number], scale * fs)
            phases = blocks.phases(width, precision)
            if blocks.hold(scale * fs, phases, centre * width, width, REACH[precision]):
                break
        _fill(row, blocks, phases, width, centre, normalised_gain(scale, normalisation), precision)
    return out


def _blocks(signal: Array, size: int) -> _Blocks:
    from scipy.fft import rfft

    margin = size // MARGIN
    step = size - 2 * margin
    count = -(-len(signal) // step)
    padded = np.zeros(count * step + 2 * margin, dtype=signal.dtype)
    padded[margin : margin + len(signal)] = signal
    cut = np.lib.stride_tricks.sliding_window_view(padded, size)[::step]
    return _Blocks(rfft(cut, axis=1), size, margin, MOST_IN_BLOCKS)


def _whole(signal: Array, pad: int) -> _Blocks:
    """`pad`: no wavelet reaches round the end."""
    from scipy.fft import next_fast_len, rfft

    least = len(signal) + pad
    unit = MOST_PHASES * TILE if least > SHORT else 1
    size = int(next_fast_len(-(-least // unit))) * unit
    return _Blocks(rfft(signal, size)[None], size, 0, MOST_PHASES if least > SHORT else 1)


def _width(blocks: _Blocks, samples: float) -> float:
    """Standard deviation of a row's spectrum, in bins, where the scale has so many samples."""
    return blocks.length / (2 * math.pi * samples)


def _half(width: float, short: int, precision: str) -> float:
    """Half the width [rad a sample] of a row's spectrum that is kept, in a transform so short."""
    return 2 * math.pi * REACH[precision] * width / short + SHIFT


def _fill(row: Complex, blocks: _Blocks, phases: int, width: float, centre: float, gain: float, precision: str) -> None:
    reach, middle, short = REACH[precision], centre * width, blocks.length // phases
    margin, turns = blocks.margin // phases, round(middle * TILE / short) if phases > 1 else 0
    bins = np.arange(
        max(math.ceil(middle - reach * width), -((blocks.length - 1) // 2)),
        min(math.floor(middle + reach * width), blocks.length // 2) + 1,
    )
    window = (gain / phases * np.exp(-0.5 * ((bins - middle) / width) ** 2)).astype(row.real.dtype)
    parts, inner = _folded(window, int(bins[0]), turns * short // TILE, short), short - 2 * margin
    around = row if phases == 1 else np.empty(LEAD + len(blocks.spectra) * inner + TAIL, dtype=row.dtype)
    laid = row if phases == 1 else around[LEAD:-TAIL]
    step = max(1, AT_ONCE // (short * row.itemsize))
    first = last = row[:0]
    for begin in range(0, len(blocks.spectra), step):
        samples = _inverse(blocks.spectra[begin : begin + step], parts, short)
        first, last = samples[0] if begin == 0 else first, samples[-1]
        kept = laid[begin * inner : (begin + step) * inner]
        count = len(kept) // inner
        kept[: count * inner].reshape(count, inner)[:] = samples[:count, margin : margin + inner]
        kept[count * inner :] = last[margin : margin + len(kept) - count * inner]
    if phases > 1:
        around[:LEAD] = first.take(np.arange(margin - LEAD, margin), mode="wrap")
        around[-TAIL:] = last.take(np.arange(short - margin, short - margin + TAIL), mode="wrap")
        half = _half(width, short, precision)
        upsampled(around, row, phases, turns=turns, half=half, reach=reach, accuracy=ACCURACY[precision])


class _Part(NamedTuple):
    """Bins of a spectrum, of negative frequencies or not, that go to others of the folded one."""

    source: slice
    negative: bool
    window: Array
    target: slice


def _folded(window: Array, first: int, shift: int, short: int) -> list[_Part]:
    """The bins from `first` on, moved down by `shift` and folded into `short` ones."""
    last, fold = first + len(window) - 1, shift + (first - shift) // short * short
    bounds = sorted({first, last + 1, *(at for at in (0, fold + short, fold + 2 * short) if first < at <= last)})
    parts = []
    for low, high in pairwise(bounds):  # neither crosses bin 0, nor a fold
        negative, target = low < 0, (low - shift) % short
        source = slice(-low, -high, -1) if negative else slice(low, high)
        parts.append(_Part(source, negative, window[low - first : high - first], slice(target, target + high - low)))
    return parts


def _inverse(spectra: Complex, parts: list[_Part], short: int) -> Complex:
    from scipy.fft import ifft

    band = np.zeros((len(spectra), short), dtype=spectra.dtype)
    for part in parts:
        source = spectra[:, part.source]
        np.multiply(np.conj(source) if part.negative else source, part.window, out=band[:, part.target])
    return np.asarray(ifft(band, axis=1, overwrite_x=True))
