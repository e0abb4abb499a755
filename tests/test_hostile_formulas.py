"""Formulas that mean harm, and laws that no table names: what is exported is the law and nothing else."""

from __future__ import annotations

import dataclasses
import math
import os
import re
import shutil
import subprocess
import time
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import stickslip as ss
from limits import SECONDS, civil, program
from stickslip import compiled
from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode, Rigid, Row
from stickslip.laws.curved import CurvedMode, Expression, Sliding, either_side, symbol, tanh
from stickslip.laws.export import FORMATS
from stickslip.laws.formula import DEEPEST, Formula
from stickslip.solve.curved import model_of
from stickslip.solve.tape import tape

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
STRICT = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
FOREIGN = '(1.1 # */ __attribute__((constructor)) static void q(void){fopen("harm","w");} /*\n + 0*v)'

HOSTILE = [
    FOREIGN,
    "1.1 # a comment",
    "(1.1\n+ v)",
    "1.1 + \\\nv",
    "1.1 + 'v'",
    '1.1 + "v"',
    "1.1 + v; import os",
    "1.1 + v */ /* v",
    "1.1 + \x1b[31mv",
    "1.1 + \N{MATHEMATICAL BOLD SMALL V}",
    "1.1 + 1e999 * v",
    "1.1 + " + "9" * 290 + "e99",
    "1.1 + v.__class__",
    "1.1 + (lambda: v)()",
    "1.1 + [v][0]",
    "1.1 + exp(v)(v)",
    "1.1 + (v := 2)",
    "1.1 if v else 2",
    "9**9**9**9",
    "-" * 290 + "v",
    "(" * 149 + "v" + ")" * 148,
    "",
]

HONEST = [
    "1.1",
    "3 / (1 + 1.42 * v) + 1 + 0.1 * v**2",
    "1.0 + 0.5 * exp(-(v / 0.1)**2) + 0.01 * v",
    "1 + (v - (0.1 - v)) - (0.2 - 0.3) / (2 / (1 + v))",
    "2 - -v * -(0.5 - v)**3",
    "1e300 * (1e300 * 1e-300) * 1e-300 + 0x10 + 1_0",
    "1.0 + tanh(20 * v) + asinh(v) + sqrt(1 + v) + log(2 + v)",
    "  1.5  +  v  ",
]


@dataclasses.dataclass(frozen=True)
class Rubber(Rigid):
    """A law of a user's own, with linear modes."""

    grip: float = 1.25
    called: str = 'tyre "*/ --> \\ \n end'
    spare: float | None = None

    @property
    def memory(self) -> Mapping[str, Row]:
        return {}

    @property
    def places(self) -> tuple[str, ...]:
        return ()

    @property
    def entry(self) -> tuple[str, str, str]:
        return "slides */ back", "sticks", "slides forth"

    def modes(self) -> tuple[Mode, ...]:
        return (
            Mode("slides */ back", "slip", -1, {"1": -self.grip}, (Exit({"v": 1.0}, "sticks"),)),
            Mode("sticks", "stick", 0, None, (Exit({"f": 1.0, "1": -self.grip}, "slides forth"),)),
            Mode("slides forth", "slip", 1, {"1": self.grip}, (Exit({"v": -1.0}, "sticks"),)),
        )


class Fluid(Sliding):
    """A law of a user's own, curved, and no dataclass."""

    @property
    def memory(self) -> Mapping[str, Row]:
        return {}

    def rates(self) -> tuple[CurvedMode, ...]:
        force = 1.5 * tanh(30.0 * symbol("v"))
        return tuple(CurvedMode(name, "slip", side, force, (turn,)) for name, side, turn in either_side())


class Unchecked(Formula):
    """A formula whose text nobody looked at."""

    def __post_init__(self) -> None:
        pass

    def __call__(self, speed: Expression) -> Expression:
        return 1.1 + 0.0 * speed


def law_of(text: str) -> ss.laws.FrictionCurve:
    return ss.laws.FrictionCurve(Formula(text))


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_a_formula_is_arithmetic_or_refused(text: str) -> None:
    with pytest.raises(ModelError) as refusal:
        Formula(text)
    assert str(refusal.value).isprintable()


