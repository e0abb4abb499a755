"""What is told of a result, on the page and on the terminal alike: sentences first, then the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from stickslip.answers.comparison import Comparison
from stickslip.answers.decay_comparison import DecayComparison
from stickslip.answers.decays import DecayFindings
from stickslip.answers.findings import Findings, record_name
from stickslip.answers.frequencies import TimeFrequency
from stickslip.answers.squeak_comparison import SqueakComparison
from stickslip.answers.squeaks import SqueakFindings
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.record.channels import Channel
from stickslip.record.record import Record, Step
from stickslip.story import decay, squeak
from stickslip.story.words import cautions, doubts, headline, interval_of, leading, number, ringing_told, value_of

_CONSTANT_UNITS = {"mass": "kg", "stiffness": "N/m", "damping": "N s/m"}


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
    """

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


@dataclass(frozen=True)
class Summary:
    """A result in words.

    Attributes
    ----------
    title : str
        The record's name.
    headline, cautions : sequence of str
        What was found; what should keep the reader from trusting it.
    lines : sequence of Line
        The table.
    faults : sequence of str or None
        What the check-up found; None where there was none.
    notes : sequence of str
        What was assumed, and what could not be asked.
    settings : mapping of str to str
        Constants and choices.
    verdicts : sequence of (str, str)
        The motions that were tried, and what the record says of each.
    tables : sequence of Table
        What is told in rows of its own: bursts, pairs of channels, conditions.
    channels : sequence of Channel
        The record's channels.
    history : sequence of Step
        What was done to the record.
    """

    title: str
    headline: Sequence[str] = ()
    cautions: Sequence[str] = ()
    lines: Sequence[Line] = ()
    faults: Sequence[str] | None = None
    notes: Sequence[str] = ()
    settings: Mapping[str, str] | None = None
    verdicts: Sequence[tuple[str, str]] = ()
    tables: Sequence[Table] = ()
    channels: Sequence[Channel] = ()
    history: Sequence[Step] = ()

    @property
    def has_truth(self) -> bool:
        """Whether a true value is known for any row."""
        return any(line.true is not None for line in self.lines)

    @property
    def has_checks(self) -> bool:
        """Whether anything was checked for any row."""
        return any(line.checks for line in self.lines)


def summary(
    results: Findings
    | DecayFindings
    | Comparison
    | DecayComparison
    | TimeFrequency
    | SqueakFindings
    | SqueakComparison
    | Estimate
    | Sequence[Estimate],
    *,
    record: Record | None = None,
) -> Summary:
    """What is told of a result: sentences for a person, the table, cautions, settings, history.

    Parameters
    ----------
    results : Findings, DecayFindings, Comparison, DecayComparison, TimeFrequency, SqueakFindings, SqueakComparison, \
            Estimate or sequence of Estimate
        What was found.
    record : Record, optional
        Where plain estimates were found; Findings bring their own.

    Returns
    -------
    Summary

    Raises
    ------
    EstimateError
        `results` is empty or holds something else than estimates.

    Examples
    --------
    >>> friction = Estimate.normal("sliding friction", 1.318, sd=0.004, unit="N", method="median of 18 half cycles")
    >>> summary([friction]).lines[0].interval
    '1.310 to 1.326 N'
    """
    if isinstance(results, Comparison):
        return _of_comparison(results)
    if isinstance(results, DecayComparison):
        return _of_decays(results)
    if isinstance(results, Findings | DecayFindings):
        return _of_findings(results)
    if isinstance(results, TimeFrequency):
        return _of_time_frequency(results)
    if isinstance(results, SqueakFindings):
        return _of_squeaks(results)
    if isinstance(results, SqueakComparison):
        return _of_conditions(results)
    return _of_estimates([results] if isinstance(results, Estimate) else list(results), record)


def _of_findings(findings: Findings | DecayFindings) -> Summary:
    record = findings.record
    if isinstance(findings, DecayFindings):
        told, settings, notes = decay.headline(findings), decay.settings(findings), list(findings.notes)
        comparisons = [replace(each, status="for comparison") for each in findings.comparisons]
        estimates = (*findings.estimates, *comparisons)
    else:
        told, settings, notes = headline(findings), _settings(findings), list(findings.notes)
        estimates = findings.estimates
    return Summary(
        findings.name, [*leading(findings.faults), *told], cautions(findings),
        lines=[_line(estimate, findings.true_value(estimate)) for estimate in estimates],
        faults=[str(fault) for fault in findings.faults], notes=notes, settings=settings,
        verdicts=decay.verdicts(findings) if isinstance(findings, DecayFindings) else (),
        channels=list(record.channels.values()), history=record.history,
    )  # fmt: skip


