"""A simulated motion as a moving picture: spring, mass and counter-face, with displacement and phase portrait."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import ModelError, RecordError
from stickslip.figures.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    axis_label,
    legend_above,
    prefixed,
    styled,
)
from stickslip.figures.trajectory import MASSES, contacts_of, curve, last_cycles, numbered_words, sampled
from stickslip.oscillator import Structure
from stickslip.whole import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stickslip.solve.trajectory import Trajectory

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


@styled
def _stage(run: Trajectory, times: Array) -> tuple[Any, list[_Scene], list[Any]]:
    """The canvas with all that stays drawn on it, and what moves."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = max(1, min(contacts_of(run), MOST_SCENES))
    figure = Figure(figsize=(6.4, 3.3 + 1.5 * shown), dpi=100, layout="constrained", facecolor="white")
    canvas = FigureCanvasAgg(figure)
    grid = figure.add_gridspec(shown + 1, 2, height_ratios=(*[1] * shown, 1.6), width_ratios=(1.5, 1))
    scenes = [_Scene(figure.add_subplot(grid[c, :]), run, c, times) for c in range(shown)]
    dots = [
        dot
        for place, across in ((grid[-1, 0], "time"), (grid[-1, 1], "x"))
        for dot in _background(figure.add_subplot(place), run, across, times)
    ]
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
        legend_above(ax, columns=4)
    names = [numbered_words(run, label, name, 0) for label, name in (("displacement", "x"), ("velocity", "v"))]
    ax.set(
        xlabel=axis_label("time" if across == "time" else names[0], x_unit),
        ylabel=axis_label("displacement" if across == "time" else names[1], y_unit),
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
