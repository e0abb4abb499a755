"""Chapter 6: dry and viscous damping from a ring-down."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip.decay import extremes as ex
from stickslip.figures.decay import plot_bounds, plot_decay, plot_differences, plot_identified
from stickslip.figures.style import BLUE, ORANGE, Plate, styled
from stickslip_thesis.drawing import figure, panels, system_i, system_ii
from stickslip_thesis.printed import Given, Ours

Array = NDArray[np.float64]

TITLE = "Dry and viscous damping from a ring-down"
STARTS_FROM = ("decay", "errors", "paper", "bearing")  # sections of given.toml
KINDS = ("random", "quantisation", "sampling")
COUNT = 12  # extremes in Table 6.1
FIRST = 2  # i of the tables
WORKED = {("rate", 1), ("rate", 3), ("rate", 5), ("dry", 1)}  # equations 6.20 to 6.23


def numbers(given: Given) -> Ours:
    """The chapter's numbers."""
    true = extremes(given)
    values: dict[str, Any] = {"extremes": true, **_taken_back(true), "beta": _beta(given["decay"])}
    for kind in KINDS:
        measured = measured_extremes(given, kind)
        columns = [table_column(given, kind, m) for m in given["errors"]["steps"]]
        values |= {f"{kind}.{key}": [column[key] for column in columns] for key in columns[0]}
        values[f"{kind}.measured"] = measured
        values[f"{kind}.errors"] = np.round(true, 5) - measured
    values |= {f"{kind}.largest": np.max(np.abs(values[f"{kind}.errors"])) for kind in ("random", "sampling")}
    values |= {
        f"random.{key}, m = {m}": values[f"random.{key}"][k]
        for key in ("rate", "dry")
        for k, m in enumerate(given["errors"]["steps"])
        if (key, m) in WORKED
    }
    return {**values, **_of_paper(given), **_of_bearing(given)}


def plates(given: Given) -> Iterator[Plate]:
    """The chapter's figures."""
    record = motion(given).record(fs=100)
    yield figure(
        "6.1",
        plot_decay(ss.analyze_decay(record, method="thesis").decay),
        "Neither friction alone decays so: the envelopes are of each by itself, fitted to the same motion.",
    )
    yield figure(
        "6.2",
        plot_differences(ss.decrement(record, form="plain")),
        "The sums X_i + X_(i+1) shrink by exp(-βπ): dry friction has gone out of them.",
    )
    yield figure("6.3", system_i(given), "Drawn from Table 6.2 and the chapter's parameters.")
    made_with = "The virtual rig with the values of Table 6.2; mass, spring and release are ours."
    for number, kind, case in (("6.4", "dry", 1), ("6.5", "dry", 2), ("6.6", "viscous", 1), ("6.7", "viscous", 2)):
        alone = ss.analyze_decay(on_paper(given, case, kind), method="thesis").decay
        yield figure(number, plot_decay(alone), made_with)
    decays = {case: ss.analyze_decay(on_paper(given, case, "both"), method="thesis").decay for case in (1, 2)}
    yield figure("6.8", plot_decay(decays[1]), made_with)
    yield figure("6.9", plot_differences(decays[1].thesis), made_with)
    yield figure("6.10", plot_identified(decays[2]), made_with)
    yield figure("6.11", plot_differences(decays[2].thesis), made_with)
    yield figure("6.12", system_ii(given), "Drawn from the parameters of section 6.5.")
    bearing = ss.analyze_decay(on_bearing(given), method="thesis").decay
    made_with = "The virtual rig with section 6.5's mass, spring, damping and friction; the release is ours."
    yield figure("6.13", plot_decay(bearing), made_with)
    yield figure("6.14", plot_differences(bearing.thesis), made_with)
    yield figure("6.15", plot_identified(bearing), made_with)
    yield from (_of_errors(given, number, kind) for number, kind in zip(("6.16", "6.17", "6.18"), KINDS, strict=True))
    yield figure(
        "bounds",
        plot_bounds(bearing.thesis),
        "Not in the thesis: for the bearing's decay, the exact worst case beside the bounds (6.16) and "
        "(6.18), against the half cycles between the two differences.",
        title="The bounds, exactly",
    )


def motion(given: Given) -> ss.solve.Trajectory:
    """The free decay of section 6.3, by the exact solver."""
    return _motion(**given["decay"])


@functools.cache
def _motion(*, mass: float, stiffness: float, damping: float, kinetic: float, release: float) -> ss.solve.Trajectory:
    slider = ss.Oscillator(mass=mass, stiffness=stiffness, damping=damping, law=ss.laws.Coulomb(kinetic))
    return ss.simulate(slider, start={"x": release}, duration=8 / slider.frequency)


def extremes(given: Given) -> Array:
    """X_0 to X_11."""
    return motion(given).states[:COUNT, 0]


