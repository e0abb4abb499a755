"""Answers tried on twins: their bias taken off, their intervals as the twins leave them, what is felt and what not."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from statistics import NormalDist
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import NEARLY
from stickslip.errors import EstimateError, StickslipError
from stickslip.estimate import FEW, NORMAL_95, UNSTATED, Doubt, Estimate, Status, doubts_of, kinds
from stickslip.record.record import Record
from stickslip.statistics import student
from stickslip.twin import descent
from stickslip.twin.belief import (
    EXCESS,
    GIVE,
    KINETIC,
    RATE,
    SLOPE,
    Belief,
    levelled,
)
from stickslip.twin.likeness import ASTRAY, LOST, Misfit, strays
from stickslip.twin.search import CHANCE, CLOSE
from stickslip.workers import Map

Answers = Mapping[str, Estimate]

LEVEL, FALL, RATIO, GIVES = (
    "sliding friction", "slope of friction against speed", "static over sliding friction", "presliding stiffness"
)  # fmt: skip
DIRECTIONS = ("sliding friction forward", "sliding friction back")
STATIC = ("static friction forward", "static friction back", RATIO)
SHARE, STOPS, FREQUENCY = "stuck share of the time", "stops per cycle", "forcing frequency"
OFFSET, ENERGY = "friction offset", "energy per cycle"
# What the displacement tells through the equation of motion; below, what is asked of the twins as of the record.
FITTED: dict[str, Callable[[Belief], float]] = {
    LEVEL: lambda rig: rig.kinetic,
    FALL: lambda rig: rig.mean_slope,
    STATIC[0]: lambda rig: rig.static,
    STATIC[1]: lambda rig: rig.static,
    RATIO: lambda rig: rig.ratio,
    GIVES: lambda rig: rig.contact,
}
COMPLIANCE = "compliance"
# What a part of friction is told by, what that is without it, and its value.
PARTS: dict[str, tuple[str, float, Callable[[Belief], float]]] = {
    LEVEL: (KINETIC, 0.0, lambda rig: rig.kinetic),
    FALL: (SLOPE, 0.0, lambda rig: rig.slope),  # beside a curve: any other change with speed
    RATIO: (EXCESS, 1.0, lambda rig: rig.ratio),
    COMPLIANCE: (GIVE, 0.0, lambda rig: 1 / rig.contact),
}
EITHER = (-math.inf, math.inf)
BOUNDS = {FALL: EITHER, OFFSET: EITHER, SHARE: (0.0, 1.0), RATIO: (1.0, math.inf)}  # of others: zero and more
ASKED = (*DIRECTIONS, OFFSET, ENERGY, SHARE, STOPS)
# What moves an answer where the zero of a sensor, and no friction, sets the directions apart: so many times the offset.
ZERO = {OFFSET: -1.0, STATIC[0]: 1.0, STATIC[1]: -1.0}  # of sliding, it is the level then
SIZES = tuple(1e-4 * 1.4**step for step in range(30))  # of friction, or of the motion: parts looked for, to two fifths
STICKS = ("stick", "microstick")  # kinds of event
JUMPED = 3.0  # times the noise of the others, by which a twin has moved another way
ANSWERED = 0.5  # of the twins, that must answer a question for the record's answer to be tried on them
BRIEF = (FALL, *STATIC, GIVES)
UNFELT, RIVALS = "not felt", "another law as likely"  # kinds of doubt


@dataclass(frozen=True)
class Power:
    """What a record would have shown of an effect.

    Attributes
    ----------
    shown : float
        The record's answer.
    null : float
        The mean answer of rigs without the effect.
    felt : float
        The least answer that fewer than one in a hundred of such rigs would have given.
    """

    shown: float
    null: float
    felt: float

    @property
    def claimed(self) -> bool:
        """Whether rigs without the effect would not have shown as much."""
        return self.shown > self.felt


@dataclass(frozen=True, eq=False)
class Trial:
    """What came of asking the twins.

    Attributes
    ----------
    count : int
        Twins that were asked.
    belief : Belief
        The rig that the record was believed to come from.
    estimates : mapping of str to Estimate
        The answers after the trial, by name.
    felt : mapping of str to Power or None
        What would have been felt: of the sliding friction [N], its slope against speed [N s/m], the static friction
        over it, the "compliance" of a contact that gives way [m/N], and the stuck share of the time; None where the
        record tells nothing.
    strays, repeats : float
        Root mean square by which x strays from its nearest rig, over that of twins from theirs; and of what of it
        is the same in every cycle, as slow noise is not.
    """

    count: int
    belief: Belief
    estimates: Answers
    felt: Mapping[str, Power | None]
    strays: float
    repeats: float

    @property
    def doubt(self) -> Doubt | None:
        """Why the record is not of the kind of its twins; None where it is."""
        return self._misfit.doubt

    @property
    def _misfit(self) -> Misfit:
        return Misfit.of(self.belief, self.strays, self.repeats)

    @property
    def unlike(self) -> bool:
        """Whether the record is not of the kind of its twins."""
        return self.doubt is not None and not self.doubt.lesser

    @property
    def slips(self) -> list[Belief]:
        """The nearest rig of each kind that has something off; none where that is slight, or does not explain x."""
        misfit = self._misfit
        return self.belief.slips if misfit.explained and misfit.unlike else []

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: how many, the law believed in, what would be felt, and how far x strays."""
        law = self.belief.law
        numbers = {name: float(value) for name, value in vars(law).items() if isinstance(value, (int, float))}
        return {
            "count": self.count,
            "law": {"name": type(law).__name__, **numbers},
            "felt": {name: None if power is None else vars(power) for name, power in self.felt.items()},
            "strays": self.strays,
            "repeats": self.repeats,
        }


