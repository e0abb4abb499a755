"""What can not all be true of a record: every check, and how far its two sides are apart."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from stickslip.consistent.checks import APART
from stickslip.plot.style import BLUE, FAINT, INK, ORANGE, axes_of, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stickslip.consistent.contradictions import Consistency

LEAST, MOST = 0.1, 1e3  # standard deviations between which the bars are drawn
COLOURS = {"holds": BLUE, "fails": ORANGE, "can not be told": FAINT}


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
            words, (1.0, place), xycoords=("axes fraction", "data"), xytext=(4, 0), textcoords="offset points",
            va="center", fontsize=7, color=colour if check.verdict == "fails" else INK,
        )  # fmt: skip
    ax.axvline(APART, color=INK, linewidth=1.0, linestyle=":")
    ax.set(xscale="log", xlim=(LEAST, MOST), xlabel="standard deviations apart")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_yticks(range(len(checks)), [check.name for check in checks])
    ax.invert_yaxis()
    ax.grid(visible=False, axis="y")
    return ax
