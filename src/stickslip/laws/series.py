"""Any law behind a compliant contact: a spring and a damper without mass carry its friction to the mass.

Under a curved law the balance g = K (x - y) + c (x' - w) - F(w, y, memory) = 0 tells the speed w = y' of the slider
without mass between them. Differentiated along the motion until w' stands in it (once where friction or the damper
follows w, else twice), it is a rate, w' = -D g / g_w, and w one more entry of the state, which the Taylor solver
follows like any other (index reduction; Hairer and Wanner, Solving Ordinary Differential Equations II, section VII.2).
Friction that creeps is asked the other way round: its law tells w by the force.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Law, Mode, Row
from stickslip.laws.curved import Creeping, CurvedLaw, CurvedMode, Expression, differs, lifted, symbol
from stickslip.laws.stribeck import TimeDelay
from stickslip.parameters import finite, parameter, parametric

SPEED, FORCE = "slider_speed", "contact_force"
SPEEDS = [10.0 ** (j / 8) for j in range(-80, 33)]  # m/s at which friction is asked whether it falls too steeply
JUMP = 1e-9  # of the break-away force: friction of slowest sliding that is below it by more leaves a jump


def memory_of(law: Any, slider: str, damping: float) -> dict[str, Row]:
    """The state of a slider under a curved law: its place and, where the force alone does not tell it, its speed."""
    own: dict[str, Row] = {slider: {"x": 1.0}}
    if isinstance(law, Creeping):
        own |= {FORCE: {"v": damping}} if damping else {}
    else:
        own |= {SPEED: {}}
    return own | dict(law.memory)


def modes_of(law: Any, slider: str, stiffness: float, damping: float) -> tuple[CurvedMode, ...]:
    """The modes of a curved law with the slider in the place of the mass."""
    if isinstance(law, Creeping):
        return tuple(_creeping(law, slider, stiffness, damping))
    modes: tuple[CurvedMode, ...] = law.rates()
    _require_no_jump(modes, damping)
    known = {mode.name: mode for mode in modes}
    return tuple(_behind(mode, known, slider, stiffness, damping) for mode in modes)


def _behind(
    mode: CurvedMode, known: Mapping[str, CurvedMode], slider: str, stiffness: float, damping: float
) -> CurvedMode:
    """A mode of the law, told of the slider: held, or sliding by the balance of forces."""
    at = {"x": symbol(slider), "v": symbol(SPEED)}
    rates = {name: rate.put(at) for name, rate in mode.rates.items()}
    spring = stiffness * (symbol("x") - symbol(slider))
    exits = tuple(_as_behind(exit_, known[exit_.to], slider, stiffness, damping) for exit_ in mode.exits)
    levels = {name: level.put(at) for name, level in mode.levels.items()}
    if mode.friction is None:
        force = spring + damping * symbol("v") if damping else spring
        still = {name: rate.put({SPEED: lifted(0.0)}) for name, rate in rates.items()}
        return CurvedMode(mode.name, "microstick", 0, force, exits, still, levels=levels)
    force = spring + damping * (symbol("v") - symbol(SPEED)) if damping else spring
    rates |= {slider: symbol(SPEED)}
    rates[SPEED] = _acceleration(force - mode.friction.put(at), rates)
    return CurvedMode(mode.name, mode.kind, mode.side, force, exits, rates, levels=levels)


def _acceleration(balance: Expression, rates: Mapping[str, Expression]) -> Expression:
    """The rate of the slider's speed that keeps a balance of forces."""
    for _ in range(2):
        steepness, rest = balance.slope(SPEED), _along(balance, rates)
        if differs(steepness, lifted(0.0)):
            return -1.0 * rest / steepness
        balance = rest
    raise ModelError(
        "friction in series that follows neither the slider's speed nor its way",
        "the balance of forces tells the slider's speed",
        "give damping=, or a law whose friction does",
    )


def _along(expression: Expression, rates: Mapping[str, Expression]) -> Expression:
    """The rate of an expression along the motion, but for what the slider's speed adds."""
    moving = {"x": symbol("v"), "v": symbol("a"), **rates}
    total = lifted(0.0)
    for name in sorted(expression.symbols & moving.keys()):
        total = total + expression.slope(name) * moving[name]
    return total


