"""Frictional memory as a time lag: friction answers a change of the sliding speed some time later."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Rigid
from stickslip.laws.curved import CurvedMode, Expression, lifted, sqrt, symbol
from stickslip.laws.stribeck import Curve
from stickslip.parameters import parameter, parametric

DELAYED = "delayed_speed"
SPEEDS = [10.0**decade for decade in range(-6, 4)]  # m/s above the beginning of a branch, at which its level is asked
CORNER = 1e-12  # of the level: how far from its corner the larger of two is rounded; far above the rounding of a force


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
        for speed in (low, *(min(low + far, high) for far in SPEEDS)):
            with suppress(ModelError):  # a formula may have no value where no motion leads
                levels.append(friction.at(**{DELAYED: speed}))
        if max(levels, default=0.0) <= breakaway:
            return lifted(breakaway)
        if min(levels) >= breakaway:
            return friction
        small = CORNER * (breakaway or 1.0)
        return 0.5 * (friction + breakaway + small * sqrt(((friction - breakaway) / small) ** 2 + 1))
