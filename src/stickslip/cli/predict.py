"""stickslip predict"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli.options import reading_options, result_options
from stickslip.cli.progress import progress
from stickslip.cli.records import answers, default_folder, groups_of, name_left_out, rig_of
from stickslip.cli.show import show

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.answers import Predictions


@click.command()
@click.argument("law", type=click.Path(path_type=Path, exists=True), metavar="LAW")
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option("--mass", metavar="VALUE", help="Oscillating mass in kg; that of LAW unless given.")
@click.option("--stiffness", metavar="VALUE", help="Spring in N/m, or with its unit.")
@click.option("--damping", metavar="VALUE", help="Viscous damping of the suspension in N s/m.")
@click.option("--damper", type=click.Choice(["ground", "base"]), help="What the damper ends on.")
@click.option("--contact", type=click.Choice(["ground", "base"]), help="What the mass slides on.")
@click.option(
    "--plain/--no-plain", default=True, show_default=True,
    help="Fit Coulomb friction and a damper to each record, to stand beside a richer law.",
)  # fmt: skip
@result_options("FILE-predicted")
@reading_options
def predict(
    law: Path, files: tuple[str, ...], output: Path | None, as_json: bool, everything: bool, plain: bool, **options: Any
) -> None:
    """Simulate a fitted law along other records, and say how much of them it follows.

    LAW is the folder that stickslip fit wrote, its law/law.toml, or a file of a system as stickslip simulate reads it.
    FILES are records that the law was not fitted to: the base's motion z or the applied force drives the simulation as
    it was recorded, and the sensors read it as --config states them. Nothing is fitted to a record but how its motion
    begins and each sensor's zero. Several records are a table, one row a file.

    Told is of each channel 100 (1 - |y - yhat| / |y - mean y|) %, the fit of system identification.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip fit slow.csv --mass 2.42 --stiffness 2310 --damping 0.12
    stickslip predict slow-fit fast.csv
    """
    rig = rig_of(**options)
    oscillator = ss.answers.read_fitted(law, rig=rig)
    groups = [group for argument in files for group in groups_of(argument)]
    folder = output or (None if as_json else default_folder(groups, "predicted"))

    def ask(record: Record) -> Predictions:
        return ss.answers.predict(record, oscillator, rig=rig, plain=plain)

    with progress(2 * len(groups) + 1) as tell:
        found, refused = answers(groups, rig, ask, tell)
        parts, notes = [part for each in found for part in each.parts], [f"Left out: {error}" for error in refused]
        results = replace(found[0], parts=tuple(parts), notes=tuple(notes))
        tell("drawing and writing", 2 * len(groups))
        written = ss.publish(results, folder=folder) if folder else None
    name_left_out(refused)
    show(results, written, as_json=as_json, everything=everything)
