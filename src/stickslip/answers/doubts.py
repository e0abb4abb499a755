"""What keeps the answers about one record from being sure, told in the status of every number that rests on it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from stickslip.balance.balance import ALONE
from stickslip.balance.likely_contact import STRAYING
from stickslip.consistent.contradictions import Consistency
from stickslip.consistent.slips import Slip
from stickslip.errors import StickslipError
from stickslip.estimate import Doubt, Estimate, Status, stands
from stickslip.record.record import Record

BY_FORCE = (
    "loops", "breakaway", "stiffness", "contact_damping", "transition", "coupled", "cause", "presliding",
)  # fmt: skip
ONSETS = ("sticks", "breakaway", "presliding")  # when it sticks, and what it does until it slips
BALANCED = ("balance", "energy")  # checks that a wrong mass, spring or sensor fails
FAR = 2.0  # times by which two sides that should be one differ, from which no force is given
GOES_ON = 0.8  # of the motion at first that is left at last, where something drives it
NO_BASE = "there is no channel z: the base is taken to be at rest, but something keeps the motion up"


def doubted(
    answers: dict[str, Any],
    record: Record,
    slips: Sequence[Slip],
    *,
    unknown: Doubt | None,
    refusals: Sequence[StickslipError],
) -> dict[str, Any]:
    """The answers, flagged by the gravest doubt that concerns each; `unknown` is what is not stated of the rig."""
    told, gravest = dict(answers), dict[str, Doubt | str]()
    contradiction = slipped(slips) or untrue(told.get("consistency"))
    for reason, keys in _reasons(contradiction, record, unknown, refusals):
        for key in keys:
            if gravest.setdefault(key, reason) == reason:
                told[key] = flagged(told.get(key), reason)
    return told


def _reasons(
    contradiction: str, record: Record, unknown: Doubt | None, refusals: Sequence[StickslipError]
) -> Iterator[tuple[Doubt | str, Iterable[str]]]:
    """Each doubt with the questions that it concerns, the gravest first."""
    if contradiction:
        yield contradiction, (*BY_FORCE, "sticks")
    if _base_unseen(record):
        yield NO_BASE, (*BY_FORCE, "sticks")
    if unknown:
        yield unknown, BY_FORCE
    if unstated := [f"{name} is read as {each.unit}" for name, each in record.channels.items() if each.assumed]:
        yield f"nobody stated a unit: {' and '.join(unstated)}", (*BY_FORCE, "regression", "asymmetric", "pull")
    if strays := [error.value for error in refusals if error.kind == STRAYING]:
        yield f"{strays[0]}: a mass, a spring or a sensor is not as stated, or the contact no spring", ONSETS


def flagged(found: Any, reason: Doubt | str) -> Any:
    """An answer with each of its numbers flagged that was thought to be sure; that of the drive stays sure."""
    if isinstance(found, Estimate):
        lesser = stands(found.status)
        if found.name == "forcing frequency" or not (lesser or not found.known):
            return found
        return replace(found, status=Status(reason) if lesser else Status(reason, found.status))
    if found is None:
        return None
    numbers = {each.name: getattr(found, each.name) for each in fields(found)}
    return replace(
        found, **{name: flagged(value, reason) for name, value in numbers.items() if isinstance(value, Estimate)}
    )  # fmt: skip


def slipped(slips: Sequence[Slip]) -> str:
    """What one slip of the hand would explain, in words; nothing without one."""
    return f"something is stated wrongly: probably {' or '.join(slip.words for slip in slips)}" if slips else ""


def untrue(told: Consistency | None) -> str:
    """What of channels and constants can not all be true, in words; a clipped sensor says so itself."""
    failed = told.failed if told is not None else ()
    if any("range" in check.name for check in failed):
        return ""
    apart = [check.sentence for check in failed if any(word in check.name for word in BALANCED)]
    return f"the record and the rig's constants contradict each other: {apart[0]}" if apart else ""


def hopeless(told: Consistency | None) -> str:
    """What of channels and constants can not all be true, where it is so far off that no force is worth a headline."""
    failed = told.failed if told is not None else ()
    apart = [check for check in failed if any(word in check.name for word in BALANCED) and check.right]
    return untrue(told) if any(not 1 / FAR < check.left / check.right < FAR for check in apart) else ""


def _base_unseen(record: Record) -> bool:
    """Whether the friction is that of a spring whose other end was not measured, while the motion goes on."""
    rig = record.rig
    if rig is None or rig.method == ALONE or "x" not in record or not {"z", "force", "load"}.isdisjoint(record):
        return False
    first, last = (float(np.std(part)) for part in np.array_split(record["x"], 2))
    return last > GOES_ON * first
