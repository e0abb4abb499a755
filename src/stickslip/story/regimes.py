"""What a system does along a parameter, over starts, between regimes and under dither, told: a figure each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from stickslip.figures.bifurcation import plot_basins, plot_bifurcation, plot_boundary, plot_dither
from stickslip.figures.plate import plate
from stickslip.maps.basins import Basins
from stickslip.maps.bifurcation import Bifurcation
from stickslip.maps.boundaries import Boundary
from stickslip.maps.dither import Dither
from stickslip.squeak.stability import Stability
from stickslip.story.findings import plain
from stickslip.story.story import Line, Story, Table
from stickslip.story.words import value_of


def of_bifurcation(found: Bifurcation) -> Story:
    """Attractors along a parameter."""
    rows = [(each.direction, f"{each.value:.6g}", each.before, each.after) for each in found.changes]
    ways = (("up", found.up), ("down", found.down))
    return _story(
        "Motion along a parameter", "bifurcation", partial(plot_bifurcation, found),
        "Where the mass is once in each period of the drive: blue followed upwards, orange downwards; lines mark "
        "where the kind of motion changes. Below, the largest multiplier: at 1 the motion ceases to attract.",
        headline=list(_along(found)),
        tables=[Table("Changes of the motion", ("way", found.parameter, "before", "after"), rows)] if rows else (),
        data=lambda: {
            "parameter": found.parameter, "values": found.values.tolist(), "coexisting": found.coexisting.tolist(),
            "regimes": {name: [each.regime for each in way] for name, way in ways},
            "changes": [vars(each) for each in found.changes],
        },
    )  # fmt: skip


def _along(found: Bifurcation) -> Iterator[str]:
    low, high = (f"{value:.6g}" for value in found.values[[0, -1]])
    if not found.changes:
        yield f"From {found.parameter} {low} to {high} the motion does not change its kind: {found.up[0].regime}."
        return
    yield (
        f"From {found.parameter} {low} to {high} the motion changes its kind {len(found.changes)} times on the way up "
        "and down."
    )
    if len(found.coexisting):
        ends = f"{found.coexisting[0]:.6g} to {found.coexisting[-1]:.6g}"
        many = f"{len(found.coexisting)} of {len(found.values)} values"
        yield f"Motions exist side by side at {many}, {ends}: hysteresis."


def of_stability(found: Stability) -> Story:
    """Whether steady sliding lasts, mode by mode."""
    rows = [(f"{each.frequency:.5g} Hz", f"{each.growth:.4g} 1/s", f"{each.damping_ratio:.3g}") for each in found.modes]
    tone = f"at {found.frequency:.5g} Hz"
    if found.stable:
        told = f"Steady sliding is stable: the slowest vibration, {tone}, dies away by {abs(found.growth):.4g} 1/s."
    else:
        told = f"Steady sliding is unstable by {found.mechanism}: a vibration {tone} grows by {found.growth:.4g} 1/s."
    keys = ("stable", "mechanism", "growth", "without_coupling", "without_slope", "place", "loads", "status")
    modes = [{key: getattr(each, key) for key in ("frequency", "growth", "damping_ratio")} for each in found.modes]
    return Story(
        "Stability of steady sliding", [told], [] if found.status == "ok" else [found.status],
        tables=[Table("Modes", ("frequency", "growth", "damping ratio"), rows)],
        data=lambda: plain({**{key: getattr(found, key) for key in keys}, "modes": modes}),
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
        headline=[
            f"Dither of {value_of(found.amplitude)} at {found.frequency:.5g} Hz on the {found.on} removes stick-slip: "
            f"the longest stick falls from {found.sticks[0]:.3g} s to {found.sticks[1]:.3g} s."
        ],
        lines=[Line.of(found.amplitude)], notes=found.checks,
        data=lambda: plain({
            "frequency": found.frequency, "amplitude": found.amplitude.to_dict(), "on": found.on, "speed": found.speed,
            "sticks": found.sticks, "tried": found.tried, "scan": found.scan, "checks": found.checks,
        }),
    )  # fmt: skip


def _story(title: str, name: str, draw: Callable[[], Any], caption: str, **told: Any) -> Story:
    return Story(title, draw=lambda: [plate(name, draw, title, caption)], **told)
