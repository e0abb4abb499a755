"""Findings in sentences that a person understands."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from stickslip.answers.comparison import Comparison
from stickslip.answers.decays import DecayFindings
from stickslip.answers.findings import Findings
from stickslip.answers.frequencies import TimeFrequency
from stickslip.answers.preparation import LEFT_OUT
from stickslip.balance.pull import Pull
from stickslip.contact.mechanisms import UNTOLD
from stickslip.cycle.before_slip import Presliding
from stickslip.cycle.onset import Breakaway
from stickslip.cycle.slips import SlipRinging
from stickslip.estimate import UNKNOWN, Estimate, decimals
from stickslip.record.check import Fault
from stickslip.units import NOTHING, prefixed

WITHIN_DIGIT = "within its last digit"  # an interval narrower than the digits shown
NEVER = "The contact never sticks."
RARELY = 0.005  # of the time
WANDERS = 1.5  # times its lowest frequency: a ridge that goes farther may be chance
SAME = 0.05  # forward and back differ noticeably beyond this part of the level
ALIKE = 0.02  # a static friction that differs from the sliding one by less is about as large
FIGURES = 5  # significant figures at most: what is surer than that still reads well
FEW = r"only (\d+) (\w+): the interval is crude"  # of a number that rests on few of anything
ONLY_FEW = rf": {FEW}\.$"
TOO_WIDE = 0.5  # an interval wider than this part of the value deserves a word


def number(value: float, sd: float, unit: str) -> str:
    """A value with the digits that its uncertainty leaves, in a readable unit.

    Examples
    --------
    >>> number(0.012345, 0.0002, "m")
    '12.3 mm'
    """
    if not math.isfinite(value):
        return UNKNOWN
    factor, text = prefixed(value, unit)
    digits = _digits(factor * sd, factor * value)
    return f"{factor * value:.{digits}f}{'' if text == '1' else ' ' + text}"


def value_of(estimate: Estimate, value: float | None = None) -> str:
    """The estimate's value; or another one (the true one) with the same unit and digits."""
    value = estimate.value if value is None else value
    if not math.isfinite(value):
        return UNKNOWN
    factor, text, digits = _scale(estimate)
    return f"{_rounded(factor * value, digits)}{text}"


def interval_of(estimate: Estimate) -> str:
    """The estimate's 95 % interval, in the unit of its value."""
    low, high = estimate.interval
    if low == high:
        return "no scatter"
    factor, text, digits = _scale(estimate)
    # An end cut to fewer digits than another row gives the same value would exclude it.
    inside = "whichever" in estimate.name and -math.inf < low < estimate.value < high < math.inf
    while (
        inside
        and digits < 7
        and not round(factor * low, digits) <= factor * estimate.value <= round(factor * high, digits)
    ):
        digits += 1

    def written(end: float) -> str:
        return _rounded(factor * end, digits)

    if math.isfinite(high - low) and written(low) == written(high):
        return WITHIN_DIGIT
    between = estimate.between(written)
    return between if between == UNKNOWN else f"{between}{text}"


def headline(result: Findings | Comparison) -> list[str]:
    """What was found, in a few sentences."""
    return list(_of_comparison(result) if isinstance(result, Comparison) else _of_findings(result))


def cautions(findings: Findings | DecayFindings) -> list[str]:
    """What should keep the reader from trusting a number."""
    flagged = _flags(findings.estimates)
    flagged += [_sentence(words) for words in getattr(findings, "doubts", ()) if not re.search(ONLY_FEW, words)]
    flagged += _of_few([estimate.status for estimate in findings.estimates])
    if findings.faults:
        many = len(findings.faults)
        flagged.append(f"The check-up found {many} fault{'s' * (many > 1)} in the record, listed below.")
    return flagged


def doubts(estimates: Sequence[Estimate]) -> list[str]:
    """The estimates that are flagged, with the reason, each reason once."""
    return [*_flags(estimates), *_of_few([estimate.status for estimate in estimates])]


def _flags(estimates: Sequence[Estimate]) -> list[str]:
    flagged: dict[str, list[str]] = {}
    for estimate in estimates:
        if estimate.status != "ok" and not re.fullmatch(FEW, estimate.status):
            flagged.setdefault(estimate.status, []).append(estimate.name)
    return [_sentence(f"{_few(names)}: {status}.") for status, names in flagged.items()]


