"""Two numbers that should be one: by how many standard deviations they are apart, and what that means."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from stickslip.estimate import plain

HOLDS, FAILS, UNTOLD = "holds", "fails", "can not be told"
APART = 3.0  # standard deviations from which two numbers are not one


@dataclass(frozen=True)
class Check:
    """One thing that must be true if everything stated is.

    Attributes
    ----------
    name : str
        What is checked.
    left, right : float
        The two sides; NaN where there are none.
    unit : str
        Of both.
    discrepancy : float
        How far they are apart, in standard deviations; of a bound, by how much it is overstepped, and zero within.
    verdict : str
        "holds", "fails" or "can not be told".
    sentence : str
        What that means.
    """

    name: str
    left: float
    right: float
    unit: str
    discrepancy: float
    verdict: str
    sentence: str

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; what is not finite becomes ``None``."""
        return dict(plain(vars(self)))

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        sides = f" ({_plainly(self.left)} against {_plainly(self.right)}{unit}, {self.discrepancy:.1f} sd)"
        return f"{self.name}: {self.verdict}{sides if math.isfinite(self.discrepancy) else ''}: {self.sentence}"


def _plainly(value: float) -> str:
    """Four digits, without a power of ten where none is needed."""
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e7 else f"{value:.4g}"


def compared(
    name: str, left: float, right: float, *, sd: float, unit: str, holds: str, fails: str, bound: bool = False
) -> Check:
    """A check of two numbers that should be one; with `bound`, of a left side that should not exceed the right."""
    apart = max(0.0, left - right) if bound else abs(left - right)
    discrepancy = apart / sd if sd > 0 else math.inf if apart else 0.0
    return judged(name, left, right, discrepancy, unit=unit, holds=holds, fails=fails)


def judged(name: str, left: float, right: float, discrepancy: float, *, unit: str, holds: str, fails: str) -> Check:
    """A check whose discrepancy is known."""
    fine = discrepancy <= APART
    return Check(name, left, right, unit, discrepancy, HOLDS if fine else FAILS, holds if fine else fails)


def untold(name: str, why: str) -> Check:
    """A check that the record does not allow."""
    return Check(name, math.nan, math.nan, "1", math.nan, UNTOLD, why)
