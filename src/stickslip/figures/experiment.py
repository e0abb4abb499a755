"""A planned experiment: how far off each answer is, against the sampling rate, for each choice of sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.figures.style import (
    BLUE,
    FAINT,
    GREEN,
    ORANGE,
    PURPLE,
    axis_label,
    new_figure,
    plain_decades,
    prefixed,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip.answers.experiment import ExperimentPlan

COLOURS = (BLUE, ORANGE, GREEN, PURPLE)
MARKS = ("o", "s", "^", "D")


@styled
def plot_plan(plan: ExperimentPlan) -> Figure:
    """What each sampling rate and choice of sensors can tell, one panel a question.

    Parameters
    ----------
    plan : ExperimentPlan
        From :func:`~stickslip.answers.plan_experiment`.

    Returns
    -------
    Figure

    Examples
    --------
    >>> import stickslip as ss
    >>> drive = ss.drives.HarmonicBase(0.01, frequency=1)
    >>> slider = ss.Oscillator(mass=1, stiffness=100, law=ss.laws.Coulomb(0.2), drive=drive)
    >>> plan = ss.answers.plan_experiment(ss.simulate(slider, cycles=8), rates=[250], draws=1)
    >>> len(plot_plan(plan).axes)
    3
    """
    from matplotlib.ticker import NullFormatter

    figure, panels = new_figure(len(plan.questions), height=0.6 + 1.5 * len(plan.questions))
    choices = list(dict.fromkeys(setup.sensors for setup in plan.setups))
    for panel, question in zip(np.atleast_1d(panels), plan.questions, strict=True):
        unit = plan.setups[0].accuracy[question].unit
        factor, text = prefixed(np.array([setup.accuracy[question].error for setup in plan.setups]), unit)
        for number, sensors in enumerate(choices):
            errors = {s.fs: s.accuracy[question].error for s in plan.setups if s.sensors == sensors}
            style = {"color": COLOURS[number % 4], "marker": MARKS[number % 4], "markersize": 7 - 1.5 * number}
            panel.plot(list(errors), factor * np.array(list(errors.values())), label=", ".join(sensors), **style)
        panel.set(xscale="log", yscale="log", ylabel=axis_label("rms error" if plan.draws > 1 else "error", text))
        plain_decades(panel.yaxis)
        panel.set_title(question, loc="left")
        panel.grid(visible=True, which="minor", color=FAINT, alpha=0.15)
    panel.set_xticks(sorted({setup.fs for setup in plan.setups}))
    panel.xaxis.set_major_formatter("{x:g}")
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.set_xlabel(axis_label("sampling rate", "Hz"))
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2)
    return figure
