"""Hundreds of records on a page: small pictures side by side, and a quantity of each with its interval."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from stickslip.answers.many import Batch, Row
from stickslip.estimate import Estimate
from stickslip.figures.plate import Plate
from stickslip.figures.style import BLUE, axes_of, axis_label, empty_figure, prefixed, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ACROSS, EACH = 8, 64  # small pictures in a row, and in a figure
MOST = 4  # figures of them
QUANTITIES = 3  # that are drawn over the records
FULL = 40  # letters of a name over a small picture that is read without being cut


def plates_of(batch: Batch) -> list[Plate]:
    """The quantities that most records have, then the small pictures."""
    quantities = [_over_records(batch, name) for name in batch.names[:QUANTITIES] if batch.known(name)]
    return [*quantities, *_pictures(batch)]


def _over_records(batch: Batch, name: str) -> Plate:
    draw = partial(plot_over_records, batch.known(name))
    title = f"{name[:1].upper()}{name[1:]} of each record"
    caption = "The records in the order given, each with its 95 % interval; copies of others are left out."
    return Plate("over-records-" + "-".join(name.split()), draw, title, caption)


@styled
def plot_over_records(estimates: Sequence[Estimate], *, ax: Axes | None = None) -> Axes:
    """A quantity of each record with its interval."""
    ax = axes_of(ax)
    values = np.array([each.value for each in estimates])
    factor, unit = prefixed(values, estimates[0].unit)
    ends = np.array([each.interval for each in estimates])
    lengths = np.where(np.isfinite(ends), np.abs(ends - values[:, None]), 0.0).T
    ax.errorbar(
        np.arange(1, len(estimates) + 1), factor * values, factor * lengths, fmt="o", color=BLUE, ms=2, elinewidth=0.6
    )
    ax.set_xlabel("record")
    ax.set_ylabel(axis_label(estimates[0].name, unit))
    return ax


def _pictures(batch: Batch) -> Iterator[Plate]:
    drawn = [row for row in batch.rows if row.counts and len(row.picture[0])]
    for number in range(min(MOST, math.ceil(len(drawn) / EACH))):
        part = drawn[number * EACH : (number + 1) * EACH]
        span = f"records {number * EACH + 1} to {number * EACH + len(part)} of {len(drawn)}"
        x, y = batch.axes
        caption = f"{y[:1].upper()}{y[1:]} over {x}, each on its own scales: look for shapes unlike the others."
        yield Plate(f"records-{number + 1}", partial(plot_small, part), f"Side by side, {span}", caption)


@styled
def plot_small(rows: Sequence[Row]) -> Figure:
    """Small pictures side by side, without axes: their shapes are what is compared."""
    down = math.ceil(len(rows) / ACROSS)
    figure = empty_figure(0.95 * down + 0.3)
    places = figure.subplots(down, ACROSS, squeeze=False)
    for place in places.flat:
        place.set_axis_off()
    for place, row in zip(places.flat, rows, strict=False):
        place.plot(*row.picture, color=BLUE, lw=0.6)
        place.set_title(_short(row.name), fontsize=5, color="0.4", pad=1)
    return figure


def _short(name: str) -> str:
    """The end of a name, which tells files of one series apart."""
    return name if len(name) <= FULL // 2 else f"...{name[-FULL // 2 + 3 :]}"
