"""What a curved law is: modes like any other law's, with friction and rates as expressions instead of linear forms; and
Filippov's rule, by which two modes of any law become one between them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Protocol, TypeVar, runtime_checkable

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode, Remembering, Rigid, Row

FUNCTIONS = ("exp", "log", "tanh", "asinh", "sqrt")


@dataclass(frozen=True)
class Expression:
    """A formula over the state of the contact: what the numeric solver expands into Taylor series.

    Built with ``+ - * / **`` from :func:`symbol`, numbers, and the functions of this module.

    Attributes
    ----------
    kind : str
        "number", "symbol", "sum", "product", "quotient", "power", or a function's name.
    parts : tuple of Expression
        What it is made of.
    value : float
        The number, or the exponent of a power.
    name : str
        The symbol.

    Examples
    --------
    >>> speed = symbol("v")
    >>> force = 1.0 + 0.5 * exp(-((speed / 0.1) ** 2))
    >>> round(force.at(v=0.1), 6)
    1.18394
    """

    kind: str
    parts: tuple[Expression, ...] = ()
    value: float = 0.0
    name: str = ""

    def __add__(self, other: Expression | float) -> Expression:
        return Expression("sum", (self, lifted(other)))

    def __radd__(self, other: float) -> Expression:
        return lifted(other) + self

    def __neg__(self) -> Expression:
        return -1.0 * self

    def __sub__(self, other: Expression | float) -> Expression:
        return self + -1.0 * lifted(other)

    def __rsub__(self, other: float) -> Expression:
        return lifted(other) - self

    def __mul__(self, other: Expression | float) -> Expression:
        return Expression("product", (self, lifted(other)))

    def __rmul__(self, other: float) -> Expression:
        return lifted(other) * self

    def __truediv__(self, other: Expression | float) -> Expression:
        return Expression("quotient", (self, lifted(other)))

    def __rtruediv__(self, other: float) -> Expression:
        return lifted(other) / self

    def __pow__(self, exponent: float) -> Expression:
        return Expression("power", (self,), float(exponent))

    def at(self, **values: float) -> float:
        """The value where the symbols have these values.

        Parameters
        ----------
        **values : float
            By symbol.

        Returns
        -------
        float

        Raises
        ------
        ModelError
            A symbol has no value, or the formula has none there (a root or a logarithm of less than nothing).
        """
        try:
            return self._at(values)
        except (ArithmeticError, TypeError, ValueError) as error:
            place = ", ".join(f"{name} = {value:g}" for name, value in values.items())
            raise ModelError(
                f"a formula has no value at {place or 'its numbers'} ({error})",
                "friction is a real, finite number wherever the motion leads",
                "correct the formula",
            ) from error

    def _at(self, values: Mapping[str, float]) -> float:
        if self.kind == "number":
            return self.value
        if self.kind == "symbol":
            if self.name not in values:
                raise ModelError(f"no value for '{self.name}'", "every symbol has a value", f"give {self.name}=")
            return float(values[self.name])
        parts = [part._at(values) for part in self.parts]
        if self.kind == "sum":
            return math.fsum(parts)
        if self.kind == "product":
            return math.prod(parts)
        if self.kind == "quotient":
            return parts[0] / parts[1]
        if self.kind == "power":
            return float(parts[0] ** self.value)
        return float(getattr(math, self.kind)(*parts))

    @property
    def symbols(self) -> frozenset[str]:
        """Names of the symbols that it is made of."""
        inner = [self]
        for part in inner:
            inner += part.parts
        return frozenset(part.name for part in inner if part.kind == "symbol")

    def put(self, values: Mapping[str, Expression]) -> Expression:
        """The same formula with other expressions in the place of symbols.

        Parameters
        ----------
        values : mapping of str to Expression
            By symbol; symbols that are not among them stay.

        Returns
        -------
        Expression
        """
        if self.kind == "symbol":
            return values.get(self.name, self)
        return replace(self, parts=tuple(part.put(values) for part in self.parts))

    def slope(self, name: str) -> Expression:
        """The partial derivative by a symbol.

        Parameters
        ----------
        name : str
            The symbol.

        Returns
        -------
        Expression
        """
        if self.kind in ("number", "symbol"):
            return lifted(1.0 if self.kind == "symbol" and self.name == name else 0.0)
        a, d = self.parts[0], self.parts[0].slope(name)
        if self.kind in ("sum", "product", "quotient"):
            b, e = self.parts[1], self.parts[1].slope(name)
            return {"sum": d + e, "product": d * b + a * e, "quotient": (d - self * e) / b}[self.kind]
        if self.kind == "power":
            return self.value * a ** (self.value - 1) * d if self.value else lifted(0.0)
        inner = {"exp": self, "log": 1 / a, "tanh": 1 - self**2, "asinh": 1 / sqrt(1 + a**2), "sqrt": 0.5 / self}
        return inner[self.kind] * d


def lifted(value: Expression | float) -> Expression:
    """A number as an expression; an expression as it is."""
    return value if isinstance(value, Expression) else Expression("number", value=float(value))


def symbol(name: str) -> Expression:
    """A quantity of the state: "x", "v" (relative to the counter-face), or the law's memory by name."""
    return Expression("symbol", name=name)


