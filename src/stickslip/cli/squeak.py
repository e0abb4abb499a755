"""stickslip squeak"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli.many import Places, answer_many, many_options
from stickslip.cli.options import contact_option, normal_option, reading_options, result_options
from stickslip.cli.progress import progress
from stickslip.cli.records import (
    answers,
    groups_of,
    name_left_out,
    require_fits,
    rig_of,
    with_left_out,
)
from stickslip.cli.show import show

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.answers import Findings


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option(
    "--channel", metavar="NAME", help="Where to listen; sound, normal_acceleration, a, friction unless given."
)
@click.option("--frequencies", metavar="LOW:HIGH", help="What is listened to in Hz; from 50 Hz up unless given.")
@contact_option
@normal_option
@click.option(
    "--lever",
    metavar="VALUE",
    help="Distance of the friction from the axis of torsion in m, for its work.",
)
@many_options
@result_options("FILE-squeak")
@reading_options
def squeak(
    files: tuple[str, ...],
    output: Path | None,
    as_json: bool,
    everything: bool,
    channel: str | None,
    frequencies: str | None,
    lever: str | None,
    **options: Any,
) -> None:
    """Find squeaks: when, how loud, at which frequency, which motions move together, and whether friction makes them.

    FILES hold a sound or a vibration, best with the motion and the friction force. Files that belong to one record are
    joined with +, as in sound.wav+motion.csv. Several records are compared: friction, its slope against speed, and
    whether it squeaks, as wet against dry or light against heavy.

    Results go into a folder: report.html to open in a browser, results.json, the figures, and each burst as a WAV file.

    \b
    stickslip squeak squeal.wav --channels "sound=sound * 2.5 [Pa]"
    stickslip squeak wet_6N.csv wet_1N.csv --normal "*6N*=6.13" --normal "*1N*=1.23"
    """
    places, shown = Places.of(options), {"as_json": as_json, "everything": everything}
    rig = rig_of(**options)
    groups = [group for argument in files for group in groups_of(argument)]
    require_fits(options["normal"], groups)
    folder = output or Path(f"{groups[0][0].stem}-squeak" if len(groups) == 1 else "squeaks-compared")

    if places.wanted(groups):
        asked = {"channel": channel, "frequencies": frequencies, "lever": lever}
        answer_many("squeak", groups, rig, asked, places, folder=folder, output=output, **shown)
        return

    def ask(record: Record) -> Findings:
        findings = ss.analyze_squeaks(
            record, channel=channel, frequencies=frequencies, contact=rig.contact, lever=lever
        )
        loads = (rig.normal_load(part) for part in (*findings.name.split(" + "), findings.name))
        return replace(findings, normal=next((load for load in loads if load is not None), findings.normal))

    with progress(2 * len(groups) + 1) as tell:
        found, refused = answers(groups, rig, ask, tell)
        results = with_left_out(ss.answers.compare_squeaks(found) if len(found) > 1 else found[0], refused)
        tell("drawing and writing", 2 * len(groups))
        written = ss.publish(results, folder=folder) if output or not as_json else None
    name_left_out(refused)
    show(results, written, **shown)
