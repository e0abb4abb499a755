"""Which questions are asked of a record, in which order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from stickslip.config import RigSettings
from stickslip.errors import EstimateError, ModelError, StickslipError
from stickslip.findings import Findings, record_name
from stickslip.identify.breakaway import breakaway
from stickslip.identify.force import friction_force
from stickslip.identify.loops import friction_loops
from stickslip.identify.motion import is_measured, slid_on
from stickslip.identify.presliding import presliding
from stickslip.identify.pull import pulled_slider
from stickslip.identify.regression import regress_friction
from stickslip.identify.sticks import find_sticks
from stickslip.record.record import Record, Step
from stickslip.signals.delay import without_delays

Answer = TypeVar("Answer")

USED = ("x", "z", "v", "a", "theta", "friction", "load", "force")  # channels that a question may take
CONSTANTS = ("mass", "stiffness", "damping", "damper")  # of the balance of forces


def analyze(
    record: Record,
    *,
    rig: RigSettings | None = None,
    mass: float | str | None = None,
    stiffness: float | str | None = None,
    damping: float | str | None = None,
    damper: str | None = None,
    contact: str | None = None,
    method: str = "smoother",
) -> Findings:
    """Ask a record every question about friction that its channels allow.

    In this order: the check-up; the friction force (as measured, or from the force balance
    ``f = k z - k x - c v - m a``); the friction loops; sticks and slips; the breakaway, and what the contact does
    before; the regression of an applied force on acceleration, velocity and direction; of a force without any motion,
    how a slider moves that is pulled through a spring. A question that can not be answered becomes a note, not an
    error.

    Parameters
    ----------
    record : Record
        Displacement ``x`` [m] with `mass` and `stiffness`, or a measured ``friction`` or ``load`` [N], or an
        applied ``force`` [N].
    rig : RigSettings, optional
        The rig's constants, as :func:`read_rig` returns them; the arguments below go before it.
    mass, stiffness, damping : float or str, optional
        Oscillating mass [kg], spring [N/m], viscous damping [N s/m]; or text with a unit ("250 g").
    damper, contact : {"ground", "base"}, optional
        What the damper ends on, and what the mass slides on; the ground unless stated.
    method : {"smoother", "five-point"}
        How displacement is differentiated.

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
    given = {"mass": mass, "stiffness": stiffness, "damping": damping, "damper": damper, "contact": contact}
    rig = _settings(rig, {key: value for key, value in given.items() if value is not None})
    asked = _Asked([], [])
    faults = tuple(record.check())
    known = [each for each in USED if each in record]
    whole = asked.ask("Stated delays", lambda: without_delays(record, *known)) if known else record
    whole = _with_friction(whole or record, rig, method, asked)
    slid = slid_on(whole, rig.contact if "contact" in rig.model_fields_set else None)
    answers: dict[str, Any] = {}
    for each in QUESTIONS:
        if each.fits(whole) and (not each.follows or answers.get(each.follows) is not None):
            answers[each.key] = asked.ask(each.name, partial(each.ask, whole, slid))
    name = record_name(record)
    if all(answer is None for answer in answers.values()):
        raise _nothing(name, record, asked.refusals)
    return Findings(
        name, whole, faults, **answers, normal=_normal_load(record, rig, name, asked.notes), notes=tuple(asked.notes),
        settings={**_balanced(whole), "contact": slid},
    )  # fmt: skip


@dataclass(frozen=True)
class Question:
    """One of the questions.

    Attributes
    ----------
    key : str
        The attribute of :class:`Findings` that holds the answer.
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
    """

    key: str
    name: str
    needs: tuple[tuple[str, ...], ...]
    ask: Callable[[Record, str], Any]
    without: tuple[str, ...] = ()
    follows: str = ""

    def fits(self, record: Record) -> bool:
        """Whether the record has the channels."""
        return all(any(name in record for name in group) for group in self.needs) and not any(
            name in record for name in self.without
        )


MOTION = ("x", "v", "theta")
FORCE = ("load", "force", "friction")
QUESTIONS = (
    Question("loops", "Friction loops", (("friction",), MOTION), lambda r, on: friction_loops(r, contact=on)),
    Question("sticks", "Sticks and slips", (MOTION,), lambda r, on: find_sticks(r, contact=on)),
    Question("breakaway", "Breakaway", (("friction",), MOTION), lambda r, on: breakaway(r, contact=on)),
    Question("presliding", "Presliding", (("friction",), MOTION), lambda r, on: presliding(r, contact=on)),
    Question("regression", "Regression", (("force",), MOTION), lambda r, on: regress_friction(r)),
    Question(
        "asymmetric", "Regression of each direction", (("force",), MOTION),
        lambda r, on: regress_friction(r, symmetric=False), follows="regression",
    ),
    Question(
        "pull", "Pulled slider", (FORCE,),
        lambda r, on: pulled_slider(r, channel=next(name for name in FORCE if name in r)), without=(*MOTION, "a"),
    ),
)  # fmt: skip


