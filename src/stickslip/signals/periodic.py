"""How harmonic a periodic channel is: the amplitudes of its fundamental and of the multiples of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result
from stickslip.record.record import Record
from stickslip.statistics import LeastSquares, least_squares, student


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
