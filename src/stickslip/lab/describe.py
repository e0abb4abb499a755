"""What a page shows of records before anything is asked of them, and what it must ask a person."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip.lab.asked import AS_WRITTEN, PART, Asked, on_the_page

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.record import Fault

Array = NDArray[np.float64]

POINTS = 2000  # pairs of least and greatest value of a channel that are drawn
MOTION, FORCES = {"x", "v"}, {"friction", "load", "force"}
CONSTANTS = ("mass", "stiffness", "damping")
UNTOLD = " (no unit stated, "  # how a channel's source tells it
_REPAIRS = {
    "repair_clock": "clock", "fill_gaps": "gaps", "fill_missing": "missing", "remove_spikes": "spikes",
    "restore_clipped": "clipping", "remove_drift": "drift",
}  # fmt: skip


def describe(asked: Asked) -> dict[str, Any]:
    """The channels, rate and faults of each record, and of each question what a person must still tell."""
    records, missing = [], []
    for number in range(len(asked.records)):
        asked.say(f"reading {asked.name(number)}", number / len(asked.records))
        told, needs = _one(asked, number)
        records.append(told)
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
    return {
        "analyze": _question(
            moves or forces,
            motion,
            needs=[] if measured or not moves else rig,
            may=[*rig, "damping", "damper", "contact", "normal"],
        ),
        "decay": _question(
            bool(channels & {"x", "theta", "v", "a"}), "name x, theta, v or a among the channels", may=rig
        ),
        "wavelet": _question(records == 1, "one record is mapped at a time", may=["frequencies", *rig]),
        "squeak": _question(True, may=["frequencies", "normal"]),
        "fit": _question(
            moves or felt,
            motion,
            needs=[] if felt and "x" not in channels else rig,
            may=["damping", "damper", "contact", "laws", "curve"],
        ),
    }


def _question(able: bool, why: str = "", *, needs: Sequence[str] = (), may: Sequence[str] = ()) -> dict[str, Any]:
    return {
        "able": able,
        "why": "" if able else why,
        "needs": list(needs),
        "may": [name for name in may if name not in needs],
    }


def _one(asked: Asked, number: int) -> tuple[dict[str, Any], list[str]]:
    """A record as the page shows it, and what reading it still needs."""
    try:
        return shown(asked.name(number), asked.parts(number)), []
    except ss.errors.RecordError as error:
        if asked.reading.get("fs") or error.kind != ss.errors.NO_RATE:
            raise
        guess = Asked(asked.records, asked.names, {**asked.reading, "fs": 1.0}, asked.options, asked.say)
        told = shown(asked.name(number), guess.parts(number))
        return {**told, "fs": None, "duration": None, "asks": on_the_page(str(error))}, ["fs"]


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
    restored = first.history[-1].outcome == AS_WRITTEN
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
                "column": channel.name if restored else channel.source.partition(UNTOLD)[0] or channel.name,
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
    found = re.search(rf"\b({'|'.join(_REPAIRS)})\(record", fault.message)
    repair = _REPAIRS[found[1]] if found else ""
    return {"message": on_the_page(fault.message), "severity": fault.severity, "repair": repair}


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
        while -(-self._total // self.width) > POINTS and self.width < PART:
            self.width *= 2
            for name, held in self._kept.items():
                self._kept[name] = [_halved(np.concatenate(held))]

    def rows(self) -> Array:
        """The row of each value of :meth:`curves`: two in each stretch."""
        starts = np.arange(0, self._total, self.width, dtype=np.float64)
        ends = np.minimum(starts + self.width, self._total)
        return np.column_stack([starts, (starts + ends) / 2]).ravel() if self.width > 1 else starts

    def curves(self) -> dict[str, Array]:
        """The values of each channel, least and greatest in turn."""
        return {
            name: np.concatenate(held).ravel() if self.width > 1 else np.concatenate(held)[:, 0]
            for name, held in self._kept.items()
        }


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
    return {
        "record": record,
        "channel": channel,
        "unit": unit,
        "time": numbers(time),
        "measured": numbers(measured),
        "fitted": numbers(fitted),
    }


def numbers(values: Iterable[float]) -> list[float | None]:
    """For JSON, with the digits that a screen shows."""
    return [plain(value) for value in values]


def plain(value: float) -> float | None:
    return float(f"{value:.7g}") if math.isfinite(value) else None
