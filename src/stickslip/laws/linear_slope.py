"""Friction that rises or falls in proportion to the sliding speed."""

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
