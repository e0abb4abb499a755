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

# How many elements of numbers or text stand before the matrices inside an array of each class (after its flags,
# dimensions and name); None where no matrix follows.
BEFORE_MATRICES: dict[int, int | None] = {
    1: 0, 2: 2, 3: 3, 16: 0, 17: 2,  # cell, struct, object, function, opaque
    **dict.fromkeys(range(4, 16)),  # text, sparse, numbers
}  # fmt: skip


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


def check_version_5(path: Path) -> None:
    """Refuse a file whose elements do not fit into each other or into the file."""
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
                    _check(inside, order, inner, inner_count, 0)
                    inside.close()
                else:
                    _check(stream, order, kind, count, 0)
        except _Damaged as damage:
            raise FormatError(
                f"'{path.name}' {damage}, near byte {min(file.tell(), size)} of {size}",
                "a MAT file is read whole or not at all",
                "copy the file again from its source, or save it again in MATLAB",
            ) from damage


def _tag(stream: _Plain | _Inflated, order: str) -> tuple[int, int, int]:
    """Type of the next element, bytes that follow its tag, bytes of data."""
    kind, count = struct.unpack(f"{order}II", stream.read(8))
    if kind >> 16:  # a small element carries up to four bytes inside its tag
        if kind >> 16 > 4:
            raise _Damaged(f"holds a small element of {kind >> 16} bytes")
        return kind & 0xFFFF, 0, kind >> 16
    return kind, count, count


def _check(stream: _Plain | _Inflated, order: str, kind: int, count: int, depth: int) -> None:
    """One variable: an array, with the arrays inside it."""
    if kind != MATRIX or depth > DEEPEST:
        raise _Damaged(f"holds an element of type {kind} at depth {depth} where an array belongs")
    if count == 0:
        return
    flags_kind, flags_count, _ = _tag(stream, order)
    if flags_kind != 6 or flags_count != 8:
        raise _Damaged("holds an array without its class")
    array_class = struct.unpack(f"{order}II", stream.read(8))[0] & 0xFF
    if array_class not in BEFORE_MATRICES:
        raise _Damaged(f"holds an array of the unknown class {array_class}")
    before = BEFORE_MATRICES[array_class]
    names = 1 if array_class == 17 else 2  # dimensions and name; an opaque object has a name alone
    left, number = count - 16, -names
    while left > 0:
        kind, follows, size = _tag(stream, order)
        padded = follows + (-follows % 8)
        left -= 8 + padded
        if left < 0:
            raise _Damaged("holds an element that reaches beyond its array")
        if before is not None and number >= before:
            _check(stream, order, kind, follows, depth + 1)
        elif kind not in NUMBERS or (number == -2 and size % 4):
            raise _Damaged(f"holds an element of the unknown type {kind}")
        else:
            stream.skip(padded)
        number += 1
