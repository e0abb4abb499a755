"""The regression of a force: measured, explained, left over."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.plot.style import (
    FAINT,
    INK,
    ORANGE,
    PURPLE,
    axis_label,
    envelope,
    legend_above,
    new_figure,
    prefixed,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip.answers.findings import Findings


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