def _function(kind: str, of: Expression | float) -> Expression:
    return Expression(kind, (lifted(of),))


def exp(of: Expression | float) -> Expression:
    """The exponential."""
    return _function("exp", of)


def log(of: Expression | float) -> Expression:
    """The natural logarithm."""
    return _function("log", of)


def tanh(of: Expression | float) -> Expression:
    """The hyperbolic tangent."""
    return _function("tanh", of)


def asinh(of: Expression | float) -> Expression:
    """The inverse hyperbolic sine."""
    return _function("asinh", of)


def sqrt(of: Expression | float) -> Expression:
    """The square root."""
    return _function("sqrt", of)


@dataclass(frozen=True)
class CurvedMode:
    """A regime of the contact in which friction is a smooth function of the state.

    Attributes
    ----------
    name : str
        "forward", "back", "stuck" ...
    kind : str
        "slip", "stick" or "microstick": what an event that leads here is called.
    side : int
        +1 or -1, the direction of slip; 0 where there is none.
    friction : Expression or None
        Friction force [N], positive against positive velocity; None: whatever holds the mass to the counter-face.
    exits : tuple of Exit
        As of a linear mode.
    rates : mapping of str to Expression
        Time derivative of the memory.
    creep : Expression or None
        Of a mode that holds the mass: how fast it creeps on the counter-face [m/s], by "f" and the memory. It is so
        slow that the mass's inertia is nothing beside friction; None: not at all.
    levels : mapping of str to Expression
        What exits may speak of beside the state.
    speed : float
        Of a mode that holds the mass: the sliding speed [m/s] at which it does; at rest on the counter-face: 0.
    """

    name: str
    kind: str
    side: int
    friction: Expression | None
    exits: tuple[Exit, ...] = ()
    rates: Mapping[str, Expression] = field(default_factory=dict)
    creep: Expression | None = None
    levels: Mapping[str, Expression] = field(default_factory=dict)
    speed: float = 0.0

    def changes(self, before: CurvedMode, leaving: int) -> Iterator[tuple[int, CurvedMode, CurvedMode]]:
        """Contact, its mode before and its mode now, as of a linear mode."""
        yield 0, before, self


@runtime_checkable
class CurvedLaw(Remembering, Protocol):
    """What the numeric solver asks of a friction law."""

    def rates(self) -> tuple[CurvedMode, ...]:
        """The modes."""


@runtime_checkable
class Creeping(Protocol):
    """A curved law whose friction takes the whole of its range within a speed too small to be told from none.

    At such speeds the force balance tells the friction, and friction the speed: the solver goes through a mode that
    holds the mass, and leaves it where the mass creeps as fast as it told the law.
    """

    def rates(self) -> tuple[CurvedMode, ...]:
        """The modes of sliding."""

    def holding(self, speed: float, side: int = 0) -> CurvedMode:
        """The mode "held" of a contact that creeps, up to a speed [m/s]; to one side only, where it is told."""


