"""Contacts that give way before they slip: a spring and a damper without mass (thesis, chapters 3 and 4), one with
inertia (section 4.5), and bristles (LuGre, Dahl)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from stickslip.arrays import Array
from stickslip.laws.base import Exit, Mode, Row, static_level
from stickslip.laws.coulomb import held_until
from stickslip.laws.curved import CurvedMode, Sliding, either_side, symbol
from stickslip.laws.guessing import (
    FALLS,
    GRID,
    LEAST_EXCESS,
    LITTLE,
    SPEEDS,
    STIFFEST,
    Family,
    Hypothesis,
    Observed,
    Searched,
    share,
)
from stickslip.laws.stribeck import EXPONENTS, require_static_above, stribeck_curve
from stickslip.parameters import parameter, parametric

HARDEST, SOFTEST = 3000.0, 3.0  # of a guess, against the spring that its friction bends over the stroke
LIGHT = 0.02  # damping of a guess over sqrt(stiffness * mass): a hundredth of the critical


@parametric
class CompliantContact:
    r"""Coulomb friction through a massless contact of stiffness :math:`K_y` and damping :math:`c`.

    In slip :math:`f = f_k\,\mathrm{sgn}\,\dot x`; in microstick :math:`f = K_y y + c\,\dot x` with
    :math:`y = x - X`, X the place where the contact holds (thesis, equations 3.9 to 3.11). Microstick ends when
    :math:`|f|` reaches `static`; slip then goes in the direction of f. Should the mass move against that direction
    (possible only with much damping; it does not happen in the thesis's cases), friction keeps its sign until the
    velocity has reversed and come back to zero.

    Raises
    ------
    ModelError
        A value has no meaning, or the rule is not one of the two.

    Examples
    --------
    >>> contact = CompliantContact(kinetic=1.1, stiffness=192000, damping=23.9)
    >>> contact.memory["anchor"]
    {'x': 1.0}
    """

    label = "Compliant contact"
    formula = (
        "f = kinetic sign(v) while sliding; f = stiffness (x - anchor) + damping v from each reversal until |f| = "
        "static, the anchor then kinetic/stiffness behind"
    )
    absent: ClassVar = {"static": "kinetic"}
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction

    kinetic: float = parameter("N", "sliding friction")
    stiffness: float = parameter("N/m", "contact stiffness", positive=True)
    damping: float = parameter("N s/m", "contact damping", default=0.0)
    static: float | None = parameter(
        "N", "static friction", default=None, note="at which microstick ends; None: as `kinetic`"
    )
    rule: str = parameter(
        "",
        "how the contact moves in slip",
        default="literal",
        choices=("literal", "consistent"),
        note='"literal": it stays at its full deflection :math:`f_k/K_y`, as the thesis has it; "consistent": a '
        r"Kelvin-Voigt contact whose deflection relaxes, :math:`c\dot y + K_y y = \pm f_k`, and which sticks when the "
        r"slider's velocity :math:`\dot x - \dot y` vanishes; equal where c is zero",
    )

    def __post_init__(self) -> None:
        static_level(self.static, self.kinetic)

    @classmethod
    def hypotheses(cls) -> tuple[Hypothesis, ...]:
        """A contact that gives way."""
        family = Family("compliant", "that of a compliant contact")
        return (Hypothesis("compliant", family, _guessed_contact, _from_coulomb, ("Coulomb",)),)

    def own_formula(self) -> str:
        """The formula, with how the contact moves in slip by this rule."""
        if self.rule == "literal":
            return self.formula
        return f"{self.formula}; while sliding the deflection (x - anchor) relaxes as stiffness and damping let it"

    @property
    def memory(self) -> Mapping[str, Row]:
        """Where the contact holds [m]; relaxed under the mass at the start."""
        return {"anchor": {"x": 1.0}}

    @property
    def places(self) -> tuple[str, ...]:
        """The anchor."""
        return ("anchor",)

    @property
    def entry(self) -> tuple[str, str, str]:
        """Motion starts in microstick, whatever the velocity: the contact is relaxed."""
        return "microstuck", "microstuck", "microstuck"

    def modes(self) -> tuple[Mode, ...]:
        """Slip on either side, and microstick."""
        level = static_level(self.static, self.kinetic)
        force = {"x": self.stiffness, "anchor": -self.stiffness, "v": self.damping}
        relaxing = self.rule == "consistent" and self.damping > 0
        slip = self._relaxing_slip if relaxing else self._slip
        return slip(-1), Mode("microstuck", "microstick", 0, force, held_until(level)), slip(1)

    def _slip(self, side: int) -> Mode:
        full = side * self.kinetic / self.stiffness
        stop = Exit({"v": float(-side)}, "microstuck", {"anchor": {"x": 1.0, "1": -full}}, crossing=True)
        return Mode(_NAMES[side], "slip", side, {"1": side * self.kinetic}, (stop,))

    def _relaxing_slip(self, side: int) -> Mode:
        relax = self.stiffness / self.damping
        slider = {"v": 1.0, "x": relax, "anchor": -relax, "1": -side * self.kinetic / self.damping}
        stop = Exit({name: -side * value for name, value in slider.items()}, "microstuck")
        return Mode(_NAMES[side], "slip", side, {"1": side * self.kinetic}, (stop,), {"anchor": slider})


_NAMES = {-1: "back", 1: "forward"}


def _guessed_contact(seen: Observed) -> list[CompliantContact]:
    """The spring that the friction bends where it turns, and what is left of it in phase with the speed."""
    stiffest = 2 * seen.level * HARDEST / float(np.ptp(np.cumsum(seen.slip)))
    stiffness = np.geomspace(stiffest * SOFTEST / HARDEST, stiffest, 2 * GRID)
    tried = []
    for k, force in zip(stiffness, _elastoplastic(seen, stiffness).T, strict=True):
        sticking = np.abs(force) < seen.level * (1 - 1e-9)
        damping = share(seen.speed[sticking], (seen.friction - force)[sticking])
        modelled = np.where(sticking, force + damping * seen.speed, force)
        # a number that is zero is not fitted: a loss that the friction does not show is begun small
        damping = max(damping, LIGHT * math.sqrt(float(k) * seen.mass))
        tried.append((seen.left(modelled), CompliantContact(seen.level, stiffness=float(k), damping=damping)))
    return [min(tried, key=lambda attempt: attempt[0])[1]]


def _from_coulomb(simpler: Mapping[str, Searched]) -> list[CompliantContact]:
    """A contact next to rigid."""
    if "Coulomb" not in simpler:
        return []
    rigid = simpler["Coulomb"]
    stiffness = rigid.law.kinetic / (STIFFEST * float(rigid.scales[:, 0].max()))
    return [CompliantContact(rigid.law.kinetic, stiffness=stiffness, damping=0.2 * math.sqrt(stiffness * rigid.mass))]


def _elastoplastic(seen: Observed, stiffness: Array) -> Array:
    """Force of springs that yield at the level, one column each."""
    force = np.empty((len(seen.slip), len(stiffness)))
    now = np.zeros(len(stiffness))
    for row, slip in zip(force, seen.slip, strict=True):
        row[:] = now
        now = np.clip(now + stiffness * slip, -seen.level, seen.level)
    return force


@parametric
class InertialContact:
    r"""A contact with a mass of its own: spring and damper to the slider, Coulomb friction to the counter-face.

    :math:`m_c\ddot y = K_y(x-y) + c(\dot x-\dot y) - f_k\,\mathrm{sgn}(\dot y-\dot b)`, b the counter-face's
    displacement; the slider feels :math:`f = K_y(x-y) + c(\dot x-\dot y)` (thesis, equation 4.3, with the imposed
    motion replaced by the slider's). The contact holds while :math:`|f - m_c\ddot b| \le f_s`: on a counter-face that
    accelerates, friction has its mass to carry along as well.

    Examples
    --------
    >>> sorted(InertialContact(1.1, stiffness=192000, mass=0.01).memory)
    ['stretch', 'u']
    """

    label = "Contact with inertia"
    formula = (
        "f = stiffness (x - y) + damping (x' - y'), mass (y'' + face_acceleration) = f - kinetic sign(y'), x and y on "
        "the counter-face"
    )
    absent: ClassVar = {"static": "kinetic"}
    memory_units: ClassVar[Mapping[str, str]] = {"stretch": "m", "u": "m/s"}
    loads = ("preload",)  # of a contact: its levels are proportional to a steady load

    kinetic: float = parameter("N", "sliding friction", note="under the contact")
    stiffness: float = parameter("N/m", "contact stiffness", positive=True)
    mass: float = parameter("kg", "contact mass", positive=True)
    damping: float = parameter("N s/m", "contact damping", default=0.0)
    static: float | None = parameter(
        "N", "static friction", default=None, note="under the contact while it holds; None: as `kinetic`"
    )

    def __post_init__(self) -> None:
        static_level(self.static, self.kinetic)

    @property
    def memory(self) -> Mapping[str, Row]:
        """Stretch x - y [m] and velocity u [m/s] of the contact on its face, at the start relaxed and at rest.

        Not y itself: far along the way a stiff contact's force would lose its digits in x - y.
        """
        return {"stretch": {}, "u": {}}

    @property
    def places(self) -> tuple[str, ...]:
        """None."""
        return ()

    @property
    def entry(self) -> tuple[str, str, str]:
        """The contact starts held."""
        return "stuck", "stuck", "stuck"

    def modes(self) -> tuple[Mode, ...]:
        """The contact slides to either side, or holds."""
        force = {"stretch": self.stiffness, "v": self.damping, "u": -self.damping}
        level = static_level(self.static, self.kinetic)
        borne = {"stretch": self.stiffness, "v": self.damping, "face_acceleration": -self.mass}
        opposite = {name: -value for name, value in borne.items()}
        exits = Exit({**borne, "1": -level}, "forward"), Exit({**opposite, "1": -level}, "back")
        stuck = Mode("stuck", "microstick", 0, force, exits, {"stretch": {"v": 1.0}})
        return self._slip("back", -1, force), stuck, self._slip("forward", 1, force)

    def _slip(self, name: str, side: int, force: Row) -> Mode:
        push = {key: value / self.mass for key, value in force.items()}
        push |= {"face_acceleration": -1.0, "1": -side * self.kinetic / self.mass}
        stop = Exit({"u": float(-side)}, "stuck", {"u": {}})
        return Mode(name, "slip", side, force, (stop,), {"stretch": {"v": 1.0, "u": -1.0}, "u": push})


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
        return (Hypothesis("LuGre", family, _guessed_bristles, _from_compliant, ("compliant", "Stribeck"), _next_to),)

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


def _guessed_bristles(seen: Observed) -> list[LuGre]:
    """The bristles whose bending under the measured sliding follows the friction best."""
    contact = _guessed_contact(seen)[0]
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
