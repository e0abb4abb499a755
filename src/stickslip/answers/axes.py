"""Which columns of a robot's log are those of one axis, by the names that its tools write."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

from stickslip.errors import RecordError
from stickslip.record.channels import VOCABULARY
from stickslip.record.record import Record, Step
from stickslip.settings import nearest

# What a column holds, by how ROS and ros2_control, LeRobot, MuJoCo, Dynamixel and drives of machines call it.
NAMES = {
    "theta": (
        "present position", "actual position", "measured position", "joint position", "motor position",
        "observation state", "qpos", "positions", "position", "pos", "angle", "theta", "actual q", "joint angle", "q",
    ),
    "reference": (
        "goal position", "target position", "desired position", "commanded position", "reference position",
        "position command", "position setpoint", "position reference", "action", "ctrl", "command", "cmd", "target",
        "setpoint", "reference", "goal", "desired", "target q", "q ref", "q des", "qref", "qdes", "ref",
    ),
    "force": ("motor torque", "joint torque", "actuator force", "qfrc actuator", "effort", "torque", "tau", "force"),
    "current": ("present current", "motor current", "actual current", "joint current", "current"),
}  # fmt: skip
OTHERS = {
    "velocity", "velocities", "vel", "qvel", "speed", "acceleration", "accelerations", "acc", "temperature", "voltage",
    "pwm", "load", "error",
}  # fmt: skip
WANTED = {
    "goal", "target", "desired", "command", "commands", "commanded", "cmd", "reference", "action", "output",
}  # fmt: skip  # of a torque: not measured
SOURCES = {"state", "states", "feedback"}  # who says it, not of which axis
TURNING = {"theta": "rad", "reference": "rad", "force": "N m", "current": "A"}


@dataclass(frozen=True)
class _Column:
    """A channel of a log: what it holds, and of which axis."""

    channel: str
    kind: str
    axis: str


def axis_record(record: Record, *, axis: str | None = None) -> Record:
    """The channels of one axis of a robot's log, under the names of the vocabulary.

    Position, reference, torque and current are known by the names that ROS, LeRobot, MuJoCo, Dynamixel and drives give
    their columns; what else stands in a name tells which axis it is of. An angle or torque whose unit is not stated is
    taken to be in rad or N m, and flagged.

    Parameters
    ----------
    record : Record
        A log with its columns as they are called in the file.
    axis : str, optional
        What tells the axis in the columns' names, "shoulder_pan" or "2"; needed where there are several.

    Returns
    -------
    Record
        With ``theta`` (``x`` of an axis that moves straight) and, where the log has them, ``reference``, ``force`` and
        ``current``; the same record where its channels are called so already.

    Raises
    ------
    RecordError
        No position is found, or several axes and none named.

    Examples
    --------
    >>> log = {"observation.state.0": [0.1, 0.2], "action.0": [0.1, 0.3], "action.1": [0.0, 0.0]}
    >>> record = Record.of({name.replace(".", "_"): values for name, values in log.items()}, fs=30.0)
    >>> list(axis_record(record, axis="0"))
    ['theta', 'reference']
    """
    if axis is None and ("theta" in record or "x" in record):
        return record
    columns = list(_columns(record))
    axes = list(dict.fromkeys(column.axis for column in columns if column.kind == "theta"))
    if not axes:
        stated = "" if axis is None else f"axis = {axis!r}: "
        raise RecordError(
            f"{stated}no column is called a position: {', '.join(_called(record, name) for name in record)}",
            "a joint's log has its position, and a torque, a current or a reference",
            'name the columns: --channels "theta=COLUMN [rad]" --channels "force=COLUMN [N m]"',
        )
    chosen = [one for one in axes if axis is None or _fits(one, axis)]
    if len(chosen) != 1:
        called = ", ".join(one or "(unnamed)" for one in axes)
        raise RecordError(
            f"the log has the axes {called}" if axis is None else f"axis = {axis!r} fits {len(chosen)} of {called}",
            "the friction of one axis is asked for at a time",
            nearest(axis or "", axes) if axis else f"name one: --axis {axes[0]}",
        )
    return _renamed(record, [column for column in columns if column.axis == chosen[0]], chosen[0])


def _called(record: Record, name: str) -> str:
    return record.channels[name].column if record.channels[name].source != "array" else name


def _columns(record: Record) -> Iterator[_Column]:
    for name in record:
        parts = re.findall(r"[a-z]+|\d+", re.sub(r"[\[(][^\[(]*[\])]\s*$", "", _called(record, name).lower()))
        if OTHERS & set(parts):
            continue
        kinds = [
            (len(alias.split()), kind, parts[:at] + parts[at + len(alias.split()) :])
            for kind, aliases in NAMES.items()
            for alias in aliases
            for at in range(len(parts))
            if parts[at : at + len(alias.split())] == alias.split()
        ]
        if not kinds:
            continue
        _, kind, others = max(kinds, key=lambda one: one[0])
        if kind in ("force", "current") and WANTED & set(parts):
            continue
        if kind == "theta" and WANTED & set(parts):
            kind, others = "reference", [word for word in others if word not in WANTED]
        yield _Column(name, kind, "_".join(word for word in others if word not in SOURCES))


def _fits(name: str, axis: str) -> bool:
    """Whether an axis is named so, by all words of its name or by some of them in a row."""
    name_parts, axis_parts = (re.findall(r"[a-z]+|\d+", text.lower()) for text in (name, axis))
    return any(name_parts[at : at + len(axis_parts)] == axis_parts for at in range(len(name_parts)))


def _renamed(record: Record, columns: list[_Column], axis: str) -> Record:
    samples, channels, titles = {}, {}, {}
    straight = any(record.channels[column.channel].unit == "m" for column in columns)
    for kind in TURNING:
        fitting = [column for column in columns if column.kind == kind]
        if len(fitting) > 1:
            raise RecordError(
                f"{' and '.join(_called(record, column.channel) for column in fitting)} both tell the {kind}",
                "one column tells one quantity of an axis",
                f'name the one meant: --channels "{kind}=COLUMN"',
            )
        for column in fitting:
            known = record.channels[column.channel]
            name = "x" if straight and kind == "theta" else kind
            usual = TURNING[kind].replace("rad", "m").replace("N m", "N") if straight else TURNING[kind]
            unit, unstated = (usual, True) if known.unit == "1" else (known.unit, known.assumed)
            samples[name], titles[name] = record[column.channel], _called(record, column.channel)
            quantity = VOCABULARY[name].words
            channels[name] = replace(known, name=name, unit=unit, quantity=quantity, assumed=unstated)
    step = Step("axis_record", titles, f"axis {axis}" if axis else "one axis")
    return replace(record, samples=samples, channels=channels, history=(*record.history, step))
