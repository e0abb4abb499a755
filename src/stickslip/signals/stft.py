"""The short-time Fourier transform, beside which wavelet maps can be held."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from stickslip.errors import RecordError
from stickslip.record.exchange import labelled_arrays
from stickslip.record.record import Record

if TYPE_CHECKING:
    import xarray as xr

LEAST = 16  # samples


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
    >>> found = abs(stft_map(record, "a", nperseg=200))
    >>> round(float(found.sel(frequency=50.0, time=2.0)), 3)
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
