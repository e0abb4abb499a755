"""Maps: measures of a sweep over two parameters, and the strength of a channel over time and frequency."""

from __future__ import annotations

import math
import re
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.consistent.sliding_balance import Slider
from stickslip.contact.ringing import UNTOLD
from stickslip.drives.kinds import HarmonicBase, HarmonicForce
from stickslip.errors import ModelError, RecordError
from stickslip.figures.style import (
    BLUE,
    INK,
    ORANGE,
    SHADE,
    Plate,
    axes_of,
    axis_label,
    captioned,
    coloured,
    empty_figure,
    envelope,
    legend_above,
    plain_decades,
    plate,
    strongest,
    styled,
)
from stickslip.laws.coulomb import Coulomb
from stickslip.maps.measures import UNKNOWN
from stickslip.oscillator import Oscillator
from stickslip.signals.pieces import RING
from stickslip.signals.wavelet import CENTRE, ends, wavelet_map
from stickslip.solve.tables import System
from stickslip.units import prefixed

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.frequencies import TimeFrequency
    from stickslip.record.record import Record

DECIBELS = 80.0  # dB between the largest modulus and the threshold
LEVELS = 18  # contour lines across them, as in the thesis
COLUMNS = 900
RISING = "cividis"  # even in brightness, and told apart by the colour blind
FEW = 16  # values of a count that are handles apart by colour
MOSTLY = 0.95  # of the points have whole numbers of a count: on a border they may not
WIDE, SPAN = 100.0, 1e4  # a range this wide is drawn by its logarithm, and as much of it


@styled
def plot_wavelet(
    wavelets: xr.DataArray,
    *,
    record: Record | None = None,
    span: float = DECIBELS,
    levels: int = LEVELS,
    style: str = "filled",
) -> Figure:
    """The map of a signal, in decibel below its largest modulus, and the signal above it.

    Parameters
    ----------
    wavelets : xarray.DataArray
        What :func:`wavelet_map`, :func:`wavelet_overview`, :func:`dyadic_map` or :func:`stft_map` returned.
    record : Record, optional
        The record it came from, to be drawn above; the times shown are the map's.
    span : float
        Decibel between the largest modulus and the threshold; what is weaker is left blank.
    levels : int
        Contours that span them in equal steps of the logarithm.
    style : {"filled", "lines"}
        Filled, or contour lines alone as in the thesis.

    Returns
    -------
    Figure

    Raises
    ------
    RecordError
        A span or number of levels that is not positive, a style that is not known, or lines through one frequency.

    Examples
    --------
    >>> import stickslip as ss
    >>> record = ss.Record.of({"a": np.sin(0.3 * np.arange(1000))}, fs=1000)
    >>> figure = plot_wavelet(ss.wavelet_map(record, "a"), record=record)
    >>> len(figure.axes)  # the signal, the map, the bar
    3
    """

    if style == "lines" and wavelets.ndim == 2 and wavelets.sizes["frequency"] < 2:
        raise RecordError(
            "a map of one frequency", "contour lines need two frequencies at least", 'leave style="filled"'
        )
    if not (span > 0 and levels >= 2 and style in ("filled", "lines")):
        raise RecordError(
            f"span = {span}, levels = {levels}, style = '{style}'",
            "a map spans some decibel in two levels at least, filled or in lines",
            "leave them out",
        )
    figure = empty_figure(5.0 if record is not None else 3.6)
    if record is not None:
        top, axes = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2.4))
        _signal(top, record, str(wavelets.attrs["channel"]), wavelets.time.values)
    else:
        axes = figure.subplots()
    steps = np.linspace(-span, 0, levels + 1)
    drawn = _points(axes, wavelets, steps, style) if wavelets.ndim == 1 else _grid(axes, wavelets, steps, style)
    if "cone" in wavelets.coords:
        _cone(axes, wavelets)
    axes.set(xlabel="time [s]", ylabel="frequency [Hz]")
    if axes.get_yscale() == "log":
        _plain_ticks(axes)
    axes.set_xlim(float(wavelets.time.min()), float(wavelets.time.max()))
    if drawn is not None:
        bar = figure.colorbar(drawn, ax=axes, pad=0.01, aspect=30, ticks=np.linspace(-span, 0, 5))
        bar.set_label("dB below the largest")
        if style == "lines":
            for lines in bar.ax.collections:
                lines.set_linewidth(2.0)
        bar.outline.set_visible(False)
    return figure


