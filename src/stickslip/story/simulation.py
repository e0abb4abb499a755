"""What is told of a simulated run: sentences, a table, the events; and the folder that holds it all."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip import scenarios
from stickslip.errors import ModelError
from stickslip.files.write import WRITERS, write_record
from stickslip.laws.formula import Formula
from stickslip.parameters import PARTS
from stickslip.plot.plate import drawable
from stickslip.plot.trajectory import (
    contacts_of,
    cycle_of,
    kinds_of,
    last_cycles,
    numbered_words,
    period_of,
    plates_of,
    pressed,
    sampled,
)  # fmt: skip
from stickslip.solve.curved import CurvedTrajectory
from stickslip.solve.energies import energy
from stickslip.solve.simulate import simulate
from stickslip.solve.tables import Tables
from stickslip.solve.trajectory import Event, Trajectory
from stickslip.squeak.listening import write_sound
from stickslip.squeak.sound import sound_pressure, squeak_record
from stickslip.story.folder import check_folder, results_folder, write_figures
from stickslip.story.story import Story
from stickslip.structure import Structure
from stickslip.systems.file import Case
from stickslip.units import prefixed

A_PERIOD = 200  # samples of the record in the shortest period of drive, system or contact
MOST_ROWS = 200_000  # of a record whose rate was not asked for
REFUSED_ROWS = 100_000_000
MOST_PIECES = 200_000  # of a run whose energy is integrated: beyond, it takes longer than the run
MOST_TOLD = 10_000  # events in JSON; events.csv has them all
MOST_NAMED = 4  # masses in a sentence
KINDS = ("slip", "microstick", "stick", "flight")
TANGENTIAL_NORMAL_TORSIONAL = 3  # displacements of a squeak rig
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
            "events": [_told(event) for event in itertools.islice(self.run.each_event(), MOST_TOLD)],
        }


def of_run(run: Trajectory) -> Story:
    """A run by itself: its figures."""
    return Story("Run", draw=lambda: plates_of(run))


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
    found: Mapping[str, Any] = {}
    if case.known and run.status != "interrupted":
        scenario = scenarios.get(case.name)
        found = scenarios.answers(scenario, run=run if case.run == scenario.run else None)
    known = {question: {"known": case.known[question], "found": found[question]} for question in found}
    values = _values(run)
    return Outcome(case, run, tuple(_sentences(run, values)), values, known)


def default_rate(run: Trajectory) -> float:
    """A sampling rate [Hz] that shows the fastest of drive, system and contact, on a round number."""
    fastest = max(
        (1 / cycle_of(run), *(tone[2] / (2 * math.pi) for tone in run.table.motion.tones), _fastest_contact(run) / 8)
    )
    wanted = A_PERIOD * fastest
    size = 10.0 ** math.floor(math.log10(wanted))
    rate = next(step * size for step in (1, 2, 5, 10) if step * size >= wanted * (1 - 1e-9))
    return min(rate, MOST_ROWS / run.duration)


def publish_run(
    result: Outcome,
    *,
    folder: str | Path,
    fs: float | None = None,
    form: str = "csv",
    animation: str | None = None,
    sound: bool = False,
    tell: Callable[[str, float], None] = lambda words, done: None,
) -> Path:
    """Write a run into a folder: results.json, events.csv, the sampled record, figures, a moving picture, the sound.

    The folder appears when all is written. An earlier one of ours is replaced; a folder that holds anything else
    is left alone.

    Parameters
    ----------
    result : Outcome
        The run.
    folder : path
        The folder to make.
    fs : float, optional
        Sampling rate of the record [Hz]; that of the case, or one fine enough for the motion.
    form : {"csv", "h5", "parquet"}
        Format of the record.
    animation : {"gif", "mp4"}, optional
        A moving picture beside the figures.
    sound : bool
        Add sound.wav, what :func:`sound_pressure` says of it, and of a squeak rig the record of its sensors.
    tell : callable
        Called before each part of the work with a few words and how many parts are done; the run counts as one.

    Returns
    -------
    Path

    Raises
    ------
    ModelError
        A format is not known, the record would be too long, or the folder holds something that is not ours.
    RecordError
        The folder can not be written.

    Examples
    --------
    >>> import tempfile
    >>> from stickslip.systems.file import scenario_case
    >>> folder = publish_run(outcome(scenario_case("FD-4")), folder=Path(tempfile.mkdtemp()) / "decay")
    >>> sorted(path.name for path in folder.iterdir())
    ['events.csv', 'figures', 'record.csv', 'results.json']
    """
    run = result.run
    require_output(result.case, folder=folder, fs=fs, form=form, animation=animation)
    rate = fs or result.case.fs or default_rate(run)
    numbers = {**result.to_dict(), "fs": rate}
    with results_folder(Path(folder), numbers) as draft:
        tell("writing the record", 1)
        write_record(run.record(fs=rate), draft / f"record.{form}")
        _write_events(run, draft / "events.csv")
        tell("drawing the figures", 2)
        plates, lost = drawable(plates_of(run), png=True)
        numbers |= {"notes": lost} if lost else {}
        write_figures(draft / "figures", "", plates)
        if animation is not None:
            from stickslip.plot.animation import animate

            animate(run, draft / f"animation.{animation}", tell=lambda n, of: tell("animating", 3 + n / of))
        if sound:
            _write_sound(run, draft, fs or result.case.fs or HEARD, form)
    return Path(folder)


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
        file.writelines(",".join(map(str, _told(event).values())) + "\n" for event in run.each_event())


def _told(event: Event) -> dict[str, Any]:
    """An event for readers: contacts are counted from 1, as in a system's file."""
    return {**event._asdict(), "contact": event.contact + 1}


