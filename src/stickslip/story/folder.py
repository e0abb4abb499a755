"""The folder of results: report, numbers and figures, there as a whole or not at all."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache, partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip import __version__
from stickslip.errors import ModelError, RecordError
from stickslip.figures import style
from stickslip.files.write import whole
from stickslip.printing import printable
from stickslip.story.story import Story, summary
from stickslip.units import spelled
from stickslip.whole import whole_folder

if TYPE_CHECKING:
    from jinja2 import Environment

    from stickslip.figures.style import Plate
    from stickslip.squeak.spectra import Clip
    from stickslip.story.scope import Scope

TEMPLATE = "page.html.jinja"
SCRIPT = "scope.js"
DRAWN = ("twin", "close-up", "record", "motion", "identified", "whole-run")  # figures of what the page draws itself
MOST_SOUND = 1 << 20  # bytes of sound of one record in a page; the folder holds all
_COLOURS = {
    style.INK: "currentColor", style.FAINT: "var(--faint)", style.SHADE: "var(--shade)", style.BLUE: "var(--blue)",
    style.ORANGE: "var(--orange)", style.GREEN: "var(--green)", style.PURPLE: "var(--purple)", style.SKY: "var(--sky)",
}  # fmt: skip


def report(result: Any, path: str | Path, **context: Any) -> Path:
    """Write one HTML page that holds everything and asks nothing of a network.

    Parameters
    ----------
    result : Findings, Comparison, Estimate or any other result
        As in :func:`summary`.
    path : path
        The page to write; it appears whole or not at all.
    **context
        As in :func:`summary`: ``record`` tells where plain estimates were found, with its faults and history.

    Returns
    -------
    Path

    Raises
    ------
    FormatError
        The page can not be written there.
    ModelError
        A result of a kind that is not told.
    EstimateError
        A sequence that is empty or holds something else than estimates.

    Examples
    --------
    >>> import tempfile
    >>> from stickslip import Estimate
    >>> friction = Estimate.normal("sliding friction", 1.318, sd=0.004, unit="N", method="median of 18 half cycles")
    >>> page = report([friction], Path(tempfile.mkdtemp()) / "report.html")
    >>> "1.318" in page.read_text(encoding="utf-8")
    True
    """
    text = render(sections(summary(result, **context)))
    with whole(Path(path)) as draft:
        draft.write_text(text, encoding="utf-8")
    return Path(path)


def sections(story: Story, *, png: bool = False, figures: bool = True) -> list[Story]:
    """The sections of the page, their figures drawn, as PNG too where asked for.

    Without `figures` a section has the one that leads, and none where the page draws the record itself.
    """
    return [part.drawn(png=png) if figures else _quick(part) for part in (story, *story.parts)]


def _quick(story: Story) -> Story:
    """What the page draws itself, else the figure that leads: all others take longer than the answers."""
    return replace(story, draw=tuple) if story.scope else replace(story, draw=lambda: story.plates[:1]).drawn()


def render(stories: Sequence[Story], wording: Callable[[str], str] = str) -> str:
    """The page as text, each sentence as `wording` has it."""
    return templates(wording=wording).get_template(TEMPLATE).render(stories=stories, version=__version__)


@lru_cache(maxsize=8)  # read and compiled once: a tenth of a second each time, of many records for each page
def templates(*folders: Path, wording: Callable[[str], str] = str) -> Environment:
    """The page's template and those of other folders that extend it, with the filters that they use."""
    from jinja2 import ChoiceLoader, Environment, FileSystemLoader, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader("stickslip.story"), FileSystemLoader(folders)]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=partial(_visible, wording),
    )
    environment.filters.update(
        inline_svg=inline_svg,
        spelled_out=spelled_out,
        spelled=spelled,
        played=played,
        heard=heard,
        packed=packed,
        closer=closer,
    )
    environment.globals.update(script=(files("stickslip.story") / "templates" / SCRIPT).read_text("utf-8"))
    return environment


