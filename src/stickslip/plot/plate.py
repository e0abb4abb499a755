"""A figure with its words, as SVG and PNG."""

from __future__ import annotations

import functools
import io
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from stickslip.errors import StickslipError
from stickslip.plot.paths import compact
from stickslip.plot.style import styled

# what drawing ends in where numbers are beyond all measure: limits of NaN, ticks without end, paths too long
UNDRAWN = (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError, StickslipError)

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
    for each in plates:
        try:
            each.svg()
            if png:
                each.png()
        except UNDRAWN as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            notes.append(f"The figure '{each.title}' can not be drawn: {reason.rstrip('.')}.")
        else:
            drawn.append(each)
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
