"""A figure with its words, as PNG and as SVG written short: long paths by steps finer than a screen."""

from __future__ import annotations

import functools
import io
import math
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from stickslip.errors import StickslipError
from stickslip.figures.style import styled

# what drawing ends in where numbers are beyond all measure: limits of NaN, ticks without end, paths too long
UNDRAWN = (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError, StickslipError)

LONG = 400  # letters: markers and ticks stay as they are
NEAR = 0.8  # tenths of a point: a place this near to a line is on it
MOST = 60  # places that one line may pass
_PATH = re.compile(r'(?<= d=")[^"]*')
_FAMILY = re.compile(r"font-family: ([^;\"]+); ")
_STEP = re.compile(r"([MLCQz])([^MLCQz]*)")
Place = tuple[int, int]

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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

    drawn = io.BytesIO()
    with _kept(figure):
        figure.set_dpi(150)
        figure.set_facecolor("white")
        canvas: Any = FigureCanvasAgg(figure)
        canvas.print_png(drawn)
    return drawn.getvalue()


@styled
def _svg_of(figure: Figure) -> str:
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    drawn = io.StringIO()
    with _kept(figure):
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
        layout.execute(figure)  # once for both formats
    figure.set_layout_engine("none")
    return figure


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
    """A path by steps on a grid of tenths.

    Examples
    --------
    >>> _short("M 10 10 L 11.04 10 L 12 10 L 12 12.52 C 13 13 14 13 15 12 z")
    'm10 10h2v2.5c1 .5 2 .5 3-.5z'
    """
    written: list[str] = []
    here: Place = (0, 0)
    passed: list[Place] = []  # since the last place written, on one straight line with it

    def write_line() -> None:
        nonlocal here
        if passed and passed[-1] != here:
            written.append(_line(passed[-1][0] - here[0], passed[-1][1] - here[1]))
            here = passed[-1]
        passed.clear()

    for letter, numbers in _STEP.findall(path):
        places = _places(numbers)
        if letter == "L":
            if len(passed) > MOST or not _straight(here, passed, places[0]):
                write_line()
            passed.append(places[0])
            continue
        write_line()
        written.append(letter.lower() + _joined([n for x, y in places for n in (x - here[0], y - here[1])]))
        here = places[-1] if places else here
    write_line()
    return "".join(written)


def _places(numbers: str) -> list[Place]:
    values = [round(10 * float(number)) for number in numbers.split()]
    return list(zip(values[::2], values[1::2], strict=True))


def _straight(start: Place, passed: list[Place], end: Place) -> bool:
    """Whether a line from start to end passes all places between within NEAR, and none lies beyond its ends."""
    across, down = end[0] - start[0], end[1] - start[1]
    length = math.hypot(across, down)
    for x, y in passed:
        along = (x - start[0]) * across + (y - start[1]) * down
        off = abs((x - start[0]) * down - (y - start[1]) * across)
        if not 0 <= along <= length**2 or off > NEAR * length:
            return False
    return True


def _line(across: int, down: int) -> str:
    if across and down:
        return "l" + _joined([across, down])
    return f"h{_tenths(across)}" if across else f"v{_tenths(down)}"


def _joined(numbers: list[int]) -> str:
    """Numbers with a blank between two only where they would run together."""
    joined = ""
    for number in map(_tenths, numbers):
        alone = not joined or number[0] == "-" or (number[0] == "." and "." in joined[joined.rfind(" ") + 1 :])
        joined += number if alone else f" {number}"
    return joined


def _tenths(number: int) -> str:
    """
    >>> _tenths(-3), _tenths(25), _tenths(40)
    ('-.3', '2.5', '4')
    """
    whole, tenth = divmod(abs(number), 10)
    return "-" * (number < 0) + (str(whole) if whole or not tenth else "") + (f".{tenth}" if tenth else "")
