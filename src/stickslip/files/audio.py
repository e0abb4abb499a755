"""Sound files: WAV, FLAC and OGG, read in blocks. Levels are relative to full scale: no file states a calibration."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from stickslip.errors import FormatError
from stickslip.files.table import FREE, Block, Column, Options, Table, optional, reading

NAME = "sound (WAV, FLAC, OGG)"
SUFFIXES = (".wav", ".flac", ".ogg", ".oga")

LAST_PAGE = 4  # flag of an Ogg page
UNCALIBRATED = "levels are relative to full scale (1 FS): the file states no calibration, so no pascals"


def recognise(path: Path, head: bytes) -> bool:
    """By the container's first bytes."""
    return (head[:4] in (b"RIFF", b"RF64", b"RIFX") and head[8:12] == b"WAVE") or head[:4] in (b"fLaC", b"OggS")


def is_sound(path: Path) -> bool:
    """Whether a file is a sound by its name, which has channels of its own: no rig's columns are looked for in it.

    Parameters
    ----------
    path : Path
        It need not be there.

    Returns
    -------
    bool

    Examples
    --------
    >>> is_sound(Path("chalk.OGG")), is_sound(Path("run.csv"))
    (True, False)
    """
    return path.suffix.lower() in SUFFIXES


def read(path: Path, options: Options) -> Table:
    """One column a channel: "sound" where there is one, else "ch1", "ch2" ..., in units of full scale."""
    soundfile = optional("soundfile")
    cut = _check_container(path)
    with reading(path, NAME), path.open("rb") as handle, soundfile.SoundFile(handle) as file:
        frames, rate, count = int(file.frames), float(file.samplerate), int(file.channels)
    if not (0 < frames < 2**62 and rate > 0):
        raise FormatError(
            f"'{path.name}' states {frames} samples at {rate:g} Hz",
            "a sound file states its length and rate",
            "save it again with the program that made it",
        )
    names = ["sound"] if count == 1 else [f"ch{number + 1}" for number in range(count)]

    def blocks(wanted: Sequence[str], size: int) -> Iterator[Block]:
        rows, size = 0, max(1, min(size, frames, FREE // count))  # a block is set up whole, with all channels
        with reading(path, NAME), path.open("rb") as handle, soundfile.SoundFile(handle) as file:
            for samples in file.blocks(blocksize=size, dtype="float64", always_2d=True):
                rows += len(samples)
                yield {name: np.ascontiguousarray(samples[:, names.index(name)]) for name in wanted}
        if rows != frames:
            raise FormatError(
                f"'{path.name}' ends after {rows} of {frames} samples",
                "a sound file is read whole or not at all",
                "copy it again from its source",
            )

    return Table(tuple(Column(name, "FS", frames, rate) for name in names), blocks, notes=(UNCALIBRATED,), cut=cut)


def _check_container(path: Path) -> str:
    """Refuse a file that ends before its container says, which the decoders shorten; what else may be missing."""
    size = path.stat().st_size
    with path.open("rb") as file:
        kind = file.read(4)
        if kind == b"OggS":
            whole, cut = _ogg_ends(path, size), ""
        elif kind in (b"RIFF", b"RF64", b"RIFX"):
            whole, cut = _wav_ends(path, size, ">" if kind == b"RIFX" else "<")
        else:
            return ""
    if not whole:
        raise FormatError(
            f"'{path.name}' is cut off at {size} bytes",
            "a sound file is read whole or not at all",
            "copy it again from its source",
        )
    return cut


def _wav_ends(path: Path, size: int, order: str) -> tuple[bool, str]:
    """Whether the chunk of samples lies within the file, and what may be missing behind it."""
    position, long_size = 12, 0
    with path.open("rb") as file:
        while position + 8 <= size:
            file.seek(position)
            name, length = struct.unpack(f"{order}4sI", file.read(8))
            if name == b"ds64":
                long_size = int.from_bytes(file.read(16)[8:16], "little")
            if name == b"data" and length == 0xFFFFFFFF and not long_size:
                return True, "the recorder did not close the file: it states no length, all that is there was read"
            if name == b"data":
                return position + 8 + (long_size if length == 0xFFFFFFFF else length) <= size, ""
            position += 8 + length + length % 2
    return False, ""


def _ogg_ends(path: Path, size: int) -> bool:
    """Whether every page is whole and each stream has its last."""
    position, open_streams = 0, set()
    with path.open("rb") as file:
        while position < size:
            file.seek(position)
            page = file.read(27)
            if len(page) < 27 or not page.startswith(b"OggS"):
                return False
            serial, lengths = page[14:18], file.read(page[26])
            open_streams.add(serial)
            if page[5] & LAST_PAGE:
                open_streams.discard(serial)
            if len(lengths) < page[26]:
                return False
            position += 27 + len(lengths) + sum(lengths)
    return position == size and not open_streams
