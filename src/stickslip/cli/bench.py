"""stickslip acquire and devices; commission; bench, the experiment on a simulated one"""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
import stickslip.bench as bench
from stickslip.cli import option
from stickslip.cli.records import groups_of, pair
from stickslip.cli.terminal import aligned, deliver, print_json, progress, redrawn, say, say_json, wrapped
from stickslip.errors import ABSENT, INTERRUPTED

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.bench import BenchStep, Device, SimulatedBench
    from stickslip.rig import RigSettings

Source = Callable[["BenchStep"], "Record | None"]


@click.command()
@click.argument("files", nargs=-1, metavar="[STEP=FILE]...")
@click.option(
    "--device",
    "name",
    metavar="NAME",
    help="What measures: a table [devices.NAME] of the configuration, or a kind of device. sim needs no hardware.",
)
@option.path("--config", "RIG.TOML", "What is known of the rig already.")
@option.several("--step", "NAME", "Record only this step. Repeatable.", to="steps")
@option.several("--again", "NAME", "Record this step anew. Repeatable.")
@option.count("--seed", 1, "Of a simulated rig's noise.", least=0)
@option.path(
    "--output", "DIR", "Folder of records, rig.toml and report; commission unless given, none where files are named."
)
@click.option("--list", "listed", is_flag=True, help="Print the steps, and what to do at each.")
@option.json()
@option.everything
def commission(
    files: tuple[str, ...], output: Path | None, as_json: bool, everything: bool, listed: bool, **options: Any
) -> None:
    """Commission a rig: find its constants and its sensors, and write rig.toml.

    Each step says what to do, records, and answers; what it finds is used by those after it. Records stay in
    DIR/records: a second call goes on where the first one ended. At the end DIR holds rig.toml, as analyze and acquire
    read it, and report/report.html.

    STEP=FILE answers a step from a file that is there, without a device: one step alone, or several.

    \b
    stickslip commission --device sim
    stickslip commission --device daq --config rig.toml --step rest --step tap
    stickslip commission tap=hammer.csv --config rig.toml
    """
    chosen = [bench.step_named(name) for name in options["steps"]] or list(bench.STEPS)
    anew = {bench.step_named(name).name for name in options["again"]}
    if listed:
        say("\n".join(aligned(("step", "question", "at the rig"), [[s.name, s.title, s.todo] for s in chosen])))
        return
    config: Path | None = options["config"]
    rig = ss.rig.read_rig(config) if config else ss.rig.rig_settings({})
    given = dict(_step_and_file(file) for file in files)
    if given and not options["steps"]:
        chosen = [step for step in bench.STEPS if step.name in given]
    folder = output or (None if given or as_json else Path("commission"))
    device = _device(options["name"], rig, config) if options["name"] else None
    if folder:  # what was recorded before stays part of the rig
        chosen = [step for step in bench.STEPS if step in chosen or _kept(folder, step.name).exists()]
    if device is None and not given and not (folder and (folder / "records").is_dir()):
        raise click.UsageError("nothing measures; name a --device (sim needs no hardware), or STEP=FILE")
    at_rig = device is not None and not isinstance(device, bench.Sim)
    if at_rig and folder is None and any(step.name not in given for step in chosen):
        raise click.UsageError("a device records into files; name --output")
    source, truth = _source(given, device, rig, folder, seed=options["seed"], anew=anew)
    rig = _seen_from(folder, rig, config) if folder and config else rig
    if at_rig:  # who is there is asked, and no bar runs beside
        done = bench.commission(source, rig=rig, steps=chosen, answered=_answered)
    else:
        with progress(len(chosen)) as tell:
            done = bench.commission(source, rig=rig, steps=chosen, truth=truth, progress=tell)
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
        done.known.write(folder / "rig.toml")
    deliver(done, folder and folder / "report", as_json=as_json, everything=everything)
    if folder and not as_json:
        say(f"Settings: {folder / 'rig.toml'}")
    if done.refused and not done.results:  # the data can not answer
        raise SystemExit(1)


def _seen_from(folder: Path, rig: RigSettings, config: Path) -> RigSettings:
    """The settings with the files that devices name, as they are called from another folder than that of `config`."""

    def named(value: Any) -> Any:
        is_file = isinstance(value, str) and (config.parent / value).is_file()
        return os.path.relpath(config.parent / value, folder) if is_file else value

    tables = {name: {key: named(value) for key, value in table.items()} for name, table in rig.devices.items()}
    return rig.model_copy(update={"devices": tables})


