"""At the rig: what a planned experiment can tell; calibrations, and the frequency response with its model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.figures.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
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
    from stickslip.bench.calibration import Calibration
    from stickslip.bench.response import ModalFit


COLOURS, MARKS = (BLUE, ORANGE, GREEN, PURPLE), ("o", "s", "^", "D")


@styled
def plot_calibrations(calibrations: Mapping[str, Calibration]) -> Figure:
    """How far each sensor is off the straight line through its levels, as a part of its range.

    Examples
    --------
    >>> from stickslip import Record, bench
    >>> read = np.repeat([0.0, 1.0, 2.0, 3.0], 500) + 0.01 * np.random.default_rng(1).standard_normal(2000)
    >>> calibration = bench.calibrate(Record.of({"load": read}, fs=500), channel="load", reference=[0, 1, 2, 3])
    >>> len(plot_calibrations({"load": calibration}).axes)
    1
    """
    figure, ax = new_figure(height=3.0)
    for number, (name, calibration) in enumerate(calibrations.items()):
        line = calibration.gain.value * calibration.reference
        off = calibration.levels - line
        off = 100 * (off - off.mean()) / np.ptp(line)
        style: Any = {"color": COLOURS[number % 4], "marker": MARKS[number % 4], "linestyle": "none"}
        ax.plot(np.arange(1, len(off) + 1) + 0.08 * number, off, label=name, **style)
    ax.axhline(0.0, color=INK, linewidth=0.8)
    ax.set(xlabel="level, in the order of the record", ylabel=axis_label("off the line", "% of range"))
    ax.legend(ncols=4, loc="lower left", bbox_to_anchor=(0, 1))
    return figure


@styled
def plot_response(fit: ModalFit) -> Figure:
    """The frequency response: H1, H2, the fitted oscillator, and the coherence.

    Examples
    --------
    >>> from stickslip import bench
    >>> sweep = bench.SimulatedBench(fs=500).record("sweep")
    >>> len(plot_response(bench.modal_fit(sweep, mass=2.42)).axes)
    2
    """
    response = fit.response
    assert response is not None
    figure, (above, below) = new_figure(2, height=4.2, heights=[3, 1])
    f = response.frequency
    above.plot(f, np.abs(response.h1), color=BLUE, label="H1, averaged")
    above.plot(f, np.abs(response.h2), color=ORANGE, linestyle=":", label="H2, averaged")
    above.plot(f, np.abs(fit.model(f)), color=INK, linewidth=0.9, label="fitted oscillator")
    above.set_yscale("log")
    plain_decades(above.yaxis)
    unit = "1" if response.channels[0] == "z" else "m/N"
    above.set_ylabel(axis_label(f"{response.channels[1]} over {response.channels[0]}", unit))
    above.legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    below.plot(f, response.coherence, color=GREEN)
    below.set(ylim=(0, 1.05), ylabel="coherence", xlabel=axis_label("frequency", "Hz"))
    return figure


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
