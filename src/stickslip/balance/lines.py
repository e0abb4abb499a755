"""Channels as complex amplitudes: of each cycle where the motion repeats, of windows where it does not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import Cycles, contact_motion, find_cycles
from stickslip.errors import EstimateError
from stickslip.record.channels import Channel
from stickslip.record.record import Record
from stickslip.signals.interpolate import band_limited
from stickslip.signals.response import Response, leak, resonance

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

MOST = 400  # cycles looked at, spread over the record
WINDOWS = 16  # half overlapping, where the motion does not repeat
SHORTEST = 64  # samples of a window
WORTH = 0.6  # independent windows that one of many half overlapping Hann windows is worth


@dataclass(frozen=True, eq=False)
class Lines:
    """Complex amplitudes c of channels, ``y(t) = Re sum c exp(2 pi i f (t - t_0))``, t_0 the stretch's beginning.

    Attributes
    ----------
    frequency : ndarray (k,)
        Of the lines [Hz], the constant left out.
    amplitudes : mapping of str to ndarray (m, k)
        Per channel and stretch.
    means : mapping of str to ndarray (m,)
        Mean of each stretch.
    worth : float
        Independent stretches that each is worth.
    cycles : Cycles or None
        The cycles, where the stretches are such.
    """

    frequency: Array
    amplitudes: Mapping[str, Complex]
    means: Mapping[str, Array]
    worth: float
    cycles: Cycles | None

    @property
    def count(self) -> int:
        """Number of stretches."""
        return len(next(iter(self.means.values())))


def find_lines(record: Record, channels: Sequence[str], *, contact: str | None = None, question: str) -> Lines:
    """The lines of `channels`: harmonics of each whole cycle, or Hann windows where the motion does not repeat."""
    try:
        cycles = find_cycles(record, contact_motion(record, contact=contact, question=question))
    except EstimateError:
        cycles = None
    if cycles is None or cycles.status != "ok" or len(cycles.edges) < 3:
        return _of_windows(record, channels, question)
    length = float(np.diff(cycles.edges).mean())
    points = 2 * math.floor(length / 2)
    chosen = np.unique(np.linspace(0, len(cycles.edges) - 2, min(MOST, len(cycles.edges) - 1)).astype(int))
    places = cycles.edges[chosen][:, None] + np.arange(points) * length / points
    places = np.minimum(places, len(record) - 1.0)
    folded = band_limited(np.array([record[name] for name in channels]), places.ravel())
    spectra = dict(zip(channels, np.fft.rfft(folded.reshape(-1, *places.shape)) / points, strict=True))
    orders = np.arange(1, points // 2)
    return Lines(
        np.asarray(orders * (record.fs / length), dtype=np.float64),
        {name: 2 * spectrum[:, 1 : points // 2] for name, spectrum in spectra.items()},
        {name: spectrum[:, 0].real for name, spectrum in spectra.items()},
        1.0,
        cycles,
    )


def _of_windows(record: Record, channels: Sequence[str], question: str) -> Lines:
    size = 2 * len(record) // (WINDOWS + 1) // 2 * 2
    if size < SHORTEST:
        raise EstimateError(
            f"{len(record)} samples", f"{question} needs {SHORTEST * (WINDOWS + 1) // 2} without cycles",
            "give a longer record",
        )  # fmt: skip
    window = np.hanning(size + 1)[:-1]
    starts = np.arange(WINDOWS) * (size // 2)
    amplitudes, means = {}, {}
    for name in channels:
        parts = np.stack([record[name][first : first + size] for first in starts])
        means[name] = parts.mean(axis=1)
        spectrum = np.fft.rfft((parts - means[name][:, None]) * window, axis=1)
        amplitudes[name] = 2 * spectrum[:, 1 : size // 2] / window.sum()
    frequency = np.arange(1, size // 2) * record.fs / size
    return Lines(frequency, amplitudes, means, WORTH, None)


def response_of(sensor: Channel) -> Response:
    """What a sensor makes of a motion, as far as it is stated: its mount, and its discharge."""
    mount = resonance(*sensor.mount) if sensor.mount is not None else Response()
    return mount.then(leak(sensor.discharge)) if sensor.discharge is not None else mount
