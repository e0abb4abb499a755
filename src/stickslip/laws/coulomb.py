"""Dry friction on a rigid contact: Coulomb's law, with static above kinetic friction if wanted.

Its kin: friction that rises or falls in proportion to the sliding speed, under a load that changes along the way, and
that of a gear, whose directions differ and whose teeth carry a part of the load.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from stickslip.laws.base import Exit, Mode, Rigid, Row, static_level
from stickslip.laws.curved import Expression
from stickslip.laws.guessing import EXCESSES, LITTLE, RIGID, Hypothesis
from stickslip.parameters import parameter, parametric


@parametric
class Coulomb(Rigid):
    r"""Rigid dry friction: :math:`f = f_k\,\mathrm{sgn}\,v` in slip, :math:`|f| \le f_s` in stick.

    A slip that comes to rest passes through the stuck mode; where the holding force would exceed `static` it goes on
    at once, in the direction of that force.

    Raises
    ------
    ModelError
        A level is negative or not finite, or `static` is below `kinetic`.

    Examples
    --------
    >>> [mode.name for mode in Coulomb(1.1).modes()]
    ['back', 'stuck', 'forward']
    """

    label = "Coulomb: rigid contact"
    formula = "f = kinetic sign(v) while sliding, |f| <= static at rest"
    absent: ClassVar = {"static": "kinetic"}
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction

    kinetic: float = parameter("N", "sliding friction")
    static: float | None = parameter("N", "static friction", default=None, note="None: as `kinetic`")

    def __post_init__(self) -> None:
        static_level(self.static, self.kinetic)

    @classmethod
    def hypotheses(cls) -> tuple[Hypothesis, ...]:
        """One level of friction; and static friction above it."""
        return (
            Hypothesis("Coulomb", RIGID, lambda seen: [cls(seen.level)]),
            Hypothesis(
                "static",
                RIGID,
                lambda seen: [_exceeding(seen.level, excess) for excess in (seen.excess, *EXCESSES)],
                lambda simpler: [_exceeding(simpler["Coulomb"].law.kinetic, LITTLE)] if "Coulomb" in simpler else [],
                ("Coulomb",),
                holds=lambda law: law.static is not None,
            ),
        )

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]."""
        return static_level(self.static, self.kinetic)

    def modes(self) -> tuple[Mode, ...]:
        """Slip on either side, and stick."""
        return (
            Mode("back", "slip", -1, {"1": -self.kinetic}, (Exit({"v": 1.0}, "stuck"),)),
            Mode("stuck", "stick", 0, None, held_until(self.breakaway)),
            Mode("forward", "slip", 1, {"1": self.kinetic}, (Exit({"v": -1.0}, "stuck"),)),
        )


def _exceeding(level: float, excess: float) -> Coulomb:
    return Coulomb(level, static=(1 + excess) * level)


def held_until(level: float, *, back: str = "back", forward: str = "forward") -> tuple[Exit, Exit]:
    """The exits of a stuck mode: the friction force reaches `level` [N] on either side."""
    return Exit({"f": 1.0, "1": -level}, forward), Exit({"f": -1.0, "1": -level}, back)