@pytest.mark.parametrize("text", HONEST)
def test_a_formula_keeps_the_text_that_its_tree_gives(text: str) -> None:
    kept = Formula(text)
    assert Formula(kept.text) == kept
    for speed in (0.0, 0.01, 0.7):
        assert ss.laws.FrictionCurve(kept).friction(speed) == law_of(kept.text).friction(speed)
    assert Formula(" ( (1.5) + v*2. ) ").text == "1.5 + v * 2.0"
    deep = "+".join(["v"] * DEEPEST)
    assert ss.laws.FrictionCurve(Formula(deep)).friction(1.0) == DEEPEST
    with pytest.raises(ModelError, match="deep"):
        Formula(deep + "+v")


@pytest.mark.parametrize("text", ["1.1 + (0.001 - v)**0.5", "9.1 + log(0.01 - v)", "1 + exp(1e4 * v)", "1 / (0.1 - v)"])
def test_a_formula_without_a_value_at_some_speed_is_one_sentence(text: str) -> None:
    law = law_of(text)
    with pytest.raises(ModelError, match=r"has no value at .*v = "):
        law.friction(0.1 if "/" in text else 1.0)
    with pytest.raises(ModelError, match=r"has no value at .*v = "):
        ss.laws.export_law(law, format="c")  # its test vector asks there


