"""Where the search for a law's parameters begins: what a law may ask of measured friction, and how it is then tried."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST_EXCESS = 0.03  # of the static friction over the kinetic, at a start
SPEEDS = (0.02, 0.3)  # of the largest speed: where a Stribeck curve falls
GRID = 16  # values that are tried of one parameter


class Observed(Protocol):
    """Sliding and friction of all records, end to end, as the sensors tell them without any law."""

    @property
    def slip(self) -> Array:
        """Way from one sample to the next [m]."""

    @property
    def speed(self) -> Array:
        """Velocity at the contact [m/s]."""

    @property
    def friction(self) -> Array:
        """Friction [N]."""

    @property
    def step(self) -> Array:
        """Time to the next sample [s]."""

    @property
    def level(self) -> float:
        """Friction of fast sliding [N]."""

    @property
    def excess(self) -> float:
        """By what part friction exceeds the level at a release, or at rest."""

    @property
    def fastest(self) -> float:
        """The largest speed [m/s]."""

    @property
    def frequency(self) -> float:
        """Angular frequency of the motion [rad/s]."""

    @property
    def mass(self) -> float:
        """What slides [kg]."""

    def left(self, modelled: Array) -> float:
        """Mean square of what a modelled friction leaves [N^2]."""


class Family(NamedTuple):
    """Laws that many records can not tell apart, and what is said where the friction is one of theirs."""

    name: str
    said: str


RIGID = Family("rigid", "that of a rigid contact")


def always(law: Any) -> bool:
    """Whatever the law's values."""
    return True


class Hypothesis(NamedTuple):
    """A law as :func:`compare_laws` tries it: its name there, its family, and where its search begins."""

    name: str
    family: Family
    guesses: Callable[[Observed], list[Any]]
    holds: Callable[[Any], bool] = always  # whether a law of the class, by its values, is this one


def share(column: Array, values: Array) -> float:
    """The factor by which a column explains values best."""
    power = float(column @ column)
    return float(column @ values) / power if power > 0 else 0.0
