"""Squeaks: where the bursts are, their spectra, what moves together, and where in the forcing cycle they come."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.estimate import decimals
from stickslip.figures import style
from stickslip.figures.contact import plot_displacement_loop, plot_velocity_loop
from stickslip.figures.style import BARS, BLUE, FAINT, GREEN, INK, ORANGE, PURPLE
from stickslip.squeak.bursts import ForcedMotion
from stickslip.units import prefixed, spelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.findings import Comparison, Findings
    from stickslip.record.record import Record
    from stickslip.squeak.bursts import Squeak, Squeaks
    from stickslip.squeak.spectra import BurstSpectra

MARKS = {
    "squeaks": (ORANGE, "D"), "squeals": (ORANGE, "D"), "creaks": (PURPLE, "^"), "does not squeak": (BLUE, "o"),
    "can not be told": (FAINT, "s"),
}  # fmt: skip
COLOURS = {"squeak": ORANGE, "squeal": ORANGE, "creak": PURPLE, "scrape": GREEN, "tonal": BLUE, "noise": FAINT}
TRACED = {
    "v": GREEN, "a": BLUE, "normal_acceleration": BLUE, "torsion_velocity": PURPLE, "friction": ORANGE, "load": PURPLE,
    "sound": INK,
}  # fmt: skip
SHORT = {
    "a": "acceleration", "normal_acceleration": "normal\nacceleration", "torsion_velocity": "torsion\nvelocity",
    "friction": "friction", "sound": "sound",
}  # fmt: skip
SPAN = 70.0  # dB of the spectrogram
WINDOW = 0.0232  # s of its frames
COLUMNS = 900
SHARE = 0.02  # of the power that lies above half of the highest frequency shown
PHASES = 100
MOST_NUMBERS = 30
MOST_ROWS = 6


@style.styled
def plot_squeaks(squeaks: Squeaks) -> Figure:
    """The sound over time with its bursts shaded, and its spectrogram with their dominant frequencies.

    Examples
    --------
    >>> import stickslip as ss
    >>> t = np.arange(10_000) / 10_000
    >>> tone = np.sin(2 * np.pi * 500 * t) * (np.abs(t - 0.5) < 0.2)
    >>> figure = plot_squeaks(ss.find_squeaks(ss.Record.of({"sound": tone}, fs=10_000)))
    >>> len(figure.axes)  # the sound, the spectrogram, its bar
    3
    """
    from matplotlib.patches import Patch

    record, name = squeaks.record, squeaks.channel
    figure, (above, below) = style.new_figure(2, height=4.8, heights=(1, 2.2))
    _trace(above, record, name)
    drawn = _spectrogram(below, squeaks)
    numbered = len(squeaks.bursts) <= MOST_NUMBERS
    for number, burst in enumerate(squeaks.bursts):
        above.axvspan(burst.start, burst.end, color=COLOURS[burst.kind], alpha=0.22, linewidth=0)
        if numbered:
            at: Any = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "ha": "center"}
            above.annotate(f"{number + 1}", ((burst.start + burst.end) / 2, 1), xytext=(0, 1), fontsize=7, **at)
        _frame(below, burst)
    kinds = dict.fromkeys(burst.kind for burst in squeaks.bursts)
    if kinds:
        handles = [Patch(color=COLOURS[kind], alpha=0.4, label=kind) for kind in kinds]
        figure.legend(handles=handles, ncols=len(handles), loc="outside upper left")
    below.set(xlabel="time [s]", ylabel="frequency [Hz]")
    below.set_xlim(float(record.time[0]), float(record.time[-1]))
    bar = figure.colorbar(drawn, ax=below, pad=0.01, aspect=30)
    bar.set_label("dB below the largest")
    bar.outline.set_visible(False)
    figure.align_ylabels([above, below])
    return figure


@style.styled
def plot_burst_spectra(spectra: BurstSpectra, *, channel: str, record: Record) -> Figure:
    """Power spectra of each channel, in the bursts and outside of them."""
    from matplotlib.ticker import LogLocator, NullLocator

    names = list(spectra.inside)
    figure, axes = _panels(len(names))
    last = _highest(spectra.frequency, spectra.inside, channel)
    for ax, name in zip(axes, names, strict=True):
        shown = spectra.frequency[1:last]
        if name in spectra.outside:
            ax.semilogy(shown, spectra.outside[name][1:last], color=BLUE, linewidth=1.0, label="outside")
        ax.semilogy(shown, spectra.inside[name][1:last], color=ORANGE, label="in the bursts")
        unit = spelled(record.channels[name].unit)
        ax.yaxis.set_major_locator(LogLocator(numticks=5))
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_locator(NullLocator())
        power = "1/Hz" if unit == "1" else f"({unit})²/Hz" if "/" in unit else f"{unit}²/Hz"
        ax.set_ylabel(f"{_quantity(record, name)}\n[{power}]")
    style.legend_above(axes[0], columns=2)
    axes[-1].set(xlabel="frequency [Hz]", xlim=(0, float(spectra.frequency[last - 1])))
    figure.align_ylabels(axes)
    return figure


@style.styled
def plot_coherence(spectra: BurstSpectra, *, channel: str, record: Record) -> Figure:
    """Coherence of every channel with the one in which the bursts were heard, in the bursts and outside of them."""
    pairs = [pair for pair in spectra.coherence if channel in pair] or list(spectra.coherence)
    figure, axes = _panels(len(pairs))
    last = _highest(spectra.frequency, spectra.inside, channel)
    shown = spectra.frequency[1:last]
    for ax, pair in zip(axes, pairs, strict=True):
        if pair in spectra.coherence_outside:
            ax.plot(shown, spectra.coherence_outside[pair][1:last], color=BLUE, linewidth=1.0, label="outside")
        ax.plot(shown, spectra.coherence[pair][1:last], color=ORANGE, label="in the bursts")
        ax.axhline(spectra.significant, color=ORANGE, linestyle=":", linewidth=0.9)
        if pair in spectra.coherence_outside:
            ax.axhline(spectra.significant_outside, color=BLUE, linestyle=":", linewidth=0.9)
        other = pair[0] if pair[1] == channel else pair[1]
        ax.set(ylim=(0, 1.02), ylabel=_quantity(record, other))
    style.legend_above(axes[0], columns=2)
    axes[-1].set(xlabel="frequency [Hz]", xlim=(0, float(shown[-1])))
    figure.align_ylabels(axes)
    return figure


@style.styled
def plot_forcing_cycle(squeaks: Squeaks) -> Figure:
    """Where in the forcing cycle, and at which sliding velocity, the bursts come."""
    record, motion = squeaks.record, ForcedMotion.of(squeaks.record)
    assert motion.velocity is not None
    assert motion.phase is not None
    factor, unit = prefixed(motion.velocity, "m/s")
    figure, (above, below) = style.new_figure(2, height=4.2, heights=[1.4, 1])
    bins = np.linspace(0, 1, PHASES + 1)
    edge = round(record.fs / motion.frequency / 2)  # half a cycle, within which the phase at an end is not known
    known = slice(edge, len(record) - edge)
    place, velocity = np.clip(np.digitize(motion.phase[known], bins) - 1, 0, PHASES - 1), motion.velocity[known]
    filled = np.unique(place)
    middle = factor * np.array([float(np.median(velocity[place == phase])) for phase in filled])
    label = "sliding velocity, median of the cycles"
    above.plot((bins[1:] + bins[:-1])[filled] / 2, middle, color=INK, label=label)
    above.axhline(0, color=FAINT, linewidth=0.8)
    thick = max(1.0, min(5.0, 100 / len(squeaks.bursts)))
    for number, burst in enumerate(squeaks.bursts):
        colour = COLOURS[burst.kind]
        above.plot(burst.phase, factor * burst.speed, "o", color=colour, markersize=4.5)
        for ends, wide in (((burst.start, burst.end), 0.3), (burst.loud, 1.0)):
            first, last = np.searchsorted(record.time, ends)
            turn = np.unwrap(2 * np.pi * motion.phase[first : last + 1]) / (2 * np.pi)
            for begin, end in _within_one(float(turn[0]), float(turn[-1])):
                below.plot([begin, end], [number + 1] * 2, color=colour, linewidth=thick * wide, solid_capstyle="butt")
        below.plot(burst.phase, number + 1, "o", color=INK, markersize=2.5)
    style.legend_above(above)
    above.set_ylabel(style.axis_label("velocity", unit))
    below.set(xlabel="phase of the forcing cycle, 0 at the largest displacement", ylabel="burst", xlim=(0, 1))
    below.set_ylim(len(squeaks.bursts) + 0.7, 0.3)
    below.yaxis.get_major_locator().set_params(integer=True)
    figure.align_ylabels([above, below])
    return figure


@style.styled
def plot_burst(findings: Findings, *, burst: Squeak) -> Figure:
    """Every channel about one burst."""
    around = min(0.5 * burst.duration, 0.1)
    part = findings.record.between(burst.start - around, burst.end + around)
    names = [name for name in TRACED if name in part] or [findings.squeaks.channel]
    figure, axes = _panels(len(names))
    for ax, name in zip(axes, names, strict=True):
        _trace(ax, part, name)
        ax.axvspan(burst.start, burst.end, color=COLOURS[burst.kind], alpha=0.15, linewidth=0)
    axes[-1].set(xlabel="time [s]", xlim=(float(part.time[0]), float(part.time[-1])))
    figure.align_ylabels(axes)
    return figure


@style.styled
def plot_conditions(comparison: Comparison) -> Figure:
    """Friction and its slope against speed in each condition, with their 95 % intervals; where it squeaks is orange.

    Grey where that can not be told. Both over the load, where it is known in every condition.
    """

    conditions = [condition for condition in comparison.conditions if condition.level is not None]
    figure = style.empty_figure(1.5 + 0.34 * len(conditions))
    left, right = figure.subplots(1, 2, sharey=True)
    over_load = all(condition.coefficient is not None for condition in conditions)
    drawn = (
        (("coefficient", "friction coefficient"), ("slope_of_coefficient", "its slope against speed"))
        if over_load
        else (("level", "sliding friction"), ("slope", "its slope against speed"))
    )
    for ax, (name, label) in zip((left, right), drawn, strict=True):
        for place, condition in enumerate(conditions):
            estimate = getattr(condition, name)
            away = np.abs(np.array(estimate.interval)[:, None] - estimate.value)
            colour, marker = MARKS[condition.answer]
            look = {**BARS, "fmt": marker, "color": colour, "label": condition.answer}
            ax.errorbar(estimate.value, place, xerr=away, **look)
        ax.axvline(0, color=INK, linewidth=0.8)
        ax.set_xlabel(style.axis_label(f"{label}, 95 %", getattr(conditions[0], name).unit, between="\n"))
    left.set_yticks(range(len(conditions)), [style.shortened(condition.name, 30) for condition in conditions])
    left.set_ylim(len(conditions) - 0.4, -0.6)
    handles, labels = left.get_legend_handles_labels()
    both = dict(zip(labels, handles, strict=True))
    figure.legend(both.values(), both.keys(), ncols=2, loc="outside upper left")
    return figure


@style.styled
def plot_condition_loops(comparison: Comparison) -> Figure:
    """Friction against displacement and velocity, a row for each condition, as the thesis's figures 7.3 and 7.6."""

    rows = [findings for findings in comparison.findings if findings.loops is not None][:MOST_ROWS]
    figure = style.empty_figure(0.4 + 2.1 * len(rows))
    axes = figure.subplots(len(rows), 2, sharey="row", squeeze=False)
    for (left, right), condition in zip(axes, rows, strict=True):
        assert condition.loops is not None
        for ax, draw in ((left, plot_displacement_loop), (right, plot_velocity_loop)):
            draw(condition, ax=ax)
            ax.get_legend().remove()
        right.set_ylabel("")
        slope = condition.loops.slope
        low, high = slope.interval
        left.set_title(style.shortened(condition.name, 30), loc="left")
        digits = decimals(slope.spread, slope.value)
        text = f"{slope.value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f}) {spelled(slope.unit)}"
        right.set_title(text, loc="right", fontsize=8)
    return figure


