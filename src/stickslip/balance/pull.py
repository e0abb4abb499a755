"""A slider pulled through a spring at a constant speed: does it stick and slip, or swing?"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result
from stickslip.record.record import Record
from stickslip.signals.delay import without_delays
from stickslip.signals.derivatives import smooth
from stickslip.statistics import mean_of_cycles

Array = NDArray[np.float64]

QUESTION = "stick-slip of a pulled slider"
LEAST = 64  # samples
AWAY = 41  # samples of a running median, which takes bursts of wild readings away
DROP = 0.1  # of the usual swing: what a drop must reach to end a stick
NOISY = 8.0  # standard deviations of the noise: a drop is larger
SLOW = 2.0  # times as long as it falls, from which on a rise is a stick
FEW = 4  # samples of a rise


@dataclass(frozen=True, eq=False, repr=False)
class Pull(Result):
    """How a slider moves that is pulled through a spring.

    Attributes
    ----------
    loading_rate : Estimate
        How fast the force rises while it sticks [N/s]: spring times pulling speed.
    breakaway : Estimate
        Force at which it slips: its static friction, for it hardly accelerates yet.
    drop : Estimate
        By how much the force falls in a slip.
    frequency : Estimate
        Slips per second [Hz].
    rise_over_fall : Estimate
        How long the force rises, over how long it falls.
    regime : str
        "stick-slip", or "inertial": it swings about its steady sliding.
    slips : ndarray, shape (n,)
        When each slip begins [s].
    status : str
        "ok", or in words what to beware of.
    """

    loading_rate: Estimate
    breakaway: Estimate
    drop: Estimate
    frequency: Estimate
    rise_over_fall: Estimate
    regime: str
    slips: Array
    status: str


def pulled_slider(record: Record, *, channel: str = "load") -> Pull:
    r"""Does a slider that is pulled through a spring stick and slip, and how fast is the spring loaded meanwhile?

    While it sticks, the spring's force rises at :math:`\dot F = k V`. Every rise, from a minimum of the force to the
    next maximum, is fitted by a line; the rate is the mean of the lines, by how long each lasts. Where the force rises
    for twice as long as it falls, or longer, the slider sticks and slips; else it swings about its steady sliding, as
    its inertia lets it, and its rises are those of a wave. Minima and maxima are those of the smoothed force.

    Parameters
    ----------
    record : Record
        With the force in the spring, over time.
    channel : str
        The force.

    Returns
    -------
    Pull

    Raises
    ------
    RecordError
        The channel is missing, broken or too short.
    EstimateError
        The force does not rise and drop three times.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> force = 0.3 + 0.1 * (t % 0.5) + 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    >>> found = pulled_slider(Record.of({"load": force}, fs=1000))
    >>> found.regime, round(found.loading_rate.value, 2)
    ('stick-slip', 0.1)
    """
    from scipy.ndimage import median_filter

    record.require_clean(channel, question=QUESTION, samples=LEAST)
    record = without_delays(record, channel, question=QUESTION)
    unit = record.channels[channel].unit
    calm = smooth(median_filter(record[channel], AWAY), record.fs)
    tops, bottoms = _turns(calm.values, float(np.median(calm.sd)))
    if len(tops) < 3:
        raise EstimateError(
            f"{channel} rises and drops {len(tops)} times by more than its noise",
            f"{QUESTION} needs three slips",
            "give a longer record",
        )
    falls = (bottoms - tops) / record.fs
    rises = (tops[1:] - bottoms[:-1]) / record.fs
    shape = mean_of_cycles(
        "rise over fall", rises / falls.mean(), unit="1", method="how long the force rises over how long it falls"
    )
    sticks = shape.value > SLOW
    rate = _rate(record[channel], record.fs, bottoms[:-1], tops[1:], f"{unit}/s")
    if not sticks:
        rate = replace(rate, status="it swings and does not stick: the rises are those of a wave")
    levels = calm.values
    every = mean_of_cycles("period", np.diff(tops) / record.fs, unit="s", method="from slip to slip")
    frequency = Estimate(
        "slips per second", 1 / every.value, (1 / every.interval[1], _over(every.interval[0])),
        every.sd / every.value**2, "Hz", "mean time from slip to slip", every.status, every.checks,
    ).within(0.0, record.fs / 2)  # fmt: skip
    return Pull(
        rate,
        mean_of_cycles("force at breakaway", levels[tops], unit=unit, method="largest force before each slip, mean"),
        mean_of_cycles("drop of the force", levels[tops] - levels[bottoms], unit=unit, method="in each slip, mean"),
        frequency, shape, "stick-slip" if sticks else "inertial", record.start + tops / record.fs, rate.status,
    )  # fmt: skip


def _over(value: float) -> float:
    return 1 / value if value > 0 else math.inf


def _turns(force: Array, noise: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Maxima of the force, each followed by a drop that counts, and the minima after them.

    A drop after which the force does not rise as much again is cut by the end of the record, and left out.
    """
    from scipy.signal import find_peaks

    _, peaks = find_peaks(force, prominence=NOISY * noise)
    if not len(peaks["prominences"]):
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    usual = float(np.quantile(peaks["prominences"], 0.9))
    counts = max(NOISY * noise, DROP * usual)
    tops = find_peaks(force, prominence=counts)[0]
    edges = np.append(tops, len(force))
    bottoms = [high + int(np.argmin(force[high:next_])) for high, next_ in zip(tops, edges[1:], strict=True)]
    if bottoms and force[-1] - force[bottoms[-1]] < counts:  # it may fall on beyond the end
        tops, bottoms = tops[:-1], bottoms[:-1]
    return tops, np.array(bottoms, dtype=np.intp)


def _rate(force: Array, fs: float, lows: NDArray[np.intp], highs: NDArray[np.intp], unit: str) -> Estimate:
    """Mean slope of the rises, by how long each lasts."""
    kept = [(low, high) for low, high in zip(lows, highs, strict=True) if high - low >= FEW]
    if not kept:
        raise EstimateError(
            f"the force rises within {FEW} samples", f"{QUESTION} needs rises that last longer", "sample faster"
        )
    slopes = np.array([fs * np.polyfit(np.arange(high - low), force[low:high], 1)[0] for low, high in kept])
    weights = np.array([high - low for low, high in kept], dtype=float)
    weights /= weights.mean()
    mean = float(np.mean(weights * slopes))
    how = "line through each rise, mean by how long it lasts"
    return mean_of_cycles("loading rate", mean + weights * (slopes - mean), unit=unit, method=how)
