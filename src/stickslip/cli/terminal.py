"""What a command prints: the answer and a short table for people, JSON for machines, through one door to the terminal.

Nothing that a file holds is obeyed there, as an escape sequence or as markup."""

from __future__ import annotations

import contextlib
import itertools
import json
import logging
import re
import shlex
import shutil
import sys
import textwrap
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.printing import printable

if TYPE_CHECKING:
    from stickslip.story import Caution, Line, Story

WIDEST = 110  # columns: longer lines are hard to read
GAP, NARROW = 2, 6  # columns between two, and of the narrowest that is broken
WHOLE = 28  # letters of a name that is not broken
MOST_LINES = 40  # unless --all is asked for
MOST_ROWS = 8  # of all tables together
OF_TABLES = 4  # of these rows, where a result has tables beside its quantities
MOST_PARTS = 4  # records of a comparison, a sentence each
END = 3  # lines kept for what is left out and where the page lies
TITLE: Mapping[str, Any] = {"bold": True}
FAINT: Mapping[str, Any] = {"dim": True}
PLURALS = {"quantity": "quantities"}
ARGUMENTS = "stickslip.arguments"  # the key under which the context keeps what was typed
CARRIED = ("--output", "--twins")  # what a command that mends another one keeps of it


def say(text: object = "", *, err: bool = False) -> None:
    """Lines as they are."""
    click.echo(_shown(text, err=err), err=err)


def complain(sentence: object) -> None:
    """One line on the error stream, whatever line ends a file's name holds."""
    say(f"stickslip: {' '.join(str(sentence).split())}", err=True)


def say_json(results: Mapping[str, Any]) -> None:
    """Results for a machine; what can not be printed is spelled out, which leaves it JSON of the same value."""
    say(json.dumps(results, indent=2, ensure_ascii=False, allow_nan=False))


def say_styled(line: str, **style: Any) -> None:
    """A line in a style of :func:`click.style`, where it is a terminal that shows styles."""
    click.echo(click.style(_shown(line), **style) if style else _shown(line))


def wrapped(text: str, begin: str = "") -> list[str]:
    """A paragraph as lines of the terminal's width; the further ones stand under the first behind `begin`."""
    return textwrap.wrap(_shown(text), _width(), initial_indent=begin, subsequent_indent=" " * len(begin))


