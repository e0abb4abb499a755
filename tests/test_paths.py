"""An SVG written short looks the same: each place of a long path within a tenth of a point, the rest as it was."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray

from stickslip.figures.style import LONG, compact

Array = NDArray[np.float64]


def absolute(path: str) -> Array:
    """The corners of a path of lines, read as a browser does."""
    here, places = np.zeros(2), []
    for letter, numbers in re.findall(r"([mlhvMLz])([^mlhvMLz]*)", path):
        values = [float(each) for each in re.findall(r"-?(?:\d+\.?\d*|\.\d+)", numbers)]
        if letter in "hv":
            here = here + np.array([values[0], 0.0] if letter == "h" else [0.0, values[0]])
        elif letter in "ml":
            here = here + np.array(values)
        elif letter in "ML":
            here = np.array(values)
        places.append(here)
    return np.array(places)


def distance(place: Array, corners: Array) -> float:
    """From a place to a line through corners."""
    start, way = corners[:-1], np.diff(corners, axis=0)
    share = np.clip(np.sum((place - start) * way, axis=1) / np.maximum(np.sum(way**2, axis=1), 1e-30), 0, 1)
    return float(np.min(np.hypot(*(place - start - share[:, None] * way).T)))


@pytest.mark.parametrize("kind", ["noise", "sine", "loop", "steps"])
def test_a_long_path_passes_the_same_places(kind: str) -> None:
    t = np.linspace(0, 1, 1500)
    rng = np.random.default_rng(1)
    x, y = {
        "noise": (400 * t, 100 + 30 * rng.standard_normal(t.size)),
        "sine": (400 * t, 100 + 80 * np.sin(60 * t)),
        "loop": (200 + 150 * np.cos(30 * t), 100 + 90 * np.sin(31 * t)),
        "steps": (400 * t, np.round(20 * t) * 10),
    }[kind]
    original = np.column_stack([x, y])
    path = "M " + " \nL ".join(f"{a:f} {b:f}" for a, b in original)
    (short,) = re.findall(r' d="([^"]*)', compact(f'<path d="{path}"/>'))
    assert len(short) < 0.55 * len(path)
    corners = absolute(short)
    assert max(distance(place, corners) for place in original) < 0.16
    assert max(distance(place, original) for place in corners) < 0.16


def test_short_paths_curves_and_words_stay() -> None:
    marker = '<path d="M 0 3 C 0.795609 3 1.55874 2.683901 2.12132 2.12132 z"/>'
    assert compact(marker) == '<path d="M 0 3 C 0.79 3 1.55 2.68 2.12 2.12 z"/>'
    curve = "M 0 0 " + "C 1 0 2 1 3 1 C 4 0 5 1 6 1 " * (LONG // 20) + "z"
    assert compact(f'<path d="{curve}"/>').startswith('<path d="m0 0c1 0 2 1 3 1c1-1 2 0 3 0'), "from where one ended"
    curve = "M 0 0 " + "C 0.4 -0.4 0.6 -1 0.6 -1.6 C 0.6 -1 0.4 -0.4 0 0 " * (LONG // 30) + "z"
    assert compact(f'<path d="{curve}"/>').startswith('<path d="m0 0c.4-.4.6-1 .6-1.6'), "-1 .6 is not -1.6"
    words = "<text style=\"font-size: 8px; font-family: 'DejaVu Sans', sans-serif; fill: red\">a  b</text>"
    assert compact(f"<svg x='1'>{words}\n  {words}</svg>") == (
        "<svg font-family=\"'DejaVu Sans', sans-serif\" x='1'>"
        + 2 * '<text style="font-size: 8px; fill: red">a  b</text>'
        + "</svg>"
    )
