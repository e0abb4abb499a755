"""stickslip analyze, demo and impact: what driven records and a tap tell"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli.many import Places, answer_many, many_options
from stickslip.cli.records import (
    all_option,
    answers,
    constants_options,
    default_folder,
    files_of,
    folder_after,
    groups_of,
    name_left_out,
    normal_option,
    reading_options,
    require_fits,
    result_options,
    rig_of,
    usable,
    with_left_out,
)
from stickslip.cli.terminal import complain, deliver, progress, publish
from stickslip.errors import INTERRUPTED
from stickslip.workers import processors

if TYPE_CHECKING:
    from stickslip.answers import Comparison, Findings

twins_option = click.option(
    "--twins",
    type=click.IntRange(min=0),
    default=40,
    show_default=True,
    envvar="STICKSLIP_TWINS",
    show_envvar=True,
    metavar="N",
    help="Try the answers on N simulated rigs that may have written the record: their bias is taken off, and nothing "
    "is claimed that rigs without it show too. 0 for the quick answers, which are written first.",
)


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@constants_options()
@normal_option
@click.option(
    "--method",
    type=click.Choice(["auto", "fusion", "motion", "load", "smoother", "five-point", "F", "F1", "F2"]),
    default="auto",
    show_default=True,
    help="How the friction is found: by all sensors together (fusion), by some, or by derivatives; auto says why.",
)
@twins_option
@many_options
@result_options("FILE-stickslip")
@reading_options
def analyze(
    files: tuple[str, ...],
    output: Path | None,
    as_json: bool,
    everything: bool,
    method: str,
    twins: int,
    **options: Any,
) -> None:
    """Find the friction in one record or several.

    FILES that belong to one record are joined with +, as in x.mat+z.mat. A quoted pattern ("run_*.csv") stands for
    all files that fit. Several records are compared, with the normal load too where it is known.

    Of more than 20 records each is a row of one table, worked on by several processes, and an interrupted run goes on
    when it is called again.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip analyze run.csv --channels "x=disp [mm]" --mass 3.08 --stiffness "1.19 N/mm"
    stickslip analyze "run_*.csv" --config rig.toml --normal "*250g*=2.45" --normal "*450g*=4.41"
    """
    places, shown = Places.of(options), {"as_json": as_json, "everything": everything}
    rig = rig_of(**options)
    groups = groups_of(*files)
    require_fits(options["normal"], groups)
    folder = output or default_folder(groups)
    if places.wanted(groups):
        chosen = click.get_current_context().get_parameter_source("twins") is not click.core.ParameterSource.DEFAULT
        query = {"method": method, "twins": twins if chosen else 0}
        answer_many("analyze", groups, rig, query, places, folder=folder, output=output, **shown)
        return
    with progress(2 * len(groups)) as tell:
        all_findings, refused = answers(
            groups,
            rig,
            lambda record: ss.analyze(record, rig=rig, method=method),
            tell,
            of_parts=lambda parts, say: ss.answers.analyze_blocks(parts, rig=rig, method=method, progress=say),
        )

    def together(findings: list[Findings]) -> Any:
        return with_left_out(ss.compare(findings) if len(findings) > 1 else findings[0], refused)

    name_left_out(refused)
    _deliver_sure(all_findings, twins, together, folder if output or not as_json else None, **shown)


def _deliver_sure(
    all_findings: list[Findings],
    twins: int,
    together: Callable[[list[Findings]], Findings | Comparison],
    folder: Path | None,
    **shown: Any,
) -> None:
    """Deliver the results, tried on twins; the quick ones are written first, and stay where that is interrupted.

    Figures are drawn once, with what stays: they take longer than the quick answers do.
    """
    if not twins:
        deliver(together(all_findings), folder, **shown)
        return
    from concurrent.futures import ThreadPoolExecutor

    context = {name: value for name, value in shown.items() if name not in ("as_json", "everything")}
    with ThreadPoolExecutor(1) as beside:  # written here, while other processes look for the twins
        quick = beside.submit(publish, together(all_findings), folder, figures=False, **context)
        try:
            with progress(1) as tell:
                results = together([_tried(findings, twins, tell) for findings in all_findings])
            deliver(results, quick.result(), **shown)
        except KeyboardInterrupt:
            if folder is None:
                raise
            complain(f"interrupted: {quick.result()} has the quick answers, not tried on twins, without figures.")
            sys.exit(INTERRUPTED)


def _tried(findings: Findings, twins: int, tell: Callable[..., None]) -> Findings:
    """The answers as their twins leave them; with a note of why, where the record has no twin."""

    def show_share(share: float) -> None:
        tell(f"trying the answers of {findings.name} on twins, {100 * share:.0f} %")

    if findings.contradiction:  # the rig that it would be tried on is not the one that wrote the record
        return findings
    show_share(0.0)
    try:
        return ss.tried(findings, twins=twins, processes=processors(), progress=show_share)
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
@all_option
@twins_option
def demo(output: Path, as_json: bool, everything: bool, twins: int) -> None:
    """Analyse the bundled record of a simulated rig, with the true answers beside the estimates."""
    with progress(2) as tell:
        tell("reading the bundled record", 0)
        record = ss.datasets.demo()
        tell("analysing", 1)
        constants = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
        findings = ss.analyze(record, **constants)
    _deliver_sure([findings], twins, lambda parts: parts[0], output, as_json=as_json, everything=everything, form="csv")


@click.command()
@click.argument("file")
@click.option("--mass", metavar="VALUE", help="Moving mass in kg, which tells the contact's mode from the mounts'.")
@result_options("FILE-impact")
@reading_options
def impact(file: str, output: Path | None, as_json: bool, everything: bool, **options: Any) -> None:
    """Which resonances does a hammer tap excite, and which sensor's mount are they?

    FILE holds the accelerometer (a) or the load cell (load), better both, and one tap on the mass while the base is
    held. The mounts that are found can be stated afterwards: --sensor "a.mount=125 Hz, 0.1".

    \b
    stickslip impact tap.csv --mass 2.42
    """
    rig = rig_of(**options)
    files = files_of(file, "a tap is one")
    folder = output or (None if as_json else folder_after(files[0], "impact"))
    with progress(1) as tell:
        tell(f"reading {file}", 0)
        record = ss.answers.read_mended(files, rig=rig)
        test = ss.balance.impact_test(record, mass=rig.mass)
    deliver(test, folder, as_json=as_json, everything=everything, record=record)
