"""How the figures are drawn: the panels that several chapters share, and the sketches that chapters start from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip import Rig
from stickslip.figures.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SHADE,
    WIDTH,
    Plate,
    envelope,
    plate,
    styled,
)
from stickslip.figures.trajectory import curve
from stickslip_thesis.printed import Given, captions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.solve import SteadyState, Trajectory

Place = tuple[float, float]
Array = NDArray[np.float64]

NAMES = ("x", "v", "a", "friction")
RESPONSES = {"x": "displacement [mm]", "v": "velocity [mm/s]", "a": "acceleration [m/s²]", "friction": "friction [N]"}
COLOURS = {"x": BLUE, "v": GREEN, "a": PURPLE, "friction": ORANGE}


def _sheet(width: float, height: float) -> tuple[Any, Axes]:
    """An empty sheet, its lengths alike in both directions."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(WIDTH, WIDTH * height / width), layout="constrained")
    ax = drawn.subplots()
    ax.set(xlim=(0, width), ylim=(0, height), aspect="equal", xticks=[], yticks=[])
    ax.grid(visible=False)
    for spine in ax.spines.values():
        spine.set_visible(False)
    return drawn, ax


def _block(ax: Axes, corner: Place, width: float, height: float, words: str = "", *, colour: str = SHADE) -> None:
    from matplotlib.patches import Rectangle

    ax.add_patch(Rectangle(corner, width, height, facecolor=colour, edgecolor=INK, linewidth=1.2))
    ax.text(corner[0] + width / 2, corner[1] + height / 2, words, ha="center", va="center", fontsize=8)


def _wall(ax: Axes, start: Place, length: float, *, upright: bool = False, side: int = -1) -> None:
    """A face with hatching on one side."""
    x, y = start
    along, across = ((0.0, length), (0.22 * side, 0.0)) if upright else ((length, 0.0), (0.0, 0.22 * side))
    ax.plot([x, x + along[0]], [y, y + along[1]], color=INK, linewidth=1.6)
    for share in np.arange(0.0, 1.0, 0.3 / length):
        foot = (x + share * along[0], y + share * along[1])
        ax.plot(
            [foot[0], foot[0] + across[0] + 0.15 * (not upright)],
            [foot[1], foot[1] + across[1] + 0.15 * upright],
            color=FAINT,
            linewidth=0.9,
        )


def _spring(ax: Axes, start: Place, end: Place, words: str = "", *, coils: int = 6) -> None:
    length = math.dist(start, end)
    way = np.array([end[0] - start[0], end[1] - start[1]]) / length
    side = np.array([-way[1], way[0]])
    along = np.concatenate([[0.0, 0.15], np.linspace(0.2, 0.8, 2 * coils), [0.85, 1.0]])
    off = np.concatenate([[0, 0], np.where(np.arange(2 * coils) % 2, 0.16, -0.16), [0, 0]])
    places = np.array(start) + length * along[:, None] * way + off[:, None] * side
    ax.plot(*places.T, color=INK, linewidth=1.1)
    _beside(ax, start, end, words)


def _damper(ax: Axes, start: Place, end: Place, words: str = "") -> None:
    """Along x alone."""
    (x, y), middle = start, (start[0] + end[0]) / 2
    ax.plot([x, middle], [y, y], color=INK, linewidth=1.1)
    ax.plot([middle, middle], [y - 0.13, y + 0.13], color=INK, linewidth=1.6)
    ax.plot(
        [middle - 0.2, middle + 0.15, middle + 0.15, middle - 0.2],
        [y + 0.2, y + 0.2, y - 0.2, y - 0.2],
        color=INK,
        linewidth=1.1,
    )
    ax.plot([middle + 0.15, end[0]], [y, y], color=INK, linewidth=1.1)
    _beside(ax, start, end, words)


def _beside(ax: Axes, start: Place, end: Place, words: str) -> None:
    upright = abs(end[0] - start[0]) < abs(end[1] - start[1])
    x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    ax.text(
        x + 0.3 * upright,
        y + 0.28 * (not upright),
        words,
        ha="left" if upright else "center",
        va="center" if upright else "bottom",
        fontsize=8,
    )