def try_on_twins(
    belief: Belief,
    answers: Answers,
    ask: Callable[[Record], Answers],
    *,
    count: int = 40,
    rng: int = 0,
    progress: Callable[[float], None] = lambda share: None,
    mapped: Map = map,
) -> Trial:
    r"""What of these answers would rigs whose truth is known have given too?

    Each answer is held against those of `count` twins of the record: with :math:`e_i` an answer less its own twin's
    truth, a pivot, the record's answer becomes :math:`q - \bar e` and its 95 % interval
    :math:`\pm t\,s_e \sqrt{1 + 1/K}` about it. What the displacement tells through the equation of motion (sliding and
    static friction, their slope, a contact's stiffness) is the answer of the fit to it, tried in the same way; a part
    that is not believed in is bounded by what would have been felt of it. Where x strays from the nearest rig further
    than twins do from theirs, the record is not of their kind: intervals hold both the quick and the tried one, and the
    status says so.

    Parameters
    ----------
    belief : Belief
        From :func:`believe`.
    answers : mapping of str to Estimate
        The record's, by name.
    ask : callable
        The same answers of any record.
    count : int
        Twins, eight at least.
    rng : int
        Seed: the same one gives the same answers.
    progress : callable, optional
        Called with the share done.
    mapped : callable, optional
        As `map`, where the twins are asked by several processes; `ask` must be picklable then.

    Returns
    -------
    Trial

    Raises
    ------
    EstimateError
        Fewer than eight twins are asked for, or most twins can not be simulated.
    """
    if count < 8:
        raise EstimateError(f"{count} twins", "an interval needs eight at least", "ask for 40")
    frequency = answers[FREQUENCY].value if FREQUENCY in answers else math.nan
    twins, seeds = [], np.random.SeedSequence(rng).spawn(count)
    for number, twin in enumerate(mapped(partial(_ask_twin, belief, ask, frequency), seeds), start=1):
        twins += [twin] if twin is not None else []
        progress(number / count)
    if len(twins) < max(8, ANSWERED * count):
        raise EstimateError(
            f"{len(twins)} of {count} twins could be asked",
            "an answer is tried on most of its twins",
            "take the quick answers",
        )
    misfit = Misfit.of(belief, *strays(belief, np.array([twin.noise for twin in twins]), frequency))
    tried = {}
    others = {} if misfit.lost else _counted_offsets(belief, frequency)
    for name in ASKED:
        if name in answers and answers[name].known:
            pairs = [(twin.answers.get(name), twin.truth[name]) for twin in twins]
            # twins count the stops as the record does: how these vary between cycles is in no error of theirs
            both = name == STOPS or belief.falls or UNSTATED in kinds(answers[name].status)
            tried[name] = _widened(_tried(answers[name], pairs, misfit, both=both), others.get(name, []))
    if GIVE in belief.values:
        answers = {**answers, GIVES: Estimate(GIVES, belief.contact, (0.0, math.inf), math.inf, "N/m", "fit to x")}
    for name, value in FITTED.items():
        if name in answers and (name != GIVES or GIVE in belief.values):
            apart = [] if misfit.lost else _rival_offsets(belief, value)
            tried[name] = _widened(_fitted(answers[name], value, belief, twins, misfit), apart)
    offset = tried[OFFSET].value if OFFSET in tried else 0.0
    tried |= {name: _widened(tried[name], [times * offset]) for name, times in ZERO.items() if name in tried}
    if ENERGY in tried and frequency > 0:
        tried[ENERGY] = _widened(tried[ENERGY], [-_work_of_drift(belief, frequency), _work_of_drift(belief, frequency)])
    if misfit.doubt and not misfit.unlike:
        tried = {name: _widened(answer, _feigned_offsets(answer, belief, misfit)) for name, answer in tried.items()}
    if LEVEL in tried and tried[LEVEL].known:
        tried |= {name: _holding(tried[name], tried[LEVEL].interval) for name in DIRECTIONS if name in tried}
    bounded = {name: answer.within(*BOUNDS.get(name, (0.0, math.inf))) for name, answer in tried.items()}
    felt = {**_powers(belief), SHARE: _share_felt(bounded.get(SHARE))}
    if (share := felt[SHARE]) is not None and not share.claimed:
        bounded[SHARE] = _widened(bounded[SHARE], [-bounded[SHARE].value]).within(*BOUNDS[SHARE])
    return Trial(count, belief, bounded, felt, misfit.strays, misfit.repeats)


