"""The questions that the page can ask, each answered by one public function and published as a folder."""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import stickslip as ss
from stickslip.lab.asked import Asked, on_the_page
from stickslip.lab.describe import curve, describe

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.story import Story

FOLDER = "results"


def each(asked: Asked, answer: Callable[[int], Any]) -> tuple[list[Any], list[str]]:
    """What each record answers, and why those that are left out do not; the reason where none does."""
    found, left_out = [], []
    for number in range(len(asked.records)):
        asked.say(f"analysing {asked.name(number)}", number / (len(asked.records) + 1))
        try:
            found.append(answer(number))
        except ss.errors.ModelError:
            raise
        except ss.StickslipError as error:
            left_out.append(error)
    if not found:
        raise left_out[0]
    return found, [f"Left out: {on_the_page(str(error))}" for error in left_out]


def published(
    asked: Asked, found: Sequence[Any], left_out: Sequence[str], compare: Callable[..., Any]
) -> dict[str, Any]:
    """The page, numbers and figures of one record, or of several compared; and what the lab shows of them."""
    results = compare(found) if len(found) > 1 else found[0]
    results = dataclasses.replace(results, notes=(*results.notes, *left_out))
    asked.say("drawing and writing", len(asked.records) / (len(asked.records) + 1))
    ss.publish(results, folder=FOLDER)
    return _told(ss.summary(results))


def _told(story: Story) -> dict[str, Any]:
    """What the lab shows: the same words as the report and the command line. Also packs the folder."""
    shutil.make_archive(FOLDER, "zip", FOLDER)
    return {
        "title": story.title,
        "headline": [on_the_page(each) for each in story.headline],
        "cautions": [on_the_page(each) for each in story.cautions],
        "lines": [[line.name, line.value, line.interval, line.status] for line in story.lines],
        "notes": [on_the_page(each) for each in story.notes],
        "overlay": [],
    }


def analyze(asked: Asked) -> dict[str, Any]:
    """All questions about friction."""
    method = asked.options.get("method") or "auto"

    def one(number: int) -> Any:
        rig = asked.rig(number)
        if not asked.is_long(number):
            return ss.analyze(asked.record(number), rig=rig, method=method)

        def tell(words: str) -> None:
            asked.say(f"analysing {asked.name(number)}, {words}", number / (len(asked.records) + 1))

        return ss.answers.analyze_blocks(asked.parts(number), rig=rig, method=method, progress=tell)

    return published(asked, *each(asked, one), ss.compare)


def decay(asked: Asked) -> dict[str, Any]:
    """How a released mass dies away."""
    told = {name: value for name, value in asked.options.items() if value is not None}
    found, left_out = each(asked, lambda number: ss.analyze_decay(asked.record(number), **told))
    answer = published(asked, found, left_out, ss.answers.compare_decays)
    return {**answer, "overlay": [curve for each in found for curve in _decay_curves(each)]}


def _decay_curves(found: Any) -> Iterator[dict[str, Any]]:
    fit = found.decay.waveform
    if fit is None:
        return
    unit = found.record.channels[fit.channel].unit
    for time, measured, fitted in zip(fit.time, fit.measured, fit.fitted, strict=True):
        yield curve(found.name, fit.channel, unit, time, measured, fitted)


def squeak(asked: Asked) -> dict[str, Any]:
    """When, how loud and at which frequency it squeaks."""
    told = {name: asked.options.get(name) for name in ("channel", "frequencies", "lever")}

    def one(number: int) -> Any:
        rig = asked.rig(number)
        found = ss.analyze_squeaks(asked.record(number), contact=rig.contact, **told)
        load = rig.normal_load(found.name)
        return found if load is None else dataclasses.replace(found, normal=load)

    return published(asked, *each(asked, one), ss.answers.compare_squeaks)


def wavelet(asked: Asked) -> dict[str, Any]:
    """A channel over time and frequency."""
    options = {name: value for name, value in asked.options.items() if value is not None}
    asked.say(f"mapping {asked.name(0)}", 0.1)
    found = ss.answers.time_frequency(asked.parts(), **options)
    return published(asked, [found], [], list)


def fit(asked: Asked) -> dict[str, Any]:
    """Which friction law it is, or a curve of friction."""
    rig = asked.rig()
    asked.say("reading", 0.0)
    records = [asked.record(number) for number in range(len(asked.records))]
    found, records = ss.answers.fit_records(
        records,
        rig=rig,
        curve=asked.options.get("curve"),
        laws=_listed(asked.options.get("laws")),
        calibration=asked.options.get("calibration") or 0.01,
        progress=lambda share: asked.say(f"fitting and comparing laws, {share:.0%}", 0.05 + 0.85 * share),
    )
    ss.publish(found, folder=FOLDER, record=records)
    told = _told(ss.summary(found, record=records))
    curves = [*_law_curves(asked, records, found)]
    return {**told, "overlay": curves, "state": fitted_system(Path(FOLDER, "law", "law.toml"))}


def _law_curves(asked: Asked, records: Sequence[Record], found: Any) -> Iterator[dict[str, Any]]:
    """What the best law's sensors would have read, over what was measured; nothing of a curve."""
    for number, traces in enumerate(found.fit.traces if isinstance(found, ss.law.LawComparison) else ()):
        for name, values in traces.measured.items():
            unit = records[number].channels[name].unit
            yield curve(asked.name(number), name, unit, traces.time[name], values, traces.fitted[name])


def fitted_system(file: Path) -> dict[str, Any] | None:
    """The system with the fitted law, to play with; None where it is a law alone, or of a kind that is not played."""
    if not file.exists():
        return None
    try:
        system: dict[str, Any] = json.loads(ss.systems.export_system(ss.systems.read_system(file), format="json"))
    except ss.errors.ModelError:
        return None
    return system


def _listed(words: str | None) -> list[str] | None:
    return [word.strip() for word in words.split(",") if word.strip()] if words else None


QUESTIONS: dict[str, Callable[[Asked], dict[str, Any]]] = {
    "describe": describe, "analyze": analyze, "decay": decay, "squeak": squeak, "wavelet": wavelet, "fit": fit,
}  # fmt: skip
