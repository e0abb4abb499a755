"""Two numbers that should be one: by how many standard deviations they are apart, and what that means.

The single slip of the hand that would make channels, clock and constants agree: a sign, two cables, a unit.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

from stickslip.estimate import Plain
from stickslip.units import parse_unit

HOLDS, FAILS, UNTOLD = "holds", "fails", "can not be told"
APART = 3.0  # standard deviations from which two numbers are not one


@dataclass(frozen=True)
class Check(Plain):
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


LENGTHS = ("mm", "inch", "m")
UNITS = {
    "x": LENGTHS, "z": LENGTHS, "v": ("mm/s", "m/s"), "a": ("g", "mm/s^2", "m/s^2"), "load": ("lbf", "kN", "N"),
}  # fmt: skip
CONSTANTS = {"stiffness": {"N/mm": 1e3}, "mass": {"g": 1e-3}}
SI = {"x": "m", "z": "m", "v": "m/s", "a": "m/s^2", "load": "N", "stiffness": "N/m", "mass": "kg"}
MILLISECONDS = 1e-3
ONE_SLIP = "one slip that explains it"
BETTER = 25.0  # times by which a slip must lower the sum of squares to be named
CLOSE = 30.0  # times by which the motions of mass and base differ at most where one unit holds for both

# Without a load cell or an accelerometer the friction must still be one: it opposes the motion. Its phase against the
# velocity is 0 for a slider, 90 degrees for a spring that never slips. Set by trial on 2,000 simulated rigs whose
# friction was a spring, a slider or both, at 0.05 to 5 times their natural frequency: none is called a slip.
ELASTIC, TURNED = 87.0, 40.0  # degrees from which a slip of a constant, of the clock is looked for
IDLE = 0.02  # of the friction: a spring that pulls less is too soft to have moved the mass
OPPOSED = 20.0  # degrees within which the friction must be left
BROUGHT = 45.0  # the same, of a constant: a rig that sticks for some of the cycle leaves its friction 25 behind
LATE = 0.15  # rad by which sensors of which nothing is stated may lag one another: energy may seem to run back by it
SWUNG, HURLED = 0.1, 300.0  # m and m/s^2: an oscillator that does more of both is read in the wrong unit


@dataclass(frozen=True)
class Slip:
    """A slip of the hand that would make the channels agree.

    Attributes
    ----------
    words : str
        What it is.
    cure : mapping of str to (str, float)
        Of each channel that is wrong: the channel that it should be read as, and times what.
    constants : mapping of str to float
        Of each constant that is wrong: times what it should be read.
    clock : float
        Times which a second of the file should be read.
    delays : mapping of str to float
        Of each channel whose stated delay is wrong: the delay [s] that it should have.
    zeros : mapping of str to float
        Of each channel whose zero is off: by how much.
    unsure : float
        The share by which gains and constants may be off, where that is no more than calibration leaves them.
    """

    words: str
    cure: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    clock: float = 1.0
    delays: Mapping[str, float] = field(default_factory=dict)
    zeros: Mapping[str, float] = field(default_factory=dict)
    unsure: float = 0.0

    @property
    def of_one_unit(self) -> bool:
        """Whether one wrong unit is meant of several channels; cables that are exchanged leave the units alone."""
        return len(self.cure) > 1 and all(name == read for name, (read, _) in self.cure.items())


@dataclass(frozen=True)
class Amplitudes:
    """Complex amplitudes of the channels at the forcing frequency, and what is known of the rig."""

    values: Mapping[str, complex]
    angular: float
    rig: Mapping[str, float]
    damper: str
    tolerance: float
    contact: str = "ground"
    stated: Mapping[str, str] = field(default_factory=dict)  # units, of channels whose unit is stated

    def unit(self, name: str) -> str:
        """That a channel was read in."""
        return self.stated.get(name, SI[name])

    @property
    def knows(self) -> bool:
        """Whether the forces can be written down."""
        return {"mass", "stiffness"} <= set(self.rig)

    def cured(self, slip: Slip) -> Amplitudes:
        """As it would be without a slip."""
        values = {**self.values, **{name: by * self.values[of] for name, (of, by) in slip.cure.items()}}
        rig = {name: value * slip.constants.get(name, 1.0) for name, value in self.rig.items()}
        return replace(self, values=values, rig=rig, angular=self.angular / slip.clock)

    @property
    def accelerated(self) -> complex:
        return self.values.get("a", -(self.angular**2) * self.values["x"])

    @property
    def friction(self) -> complex:
        """What the motion leaves over for the friction [N]."""
        x, z = self.values["x"], self.values.get("z", 0.0)
        moved = x - (z if self.damper == "base" else 0.0)
        pulled = self.rig["stiffness"] * (z - x) - 1j * self.angular * self.rig.get("damping", 0.0) * moved
        return pulled + self.values.get("force", 0.0) - self.rig["mass"] * self.accelerated

    @property
    def lag(self) -> float:
        """Phase of the friction against the velocity [degrees], without its sign."""
        return abs(math.degrees(cmath.phase(self.friction * (1j * self.values["x"]).conjugate())))

    @property
    def idle(self) -> float:
        """The spring's force as a part of what the motion leaves over."""
        stretch = self.values.get("z", 0.0) - self.values["x"]
        return abs(self.rig["stiffness"] * stretch) / (abs(self.friction) or math.inf)

    @property
    def misfit(self) -> float:
        """Sum of squares, in standard deviations, of what should be zero, and of energy that runs the wrong way."""
        w, x, values = self.angular, self.values["x"], self.values
        total = 0.0
        for name, order in (("v", 1), ("a", 2)):
            if name in values:
                moved = (1j * w) ** order * x
                largest = max(abs(moved), abs(values[name]))
                total += abs(values[name] - moved) ** 2 / (2 * (self.tolerance * largest) ** 2)
        if "load" in values and self.knows:
            k, m = self.rig["stiffness"], self.rig["mass"]
            terms = (k * values.get("z", 0.0), k * x, m * self.accelerated, values["load"])
            sizes = math.hypot(*(abs(term) for term in terms))
            total += abs(self.friction - values["load"]) ** 2 / (2 * (self.tolerance * sizes) ** 2)
        for name in ("z", "load"):
            if name in values and (name != "z" or "force" not in values):
                turned = (values[name] * complex(1j * x).conjugate()).real / (abs(values[name]) * abs(x))
                total += (min(0.0, turned + LATE) / self.tolerance) ** 2
        return total

    @property
    def of_one_size(self) -> bool:
        """Whether mass and base move by distances that one unit may give."""
        x, z = abs(self.values["x"]), abs(self.values.get("z", 0.0))
        return z > 0 and 1 / CLOSE < x / z < CLOSE


