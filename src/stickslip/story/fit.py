"""A fitted law or curve, several laws compared, or records as a law predicts them, told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from stickslip.answers.arm import Joint
from stickslip.answers.findings import Findings, record_name
from stickslip.answers.fits import Prediction, Predictions
from stickslip.arrays import Array
from stickslip.balance.motion import driving, forcing_frequency
from stickslip.drives.kinds import Drive, HarmonicBase, Ramp, Release
from stickslip.errors import ModelError
from stickslip.estimate import UNKNOWN, doubts_of
from stickslip.figures.contact import law_plates
from stickslip.law.fit_curve import CurveFit
from stickslip.law.law import LawFit
from stickslip.law.verdict import LawComparison
from stickslip.laws.export import export_law, plain
from stickslip.parameters import unit
from stickslip.record.record import Record
from stickslip.rig.settings import rig_toml
from stickslip.settings import toml_lines
from stickslip.story.scope import Scope, corrected, of_fit, reading_of
from stickslip.story.story import (
    Caution,
    Line,
    Story,
    Table,
    doubts,
    faulty,
    interval_of,
    leading,
    listed,
    number,
    value_of,
)

Fit: TypeAlias = LawComparison | LawFit | CurveFit
Records: TypeAlias = Record | Sequence[Record]  # what it was fitted to

LOUD = 0.3  # of the friction, that a curve leaves for noise
FILES = {
    "toml": "law.toml", "python": "friction.py", "c": "friction.c", "mujoco": "mujoco.xml", "modelica": "friction.mo",
    "simulink": "friction.m",
}  # fmt: skip
COLUMNS = "rig.toml"  # beside the law: columns and units of the record that it was fitted to
MOST = 0.5  # of the variance: what carries more is what drives the rig, not a line in the noise of a resting base
CYCLES = 6.0  # that are shown first of a fit: the lines of more run into one another
STEADY = 0.05  # of its spread that a base may stray from a straight line: a tone over its half period strays by 0.2
ALONE = "# a law alone: to simulate it, add [system] with its mass and stiffness, and [drive]"
DEFINITION = (
    "Fit: 100 (1 - |y - yhat| / |y - mean y|) %, the fit of system identification: 100 % is the record itself, 0 % "
    "no better than its mean. Nothing was fitted to it, but of an oscillator how it begins and each sensor's zero."
)
LIKE_NOISE = 1.5  # times its noise, chosen: what a prediction leaves of a channel by noise alone
COMPARED = "Coulomb: the same of one level of friction and a viscous damper, both fitted to the record itself."


def of_curve(fit: CurveFit, *, record: Records = ()) -> Story:
    """A curve of friction."""
    return _story(fit, record, list(_curve_told(fit)), data=partial(_curve_numbers, fit))


def of_law(fit: LawFit, *, record: Records = ()) -> Story:
    """One law."""
    return _story(fit, record, list(_law_told(fit)), notes=list(fit.checks), data=fit.to_dict)


def of_laws(
    comparison: LawComparison, *, record: Records = (), mistaken: Findings | None = None, options: Sequence[str] = ()
) -> Story:
    """Several laws compared; first a slip of the hand that shows, and the command with its `options` that mends it."""
    laws = sorted(comparison.candidates, key=lambda candidate: candidate.standing.misfit)
    rows = [
        (law.name, _ratio(law.standing.misfit), "yes" if law.standing.kept else "no", _values(law.oscillator.law))
        for law in laws
    ]
    verdicts = [(law.name, law.standing.verdict) for law in laws]
    note = (
        "Misfit: mean square left over, in channels and records together, over the least that any law leaves. Kept: "
        "what explains the records, with no parameter more than it takes."
    )
    ranked = Table("Laws by misfit", ("law", "misfit", "kept", "parameters"), rows, note)
    why = Table("Why each law is kept or not", ("law", "verdict"), verdicts, folded=True)
    headline, remedies = [comparison.verdict], list[str]()
    if mistaken is not None:
        headline = [f"Probably {mistaken.contradiction}: until that is mended no law holds.", *headline]
        remedies = corrected(mistaken, mistaken.slips, "fit", options)
    return _story(
        comparison,
        record,
        headline,
        notes=comparison.fit.checks,
        remedies=remedies,
        tables=[ranked, why],
        history=comparison.history,
        data=comparison.to_dict,
    )


def _story(fit: Fit, record: Records, headline: list[str], **content: Any) -> Story:
    """What all fits tell of their parameters and of the records that they were made to."""
    records = [record] if isinstance(record, Record) else list(record)
    checked = [(f"{record_name(record)}: " if len(records) > 1 else "", record.check()) for record in records]
    units = list(dict.fromkeys(caution for name, faults in checked for caution in leading(faults, of=name)))
    own = doubts(fit.estimates)
    said = {caution.reason for caution in own}
    cautions = [*(Caution(doubt.words) for doubt in doubts_of(fit.status) if doubt.words not in said), *own]
    cautions += [caution for name, faults in checked for caution in faulty(faults, of=name)]
    if records:
        first = records[0]
        content = {"channels": list(first.channels.values()), "history": first.history, **content}
        content["settings"] = {
            "records": str(len(records)),
            "sampling rate": f"{first.fs:g} Hz",
            "length": ", ".join(f"{record.duration:g} s" for record in records),
        }
    title = record_name(records[0]) if len(records) == 1 else f"{len(records)} records" if records else "Fit"
    return Story(
        title,
        [*units, *headline],
        cautions,
        lines=list(map(Line.of, fit.estimates)),
        faults=[f"{name}{fault}" for name, faults in checked for fault in faults] if records else None,
        draw=lambda: law_plates(fit),
        look=lambda: _scope(fit, records),
        write=partial(write_law, result=fit, records=records),
        **content,
    )


def _scope(result: Fit, records: Sequence[Record]) -> Scope | None:
    """The first record's first channel with what the law's sensor would have read, and what is left."""
    fit = result.fit if isinstance(result, LawComparison) else result
    if not records or isinstance(fit, CurveFit) or not fit.traces:
        return None
    traces = fit.traces[0]
    name = next(iter(traces.measured))
    fitted = {name: (traces.time[name], traces.fitted[name])}
    values = _values(fit.law)
    law = f"{type(fit.law).__name__}{f' ({values})' if values else ''}"
    return of_fit(records[0], fitted, ["fit"], law, _middle(records[0]))


def _middle(record: Record) -> tuple[float, float] | None:
    """From when to when some cycles of the middle last; None where no tone drives the rig, or not for so many."""
    channel = driving(record)
    if channel is None or not np.isfinite(record[channel]).all():
        return None
    _, frequency, _, share = _tone(record[channel], record.fs)
    length, middle = CYCLES / frequency, record.start + record.duration / 2
    return (middle - length / 2, middle + length / 2) if share > MOST and 2 * length < record.duration else None


def _ratio(misfit: float) -> str:
    return f"{misfit:.2f}" if misfit < 10 else f"{misfit:.0f}"


def _curve_told(fit: CurveFit) -> Iterator[str]:
    follows = "the friction follows" if fit.follows else "the friction does not follow"
    if fit.follows and fit.unexplained > LOUD:
        follows = f"as far as its noise lets it be seen, {follows}"
    yield f'{follows[0].upper()}{follows[1:]} the curve "{fit.curve}": {fit.formula}.'
    left = f"{100 * fit.unexplained:.1f} % of the friction, {number(fit.residual, fit.residual / 100, fit.unit)}"
    what = "It leaves" if fit.follows else "The best of that kind leaves"
    yield f"{what} {left} root mean square; {100 * fit.model_error:.1f} % is no noise."


def _law_told(fit: LawFit) -> Iterator[str]:
    how = "fitted to" if fit.parameters else "as it was given, predicts"
    surface = " on a rough surface" if fit.surface == "rough" else ""
    yield f"The law {type(fit.law).__name__}{surface}, {how} {', '.join(fit.misfit)}: {_values(fit.law)}."
    yield f"It leaves {', '.join(f'{times:.3g} times the noise of {name}' for name, times in fit.misfit.items())}."


def _values(law: object) -> str:
    values = {key: value for key, value in vars(law).items() if isinstance(value, float)}
    return ", ".join(f"{key} {number(value, abs(value) / 1000, unit(law, key))}" for key, value in values.items())


def _curve_numbers(fit: CurveFit) -> dict[str, object]:
    """Plain data for JSON: SI numbers, None where a number does not exist."""
    return {
        "curve": fit.curve, "formula": fit.formula, "residual": fit.residual,
        "unexplained": fit.unexplained, "model_error": fit.model_error, "follows": fit.follows,
        "unit": fit.unit, "status": fit.status,
        "estimates": [estimate.to_dict() for estimate in fit.estimates],
    }  # fmt: skip


# ---- a fitted law in a folder, in every form that another program reads


def write_law(draft: Path, result: LawComparison | LawFit | CurveFit, records: Sequence[Record]) -> None:
    """The fitted law in every form that it has, into the folder law, and how its record was read for the next one."""
    law = result.fit.law if isinstance(result, LawComparison) else result.law
    if law is None:
        return
    (draft / "law").mkdir()
    for form, file in FILES.items():
        try:
            text = export_law(law, format=form)
        except ModelError:  # this law has no such form
            continue
        if form == "toml":
            text = _whole(text, result, records[0]) if records else f"{ALONE}\n{text}"
        (draft / "law" / file).write_text(text.rstrip("\n") + "\n", encoding="utf-8")
    reading = reading_of(records[0]) if records else {}
    reading.pop("fs", None)  # of that file alone: the next one has its own clock, or is asked for it
    if reading:
        (draft / "law" / COLUMNS).write_text("\n".join(rig_toml(reading)) + "\n", encoding="utf-8")


def _whole(law: str, result: LawComparison | LawFit | CurveFit, record: Record) -> str:
    """The law's table within a system, moved as the first record was; alone where the mass is not known."""
    if isinstance(result, CurveFit):
        constants: dict[str, Any] = {} if record.rig is None else record.rig.constants
        contact = str(constants.get("contact", "ground"))
        given: Drive = HarmonicBase(0.0, frequency=1.0, contact=contact)
    else:
        rig = (result.fit if isinstance(result, LawComparison) else result).oscillator
        constants = {name: getattr(rig, name) for name in ("mass", "stiffness", "damping", "damper")}
        given = rig.drive
    if constants.get("mass") is None or constants.get("stiffness") is None:
        return f"{ALONE}\n{law}"
    drive = _drive(record, given)
    named = {name: constants[name] for name in ("mass", "stiffness", "damping", "damper") if name in constants}
    system = {name: value if isinstance(value, str) else float(value) for name, value in named.items()}
    start = {"x": float(record["x"][0])} if isinstance(drive, Release) and "x" in record else {}
    tables = {"system": system, "drive": plain(drive), "start": start, "run": {"duration": record.duration}}
    return "\n".join([law, *toml_lines(tables)])


