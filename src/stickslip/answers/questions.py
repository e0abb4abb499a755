"""Which questions are asked of a record, in which order; of one longer than memory, block after block."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, partial
from typing import Any

import numpy as np

from stickslip.answers.findings import BY_FORCE, NOT_TRIED, ONSETS, Findings, Inquiry, flagged, record_name, with_doubt
from stickslip.answers.mistakes import base_unseen, missing, mistakes, slipped, untrue
from stickslip.answers.preparation import AT_ONCE, CONSTANTS, MOTION, described, middle, normal_load, ready, unmoved
from stickslip.balance.balance import Balance, pulled_slider
from stickslip.balance.force import FUSIONS, friction_force
from stickslip.balance.likely_contact import STRAYING
from stickslip.balance.motion import is_measured, lacking, slid_on
from stickslip.consistent.checks import Slip
from stickslip.consistent.contradictions import consistency
from stickslip.contact.cause import lag_or_compliance
from stickslip.contact.contact import contact_damping, contact_stiffness, coupled_frequency, transition_speed
from stickslip.cycle.loops import Loops, friction_loops
from stickslip.cycle.onset import breakaway, presliding
from stickslip.cycle.regression import Regression, regress_friction
from stickslip.cycle.sticks import find_sticks
from stickslip.errors import TOO_SHORT, UNNAMED, EstimateError, ModelError, RecordError, StickslipError
from stickslip.estimate import NORMAL_95, Constant, Doubt, Estimate, Result
from stickslip.record.channels import Channel
from stickslip.record.flaws import constant
from stickslip.record.record import RIG_UNITS, Record, require_record
from stickslip.rig.settings import RigSettings, rig_settings
from stickslip.statistics import student
from stickslip.units import parse_unit

STRETCH = 1 << 14  # samples in which the contact is fitted
NO_BASE = "there is no channel z: the base is taken to be at rest, but something keeps the motion up"
TIMES = ("cycles", "slips")  # arrays of instants, which follow each other from block to block


def analyze(
    record: Record,
    *,
    rig: RigSettings | None = None,
    mass: Constant | None = None,
    stiffness: Constant | None = None,
    damping: Constant | None = None,
    damper: str | None = None,
    contact: str | None = None,
    method: str = "auto",
) -> Findings:
    """Ask a record every question about friction that its channels allow.

    In this order: the check-up; the delay between displacement and acceleration, where none is stated; the friction
    force (as measured, or from the force balance ``f = k z - k x - c v - m a``, compared with the load cell's where
    there is one); the friction loops; sticks and slips; the breakaway, and what the contact does before; the contact's
    stiffness and damping, where all sensors are put together; the regression of an applied force on acceleration,
    velocity and direction; of a force without any motion, how a slider moves that is pulled through a spring. A
    question that can not be answered becomes a note, not an error.

    Parameters
    ----------
    record : Record
        Displacement ``x`` [m] with `mass` and `stiffness`, or a measured ``friction`` or ``load`` [N], or an
        applied ``force`` [N].
    rig : RigSettings, optional
        The rig's constants, as :func:`read_rig` returns them; the arguments below go before it.
    mass, stiffness, damping : float, str, tuple or Estimate, optional
        Oscillating mass [kg], spring [N/m], viscous damping [N s/m]; or text with a unit ("250 g").
    damper, contact : {"ground", "base"}, optional
        What the damper ends on, and what the mass slides on; the ground unless stated.
    method : str
        How the friction is found: one of :func:`friction_force`'s, or "auto": all sensors together where there is an
        accelerometer or a load cell beside x whose mount is stated or shows; else the displacement differentiated by a
        smoother, whose interval holds: a mount's gain that nobody stated is in no interval. The notes say which, and
        why.

    Returns
    -------
    Findings

    Raises
    ------
    EstimateError
        None of the questions could be answered; the sentence says why.
    ModelError
        A constant that has no meaning.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.arange(4000) / 500
    >>> v = np.cos(2 * np.pi * time)
    >>> rng = np.random.default_rng(1)
    >>> friction = 1.5 * np.sign(v) + rng.normal(0, 0.01, time.size)
    >>> record = Record.of({"x": np.sin(2 * np.pi * time) / (2 * np.pi), "friction": friction}, fs=500)
    >>> round(analyze(record).level.value, 2)
    1.5
    """
    require_record(record)
    given = {"mass": mass, "stiffness": stiffness, "damping": damping, "damper": damper, "contact": contact}
    return _findings(record, _settings(rig, {key: value for key, value in given.items() if value is not None}), method)


def stated_wrongly(records: Iterable[Record], *, rig: RigSettings) -> Findings | None:
    """Which record is the first in which one slip of the hand shows, in a column, a unit or a constant?

    Parameters
    ----------
    records : iterable of Record
        As they were read.
    rig : RigSettings
        The rig's constants.

    Returns
    -------
    Findings or None
        Of that record, with its ``slips``, the likeliest first; None where nothing speaks for one.

    Examples
    --------
    >>> import stickslip as ss
    >>> soft = ss.rig.rig_settings({"mass": 2.42, "stiffness": 2.31})
    >>> stated_wrongly([ss.datasets.demo()], rig=soft).slips[0].words
    'the stiffness is in N/mm, not in N/m'
    """
    questions = [question for question in QUESTIONS if question.key in ("loops", "consistency")]
    for record in records:
        try:
            findings = _findings(record, rig, "auto", questions)
        except EstimateError:  # it answers neither: nothing of it can be held against what was stated
            continue
        if findings.results["slips"]:
            return findings
    return None


def _findings(record: Record, rig: RigSettings, method: str, questions: Sequence[Question] | None = None) -> Findings:
    """What the record answers, of all questions or of some."""
    inquiry, name, faults = Inquiry(), record_name(record), tuple(record.check())
    made = ready(record, rig, method, inquiry)
    whole = made.record
    slid = slid_on(whole, rig.contact if "contact" in rig.model_fields_set else None)
    answers: dict[str, Any] = {}
    fused = cache(partial(_fused, whole))  # one record for all questions: the contact is fitted to it once
    for question in QUESTIONS if questions is None else questions:
        led = not question.follows or answers.get(question.follows) is not None
        if led and answers.get(question.unless) is None and question.fits(whole):
            answers[question.key] = inquiry.ask(question.name, partial(_answer, question, whole, fused, slid))
    slips = mistakes(record, rig, answers.get("consistency"), answers.get("loops"), unseen=base_unseen(whole))
    answers = doubted(answers, whole, slips, unknown=made.doubt, refusals=inquiry.refusals)
    answers = untried(answers) if lacking(whole, "the twin of a record") is None else answers
    if all(answer is None for answer in answers.values()):
        raise _nothing(name, record, inquiry.refusals)
    names = [question.key for question in QUESTIONS]
    results = {**dict.fromkeys(names), **answers, "delay": made.delay, "comparison": made.comparison, "trial": None}
    results |= {"slips": slips, "lacking": missing(whole, rig)}
    normal = normal_load(whole, rig, name, inquiry.notes)
    settings = {**_stated(rig, all_of_it=bool(results["lacking"])), **_constants_of(whole), "contact": slid}
    return Findings(name, whole, faults, normal, tuple(inquiry.notes), settings, results=results)


@dataclass(frozen=True)
class Question:
    """One of the questions.

    Attributes
    ----------
    key : str
        The name of its answer among the results.
    name : str
        In words.
    needs : tuple of tuple of str
        Channels: one of each group.
    ask : callable
        Answers it, given the record and what the mass slides on.
    without : tuple of str
        Channels with which it is not asked: others answer it better.
    follows : str
        The question that must have been answered before, where there is one.
    unless : str
        The question whose answer makes this one idle.
    fused : bool
        Whether the friction must come from all sensors together.
    derived : bool
        Whether there must be a balance of forces, or a load cell to hold one against.
    """

    key: str
    name: str
    needs: tuple[tuple[str, ...], ...]
    ask: Callable[[Record, str], Any]
    without: tuple[str, ...] = ()
    follows: str = ""
    unless: str = ""
    fused: bool = False
    derived: bool = False

    def fits(self, record: Record) -> bool:
        """Whether the record has the channels."""
        return (
            all(any(name in record for name in group) for group in self.needs)
            and not any(name in record for name in self.without)
            and (not self.fused or _can_be_fused(record, again=not self.follows))
            and (not self.derived or bool(_constants_of(record)) or "load" in record)
        )


def _answer(question: Question, whole: Record, fused: Callable[[], Record], slid: str) -> Any:
    return question.ask(fused() if question.fused else whole, slid)


def _regression(record: Record, *, symmetric: bool = True) -> Regression:
    """The regression, but of a mass on a spring, whose force goes with the acceleration as inertia does."""
    spring = 0.0 if record.rig is None else record.rig.stiffness or 0.0
    if spring > 0 and "x" in record:
        raise EstimateError(
            f"a mass on a spring of {spring:.3g} N/m",
            "the regression knows of inertia, damping and friction alone",
            "see the friction loops, which take the spring's force off",
        )
    return regress_friction(record, symmetric=symmetric)


FORCE = ("load", "force", "friction")
QUESTIONS = (
    Question("loops", "Friction loops", (("friction",), MOTION), lambda r, on: friction_loops(r, contact=on)),
    Question("regression", "Regression", (("force",), MOTION), lambda r, on: _regression(r)),
    Question(
        "asymmetric", "Regression of each direction", (("force",), MOTION),
        lambda r, on: _regression(r, symmetric=False), follows="regression",
    ),
    Question("sticks", "Sticks and slips", (MOTION,), lambda r, on: find_sticks(r, contact=on)),
    Question("breakaway", "Breakaway", (("friction",), MOTION), lambda r, on: breakaway(r, contact=on)),
    Question(
        "stiffness", "Contact stiffness", (("friction",), ("x",)), lambda r, on: contact_stiffness(r), fused=True,
    ),
    Question(
        "contact_damping", "Contact damping", (("friction",), ("x",)), lambda r, on: contact_damping(r),
        follows="stiffness", fused=True,
    ),
    Question(
        "transition", "Transition speed", (("friction",), ("x",)), lambda r, on: transition_speed(r),
        follows="stiffness", fused=True,
    ),
    Question(
        "coupled", "Coupled frequency", (("friction",), ("x",)), lambda r, on: coupled_frequency(r),
        follows="stiffness", fused=True,
    ),
    Question(
        "cause", "Sensor lag or compliance", (("friction",), ("x",)), lambda r, on: lag_or_compliance(r),
        follows="stiffness", fused=True,
    ),
    Question(
        "consistency", "Consistency", (("friction",), ("x",)), lambda r, on: consistency(middle(r, STRETCH)),
        follows="loops", derived=True,
    ),
    Question(
        "presliding", "Presliding", (("friction",), MOTION), lambda r, on: presliding(r, contact=on),
        unless="stiffness",
    ),
    Question(
        "pull", "Pulled slider", (FORCE,),
        lambda r, on: pulled_slider(r, channel=next(name for name in FORCE if name in r)), without=(*MOTION, "a"),
    ),
)  # fmt: skip


def _settings(rig: RigSettings | None, given: Mapping[str, Any]) -> RigSettings:
    return rig_settings({**(rig.model_dump(exclude_unset=True) if rig is not None else {}), **given}, source="the call")


def _can_be_fused(record: Record, *, again: bool) -> bool:
    """Whether the friction comes from all sensors together; or might have, `again`, if the record were not so long."""
    method = _constants_of(record).get("differentiation")
    sensors = any(is_measured(record, name) and described(record.channels[name]) for name in ("a", "load"))
    return method in FUSIONS or (
        again and method == "smoother" and len(record) > AT_ONCE and sensors and slid_on(record, None) == "ground"
    )


def _fused(record: Record) -> Record:
    """The middle of a record, enough to fit a contact by its likelihood, with all sensors put together."""
    cut = middle(record, STRETCH)
    if cut.rig is None or cut.rig.method in FUSIONS:
        return cut
    return friction_force(cut, method="fusion", **{key: getattr(cut.rig, key) for key in CONSTANTS})


def _constants_of(record: Record) -> dict[str, Any]:
    """The constants and the method behind the friction force, where it comes from a balance of forces."""
    if "friction" not in record or is_measured(record, "friction"):
        return {}
    if Balance.of(record.rig) is None:
        return {}
    constants = {key.replace("method", "differentiation"): getattr(record.rig, key) for key in (*CONSTANTS, "method")}
    return constants | ({"sd": dict(record.rig.sd)} if record.rig is not None and record.rig.sd else {})


def _stated(rig: RigSettings, *, all_of_it: bool) -> dict[str, Any]:
    """What is stated of the sensors; and of the rig's constants, where they do not lead to a force."""
    sensors = {name: sensor.model_dump(exclude_unset=True) for name, sensor in rig.sensors.items()}
    constants = {key: float(getattr(rig, key)) for key in RIG_UNITS if all_of_it and getattr(rig, key) is not None}
    return {**constants, **({"sensors": sensors} if sensors else {})}


