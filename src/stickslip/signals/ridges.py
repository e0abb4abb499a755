"""What stands out in a map over time and frequency: ridges, local maxima, and spikes across all frequencies.

The short-time Fourier transform, beside which wavelet maps can be held; and the harmonics of a periodic channel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Mask, Rows
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import Estimate, Result
from stickslip.record.metadata import labelled_arrays
from stickslip.record.record import Record
from stickslip.signals.wavelet import ends, wavelet_map
from stickslip.statistics import LeastSquares, least_squares, student

if TYPE_CHECKING:
    import xarray as xr


STEP = 0.25  # of the shortest scale: the columns of a map that are looked at
LEVEL_STEP = 0.5  # dB: how finely a prominence is told
OCTAVES, VOICES = (1 / 16, 1 / 4), 4  # of the rate: where spikes are looked for
FLOOR = 1e-7  # of a row's largest modulus, below which nothing is told
BLIND = 6.0  # wavelet frequency: one of 4.5 sees exp(-10) of the level, which may be more than a kink
FLAT = 0.5  # of a spike's level that every frequency reaches: a tone does not

LEAST = 16  # samples


@dataclass(frozen=True, eq=False)
class Ridge:
    """A line along which the modulus is largest over the frequencies.

    Attributes
    ----------
    time, frequency, modulus : ndarray, shape (n,)
        Of its points [s], [Hz], [unit of the map].
    """

    time: Array
    frequency: Array
    modulus: Array

    @property
    def duration(self) -> float:
        """How long it lasts [s]."""
        return float(self.time[-1] - self.time[0])

    def __repr__(self) -> str:
        low, high = self.frequency.min(), self.frequency.max()
        return f"Ridge({low:.4g} to {high:.4g} Hz, {self.time[0]:.4g} to {self.time[-1]:.4g} s)"


@dataclass(frozen=True)
class LocalMaximum:
    """A peak of a map.

    Attributes
    ----------
    time, frequency, modulus : float
        Where [s], [Hz] and how high [unit of the map].
    prominence : float
        By how many dB one has to go down from it to reach a higher one.
    """

    time: float
    frequency: float
    modulus: float
    prominence: float


@dataclass(frozen=True)
class Spike:
    """A vertical structure: all high frequencies at one instant.

    Attributes
    ----------
    time : float
        When [s].
    level : float
        dB above the median, mean of the frequencies.
    group : int
        Number of the group that it belongs to.
    """

    time: float
    level: float
    group: int


def find_ridges(wavelets: xr.DataArray, *, span: float = 40.0, cycles: float = 3.0) -> tuple[Ridge, ...]:
    """Along which lines is the modulus largest over the frequencies?

    At each time the local maxima over the frequencies, refined by a parabola through the logarithms, are joined with
    those at the next time that are at most one frequency of the map away: a ridge ends where it can not go on, and
    never jumps. Where an end of the record is felt, within the map's cone, there is none: the end bends it.

    Parameters
    ----------
    wavelets : xarray.DataArray
        What :func:`wavelet_map` returned.
    span : float
        Decibel below the map's largest modulus where a ridge ends.
    cycles : float
        Oscillations that a ridge lasts at least.

    Returns
    -------
    tuple of Ridge
        The strongest first.

    Raises
    ------
    RecordError
        Something that is no wavelet map.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> record = Record.of({"a": np.sin(2 * np.pi * (30 * t + 5 * t**2))}, fs=1000)
    >>> ridge = find_ridges(wavelet_map(record, "a", frequencies=(10, 150)))[0]
    >>> [round(float(np.interp(at, ridge.time, ridge.frequency))) for at in (1, 2, 3)]
    [40, 50, 60]
    """
    modulus, times, frequencies = _coarse(wavelets)
    if not modulus.any():
        return ()
    level = np.log(np.maximum(modulus, modulus.max() * 1e-12))
    crest = np.zeros(modulus.shape, dtype=bool)
    crest[1:-1] = (level[1:-1] >= level[:-2]) & (level[1:-1] > level[2:])
    crest &= (level > level.max() - span * math.log(10) / 20) & ~_near_ends(wavelets, times)
    if not crest.any():
        return ()
    ridges = []
    for rows, columns in _chains(crest, level):
        place, height = _refined(level, rows, columns)
        frequency = np.exp(np.interp(place, np.arange(len(frequencies)), np.log(frequencies)))
        ridge = Ridge(times[columns], frequency, np.exp(height))
        if ridge.duration * float(np.median(frequency)) >= cycles:
            ridges.append(ridge)
    return tuple(sorted(ridges, key=lambda ridge: -float((ridge.modulus**2).sum())))


def local_maxima(wavelets: xr.DataArray, *, prominence: float = 3.0, span: float = 60.0) -> tuple[LocalMaximum, ...]:
    """Where does a map have its peaks, and how far do they stand out?

    The thesis's circle-like structures. A peak's prominence is what has to be descended to reach a higher one.

    Parameters
    ----------
    wavelets : xarray.DataArray
        What :func:`wavelet_map` returned.
    prominence : float
        Decibel at least.
    span : float
        Decibel below the map's largest modulus down to which peaks are looked for.

    Returns
    -------
    tuple of LocalMaximum
        In the order of time; none at the edge of the map, and none whose surroundings, down to the prominence, reach
        where an end of the record is felt: a tone that runs through is no peak.

    Raises
    ------
    RecordError
        Something that is no wavelet map, or a prominence that is not positive.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> bursts = sum(np.exp(-(((t - at) / 0.1) ** 2)) * np.sin(2 * np.pi * f * t) for at, f in ((1, 40), (3, 90)))
    >>> maxima = local_maxima(wavelet_map(Record.of({"a": bursts}, fs=1000), "a", frequencies=(10, 200)))
    >>> [(round(peak.time, 1), round(peak.frequency, -1)) for peak in maxima]
    [(1.0, 40.0), (3.0, 90.0)]
    """
    from scipy.ndimage import label, maximum_filter

    if not prominence > 0:
        raise RecordError(f"prominence = {prominence} dB", "a peak stands out by more than 0 dB", "give a positive one")
    modulus, times, frequencies = _coarse(wavelets)
    if not modulus.any():
        return ()
    level = 20 * np.log10(np.maximum(modulus / modulus.max(), 1e-12))
    peak = (maximum_filter(level, size=3) == level) & (level > -span)
    peak[[0, -1]] = peak[:, [0, -1]] = False
    rows, columns = np.nonzero(peak)
    heights, stands = level[rows, columns], np.full(len(rows), np.inf)
    felt = _near_ends(wavelets, times)
    order = np.argsort(-heights, kind="stable")
    for floor in np.arange(0.0, -span - LEVEL_STEP, -LEVEL_STEP):
        regions, _ = label(level >= floor, structure=np.ones((3, 3)))
        here = regions[rows[order], columns[order]]
        above = order[here > 0]
        _, first = np.unique(here[here > 0], return_index=True)  # the highest of each region
        lower = np.setdiff1d(above, above[first])
        new = lower[np.isinf(stands[lower])]
        stands[new] = heights[new] - floor
        cut = np.isin(regions[rows, columns], np.unique(regions[felt & (regions > 0)])) & (heights >= floor)
        stands[cut] = np.minimum(stands[cut], heights[cut] - floor)
    stands = np.minimum(stands, heights + span)  # lower, nothing is known of the map
    kept = [n for n in range(len(rows)) if stands[n] >= prominence]
    columns_of = (times[columns], frequencies[rows], modulus[rows, columns], stands)
    maxima = [LocalMaximum(*(float(values[n]) for values in columns_of)) for n in kept]
    return tuple(sorted(maxima, key=lambda ridge: ridge.time))


def find_spikes(
    record: Record,
    channel: str,
    *,
    threshold: float = 12.0,
    frequencies: ArrayLike | None = None,
    within: float | None = None,
) -> tuple[Spike, ...]:
    """When does a signal jump or kink: at which instants do all high frequencies sound at once?

    The logarithm of each row of the map over its median, averaged over the frequencies, has its maximum where a jump, a
    kink or an impulse is, to a sample; a tone raises some frequencies and not the others.

    Parameters
    ----------
    record : Record
        At one rate.
    channel : str
        Which channel.
    threshold : float
        Decibel over the median that a spike has.
    frequencies : array_like, optional
        Lowest and highest [Hz] that are looked at; a sixteenth to a quarter of the rate when not given.
    within : float, optional
        Spikes no further apart [s] are one group; where the gaps are of two sizes, as these tell, when not given.

    Returns
    -------
    tuple of Spike
        In the order of time.

    Raises
    ------
    RecordError
        As :func:`wavelet_map`.

    Examples
    --------
    >>> values = np.random.default_rng(0).normal(0, 0.01, 4000)
    >>> values[[1000, 1040, 3000, 3040]] += 1.0
    >>> [(round(spike.time, 3), spike.group) for spike in find_spikes(Record.of({"a": values}, fs=1000), "a")]
    [(1.0, 0), (1.04, 0), (3.0, 1), (3.04, 1)]
    """
    from scipy.signal import find_peaks

    wanted = np.asarray(OCTAVES) * record.fs if frequencies is None else np.asarray(frequencies, dtype=float)
    wavelets = wavelet_map(record, channel, frequencies=wanted, voices=VOICES, wavelet_frequency=BLIND)
    modulus = np.abs(wavelets.values)
    largest = modulus.max(axis=1, keepdims=True)
    if not largest.all():
        return ()
    about = np.maximum(np.median(modulus, axis=1, keepdims=True), FLOOR * largest)
    level = 20 * np.log10(np.maximum(modulus, FLOOR * largest) / about)
    mean = level.mean(axis=0)
    apart = max(1, math.ceil(float(wavelets.scale.max()) * record.fs))
    peaks, _ = find_peaks(mean, height=threshold, distance=apart)
    broad = [
        row for row in peaks if (level[:, max(0, row - apart) : row + apart + 1].max(axis=1) > FLAT * mean[row]).all()
    ]
    times = record.start + np.array([_centre(mean, int(row), apart // 2) for row in broad]) / record.fs
    groups = _grouped(times, within)
    return tuple(Spike(float(t), float(mean[r]), int(g)) for t, r, g in zip(times, broad, groups, strict=True))


def _centre(level: Array, row: int, reach: int) -> float:
    """Where the power about a peak has its centre, in samples."""
    rows = np.arange(max(0, row - reach), min(len(level), row + reach + 1))
    return float(np.average(rows, weights=10 ** (level[rows] / 10)))


def _grouped(times: Array, within: float | None) -> Rows:
    gaps = np.diff(times)
    if within is None:
        sizes = np.sort(np.log(gaps)) if len(gaps) else np.zeros(0)
        jump = int(np.diff(sizes).argmax()) if len(sizes) > 1 else -1
        two = jump >= 0 and sizes[jump + 1] - sizes[jump] > math.log(1.5)
        within = math.exp((sizes[jump] + sizes[jump + 1]) / 2) if two else 0.0
    return np.concatenate([[0], np.cumsum(gaps > within)])[: len(times)].astype(np.intp)


def _coarse(wavelets: xr.DataArray) -> tuple[Array, Array, Array]:
    """Modulus, times and frequencies of the map, at as many times as its shortest wavelet needs."""
    if "scale" not in getattr(wavelets, "coords", {}) or wavelets.ndim != 2 or wavelets.sizes["frequency"] < 3:
        raise RecordError(
            "an array without scales, or of fewer than three frequencies",
            "lines and peaks belong to a wavelet map",
            "pass what wavelet_map gave",
        )
    step = max(1, int(STEP * float(wavelets.scale.min()) * float(wavelets.attrs["fs"])))
    part: Any = wavelets[:, ::step]
    return np.abs(part.values).astype(float), part.time.values, part.frequency.values


def _near_ends(wavelets: xr.DataArray, times: Array) -> Mask:
    """Where in a map an end of the record is felt."""
    first, last = ends(wavelets)
    cone = wavelets.cone.values[:, None]
    return np.asarray((times < first + cone) | (times > last - cone))


def _chains(crest: Mask, level: Array) -> list[tuple[Rows, Rows]]:
    """Rows and columns of the ridges: neighbours joined, the strongest at each time, cut where that jumps."""
    from scipy.ndimage import label

    labels, _ = label(crest, structure=np.ones((3, 3)))
    rows, columns = np.nonzero(labels)
    names = labels[rows, columns]
    order = np.lexsort((-level[rows, columns], columns, names))
    rows, columns, names = rows[order], columns[order], names[order]
    first = (
        np.concatenate([[True], (np.diff(names) != 0) | (np.diff(columns) != 0)]) if len(rows) else np.zeros(0, bool)
    )
    rows, columns, names = rows[first], columns[first], names[first]
    broken = (np.diff(names) != 0) | (np.diff(columns) != 1) | (np.abs(np.diff(rows)) > 1)
    cuts = np.flatnonzero(broken) + 1
    return list(zip(np.split(rows, cuts), np.split(columns, cuts), strict=True))


def _refined(level: Array, rows: Rows, columns: Rows) -> tuple[Array, Array]:
    """Place and height of the parabola through the three values about each crest."""
    low, middle, high = (level[rows + side, columns] for side in (-1, 0, 1))
    bend = low - 2 * middle + high
    shift = np.where(bend < 0, 0.5 * (low - high) / np.where(bend < 0, bend, -1.0), 0.0)
    shift = np.clip(shift, -0.5, 0.5)
    return np.asarray(rows + shift, dtype=float), middle - 0.25 * (low - high) * shift


def stft_map(record: Record, channel: str, *, nperseg: int | None = None, window: str = "hann") -> xr.DataArray:
    """The short-time Fourier transform, for comparison: one window length for all frequencies.

    Parameters
    ----------
    record : Record
        At one rate.
    channel : str
        Which channel; its mean is taken off.
    nperseg : int, optional
        Samples of a window; the power of two next to a tenth of a second, or an eighth of the record.
    window : str
        As scipy.signal.get_window names it.

    Returns
    -------
    xarray.DataArray
        Complex, ``(frequency, time)``; the modulus of a tone is its amplitude.

    Raises
    ------
    RecordError
        A channel that is missing or not finite, a broken clock, a window longer than the record.

    Examples
    --------
    >>> import numpy as np
    >>> record = Record.of({"a": 0.3 * np.sin(2 * np.pi * 50 * np.arange(4000) / 1000)}, fs=1000)
    >>> magnitudes = abs(stft_map(record, "a", nperseg=200))
    >>> round(float(magnitudes.sel(frequency=50.0, time=2.0)), 3)
    0.3
    """
    from scipy.signal import ShortTimeFFT

    record.require_clean(channel, question="a short-time Fourier transform", samples=LEAST)
    count = len(record)
    if nperseg is None:
        nperseg = max(8, min(1 << round(math.log2(max(8, 0.1 * record.fs))), count // 8))
    if not 4 <= nperseg <= count:
        raise RecordError(
            f"nperseg = {nperseg} of {count} samples",
            "a window has 4 samples at least, and fits into the record",
            "choose it between",
        )
    hop = max(1, nperseg // 8)
    short = ShortTimeFFT.from_window(
        window, record.fs, nperseg, nperseg - hop, scale_to="magnitude", phase_shift=None, fft_mode="onesided2X"
    )
    mean = float(record[channel].mean())
    values = short.stft(record[channel] - mean)
    times = record.start + short.t(count)
    inside = (times >= record.start) & (times < record.start + record.duration)
    xarray = labelled_arrays("wavelet maps")
    result: xr.DataArray = xarray.DataArray(
        values[:, inside],
        dims=("frequency", "time"),
        coords={"frequency": ("frequency", short.f, {"units": "Hz"}), "time": ("time", times[inside], {"units": "s"})},
        attrs={
            "units": record.channels[channel].unit,
            "channel": channel,
            "fs": record.fs,
            "nperseg": nperseg,
            "window": window,
            "normalisation": "amplitude",
            "mean": mean,
        },
    )
    return result


@dataclass(frozen=True, eq=False, repr=False)
class Harmonics(Result):
    """The harmonics of a channel.

    Attributes
    ----------
    frequency : float
        Of the fundamental [Hz], as asked for.
    amplitudes : tuple of Estimate
        Of the fundamental and its multiples, in the channel's unit.
    """

    frequency: float
    amplitudes: tuple[Estimate, ...]

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The amplitudes."""
        return self.amplitudes

    def ratio(self, order: int) -> float:
        """How many times larger the fundamental is than the harmonic of this order."""
        return self.amplitudes[0].value / self.amplitudes[order - 1].value


