"""A law is one file and one line: engine, sweeps, fits, files, exports, lab and pages then know it."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip.cli.program import main
from stickslip.lab.worker import catalog
from stickslip.laws.base import Exit, Mode, Rigid
from stickslip.laws.curved import CurvedMode, Sliding, either_side, symbol, tanh
from stickslip.laws.export import FORMATS
from stickslip.laws.guessing import RIGID, Hypothesis, Observed, registered
from stickslip.parameters import parameter, parametric, unit

RIG: dict[str, Any] = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.12}


@parametric
class AsymmetricCoulomb(Rigid):
    """Rigid dry friction with a level of its own in each direction.

    Examples
    --------
    >>> AsymmetricCoulomb(1.2, back=0.8).forward
    1.2
    """

    label = "Asymmetric Coulomb"
    formula = "f = forward while v > 0, f = -back while v < 0"

    forward: float = parameter("N", "sliding friction forward", positive=True)
    back: float = parameter("N", "sliding friction back", positive=True, note="against motion to negative x")

    @classmethod
    def hypotheses(cls) -> tuple[Hypothesis, ...]:
        """A level in each direction."""
        return (Hypothesis("asymmetric", RIGID, cls.guesses),)

    @classmethod
    def guesses(cls, seen: Observed) -> list[AsymmetricCoulomb]:
        """The friction of fast sliding, way by way."""
        fast = np.abs(seen.speed) > 0.3 * seen.fastest
        ways = fast & (seen.speed > 0), fast & (seen.speed < 0)
        return [cls(*(float(np.median(np.abs(seen.friction[way]))) for way in ways))]

    def modes(self) -> tuple[Mode, ...]:
        """Slip on either side, and stick."""
        held = Exit({"f": 1.0, "1": -self.forward}, "forward"), Exit({"f": -1.0, "1": -self.back}, "back")
        return (
            Mode("back", "slip", -1, {"1": -self.back}, (Exit({"v": 1.0}, "stuck"),)),
            Mode("stuck", "stick", 0, None, held),
            Mode("forward", "slip", 1, {"1": self.forward}, (Exit({"v": -1.0}, "stuck"),)),
        )


@parametric
class Knee(Sliding):
    """A level in each direction, reached over a rounded knee; it says nothing of how it is searched."""

    label = "Asymmetric, with a knee"
    formula = "f = forward tanh(v/knee) while v > 0, back tanh(v/knee) while v < 0"

    forward: float = parameter("N", "sliding friction forward", positive=True)
    back: float = parameter("N", "sliding friction back", positive=True)
    knee: float = parameter("m/s", "speed of the knee", positive=True)

    def rates(self) -> tuple[CurvedMode, ...]:
        """Slip on either side."""
        rounded = tanh(symbol("v") / self.knee)
        return tuple(
            CurvedMode(name, "slip", side, (self.forward if side > 0 else self.back) * rounded, (turn,), {})
            for name, side, turn in either_side()
        )


LAW = AsymmetricCoulomb(1.2, back=0.8)
KNEE = Knee(1.2, 0.8, knee=5e-3)
FILE = """
system = { mass = 2.42, stiffness = 2310.0, damping = 0.12 }
law = { name = "AsymmetricCoulomb", forward = "1.2 N", back = "800 mN" }
drive = { name = "HarmonicBase", amplitude = "1.1 mm", frequency = 8.7 }
"""


@pytest.fixture(autouse=True)
def line_in_the_register(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a line in ``laws/__init__.pyi`` does for a law of the package."""
    for law in (AsymmetricCoulomb, Knee):
        monkeypatch.setitem(registered(), law.__name__, law)
        monkeypatch.setattr(ss.laws, law.__name__, law, raising=False)


def slider(law: Any = LAW) -> ss.Oscillator:
    return ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7), **RIG)


def measured(law: Any = LAW) -> ss.Record:
    rig = ss.Rig.perfect("x", "z", "load").having("x", white=1e-6).having("z", white=1e-6).having("load", white=2e-3)
    return rig.measure(ss.simulate(slider(law), duration=2.5, rtol=1e-9), fs=2500, rng=3, start=2.0)