@dataclass(frozen=True)
class Sliding(Rigid):
    """A curved law's usual ground: no places, slip to either side."""

    @property
    def entry(self) -> tuple[str, str, str]:
        """Modes in which motion starts, by the sign of the velocity."""
        return "back", "forward", "forward"


def either_side() -> tuple[tuple[str, int, Exit], ...]:
    """Name, side and exit of the two slips of a law that never holds the mass: they meet where the velocity turns."""
    return (("back", -1, Exit({"v": 1.0}, "forward")), ("forward", 1, Exit({"v": -1.0}, "back")))


M = TypeVar("M", Mode, CurvedMode)
TRIED = (0.37, -0.73, 1.91)  # values of the memory at which friction on both sides is compared
ALIKE = 1e-12  # relative: friction that differs by no more is continuous


def with_sliding_modes(modes: Sequence[M]) -> tuple[M, ...]:
    """The modes of a law, with one between each two that go over into each other at a speed where friction jumps.

    Two modes that would take turns without end become one between them. Where the acceleration on either side of a
    speed points to that speed, the motion stays on it, under a mixture of both modes (Filippov, Differential Equations
    with Discontinuous Righthand Sides, 1988, chapter 2): with friction f_- just below the speed and f_+ just above,

        f = f_- + s (f_+ - f_-),    rate = rate_- + s (rate_+ - rate_-),    0 <= s <= 1.

    The force that keeps the speed tells s; the mode ends where s leaves that range. At no speed this is sticking.
    """
    known: dict[str, M] = {mode.name: mode for mode in modes}
    added: list[M] = []
    for low in modes:
        for exit_ in low.exits:
            up, speed = known[exit_.to], _speed(exit_.quantity)
            if speed is None or exit_.quantity["v"] < 0 or not _returns(up, low.name, speed):
                continue
            between = _between(known[low.name], known[up.name], speed)
            if between is not None and not exit_.reset:
                added.append(between)
                known[low.name] = _through(known[low.name], up.name, speed, between.name)
                known[up.name] = _through(known[up.name], low.name, speed, between.name)
    every = [known[mode.name] for mode in modes]
    return tuple(every + added)


def curved_modes(law: Any) -> tuple[CurvedMode, ...]:
    """The modes of a curved law with those between them; equal laws have the same."""
    return _known(law) if compared_by_value(law) else with_sliding_modes(law.rates())


@lru_cache(maxsize=32)
def _known(law: Any) -> tuple[CurvedMode, ...]:
    return with_sliding_modes(law.rates())


def compared_by_value(part: object) -> bool:
    """Whether an equal law, or drive, is the same one."""
    return type(part).__hash__ not in (None, object.__hash__)


def _speed(quantity: Row) -> float | None:
    """The speed at which an exit ends a mode; None where it ends it by anything else."""
    if quantity.get("v") and set(quantity) <= {"v", "1"}:
        return -quantity.get("1", 0.0) / quantity["v"] + 0.0
    return None


def _returns(mode: Mode | CurvedMode, to: str, speed: float) -> bool:
    """Whether a mode ends where the velocity falls to a speed, and goes over into another without a reset."""
    return any(e.to == to and _speed(e.quantity) == speed and e.quantity["v"] < 0 and not e.reset for e in mode.exits)


def _through(mode: M, to: str, speed: float, between: str) -> M:
    """A mode that goes over into another by the mode between them."""
    there = (replace(e, to=between) if e.to == to and _speed(e.quantity) == speed else e for e in mode.exits)
    return replace(mode, exits=tuple(there))


