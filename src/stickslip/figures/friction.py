"""Which figures a record's friction is worth, each with a title and a caption in plain words.

Beside those of rooms of their own: what a regression explains of a force, what can not all be true, and records side by
side, hundreds too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.answers.findings import Comparison, Findings
from stickslip.answers.many import Batch, Row
from stickslip.balance.force import FUSIONS
from stickslip.consistent.checks import APART
from stickslip.estimate import UNSTATED, Estimate, kinds
from stickslip.figures import style
from stickslip.figures.contact import (
    plot_breakaway,
    plot_displacement_loop,
    plot_micro_slips,
    plot_sticks,
    plot_transition_speed,
    plot_velocity_loop,
)
from stickslip.figures.style import BARS, BLUE, FAINT, INK, ORANGE, PURPLE, SKY
from stickslip.figures.traces import (
    MOST_SHADES,
    close_up,
    force_balance,
    plot_force_balance,
    plot_force_comparison,
    plot_traces,
    plot_twin,
)
from stickslip.units import prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.consistent.contradictions import Consistency

COLOURS = {"holds": BLUE, "fails": ORANGE, "can not be told": FAINT}


def plates_of(findings: Findings) -> list[style.Plate]:
    """The figures of one record, in reading order."""
    findings = findings.drawn
    events = findings.sticks.events if findings.sticks is not None else ()
    sticks = [event for event in events if event.kind == "stick"]
    plates = [*_of_friction(findings), *_over_time(findings, sticks=len(sticks)), *_of_contact(findings)]
    if any(event.whole for event in sticks):
        uncorrected = _before_twins(findings)
        plates.append(style.captioned("friction", "sticks", partial(plot_sticks, findings), uncorrected=uncorrected))
    return plates


def _before_twins(findings: Findings) -> str:
    """That drawn sticks are those read off the record, where the table's share is corrected by twins."""
    if findings.trial is None:
        return ""
    stuck = sum(event.duration for event in findings.sticks.events if event.kind == "stick")
    share = 100 * stuck / findings.record.duration
    return f", as read off the record: {share:.0f} % of the time, not yet corrected by twins"


def _of_friction(findings: Findings) -> list[style.Plate]:
    """Friction over the cycle, and the force that the regression explains."""
    plates = []
    if findings.loops is not None:
        plates += [
            style.captioned("friction", "friction-velocity", partial(plot_velocity_loop, findings)),
            style.captioned("friction", "friction-displacement", partial(plot_displacement_loop, findings)),
        ]
    if findings.regression is not None:
        plates.append(style.captioned("friction", "regression", partial(plot_regression, findings)))
    return plates


def _over_time(findings: Findings, *, sticks: int) -> list[style.Plate]:
    """The record as a whole, some cycles of it, and the force balance in them."""
    near = close_up(findings)
    stuck = f" Grey: the contact sticks{_before_twins(findings)}." if sticks else ""
    shaded = stuck if sticks <= MOST_SHADES else ""
    plates = [style.captioned("friction", "record", partial(plot_traces, findings), stuck=shaded)]
    if near is not None:
        plates.append(style.captioned("friction", "close-up", partial(plot_traces, findings, record=near), stuck=stuck))
    if force_balance(findings.record) is not None:
        kind = "force-balance-fused" if _is_fused(findings) else "force-balance"
        draw = partial(plot_force_balance, findings, record=near)
        plates.append(style.captioned("friction", kind, draw, name="force-balance", stuck=stuck))
    return plates


def _of_contact(findings: Findings) -> list[style.Plate]:
    """What the contact does at a turn and before it slips, and what the sensors say of each other."""
    plates, breakaway = [], findings.breakaway
    if breakaway is not None and findings.loops is not None and UNSTATED not in kinds(breakaway.ratio.status):
        plates.append(style.captioned("friction", "breakaway", partial(plot_breakaway, findings)))
    if findings.transition is not None:
        plates.append(style.captioned("friction", "transition", partial(plot_transition_speed, findings.transition)))
    events = findings.sticks.events if findings.sticks is not None else ()
    if any(event.kind == "microslip" for event in events):
        plates.append(style.captioned("friction", "micro-slips", partial(plot_micro_slips, findings)))
    compared = findings.comparison
    if compared is not None and (_is_fused(findings) or compared.unlike):
        plates.append(style.captioned("friction", "force-comparison", partial(plot_force_comparison, compared)))
    if findings.trial is not None:
        draw = partial(plot_twin, findings.trial, record=close_up(findings))
        plates.append(style.captioned("friction", "twin", draw))
    if findings.consistency is not None and findings.consistency.failed:
        plates.append(style.captioned("friction", "consistency", partial(plot_consistency, findings.consistency)))
    return plates


