"""Which laws records are asked to choose from: those registered that say where their search begins."""

from __future__ import annotations

from stickslip.laws.guessing import RIGID, Family, Hypothesis
from stickslip.laws.register import registered


def hypotheses() -> dict[str, Hypothesis]:
    """By name and in the order of their trial: rigid contacts, then others, the simplest of both first."""
    known = [each for law in registered().values() if hasattr(law, "hypotheses") for each in law.hypotheses()]
    return {each.name: each for each in sorted(known, key=lambda each: each.family is not RIGID)}


def family_of(name: str) -> Family:
    """The family of a law by its name; one that is no hypothesis is its own."""
    known = hypotheses().get(name)
    return known.family if known else Family(name, name)
