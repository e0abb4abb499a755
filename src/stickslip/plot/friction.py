"""Which figures a record's friction is worth, each with a title and a caption in plain words.

Beside those of rooms of their own: what a regression explains of a force, what can not all be true, and records side by
side.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from stickslip.answers.findings import Comparison, Findings
from stickslip.balance.force import FUSIONS
from stickslip.consistent.checks import APART
from stickslip.estimate import UNSTATED, kinds
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
from stickslip.plot.style import (
    BLUE,
    FAINT,
    INK,
    ORANGE,
    PURPLE,
    axes_of,
    axis_label,
    envelope,
    legend_above,
    new_figure,
    prefixed,
    styled,
)
from stickslip.plot.traces import MOST_SHADES, close_up, force_balance, plot_force_balance, plot_traces
from stickslip.plot.twin import plot_twin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.consistent.contradictions import Consistency

COLOURS = {"holds": BLUE, "fails": ORANGE, "can not be told": FAINT}


def plates_of(findings: Findings) -> list[Plate]:
    """The figures of one record, in reading order."""
    events = findings.sticks.events if findings.sticks is not None else ()
    sticks = [event for event in events if event.kind == "stick"]
    plates = [*_of_friction(findings), *_over_time(findings, sticks=len(sticks)), *_of_contact(findings)]
    if any(event.whole for event in sticks):
        plates.append(
            plate(
                "sticks",
                partial(plot_sticks, findings),
                "How long it sticks and slips",
                "Each mark is one whole stretch of sticking or slipping; the bars count how often each duration "
                "occurred.",
            )
        )
    return plates


def _of_friction(findings: Findings) -> list[Plate]:
    """Friction over the cycle, and the force that the regression explains."""
    plates = []
    if findings.loops is not None:
        plates += [
            plate(
                "friction-velocity",
                partial(plot_velocity_loop, findings),
                "Friction against velocity",
                "Dry friction is a step: about the same force (dotted) at every speed, against the motion. A slope to "
                "either side is friction that changes with speed; points between the levels at zero velocity are the "
                "sticking contact, which bears any force up to the level.",
            ),
            plate(
                "friction-displacement",
                partial(plot_displacement_loop, findings),
                "Friction against displacement",
                "One turn is one cycle and its area is the work lost to friction. Flat top and bottom: sliding. Steep "
                "sides: the contact sticks, and their slope is the contact's own stiffness. The band is the scatter "
                "between cycles.",
            ),
        ]
    if findings.regression is not None:
        plates.append(
            plate(
                "regression",
                partial(plot_regression, findings),
                "Does the friction model explain the force?",
                "Top: the measured force and the force that inertia, viscous and dry friction together give. Bottom: "
                "what is left over; a pattern there is friction that the model does not hold.",
            )
        )
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
            plate(
                "close-up",
                partial(plot_traces, findings, record=near),
                "A closer look",
                f"A few cycles from the middle of the record.{stuck}",
            )
        )
    if force_balance(findings.record) is not None:
        plates.append(
            plate(
                "force-balance",
                partial(plot_force_balance, findings, record=near),
                "Where the friction force comes from",
                f"{_how_it_adds_up(findings)}{stuck}",
            )
        )
    return plates


def _of_contact(findings: Findings) -> list[Plate]:
    """What the contact does at a turn and before it slips, and what the sensors say of each other."""
    plates, found = [], findings.breakaway
    if found is not None and findings.loops is not None and UNSTATED not in kinds(found.ratio.status):
        plates.append(
            plate(
                "breakaway",
                partial(plot_breakaway, findings),
                "Before it slips, and while it slides",
                "Where the contact bears more before it slips than while it slides, its friction falls as slip "
                "begins; bars are 95 % intervals.",
            )
        )
    if findings.transition is not None:
        plates.append(
            plate(
                "transition",
                partial(plot_transition_speed, findings.transition),
                "From holding to sliding",
                "The mean friction after a turn against the velocity: it grows with the contact's give, and slides "
                "from the transition speed on. Bands are 95 % intervals of each way to find that speed.",
            )
        )
    events = findings.sticks.events if findings.sticks is not None else ()
    if any(event.kind == "microslip" for event in events):
        plates.append(
            plate(
                "micro-slips",
                partial(plot_micro_slips, findings),
                "Inside one stick",
                "The mass rings on its contact when it comes to rest, and slips a little again where the ring is "
                "more than the contact bears.",
            )
        )
    compared = findings.comparison
    if compared is not None and (_is_fused(findings) or compared.unlike):
        plates.append(
            plate(
                "force-comparison",
                partial(plot_force_comparison, compared),
                "The force felt and the force computed",
                "Both forces over time, their size in each band, and their ratio: above the frequency up to which "
                "they agree, the mounts of the sensors swing.",
            )
        )
    if findings.trial is not None:
        plates.append(
            plate(
                "twin",
                partial(plot_twin, findings.trial, record=close_up(findings)),
                "The record and its twin",
                "Above the displacement as measured and as the rig believed in moves; below what is left. Where that "
                "is more than noise, the rig is not of this kind.",
            )
        )
    if findings.consistency is not None and findings.consistency.failed:
        plates.append(
            plate(
                "consistency",
                partial(plot_consistency, findings.consistency),
                "What can not all be true",
                "Two sides of each check, and how far they are apart; to the right of the dotted line they can not "
                "be one. The sentences are above.",
            )
        )
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
            plate(
                "friction-load",
                partial(plot_load_dependence, comparison),
                "Friction against normal load",
                "Points on a line through the origin mean one coefficient of friction for all records.",
            )
        )
    if any(findings.level is not None for findings in comparison.findings):
        plates.append(
            plate(
                "levels",
                partial(plot_levels, comparison),
                "Friction of each record",
                "The sliding friction found in each record, with its 95 % interval.",
            )
        )
    return plates


@styled
def plot_regression(findings: Findings) -> Figure:
    """The measured force, the force that the regression explains, and the rest, over time.

    Parameters
    ----------
    findings : Findings
        With a regression.

    Returns
    -------
    Figure
    """
    regression = findings.regression
    assert regression is not None
    factor, unit = prefixed(regression.measured, regression.coulomb.unit)
    figure, (above, below) = new_figure(2, height=4.4, heights=[2, 1])
    time = regression.time
    above.plot(*envelope(time, factor * regression.measured), color=PURPLE, linewidth=1.0, label="measured")
    above.plot(*envelope(time, factor * regression.explained), color=ORANGE, linewidth=1.0, label="explained")
    above.set_ylabel(axis_label("force", unit))
    legend_above(above, columns=2)
    below.plot(*envelope(time, factor * (regression.measured - regression.explained)), color=INK, linewidth=0.8)
    below.axhline(0, color=FAINT, linewidth=0.8)
    below.set(xlabel="time [s]", ylabel=axis_label("left over", unit))
    span = 1.05 * factor * float(np.nanmax(np.abs(regression.measured)))
    below.set_ylim(-span / 2, span / 2)
    figure.align_ylabels([above, below])
    return figure


LEAST, MOST = 0.1, 1e3  # standard deviations between which the bars are drawn


@styled
def plot_consistency(found: Consistency, *, ax: Axes | None = None) -> Axes:
    """How far are the two sides of each check apart? In standard deviations; from three on they are not one.

    Parameters
    ----------
    found : Consistency
        From :func:`~stickslip.consistent.consistency`.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import stickslip as ss
    >>> row = {"mass": 2.42, "stiffness": 2310, "forcing frequency": 5.61, "base amplitude": "0.51 mm",
    ...        "amplitude": "0.49 mm", "sliding friction": "1.06 N"}
    >>> [label.get_text() for label in plot_consistency(ss.consistent.consistency(row)).get_yticklabels()][0]
    'energy'
    """
    checks = found.checks
    ax = axes_of(ax, height=0.8 + 0.26 * len(checks))
    for place, check in enumerate(checks):
        apart = check.discrepancy if not math.isnan(check.discrepancy) else 0.0
        colour, told = COLOURS[check.verdict], check.verdict != "can not be told"
        ax.barh(place, min(max(apart, 1.2 * LEAST), MOST) if told else 0.0, color=colour, height=0.6)
        words = check.verdict if told else "can not be told"
        ax.annotate(
            words,
            (1.0, place),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=7,
            color=colour if check.verdict == "fails" else INK,
        )
    ax.axvline(APART, color=INK, linewidth=1.0, linestyle=":")
    ax.set(xscale="log", xlim=(LEAST, MOST), xlabel="standard deviations apart")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_yticks(range(len(checks)), [check.name for check in checks])
    ax.invert_yaxis()
    ax.grid(visible=False, axis="y")
    return ax


@styled
def plot_levels(comparison: Comparison, *, ax: Axes | None = None) -> Axes:
    """The friction level of each record with its 95 % interval.

    Parameters
    ----------
    comparison : Comparison
        What to draw.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
    """
    rows = [(findings.name, findings.level) for findings in comparison.findings if findings.level is not None]
    ax = axes_of(ax, height=1.2 + 0.32 * len(rows))
    values = np.array([level.value for _, level in rows])
    ends = np.array([level.interval for _, level in rows])
    factor, unit = prefixed(values, rows[0][1].unit)
    places = np.arange(len(rows))
    ax.errorbar(
        factor * values,
        places,
        xerr=factor * np.abs(ends - values[:, None]).T,
        fmt="o",
        color=BLUE,
        capsize=3,
        markersize=5,
    )
    ax.set_yticks(places, [name if len(name) < 44 else f"{name[:41]}..." for name, _ in rows])
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.set(xlabel=axis_label("sliding friction, 95 %", unit))
    ax.set_xlim(left=0)
    return ax


@styled
def plot_load_dependence(comparison: Comparison, *, ax: Axes | None = None) -> Axes:
    """Friction against normal load, with the line through the origin and its 95 % band.

    Parameters
    ----------
    comparison : Comparison
        With a fitted coefficient.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
    """
    ax = axes_of(ax)
    known = [(f.normal, f.level) for f in comparison.findings if f.normal is not None and f.level is not None]
    loads = np.array([load for load, _ in known])
    values = np.array([level.value for _, level in known])
    ends = np.array([level.interval for _, level in known])
    x_factor, x_unit = prefixed(loads, "N")
    y_factor, y_unit = prefixed(values, "N")
    if comparison.coefficient is not None:
        reach = np.array([0.0, 1.1 * loads.max()])
        low, high = comparison.coefficient.interval
        ax.fill_between(
            x_factor * reach,
            y_factor * low * reach,
            y_factor * high * reach,
            color=ORANGE,
            alpha=0.18,
            linewidth=0,
            label="95 % band",
        )
        ax.plot(
            x_factor * reach,
            y_factor * comparison.coefficient.value * reach,
            color=ORANGE,
            label=f"friction = {comparison.coefficient.value:.3g} × normal load",
        )
    ax.errorbar(
        x_factor * loads,
        y_factor * values,
        yerr=y_factor * np.abs(ends - values[:, None]).T,
        fmt="o",
        color=INK,
        capsize=3,
        markersize=5,
        label="records, 95 %",
    )
    ax.set(xlabel=axis_label("normal load", x_unit), ylabel=axis_label("sliding friction", y_unit))
    ax.set_xlim(left=0)
    ax.set_ylim(0, 1.4 * y_factor * float(ends.max()))
    ax.legend(loc="upper left")
    return ax
