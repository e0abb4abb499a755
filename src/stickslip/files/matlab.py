"""MATLAB: v4, v5 to v7 (scipy) and v7.3 (HDF5). Vectors are columns, matrices several, scalars constants."""

from __future__ import annotations

import math
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import FormatError
from stickslip.files import hdf5
from stickslip.files.select import path_parts
from stickslip.files.table import Budget, Column, Options, Table, optional, reading, slices

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
            size = int.from_bytes(length[:4], "little" if self.order == "<" else "big")
            fields = len(names) // size if size else 0
        if parts != self._size(texts[-2]) * fields:
            raise _Damaged(f"holds {parts} arrays where the dimensions of a struct or cell say otherwise")


def _short(stream: _Plain | _Inflated, count: int, padded: int) -> bytes:
    """An element of text or dimensions; a longer one than these are is passed over."""
    if count < PIECE:
        return stream.read(padded)[:count]
    stream.skip(padded)
    return b""


NAME = "MATLAB"
SUFFIXES = (".mat",)

SIZES_V4 = (8, 4, 4, 2, 2, 1)  # bytes of a number, by its type in MAT version 4
AN_OBJECT = "an object, such as a table or datetime"
NUMERIC = ("double", "single", "int", "uint", "logical")
SAVE_PLAIN = (
    "in MATLAB save it as plain arrays, for instance t = seconds(T.Time - T.Time(1)); x = T.x; save('run.mat','t','x')"
)


def recognise(path: Path, head: bytes) -> bool:
    """By the header's first words; version 4 has none and is recognised by its suffix and a sensible first header."""
    if head.startswith(b"MATLAB 5.0") or _is_v73(head):
        return True
    return path.suffix.lower() in SUFFIXES and _order_v4(head[:20]) is not None


def read(path: Path, options: Options) -> Table:
    """The numeric variables, structs flattened with dots; what is neither is named in the notes."""
    with path.open("rb") as file:
        head = file.read(1024)
    if _is_v73(head):
        return _read_v73(path)
    return _read_v5(path, head)


def _is_v73(head: bytes) -> bool:
    """HDF5 behind MATLAB's own header (early versions call themselves 7.0)."""
    return head.startswith(b"MATLAB 7.") and hdf5.SIGNATURE in head[128:]


# ---- versions 4 and 5


def _read_v5(path: Path, head: bytes) -> Table:
    from scipy.io import loadmat

    objects: list[str] = []
    if head.startswith(b"MATLAB"):
        objects = check_version_5(path)
    else:
        with path.open("rb") as file:
            for end in _elements_v4(file):
                _require_end(path, end)
    with reading(path, NAME), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "duplicate variable name": objects share one; they are reported below
        variables = loadmat(path, struct_as_record=True, squeeze_me=False)
    arrays: dict[str, Array] = {}
    constants: dict[str, float] = {}
    left_out = [f"{name} ({AN_OBJECT})" for name in objects if name]
    for name, value in _flat({key: value for key, value in variables.items() if not key.startswith("__")}):
        reason = _refusal(value)
        if reason is not None:
            left_out += [] if name == "None" else [f"{name} ({reason})"]  # scipy's name for all objects together
        elif value.size == 1:
            constants[name] = float(value.item())
        else:
            for column, axis, line, _ in hdf5.matrix_lines(name, value.shape, square=0):
                lines = value if axis == 0 else value.T
                arrays[column] = np.asarray(lines if line is None else lines[:, line], dtype=np.float64)
    columns = hdf5.with_rate([Column(name, rows=len(values)) for name, values in arrays.items()], constants)
    _require_columns(path, columns, left_out)
    return Table(columns, slices(arrays), constants, _notes(left_out))