def built(text: str, folder: Path) -> Path:
    if CC is None:
        pytest.skip("no C compiler on this machine (cc, gcc or clang)")
    source, test = folder / "friction.c", folder / "friction_test"
    source.write_text(text)
    run = subprocess.run([CC, *STRICT, "-DFRICTION_TEST", "-o", test, source, "-lm"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return test


@pytest.mark.parametrize("law", [*map(law_of, HONEST), Rubber(), Fluid()], ids=[*HONEST, "linear", "curved"])
def test_c_of_a_law_passes_its_vector_under_the_sanitizers(law: object, tmp_path: Path) -> None:
    test = built(ss.laws.export_law(law, format="c"), tmp_path)  # type: ignore[arg-type]
    run = subprocess.run([test], capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    assert re.fullmatch(r"0 of \d+ wrong\n", run.stdout)
    assert sorted(os.listdir(tmp_path)) == ["friction.c", "friction_test"]


@pytest.mark.parametrize("format", FORMATS)
def test_what_slips_past_a_formula_stays_text_in_every_format(format: str, tmp_path: Path) -> None:
    """The second wall: a text that no formula lets in, put where one stands, is no code of the file either."""
    formula = Unchecked(FOREIGN + " --> <evil/> \u2028 \x07")
    text = ss.laws.export_law(ss.laws.FrictionCurve(formula), format=format)
    assert "\x07" not in text
    assert format == "toml" or "\u2028" not in text  # a string of TOML may hold it
    if format == "c":
        test = built(text, tmp_path)
        assert subprocess.run([test], cwd=tmp_path, check=False).returncode == 0
        assert not (tmp_path / "harm").exists()
    elif format == "python":
        names: dict[str, object] = {}
        exec(compile(text, "friction", "exec"), names)
        assert set(names) - {"__builtins__"} == {"friction"}
    elif format == "toml":
        assert set(tomllib.loads(text)["law"]) == {"name", "curve"}
    elif format == "mujoco":
        assert [part.tag for part in ElementTree.fromstring(text)] == ["custom"]
    else:
        remark = {"modelica": "//", "simulink": "%"}[format]
        assert not [line for line in text.splitlines() if "constructor" in line and not line.startswith(remark)]


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("law", [Rubber(), Fluid()], ids=["linear", "curved"])
def test_a_law_of_ones_own_is_exported_or_refused_in_a_sentence(law: object, format: str) -> None:
    if format == "toml":
        with pytest.raises(ModelError, match="a system's file names one of"):
            ss.laws.export_law(law, format=format)  # type: ignore[arg-type]
        return
    text = ss.laws.export_law(law, format=format)  # type: ignore[arg-type]
    assert ("1.25" if isinstance(law, Rubber) else "30.0") in text
    if format == "mujoco":
        named = {part.get("name"): part.get("data") for part in ElementTree.fromstring(text).iter("text")}
        assert named == ({"Rubber_called": 'tyre "*/ --> \\ end'} if isinstance(law, Rubber) else {})


@pytest.mark.parametrize("law", [Rubber(), Fluid()], ids=["linear", "curved"])
def test_python_of_a_law_of_ones_own_has_its_friction(law: Rubber | Fluid) -> None:
    names: dict[str, Any] = {}
    exec(compile(ss.laws.export_law(law, format="python"), "friction", "exec"), names)
    contact = names["Friction"](0.0, 0.02)
    wanted = 1.25 if isinstance(law, Rubber) else 1.5 * math.tanh(0.6)
    assert contact.step(0.0, 0.02, 1e-3, **({"hold": 0.0} if isinstance(law, Rubber) else {})) == pytest.approx(wanted)


def test_a_law_that_only_bears_the_name_of_another_has_its_own_formula() -> None:
    stranger = dataclasses.make_dataclass("Coulomb", [], bases=(Rubber,), frozen=True)()
    first = ss.laws.export_law(stranger, format="simulink").splitlines()[0]
    assert "kinetic" not in first
    assert "1.25" in first


COSTLIER = 20.0  # times a plain formula, where the machine is slow: they take up to 25 times as long, 9 s here
COSTLY = [
    "1+" + "*".join(["exp(v/(1+v))"] * 22),
    "1+" + "*".join(f"exp(v/({k}+v))" for k in range(1, 20)),
    "1+" + "".join(f"tanh({k}+" for k in range(1, 24)) + "v" + ")" * 23,
    "1+" + "+".join(f"asinh(v/{k})" for k in range(1, 22)),
]


@pytest.fixture(scope="module")
def plain_seconds(tmp_path_factory: pytest.TempPathFactory) -> float:
    """Processor time that a plain formula takes to be compiled on this machine, however slow it is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled, "_root", lambda: tmp_path_factory.mktemp("plain"))
        drive = ss.drives.HarmonicBase(1e-3, frequency=1.0)
        table = tape(ss.Oscillator(mass=1.0, stiffness=4.0, law=law_of("1+exp(-v)"), drive=drive))
        began = time.process_time()
        model_of(table, 1e-12)
        return time.process_time() - began


@pytest.mark.parametrize("text", COSTLY, ids=range(len(COSTLY)))
def test_no_formula_is_compiled_for_long(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plain_seconds: float
) -> None:
    monkeypatch.setattr(compiled, "_root", lambda: tmp_path)
    drive = ss.drives.HarmonicBase(1e-3, frequency=1.0)
    table = tape(ss.Oscillator(mass=1.0, stiffness=4.0, law=law_of(text), drive=drive))
    began = time.process_time()
    model_of(table, 1e-12)
    assert time.process_time() - began < max(SECONDS, COSTLIER * plain_seconds)


def test_a_hostile_file_is_one_sentence_and_makes_nothing(tmp_path: Path) -> None:
    changed = FOREIGN.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    (tmp_path / "slider.toml").write_text(
        f'system = {{ mass = 1, stiffness = 4 }}\nlaw = {{ name = "FrictionCurve", curve = "{changed}" }}\n'
    )
    outcome = civil(program("simulate", "slider.toml", folder=tmp_path))
    assert outcome.code == 2
    assert sorted(os.listdir(tmp_path)) == ["slider.toml"]


def test_generated_code_is_kept_for_the_latest_systems_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "_root", lambda: tmp_path)
    monkeypatch.setattr(compiled, "KEPT", 4)
    monkeypatch.setattr(compiled, "IN_USE", 0.0)
    first = compiled.generated("number = 0\n")
    Path(first.__file__ or "").with_suffix(".series-3.py311.nbi").write_text("what numba keeps beside it")
    for number in range(1, 12):
        compiled.generated(f"number = {number}\n")
        assert compiled.generated("number = 5\n").number == 5  # used again and again: it stays
    held = {path.name for path in tmp_path.rglob("generated_*.*")}
    assert len(list(tmp_path.iterdir())) <= 5, "what is pruned is pruned before the next is added"
    assert Path(compiled.generated("number = 5\n").__file__ or "").name in held
    assert not [name for name in held if name.endswith(".nbi")]
    assert compiled.generated("number = 0\n").number == 0


def test_what_was_used_this_minute_is_not_pruned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "_root", lambda: tmp_path)
    monkeypatch.setattr(compiled, "KEPT", 1)
    for number in range(5):
        compiled.generated(f"number = {number}\n")
    assert len(list(tmp_path.iterdir())) == 5
