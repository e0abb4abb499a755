"""Squeaks in sentences, tables and sounds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from stickslip.answers.findings import Comparison, Findings
from stickslip.answers.squeaks import Condition, trend_of
from stickslip.estimate import Estimate, decimals, doubts_of, plain
from stickslip.figures.squeak import plates_of, plates_together
from stickslip.squeak.bursts import WORDS, Squeak, Squeaks
from stickslip.squeak.couplings import Coupling, Pair
from stickslip.squeak.spectra import burst_clips
from stickslip.story.story import Story, Table, cautions, interval_of, number, value_of
from stickslip.units import prefixed

MOST = 40  # bursts in a table
NONE = "–"


def of_findings(findings: Findings) -> Story:
    """One record."""
    low, high = findings.squeaks.band
    return Story(
        findings.name,
        list(_headline(findings)),
        [*_cautions(findings), *cautions(findings)],
        settings={"heard in": findings.squeaks.channel, "between": f"{low:g} and {high:g} Hz"},
        tables=list(_tables(findings)),
        draw=lambda: plates_of(findings),
        listen=lambda: burst_clips(findings.squeaks),
        data=lambda: _data(findings),
    )


def of_comparison(comparison: Comparison) -> Story:
    """Several conditions; each by itself on the page, and in a line of the terminal."""
    return Story(
        f"{len(comparison.conditions)} conditions compared",
        comparison.verdicts,
        tables=[Table("Conditions", *_condition_table(comparison))],
        draw=lambda: plates_together(comparison),
        data=lambda: _together(comparison),
    )


def _data(findings: Findings) -> dict[str, Any]:
    """Bursts, coupling and how it is heard, for JSON."""
    heard = findings.squeaks.to_dict()
    parts = {"coupling": findings.coupling, "sound_quality": findings.quality, "impulses": findings.impulses}
    return {
        "normal_load": findings.normal and findings.normal.value,
        "squeaks": {key: value for key, value in heard.items() if key not in ("notes", "history")},
        "beside": {
            squeaks.channel: {
                "kind": squeaks.kind,
                "reference": squeaks.reference,
                "bursts": [burst.to_dict() for burst in squeaks.bursts],
            }
            for squeaks in findings.beside
        },
        **{name: None if part is None else part.to_dict() for name, part in parts.items()},
    }


def _together(comparison: Comparison) -> dict[str, Any]:
    """The conditions and what they say together, for JSON."""
    loads = [condition.normal and condition.normal.value for condition in comparison.conditions]
    rows = [{**plain(vars(c)), "normal": load} for c, load in zip(comparison.conditions, loads, strict=True)]
    conditions = [{**row, "trend": condition.trend} for row, condition in zip(rows, comparison.conditions, strict=True)]
    return {"conditions": conditions, "verdicts": comparison.verdicts}


def _headline(findings: Findings) -> Iterator[str]:
    """What was heard, in a few sentences."""
    squeaks, record = findings.squeaks, findings.record
    heard = squeaks.of("squeak", "squeal")
    where = "" if squeaks.channel == "sound" else f" in the channel {squeaks.channel}"
    if not squeaks.bursts:
        clicks = f"{squeaks.clicks} click{'s' if squeaks.clicks > 1 else ''}"
        what = f"Nothing squeaks{where}: {clicks}, and" if squeaks.clicks else f"Nothing sounds{where}:"
        yield f"{what} no burst in {record.duration:.4g} s."
        yield from _power(squeaks)
        return
    creaks = [f"{burst.rate:.3g}" for burst in squeaks.of("creak")]
    if not heard and creaks:
        rates = f"stick-slip pulses, {' and '.join(creaks)} in a second{_by_sound_alone(findings)}"
        yield f"It {_likely(squeaks)}creaks{where}: {rates}."
    elif squeaks.answer == "can not be told":
        yield f"Whether it squeaks{where} can not be told: {_untold(squeaks)}."
        yield from _power(squeaks)
    elif not heard:
        kinds = [(squeaks.of(kind), label) for kind, label in WORDS.items()]
        yield f"No squeak{where}. {'; '.join(f'{_counted(of)}, {label}' for of, label in kinds if of)}."
        yield from _power(squeaks)
    else:
        many = f"{len(heard)} times in {record.duration:.3g} s" if len(heard) > 1 else "once"
        tone = squeaks.frequency.value
        pitch = f"at {number(tone, tone / 500, 'Hz')}{_by_sound_alone(findings)}"
        yield f"It {_likely(squeaks)}{squeaks.answer}{where} {many}, {pitch}."
    loudest = squeaks.loudest
    if loudest is not None:
        yield _of_one(loudest, squeaks)
    if findings.coupling is not None:
        yield _of_pairs(findings.coupling)
        yield from _of_energy(findings.coupling, torsion="torsion_velocity" in record)
    if findings.loops is not None:
        slope = findings.loops.slope
        trend = trend_of(slope)
        sure = f" {trend}" if trend in ("falls", "rises") else " can not be told to change"
        yield (
            f"Friction is {value_of(findings.loops.level)} and{sure} with speed: {value_of(slope)} ({_ends(slope)})."
        )


def _of_pairs(joined: Coupling) -> str:
    """What the squeak adds to how the channels move together."""
    pairs = [pair for pair in joined.pairs if not pair.tied]
    coupled, adding = [pair for pair in pairs if pair.coupled], [pair for pair in pairs if pair.adds]
    if not pairs:
        return "Of two channels of which one follows from the other no coupling can be told."
    if all(pair.added is None for pair in pairs):
        return (
            f"While it squeaks, {len(coupled)} of {len(pairs)} pairs of channels move together beyond chance; there is "
            "nothing outside to tell what of that the squeak adds."
        )
    if not adding:
        many = f"{len(coupled)} of {len(pairs)} pairs of channels move together beyond chance"
        return f"While it squeaks, {many}; that the squeak adds to any of them, against the rest, is not shown."
    most = max(adding, key=lambda pair: 0.0 if pair.added is None else pair.added.value)
    return (
        f"While it squeaks, {len(adding)} of {len(pairs)} pairs of channels move together more than outside, most of "
        f"all {_spoken_name(most.first)} and {_spoken_name(most.second)}: coherence {most.inside:.2f} against "
        f"{most.outside:.2f}."
    )


def _of_energy(joined: Coupling, *, torsion: bool) -> Iterator[str]:
    """Which motion friction feeds, where that is told."""
    fed = {"tangential vibration": joined.energy_per_cycle, "torsion": joined.energy_to_torsion}
    for motion, energy in fed.items():
        if energy is not None and not energy.includes(0.0):
            verb = "feeds" if energy.value > 0 else "damps"
            yield f"Friction {verb} the {motion}: {value_of(energy)} in each cycle of the squeak."
    if joined.energy_per_cycle is not None and joined.energy_per_cycle.includes(0.0):
        lever = "; what it gives the torsion is told where its distance from the axis is stated, as lever= in m"
        why = lever if torsion and joined.energy_to_torsion is None else ""
        yield f"Whether friction feeds or damps the tangential vibration can not be told{why}."


def _spoken_name(channel: str) -> str:
    """A channel's name as words."""
    return {"a": "acceleration"}.get(channel, channel.replace("_", " "))


