"""Rate-and-state friction of rocks and metals: the logarithm of the speed and of the contact's age."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from stickslip.errors import ModelError
from stickslip.laws.base import Row, finite
from stickslip.laws.curved import CurvedMode, Sliding, asinh, either_side, exp, log, symbol


@dataclass(frozen=True)
class RateState(Sliding):
    r"""Friction by speed and age (Dieterich 1979, Ruina 1983), regular at rest (Rice and Ben-Zion, PNAS 93, 1996).

    .. math:: f = a N\,\mathrm{asinh}\!\left[\frac{v}{2 V_0}
              \exp\frac{\mu_0 + b \ln(V_0\theta/D_c)}{a}\right], \quad
              \dot\theta = 1 - |v|\theta/D_c \ (\text{aging}), \quad
              \dot\theta = -(|v|\theta/D_c) \ln(|v|\theta/D_c) \ (\text{slip})

    For speeds above :math:`V_0 e^{-\mu_0/a}` this is :math:`N[\mu_0 + a \ln(v/V_0) + b \ln(V_0\theta/D_c)]` to
    rounding.

    Attributes
    ----------
    normal : float
        N [N], the normal load.
    friction : float
        mu_0, the coefficient at the reference speed.
    direct, evolution : float
        a and b.
    distance : float
        D_c [m], the way over which the contact renews itself.
    reference : float
        V_0 [m/s], the reference speed.
    law : {"aging", "slip"}
        How the age evolves.

    Raises
    ------
    ModelError
        A value is not finite and positive, or mu_0/a is too large for numbers (700).

    Examples
    --------
    >>> rock = RateState(5e6, friction=0.6, direct=0.010, evolution=0.015, distance=1e-5, reference=1e-6)
    >>> round(rock.steady(1e-5) / 5e6, 9)
    0.588487075
    """

    normal: float
    friction: float
    direct: float
    evolution: float
    distance: float
    reference: float
    law: str = "aging"

    def __post_init__(self) -> None:
        finite("normal", self.normal, unit="N", positive=True)
        finite("friction", self.friction, unit="", positive=True)
        finite("direct", self.direct, unit="", positive=True)
        finite("evolution", self.evolution, unit="")
        finite("distance", self.distance, unit="m", positive=True)
        finite("reference", self.reference, unit="m/s", positive=True)
        if self.law not in ("aging", "slip"):
            raise ModelError(f"law = '{self.law}'", "the age follows the 'aging' or the 'slip' law", "choose one")
        if self.friction / self.direct > 600:
            raise ModelError(
                f"friction / direct = {self.friction / self.direct:g}",
                "the exponential of it is a number up to 600",
                "give a larger direct=",
            )

    @property
    def memory(self) -> Mapping[str, Row]:
        """Age theta [s]; at the start, that of steady sliding at the reference speed."""
        return {"age": {"1": self.distance / self.reference}}

    def steady(self, speed: float) -> float:
        """Friction force of steady sliding.

        Parameters
        ----------
        speed : float
            Sliding speed [m/s], positive.

        Returns
        -------
        float
            Force [N].
        """
        finite("speed", speed, unit="m/s", positive=True)
        slope = (self.direct - self.evolution) * math.log(speed / self.reference)
        return self.normal * (self.friction + slope)

    def rates(self) -> tuple[CurvedMode, ...]:
        """Slip on either side; they meet where the velocity turns."""
        v, age = symbol("v"), symbol("age")
        renewed = log(age * (self.reference / self.distance))
        grip = exp((self.friction + self.evolution * renewed) / self.direct)
        force = self.direct * self.normal * asinh(v * grip / (2 * self.reference))
        modes = []
        for name, side, turn in either_side():
            way = v * age * (side / self.distance)
            rate = 1 - way if self.law == "aging" else -(way * log(way))
            modes.append(CurvedMode(name, "slip", side, force, (turn,), {"age": rate}))
        return tuple(modes)
