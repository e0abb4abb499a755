"""stickslip analyze"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

import stickslip as ss
from stickslip.cli.options import reading_options, result_options, usable
from stickslip.cli.progress import progress
from stickslip.cli.records import (
    answers,
    default_folder,
    groups_of,
    name_left_out,
    require_fits,
    rig_of,
    with_left_out,
)
from stickslip.cli.show import show


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option("--mass", metavar="VALUE", help='Oscillating mass in kg, or with its unit ("250 g", "2.42 ± 0.02 kg").')
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
    type=click.Choice(["auto", "fusion", "motion", "load", "smoother", "five-point", "F", "F1", "F2"]),
    default="auto",
    show_default=True,
    help="How the friction is found: by all sensors together (fusion), by some, or by derivatives; auto says why.",
)
@click.option(
    "--twins",
    type=click.IntRange(min=0),
    default=0,
    metavar="N",
    help="Try the answers on N simulated rigs that may have written the record (40 is good): their bias is taken off, "
    "and nothing is claimed that rigs without it show too. 0 for the quick answers.",
)
@result_options("FILE-stickslip")
@reading_options
def analyze(
    files: tuple[str, ...], output: Path | None, as_json: bool, method: str, twins: int, **options: Any
) -> None:
    """Find the friction in one record or several.

    FILES that belong to one record are joined with +, as in x.mat+z.mat. A quoted pattern ("run_*.csv") stands for
    all files that fit. Several records are compared, with the normal load too where it is known.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip analyze run.csv --channels "x=disp [mm]" --mass 3.08 --stiffness "1.19 N/mm"
    stickslip analyze "run_*.csv" --config rig.toml --normal "*250g*=2.45" --normal "*450g*=4.41"
    """
    rig = rig_of(**options)
    groups = [group for argument in files for group in groups_of(argument)]
    require_fits(options["normal"], groups)
    folder = output or default_folder(groups)
    with progress(2 * len(groups) + 1) as tell:
        found, refused = answers(
            groups,
            rig,
            lambda record: _tried(ss.analyze(record, rig=rig, method=method), twins, tell),
            tell,
            of_parts=lambda parts, say: ss.answers.analyze_blocks(parts, rig=rig, method=method, progress=say),
        )
        results = with_left_out(ss.compare(found) if len(found) > 1 else found[0], refused)
        tell("drawing and writing", 2 * len(groups))
        written = ss.publish(results, folder=folder) if output or not as_json else None
    name_left_out(refused)
    show(results, written, as_json=as_json)


def _tried(findings: ss.answers.Findings, twins: int, tell: Callable[..., None]) -> ss.answers.Findings:
    """The answers as their twins leave them; with a note of why, where the record has no twin."""
    if not twins:
        return findings
    try:
        return ss.tried(findings, twins=twins, progress=lambda share: tell(f"asking twins, {100 * share:.0f} %"))
    except ss.errors.EstimateError as error:
        return replace(findings, notes=(*findings.notes, f"Twins: {error}"))


@click.command()
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    callback=usable,
    default=Path("stickslip-demo"),
    show_default=True,
    metavar="DIR",
    help="Folder for the results.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON and nothing else.")
def demo(output: Path, as_json: bool) -> None:
    """Analyse the bundled record of a simulated rig, with the true answers beside the estimates."""
    with progress(3) as tell:
        tell("reading the bundled record", 0)
        record = ss.datasets.demo()
        tell("analysing", 1)
        constants = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
        findings = ss.analyze(record, **constants)
        tell("drawing and writing", 2)
        written = ss.publish(findings, folder=output)
    show(findings, written, as_json=as_json)
