"""Rigid contact whose sliding friction follows a smooth curve over the speed; sticking is exact.

Any friction-velocity curve as a table: straight lines between its points, each solved exactly. Frictional memory as a
time lag: friction answers a change of the sliding speed some time later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

import numpy as np

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode, Rigid, static_level
from stickslip.laws.coulomb import held_until
from stickslip.laws.curved import CurvedMode, Expression, exp, lifted, sqrt, symbol
from stickslip.laws.formula import Formula, written
from stickslip.laws.guessing import FALLS, GRID, LEAST_EXCESS, RIGID, SPEEDS, Hypothesis, Observed, Searched
from stickslip.parameters import finite, parameter, parametric

if TYPE_CHECKING:
    from stickslip.laws.compliant import LuGre

Curve = Callable[[Expression], Expression]
EXPONENTS: Mapping[str, tuple[float, float]] = {"exponent": (0.5, 4.0)}  # most are 0.5 to 2: Armstrong-Helouvry (1994)
SHARPER = (0.5, 1.0)  # exponents of curves that a search begins at, beside 2
LOWEST = 0.1  # of the level, that a guess has in fast sliding
SLIDING = 0.01  # of the largest speed, above which friction tells the curve
DELAYED = "delayed_speed"
AHEAD = [10.0**decade for decade in range(-6, 4)]  # m/s above the beginning of a branch, at which its level is asked
CORNER = 1e-12  # of the level: how far from its corner the larger of two is rounded; far above the rounding of a force


def slips_and_stick(curve: Curve, level: float) -> tuple[CurvedMode, ...]:
    """The modes of a rigid contact: slip on either side with the friction of `curve`, stick up to `level` [N]."""
    v = symbol("v")
    return (
        CurvedMode("back", "slip", -1, -curve(-v), (Exit({"v": 1.0}, "stuck"),)),
        CurvedMode("stuck", "stick", 0, None, held_until(level)),
        CurvedMode("forward", "slip", 1, curve(v), (Exit({"v": -1.0}, "stuck"),)),
    )


def stribeck_curve(law: Stribeck | LuGre, speed: Expression) -> Expression:
    r""":math:`f_k + (f_s - f_k) e^{-(|v|/v_s)^\delta}` at a sliding speed."""
    return law.kinetic + (law.static - law.kinetic) * exp(-((speed / law.speed) ** law.exponent))


def require_static_above(law: Stribeck | LuGre) -> None:
    """Refuse friction that rises from static to kinetic."""
    if law.static < law.kinetic:
        raise ModelError(
            f"static = {law.static:.6g} N below kinetic = {law.kinetic:.6g} N",
            "static friction is at least the kinetic friction",
            "raise static=",
        ).of("static")


@parametric
class Stribeck(Rigid):
    r"""Friction that falls with the speed: :math:`f = f_k + (f_s - f_k) e^{-(|v|/v_s)^\delta} + \sigma |v|` in slip.

    Stribeck's curve in the form of Bo and Pavelescu (Wear 82, 1982); in stick :math:`|f| \le f_s`, held exactly.

    Raises
    ------
    ModelError
        A value has no meaning, or `static` is below `kinetic`.

    Examples
    --------
    >>> round(Stribeck(1.0, 1.5, speed=0.1).friction(0.1), 6)
    1.18394
    """

    label = "Stribeck curve"
    formula = (
        "f = (kinetic + (static - kinetic) exp(-(|v|/speed)^exponent)) sign(v) + viscous v while sliding, |f| <= "
        "static at rest"
    )
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction
    chosen = ("exponent",)  # not fitted where nothing else is said
    between: ClassVar = EXPONENTS

    kinetic: float = parameter("N", "sliding friction", note="f_k, at high speed")
    static: float = parameter("N", "static friction", note="f_s, the level at rest")
    speed: float = parameter("m/s", "Stribeck speed", positive=True, note="v_s")
    exponent: float = parameter(
        "1", "exponent", default=2.0, positive=True, note="delta; 2 is Gauss's curve, 1 Tustin's"
    )
    viscous: float = parameter("N s/m", "viscous friction", default=0.0, note="sigma")

    def __post_init__(self) -> None:
        require_static_above(self)

    @classmethod
    def hypotheses(cls) -> tuple[Hypothesis, ...]:
        """Friction that falls with the speed."""
        return (Hypothesis("Stribeck", RIGID, _guesses, _from_static, ("static",)),)

    def _curve(self, speed: Expression) -> Expression:
        return stribeck_curve(self, speed) + self.viscous * speed

    def friction(self, speed: float) -> float:
        """Friction force while sliding at a speed.

        Parameters
        ----------
        speed : float
            Sliding speed [m/s], not negative.

        Returns
        -------
        float
            Force [N].
        """
        return self._curve(symbol("v")).at(v=speed)

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]."""
        return self.static

    def branches(self) -> tuple[tuple[float, Curve], ...]:
        """One smooth curve from rest on."""
        return ((0.0, self._curve),)

    def rates(self) -> tuple[CurvedMode, ...]:
        """Slip on either side, and stick."""
        return slips_and_stick(self._curve, self.breakaway)