def _step_and_file(text: str) -> tuple[str, Path]:
    """A step and the file that answers it."""
    name, file = pair(text, "STEP=FILE")
    return bench.step_named(name).name, groups_of(file)[0][0]


def _device(name: str, rig: RigSettings, config: Path | None) -> Device:
    return bench.find_device(name, rig.devices, folder=config.parent if config else None)


def _source(
    given: dict[str, Path], device: Device | None, rig: RigSettings, folder: Path | None, *, seed: int, anew: set[str]
) -> tuple[Source, dict[str, float]]:
    """What gives the record of a step, and the truth where the rig is simulated."""
    bench_of = _simulated(device, rig, seed)

    def source(step: BenchStep) -> Record | None:
        if step.name in given:
            stated = _of_file(given[step.name], step, rig)
            stated.require(*step.needs, question=f"the step {step.name}")
            return stated
        kept = _kept(folder, step.name) if folder else None
        if kept is not None and kept.exists() and step.name not in anew:
            return ss.read_record(kept)
        if device is None:
            return None
        if kept is not None:
            kept.parent.mkdir(parents=True, exist_ok=True)
        if bench_of is not None:
            record = rig.logged(bench_of.step(step)) if step.fits(bench_of.rig) else None
            if record is not None and kept is not None:
                ss.write_record(record, kept, overwrite=True)
            return record
        assert kept is not None
        try:
            return _asked_at_rig(device, step, kept, rig)
        except (click.Abort, KeyboardInterrupt) as error:
            stay = f"the steps before stay in {kept.parent}, and the same command goes on there"
            raise KeyboardInterrupt("; ".join(filter(None, (str(error), stay)))) from error

    return source, bench_of.truth if bench_of is not None else {}


def _of_file(file: Path, step: BenchStep, rig: RigSettings) -> Record:
    """A step's record from a file: the rig's channels, without those that neither the step needs nor the file has."""

    def has(channel: str) -> bool:
        try:
            ss.read_blocks(file, **{**rig.reading(), "channels": {channel: rig.channels[channel]}})
        except ss.errors.RecordError as error:
            if error.kind != ABSENT:
                raise
            return False
        return True

    channels = {name: text for name, text in rig.channels.items() if name in step.needs or has(name)}
    return ss.answers.read_mended([file], rig=rig.model_copy(update={"channels": channels}))


def _kept(folder: Path, name: str) -> Path:
    """Where the record of a step is kept."""
    return folder / "records" / f"{name}.{'h5' if importlib.util.find_spec('h5py') else 'csv'}"


def _simulated(device: Device | None, rig: RigSettings, seed: int) -> SimulatedBench | None:
    """The bench that stands behind a simulated device: it can be weighed, tapped and loaded too."""
    if not isinstance(device, bench.Sim):
        return None
    system: Any = device.system
    hand = rig.commission or ss.rig.CommissionSettings()
    return bench.SimulatedBench(system, device.rig, device.fs, seed, hand)


def _asked_at_rig(device: Device, step: BenchStep, kept: Path, rig: RigSettings) -> Record | None:
    """The record of a step at a real rig, once its hands are ready."""
    if any(name not in [one.name for one in device.inputs] for name in step.needs):
        return None
    say(f"{step.title}\n  {step.todo}", err=True)
    if (left := bench.journal_of(kept)).exists():
        say(f"  {left.name} holds what came when it was cut short; it goes when the step is recorded anew.", err=True)
    if not click.confirm(f"  Record {step.seconds:g} s now?", default=True, err=True):
        return None
    bench.journal_of(kept).unlink(missing_ok=True)
    moved = {"base": bench.sweep_of(device.fs)} if step.drives and device.outputs else {}
    wanted = bench.Wanted(seconds=step.seconds, drive=moved, log=rig.log)
    with _aside(kept):
        with _picture(step.seconds) as watch:
            done = bench.acquire(device, output=kept, wanted=wanted, watch=watch)
        if done.ended == "interrupted":  # half a step answers nothing; those before it stay
            kept.unlink()
            raise KeyboardInterrupt
    say(f"  {done.outcomes[device.name]}", err=True)
    return ss.read_record(done.paths[0])


