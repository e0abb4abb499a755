"""Spectra inside bursts against outside of them, and which frequencies two channels share there.

Sound and vibration as WAV, to listen to: whole records, and bursts cut out of them.
"""

from __future__ import annotations

import io
import itertools
import math
import wave
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.errors import EstimateError, FormatError, RecordError
from stickslip.files.write import require_free, whole
from stickslip.record.record import Record
from stickslip.squeak.bursts import Squeak, Squeaks, find_squeaks
from stickslip.squeak.hearing import chosen_channel, filtered

LISTENED = ("a", "v", "normal_acceleration", "torsion_velocity", "friction", "load", "sound")
LONGEST = 0.1  # s: the window where bursts allow it
SHORTEST = 64  # samples
ENOUGH, FEWEST = 8, 2  # segments that are sought, and needed
APART = "the bursts and the pauses between them"
LOUD = "the loud parts of the bursts and the rest: there are no pauses between them"
NOTHING_OUTSIDE = "the bursts alone: nothing lies outside of them"
CHANCE = 0.05  # with which coherence exceeds what is called significant

COUNTS = 32768  # of 16 bit, the largest positive one left out
PLAYED = 8000.0  # Hz: players refuse lower rates
AROUND = 0.05  # s before and after a burst
FADE = 0.005  # s: no click where it is cut


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
    >>> spectra = burst_spectra(record)
    >>> peak = int(np.argmax(spectra.inside["sound"]))
    >>> off, coherence = abs(spectra.frequency[peak] - 500), spectra.coherence["a", "sound"][peak]
    >>> bool(off < spectra.resolution), bool(coherence > 0.99)
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
    bursts, time = squeaks.of("squeak", "squeal") or squeaks.bursts, record.time
    inside = [_rows(time, burst.start, burst.end) for burst in bursts]
    pauses = _between(record, [_rows(time, burst.start, burst.end) for burst in squeaks.bursts], size)
    if len(pauses) >= FEWEST:
        return Stretches(_segments(inside, size), pauses, APART)
    loud = [_rows(time, *burst.loud) for burst in bursts]
    rest, within = _between(record, loud, size), _segments(loud, size)
    if len(rest) >= FEWEST and len(within) >= FEWEST:
        return Stretches(within, rest, LOUD)
    return Stretches(_segments(inside, size), [], NOTHING_OUTSIDE)


def _rows(time: Array, start: float, end: float) -> tuple[int, int]:
    first, last = np.searchsorted(time, [start, end])
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
        for size, pieces in tried:
            if len(pieces.inside) >= enough and len(pieces.outside) >= beyond:
                return size, pieces
    raise EstimateError(
        f"bursts of {max(burst.duration for burst in squeaks.bursts) * record.fs:.0f} samples at most",
        f"spectra are averaged over {FEWEST} segments of {SHORTEST} samples at least",
        "record at a higher rate, or for longer",
    )


def _waves(values: Array, rows: list[int], size: int) -> Complex:
    parts = values[np.add.outer(rows, np.arange(size))]
    return np.asarray(np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * np.hanning(size), axis=1))


def _power(waves: Complex) -> Array:
    return np.asarray(np.mean(np.abs(waves) ** 2, axis=0))


def _cross(waves: Mapping[str, Complex], pair: tuple[str, str]) -> tuple[Array, Array]:
    """Coherence and phase of two channels."""
    one, other = (waves[name] for name in pair)
    shared = np.mean(one * np.conj(other), axis=0)
    powers = np.maximum(_power(one) * _power(other), np.finfo(float).tiny)
    return np.abs(shared) ** 2 / powers, np.angle(shared)


@dataclass(frozen=True)
class Clip:
    """A burst cut out to listen to.

    Attributes
    ----------
    name : str
        Short name, fit for a file.
    caption : str
        Which burst it is.
    full_scale : float
        What the largest count stands for [unit]: the loudest moment of all bursts.
    unit : str
        SI unit of the channel; "1" where it is not calibrated.
    level : float
        Mean power, for comparison among the clips of one record.
    wav : bytes
        The WAV file, 16 bit.
    """

    name: str
    caption: str
    full_scale: float
    unit: str
    level: float
    wav: bytes


