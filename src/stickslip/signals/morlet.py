"""The Morlet wavelet transform of an array: band by band, at the rate that the band needs, then interpolated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stickslip.signals.upsample import LEAD, MOST_PHASES, SHIFT, TAIL, TILE, WIDEST, upsampled

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating]

REACH = {"double": 7.0, "single": 5.2}  # standard deviations of the Gaussian kept: exp(-7^2 / 2) = 2e-11
ACCURACY = {"double": 2e-11, "single": 1e-6}  # of the interpolation, where the row's spectrum is highest
SHORT = 1 << 15  # samples, below which a whole transform costs less than the weights of an interpolation
BLOCK = 1 << 14  # samples of one transform of many, which the processor's cache holds
MARGIN = 1 << 10  # of them at either end that a wavelet of the neighbours may reach
MOST_IN_BLOCKS = 32  # values made of one sample there
FEWEST_BLOCKS = 4


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
        while phases < self.most_phases and _half(width, self.length // (2 * phases), precision) < WIDEST:
            phases *= 2
        return phases


def transform(
    values: Array, fs: float, scales: Array, *, centre: float, normalisation: str, precision: str = "double"
) -> Complex:
    """W(a, b) of each scale (rows) at each sample (columns); the values are zero before and after."""
    out = np.empty((len(scales), len(values)), dtype=np.complex128 if precision == "double" else np.complex64)
    signal = values.astype(out.real.dtype, copy=False)
    reached = REACH[precision] * scales * fs  # samples on either side
    many = _blocks(signal) if len(signal) > FEWEST_BLOCKS * BLOCK else None
    whole = None
    for row, scale, reach in zip(out, scales.tolist(), reached.tolist(), strict=True):
        blocks = many
        if many is None or reach + TAIL * many.phases(_width(many, scale * fs), precision) > MARGIN:
            blocks = whole = whole or _whole(signal, math.ceil(reached.max()))
        assert blocks is not None
        _fill(row, blocks, _width(blocks, scale * fs), centre, normalised_gain(scale, normalisation), precision)
    return out


def _blocks(signal: Array) -> _Blocks:
    from scipy.fft import rfft

    step = BLOCK - 2 * MARGIN
    count = -(-len(signal) // step)
    padded = np.zeros(count * step + 2 * MARGIN, dtype=signal.dtype)
    padded[MARGIN : MARGIN + len(signal)] = signal
    cut = np.lib.stride_tricks.sliding_window_view(padded, BLOCK)[::step]
    return _Blocks(rfft(cut, axis=1), BLOCK, MARGIN, MOST_IN_BLOCKS)


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


def _fill(row: Complex, blocks: _Blocks, width: float, centre: float, gain: float, precision: str) -> None:
    from scipy.fft import ifft

    phases = blocks.phases(width, precision)
    short, margin = blocks.length // phases, blocks.margin // phases
    turns = round(centre * width * TILE / short) if phases > 1 else 0
    band = _band(blocks, short, turns * short // TILE, centre * width, width, REACH[precision], gain / phases)
    samples = ifft(band, axis=1, overwrite_x=True)
    count, inner = len(samples), short - 2 * margin
    if phases == 1:
        whole = len(row) // inner
        row[: whole * inner].reshape(whole, inner)[:] = samples[:whole, margin : margin + inner]
        row[whole * inner :] = samples[-1, margin : margin + len(row) - whole * inner]
        return
    around = np.empty(LEAD + count * inner + TAIL, dtype=row.dtype)
    around[:LEAD] = samples[0].take(np.arange(margin - LEAD, margin), mode="wrap")
    around[LEAD:-TAIL].reshape(count, inner)[:] = samples[:, margin : margin + inner]
    around[-TAIL:] = samples[-1].take(np.arange(short - margin, short - margin + TAIL), mode="wrap")
    half = _half(width, short, precision)
    upsampled(around, row, phases, turns=turns, half=half, reach=REACH[precision], accuracy=ACCURACY[precision])


def _band(blocks: _Blocks, short: int, shift: int, middle: float, width: float, reach: float, gain: float) -> Complex:
    """The blocks' spectra times the row's Gaussian, moved down by `shift` bins and folded into `short` ones."""
    size, spectra = blocks.length, blocks.spectra
    first = max(math.ceil(middle - reach * width), -((size - 1) // 2))
    last = min(math.floor(middle + reach * width), size // 2)
    window = (gain * np.exp(-0.5 * ((np.arange(first, last + 1) - middle) / width) ** 2)).astype(spectra.real.dtype)
    band = np.zeros((len(spectra), short), dtype=spectra.dtype)
    fold = shift + (first - shift) // short * short
    bounds = sorted({first, last + 1, *(at for at in (0, fold + short, fold + 2 * short) if first < at <= last)})
    for low, high in pairwise(bounds):  # neither crosses bin 0, nor a fold; negative bins are negative frequencies
        part = spectra[:, low:high] if low >= 0 else np.conj(spectra[:, 1 - high : 1 - low][:, ::-1])
        np.multiply(part, window[low - first : high - first], out=band[:, (low - shift) % short :][:, : high - low])
    return band
