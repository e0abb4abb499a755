"""One axis of a robot's log: which column is what, by the names that robots and drives give them, and what the bodies
take of its torque, by a URDF: the rest is the joint's own, friction and rotor. And how a joint moves along a log."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from stickslip.answers.mistakes import called, require_angle
from stickslip.arrays import Array
from stickslip.compiled import OPTIONS, compiled
from stickslip.cycle.joint import JointFriction
from stickslip.cycle.joint_fit import LOOP, is_late
from stickslip.cycle.joint_slides import sliding
from stickslip.errors import ABSENT, ModelError, RecordError, package
from stickslip.estimate import Estimate, doubts_of
from stickslip.files.expression import split_gain
from stickslip.files.select import split_name
from stickslip.record.channels import VOCABULARY, Channel
from stickslip.record.record import Record, Step
from stickslip.settings import nearest
from stickslip.signals.derivatives import differentiate, smooth
from stickslip.units import parse_unit

# What a column holds, by how ROS and ros2_control, LeRobot, MuJoCo, Dynamixel and drives of machines call it.
NAMES = {
    "theta": (
        "present position", "actual position", "measured position", "joint position", "link position",
        "observation state", "qpos", "positions", "position", "pos", "angle", "theta", "actual q", "joint angle", "q",
    ),
    "reference": (
        "goal position", "target position", "desired position", "commanded position", "reference position",
        "position command", "position setpoint", "position reference", "action", "ctrl", "command", "cmd", "target",
        "setpoint", "reference", "goal", "desired", "target q", "q ref", "q des", "qref", "qdes", "ref",
    ),
    "motor": ("motor position", "motor angle", "rotor position", "rotor angle"),
    "force": ("motor torque", "joint torque", "actuator force", "qfrc actuator", "effort", "torque", "tau", "force"),
    "temperature": ("present temperature", "motor temperature", "joint temperature", "temperature"),
    "current": ("present current", "motor current", "actual current", "joint current", "current"),
}  # fmt: skip
RATES = {"velocity", "velocities", "vel", "qvel", "speed"}
OTHERS = {*RATES, "acceleration", "accelerations", "acc", "voltage", "pwm", "load", "error"}
WANTED = {
    "goal", "target", "desired", "command", "commands", "commanded", "cmd", "reference", "action", "output",
}  # fmt: skip  # of a torque: not measured
LINKS = {"joint", "link", "present", "actual", "measured", "observation", "state", "rad", "deg", "s"}  # of no axis
SOURCES = {"state", "states", "feedback"}  # who says it, not of which axis
TITLE_UNITS = {
    "rad": ("rad", "rad"), "deg": ("deg", "rad"), "Nm": ("N m", "N m"), "mNm": ("mN m", "N m"), "A": ("A", "A"),
    "mA": ("mA", "A"),
}  # fmt: skip  # at a title's end ("torque_Nm"): the unit, and that of SI
NEARLY = 0.25  # of a turn: an encoder that wraps jumps by one within so much, and by no more from sample to sample else
TURNING = {"theta": "rad", "reference": "rad", "motor": "rad", "force": "N m", "current": "A", "temperature": "K"}


@dataclass(frozen=True)
class _Column:
    """A channel of a log: what it holds, of which axis, and the unit that its title ends in."""

    channel: str
    kind: str
    axis: str
    unit: str = ""


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
        No position is found, several axes and none named, or an angle without a unit that is not in rad.

    Examples
    --------
    >>> log = {"observation.state.0": [0.1, 0.2], "action.0": [0.1, 0.3], "action.1": [0.0, 0.0]}
    >>> record = Record.of({name.replace(".", "_"): values for name, values in log.items()}, fs=30.0)
    >>> list(axis_record(record, axis="0"))
    ['theta', 'reference']
    """
    if axis is None and ("theta" in record or "x" in record):
        require_angle(record, _rate(record, ""))
        return _unwrapped(record)
    columns = list(_columns(record))
    if all(column.kind != "theta" for column in columns):  # the motor's encoder is the only one
        columns = [replace(one, kind="theta") if one.kind == "motor" else one for one in columns]
    axes = list(dict.fromkeys(column.axis for column in columns if column.kind == "theta"))
    if not axes:
        stated = "" if axis is None else f"axis = {axis!r}: "
        raise RecordError(
            f"{stated}no column is called a position: {', '.join(called(record, name) for name in record)}",
            "a joint's log has its position, and a torque, a current or a reference",
            'name the columns: --channels "theta=COLUMN [rad]" --channels "force=COLUMN [N m]"',
        )
    chosen = [one for one in axes if axis is None or fits(one, axis)]
    if len(chosen) != 1:
        names = ", ".join(one or "(unnamed)" for one in axes)
        raise RecordError(
            f"the log has the axes {names}" if axis is None else f"axis = {axis!r} fits {len(chosen)} of {names}",
            "the friction of one axis is asked for at a time",
            nearest(axis or "", axes) if axis else f"name one: --axis {axes[0]}",
            kind="" if axis is None else ABSENT,
        )
    log = _renamed(record, [column for column in columns if column.axis == chosen[0]], chosen[0])
    require_angle(log, _rate(record, chosen[0]))
    return _unwrapped(log)


