"""Friction of machines: a joint or an axis from its own log, and a tribometer's coefficient by its definitions."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from stickslip.answers.findings import Comparison, Findings, Inquiry, flagged, record_name, require_several, with_doubt
from stickslip.answers.mistakes import called, require_angle
from stickslip.cycle.joint import JointFriction, regress_joint
from stickslip.cycle.joint_logs import regress_joint_logs
from stickslip.cycle.joint_onset import joint_backlash, joint_breakaway
from stickslip.cycle.static_peak import static_coefficient
from stickslip.cycle.sticks import find_sticks
from stickslip.cycle.tribometer import DEFINITIONS, friction_coefficients
from stickslip.errors import ABSENT, RecordError
from stickslip.estimate import UNTRIED, Constant, Doubt, Estimate
from stickslip.laws.coulomb import LinearSlope
from stickslip.laws.stribeck import Stribeck
from stickslip.record.channels import VOCABULARY
from stickslip.record.clock import fit_clock
from stickslip.record.record import Record, Step, require_record
from stickslip.rig.settings import RigSettings
from stickslip.settings import nearest
from stickslip.signals.derivatives import differentiate
from stickslip.signals.interpolate import without_delays
from stickslip.statistics import mean_of_cycles
from stickslip.units import parse_unit

# A joint has no twins: swept through its turns without a rest it was told to stand still 1.0 to 2.3 % of the time.
TURNS = Doubt("a joint that never rests may seem to stand still as well where it turns", UNTRIED)
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
OTHERS = {
    "velocity", "velocities", "vel", "qvel", "speed", "acceleration", "accelerations", "acc", "voltage",
    "pwm", "load", "error",
}  # fmt: skip
WANTED = {
    "goal", "target", "desired", "command", "commands", "commanded", "cmd", "reference", "action", "output",
}  # fmt: skip  # of a torque: not measured
SOURCES = {"state", "states", "feedback"}  # who says it, not of which axis
TITLE_UNITS = {
    "rad": ("rad", "rad"), "deg": ("deg", "rad"), "Nm": ("N m", "N m"), "mNm": ("mN m", "N m"), "A": ("A", "A"),
    "mA": ("mA", "A"),
}  # fmt: skip  # at a title's end ("torque_Nm"): the unit, and that of SI
NEARLY = 0.25  # of a turn: an encoder that wraps jumps by one within so much, and by no more from sample to sample else
TURNING = {"theta": "rad", "reference": "rad", "motor": "rad", "force": "N m", "current": "A", "temperature": "K"}


def analyze_joint(
    record: Record,
    *,
    inertia: Constant | None = None,
    kp: Constant | None = None,
    kd: Constant | None = None,
    torque_constant: Constant | None = None,
    gravity: bool | None = None,
    axis: str | None = None,
) -> Findings:
    """Ask a joint's log every question about its friction that its columns allow.

    In this order: which columns are the axis's; friction either way, its viscous part, what of it grows with the load,
    inertia and gravity (:func:`~stickslip.cycle.regress_joint`); the friction at breakaway over the sliding one, where
    the log tells it to 5 %; where motor and link have an encoder each the play between them
    (:func:`~stickslip.cycle.joint_backlash`); stops. A question that can not be answered becomes a note.

    Parameters
    ----------
    record : Record
        A log of positions with a torque, a current or the controller's reference; its channels as :func:`read_record`
        names them, or ``theta``, ``reference``, ``force`` and ``current``.
    inertia, kp, kd, torque_constant : float, str, tuple or Estimate, optional
        What is known of the joint, as "0.021 ± 0.001 kg m^2", "17.8 N m/rad", "0.6 N m s/rad", "0.87 N m/A".
    gravity : bool, optional
        Whether gravity may act on it; of an angle yes, unless said.
    axis : str, optional
        Which axis, where the log has several: what tells it in the columns' names.

    Returns
    -------
    Findings
        Its results: ``joint``, ``breakaway``, ``backlash`` and ``sticks``.

    Raises
    ------
    RecordError
        No position, no torque, or several axes.
    ModelError
        A constant without meaning.
    EstimateError
        The log does not tell any friction: the sentence says which motion would.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(6000) / 200
    >>> q = 1.2 * np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t)
    >>> v, a = np.gradient(q, 1 / 200), np.gradient(np.gradient(q, 1 / 200), 1 / 200)
    >>> torque = 0.02 * a + 0.03 * v + 0.06 * np.sign(v) + np.random.default_rng(0).normal(0, 0.01, t.size)
    >>> log = Record.of({"position": q, "effort": torque}, fs=200, units={"position": "rad", "effort": "N m"})
    >>> analyze_joint(log, gravity=False).joint.level.includes(0.06)
    True
    """
    require_record(record)
    given = {"inertia": inertia, "kp": kp, "kd": kd, "torque_constant": torque_constant}
    faults, name, inquiry = tuple(record.check()), record_name(record), Inquiry()
    log = axis_record(record, axis=axis)
    log = without_delays(log, question="the friction of a joint")
    joint = regress_joint(log, gravity=gravity, **given)
    whole = _with_friction(log, joint)
    breakaway = inquiry.ask("Breakaway", partial(joint_breakaway, whole, joint=joint), aside=True)
    play = partial(joint_backlash, whole, joint=joint)
    backlash = inquiry.ask("Backlash", play, aside=True) if "motor" in whole else None
    sticks = inquiry.ask("Sticks and slips", partial(find_sticks, whole, method="speed"), aside=True)
    results = {"joint": joint, "breakaway": breakaway, "backlash": backlash}
    results["sticks"] = with_doubt(sticks, TURNS)
    assumed = {
        key: channel.unit
        for key, channel in log.channels.items()
        if channel.assumed and key not in ("motor", "temperature")
    }
    unstated = [f"{key} is read as {unit}" for key, unit in assumed.items()]
    if unstated:
        doubt = f"nobody stated a unit: {' and '.join(unstated)}"
        results = {key: flagged(result, doubt) for key, result in results.items()}
    return Findings(name, whole, faults, notes=tuple(inquiry.notes), settings=_settings(joint, given), results=results)


def joint_law(joint: JointFriction) -> LinearSlope | Stribeck:
    """The law of a joint under the mean load of its log, alike both ways: what simulators take.

    Parameters
    ----------
    joint : JointFriction
        Of :func:`~stickslip.cycle.regress_joint`.

    Returns
    -------
    LinearSlope or Stribeck
        Stribeck's curve where friction falls with the speed; numbers in N m and rad/s of a joint that turns.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(6000) / 200
    >>> q = 1.2 * np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t)
    >>> v, a = np.gradient(q, 1 / 200), np.gradient(np.gradient(q, 1 / 200), 1 / 200)
    >>> friction = (0.06 + 0.04 * np.exp(-((v / 0.5) ** 2))) * np.sign(v) + 0.03 * v
    >>> torque = 0.02 * a + friction + np.random.default_rng(0).normal(0, 0.01, t.size)
    >>> log = Record.of({"theta": q, "force": torque}, fs=200, units={"force": "N m"})
    >>> joint_law(regress_joint(log, gravity=False)).exponent
    2.0
    """
    slope = max(joint.viscous.value, 0.0)
    if joint.static is None or joint.stribeck_speed is None or joint.exponent is None:
        return LinearSlope(joint.level.value, slope=slope)
    static, speed = max(joint.static.value, joint.level.value), joint.stribeck_speed.value
    return Stribeck(joint.level.value, static, speed=speed, exponent=joint.exponent, viscous=slope)


def compare_joints(
    findings: Sequence[Findings], *, gravity: bool | None = None, **constants: Constant | None
) -> Comparison:
    """Several logs of one joint: what they tell together, and how much of each the others predict.

    Parameters
    ----------
    findings : sequence of Findings
        Two or more, of :func:`analyze_joint`.
    gravity : bool, optional
        As there.
    **constants : float, str, tuple or Estimate
        `inertia`, `kp`, `kd` and `torque_constant`, as there.

    Returns
    -------
    Comparison
        Its results: ``together``, a :class:`~stickslip.cycle.JointLogs`, and each of its numbers by name.

    Raises
    ------
    EstimateError
        Fewer than two logs, or what they can not tell together.
    RecordError
        Logs whose torques have different sources.

    Examples
    --------
    >>> def moved(seed, speed):
    ...     t = np.arange(4000) / 200
    ...     q = np.sin(2 * np.pi * speed * t) + 0.4 * np.sin(2 * np.pi * 3.1 * speed * t)
    ...     v, a = np.gradient(q, 1 / 200), np.gradient(np.gradient(q, 1 / 200), 1 / 200)
    ...     torque = 0.02 * a + 0.03 * v + 0.06 * np.sign(v) + np.random.default_rng(seed).normal(0, 0.01, t.size)
    ...     return Record.of({"theta": q, "force": torque}, fs=200, units={"force": "N m"})
    >>> joints = [analyze_joint(moved(seed, speed), gravity=False) for seed, speed in enumerate((0.2, 0.3))]
    >>> compare_joints(joints, gravity=False).forward.includes(0.06)
    True
    """
    require_several(findings)
    together = regress_joint_logs([one.record for one in findings], gravity=gravity, **constants)
    numbers = {name: value for name, value in vars(together).items() if isinstance(value, Estimate)}
    return Comparison(tuple(findings), results={**numbers, "together": together})


def episodes(record: Record) -> Iterator[Record]:
    """The episodes of a data set that holds several in one file, as LeRobot's do.

    Parameters
    ----------
    record : Record
        With a channel ``episode_index``, where it has several.

    Returns
    -------
    iterator of Record
        Each episode on its own clock; the record itself where it has no such channel.

    Examples
    --------
    >>> both = Record.of({"q": [0.0, 0.1, 0.2, 0.3], "episode_index": [7, 7, 8, 8]}, fs=30.0)
    >>> [len(episode) for episode in episodes(both)]
    [2, 2]
    """
    if "episode_index" not in record:
        yield record
        return
    index = record["episode_index"]
    ends = [0, *(np.flatnonzero(np.diff(index) != 0) + 1), len(record)]
    for first, last in itertools.pairwise(ends):
        part = record.rows(int(first), int(last))
        if part.stamps is not None:
            clock = fit_clock(part.stamps)
            part = replace(part, fs=clock.fs, start=clock.start, stamps=clock.stamps)
        step = Step("episodes", {"episode_index": int(index[first])}, f"episode {index[first]:g}")
        yield replace(part, history=(*part.history, step))


def _settings(joint: JointFriction, given: Mapping[str, Any]) -> dict[str, Any]:
    stated = {name: str(value) for name, value in given.items() if value is not None}
    return {
        **stated,
        "torque": {"reference": "of the controller", "current": "of the current"}.get(joint.source, "measured"),
    }


def _with_friction(record: Record, joint: JointFriction) -> Record:
    """The record with the torque that is neither inertia nor gravity; at rest that which the joint bears."""
    position = record["theta" if "theta" in record else "x"]
    inertial = joint.inertia.value * differentiate(position, record.fs, order=2).values
    friction, unit = joint.torque - joint.weight(position) - inertial, joint.level.unit
    step = Step("analyze_joint", {}, "torque less inertia and gravity")
    return record.with_channel("friction", friction, unit=unit, source="analyze_joint", step=step)


# ---- one axis of a log of several


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
        require_angle(record)
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
    chosen = [one for one in axes if axis is None or _fits(one, axis)]
    if len(chosen) != 1:
        names = ", ".join(one or "(unnamed)" for one in axes)
        raise RecordError(
            f"the log has the axes {names}" if axis is None else f"axis = {axis!r} fits {len(chosen)} of {names}",
            "the friction of one axis is asked for at a time",
            nearest(axis or "", axes) if axis else f"name one: --axis {axes[0]}",
            kind="" if axis is None else ABSENT,
        )
    log = _renamed(record, [column for column in columns if column.axis == chosen[0]], chosen[0])
    require_angle(log)
    return _unwrapped(log)


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


def _fits(name: str, axis: str) -> bool:
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


def analyze_tribometer(
    record: Record,
    *,
    normal: Constant | None = None,
    frequency: float | str | None = None,
    rig: RigSettings | None = None,
) -> Findings:
    """Ask a tribometer's record for its coefficient of friction by every definition in use.

    Parameters
    ----------
    record : Record
        Strokes to and fro, as :func:`~stickslip.cycle.friction_coefficients` takes them: ``friction`` [N] with ``x`` or
        ``v``, and ``normal`` [N] where the load was measured. A force called ``load`` or ``force`` is the friction
        where no other is.
    normal, frequency : optional
        The load and the strokes' frequency, as there.
    rig : RigSettings, optional
        States the load of a record of this name, where nothing else does.

    Returns
    -------
    Findings
        Its results: ``tribometer``, ``wear_in`` where it is told, and ``static``, the coefficient at breakaway as
        :func:`~stickslip.cycle.static_coefficient` tells it (that of every stroke: ``peaks``), or a note of why not.

    Raises
    ------
    RecordError, ModelError, EstimateError
        As of :func:`~stickslip.cycle.friction_coefficients`.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(40000) / 1000
    >>> v = 2e-3 * np.pi * 2 * np.cos(2 * np.pi * 2 * t)
    >>> friction = 3.0 * np.sign(v) + np.random.default_rng(0).normal(0, 0.02, t.size)
    >>> test = Record.of({"x": 2e-3 * np.sin(2 * np.pi * 2 * t), "friction": friction}, fs=1000)
    >>> analyze_tribometer(test, normal="10 N").tribometer.by_energy.includes(0.3)
    True
    """
    require_record(record)
    faults, inquiry = tuple(record.check()), Inquiry()
    if "friction" not in record and (felt := next((name for name in ("load", "force") if name in record), None)):
        step = Step("analyze_tribometer", {"friction": felt}, f"the friction is the {felt}")
        record = record.with_channel("friction", record[felt], unit="N", source=felt, step=step)
    if normal is None and rig is not None and "normal" not in record:
        normal = rig.normal_load(record_name(record))
    coefficients = friction_coefficients(record, normal=normal, frequency=frequency)
    ask = partial(static_coefficient, record, coefficients=coefficients)
    peaks = inquiry.ask("The static coefficient", ask, aside=True)
    static = None if peaks is None else peaks.static
    results = {"tribometer": coefficients, "static": static, "wear_in": coefficients.wear_in, "peaks": peaks}
    load = "measured" if coefficients.measured else f"{coefficients.load.value:.4g} N, stated"
    return Findings(
        record_name(record), record, faults, notes=tuple(inquiry.notes), settings={"normal load": load}, results=results
    )


def compare_tribometers(findings: Sequence[Findings]) -> Comparison:
    """The coefficients of several tests, and their mean over the tests by every definition.

    Parameters
    ----------
    findings : sequence of Findings
        Two or more, of :func:`analyze_tribometer`.

    Returns
    -------
    Comparison
        Its results: ``plateau``, ``by_stroke``, ``by_cycle`` and ``by_energy``, each the mean over the tests, its
        interval Student's t on the scatter between them, which is in no test's own interval.

    Raises
    ------
    EstimateError
        Fewer than two tests.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(20000) / 1000
    >>> x, v = 2e-3 * np.sin(4 * np.pi * t), np.cos(4 * np.pi * t)
    >>> tests = [Record.of({"x": x, "friction": force * np.sign(v)}, fs=1000) for force in (2.9, 3.0, 3.1)]
    >>> compare_tribometers([analyze_tribometer(test, normal=10.0) for test in tests]).plateau.includes(0.3)
    True
    """
    require_several(findings)
    results = {}
    for name in DEFINITIONS:
        coefficients = [getattr(one.tribometer, name) for one in findings]
        values = [one.value for one in coefficients]
        results[name] = mean_of_cycles(coefficients[0].name, values, unit="1", method="mean over the tests", of="test")
    return Comparison(tuple(findings), results=results)
