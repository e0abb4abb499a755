"""Run the chapters, judge every number, and write the page, with what each chapter starts from in words and units."""

from __future__ import annotations

import functools
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip import __version__
from stickslip.figures.style import Plate
from stickslip.story.folder import check_folder, results_folder, templates, write_figures
from stickslip.units import prefixed, spelled
from stickslip.workers import processors, workers
from stickslip_thesis import appendices, beyond, chapter2, chapter3, chapter4, chapter5, chapter6, chapter7
from stickslip_thesis.drawing import caption_of
from stickslip_thesis.measures import Seen, seen
from stickslip_thesis.printed import CHANGED as CHANGED
from stickslip_thesis.printed import HERE, MEANINGS, Given, Number, Ours, Table, given, judged, tables

WITHOUT_UNITS = ("decay", "errors", "schematic", "inertial")  # sections whose equations have none
UNITS = {
    "mass": "kg", "stiffness": "N/m", "spring": "N/m", "damping": "N s/m", "contact_damping": "N s/m", "kinetic": "N",
    "friction": "N", "heavy": "N", "light": "N", "load": "N", "blow": "N", "release": "m", "resolution": "m",
    "amplitude": "m", "base": "m", "forced_base": "m", "dry": "m", "estimated_dry": "m", "speed": "m/s",
    "mounting_frequency": "Hz", "reflector": "Hz", "microphone": "m", "room": "dB", "radiator": "m^2",
    "gravity": "m/s^2", "fs": "Hz", "frequency": "Hz", "forced": "Hz", "transition": "Hz", "phase": "rad",
    "slider": "kg", "radius": "m", "face": "m^2", "distance": "m", "delay": "s",
    "natural": "rad/s", "rate": "1/(N s)", "steepness": "s/m", "constant": "s", "hold": "s", "lag": "s",
}  # fmt: skip
LETTERS = {
    "fs": "sampling rate", "dry": "dry displacement", "estimated_dry": "estimated dry displacement",
    "kinetic": "kinetic friction", "static": "static friction", "base": "amplitude of the base",
    "forced_base": "amplitude of the base, forced", "forced": "frequency, forced",
    "natural": "natural angular frequency", "steps": "steps between the extremes",
    "heavy": "heavier load", "light": "lighter load", "reflector": "bending of the reflector's beam",
    "microphone": "distance of the microphone", "room": "level of the room", "radiator": "area of the radiator",
    "mounting_share": "share of the mounting", "mounting_frequency": "frequency on the mounting",
}  # fmt: skip


@dataclass(frozen=True)
class Start:
    """A section of given.toml: what it is, and quantity, value and remark of each entry."""

    name: str
    about: str
    rows: tuple[tuple[str, str, str], ...]


def starts(given: Given) -> list[Start]:
    """The sections as they are shown.

    Examples
    --------
    >>> starts({"discharge": {"constant": 50.0}})[0].rows
    (('constant', '50 s', ''),)
    """
    notes = remarks()
    return [
        Start(
            _words(name),
            notes.get((name, ""), ""),
            tuple(
                (words, value, notes.get((name, key), ""))
                for key, value in values.items()
                for words, value in _entries(name, key, value, contact="spring" in values)
            ),
        )
        for name, values in given.items()
    ]


def _entries(section: str, key: str, value: Any, *, contact: bool) -> Iterator[tuple[str, str]]:
    """Words and value of an entry; beside a spring, stiffness is that of the contact."""
    if isinstance(value, Mapping):
        for inner, held in value.items():
            yield f"{_words(key)}: {_words(inner)}", _formatted(section, inner, held)
    else:
        yield "contact stiffness" if contact and key == "stiffness" else _words(key), _formatted(section, key, value)


def _formatted(section: str, key: str, value: float | Sequence[float]) -> str:
    unit = "1" if section in WITHOUT_UNITS else UNITS.get(key, "1")
    values = np.atleast_1d(np.asarray(value, dtype=float))
    factor, name = prefixed(values, unit)
    return ", ".join(f"{number:.7g}" for number in factor * values) + ("" if name == "1" else f" {spelled(name)}")


def _words(key: str) -> str:
    words = LETTERS.get(key, key.replace("_", " "))
    return re.sub(r"([a-z])(\d)", r"\1 \2", words)