def _is_fused(findings: Findings) -> bool:
    return findings.settings.get("differentiation") in FUSIONS


def plates_together(comparison: Comparison) -> list[style.Plate]:
    """The figures of several records."""
    plates = []
    if comparison.coefficient is not None:
        plates.append(style.captioned("friction", "friction-load", partial(plot_load_dependence, comparison)))
    if any(findings.level is not None for findings in comparison.findings):
        plates.append(style.captioned("friction", "levels", partial(plot_levels, comparison)))
    return plates


@style.styled
def plot_regression(findings: Findings) -> Figure:
    """The measured force, the force that the regression explains, and the rest, over time."""
    regression = findings.regression
    assert regression is not None
    factor, unit = prefixed(regression.measured, regression.coulomb.unit)
    figure, (above, below) = style.new_figure(2, height=4.4, heights=[2, 1])
    time = regression.time
    above.plot(*style.envelope(time, factor * regression.measured), color=PURPLE, linewidth=1.0, label="measured")
    above.plot(*style.envelope(time, factor * regression.explained), color=ORANGE, linewidth=1.0, label="explained")
    above.set_ylabel(style.axis_label("force", unit))
    style.legend_above(above, columns=2)
    below.plot(*style.envelope(time, factor * (regression.measured - regression.explained)), color=INK, linewidth=0.8)
    below.axhline(0, color=FAINT, linewidth=0.8)
    below.set(xlabel="time [s]", ylabel=style.axis_label("left over", unit))
    span = 1.05 * factor * float(np.nanmax(np.abs(regression.measured)))
    below.set_ylim(-span / 2, span / 2)
    figure.align_ylabels([above, below])
    return figure


LEAST, MOST = 0.1, 1e3  # standard deviations between which the bars are drawn


