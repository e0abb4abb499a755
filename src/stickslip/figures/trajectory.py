"""A simulated motion: traces, loops and phase portraits, drawn from the exact solution, with sticks marked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip import arrays
from stickslip.arrays import Array, Mask
from stickslip.figures.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SHADE,
    SKY,
    Plate,
    axes_of,
    axis_label,
    captioned,
    envelope,
    legend_above,
    new_figure,
    prefixed,
    styled,
)
from stickslip.oscillator import Structure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.solve.trajectory import Trajectory

CLOSE_CYCLES = 3
POINTS = 2400  # of a curve; the instants of events come on top
A_CYCLE, MOST_POINTS = 60, 200_000  # instants looked at in each cycle of a long run before its envelope is drawn
A_PIECE, MOST_PIECES = 24, 400  # instants in each piece, so that a stiff contact's ringing is drawn as it is
MOST_EDGES = 6000  # pieces whose both ends are drawn, so that jumps stay upright
MOST_SHADES = 150
MOST_DRAWN = 4  # masses with a phase portrait, contacts with a loop
_WORDS = {
    "x": "displacement", "way": "displacement along the contact", "v": "velocity", "slip": "sliding velocity",
    "friction": "friction", "load": "normal load", "force": "force",
}  # fmt: skip
_TURNING = {"x": "angle", "v": "angular velocity"}
_COLOURS = {"x": BLUE, "z": SKY, "v": GREEN, "friction": ORANGE, "load": INK, "force": PURPLE}
MASSES = (BLUE, ORANGE, GREEN, PURPLE, SKY, INK)
_KINDS = {
    "stick": ("sticks", SHADE, 0.8),
    "microstick": ("microsticks", SHADE, 0.4),
    "flight": ("lifts off", SKY, 0.25),
}

Quantity = tuple[str, int]
"""An output of a run and which of its rows: that of a mass, or of a contact."""


def contacts_of(run: Trajectory) -> int:
    """How many contacts there are."""
    return len(run.system.contacts) if isinstance(run.system, Structure) else 1


def numbered_words(run: Trajectory, label: str, name: str, row: int) -> str:
    """What a row of an output is called: "velocity" of one mass, "velocity v2", "friction, contact 2" of several."""
    if name in ("z", "force") or len(run.labels("x" if name in ("x", "v") else "friction")) == 1:
        return label
    return f"{label} {name}{row + 1}" if name in ("x", "v") else f"{label}, contact {row + 1}"


def period_of(run: Trajectory) -> float:
    """The time after which the motion repeats, or would [s]: the drive's period, else that of the events themselves,
    else the natural one; the whole run where there is none."""
    motion = run.table.motion
    if math.isfinite(motion.period):
        return motion.period
    natural = 1 / run.system.frequency if run.system.frequency else run.duration
    if motion.tones:
        return max(natural, *(2 * math.pi / tone[2] for tone in motion.tones))
    same = np.flatnonzero(run.modes == run.modes[-1])
    pulled = motion.rates and motion.knots is None  # by a belt or a ramp
    return float(run.starts[same[-1]] - run.starts[same[-2]]) if len(same) > 1 and pulled else natural


def cycle_of(run: Trajectory) -> float:
    """What is shown as one cycle [s]: the motion's period, at most the whole run."""
    return min(period_of(run), run.duration)


def last_cycles(run: Trajectory, cycles: float) -> tuple[float, float]:
    """First and last instant of the run's last `cycles`; of a motion that comes to rest, of all that moved."""
    if run.status == "at rest":
        moved = float(run.starts[-1]) if len(run.starts) > 1 else run.duration
        return 0.0, min(run.duration, moved + 0.15 * max(moved, cycle_of(run)))
    return max(0.0, run.duration - cycles * cycle_of(run)), run.duration