def _as_behind(exit_: Exit, to: CurvedMode, slider: str, stiffness: float, damping: float) -> Exit:
    """An exit told of the slider; where it stops, its speed is none, and it stands where the force is that of rest."""
    names = {"x": slider, "v": SPEED}
    quantity = {names.get(name, name): value for name, value in exit_.quantity.items()}
    reset: dict[str, Row] = {}
    if set(exit_.quantity) == {"v"}:
        reset[SPEED] = {}
        side = -math.copysign(1.0, exit_.quantity["v"])
        level = _level(to, side)
        if level is not None:
            reset[slider] = {"x": 1.0, "v": damping / stiffness, "1": -side * level / stiffness}
    return replace(exit_, quantity=quantity, reset=reset | dict(exit_.reset))


def _level(stuck: CurvedMode, side: float) -> float | None:
    """The steady force up to which a mode holds to a side; None where there is none."""
    if stuck.friction is not None:
        return None
    for exit_ in stuck.exits:
        if set(exit_.quantity) == {"f", "1"} and exit_.quantity["f"] * side > 0:
            return -exit_.quantity["1"] / abs(exit_.quantity["f"])
    return None


def _creeping(law: Any, slider: str, stiffness: float, damping: float) -> Iterator[CurvedMode]:
    """The motion of a slider whose law tells its speed by the force; the modes tell the direction."""
    spring = stiffness * (symbol("x") - symbol(slider))
    force = symbol(FORCE) if damping else spring
    for name, side, other in (("back", -1, "forward"), ("forward", 1, "back")):
        stuck = law.holding(1.0, side)
        creep, rates = stuck.creep.put({"f": force}), {own: rate.put({"f": force}) for own, rate in stuck.rates.items()}
        rates[slider] = creep
        if damping:
            balance = spring + damping * (symbol("v") - creep)
            rates[FORCE] = _along(balance, rates) / (1.0 + damping * creep.slope(FORCE))
        yield CurvedMode(name, "slip", side, force, (Exit({"f": -float(side)}, other),), rates)


def _require_no_jump(modes: tuple[CurvedMode, ...], damping: float) -> None:
    """Refuse friction under which a slider without mass would jump."""
    known = {mode.name: mode for mode in modes}
    for mode in modes:
        if mode.friction is None:
            for exit_ in mode.exits:
                _require_continuous(mode, exit_, known[exit_.to])
        elif mode.friction.symbols <= {"v"}:
            slope = mode.friction.slope("v")
            steepest = min(slope.at(v=mode.side * speed) for speed in SPEEDS)
            if steepest + damping <= 0.0:
                raise ModelError(
                    f"friction that falls by up to {-steepest:.3g} N s/m behind damping = {damping:g} N s/m",
                    "a slider without mass jumps where friction falls faster with speed than the damping rises",
                    f"raise damping= above {-steepest:.3g} N s/m",
                )


