"""Parquet: numeric columns, read by batches of rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import FormatError
from stickslip.files.table import LISTED, Block, Column, Options, Table, optional, reading
from stickslip.record.metadata import KEY, parse_metadata

NAME = "Parquet"
SUFFIXES = (".parquet", ".pq")


def recognise(path: Path, head: bytes) -> bool:
    """By the mark at the start."""
    return head.startswith(b"PAR1")


def read(path: Path, options: Options) -> Table:
    """The numeric columns, and dates as seconds since the first; of lists as long as the first one a column each.

    Robots' logs (LeRobot's) hold a row of numbers for all joints in a cell: ``observation.state`` is read as
    ``observation.state.0``, ``observation.state.1`` ...
    """
    types = optional("pyarrow.types")
    columns: list[Column] = []
    left_out: list[str] = []
    record: Mapping[str, Any] = {}
    lists: dict[str, tuple[str, int]] = {}
    with _opened(path) as file:
        rows, schema = int(file.metadata.num_rows), file.schema_arrow
        if (schema.metadata or {}).get(KEY.encode()):
            record = parse_metadata(schema.metadata[KEY.encode()])
        for field in schema:
            kind = field.type
            dates = types.is_timestamp(kind) or types.is_duration(kind)
            if dates or types.is_floating(kind) or types.is_integer(kind) or types.is_boolean(kind):
                unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
                columns.append(Column(field.name, "s" if dates else unit or None, rows))
            elif length := _length(file, field, types):
                parts = {f"{field.name}.{place}": (field.name, place) for place in range(length)}
                columns += [Column(name, None, rows) for name in parts]
                lists |= parts
            else:
                left_out.append(f"{field.name} ({kind})")
    names = [column.name for column in columns]
    if not columns or rows == 0 or len(set(names)) < len(names):
        raise FormatError(
            f"'{path.name}' has {rows} rows and the numeric columns {', '.join(names) or '(none)'}",
            "a record needs rows, and columns of different names",
            "write the file again",
        )

    def blocks(wanted: Sequence[str], size: int) -> Iterator[Block]:
        origins: dict[str, Any] = {}
        count = 0
        with _opened(path) as file:
            whole = list(dict.fromkeys(lists.get(name, (name, 0))[0] for name in wanted))
            for batch in file.iter_batches(batch_size=size, columns=whole, use_threads=False):
                count += len(batch)
                yield {name: _column(batch, name, lists, origins) for name in wanted}
        if count != rows:
            raise FormatError(
                f"'{path.name}' holds {count} of {rows} rows",
                "a file is read whole or not at all",
                "write the file again",
            )

    notes = (f"not numbers, left out: {', '.join(left_out)}",) if left_out else ()
    return Table(tuple(columns), blocks, notes=notes, record=record)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    parquet = optional("pyarrow.parquet")
    # pyarrow takes no path that is not UTF-8
    with reading(path, NAME), path.open("rb") as handle, parquet.ParquetFile(handle, pre_buffer=False) as file:
        yield file


def _length(file: Any, field: Any, types: Any) -> int:
    """How many numbers each cell of a column of lists holds, by its type or its first row; 0 where it holds none."""
    kind = field.type
    if not (types.is_list(kind) or types.is_fixed_size_list(kind)):
        return 0
    if not (types.is_floating(kind.value_type) or types.is_integer(kind.value_type)):
        return 0
    if types.is_fixed_size_list(kind):
        return int(min(kind.list_size, LISTED))
    first = next(file.iter_batches(batch_size=1, columns=[field.name], use_threads=False), None)
    cell = None if first is None or not len(first) else first.column(0)[0].as_py()
    return len(cell) if cell and len(cell) <= LISTED else 0


def _column(batch: Any, name: str, lists: Mapping[str, tuple[str, int]], origins: dict[str, Any]) -> Array:
    """A column of a batch, or a place of one of lists."""
    if name not in lists:
        return _numbers(batch.column(name), name, origins)
    own, place = lists[name]
    compute = optional("pyarrow.compute")
    return _numbers(compute.list_element(batch.column(own), place), name, origins)


def _numbers(values: Any, name: str, origins: dict[str, Any]) -> Array:
    """The batch as float64, what is missing as NaN; dates as seconds since the first of all."""
    array = values.to_numpy(zero_copy_only=False)
    if array.dtype.kind == "M":
        origin = origins.setdefault(name, array[0])
        array = (array - origin) / np.timedelta64(1, "ns") * 1e-9
    elif array.dtype.kind == "m":
        array = array / np.timedelta64(1, "ns") * 1e-9
    return np.asarray(array, dtype=np.float64)
