"""The contact: friction against displacement and velocity, sticks and slips; a tribometer's over cycles and strokes;
laws that were fitted: how they stand, what was measured over what the best one predicts, and a joint's torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import contact_motion
from stickslip.figures import style
from stickslip.figures.style import BARS, BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, SHADE, SKY
from stickslip.law.fit_curve import CurveFit
from stickslip.law.law import LawFit
from stickslip.law.verdict import LawComparison
from stickslip.units import prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.findings import Findings
    from stickslip.contact.contact import TransitionSpeed
    from stickslip.cycle.joint import JointFriction
    from stickslip.cycle.joint_logs import JointPrediction
    from stickslip.cycle.tribometer import Coefficients

MARGIN = 0.25  # of a stick's duration, drawn on either side of it
MOST_CYCLES = 30
POINTS_A_CYCLE = 300
COLOURS = {"plateau": BLUE, "by_stroke": ORANGE, "by_cycle": GREEN, "by_energy": INK}


@style.styled
def plot_displacement_loop(findings: Findings, *, ax: Axes | None = None) -> Axes:
    """Friction against displacement: the cycles thin, their mean with a band of one standard deviation."""
    return _loop(findings, "displacement", style.axes_of(ax))


@style.styled
def plot_velocity_loop(findings: Findings, *, ax: Axes | None = None) -> Axes:
    """Friction against velocity: the cycles thin, their mean, and the binned curve with 95 % intervals."""
    ax = _loop(findings, "velocity", style.axes_of(ax, height=4.2))
    loops = findings.loops
    assert loops is not None
    x_factor, _ = prefixed(loops.velocity, f"{loops.unit}/s")
    y_factor, _ = prefixed(loops.friction, loops.level.unit)
    curve = loops.curve
    away = y_factor * np.abs(np.array([curve.friction - curve.low, curve.high - curve.friction]))
    look: Any = {"fmt": "o", "color": INK, "markersize": 3.2, "linewidth": 1.0, "zorder": 4}
    label = "mean in velocity bins, 95 %"
    ax.errorbar(x_factor * curve.velocity, y_factor * curve.friction, yerr=away, label=label, **look)
    for value in (loops.forward.value, -loops.back.value):
        ax.axhline(y_factor * value, color=INK, linewidth=0.9, linestyle=":", zorder=1)
    style.legend_above(ax, columns=3)
    return ax


@style.styled
def plot_sticks(findings: Findings) -> Figure:
    """How long the contact stuck and slipped, over the record's time, and how often each duration occurred.

    A stick or slip that the record's begin or end cuts lasted longer than is known, and is not shown.
    """
    assert findings.sticks is not None
    events = [event for event in findings.sticks.events if event.whole]
    figure = style.empty_figure(3.0)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1, 0.3))
    factor, unit = prefixed(np.array([event.duration for event in events]), "s")
    bins = np.linspace(0, factor * max(event.duration for event in events), 40).tolist()
    for kind, colour, marker in (("stick", BLUE, "o"), ("slip", ORANGE, "^")):
        chosen = [event for event in events if event.kind == kind]
        if chosen:
            durations = factor * np.array([event.duration for event in chosen])
            some = style.thinned(len(chosen), 1500)
            times = np.array([event.time for event in chosen])
            left.plot(times[some], durations[some], marker, color=colour, markersize=4, linestyle="none", label=kind)
            right.hist(durations, bins=bins, color=colour, alpha=0.75, orientation="horizontal")
    left.set(xlabel="time [s]", ylabel=style.axis_label("duration", unit), ylim=(0, None))
    style.legend_above(left, columns=2)
    right.set(xlabel="how many")
    return figure


@style.styled
def plot_transition_speed(transition: TransitionSpeed, *, ax: Axes | None = None) -> Axes:
    """At which speed does sliding begin after a turn? The mean curve of friction against velocity, and each method.

    Parameters
    ----------
    transition : TransitionSpeed
        From :func:`~stickslip.contact.transition_speed`.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.drives.HarmonicBase(1.1e-3, frequency=8.7)
    >>> slider = ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive)
    >>> record = ss.Rig.perfect().having("x", white=1e-7).measure(ss.simulate(slider, cycles=20), fs=4000, rng=1)
    >>> record = ss.friction_force(record.between(1.0, 2.2), mass=2.42, stiffness=2310, method="fusion")
    >>> plot_transition_speed(ss.contact.transition_speed(record)).get_ylabel()
    'friction [N]'
    """
    ax = style.axes_of(ax)
    x_factor, x_unit = prefixed(transition.velocity, "m/s")
    y_factor, y_unit = prefixed(transition.friction, transition.level.unit)
    x, y = x_factor * transition.velocity, y_factor * transition.friction
    ax.plot(x, y, "o-", color=INK, markersize=3, label="mean of turns")
    for name, colour, dashes in (("contact", BLUE, "-"), ("curve", ORANGE, "--"), ("equation", INK, ":")):
        speed = getattr(transition, name)
        if speed is not None:
            ax.axvline(x_factor * speed.value, color=colour, linestyle=dashes, linewidth=1.2, label=f"by the {name}")
            ax.axvspan(*(x_factor * end for end in speed.interval), color=colour, alpha=0.15, linewidth=0)
    reached = transition.curve
    if reached is not None:  # where its line meets the sliding friction, beyond what is drawn of the turns
        ends = x_factor * np.array([transition.velocity[-1], reached.value])
        heights = y_factor * np.array([transition.friction[-1], transition.level.value])
        ax.plot(ends, heights, "--", color=ORANGE, marker="o", markersize=4, markevery=[1], label="carried on")
    for side, label in ((-1, None), (1, "sliding friction")):
        ax.axhline(side * y_factor * transition.level.value, color=FAINT, linewidth=1.0, label=label)
    ax.set(xlabel=style.axis_label("velocity after the turn", x_unit), ylabel=style.axis_label("friction", y_unit))
    style.legend_above(ax, columns=3)
    return ax


def _loop(findings: Findings, abscissa: str, ax: Axes) -> Axes:
    loops = findings.loops
    assert loops is not None
    unit = {"displacement": loops.unit, "velocity": f"{loops.unit}/s"}[abscissa]
    mean_x = getattr(loops, abscissa)
    x_factor, x_unit = prefixed(mean_x, unit)
    y_factor, y_unit = prefixed(loops.friction, loops.level.unit)
    drawn = _cycles(findings, abscissa)
    for number, (x, friction) in enumerate(drawn):
        label = f"{len(drawn)} of {len(loops.cycles)} cycles" if number == 0 else None
        ax.plot(x_factor * x, y_factor * friction, color=FAINT, linewidth=0.6, alpha=0.6, label=label)
    x, f, band = (np.append(part, part[0]) for part in (mean_x, loops.friction, loops.scatter))
    if abscissa == "displacement":
        ring = np.concatenate([f + band, (f - band)[::-1]])
        ax.fill(x_factor * np.concatenate([x, x[::-1]]), y_factor * ring, color=ORANGE, alpha=0.2, linewidth=0)
    ax.plot(x_factor * x, y_factor * f, color=ORANGE, linewidth=1.8, label="mean cycle")
    ax.axhline(0, color=FAINT, linewidth=0.8)
    ax.axvline(0, color=FAINT, linewidth=0.8)
    text = f"{abscissa} of the contact"
    ax.set(xlabel=style.axis_label(text, x_unit), ylabel=style.axis_label("friction", y_unit))
    style.legend_above(ax, columns=3)
    return ax


def _cycles(findings: Findings, abscissa: str) -> list[tuple[Array, Array]]:
    """Displacement (or velocity) across the contact and friction of at most thirty cycles, thinned."""
    record, loops, drawn = findings.record, findings.loops, []
    assert loops is not None
    moved = across(findings, abscissa)
    rows = round(record.fs / loops.frequency.value)
    for start in np.asarray(loops.cycles)[style.thinned(len(loops.cycles), MOST_CYCLES)]:
        first = round((float(start) - record.start) * record.fs)
        part = slice(max(first, 0), first + rows + 1)
        some = style.thinned(len(moved[part]), POINTS_A_CYCLE)
        if len(some):
            drawn.append((moved[part][some], record["friction"][part][some]))
    return drawn


def across(findings: Findings, abscissa: str) -> Array:
    """Displacement or velocity of the mass against what it slides on."""
    record, contact = findings.record, findings.settings.get("contact", "ground")
    name = {"displacement": "x", "velocity": "v"}[abscissa]
    if contact == "ground" and name in record:
        return record[name]
    moved: Array = getattr(contact_motion(record, contact=contact, question="the figure"), abscissa)
    return moved


@style.styled
def plot_micro_slips(findings: Findings) -> Figure:
    """Does the contact hold all the time that it sticks? One stick, with the micro-slips in it shaded."""
    assert findings.sticks is not None
    events, record = findings.sticks.events, findings.record
    span = record.time[0], record.time[-1]
    inside = [event for event in events if event.kind == "microslip" and span[0] < event.time < span[1]]
    middle = inside[len(inside) // 2]
    stick = max((e for e in events if e.kind == "stick" and e.time <= middle.time), key=lambda event: event.time)
    margin = MARGIN * stick.duration
    rows = np.flatnonzero(np.abs(record.time - stick.time - stick.duration / 2) < stick.duration / 2 + margin)
    time = record.time[rows]
    figure, axes = style.new_figure(2, height=3.8)
    speed = contact_motion(record, contact=findings.settings.get("contact"), question="the figure").velocity
    for ax, values, quantity, unit in (
        (axes[0], record["friction"], "friction", record.channels["friction"].unit),
        (axes[1], speed, "velocity", "m/s"),
    ):
        factor, text = prefixed(values[rows], unit)
        ax.plot(time, factor * values[rows], color=INK, linewidth=1.2)
        ax.axvspan(stick.time, stick.time + stick.duration, color=SHADE, alpha=0.5, linewidth=0, label="stick")
        for number, event in enumerate(e for e in inside if stick.time <= e.time < stick.time + stick.duration):
            label = "micro-slip" if number == 0 else None
            ax.axvspan(event.time, event.time + event.duration, color=ORANGE, alpha=0.4, linewidth=0, label=label)
        ax.set_ylabel(style.axis_label(quantity, text))
    axes[1].set(xlabel="time [s]", xlim=(float(time[0]), float(time[-1])))
    style.legend_above(axes[0], columns=3)
    return figure


@style.styled
def plot_breakaway(findings: Findings, *, ax: Axes | None = None) -> Axes:
    """What the contact bears just before it slips against what it bears while it slides, in each direction."""
    loops, breakaway = findings.loops, findings.breakaway
    assert loops is not None
    assert breakaway is not None
    ax = style.axes_of(ax, height=2.4)
    pairs = {
        "sliding": (loops.forward, loops.back, BLUE, "o"),
        "before it slips": (breakaway.forward, breakaway.back, ORANGE, "^"),
    }
    factor, unit = prefixed(loops.level.value, loops.level.unit)
    for shift, (label, (forward, back, colour, marker)) in zip((0.1, -0.1), pairs.items(), strict=True):
        drawn = [(level, place + shift) for place, level in enumerate((back, forward)) if level is not None]
        values = factor * np.array([level.value for level, _ in drawn])
        ends = factor * np.array([level.interval for level, _ in drawn]).reshape(-1, 2)
        places = [place for _, place in drawn]
        look: Any = {**BARS, "fmt": marker, "color": colour, "label": label if drawn else None}
        ax.errorbar(values, places, xerr=np.abs(ends - values[:, None]).T, linestyle="none", **look)
    ax.set(yticks=[0, 1], yticklabels=["back", "forward"], ylim=(-0.5, 1.5), xlabel=style.axis_label("friction", unit))
    style.legend_above(ax, columns=3)
    return ax


def tribometer_plates(coefficients: Coefficients) -> list[style.Plate]:
    """The figures of a tribometer's test, in reading order."""
    return [
        style.captioned("tribometer", "coefficient", partial(plot_coefficients, coefficients)),
        style.captioned("tribometer", "triboscopy", partial(plot_triboscopy, coefficients)),
    ]


