"""The state-variable law of chapter 4: friction follows Coulomb's law with a lag; smooth, and as a table of modes.

Rate-and-state friction of rocks and metals: the logarithm of the speed and of the contact's age.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode, Rigid, Row
from stickslip.laws.curved import CurvedMode, Expression, Sliding, asinh, either_side, exp, lifted, log, symbol, tanh
from stickslip.laws.guessing import GRID, Family, Hypothesis, Observed, share
from stickslip.parameters import finite, parameter, parametric

# Of the friction's level: the n-th swing of a tremble has 1.5/n of it, and the way that is left to go is the square.
TREMBLE = 5e-4

RATES = (2.0, 80.0)  # of a guess, over the oscillation's angular frequency
STEEPEST = 60.0  # of a guess, over the largest speed

STILLEST = 1e-12  # of the speed at which friction turns: a logarithm of the speed wants one that is not zero
# friction over direct effect from which asinh is a logarithm: its argument is above e^60, or nothing
LOGARITHMIC = 100.0


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
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction
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


@parametric
class StateVariable(Rigid):
    r"""Friction that tracks Coulomb's: :math:`\dot\theta = -f_k\gamma(\theta - f_k\,\mathrm{sgn}\,v)`.

    Thesis, equations 4.1 and 4.2, where the backbone lacks its factor :math:`f_k`; `printed` keeps it out, which
    limits friction to 1 N. The product :math:`f_k\gamma` is the rate. Where velocity and acceleration vanish together
    the mass may be held: :math:`\mathrm{sgn}\,0` takes whatever value between -1 and 1 keeps it at rest. It comes to
    such a rest by trembling ever faster, without end; the mass is held from where the trembling friction is within
    5e-4 of its level; what is left of the trembling would move it by 1e-6 of the motion or less.

    Examples
    --------
    >>> [mode.name for mode in StateVariable(1.1, rate=100.0).modes()]
    ['back', 'turning', 'held', 'forward']
    """

    label = "State variable"
    formula = "f = theta, theta' = -kinetic rate (theta - level sign(v)), level = kinetic, 1 where printed is true"
    memory_units: ClassVar[Mapping[str, str]] = {"theta": "N"}

    kinetic: float = parameter("N", "sliding friction", positive=True, note="f_k")
    rate: float = parameter("1/(N s)", "rate", positive=True, note="gamma")
    printed: bool = parameter("", "backbone of 1 N, as printed", default=False)
    steepness: float | None = parameter(
        "s/m",
        "steepness",
        default=None,
        positive=True,
        note=r"alpha: the backbone rises as :math:`\alpha v` to its full level instead of jumping, a polygon for the "
        r"thesis's :math:`\tanh\alpha v`. None: it jumps",
    )

    hypotheses = SmoothStateVariable.hypotheses  # records are asked for its smooth form

    def own_formula(self) -> str:
        """The formula, with the slope near rest where there is one."""
        near_rest = "" if self.steepness is None else "; steepness v for sign(v) near rest"
        return f"{self.formula}{near_rest}"

    @property
    def memory(self) -> Mapping[str, Row]:
        """The friction force [N], zero at the start."""
        return {"theta": {}}

    @property
    def entry(self) -> tuple[str, str, str]:
        """Modes in which motion starts, by the sign of the velocity."""
        return ("back", "turning", "forward") if self.steepness is None else ("slow", "slow", "slow")

    def modes(self) -> tuple[Mode, ...]:
        """Slip on either side, and the rest in which friction follows the load."""
        decay = self.kinetic * self.rate
        pull = decay * (1.0 if self.printed else self.kinetic)
        if self.steepness is not None:
            edge = 1 / self.steepness
            slow = (Exit({"v": 1.0, "1": -edge}, "forward"), Exit({"v": -1.0, "1": -edge}, "back"))
            rates = {"theta": {"theta": -decay, "v": pull * self.steepness}}
            return (
                self._slip("back", -1, decay, pull, edge),
                Mode("slow", "microstick", 0, {"theta": 1.0}, slow, rates),
                self._slip("forward", 1, decay, pull, edge),
            )
        band = TREMBLE * pull / decay
        onward = (
            Exit({"f": 1.0, "theta": -1.0, "1": -band}, "forward"),
            Exit({"f": -1.0, "theta": 1.0, "1": -band}, "back"),
        )
        released = (
            Exit({"df": 1.0, "theta": decay, "1": -pull}, "forward"),
            Exit({"df": -1.0, "theta": -decay, "1": -pull}, "back"),
        )
        follows, push = {"theta": {"df": 1.0}}, {"theta": {"f": 1.0}}
        # no time passes while it turns: it goes on, or its friction is the push from then on and holds it or lets it go
        let_go = (
            Exit({"df": 1.0, "f": decay, "1": -pull}, "forward", push),
            Exit({"df": -1.0, "f": -decay, "1": -pull}, "back", push),
        )
        turning = (*onward, *let_go, Exit({"1": 1.0}, "held", push))
        return (
            self._slip("back", -1, decay, pull),
            Mode("turning", "stick", 0, None, turning, follows),
            Mode("held", "stick", 0, None, released, follows),
            self._slip("forward", 1, decay, pull),
        )

    def _slip(self, name: str, side: int, decay: float, pull: float, edge: float = 0.0) -> Mode:
        rates = {"theta": {"theta": -decay, "1": side * pull}}
        stop = Exit({"v": float(-side), "1": edge}, "slow") if edge else Exit({"v": float(-side)}, "turning")
        return Mode(name, "slip", side, {"theta": 1.0}, (stop,), rates)


def _guesses(seen: Observed) -> list[SmoothStateVariable]:
    """The rate and steepness whose lagging backbone follows the friction best."""
    from scipy.linalg import solve_banded

    steepnesses = np.geomspace(3.0, STEEPEST, GRID) / seen.fastest
    backbones = np.tanh(np.multiply.outer(seen.speed, steepnesses))
    band, tried = np.ones((2, len(backbones))), []
    for rate in seen.frequency * np.geomspace(*RATES, GRID):
        kept = np.exp(-rate * float(seen.step[0]))  # of a lag, from one reading to the next
        band[1] = -kept
        for steepness, lagging in zip(steepnesses, solve_banded((1, 0), band, (1 - kept) * backbones).T, strict=True):
            level = share(lagging, seen.friction)
            tried.append((seen.left(level * lagging), level, rate, steepness))
    _, level, rate, steepness = min(tried)
    level = max(level, 0.1 * seen.level)
    return [SmoothStateVariable(level, rate=float(rate) / level, steepness=float(steepness))]


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
        A value is not finite and positive, or mu_0/a is too large for numbers (300).

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
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction
    memory_units: ClassVar[Mapping[str, str]] = {"age": "s"}

    normal: float = parameter("N", "normal load", positive=True, note="N")
    friction: float = parameter("1", "coefficient of friction", positive=True, note="mu_0, at the reference speed")
    direct: float = parameter("1", "direct effect", positive=True, note="a")
    evolution: float = parameter("1", "evolution effect", note="b")
    distance: float = parameter("m", "critical distance", positive=True, note="D_c: the contact renews itself over it")
    reference: float = parameter("m/s", "reference speed", positive=True, note="V_0")
    law: str = parameter("", "how the age evolves", default="aging", choices=("aging", "slip"))

    def __post_init__(self) -> None:
        if self.friction / self.direct > 300:  # its square, and that of a speed beside it, are numbers too
            raise ModelError(
                f"friction / direct = {self.friction / self.direct:g}",
                "the square of its exponential is a number up to 300",
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
            CurvedMode(name, "slip", side, self._force(v, side), (turn,), {"age": self._ageing(v * float(side))})
            for name, side, turn in either_side()
        )

    def holding(self, speed: float, side: int = 0) -> CurvedMode:
        r"""Creep slower than a speed [m/s]: the mass goes as fast as its friction, which is the push, makes it go.

        With :math:`q = f/(a N)` and :math:`G = \exp[(\mu_0 + b\ln(V_0\theta/D_c))/a]` the law says
        :math:`v = (2 V_0/G) \sinh q`. For the age's sake :math:`|v|` is :math:`(2 V_0/G)(\cosh q - 1)`: both are
        nothing where they differ, this one is smooth. To one side it is :math:`(2 V_0/G) |\sinh q|`, at any speed.
        """
        stress, grip = symbol("f") / (self.direct * self.normal), self._grip()
        onward, backward, still = exp(stress - grip), exp(-stress - grip), exp(-grip)
        pace = onward + backward - 2 * (1 - STILLEST) * still
        if side:
            pace = side * (onward - backward) + 2 * STILLEST * still
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

    def _force(self, speed: Expression | float, side: int = 1) -> Expression:
        if self.friction > LOGARITHMIC * self.direct:  # the cube of asinh's argument would be no number
            return side * self.direct * self.normal * (self._grip() + log(speed * lifted(side / self.reference)))
        return self.direct * self.normal * asinh(exp(self._grip()) * speed / (2 * self.reference))

    def _ageing(self, speed: Expression) -> Expression:
        """Rate of the age at a speed without sign."""
        way = speed * symbol("age") * (1 / self.distance)
        return 1 - way if self.law == "aging" else -(way * log(way))
