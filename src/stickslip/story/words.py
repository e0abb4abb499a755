"""Numbers, faults and doubts in words that a person understands."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from stickslip.estimate import UNKNOWN, Estimate, decimals, doubts_of
from stickslip.record.check import Fault
from stickslip.units import NOTHING, prefixed

if TYPE_CHECKING:
    from stickslip.answers.findings import Findings

WITHIN_DIGIT = "within its last digit"  # an interval narrower than the digits shown
FIGURES = 5  # significant figures at most: what is surer than that still reads well


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


def cautions(findings: Findings, said: Iterable[Estimate] = ()) -> list[str]:
    """What should keep the reader from trusting a number, but what the headline has `said` of those without a value."""
    untold = {estimate.name for estimate in said if not estimate.known}
    told = [(estimate.name, estimate.status) for estimate in findings.estimates if estimate.name not in untold]
    flagged = _flags([*told, *findings.doubts])
    flagged += _of_few([estimate.status for estimate in findings.estimates])
    if findings.faults:
        many = len(findings.faults)
        flagged.append(f"The check-up found {many} fault{'s' * (many > 1)} in the record, listed below.")
    return flagged


def doubts(estimates: Sequence[Estimate]) -> list[str]:
    """The estimates that are flagged, with the reason, each reason once."""
    return [
        *_flags([(each.name, each.status) for each in estimates]),
        *_of_few([estimate.status for estimate in estimates]),
    ]


def _flags(told: Sequence[tuple[str, str]]) -> list[str]:
    """What speaks against answers, each reason once, with the names of those that it speaks against."""
    flagged: dict[str, list[str]] = {}
    for name, status in told:
        if status != "ok" and not _only_few(status):
            flagged.setdefault(status, []).append(name)
    return [sentence(f"{_few(names)}: {status}.") for status, names in flagged.items()]


def _only_few(status: str) -> bool:
    """Whether nothing is wrong but that the number rests on few cycles: that is said once for all numbers."""
    return any(doubt.count for doubt in doubts_of(status)) and len(doubts_of(status)) == 1


def _of_few(statuses: Sequence[str]) -> Iterator[str]:
    """One sentence for all intervals that few cycles leave crude."""
    few = [doubts_of(status)[0] for status in statuses if _only_few(status)]
    if few:
        counts, kinds = sorted({doubt.count for doubt in few}), dict.fromkeys(doubt.of for doubt in few)
        many = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
        plural = "" if counts[-1] == 1 else "s"
        those = "the interval of one number is" if len(few) == 1 else f"the intervals of {len(few)} numbers are"
        yield f"There are only {many} {' or '.join(kind + plural for kind in kinds)}: {those} crude."


def _few(names: list[str]) -> str:
    """Three names at most."""
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} and {len(names) - 1} more numbers"


def leading(faults: Iterable[Fault]) -> list[str]:
    """What the check-up found wrong with units: every number hangs on it, so that it comes first."""
    return [str(fault) for fault in faults if fault.kind == "unit"]


def sentence(words: str) -> str:
    """Beginning with a capital."""
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
