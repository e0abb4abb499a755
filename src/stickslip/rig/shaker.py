"""What a shaker can do: stroke, frequency, velocity, force; and whether that is enough for what is asked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from stickslip.errors import ModelError
from stickslip.parameters import finite
from stickslip.rig.settings import ShakerSettings


@dataclass(frozen=True)
class Shaker:
    r"""The limits of a shaker that moves the base as :math:`A \cos 2 \pi f t`.

    A is at most the stroke, :math:`2\pi f A` the velocity, and :math:`M (2\pi f)^2 A` with the pull of the spring the
    force. The thesis's (LDS 400, section 2.2) has 8 mm of amplitude, and a clean sine from 1 Hz on.

    Attributes
    ----------
    stroke : float
        Largest amplitude [m].
    lowest, highest : float
        Frequencies [Hz] between which its motion is a sine.
    velocity : float
        Largest velocity [m/s].
    force : float
        Largest force [N].
    moving_mass : float
        Of armature, table and base [kg].

    Raises
    ------
    ModelError
        A value without meaning.

    Examples
    --------
    >>> shaker = Shaker(force=20.0, moving_mass=1.5)
    >>> round(1e3 * shaker.largest(11.1), 2), shaker.bound(11.1)
    (2.74, 'force')
    """

    stroke: float = 8e-3
    lowest: float = 1.0
    highest: float = math.inf
    velocity: float = math.inf
    force: float = math.inf
    moving_mass: float = 0.0

    def __post_init__(self) -> None:
        finite("stroke", self.stroke, unit="m", positive=True)
        finite("lowest", self.lowest, unit="Hz")
        finite("moving_mass", self.moving_mass, unit="kg")
        for name in ("highest", "velocity", "force"):
            if not getattr(self, name) > 0:
                raise ModelError(f"{name} = {getattr(self, name)}", "a limit is positive", "leave it out where unknown")
        if not self.lowest < self.highest:
            raise ModelError(f"from {self.lowest} to {self.highest} Hz", "a range goes upwards", "swap them")

    @classmethod
    def of(cls, settings: ShakerSettings | None) -> Shaker:
        """The shaker of a rig's settings; the thesis's where they say nothing."""
        if settings is None:
            return cls()
        return cls(**{name: value for name, value in settings.model_dump().items() if value is not None})

    def demands(self, frequency: float, amplitude: float, *, pull: float = 0.0) -> Mapping[str, float]:
        """What a motion asks of it, each as a part of the limit.

        Parameters
        ----------
        frequency : float
            [Hz].
        amplitude : float
            [m].
        pull : float
            Largest force of the spring on the base [N].

        Returns
        -------
        mapping of str to float
            "stroke", "velocity" and "force"; more than 1 can not be.
        """
        turn = 2 * math.pi * frequency
        return {
            "stroke": amplitude / self.stroke,
            "velocity": turn * amplitude / self.velocity,
            "force": (self.moving_mass * turn**2 * amplitude + pull) / self.force,
        }

    def largest(self, frequency: float, *, pull: float = 0.0) -> float:
        """The largest amplitude [m] at a frequency [Hz], the spring pulling so much [N]; 0 where there is none."""
        turn = 2 * math.pi * frequency
        if not self.lowest <= frequency <= self.highest or pull >= self.force:
            return 0.0
        by_force = (self.force - pull) / (self.moving_mass * turn**2) if self.moving_mass else math.inf
        return min(self.stroke, self.velocity / turn, by_force)

    def bound(self, frequency: float, *, pull: float = 0.0) -> str:
        """Which limit the largest amplitude at a frequency reaches."""
        demands = self.demands(frequency, max(self.largest(frequency, pull=pull), 1e-12), pull=pull)
        return max(demands, key=lambda name: demands[name])

    def require(self, frequency: float, amplitude: float, *, pull: float = 0.0) -> None:
        """Refuse, in one sentence, a motion that it can not make.

        Raises
        ------
        ModelError
            The frequency lies outside its range, or the amplitude is too large.
        """
        if not self.lowest <= frequency <= self.highest:
            raise ModelError(
                f"{frequency:g} Hz",
                f"the shaker's motion is a sine from {self.lowest:g} to {self.highest:g} Hz",
                "choose a frequency between",
            )
        demands = self.demands(frequency, amplitude, pull=pull)
        worst = max(demands, key=lambda name: demands[name])
        if demands[worst] > 1:
            raise ModelError(
                f"an amplitude of {1e3 * amplitude:.3g} mm at {frequency:g} Hz",
                f"the shaker's {worst} allows {1e3 * self.largest(frequency, pull=pull):.3g} mm there",
                "ask for less",
            )
