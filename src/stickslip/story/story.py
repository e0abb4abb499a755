"""A result as it is told, sentences first: page, terminal and lab read nothing else; numbers and doubts in words."""

from __future__ import annotations

import functools
import importlib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from stickslip.errors import ModelError
from stickslip.estimate import FEW, UNKNOWN, Doubt, Estimate, decimals, doubts_of
from stickslip.figures.style import Plate, drawable
from stickslip.printing import html_table
from stickslip.record.check import Fault
from stickslip.units import NOTHING, prefixed

if TYPE_CHECKING:
    from stickslip.answers.findings import Findings
    from stickslip.estimate import Estimate
    from stickslip.record.channels import Channel
    from stickslip.record.record import Record, Step
    from stickslip.squeak.spectra import Clip
    from stickslip.story.scope import Scope

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
    others = [str(fault) for fault in faults if not _leads(fault)]
    if others:
        more = len(others) - 1
        those = f" ({more} more fault{'s' * (more > 1)} in the record)" if more else ""
        one = f"The check-up found 1 fault in the record: {others[0]}"
        yield Caution(f"{of}{others[0]}{those}" if more or of else one)


def leading(faults: Iterable[Fault], *, of: str = "") -> list[Caution]:
    """What the check-up found wrong that every number hangs on, so that it comes first.

    A unit that nobody stated is that of all records alike; else `of` says which of several it is.
    """
    return [Caution(f"{'' if fault.kind == 'unit' else of}{fault}") for fault in faults if _leads(fault)]


def _leads(fault: Fault) -> bool:
    """Whether it is of units, or of a displacement that is cut."""
    return fault.kind == "unit" or (fault.kind == "clipped" and fault.channel in ("x", "theta", "v"))


def sentence(text: str) -> str:
    """Beginning with a capital."""
    return text[:1].upper() + text[1:]


def listed(parts: Sequence[str]) -> str:
    """ "a, b and c"."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


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


# Of each kind of result the function that tells it, in a file of this room, which is imported when it is needed.
TELLERS = {
    "Findings": "findings.of_findings", "Comparison": "findings.of_comparison",
    "TimeFrequency": "friction.of_map",
    "LawComparison": "fit.of_laws", "LawFit": "fit.of_law", "CurveFit": "fit.of_curve",
    "Predictions": "fit.of_predictions", "Batch": "findings.of_batch",
    "Outcome": "simulation.of_outcome", "Trajectory": "simulation.of_run",
    "Record": "bench.of_record", "ExperimentPlan": "bench.of_plan",
    "Bifurcation": "maps.of_bifurcation", "Basins": "maps.of_basins", "Boundary": "maps.of_boundary",
    "Dither": "maps.of_dither", "Stability": "maps.of_stability",
    "ImpactTest": "findings.of_tap", "Dataset": "maps.of_map",
    "Commissioned": "bench.of_commissioned", "Tour": "bench.of_tour",
    "Estimate": "findings.of_one", "list": "findings.of_several", "tuple": "findings.of_several",
}  # fmt: skip


@dataclass(frozen=True)
class Line:
    """One row of the table of results, as text.

    Attributes
    ----------
    name, value, interval : str
        The quantity, its value and its 95 % interval.
    true : str or None
        The true value, where the record is simulated and knows it.
    method, status : str
        How it was found; "ok", or why not to trust it.
    checks : tuple of str
        What was checked.
    """

    name: str
    value: str
    interval: str
    true: str | None
    method: str
    status: str
    checks: tuple[str, ...]

    @classmethod
    def of(cls, estimate: Estimate, true: float | None = None, *, name: str = "") -> Line:
        """The row of an estimate, under another name where one is given."""
        shown = None if true is None else value_of(estimate, true)
        how = estimate.method, estimate.status, estimate.checks
        return cls(name or estimate.name, value_of(estimate), interval_of(estimate), shown, *how)


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes
    ----------
    title : str
        What it shows.
    headings : sequence of str
        Of its columns.
    rows : sequence of sequence of str
        Its cells.
    note : str
        How to read it.
    folded : bool
        Whether a page shows it when it is asked to, and a terminal says only that it is there.
    """

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    folded: bool = False


def tried(what: str, verdicts: Sequence[Sequence[str]]) -> Table:
    """What was tried, and what the records say of each."""
    return Table("What was tried", (f"{what} tried", "verdict"), verdicts)


def logged(record: Record) -> list[Table]:
    """What was written down beside a measurement; nothing where nothing was."""
    rows = record.log.rows() if record.log is not None else []
    return [Table("What was logged of the experiment?", ("entry", "written down"), rows, folded=True)] if rows else []


