"""Attractors along a parameter, basins, boundaries, what dither does, and where steady sliding ends in vibration."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.errors import ModelError
from stickslip.figures import style
from stickslip.figures.maps import den_hartog
from stickslip.figures.style import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, SHADE, SKY
from stickslip.maps.basins import Attractor, Basins
from stickslip.maps.bifurcation import Bifurcation
from stickslip.maps.boundaries import Boundary
from stickslip.maps.dither import Dither, dithered_friction
from stickslip.oscillator import Oscillator
from stickslip.parameters import unit as unit_of
from stickslip.solve.tables import System
from stickslip.units import prefixed, spelled

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.squeak.bifurcation import CycleBranches

STATES = {
    "stable": "#ffffff", "mode coupling": ORANGE, "falling friction": BLUE, "jamming": INK,
    "mode coupling, and falling friction too": PURPLE, "mode coupling and falling friction together": SKY,
    "mode coupling and rising friction together": GREEN, "the structure itself": FAINT,
}  # fmt: skip
FILLED = 0.55  # how opaque a region is
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, INK, FAINT, SHADE)
MOST_NAMED = 8  # attractors in a legend


@style.styled
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
    figure, (top, middle, below) = style.new_figure(3, height=5.6, heights=[2, 1, 1])
    sizes = np.concatenate([branches.amplitudes(way) for way in ("up", "down")])
    factor, unit = prefixed(sizes, "m")
    looks = {"up": (BLUE, ">", "going up", 5), "down": (ORANGE, "<", "going down", 8)}
    for way, (colour, marker, text, size) in reversed(looks.items()):
        cycles = branches.up if way == "up" else branches.down
        face = colour if way == "up" else "none"
        look = {"color": colour, "marker": marker, "markersize": size, "markerfacecolor": face, "linewidth": 1.0}
        top.plot(branches.values, factor * branches.amplitudes(way), label=text, **look)
        frequencies = [cycle.frequency if cycle.vibrates else np.nan for cycle in cycles]
        middle.plot(branches.values, frequencies, **look)
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
    top.set_ylabel(style.axis_label("amplitude of sliding", unit))
    top.set_ylim(bottom=-0.04 * factor * max(float(sizes.max()), 1e-300))
    style.legend_above(top, columns=2)
    middle.set_ylabel("frequency [Hz]")
    below.set(xlabel=label, ylabel="share of the time", ylim=(-0.05, 1.05))
    below.legend(loc="upper right", ncols=2)
    figure.align_ylabels([top, middle, below])
    return figure


@style.styled
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
    >>> chart = stability_map(block, grid={"slope": [-0.5, -0.1, 0.1], "stiffness": [50.0, 100.0]})
    >>> plot_stability(chart).axes[0].get_xlabel()
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
    figure, axes = style.new_figure(height=4.2)
    known = list(STATES)
    places = np.vectorize(known.index)(stability.mechanism.values)
    y, x = (stability[name].values for name in names)
    options: Any = {"cmap": ListedColormap(list(STATES.values())), "vmin": -0.5, "vmax": len(known) - 0.5}
    style.coloured(axes, x, y, places, alpha=FILLED, **options)
    growth = stability.growth.values
    if growth.min() < 0 < growth.max():
        axes.contour(x, y, growth, levels=[0.0], colors=INK, linewidths=1.2)
    if growth.max() > 0:
        lines = axes.contour(x, y, growth, levels=np.linspace(0, growth.max(), 6)[1:-1], colors=FAINT, linewidths=0.7)
        axes.clabel(lines, fmt=lambda level: f"{level:.3g} 1/s", fontsize=7, colors=INK)
    first, second = names if labels is None else labels
    axes.set(xlabel=second, ylabel=first)
    seen = [known[k] for k in np.unique(places)]
    shown = [Patch(facecolor=STATES[name], alpha=FILLED, edgecolor=FAINT, label=name) for name in seen]
    style.legend_above(axes, handles=shown, columns=2)
    return figure


@style.styled
def plot_bifurcation(diagram: Bifurcation) -> Figure:
    """The diagram: where the motion is once in each period of the drive, followed up and down, with every change.

    Parameters
    ----------
    diagram : Bifurcation
        What :func:`stickslip.bifurcation` returned.

    Returns
    -------
    Figure
        Displacement once in each period over the parameter (top) and the largest multiplier (bottom).

    Examples
    --------
    >>> import stickslip as ss
    >>> diagram = ss.bifurcation(ss.scenarios.forced(0.8, 0.5), "kinetic", values=[0.5, 0.7, 0.9])
    >>> len(plot_bifurcation(diagram).axes)
    2
    """
    figure, (top, bottom) = style.new_figure(2, height=4.6, heights=(3, 1))
    motion = diagram.up[0].orbit.orbit
    points = [attractor.points[:, 0] for attractor in (*diagram.up, *diagram.down)]
    factor, unit = prefixed(np.concatenate(points), motion.units("x")[0])
    crowded = max(map(len, points)) > 20
    _follow(top, bottom, diagram, factor, dot=1.2 if crowded else None)
    _beside(top, diagram, factor)
    for change in diagram.changes:
        colour = BLUE if change.direction == "up" else ORANGE
        for ax in (top, bottom):
            ax.axvline(change.value, color=colour, linewidth=0.8, linestyle=":" if change.direction == "up" else "--")
    _name_regimes(top, diagram)
    bottom.axhline(1.0, color=INK, linewidth=0.8)
    bottom.set_ylim(0, 1.15)
    bottom.set_ylabel("largest\nmultiplier")
    top.set_ylabel(style.axis_label("displacement at phase zero", unit))
    bottom.set_xlabel(_named(motion.system, diagram.parameter))
    style.legend_above(top, columns=4, markerscale=3 if crowded else 1)
    return figure


def _follow(top: Axes, bottom: Axes, diagram: Bifurcation, factor: float, *, dot: float | None) -> None:
    """The motion followed down and up: displacements, as dots of one size where they are crowded, and multipliers."""
    looks = (("down", ORANGE, "o", 5.0, "none"), ("up", BLUE, ".", 4.0, BLUE))
    for name, colour, marker, size, face in looks:
        way = getattr(diagram, name)
        places = np.repeat(diagram.values, [len(attractor.points) for attractor in way])
        heights = factor * np.concatenate([attractor.points[:, 0] for attractor in way])
        look: Any = {"color": colour, "marker": marker, "linestyle": "none", "markerfacecolor": face}
        look |= {"markeredgewidth": 0.7, "zorder": 3 if name == "up" else 2}
        top.plot(places, heights, markersize=dot or size, label=f"followed {name}", **look)
        bottom.plot(diagram.values, [_largest(attractor) for attractor in way], markersize=size, **look)


def _beside(top: Axes, diagram: Bifurcation, factor: float) -> None:
    """Motions from other starts, and branches that lose their stability."""
    beside = zip(diagram.values, diagram.beside, strict=True)
    others = [(value, motion) for value, several in beside for motion in several]
    for number, (value, motion) in enumerate(others):
        label = "beside, from another start" if not number else None
        heights = factor * motion.points[:, 0]
        top.plot([value] * len(heights), heights, "x", color=GREEN, markersize=5, label=label)
    for number, branch in enumerate(diagram.branches):
        unstable = np.array([orbit.status == "unstable" for orbit in branch.orbits])
        heights = factor * np.array([orbit.orbit.states[0, 0] for orbit in branch.orbits])
        label = "unstable" if not number else None
        top.plot(branch.values, np.where(unstable, heights, np.nan), "--", color=INK, linewidth=1.0, label=label)


def _largest(attractor: Attractor) -> float:
    """The largest multiplier's modulus; a motion that never repeats has none."""
    return math.nan if attractor.orbit.order < 1 else float(np.max(np.abs(attractor.orbit.multipliers)))


