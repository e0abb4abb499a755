"""One look for every figure, and a figure with its caption: palette, sizes, and fewer points than samples."""

from __future__ import annotations

import functools
import io
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from stickslip.arrays import Array, Index, Rows
from stickslip.errors import StickslipError
from stickslip.estimate import Estimate
from stickslip.units import prefixed, spelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

Arguments = ParamSpec("Arguments")
Drawn = TypeVar("Drawn")

# Okabe and Ito's palette, told apart by the colour blind; ink and grid follow the page's colours in a report.
BLUE, ORANGE, GREEN, PURPLE, SKY = "#0072b2", "#d55e00", "#009e73", "#b0559b", "#56b4e9"
INK, FAINT, SHADE = "#1f2933", "#9aa5b1", "#c8d0da"
WIDTH = 6.2  # inch: narrow enough that the letters stay readable on a phone
DPI = 150  # of a PNG
COLUMNS = 1200  # of a min-max envelope: beyond the pixels of a figure
BARS: Any = {"fmt": "o", "capsize": 3, "markersize": 5}  # of an interval
STYLE: Any = {
    "font.family": "sans-serif", "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"], "font.size": 9,
    "axes.labelsize": 9, "axes.titlesize": 10, "xtick.labelsize": 8, "ytick.labelsize": 8, "legend.fontsize": 8,
    "axes.edgecolor": INK, "axes.labelcolor": INK, "text.color": INK, "xtick.color": INK, "ytick.color": INK,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": FAINT, "grid.alpha": 0.3,
    "grid.linewidth": 0.6, "axes.axisbelow": True, "lines.linewidth": 1.3, "legend.frameon": False,
    "figure.facecolor": "none", "axes.facecolor": "none", "savefig.facecolor": "none", "svg.fonttype": "none",
    "svg.hashsalt": "stickslip", "text.parse_math": False, "path.simplify": True, "axes.formatter.useoffset": False,
}  # fmt: skip
# what drawing ends in where numbers are beyond all measure: limits of NaN, ticks without end, paths too long
UNDRAWN = (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError, StickslipError)


def styled(draw: Callable[Arguments, Drawn]) -> Callable[Arguments, Drawn]:
    """`draw`, in the house's style whatever the user's own settings are."""

    @functools.wraps(draw)
    def drawing(*args: Arguments.args, **options: Arguments.kwargs) -> Drawn:
        import matplotlib as mpl

        with mpl.rc_context(STYLE):
            return draw(*args, **options)

    return drawing


_shown: ContextVar[bool] = ContextVar("shown", default=False)


@contextmanager
def known_to_pyplot() -> Iterator[None]:
    """Within it a new figure is pyplot's, which shows it; elsewhere nobody keeps it."""
    token = _shown.set(True)
    try:
        yield
    finally:
        _shown.reset(token)


def empty_figure(height: float) -> Figure:
    """A figure of the report's width."""
    if _shown.get():
        from matplotlib import pyplot

        return pyplot.figure(figsize=(WIDTH, height), layout="constrained")
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained")


def new_figure(rows: int = 1, *, height: float = 3.4, heights: Sequence[float] | None = None) -> tuple[Figure, Any]:
    """A figure of the report's width, and its axes, one under the other on one abscissa."""
    figure = empty_figure(height)
    return figure, figure.subplots(rows, 1, sharex=True, height_ratios=heights)


def axes_of(ax: Axes | None, *, height: float = 3.8) -> Axes:
    """The axes given, or those of a new figure."""
    return ax if ax is not None else new_figure(height=height)[1]


def legend_above(ax: Axes, *, columns: int = 1, **options: Any) -> None:
    """A legend over the axes, where it hides nothing that is drawn."""
    ax.legend(ncols=columns, loc="lower left", bbox_to_anchor=(0, 1), **options)


def plain_decades(axis: Axis) -> None:
    """Plain numbers along a logarithmic axis; between the powers of ten too, where less than a decade may hold none."""
    from matplotlib.ticker import LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    if 2 * low < high < 10 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("{x:g}" if high <= 2 * low else NullFormatter())


def axis_label(label: str, unit: str, between: str = " ") -> str:
    """ "displacement [mm]"; no bracket for a pure number."""
    return label if unit in ("1", "") else f"{label}{between}[{spelled(unit)}]"


