"""The command line: parse, call one public function, show."""

from __future__ import annotations

import contextlib
import dataclasses
import fnmatch
import glob
import hashlib
import itertools
import json
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss

if TYPE_CHECKING:
    from stickslip import Case, Comparison, DecayFindings, Findings, Outcome, Record, RigSettings, TimeFrequency

INTERRUPTED = 130
SHOWN_EVENTS = 12
LIST_WIDTH = 100
PATIENCE = 2.0  # seconds of silence before a progress bar is shown

# What a sentence says to a Python user, and how the command line says it.
_REPAIRS = {
    "repair_clock": "clock", "fill_gaps": "gaps", "fill_missing": "missing", "remove_spikes": "spikes",
    "restore_clipped": "clipping", "remove_drift": "drift",
}  # fmt: skip
_SPOKEN = (
    (r"\brecord\.check\(\)", "stickslip check"),
    (r"\brecord\.rows\(\)", "--rows"),
    (r"\brecord\.rows\((\d+), (\d+)\)", r"--rows \1:\2"),
    (r'\bchannels=\{"(\w+)": "([^"]*)"\}', r'--channels "\1=\2"'),
    (r"\b(channels|units|fs|time|delimiter|decimal|method|damper|contact|mass|stiffness)=(?=\W|$)", r"--\1"),
)


