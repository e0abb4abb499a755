"""One call that draws any result: with matplotlib's pyplot, or on axes of one's own."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from stickslip.errors import ModelError
from stickslip.estimate import Estimate, Result
from stickslip.figures import style
from stickslip.figures.style import BARS, BLUE, INK, ORANGE
from stickslip.units import prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.findings import Comparison, Findings
    from stickslip.answers.frequencies import TimeFrequency
    from stickslip.cycle.loops import Loops
    from stickslip.decay.answer import DecayFit
    from stickslip.record.record import Record

# What draws each kind of result, the file of this room and the function. One that takes no `ax` fills a whole figure.
DRAWN = {
    "Record": "drawing.of_record", "Findings": "drawing.of_findings", "Comparison": "drawing.of_comparison",
    "Loops": "drawing.of_loops", "JointFriction": "contact.plot_joint", "Coefficients": "contact.plot_coefficients",
    "DecayFit": "drawing.of_decay", "Decrement": "decay.plot_differences",
    "ForceComparison": "traces.plot_force_comparison", "Consistency": "friction.plot_consistency",
    "TransitionSpeed": "contact.plot_transition_speed", "Trial": "traces.plot_twin", "Squeaks": "squeak.plot_squeaks",
    "TimeFrequency": "drawing.of_frequencies", "DataArray": "maps.plot_wavelet",
    "LawComparison": "contact.plot_laws", "LawFit": "contact.plot_fit", "CurveFit": "contact.plot_curve",
    "Trajectory": "trajectory.plot_motion", "CycleBranches": "bifurcation.plot_limit_cycles",
    "Bifurcation": "bifurcation.plot_bifurcation", "Basins": "bifurcation.plot_basins",
    "Boundary": "bifurcation.plot_boundary", "Dither": "bifurcation.plot_dither", "Dataset": "drawing.of_dataset",
    "ExperimentPlan": "traces.plot_plan", "Estimate": "drawing.of_estimates", "list": "drawing.of_estimates",
    "tuple": "drawing.of_estimates", "Result": "drawing.of_result",
}  # fmt: skip


def plot(thing: Any, *, ax: Axes | None = None, **options: Any) -> Axes:
    """Draw a record, a motion, an answer or a map.

    Without `ax` the figure is pyplot's, which a notebook shows by itself and ``matplotlib.pyplot.show()`` elsewhere.

    Parameters
    ----------
    thing : Record, Trajectory, Findings, Estimate or any other result
        What to draw; a sequence of estimates is drawn as rows with their intervals.
    ax : matplotlib Axes, optional
        Where to draw. What needs several panels (a motion, a squeak, a plan ...) refuses it.
    **options
        Of the function that draws this kind of result, as ``first`` and ``last`` of a motion, ``system`` of a map.

    Returns
    -------
    matplotlib Axes
        The first, where there are several; its ``figure`` has them all.

    Raises
    ------
    ModelError
        A thing of a kind that is not drawn, or one of several panels with `ax`.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=1, stiffness=100, law=ss.laws.Coulomb(0.5))
    >>> run = ss.simulate(slider, start={"x": 0.05}, duration=3.0)
    >>> plot(run).get_ylabel(), plot(run.record(fs=100)).get_ylabel()
    ('displacement\\n[mm]', 'x\\n[mm]')
    """
    draw = _drawer(thing)
    if "ax" in inspect.signature(draw).parameters:
        options["ax"] = ax
    elif ax is not None:
        raise ModelError(
            f"a {type(thing).__name__} drawn on given axes", "it needs several panels of its own", "leave out ax="
        )
    with style.known_to_pyplot():
        drawn = draw(thing, **options)
    panels: Any = drawn.axes  # of a figure all of its axes, of axes themselves
    first: Any = panels[0] if isinstance(panels, list) else drawn
    return cast("Axes", first)


def _drawer(thing: Any) -> Callable[..., Figure | Axes]:
    place = next((DRAWN[kind.__name__] for kind in type(thing).__mro__ if kind.__name__ in DRAWN), None)
    if place is None:
        raise ModelError(
            f"a {type(thing).__name__}",
            f"what can be drawn is one of {', '.join(DRAWN)}",
            "give what a question or a simulation returned",
        )
    return _named(place)


def _named(place: str) -> Callable[..., Figure | Axes]:
    """A function of this room by its file and its name; a file is loaded when it first draws, as each loads much."""
    file, name = place.split(".")
    draw: Callable[..., Figure | Axes] = getattr(importlib.import_module(f"stickslip.figures.{file}"), name)
    return draw


@style.styled
def of_record(record: Record, *, ax: Axes | None = None, channels: Sequence[str] | None = None) -> Figure | Axes:
    """The channels over time, one under the other; on given axes those that share the first one's unit."""
    names = list(channels or record)
    if ax is not None:
        unit = record.channels[names[0]].unit
        names = [name for name in names if record.channels[name].unit == unit]
        factor, spelled = prefixed(np.concatenate([record[name] for name in names]), unit)
        for name in names:
            times, values = style.envelope(record.time, factor * record[name])
            ax.plot(times, values, label=name)
        ax.set(xlabel="time [s]", ylabel=style.axis_label(", ".join(names), spelled))
        return ax
    figure, axes = style.new_figure(len(names), height=0.8 + 1.2 * len(names))
    for name, panel in zip(names, np.atleast_1d(axes), strict=True):
        factor, spelled = prefixed(record[name], record.channels[name].unit)
        panel.plot(*style.envelope(record.time, factor * record[name]), color=BLUE, linewidth=1.0)
        panel.set_ylabel(style.axis_label(name, spelled, between="\n"))
    panel.set_xlabel("time [s]")
    return figure


