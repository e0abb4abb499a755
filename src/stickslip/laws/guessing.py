"""Where the search for a law's parameters begins: what a law may ask of measured friction, and how it is then tried.

The laws that every room knows by name: those of the room's stub that carry a formula.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from stickslip import laws
from stickslip.errors import ModelError
from stickslip.parameters import declaration
from stickslip.units import dimensions

Array = NDArray[np.float64]

LEAST_EXCESS = 0.03  # of the static friction over the kinetic, at a start
EXCESSES = (0.06, 0.2, 0.4)  # the misfit has several valleys over it: where else a search starts
SPEEDS = (0.02, 0.3)  # of the largest speed: where a Stribeck curve falls
GRID = 16  # values that are tried of one parameter
LITTLE = 0.01  # of the kinetic friction, by which the static one exceeds it at a start
FALLS = (0.01, 0.05)  # of the largest speed, within which a Stribeck curve falls
STIFF = 1e-2  # of the smallest stroke, by which a contact gives way that counts as rigid where a rigid law does as well
STIFFEST = 1e-4  # of the stroke: what a contact that is next to rigid gives way
STARTS, DECADES = 32, 4.0  # of a law that does not guess: starts, and decades about its natural size for a parameter


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
        Those simpler laws, by name: it never leaves more than they do.
    holds : callable
        Whether a law of the class is this one, by its values.
    """

    name: str
    family: Family
    guesses: Callable[[Observed], list[Any]]
    continued: Callable[[Mapping[str, Searched]], list[Any]] = nothing
    contains: tuple[str, ...] = ()
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


def hypotheses() -> dict[str, Hypothesis]:
    """What records are asked to choose from, by name: rigid contacts, then others, the simplest of both first."""
    known = [
        hypothesis for law in registered().values() if hasattr(law, "hypotheses") for hypothesis in law.hypotheses()
    ]
    return {kind.name: kind for kind in sorted(known, key=lambda kind: kind.family is not RIGID)}


def family_of(name: str) -> Family:
    """The family of a law by its name; one that is no hypothesis is its own."""
    known = hypotheses().get(name)
    return known.family if known else Family(name, f"that of the law {name}")


def hypothesis_of(law: Any) -> Hypothesis:
    """As what a law is tried: by its name, its class, or an instance with the values to start from.

    Raises
    ------
    ModelError
        No law has that name, or it is none.

    Examples
    --------
    >>> [hypothesis_of(law).name for law in ("state-variable", laws.Dahl, laws.Coulomb(1.0, static=1.2))]
    ['state variable', 'Dahl', 'static']
    """
    named = _named(law) if isinstance(law, str) else law
    if isinstance(named, Hypothesis):
        return named
    kind: type[Any] = named if isinstance(named, type) else type(named)
    if not (hasattr(kind, "modes") or hasattr(kind, "rates")):
        raise ModelError(f"law {law!r}", "a law has modes() or rates()", "give a law, its class or its name")
    own: tuple[Hypothesis, ...] = kind.hypotheses() if hasattr(kind, "hypotheses") else ()
    fitting = [one for one in own if isinstance(law, str | type) or one.holds(law)]
    if fitting:
        return fitting[0] if isinstance(law, str | type) else fitting[-1]
    return Hypothesis(kind.__name__, family_of(kind.__name__), functools.partial(declared_guesses, kind))


def contained(kind: Hypothesis) -> set[str]:
    """The simpler laws that a law contains, and those that these contain."""
    known = hypotheses()
    own = {name for name in kind.contains if name in known}
    return own.union(*(contained(known[name]) for name in own))


def _named(name: str) -> Any:
    """A law as it is called among the hypotheses, or in the register."""
    known: dict[str, Any] = {**registered(), **hypotheses()}
    plain = {_plain(one): one for one in known}
    if _plain(name) not in plain:
        raise ModelError(
            f"law '{name}'",
            f"laws are {', '.join([*hypotheses(), *(one for one in registered() if one not in hypotheses())])}",
            "choose among these, or give a law",
        )
    return known[plain[_plain(name)]]


def _plain(name: str) -> str:
    return name.lower().replace("-", "").replace("_", "").replace(" ", "")


def declared_guesses(law: type[Any], seen: Observed) -> list[Any]:
    """Where the search for a law begins that says no more of its parameters than their units.

    Every unit is made of a force, a length and a time, and the friction has one of each: its level, the way and the
    time of the motion. Forces begin at the level; all else is spread about that natural size, together (an additive
    recurrence in the logarithms), since ever so many values of each would be ever so many starts.

    Raises
    ------
    ModelError
        A parameter that must be given is no number with a unit.
    """
    asked = {own.name: declaration(own) for own in fields(law) if own.default is MISSING}
    if strange := [name for name, one in asked.items() if not one.unit or one.size != "number"]:
        raise ModelError(
            f"{law.__name__} without values",
            f"its {' and '.join(strange)} can not be guessed from a record",
            "give the law with its values",
        )
    sizes = {name: natural_size(one.unit, seen) for name, one in asked.items()}
    spread = [name for name, one in asked.items() if one.unit != "N"]
    golden = _golden(len(spread))
    guesses = []
    for number in range(STARTS if spread else 1):
        places = (0.5 + number * golden ** -np.arange(1.0, len(spread) + 1)) % 1
        factors = dict(zip(spread, 10 ** (DECADES * (places - 0.5)), strict=True))
        try:
            guesses.append(law(**{name: float(size * factors.get(name, 1.0)) for name, size in sizes.items()}))
        except ModelError:  # values that the law itself does not allow together
            continue
    return guesses


def natural_size(unit: str, seen: Observed) -> float:
    """What a quantity is when measured by the friction's level, the way and the time of the motion."""
    mass, length, time = dimensions(unit)
    way, while_ = seen.fastest / seen.frequency, 1 / seen.frequency
    return float((seen.level * while_**2 / way) ** mass * way**length * while_**time)


def _golden(count: int) -> float:
    """The root of ``g^(count + 1) = g + 1``, whose powers step evenly through so many dimensions."""
    root = 2.0
    for _ in range(30):
        root = (1 + root) ** (1 / (count + 1))
    return root