def _rate(record: Record, axis: str) -> tuple[Channel, Array] | None:
    """The velocity of an axis, which is no motor's nor a set value; None without one."""
    own = set(re.findall(r"[a-z]+|\d+", axis.lower()))
    for name in record:
        words = set(re.findall(r"[a-z]+|\d+", split_name(called(record, name))[0].lower()))
        if words & RATES and not words & {*WANTED, "motor", "rotor"} and words - RATES - LINKS == own - LINKS:
            return record.channels[name], record[name]
    return None


def _unwrapped(record: Record) -> Record:
    """Angles that jump by a turn, as of an encoder that counts one alone, counted on beyond it."""
    samples, jumps = dict(record.samples), dict[str, int]()
    for name in ("theta", "reference"):
        turns = np.diff(samples[name]) / (2 * np.pi) if name in samples else np.zeros(0)
        jumped = np.abs(turns) > 0.5
        if np.any(jumped) and np.all(np.abs(np.abs(turns) - jumped) < NEARLY):
            samples[name], jumps[name] = np.unwrap(samples[name]), int(jumped.sum())
    if not jumps:
        return record
    if "theta" in samples and "reference" in samples:  # within half a turn of each other
        ahead = np.median(samples["reference"] - samples["theta"]) / (2 * np.pi)
        samples["reference"] = samples["reference"] - 2 * np.pi * np.rint(ahead)
    step = Step("axis_record", {"jumps of a turn": jumps}, "angles counted on beyond a turn")
    return replace(record, samples=samples, history=(*record.history, step))


def _columns(record: Record) -> Iterator[_Column]:
    lettered = any(called(record, name).endswith("_B") for name in record)  # then "_A" is an axis
    for name in record:
        title = re.sub(r"[\[(][^\[(]*[\])]\s*$", "", called(record, name))
        bare, _, unit = title.rpartition("_")
        title, unit = (bare, unit) if unit in TITLE_UNITS and not (lettered and unit == "A") else (title, "")
        parts = re.findall(r"[a-z]+|\d+", title.lower())
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
        yield _Column(name, kind, "_".join(word for word in others if word not in SOURCES), unit)


def fits(name: str, axis: str) -> bool:
    """Whether an axis is named so, by all words of its name or by some of them in a row."""
    name_parts, axis_parts = (re.findall(r"[a-z]+|\d+", text.lower()) for text in (name, axis))
    return any(name_parts[at : at + len(axis_parts)] == axis_parts for at in range(len(name_parts)))