def measured_extremes(given: Given, kind: str) -> Array:
    """As Tables 6.3, 6.5 and 6.7 have them: with noise, counted, or the largest of a few samples."""
    section = given["errors"]
    if kind == "random":
        return np.array(section["random"])
    if kind == "quantisation":
        return np.round(extremes(given) / section["quantum"]) * section["quantum"]
    run = motion(given)
    times = np.arange(section["first_sample"], run.duration, section["sampling"])
    samples, turns = run.sample(times, ("x",))[0][0], run.starts[:COUNT]
    signs = (-1.0) ** np.arange(COUNT)
    reach = math.pi / 8 * math.sqrt(given["decay"]["mass"] / given["decay"]["stiffness"]) * 2
    largest = [
        sign * np.max(sign * samples[np.abs(times - turn) < reach])
        for sign, turn in zip(signs[1:], turns[1:], strict=True)
    ]
    return np.round([given["decay"]["release"], *largest], 4)


def table_column(given: Given, kind: str, m: int) -> dict[str, float]:
    """One column of Tables 6.4 to 6.11 by the thesis's own conventions.

    x_k is from the printed, rounded rate; errors of the random and sampling tables are between printed numbers, those
    of the quantisation table are not rounded before.
    """
    section, x = given["errors"], measured_extremes(given, kind)
    bound, true_rate, true_dry = section["bounds"][kind], section["rate"], section["dry"]
    beta = ex.rate(x, i=FIRST, m=m)
    printed = round(beta, 4)
    dry = float(ex.dry(x, printed)[FIRST - 1])
    finely = kind == "quantisation"
    rate_off = abs(true_rate - (beta if finely else printed))
    dry_off = abs(true_dry - (float(ex.dry(x, beta)[FIRST - 1]) if finely else round(dry, 4)))
    errors = np.round(np.round(extremes(given), 5) - x + 1e-12, 4)
    return {
        "rate": beta,
        "rate off": rate_off,
        "rate off, percent": 100 * rate_off / true_rate,
        "alpha": ex.rate_bound(x, i=FIRST, m=m, error=bound),
        "dry": dry,
        "dry off": dry_off,
        "dry off, percent": 100 * dry_off / true_dry,
        "psi": ex.dry_bound(x, i=FIRST, beta=beta, dry_displacement=dry, error=bound, rate_error=abs(true_rate - beta)),
        "alpha effective": ex.rate_bound(x + errors, i=FIRST, m=m, beta=beta, error=_effective(errors, m)),
    }


def _effective(errors: Array, m: int) -> float:
    """delta_eff: half the larger error of the two differences."""
    return float(np.abs(ex.differences(errors))[[FIRST - 1, FIRST - 1 + m]].max() / 2)


def _beta(decay: Mapping[str, float]) -> float:
    zeta = decay["damping"] / (2 * math.sqrt(decay["mass"] * decay["stiffness"]))
    return zeta / math.sqrt(1 - zeta**2)


def _taken_back(true: Array) -> dict[str, float]:
    """Section 6.3: from the printed extremes, by (6.12) and (6.6)."""
    x = np.round(true, 5)
    beta = ex.rate(x, i=0, m=10, form="plain")
    dry = float(np.mean(ex.dry(x, beta, form="plain")))
    return {"beta by sums": beta, "zeta by sums": beta / math.sqrt(1 + beta**2), "dry by sums": dry}


def on_paper(given: Given, case: int, kind: str) -> ss.Record:
    """What the LVDT of system I would have written: "dry" (MKF), "viscous" (MKC) or "both" (MKCF)."""
    section = given["paper"]
    return _paper_record(
        section["mass"],
        section["stiffness"],
        section[f"case{case}"]["damping_ratio"] * (kind != "dry"),
        section["stiffness"] * section[f"case{case}"]["dry"] * (kind != "viscous"),
        section["release"],
        section["resolution"],
        section["fs"],
    )


def on_bearing(given: Given) -> ss.Record:
    """The same of system II."""
    section = given["bearing"]
    return _paper_record(
        section["mass"],
        section["stiffness"],
        section["damping_ratio"],
        section["kinetic"],
        section["release"],
        given["paper"]["resolution"],
        section["fs"],
    )


@functools.cache
def _paper_record(
    mass: float, stiffness: float, ratio: float, kinetic: float, release: float, step: float, fs: float
) -> ss.Record:
    slider = ss.Oscillator(
        mass=mass, stiffness=stiffness, damping=2 * ratio * math.sqrt(mass * stiffness), law=ss.laws.Coulomb(kinetic)
    )
    run = ss.simulate(slider, start={"x": release}, duration=(14 if ratio else 20) / slider.frequency)
    rig = ss.Rig((ss.rig.Sensor("x", noise=ss.rig.Noise(step / 5), digitiser=ss.rig.Digitiser(step=step)),))
    return rig.measure(run, fs=fs, rng=1)