@dataclass(frozen=True, eq=False)
class _Twin:
    values: Mapping[str, float]  # of its rig
    x: Array  # less what noise of the drive's sensor makes of a motion that is followed by it
    noise: Array
    answers: Answers
    truth: Mapping[str, float]


def _ask_twin(
    belief: Belief, ask: Callable[[Record], Answers], frequency: float, seed: np.random.SeedSequence
) -> _Twin | None:
    """A twin, with its answers and its truth; None of one that can not be followed: it tells nothing."""
    chance = np.random.default_rng(seed)
    # the linear fit of a rig that is nowhere near draws others that can not be followed
    fit = belief.fit
    drawn = (
        belief if fit is None else descent.within_ends(belief, fit, fit.root @ chance.standard_normal(len(fit.names)))
    )
    for rig in (drawn, belief) if belief.left > LOST else (drawn,):
        try:
            record = rig.twin(chance)
            x = record["x"] - rig.strayed(chance)
            return _Twin(rig.values, x, x - rig.moved, ask(record), _truth(rig, record, frequency))
        except StickslipError:
            continue
    return None


def _truth(rig: Belief, record: Record, frequency: float) -> dict[str, float]:
    """What is true of a twin, by the name of the answer."""
    cycles = math.floor(record.duration * frequency + NEARLY) if frequency > 0 else 0
    # a twin of a record that begins in a stick is not quite at rest there, and comes to a stop that the record has not
    begin = 1 if cycles > 1 else 0
    stops = sum(kind in STICKS and begin <= time * frequency < cycles for time, kind in record.truth["events"])
    return {
        **dict.fromkeys(DIRECTIONS, rig.kinetic),
        OFFSET: 0.0,
        ENERGY: rig.work(cycles / frequency) / cycles if cycles else math.nan,
        SHARE: _share_stuck(record, cycles / frequency if cycles else record.duration),
        STOPS: stops / (cycles - begin) if cycles else math.nan,
    }


