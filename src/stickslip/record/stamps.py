"""How a record's time stamps are broken: what the intervals between them say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.statistics import least_squares, student

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

GAP = 1.9  # an interval this many times the usual one lost a sample; slower loops of a host stay below
TOLERANCE = 0.02  # relative deviation of an interval that no analysis of friction would notice
STEADY = 10  # gaps this close together are no accident


@dataclass(frozen=True)
class Stamps:
    """What time stamps say about the clock that wrote them.

    Attributes
    ----------
    step : float
        Usual interval between samples [s].
    resolution : float
        Decimal resolution of the stamps [s]; 0 where they have none.
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
        return not (
            self.held
            or any(map(len, (self.repeated, self.backward, self.gaps, self.slower, self.uneven, self.missing)))
        )


def inspect(stamps: Array) -> Stamps:
    """Find what is wrong with time stamps [s], shape (n,)."""
    missing = np.flatnonzero(~np.isfinite(stamps))
    known = np.flatnonzero(np.isfinite(stamps))
    none = known[:0]
    if len(known) < 3:
        return Stamps(0.0, 0.0, False, none, none, none, none, none, missing)
    steps, spanned, first = np.diff(stamps[known]), np.diff(known), known[:-1]
    resolution = _resolution(stamps[known])
    repeated, backward = steps == 0, steps < 0
    mean = float(stamps[known[-1]] - stamps[known[0]]) / int(known[-1] - known[0])
    if mean > 0 and _is_rounding(known, stamps[known], mean, resolution):
        return Stamps(mean, resolution, False, none, none, none, none, none, missing)
    forward = steps[steps > 0]
    step = _usual(forward, resolution) if len(forward) else 0.0
    share = float(np.mean(repeated))
    held = share > 0.5 or (share > 0.05 and float(np.median(steps)) < 0.6 * mean)
    # One stamp gone wrong disturbs the interval after it too.
    readable = (np.convolve(repeated | backward, np.ones(5), "same") == 0) & (not held)
    gaps = (steps > (GAP + spanned - 1) * step) & readable
    uneven = np.abs(steps - spanned * step) > max(1.5 * resolution, TOLERANCE * step)
    uneven &= readable & ~gaps
    if np.mean(uneven) < 0.01:
        uneven[:] = False
    # gaps row after row are another rate
    rate = np.convolve(gaps, np.ones(2 * STEADY - 1), "same") >= STEADY
    slower, gaps = gaps & rate, gaps & ~rate
    return Stamps(
        step, resolution, held, first[repeated], first[backward], first[gaps], first[slower], first[uneven], missing
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


def _resolution(stamps: Array) -> float:
    """The decimal resolution that all stamps share [s], at or above a microsecond; 0 if none."""
    part = stamps[:20_000] - stamps[0]
    for digits in range(7):
        scaled = part * 10.0**digits
        if float(np.max(np.abs(scaled - np.round(scaled)))) < 1e-3:
            return float(10.0**-digits)
    return 0.0


def _is_rounding(rows: Rows, stamps: Array, mean: float, resolution: float) -> bool:
    """Whether an even clock written with few decimals explains all unevenness, equal stamps included.

    It does so only where the interval is no multiple of the resolution, so that the rounding beats.
    """
    if resolution == 0:
        return False
    late = stamps - np.polyval(np.polyfit(rows, stamps, 1), rows)
    beats = abs(mean - resolution * round(mean / resolution)) * len(rows) / resolution
    return bool(np.ptp(late) < (1.05 if beats > 1 else 0.1) * resolution)


def _usual(steps: Array, resolution: float) -> float:
    """The usual step: the median, then the mean of those that differ from it by rounding alone."""
    middle = float(np.quantile(steps, 0.5, method="lower"))
    near = steps[np.abs(steps - middle) <= TOLERANCE * middle]
    if len(near) < 0.9 * len(steps):
        near = steps[np.abs(steps - middle) <= max(1.01 * resolution, TOLERANCE * middle)]
    return float(np.mean(near))
