"""Laws written for other programs: read back, evaluated, compiled and run, and refused where there is no such form."""

from __future__ import annotations

import inspect
import re
import shutil
import subprocess
import tomllib
from dataclasses import fields, replace
from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree

import numpy as np
import pytest

import stickslip as ss
from any_law import with_values
from stickslip import scenarios
from stickslip.errors import ModelError
from stickslip.laws.base import Mode, Rigid
from stickslip.laws.c_code import at, modes_of
from stickslip.laws.curved import exp
from stickslip.laws.export import FORMATS, formula_of
from stickslip.laws.formula import Formula
from stickslip.laws.guessing import registered
from stickslip.parameters import parameter, parametric

LAWS = {
    "Coulomb": ss.laws.Coulomb(1.1, static=1.3),
    "CompliantContact": ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9, static=1.2),
    "consistent contact": ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9, rule="consistent"),
    "LinearSlope": ss.laws.LinearSlope(1.0, slope=-0.2, static=1.5),
    "Tabulated": ss.laws.Tabulated([0, 0.1, 0.3], [1.5, 1.0, 1.2]),
    "StateVariable": ss.laws.StateVariable(1.1, rate=100.0),
    "steep StateVariable": ss.laws.StateVariable(1.1, rate=100.0, steepness=500.0, printed=True),
    "InertialContact": ss.laws.InertialContact(1.1, stiffness=192000, mass=0.01, damping=3.0),
    "ElastoSlip": ss.laws.ElastoSlip.iwan(1e6, width=30e-6, elements=4),
    "PositionLoad": ss.laws.PositionLoad(1.0, gradient=1.5),
    "Geared": ss.laws.Geared(1.0, 1.2, 0.1, 0.2, load=0.5, gradient=1.5, driving=0.3, driven=0.1),
    "Stribeck": ss.laws.Stribeck(1.0, 1.5, speed=0.1, exponent=1.3, viscous=0.2),
    "Dahl": ss.laws.Dahl(1.1, stiffness=192000, exponent=1.5),
    "LuGre": ss.laws.LuGre(1.0, 1.5, speed=1e-3, stiffness=1e5, damping=316.23, viscous=0.4),
    "RateState": ss.laws.RateState(10.0, friction=0.6, direct=0.01, evolution=0.015, distance=1e-5, reference=1e-6),
    "slip law": ss.laws.RateState(
        9.0, friction=0.6, direct=0.01, evolution=0.01, distance=1e-5, reference=1e-6, law="slip"
    ),
    "SmoothStateVariable": ss.laws.SmoothStateVariable(1.1, rate=100.0, steepness=3000.0),
    "FrictionCurve": ss.laws.FrictionCurve(Formula("3 / (1 + 1.42 * v) + 1 + 0.1 * v**2")),
    "InSeries": ss.laws.InSeries(ss.laws.LinearSlope(1.0, slope=-5.0), stiffness=192000, damping=24),
    "TimeDelay": ss.laws.TimeDelay(ss.laws.LinearSlope(1.0, slope=2.0), lag=1e-3),
}
LAWS |= {
    name: with_values(law)
    for name, law in scenarios.LAWS.items()
    if name not in {type(known).__name__ for known in LAWS.values()}
}
CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


def test_every_law_has_a_label_and_a_formula() -> None:
    assert all(law.label and law.formula for law in scenarios.LAWS.values())


ALL = {
    **LAWS, "plain Coulomb": ss.laws.Coulomb(1.1), "plain contact": ss.laws.CompliantContact(1.1, stiffness=192000),
    "plain slope": ss.laws.LinearSlope(1.0, slope=0.1),
}  # fmt: skip


@pytest.mark.parametrize("name", ALL)
def test_a_formula_names_no_parameter_that_is_not_there(name: str) -> None:
    told = ss.laws.export_law(ALL[name], format="simulink").splitlines()[0]
    optional = [own.name for own in fields(ALL[name]) if own.default is None]  # type: ignore[arg-type]
    bare = ss.laws.export_law(replace(ALL[name], **dict.fromkeys(optional)), format="simulink").splitlines()[0]
    lacking = "say what stands in its place by the class's `absent`, or by own_formula()"
    assert not [each for each in optional if re.search(rf"\b{each}\b", bare)], lacking
    assert ("relaxes" in told) == (name == "consistent contact")