def _arrow(ax: Axes, start: Place, end: Place, words: str, *, colour: str = BLUE) -> None:
    ax.annotate("", xy=end, xytext=start, arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.2})
    upright = abs(end[0] - start[0]) < abs(end[1] - start[1])
    ax.text(
        (start[0] + end[0]) / 2 + 0.12 * upright,
        (start[1] + end[1]) / 2 + 0.12 * (not upright),
        words,
        color=colour,
        ha="left" if upright else "center",
        va="center" if upright else "bottom",
        fontsize=8,
    )


def _annotate(ax: Axes, at: Place, place: Place, words: str, *, colour: str = PURPLE) -> None:
    """Words beside the drawing, with a line to what they are about."""
    ax.annotate(
        words,
        xy=at,
        xytext=place,
        fontsize=8,
        color=colour,
        ha="center",
        va="center",
        arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.8},
    )


def _number(value: float, unit: str) -> str:
    return f"{value:,.4g}".replace(",", " ").replace("e+05", "·10⁵") + f" {unit}"


def _kilo(value: float) -> str:
    return _number(value / 1e3, "N/mm")


@styled
def apparatus(given: Given) -> Any:
    """Figure 2.1."""
    section = given["rig"]
    x, _, a, load = Rig.air_track().sensors
    assert a.mount is not None
    assert load.mount is not None
    drawn, ax = _sheet(11, 5.6)
    _wall(ax, (0.3, 1.5), 10.4)
    ax.text(9.1, 1.05, "air track", fontsize=8, ha="center")
    _block(ax, (0.6, 1.6), 1.1, 1.1, "base")
    _spring(ax, (1.7, 2.15), (4.2, 2.15), f"k = {_kilo(section['spring'])}")
    _block(ax, (4.2, 1.6), 2.0, 1.1, f"m = {section['mass']:g} kg")
    _arrow(ax, (0.75, 3.0), (1.65, 3.0), "z(t)")
    _arrow(ax, (4.3, 3.0), (5.2, 3.0), "x(t)")
    ax.plot([6.2, 8.3], [2.15, 2.15], color=INK, linewidth=3)  # the strip that is rubbed
    for y, ends in ((2.2, (3.2, 2.52)), (1.84, (1.52, 1.8))):
        _block(ax, (7.3, y), 0.5, 0.26, colour=ORANGE)
        _arrow(ax, (7.55, ends[0]), (7.55, ends[1]), "N" if ends[0] > ends[1] else "", colour=INK)
    ax.plot([7.8, 9.0, 9.0, 7.8], [2.33, 2.33, 1.97, 1.97], color=INK, linewidth=1.6)  # the flange
    _block(ax, (9.0, 1.85), 0.55, 0.6, colour=GREEN)
    _wall(ax, (9.55, 1.55), 1.3, upright=True, side=1)
    _annotate(ax, (1.1, 1.6), (1.5, 0.5), f"LVDT, S3: {1e6 * x.digitiser.step:.1f} µm a count")
    _annotate(ax, (4.9, 1.6), (4.9, 0.5), "LVDT, S1")
    _annotate(ax, (5.9, 2.7), (5.6, 4.3), f"accelerometer, S2,\non a mount of {a.mount.frequency:g} Hz")
    _annotate(
        ax,
        (9.27, 2.45),
        (9.2, 4.3),
        f"load cell, discharge {load.discharge:g} s,\nbehind a flange of {load.mount.frequency:g} Hz",
    )
    _annotate(ax, (7.4, 1.84), (7.0, 0.5), f"friction contact, f = {section['kinetic']:g} N", colour=ORANGE)
    ax.text(2.6, 4.3, f"natural frequency {section['natural']:g} rad/s", fontsize=8, ha="center")
    return drawn


