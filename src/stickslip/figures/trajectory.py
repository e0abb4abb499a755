"""A simulated motion: traces, loops and phase portraits, from the exact solution, sticks marked; a moving picture."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip import arrays
from stickslip.arrays import Array, Mask
from stickslip.errors import ModelError, RecordError
from stickslip.figures import style
from stickslip.figures.style import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, SHADE, SKY
from stickslip.oscillator import Structure
from stickslip.units import prefixed
from stickslip.whole import whole_file

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
        drawn = [style.envelope(times, row, columns=POINTS // 2) for row in sampled(run, wanted, times)]
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


@style.styled
def plot_motion(run: Trajectory, *, first: float = 0.0, last: float | None = None) -> Figure:
    """Displacement, velocity, friction and force over time, one under the other, with sticks shaded.

    Of a structure every mass is drawn, and each contact's friction has a panel of its own, shaded by what that contact
    does; a load that follows the motion is drawn too.
    """
    last = run.duration if last is None else last
    panels = _panels(run)
    figure, axes = style.new_figure(len(panels), height=1.0 + 1.3 * len(panels))
    for ax, wanted in zip(axes, panels, strict=True):
        times, values = curve(run, wanted, first=first, last=last)
        factor, unit = prefixed(np.concatenate(values), unit_of(run, wanted[0]))
        for quantity, row in zip(wanted, values, strict=True):
            ax.plot(times, factor * row, **_line(run, quantity, wanted))
        ax.set_ylabel(style.axis_label(_panel_words(run, wanted), unit, between="\n"))
        if np.min(values) < 0 < np.max(values):
            ax.axhline(0, color=FAINT, linewidth=0.8, zorder=0.5)
        own = [row for name, row in wanted if name in ("friction", "load")]
        if contacts_of(run) == 1 or own:
            _shade(ax, run, first, last, own[0] if own else 0)
    shades = {label for label, *_ in _KINDS.values()}
    for ax in axes:
        handles = [one for one in ax.get_legend_handles_labels()[0] if ax is axes[0] or one.get_label() in shades]
        if handles and (ax is axes[0] or contacts_of(run) > 1):
            style.legend_above(ax, handles=handles, columns=6)
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


@style.styled
def plot_loop(run: Trajectory, *, against: str = "x", contact: int = 0, ax: Axes | None = None) -> Axes:
    """Friction against displacement, velocity or load: the last cycle, over those before it."""
    across = "way" if against == "x" and isinstance(run.system, Structure) else against
    return _portrait(run, (across, contact), ("friction", contact), style.axes_of(ax), contact)


@style.styled
def plot_phase(run: Trajectory, *, mass: int = 0, ax: Axes | None = None) -> Axes:
    """Velocity against displacement: the last cycle, over those before it, with sticks of a single contact marked."""
    marked = 0 if contacts_of(run) == 1 else None
    return _portrait(run, ("x", mass), ("v", mass), style.axes_of(ax, height=4.2), marked)


@style.styled
def plates_of(run: Trajectory) -> tuple[style.Plate, ...]:
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
        plates.append(style.captioned("run", "whole-run", partial(plot_motion, run), shaded=shaded))
    span = "As long as it moves" if run.status == "at rest" else "The last cycles"
    motion = partial(plot_motion, run, first=first, last=last)
    plates.append(style.captioned("run", "motion", motion, span=span, shaded=shaded))
    contacts, masses = contacts_of(run), len(run.labels("x"))
    for c in range(min(contacts, MOST_DRAWN)):
        number, of = (f"-{c + 1}", f", contact {c + 1}") if contacts > 1 else ("", "")
        for name, against in (("displacement", "x"), ("velocity", "slip"), ("load", "load")):
            if against == "load" and not pressed(run, c):
                continue
            draw = partial(plot_loop, run, against=against, contact=c)
            plates.append(style.captioned("run", f"friction-{name}", draw, name=f"friction-{name}{number}", of=of))
    holds = " Marked: where the contact holds." if contacts == 1 else ""
    for j in range(min(masses, MOST_DRAWN)):
        number, of = (f"-x{j + 1}", f" of x{j + 1}") if masses > 1 else ("", "")
        draw, name = partial(plot_phase, run, mass=j), f"phase-portrait{number}"
        plates.append(style.captioned("run", "phase-portrait", draw, name=name, of=of, holds=holds))
    return tuple(plates)


def _shade(ax: Axes, run: Trajectory, first: float, last: float, contact: int) -> None:
    low, high = ax.get_ylim()
    for kind, (label, colour, opacity) in _KINDS.items():
        spans = stretches(run, kind, first=first, last=last, contact=contact)
        if 0 < len(spans) <= MOST_SHADES:
            look: Any = {"color": colour, "alpha": opacity, "linewidth": 0, "zorder": 0, "label": label}
            ax.broken_barh(spans.tolist(), (low, high - low), **look)
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
    ax.set(xlabel=style.axis_label(next(named), x_unit), ylabel=style.axis_label(next(named), y_unit))
    style.legend_above(ax, columns=4)
    return ax


def _middles(shown: Mask) -> list[int]:
    """The middle of each unbroken row of True."""
    begins, ends = arrays.stretches(shown)
    return [int(middle) for middle in (begins + ends - 1) // 2]


Image = NDArray[np.uint8]

RATE = 25  # frames a second
CYCLES = 2
FRAMES = 150
COLOURS_OF_GIF = 64
COILS = 9
_MARKS = {
    "slip": (ORANGE, "slips"),
    "stick": (BLUE, "sticks"),
    "microstick": (SKY, "microsticks"),
    "flight": (PURPLE, "lifts off"),
    "landing": (PURPLE, "lands"),
}
_FREE = (FAINT, "")  # without contact
MOST_SCENES = 3


def animate(run: Trajectory, path: str | Path, *, tell: Callable[[int, int], None] | None = None) -> Path:
    """Draw the last two cycles of a run (of a motion that comes to rest: all of it) as a moving picture.

    The mass on its spring and the face it rubs on, coloured by what the contact does; below, its displacement over
    time and its phase portrait. Of a structure: what slides at each contact (the first three) and how it lifts off, the
    displacements of all masses, and the phase portrait of the first.

    Parameters
    ----------
    run : Trajectory
        What to draw.
    path : str or Path
        Where to; the suffix chooses: ``.gif``, or ``.mp4`` where the program ffmpeg is installed.
    tell : callable, optional
        Called before each frame with its number and their count.

    Returns
    -------
    Path

    Raises
    ------
    ModelError
        The suffix is another one, or ffmpeg is not installed.
    RecordError
        The file can not be written.

    Examples
    --------
    >>> import tempfile
    >>> from stickslip import Oscillator, simulate
    >>> from stickslip.laws import Coulomb
    >>> decay = simulate(Oscillator(mass=1, stiffness=4, law=Coulomb(1.0)), duration=5, start={"x": 1.25})
    >>> animate(decay, Path(tempfile.mkdtemp()) / "decay.gif").stat().st_size > 10_000
    True
    """
    path = Path(path)
    require_writer(path.suffix)
    images = frames(run, tell=tell)
    try:
        with whole_file(path) as draft:
            (_write_gif if path.suffix == ".gif" else _write_mp4)(images, draft)
    except OSError as error:
        raise RecordError(
            f"{path.name} can not be written ({error.strerror or error})",
            "the folder may be written to",
            "choose another place",
        ) from error
    return path


def require_writer(suffix: str) -> None:
    """Refuse a suffix that no moving picture can be written with here."""
    if suffix not in (".gif", ".mp4"):
        raise ModelError(f"an animation '{suffix}'", "a moving picture is a .gif or an .mp4", "choose one of the two")
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise ModelError("ffmpeg is not installed", "an .mp4 is written by ffmpeg", "install ffmpeg, or choose gif")


def frames(run: Trajectory, *, tell: Callable[[int, int], None] | None = None) -> Iterator[Image]:
    """The pictures one by one: what stays is drawn once, what moves is drawn over it."""
    first, last = last_cycles(run, CYCLES)
    times = np.linspace(first, last, FRAMES)
    canvas, scenes, dots = _stage(run, times)
    _, pieces = run.sample(times, ("x",))
    still = canvas.copy_from_bbox(canvas.figure.bbox)
    marks = [[_MARKS.get(kind, _FREE) for kind in run.kinds(scene.contact)] for scene in scenes]
    for number, piece in enumerate(pieces):
        if tell is not None:
            tell(number, FRAMES)
        canvas.restore_region(still)
        mode = run.modes[piece]
        for scene, mark in zip(scenes, marks, strict=True):
            scene.draw(number, *mark[mode])
        for dot, xs, ys, colour in dots:
            dot.set_data([xs[number]], [ys[number]])
            dot.set_color(colour or marks[0][mode][0])
            dot.axes.draw_artist(dot)
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


@style.styled
def _stage(run: Trajectory, times: Array) -> tuple[Any, list[_Scene], list[Any]]:
    """The canvas with all that stays drawn on it, and what moves."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = max(1, min(contacts_of(run), MOST_SCENES))
    figure = Figure(figsize=(6.4, 3.3 + 1.5 * shown), dpi=100, layout="constrained", facecolor="white")
    canvas = FigureCanvasAgg(figure)
    grid = figure.add_gridspec(shown + 1, 2, height_ratios=(*[1] * shown, 1.6), width_ratios=(1.5, 1))
    scenes = [_Scene(figure.add_subplot(grid[c, :]), run, c, times) for c in range(shown)]
    places = ((grid[-1, 0], "time"), (grid[-1, 1], "x"))
    drawn = [_background(figure.add_subplot(place), run, across, times) for place, across in places]
    dots = [dot for dots in drawn for dot in dots]
    canvas.draw()  # type: ignore[no-untyped-call]
    return canvas, scenes, dots