@style.styled
def plot_coefficients(coefficients: Coefficients, *, ax: Axes | None = None) -> Axes:
    """The coefficient of every cycle by each definition, and how it wears in."""
    ax = style.axes_of(ax)
    for name, values in coefficients.of_cycles.items():
        ax.plot(np.arange(1, len(values) + 1), values, color=COLOURS[name], linewidth=1.0, label=name.replace("_", " "))
    if coefficients.wear_in is not None:
        cycle = np.arange(1, len(coefficients.wear_in.fitted) + 1)
        ax.plot(cycle, coefficients.wear_in.fitted, color=INK, linewidth=1.0, linestyle="--", label="wear-in")
    ax.set(xlabel="cycle", ylabel="friction over load")
    style.legend_above(ax, columns=5)
    return ax


@style.styled
def plot_triboscopy(coefficients: Coefficients, *, ax: Axes | None = None) -> Axes:
    """Friction over load at each place of the stroke, cycle after cycle, the mean of both directions."""
    ax = style.axes_of(ax)
    both = (coefficients.forward + coefficients.back) / 2
    factor, unit = (1e3, "mm") if coefficients.unit == "m" else (1.0, coefficients.unit)
    low, high = np.nanquantile(both, [0.02, 0.98])
    last = len(next(iter(coefficients.of_cycles.values())))
    mesh = ax.imshow(
        both,
        aspect="auto",
        origin="lower",
        vmin=low,
        vmax=high,
        interpolation="nearest",
        extent=(factor * coefficients.position[0], factor * coefficients.position[-1], 1, last),
    )
    ax.figure.colorbar(mesh, ax=ax, label="friction over load")
    ax.set(xlabel=f"displacement [{unit}]", ylabel="cycle")
    return ax


