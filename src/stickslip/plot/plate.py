"""A figure with its words, as SVG and PNG."""

from __future__ import annotations

import functools
import io
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

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
        drawn = io.BytesIO()
        self.figure.savefig(drawn, format="png", dpi=150, facecolor="white")
        return drawn.getvalue()


@styled
def _svg_of(figure: Figure) -> str:
    """Hundredths of a point are fine enough for a path, and keep a page small."""
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    return re.sub(r'(?<= d=")[^"]*', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), drawn.getvalue())


@styled
def plate(name: str, drawn: Figure | Axes, title: str, caption: str) -> Plate:
    """A figure with its words, laid out once for both formats."""
    from matplotlib.figure import Figure

    figure = drawn if isinstance(drawn, Figure) else drawn.get_figure(root=True)
    assert isinstance(figure, Figure)
    figure.draw_without_rendering()  # lays the axes out, once for both formats
    figure.set_layout_engine("none")
    return Plate(re.sub(r"\W+", "-", name), figure, title, caption)