def test_a_formula_names_what_stands_for_any_parameter_that_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    @parametric
    class Grain(Rigid):
        """A level for each direction at rest."""

        formula = "f = kinetic sign(v) while sliding, -static_back <= f <= static_forward at rest"
        absent: ClassVar[dict[str, str]] = {"static_back": "static_forward", "static_forward": "kinetic"}
        kinetic: float = parameter("N", "sliding friction")
        static_forward: float | None = parameter("N", "static friction forward", default=None)
        static_back: float | None = parameter("N", "static friction back", default=None)

        def modes(self) -> tuple[Mode, ...]:
            """Of Coulomb's law."""
            return ss.laws.Coulomb(self.kinetic).modes()

    monkeypatch.setitem(registered(), "Grain", Grain)
    assert formula_of(Grain(1.0, 1.2, 1.3)) == Grain.formula
    assert formula_of(Grain(1.0, static_back=1.3)).endswith("-static_back <= f <= kinetic at rest")
    assert formula_of(Grain(1.0, 1.2)).endswith("-static_forward <= f <= static_forward at rest")
    assert formula_of(Grain(1.0)).endswith("-kinetic <= f <= kinetic at rest")


@pytest.mark.parametrize("name", LAWS)
def test_toml_is_read_back(name: str, tmp_path: Path) -> None:
    path = tmp_path / "slider.toml"
    path.write_text(f"system = {{ mass = 1.0, stiffness = 4.0 }}\n{ss.laws.export_law(LAWS[name])}\n")
    assert ss.systems.read_system(path).system.law == LAWS[name]


def test_a_curve_of_python_is_written_as_its_formula(tmp_path: Path) -> None:
    law = ss.laws.FrictionCurve(lambda v: 2.0 + 0.5 * exp(-(v / 0.1)) - v / (1 + v**2), static=3.0)
    path = tmp_path / "slider.toml"
    path.write_text(f"system = {{ mass = 1.0, stiffness = 4.0 }}\n{ss.laws.export_law(law)}\n")
    again = ss.systems.read_system(path).system.law
    assert again.static == 3.0
    for speed in (0.0, 0.03, 0.7):
        assert again.friction(speed) == pytest.approx(law.friction(speed), rel=1e-14)


def run_as_it_stands(name: str) -> dict[str, object]:
    names: dict[str, object] = {}
    exec(compile(ss.laws.export_law(LAWS[name], format="python"), name, "exec"), names)
    return names


@pytest.mark.parametrize("name", ["Coulomb", "LinearSlope", "Stribeck", "FrictionCurve"])
def test_python_of_a_law_over_the_speed_is_a_function(name: str) -> None:
    law, friction = LAWS[name], run_as_it_stands(name)["friction"]
    forward = next(mode for mode in modes_of(law) if mode.name == "forward").friction
    for speed in (1e-3, 0.05, 2.0):
        wanted = at(forward, {"v": speed, "1": 1.0})
        assert friction(speed) == pytest.approx(wanted, rel=1e-14)
        assert friction(-speed) == pytest.approx(-wanted, rel=1e-14)
    level = law.static if name in ("Coulomb", "LinearSlope", "Stribeck") else law.breakaway
    assert friction(0.0, hold=99.0) == level
    assert friction(0.0, -0.1) == -0.1


