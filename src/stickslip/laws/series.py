"""Any law behind a compliant contact: a spring and a damper without mass carry its friction to the mass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from stickslip.errors import ModelError
from stickslip.laws.base import Law, Mode, Row
from stickslip.laws.curved import CurvedLaw
from stickslip.parameters import parameter, parametric


@parametric
class InSeries:
    r"""A law at a slider without mass, tied to the mass by the tangential contact stiffness and damping.

    :math:`f = K_y (x-y) + c\,(\dot x-\dot y)`, y the slider's displacement, and f is the friction that the law gives
    for the slider's motion. Where the law is :math:`f = \alpha y + b\dot y + r`, the slider follows
    :math:`(b+c)\,\dot y = K_y x + c\dot x - (K_y+\alpha) y - r`; with b = c = 0 it stands at
    :math:`y = (K_y x - r)/(K_y+\alpha)`. A law holds the slider where it would hold the mass.

    Raises
    ------
    ModelError
        A value has no meaning, or the slider would jump.

    Examples
    --------
    >>> from stickslip.laws.linear_slope import LinearSlope
    >>> contact = InSeries(LinearSlope(1.0, slope=-5.0), stiffness=192000, damping=24)
    >>> [(mode.name, mode.kind) for mode in contact.modes()]
    [('back', 'slip'), ('stuck', 'microstick'), ('forward', 'slip')]
    """

    label = "Slider in series with a spring"
    formula = "a slider without mass under the law, tied to the mass by f = stiffness (x - y) + damping (x' - y')"

    law: Law = parameter("", "law at the slider", note="of linear modes")
    stiffness: float = parameter("N/m", "contact stiffness", positive=True, note="K_y")
    damping: float = parameter(
        "N s/m",
        "contact damping",
        default=0.0,
        note="c; where the law's friction falls with speed, it must exceed that slope, or a slider without mass jumps",
    )

    def __post_init__(self) -> None:
        if isinstance(self.law, CurvedLaw):
            raise ModelError(
                f"{type(self.law).__name__} in series",
                "the law in series has linear modes",
                "use Tabulated, or another law with linear modes",
            )
        self.modes()

    @property
    def slider(self) -> str:
        """Name of the slider's displacement in the memory: "slider", or "slider2" ... behind another one."""
        behind = sum(name.startswith("slider") for name in self.law.memory)
        return f"slider{behind + 1}" if behind else "slider"

    @property
    def memory(self) -> Mapping[str, Row]:
        """The slider's displacement [m], under the mass at the start, and the law's own memory."""
        return {self.slider: {"x": 1.0}, **self.law.memory}

    @property
    def memory_units(self) -> Mapping[str, str]:
        """Of the law's own memory."""
        return getattr(self.law, "memory_units", {})

    @property
    def places(self) -> tuple[str, ...]:
        """The slider's, and the law's own."""
        return (self.slider, *self.law.places)

    @property
    def entry(self) -> tuple[str, str, str]:
        """Motion starts with the slider at rest, whatever the velocity: the contact is relaxed."""
        return (self.law.entry[1],) * 3

    def modes(self) -> tuple[Mode, ...]:
        """The law's modes, with the slider in the place of the mass."""
        return tuple(self._held(mode) if mode.friction is None else self._slides(mode) for mode in self.law.modes())

    def _held(self, mode: Mode) -> Mode:
        spring = {"x": self.stiffness, self.slider: -self.stiffness, "v": self.damping}
        return replace(_moved(mode, {self.slider: 1.0}, {}), kind="microstick", friction=spring)

    def _slides(self, mode: Mode) -> Mode:
        """A mode in which the law's friction is a linear form of the slider's motion."""
        own = dict(mode.friction or {})
        along, slope = own.pop("x", 0.0), own.pop("v", 0.0)
        resisting, stiff = slope + self.damping, self.stiffness + along
        if resisting > 0:
            push = {"x": self.stiffness, "v": self.damping, self.slider: -stiff}
            speed = _sum((1 / resisting, push), (-1 / resisting, own))
            moved = _moved(mode, {self.slider: 1.0}, speed)
            return replace(
                moved,
                friction=_sum((1.0, own), (along, {self.slider: 1.0}), (slope, speed)),
                rates={**moved.rates, self.slider: speed},
            )
        if resisting < 0 or slope != 0:
            raise ModelError(
                f"a friction slope of {slope:g} N s/m behind damping = {self.damping:g} N s/m",
                "a slider without mass jumps where friction falls faster with speed than the damping rises",
                "raise damping= above it",
            )
        place = _sum((self.stiffness / stiff, {"x": 1.0}), (-1 / stiff, own)) if stiff > 0 else {}
        change = _sum(*((factor, mode.rates.get(name, {})) for name, factor in own.items()))
        by_speed, by_force = change.pop("v", 0.0), change.pop("df", 0.0)
        whole = stiff + by_speed - self.stiffness * by_force
        if min(stiff, whole) <= 0:
            raise ModelError(
                f"friction that falls by {-along:g} N/m along the way behind stiffness = {self.stiffness:g} N/m",
                "a slider without mass jumps where friction falls faster than the spring",
                "raise stiffness=",
            )
        rest = _put(change, place, {})
        speed = _sum((self.stiffness * (1 - by_force) / whole, {"v": 1.0}), (-1 / whole, rest))
        moved = _moved(mode, place, speed)
        # the slider's place is written down when the mode ends; while it lasts it follows from the rest
        exits = tuple(replace(exit_, reset={self.slider: place, **exit_.reset}) for exit_ in moved.exits)
        return replace(moved, friction=_sum((1.0, own), (along, place)), exits=exits)


def _moved(mode: Mode, place: Row, speed: Row) -> Mode:
    """A mode whose forms speak of the slider: its displacement and velocity in the place of the mass's."""
    exits = tuple(
        replace(
            exit_,
            quantity=_put(exit_.quantity, place, speed),
            reset={name: _put(form, place, speed) for name, form in exit_.reset.items()},
        )
        for exit_ in mode.exits
    )
    return replace(mode, exits=exits, rates={name: _put(form, place, speed) for name, form in mode.rates.items()})


def _put(form: Row, place: Row, speed: Row) -> dict[str, float]:
    own = {name: value for name, value in form.items() if name not in ("x", "v")}
    return _sum((1.0, own), (form.get("x", 0.0), place), (form.get("v", 0.0), speed))


def _sum(*parts: tuple[float, Row]) -> dict[str, float]:
    """The sum of linear forms, each by its factor, without the terms that vanish."""
    total: dict[str, float] = {}
    for factor, form in parts:
        for name, value in form.items():
            total[name] = total.get(name, 0.0) + factor * value
    return {name: value for name, value in total.items() if value != 0.0}