def harmonics(record: Record, channel: str = "x", *, frequency: float, count: int = 5) -> Harmonics:
    r"""How large are the fundamental of a periodic channel and the multiples of it?

    Least squares of :math:`a_0 + \sum_k a_k\cos k\omega t + b_k\sin k\omega t`; the amplitudes are
    :math:`\sqrt{a_k^2 + b_k^2}` (thesis, section 3.5.1, where sliding counts as harmonic because the fundamental is
    100 times the second harmonic). The mean and a steady drift are taken off with it.

    Parameters
    ----------
    record : Record
        With the channel, over two cycles or more.
    channel : str
        Which one.
    frequency : float
        Of the fundamental [Hz].
    count : int
        How many, the fundamental among them.

    Returns
    -------
    Harmonics

    Raises
    ------
    EstimateError
        The record is shorter than two cycles, or does not hold the highest harmonic.

    Examples
    --------
    >>> t = np.arange(2000) / 500
    >>> swing = Record.of({"x": np.cos(2 * np.pi * 5 * t) + 0.01 * np.sin(2 * np.pi * 15 * t)}, fs=500)
    >>> round(harmonics(swing, frequency=5.0).ratio(3), 6)
    100.0
    """
    record.require_clean(channel, question="harmonics")
    cycles = record.duration * frequency
    if cycles < 2 or 2 * count * frequency >= record.fs:
        raise EstimateError(
            f"{cycles:.3g} cycles of {frequency:g} Hz at {record.fs:g} samples a second",
            f"{count} harmonics need two cycles, and more than {2 * count * frequency:g} samples a second",
            "give a longer record, or ask for fewer harmonics",
        )
    turned = 2 * math.pi * frequency * (record.time - record.time[0])
    waves = [wave(order * turned) for order in range(1, count + 1) for wave in (np.cos, np.sin)]
    line = least_squares(np.column_stack([*waves, np.ones(len(turned)), turned]), record[channel])
    unit = record.channels[channel].unit
    return Harmonics(frequency, tuple(_amplitude(line, order, unit) for order in range(count)))


def _amplitude(line: LeastSquares, order: int, unit: str) -> Estimate:
    """Of one harmonic, with the standard deviation along its own phase."""
    parts = slice(2 * order, 2 * order + 2)
    value = float(np.hypot(*line.coefficients[parts]))
    sd = float(np.hypot(*(line.coefficients[parts] * line.sd[parts]))) / value if value else float(line.sd[parts].max())
    name = "fundamental" if order == 0 else f"harmonic {order + 1}"
    quantile = student(float(line.freedom[parts].min()))
    return Estimate.normal(name, value, sd=sd, unit=unit, method="least squares", quantile=quantile).within(0.0)