class _Scene:
    """A mass on the face it rubs on, coloured by what the contact does; lengths in units of the largest displacement.

    Of one mass its spring is drawn too; of a structure, what slides at one contact, and how high it lifts off.
    """

    def __init__(self, ax: Axes, run: Trajectory, contact: int, times: Array) -> None:
        from matplotlib.patches import Rectangle

        several = isinstance(run.system, Structure)
        self.contact = contact if contacts_of(run) else 0
        x = sampled(run, [("way" if several and contacts_of(run) else "x", contact)], times)[0]
        base = sampled(run, ["z"], times)[0] if run.table.motion.base and not several else np.zeros(len(times))
        middle = (np.max(x) + np.min(x)) / 2
        size = max(float(np.ptp(x)), float(np.ptp(base))) / 2 or 1.0
        self.ax, self.x, self.base = ax, (x - middle) / size, (base - np.mean(base)) / size
        self.face = _face(run, contact, times) / size
        self.height = _lift(run, contact, times)
        self.name = f"contact {contact + 1}: " if contacts_of(run) > 1 else ""
        ax.set(xlim=(-6.2, 3.2), ylim=(-0.75, 2.0 if self.height.any() else 1.6), xticks=[], yticks=[])
        ax.grid(visible=False)
        for spine in ax.spines.values():
            spine.set_visible(False)
        ax.axhline(0, color=INK, linewidth=1.2)
        self.mass = Rectangle((0, 0), 1.4, 1.0, ec=INK, linewidth=1.0, animated=True)
        ax.add_patch(self.mass)
        self.spring = ax.plot([], [], color=INK, linewidth=1.2, animated=True)[0]
        self.wall = ax.plot([], [], color=INK, linewidth=3.5, animated=True)[0]
        self.marks = ax.plot([], [], color=FAINT, linewidth=1.0, animated=True)[0]
        self.words = ax.text(0, 1.15, "", ha="center", va="bottom", animated=True)
        self.moving = [self.marks, *([] if several else [self.wall, self.spring]), self.mass, self.words]

    def draw(self, number: int, colour: str, label: str) -> None:
        """One instant."""
        x, base, height = self.x[number], -5.0 + self.base[number], self.height[number]
        self.mass.set_xy((x - 0.7, height))
        self.mass.set_facecolor(colour)
        ends = np.linspace(base + 0.25, x - 0.95, 2 * COILS)
        heights = 0.5 + 0.22 * np.where(np.arange(2 * COILS) % 2, 1, -1)
        self.spring.set_data([base, base + 0.25, *ends[1:-1], x - 0.95, x - 0.7], [0.5, 0.5, *heights[1:-1], 0.5, 0.5])
        self.wall.set_data([base, base], [0.06, 1.0])
        places = np.arange(-9, 8) * 0.6 + np.mod(self.face[number], 0.6)
        hatch = np.column_stack([places, places - 0.25, np.full(len(places), np.nan)]).ravel()
        self.marks.set_data(hatch, np.tile([-0.02, -0.3, np.nan], len(places)))
        self.words.set_text(f"{self.name}{label}")
        self.words.set_position((x, height + 1.15))
        for artist in self.moving:
            self.ax.draw_artist(artist)


