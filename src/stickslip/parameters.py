"""The parameters of a system by name: "kinetic" wherever it stands, "law.stiffness" in one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from stickslip.errors import ModelError
from stickslip.settings import nearest

Path = tuple[str, ...]
Part = TypeVar("Part")
UNITS = {
    "kinetic": "N", "static": "N", "forces": "N", "error": "N", "mass": "kg", "stiffness": "N/m", "stiffnesses": "N/m",
    "damping": "N s/m", "slope": "N s/m", "gradient": "N/m", "rate": "1/(N s)", "steepness": "s/m", "speeds": "m/s",
    "speed": "m/s", "amplitude": "m", "frequency": "Hz", "phase": "rad", "fs": "Hz", "samples": "m",
    "HarmonicForce.amplitude": "N", "viscous": "N s/m", "normal": "N", "distance": "m", "reference": "m/s",
    "preload": "N", "times": "s", "lag": "s",
}  # fmt: skip
PARTS = ("law", "drive", "contacts")  # what holds parameters of its own


def places(part: Any, within: Path = ()) -> dict[Path, Any]:
    """Where each parameter stands, with the part it belongs to: the system's own first, then those of its parts.

    Examples
    --------
    >>> from stickslip import Oscillator
    >>> from stickslip.laws import CompliantContact
    >>> slider = Oscillator(mass=1, stiffness=4, law=CompliantContact(kinetic=1, stiffness=1e5))
    >>> [".".join(path) for path in places(slider)][-4:]
    ['law.stiffness', 'law.damping', 'law.static', 'law.rule']
    """
    found = {(*within, field.name): part for field in fields(part)}
    for name in PARTS:
        inner = getattr(part, name, None)
        if name == "contacts" and inner is not None:
            for number, contact in enumerate(inner, start=1):
                found |= places(contact, (*within, name, str(number)))
        elif is_dataclass(inner):
            found |= places(inner, (*within, name))
    return found


def find(system: Any, name: str) -> tuple[Path, ...]:
    """The places that a name means: with points one, without the outermost, and that in every contact alike.

    Raises
    ------
    ModelError
        No parameter has that name.
    """
    known = places(system)
    own = tuple(name.split("."))
    if own in known:
        return (own,)
    named = [path for path in known if path[-1] == name]
    if not named:
        choices = list(dict.fromkeys(".".join(path) if "." in name else path[-1] for path in known))
        choices = [choice for choice in choices if choice.rpartition(".")[2] not in PARTS]
        raise ModelError(f"no parameter is called '{name}'", f"there are {', '.join(choices)}", nearest(name, choices))
    return tuple(path for path in named if _unnumbered(path) == _unnumbered(named[0]))


def unit(system: Any, name: str) -> str:
    """The SI unit of a parameter, "1" of a plain number.

    Examples
    --------
    >>> from stickslip import Oscillator
    >>> from stickslip.drives import HarmonicForce
    >>> from stickslip.laws import CompliantContact
    >>> contact = CompliantContact(kinetic=1, stiffness=1e5)
    >>> pushed = Oscillator(mass=1, stiffness=4, law=contact, drive=HarmonicForce(2, frequency=3))
    >>> unit(pushed, "law.damping"), unit(pushed, "drive.amplitude"), unit(contact, "kinetic")
    ('N s/m', 'N', 'N')
    """
    path = find(system, name)[0]
    part = type(places(system)[path]).__name__
    return UNITS.get(f"{part}.{path[-1]}", UNITS.get(path[-1], "1"))


def changed(system: Part, changes: Mapping[str, Any]) -> Part:
    """The system with other values: whole parts first, then what stands in them."""
    whole = {name: value for name, value in changes.items() if name.rpartition(".")[2] in PARTS and find(system, name)}
    for some in (whole, {name: value for name, value in changes.items() if name not in whole}):
        system = _rebuilt(system, {path: value for name, value in some.items() for path in find(system, name)})
    return system


def _rebuilt(part: Any, values: Mapping[Path, Any]) -> Any:
    own = {path[0]: value for path, value in values.items() if len(path) == 1}
    for name in {path[0] for path in values if len(path) > 1}:
        below = {path[1:]: value for path, value in values.items() if path[0] == name and len(path) > 1}
        inner = getattr(part, name)
        if name != "contacts":
            own[name] = _rebuilt(inner, below)
            continue
        numbered = {n: {p[1:]: v for p, v in below.items() if p[0] == str(n)} for n in range(1, len(inner) + 1)}
        own[name] = [_rebuilt(contact, numbered[n]) for n, contact in enumerate(inner, start=1)]
    return replace(part, **own) if own else part


def _unnumbered(path: Path) -> Path:
    return tuple(word for word in path if not word.isdigit())
