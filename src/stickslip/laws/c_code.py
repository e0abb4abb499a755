"""A friction law as C: its modes, what ends them, and a test vector.

A friction law as Python that runs as it stands: a function of the speed, or a class that keeps what it remembers.
"""

from __future__ import annotations

import platform
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from string import Template
from xml.sax.saxutils import quoteattr

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Law, Mode, Row
from stickslip.laws.curved import (
    FUNCTIONS,
    Creeping,
    CurvedLaw,
    CurvedMode,
    Expression,
    curved_modes,
    with_sliding_modes,
)
from stickslip.laws.formula import remark, written

Modes = Sequence[Mode | CurvedMode]
INPUTS = ("x", "v", "hold", "hold_rate", "delayed_speed", "face_acceleration")
SPEEDS = (1e-3, 1e-2, 0.1)  # of the test vector [m/s]
SOON = 1e-6  # s, in which memory leaves its start for the test vector
PLACE, HOLD, HOLD_RATE, CARRIED = 1e-5, 0.3, 2.0, 0.7  # of the test vector [m, N, N/s, m/s^2]


OVER_SPEED = ["back", "stuck", "forward"]  # modes of a law that the speed alone tells
OTHERS = ("hold", "hold_rate", "delayed_speed", "face_acceleration")  # that a law may ask for beside x and v

NOTES = {
    "hold": "hold [N]: the force that would keep the mass at rest against the counter-face, as the rest of the model "
    "has it",
    "hold_rate": "hold_rate [N/s]: how fast that changes",
    "delayed_speed": "delayed_speed [m/s]: the speed a lag ago",
    "face_acceleration": "face_acceleration [m/s^2]: of the counter-face",
}
INPUT = 'causality="input" variability="continuous"'
PARAMETER = 'causality="parameter" variability="fixed" initial="exact"'
STATE = 'causality="output" variability="continuous" initial="exact"'
OUTPUT = 'causality="output" variability="continuous" initial="calculated"'
LOCAL = 'causality="local" variability="continuous" initial="calculated"'
VARIABLES = {  # of an FMU, in the order of fmu.c: unit, what it is, what a tool may do with it
    "force": ("N", "pushes the mass", INPUT),
    "z": ("m", "of the spring's end: a base, or a servo's reference", INPUT),
    "z_rate": ("m/s", "how fast z goes on", INPUT),
    "mass": ("kg", "", PARAMETER),
    "stiffness": ("N/m", "spring between x and z", PARAMETER),
    "damping": ("N.s/m", "of the damper on the mass", PARAMETER),
    "face_speed": ("m/s", "of the counter-face: a belt's", PARAMETER),
    "x": ("m", "displacement of the mass", STATE),
    "v": ("m/s", "its velocity", f'{STATE} derivative="8"'),
}
TURNING_UNITS = {
    "N": "N.m", "m": "rad", "m/s": "rad/s", "m/s2": "rad/s2", "kg": "kg.m2", "N/m": "N.m/rad", "N.s/m": "N.m.s/rad",
}  # fmt: skip
BASES = {  # exponents of SI's base units
    "s": "s='1'", "m": "m='1'", "m/s": "m='1' s='-1'", "m/s2": "m='1' s='-2'", "kg": "kg='1'",
    "N": "kg='1' m='1' s='-2'", "N/m": "kg='1' s='-2'", "N.s/m": "kg='1' s='-1'", "rad": "rad='1'",
    "rad/s": "rad='1' s='-1'", "rad/s2": "rad='1' s='-2'", "kg.m2": "kg='1' m='2'", "N.m": "kg='1' m='2' s='-2'",
    "N.m/rad": "kg='1' m='2' s='-2' rad='-1'", "N.m.s/rad": "kg='1' m='2' s='-1' rad='-1'",
}  # fmt: skip
UNITS = [f"    <Unit name='{name}'><BaseUnit {powers}/></Unit>" for name, powers in BASES.items()]
GO_ON = """\
        # exponential Euler: it holds however fast the memory fades, and is exact where its rate is linear in it
        ended = {}
        for name, rate in self.rates(x, v, OTHERS).items():
            now = getattr(self, name)
            little = 1e-6 * max(abs(now), abs(dt * rate))
            setattr(self, name, now + little)
            fading = dt * (self.rates(x, v, OTHERS)[name] - rate) / little if little else 0.0
            setattr(self, name, now)
            share = (exp(min(fading, 1.0)) - 1) / fading if abs(fading) > 1e-6 else 1.0
            ended[name] = now + dt * rate * share
        for name, now in ended.items():
            setattr(self, name, now)
"""


