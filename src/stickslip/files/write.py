"""write_record: a Record with its history as CSV, HDF5 or Parquet, whole or not at all."""

from __future__ import annotations

import errno
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from stickslip.arrays import Array
from stickslip.errors import FormatError, ModelError
from stickslip.files.table import Table, optional
from stickslip.record.metadata import (
    BEFORE,
    BEGINS,
    KEY,
    OF,
    Digests,
    checksum,
    described_beside,
    read_beside,
    record_to_metadata,
    time_column,
    units_of,
)
from stickslip.record.record import Record, require_record
from stickslip.whole import whole_file

ROWS_AT_ONCE = 200_000
SLACK = 1 << 17  # bytes that HDF5 takes beside the samples and their description
Columns = dict[str, tuple[str, Array]]


def write_record(record: Record, path: str | Path, *, overwrite: bool = False) -> Path:
    """Write a record, with its channels, clock, history and truth, so that read_record gives it back exactly.

    The format follows the suffix: ``.csv`` (plain, with ``name [unit]`` headers, as Excel and pandas read it; history
    and truth in ``NAME.csv.json`` beside it), ``.h5``/``.hdf5`` (one dataset a channel) or ``.parquet``. Time [s] is
    written as a column of its own, for other programs. The file appears whole or not at all.

    Parameters
    ----------
    record : Record
        The record to keep.
    path : str or Path
        Where to; the folder exists already.
    overwrite : bool, optional
        Whether a file that is there already may be replaced; it could be the measurement itself.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    ModelError
        The suffix names no format that can be written.
    FormatError
        The file is there already, or the folder can not be written to.

    Examples
    --------
    >>> import tempfile
    >>> import stickslip as ss
    >>> record = ss.Record.of({"x": [0.1, 0.2, 0.4]}, fs=50.0, units={"x": "mm"})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     ss.read_record(ss.write_record(record, folder + "/slide.csv")).equals(record)
    True
    """
    require_record(record)
    path = Path(path)
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise ModelError(
            f"'{path.name}' ends in '{path.suffix}'",
            f"a record is written as {', '.join(WRITERS)}",
            "choose one of these endings",
        )
    beside = described_beside(path) if writer is _write_csv else None
    for file in () if overwrite else (path, *filter(None, [beside])):
        require_free(file)
    columns = {time_column(record): ("s", record.time)}
    columns |= {name: (record.channels[name].unit, values) for name, values in record.samples.items()}
    metadata = json.dumps(record_to_metadata(record))
    if beside is not None:
        return _write_with_beside(path, beside, columns, metadata, overwrite=overwrite)
    with whole(path, replace=overwrite) as part:
        writer(part, columns, metadata)
    return path


def _write_with_beside(path: Path, beside: Path, columns: Columns, metadata: str, *, overwrite: bool) -> Path:
    """A text file and the one beside it, which is there first and tells of both until the new numbers are there."""
    before = read_beside(path) if overwrite and path.exists() else {}
    new = False
    try:
        with whole(path, replace=overwrite) as part:
            _write_csv(part, columns, metadata)
            _describe(beside, metadata, {OF: checksum(part), BEFORE: before} if before else {}, replace=overwrite)
            new = not before
    except BaseException:
        if new:
            beside.unlink(missing_ok=True)
        raise
    if before:
        _describe(beside, metadata, {}, replace=True)
    return path


def _describe(path: Path, metadata: str, more: dict[str, Any], *, replace: bool) -> None:
    """Write the file beside a text file."""
    added = "".join(f", {json.dumps(key)}: {json.dumps(value)}" for key, value in more.items())
    with whole(path, replace=replace) as part:
        part.write_text(f"{BEGINS}{metadata}{added}}}\n", "utf-8")


@contextmanager
def whole(path: Path, *, replace: bool = True) -> Iterator[Path]:
    """A path to write to that becomes `path` when all went well, and vanishes when not."""
    try:
        with whole_file(path, replace=replace) as draft:
            yield draft
    except FileExistsError as error:
        raise _taken(path) from error
    except OSError as error:
        raise FormatError(
            f"'{path.name}' can not be written ({error.strerror or error})",
            "the folder exists and may be written to",
            "choose another place",
        ) from error


def require_free(path: Path) -> None:
    """Refuse to replace a file that is there."""
    if path.exists():
        raise _taken(path)


