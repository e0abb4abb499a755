"""Friction of a gear: either direction its own, and a part of the load that its teeth carry."""

from __future__ import annotations

from stickslip.laws.base import Exit, Mode, Rigid, Row
from stickslip.parameters import parameter, parametric


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
