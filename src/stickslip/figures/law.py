"""Laws that were fitted: how they stand, what was measured over what the best one predicts, and a joint's torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.figures.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    Plate,
    axes_of,
    axis_label,
    captioned,
    envelope,
    legend_above,
    new_figure,
    prefixed,
    styled,
)
from stickslip.law.fit_curve import CurveFit
from stickslip.law.law import LawFit
from stickslip.law.verdict import LawComparison

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.findings import Findings
    from stickslip.cycle.joint import JointFriction
    from stickslip.cycle.joint_logs import JointPrediction

WORDS = {
    "x": ("displacement", "m"), "v": ("velocity", "m/s"), "a": ("acceleration", "m/s^2"), "load": ("load cell", "N"),
    "friction": ("friction", "N"),
}  # fmt: skip
ALONG = {"v": ("velocity", "m/s"), "x": ("displacement", "m"), "t": ("time", "s")}
COLOURS = (BLUE, GREEN, PURPLE, SKY, ORANGE)
CURVE = 200  # points of a line over the speed
SHOWN = 0.4  # s of a record that are drawn: more can not be told apart on a page


def plates_of(joint: JointFriction) -> list[Plate]:
    """The figures of one joint, in reading order."""
    traces = joint.time, joint.measured, joint.explained
    return [
        captioned("joint", "joint-friction", partial(plot_joint, joint)),
        captioned("joint", "joint-torque", partial(plot_torque, *traces, unit=joint.level.unit)),
    ]


def plates_together(logs: Sequence[tuple[Findings, JointPrediction]]) -> list[Plate]:
    """The torque of the log that the others predict worst, and of the one that they predict best."""
    ordered = sorted(logs, key=lambda pair: pair[1].error)
    plates = []
    for place, (log, one) in (("worst", ordered[-1]), ("best", ordered[0])):
        traces, unit = (one.time, one.measured, one.predicted), log.joint.level.unit
        plate = captioned("joint", "joint-predicted", partial(plot_torque, *traces, unit=unit, label="by the others"))
        plates.append(replace(plate, name=f"{plate.name}-{place}", title=f"{plate.title} {place}: {log.name}"))
    return plates


@styled
def plot_joint(joint: JointFriction, *, ax: Axes | None = None) -> Axes:
    """Friction over speed while the joint slides, and what is made of it."""
    ax, unit = axes_of(ax), joint.level.unit
    ax.plot(joint.speed, joint.friction, ".", color=BLUE, markersize=3, alpha=0.5, label="while it slides")
    under_load = joint.load.value * joint.carried if joint.load is not None and joint.load.known else 0.0
    ways = ((-1, joint.back, joint.viscous_back), (1, joint.forward, joint.viscous_forward))
    for side, coulomb, viscous in ways:
        speed = np.linspace(0, side * np.abs(joint.speed).max(), CURVE)
        friction = side * (coulomb.value + under_load) + (viscous or joint.viscous).value * speed
        if joint.static is not None and joint.stribeck_speed is not None and joint.exponent is not None:
            near = np.exp(-((np.abs(speed) / joint.stribeck_speed.value) ** joint.exponent))
            friction = friction + side * (joint.static.value - joint.level.value) * near
        ax.plot(speed, friction, color=ORANGE, linewidth=1.6, label="under the mean load" if side > 0 else None)
    ax.axhline(0.0, color=INK, linewidth=0.6)
    ax.set(xlabel=f"speed [{'rad/s' if unit == 'N m' else 'm/s'}]", ylabel=f"friction [{unit}]")
    legend_above(ax, columns=2)
    return ax


@styled
def plot_torque(
    time: Array, measured: Array, model: Array, *, unit: str, label: str = "explained", ax: Axes | None = None
) -> Axes:
    """The torque while the joint slides, and what is made of it."""
    ax, what = axes_of(ax), "torque" if unit == "N m" else "force"
    ax.plot(time, measured, ".", color=BLUE, markersize=3, label=f"{what}, smoothed")
    ax.plot(time, model, ".", color=ORANGE, markersize=2, label=label)
    ax.set(xlabel="time [s]", ylabel=f"{what} [{unit}]")
    legend_above(ax, columns=2)
    return ax


@styled
def plot_laws(comparison: LawComparison, *, ax: Axes | None = None) -> Axes:
    """The misfit of each law over the least that any law leaves, and which laws are rejected."""
    from matplotlib.ticker import NullFormatter

    standings = [candidate.standing for candidate in comparison.candidates]
    ax, places = axes_of(ax, height=1.3 + 0.32 * len(standings)), np.arange(len(standings))
    for kept, colour, label in ((True, BLUE, "not rejected"), (False, FAINT, "rejected")):
        rows = [j for j, standing in enumerate(standings) if standing.kept == kept]
        if rows:
            ax.plot([standings[j].misfit for j in rows], places[rows], "o", color=colour, markersize=7, label=label)
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_yticks(places, [law.name for law in standings])
    ax.set_ylim(len(standings) - 0.4, -0.6)
    ax.set_xlabel("misfit, over the least that any law leaves")
    legend_above(ax, columns=2)
    return ax


@styled
def plot_fit(result: LawComparison | LawFit, *, record: int = 0) -> Figure:
    """What was measured, what the fitted or best law predicts, and what is left, over the first part of a record."""
    fit = result.fit if isinstance(result, LawComparison) else result
    name_of_law = result.best.name if isinstance(result, LawComparison) else type(fit.law).__name__
    traces = fit.traces[record]
    names = list(traces.measured)
    figure, axes = new_figure(len(names) + 1, height=1.6 * len(names) + 1.8)
    below = axes[-1]
    for ax, name, colour in zip(axes, names, COLOURS, strict=False):
        time, measured, fitted = traces.time[name], traces.measured[name], traces.fitted[name]
        near = time <= time[0] + SHOWN
        quantity, unit = WORDS.get(name, (name, ""))
        factor, unit = prefixed(measured[near] - measured[near].mean(), unit)
        ax.plot(*envelope(time[near], factor * measured[near]), color=INK, linewidth=1.4, label="measured")
        label = f"fitted: {name_of_law}"
        ax.plot(*envelope(time[near], factor * fitted[near]), color=ORANGE, linewidth=1.0, linestyle="--", label=label)
        ax.set_ylabel(axis_label(quantity, unit, "\n"))
        residual = (measured - fitted)[near] / fit.noise[name]
        below.plot(*envelope(time[near], residual), color=colour, linewidth=0.8, label=quantity)
    legend_above(axes[0], columns=2)
    below.axhline(0, color=FAINT, linewidth=0.8)
    below.set(xlabel="time [s]", ylabel="left over,\ntimes the noise")
    legend_above(below, columns=len(names), borderaxespad=0.1)
    figure.align_ylabels(list(axes))
    return figure


@styled
def plot_curve(fit: CurveFit, *, ax: Axes | None = None) -> Axes:
    """A measured friction and the fitted curve."""
    ax = axes_of(ax)
    label, unit = ALONG[fit.along]
    factor, unit = prefixed(fit.at, unit)
    order = np.argsort(fit.at, kind="stable") if fit.along == "v" else np.arange(len(fit.at))
    force, force_unit = prefixed(fit.measured, fit.unit)
    ax.plot(factor * fit.at, force * fit.measured, ".", color=FAINT, markersize=2, label="measured", rasterized=True)
    at, fitted = factor * fit.at[order], force * fit.fitted[order]
    if fit.along == "v" and at[0] < 0 < at[-1]:  # the curve of neither direction goes through zero
        middle = int(np.searchsorted(at, 0.0))
        at, fitted = np.insert(at, middle, 0.0), np.insert(fitted, middle, np.nan)
    ax.plot(at, fitted, color=ORANGE, linewidth=1.4, label=f"fitted: {fit.curve}")
    quantity = "coefficient of friction" if fit.unit == "1" else "friction"
    ax.set(xlabel=axis_label(label, unit), ylabel=axis_label(quantity, force_unit))
    legend_above(ax, columns=2)
    return ax


def law_plates(result: LawComparison | LawFit | CurveFit) -> list[Plate]:
    """The figures of a fit, in reading order."""
    if isinstance(result, CurveFit):
        return [captioned("law", "curve", partial(plot_curve, result))]
    plates = []
    if isinstance(result, LawComparison) and len(result.candidates) > 1:
        plates.append(captioned("law", "laws", partial(plot_laws, result)))
    count = len(result.fit.traces if isinstance(result, LawComparison) else result.traces)
    for record in range(count):
        draw, of = partial(plot_fit, result, record=record), f", record {record + 1} of {count}" if count > 1 else ""
        plates.append(captioned("law", "fit", draw, name=f"fit-{record + 1}", of=of))
    return plates
