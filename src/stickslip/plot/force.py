"""The friction felt and the friction computed, over time and over frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.plot.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    SHADE,
    Array,
    axis_label,
    empty_figure,
    legend_above,
    prefixed,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.balance.felt_and_computed import ForceComparison

NAMES = {"direct": "load cell", "indirect": "from the motion", "difference": "difference"}
CYCLES = 3.0  # of the lowest line that are drawn


@styled
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

    figure = empty_figure(6.6)
    above, middle, below = figure.subplots(3, 1)
    _over_time(comparison, above)
    _sizes(comparison, middle)
    _ratio(comparison, below)
    below.sharex(middle)
    return figure


def _agreement(frequency: float) -> str:
    return f"agree up to {frequency:.2g} Hz" if frequency else "agree nowhere"


def _over_time(comparison: ForceComparison, ax: Axes) -> None:
    shown = comparison.time - comparison.time[0] < CYCLES / comparison.bands[0].low
    factor, unit = prefixed(comparison.direct, "N")
    for values, colour, label in (
        (comparison.indirect, ORANGE, NAMES["indirect"]),
        (comparison.direct, BLUE, NAMES["direct"]),
    ):
        ax.plot(comparison.time[shown], factor * values[shown], color=colour, linewidth=1.0, label=label)
    ax.set(xlabel="time [s]", ylabel=axis_label("friction", unit))
    legend_above(ax, columns=2)


def _middle(comparison: ForceComparison) -> Array:
    return np.array([band.centre for band in comparison.bands])


def _sizes(comparison: ForceComparison, ax: Axes) -> None:
    for name, colour in (("direct", BLUE), ("indirect", ORANGE), ("difference", INK)):
        sizes = [getattr(band, name) for band in comparison.bands]
        ax.loglog(_middle(comparison), sizes, "o-", color=colour, markersize=3, linewidth=1.0, label=NAMES[name])
    ax.set(ylabel="rms in the band [N]")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_major_formatter("{x:g}")
    legend_above(ax, columns=3)


def _ratio(comparison: ForceComparison, ax: Axes) -> None:
    frequency, tolerance = _middle(comparison), comparison.tolerance
    heard = np.array([band.verdict != "noise" for band in comparison.bands])
    gain, sd = (np.array([getattr(band, name) for band in comparison.bands]) for name in ("gain", "gain_sd"))
    within = f"within {100 * tolerance:g} %"
    ax.axhspan(1 - tolerance, 1 + tolerance, color=SHADE, alpha=0.5, linewidth=0, label=within)
    ax.errorbar(
        frequency[heard],
        gain[heard],
        yerr=2 * sd[heard],
        fmt="o-",
        color=INK,
        markersize=3,
        linewidth=1.0,
        label="computed over felt",
    )
    coherence = [band.coherence for band in comparison.bands]
    ax.plot(frequency, coherence, color=GREEN, linewidth=1.0, label="coherence")
    ax.plot(frequency, [b.significant for b in comparison.bands], ":", color=GREEN, linewidth=1.0, label="by chance")
    agree = max(comparison.agree_up_to.value, frequency[0])
    ax.axvline(
        agree, color=BLUE, linewidth=1.0, label=_agreement(agree if agree == comparison.agree_up_to.value else 0.0)
    )
    for number, each in enumerate(comparison.resonances):
        ax.axvline(each.frequency.value, color=FAINT, linewidth=1.0, linestyle="--")
        ax.annotate(
            f" {each.name}\n {each.frequency.value:.0f} Hz",
            (each.frequency.value, 0.97 - 0.25 * number),
            ha="left",
            va="top",
            xycoords=("data", "axes fraction"),
            fontsize=7,
        )
    top = max(2.0, 1.1 * float(gain[heard].max(initial=0.0)))
    ax.set(xscale="log", ylim=(0, min(top, 10.0)), xlabel="frequency [Hz]", ylabel="ratio, coherence")
    ax.xaxis.set_major_formatter("{x:g}")
    legend_above(ax, columns=3)
