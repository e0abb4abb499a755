"""What the page offers: every law and drive with its parameters, units and words, and the scenarios to begin with."""

from __future__ import annotations

import dataclasses
import inspect
import itertools
import json
import re
from collections.abc import Mapping
from typing import Any

import stickslip as ss

Answer = tuple[dict[str, Any], dict[str, Any]]
TEX = (
    (r":math:`([^`]*)`", r"\1"), (r"``?", ""), (r"\\mathrm{(\w+)}", r"\1"),
    (r"\\dot\s*\\?(\w+)", r"\1'"), (r"\^{(.*?)}", r"^(\1)"),
    (r"\\le\b", "≤"), (r"\\,", " "), (r"\\varphi", "φ"), (r"\\pi", "π"), (r"\\tau", "τ"), (r"\\?theta", "θ"),
    (r"\\gamma", "γ"), (r"\\sigma", "σ"), (r"\\delta", "δ"), (r"\\alpha", "α"), (r"\\(\w+)", r"\1"),
)  # fmt: skip
FIRST = "THESIS rigid 2.5Hz fk=1.1"
BOUNDARY = [
    0.103 + 0.01 * j for j in range(190)
]  # frequency ratios, none an odd part of one, at which Den Hartog's line is drawn
MORE = ("law", "drive", "contacts")


def catalog(request: Mapping[str, Any], go_on: Any) -> Answer:
    """What the form is made of, and what plays first: ``{"laws": ..., "drives": ..., "system": ..., "first": ...}``."""
    return {
        "laws": {name: _part(make) for name, make in ss.scenarios.LAWS.items()},
        "drives": {name: _part(make) for name, make in ss.scenarios.DRIVES.items()},
        "system": _part(ss.Oscillator),
        "contact": _part(ss.Contact),
        "first": {"name": FIRST, "about": ss.systems.scenario_case(FIRST).about, "state": first_state()},
    }, {}


def presets(request: Mapping[str, Any], go_on: Any) -> Answer:
    """The scenarios, those together that are told alike: what is searched, once somebody searches."""
    cases = [ss.systems.scenario_case(name) for name in ss.scenarios.names()]
    alike = itertools.groupby(cases, key=lambda case: (case.about, case.parts))
    return {"presets": [{"about": about, "names": [case.name for case in group]} for (about, _), group in alike]}, {}


def boundary(request: Mapping[str, Any], go_on: Any) -> Answer:
    """Den Hartog's line: the friction ratio at which sliding first stops, over the frequency ratio."""
    ratios = ss.consistent.sliding_boundary(BOUNDARY)
    return {"boundary": list(zip(BOUNDARY, map(float, ratios), strict=True))}, {}


def first_state() -> dict[str, Any]:
    """What plays when the page opens: few cycles, so that one sees their shape."""
    state: dict[str, Any] = json.loads(
        ss.systems.export_system(ss.systems.scenario_case(FIRST).lasting(cycles=8), format="json")
    )
    return state


def _part(make: Any) -> dict[str, Any]:
    """A class by its label, in a line, and parameter by parameter."""
    return {
        "label": getattr(make, "label", ""),
        "about": _plain(inspect.cleandoc(make.__doc__ or "").split("\n\n")[0]),
        "parameters": [_parameter(field) for field in dataclasses.fields(make)],
    }


def _plain(text: str) -> str:
    """A docstring's sentence without its marks."""
    for mark, shown in TEX:
        text = re.sub(mark, shown, text)
    return " ".join(text.split())


def _parameter(field: dataclasses.Field[Any]) -> dict[str, Any]:
    declared = field.metadata["parameter"]
    default = None if field.default is dataclasses.MISSING else field.default
    entry = {
        "name": field.name,
        "label": declared.name,
        "unit": "" if declared.unit == "1" else declared.unit,
        "words": _plain(declared.note),  # what the name and the unit beside it do not say
        "default": default if isinstance(default, int | float | str | None) else None,
        "optional": field.default is not dataclasses.MISSING,
        "choices": list(declared.choices),
        "part": field.name in MORE and not declared.choices,
    }
    empty: dict[str, Any] = {"unit": "", "words": "", "default": None, "optional": False, "choices": [], "part": False}
    return {name: value for name, value in entry.items() if name in ("name", "label") or value != empty[name]}
