"""The records of a command: how they are named and read; one, several and hundreds of them asked."""

from __future__ import annotations

import contextlib
import fnmatch
import functools
import glob
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

import stickslip as ss
from stickslip.cli import option
from stickslip.cli.terminal import Output, complain, progress, spoken

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.answers import Batch, Findings, Row
    from stickslip.rig import RigSettings
    from stickslip.systems import Case

Answer = TypeVar("Answer")
Reader = Callable[..., "Record"]

RIG_FILE = "rig.toml"  # of the folder one is in: read where no other is named
POINTS = 120  # of a small picture
SHOWN = 3.0  # cycles in it, where there are cycles


def rig_of(
    *files: str,
    config: Path | None,
    channels: Sequence[str],
    units: Sequence[str],
    repair: str | None,
    sensors: Sequence[str] = (),
    normal: Sequence[str] = (),
    here: bool = True,
    **constants: str | None,
) -> RigSettings:
    """The settings of the file, with those of the command line in front; rig.toml of this folder is that file.

    A rig.toml is looked for only if it may be `here`; not where all `files` are sounds, which have none of its columns.
    """
    parts = [Path(part) for file in files for part in file.split("+")]
    here = here and not (parts and all(map(ss.squeak.is_sound, parts)))
    if config is None and here and Path(RIG_FILE).is_file():
        config = Path(RIG_FILE)
        complain(f"columns and constants by {RIG_FILE}")
    given: dict[str, Any] = {key: value for key, value in constants.items() if value is not None}
    base = ss.rig.read_rig(config).model_dump(exclude_unset=True) if config else {}
    for key, pairs in (("channels", channels), ("units", units)):
        if pairs:
            given[key] = {**base.get(key, {}), **dict(pair(text, f"--{key}") for text in pairs)}
    if sensors:
        given["sensors"] = _sensors(base.get("sensors", {}), sensors)
    if repair is not None:
        given["repair"] = [word.strip() for word in repair.split(",")]
    if normal:  # the first pattern that fits decides
        loads = dict(pair(load, "--normal") if "=" in load else ("*", load) for load in normal)
        for load in loads.values():
            _require_load(load)
        given["normal"] = loads | {key: load for key, load in base.get("normal", {}).items() if key not in loads}
    return ss.rig.rig_settings({**base, **given}, source="the command line")


def _sensors(known: Mapping[str, Any], stated: Sequence[str]) -> dict[str, dict[str, Any]]:
    """What is known of the sensors, with what the command line states in front."""
    sensors = {name: dict(details) for name, details in known.items()}
    for text in stated:
        name, value = pair(text, "--sensor")
        channel, point, detail = name.partition(".")
        if not point:
            raise click.BadParameter(f"'{text}' is not CHANNEL.NAME=VALUE", param_hint="--sensor")
        parts = [_number(part.strip()) for part in value.split(",")]
        sensors.setdefault(channel, {})[detail] = parts if detail == "mount" else _number(value)
    return sensors


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _require_load(load: str) -> None:
    try:
        ss.rig.rig_settings({"normal": {"*": load}}, source="--normal")
    except ss.errors.ModelError as error:
        raise click.BadParameter(f"'{load}' is no load: {error.rule}", param_hint="--normal") from error


def groups_of(*arguments: str) -> list[list[Path]]:
    """The records that arguments stand for, each as its files: patterns filled in, parts joined by + paired."""
    return [group for argument in arguments for group in _groups(argument)]


def files_of(argument: str, why: str) -> list[Path]:
    """The files of the one record that an argument stands for."""
    groups = groups_of(argument)
    if len(groups) != 1:
        raise click.BadParameter(f"'{argument}' fits {len(groups)} records; {why}", param_hint="FILE")
    return groups[0]


