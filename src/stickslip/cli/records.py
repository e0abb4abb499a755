"""The records that the arguments of a command stand for."""

from __future__ import annotations

import contextlib
import dataclasses
import fnmatch
import functools
import glob
import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

import stickslip as ss
from stickslip.cli.options import pair
from stickslip.cli.terminal import complain, progress, publish, show, spoken
from stickslip.printing import printable

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.record import Step
    from stickslip.rig import RigSettings

Answer = TypeVar("Answer")
Reader = Callable[[Sequence[Path], "RigSettings", Sequence[str]], "Record"]

LONG = 1 << 26  # bytes on the disk
RIG_FILE = "rig.toml"  # of the folder one is in: read where no other is named
PART = 1 << 18  # rows of a long record's part


def rig_of(
    *,
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

    A rig.toml is looked for only if it may be `here`.
    """
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


def read(files: Sequence[Path], rig: RigSettings, names: Sequence[str] = ()) -> Record:
    """The record, its files called by their names or by those given."""
    record = ss.read_record(files, rows=rig.row_range(), **rig.reading())
    return rig.logged(ss.answers.mend(_with_source(record, files, names), repairs=rig.repair))


def is_long(files: Sequence[Path]) -> bool:
    """Whether the record may be too long to be held in memory with all that is made of it."""
    return sum(path.stat().st_size for path in files) > LONG


def read_parts(
    files: Sequence[Path], rig: RigSettings, size: int | None = None, names: Sequence[str] = ()
) -> Iterator[Record]:
    """The record in parts that fit into memory; whole where rows of it or repairs are asked for."""
    if rig.rows or rig.repair:
        yield read(files, rig, names)
        return
    options = {**rig.reading(), **({} if size is None else {"size": size})}
    for part in ss.read_blocks(files, **options):
        yield rig.logged(_with_source(part, files, names))


def _folder(path: Path) -> dict[str, str]:
    """As it was typed, unless that says where this machine keeps it."""
    return {} if path.parent == Path() or path.is_absolute() else {"folder": printable(str(path.parent))}


def _with_source(record: Record, files: Sequence[Path], names: Sequence[str]) -> Record:
    """The record with its files in the history, called as told; one that write_record kept comes back without."""
    own = [printable(path.name) for path in files]
    called = dict(zip(own, map(printable, names) if names else own, strict=True))
    known = {file["name"] for step in record.history for file in step.arguments.get("files", ())}
    if called.keys() <= known:
        return dataclasses.replace(record, history=tuple(_called(step, called) for step in record.history))
    sources = [
        {"name": name, **_folder(path), "sha256": checksum(path)}
        for name, path in zip(called.values(), files, strict=True)
    ]
    step = ss.record.Step("read_record", {"files": sources}, "a record as it was written")
    return dataclasses.replace(record, history=(*record.history, step))


def _called(step: Step, names: Mapping[str, str]) -> Step:
    """The step with other names of the files that it read."""
    read = step.arguments.get("files")
    if not read:
        return step
    files = [{**file, "name": names.get(file["name"], file["name"])} for file in read]
    return dataclasses.replace(step, arguments={**step.arguments, "files": files})


@functools.cache
def checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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
        refused.append(type(error)(value, error.rule, error.next_step, kind=error.kind))


def answers(
    groups: Sequence[Sequence[Path]],
    rig: RigSettings,
    ask: Callable[[Record], Answer],
    tell: Callable[[str, float], None],
    *,
    of_parts: Callable[[Iterator[Record], Callable[[str], None]], Answer] | None = None,
    reader: Reader = read,
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
            if of_parts is not None and is_long(group):
                say = functools.partial(_say, tell, f"analysing {name}", 2 * number)
                results.append(of_parts(read_parts(group, rig, PART, names), say))
                continue
            record = reader(group, rig, names)
            tell(f"checking and analysing {name}", 2 * number + 1)
            results.append(ask(record))
    if results:
        return results, refused
    if len(refused) == 1:
        raise refused[0]
    name_left_out(refused)
    raise type(refused[0])(
        f"none of {len(refused)} records answers", "each has its own reason, told above", "mend them, or give others"
    )


def answer_together(
    groups: Sequence[Sequence[Path]],
    rig: RigSettings,
    ask: Callable[[Record], Answer],
    *,
    together: Callable[[list[Answer]], Any],
    folder: Path | None,
    as_json: bool,
    everything: bool,
    reader: Reader = read,
) -> None:
    """Ask every record, put the answers together, leave them in a folder, and show them."""
    with progress(2 * len(groups) + 1) as tell:
        found, refused = answers(groups, rig, ask, tell, reader=reader)
        results = with_left_out(together(found), refused)
        tell("drawing and writing", 2 * len(groups))
        written = publish(results, folder)
    name_left_out(refused)
    show(results, written, as_json=as_json, everything=everything)


def _say(tell: Callable[[str, float], None], what: str, done: float, state: str) -> None:
    tell(f"{what}, {state}", done)


def with_left_out(results: Any, refused: Sequence[ss.StickslipError]) -> Any:
    """The results, with a note for each record that is not among them."""
    notes = (*results.notes, *(f"Left out: {error}" for error in refused))
    return dataclasses.replace(results, notes=notes)


def name_left_out(refused: Iterable[ss.StickslipError]) -> None:
    for error in refused:
        complain(f"left out: {spoken(error)}")
