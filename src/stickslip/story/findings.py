"""Findings told: what stands on every page of a record, around what its own family of answers says.

Plain estimates are told with the record that they were found in.

Hundreds of records are told in a few sentences and one table.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.answers.findings import Comparison, Findings, record_name
from stickslip.answers.many import Batch, Row
from stickslip.balance.impact import ImpactTest
from stickslip.errors import EstimateError, ModelError, RecordError, package
from stickslip.estimate import Estimate
from stickslip.figures.friction import plates_of_batch
from stickslip.files.write import require_form, write_record
from stickslip.record.record import Record
from stickslip.story.scope import of_findings as scope_of
from stickslip.story.story import Caution, Line, Story, Table, constant, flags, interval_of, leading, logged, value_of
from stickslip.whole import whole_file

# Which functions, of one record and of several, tell findings that hold a result of this name; others are friction's.
FAMILIES = {
    "decay": ("decay.of_findings", "decay.of_comparison"),
    "squeaks": ("squeak.of_findings", "squeak.of_comparison"),
    "joint": ("machines.of_joint", "machines.of_joints"),
    "tribometer": ("machines.of_tribometer", "machines.of_tribometers"),
}
FRICTION = ("friction.of_findings", "friction.of_comparison")


# What an engineer looks for first: these quantities lead the table, those without a value end it.
FIRST = (
    "coefficient of friction, plateau", "coefficient of friction, static",
    "sliding friction", "Coulomb friction", "viscous friction", "inertia", "friction coefficient",
    "static over sliding friction", "static friction forward", "static friction back", "stuck share of the time",
    "stops per cycle", "slope of friction against speed", "presliding stiffness", "contact stiffness",
    "forcing frequency", "sliding friction forward", "sliding friction back", "damping ratio",
    "damping ratio, whichever motion", "dry friction displacement", "dry friction force", "natural frequency",
    "static friction displacement",
)  # fmt: skip


def _place(estimate: Estimate) -> tuple[bool, int]:
    """Where a quantity stands in the table."""
    return not estimate.known, FIRST.index(estimate.name) if estimate.name in FIRST else len(FIRST)


def of_findings(findings: Findings, *, form: str = "") -> Story:
    """One record; in `form`, where one is named, its folder holds the record too."""
    record = findings.record
    own: Story = _family(findings, several=False)(findings)
    if form:
        require_form(form)
        file = f"record.{form}"
        own = replace(
            own, look=lambda: scope_of(findings, file), write=lambda folder: write_record(record, folder / file)
        )
    pressed = findings.normal
    load = {} if pressed is None else {"normal load": constant(pressed.value, pressed.sd, pressed.unit)}
    length = {"sampling rate": f"{record.fs:g} Hz", "length": f"{len(record)} samples, {record.duration:g} s"}
    return replace(
        own,
        headline=_headed(findings, own.headline),
        lines=[
            *(Line.of(estimate, findings.true_value(estimate)) for estimate in sorted(findings.quoted, key=_place)),
            *own.lines,
        ],
        faults=[str(fault) for fault in findings.faults],
        notes=[*findings.notes, *own.notes],
        settings={**own.settings, **load, **length},
        tables=[*own.tables, *logged(record)],
        channels=list(record.channels.values()),
        history=record.history,
        data=lambda: _data(findings, own),
    )


def _headed(findings: Findings, sentences: Sequence[str]) -> list[str]:
    """What is wrong with units before the answer; behind it where that names the mistake."""
    named = 1 if findings.contradiction else 0
    return [*sentences[:named], *leading(findings.faults), *sentences[named:]]


def of_comparison(comparison: Comparison) -> Story:
    """Several records side by side."""
    own: Story = _family(comparison.findings[0], several=True)(comparison)
    parts = [of_findings(finding) for finding in comparison.findings]
    estimates = comparison.estimates

    def data() -> dict[str, Any]:
        numbers = {**own.data(), "estimates": [estimate.to_dict() for estimate in estimates], "notes": comparison.notes}
        return {"comparison": plain(numbers), "records": [part.data() for part in parts]}

    return replace(own, lines=[*map(Line.of, estimates), *own.lines], notes=comparison.notes, parts=parts, data=data)


def _family(findings: Findings, *, several: bool) -> Callable[..., Story]:
    """What tells such findings, imported when it is needed."""
    tellers = next((tellers for name, tellers in FAMILIES.items() if name in findings.results), FRICTION)
    file, _, function = tellers[several].partition(".")
    teller: Callable[..., Story] = getattr(importlib.import_module(f"stickslip.story.{file}"), function)
    return teller


def _data(findings: Findings, own: Story) -> dict[str, Any]:
    data = {
        "name": findings.name,
        "faults": [str(fault) for fault in findings.faults],
        "settings": findings.settings,
        **own.data(),
        "estimates": [estimate.to_dict() for estimate in findings.estimates],
        "truth": findings.record.truth,
        "log": findings.record.log.entries() if findings.record.log is not None else {},
        "notes": findings.notes,
        "history": [step.to_dict() for step in findings.record.history],
    }
    return {key: plain(value) for key, value in data.items()}


def plain(value: Any) -> Any:
    """Plain JSON data of anything that settings, truth or history may hold; a number not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)