def test_its_parameters_are_checked_and_told() -> None:
    with pytest.raises(ss.errors.ModelError, match=r"back = -1\.0 N; back is finite and positive"):
        AsymmetricCoulomb(1.0, back=-1.0)
    with pytest.raises(ss.errors.ModelError, match="forward is a number"):
        AsymmetricCoulomb("1 N", back=1.0)
    assert "back : float\n    Sliding friction back [N]; against motion to negative x." in (
        AsymmetricCoulomb.__doc__ or ""
    )
    with pytest.raises(ss.errors.ModelError, match="forward is a number"):
        AsymmetricCoulomb([1.0, 2.0], back=1.0)
    assert AsymmetricCoulomb(np.array(1.2), back=0.8) == LAW
    assert unit(slider(), "law.back") == "N"


def test_it_is_simulated_exactly() -> None:
    """Half swings about where the friction of their direction would hold the spring."""
    free = ss.Oscillator(mass=1.0, stiffness=4.0, law=AsymmetricCoulomb(0.4, back=1.0))
    run = ss.simulate(free, duration=10, start={"x": 1.25})
    assert run.state(10)["x"] == pytest.approx(-0.05, abs=1e-12)


@pytest.mark.parametrize("engine", ["serial", "threads"])
def test_it_is_swept_on_every_engine(engine: str) -> None:
    atlas = ss.sweep(slider(), {"back": [0.8, 1.0]}, measures=["amplitude"], settle=20, cycles=5, engine=engine)
    for back in (0.8, 1.0):
        orbit = ss.steady_state(slider().having(back=back))
        assert float(atlas.amplitude.sel(back=back)) == pytest.approx(orbit.amplitude, rel=1e-6)
    assert atlas.back.attrs["units"] == "N"


def test_it_is_fitted() -> None:
    fit = ss.fit_law(measured(), slider(AsymmetricCoulomb(1.0, back=1.0)))
    own = {name: each for name, each in fit.parameters.items() if name in ("forward", "back")}
    assert {name: each.name for name, each in own.items()} == {
        "forward": "sliding friction forward",
        "back": "sliding friction back",
    }
    assert {each.unit for each in own.values()} == {"N"}
    # an offset of x is the same as a difference between the two, so that the records tell their mean
    assert (fit.law.forward + fit.law.back) / 2 == pytest.approx(1.0, rel=5e-3)


def test_it_is_compared_by_its_name() -> None:
    comparison = ss.compare_laws(measured(), slider(ss.laws.Coulomb(1.0)), laws=["Coulomb", "asymmetric"])
    assert comparison.family == "rigid"
    assert "asymmetric" in comparison.kept
    assert "that of a rigid contact" in comparison.verdict
    with pytest.raises(ss.errors.ModelError, match=r"laws are .*asymmetric"):
        ss.compare_laws(measured(), slider(), laws=["nothing"])


@pytest.mark.parametrize(
    ("law", "values"),
    [
        (ss.laws.Dahl(1.1, 2e4), {"kinetic": 1.1, "law.stiffness": 2e4}),
        (ss.laws.PositionLoad(1.0, 100.0), {"kinetic": 1.0, "gradient": 100.0}),
    ],
    ids=lambda value: type(value).__name__,
)
@pytest.mark.parametrize("by", [type, lambda law: type(law).__name__.lower(), repr], ids=["class", "name", "values"])
def test_one_that_says_nothing_of_itself_is_found_by_its_units(law: Any, values: dict[str, float], by: Any) -> None:
    """Measured by a load cell beside x and z; of class, name or values each is enough."""
    rig = ss.Rig.perfect("x", "z", "load").having("x", white=1e-6).having("load", white=2e-3)
    record = rig.measure(ss.simulate(slider(law), cycles=12), fs=1000, rng=1, start=0.7)
    asked = law if by is repr else by(law)
    comparison = ss.compare_laws(record, slider(ss.laws.Coulomb(1.0)), laws=["Coulomb", asked])
    assert comparison.kept == (type(law).__name__,)
    for name, value in values.items():
        estimate = comparison.fit.parameters[name]
        assert estimate.value == pytest.approx(value, rel=0.01), name
        assert estimate.interval[0] < value < estimate.interval[1], name


def test_a_law_of_other_laws_needs_its_values() -> None:
    with pytest.raises(ss.errors.ModelError, match=r"InSeries of which no law is known.*give the law with its values"):
        ss.compare_laws(measured(), slider(), laws=["InSeries"])


