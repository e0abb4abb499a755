"""stickslip decay, squeak and wavelet: what free and fast vibrations tell"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli.many import Places, answer_all, many_options
from stickslip.cli.records import (
    contact_option,
    default_folder,
    files_of,
    folder_after,
    groups_of,
    name_of,
    normal_option,
    read_parts,
    reading_options,
    require_fits,
    result_options,
    rig_of,
)
from stickslip.cli.terminal import progress, publish, show

if TYPE_CHECKING:
    from stickslip import Record


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option("--mass", metavar="VALUE", help="Oscillating mass in kg, for the friction force; of an angle in kg m^2.")
@click.option("--stiffness", metavar="VALUE", help="Spring in N/m, for the friction force; of an angle in N m/rad.")
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
    query = {key: options.pop(key) for key in ("method", "channel", "restoring", "mass", "stiffness")}
    rig = rig_of(**options)
    if any(repair.partition(":")[0] == "drift" for repair in rig.repair):
        raise ss.errors.ModelError(
            "--repair drift of a free decay",
            "a drift is told from a steady oscillation, and would take what friction does for drift",
            "leave it out: what drifts is said, and the whole waveform bears it",
        )
    groups = groups_of(*files)
    folder = output or (default_folder(groups) if len(groups) == 1 else Path("decays-stickslip"))
    query |= {key: getattr(rig, key) for key in ("mass", "stiffness") if query[key] is None}
    compare = ss.answers.compare_decays
    answer_all("decay", groups, rig, query, places, compare=compare, folder=folder, output=output, **shown)


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option(
    "--channel", metavar="NAME", help="Where to listen; sound, normal_acceleration, a, friction unless given."
)
@click.option("--frequencies", metavar="LOW:HIGH", help="What is listened to in Hz; from 50 Hz up unless given.")
@contact_option
@normal_option
@click.option("--lever", metavar="VALUE", help="Distance of the friction from the axis of torsion in m, for its work.")
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
    groups = groups_of(*files)
    require_fits(options["normal"], groups)
    folder = output or Path(f"{groups[0][0].stem}-squeak" if len(groups) == 1 else "squeaks-compared")
    query = {"channel": channel, "frequencies": frequencies, "lever": lever}
    compare = ss.answers.compare_squeaks
    answer_all("squeak", groups, rig, query, places, compare=compare, folder=folder, output=output, **shown)


@click.command()
@click.argument("file")
@click.option("--channel", metavar="NAME", help="Which channel; a, sound, force, load, friction, v or x unless given.")
@click.option("--frequencies", metavar="LOW:HIGH", help="Range of the map in Hz; what the record allows unless given.")
@click.option("--wavelet-frequency", type=float, default=4.5, show_default=True, help="How long a wavelet is.")
@click.option("--normalisation", type=click.Choice(["energy", "amplitude"]), default="energy", show_default=True)
@click.option("--mass", metavar="VALUE", help="Oscillating mass in kg, or with its unit, for the contact's stiffness.")
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
    files = files_of(file, "one is mapped at a time")
    query = {key: options.pop(key) for key in ("channel", "wavelet_frequency", "normalisation")}
    rig = rig_of(**options)
    folder = output or (None if as_json else folder_after(files[0], "wavelet"))
    with progress(3) as tell:
        tell(f"reading {name_of(files)}", 0)
        parts = _told_of(read_parts(files, rig), tell)
        query |= {"mass": rig.mass, "stiffness": rig.stiffness}
        findings = ss.answers.time_frequency(parts, frequencies=frequencies, **query)
        tell("drawing and writing", 2)
        written = publish(findings, folder)
    show(findings, written, as_json=as_json, everything=everything)


def _told_of(parts: Iterator[Record], tell: Callable[[str, float], None]) -> Iterator[Record]:
    """The parts of a record, with a word on how far the map is."""
    for part in parts:
        tell(f"mapping, {part.start + part.duration:.0f} s", 1)
        yield part
