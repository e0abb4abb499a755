"""The record over time: its channels, the forces that gave the friction, the friction felt and computed, its twin;
what a bench is told: responses, references, the plan of an experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import is_measured
from stickslip.figures import style
from stickslip.figures.style import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, SHADE, SKY
from stickslip.signals.derivatives import differentiate
from stickslip.statistics import follows
from stickslip.units import prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.experiment import ExperimentPlan
    from stickslip.answers.findings import Findings
    from stickslip.balance.felt_and_computed import ForceComparison
    from stickslip.bench.calibration import Calibration
    from stickslip.bench.response import ModalFit
    from stickslip.record.record import Record
    from stickslip.twin.trial import Trial

PANELS = (("x", "z"), ("theta",), ("v",), ("a",), ("force",), ("load",), ("friction",), ("normal",), ("y",), ("sound",))
MOST_SHADES = 300
CLOSE_UP_CYCLES = 6
_TERMS = {
    "spring": (BLUE, "--"), "inertia": (GREEN, "-."), "damper": (PURPLE, ":"), "applied force": (SKY, "--"),
    "friction": (ORANGE, "-"),
}  # fmt: skip
_COLOURS = {"x": BLUE, "z": SKY, "friction": ORANGE, "force": PURPLE, "load": PURPLE, "v": GREEN}


_METHODS = {"direct": "load cell", "indirect": "from the motion", "difference": "difference"}
_CYCLES = 3.0  # of the lowest line that are drawn


@style.styled
def plot_traces(findings: Findings, *, record: Record | None = None, most: int = 5) -> Figure:
    """The channels over time, one under the other, with the times of sticking shaded.

    A stretch of the record may be given to look closer; `most` panels are drawn, in the order of `PANELS`.
    """
    record = findings.record if record is None else record
    panels = [names for names in PANELS if any(name in record for name in names)]
    if len(panels) > most:
        panels = [names for names in panels if names != ("a",)][:most]
    if not panels:
        panels = [(name,) for name in list(record)[:most]]
    figure, axes = style.new_figure(len(panels), height=1.0 + 1.25 * len(panels))
    axes = np.atleast_1d(axes)
    for ax, names in zip(axes, panels, strict=True):
        _trace(ax, record, [name for name in names if name in record])
        shade_sticks(ax, findings, record)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(float(record.time[0]), float(record.time[-1]))
    figure.align_ylabels(axes)
    return figure


def close_up(findings: Findings) -> Record | None:
    """About six cycles from the middle of the record; None where the whole record is hardly longer."""
    record = findings.record
    if findings.loops is None or record.stamps is not None:
        return None
    rows = int(CLOSE_UP_CYCLES * record.fs / findings.loops.frequency.value)
    if rows < 30 or len(record) < 2 * rows:
        return None
    first = (len(record) - rows) // 2
    return record.rows(first, first + rows)


def shade_sticks(ax: Axes, findings: Findings, record: Record) -> None:
    """Shade the time that the contact stuck, where the stretches can be told apart."""
    if findings.sticks is None:
        return
    first, last = float(record.time[0]), float(record.time[-1])
    spans = [
        (max(event.time, first), min(event.time + event.duration, last) - max(event.time, first))
        for event in findings.sticks.events
        if event.kind == "stick" and event.time < last and event.time + event.duration > first
    ]
    if not 0 < len(spans) <= MOST_SHADES:
        return
    low, high = ax.get_ylim()
    ax.broken_barh(spans, (low, high - low), color=SHADE, alpha=0.55, linewidth=0, zorder=0)
    ax.set_ylim(low, high)


def force_balance(record: Record) -> dict[str, Array] | None:
    """The terms of the balance that gave the friction, in the order of drawing; None where it was not computed.

    ``f = k (z - x) - m a - c v + P``, with ``c (v - dz/dt)`` for a damper on the base; the constants are those in the
    record, not those at hand.
    """
    rig = record.rig
    if rig is None or rig.mass is None or rig.stiffness is None or is_measured(record, "friction"):
        return None
    stretch = record["z"] - record["x"] if "z" in record else -record["x"]
    terms = {"spring": rig.stiffness * stretch, "inertia": -rig.mass * record["a"]}
    if rig.damping:
        across = record["v"]
        if rig.damper == "base" and "z" in record:
            derive: Literal["smoother", "five-point"] = "five-point" if rig.method == "five-point" else "smoother"
            moved = differentiate(record["z"], record.fs, method=derive, bandwidth=rig.bandwidth)
            across = across - moved.values
        terms["damper"] = -rig.damping * across
    if "force" in record:
        terms["applied force"] = record["force"]
    return {**terms, "friction": record["friction"]}


@style.styled
def plot_force_balance(findings: Findings, *, record: Record | None = None, ax: Axes | None = None) -> Axes:
    """The terms of the force balance: spring, inertia, damper, applied force, and the friction that they leave."""
    ax = style.axes_of(ax)
    whole = findings.record
    record = whole if record is None else record
    terms = force_balance(whole)
    assert terms is not None
    first = round((record.start - whole.start) * whole.fs)
    parts = {term: values[first : first + len(record)] for term, values in terms.items()}
    factor, unit = prefixed(np.concatenate(list(parts.values())), "N")
    for term, values in parts.items():
        colour, line = _TERMS[term]
        ax.plot(*style.envelope(record.time, factor * values), line, color=colour, label=term)
    shade_sticks(ax, findings, record)
    ax.axhline(0, color=FAINT, linewidth=0.8)
    ax.set(xlabel="time [s]", ylabel=style.axis_label("force on the mass", unit))
    ax.set_xlim(float(record.time[0]), float(record.time[-1]))
    ax.legend(ncols=len(terms), loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return ax


def _trace(ax: Axes, record: Record, names: Sequence[str]) -> None:
    peak = np.array([np.nanmax(np.abs(record[n])) if np.isfinite(record[n]).any() else 0.0 for n in names])
    factor, unit = prefixed(peak, record.channels[names[0]].unit)
    for name in names:
        ax.plot(*style.envelope(record.time, factor * record[name]), color=_COLOURS.get(name, INK), label=name)
    quantities = {
        "x": "displacement",
        "theta": "angle",
        "y": "normal\ndisplacement",
        "a": "acceleration",
        "v": "velocity",
    }
    ax.set_ylabel(style.axis_label(quantities.get(names[0], names[0]), unit, between="\n"))
    if len(names) > 1:
        labels = {"x": "mass (x)", "z": "base (z)"}
        for line in ax.get_lines():
            line.set_label(labels.get(str(line.get_label()), str(line.get_label())))
        ax.legend(ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.97))


@style.styled
def plot_force_comparison(comparison: ForceComparison) -> Figure:
    """Where do the load cell and the motion tell the same friction?

    Above both forces over a few cycles; below their size and that of their difference in each band; then their ratio,
    with the tolerance shaded, the frequency up to which they agree, and the mounts that were found.

    Parameters
    ----------
    comparison : ForceComparison
        From :func:`~stickslip.balance.compare_force`.

    Returns
    -------
    Figure

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(
    ...     mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7)
    ... )
    >>> record = ss.Rig().measure(ss.simulate(slider, duration=4), fs=2000, rng=1, start=2)
    >>> len(plot_force_comparison(ss.balance.compare_force(record, mass=2.42, stiffness=2310)).axes)
    3
    """

    figure = style.empty_figure(6.6)
    above, middle, below = figure.subplots(3, 1)
    _over_time(comparison, above)
    _sizes(comparison, middle)
    _ratio(comparison, below)
    below.sharex(middle)
    return figure


def _over_time(comparison: ForceComparison, ax: Axes) -> None:
    shown = comparison.time - comparison.time[0] < _CYCLES / comparison.bands[0].low
    factor, unit = prefixed(comparison.direct, "N")
    for name, colour in (("indirect", ORANGE), ("direct", BLUE)):
        values = factor * getattr(comparison, name)[shown]
        ax.plot(comparison.time[shown], values, color=colour, linewidth=1.0, label=_METHODS[name])
    ax.set(xlabel="time [s]", ylabel=style.axis_label("friction", unit))
    style.legend_above(ax, columns=2)


def _middle(comparison: ForceComparison) -> Array:
    return np.array([band.centre for band in comparison.bands])


def _sizes(comparison: ForceComparison, ax: Axes) -> None:
    for name, colour in (("direct", BLUE), ("indirect", ORANGE), ("difference", INK)):
        sizes = [getattr(band, name) for band in comparison.bands]
        ax.loglog(_middle(comparison), sizes, "o-", color=colour, markersize=3, linewidth=1.0, label=_METHODS[name])
    ax.set(ylabel="rms in the band [N]")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_major_formatter("{x:g}")
    style.legend_above(ax, columns=3)


def _ratio(comparison: ForceComparison, ax: Axes) -> None:
    frequency, tolerance = _middle(comparison), comparison.tolerance
    heard = np.array([band.verdict != "noise" for band in comparison.bands])
    gain, sd = (np.array([getattr(band, name) for band in comparison.bands]) for name in ("gain", "gain_sd"))
    within = f"within {100 * tolerance:g} %"
    ax.axhspan(1 - tolerance, 1 + tolerance, color=SHADE, alpha=0.5, linewidth=0, label=within)
    look: Any = {"fmt": "o-", "color": INK, "markersize": 3, "linewidth": 1.0, "label": "computed over measured"}
    ax.errorbar(frequency[heard], gain[heard], yerr=2 * sd[heard], **look)
    coherence = [band.coherence for band in comparison.bands]
    ax.plot(frequency, coherence, color=GREEN, linewidth=1.0, label="coherence")
    ax.plot(frequency, [b.significant for b in comparison.bands], ":", color=GREEN, linewidth=1.0, label="by chance")
    known = comparison.agree_up_to.value
    label = f"agree up to {known:.2g} Hz" if known >= frequency[0] else "agree nowhere"
    ax.axvline(max(known, frequency[0]), color=BLUE, linewidth=1.0, label=label)
    for number, resonance in enumerate(comparison.resonances):
        at, label = resonance.frequency.value, f" {resonance.name}\n {resonance.frequency.value:.0f} Hz"
        ax.axvline(at, color=FAINT, linewidth=1.0, linestyle="--")
        ax.text(at, 0.97 - 0.25 * number, label, va="top", transform=ax.get_xaxis_transform(), fontsize=7)
    top = max(2.0, 1.1 * float(gain[heard].max(initial=0.0)))
    ax.set(xscale="log", ylim=(0, min(top, 10.0)), xlabel="frequency [Hz]", ylabel="ratio, coherence")
    ax.xaxis.set_major_formatter("{x:g}")
    style.legend_above(ax, columns=3)


@style.styled
def plot_twin(trial: Trial, *, record: Record | None = None) -> Figure:
    """Does the rig that the record is believed to come from move as the record did?

    Above the measured displacement and the quiet twin's; below what is left, with the share of the motion that the twin
    follows: ``100 (1 - |x - y| / |x - mean x|)``, as a comparison of models is commonly rated.
    """
    whole = trial.belief.record
    moved = trial.belief.moved
    residual = whole["x"] - moved
    residual = residual - residual.mean()
    rated = follows(whole["x"], moved)
    stretch = whole if record is None else record
    shown = (whole.time >= stretch.time[0]) & (whole.time <= stretch.time[-1])
    figure, (above, below) = style.new_figure(2, height=4.4, heights=(2, 1))
    factor, unit = prefixed(whole["x"][shown], "m")
    above.plot(whole.time[shown], factor * whole["x"][shown], color=BLUE, label="measured")
    above.plot(whole.time[shown], factor * moved[shown], color=ORANGE, ls="--", label=f"twin, follows {rated:.2f} %")
    above.set_ylabel(style.axis_label("x", unit))
    style.legend_above(above, columns=2)
    factor, unit = prefixed(residual[shown], "m")
    below.plot(whole.time[shown], factor * residual[shown], color=INK, lw=0.8)
    below.axhline(0.0, color=FAINT, lw=0.8, zorder=0)
    below.set_ylabel(style.axis_label("left", unit))
    below.set_xlabel(style.axis_label("time", "s"))
    return figure


COLOURS, MARKS = (BLUE, ORANGE, GREEN, PURPLE), ("o", "s", "^", "D")


@style.styled
def plot_calibrations(calibrations: Mapping[str, Calibration]) -> Figure:
    """How far each sensor is off the straight line through its levels, as a part of its range.

    Examples
    --------
    >>> from stickslip import Record, bench
    >>> read = np.repeat([0.0, 1.0, 2.0, 3.0], 500) + 0.01 * np.random.default_rng(1).standard_normal(2000)
    >>> calibration = bench.calibrate(Record.of({"load": read}, fs=500), channel="load", reference=[0, 1, 2, 3])
    >>> len(plot_calibrations({"load": calibration}).axes)
    1
    """
    figure, ax = style.new_figure(height=3.0)
    for number, (name, calibration) in enumerate(calibrations.items()):
        line = calibration.gain.value * calibration.reference
        off = calibration.levels - line
        off = 100 * (off - off.mean()) / np.ptp(line)
        look: Any = {"color": COLOURS[number % 4], "marker": MARKS[number % 4], "linestyle": "none"}
        ax.plot(np.arange(1, len(off) + 1) + 0.08 * number, off, label=name, **look)
    ax.axhline(0.0, color=INK, linewidth=0.8)
    ax.set(xlabel="level, in the order of the record", ylabel=style.axis_label("off the line", "% of range"))
    ax.legend(ncols=4, loc="lower left", bbox_to_anchor=(0, 1))
    return figure


@style.styled
def plot_response(fit: ModalFit) -> Figure:
    """The frequency response: H1, H2, the fitted oscillator, and the coherence.

    Examples
    --------
    >>> from stickslip import bench
    >>> sweep = bench.SimulatedBench(fs=500).record("sweep")
    >>> len(plot_response(bench.modal_fit(sweep, mass=2.42)).axes)
    2
    """
    response = fit.response
    assert response is not None
    figure, (above, below) = style.new_figure(2, height=4.2, heights=[3, 1])
    f = response.frequency
    above.plot(f, np.abs(response.h1), color=BLUE, label="H1, averaged")
    above.plot(f, np.abs(response.h2), color=ORANGE, linestyle=":", label="H2, averaged")
    above.plot(f, np.abs(fit.model(f)), color=INK, linewidth=0.9, label="fitted oscillator")
    above.set_yscale("log")
    style.plain_decades(above.yaxis)
    unit = "1" if response.channels[0] == "z" else "m/N"
    above.set_ylabel(style.axis_label(f"{response.channels[1]} over {response.channels[0]}", unit))
    above.legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    below.plot(f, response.coherence, color=GREEN)
    below.set(ylim=(0, 1.05), ylabel="coherence", xlabel=style.axis_label("frequency", "Hz"))
    return figure


@style.styled
def plot_plan(plan: ExperimentPlan) -> Figure:
    """What each sampling rate and choice of sensors can tell, one panel a question.

    Parameters
    ----------
    plan : ExperimentPlan
        From :func:`~stickslip.answers.plan_experiment`.

    Returns
    -------
    Figure

    Examples
    --------
    >>> import stickslip as ss
    >>> drive = ss.drives.HarmonicBase(0.01, frequency=1)
    >>> slider = ss.Oscillator(mass=1, stiffness=100, law=ss.laws.Coulomb(0.2), drive=drive)
    >>> plan = ss.answers.plan_experiment(ss.simulate(slider, cycles=8), rates=[250], draws=1)
    >>> len(plot_plan(plan).axes)
    3
    """
    from matplotlib.ticker import NullFormatter

    figure, panels = style.new_figure(len(plan.questions), height=0.6 + 1.5 * len(plan.questions))
    choices = list(dict.fromkeys(setup.sensors for setup in plan.setups))
    for panel, question in zip(np.atleast_1d(panels), plan.questions, strict=True):
        unit = plan.setups[0].accuracy[question].unit
        factor, text = prefixed(np.array([setup.accuracy[question].error for setup in plan.setups]), unit)
        for number, sensors in enumerate(choices):
            errors = {s.fs: s.accuracy[question].error for s in plan.setups if s.sensors == sensors}
            look = {"color": COLOURS[number % 4], "marker": MARKS[number % 4], "markersize": 7 - 1.5 * number}
            panel.plot(list(errors), factor * np.array(list(errors.values())), label=", ".join(sensors), **look)
        panel.set(xscale="log", yscale="log", ylabel=style.axis_label("rms error" if plan.draws > 1 else "error", text))
        style.plain_decades(panel.yaxis)
        panel.set_title(question, loc="left")
        panel.grid(visible=True, which="minor", color=FAINT, alpha=0.15)
    panel.set_xticks(sorted({setup.fs for setup in plan.setups}))
    panel.xaxis.set_major_formatter("{x:g}")
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.set_xlabel(style.axis_label("sampling rate", "Hz"))
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2)
    return figure