def _drive(record: Record, given: Drive) -> Drive:
    """The base's steady pull or strongest tone, or what the fit was told."""
    if "z" in record and np.ptp(record["z"]) > 0:
        z, time = record["z"], np.arange(len(record)) / record.fs
        speed, begin = np.polyfit(time, z, 1)
        if np.std(z - begin - speed * time) < STEADY * np.std(z) and getattr(given, "contact", "ground") == "ground":
            return Ramp(float(speed))
        amplitude, frequency, phase, _ = _tone(z, record.fs)
        return HarmonicBase(amplitude, frequency=frequency, phase=phase, contact=getattr(given, "contact", "ground"))
    still = isinstance(given, HarmonicBase) and given.amplitude == 0
    known = all(isinstance(value, int | float | str) for value in vars(given).values())
    return given if known and not still else Release()


def _tone(values: Array, fs: float) -> tuple[float, float, float, float]:
    """Amplitude, frequency [Hz] and phase of the strongest line, and its share of the variance."""
    frequency = forcing_frequency(values, fs).value
    turns = 2 * np.pi * frequency * np.arange(len(values)) / fs
    waves = np.column_stack([np.cos(turns), np.sin(turns), np.ones(len(values))])
    solution = np.linalg.lstsq(waves, values, rcond=None)[0]
    a, b, _ = solution
    share = 1 - float(np.var(values - waves @ solution) / np.var(values))
    return float(np.hypot(a, b)), frequency, float(np.arctan2(-b, a)), share