@pytest.mark.parametrize("law", [Knee, "Knee", Knee(1.0, 1.0, knee=1e-2)], ids=["class", "name", "instance"])
def test_a_law_that_guesses_nothing_is_fitted(law: Any) -> None:
    fit = ss.fit_law(measured(KNEE), slider(ss.laws.Coulomb(1.0)), law=law, intervals=False)
    assert max(fit.misfit.values()) < 1.1
    for name, true in vars(KNEE).items():
        assert getattr(fit.law, name) == pytest.approx(true, rel=1e-2)


def test_a_law_that_guesses_nothing_is_compared_by_its_class() -> None:
    comparison = ss.compare_laws(measured(KNEE), slider(ss.laws.Coulomb(1.0)), laws=["Coulomb", Knee])
    assert (comparison.law, comparison.family) == ("Knee", "Knee")
    assert comparison.fit.parameters["knee"].includes(KNEE.knee)


def test_a_law_that_explains_nothing_more_does_not_lead_alone() -> None:
    """Two levels where there is one, and a knee where there is none: the simpler law stays."""
    record = measured(ss.laws.Coulomb(1.0))
    for law in (Knee, AsymmetricCoulomb):
        comparison = ss.compare_laws(record, slider(ss.laws.Coulomb(1.0)), laws=["Coulomb", law])
        assert "Coulomb" in comparison.kept


def test_it_is_fitted_and_tried_on_another_record_from_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("one", "other"):
        ss.write_record(measured(KNEE), f"{name}.csv")
    constants = [word for name, value in RIG.items() for word in (f"--{name}", str(value))]
    result = CliRunner().invoke(
        main, ["fit", "one.csv", *constants, "--laws", "Coulomb, knee", "--output", "fit", "--json"]
    )
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["law"] == "Knee"
    result = CliRunner().invoke(main, ["predict", "fit", "other.csv", "--no-plain", "--json"])
    assert result.exit_code == 0, result.output
    predicted = ss.answers.predict(ss.read_record("other.csv"), ss.answers.read_fitted(Path("fit")), plain=False)
    assert predicted.parts[0].follows["x"] > 99.5


def test_it_is_read_and_written_in_every_form(tmp_path: Path) -> None:
    file = tmp_path / "slider.toml"
    file.write_text(FILE, encoding="utf-8")
    case = ss.systems.read_system(file)
    assert case.system.law == LAW
    file.write_text(ss.systems.export_system(case), encoding="utf-8")
    assert ss.systems.read_system(file).system == case.system
    assert ss.systems.read_system(json.loads(ss.systems.export_system(case, format="json"))).system == case.system
    program, _, _ = ss.systems.export_system(case, format="python").partition("result = ")
    (tmp_path / "slider.py").write_text(program, encoding="utf-8")
    assert runpy.run_path(str(tmp_path / "slider.py"))["case"].system == case.system
    with pytest.raises(ss.errors.ModelError, match=r"\[law\]: back = -1"):
        ss.systems.read_system(
            {"system": {"mass": 1, "stiffness": 4}, "law": {"name": "AsymmetricCoulomb", "forward": 1, "back": -1}}
        )


@pytest.mark.parametrize("format", FORMATS)
def test_it_is_exported_by_its_formula(format: str) -> None:
    assert AsymmetricCoulomb.formula in ss.laws.export_law(LAW, format=format)


def test_the_lab_has_a_form_for_it() -> None:
    offered, _ = catalog({}, None)
    form = offered["laws"]["AsymmetricCoulomb"]
    assert (form["label"], form["about"]) == (
        "Asymmetric Coulomb",
        "Rigid dry friction with a level of its own in each direction.",
    )
    assert form["parameters"][1] == {
        "name": "back",
        "label": "sliding friction back",
        "unit": "N",
        "words": "against motion to negative x",
    }


def test_the_pages_have_a_row_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "docs"))
    import law_table

    row = next(line for line in law_table.table().splitlines() if "AsymmetricCoulomb" in line)
    assert row == (
        "| `AsymmetricCoulomb` | Asymmetric Coulomb | `f = forward while v > 0, f = -back while v < 0` | "
        "`forward` [N], `back` [N] |"
    )
