"""A result as it is told, sentences first: page, terminal and lab read nothing else."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.errors import ModelError
from stickslip.figures.style import Plate, drawable
from stickslip.printing import html_table
from stickslip.story.words import Caution, flags, interval_of, value_of

if TYPE_CHECKING:
    from stickslip.estimate import Estimate
    from stickslip.record.channels import Channel
    from stickslip.record.record import Record, Step
    from stickslip.squeak.spectra import Clip
    from stickslip.story.scope import Scope

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
        return cls(
            name or estimate.name,
            value_of(estimate),
            interval_of(estimate),
            None if true is None else value_of(estimate, true),
            estimate.method,
            estimate.status,
            estimate.checks,
        )


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
    remedy : str
        The command that would mend what is wrong; empty where nothing is, or no command would.
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
    remedy: str = ""
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
        return [
            sentence
            for sentence in self.headline
            if sentence and (isinstance(sentence, Caution) or sentence == self.answer)
        ]

    @property
    def others(self) -> list[str]:
        """The sentences behind the answer."""
        return [sentence for sentence in self.headline if not isinstance(sentence, Caution)][1:]

    @functools.cached_property
    def notices(self) -> list[Caution]:
        """The cautions, each reason once: those of rows in the rows' order, which numbers them, then the others."""
        headline, order = " ".join(self.headline).casefold(), [line.name for line in self.lines]
        flagged = flags((line.name, line.status) for line in self.lines)
        rows = [flag for flag in flagged if flag.reason.casefold() not in headline]
        rows.sort(key=lambda flag: min(map(order.index, flag.names)))
        reasons, kinds = {row.reason for row in rows}, {row.kind for row in rows} - {""}
        plain = [caution if isinstance(caution, Caution) else Caution(caution) for caution in self.cautions]
        others = [
            remark
            for remark in plain
            if remark.reason not in reasons and remark.kind not in kinds and remark.reason.casefold() not in headline
        ]
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
        first = {
            text: other.name
            for other in reversed(self.lines[: self.lines.index(line)])
            for text in (other.method, *other.checks)
        }
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
