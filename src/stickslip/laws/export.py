"""A friction law for another program: as TOML, Python, C, or a block of parameters with the formula beside."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from math import isfinite
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_OID, uuid5
from xml.sax.saxutils import quoteattr
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from stickslip.errors import ModelError
from stickslip.laws.base import Law
from stickslip.laws.c_code import (
    build_description,
    c_code,
    compiled_fmu,
    fmu_code,
    model_description,
    modes_of,
    python_code,
)
from stickslip.laws.compliant import LuGre
from stickslip.laws.coulomb import Coulomb, LinearSlope
from stickslip.laws.curved import CurvedLaw, lifted
from stickslip.laws.formula import one_line, remark, written
from stickslip.laws.guessing import registered
from stickslip.laws.stribeck import FrictionCurve, SpeedCurve, Tabulated
from stickslip.laws.surfaces import RoughSurface
from stickslip.parameters import finite
from stickslip.settings import nearest, toml_lines
from stickslip.whole import whole_file

TABLE = 33  # points of a curve over the speed, where a program takes a table
WIDE, FASTEST = 10.0, 1.0  # it goes to ten times the law's own speed, or to 1 m/s where it has none


def export_law(law: Law | CurvedLaw, *, format: str = "toml", turning: bool = False) -> str:
    """How is a friction law written for another program?

    * ``"toml"``: the table ``[law]`` of a system's file; with ``[system]`` beside it :func:`read_system` reads it;
    * ``"python"``: a function of the speed, or a class that is led step by step where the law has a memory; each runs
      as it stands;
    * ``"c"``: C99 code of the friction in each mode, of what ends a mode, and a test vector that it checks itself by;
    * ``"mujoco"``, ``"modelica"``, ``"simulink"``: a block of parameters with the formula beside. Where the program has
      friction of that kind, in its own words: MuJoCo's joints Coulomb and viscous friction, its ``dcmotor`` that of
      LuGre, Modelica's ``SupportFriction``, which the model then extends, and Simulink's lookup table any friction
      over the speed.

    A law that is not of this package is written from its modes, in every form but TOML.

    Parameters
    ----------
    law : Law
        Any of the friction laws.
    format : str
        One of the names above.
    turning : bool
        Whether it is the friction of something that turns, its numbers in N m and rad/s: MuJoCo's joint is then a
        hinge, Modelica's model that of a bearing.

    Returns
    -------
    str

    Raises
    ------
    ModelError
        The law has no such form, or there is no such format.

    Examples
    --------
    >>> from stickslip.laws.coulomb import Coulomb
    >>> print(export_law(Coulomb(1.1, static=1.3)))
    # f = kinetic sign(v) while sliding, |f| <= static at rest
    [law]
    name = "Coulomb"
    kinetic = 1.1
    static = 1.3
    """
    if format not in FORMATS:
        raise ModelError(f"format = '{format}'", f"it is one of {', '.join(FORMATS)}", nearest(str(format), FORMATS))
    _require_formula(law)
    write = TURNING.get(format, FORMATS[format]) if turning else FORMATS[format]
    return write(law).rstrip("\n") + "\n" * (format == "c")


def export_fmu(
    law: Law | CurvedLaw,
    path: str | Path,
    *,
    mass: float,
    stiffness: float = 0.0,
    damping: float = 0.0,
    damper: str = "ground",
    turning: bool = False,
    sources_only: bool = False,
) -> Path:
    r"""How is a mass that rubs written for Simulink, Modelica tools and whatever else takes an FMU?

    A functional mock-up unit of FMI 3, for model exchange and for co-simulation: the friction together with the mass
    that it holds,

    .. math:: m\ddot x = F + k\,(z - x) + c\,(\dot z - \dot x) - f,

    for at rest friction is whatever holds the mass, which no speed tells; a law alone would close a loop without delay
    around the model. Inputs are the force F, and z with its rate (of the spring's end: a base, or a servo's reference);
    outputs x, v, the friction f, the acceleration and the law's mode. Mass, stiffness, damping, the speed of the
    counter-face and the start of x and v are changed by the tool; the law's own numbers are compiled in. Without a
    stiffness it is a mass that is pushed.

    In co-simulation the unit steps itself, to 1e-10, and ends its steps where a mode ends; within a step of the tool
    the force is held and z goes on by its rate. In model exchange the tool's solver integrates, and is told by event
    indicators where a mode ends.

    Parameters
    ----------
    law : Law
        Any law that :func:`export_law` writes as C but a `TimeDelay`.
    path : path
        The file; its name is that of the model.
    mass : float
        Mass [kg], or inertia [kg m^2].
    stiffness : float
        Spring between x and z [N/m], [N m/rad]; a servo's kp.
    damping : float
        Damper [N s/m], [N m s/rad]; a servo's kd.
    damper : str
        What it is fixed to: "ground", where its force is without the rate of z, or "base".
    turning : bool
        Whether it turns: units are then those of angles and torques.
    sources_only : bool
        Whether the importing tool is to compile it; else it is compiled here, for this kind of machine.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ModelError
        The law has no such form, a value has no meaning, the file does not end in .fmu, or no C compiler is there.

    Examples
    --------
    >>> import tempfile, zipfile
    >>> path = Path(tempfile.mkdtemp()) / "slider.fmu"
    >>> with zipfile.ZipFile(export_fmu(Coulomb(1.1), path, mass=2.4, sources_only=True)) as unit:
    ...     unit.namelist()
    ['modelDescription.xml', 'sources/buildDescription.xml', 'sources/slider.c']
    """
    _require_formula(law)
    for name, value in (("mass", mass), ("stiffness", stiffness), ("damping", damping)):
        finite(name, value, unit="", positive=name == "mass", signed=name == "damping")
    if damper not in ("ground", "base"):
        raise ModelError(f"damper = '{damper}'", "it is fixed to the ground or the base", "give one of them")
    path = Path(path)
    if path.suffix != ".fmu":
        raise ModelError(f"'{path}' is no FILE.fmu", "tools know a unit by this ending", "give it a name that ends so")
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    name = name if name[:1].isalpha() else f"model_{name}"
    begins = (0.0, 0.0, 0.0, 0.0, mass, stiffness, damping, 0.0, 0.0, 0.0)
    code, exits = fmu_code(law, formula_of(law), begins, on_base=damper == "base")
    token = f"{{{uuid5(NAMESPACE_OID, name + code)}}}"
    code = f'#define TOKEN "{token}"\n{code}'
    content: dict[str, str | bytes] = {
        "modelDescription.xml": model_description(
            name, token, formula_of(law), law=law, begins=begins, exits=exits, turning=turning
        ),
        "sources/buildDescription.xml": build_description(name),
        f"sources/{name}.c": code,
    }
    if not sources_only:
        place, binary = compiled_fmu(name, code)
        content[place] = binary
    with whole_file(path) as draft, ZipFile(draft, "w", ZIP_DEFLATED) as unit:
        for place, data in content.items():
            unit.writestr(ZipInfo(place), data, ZIP_DEFLATED)  # without the time: the same law, the same file
    return path


def urdf_dynamics(law: Coulomb | LinearSlope) -> str:
    """The friction of a joint as URDF's element, whose friction is Coulomb's.

    Examples
    --------
    >>> urdf_dynamics(LinearSlope(0.052, slope=0.6))
    '<dynamics damping="0.6" friction="0.052"/>'
    """
    return f'<dynamics damping="{getattr(law, "slope", 0.0)!r}" friction="{law.kinetic!r}"/>'


def formula_of(law: Any) -> str:
    """The law's friction in the names of its parameters."""
    if not _registered(law):
        return _formula_of_modes(law)
    formula: str = law.own_formula() if hasattr(law, "own_formula") else law.formula
    for name, substitute in getattr(law, "absent", {}).items():  # in the class's order: one may stand for another
        if getattr(law, name) is None:
            formula = re.sub(rf"\b{name}\b", substitute, formula)
    inner = getattr(law, "law", None)
    return f"{formula}; {formula_of(inner)}" if is_dataclass(inner) else formula