def _groups(argument: str) -> list[list[Path]]:
    if Path(argument).is_dir():
        raise click.BadParameter(
            f"'{argument}' is a folder; name a file, or a pattern like '{Path(argument) / '*.csv'}'", param_hint="FILES"
        )
    if Path(argument).exists():
        return [[Path(argument)]]
    parts: list[list[Path]] = []
    for part in argument.split("+"):
        fits = _fitting(part)
        if not fits and parts:  # a name without a folder may stand beside the part before it
            fits = _fitting(part, parts[-1][0].parent)
        if not fits:
            raise click.BadParameter(f"no file is called, or fits, '{part}'", param_hint="FILES")
        parts.append(fits)
    if len({len(fits) for fits in parts}) > 1:
        counts = " and ".join(str(len(fits)) for fits in parts)
        raise click.BadParameter(
            f"the parts of '{argument}' fit {counts} files; each record needs one of each", param_hint="FILES"
        )
    return [list(files) for files in zip(*parts, strict=True)]


def _fitting(pattern: str, folder: Path = Path()) -> list[Path]:
    if (folder / pattern).exists():
        return [folder / pattern]
    return sorted(folder / path for path in glob.glob(pattern, root_dir=folder))


def require_fits(normal: Sequence[str], groups: Sequence[Sequence[Path]]) -> None:
    """Refuse a load stated for files that are not there: it is a typing error."""
    titles = names_of(groups)
    known = [name for names in titles for name in (*names, " + ".join(names))]
    known += [name for group in groups for name in (*(path.name for path in group), name_of(group))]
    for load in normal:
        pattern, separator, _ = load.partition("=")
        if separator and not fnmatch.filter(known, pattern.strip()):
            called = ", ".join(" + ".join(names) for names in titles[:3]) + (", ..." if len(titles) > 3 else "")
            raise click.BadParameter(f"no file fits '{pattern.strip()}': called {called}", param_hint="--normal")


def name_of(files: Sequence[Path]) -> str:
    return " + ".join(path.name for path in files)


def names_of(groups: Sequence[Sequence[Path]]) -> list[list[str]]:
    """What the files of each record are called: their names, with as many folders before as tell records apart."""
    paths = [tuple(path.absolute() for path in group) for group in groups]
    titles = {paths_of: tuple(path.name for path in paths_of) for paths_of in paths}
    for depth in range(2, max((len(path.parts) for paths_of in paths for path in paths_of), default=0)):
        often = Counter(titles.values())
        titles = {
            paths_of: tuple("/".join(path.parts[-depth:]) for path in paths_of) if often[names] > 1 else names
            for paths_of, names in titles.items()
        }
    return [list(titles[paths_of]) for paths_of in paths]


def default_folder(groups: Sequence[Sequence[Path]], ending: str = "stickslip") -> Path:
    """Where the results of these records go; commands that answer other questions of them end it otherwise."""
    return folder_after(groups[0][0], ending) if len(groups) == 1 else Path(f"comparison-{ending}")


def folder_after(file: Path, ending: str) -> Path:
    """A folder's name after a file's, without the signs in it that can not be seen."""
    return Path("".join(sign if sign.isprintable() else "-" for sign in f"{file.stem}-{ending}"))


@contextlib.contextmanager
def collected(refused: list[ss.StickslipError], files: Sequence[Path], names: Sequence[str] = ()) -> Iterator[None]:
    """Put what the data can not answer aside, with the file's name; what was asked wrongly ends all."""
    names = names or [path.name for path in files]
    try:
        yield
    except ss.errors.ModelError:
        raise
    except ss.StickslipError as error:
        known = any(name in str(error) for name in names)
        value = error.value if known else f"{' + '.join(names)}: {error.value}"
        refused.append(type(error)(value, error.rule, error.next_step, kind=error.kind, options=error.options))


def answers(
    groups: Sequence[Sequence[Path]],
    rig: RigSettings,
    ask: Callable[[Record], Answer],
    tell: Callable[[str, float], None],
    *,
    of_parts: Callable[[Iterator[Record], Callable[[str], None]], Answer] | None = None,
    reader: Reader | None = None,
) -> tuple[list[Answer], list[ss.StickslipError]]:
    """What each record answers, and why those that are left out do not; the last word where none does.

    With `of_parts` a long record is asked part by part, and a sentence is told of each.
    """
    results: list[Answer] = []
    refused: list[ss.StickslipError] = []
    for number, (group, names) in enumerate(zip(groups, names_of(groups), strict=True)):
        with collected(refused, group, names):
            name = " + ".join(names)
            tell(f"reading {name}", 2 * number)
            if of_parts is not None and ss.answers.is_long(group):
                say = functools.partial(_say, tell, f"analysing {name}", 2 * number)
                results.append(of_parts(ss.answers.read_parts(group, rig=rig, names=names), say))
                continue
            record = (reader or ss.answers.read_mended)(group, rig=rig, names=names)
            if len(groups) == 1:
                require_described(record)
            tell(f"checking and analysing {name}", 2 * number + 1)
            results.append(ask(record))
    if results:
        return results, refused
    if len(refused) == 1:
        raise refused[0]
    name_left_out(refused)
    shared = {error.kind for error in refused}
    raise type(refused[0])(
        f"none of {len(refused)} records answers",
        "each has its own reason, told above",
        "mend them, or give others",
        kind=shared.pop() if len(shared) == 1 else "",
    )


