"""Channels that lag what they measure: the stated delays taken out, before anything compares one with another."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from stickslip.errors import RecordError
from stickslip.record.record import Record, Step
from stickslip.signals.interpolate import LOBES, band_limited


def without_delays(record: Record, *channels: str, question: str = "taking delays out", samples: int = 2) -> Record:
    """What would the channels read, had none of them come late?

    Each named channel whose delay is stated is moved by band-limited interpolation, ``y(t) = x(t + delay)``; then all
    channels are cut to the rows that every moved one reaches. Channels not named keep their values and their delay.

    Parameters
    ----------
    record : Record
        Delays [s] stated in its channels, see :meth:`~stickslip.record.record.Record.with_details`.
    *channels : str
        Those to move; all where none is named.
    question : str
        Who asks, for the words of a refusal.
    samples : int
        Least number of rows that must be left.

    Returns
    -------
    Record
        The same record where no named channel is delayed; else with the step in its history and delays of zero. A
        channel's stated noise is kept: white noise loses 2 % at most to the interpolation.

    Raises
    ------
    RecordError
        A delayed channel that is missing or not finite, a broken clock, or too few rows left.

    Examples
    --------
    >>> t = np.arange(1000) / 1000
    >>> late = Record.of({"x": np.sin(9 * t), "v": 9 * np.cos(9 * (t - 0.0125))}, fs=1000.0)
    >>> record = without_delays(late.with_details("v", delay=0.0125), "x", "v")
    >>> len(record), bool(np.allclose(record["v"][50:-50], 9 * np.cos(9 * record.time[50:-50]), atol=1e-4))
    (987, True)
    """
    record.require(*channels, question=question)
    delays = {name: record.channels[name].delay for name in channels or record if record.channels[name].delay}
    if not delays:
        return record
    record.require_clean(*delays, question=question)
    shifts = {name: delay * record.fs for name, delay in delays.items()}
    first = max(0, math.ceil(-min(shifts.values())))
    last = len(record) - max(0, math.ceil(max(shifts.values())))
    if last - first < samples or len(record) <= LOBES:
        raise RecordError(
            f"delays of {', '.join(f'{name} {delay:g} s' for name, delay in delays.items())}",
            f"{question} needs {max(samples, LOBES + 1)} rows that every channel reaches, "
            f"and {max(0, last - first)} of {len(record)} are left",
            "correct the delays, in seconds, or give a longer record",
        )
    rows = np.arange(first, last, dtype=float)
    moved = {
        name: band_limited(values, rows + shifts[name]) if name in shifts else values[first:last]
        for name, values in record.samples.items()
    }
    step = Step(
        "without_delays", {"delays": delays}, f"delays taken out; {last - first} of {len(record)} rows reached by all"
    )
    result = record.with_samples(moved, step, start=record.start + first / record.fs)
    punctual = {name: replace(record.channels[name], delay=0.0) for name in delays}
    return replace(result, channels={**record.channels, **punctual})
