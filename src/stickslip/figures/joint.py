"""A joint: its torque and what explains it, and its friction over its speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stickslip.figures.plate import Plate, captioned
from stickslip.figures.style import BLUE, INK, ORANGE, axes_of, legend_above, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stickslip.answers.findings import Findings
    from stickslip.cycle.joint import JointFriction
    from stickslip.cycle.joint_fit import JointPrediction

Array = NDArray[np.float64]


def plates_of(joint: JointFriction) -> list[Plate]:
    """The figures of one joint, in reading order."""
    traces = joint.time, joint.measured, joint.explained
    return [
        captioned("joint", "joint-friction", partial(plot_joint, joint)),
        captioned("joint", "joint-torque", partial(plot_torque, *traces, unit=joint.level.unit)),
    ]


def plates_together(logs: Sequence[tuple[Findings, JointPrediction]]) -> list[Plate]:
    """The torque of the log that the others predict worst, and of the one that they predict best."""
    ordered = sorted(logs, key=lambda pair: pair[1].error)
    plates = []
    for place, (log, one) in (("worst", ordered[-1]), ("best", ordered[0])):
        traces, unit = (one.time, one.measured, one.predicted), log.joint.level.unit
        plate = captioned("joint", "joint-predicted", partial(plot_torque, *traces, unit=unit, label="by the others"))
        plates.append(replace(plate, name=f"{plate.name}-{place}", title=f"{plate.title} {place}: {log.name}"))
    return plates


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
def plot_torque(
    time: Array, measured: Array, model: Array, *, unit: str, label: str = "explained", ax: Axes | None = None
) -> Axes:
    """The torque while the joint slides, and what is made of it."""
    ax, what = axes_of(ax), "torque" if unit == "N m" else "force"
    ax.plot(time, measured, ".", color=BLUE, markersize=3, label=f"{what}, smoothed")
    ax.plot(time, model, ".", color=ORANGE, markersize=2, label=label)
    ax.set(xlabel="time [s]", ylabel=f"{what} [{unit}]")
    legend_above(ax, columns=2)
    return ax
