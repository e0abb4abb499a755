"""Hundreds of records asked by analyze, decay or squeak: on several processors, kept as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli.records import answer_together, names_of, together
from stickslip.cli.terminal import Output, progress

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.answers import Batch, Row
    from stickslip.rig import RigSettings

MANY = 20  # records from which each is a row of a table, and has no page of its own
POINTS = 120  # of a small picture
SHOWN = 3.0  # cycles in it, where there are cycles


# Of hundreds of records.
many_options = together(
    click.option(
        "--workers",
        type=click.IntRange(min=1),
        metavar="N",
        help=f"Processes for more than {MANY} records, all processors unless given.",
    ),
    click.option(
        "--engine",
        metavar="NAME",
        default="processes",
        show_default=True,
        help="Where many records are worked on: processes, cluster (Dask, on this machine) or cluster://HOST:PORT.",
    ),
    click.option(
        "--table",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Write one row a record into FILE.csv, FILE.parquet or FILE.xlsx.",
    ),
)


@dataclass(frozen=True)
class Places:
    """Where many records are worked on, and where their table goes."""

    workers: int | None
    engine: str
    table: Path | None

    @classmethod
    def of(cls, options: dict[str, Any]) -> Places:
        """Taken out of a command's options."""
        engine = ss.answers.require_engine(options.pop("engine"))
        return cls(options.pop("workers"), engine, options.pop("table"))

    def wanted(self, groups: Sequence[Sequence[Path]]) -> bool:
        """Whether the records are so many, or the table is asked for."""
        return len(groups) > MANY or self.table is not None


@dataclass(frozen=True)
class Task:
    """One record to be asked."""

    question: str
    files: tuple[Path, ...]
    names: tuple[str, ...]
    key: str
    rig: RigSettings
    options: Mapping[str, Any]


def ask_many(
    question: str,
    groups: Sequence[Sequence[Path]],
    rig: RigSettings,
    options: Mapping[str, Any],
    places: Places,
    *,
    folder: Path,
    tell: Callable[..., None],
) -> Batch:
    """One row a record; those that an earlier run has kept are not asked again."""
    if places.table is not None:
        ss.story.check_table(places.table)
    tasks = [
        Task(question, tuple(group), tuple(names), "+".join(map(ss.record.checksum, group)), rig, options)
        for group, names in zip(groups, names_of(groups), strict=True)
    ]
    query = {"question": question, "rig": rig.model_dump(), "options": dict(options), "version": ss.__version__}
    with ss.answers.Kept(_kept(folder), query) as kept:
        left = list({task.key: task for task in reversed(tasks) if task.key not in kept.rows}.values())[::-1]
        answers = ss.answers.spread(answered, tasks=left, engine=places.engine, workers=places.workers)
        for done, row in enumerate(answers, start=len(tasks) - len(left) + 1):
            kept.add(row)
            tell(f"{question}: {row.name}", done)
    rows = tuple(_rows(tasks, kept.rows))
    return ss.answers.Batch.of(question, rows, AXES[question], _untried(options))


def _kept(folder: Path) -> Path:
    """Where rows are kept until the folder of results is there."""
    return folder.with_name(f"{folder.name}.rows")


def answer_many(
    question: str,
    groups: Sequence[Sequence[Path]],
    rig: RigSettings,
    query: Mapping[str, Any],
    places: Places,
    *,
    usual: Path,
    output: Output,
) -> None:
    """Ask all records, show what was found, write it into a folder (not of JSON alone), forget what was kept of it."""
    folder = output.chosen or usual
    with progress(len(groups)) as tell:
        batch = ask_many(question, groups, rig, query, places, folder=folder, tell=tell)
    output.deliver(batch, output.folder(usual))
    if places.table is not None:
        ss.story.write_table(batch, places.table)
    _kept(folder).unlink(missing_ok=True)


