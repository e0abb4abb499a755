"""Any friction-velocity curve as a table: straight lines between its points, each solved exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode, Rigid, static_level
from stickslip.laws.coulomb import held_until
from stickslip.laws.curved import Expression
from stickslip.parameters import parameter, parametric


@parametric
class Tabulated(Rigid):
    """Rigid contact whose friction follows a polygon over the sliding speed, odd in the velocity.

    Beyond the last speed the force stays as it is there.

    Examples
    --------
    >>> stribeck = Tabulated.of(lambda v: 1.0 + 0.5 * 2.718281828 ** -(v / 0.1), np.linspace(0, 0.5, 101))
    >>> len(stribeck.modes()), round(stribeck.error, 6)
    (203, 0.000152)
    """

    label = "Table over speed"
    formula = (
        "f = F(|v|) sign(v) while sliding, F a polygon through forces at speeds, level beyond the last; |f| <= "
        "static at rest"
    )
    loads = ("preload", "normal")  # of a contact: it may be told as a coefficient of friction
    chosen = ("error",)  # not fitted where nothing else is said

    speeds: Sequence[float] = parameter(
        "m/s", "sliding speeds", size="row", signed=True, note="increasing, the first one 0"
    )
    forces: Sequence[float] = parameter("N", "friction forces", size="row", note="one at each speed")
    static: float | None = parameter("N", "static friction", default=None, note="None: the force at speed 0")
    error: float = parameter(
        "N",
        "error of the table",
        default=0.0,
        note="largest distance to the curve that it stands for; 0: it is the law",
    )

    def __post_init__(self) -> None:
        speeds, forces = tuple(map(float, self.speeds)), tuple(map(float, self.forces))
        if len(speeds) < 2 or len(speeds) != len(forces):
            raise ModelError(
                f"{len(speeds)} speeds, {len(forces)} forces",
                "two points at least, a force for each speed",
                "complete it",
            )
        if speeds[0] != 0 or not all(a < b for a, b in pairwise(speeds)):
            raise ModelError(
                "the speeds do not increase from 0", "a friction curve starts at 0 and is sorted", "sort it"
            )
        static_level(self.static, forces[0])
        object.__setattr__(self, "speeds", speeds)
        object.__setattr__(self, "forces", forces)

    @classmethod
    def of(cls, curve: Callable[[float], float], speeds: Sequence[float], static: float | None = None) -> Tabulated:
        """The polygon through a smooth curve, with its largest distance from it.

        Parameters
        ----------
        curve : callable
            Friction force [N] at a speed [m/s].
        speeds : sequence of float
            Where the polygon meets the curve.
        static : float, optional
            As in the class.

        Returns
        -------
        Tabulated
        """
        points = [float(v) for v in speeds]
        forces = [float(curve(v)) for v in points]
        fine = np.concatenate([np.linspace(a, b, 33) for a, b in pairwise(points)])
        error = float(np.max(np.abs([curve(float(v)) for v in fine] - np.interp(fine, points, forces))))
        return cls(points, forces, static, error)

    @property
    def entry(self) -> tuple[str, str, str]:
        """Modes in which motion starts, by the sign of the velocity."""
        return "back 0", "stuck", "forward 0"

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]."""
        return static_level(self.static, self.forces[0])

    def branches(self) -> tuple[tuple[float, Callable[[Expression], Expression]], ...]:
        """A straight line between two points, the last one level."""

        def line(speed: float, force: float, slope: float) -> Callable[[Expression], Expression]:
            return lambda at: force + slope * (at - speed)

        ends = zip(self.speeds, self.forces, (*self._slopes(), 0.0), strict=True)
        return tuple((speed, line(speed, force, slope)) for speed, force, slope in ends)

    def _slopes(self) -> tuple[float, ...]:
        """Slope of each straight piece [N s/m]."""
        points = zip(self.speeds, self.forces, strict=True)
        return tuple((g - f) / (w - v) for (v, f), (w, g) in pairwise(points))

    def modes(self) -> tuple[Mode, ...]:
        """A mode for each straight piece on either side, and stick."""
        stuck = Mode("stuck", "stick", 0, None, held_until(self.breakaway, back="back 0",
                                                           forward="forward 0"))  # fmt: skip
        return (*self._side(-1, "back"), stuck, *self._side(1, "forward"))

    def _side(self, side: int, name: str) -> list[Mode]:
        found = []
        last, slopes = len(self.speeds) - 1, (*self._slopes(), 0.0)
        for j in range(last + 1):
            low, high, slope = self.speeds[j], self.speeds[min(j + 1, last)], slopes[j]
            friction = {"1": side * (self.forces[j] - slope * low), "v": slope}
            slower = Exit({"v": -side, "1": low}, f"{name} {j - 1}") if j else Exit({"v": float(-side)}, "stuck")
            faster = (Exit({"v": float(side), "1": -high}, f"{name} {j + 1}"),) if j < last else ()
            found.append(Mode(f"{name} {j}", "slip", side, friction, (slower, *faster)))
        return found