def c_code(law: Law | CurvedLaw, formula: str) -> str:
    """The law's friction as a function of the motion, mode by mode."""
    return _friction(law, formula, modes_of(law))


def sizes_of(law: Law | CurvedLaw) -> list[float]:
    """How large x, v and what the friction remembers are about, by which solvers set what they may be off by."""
    units: Mapping[str, str] = getattr(law, "memory_units", {})
    return [1e-3, 1e-2, *(1e-6 if name in law.places or units.get(name) == "m" else 1.0 for name in law.memory)]


def fmu_code(law: Law | CurvedLaw, formula: str, begins: Sequence[float], *, on_base: bool) -> tuple[str, int]:
    """C code of a mass that rubs, as FMI 3 calls it, less the token that it answers to; and how many exits a mode has.

    `begins` are its values before anything is set: those of fmu.c, from the time to the speed v.
    """
    if isinstance(law, Creeping):
        raise ModelError(
            f"{type(law).__name__} in an FMU",
            "its friction takes its whole range at speeds too small to be told from none",
            "export C",
        )
    modes: Modes = curved_modes(law) if isinstance(law, CurvedLaw) else with_sliding_modes(law.modes())
    forms = [form for mode in modes for form in (mode.friction or {}, *mode.rates.values())]
    if any("delayed_speed" in (form.symbols if isinstance(form, Expression) else form) for form in forms):
        raise ModelError(
            f"{type(law).__name__} in an FMU",
            "it asks for the speed a lag ago, which its states do not hold",
            "export C, or use SmoothStateVariable for a friction that lags",
        )
    exits = max(len(mode.exits) for mode in modes)
    frame = _template(
        "fmu.c",
        modes=len(modes),
        exits=exits,
        on_base=int(on_base),
        holds=", ".join(str(int(mode.friction is None)) for mode in modes),
        speeds=_numbers(getattr(mode, "speed", 0.0) for mode in modes),
        count=len(begins),
        begins=_numbers(begins),
        sizes=_numbers(sizes_of(law)),
        ends=_ends(modes, _names(law)),
    )
    return f"{_friction(law, formula, modes)}\n{frame}", exits


def _template(file: str, **fields: object) -> str:
    """A file of the package's data, with what stands for its $names."""
    return Template(resources.files("stickslip").joinpath(f"data/{file}").read_text("utf-8")).substitute(fields)


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(repr(float(value)) for value in values)


def model_description(
    name: str, token: str, about: str, *, law: Law | CurvedLaw, begins: Sequence[float], exits: int, turning: bool
) -> str:
    """What a tool has to know of the model: its variables and their units, by the value references of fmu.c."""
    memory, sizes = list(law.memory), [f'nominal="{size!r}"' for size in sizes_of(law)]
    first = len(VARIABLES) + 1 + len(memory)  # of what is computed; the time is the first of all
    unit = TURNING_UNITS if turning else {}
    rows = [variable("time", 0, 'causality="independent" variability="continuous"', "", "s")]
    for number, (key, (size, what, kind)) in enumerate(VARIABLES.items(), start=1):
        begin = f'start="{float(begins[number])!r}"' + (f" {sizes[number - 8]}" if key in ("x", "v") else "")
        rows.append(variable(key, number, f"{kind} {begin}", what, unit.get(size, size)))
    states = [f"memory_{number}" for number in range(1, len(memory) + 1)]
    for number, (key, what) in enumerate(zip(states, memory, strict=True), start=len(VARIABLES) + 1):
        rows.append(variable(key, number, f"{LOCAL} {sizes[number - 8]}", f"{what}, which the friction remembers", ""))
    force, speeds = unit.get("N", "N"), unit.get("m/s2", "m/s2")
    rows.append(variable("friction", first, OUTPUT, "against positive velocity where positive", force))
    rows.append(variable("acceleration", first + 1, f'{OUTPUT} derivative="9"', "of x", speeds))
    for number, key in enumerate(states, start=2):
        rows.append(variable(f"der_{key}", first + number, f'{LOCAL} derivative="{8 + number}"', "", ""))
    mode = first + 2 + len(memory)
    rows.append(
        f'<Int32 name="mode" valueReference="{mode}" causality="output" variability="discrete" '
        'initial="calculated" description="number of the mode of the friction"/>'
    )
    ends = range(mode + 1, mode + 1 + exits)
    for number, reference in enumerate(ends, start=1):
        rows.append(variable(f"exit_{number}", reference, LOCAL, "ends the mode where it rises above zero", ""))
    slopes, kept = [9, *range(first + 1, mode)], range(10, first)
    structure = [
        *(f'<Output valueReference="{number}"/>' for number in (8, 9, first, first + 1, mode)),
        *(f'<ContinuousStateDerivative valueReference="{number}"/>' for number in slopes),
        *(f'<InitialUnknown valueReference="{number}"/>' for number in (*kept, *range(first, mode + 1))),
        *(f'<EventIndicator valueReference="{number}"/>' for number in ends),
    ]
    return _template(
        "modelDescription.xml",
        name=name,
        token=quoteattr(token),
        about=quoteattr(about),
        units="\n".join(UNITS),
        variables="\n".join(f"    {row}" for row in rows),
        structure="\n".join(f"    {row}" for row in structure),
    )


