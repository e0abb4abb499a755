"""Filippov's rule: two modes that would take turns without end become one mode between them.

Where the acceleration on either side of a speed points to that speed, the motion stays on it, under a mixture of both
modes (Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, chapter 2): with friction f_- just
below the speed and f_+ just above,

    f = f_- + s (f_+ - f_-),    rate = rate_- + s (rate_+ - rate_-),    0 <= s <= 1.

The force that keeps the speed tells s; the mode ends where s leaves that range. At no speed this is sticking.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, TypeVar

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode, Row
from stickslip.laws.curved import CurvedMode, Expression, lifted, symbol

M = TypeVar("M", Mode, CurvedMode)
TRIED = (0.37, -0.73, 1.91)  # values of the memory at which friction on both sides is compared
ALIKE = 1e-12  # relative: friction that differs by no more is continuous


def with_sliding_modes(modes: Sequence[M]) -> tuple[M, ...]:
    """The modes of a law, with one between each two that go over into each other at a speed where friction jumps."""
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
    return _known(law) if by_value(law) else with_sliding_modes(law.rates())


@lru_cache(maxsize=32)
def _known(law: Any) -> tuple[CurvedMode, ...]:
    return with_sliding_modes(law.rates())


def by_value(part: object) -> bool:
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
    at = {"v": lifted(speed)}
    below, above = low.friction.put(at), up.friction.put(at)
    if not differs(below, above):
        return None
    share = (symbol("f") - below) / (above - below)
    rates = dict[str, Expression]()
    for name in {**low.rates, **up.rates}:
        slow, fast = (mode.rates.get(name, lifted(0.0)).put(at) for mode in (low, up))
        rates[name] = slow if slow == fast else slow + share * (fast - slow)
    exits = (Exit({"f": 1.0, "above": -1.0}, up.name), Exit({"f": -1.0, "below": 1.0}, low.name))
    return CurvedMode("", "", 0, None, exits, rates, levels={"above": above, "below": below})


def differs(below: Expression, above: Expression) -> bool:
    """Whether two expressions differ, at values of their symbols at which both have one."""
    names = sorted(below.symbols | above.symbols)
    for values in _values(names):
        try:
            a, b = below.at(**values), above.at(**values)
        except ModelError:
            continue
        if abs(a - b) > ALIKE * max(abs(a), abs(b)):
            return True
    return False


def _values(names: Sequence[str]) -> Iterator[Mapping[str, float]]:
    for j, one in enumerate(TRIED):
        yield {name: one * (1 + 0.1 * k) for k, name in enumerate(names, start=j)}