@contextlib.contextmanager
def _aside(file: Path) -> Iterator[None]:
    """Put a file aside until another has taken its place; where none does it is back."""
    before = file.with_stem(f"{file.stem}-before")
    if file.exists():
        file.replace(before)
    try:
        yield
    finally:
        if file.exists():
            before.unlink(missing_ok=True)
        elif before.exists():
            before.replace(file)


@contextlib.contextmanager
def _picture(seconds: float) -> Iterator[Callable[[Device, bench.Block], None] | None]:
    """What draws the blocks of a recording on the error stream as they come; nothing where nobody watches."""
    drawn, due = bench.Picture(seconds), 0.0
    with redrawn() as draw:
        if draw is None:
            yield None
            return

        def watch(device: Device, block: bench.Block) -> None:
            nonlocal due
            drawn.add(device, block)
            if time.monotonic() >= due:
                draw(drawn.lines(device))
                due = time.monotonic() + 0.1

        yield watch


def _answered(step: BenchStep, outcome: Any) -> None:
    """What a step found, before the next one is asked; on the error stream, as the questions are."""
    if isinstance(outcome, str):
        rows = [f"not answered: {outcome}"]
    else:
        rows = [str(replace(number, status="ok")) for number in outcome.estimates]
        rows += ss.story.doubts(outcome.estimates)
    say("\n".join(line for row in rows for line in wrapped(row, "  ")), err=True)


TRIGGER = re.compile(r"\s*(\w+)\s*([<>])\s*(\S+)\s*")


@click.command()
@option.several(
    "--device",
    "NAME",
    "A table [devices.NAME] of the configuration, or a kind of device. Repeatable.",
    to="names",
    required=True,
)
@option.path("--config", "RIG.TOML", "File of the rig and its devices.")
@click.option("--seconds", type=option.POSITIVE, help="How long; until Ctrl-C unless given.")
@click.option(
    "--trigger", metavar='"CHANNEL>LEVEL"', help='Begin where a reading passes a level, in SI: "load>0.5", "x<-1e-3".'
)
@click.option("--before", type=click.FloatRange(min=0), metavar="S", help="Time before the trigger that is kept.")
@click.option(
    "--timeout",
    type=option.POSITIVE,
    metavar="S",
    help="How long the trigger is waited for; until Ctrl-C unless given.",
)
@option.several(
    "--drive", '"OUTPUT=AMPLITUDE@HZ"', 'Move an output by a tone meanwhile, in SI: "base=0.65e-3@2.5". Repeatable.'
)
@option.path(
    "--runs",
    "RUNS.TOML",
    "Record every run of a list, as bench next writes it, each with its own tone; --output names their folder.",
)
@option.path("--output", "FILE", "The record: .h5, .csv or .parquet; of --runs a folder.", required=True)
@option.json("Print what was recorded as JSON and nothing else.")
def acquire(names: tuple[str, ...], config: Path | None, output: Path, as_json: bool, **options: Any) -> None:
    """Record from devices into a file.

    What comes stands on the disk at once, in FILE.journal: it is a record up to the last block, whatever ends the
    program, and any command reads it. At the end it becomes FILE. Lost and clipped samples are told, and stand in the
    history beside device, ranges and serial numbers.

    \b
    stickslip acquire --device sim --seconds 30 --output run.h5
    stickslip acquire --device daq --config rig.toml --trigger "load>0.5" --before 0.2 --seconds 5 --output hit.h5
    """
    settings = ss.rig.read_rig(config) if config else None
    tables, folder = (settings.devices if settings else {}), config.parent if config else None
    chosen = [bench.find_device(name, tables, folder=folder) for name in names]
    log = settings.log if settings else None
    shaker = ss.rig.Shaker.of(settings.shaker) if settings and settings.shaker else None
    if options["runs"]:
        if given := [name for name in ("seconds", "trigger", "before", "timeout", "drive") if options[name]]:
            raise click.UsageError(f"--runs says what each run is; leave out --{', --'.join(given)}")
        _run_all(chosen, bench.read_runs(options["runs"]), output, log, shaker, as_json=as_json)
        return
    drive = dict(_driven(text) for text in options["drive"])
    trigger = _trigger(options["trigger"], options["before"], options["timeout"])
    wanted = bench.Wanted(options["seconds"], trigger, drive, log)
    _require_moved(chosen, wanted, shaker)
    with progress(100) as tell:
        done = bench.acquire(chosen, output=output, wanted=wanted, progress=_paced(tell))
    _recorded(done, as_json=as_json)
    if done.ended == "interrupted" and options["seconds"]:
        raise SystemExit(INTERRUPTED)