def _share_stuck(record: Record, until: float) -> float:
    """The part of the time that sticks, up to an instant [s]: the record's answer is of whole cycles."""
    events = record.truth["events"]
    if not events:
        return float(record.truth[SHARE])
    states = [(0.0, STICKS[0] if events[0][1] == "slip" else ""), *events, (until, "")]
    spans = ((begin, min(end, until)) for (begin, kind), (end, _) in pairwise(states) if kind in STICKS)
    return float(sum(max(end - begin, 0.0) for begin, end in spans) / until)


def _powers(belief: Belief) -> dict[str, Power | None]:
    """What x would have shown of each part, at one in a hundred: by how sure it is, or the least that is felt."""
    fit, kinetic = belief.fit, belief.values.get(KINETIC, 0.0)
    if fit is None:
        return {}
    from scipy.special import stdtrit  # half a second, where nothing else of an analysis loads it

    chance = float(stdtrit(fit.freedom, 1 - CHANCE))
    furthest = float(np.max(np.abs(belief.record["x"])))
    sought = {
        KINETIC: [size * belief.size(KINETIC) for size in SIZES],
        SLOPE: [size * belief.size(SLOPE) for size in SIZES],
        EXCESS: [size * kinetic for size in SIZES if kinetic > 0],
        GIVE: [math.log(kinetic / (size * furthest)) for size in SIZES if kinetic > 0],
    }
    powers: dict[str, Power | None] = {}
    for name, (part, null, value) in PARTS.items():
        if part in belief.values:
            felt = null + abs(value(belief) - value(belief.by((part,), np.array([-chance * fit.sd(part)]))))
        else:
            seen = belief.first_detectable(({part: size} for size in sought[part]), chance)
            felt = math.inf if seen is None else abs(value(belief.at(**seen)))
        powers[name] = Power(value(belief), null, felt) if math.isfinite(felt) else None
    return powers


def _share_felt(share: Estimate | None) -> Power | None:
    """The stuck share that would have been told from none, by how far twins' answers scatter."""
    if share is None or not math.isfinite(share.sd):
        return None
    return Power(share.value, 0.0, float(NormalDist().inv_cdf(1 - CHANCE)) * share.sd)


def _tried(quick: Estimate, pairs: list[tuple[Estimate | None, float]], misfit: Misfit, *, both: bool) -> Estimate:
    """The answer less its bias, with the interval that held on the twins; with `both` that of the quick one in it."""
    errors = np.array([e.value - true for e, true in pairs if e is not None and e.known and math.isfinite(true)])
    if len(errors) < max(8, ANSWERED * len(pairs)):
        words = f"{len(errors)} of {len(pairs)} twins could answer it, so that it is not tried on them"
        return replace(quick, status=Status(words, *([misfit.doubt] if misfit.doubt else []), quick.status))
    value, interval = _less_bias(quick.value, errors, misfit.strays)
    doubts = [doubt for doubt in doubts_of(quick.status) if doubt.kind != FEW]
    if misfit.doubt or both:  # the twins share what is not so, or was not stated
        interval = _hull(value, interval, quick)
    taken, bias = (f"{0.0 + part:+.3g} {quick.unit}".removesuffix(" 1") for part in (-errors.mean(), errors.mean()))
    checks = (*quick.checks, f"corrected by {taken}: its mean error on the twins is {bias}")  # 0.0 + -0.0 is no -0
    return _estimate(quick, value, interval, f"{quick.method}; tried on {len(errors)} twins", doubts, misfit, checks)