def _visible(wording: Callable[[str], str], value: Any) -> Any:
    """What the page is given: sentences in its own wording, and text of others shows its hidden signs."""
    if not isinstance(value, str):
        return value
    return type(value)(printable(value)) if hasattr(value, "__html__") else printable(wording(value))


def packed(scope: Scope) -> str:
    """What the page draws itself, as JSON that no sign of markup ends."""
    return json.dumps(scope.packed(), allow_nan=False).replace("<", "\\u003c")


def closer(story: Story) -> tuple[Plate | None, list[Plate]]:
    """The figure that leads, and those that are folded: without those that the page draws itself."""
    named = {plate.name: plate for plate in story.plates}
    drawn = [named[name] for name in DRAWN if name in named] if story.scope else []
    first = drawn[0] if drawn else story.plates[0] if story.plates else None
    return first, [plate for plate in story.plates if plate is not first and plate not in drawn]


def heard(clips: Sequence[Clip]) -> Sequence[Clip]:
    """The clips that the page itself holds: as many of the loudest as keep it light."""
    light, size = set(), 0
    for clip in sorted(clips, key=lambda clip: -clip.level):
        size += len(clip.wav)
        if size > MOST_SOUND:
            break
        light.add(clip.name)
    return [clip for clip in clips if clip.name in light]


def played(clip: Clip) -> str:
    """The sound as an address that holds it."""
    return f"data:audio/wav;base64,{base64.b64encode(clip.wav).decode('ascii')}"


def inline_svg(plate: Plate) -> str:
    """The figure as an SVG element that takes the page's width, colours and type."""
    svg = plate.svg()
    svg = svg[svg.index("<svg") :]
    opening, rest = svg.split(">", 1)
    opening = re.sub(r' (width|height)="[^"]*"', "", opening).replace("<svg", '<svg role="img" aria-hidden="true"')
    rest = re.sub(r"<metadata>.*?</metadata>", "", rest, flags=re.DOTALL)
    rest = re.sub(r'<g id="[^"]*">', "<g>", rest)
    for colour, variable in _COLOURS.items():
        rest = rest.replace(colour, variable)
    return f"{opening}>{rest}"