@dataclass(frozen=True)
class _Asked:
    """What came of the questions so far: notes in words, and the errors behind those that failed."""

    notes: list[str]
    refusals: list[StickslipError]

    def ask(self, question: str, answer: Callable[[], Answer]) -> Answer | None:
        try:
            return answer()
        except ModelError:
            raise
        except StickslipError as error:
            self.notes.append(f"{question}: {error}")
            self.refusals.append(error)
            return None


def _settings(rig: RigSettings | None, given: Mapping[str, Any]) -> RigSettings:
    from stickslip.config import rig_settings

    return rig_settings({**(rig.model_dump(exclude_unset=True) if rig is not None else {}), **given}, source="the call")


def _balanced(record: Record) -> dict[str, Any]:
    """The constants and the method behind the friction force, where it comes from a balance of forces."""
    if "friction" not in record or is_measured(record, "friction"):
        return {}
    told = [step.arguments for step in record.history if step.action == "friction_force"][-1:]
    return {key.replace("method", "differentiation"): made[key] for made in told for key in (*CONSTANTS, "method")}


def _with_friction(record: Record, rig: RigSettings, method: str, asked: _Asked) -> Record:
    """The record with its friction force, where there is a way to it."""
    if is_measured(record, "friction"):
        unused = [key for key in CONSTANTS if key in rig.model_fields_set and getattr(rig, key) is not None]
        if unused:
            asked.notes.append(f"The friction was measured: {' and '.join(unused)} as stated {_are(unused)} not used.")
        return record
    if "x" in record and rig.mass is not None and rig.stiffness is not None:
        balanced = asked.ask(
            "Friction force",
            lambda: friction_force(
                record, mass=rig.mass or 0.0, stiffness=rig.stiffness or 0.0, damping=rig.damping or 0.0,
                damper=rig.damper, contact=rig.contact, method=method,
            ),
        )  # fmt: skip
        if balanced is not None and rig.damping is None:
            asked.notes.append("No damping was stated: viscous damping of the suspension, if any, counts as friction.")
        if balanced is not None:
            return balanced
    if "friction" in record:
        return record
    if "load" in record and "force" not in record and any(name in record for name in MOTION):
        asked.notes.append(
            "The load cell's reading is taken as the friction force; inertia between both is part of it."
        )
        step = Step("analyze", {"friction": "load"}, "the load cell's reading taken as the friction force")
        return record.with_channel(
            "friction", record["load"], unit=record.channels["load"].unit, source="load", step=step
        )
    lacking = _lacking(record, rig)
    if lacking and "force" not in record and "load" not in record:
        asked.notes.append(
            f"Friction force: without a measured friction or load it needs {' and '.join(lacking)}, not given."
        )
    return record


def _are(words: Sequence[str]) -> str:
    return "is" if len(words) == 1 else "are"


def _lacking(record: Record, rig: RigSettings) -> list[str]:
    missing = [key for key in ("mass", "stiffness") if getattr(rig, key) is None]
    return missing if "x" in record else ["a displacement x", *missing]


def _nothing(name: str, record: Record, refusals: list[StickslipError]) -> EstimateError:
    value = f"{name} answers no question about friction"
    if refusals:
        return EstimateError(f"{value}: {refusals[0].value}", refusals[0].rule, refusals[0].next_step)
    return EstimateError(
        f"{value}: its channels are {', '.join(f'{c.name} [{c.unit}]' for c in record.channels.values())}",
        "a displacement x or velocity v is needed, and a force, or mass and stiffness to find it",
        'name the columns, as in channels={"x": "COLUMN [mm]"}',
    )


def _normal_load(record: Record, rig: RigSettings, name: str, notes: list[str]) -> float | None:
    """The normal load as measured, by its magnitude, or as stated for the file."""
    if "normal" in record:
        finite = record["normal"][np.isfinite(record["normal"])]
        mean = float(finite.mean()) if len(finite) else 0.0
        if mean < 0:
            notes.append(f"The normal load reads {mean:.4g} N: its magnitude is taken.")
        if mean:
            return abs(mean)
        notes.append("The channel normal tells no load: it holds " + ("zeros." if len(finite) else "no numbers."))
    loads = (rig.normal_load(part) for part in [*name.split(" + "), name])
    return next((load for load in loads if load is not None), None)
