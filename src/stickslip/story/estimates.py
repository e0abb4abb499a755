"""Plain estimates, told with the record that they were found in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from stickslip.answers.findings import record_name
from stickslip.balance.impact import ImpactTest
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.record.record import Record
from stickslip.story.story import Line, Story, Table
from stickslip.story.words import leading, value_of


def of_one(estimate: Estimate, *, record: Record | None = None) -> Story:
    """An estimate by itself."""
    return of_several([estimate], record=record)


def of_tap(test: ImpactTest, *, record: Record | None = None) -> Story:
    """What rings after a tap, and whose resonance each is."""
    named = [f"{resonance.name} at {value_of(resonance.frequency)}" for resonance in test.resonances]
    many = f"{len(named)} resonance{'s' * (len(named) > 1)} ring{'s' * (len(named) == 1)} after the tap"
    lines = [
        Line.of(number, name=f"{quantity}, {resonance.name}")
        for resonance in test.resonances
        for quantity, number in (("frequency", resonance.frequency), ("damping ratio", resonance.damping))
    ]
    rows = [(resonance.name, ", ".join(resonance.channels), resonance.evidence) for resonance in test.resonances]
    told: dict[str, Any] = {
        "headline": [f"{many}: {'; '.join(named)}."], "lines": lines, "data": test.to_dict,
        "cautions": [] if test.status == "ok" else [test.status],
        "tables": [Table("Why each is called so", ("resonance", "seen by", "evidence"), rows, folded=True)],
    }  # fmt: skip
    return Story("Tap", **told) if record is None else Story.of_record(record_name(record), record, **told)


def of_several(estimates: Sequence[Estimate], *, record: Record | None = None) -> Story:
    """Estimates, and the faults of their record."""
    strangers = [type(item).__name__ for item in estimates if not isinstance(item, Estimate)]
    if strangers or not estimates:
        raise EstimateError(
            f"a report of {', '.join(strangers) or 'nothing'}",
            "a report is made of Findings, a Comparison, or Estimates",
            "pass analyze(record), compare(findings) or a list of estimates",
        )
    lines = [Line.of(estimate) for estimate in estimates]

    def data() -> dict[str, object]:
        return {"estimates": [estimate.to_dict() for estimate in estimates]}

    if record is None:
        return Story("Estimates", lines=lines, data=data)
    faults = record.check()
    return Story.of_record(
        record_name(record), record, headline=leading(faults), lines=lines, faults=[str(fault) for fault in faults],
        data=data,
    )  # fmt: skip
