"""What a system does along a parameter, over starts, between regimes and under dither, told: a figure each."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from stickslip.figures.bifurcation import plot_basins, plot_bifurcation, plot_boundary, plot_dither
from stickslip.figures.plate import plate
from stickslip.maps.basins import Basins
from stickslip.maps.bifurcation import Bifurcation
from stickslip.maps.boundaries import Boundary
from stickslip.maps.dither import Dither
from stickslip.story.story import Story


def of_bifurcation(found: Bifurcation) -> Story:
    """Attractors along a parameter."""
    return _story(
        "Motion along a parameter", "bifurcation", partial(plot_bifurcation, found),
        "Where the mass is once in each period of the drive: blue followed upwards, orange downwards; lines mark "
        "where the kind of motion changes. Below, the largest multiplier: at 1 the motion ceases to attract.",
    )  # fmt: skip


def of_basins(found: Basins) -> Story:
    """Attractors over starts."""
    return _story(
        "Which start leads where", "basins", partial(plot_basins, found),
        "Each start in the colour of the motion it leads to; crosses: where that motion is at phase zero.",
    )  # fmt: skip


def of_boundary(found: Boundary) -> Story:
    """Where the kind of motion changes."""
    return _story(
        "Where the kind of motion changes", "boundary", partial(plot_boundary, found),
        "Points: found by bisection of exact runs. Line: the closed form.",
    )  # fmt: skip


def of_dither(found: Dither) -> Story:
    """What dither leaves of the sticks and of the friction."""
    return _story(
        "What dither does", "dither", partial(plot_dither, found),
        "Top: the longest stick left; below the line none outlasts a period of the dither. Bottom: the friction "
        "left on average, and what the averaged law says; where they part, friction moves the mass in a period, "
        "or the contact gives way.",
    )  # fmt: skip


def _story(title: str, name: str, draw: Callable[[], Any], caption: str) -> Story:
    return Story(title, draw=lambda: [plate(name, draw, title, caption)])