def _require_continuous(stuck: CurvedMode, exit_: Exit, slip: CurvedMode) -> None:
    level = _level(stuck, math.copysign(1.0, exit_.quantity.get("f", 0.0)))
    if level is None or slip.friction is None or slip.friction.symbols - {"v"}:
        return
    slowest = abs(slip.friction.at(v=0.0))
    if abs(level - slowest) > JUMP * level:
        raise ModelError(
            f"a break-away force of {level:g} N above the {slowest:g} N of slowest sliding, in series",
            "a slider without mass jumps where friction does",
            "take the friction at rest for the static friction",
        )


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
    >>> from stickslip.laws.coulomb import LinearSlope
    >>> contact = InSeries(LinearSlope(1.0, slope=-5.0), stiffness=192000, damping=24)
    >>> [(mode.name, mode.kind) for mode in contact.modes()]
    [('back', 'slip'), ('stuck', 'microstick'), ('forward', 'slip')]
    """

    label = "Slider in series with a spring"
    formula = "a slider without mass under the law, tied to the mass by f = stiffness (x - y) + damping (x' - y')"

    law: Law = parameter("", "law at the slider", note="any but one with a time lag")
    stiffness: float = parameter("N/m", "contact stiffness", positive=True, note="K_y")
    damping: float = parameter(
        "N s/m",
        "contact damping",
        default=0.0,
        note="c; where the law's friction falls with speed, it must exceed that slope, or a slider without mass jumps",
    )

    def __post_init__(self) -> None:
        if isinstance(self.law, TimeDelay):
            raise ModelError(
                "TimeDelay in series",
                "a lag recalls the speed of a mass, and no state tells that of a slider without one",
                "give the slider a mass: an Oscillator of it under the lag, its spring to a HarmonicBase; or use "
                "SmoothStateVariable for a friction that lags",
            )
        if isinstance(self.law, CurvedLaw):
            object.__setattr__(self, "rates", self._rates)  # with it, it is a curved law itself
            self._rates()
        else:
            self.modes()

    @property
    def loads(self) -> tuple[str, ...]:
        """A contact may press it where its law is curved; stiffness and damping are then those per unit of load."""
        return getattr(self.law, "loads", ()) if isinstance(self.law, CurvedLaw) else ()

    @property
    def slider(self) -> str:
        """Name of the slider's displacement in the memory: "slider", or "slider2" ... behind another one."""
        behind = sum(name.startswith("slider") for name in self.law.memory)
        return f"slider{behind + 1}" if behind else "slider"

    @property
    def memory(self) -> Mapping[str, Row]:
        """The slider's displacement [m], under the mass at the start, and the law's own memory."""
        if isinstance(self.law, CurvedLaw):
            return memory_of(self.law, self.slider, self.damping)
        return {self.slider: {"x": 1.0}, **self.law.memory}

    @property
    def memory_units(self) -> Mapping[str, str]:
        """Of the slider's speed and force, and of the law's own memory."""
        return {SPEED: "m/s", FORCE: "N", **getattr(self.law, "memory_units", {})}

    @property
    def places(self) -> tuple[str, ...]:
        """The slider's, and the law's own."""
        return (self.slider, *self.law.places)

    @property
    def entry(self) -> tuple[str, str, str]:
        """Motion starts with the slider at rest, whatever the velocity: the contact is relaxed."""
        return (self.law.entry[1],) * 3

    def _rates(self) -> tuple[CurvedMode, ...]:
        """The modes of a curved law, with the slider in the place of the mass."""
        return modes_of(self.law, self.slider, self.stiffness, self.damping)

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
            friction = _sum((1.0, own), (along, {self.slider: 1.0}), (slope, speed))
            return replace(moved, friction=friction, rates={**moved.rates, self.slider: speed})
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


