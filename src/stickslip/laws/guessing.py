"""Where the search for a law's parameters begins: what a law may ask of measured friction, and how it is then tried.

The laws that every room knows by name: those of the room's stub that carry a formula.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, NamedTuple, Protocol

import numpy as np

from stickslip import laws
from stickslip.arrays import Array
from stickslip.errors import ModelError
from stickslip.parameters import declaration
from stickslip.units import dimensions

LEAST_EXCESS = 0.03  # of the static friction over the kinetic, at a start
EXCESSES = (0.06, 0.2, 0.4)  # the misfit has several valleys over it: where else a search starts
SPEEDS = (0.02, 0.3)  # of the largest speed: where a Stribeck curve falls
GRID = 16  # values that are tried of one parameter
LITTLE = 0.01  # of the kinetic friction, by which the static one exceeds it at a start
FALLS = (0.01, 0.05)  # of the largest speed, within which a Stribeck curve falls
STIFF = 1e-2  # of the smallest stroke, by which a contact gives way that counts as rigid where a rigid law does as well
STIFFEST = 1e-4  # of the stroke: what a contact that is next to rigid gives way
MOST_GUESSED = 24  # starts of a law that is asked by its units alone: each costs a simulation


@dataclass(frozen=True, eq=False)
class Observed:
    """Sliding and friction of all records, end to end, as the sensors tell them without any law.

    Attributes
    ----------
    slip, speed, friction : ndarray (n,)
        Way [m] from one sample to the next, velocity [m/s] and friction [N] at the contact.
    step : ndarray (n,)
        Time [s] to the next sample.
    level : float
        Friction of fast sliding [N].
    excess : float
        By what part friction exceeds the level at a release, or at rest where there is none.
    frequency : float
        Angular frequency [rad/s] of the motion: speed over displacement.
    mass : float
        What slides [kg].
    """

    slip: Array
    speed: Array
    friction: Array
    step: Array
    level: float
    excess: float
    frequency: float
    mass: float

    @property
    def fastest(self) -> float:
        """The largest speed [m/s]."""
        return float(np.abs(self.speed).max())

    @property
    def furthest(self) -> float:
        """About how far it moves [m]."""
        return self.fastest / self.frequency

    def left(self, modelled: Array) -> float:
        """Mean square of what a modelled friction leaves [N^2]."""
        return float(np.mean((self.friction - modelled) ** 2))


class Searched(Protocol):
    """A law at the end of its search."""

    @property
    def law(self) -> Any:
        """With its values."""

    @property
    def mass(self) -> float:
        """What slides [kg]."""

    @property
    def scales(self) -> Array:
        """Largest way [m] and speed [m/s] of every stretch of a record (n, 2)."""

    @property
    def stiff(self) -> bool:
        """Whether its contact is next to rigid."""


class Family(NamedTuple):
    """Laws that many records can not tell apart, and what is said where the friction is one of theirs."""

    name: str
    said: str


RIGID = Family("rigid", "that of a rigid contact")


def always(law: Any) -> bool:
    """Whatever the law's values."""
    return True


def nothing(simpler: Mapping[str, Searched]) -> list[Any]:
    """No start of a law that contains none of the simpler ones."""
    return []


class Hypothesis(NamedTuple):
    """A law as :func:`compare_laws` tries it.

    Attributes
    ----------
    name : str
        What it is called there.
    family : Family
        With which others it is taken together.
    guesses : callable
        Where its search begins, from friction as it was observed.
    continued : callable
        Where else: at the end of the search of a simpler law that it contains, what it adds hardly felt.
    contains : tuple of str
        Those simpler laws, by name: it is searched anew from where they end, if it ends above.
    next_to : callable
        Where such a search begins, of one of them; where it continues it, if nothing is said.
    holds : callable
        Whether a law of the class is this one, by its values.
    """

    name: str
    family: Family
    guesses: Callable[[Observed], list[Any]]
    continued: Callable[[Mapping[str, Searched]], list[Any]] = nothing
    contains: tuple[str, ...] = ()
    next_to: Callable[[Mapping[str, Searched]], list[Any]] | None = None
    holds: Callable[[Any], bool] = always


def share(column: Array, values: Array) -> float:
    """The factor by which a column explains values best."""
    power = float(column @ column)
    return float(column @ values) / power if power > 0 else 0.0


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


def asked_for(law: type[Any]) -> tuple[Hypothesis, ...]:
    """How records are asked for a law: as its class says, or by the units of its parameters."""
    if hasattr(law, "hypotheses"):
        own: tuple[Hypothesis, ...] = law.hypotheses()
        return own
    family = Family(law.__name__, f"that of the law {law.__name__}")
    return (Hypothesis(law.__name__, family, functools.partial(_by_units, law)),)