def _face(run: Trajectory, contact: int, times: Array) -> Array:
    """The counter-face's displacement under a contact [m]."""
    face, carried = run.table.motion.face, 1.0
    if isinstance(run.system, Structure):
        carried = run.system.contacts[contact].carried if run.system.contacts else 0.0
    signals = [name for name in face if name != "1"]
    total = np.zeros(len(times))
    for name, row in zip(signals, sampled(run, signals, times) if signals else (), strict=True):
        total += carried * face[name] * row
    return total


def _lift(run: Trajectory, contact: int, times: Array) -> Array:
    """How high a contact has lifted off, the largest height as 0.4; the scale across is not that along."""
    contacts = run.system.contacts if isinstance(run.system, Structure) else ()
    if not contacts or contacts[contact].normal is None:
        return np.zeros(len(times))
    pad = contacts[contact]
    across = np.asarray(pad.normal) @ run.sample(times, ("x",))[0]
    gap = np.maximum(-pad.preload / pad.stiffness - across, 0.0)
    return np.asarray(0.4 * gap / (np.max(gap) or 1.0))


def _background(ax: Axes, run: Trajectory, across: str, times: Array) -> list[tuple[Any, Array, Array, str | None]]:
    """The whole curve of every mass, and the dots that run along: artist, places, their colour if not by contact."""
    up, count = ("x" if across == "time" else "v"), len(run.labels("x"))
    first, last = float(times[0]), float(times[-1])
    alike = [j for j in range(count) if run.units("x")[j] == run.units("x")[0]]  # angles have no place on an axis of mm
    rows = alike if across == "time" else [0]
    drawn = [curve(run, (("x", j), (up, j)), first=first, last=last) for j in rows]
    x_factor, x_unit = (1.0, "s") if across == "time" else prefixed(drawn[0][1][0], run.units("x")[0])
    y_factor, y_unit = prefixed(np.concatenate([values[1] for _, values in drawn]), run.units(up)[0])
    dots = []
    for j, (instants, values) in zip(rows, drawn, strict=True):
        colour = MASSES[j % len(MASSES)] if count > 1 else GREEN if up == "v" else BLUE
        own = x_factor * (instants if across == "time" else values[0])
        ax.plot(own, y_factor * values[1], color=colour, linewidth=1, label=f"x{j + 1}")
        dot = ax.plot([], [], "o", markersize=7, markeredgecolor=INK, markeredgewidth=0.8, animated=True)[0]
        x, y = sampled(run, (("x", j), (up, j)), times)
        dots.append((dot, x_factor * (times if across == "time" else x), y_factor * y, colour if count > 1 else None))
    if count > 1 and across == "time":
        style.legend_above(ax, columns=4)
    names = [numbered_words(run, label, name, 0) for label, name in (("displacement", "x"), ("velocity", "v"))]
    ax.set(
        xlabel=style.axis_label("time" if across == "time" else names[0], x_unit),
        ylabel=style.axis_label("displacement" if across == "time" else names[1], y_unit),
    )
    return dots


