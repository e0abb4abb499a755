"""Which frequencies does a channel hold, and when? Maps by the Morlet wavelet, their frequencies and labels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.arrays import Array
from stickslip.errors import ModelError, RecordError
from stickslip.record.metadata import labelled_arrays
from stickslip.record.record import Record, require_record
from stickslip.signals.morlet import REACH, normalised_gain, ridge_centre, transform

if TYPE_CHECKING:
    import xarray as xr


QUESTION = "a wavelet map"
CENTRE = 4.5  # the thesis's wavelet: e-folding after 0.7 of a cycle
LEAST = 16  # samples
HIGHEST = 0.25  # of the rate, for the default range: above, the wavelet's spectrum is cut at half the rate
LONGEST = 0.25  # of the record on either side may be near an end, at the lowest frequency of the default range
NORMALISATIONS = ("energy", "amplitude")
VOICES = 16
LARGEST = 4 << 30  # bytes of a map
BLOCK_BYTES = 256 << 20  # of a map of one block
COVERED = (1e-3, 0.4)  # of the highest sum of the Gaussians: frequencies below are not in the map, those above wholly


@dataclass(frozen=True)
class Grid:
    """The wavelet, and the frequencies it is asked for."""

    frequencies: Array
    centre: float
    normalisation: str
    corrected: bool

    @property
    def scales(self) -> Array:
        """Dilation [s] of each frequency."""
        centre = ridge_centre(self.centre, self.normalisation) if self.corrected else self.centre
        return np.asarray(centre / (2 * np.pi * self.frequencies))

    def transform(
        self, values: Array, fs: float, rows: slice = slice(None), precision: str = "double"
    ) -> NDArray[np.complexfloating]:
        """The wavelets of some samples, of all frequencies or some."""
        options: Any = {"centre": self.centre, "normalisation": self.normalisation, "precision": precision}
        return transform(values, fs, self.scales[rows], **options)


def grid_of(
    frequencies: ArrayLike | None,
    voices: int,
    centre: float,
    normalisation: str,
    corrected: bool,
    fs: float,
    duration: float,
) -> Grid:
    """The frequencies asked for, checked against the rate and the length of the record."""
    check_centre(centre)
    if normalisation not in NORMALISATIONS:
        raise RecordError(f"normalisation = '{normalisation}'", f"there are {', '.join(NORMALISATIONS)}", "choose one")
    if isinstance(voices, bool) or not isinstance(voices, (int, np.integer)) or not 1 <= voices <= 512:
        raise RecordError(f"voices = {voices}", "an octave has 1 to 512 frequencies, a whole number", "choose one")
    ridge = ridge_centre(centre, normalisation) if corrected else centre
    lowest = ridge * math.sqrt(2) / (2 * math.pi * duration)  # where the cones of both ends meet at half of it
    if frequencies is None:
        wanted = np.array([lowest / LONGEST, HIGHEST * fs])
    else:
        wanted = np.atleast_1d(np.asarray(frequencies, dtype=float))
    _require_frequencies(wanted, lowest, fs, duration)
    if len(wanted) == 2:
        count = max(2, round(voices * math.log2(wanted[1] / wanted[0])) + 1)
        wanted = np.geomspace(wanted[0], wanted[1], count)
    return Grid(wanted, float(centre), normalisation, corrected)


def _require_frequencies(wanted: Array, lowest: float, fs: float, duration: float) -> None:
    """Refuse frequencies of which the record holds nothing; both its ends are felt at twice `lowest`."""
    if (
        wanted.ndim != 1
        or not wanted.size
        or not np.isfinite(wanted).all()
        or (wanted <= 0).any()
        or (np.diff(wanted) <= 0).any()
    ):
        raise ModelError(
            f"frequencies = {np.array2string(wanted, threshold=6, precision=4)}",
            "they are positive and rise",
            "give the lowest and the highest in Hz",
        )
    if wanted[-1] > fs / 2:
        raise RecordError(
            f"a frequency of {wanted[-1]:.6g} Hz at a rate of {fs:g} Hz",
            f"nothing is known above half the rate, {fs / 2:g} Hz",
            "ask for lower frequencies",
        )
    if wanted[0] < 2 * lowest:
        raise RecordError(
            f"a wavelet of {wanted[0]:.4g} Hz feels an end of the record, {duration:.4g} s long, wherever it stands",
            f"the lowest frequency that it allows is {2 * lowest:.4g} Hz",
            "give a longer record or ask for higher frequencies",
        )


def check_centre(centre: float) -> None:
    if not 3 <= centre <= 100:
        raise RecordError(
            f"wavelet_frequency = {centre}",
            "it is 3 to 100: below, a wavelet sees the mean; above, it is longer than what it is to tell apart",
            "leave it at 4.5",
        )


def labelled(
    values: NDArray[np.complexfloating], time: Array, grid: Grid, record: Record, channel: str, mean: float
) -> xr.DataArray:
    xarray = labelled_arrays("wavelet maps")
    scales = grid.scales
    along = {
        "frequency": ("frequency", grid.frequencies, {"units": "Hz"}),
        "time": ("time", time, {"units": "s"}),
        "scale": ("frequency", scales, {"units": "s"}),
        "bandwidth": ("frequency", math.sqrt(math.log(2)) / (math.pi * scales), {"units": "Hz"}),
        "cone": ("frequency", math.sqrt(2) * scales, {"units": "s"}),
    }
    result: xr.DataArray = xarray.DataArray(
        values,
        dims=("frequency", "time"),
        coords=along,
        name=f"wavelets of {channel}",
        attrs=attributes_of(grid, record, channel, mean),
    )
    return result


def attributes_of(grid: Grid, record: Record, channel: str, mean: float) -> dict[str, Any]:
    unit = record.channels[channel].unit
    return {
        "units": unit if grid.normalisation == "amplitude" else f"{unit} s^0.5",
        "channel": channel,
        "wavelet": "Morlet",
        "wavelet_frequency": grid.centre,
        "normalisation": grid.normalisation,
        "corrected": grid.corrected,
        "mean": mean,
        "fs": record.fs,
        "start": record.start,
        "end": record.start + (len(record) - 1) / record.fs,
        "history": [str(step) for step in record.history],
    }


def wavelet_map(
    record: Record,
    channel: str,
    *,
    frequencies: ArrayLike | None = None,
    voices: int = VOICES,
    wavelet_frequency: float = CENTRE,
    normalisation: str = "energy",
    corrected: bool = True,
    precision: str = "double",
) -> xr.DataArray:
    """Which frequencies does a channel hold, and when?

    The continuous wavelet transform ``W(a, b) = a^(-1/2) integral x(t) h*((t - b) / a) dt`` (thesis 5.1, 5.2) with the
    Morlet wavelet ``h(t) = pi^(-1/4) exp(i w t - t^2 / 2)`` (thesis 5.3 without its second term, and with the phase
    running forwards: the thesis's values are the complex conjugates). The mean is taken off first; before and after
    the record the signal is zero, and what that spoils lies within the cone of influence, see
    :func:`cone_of_influence`.

    With ``normalisation="energy"`` as above, a tone of amplitude A has the modulus ``A sqrt(a) pi^(-1/4) sqrt(pi / 2)``
    and the modulus over ``a`` is largest at ``a = (w + sqrt(w^2 + 2)) / (2 w0)``, not at ``w / w0``: read by ``w / a``
    a tone appears 2.4 % low at w = 4.5. So scales are chosen for a tone to read its own frequency
    (``corrected=False``: ``f = w / (2 pi a)``, as in the thesis). With ``normalisation="amplitude"`` the factor
    ``a^(-1/2)`` is ``sqrt(2 / pi) pi^(1/4) / a`` instead: the modulus of a tone is its amplitude, largest at w / w0.

    Parameters
    ----------
    record : Record
        At one rate.
    channel : str
        Which channel.
    frequencies : array_like, optional
        Lowest and highest [Hz], with `voices` between; or three and more, taken as they are. From where the ends of
        the record spoil half of it, to a quarter of the sampling rate, when not given.
    voices : int
        Frequencies per octave.
    wavelet_frequency : float
        The wavelet's angular frequency w: how many oscillations it holds. A higher one resolves frequencies better
        and times worse.
    normalisation : {"energy", "amplitude"}
        What a modulus means.
    corrected : bool
        Whether a tone reads its own frequency.
    precision : {"double", "single"}
        Right to 1e-10 of a row's largest value, or 1e-5 in half of the memory and a quarter of the time.

    Returns
    -------
    xarray.DataArray
        Complex, ``(frequency, time)``, frequencies rising, with the coordinates ``scale`` [s], ``bandwidth`` [Hz] (at
        half power) and ``cone`` [s] (how far from either end the end is felt: ``sqrt(2) a``) along the frequencies,
        and the settings in ``.attrs``.

    Raises
    ------
    RecordError
        A channel that is missing or not finite, a broken clock, frequencies above half the rate or too low for the
        record's length, a map that would not fit into memory.
    ModelError
        Frequencies that are not positive, or do not rise.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> record = Record.of({"a": 0.3 * np.sin(2 * np.pi * 47 * t)}, fs=1000)
    >>> magnitudes = abs(wavelet_map(record, "a", frequencies=(20, 100), voices=64, normalisation="amplitude"))
    >>> ridge = magnitudes.sel(time=2.0, method="nearest")
    >>> round(float(ridge.idxmax()), 0), round(float(ridge.max()), 3)
    (47.0, 0.3)
    """
    require_record(record)
    record.require_clean(channel, question=QUESTION, samples=LEAST)
    grid = grid_of(frequencies, voices, wavelet_frequency, normalisation, corrected, record.fs, record.duration)
    if precision not in REACH:
        raise RecordError(f"precision = '{precision}'", f"there are {', '.join(REACH)}", "choose one of them")
    size = (16 if precision == "double" else 8) * len(record) * len(grid.frequencies)
    if size > LARGEST:
        raise RecordError(
            f"{len(grid.frequencies)} frequencies of {len(record)} samples take {size / 2**30:.3g} GiB",
            f"a map in memory has {LARGEST >> 30} GiB at most",
            "cut the record, ask for fewer voices, or go through it with wavelet_blocks or wavelet_overview",
        )
    mean = float(record[channel].mean())
    values = grid.transform(record[channel] - mean, record.fs, precision=precision)
    return labelled(values, record.time, grid, record, channel, mean)


def wavelet_blocks(
    source: Record | Iterable[Record],
    channel: str,
    *,
    frequencies: ArrayLike | None = None,
    voices: int = VOICES,
    wavelet_frequency: float = CENTRE,
    normalisation: str = "energy",
    corrected: bool = True,
    size: int | None = None,
) -> Iterator[xr.DataArray]:
    """The map of a record longer than memory, block by block.

    Each block is computed with as much of its neighbours as the longest wavelet reaches, so that together the blocks
    equal the map of the whole to 1e-9. The mean that is taken off is that of the record, or of the first block of
    several.

    Parameters
    ----------
    source : Record or iterable of Record
        A record, or its parts in order, as :func:`read_blocks` yields them.
    channel, frequencies, voices, wavelet_frequency, normalisation, corrected
        As in :func:`wavelet_map`; without `frequencies`, the range follows from the first part.
    size : int, optional
        Samples of each block; such that a block's map takes 256 MiB, or an eighth of what the longest wavelet
        reaches, when not given.

    Returns
    -------
    iterator of xarray.DataArray
        In order, without overlap.

    Raises
    ------
    RecordError
        As :func:`wavelet_map`, or parts that do not follow each other at one rate.

    Examples
    --------
    >>> record = Record.of({"a": np.sin(0.3 * np.arange(5000))}, fs=1000)
    >>> parts = wavelet_blocks(record, "a", frequencies=(20, 100), voices=4, size=2000)
    >>> [part.sizes["time"] for part in parts]
    [2000, 2000, 1000]
    """
    parts = iter([source] if isinstance(source, Record) else source)
    first = next(parts, None)
    if first is None:
        raise RecordError("no block at all", f"{QUESTION} needs one at least", "check the file")
    first.require_clean(channel, question=QUESTION, samples=LEAST)
    grid = grid_of(frequencies, voices, wavelet_frequency, normalisation, corrected, first.fs, first.duration)
    mean = float(first[channel].mean())
    margin = math.ceil(REACH["double"] * float(grid.scales.max()) * first.fs)
    if size is None:
        size = max(BLOCK_BYTES // (16 * len(grid.frequencies)), margin // 8, LEAST)
    if size < 1:
        raise RecordError(f"size = {size} samples", "a block has at least one sample", "pass a larger size=")
    begin = 0  # row of the next block's first sample, in the whole
    for kept, offset, last in _windows(first, parts, channel, size, margin):
        rows = size if not last else len(kept) - (begin - offset)
        wanted = _inner(kept - mean, begin - offset, rows, first.fs, grid)
        yield labelled(wanted, first.start + (begin + np.arange(rows)) / first.fs, grid, first, channel, mean)
        begin += rows


def wavelet_overview(
    source: Record | Iterable[Record],
    channel: str,
    *,
    frequencies: ArrayLike | None = None,
    voices: int = VOICES,
    wavelet_frequency: float = CENTRE,
    normalisation: str = "energy",
    corrected: bool = True,
    columns: int = 1200,
) -> xr.DataArray:
    """The largest moduli of each stretch of time: a map as wide as a figure, of a record of any length.

    Parameters
    ----------
    source : Record or iterable of Record
        A record, or its parts in order, as :func:`read_blocks` yields them.
    channel, frequencies, voices, wavelet_frequency, normalisation, corrected
        As in :func:`wavelet_blocks`.
    columns : int
        Stretches of time at most; half as many at least.

    Returns
    -------
    xarray.DataArray
        Real, ``(frequency, time)``; ``time`` is the middle of each stretch. The largest ``abs`` of the map within it.

    Raises
    ------
    RecordError
        As :func:`wavelet_blocks`.

    Examples
    --------
    >>> record = Record.of({"a": np.sin(0.3 * np.arange(5000))}, fs=1000)
    >>> wavelet_overview(record, "a", frequencies=(20, 100), voices=4, columns=100).sizes["time"]
    79
    """
    if columns < 2:
        raise RecordError(f"columns = {columns}", "an overview has two columns at least", "ask for more")
    options: dict[str, Any] = {"voices": voices, "wavelet_frequency": wavelet_frequency, "normalisation": normalisation}
    blocks = wavelet_blocks(source, channel, frequencies=frequencies, corrected=corrected, **options)
    first = last = next(blocks)
    width = 1 << max(0, math.ceil(math.log2(max(1, first.sizes["time"] / columns))))  # samples of a column
    shown = rest = np.empty((first.sizes["frequency"], 0))
    for last in itertools.chain([first], blocks):
        more, rest = _largest(np.hstack([rest, np.abs(last.values)]), width)
        shown = np.hstack([shown, more])
        while shown.shape[1] > columns:
            shown, odd = _largest(shown, 2)
            rest, width = np.hstack([np.repeat(odd, width, axis=1), rest]), 2 * width
    if rest.shape[1]:
        shown = np.hstack([shown, rest.max(axis=1, keepdims=True)])
    times = first.time.values[0] + (np.arange(shown.shape[1]) + 0.5) * width / first.attrs["fs"]
    overview = last.isel(time=np.zeros(shown.shape[1], dtype=int)).assign_coords(time=("time", times, {"units": "s"}))
    result: xr.DataArray = overview.copy(data=shown)
    return result.assign_attrs(start=float(first.time.values[0]), end=float(last.time.values[-1]))


def _largest(values: Array, width: int) -> tuple[Array, Array]:
    """Largest of each `width` columns; the columns that are left over."""
    whole = values.shape[1] // width * width
    return values[:, :whole].reshape(len(values), -1, width).max(axis=2), values[:, whole:]


def dyadic_map(record: Record, channel: str, *, wavelet_frequency: float = CENTRE) -> xr.DataArray:
    """The transform on the thesis's own grid: one scale an octave, each at steps of its own length.

    ``WT(m, n) = a0^(-m/2) integral h*(a0^(-m) t - n b0) x(t) dt`` (thesis 5.5 to 5.7) with a0 = 2 and b0 = 1, in units
    of the sampling interval; frequencies are ``w / (2 pi a)``, not corrected. On it, a frequency is told to an octave
    at best.

    Parameters
    ----------
    record : Record
        At one rate.
    channel : str
        Which channel.
    wavelet_frequency : float
        The wavelet's angular frequency.

    Returns
    -------
    xarray.DataArray
        Complex, along ``point``, with the coordinates ``frequency``, ``time``, ``scale``, ``m``, ``n``.

    Raises
    ------
    RecordError
        As :func:`wavelet_map`.

    Examples
    --------
    >>> record = Record.of({"a": np.sin(0.3 * np.arange(1024))}, fs=1000)
    >>> points = dyadic_map(record, "a")
    >>> sorted(set(points.m.values.tolist()))
    [1, 2, 3, 4, 5, 6, 7, 8]
    """
    record.require_clean(channel, question=QUESTION, samples=LEAST)
    check_centre(wavelet_frequency)
    deepest = int(math.log2(len(record) / (2 * math.sqrt(2)))) if len(record) > 2 * math.sqrt(2) else 0
    levels = [m for m in range(deepest + 1) if wavelet_frequency / (2 * math.pi * 2**m) < 0.5]
    scales = np.array([2.0**m for m in levels]) / record.fs
    mean = float(record[channel].mean())
    values = transform(record[channel] - mean, record.fs, scales, centre=wavelet_frequency, normalisation="energy")
    picked = [row[:: 2**m] for m, row in zip(levels, values, strict=True)]
    counts = [len(row) for row in picked]
    grid = Grid(wavelet_frequency / (2 * np.pi * scales), wavelet_frequency, "energy", corrected=False)
    places = np.concatenate([np.arange(count) for count in counts])
    scale = np.repeat(scales, counts)
    along = {
        "frequency": ("point", np.repeat(grid.frequencies, counts), {"units": "Hz"}),
        "time": ("point", record.start + places * scale, {"units": "s"}),
        "scale": ("point", scale, {"units": "s"}),
        "m": ("point", np.repeat(levels, counts)),
        "n": ("point", places),
    }
    xarray = labelled_arrays("wavelet maps")
    attributes = attributes_of(grid, record, channel, mean)
    result: xr.DataArray = xarray.DataArray(np.concatenate(picked), dims="point", coords=along, attrs=attributes)
    return result


def cone_of_influence(wavelets: xr.DataArray) -> xr.DataArray:
    """Where a map feels the ends of its record.

    Parameters
    ----------
    wavelets : xarray.DataArray
        What :func:`wavelet_map` or :func:`wavelet_overview` returned.

    Returns
    -------
    xarray.DataArray
        True where an end is nearer than ``sqrt(2) a``: there a jump at the end has fallen to 1/e (Torrence and Compo
        1998).

    Raises
    ------
    RecordError
        Something that is no wavelet map.

    Examples
    --------
    >>> record = Record.of({"a": np.sin(0.3 * np.arange(1000))}, fs=1000)
    >>> cone = cone_of_influence(wavelet_map(record, "a", frequencies=(20, 100), voices=4))
    >>> [int(cone.sel(frequency=f, method="nearest").sum()) for f in (20, 100)]
    [104, 22]
    """
    if "cone" not in getattr(wavelets, "coords", {}):
        raise RecordError("an array without a cone", "the cone belongs to a wavelet map", "pass what wavelet_map gave")
    first, last = ends(wavelets)
    time = wavelets.time
    result: xr.DataArray = (time - first < wavelets.cone) | (last - time < wavelets.cone)
    return result.transpose("frequency", "time")


def ends(wavelets: xr.DataArray) -> tuple[float, float]:
    """Times [s] of the first and the last sample of the record behind a map."""
    return float(wavelets.attrs["start"]), float(wavelets.attrs["end"])


def inverse_wavelet(wavelets: xr.DataArray) -> Array:
    """The signal that a wavelet map came from.

    Every row of the map is the signal's spectrum times a Gaussian. The rows' real parts, summed at each time with the
    steps between the logarithms of their scales (Morlet's formula: Delprat et al. 1992, IEEE Trans. Inf. Theory 38,
    644), are the signal filtered by the sum of the Gaussians, which is flat but at the ends of the map's range; the
    spectrum is divided by it. So each instant comes from the map near it, and an end of the record is felt there alone.

    Parameters
    ----------
    wavelets : xarray.DataArray
        What :func:`wavelet_map` returned, whole.

    Returns
    -------
    ndarray, shape (n,)
        The channel, as far as the map's frequencies cover it, with the mean that was taken off: right to 1e-10 for a
        signal in their range that fades at both ends; of another, the ends are off, and the rest by what the step at
        an end has outside the range (a tone: 1e-4 ten cones away).

    Raises
    ------
    RecordError
        Something that is no complex wavelet map.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> burst = np.exp(-(((t - 2) / 0.2) ** 2)) * np.cos(2 * np.pi * 50 * t)
    >>> inverse = inverse_wavelet(wavelet_map(Record.of({"a": burst}, fs=1000), "a", frequencies=(10, 200)))
    >>> bool(np.abs(inverse - burst).max() < 1e-10)
    True
    """
    from scipy.fft import irfft, rfft

    if "scale" not in getattr(wavelets, "coords", {}) or wavelets.ndim != 2 or not np.iscomplexobj(wavelets.values):
        raise RecordError(
            "an array without phases or scales",
            "a signal comes back from a complex wavelet map",
            "pass what wavelet_map gave",
        )
    count, fs = wavelets.sizes["time"], float(wavelets.attrs["fs"])
    size = 2 * count
    turn = 2 * np.pi * np.fft.rfftfreq(size, 1 / fs)
    centre, normalisation = float(wavelets.attrs["wavelet_frequency"]), str(wavelets.attrs["normalisation"])
    scales = wavelets.scale.values
    steps = np.abs(np.gradient(np.log(scales))) if len(scales) > 1 else np.ones(1)
    total, cover = np.zeros(count), np.zeros(len(turn))
    for scale, step, row in zip(scales, steps, wavelets.values, strict=True):
        total += 2 * step / normalised_gain(float(scale), normalisation) * row.real
        # a real part has both sides of the spectrum
        cover += step * (np.exp(-0.5 * (scale * turn - centre) ** 2) + np.exp(-0.5 * (scale * turn + centre) ** 2))
    share = cover / cover.max()
    weight = _smooth_step((share - COVERED[0]) / (COVERED[1] - COVERED[0]))
    restored = np.divide(weight, cover, out=np.zeros_like(cover), where=weight > 0)
    return np.asarray(irfft(restored * rfft(total, size), size)[:count] + float(wavelets.attrs["mean"]))


def _smooth_step(values: Array) -> Array:
    """From 0 to 1 where the values do so, with two derivatives that are nowhere broken: no ringing far away."""
    inside = np.clip(values, 0.0, 1.0)
    return np.asarray(inside**3 * (10 - 15 * inside + 6 * inside**2))


def _inner(values: Array, begin: int, count: int, fs: float, grid: Grid) -> NDArray[np.complexfloating]:
    """The map of some samples amid others: a few rows at once, each with as much around as its wavelet reaches."""
    products = np.empty((len(grid.scales), count), dtype=complex)
    row = 0
    while row < len(products):
        reach = math.ceil(REACH["double"] * float(grid.scales[row]) * fs)  # the later ones reach less far
        low, high = max(0, begin - reach), min(len(values), begin + count + reach)
        some = slice(row, row + max(1, BLOCK_BYTES // 2 // (16 * (high - low))))
        around = grid.transform(values[low:high], fs, some)
        products[some] = around[:, begin - low : begin - low + count]
        row = some.stop
    return products


def _windows(
    first: Record, rest: Iterable[Record], channel: str, size: int, margin: int
) -> Iterator[tuple[Array, int, bool]]:
    """A block and what the wavelets reach of its neighbours; their first row; whether it is the last."""
    kept, offset, begin = first[channel], 0, 0
    seen = len(first)
    sources: Sequence[Record] | Iterator[Record] = iter(rest)
    done = False
    while True:
        while not done and offset + len(kept) < begin + size + margin:
            part = next(iter(sources), None)
            if part is None:
                done = True
                break
            part.require_clean(channel, question=QUESTION)
            if part.fs != first.fs or abs(part.start - first.start - seen / first.fs) > 0.5 / first.fs:
                raise RecordError(
                    f"a block from {part.start:g} s at {part.fs:g} Hz",
                    f"it follows the one before, at {first.start + seen / first.fs:g} s and {first.fs:g} Hz",
                    "give the blocks of one record in order",
                )
            seen += len(part)
            kept = np.concatenate([kept, part[channel]])
        end = offset + len(kept)
        last = done and end <= begin + size
        yield kept[: begin + size + margin - offset], offset, last
        if last:
            return
        begin += size
        drop = max(0, begin - margin - offset)
        kept, offset = kept[drop:], offset + drop
