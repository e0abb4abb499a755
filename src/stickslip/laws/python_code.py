"""A friction law as Python that runs as it stands: a function of the speed, or a class that keeps what it remembers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Law, Row
from stickslip.laws.c_code import Modes, levels_of, modes_of
from stickslip.laws.curved import FUNCTIONS, CurvedLaw, Expression
from stickslip.laws.written import remark, written

OVER_SPEED = ["back", "stuck", "forward"]  # modes of a law that the speed alone tells
OTHERS = ("hold", "hold_rate", "delayed_speed", "face_acceleration")  # that a law may ask for beside x and v

NOTES = {
    "hold": "hold [N]: the force that would keep the mass at rest against the counter-face, as the rest of the model "
    "has it",
    "hold_rate": "hold_rate [N/s]: how fast that changes",
    "delayed_speed": "delayed_speed [m/s]: the speed a lag ago",
    "face_acceleration": "face_acceleration [m/s^2]: of the counter-face",
}
CLASS = """\
class Friction:
    \"\"\"A contact: contact = Friction(x, v); then its friction is contact.step(x, v, dt, OTHERS) every dt [s].

    Let dt be short against the times in which the contact gives way.
    \"\"\"

    def __init__(self, x=0.0, v=0.0):
        self.mode = {start}
        self.armed = set()
{memory}
    def step(self, x, v, dt, OTHERS):
        \"\"\"Friction at x and v; what the contact remembers then goes on by dt.\"\"\"
        for _ in range({most}):
            if not self.leave(x, v, OTHERS):
                break
        force = self.force(x, v, OTHERS)
{go_on}        return force
"""
GO_ON = """\
        for name, rate in self.rates(x, v, OTHERS).items():
            setattr(self, name, getattr(self, name) + dt * rate)
"""


def python_code(law: Law | CurvedLaw, formula: str, breakaway: float | None) -> str:
    """The law's friction: of the speed, where that alone tells it, or of a contact that is led step by step."""
    modes = modes_of(law)
    alone = breakaway is not None and [mode.name for mode in modes] == OVER_SPEED
    body = _function(modes, float(breakaway or 0.0)) if alone else _class(law, modes)
    used = [name for name in OTHERS if re.search(rf"\b{name}\b", body)]
    functions = [name for name in FUNCTIONS if re.search(rf"\b{name}\(", body)]
    head = [
        f"# {remark(formula)}",
        "# friction [N], positive against positive velocity; x [m], v [m/s] of the mass against the counter-face",
        *(f"# {NOTES[name]}" for name in used),
    ]  # fmt: skip
    imports = [f"from math import {', '.join(functions)}", "", ""] if functions else ["", ""]
    body = body.replace(", OTHERS", "".join(f", {name}" for name in used))
    return "\n".join([*head, *imports, body])


def _function(modes: Modes, breakaway: float) -> str:
    back, _, forward = (written(mode.friction or {}) for mode in modes)
    return "\n".join([
        "def friction(v, hold=0.0):", "    if v == 0:",
        f"        return min(max(hold, -{breakaway!r}), {breakaway!r})",
        f"    return {forward} if v > 0 else {back}",
    ])  # fmt: skip


def _class(law: Law | CurvedLaw, modes: Modes) -> str:
    if strange := [name for name in law.memory if not name.isidentifier()]:
        raise ModelError(f"memory called '{strange[0]}'", "Python writes it as self.NAME", "name it in letters")
    names = {name: f"self.{name}" for name in law.memory}
    back, still, forward = law.entry
    start = repr(still) if back == still == forward else f"{back!r} if v < 0 else {forward!r} if v > 0 else {still!r}"
    rates = _rates(modes, names) if any(mode.rates for mode in modes) else []
    memory = "".join(f"        self.{name} = {written(form)}\n" for name, form in law.memory.items())
    head = CLASS.format(start=start, memory=memory, most=len(modes), go_on=GO_ON if rates else "")
    return "\n".join([head, *_force(modes, names), *rates, *_leave(modes, names)]).rstrip()


def _force(modes: Modes, names: Mapping[str, str]) -> list[str]:
    lines = ["    def force(self, x, v, OTHERS):"]
    for mode in modes:
        force = "hold" if mode.friction is None else written(mode.friction, names=names)
        lines += [f"        if self.mode == {mode.name!r}:", f"            return {force}"]
    return [*lines, '        raise ValueError(f"no mode is called {self.mode}")', ""]


def _rates(modes: Modes, names: Mapping[str, str]) -> list[str]:
    lines, named = ["    def rates(self, x, v, OTHERS):"], {**names, "f": "hold", "df": "hold_rate"}
    for mode in modes:
        if mode.rates:
            told = ", ".join(f"{name!r}: {written(form, names=named)}" for name, form in mode.rates.items())
            lines += [f"        if self.mode == {mode.name!r}:", f"            return {{{told}}}"]
    return [*lines, "        return {}", ""]


def _leave(modes: Modes, names: Mapping[str, str]) -> list[str]:
    named = {**names, "f": "force", "df": "hold_rate"}
    lines = [
        "    def leave(self, x, v, OTHERS):",
        '        """Whether the mode ends here; then the next one is set, with what it remembers."""',
    ]
    body: list[str] = []
    for mode in modes:
        if mode.exits:
            body.append(f"        if self.mode == {mode.name!r}:")
            own = {**named, **levels_of(mode, lambda form: written(form, names=named))}
            for number, exit_ in enumerate(mode.exits):
                body += _exit(number, exit_, own)
    if any(re.search(r"\bforce\b", line) for line in body):
        lines.append("        force = self.force(x, v, OTHERS)")
    return [*lines, *body, "        return False", ""]


def _exit(number: int, exit_: Exit, names: Mapping[str, str]) -> Sequence[str]:
    due = _due(exit_.quantity, names)
    lines = []
    if exit_.crossing:
        lines += [f"            if not {due}:", f"                self.armed.add({number})"]
        due = f"{number} in self.armed and {due}"
    resets = [f"{names[name]}" for name in exit_.reset], [written(form, names=names) for form in exit_.reset.values()]
    lines.append(f"            if {due}:")
    if exit_.reset:
        lines.append(f"                {', '.join(resets[0])} = {', '.join(resets[1])}")
    return [*lines, f"                self.mode, self.armed = {exit_.to!r}, set()", "                return True"]


def _due(quantity: Row | Expression, names: Mapping[str, str]) -> str:
    """Above zero by more than rounding of its terms."""
    text = written(quantity, names=names)
    if isinstance(quantity, Expression):
        return f"{text} > 0"
    terms = [written({name: value}, names=names) for name, value in quantity.items() if value]
    size = " + ".join(f"abs({term})" for term in terms)
    return f"{text} > 1e-14 * ({size})" if len(terms) > 1 else f"{text} > 0"
