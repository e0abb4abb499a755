"""The LuGre law: bristles that bend, and a Stribeck curve at which they yield.

Dahl's law: friction as a spring that yields.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from stickslip.arrays import Array
from stickslip.laws import compliant
from stickslip.laws.base import Row
from stickslip.laws.curved import CurvedMode, Sliding, either_side, symbol
from stickslip.laws.guessing import (
    FALLS,
    LEAST_EXCESS,
    LITTLE,
    SPEEDS,
    STIFFEST,
    Family,
    Hypothesis,
    Observed,
    Searched,
)
from stickslip.laws.stribeck import EXPONENTS, require_static_above, stribeck_curve
from stickslip.parameters import parameter, parametric


@parametric
class LuGre(Sliding):
    r"""Friction of bristles (Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Automatic Control 40, 1995).

    .. math:: f = \sigma_0 z + \sigma_1 \dot z + \sigma_2 v, \quad \dot z = v - \sigma_0 |v| z / g(v), \quad
              g = f_k + (f_s - f_k) e^{-(|v|/v_s)^\delta}

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

    label = "LuGre: bristles"
    formula = (
        "f = stiffness z + damping z' + viscous v, z' = v - stiffness |v| z / g, g = kinetic + (static - kinetic) "
        "exp(-(|v|/speed)^exponent)"
    )
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction
    memory_units: ClassVar[Mapping[str, str]] = {"bristle": "m"}
    chosen = ("exponent",)  # not fitted where nothing else is said
    between: ClassVar = EXPONENTS

    kinetic: float = parameter("N", "sliding friction", positive=True, note="f_k, of fast sliding")
    static: float = parameter("N", "static friction", positive=True, note="f_s, of slowest sliding")
    speed: float = parameter("m/s", "Stribeck speed", positive=True, note="v_s")
    stiffness: float = parameter("N/m", "contact stiffness", positive=True, note="sigma_0, of the bristles")
    damping: float = parameter("N s/m", "contact damping", default=0.0, note="sigma_1, of the bristles")
    viscous: float = parameter("N s/m", "viscous friction", default=0.0, note="sigma_2")
    exponent: float = parameter("1", "exponent", default=2.0, positive=True, note="delta")

    def __post_init__(self) -> None:
        require_static_above(self)

    @classmethod
    def hypotheses(cls) -> tuple[Hypothesis, ...]:
        """Bristles."""
        family = Family("LuGre", "that of bristles (LuGre)")
        return (Hypothesis("LuGre", family, _guesses, _from_compliant, ("compliant", "Stribeck"), _next_to),)

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


def _guesses(seen: Observed) -> list[LuGre]:
    """The bristles whose bending under the measured sliding follows the friction best."""
    contact = compliant.guesses(seen)[0]
    mesh = np.meshgrid(
        contact.stiffness * np.array([1.0, 1.5, 2.5]),
        seen.fastest * np.geomspace(*SPEEDS, 6),
        np.array([LEAST_EXCESS, 0.1, 0.2, 0.35, 0.6]),
    )
    stiffness, speed, excess = (values.ravel() for values in mesh)
    force = _bristles(seen, stiffness, speed, excess)
    best = int(np.argmin(np.mean((force - seen.friction[:, None]) ** 2, axis=0)))
    static = seen.level * (1 + float(excess[best]))
    curve = {"speed": float(speed[best]), "stiffness": float(stiffness[best]), "damping": contact.damping}
    return [LuGre(seen.level, static, **curve)]


def _from_compliant(simpler: Mapping[str, Searched]) -> list[LuGre]:
    """The contact with a steep curve, where it gives way."""
    contact = simpler.get("compliant")
    return [] if contact is None or contact.stiff else [_steep(contact)]


def _steep(contact: Searched) -> LuGre:
    """A contact with a curve that is hardly felt."""
    bristle, speed = contact.law, FALLS[-1] * float(contact.scales[:, 1].max())
    static = (1 + LITTLE) * bristle.kinetic
    return LuGre(bristle.kinetic, static, speed=speed, stiffness=bristle.stiffness, damping=bristle.damping)


def _next_to(simpler: Mapping[str, Searched]) -> list[LuGre]:
    """A contact, however stiff, with a steep curve; or the Stribeck curve with bristles next to rigid.

    Softer ones left 40 times as much as the curve.
    """
    curve = simpler.get("Stribeck")
    if curve is None:
        return [_steep(simpler["compliant"])] if "compliant" in simpler else []
    law = curve.law
    stiffness = law.kinetic / (STIFFEST * float(curve.scales[:, 0].min()))
    damping = 0.2 * math.sqrt(stiffness * curve.mass)
    shape = {"speed": law.speed, "exponent": law.exponent}
    return [LuGre(law.kinetic, law.static, stiffness=stiffness, damping=damping, **shape)]


def _bristles(seen: Observed, stiffness: Array, speed: Array, excess: Array) -> Array:
    """Force of bristles without damping, one column each; an implicit step, since sliding bends them stiffly."""
    force = np.empty((len(seen.slip), len(stiffness)))
    now = np.zeros(len(stiffness))
    levels = seen.level * (1 + excess * np.exp(-((seen.speed[:, None] / speed) ** 2)))
    for row, slip, level in zip(force, seen.slip, levels, strict=True):
        row[:] = now
        now = (now + stiffness * slip) / (1 + stiffness * abs(slip) / level)
    return force


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
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction
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
            CurvedMode(
                name,
                "slip",
                side,
                f,
                (turn,),
                {"force_state": self.stiffness * v * (1 - f * (side / self.kinetic)) ** self.exponent},
            )
            for name, side, turn in either_side()
        )