def plates_of(findings: Findings) -> list[style.Plate]:
    """The figures of one record."""
    plates = [style.captioned("squeak", "spectrogram", partial(plot_squeaks, findings.squeaks))]
    if findings.squeaks.loudest is not None:
        plates += [*_of_spectra(findings), *_of_bursts(findings, findings.squeaks.loudest)]
    return plates


def _of_spectra(findings: Findings) -> list[style.Plate]:
    """What sounds in the bursts, and which frequencies the motions share."""
    record, spectra, channel = findings.record, findings.spectra, findings.squeaks.channel
    if spectra is None:
        return []
    draw = partial(plot_burst_spectra, spectra, channel=channel, record=record)
    plates = [style.captioned("squeak", "spectra", draw, compared=spectra.compared)]
    if spectra.coherence:
        draw = partial(plot_coherence, spectra, channel=channel, record=record)
        plates.append(style.captioned("squeak", "coherence", draw, channel=_quantity(record, channel)))
    return plates


def _of_bursts(findings: Findings, loudest: Squeak) -> list[style.Plate]:
    """Where in the cycle it sounds, the loudest burst, and the friction that feeds it."""
    squeaks, plates = findings.squeaks, []
    if not math.isnan(squeaks.forcing):
        plates.append(style.captioned("squeak", "forcing-cycle", partial(plot_forcing_cycle, squeaks)))
    if len(findings.record) > 1:
        number = squeaks.bursts.index(loudest) + 1
        plates.append(style.captioned("squeak", "burst", partial(plot_burst, findings, burst=loudest), number=number))
    if findings.loops is not None:
        plates.append(style.captioned("squeak", "friction-velocity", partial(plot_velocity_loop, findings)))
    return plates