def mixups(balance: Amplitudes, *, failing: bool) -> tuple[Slip, ...]:
    """Every slip that would make the channels agree, the best first; none where they agree or none would.

    Channels are brought together where some check is `failing`.
    """
    return (_explaining(balance) if failing else ()) or tuple(_of_the_balance(balance))


def _explaining(balance: Amplitudes) -> tuple[Slip, ...]:
    """What brings readings of one thing together."""
    before, most = balance.misfit, 2 * APART**2
    if before <= most:
        return ()
    # two that fit as well are ranked by how well the friction opposes the motion then, joint units before single ones
    tried = [(balance.cured(slip), slip) for slip in _slips(balance)]
    ranked = sorted(tried, key=lambda pair: pair[0].misfit + (pair[0].lag / 90 if pair[0].knows else 0.0))
    near = max(most, 1.2 * ranked[0][0].misfit)
    likely = [slip for cured, slip in ranked if cured.misfit < near and cured.misfit * BETTER < before]
    joint = [slip for slip in likely if slip.of_one_unit]
    return tuple(joint[:1]) if joint and balance.of_one_size else tuple(s for s in likely if not s.of_one_unit)


def _of_the_balance(balance: Amplitudes) -> Iterator[Slip]:
    """What only the friction's own nature speaks against, where nothing measures it: it opposes the motion."""
    if "z" not in balance.values or "load" in balance.values:
        return
    x, metres = abs(balance.values["x"]), balance.unit("x") == balance.unit("z") == SI["x"]
    if metres and x > SWUNG and balance.angular**2 * x > HURLED and balance.of_one_size and "a" not in balance.values:
        yield _in_unit(("x", "z"), "mm", SI["x"])
        return
    if not balance.knows or balance.contact == "base":  # a face that moves may drive the mass by friction alone
        return
    idle = balance.lag > ELASTIC and balance.idle < IDLE
    slips = [(slip, BROUGHT) for slip in _of_constants(balance.rig)] if idle else []
    slips += [(_of_clock(), OPPOSED)] if balance.lag > TURNED and "a" not in balance.values else []
    yield from (slip for slip, left in slips if balance.cured(slip).lag < left)


def slip_check(balance: Amplitudes, slips: Sequence[Slip]) -> list[Check]:
    """A check that names the slips; none without any."""
    if not slips:
        return []
    before, after = balance.misfit**0.5, balance.cured(slips[0]).misfit ** 0.5
    return [Check(ONE_SLIP, before, after, "1", before, FAILS, " or ".join(slip.words for slip in slips))]


def _slips(balance: Amplitudes) -> Iterator[Slip]:
    """Every channel turned round, every two exchanged, every usual unit mistaken, of constants and clock too."""
    names = balance.values
    for name in names:
        yield Slip(f"{name} has the wrong sign", {name: (name, -1.0)})
    for one, other in combinations(names, 2):
        yield Slip(f"{one} and {other} are exchanged", {one: (other, 1.0), other: (one, 1.0)})
    for name in (name for name in names if name in UNITS):
        yield from (_in_unit((name,), unit, balance.unit(name)) for unit in UNITS[name] if unit != balance.unit(name))
    if "z" in names and balance.unit("x") == balance.unit("z"):
        yield from (_in_unit(("x", "z"), unit, balance.unit("x")) for unit in LENGTHS if unit != balance.unit("x"))
    yield from _of_constants(balance.rig)
    yield _of_clock()
    yield Slip("the time is in s, not in ms", clock=1 / MILLISECONDS)


def _in_unit(names: Sequence[str], unit: str, stated: str) -> Slip:
    """Channels in another unit than they were read in."""
    are, expect = "are" if len(names) > 1 else "is", SI[names[0]]
    factor = parse_unit(unit, expect).scale / parse_unit(stated, expect).scale
    return Slip(f"{' and '.join(names)} {are} in {unit}, not in {stated}", {name: (name, factor) for name in names})


def _of_constants(known: Iterable[str]) -> Iterator[Slip]:
    for name, units in CONSTANTS.items():
        for unit, factor in units.items() if name in known else ():
            yield Slip(f"the {name} is in {unit}, not in {SI[name]}", constants={name: factor})


def _of_clock() -> Slip:
    return Slip("the time is in ms, not in s", clock=MILLISECONDS)
