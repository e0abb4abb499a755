"""stickslip joint and tribometer: friction of machines"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli.records import (
    answer_together,
    default_folder,
    groups_of,
    normal_option,
    number_of,
    read,
    reading_options,
    require_fits,
    result_options,
    rig_of,
)

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.answers import Comparison, Findings


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="LOGS...")
@click.option("--inertia", metavar="VALUE", help="Moment of inertia in kg m^2, or with its unit; found unless given.")
@click.option("--kp", metavar="VALUE", help="The controller's gain in N m/rad, for a log without torque and current.")
@click.option("--kd", metavar="VALUE", help="The controller's damping in N m s/rad; found unless given.")
@click.option("--torque-constant", metavar="VALUE", help="Torque per current at the joint in N m/A.")
@click.option("--gravity/--no-gravity", default=None, help="Whether gravity acts on it; of an angle yes unless said.")
@click.option("--axis", metavar="NAME", help="Which axis of a log of several: a part of its columns' names.")
@click.option(
    "--propose", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
    help="Write a motion into FILE that would tell what this log does not, within its range and speed.",
)  # fmt: skip
@result_options("LOG-joint")
@reading_options
def joint(
    files: tuple[str, ...], output: Path | None, as_json: bool, everything: bool, propose: Path | None, **options: Any
) -> None:
    """How much friction is in this joint of a robot, servo or axis?

    Each of LOGS holds its position with one of: the torque, the motor's current (then --torque-constant), or the
    controller's reference (then --kp). Columns are known by the names that ROS, LeRobot, MuJoCo, Dynamixel and drives
    give them.

    Told are the friction either way, its viscous part, what of it grows with the load, inertia and gravity, breakaway
    and stops; or what the log can not tell, and which motion would. Several logs of one joint, or a file of several
    episodes, are told together too, and each is predicted by the others.

    Results go into a folder: report.html to open in a browser, results.json, the figures, and the joint for MuJoCo,
    URDF, Modelica, Simulink and C.

    \b
    stickslip joint shoulder.csv --torque-constant "0.87 N m/A"
    stickslip joint shoulder.csv --kp "17.8 N m/rad" --propose next.csv
    stickslip joint "shoulder_*.csv"
    stickslip joint episode.parquet --axis 2 --kp "17.8 N m/rad" --units "observation.state.2=deg"
    """
    names, axis = ("inertia", "kp", "kd", "torque_constant", "gravity"), options.pop("axis")
    stated = {name: options.pop(name) for name in names}
    if propose is not None and propose.exists():
        raise click.BadParameter(f"'{propose}' is there already; name another file", param_hint="--propose")
    rig = rig_of(**options)
    groups = groups_of(*files)
    folder = output or (None if as_json else default_folder(groups, "joint"))

    def ask(record: Record) -> list[Findings]:
        parts = list(ss.answers.episodes(record))
        names = [f", {part.history[-1].outcome}" if len(parts) > 1 else "" for part in parts]
        joints = [ss.answers.analyze_joint(part, **stated, axis=axis) for part in parts]
        return [replace(one, name=one.name + name) for one, name in zip(joints, names, strict=True)]

    def together(findings: list[list[Findings]]) -> Findings | Comparison:
        logs = [log for part in findings for log in part]
        return ss.answers.compare_joints(logs, **stated) if len(logs) > 1 else logs[0]

    if propose is not None:
        log = ss.answers.axis_record(next(ss.answers.episodes(read(groups[0], rig))), axis=axis)
        ss.write_record(ss.cycle.telling_motion(log), propose)
    answer_together(groups, rig, ask, together=together, folder=folder, as_json=as_json, everything=everything)


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
