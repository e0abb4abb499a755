"""A simulated run, told: sentences, quantities, the events; and what its folder holds beside."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip import scenarios
from stickslip.errors import ModelError
from stickslip.figures.style import Plate
from stickslip.figures.trajectory import (
    animate,
    contacts_of,
    cycle_of,
    last_cycles,
    numbered_words,
    period_of,
    plates_of,
    pressed,
    require_writer,
    sampled,
    stretches,
)
from stickslip.files.write import require_form, write_record
from stickslip.laws.formula import Formula
from stickslip.oscillator import Structure
from stickslip.parameters import PARTS
from stickslip.record.record import RIG_UNITS
from stickslip.solve.curved import CurvedTrajectory
from stickslip.solve.energies import energy
from stickslip.solve.simulate import simulate
from stickslip.solve.tables import Tables
from stickslip.solve.trajectory import Event, Trajectory
from stickslip.squeak.sound import sound_pressure, squeak_record
from stickslip.squeak.spectra import write_sound
from stickslip.story.folder import check_folder
from stickslip.story.scope import Scope
from stickslip.story.scope import of_run as of_motion
from stickslip.story.story import Story, Table, listed
from stickslip.systems.file import Case
from stickslip.units import prefixed

A_PERIOD = 200  # samples of the record in the shortest period of drive, system or contact
MOST_ROWS = 200_000  # of a record whose rate was not asked for
REFUSED_ROWS = 100_000_000
MOST_PIECES = 200_000  # of a run whose energy is integrated: beyond, it takes longer than the run
MOST_TOLD = 10_000  # events in JSON; events.csv has them all
SHOWN_EVENTS = 12
MOST_NAMED = 4  # masses in a sentence
KINDS = ("slip", "microstick", "stick", "flight")
TANGENTIAL_NORMAL_TORSIONAL = 3  # displacements of a squeak rig
LOOKED_CYCLES = 8  # of a run, at first
COUNTED_CYCLES = 4  # the last ones, over which sticks are counted
LOOKED = 100_000  # samples of a run that is looked at without a record
HEARD = 10_000.0  # Hz of a sound whose rate was not asked for
PEAKS = 4001  # instants looked at for the largest values of the last cycle


@dataclasses.dataclass(frozen=True)
class Outcome:
    """A run and what is told of it.

    Attributes
    ----------
    case : Case
        What was run.
    run : Trajectory
        The motion.
    sentences : tuple of str
        What happened, in words.
    values : mapping of str to (float, str)
        Quantities with their SI units.
    known : mapping of str to mapping
        Of a scenario as it is named: the answers "known" and "found".
    """

    case: Case
    run: Trajectory
    sentences: tuple[str, ...]
    values: Mapping[str, tuple[float, str]]
    known: Mapping[str, Mapping[str, Any]]

    @property
    def rows(self) -> list[tuple[str, str]]:
        """The quantities as text, in readable units."""
        return [(name, _text(value, unit)) for name, (value, unit) in self.values.items()]

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: SI numbers, None where a number does not exist."""
        system = self.case.system
        counts = self.run.event_counts()
        return {
            "name": self.case.name,
            "about": self.case.about,
            "status": self.run.status,
            "system": {"name": type(system).__name__, **_fields(system, without=PARTS)},
            **{part: _described(getattr(system, part)) for part in PARTS if hasattr(system, part)},
            "start": dict(self.case.start),
            "run": dict(self.case.run),
            "quantities": [
                {"name": name, "value": _plain(value), "unit": unit} for name, (value, unit) in self.values.items()
            ],
            "known_answers": _plain(self.known),
            "event_count": counts.total(),
            "events": [_event_data(event) for event in itertools.islice(self.run.each_event(), MOST_TOLD)],
        }


def of_run(run: Trajectory) -> Story:
    """A run by itself: its figures."""
    return Story(
        "Run", draw=lambda: plates_of(run), look=lambda: _scope(run, min(default_rate(run), LOOKED / run.duration))
    )


