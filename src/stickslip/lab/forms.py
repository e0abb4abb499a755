"""What the page offers: every law and drive with its parameters, units and words, and the scenarios to begin with."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Mapping
from typing import Any

import stickslip as ss

Answer = tuple[dict[str, Any], dict[str, Any]]
CHOICE = re.compile(r"\{(.+)\}")
UNIT = re.compile(r"\[([^\]]+)\]")
TEX = (
    (r":math:`([^`]*)`", r"\1"), (r"``?", ""), (r"\\mathrm{(\w+)}", r"\1"),
    (r"\\dot\s*\\?(\w+)", r"\1'"), (r"\^{(.*?)}", r"^(\1)"),
    (r"\\le\b", "≤"), (r"\\,", " "), (r"\\varphi", "φ"), (r"\\pi", "π"), (r"\\tau", "τ"), (r"\\?theta", "θ"),
    (r"\\gamma", "γ"), (r"\\sigma", "σ"), (r"\\delta", "δ"), (r"\\alpha", "α"), (r"\\(\w+)", r"\1"),
)  # fmt: skip
MORE = ("law", "drive", "contacts")


def catalog(request: Mapping[str, Any], go_on: Any) -> Answer:
    """All that can be chosen: ``{"laws": ..., "drives": ..., "system": ..., "presets": ...}``."""
    return {
        "laws": {name: _part(make) for name, make in ss.scenarios.LAWS.items()},
        "drives": {name: _part(make) for name, make in ss.scenarios.DRIVES.items()},
        "system": _part(ss.Oscillator),
        "contact": _part(ss.Contact),
        "boundary": [[b, r] for b, damping, r in ss.scenarios.grid("DH-2")["boundary"] if damping == 0],
        "presets": [_preset(name) for name in ss.scenarios.names()],
    }, {}


def _preset(name: str) -> dict[str, Any]:
    case = ss.scenario_case(name)
    return {"name": name, "about": case.about, "parts": case.parts}


def _part(make: Any) -> dict[str, Any]:
    """A class by what its docstring says: in a line, and parameter by parameter."""
    text = inspect.cleandoc(make.__doc__ or "")
    return {
        "about": _plain(text.split("\n\n")[0]),
        "parameters": [_parameter(field, text) for field in dataclasses.fields(make)],
    }


def _plain(text: str) -> str:
    """A docstring's sentence without its marks."""
    for found, shown in TEX:
        text = re.sub(found, shown, text)
    return " ".join(text.split())


def _parameter(field: dataclasses.Field[Any], text: str) -> dict[str, Any]:
    found = re.search(rf"^(?:\w+, )*{field.name}(?:, \w+)* : (.*)\n((?:    .*\n?)+)", text, re.MULTILINE)
    kind, words = (found[1], " ".join(found[2].split())) if found else ("", "")
    choice, unit = CHOICE.match(kind), UNIT.search(words)
    default = None if field.default is dataclasses.MISSING else field.default
    return {
        "name": field.name,
        "unit": unit[1] if unit else "",
        "words": _plain(words),
        "default": default if isinstance(default, int | float | str | None) else None,
        "optional": "None" in kind or field.default is not dataclasses.MISSING,
        "choices": re.findall(r'"(.*?)"', choice[1]) if choice else [],
        "part": field.name in MORE and not choice,
    }