def _fitted(
    quick: Estimate, value: Callable[[Belief], float], belief: Belief, twins: list[_Twin], misfit: Misfit
) -> Estimate:
    """What the displacement tells through the equation of motion; a bound where the part is not believed in."""
    if misfit.unlike and not quick.known:  # of a contact of another kind the fit tells no more
        return quick
    if misfit.lost:  # and one that is nowhere near tells nothing
        return _estimate(quick, quick.value, quick.interval, quick.method, [quick.status], misfit)
    part = {LEVEL: KINETIC, FALL: SLOPE, GIVES: GIVE}.get(quick.name, EXCESS)
    reach = 0.0
    if part not in belief.values:
        if misfit.unlike:  # of a contact of another kind nothing is bounded
            return _estimate(quick, quick.value, quick.interval, quick.method, [quick.status], misfit)
        reach = _detectable(belief, part, value)
    if not math.isfinite(value(belief) + reach):
        unfelt = Doubt("the motion does not depend on it, so that the record tells nothing of it", UNFELT)
        return replace(quick.unknown(Status(unfelt)), method=f"fit to x, {len(twins)} twins")
    # one that misses a stop for the noise of its drive is no more followed by a linear fit: one of 12 was, 20 times off
    noises = [float(np.std(twin.noise)) for twin in twins]
    near = [twin for twin, noise in zip(twins, noises, strict=True) if noise <= JUMPED * np.median(noises)]
    errors = np.array([value(_refitted(belief, twin.x)) - value(belief.at(**twin.values)) for twin in near])
    least, (low, high) = _less_bias(value(belief), errors, misfit.strays)
    interval = (low - reach if part == SLOPE else low, high + reach)
    if quick.known and (misfit.unlike or belief.falls):  # a line, where a real one is a curve
        interval = _hull(least, interval, quick)
    return _estimate(quick, least, interval, f"fit to x, {len(twins)} twins", [], misfit)


def _refitted(belief: Belief, x: Array) -> Belief:
    """The rig that a twin would have been believed to be by its displacement, by the same linear fit."""
    fit = belief.fit
    return belief if fit is None else descent.within_ends(belief, fit, fit.gain @ levelled(x - belief.moved))


def _detectable(belief: Belief, part: str, value: Callable[[Belief], float]) -> float:
    """By how much a part that is not believed in may move an answer; infinite where the motion does not show it."""
    if belief.fit is None:
        return math.inf
    larger = ({part: size * belief.size(part)} for size in SIZES)
    felt = belief.first_detectable(larger, student(belief.fit.freedom))
    return math.inf if felt is None else value(belief.at(**felt)) - value(belief)


def _rival_offsets(belief: Belief, value: Callable[[Belief], float]) -> list[float]:
    """By how much other laws that the record leaves possible would answer more: the ends of what x leaves each of them.

    They lie where it leaves as much more of x than the nearest law as chance would once in twenty.
    """
    left, ends = {rig: descent.misfit(rig) for rig in (belief, *belief.rivals)}, list[float]()
    # one with a constant off by what nobody stated is nearer by that alone, and makes no other law less likely
    nearest = min(misfit for rig, misfit in left.items() if rig.slipped == belief.slipped)
    low, high = descent.linear_ends(belief, value, NORMAL_95)
    for rig in belief.rivals:
        further = rig.fit.freedom * math.log(left[rig] / nearest) if rig.fit is not None else math.inf
        if further > CLOSE:  # near the law that is believed in, which is not the nearest
            continue
        least, most = descent.linear_ends(rig, value, math.sqrt(min(max(0.0, NORMAL_95**2 - further), NORMAL_95**2)))
        more = value(rig) - value(belief)
        ends += [min(more, least - low), max(more, most - high)]
    return ends


