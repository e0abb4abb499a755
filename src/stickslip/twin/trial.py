"""Answers tried on twins: their bias taken off, their intervals as the twins leave them, what is felt and what not."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError, StickslipError
from stickslip.estimate import FEW, NORMAL_95, UNSTATED, Doubt, Estimate, Status, doubts_of, kinds
from stickslip.record.record import Record
from stickslip.statistics import student
from stickslip.twin.belief import Belief

Array = NDArray[np.float64]
Answers = Mapping[str, Estimate]

LEVELS = ("sliding friction", "sliding friction forward", "sliding friction back")
STATIC = ("static friction forward", "static friction back", "static over sliding friction")
SLOPE, SHARE, STOPS, RATIO = (
    "slope of friction against speed", "stuck share of the time", "stops per cycle", "static over sliding friction"
)  # fmt: skip
GIVES = "presliding stiffness"
TRIED = (*LEVELS, *STATIC, SLOPE, SHARE, STOPS)
NULL = 0.01  # of the null twins, that may show as much as is claimed
ANSWERED = 0.5  # of the twins, that must answer a question for the record's answer to be tried on them
UNLIKE = 1.5  # times what noise and the twins' spread explain, by which x may stray from its twin before that is said
ASTRAY = "unlike its twins"  # the kind of doubt


@dataclass(frozen=True)
class Power:
    """What a record would have shown of an effect.

    Attributes
    ----------
    shown : float
        The record's answer.
    null : float
        The mean answer of twins without the effect.
    felt : float
        The least answer that fewer than one in a hundred of such twins would have given.
    """

    shown: float
    null: float
    felt: float

    @property
    def claimed(self) -> bool:
        """Whether twins without the effect would not have shown as much."""
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
    static : Power or None
        Static above sliding friction: what is felt of it; None where the question had no answer.
    yields : Power or None
        How far the contact gives way before it slips, as a compliance [m/N]: what is felt of it.
    strays : float
        Root mean square by which x strays from the quiet twin, over what noise and the twins' spread explain.
    """

    count: int
    belief: Belief
    estimates: Answers
    static: Power | None
    yields: Power | None
    strays: float

    @property
    def unlike(self) -> bool:
        """Whether the record is not of the kind of its twins."""
        return self.strays > UNLIKE

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: how many, the law believed in, what is felt, and how far x strays."""
        law = self.belief.law
        felt = {"static over sliding friction": self.static, "compliance": self.yields}
        return {
            "count": self.count,
            "law": {"kinetic": law.kinetic, "slope": law.slope},
            "felt": {name: None if power is None else vars(power) for name, power in felt.items()},
            "strays": self.strays,
        }


def try_on_twins(
    belief: Belief,
    answers: Answers,
    ask: Callable[[Record], Answers],
    *,
    count: int = 40,
    rng: int = 0,
    progress: Callable[[float], None] = lambda share: None,
) -> Trial:
    r"""What of these answers would rigs whose truth is known have given too?

    Each answer is held against those of `count` twins of the record: with :math:`e_i` an answer less its own twin's
    truth, a pivot, the record's answer becomes :math:`q - \bar e` and its 95 % interval
    :math:`\pm t\,s_e \sqrt{1 + 1/K}` about it. That static friction is above the sliding one is claimed only where
    fewer than one in a hundred of twins without it would have shown as much, by the same distribution; the twins then
    have it too. Where x strays from the quiet twin by several times what noise and the twins' spread explain, the
    record is not of their kind: intervals hold both the quick and the tried one, and the status says so.

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
    twins = _asked(belief, ask, count, rng, lambda share: progress(share / 2))
    static = _power(answers.get(RATIO), [twin.answers.get(RATIO) for twin in twins])
    yields = None
    if GIVES in answers and answers[GIVES].known:  # the twins are rigid: what they show of it is not there
        shown_by = [1 / twin.answers[GIVES].value if GIVES in twin.answers else 0.0 for twin in twins]
        yields = _beyond(1 / answers[GIVES].value, np.array(shown_by))
    unstated = RATIO in answers and UNSTATED in kinds(answers[RATIO].status)  # twins share what was not stated
    if static is not None and static.claimed:
        belief = belief.bearing(1 + static.shown - static.null)
        twins = _asked(belief, ask, count, rng, lambda share: progress((1 + share) / 2))
    progress(1.0)
    strays = _strays(belief, [twin.record for twin in twins])
    tried = {}
    falls = belief.law.slope < 0  # as a line, where a real one is a curve
    for name in TRIED:
        if name in answers and answers[name].known:
            pairs = [(twin.answers.get(name), twin.truth[name]) for twin in twins]
            tried[name] = _tried(answers[name], pairs, strays, both=falls or UNSTATED in kinds(answers[name].status))
    if static is not None and (unstated or not static.claimed):
        tried |= {name: _not_felt(answers[name], static, count) for name in STATIC if name in answers}
    return Trial(count, belief, tried, static, yields, strays)


@dataclass(frozen=True, eq=False)
class _Twin:
    record: Record
    answers: Answers
    truth: Mapping[str, float]


