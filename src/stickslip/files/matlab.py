"""MATLAB: v4, v5 to v7 (scipy) and v7.3 (HDF5). Vectors are columns, matrices several, scalars constants."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from stickslip.errors import FormatError
from stickslip.files import hdf5
from stickslip.files.matlab_elements import check_version_5
from stickslip.files.table import Array, Column, Options, Table, optional, reading, slices
from stickslip.files.titles import path_parts

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