def require_described(record: Record) -> Record:
    """The only record of a command; refused where it lacks a sensor that the command line describes."""
    for text in click.get_current_context().params.get("sensors", ()):
        name = text.partition(".")[0]
        if name not in record:
            raise click.BadParameter(
                f"'{name}' is no channel of the record, which has {', '.join(record)}; name one of them",
                param_hint="--sensor",
            )
    return record


def answer_together(
    groups: Sequence[Sequence[Path]],
    rig: RigSettings,
    ask: Callable[[Record], Answer],
    *,
    together: Callable[[list[Answer]], Any],
    folder: Path | None,
    output: Output,
    reader: Reader | None = None,
) -> None:
    """Ask every record, put the answers together, leave them in a folder, and show them."""
    with progress(2 * len(groups)) as tell:
        answered, refused = answers(groups, rig, ask, tell, reader=reader)
        results = with_left_out(together(answered), refused)
    name_left_out(refused)
    output.deliver(results, folder)


def _say(tell: Callable[[str, float], None], what: str, done: float, state: str) -> None:
    tell(f"{what}, {state}", done)


def with_left_out(results: Any, refused: Sequence[ss.StickslipError]) -> Any:
    """The results, with a note for each record that is not among them."""
    notes = (*results.notes, *(f"Left out: {error}" for error in refused))
    return replace(results, notes=notes)


def name_left_out(refused: Iterable[ss.StickslipError]) -> None:
    for error in refused:
        complain(f"left out: {spoken(error)}")


def number_of(text: str, si: str, option: str) -> float:
    """A number in SI, or with its unit; what is none is refused by the name of its option."""
    try:
        return float(ss.Estimate.stated(option.lstrip("-"), text, si))
    except ss.StickslipError as error:
        raise click.BadParameter(f"{error.value}; {error.rule}", param_hint=option) from error


def pair(text: str, option: str) -> tuple[str, str]:
    name, separator, value = text.partition("=")
    if not separator or not name.strip() or not value.strip():
        raise click.BadParameter(f"'{text}' is not NAME=VALUE", param_hint=option)
    return name.strip(), value.strip()


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
        return len(groups) > option.MANY or self.table is not None


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


def on_twins(findings: Findings, twins: int, **how: Any) -> Findings:
    """The answers as their twins leave them; with a note of why, where the record has no twin."""
    if not twins or findings.contradiction:  # the rig that it would be tried on is not the one that wrote the record
        return findings
    try:
        return ss.tried(findings, twins=twins, **how)
    except ss.errors.EstimateError as error:
        return replace(findings, notes=(*findings.notes, f"Twins: {error}"))


def _analyzed(record: Record, rig: RigSettings, *, method: str, twins: int) -> Any:
    return on_twins(ss.analyze(record, rig=rig, method=method), twins)


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


def wanted_case(
    name: str, *, duration: str | None, cycles: float | None, changes: Sequence[str], fs: str | None = None
) -> Case:
    """The scenario or the file of that name, with what the command line changes."""
    case = (
        ss.systems.read_system(name)
        if name.endswith(".toml") or Path(name).is_file()
        else ss.systems.scenario_case(name)
    )
    case = case.having(**dict(pair(change, "--set") for change in changes))
    return case.lasting(duration=duration, cycles=cycles, fs=fs)


def folder_name(case: Case, ending: str) -> Path:
    """A folder's name after the case."""
    name = "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in case.name)
    return Path(f"{name}-{ending}")