def sampled(run: Trajectory, wanted: Sequence[str | Quantity], times: Array) -> Array:
    """Exact values of some quantities at increasing instants, a row for each."""
    pairs = [(quantity, 0) if isinstance(quantity, str) else quantity for quantity in wanted]
    names = list(dict.fromkeys("x" if name == "way" else name for name, _ in pairs))
    values, _ = run.sample(times, tuple(names))
    counts = [len(run.labels(name)) for name in names]
    rows = dict(zip(names, np.split(values, np.cumsum(counts)[:-1]), strict=True))
    if "x" in rows:
        rows["way"] = run.system.tangents @ rows["x"] if isinstance(run.system, Structure) else rows["x"]
    return np.array([rows[name][row] for name, row in pairs])


def curve(run: Trajectory, wanted: Sequence[str | Quantity], *, first: float, last: float) -> tuple[Array, list[Array]]:
    """Instants and exact values between two of them: both sides of every event, so that jumps stay upright; of very
    many cycles the envelope."""
    count = int(np.clip(A_CYCLE * (last - first) / cycle_of(run), POINTS, MOST_POINTS))
    times = np.linspace(first, last, count)
    if count > POINTS:
        drawn = [envelope(times, row, columns=POINTS // 2) for row in sampled(run, wanted, times)]
        return drawn[0][0], [row for _, row in drawn]
    ends = run.starts + run.durations
    shown = (ends > first) & (run.starts < last)
    begin, end = np.clip(run.starts[shown], first, last), np.clip(ends[shown], first, last)
    if len(begin) <= MOST_EDGES:
        times = np.concatenate([times, begin, np.maximum(np.nextafter(begin, -np.inf), first)])
    if len(begin) <= MOST_PIECES:
        times = np.concatenate([times, *(begin[:, None] + np.linspace(0, 1, A_PIECE) * (end - begin)[:, None])])
    times = np.clip(np.unique(times), first, last)
    return times, list(sampled(run, wanted, times))


def stretches(run: Trajectory, kind: str, *, first: float, last: float, contact: int = 0) -> Array:
    """Start and length of each stretch of one kind of mode at a contact ("slip", "stick", "microstick", "flight"),
    within two instants (n, 2)."""
    chosen = np.array([mode == kind for mode in run.kinds(contact)])[run.modes]
    chosen &= (run.starts < last) & (run.starts + run.durations > first)
    begin, end = (np.clip(ends[chosen], first, last) for ends in (run.starts, run.starts + run.durations))
    spans: Array = np.column_stack([begin, end - begin])[end > begin]
    return spans


@styled
def plot_motion(run: Trajectory, *, first: float = 0.0, last: float | None = None) -> Figure:
    """Displacement, velocity, friction and force over time, one under the other, with sticks shaded.

    Of a structure every mass is drawn, and each contact's friction has a panel of its own, shaded by what that contact
    does; a load that follows the motion is drawn too.
    """
    last = run.duration if last is None else last
    panels = _panels(run)
    figure, axes = new_figure(len(panels), height=1.0 + 1.3 * len(panels))
    for ax, wanted in zip(axes, panels, strict=True):
        times, values = curve(run, wanted, first=first, last=last)
        factor, unit = prefixed(np.concatenate(values), unit_of(run, wanted[0]))
        for quantity, row in zip(wanted, values, strict=True):
            ax.plot(times, factor * row, **_line(run, quantity, wanted))
        ax.set_ylabel(axis_label(_panel_words(run, wanted), unit, between="\n"))
        if np.min(values) < 0 < np.max(values):
            ax.axhline(0, color=FAINT, linewidth=0.8, zorder=0.5)
        own = [row for name, row in wanted if name in ("friction", "load")]
        if contacts_of(run) == 1 or own:
            _shade(ax, run, first, last, own[0] if own else 0)
    for ax in axes:
        handles = [
            handle for handle in ax.get_legend_handles_labels()[0] if ax is axes[0] or _shades_alone(run, handle)
        ]
        if handles and (ax is axes[0] or contacts_of(run) > 1):
            legend_above(ax, handles=handles, columns=6)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(first, last)
    figure.align_ylabels(axes)
    return figure


def _panels(run: Trajectory) -> list[list[Quantity]]:
    motion, every = run.table.motion, range(len(run.labels("x")))
    turns = [j for j in every if unit_of(run, ("x", j)) == "rad"]
    moves = [j for j in every if j not in turns]
    panels = [[*(("x", j) for j in moves), *([("z", 0)] if motion.base else [])], [("v", j) for j in moves]]
    panels += [[(name, j) for j in turns] for name in _TURNING]
    panels = [panel for panel in panels if panel]
    for c in range(contacts_of(run)):
        panels.append([("friction", c)])
        if pressed(run, c):
            panels.append([("load", c)])
    return [*panels, *([[("force", 0)]] if motion.force else [])]


def unit_of(run: Trajectory, quantity: Quantity) -> str:
    """SI unit of one row of an output."""
    name, row = quantity
    return "m" if name == "way" else run.units(name)[row]


def _named(run: Trajectory, quantity: Quantity) -> str:
    """What a quantity is called in words, without its number."""
    return (_TURNING if unit_of(run, quantity).startswith("rad") else _WORDS)[quantity[0]]


def pressed(run: Trajectory, contact: int) -> bool:
    """Whether a contact's load follows the motion."""
    return isinstance(run.system, Structure) and run.system.contacts[contact].normal is not None


def _panel_words(run: Trajectory, wanted: list[Quantity]) -> str:
    name, row = wanted[0]
    label = _named(run, wanted[0]) if name in ("x", "v") else numbered_words(run, _WORDS[name], name, row)
    return label.replace(", ", "\n").replace("normal load", "load")


def _line(run: Trajectory, quantity: Quantity, wanted: list[Quantity]) -> dict[str, Any]:
    """Colour, line and legend of one row of a panel."""
    name, row = quantity
    several = len(run.labels("x")) > 1
    labels = {"x": f"x{row + 1}" if several else "mass", "z": "base" if several else "spring's end"}.get(name)
    colour = MASSES[row % len(MASSES)] if several and name in ("x", "v") else _COLOURS[name]
    alone = name == "x" and not several and len(wanted) == 1
    return {"color": colour, "linestyle": "--" if name == "z" else "-", "label": None if alone else labels}


def _shades_alone(run: Trajectory, handle: Any) -> bool:
    return handle.get_label() in {label for label, *_ in _KINDS.values()}


@styled
def plot_loop(run: Trajectory, *, against: str = "x", contact: int = 0, ax: Axes | None = None) -> Axes:
    """Friction against displacement, velocity or load: the last cycle, over those before it."""
    across = "way" if against == "x" and isinstance(run.system, Structure) else against
    return _portrait(run, (across, contact), ("friction", contact), axes_of(ax), contact)


@styled
def plot_phase(run: Trajectory, *, mass: int = 0, ax: Axes | None = None) -> Axes:
    """Velocity against displacement: the last cycle, over those before it, with sticks of a single contact marked."""
    marked = 0 if contacts_of(run) == 1 else None
    return _portrait(run, ("x", mass), ("v", mass), axes_of(ax, height=4.2), marked)


@styled
def plates_of(run: Trajectory) -> tuple[Plate, ...]:
    """The figures that show a run, in reading order."""
    seen = np.unique(run.modes)
    kinds = {run.kinds(c)[mode] for c in range(contacts_of(run)) for mode in seen}
    marks = {"stick": "dark grey: it sticks", "microstick": "light grey: the contact holds and yields a little",
             "flight": "blue: the contact has lifted off"}  # fmt: skip
    shaded = "; ".join(label for kind, label in marks.items() if kind in kinds)
    shaded = f" {shaded[0].upper()}{shaded[1:]}." if shaded else ""
    first, last = last_cycles(run, CLOSE_CYCLES)
    plates = []
    if first > 0:
        plates.append(captioned("run", "whole-run", partial(plot_motion, run), shaded=shaded))
    span = "As long as it moves" if run.status == "at rest" else "The last cycles"
    plates.append(
        captioned("run", "motion", partial(plot_motion, run, first=first, last=last), span=span, shaded=shaded)
    )
    contacts, masses = contacts_of(run), len(run.labels("x"))
    for c in range(min(contacts, MOST_DRAWN)):
        number, of = (f"-{c + 1}", f", contact {c + 1}") if contacts > 1 else ("", "")
        for name, against in (("displacement", "x"), ("velocity", "slip"), ("load", "load")):
            if against == "load" and not pressed(run, c):
                continue
            draw = partial(plot_loop, run, against=against, contact=c)
            plates.append(captioned("run", f"friction-{name}", draw, name=f"friction-{name}{number}", of=of))
    holds = " Marked: where the contact holds." if contacts == 1 else ""
    for j in range(min(masses, MOST_DRAWN)):
        number, of = (f"-x{j + 1}", f" of x{j + 1}") if masses > 1 else ("", "")
        draw, name = partial(plot_phase, run, mass=j), f"phase-portrait{number}"
        plates.append(captioned("run", "phase-portrait", draw, name=name, of=of, holds=holds))
    return tuple(plates)


def _shade(ax: Axes, run: Trajectory, first: float, last: float, contact: int) -> None:
    low, high = ax.get_ylim()
    for kind, (label, colour, opacity) in _KINDS.items():
        spans = stretches(run, kind, first=first, last=last, contact=contact)
        if 0 < len(spans) <= MOST_SHADES:
            ax.broken_barh(
                spans.tolist(), (low, high - low), color=colour, alpha=opacity, linewidth=0, zorder=0, label=label
            )
    ax.set_ylim(low, high)


def _portrait(run: Trajectory, across: Quantity, up: Quantity, ax: Axes, contact: int | None) -> Axes:
    """One quantity against another: the cycles before thin, the last one strong, what holds marked along it."""
    first, last = last_cycles(run, 20)
    split = 0.0 if run.status == "at rest" else max(first, last - cycle_of(run))
    _, before = curve(run, (across, up), first=first, last=last)
    times, values = curve(run, (across, up), first=split, last=last)
    (x_factor, x_unit), (y_factor, y_unit) = (
        prefixed(row, unit_of(run, quantity)) for row, quantity in zip(before, (across, up), strict=True)
    )
    if split > first:
        ax.plot(
            x_factor * before[0], y_factor * before[1], color=FAINT, linewidth=0.6, alpha=0.7, label="cycles before"
        )
    label = "last cycle" if split > 0 else "the motion"
    ax.plot(x_factor * values[0], y_factor * values[1], color=ORANGE if up[0] == "friction" else GREEN, label=label)
    marks = (("microstick", SKY, "microstick"), ("stick", BLUE, "stick"), ("flight", PURPLE, "lifted off"))
    for kind, colour, text in marks if contact is not None and contacts_of(run) else ():
        shown = np.zeros(len(times), dtype=bool)
        for begin, length in stretches(run, kind, first=split, last=last, contact=contact or 0):
            shown |= (times >= begin) & (times < begin + length)
        if not shown.any():
            continue
        x, y = (np.where(shown, factor * row, np.nan) for factor, row in zip((x_factor, y_factor), values, strict=True))
        # at rest, a stick is a point of the portrait
        point = up[0] == "v" and kind == "stick" and not run.table.motion.face and len(run.labels("x")) == 1
        dot = "o" if point else ""
        ax.plot(x, y, marker=dot, markevery=_middles(shown), color=colour, linewidth=3, markersize=6, label=text)
    for line, row in ((ax.axvline, before[0]), (ax.axhline, before[1])):
        if row.min() < 0 < row.max():  # an axis far from the motion would only squeeze it
            line(0, color=FAINT, linewidth=0.8, zorder=0.5)
    if up[0] == "v" and "way" in run.table.motion.face and not isinstance(run.system, Structure):
        belt = y_factor * run.table.motion.face["way"]
        ax.axhline(belt, color=INK, linewidth=0.9, linestyle=":", zorder=1, label="belt")
    named = (numbered_words(run, _named(run, quantity), *quantity) for quantity in (across, up))
    ax.set(xlabel=axis_label(next(named), x_unit), ylabel=axis_label(next(named), y_unit))
    legend_above(ax, columns=4)
    return ax


def _middles(shown: Mask) -> list[int]:
    """The middle of each unbroken row of True."""
    begins, ends = arrays.stretches(shown)
    return [int(middle) for middle in (begins + ends - 1) // 2]
