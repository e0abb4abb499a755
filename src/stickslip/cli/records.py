"""The options that commands share, and the records that they read by them."""

from __future__ import annotations

import contextlib
import dataclasses
import fnmatch
import functools
import glob
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

import stickslip as ss
from stickslip.cli.terminal import Output, complain, progress, spoken

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.rig import RigSettings
    from stickslip.systems import Case

Answer = TypeVar("Answer")
Reader = Callable[..., "Record"]

RIG_FILE = "rig.toml"  # of the folder one is in: read where no other is named


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
    return dataclasses.replace(results, notes=notes)


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


Decorator = Callable[[Callable[..., None]], Callable[..., None]]


def together(*options: Decorator) -> Decorator:
    """Several options as one decorator, in the order in which the help lists them."""

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


# How a file is read.
reading_options = together(
    click.option(
        "--channels",
        multiple=True,
        metavar='"NAME=COLUMN [UNIT]"',
        help='What a column is: "x=qm [m]", "force=vir * 35.15 [N]", "a=acc [g] ± 1 %". Repeatable.',
    ),
    click.option(
        "--units",
        multiple=True,
        metavar='"COLUMN=UNIT"',
        help='Unit of a column whose header states none: "x=mm", "#1=ms". Repeatable.',
    ),
    click.option(
        "--sensor",
        "sensors",
        multiple=True,
        metavar='"CHANNEL.NAME=VALUE"',
        help='What is known of a sensor: "a.delay=3 ms", "a.mount=125 Hz, 0.1", "load.inertia=20 g". Repeatable.',
    ),
    click.option("--fs", metavar="HZ", help="Sampling rate, for a file that states none."),
    click.option("--time", metavar="COLUMN", help="Column that holds the time, where its header does not say."),
    click.option("--delimiter", metavar="SIGN", help="Delimiter of a text file, where it can not be told."),
    click.option("--decimal", type=click.Choice([".", ","]), help="Decimal sign of a text file."),
    click.option("--rows", metavar="FIRST:LAST", help="Rows to keep of each file."),
    click.option(
        "--repair",
        metavar="LIST",
        help="Repairs after reading, in this order, with commas: clock, gaps, missing, spikes, clipping, drift; "
        "for one channel alone as in drift:x.",
    ),
    click.option(
        "--config",
        type=click.Path(path_type=Path),
        metavar="RIG.TOML",
        help="The rig's constants and channel map; unless given rig.toml of this folder. Options go before it.",
    ),
)


def constants_options(mass: str = 'Oscillating mass in kg, or with its unit ("250 g", "2.42 ± 0.02 kg").') -> Decorator:
    """The options that state the oscillator; `mass` is the help of the first."""
    return together(
        click.option("--mass", metavar="VALUE", help=mass),
        click.option("--stiffness", metavar="VALUE", help="Spring in N/m, or with its unit."),
        click.option("--damping", metavar="VALUE", help="Viscous damping of the suspension in N s/m."),
        click.option("--damper", type=click.Choice(["ground", "base"]), help="What the damper ends on."),
        contact_option,
    )


contact_option = click.option("--contact", type=click.Choice(["ground", "base"]), help="What the mass slides on.")
normal_option = click.option(
    "--normal",
    multiple=True,
    metavar='LOAD or "PATTERN=LOAD"',
    help="Normal load in N, for all files or for those whose name fits. Repeatable.",
)
form_option = click.option(
    "--format",
    "form",
    type=click.Choice(["csv", "h5", "parquet"]),
    default="csv",
    show_default=True,
    help="Format of the record.",
)


def usable(context: click.Context, option: click.Parameter, folder: Path | None) -> Path | None:
    """A folder for results, refused before the work where it may not be written; none may be asked for."""
    if folder is not None:
        ss.story.check_folder(folder)
    return folder


all_option = click.option(
    "--all", "everything", is_flag=True, help="Print all quantities, cautions and notes, as the page has them."
)


def result_options(folder: str) -> Decorator:
    """The options that say where the results go, `folder` unless it is said, and how much of them is printed.

    The command gets them together, as its `output`.
    """
    chosen = click.option(
        "--output",
        type=click.Path(path_type=Path),
        callback=usable,
        metavar="DIR",
        help=f"Folder for the results; {folder} unless given.",
    )
    as_json = click.option(
        "--json",
        "as_json",
        is_flag=True,
        help="Print the results as JSON and nothing else; a folder is written only with --output.",
    )
    return together(chosen, as_json, all_option, _gathered)


def _gathered(command: Callable[..., None]) -> Callable[..., None]:
    @functools.wraps(command)
    def gathering(*, output: Path | None, as_json: bool, everything: bool, **arguments: Any) -> None:
        command(output=Output(output, as_json, everything), **arguments)

    return gathering


changes_option = click.option(
    "--set",
    "changes",
    multiple=True,
    metavar='"NAME=VALUE"',
    help='Another value of a parameter: "kinetic=1.3", "amplitude=0.7 mm", "law.stiffness=2 N/um". Repeatable.',
)


# How long it runs, and what is changed of it.
case_options = together(
    click.option("--duration", metavar="TIME", help="Time to simulate in s, or with its unit."),
    click.option("--cycles", type=click.FloatRange(min=0, min_open=True), help="The same in periods of the drive."),
    changes_option,
)


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