def of_outcome(
    result: Outcome,
    *,
    fs: float | None = None,
    form: str = "csv",
    animation: str | None = None,
    sound: bool = False,
    tell: Callable[[str, float], None] = lambda stage, done: None,
) -> Story:
    """A run and what happened; its folder holds the events and the sampled record too.

    The record is sampled at `fs` [Hz], that of the case, or one fine enough for the motion, and written in `form`. A
    moving picture ("gif", "mp4") and the sound, of a squeak rig with the record of its sensors, come on top. `tell` is
    called before each part of the work with a few words and how many parts are done; the run counts as one.
    """
    run, case = result.run, result.case
    _require_record(case, fs, form, animation)
    rate = fs or case.fs or default_rate(run)

    def draw() -> tuple[Plate, ...]:
        tell("drawing the figures", 1)
        return plates_of(run)

    def write(folder: Path) -> None:
        tell("writing the record", 2)
        write_record(run.record(fs=rate), folder / f"record.{form}")
        _write_events(run, folder / "events.csv")
        if animation is not None:
            animate(run, folder / f"animation.{animation}", tell=lambda n, of: tell("animating", 3 + n / of))
        if sound:
            _write_sound(run, folder, fs or case.fs or HEARD, form)

    return Story(
        f"{case.name}  {case.about}".rstrip(),
        result.sentences,
        tables=list(_tables(result)),
        draw=draw,
        data=lambda: {**result.to_dict(), "fs": rate},
        write=write,
        look=lambda: _scope(run, rate, f"record.{form}"),
    )


def _scope(run: Trajectory, rate: float, file: str = "record.csv") -> Scope:
    """The motion as its record has it; of a structure its masses over time."""
    system = run.system
    constants = {key: getattr(system, key) for key in (*RIG_UNITS, "damper", "contact") if hasattr(system, key)}
    alone = {} if isinstance(system, Structure) else constants
    return of_motion(run.record(fs=rate), cycle_of(run), last_cycles(run, LOOKED_CYCLES), alone, file)


def _answer(value: Any) -> str:
    """To the digits that are compared; results.json has all."""
    if isinstance(value, (list, tuple)):
        return ", ".join(map(_answer, value))
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _tables(result: Outcome) -> Iterator[Table]:
    """The quantities, the known answers and the first events."""
    yield Table("Quantities", ("quantity", "value"), result.rows)
    if result.known:
        answers = [(name, _answer(pair["known"]), _answer(pair["found"])) for name, pair in result.known.items()]
        yield Table("Known of this scenario, and what the engine finds", ("answer", "known", "found"), answers)
    count, events = result.run.event_counts().total(), list(itertools.islice(result.run.each_event(), SHOWN_EVENTS))
    if events:
        several = any(event.contact for event in events)
        rows = [
            (f"{event.time:.9g}", event.kind, *([str(event.contact + 1)] if several else []), event.mode)
            for event in events
        ]
        headings = ("time [s]", "event", *(["contact"] if several else []), "mode that begins")
        more = f"... and {count - len(rows)} more: events.csv, in a folder of results, has all." * (count > len(rows))
        yield Table("Events", headings, rows, more)


def outcome(case: Case, *, progress: Callable[[float], object] | None = None) -> Outcome:
    """Run a case, and say what happened.

    Parameters
    ----------
    case : Case
        As :func:`read_system` or :func:`scenario_case` gives it.
    progress : callable, optional
        Called now and then with the share of the time that is simulated, as in :func:`simulate`.

    Returns
    -------
    Outcome

    Raises
    ------
    SolveError
        The run can not go on, or can not be trusted.
    ModelError
        The run has no length.

    Examples
    --------
    >>> from stickslip.systems.file import scenario_case
    >>> outcome(scenario_case("FD-4")).sentences[0]
    'The mass comes to rest after 3.142 s, at a displacement of 250 mm.'
    """
    run = simulate(case.system, start=case.start, progress=progress, **case.run)  # type: ignore[arg-type]
    answers: Mapping[str, Any] = {}
    if case.known and run.status != "interrupted":
        scenario = scenarios.get(case.name)
        answers = scenarios.answers(scenario, run=run if case.run == scenario.run else None)
    known = {question: {"known": case.known[question], "found": answers[question]} for question in answers}
    values = _values(run)
    return Outcome(case, run, tuple(_sentences(run, values)), values, known)


def default_rate(run: Trajectory) -> float:
    """A sampling rate [Hz] that shows the fastest of drive, system and contact, on a round number."""
    tones = (tone[2] / (2 * math.pi) for tone in run.table.motion.tones)
    fastest = max((1 / cycle_of(run), *tones, _fastest_contact(run) / 8))
    wanted = A_PERIOD * fastest
    size = 10.0 ** math.floor(math.log10(wanted))
    rate = next(step * size for step in (1, 2, 5, 10) if step * size >= wanted * (1 - 1e-9))
    return min(rate, MOST_ROWS / run.duration)


def _write_sound(run: Trajectory, folder: Path, fs: float, form: str) -> None:
    """The sound as a WAV; of a squeak rig, as its sensors would have written it, with their record."""
    if isinstance(run.system, Structure) and run.system.size == TANGENTIAL_NORMAL_TORSIONAL and run.table.motion.base:
        heard = squeak_record(run, fs=fs)
        write_record(heard, folder / f"sensors.{form}")
    else:
        heard = sound_pressure(run, fs=fs)
    write_sound(heard, folder / "sound.wav")


