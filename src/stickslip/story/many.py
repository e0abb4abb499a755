"""Hundreds of records, told in a few sentences and one table."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.answers.many import Batch, Row
from stickslip.errors import ModelError, RecordError
from stickslip.estimate import Estimate
from stickslip.figures.friction import plates_of_batch
from stickslip.story.findings import plain
from stickslip.story.story import Line, Story, Table
from stickslip.story.words import Caution, interval_of, value_of
from stickslip.whole import whole_file

LEADING = {  # of each question the quantities of the short table; of others those of most records
    "analyze": ("sliding friction", "stuck share of the time"),
    "decay": ("damping ratio", "dry friction displacement"),
}
NAMED = 3  # copies, and records that were left out, that are named in a sentence
WRITERS = {".csv": "to_csv", ".parquet": "to_parquet", ".xlsx": "to_excel"}
NEEDED = {".parquet": ("pyarrow", "io"), ".xlsx": ("openpyxl", "excel")}
TABLE = "table.csv"


def of_batch(batch: Batch) -> Story:
    """Many records."""
    leading = [name for name in LEADING.get(batch.question, batch.names[:2]) if batch.known(name)]
    remarked = any(not row.counts for row in batch.rows)
    rows = [
        (row.name, *(_cell(row, name) for name in leading), *([_remark(row)] if remarked else [])) for row in batch.rows
    ]
    table = Table("Records", ("record", *leading, *(["remark"] if remarked else [])), rows)
    return Story(
        f"{len(batch.rows)} records", list(_headline(batch, leading)), lines=[Line.of(e) for e in batch.estimates],
        notes=batch.notes, tables=[table], draw=lambda: plates_of_batch(batch), data=lambda: _data(batch),
        write=lambda folder: write_table(batch, folder / TABLE),
    )  # fmt: skip


def _headline(batch: Batch, leading: Sequence[str]) -> Iterator[str]:
    answered = sum(row.counts for row in batch.rows)
    ranges = [_range(name, batch.known(name)) for name in leading]
    said = f": {'; '.join(ranges)}" if ranges else ""
    yield f"{answered} of {len(batch.rows)} records answer{said}."
    copies = [row for row in batch.rows if row.same_as]
    if copies:
        yield Caution(
            _several(copies, "are copies of others", "is a copy of another", lambda row: f"{row.name} of {row.same_as}")
        )
    refused = [row for row in batch.rows if row.refusal]
    if refused:
        yield Caution(_several(refused, "give no answer", "gives no answer", lambda row: row.refusal.rstrip(".")))


def _range(name: str, estimates: Sequence[Estimate]) -> str:
    low, middle, high = (
        value_of(estimates[0], float(v)) for v in np.percentile([e.value for e in estimates], [0, 50, 100])
    )
    return f"{name} {low} to {high}, median {middle}, in {len(estimates)}"


def _several(rows: Sequence[Row], are: str, is_one: str, word: Any) -> str:
    named = "; ".join(word(row) for row in rows[:NAMED])
    more = f"; and {len(rows) - NAMED} more" if len(rows) > NAMED else ""
    return f"{len(rows)} {are if len(rows) > 1 else is_one}: {named}{more}."


def _cell(row: Row, name: str) -> str:
    estimate = next((estimate for estimate in row.estimates if estimate.name == name), None)
    if estimate is None or not estimate.known:
        return "-"
    return f"{value_of(estimate)} ({interval_of(estimate)})"


def _remark(row: Row) -> str:
    return f"copy of {row.same_as}" if row.same_as else "no answer" if row.refusal else ""


def _data(batch: Batch) -> Mapping[str, Any]:
    together = [estimate.to_dict() for estimate in batch.estimates]
    rows = [
        {"name": row.name, "sha256": row.key, "answer": row.answer, "refusal": row.refusal, "same_as": row.same_as,
         "normal_load": row.normal, "estimates": [estimate.to_dict() for estimate in row.estimates]}
        for row in batch.rows
    ]  # fmt: skip
    return {"comparison": {"estimates": together, "notes": plain(batch.notes)}, "records": plain(rows)}


def check_table(path: Path) -> None:
    """Refuse a table of no known kind, or whose program is not installed, before the work.

    Parameters
    ----------
    path : Path
        Ends in .csv, .parquet or .xlsx.

    Raises
    ------
    ModelError
        A suffix that is not known, or an optional package that is absent.

    Examples
    --------
    >>> check_table(Path("all.csv"))
    """
    if path.suffix not in WRITERS:
        raise ModelError(
            f"a table {path.name}", f"a table is written as {', '.join(WRITERS)}", "give a name that ends so"
        )
    package, extra = NEEDED.get(path.suffix, ("", ""))
    try:
        importlib.import_module(package or "pandas")
    except ImportError as absent:
        raise ModelError(
            f"{package} is not installed",
            f"{path.suffix} is written by it",
            f'pip install ".[{extra}]" in the checkout',
        ) from absent


def write_table(batch: Batch, path: Path) -> Path:
    """A row a record, as CSV, Parquet or Excel by the suffix.

    Parameters
    ----------
    batch : Batch
        The records.
    path : Path
        Ends in .csv, .parquet or .xlsx.

    Returns
    -------
    Path

    Raises
    ------
    ModelError
        Another suffix, or an optional package that is absent.
    RecordError
        The file can not be written.

    Examples
    --------
    >>> import tempfile
    >>> from stickslip.estimate import Estimate
    >>> level = Estimate.normal("sliding friction", 1.3, sd=0.1, unit="N", method="by hand")
    >>> batch = Batch.of("analyze", [Row("run.csv", "0", "It slides.", (level,))], ("displacement", "friction"))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_table(batch, Path(folder) / "all.csv").read_text()[:38]
    'file,answer,same as,sha256,normal load'
    """
    import pandas as pd

    check_table(path)
    frame = pd.DataFrame(batch.table())
    try:
        with whole_file(path) as draft:
            getattr(frame, WRITERS[path.suffix])(draft, index=False)
    except OSError as error:
        raise RecordError(
            f"{path} can not be written ({error.strerror or error})", "a table needs a place on a disk", "name another"
        ) from error
    return path
