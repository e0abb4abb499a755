"""The Morlet wavelet transform of an array: band by band, at the rate that the band needs, then interpolated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.compiled import FAST, compiled

TILE = 64  # samples gone through at once, so that what they make stays in the processor's cache
MOST_PHASES = 64  # values made of one sample
SHIFT = math.pi / TILE  # [rad a sample] a band's middle may lie from zero
WIDEST = 2.4  # [rad a sample] half of a band, which is pi where nothing is to spare
WIDEST_OF_MANY = 2.0  # the same where the values are `MANY`
MANY = 16  # phases from which on they are gone through sample by sample
BYTES = 256  # half of the values made at once there take so many
STEPS = 8  # widths an octave that there are weights for
MOST_TAPS = 40
LEAD = MOST_TAPS // 2 + 8  # samples before the first that values are made of
TAIL = MOST_TAPS // 2 + 24  # and after the last


def upsampled(
    samples: NDArray[np.complexfloating],
    out: NDArray[np.complexfloating],
    phases: int,
    *,
    turns: int,
    half: float,
    reach: float,
    accuracy: float,
) -> None:
    """Fill `out` with a band's values, so many for each of its samples.

    Parameters
    ----------
    samples : ndarray (LEAD + s + TAIL,)
        The band, moved to zero frequency but for :data:`SHIFT`; the first value lies on the sample after `LEAD`, and s
        is a multiple of `TILE`.
    out : ndarray (n,)
        At most ``phases s`` values.
    phases : int
        Values a sample, a power of two up to `MOST_PHASES`.
    turns : int
        The band is moved up by so many cycles in `TILE` samples.
    half : float
        Half of the band's width [rad a sample].
    reach : float
        The same in standard deviations of its Gaussian.
    accuracy : float
        Of the weights, where the spectrum is highest.
    """
    weights = _weights(math.ceil(STEPS * math.log2(half / WIDEST)), reach, accuracy)[:: MOST_PHASES // phases]
    kind = out.real.dtype
    if phases < MANY:
        weights = np.pad(weights, ((0, 0), (1, 1))) if weights.shape[1] % 4 else weights
        around = samples[LEAD + 1 - weights.shape[1] // 2 :]
        places = turns * (np.arange(TILE) * phases + np.arange(phases)[:, None]) % (TILE * phases)
        turn = np.exp(2j * np.pi / (TILE * phases) * places).astype(out.dtype)
        room = np.empty((phases, 2 * TILE), dtype=kind)
        _FEW[phases](around.view(kind), weights.astype(kind), turn.view(kind), room, out.view(kind))
        return
    values = 2 * BYTES // kind.itemsize  # made at once
    halves, first = _halves(weights, values)
    swing = np.exp(2j * np.pi * (turns * np.arange(TILE) % TILE) / TILE).astype(out.dtype)
    turn = np.exp(2j * np.pi * turns / (TILE * phases) * np.arange(values)).astype(out.dtype)
    room = np.empty((8, max(halves.shape[1:])), dtype=kind)
    _MANY[kind.itemsize](
        samples[LEAD - first :],
        halves.astype(kind),
        (first, values // phases),
        swing,
        np.array([turn.real, turn.imag]),
        room,
        np.empty_like(turn),
        out,
    )


@lru_cache(maxsize=256)
def _weights(step: int, reach: float, accuracy: float) -> Array:
    """Weights (phases, neighbours), best in the mean over a Gaussian spectrum whose middle is within SHIFT of zero."""
    half = WIDEST * 2.0 ** (max(step, -4 * STEPS) / STEPS)
    angles = np.linspace(0, half, 160)
    spread = (half - SHIFT) / reach
    height = np.exp(-0.5 * (np.maximum(angles - SHIFT, 0) / spread) ** 2)
    height = np.concatenate([height, height])[:, None]

    def waves(places: Array) -> Array:
        turn = np.outer(angles, places)
        return np.asarray(np.vstack([np.cos(turn), np.sin(turn)]) * height)

    target = waves(np.arange(MOST_PHASES) / MOST_PHASES)
    for taps in range(4, MOST_TAPS + 1, 2):
        design = waves(np.arange(taps, dtype=float) - (taps // 2 - 1))
        weights = np.linalg.lstsq(design, target, rcond=1e-15)[0]
        if np.abs(design @ weights - target).max() < accuracy:
            break
    return np.ascontiguousarray(weights.T)


def _few_of(phases: int) -> Any:
    """The kernel for so many phases: a constant of it, so that what it writes lies side by side."""

    @compiled(**FAST)
    def few(around, weights, turn, room, out):
        """Phase by phase over a tile. Real and imaginary parts stand side by side; the taps are a multiple of four.

        `around` (2 s,) and `out` (2 n,) are views of complex arrays; `weights` is (phases, taps), `turn` and `room`
        (phases, 2 TILE).
        """
        taps, tile = weights.shape[1], room.shape[1]
        for first in range(0, out.size // phases + 1, tile):
            # Weigh: four taps at a time, so that a sum is read and written once for four products.
            for phase in range(1, phases):
                sums = room[phase]
                for j in range(0, taps, 4):
                    a, b, c, d = weights[phase, j], weights[phase, j + 1], weights[phase, j + 2], weights[phase, j + 3]
                    window = around[first + 2 * j : first + 2 * j + tile + 6]
                    if j == 0:
                        for i in range(tile):
                            sums[i] = a * window[i] + b * window[i + 2] + c * window[i + 4] + d * window[i + 6]
                    else:
                        for i in range(tile):
                            sums[i] += a * window[i] + b * window[i + 2] + c * window[i + 4] + d * window[i + 6]
            window = around[first + taps - 2 : first + taps - 2 + tile]
            for i in range(tile):  # the samples themselves
                room[0, i] = window[i]
            # Turn: up to the band's own frequency, as the values are written; the last tile may be cut short.
            row = out[first * phases : (first + tile) * phases]
            if row.size == tile * phases:
                for k in range(tile // 2):
                    for phase in range(phases):
                        c, s = turn[phase, 2 * k], turn[phase, 2 * k + 1]
                        x, y = room[phase, 2 * k], room[phase, 2 * k + 1]
                        row[2 * (k * phases + phase)] = c * x - s * y
                        row[2 * (k * phases + phase) + 1] = c * y + s * x
            else:
                for place in range(row.size // 2):
                    k, phase = place // phases, place % phases
                    c, s = turn[phase, 2 * k], turn[phase, 2 * k + 1]
                    x, y = room[phase, 2 * k], room[phase, 2 * k + 1]
                    row[2 * place] = c * x - s * y
                    row[2 * place + 1] = c * y + s * x

    return few


def _halves(weights: Array, values: int) -> tuple[Array, int]:
    """Weights of the values made at once, in two parts: even and odd about the middle of their neighbours.

    Of all but the first up to the middle one; the others mirror them. And how many samples come before the first.
    """
    phases, taps = weights.shape
    together = values // phases
    least = (taps + together) // 2
    pairs = -(-least // 4) * 4
    before = pairs - least
    wide = np.zeros((2 * pairs - (taps + together - 1) % 2, values // 2))
    for lane, column in enumerate(wide.T):
        sample, phase = divmod(lane + 1, phases)
        column[before + sample : before + sample + taps] = weights[phase]
    halves = np.array([(wide + wide[::-1])[:pairs], (wide - wide[::-1])[:pairs]]) / 2
    if len(wide) % 2:
        halves[0, -1] /= 2  # the middle one is its own neighbour
    return halves, before + taps // 2 - 1


@compiled(**FAST, inline="always")
def _sums(weights, real, imaginary, sums, sums_i, lanes):
    """Complex values times weights, of which there is a multiple of four."""
    for j in range(0, real.size, 4):
        a, b, c, d = real[j], real[j + 1], real[j + 2], real[j + 3]
        ai, bi, ci, di = imaginary[j], imaginary[j + 1], imaginary[j + 2], imaginary[j + 3]
        e, f, g, h = weights[j], weights[j + 1], weights[j + 2], weights[j + 3]
        if j == 0:
            for i in range(lanes):
                sums[i] = a * e[i] + b * f[i] + c * g[i] + d * h[i]
                sums_i[i] = ai * e[i] + bi * f[i] + ci * g[i] + di * h[i]
        else:
            for i in range(lanes):
                sums[i] += a * e[i] + b * f[i] + c * g[i] + d * h[i]
                sums_i[i] += ai * e[i] + bi * f[i] + ci * g[i] + di * h[i]


def _many_of(lanes: int) -> Any:
    """The kernel for twice so many values at once: a constant of it, so that its loops are unrolled."""

    @compiled(**FAST)
    def many(around, halves, span, swing, turn, room, spare, out):
        """All phases of some samples, half of them by the mirrored weights; the pairs are a multiple of four.

        `around` (s,) and `out` (n,) are complex, `halves` is (2, pairs, lanes), `swing` (TILE,), `turn` (2, 2 lanes),
        `room` (8, pairs or lanes), `spare` (2 lanes,).
        """
        (first, together), pairs = span, halves.shape[1]
        plus, plus_i, minus, minus_i = room[0, :pairs], room[1, :pairs], room[2, :pairs], room[3, :pairs]
        er, ei, dr, di, cosine, sine = room[4], room[5], room[6], room[7], turn[0], turn[1]
        for number in range(-(-out.size // (2 * lanes))):
            begin = number * together
            to, last = swing[begin % swing.size], begin + 2 * first + together
            # Fold: sums and differences of samples as far before the middle as behind it.
            for j in range(pairs):
                one, other = to * around[begin + j], to * around[last - j]
                plus[j], plus_i[j] = one.real + other.real, one.imag + other.imag
                minus[j], minus_i[j] = one.real - other.real, one.imag - other.imag
            # Weigh: even weights see the sums, odd ones the differences: half the products.
            _sums(halves[0], plus, plus_i, er, ei, lanes)
            _sums(halves[1], minus, minus_i, dr, di, lanes)
            # Unfold: even + odd is a value, even - odd its mirror image; turned up to the band's own frequency.
            row = out[2 * number * lanes : 2 * (number + 1) * lanes]
            made = row if row.size == 2 * lanes else spare
            made[0] = to * around[begin + first]
            for i in range(lanes):
                x, y = er[i] + dr[i], ei[i] + di[i]
                made[i + 1] = complex(cosine[i + 1] * x - sine[i + 1] * y, sine[i + 1] * x + cosine[i + 1] * y)
            for i in range(lanes):
                x, y = er[lanes - 1 - i] - dr[lanes - 1 - i], ei[lanes - 1 - i] - di[lanes - 1 - i]
                c, s = cosine[lanes + i], sine[lanes + i]
                made[lanes + i] = complex(c * x - s * y, s * x + c * y)
            if row.size < 2 * lanes:
                for i in range(row.size):
                    row[i] = spare[i]

    return many


_FEW = {phases: _few_of(phases) for phases in (2, 4, 8)}
_MANY = {size: _many_of(BYTES // size) for size in (4, 8)}


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
    if 2 * bins[-1] == blocks.length:
        window[-1] /= 2  # half of it is the same frequency's, turning back
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
