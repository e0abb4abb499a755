"""Sound and vibration as WAV, to listen to: whole records, and bursts cut out of them."""

from __future__ import annotations

import io
import math
import wave
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import FormatError, RecordError
from stickslip.files.write import require_free, whole
from stickslip.record.record import Record
from stickslip.squeak.bursts import Squeak, Squeaks, chosen_channel
from stickslip.squeak.hearing import filtered

Array = NDArray[np.float64]

COUNTS = 32768  # of 16 bit, the largest positive one left out
PLAYED = 8000.0  # Hz: players refuse lower rates
AROUND = 0.05  # s before and after a burst
FADE = 0.005  # s: no click where it is cut


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


def burst_clips(found: Squeaks, *, most: int | None = None) -> tuple[Clip, ...]:
    """The bursts cut out, each in the band that was listened to, with a twentieth of a second before and after it.

    All share one full scale, so that a loud burst stays louder than a soft one.

    Parameters
    ----------
    found : Squeaks
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
    record = found.record
    unit = record.channels[found.channel].unit
    values = filtered(record[found.channel], record.fs, found.band)
    pieces = [_cut(values, record, burst) for burst in found.bursts]
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
        for number, burst in enumerate(found.bursts)
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
