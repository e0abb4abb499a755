"""What was found in one record: every answer, what keeps it from being sure, and what was not asked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.balance.felt_and_computed import ForceComparison
from stickslip.balance.lag import SensorDelay
from stickslip.balance.pull import Pull
from stickslip.consistent.contradictions import Consistency
from stickslip.contact.cause import Cause
from stickslip.contact.sliding_onset import TransitionSpeed
from stickslip.cycle.before_slip import Presliding
from stickslip.cycle.loops import Loops
from stickslip.cycle.onset import Breakaway
from stickslip.cycle.regression import Regression
from stickslip.cycle.sticks import Sticks
from stickslip.estimate import Estimate, Result
from stickslip.record.record import Record
from stickslip.twin.trial import Trial

if TYPE_CHECKING:
    from stickslip.record.check import Fault


@dataclass(frozen=True, eq=False, repr=False)
class Findings(Result):
    """What a record says about its friction.

    Attributes
    ----------
    name : str
        The record's name: its file, or what the caller called it.
    record : Record
        The record, with the channel ``friction`` where it could be found.
    faults : tuple of Fault
        What the check-up found in the record as it was given.
    loops, regression, asymmetric, sticks : Loops, Regression, Regression, Sticks or None
        The answers to the questions that could be asked; `asymmetric` lets both directions differ.
    breakaway, presliding, pull : Breakaway, Presliding, Pull or None
        How it begins to slip, what it does before, and of a force alone how a pulled slider moves.
    stiffness, contact_damping : Estimate or None
        Of the contact while it holds, from all sensors together.
    transition : TransitionSpeed or None
        Speed at which the contact begins to slide after the motion has turned.
    coupled : Estimate or None
        Frequency at which the mass rings while the contact holds.
    cause : Cause or None
        Whether a lag of the sensors or a contact that gives way makes the friction turn late.
    consistency : Consistency or None
        What of the record and the rig's constants can not all be true.
    delay : SensorDelay or None
        Of the accelerometer behind the displacement.
    comparison : ForceComparison or None
        The friction felt by the load cell against the friction computed from the motion.
    trial : Trial or None
        What came of its twins, where it was tried on them: see :func:`~stickslip.tried`.
    normal : float or None
        Normal load [N] on the contact, where stated or measured.
    notes : tuple of str
        What could not be asked, and why; what was assumed.
    settings : mapping
        The constants and choices that the answers rest on.
    """

    name: str
    record: Record
    faults: tuple[Fault, ...] = ()
    loops: Loops | None = None
    regression: Regression | None = None
    asymmetric: Regression | None = None
    sticks: Sticks | None = None
    breakaway: Breakaway | None = None
    presliding: Presliding | None = None
    pull: Pull | None = None
    stiffness: Estimate | None = None
    contact_damping: Estimate | None = None
    transition: TransitionSpeed | None = None
    coupled: Estimate | None = None
    cause: Cause | None = None
    consistency: Consistency | None = None
    delay: SensorDelay | None = None
    comparison: ForceComparison | None = None
    trial: Trial | None = None
    normal: float | None = None
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def level(self) -> Estimate | None:
        """The sliding friction, where it is known: from the loops, or the Coulomb term of the regression."""
        told = self.loops.level if self.loops is not None else None
        if self.loops is None and self.regression is not None:
            told = self.regression.coulomb
        return told if told is not None and told.known else None

    @property
    def coefficient(self) -> Estimate | None:
        """Sliding friction over the normal load, where both are known."""
        if self.level is None or self.normal is None or self.level.unit != "N":
            return None
        return self.level.scaled(1 / self.normal, "1", "friction coefficient")

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found, in the order of asking."""
        level = [self.coefficient] if self.coefficient is not None else []
        found = list(level)
        for answer in vars(self).values():
            found += (
                answer.estimates if isinstance(answer, Result) else [answer] if isinstance(answer, Estimate) else []
            )
        first: dict[str, Estimate] = {}
        for estimate in found:
            first.setdefault(estimate.name, estimate)
        return tuple(first.values())

    @property
    def doubts(self) -> tuple[tuple[str, str], ...]:
        """The answers that are not sure as wholes, and what each says of it."""
        names = {
            "delay": "sensor delay",
            "comparison": "comparison of the forces",
            "loops": "friction loops",
            "consistency": "consistency",
        }
        told = ((names.get(name, name), getattr(value, "status", "ok")) for name, value in vars(self).items())
        return tuple((name, status) for name, status in told if status != "ok" and name in names.values())

    @property
    def contradiction(self) -> str:
        """What slip of the hand in the channels forbids to trust any force, in words; else empty."""
        return self.consistency.slip if self.consistency is not None else ""

    def true_value(self, estimate: Estimate) -> float | None:
        """The true value of what was estimated, where the record is simulated and tells it."""
        true = self.record.truth.get(estimate.name)
        return None if true is None else float(true)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: settings, estimates, faults, notes and history."""
        told = {
            "name": self.name,
            "faults": [str(fault) for fault in self.faults],
            "contradiction": self.contradiction,
            "settings": dict(self.settings),
            "normal_load": self.normal,
            "estimates": [estimate.to_dict() for estimate in self.estimates],
            "regression_residual": None if self.regression is None else self.regression.residual,
            "truth": dict(self.record.truth),
            **({} if self.trial is None else {"twins": self.trial.to_dict()}),
            "notes": list(self.notes),
            "history": [step.to_dict() for step in self.record.history],
        }
        return {key: plain(value) for key, value in told.items()}


def record_name(record: Record) -> str:
    """The names of the files that the record was last read from; of the first record, where two were joined."""
    own = (step.arguments for step in record.history if step.arguments.get("record") != "b")
    reads = [arguments["files"] for arguments in own if arguments.get("files")]
    if reads:
        return " + ".join(file["name"] for file in reads[-1])
    return "simulated record" if record.truth else "record"


def plain(value: Any) -> Any:
    """Plain JSON data of anything that settings, truth or history may hold; a number not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
