"""The state-variable law of chapter 4 with its smooth backbone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from stickslip.laws.base import Row
from stickslip.laws.curved import CurvedMode, Sliding, either_side, symbol, tanh
from stickslip.laws.guessing import GRID, Family, Hypothesis, Observed, share
from stickslip.parameters import parameter, parametric

RATES = (2.0, 80.0)  # of a guess, over the oscillation's angular frequency
STEEPEST = 60.0  # of a guess, over the largest speed


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
    memory_units: ClassVar[Mapping[str, str]] = {"theta": "N"}

    kinetic: float = parameter("N", "sliding friction", positive=True, note="f_k")
    rate: float = parameter("1/(N s)", "rate", positive=True, note="gamma")
    steepness: float = parameter("s/m", "steepness", positive=True, note="alpha")
    printed: bool = parameter("", "backbone of 1 N, as printed", default=False)

    @classmethod
    def hypotheses(cls) -> tuple[Hypothesis, ...]:
        """Friction that lags."""
        family = Family("state variable", "that of a state variable, which lags behind the velocity")
        return (Hypothesis("state variable", family, _guesses),)

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


def _guesses(seen: Observed) -> list[SmoothStateVariable]:
    """The rate and steepness whose lagging backbone follows the friction best."""
    from scipy.signal import lfilter

    step, tried = float(seen.step[0]), []
    for steepness in np.geomspace(3.0, STEEPEST, GRID) / seen.fastest:
        backbone = np.tanh(steepness * seen.speed)
        for rate in seen.frequency * np.geomspace(*RATES, GRID):
            kept = np.exp(-rate * step)
            lagging = lfilter([1 - kept], [1, -kept], backbone)
            level = share(lagging, seen.friction)
            tried.append((seen.left(level * lagging), level, rate, steepness))
    _, level, rate, steepness = min(tried)
    level = max(level, 0.1 * seen.level)
    return [SmoothStateVariable(level, rate=float(rate) / level, steepness=float(steepness))]
