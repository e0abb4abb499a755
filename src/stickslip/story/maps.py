"""What is told of a map: its numbers, a page, and the folder that holds them with its figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.plot.maps import plates_of
from stickslip.solve.tables import System
from stickslip.story.folder import check_folder, results_folder, write_figures
from stickslip.story.page import render
from stickslip.story.story import Story

LOST = ("not run", "failed")  # outcomes that leave holes in a map


def map_numbers(atlas: Any) -> dict[str, Any]:
    """What a map holds, in plain data.

    Parameters
    ----------
    atlas : xarray.Dataset
        What :func:`sweep` returned.

    Returns
    -------
    dict
        The settings, and for each variable its least and most value, at how many points it is known, and its unit.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.scenarios.forced(0.8, 0.5)
    >>> atlas = ss.sweep(slider, {"kinetic": [0.5, 0.9]}, measures=["stops"], settle=40, cycles=10)
    >>> map_numbers(atlas)["variables"]["normal_stops"]
    {'least': 0.0, 'most': 2.0, 'known': 2, 'unit': '1'}
    """
    told = {}
    for name, column in atlas.data_vars.items():
        values = abs(column) if column.dtype.kind == "c" else column
        known = int(values.notnull().sum())
        least, most = (float(values.min()), float(values.max())) if known else (None, None)
        told[str(name)] = {"least": least, "most": most, "known": known, "unit": column.attrs.get("units", "1")}
    return {**atlas.attrs, "variables": told}


def publish_map(atlas: Any, *, folder: str | Path, system: System | None = None) -> Path:
    """Write ``report.html``, ``results.json`` and the figures of a map as SVG and PNG into a folder.

    The folder appears when all is written. An earlier one of ours is replaced; a folder that holds anything else
    is left alone. A map over more than two parameters that change has no figures, and the page says so.

    Parameters
    ----------
    atlas : xarray.Dataset
        What :func:`sweep` returned.
    folder : path
        The folder to make.
    system : Oscillator or Structure, optional
        What moved, for Den Hartog's boundary, as in :func:`plot_map`.

    Returns
    -------
    Path

    Raises
    ------
    ModelError
        The folder holds something that is not ours.
    RecordError
        The folder can not be written.

    Examples
    --------
    >>> import tempfile
    >>> import stickslip as ss
    >>> slider = ss.scenarios.forced(0.8, 0.5)
    >>> grid = {"frequency": [0.1, 0.13, 0.16], "kinetic": [0.3, 0.6, 0.9]}
    >>> atlas = ss.sweep(slider, grid, measures=["stops"], settle=40, cycles=10)
    >>> folder = publish_map(atlas, folder=Path(tempfile.mkdtemp()) / "map", system=slider)
    >>> sorted(path.name for path in folder.iterdir())
    ['figures', 'report.html', 'results.json']
    """
    folder = Path(folder)
    check_folder(folder)
    changing = sum(size > 1 for size in atlas.sizes.values())
    flat = atlas.squeeze() if 1 <= changing < len(atlas.dims) else atlas
    plates = plates_of(flat, system) if 1 <= len(flat.dims) <= 2 else ()
    story = replace(_words(atlas), draw=lambda: plates).drawn(png=True)
    with results_folder(folder, map_numbers(atlas)) as draft:
        (draft / "report.html").write_text(render([story]), encoding="utf-8")
        (draft / "figures").mkdir()
        write_figures(draft / "figures", "", story.plates)
    return folder


def _words(atlas: Any) -> Story:
    """How many motions over what, and what became of them."""
    status = atlas["status"]
    codes, words = status.attrs.get("flag_values", ()), status.attrs.get("flag_meanings", "").split()
    counts = {
        word.replace("_", " "): int(np.sum(status.values == code)) for code, word in zip(codes, words, strict=True)
    }
    became = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    over = " and ".join(_over(atlas, str(dim)) for dim in atlas.dims)
    whole = atlas.attrs.get("status", "complete")
    cautions = [] if whole == "complete" else [f"The map is not whole: {whole}."]
    cautions += [f"{counts[word]} points have no answer: {word}." for word in LOST if counts.get(word)]
    if sum(size > 1 for size in atlas.sizes.values()) > 2:
        cautions.append(
            f"There is no figure: the map is over {len(atlas.dims)} parameters, and two can be drawn. Choose with "
            "sel() and draw that with plot_map(), or sweep over fewer."
        )
    if counts.get("at rest") == status.size:
        cautions.append("Nothing moves anywhere: friction holds the mass at every point. Drive it harder, or near its "
                        "own frequency.")  # fmt: skip
    return Story("Map", (f"{status.size} motions over {over}: {became}.",), cautions, settings=_settings(atlas.attrs))


def _over(atlas: Any, dim: str) -> str:
    """A dimension in words; parameters that change together with each other."""
    names = [str(name) for name in atlas.coords if atlas[name].dims == (dim,)] if dim not in atlas.coords else [dim]
    return " with ".join(name.replace("_", " ") for name in names or [dim])


def _settings(attributes: Mapping[str, Any]) -> dict[str, str]:
    def text(value: Any) -> str:
        return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)

    return {key: text(value) for key, value in attributes.items()}
