"""Conditions side by side: friction, its slope against speed, and whether it squeaks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.answers.findings import Comparison, Findings, require_several
from stickslip.answers.squeaks import trend_of
from stickslip.estimate import Estimate


@dataclass(frozen=True)
class Condition:
    """One condition of a squeak test: what drove it, how it rubbed, and what was heard.

    Attributes
    ----------
    name : str
        What it is called.
    normal : float or None
        Normal load [N].
    forcing : float
        Frequency of the forced motion [Hz]; NaN where none is recorded.
    stroke : float
        Half of what the displacement spans [m, or rad]; NaN where none is recorded.
    level : Estimate or None
        Sliding friction.
    slope : Estimate or None
        Change of the sliding friction with speed; below zero where it falls.
    coefficient, slope_of_coefficient : Estimate or None
        Both over the normal load, where it is known.
    answer : str
        Whether it "squeaks", "squeals", "creaks" or "does not squeak", or that this "can not be told", as
        :attr:`Squeaks.answer`.
    kind : str
        What most of the sounding time is, as :attr:`Squeaks.kind`.
    count : int
        Squeaks and squeals.
    rate : float
        How many there are in a second [1/s].
    pulses : float
        Stick-slip pulses in a second of its longest creak [1/s]; NaN where nothing creaks.
    frequency : Estimate or None
        Mean frequency of the squeaks and squeals [Hz].
    sound : float
        Level of the loudest of them [dB re `reference`]; NaN where there is none, or it is clipped.
    reference : str
        What levels are relative to.
    """

    name: str
    normal: float | None
    forcing: float
    stroke: float
    level: Estimate | None
    slope: Estimate | None
    coefficient: Estimate | None
    slope_of_coefficient: Estimate | None
    answer: str
    kind: str
    count: int
    rate: float
    pulses: float
    frequency: Estimate | None
    sound: float
    reference: str

    @property
    def squeaks(self) -> bool:
        """Whether it squeaks or squeals."""
        return self.count > 0

    @property
    def trend(self) -> str:
        """Whether friction "falls" or "rises" with speed; "flat or not told" where the slope's interval holds zero."""
        return trend_of(self.slope)


def compare_squeaks(findings: Sequence[Findings]) -> Comparison:
    """In which conditions does it squeak, and is it the slope of friction against speed, or the load, that decides?

    Each record is a condition: wet or dry, light or heavy, as in the thesis's figures 7.3 and 7.6. Of each are told the
    excitation, the friction and its slope against speed with their intervals, and the squeaks. What the conditions say
    together holds for these records: which squeak; whether friction that falls with speed, found in a condition that is
    not heard to squeak, is too little for one; and whether one squeaks in which it rises.

    Parameters
    ----------
    findings : sequence of Findings
        What :func:`analyze_squeaks` returned of two records or more, each named by its condition.

    Returns
    -------
    Comparison
        Its results are ``conditions``, a :class:`~stickslip.answers.Condition` for each record, ``verdicts``, what they
        say together in sentences, and ``squeaking``, the names of those that squeak.

    Raises
    ------
    EstimateError
        Fewer than two records.

    Examples
    --------
    >>> import stickslip as ss
    >>> found = []
    >>> for load in (1.23, 6.13):
    ...     run = ss.simulate(ss.squeak.squeak_rig("wet", load), duration=0.8)
    ...     record = ss.squeak.squeak_record(run, snr=30, rng=1)
    ...     found.append(ss.analyze_squeaks(record, name=f"wet, {load} N", normal=load))
    >>> compared = compare_squeaks(found)
    >>> compared.squeaking, compared.conditions[0].trend
    (('wet, 6.13 N',), 'falls')
    """
    require_several(findings)
    conditions = tuple(_condition(each) for each in findings)
    squeaking = tuple(each.name for each in conditions if each.squeaks)
    results = {"conditions": conditions, "verdicts": tuple(_verdicts(conditions)), "squeaking": squeaking}
    return Comparison(tuple(findings), results=results)


def _condition(found: Findings) -> Condition:
    squeaks, loops, record = found.squeaks, found.loops, found.record
    heard = squeaks.of("squeak", "squeal")
    levels = [burst.level for burst in heard if np.isfinite(burst.level)]
    path = next((each for each in ("x", "theta") if each in record), None)
    return Condition(
        name=found.name, normal=found.normal, forcing=squeaks.forcing,
        stroke=float(np.nanmax(record[path]) - np.nanmin(record[path])) / 2 if path else float("nan"),
        level=None if loops is None else loops.level, slope=None if loops is None else loops.slope,
        coefficient=found.coefficient, slope_of_coefficient=found.slope_of_coefficient,
        answer=squeaks.answer, kind=squeaks.kind, count=len(heard), rate=len(heard) / record.duration,
        pulses=max(squeaks.of("creak"), key=lambda burst: burst.duration).rate if squeaks.of("creak") else float("nan"),
        frequency=squeaks.frequency, sound=max(levels, default=float("nan")), reference=squeaks.reference,
    )  # fmt: skip


def _verdicts(conditions: Sequence[Condition]) -> list[str]:
    """Which squeak, and what their slopes say of that."""
    loud = [each for each in conditions if each.squeaks]
    quiet, untold = _answering(conditions, "does not squeak"), _answering(conditions, "can not be told")
    creaking = _answering(conditions, "creaks")
    if not loud and not untold:
        return ["No condition squeaks.", *(f"{words}." for words in _say(creaking, "creaks", "creak"))]
    heard = [
        *_say(_answering(conditions, "squeaks"), "squeaks", "squeak"),
        *_say(_answering(conditions, "squeals"), "squeals", "squeal"),
        *_say(creaking, "creaks", "creak"),
        *_say(quiet, "does not squeak", "do not squeak"),
    ]
    told = [f"{'; '.join(heard)}."] if heard else []
    told += [f"Whether {words} can not be told." for words in _say(untold, "squeaks", "squeak")]
    falling = [each for each in quiet if each.trend == "falls"]
    if loud and falling:
        too = " too" if all(each.trend == "falls" for each in loud) else ""
        told.append(
            f"Friction falls with speed in {_names(falling)}{too}, and nothing squeaks there: a falling friction "
            "alone is not enough."
        )
    rising = [each for each in loud if each.trend == "rises"]
    return told + [f"{words} though friction rises with speed." for words in _say(rising, "squeaks", "squeak")]


def _answering(conditions: Sequence[Condition], answer: str) -> list[Condition]:
    return [each for each in conditions if each.answer == answer]


def _say(conditions: Sequence[Condition], one: str, several: str) -> list[str]:
    """The conditions with a verb; nothing where there are none."""
    return [f"{_names(conditions)} {several if len(conditions) > 1 else one}"] if conditions else []


def _names(conditions: Sequence[Condition]) -> str:
    names = [each.name for each in conditions]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
