"""stickslip decay, squeak, wavelet, joint and tribometer: vibrations, and friction of machines"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli import option
from stickslip.cli.records import (
    Places,
    answer_all,
    answer_together,
    default_folder,
    files_of,
    folder_after,
    groups_of,
    name_of,
    number_of,
    require_described,
    require_fits,
    rig_of,
)
from stickslip.cli.terminal import Output, progress

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.answers import Comparison, Findings

BLOCK = 1_000_000  # rows of a part that is mapped: spikes and sticks are asked of the first 400,000


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="LOGS...")
@click.option("--inertia", metavar="VALUE", help="Moment of inertia in kg m^2, or with its unit; found unless given.")
@click.option("--kp", metavar="VALUE", help="The controller's gain in N m/rad, for a log without torque and current.")
@click.option("--kd", metavar="VALUE", help="The controller's damping in N m s/rad; found unless given.")
@click.option("--torque-constant", metavar="VALUE", help="Torque per current at the joint in N m/A.")
@click.option("--gravity/--no-gravity", default=None, help="Whether gravity acts on it; of an angle yes unless said.")
@click.option(
    "--play", metavar="VALUE", help="Of the teeth in rad, or with its unit, where the motor alone has an encoder."
)
@click.option("--axis", metavar="NAME", help="Which axis of a log of several: a part of its columns' names.")
@click.option(
    "--urdf",
    metavar="FILE",
    help='The robot that --axis is a joint of, "arm.urdf ± 2 %": what its bodies take of the torque is taken off.',
)
@click.option(
    "--propose",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write a motion into FILE that would tell what this log does not, within its range and speed.",
)
@option.results("LOG-joint")
@option.reading
def joint(files: tuple[str, ...], output: Output, propose: Path | None, **options: Any) -> None:
    """How much friction is in this joint of a robot, servo or axis?

    Each of LOGS holds its position with one of: the torque, the motor's current (then --torque-constant), or the
    controller's reference (then --kp). Columns are known by the names that ROS, LeRobot, MuJoCo, Dynamixel and drives
    give them.

    Told are the friction either way, its viscous part, what of it grows with the load, inertia and gravity, breakaway
    and stops; or what the log can not tell, and which motion would. Several logs of one joint, or a file of several
    episodes, are told together too, and each is predicted by the others.

    Results go into a folder: report.html to open in a browser, results.json, the figures, and the joint for MuJoCo,
    URDF, Modelica, Simulink, C and as an FMU. A logged temperature tells the friction over it, per kelvin.

    \b
    stickslip joint shoulder.csv --torque-constant "0.87 N m/A"
    stickslip joint shoulder.csv --kp "17.8 N m/rad" --propose next.csv
    stickslip joint "shoulder_*.csv"
    stickslip joint walk.mcap --urdf arm.urdf --axis elbow
    stickslip joint episode.parquet --axis 2 --kp "17.8 N m/rad" --units "observation.state.2=deg"
    """
    names = ("inertia", "kp", "kd", "torque_constant", "gravity", "play")
    axis, urdf = options.pop("axis"), options.pop("urdf")
    if urdf is not None and axis is None:
        raise click.BadParameter("which of the robot's joints? name it by --axis", param_hint="--urdf")
    stated = {name: options.pop(name) for name in names}
    if propose is not None and propose.exists():
        raise click.BadParameter(f"'{propose}' is there already; name another file", param_hint="--propose")
    rig = rig_of(**options)
    groups = groups_of(*files)
    folder = output.folder(default_folder(groups, "joint"))

    def ask(record: Record) -> list[Findings]:
        parts = list(ss.answers.episodes(record))
        names = [f", {part.history[-1].outcome}" if len(parts) > 1 else "" for part in parts]
        logs = [part if urdf is None else ss.answers.without_bodies(part, urdf=urdf, axis=axis) for part in parts]
        joints = [ss.answers.analyze_joint(log, **stated, axis=None if urdf else axis) for log in logs]
        return [replace(one, name=one.name + name) for one, name in zip(joints, names, strict=True)]

    def together(findings: list[list[Findings]]) -> Findings | Comparison:
        logs = [log for part in findings for log in part]
        return ss.answers.compare_joints(logs, **stated) if len(logs) > 1 else logs[0]

    if propose is not None:
        log = ss.answers.axis_record(next(ss.answers.episodes(ss.answers.read_mended(groups[0], rig=rig))), axis=axis)
        ss.write_record(ss.cycle.telling_motion(log), propose)
    answer_together(groups, rig, ask, together=together, folder=folder, output=output)


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@option.normal
@click.option("--frequency", metavar="HZ", help="Strokes to and fro in a second; found unless given.")
@option.results("FILE-tribometer")
@option.reading
def tribometer(files: tuple[str, ...], output: Output, frequency: str | None, **options: Any) -> None:
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
    answer_together(
        groups,
        rig,
        lambda record: ss.answers.analyze_tribometer(record, frequency=strokes, rig=rig),
        together=lambda tests: ss.answers.compare_tribometers(tests) if len(tests) > 1 else tests[0],
        folder=output.folder(default_folder(groups, "tribometer")),
        output=output,
    )


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option("--mass", metavar="VALUE", help="Oscillating mass in kg, for the friction force; of an angle in kg m^2.")
@click.option("--stiffness", metavar="VALUE", help="Spring in N/m, for the friction force; of an angle in N m/rad.")
@option.choice(
    "--method",
    ["all", "waveform", "thesis"],
    "The whole waveform, the decrements of the extremes (the thesis's chapter 6), or both.",
)
@option.choice("--restoring", ["linear", "pendulum"], "The spring's law; pendulum for an angle that swings far.")
@click.option("--channel", metavar="NAME", help="x, theta, v or a; the first of these that the file has unless given.")
@option.many
@option.results("FILE-stickslip")
@option.reading
def decay(files: tuple[str, ...], output: Output, **options: Any) -> None:
    """Tell viscous from dry friction by how a released mass dies away.

    FILES hold free decays: displacement, angle, velocity or acceleration of something that was let go. Several
    releases in one file are told apart. A quoted pattern ("release_*.csv") stands for all files that fit. Several
    files of one oscillator are fitted together too, where they are alike.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip decay release.csv --channels "x=disp [mm]" --stiffness "2.31 N/mm"
    stickslip decay "release_*.csv" --method thesis --json
    """
    places = Places.of(options)
    query = {key: options.pop(key) for key in ("method", "channel", "restoring", "mass", "stiffness")}
    rig = rig_of(**options)
    if any(repair.partition(":")[0] == "drift" for repair in rig.repair):
        raise ss.errors.ModelError(
            "--repair drift of a free decay",
            "a drift is told from a steady oscillation, and would take what friction does for drift",
            "leave it out: what drifts is said, and the whole waveform bears it",
        )
    groups = groups_of(*files)
    usual = default_folder(groups) if len(groups) == 1 else Path("decays-stickslip")
    query |= {key: getattr(rig, key) for key in ("mass", "stiffness") if query[key] is None}
    compare = ss.answers.compare_decays
    answer_all("decay", groups, rig, query, places, compare=compare, usual=usual, output=output)


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option(
    "--channel", metavar="NAME", help="Where to listen; sound, normal_acceleration, a, friction unless given."
)
@click.option("--frequencies", metavar="LOW:HIGH", help="What is listened to in Hz; from 50 Hz up unless given.")
@option.contact
@option.normal
@click.option("--lever", metavar="VALUE", help="Distance of the friction from the axis of torsion in m, for its work.")
@option.many
@option.results("FILE-squeak")
@option.reading
def squeak(
    files: tuple[str, ...],
    output: Output,
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
    places = Places.of(options)
    rig = rig_of(*files, **options)
    groups = groups_of(*files)
    require_fits(options["normal"], groups)
    usual = Path(f"{groups[0][0].stem}-squeak" if len(groups) == 1 else "squeaks-compared")
    query = {"channel": channel, "frequencies": frequencies, "lever": lever}
    compare = ss.answers.compare_squeaks
    answer_all("squeak", groups, rig, query, places, compare=compare, usual=usual, output=output)


@click.command()
@click.argument("file")
@click.option("--channel", metavar="NAME", help="Which channel; a, sound, force, load, friction, v or x unless given.")
@click.option("--frequencies", metavar="LOW:HIGH", help="Range of the map in Hz; what the record allows unless given.")
@click.option("--wavelet-frequency", type=float, default=4.5, show_default=True, help="How long a wavelet is.")
@option.choice("--normalisation", ["energy", "amplitude"])
@click.option("--mass", metavar="VALUE", help="Oscillating mass in kg, or with its unit, for the contact's stiffness.")
@click.option("--stiffness", metavar="VALUE", help="Spring in N/m, or with its unit, for the same.")
@option.results("FILE-wavelet")
@option.reading
def wavelet(file: str, output: Output, frequencies: str | None, **options: Any) -> None:
    """Map a channel over time and frequency, and tell what its sticks are like.

    Of an acceleration: at which frequency the contact rings while the mass sticks, how many micro-slips there are,
    and which mechanism that shows. FILE may be several joined with +, as in x.mat+a.mat.

    \b
    stickslip wavelet run.csv --channels "a=acc [m/s^2]" --mass 2.42 --stiffness 2310
    stickslip wavelet squeal.ogg --frequencies 500:8000 --wavelet-frequency 20
    """
    files = files_of(file, "one is mapped at a time")
    query = {key: options.pop(key) for key in ("channel", "wavelet_frequency", "normalisation")}
    rig = rig_of(file, **options)
    with progress(2) as tell:
        tell(f"reading {name_of(files)}", 0)
        parts = _told_of(ss.answers.read_parts(files, rig=rig, size=BLOCK), tell)
        query |= {"mass": rig.mass, "stiffness": rig.stiffness}
        findings = ss.answers.time_frequency(parts, frequencies=frequencies, **query)
    output.deliver(findings, output.folder(folder_after(files[0], "wavelet")))


def _told_of(parts: Iterator[Record], tell: Callable[[str, float], None]) -> Iterator[Record]:
    """The parts of a record, with a word on how far the map is."""
    for part in parts:
        tell(f"mapping, {part.start + part.duration:.0f} s", 1)
        yield require_described(part)