def _renamed(record: Record, columns: list[_Column], axis: str) -> Record:
    samples, channels, titles = {}, {}, {}
    straight = any(record.channels[column.channel].unit == "m" for column in columns)
    for kind in TURNING:
        fitting = [column for column in columns if column.kind == kind]
        if kind == "temperature" and len(fitting) > 1:  # of what, nobody said: the friction is told without
            continue
        if len(fitting) > 1:
            raise RecordError(
                f"{' and '.join(called(record, column.channel) for column in fitting)} both tell the {kind}",
                "one column tells one quantity of an axis",
                f'name the one meant: --channels "{kind}=COLUMN"',
            )
        for column in fitting:
            known = record.channels[column.channel]
            name = "x" if straight and kind == "theta" else kind
            usual = TURNING[kind].replace("rad", "m").replace("N m", "N") if straight else TURNING[kind]
            unit, unstated = (usual, True) if known.unit == "1" else (known.unit, known.assumed)
            if kind == "temperature":  # robots write it in degrees Celsius, without a unit
                scale = parse_unit("degC" if known.unit == "1" or known.assumed else known.unit, expect="K")
                samples[name], titles[name] = record[column.channel] * scale.scale + scale.zero, name
                channels[name] = replace(known, name=name, unit="K", quantity=VOCABULARY[name].words)
                continue
            samples[name], titles[name] = record[column.channel], called(record, column.channel)
            written, meant = TITLE_UNITS.get(column.unit, ("", ""))
            if unstated and meant == usual:
                samples[name], unstated = samples[name] * parse_unit(written, expect=usual).scale, False
            quantity = VOCABULARY[name].words
            channels[name] = replace(known, name=name, unit=unit, quantity=quantity, assumed=unstated)
    step = Step("axis_record", titles, f"axis {axis}" if axis else "one axis")
    return replace(record, samples=samples, channels=channels, history=(*record.history, step))


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
    for axis in (name, re.sub(r"[\W_]*joint[\W_]*", "_", name).strip("_")):
        try:
            return axis_record(record, axis=axis)
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


# ---- a joint that moves


# Steps in a second at least, and in the time in which the loop answers: of 12 joints of tests/joints.py, seeds 300 to
# 311, the motion is then within 6e-6 rad (r.m.s.) of that of 32 times as many, a sixteenth of a count of 16 bit.
FINEST, STEPS = 1000.0, 20.0
FASTEST = 1e6  # steps in a second at most: a minute of a log takes some 20 s then
# What a log tells of a joint that moves it.
PARTS = (
    "inertia", "forward", "back", "viscous_forward", "viscous_back", "load", "sine", "cosine", "damping"
)  # fmt: skip
MOVES = 4.0  # deviations of its speed, above which a joint surely moves where it begins