def plates_together(comparison: Comparison) -> list[style.Plate]:
    """The figures of several records side by side."""
    if all(findings.loops is None for findings in comparison.findings):
        return []
    draws = {"conditions": plot_conditions, "loops": plot_condition_loops}
    return [style.captioned("squeak", kind, partial(draw, comparison)) for kind, draw in draws.items()]


def _panels(count: int) -> tuple[Figure, Any]:
    figure, axes = style.new_figure(count, height=1.0 + 1.15 * count)
    return figure, np.atleast_1d(axes)


def _trace(ax: Axes, record: Record, name: str) -> None:
    factor, unit = prefixed(record[name], record.channels[name].unit)
    ax.plot(*style.envelope(record.time, factor * record[name]), color=TRACED.get(name, BLUE), linewidth=0.8)
    ax.set_ylabel(style.axis_label(_quantity(record, name), unit, between="\n"))


def _spectrogram(ax: Axes, squeaks: Squeaks) -> Any:
    """Power over time and frequency in decibel, the largest of each column's frames."""
    from scipy.signal import stft

    record = squeaks.record
    values = record[squeaks.channel] - record[squeaks.channel].mean()
    size = min(len(values), max(64, 2 ** round(math.log2(WINDOW * record.fs))))
    frequencies, times, waves = stft(values, record.fs, nperseg=size, noverlap=size - max(1, size // 8))
    power = np.abs(waves) ** 2
    power, times = style.strongest(power, times, COLUMNS)
    inside = (frequencies >= squeaks.band[0] / 2) & (frequencies <= squeaks.band[1])
    last = _highest(frequencies[inside], {squeaks.channel: power[inside].sum(axis=1)}, squeaks.channel)
    shown = power[inside][:last]
    level = 10 * np.log10(np.maximum(shown / max(float(shown.max()), np.finfo(float).tiny), 1e-30))
    colours: Any = {"cmap": "cividis", "vmin": -SPAN, "vmax": 0}
    return style.coloured(ax, record.start + times, frequencies[inside][:last], np.maximum(level, -SPAN), **colours)


def _frame(ax: Axes, burst: Squeak) -> None:
    """The dominant frequency of a tonal burst."""
    if burst.kind in ("squeak", "squeal", "tonal") and burst.frequency < ax.get_ylim()[1]:
        ends = [burst.start, burst.end]
        ax.plot(ends, [burst.frequency] * 2, color="black", linewidth=2.4, alpha=0.5)
        ax.plot(ends, [burst.frequency] * 2, color="white", linewidth=1.0)


def _highest(frequencies: Array, powers: Mapping[str, Array], heard: str) -> int:
    """How many of the frequencies are worth showing: twice those below which nearly all is that was heard."""
    power = powers.get(heard, next(iter(powers.values())))
    share = np.cumsum(power[1:]) / max(float(power[1:].sum()), np.finfo(float).tiny)
    return min(len(frequencies), max(2 * int(np.searchsorted(share, 1 - SHARE)), 16))


def _within_one(begin: float, end: float) -> list[tuple[float, float]]:
    """A stretch of turns as stretches between 0 and 1."""
    pieces: list[tuple[float, float]] = []
    while end - math.floor(begin) > 1 and len(pieces) < 50:
        pieces.append((begin - math.floor(begin), 1.0))
        begin = math.floor(begin) + 1.0
    return [*pieces, (begin - math.floor(begin), end - math.floor(begin))]


def _quantity(record: Record, name: str) -> str:
    """What a channel measures, short enough for an axis."""
    return SHORT.get(name) or re.split("[,(]", record.channels[name].quantity or name)[0].strip()