def aligned(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A table under its headings as lines; the widest columns are broken until it fits the terminal."""
    table = [[_shown(cell) for cell in row] for row in (headings, *rows)]
    widths = [max(1, *map(len, column)) for column in zip(*table, strict=True)]
    breakable = range(widths[0] <= WHOLE, len(widths))
    while sum(widths) + GAP * (len(widths) - 1) > _width():
        widest = max(breakable, key=lambda place: widths[place], default=0)
        if widths[widest] <= NARROW:
            break
        widths[widest] -= 1
    broken = ((textwrap.wrap(cell, width) for cell, width in zip(row, widths, strict=True)) for row in table)
    parts = (part for cells in broken for part in itertools.zip_longest(*cells, fillvalue=""))
    return [(GAP * " ").join(map(str.ljust, part, widths)).rstrip() for part in parts]


def _width() -> int:
    return min(WIDEST, shutil.get_terminal_size().columns)


def _shown(text: object, *, err: bool = False) -> str:
    stream = sys.stderr if err else sys.stdout
    return printable(str(text), encoding=getattr(stream, "encoding", None) or "utf-8")


PATIENCE = 2.0  # seconds of silence before a progress bar is shown


class _Spoken(logging.Handler):
    """What the package has to say of itself, on the error stream."""

    def emit(self, record: logging.LogRecord) -> None:
        """One line."""
        complain(record.getMessage())


@contextlib.contextmanager
def compiling() -> Iterator[None]:
    """Says to who watches that kernels are compiled, as it begins, and how long it took."""
    log, spoken = logging.getLogger("stickslip"), _Spoken(logging.INFO)
    if sys.stderr.isatty():
        log.addHandler(spoken)
        log.setLevel(logging.INFO)
    try:
        yield
    finally:
        kernels = sys.modules.get("stickslip.compiler")  # not imported for this: a command without kernels starts light
        if kernels is not None and kernels.compilation.seconds >= 1:
            log.info("compiled in %.0f s; the next run finds it", kernels.compilation.seconds)
        log.removeHandler(spoken)


@contextlib.contextmanager
def progress(steps: int) -> Iterator[Callable[..., None]]:
    """What is being done, on the error stream, for work that lasts; silent where nobody watches."""
    if not sys.stderr.isatty():
        yield lambda stage, done=None: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    column = TextColumn("{task.description}", markup=False)  # a file may be called "[/x].csv"
    columns = (SpinnerColumn(), column, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    task = bar.add_task("", total=steps)
    patience = threading.Timer(PATIENCE, bar.start)
    patience.daemon = True
    patience.start()
    if PATIENCE <= 0:
        patience.join()
    try:
        yield lambda stage, done=None: bar.update(task, completed=done, description=printable(stage), refresh=True)
    finally:
        patience.cancel()
        bar.stop()


@contextlib.contextmanager
def redrawn() -> Iterator[Callable[[Sequence[str]], None] | None]:
    """What draws lines in place of those before, on the error stream; None where nobody watches."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    with Live(console=Console(stderr=True), auto_refresh=False, transient=True) as live:
        yield lambda lines: live.update(Text("\n".join(lines), overflow="crop", no_wrap=True), refresh=True)


REPAIRS = {
    "repair_clock": "clock",
    "fill_gaps": "gaps",
    "fill_missing": "missing",
    "remove_spikes": "spikes",
    "restore_clipped": "clipping",
    "remove_drift": "drift",
}  # a function's name, and what --repair calls it
_SPOKEN = (
    (r"\b(the command line|the run) sets (\w+)", r"\1 sets --\2"),
    (r"\brecord\.check\(\)", "stickslip check"),
    (r"\brecord\.rows\(\)", "--rows"),
    (r"\brecord\.between\([^)]*\)", "--rows"),
    (r", or trust='samples'[^;.]*", ""),
    (r"\bask friction_loops\(record\)", "ask stickslip analyze"),
    (r", or ask (?:extreme|fit)_decay\(record\)[^;.]*", ""),
    (r', or choose form="plain"[^;.]*', ""),
    (r" \(see choose_motion\)", ""),
    (r", or overwrite=True", ""),
    (r"; use log_decrement or fit_decay instead", ""),
    (r'\brestoring="pendulum"', "--restoring pendulum"),
    (r"\brecord\.rows\((\d+), (\d+)\)", r"--rows \1:\2"),
    (r'\bchannel="(\w+)"', r"--channel \1"),
    (r'\bchannels=\{"(\w+)": "([^"]*)"\}', r'--channels "\1=\2"'),
    (r'\btime="([^"]*)"', r'--time "\1"'),
    (r'\bfriction_force\(record, \.\.\., method="(\w+)"\)', r"--method \1"),
    (r"\brows=\((\d+), (\d+)\)", r"--rows \1:\2"),
)
_NAMED = re.compile(r"\b([a-z_]+)=(?=[\s,.;:)]|$)")  # an argument of a function, to be given or corrected
IN_PYTHON = {"budget", "rtol"}  # of a simulation, and no parameter of a system


def spoken(sentence: object) -> str:
    """A sentence with the options of the command line for what it says of Python."""

    def repair(call: re.Match[str]) -> str:
        word = REPAIRS.get(call[1])
        return call[0] if word is None else f"--repair {word}" + (f":{call[2]}" if call[2] else "")

    text = re.sub(r"\bfill_gaps\(record\) and fill_missing\(record\)", "--repair gaps,missing", str(sentence))
    text = re.sub(r'\b(\w+)\(record(?:, "(\w+)")?\)', repair, text)
    for phrase, option in _SPOKEN:
        text = re.sub(phrase, option, text)
    options = _options()

    def typed(argument: re.Match[str]) -> str:
        option = f"--{argument[1].replace('_', '-')}"
        if not options or option in options:
            return option
        settable = "--set" in options and argument[1] not in IN_PYTHON
        return f'--set "{argument[1]}=VALUE"' if settable else f"{argument[0]} in Python"

    return _NAMED.sub(typed, text)


def _options() -> set[str]:
    """The options of the command that was typed; none outside of one."""
    context = click.get_current_context(silent=True)
    if context is None:
        return set()
    command: click.Command = context.find_root().command
    for word in context.meta.get(ARGUMENTS, ()):
        if isinstance(command, click.Group):
            command = command.commands.get(word, command)
    own = command.commands.values() if isinstance(command, click.Group) else [command]
    return {option for one in own for parameter in one.params for option in parameter.opts}


def print_json(results: Mapping[str, Any]) -> None:
    """Results for a machine, which begin as results.json does: with what made them."""
    say_json({"program": "stickslip", "version": ss.__version__, **results})


def publish(result: Any, folder: Path | None, **context: Any) -> Path | None:
    """The folder of a result, whose page names options as the terminal does; none where none is asked for."""
    return None if folder is None else ss.publish(result, folder=folder, wording=spoken, **context)


def deliver(
    result: Any, folder: Path | None, *, as_json: bool, everything: bool = False, parts: int = 0, **context: Any
) -> None:
    """Show a result, then write its folder: figures take longer than most answers, which are read meanwhile.

    A writing in several `parts` tells of each itself.
    """
    try:
        show(result, as_json=as_json, everything=everything, **context)
    finally:  # a reader that goes early, as `head` does, takes the words away and not the folder
        with progress(parts or 1) as tell:
            tell("drawing and writing", 0)
            written = publish(result, folder, **({"tell": tell} if parts else {}), **context)
    say_report(written, as_json=as_json)


@dataclass(frozen=True)
class Output:
    """Where the results of a command go, and how much of them is printed: as option.results have it.

    Attributes
    ----------
    chosen : Path or None
        The folder asked for.
    as_json, everything : bool
        Whether JSON is printed and nothing else, or all of the story.
    """

    chosen: Path | None
    as_json: bool
    everything: bool

    def folder(self, usual: Path) -> Path | None:
        """The folder asked for, or the usual one; none where JSON alone is asked for."""
        return self.chosen or (None if self.as_json else usual)

    def deliver(self, result: Any, folder: Path | None, **context: Any) -> None:
        """Show a result, then write its folder, as :func:`deliver` does."""
        deliver(result, folder, as_json=self.as_json, everything=self.everything, **context)


def say_report(written: Path | None, *, as_json: bool) -> None:
    """Where the page lies, to a person."""
    if written is not None and not as_json:
        say(f"Report: {written / 'report.html'}")


def show(result: Any, *, as_json: bool, everything: bool = False, **context: Any) -> None:
    """A result as its story tells it, in short or with `everything`; `context` as in ``publish``."""
    story = ss.summary(result, **context)
    if as_json:
        print_json(story.data())
        return
    if everything:
        for part in (*story.parts, story):
            _print_all(part)
    else:
        _print_short(story)


def _print_short(story: Story) -> None:
    """At most MOST_LINES lines: the answer, the rows that lead, their cautions, and what else there is."""
    in_tables = sum(len(table.rows) for table in story.tables if not table.folded)
    rows, lines = story.lines[: MOST_ROWS - min(in_tables, OF_TABLES)], []
    # without rows the sentences are all
    sentences = story.explaining(rows) if story.lines or story.tables else story.others
    for text in (*story.opening, *sentences, *(f"{part.title}: {part.answer}" for part in story.parts[:MOST_PARTS])):
        lines += _lines(text)
    lines += [*_remedies(story), *_numbers(story, rows)]
    left, hidden = MOST_ROWS - len(rows), 0
    for table in story.tables:
        shown = () if table.folded else table.rows[:left]
        lines += [*_table(table.title, table.headings, shown), *(_lines(table.note) if shown else ())]
        left, hidden = left - len(shown), hidden + len(table.rows) - len(shown)
    cautions: list[Caution] = []
    lines.append("")
    for caution in story.concerned(rows):
        caution_lines = _caution(story, caution)
        if len(lines) + len(caution_lines) <= MOST_LINES - END:
            lines += caution_lines
            cautions.append(caution)
    _print(story.title, lines)
    more = {
        "quantity": len(story.lines) - len(rows), "row": hidden, "caution": len(story.notices) - len(cautions),
        "sentence": len(story.others) - len(sentences), "note": len(story.notes),
        "record": max(0, len(story.parts) - MOST_PARTS),
    }  # fmt: skip
    counted = [
        f"{count} {PLURALS.get(name, name + 's') if count > 1 else name}" for name, count in more.items() if count
    ]
    if counted:
        say_styled(f"More with --all: {', '.join(counted)}.", **FAINT)


def _print_all(story: Story) -> None:
    """Everything that the page tells in words, each sentence once."""
    lines = [line for text in story.headline for line in _lines(text)]
    lines += [*_remedies(story), *_numbers(story, story.lines), ""]
    shown = {str(sentence) for sentence in (*story.headline, *story.notices)} | {
        notice.reason for notice in story.notices
    }
    lines += [line for caution in story.notices for line in _caution(story, caution)]
    lines += [line for fault in story.faults or () if fault not in shown for line in _lines(fault, "- ")]
    for table in story.tables:
        lines += [*_table(table.title, table.headings, table.rows), *_lines(table.note)]
    lines += [line for note in story.notes if note not in shown for line in _lines(note, "Note: ")]
    _print(story.title, lines)


def _print(title: str, lines: Sequence[str]) -> None:
    say()
    for line in wrapped(title):
        say_styled(line, **TITLE)
    for line, before in zip(lines, ["", *lines], strict=False):
        if line or before:
            say(line)


def _remedies(story: Story) -> list[str]:
    """The commands that mend what is wrong, whichever of them is so, on lines that can be copied."""
    commands = [line for remedy in story.remedies for line in ("or:", as_typed(remedy))]
    return ["To mend it:", *commands[1:]] if commands else []


def as_typed(command: str) -> str:
    """A command about the files that were asked about, where these lie, with the folder and twins that were asked for.

    A page has their names alone: it may be read elsewhere.
    """
    context = click.get_current_context(silent=True)
    typed: list[str] = context.meta.get(ARGUMENTS, []) if context is not None else []
    words = shlex.split(command)
    words[2:3] = [word for word in typed if "+".join(Path(own).name for own in word.split("+")) == words[2]][:1] or [
        words[2]
    ]
    for at, word in enumerate(typed):
        option, equals, _ = word.partition("=")
        if option in CARRIED and option not in words:
            words[3:3] = [word] if equals else typed[at : at + 2]
    return shlex.join(words)


def _lines(text: object, begin: str = "") -> list[str]:
    """A paragraph in the terminal's own words."""
    return wrapped(spoken(text), begin)


def _table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """A table under its title and headings; nothing without rows."""
    if rows:
        yield from ("", *wrapped(title), *aligned(headings, [[spoken(cell) for cell in row] for row in rows]))


def _numbers(story: Story, lines: Sequence[Line]) -> list[str]:
    """The rows of quantities, each with the numbers of the cautions that concern it."""
    columns = [
        ("quantity", [line.name for line in lines]), ("", [story.marks(line) for line in lines]),
        ("value", [line.value for line in lines]), ("95 % interval", [line.interval for line in lines]),
        ("true value", [line.true or "-" for line in lines] if story.has_truth else []),
    ]  # fmt: skip
    columns = [(heading, cells) for heading, cells in columns if any(cells)]
    rows = list(zip(*(cells for _, cells in columns), strict=True))
    return ["", *aligned([heading for heading, _ in columns], rows)] if rows else []


def _caution(story: Story, caution: Caution) -> list[str]:
    """A caution behind its number, or in words of its own."""
    mark = story.mark(caution)
    return _lines(caution.reason, f"{mark:<3}") if mark else _lines(caution)