WORDS = {
    "x": ("displacement", "m"), "v": ("velocity", "m/s"), "a": ("acceleration", "m/s^2"), "load": ("load cell", "N"),
    "friction": ("friction", "N"),
}  # fmt: skip
ALONG = {"v": ("velocity", "m/s"), "x": ("displacement", "m"), "t": ("time", "s")}
OF_LAWS = (BLUE, GREEN, PURPLE, SKY, ORANGE)
CURVE = 200  # points of a line over the speed
SHOWN = 0.4  # s of a record that are drawn: more can not be told apart on a page


def plates_of(joint: JointFriction) -> list[style.Plate]:
    """The figures of one joint, in reading order."""
    traces = joint.time, joint.measured, joint.explained
    return [
        style.captioned("joint", "joint-friction", partial(plot_joint, joint)),
        style.captioned("joint", "joint-torque", partial(plot_torque, *traces, unit=joint.level.unit)),
    ]


def plates_together(logs: Sequence[tuple[Findings, JointPrediction]]) -> list[style.Plate]:
    """The torque of the log that the others predict worst, and of the one that they predict best."""
    ordered = sorted(logs, key=lambda pair: pair[1].error)
    plates = []
    for place, (log, one) in (("worst", ordered[-1]), ("best", ordered[0])):
        traces, unit = (one.time, one.measured, one.predicted), log.joint.level.unit
        plate = style.captioned(
            "joint", "joint-predicted", partial(plot_torque, *traces, unit=unit, label="by the others")
        )
        plates.append(replace(plate, name=f"{plate.name}-{place}", title=f"{plate.title} {place}: {log.name}"))
    return plates