@style.styled
def plot_consistency(consistency: Consistency, *, ax: Axes | None = None) -> Axes:
    """How far are the two sides of each check apart? In standard deviations; from three on they are not one.

    Parameters
    ----------
    consistency : Consistency
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
    checks = consistency.checks
    ax = style.axes_of(ax, height=0.8 + 0.26 * len(checks))
    for place, check in enumerate(checks):
        apart = check.discrepancy if not math.isnan(check.discrepancy) else 0.0
        known, colour = check.verdict != "can not be told", COLOURS[check.verdict]
        ax.barh(place, min(max(apart, 1.2 * LEAST), MOST) if known else 0.0, color=colour, height=0.6)
        ink: Any = {"fontsize": 7, "color": colour if check.verdict == "fails" else INK}
        at: Any = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
        ax.annotate(check.verdict, (1.0, place), xytext=(4, 0), va="center", **at, **ink)
    ax.axvline(APART, color=INK, linewidth=1.0, linestyle=":")
    ax.set(xscale="log", xlim=(LEAST, MOST), xlabel="standard deviations apart")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_yticks(range(len(checks)), [check.name for check in checks])
    ax.invert_yaxis()
    ax.grid(visible=False, axis="y")
    return ax


@style.styled
def plot_levels(comparison: Comparison, *, ax: Axes | None = None) -> Axes:
    """The friction level of each record with its 95 % interval."""
    levels = {findings.name: findings.level for findings in comparison.findings if findings.level is not None}
    ax, _, unit = style.named_intervals(list(levels), list(levels.values()), ax=ax)
    ax.set(xlabel=style.axis_label("sliding friction, 95 %", unit))
    ax.margins(x=0.08)
    return ax


@style.styled
def plot_load_dependence(comparison: Comparison, *, ax: Axes | None = None) -> Axes:
    """Friction against normal load, with the line through the origin and its 95 % band."""
    ax = style.axes_of(ax)
    known = [(f.normal.value, f.level) for f in comparison.findings if f.normal is not None and f.level is not None]
    loads = np.array([load for load, _ in known])
    values = np.array([level.value for _, level in known])
    ends = np.array([level.interval for _, level in known])
    x_factor, x_unit = prefixed(loads, "N")
    y_factor, y_unit = prefixed(values, "N")
    if comparison.coefficient is not None:
        reach, value = np.array([0.0, 1.1 * loads.max()]), comparison.coefficient.value
        low, high = (y_factor * end * reach for end in comparison.coefficient.interval)
        ax.fill_between(x_factor * reach, low, high, color=ORANGE, alpha=0.18, linewidth=0, label="95 % band")
        label = f"friction = {comparison.coefficient.cells[1]} × normal load"
        ax.plot(x_factor * reach, y_factor * value * reach, color=ORANGE, label=label)
    away = y_factor * np.abs(ends - values[:, None]).T
    ax.errorbar(x_factor * loads, y_factor * values, yerr=away, color=INK, label="records, 95 %", **BARS)
    ax.set(xlabel=style.axis_label("normal load", x_unit), ylabel=style.axis_label("sliding friction", y_unit))
    ax.set_xlim(left=0)
    ax.set_ylim(0, 1.4 * y_factor * float(ends.max()))
    ax.legend(loc="upper left")
    return ax


ACROSS, EACH = 8, 64  # small pictures in a row, and in a figure
MOST_PAGES = 4  # figures of them
CROWD = 200  # records whose intervals hide their values unless they are drawn thin
QUANTITIES = 3  # that are drawn over the records
FULL = 40  # letters of a name over a small picture that is read without being cut


def plates_of_batch(batch: Batch) -> list[style.Plate]:
    """The quantities that most records have, then the small pictures."""
    quantities = [_over_records(batch, name) for name in batch.names[:QUANTITIES] if batch.known(name)]
    return [*quantities, *_pictures(batch)]


def _over_records(batch: Batch, name: str) -> style.Plate:
    draw, quantity = partial(plot_over_records, batch.known(name)), f"{name[:1].upper()}{name[1:]}"
    return style.captioned("records", "over-records", draw, name=f"over-records-{name}", quantity=quantity)


@style.styled
def plot_over_records(estimates: Sequence[Estimate], *, ax: Axes | None = None) -> Axes:
    """A quantity of each record with its interval."""
    ax = style.axes_of(ax)
    values = np.array([estimate.value for estimate in estimates])
    factor, unit = prefixed(values, estimates[0].unit)
    ends = np.array([estimate.interval for estimate in estimates])
    lengths = np.where(np.isfinite(ends), np.abs(ends - values[:, None]), 0.0).T
    look: Any = {"fmt": "o", "color": BLUE, "ms": 2, "ecolor": SKY}
    look["elinewidth"] = 0.6 if len(estimates) < CROWD else 0.2
    ax.errorbar(np.arange(1, len(estimates) + 1), factor * values, factor * lengths, **look)
    ax.set_xlabel("record")
    ax.set_ylabel(style.axis_label(estimates[0].name, unit))
    return ax


def _pictures(batch: Batch) -> Iterator[style.Plate]:
    drawn = [row for row in batch.rows if row.counts and len(row.picture[0])]
    for number in range(min(MOST_PAGES, math.ceil(len(drawn) / EACH))):
        part = drawn[number * EACH : (number + 1) * EACH]
        span = f"records {number * EACH + 1} to {number * EACH + len(part)} of {len(drawn)}"
        x, y = batch.axes
        words = {"span": span, "quantity": f"{y[:1].upper()}{y[1:]}", "abscissa": x}
        yield style.captioned("records", "records", partial(plot_small, part), name=f"records-{number + 1}", **words)


@style.styled
def plot_small(rows: Sequence[Row]) -> Figure:
    """Small pictures side by side, without axes: their shapes are what is compared."""
    down = math.ceil(len(rows) / ACROSS)
    figure = style.empty_figure(0.95 * down + 0.3)
    places = figure.subplots(down, ACROSS, squeeze=False)
    for place in places.flat:
        place.set_axis_off()
    for place, row in zip(places.flat, rows, strict=False):
        place.plot(*row.picture, color=BLUE, lw=0.6)
        place.set_title(_short(row.name), fontsize=5, color="0.4", pad=1)
    return figure


def _short(name: str) -> str:
    """The end of a name, which tells files of one series apart."""
    return name if len(name) <= FULL // 2 else f"...{name[-FULL // 2 + 3 :]}"
