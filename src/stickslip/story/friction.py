"""A record's friction, that of several records, and what a channel holds over time and frequency, told."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from stickslip.answers.findings import Comparison, Findings
from stickslip.answers.frequencies import TimeFrequency
from stickslip.answers.mistakes import hopeless
from stickslip.balance.balance import Pull
from stickslip.consistent.checks import Slip
from stickslip.contact.ringing import UNTOLD
from stickslip.cycle.onset import Breakaway, Presliding
from stickslip.cycle.slips import SlipRinging
from stickslip.estimate import Estimate, stands
from stickslip.figures.friction import plates_of, plates_together
from stickslip.figures.maps import plates_of_map
from stickslip.record.record import RIG_UNITS
from stickslip.statistics import relative_swing
from stickslip.story import scope
from stickslip.story.story import (
    Caution,
    Line,
    Story,
    cautions,
    constant,
    doubts,
    interval_of,
    leading,
    number,
    sentence,
    value_of,
)

MOSTLY = 0.5  # of the time: a bound above it tells nothing
RARELY = 0.005  # of the time
STEADY = 0.01  # of its mean, by which a recorded load may swing unsaid: from there on no twin's friction is like it
LIKELY = 3.0  # times the difference: wider intervals of the two directions tell nothing of it
SAME = 0.05  # forward and back differ noticeably beyond this part of the level
LOOSE = 3.0  # times the sliding friction: a bound on the static one that is wider tells nothing worth a claim
ALIKE = 0.02  # a static friction that differs from the sliding one by less is about as large
TOO_WIDE = 0.5  # an interval wider than this part of the value deserves a word


def of_findings(findings: Findings) -> Story:
    """One record."""
    leading = () if next(_wrong(findings), "") else (findings.breakaway, findings.presliding)
    headed = [estimate for answer in leading if answer is not None for estimate in answer.estimates]
    return Story(
        findings.name,
        list(_headline(findings)),
        cautions(findings, headed),
        notes=list(_exact(findings)),
        settings=_settings(findings),
        draw=lambda: plates_of(findings),
        data=lambda: _data(findings),
        look=lambda: scope.of_findings(findings),
        remedies=_remedies(findings),
    )


def of_comparison(comparison: Comparison) -> Story:
    """Several records side by side."""
    levels = [(finding, finding.level) for finding in comparison.findings if finding.level is not None]
    return Story(
        f"{len(comparison.findings)} records compared",
        list(_together(comparison)),
        lines=[
            Line.of(level, finding.true_value(level), name=f"{level.name}, {finding.name}") for finding, level in levels
        ],
        draw=lambda: plates_together(comparison),
    )


def _settings(findings: Findings) -> dict[str, str]:
    settings = {key: str(value) for key, value in findings.settings.items() if key not in ("sd", "sensors")}
    for channel, stated in findings.settings.get("sensors", {}).items():
        settings[f"sensor {channel}"] = ", ".join(f"{key} {value}" for key, value in stated.items())
    sd = findings.settings.get("sd", {})
    for key in settings.keys() & RIG_UNITS.keys():
        settings[key] = constant(findings.settings[key], sd.get(key, 0.0), RIG_UNITS[key])
    return settings


def _data(findings: Findings) -> dict[str, Any]:
    regression, trial = findings.regression, findings.trial
    return {
        "contradiction": findings.contradiction,
        "normal_load": findings.normal and findings.normal.value,
        "regression_residual": None if regression is None else regression.residual,
        **({} if trial is None else {"twins": trial.to_dict()}),
    }


def _exact(findings: Findings) -> Iterator[str]:
    """How to state how sure constants and gains are, where the headline says that nobody did."""
    if _taken_exact(findings):
        yield (
            "The intervals leave out how sure your constants and the sensors' gains are: state it as in "
            '"2.42 ± 0.02 kg", and of a channel as in "COLUMN [g] ± 1 %".'
        )


def _taken_exact(findings: Findings) -> bool:
    """Whether a trial took constants and gains as exact, as nobody stated how sure they are."""
    return findings.trial is not None and not _uncertain(findings.record)


def _uncertain(record: Any) -> bool:
    """Whether it is stated how sure a constant or a gain is."""
    return bool(record.rig and record.rig.sd) or any(channel.gain_sd for channel in record.channels.values())


def _remedies(findings: Findings) -> list[str]:
    """The commands that read the channels without a slip that would make them agree, or state what is missing."""
    slips = findings.results.get("slips") or findings.results.get("slipped") or _zeros_off(findings)
    return scope.corrected(findings, slips) if slips else scope.completed(findings)


def _zeros_off(findings: Findings) -> tuple[Slip, ...]:
    """The zeros of which one is off by much, where nothing graver is wrong."""
    return findings.consistency.zeros if findings.consistency is not None and not findings.contradiction else ()


def _wrong(findings: Findings) -> Iterator[str]:
    """What is stated wrongly, or not at all, and leaves no force to be given."""
    slips, missing = findings.results.get("slips") or (), findings.results.get("lacking") or ()
    if slips:
        yield f"Probably {' or '.join(slip.words for slip in slips)}: until that is mended no force is given."
    elif apart := hopeless(findings.consistency):
        yield f"{sentence(apart)}. Until that is mended no force is given."
    elif missing:
        are, them = ("is", "it") if len(missing) == 1 else ("are", "them")
        yield (
            f"The {' and the '.join(missing)} {are} missing: without {them}, or a force sensor, the friction "
            "can not be found."
        )


def _headline(findings: Findings) -> Iterator[str]:
    if wrong := list(_wrong(findings)):
        yield from wrong
        if findings.sticks is not None:
            yield sentence(f"{of_sticks(findings)}.")
        return
    if zeros := _zeros_off(findings):
        yield Caution(f"{sentence(zeros[0].words)}.")
    clauses = [_of_level(findings)] if findings.loops is not None else []
    clauses += [of_sticks(findings)] if findings.sticks is not None else []
    if findings.loops is not None:
        yield sentence(f"{'; '.join(clauses)}.")
        yield from _of_loops(findings)
    regression = findings.regression
    if regression is not None and regression.viscous is not None and regression.coulomb is not None:
        left = regression.residual
        share = f"; {100 * left:.1f} % of it is left unexplained" if math.isfinite(left) else ""
        yield (
            f"An inertia of {value_of(regression.inertia)}, viscous friction of {value_of(regression.viscous)} and "
            f"dry friction of {value_of(regression.coulomb)} explain the measured force{share}."
        )
    apart = findings.asymmetric
    if apart is not None and findings.loops is None:
        yield from _of_directions(apart.coulomb_forward, apart.coulomb_back)
        yield from _of_directions(apart.viscous_forward, apart.viscous_back, "in viscous friction")
    if findings.sticks is not None and findings.loops is None:
        yield sentence(f"{of_sticks(findings)}.")
    if findings.breakaway is not None:
        stops = findings.sticks is None or any(event.kind != "slip" for event in findings.sticks.events)
        yield from _of_breakaway(findings.breakaway, "At breakaway" if stops else "As it turns round")
    if findings.stiffness is not None:
        yield _of_contact(findings.stiffness, findings.contact_damping)
    if findings.cause is not None:
        yield sentence(f"{findings.cause.cause}: {findings.cause.reason.rstrip('.')}.")
    if findings.presliding is not None:
        yield from _of_presliding(findings.presliding)
    if findings.pull is not None:
        yield from _of_pull(findings.pull)


def _of_directions(forward: Estimate | None, back: Estimate | None, what: str = "") -> Iterator[str]:
    if forward is None or back is None:
        return
    apart = abs(forward.value - back.value)
    (low, high), (least, most) = forward.interval, back.interval
    if apart <= SAME * abs(forward.value + back.value) / 2:
        return
    if low > most or least > high:
        alike = "" if what else "; a zero offset of a sensor or a sloping rig looks the same"
        yield (
            f"The two directions differ{what and ' ' + what}: {value_of(forward)} forward and {value_of(back)} "
            f"back{alike}."
        )
    elif not what and max(high - low, most - least) < apart * LIKELY:  # the offset itself is told
        yield (
            "Friction unlike in its directions and a zero of a sensor that is off look the same: forward and back hold "
            "where it is one of them, not where one hides the other."
        )


def _of_level(findings: Findings) -> str:
    """How large the friction is; lesser doubts are among the cautions."""
    level = findings.loops.level
    if not level.known:
        return f"the sliding friction is not known: {level.status}"
    doubt = "" if stands(level.status) else f", which is not to be trusted ({level.status})"
    if level.interval[0] == 0:
        return f"no sliding friction is resolved: it is below {value_of(level, level.interval[1])} (95 %){doubt}"
    exact = ", with your constants exact" if _taken_exact(findings) else ""
    how = ", not tried on twins" if findings.untried else exact
    if findings.untried and _uncertain(findings.record):
        how += ", which would count how sure your constants are"
    sure = f"95 %{how}"
    return f"the contact slides against {value_of(level)} of friction ({sure}: {interval_of(level)}){doubt}"


def _of_loops(findings: Findings) -> Iterator[str]:
    loops = findings.loops
    assert loops is not None
    if not loops.level.known:
        return
    if findings.coefficient is not None and findings.normal is not None:
        swing = relative_swing(findings.record["normal"]) if "normal" in findings.record else 0.0
        swings = f", which swings by {100 * swing:.2g} % (r.m.s.)," if swing > STEADY else ""
        yield (
            f"Under a normal load of {value_of(findings.normal)}{swings} that is a friction coefficient of "
            f"{value_of(findings.coefficient)}."
        )
    yield from _of_directions(loops.forward, loops.back)
    low, high = loops.slope.interval
    changes = loops.slope.status == "ok" and (low > 0 or high < 0)
    trial = findings.trial
    curved = trial is not None and not trial.unlike and math.isfinite(trial.belief.fall_speed)
    ratio = _surely_static(findings) if curved else None
    if ratio is not None:
        belief = trial.belief
        static = number(belief.static, ratio.sd * belief.kinetic, loops.level.unit)
        speed = number(belief.fall_speed, 0.1 * belief.fall_speed, "m/s")
        line = f"; over the speeds at which it slides its slope is {value_of(loops.slope)}" if changes else ""
        yield f"Friction falls from {static} at rest as it begins to slide, about a speed of {speed}{line}."
    elif changes:
        yield f"Friction {'rises' if low > 0 else 'falls'} with speed, by {value_of(loops.slope)}."
    if loops.slope.status == "ok" and not changes and math.isfinite(low + high) and (ratio is not None or not curved):
        power = findings.trial and findings.trial.felt.get(loops.slope.name)
        seen = f": {value_of(loops.slope, power.felt)} would be" if power else ""
        yield f"No {'other ' if ratio is not None else ''}change of friction with speed is resolved{seen}."


def _surely_static(findings: Findings) -> Estimate | None:
    """Static over sliding friction, where it surely exceeds one."""
    ratio = findings.breakaway.ratio if findings.breakaway is not None else None
    return ratio if ratio is not None and stands(ratio.status) and ratio.interval[0] > 1 else None


def of_sticks(findings: Findings) -> str:
    """Whether, and for how long, it sticks."""
    sticks = findings.sticks
    assert sticks is not None
    low, high = sticks.share.interval
    bound = findings.trial is not None and sticks.share.known and low == 0.0 < high
    if high >= MOSTLY and (bound or sticks.share.value < RARELY):
        return "how long it sticks is not resolved"
    if bound:
        return f"no stick is resolved: it sticks below {100 * high:.2g} % of the time (95 %)"
    if high == 0.0 or not any(event.kind == "stick" for event in sticks.events):
        brief = sticks.share.value >= RARELY
        share = value_of(sticks.share)
        return f"it rests only briefly as it turns round, {share} of the time in all" if brief else "it never sticks"
    if sticks.share.value < RARELY:
        return "it hardly ever sticks"
    often = sticks.per_cycle.value
    some = math.isfinite(often) and often > 0
    number = f"{often:.2g}"
    where = "each cycle" if number.isdigit() else "a cycle on average"
    stops = f", with {number} stop{'' if number == '1' else 's'} in {where}" if some else ""
    share = interval_of(sticks.share) if high - low > 0.01 else value_of(sticks.share)
    return f"it {'sticks' if stands(sticks.share.status) else 'seems to stick'} {share} of the time{stops}"


def _of_breakaway(breakaway: Breakaway, when: str) -> Iterator[str]:
    ratio = breakaway.ratio
    low, high = ratio.interval
    if not math.isfinite(low + high):
        why = ratio.status if breakaway.status == "ok" else breakaway.status
        yield f"The breakaway force is not known: {why}."
        return
    if low <= 1 + ALIKE and high > LOOSE:
        yield f"{when} the record hardly tells what it bears: at most {high:.2g} times the sliding friction."
        return
    if not stands(ratio.status):
        most = f"at most {high:.3g}" if low < 1 else value_of(ratio)
        yield f"{when} it seems to bear {most} times as much as while it slides."
        return
    more = "more than" if low > 1 + ALIKE else "less than" if high < 1 - ALIKE else ""
    times = f"while it slides ({value_of(ratio)} times, 95 %: {interval_of(ratio)})"
    both = [estimate for estimate in (breakaway.forward, breakaway.back) if estimate]
    sides = " and ".join(f"{value_of(estimate)} {estimate.name.split()[-1]}" for estimate in both)
    # of what is not told from the sliding friction the two directions may differ as that does
    yield f"{when} it bears {sides}: {more} {times}." if more else f"{when} it bears about as much as {times}."
    rings = [estimate for estimate in (breakaway.ringing_forward, breakaway.ringing_back) if estimate is not None]
    if rings:
        yield f"After slip begins it rings at {' and '.join(f'{value_of(e)} {e.name.split()[-1]}' for e in rings)}."
    apart = breakaway.ringing_difference
    if apart is not None and not apart.interval[0] <= 0 <= apart.interval[1]:
        yield f"The two directions ring apart by {value_of(apart)} (95 %: {interval_of(apart)})."


def _of_contact(stiffness: Estimate, damping: Estimate | None) -> str:
    told = f"While it holds the contact has a stiffness of {value_of(stiffness)} (95 %: {interval_of(stiffness)})"
    if not stands(stiffness.status):
        return f"{told}, which is not to be trusted ({stiffness.status})."
    return f"{told} and a damping of {value_of(damping)}." if damping is not None else f"{told}."


def _of_presliding(presliding: Presliding) -> Iterator[str]:
    if presliding.verdict == "gives way" and presliding.stiffness is not None:
        gap = presliding.backlash
        play = f", with {value_of(gap)} of play" if gap is not None and gap.interval[0] > 0 else ""
        gives = "gives" if stands(presliding.stiffness.status) else "seems to give"
        yield (
            f"Before it slips the contact {gives} way, with a stiffness of {value_of(presliding.stiffness)} "
            f"(95 %: {interval_of(presliding.stiffness)}){play}."
        )
    elif presliding.verdict == "rigid":
        yield f"Before it slips the contact is rigid as far as the record shows: {presliding.evidence}."
    else:
        yield f"Whether the contact gives way before it slips is not resolved: {presliding.evidence}."


def _of_pull(pull: Pull) -> Iterator[str]:
    if pull.regime == "stick-slip":
        yield (
            f"The slider sticks and slips at {value_of(pull.frequency)}: while it sticks the force rises by "
            f"{value_of(pull.loading_rate)} (95 %: {interval_of(pull.loading_rate)}), to "
            f"{value_of(pull.breakaway)}, and falls by {value_of(pull.drop)} in a slip."
        )
    else:
        yield (
            f"The slider does not stick: it swings about its steady sliding at {value_of(pull.frequency)}, as its own "
            f"inertia lets it (the force rises for {value_of(pull.rise_over_fall)} times as long as it falls)."
        )


def _together(comparison: Comparison) -> Iterator[str]:
    levels = [findings.level for findings in comparison.findings if findings.level is not None]
    if levels:
        least, most = min(levels, key=lambda e: e.value), max(levels, key=lambda e: e.value)
        yield (
            f"Over {len(comparison.findings)} records the sliding friction runs from {value_of(least)} to "
            f"{value_of(most)}."
        )
    if comparison.coefficient is not None:
        mu = comparison.coefficient
        yield f"Against the normal load the friction coefficient is {value_of(mu)} (95 %: {interval_of(mu)})."
        if mu.interval[1] - mu.interval[0] > TOO_WIDE * abs(mu.value):
            yield "The interval is wide because few records fix it; more loads would narrow it."


WANDERS = 1.5  # times its lowest frequency: a ridge that goes farther may be chance


def of_map(findings: TimeFrequency) -> Story:
    """A channel's map, and what its sticks tell."""
    record, faults = findings.record, findings.record.check()
    return Story.of_record(
        findings.name,
        record,
        headline=[*leading(faults), *_of_channel(findings)],
        cautions=doubts(findings.estimates),
        lines=list(map(Line.of, findings.estimates)),
        faults=[str(fault) for fault in faults],
        notes=findings.notes,
        settings={
            "channel": findings.channel,
            "wavelet frequency": f"{findings.wavelets.attrs['wavelet_frequency']:g}",
            "normalisation": str(findings.wavelets.attrs["normalisation"]),
            "sampling rate": f"{record.fs:g} Hz",
            "length": f"{len(record)} samples, {record.duration:g} s",
        },
        draw=lambda: plates_of_map(findings),
        data=findings.to_dict,
    )


