"""A figure with its words, as SVG and PNG."""

from __future__ import annotations

import functools
import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from stickslip.plot.paths import compact
from stickslip.plot.style import styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Plate:
    """A figure with its words.

    Attributes
    ----------
    name : str
        Short name, fit for a file.
    figure : Figure
        The matplotlib figure.
    title, caption : str
        What it shows, and how to read it.
    """

    name: str
    figure: Figure
    title: str
    caption: str

    def svg(self) -> str:
        """The figure as an SVG image, the same for the same data."""
        return self._svg

    @functools.cached_property
    def _svg(self) -> str:
        return _svg_of(self.figure)

    @styled
    def png(self) -> bytes:
        """The figure as a PNG image on white."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        drawn = io.BytesIO()
        with _kept(self.figure) as figure:
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
def plate(name: str, drawn: Figure | Axes, title: str, caption: str) -> Plate:
    """A figure with its words, laid out once for both formats."""
    from matplotlib.figure import Figure

    figure = drawn if isinstance(drawn, Figure) else drawn.get_figure(root=True)
    assert isinstance(figure, Figure)
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)  # once for both formats
    figure.set_layout_engine("none")
    return Plate(re.sub(r"\W+", "-", name), figure, title, caption)