def require_output(
    case: Case, *, folder: str | Path, fs: float | None = None, form: str = "csv", animation: str | None = None
) -> None:
    """Refuse, before a case is run, what :func:`publish_run` could not write after it.

    Parameters
    ----------
    case : Case
        What is to be run.
    folder, fs, form, animation
        As in :func:`publish_run`.

    Raises
    ------
    ModelError
        A format is not known, the record would be too long, or the folder holds something that is not ours.

    Examples
    --------
    >>> from stickslip.systems.file import scenario_case
    >>> require_output(scenario_case("FD-4"), folder="decay", form="h5")
    """
    if f".{form}" not in WRITERS:
        raise ModelError(f"a record as '{form}'", f"it is written as {', '.join(w[1:] for w in WRITERS)}", "choose one")
    if animation is not None:
        from stickslip.plot.animation import require_writer

        require_writer(f".{animation}")
    rate = fs or case.fs
    if rate is not None and not (math.isfinite(rate) and rate > 0 and rate * case.duration <= REFUSED_ROWS):
        raise ModelError(
            f"fs = {rate:g} Hz over {case.duration:g} s",
            f"a record has at most {REFUSED_ROWS:g} rows, at a positive rate",
            "give a lower --fs or a shorter run",
        )
    check_folder(Path(folder))


def _values(run: Trajectory) -> dict[str, tuple[float, str]]:
    first, last = last_cycles(run, 1)
    times = np.linspace(first, last, PEAKS)
    values = {
        "simulated time": (run.duration, "s"),
        "cycles": (run.duration / period_of(run), "1"),
        "events": (float(np.count_nonzero(run.exits[:-1] >= 0)), "1"),
        **_shares(run),
    }
    for j in range(len(run.labels("x"))):
        x, v = sampled(run, (("x", j), ("v", j)), times)
        words, speed, units = *_ways(run, j), (run.units("x")[j], run.units("v")[j])
        values[f"{words}, from"] = (float(x.min()), units[0])
        values[f"{words}, to"] = (float(x.max()), units[0])
        values[f"largest {speed}"] = (float(np.abs(v).max()), units[1])
    for c in range(contacts_of(run)):
        if pressed(run, c):
            (load,) = sampled(run, (("load", c),), times)
            words = numbered_words(run, "normal load", "load", c)
            values[f"{words}, from"], values[f"{words}, to"] = (float(load.min()), "N"), (float(load.max()), "N")
    if len(run.modes) <= MOST_PIECES and isinstance(run.table, Tables):  # a closed form to integrate
        work = energy(run)
        values["work against friction"] = (work.friction, "J")
        values["energy unaccounted for, relative"] = (work.residual, "1")
    return values