def _nothing_more(folder: Path) -> None:
    """Of most results page, numbers and figures are all."""


def _nothing_to_look_at() -> None:
    """Of maps and sounds the figures are all."""


LEADING = 8  # rows that are shown first
ABOVE = "!"  # the mark of a row whose caution the headline says already


@dataclass(frozen=True)
class Story:
    """A result as it is told.

    Attributes
    ----------
    title : str
        The record's name.
    headline, cautions : sequence of str
        What was found, the answer in the first sentence; what should keep the reader from trusting it. What must be
        read before the answer is a :class:`Caution` in the headline.
    lines : sequence of Line
        The table.
    faults : sequence of str or None
        What the check-up found; None where there was none.
    notes : sequence of str
        What was assumed, and what could not be asked.
    settings : mapping of str to str
        Constants and choices.
    tables : sequence of Table
        What is told in rows of its own: bursts, pairs of channels, motions that were tried.
    channels : sequence of Channel
        The record's channels.
    history : sequence of Step
        What was done to the record.
    parts : sequence of Story
        Of several records, each by itself.
    draw, listen, look : callable
        The figures, the sounds, and what the page draws itself; called when they are first looked at, as
        :attr:`plates`, :attr:`clips` and :attr:`scope`.
    data : callable
        What ``results.json`` holds.
    remedies : sequence of str
        The commands any one of which would mend what is wrong; none where nothing is, or no command would.
    write : callable
        Writes the files that this kind of result has beside page, numbers, figures and sounds into a folder.
    """

    title: str
    headline: Sequence[str] = ()
    cautions: Sequence[str] = ()
    lines: Sequence[Line] = ()
    faults: Sequence[str] | None = None
    notes: Sequence[str] = ()
    settings: Mapping[str, str] = field(default_factory=dict)
    tables: Sequence[Table] = ()
    channels: Sequence[Channel] = ()
    history: Sequence[Step] = ()
    parts: Sequence[Story] = ()
    draw: Callable[[], Iterable[Plate]] = tuple
    listen: Callable[[], Sequence[Clip]] = tuple
    look: Callable[[], Scope | None] = _nothing_to_look_at
    data: Callable[[], Mapping[str, Any]] = dict
    remedies: Sequence[str] = ()
    write: Callable[[Path], object] = _nothing_more

    @property
    def has_truth(self) -> bool:
        """Whether a true value is known for any row."""
        return any(line.true is not None for line in self.lines)

    @property
    def answer(self) -> str:
        """The sentence that answers; where nothing is told, none."""
        return next((sentence for sentence in self.headline if not isinstance(sentence, Caution)), "")

    @property
    def opening(self) -> list[str]:
        """What is read first, in this order: what every number hangs on, and the answer."""
        own = [sentence for sentence in self.headline if isinstance(sentence, Caution) or sentence == self.answer]
        return [sentence for sentence in own if sentence]

    @property
    def others(self) -> list[str]:
        """The sentences behind the answer."""
        return [sentence for sentence in self.headline if not isinstance(sentence, Caution)][1:]

    def explaining(self, rows: Sequence[Line]) -> list[str]:
        """Those of them that say why some of these rows are not sure."""
        reasons = [flag.reason.casefold() for flag in flags((line.name, line.status) for line in rows)]
        return [sentence for sentence in self.others if any(reason in sentence.casefold() for reason in reasons)]

    @functools.cached_property
    def notices(self) -> list[Caution]:
        """The cautions, each reason once: those of rows in the rows' order, which numbers them, then the others."""
        headline, order = " ".join(self.headline).casefold(), [line.name for line in self.lines]
        flagged = flags((line.name, line.status) for line in self.lines)
        rows = [flag for flag in flagged if flag.reason.casefold() not in headline]
        rows.sort(key=lambda flag: min(map(order.index, flag.names)))
        reasons, kinds = {row.reason for row in rows}, {row.kind for row in rows} - {""}
        plain = [caution if isinstance(caution, Caution) else Caution(caution) for caution in self.cautions]
        others = [remark for remark in plain if remark.reason not in reasons and remark.kind not in kinds]
        others = [remark for remark in others if remark.reason.casefold() not in headline]
        return [*rows, *(other for other in others if not other.names), *(other for other in others if other.names)]

    def marks(self, line: Line) -> str:
        """The numbers of the cautions that concern a row; none of one that is sure."""
        numbers = [str(place) for place, notice in enumerate(self.notices, start=1) if line.name in notice.names]
        return " ".join(numbers) or ("" if line.status == "ok" else ABOVE)

    def mark(self, caution: Caution) -> str:
        """The number of a caution that rows bear; none of one that concerns the record."""
        rows = {line.name for line in self.lines}
        return str(self.notices.index(caution) + 1) if rows.intersection(caution.names) else ""

    def how(self, line: Line) -> list[str]:
        """How a row was found and checked; what an earlier row says in the same words is told there."""
        texts = (line.method, *line.checks)
        before = reversed(self.lines[: self.lines.index(line)])
        first = {text: other.name for other in before for text in (other.method, *other.checks)}
        rows = dict.fromkeys(first[text] for text in texts if text in first)
        return [*(f"as {row}" for row in rows), *(text for text in texts if text not in first)]

    @property
    def leading(self) -> Sequence[Line]:
        """The rows that are shown first."""
        return self.lines[:LEADING]

    def concerned(self, rows: Sequence[Line]) -> list[Caution]:
        """The cautions of the record as a whole, and of these rows."""
        names = {line.name for line in rows}
        return [notice for notice in self.notices if not self.mark(notice) or not names.isdisjoint(notice.names)]

    @property
    def shown(self) -> list[Caution]:
        """The cautions that stand beside the leading rows."""
        return self.concerned(self.leading)

    @property
    def hidden(self) -> list[Caution]:
        """The cautions of further rows alone."""
        return [notice for notice in self.notices if notice not in self.shown]

    @functools.cached_property
    def plates(self) -> tuple[Plate, ...]:
        """The figures, in reading order."""
        return tuple(self.draw())

    @functools.cached_property
    def scope(self) -> Scope | None:
        """What the page draws itself."""
        return self.look()

    @functools.cached_property
    def clips(self) -> Sequence[Clip]:
        """The sounds."""
        return self.listen()

    def drawn(self, *, png: bool = False) -> Story:
        """With the figures that can be drawn, as PNG too where these are asked for, and of the others a note."""
        plates, lost = drawable(self.plates, png=png)
        return replace(self, notes=(*self.notes, *lost), draw=lambda: plates)

    def _repr_html_(self) -> str:
        rows = [(line.name, line.value, line.interval, self.marks(line)) for line in self.leading]
        notes = [f"{self.mark(caution)} {caution.reason}".strip() for caution in self.shown]
        title = " ".join(self.opening) or self.title
        return html_table(title, ("quantity", "value", "95 % interval", ""), rows, notes)

    @classmethod
    def of_record(cls, title: str, record: Record, **content: Any) -> Story:
        """What is told of something that was found in a record."""
        return cls(title, channels=list(record.channels.values()), history=record.history, **content)


