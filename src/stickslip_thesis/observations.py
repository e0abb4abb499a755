"""What the text says that one should see, chapter by chapter, and whether our figures show it: by numbers."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stickslip_thesis.printed import Given, read

MOST_TOLD = 6  # numbers that are told one by one


@dataclass(frozen=True)
class Observation:
    """One thing to see.

    Attributes
    ----------
    chapter, section : str
        Where the text says it.
    figures : tuple of str
        In which figures; none where it is not drawn.
    says : str
        What is to be seen, in our words.
    measure : str
        Its name among the measures of its chapter: a number or several.
    above, below : float
        Between which all of them have to lie.
    why : str
        Why ours does not show it; empty where it has to.
    """

    chapter: str
    section: str
    figures: tuple[str, ...]
    says: str
    measure: str
    above: float
    below: float
    why: str

    def shown(self, values: Sequence[float]) -> bool:
        """Do all of its numbers lie where they should?

        Examples
        --------
        >>> Observation("2", "2.3", ("2.3",), "what is left is noise", "left", -np.inf, 0.1, "").shown([0.02, 0.05])
        True
        """
        return all(self.above < value < self.below for value in values)


@dataclass(frozen=True)
class Seen:
    """An observation with its numbers."""

    observation: Observation
    values: tuple[float, ...]

    @property
    def shown(self) -> bool:
        """Whether ours shows it."""
        return self.observation.shown(self.values)

    @property
    def text(self) -> str:
        """The numbers and what they should be.

        Examples
        --------
        >>> Seen(Observation("2", "2.3", (), "what is left is noise", "left", -np.inf, 0.1, ""), (0.0213,)).text
        'left: 0.0213, below 0.1'
        """
        bounds = [("above", self.observation.above), ("below", self.observation.below)]
        wanted = " and ".join(f"{word} {bound:g}" for word, bound in bounds if np.isfinite(bound))
        told = ", ".join(f"{value:.3g}" for value in self.values)
        if len(self.values) > MOST_TOLD:
            told = f"{min(self.values):.3g} to {max(self.values):.3g}"
        return f"{self.observation.measure}: {told}, {wanted}"


@functools.cache
def observations() -> tuple[Observation, ...]:
    """All of them, in the order of the text."""
    return tuple(
        Observation(
            entry["section"].partition(".")[0],
            entry["section"],
            tuple(entry.get("figures", ())),
            entry["says"],
            entry["measure"],
            entry.get("above", -np.inf),
            entry.get("below", np.inf),
            entry.get("why", ""),
        )
        for entry in read("observations.toml")["observation"]
    )


def seen(chapter: str, given: Given) -> tuple[Seen, ...]:
    """The observations of a chapter, measured on what its figures show."""
    own = [one for one in observations() if one.chapter == chapter]
    if not own:
        return ()
    from stickslip_thesis.measures import MEASURES

    values = MEASURES[chapter](given)
    return tuple(Seen(one, tuple(float(value) for value in np.atleast_1d(values[one.measure]))) for one in own)