def of_one(estimate: Estimate, *, record: Record | None = None) -> Story:
    """An estimate by itself."""
    return of_several([estimate], record=record)


def of_tap(test: ImpactTest, *, record: Record | None = None) -> Story:
    """What rings after a tap, and whose resonance each is."""
    named = [f"{resonance.name} at {value_of(resonance.frequency)}" for resonance in test.resonances]
    many = f"{len(named)} resonance{'s' * (len(named) > 1)} ring{'s' * (len(named) == 1)} after the tap"
    lines = [
        Line.of(number, name=f"{quantity}, {resonance.name}")
        for resonance in test.resonances
        for quantity, number in (("frequency", resonance.frequency), ("damping ratio", resonance.damping))
    ]
    rows = [(resonance.name, ", ".join(resonance.channels), resonance.evidence) for resonance in test.resonances]
    content: dict[str, Any] = {
        "headline": [f"{many}: {'; '.join(named)}."], "lines": lines, "data": test.to_dict,
        "cautions": flags((line.name, test.status) for line in lines),
        "tables": [Table("Why each is called so", ("resonance", "seen by", "evidence"), rows, folded=True)],
    }  # fmt: skip
    return Story("Tap", **content) if record is None else Story.of_record(record_name(record), record, **content)


def of_several(estimates: Sequence[Estimate], *, record: Record | None = None) -> Story:
    """Estimates, and the faults of their record."""
    strangers = [type(item).__name__ for item in estimates if not isinstance(item, Estimate)]
    if strangers or not estimates:
        raise EstimateError(
            f"a report of {', '.join(strangers) or 'nothing'}",
            "a report is made of Findings, a Comparison, or Estimates",
            "pass analyze(record), compare(findings) or a list of estimates",
        )
    lines = [Line.of(estimate) for estimate in estimates]

    def data() -> dict[str, object]:
        return {"estimates": [estimate.to_dict() for estimate in estimates]}

    if record is None:
        return Story("Estimates", lines=lines, data=data)
    faults = record.check()
    own: dict[str, Any] = {"headline": leading(faults), "lines": lines, "faults": [str(fault) for fault in faults]}
    return Story.of_record(record_name(record), record, data=data, **own)


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
        f"{len(batch.rows)} records",
        list(_headline(batch, leading)),
        lines=[Line.of(e) for e in batch.estimates],
        notes=batch.notes,
        tables=[table],
        draw=lambda: plates_of_batch(batch),
        data=lambda: _rows_of(batch),
        write=lambda folder: write_table(batch, folder / TABLE),
    )


def _headline(batch: Batch, leading: Sequence[str]) -> Iterator[str]:
    answered = sum(row.counts for row in batch.rows)
    ranges = [_range(name, batch.known(name)) for name in leading]
    bounds = f": {'; '.join(ranges)}" if ranges else ""
    yield f"{answered} of {len(batch.rows)} records answer{bounds}."
    copies = [row for row in batch.rows if row.same_as]
    if copies:
        texts = "are copies of others", "is a copy of another"
        yield Caution(_several(copies, *texts, lambda row: f"{row.name} of {row.same_as}"))
    refused = [row for row in batch.rows if row.refusal]
    if refused:
        yield Caution(_several(refused, "give no answer", "gives no answer", lambda row: row.refusal.rstrip(".")))


def _range(name: str, estimates: Sequence[Estimate]) -> str:
    percentiles = np.percentile([e.value for e in estimates], [0, 50, 100])
    low, middle, high = (value_of(estimates[0], float(value)) for value in percentiles)
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


def _rows_of(batch: Batch) -> Mapping[str, Any]:
    together = [estimate.to_dict() for estimate in batch.estimates]
    rows = [
        {
            "name": row.name,
            "sha256": row.key,
            "answer": row.answer,
            "refusal": row.refusal,
            "same_as": row.same_as,
            "normal_load": row.normal and row.normal.value,
            "estimates": [estimate.to_dict() for estimate in row.estimates],
        }
        for row in batch.rows
    ]
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
    module, extra = NEEDED.get(path.suffix, ("pandas", "io"))
    package(module, extra=extra, rule=f"{path.suffix} is written by it")


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