def _untold(squeaks: Squeaks) -> str:
    """Of how many bursts it can not be told whether friction makes them: of tonal ones, where there are any."""
    tonal = [burst for burst in squeaks.untold if burst.kind == "tonal"]
    kind, undecided = ("tonal", len(tonal)) if tonal else ("broad", len(squeaks.untold))
    every = len(squeaks.of("tonal")) if tonal else undecided
    if every == undecided == 1:
        return f"one {kind} burst may be friction's, or not"
    if every == undecided:
        return f"each of {every} {kind} bursts may be friction's, or not"
    rest = "the other one is not" if every - undecided == 1 else f"the other {every - undecided} are not"
    return f"of {every} {kind} bursts {undecided} may be friction's, or not; {rest}"


def _likely(squeaks: Squeaks) -> str:
    """A word before the verb where nothing but the sound or the motion speaks for friction."""
    shown = any(burst.friction == "shown" for burst in squeaks.of("squeak", "squeal", "creak"))
    return "" if shown else "likely "


def _by_sound_alone(findings: Findings) -> str:
    """What else would sound alike, where no motion was recorded beside the sound."""
    alone = _likely(findings.squeaks) and {"x", "v"}.isdisjoint(findings.record)
    return ", if it is a contact that sounds: electronic tones and birds that glide sound alike" if alone else ""


