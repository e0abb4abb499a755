"""The questions that the page can ask, each answered by one public function and published as a folder."""

from __future__ import annotations

import base64
import dataclasses
import json
import math
import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.record import Fault
    from stickslip.rig import RigSettings
    from stickslip.story import Story

Array = NDArray[np.float64]

TWINS = 40  # simulated rigs on which answers are tried
MOST_FIGURES, MOST_SOUNDS, LONGEST_SOUND = 6, 8, 1 << 20  # shown in the lab; bytes of a sound
WIDEST = 1 << 18  # rows of a stretch of which the extremes are drawn: none reaches over two parts
POINTS = 2000  # pairs of least and greatest value of a channel that are drawn
MOTION, FORCES = {"x", "v"}, {"friction", "load", "force"}
CONSTANTS = ("mass", "stiffness", "damping")


def describe(query: Query) -> dict[str, Any]:
    """The channels, rate and faults of each record, and of each question what a person must still tell."""
    records, missing = [], []
    for number in range(len(query.records)):
        query.say(f"reading {query.name(number)}", number / len(query.records))
        summary, needs = _one(query, number)
        records.append(summary)
        missing += needs
    names = [{channel["name"] for channel in record["channels"]} for record in records]
    common = set.intersection(*names)
    return {"records": records, "needs": sorted(set(missing)), "questions": questions(common, len(records))}


def questions(channels: set[str], records: int) -> dict[str, dict[str, Any]]:
    """Of each question: whether the channels allow it, why not, and which constants it needs or takes."""
    forces, moves = bool(channels & FORCES), bool(channels & MOTION)
    rig, felt = ["mass", "stiffness"], bool(channels & {"friction", "coefficient"})
    measured = "friction" in channels or ("load" in channels and moves) or "force" in channels
    motion = "name the displacement x or the velocity v among the channels"
    own, decays = ["damping", "damper", "contact"], bool(channels & {"x", "theta", "v", "a"})
    unmeasured, unfelt = moves and not measured, not felt or "x" in channels
    return {
        "analyze": _question(moves or forces, motion, rig if unmeasured else [], [*rig, *own, "normal"]),
        "decay": _question(decays, "name x, theta, v or a among the channels", [], rig),
        "wavelet": _question(records == 1, "one record is mapped at a time", [], ["frequencies", *rig]),
        "squeak": _question(True, "", [], ["frequencies", "normal"]),
        "fit": _question(moves or felt, motion, rig if unfelt else [], [*own, "laws", "curve"]),
    }


def _question(able: bool, why: str, needs: list[str], may: list[str]) -> dict[str, Any]:
    optional = [name for name in may if name not in needs]
    return {"able": able, "why": "" if able else why, "needs": needs, "may": optional}


def _one(query: Query, number: int) -> tuple[dict[str, Any], list[str]]:
    """A record as the page shows it, and what reading it still needs."""
    try:
        return shown(query.name(number), query.parts(number)), []
    except ss.errors.RecordError as error:
        if query.reading.get("fs") or error.kind != ss.errors.NO_RATE:
            raise
        guess = Query(query.records, query.names, {**query.reading, "fs": 1.0}, query.options, query.say)
        summary = shown(query.name(number), guess.parts(number))
        return {**summary, "fs": None, "duration": None, "asks": on_the_page(str(error))}, ["fs"]


def shown(name: str, parts: Iterable[Record]) -> dict[str, Any]:
    """Channels, rate, faults and a thinned picture of a record that comes in parts."""
    first: Record | None = None
    rows, thin = 0, Thinned()
    for part in parts:
        first = part if first is None else first
        rows += len(part)
        thin.add(part)
    assert first is not None
    whole = rows == len(first)
    faults = [_fault(fault) for fault in first.check()]
    restored = first.history[-1].outcome == "a record as it was written"
    notes = [step.outcome for step in first.history if step.outcome and step.arguments.get("files")]
    if not whole:
        notes.append(f"the check-up looked at the first {len(first)} of {rows} rows")
    curves = thin.curves()
    return {
        "name": name,
        "rows": rows,
        "fs": first.fs,
        "start": first.start,
        "duration": rows / first.fs,
        "channels": [
            {
                "name": channel.name,
                "unit": channel.unit,
                "words": channel.quantity,
                "column": channel.name if restored else channel.column or channel.name,
                "low": plain(np.fmin.reduce(curves[channel.name])),
                "high": plain(np.fmax.reduce(curves[channel.name])),
            }
            for channel in first.channels.values()
        ],
        "stated": {name: first.truth[name] for name in CONSTANTS if name in first.truth},
        "faults": faults,
        "notes": notes,
        "unknown": [c.name for c in first.channels.values() if _untold(c)],
        "preview": {
            "time": numbers(first.start + thin.rows() / first.fs),
            "channels": {name: numbers(values) for name, values in curves.items()},
        },
    }


