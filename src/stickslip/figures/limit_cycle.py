"""Where steady sliding lasts, and how the vibration that follows it begins and ends."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.errors import ModelError
from stickslip.figures.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SHADE,
    SKY,
    axis_label,
    coloured,
    legend_above,
    new_figure,
    prefixed,
    styled,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from stickslip.squeak.bifurcation import CycleBranches

COLOURS = {
    "stable": "#ffffff", "mode coupling": ORANGE, "falling friction": BLUE, "jamming": INK,
    "mode coupling, and falling friction too": PURPLE, "mode coupling and falling friction together": SKY,
    "mode coupling and rising friction together": GREEN, "the structure itself": FAINT,
}  # fmt: skip
FILLED = 0.55  # how opaque a region is


@styled
def plot_limit_cycles(branches: CycleBranches, *, label: str = "parameter") -> Figure:
    """The amplitude and the frequency of the limit cycle over the parameter, both ways, and what the contacts do.

    Parameters
    ----------
    branches : CycleBranches
        What :func:`limit_cycles` returned.
    label : str
        What the parameter is called, with its unit.

    Returns
    -------
    Figure

    Examples
    --------
    >>> from stickslip import Oscillator
    >>> from stickslip.drives import Belt
    >>> from stickslip.laws import Coulomb
    >>> from stickslip.squeak import limit_cycles
    >>> block = Oscillator(1.0, 1.0, Coulomb(1.0, static=1.5), Belt(0.5), damping=0.1)
    >>> drawn = plot_limit_cycles(limit_cycles(block, "drive.speed", values=[0.3, 0.5, 0.6]), label="belt speed [m/s]")
    >>> [axes.get_ylabel() for axes in drawn.axes]
    ['amplitude of sliding [mm]', 'frequency [Hz]', 'share of the time']
    """
    figure, (top, middle, below) = new_figure(3, height=5.6, heights=[2, 1, 1])
    sizes = np.concatenate([branches.amplitudes(way) for way in ("up", "down")])
    factor, unit = prefixed(sizes, "m")
    looks = {"up": (BLUE, ">", "going up", 5), "down": (ORANGE, "<", "going down", 8)}
    for way, (colour, marker, text, size) in reversed(looks.items()):
        cycles = branches.up if way == "up" else branches.down
        face = colour if way == "up" else "none"
        style = {"color": colour, "marker": marker, "markersize": size, "markerfacecolor": face, "linewidth": 1.0}
        top.plot(branches.values, factor * branches.amplitudes(way), label=text, **style)
        frequencies = [cycle.frequency if cycle.vibrates else np.nan for cycle in cycles]
        middle.plot(branches.values, frequencies, **style)
    separating = branches.amplitudes("between")
    if np.isfinite(separating).any():
        top.plot(branches.values, factor * separating, color=INK, linestyle=":", marker="x", label="unstable, between")
    pairs = zip(branches.up, branches.down, strict=True)
    vibrating = [one if one.vibrates else other for one, other in pairs]
    shares = {"sticks": "stick_share", "lifted": "separation_share"}
    for (name, field), colour in zip(shares.items(), (GREEN, PURPLE), strict=True):
        most = [max(getattr(cycle, field)) if cycle.vibrates else np.nan for cycle in vibrating]
        below.plot(branches.values, most, color=colour, marker=".", linewidth=1.0, label=name)
    if branches.threshold is not None:
        for axes in (top, middle, below):
            axes.axvline(branches.threshold.value, color=INK, linewidth=0.9, linestyle="--")
        text = f"sliding ceases to be stable at {branches.threshold.value:.4g}"
        top.plot([], [], color=INK, linewidth=0.9, linestyle="--", label=text)
    if branches.both is not None and branches.both[0] < branches.both[1]:
        top.axvspan(*branches.both, color=SHADE, alpha=0.5, linewidth=0, label="either may last")
    top.set_ylabel(axis_label("amplitude of sliding", unit))
    top.set_ylim(bottom=-0.04 * factor * max(float(sizes.max()), 1e-300))
    legend_above(top, columns=2)
    middle.set_ylabel("frequency [Hz]")
    below.set(xlabel=label, ylabel="share of the time", ylim=(-0.05, 1.05))
    below.legend(loc="upper right", ncols=2)
    figure.align_ylabels([top, middle, below])
    return figure


@styled
def plot_stability(stability: xr.Dataset, *, labels: tuple[str, str] | None = None) -> Figure:
    """Over two parameters: where steady sliding lasts, and what ends it elsewhere.

    Parameters
    ----------
    stability : xarray.Dataset
        What :func:`stability_map` returned for two parameters: the first upwards, the second to the right.
    labels : tuple of str, optional
        What both are called, with their units; their names where left out.

    Returns
    -------
    Figure

    Raises
    ------
    ModelError
        The map has not two parameters of two values or more.

    Examples
    --------
    >>> from stickslip import Oscillator
    >>> from stickslip.drives import Belt
    >>> from stickslip.laws import LinearSlope
    >>> from stickslip.squeak import stability_map
    >>> block = Oscillator(1.0, 100.0, LinearSlope(1.0, slope=-0.1), Belt(0.2), damping=0.3)
    >>> found = stability_map(block, grid={"slope": [-0.5, -0.1, 0.1], "stiffness": [50.0, 100.0]})
    >>> plot_stability(found).axes[0].get_xlabel()
    'stiffness'
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    names = tuple(map(str, stability.growth.dims))
    if len(names) != 2 or min(stability.growth.shape) < 2:
        raise ModelError(
            f"a map over {', '.join(names)} of shape {stability.growth.shape}",
            "a figure has two parameters of two values or more",
            "choose the others' values with .sel()",
        )
    figure, axes = new_figure(height=4.2)
    known = list(COLOURS)
    places = np.vectorize(known.index)(stability.mechanism.values)
    y, x = (stability[name].values for name in names)
    options: Any = {"cmap": ListedColormap(list(COLOURS.values())), "vmin": -0.5, "vmax": len(known) - 0.5}
    coloured(axes, x, y, places, alpha=FILLED, **options)
    growth = stability.growth.values
    if growth.min() < 0 < growth.max():
        axes.contour(x, y, growth, levels=[0.0], colors=INK, linewidths=1.2)
    if growth.max() > 0:
        lines = axes.contour(x, y, growth, levels=np.linspace(0, growth.max(), 6)[1:-1], colors=FAINT, linewidths=0.7)
        axes.clabel(lines, fmt=lambda level: f"{level:.3g} 1/s", fontsize=7, colors=INK)
    first, second = names if labels is None else labels
    axes.set(xlabel=second, ylabel=first)
    shown = [
        Patch(facecolor=COLOURS[known[k]], alpha=FILLED, edgecolor=FAINT, label=known[k]) for k in np.unique(places)
    ]
    legend_above(axes, handles=shown, columns=2)
    return figure
