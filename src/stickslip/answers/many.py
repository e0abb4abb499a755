"""Records side by side: a few and their friction against the load, or hundreds.

Of hundreds what each answers is one row, kept as it comes, so that a run that was ended goes on.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np

from stickslip.answers.findings import Comparison, Findings, require_several
from stickslip.arrays import Array
from stickslip.errors import ModelError, RecordError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.law.fit_curve import LATE
from stickslip.statistics import student
from stickslip.workers import processors
from stickslip.workers import workers as processes


def compare(findings: Sequence[Findings]) -> Comparison:
    """Friction of several records side by side, and against the normal load where it is known.

    The coefficient is the slope of ``f = mu N`` by least squares; with three loads or more a line ``f = mu N + f0`` is
    fitted beside it. Their intervals are Student's t on the scatter about the line, or what the records' own intervals
    allow where that is wider.

    Parameters
    ----------
    findings : sequence of Findings
        Two or more.

    Returns
    -------
    Comparison

    Raises
    ------
    EstimateError
        Fewer than two records.

    Examples
    --------
    >>> import numpy as np
    >>> from stickslip import Record, analyze
    >>> rng, time = np.random.default_rng(1), np.arange(4000) / 500
    >>> def slide(load):
    ...     friction = 0.3 * load * np.sign(np.cos(2 * np.pi * time)) + rng.normal(0, 0.01, time.size)
    ...     x = np.sin(2 * np.pi * time) / (2 * np.pi)
    ...     return Record.of({"x": x, "friction": friction, "normal": np.full(time.size, load)}, fs=500)
    >>> round(compare([analyze(slide(load)) for load in (2.0, 4.0, 8.0)]).coefficient.value, 2)
    0.3
    """
    require_several(findings)
    results, notes = against_load(findings)
    return Comparison(tuple(findings), notes, results=results)


def against_load(findings: Sequence[Findings | Row]) -> tuple[dict[str, Estimate | None], tuple[str, ...]]:
    """The coefficient and the line of friction against the normal load; and what could not be used."""
    known = [f for f in findings if f.normal is not None and f.level is not None and f.level.unit == "N"]
    left_out = {
        "The normal load of {} is not known; state it to fit the coefficient.": [f for f in findings if not f.normal],
        "No friction level was found for {}.": [f for f in findings if f.level is None],
        "The friction of {} is a torque: it is not set against a normal load.": [
            f for f in findings if f.level is not None and f.level.unit != "N"
        ],
    }
    notes = [note.format(", ".join(f.name for f in those)) for note, those in left_out.items() if those]
    results: dict[str, Estimate | None] = dict.fromkeys(("coefficient", "slope", "offset"))
    if len(known) < 2:
        return results, tuple(notes)
    pressed = [f.normal for f in known if f.normal is not None]
    loads = np.array([load.value for load in pressed])
    unsure = max(load.sd / load.value for load in pressed)  # one gain, or one scale, may have measured all of them
    levels, sds = (np.array([getattr(f.level, key) for f in known]) for key in ("value", "sd"))
    over = f"over {len(known)} records"
    (slope,) = _line(loads[:, None], levels, sds)
    scatter = math.sqrt(float(np.sum((levels - slope["value"] * loads) ** 2)) / (len(known) - 1))
    coefficient = Estimate.normal(
        "friction coefficient",
        **slope,
        unit="1",
        method=f"slope through the origin {over}",
        checks=(f"scatter about the line {scatter:.3g} N",),
    ).widened(unsure)
    if len(np.unique(loads)) >= 3:
        rise, rest = _line(np.column_stack([loads, np.ones_like(loads)]), levels, sds)
        way = f"straight line {over}"
        tilt = Estimate.normal("slope of the line", **rise, unit="1", method=way).widened(unsure)
        offset = Estimate.normal("friction at no load", **rest, unit="N", method=way)
        if not offset.includes(0.0):
            coefficient = replace(coefficient, status="the line misses the origin: see friction at no load")
        results["slope"] = tilt.within(0.0, otherwise="friction falls with the load")
        results["offset"] = offset.within(0.0, otherwise=LATE)
    else:
        notes.append("Fewer than three loads: whether the line passes through the origin can not be told.")
    return {**results, "coefficient": coefficient}, tuple(notes)


def _line(design: Array, levels: Array, sds: Array) -> list[dict[str, float]]:
    """Coefficients by least squares; each varies as the scatter about the line says, or as `sds` do if that is more."""
    free = len(levels) - design.shape[1]
    inverse = np.linalg.pinv(design)
    line = inverse @ levels
    scatter = np.sqrt(np.sum((levels - design @ line) ** 2) / free * np.sum(inverse**2, axis=1))
    # a record of one cycle has no sd of its own: the scatter alone speaks for it
    own = np.sqrt(inverse**2 @ np.where(np.isfinite(sds), sds, 0.0) ** 2)
    sd = np.maximum(scatter, own * NORMAL_95 / student(free))
    return [{"value": v, "sd": s, "quantile": student(free)} for v, s in zip(line, sd, strict=True)]


Task = TypeVar("Task")
CLUSTERS = ("cluster", "dask")  # names of the engine that asks a Dask cluster, an address behind "://"


@dataclass(frozen=True)
class Row:
    """What one record answers, without the record.

    Attributes
    ----------
    name, key : str
        What it is called; the checksums of its files.
    answer : str
        The sentence that answers.
    estimates : tuple of Estimate
        Its numbers.
    level : Estimate or None
        The sliding friction, where it is known.
    normal : Estimate or None
        Normal load [N], where it is known.
    refusal : str
        Why it answers nothing; else empty.
    same_as : str
        The record before it that has the same checksum; else empty.
    picture : tuple of sequences of float
        Abscissa and ordinate of a small picture.
    """

    name: str
    key: str
    answer: str = ""
    estimates: tuple[Estimate, ...] = ()
    level: Estimate | None = None
    normal: Estimate | None = None
    refusal: str = ""
    same_as: str = ""
    picture: tuple[Sequence[float], Sequence[float]] = ((), ())

    @property
    def counts(self) -> bool:
        """Whether it answers something that no record before it did."""
        return not self.refusal and not self.same_as

    @classmethod
    def of_dict(cls, data: Mapping[str, Any]) -> Row:
        """A row from plain data."""
        estimates = tuple(map(_estimate, data["estimates"]))
        level, normal = (data[key] and _estimate(data[key]) for key in ("level", "normal"))
        own = {"estimates": estimates, "level": level, "normal": normal, "picture": tuple(data["picture"])}
        return cls(**{**data, **own})


def _estimate(data: Mapping[str, Any]) -> Estimate:
    return Estimate(**{**data, "interval": tuple(data["interval"]), "checks": tuple(data["checks"])})


@dataclass(frozen=True, eq=False, repr=False)
class Batch(Result):
    """What many records answer.

    Attributes
    ----------
    question : str
        The command that asked: analyze, decay or squeak.
    rows : tuple of Row
        One a record, in the order given.
    axes : tuple of str
        What the small pictures show.
    together : mapping of str to Estimate
        What they tell together: the coefficient of friction, where the normal loads are known.
    notes : tuple of str
        How they were asked.
    """

    question: str
    rows: tuple[Row, ...]
    axes: tuple[str, str]
    together: Mapping[str, Estimate] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, question: str, rows: Sequence[Row], axes: tuple[str, str], notes: Sequence[str] = ()) -> Self:
        """With the coefficient of friction over the records whose normal load is known."""
        loaded = [row for row in rows if row.counts and row.normal is not None]
        together, more = against_load(loaded) if len(loaded) > 1 else ({}, ())
        known = {name: estimate for name, estimate in together.items() if estimate is not None}
        return cls(question, tuple(rows), axes, known, (*more, *notes))

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """What they tell together."""
        return tuple(self.together.values())

    @property
    def names(self) -> tuple[str, ...]:
        """The quantities that records answer, those of most records first."""
        often: dict[str, int] = {}
        for row in self.rows:
            for estimate in row.estimates:
                often[estimate.name] = often.get(estimate.name, 0) + (row.counts and estimate.known)
        return tuple(sorted(often, key=lambda name: -often[name]))

    def known(self, name: str) -> list[Estimate]:
        """A quantity of each record that has it, without copies of others."""
        rows = (row for row in self.rows if row.counts)
        return [estimate for row in rows for estimate in row.estimates if estimate.name == name and estimate.known]

    def table(self) -> list[dict[str, Any]]:
        """A row a record for a spreadsheet: of each quantity the value and the ends of its 95 % interval."""
        return [dict(_cells(row, self.names)) for row in self.rows]


def spread(
    answer: Callable[[Task], Row], *, tasks: Sequence[Task], engine: str = "processes", workers: int | None = None
) -> Iterator[Row]:
    """Answer tasks on several processors, each row as soon as it is there.

    Parameters
    ----------
    answer : callable
        Answers one task; on several processes it must be picklable, and so must its tasks.
    tasks : sequence
        What is to be answered.
    engine : str
        "processes", "cluster" (Dask, on this machine) or "cluster://HOST:PORT".
    workers : int, optional
        Processes; all processors where left out.

    Returns
    -------
    iterator of Row

    Raises
    ------
    ModelError
        No such engine, or no cluster.

    Examples
    --------
    >>> [row.name for row in spread(lambda name: Row(name, name), tasks=["a.csv", "b.csv"], workers=1)]
    ['a.csv', 'b.csv']
    """
    word, _, address = require_engine(engine).partition("://")
    if word == "processes":
        return _by_processes(answer, tasks, workers or processors())
    return _by_cluster(answer, tasks, address or None)


def require_engine(engine: str) -> str:
    """Is this an engine that works on many records?

    Parameters
    ----------
    engine : str
        "processes", "cluster" or "cluster://HOST:PORT", as :func:`spread` takes it.

    Returns
    -------
    str
        The same.

    Raises
    ------
    ModelError
        It is none.

    Examples
    --------
    >>> require_engine("cluster://localhost:8786")
    'cluster://localhost:8786'
    """
    word, _, address = engine.partition("://")
    if word not in CLUSTERS and (word != "processes" or address):
        raise ModelError(f"engine '{engine}'", "it is processes, cluster or cluster://HOST:PORT", "choose one of them")
    return engine


def _by_processes(answer: Callable[[Task], Row], tasks: Sequence[Task], count: int) -> Iterator[Row]:
    with _one_thread_each(), processes(min(count, len(tasks)), answer.__module__) as over:
        yield from over(answer, tasks)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Linear algebra on one thread in each process: on several, full processes stand in each other's way."""
    names = [name for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS") if name not in os.environ]
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name in names:
            del os.environ[name]


def _by_cluster(answer: Callable[[Task], Row], tasks: Sequence[Task], address: str | None) -> Iterator[Row]:
    if not tasks:
        return
    # systems and laws, which a record on this machine does not need
    from stickslip.maps.engines import AHEAD, client_of

    with client_of(address) as client:
        from distributed import as_completed

        waiting = iter(tasks)
        count = AHEAD * max(1, sum(client.nthreads().values()))
        running = as_completed([client.submit(answer, task, pure=False) for task in islice(waiting, count)])
        for future in running:
            yield future.result()
            running.update([client.submit(answer, task, pure=False) for task in islice(waiting, 1)])


def _cells(row: Row, names: Sequence[str]) -> Iterator[tuple[str, Any]]:
    yield from (("file", row.name), ("answer", row.answer or row.refusal))
    yield from (("same as", row.same_as), ("sha256", row.key))
    yield "normal load [N]", row.normal and row.normal.value
    estimates = {estimate.name: estimate for estimate in row.estimates}
    for name in names:
        estimate = estimates.get(name)
        unit = "" if estimate is None or estimate.unit == "1" else f" [{estimate.unit}]"
        if estimate is not None:
            yield f"{name}{unit}", estimate.value
            yield f"{name}, low{unit}", estimate.interval[0]
            yield f"{name}, high{unit}", estimate.interval[1]
            yield f"{name}, status", estimate.status


class Kept:
    """The rows that are done, in a file beside the folder of results; one that was asked otherwise is begun again."""

    def __init__(self, path: Path, query: Mapping[str, Any]) -> None:
        self.path, self.rows = path, dict[str, Row]()
        first = json.dumps({"asked": query}, sort_keys=True, default=str)
        lines = path.read_text(encoding="utf-8").split("\n") if path.exists() else []
        if lines[:1] == [first]:
            for line in lines[1:-1]:  # a last line without its end was cut off
                row = Row.of_dict(json.loads(line))
                self.rows[row.key] = row
        try:
            self.file = path.open("w", encoding="utf-8")
        except OSError as error:
            raise RecordError(
                f"{path} can not be written ({error.strerror})", "what is done is kept there", "name another --output"
            ) from error
        self._write(first)
        for row in self.rows.values():
            self._write(json.dumps(asdict(row)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.file.close()

    def add(self, row: Row) -> None:
        """Keep a row: it is in the file when this returns."""
        self.rows[row.key] = row
        self._write(json.dumps(asdict(row)))

    def _write(self, line: str) -> None:
        self.file.write(line + "\n")
        self.file.flush()
