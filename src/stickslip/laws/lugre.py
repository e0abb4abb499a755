"""The LuGre law: bristles that bend, and a Stribeck curve at which they yield."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from stickslip.laws.base import Row, finite
from stickslip.laws.curved import CurvedMode, Sliding, either_side, symbol
from stickslip.laws.stribeck import require_static_above, stribeck_curve


@dataclass(frozen=True)
class LuGre(Sliding):
    r"""Friction of bristles (Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Automatic Control 40, 1995).

    .. math:: f = \sigma_0 z + \sigma_1 \dot z + \sigma_2 v, \quad \dot z = v - \sigma_0 |v| z / g(v), \quad
              g = f_k + (f_s - f_k) e^{-(|v|/v_s)^\delta}

    Attributes
    ----------
    kinetic, static : float
        f_k and f_s [N], the levels of fast and of slowest sliding.
    speed : float
        v_s [m/s], the Stribeck speed.
    stiffness : float
        sigma_0 [N/m].
    damping : float
        sigma_1 [N s/m].
    viscous : float
        sigma_2 [N s/m].
    exponent : float
        delta; 2 where left out.

    Raises
    ------
    ModelError
        A value has no meaning, or `static` is below `kinetic`.

    Examples
    --------
    >>> lugre = LuGre(1.0, 1.5, speed=1e-3, stiffness=1e5, damping=316.23, viscous=0.4)
    >>> round(lugre.steady(1e-3), 9)
    1.184339721
    """

    kinetic: float
    static: float
    speed: float
    stiffness: float
    damping: float = 0.0
    viscous: float = 0.0
    exponent: float = 2.0

    def __post_init__(self) -> None:
        finite("kinetic", self.kinetic, unit="N", positive=True)
        finite("static", self.static, unit="N", positive=True)
        finite("speed", self.speed, unit="m/s", positive=True)
        finite("stiffness", self.stiffness, unit="N/m", positive=True)
        finite("damping", self.damping, unit="N s/m")
        finite("viscous", self.viscous, unit="N s/m")
        finite("exponent", self.exponent, unit="", positive=True)
        require_static_above(self)

    @property
    def memory(self) -> Mapping[str, Row]:
        """Deflection z of the bristles [m], zero at the start."""
        return {"bristle": {}}

    def steady(self, speed: float) -> float:
        """Friction force of steady sliding.

        Parameters
        ----------
        speed : float
            Sliding speed [m/s], not negative.

        Returns
        -------
        float
            Force [N].
        """
        return stribeck_curve(self, symbol("v")).at(v=speed) + self.viscous * speed

    def rates(self) -> tuple[CurvedMode, ...]:
        """Slip on either side; they meet where the velocity turns."""
        v, z = symbol("v"), symbol("bristle")
        modes = []
        for name, side, turn in either_side():
            speed = v * float(side)
            rate = v - self.stiffness * (speed * z / stribeck_curve(self, speed))
            force = self.stiffness * z + self.damping * rate + self.viscous * v
            modes.append(CurvedMode(name, "slip", side, force, (turn,), {"bristle": rate}))
        return tuple(modes)
