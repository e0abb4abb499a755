"""stickslip tribometer"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import stickslip as ss
from stickslip.cli.options import normal_option, number_of, reading_options, result_options
from stickslip.cli.records import answer_together, default_folder, groups_of, require_fits, rig_of


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@normal_option
@click.option("--frequency", metavar="HZ", help="Strokes to and fro in a second; found unless given.")
@result_options("FILE-tribometer")
@reading_options
def tribometer(
    files: tuple[str, ...], output: Path | None, as_json: bool, everything: bool, frequency: str | None, **options: Any
) -> None:
    """What is the coefficient of friction, by which definition, and how does it wear in?

    FILES are tests of a tribometer that slides to and fro: displacement or velocity, the friction force, and the
    normal load, measured (normal) or stated (--normal).

    Told are the coefficient by plateau, stroke, cycle and energy side by side with intervals, the static one where the
    record tells breakaway, the wear-in over the cycles, and the friction along the stroke, cycle after cycle. Several
    tests are told together, too.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip tribometer test.csv --channels "x=stroke [mm]" --channels "friction=Ft [N]" --normal 10
    stickslip tribometer "test_*.csv" --channels "friction=Ft [N]" --channels "normal=Fn [N]"
    """
    strokes = None if frequency is None else number_of(frequency, "Hz", "--frequency")
    rig = rig_of(**options)
    groups = groups_of(*files)
    require_fits(options["normal"], groups)
    folder = output or (None if as_json else default_folder(groups, "tribometer"))

    answer_together(
        groups,
        rig,
        lambda record: ss.answers.analyze_tribometer(record, frequency=strokes, rig=rig),
        together=lambda tests: ss.answers.compare_tribometers(tests) if len(tests) > 1 else tests[0],
        folder=folder,
        as_json=as_json,
        everything=everything,
    )