def _require_formula(law: Any) -> None:
    if not _is_law(law):
        raise ModelError(f"law = {law!r}", "a law is exported with its values", "give one, as in Coulomb(1.1)")
    if any(isinstance(part, RoughSurface) for part in _nested(law)):
        raise ModelError(
            "a rough surface",
            "its friction follows a place by chance, and has no formula",
            "export the contact on it, law.contact",
        )


def _is_law(law: object) -> bool:
    return not isinstance(law, type) and (hasattr(law, "modes") or hasattr(law, "rates"))


def _nested(law: Any) -> Iterator[Any]:
    """A law and those within it."""
    while _is_law(law):
        yield law
        law = getattr(law, "law", None)


def _registered(law: object) -> bool:
    """Whether it is the law that its name means."""
    return registered().get(type(law).__name__) is type(law)


def _formula_of_modes(law: Law | CurvedLaw) -> str:
    """The friction of any law, as its modes have it."""
    lines = []
    for mode in modes_of(law):
        rates = [f"{name}' = {written(form)}" for name, form in mode.rates.items()]
        force = "what holds the mass" if mode.friction is None else written(mode.friction)
        lines.append(f"{mode.name}: " + ", ".join([f"f = {force}", *rates]))
    return "; ".join(lines)


def _values(law: object) -> Iterator[tuple[str, Any]]:
    for field in fields(law) if is_dataclass(law) else ():
        value = getattr(law, field.name)
        if value is not None:
            yield field.name, law.text if isinstance(law, FrictionCurve) and field.name == "curve" else value