def _power(squeaks: Squeaks) -> Iterator[str]:
    """How loud a squeak would have been heard, where no tone may be one."""
    if not math.isnan(squeaks.threshold) and not any(burst.kind == "tonal" for burst in squeaks.untold):
        yield f"A squeak of {squeaks.threshold:.0f} dB re {squeaks.reference} or more would have been heard."


def _of_one(burst: Squeak, squeaks: Squeaks) -> str:
    """The loudest burst in a sentence."""
    where = "" if math.isnan(burst.phase) else f", at {100 * burst.phase:.0f} % of the forcing cycle"
    speed = "" if math.isnan(burst.speed) else f" and {number(burst.speed, 1e-3, 'm/s')}"
    loudest = f"The loudest is {_level_of(burst, squeaks)}{where}{speed}"
    friction = {"shown": "friction makes it", "likely": "friction likely makes it"}.get(burst.friction)
    return f"{loudest}; {friction}: {burst.evidence}." if friction else f"{loudest}: {burst.evidence}."


def _level_of(burst: Squeak, squeaks: Squeaks) -> str:
    """The level with its reference, and weighted where that is known."""
    if math.isnan(burst.level):
        return "clipped, its level unknown"
    weighted = "" if math.isnan(burst.weighted_level) else f", {burst.weighted_level:.0f} dB(A)"
    return f"{burst.level:.1f} dB re {squeaks.reference}{weighted}"


def _counted(bursts: Sequence[Squeak]) -> str:
    return f"{len(bursts)} burst{'s' if len(bursts) > 1 else ''}"


def _cautions(findings: Findings) -> list[str]:
    """What should keep the reader from trusting it."""
    lines = list(findings.squeaks.cautions)
    if any(fault.kind == "spike" for fault in findings.faults):
        lines.append(
            "What stands off as a spike may be a contact that sticks, lifts or lands: look before it is replaced."
        )
    spoilt: dict[str, list[str]] = {}
    for place, burst in enumerate(findings.squeaks.bursts):
        for doubt in doubts_of(burst.status):
            spoilt.setdefault(doubt.words, []).append(str(place + 1))
    named = ((f"Burst{'s' if len(places) > 1 else ''} {', '.join(places)}", part) for part, places in spoilt.items())
    return lines + [f"{bursts}: {part}." for bursts, part in named]


def _tables(findings: Findings) -> Iterator[Table]:
    """The bursts, the channels, how it is heard, and what moves together."""
    bursts, joined = findings.squeaks.bursts, findings.coupling
    if bursts:
        more = f", the first {MOST}" if len(bursts) > MOST else ""
        title = f"{len(bursts)} burst{'s' if len(bursts) > 1 else ''}{more}, levels re {findings.squeaks.reference}"
        yield Table(title, *_burst_table(findings))
    if findings.beside:
        yield Table("In every channel that vibrates", *_channel_table(findings))
    if findings.quality is not None or findings.impulses is not None:
        yield Table("How it is heard", *_hearing_table(findings), _hearing_note(findings))
    if joined is not None:
        title = f"What moves together at {number(joined.frequency, 0.5, 'Hz')}"
        yield Table(title, *_coupling_table(joined), _coupling_note(joined))