def _of_time_frequency(found: TimeFrequency) -> Summary:
    record = found.record
    return Summary(
        found.name, [*leading(record.check()), *ringing_told(found)], doubts(found.estimates),
        lines=[_line(each) for each in found.estimates],
        faults=[str(fault) for fault in record.check()], notes=found.notes,
        settings={
            "channel": found.channel, "wavelet frequency": f"{found.wavelets.attrs['wavelet_frequency']:g}",
            "normalisation": str(found.wavelets.attrs["normalisation"]), "sampling rate": f"{record.fs:g} Hz",
            "length": f"{len(record)} samples, {record.duration:g} s",
        },
        channels=list(record.channels.values()), history=record.history,
    )  # fmt: skip


def _of_squeaks(found: SqueakFindings) -> Summary:
    record, bursts = found.record, found.squeaks.bursts
    tables = []
    if bursts:
        more = f", the first {squeak.MOST}" if len(bursts) > squeak.MOST else ""
        title = f"{len(bursts)} burst{'s' if len(bursts) > 1 else ''}{more}, levels re {found.squeaks.reference}"
        tables.append(Table(title, *squeak.burst_table(found)))
    if found.beside:
        tables.append(Table("In every channel that vibrates", *squeak.channel_table(found)))
    if found.quality is not None or found.impulses is not None:
        tables.append(Table("How it is heard", *squeak.hearing_table(found), squeak.hearing_note(found)))
    if found.coupling is not None:
        title = f"What moves together at {number(found.coupling.frequency, 0.5, 'Hz')}"
        tables.append(Table(title, *squeak.coupling_table(found.coupling), squeak.coupling_note(found.coupling)))
    low, high = found.squeaks.band
    return Summary(
        found.name, [*leading(found.faults), *squeak.headline(found)],
        [*squeak.cautions(found), *doubts(found.estimates)],
        lines=[_line(each) for each in found.estimates], faults=[str(fault) for fault in found.faults],
        notes=found.notes, tables=tables,
        settings={
            "heard in": found.squeaks.channel, "between": f"{low:g} and {high:g} Hz",
            **({} if found.normal is None else {"normal load": number(found.normal, 0.0, "N")}),
            "sampling rate": f"{record.fs:g} Hz", "length": f"{len(record)} samples, {record.duration:g} s",
        },
        channels=list(record.channels.values()), history=record.history,
    )  # fmt: skip


def _of_conditions(comparison: SqueakComparison) -> Summary:
    title = f"{len(comparison.conditions)} conditions compared"
    table = Table("Conditions", *squeak.condition_table(comparison))
    return Summary(title, list(comparison.verdicts), tables=[table], notes=comparison.notes)


def _of_comparison(comparison: Comparison) -> Summary:
    lines = [_line(estimate) for estimate in comparison.estimates]
    for findings in comparison.findings:
        if findings.level is not None:
            true = findings.true_value(findings.level)
            lines.append(_line(findings.level, true, name=f"{findings.level.name}, {findings.name}"))
    title = f"{len(comparison.findings)} records compared"
    return Summary(title, headline(comparison), lines=lines, notes=comparison.notes)


def _of_decays(comparison: DecayComparison) -> Summary:
    lines = [_line(estimate) for estimate in comparison.estimates]
    for findings in comparison.findings:
        own = (findings.best.damping_ratio, findings.best.dry_displacement, findings.best.frequency)
        lines += [_line(each, findings.true_value(each), name=f"{each.name}, {findings.name}") for each in own]
    title = f"{len(comparison.findings)} records together"
    return Summary(
        title, decay.headline(comparison), doubts(comparison.estimates), lines=lines, notes=comparison.notes
    )  # fmt: skip


def _of_estimates(estimates: list[Estimate], record: Record | None) -> Summary:
    strangers = [type(item).__name__ for item in estimates if not isinstance(item, Estimate)]
    if strangers or not estimates:
        raise EstimateError(
            f"a report of {', '.join(strangers) or 'nothing'}",
            "a report is made of Findings, a Comparison, or Estimates",
            "pass analyze(record), compare(findings) or a list of estimates",
        )
    lines = [_line(estimate) for estimate in estimates]
    if record is None:
        return Summary("Estimates", lines=lines)
    found = record.check()
    faults = [str(fault) for fault in found]
    channels = list(record.channels.values())
    return Summary(
        record_name(record), leading(found), lines=lines, faults=faults, channels=channels, history=record.history
    )


def _line(estimate: Estimate, true: float | None = None, *, name: str | None = None) -> Line:
    return Line(
        name or estimate.name, value_of(estimate), interval_of(estimate),
        None if true is None else value_of(estimate, true), estimate.method, estimate.status, estimate.checks,
    )  # fmt: skip


def _settings(findings: Findings) -> dict[str, str]:
    told = {
        key: number(value, 0.0, _CONSTANT_UNITS[key]) if key in _CONSTANT_UNITS else str(value)
        for key, value in findings.settings.items()
    }
    if findings.normal is not None:
        told["normal load"] = number(findings.normal, 0.0, "N")
    record = findings.record
    return {**told, "sampling rate": f"{record.fs:g} Hz", "length": f"{len(record)} samples, {record.duration:g} s"}
