"""Numbers, faults and doubts in words that a person understands."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from stickslip.estimate import FEW, UNKNOWN, Doubt, Estimate, decimals, doubts_of
from stickslip.record.check import Fault
from stickslip.units import NOTHING, prefixed

if TYPE_CHECKING:
    from stickslip.answers.findings import Findings

WITHIN_DIGIT = "within its last digit"  # an interval narrower than the digits shown
FIGURES = 5  # significant figures at most: what is surer than that still reads well
SHARE_FIGURES = 3  # of a share, or of what it lacks of the whole: no scatter of cycles says so well when a stick begins


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


def constant(value: float, sd: float, unit: str) -> str:
    """A constant as it was stated, with its standard uncertainty where it has one.

    Examples
    --------
    >>> constant(2.42, 0.0, "kg"), constant(2.42, 0.02, "kg")
    ('2.42 kg', '2.42 kg, standard uncertainty 0.02 kg')
    """
    return number(value, sd, unit) + (f", standard uncertainty {number(sd, sd, unit)}" if sd else "")


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


class Caution(str):
    """A caution in words; behind them stand the rows that it speaks against, and the reason alone.

    Attributes
    ----------
    reason : str
        The words without the rows.
    names : tuple of str
        The quantities that it speaks against; none of one that concerns the whole record.
    kind : str
        The kind of doubt, where there is one.

    Examples
    --------
    >>> caution = Caution("the base moves", ["stops per cycle"])
    >>> caution, caution.reason, caution.names
    ('Stops per cycle: the base moves.', 'the base moves', ('stops per cycle',))
    """

    reason: str
    names: tuple[str, ...]
    kind: str

    def __new__(cls, reason: str, names: Iterable[str] = (), kind: str = "") -> Self:
        """A reason, of these rows; of a doubt of this kind."""
        names = tuple(dict.fromkeys(names))
        few = ", ".join(names) if len(names) <= 3 else f"{names[0]} and {len(names) - 1} more quantities"
        caution = super().__new__(cls, sentence(f"{few}: {reason.rstrip('.')}.") if names else reason)
        caution.reason, caution.names, caution.kind = reason, names, kind
        return caution

    def __reduce__(self) -> tuple[Any, ...]:
        return Caution, (self.reason, self.names, self.kind)


def cautions(findings: Findings, headed: Iterable[Estimate] = ()) -> list[Caution]:
    """What should keep the reader from trusting a number, but what `headed` the page of those without a value."""
    untold = {estimate.name for estimate in headed if not estimate.known}
    statuses = [(estimate.name, estimate.status) for estimate in findings.quoted if estimate.name not in untold]
    return [*flags([*statuses, *findings.doubts]), *faulty(findings.faults)]


def doubts(estimates: Iterable[Estimate]) -> list[Caution]:
    """The estimates that are flagged, with the reason, each reason once.

    Parameters
    ----------
    estimates : iterable of Estimate
        Those that a reader sees.

    Returns
    -------
    list of Caution

    Examples
    --------
    >>> late = [Estimate.normal(n, 1.0, sd=0.1, unit="s", method="", status="x is late") for n in ("one", "other")]
    >>> doubts(late)
    ['One, other: x is late.']
    """
    return flags((estimate.name, estimate.status) for estimate in estimates)


def flags(statuses: Iterable[tuple[str, str]]) -> list[Caution]:
    """What speaks against answers, each reason once, with the names of those concerned; few cycles last."""
    flagged: dict[str, list[str]] = {}
    few: dict[Doubt, list[str]] = {}
    for name, status in statuses:
        for doubt in doubts_of(status):
            if doubt.count:
                few.setdefault(doubt, []).append(name)
            else:
                flagged.setdefault(doubt.words, []).append(name)
    return [*(Caution(reason, names) for reason, names in flagged.items()), *_of_few(few)]


def _of_few(few: Mapping[Doubt, Sequence[str]]) -> Iterator[Caution]:
    """One sentence for all intervals that few cycles leave crude."""
    if few:
        counts, kinds = sorted({doubt.count for doubt in few}), dict.fromkeys(doubt.of for doubt in few)
        names = list(dict.fromkeys(name for those in few.values() for name in those))
        many = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
        plural = "" if counts[-1] == 1 else "s"
        reason = f"only {many} {' or '.join(kind + plural for kind in kinds)}: the interval is crude"
        yield Caution(reason, names, FEW)


def faulty(faults: Sequence[Fault], *, of: str = "") -> Iterator[Caution]:
    """What the check-up found beside what leads: the first, and how many more; `of` which record of several."""
    others = [str(fault) for fault in faults if fault.kind != "unit"]
    if others:
        more = len(others) - 1
        those = f" ({more} more fault{'s' * (more > 1)} in the record)" if more else ""
        yield Caution(
            f"{of}{others[0]}{those}" if more or of else f"The check-up found 1 fault in the record: {others[0]}"
        )


def leading(faults: Iterable[Fault]) -> list[Caution]:
    """What the check-up found wrong with units: every number hangs on it, so that it comes first."""
    return [Caution(str(fault)) for fault in faults if fault.kind == "unit"]


def sentence(text: str) -> str:
    """Beginning with a capital."""
    return text[:1].upper() + text[1:]


def _rounded(value: float, digits: int) -> str:
    """With so many decimals; a zero without sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _digits(sd: float, value: float, figures: int = FIGURES) -> int:
    if max(abs(value), sd) < NOTHING:
        return 0
    if sd == 0:  # a constant that was given, a count that never varied
        return max(0, len(f"{value:.4g}".partition(".")[2]))
    most = figures - 1 - math.floor(math.log10(abs(value))) if value and math.isfinite(value) else figures
    return max(0, min(decimals(sd, value), most))


def _scale(estimate: Estimate) -> tuple[float, str, int]:
    """Factor, unit and decimals in which an estimate reads well."""
    share = "share" in estimate.name and estimate.unit == "1"
    factor, text = (100.0, "%") if share else prefixed(np.array([estimate.value, *estimate.interval]), estimate.unit)
    value, spread = factor * estimate.value, factor * estimate.spread
    digits = _digits(spread, min(value, 100.0 - value), SHARE_FIGURES) if share else _digits(spread, value)
    return factor, "" if text == "1" else f" {text}", digits