class _Commands(click.Group):
    """Every error that stickslip raises on purpose ends as one sentence and its exit code."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            click.echo("stickslip: interrupted; nothing was written.", err=True)
            ctx.exit(INTERRUPTED)
        except click.UsageError as error:
            click.echo(f"stickslip: {error.format_message().rstrip('.')}; see {ctx.command_path} --help.", err=True)
            ctx.exit(error.exit_code)
        except ss.StickslipError as error:
            click.echo(f"stickslip: {_spoken(error)}", err=True)
            ctx.exit(error.exit_code)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(ss.__version__, prog_name="stickslip")
def main() -> None:
    """How much friction is in this record, did the contact stick, and how sure is that?

    Exit codes: 0 done, 1 the data can not answer (and why), 2 wrong use. Of several files, those that can not answer
    are named and left out; the exit code is 1 where none is left.
    """


def _spoken(words: object) -> str:
    """A sentence with the options of the command line for what it says of Python."""

    def repair(call: re.Match[str]) -> str:
        word = _REPAIRS.get(call[1])
        return call[0] if word is None else f"--repair {word}" + (f":{call[2]}" if call[2] else "")

    text = re.sub(r'\b(\w+)\(record(?:, "(\w+)")?\)', repair, str(words))
    for said, option in _SPOKEN:
        text = re.sub(said, option, text)
    return text


def _pair(text: str, option: str) -> tuple[str, str]:
    name, separator, value = text.partition("=")
    if not separator or not name.strip() or not value.strip():
        raise click.BadParameter(f"'{text}' is not NAME=VALUE", param_hint=option)
    return name.strip(), value.strip()


def _reading(command: Callable[..., None]) -> Callable[..., None]:
    """The options that say how a file is read."""
    options = [
        click.option(
            "--channels",
            multiple=True,
            metavar='"NAME=COLUMN [UNIT]"',
            help='What a column is: "x=qm [m]", "force=vir * 35.15 [N]". Repeatable.',
        ),
        click.option(
            "--units",
            multiple=True,
            metavar='"COLUMN=UNIT"',
            help="Unit of a column whose header states none. Repeatable.",
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
            help="File of the rig's constants and channel map; options go before it.",
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


@main.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option("--mass", metavar="VALUE", help='Oscillating mass in kg, or with its unit ("250 g").')
@click.option("--stiffness", metavar="VALUE", help="Spring in N/m, or with its unit.")
@click.option("--damping", metavar="VALUE", help="Viscous damping of the suspension in N s/m.")
@click.option("--damper", type=click.Choice(["ground", "base"]), help="What the damper ends on.")
@click.option("--contact", type=click.Choice(["ground", "base"]), help="What the mass slides on.")
@click.option(
    "--normal",
    multiple=True,
    metavar='LOAD or "PATTERN=LOAD"',
    help="Normal load in N, for all files or for those whose name fits. Repeatable.",
)
@click.option(
    "--method",
    type=click.Choice(["smoother", "five-point"]),
    default="smoother",
    show_default=True,
    help="How displacement is differentiated.",
)
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for the results; FILE-stickslip unless given.",
)
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the results as JSON and nothing else; a folder is written only with --output.",
)
@_reading
def analyze(files: tuple[str, ...], output: Path | None, as_json: bool, method: str, **options: Any) -> None:
    """Find the friction in one record or several.

    FILES that belong to one record are joined with +, as in x.mat+z.mat. A quoted pattern ("run_*.csv") stands for
    all files that fit. Several records are compared, with the normal load too where it is known.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip analyze run.csv --channels "x=disp [mm]" --mass 3.08 --stiffness "1.19 N/mm"
    stickslip analyze "run_*.csv" --config rig.toml --normal "*250g*=2.45" --normal "*450g*=4.41"
    """
    rig = _rig(**options)
    groups = [group for argument in files for group in _groups(argument)]
    _require_fits(options["normal"], groups)
    folder = output or _default_folder(groups)
    with _progress(2 * len(groups) + 1) as tell:
        results, refused = _answers(groups, rig, method, tell)
        tell("drawing and writing", 2 * len(groups))
        written = ss.publish(results, folder=folder) if output or not as_json else None
    _name_left_out(refused)
    _show(results, written, as_json=as_json)


@main.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option("--mass", metavar="VALUE", help="Oscillating mass in kg, for the friction force; of an angle in kg m^2.")
@click.option("--stiffness", metavar="VALUE", help="Spring in N/m, for the friction force; of an angle in N m/rad.")
@click.option(
    "--method",
    type=click.Choice(["all", "waveform", "thesis"]),
    default="all",
    show_default=True,
    help="The whole waveform, the decrements of the extremes (the thesis's chapter 6), or both.",
)
@click.option(
    "--restoring",
    type=click.Choice(["linear", "pendulum"]),
    default="linear",
    show_default=True,
    help="The spring's law; pendulum for an angle that swings far.",
)
@click.option("--channel", metavar="NAME", help="x, theta, v or a; the first of these that the file has unless given.")
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for the results; FILE-stickslip unless given.",
)
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the results as JSON and nothing else; a folder is written only with --output.",
)
@_reading
def decay(files: tuple[str, ...], output: Path | None, as_json: bool, **options: Any) -> None:
    """Tell viscous from dry friction by how a released mass dies away.

    FILES hold free decays: displacement, angle, velocity or acceleration of something that was let go. Several
    releases in one file are told apart. A quoted pattern ("release_*.csv") stands for all files that fit.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip decay release.csv --channels "x=disp [mm]" --stiffness "2.31 N/mm"
    stickslip decay "release_*.csv" --method thesis --json
    """
    asked = {key: options.pop(key) for key in ("method", "channel", "restoring", "mass", "stiffness")}
    rig = _rig(**options)
    groups = [group for argument in files for group in _groups(argument)]
    folder = output or (_default_folder(groups) if len(groups) == 1 else Path("decays-stickslip"))
    found: list[DecayFindings] = []
    refused: list[ss.StickslipError] = []
    with _progress(2 * len(groups) + 1) as tell:
        for number, group in enumerate(groups):
            with _collected(refused, group):
                tell(f"reading {_name(group)}", 2 * number)
                record = _read(group, rig)
                tell(f"fitting {_name(group)}", 2 * number + 1)
                stated = {key: asked[key] or getattr(rig, key) for key in ("mass", "stiffness")}
                found.append(ss.analyze_decay(record, **{**asked, **stated}))
        if not found:
            raise _none_answers(refused)
        tell("drawing and writing", 2 * len(groups))
        written = ss.publish(found, folder=folder) if output or not as_json else None
    _name_left_out(refused)
    _show(found, written, as_json=as_json)


@main.command()
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    default=Path("stickslip-demo"),
    show_default=True,
    metavar="DIR",
    help="Folder for the results.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON and nothing else.")
def demo(output: Path, as_json: bool) -> None:
    """Analyse the bundled record of a simulated rig, with the true answers beside the estimates."""
    with _progress(3) as tell:
        tell("reading the bundled record", 0)
        record = ss.datasets.demo()
        tell("analysing", 1)
        constants = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
        findings = ss.analyze(record, **constants)
        tell("drawing and writing", 2)
        written = ss.publish(findings, folder=output)
    _show(findings, written, as_json=as_json)


@main.command()
@click.argument("case", required=False, metavar="[SCENARIO|FILE.toml]")
@click.option("--list", "listed", is_flag=True, help="List the scenarios, with what is known of each.")
@click.option("--duration", metavar="TIME", help="Time to simulate in s, or with its unit.")
@click.option("--cycles", type=click.FloatRange(min=0, min_open=True), help="The same in periods of the drive.")
@click.option(
    "--set",
    "changes",
    multiple=True,
    metavar='"NAME=VALUE"',
    help='Another value of a parameter: "kinetic=1.3", "amplitude=0.7 mm", "law.stiffness=2 N/um". Repeatable.',
)
@click.option("--fs", metavar="HZ", help="Sampling rate of the record; fine enough for the motion unless given.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["csv", "h5", "parquet"]),
    default="csv",
    show_default=True,
    help="Format of the record.",
)
@click.option("--animate", "animation", type=click.Choice(["gif", "mp4"]), help="Add a moving picture; mp4 by ffmpeg.")
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for the results; NAME-stickslip unless given.",
)
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the results as JSON and nothing else; a folder is written only with --output.",
)
def simulate(case: str | None, listed: bool, output: Path | None, as_json: bool, **options: Any) -> None:
    """Simulate masses that rub, exactly, event by event.

    What to simulate is a named scenario, or a TOML file of a system: masses, friction laws and a drive. Without
    a name the scenarios are listed.

    Results go into a folder: results.json, the events, the sampled record with friction, and the figures.

    \b
    stickslip simulate FD-4
    stickslip simulate slider.toml --cycles 100 --set "kinetic=1.3 N" --animate gif

    Ctrl-C while it runs keeps what was simulated until then, marked "interrupted", with exit code 130.
    """
    if case is None or listed:
        _list_scenarios(as_json=as_json)
        return
    wanted = _case(case, **{key: options.pop(key) for key in ("duration", "cycles", "changes", "fs")})
    folder = output or (None if as_json else Path(f"{_fit_for_a_file(wanted.name)}-stickslip"))
    if folder:
        ss.require_output(wanted, folder=folder, **options)
    with _progress(4 if options["animation"] else 3) as tell:
        tell("simulating", 0)
        result = ss.outcome(wanted, progress=lambda share: tell(f"simulating, {share:.0%}", share))
        written = ss.publish_run(result, folder=folder, tell=tell, **options) if folder else None
    _show_run(result, written, as_json=as_json)
    if result.run.status == "interrupted":
        raise SystemExit(INTERRUPTED)


@main.command()
@click.argument("file")
@click.option("--channel", metavar="NAME", help="Which channel; a, sound, force, load, friction, v or x unless given.")
@click.option("--frequencies", metavar="LOW:HIGH", help="Range of the map in Hz; what the record allows unless given.")
@click.option("--wavelet-frequency", type=float, default=4.5, show_default=True, help="How long a wavelet is.")
@click.option("--normalisation", type=click.Choice(["energy", "amplitude"]), default="energy", show_default=True)
@click.option("--mass", metavar="VALUE", help="Oscillating mass in kg, or with its unit, for the contact's stiffness.")
@click.option("--stiffness", metavar="VALUE", help="Spring in N/m, or with its unit, for the same.")
@click.option("--output", type=click.Path(path_type=Path), metavar="DIR", help="Folder for the results; FILE-wavelet.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON and nothing else; a folder only with --output.")
@_reading
def wavelet(file: str, output: Path | None, as_json: bool, frequencies: str | None, **options: Any) -> None:
    """Map a channel over time and frequency, and tell what its sticks are like.

    Of an acceleration: at which frequency the contact rings while the mass sticks, how many micro-slips there are,
    and which mechanism that shows. FILE may be several joined with +, as in x.mat+a.mat.

    \b
    stickslip wavelet run.csv --channels "a=acc [m/s^2]" --mass 2.42 --stiffness 2310
    stickslip wavelet squeal.ogg --frequencies 500:8000 --wavelet-frequency 20
    """
    groups = _groups(file)
    if len(groups) != 1:
        raise click.BadParameter(f"'{file}' fits {len(groups)} records; one is mapped at a time", param_hint="FILE")
    asked = {key: options.pop(key) for key in ("channel", "wavelet_frequency", "normalisation", "mass", "stiffness")}
    rig = _rig(**options)
    folder = output or (None if as_json else Path(f"{groups[0][0].stem}-wavelet"))
    with _progress(3) as tell:
        tell(f"reading {_name(groups[0])}", 0)
        record = _read(groups[0], rig)
        tell("mapping", 1)
        for name in ("mass", "stiffness"):
            asked[name] = asked[name] if asked[name] is not None else getattr(rig, name)
        found = ss.time_frequency(record, frequencies=_range(frequencies), **asked)
        tell("drawing and writing", 2)
        written = ss.publish(found, folder=folder) if folder else None
    _show(found, written, as_json=as_json)


@main.command()
@click.argument("file")
@_reading
def check(file: str, **options: Any) -> None:
    """Tell what is wrong with a record, with row numbers."""
    rig = _rig(**options)
    refused: list[ss.StickslipError] = []
    for group in _groups(file):
        with _collected(refused, group):
            record = _read(group, rig)
            click.echo(f"{record!r}")
            for words in [str(fault) for fault in record.check()] or ["nothing wrong was found"]:
                click.echo(f"- {_spoken(words)}")
    for error in refused[:-1]:
        click.echo(f"stickslip: {_spoken(error)}", err=True)
    if refused:
        raise refused[-1]


@main.command()
@click.argument("file")
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--force", is_flag=True, help="Write over OUT if it is there.")
@_reading
def convert(file: str, out: Path, force: bool, **options: Any) -> None:
    """Read FILE and write it as OUT: CSV, HDF5 or Parquet by its suffix, with units and history."""
    groups = _groups(file)
    if len(groups) != 1:
        raise click.BadParameter(f"'{file}' fits {len(groups)} records; one is converted at a time", param_hint="FILE")
    if out.exists() and any(out.samefile(path) for path in groups[0]):
        raise click.BadParameter(f"'{out}' is the file to be read", param_hint="OUT")
    if out.exists() and not force:
        raise click.BadParameter(f"'{out}' is there already; --force writes over it", param_hint="OUT")
    click.echo(ss.write_record(_read(groups[0], _rig(**options)), out, overwrite=force))


@main.command()
@click.argument("name", required=False)
def datasets(name: str | None) -> None:
    """List the public record sets, or fetch the one named."""
    if name is not None:
        for path in ss.datasets.fetch(name).files:
            click.echo(path)
        return
    for each in ss.datasets.names():
        click.echo(f"{ss.datasets.info(each)}\n")


def _range(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        low, high = (float(end) for end in text.split(":"))
    except ValueError as error:
        raise click.BadParameter(f"'{text}' is not LOW:HIGH in Hz", param_hint="--frequencies") from error
    return low, high


def _case(name: str, *, duration: str | None, cycles: float | None, changes: Sequence[str], fs: str | None) -> Case:
    """The scenario or the file of that name, with what the command line changes."""
    case = ss.read_system(name) if name.endswith(".toml") or Path(name).is_file() else ss.scenario_case(name)
    case = case.having(**dict(_pair(change, "--set") for change in changes))
    return case.lasting(duration=duration, cycles=cycles, fs=fs)


def _fit_for_a_file(name: str) -> str:
    return "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in name)


def _list_scenarios(*, as_json: bool) -> None:
    found = {name: ss.scenarios.get(name) for name in ss.scenarios.names()}
    if as_json:
        click.echo(json.dumps({name: each.about for name, each in found.items()}, indent=2, ensure_ascii=False))
        return
    cases = [(ss.scenario_case(name), ", ".join(each.known).replace("_", " ")) for name, each in found.items()]
    for (about, parts, known), group in itertools.groupby(
        cases, key=lambda each: (each[0].about, each[0].parts, each[1])
    ):
        click.echo(f"\n{about}\n  {parts}; known: {known}")
        line = ""
        for case, _ in group:
            name = f'  "{case.name}"'
            if len(line) + len(name) > LIST_WIDTH:
                click.echo(line)
                line = ""
            line += name
        click.echo(line)
    click.echo(f'\n{len(found)} scenarios; run one with: stickslip simulate "NAME"')


def _rig(
    *,
    config: Path | None,
    channels: Sequence[str],
    units: Sequence[str],
    repair: str | None,
    normal: Sequence[str] = (),
    **constants: str | None,
) -> RigSettings:
    """The settings of the file, with those of the command line in front."""
    given: dict[str, Any] = {key: value for key, value in constants.items() if value is not None}
    base = ss.read_rig(config).model_dump() if config else {}
    for key, pairs in (("channels", channels), ("units", units)):
        if pairs:
            given[key] = {**base.get(key, {}), **dict(_pair(pair, f"--{key}") for pair in pairs)}
    if repair is not None:
        given["repair"] = [word.strip() for word in repair.split(",") if word.strip()]
    if normal:  # the first pattern that fits decides
        loads = dict(_pair(load, "--normal") if "=" in load else ("*", load) for load in normal)
        given["normal"] = loads | {key: load for key, load in base.get("normal", {}).items() if key not in loads}
    return ss.rig_settings({**base, **given}, source="the command line")


def _require_fits(normal: Sequence[str], groups: Sequence[Sequence[Path]]) -> None:
    """Refuse a load stated for files that are not there: it is a typing error."""
    names = [name for group in groups for name in (*(path.name for path in group), _name(group))]
    for load in normal:
        pattern, separator, _ = load.partition("=")
        if separator and not fnmatch.filter(names, pattern.strip()):
            raise click.BadParameter(f"no file fits '{pattern.strip()}'", param_hint="--normal")


def _groups(argument: str) -> list[list[Path]]:
    """The records that an argument stands for, each as its files: patterns filled in, parts joined by + paired."""
    if Path(argument).is_dir():
        raise click.BadParameter(
            f"'{argument}' is a folder; name a file, or a pattern like '{Path(argument) / '*.csv'}'", param_hint="FILES"
        )
    if Path(argument).exists():
        return [[Path(argument)]]
    parts = []
    for part in argument.split("+"):
        fits = [Path(part)] if Path(part).exists() else sorted(Path(path) for path in glob.glob(part))
        if not fits:
            raise click.BadParameter(f"no file is called, or fits, '{part}'", param_hint="FILES")
        parts.append(fits)
    if len({len(fits) for fits in parts}) > 1:
        counts = " and ".join(str(len(fits)) for fits in parts)
        raise click.BadParameter(
            f"the parts of '{argument}' fit {counts} files; each record needs one of each", param_hint="FILES"
        )
    return [list(files) for files in zip(*parts, strict=True)]


def _default_folder(groups: Sequence[Sequence[Path]]) -> Path:
    return Path(f"{groups[0][0].stem}-stickslip") if len(groups) == 1 else Path("comparison-stickslip")


def _name(files: Sequence[Path]) -> str:
    return " + ".join(path.name for path in files)


def _answers(
    groups: Sequence[Sequence[Path]], rig: RigSettings, method: str, tell: Callable[[str, int], None]
) -> tuple[Findings | Comparison, list[ss.StickslipError]]:
    """What the records answer, together; and why those that are left out do not."""
    found: list[Findings] = []
    refused: list[ss.StickslipError] = []
    for number, group in enumerate(groups):
        with _collected(refused, group):
            tell(f"reading {_name(group)}", 2 * number)
            record = _read(group, rig)
            tell(f"checking and analysing {_name(group)}", 2 * number + 1)
            found.append(ss.analyze(record, rig=rig, method=method))
    if not found:
        raise _none_answers(refused)
    results = ss.compare(found) if len(found) > 1 else found[0]
    notes = (*results.notes, *(f"Left out: {error}" for error in refused))
    return dataclasses.replace(results, notes=notes), refused


def _none_answers(refused: Sequence[ss.StickslipError]) -> ss.StickslipError:
    first, many = refused[0], f"none of {len(refused)} records answers; the first: " * (len(refused) > 1)
    return type(first)(f"{many}{first.value}", first.rule, first.next_step)


def _name_left_out(refused: Iterable[ss.StickslipError]) -> None:
    for error in refused:
        click.echo(f"stickslip: left out: {_spoken(error)}", err=True)


@contextlib.contextmanager
def _collected(refused: list[ss.StickslipError], files: Sequence[Path]) -> Iterator[None]:
    """Put what the data can not answer aside, with the file's name; what was asked wrongly ends all."""
    try:
        yield
    except ss.ModelError:
        raise
    except ss.StickslipError as error:
        known = any(path.name in str(error) for path in files)
        value = error.value if known else f"{_name(files)}: {error.value}"
        refused.append(type(error)(value, error.rule, error.next_step))