def write_sound(
    record: Record,
    path: str | Path,
    *,
    channel: str | None = None,
    full_scale: float | None = None,
    overwrite: bool = False,
) -> float:
    """Write a channel as a WAV file of 16 bit, to listen to it or to give it to a program for sound.

    The file appears whole or not at all. A WAV file states no calibration: to read it back, state the full scale, as in
    ``read_record(path, channels={"sound": f"sound * {full_scale} [Pa]"})``.

    Parameters
    ----------
    record : Record
        At one rate; of less than 8 kHz it is written at a whole multiple of the rate, which players need.
    path : path
        A name that ends in ``.wav``.
    channel : str, optional
        Which; the first of sound, normal_acceleration, a, friction, ch1, or any other.
    full_scale : float, optional
        What the largest count stands for [unit of the channel]; the channel's largest magnitude where left out. What
        is beyond would be clipped, and is refused.
    overwrite : bool
        Whether a file that is there already may be replaced.

    Returns
    -------
    float
        The full scale.

    Raises
    ------
    RecordError
        A channel that is missing, not finite or silent, or beyond the full scale.
    FormatError
        Another ending, a file that is there already, or a folder that can not be written to.

    Examples
    --------
    >>> import tempfile
    >>> import stickslip as ss
    >>> record = ss.Record.of({"sound": 2.0 * np.sin(np.arange(8000))}, fs=8000)
    >>> path = Path(tempfile.mkdtemp()) / "tone.wav"
    >>> full_scale = write_sound(record, path)
    >>> again = ss.read_record(path, channels={"sound": f"sound * {full_scale} [Pa]"})
    >>> bool(np.max(np.abs(again["sound"] - record["sound"])) < 2.0 / 32767)
    True
    """
    path = Path(path)
    if path.suffix.lower() != ".wav":
        raise FormatError(f"'{path.name}'", "a sound is written as .wav", "choose this ending")
    if not overwrite:
        require_free(path)
    name = chosen_channel(record, channel)
    record.require_clean(name, question="writing a sound")
    peak = float(np.max(np.abs(record[name])))
    scale = peak * COUNTS / (COUNTS - 1) if full_scale is None else float(full_scale)
    if not (math.isfinite(scale) and scale > 0) or peak > scale * (1 + 1e-9):
        raise RecordError(
            f"{name} reaches {peak:g} {record.channels[name].unit} of a full scale of {scale:g}",
            "a sound is written between zero and its full scale",
            "choose another channel= or a larger full_scale=",
        )
    with whole(path, replace=overwrite) as part:
        part.write_bytes(wav_bytes(record[name], record.fs, scale))
    return scale


def burst_clips(squeaks: Squeaks, *, most: int | None = None) -> tuple[Clip, ...]:
    """The bursts cut out, each in the band that was listened to, with a twentieth of a second before and after it.

    All share one full scale, so that a loud burst stays louder than a soft one.

    Parameters
    ----------
    squeaks : Squeaks
        What :func:`find_squeaks` returned.
    most : int, optional
        The loudest so many, in the order of time; all where left out.

    Returns
    -------
    tuple of Clip

    Examples
    --------
    >>> from stickslip.squeak.bursts import find_squeaks
    >>> t = np.arange(10_000) / 10_000
    >>> tone = np.sin(2 * np.pi * 500 * t) * (np.abs(t - 0.5) < 0.2)
    >>> (clip,) = burst_clips(find_squeaks(Record.of({"sound": tone}, fs=10_000)))
    >>> clip.name, clip.wav[:4]
    ('1-tonal-500-Hz', b'RIFF')
    """
    record = squeaks.record
    unit = record.channels[squeaks.channel].unit
    values = filtered(record[squeaks.channel], record.fs, squeaks.band)
    pieces = [_cut(values, record, burst) for burst in squeaks.bursts]
    scale = max((float(np.max(np.abs(piece))) for piece in pieces), default=0.0) * COUNTS / (COUNTS - 1) or 1.0
    kept = _loudest(pieces, most)
    return tuple(
        Clip(
            f"{number + 1}-{burst.kind}-{burst.frequency:.0f}-Hz",
            f"Burst {number + 1}, {burst.kind}, {burst.start:.3f} to {burst.end:.3f} s",
            scale,
            unit,
            float(np.mean(pieces[number] ** 2)),
            wav_bytes(pieces[number], record.fs, scale),
        )
        for number, burst in enumerate(squeaks.bursts)
        if number in kept
    )


def wav_bytes(values: Array, fs: float, full_scale: float) -> bytes:
    """A WAV file of 16 bit, at `fs` or at a whole multiple of it that players take."""
    from scipy.signal import resample_poly

    factor = max(1, math.ceil(PLAYED / fs))
    played = values if factor == 1 else resample_poly(values, factor, 1)
    counts = np.clip(np.rint(played / full_scale * COUNTS), -COUNTS, COUNTS - 1).astype("<i2")
    written = io.BytesIO()
    with wave.open(written, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(round(factor * fs))
        file.writeframes(counts.tobytes())
    return written.getvalue()


def _cut(values: Array, record: Record, burst: Squeak) -> Array:
    """The burst and a little of what is around it, faded in and out."""
    first, last = np.searchsorted(record.time, [burst.start - AROUND, burst.end + AROUND])
    piece = values[first:last].copy()
    fade = min(round(FADE * record.fs), len(piece) // 2)
    rise = np.sin(np.linspace(0, np.pi / 2, fade, endpoint=False)) ** 2
    piece[:fade] *= rise
    piece[len(piece) - fade :] *= rise[::-1]
    return piece


def _loudest(pieces: list[Array], most: int | None) -> set[int]:
    order = sorted(range(len(pieces)), key=lambda number: -float(np.mean(pieces[number] ** 2)))
    return set(order[:most])
