"""Coulomb friction under a normal load that changes along the way."""

from __future__ import annotations

from stickslip.laws.base import Exit, Mode, Rigid
from stickslip.parameters import parameter, parametric


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
        exits = (
            Exit({"v": float(-side)}, f"{other} lifted"),
            Exit({"1": self.kinetic, "x": self.gradient}, name),
        )
        return Mode(f"{name} lifted", "flight", side, {}, exits)
