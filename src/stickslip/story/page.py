"""One self-contained page: what was found, how sure it is, and how it came about."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip import __version__
from stickslip.figures import style
from stickslip.figures.plate import Plate
from stickslip.files.write import whole
from stickslip.printing import printable
from stickslip.squeak.spectra import Clip
from stickslip.story.scope import Scope
from stickslip.story.story import Story, summary

if TYPE_CHECKING:
    from jinja2 import Environment

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


def sections(story: Story, *, png: bool = False) -> list[Story]:
    """The sections of the page, with their figures drawn; as PNG too where these are asked for."""
    return [part.drawn(png=png) for part in (story, *story.parts)]


def render(stories: Sequence[Story]) -> str:
    """The page as text."""
    return templates().get_template(TEMPLATE).render(stories=stories, version=__version__)


def templates(*folders: Path) -> Environment:
    """The page's template and those of other folders that extend it, with the filters that they use."""
    from jinja2 import ChoiceLoader, Environment, FileSystemLoader, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader("stickslip.story"), FileSystemLoader(folders)]), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=_visible,
    )  # fmt: skip
    environment.filters.update(
        inline_svg=inline_svg,
        told=told,
        spelled=style.spelled,
        played=played,
        heard=heard,
        packed=packed,
        closer=closer,
    )
    environment.globals.update(script=(files("stickslip.story") / "templates" / SCRIPT).read_text("utf-8"))
    return environment


def _visible(value: Any) -> Any:
    """What the page is given: text of others shows its hidden signs."""
    return type(value)(printable(value)) if isinstance(value, str) else value


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


def told(value: Any) -> str:
    """An argument of a step, with its parts spelled out."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {told(item)}" for key, item in value.items())
    if isinstance(value, (list, tuple)):
        return "; ".join(told(item) for item in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
