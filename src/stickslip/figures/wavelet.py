"""Maps over time and frequency: the signal above, the map below, the cone of influence hatched, a bar in decibel."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.contact.ringing import UNTOLD
from stickslip.errors import RecordError
from stickslip.figures.style import (
    BLUE,
    INK,
    ORANGE,
    SHADE,
    Array,
    Plate,
    axis_label,
    captioned,
    coloured,
    empty_figure,
    envelope,
    legend_above,
    prefixed,
    strongest,
    styled,
)
from stickslip.signals.pieces import RING
from stickslip.signals.wavelet import CENTRE, ends, wavelet_map

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.frequencies import TimeFrequency
    from stickslip.record.record import Record

SPAN = 80.0  # dB between the largest modulus and the threshold
LEVELS = 18  # contour lines across them, as in the thesis
COLUMNS = 900
RISING = "cividis"  # even in brightness, and told apart by the colour blind


@styled
def plot_wavelet(
    wavelets: xr.DataArray,
    *,
    record: Record | None = None,
    span: float = SPAN,
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
    return [*plates, captioned("map", "contours", partial(draw, style="lines"), lines=LEVELS, span=SPAN)]


def decibels(wavelets: xr.DataArray, span: float = SPAN) -> Array:
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
