"""Records as a law that was fitted elsewhere predicts them, told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from stickslip.answers.fits import Prediction, Predictions
from stickslip.estimate import UNKNOWN
from stickslip.figures.law import law_plates
from stickslip.story.scope import Panel, Scope, command_of
from stickslip.story.story import Story, Table
from stickslip.story.words import doubts, interval_of, leading, number, value_of

DEFINITION = (
    "Follows: 100 (1 - |y - yhat| / |y - mean y|) %, the fit of system identification: 100 % is the record itself, 0 % "
    "no better than its mean. Nothing was fitted to it but how the motion begins and each sensor's zero."
)
COMPARED = "Coulomb: the same of one level of friction and a viscous damper, both fitted to the record itself."


def of_predictions(found: Predictions) -> Story:
    """One record by itself; several in a table, a row each, with a section of the page for each."""
    parts = [_of_one(part, _law(found)) for part in found.parts]
    if len(parts) == 1:
        return _noted(parts[0], found)
    headline = (
        f"{_law(found)}, as it was given, follows at least {_listed(found.least)} in each of {len(parts)} records."
    )
    first = next(iter(found.least))
    rows = [
        (part.name, *(_percent(part.follows.get(name)) for name in found.least), _percent(part.plain.get(first)),
         *_stops(part)) for part in found.parts
    ]  # fmt: skip
    headings = ("record", *found.least, f"{first}, Coulomb", "stops per cycle", "predicted")
    table = Table("How much is followed", headings, rows, f"{DEFINITION} {COMPARED}")
    return _noted(Story(f"{len(parts)} records predicted", [headline], tables=[table], parts=parts), found)


def _noted(story: Story, found: Predictions) -> Story:
    return replace(story, notes=[*story.notes, *found.notes], data=found.to_dict)


def _of_one(part: Prediction, law: str) -> Story:
    record, fit = part.record, part.fit
    rows = [
        (name, _percent(value), _percent(part.plain.get(name)), _left(part, name), f"{fit.misfit[name]:.3g}")
        for name, value in part.follows.items()
    ]
    headings = ("channel", "follows", "Coulomb", "left (rms)", "over its noise")
    note = f"{DEFINITION} {COMPARED}" if part.plain else DEFINITION
    tables = [Table("How much is followed", headings, rows, note)]
    if part.sticks:
        of = [(each.per_cycle, each.share) for each in part.sticks]
        stops = [
            (pair[0].name, *(text for each in pair for text in (value_of(each), interval_of(each))))
            for pair in zip(*of, strict=True)
        ]
        tables.append(Table("Stops, by the speed", ("", "measured", "95 %", "predicted", "95 %"), stops))
    return Story.of_record(
        part.name, record, headline=[*leading(record.check()), *_headline(part, law)],
        cautions=[*_cautions(part), *doubts(part.estimates[:2])], tables=tables, draw=lambda: law_plates(fit),
        look=lambda: _scope(part, law), data=part.to_dict,
    )  # fmt: skip


def _headline(part: Prediction, law: str) -> Iterator[str]:
    yield f"{law}, as it was given, follows {_listed(part.follows)} in {part.name}."
    better = {name: value for name, value in part.plain.items() if value >= part.follows[name]}
    if better:
        yield f"Plain Coulomb friction, fitted to this record, follows no less: {_listed(better)}."


def _cautions(part: Prediction) -> Iterator[str]:
    if {"z", "force"}.isdisjoint(part.record):
        yield "Neither the base's motion z nor a force was recorded: the motion is driven as the law's file says."
    least = min(part.follows, key=lambda name: part.follows[name])
    if part.follows[least] < 0:
        yield f"{least} is predicted worse than by its mean: the law, a constant, a unit or the drive is another one."


def _scope(part: Prediction, law: str) -> Scope | None:
    """Each channel with what the law's sensor would have read over it; none of a broken clock."""
    record, traces = part.record, part.fit.traces[0]
    if record.stamps is not None:
        return None
    panels = [
        Panel(name, record.channels[name].unit, {
            "measured": record[name],
            "model": np.interp(record.time, traces.time[name], traces.fitted[name], left=np.nan, right=np.nan),
        }) for name in part.follows
    ]  # fmt: skip
    command, first = command_of(record, "analyze")
    return Scope(record.start, record.fs, panels, f"{law}, as it was given", command=command, first=first)


def _law(found: Predictions) -> str:
    return type(found.oscillator.law).__name__


def _stops(part: Prediction) -> Sequence[str]:
    """Per cycle, as measured and as predicted."""
    return [value_of(each.per_cycle) for each in part.sticks] or [UNKNOWN, UNKNOWN]


def _left(part: Prediction, name: str) -> str:
    residual = part.fit.residual[name]
    return number(residual, residual / 100, part.record.channels[name].unit)


def _listed(follows: Mapping[str, float]) -> str:
    told = [f"{_percent(value)} of {name}" for name, value in follows.items()]
    return " and ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f} %" if value < 99 else f"{value:.2f} %"
