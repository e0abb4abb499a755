"""A parameter is declared once, as a field of its class: unit, name, bounds; and is found by name in a system.

``kinetic: float = parameter("N", "sliding friction")`` is all that is said of it: what is refused, the
docstring, the keys of a system's file, the forms of the lab and the names of what was fitted are read from there.
"""

from __future__ import annotations

import inspect
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar, dataclass_transform, overload

from stickslip.errors import ModelError
from stickslip.settings import nearest

Path = tuple[str, ...]
Part = TypeVar("Part")
PARTS = ("law", "drive", "drives", "contacts")  # what holds parameters of its own
NUMBERED = ("drives", "contacts")  # of them, those of which there are several
SECTION = re.compile(r"^\S.*\n-{3,}$", re.MULTILINE)  # the heading of a numpydoc section


@dataclass(frozen=True)
class Parameter:
    """What is declared of a field: how :func:`parameter` was called."""

    unit: str = ""
    name: str = ""
    note: str = ""
    positive: bool = False
    signed: bool = False
    choices: tuple[str, ...] = ()
    size: str = "number"

    @property
    def described(self) -> str:
        """The sentence of the docstring: "Sliding friction [N]; the level at high speed."."""
        unit = f" [{self.unit}]" if self.unit not in ("", "1") else ""
        note = f"; {self.note}" if self.note else ""
        return f"{self.name[:1].upper()}{self.name[1:]}{unit}{note}."

    def check(self, name: str, value: Any) -> None:
        """Refuse a value that the parameter can not have; an array is its class's to check."""
        if self.choices and value not in self.choices:
            raise ModelError(
                f"{name} = {value!r}", f"{self.name}: {' or '.join(map(repr, self.choices))}", f"choose one as {name}="
            ).of(name)
        if self.size == "row" and (isinstance(value, str) or not isinstance(value, Iterable)):
            raise ModelError(
                f"{name} = {value!r}", f"{self.name} are a list of numbers", f"write {name}=[{value!r}]"
            ).of(name)
        if self.unit and self.size != "array":
            for number in value if self.size == "row" else [value]:
                finite(name, number, unit=self.unit, positive=self.positive, signed=self.signed)


def parameter(
    unit: str,
    name: str,
    *,
    default: Any = MISSING,
    note: str = "",
    positive: bool = False,
    signed: bool = False,
    choices: tuple[str, ...] = (),
    size: str = "number",
) -> Any:
    """A field of a law, a drive or a system: finite and not negative where nothing else is said.

    Parameters
    ----------
    unit : str
        In SI (Hz for a frequency), "1" of a plain number; empty where it is no number.
    name : str
        What it is called, "sliding friction".
    default
        As of any dataclass's field.
    note : str
        What else the docstring says.
    positive, signed : bool
        Zero is refused; a negative number is not.
    choices : tuple of str
        The words that it may be.
    size : {"number", "row", "array"}
        One number; a row of which every number has these bounds; an array or matrix, which its class checks as a whole.

    Returns
    -------
    Field
        The field, with all of this in its metadata.

    Examples
    --------
    >>> @parametric
    ... class Viscous:
    ...     slope: float = parameter("N s/m", "damping", signed=True)
    >>> declared(Viscous, "slope").described
    'Damping [N s/m].'
    """
    declared = Parameter(unit, name, note, positive, signed, choices, size)
    return field(default=default, metadata={"parameter": declared})


@overload
def parametric(part: type[Part], *, eq: bool = ...) -> type[Part]: ...
@overload
def parametric(part: None = ..., *, eq: bool = ...) -> Callable[[type[Part]], type[Part]]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(parameter, field))
def parametric(part: Any = None, *, eq: bool = True) -> Any:
    """A frozen dataclass whose parameters are checked before its own ``__post_init__``, and stand in its docstring.

    Examples
    --------
    >>> @parametric
    ... class Grip:
    ...     level: float = parameter("N", "level", positive=True)
    >>> Grip(-1.0)
    Traceback (most recent call last):
    stickslip.errors.ModelError: level = -1.0 N; level is finite and positive; correct level=.
    """
    if part is None:
        return lambda part: parametric(part, eq=eq)
    beyond = getattr(part, "__post_init__", None)

    def check(self: Any) -> None:
        for name, default, declared in known:
            value = getattr(self, name)
            if not (value is None and default is None):  # left out
                declared.check(name, value)
        if beyond is not None:
            beyond(self)

    part.__post_init__ = check
    made = dataclass(frozen=True, eq=eq)(part)
    made.__doc__ = _documented(made)
    known = [(own.name, own.default, declaration(own)) for own in fields(made)]
    return made


