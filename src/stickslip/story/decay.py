"""A free decay in sentences that a person understands."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.answers.decays import CLEAR, Decay
from stickslip.answers.findings import Comparison, Findings
from stickslip.arrays import Array
from stickslip.decay.answer import rig_units
from stickslip.decay.candidates import CURVED
from stickslip.decay.choice import SIZE
from stickslip.decay.decrement import Decrement
from stickslip.decay.fit_decay import LEFT_OVER, UNSHARED
from stickslip.decay.motions import free_decay
from stickslip.decay.release import CAUGHT
from stickslip.decay.which_motion import DecayMotion, beginning
from stickslip.estimate import Estimate, kinds
from stickslip.figures.decay import plates_of, plates_together
from stickslip.record.record import Record
from stickslip.story.scope import Scope, completed, corrected, of_fit
from stickslip.story.story import (
    WITHIN_DIGIT,
    Line,
    Story,
    Table,
    cautions,
    doubts,
    interval_of,
    listed,
    number,
    tried,
    value_of,
)

MOST = 0.5  # of the power of what is left over
OTHER = 0.1  # of the oscillation's frequency, within which it is a multiple of it
LEAVES_MORE = 1.5  # times the residual: a difference worth a sentence
FAR = 0.2  # rad: a pendulum's swing that a straight spring does not follow
SMOOTH = 4  # blocks that a cubic needs
METHODS = {"all": "whole waveform, and decrements", "waveform": "whole waveform", "thesis": "decrements"}


def of_findings(findings: Findings) -> Story:
    """One record."""
    decay, chosen = findings.decay, findings.settings
    beside = [replace(comparison, status="for comparison") for comparison in decay.comparisons]
    motions = () if decay.motion is None else [candidate[1:] for candidate in decay.motion.candidates]
    units = rig_units(chosen["channel"])
    settings = {"methods": METHODS[chosen["method"]], "channel": chosen["channel"], "spring": chosen["restoring"]}
    stated = {key: number(value, 0.0, units[key]) for key, value in chosen.items() if key in units}
    return Story(
        findings.name,
        list(_headline(findings)),
        cautions(findings),
        settings={**settings, **stated},
        tables=[*_by_other_ways([*decay.beside, *beside]), *([tried("motion", motions)] if motions else [])],
        draw=lambda: plates_of(decay),
        data=lambda: _data(decay),
        look=lambda: _scope(findings),
        remedies=_remedies(findings),
    )


def _remedies(findings: Findings) -> list[str]:
    """The commands without a mistake that may have been made, or with the units that were left out."""
    options = [] if findings.settings["restoring"] == "linear" else ["--restoring", findings.settings["restoring"]]
    if slips := findings.results.get("slips"):
        return corrected(findings, slips, "decay", options)
    return completed(findings, "decay", options)


def _scope(findings: Findings) -> Scope | None:
    """The record with the motion chosen over it, or the fitted waveform of all releases, where there is one."""
    decay, record = findings.decay, findings.record
    channel, fit = decay.releases.ring_downs[0].channel, decay.waveform
    question = ["decay", "--channel", channel]
    if findings.settings["restoring"] != "linear":
        question += ["--restoring", findings.settings["restoring"]]
    if decay.motion is not None and decay.best is decay.motion and len(decay.releases.ring_downs) == 1:
        words = decay.motion.choice.chosen.fitted.motion.words
        return of_fit(record, {channel: _chosen_motion(record, decay.motion)}, question, words)
    if fit is None:
        return None
    swings = [_at_samples(record, *release) for release in zip(fit.time, fit.fitted, strict=True)]
    time, fitted = (np.concatenate(parts) for parts in zip(*swings, strict=True))
    return of_fit(record, {channel: (time, fitted)}, question, fit.model)


def _chosen_motion(record: Record, motion: DecayMotion) -> tuple[Array, Array]:
    """The samples of a record within its release, and the motion chosen there."""
    chosen = motion.choice.chosen.fitted
    zero = motion.release_time.value - chosen.value("release")  # the record's time at that of the fit
    begin, end = zero + chosen.blocks.times[0], zero + chosen.blocks.times[-1]
    time = record.time[(record.time >= begin) & (record.time <= end)]
    restoring = chosen.blocks.restoring
    return time, free_decay(time - zero, chosen.parameters, restoring=restoring, half_cycles=chosen.half_cycles)[0]


def _at_samples(record: Record, centres: Array, means: Array) -> tuple[Array, Array]:
    """The samples of a record within a release, and a smooth motion there of which the means over blocks are known.

    Where a motion curves, its mean over a block of `n` samples, `h` long, lies off its value at the centre by
    (1 - 1/n^2) h^2 / 24 of its second derivative.
    """
    time = record.time[(record.time >= centres[0]) & (record.time <= centres[-1])]
    if len(centres) < SMOOTH:
        return time, np.interp(time, centres, means)
    from scipy.interpolate import CubicSpline

    n = round((centres[1] - centres[0]) * record.fs)
    bend = np.pad(np.diff(means, 2), 1, mode="edge")
    return time, CubicSpline(centres, means - (1 - 1 / n**2) / 24 * bend)(time)


def _by_other_ways(estimates: list[Estimate]) -> Iterator[Table]:
    """What is not quoted, folded away."""
    headings = ("quantity", "value", "95 % interval", "how sure")
    rows = [(estimate.name, value_of(estimate), interval_of(estimate), estimate.status) for estimate in estimates]
    if rows:
        yield Table("The same by other ways", headings, rows, folded=True)


def of_comparison(comparison: Comparison) -> Story:
    """Several records together."""
    own = [
        Line.of(number, finding.true_value(number), name=f"{number.name}, {finding.name}")
        for finding in comparison.findings
        for number in (
            finding.decay.best.damping_ratio,
            finding.decay.best.dry_displacement,
            finding.decay.best.frequency,
        )
    ]
    joint = comparison.joint
    half_cycles = None if joint is None else joint.half_cycles
    return Story(
        f"{len(comparison.findings)} records together",
        list(_together(comparison)),
        doubts(comparison.estimates),
        lines=own,
        draw=lambda: plates_together(comparison),
        data=lambda: {"joint": joint is not None, "apart": comparison.apart, "half_cycles": half_cycles},
    )


def _data(decay: Decay) -> dict[str, Any]:
    """Releases, motions tried, older methods and bounds, for JSON."""
    keys = ("release", "stop", "held", "stopped", "channel", "unit", "amplitude", "rest", "noise", "step", "status")
    tried = () if decay.motion is None else decay.motion.candidates
    return {
        "model": decay.best.model,
        "status": decay.best.status,
        "releases": [
            {**{key: getattr(ring_down, key) for key in keys}, "extremes": len(ring_down.turns)}
            for ring_down in decay.releases.ring_downs
        ],
        "motions": [{"name": name, "words": label, "verdict": verdict} for name, label, verdict in tried],
        "viscous_residual": decay.viscous_residual,
        "comparisons": [estimate.to_dict() for estimate in decay.comparisons],
        "decrements": None if decay.thesis is None else _decrements(decay.thesis),
    }


def _decrements(decrement: Decrement) -> dict[str, Any]:
    """Extremes, and the table of the bounds."""
    bounds = decrement.bounds
    rows = ("m", "rate", "rate_first_order", "rate_worst", "dry", "dry_first_order", "dry_worst")
    return {
        "extremes": {"time": decrement.time, "value": decrement.extremes, "sd": decrement.sd},
        "differences": decrement.differences,
        "bounds": {
            "i": bounds.i, "best_m": bounds.best, "error": bounds.error,
            **{name: getattr(bounds, name) for name in rows},
        },
        "scatter": {
            name: {"mean": values.mean(), "sd": values.std()}
            for name, values in vars(decrement.scatter).items() if len(values)
        },
    }  # fmt: skip


def _headline(findings: Findings) -> Iterator[str]:
    """What was found, in a few sentences."""
    decay = findings.decay
    if slips := findings.results.get("slips"):
        yield f"Probably {' or '.join(slip.words for slip in slips)}: until that is mended no friction is given."
        return
    yield from _frictions(findings)
    yield from _left_over(decay)
    if decay.refusal is not None and decay.best is not decay.motion:
        yield f"It is read from its extremes alone, for of the whole waveform {decay.refusal}"
    force = decay.dry_force
    word = "torque" if findings.settings["channel"] == "theta" else "force"
    if force is not None and decay.rubs:
        yield f"That is a dry friction {word} of {value_of(force)} (95 %: {interval_of(force)})."
    elif decay.rubs:
        yield f"The dry friction {word} is that displacement times the spring's stiffness; state stiffness= or mass=."
    yield from _motion(decay)
    yield from _chosen(decay)
    yield from _compared(decay)


def _frictions(findings: Findings) -> Iterator[str]:
    """What makes it die away, and what the record says against that."""
    decay = findings.decay
    yield _dying(decay)
    yield from _steady(decay)
    yield from _curved(decay)
    if decay.strays and decay.against >= CLEAR:
        words = decay.strays[0].words
        yield f"{words[0].upper()}{words[1:]}."
    elif CLEAR <= decay.against < SIZE:
        yield (
            f"The motions tried speak against viscous and dry friction, but weakly (p = {decay.against:.1g}): of "
            "true ones too one in twenty does so."
        )
    swings = decay.releases.ring_downs
    far = max(abs(swing.amplitude) for swing in swings)
    straight = findings.settings["channel"] == "theta" and findings.settings["restoring"] == "linear"
    if straight and far > FAR and (decay.against < CLEAR or not swings[0].isochronous):
        yield f'A swing of {far:.2g} rad is far for a straight spring: of a pendulum ask with restoring="pendulum".'


def _dying(decay: Decay) -> str:
    """By which frictions it dies away, and how large they are."""
    ratio, dry = decay.best.damping_ratio, decay.best.dry_displacement
    viscous, rubs = ratio.interval[0] > 0, decay.rubs
    shown = _both(ratio, dry)
    if decay.waveform is not None and UNSHARED in kinds(decay.waveform.status) and decay.waveform.motions:
        pairs = [_both(motion.damping_ratio, motion.dry_displacement) for motion in decay.waveform.motions]
        of_each = "; ".join(f"of release {number} {both}" for number, both in enumerate(pairs, 1))
        return f"The releases do not share one friction and frequency: {of_each}. The table fits all of them at once."
    curved = decay.best is decay.thesis and not decay.releases.ring_downs[0].isochronous
    if decay.motion is not None and decay.best is decay.motion:
        forces = decay.motion.choice.chosen.fitted.motion.words
        terms = [term for term in decay.motion.terms if rubs or term.name != dry.name]
        told = f"by {forces}: {listed([_with_interval(term) for term in terms])}."
        hidden = "" if len(terms) == len(decay.motion.terms) else f" {_hidden(dry, 'dry friction')}"
        if not decay.motion.choice.chosen.kept:
            return f"Nearest comes dying away {told[:-1]}; but more than noise is left over.{hidden}"
        return f"The motion dies away {'as it would ' if hidden else ''}{told}{hidden}"
    if decay.undecided:
        ratio, dry = decay.whichever
        return (
            f"The motion dies away by viscous friction. {_hidden(dry, 'dry friction')} Whichever it was, the damping "
            f"ratio is {_reach(ratio)}."
        )
    if decay.denied and decay.whichever:
        ratio, dry = decay.whichever
        rubbing = "" if dry.interval == (0.0, 0.0) else f" and the dry friction displacement {_reach(dry)}"
        reach = f"the damping ratio is {_reach(ratio)}{rubbing}"
        candidates = decay.motion.choice.candidates if decay.motion is not None else ()
        kept = [candidate.fitted.motion.words for candidate in candidates if candidate.kept]
        if len(kept) == 1:
            return f"Nearest comes {kept[0]}, though more than noise is left over: by that {reach}."
        which = f"Whichever of {len(candidates)} motions it was" if candidates else "Whichever motion it was"
        return f"{which}, {reach}: read as viscous and dry friction, which the record speaks against."
    if decay.denied or curved:
        return f"Read as viscous and dry friction, which the record speaks against, it shows {shown}."
    if viscous and rubs:
        model = decay.best.model
        forces = model if "friction" in model else f"{model} friction"
        return f"The motion dies away by {forces}: {shown}, if the dry friction stays the same."
    if viscous:
        widest = max((dry, *decay.whichever[1:]), key=lambda estimate: estimate.interval[1])
        return f"The motion dies away by viscous friction: {_with_interval(ratio)}. {_hidden(widest, 'dry friction')}"
    if rubs:
        return f"The motion dies away by dry friction: {_with_interval(dry)}. {_hidden(ratio, 'viscous friction')}"
    return "Neither viscous nor dry friction can be told from zero."


def _steady(decay: Decay) -> Iterator[str]:
    """What of the damping ratio a dry friction that changes on the way would be: no record tells the two well apart."""
    ratio = decay.whichever[0] if decay.denied and decay.whichever else decay.best.damping_ratio
    if decay.motion is None or decay.best is not decay.waveform or not (decay.rubs and ratio.interval[0] > 0):
        return
    per_drift = decay.motion.choice.candidate("both").damping_per_drift
    fall = -100 * ratio.value / per_drift if per_drift else math.inf
    all_of_it = f"; a fall by about {fall:.0f} % would pass for all of it" if 0 < fall < 100 else ""
    moved = "small" if per_drift < 0 else "large"
    yield (
        f"If the dry friction rises by 1 % over the decay, the damping ratio is read {abs(per_drift) / 100:.2g} too "
        f"{moved}{all_of_it}."
    )


def _curved(decay: Decay) -> Iterator[str]:
    """By how much the frequency of a spring that is not straight moves with the amplitude, to first order."""
    if decay.motion is None or decay.motion.model != CURVED or decay.against >= CLEAR:
        return
    fitted = decay.motion.choice.chosen.fitted
    if decay.motion.choice.chosen.p_value >= CLEAR:
        shift = 3 / 8 * fitted.value("curvature") * fitted.value("amplitude") ** 2
        way = "rises with the amplitude: it hardens" if shift > 0 else "falls with the amplitude: it softens"
        yield f"The spring is not straight, its frequency {way}, by {100 * abs(shift):.2g} % at the first swing."


def _chosen(decay: Decay) -> Iterator[str]:
    """Which motions the record leaves possible, and what counting them does to the dry friction."""
    motion = decay.motion
    if motion is None:
        return
    kept = [candidate.fitted.motion.words for candidate in motion.choice.candidates if candidate.kept]
    tried = len(motion.candidates)
    nearest = max(motion.choice.candidates, key=lambda candidate: candidate.p_value)
    if kept and motion.choice.status == "ok":
        yield f"Of {tried} motions tried the record does not speak against {len(kept)}: {'; '.join(kept)}."
    elif kept:
        yield f"Of {tried} motions tried {len(kept)} can not be excluded, but what they leave over is not noise alone."
    elif nearest.p_value < CLEAR:
        yield f"The record speaks against each of the {tried} motions tried: there is friction of another kind too."
    else:
        yield (
            f"The record speaks against each of the {tried} motions tried, least against "
            f"{nearest.fitted.motion.words} (p = {nearest.p_value:.1g}), which may be chance."
        )
    more = decay.viscous_residual
    if more is not None and more > LEAVES_MORE:
        yield f"Viscous damping alone leaves {more:.3g} times the residual that it leaves together with dry friction."
    dry = decay.whichever[1]
    force = decay.as_force(dry, "")
    also = f", its {'torque' if force.unit == 'N m' else 'force'} {_reach(force)}" if force is not None else ""
    if decay.denied or dry.interval == (0.0, 0.0):
        return
    which = "Whichever of them it is" if kept else "By all that leave at most twice the least residual"
    yield f"{which}, the dry friction displacement is {_reach(dry)}{also}."


def _reach(estimate: Estimate) -> str:
    """The interval; the value where it is narrower than the digits shown."""
    low, high = estimate.interval
    interval = interval_of(estimate)
    if interval == WITHIN_DIGIT:
        return value_of(estimate)
    two_sided = -math.inf < low < high < math.inf and not estimate.is_bound
    return f"within {interval}" if two_sided else interval


def _both(ratio: Estimate, dry: Estimate) -> str:
    return f"{_with_interval(ratio)} and {_with_interval(dry)}"


def _with_interval(estimate: Estimate) -> str:
    article = "an" if estimate.name[0] in "aeiou" else "a"
    return f"{article} {estimate.name} of {value_of(estimate)} (95 %: {interval_of(estimate)})"


def _hidden(estimate: Estimate, kind: str) -> str:
    """What is not told from zero, and up to how much of it would not be."""
    least = value_of(estimate, max(0.0, estimate.interval[1]))
    return f"That there is {kind} too can not be told: less than {least} of it would not be seen."


def _left_over(decay: Decay) -> Iterator[str]:
    """Where the fit leaves more than noise: whether that drifts, or swings at a frequency of its own."""
    fit = decay.waveform
    if fit is None or decay.best is decay.motion or LEFT_OVER not in kinds(fit.status):
        return
    # by least squares, where they were asked: noise that drifts takes part of another mode, and bends the motion for it
    tried = [motion.choice.chosen.fitted for motion in fit.motions]
    left = [(one.blocks.times, one.residual) for one in tried] or zip(fit.time, fit.residual, strict=True)
    time, residual = max(left, key=lambda pair: float(np.std(pair[1])))
    power = np.abs(np.fft.rfft((residual - residual.mean()) * np.hanning(len(residual)))) ** 2
    frequency = np.fft.rfftfreq(len(residual), float(time[1] - time[0]))
    own, total = fit.frequency.value, float(power.sum())
    near = slice(max(0, int(np.argmax(power)) - 2), int(np.argmax(power)) + 3)
    line = float(power[near].sum())
    at = float(power[near] @ frequency[near]) / line
    if float(power[frequency < own / 3].sum()) > MOST * total:
        yield "Most of what the fit leaves over is slower than the oscillation: the rest position drifts."
        return
    times = round(at / own)
    multiple = abs(at / own - times) < OTHER
    if line > MOST * total and not (multiple and times == 1):
        about = f", about {times} times the oscillation's own" if multiple else ""
        who = "a spring or a sensor that is not straight" if multiple else "something that drives it"
        yield (
            f"Most of what the fit leaves over swings at {number(at, frequency[1] / 10, 'Hz')}{about}: another mode of "
            f"the rig, or {who}; hold it still, or filter it out."
        )


def _motion(decay: Decay) -> Iterator[str]:
    rings = decay.releases.ring_downs
    many = f"{len(rings)} releases were found; the first" if len(rings) > 1 else "The motion"
    first = rings[0]
    end = f"comes to rest at {first.stop:.4g} s" if first.stopped else "is still going on at the end"
    end = f"is caught at {first.stop:.4g} s" if CAUGHT in first.marks else end
    begin, far = _begin(decay)
    yield (
        f"{many} {begin}, swings at {value_of(decay.best.frequency)} through {len(first.turns)} extremes from "
        f"{far}, and {end}."
    )


def _begin(decay: Decay) -> tuple[str, str]:
    """When the motion begins, and from how far; as it is fitted, where it is."""
    first, fit = decay.releases.ring_downs[0], decay.course
    begin = f"begins at {first.release:.4g} s" if first.held else "is under way when the record begins"
    if fit is None:
        return begin, number(abs(first.amplitude), abs(first.amplitude) / 1000, first.unit)
    at, far = value_of(fit.release_time), value_of(fit.amplitude, abs(fit.amplitude.value))
    if fit.release_time.name == beginning(True)[0]:
        return f"begins at {at}", far
    less = "swings are left out: " if first.held else ""
    return f"{begin} ({less}it is fitted from its turn at {at})", far


def _compared(decay: Decay) -> Iterator[str]:
    """Where two methods answer: whether they agree."""
    if decay.waveform is None or decay.thesis is None or decay.best is decay.motion:
        return
    apart = []
    for name in ("damping_ratio", "dry_displacement"):
        mine, theirs = getattr(decay.waveform, name), getattr(decay.thesis, name)
        gap = abs(mine.value - theirs.value)
        reach = max(abs(end - theirs.value) for end in theirs.interval) + max(
            abs(end - mine.value) for end in mine.interval
        )
        if gap > reach:
            apart.append(f"{mine.name} {value_of(theirs)}")
    if apart:
        yield (
            f"The decrements of the extremes give another {' and '.join(apart)}: neither interval knows of friction "
            "that is of another kind than these two."
        )
    else:
        yield "The decrements of the extremes agree within their intervals."


def _together(comparison: Comparison) -> Iterator[str]:
    many = len(comparison.findings)
    ratio, dry = comparison.damping_ratio, comparison.dry_displacement
    if comparison.apart:
        gaps = ", ".join(f"{name} by {gap:.{1 if gap < 10 else 0}f} times" for name, gap in comparison.apart.items())
        yield f"The {many} records are not alike: they differ in {gaps} what their own intervals allow."
        way = "Their means, with intervals that hold the scatter between them, are"
    else:
        yield f"The {many} records agree within their own intervals."
        way = "Fitted at once they give" if comparison.joint else "Their means are"
    if ratio is not None and dry is not None:
        yield f"{way} {_both(ratio, dry)}."
    if comparison.dry_force is not None:
        force = comparison.dry_force
        yield f"That is a dry friction force of {value_of(force)} (95 %: {interval_of(force)})."
    either, static = comparison.dry_displacement_any, comparison.static_displacement
    if either is not None:
        yield f"Whichever motion it was, the dry friction displacement is {_reach(either)}."
    if static is not None:
        waveforms = [finding.decay.waveform for finding in comparison.findings]
        alone = [waveform.static_displacement for waveform in waveforms if waveform is not None]
        least = min(alone, key=lambda estimate: estimate.interval[1] - estimate.interval[0])
        yield (
            f"The static friction displacement lies within {_reach(static).removeprefix('within ')}; the surest record "
            f"alone leaves {interval_of(least)}."
        )
