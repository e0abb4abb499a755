"""From time stamps to a sampling rate: uniform within their own rounding, or kept, and what is wrong with them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array, Mask, Rows
from stickslip.errors import RecordError
from stickslip.statistics import least_squares, student

NEGLIGIBLE = 1e-3  # of a sampling interval: such a timing error moves a sine at fs/10 by less than 1e-3 of itself
COARSEST_SNAP = 2e-3  # a rate is taken as round only where the stamps fix it this well
GAP = 1.9  # an interval this many times the usual one lost a sample; slower loops of a host stay below
TOLERANCE = 0.02  # relative deviation of an interval that no analysis of friction would notice
BRIDGED = 6  # sampling intervals over which samples are interpolated by their stamps
SIGNIFICANT = range(4, 10)  # digits of a stamp that programs write
STEADY = 10  # gaps this close together are no accident


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
    """The step to which stamps are rounded: a power of ten where they are decimals, else that of their floats.

    Stamps of as many significant digits each, as "%g" writes them, are rounded the more the larger they are: told is
    the step of the largest.
    """
    largest = float(np.max(np.abs(stamps), initial=0.0))
    floor = 4 * np.finfo(float).eps * max(largest, np.finfo(float).tiny)
    some = stamps[stamps != 0]
    places = np.floor(np.log10(np.abs(some)))
    steps = []
    for digits in range(10):
        scaled = stamps * 10.0**digits
        if np.max(np.abs(scaled - np.rint(scaled)), initial=0.0) <= floor * 10.0**digits:
            steps.append(10.0**-digits)
            break
    for digits in SIGNIFICANT if len(some) and math.isfinite(largest) else ():
        scaled = some * 10.0 ** (digits - 1 - places)
        if np.max(np.abs(scaled - np.rint(scaled))) <= 4 * np.finfo(float).eps * 10.0**digits:
            steps.append(10.0 ** (places.max() - digits + 1))
            break
    if steps:  # the first thousandths of a second have all the decimals of seven digits
        return float(max(steps))
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


# ---- stamps that are kept


def is_uniform(stamps: Array) -> bool:
    """Whether stamps [s] follow one rate, so that a record need not keep them: the rule of :func:`fit_clock`."""
    known = stamps[np.isfinite(stamps)]
    return bool(np.any(np.diff(known) > 0)) and fit_clock(stamps).stamps is None


@dataclass(frozen=True)
class Stamps:
    """What time stamps say about the clock that wrote them.

    Attributes
    ----------
    step : float
        Usual interval between samples [s].
    resolution : float
        Step to which the stamps are rounded [s].
    held : bool
        Whether a host stamped blocks of samples as they arrived: stamps stand still, or crowd, and then jump.
    repeated, backward, gaps, slower, uneven : ndarray of int
        First row of each pair whose stamps are equal, go back, lie `GAP` steps or more apart, do so again and again, or
        are unevenly spaced.
    missing : ndarray of int
        Rows whose stamp is not a number.
    """

    step: float
    resolution: float
    held: bool
    repeated: Rows
    backward: Rows
    gaps: Rows
    slower: Rows
    uneven: Rows
    missing: Rows

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong with the stamps."""
        flaws = (self.repeated, self.backward, self.gaps, self.slower, self.uneven, self.missing)
        return not (self.held or any(map(len, flaws)))


