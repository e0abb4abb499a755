"""stickslip bench"""

from __future__ import annotations

from pathlib import Path

import click

import stickslip as ss
import stickslip.bench as room
from stickslip.cli.options import all_option, usable
from stickslip.cli.progress import progress
from stickslip.cli.show import print_json, show
from stickslip.cli.terminal import aligned, say


@click.group()
def bench() -> None:
    """The whole experiment on a simulated bench, and what to measure next."""


@bench.command()
@click.option("--fast", is_flag=True, help="As fast as the computer can, and not in the time that a rig would take.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Draws gains, zeros and noise.")
@click.option(
    "--output", type=click.Path(path_type=Path), default=Path("bench-tour"), show_default=True, metavar="DIR",
    help="Folder of records, rig.toml, next.toml and report.",
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON and nothing else.")
@all_option
def tour(fast: bool, seed: int, output: Path, as_json: bool, everything: bool) -> None:
    """Repeat the thesis's experiment on a simulated bench, from a bare rig to the report.

    The bench is commissioned; the base moves at 2.5, 5.61, 8.7 and 11.1 Hz, the mass is let go, a squeak rig rubs dry
    and wet; all is recorded, analysed, laws are compared, and DIR/report/report.html is what a lab would hand in, with
    the true values beside.
    """
    report = output / "report"
    usable(click.get_current_context(), None, report)  # type: ignore[arg-type]
    with progress(100) as tell:
        found = room.tour(output, seed=seed, fast=fast, progress=lambda words, share: tell(words, 100 * share))
        tell("drawing and writing", 95)
        written = ss.publish(found, folder=report)
    show(found, written, as_json=as_json, everything=everything)


@bench.command("next")
@click.argument("laws", nargs=-1, required=True, metavar="LAW LAW...")
@click.option("--config", type=click.Path(path_type=Path), metavar="RIG.TOML", help="The rig, its shaker, its sensors.")
@click.option("--count", type=click.IntRange(min=1), default=3, show_default=True, help="How many runs.")
@click.option("--seconds", type=click.FloatRange(min=0, min_open=True), default=20.0, show_default=True)
@click.option("--done", multiple=True, metavar='"AMPLITUDE@HZ"', help='A run made already: "0.65e-3@2.5". Repeatable.')
@click.option("--output", type=click.Path(path_type=Path), metavar="RUNS.TOML", help="Write the runs, for acquire.")
@click.option("--json", "as_json", is_flag=True, help="Print the runs as JSON and nothing else.")
def following(
    laws: tuple[str, ...], config: Path | None, count: int, seconds: float, done: tuple[str, ...], output: Path | None,
    as_json: bool,
) -> None:  # fmt: skip
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
        proposals = room.next_runs(left, shaker=shaker, noise=noise, count=count, done=motions)
    runs = room.run_list(proposals, seconds=seconds)
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
