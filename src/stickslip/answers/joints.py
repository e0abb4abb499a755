"""Everything that is asked of one joint's log, together: friction and gravity, breakaway, stops."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from stickslip.answers.axes import axis_record
from stickslip.answers.findings import Comparison, Findings, Inquiry, flagged, record_name, require_several, with_doubt
from stickslip.cycle.joint import JointFriction, regress_joint
from stickslip.cycle.joint_logs import regress_joint_logs
from stickslip.cycle.joint_onset import joint_breakaway
from stickslip.cycle.sticks import find_sticks
from stickslip.estimate import UNTRIED, Constant, Doubt, Estimate
from stickslip.record.clock import fit_clock
from stickslip.record.record import Record, Step, require_record
from stickslip.signals.derivatives import differentiate
from stickslip.signals.interpolate import without_delays

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
    axis: str | None = None,
) -> Findings:
    """Ask a joint's log every question about its friction that its columns allow.

    In this order: which columns are the axis's; friction either way, its viscous part, what of it grows with the load,
    inertia and gravity (:func:`~stickslip.cycle.regress_joint`); the friction at breakaway over the sliding one, where
    the log tells it to 5 %; stops. A question that can not be answered becomes a note.

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
        Its results: ``joint``, ``breakaway`` and ``sticks``.

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
    sticks = inquiry.ask("Sticks and slips", partial(find_sticks, whole, method="speed"), aside=True)
    results = {"joint": joint, "breakaway": breakaway, "sticks": with_doubt(sticks, TURNS)}
    unstated = [f"{key} is read as {channel.unit}" for key, channel in log.channels.items() if channel.assumed]
    if unstated:
        doubt = f"nobody stated a unit: {' and '.join(unstated)}"
        results = {key: flagged(result, doubt) for key, result in results.items()}
    return Findings(name, whole, faults, notes=tuple(inquiry.notes), settings=_settings(joint, given), results=results)


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
    >>> found = [analyze_joint(moved(seed, speed), gravity=False) for seed, speed in enumerate((0.2, 0.3))]
    >>> compare_joints(found, gravity=False).forward.includes(0.06)
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