def _ways(run: Trajectory, row: int) -> tuple[str, str]:
    """What a degree of freedom's displacement and speed are called."""
    turns = run.units("x")[row] == "rad"
    words = ("angle", "angular speed") if turns else ("displacement", "speed")
    return numbered_words(run, words[0], "x", row), numbered_words(run, words[1], "v", row)


def _shares(run: Trajectory) -> dict[str, tuple[float, str]]:
    """How the time is shared by what each contact does."""
    found: dict[str, tuple[float, str]] = {}
    spent = np.bincount(run.modes, weights=run.durations, minlength=len(run.table.modes)) / run.duration
    for contact in range(contacts_of(run)):
        kinds = kinds_of(run, contact)
        for kind in [kind for kind in KINDS if kind in kinds]:
            share = float(sum(s for s, k in zip(spent, kinds, strict=True) if k == kind))
            found[numbered_words(run, f"share of time in {kind}", "friction", contact)] = (share, "1")
    return found


def _sentences(run: Trajectory, values: Mapping[str, tuple[float, str]]) -> list[str]:
    found = []
    masses = run.labels("x")
    if run.status == "interrupted":
        found.append(f"Interrupted: the run holds the {_text(run.duration, 's')} simulated until then.")
    if run.status == "at rest":
        state, after = run.state(run.duration), _text(float(run.starts[-1]), "s")
        places = [
            f"{_text(float(state[name]), unit)}{f' of {name}' if len(masses) > 1 else ''}"
            for name, unit in zip(masses, run.units("x"), strict=True)
        ]
        subject = "The mass comes" if len(masses) == 1 else "All masses come"
        found.append(f"{subject} to rest after {after}, at a displacement of {_listed(places)}.")
    else:
        ways = []
        for j, name in enumerate(masses):
            words, _ = _ways(run, j)
            low, high = (_text(*values[f"{words}, {end}"]) for end in ("from", "to"))
            ways.append(f"{'the mass moves' if len(masses) == 1 else name} between {low} and {high}")
        speeds: dict[str, float] = {}
        for j in range(len(masses)):
            speed, unit = values[f"largest {_ways(run, j)[1]}"]
            speeds[unit] = max(speed, speeds.get(unit, 0.0))
        fastest = " and ".join(_text(speed, unit) for unit, speed in speeds.items())
        verb = "" if len(masses) == 1 else "the masses move: "
        found.append(f"In the last cycle {verb}{_listed(ways)}, at up to {fastest}.")
    counts = run.event_counts()
    if counts:
        told = ", ".join(f"{count} × {kind}" for kind, count in counts.most_common())
        subject = "the contact changes" if contacts_of(run) == 1 else "the contacts change"
        found.append(f"On the way {subject} {counts.total()} times: {told}.")
    elif len(run.modes) == 1 and contacts_of(run):
        found.append("The contact never changes its mode." if contacts_of(run) == 1 else "No contact changes its mode.")
    return found


def _listed(parts: Sequence[str]) -> str:
    shown = [*parts[:MOST_NAMED], *([f"{len(parts) - MOST_NAMED} more"] if len(parts) > MOST_NAMED else [])]
    return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def _fastest_contact(run: Trajectory) -> float:
    """The highest frequency at which a mode rings [Hz]; under a curved law, as its steps tell."""
    if isinstance(run, CurvedTrajectory):
        return 1 / (2 * math.pi * float(np.median(run.step_lengths)))
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