def _of_few(statuses: Sequence[str]) -> Iterator[str]:
    """One sentence for all intervals that few cycles leave crude."""
    found = [match for status in statuses if (match := re.fullmatch(FEW, status))]
    if found:
        counts, kinds = sorted({int(each[1]) for each in found}), dict.fromkeys(each[2].rstrip("s") for each in found)
        many = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
        plural = "" if counts[-1] == 1 else "s"
        those = "the interval of one number is" if len(found) == 1 else f"the intervals of {len(found)} numbers are"
        yield f"There are only {many} {' or '.join(kind + plural for kind in kinds)}: {those} crude."


def _few(names: list[str]) -> str:
    """Three names at most."""
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} and {len(names) - 1} more numbers"


def ringing_told(found: TimeFrequency) -> Iterator[str]:
    """What a channel holds over time and frequency, in a few sentences."""
    if found.mechanism is not None:
        sure = f" (probability {found.mechanism.probability:.2f})" if math.isfinite(found.mechanism.probability) else ""
        yield _sentence(f"{found.mechanism.name}{sure}: {found.mechanism.reason.rstrip('.')}.")
    if found.transition is not None:
        ring = found.transition
        yield (
            f"In the sticks the contact rings at {value_of(ring.frequency)} (95 % sure: {interval_of(ring.frequency)}) "
            f"with a damping ratio of {value_of(ring.damping)}; {ring.agreement}."
        )
        if ring.stiffness is not None:
            yield f"That takes a contact of {value_of(ring.stiffness)} (95 % sure: {interval_of(ring.stiffness)})."
    if found.microslips is not None and found.microslips.kind != UNTOLD:
        slips = found.microslips
        yield f"{len(slips.events)} micro-slips are found in {len(slips.counts)} sticks: {slips.kind}."
    if found.slip_ringing is not None:
        yield from _of_slip_ringing(found.slip_ringing)
    if found.ridges:
        ridge = found.ridges[0]
        low, middle, high = (number(float(end(ridge.frequency)), 0.0, "Hz") for end in (np.min, np.median, np.max))
        span = middle if low == high else f"near {middle} ({low} to {high})"
        wanders = ridge.frequency.max() > WANDERS * ridge.frequency.min()
        beware = "; it wanders that far, as a sweep does, or chance in noise" if wanders else ""
        yield f"The strongest ridge of the map: {span}, from {ridge.time[0]:.4g} s to {ridge.time[-1]:.4g} s{beware}."
    if found.spikes:
        groups = found.spikes[-1].group + 1
        yield f"The signal jumps or kinks {len(found.spikes)} times, in {groups} group{'s' * (groups > 1)}."


def leading(faults: Iterable[Fault]) -> list[str]:
    """What the check-up found wrong with units: every number hangs on it, so that it comes first."""
    return [str(fault) for fault in faults if fault.kind == "unit"]


def _of_findings(findings: Findings) -> Iterator[str]:
    if findings.contradiction:
        yield (
            f"The channels contradict each other: perhaps {findings.contradiction}. Until that is mended no force is "
            "told here; the table has what they give as they are."
        )
        if findings.sticks is not None:
            yield from _of_sticks(findings)
        return
    if findings.loops is not None:
        yield from _of_loops(findings)
    found = findings.regression
    if found is not None and found.viscous is not None and found.coulomb is not None:
        share = f"; {100 * found.residual:.1f} % of it is left unexplained" if math.isfinite(found.residual) else ""
        yield (
            f"An inertia of {value_of(found.inertia)}, viscous friction of {value_of(found.viscous)} and dry friction "
            f"of {value_of(found.coulomb)} explain the measured force{share}."
        )
    apart = findings.asymmetric
    if apart is not None and findings.loops is None:
        yield from _of_directions(apart.coulomb_forward, apart.coulomb_back)
        yield from _of_directions(apart.viscous_forward, apart.viscous_back, "in viscous friction")
    if findings.sticks is not None:
        yield from _of_sticks(findings)
    if findings.breakaway is not None:
        yield from _of_breakaway(findings.breakaway)
    if findings.stiffness is not None:
        yield _of_contact(findings.stiffness, findings.contact_damping)
    if findings.cause is not None:
        yield _sentence(f"{findings.cause.cause}: {findings.cause.reason.rstrip('.')}.")
    if findings.presliding is not None:
        yield from _of_presliding(findings.presliding)
    if findings.pull is not None:
        yield from _of_pull(findings.pull)