def build_description(name: str) -> str:
    """How the model's C code is compiled."""
    return _template("buildDescription.xml", name=name)


def variable(name: str, reference: int, kind: str, what: str, unit: str) -> str:
    """A number of the model."""
    about = f" description={quoteattr(what)}" if what else ""
    measured = f' unit="{unit}"' if unit else ""
    return f'<Float64 name="{name}" valueReference="{reference}" {kind}{measured}{about}/>'


def compiler() -> str | None:
    """The C compiler of this machine, if there is one."""
    return next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)


def compiled_fmu(name: str, code: str) -> tuple[str, bytes]:
    """The model's code compiled for this machine, and its place in the unit."""
    command = compiler()
    if command is None:
        raise ModelError(
            "no C compiler (cc, gcc, clang) on this machine",
            "an FMU holds a program compiled for the machine that runs it",
            "install one, or give sources_only=True where the importing tool compiles",
        )
    systems = {"Linux": ("linux", ".so"), "Darwin": ("darwin", ".dylib"), "Windows": ("windows", ".dll")}
    kinds = {"amd64": "x86_64", "arm64": "aarch64"}
    system, suffix = systems.get(platform.system(), (platform.system().lower(), ".so"))
    machine = platform.machine().lower()
    with tempfile.TemporaryDirectory() as folder:
        source, binary = Path(folder) / f"{name}.c", Path(folder) / (name + suffix)
        source.write_text(code, encoding="utf-8")
        flags = ["-std=c99", "-O2", "-shared", "-fvisibility=hidden", *(["-fPIC"] if system != "windows" else [])]
        run = subprocess.run([command, *flags, "-o", binary, source, "-lm"], capture_output=True, text=True)
        if run.returncode:
            raise ModelError(
                f"{command} did not compile the model: {run.stderr.strip()[:200]}",
                "an FMU holds a program compiled for the machine that runs it",
                "try another compiler, or give sources_only=True where the importing tool compiles",
            )
        return f"binaries/{kinds.get(machine, machine)}-{system}/{name}{suffix}", binary.read_bytes()


def _names(law: Law | CurvedLaw) -> dict[str, str]:
    """What the friction is told and remembers, as C calls it."""
    return {name: f"in->{name}" for name in INPUTS} | {name: f"s->memory[{j}]" for j, name in enumerate(law.memory)}


def _friction(law: Law | CurvedLaw, formula: str, modes: Modes) -> str:
    _require_writable(law, modes)
    memory, names = list(law.memory), _names(law)
    back, still, forward = (_token(name) for name in law.entry)
    rows, inputs = _vector(law, modes, memory), len(INPUTS)
    return _template(
        "friction.c",
        formula=remark(formula),
        memory=len(memory),
        size=max(1, len(memory)),
        modes=", ".join(f"{_token(mode.name)} = {number}" for number, mode in enumerate(modes)),
        back=back,
        still=still,
        forward=forward,
        starts=_lines(f"    s.memory[{j}] = {_text(form, names)};" for j, form in enumerate(law.memory.values())),
        forces=_forces(modes, names),
        rates=_rates(modes, memory, names),
        exits=_leave(modes, names),
        inputs=", ".join(INPUTS),
        vector=",\n".join(rows),
        rows=len(rows),
        columns=inputs + len(memory) + 2,
        motion=", ".join(f"r[{1 + j}]" for j in range(inputs)),
        first=inputs + 1,
        last=inputs + len(memory) + 1,
    )


