"""What keeps the answers about one record from being sure, told in the status of every number that rests on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from stickslip.balance.balance import ALONE
from stickslip.balance.likely_contact import STRAYING
from stickslip.consistent.contradictions import Consistency
from stickslip.errors import StickslipError
from stickslip.estimate import UNTRIED, Doubt, Estimate, Status, doubts_of, stands
from stickslip.record.record import Record

BY_FORCE = (
    "loops", "breakaway", "stiffness", "contact_damping", "transition", "coupled", "cause", "presliding",
)  # fmt: skip
DRIVEN = "forcing frequency"  # no matter of friction
NOT_TRIED = Doubt("not tried on twins: rigs that never stick, that slide at one level or on a rigid contact may seem "
                  "to do so as well", UNTRIED)  # fmt: skip
ONSETS = ("sticks", "breakaway", "presliding")  # when it sticks, and what it does until it slips
BALANCED = ("balance", "energy")  # checks that a wrong mass, spring or sensor fails
GOES_ON = 0.8  # of the motion at first that is left at last, where something drives it
NO_BASE = "there is no channel z: the base is taken to be at rest, but something keeps the motion up"


def doubted(
    answers: dict[str, Any], record: Record, *, unknown: Doubt | None, refusals: Sequence[StickslipError]
) -> dict[str, Any]:
    """The answers, flagged by the gravest doubt that concerns each; `unknown` is what is not stated of the rig."""
    told, gravest = dict(answers), dict[str, Doubt | str]()
    for reason, keys in _reasons(told.get("consistency"), record, unknown, refusals):
        for key in keys:
            if gravest.setdefault(key, reason) == reason:
                told[key] = flagged(told.get(key), reason)
    return told


def _reasons(
    consistent: Consistency | None, record: Record, unknown: Doubt | None, refusals: Sequence[StickslipError]
) -> Iterator[tuple[Doubt | str, Iterable[str]]]:
    """Each doubt with the questions that it concerns, the gravest first."""
    if words := _contradiction(consistent):
        yield words, (*BY_FORCE, "sticks")
    if _base_unseen(record):
        yield NO_BASE, (*BY_FORCE, "sticks")
    if unknown:
        yield unknown, BY_FORCE
    if unstated := [f"{name} is read as {each.unit}" for name, each in record.channels.items() if each.assumed]:
        yield f"nobody stated a unit: {' and '.join(unstated)}", (*BY_FORCE, "regression", "asymmetric", "pull")
    if strays := [error.value for error in refusals if error.kind == STRAYING]:
        yield f"{strays[0]}: a mass, a spring or a sensor is not as stated, or the contact no spring", ONSETS


def untried(answers: dict[str, Any]) -> dict[str, Any]:
    """The answers, with a doubt at those that rigs of another kind give too."""
    return {**answers, **{key: _with(answers.get(key), NOT_TRIED) for key in ONSETS}}


def without(found: Any, kind: str) -> Any:
    """An answer without doubts of a kind."""

    def left(number: Estimate) -> Estimate:
        return replace(number, status=Status(*(each for each in doubts_of(number.status) if each.kind != kind)))

    return _each(found, left)


def _with(found: Any, doubt: Doubt) -> Any:
    return _each(found, lambda number: replace(number, status=Status(number.status, doubt)))


def _each(found: Any, change: Callable[[Estimate], Estimate]) -> Any:
    """An answer with each of its numbers changed, but for that of the drive."""
    if found is None:
        return None
    numbers = {each.name: getattr(found, each.name) for each in fields(found)}
    return replace(
        found,
        **{
            name: change(value)
            for name, value in numbers.items()
            if isinstance(value, Estimate) and value.name != DRIVEN
        },
    )


def flagged(found: Any, reason: Doubt | str) -> Any:
    """An answer with each of its numbers flagged that was thought to be sure; that of the drive stays sure."""
    if isinstance(found, Estimate):
        lesser = stands(found.status)
        if found.name == DRIVEN or not (lesser or not found.known):
            return found
        return replace(found, status=Status(reason) if lesser else Status(reason, found.status))
    return _each(found, lambda number: flagged(number, reason))


def _contradiction(told: Consistency | None) -> str:
    """What one slip in the channels, or in the rig's constants, would explain; a clipped sensor says so itself."""
    if told is None:
        return ""
    if told.slip:
        return f"the channels contradict each other: perhaps {told.slip}"
    failed = told.failed
    if any("range" in check.name for check in failed):
        return ""
    apart = [check.sentence for check in failed if any(word in check.name for word in BALANCED)]
    return f"the record and the rig's constants contradict each other: {apart[0]}" if apart else ""


def _base_unseen(record: Record) -> bool:
    """Whether the friction is that of a spring whose other end was not measured, while the motion goes on."""
    rig = record.rig
    if rig is None or rig.method == ALONE or "x" not in record or not {"z", "force", "load"}.isdisjoint(record):
        return False
    first, last = (float(np.std(part)) for part in np.array_split(record["x"], 2))
    return last > GOES_ON * first
