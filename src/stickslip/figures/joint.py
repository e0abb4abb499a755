"""A joint: its torque and what explains it, and its friction over its speed."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from stickslip.figures.plate import Plate, captioned
from stickslip.figures.style import BLUE, INK, ORANGE, axes_of, legend_above, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stickslip.cycle.joint import JointFriction


def plates_of(joint: JointFriction) -> list[Plate]:
    """The figures of one joint, in reading order."""
    return [
        captioned("joint", "joint-friction", partial(plot_joint, joint)),
        captioned("joint", "joint-torque", partial(plot_torque, joint)),
    ]


@styled
def plot_joint(joint: JointFriction, *, ax: Axes | None = None) -> Axes:
    """Friction over speed while the joint slides, and what is made of it."""
    ax, unit = axes_of(ax), joint.level.unit
    ax.plot(joint.speed, joint.friction, ".", color=BLUE, markersize=3, alpha=0.5, label="while it slides")
    under_load = joint.load.value * joint.carried if joint.load is not None and joint.load.known else 0.0
    ways = ((-1, joint.back, joint.viscous_back), (1, joint.forward, joint.viscous_forward))
    for side, coulomb, viscous in ways:
        speed = np.linspace(0, side * np.abs(joint.speed).max(), 50)
        friction = side * (coulomb.value + under_load) + (viscous or joint.viscous).value * speed
        ax.plot(speed, friction, color=ORANGE, linewidth=1.6, label="under the mean load" if side > 0 else None)
    ax.axhline(0.0, color=INK, linewidth=0.6)
    ax.set(xlabel=f"speed [{'rad/s' if unit == 'N m' else 'm/s'}]", ylabel=f"friction [{unit}]")
    legend_above(ax, columns=2)
    return ax


@styled
def plot_torque(joint: JointFriction, *, ax: Axes | None = None) -> Axes:
    """The torque while the joint slides, and what is made of it."""
    ax, what = axes_of(ax), "torque" if joint.level.unit == "N m" else "force"
    ax.plot(joint.time, joint.measured, ".", color=BLUE, markersize=3, label=f"{what}, smoothed")
    ax.plot(joint.time, joint.explained, ".", color=ORANGE, markersize=2, label="explained")
    ax.set(xlabel="time [s]", ylabel=f"{what} [{joint.level.unit}]")
    legend_above(ax, columns=2)
    return ax
