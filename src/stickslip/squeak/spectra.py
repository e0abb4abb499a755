"""Spectra inside bursts against outside of them, and which frequencies two channels share there."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.record.record import Record
from stickslip.squeak.bursts import Squeaks, find_squeaks

Array = NDArray[np.float64]
Waves = NDArray[np.complex128]

LISTENED = ("a", "v", "normal_acceleration", "torsion_velocity", "friction", "load", "sound")
LONGEST = 0.1  # s: the window where bursts allow it
SHORTEST = 64  # samples
ENOUGH, FEWEST = 8, 2  # segments that are sought, and needed
APART = "the bursts and the pauses between them"
LOUD = "the loud parts of the bursts and the rest: there are no pauses between them"
NOTHING_OUTSIDE = "the bursts alone: nothing lies outside of them"
CHANCE = 0.05  # with which coherence exceeds what is called significant


@dataclass(frozen=True, eq=False)
class BurstSpectra:
    """Spectra of a record's channels in bursts and outside of them.

    Attributes
    ----------
    frequency : ndarray, shape (k,)
        Frequencies [Hz].
    inside, outside : mapping of str to ndarray, shape (k,)
        Power spectral density of each channel [unit^2/Hz], one-sided; `outside` is empty where too little lies there.
    coherence : mapping of (str, str) to ndarray, shape (k,)
        Magnitude-squared coherence of each two channels in the bursts, 0 to 1.
    coherence_outside : mapping of (str, str) to ndarray, shape (k,)
        The same outside of the bursts.
    phase : mapping of (str, str) to ndarray, shape (k,)
        Of the cross spectrum in the bursts [rad], by which the second lags the first.
    significant, significant_outside : float
        Coherence that channels that have nothing to do with each other exceed once in twenty times.
    segments, segments_outside : int
        Stretches averaged.
    compared : str
        What is held against what.
    """

    frequency: Array
    inside: Mapping[str, Array]
    outside: Mapping[str, Array]
    coherence: Mapping[tuple[str, str], Array]
    coherence_outside: Mapping[tuple[str, str], Array]
    phase: Mapping[tuple[str, str], Array]
    significant: float
    significant_outside: float
    segments: int
    segments_outside: int
    compared: str

    @property
    def resolution(self) -> float:
        """Distance of two frequencies [Hz]."""
        return float(self.frequency[1] - self.frequency[0])


def burst_spectra(record: Record, *, squeaks: Squeaks | None = None) -> BurstSpectra:
    r"""Which frequencies sound in the bursts, in which channels, and which of them do two channels share?

    Welch's power and cross spectra (IEEE Trans. Audio Electroacoust. 15, 1967) of segments without overlap, Hann's
    window, the mean of each segment taken off: from segments that lie in squeaks and squeals (in bursts of any kind
    where there are none), and from segments that lie outside of all bursts. Where bursts follow each other without a
    pause, what is within ten decibel of their loudest moments is held against the rest. A segment is a tenth of a
    second long, or as long as leaves eight of them in the bursts. The coherence is :math:`|G_{xy}|^2/(G_{xx} G_{yy})`.

    Parameters
    ----------
    record : Record
        With one at least of a, v, normal_acceleration, torsion_velocity, friction, load, sound; or the channel in which
        the bursts were heard.
    squeaks : Squeaks, optional
        What :func:`find_squeaks` found in it; found where left out.

    Returns
    -------
    BurstSpectra

    Raises
    ------
    RecordError
        A channel is broken.
    EstimateError
        No burst, or none long enough.

    Examples
    --------
    >>> t = np.arange(20_000) / 10_000
    >>> tone = np.sin(2 * np.pi * 500 * t) * (np.abs(t - 1) < 0.5)
    >>> noise = np.random.default_rng(0).standard_normal((2, t.size))
    >>> record = Record.of({"sound": tone + 0.01 * noise[0], "a": 3 * tone + 0.1 * noise[1]}, fs=10_000)
    >>> found = burst_spectra(record)
    >>> peak = int(np.argmax(found.inside["sound"]))
    >>> bool(abs(found.frequency[peak] - 500) < found.resolution), bool(found.coherence["a", "sound"][peak] > 0.99)
    (True, True)
    """
    squeaks = find_squeaks(record) if squeaks is None else squeaks
    if not squeaks.bursts:
        raise EstimateError(
            "no burst was found", "spectra are compared in bursts and outside", "see find_squeaks(record)"
        )
    names = [name for name in LISTENED if name in record and np.ptp(record[name]) > 0] or [squeaks.channel]
    record.require_clean(*names, question="spectra of bursts")
    size, where = _longest(record, squeaks)
    waves = {name: _waves(record[name], where.inside, size) for name in names}
    quiet = {name: _waves(record[name], where.outside, size) for name in names} if where.outside else {}
    scale = 2 / (record.fs * float(np.sum(np.hanning(size) ** 2)))
    cross = {pair: _cross(waves, pair) for pair in itertools.combinations(names, 2)}
    cross_quiet = {pair: _cross(quiet, pair) for pair in cross} if quiet else {}
    return BurstSpectra(
        frequency=np.asarray(np.fft.rfftfreq(size, 1 / record.fs), dtype=float),
        inside={name: scale * _power(wave) for name, wave in waves.items()},
        outside={name: scale * _power(wave) for name, wave in quiet.items()},
        coherence={pair: both[0] for pair, both in cross.items()},
        coherence_outside={pair: both[0] for pair, both in cross_quiet.items()},
        phase={pair: both[1] for pair, both in cross.items()},
        significant=coherence_by_chance(len(where.inside)),
        significant_outside=coherence_by_chance(len(where.outside)) if quiet else math.nan,
        segments=len(where.inside),
        segments_outside=len(where.outside),
        compared=where.words,
    )


@dataclass(frozen=True)
class Stretches:
    """First rows of the segments of a length that lie in bursts, and outside; and what that means."""

    inside: list[int]
    outside: list[int]
    words: str


def stretches(record: Record, *, squeaks: Squeaks, size: int) -> Stretches:
    """Segments of `size` samples in the squeaks (or the bursts of any kind where there are none) and outside of all.

    Where bursts follow each other without a pause, their loud parts are held against the rest.
    """
    bursts = squeaks.of("squeak", "squeal") or squeaks.bursts
    inside = [_rows(record, burst.start, burst.end) for burst in bursts]
    pauses = _between(record, [_rows(record, burst.start, burst.end) for burst in squeaks.bursts], size)
    if len(pauses) >= FEWEST:
        return Stretches(_segments(inside, size), pauses, APART)
    loud = [_rows(record, *burst.loud) for burst in bursts]
    rest, within = _between(record, loud, size), _segments(loud, size)
    if len(rest) >= FEWEST and len(within) >= FEWEST:
        return Stretches(within, rest, LOUD)
    return Stretches(_segments(inside, size), [], NOTHING_OUTSIDE)


def _rows(record: Record, start: float, end: float) -> tuple[int, int]:
    first, last = np.searchsorted(record.time, [start, end])
    return int(first), int(last)


def _segments(rows: list[tuple[int, int]], size: int) -> list[int]:
    return [row for first, last in rows for row in range(first, last - size + 1, size)]


def _between(record: Record, rows: list[tuple[int, int]], size: int) -> list[int]:
    """Segments that hold none of the rows."""
    taken = np.zeros(len(record), dtype=int)
    for first, last in rows:
        taken[first:last] = 1
    count = np.concatenate([[0], np.cumsum(taken)])
    return [row for row in range(0, len(record) - size + 1, size) if count[row + size] == count[row]]


def coherence_by_chance(count: int) -> float:
    """What the coherence of `count` segments of independent noise exceeds once in twenty times."""
    return float(1 - CHANCE ** (1 / (count - 1)))


def _longest(record: Record, squeaks: Squeaks) -> tuple[int, Stretches]:
    """Samples of a segment, and where segments lie."""
    longest = max(SHORTEST, 1 << round(math.log2(LONGEST * record.fs)))
    sizes = [longest >> halved for halved in range(10) if longest >> halved >= SHORTEST]
    tried = [(size, stretches(record, squeaks=squeaks, size=size)) for size in sizes]
    for enough, beyond in ((ENOUGH, ENOUGH), (ENOUGH, FEWEST), (ENOUGH, 0), (FEWEST, 0)):
        for size, found in tried:
            if len(found.inside) >= enough and len(found.outside) >= beyond:
                return size, found
    raise EstimateError(
        f"bursts of {max(burst.duration for burst in squeaks.bursts) * record.fs:.0f} samples at most",
        f"spectra are averaged over {FEWEST} segments of {SHORTEST} samples at least",
        "record at a higher rate, or for longer",
    )


def _waves(values: Array, rows: list[int], size: int) -> Waves:
    parts = values[np.add.outer(rows, np.arange(size))]
    return np.asarray(np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * np.hanning(size), axis=1))


def _power(waves: Waves) -> Array:
    return np.asarray(np.mean(np.abs(waves) ** 2, axis=0))


def _cross(waves: Mapping[str, Waves], pair: tuple[str, str]) -> tuple[Array, Array]:
    """Coherence and phase of two channels."""
    one, other = (waves[name] for name in pair)
    shared = np.mean(one * np.conj(other), axis=0)
    powers = np.maximum(_power(one) * _power(other), np.finfo(float).tiny)
    return np.abs(shared) ** 2 / powers, np.angle(shared)
