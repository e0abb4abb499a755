"""Friction that rises or falls in proportion to the sliding speed.

Coulomb friction under a normal load that changes along the way.
"""

from __future__ import annotations

from collections.abc import Callable

from stickslip.laws.base import Exit, Mode, Rigid, static_level
from stickslip.laws.coulomb import held_until
from stickslip.laws.curved import Expression
from stickslip.parameters import parameter, parametric


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
