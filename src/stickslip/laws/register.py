"""The laws that every room knows by name: those of the room's stub that carry a formula."""

from __future__ import annotations

import functools
from dataclasses import MISSING, fields
from typing import Any

from stickslip import laws
from stickslip.laws.guessing import RIGID, Family, Hypothesis


@functools.cache
def registered() -> dict[str, type[Any]]:
    """Laws by the name that a file, a command and a page know them by, the simplest first; others may be added.

    Examples
    --------
    >>> registered()["Coulomb"].formula
    'f = kinetic sign(v) while sliding, |f| <= static at rest'
    """
    listed = {name: getattr(laws, name) for name in laws.__all__}
    known = {name: law for name, law in listed.items() if hasattr(law, "formula")}
    return dict(sorted(known.items(), key=lambda item: required(item[1])))


def required(law: type[Any]) -> int:
    """How many parameters of a law must be given."""
    return sum(field.default is MISSING for field in fields(law))


def hypotheses() -> dict[str, Hypothesis]:
    """What records are asked to choose from, by name: rigid contacts, then others, the simplest of both first."""
    known = [each for law in registered().values() if hasattr(law, "hypotheses") for each in law.hypotheses()]
    return {each.name: each for each in sorted(known, key=lambda each: each.family is not RIGID)}


def family_of(name: str) -> Family:
    """The family of a law by its name; one that is no hypothesis is its own."""
    known = hypotheses().get(name)
    return known.family if known else Family(name, name)
