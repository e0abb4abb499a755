"""What a friction law is: a table of linear modes, each with the exits that end it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from stickslip.errors import ModelError

Row = Mapping[str, float]
"""A linear form: coefficients over "x", "v" (displacement and velocity of the mass relative to the counter-face),
"f" and "df" (the friction force of the mode and its rate), "face_acceleration" (of the counter-face), "1" (the
constant) and the names of the law's memory."""


@dataclass(frozen=True)
class Exit:
    """One way out of a mode: it ends at the instant when `quantity` rises above zero.

    Attributes
    ----------
    quantity : mapping of str to float
        The linear form that is negative while the mode lasts.
    to : str
        Name of the mode that follows.
    reset : mapping of str to mapping
        Memory that takes a new value on the way, as a linear form of the state before.
    crossing : bool
        Only a crossing counts: a quantity that is positive on arrival does not end the mode.
    """

    quantity: Row
    to: str
    reset: Mapping[str, Row] = field(default_factory=dict)
    crossing: bool = False


@dataclass(frozen=True)
class Mode:
    """A regime of the contact in which friction is a linear form of the state.

    Attributes
    ----------
    name : str
        "forward", "back", "stuck" ...
    kind : str
        "slip", "stick" or "microstick": what an event that leads here is called.
    side : int
        +1 or -1, the direction of slip; 0 where there is none.
    friction : mapping of str to float, or None
        Friction force [N], positive against positive velocity; None: whatever holds the mass to the counter-face.
    exits : tuple of Exit
        In order of precedence, should two be due at the same instant.
    rates : mapping of str to mapping
        Time derivative of the memory that moves in this mode.
    speed : float
        Of a mode that holds the mass: the sliding speed [m/s] at which it does; at rest on the counter-face: 0.
    """

    name: str
    kind: str
    side: int
    friction: Row | None
    exits: tuple[Exit, ...]
    rates: Mapping[str, Row] = field(default_factory=dict)
    speed: float = 0.0

    def changes(self, before: Mode, leaving: int) -> Iterator[tuple[int, Mode, Mode]]:
        """Contact, its mode before and its mode now: what an event by exit `leaving` into this mode has changed."""
        yield 0, before, self


class Remembering(Protocol):
    """What any law says of what it remembers, and of where motion starts."""

    @property
    def memory(self) -> Mapping[str, Row]:
        """The law's own state, with its value at the start as a linear form of "x", "v" and "1"."""

    @property
    def places(self) -> tuple[str, ...]:
        """Memory that is a place on the counter-face [m] and moves with it; curved laws have none."""

    @property
    def entry(self) -> tuple[str, str, str]:
        """Names of the modes in which motion starts: with v < 0, v = 0 and v > 0."""


class Law(Remembering, Protocol):
    """What the solver asks of a friction law.

    What others ask, its class says where it has an answer: `label` and `formula` (how it is called and written),
    `hypotheses` (how records are asked for it), `loads` (by which parameters of a Contact it may be pressed: all its
    forces are proportional to them), `chosen` (numbers that are not fitted), `between` (where those of them that are
    fitted without values lie), `memory_units`.
    """

    def modes(self) -> tuple[Mode, ...]:
        """The table."""


def loads_of(law: object) -> tuple[str, ...]:
    """By which of its parameters a contact may press a law: what of them all its forces are proportional to."""
    loads = getattr(law, "loads", ())
    return loads if isinstance(loads, tuple) else ()  # of a class whose laws differ in it: it is not told


def of_speed(quantity: Row) -> Row:
    """An exit's quantity in which a bound on the speed is no share of the load."""
    if "v" not in quantity:
        return quantity
    return {"always" if name == "1" else name: share for name, share in quantity.items()}


@dataclass(frozen=True)
class Rigid:
    """What a rigid contact has in common with others: no memory, no places, slip to either side or stick."""

    @property
    def memory(self) -> Mapping[str, Row]:
        """None."""
        return {}

    @property
    def places(self) -> tuple[str, ...]:
        """None."""
        return ()

    @property
    def entry(self) -> tuple[str, str, str]:
        """Modes in which motion starts, by the sign of the velocity."""
        return "back", "stuck", "forward"


def static_level(static: float | None, kinetic: float, *, name: str = "static", kinetic_name: str = "kinetic") -> float:
    """The break-away force [N]: `static` where given, else the kinetic level; a refusal calls both by these names."""
    level = kinetic if static is None else float(static)
    if level < kinetic:
        raise ModelError(
            f"{name} = {level:.6g} N below {kinetic_name} = {kinetic:.6g} N",
            "static friction is at least the kinetic friction",
            f"raise {name}=, or leave it out to make both equal",
        ).of(name)
    return level
