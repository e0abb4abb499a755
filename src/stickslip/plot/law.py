"""Fitted laws: how they stand against each other, and what is measured over what the best one predicts."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from stickslip.law.fit_curve import CurveFit
from stickslip.law.law import LawFit
from stickslip.law.which_law import LawComparison
from stickslip.plot.plate import Plate, plate
from stickslip.plot.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    axes_of,
    axis_label,
    envelope,
    new_figure,
    prefixed,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WORDS = {
    "x": ("displacement", "m"), "v": ("velocity", "m/s"), "a": ("acceleration", "m/s^2"), "load": ("load cell", "N"),
    "friction": ("friction", "N"),
}  # fmt: skip
ALONG = {"v": ("velocity", "m/s"), "x": ("displacement", "m"), "t": ("time", "s")}
COLOURS = (BLUE, GREEN, PURPLE, SKY, ORANGE)
SHOWN = 0.4  # s of a record that are drawn: more can not be told apart on a page


@styled
def plot_laws(comparison: LawComparison, *, ax: Axes | None = None) -> Axes:
    """The misfit of each law over the least that any law leaves, and which laws are rejected.

    Parameters
    ----------
    comparison : LawComparison
        What :func:`~stickslip.compare_laws` returned.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
    """
    from matplotlib.ticker import FuncFormatter, NullFormatter

    told = [each.standing for each in comparison.candidates]
    ax, places = axes_of(ax, height=1.3 + 0.32 * len(told)), np.arange(len(told))
    for kept, colour, words in ((True, BLUE, "not rejected"), (False, FAINT, "rejected")):
        rows = [j for j, each in enumerate(told) if each.kept == kept]
        if rows:
            ax.plot([told[j].misfit for j in rows], places[rows], "o", color=colour, markersize=7, label=words)
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_yticks(places, [each.name for each in told])
    ax.set_ylim(len(told) - 0.4, -0.6)
    ax.set_xlabel("misfit, over the least that any law leaves")
    ax.legend(ncols=2, loc="lower left", bbox_to_anchor=(0, 1))
    return ax


@styled
def plot_fit(found: LawComparison | LawFit, *, record: int = 0) -> Figure:
    """What was measured, what the fitted or best law predicts, and what is left, over the first part of a record.

    Parameters
    ----------
    found : LawComparison or LawFit
        What :func:`~stickslip.compare_laws` or :func:`~stickslip.fit_law` returned.
    record : int
        Which of several records, from 0.

    Returns
    -------
    Figure
    """
    fit = found.fit if isinstance(found, LawComparison) else found
    name_of_law = found.best.name if isinstance(found, LawComparison) else type(fit.law).__name__
    traces = fit.traces[record]
    names = list(traces.measured)
    figure, axes = new_figure(len(names) + 1, height=1.6 * len(names) + 1.8)
    below = axes[-1]
    for ax, name, colour in zip(axes, names, COLOURS, strict=False):
        time, measured, fitted = traces.time[name], traces.measured[name], traces.fitted[name]
        near = time <= time[0] + SHOWN
        words, unit = WORDS.get(name, (name, ""))
        factor, unit = prefixed(measured[near] - measured[near].mean(), unit)
        ax.plot(*envelope(time[near], factor * measured[near]), color=INK, linewidth=1.4, label="measured")
        ax.plot(
            *envelope(time[near], factor * fitted[near]),
            color=ORANGE,
            linewidth=1.0,
            linestyle="--",
            label=f"fitted: {name_of_law}",
        )
        ax.set_ylabel(axis_label(words, unit, "\n"))
        left = (measured - fitted)[near] / fit.noise[name]
        below.plot(*envelope(time[near], left), color=colour, linewidth=0.8, label=words)
    axes[0].legend(ncols=2, loc="lower left", bbox_to_anchor=(0, 1))
    below.axhline(0, color=FAINT, linewidth=0.8)
    below.set(xlabel="time [s]", ylabel="left over,\ntimes the noise")
    below.legend(ncols=len(names), loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.1)
    figure.align_ylabels(list(axes))
    return figure


@styled
def plot_curve(found: CurveFit, *, ax: Axes | None = None) -> Axes:
    """A measured friction and the fitted curve.

    Parameters
    ----------
    found : CurveFit
        What :func:`~stickslip.fit_curve` returned.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
    """
    ax = axes_of(ax)
    words, unit = ALONG[found.along]
    factor, unit = prefixed(found.at, unit)
    order = np.argsort(found.at, kind="stable") if found.along == "v" else np.arange(len(found.at))
    force, force_unit = prefixed(found.measured, found.unit)
    ax.plot(
        factor * found.at, force * found.measured, ".", color=FAINT, markersize=2, label="measured", rasterized=True
    )
    at, fitted = factor * found.at[order], force * found.fitted[order]
    if found.along == "v" and at[0] < 0 < at[-1]:  # the curve of neither direction goes through zero
        middle = int(np.searchsorted(at, 0.0))
        at, fitted = np.insert(at, middle, 0.0), np.insert(fitted, middle, np.nan)
    ax.plot(at, fitted, color=ORANGE, linewidth=1.4, label=f"fitted: {found.curve}")
    said = "coefficient of friction" if found.unit == "1" else "friction"
    ax.set(xlabel=axis_label(words, unit), ylabel=axis_label(said, force_unit))
    ax.legend(ncols=2, loc="lower left", bbox_to_anchor=(0, 1))
    return ax


def law_plates(result: LawComparison | LawFit | CurveFit) -> list[Plate]:
    """The figures of a fit, in reading order."""
    if isinstance(result, CurveFit):
        return [
            plate(
                "curve",
                partial(plot_curve, result),
                "Measured and fitted",
                "The curve over all samples that were used.",
            )
        ]
    told = (
        "Mean square of what a law leaves over the least that any law leaves, the mean over channels and records. "
        "Diamonds: each record predicted by a fit to the others, over what the best law leaves so."
    )
    plates = []
    if isinstance(result, LawComparison) and len(result.candidates) > 1:
        plates.append(plate("laws", partial(plot_laws, result), "How the laws stand", told))
    count = len(result.fit.traces if isinstance(result, LawComparison) else result.traces)
    for record in range(count):
        title = "Measured and fitted" + (f", record {record + 1} of {count}" if count > 1 else "")
        words = "Top: each sensor, and what it would have read of the fitted law. Bottom: what is left between them."
        plates.append(plate(f"fit-{record + 1}", partial(plot_fit, result, record=record), title, words))
    return plates