def of_predictions(predictions: Predictions) -> Story:
    """One record by itself; several in a table, a row each, with a section of the page for each."""
    parts = [_of_one(part, _law(predictions)) for part in predictions.parts]
    if len(parts) == 1:
        return _noted(parts[0], predictions)
    least = _listed(predictions.least)
    several = any(part.how for part in predictions.parts)  # of one log
    what = f"{len(parts)} {'predictions' if several else 'records'}"
    headline = f"{_law(predictions)}, as it was given, follows at least {least} in each of {what}."
    first = next(iter(predictions.least))
    compared = any(part.plain for part in predictions.parts)
    rows = [
        (
            part.name,
            *(_percent(part.follows.get(name)) for name in predictions.least),
            *([_percent(part.plain.get(first))] if compared else []),
            *_stops(part),
        )
        for part in predictions.parts
    ]
    beside = [f"{first}, Coulomb"] if compared else []
    headings = ("record", *predictions.least, *beside, "stops per cycle", "predicted")
    table = Table("Fit of each channel", headings, rows, f"{DEFINITION} {COMPARED}" if compared else DEFINITION)
    title = what if several else f"{what} predicted"
    return _noted(Story(title, [headline], tables=[table], parts=parts), predictions)


def _noted(story: Story, predictions: Predictions) -> Story:
    moved = predictions.oscillator
    doubtful = moved.doubtful if isinstance(moved, Joint) else ()
    cautions = [f"The log that told this joint leaves doubtful: {', '.join(doubtful)}."] if doubtful else []
    notes = [*story.notes, *predictions.notes]
    return replace(story, cautions=[*story.cautions, *cautions], notes=notes, data=predictions.to_dict)