def _guesses(seen: Observed) -> list[Stribeck]:
    """The curves that the sliding friction fits best: the likelihood has several tops over fall and exponent."""
    sharp = [_fitting(seen, exponent) for exponent in SHARPER]
    tried = _fitting(seen, 2.0)
    best = _nearest(tried)
    apart = dict.fromkeys((best, max(0, best - GRID // 3), min(GRID - 1, best + GRID // 3)))
    return [tried[i][1] for i in apart] + [curves[_nearest(curves)][1] for curves in sharp]


def _nearest(tried: Sequence[tuple[float, Stribeck]]) -> int:
    """Which of the curves leaves least."""
    return min(range(len(tried)), key=lambda i: tried[i][0])


def _fitting(seen: Observed, exponent: float) -> list[tuple[float, Stribeck]]:
    """Curves of an exponent, one for each fall, and the sum of squares that each leaves of the sliding friction."""
    sliding = np.abs(seen.speed) > SLIDING * seen.fastest
    speed, friction = np.abs(seen.speed[sliding]), (seen.friction * np.sign(seen.speed))[sliding]
    tried = []
    for fall in seen.fastest * np.geomspace(*SPEEDS, GRID):
        columns = np.column_stack([np.ones(len(speed)), np.exp(-((speed / fall) ** exponent))])
        (level, excess), left, *_ = np.linalg.lstsq(columns, friction, rcond=None)
        level = max(float(level), LOWEST * seen.level)
        static = float(level + max(LEAST_EXCESS * level, excess))
        law = Stribeck(float(level), static, speed=float(fall), exponent=exponent)
        tried.append((float(left[0]) if len(left) else np.inf, law))
    return tried


def _from_static(simpler: Mapping[str, Searched]) -> list[Stribeck]:
    """A fall that is steep."""
    if "static" not in simpler:
        return []
    law, fastest = simpler["static"].law, float(simpler["static"].scales[:, 1].max())
    static = max(law.static, 1.02 * law.kinetic)
    return [Stribeck(law.kinetic, static, speed=share * fastest) for share in FALLS]


@parametric
class FrictionCurve(Rigid):
    """Any smooth curve of friction over the sliding speed, odd in the velocity, with exact sticking.

    Raises
    ------
    ModelError
        The curve is no function of the speed, or has no finite value at rest, or `static` is below it.

    Examples
    --------
    >>> popp = FrictionCurve(lambda v: 3.0 / (1 + 1.42 * v) + 1.0 + 0.1 * v * v)
    >>> round(popp.friction(1.0), 6)
    2.339669
    """

    label = "Any curve over speed"
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction
    formula = "f = F(|v|) sign(v) while sliding, |f| <= static at rest"
    absent: ClassVar = {"static": "F(0)"}

    curve: Curve = parameter(
        "", "friction over the speed", note="from the sliding speed [m/s] to the force [N], both Expressions"
    )
    static: float | None = parameter("N", "static friction", default=None, note="None: the curve at speed 0")

    def __post_init__(self) -> None:
        if not (callable(self.curve) and isinstance(self.curve(symbol("v")), Expression)):
            raise ModelError(
                f"curve = {self.curve!r}",
                "a curve is a function that makes an Expression of the sliding speed, by + - * / ** and the functions"
                " of stickslip.laws.curved",
                "give one, as lambda v: 1 + 0.2 / (1 + v); for friction without speed take Coulomb",
            ).of("curve")
        rest = finite("curve at rest", self.friction(0.0), unit="N")
        if self.static is not None and finite("static", self.static, unit="N") < rest:
            raise ModelError(
                f"static = {self.static} N below the curve's {rest:g} N at rest",
                "static friction is at least the friction of the slowest slip",
                "raise static=, or leave it out to take the curve's own",
            ).of("static")

    def friction(self, speed: float) -> float:
        """Friction force while sliding at a speed.

        Parameters
        ----------
        speed : float
            Sliding speed [m/s], not negative.

        Returns
        -------
        float
            Force [N].
        """
        if not math.isfinite(speed):
            raise ModelError(f"speed = {speed} m/s", "a speed is finite", "correct it").of("speed")
        return self.curve(symbol("v")).at(v=speed)

    @property
    def text(self) -> str:
        """The curve over v as text."""
        return self.curve.text if isinstance(self.curve, Formula) else written(self.curve(symbol("v")))

    def own_formula(self) -> str:
        """The formula, with the curve."""
        return f"{self.formula}, F = {self.text}"

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]."""
        return self.friction(0.0) if self.static is None else self.static

    def branches(self) -> tuple[tuple[float, Curve], ...]:
        """One smooth curve from rest on."""
        return ((0.0, self.curve),)

    def rates(self) -> tuple[CurvedMode, ...]:
        """Slip on either side, and stick."""
        return slips_and_stick(self.curve, self.breakaway)


@parametric
class Tabulated(Rigid):
    """Rigid contact whose friction follows a polygon over the sliding speed, odd in the velocity.

    Beyond the last speed the force stays as it is there.

    Examples
    --------
    >>> stribeck = Tabulated.of(lambda v: 1.0 + 0.5 * 2.718281828 ** -(v / 0.1), np.linspace(0, 0.5, 101))
    >>> len(stribeck.modes()), round(stribeck.error, 6)
    (203, 0.000152)
    """

    label = "Table over speed"
    formula = (
        "f = F(|v|) sign(v) while sliding, F a polygon through forces at speeds, level beyond the last; |f| <= "
        "static at rest"
    )
    absent: ClassVar = {"static": "F(0)"}
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction
    chosen = ("error",)  # not fitted where nothing else is said

    speeds: Sequence[float] = parameter(
        "m/s", "sliding speeds", size="row", signed=True, note="increasing, the first one 0"
    )
    forces: Sequence[float] = parameter("N", "friction forces", size="row", note="one at each speed")
    static: float | None = parameter("N", "static friction", default=None, note="None: the force at speed 0")
    error: float = parameter(
        "N",
        "error of the table",
        default=0.0,
        note="largest distance to the curve that it stands for; 0: it is the law",
    )

    def __post_init__(self) -> None:
        speeds, forces = tuple(map(float, self.speeds)), tuple(map(float, self.forces))
        if len(speeds) < 2 or len(speeds) != len(forces):
            raise ModelError(
                f"{len(speeds)} speeds, {len(forces)} forces",
                "two points at least, a force for each speed",
                "complete it",
            )
        if speeds[0] != 0 or not all(a < b for a, b in pairwise(speeds)):
            raise ModelError(
                "the speeds do not increase from 0", "a friction curve starts at 0 and is sorted", "sort it"
            )
        static_level(self.static, forces[0], kinetic_name="forces[0]")
        object.__setattr__(self, "speeds", speeds)
        object.__setattr__(self, "forces", forces)

    @classmethod
    def of(cls, curve: Callable[[float], float], speeds: Sequence[float], static: float | None = None) -> Tabulated:
        """The polygon through a smooth curve, with its largest distance from it.

        Parameters
        ----------
        curve : callable
            Friction force [N] at a speed [m/s].
        speeds : sequence of float
            Where the polygon meets the curve.
        static : float, optional
            As in the class.

        Returns
        -------
        Tabulated
        """
        points = [float(v) for v in speeds]
        forces = [float(curve(v)) for v in points]
        fine = np.concatenate([np.linspace(a, b, 33) for a, b in pairwise(points)])
        error = float(np.max(np.abs([curve(float(v)) for v in fine] - np.interp(fine, points, forces))))
        return cls(points, forces, static, error)

    @property
    def entry(self) -> tuple[str, str, str]:
        """Modes in which motion starts, by the sign of the velocity."""
        return "back 0", "stuck", "forward 0"

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]."""
        return static_level(self.static, self.forces[0])

    def branches(self) -> tuple[tuple[float, Callable[[Expression], Expression]], ...]:
        """A straight line between two points, the last one level."""

        def line(speed: float, force: float, slope: float) -> Callable[[Expression], Expression]:
            return lambda at: force + slope * (at - speed)

        ends = zip(self.speeds, self.forces, (*self._slopes(), 0.0), strict=True)
        return tuple((speed, line(speed, force, slope)) for speed, force, slope in ends)

    def _slopes(self) -> tuple[float, ...]:
        """Slope of each straight piece [N s/m]."""
        points = zip(self.speeds, self.forces, strict=True)
        return tuple((g - f) / (w - v) for (v, f), (w, g) in pairwise(points))

    def modes(self) -> tuple[Mode, ...]:
        """A mode for each straight piece on either side, and stick."""
        stuck = Mode("stuck", "stick", 0, None, held_until(self.breakaway, back="back 0", forward="forward 0"))
        return (*self._side(-1, "back"), stuck, *self._side(1, "forward"))

    def _side(self, side: int, name: str) -> list[Mode]:
        modes = []
        last, slopes = len(self.speeds) - 1, (*self._slopes(), 0.0)
        for j in range(last + 1):
            low, high, slope = self.speeds[j], self.speeds[min(j + 1, last)], slopes[j]
            friction = {"1": side * (self.forces[j] - slope * low), "v": slope}
            slower = Exit({"v": -side, "1": low}, f"{name} {j - 1}") if j else Exit({"v": float(-side)}, "stuck")
            faster = (Exit({"v": float(side), "1": -high}, f"{name} {j + 1}"),) if j < last else ()
            modes.append(Mode(f"{name} {j}", "slip", side, friction, (slower, *faster)))
        return modes


@runtime_checkable
class SpeedCurve(Protocol):
    """A law whose friction in slip is a function of the sliding speed alone."""

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]."""

    def branches(self) -> tuple[tuple[float, Curve], ...]:
        """The curve's smooth branches: the speed [m/s] from which each one holds, and its formula."""


@dataclass(frozen=True)
class DelayedMode(CurvedMode):
    """A regime of a delayed law: to go from one branch of the curve to the next is no event."""

    def changes(self, before: CurvedMode, leaving: int) -> Iterator[tuple[int, CurvedMode, CurvedMode]]:
        """Contact, its mode before and its mode now."""
        if (before.kind, before.side) != (self.kind, self.side):
            yield 0, before, self


@parametric
class TimeDelay(Rigid):
    r"""Rigid contact with friction of the speed a while ago: :math:`f(t) = F(|v(t-\tau)|)\,\mathrm{sgn}\,v(t)` in slip.

    The time-lag model of Hess and Soom (Journal of Tribology 112, 1990), one of the two frictional memories of the
    thesis (1.4). The friction-velocity curve F gives the level by the delayed speed; direction and sticking are those
    of the present: a mass that has stopped is held while :math:`|f| \le \max(f_s, F)`, by F too where the speed a
    while ago has more friction than rest: no less could start it. Friction always opposes the slip.
    All velocities are those relative to the counter-face. Before time 0 the mass is taken to have slid as at time 0.

    Raises
    ------
    ModelError
        The lag is not finite and positive, or friction of `law` does not follow the speed alone.

    Examples
    --------
    >>> from stickslip.laws.coulomb import LinearSlope
    >>> law = TimeDelay(LinearSlope(1.0, slope=2.0), lag=1e-3)
    >>> law.rates()[2].friction.at(delayed_speed=0.1)
    1.2
    """

    label = "Friction with a time lag"
    formula = "f = F(|v(t - lag)|) sign(v) while sliding, F of the law"

    law: SpeedCurve = parameter(
        "",
        "friction over the speed",
        note="of Stribeck, FrictionCurve, LinearSlope or Tabulated, with its break-away force",
    )
    lag: float = parameter(
        "s", "time lag", positive=True, note="tau, from a change of speed to the answer of the friction"
    )

    def __post_init__(self) -> None:
        if not isinstance(self.law, SpeedCurve):
            raise ModelError(
                f"law = {type(self.law).__name__}",
                "a time lag is that of a law whose friction follows the speed alone",
                "give a Stribeck, FrictionCurve, LinearSlope or Tabulated",
            ).of("law")

    @property
    def entry(self) -> tuple[str, str, str]:
        """Modes in which motion starts, by the sign of the velocity; the solver knows the branch."""
        back, stuck, forward = self.rates()[:3]
        return back.name, stuck.name, forward.name

    def rates(self) -> tuple[CurvedMode, ...]:
        """Slip back, stick and slip forward, on each branch of the curve over the delayed speed in turn."""
        branches = self.law.branches()
        highs = [low for low, _ in branches[1:]] + [math.inf]
        return tuple(
            mode
            for j, ((low, curve), high) in enumerate(zip(branches, highs, strict=True))
            for mode in self._branch(j, low, high, curve, single=len(branches) == 1)
        )

    def _branch(self, number: int, low: float, high: float, curve: Curve, *, single: bool) -> Iterator[CurvedMode]:
        def named(name: str, j: int = number) -> str:
            return name if single else f"{name} {j}"

        friction = lifted(curve(symbol(DELAYED)))
        level = self._held(friction, low, high)
        stops = (Exit({"f": 1.0, "level": -1.0}, named("forward")), Exit({"f": -1.0, "level": -1.0}, named("back")))
        stopped = {side: (Exit({"v": -float(side)}, named("stuck")),) for side in (-1, 1)}
        for name, kind, side, force, exits in (
            ("back", "slip", -1, -friction, stopped[-1]),
            ("stuck", "stick", 0, None, stops),
            ("forward", "slip", 1, friction, stopped[1]),
        ):
            slower = (Exit({DELAYED: -1.0, "1": low}, named(name, number - 1)),) * (number > 0)
            faster = (Exit({DELAYED: 1.0, "1": -high}, named(name, number + 1)),) * (high < math.inf)
            levels = {"level": level} if side == 0 else {}
            yield DelayedMode(named(name), kind, side, force, (*exits, *slower, *faster), levels=levels)

    def _held(self, friction: Expression, low: float, high: float) -> Expression:
        """The force that a mass at rest is held by on a branch: the larger one of break-away and friction."""
        breakaway = self.law.breakaway
        levels = []
        for speed in (low, *(min(low + far, high) for far in AHEAD)):
            with suppress(ModelError):  # a formula may have no value where no motion leads
                levels.append(friction.at(**{DELAYED: speed}))
        if max(levels, default=0.0) <= breakaway:
            return lifted(breakaway)
        if min(levels) >= breakaway:
            return friction
        small = CORNER * (breakaway or 1.0)
        return 0.5 * (friction + breakaway + small * sqrt(((friction - breakaway) / small) ** 2 + 1))
