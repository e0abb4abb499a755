"""From time stamps to a sampling rate: uniform within their own rounding, or kept as they are."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import RecordError

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-3  # of a sampling interval: such a timing error moves a sine at fs/10 by less than 1e-3 of itself
COARSEST_SNAP = 2e-3  # a rate is taken as round only where the stamps fix it this well


@dataclass(frozen=True)
class Clock:
    """A sampling rate, the first sample's time and, where they are not uniform, the stamps.

    Attributes
    ----------
    fs : float
        [Hz]
    start : float
        [s]
    stamps : ndarray or None
        [s]
    wander : float
        How far uniform time lies from the stamps at most [s], where that is more than their rounding.
    """

    fs: float
    start: float
    stamps: Array | None = None
    wander: float = 0.0


def resolution(stamps: Array) -> float:
    """The step to which stamps are rounded: a power of ten where they are decimals, else that of their floats."""
    largest = float(np.max(np.abs(stamps), initial=0.0))
    floor = 4 * np.finfo(float).eps * max(largest, np.finfo(float).tiny)
    for digits in range(10):
        scaled = stamps * 10.0**digits
        if np.max(np.abs(scaled - np.rint(scaled)), initial=0.0) <= floor * 10.0**digits:
            return float(10.0**-digits)
    single = stamps.astype(np.float32)
    return float(np.spacing(np.float32(largest))) if np.array_equal(single.astype(float), stamps) else floor


def fit_clock(raw: Array, scale: float = 1.0, fs: float | None = None) -> Clock:
    """The clock behind time stamps.

    A line is fitted by least squares, t_n = start + n/fs. The clock is uniform where no stamp lies further from the
    line than the stamps' own rounding, or where every step between stamps is within that rounding and no stamp lies
    half a sample off (a clock that wanders). The rate is then the roundest number inside its uncertainty: stamps
    0.00667 s apart, of five decimals, come from 150 Hz. Otherwise the stamps are kept, with the median rate.

    Parameters
    ----------
    raw : ndarray, shape (n,)
        Stamps in the file's unit.
    scale : float
        Seconds per unit.
    fs : float, optional
        A rate [Hz] known already, from earlier rows of the same file; kept where the stamps agree with it.

    Raises
    ------
    RecordError
        Fewer than two stamps that are numbers, or stamps that do not advance.
    """
    finite = raw[np.isfinite(raw)]
    whole = len(finite) == len(raw) > 0
    quantum = resolution(finite)
    if fs is not None and whole:
        step = 1 / fs / scale
        wander = _departure(raw, raw[0] + np.arange(len(raw)) * step, step, quantum)
        if wander is not None:
            return Clock(fs, float(raw[0] * scale), None, wander * scale)
    span = float(finite[-1] - finite[0]) if len(finite) else 0.0
    gaps = np.diff(finite)
    if not np.any(gaps > 0) or not math.isfinite(span * scale):
        raise RecordError(
            f"the time column has {len(finite)} numbers and does not advance",
            "a clock needs at least two time stamps that increase",
            "pass fs= in Hz, or name another column in time=",
        )
    n = np.arange(len(finite)) - (len(finite) - 1) / 2
    mean = float(np.mean(finite))
    step = float(np.dot(n, finite - mean) / np.dot(n, n))
    departure = (
        _departure(finite, np.asarray(mean + step * n, dtype=np.float64), step, quantum) if whole and step > 0 else None
    )
    if departure is not None:
        accumulated = np.ptp(gaps) < 0.01 * quantum  # a rounded step, added up: it hides the rate's own decimals
        slack = quantum if accumulated else (quantum + 4 * departure) / (len(finite) - 1)
        return Clock(roundest(step * scale, slack * scale), float(finite[0] * scale), None, departure * scale)
    typical = float(np.median(gaps))
    if typical <= 0:  # constant for many rows, then a jump: the median says nothing
        typical = abs(span) / (len(finite) - 1) or float(np.mean(gaps[gaps > 0]))
    return Clock(roundest(typical * scale, 0.0), float(finite[0] * scale), raw * scale)


def _departure(stamps: Array, line: Array, step: float, quantum: float) -> float | None:
    """How far the stamps lie from uniform at most, 0 within their rounding; None where they are not uniform."""
    if _has_odd_gap(np.diff(stamps)):
        return None
    furthest = float(np.max(np.abs(stamps - line)))
    rounding = max(1.01 * quantum, NEGLIGIBLE * step)
    if furthest <= rounding and np.all(np.abs(np.diff(stamps) - step) <= rounding):
        return 0.0
    steady = np.all(np.abs(np.diff(stamps) - step) <= 1.2 * quantum)
    return furthest if steady and furthest <= step / 2 else None


def _has_odd_gap(gaps: Array) -> bool:
    """Whether some step stands out that rounding does not explain (which repeats at equal distances)."""
    typical = float(np.median(gaps)) if len(gaps) else 0.0
    odd = np.flatnonzero(np.abs(gaps - typical) > 0.45 * typical)
    if typical <= 0 or not len(odd) or len(odd) > len(gaps) / 20:
        return False
    apart = np.diff(odd)
    return len(odd) < 3 or bool(np.ptp(apart) > 2 + 0.1 * np.mean(apart))


def roundest(step: float, slack: float) -> float:
    """The rate of fewest digits whose step lies within `slack` of the one measured."""
    fs = 1.0 / step
    if not math.isfinite(fs) or fs <= 0:
        raise RecordError(
            f"time stamps {step:g} s apart", "a sampling rate is a finite number", "check the time column's unit"
        )
    slack = max(slack, 1e-9 * step) if slack <= COARSEST_SNAP * step else 1e-9 * step
    for digits in range(1, 8):
        candidate = float(f"{fs:.{digits - 1}e}")
        if abs(1.0 / candidate - step) <= slack:
            return candidate
        period = float(f"{step:.{digits - 1}e}")
        if abs(period - step) <= 1e-9 * step:  # the step is the rounder number of the two
            return 1.0 / period
    return fs
