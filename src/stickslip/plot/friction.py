"""Which figures a record's friction is worth, each with a title and a caption in plain words."""

from __future__ import annotations

from functools import partial

from stickslip.answers.comparison import Comparison
from stickslip.answers.findings import Findings
from stickslip.balance.force import FUSIONS
from stickslip.estimate import UNSTATED, kinds
from stickslip.plot.comparison import plot_levels, plot_load_dependence
from stickslip.plot.consistency import plot_consistency
from stickslip.plot.contact import (
    plot_breakaway,
    plot_displacement_loop,
    plot_micro_slips,
    plot_sticks,
    plot_transition_speed,
    plot_velocity_loop,
)
from stickslip.plot.force import plot_force_comparison
from stickslip.plot.plate import Plate, plate
from stickslip.plot.regression import plot_regression
from stickslip.plot.traces import MOST_SHADES, close_up, force_balance, plot_force_balance, plot_traces
from stickslip.plot.twin import plot_twin


def plates_of(findings: Findings) -> list[Plate]:
    """The figures of one record, in reading order."""
    events = findings.sticks.events if findings.sticks is not None else ()
    sticks = [event for event in events if event.kind == "stick"]
    plates = [*_of_friction(findings), *_over_time(findings, sticks=len(sticks)), *_of_contact(findings)]
    if any(event.whole for event in sticks):
        plates.append(
            plate("sticks", partial(plot_sticks, findings), "How long it sticks and slips",
                   "Each mark is one whole stretch of sticking or slipping; the bars count how often each duration "
                   "occurred.")
        )  # fmt: skip
    return plates


def _of_friction(findings: Findings) -> list[Plate]:
    """Friction over the cycle, and the force that the regression explains."""
    plates = []
    if findings.loops is not None:
        plates += [
            plate(
                "friction-velocity", partial(plot_velocity_loop, findings), "Friction against velocity",
                "Dry friction is a step: about the same force (dotted) at every speed, against the motion. A slope to "
                "either side is friction that changes with speed; points between the levels at zero velocity are the "
                "sticking contact, which bears any force up to the level.",
            ),
            plate(
                "friction-displacement", partial(plot_displacement_loop, findings), "Friction against displacement",
                "One turn is one cycle and its area is the work lost to friction. Flat top and bottom: sliding. Steep "
                "sides: the contact sticks, and their slope is the contact's own stiffness. The band is the scatter "
                "between cycles.",
            ),
        ]  # fmt: skip
    if findings.regression is not None:
        plates.append(
            plate(
                "regression", partial(plot_regression, findings), "Does the friction model explain the force?",
                "Top: the measured force and the force that inertia, viscous and dry friction together give. Bottom: "
                "what is left over; a pattern there is friction that the model does not hold.",
            )
        )  # fmt: skip
    return plates


def _over_time(findings: Findings, *, sticks: int) -> list[Plate]:
    """The record as a whole, some cycles of it, and the force balance in them."""
    near = close_up(findings)
    stuck = " Grey: the contact sticks." if sticks else ""
    shaded = stuck if sticks <= MOST_SHADES else ""
    plates = [
        plate(
            "record", partial(plot_traces, findings), "The record", f"Every channel used, over the whole time.{shaded}"
        )
    ]
    if near is not None:
        plates.append(
            plate("close-up", partial(plot_traces, findings, record=near), "A closer look",
                   f"A few cycles from the middle of the record.{stuck}")
        )  # fmt: skip
    if force_balance(findings.record) is not None:
        plates.append(
            plate("force-balance", partial(plot_force_balance, findings, record=near),
                  "Where the friction force comes from", f"{_how_it_adds_up(findings)}{stuck}")
        )  # fmt: skip
    return plates


def _of_contact(findings: Findings) -> list[Plate]:
    """What the contact does at a turn and before it slips, and what the sensors say of each other."""
    plates, found = [], findings.breakaway
    if found is not None and findings.loops is not None and UNSTATED not in kinds(found.ratio.status):
        plates.append(
            plate("breakaway", partial(plot_breakaway, findings), "Before it slips, and while it slides",
                   "Where the contact bears more before it slips than while it slides, its friction falls as slip "
                   "begins; bars are 95 % intervals.")
        )  # fmt: skip
    if findings.transition is not None:
        plates.append(
            plate("transition", partial(plot_transition_speed, findings.transition), "From holding to sliding",
                   "The mean friction after a turn against the velocity: it grows with the contact's give, and slides "
                   "from the transition speed on. Bands are 95 % intervals of each way to find that speed.")
        )  # fmt: skip
    events = findings.sticks.events if findings.sticks is not None else ()
    if any(event.kind == "microslip" for event in events):
        plates.append(
            plate("micro-slips", partial(plot_micro_slips, findings), "Inside one stick",
                   "The mass rings on its contact when it comes to rest, and slips a little again where the ring is "
                   "more than the contact bears.")
        )  # fmt: skip
    compared = findings.comparison
    if compared is not None and (_is_fused(findings) or compared.unlike):
        plates.append(
            plate("force-comparison", partial(plot_force_comparison, compared), "The force felt and the force computed",
                   "Both forces over time, their size in each band, and their ratio: above the frequency up to which "
                   "they agree, the mounts of the sensors swing.")
        )  # fmt: skip
    if findings.trial is not None:
        plates.append(
            plate("twin", partial(plot_twin, findings.trial, record=close_up(findings)), "The record and its twin",
                  "Above the displacement as measured and as the rig believed in moves; below what is left. Where that "
                  "is more than noise, the rig is not of this kind.")
        )  # fmt: skip
    if findings.consistency is not None and findings.consistency.failed:
        plates.append(
            plate("consistency", partial(plot_consistency, findings.consistency), "What can not all be true",
                   "Two sides of each check, and how far they are apart; to the right of the dotted line they can not "
                   "be one. The sentences are above.")
        )  # fmt: skip
    return plates


def _is_fused(findings: Findings) -> bool:
    return findings.settings.get("differentiation") in FUSIONS


def _how_it_adds_up(findings: Findings) -> str:
    """What the terms of the balance have to do with the friction that is drawn."""
    if _is_fused(findings):
        return (
            "The other terms are as the sensors read them, with their noise and the ring of their mounts; the friction "
            "is the likeliest one by all sensors together, and not their sum sample by sample."
        )
    return "At every moment the other terms add up to the friction."


def plates_together(comparison: Comparison) -> list[Plate]:
    """The figures of several records."""
    plates = []
    if comparison.coefficient is not None:
        plates.append(
            plate("friction-load", partial(plot_load_dependence, comparison), "Friction against normal load",
                   "Points on a line through the origin mean one coefficient of friction for all records.")
        )  # fmt: skip
    if any(findings.level is not None for findings in comparison.findings):
        plates.append(
            plate("levels", partial(plot_levels, comparison), "Friction of each record",
                   "The sliding friction found in each record, with its 95 % interval.")
        )  # fmt: skip
    return plates
