"""The state-variable law of chapter 4 with its smooth backbone."""

from __future__ import annotations

from collections.abc import Mapping

from stickslip.laws.base import Row
from stickslip.laws.curved import CurvedMode, Sliding, either_side, symbol, tanh
from stickslip.parameters import parameter, parametric


@parametric
class SmoothStateVariable(Sliding):
    r"""Friction that tracks a smooth backbone: :math:`\dot\theta = -f_k\gamma(\theta - f_k\tanh\alpha v)`.

    Thesis, equations 4.1 and 4.2, where the backbone lacks its factor :math:`f_k`; `printed` keeps it out, which
    limits friction to 1 N. The product :math:`f_k\gamma` is the rate.

    Raises
    ------
    ModelError
        A value is not finite and positive.

    Examples
    --------
    >>> law = SmoothStateVariable(1.1, rate=100.0, steepness=3000.0)
    >>> round(law.rates()[0].rates["theta"].at(v=1.0, theta=0.0), 9)
    121.0
    """

    label = "Smooth state variable"
    formula = (
        "f = theta, theta' = -kinetic rate (theta - level tanh(steepness v)), level = kinetic, 1 where printed is true"
    )

    kinetic: float = parameter("N", "sliding friction", positive=True, note="f_k")
    rate: float = parameter("1/(N s)", "rate", positive=True, note="gamma")
    steepness: float = parameter("s/m", "steepness", positive=True, note="alpha")
    printed: bool = parameter("", "backbone of 1 N, as printed", default=False)

    @property
    def memory(self) -> Mapping[str, Row]:
        """The friction force [N], zero at the start."""
        return {"theta": {}}

    def rates(self) -> tuple[CurvedMode, ...]:
        """One smooth motion; the modes tell the direction of slip."""
        v, theta = symbol("v"), symbol("theta")
        decay = self.kinetic * self.rate
        pull = decay * (1.0 if self.printed else self.kinetic)
        rates = {"theta": pull * tanh(self.steepness * v) - decay * theta}
        return tuple(CurvedMode(name, "slip", side, theta, (turn,), rates) for name, side, turn in either_side())
