"""What the page draws itself: the record with its model over it, cycle by cycle, and how to ask about a span."""

from __future__ import annotations

import base64
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.answers.findings import Findings
from stickslip.answers.mistakes import hopeless
from stickslip.arrays import Array
from stickslip.balance.motion import is_measured
from stickslip.consistent.checks import Slip
from stickslip.errors import StickslipError
from stickslip.figures.contact import across
from stickslip.figures.style import envelope
from stickslip.files.expression import shifted, split_gain, split_spec, times
from stickslip.printing import printable
from stickslip.record.record import RIG_UNITS, Record
from stickslip.rig.rig import Rig
from stickslip.rig.sensor import Digitiser, Noise, Sensor
from stickslip.rig.settings import READING
from stickslip.statistics import follows
from stickslip.twin.belief import Belief
from stickslip.units import prefixed, spelled

DETAILED = 270_000  # values that the page holds one by one, of all lines; else the least and the most of each column
COLUMNS = 1_500
LEVELS = 65_534  # of a value, in two bytes; one more is a gap
MOST_PANELS = 4
PANELS = ("x", "theta", "v", "a", "load", "force", "friction", "normal", "sound")
EXPLAINED = "inertia, viscous and dry friction"  # the model of a regression
MOVED_BY = ("x", "z", "force")  # channels whose gains an equation of motion compares
LEFT = "left"  # the line of what a model leaves
BESIDE = {"x": "z"}  # drawn in the same panel
HERE = "{here}"  # before the name of a file that lies beside the page, which knows its folder
ROWS = "--rows {first}:{last}"  # of a command, with the rows left open


@dataclass(frozen=True, eq=False)
class Panel:
    """A channel over time.

    Attributes
    ----------
    name, unit : str
        What it is, in SI.
    lines : mapping of str to ndarray
        "measured", "model", "left" and others by name, all of one length.
    """

    name: str
    unit: str
    lines: Mapping[str, Array]

    def packed(self, detail: slice) -> dict[str, Any]:
        """For the page, in a readable unit."""
        factor, unit = prefixed(next(iter(self.lines.values())), self.unit)
        model = self.lines.get("model")
        merit = None if model is None else follows(self.lines["measured"], model)
        lines = {name: _line(factor * values, detail) for name, values in self.lines.items()}
        return {"name": self.name, "unit": "" if unit == "1" else spelled(unit), "merit": merit, "lines": lines}


