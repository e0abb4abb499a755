"""HDF5: every one-dimensional set of numbers is a column; nothing outside the file is ever opened."""

from __future__ import annotations

import math
import mmap
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import FormatError
from stickslip.files.table import FREE, Block, Column, Options, Table, optional, reading
from stickslip.record.metadata import KEY, parse_metadata

NAME = "HDF5"
SUFFIXES = (".h5", ".hdf5", ".hdf", ".he5", ".nc")

SIGNATURE = b"\x89HDF\r\n\x1a\n"
HEAP = b"GCOL\x01\0\0\0"  # begins a global heap: of texts whose length varies
WIDEST = 512  # a matrix wider than this both ways is an image, not a table of channels
COMPRESSION = 2000  # no filter of HDF5 shrinks numbers further; a larger claim was never written
LARGEST_CHUNK = 8 * FREE  # bytes: a chunk is unpacked whole
CHUNK_CACHE = 2**25  # bytes: columns of one matrix share its chunks

UNIT_WORDS = ("unit", "units", "Unit", "Units", "unit_string")
RATE_WORDS = ("fs", "Fs", "sampling_rate", "sample_rate", "sampling_frequency")
STEP_WORDS = ("dt", "sampling_interval")


@dataclass(frozen=True)
class Source:
    """Where a column's samples lie: a dataset, in it a field, or one line of a matrix along `axis`."""

    path: str
    field: str | None = None
    axis: int = 0
    line: int | None = None

    def read(self, file: Any, rows: slice) -> Array:
        dataset = file[self.path]
        if self.field is not None:
            dataset = dataset.fields(self.field)
        if self.line is None:
            values = dataset[rows]
        else:
            values = dataset[rows, self.line] if self.axis == 0 else dataset[self.line, rows]
        return np.asarray(values, dtype=np.float64)


def recognise(path: Path, head: bytes) -> bool:
    """By the signature, at the start or after a user block."""
    return not head.startswith(b"MATLAB") and any(head[at : at + 8] == SIGNATURE for at in (0, 512, 1024, 2048))


def read(path: Path, options: Options) -> Table:
    """The numeric sets as columns named by their paths; single numbers as constants."""
    h5py = optional("h5py")
    columns: list[Column] = []
    sources: dict[str, Source] = {}
    constants: dict[str, float] = {}
    notes: list[str] = []
    record: Mapping[str, Any] = {}
    check_heaps(path)
    with reading(path, NAME), h5py.File(path, "r") as file:
        if KEY in file.attrs:
            kept = _value(file.attrs, KEY)
            record = parse_metadata(kept if isinstance(kept, str) else "")
        constants |= _numbers(file.attrs)
        for name, dataset in datasets(file, notes):
            reason = refusal(dataset)
            if reason is None and dataset.size == 1 and dataset.dtype.names is None and not record:
                constants[name] = float(dataset[()].item())
                continue
            if reason is not None:
                notes.append(f"'{name}' is not a column: it {reason}")
                continue
            fs, unit = _rate(dataset), _unit(dataset.attrs)
            for column, source, rows in _lines(name, dataset):
                columns.append(Column(column, unit, rows, fs))
                sources[column] = source
    return table(path, columns, sources, constants, notes, record)