@style.styled
def plot_joint(joint: JointFriction, *, ax: Axes | None = None) -> Axes:
    """Friction over speed while the joint slides, and what is made of it."""
    ax, unit = style.axes_of(ax), joint.level.unit
    ax.plot(joint.speed, joint.friction, ".", color=BLUE, markersize=3, alpha=0.5, label="while it slides")
    under_load = joint.load.value * joint.carried if joint.load is not None and joint.load.known else 0.0
    ways = ((-1, joint.back, joint.viscous_back), (1, joint.forward, joint.viscous_forward))
    for side, coulomb, viscous in ways:
        speed = np.linspace(0, side * np.abs(joint.speed).max(), CURVE)
        friction = side * (coulomb.value + under_load) + (viscous or joint.viscous).value * speed
        if joint.static is not None and joint.stribeck_speed is not None and joint.exponent is not None:
            near = np.exp(-((np.abs(speed) / joint.stribeck_speed.value) ** joint.exponent))
            friction = friction + side * (joint.static.value - joint.level.value) * near
        ax.plot(speed, friction, color=ORANGE, linewidth=1.6, label="under the mean load" if side > 0 else None)
    ax.axhline(0.0, color=INK, linewidth=0.6)
    ax.set(xlabel=f"speed [{'rad/s' if unit == 'N m' else 'm/s'}]", ylabel=f"friction [{unit}]")
    style.legend_above(ax, columns=2)
    return ax


@style.styled
def plot_torque(
    time: Array, measured: Array, model: Array, *, unit: str, label: str = "explained", ax: Axes | None = None
) -> Axes:
    """The torque while the joint slides, and what is made of it."""
    ax, what = style.axes_of(ax), "torque" if unit == "N m" else "force"
    ax.plot(time, measured, ".", color=BLUE, markersize=3, label=f"{what}, smoothed")
    ax.plot(time, model, ".", color=ORANGE, markersize=2, label=label)
    ax.set(xlabel="time [s]", ylabel=f"{what} [{unit}]")
    style.legend_above(ax, columns=2)
    return ax