def _read(files: Sequence[Path], rig: RigSettings) -> Record:
    paths: Any = files[0] if len(files) == 1 else list(files)
    given = {key: getattr(rig, key) or None for key in ("channels", "fs", "units", "time", "delimiter", "decimal")}
    record = ss.read_record(paths, rows=rig.row_range(), **given)
    return ss.mend(_with_source(record, files), repairs=rig.repair)


def _with_source(record: Record, files: Sequence[Path]) -> Record:
    """The record with its files in the history; one that write_record kept comes back without."""
    known = {file["name"] for step in record.history for file in step.arguments.get("files", ())}
    if {path.name for path in files} <= known:
        return record
    sources = [{"name": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()} for path in files]
    step = ss.Step("read_record", {"files": sources}, "a record as it was written")
    return dataclasses.replace(record, history=(*record.history, step))


@contextlib.contextmanager
def _progress(steps: int) -> Iterator[Callable[[str, float], None]]:
    """What is being done, on the error stream, for work that lasts; silent where nobody watches."""
    if not sys.stderr.isatty():
        yield lambda words, done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (
        SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    )  # fmt: skip
    progress = Progress(*columns, console=Console(stderr=True), transient=True)
    task = progress.add_task("", total=steps)
    patience = threading.Timer(PATIENCE, progress.start)
    patience.daemon = True
    patience.start()
    if PATIENCE <= 0:
        patience.join()
    try:
        yield lambda words, done: progress.update(task, completed=done, description=words, refresh=True)
    finally:
        patience.cancel()
        progress.stop()