def check_heaps(path: Path) -> None:
    """Refuse a file with a heap of texts in which a free piece has no length: HDF5 would look behind it for ever."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        begin = data.find(HEAP)
        while begin >= 0:
            end = min(begin + int.from_bytes(data[begin + 8 : begin + 16], "little"), len(data))
            at = begin + 16
            while at + 16 <= end:
                index, _, length = struct.unpack("<HH4xQ", data[at : at + 16])
                if index == 0 and length == 0:
                    raise FormatError(
                        f"'{path.name}' is damaged near byte {at}",
                        "each piece of a heap of HDF5 has a length",
                        "copy it again from its source",
                    )
                at += length if index == 0 else 16 + length + -length % 8
            begin = data.find(HEAP, begin + 1)


def table(
    path: Path,
    columns: Sequence[Column],
    sources: Mapping[str, Source],
    constants: Mapping[str, float],
    notes: Sequence[str],
    record: Mapping[str, Any] | None = None,
) -> Table:
    """The Table of a file of HDF5 whose columns lie at `sources`, read in blocks."""
    if not columns:
        raise FormatError(
            f"'{path.name}' holds no column of numbers" + "".join(f"; {note}" for note in notes[:3]),
            "a record needs plain numeric arrays",
            "save the channels as plain arrays",
        )
    lengths = {column.name: column.rows or 0 for column in columns}

    def blocks(names: Sequence[str], size: int) -> Iterator[Block]:
        h5py = optional("h5py")
        rows = min((lengths[name] for name in names), default=0)
        with reading(path, NAME), h5py.File(path, "r", rdcc_nbytes=CHUNK_CACHE) as file:
            for first in range(0, rows, size):
                part = slice(first, min(first + size, rows))
                yield {name: sources[name].read(file, part) for name in names}

    return Table(with_rate(columns, constants), blocks, dict(constants), tuple(notes), record or {})


def datasets(file: Any, notes: list[str]) -> Iterator[tuple[str, Any]]:
    """Each dataset of the file once, by path; links are reported, never followed."""
    h5py = optional("h5py")
    seen = {h5py.h5o.get_info(file.id).addr}

    def walk(group: Any, prefix: str) -> Iterator[tuple[str, Any]]:
        for name in group:
            path = prefix + name
            link = group.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink):
                target = "another file" if isinstance(link, h5py.ExternalLink) else "another place in the file"
                notes.append(f"'{path}' is a link to {target} and was not followed")
                continue
            item = group[name]
            address = h5py.h5o.get_info(item.id).addr
            if address in seen:
                continue
            seen.add(address)
            if isinstance(item, h5py.Group):
                yield from walk(item, path + "/")
            elif isinstance(item, h5py.Dataset):
                yield path, item

    yield from walk(file, "")


def refusal(dataset: Any) -> str | None:
    """Why a dataset can not be columns of numbers, in words; None if it can."""
    kinds = dataset.dtype.fields.values() if dataset.dtype.names else [(dataset.dtype,)]
    if dataset.shape is None or dataset.size == 0:
        return "is empty"
    if dataset.is_virtual or dataset.external:
        return "keeps its numbers in another file, which is never opened"
    if not any(_real(kind[0]) for kind in kinds):
        return f"holds {'text' if dataset.dtype.kind in 'SOU' else dataset.dtype}"
    if dataset.ndim > (1 if dataset.dtype.names else 2):
        return f"has {dataset.ndim} dimensions"
    if dataset.ndim == 2 and min(dataset.shape) > WIDEST:
        return f"is a matrix of {dataset.shape[0]} x {dataset.shape[1]}"
    if dataset.chunks and math.prod(dataset.chunks) * dataset.dtype.itemsize > LARGEST_CHUNK:
        return f"is stored in chunks of {' x '.join(map(str, dataset.chunks))}, larger than {LARGEST_CHUNK} bytes"
    if dataset.nbytes > COMPRESSION * dataset.id.get_storage_size() + 2**20:
        return f"claims {dataset.size} values but stores {dataset.id.get_storage_size()} bytes"
    return None


def matrix_lines(name: str, shape: tuple[int, ...], square: int) -> Iterator[tuple[str, int, int | None, int]]:
    """The columns of an array: name, axis along which time runs, line across it, number of samples.

    Time runs along the longer side; along axis `square` where both are equal.
    """
    if len(shape) == 1:
        yield name, 0, None, shape[0]
        return
    axis = square if shape[0] == shape[1] else int(shape[1] > shape[0])
    for line in range(shape[1 - axis]):
        yield (name if shape[1 - axis] == 1 else f"{name}_{line + 1}"), axis, line, shape[axis]


def _lines(name: str, dataset: Any) -> Iterator[tuple[str, Source, int]]:
    if dataset.dtype.names is not None:
        for field in dataset.dtype.names:
            if _real(dataset.dtype.fields[field][0]):
                yield f"{name}.{field}", Source(dataset.name, field), dataset.shape[0]
        return
    for column, axis, line, rows in matrix_lines(name, dataset.shape, square=0):
        yield column, Source(dataset.name, None, axis, line), rows


def _real(dtype: np.dtype[Any]) -> bool:
    return dtype.kind in "fiub" and dtype.shape == ()


def _value(attributes: Any, name: str) -> float | str | None:
    """A number or a text; None of an attribute of any other type.

    HDF5 is not asked to read those: by a list of a damaged type it reads outside its memory, and the process dies.
    """
    h5t = optional("h5py").h5t
    attribute = attributes.get_id(name)
    known = (h5t.INTEGER, h5t.FLOAT, h5t.STRING)
    if attribute.shape not in ((), (1,)) or attribute.get_type().get_class() not in known:
        return None
    value = np.asarray(attributes[name]).item()
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def _numbers(attributes: Any) -> dict[str, float]:
    values = {name: _value(attributes, name) for name in attributes}
    return {name: float(value) for name, value in values.items() if isinstance(value, (int, float, np.floating))}


def _unit(attributes: Any) -> str | None:
    texts = (_value(attributes, word) for word in UNIT_WORDS if word in attributes)
    return next((text.strip() for text in texts if isinstance(text, str) and text.strip()), None)


def _rate(dataset: Any) -> float | None:
    """Sampling rate [Hz] from the attributes of the dataset, its group, or the file."""
    places = (dataset, dataset.parent, dataset.file)
    return next((rate for place in places if (rate := stated_rate(_numbers(place.attrs)))), None)


def stated_rate(numbers: Mapping[str, float]) -> float | None:
    """The sampling rate [Hz] among named numbers, by the names in use."""
    rates = [numbers[word] for word in RATE_WORDS if word in numbers]
    rates += [1 / numbers[word] for word in STEP_WORDS if numbers.get(word, 0.0) > 0]
    return next((rate for rate in rates if np.isfinite(rate) and rate > 0), None)


def with_rate(columns: Sequence[Column], constants: Mapping[str, float]) -> tuple[Column, ...]:
    """The columns, those without a rate at the one that stands among the file's constants."""
    rate = stated_rate(constants)
    return tuple(replace(column, fs=rate) if column.fs is None else column for column in columns)