def _of_paper(given: Given) -> Ours:
    """Table 6.2: what twins of system I give back, and the errors between its printed values."""
    section = [given["paper"][f"case{case}"] for case in (1, 2)]
    both = [ss.decrement(on_paper(given, case, "both")) for case in (1, 2)]
    viscous = [ss.decay.log_decrement(on_paper(given, case, "viscous")) for case in (1, 2)]
    dry = [ss.decay.linear_decrement(on_paper(given, case, "dry")) for case in (1, 2)]
    return {
        "paper.zeta": [result.damping_ratio.value for result in viscous],
        "paper.dry": [1e3 * result.dry_displacement.value for result in dry],
        "paper.zeta of both": [result.damping_ratio.value for result in both],
        "paper.dry of both": [1e3 * result.dry_displacement.value for result in both],
        **{f"paper.{key}": values for key, values in _scatters(given).items()},
        "paper.zeta off": [100 * abs(1 - entry["estimated_ratio"] / entry["damping_ratio"]) for entry in section],
        "paper.dry off": [100 * abs(1 - entry["estimated_dry"] / entry["dry"]) for entry in section],
    }


def _scatters(given: Given) -> dict[str, list[float]]:
    """The scatter of single estimates along one decay, of the friction alone and of both (equations 6.11 and 6.9)."""
    scatter = {
        (case, kind): ss.decrement(on_paper(given, case, kind)).scatter
        for case in (1, 2)
        for kind in ("viscous", "dry", "both")
    }
    return {
        "zeta scatter": [float(np.std(scatter[case, "viscous"].damping_ratio)) for case in (1, 2)],
        "dry scatter": [1e3 * float(np.std(scatter[case, "dry"].dry_displacement)) for case in (1, 2)],
        "zeta of both scatter": [float(np.std(scatter[case, "both"].damping_ratio)) for case in (1, 2)],
        "dry of both scatter": [1e3 * float(np.std(scatter[case, "both"].dry_displacement)) for case in (1, 2)],
    }


def _of_bearing(given: Given) -> Ours:
    """Section 6.5."""
    section, result = given["bearing"], ss.decrement(on_bearing(given))
    zeta = result.damping_ratio.value
    return {
        "bearing.zeta": zeta,
        "bearing.beta": zeta / math.sqrt(1 - zeta**2),
        "bearing.zeta scatter": float(np.std(result.scatter.damping_ratio)),
        "bearing.friction scatter": section["stiffness"] * float(np.std(result.scatter.dry_displacement)),
        "bearing.friction": section["stiffness"] * result.dry_displacement.value,
        "bearing.coefficient": section["kinetic"] / (section["mass"] * section["gravity"]),
    }


@styled
def _of_errors(given: Given, number: str, kind: str) -> Plate:
    """Figures 6.16 to 6.18: the response as it would be measured, and the error within it."""
    run, section = motion(given), given["errors"]
    fine = np.linspace(0, run.duration, 4001)
    x = run.sample(fine, ("x",))[0][0]
    if kind == "random":
        measured, words = (
            x + section["bounds"]["random"] * np.random.default_rng(1).uniform(-1, 1, len(x)),
            "with noise",
        )
        times = fine
    elif kind == "quantisation":
        measured, words, times = np.round(x / section["quantum"]) * section["quantum"], "counted", fine
    else:
        times = np.concatenate([[0.0], np.arange(section["first_sample"], run.duration, section["sampling"])])
        measured, words = run.sample(times, ("x",))[0][0], "sampled"
    drawn, (whole, detail) = panels(2, height=5.0)
    sampled = kind == "sampling"
    for ax in (whole, detail):
        ax.plot(fine, x, color=BLUE, linewidth=1.2, label="exact")
        ax.plot(times, measured, color=ORANGE, linewidth=0.9, marker="." if sampled else None, label=words)
        ax.set(xlabel="time [s]", ylabel="displacement [m]")
    turn, span, height = {"sampling": (4, 0.5, 0.1), "random": (2, 0.12, 0.012), "quantisation": (2, 0.06, 0.004)}[kind]
    middle, top = float(run.starts[turn]), float(run.states[turn, 0])
    detail.set(xlim=(middle - span, middle + span), ylim=(top - height, top + height))
    whole.legend(ncols=2, loc="upper right")
    how = {
        "random": "Uniform random numbers of our own within the bound.",
        "quantisation": "Counts of 0.001: the extremes of Table 6.5 follow to every digit.",
        "sampling": "Samples every 0.2 from 0.01 on, the release itself taken as 1: the extremes of Table 6.7 "
        "follow to every digit. The thesis does not print the interval.",
    }
    return figure(number, drawn, how[kind])
