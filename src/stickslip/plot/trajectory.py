"""A simulated motion: traces, loops and phase portrait, drawn from the exact solution, with sticks marked."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stickslip.plot.plate import Plate, plate
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

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.solve.trajectory import Trajectory

CLOSE_CYCLES = 3
POINTS = 2400  # of a curve; the instants of events come on top
A_CYCLE, MOST_POINTS = 60, 200_000  # instants looked at in each cycle of a long run before its envelope is drawn
A_PIECE, MOST_PIECES = 24, 400  # instants in each piece, so that a stiff contact's ringing is drawn as it is
MOST_SHADES = 150
_UNITS = {"x": "m", "z": "m", "v": "m/s", "slip": "m/s", "friction": "N", "force": "N"}
_WORDS = {"x": "displacement", "v": "velocity", "slip": "sliding velocity", "friction": "friction", "force": "force"}
_COLOURS = {"x": BLUE, "z": SKY, "v": GREEN, "friction": ORANGE, "force": PURPLE}
_KINDS = {"stick": ("sticks", 0.8), "microstick": ("microsticks", 0.4)}  # legend, opacity of the shade


def cycle_of(run: Trajectory) -> float:
    """The time after which the motion repeats, or could [s]: the drive's period, else that of the events themselves,
    else the natural one; at most the whole run."""
    motion = run.table.motion
    if math.isfinite(motion.period):
        return min(motion.period, run.duration)
    natural = 1 / run.system.frequency if run.system.stiffness else run.duration
    if motion.tones:
        return min(max(natural, *(2 * math.pi / tone[2] for tone in motion.tones)), run.duration)
    same = np.flatnonzero(run.modes == run.modes[-1])
    found = float(run.starts[same[-1]] - run.starts[same[-2]]) if len(same) > 1 and motion.face else natural
    return min(found, run.duration)


def last_cycles(run: Trajectory, cycles: float) -> tuple[float, float]:
    """First and last instant of the run's last `cycles`; of a motion that comes to rest, of all that moved."""
    if run.status == "at rest":
        moved = float(run.starts[-1]) if len(run.starts) > 1 else run.duration
        return 0.0, min(run.duration, moved + 0.15 * max(moved, cycle_of(run)))
    return max(0.0, run.duration - cycles * cycle_of(run)), run.duration