def _flat(variables: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in variables.items():
        if type(value) is np.ndarray and value.dtype.names is not None and value.size == 1:
            fields = value.ravel()[0]
            yield from _flat({f"{name}.{field}": fields[field] for field in value.dtype.names})
        else:
            yield name, value


def _refusal(value: Any) -> str | None:
    """What a variable is, if it is no array of numbers."""
    from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

    if isinstance(value, (MatlabOpaque, MatlabObject)):
        return AN_OBJECT
    if isinstance(value, MatlabFunction):
        return "a function"
    if not isinstance(value, np.ndarray):
        return "sparse"
    if value.dtype.kind in "OV":
        return "a cell array" if value.dtype.names is None else "an array of structs"
    return _refusal_of(value.dtype, value.shape)


def _refusal_of(dtype: np.dtype[Any], shape: tuple[int, ...]) -> str | None:
    if dtype.kind not in "fiub":
        return {"c": "complex", "U": "text", "S": "text"}.get(dtype.kind, str(dtype))
    if 0 in shape:
        return "empty"
    if len(shape) > 2:
        return f"of {len(shape)} dimensions"
    if len(shape) == 2 and min(shape) > hdf5.WIDEST:
        return f"a matrix of {shape[0]} x {shape[1]}"
    return None


def _order_v4(header: bytes) -> str | None:
    """Byte order of a version 4 header, or None if it is not one."""
    if len(header) < 20:
        return None
    for order, kinds in (("<", range(100)), (">", range(1000, 1100))):
        kind, rows, columns, imaginary, name = struct.unpack(f"{order}5i", header)
        known = kind in kinds and kind // 10 % 10 < len(SIZES_V4) and kind % 10 < 3
        if known and rows >= 0 and columns >= 0 and imaginary in (0, 1) and 0 < name < 1000:
            return order
    return None


def _elements_v4(file: BinaryIO) -> Iterator[int]:
    while header := file.read(20):
        start = file.tell()
        order = _order_v4(header)
        if order is None:
            yield start + 20
            return
        kind, rows, columns, imaginary, name = struct.unpack(f"{order}5i", header)
        end = start + name + rows * columns * SIZES_V4[kind // 10 % 10] * (1 + imaginary)
        yield end
        file.seek(end)


def _require_end(path: Path, end: int) -> None:
    size = path.stat().st_size
    if end > size:
        raise FormatError(
            f"'{path.name}' is cut off: a variable ends at byte {end}, the file at {size}",
            "only whole variables are read",
            "copy the file again from its source",
        )


# ---- version 7.3


def _read_v73(path: Path) -> Table:
    h5py = optional("h5py")
    columns: list[Column] = []
    sources: dict[str, hdf5.Source] = {}
    constants: dict[str, float] = {}
    left_out: list[str] = []
    links: list[str] = []
    hdf5.check_heaps(path)
    with reading(path, NAME), h5py.File(path, "r") as file:
        for place, dataset in hdf5.datasets(file, links):
            if place.startswith("#"):  # MATLAB's own store of what cells and objects refer to
                continue
            name = ".".join(path_parts(place))
            reason = _refusal_v73(dataset)
            if reason is not None:
                left_out.append(f"{name} ({reason})")
            elif dataset.size == 1:
                constants[name] = float(dataset[()].item())
            else:
                for column, axis, line, rows in hdf5.matrix_lines(name, dataset.shape, square=1):
                    columns.append(Column(column, rows=rows))
                    sources[column] = hdf5.Source(dataset.name, None, axis, line)
    _require_columns(path, tuple(columns), left_out)
    return hdf5.table(path, columns, sources, constants, [*_notes(left_out), *links])


def _refusal_v73(dataset: Any) -> str | None:
    kind = dataset.attrs.get("MATLAB_class", b"")
    kind = kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)
    if "MATLAB_object_decode" in dataset.attrs or "MATLAB_sparse" in dataset.parent.attrs:
        return "sparse" if "MATLAB_sparse" in dataset.parent.attrs else AN_OBJECT
    if "MATLAB_empty" in dataset.attrs:
        return "empty"
    if dataset.dtype.kind == "O":
        return "a cell array" if kind == "cell" else "an array of structs"
    if kind == "char":
        return "text"
    if kind and not kind.startswith(NUMERIC):
        return f"of class {kind}"
    if dataset.dtype.names == ("real", "imag"):
        return "complex"
    return _refusal_of(dataset.dtype, dataset.shape) or hdf5.refusal(dataset)


# ---- both


def _notes(left_out: list[str]) -> tuple[str, ...]:
    return (f"not arrays of numbers, left out: {', '.join(left_out)}",) if left_out else ()


def _require_columns(path: Path, columns: tuple[Column, ...], left_out: list[str]) -> None:
    if columns:
        return
    objects = any("object" in reason for reason in left_out)
    raise FormatError(
        f"'{path.name}' holds no plain array of numbers (it holds {', '.join(left_out[:8]) or 'nothing'})",
        "tables, timetables, datetimes, cells and text of MATLAB are not read" if objects else "a column is an array",
        SAVE_PLAIN if objects else "save the channels as numeric vectors",
    )
