"""A free decay: the response within its envelopes, what the identified motion leaves, the amplitude differences."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.decay import extremes as ex
from stickslip.figures import style
from stickslip.figures.style import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, SHADE
from stickslip.units import prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.answers.decays import Decay
    from stickslip.answers.findings import Comparison
    from stickslip.decay.decrement import Decrement
    from stickslip.decay.release import RingDown


WORDS = {"x": "displacement", "theta": "angle", "v": "velocity", "a": "acceleration"}
MARGIN = 0.04  # of the motion's length, shown before and after it
POINTS = 600  # of a smooth curve


@style.styled
def plot_decay(decay: Decay, *, release: int = 0, ax: Axes | None = None) -> Axes:
    """The response within the envelopes that either friction alone would give (thesis, Figure 6.1)."""
    ax, ring = style.axes_of(ax), decay.releases.ring_downs[release]
    factor, unit = prefixed(ring.samples - ring.rest, ring.unit)
    rows = _shown(ring)
    ax.plot(*style.envelope(ring.time[rows], factor * ring.samples[rows]), color=INK, linewidth=1.0, label="recorded")
    rest = decay.rest
    time, viscous, dry = _envelopes(decay, ring)
    alone = ((viscous, BLUE, "viscous friction alone"), (dry, ORANGE, "dry friction alone"))
    for curve, colour, text in alone if ring.isochronous else ():  # of a linear spring
        for side in (1, -1):
            label = text if side == 1 else None
            ax.plot(time, factor * (rest + side * curve), color=colour, linestyle="--", linewidth=1.1, label=label)
    ax.axhline(factor * rest, color=FAINT, linewidth=0.8)
    _shade_rest(ax, ring, rows)
    ax.set(xlabel="time [s]", ylabel=style.axis_label(WORDS[ring.channel], unit))
    style.legend_above(ax, columns=3)
    return ax


@style.styled
def plot_identified(decay: Decay, *, release: int = 0) -> Figure:
    """Recorded and identified response over each other, and what is left between them (thesis, Figure 6.10).

    Of a release beyond the first, by the whole waveform alone.
    """
    time, measured, fitted, label = _identified(decay, release)
    ring = decay.releases.ring_downs[release]
    factor, unit = prefixed(measured - decay.rest, ring.unit)
    figure, (above, below) = style.new_figure(2, height=4.6, heights=[2, 1])
    above.plot(*style.envelope(time, factor * measured), color=INK, linewidth=1.6, label="recorded")
    above.plot(*style.envelope(time, factor * fitted), color=ORANGE, linewidth=1.0, linestyle="--", label=label)
    above.set_ylabel(style.axis_label(WORDS[ring.channel], unit))
    style.legend_above(above, columns=2)
    residual = measured - fitted
    small, small_unit = prefixed(residual, ring.unit)
    below.plot(*style.envelope(time, small * residual), color=PURPLE, linewidth=0.8)
    below.axhline(0, color=FAINT, linewidth=0.8)
    below.set(xlabel="time [s]", ylabel=style.axis_label("left over", small_unit))
    figure.align_ylabels([above, below])
    return figure


@style.styled
def plot_differences(decrement: Decrement, *, ax: Axes | None = None) -> Axes:
    """The amplitude differences on the exponential that viscous friction alone makes of them (thesis, Figure 6.2)."""
    ax = style.axes_of(ax)
    factor, unit = prefixed(decrement.differences, decrement.ring_down.unit)
    # 2: differences of extremes two apart; 1: sums of neighbours
    apart = len(decrement.sd) - len(decrement.differences)
    spread = np.hypot(decrement.sd[apart:], decrement.sd[:-apart])
    number = np.arange(1, len(decrement.differences) + 1)
    zeta = decrement.damping_ratio.value
    beta = zeta / math.sqrt(1 - zeta**2)
    along = np.linspace(number[0], number[-1], POINTS)
    first = decrement.bounds.i
    scale = abs(float(decrement.differences[first - 1])) * math.exp(math.pi * beta * first)
    for side in (1, -1):
        label = f"exponential of the damping ratio {decrement.damping_ratio.cells[1]}" if side == 1 else None
        ax.plot(along, side * factor * scale * np.exp(-math.pi * beta * along), color=BLUE, linestyle="--", label=label)
    label = f"amplitude {'differences' if apart == 2 else 'sums'}, 95 %"
    look: Any = {"fmt": "o", "color": INK, "markersize": 3.5, "linewidth": 0.9, "zorder": 3, "label": label}
    ax.errorbar(number, factor * decrement.differences, yerr=1.96 * factor * spread, **look)
    ax.axhline(0, color=FAINT, linewidth=0.8)
    label = "X(i+1) - X(i-1)" if apart == 2 else "X(i-1) + X(i)"
    ax.set(xlabel="number i of the extreme", ylabel=style.axis_label(label, unit))
    style.legend_above(ax, columns=2)
    return ax


@style.styled
def plot_bounds(decrement: Decrement) -> Figure:
    """The viscous rate and the dry friction against the number m of half cycles, each with its worst case."""
    bounds = decrement.bounds
    factor, unit = prefixed(bounds.dry, decrement.dry_displacement.unit)
    figure, axes = style.new_figure(2, height=4.6)
    length = style.axis_label("x_k", unit)
    rows = (
        (bounds.rate, bounds.rate_first_order, bounds.rate_worst, "viscous rate β"),
        (factor * bounds.dry, factor * bounds.dry_first_order, factor * bounds.dry_worst, length),
    )
    for ax, (value, first_order, worst, label) in zip(axes, rows, strict=True):
        look: Any = {"color": ORANGE, "alpha": 0.2, "linewidth": 0, "label": "exact worst case"}
        ax.fill_between(bounds.m, value - worst, value + worst, **look)
        for side in (1, -1):
            text = "to first order" if side == 1 else None
            ax.plot(bounds.m, value + side * first_order, color=BLUE, linestyle="--", linewidth=1.0, label=text)
        ax.plot(bounds.m, value, "o-", color=INK, markersize=3, linewidth=0.9, label="estimate")
        ax.axvline(bounds.best, color=GREEN, linewidth=0.9, linestyle=":")
        _within_reach(ax, value, worst, first_order)
        ax.set_ylabel(label)
    style.legend_above(axes[0], columns=3)
    axes[1].set_xlabel("half cycles m between the two differences")
    figure.align_ylabels(list(axes))
    return figure


def _within_reach(ax: Axes, value: Array, *errors: Array) -> None:
    """Limits that show the values and the first of their errors that is finite anywhere; an axis of its own if none."""
    bounded = next((error[np.isfinite(error)] for error in errors if np.isfinite(error).any()), np.zeros(1))
    middle, reach = float(np.median(value)), 3 * float(np.median(bounded)) + float(np.ptp(value))
    if math.isfinite(middle + reach) and reach > 0:
        ax.set_ylim(middle - reach, middle + reach)


@style.styled
def plot_records(comparison: Comparison, *, quantity: str = "damping_ratio", ax: Axes | None = None) -> Axes:
    """A quantity of each record with its 95 % interval, and the band that holds for all."""
    estimates = [getattr(findings.decay.best, quantity) for findings in comparison.findings]
    names, label = [findings.name for findings in comparison.findings], "each record, 95 %"
    ax, factor, unit = style.named_intervals(names, estimates, ax=ax, label=label)
    for shared in (estimate for estimate in comparison.estimates if estimate.name == estimates[0].name):
        low, high = (factor * end for end in shared.interval)
        ax.axvspan(low, high, color=ORANGE, alpha=0.25, linewidth=0, label="all records, 95 %")
        ax.axvline(factor * shared.value, color=ORANGE, linewidth=1.0)
    ax.set_xlabel(style.axis_label(estimates[0].name, unit))
    style.legend_above(ax, columns=2)
    return ax


def plates_together(comparison: Comparison) -> list[style.Plate]:
    """The figures of several decays."""
    sentence = (
        "The records differ by more than their own intervals allow: something changed between them that no single one "
        "shows. The band holds their scatter."
        if comparison.apart
        else "The band is what all records give together; each by itself agrees with it."
    )
    return [
        style.captioned(
            "decay",
            quantity.replace("_", "-"),
            partial(plot_records, comparison, quantity=quantity),
            agreement=sentence,
        )
        for quantity in ("damping_ratio", "dry_displacement")
    ]


def plates_of(decay: Decay) -> list[style.Plate]:
    """The figures of a decay, in reading order."""
    ring, thesis = decay.releases.ring_downs[0], decay.thesis
    several = len(decay.releases.ring_downs)
    envelopes = (
        "Viscous friction alone would let it die away along the curved envelope, dry friction alone along the straight "
        "one; together they are faster than either. "
    ) * ring.isochronous
    filled = {
        "envelopes": envelopes,
        "grey": "Grey: at rest before the release or after." if ring.held or ring.stopped else "",
        "several": f" The first of {several} releases; the others are below." if several > 1 else "",
    }
    plates = [style.captioned("decay", "decay", partial(plot_decay, decay), **filled)]
    if decay.waveform is not None or (ring.order == 0 and decay.best in (decay.motion, thesis)):
        plates.append(style.captioned("decay", "identified", partial(plot_identified, decay)))
    fitted = 0 if decay.waveform is None or decay.best is decay.motion else len(decay.waveform.time)
    for release in range(1, several):
        kind, plot = ("identified", plot_identified) if release < fitted else ("decay", plot_decay)
        draw, number = partial(plot, decay, release=release), release + 1
        values = {"number": number, "several": several, "envelopes": envelopes.strip()}
        plates.append(style.captioned("decay", f"next-{kind}", draw, name=f"{kind}-{number}", **values))
    if thesis is not None:
        plates.append(style.captioned("decay", "differences", partial(plot_differences, thesis)))
        if len(thesis.bounds.m) > 2:
            plates.append(style.captioned("decay", "bounds", partial(plot_bounds, thesis), error=_length(thesis)))
    return plates


def _length(decrement: Decrement) -> str:
    factor, unit = prefixed(decrement.bounds.error, decrement.ring_down.unit)
    return f"{factor * decrement.bounds.error:.3g} {unit}"


def _shown(ring: RingDown) -> slice:
    """Rows of the motion and a little of what lies on either side."""
    motion = ring.motion
    margin = max(5, round(MARGIN * (motion.stop - motion.start)))
    return slice(max(0, motion.start - margin), min(len(ring.samples), motion.stop + margin))


def _shade_rest(ax: Axes, ring: RingDown, rows: slice) -> None:
    first, last = float(ring.time[rows][0]), float(ring.time[rows][-1])
    for seen, begin, end in ((ring.held, first, ring.release), (ring.stopped, ring.stop, last)):
        if seen and end > begin:
            ax.axvspan(begin, end, color=SHADE, alpha=0.5, linewidth=0)
    ax.set_xlim(first, last)


def _envelopes(decay: Decay, ring: RingDown) -> tuple[Array, Array, Array]:
    """Times, and the envelopes of either friction alone, from the first amplitude."""
    best = decay.best
    time = np.linspace(ring.release, ring.stop, POINTS)
    since, w = time - ring.release, 2 * math.pi * best.frequency.value
    viscous = abs(ring.amplitude) * np.exp(-max(0.0, best.damping_ratio.value) * w * since)
    fall = max(0.0, best.dry_displacement.value) * w**ring.order * 4 * best.frequency.value
    return time, viscous, np.maximum(0.0, abs(ring.amplitude) - fall * since)


def _identified(decay: Decay, release: int = 0) -> tuple[Array, Array, Array, str]:
    """Time, recorded, identified, and by which method."""
    if decay.best is decay.motion and release == 0:
        chosen = decay.motion.choice.chosen.fitted
        fitted, _, _ = chosen.blocks.motion(chosen.parameters, half_cycles=chosen.half_cycles)
        return chosen.blocks.times, chosen.blocks.values, fitted, "identified by the whole waveform"
    if decay.waveform is not None:
        fit, ring = decay.waveform, decay.releases.ring_downs[release]
        shown, time = ring.time[_shown(ring)], fit.time[release]
        near = (time >= shown[0]) & (time <= shown[-1])
        return time[near], fit.measured[release][near], fit.fitted[release][near], "identified by the whole waveform"
    thesis, ring = decay.thesis, decay.releases.ring_downs[0]
    assert thesis is not None
    rows = _shown(ring)
    time, rest = ring.time[rows], thesis.bias.value
    fitted = rest + ex.motion(
        time - float(thesis.time[0]),
        float(thesis.extremes[0]) - rest,
        damping_ratio=thesis.damping_ratio.value,
        dry_displacement=thesis.dry_displacement.value,
        frequency=thesis.frequency.value,
    )
    return time, ring.samples[rows], fitted, "identified by the decrements"