def curve(run: Trajectory, outputs: tuple[str, ...], *, first: float, last: float) -> tuple[Array, list[Array]]:
    """Instants and exact values between two of them: both sides of every event, so that jumps stay upright; of very
    many cycles the envelope."""
    count = int(np.clip(A_CYCLE * (last - first) / cycle_of(run), POINTS, MOST_POINTS))
    times = np.linspace(first, last, count)
    if count > POINTS:
        values, _ = run.sample(times, outputs)
        drawn = [envelope(times, row, columns=POINTS // 2) for row in values]
        return drawn[0][0], [row for _, row in drawn]
    ends = run.starts + run.durations
    shown = (ends > first) & (run.starts < last)
    begin, end = np.clip(run.starts[shown], first, last), np.clip(ends[shown], first, last)
    if len(begin) <= MOST_PIECES:
        inner = begin[:, None] + np.linspace(0, 1, A_PIECE) * (end - begin)[:, None]
        times = np.unique(np.concatenate([times, begin, np.maximum(np.nextafter(begin, -np.inf), first), *inner]))
    values, _ = run.sample(np.clip(times, first, last), outputs)
    return times, list(values)


def stretches(run: Trajectory, kind: str, *, first: float, last: float) -> list[tuple[float, float]]:
    """Start and length of each stretch of one kind of mode ("slip", "stick", "microstick"), within two instants."""
    chosen = np.array([mode.kind == kind for mode in run.table.modes])[run.modes]
    begin = np.clip(run.starts[chosen], first, last)
    length = np.clip(run.starts[chosen] + run.durations[chosen], first, last) - begin
    return [(float(b), float(n)) for b, n in zip(begin, length, strict=True) if n > 0]


@styled
def plot_motion(run: Trajectory, *, first: float = 0.0, last: float | None = None) -> Figure:
    """Displacement, velocity, friction and force over time, one under the other, with sticks shaded.

    Parameters
    ----------
    run : Trajectory
        What to draw.
    first, last : float
        Time shown [s]; to the end where `last` is left out.

    Returns
    -------
    Figure
    """
    last = run.duration if last is None else last
    motion = run.table.motion
    panels = [("x", *(["z"] if motion.base else [])), ("v",), ("friction",), *([("force",)] if motion.force else [])]
    figure, axes = new_figure(len(panels), height=1.0 + 1.3 * len(panels))
    for ax, names in zip(axes, panels, strict=True):
        times, values = curve(run, names, first=first, last=last)
        factor, unit = prefixed(np.concatenate(values), _UNITS[names[0]])
        for name, row in zip(names, values, strict=True):
            words = {"x": "mass", "z": "spring's end"}.get(name)
            ax.plot(times, factor * row, color=_COLOURS[name], label=words, linestyle="--" if name == "z" else "-")
        ax.set_ylabel(axis_label(_WORDS[names[0]], unit, between="\n"))
        if np.min(values) < 0 < np.max(values):
            ax.axhline(0, color=FAINT, linewidth=0.8, zorder=0.5)
        _shade(ax, run, first, last)
    handles = [
        h for h in axes[0].get_legend_handles_labels()[0] if motion.base or h.get_label() in ("sticks", "microsticks")
    ]
    if handles:
        axes[0].legend(handles=handles, ncols=4, loc="lower left", bbox_to_anchor=(0, 1.0))
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(first, last)
    figure.align_ylabels(axes)
    return figure


@styled
def plot_loop(run: Trajectory, *, against: str = "x", ax: Axes | None = None) -> Axes:
    """Friction against displacement or velocity: the last cycle, over those before it.

    Parameters
    ----------
    run : Trajectory
        What to draw.
    against : {"x", "slip"}
        Displacement of the mass, or its velocity on the counter-face.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
    """
    return _portrait(run, against, "friction", axes_of(ax))


@styled
def plot_phase(run: Trajectory, *, ax: Axes | None = None) -> Axes:
    """Velocity against displacement: the last cycle, over those before it, with sticks marked.

    Parameters
    ----------
    run : Trajectory
        What to draw.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
    """
    return _portrait(run, "x", "v", axes_of(ax, height=4.2))


@styled
def plates_of(run: Trajectory) -> tuple[Plate, ...]:
    """The figures that show a run, in reading order."""
    kinds = {mode.kind for mode in np.array(run.table.modes, dtype=object)[np.unique(run.modes)]}
    marks = {"stick": "dark grey: it sticks", "microstick": "light grey: the contact holds and yields a little"}
    shaded = "; ".join(words for kind, words in marks.items() if kind in kinds)
    shaded = f" {shaded[0].upper()}{shaded[1:]}." if shaded else ""
    first, last = last_cycles(run, CLOSE_CYCLES)
    plates = []
    if first > 0:
        plates.append(
            plate("whole-run", plot_motion(run), "The whole run", f"From the start, over all of the time.{shaded}")
        )
    words = "As long as it moves" if run.status == "at rest" else "The last cycles"
    plates += [
        plate("motion", plot_motion(run, first=first, last=last), words,
              f"Exact between events; friction jumps where a slip begins, ends or turns.{shaded}"),
        plate("friction-displacement", plot_loop(run), "Friction against displacement",
              "The area of a loop is the work that friction takes in a cycle. Flat top and bottom: sliding. Sides: the "
              "contact holds, upright where it is rigid, sloping where it gives way."),
        plate("friction-velocity", plot_loop(run, against="slip"), "Friction against sliding velocity",
              "The law as the motion passes through it. A contact that holds bears whatever the other forces ask for: "
              "the upright at zero."),
        plate("phase-portrait", plot_phase(run), "Phase portrait",
              "Velocity against displacement, run through clockwise. Marked: where the contact holds."),
    ]  # fmt: skip
    return tuple(plates)


def _shade(ax: Axes, run: Trajectory, first: float, last: float) -> None:
    low, high = ax.get_ylim()
    for kind, (words, opacity) in _KINDS.items():
        spans = stretches(run, kind, first=first, last=last)
        if 0 < len(spans) <= MOST_SHADES:
            ax.broken_barh(spans, (low, high - low), color=SHADE, alpha=opacity, linewidth=0, zorder=0, label=words)
    ax.set_ylim(low, high)


def _portrait(run: Trajectory, across: str, up: str, ax: Axes) -> Axes:
    """One output against another: the cycles before thin, the last one strong, what holds marked along it."""
    first, last = last_cycles(run, 20)
    split = 0.0 if run.status == "at rest" else max(first, last - cycle_of(run))
    _, before = curve(run, (across, up), first=first, last=last)
    times, values = curve(run, (across, up), first=split, last=last)
    (x_factor, x_unit), (y_factor, y_unit) = prefixed(before[0], _UNITS[across]), prefixed(before[1], _UNITS[up])
    if split > first:
        ax.plot(
            x_factor * before[0], y_factor * before[1], color=FAINT, linewidth=0.6, alpha=0.7, label="cycles before"
        )
    label = "last cycle" if split > 0 else "the motion"
    ax.plot(x_factor * values[0], y_factor * values[1], color=ORANGE if up == "friction" else GREEN, label=label)
    for kind, colour, words in (("microstick", SKY, "microstick"), ("stick", BLUE, "stick")):
        spans = stretches(run, kind, first=split, last=last)
        held = np.zeros(len(times), dtype=bool)
        for begin, length in spans:
            held |= (times >= begin) & (times < begin + length)
        if not held.any():
            continue
        x, y = (np.where(held, factor * row, np.nan) for factor, row in zip((x_factor, y_factor), values, strict=True))
        point = (
            up == "v" and kind == "stick" and not run.table.motion.face
        )  # at rest, a stick is a point of the portrait
        dot = "o" if point else ""
        ax.plot(x, y, marker=dot, markevery=_middles(held), color=colour, linewidth=3, markersize=6, label=words)
    for line, row in ((ax.axvline, before[0]), (ax.axhline, before[1])):
        if row.min() < 0 < row.max():  # an axis far from the motion would only squeeze it
            line(0, color=FAINT, linewidth=0.8, zorder=0.5)
    if up == "v" and "way" in run.table.motion.face:
        belt = y_factor * run.table.motion.face["way"]
        ax.axhline(belt, color=INK, linewidth=0.9, linestyle=":", zorder=1, label="belt")
    ax.set(xlabel=axis_label(_WORDS[across], x_unit), ylabel=axis_label(_WORDS[up], y_unit))
    ax.legend(ncols=4, loc="lower left", bbox_to_anchor=(0, 1.0))
    return ax


def _middles(held: NDArray[np.bool_]) -> list[int]:
    """The middle of each unbroken row of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(int)))
    return [int(middle) for middle in (edges[::2] + edges[1::2] - 1) // 2]