def _name_regimes(ax: Axes, diagram: Bifurcation) -> None:
    """What the motion does, written over each stretch of values: upwards at the top, downwards below."""
    first, last = diagram.values[[0, -1]]
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.22 * (high - low))
    for row, (direction, colour) in enumerate((("up", BLUE), ("down", ORANGE))):
        changes = sorted(change.value for change in diagram.changes if change.direction == direction)
        for begin, end in pairwise([first, *changes, last]):
            inside = np.flatnonzero((diagram.values >= begin) & (diagram.values <= end))
            if not len(inside):
                continue
            text = getattr(diagram, direction)[inside[len(inside) // 2]].regime
            if end - begin > 0.012 * len(text) * (last - first):
                at: Any = {"ha": "center", "va": "top", "transform": ax.get_xaxis_transform()}
                ax.text((begin + end) / 2, 0.985 - 0.075 * row, text, color=colour, fontsize=7, **at)


def _named(system: System, parameter: str) -> str:
    return style.axis_label(parameter.replace(".", " ").replace("_", " "), unit_of(system, parameter))


@style.styled
def plot_basins(basins: Basins, *, ax: Axes | None = None) -> Axes:
    """The map of starts, each in the colour of the motion it leads to; crosses where the motion is at phase zero.

    Parameters
    ----------
    basins : Basins
        What :func:`stickslip.basins` returned.
    ax : Axes, optional
        Where to draw; a new figure where left out.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.scenarios.forced(0.8, 0.7, static_ratio=1.5)
    >>> basins = ss.basins(slider, grid={"x": [-1.0, 0.0, 1.0], "v": [-1.0, 0.0, 1.0]})
    >>> plot_basins(basins).get_xlabel()
    'x [m]'
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    ax = style.axes_of(ax, height=4.2)
    (down, across), (rows, columns) = basins.names, basins.axes
    motion = basins.attractors[0].orbit.orbit
    units = dict(zip(motion.table.names, (*motion.units("x"), *motion.units("v")), strict=False))  # rad if it turns
    across_factor, across_unit = prefixed(rows, units.get(down, "1"))
    down_factor, down_unit = prefixed(columns, units.get(across, "1"))
    count = len(basins.attractors)
    colours = [COLOURS[j % len(COLOURS)] for j in range(count)]
    known = np.ma.masked_less(basins.which.T, 0)
    options: Any = {"cmap": ListedColormap(colours), "vmin": -0.5, "vmax": count - 0.5, "alpha": 0.55}
    style.coloured(ax, across_factor * rows, down_factor * columns, known, **options)
    handles = []
    for j, (attractor, share) in enumerate(zip(basins.attractors, basins.shares, strict=True)):
        table = attractor.orbit.orbit.table
        if set(basins.names) <= set(table.names) and attractor.status != "rest":
            places = [table.names.index(name) for name in basins.names]
            points, factors = attractor.points[:, places], (across_factor, down_factor)
            least, most = (np.array([axis[end] for axis in basins.axes]) for end in (0, -1))
            inside = np.all((points >= least) & (points <= most), axis=1)
            ax.plot(*(points[inside] * factors).T, "+", color=INK, markersize=8, markeredgewidth=1.4)
        low, high = share.interval
        label = f"{attractor.regime}: {100 * share.value:.1f} % ({100 * low:.1f} to {100 * high:.1f})"
        handles.append(Patch(color=colours[j], alpha=0.55, label=label))
    style.legend_above(ax, handles=handles[:MOST_NAMED], columns=2)
    ax.set_xlabel(style.axis_label(down, across_unit))
    ax.set_ylabel(style.axis_label(across, down_unit))
    return ax


@style.styled
def plot_boundary(boundary: Boundary, *, ax: Axes | None = None) -> Axes:
    """The boundary as a curve, with Den Hartog's closed form over it where it applies.

    Parameters
    ----------
    boundary : Boundary
        What :func:`stickslip.maps.boundary` returned with ``along=``.
    ax : Axes, optional
        Where to draw; a new figure where left out.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.scenarios.forced(0.8, 0.5)
    >>> along = {"frequency": [0.1, 0.2]}
    >>> border = ss.maps.boundary(slider, "kinetic", between=(0.05, 0.99), along=along, precision=1e-3)
    >>> plot_boundary(border).get_lines()[1].get_label()
    'Den Hartog (1931)'
    """
    ax = style.axes_of(ax)
    system = next(motion for motion in boundary.low if motion is not None).orbit.orbit.system
    free = np.array([motion is not None and motion.status == "not unique" for motion in boundary.low])
    sides = ((~free, BLUE, "bisection of exact runs"), (free, "none", "of a family, from one start"))
    for chosen, face, label in sides:
        if np.any(chosen & np.isfinite(boundary.values)):
            look: Any = {"color": BLUE, "markerfacecolor": face, "markersize": 4, "zorder": 3}
            ax.plot(boundary.places[chosen], boundary.values[chosen], "o", label=label, **look)
    kinds = next(pair for pair, value in zip(boundary.kinds, boundary.values, strict=True) if math.isfinite(value))
    fine = np.linspace(boundary.places[0], boundary.places[-1], 400)
    curve = (
        den_hartog(system, (boundary.along, boundary.parameter), fine) if set(kinds) == {"no stops", "stops"} else None
    )
    if curve is not None:
        assert isinstance(system, Oscillator)
        ax.plot(fine, curve, color=ORANGE, label="Den Hartog (1931)")
        ax.axvline(system.frequency, color=FAINT, linewidth=0.8)
    ax.margins(y=0.12)
    for place, kind in ((0.98, kinds[1]), (0.02, kinds[0])):
        ax.text(0.98, place, str(kind), transform=ax.transAxes, ha="right", va="top" if place > 0.5 else "bottom")
    ax.set_xlabel(_named(system, boundary.along) if boundary.along else "place")
    ax.set_ylabel(_named(system, boundary.parameter))
    style.legend_above(ax, columns=2)
    return ax


@style.styled
def plot_dither(dither: Dither) -> Figure:
    """How the longest stick goes down with the dither, and what the dither makes of the friction.

    Parameters
    ----------
    dither : Dither
        What :func:`stickslip.dither` returned.

    Returns
    -------
    Figure
        The longest stick in periods of the dither over its amplitude (top), and the mean friction over the sliding
        speed, with the averaged law (bottom).

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(1, 1, ss.laws.Coulomb(1.0, static=1.5), ss.drives.Belt(0.5), damping=0.02)
    >>> len(plot_dither(ss.dither(slider, frequency=5.0)).axes)
    2
    """
    figure = style.empty_figure(4.8)
    top, bottom = figure.subplots(2, 1)
    factor, unit = prefixed(dither.scan[:, 0], dither.amplitude.unit)
    sticks = dither.scan[:, 1] * dither.frequency
    least = 0.3 * min(1.0, np.min(sticks[sticks > 0], initial=1.0))
    known = np.where(np.isfinite(sticks), np.maximum(sticks, least), np.nan)
    top.loglog(factor * dither.scan[:, 0], known, ".", color=BLUE, label="exact runs")
    for axis in (top.xaxis, top.yaxis):
        style.plain_decades(axis)
    top.axhline(1.0, color=INK, linewidth=0.8)
    smallest = factor * dither.amplitude.value
    label = f"smallest that does it: {smallest:.3g} {spelled(unit)}"
    top.axvline(smallest, color=ORANGE, linestyle="--", label=label)
    if np.any(sticks == 0):
        top.text(0.99, 0.04, "lowest row: no stick at all", transform=top.transAxes, ha="right", fontsize=7)
    top.set_xlabel(style.axis_label(f"dither of {dither.frequency:.4g} Hz on the {dither.on}", unit))
    top.set_ylabel("longest stick\n[periods of the dither]")
    style.legend_above(top, columns=2)
    shares = np.linspace(0, 1, 200)
    bottom.plot(shares, dithered_friction(shares, speed=1.0), color=ORANGE, label="(2/pi) asin(v/aw)")
    for column, colour, text in ((2, BLUE, "exact runs with this dither"), (3, GREEN, "with ten times as much")):
        bottom.plot(dither.averaged[:, 0], dither.averaged[:, column], "o", color=colour, markersize=4, label=text)
    bottom.axhline(1.0, color=FAINT, linewidth=0.8)
    bottom.set_xlabel("sliding speed over that of the dither, v/aw")
    bottom.set_ylabel("mean friction\nover sliding friction")
    style.legend_above(bottom, columns=3)
    figure.align_ylabels([top, bottom])
    return figure
