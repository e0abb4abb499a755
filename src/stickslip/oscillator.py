"""The oscillator: a mass on a spring, with what moves it and what it rubs on."""

from __future__ import annotations

import math
from typing import Any

from stickslip.drives.kinds import Drive, Release, require_drive
from stickslip.errors import ModelError
from stickslip.laws.base import Law
from stickslip.laws.curved import Creeping, CurvedLaw
from stickslip.parameters import changed, parameter, parametric


@parametric
class Oscillator:
    r"""One mass: :math:`m\ddot x + c\,(\dot x - \dot d) + k\,(x - z) + f = P(t)`, z the spring's end, d the damper's.

    Raises
    ------
    ModelError
        A value has no meaning.

    Examples
    --------
    >>> from stickslip.laws.coulomb import Coulomb
    >>> slider = Oscillator(mass=2.42, stiffness=2310, law=Coulomb(1.1))
    >>> round(slider.frequency, 3), slider.having(kinetic=1.28, mass=3.0).law
    (4.917, Coulomb(kinetic=1.28, static=None))
    """

    mass: float = parameter("kg", "mass", positive=True, note="m")
    stiffness: float = parameter("N/m", "stiffness", note="k; zero: no spring")
    law: Law | CurvedLaw = parameter("", "friction law of the contact")
    drive: Drive = parameter("", "what moves", default=Release(), note="nothing (free decay) where left out")
    damping: float = parameter("N s/m", "damping", default=0.0, signed=True, note="c; negative: self-excited")
    damper: str = parameter("", "what the damper is fixed to", default="ground", choices=("ground", "base"))

    def __post_init__(self) -> None:
        if isinstance(self.law, type) or not (hasattr(self.law, "modes") or hasattr(self.law, "rates")):
            raise ModelError(
                f"law = {self.law!r}", "a mass rubs under a friction law", "give one, as law=Coulomb(1.1)"
            ).of("law")
        require_drive(self.drive)
        if self.drive.motion().imposed:
            _require_given_way(self.law)

    @property
    def frequency(self) -> float:
        """Natural frequency without friction and damping [Hz]."""
        return math.sqrt(self.stiffness / self.mass) / (2 * math.pi)

    def having(self, **changes: Any) -> Oscillator:
        """The same oscillator with other values; a name is looked for in the oscillator, its law, then its drive.

        Parameters
        ----------
        **changes
            New values by name (``mass=3.0, kinetic=1.28, frequency=5.61``), or by name and place
            (``**{"law.stiffness": 1e5}``).

        Returns
        -------
        Oscillator
        """
        return changed(self, changes)


def _require_given_way(law: Any) -> None:
    """Refuse a law under an imposed motion that would hold the mass."""
    name = type(law).__name__
    modes = law.rates() if isinstance(law, CurvedLaw) else law.modes()
    if isinstance(law, Creeping) or any(mode.friction is None for mode in modes):
        raise ModelError(
            f"{name} under an imposed motion",
            "a rigid contact would hold the mass against it",
            "put a spring before it: CompliantContact(), or InSeries() of this law",
        ).of("law")