def _show(
    results: Findings | Comparison | TimeFrequency | list[DecayFindings], written: Path | None, *, as_json: bool
) -> None:
    if as_json:
        told = {"records": [each.to_dict() for each in results]} if isinstance(results, list) else results.to_dict()
        click.echo(json.dumps(told, indent=2, ensure_ascii=False, allow_nan=False))
        return
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=False)
    for part in results if isinstance(results, list) else (*getattr(results, "findings", ()), results):
        _print_table(console, part)
    if written is not None:
        click.echo(f"Report: {written / 'report.html'}")


def _print_table(console: Any, results: Findings | Comparison | TimeFrequency | DecayFindings) -> None:
    from rich.markup import escape

    summary = ss.summary(results)
    console.print(f"\n[bold]{escape(summary.title)}[/bold]")
    for sentence in (*summary.headline, *summary.cautions, *(f"- {fault}" for fault in summary.faults or ())):
        console.print(escape(_spoken(sentence)))
    truth = summary.has_truth
    headings = ("quantity", "value", "95 % interval", *(["true value"] if truth else []), "how sure")
    rows = (
        [line.name, line.value, line.interval, *([line.true or "-"] if truth else []), line.status]
        for line in summary.lines
    )
    console.print(_table(headings, rows))
    if summary.verdicts:
        console.print(_table(("motion tried", "verdict"), summary.verdicts))
    for note in summary.notes:
        console.print(f"[dim]Note: {escape(_spoken(note))}[/dim]")


