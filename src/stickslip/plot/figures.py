"""Which figures a result is worth, each with a title and a caption in plain words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stickslip.analysis.comparison import Comparison
from stickslip.analysis.decay_comparison import DecayComparison
from stickslip.analysis.decays import DecayFindings
from stickslip.analysis.findings import Findings
from stickslip.analysis.time_frequency import TimeFrequency
from stickslip.plot.comparison import plot_levels, plot_load_dependence
from stickslip.plot.contact import plot_displacement_loop, plot_sticks, plot_velocity_loop
from stickslip.plot.decay import plates_of as decay_plates
from stickslip.plot.decay import plates_together as together_plates
from stickslip.plot.plate import Plate, plate
from stickslip.plot.regression import plot_regression
from stickslip.plot.traces import MOST_SHADES, close_up, force_balance, plot_force_balance, plot_traces

if TYPE_CHECKING:
    from stickslip.solve.trajectory import Trajectory


def figures(
    result: Findings | Comparison | DecayFindings | DecayComparison | TimeFrequency | Trajectory,
) -> tuple[Plate, ...]:
    """The figures that show a result, in reading order.

    Parameters
    ----------
    result : Findings, Comparison, DecayFindings, DecayComparison, TimeFrequency or Trajectory
        What :func:`analyze`, :func:`compare`, :func:`analyze_decay`, :func:`compare_decays`, :func:`time_frequency` or
        :func:`simulate` returned.

    Returns
    -------
    tuple of Plate
        Each with ``.figure`` (matplotlib), ``.title``, ``.caption``, ``.svg()`` and ``.png()``.

    Examples
    --------
    >>> import stickslip as ss
    >>> record = ss.datasets.demo()
    >>> plates = figures(ss.analyze(record, mass=2.42, stiffness=2310, damping=0.12))
    >>> [plate.name for plate in plates][:2]
    ['friction-velocity', 'friction-displacement']
    """
    if isinstance(result, Comparison):
        return tuple(_of_comparison(result))
    if isinstance(result, Findings):
        return tuple(_of_findings(result))
    if isinstance(result, DecayFindings):
        return tuple(decay_plates(result))
    if isinstance(result, DecayComparison):
        return tuple(together_plates(result))
    if isinstance(result, TimeFrequency):
        from stickslip.plot.wavelet import plates_of as plates_of_map

        return tuple(plates_of_map(result))
    from stickslip.plot.trajectory import plates_of

    return plates_of(result)


def _of_findings(findings: Findings) -> list[Plate]:
    plates, near = [], close_up(findings)
    events = findings.sticks.events if findings.sticks is not None else ()
    sticks = [event for event in events if event.kind == "stick"]
    stuck = " Grey: the contact sticks." if sticks else ""
    shaded = stuck if len(sticks) <= MOST_SHADES else ""
    if findings.loops is not None:
        plates += [
            plate(
                "friction-velocity", plot_velocity_loop(findings), "Friction against velocity",
                "Dry friction is a step: about the same force (dotted) at every speed, against the motion. A slope to "
                "either side is friction that changes with speed; points between the levels at zero velocity are the "
                "sticking contact, which bears any force up to the level.",
            ),
            plate(
                "friction-displacement", plot_displacement_loop(findings), "Friction against displacement",
                "One turn is one cycle and its area is the work lost to friction. Flat top and bottom: sliding. Steep "
                "sides: the contact sticks, and their slope is the contact's own stiffness. The band is the scatter "
                "between cycles.",
            ),
        ]  # fmt: skip
    if findings.regression is not None:
        plates.append(
            plate(
                "regression", plot_regression(findings), "Does the friction model explain the force?",
                "Top: the measured force and the force that inertia, viscous and dry friction together give. Bottom: "
                "what is left over; a pattern there is friction that the model does not hold.",
            )
        )  # fmt: skip
    plates.append(
        plate("record", plot_traces(findings), "The record", f"Every channel used, over the whole time.{shaded}")
    )
    if near is not None:
        plates.append(
            plate("close-up", plot_traces(findings, record=near), "A closer look",
                   f"A few cycles from the middle of the record.{stuck}")
        )  # fmt: skip
    if force_balance(findings.record) is not None:
        plates.append(
            plate("force-balance", plot_force_balance(findings, record=near), "Where the friction force comes from",
                   f"At every moment the other terms add up to the friction.{stuck}")
        )  # fmt: skip
    if sticks:
        plates.append(
            plate("sticks", plot_sticks(findings), "How long it sticks and slips",
                   "Each mark is one stretch of sticking or slipping; the bars count how often each duration occurred.")
        )  # fmt: skip
    return plates


def _of_comparison(comparison: Comparison) -> list[Plate]:
    plates = []
    if comparison.coefficient is not None:
        plates.append(
            plate("friction-load", plot_load_dependence(comparison), "Friction against normal load",
                   "Points on a line through the origin mean one coefficient of friction for all records.")
        )  # fmt: skip
    if any(findings.level is not None for findings in comparison.findings):
        plates.append(
            plate("levels", plot_levels(comparison), "Friction of each record",
                   "The sliding friction found in each record, with its 95 % interval.")
        )  # fmt: skip
    return plates
