"""Two numbers that should be one: by how many standard deviations they are apart, and what that means."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
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

    def cured(self, slip: Slip) -> float:
        """The misfit without a slip."""
        return self.misfit({**self.values, **{name: by * self.values[of] for name, (of, by) in slip.cure.items()}})

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


@dataclass(frozen=True)
class Slip:
    """A slip of the hand that would make the channels agree.

    Attributes
    ----------
    words : str
        What it is.
    cure : mapping of str to (str, float)
        Of each channel that is wrong: the channel that it should be read as, and times what.
    """

    words: str
    cure: Mapping[str, tuple[str, float]]


def mixups(balance: Amplitudes) -> tuple[Slip, ...]:
    """Every slip that would make the channels agree, the best first; none where they agree or none would."""
    before = balance.misfit(balance.values)
    most = 2 * APART**2
    tried = sorted(((balance.cured(slip), slip) for slip in _slips(balance.values)), key=lambda each: each[0])
    near = max(most, 1.2 * tried[0][0])
    return tuple(slip for misfit, slip in tried if before > most and misfit < near and misfit * BETTER < before)


def slip_check(balance: Amplitudes, slips: Sequence[Slip]) -> list[Check]:
    """A check that names the slips; none without any."""
    if not slips:
        return []
    before, after = balance.misfit(balance.values) ** 0.5, balance.cured(slips[0]) ** 0.5
    return [Check(ONE_SLIP, before, after, "1", before, FAILS, " or ".join(slip.words for slip in slips))]


def _slips(names: Iterable[str]) -> Iterator[Slip]:
    """Every channel turned round, every two exchanged, every usual unit mistaken."""
    for name in names:
        yield Slip(f"{name} has the wrong sign", {name: (name, -1.0)})
    for one, other in combinations(names, 2):
        yield Slip(f"{one} and {other} are exchanged", {one: (other, 1.0), other: (one, 1.0)})
    for name in names:
        for unit, factor in UNITS.get(name, {}).items():
            yield Slip(f"{name} is in {unit}, not in its SI unit", {name: (name, factor)})