def named_intervals(
    names: Sequence[str], estimates: Sequence[Estimate], *, ax: Axes | None, label: str = ""
) -> tuple[Axes, float, str]:
    """Estimates with their 95 % intervals, a named row each; the axes, and the factor and unit they are drawn in."""
    values, ends = np.array([e.value for e in estimates]), np.array([e.interval for e in estimates])
    ax, places = axes_of(ax, height=1.3 + 0.32 * len(names)), np.arange(len(names))
    factor, unit = prefixed(values, estimates[0].unit)
    away = factor * np.abs(ends - values[:, None]).T
    ax.errorbar(factor * values, places, xerr=away, color=BLUE, label=label or None, **BARS)
    ax.set_yticks(places, [shortened(name, 44) for name in names])
    ax.set_ylim(len(names) - 0.4, -0.6)
    return ax, factor, unit


def shortened(name: str, limit: int) -> str:
    return name if len(name) < limit else f"{name[: limit - 3]}..."


def strongest(level: Array, times: Array, columns: int) -> tuple[Array, Array]:
    """A map thinned to about `columns` columns, the largest of each kept, and their times."""
    width = -(-level.shape[1] // columns)
    starts = np.arange(0, level.shape[1], width)
    return np.maximum.reduceat(level, starts, axis=1), times[np.minimum(starts + width // 2, len(times) - 1)]


def coloured(ax: Axes, x: Array, y: Array, values: Any, **options: Any) -> Any:
    """A map in colour over two axes, without the grid."""
    ax.grid(visible=False)
    return ax.pcolormesh(x, y, values, shading="nearest", rasterized=True, linewidth=0, **options)


def envelope(time: Array, values: Array, columns: int = COLUMNS) -> tuple[Array, Array]:
    """The lowest and highest value of each of `columns` equal stretches, so that no peak is lost in drawing.

    Examples
    --------
    >>> time = np.arange(100_000.0)
    >>> spike = np.where(time == 777, 5.0, 0.0)
    >>> len(envelope(time, spike)[0]), envelope(time, spike)[1].max()
    (2400, np.float64(5.0))
    """
    if len(values) <= 2 * columns:
        return time, values
    edges = np.linspace(0, len(values), columns, endpoint=False).astype(int)
    low, high = np.fmin.reduceat(values, edges), np.fmax.reduceat(values, edges)
    return np.repeat(time[edges], 2), np.column_stack([low, high]).ravel()


def thinned(count: int, limit: int) -> Rows:
    """At most `limit` indices spread evenly over `count`."""
    return np.unique(np.linspace(0, count - 1, min(count, limit)).astype(np.intp))


@dataclass(frozen=True, eq=False)
class Plate:
    """A figure with its words. It is drawn when it is first looked at.

    Attributes
    ----------
    name : str
        Short name, fit for a file.
    draw : callable
        Draws it.
    title, caption : str
        What it shows, and how to read it.
    """

    name: str
    draw: Callable[[], Figure | Axes]
    title: str
    caption: str

    @functools.cached_property
    def figure(self) -> Figure:
        """The matplotlib figure, laid out once for both formats."""
        return _laid_out(self.draw)

    def svg(self) -> str:
        """The figure as an SVG image, the same for the same data."""
        return self._svg

    @functools.cached_property
    def _svg(self) -> str:
        return _svg_of(self.figure)

    def png(self) -> bytes:
        """The figure as a PNG image on white."""
        return self._png

    @functools.cached_property
    def _png(self) -> bytes:
        return _png_of(self.figure)


def drawable(plates: Iterable[Plate], *, png: bool = False) -> tuple[list[Plate], list[str]]:
    """The figures that can be drawn, and a note on each that can not: no finding is lost with a picture of it."""
    drawn, notes = [], []
    for figure in plates:
        try:
            figure.svg()
            if png:
                figure.png()
        except UNDRAWN as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            notes.append(f"The figure '{figure.title}' can not be drawn: {reason.rstrip('.')}.")
        else:
            drawn.append(figure)
    return drawn, notes


@styled
def _png_of(figure: Figure) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    drawn = io.BytesIO()
    with _kept(figure), _measured_once(figure):
        figure.set_dpi(DPI)
        figure.set_facecolor("white")
        canvas: Any = FigureCanvasAgg(figure)
        canvas.draw()
        # without its alpha, and packed less hard: in half the time, and no larger
        image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        image.save(drawn, format="png", dpi=(DPI, DPI), compress_level=3)
    return drawn.getvalue()


@styled
def _svg_of(figure: Figure) -> str:
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    drawn = io.StringIO()
    with _kept(figure), _measured_once(figure):
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(drawn, metadata={"Date": None, "Creator": None})
    return compact(drawn.getvalue())


@contextmanager
def _kept(figure: Figure) -> Iterator[Figure]:
    """The figure, drawn on a canvas of its own and left as it was; ``savefig`` would draw it twice."""
    canvas, dpi, colour = figure.canvas, figure.dpi, figure.get_facecolor()
    try:
        yield figure
    finally:
        figure.set_canvas(canvas)
        figure.set_dpi(dpi)
        figure.set_facecolor(colour)


@styled
def _laid_out(draw: Callable[[], Figure | Axes]) -> Figure:
    from matplotlib.figure import Figure

    drawn = draw()
    figure = drawn if isinstance(drawn, Figure) else drawn.get_figure(root=True)
    assert isinstance(figure, Figure)
    layout = figure.get_layout_engine()
    if layout is not None:
        with _measured_once(figure):
            layout.execute(figure)  # once for both formats
        for axis in _axes_of(figure):
            _keep_label(axis)
    figure.set_layout_engine("none")
    return figure


def _axes_of(figure: Figure) -> list[Axis]:
    return [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]


def _keep_label(axis: Axis) -> None:
    """The label stays where the layout put it: for its place each drawing would measure all labels of ticks again."""
    axis.axes.apply_aspect()  # the layout gives a colour bar more room than it takes
    place = axis.label.get_transform().transform(axis.label.get_position())
    axis.set_label_coords(*axis.axes.transAxes.inverted().transform(place))


@contextmanager
def _measured_once(figure: Figure) -> Iterator[None]:
    """Within it ticks are found and their labels measured once for each place of the axes; matplotlib does so five
    times a drawing, of whose time it is a quarter, with the same end. Its own methods are back afterwards."""
    axes: list[Any] = [axis for axis in _axes_of(figure) if hasattr(axis, "_get_ticklabel_bboxes")]
    for axis in axes:
        axis._update_ticks, axis._get_ticklabel_bboxes = _remembering(axis)
    try:
        yield
    finally:
        for axis in axes:
            del axis._update_ticks, axis._get_ticklabel_bboxes


def _remembering(axis: Any) -> tuple[Callable[[], Any], Callable[[Any, Any], Any]]:
    """How an axis finds its ticks and measures their labels, as long as neither its range nor its place changes."""
    find, measure, figure = axis._update_ticks, axis._get_ticklabel_bboxes, axis.get_figure(root=True)
    ticks: dict[Any, Any] = {}
    boxes: dict[Any, Any] = {}

    def place() -> tuple[float, ...]:
        return (*axis.get_view_interval(), *axis.axes.bbox.bounds, figure.dpi)

    def found() -> Any:
        if place() not in ticks:
            now = find()  # may move the ends of the range
            ticks.clear()
            ticks[place()] = now
        return [*ticks[place()]]

    def measured(shown: Any, renderer: Any) -> Any:
        key = (place(), renderer)
        if key not in boxes:
            boxes.clear()
            boxes[key] = measure(shown, renderer)
        return boxes[key]

    return found, measured


def plate(name: str, draw: Callable[[], Figure | Axes], title: str, caption: str) -> Plate:
    """A figure with its words; `draw` is called when it is looked at."""
    return Plate(re.sub(r"\W+", "-", name), draw, title, caption)


def captioned(family: str, kind: str, draw: Callable[[], Figure | Axes], *, name: str = "", **values: object) -> Plate:
    """A figure with the words that captions.toml has for its kind, some values filled in; called `name`, if given."""
    caption = _captions()[family][kind]
    return plate(name or kind, draw, caption["title"].format(**values), caption["caption"].format(**values))


@functools.cache
def _captions() -> dict[str, dict[str, dict[str, str]]]:
    return tomllib.loads((files("stickslip.figures") / "captions.toml").read_text("utf-8"))


# An SVG written short: places on a grid, in long paths from one to the next.
LONG = 400  # letters: markers and ticks stay as they are
PLACES = {"M": 1, "L": 1, "Q": 2, "C": 3, "z": 0}  # that follow a letter
_PATH = re.compile(r'(?<= d=")[^"]*')
_FAMILY = re.compile(r"font-family: ([^;\"]+); ")
_LETTER = re.compile("[MLCQz]")


def compact(svg: str) -> str:
    """The same picture: places to a hundredth of a point, in long paths to a tenth and from one to the next."""
    svg = _PATH.sub(lambda path: _short(path[0]) if len(path[0]) > LONG else _rounded(path[0]), svg)
    svg = re.sub(r' (x|y)="(-?\d+\.\d\d)\d+"', r' \1="\2"', svg)
    svg = re.sub(r' transform="rotate\(-?0 [^"]*"', "", svg)
    return _family_once(re.sub(r">\s+<", "><", svg))


def _family_once(svg: str) -> str:
    """The letters' family as a property of the whole picture where it is the same for all."""
    families = set(_FAMILY.findall(svg))
    if len(families) != 1:
        return svg
    family = families.pop().replace('"', "&quot;")
    return _FAMILY.sub("", svg).replace("<svg ", f'<svg font-family="{family}" ', 1)


def _rounded(path: str) -> str:
    return re.sub(r"(\.\d\d)\d+", r"\1", path)


def _short(path: str) -> str:
    """A path by steps on a grid of tenths; what goes on along one axis is one step.

    Examples
    --------
    >>> _short("M 10 10 L 11.04 10 L 12 10 L 12 12.52 C 13 13 14 13 15 12 z M 10 11 L 10 12")
    'm10 10h2v2.5c1 .5 2 .5 3-.5zm0 1v1'
    """
    letters = _LETTER.findall(path)
    counts = np.array([PLACES[letter] for letter in letters])
    places = np.rint(10 * np.fromstring(_LETTER.sub(" ", path), sep=" ")).astype(np.int64).reshape(-1, 2)
    stops = np.cumsum(counts)
    last = _ends(letters, stops)
    before = np.vstack([np.zeros((1, 2), np.int64), places[last[:-1]]])
    relative = places - np.repeat(before, counts, axis=0)
    steps = places[last] - before
    along = (np.array(letters) == "L") & (steps == 0).any(axis=1)
    same = along[1:] & along[:-1] & (np.sign(steps[1:]) == np.sign(steps[:-1])).all(axis=1)
    firsts = np.concatenate([[0], np.flatnonzero(~same) + 1])
    written = []
    for first, (across, down) in zip(firsts.tolist(), np.add.reduceat(steps, firsts).tolist(), strict=True):
        if letters[first] == "L":
            written.append(_line(across, down))
        else:
            own = relative[stops[first] - counts[first] : stops[first]]
            written.append(letters[first].lower() + _joined(own.ravel().tolist()))
    return "".join(written)


def _ends(letters: list[str], stops: Index) -> Index:
    """The row of the place where each step ends: of one that closes a path the place where that began."""
    ends = stops - 1
    begun = np.maximum.accumulate(np.where(np.array(letters) == "M", ends, 0))
    return np.where(np.array(letters) == "z", begun, ends)


@functools.lru_cache(1 << 16)
def _line(across: int, down: int) -> str:
    if across and down:
        return "l" + _joined([across, down])
    return f"h{_tenths(across)}" if across else f"v{_tenths(down)}" if down else ""


def _joined(numbers: list[int]) -> str:
    """Numbers with a blank between two only where they would run together.

    Examples
    --------
    >>> _joined([4, -4, 6, -10, 6, -16])
    '.4-.4.6-1 .6-1.6'
    """
    joined, before = "", ""
    for number in map(_tenths, numbers):
        alone = not before or number[0] == "-" or (number[0] == "." and "." in before)
        joined, before = joined + (number if alone else f" {number}"), number
    return joined


def _tenths(number: int) -> str:
    """
    >>> _tenths(-3), _tenths(25), _tenths(40)
    ('-.3', '2.5', '4')
    """
    whole, tenth = divmod(abs(number), 10)
    return "-" * (number < 0) + (str(whole) if whole or not tenth else "") + (f".{tenth}" if tenth else "")