def _between(low: Any, up: Any, speed: float) -> Any:
    """The mode between two; None where friction does not jump, or where no mode of their kind can tell the mixture."""
    if low.friction is None or up.friction is None:
        return None
    made: Any = _linear(low, up, speed) if isinstance(low, Mode) else _curved(low, up, speed)
    if made is None:
        return None
    name, side = f"between {low.name} and {up.name}", int(math.copysign(1, speed)) if speed else 0
    exits = [e for mode in (low, up) for e in mode.exits if e.to not in (low.name, up.name)]
    others = {(e.to, tuple(e.quantity.items())): e for e in exits}
    every = (*made.exits, *others.values())
    return replace(made, name=name, kind="slip" if speed else "stick", side=side, speed=speed, exits=every)


def _linear(low: Mode, up: Mode, speed: float) -> Mode | None:
    below, above = _at_speed(low.friction or {}, speed), _at_speed(up.friction or {}, speed)
    jump = _less(above, below)
    if not jump:
        return None
    rates = dict[str, Row]()
    for name in {**low.rates, **up.rates}:
        slow = _at_speed(low.rates.get(name, {}), speed)
        ratio = _ratio(_less(_at_speed(up.rates.get(name, {}), speed), slow), jump)
        if ratio is None or {"f", "df"} & {*low.rates.get(name, {}), *up.rates.get(name, {})}:
            return None  # the mixture is no linear form
        rates[name] = _less({**slow, "f": ratio}, {key: ratio * value for key, value in below.items()})
    exits = (Exit(_less({"f": 1.0}, above), up.name), Exit(_less(below, {"f": 1.0}), low.name))
    return Mode("", "", 0, None, exits, rates)


def _at_speed(form: Row, speed: float) -> dict[str, float]:
    """A linear form at a given velocity."""
    rest = {name: value for name, value in form.items() if name not in ("v", "1")}
    return rest | {"1": form.get("1", 0.0) + speed * form.get("v", 0.0)}


def _less(form: Row, other: Row) -> dict[str, float]:
    """The difference of two linear forms, without the terms that vanish."""
    apart = {name: form.get(name, 0.0) - other.get(name, 0.0) for name in {**form, **other}}
    return {name: value for name, value in apart.items() if value}


def _ratio(form: Row, of: Row) -> float | None:
    """The number by which a linear form is another one; None where there is none."""
    name = max(of, key=lambda name: abs(of[name]))
    ratio = form.get(name, 0.0) / of[name]
    apart = _less(form, {key: ratio * value for key, value in of.items()})
    return ratio if all(abs(value) <= ALIKE * abs(form.get(key, 0.0)) for key, value in apart.items()) else None


def _curved(low: CurvedMode, up: CurvedMode, speed: float) -> CurvedMode | None:
    assert low.friction is not None
    assert up.friction is not None
    if not differs(low.friction, up.friction, v=speed):
        return None
    at = {"v": lifted(speed)}
    below, above = low.friction.put(at), up.friction.put(at)
    share = (symbol("f") - below) / (above - below)
    rates = dict[str, Expression]()
    for name in {**low.rates, **up.rates}:
        slow, fast = (mode.rates.get(name, lifted(0.0)).put(at) for mode in (low, up))
        rates[name] = slow if slow == fast else slow + share * (fast - slow)
    exits = (Exit({"f": 1.0, "above": -1.0}, up.name), Exit({"f": -1.0, "below": 1.0}, low.name))
    return CurvedMode("", "", 0, None, exits, rates, levels={"above": above, "below": below})


def differs(below: Expression, above: Expression, **known: float) -> bool:
    """Whether two expressions differ, at values of their symbols at which both have one; some of these are known."""
    names = sorted((below.symbols | above.symbols) - known.keys())
    for values in _values(names):
        try:
            a, b = below.at(**values, **known), above.at(**values, **known)
        except ModelError:
            continue
        if abs(a - b) > ALIKE * max(abs(a), abs(b)):
            return True
    return False


def _values(names: Sequence[str]) -> Iterator[Mapping[str, float]]:
    for j, one in enumerate(TRIED):
        yield {name: one * (1 + 0.1 * k) for k, name in enumerate(names, start=j)}