def _lines(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)


def modes_of(law: Law | CurvedLaw) -> Modes:
    """Its modes, linear or curved."""
    return law.rates() if isinstance(law, CurvedLaw) else law.modes()


def levels_of(mode: Mode | CurvedMode, text: Callable[[Expression], str]) -> dict[str, str]:
    """What else a mode's exits speak of, as text."""
    levels: Mapping[str, Expression] = getattr(mode, "levels", {})
    return {name: f"({text(form)})" for name, form in levels.items()}


def _require_writable(law: Law | CurvedLaw, modes: Modes) -> None:
    if len({_token(mode.name) for mode in modes}) < len(modes):
        raise ModelError(
            f"modes called {', '.join(mode.name for mode in modes)}",
            "each has a name of its own in letters and digits",
            "name them so",
        )
    for mode in modes:
        forms = [*(exit_.quantity for exit_ in mode.exits), *mode.rates.values()]
        if mode.friction is not None and any("df" in form for form in forms if not isinstance(form, Expression)):
            raise ModelError(
                f"the mode '{mode.name}' of {type(law).__name__} asks for the rate of its own friction",
                "C code knows the motion and the memory alone",
                "export the law that stands in series, and write the spring in the program around it",
            )


def _token(name: str) -> str:
    return "FRICTION_" + re.sub(r"\W", "_", name.upper(), flags=re.ASCII)


def _text(form: Expression | Row, names: Mapping[str, str]) -> str:
    return written(form, names=names, c=True)


def _forces(modes: Modes, names: Mapping[str, str]) -> str:
    friction = {mode.name: "in->hold" if mode.friction is None else _text(mode.friction, names) for mode in modes}
    return _lines(f"    case {_token(name)}: return {text};" for name, text in friction.items())


def _rates(modes: Modes, memory: list[str], names: Mapping[str, str]) -> str:
    named = {**names, "f": "in->hold", "df": "in->hold_rate"}
    moves = {
        mode.name: " ".join(f"rate[{memory.index(name)}] = {_text(form, named)};" for name, form in mode.rates.items())
        for mode in modes
    }
    return _lines(f"    case {_token(name)}: {move} break;" for name, move in moves.items() if move)


def _leave(modes: Modes, names: Mapping[str, str]) -> str:
    lines: list[str] = []
    for mode in modes:
        if mode.exits:
            own = _speaking(mode, names)
            exits = [_exit(number, exit_, own) for number, exit_ in enumerate(mode.exits)]
            lines += [f"    case {_token(mode.name)}:", *exits, "        break;"]
    return _lines(lines)


def _ends(modes: Modes, names: Mapping[str, str]) -> str:
    """What ends a mode where it rises above zero, less so little that it is above zero where this is found to be."""
    lines: list[str] = []
    for mode in modes:
        own = _speaking(mode, names)
        exits = [
            f"        z[{number}] = {_text(exit_.quantity, own)} - PASSED * (1.0 + {_size(exit_, own)});"
            for number, exit_ in enumerate(mode.exits)
        ]
        lines += [f"    case {_token(mode.name)}:", *exits, "        break;"]
    return _lines(lines)


def _speaking(mode: Mode | CurvedMode, names: Mapping[str, str]) -> dict[str, str]:
    """What a mode's exits speak of, as C calls it."""
    named = {**names, "f": "force", "df": "in->hold_rate"}
    return {**named, **levels_of(mode, lambda form: _text(form, named))}


def _size(exit_: Exit, names: Mapping[str, str]) -> str:
    """How large the terms are of which an exit's quantity is the sum; nothing where it is one alone."""
    terms = [_text({name: value}, names) for name, value in exit_.quantity.items() if value]
    return " + ".join(f"fabs({term})" for term in terms) if len(terms) > 1 else "0.0"


def _exit(number: int, exit_: Exit, names: Mapping[str, str]) -> str:
    quantity, bit = _text(exit_.quantity, names), f"{1 << number}u"
    size = _size(exit_, names)
    due = f"{quantity} > 0" if size == "0.0" else f"{quantity} > ROUNDING * ({size})"
    first = f"        if (!({due})) s->armed |= {bit};\n" if exit_.crossing else ""
    due = f"(s->armed & {bit}) && {due}" if exit_.crossing else due
    old = {name: text.replace("s->", "before.") for name, text in names.items()}
    resets = [f"{names[name]} = {_text(form, old)};" for name, form in exit_.reset.items()]
    body = " ".join([*resets, f"s->mode = {_token(exit_.to)}; s->armed = 0u; return 1;"])
    return f"{first}        if ({due}) {{ {body} }}"


