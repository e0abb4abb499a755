"""How the figures are drawn: the panels that several chapters share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.figures.plate import Plate, plate
from stickslip.figures.style import BLUE, GREEN, ORANGE, PURPLE, WIDTH, envelope, styled
from stickslip.figures.trajectory import curve
from stickslip_thesis.printed import captions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.solve import SteadyState, Trajectory

Array = NDArray[np.float64]

NAMES = ("x", "v", "a", "friction")
RESPONSES = {"x": "displacement [mm]", "v": "velocity [mm/s]", "a": "acceleration [m/s²]", "friction": "friction [N]"}
COLOURS = {"x": BLUE, "v": GREEN, "a": PURPLE, "friction": ORANGE}


def figure(number: str, drawn: Figure | Axes, words: str, *, title: str = "") -> Plate:
    """A figure of the thesis by its number, or one of ours with a title; `words` say how ours came about."""
    return plate(f"figure-{number}", lambda: drawn, title or f"Figure {number}", words)


def caption_of(drawn: Plate) -> str:
    """What it shows; empty under a figure that the thesis does not have."""
    return captions().get(drawn.title.removeprefix("Figure "), "")


def panels(rows: int, columns: int = 1, *, height: float) -> tuple[Figure, Any]:
    """A figure of the page's width with panels, each on axes of its own."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(WIDTH, height), layout="constrained")
    return drawn, drawn.subplots(rows, columns)


def tag(ax: Axes, letter: str) -> None:
    """The panel's letter, above its corner."""
    ax.set_title(f"({letter})", loc="left", fontsize=9)


@styled
def responses(time: Array, motion: Mapping[str, Array], *, words: Mapping[str, str] = RESPONSES) -> Figure:
    """Displacement, velocity, acceleration and friction force over time, in the thesis's four panels."""
    drawn, axes = panels(2, 2, height=4.4)
    for ax, letter, (name, label) in zip(axes.flat, "abcd", words.items(), strict=True):
        factor = 1e3 if "[mm" in label else 1.0
        ax.plot(*envelope(time - time[0], factor * motion[name]), color=COLOURS[name], linewidth=0.9)
        ax.set_ylabel(label)
        tag(ax, letter)
    for ax in axes[1]:
        ax.set_xlabel("time [s]")
    return drawn


@styled
def characteristics(motion: Mapping[str, Array], *, way: float, speed: float, mark: float | None = None) -> Figure:
    """Friction against displacement and velocity, each with the sticking in detail: `way` [m] and `speed` [m/s] wide.

    The detail of (a) is at the motion's lower end; `mark` is a transition speed to show in (c).
    """
    drawn, axes = panels(2, 2, height=4.8)
    x, v, f = motion["x"], motion["v"], motion["friction"]
    low = float(np.min(x))
    for ax, letter, across in zip(axes.flat, "abcd", (1e6 * (x - low), 1e3 * x, 1e3 * v, 1e3 * v), strict=True):
        ax.plot(across, f, color=ORANGE, linewidth=0.8)
        ax.set_ylabel("friction [N]")
        tag(ax, letter)
    axes[0, 0].set(xlim=(-0.1e6 * way, 1e6 * way), xlabel="displacement from its lower end [µm]")
    axes[0, 1].set_xlabel("displacement [mm]")
    axes[1, 0].set(xlim=(-1e3 * speed, 1e3 * speed), xlabel="velocity [mm/s]")
    axes[1, 1].set_xlabel("velocity [mm/s]")
    for side in (-1, 1) if mark is not None else ():
        axes[1, 0].axvline(1e3 * side * mark, color=BLUE, linestyle="--", linewidth=0.9)
    return drawn


def exact(
    run: Trajectory, *, first: float, last: float, names: Sequence[str] = NAMES
) -> tuple[Array, dict[str, Array]]:
    """Exact instants and values of a run between two instants, both sides of every jump."""
    times, values = curve(run, names, first=first, last=last)
    return times, dict(zip(names, values, strict=True))


def around(orbit: SteadyState, *, cycles: int = 1, names: Sequence[str] = NAMES) -> tuple[Array, dict[str, Array]]:
    """The same of a periodic orbit, over some cycles of it."""
    times, motion = exact(orbit.orbit, first=0.0, last=orbit.orbit.duration, names=names)
    laps = np.concatenate([times + lap * orbit.period for lap in range(cycles)])
    return laps, {name: np.tile(values, cycles) for name, values in motion.items()}
