"""A fitted law or curve, or several laws compared, told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, TypeAlias

from stickslip.answers.findings import record_name
from stickslip.estimate import doubts_of
from stickslip.figures.law import law_plates
from stickslip.law.fit_curve import CurveFit
from stickslip.law.law import LawFit
from stickslip.law.which_law import LawComparison
from stickslip.parameters import unit
from stickslip.record.record import Record
from stickslip.story.law_files import write_law
from stickslip.story.scope import Scope, of_fit
from stickslip.story.story import Line, Story, Table
from stickslip.story.words import Caution, doubts, leading, number

Fit: TypeAlias = LawComparison | LawFit | CurveFit
Records: TypeAlias = Record | Sequence[Record]  # what it was fitted to

LOUD = 0.3  # of the friction, that a curve leaves for noise


def of_curve(found: CurveFit, *, record: Records = ()) -> Story:
    """A curve of friction."""
    return _story(found, record, list(_curve_told(found)), data=partial(_curve_numbers, found))


def of_law(found: LawFit, *, record: Records = ()) -> Story:
    """One law."""
    return _story(found, record, list(_law_told(found)), notes=list(found.checks), data=found.to_dict)


def of_laws(found: LawComparison, *, record: Records = ()) -> Story:
    """Several laws compared."""
    laws = sorted(found.candidates, key=lambda each: each.standing.misfit)
    rows = [
        (each.name, _ratio(each.standing.misfit), "yes" if each.standing.kept else "no", _values(each.oscillator.law))
        for each in laws
    ]
    verdicts = [(each.name, each.standing.verdict) for each in laws]
    note = "Misfit: mean square left over, in channels and records together, over the least that any law leaves."
    ranked = Table("Laws by misfit", ("law", "misfit", "possible", "parameters"), rows, note)
    why = Table("Why each law is possible or not", ("law", "verdict"), verdicts, folded=True)
    return _story(
        found, record, [found.verdict], notes=[*found.checks, *found.fit.checks], tables=[ranked, why],
        history=found.history, data=found.to_dict,
    )  # fmt: skip


def _story(found: Fit, record: Records, headline: list[str], **told: Any) -> Story:
    """What all fits tell of their parameters and of the records that they were made to."""
    records = [record] if isinstance(record, Record) else list(record)
    units = list(dict.fromkeys(words for each in records for words in leading(each.check())))
    cautions = [*map(Caution, (doubt.words for doubt in doubts_of(found.status))), *doubts(found.estimates)]
    if records:
        first = records[0]
        told = {"channels": list(first.channels.values()), "history": first.history, **told}
        told["settings"] = {
            "records": str(len(records)), "sampling rate": f"{first.fs:g} Hz",
            "length": ", ".join(f"{each.duration:g} s" for each in records),
        }  # fmt: skip
    title = record_name(records[0]) if len(records) == 1 else f"{len(records)} records" if records else "Fit"
    return Story(
        title, [*units, *headline], cautions, lines=list(map(Line.of, found.estimates)),
        draw=lambda: law_plates(found), look=lambda: _scope(found, records),
        write=partial(write_law, result=found, records=records), **told,
    )  # fmt: skip


def _scope(found: Fit, records: Sequence[Record]) -> Scope | None:
    """The first record's first channel with what the law's sensor would have read."""
    fit = found.fit if isinstance(found, LawComparison) else found
    if not records or isinstance(fit, CurveFit) or not fit.traces:
        return None
    traces = fit.traces[0]
    name = next(iter(traces.measured))
    return of_fit(records[0], name, traces.time[name], traces.fitted[name], ["fit"], type(fit.law).__name__)


def _ratio(misfit: float) -> str:
    return f"{misfit:.2f}" if misfit < 10 else f"{misfit:.0f}"


def _curve_told(found: CurveFit) -> Iterator[str]:
    follows = "the friction follows" if found.follows else "the friction does not follow"
    if found.follows and found.unexplained > LOUD:
        follows = f"as far as its noise lets it be seen, {follows}"
    yield f'{follows[0].upper()}{follows[1:]} the curve "{found.curve}": {found.formula}.'
    left = f"{found.unexplained:.1%} of the friction, {number(found.residual, found.residual / 100, found.unit)}"
    what = "It leaves" if found.follows else "The best of that kind leaves"
    yield f"{what} {left} root mean square; {found.model_error:.1%} is no noise."


def _law_told(found: LawFit) -> Iterator[str]:
    how = "fitted to" if found.parameters else "as it was given, predicts"
    surface = " on a rough surface" if found.surface == "rough" else ""
    yield f"The law {type(found.law).__name__}{surface}, {how} {', '.join(found.misfit)}: {_values(found.law)}."
    yield f"It leaves {', '.join(f'{times:.3g} times the noise of {name}' for name, times in found.misfit.items())}."


def _values(law: object) -> str:
    told = {key: value for key, value in vars(law).items() if isinstance(value, float)}
    return ", ".join(f"{key} {number(value, abs(value) / 1000, unit(law, key))}" for key, value in told.items())


def _curve_numbers(found: CurveFit) -> dict[str, object]:
    """Plain data for JSON: SI numbers, None where a number does not exist."""
    return {
        "curve": found.curve, "formula": found.formula, "residual": found.residual,
        "unexplained": found.unexplained, "model_error": found.model_error, "follows": found.follows,
        "unit": found.unit, "status": found.status,
        "estimates": [each.to_dict() for each in found.estimates],
    }  # fmt: skip