def _toml(law: Law | CurvedLaw) -> str:
    if strange := [type(part).__name__ for part in _nested(law) if not _registered(part)]:
        raise ModelError(
            f"a {strange[0]}", f"a system's file names one of {', '.join(registered())}", "export Python or C"
        )
    return "\n".join([f"# {remark(formula_of(law))}", *[*toml_lines({"law": plain(law)})][1:]])


def plain(part: Any) -> Any:
    """A law or a drive as plain data: its name and what it holds; what it holds itself likewise."""
    if is_dataclass(part):
        return {"name": type(part).__name__, **{name: plain(value) for name, value in _values(part)}}
    if hasattr(part, "tolist"):
        return part.tolist()
    return [plain(item) for item in part] if _listed(part) else part


def _python(law: Law | CurvedLaw) -> str:
    return python_code(law, formula_of(law), getattr(law, "breakaway", None))


def _flat(law: object, within: str = "") -> Iterator[tuple[str, Any]]:
    """Parameters by name, those of a law within it too; a curve stands in the formula."""
    for name, value in _values(law):
        if is_dataclass(value):
            yield from _flat(value, f"{within}{name}_")
        elif name != "curve":
            yield within + name, _parameter(within + name, value)


def _parameter(name: str, value: Any) -> Any:
    """A value that a block of parameters can hold."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, str):
        return one_line(value)
    if not all(isinstance(part, int | float) and isfinite(part) for part in (value if _listed(value) else [value])):
        raise ModelError(
            f"{name} of type {type(value).__name__}",
            "a block of parameters holds finite numbers, lists of them, and text",
            "export Python or C",
        )
    return value


def _number(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(float(value))


def _listed(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _table(law: Law | CurvedLaw) -> Tabulated | None:
    """A law whose friction in slip follows the speed alone, as a polygon over it."""
    if isinstance(law, Coulomb):
        return Tabulated([0.0, FASTEST], [law.kinetic, law.kinetic], law.static)
    if isinstance(law, Tabulated) or not isinstance(law, SpeedCurve):
        return law if isinstance(law, Tabulated) else None
    scale = getattr(law, "speed", FASTEST / WIDE)
    speeds = [WIDE * scale * (number / (TABLE - 1)) ** 2 for number in range(TABLE)]
    ((_, branch),) = law.branches()

    def curve(speed: float) -> float:
        return lifted(branch(lifted(speed))).at()

    below = next((speed for speed in speeds if curve(speed) < 0), None)
    if below is not None:
        raise ModelError(
            f"the friction of {type(law).__name__} falls below zero before {below:.3g} m/s",
            f"a table over the speed, here to {speeds[-1]:.3g} m/s, has friction that brakes",
            "give a law that levels off, or export it to C or Python",
        )
    return Tabulated.of(curve, speeds, law.breakaway)


# MuJoCo gives way to friction by a spring and damper of 20 ms, so that a joint creeps; for a shorter time than two of
# its steps it takes those two. A decay is then right to 0.1 % of its release at steps of 0.2 ms, else to 2.6 %.
HARD = 'solreffriction="1e-06 1"'


def _mujoco(law: Law | CurvedLaw, joint: str = "slide") -> str:
    name, static = type(law).__name__, getattr(law, "static", None)
    if isinstance(law, Coulomb | LinearSlope) and static in (None, law.kinetic) and getattr(law, "slope", 0.0) >= 0:
        where = "include this file in the body that rubs"
        rubs = f'frictionloss="{law.kinetic!r}" damping="{getattr(law, "slope", 0.0)!r}" {HARD}'
        own = [f'  <joint type="{joint}" {rubs}/>']
    elif isinstance(law, LuGre) and law.exponent == 2 and law.viscous >= 0:
        where = "include this file in the model, with the name of the joint that rubs for JOINT; MuJoCo 4 or later"
        own = _dcmotor(law)
    else:
        where = "no joint of MuJoCo rubs so: apply it in a callback (mjcb_passive), as in the C code; include this file"
        own = ["  <custom>"]
        for key, value in _flat(law):
            data = " ".join(map(_number, value)) if _listed(value) else value
            kind = "text" if isinstance(value, str) else "numeric"
            data = data if isinstance(data, str) else repr(float(data))
            own.append(f"    <{kind} name={quoteattr(f'{name}_{key}')} data={quoteattr(data)}/>")
        own.append("  </custom>")
    formula = remark(formula_of(law))
    return "\n".join(["<mujocoinclude>", f"  <!-- {formula} -->", f"  <!-- {where} -->", *own, "</mujocoinclude>"])


def _dcmotor(law: LuGre) -> list[str]:
    """A motor that no current drives: its bearing has the friction, the motor itself 1e-18 N s/m of damping."""
    bristles = (law.stiffness, law.damping, law.kinetic, law.static, law.speed)
    return [
        "  <actuator>",
        '    <dcmotor joint="JOINT" input="none" motorconst="1e-9" resistance="1"',
        f'             lugre="{" ".join(map(_number, bristles))}" damping="{_number(law.viscous)}"/>',
        "  </actuator>",
    ]


def _modelica(law: Law | CurvedLaw, *, turning: bool = False) -> str:
    name, table = type(law).__name__, _table(law)
    rubs = table is not None and table.forces[0] > 0
    lines = [f"// {remark(formula_of(law))}", f"{'model' if rubs else 'record'} {name}Friction"]
    if table is not None and rubs:
        speeds, forces = list(table.speeds), list(table.forces)
        if isinstance(law, Tabulated):  # level beyond the last: Modelica goes on as the last two points
            speeds, forces = [*speeds, 2 * speeds[-1]], [*forces, forces[-1]]
        within = "Rotational.Components.BearingFriction" if turning else "Translational.Components.SupportFriction"
        rows = "; ".join(f"{speed!r}, {force!r}" for speed, force in zip(speeds, forces, strict=True))
        lines.append(f"{_strays(table, '  //')}  extends Modelica.Mechanics.{within}(")
        lines.append(
            f"    {'tau' if turning else 'f'}_pos = [{rows}],\n    peak = {table.breakaway / table.forces[0]!r});"
        )
    for key, value in _flat(law):
        if isinstance(value, bool):
            lines.append(f"  parameter Boolean {key} = {_number(value)};")
        elif isinstance(value, str):
            text = value.replace("\\", "\\\\").replace('"', '\\"')
            lines.append(f'  parameter String {key} = "{text}";')
        else:
            data = f"{{{', '.join(map(_number, value))}}}" if _listed(value) else _number(value)
            lines.append(f"  parameter Real {key}{'[:]' if _listed(value) else ''} = {data};")
    return "\n".join([*lines, f"end {name}Friction;"])


def _simulink(law: Law | CurvedLaw) -> str:
    lines = [f"% {remark(formula_of(law))}"]
    for key, value in _flat(law):
        data = (
            f"'{value.replace(chr(39), chr(39) * 2)}'"
            if isinstance(value, str)
            else f"[{' '.join(map(_number, value))}]"
            if _listed(value)
            else ""
        )
        lines.append(f"{type(law).__name__}.{key} = {data or _number(value)};")
    if (table := _table(law)) is not None:
        usage = "% for a 1-D Lookup Table over abs(v), clipped at its end, times sign(v); at rest up to breakaway"
        lines.append(_strays(table, "%") + usage)
        for key, numbers in (("breakpoints", table.speeds), ("table", table.forces)):
            lines.append(f"{type(law).__name__}.{key} = [{' '.join(map(_number, numbers))}];")
        lines.append(f"{type(law).__name__}.breakaway = {_number(table.breakaway)};")
    return "\n".join(lines)


def _strays(table: Tabulated, comment: str) -> str:
    return f"{comment} the table strays from the formula by {table.error:.2g} N at most\n" if table.error else ""


FORMATS: dict[str, Callable[[Law | CurvedLaw], str]] = {
    "toml": _toml, "python": _python, "c": lambda law: c_code(law, formula_of(law)), "mujoco": _mujoco,
    "modelica": _modelica, "simulink": _simulink,
}  # fmt: skip
TURNING: dict[str, Callable[[Law | CurvedLaw], str]] = {
    "mujoco": lambda law: _mujoco(law, "hinge"),
    "modelica": lambda law: _modelica(law, turning=True),
}
