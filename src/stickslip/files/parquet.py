"""Parquet: numeric columns, read by batches of rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import FormatError
from stickslip.files.table import Array, Block, Column, Options, Table, optional, reading
from stickslip.record.metadata import KEY, parse_metadata

NAME = "Parquet"
SUFFIXES = (".parquet", ".pq")


def recognise(path: Path, head: bytes) -> bool:
    """By the mark at the start."""
    return head.startswith(b"PAR1")


def read(path: Path, options: Options) -> Table:
    """The numeric columns, and dates as seconds since the first."""
    types = optional("pyarrow.types")
    columns: list[Column] = []
    left_out: list[str] = []
    record: Mapping[str, Any] = {}
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
            for batch in file.iter_batches(batch_size=size, columns=list(wanted), use_threads=False):
                count += len(batch)
                yield {name: _numbers(batch.column(name), name, origins) for name in wanted}
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


def _numbers(values: Any, name: str, origins: dict[str, Any]) -> Array:
    """The batch as float64, what is missing as NaN; dates as seconds since the first of all."""
    array = values.to_numpy(zero_copy_only=False)
    if array.dtype.kind == "M":
        origin = origins.setdefault(name, array[0])
        array = (array - origin) / np.timedelta64(1, "ns") * 1e-9
    elif array.dtype.kind == "m":
        array = array / np.timedelta64(1, "ns") * 1e-9
    return np.asarray(array, dtype=np.float64)
