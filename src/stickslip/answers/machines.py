"""Friction of machines: a joint or an axis from its own log, and a tribometer's coefficient by its definitions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from stickslip.answers.arm import axis_record
from stickslip.answers.findings import Comparison, Findings, Inquiry, flagged, record_name, require_several, with_doubt
from stickslip.answers.mistakes import require_torque
from stickslip.cycle.joint import JointFriction, regress_joint
from stickslip.cycle.joint_fit import SURELY
from stickslip.cycle.joint_logs import JointLogs, joint_backlash, joint_breakaway, regress_joint_logs
from stickslip.cycle.static_peak import static_coefficient
from stickslip.cycle.sticks import find_sticks
from stickslip.cycle.tribometer import DEFINITIONS, friction_coefficients
from stickslip.estimate import UNTRIED, Constant, Doubt, Estimate, stands
from stickslip.laws.coulomb import LinearSlope
from stickslip.laws.stribeck import Stribeck
from stickslip.record.clock import fit_clock
from stickslip.record.record import Record, Step, require_record
from stickslip.rig.settings import RigSettings
from stickslip.signals.derivatives import differentiate
from stickslip.signals.interpolate import without_delays
from stickslip.statistics import mean_of_cycles, weighted_mean

PAYLOAD = {"inertia": "inertia", "sine": "gravity", "cosine": "gravity"}  # what goes with what a joint carries
SHARED = ("forward", "back", "viscous", "load", "damping", "warming", "thinning", "delay")
# A joint has no twins: swept through its turns without a rest it was told to stand still 1.0 to 2.3 % of the time.
TURNS = Doubt("a joint that never rests may seem to stand still as well where it turns", UNTRIED)


def analyze_joint(
    record: Record,
    *,
    inertia: Constant | None = None,
    kp: Constant | None = None,
    kd: Constant | None = None,
    torque_constant: Constant | None = None,
    gravity: bool | None = None,
    play: Constant | None = None,
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
        names them, or ``theta``, ``reference``, ``force`` and ``current``; a joint of an arm from
        :func:`~stickslip.answers.without_bodies`.
    inertia, kp, kd, torque_constant : float, str, tuple or Estimate, optional
        What is known of the joint, as "0.021 ± 0.001 kg m^2", "17.8 N m/rad", "0.6 N m s/rad", "0.87 N m/A".
    gravity : bool, optional
        Whether gravity may act on it; of an angle yes, unless said.
    play : float, str, tuple or Estimate, optional
        Of the teeth between motor and link [rad], where the motor alone has an encoder.
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
    given = {"inertia": inertia, "kp": kp, "kd": kd, "torque_constant": torque_constant, "play": play}
    faults, name, inquiry = tuple(record.check()), record_name(record), Inquiry()
    log = axis_record(record, axis=axis)
    require_torque(log, gravity, given)
    log = without_delays(log, question="the friction of a joint")
    joint = regress_joint(log, gravity=gravity, **given)
    whole = _with_friction(log, joint)
    breakaway = inquiry.ask("Breakaway", partial(joint_breakaway, whole, joint=joint), aside=True)
    apart = partial(joint_backlash, whole, joint=joint)
    backlash = inquiry.ask("Backlash", apart, aside=True) if "motor" in whole else None
    sticks = inquiry.ask("Sticks and slips", partial(find_sticks, whole, method="speed", creeps=False), aside=True)
    results = {"joint": joint, "breakaway": breakaway, "backlash": backlash}
    if sticks is not None and not stands(sticks.frequency.status):
        sticks = replace(sticks, per_cycle=sticks.per_cycle.unknown("the motion has no period"))
    results["sticks"] = with_doubt(sticks, TURNS)
    assumed = {key: channel.unit for key, channel in log.channels.items() if channel.assumed}
    unstated = [f"{key} is read as {unit}" for key, unit in assumed.items() if key not in ("motor", "temperature")]
    if unstated:
        doubt = f"nobody stated a unit: {' and '.join(unstated)}"
        results = {key: flagged(result, doubt) for key, result in results.items()}
    return Findings(
        name,
        whole,
        faults,
        notes=tuple(inquiry.notes),
        settings=_settings(joint, {**given, "axis": axis}),
        results=results,
    )


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
        `inertia`, `kp`, `kd`, `torque_constant` and `play`, as there.

    Returns
    -------
    Comparison
        Its results: ``together``, a :class:`~stickslip.cycle.JointLogs`, and each of its numbers by name; ``unlike``,
        which of inertia and gravity differ surely, as of several payloads: the friction is then the mean of what each
        log tells, and inertia and gravity are each log's own.

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
    unlike = _unlike_payloads([one.joint for one in findings])
    if unlike:
        together = _payloads_apart(together, [one.joint for one in findings])
    numbers = {name: value for name, value in vars(together).items() if isinstance(value, Estimate)}
    return Comparison(tuple(findings), results={**numbers, "together": together, "unlike": unlike})


def _unlike_payloads(joints: Sequence[JointFriction]) -> tuple[str, ...]:
    """Of inertia and gravity, what logs tell surely otherwise than others do, each by itself."""
    unlike = []
    for name, what in PAYLOAD.items():
        told = [estimate for estimate in (getattr(joint, name) for joint in joints) if estimate is not None]
        pairs = itertools.combinations(told, 2)
        if any(abs(one.value - other.value) > SURELY * math.hypot(one.sd, other.sd) for one, other in pairs):
            unlike.append(what)
    return tuple(dict.fromkeys(unlike))


def _payloads_apart(together: JointLogs, joints: Sequence[JointFriction]) -> JointLogs:
    """The friction that logs of unlike payloads share: the mean of what each tells, its doubtful ones left out."""
    shared: dict[str, Any] = dict.fromkeys(PAYLOAD)
    for name in SHARED:
        told = [estimate for estimate in (getattr(joint, name) for joint in joints) if estimate is not None]
        sure = [estimate for estimate in told if stands(estimate.status)]
        status = "ok" if sure or not told else told[0].status
        shared[name] = weighted_mean(sure or told, of="logs", status=status) if told else None
    return replace(together, **shared, left_out=())


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
    sources = {"reference": "of the controller", "current": "of the current"}
    return {**stated, "torque": sources.get(joint.source, "measured")}


def _with_friction(record: Record, joint: JointFriction) -> Record:
    """The record with the torque that is neither inertia nor gravity; at rest that which the joint bears."""
    position = record["theta" if "theta" in record else "x"]
    inertial = joint.inertia.value * differentiate(position, record.fs, order=2).values
    bodies = record.samples.get("bodies", 0.0)
    friction, unit = joint.torque - bodies - joint.weight(position) - joint.cogs(position) - inertial, joint.level.unit
    step = Step("analyze_joint", {}, "torque less inertia and gravity")
    return record.with_channel("friction", friction, unit=unit, source="analyze_joint", step=step)


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
