"""The compliant contact with inertia of section 4.5, in series with the mass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from stickslip.laws.base import Exit, Mode, Row, static_level
from stickslip.parameters import parameter, parametric


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
        held = (
            Exit({**borne, "1": -level}, "forward"),
            Exit({**{name: -value for name, value in borne.items()}, "1": -level}, "back"),
        )
        return (
            self._slip("back", -1, force),
            Mode("stuck", "microstick", 0, force, held, {"stretch": {"v": 1.0}}),
            self._slip("forward", 1, force),
        )

    def _slip(self, name: str, side: int, force: Row) -> Mode:
        push = {key: value / self.mass for key, value in force.items()}
        push |= {"face_acceleration": -1.0, "1": -side * self.kinetic / self.mass}
        stop = Exit({"u": float(-side)}, "stuck", {"u": {}})
        return Mode(name, "slip", side, force, (stop,), {"stretch": {"v": 1.0, "u": -1.0}, "u": push})