def summary(result: Any, **context: Any) -> Story:
    """What is told of a result: sentences for a person, tables, cautions, settings, history; figures on demand.

    Parameters
    ----------
    result : Findings, Comparison, Estimate or any other result
        What :func:`analyze`, :func:`compare`, :func:`analyze_decay`, :func:`analyze_squeaks`, :func:`fit_law`,
        :func:`simulate` or another question returned; or a sequence of estimates.
    **context
        What the result does not hold itself: as ``record`` the one that plain estimates, a law or a curve was found
        in; of a law fitted to several all of them. As ``system`` what moved on a map that :func:`sweep` made. Of a run
        and of a record ``form`` names the format of the file that is written: csv, h5 or parquet.

    Returns
    -------
    Story

    Raises
    ------
    ModelError
        A result of a kind that is not told.
    EstimateError
        A sequence that is empty or holds something else than estimates.

    Examples
    --------
    >>> from stickslip import Estimate
    >>> friction = Estimate.normal("sliding friction", 1.318, sd=0.004, unit="N", method="median of 18 half cycles")
    >>> summary([friction]).lines[0].interval
    '1.310 to 1.326 N'
    """
    place = next((TELLERS[kind.__name__] for kind in type(result).__mro__ if kind.__name__ in TELLERS), None)
    if place is None:
        raise ModelError(
            f"a {type(result).__name__}",
            "summary, report and publish tell what analyze, compare, analyze_decay, compare_decays, "
            "time_frequency, analyze_squeaks, compare_squeaks, simulate, bifurcation, basins, boundary, dither, "
            "compare_laws, fit_law or fit_curve returned, and estimates",
            "give what one of these returned, or draw it with plot",
        )
    file, name = place.split(".")
    story: Story = getattr(importlib.import_module(f"stickslip.story.{file}"), name)(result, **context)
    return story
