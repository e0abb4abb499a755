"""Dahl's law: friction as a spring that yields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from stickslip.laws.base import Row, finite
from stickslip.laws.curved import CurvedMode, Sliding, either_side, symbol


@dataclass(frozen=True)
class Dahl(Sliding):
    r"""Friction by :math:`\dot f = \sigma_0 v\,(1 - (f/f_k)\,\mathrm{sgn}\,v)^n` (Dahl, Aerospace TOR-0158, 1968).

    Friction depends on the way, not on the speed. Where n is not whole, the parenthesis must stay positive: it does on
    every motion that starts with :math:`|f| < f_k`.

    Attributes
    ----------
    kinetic : float
        f_k [N], the level of sliding.
    stiffness : float
        sigma_0 [N/m], slope at f = 0.
    exponent : float
        n; 1 where left out.

    Raises
    ------
    ModelError
        A value is not finite and positive.

    Examples
    --------
    >>> [mode.name for mode in Dahl(1.1, stiffness=192000).rates()]
    ['back', 'forward']
    """

    kinetic: float
    stiffness: float
    exponent: float = 1.0

    def __post_init__(self) -> None:
        finite("kinetic", self.kinetic, unit="N", positive=True)
        finite("stiffness", self.stiffness, unit="N/m", positive=True)
        finite("exponent", self.exponent, unit="", positive=True)

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
