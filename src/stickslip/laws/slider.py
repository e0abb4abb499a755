"""A slider without mass under a curved law: what its speed is between the contact's spring and the law's friction.

The balance g = K (x - y) + c (x' - w) - F(w, y, memory) = 0 tells the slider's speed w = y'. Differentiated along the
motion until w' stands in it (once where friction or the damper follows w, else twice), it is a rate, w' = -D g / g_w,
and w one more entry of the state, which the Taylor solver follows like any other (index reduction; Hairer and Wanner,
Solving Ordinary Differential Equations II, section VII.2). Friction that creeps is asked the other way round: its law
tells w by the force.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Row
from stickslip.laws.curved import Creeping, CurvedMode, Expression, lifted, symbol
from stickslip.laws.filippov import differs

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
    exits = tuple(_moved(exit_, known[exit_.to], slider, stiffness, damping) for exit_ in mode.exits)
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


def _moved(exit_: Exit, to: CurvedMode, slider: str, stiffness: float, damping: float) -> Exit:
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