@styled
def plot_stick(findings: TimeFrequency) -> Figure:
    """One stick from the middle of the record: its acceleration in pieces, and the map up to high frequencies."""
    ringing = findings.ringing
    assert ringing is not None
    record, window = ringing.record, ringing.windows[len(ringing.windows) // 2]
    margin = len(window.values) // 2
    first, last = max(0, window.first - margin), min(len(record), window.first + len(window.values) + margin)
    lowest = 0.4 * ringing.pole.imag / (2 * np.pi)
    reach = int(2 * CENTRE / (2 * np.pi * lowest) * ringing.fs) + 1
    around = record.rows(max(0, first - reach), min(len(record), last + reach))
    wavelets = wavelet_map(around, findings.channel, frequencies=(lowest, 0.4 * ringing.fs))
    shown = wavelets.sel(time=slice(record.time[first], record.time[last - 1]))
    figure = plot_wavelet(shown, record=record)
    top, heard = figure.axes[0], findings.transition is not None and not ringing.silent
    slips = heard and findings.microslips is not None and findings.microslips.kind != UNTOLD
    for number, piece in enumerate(window.pieces if heard else ()):
        begin, end = ringing.time(window, piece.first), ringing.time(window, piece.last)
        if piece.kind == RING:
            top.axvspan(begin, end, color=ORANGE, alpha=0.18, linewidth=0, label="rings" if number == 1 else None)
        elif slips and 0 < number < len(window.pieces) - 1:
            top.axvspan(begin, end, color=SHADE, alpha=0.8, linewidth=0, label="micro-slip" if number == 2 else None)
    if heard:
        legend_above(top, columns=2)
    return figure


def plates_of_map(findings: TimeFrequency) -> list[Plate]:
    """The figures of a channel over time and frequency."""
    reached = findings.record.start + findings.record.duration >= float(findings.wavelets.time.max())
    record = findings.record if reached else None  # one that came in parts is there no more
    draw = partial(plot_wavelet, findings.wavelets, record=record)
    plates = [captioned("map", "map" if reached else "map-alone", draw, name="map")]
    if findings.ringing is not None:
        kind = "stick-that-rings" if findings.transition is not None else "stick"
        plates.append(captioned("map", kind, partial(plot_stick, findings), name="stick"))
    return [*plates, captioned("map", "contours", partial(draw, style="lines"), lines=LEVELS, span=DECIBELS)]


def decibels(wavelets: xr.DataArray, span: float = DECIBELS) -> Array:
    """Modulus in decibel re the largest; at the threshold where it is weaker."""
    modulus = np.abs(wavelets.values)
    largest = modulus.max(initial=0.0)
    if largest == 0:
        return np.full(modulus.shape, -span)
    return np.asarray(20 * np.log10(np.maximum(modulus / largest, 10 ** (-span / 20))))


def _signal(axes: Axes, record: Record, channel: str, times: Array) -> None:
    inside = slice(*np.searchsorted(record.time, [times.min(), times.max()]))
    values = record[channel][inside]
    factor, unit = prefixed(values, record.channels[channel].unit)
    axes.plot(*envelope(record.time[inside], factor * values), color=BLUE, linewidth=0.8)
    quantity = re.split("[,(]", record.channels[channel].quantity or channel)[0].strip()  # the axis is short
    axes.set_ylabel(axis_label(quantity, unit, between="\n"))


def _grid(axes: Axes, wavelets: xr.DataArray, steps: Array, style: str) -> Any:
    import matplotlib as mpl

    level, times = decibels(wavelets, -steps[0]), wavelets.time.values
    level, times = strongest(level, times, COLUMNS)
    frequencies = wavelets.frequency.values
    shown = frequencies > 0
    axes.set_yscale("log" if "scale" in wavelets.coords else "linear")
    if not (level > steps[0]).any():
        return None
    if style == "lines":
        return axes.contour(times, frequencies[shown], level[shown], steps[1:-1], cmap=RISING, linewidths=0.7)
    known = np.ma.masked_less_equal(level[shown], steps[0])
    colours = mpl.colormaps[RISING].resampled(len(steps) - 1)
    return coloured(axes, times, frequencies[shown], known, cmap=colours, vmin=steps[0], vmax=0)


def _points(axes: Axes, points: xr.DataArray, steps: Array, style: str) -> Any:
    """Contours through the scattered points of a dyadic grid."""
    axes.set_yscale("log")
    level = decibels(points, -steps[0])
    if not (level > steps[0]).any():
        return None
    contour = axes.tricontour if style == "lines" else axes.tricontourf
    options: Any = {"linewidths": 0.7} if style == "lines" else {}
    frequencies = points.frequency.values
    axes.set_ylim(frequencies.min(), frequencies.max())
    return contour(points.time.values, frequencies, level, steps, cmap=RISING, **options)


def _cone(axes: Axes, wavelets: xr.DataArray) -> None:
    first, last = ends(wavelets)
    frequencies, cone = wavelets.frequency.values, np.minimum(wavelets.cone.values, (last - first) / 2)
    for edge, sign in ((first, 1.0), (last, -1.0)):
        hatching: Any = {"facecolor": "white", "alpha": 0.45, "hatch": "////", "edgecolor": INK, "linewidth": 0.0}
        axes.fill_betweenx(frequencies, edge, edge + sign * cone, **hatching)
        axes.plot(edge + sign * cone, frequencies, color=INK, linewidth=0.8)
    if len(frequencies) > 1:
        axes.set_ylim(frequencies[0], frequencies[-1])


def _plain_ticks(axes: Axes) -> None:
    """Frequencies as plain numbers: 20, 50, 100, 1000."""
    from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

    low, high = axes.get_ylim()
    wide = high / low > 300
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:g}")
    if wide:
        axes.yaxis.set_minor_formatter(NullFormatter())
    else:
        axes.yaxis.set_minor_locator(NullLocator())
    axes.set_ylim(low, high)


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
        below = " Line: Den Hartog's boundary, below which sliding does not stop."
        line = below if ax.get_legend() and ax.lines else ""
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