def _write_events(run: Trajectory, path: Path) -> None:
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(["time [s]", *Event._fields[1:]]) + "\n")
        file.writelines(",".join(map(str, _event_data(event).values())) + "\n" for event in run.each_event())


def _event_data(event: Event) -> dict[str, Any]:
    """An event for readers: contacts are counted from 1, as in a system's file."""
    return {**event._asdict(), "contact": event.contact + 1}


def require_output(
    case: Case, *, folder: str | Path, fs: float | None = None, form: str = "csv", animation: str | None = None
) -> None:
    """Refuse, before a case is run, what :func:`publish` could not write after it.

    Parameters
    ----------
    case : Case
        What is to be run.
    folder, fs, form, animation
        Where it goes, the record's sampling rate [Hz] and format, and the moving picture's.

    Raises
    ------
    ModelError
        A format is not known, the record would be too long, or the folder holds something that is not ours.

    Examples
    --------
    >>> from stickslip.systems.file import scenario_case
    >>> require_output(scenario_case("FD-4"), folder="decay", form="h5")
    """
    _require_record(case, fs, form, animation)
    check_folder(Path(folder))


def _require_record(case: Case, fs: float | None, form: str, animation: str | None) -> None:
    require_form(form)
    if animation is not None:
        require_writer(f".{animation}")
    rate = fs or case.fs
    if rate is not None and not (math.isfinite(rate) and rate > 0 and rate * case.duration <= REFUSED_ROWS):
        raise ModelError(
            f"fs = {rate:g} Hz over {case.duration:g} s",
            f"a record has at most {REFUSED_ROWS:g} rows, at a positive rate",
            "give a lower --fs or a shorter run",
        )


def _values(run: Trajectory) -> dict[str, tuple[float, str]]:
    first, last = last_cycles(run, 1)
    times = np.linspace(first, last, PEAKS)
    values = {
        "simulated time": (run.duration, "s"),
        "cycles": (run.duration / period_of(run), "1"),
        "events": (float(run.event_counts().total()), "1"),
        **_shares(run),
    }
    for j in range(len(run.labels("x"))):
        x, v = sampled(run, (("x", j), ("v", j)), times)
        path, speed, units = *_ways(run, j), (run.units("x")[j], run.units("v")[j])
        values[f"{path}, from"] = (float(x.min()), units[0])
        values[f"{path}, to"] = (float(x.max()), units[0])
        values[f"largest {speed}"] = (float(np.abs(v).max()), units[1])
    for c in range(contacts_of(run)):
        if pressed(run, c):
            (load,) = sampled(run, (("load", c),), times)
            label = numbered_words(run, "normal load", "load", c)
            values[f"{label}, from"], values[f"{label}, to"] = (float(load.min()), "N"), (float(load.max()), "N")
    if len(run.modes) <= MOST_PIECES and isinstance(run.table, Tables):  # a closed form to integrate
        work = energy(run)
        values["work against friction"] = (work.friction, "J")
        values["energy unaccounted for, relative"] = (work.residual, "1")
    return values


def _ways(run: Trajectory, row: int) -> tuple[str, str]:
    """What a degree of freedom's displacement and speed are called."""
    turns = run.units("x")[row] == "rad"
    names = ("angle", "angular speed") if turns else ("displacement", "speed")
    return numbered_words(run, names[0], "x", row), numbered_words(run, names[1], "v", row)


def _shares(run: Trajectory) -> dict[str, tuple[float, str]]:
    """How the time is shared by what each contact does."""
    shares: dict[str, tuple[float, str]] = {}
    for contact in range(contacts_of(run)):
        spent = run.shares(contact)
        for kind in [kind for kind in KINDS if kind in spent]:
            shares[numbered_words(run, f"share of time in {kind}", "friction", contact)] = (spent[kind], "1")
    return shares


