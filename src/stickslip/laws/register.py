"""The laws that every room knows by name: those that the room's stub lists and that carry a formula."""

from __future__ import annotations

import functools
from dataclasses import MISSING, fields
from typing import Any

from stickslip import laws


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