def _require_moved(devices: Any, wanted: bench.Wanted, shaker: Any) -> None:
    """Refuse a motion that a device's output, or the rig's shaker, can not make."""
    for output in (output for device in devices for output in device.outputs):
        output.require(wanted.drive.get(output.name), fs=devices[0].fs)
    tone = wanted.drive.get("base")
    if shaker is not None and isinstance(tone, bench.Tone):
        shaker.require(tone.frequency, tone.amplitude)


def _run_all(devices: Any, runs: bench.RunList, folder: Path, log: Any, shaker: Any, *, as_json: bool) -> None:
    """Every run of a list, each into a file of its name; one that is there already is left out."""
    every = {
        folder / f"{run.name}.h5": bench.Wanted(
            run.seconds, None, {run.on: bench.Tone(run.amplitude, run.frequency)}, log
        )
        for run in runs.run
    }
    for wanted in every.values():
        _require_moved(devices, wanted, shaker)
    folder.mkdir(parents=True, exist_ok=True)
    for path, wanted in every.items():
        if path.exists():
            say(f"{path} is there already: left out", err=True)
            continue
        with progress(100) as tell:
            done = bench.acquire(devices, output=path, wanted=wanted, progress=_paced(tell))
        _recorded(done, as_json=as_json)
        if done.ended == "interrupted":
            raise SystemExit(INTERRUPTED)


def _paced(tell: Callable[[str, float], None]) -> Callable[[str, float], None]:
    """What shows how far a recording is, some ten times a second."""
    due = 0.0

    def show(words: str, share: float) -> None:
        nonlocal due
        if time.monotonic() >= due:
            tell(words, 100 * share)
            due = time.monotonic() + 0.1

    return show


def _trigger(text: str | None, before: float | None, timeout: float | None) -> bench.Trigger | None:
    if text is None:
        for option, value in (("--before", before), ("--timeout", timeout)):
            if value:
                raise click.BadParameter("it is of a trigger; name one with --trigger", param_hint=option)
        return None
    match = TRIGGER.fullmatch(text)
    try:
        level = float(match[3])  # type: ignore[index]
    except (TypeError, ValueError):
        raise click.BadParameter(f"'{text}' is not CHANNEL>LEVEL or CHANNEL<LEVEL", param_hint="--trigger") from None
    return bench.Trigger(match[1], level, match[2] == ">", before or 0.0, timeout or math.inf)  # type: ignore[index]


def _driven(text: str) -> tuple[str, bench.Tone]:
    name, tone = pair(text, "--drive")
    amplitude, _, frequency = tone.partition("@")
    try:
        return name, bench.Tone(float(amplitude), float(frequency))
    except ValueError:
        raise click.BadParameter(f"'{text}' is not OUTPUT=AMPLITUDE@HZ", param_hint="--drive") from None


def _recorded(done: bench.Acquired, *, as_json: bool) -> None:
    if as_json:
        paths = [str(path) for path in done.paths]
        say_json({"files": paths, "devices": dict(done.outcomes), "ended": done.ended, "notes": [*done.notes]})
        return
    for name, outcome in done.outcomes.items():
        say("\n".join(wrapped(outcome, f"{name}: ")))
    for note in done.notes:
        say("\n".join(wrapped(note)))
    ended = "" if done.ended == "complete" else f" ({done.ended})"
    say(f"Written: {', '.join(map(str, done.paths))}{ended}")


@click.command()
@option.path("--config", "RIG.TOML", "List the devices that it names too.")
@option.json("Print the list as JSON and nothing else.")
def devices(config: Path | None, as_json: bool) -> None:
    """List what can measure here: kinds of devices, what is plugged in, and which package is missing.

    \b
    stickslip devices
    stickslip devices --config rig.toml
    """
    kinds = bench.devices()
    named = ss.rig.read_rig(config).devices if config else {}
    mine = {name: bench.find_device(name, named, folder=config.parent if config else None) for name in named}
    if as_json:
        about = {kind.kind: {"about": kind.about, "there": [*kind.there], "missing": kind.missing} for kind in kinds}
        named_so = {name: {"kind": one.kind, "model": one.model, "fs": one.fs} for name, one in mine.items()}
        say_json({"kinds": about, "named": named_so})
        return
    for name, one in mine.items():
        inputs = ", ".join(f"{entry.name} [{entry.unit}]" for entry in one.inputs)
        outputs = "".join(f"; moves {output.name}" for output in one.outputs)
        say("\n".join(wrapped(f"{one.model}, {one.fs:g} Hz: {inputs}{outputs}", f"{name:<8} ")))
    for kind in kinds:
        there = f"missing: {kind.missing}" if kind.missing else "; ".join(kind.there) or "nothing found"
        say("\n".join([*wrapped(kind.about, f"{kind.kind:<8} "), *wrapped(there, 9 * " ")]))


