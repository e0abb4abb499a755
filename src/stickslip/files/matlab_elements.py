"""The elements of a MAT file of version 5, walked before scipy reads them.

scipy looks up an element's type without checking it: a damaged tag ends the whole process, not in an exception. It also
makes an array as large as its dimensions say before it looks for what is in it. So the tags are read first, also inside
compressed variables, and what they would become is counted; numbers are passed over.
"""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from stickslip.errors import FormatError
from stickslip.files.table import Budget

MATRIX, COMPRESSED = 14, 15
BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}  # of integers, floats, text
HEADER = 128
DEEPEST = 64
PIECE = 1 << 16

AN_ARRAY = 64  # cells that an array counts as at least: numpy and scipy need 500 bytes for an empty one
CELL, STRUCT, OBJECT, SPARSE, OPAQUE = 1, 2, 3, 5, 17
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
        self.source, self.left, self.engine = source, size, zlib.decompressobj()
        self.buffer, self.at = b"", 0  # what is inflated, and how much of it was read

    def read(self, count: int) -> bytes:
        while self.at + count > len(self.buffer):
            self._fill()
        self.at += count
        return self.buffer[self.at - count : self.at]

    def skip(self, count: int) -> None:
        self.at += count
        while self.at > len(self.buffer):
            self._fill()

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
        kept = self.buffer[self.at :]
        self.at = max(0, self.at - len(self.buffer))
        self.buffer = kept + data


def check_version_5(path: Path) -> list[str]:
    """Refuse a file whose elements do not fit into each other, the file or its budget; the names of its objects."""
    size = path.stat().st_size
    with path.open("rb") as file:
        walk = _Walk(">" if file.read(HEADER)[126:] == b"MI" else "<", Budget.of(path))
        stream = _Plain(file, size)
        try:
            while file.tell() < size:
                kind, count, _ = walk.tag(stream)
                if kind == COMPRESSED:
                    inside = _Inflated(stream, count)
                    inner, inner_count, _ = walk.tag(inside)
                    walk.array(inside, inner, inner_count)
                    inside.close()
                else:
                    walk.array(stream, kind, count)
        except _Damaged as damage:
            raise FormatError(
                f"'{path.name}' {damage}, near byte {min(file.tell(), size)} of {size}",
                "a MAT file is read whole or not at all",
                "copy the file again from its source, or save it again in MATLAB",
            ) from damage
    return walk.objects


class _Walk:
    """Through all arrays of a file: the names of objects and the cells that came so far."""

    def __init__(self, order: str, budget: Budget) -> None:
        self.order, self.budget = order, budget
        self.objects: list[str] = []
        self.cells = 0

    def tag(self, stream: _Plain | _Inflated) -> tuple[int, int, bytes]:
        """Type of the next element, bytes that follow its tag, and the data that a small element has inside it."""
        raw = stream.read(8)
        kind, count = struct.unpack(f"{self.order}II", raw)
        small = kind >> 16
        if small > 4:
            raise _Damaged(f"holds a small element of {small} bytes")
        return (kind & 0xFFFF, 0, raw[4 : 4 + small]) if small else (kind, count, b"")

    def array(self, stream: _Plain | _Inflated, kind: int, count: int, depth: int = 0) -> None:
        """One variable: an array, with the arrays inside it."""
        if kind != MATRIX or depth > DEEPEST:
            raise _Damaged(f"holds an element of type {kind} at depth {depth} where an array belongs")
        self._count(AN_ARRAY)
        if count == 0:
            return
        array_class, complex_part = self._class(stream)
        plain, nested = PLAIN_PARTS[array_class], array_class in HOLDS_ARRAYS
        plain += complex_part and not nested and array_class != 4
        left, number = count - 16, -1 if array_class == OPAQUE else -2  # dimensions, name; an object has no dimensions
        texts: dict[int, bytes] = {}
        size = 0
        while left > 0:
            kind, follows, small = self.tag(stream)
            padded = follows + (-follows % 8)
            left -= 8 + padded
            if left < 0:
                raise _Damaged("holds an element that reaches beyond its array")
            if nested and number >= plain:
                self.array(stream, kind, follows, depth + 1)
            elif kind not in BYTES:
                raise _Damaged(f"holds an element of the unknown type {kind}")
            elif number < 0 or nested:
                texts[number] = small + _short(stream, follows, padded)
                if number == -2 and array_class != SPARSE:
                    size = self._size(texts[-2])
                    self._count(size)
            else:
                self._count(max(0, follows // BYTES[kind] - size))
                stream.skip(padded)
            number += 1
        if number < plain or (number > plain and not nested):
            raise _Damaged(f"holds an array of class {array_class} with {number} parts in place of {plain}")
        if array_class == OPAQUE and depth == 0:
            self.objects.append(texts.get(-1, b"").decode("ascii", "replace"))
        if array_class in (CELL, STRUCT, OBJECT):
            self._require_parts(texts, array_class, number - plain)

    def _class(self, stream: _Plain | _Inflated) -> tuple[int, bool]:
        """What kind of array follows, and whether it has an imaginary part."""
        kind, count, _ = self.tag(stream)
        if kind != 6 or count != 8:
            raise _Damaged("holds an array without its class")
        flags = struct.unpack(f"{self.order}II", stream.read(8))[0]
        if flags & 0xFF not in PLAIN_PARTS:
            raise _Damaged(f"holds an array of the unknown class {flags & 0xFF}")
        return flags & 0xFF, bool(flags & COMPLEX)

    def _size(self, dimensions: bytes) -> int:
        sizes = struct.unpack(f"{self.order}{len(dimensions) // 4}i", dimensions[: len(dimensions) // 4 * 4])
        if any(size < 0 for size in sizes):
            raise _Damaged(f"holds an array of the dimensions {' x '.join(map(str, sizes[:4]))}")
        return math.prod(sizes)

    def _count(self, cells: int) -> None:
        self.cells += cells
        self.budget.require(self.cells)

    def _require_parts(self, texts: dict[int, bytes], array_class: int, parts: int) -> None:
        """Refuse cells and structs that hold another number of arrays than their dimensions say."""
        fields = 1
        if array_class != CELL:
            length, names = texts[PLAIN_PARTS[array_class] - 2], texts[PLAIN_PARTS[array_class] - 1]
            each = int.from_bytes(length[:4], "little" if self.order == "<" else "big")
            fields = len(names) // each if each else 0
        if parts != self._size(texts[-2]) * fields:
            raise _Damaged(f"holds {parts} arrays where the dimensions of a struct or cell say otherwise")


def _short(stream: _Plain | _Inflated, count: int, padded: int) -> bytes:
    """An element of text or dimensions; a longer one than these are is passed over."""
    if count < PIECE:
        return stream.read(padded)[:count]
    stream.skip(padded)
    return b""