@pytest.mark.parametrize("name", [name for name in LAWS if name not in ("Coulomb", "LinearSlope", "Stribeck")])
def test_python_of_a_contact_has_the_friction_of_each_mode(name: str) -> None:
    made = run_as_it_stands(name)
    if "friction" in made:
        return
    law, kind = LAWS[name], made["Friction"]
    inputs = inspect.signature(kind.force).parameters
    for mode in modes_of(law):
        values = {
            "x": 1e-5,
            "v": 0.02 * (mode.side or 1),
            "hold": 0.3,
            "hold_rate": 2.0,
            "delayed_speed": 0.03,
            "face_acceleration": 0.7,
            "1": 1.0,
        }
        contact = kind(values["x"], values["v"])
        values |= {name: getattr(contact, name) for name in law.memory}
        contact.mode = mode.name
        force = contact.force(*(values[each] for each in inputs if each != "self"))
        assert force == (0.3 if mode.friction is None else pytest.approx(at(mode.friction, values), rel=1e-14))


def test_python_names_what_a_contact_must_be_told() -> None:
    held = run_as_it_stands("StateVariable")["Friction"]
    assert list(inspect.signature(held.step).parameters) == ["self", "x", "v", "dt", "hold", "hold_rate"]
    bristles = run_as_it_stands("LuGre")["Friction"]
    assert list(inspect.signature(bristles.step).parameters) == ["self", "x", "v", "dt"]


@pytest.mark.parametrize("name", ["CompliantContact", "consistent contact", "ElastoSlip", "Dahl", "LuGre"])
def test_python_along_a_motion_is_the_friction_of_the_exact_solver(name: str) -> None:
    """The class is fed the motion of a simulated slider, 200 000 steps a second, and left to itself."""
    system = ss.Oscillator(mass=2.42, stiffness=2310, law=LAWS[name], drive=ss.drives.HarmonicBase(2e-3, frequency=5.0))
    record = ss.simulate(system, duration=0.3).record(fs=200_000)
    contact = run_as_it_stands(name)["Friction"](record["x"][0], record["v"][0])
    values = np.array([contact.step(x, v, 5e-6) for x, v in zip(record["x"], record["v"], strict=True)])
    wanted = record["friction"]
    assert np.sqrt(np.mean((values - wanted) ** 2)) < 0.01 * np.abs(wanted).max()


@pytest.mark.parametrize("name", ["Dahl", "LuGre"])
def test_python_of_a_stiff_contact_holds_at_the_rate_of_a_record(name: str) -> None:
    """By Euler's rule the friction grew to 1e145 N, without a word, over a record of 2 kHz."""
    t = np.arange(2000) / 2000
    x, v = 2e-3 * np.sin(10 * np.pi * t), 2e-3 * 10 * np.pi * np.cos(10 * np.pi * t)
    contact = run_as_it_stands(name)["Friction"](x[0], v[0])
    values = np.array([contact.step(place, speed, 1 / 2000) for place, speed in zip(x, v, strict=True)])
    fine = run_as_it_stands(name)["Friction"](x[0], v[0])
    t = np.arange(200_000) / 200_000
    x, v = 2e-3 * np.sin(10 * np.pi * t), 2e-3 * 10 * np.pi * np.cos(10 * np.pi * t)
    wanted = np.array([fine.step(place, speed, 5e-6) for place, speed in zip(x, v, strict=True)])
    assert np.abs(values).max() < 1.05 * np.abs(wanted).max()
    assert np.sqrt(np.mean((values - wanted[::100]) ** 2)) < 0.1 * np.abs(wanted).max()