def _nothing(name: str, record: Record, refusals: list[StickslipError]) -> EstimateError:
    value = f"{name} answers no question about friction"
    still = [channel for channel in MOTION if channel in record and constant(record[channel])]
    if still:
        return EstimateError(
            f"{value}: {unmoved(record, still[0])}",
            "friction is found from a contact that moves",
            "look at its cable, range and column",
        )
    if refusals:
        first = refusals[0]
        if first.kind == TOO_SHORT:
            return EstimateError(f"{name} is too short: {len(record)} samples", *first.args[1:], kind=first.kind)
        return EstimateError(f"{value}: {first.value}", first.rule, first.next_step, kind=first.kind)
    channels = ", ".join(f"{c.name} [{c.unit}]{_strange(c)}" for c in record.channels.values())
    return EstimateError(
        f"{value}: its channels are {channels}",
        "a displacement x or velocity v is needed, and a force, or mass and stiffness to find it",
        'name the columns, as in channels={"x": "COLUMN [mm]"}',
        kind=UNNAMED,
    )


def _strange(channel: Channel) -> str:
    """That its unit is none, in words; nothing of one that is."""
    try:
        parse_unit(channel.unit)
    except RecordError:
        return f" ('{channel.unit}' is no unit that is known)"
    return ""


# ---- doubts


