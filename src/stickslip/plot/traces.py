"""The record over time: its channels, and the force balance that gave the friction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from stickslip.balance.motion import is_measured
from stickslip.plot.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SHADE,
    SKY,
    Array,
    axes_of,
    axis_label,
    envelope,
    new_figure,
    prefixed,
    styled,
)
from stickslip.signals.derivatives import differentiate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.findings import Findings
    from stickslip.record.record import Record

PANELS = (("x", "z"), ("theta",), ("v",), ("a",), ("force",), ("load",), ("friction",), ("normal",), ("y",), ("sound",))
MOST_SHADES = 300
CLOSE_UP_CYCLES = 6
_TERMS = {
    "spring": (BLUE, "--"), "inertia": (GREEN, "-."), "damper": (PURPLE, ":"), "applied force": (SKY, "--"),
    "friction": (ORANGE, "-"),
}  # fmt: skip
_COLOURS = {"x": BLUE, "z": SKY, "friction": ORANGE, "force": PURPLE, "load": PURPLE, "v": GREEN}


@styled
def plot_traces(findings: Findings, *, record: Record | None = None, most: int = 5) -> Figure:
    """The channels over time, one under the other, with the times of sticking shaded.

    Parameters
    ----------
    findings : Findings
        What to draw.
    record : Record, optional
        A stretch of its record, to look closer.
    most : int
        Panels at most; the first ones of x and z, theta, v, a, force, load, friction, normal, y, sound that exist.

    Returns
    -------
    Figure
    """
    record = findings.record if record is None else record
    panels = [names for names in PANELS if any(name in record for name in names)]
    if len(panels) > most:
        panels = [names for names in panels if names != ("a",)][:most]
    if not panels:
        panels = [(name,) for name in list(record)[:most]]
    figure, axes = new_figure(len(panels), height=1.0 + 1.25 * len(panels))
    axes = np.atleast_1d(axes)
    for ax, names in zip(axes, panels, strict=True):
        _trace(ax, record, [name for name in names if name in record])
        shade_sticks(ax, findings, record)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(float(record.time[0]), float(record.time[-1]))
    figure.align_ylabels(axes)
    return figure


def close_up(findings: Findings) -> Record | None:
    """About six cycles from the middle of the record; None where the whole record is hardly longer."""
    record = findings.record
    if findings.loops is None or record.stamps is not None:
        return None
    rows = int(CLOSE_UP_CYCLES * record.fs / findings.loops.frequency.value)
    if rows < 30 or len(record) < 2 * rows:
        return None
    first = (len(record) - rows) // 2
    return record.rows(first, first + rows)


def shade_sticks(ax: Axes, findings: Findings, record: Record) -> None:
    """Shade the time that the contact stuck, where the stretches can be told apart."""
    if findings.sticks is None:
        return
    first, last = float(record.time[0]), float(record.time[-1])
    spans = [
        (max(event.time, first), min(event.time + event.duration, last) - max(event.time, first))
        for event in findings.sticks.events
        if event.kind == "stick" and event.time < last and event.time + event.duration > first
    ]
    if not 0 < len(spans) <= MOST_SHADES:
        return
    low, high = ax.get_ylim()
    ax.broken_barh(spans, (low, high - low), color=SHADE, alpha=0.55, linewidth=0, zorder=0)
    ax.set_ylim(low, high)


def force_balance(record: Record) -> dict[str, Array] | None:
    """The terms of the balance that gave the friction, in the order of drawing; None where it was not computed.

    ``f = k (z - x) - m a - c v + P``, with ``c (v - dz/dt)`` for a damper on the base; the constants are those in the
    record, not those at hand.
    """
    rig = record.rig
    if rig is None or rig.mass is None or rig.stiffness is None or is_measured(record, "friction"):
        return None
    stretch = record["z"] - record["x"] if "z" in record else -record["x"]
    terms = {"spring": rig.stiffness * stretch, "inertia": -rig.mass * record["a"]}
    if rig.damping:
        across = record["v"]
        if rig.damper == "base" and "z" in record:
            derive: Literal["smoother", "five-point"] = "five-point" if rig.method == "five-point" else "smoother"
            moved = differentiate(record["z"], record.fs, method=derive, bandwidth=rig.bandwidth)
            across = across - moved.values
        terms["damper"] = -rig.damping * across
    if "force" in record:
        terms["applied force"] = record["force"]
    return {**terms, "friction": record["friction"]}


@styled
def plot_force_balance(findings: Findings, *, record: Record | None = None, ax: Axes | None = None) -> Axes:
    """The terms of the force balance: spring, inertia, damper, applied force, and the friction that they leave.

    Parameters
    ----------
    findings : Findings
        Of a record whose friction came from ``friction_force``.
    record : Record, optional
        The stretch to draw; all of it unless given.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
    """
    ax = axes_of(ax)
    whole = findings.record
    record = whole if record is None else record
    terms = force_balance(whole)
    assert terms is not None
    first = round((record.start - whole.start) * whole.fs)
    parts = {words: values[first : first + len(record)] for words, values in terms.items()}
    factor, unit = prefixed(np.concatenate(list(parts.values())), "N")
    for words, values in parts.items():
        colour, line = _TERMS[words]
        ax.plot(*envelope(record.time, factor * values), line, color=colour, label=words)
    shade_sticks(ax, findings, record)
    ax.axhline(0, color=FAINT, linewidth=0.8)
    ax.set(xlabel="time [s]", ylabel=axis_label("force on the mass", unit))
    ax.set_xlim(float(record.time[0]), float(record.time[-1]))
    ax.legend(ncols=len(terms), loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return ax


def _trace(ax: Axes, record: Record, names: Sequence[str]) -> None:
    peak = np.array([np.nanmax(np.abs(record[n])) if np.isfinite(record[n]).any() else 0.0 for n in names])
    factor, unit = prefixed(peak, record.channels[names[0]].unit)
    for name in names:
        ax.plot(*envelope(record.time, factor * record[name]), color=_COLOURS.get(name, INK), label=name)
    words = {"x": "displacement", "theta": "angle", "y": "normal\ndisplacement", "a": "acceleration", "v": "velocity"}
    ax.set_ylabel(axis_label(words.get(names[0], names[0]), unit, between="\n"))
    if len(names) > 1:
        labels = {"x": "mass (x)", "z": "base (z)"}
        for line in ax.get_lines():
            line.set_label(labels.get(str(line.get_label()), str(line.get_label())))
        ax.legend(ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.97))
