"""One joint's log as robots write it: MCAP, bags of ROS 1 and 2, MDF, each by its own library."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

FS, SECONDS = 100.0, 30.0
EFFORT = {"inertia": 0.02, "coulomb": 0.06, "viscous": 0.03}
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
COMMANDS = """std_msgs/MultiArrayLayout layout
float64[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""
STATES, SLOW = "/joint_states", "/effort_controller/commands"


def moved() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, angle and torque of a joint without gravity."""
    t = np.arange(round(SECONDS * FS)) / FS
    q = 1.2 * np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    noise = np.random.default_rng(3).normal(0, 0.003, t.size)
    return t, q, EFFORT["inertia"] * a + EFFORT["viscous"] * v + EFFORT["coulomb"] * np.sign(v) + noise


def _rows() -> list[tuple[int, dict[str, object]]]:
    t, q, effort = moved()
    return [
        (
            10**18 + round(now * 1e9),
            {
                "header": {"stamp": {"sec": 10**9 + int(now), "nanosec": round(now % 1 * 1e9)}, "frame_id": ""},
                "name": ["shoulder", "elbow"],
                "position": [0.0, angle],
                "velocity": [],
                "effort": [0.1, torque],
            },
        )
        for now, angle, torque in zip(t.tolist(), q.tolist(), effort.tolist(), strict=True)
    ]


def _commands() -> list[tuple[int, list[float]]]:
    """Every fifth torque, told 2 ms after its state was heard."""
    return [(heard + 2_000_000, row["effort"]) for heard, row in _rows()[::5]]  # type: ignore[misc]


def write_mcap(path: Path) -> None:
    from mcap_ros2.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        states = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        commands = writer.register_msgdef("std_msgs/msg/Float64MultiArray", COMMANDS)
        for heard, row in _rows():
            writer.write_message(topic=STATES, schema=states, message=row, log_time=heard, publish_time=heard)
        for heard, data in _commands():
            message = {"layout": {"dim": [], "data_offset": 0}, "data": data}
            writer.write_message(topic=SLOW, schema=commands, message=message, log_time=heard, publish_time=heard)
        writer.finish()


def write_json_mcap(path: Path) -> None:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        states = writer.register_channel(STATES, "json", 0)
        other = writer.register_channel("/video", "protobuf", 0)
        writer.add_message(other, log_time=10**18, publish_time=10**18, data=b"\x08\x01")
        for heard, row in _rows():
            writer.add_message(states, log_time=heard, publish_time=heard, data=json.dumps(row).encode())
        writer.finish()


def _stored(store, row: dict) -> object:  # type: ignore[no-untyped-def, type-arg]
    types, stamp = store.types, row["header"]["stamp"]
    more = {"seq": 0} if "seq" in dict(store.fielddefs["std_msgs/msg/Header"][1]) else {}
    time = types["builtin_interfaces/msg/Time"](**stamp)
    lists = {name: np.array(row[name], dtype=np.float64) for name in ("position", "velocity", "effort")}
    header = types["std_msgs/msg/Header"](stamp=time, frame_id="", **more)
    return types["sensor_msgs/msg/JointState"](header=header, name=row["name"], **lists)


def write_bag(path: Path) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as bag:
        states = bag.add_connection(STATES, "sensor_msgs/msg/JointState", typestore=store)
        for heard, row in _rows():
            bag.write(states, heard, store.serialize_ros1(_stored(store, row), states.msgtype))


def write_db3(path: Path) -> None:
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    folder = path.with_suffix(".folder")
    with Writer(folder, version=8) as bag:
        states = bag.add_connection(STATES, "sensor_msgs/msg/JointState", typestore=store)
        for heard, row in _rows():
            bag.write(states, heard, store.serialize_cdr(_stored(store, row), states.msgtype))
    next(folder.glob("*.db3")).rename(path)


def write_mf4(path: Path) -> None:
    from asammdf import MDF, Signal

    t, q, effort = moved()
    with MDF() as file:
        signals = [(np.rad2deg(q), "position", "deg"), (effort, "torque", "Nm")]
        file.append([Signal(values, t, unit=unit, name=name) for values, name, unit in signals])
        file.append([Signal(20 + t[::50], t[::50], unit="degC", name="temperature")])
        file.save(path, overwrite=True)


LOGS = {
    "a.mcap": write_mcap, "json.mcap": write_json_mcap, "one.bag": write_bag, "two.db3": write_db3, "a.mf4": write_mf4,
}  # fmt: skip