@dataclass(frozen=True)
class Joint:
    """A joint as a log told it, in rad, N m and s; of an axis that moves straight in m, N and s.

    Attributes
    ----------
    inertia, forward, back, viscous_forward, viscous_back, load, sine, cosine : float
        As of :class:`~stickslip.cycle.JointFriction`.
    cogging, waves, phase : float
        Of a torque that goes up and down along the way: its size, periods in a radian, and phase.
    excess, speed, exponent : float
        By how much its friction at rest is above that, within which speed it falls, and Stribeck's exponent.
    by_teeth : float
        1 where `load` is that which a gear's teeth bear, the mean of the motor's torque and of gravity's.
    kp, damping : float
        Of its control loop, late as that is: 0 where nobody stated the gain, nor `kd` of a log with its torque.
    torque_constant : float
        Torque per current; 0 where nobody stated it.
    delay : float
        By how much a measured torque comes later than the position.
    axis : str
        Which of a log of several.
    doubtful : tuple of str
        Quantities that its log told with a doubt.
    """

    inertia: float
    forward: float
    back: float
    viscous_forward: float
    viscous_back: float
    load: float = 0.0
    sine: float = 0.0
    cosine: float = 0.0
    cogging: float = 0.0
    waves: float = 0.0
    phase: float = 0.0
    excess: float = 0.0
    speed: float = 1.0
    exponent: float = 2.0
    by_teeth: float = 0.0
    kp: float = 0.0
    damping: float = 0.0
    torque_constant: float = 0.0
    delay: float = 0.0
    axis: str = ""
    doubtful: tuple[str, ...] = ()

    @classmethod
    def of(cls, joint: JointFriction, axis: str) -> Self:
        """That of a regression."""
        stated = {name: constant.value for name, constant in joint.stated.items()}
        told = {name: getattr(joint, name) for name in PARTS}
        told |= {name: told[name] or joint.viscous for name in ("viscous_forward", "viscous_back")}
        # all together as they fit the log: each cut where it can not be, they would move as nothing in it did
        numbers = {name: joint.moving.get(name, _known(estimate)) for name, estimate in told.items()}
        doubted = [estimate for estimate in told.values() if estimate is not None and doubts_of(estimate.status)]
        falls = {}
        if joint.static is not None and joint.stribeck_speed is not None and joint.exponent is not None:
            excess = max(joint.static.value - joint.level.value, 0.0)
            falls = {"excess": excess, "speed": joint.stribeck_speed.value, "exponent": joint.exponent}
        loop, kp, late = joint.source == "reference", stated.get("kp", 0.0), _known(joint.delay)
        if "kd" in stated:  # a late controller damps less
            damping = stated["kd"] - kp * (late if loop and late else LOOP[0])
        else:
            kp, damping = (kp, numbers["damping"]) if loop else (0.0, 0.0)
        surely = not loop and joint.delay is not None and is_late(joint.delay)
        constant = stated.get("torque_constant", 0.0)
        loop_of = {"kp": kp, "damping": damping, "torque_constant": constant, "delay": late if surely else 0.0}
        teeth = {"cogging": _known(joint.cogging), "waves": joint.waves[0], "phase": joint.waves[1]}
        numbers |= {**teeth, **falls, **loop_of, "by_teeth": joint.by_teeth}
        doubtful = tuple(dict.fromkeys(estimate.name for estimate in doubted))
        return cls(**{name: float(value) for name, value in numbers.items()}, axis=axis, doubtful=doubtful)

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> Self:
        """That of a file."""
        try:
            joint = cls(**{**values, "doubtful": tuple(values.get("doubtful", ()))})
            words = ("axis", "doubtful")
            right = all(np.isfinite(value) for name, value in vars(joint).items() if name not in words)
        except TypeError as error:
            raise ModelError(f"[joint]: {error}", "it holds what stickslip joint writes", "write it anew") from error
        if not (right and joint.inertia > 0):
            raise ModelError(f"[joint]: {joint}", "its numbers are finite, its inertia positive", "correct the file")
        return joint

    @property
    def law(self) -> Joint:
        """What is tried on a record: all of it."""
        return self

    def plainly(self, level: float, viscous: float) -> Joint:
        """With Coulomb's friction and a damper, alike both ways."""
        viscous = max(viscous, 0.0)
        ways = {"forward": level, "back": level, "viscous_forward": viscous, "viscous_back": viscous}
        return replace(self, **ways, load=0.0, excess=0.0)  # type: ignore[arg-type]

    def moved(self, log: Record, *, loop: bool) -> tuple[Array, Array]:
        """Place and torque at each sample of a log: inside its control loop, or by the torque that was measured.

        By a torque it begins anew from the log wherever that turns or comes to rest: nothing holds it in its place, and
        what is wrong of the torque adds up.
        """
        fs, position = log.fs, log["theta" if "theta" in log else "x"]
        drive, anew = log["reference" if loop else "force"], np.zeros(len(log), dtype=bool)
        if not loop:
            drive = np.interp(log.time + self.delay, log.time, drive)
            anew[1:] = np.diff(np.abs(sliding(position, fs).side)) < 0
        kp, kd = (self.kp, self.damping) if loop else (0.0, 0.0)
        most = max(abs(self.viscous_forward), abs(self.viscous_back)) + abs(kd)
        fastest = STEPS * (math.sqrt((kp + math.hypot(self.sine, self.cosine)) / self.inertia) + most / self.inertia)
        if fastest > FASTEST:
            raise ModelError(
                f"an inertia of {self.inertia:.3g} under such a gain and such friction",
                f"a joint is followed that answers within {STEPS / FASTEST:g} s or later",
                "look at what stickslip joint tells of its inertia",
            )
        steps = math.ceil(max(FINEST, fastest) / fs)
        velocity = differentiate(position, fs)
        rate = np.where(np.abs(velocity.values) > MOVES * velocity.sd, velocity.values, 0.0)
        numbers = np.array([getattr(self, field.name) for field in fields(self)[:15]])
        place, torque = smooth(position, fs).values.copy(), np.ascontiguousarray(drive).copy()
        anew[0] = True
        march_joint(numbers, np.array([kp, kd]), anew, rate, steps, 1 / (fs * steps), place, torque)
        return place, torque


