"""Two numbers that should be one: by how many standard deviations they are apart, and what that means."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
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


LENGTHS = {"mm": 1e-3, "inch": 0.0254}
UNITS = {"x": LENGTHS, "z": LENGTHS, "a": {"g": 9.80665, "mm/s^2": 1e-3}, "load": {"lbf": 4.4482216152605}}
ONE_SLIP = "one slip that explains it"
BETTER = 25.0  # times by which a slip must lower the sum of squares to be named


@dataclass(frozen=True)
class Amplitudes:
    """Complex amplitudes of the channels at the forcing frequency, and what is known of the rig."""

    values: Mapping[str, complex]
    angular: float
    rig: Mapping[str, float]
    damper: str
    tolerance: float

    def misfit(self, values: Mapping[str, complex]) -> float:
        """Sum of squares, in standard deviations, of what should be zero, and of energy that runs the wrong way."""
        w, x = self.angular, values["x"]
        total = 0.0
        if "a" in values:
            moved = -(w**2) * x
            total += abs(values["a"] - moved) ** 2 / (2 * (self.tolerance * max(abs(moved), abs(values["a"]))) ** 2)
        if "load" in values and {"mass", "stiffness"} <= set(self.rig):
            k, m, c = self.rig["stiffness"], self.rig["mass"], self.rig.get("damping", 0.0)
            z = values.get("z", 0.0)
            inertia = m * values.get("a", -(w**2) * x)
            driven = 1j * w * c * (x - (z if self.damper == "base" else 0.0))
            rest = k * (z - x) - driven + values.get("force", 0.0) - inertia - values["load"]
            sizes = math.hypot(*(abs(term) for term in (k * z, k * x, inertia, values["load"])))
            total += abs(rest) ** 2 / (2 * (self.tolerance * sizes) ** 2)
        for name in ("z", "load"):
            if name in values and (name != "z" or "force" not in values):
                turned = (values[name] * complex(1j * x).conjugate()).real / (abs(values[name]) * abs(x))
                total += (min(0.0, turned) / self.tolerance) ** 2
        return total


def mixups(balance: Amplitudes, checks: Sequence[Check]) -> list[Check]:
    """A check that names every slip which would make the channels agree, or that none would."""
    before = balance.misfit(balance.values)
    most = 2 * APART**2
    tried = sorted((balance.misfit(values), slip) for slip, values in _slips(balance.values))
    cured = [mixup for misfit, mixup in tried if misfit < max(most, 1.2 * tried[0][0]) and misfit * BETTER < before]
    if before <= most or not cured:
        return []
    sentence = " or ".join(cured)
    return [Check(ONE_SLIP, before**0.5, tried[0][0] ** 0.5, "1", before**0.5, FAILS, sentence)]


def _slips(values: Mapping[str, complex]) -> Iterator[tuple[str, dict[str, complex]]]:
    """Every channel turned round, every two exchanged, every usual unit mistaken."""
    for name in values:
        yield f"{name} has the wrong sign", {**values, name: -values[name]}
    for one, other in combinations(values, 2):
        yield f"{one} and {other} are exchanged", {**values, one: values[other], other: values[one]}
    for name in values:
        for unit, factor in UNITS.get(name, {}).items():
            yield f"{name} is in {unit}, not in its SI unit", {**values, name: factor * values[name]}