def _asked(
    belief: Belief, ask: Callable[[Record], Answers], count: int, rng: int, progress: Callable[[float], None]
) -> list[_Twin]:
    """The twins' records, answers and truths."""
    twins: list[_Twin] = []
    refusal: StickslipError | None = None
    for number, seed in enumerate(np.random.SeedSequence(rng).spawn(count)):
        chance = np.random.default_rng(seed)
        drawn = belief.drawn(chance)
        try:
            record = drawn.twin(chance)
            twins.append(_Twin(record, ask(record), _truth(drawn, record)))
        except StickslipError as error:  # a twin that can not be followed tells nothing; most of them must be
            refusal = error
        progress((number + 1) / count)
    if len(twins) < max(8, ANSWERED * count):
        raise EstimateError(
            f"{len(twins)} of {count} twins could be asked" + (f" ({refusal.value})" if refusal else ""),
            "an answer is tried on most of its twins",
            "take the quick answers",
        )
    return twins


def _truth(belief: Belief, record: Record) -> dict[str, float]:
    """What is true of a twin, by the name of the answer."""
    law = belief.law
    static = law.breakaway
    frequency = record.truth.get("forcing frequency", 0.0)
    cycles = math.floor(record.duration * frequency)
    stops = sum(kind == "stick" and time * frequency < cycles for time, kind in record.truth["events"])
    return {
        # a slope that rises is a damper's and no dry friction; one that falls is the friction's own
        **dict.fromkeys(LEVELS, law.kinetic + min(0.0, law.slope) * belief.sliding_speed),
        **dict.fromkeys(STATIC, static),
        RATIO: static / law.kinetic if law.kinetic else math.nan,
        SLOPE: law.slope,
        SHARE: float(record.truth[SHARE]),
        STOPS: stops / cycles if cycles else math.nan,
    }


def _power(shown: Estimate | None, null: list[Estimate | None]) -> Power | None:
    """Whether twins without an effect show as much of it."""
    values = np.array([each.value for each in null if each is not None and each.known])
    if shown is None or not shown.known or len(values) < max(8, ANSWERED * len(null)):
        return None
    return _beyond(shown.value, values)


def _beyond(shown: float, null: Array) -> Power:
    """An answer beside those of twins without the effect, of which one in a hundred would lie beyond what is felt."""
    from scipy.special import stdtrit  # half a second, where nothing else of an analysis loads it

    reach = float(stdtrit(len(null) - 1, 1 - NULL)) * float(null.std(ddof=1)) * math.sqrt(1 + 1 / len(null))
    return Power(shown, float(null.mean()), float(null.mean()) + reach)


def _tried(quick: Estimate, pairs: list[tuple[Estimate | None, float]], strays: float, *, both: bool) -> Estimate:
    """The answer less its bias, with the interval that held on the twins; with `both` that of the quick one in it."""
    errors = np.array([e.value - true for e, true in pairs if e is not None and e.known and math.isfinite(true)])
    if len(errors) < max(8, ANSWERED * len(pairs)):
        words = f"{len(errors)} of {len(pairs)} twins could answer it, so that it is not tried on them"
        return replace(quick, status=Status(words, quick.status))
    bias = float(errors.mean())
    # what the law leaves unexplained moves an answer as much as noise does: as in Birge's ratio
    half = student(len(errors) - 1) * float(errors.std(ddof=1)) * math.sqrt(1 + 1 / len(errors)) * max(1.0, strays)
    value = quick.value - bias
    interval, doubts = (value - half, value + half), [d for d in doubts_of(quick.status) if d.kind != FEW]
    if strays > UNLIKE or both:  # the twins share what is not so, or was not stated
        low, high = quick.interval
        interval = (min(low, interval[0], quick.value), max(high, interval[1], quick.value))
    if strays > UNLIKE:
        words = (
            f"x strays {strays:.2g} times as far from its twins as noise explains: the contact is no rigid one with "
            "dry and viscous friction, or a constant is not as stated"
        )
        doubts.append(Doubt(words, ASTRAY))
    tried = Estimate(
        quick.name, value, interval, (interval[1] - interval[0]) / (2 * NORMAL_95), quick.unit,
        f"{quick.method}; tried on {len(errors)} twins", Status(*doubts),
        (*quick.checks, f"a bias of {bias:.3g} {quick.unit} is taken off"),
    )  # fmt: skip
    return tried if quick.name == SLOPE else tried.within(0.0, 1.0 if quick.name == SHARE else math.inf)


def _not_felt(quick: Estimate, power: Power, count: int) -> Estimate:
    """A static friction that twins without any show too."""
    words = (
        f"twins without any static friction above the sliding one show {power.null:.3g} times as well, and "
        f"{power.felt:.3g} times would be needed"
    )
    if power.claimed:  # on sensors that the twins have as they were found, and that may be otherwise
        words = quick.status
    return replace(quick.unknown(Status(Doubt(words, "not felt"))), method=f"{quick.method}; tried on {count} twins")


def _strays(belief: Belief, twins: list[Record]) -> float:
    """How far x strays from the quiet twin, over what noise and the twins' spread explain."""
    measured, quiet = belief.record["x"], belief.moved()
    apart = measured - quiet
    spread = np.array([twin["x"] - quiet for twin in twins])
    explained = float(np.mean((spread - spread.mean(axis=1, keepdims=True)) ** 2))
    return math.sqrt(float(np.var(apart)) / explained) if explained > 0 else math.inf
