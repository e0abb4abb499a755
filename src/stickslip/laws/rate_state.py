"""Rate-and-state friction of rocks and metals: the logarithm of the speed and of the contact's age."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Row
from stickslip.laws.curved import CurvedMode, Expression, Sliding, asinh, either_side, exp, log, symbol
from stickslip.parameters import finite, parameter, parametric

STILLEST = 1e-12  # of the speed at which friction turns: a logarithm of the speed wants one that is not zero


@parametric
class RateState(Sliding):
    r"""Friction by speed and age (Dieterich 1979, Ruina 1983), regular at rest (Rice and Ben-Zion, PNAS 93, 1996).

    .. math:: f = a N\,\mathrm{asinh}\!\left[\frac{v}{2 V_0}
              \exp\frac{\mu_0 + b \ln(V_0\theta/D_c)}{a}\right], \quad
              \dot\theta = 1 - |v|\theta/D_c \ (\text{aging}), \quad
              \dot\theta = -(|v|\theta/D_c) \ln(|v|\theta/D_c) \ (\text{slip})

    For speeds above :math:`V_0 e^{-\mu_0/a}` this is :math:`N[\mu_0 + a \ln(v/V_0) + b \ln(V_0\theta/D_c)]` to
    rounding.

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

    label = "Rate and state"
    formula = (
        "f = direct normal asinh(v/(2 reference) exp((friction + evolution ln(reference age/distance))/direct)), "
        "age' = 1 - |v| age/distance (aging) or -(|v| age/distance) ln(|v| age/distance) (slip)"
    )
    memory_units: ClassVar[Mapping[str, str]] = {"age": "s"}

    normal: float = parameter("N", "normal load", positive=True, note="N")
    friction: float = parameter("1", "coefficient of friction", positive=True, note="mu_0, at the reference speed")
    direct: float = parameter("1", "direct effect", positive=True, note="a")
    evolution: float = parameter("1", "evolution effect", note="b")
    distance: float = parameter("m", "critical distance", positive=True, note="D_c: the contact renews itself over it")
    reference: float = parameter("m/s", "reference speed", positive=True, note="V_0")
    law: str = parameter("", "how the age evolves", default="aging", choices=("aging", "slip"))

    def __post_init__(self) -> None:
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
        v = symbol("v")
        return tuple(
            CurvedMode(name, "slip", side, self._force(v), (turn,), {"age": self._ageing(v * float(side))})
            for name, side, turn in either_side()
        )

    def holding(self, speed: float) -> CurvedMode:
        r"""Creep slower than a speed [m/s]: the mass goes as fast as its friction, which is the push, makes it go.

        With :math:`q = f/(a N)` and :math:`G = \exp[(\mu_0 + b\ln(V_0\theta/D_c))/a]` the law says
        :math:`v = (2 V_0/G) \sinh q`. For the age's sake :math:`|v|` is :math:`(2 V_0/G)(\cosh q - 1)`: both are
        nothing where they differ, this one is smooth.
        """
        stress, grip = symbol("f") / (self.direct * self.normal), self._grip()
        onward, backward, still = exp(stress - grip), exp(-stress - grip), exp(-grip)
        pace = onward + backward - 2 * (1 - STILLEST) * still
        return CurvedMode(
            "held",
            "stick",
            0,
            None,
            (Exit({"f": 1.0, "level": -1.0}, "forward"), Exit({"f": -1.0, "level": -1.0}, "back")),
            {"age": self._ageing(self.reference * pace)},
            creep=self.reference * (onward - backward),
            levels={"level": self._force(speed)},
        )

    def _grip(self) -> Expression:
        """Logarithm of how many times the reference speed is above the speed at which friction turns."""
        renewed = log(symbol("age") * (self.reference / self.distance))
        return (self.friction + self.evolution * renewed) / self.direct

    def _force(self, speed: Expression | float) -> Expression:
        return self.direct * self.normal * asinh(exp(self._grip()) * speed / (2 * self.reference))

    def _ageing(self, speed: Expression) -> Expression:
        """Rate of the age at a speed without sign."""
        way = speed * symbol("age") * (1 / self.distance)
        return 1 - way if self.law == "aging" else -(way * log(way))
