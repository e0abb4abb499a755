"""Filters that shift nothing in time: a band kept, a mode taken out, a trend taken off; each is told in the history.

How harmonic a periodic channel is, is told by the amplitudes of its fundamental and of the multiples of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import Estimate, Result
from stickslip.record.record import Record, Step, require_record
from stickslip.statistics import LeastSquares, least_squares, student

Array = NDArray[np.float64]

ORDER = 4  # of Butterworth's filter, which runs forward and back: the gain at an edge is one half
SETTLES = 3  # periods of the lowest edge that a record must last
MOST_DEGREE = 6


def keep_band(
    record: Record, *, low: float | None = None, high: float | None = None, channels: Iterable[str] | None = None
) -> Record:
    r"""Keep what lies between two frequencies.

    Butterworth's filter of fourth order forward and back (zero phase): the gain is :math:`1/(1 + (f/f_c)^8)` beside an
    edge :math:`f_c`, one half at it. All channels are filtered alike unless some are named, so that forces still
    balance between them.

    Parameters
    ----------
    record : Record
        With one clock.
    low, high : float, optional
        Edges of the band [Hz]; one that is left out is open.
    channels : iterable of str, optional
        Which ones; all where left out.

    Returns
    -------
    Record
        Its first and last periods of the lower edge hold the filter's settling.

    Raises
    ------
    RecordError
        No edge, edges out of order or beyond half the sampling rate, a record shorter than three periods of the lower
        edge, or values that are not numbers.

    Examples
    --------
    >>> t = np.arange(2000) / 1000
    >>> record = Record.of({"x": np.sin(2 * np.pi * 5 * t) + np.sin(2 * np.pi * 100 * t)}, fs=1000)
    >>> kept = keep_band(record, high=20)["x"][300:-300]
    >>> bool(np.abs(kept - np.sin(2 * np.pi * 5 * t)[300:-300]).max() < 1e-3)
    True
    """
    edges = [edge for edge in (low, high) if edge is not None]
    if not edges or not all(0 < edge < record.fs / 2 for edge in edges) or (len(edges) == 2 and edges[0] >= edges[1]):
        raise RecordError(
            f"a band from {low} to {high} Hz of a record at {record.fs:g} Hz",
            "edges lie between 0 and half the sampling rate, the lower first",
            "state low=, high= or both, in Hz",
        )
    kind = "bandpass" if len(edges) == 2 else "highpass" if high is None else "lowpass"
    between = " to ".join(f"{edge:g}" for edge in edges)
    below, above = (f"kept below {high:g} Hz" if high else ""), (f"kept above {low:g} Hz" if low else "")
    outcome = {"bandpass": f"kept {between} Hz", "highpass": above, "lowpass": below}[kind]
    return _filtered(record, channels, edges, kind, Step("keep_band", {"low": low, "high": high}, outcome))


def remove_mode(
    record: Record, *, frequency: float, width: float = 0.2, channels: Iterable[str] | None = None
) -> Record:
    """Take out one mode of vibration: what lies about its frequency, as the ringing of a mount or of a frame.

    Parameters
    ----------
    record : Record
        With one clock.
    frequency : float
        Of the mode [Hz].
    width : float
        How wide a band is taken out, over its frequency.
    channels : iterable of str, optional
        Which ones; all where left out.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        A band that does not lie between 0 and half the sampling rate, or as of :func:`keep_band`.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> slow, ringing = np.sin(2 * np.pi * 2 * t), 0.3 * np.sin(2 * np.pi * 60 * t)
    >>> record = remove_mode(Record.of({"x": slow + ringing}, fs=1000), frequency=60)
    >>> bool(np.abs(record["x"] - slow)[300:-300].max() < 1e-3), record.history[-1].outcome
    (True, 'taken out 54 to 66 Hz')
    """
    edges = [frequency * (1 - width / 2), frequency * (1 + width / 2)]
    if not (0 < width < 2 and edges[0] > 0 and edges[1] < record.fs / 2):
        raise RecordError(
            f"a mode at {frequency:g} Hz, {width:g} of it wide, at {record.fs:g} Hz",
            "its band lies between 0 and half the sampling rate",
            "correct the frequency [Hz] or width=",
        )
    outcome = f"taken out {edges[0]:g} to {edges[1]:g} Hz"
    step = Step("remove_mode", {"frequency": frequency, "width": width}, outcome)
    return _filtered(record, channels, edges, "bandstop", step)


def remove_trend(record: Record, *channels: str, degree: int = 1) -> Record:
    """Take off a straight line (degree 0: the mean; up to 6) fitted to all samples by least squares.

    What oscillates over few periods bends such a line: :func:`remove_drift` looks at means over whole periods.

    Parameters
    ----------
    record : Record
        With one clock.
    *channels : str
        Which ones; all where none is named.
    degree : int
        Of the polynomial.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        A degree outside 0 to 6, or values that are not numbers.

    Examples
    --------
    >>> record = remove_trend(Record.of({"load": [3.0, 4.0, 5.0, 6.0]}, fs=10.0))
    >>> bool(np.abs(record["load"]).max() < 1e-12), record.history[-1].action
    (True, 'remove_trend')
    """
    if not 0 <= degree <= MOST_DEGREE:
        raise RecordError(f"degree = {degree}", f"a trend is a polynomial of degree 0 to {MOST_DEGREE}", "choose one")
    names = _named(record, channels, "remove_trend", degree + 2)
    rows = np.linspace(-1, 1, len(record))
    off = {n: np.polynomial.Polynomial.fit(rows, record[n], degree)(rows) for n in names}
    step = Step("remove_trend", {"channels": names, "degree": degree}, f"a polynomial of degree {degree} taken off")
    return record.with_samples({**record.samples, **{n: record[n] - off[n] for n in names}}, step)


def _named(record: Record, channels: Iterable[str] | None, asker: str, samples: int) -> list[str]:
    require_record(record)
    names = list(channels or record)
    record.require_clean(*names, question=asker, samples=samples)
    return names


def _filtered(record: Record, channels: Iterable[str] | None, edges: list[float], kind: str, step: Step) -> Record:
    """Some channels, run through Butterworth's filter forward and back."""
    from scipy.signal import butter, sosfiltfilt

    names = _named(record, channels, step.action, int(np.ceil(SETTLES * record.fs / edges[0])) + 1)
    sections = butter(ORDER, edges if len(edges) > 1 else edges[0], kind, fs=record.fs, output="sos")
    most = len(record) - 1
    settle = min(most, int(SETTLES * record.fs / edges[0]))
    through: dict[str, Array] = {n: sosfiltfilt(sections, record[n], padlen=settle) for n in names}
    described = Step(step.action, {**step.arguments, "channels": names}, step.outcome)
    return record.with_samples({**record.samples, **through}, described, filtered=True)


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