@styled
def massless_contact(given: Given) -> Any:
    """Figure 3.1."""
    section = given["sliding"]
    drawn, ax = _sheet(11, 4.9)
    ratio = 2 * section["damping_ratio"] * math.sqrt(section["mass"] * (section["spring"] + section["stiffness"][1]))
    _wall(ax, (0.6, 1.9), 1.6, upright=True)
    _arrow(ax, (0.3, 4.0), (1.3, 4.0), "z(t)")
    _spring(ax, (0.6, 2.7), (3.6, 2.7), f"k = {_kilo(section['spring'])}")
    _block(ax, (3.6, 2.0), 2.0, 1.4, f"m = {section['mass']:g} kg")
    _arrow(ax, (4.0, 3.7), (5.2, 3.7), "x(t)")
    _contact(ax, 5.6, f"K_y = {_kilo(section['stiffness'][1])}", f"c = {ratio:.3g} N s/m")
    _block(ax, (8.5, 1.75), 0.35, 1.8, colour=ORANGE)
    _wall(ax, (7.6, 1.55), 3.0)
    ax.plot([8.68, 8.68], [1.55, 1.75], color=INK, linewidth=1.2)
    _arrow(ax, (7.6, 4.0), (8.6, 4.0), "x(t) - y(t)", colour=ORANGE)
    _annotate(ax, (8.68, 1.75), (9.7, 2.5), f"massless,\nf_k = {section['kinetic'][1]:g} N", colour=ORANGE)
    ax.text(
        1.6,
        0.7,
        f"at {section['frequency'][1]:g} Hz: the base moves by {1e3 * section['base'][1]:g} mm, "
        f"the contact gives way by f_k / K_y = {1e6 * section['kinetic'][1] / section['stiffness'][1]:.2f} µm",
        fontsize=8,
        ha="left",
    )
    return drawn


def _contact(ax: Axes, x: float, spring: str, damper: str) -> None:
    """Spring and damper beside each other between a mass's face at `x` and a bar 2.9 further on."""
    _spring(ax, (x, 3.15), (x + 2.9, 3.15), spring)
    _damper(ax, (x, 2.2), (x + 2.9, 2.2), damper)


@styled
def contact_with_inertia(given: Given) -> Any:
    """Figure 4.14."""
    section = given["inertial"]
    drawn, ax = _sheet(11, 4.4)
    _wall(ax, (0.8, 1.6), 1.9, upright=True)
    _spring(ax, (0.8, 2.5), (4.2, 2.5), f"k = {section['stiffness']:g}")
    _block(ax, (4.2, 1.9), 1.9, 1.2, "contact, m")
    _arrow(ax, (4.6, 3.4), (5.7, 3.4), "y(t)")
    _block(ax, (3.0, 1.3), 6.4, 0.6, "slider", colour=FAINT)
    _arrow(ax, (8.0, 2.3), (9.2, 2.3), "x(t) = X_m cos ωt", colour=ORANGE)
    _annotate(ax, (5.1, 1.9), (7.2, 3.1), f"f = ±{section['kinetic']:g}", colour=ORANGE)
    cases = " and ".join(f"{amplitude:g}" for amplitude in section["amplitude"])
    ax.text(5.5, 0.6, f"X_m = {cases}, Ω = ω √(m/k) = {section['ratio']:g}", fontsize=8, ha="center")
    return drawn


@styled
def system_i(given: Given) -> Any:
    """Figure 6.3."""
    section = given["paper"]
    drawn, ax = _sheet(11, 5.4)
    _wall(ax, (0.6, 1.6), 1.8, upright=True)
    _spring(ax, (0.6, 2.5), (3.8, 2.5), f"k = {_kilo(section['stiffness'])}")
    _wall(ax, (0.4, 1.6), 10.2)
    ax.text(1.9, 1.15, "air track", fontsize=8, ha="center")
    _block(ax, (3.8, 1.7), 2.2, 1.5, f"m = {section['mass']:g} kg")
    _damper(ax, (6.0, 2.7), (9.9, 2.7), "")
    _wall(ax, (9.9, 1.6), 1.8, upright=True, side=1)
    ax.plot([6.0, 8.4], [2.0, 2.0], color=INK, linewidth=3)
    for y, sign in ((2.05, 1), (1.95, -1)):
        _block(ax, (7.2, y - 0.2 * (sign < 0)), 0.5, 0.2, colour=ORANGE)
    cases = [section["case1"], section["case2"]]
    _annotate(
        ax,
        (7.9, 2.9),
        (8.2, 4.4),
        "damper, switched on: ζ = " + " or ".join(f"{case['damping_ratio']:g}" for case in cases),
    )
    _annotate(
        ax,
        (7.45, 1.75),
        (7.6, 0.5),
        "paper, switched on: f_k = " + " or ".join(f"{section['stiffness'] * case['dry']:.3f} N" for case in cases),
        colour=ORANGE,
    )
    _moves(ax, (4.4, 3.5), 1.0, (2.6, 4.4), section["resolution"])
    return drawn


