"""A joint's angle in degrees that is stated in rad, or the other way round: named where the log shows it, else not."""

import json
import shlex

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip.answers import analyze_joint
from stickslip.cli.program import main

D = np.degrees(1.0)
T = np.arange(3000) / 100
Q = 0.3 + 2.4 * np.sin(2 * np.pi * 0.2 * T) + 0.8 * np.sin(2 * np.pi * 0.7 * T)
V, A = np.gradient(Q, T), np.gradient(np.gradient(Q, T), T)
LEVEL = 0.02 * A + 0.03 * V + 0.06 * np.sign(V) + np.random.default_rng(0).normal(0, 0.01, T.size)  # without gravity
TORQUE = LEVEL + np.sign(V) * 0.15 * np.abs(0.5 * np.sin(Q)) + 0.5 * np.sin(Q)
UNITS = {"position": "rad", "goal_position": "rad", "velocity": "rad/s", "effort": "N m"}


def written(tmp_path, position=1.0, goal=0.0, velocity=0.0, *, torque=TORQUE, step=0.0, units=None):
    """A log whose columns are times these factors, under titles that state these units."""
    moved = position * Q
    columns = {"position": np.round(moved / step) * step if step else moved, "effort": torque}
    columns |= {"goal_position": goal * (Q + torque / 18)} if goal else {}
    columns |= {"velocity": velocity * V} if velocity else {}
    header = ",".join(["t [s]", *(f"{name} [{(UNITS | (units or {}))[name]}]" for name in columns)])
    table = np.column_stack([T, *columns.values()])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    return tmp_path / "log.csv"


DEG = {"position": "deg"}
WRONG = [  # the log, what is stated beside, what the sentence says, what mends it
    ({"position": D}, "", "gravity's torque repeats with 360 of it", "position=deg"),
    ({"position": D, "velocity": 1.0, "torque": LEVEL}, "", "moves 57.3 times as far as velocity", "position=deg"),
    ({"position": D, "goal": 1.0}, "", "moves 57.3 times as far as goal_position", "position=deg"),
    ({"goal": D}, "", "moves 57.3 times as far as position", "goal_position=deg"),
    ({"position": D, "torque": LEVEL, "step": 360 / 4096}, "", "of 12 bit in deg", "position=deg"),
    ({"position": D, "torque": LEVEL}, "--inertia=0.02", "of the torque inertia is", "position=deg"),
    ({"step": 2 * np.pi / 4096, "units": DEG}, "", "of 12 bit in rad", "position=rad"),
    ({"velocity": D, "units": DEG | {"velocity": "deg/s"}}, "", "moves by a 57.3th of what velocity", "position=rad"),
    (
        {"goal": D, "units": DEG | {"goal_position": "deg"}},
        "",
        "moves by a 57.3th of what goal_position",
        "position=rad",
    ),
]


@pytest.mark.parametrize(("log", "stated", "words", "remedy"), WRONG)
def test_a_wrong_unit_is_named_and_the_command_printed_mends_it(tmp_path, log, stated, words, remedy) -> None:
    """It passed without a word: 0.0005 N m s/rad for 0.03."""
    path = written(tmp_path, **log)
    ran = CliRunner().invoke(main, ["joint", str(path), "--json", *filter(None, [stated])])
    assert ran.exit_code == 1, ran.output
    assert words in ran.stderr
    command = shlex.split(ran.stderr.splitlines()[-1])
    assert command[-2:] == ["--units", remedy]
    mended = CliRunner().invoke(main, command[1:])
    assert mended.exit_code == 0, mended.output
    told = {one["name"]: one["interval"] for one in json.loads(mended.stdout)["estimates"]}
    low, high = told["viscous friction"]
    assert low <= 0.03 <= high


def test_a_gain_that_the_torque_contradicts_is_named_too(tmp_path) -> None:
    path = written(tmp_path, position=D, goal=D, torque=LEVEL)
    with pytest.raises(ss.errors.RecordError, match="of the torque kp is") as refused:
        analyze_joint(ss.read_record(path), kp=18.0)
    assert refused.value.options == ("--units", "position=deg")


def test_what_a_channel_map_named_is_mended_there(tmp_path) -> None:
    channels = ["--channels", "theta=position [rad]", "--channels", "force=effort [N m]"]
    ran = CliRunner().invoke(main, ["joint", str(written(tmp_path, position=D)), "--json", *channels])
    command = shlex.split(ran.stderr.splitlines()[-1])
    assert command[-2:] == ["--channels", "theta=position [deg]"]
    assert CliRunner().invoke(main, command[1:]).exit_code == 0


def test_where_either_of_two_units_may_be_wrong_both_are_named(tmp_path) -> None:
    path = written(tmp_path, velocity=1.0, units=DEG)
    ran = CliRunner().invoke(main, ["joint", str(path), "--json"])
    assert ran.exit_code == 1
    assert "To mend it:" not in ran.stderr
    for mend in ("position=rad", "velocity=deg/s"):
        assert f'--units "{mend}"' in ran.stderr
        assert CliRunner().invoke(main, ["joint", str(path), "--json", "--units", mend]).exit_code == 0


RIGHT = [
    {},
    {"goal": 1.0, "velocity": 1.0},
    {"velocity": D},  # of a velocity alone, which is in no balance
    {"position": D, "torque": LEVEL},  # 184 rad, or degrees: nothing tells
    {"step": 2 * np.pi / 4096},
    {"position": D, "velocity": D, "torque": 0.005 * D * Q + LEVEL},  # a spring over many turns is no gravity
]


@pytest.mark.parametrize("log", RIGHT)
def test_an_angle_of_which_nothing_tells_another_unit_is_left_alone(tmp_path, log) -> None:
    assert analyze_joint(ss.read_record(written(tmp_path, **log))).joint.level.known