def answer_all(
    question: str,
    groups: Sequence[Sequence[Path]],
    rig: RigSettings,
    query: Mapping[str, Any],
    places: Places,
    *,
    compare: Callable[[Any], Any],
    usual: Path,
    output: Output,
) -> None:
    """Ask all records: many are a row each, few have each a part of the page, and are compared."""
    if places.wanted(groups):
        answer_many(question, groups, rig, query, places, usual=usual, output=output)
        return
    answer_together(
        groups,
        rig,
        lambda record: ASK[question](record, rig, **query),
        together=lambda findings: compare(findings) if len(findings) > 1 else findings[0],
        folder=output.folder(usual),
        output=output,
    )


def _rows(tasks: Sequence[Task], kept: Mapping[str, Row]) -> Iterator[Row]:
    """In the order given, copies after the record that they are copies of."""
    first: dict[str, str] = {}
    for task in tasks:
        name = " + ".join(task.names)
        yield replace(kept[task.key], name=name, same_as=first.get(task.key, ""))
        first.setdefault(task.key, name)


def _untried(options: Mapping[str, Any]) -> tuple[str, ...]:
    if options.get("twins") != 0:
        return ()
    return ("The answers of so many records are not tried on twins; --twins 40 does that, for some seconds each.",)


# ---- one of them


def answered(task: Task) -> Row:
    """What one record answers; why, where it does not."""
    name = " + ".join(task.names)
    try:
        record = ss.answers.read_mended(task.files, rig=task.rig, names=task.names)
        findings = ASK[task.question](record, task.rig, **task.options)
        answer, picture = ss.summary(findings).answer, PICTURES[task.question](findings)
        quoted, level = findings.quoted, findings.level
        return ss.answers.Row(name, task.key, answer, quoted, level, findings.normal, picture=picture)
    except ss.errors.ModelError:
        raise
    except ss.StickslipError as error:
        return ss.answers.Row(name, task.key, refusal=str(error))


def _analyzed(record: Record, rig: RigSettings, *, method: str, twins: int) -> Any:
    findings = ss.analyze(record, rig=rig, method=method)
    if not twins or findings.contradiction:
        return findings
    try:
        return ss.tried(findings, twins=twins)
    except ss.errors.EstimateError as error:
        return replace(findings, notes=(*findings.notes, f"Twins: {error}"))


def _decayed(record: Record, rig: RigSettings, **query: Any) -> Any:
    return ss.analyze_decay(record, **query)


def _squeaked(record: Record, rig: RigSettings, **query: Any) -> Any:
    findings = ss.analyze_squeaks(record, contact=rig.contact, **query)
    loads = (rig.normal_load(part) for part in (*findings.name.split(" + "), findings.name))
    return replace(findings, normal=next((load for load in loads if load is not None), findings.normal))


ASK: dict[str, Callable[..., Any]] = {"analyze": _analyzed, "decay": _decayed, "squeak": _squeaked}

Picture = tuple[list[float], list[float]]


def _loop(findings: Any) -> Picture:
    """Friction over the displacement, for some cycles of the middle."""
    record = findings.record
    if "friction" not in record or "x" not in record:
        return _trace(findings)
    count = len(record)
    if findings.loops is not None:
        count = min(count, round(SHOWN * record.fs / findings.loops.frequency.value))
    first = (len(record) - count) // 2
    return _thinned(record["x"][first : first + count], record["friction"][first : first + count])


def _trace(findings: Any) -> Picture:
    """The channel that was asked over the time."""
    record = findings.record
    channel = findings.settings.get("channel") or next(iter(record))
    return _thinned(record.time, record[channel if channel in record else next(iter(record))])


def _thinned(x: Any, y: Any) -> Picture:
    import numpy as np  # the command line starts without it

    rows = np.linspace(0, len(x) - 1, min(POINTS, len(x))).astype(int)
    kept = np.isfinite(x[rows]) & np.isfinite(y[rows])
    return [float(f"{v:.5g}") for v in x[rows][kept]], [float(f"{v:.5g}") for v in y[rows][kept]]


PICTURES: dict[str, Callable[[Any], Picture]] = {"analyze": _loop, "decay": _trace, "squeak": _trace}
AXES = {
    "analyze": ("displacement", "friction"), "decay": ("time", "displacement"), "squeak": ("time", "sound or motion"),
}  # fmt: skip