def _sentences(run: Trajectory, values: Mapping[str, tuple[float, str]]) -> list[str]:
    sentences = []
    masses = run.labels("x")
    if run.status == "interrupted":
        sentences.append(f"Interrupted: the run holds the {_text(run.duration, 's')} simulated until then.")
    if run.status == "at rest":
        state, after = run.state(run.duration), _text(float(run.starts[-1]), "s")
        places = [
            f"{_text(float(state[name]), unit)}{f' of {name}' if len(masses) > 1 else ''}"
            for name, unit in zip(masses, run.units("x"), strict=True)
        ]
        subject = "The mass comes" if len(masses) == 1 else "All masses come"
        sentences.append(f"{subject} to rest after {after}, at a displacement of {_listed(places)}.")
    else:
        sentences += [holding(run)] if len(masses) == contacts_of(run) == 1 else []
        ways = []
        for j, name in enumerate(masses):
            place, _ = _ways(run, j)
            low, high = (_text(*values[f"{place}, {end}"]) for end in ("from", "to"))
            ways.append(f"{'the mass moves' if len(masses) == 1 else name} between {low} and {high}")
        speeds: dict[str, float] = {}
        for j in range(len(masses)):
            speed, unit = values[f"largest {_ways(run, j)[1]}"]
            speeds[unit] = max(speed, speeds.get(unit, 0.0))
        fastest = " and ".join(_text(speed, unit) for unit, speed in speeds.items())
        verb = "" if len(masses) == 1 else "the masses move: "
        sentences.append(f"In the last cycle {verb}{_listed(ways)}, at up to {fastest}.")
    counts = run.event_counts()
    if counts:
        counted = ", ".join(f"{count} × {kind}" for kind, count in counts.most_common())
        subject = "the contact changes" if contacts_of(run) == 1 else "the contacts change"
        sentences.append(f"On the way {subject} {counts.total()} times: {counted}.")
    elif len(run.modes) == 1 and contacts_of(run):
        sentences.append(
            "The contact never changes its mode." if contacts_of(run) == 1 else "No contact changes its mode."
        )
    return sentences


def holding(run: Trajectory) -> str:
    """How often in a cycle a single contact holds, and for which share of the time, over the last cycles."""
    cycle = cycle_of(run)
    cycles = max(1, min(COUNTED_CYCLES, int(run.duration / cycle * (1 + 1e-9))))
    first, holds = run.duration - cycles * cycle, []
    late = f"In the last {f'{cycles} cycles' if cycles > 1 else 'cycle'} t" if first > 1e-9 * cycle else "T"
    span = "a cycle" if cycle == period_of(run) else f"in {_text(run.duration, 's')}"
    for kind, verb in (("stick", "sticks"), ("microstick", "holds, giving a little,"), ("flight", "lifts off")):
        spans = stretches(run, kind, first=first, last=run.duration)
        if not len(spans):
            continue
        begins = spans[1:, 0] - spans[:-1].sum(axis=1) > 1e-9 * cycle  # parts of one stretch follow without a gap
        cut = spans[0, 0] <= first and spans[-1].sum() >= run.duration * (1 - 1e-12) and begins.any()
        count = (1 + int(begins.sum()) - bool(cut)) / cycles
        often = {1.0: "once", 2.0: "twice"}.get(count, f"{count:.2g} times")
        share = float(spans[:, 1].sum()) / (cycles * cycle)
        part = f"{verb} {often} {span}, {100 * share:.2g} % of the time"
        holds.append(part if share < 1 - 1e-9 else f"{verb} throughout")
    return f"{late}he mass {_listed(holds) if holds else 'slides without a stop'}."


def _listed(parts: Sequence[str]) -> str:
    shown = [*parts[:MOST_NAMED], *([f"{len(parts) - MOST_NAMED} more"] if len(parts) > MOST_NAMED else [])]
    return listed(shown)


def _fastest_contact(run: Trajectory) -> float:
    """The highest frequency at which a mode rings [Hz]; under a curved law, as its steps tell."""
    if isinstance(run, CurvedTrajectory):
        return 1 / (2 * math.pi * float(np.median(run.steps.lengths)))
    return max(float(np.abs(np.linalg.eigvals(flow).imag).max()) for flow in run.table.flow) / (2 * math.pi)


def _described(thing: Any) -> Any:
    """A part of a system by its name and values; several parts, each."""
    if isinstance(thing, Sequence):
        return [_described(part) for part in thing]
    return {"name": type(thing).__name__, **_fields(thing)}


def _fields(thing: Any, *, without: Sequence[str] = ()) -> dict[str, Any]:
    values = {f.name: getattr(thing, f.name) for f in dataclasses.fields(thing) if f.name not in without}
    return {name: _plain(np.size(value) if name == "samples" else value) for name, value in values.items()}


def _plain(value: Any) -> Any:
    """A value as JSON has it."""
    if isinstance(value, Formula):
        return value.text
    if dataclasses.is_dataclass(value):
        return _described(value)
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(inner) for inner in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value if isinstance(value, str | int | None) else repr(value)


def _text(value: float, unit: str) -> str:
    """Four figures in a readable unit."""
    if not math.isfinite(value):
        return "unknown"
    factor, text = prefixed(value, unit)
    shown = factor * value
    figures = f"{shown:.4g}" if abs(shown) < 1e4 else f"{shown:.0f}" if abs(shown) < 1e9 else f"{shown:.3e}"
    return figures if text == "1" else f"{figures} {text}"
