"""Dahl's law: friction as a spring that yields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from stickslip.laws.base import Row
from stickslip.laws.curved import CurvedMode, Sliding, either_side, symbol
from stickslip.parameters import parameter, parametric


@parametric
class Dahl(Sliding):
    r"""Friction by :math:`\dot f = \sigma_0 v\,(1 - (f/f_k)\,\mathrm{sgn}\,v)^n` (Dahl, Aerospace TOR-0158, 1968).

    Friction depends on the way, not on the speed. Where n is not whole, the parenthesis must stay positive: it does on
    every motion that starts with :math:`|f| < f_k`.

    Raises
    ------
    ModelError
        A value is not finite and positive.

    Examples
    --------
    >>> [mode.name for mode in Dahl(1.1, stiffness=192000).rates()]
    ['back', 'forward']
    """

    label = "Dahl"
    formula = "f' = stiffness v (1 - (f/kinetic) sign(v))^exponent"
    memory_units: ClassVar[Mapping[str, str]] = {"force_state": "N"}
    chosen = ("exponent",)  # not fitted where nothing else is said

    kinetic: float = parameter("N", "sliding friction", positive=True, note="f_k")
    stiffness: float = parameter("N/m", "contact stiffness", positive=True, note="sigma_0, the slope at f = 0")
    exponent: float = parameter("1", "exponent", default=1.0, positive=True, note="n")

    @property
    def memory(self) -> Mapping[str, Row]:
        """The friction force [N], zero at the start."""
        return {"force_state": {}}

    def rates(self) -> tuple[CurvedMode, ...]:
        """Slip on either side; they meet where the velocity turns."""
        v, f = symbol("v"), symbol("force_state")
        return tuple(
            CurvedMode(name, "slip", side, f, (turn,),
                       {"force_state": self.stiffness * v * (1 - f * (side / self.kinetic)) ** self.exponent})
            for name, side, turn in either_side()
        )  # fmt: skip