def _write_gif(images: Iterable[Image], path: Path) -> None:
    from PIL import Image as Pillow

    pictures = [Pillow.fromarray(image) for image in images]
    kinds = pictures[:: max(1, len(pictures) // 8)]  # one palette for all: colours that do not flicker
    sheet = Pillow.new("RGB", (kinds[0].width, kinds[0].height * len(kinds)))
    for number, picture in enumerate(kinds):
        sheet.paste(picture, (0, number * picture.height))
    palette = sheet.quantize(COLOURS_OF_GIF)
    drawn = [picture.quantize(palette=palette, dither=Pillow.Dither.NONE) for picture in pictures]
    drawn[0].save(path, save_all=True, append_images=drawn[1:], duration=1000 // RATE, loop=0)


def _write_mp4(images: Iterable[Image], path: Path) -> None:
    pictures = iter(images)
    opening = next(pictures)
    height, width = (size - size % 2 for size in opening.shape[:2])
    source = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {RATE} -i -"
    options = f"ffmpeg -loglevel error -y {source} -an -pix_fmt yuv420p -movflags +faststart"
    command = [*options.split(), str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        assert ffmpeg.stderr is not None
        for image in (opening, *pictures):
            ffmpeg.stdin.write(image[:height, :width].tobytes())
        ffmpeg.stdin.close()
        message = ffmpeg.stderr.read().decode(errors="replace").strip()
        if ffmpeg.wait():
            raise OSError(f"ffmpeg: {message.splitlines()[-1] if message else ffmpeg.returncode}")