@functools.cache
def remarks() -> Mapping[tuple[str, str], str]:
    """The remarks of given.toml by section and key; that of a section by an empty key."""
    notes, section, above = {}, "", ""
    for line in (HERE / "given.toml").read_text("utf-8").splitlines():
        code, _, remark = (part.strip() for part in line.partition("#"))
        key = re.match(r"\[?(\w+)", code)
        if key is None:
            above = remark
            continue
        if code.startswith("["):
            section = key[1]
        notes[section, "" if code.startswith("[") else key[1]] = "; ".join(part for part in (remark, above) if part)
        above = ""
    return notes


CHAPTERS = {
    "2": chapter2,
    "3": chapter3,
    "4": chapter4,
    "5": chapter5,
    "6": chapter6,
    "7": chapter7,
    "appendices": appendices,
    "beyond": beyond,
}
VERDICTS = (*MEANINGS, CHANGED)
TEMPLATE = "thesis.html.jinja"

Tell = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Chapter:
    """One chapter, run: its tables with our numbers and verdicts, and its figures.

    Attributes
    ----------
    name, title : str
        "6", and what it is about.
    tables : tuple of (Table, entries)
        For each entry of each row our number and the verdict.
    start : mapping of str to mapping
        What it starts from: sections of given.toml.
    plates : tuple of Plate
        Its figures.
    seen : tuple of Seen
        What the text says that one should see in them, ticked where ours shows it.
    """

    name: str
    title: str
    start: Given
    tables: tuple[tuple[Table, list[list[tuple[float | None, str]]]], ...]
    plates: tuple[Plate, ...] = ()
    seen: tuple[Seen, ...] = ()

    def seen_in(self, plate: Plate) -> list[Seen]:
        """The observations of a figure, told where the first of their figures stands."""
        number = plate.title.removeprefix("Figure ")
        return [one for one in self.seen if one.observation.figures[:1] == (number,)]

    @property
    def counts(self) -> Counter[str]:
        """How many numbers have each verdict; one that is printed twice counts once."""
        return Counter(
            verdict
            for table, rows in self.tables
            for row, entries in zip(table.rows, rows, strict=True)
            if not row.again
            for _, verdict in entries
        )

    def entries(self) -> Iterator[dict[str, Any]]:
        """Each number with its verdict, as plain data."""
        for table, rows in self.tables:
            for row, entries in zip(table.rows, rows, strict=True):
                for number, (value, verdict) in zip(row.numbers, entries, strict=True):
                    yield {
                        "chapter": self.name,
                        "place": table.name,
                        "quantity": row.quantity,
                        "entry": number.label,
                        "unit": row.unit,
                        "printed": number.printed,
                        "ours": value,
                        "verdict": verdict,
                        "why": number.why,
                        "again": row.again,
                    }


def run_chapter(name: str, *, start: Given | None = None, draw: bool = True, tell: Tell | None = None) -> Chapter:
    """A chapter's numbers and verdicts and, if asked, its figures."""
    module, start = CHAPTERS[name], given() if start is None else start
    ours: Ours = module.numbers(start)
    plates = []
    for drawn in module.plates(start) if draw else ():
        plates.append(drawn)
        if tell:
            tell(f"chapter {name}, {drawn.title.lower()}", len(plates))
    verdicts = tuple((table, judged(table, ours)) for table in tables() if table.chapter == name)
    begins = {section: start[section] for section in module.STARTS_FROM}
    return Chapter(name, module.TITLE, begins, verdicts, tuple(plates), seen(name, start) if draw else ())


def reproduce(chapters: Sequence[str], *, folder: Path | None, tell: Tell) -> tuple[Chapter, ...]:
    """Run chapters and, given a folder, write page, figures and results.json there, whole or not at all."""
    if folder is not None:
        check_folder(folder)
    run = _run_apart if folder is not None and len(chapters) > 1 else _run_here
    done = run(chapters, folder is not None, tell)
    if folder is not None:
        tell("writing the page", len(chapters))
        with results_folder(folder, results(done)) as draft:
            (draft / "thesis.html").write_text(render(done), encoding="utf-8")
            (draft / "figures").mkdir()
            for chapter in done:
                write_figures(draft / "figures", f"{chapter.name}-", chapter.plates)
    return tuple(done)