def _of_directions(forward: Estimate | None, back: Estimate | None, what: str = "") -> Iterator[str]:
    if forward is None or back is None:
        return
    apart = abs(forward.value - back.value)
    if apart > SAME * abs(forward.value + back.value) / 2 and apart > 2 * forward.sd + 2 * back.sd:
        alike = "" if what else "; a zero offset of a sensor or a sloping rig looks the same"
        yield (
            f"The two directions differ{what and ' ' + what}: {value_of(forward)} forward and {value_of(back)} "
            f"back{alike}."
        )


def _of_loops(findings: Findings) -> Iterator[str]:
    loops = findings.loops
    assert loops is not None
    if not loops.level.known:
        yield f"How large the friction is can not be told: {loops.level.status}."
        return
    if loops.level.interval[0] == 0:
        highest = value_of(loops.level, loops.level.interval[1])
        yield f"No sliding friction can be told from none: it is {highest} at most (95 % sure)."
    else:
        yield f"The contact slides against {value_of(loops.level)} of friction (95 % sure: {interval_of(loops.level)})."
    lesser = re.fullmatch(FEW, loops.level.status) or loops.level.status.endswith(LEFT_OUT)  # said among the cautions
    if loops.level.status != "ok" and not lesser:
        yield f"That is not to be trusted: {loops.level.status}."
    if findings.coefficient is not None and findings.normal is not None:
        yield (
            f"Under a normal load of {number(findings.normal, 0.0, 'N')} that is a friction coefficient of "
            f"{value_of(findings.coefficient)}."
        )
    yield from _of_directions(loops.forward, loops.back)
    low, high = loops.slope.interval
    if loops.slope.status != "ok":
        return
    if low > 0 or high < 0:
        yield f"Friction {'rises' if low > 0 else 'falls'} with speed, by {value_of(loops.slope)}."
    elif math.isfinite(low + high):
        yield "No change of friction with speed can be told from zero."


def _of_sticks(findings: Findings) -> Iterator[str]:
    sticks = findings.sticks
    assert sticks is not None
    if not any(event.kind == "stick" for event in sticks.events):
        brief = sticks.share.value >= RARELY
        share = value_of(sticks.share)
        yield f"The contact rests only briefly as it turns round, {share} of the time in all." if brief else NEVER
        return
    if sticks.share.value < RARELY:
        yield "The contact hardly ever sticks."
        return
    beat = f" of {value_of(findings.loops.frequency)}" if findings.loops is not None else ""
    often = sticks.per_cycle.value
    stops = f", with {often:.2g} stops in each cycle{beat}" if math.isfinite(often) and often > 0 else ""
    low, high = sticks.share.interval
    share = interval_of(sticks.share) if high - low > 0.01 else value_of(sticks.share)
    yield f"It sticks {share} of the time{stops}."


def _of_breakaway(found: Breakaway) -> Iterator[str]:
    ratio = found.ratio
    low, high = ratio.interval
    if not math.isfinite(low + high):
        yield f"What it bears just before it slips can not be told: {ratio.status}."
        return
    more = "more than" if low > 1 + ALIKE else "less than" if high < 1 - ALIKE else "about as much as"
    sides = " and ".join(f"{value_of(each)} {each.name.split()[-1]}" for each in (found.forward, found.back) if each)
    yield (
        f"Just before it slips it bears {sides}: {more} while it slides ({value_of(ratio)} times, 95 % sure: "
        f"{interval_of(ratio)})."
    )
    rings = [each for each in (found.ringing_forward, found.ringing_back) if each is not None]
    if rings:
        yield f"After slip begins it rings at {' and '.join(f'{value_of(e)} {e.name.split()[-1]}' for e in rings)}."
    apart = found.ringing_difference
    if apart is not None and not apart.interval[0] <= 0 <= apart.interval[1]:
        yield f"The two directions ring apart by {value_of(apart)} (95 % sure: {interval_of(apart)})."


