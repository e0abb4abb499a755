"""stickslip check, convert, datasets and init: files before anything is asked of them"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli import option
from stickslip.cli.records import RIG_FILE, collected, files_of, groups_of, require_described, rig_of
from stickslip.cli.terminal import aligned, complain, say, spoken, wrapped

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.answers import Findings
    from stickslip.rig import Guess, RigSettings


@click.command()
@click.argument("file")
@option.reading
def check(file: str, **options: Any) -> None:
    """Tell what is wrong with a record, with row numbers."""
    rig = rig_of(file, **options)
    refused: list[ss.StickslipError] = []
    groups = groups_of(file)
    for group in groups:
        with collected(refused, group):
            record = ss.answers.read_mended(group, rig=rig)
            if len(groups) == 1:
                require_described(record)
            say(f"{record!r}")
            if outcome := record.history[0].outcome:  # what a device wrote was read as it is
                say(f"- {spoken(f'read: {outcome}')}")
            faults = [str(fault) for fault in record.check()]
            if (wrong := ss.answers.stated_wrongly([record], rig=rig)) is not None:
                faults.append(ss.summary(wrong).answer)
            for fault in faults or ["nothing wrong was found"]:
                say(f"- {spoken(fault)}")
    for error in refused[:-1]:
        complain(spoken(error))
    if refused:
        raise refused[-1]


@click.command()
@click.argument("file")
@click.argument("out", type=option.PATH)
@click.option("--force", is_flag=True, help="Write over OUT if it is there.")
@option.reading
def convert(file: str, out: Path, force: bool, **options: Any) -> None:
    """Read FILE and write it as OUT: CSV, HDF5 or Parquet by its suffix, with units and history."""
    files = files_of(file, "one is converted at a time")
    if out.exists() and any(out.samefile(path) for path in files):
        raise click.BadParameter(f"'{out}' is the file to be read", param_hint="OUT")
    if out.exists() and not force:
        raise click.BadParameter(f"'{out}' is there already; --force writes over it", param_hint="OUT")
    record = require_described(ss.answers.read_mended(files, rig=rig_of(file, **options)))
    say(ss.write_record(record, out, overwrite=force))


@click.command()
@click.argument("name", required=False)
@option.everything
def datasets(name: str | None, everything: bool) -> None:
    """List the public record sets, or fetch the one named and tell its columns, units and rig."""
    if name is not None:
        say(ss.datasets.info(name), err=True)
        for path in ss.datasets.fetch(name).files:
            say(path)
        return
    sets = [ss.datasets.info(key) for key in ss.datasets.names()]
    if everything:
        say("\n\n".join(map(str, sets)))
        return
    rows = [(entry.name, entry.title, entry.licence) for entry in sets]
    say("\n".join(aligned(("name", "record set", "licence"), rows)))
    say("\nMore with --all, or of one: stickslip datasets NAME")


NONE = "-"  # what is typed for a column that is left out
LOOKED_AT = 64  # rows of each further file
USUAL = {"x": "m", "z": "m", "v": "m/s", "a": "m/s^2", "theta": "rad"} | dict.fromkeys(
    ("load", "force", "friction", "normal"), "N"
)
ASKED = ("x", "z", "v", "a", "load", "force", "friction", "normal", "theta", "sound")
CONSTANTS = {
    "mass": "Mass that moves (kg, or with its unit; ± its uncertainty)",
    "stiffness": "Stiffness of the spring (N/m, or as 2.31 N/mm)",
    "damping": "Viscous damping of the suspension (N s/m)",
}


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@option.constants()
@click.option("--yes", is_flag=True, help="Ask nothing: take what was recognised and what the options say.")
@option.path("--output", "FILE", "The file to write.", default=Path(RIG_FILE), show_default=True)
@click.option("--force", is_flag=True, help="Write over it if it is there.")
@option.reading
def init(files: tuple[str, ...], yes: bool, output: Path, force: bool, **options: Any) -> None:
    """Describe a rig once: columns, units and constants go into rig.toml.

    FILES are records of the rig. Shown is what was recognised in the first of them; asked is what each column measures,
    its unit, and the rig's mass, spring and damper with their uncertainties. In the folder of rig.toml the other
    commands need no options then.

    \b
    stickslip init run1.csv
    stickslip init "run_*.csv" --yes --mass "2.42 ± 0.02 kg" --stiffness "2.31 N/mm"
    """
    if output.exists() and not force:
        raise click.BadParameter(f"'{output}' is there already; --force writes over it", param_hint="--output")
    groups = groups_of(*files)
    stated = rig_of(**{**options, "here": False})
    record = ss.answers.read_mended(groups[0], rig=stated)
    guesses = [] if stated.channels else ss.rig.guess_columns(record)
    _show(groups[0], record, guesses)
    if not yes:
        guesses = [_confirmed(guess) for guess in guesses]
    settings = _settings(options, stated, guesses, {} if yes else _constants(stated, record, guesses))
    rig = ss.rig.rig_settings(settings, source="the answers")
    try:
        output.write_text("\n".join(_toml(settings, groups[0])) + "\n", encoding="utf-8")
    except OSError as error:
        raise click.BadParameter(f"'{output}' can not be written ({error.strerror})", param_hint="--output") from error
    for line in _after(groups, rig, output):
        say(line)


# ---- what is shown


def _show(files: Sequence[Path], record: Record, guesses: Sequence[Guess]) -> None:
    say(" + ".join(map(str, files)))
    say(f"{len(record)} samples at {record.fs:.6g} Hz, {record.duration:.4g} s.")
    rows = [
        (guess.column, guess.unit + ("" if guess.stated else " ?"), guess.spanned, _description(guess))
        for guess in guesses
    ]
    for line in aligned(("column", "unit", "span", "taken for"), rows) if rows else ():
        say(line)
    suspicious = [
        f"{guess.column}: the file states no unit; {guess.unit} is a guess." for guess in guesses if _unsure(guess)
    ]
    suspicious += [
        f"{guess.column}: taken for {guess.channel} by its unit alone." for guess in guesses if "alone" in guess.why
    ]
    faults = [spoken(fault) for fault in record.check() if fault.kind != "unit"]
    for sentence in (*suspicious, *faults):
        for line in wrapped(sentence, "! "):
            say(line)


def _unsure(guess: Guess) -> bool:
    return not guess.stated and bool(guess.unit) and guess.unit != "1"


def _description(guess: Guess) -> str:
    return f"{guess.channel}, {guess.words}" if guess.channel else guess.words


# ---- what is asked


def _confirmed(guess: Guess) -> Guess:
    """The column as the user calls it."""
    say()
    channel = click.prompt(
        f"{guess.column}: {', '.join(ASKED)}, or {NONE} to leave it out",
        default=guess.channel or NONE,
        value_proc=_a_channel,
        err=False,
    )
    if channel == NONE:
        return replace(guess, channel="")
    unit = guess.unit if guess.stated else click.prompt("  its unit", default=guess.unit or USUAL.get(channel, "1"))
    return replace(guess, channel=channel, unit=unit, why="your word")


def _a_channel(text: str) -> str:
    if text != NONE and text not in ASKED:
        raise click.UsageError(f"'{text}' is none of {', '.join(ASKED)}, {NONE}")
    return text


def _constants(stated: RigSettings, record: Record, guesses: Sequence[Guess]) -> dict[str, str]:
    """Mass, spring, damper and what the mass slides on, where they are not stated; nothing of what is not known."""
    say()
    constants: dict[str, str] = {}
    for name, question in CONSTANTS.items():
        if name not in stated.model_fields_set:
            answer = click.prompt(
                f"{question}; Enter if not known", default="", show_default=False, value_proc=_a(name)
            )
            constants |= {name: answer} if answer else {}
    if any(guess.channel == "z" for guess in guesses):
        for name, question in (("contact", "What does the mass slide on"), ("damper", "What does the damper end on")):
            if name not in stated.model_fields_set:
                constants[name] = click.prompt(question, type=click.Choice(["ground", "base"]), default="ground")
    return constants


def _a(name: str) -> Callable[[str], str]:
    """A constant as typed, refused where it has no meaning."""

    def proper(text: str) -> str:
        try:
            ss.rig.rig_settings({name: text} if text else {}, source="the answer")
        except ss.errors.ModelError as error:
            raise click.UsageError(f"{error.value}; {error.rule}") from error
        return text

    return proper


# ---- what is written


def _settings(
    options: Mapping[str, Any], stated: RigSettings, guesses: Sequence[Guess], answers: Mapping[str, str]
) -> dict[str, Any]:
    given = {name: options[name] for name in (*CONSTANTS, "damper", "contact") if options[name] is not None}
    known = {key: value for key, value in stated.model_dump(exclude_unset=True).items() if key not in given}
    channels = {guess.channel: guess.text for guess in guesses if guess.channel}
    return {**known, **given, **answers, **({"channels": channels} if channels else {})}


def _toml(settings: Mapping[str, Any], files: Sequence[Path]) -> Iterator[str]:
    yield f"# The rig of {' + '.join(path.name for path in files)}, as stickslip init wrote it. A bare number is in SI."
    yield '# State how sure a constant is as in mass = "2.42 ± 0.02 kg", and a gain as in a = "acc [g] ± 1 %".'
    yield from ss.rig.rig_toml(settings)


# ---- what comes of it


def _after(groups: Sequence[Sequence[Path]], rig: RigSettings, output: Path) -> Iterator[str]:
    """Whether the other files are alike, whether all can be true, and what to type next."""
    yield ""
    yield f"{output} is written."
    for group in groups[1:]:
        try:
            ss.answers.read_mended(group, rig=rig.model_copy(update={"rows": f"0:{LOOKED_AT}", "repair": ()}))
        except ss.StickslipError as error:
            complain(f"{' + '.join(map(str, group))} is not like the first: {spoken(error)}")
    for sentence in _wrong(groups[0], rig):
        yield from wrapped(sentence, "! ")
    config = "" if output == Path(RIG_FILE) else f" --config {output}"
    yield f"Next: stickslip analyze {'+'.join(map(str, groups[0]))}{config}"


def _wrong(files: Sequence[Path], rig: RigSettings) -> Iterator[str]:
    """What the record says against what was stated."""
    try:
        findings: Findings = ss.analyze(ss.answers.read_mended(files, rig=rig), rig=rig)
    except ss.StickslipError as error:
        yield spoken(error)
        return
    if findings.contradiction or findings.results["lacking"]:
        yield spoken(ss.summary(findings).answer)
