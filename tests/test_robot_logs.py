"""Robots' logs, each made by its own library: what is in them, and the friction of the joint that they hold."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

import robot_logs
import stickslip as ss
from stickslip.errors import FormatError

NEEDED = {"mcap": "mcap_ros2.writer", "bag": "rosbags.rosbag1", "db3": "rosbags.rosbag2", "mf4": "asammdf"}


@pytest.fixture
def log(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    path = tmp_path / request.param
    pytest.importorskip(NEEDED[path.suffix[1:]])
    robot_logs.LOGS[request.param](path)
    return path


@pytest.mark.parametrize("log", robot_logs.LOGS, indirect=True)
def test_the_joint_of_a_log_is_found_by_the_names_in_it(log: Path) -> None:
    record = ss.read_record(log)
    t, q, effort = robot_logs.moved()
    axis = None if log.suffix == ".mf4" else "elbow"
    joint = ss.answers.axis_record(record, axis=axis)
    assert record.fs == pytest.approx(robot_logs.FS)
    late = len(t) - len(record)  # until every topic was heard
    assert late == (1 if log.name == "a.mcap" else 0)
    assert joint["theta"] == pytest.approx(q[late:], abs=1e-6)
    assert joint["force"] == pytest.approx(effort[late:])
    found = ss.answers.analyze_joint(record, axis=axis, gravity=False).joint
    assert found.level.includes(robot_logs.EFFORT["coulomb"])
    assert found.viscous.includes(robot_logs.EFFORT["viscous"])


@pytest.mark.parametrize("log", ["a.mcap"], indirect=True)
def test_a_topic_of_its_own_clock_is_read_as_last_heard(log: Path) -> None:
    record = ss.read_record(log)
    _, _, effort = robot_logs.moved()
    held = np.repeat(effort[::5], 5)[: len(record)]
    assert np.array_equal(record["data_1"], held)
    assert "effort_controller/commands is read as last heard" in record.history[-1].outcome


@pytest.mark.parametrize("log", ["json.mcap"], indirect=True)
def test_what_is_not_understood_is_named(log: Path) -> None:
    assert "/video (protobuf) is left out" in ss.read_record(log).history[-1].outcome


@pytest.mark.parametrize("log", robot_logs.LOGS, indirect=True)
def test_a_log_that_was_cut_off_is_refused_or_read_so_far(log: Path) -> None:
    whole = log.read_bytes()
    for share in (0.02, 0.5, 0.95):
        log.write_bytes(whole[: int(share * len(whole))])
        with contextlib.suppress(FormatError):
            assert len(ss.read_record(log)) <= len(robot_logs.moved()[0])