def inspect(stamps: Array) -> Stamps:
    """Find what is wrong with time stamps [s], shape (n,)."""
    missing = np.flatnonzero(~np.isfinite(stamps))
    known = np.flatnonzero(np.isfinite(stamps))
    none = known[:0]
    if len(known) < 3:
        return Stamps(0.0, 0.0, False, none, none, none, none, none, missing)
    steps, spanned, first = np.diff(stamps[known]), np.diff(known), known[:-1]
    quantum = resolution(stamps[known])
    repeated, backward = steps == 0, steps < 0
    mean = float(stamps[known[-1]] - stamps[known[0]]) / int(known[-1] - known[0])
    if mean > 0 and _is_rounding(known, stamps[known], mean, quantum):
        worst = none if len(missing) or is_uniform(stamps) else _worst(steps, mean, quantum)
        return Stamps(mean, quantum, False, none, none, none, none, worst, missing)
    forward = steps[steps > 0]
    step = _usual(forward, quantum) if len(forward) else 0.0
    share = float(np.mean(repeated))
    repeats = share > 0.5 or (share > 0.05 and float(np.median(steps)) < 0.6 * mean)
    # One stamp gone wrong disturbs the interval after it too.
    readable = (_around(repeated | backward, 5) == 0) & (not repeats)
    gaps = (steps > (GAP + spanned - 1) * step) & readable
    uneven = np.abs(steps - spanned * step) > max(1.5 * quantum, TOLERANCE * step)
    uneven &= readable & ~gaps
    if np.mean(uneven) < 0.01:
        uneven[:] = False
        if not (repeats or (repeated | backward | gaps).any() or len(missing) or is_uniform(stamps)):
            uneven[_worst(steps, step, quantum)] = True
    # gaps row after row are another rate
    rate = _around(gaps, 2 * STEADY - 1) >= STEADY
    slower, gaps = gaps & rate, gaps & ~rate
    return Stamps(
        step, quantum, repeats, first[repeated], first[backward], first[gaps], first[slower], first[uneven], missing
    )


@dataclass(frozen=True)
class Line:
    """A uniform clock fitted to stamps: rate [Hz] with its 95 % interval, first instant [s], lateness of each [s]."""

    fs: float
    fs_interval: tuple[float, float]
    start: float
    late: Array


def fit_line(stamps: Array) -> Line:
    """Fit the uniform clock ``start + k / fs`` to stamps [s], robustly, as a host that stamps late requires.

    Huber's M-estimate of the line (weight 1 up to 1.345 robust standard deviations), with an interval that allows
    for the correlation of the lateness from row to row.
    """
    rows = np.flatnonzero(np.isfinite(stamps)).astype(float)
    times = stamps[np.isfinite(stamps)]
    centre = rows.mean()
    design = np.column_stack([np.ones_like(rows), rows - centre])
    weights = np.ones_like(rows)
    for _ in range(30):
        root = np.sqrt(weights)
        coefficients, *_ = np.linalg.lstsq(design * root[:, None], times * root, rcond=None)
        late = times - design @ coefficients
        scale = 1.4826 * float(np.median(np.abs(late))) + 1e-15
        fresh = np.minimum(1.0, 1.345 * scale / np.maximum(np.abs(late), 1e-300))
        settled = float(np.max(np.abs(fresh - weights))) < 1e-6
        weights = fresh
        if settled:
            break
    root = np.sqrt(weights)
    line = least_squares(design * root[:, None], times * root)
    start, step = (float(value) for value in line.coefficients)
    reach = student(float(line.freedom[1])) * float(line.sd[1])
    interval = (1 / (step + reach), 1 / max(step - reach, 1e-300))
    return Line(1 / step, interval, start - step * centre, late)


def _is_rounding(rows: Rows, stamps: Array, mean: float, quantum: float) -> bool:
    """Whether an even clock written with few decimals explains all unevenness, equal stamps included.

    It does so only where the interval is no multiple of the resolution, so that the rounding beats.
    """
    late = stamps - np.polyval(np.polyfit(rows, stamps, 1), rows)
    beats = abs(mean - quantum * round(mean / quantum)) * len(rows) / quantum
    return bool(np.ptp(late) < (1.05 if beats > 1 else 0.1) * quantum)


def _worst(steps: Array, step: float, quantum: float) -> Rows:
    """The intervals for which stamps of small faults are kept: all that are uneven at all, or the most uneven one."""
    off = np.abs(steps - step)
    return np.flatnonzero(off >= min(max(1.5 * quantum, NEGLIGIBLE * step), float(np.max(off))))


def _usual(steps: Array, quantum: float) -> float:
    """The usual step: the median, then the mean of those that differ from it by rounding alone."""
    middle = float(np.quantile(steps, 0.5, method="lower"))
    near = steps[np.abs(steps - middle) <= TOLERANCE * middle]
    if len(near) < 0.9 * len(steps):
        near = steps[np.abs(steps - middle) <= max(1.01 * quantum, TOLERANCE * middle)]
    return float(np.mean(near))


def _around(mask: Mask, width: int) -> Array:
    """How many hold among the odd number of `width` rows about each; of short masks too."""
    return np.convolve(mask, np.ones(width))[width // 2 : width // 2 + len(mask)]
