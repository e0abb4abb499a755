"""What commissioning found, drawn: calibrations, the frequency response with its model, what rang."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.figures.style import BLUE, GREEN, INK, ORANGE, PURPLE, axis_label, new_figure, plain_decades, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip.bench.calibration import Calibration
    from stickslip.bench.response import ModalFit

COLOURS, MARKS = (BLUE, ORANGE, GREEN, PURPLE), ("o", "s", "^", "D")


@styled
def plot_calibrations(found: Mapping[str, Calibration]) -> Figure:
    """How far each sensor is off the straight line through its levels, as a part of its range.

    Examples
    --------
    >>> from stickslip import Record, bench
    >>> read = np.repeat([0.0, 1.0, 2.0, 3.0], 500) + 0.01 * np.random.default_rng(1).standard_normal(2000)
    >>> found = bench.calibrate(Record.of({"load": read}, fs=500), channel="load", reference=[0, 1, 2, 3])
    >>> len(plot_calibrations({"load": found}).axes)
    1
    """
    figure, ax = new_figure(height=3.0)
    for number, (name, each) in enumerate(found.items()):
        zero = each.zero.value if each.zero is not None else 0.0
        span = np.ptp(each.gain.value * each.reference)
        off = 100 * (each.levels - zero - each.gain.value * each.reference) / span
        style: Any = {"color": COLOURS[number % 4], "marker": MARKS[number % 4], "linestyle": "none"}
        ax.plot(np.arange(1, len(off) + 1) + 0.08 * number, off, label=name, **style)
    ax.axhline(0.0, color=INK, linewidth=0.8)
    ax.set(xlabel="level, in the order of the record", ylabel=axis_label("off the line", "% of range"))
    ax.legend(ncols=4, loc="lower left", bbox_to_anchor=(0, 1))
    return figure


@styled
def plot_response(found: ModalFit) -> Figure:
    """The frequency response: H1, H2, the fitted oscillator, and the coherence.

    Examples
    --------
    >>> from stickslip import bench
    >>> sweep = bench.SimulatedBench(fs=500).record("sweep")
    >>> len(plot_response(bench.modal_fit(sweep, mass=2.42)).axes)
    2
    """
    response = found.response
    assert response is not None
    figure, (above, below) = new_figure(2, height=4.2, heights=[3, 1])
    f = response.frequency
    above.plot(f, np.abs(response.h1), color=BLUE, label="H1, averaged")
    above.plot(f, np.abs(response.h2), color=ORANGE, linestyle=":", label="H2, averaged")
    above.plot(f, np.abs(found.model(f)), color=INK, linewidth=0.9, label="fitted oscillator")
    above.set_yscale("log")
    plain_decades(above.yaxis)
    unit = "1" if response.channels[0] == "z" else "m/N"
    above.set_ylabel(axis_label(f"{response.channels[1]} over {response.channels[0]}", unit))
    above.legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    below.plot(f, response.coherence, color=GREEN)
    below.set(ylim=(0, 1.05), ylabel="coherence", xlabel=axis_label("frequency", "Hz"))
    return figure
