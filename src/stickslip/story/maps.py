"""A map over the parameters of a system, told."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from stickslip.estimate import plain
from stickslip.figures.bifurcation import plot_basins, plot_bifurcation, plot_boundary, plot_dither
from stickslip.figures.maps import plates_of
from stickslip.figures.style import Plate, captioned
from stickslip.maps.basins import Basins
from stickslip.maps.bifurcation import Bifurcation
from stickslip.maps.boundaries import Boundary
from stickslip.maps.dither import Dither
from stickslip.solve.tables import System
from stickslip.squeak.stability import Stability
from stickslip.story.story import Line, Story, Table, number, value_of

OF_DITHER = ("frequency", "amplitude", "on", "speed", "sticks", "tried", "scan", "checks")  # in JSON
LOST = ("not run", "failed")  # outcomes that leave holes in a map


def of_map(atlas: Any, *, system: System | None = None) -> Story:
    """A map, with Den Hartog's boundary where the `system` that moved is given.

    A map over more than two parameters that change has no figures, and its page says so.
    """
    measures = _measures(atlas)
    title = f"{' x '.join(map(str, atlas.sizes.values()))} points, {atlas.attrs.get('status', 'complete')}"
    rows = [
        (atlas[name].attrs.get("long_name", name), _shown(part, "least"), _shown(part, "most"), str(part["known"]))
        for name, part in measures.items()
        if name != "status"
    ]
    return Story(
        "Map",
        _headline(atlas),
        _cautions(atlas),
        settings=_settings(atlas.attrs),
        tables=[Table(title, ("measure", "least", "most", "points"), rows)],
        draw=lambda: _plates(atlas, system),
        data=lambda: {**atlas.attrs, "variables": measures},
    )


def _measures(atlas: Any) -> dict[str, dict[str, Any]]:
    """Of each variable its least and most value, at how many points it is known, and its unit."""
    ranges = {}
    for name, column in atlas.data_vars.items():
        values = abs(column) if column.dtype.kind == "c" else column
        known = int(values.notnull().sum())
        least, most = (float(values.min()), float(values.max())) if known else (None, None)
        ranges[str(name)] = {"least": least, "most": most, "known": known, "unit": column.attrs.get("units", "1")}
    return ranges


def _shown(part: Mapping[str, Any], key: str) -> str:
    """A number of a measure, to a thousandth, in a readable unit."""
    if part[key] is None:
        return "-"
    return number(part[key], 0.0 if part["unit"] == "1" else abs(part[key]) / 1000, part["unit"])


def _plates(atlas: Any, system: System | None) -> tuple[Plate, ...]:
    changing = sum(size > 1 for size in atlas.sizes.values())
    flat = atlas.squeeze() if 1 <= changing < len(atlas.dims) else atlas
    return plates_of(flat, system) if 1 <= len(flat.dims) <= 2 else ()


def _counts(atlas: Any) -> dict[str, int]:
    """How many motions ended in what."""
    status = atlas["status"]
    codes, meanings = status.attrs.get("flag_values", ()), status.attrs.get("flag_meanings", "").split()
    counts = [int(np.sum(status.values == code)) for code in codes]
    return {word.replace("_", " "): count for word, count in zip(meanings, counts, strict=True)}


def _headline(atlas: Any) -> list[str]:
    """How many motions over what, and what became of them."""
    became = ", ".join(f"{count} {word}" for word, count in _counts(atlas).items() if count)
    over = " and ".join(_over(atlas, str(dim)) for dim in atlas.dims)
    answer = f"{atlas['status'].size} motions over {over}: {became}"
    if "normal_stops" in atlas and "abnormal_stops" in atlas:
        stops = atlas["normal_stops"] + atlas["abnormal_stops"]
        often = f", up to {float(stops.max()):.3g} times a period" if stops.max() > 0 else ""
        answer += f"; the mass stops in {int((stops > 0).sum())} of them{often}"
    return [f"{answer}."]


def _cautions(atlas: Any) -> list[str]:
    counts, whole = _counts(atlas), atlas.attrs.get("status", "complete")
    cautions = [] if whole == "complete" else [f"The map is not whole: {whole}."]
    cautions += [f"{counts[word]} points have no answer: {word}." for word in LOST if counts.get(word)]
    if why := atlas["status"].attrs.get("refused"):
        cautions.append(f"{counts['no such system']} points are no system: {why}.")
    if sum(size > 1 for size in atlas.sizes.values()) > 2:
        cautions.append(
            f"There is no figure: the map is over {len(atlas.dims)} parameters, and two can be drawn. Choose with "
            "sel() and draw that with plot_map(), or sweep over fewer."
        )
    if counts.get("at rest") == atlas["status"].size:
        cautions.append(
            "Nothing moves anywhere: friction holds the mass at every point. Drive it harder, or near its "
            "own frequency."
        )
    return cautions


def _over(atlas: Any, dim: str) -> str:
    """A dimension in words; parameters that change together with each other."""
    names = [str(name) for name in atlas.coords if atlas[name].dims == (dim,)] if dim not in atlas.coords else [dim]
    return " with ".join(name.replace("_", " ") for name in names or [dim])


def _settings(attributes: Mapping[str, Any]) -> dict[str, str]:
    def text(value: Any) -> str:
        return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)

    return {key: text(value) for key, value in attributes.items()}


# ---- along a parameter, over starts, between regimes and under dither: a figure each


def of_bifurcation(diagram: Bifurcation) -> Story:
    """Attractors along a parameter."""
    rows = [(change.direction, f"{change.value:.6g}", change.before, change.after) for change in diagram.changes]
    ways = (("up", diagram.up), ("down", diagram.down))
    return _story(
        "bifurcation",
        partial(plot_bifurcation, diagram),
        headline=list(_along(diagram)),
        tables=[Table("Changes of the motion", ("way", diagram.parameter, "before", "after"), rows)] if rows else (),
        data=lambda: {
            "parameter": diagram.parameter,
            "values": diagram.values.tolist(),
            "coexisting": diagram.coexisting.tolist(),
            "regimes": {name: [motion.regime for motion in way] for name, way in ways},
            "changes": [vars(change) for change in diagram.changes],
        },
    )


def _along(diagram: Bifurcation) -> Iterator[str]:
    low, high = (f"{value:.6g}" for value in diagram.values[[0, -1]])
    if not diagram.changes:
        yield f"From {diagram.parameter} {low} to {high} the motion does not change its kind: {diagram.up[0].regime}."
        return
    yield (
        f"From {diagram.parameter} {low} to {high} the motion changes its kind {len(diagram.changes)} times on the way "
        "up and down."
    )
    if len(diagram.coexisting):
        ends = f"{diagram.coexisting[0]:.6g} to {diagram.coexisting[-1]:.6g}"
        many = f"{len(diagram.coexisting)} of {len(diagram.values)} values"
        yield f"Motions exist side by side at {many}, {ends}: hysteresis."


def of_stability(stability: Stability) -> Story:
    """Whether steady sliding lasts, mode by mode."""
    rows = [(f"{m.frequency:.5g} Hz", f"{m.growth:.4g} 1/s", f"{m.damping_ratio:.3g}") for m in stability.modes]
    tone = f"at {stability.frequency:.5g} Hz"
    if not stability.stable:
        answer = f"Steady sliding is unstable by {stability.mechanism}: a vibration {tone} {stability.course}."
    elif stability.growth < 0:
        answer = f"Steady sliding is stable: the slowest vibration, {tone}, {stability.course}."
    else:
        answer = f"Steady sliding is at the border of stability: a vibration {tone} {stability.course}."
    keys = ("stable", "mechanism", "growth", "without_coupling", "without_slope", "place", "loads", "status")
    modes = [{key: getattr(mode, key) for key in ("frequency", "growth", "damping_ratio")} for mode in stability.modes]
    return Story(
        "Stability of steady sliding",
        [answer],
        [] if stability.status == "ok" else [stability.status],
        tables=[Table("Modes", ("frequency", "growth", "damping ratio"), rows)],
        data=lambda: plain({**{key: getattr(stability, key) for key in keys}, "modes": modes}),
    )


def of_basins(basins: Basins) -> Story:
    """Attractors over starts."""
    return _story("basins", partial(plot_basins, basins))


def of_boundary(boundary: Boundary) -> Story:
    """Where the kind of motion changes."""
    return _story("boundary", partial(plot_boundary, boundary))


def of_dither(dither: Dither) -> Story:
    """What dither leaves of the sticks and of the friction."""
    return _story(
        "dither",
        partial(plot_dither, dither),
        headline=[
            f"Dither of {value_of(dither.amplitude)} at {dither.frequency:.5g} Hz on the {dither.on} removes "
            f"stick-slip: the longest stick falls from {dither.sticks[0]:.3g} s to {dither.sticks[1]:.3g} s."
        ],
        lines=[Line.of(dither.amplitude)],
        notes=dither.checks,
        data=lambda: plain({name: getattr(dither, name) for name in OF_DITHER}),
    )


def _story(kind: str, draw: Callable[[], Any], **content: Any) -> Story:
    """What is told under the title of its one figure."""
    figure = captioned("motions", kind, draw)
    return Story(figure.title, draw=lambda: [figure], **content)