def of_findings(findings: Findings, *, ax: Axes | None = None) -> Figure | Axes:
    """The friction loop, the decay, the joint, the squeaks, or else the record."""
    results = findings.results
    if results.get("loops") is not None:
        return _named("contact.plot_displacement_loop")(findings, ax=ax)
    if results.get("decay") is not None:
        return _named("decay.plot_decay")(findings.decay, ax=ax)
    if results.get("joint") is not None:
        return _named("contact.plot_joint")(findings.joint, ax=ax)
    if results.get("squeaks") is not None and ax is None:
        return _named("squeak.plot_squeaks")(findings.squeaks)
    return of_record(findings.record, ax=ax)


def of_comparison(comparison: Comparison, *, ax: Axes | None = None) -> Figure | Axes:
    """Friction of each record; of decays their damping ratio, of squeaks their conditions."""
    kinds = set(comparison.findings[0].results)
    if "squeaks" in kinds and ax is None:
        return _named("squeak.plot_conditions")(comparison)
    return _named("decay.plot_records" if "decay" in kinds else "friction.plot_levels")(comparison, ax=ax)


@style.styled
def of_loops(loops: Loops, *, ax: Axes | None = None, against: str = "displacement") -> Axes:
    """The mean cycle of friction, with a band of one standard deviation between cycles."""
    ax = style.axes_of(ax)
    moved = getattr(loops, against)
    across, unit = prefixed(moved, loops.unit if against == "displacement" else f"{loops.unit}/s")
    up, force = prefixed(loops.friction, loops.level.unit)
    x, f, band = (np.append(part, part[0]) for part in (across * moved, up * loops.friction, up * loops.scatter))
    ring = np.concatenate([f + band, (f - band)[::-1]])
    ax.fill(np.concatenate([x, x[::-1]]), ring, color=ORANGE, alpha=0.2, linewidth=0)
    ax.plot(x, f, color=ORANGE)
    ax.set(xlabel=style.axis_label(f"{against} of the contact", unit), ylabel=style.axis_label("friction", force))
    return ax


def of_frequencies(findings: TimeFrequency) -> Figure | Axes:
    """The map of a channel, with the signal above it."""
    return _named("maps.plot_wavelet")(findings.wavelets, record=findings.record)


def of_decay(fit: DecayFit, *, ax: Axes | None = None) -> Axes:
    """A free decay as it was measured, and as it was fitted."""
    ax = style.axes_of(ax)
    for number, (time, measured, fitted) in enumerate(zip(fit.time, fit.measured, fit.fitted, strict=True)):
        ax.plot(time, measured, color=BLUE, label=None if number else "measured")
        ax.plot(time, fitted, color=ORANGE, linestyle="--", label=None if number else "fitted")
    ax.set(xlabel="time [s]", ylabel=fit.channel)
    ax.legend()
    return ax


def of_dataset(data: Any, *, ax: Axes | None = None, **options: Any) -> Figure | Axes:
    """A map of a sweep; where steady sliding lasts."""
    if "growth" in data:
        return _named("bifurcation.plot_stability")(data, **options)
    return _named("maps.plot_map")(data, ax=ax, **options)


@style.styled
def of_estimates(estimates: Estimate | Sequence[Estimate], *, ax: Axes | None = None) -> Axes:
    """Estimates of one unit with their 95 % intervals; of several units each against its own value."""
    rows = [estimates] if isinstance(estimates, Estimate) else list(estimates)
    if strangers := {type(row).__name__ for row in rows if not isinstance(row, Estimate)} or (not rows and "nothing"):
        raise ModelError(f"a plot of {', '.join(strangers)}", "a sequence that is drawn holds estimates", "pass these")
    rows = [row for row in rows if row.known] or rows
    if len({row.unit for row in rows}) == 1:
        ax, _, unit = style.named_intervals([row.name for row in rows], rows, ax=ax)
        ax.set_xlabel("" if unit == "1" else f"[{unit}]")
        return ax
    ax = style.axes_of(ax, height=1.3 + 0.32 * len(rows))
    for place, row in enumerate(rows):
        size = abs(row.value) or 1.0
        away = np.abs(np.array(row.interval)[:, None] - row.value) / size * 100
        ax.errorbar([0.0], [place], xerr=np.where(np.isfinite(away), away, 0.0), color=BLUE, **BARS)
    ax.set_yticks(range(len(rows)), [" ".join(row.cells[:2]) for row in rows])
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.axvline(0, color=INK, linewidth=0.6)
    ax.set_xlabel("95 % interval over the value [%]")
    return ax


def of_result(result: Result, *, ax: Axes | None = None) -> Axes:
    """The numbers of an answer that has no picture of its own."""
    return of_estimates(result.estimates, ax=ax)