def _run_here(chapters: Sequence[str], draw: bool, tell: Tell) -> list[Chapter]:
    """Each in this process, its figures told one by one."""
    start = given()
    return [
        run_chapter(name, start=start, draw=draw, tell=lambda words, _, place=place: tell(words, place))
        for place, name in enumerate(chapters)
    ]


def _run_apart(chapters: Sequence[str], draw: bool, tell: Tell) -> list[Chapter]:
    """Each in one of as many processes as there are processors, the longest ones, which stand last, begun first."""
    count = min(len(chapters), processors())
    start, done = given(), []
    tell(f"{len(chapters)} chapters", 0)
    with workers(count, __name__) as over:
        jobs = [(name, start, draw) for name in reversed(chapters)]
        for place, chapter in enumerate(over(_rendered, jobs)):
            done.append(chapter)
            tell(f"chapter {chapter.name}", place + 1)
    return done[::-1]


@dataclass(frozen=True, eq=False)
class Rendered(Plate):
    """A figure as its images, which pass from one process to another."""

    vector: str = ""
    image: bytes = b""

    def svg(self) -> str:
        """As it was drawn."""
        return self.vector

    def png(self) -> bytes:
        """As it was drawn."""
        return self.image


def _rendered(job: tuple[str, Given, bool]) -> Chapter:
    """A chapter, its figures drawn."""
    name, start, draw = job
    chapter = run_chapter(name, start=start, draw=draw)
    plates = (Rendered(one.name, _elsewhere, one.title, one.caption, one.svg(), one.png()) for one in chapter.plates)
    return replace(chapter, plates=tuple(plates))


def _elsewhere() -> Any:
    raise RuntimeError("this figure was drawn in another process, and is kept as its images")


def results(chapters: Sequence[Chapter]) -> dict[str, Any]:
    """What results.json holds: the count of each verdict, and every number."""
    total = sum((chapter.counts for chapter in chapters), Counter())
    return {
        "chapters": {chapter.name: chapter.title for chapter in chapters},
        "verdicts": {verdict: total[verdict] for verdict in VERDICTS},
        "numbers": [entry for chapter in chapters for entry in chapter.entries()],
        "seen": [_plain(one) for chapter in chapters for one in chapter.seen],
    }


def _plain(one: Seen) -> dict[str, Any]:
    observation = one.observation
    return {
        "section": observation.section, "figures": list(observation.figures), "says": observation.says,
        "measure": observation.measure,
        "values": list(one.values), "seen": one.shown, "why": observation.why,
    }  # fmt: skip


def holds(outcome: dict[str, Any]) -> bool:
    """Whether every verdict holds, and everything is seen that should be."""
    return not outcome["verdicts"][CHANGED] and all(one["seen"] == (not one["why"]) for one in outcome["seen"])


def render(chapters: Sequence[Chapter]) -> str:
    """The page as text."""
    environment = templates(Path(__file__).parent)
    environment.filters.update(caption_of=caption_of)
    environment.globals.update(digits_of=digits_of, reasons=reasons, starts=starts)
    total = sum((chapter.counts for chapter in chapters), Counter())
    return environment.get_template(TEMPLATE).render(
        chapters=chapters, total=total, verdicts=VERDICTS, meanings=MEANINGS, version=__version__
    )


def digits_of(number: Number, value: float | None) -> str:
    """Our number with one digit more than the printed one.

    Examples
    --------
    >>> digits_of(Number("", "0.0197", "same", None, 5e-5, ""), 0.019651)
    '0.01965'
    """
    if value is None:
        return "–"
    mantissa, exponent, _ = number.printed.lower().partition("e")
    digits = len(mantissa.partition(".")[2]) + 1
    return f"{value:.{digits}e}" if exponent else f"{value:.{digits}f}"


def reasons(numbers: Sequence[Number]) -> list[tuple[str, str]]:
    """Why some of a row are not the same: each reason once, with the entries that it holds for."""
    labels_of: dict[str, list[str]] = {}
    for number in numbers:
        if number.why:
            labels_of.setdefault(number.why, []).append(number.label)
    whole = len(labels_of) == 1 and len(next(iter(labels_of.values()))) == len(numbers)
    return [("" if whole else ", ".join(labels), why) for why, labels in labels_of.items()]