def doubted(
    answers: dict[str, Any],
    record: Record,
    slips: Sequence[Slip],
    *,
    unknown: Doubt | None,
    refusals: Sequence[StickslipError],
) -> dict[str, Any]:
    """The answers, flagged by the gravest doubt that concerns each; `unknown` is what is not stated of the rig."""
    results, gravest = dict(answers), dict[str, Doubt | str]()
    contradiction = slipped(slips) or untrue(results.get("consistency"))
    for reason, keys in _reasons(contradiction, record, results.get("loops"), unknown, refusals):
        for key in keys:
            if gravest.setdefault(key, reason) == reason:
                results[key] = flagged(results.get(key), reason)
    return results


def _reasons(
    contradiction: str, record: Record, loops: Loops | None, unknown: Doubt | None, refusals: Sequence[StickslipError]
) -> Iterator[tuple[Doubt | str, Iterable[str]]]:
    """Each doubt with the questions that it concerns, the gravest first."""
    if contradiction:
        yield contradiction, (*BY_FORCE, "sticks")
    if base_unseen(record):
        yield NO_BASE, (*BY_FORCE, "sticks")
    if loops is not None and not loops.level.known:  # on a belt that is not stated a mass that moves with it sticks
        yield loops.level.status, (*BY_FORCE, "sticks")
    if unknown:
        yield unknown, BY_FORCE
    if unstated := [f"{name} is read as {known.unit}" for name, known in record.channels.items() if known.assumed]:
        yield f"nobody stated a unit: {' and '.join(unstated)}", (*BY_FORCE, "regression", "asymmetric", "pull")
    if strays := [error.value for error in refusals if error.kind == STRAYING]:
        yield f"{strays[0]}: a mass, a spring or a sensor is not as stated, or the contact no spring", ONSETS