def _of_one(part: Prediction, law: str) -> Story:
    record, fit = part.record, part.fit
    rows = [
        (
            name,
            _percent(value),
            *([_percent(part.plain.get(name))] if part.plain else []),
            _left(part, name),
            f"{fit.misfit[name]:.3g}",
        )
        for name, value in part.follows.items()
    ]
    headings = ("channel", "fit", *(["Coulomb"] if part.plain else []), "left (rms)", "over its noise")
    note = f"{DEFINITION} {COMPARED}" if part.plain else DEFINITION
    tables = [Table("Fit of each channel", headings, rows, note)]
    if part.sticks:
        of = [(stick.per_cycle, stick.share) for stick in part.sticks]
        stops = [
            (pair[0].name, *(text for estimate in pair for text in (value_of(estimate), interval_of(estimate))))
            for pair in zip(*of, strict=True)
        ]
        tables.append(Table("Stops, by the speed", ("", "measured", "95 %", "predicted", "95 %"), stops))
    faults = record.check()
    return Story.of_record(
        part.name,
        record,
        headline=[*leading(faults), *_headline(part, law)],
        cautions=[*_cautions(part), *doubts(part.estimates[:2]), *faulty(faults)],
        faults=[str(fault) for fault in faults],
        tables=tables,
        draw=lambda: law_plates(fit),
        look=lambda: _scope_of(part, law),
        data=part.to_dict,
    )


def _headline(part: Prediction, law: str) -> Iterator[str]:
    worst = max(part.fit.misfit, key=lambda name: part.fit.misfit[name])
    times = part.fit.misfit[worst]
    left = "all but the sensors' noise" if times < LIKE_NOISE else f"but leaves {times:.2g} times the noise of {worst}"
    yield f"{law}, as it was given, follows {_listed(part.follows)} in {part.name}, {left}."
    better = {name: value for name, value in part.plain.items() if value >= part.follows[name]}
    if better:
        yield f"Plain Coulomb friction, fitted to this record, follows no less: {_listed(better)}."


def _cautions(part: Prediction) -> Iterator[str]:
    if {"z", "force", "reference"}.isdisjoint(part.record):
        yield "Neither the base's motion z nor a force was recorded: the motion is driven as the law's file says."
    least = min(part.follows, key=lambda name: part.follows[name])
    if part.follows[least] < 0:
        yield f"{least} is predicted worse than by its mean: the law, a constant, a unit or the drive is another one."


def _scope_of(part: Prediction, law: str) -> Scope | None:
    """Each channel with what the law's sensor would have read over it, and what is left; none of a broken clock."""
    traces = part.fit.traces[0]
    fitted = {name: (traces.time[name], traces.fitted[name]) for name in part.follows}
    question = "joint" if "theta" in part.record else "analyze"
    return of_fit(part.record, fitted, [question], f"{law}, as it was given", _middle(part.record))


def _law(predictions: Predictions) -> str:
    return type(predictions.oscillator.law).__name__


def _stops(part: Prediction) -> Sequence[str]:
    """Per cycle, as measured and as predicted."""
    return [value_of(stick.per_cycle) for stick in part.sticks] or [UNKNOWN, UNKNOWN]


def _left(part: Prediction, name: str) -> str:
    residual = part.fit.residual[name]
    return number(residual, residual / 100, part.record.channels[name].unit)


def _listed(follows: Mapping[str, float]) -> str:
    return listed([f"{_percent(value)} of {name}" for name, value in follows.items()])


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f} %" if value < 99 else f"{value:.2f} %"
