"""stickslip decay"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import stickslip as ss
from stickslip.cli.many import Places, answer_many, many_options
from stickslip.cli.options import reading_options, result_options
from stickslip.cli.progress import progress
from stickslip.cli.records import (
    answers,
    default_folder,
    groups_of,
    name_left_out,
    rig_of,
    with_left_out,
)
from stickslip.cli.show import show


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option(
    "--mass",
    metavar="VALUE",
    help="Oscillating mass in kg, for the friction force; of an angle in kg m^2.",
)
@click.option(
    "--stiffness",
    metavar="VALUE",
    help="Spring in N/m, for the friction force; of an angle in N m/rad.",
)
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
@many_options
@result_options("FILE-stickslip")
@reading_options
def decay(files: tuple[str, ...], output: Path | None, as_json: bool, everything: bool, **options: Any) -> None:
    """Tell viscous from dry friction by how a released mass dies away.

    FILES hold free decays: displacement, angle, velocity or acceleration of something that was let go. Several
    releases in one file are told apart. A quoted pattern ("release_*.csv") stands for all files that fit. Several
    files of one oscillator are fitted together too, where they are alike.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip decay release.csv --channels "x=disp [mm]" --stiffness "2.31 N/mm"
    stickslip decay "release_*.csv" --method thesis --json
    """
    places, shown = Places.of(options), {"as_json": as_json, "everything": everything}
    asked = {key: options.pop(key) for key in ("method", "channel", "restoring", "mass", "stiffness")}
    rig = rig_of(**options)
    if any(each.partition(":")[0] == "drift" for each in rig.repair):
        raise ss.errors.ModelError(
            "--repair drift of a free decay",
            "a drift is told from a steady oscillation, and would take what friction does for drift",
            "leave it out: what drifts is said, and the whole waveform bears it",
        )
    groups = [group for argument in files for group in groups_of(argument)]
    folder = output or (default_folder(groups) if len(groups) == 1 else Path("decays-stickslip"))
    asked |= {key: getattr(rig, key) for key in ("mass", "stiffness") if asked[key] is None}
    if places.wanted(groups):
        answer_many("decay", groups, rig, asked, places, folder=folder, output=output, **shown)
        return
    with progress(2 * len(groups) + 1) as tell:
        found, refused = answers(groups, rig, lambda record: ss.analyze_decay(record, **asked), tell)
        tell("drawing and writing", 2 * len(groups))
        results = with_left_out(ss.answers.compare_decays(found) if len(found) > 1 else found[0], refused)
        written = ss.publish(results, folder=folder) if output or not as_json else None
    name_left_out(refused)
    show(results, written, **shown)
