"""The contact: friction against displacement and velocity, sticks and slips; a tribometer's over cycles and strokes."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import contact_motion
from stickslip.figures.style import (
    BARS,
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    SHADE,
    Plate,
    axes_of,
    axis_label,
    captioned,
    empty_figure,
    legend_above,
    new_figure,
    prefixed,
    styled,
    thinned,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.findings import Findings
    from stickslip.contact.contact import TransitionSpeed
    from stickslip.cycle.tribometer import Coefficients

MARGIN = 0.25  # of a stick's duration, drawn on either side of it
MOST_CYCLES = 30
POINTS_A_CYCLE = 300
COLOURS = {"plateau": BLUE, "by_stroke": ORANGE, "by_cycle": GREEN, "by_energy": INK}


@styled
def plot_displacement_loop(findings: Findings, *, ax: Axes | None = None) -> Axes:
    """Friction against displacement: the cycles thin, their mean with a band of one standard deviation."""
    return _loop(findings, "displacement", axes_of(ax))


@styled
def plot_velocity_loop(findings: Findings, *, ax: Axes | None = None) -> Axes:
    """Friction against velocity: the cycles thin, their mean, and the binned curve with 95 % intervals."""
    ax = _loop(findings, "velocity", axes_of(ax, height=4.2))
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
    legend_above(ax, columns=3)
    return ax


@styled
def plot_sticks(findings: Findings) -> Figure:
    """How long the contact stuck and slipped, over the record's time, and how often each duration occurred.

    A stick or slip that the record's begin or end cuts lasted longer than is known, and is not shown.
    """
    assert findings.sticks is not None
    events = [event for event in findings.sticks.events if event.whole]
    figure = empty_figure(3.0)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1, 0.3))
    factor, unit = prefixed(np.array([event.duration for event in events]), "s")
    bins = np.linspace(0, factor * max(event.duration for event in events), 40).tolist()
    for kind, colour, marker in (("stick", BLUE, "o"), ("slip", ORANGE, "^")):
        chosen = [event for event in events if event.kind == kind]
        if chosen:
            durations = factor * np.array([event.duration for event in chosen])
            some = thinned(len(chosen), 1500)
            times = np.array([event.time for event in chosen])
            left.plot(times[some], durations[some], marker, color=colour, markersize=4, linestyle="none", label=kind)
            right.hist(durations, bins=bins, color=colour, alpha=0.75, orientation="horizontal")
    left.set(xlabel="time [s]", ylabel=axis_label("duration", unit), ylim=(0, None))
    legend_above(left, columns=2)
    right.set(xlabel="how many")
    return figure


@styled
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
    ax = axes_of(ax)
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
    ax.set(xlabel=axis_label("velocity after the turn", x_unit), ylabel=axis_label("friction", y_unit))
    legend_above(ax, columns=3)
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
    ax.set(xlabel=axis_label(text, x_unit), ylabel=axis_label("friction", y_unit))
    legend_above(ax, columns=3)
    return ax


def _cycles(findings: Findings, abscissa: str) -> list[tuple[Array, Array]]:
    """Displacement (or velocity) across the contact and friction of at most thirty cycles, thinned."""
    record, loops, drawn = findings.record, findings.loops, []
    assert loops is not None
    moved = across(findings, abscissa)
    rows = round(record.fs / loops.frequency.value)
    for start in np.asarray(loops.cycles)[thinned(len(loops.cycles), MOST_CYCLES)]:
        first = round((float(start) - record.start) * record.fs)
        part = slice(max(first, 0), first + rows + 1)
        some = thinned(len(moved[part]), POINTS_A_CYCLE)
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


@styled
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
    figure, axes = new_figure(2, height=3.8)
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
        ax.set_ylabel(axis_label(quantity, text))
    axes[1].set(xlabel="time [s]", xlim=(float(time[0]), float(time[-1])))
    legend_above(axes[0], columns=3)
    return figure


@styled
def plot_breakaway(findings: Findings, *, ax: Axes | None = None) -> Axes:
    """What the contact bears just before it slips against what it bears while it slides, in each direction."""
    loops, breakaway = findings.loops, findings.breakaway
    assert loops is not None
    assert breakaway is not None
    ax = axes_of(ax, height=2.4)
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
    ax.set(yticks=[0, 1], yticklabels=["back", "forward"], ylim=(-0.5, 1.5), xlabel=axis_label("friction", unit))
    legend_above(ax, columns=3)
    return ax


def tribometer_plates(coefficients: Coefficients) -> list[Plate]:
    """The figures of a tribometer's test, in reading order."""
    return [
        captioned("tribometer", "coefficient", partial(plot_coefficients, coefficients)),
        captioned("tribometer", "triboscopy", partial(plot_triboscopy, coefficients)),
    ]


@styled
def plot_coefficients(coefficients: Coefficients, *, ax: Axes | None = None) -> Axes:
    """The coefficient of every cycle by each definition, and how it wears in."""
    ax = axes_of(ax)
    for name, values in coefficients.of_cycles.items():
        ax.plot(np.arange(1, len(values) + 1), values, color=COLOURS[name], linewidth=1.0, label=name.replace("_", " "))
    if coefficients.wear_in is not None:
        cycle = np.arange(1, len(coefficients.wear_in.fitted) + 1)
        ax.plot(cycle, coefficients.wear_in.fitted, color=INK, linewidth=1.0, linestyle="--", label="wear-in")
    ax.set(xlabel="cycle", ylabel="friction over load")
    legend_above(ax, columns=5)
    return ax


@styled
def plot_triboscopy(coefficients: Coefficients, *, ax: Axes | None = None) -> Axes:
    """Friction over load at each place of the stroke, cycle after cycle, the mean of both directions."""
    ax = axes_of(ax)
    both = np.where(
        np.isnan(coefficients.forward + coefficients.back), np.nan, (coefficients.forward + coefficients.back) / 2
    )
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
