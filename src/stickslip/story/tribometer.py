"""A tribometer's coefficients, told."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from stickslip.answers.findings import Comparison, Findings
from stickslip.cycle.tribometer import DEFINITIONS
from stickslip.estimate import Estimate, stands
from stickslip.figures.contact import tribometer_plates
from stickslip.story.story import Story, Table
from stickslip.story.words import cautions, interval_of, value_of

APART = 0.05  # of the coefficient, by which definitions must differ to be worth a sentence


def of_findings(findings: Findings) -> Story:
    """One test."""
    found = findings.tribometer
    return Story(
        findings.name, list(_headline(findings)), cautions(findings),
        settings={key: str(value) for key, value in findings.settings.items()},
        tables=[_definitions(findings)], draw=lambda: tribometer_plates(found), data=lambda: _data(findings),
    )  # fmt: skip


def of_comparison(comparison: Comparison) -> Story:
    """Several tests."""
    rows = [
        (one.name, *(value_of(getattr(one.tribometer, name)) for name in DEFINITIONS)) for one in comparison.findings
    ]
    table = Table("Tests", ("test", *(name.replace("_", " ") for name in DEFINITIONS)), rows)
    mean: Estimate = comparison.plateau
    told = f"Over {len(rows)} tests the coefficient of friction is {value_of(mean)} (95 %: {interval_of(mean)})."
    return Story(f"{len(rows)} tests", [told], tables=[table])


def _headline(findings: Findings) -> Iterator[str]:
    found = findings.tribometer
    doubt = "" if stands(found.plateau.status) else f", which is not to be trusted ({found.plateau.status})"
    yield (
        f"The kinetic coefficient of friction is {value_of(found.plateau)} by the plateau "
        f"(95 %: {interval_of(found.plateau)}) under {value_of(found.load)}{doubt}."
    )
    others = [getattr(found, name) for name in DEFINITIONS if name != "plateau"]
    if any(abs(one.value - found.plateau.value) > APART * found.plateau.value for one in others if one.known):
        told = ", ".join(f"{value_of(one)} {one.name.rpartition(', ')[2]}" for one in others if one.known)
        yield f"By other definitions it is {told}: say which when you quote it."
    if findings.static is not None:
        yield f"The static coefficient is {value_of(findings.static)} (95 %: {interval_of(findings.static)})."
    if found.wear_in is not None:
        change, way = found.wear_in.change, "above" if found.wear_in.change.value > 0 else "below"
        yield (
            f"It wears in over {value_of(found.wear_in.cycles)} cycles (95 %: {interval_of(found.wear_in.cycles)}), "
            f"from {value_of(change.scaled(1 if change.value > 0 else -1, '1'))} {way} where it settles."
        )


def _definitions(findings: Findings) -> Table:
    """The coefficient by every definition, side by side."""
    told = [(getattr(findings.tribometer, name), words) for name, words in DEFINITIONS.items()]
    if findings.static is not None:
        told.append((findings.static, "what the contact bears before it slips"))
    rows = [(one.name.rpartition(", ")[2], value_of(one), interval_of(one), words) for one, words in told]
    return Table("The coefficient by the definitions in use", ("definition", "value", "95 %", "of each cycle"), rows)


def _data(findings: Findings) -> dict[str, Any]:
    found = findings.tribometer
    return {
        "load_measured": found.measured, "of_cycles": dict(found.of_cycles), "cycle_time": found.time,
        "map": {name: getattr(found, name) for name in ("position", "cycle", "forward", "back")},
    }  # fmt: skip
