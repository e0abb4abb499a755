"""The frequencies that a wavelet map is asked for, and the labels of a map."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import RecordError
from stickslip.record.metadata import labelled_arrays
from stickslip.record.record import Record
from stickslip.signals.morlet import ridge_centre, transform

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

QUESTION = "a wavelet map"
CENTRE = 4.5  # the thesis's wavelet: e-folding after 0.7 of a cycle
LEAST = 16  # samples
HIGHEST = 0.25  # of the rate, for the default range: above, the wavelet's spectrum is cut at half the rate
LONGEST = 0.25  # of the record on either side may be near an end, at the lowest frequency of the default range
NORMALISATIONS = ("energy", "amplitude")


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
        raise RecordError(
            f"frequencies = {_shortly(wanted)}", "they are positive and rise", "give the lowest and the highest in Hz"
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


def _shortly(values: Array) -> str:
    return np.array2string(values, threshold=6, precision=4)


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