def _vector(law: Law | CurvedLaw, modes: Modes, memory: list[str]) -> list[str]:
    """States in every mode with the friction that Python finds there."""
    rows = []
    for mode in modes:
        for speed in SPEEDS:
            values = {"x": PLACE, "v": (mode.side or 1) * speed, "hold": HOLD, "hold_rate": HOLD_RATE}
            values |= {"delayed_speed": 1.5 * speed, "face_acceleration": CARRIED, "1": 1.0, "f": HOLD, "df": HOLD_RATE}
            values |= {name: at(form, values) for name, form in law.memory.items()}
            moved = {name: values[name] + SOON * at(form, values) for name, form in mode.rates.items()}
            values |= moved
            force = HOLD if mode.friction is None else at(mode.friction, values)
            state = [values[name] for name in (*INPUTS, *memory)] + [force]
            rows.append(f"    {{ {_token(mode.name)}, {_numbers(state)} }}")
    return rows


def at(form: Expression | Row, values: Mapping[str, float]) -> float:
    """The value of a linear form or an expression."""
    if isinstance(form, Expression):
        return form.at(**{name: value for name, value in values.items() if name != "1"})
    return sum(value * values[name] for name, value in form.items())


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
    ]
    imports = [f"from math import {', '.join(functions)}", "", ""] if functions else ["", ""]
    body = body.replace(", OTHERS", "".join(f", {name}" for name in used))
    return "\n".join([*head, *imports, body])


def _function(modes: Modes, breakaway: float) -> str:
    back, _, forward = (written(mode.friction or {}) for mode in modes)
    return "\n".join(
        [
            "def friction(v, hold=0.0):",
            "    if v == 0:",
            f"        return min(max(hold, -{breakaway!r}), {breakaway!r})",
            f"    return {forward} if v > 0 else {back}",
        ]
    )


def _class(law: Law | CurvedLaw, modes: Modes) -> str:
    if strange := [name for name in law.memory if not name.isidentifier()]:
        raise ModelError(f"memory called '{strange[0]}'", "Python writes it as self.NAME", "name it in letters")
    names = {name: f"self.{name}" for name in law.memory}
    back, still, forward = law.entry
    start = repr(still) if back == still == forward else f"{back!r} if v < 0 else {forward!r} if v > 0 else {still!r}"
    rates = _python_rates(modes, names) if any(mode.rates for mode in modes) else []
    memory = "".join(f"        self.{name} = {written(form)}\n" for name, form in law.memory.items())
    head = _template("friction.py.txt", start=start, memory=memory, most=len(modes), go_on=GO_ON if rates else "")
    return "\n".join([head, *_python_force(modes, names), *rates, *_python_leave(modes, names)]).rstrip()


def _python_force(modes: Modes, names: Mapping[str, str]) -> list[str]:
    lines = ["    def force(self, x, v, OTHERS):"]
    for mode in modes:
        force = "hold" if mode.friction is None else written(mode.friction, names=names)
        lines += [f"        if self.mode == {mode.name!r}:", f"            return {force}"]
    return [*lines, '        raise ValueError(f"no mode is called {self.mode}")', ""]


def _python_rates(modes: Modes, names: Mapping[str, str]) -> list[str]:
    lines, named = ["    def rates(self, x, v, OTHERS):"], {**names, "f": "hold", "df": "hold_rate"}
    for mode in modes:
        if mode.rates:
            rates = ", ".join(f"{name!r}: {written(form, names=named)}" for name, form in mode.rates.items())
            lines += [f"        if self.mode == {mode.name!r}:", f"            return {{{rates}}}"]
    return [*lines, "        return {}", ""]


def _python_leave(modes: Modes, names: Mapping[str, str]) -> list[str]:
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
                body += _python_exit(number, exit_, own)
    if any(re.search(r"\bforce\b", line) for line in body):
        lines.append("        force = self.force(x, v, OTHERS)")
    return [*lines, *body, "        return False", ""]


def _python_exit(number: int, exit_: Exit, names: Mapping[str, str]) -> Sequence[str]:
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