def _by_units(law: type[Any], seen: Observed) -> list[Any]:
    """Laws whose values have the size of what was observed, of those that the class allows."""
    choices = [[(own.name, value) for value in _sized(law, own, seen)] for own in fields(law) if own.default is MISSING]
    allowed = list(_allowed(law, choices))
    if not allowed:
        raise ModelError(
            f"{law.__name__} refuses all values of the size of what was seen",
            "its search begins at one that it allows",
            "give the law with its values",
        )
    return allowed[:: math.ceil(len(allowed) / MOST_GUESSED)]  # the first ones have the first parameters alike


def _allowed(law: type[Any], choices: list[list[tuple[str, float]]]) -> Iterator[Any]:
    for chosen in itertools.product(*choices):
        try:
            yield law(**dict(chosen))
        except ModelError:  # a static friction below the kinetic
            continue


def _sized(law: type[Any], parameter: Any, seen: Observed) -> tuple[float, ...]:
    """Values to begin with, by a parameter's unit: forces about the level, the rest where a law's effects are felt."""
    declared, level, fastest, furthest = declaration(parameter), seen.level, seen.fastest, seen.furthest
    sizes = {
        "N": (level, (1 + EXCESSES[1]) * level),
        "m/s": tuple(part * fastest for part in SPEEDS),
        "s/m": tuple(1 / (part * fastest) for part in SPEEDS),
        "m": tuple(part * furthest for part in (STIFF, 0.1)),
        "N/m": tuple(
            level / (part * furthest) for part in (STIFF, 0.1, 10.0, STIFFEST)
        ),  # a contact's, or friction along the way
        "N s/m": (LITTLE * level / fastest, 0.1 * level / fastest),
        "s": tuple(part / seen.frequency for part in SPEEDS),
        "1/s": tuple(seen.frequency / part for part in SPEEDS),
        "kg": (seen.mass,),
        "1": (1.0, EXCESSES[1]),
    }
    if not declared.unit or declared.size != "number":
        raise ModelError(
            f"{law.__name__} of which no {parameter.name} is known",
            "records tell where to begin with a number that has a unit",
            "give the law with its values",
        )
    values = sizes.get(declared.unit) or (_natural(declared.unit, seen),)
    return (*values, *(-value for value in values)) if declared.signed else values


def _natural(unit: str, seen: Observed) -> float:
    """What a quantity is when measured by the friction's level, the way and the time of the motion."""
    powers, time = dimensions(unit), 1 / seen.frequency
    measures = {"mass": seen.level * time**2 / seen.furthest, "length": seen.furthest, "time": time}
    return float(math.prod(measures[name] ** power for name, power in powers.items()))


def hypotheses() -> dict[str, Hypothesis]:
    """What records are asked to choose from, by name: rigid contacts, then others, the simplest of both first."""
    telling = [law for law in registered().values() if hasattr(law, "hypotheses")]
    known = [hypothesis for law in telling for hypothesis in law.hypotheses()]
    return {kind.name: kind for kind in sorted(known, key=lambda kind: kind.family is not RIGID)}


def hypothesis_of(law: Any) -> Hypothesis:
    """How records are asked for a law: by the name of a hypothesis or of a law, by a class, or by one with values.

    Raises
    ------
    ModelError
        No law has that name.
    """
    if isinstance(law, str):
        named = {_plain(name): kind for name, kind in hypotheses().items()}
        named = {_plain(name): asked_for(kind)[0] for name, kind in registered().items()} | named
        if _plain(law) not in named:
            choices = ", ".join(dict.fromkeys([*hypotheses(), *registered()]))
            raise ModelError(f"law '{law}'", f"laws are {choices}", "choose among these, or give a law")
        return named[_plain(law)]
    kind = law if isinstance(law, type) else type(law)
    if not (hasattr(kind, "modes") or hasattr(kind, "rates")):
        raise ModelError(f"law {law!r}", "a law has modes or rates", "give a law's name, its class, or one with values")
    held = [hypothesis for hypothesis in asked_for(kind) if law is kind or hypothesis.holds(law)]
    return held[0] if law is kind else held[-1]


def contained(kind: Hypothesis) -> set[str]:
    """The simpler laws that a law contains, and those that these contain."""
    known = hypotheses()
    own = {name for name in kind.contains if name in known}
    return own.union(*(contained(known[name]) for name in own))


def _plain(name: str) -> str:
    return name.strip().lower().replace("-", "").replace("_", "").replace(" ", "")


def family_of(name: str) -> Family:
    """The family of a law by its name; one that is no hypothesis is its own."""
    known = hypotheses().get(name)
    return known.family if known else Family(name, f"that of the law {name}")