@parametric
class ElastoSlip:
    """Parallel elements, each a spring in series with a Coulomb slider; one element is a Jenkins element.

    Elements yield in the order of their yield displacement f/k. From the virgin start (all springs relaxed) this
    order holds on every branch for ever, so n elements need 2 n + 1 modes.

    It is the Maxwell slip model, and the generalized one (Al-Bender, Lampaert and Swevers, IEEE Trans. Automatic
    Control 50, 2005) wherever that one's curve of friction over speed is level: an element that slips at its share of
    the friction then stays there, whatever attracts it.

    Examples
    --------
    >>> chain = ElastoSlip.iwan(1e6, width=30e-6, elements=10)
    >>> len(chain.modes()), round(sum(chain.forces), 3)
    (21, 15.0)
    """

    label = "Elasto-slip elements"
    formula = "f = sum of elements, each a spring of its stiffness that slips at its force"
    loads = ("preload",)  # of a contact: its levels are proportional to a steady load

    stiffnesses: Sequence[float] = parameter(
        "N/m", "stiffnesses", size="row", positive=True, note="the spring of every element"
    )
    forces: Sequence[float] = parameter("N", "yield forces", size="row", positive=True, note="one of every element")

    def __post_init__(self) -> None:
        if len(self.stiffnesses) != len(self.forces) or len(self.forces) == 0:
            raise ModelError(
                f"{len(self.stiffnesses)} stiffnesses, {len(self.forces)} forces",
                "one of each an element",
                "complete it",
            )
        rows = zip(map(float, self.stiffnesses), map(float, self.forces), strict=True)
        pairs = sorted(rows, key=lambda p: p[1] / p[0])
        object.__setattr__(self, "stiffnesses", tuple(k for k, _ in pairs))
        object.__setattr__(self, "forces", tuple(f for _, f in pairs))

    @classmethod
    def iwan(cls, stiffness: float, *, width: float, elements: int) -> ElastoSlip:
        """Iwan's model with yield displacements spread evenly over a width, in equal classes.

        Parameters
        ----------
        stiffness : float
            Stiffness of the whole [N/m].
        width : float
            Largest yield displacement [m].
        elements : int
            Number of classes; each yields at its middle.

        Returns
        -------
        ElastoSlip
        """
        finite("width", width, unit="m", positive=True)
        if elements < 1:
            raise ModelError(f"elements = {elements}", "at least one", "raise elements=")
        share = stiffness / elements
        return cls([share] * elements, [share * width * (j + 0.5) / elements for j in range(elements)])

    @classmethod
    def mindlin(cls, kinetic: float, *, stiffness: float, elements: int = 12) -> ElastoSlip:
        r"""Two spheres under a steady load, whose contact slips from its rim inwards, in equal classes of displacement.

        .. math:: f = f_k\left(1 - (1 - x/x_s)^{3/2}\right), \quad x_s = \frac{3 f_k}{2 K}

        from rest; every later branch is that curve twice as large, as Masing's rule has it (Mindlin and Deresiewicz,
        Journal of Applied Mechanics 20, 1953). The elements meet it where each of them yields.

        Parameters
        ----------
        kinetic : float
            Sliding friction :math:`f_k` [N].
        stiffness : float
            Tangential stiffness K at rest [N/m].
        elements : int
            Number of classes.

        Returns
        -------
        ElastoSlip

        Examples
        --------
        >>> contact = ElastoSlip.mindlin(1.1, stiffness=192e3, elements=12)
        >>> round(sum(contact.forces), 12)
        1.1
        """
        for name, value, unit in (("kinetic", kinetic, "N"), ("stiffness", stiffness, "N/m")):
            finite(name, value, unit=unit, positive=True)
        if elements < 2:
            raise ModelError(f"elements = {elements}", "a curve takes two at least", "raise elements=")
        places = 1.5 * kinetic / stiffness * np.linspace(0, 1, elements + 1)
        force = kinetic * (1 - (1 - np.linspace(0, 1, elements + 1)) ** 1.5)
        chords = np.append(np.diff(force) / np.diff(places), 0.0)
        springs = chords[:-1] - chords[1:]
        return cls(springs.tolist(), (springs * places[1:]).tolist())

    @property
    def memory(self) -> Mapping[str, Row]:
        """Where each slider holds [m]; under the mass at the start."""
        return {f"anchor{j}": {"x": 1.0} for j in range(len(self.forces))}

    @property
    def places(self) -> tuple[str, ...]:
        """All anchors."""
        return tuple(self.memory)

    @property
    def entry(self) -> tuple[str, str, str]:
        """All sliders hold at the start."""
        return "held", "held", "held"

    def modes(self) -> tuple[Mode, ...]:
        """All hold; or the first j slide, to either side."""
        stuck = Mode("held", "microstick", 0, self._force(0, 0), (self._yield(1, 0), self._yield(-1, 0)))
        sliding = [self._slide(side, j) for side in (-1, 1) for j in range(1, len(self.forces) + 1)]
        return stuck, *sliding

    def _slide(self, side: int, count: int) -> Mode:
        anchors = {f"anchor{j}": {"x": 1.0, "1": -side * self.forces[j] / self.stiffnesses[j]} for j in range(count)}
        back = Exit({"v": float(-side)}, "held", anchors, crossing=True)
        onward = (self._yield(side, count),) if count < len(self.forces) else ()
        return Mode(_name(side, count), "slip", side, self._force(side, count), (back, *onward))

    def _force(self, side: int, count: int) -> Row:
        stiff = {f"anchor{j}": -self.stiffnesses[j] for j in range(count, len(self.forces))}
        return {"x": -sum(stiff.values()), "1": side * sum(self.forces[:count]), **stiff}

    def _yield(self, side: int, j: int) -> Exit:
        k = side * self.stiffnesses[j]
        return Exit({"x": k, f"anchor{j}": -k, "1": -self.forces[j]}, _name(side, j + 1))


def _name(side: int, count: int) -> str:
    return f"{'forward' if side > 0 else 'back'} {count}"
