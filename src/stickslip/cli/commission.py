"""stickslip commission"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
import stickslip.bench as bench
from stickslip.cli.options import all_option, pair
from stickslip.cli.progress import progress
from stickslip.cli.records import groups_of, read
from stickslip.cli.show import show
from stickslip.cli.terminal import aligned, say

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.bench import BenchStep, Device, SimulatedBench
    from stickslip.rig import RigSettings

Source = Callable[["BenchStep"], "Record | None"]


@click.command()
@click.argument("files", nargs=-1, metavar="[STEP=FILE]...")
@click.option(
    "--device", "name", metavar="NAME",
    help="What measures: a table [devices.NAME] of the configuration, or a kind of device. sim needs no hardware.",
)  # fmt: skip
@click.option("--config", type=click.Path(path_type=Path), metavar="RIG.TOML", help="What is known of the rig already.")
@click.option("--step", "steps", multiple=True, metavar="NAME", help="Only this step. Repeatable.")
@click.option("--again", multiple=True, metavar="NAME", help="Record this step anew. Repeatable.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of a simulated rig's noise.")
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="DIR",
    help="Folder of records, rig.toml and report; commission unless given, none where files are named.",
)  # fmt: skip
@click.option("--list", "listed", is_flag=True, help="Print the steps, and what to do at each.")
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON and nothing else.")
@all_option
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
    given = dict(_given(file) for file in files)
    if given and not options["steps"]:
        chosen = [step for step in bench.STEPS if step.name in given]
    folder = output or (None if given or as_json else Path("commission"))
    device = _device(options["name"], rig, config) if options["name"] else None
    if device is None and not given and not (folder and (folder / "records").is_dir()):
        raise click.UsageError("nothing measures; name a --device (sim needs no hardware), or STEP=FILE")
    source, truth = _source(given, device, rig, folder, seed=options["seed"], anew=anew)
    with progress(len(chosen) + 1) as tell:
        done = bench.commission(source, rig=rig, steps=chosen, truth=truth, progress=tell)
        tell("drawing and writing", len(chosen))
        written = _written(done, folder) if folder else None
    show(done, written, as_json=as_json, everything=everything)
    if folder and not as_json:
        say(f"Settings: {folder / 'rig.toml'}")


def _given(text: str) -> tuple[str, Path]:
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
            return read([given[step.name]], rig)
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
        return _asked(device, step, kept, rig)

    return source, bench_of.truth if bench_of is not None else {}


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


def _asked(device: Device, step: BenchStep, kept: Path | None, rig: RigSettings) -> Record | None:
    """The record of a step at a real rig, once its hands are ready."""
    if any(name not in [one.name for one in device.inputs] for name in step.needs):
        return None
    say(f"{step.title}\n  {step.todo}")
    if not click.confirm(f"  Record {step.seconds:g} s now?", default=True, err=True):
        return None
    if kept is None:
        raise click.UsageError("a device records into files; name --output")
    if kept.exists():
        kept.unlink()
    moved = {"base": bench.sweep_of(device.fs)} if step.drives and device.outputs else {}
    wanted = bench.Wanted(seconds=step.seconds, drive=moved, log=rig.log)
    done = bench.acquire(device, output=kept, wanted=wanted)
    return ss.read_record(done.paths[0])


def _written(done: Any, folder: Path) -> Path:
    """The report, and rig.toml beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    report = ss.publish(done, folder=folder / "report")
    (folder / "rig.toml").write_text(done.known.toml(), encoding="utf-8")
    return report


__all__: Sequence[str] = ["commission"]
