"""The model over the record: what was measured, and what the twin would have written without noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.plot.style import BLUE, FAINT, INK, ORANGE, axis_label, legend_above, new_figure, prefixed, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip.record.record import Record
    from stickslip.twin.trial import Trial


@styled
def plot_twin(trial: Trial, *, record: Record | None = None) -> Figure:
    """Does the rig that the record is believed to come from move as the record did?

    Above the measured displacement and the quiet twin's; below what is left, with the share of the motion that the twin
    follows: ``100 (1 - |x - y| / |x - mean x|)``, as a comparison of models is commonly rated.

    Parameters
    ----------
    trial : Trial
        From :func:`~stickslip.tried`: ``findings.trial``.
    record : Record, optional
        The stretch to draw; all of it unless given.

    Returns
    -------
    Figure
    """
    whole = trial.belief.record
    moved = trial.belief.moved
    left = whole["x"] - moved
    left = left - left.mean()
    follows = 100 * (1 - float(np.linalg.norm(left) / np.linalg.norm(whole["x"] - whole["x"].mean())))
    stretch = whole if record is None else record
    shown = (whole.time >= stretch.time[0]) & (whole.time <= stretch.time[-1])
    figure, (above, below) = new_figure(2, height=4.4, heights=(2, 1))
    factor, unit = prefixed(whole["x"][shown], "m")
    above.plot(whole.time[shown], factor * whole["x"][shown], color=BLUE, label="measured")
    above.plot(whole.time[shown], factor * moved[shown], color=ORANGE, ls="--", label=f"twin, follows {follows:.2f} %")
    above.set_ylabel(axis_label("x", unit))
    legend_above(above, columns=2)
    factor, unit = prefixed(left[shown], "m")
    below.plot(whole.time[shown], factor * left[shown], color=INK, lw=0.8)
    below.axhline(0.0, color=FAINT, lw=0.8, zorder=0)
    below.set_ylabel(axis_label("left", unit))
    below.set_xlabel(axis_label("time", "s"))
    return figure