def _of_channel(findings: TimeFrequency) -> Iterator[str]:
    """What a channel holds over time and frequency, in a few sentences."""
    if findings.mechanism is not None:
        probability = findings.mechanism.probability
        sure = f" (probability {probability:.2f})" if math.isfinite(probability) else ""
        yield sentence(f"{findings.mechanism.name}{sure}: {findings.mechanism.reason.rstrip('.')}.")
    if findings.transition is not None:
        ring = findings.transition
        yield (
            f"In the sticks the contact rings at {value_of(ring.frequency)} (95 %: {interval_of(ring.frequency)}) "
            f"with a damping ratio of {value_of(ring.damping)}; {ring.agreement}."
        )
        if ring.stiffness is not None:
            yield f"That takes a contact of {value_of(ring.stiffness)} (95 %: {interval_of(ring.stiffness)})."
    if findings.microslips is not None and findings.microslips.kind != UNTOLD:
        slips = findings.microslips
        yield f"{len(slips.events)} micro-slips are found in {len(slips.counts)} sticks: {slips.kind}."
    if findings.slip_ringing is not None:
        yield from _of_slip_ringing(findings.slip_ringing)
    if findings.ridges:
        ridge = findings.ridges[0]
        low, middle, high = (number(float(end(ridge.frequency)), 0.0, "Hz") for end in (np.min, np.median, np.max))
        span = middle if low == high else f"near {middle} ({low} to {high})"
        wanders = ridge.frequency.max() > WANDERS * ridge.frequency.min()
        beware = "; it wanders that far, as a sweep does, or chance in noise" if wanders else ""
        yield f"The strongest ridge of the map: {span}, from {ridge.time[0]:.4g} s to {ridge.time[-1]:.4g} s{beware}."
    if findings.spikes:
        groups = findings.spikes[-1].group + 1
        yield f"The signal jumps or kinks {len(findings.spikes)} times, in {groups} group{'s' * (groups > 1)}."


def _of_slip_ringing(ringing: SlipRinging) -> Iterator[str]:
    sides = [
        f"{value_of(frequency)} {frequency.name.split()[-1]} with a damping ratio of {value_of(damping)}"
        for frequency, damping in ((ringing.forward, ringing.damping_forward), (ringing.back, ringing.damping_back))
        if frequency is not None and damping is not None
    ]
    yield f"After slip begins the friction rings at {' and '.join(sides)}{'' if ringing.difference else ' alone'}."
    if ringing.difference is not None:
        verdict = ringing.verdict if ringing.verdict.startswith("no") else f"it is {ringing.verdict}"
        low_high = interval_of(ringing.difference)
        yield f"Between the directions {verdict}: forward less back {value_of(ringing.difference)} (95 %: {low_high})."
