"""Findings told: what stands on every page of a record, around what its own family of answers says.

Plain estimates are told with the record that they were found in.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.answers.findings import Comparison, Findings, record_name
from stickslip.balance.impact import ImpactTest
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.files.write import require_form, write_record
from stickslip.record.record import Record
from stickslip.story.scope import of_findings as scope_of
from stickslip.story.story import Line, Story, Table, logged
from stickslip.story.words import leading, number, value_of

# The file that tells findings which hold a result of this name; friction.py tells all others.
FAMILIES = {"decay": "decay", "squeaks": "squeak", "joint": "joint", "tribometer": "tribometer"}


# What an engineer looks for first: these quantities lead the table, those without a value end it.
FIRST = (
    "coefficient of friction, plateau", "coefficient of friction, static",
    "sliding friction", "Coulomb friction", "viscous friction", "inertia", "friction coefficient",
    "static over sliding friction", "stuck share of the time", "stops per cycle", "slope of friction against speed",
    "presliding stiffness", "contact stiffness", "forcing frequency", "sliding friction forward",
    "sliding friction back", "damping ratio", "damping ratio, whichever motion", "dry friction displacement",
    "dry friction force", "natural frequency", "static friction displacement",
)  # fmt: skip


def _place(estimate: Estimate) -> tuple[bool, int]:
    """Where a quantity stands in the table."""
    return not estimate.known, FIRST.index(estimate.name) if estimate.name in FIRST else len(FIRST)


def of_findings(findings: Findings, *, form: str = "") -> Story:
    """One record; in `form`, where one is named, its folder holds the record too."""
    record = findings.record
    own: Story = _family(findings).of_findings(findings)
    if form:
        require_form(form)
        file = f"record.{form}"
        own = replace(
            own, look=lambda: scope_of(findings, file), write=lambda folder: write_record(record, folder / file)
        )
    load = {} if findings.normal is None else {"normal load": number(findings.normal, 0.0, "N")}
    length = {"sampling rate": f"{record.fs:g} Hz", "length": f"{len(record)} samples, {record.duration:g} s"}
    return replace(
        own,
        headline=_headed(findings, own.headline),
        lines=[*(Line.of(each, findings.true_value(each)) for each in sorted(findings.quoted, key=_place)), *own.lines],
        faults=[str(fault) for fault in findings.faults],
        notes=[*findings.notes, *own.notes],
        settings={**own.settings, **load, **length},
        tables=[*own.tables, *logged(record)],
        channels=list(record.channels.values()),
        history=record.history,
        data=lambda: _data(findings, own),
    )


def _headed(findings: Findings, told: Sequence[str]) -> list[str]:
    """What is wrong with units before the answer; behind it where that names the mistake."""
    named = 1 if findings.contradiction else 0
    return [*told[:named], *leading(findings.faults), *told[named:]]


def of_comparison(comparison: Comparison) -> Story:
    """Several records side by side."""
    own: Story = _family(comparison.findings[0]).of_comparison(comparison)
    parts = [of_findings(each) for each in comparison.findings]
    estimates = comparison.estimates

    def data() -> dict[str, Any]:
        told = {**own.data(), "estimates": [estimate.to_dict() for estimate in estimates], "notes": comparison.notes}
        return {"comparison": plain(told), "records": [part.data() for part in parts]}

    return replace(own, lines=[*map(Line.of, estimates), *own.lines], notes=comparison.notes, parts=parts, data=data)


def _family(findings: Findings) -> Any:
    file = next((file for name, file in FAMILIES.items() if name in findings.results), "friction")
    return importlib.import_module(f"stickslip.story.{file}")


def _data(findings: Findings, own: Story) -> dict[str, Any]:
    told = {
        "name": findings.name,
        "faults": [str(fault) for fault in findings.faults],
        "settings": findings.settings,
        **own.data(),
        "estimates": [estimate.to_dict() for estimate in findings.estimates],
        "truth": findings.record.truth,
        "log": findings.record.log.entries() if findings.record.log is not None else {},
        "notes": findings.notes,
        "history": [step.to_dict() for step in findings.record.history],
    }
    return {key: plain(value) for key, value in told.items()}


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