def _counted_offsets(belief: Belief, frequency: float) -> dict[str, list[float]]:
    """The same of what is counted in a simulated motion."""
    rigid = [not {GIVE, RATE} & rig.values.keys() for rig in belief.rivals]
    true, *others = (_truth(r, r.twin(np.random.default_rng(0)), frequency) for r in (belief, *belief.rivals))
    # a contact that gives way holds at each reversal, which is no stop of one that does not
    alike = [other for other, stops in zip(others, rigid, strict=True) if stops or {GIVE, RATE} & belief.values.keys()]
    names = [name for name in ASKED if math.isfinite(true[name])]  # without a cycle there is none of its stops and work
    return {name: [one[name] - true[name] for one in (alike if name in (SHARE, STOPS) else others)] for name in names}


def _work_of_drift(belief: Belief, frequency: float) -> float:
    """What the drift of x's sensor, which twins have not, may add to the work of a cycle that does not close [J]."""
    x, moved = belief.record["x"], belief.moved
    line = x - moved - belief.residual
    return belief.stated.stiffness * float(np.ptp(line)) / (belief.record.duration * frequency) * float(np.ptp(x)) / 2


def _feigned_offsets(answer: Estimate, belief: Belief, misfit: Misfit) -> list[float]:
    """By how much twice a force that passes for friction would move an answer either way; none of what is counted.

    And twice the share by which a gain or a constant is off: x tells their ratios alone, and the others, and with them
    the scale of all forces, may be off by as much.
    """
    by_unit = {"N": misfit.feigned, "N s/m": misfit.feigned / belief.sliding_speed}
    force = by_unit.get(answer.unit, misfit.feigned / belief.kinetic * abs(answer.value))
    more = 2 * math.hypot(force, misfit.share * answer.value)
    return [] if answer.name in (SHARE, STOPS) else [-more, more]


def _holding(answer: Estimate, interval: tuple[float, float]) -> Estimate:
    """The answer with an interval that holds another one."""
    return _widened(answer, [here - own for here, own in zip(interval, answer.interval, strict=True)])


def _widened(answer: Estimate, apart: list[float]) -> Estimate:
    """The answer with an interval that holds what other laws would answer, too."""
    if not answer.known or not apart:
        return answer
    if not np.isfinite(apart).all():
        return replace(
            answer, status=Status(*doubts_of(answer.status), Doubt("laws without it explain x as well", RIVALS))
        )
    low, high = answer.interval
    interval = (low + min(0.0, *apart), high + max(0.0, *apart))
    return replace(answer, interval=interval, sd=(interval[1] - interval[0]) / (2 * NORMAL_95))


def _less_bias(value: float, errors: Array, strays: float) -> tuple[float, tuple[float, float]]:
    """A value and its 95 % interval by its errors on twins."""
    # what the law leaves unexplained moves an answer as much as noise does: as in Birge's ratio
    half = student(len(errors) - 1) * float(errors.std(ddof=1)) * math.sqrt(1 + 1 / len(errors)) * max(1.0, strays)
    value -= float(errors.mean())
    return value, (value - half, value + half)


def _hull(value: float, interval: tuple[float, float], quick: Estimate) -> tuple[float, float]:
    """An interval that holds the quick one too."""
    return min(interval[0], quick.interval[0], quick.value), max(interval[1], quick.interval[1], quick.value)


def _estimate(
    quick: Estimate,
    value: float,
    interval: tuple[float, float],
    method: str,
    doubts: Sequence[Doubt | str],
    misfit: Misfit,
    checks: tuple[str, ...] = (),
) -> Estimate:
    """The answer as tried, with a doubt where the record is not of its twins' kind."""
    doubts = [*doubts, misfit.doubt] if misfit.doubt else doubts
    if misfit.doubt and misfit.doubt.lesser and quick.name in BRIEF:
        doubts = [*doubts, Doubt("as small a force may pass for it", ASTRAY)]
    sd = (interval[1] - interval[0]) / (2 * NORMAL_95)
    return Estimate(quick.name, value, interval, sd, quick.unit, method, Status(*doubts), checks or quick.checks)