def _untold(channel: ss.record.Channel) -> bool:
    """Whether nobody stated a unit: what it is in is then not known, unless it may well have none."""
    return channel.assumed or (channel.unit == "1" and channel.name not in ("sound", "coefficient"))


def _fault(fault: Fault) -> dict[str, Any]:
    return {"message": on_the_page(fault.message), "severity": fault.severity, "repair": fault.repair}


class Thinned:
    """Channels that come in parts, as the least and the greatest value of ever wider stretches."""

    def __init__(self) -> None:
        self.width = 1
        self._total = 0
        self._kept: dict[str, list[Array]] = {}

    def add(self, part: Record) -> None:
        """Go on with the next part."""
        self._total += len(part)
        for name in part:
            self._kept.setdefault(name, []).append(extremes(part[name], self.width))
        while -(-self._total // self.width) > POINTS and self.width < WIDEST:
            self.width *= 2
            for name, blocks in self._kept.items():
                self._kept[name] = [_halved(np.concatenate(blocks))]

    def rows(self) -> Array:
        """The row of each value of :meth:`curves`: two in each stretch."""
        starts = np.arange(0, self._total, self.width, dtype=np.float64)
        ends = np.minimum(starts + self.width, self._total)
        return np.column_stack([starts, (starts + ends) / 2]).ravel() if self.width > 1 else starts

    def curves(self) -> dict[str, Array]:
        """The values of each channel, least and greatest in turn."""
        kept = {name: np.concatenate(blocks) for name, blocks in self._kept.items()}
        return {name: values.ravel() if self.width > 1 else values[:, 0] for name, values in kept.items()}


def extremes(values: Array, width: int) -> Array:
    """The least and the greatest value of each stretch of `width`."""
    starts = np.arange(0, len(values), width)
    return np.column_stack([np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)])


def _halved(pairs: Array) -> Array:
    starts = np.arange(0, len(pairs), 2)
    return np.column_stack([np.fmin.reduceat(pairs[:, 0], starts), np.fmax.reduceat(pairs[:, 1], starts)])