@parametric
class LinearSlope(Rigid):
    r"""Rigid contact with :math:`f = f_k\,\mathrm{sgn}\,v + s\,v` in slip, :math:`|f| \le f_s` in stick.

    Examples
    --------
    >>> LinearSlope(1.0, slope=-0.2, static=1.5).modes()[2].friction
    {'1': 1.0, 'v': -0.2}
    """

    label = "Friction linear in speed"
    formula = "f = kinetic sign(v) + slope v while sliding, |f| <= static at rest"
    absent: ClassVar = {"static": "kinetic"}
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction

    kinetic: float = parameter("N", "sliding friction", note="at vanishing speed")
    slope: float = parameter(
        "N s/m", "slope over the speed", signed=True, note="s; negative: friction falls with speed and feeds vibration"
    )
    static: float | None = parameter("N", "static friction", default=None, note="None: as `kinetic`")

    def __post_init__(self) -> None:
        static_level(self.static, self.kinetic)

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]."""
        return static_level(self.static, self.kinetic)

    def branches(self) -> tuple[tuple[float, Callable[[Expression], Expression]], ...]:
        """One straight line from rest on."""
        return ((0.0, lambda speed: self.kinetic + self.slope * speed),)

    def modes(self) -> tuple[Mode, ...]:
        """Slip on either side, and stick."""
        return (
            Mode("back", "slip", -1, {"1": -self.kinetic, "v": self.slope}, (Exit({"v": 1.0}, "stuck"),)),
            Mode("stuck", "stick", 0, None, held_until(self.breakaway)),
            Mode("forward", "slip", 1, {"1": self.kinetic, "v": self.slope}, (Exit({"v": -1.0}, "stuck"),)),
        )


@parametric
class PositionLoad(Rigid):
    r"""Rigid contact with :math:`|f| = n(x)`, :math:`n(x) = f_k + g\,x` where positive, else the contact is lifted.

    The oscillator of Feeny and Moon: chaotic under a harmonic drive.

    Examples
    --------
    >>> PositionLoad(1.0, gradient=1.5).modes()[2].friction
    {'1': 1.0, 'x': 1.5}
    """

    label = "Load that varies with position"
    formula = "f = (kinetic + gradient x) sign(v) where that load is positive, else no contact"

    kinetic: float = parameter("N", "sliding friction", note="at x = 0")
    gradient: float = parameter("N/m", "gradient of the load", signed=True, note="g")

    def modes(self) -> tuple[Mode, ...]:
        """Slip and flight on either side, and stick."""
        stuck = (
            Exit({"f": 1.0, "1": -self.kinetic, "x": -self.gradient}, "forward"),
            Exit({"f": -1.0, "1": -self.kinetic, "x": -self.gradient}, "back"),
        )
        lifted = self._lifted("back", "forward", -1), self._lifted("forward", "back", 1)
        return (self._slip("back", -1), Mode("stuck", "stick", 0, None, stuck), self._slip("forward", 1), *lifted)

    def _slip(self, name: str, side: int) -> Mode:
        friction = {"1": side * self.kinetic, "x": side * self.gradient}
        lift = Exit({"1": -self.kinetic, "x": -self.gradient}, f"{name} lifted")
        return Mode(name, "slip", side, friction, (Exit({"v": float(-side)}, "stuck"), lift))

    def _lifted(self, name: str, other: str, side: int) -> Mode:
        exits = (Exit({"v": float(-side)}, f"{other} lifted"), Exit({"1": self.kinetic, "x": self.gradient}, name))
        return Mode(f"{name} lifted", "flight", side, {}, exits)


@parametric
class Geared(Rigid):
    r"""Rigid contact of a gear: :math:`|f| = f_c + \mu |n| + s |v|` in slip, each of them of its direction.

    The load :math:`n(x) = n_0 + g\,x` is what a payload or gravity puts on the joint, linear about a place; its share
    is `driving` where the motion goes against it and `driven` where it goes along, as a gear's efficiency forward and
    back. In stick the friction is at most that of the slip at vanishing speed. The friction of robots' joints
    (:func:`~stickslip.cycle.regress_joint`); still linear in every mode.

    Examples
    --------
    >>> lifting = Geared(0.5, 0.5, load=4.0, driving=0.25, driven=0.125)
    >>> [(mode.name, mode.friction["1"]) for mode in lifting.modes() if mode.side]
    [('back', -1.0), ('forward', 1.5)]
    """

    label = "Gear: each direction its own, and a part of the load"
    formula = (
        "f = (c + p |n| + s |v|) sign(v) while sliding, n = load + gradient x, c = forward and s = viscous_forward "
        "where v > 0, else back and viscous_back, p = driving where v n > 0, else driven; at rest up to c + p |n|"
    )

    forward: float = parameter("N", "Coulomb friction forward", note="without load")
    back: float = parameter("N", "Coulomb friction back", note="without load")
    viscous_forward: float = parameter("N s/m", "viscous friction forward", default=0.0, signed=True)
    viscous_back: float = parameter("N s/m", "viscous friction back", default=0.0, signed=True)
    load: float = parameter("N", "load", default=0.0, signed=True, note="at x = 0; positive against forward motion")
    gradient: float = parameter("N/m", "gradient of the load", default=0.0, signed=True)
    driving: float = parameter("1", "friction per load against it", default=0.0)
    driven: float = parameter("1", "friction per load along it", default=0.0)

    def modes(self) -> tuple[Mode, ...]:
        """Slip on either side, and stick; each under a load of either sign, where it may change."""
        if self.gradient == 0:
            return self._under(1 if self.load >= 0 else -1, "")
        return (*self._under(1, ""), *self._under(-1, " under"))

    def _under(self, sign: int, ending: str) -> tuple[Mode, ...]:
        """The modes under a load of one sign; those under the other have the other ending."""
        ahead, behind = self._level(1, sign), self._level(-1, sign)
        exits = (
            Exit({"f": 1.0, **{key: -value for key, value in ahead.items()}}, f"forward{ending}"),
            Exit({"f": -1.0, **{key: -value for key, value in behind.items()}}, f"back{ending}"),
        )
        back = {**{key: -value for key, value in behind.items()}, "v": self.viscous_back}
        forward = {**ahead, "v": self.viscous_forward}
        return (
            Mode(f"back{ending}", "slip", -1, back, (Exit({"v": 1.0}, f"stuck{ending}"), *self._turned("back", sign))),
            Mode(f"stuck{ending}", "stick", 0, None, (*exits, *self._turned("stuck", sign))),
            Mode(
                f"forward{ending}", "slip", 1, forward,
                (Exit({"v": -1.0}, f"stuck{ending}"), *self._turned("forward", sign)),
            ),
        )  # fmt: skip

    def _level(self, side: int, sign: int) -> Row:
        """Friction of slip at vanishing speed, as a linear form of the place."""
        share = sign * (self.driving if side == sign else self.driven)
        level = {"1": (self.forward if side > 0 else self.back) + share * self.load}
        return {**level, "x": share * self.gradient} if self.gradient else level

    def _turned(self, mode: str, sign: int) -> tuple[Exit, ...]:
        """The exit to the same mode under the other load, where the load changes its sign."""
        if self.gradient == 0:
            return ()
        other = f"{mode} under" if sign > 0 else mode
        return (Exit({"1": -sign * self.load, "x": -sign * self.gradient}, other),)