def declaration(of: Field[Any]) -> Parameter:
    """What a field declares; nothing, where it is a plain one."""
    declared = of.metadata.get("parameter")
    return declared if isinstance(declared, Parameter) else Parameter()


def declared(part: type, name: str) -> Parameter:
    """What the class of a part declares of the parameter `name`."""
    return next(declaration(own) for own in fields(part) if own.name == name)


def _documented(part: Any) -> str | None:
    """The docstring with its section Attributes, before the first section that is written."""
    written: str | None = part.__doc__
    if not written or not fields(part):
        return written
    text = inspect.cleandoc(written)
    first = SECTION.search(text)
    place = first.start() if first else len(text)
    lines = [line for own in fields(part) for line in _entry(own)]
    before, after = text[:place].rstrip(), text[place:]
    return "\n".join([before, "", "Attributes", "----------", *lines, "", after]).rstrip() + "\n"


def _entry(of: Field[Any]) -> Iterator[str]:
    declared = declaration(of)
    kind = "{" + ", ".join(f'"{choice}"' for choice in declared.choices) + "}" if declared.choices else str(of.type)
    default = "" if of.default is MISSING or of.default is None else f", default {of.default!r}"
    yield f"{of.name} : {kind.replace(' | ', ' or ')}{default}"
    yield from textwrap.wrap(declared.described, 112, initial_indent="    ", subsequent_indent="    ")


def finite(name: str, value: float, *, unit: str, positive: bool = False, signed: bool = False) -> float:
    """`value`, if the parameter can have it: finite, and not negative unless `signed`, not zero if `positive`."""
    if type(value) is float and 0.0 < value < math.inf:  # as nearly all are: a fit asks some hundred times a trial
        return value
    try:
        known, number = math.isfinite(value), float(value)
    except (TypeError, ValueError):
        raise ModelError(f"{name} = {value!r}", f"{name} is a number [{unit}]", f"correct {name}=").of(name) from None
    if not known or (number < 0 and not signed) or (number == 0 and positive):
        rule = (
            "is a finite number" if signed else "is finite and positive" if positive else "is finite and not negative"
        )
        shown = value if unit in ("", "1") else f"{value} {unit}"
        raise ModelError(f"{name} = {shown}", f"{name} {rule}", f"correct {name}=").of(name)
    return number


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
    parts = {(*within, field.name): part for field in fields(part)}
    for name in PARTS:
        inner = getattr(part, name, None)
        if name in NUMBERED and inner is not None:
            for number, contact in enumerate(inner, start=1):
                parts |= places(contact, (*within, name, str(number)))
        elif is_dataclass(inner):
            parts |= places(inner, (*within, name))
    return parts


def find(system: Any, name: str) -> tuple[Path, ...]:
    """The places that a name means: with points one, without the outermost, and that in every contact alike.

    Raises
    ------
    ModelError
        No parameter has that name.
    """
    return _places_of(places(system), name)


def _places_of(known: Mapping[Path, Any], name: str) -> tuple[Path, ...]:
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
    return named(system, name).unit or "1"


def named(system: Any, name: str) -> Parameter:
    """What is declared of the parameter that a name means, by :func:`find`."""
    path = find(system, name)[0]
    return declared(type(places(system)[path]), path[-1])


def changed(system: Part, changes: Mapping[str, Any]) -> Part:
    """The system with other values: whole parts first, then what stands in them."""
    whole = {name: value for name, value in changes.items() if name.rpartition(".")[2] in PARTS and find(system, name)}
    for some in (whole, {name: value for name, value in changes.items() if name not in whole}):
        known = places(system) if some else {}
        system = _rebuilt(system, {path: value for name, value in some.items() for path in _places_of(known, name)})
    return system


def _rebuilt(part: Any, values: Mapping[Path, Any]) -> Any:
    own = {path[0]: value for path, value in values.items() if len(path) == 1}
    for name in {path[0] for path in values if len(path) > 1}:
        below = {path[1:]: value for path, value in values.items() if path[0] == name and len(path) > 1}
        inner = getattr(part, name)
        if name not in NUMBERED:
            own[name] = _rebuilt(inner, below)
            continue
        numbered = {n: {p[1:]: v for p, v in below.items() if p[0] == str(n)} for n in range(1, len(inner) + 1)}
        own[name] = [_rebuilt(contact, numbered[n]) for n, contact in enumerate(inner, start=1)]
    return replace(part, **own) if own else part


def _unnumbered(path: Path) -> Path:
    return tuple(word for word in path if not word.isdigit())