def curve(record: str, channel: str, unit: str, time: Array, measured: Array, fitted: Array) -> dict[str, Any]:
    """A fitted curve over what was measured, thinned alike."""
    width = max(1, -(-len(time) // POINTS))
    if width > 1:
        middles = time[::width][: -(-len(time) // width)]
        time = np.repeat(middles, 2)
        measured, fitted = extremes(measured, width).ravel(), extremes(fitted, width).ravel()
    values = {"time": numbers(time), "measured": numbers(measured), "fitted": numbers(fitted)}
    return {"record": record, "channel": channel, "unit": unit, **values}


def numbers(values: Iterable[float]) -> list[float | None]:
    """For JSON, with the digits that a screen shows."""
    return [plain(value) for value in values]


def plain(value: float) -> float | None:
    return float(f"{value:.7g}") if math.isfinite(value) else None


FOLDER = "results"


def results_of(query: Query, answer: Callable[[int], Any]) -> tuple[list[Any], list[str]]:
    """What each record answers, and why those that are left out do not; the reason where none does."""
    results, left_out = [], []
    for number in range(len(query.records)):
        query.say(f"analysing {query.name(number)}", number / (len(query.records) + 1))
        try:
            results.append(answer(number))
        except ss.errors.ModelError:
            raise
        except ss.StickslipError as error:
            left_out.append(error)
    if not results:
        raise left_out[0]
    return results, [f"Left out: {on_the_page(str(error))}" for error in left_out]


def published(
    query: Query, findings: Sequence[Any], left_out: Sequence[str], compare: Callable[..., Any]
) -> dict[str, Any]:
    """The page, numbers and figures of one record, or of several compared; and what the lab shows of them."""
    results = compare(findings) if len(findings) > 1 else findings[0]
    results = dataclasses.replace(results, notes=(*results.notes, *left_out))
    query.say("drawing and writing", len(query.records) / (len(query.records) + 1))
    ss.publish(results, folder=FOLDER)
    return _shown(ss.summary(results))


def _shown(story: Story) -> dict[str, Any]:
    """What the lab shows: the same words as the report and the command line. Also packs the folder."""
    shutil.make_archive(FOLDER, "zip", FOLDER)
    return {
        "title": story.title,
        "headline": [on_the_page(sentence) for sentence in story.headline],
        "cautions": [on_the_page(sentence) for sentence in story.notices],
        "lines": [[line.name, line.value, line.interval, story.marks(line)] for line in story.lines],
        "notes": [on_the_page(sentence) for sentence in story.notes],
        "figures": [[plate.title, plate.svg(), plate.caption] for plate in story.plates[:MOST_FIGURES]],
        "sounds": [[clip.caption, base64.b64encode(clip.wav).decode("ascii")] for clip in loudest(story)],
        "overlay": [],
    }


def loudest(story: Story) -> list[Any]:
    """As many of the loudest clips as keep the page light; the folder has all."""
    clips = sorted(story.clips, key=lambda clip: -clip.level)[:MOST_SOUNDS]
    return [clip for clip in clips if len(clip.wav) < LONGEST_SOUND]


def analyze(query: Query) -> dict[str, Any]:
    """All questions about friction."""
    method = query.options.get("method") or "auto"

    def one(number: int) -> Any:
        rig = query.rig(number)
        if not query.is_long(number):
            return _on_twins(query, ss.analyze(query.record(number), rig=rig, method=method))

        def tell(sentence: str) -> None:
            query.say(f"analysing {query.name(number)}, {sentence}", number / (len(query.records) + 1))

        return ss.answers.analyze_blocks(query.parts(number), rig=rig, method=method, progress=tell)

    return published(query, *results_of(query, one), ss.compare)


def _on_twins(query: Query, findings: Any) -> Any:
    """The answers tried on twins where that is asked for; with a note of why, where the record has none."""
    if not query.options.get("twins"):
        return findings

    def tell(share: float) -> None:
        query.say(
            f"trying the answers of {findings.name} on {TWINS} simulated rigs, {100 * share:.0f} %", 0.1 + 0.8 * share
        )

    tell(0.0)
    try:
        return ss.tried(findings, twins=TWINS, progress=tell)
    except ss.errors.EstimateError as error:
        return dataclasses.replace(findings, notes=(*findings.notes, f"Twins: {error}"))


def decay(query: Query) -> dict[str, Any]:
    """How a released mass dies away."""
    options = {name: value for name, value in query.options.items() if value is not None}
    results, left_out = results_of(query, lambda number: ss.analyze_decay(query.record(number), **options))
    answer = published(query, results, left_out, ss.answers.compare_decays)
    return {**answer, "overlay": [curve for findings in results for curve in _decay_curves(findings)]}


def _decay_curves(findings: Any) -> Iterator[dict[str, Any]]:
    fit = findings.decay.waveform
    if fit is None:
        return
    unit = findings.record.channels[fit.channel].unit
    for time, measured, fitted in zip(fit.time, fit.measured, fit.fitted, strict=True):
        yield curve(findings.name, fit.channel, unit, time, measured, fitted)


def squeak(query: Query) -> dict[str, Any]:
    """When, how loud and at which frequency it squeaks."""
    options = {name: query.options.get(name) for name in ("channel", "frequencies", "lever")}

    def one(number: int) -> Any:
        rig = query.rig(number)
        findings = ss.analyze_squeaks(query.record(number), contact=rig.contact, **options)
        load = rig.normal_load(findings.name)
        return findings if load is None else dataclasses.replace(findings, normal=load)

    return published(query, *results_of(query, one), ss.answers.compare_squeaks)


def wavelet(query: Query) -> dict[str, Any]:
    """A channel over time and frequency."""
    options = {name: value for name, value in query.options.items() if value is not None}
    query.say(f"mapping {query.name(0)}", 0.1)
    findings = ss.answers.time_frequency(query.parts(), **options)
    return published(query, [findings], [], list)


def fit(query: Query) -> dict[str, Any]:
    """Which friction law it is, or a curve of friction."""
    rig = query.rig()
    query.say("reading", 0.0)
    records = [query.record(number) for number in range(len(query.records))]
    result, records = ss.answers.fit_records(
        records,
        rig=rig,
        curve=query.options.get("curve"),
        laws=_listed(query.options.get("laws")),
        calibration=query.options.get("calibration") or 0.01,
        progress=lambda share: query.say(f"fitting and comparing laws, {100 * share:.0f} %", 0.05 + 0.85 * share),
    )
    ss.publish(result, folder=FOLDER, record=records)
    answer = _shown(ss.summary(result, record=records))
    curves = [*_law_curves(query, records, result)]
    return {**answer, "overlay": curves, "state": fitted_system(Path(FOLDER, "law", "law.toml"))}


def _law_curves(query: Query, records: Sequence[Record], result: Any) -> Iterator[dict[str, Any]]:
    """What the best law's sensors would have read, over what was measured; nothing of a curve."""
    for number, traces in enumerate(result.fit.traces if isinstance(result, ss.law.LawComparison) else ()):
        for name, values in traces.measured.items():
            unit = records[number].channels[name].unit
            yield curve(query.name(number), name, unit, traces.time[name], values, traces.fitted[name])


def fitted_system(file: Path) -> dict[str, Any] | None:
    """The system with the fitted law, to play with; None where it is a law alone, or of a kind that is not played."""
    if not file.exists():
        return None
    try:
        system: dict[str, Any] = json.loads(ss.systems.export_system(ss.systems.read_system(file), format="json"))
    except ss.errors.ModelError:
        return None
    return system


def _listed(names: str | None) -> list[str] | None:
    return [word.strip() for word in names.split(",") if word.strip()] if names else None


# ---- what is asked, of which records


@dataclass(frozen=True)
class Query:
    """What was asked: of which records, read how, with which options.

    Attributes
    ----------
    records : sequence of sequence of Path
        The files of each record.
    names : mapping of str to str
        What the users call a file, by our name of it.
    reading, options : mapping
        How the files are read; what the question is told.
    say : callable
        Told in words, and as a share of one, how far it is.
    """

    records: Sequence[Sequence[Path]]
    names: Mapping[str, str]
    reading: Mapping[str, Any]
    options: Mapping[str, Any]
    say: Callable[[str, float], None]

    @classmethod
    def of(cls, ask: Mapping[str, Any], say: Callable[[str, float], None]) -> Query:
        records = [[Path(path) for path in record] for record in ask["records"]]
        return cls(records, ask["names"], ask["reading"], ask["options"], say)

    def rig(self, number: int = 0) -> RigSettings:
        """The settings, with the normal load of one of the records."""
        known = set(ss.rig.RigSettings.model_fields)
        given = {name: value for name, value in {**self.reading, **self.options}.items() if name in known}
        loads = given.pop("normal", None)
        load = loads[number] if isinstance(loads, list) and number < len(loads) else None
        return ss.rig.rig_settings({**given, **({"normal": load} if load else {})}, source="the page")

    def record(self, number: int = 0) -> Record:
        """One of the records, whole, mended as asked."""
        return ss.answers.read_mended(self.records[number], rig=self.rig(number), names=self._called(number))

    def parts(self, number: int = 0) -> Iterator[Record]:
        """One of the records in parts that fit into memory; whole if it is short, or rows or repairs are asked for."""
        if not self.is_long(number):
            return iter([self.record(number)])
        return ss.answers.read_parts(self.records[number], rig=self.rig(number), names=self._called(number))

    def is_long(self, number: int) -> bool:
        return ss.answers.is_long(self.records[number])

    def name(self, number: int) -> str:
        return " + ".join(self._called(number))

    def _called(self, number: int) -> list[str]:
        return [self.names[path.name] for path in self.records[number]]


def on_the_page(sentence: str) -> str:
    """A sentence with the page's fields for the arguments that it names to a Python user."""
    text = re.sub(r'channels=\{"(\w+)": "([^"]*)"\}', r"\1 in the table of channels", sentence)
    text = re.sub(r'\b(channel|method|restoring|contact)="(\w+)"', r"\1: \2", text)
    return re.sub(r"\b([a-z_]+)=(?=\W|$)", r'the field "\1"', text)


QUESTIONS: dict[str, Callable[[Query], dict[str, Any]]] = {
    "describe": describe, "analyze": analyze, "decay": decay, "squeak": squeak, "wavelet": wavelet, "fit": fit,
}  # fmt: skip
