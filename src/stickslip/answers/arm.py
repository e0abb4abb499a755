"""What the bodies of a robot take of a joint's torque, by its URDF: the rest is the joint's own, friction and rotor."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.answers.axes import axis_record, fits
from stickslip.arrays import Array
from stickslip.errors import ABSENT, ModelError, RecordError, package
from stickslip.files.expression import split_gain
from stickslip.record.record import Record, Step
from stickslip.signals.derivatives import differentiate, smooth

# Of what bodies take, that smoothing and counts leave unknown at least: at 12 bit the rotor beside bodies of ten times
# its inertia was told 1.4 % too small (30 logs of tests/test_arm.py), which is 0.14 % of both.
SMOOTHED = 2e-3


def without_bodies(record: Record, *, urdf: str | Path, axis: str) -> Record:
    r"""One axis of a robot's log, with the torque that the robot's bodies take of it.

    That torque is the axis's row of :math:`M(q)\ddot q + C(q, \dot q)\dot q + g(q)`, by the recursive Newton-Euler
    algorithm (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 5) of Pinocchio over all axes of the log. What
    moves in the URDF and is not in the log is taken to rest at its zero.

    Parameters
    ----------
    record : Record
        A log of the positions of all axes that move, as :func:`axis_record` takes it; its columns named as the joints.
    urdf : path
        The robot, standing on its first link. As text with how unsure its torques are, one standard deviation,
        ``"arm.urdf ± 2 %"``; else its masses, lengths and inertias are taken to be exact.
    axis : str
        Which joint, by its name in the URDF or a part of it.

    Returns
    -------
    Record
        That of the axis, with a channel ``bodies`` [N m, or N of one that moves straight], which
        :func:`~stickslip.cycle.regress_joint` takes from its torque.

    Raises
    ------
    ModelError
        Pinocchio is not installed, the file is no URDF, or no joint, or several, are called so.
    RecordError
        The log does not have the joint.

    Examples
    --------
    >>> import tempfile
    >>> bar = '<inertial><origin xyz="0.2 0 0"/><mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0.01" '
    >>> bar = f'<link name="wall"/><link name="bar">{bar} iyz="0" izz="0.01"/></inertial></link>'
    >>> hinge = '<parent link="wall"/><child link="bar"/><axis xyz="0 -1 0"/>'
    >>> urdf = Path(tempfile.mkdtemp()) / "bar.urdf"
    >>> text = f'<robot name="bar">{bar}<joint name="hinge" type="continuous">{hinge}</joint></robot>'
    >>> characters = urdf.write_text(text, encoding="utf-8")
    >>> log = Record.of({"position_hinge": np.linspace(-0.5, 0.5, 1001)}, fs=100, units={"position_hinge": "rad"})
    >>> round(float(without_bodies(log, urdf=urdf, axis="hinge")["bodies"][500]), 3)  # m g r, where it is level
    1.962
    """
    pinocchio = package("pinocchio", extra="arm", rule="it computes what a URDF's bodies take", error=ModelError)
    text, unsure = split_gain(str(urdf))
    file = Path(text.strip())
    model = _model(pinocchio, file)
    names = list(model.names)[1:]
    chosen = _chosen(names, axis)
    logs = {name: _axis(record, name) for name in names}
    log = logs[chosen]
    if log is None:
        raise RecordError(f"the log has no position of {chosen}", "it is that joint's", "see its columns")
    moves = {name: part for name, part in logs.items() if part is not None}
    torque = _torques(pinocchio, model, moves, record.fs)[names.index(chosen)]
    resting = [name for name in names if name not in moves]
    outcome = f"of {', '.join(moves)}" + (f"; {', '.join(resting)} taken to rest" if resting else "")
    unit = "N" if "x" in log else "N m"
    step = Step("without_bodies", {"urdf": file.name, "unsure": unsure}, outcome)
    log = log.with_channel("bodies", torque, unit=unit, source="without_bodies", step=step)
    return log.with_details("bodies", gain_sd=math.hypot(unsure, SMOOTHED))


def _model(pinocchio: Any, urdf: Path) -> Any:
    """The robot, all of whose joints have one coordinate."""
    try:
        model = pinocchio.buildModelFromXML(urdf.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValueError, RuntimeError) as error:
        raise ModelError(f"'{urdf}': {error}", "a robot is read from its URDF", "name another file") from error
    several = [name for name, joint in zip(model.names, model.joints, strict=True) if joint.nv > 1]
    if several or len(model.names) < 2:
        raise ModelError(
            f"'{urdf}' moves in {', '.join(several) or 'no joint'}",
            "each joint turns or slides about one axis",
            "give a robot of such joints",
        )
    return model


def _chosen(names: list[str], axis: str) -> str:
    """The joint that is called so, or the one of whose name that is a part."""
    chosen = [name for name in names if name == axis] or [name for name in names if fits(name, axis)]
    if len(chosen) != 1:
        raise ModelError(
            f"axis = {axis!r} fits {len(chosen)} of {', '.join(names)}", "one joint is asked for at a time", "name one"
        )
    return chosen[0]


def _axis(record: Record, name: str) -> Record | None:
    """A joint's own channels; None where the log has not its position."""
    for called in (name, re.sub(r"[\W_]*joint[\W_]*", "_", name).strip("_")):
        try:
            return axis_record(record, axis=called)
        except RecordError as error:
            if error.kind != ABSENT:
                raise
    return None


def _torques(pinocchio: Any, model: Any, logs: dict[str, Record], fs: float) -> Array:
    """The torque of every joint over time, shape (joints, n)."""
    count = len(next(iter(logs.values())))
    place, speed, acceleration = np.zeros((model.nq, count)), np.zeros((model.nv, count)), np.zeros((model.nv, count))
    place[:] = pinocchio.neutral(model)[:, None]
    for name, log in logs.items():
        joint = model.joints[model.getJointId(name)]
        position = log["x" if "x" in log else "theta"]
        still = smooth(position, fs).values
        # a joint that turns without end has the cosine and the sine of its angle for coordinates
        place[joint.idx_q : joint.idx_q + joint.nq] = still if joint.nq == 1 else (np.cos(still), np.sin(still))
        speed[joint.idx_v] = differentiate(position, fs).values
        acceleration[joint.idx_v] = differentiate(position, fs, order=2).values
    data = model.createData()
    moments = zip(place.T, speed.T, acceleration.T, strict=True)
    torques = np.array([pinocchio.rnea(model, data, q, v, a) for q, v, a in moments])
    return torques.T[[model.joints[model.getJointId(name)].idx_v for name in list(model.names)[1:]]]
