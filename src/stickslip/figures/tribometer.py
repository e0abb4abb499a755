"""A tribometer's figures: the coefficient over the cycles, and along the stroke (triboscopy)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from stickslip.figures.plate import Plate, captioned
from stickslip.figures.style import BLUE, GREEN, INK, ORANGE, axes_of, legend_above, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stickslip.cycle.tribometer import Coefficients

COLOURS = {"plateau": BLUE, "by_stroke": ORANGE, "by_cycle": GREEN, "by_energy": INK}


def plates_of(found: Coefficients) -> list[Plate]:
    """The figures of one test, in reading order."""
    return [
        captioned("tribometer", "coefficient", partial(plot_coefficients, found)),
        captioned("tribometer", "triboscopy", partial(plot_triboscopy, found)),
    ]


@styled
def plot_coefficients(found: Coefficients, *, ax: Axes | None = None) -> Axes:
    """The coefficient of every cycle by each definition, and how it wears in."""
    ax = axes_of(ax)
    for name, values in found.of_cycles.items():
        ax.plot(np.arange(1, len(values) + 1), values, color=COLOURS[name], linewidth=1.0, label=name.replace("_", " "))
    if found.wear_in is not None:
        cycle = np.arange(1, len(found.wear_in.fitted) + 1)
        ax.plot(cycle, found.wear_in.fitted, color=INK, linewidth=1.0, linestyle="--", label="wear-in")
    ax.set(xlabel="cycle", ylabel="friction over load")
    legend_above(ax, columns=5)
    return ax


@styled
def plot_triboscopy(found: Coefficients, *, ax: Axes | None = None) -> Axes:
    """Friction over load at each place of the stroke, cycle after cycle, the mean of both directions."""
    ax = axes_of(ax)
    both = np.where(np.isnan(found.forward + found.back), np.nan, (found.forward + found.back) / 2)
    factor, unit = (1e3, "mm") if found.unit == "m" else (1.0, found.unit)
    low, high = np.nanquantile(both, [0.02, 0.98])
    last = len(next(iter(found.of_cycles.values())))
    mesh = ax.imshow(
        both, aspect="auto", origin="lower", vmin=low, vmax=high, interpolation="nearest",
        extent=(factor * found.position[0], factor * found.position[-1], 1, last),
    )  # fmt: skip
    ax.figure.colorbar(mesh, ax=ax, label="friction over load")
    ax.set(xlabel=f"displacement [{unit}]", ylabel="cycle")
    return ax
