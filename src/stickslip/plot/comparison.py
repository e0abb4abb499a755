"""Records side by side: friction per record, and against the normal load."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.plot.style import BLUE, INK, ORANGE, axes_of, axis_label, prefixed, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stickslip.answers.comparison import Comparison


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
            x_factor * reach, y_factor * low * reach, y_factor * high * reach, color=ORANGE, alpha=0.18, linewidth=0,
            label="95 % band",
        )  # fmt: skip
        ax.plot(
            x_factor * reach, y_factor * comparison.coefficient.value * reach, color=ORANGE,
            label=f"friction = {comparison.coefficient.value:.3g} × normal load",
        )  # fmt: skip
    ax.errorbar(
        x_factor * loads, y_factor * values, yerr=y_factor * np.abs(ends - values[:, None]).T,
        fmt="o", color=INK, capsize=3, markersize=5, label="records, 95 %",
    )  # fmt: skip
    ax.set(xlabel=axis_label("normal load", x_unit), ylabel=axis_label("sliding friction", y_unit))
    ax.set_xlim(left=0)
    ax.set_ylim(0, 1.4 * y_factor * float(ends.max()))
    ax.legend(loc="upper left")
    return ax
