"""stickslip acquire, and stickslip devices, which tells what can measure."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import click

import stickslip as ss
import stickslip.bench as bench
from stickslip.cli.options import pair
from stickslip.cli.progress import progress
from stickslip.cli.terminal import say, say_json, wrapped
from stickslip.errors import INTERRUPTED

TRIGGER = re.compile(r"\s*(\w+)\s*([<>])\s*(\S+)\s*")


@click.command()
@click.option(
    "--device", "names", multiple=True, required=True, metavar="NAME",
    help="A table [devices.NAME] of the configuration, or a kind of device. Repeatable.",
)  # fmt: skip
@click.option("--config", type=click.Path(path_type=Path), metavar="RIG.TOML", help="File of the rig and its devices.")
@click.option("--seconds", type=click.FloatRange(min=0, min_open=True), help="How long; until Ctrl-C unless given.")
@click.option(
    "--trigger", metavar='"CHANNEL>LEVEL"', help='Begin where a reading passes a level, in SI: "load>0.5", "x<-1e-3".'
)
@click.option(
    "--before", type=click.FloatRange(min=0), default=0.0, metavar="S", help="Time before the trigger that is kept."
)
@click.option(
    "--drive", "drives", multiple=True, metavar='"OUTPUT=AMPLITUDE@HZ"',
    help='Move an output by a tone meanwhile, in SI: "base=0.65e-3@2.5". Repeatable.',
)  # fmt: skip
@click.option(
    "--runs", type=click.Path(path_type=Path), metavar="RUNS.TOML",
    help="Record every run of a list, as bench next writes it, each with its own tone; --output names their folder.",
)  # fmt: skip
@click.option(
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="The record: .h5, .csv or .parquet; of --runs a folder.",
)
@click.option("--json", "as_json", is_flag=True, help="Print what was recorded as JSON and nothing else.")
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
    if options["runs"]:
        _run_all(chosen, bench.read_runs(options["runs"]), output, log, as_json=as_json)
        return
    drive = dict(_driven(text) for text in options["drives"])
    wanted = bench.Wanted(options["seconds"], _trigger(options["trigger"], options["before"]), drive, log)
    with progress(100) as tell:
        done = bench.acquire(chosen, output=output, wanted=wanted, watch=_watch(tell, options["seconds"]))
    _show(done, as_json=as_json)
    if done.ended == "interrupted" and options["seconds"]:
        raise SystemExit(INTERRUPTED)


def _run_all(devices: Any, runs: bench.RunList, folder: Path, log: Any, *, as_json: bool) -> None:
    """Every run of a list, each into a file of its name; one that is there already is left out."""
    folder.mkdir(parents=True, exist_ok=True)
    for run in runs.run:
        path = folder / f"{run.name}.h5"
        if path.exists():
            say(f"{path} is there already: left out", err=True)
            continue
        moved: dict[str, bench.Signal] = {run.on: bench.Tone(run.amplitude, run.frequency)}
        wanted = bench.Wanted(run.seconds, None, moved, log)
        with progress(100) as tell:
            done = bench.acquire(devices, output=path, wanted=wanted, watch=_watch(tell, run.seconds))
        _show(done, as_json=as_json)
        if done.ended == "interrupted":
            raise SystemExit(INTERRUPTED)


def _watch(tell: Any, seconds: float | None) -> Any:
    """What shows how far it is, some ten times a second."""
    due = 0.0

    def watch(device: bench.Device, block: bench.Block) -> None:
        nonlocal due
        if time.monotonic() >= due:
            passed = block.after / device.fs
            tell(f"recording, {passed:.1f} s", 100 * min(1.0, passed / seconds) if seconds else 0)
            due = time.monotonic() + 0.1

    return watch


def _trigger(text: str | None, before: float) -> bench.Trigger | None:
    if text is None:
        if before:
            raise click.BadParameter("what is kept before a trigger needs one", param_hint="--before")
        return None
    found = TRIGGER.fullmatch(text)
    try:
        return bench.Trigger(found[1], float(found[3]), found[2] == ">", before)  # type: ignore[index]
    except (TypeError, ValueError):
        raise click.BadParameter(f"'{text}' is not CHANNEL>LEVEL or CHANNEL<LEVEL", param_hint="--trigger") from None


def _driven(text: str) -> tuple[str, bench.Tone]:
    name, tone = pair(text, "--drive")
    amplitude, _, frequency = tone.partition("@")
    try:
        return name, bench.Tone(float(amplitude), float(frequency))
    except ValueError:
        raise click.BadParameter(f"'{text}' is not OUTPUT=AMPLITUDE@HZ", param_hint="--drive") from None


def _show(done: bench.Acquired, *, as_json: bool) -> None:
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
@click.option(
    "--config", type=click.Path(path_type=Path), metavar="RIG.TOML", help="List the devices that it names too."
)
@click.option("--json", "as_json", is_flag=True, help="Print the list as JSON and nothing else.")
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
        told = {kind.kind: {"about": kind.about, "there": [*kind.there], "missing": kind.missing} for kind in kinds}
        named_so = {name: {"kind": one.kind, "model": one.model, "fs": one.fs} for name, one in mine.items()}
        say_json({"kinds": told, "named": named_so})
        return
    for name, one in mine.items():
        inputs = ", ".join(f"{entry.name} [{entry.unit}]" for entry in one.inputs)
        outputs = "".join(f"; moves {output.name}" for output in one.outputs)
        say("\n".join(wrapped(f"{one.model}, {one.fs:g} Hz: {inputs}{outputs}", f"{name:<8} ")))
    for kind in kinds:
        there = f"missing: {kind.missing}" if kind.missing else "; ".join(kind.there) or "nothing found"
        say("\n".join([*wrapped(kind.about, f"{kind.kind:<8} "), *wrapped(there, 9 * " ")]))