def untried(answers: dict[str, Any]) -> dict[str, Any]:
    """The answers, with a doubt at those that may be otherwise on twins."""
    return answers | {key: with_doubt(answers.get(key), doubt) for key, doubt in NOT_TRIED.items()}


def analyze_blocks(
    blocks: Iterable[Record],
    *,
    rig: RigSettings | None = None,
    method: str = "auto",
    progress: Callable[[str], None] | None = None,
) -> Findings:
    """Ask a record that is longer than memory every question about friction, block after block.

    Each block is analysed as a record of its own, so that no more than one is held. A number is the mean over the
    blocks, each counting by its length; its interval holds what the blocks' own intervals leave and, by Student's t,
    how far the blocks are apart. Sticks, slips and cycles follow each other; one that a block's end cuts is not whole.
    Figures show the block in the middle.

    Parameters
    ----------
    blocks : iterable of Record
        In order, as :func:`read_blocks` yields them.
    rig : RigSettings, optional
        The rig's constants, as for :func:`analyze`.
    method : str
        As for :func:`analyze`.
    progress : callable, optional
        Called with a sentence before each block.

    Returns
    -------
    Findings
        With the record of one block.

    Raises
    ------
    EstimateError
        None of the blocks answers anything.
    ModelError
        A constant that has no meaning.

    Examples
    --------
    >>> import stickslip as ss
    >>> record = ss.datasets.demo()
    >>> blocks = [record.rows(first, first + 8000) for first in (0, 8000)]
    >>> found = analyze_blocks(blocks, rig=ss.rig.rig_settings({"mass": 2.42, "stiffness": 2310, "damping": 0.12}))
    >>> round(found.level.value, 2)
    1.1
    """
    answered: list[Findings] = []
    refused: list[str] = []
    kept: Record | None = None
    size, number = 0, 0
    for number, block in enumerate(blocks, start=1):
        place = f"block {number}, from {block.start:.5g} s"
        if progress is not None:
            progress(place)
        size += len(block)
        try:
            findings = analyze(block, rig=rig, method=method)
        except ModelError:
            raise
        except StickslipError as error:
            refused.append(f"{place.capitalize()}, answers nothing: {error}")
            continue
        if number & (number - 1) == 0 or kept is None:  # of blocks 1, 2, 4, 8 ... the last is near the middle
            kept, shown = findings.record, f"The figures show {place}."
        answered.append(replace(findings, record=_first_row(findings.record)))
    if kept is None:
        raise EstimateError(
            f"none of {number} blocks answers anything" + (f"; {refused[0]}" if refused else ""),
            "a block holds some cycles of a motion, and what tells its friction",
            "see the check-up of the record",
        )
    blocks_told = f"The record was analysed in {number} blocks, {size} samples in all; numbers are means over them."
    return replace(_in_one(answered, [f"{blocks_told} {shown}", *refused]), record=kept)


