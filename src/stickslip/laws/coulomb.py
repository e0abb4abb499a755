"""Dry friction on a rigid contact: Coulomb's law, with static above kinetic friction if wanted."""

from __future__ import annotations

from stickslip.laws.base import Exit, Mode, Rigid, static_level
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