def _taken(path: Path) -> FormatError:
    return FormatError(
        f"'{path.name}' is there already", "no file is replaced unasked", "choose another name, or overwrite=True"
    )


def _write_csv(path: Path, columns: Columns, _: str) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(f"{name} [{unit}]" for name, (unit, _) in columns.items()) + "\n")
        rows = len(next(iter(columns.values()))[1])
        for first in range(0, rows, ROWS_AT_ONCE):
            # repr gives the shortest digits that are the same float again
            part = (map(repr, values[first : first + ROWS_AT_ONCE].tolist()) for _, values in columns.values())
            file.writelines(f"{','.join(row)}\n" for row in zip(*part, strict=True))


def _write_hdf5(path: Path, columns: Columns, metadata: str) -> None:
    _require_room(path, sum(values.nbytes for _, values in columns.values()) + len(metadata))
    with _hdf5(path) as file:
        file.attrs[KEY] = metadata
        for name, (unit, values) in columns.items():
            file.create_dataset(name, data=values).attrs["unit"] = unit


@contextmanager
def _hdf5(path: Path) -> Iterator[Any]:
    """A file of HDF5 that is written; what it raises of a disk that takes no more is an OSError."""
    h5py = optional("h5py")
    try:
        with h5py.File(path, "w", libver="latest") as file:  # only this layout lets an attribute pass 64 KiB
            yield file
    except RuntimeError as error:  # what was left to write can not be, as it is closed
        raise OSError(errno.ENOSPC, "the disk takes no more") from error


def _require_room(path: Path, size: int) -> None:
    """Refuse a file that the disk has no room for: HDF5 may not tell of it, and break down as the program ends."""
    free = shutil.disk_usage(path.parent).free
    if free < size + SLACK:
        raise FormatError(
            f"'{path.name}' takes {size / 1e6:.3g} MB, and {free / 1e6:.3g} MB are free",
            "a record is written whole or not at all",
            "make room, or choose another disk",
        )


def write_table(table: Table, path: Path) -> Path:
    """A described table of any length as HDF5, block by block: what a journal becomes.

    Parameters
    ----------
    table : Table
        With the description of the record, of a journal.
    path : Path
        Where to; ends in .h5 or .hdf5.

    Returns
    -------
    Path

    Raises
    ------
    FormatError
        The file is there already, or the disk can not be written.
    """
    require_free(path)
    units, digests = units_of(table.record), Digests()
    rows = int(table.record["rows"])
    with ExitStack() as stack:
        part = stack.enter_context(whole(path, replace=False))
        _require_room(part, 8 * rows * len(units) + len(json.dumps(table.record)))
        file = stack.enter_context(_hdf5(part))
        for name, unit in units.items():
            file.create_dataset(name, shape=(rows,), dtype="<f8").attrs["unit"] = unit
        first = 0
        for block in table.blocks(list(units), ROWS_AT_ONCE):
            count = len(next(iter(block.values())))
            for name, values in block.items():
                file[name][first : first + count] = values
            digests.add(block)
            first += count
        file.attrs[KEY] = json.dumps({**table.record, "sha256": digests.sums()})
    return path


def _write_parquet(path: Path, columns: Columns, metadata: str) -> None:
    arrow, parquet = optional("pyarrow"), optional("pyarrow.parquet")
    fields = [arrow.field(name, arrow.float64(), metadata={"unit": unit}) for name, (unit, _) in columns.items()]
    schema = arrow.schema(fields, metadata={KEY: metadata})
    table = arrow.Table.from_arrays([arrow.array(values) for _, values in columns.values()], schema=schema)
    with path.open("wb") as file:  # pyarrow takes no path that is not UTF-8
        parquet.write_table(table, file, row_group_size=ROWS_AT_ONCE)


WRITERS: dict[str, Callable[[Path, Columns, str], None]] = {
    ".csv": _write_csv,
    ".h5": _write_hdf5,
    ".hdf5": _write_hdf5,
    ".parquet": _write_parquet,
}


def require_form(form: str) -> None:
    """Refuse a format of records, as "csv", that is not written."""
    if f".{form}" not in WRITERS:
        raise ModelError(f"a record as '{form}'", f"it is written as {', '.join(w[1:] for w in WRITERS)}", "choose one")
