"""The elements of a MAT file of version 5, walked before scipy reads them.

scipy looks up an element's type without checking it: a damaged tag ends the whole process, not in an exception. So
the tags are read first, also inside compressed variables; numbers are passed over.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from stickslip.errors import FormatError

MATRIX, COMPRESSED = 14, 15
NUMBERS = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))  # integers, floats and text
HEADER = 128
DEEPEST = 64
PIECE = 1 << 16

OPAQUE = 17
# How many elements of numbers or text an array of each class holds after its flags, dimensions and name ...
PLAIN_PARTS = {1: 0, 2: 2, 3: 3, 4: 1, 5: 3, **dict.fromkeys(range(6, 16), 1), 16: 0, OPAQUE: 2}
HOLDS_ARRAYS = frozenset((1, 2, 3, 16, OPAQUE))  # ... and the classes where arrays follow: cell, struct, object ...
COMPLEX = 1 << 11  # flag of an array with one more part


class _Damaged(Exception):
    """What is wrong, and at which byte of the stream."""


class _Plain:
    """The file itself."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self.file, self.size = file, size

    def read(self, count: int) -> bytes:
        data = self.file.read(count)
        if len(data) < count:
            raise _Damaged("is cut off")
        return data

    def skip(self, count: int) -> None:
        if self.file.seek(count, 1) > self.size:
            raise _Damaged("is cut off")


class _Inflated:
    """A compressed variable, inflated piece by piece."""

    def __init__(self, source: _Plain, size: int) -> None:
        self.source, self.left, self.engine, self.buffer = source, size, zlib.decompressobj(), b""

    def read(self, count: int) -> bytes:
        while len(self.buffer) < count:
            self._fill()
        data, self.buffer = self.buffer[:count], self.buffer[count:]
        return data

    def skip(self, count: int) -> None:
        while count > len(self.buffer):
            count -= len(self.buffer)
            self.buffer = b""
            self._fill()
        self.buffer = self.buffer[count:]

    def close(self) -> None:
        """Take what is left, so that the source stands behind the variable."""
        self.source.skip(self.left)

    def _fill(self) -> None:
        feed = self.engine.unconsumed_tail
        if not feed and self.left:
            feed = self.source.read(min(self.left, PIECE))
            self.left -= len(feed)
        try:
            data = self.engine.decompress(feed, 16 * PIECE)
        except zlib.error as error:
            raise _Damaged(f"holds a variable that can not be inflated ({error})") from error
        if not data and not self.left and not self.engine.unconsumed_tail:
            raise _Damaged("holds a compressed variable that ends early")
        self.buffer += data


def check_version_5(path: Path) -> list[str]:
    """Refuse a file whose elements do not fit into each other or into the file; the names of its objects."""
    objects: list[str] = []
    size = path.stat().st_size
    with path.open("rb") as file:
        order = ">" if file.read(HEADER)[126:] == b"MI" else "<"
        stream = _Plain(file, size)
        try:
            while file.tell() < size:
                kind, count, _ = _tag(stream, order)
                if kind == COMPRESSED:
                    inside = _Inflated(stream, count)
                    inner, inner_count, _ = _tag(inside, order)
                    _check(inside, order, inner, inner_count, 0, objects)
                    inside.close()
                else:
                    _check(stream, order, kind, count, 0, objects)
        except _Damaged as damage:
            raise FormatError(
                f"'{path.name}' {damage}, near byte {min(file.tell(), size)} of {size}",
                "a MAT file is read whole or not at all",
                "copy the file again from its source, or save it again in MATLAB",
            ) from damage
    return objects


def _tag(stream: _Plain | _Inflated, order: str) -> tuple[int, int, bytes]:
    """Type of the next element, bytes that follow its tag, and the data that a small element has inside it."""
    raw = stream.read(8)
    kind, count = struct.unpack(f"{order}II", raw)
    small = kind >> 16
    if small > 4:
        raise _Damaged(f"holds a small element of {small} bytes")
    return (kind & 0xFFFF, 0, raw[4 : 4 + small]) if small else (kind, count, b"")


def _check(stream: _Plain | _Inflated, order: str, kind: int, count: int, depth: int, objects: list[str]) -> None:
    """One variable: an array, with the arrays inside it."""
    if kind != MATRIX or depth > DEEPEST:
        raise _Damaged(f"holds an element of type {kind} at depth {depth} where an array belongs")
    if count == 0:
        return
    flags_kind, flags_count, _ = _tag(stream, order)
    if flags_kind != 6 or flags_count != 8:
        raise _Damaged("holds an array without its class")
    flags = struct.unpack(f"{order}II", stream.read(8))[0]
    array_class = flags & 0xFF
    if array_class not in PLAIN_PARTS:
        raise _Damaged(f"holds an array of the unknown class {array_class}")
    plain, nested = PLAIN_PARTS[array_class], array_class in HOLDS_ARRAYS
    plain += bool(flags & COMPLEX) and not nested and array_class != 4
    left, number = count - 16, -1 if array_class == OPAQUE else -2  # dimensions and name; an object has no dimensions
    while left > 0:
        kind, follows, small = _tag(stream, order)
        padded = follows + (-follows % 8)
        left -= 8 + padded
        if left < 0:
            raise _Damaged("holds an element that reaches beyond its array")
        if nested and number >= plain:
            _check(stream, order, kind, follows, depth + 1, objects)
        elif kind not in NUMBERS:
            raise _Damaged(f"holds an element of the unknown type {kind}")
        elif array_class == OPAQUE and number == -1 and depth == 0:
            objects.append(small.decode("ascii", "replace") + _text(stream, follows, padded))
        else:
            stream.skip(padded)
        number += 1
    if number < plain or (number > plain and not nested):
        raise _Damaged(f"holds an array of class {array_class} with {number} parts in place of {plain}")


def _text(stream: _Plain | _Inflated, count: int, padded: int) -> str:
    return stream.read(padded)[:count].decode("ascii", "replace") if count < PIECE else ""