def spelled_out(value: Any) -> str:
    """An argument of a step, with its parts spelled out."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {spelled_out(item)}" for key, item in value.items())
    if isinstance(value, (list, tuple)):
        return "; ".join(spelled_out(item) for item in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


PROGRAM = "stickslip"
NUMBERS = "results.json"


def publish(
    result: Any, *, folder: str | Path, figures: bool = True, wording: Callable[[str], str] = str, **context: Any
) -> Path:
    """Write ``report.html``, ``results.json``, the figures as SVG and PNG, and what else a result has into a folder.

    That is each burst as WAV, and a fitted law for other programs. The folder appears when all is written, and is on
    the disk itself then. An earlier one of ours is replaced in one step where the system can do that (Linux, macOS); a
    folder that holds anything else is left alone. A file that somebody puts there meanwhile stays.

    Parameters
    ----------
    result : Findings, Comparison or any other result
        As in :func:`summary`.
    folder : path
        The folder to make.
    figures : bool
        Whether figures are drawn. Without them the folder is there three times as soon, and the page shows the record
        with its loop, which it draws itself.
    wording : callable
        What the page makes of each sentence: a command puts its options where a sentence names arguments of Python.
    **context
        As in :func:`summary`: of a fit ``record`` tells what it was fitted to, and how the law's system moved.

    Returns
    -------
    Path

    Raises
    ------
    ModelError
        The folder holds something that is not ours, or the result is of a kind that is not told.
    RecordError
        The folder can not be written.

    Examples
    --------
    >>> import tempfile
    >>> import stickslip as ss
    >>> record = ss.datasets.demo()
    >>> rig = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
    >>> folder = publish(ss.analyze(record, **rig), folder=Path(tempfile.mkdtemp()) / "results")
    >>> sorted(path.name for path in folder.iterdir())
    ['figures', 'report.html', 'results.json']
    """
    folder = Path(folder)
    check_folder(folder)
    story = summary(result, **context)
    stories = sections(story, png=True, figures=figures)
    with results_folder(folder, story.data()) as draft:
        (draft / "report.html").write_text(render(stories, wording), encoding="utf-8")
        for number, part in enumerate(stories):
            prefix = f"{number}-{_fit_for_a_file(part.title)}-" if len(stories) > 1 else ""
            if figures:
                write_figures(draft / "figures", prefix, part.plates)
            _write_sounds(draft / "sounds", prefix, part.clips)
        story.write(draft)
    return folder


def _write_sounds(folder: Path, prefix: str, clips: Sequence[Clip]) -> None:
    """Each burst to listen to."""
    if clips:
        folder.mkdir(exist_ok=True)
    for clip in clips:
        (folder / f"{prefix}{clip.name}.wav").write_bytes(clip.wav)


@contextmanager
def results_folder(folder: Path, results: Mapping[str, Any]) -> Iterator[Path]:
    """A folder to fill; with `results` and the list of its files in ``results.json`` it appears at the end, whole."""
    check_folder(folder)
    with _written(folder) as draft:
        yield draft
        files = sorted(str(path.relative_to(draft).as_posix()) for path in draft.rglob("*") if path.is_file())
        numbers = {"program": PROGRAM, "version": __version__, "files": [*files, NUMBERS], **results}
        text = printable(json.dumps(numbers, indent=2, ensure_ascii=False, allow_nan=False))
        (draft / NUMBERS).write_text(text + "\n", encoding="utf-8")


def check_folder(folder: Path) -> None:
    """Refuse, before any work, a folder that results may not go into.

    Parameters
    ----------
    folder : Path
        Where they are to go; it need not be there.

    Raises
    ------
    ModelError
        It lies in a file, or holds anything that an earlier run did not write.
    OSError
        Its name is none that the system takes.

    Examples
    --------
    >>> import tempfile
    >>> check_folder(Path(tempfile.mkdtemp()) / "results")
    """
    if not folder.exists():
        if any(parent.is_file() for parent in folder.absolute().parents):
            raise ModelError(f"{folder} lies in a file", "results go into a folder", "name another with --output")
        return
    strangers = ["it is a file"] if not folder.is_dir() else _strangers(folder)
    if strangers:
        raise ModelError(
            f"{folder} holds something that stickslip did not write ({strangers[0]})",
            "results go into a new folder, an empty one, or one of earlier results",
            "name another folder with --output",
        )


def _strangers(folder: Path) -> list[str]:
    paths = (path for path in folder.rglob("*") if not path.is_dir() or path.is_symlink())
    present = {path.relative_to(folder).as_posix() for path in paths}
    try:
        numbers = json.loads((folder / NUMBERS).read_text(encoding="utf-8"))
        ours = set(numbers["files"]) if numbers["program"] == PROGRAM else set()
    except (OSError, ValueError, KeyError, TypeError):  # absent or not ours: then every file is a stranger's
        ours = set()
    return sorted(present - ours)


@contextmanager
def _written(folder: Path) -> Iterator[Path]:
    """A folder to fill that takes the place of `folder` at the end; what else came there meanwhile stays there."""
    try:
        with whole_folder(folder, strangers=_strangers) as draft:
            yield draft
    except OSError as error:
        raise RecordError(
            f"{folder} can not be written ({error.strerror or error})",
            "results need a place on a disk that can be written",
            "name another folder with --output",
        ) from error


def write_figures(folder: Path, prefix: str, plates: Sequence[Plate]) -> None:
    """Each figure as SVG and PNG, in a folder that is made."""
    folder.mkdir(exist_ok=True)
    for plate in plates:
        (folder / f"{prefix}{plate.name}.svg").write_text(plate.svg(), encoding="utf-8")
        (folder / f"{prefix}{plate.name}.png").write_bytes(plate.png())


def _fit_for_a_file(title: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]+", "-", title).strip("-.")[:60] or "record"