def built(law: object, folder: Path, *more: str, main: str = "") -> Path:
    if CC is None:
        pytest.skip("no C compiler on this machine (cc, gcc or clang)")
    source, program = folder / "friction.c", folder / "friction_test"
    source.write_text(ss.laws.export_law(law, format="c") + main)
    flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    run = subprocess.run([CC, *flags, *more, "-o", program, source, "-lm"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return program


@pytest.mark.parametrize("name", LAWS)
def test_c_code_meets_its_test_vector(name: str, tmp_path: Path) -> None:
    run = subprocess.run([built(LAWS[name], tmp_path, "-DFRICTION_TEST")], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout
    assert re.fullmatch(r"0 of \d+ wrong\n", run.stdout)


def test_the_test_vector_sees_a_wrong_number(tmp_path: Path) -> None:
    if CC is None:
        pytest.skip("no C compiler on this machine (cc, gcc or clang)")
    source, program = tmp_path / "friction.c", tmp_path / "friction_test"
    source.write_text(ss.laws.export_law(ss.laws.Coulomb(1.1), format="c").replace("return 1.1;", "return 1.2;"))
    subprocess.run([CC, "-DFRICTION_TEST", "-o", program, source, "-lm"], check=True)
    run = subprocess.run([program], capture_output=True, text=True)
    assert run.returncode == 1
    assert run.stdout.startswith("3 of 9 wrong")


MARCH = """
#include <stdio.h>
int main(void)
{
    double t, x, v, rate[8];
    friction_motion in = { 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 };
    friction_state s = friction_start(&in);
    int row, fine, i;
    scanf("%*s");
    for (row = 0; scanf("%lf %lf %lf", &t, &x, &v) == 3; row++) {
        const double x0 = in.x, v0 = in.v;
        for (fine = 1; fine <= 50; fine++) {
            const double p = fine / 50.0, h = 1e-4; /* the cubic through both places and speeds */
            const double c = 3 * (x - x0) - h * (2 * v0 + v), d = 2 * (x0 - x) + h * (v0 + v);
            in.x = x0 + p * (h * v0 + p * (c + p * d)); in.v = (h * v0 + p * (2 * c + 3 * p * d)) / h;
            for (i = 0; i < 9 && friction_leave(&s, &in); i++) {}
            friction_rates(&s, &in, rate);
            for (i = 0; i < FRICTION_MEMORY; i++) s.memory[i] += 2e-6 * rate[i];
        }
        printf("%.17g\\n", friction_force(&s, &in));
    }
    return 0;
}
"""


@pytest.mark.parametrize("name", ["CompliantContact", "ElastoSlip", "Dahl", "LuGre"])
def test_c_code_along_a_motion_is_the_friction_of_the_exact_solver(name: str, tmp_path: Path) -> None:
    """The C code is fed the displacement of a simulated slider, 500 000 steps a second, and left to itself."""
    system = ss.Oscillator(mass=2.42, stiffness=2310, law=LAWS[name], drive=ss.drives.HarmonicBase(2e-3, frequency=5.0))
    record = ss.simulate(system, duration=0.4).record(fs=10000)
    x, v, wanted = record["x"], record["v"], record["friction"]
    rows = "\n".join(f"{t:.17g} {a:.17g} {b:.17g}" for t, a, b in zip(record.time, x, v, strict=True))
    program = built(LAWS[name], tmp_path, main=MARCH)
    run = subprocess.run([program], input=f"motion\n{rows}\n", capture_output=True, text=True, check=True)
    values = np.array(run.stdout.split(), dtype=float)
    assert len(values) == len(wanted)
    assert np.sqrt(np.mean((values - wanted) ** 2)) < 0.005 * np.abs(wanted).max()


def test_mujoco_has_coulomb_and_viscous_joints() -> None:
    text = ss.laws.export_law(ss.laws.LinearSlope(1.0, slope=0.2), format="mujoco")
    assert '<joint type="slide" frictionloss="1.0" damping="0.2" solreffriction="1e-06 1"/>' in text
    for law in LAWS.values():
        file = ElementTree.fromstring(ss.laws.export_law(law, format="mujoco"))
        assert file.tag == "mujocoinclude"
        assert [part.tag for part in file] in (["joint"], ["custom"], ["actuator"])
        assert all(part.get("name") and part.get("data") for part in file.iterfind("custom/*"))
    lugre = LAWS["LuGre"]
    root = ElementTree.fromstring(ss.laws.export_law(replace(lugre, exponent=1.5), format="mujoco"))
    given = {each.get("name"): float(each.get("data")) for each in root.iter("numeric")}
    assert given["LuGre_damping"] == 316.23
    (motor,) = ElementTree.fromstring(ss.laws.export_law(lugre, format="mujoco")).iter("dcmotor")  # its exponent is 2
    levels = [lugre.stiffness, lugre.damping, lugre.kinetic, lugre.static, lugre.speed]
    assert [float(each) for each in motor.get("lugre", "").split()] == levels
    assert float(motor.get("damping", "")) == lugre.viscous


@pytest.mark.parametrize("name", LAWS)
def test_modelica_is_one_class_whose_statements_end(name: str) -> None:
    """What Modelica's grammar asks of a file: a class, statements with a semicolon inside of it, and its end."""
    comment, *lines = ss.laws.export_law(LAWS[name], format="modelica").splitlines()
    assert comment.startswith("// ")
    kind, called = lines[0].split()
    assert kind in ("model", "record")
    assert lines[-1] == f"end {called};"
    code = " ".join(line for line in lines[1:-1] if not line.strip().startswith("//"))
    statements = [each.strip() for each in re.sub(r"\[[^]]*\]", "[]", code).split(";")]
    assert statements.pop() == ""
    number = r"-?\d[\d.e+-]*"
    for statement in statements:
        value = rf"Real \w+ = {number}|Real \w+\[\] = {{[^}}]*}}|Boolean \w+ = (true|false)|String \w+ = \"[^\"]*\""
        friction = rf"extends [\w.]+\.SupportFriction\( +f_pos = \[\], +peak = {number}\)"
        assert re.fullmatch(rf"parameter ({value})|{friction}", statement), statement
    assert (kind == "model") == any(statement.startswith("extends") for statement in statements)
    if kind == "model":
        points = np.array([row.split(",") for row in re.search(r"f_pos = \[(.*?)\]", code)[1].split(";")], dtype=float)
        assert (np.diff(points[:, 0]) > 0).all()
        assert float(re.search(r"peak = ([^)]*)\)", code)[1]) >= 1


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("format", ["modelica", "simulink"])
def test_blocks_hold_every_number_and_the_formula(name: str, format: str) -> None:
    law, text = LAWS[name], ss.laws.export_law(LAWS[name], format=format)
    assert formula_of(law) in text.splitlines()[0]
    for key, value in tomllib.loads(ss.laws.export_law(law))["law"].items():
        if isinstance(value, float):
            assert re.search(rf"\b{key} = {re.escape(repr(value))};", text)


def test_tables_for_lookup_blocks_follow_the_law() -> None:
    text = ss.laws.export_law(LAWS["Stribeck"], format="simulink")
    numbers = {key: np.array(row.split(), dtype=float) for key, row in re.findall(r"\.(\w+) = \[(.*?)\];", text)}
    strays = float(re.search(r"strays from the formula by (\S+) N", text)[1])
    for speed in np.linspace(0, 1, 77):
        wanted = LAWS["Stribeck"].friction(speed)
        assert np.interp(speed, numbers["breakpoints"], numbers["table"]) == pytest.approx(wanted, abs=1.05 * strays)
    assert strays < 0.01
    assert "f_pos = [0.0, 1.1; 1.0, 1.1],\n    peak = 1.18" in ss.laws.export_law(LAWS["Coulomb"], format="modelica")


def test_what_has_no_form_is_refused() -> None:
    with pytest.raises(ModelError, match=r"format = 'tmol'.*perhaps 'toml'|toml"):
        ss.laws.export_law(LAWS["Coulomb"], format="tmol")
    with pytest.raises(ModelError, match="exported with its values"):
        ss.laws.export_law(ss.laws.Coulomb)
    rough = ss.laws.RoughSurface(ss.laws.Coulomb(1.1), share=0.03, length=1e-4, span=1e-3)
    for format in FORMATS:
        with pytest.raises(ModelError, match=r"has no formula; export the contact on it"):
            ss.laws.export_law(rough, format=format)
    for format in ("modelica", "simulink"):
        with pytest.raises(ModelError, match=r"LinearSlope falls below zero before 0\.5\d* m/s"):
            ss.laws.export_law(ss.laws.LinearSlope(1.1, -2.0), format=format)
    behind = ss.laws.InSeries(ss.laws.StateVariable(1.1, rate=100.0), stiffness=192000)
    with pytest.raises(ModelError, match="rate of its own friction"):
        ss.laws.export_law(behind, format="c")