def _burst_table(findings: Findings) -> tuple[Sequence[str], list[list[str]]]:
    """Headings and a row for each burst."""
    squeaks = findings.squeaks
    moves, calibrated = not math.isnan(squeaks.forcing), any(not math.isnan(b.weighted_level) for b in squeaks.bursts)
    headings = [
        "", "begins [s]", "lasts [s]", "kind", "Hz", "dB", *(["dB(A)"] if calibrated else []), "tonal",
        *(["phase", "m/s"] if moves else []), "friction",
    ]  # fmt: skip
    rows = []
    for place, burst in enumerate(squeaks.bursts[:MOST]):
        rate = "" if math.isnan(burst.rate) else f", {burst.rate:.3g} pulses in a second"
        rows.append([
            str(place + 1), f"{burst.start:.3f}", f"{burst.duration:.3f}", burst.kind + rate, f"{burst.frequency:.1f}",
            "clipped" if math.isnan(burst.level) else f"{burst.level:.1f}",
            *([_or_none(burst.weighted_level, ".1f")] if calibrated else []), f"{100 * burst.tonality:.0f} %",
            *([_or_none(burst.phase, ".2f"), _or_none(burst.speed, ".3f")] if moves else []), burst.friction,
        ])  # fmt: skip
    return headings, rows


def _channel_table(findings: Findings) -> tuple[Sequence[str], list[list[str]]]:
    """Headings and a row for each channel that vibrates."""
    rows = []
    for squeaks in (findings.squeaks, *findings.beside):
        heard = squeaks.of("squeak", "squeal")
        frequency = f"{np.median([burst.frequency for burst in heard]):.1f}" if heard else NONE
        levels = [burst.level for burst in heard or squeaks.bursts if not math.isnan(burst.level)]
        level = f"{max(levels):.1f} re {squeaks.reference}" if levels else NONE
        rows.append([squeaks.channel, squeaks.kind, str(len(heard)), frequency, level])
    return ["channel", "what it is", "squeaks", "Hz", "loudest, dB"], rows


def _hearing_table(findings: Findings) -> tuple[Sequence[str], list[list[str]]]:
    """Headings and a row for each measure of how it is heard."""
    rows, quality, impulses = [], findings.quality, findings.impulses
    if quality is not None:
        rows += [
            ["loudness N5", f"{quality.loudness:.3g} sone", "exceeded 5 % of the time; Zwicker, ISO 532-1, free field"],
            ["sharpness", f"{quality.sharpness:.3g} acum", "of the mean specific loudness; weighting of DIN 45692"],
            ["roughness", _or_none(quality.roughness, ".3g") + " asper", "Daniel and Weber, mean of windows of 0.2 s"],
        ]
    if impulses is not None:
        rows += [
            ["crest factor", f"{impulses.crest_factor:.3g}", "largest magnitude over RMS; 1.41 of a sine"],
            ["kurtosis", f"{impulses.kurtosis:.3g}", "3 of normal noise, 1.5 of a sine, large of pulses"],
            [
                "sharp pulses",
                _or_none(impulses.rate, ".3g") + " in a second of all",
                "in windows of 2 ms, 10 dB over the valleys beside: not all pulses of a creak are",
            ],
        ]
    return ["", "value", "what it is"], rows


def _hearing_note(findings: Findings) -> str:
    """By what, and that no conformity is claimed."""
    by = "" if findings.quality is None else f"Loudness, sharpness and roughness by {findings.quality.method}. "
    return f"{by}No conformity to a standard is claimed; the sharp pulses follow none."


def _coupling_table(joined: Coupling) -> tuple[Sequence[str], list[list[str]]]:
    """Headings and a row for each pair of channels: first those that the squeak adds to, last what is no coupling."""
    rest = any(pair.added is not None for pair in joined.pairs)
    headings = [
        "channels, the first leads", "coherence", *(["outside", "added (95 %)"] if rest else []), "phase", "later by"
    ]  # fmt: skip

    def order(pair: Pair) -> tuple[bool, bool, float]:
        return pair.tied, not pair.adds, 0.0 if pair.added is None else -pair.added.value

    return headings, [_pair(pair, rest=rest) for pair in sorted(joined.pairs, key=order)]


