"""A simulated motion as a moving picture: spring, mass and counter-face, with displacement and phase portrait."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError, RecordError
from stickslip.plot.style import BLUE, FAINT, GREEN, INK, ORANGE, SKY, Array, axis_label, prefixed, styled
from stickslip.plot.trajectory import curve, last_cycles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stickslip.solve.trajectory import Trajectory

Image = NDArray[np.uint8]

RATE = 25  # frames a second
CYCLES = 2
FRAMES = 150
COLOURS_OF_GIF = 64
COILS = 9
_MARKS = {"slip": (ORANGE, "slips"), "stick": (BLUE, "sticks"), "microstick": (SKY, "microsticks")}


def animate(run: Trajectory, path: str | Path, *, tell: Callable[[int, int], None] | None = None) -> Path:
    """Draw the last two cycles of a run (of a motion that comes to rest: all of it) as a moving picture.

    The mass on its spring and the face it rubs on, coloured by what the contact does; below, its displacement over
    time and its phase portrait.

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
    >>> from stickslip import Coulomb, Oscillator, simulate
    >>> decay = simulate(Oscillator(mass=1, stiffness=4, law=Coulomb(1.0)), duration=5, start={"x": 1.25})
    >>> animate(decay, Path(tempfile.mkdtemp()) / "decay.gif").stat().st_size > 10_000
    True
    """
    path = Path(path)
    require_writer(path.suffix)
    images = frames(run, tell=tell)
    try:
        (_write_gif if path.suffix == ".gif" else _write_mp4)(images, path)
    except OSError as error:
        path.unlink(missing_ok=True)
        raise RecordError(
            f"{path.name} can not be written ({error.strerror or error})", "the folder may be written to",
            "choose another place",
        ) from error  # fmt: skip
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
    motion = run.table.motion
    signals = [name for name in motion.face if name != "1"]
    outputs = ("x", "v", *(("z",) if motion.base else ()), *signals)
    values, pieces = run.sample(times, outputs)
    face = np.zeros(FRAMES)
    for name, row in zip(signals, values[len(outputs) - len(signals) :], strict=True):
        face += motion.face[name] * row
    base = values[2] if motion.base else np.zeros(FRAMES)
    canvas, scene, dots = _stage(run, values[0], base, face)
    still = canvas.copy_from_bbox(canvas.figure.bbox)
    for number, piece in enumerate(pieces):
        if tell is not None:
            tell(number, FRAMES)
        canvas.restore_region(still)
        colour, words = _MARKS[run.table.modes[run.modes[piece]].kind]
        scene.draw(number, colour, words)
        for (dot, x_factor, y_factor), (x, y) in zip(
            dots, ((times[number], values[0, number]), (values[0, number], values[1, number])), strict=True
        ):
            dot.set_data([x_factor * x], [y_factor * y])
            dot.set_color(colour)
            dot.axes.draw_artist(dot)
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


@styled
def _stage(run: Trajectory, x: Array, base: Array, face: Array) -> tuple[Any, _Scene, list[Any]]:
    """The canvas with all that stays drawn on it, and what moves."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.8), dpi=100, layout="constrained", facecolor="white")
    canvas = FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, height_ratios=(1, 1.6), width_ratios=(1.5, 1))
    scene = _Scene(figure.add_subplot(grid[0, :]), x, base, face)
    first, last = last_cycles(run, CYCLES)
    places = ((grid[1, 0], "time"), (grid[1, 1], "x"))
    dots = [_background(figure.add_subplot(place), run, across, first, last) for place, across in places]
    canvas.draw()  # type: ignore[no-untyped-call]
    return canvas, scene, dots


class _Scene:
    """Spring, mass and counter-face; lengths in units of the largest displacement."""

    def __init__(self, ax: Axes, x: Array, base: Array, face: Array) -> None:
        from matplotlib.patches import Rectangle

        middle = (np.max(x) + np.min(x)) / 2
        size = max(float(np.ptp(x)), float(np.ptp(base))) / 2 or 1.0
        self.ax, self.x, self.base = ax, (x - middle) / size, (base - np.mean(base)) / size
        self.face = face / size
        ax.set(xlim=(-6.2, 3.2), ylim=(-0.75, 1.6), xticks=[], yticks=[])
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

    def draw(self, number: int, colour: str, words: str) -> None:
        """One instant."""
        x, base = self.x[number], -5.0 + self.base[number]
        self.mass.set_x(x - 0.7)
        self.mass.set_facecolor(colour)
        ends = np.linspace(base + 0.25, x - 0.95, 2 * COILS)
        heights = 0.5 + 0.22 * np.where(np.arange(2 * COILS) % 2, 1, -1)
        self.spring.set_data([base, base + 0.25, *ends[1:-1], x - 0.95, x - 0.7], [0.5, 0.5, *heights[1:-1], 0.5, 0.5])
        self.wall.set_data([base, base], [0.06, 1.0])
        places = np.arange(-9, 8) * 0.6 + np.mod(self.face[number], 0.6)
        hatch = np.column_stack([places, places - 0.25, np.full(len(places), np.nan)]).ravel()
        self.marks.set_data(hatch, np.tile([-0.02, -0.3, np.nan], len(places)))
        self.words.set_text(words)
        self.words.set_x(x)
        for artist in (self.marks, self.wall, self.spring, self.mass, self.words):
            self.ax.draw_artist(artist)


def _background(ax: Axes, run: Trajectory, across: str, first: float, last: float) -> tuple[Any, float, float]:
    """The whole curve in grey, and the dot that runs along it with the factors of its axes."""
    up = "x" if across == "time" else "v"
    times, (x, v) = curve(run, ("x", "v"), first=first, last=last)
    y = x if up == "x" else v
    x_factor, x_unit = (1.0, "s") if across == "time" else prefixed(x, "m")
    y_factor, y_unit = prefixed(y, "m" if up == "x" else "m/s")
    ax.plot(
        x_factor * (times if across == "time" else x), y_factor * y, color=GREEN if up == "v" else BLUE, linewidth=1
    )
    ax.set(
        xlabel=axis_label("time" if across == "time" else "displacement", x_unit),
        ylabel=axis_label("displacement" if up == "x" else "velocity", y_unit),
    )
    dot = ax.plot([], [], "o", markersize=7, markeredgecolor=INK, markeredgewidth=0.8, animated=True)[0]
    return dot, x_factor, y_factor


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
    command = ["ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
               "-r", str(RATE), "-i", "-", "-an", "-pix_fmt", "yuv420p", "-movflags", "+faststart",
               str(path)]  # fmt: skip
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        assert ffmpeg.stderr is not None
        for image in (opening, *pictures):
            ffmpeg.stdin.write(image[:height, :width].tobytes())
        ffmpeg.stdin.close()
        told = ffmpeg.stderr.read().decode(errors="replace").strip()
        if ffmpeg.wait():
            raise OSError(f"ffmpeg: {told.splitlines()[-1] if told else ffmpeg.returncode}")