def _moves(ax: Axes, start: Place, length: float, words: Place, resolution: float) -> None:
    """The motion of a mass over its face, and the LVDT that feels it."""
    _arrow(ax, start, (start[0] + length, start[1]), "x(t)")
    _annotate(ax, (start[0] + 0.2, start[1] - 0.3), words, f"LVDT, {1e6 * resolution:g} µm a count")


@styled
def system_ii(given: Given) -> Any:
    """Figure 6.12."""
    section = given["bearing"]
    drawn, ax = _sheet(11, 4.9)
    _wall(ax, (0.4, 1.3), 10.2)
    ax.plot([0.8, 10.2], [1.75, 1.75], color=INK, linewidth=2.2)  # the rail
    for x in (0.8, 10.2):
        ax.plot([x, x], [1.3, 1.75], color=INK, linewidth=2.2)
    for x in (4.3, 6.3):
        _block(ax, (x, 1.55), 0.9, 0.4, colour=ORANGE)
    _block(ax, (3.9, 1.95), 3.6, 1.0, f"table, m = {section['mass']:g} kg")
    for y in (2.15, 2.45, 2.75):
        _spring(ax, (0.8, y), (3.9, y), "", coils=9)
    _wall(ax, (0.8, 1.75), 1.4, upright=True)
    ax.text(2.5, 3.3, f"three springs, k = {_kilo(section['stiffness'])} together", fontsize=8, ha="center")
    friction = f"ζ = {section['damping_ratio']:g}, f_k = {section['kinetic']:g} N"
    _annotate(ax, (6.75, 1.65), (8.0, 0.6), f"two linear bearings: {friction}", colour=ORANGE)
    _moves(ax, (5.2, 3.25), 1.1, (3.6, 4.2), given["paper"]["resolution"])
    return drawn


@styled
def transducers(given: Given) -> Any:
    """Figure 7.7."""
    section = given["squeak"]
    drawn, ax = _sheet(11, 6.0)
    _wall(ax, (0.4, 1.0), 10.2)
    _block(ax, (1.0, 1.1), 5.4, 0.9, "mass on the linear bearing, driven at " + f"{section['frequency']:g} Hz")
    ax.plot([1.2, 6.2], [2.05, 2.05], color=INK, linewidth=3)
    _annotate(ax, (1.7, 2.1), (1.7, 3.2), "steel strip,\ndry or wet", colour=INK)
    for x in (3.5, 4.5):
        ax.add_patch(_hemisphere((x, 2.42)))
    _block(ax, (3.1, 2.42), 1.8, 0.3)
    _block(ax, (3.85, 2.72), 0.3, 1.9, colour=FAINT)
    _wall(ax, (3.2, 4.62), 1.6, side=1)
    _annotate(ax, (4.0, 4.0), (2.2, 4.3), "beam: bends\nand twists", colour=INK)
    _annotate(ax, (4.6, 2.3), (6.3, 2.75), f"rubber, {section['heavy']:g} or {section['light']:g} N", colour=ORANGE)
    _block(ax, (4.3, 2.72), 0.35, 0.3, colour=GREEN)
    _annotate(ax, (4.5, 3.02), (6.5, 3.7), "accelerometer, normal: ÿ", colour=GREEN)
    _block(ax, (8.6, 4.2), 1.2, 0.5, "laser", colour=SHADE)
    for y in (4.35, 4.55):
        ax.plot([4.15, 8.6], [y, y], color=PURPLE, linewidth=0.9, linestyle="--")
    ax.text(6.9, 4.75, "two beams on a reflector, torsion: θ̇", color=PURPLE, fontsize=8, ha="center")
    _block(ax, (8.4, 2.4), 1.1, 0.4, colour=FAINT)
    ax.text(8.95, 2.95, "microphone", fontsize=8, ha="center")
    _annotate(ax, (5.9, 2.0), (7.9, 1.7), "accelerometer: ẍ", colour=BLUE)
    _block(ax, (0.5, 1.25), 0.5, 0.6, colour=GREEN)
    ax.text(0.75, 0.5, "load cell: f", color=GREEN, fontsize=8, ha="center")
    ax.text(6.3, 0.5, f"sampled at {section['fs'] / 1e3:g} kHz", fontsize=8, ha="center")
    return drawn


def _hemisphere(top: Place) -> Any:
    from matplotlib.patches import Wedge

    return Wedge(top, 0.36, 180, 360, facecolor=ORANGE, edgecolor=INK, linewidth=1.0)


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
