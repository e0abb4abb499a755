"""Maps of a sweep: one measure over two parameters, with Den Hartog's boundary where it applies."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.consistent.sliding_balance import Slider
from stickslip.drives.kinds import HarmonicBase, HarmonicForce
from stickslip.errors import ModelError
from stickslip.figures.style import (
    BLUE,
    INK,
    ORANGE,
    Array,
    Plate,
    axes_of,
    axis_label,
    coloured,
    plain_decades,
    plate,
    prefixed,
    styled,
)
from stickslip.laws.coulomb import Coulomb
from stickslip.maps.measures import UNKNOWN
from stickslip.oscillator import Oscillator
from stickslip.solve.tables import System

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RISING = "cividis"
FEW = 16  # values of a count that are handles apart by colour
MOSTLY = 0.95  # of the points have whole numbers of a count: on a border they may not
WIDE, SPAN = 100.0, 1e4  # a range this wide is drawn by its logarithm, and as much of it


@styled
def plot_map(atlas: Any, *, variable: str | None = None, system: System | None = None, ax: Axes | None = None) -> Axes:
    """One measure of a sweep: in colour over two parameters, as a curve over one.

    Parameters
    ----------
    atlas : xarray.Dataset
        What :func:`stickslip.sweep` returned.
    variable : str, optional
        Which of its variables; the stops, both kinds together, where left out and there.
    system : Oscillator or Structure, optional
        What moved: with rigid Coulomb friction over frequency and friction, Den Hartog's boundary of the motion
        without stops is drawn over the map.
    ax : Axes, optional
        Where to draw; a new figure where left out.

    Returns
    -------
    Axes

    Raises
    ------
    ModelError
        The variable is not there, or the map has more than two dimensions.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.scenarios.forced(0.8, 0.5)
    >>> grid = {"frequency": [0.1, 0.13, 0.16], "kinetic": [0.3, 0.6, 0.9]}
    >>> atlas = ss.sweep(slider, grid, measures=["stops"], settle=40, cycles=10)
    >>> plot_map(atlas, system=slider).get_xlabel()
    'frequency [Hz]'
    """
    values, quantity, unit = _shown(atlas, variable)
    if values.ndim not in (1, 2):
        raise ModelError(
            f"a map over {', '.join(values.dims)}", "one or two dimensions can be drawn", "choose with sel()"
        )
    ax = axes_of(ax, height=4.2)
    across, scale, label = _axis(atlas, values.dims[0])
    factor, spelled = prefixed(values.values[np.isfinite(values.values)], unit)
    named = _outcomes(values)
    if values.ndim == 1:
        from matplotlib.ticker import MaxNLocator

        counted = len(_steps(values.values)) > 0
        ax.plot(across, factor * values.values, ".-", color=BLUE, drawstyle="steps-mid" if counted else "default")
        if counted:
            ax.yaxis.set_major_locator(MaxNLocator(integer=True))
        if named:
            ax.set_yticks(list(named), list(named.values()))
        ax.set_xlabel(label)
        ax.set_ylabel(axis_label(quantity, spelled))
        return ax
    up, lift, upward = _axis(atlas, values.dims[1])
    _colour(ax, across, up, factor * values.values.T, axis_label(quantity, spelled), named)
    curve = None if system is None else den_hartog(system, values.dims, across / scale)
    handles: list[Any] = []
    if curve is not None:
        handles += ax.plot(across, lift * curve, color=ORANGE, linewidth=1.8, label="Den Hartog (1931): no stops below")
        ax.set_ylim(up[0], up[-1])
    white = _white(atlas, values)
    if white:
        from matplotlib.patches import Patch

        handles.append(Patch(facecolor="white", edgecolor=INK, linewidth=0.6, label=white))
    if handles:
        ax.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1.0), borderaxespad=0.2)
    ax.set_xlabel(label)
    ax.set_ylabel(upward)
    return ax


def _shown(atlas: Any, variable: str | None) -> tuple[Any, str, str]:
    """The values, what they are, and their unit."""
    if variable is None and {"normal_stops", "abnormal_stops"} <= set(atlas.data_vars):
        return atlas.normal_stops + atlas.abnormal_stops, "stops per period", "1"
    name = variable if variable is not None else next((n for n in atlas.data_vars if n != "status"), "status")
    if name not in atlas.data_vars:
        raise ModelError(
            f"the map has no '{name}'", f"it has {', '.join(map(str, atlas.data_vars))}", "name one of them"
        )
    values = abs(atlas[name]) if np.iscomplexobj(atlas[name]) else atlas[name]
    return values, atlas[name].attrs.get("long_name", name), atlas[name].attrs.get("units", "1")


def _white(atlas: Any, values: Any) -> str:
    """What the points without a number are; nothing where there are none."""
    unknown = ~np.isfinite(values.values)
    if not unknown.any():
        return ""
    status = atlas.get("status")
    became = {} if status is None else _outcomes(status.where(unknown, -2).astype(int).assign_attrs(status.attrs))
    lost = [word for word in became.values() if word not in ("moving", "at rest")]
    reason = atlas[values.name].attrs.get(UNKNOWN) if values.name in atlas else None
    why = " or ".join([*lost, *([reason] if reason and len(lost) < len(became) else [])])
    return f"white: no number at {np.sum(unknown)} of {unknown.size} points{why and f' ({why})'}"


def _axis(atlas: Any, dim: str) -> tuple[Array, float, str]:
    """Values along a dimension as drawn, their scale to SI, and the label."""
    known = atlas[dim] if dim in atlas.coords and atlas[dim].dtype.kind == "f" else None
    if known is None:
        return np.arange(float(atlas.sizes[dim])), 1.0, dim
    factor, unit = prefixed(known.values, known.attrs.get("units", "1"))
    return factor * known.values, factor, axis_label(dim.replace(".", " ").replace("_", " "), unit)


def plates_of(atlas: Any, system: System | None = None) -> tuple[Plate, ...]:
    """The figures of a map over one or two parameters, one for each measure, with their words."""
    counts = {"normal_stops", "abnormal_stops"} & set(atlas.data_vars)
    own = [str(name) for name in atlas.data_vars if name not in {"status", *counts}]
    drawn = {**({"stops": None} if len(counts) == 2 else {}), **{name: name for name in own}}
    cycles, settle = (atlas.attrs.get(name, "some") for name in ("cycles", "settle"))
    caption = f"Each point is a motion of its own, measured over {cycles} periods after {settle} in which it settles."
    plates = []
    for name, variable in (drawn or {"status": "status"}).items():
        ax, (values, label, _) = plot_map(atlas, variable=variable, system=system), _shown(atlas, variable)
        line = (
            " Line: Den Hartog's boundary, below which sliding does not stop." if ax.get_legend() and ax.lines else ""
        )
        white = _white(atlas, values)
        left = f" {white[0].upper()}{white[1:]}." if white else ""
        plates.append(plate(name, partial(_itself, ax), f"{label[0].upper()}{label[1:]}", caption + line + left))
    return tuple(plates)


def _itself(drawn: Axes) -> Axes:
    return drawn


def _outcomes(values: Any) -> dict[int, str]:
    """What the numbers of a status mean, of those that are there; nothing for other variables."""
    codes, meanings = values.attrs.get("flag_values", ()), values.attrs.get("flag_meanings", "").split()
    named = {int(code): word.replace("_", " ") for code, word in zip(codes, meanings, strict=True)}
    return {code: named[code] for code in np.unique(values.values).tolist() if code in named}


def _steps(values: Array) -> Array:
    """The different numbers of a count of few values; none of what is no count."""
    known = values[np.isfinite(values)]
    whole = np.unique(np.round(known))
    counted = 0 < len(whole) <= FEW and np.mean(known == np.round(known)) > MOSTLY
    return whole if counted else whole[:0]


def _colour(ax: Axes, across: Array, up: Array, values: Array, label: str, named: dict[int, str]) -> None:
    """The map in colour; a count of few values in steps, which may have names."""
    import matplotlib as mpl
    from matplotlib.colors import BoundaryNorm, LogNorm

    known = values[np.isfinite(values)]
    whole = _steps(values)
    options: dict[str, Any] = {"cmap": RISING}
    if len(whole):
        edges = np.append(whole - 0.5, whole[-1] + 0.5)
        options = {"cmap": mpl.colormaps[RISING].resampled(len(whole)), "norm": BoundaryNorm(edges, len(whole))}
    elif len(known) and np.min(known) > 0 and np.max(known) > WIDE * np.min(known):
        options["norm"] = LogNorm(max(np.min(known), np.max(known) / SPAN), np.max(known))
    drawn = coloured(ax, across, up, np.ma.masked_invalid(values), **options)
    bar = ax.figure.colorbar(drawn, ax=ax, label=label)
    if isinstance(options.get("norm"), LogNorm):
        plain_decades(bar.ax.yaxis)
    if isinstance(options.get("norm"), BoundaryNorm):
        bar.set_ticks([(low + high) / 2 for low, high in pairwise(edges)])
        bar.set_ticklabels([named.get(int(count), f"{count:g}") for count in whole])
    bar.outline.set_edgecolor(INK)


def den_hartog(system: System, names: tuple[str | None, ...], frequencies: Array) -> Array | None:
    """The friction above which rigid sliding stops on its way [N], over frequencies; None where it does not apply."""
    if names != ("frequency", "kinetic") or not isinstance(system, Oscillator):
        return None
    law, drive = system.law, system.drive
    rigid = isinstance(law, Coulomb) and law.static in (None, law.kinetic)
    grounded = getattr(drive, "contact", "ground") == "ground" and system.damper == "ground"
    if not (rigid and grounded and isinstance(drive, HarmonicForce | HarmonicBase)):
        return None
    force = drive.amplitude * (system.stiffness if isinstance(drive, HarmonicBase) else 1.0)
    sliders = [Slider(system.mass, system.stiffness, 2 * math.pi * f, system.damping) for f in frequencies]
    return np.array([force * slider.boundary() for slider in sliders])
