"""The oscillator: a mass on a spring, with what moves it and what it rubs on."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any

from stickslip.drives import Drive, Release
from stickslip.errors import ModelError
from stickslip.laws.base import Law, changed, finite, parameters
from stickslip.laws.curved import CurvedLaw


@dataclass(frozen=True)
class Oscillator:
    r"""One mass: :math:`m\ddot x + c\,(\dot x - \dot d) + k\,(x - z) + f = P(t)`, z the spring's end, d the damper's.

    Attributes
    ----------
    mass : float
        m [kg].
    stiffness : float
        k [N/m]; zero: no spring.
    law : Law or CurvedLaw
        Friction law of the contact.
    drive : Drive
        What moves; nothing (free decay) where left out.
    damping : float
        c [N s/m]; negative: a self-excited oscillator.
    damper : {"ground", "base"}
        What the damper's other end is fixed to.

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

    mass: float
    stiffness: float
    law: Law | CurvedLaw
    drive: Drive = field(default_factory=Release)
    damping: float = 0.0
    damper: str = "ground"

    def __post_init__(self) -> None:
        finite("mass", self.mass, unit="kg", positive=True)
        finite("stiffness", self.stiffness, unit="N/m")
        finite("damping", self.damping, unit="N s/m", signed=True)
        if self.damper not in ("ground", "base"):
            raise ModelError(
                f"damper = '{self.damper}'", "the damper is fixed to the 'ground' or the 'base'", "choose one"
            )

    @property
    def frequency(self) -> float:
        """Natural frequency without friction and damping [Hz]."""
        return math.sqrt(self.stiffness / self.mass) / (2 * math.pi)

    def having(self, **changes: Any) -> Oscillator:
        """The same oscillator with other values; a name is looked for in the oscillator, its law, then its drive.

        Of a law around another law (:class:`InSeries`), the inner one's parameters come last.

        Parameters
        ----------
        **changes
            New values by name (``mass=3.0, kinetic=1.28, frequency=5.61``).

        Returns
        -------
        Oscillator
        """
        own = {f.name: changes.pop(f.name) for f in fields(self) if f.name in changes}
        law, drive = own.pop("law", self.law), own.pop("drive", self.drive)
        of_law, of_drive = parameters(law), parameters(drive)
        for name in changes:
            if name not in of_law | of_drive:
                known = [*(f.name for f in fields(self)), *of_law, *of_drive]
                raise ModelError(f"no parameter is called '{name}'", f"it is one of {', '.join(known)}", "correct it")
        moved = {name: changes.pop(name) for name in of_drive.keys() & changes.keys() if name not in of_law}
        return replace(self, **own, law=changed(law, changes), drive=changed(drive, moved))
