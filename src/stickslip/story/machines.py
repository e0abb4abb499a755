"""Friction of machines: a joint's from its own log, and a tribometer's coefficients."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.answers.arm import Joint
from stickslip.answers.findings import Comparison, Findings
from stickslip.answers.machines import joint_law
from stickslip.cycle.joint import LAWS, JointFriction
from stickslip.cycle.joint_fall import ALONG
from stickslip.cycle.joint_fit import SURELY, is_late
from stickslip.cycle.joint_logs import JointLogs
from stickslip.cycle.tribometer import DEFINITIONS
from stickslip.errors import ModelError
from stickslip.estimate import Estimate, doubts_of, stands
from stickslip.figures.contact import plates_of, plates_together, tribometer_plates
from stickslip.laws.c_code import compiler
from stickslip.laws.coulomb import LinearSlope
from stickslip.laws.export import export_fmu, export_law, urdf_dynamics
from stickslip.settings import toml_lines
from stickslip.story.fit import ALONE, FILES
from stickslip.story.story import Caution, Story, Table, cautions, interval_of, number, value_of
from stickslip.units import parse_unit

APART = 0.05  # of a level, by which directions or definitions must differ to be worth a sentence
RARELY = 0.005  # of the time
BY_GRAVITY = "gravity's torque"
SIMPLEST = {
    "M1": "Coulomb and viscous friction",
    "M2": "Coulomb and viscous friction, and a fall with the speed",
    "M3": "Coulomb and viscous friction, and growth with the load",
    "M4": "Coulomb and viscous friction, a fall with the speed and growth with the load",
}
TRIED = "# all of the joint: what stickslip predict moves along another log"


def of_tribometer(findings: Findings) -> Story:
    """One test."""
    tribometer = findings.tribometer
    return Story(
        findings.name,
        list(_of_one_test(findings)),
        cautions(findings),
        settings={key: str(value) for key, value in findings.settings.items()},
        tables=[_definitions(findings)],
        draw=lambda: tribometer_plates(tribometer),
        data=lambda: _test_data(findings),
    )


def of_tribometers(comparison: Comparison) -> Story:
    """Several tests."""
    tests = [(one.name, one.tribometer) for one in comparison.findings]
    rows = [(name, *(value_of(getattr(test, kind)) for kind in DEFINITIONS)) for name, test in tests]
    table = Table("Tests", ("test", *(name.replace("_", " ") for name in DEFINITIONS)), rows)
    mean: Estimate = comparison.plateau
    sentence = f"Over {len(rows)} tests the coefficient of friction is {value_of(mean)} (95 %: {interval_of(mean)})."
    return Story(f"{len(rows)} tests", [sentence], tables=[table])


def _of_one_test(findings: Findings) -> Iterator[str]:
    tribometer, plateau = findings.tribometer, findings.tribometer.plateau
    if plateau.known:
        doubt = "" if stands(plateau.status) else f", which is not to be trusted ({plateau.status})"
        yield (
            f"The kinetic coefficient of friction is {value_of(plateau)} by the plateau "
            f"(95 %: {interval_of(plateau)}) under {value_of(tribometer.load)}{doubt}."
        )
    else:
        yield f"No kinetic coefficient of friction is told: {plateau.status}."
    first, last = tribometer.first, tribometer.last
    if first is not None and last is not None:
        way = "rises" if last.value > first.value else "falls"
        yield f"It {way} along the test, from {value_of(first)} in its first cycles to {value_of(last)} in its last."
    others = [getattr(tribometer, name) for name in DEFINITIONS if name != "plateau"]
    if any(abs(one.value - plateau.value) > APART * plateau.value for one in others if one.known):
        rest = ", ".join(f"{value_of(one)} {one.name.rpartition(', ')[2]}" for one in others if one.known)
        yield f"By other definitions it is {rest}: say which when you quote it."
    static = findings.static
    if static is not None and plateau.known and static.interval[0] <= plateau.interval[1]:
        most = value_of(static, static.interval[1])
        yield f"No static coefficient above the kinetic one is told: it would be at most {most} (95 %)."
    elif static is not None:
        yield f"The static coefficient is {value_of(static)} (95 %: {interval_of(static)})."
    wear = tribometer.wear_in
    if wear is not None:
        change, way = wear.change, "above" if wear.change.value > 0 else "below"
        yield (
            f"It wears in over {value_of(wear.cycles)} cycles (95 %: {interval_of(wear.cycles)}), "
            f"from {value_of(change.scaled(1 if change.value > 0 else -1, '1'))} {way} where it settles."
        )


def _definitions(findings: Findings) -> Table:
    """The coefficient by every definition, side by side."""
    definitions = [(getattr(findings.tribometer, name), words) for name, words in DEFINITIONS.items()]
    if findings.static is not None:
        definitions.append((findings.static, "what the contact bears before it slips"))
    rows = [(one.name.rpartition(", ")[2], value_of(one), interval_of(one), words) for one, words in definitions]
    return Table("The coefficient by the definitions in use", ("definition", "value", "95 %", "of each cycle"), rows)


def _test_data(findings: Findings) -> dict[str, Any]:
    tribometer, peaks = findings.tribometer, findings.peaks
    static = {} if peaks is None else {"static_of_strokes": peaks.of_strokes, "stroke_time": peaks.time}
    return {
        **static,
        "load_measured": tribometer.measured, "of_cycles": dict(tribometer.of_cycles), "cycle_time": tribometer.time,
        "map": {name: getattr(tribometer, name) for name in ("position", "cycle", "forward", "back")},
    }  # fmt: skip


def of_joint(findings: Findings) -> Story:
    """One log."""
    joint = findings.joint
    return Story(
        findings.name,
        list(_of_one_joint(findings)),
        [*cautions(findings), *map(Caution, _untold(joint))],
        settings={key: str(value) for key, value in findings.settings.items()},
        draw=lambda: plates_of(joint),
        data=lambda: _joint_data(findings),
        write=partial(write_joint, findings=findings),
    )


def of_joints(comparison: Comparison) -> Story:
    """Several logs of one joint."""
    logs = list(zip(comparison.findings, comparison.together.predictions, strict=True))
    data = [{"name": log.name, "error": one.error, "plain": one.plain} for log, one in logs]
    return Story(
        f"{len(logs)} logs of a joint",
        list(_together(comparison)),
        list(map(Caution, _untold(comparison.together, "These logs do"))),
        tables=[_payloads(comparison) if comparison.unlike else _predicted(comparison)],
        draw=lambda: [] if comparison.unlike else plates_together(logs),
        data=lambda: {"predictions": data},
    )


def _payloads(comparison: Comparison) -> Table:
    """What logs of unlike payloads tell, each by itself."""
    joints = [(log.name, log.joint) for log in comparison.findings]
    rows = [
        (name, *("" if one is None else f"{value_of(one)} ({interval_of(one)})" for one in _carried(joint)))
        for name, joint in joints
    ]
    return Table(
        "Each log by itself", ("log", "sliding friction", "inertia", "gravity, sine part", "cosine part"), rows
    )


def _carried(joint: JointFriction) -> tuple[Estimate | None, ...]:
    return joint.level, joint.inertia, joint.sine, joint.cosine


def _predicted(comparison: Comparison) -> Table:
    """How far each log is predicted by the others."""
    rows = [
        (
            log.name,
            value_of(log.joint.level),
            interval_of(log.joint.level),
            f"{100 * one.error:.2f} %",
            f"{100 * one.plain:.2f} %",
        )
        for log, one in zip(comparison.findings, comparison.together.predictions, strict=True)
    ]
    return Table(
        "Each log by the others",
        ("log", "sliding friction", "95 %", "missed", "by a plain law"),
        rows,
        "Missed: what the others do not predict of the torque while it slides, over how far the torque varies (norms). "
        "The plain law is Coulomb and viscous friction, alike both ways, beside inertia and gravity.",
    )


def _together(comparison: Comparison) -> Iterator[str]:
    if comparison.unlike:
        yield (
            f"The logs' {' and '.join(comparison.unlike)} differ by more than their intervals allow, as of several "
            "payloads: each keeps its own, and the friction is the mean of what each tells."
        )
    together, logs = comparison.together, comparison.together.predictions
    parts = [f"{value_of(together.forward)} forward and {value_of(together.back)} back"]
    parts.append(f"{value_of(together.viscous)} of viscous friction")
    if together.load is not None and together.load.known and together.load.interval[0] > 0:
        parts.append(f"{value_of(together.load)} of {BY_GRAVITY}")
    yield f"Together the logs tell Coulomb friction of {', '.join(parts)}."
    yield from _laws([log.joint for log in comparison.findings])
    if comparison.unlike:
        return
    missed, plain = (sorted(getattr(one, name) for one in logs) for name in ("error", "plain"))
    yield (
        f"The torque of each log is predicted by the others but for {_share(missed[0])} to {_share(missed[-1])} % "
        "of how far it varies; by Coulomb and viscous friction alone but for "
        f"{_share(plain[0])} to {_share(plain[-1])} %."
    )


def _share(part: float) -> str:
    return f"{float(f'{100 * part:.2g}'):g}"


def _of_one_joint(findings: Findings) -> Iterator[str]:
    joint = findings.joint
    level, unit = joint.level, joint.level.unit
    said = {doubt.words for doubt in doubts_of(level.status)}
    doubt = f", which is not to be trusted ({level.status})" if not stands(level.status) else _in_doubt(level, set())
    under = f" under a mean load of {number(joint.carried, joint.carried / 100, unit)}" if joint.carried else ""
    if level.interval[0] > 0 or joint.static is not None:
        yield f"The joint slides against {value_of(level)} of friction{under} (95 %: {interval_of(level)}){doubt}."
        yield from _directions(joint)
        yield from _fall(joint, said)
    else:
        yield f"No dry friction{under} is felt{doubt}; more than {value_of(level, level.interval[1])} would be (95 %)."
    parts = [f"{value_of(joint.viscous)} of viscous friction{_in_doubt(joint.viscous, said)}"]
    if joint.load is not None and joint.load.known:
        most = f"less than {value_of(joint.load, joint.load.interval[1])}"
        some = f"{value_of(joint.load)}{_in_doubt(joint.load, said)}" if joint.load.interval[0] > 0 else most
        parts.append(f"{some} of {'the mean torque of motor and gravity' if joint.by_teeth else BY_GRAVITY}")
    fastest = float(np.abs(joint.speed).max())
    rate = f"{fastest:.3g} rad/s" if unit == "N m" else f"{fastest:.3g} m/s"
    yield f"To that come {' and '.join(parts)}; it was moved at up to {rate}."
    yield from _laws([joint])
    yield from _warmth(findings)
    sources = {"reference": "its controller's gains make", "current": "its current makes"}
    torque = "the torque that" if unit == "N m" else "the force that"
    source = sources.get(joint.source, "was measured")
    yield (
        f"With an inertia of {value_of(joint.inertia)}{_in_doubt(joint.inertia, said)} that explains {torque} {source};"
        f" {100 * joint.residual:.2g} % of it is left unexplained while it slides."
    )
    if joint.delay is not None and is_late(joint.delay):
        delay, way = joint.delay, "later" if joint.delay.value > 0 else "earlier"
        moved = number(abs(delay.value), delay.sd, "s")
        known = "error that it is made of" if joint.source == "reference" else "position"
        yield f"It comes {moved} {way} than the {known} (95 %: {interval_of(delay)}), which is taken out."
    if joint.cogging is not None:
        often, angle = (2 * np.pi * joint.waves[0], "turn") if unit == "N m" else (joint.waves[0], "metre")
        yield f"A torque of {value_of(joint.cogging)} goes up and down {often:.4g} times a {angle}, as teeth make it."
    if findings.breakaway is not None:
        ratio = findings.breakaway.ratio
        yield f"It breaks away at {value_of(ratio)} times its sliding friction (95 %: {interval_of(ratio)})."
    if findings.backlash is not None:
        backlash, felt = findings.backlash.backlash, findings.backlash.felt
        least = number(felt, felt / 10, backlash.unit)
        yield (
            f"Between motor and link there are {value_of(backlash)} of play (95 %: {interval_of(backlash)})."
            if findings.backlash.claimed
            else f"No play between motor and link is felt; {least} would be."
        )
    if findings.sticks is not None and findings.sticks.share.value > RARELY and stands(findings.sticks.share.status):
        yield f"It stands still up to {value_of(findings.sticks.share)} of the time."


def _laws(joints: Sequence[JointFriction]) -> Iterator[str]:
    """Which of the laws M1 to M6 all logs leave, where they carry a load, and no doubt is of what would deny one."""
    if any(joint.load is None or not (stands(joint.load.status) and stands(joint.level.status)) for joint in joints):
        return
    left = [law for law in LAWS if all(law in joint.laws for joint in joints)]
    *others, last = [law for law in LAWS if law not in left] or [""]
    simplest = f"{left[0]} is the simplest of the others: {SIMPLEST[left[0]]}"
    if not last:
        yield f"None of the friction laws M1 to M6 of servos is denied; {SIMPLEST[left[0]]} (M1) will do."
    elif others:
        yield f"Of the friction laws M1 to M6 of servos {', '.join(others)} and {last} are denied; {simplest}."
    else:
        yield f"Of the friction laws M1 to M6 of servos {last} is denied; {simplest}."


def _in_doubt(estimate: Estimate, said: set[str]) -> str:
    """What its row doubts of a number, behind it; what a sentence before has said, in short."""
    doubts = doubts_of(estimate.status)
    fresh = [doubt.words for doubt in doubts if doubt.words not in said]
    said.update(fresh)
    if fresh:
        return f" (in doubt: {'; '.join(fresh)})"
    return "" if stands(estimate.status) else " (in doubt as well)"


def _warmth(findings: Findings) -> Iterator[str]:
    """What the temperature makes of the friction: claimed where chance would hardly make as much."""
    joint = findings.joint
    if joint.temperature is None:
        return
    if not findings.record.channels["temperature"].assumed:
        mean = joint.temperature - parse_unit("degC", expect="K").zero
        yield f"All of this is told at {mean:.3g} °C, the mean of the log."
    for change, what in ((joint.warming, "Coulomb friction"), (joint.thinning, "viscous friction")):
        spread = f"(95 %: {interval_of(change)})"
        if abs(change.value) > SURELY * change.sd:
            yield f"With the temperature its {what} changes by {value_of(change)} {spread}."
        else:
            yield f"No change of its {what} with the temperature is told {spread}."


def _directions(joint: JointFriction) -> Iterator[str]:
    forward, back = joint.forward, joint.back
    if not (forward.known and back.known):
        return
    apart = abs(forward.value - back.value)
    if apart > APART * joint.level.value and apart > 2 * (forward.sd + back.sd):
        yield f"The two directions differ: {value_of(forward)} forward and {value_of(back)} back without load."


def _fall(joint: JointFriction, said: set[str]) -> Iterator[str]:
    """How its friction falls with the speed, or from which speed on none does."""
    if joint.static is not None and joint.stribeck_speed is not None:
        static, speed = joint.static, joint.stribeck_speed
        moved = np.linspace(np.abs(joint.speed).min(), np.abs(joint.speed).max(), ALONG)
        excess = (static.value - joint.level.value) * np.exp(-((moved / speed.value) ** (joint.exponent or 1.0)))
        falls = np.any(np.diff(joint.viscous.value * moved + excess) < 0)
        what = "friction" if falls else "friction but the viscous part"
        yield (
            f"Its {what} falls with the speed: at rest it is {value_of(static)} (95 %: {interval_of(static)})"
            f"{_in_doubt(static, said)}, and falls within {value_of(speed)} (95 %: {interval_of(speed)}), the Stribeck "
            "speed."
        )
        return
    slowest = float(np.abs(joint.speed).min())
    unit = "rad/s" if joint.level.unit == "N m" else "m/s"
    yield f"No fall of it with the speed is felt from {number(slowest, slowest / 10, unit)} on, where the log slides."


def _untold(joint: JointFriction | JointLogs, who: str = "This log does") -> Iterator[str]:
    for words in joint.left_out:
        yield f"{who} not tell {words}."


def _joint_data(findings: Findings) -> dict[str, Any]:
    joint, backlash = findings.joint, findings.backlash
    play = {} if backlash is None else {"backlash_felt": backlash.felt, "gear_ratio": backlash.ratio}
    return {
        **play,
        "residual": joint.residual, "condition": joint.condition, "carried": joint.carried, "source": joint.source,
        "left_out": list(joint.left_out),
    }  # fmt: skip


def write_joint(folder: Path, *, findings: Findings) -> None:
    """Its friction under the mean load in every form that another program reads, into the folder joint.

    With the law in TOML stands all of the joint, as a prediction moves it.
    """
    joint = findings.joint
    if not (joint.level.known and joint.viscous.known):
        return
    (folder / "joint").mkdir()
    turning = joint.level.unit == "N m"
    law, line = joint_law(joint), LinearSlope(joint.level.value, slope=max(joint.viscous.value, 0.0))
    rises = f"<!-- its friction rises to {law.breakaway:.4g} {joint.level.unit} at rest, not here -->\n"
    lost = "" if law == line else rises
    (folder / "joint" / "dynamics.urdf").write_text(f"{lost}{urdf_dynamics(line)}\n", encoding="utf-8")
    moves = joint.inertia.known and joint.inertia.value > 0
    whole = vars(Joint.of(joint, findings.settings.get("axis", ""))) if moves else {}
    lines = [] if not moves or "bodies" in findings.record else [TRIED, *toml_lines({"joint": whole})]
    for form, file in FILES.items():
        try:
            if form == "mujoco":  # whose joints take a line alone, as URDF's
                text = lost + export_law(line, format=form, turning=turning)
            else:
                text = export_law(law, format=form, turning=turning)
        except ModelError:  # it has no such form
            continue
        if form == "toml":
            text = "\n".join([ALONE, text, *lines])
        (folder / "joint" / file).write_text(text.rstrip("\n") + "\n", encoding="utf-8")
    if moves:
        place, alone = folder / "joint" / "joint.fmu", compiler() is None
        export_fmu(law, place, mass=joint.inertia.value, turning=turning, sources_only=alone)
