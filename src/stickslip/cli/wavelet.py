"""stickslip wavelet"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli.options import reading_options, result_options
from stickslip.cli.progress import progress
from stickslip.cli.records import folder_after, groups_of, name_of, read_parts, rig_of
from stickslip.cli.show import show

if TYPE_CHECKING:
    from stickslip import Record


@click.command()
@click.argument("file")
@click.option("--channel", metavar="NAME", help="Which channel; a, sound, force, load, friction, v or x unless given.")
@click.option("--frequencies", metavar="LOW:HIGH", help="Range of the map in Hz; what the record allows unless given.")
@click.option("--wavelet-frequency", type=float, default=4.5, show_default=True, help="How long a wavelet is.")
@click.option("--normalisation", type=click.Choice(["energy", "amplitude"]), default="energy", show_default=True)
@click.option(
    "--mass",
    metavar="VALUE",
    help="Oscillating mass in kg, or with its unit, for the contact's stiffness.",
)
@click.option("--stiffness", metavar="VALUE", help="Spring in N/m, or with its unit, for the same.")
@result_options("FILE-wavelet")
@reading_options
def wavelet(
    file: str, output: Path | None, as_json: bool, everything: bool, frequencies: str | None, **options: Any
) -> None:
    """Map a channel over time and frequency, and tell what its sticks are like.

    Of an acceleration: at which frequency the contact rings while the mass sticks, how many micro-slips there are,
    and which mechanism that shows. FILE may be several joined with +, as in x.mat+a.mat.

    \b
    stickslip wavelet run.csv --channels "a=acc [m/s^2]" --mass 2.42 --stiffness 2310
    stickslip wavelet squeal.ogg --frequencies 500:8000 --wavelet-frequency 20
    """
    groups = groups_of(file)
    if len(groups) != 1:
        raise click.BadParameter(f"'{file}' fits {len(groups)} records; one is mapped at a time", param_hint="FILE")
    asked = {key: options.pop(key) for key in ("channel", "wavelet_frequency", "normalisation")}
    rig = rig_of(**options)
    folder = output or (None if as_json else folder_after(groups[0][0], "wavelet"))
    with progress(3) as tell:
        tell(f"reading {name_of(groups[0])}", 0)
        parts = _told_of(read_parts(groups[0], rig), tell)
        asked |= {"mass": rig.mass, "stiffness": rig.stiffness}
        findings = ss.answers.time_frequency(parts, frequencies=frequencies, **asked)
        tell("drawing and writing", 2)
        written = ss.publish(findings, folder=folder) if folder else None
    show(findings, written, as_json=as_json, everything=everything)


def _told_of(parts: Iterator[Record], tell: Callable[[str, float], None]) -> Iterator[Record]:
    """The parts of a record, with a word on how far the map is."""
    for part in parts:
        tell(f"mapping, {part.start + part.duration:.0f} s", 1)
        yield part