def _of_slip_ringing(found: SlipRinging) -> Iterator[str]:
    sides = [
        f"{value_of(frequency)} {frequency.name.split()[-1]} with a damping ratio of {value_of(damping)}"
        for frequency, damping in ((found.forward, found.damping_forward), (found.back, found.damping_back))
        if frequency is not None and damping is not None
    ]
    yield f"After slip begins the friction rings at {' and '.join(sides)}{'' if found.difference else ' alone'}."
    if found.difference is not None:
        told = found.verdict if found.verdict.startswith("no") else f"it is {found.verdict}"
        low_high = interval_of(found.difference)
        yield f"Between the directions {told}: forward less back {value_of(found.difference)} (95 % sure: {low_high})."


def _of_contact(stiffness: Estimate, damping: Estimate | None) -> str:
    damped = f" and a damping of {value_of(damping)}" if damping is not None else ""
    return (
        f"While it holds the contact has a stiffness of {value_of(stiffness)} (95 % sure: {interval_of(stiffness)})"
        f"{damped}."
    )


def _of_presliding(found: Presliding) -> Iterator[str]:
    if found.verdict == "gives way" and found.stiffness is not None:
        gap = found.backlash
        play = f", with {value_of(gap)} of play" if gap is not None and gap.interval[0] > 0 else ""
        yield (
            f"Before it slips the contact gives way, with a stiffness of {value_of(found.stiffness)} "
            f"(95 % sure: {interval_of(found.stiffness)}){play}."
        )
    elif found.verdict == "rigid":
        yield f"Before it slips the contact is rigid as far as the record can tell: {found.evidence}."
    else:
        yield f"Whether the contact gives way before it slips can not be told: {found.evidence}."


def _of_pull(found: Pull) -> Iterator[str]:
    if found.regime == "stick-slip":
        yield (
            f"The slider sticks and slips at {value_of(found.frequency)}: while it sticks the force rises by "
            f"{value_of(found.loading_rate)} (95 % sure: {interval_of(found.loading_rate)}), to "
            f"{value_of(found.breakaway)}, and falls by {value_of(found.drop)} in a slip."
        )
    else:
        yield (
            f"The slider does not stick: it swings about its steady sliding at {value_of(found.frequency)}, as its own "
            f"inertia lets it (the force rises for {value_of(found.rise_over_fall)} times as long as it falls)."
        )


def _of_comparison(comparison: Comparison) -> Iterator[str]:
    levels = [findings.level for findings in comparison.findings if findings.level is not None]
    if levels:
        least, most = min(levels, key=lambda e: e.value), max(levels, key=lambda e: e.value)
        yield (
            f"Over {len(comparison.findings)} records the sliding friction runs from {value_of(least)} to "
            f"{value_of(most)}."
        )
    if comparison.coefficient is not None:
        mu = comparison.coefficient
        yield f"Against the normal load the friction coefficient is {value_of(mu)} (95 % sure: {interval_of(mu)})."
        if mu.interval[1] - mu.interval[0] > TOO_WIDE * abs(mu.value):
            yield "The interval is wide because few records fix it; more loads would narrow it."


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:]


def _rounded(value: float, digits: int) -> str:
    """With so many decimals; a zero without sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _digits(sd: float, value: float) -> int:
    if max(abs(value), sd) < NOTHING:
        return 0
    if sd == 0:  # a constant that was given, a count that never varied
        return max(0, len(f"{value:.4g}".partition(".")[2]))
    most = FIGURES - 1 - math.floor(math.log10(abs(value))) if value and math.isfinite(value) else FIGURES
    return max(0, min(decimals(sd, value), most))


def _scale(estimate: Estimate) -> tuple[float, str, int]:
    """Factor, unit and decimals in which an estimate reads well."""
    share = "share" in estimate.name and estimate.unit == "1"
    factor, text = (100.0, "%") if share else prefixed(np.array([estimate.value, *estimate.interval]), estimate.unit)
    digits = _digits(factor * estimate.spread, factor * estimate.value)
    return factor, "" if text == "1" else f" {text}", digits