def _coupling_note(joined: Coupling) -> str:
    """How to read the table of pairs."""
    tied = (
        " Friction and acceleration of one mass go together by its inertia, m a = ... - f: that is no coupling."
        if any(pair.tied for pair in joined.pairs)
        else ""
    )
    half = (
        " At half a period it can not be told which leads: that is a sign, and no delay."
        if any(pair.delay is None for pair in joined.pairs)
        else ""
    )
    return (
        f"Compared: {joined.compared}. Channels that have nothing to do with each other have a coherence below "
        f"{joined.pairs[0].significant:.2f} in 95 of 100 cases. A tone has no beginning: which channel leads holds "
        f"within half a period, and is no cause.{half}{tied}"
    )


def _pair(pair: Pair, *, rest: bool) -> list[str]:
    sign = -1 if pair.leads == pair.second else 1
    first, second = (pair.second, pair.first) if sign < 0 else (pair.first, pair.second)
    cells = [f"{first}{' → ' if pair.leads != 'neither' else ', '}{second}", f"{pair.inside:.2f}"]
    if rest:
        low, high = pair.added.interval if pair.added is not None else (math.nan, math.nan)
        cells += [f"{pair.outside:.2f}", f"{round(low, 2) + 0.0:.2f} to {round(high, 2) + 0.0:.2f}"]
    if not pair.coupled:
        return [*cells, NONE, "by chance"]
    phase = f"{math.degrees(sign * pair.phase.value):.0f}°"
    if pair.delay is None:
        return [*cells, phase, "half a period"]
    delay, half = sign * pair.delay.value, (pair.delay.interval[1] - pair.delay.interval[0]) / 2
    factor, unit = prefixed(delay, "s")
    digits = decimals(factor * half, factor * delay)
    return [*cells, phase, f"{factor * delay:.{digits}f} ± {factor * half:.{digits}f} {unit}"]


def _condition_table(comparison: Comparison) -> tuple[Sequence[str], list[list[str]]]:
    """Headings and a row for each condition; a column that is known of none is left out."""
    headings = ["condition", "load", "driven, stroke", "friction", "slope against speed (95 %)", "heard", "Hz", "dB"]
    rows = [_condition(condition) for condition in comparison.conditions]
    known = [place for place in range(len(headings)) if any(row[place] != NONE for row in rows)]
    return [headings[place] for place in known], [[row[place] for place in known] for row in rows]


def _condition(condition: Condition) -> list[str]:
    forcing = "" if math.isnan(condition.forcing) else f"{condition.forcing:.3g} Hz"
    stroke = "" if math.isnan(condition.stroke) else f"±{number(condition.stroke, condition.stroke / 100, 'm')}"
    slope = NONE if condition.slope is None else f"{value_of(condition.slope)} ({_ends(condition.slope)})"
    return [
        condition.name, NONE if condition.normal is None else number(condition.normal.value, 0.0, "N"),
        ", ".join(part for part in (forcing, stroke) if part) or NONE, _value(condition.level), slope,
        _heard(condition),
        NONE if condition.frequency is None else f"{condition.frequency.value:.1f}", _or_none(condition.sound, ".1f"),
    ]  # fmt: skip


def _heard(condition: Condition) -> str:
    """Squeaks and their number, or what is heard instead."""
    if condition.squeaks:
        name = "squeal" if condition.answer == "squeals" else "squeak"
        return f"{condition.count} {name}{'s' * (condition.count > 1)} ({condition.rate:.2g} in a second)"
    if condition.answer == "creaks":
        return f"creak, {condition.pulses:.3g} pulses in a second"
    return "can not be told" if condition.answer == "can not be told" else f"no squeak ({condition.kind})"


def _ends(estimate: Estimate) -> str:
    """The interval without the unit, which stands beside the value."""
    return interval_of(estimate).removesuffix(value_of(estimate).lstrip("-.0123456789e"))


def _value(estimate: Estimate | None) -> str:
    return NONE if estimate is None else value_of(estimate)


def _or_none(value: float, form: str) -> str:
    return NONE if math.isnan(value) else f"{value:{form}}"