@style.styled
def plot_laws(comparison: LawComparison, *, ax: Axes | None = None) -> Axes:
    """The misfit of each law over the least that any law leaves, and which laws are rejected."""
    from matplotlib.ticker import NullFormatter

    standings = [candidate.standing for candidate in comparison.candidates]
    ax, places = style.axes_of(ax, height=1.3 + 0.32 * len(standings)), np.arange(len(standings))
    for kept, colour, label in ((True, BLUE, "not rejected"), (False, FAINT, "rejected")):
        rows = [j for j, standing in enumerate(standings) if standing.kept == kept]
        if rows:
            ax.plot([standings[j].misfit for j in rows], places[rows], "o", color=colour, markersize=7, label=label)
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_yticks(places, [law.name for law in standings])
    ax.set_ylim(len(standings) - 0.4, -0.6)
    ax.set_xlabel("misfit, over the least that any law leaves")
    style.legend_above(ax, columns=2)
    return ax


@style.styled
def plot_fit(result: LawComparison | LawFit, *, record: int = 0) -> Figure:
    """What was measured, what the fitted or best law predicts, and what is left, over the first part of a record."""
    fit = result.fit if isinstance(result, LawComparison) else result
    name_of_law = result.best.name if isinstance(result, LawComparison) else type(fit.law).__name__
    traces = fit.traces[record]
    names = list(traces.measured)
    figure, axes = style.new_figure(len(names) + 1, height=1.6 * len(names) + 1.8)
    below = axes[-1]
    for ax, name, colour in zip(axes, names, OF_LAWS, strict=False):
        time, measured, fitted = traces.time[name], traces.measured[name], traces.fitted[name]
        near = time <= time[0] + SHOWN
        quantity, unit = WORDS.get(name, (name, ""))
        factor, unit = prefixed(measured[near] - measured[near].mean(), unit)
        ax.plot(*style.envelope(time[near], factor * measured[near]), color=INK, linewidth=1.4, label="measured")
        label = f"fitted: {name_of_law}"
        ax.plot(
            *style.envelope(time[near], factor * fitted[near]), color=ORANGE, linewidth=1.0, linestyle="--", label=label
        )
        ax.set_ylabel(style.axis_label(quantity, unit, "\n"))
        residual = (measured - fitted)[near] / fit.noise[name]
        below.plot(*style.envelope(time[near], residual), color=colour, linewidth=0.8, label=quantity)
    style.legend_above(axes[0], columns=2)
    below.axhline(0, color=FAINT, linewidth=0.8)
    below.set(xlabel="time [s]", ylabel="left over,\ntimes the noise")
    style.legend_above(below, columns=len(names), borderaxespad=0.1)
    figure.align_ylabels(list(axes))
    return figure


@style.styled
def plot_curve(fit: CurveFit, *, ax: Axes | None = None) -> Axes:
    """A measured friction and the fitted curve."""
    ax = style.axes_of(ax)
    label, unit = ALONG[fit.along]
    factor, unit = prefixed(fit.at, unit)
    order = np.argsort(fit.at, kind="stable") if fit.along == "v" else np.arange(len(fit.at))
    force, force_unit = prefixed(fit.measured, fit.unit)
    ax.plot(factor * fit.at, force * fit.measured, ".", color=FAINT, markersize=2, label="measured", rasterized=True)
    at, fitted = factor * fit.at[order], force * fit.fitted[order]
    if fit.along == "v" and at[0] < 0 < at[-1]:  # the curve of neither direction goes through zero
        middle = int(np.searchsorted(at, 0.0))
        at, fitted = np.insert(at, middle, 0.0), np.insert(fitted, middle, np.nan)
    ax.plot(at, fitted, color=ORANGE, linewidth=1.4, label=f"fitted: {fit.curve}")
    quantity = "coefficient of friction" if fit.unit == "1" else "friction"
    ax.set(xlabel=style.axis_label(label, unit), ylabel=style.axis_label(quantity, force_unit))
    style.legend_above(ax, columns=2)
    return ax


def law_plates(result: LawComparison | LawFit | CurveFit) -> list[style.Plate]:
    """The figures of a fit, in reading order."""
    if isinstance(result, CurveFit):
        return [style.captioned("law", "curve", partial(plot_curve, result))]
    plates = []
    if isinstance(result, LawComparison) and len(result.candidates) > 1:
        plates.append(style.captioned("law", "laws", partial(plot_laws, result)))
    count = len(result.fit.traces if isinstance(result, LawComparison) else result.traces)
    for record in range(count):
        draw, of = partial(plot_fit, result, record=record), f", record {record + 1} of {count}" if count > 1 else ""
        plates.append(style.captioned("law", "fit", draw, name=f"fit-{record + 1}", of=of))
    return plates
