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

Array = NDArray[np.float64]

LEAST_EXCESS = 0.03  # of the static friction over the kinetic, at a start
EXCESSES = (0.06, 0.2, 0.4)  # the misfit has several valleys over it: where else a search starts
SPEEDS = (0.02, 0.3)  # of the largest speed: where a Stribeck curve falls
GRID = 16  # values that are tried of one parameter
LITTLE = 0.01  # of the kinetic friction, by which the static one exceeds it at a start
FALLS = (0.01, 0.05)  # of the largest speed, within which a Stribeck curve falls
STIFF = 1e-2  # of the smallest stroke, by which a contact gives way that counts as rigid where a rigid law does as well
STIFFEST = 1e-4  # of the stroke: what a contact that is next to rigid gives way


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
    holds : callable
        Whether a law of the class is this one, by its values.
    """

    name: str
    family: Family
    guesses: Callable[[Observed], list[Any]]
    continued: Callable[[Mapping[str, Searched]], list[Any]] = nothing
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
    return known.family if known else Family(name, name)