@dataclass(frozen=True, eq=False)
class Scope:
    """A record as the page draws it.

    Attributes
    ----------
    start, fs : float
        Time of the first sample [s], and samples a second.
    panels : sequence of Panel
        One under the other.
    model : str
        What the model is, in a few words; empty without one.
    across : Panel or None
        Displacement across the contact, which friction is drawn against; None where there are no cycles.
    cycles : array-like of float
        When cycles begin [s].
    period : float
        How long they last [s].
    command : str
        What asks about the rows from ``{first}`` to ``{last}`` again; empty where nothing can.
    first : int
        The file's row of the first sample.
    view : tuple of float or None
        From when to when it is shown at first [s]; None: some cycles of its middle.
    """

    start: float
    fs: float
    panels: Sequence[Panel]
    model: str = ""
    across: Panel | None = None
    cycles: Sequence[float] | Array = ()
    period: float = 0.0
    command: str = ""
    first: int = 0
    view: tuple[float, float] | None = None

    def packed(self) -> dict[str, Any]:
        """For the page: the whole as envelopes, and of a long record its middle in detail."""
        count = len(self.panels[0].lines["measured"])
        lines = sum(len(panel.lines) for panel in (*self.panels, *([self.across] if self.across else [])))
        most = DETAILED // lines
        middle = count // 2 if self.view is None else round((sum(self.view) / 2 - self.start) * self.fs)
        first = max(0, min(middle - most // 2, count - most))
        detail = slice(first, min(count, first + most))
        cycles = [round(float(cycle), 6) for cycle in self.cycles if self._within(cycle, detail)]
        return {
            "start": self.start, "fs": self.fs, "count": count, "detail": [detail.start, detail.stop],
            "panels": [panel.packed(detail) for panel in self.panels], "model": self.model,
            "across": None if self.across is None else self.across.packed(detail),
            "cycles": cycles, "period": self.period,
            "command": printable(self.command), "first": self.first, "view": self.view,
        }  # fmt: skip

    def _within(self, cycle: float, detail: slice) -> bool:
        """Whether a whole cycle lies in what is held in detail."""
        first, last = ((time - self.start) * self.fs for time in (cycle, cycle + self.period))
        return bool(detail.start - 0.5 < first and last < detail.stop + 0.5)


def _line(values: Array, detail: slice) -> dict[str, Any]:
    """A line in detail and as a whole, each value in two bytes."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    step = (high - low) / LEVELS or 1.0

    def coded(part: Array) -> str:
        known = np.isfinite(part)
        levels = np.where(known, np.round((np.where(known, part, low) - low) / step), LEVELS + 1)
        return base64.b64encode(levels.astype("<u2").tobytes()).decode("ascii")

    whole = len(values) > detail.stop - detail.start
    outline = coded(envelope(np.arange(float(len(values))), values, COLUMNS)[1]) if whole else ""
    return {"low": low, "step": step, "detail": coded(values[detail]), "whole": outline}


def of_findings(findings: Findings, file: str = "") -> Scope | None:
    """A record of friction, with its twin over it where it has one; None of a broken clock."""
    findings = findings.drawn
    record, trial, loops = findings.record, findings.trial, findings.loops
    if record.stamps is not None:
        return None
    twin = None if trial is None else _quiet_twin(trial.belief, len(record))
    panels, model = list(_panels(record, twin)), "" if trial is None or twin is None else trial.belief.called
    if not model and findings.regression is not None:
        panels, model = [_explained(panel, findings) for panel in panels], EXPLAINED
    moved, cycles, period = None, (), 0.0
    if loops is not None:
        moved = _moved(findings, twin)
        cycles, period = loops.cycles, 1 / loops.frequency.value
    stated = [*_stated(findings.settings)]
    command, first = command_of(record, "analyze", *stated) if not file else (_beside(file, stated), 0)
    return Scope(record.start, record.fs, panels, model, moved, cycles, period, command, first)


def _quiet_twin(belief: Belief, count: int) -> Record | None:
    """What the rig believed in would have written without noise, counts and chance, with its friction."""
    sensors = [replace(s, noise=Noise(), digitiser=Digitiser(limit=s.digitiser.limit)) for s in belief.rig.sensors]
    exact = {name: replace(channel, gain_sd=0.0) for name, channel in belief.record.channels.items()}
    record = replace(belief.record, channels=exact)
    try:
        quiet = replace(belief, record=record, rig=Rig((*sensors, Sensor("friction"))))
        twin = quiet.twin(np.random.default_rng(0))
    except StickslipError:
        return None
    if len(twin) != count:
        return None
    drift = belief.record["x"] - belief.moved - belief.residual  # of the sensor: it is not the rig's
    return twin.with_channel("x", twin["x"] + drift, unit="m")


def _panels(record: Record, twin: Record | None) -> Iterator[Panel]:
    """The channels that tell most; friction is one of them."""
    names = [name for name in PANELS if name in record and (name == "friction" or is_measured(record, name))]
    names = [name for name in names if name != "v" or "x" not in names]
    kept = [name for name in names if name != "friction"][: MOST_PANELS - ("friction" in names)]
    for name in [*kept, *(["friction"] if "friction" in names else [])] or list(record)[:1]:
        lines = {"measured": record[name]}
        if twin is not None and name in twin:
            lines["model"] = twin[name]
        beside = BESIDE.get(name, "")
        if beside in record:
            lines[beside] = record[beside]
        yield Panel(name, record.channels[name].unit, lines)


def _explained(panel: Panel, findings: Findings) -> Panel:
    """The force that a regression explains, over what was measured of it."""
    regression, time = findings.regression, findings.record.time
    if panel.name != regression.signal:
        return panel
    over = np.interp(time, regression.time, regression.explained, left=np.nan, right=np.nan)
    return replace(panel, lines={**panel.lines, "model": over})


def _moved(findings: Findings, twin: Record | None) -> Panel:
    """The displacement across the contact, which friction is drawn against."""
    lines = {"measured": across(findings, "displacement")}
    if twin is not None:
        slides_on = twin["z"] if findings.settings.get("contact") == "base" and "z" in twin else 0.0
        lines["model"] = twin["x"] - slides_on
    return Panel("displacement", findings.loops.unit, lines)


def of_fit(
    record: Record,
    fitted: Mapping[str, tuple[Array, Array]],
    question: Sequence[str],
    model: str,
    view: tuple[float, float] | None = None,
) -> Scope | None:
    """Channels, each with what was fitted to it and what is left, from `view` on; none of a broken clock."""
    if record.stamps is not None:
        return None
    panels = []
    for name, (time, values) in fitted.items():
        over = np.interp(record.time, time, values, left=np.nan, right=np.nan)
        unit = record.channels[name].unit
        panels += [
            Panel(name, unit, {"measured": record[name], "model": over}),
            Panel(f"{name}, measured less model", unit, {LEFT: record[name] - over}),
        ]
    command, first = command_of(record, *question)
    return Scope(record.start, record.fs, panels, model, command=command, first=first, view=view)


def of_run(record: Record, period: float, view: tuple[float, float], constants: Mapping[str, Any], file: str) -> Scope:
    """A simulated motion as a record, that `file` holds too, with its cycles."""
    moved = None
    if "x" in record and "friction" in record:
        base = record["z"] if constants.get("contact") == "base" and "z" in record else 0.0
        moved = Panel("displacement", record.channels["x"].unit, {"measured": record["x"] - base})
    cycles = np.arange(view[0], min(view[1], record.start + record.duration - period), period)
    command = _beside(file, [*_stated(constants)])
    return Scope(record.start, record.fs, list(_panels(record, None)), "", moved, cycles, period, command, view=view)


def _beside(file: str, options: Sequence[str]) -> str:
    """What asks about rows of a record in a file beside the page."""
    return f"{shlex.join(['stickslip', 'analyze', HERE + file, *options])} {ROWS}"


def command_of(record: Record, question: str, *options: str) -> tuple[str, int]:
    """What asks a question about some rows of the record again, and the file's row of the first sample.

    Empty of a record that came from no file, or from several that were read one by one.
    """
    command = _command(record, question, options)
    return (f"{shlex.join(command)} {ROWS}", _read(record).get("rows", (0,))[0] or 0) if command else ("", 0)


def corrected(
    findings: Findings, slips: Iterable[Slip], question: str = "analyze", options: Sequence[str] = ()
) -> list[str]:
    """The commands that ask again, each without one of the slips of the hand that would explain it alike."""
    commands = (_corrected(findings, slip, question, options) for slip in slips)
    return list(filter(None, dict.fromkeys(commands)))


def _corrected(findings: Findings, slip: Slip, question: str, options: Sequence[str]) -> str:
    """The command that asks again, without a slip of the hand; empty where none can."""
    record, settings = findings.record, dict(findings.settings)
    read = dict(_read(record))
    channels: dict[str, str] = dict(read.get("channels") or _sources(record))
    if slip == Slip(slip.words) or not channels.keys() >= {*slip.zeros, *(of for of, _ in slip.cure.values())}:
        return ""
    # of two that were exchanged each keeps its unit; a channel that there was not is read from the other's column
    cured = {
        name: times(channels[of], by, unit=split_spec(channels.get(name, channels[of])).unit)
        for name, (of, by) in slip.cure.items()
    }
    renamed = {of for name, (of, _) in slip.cure.items() if name not in channels}
    channels = {name: text for name, text in channels.items() if name not in renamed}
    cured |= {name: shifted(channels[name], off, name) for name, off in slip.zeros.items()}
    if not all(cured.values()):
        return ""
    if slip.unsure:
        cured |= {name: _unsure(channels[name], slip.unsure) for name in MOVED_BY if name in channels}
        sd = dict(settings.get("sd") or {})
        least = {name: slip.unsure * settings[name] for name in ("mass", "stiffness") if settings.get(name)}
        settings["sd"] = sd | {name: max(spread, sd.get(name, 0.0)) for name, spread in least.items()}
    if cured:
        read["channels"] = {**channels, **cured}
    if slip.clock != 1:
        read |= {"fs": record.fs / slip.clock, "time": None}
    settings |= {name: by * settings[name] for name, by in slip.constants.items() if name in settings}
    sensors = {name: dict(stated) for name, stated in settings.get("sensors", {}).items()}
    for name, late in slip.delays.items():
        sensors.setdefault(name, {})["delay"] = late
    return _again(findings, question, read, {**settings, "sensors": sensors}, options)


def _unsure(spec: str, share: float) -> str:
    """A channel's column with a gain that is unsure by a share at least.

    Examples
    --------
    >>> _unsure("disp [mm]", 0.01), _unsure("disp [mm] ± 5 %", 0.01)
    ('disp [mm] ± 1 %', 'disp [mm] ± 5 %')
    """
    column, stated = split_gain(spec)
    return f"{column.strip()} ± {100 * max(share, stated):g} %"


def completed(findings: Findings, question: str = "analyze", options: Sequence[str] = ()) -> list[str]:
    """The command that asks again with what was not stated: a constant left to fill in, a unit as it was read.

    Where the channels contradict each other as they were read, their units are to be filled in, too.
    """
    record, read, wrong = findings.record, dict(_read(findings.record)), hopeless(findings.results.get("consistency"))
    assumed = {name: "UNIT" if wrong else channel.unit for name, channel in record.channels.items() if channel.assumed}
    if assumed:
        read["units"] = {**read.get("units", {}), **assumed}
    clock = next((file["seconds"] for file in read.get("files", ()) if file.get("seconds")), "")
    if clock and not read.get("fs"):
        read["time"] = f"{clock} [s]"
    lacking = findings.results.get("lacking", ())
    missing = [word for name in lacking for word in (f"--{name}", f"VALUE {RIG_UNITS[name]}")]
    if not (missing or assumed or clock):
        return []
    return list(filter(None, [_again(findings, question, read, findings.settings, (*options, *missing))]))


def _again(
    findings: Findings, question: str, read: Mapping[str, Any], settings: Mapping[str, Any], options: Sequence[str]
) -> str:
    command = _command(findings.record, question, (*_stated(settings), *_loaded(findings), *options), read)
    rows = read.get("rows")
    if command and rows:
        command += ["--rows", ":".join("" if row is None else str(row) for row in rows)]
    return shlex.join(command)


def _loaded(findings: Findings) -> Iterator[str]:
    """The normal load, where it was stated."""
    load = findings.normal
    if load is not None and "normal" not in findings.record:
        yield from ("--normal", f"{load.value:.12g}" + (f" ± {load.sd:.12g} N" if load.sd else ""))


def _sources(record: Record) -> dict[str, str]:
    """The columns that channels were read from, where the command named none."""
    sources = {name: channel.column for name, channel in record.channels.items()}
    return {name: source for name, source in sources.items() if source and is_measured(record, name)}


def _read(record: Record) -> Mapping[str, Any]:
    """The arguments by which the record was read, once; none of another record."""
    reads = [step.arguments for step in record.history if step.arguments.get("files")]
    return reads[0] if len(reads) == 1 else {}


def reading_of(record: Record) -> dict[str, Any]:
    """The options by which the record was read."""
    read = _read(record)
    return {option: read[option] for option in READING if read.get(option) is not None}


def _command(record: Record, question: str, options: Sequence[str], read: Mapping[str, Any] | None = None) -> list[str]:
    """The words of a command about the record's file, `read` otherwise where that is given."""
    read = _read(record) if read is None else read
    if not read.get("files"):
        return []
    places = [f"{file['folder']}/{file['name']}" if "folder" in file else file["name"] for file in read["files"]]
    command = ["stickslip", question, "+".join(places)]
    for option in READING:
        stated = read.get(option)
        if isinstance(stated, Mapping):
            command += [word for name, value in stated.items() for word in (f"--{option}", f"{name}={value}")]
        elif stated is not None:
            command += [f"--{option}", f"{stated:.12g}" if isinstance(stated, float) else str(stated)]
    repairs = [step.repair for step in record.history if step.repair]
    command += ["--repair", ",".join(dict.fromkeys(repairs))] if repairs else []
    return [*command, *options]


def _stated(constants: Mapping[str, Any]) -> Iterator[str]:
    """The options that state a rig; where a damper or a contact ends is said where it is not the ground."""
    sd = constants.get("sd") or {}
    for key, unit in RIG_UNITS.items():
        if constants.get(key):
            sure = f" ± {sd[key]:.12g} {unit}" if sd.get(key) else ""
            yield from (f"--{key}", f"{constants[key]:.12g}{sure}")
    for key in ("damper", "contact"):
        if constants.get(key) == "base":
            yield from (f"--{key}", "base")
    for channel, stated in (constants.get("sensors") or {}).items():
        for key, value in stated.items():
            text = ", ".join(map(str, value)) if isinstance(value, (tuple, list)) else f"{value:.12g}"
            yield from ("--sensor", f"{channel}.{key}={text}")
