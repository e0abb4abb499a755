"""How the gallery finds its pictures: the figures that an example has made, in the order of their making."""

from __future__ import annotations

import weakref
from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

from stickslip.figures.style import Plate

_SHOWN: weakref.WeakSet[Figure] = weakref.WeakSet()


def figures_of(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save each figure that a variable holds, alone, by its axes, or in a tuple of plates, and was not shown before."""
    paths = []
    for value in list(block_vars["example_globals"].values()):
        for figure in _figures(value):
            if figure not in _SHOWN:
                _SHOWN.add(figure)
                paths.append(next(block_vars["image_path_iterator"]))
                figure.savefig(paths[-1], dpi=150, facecolor="white")
    return str(figure_rst(paths, gallery_conf["src_dir"]))


def _figures(value: Any) -> list[Figure]:
    if isinstance(value, Figure):
        return [value]
    if isinstance(value, Plate):
        return [value.figure]
    if isinstance(value, tuple) and value and all(isinstance(each, Plate) for each in value):
        return [each.figure for each in value]
    own = getattr(value, "figure", None)  # of axes
    return [own] if isinstance(own, Figure) else []


def forget(gallery_conf: dict[str, Any], name: str) -> None:
    """Nothing to undo between examples: the package changes no settings."""