def _show_run(result: Outcome, written: Path | None, *, as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(result.to_dict(), indent=2, ensure_ascii=False, allow_nan=False))
        return
    from rich.console import Console
    from rich.markup import escape

    console = Console(highlight=False, soft_wrap=False)
    console.print(f"\n[bold]{escape(result.case.name)}[/bold]  {escape(result.case.about)}")
    for sentence in result.sentences:
        console.print(escape(sentence))
    console.print(_table(("quantity", "value"), result.rows))
    if result.known:
        answers = [(name, str(pair["known"]), str(pair["found"])) for name, pair in result.known.items()]
        console.print("\nKnown of this scenario, and what the engine finds:")
        console.print(_table(("answer", "known", "found"), answers))
    count, events = result.run.event_counts().total(), list(itertools.islice(result.run.each_event(), SHOWN_EVENTS))
    if events:
        several = any(event.contact for event in events)
        rows = [
            (f"{event.time:.9g}", event.kind, *([str(event.contact + 1)] if several else []), event.mode)
            for event in events
        ]
        headings = ("time [s]", "event", *(["contact"] if several else []), "mode that begins")
        console.print("")
        console.print(_table(headings, rows))
        if count > len(rows):
            click.echo(f"... and {count - len(rows)} more{', in events.csv' if written is not None else ''}")
    if written is not None:
        click.echo(f"Results: {written}")


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Any:
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in headings:
        table.add_column(heading, overflow="fold")
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    return table