def _known(estimate: Estimate | None) -> float:
    """A value, none where nothing is told."""
    return 0.0 if estimate is None or not estimate.known else estimate.value


@compiled(**OPTIONS)
def march_joint(p, gains, anew, rate, steps, dt, place, torque):  # type: ignore[no-untyped-def]
    """Places and torques in place of those of a log, and of a torque or a reference that is straight between samples.

    Runge's and Kutta's fourth order, one side of the friction in a step: where the speed changes its sign in it, it
    rests, and slides again as soon as the friction does not bear the torque. It begins `anew` as the log does there.
    """
    inertia, forward, back, ahead, behind, share, sine, cosine, cogging, waves, phase, excess, fall, exponent, teeth = p
    kp, kd = gains
    closed = kp != 0.0
    q, v = place[0], rate[0]
    for i in range(len(torque)):
        drive = torque[i]
        slope = (torque[i + 1] - drive) / (steps * dt) if i + 1 < len(torque) else 0.0
        if anew[i]:
            q, v = place[i], rate[i]
        place[i] = q
        torque[i] = kp * (drive - q) + kd * (slope - v) if closed else drive
        for j in range(steps):
            side = 1.0 if v > 0 else -1.0
            if v == 0.0:
                command = drive + slope * j * dt
                push = kp * (command - q) + kd * slope if closed else command
                load = sine * np.sin(q) + cosine * np.cos(q)
                push -= cogging * np.sin(2 * np.pi * waves * q + phase)
                side = 1.0 if push > load else -1.0
                borne = abs(load + teeth * push) / (1 + teeth)
                if abs(push - load) <= (forward if side > 0 else back) + share * borne + excess:
                    continue
            # four slopes, each about the one before it
            moved, rose, vs, a = 0.0, 0.0, v, 0.0
            for k in range(4):
                h = 0.0 if k == 0 else dt if k == 3 else dt / 2
                x, vs = q + h * vs, v + h * a
                command = drive + slope * (j * dt + h)
                push = kp * (command - x) + kd * (slope - vs) if closed else command
                push -= cogging * np.sin(2 * np.pi * waves * x + phase)
                load = sine * np.sin(x) + cosine * np.cos(x)
                rubs = (forward if side > 0 else back) + share * abs(load + teeth * push) / (1 + teeth)
                if excess > 0.0:
                    rubs += excess * np.exp(-((abs(vs) / fall) ** exponent))
                a = (push - load - (ahead if side > 0 else behind) * vs - side * rubs) / inertia
                weight = 1.0 if k == 0 or k == 3 else 2.0
                moved, rose = moved + weight * vs, rose + weight * a
            q, v = q + dt / 6 * moved, v + dt / 6 * rose
            if v * side <= 0.0:
                v = 0.0
