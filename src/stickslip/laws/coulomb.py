"""Dry friction on a rigid contact: Coulomb's law, with static above kinetic friction if wanted.

Its kin: friction that rises or falls in proportion to the sliding speed, and under a load that changes along the way.
"""

from __future__ import annotations

from collections.abc import Callable

from stickslip.laws.base import Exit, Mode, Rigid, static_level
from stickslip.laws.curved import Expression
from stickslip.laws.guessing import EXCESSES, LITTLE, RIGID, Hypothesis
from stickslip.parameters import parameter, parametric


@parametric
class Coulomb(Rigid):
    r"""Rigid dry friction: :math:`f = f_k\,\mathrm{sgn}\,v` in slip, :math:`|f| \le f_s` in stick.

    A slip that comes to rest passes through the stuck mode; where the holding force would exceed `static` it goes on
    at once, in the direction of that force.

    Raises
    ------
    ModelError
        A level is negative or not finite, or `static` is below `kinetic`.

    Examples
    --------
    >>> [mode.name for mode in Coulomb(1.1).modes()]
    ['back', 'stuck', 'forward']
    """

    label = "Coulomb: rigid contact"
    formula = "f = kinetic sign(v) while sliding, |f| <= static at rest"
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction

    kinetic: float = parameter("N", "sliding friction")
    static: float | None = parameter("N", "static friction", default=None, note="None: as `kinetic`")

    def __post_init__(self) -> None:
        static_level(self.static, self.kinetic)

    @classmethod
    def hypotheses(cls) -> tuple[Hypothesis, ...]:
        """One level of friction; and static friction above it."""
        return (
            Hypothesis("Coulomb", RIGID, lambda seen: [cls(seen.level)]),
            Hypothesis(
                "static",
                RIGID,
                lambda seen: [_exceeding(seen.level, excess) for excess in (seen.excess, *EXCESSES)],
                lambda simpler: [_exceeding(simpler["Coulomb"].law.kinetic, LITTLE)] if "Coulomb" in simpler else [],
                ("Coulomb",),
                holds=lambda law: law.static is not None,
            ),
        )

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]."""
        return static_level(self.static, self.kinetic)

    def modes(self) -> tuple[Mode, ...]:
        """Slip on either side, and stick."""
        return (
            Mode("back", "slip", -1, {"1": -self.kinetic}, (Exit({"v": 1.0}, "stuck"),)),
            Mode("stuck", "stick", 0, None, held_until(self.breakaway)),
            Mode("forward", "slip", 1, {"1": self.kinetic}, (Exit({"v": -1.0}, "stuck"),)),
        )


def _exceeding(level: float, excess: float) -> Coulomb:
    return Coulomb(level, static=(1 + excess) * level)


def held_until(level: float, *, back: str = "back", forward: str = "forward") -> tuple[Exit, Exit]:
    """The exits of a stuck mode: the friction force reaches `level` [N] on either side."""
    return Exit({"f": 1.0, "1": -level}, forward), Exit({"f": -1.0, "1": -level}, back)


@parametric
class LinearSlope(Rigid):
    r"""Rigid contact with :math:`f = f_k\,\mathrm{sgn}\,v + s\,v` in slip, :math:`|f| \le f_s` in stick.

    Examples
    --------
    >>> LinearSlope(1.0, slope=-0.2, static=1.5).modes()[2].friction
    {'1': 1.0, 'v': -0.2}
    """

    label = "Friction linear in speed"
    formula = "f = kinetic sign(v) + slope v while sliding, |f| <= static at rest"
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction

    kinetic: float = parameter("N", "sliding friction", note="at vanishing speed")
    slope: float = parameter(
        "N s/m", "slope over the speed", signed=True, note="s; negative: friction falls with speed and feeds vibration"
    )
    static: float | None = parameter("N", "static friction", default=None, note="None: as `kinetic`")

    def __post_init__(self) -> None:
        static_level(self.static, self.kinetic)

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]."""
        return static_level(self.static, self.kinetic)

    def branches(self) -> tuple[tuple[float, Callable[[Expression], Expression]], ...]:
        """One straight line from rest on."""
        return ((0.0, lambda speed: self.kinetic + self.slope * speed),)

    def modes(self) -> tuple[Mode, ...]:
        """Slip on either side, and stick."""
        return (
            Mode("back", "slip", -1, {"1": -self.kinetic, "v": self.slope}, (Exit({"v": 1.0}, "stuck"),)),
            Mode("stuck", "stick", 0, None, held_until(self.breakaway)),
            Mode("forward", "slip", 1, {"1": self.kinetic, "v": self.slope}, (Exit({"v": -1.0}, "stuck"),)),
        )


@parametric
class PositionLoad(Rigid):
    r"""Rigid contact with :math:`|f| = n(x)`, :math:`n(x) = f_k + g\,x` where positive, else the contact is lifted.

    The oscillator of Feeny and Moon: chaotic under a harmonic drive.

    Examples
    --------
    >>> PositionLoad(1.0, gradient=1.5).modes()[2].friction
    {'1': 1.0, 'x': 1.5}
    """

    label = "Load that varies with position"
    formula = "f = (kinetic + gradient x) sign(v) where that load is positive, else no contact"

    kinetic: float = parameter("N", "sliding friction", note="at x = 0")
    gradient: float = parameter("N/m", "gradient of the load", signed=True, note="g")

    def modes(self) -> tuple[Mode, ...]:
        """Slip and flight on either side, and stick."""
        stuck = (
            Exit({"f": 1.0, "1": -self.kinetic, "x": -self.gradient}, "forward"),
            Exit({"f": -1.0, "1": -self.kinetic, "x": -self.gradient}, "back"),
        )
        return (
            self._slip("back", -1),
            Mode("stuck", "stick", 0, None, stuck),
            self._slip("forward", 1),
            self._lifted("back", "forward", -1),
            self._lifted("forward", "back", 1),
        )

    def _slip(self, name: str, side: int) -> Mode:
        friction = {"1": side * self.kinetic, "x": side * self.gradient}
        lift = Exit({"1": -self.kinetic, "x": -self.gradient}, f"{name} lifted")
        return Mode(name, "slip", side, friction, (Exit({"v": float(-side)}, "stuck"), lift))

    def _lifted(self, name: str, other: str, side: int) -> Mode:
        exits = (Exit({"v": float(-side)}, f"{other} lifted"), Exit({"1": self.kinetic, "x": self.gradient}, name))
        return Mode(f"{name} lifted", "flight", side, {}, exits)