@click.group("bench")
def simulated_bench() -> None:
    """The whole experiment on a simulated bench, and what to measure next."""


@simulated_bench.command()
@click.option("--fast", is_flag=True, help="As fast as the computer can, and not in the time that a rig would take.")
@option.count("--seed", 1, "Draws gains, zeros and noise.", least=0)
@option.path(
    "--output",
    "DIR",
    "Folder of records, rig.toml, next.toml and report.",
    default=Path("bench-tour"),
    show_default=True,
)
@option.json()
@option.everything
def tour(fast: bool, seed: int, output: Path, as_json: bool, everything: bool) -> None:
    """Repeat the thesis's experiment on a simulated bench, from a bare rig to the report.

    The bench is commissioned; the base moves at 2.5, 5.61, 8.7 and 11.1 Hz, the mass is let go, a squeak rig rubs dry
    and wet; all is recorded, analysed, laws are compared, and DIR/report/report.html is what a lab would hand in, with
    the true values beside.
    """
    report = output / "report"
    option.usable(click.get_current_context(), None, report)  # type: ignore[arg-type]
    with progress(100) as tell:
        done = bench.tour(output, seed=seed, fast=fast, progress=lambda stage, share: tell(stage, 100 * share))
    deliver(done, report, as_json=as_json, everything=everything)


@simulated_bench.command("next")
@click.argument("laws", nargs=-1, required=True, metavar="LAW LAW...")
@option.path("--config", "RIG.TOML", "The rig, its shaker, its sensors.")
@option.count("--count", 3, "How many runs.")
@click.option("--seconds", type=option.POSITIVE, default=20.0, show_default=True)
@option.several("--done", '"AMPLITUDE@HZ"', 'A run made already: "0.65e-3@2.5". Repeatable.')
@option.path("--output", "RUNS.TOML", "Write the runs, for acquire.")
@option.json("Print the runs as JSON and nothing else.")
def following(
    laws: tuple[str, ...],
    config: Path | None,
    count: int,
    seconds: float,
    done: tuple[str, ...],
    output: Path | None,
    as_json: bool,
) -> None:
    """Which runs would tell most about the law that is left open?

    LAW is the folder of a fit's results, its law.toml, or a system's file; two or more, those that are left. Every
    motion that the shaker of RIG.TOML can make is simulated with each, and the runs in which they differ most are
    told, after what refitting them could take up.

    \b
    stickslip bench next rigid-fit compliant-fit --config rig.toml --output next.toml
    stickslip acquire --device daq --config rig.toml --runs next.toml --output records
    """
    motions = [_motion(motion) for motion in done]
    rig = ss.rig.read_rig(config) if config else None
    left = {Path(law).stem or law: ss.answers.read_fitted(law, rig=rig) for law in laws}
    sensor = rig.sensors.get("x") if rig else None
    noise = sensor.noise if sensor is not None and sensor.noise else 1e-6
    shaker = ss.rig.Shaker.of(rig.shaker if rig else None)
    with progress(1) as tell:
        tell("simulating what the shaker can do", 0)
        proposals = bench.next_runs(left, shaker=shaker, noise=noise, count=count, done=motions)
    runs = bench.run_list(proposals, seconds=seconds)
    if output:
        output.write_text(runs.toml(), encoding="utf-8")
    if as_json:
        print_json({"runs": [run.model_dump() for run in runs.run]})
        return
    rows = [[run.name, f"{run.frequency:g} Hz", f"{1e3 * run.amplitude:.3g} mm", run.why] for run in runs.run]
    say("\n".join(aligned(("run", "base", "amplitude", "why"), rows)))
    if output:
        say(f"Runs: {output}")


def _motion(text: str) -> tuple[float, float]:
    amplitude, _, frequency = text.partition("@")
    try:
        return float(frequency), float(amplitude)
    except ValueError:
        raise click.BadParameter(f"'{text}' is not AMPLITUDE@HZ", param_hint="--done") from None
