"""From time stamps to a sampling rate: uniform within their own rounding, or kept as they are."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import RecordError

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-3  # of a sampling interval: such a timing error moves a sine at fs/10 by less than 1e-3 of itself
COARSEST_SNAP = 1e-3  # a rate is taken as round only where the stamps fix it this well


@dataclass(frozen=True)
class Clock:
    """A sampling rate [Hz], the first sample's time [s] and, where they are not uniform, the stamps [s]."""

    fs: float
    start: float
    stamps: Array | None = None


def resolution(stamps: Array) -> float:
    """The step to which stamps are rounded: a power of ten where they are decimals, else that of their floats."""
    largest = float(np.max(np.abs(stamps), initial=0.0))
    floor = 4 * np.finfo(float).eps * max(largest, np.finfo(float).tiny)
    for digits in range(10):
        scaled = stamps * 10.0**digits
        if np.max(np.abs(scaled - np.rint(scaled))) <= floor * 10.0**digits:
            return float(10.0**-digits)
    single = stamps.astype(np.float32)
    return float(np.spacing(np.float32(largest))) if np.array_equal(single.astype(float), stamps) else floor


def fit_clock(raw: Array, scale: float = 1.0) -> Clock:
    """The clock behind time stamps.

    A line is fitted by least squares, t_n = start + n/fs; where no stamp lies further from it than the stamps' own
    rounding (or a thousandth of a sampling interval) the clock is uniform. The rate is then the roundest number
    inside its uncertainty: stamps 0.00667 s apart, of five decimals, come from 150 Hz. Otherwise the stamps
    are kept, with the median rate.

    Parameters
    ----------
    raw : ndarray, shape (n,)
        Stamps in the file's unit.
    scale : float
        Seconds per unit.

    Raises
    ------
    RecordError
        Fewer than two stamps that are numbers, or stamps that do not advance.
    """
    finite = raw[np.isfinite(raw)]
    span = float(finite[-1] - finite[0]) if len(finite) else 0.0
    if len(finite) < 2 or not np.any(np.diff(finite) > 0) or not math.isfinite(span * scale):
        raise RecordError(
            f"the time column has {len(finite)} numbers and does not advance",
            "a clock needs at least two time stamps that increase",
            "pass fs= in Hz, or name another column in time=",
        )
    quantum = resolution(finite)
    n = np.arange(len(finite)) - (len(finite) - 1) / 2
    mean = float(np.mean(finite))
    step = float(np.dot(n, finite - mean) / np.dot(n, n))
    residual = np.max(np.abs(finite - mean - step * n))
    if len(finite) == len(raw) and step > 0 and residual <= max(1.01 * quantum, NEGLIGIBLE * step):
        gaps = np.diff(finite)
        accumulated = np.ptp(gaps) < 0.01 * quantum  # a rounded step, added up: it hides the rate's own decimals
        slack = quantum / 2 if accumulated else quantum / (len(finite) - 1)
        return Clock(_roundest(step * scale, slack * scale), float(finite[0] * scale))
    gaps = np.diff(finite)
    typical = float(np.median(gaps))
    if typical <= 0:  # constant for many rows, then a jump: the median says nothing
        typical = abs(span) / (len(finite) - 1) or float(np.mean(gaps[gaps > 0]))
    return Clock(_roundest(typical * scale, 0.0), float(finite[0] * scale), raw * scale)


def _roundest(step: float, slack: float) -> float:
    """The rate of fewest digits whose step lies within `slack` of the one measured."""
    fs = 1.0 / step
    if not math.isfinite(fs) or fs <= 0:
        raise RecordError(
            f"time stamps {step:g} s apart", "a sampling rate is a finite number", "check the time column's unit"
        )
    slack = min(max(slack, 1e-9 * step), COARSEST_SNAP * step)
    for digits in range(1, 8):
        candidate = float(f"{fs:.{digits - 1}e}")
        if abs(1.0 / candidate - step) <= slack:
            return candidate
    return fs