def _in_one(answered: Sequence[Findings], notes: Sequence[str]) -> Findings:
    """The findings of blocks as those of one record; notes that most blocks have come first."""
    middle = answered[len(answered) // 2]
    results = {key: _joined([block.results[key] for block in answered], middle.results[key]) for key in middle.results}
    faults = tuple(fault for block in answered for fault in block.faults)
    own = Counter(note for block in answered for note in block.notes).most_common()
    return replace(middle, results=results, faults=faults, notes=(*notes, *(note for note, _ in own)))


def _first_row(record: Record) -> Record:
    """One row, copied: a part of an array would keep all of it in memory."""
    row = record.rows(0, 1)
    return replace(row, samples={name: values.copy() for name, values in row.samples.items()})


def _together(parts: Sequence[Any]) -> Any:
    """Answers of one kind to one question, of several blocks, as one."""
    middle = parts[len(parts) // 2]
    joined: dict[str, Any] = {}
    for name in (field.name for field in fields(middle)):
        values = [getattr(part, name) for part in parts]
        if name in TIMES:
            joined[name] = np.concatenate(values)
        elif name == "events":
            joined[name] = tuple(event for value in values for event in value)
        else:
            joined[name] = _joined(values, getattr(middle, name))
    return replace(middle, **joined)


def _joined(values: Sequence[Any], otherwise: Any) -> Any:
    """A number, a part of an answer or words of several blocks as one; of anything else what the middle one has."""
    present = [value for value in values if value is not None]
    kind = present[0] if present else None
    if isinstance(kind, Estimate):
        return _mean(present)
    if isinstance(kind, Result):
        return _together(present)
    if isinstance(kind, str):
        return Counter(present).most_common(1)[0][0]
    return otherwise


def _mean(estimates: Sequence[Estimate]) -> Estimate:
    """The mean of what blocks tell, as sure as they are, and as they agree."""
    count = len(estimates)
    if count == 1:
        return estimates[0]
    values = np.array([estimate.value for estimate in estimates])
    halves = np.array([np.subtract(*estimate.interval[::-1]) / 2 for estimate in estimates])
    mean = float(values.mean())
    own = float(np.sqrt(np.sum(halves**2))) / count
    apart = student(count - 1) * float(values.std(ddof=1)) / math.sqrt(count)
    low, high = (float(np.mean([estimate.interval[end] - estimate.value for estimate in estimates])) for end in (0, 1))
    skew = (high + low) / 2  # of an interval that is not symmetric, in which a method's own error stands
    half = max(own, apart) + abs(skew)
    status = Counter(estimate.status for estimate in estimates).most_common(1)[0][0]
    checks = (f"{count} blocks, which scatter by {values.std(ddof=1):.3g}", *estimates[count // 2].checks)
    ends, sd = (mean - half + min(skew, 0), mean + half + max(skew, 0)), half / NORMAL_95
    return replace(estimates[count // 2], value=mean, interval=ends, sd=sd, status=status, checks=checks)
