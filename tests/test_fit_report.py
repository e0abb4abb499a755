"""What the folder of a fit holds, and what the command that makes it says."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.program import main
from stickslip.cli.records import default_folder
from stickslip.units import parse_range

RIG = ["--mass", "2.42", "--stiffness", "2310"]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def fit(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["fit", *arguments])


def write(path: str, fs: float = 1000.0, **columns: np.ndarray) -> None:
    """A file of columns named with their units, as in x_mm."""
    time = np.arange(len(next(iter(columns.values())))) / fs
    heads = ",".join(["t [s]", *(f"{name.partition('_')[0]} [{name.partition('_')[2]}]" for name in columns)])
    np.savetxt(path, np.column_stack([time, *columns.values()]), delimiter=",", header=heads, comments="", fmt="%.9g")


@pytest.mark.figures
def test_the_law_is_written_for_other_programs(tmp_path: Path) -> None:
    record = ss.friction_force(ss.datasets.demo(), mass=2.42, stiffness=2310)
    found = ss.fit_curve(record, curve="coulomb")
    assert found.law is not None
    folder = ss.publish(found, folder=tmp_path / "fit", record=record)
    written = {file.name: file.read_text(encoding="utf-8") for file in (folder / "law").iterdir()}
    forms = ("toml", "python", "c", "mujoco", "modelica", "simulink")
    for form in forms:
        assert any(ss.laws.export_law(found.law, format=form).strip() in text for text in written.values()), form
    assert all(text.endswith("\n") for text in written.values())
    assert "FRICTION_TEST" in written["friction.c"]


def test_a_fit_leaves_the_results_of_an_analysis_alone() -> None:
    groups = [[Path("runs/rig.csv")]]
    assert default_folder(groups) == Path("rig-stickslip")
    assert default_folder(groups, "fit") == Path("rig-fit")
    assert default_folder(groups * 2, "fit") == Path("comparison-fit")


def test_the_fitted_law_can_be_simulated_as_it_was_written(tmp_path: Path) -> None:
    record = ss.friction_force(ss.datasets.demo(), mass=2.42, stiffness=2310)
    found = ss.fit_curve(record, curve="coulomb")
    folder = ss.publish(found, folder=tmp_path / "fit", record=record)
    case = ss.systems.read_system(folder / "law" / "law.toml")
    assert case.system.law == found.law
    assert (case.system.mass, case.system.stiffness, case.duration) == (2.42, 2310.0, record.duration)
    assert case.system.drive.frequency == pytest.approx(2.5, rel=0.01)
    assert case.system.drive.amplitude == pytest.approx(np.ptp(record["z"]) / 2, rel=0.05)
    run = ss.simulate(case.system, duration=2.0, start=case.start).record(fs=2000)
    again = ss.friction_loops(run.rows(1000, len(run))).level
    assert again.value == pytest.approx(found.parameters["kinetic"].value, rel=0.01)


def test_a_law_fitted_to_a_pull_is_written_with_the_pull(tmp_path: Path) -> None:
    t, rng = np.arange(4000) / 1000, np.random.default_rng(5)
    z = 0.003 + 2e-3 * t + 1e-6 * np.sin(60 * t) + rng.normal(0, 1e-6, t.size)
    v = 2e-3 * (1 + np.sin(40 * t))
    made = {"x": np.cumsum(v) / 1000, "v": v, "z": z, "friction": 1.1 + rng.normal(0, 0.01, t.size)}
    rig = ss.record.StatedRig("smoother", mass=2.42, stiffness=2310.0)
    record = dataclasses.replace(ss.Record.of(made, fs=1000), rig=rig)
    folder = ss.publish(ss.fit_curve(record, curve="coulomb"), folder=tmp_path / "fit", record=record)
    drive = ss.systems.read_system(folder / "law" / "law.toml").system.drive
    assert isinstance(drive, ss.drives.Ramp)
    assert drive.speed == pytest.approx(2e-3, rel=1e-3)


def test_the_load_of_the_settings_makes_a_force_of_a_coefficient(tmp_path: Path) -> None:
    t, rng = np.arange(4000) / 1000, np.random.default_rng(0)
    v = 0.1 * np.sin(2 * np.pi * t)
    told = {"v": v, "coefficient": 0.3 * np.sign(v) + rng.normal(0, 0.003, t.size)}
    record = ss.Record.of(told, fs=1000)
    step = ss.record.Step("read_record", {"files": [{"name": "run_250g.csv"}]}, "")
    record = dataclasses.replace(record, history=(*record.history, step))
    rig = ss.rig.rig_settings({"normal": {"*100g*": 9.0, "*250g*": "2.5 N"}})
    kinetic = ss.answers.fit_records([record], rig=rig, curve="coulomb")[0].parameters["kinetic"]  # type: ignore[union-attr]
    assert kinetic.unit == "N"
    assert kinetic.value == pytest.approx(0.75, rel=0.01)
    alone = ss.answers.fit_records([record], rig=ss.rig.rig_settings({}), curve="coulomb")[0].parameters["kinetic"]  # type: ignore[union-attr]
    assert alone.unit == "1"


def test_a_single_fitted_law_is_shown_and_written_too(tmp_path: Path) -> None:
    slider = ss.Oscillator(
        mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7)
    )
    rig = ss.Rig.perfect("x", "z").having("x", white=1e-6)
    record = rig.measure(ss.simulate(slider, duration=1.6), fs=2000, rng=1, start=0.8)
    found = ss.fit_law(record, slider.having(kinetic=1.0))
    assert [plate.name for plate in ss.summary(found).plates] == ["fit-1"]
    folder = ss.publish(found, folder=tmp_path / "fit", record=record)
    data = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    assert (data["law"], data["estimates"][0]["value"]) == ("Coulomb", found.law.kinetic)
    assert ss.systems.read_system(folder / "law" / "law.toml").system.law == found.law
    assert ss.summary(found, record=record).headline[0] == (
        f"The law Coulomb, fitted to x: kinetic {found.law.kinetic:.3f} N."
    )
    ahead = ss.fit_law(record, found.oscillator, free=(), intervals=False)
    assert "as it was given, predicts x" in ss.summary(ahead, record=record).headline[0]


def test_a_law_without_a_mass_says_what_it_lacks(tmp_path: Path) -> None:
    t = np.arange(8000) / 1000
    v = 0.1 * np.sin(2 * np.pi * t)
    record = ss.Record.of({"v": v, "friction": np.sign(v)}, fs=1000)
    folder = ss.publish(ss.fit_curve(record, curve="coulomb"), folder=tmp_path / "fit", record=record)
    file = folder / "law" / "law.toml"
    assert file.read_text(encoding="utf-8").startswith("# a law alone: to simulate it, add [system]")
    with pytest.raises(ss.errors.ModelError, match=r"law.toml holds a law alone; .* add \[system\]"):
        ss.systems.read_system(file)


def test_a_curve_without_a_law_has_none(tmp_path: Path) -> None:
    record = ss.friction_force(ss.datasets.demo(), mass=2.42, stiffness=2310)
    found = ss.fit_curve(record, curve="asymmetric")
    folder = ss.publish(found, folder=tmp_path / "fit", record=record)
    assert found.law is None
    assert not (folder / "law").exists()


def test_friction_is_found_from_the_mass_and_the_force() -> None:
    t = np.arange(12000) / 1000
    x, v = 0.1 * np.sin(2 * np.pi * t), 0.2 * np.pi * np.cos(2 * np.pi * t)
    force = -5 * (2 * np.pi) ** 2 * x + 4 * np.sign(v) + 3 * v + np.random.default_rng(0).normal(0, 0.05, t.size)
    write("robot.csv", x_m=x, force_N=force)
    result = fit("robot.csv", "--mass", "5", "--stiffness", "0", "--curve", "viscous", "--json")
    assert result.exit_code == 0, result.output
    found = {load["name"]: load for load in json.loads(result.stdout)["estimates"]}
    assert found["sliding friction"]["value"] == pytest.approx(4, rel=0.02)
    assert found["viscous friction"]["value"] == pytest.approx(3, rel=0.05)
    refused = fit("robot.csv", "--curve", "viscous")
    assert refused.exit_code == 1
    assert "neither friction nor a mass (the record has x, force)" in refused.stderr
    assert "--mass and --stiffness" in refused.stderr
    wrong = fit("robot.csv", "--channels", "x=x [m]", "--channels", "friction=force [N]", "--curve", "viscous")
    assert 'The friction does not follow the curve "viscous"' in wrong.stdout.replace("\n", " ")
    said = [line for line in wrong.stdout.splitlines() if line]
    assert len(set(said)) == len(said), "a reason stands once, not in each row of the table"


def test_what_is_asked_wrongly_is_said_before_it_is_read() -> None:
    write("a.csv", x_m=np.sin(0.01 * np.arange(2000)))
    write("b.csv", x_m=np.sin(0.01 * np.arange(2000)))
    for arguments, word in (
        (["a.csv", "--curve", "stribek"], "'stribeck'"),
        (["a.csv", "--curve", "coulomb", "--laws", "Coulomb"], "leave one out"),
        (["a.csv", "b.csv", "--curve", "coulomb"], "not to 2"),
    ):
        result = fit(*arguments)
        assert result.exit_code == 2, result.output
        assert word in result.stderr


def test_nothing_that_the_mass_makes_is_surer_than_it_was_weighed() -> None:
    """A mass off by two of its deviations takes the spring with it, which said a tenth of that."""
    rig = {"stiffness": 2310, "damping": 0.12}
    exact, weighed = (
        ss.answers.fit_records(
            [ss.datasets.demo()], rig=ss.rig.rig_settings({**rig, "mass": mass}), laws=["compliant"]
        )[0].fit  # type: ignore[union-attr]
        for mass in ("2.42 kg", "2.42 ± 0.05 kg")
    )
    for name, one in weighed.parameters.items():
        known = exact.parameters[name]
        share = 0.05 / 2.42 * abs(one.value) if one.unit in ("N", "N/m", "N s/m") else 0.0
        assert one.sd == pytest.approx(math.hypot(known.sd, share), rel=1e-6), name


def test_a_range_of_frequencies_is_read_with_its_units_or_refused() -> None:
    ss.write_record(ss.datasets.demo(), "demo.csv")
    for words in ("500-8000", "5", "1:2:3", "5:8 mm", "5:nan"):
        for command in ("wavelet", "squeak"):
            result = CliRunner().invoke(main, [command, "demo.csv", "--frequencies", words])
            assert result.exit_code == 2, result.output
            assert f"'{words}' is no range" in result.stderr
    assert parse_range("0.5 kHz:8000", "Hz") == (500.0, 8000.0)


def test_a_curve_is_not_fitted_to_several_records_nor_a_law_to_several_masses() -> None:
    demo, rig = ss.datasets.demo(), ss.rig.rig_settings({"mass": 2.42, "stiffness": 2310})
    with pytest.raises(ss.errors.ModelError, match="a curve and 2 records"):
        ss.answers.fit_records([demo, demo], rig=rig, curve="coulomb")
    with pytest.raises(ss.errors.ModelError, match="no mass and no stiffness"):
        ss.answers.fit_records([demo], rig=ss.rig.rig_settings({}), laws=["Coulomb"])
    with pytest.raises(ss.errors.ModelError, match="several masses"):
        ss.answers.fit_records([demo], rig=rig, system=ss.squeak.squeak_rig())


def test_what_the_settings_state_goes_before_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[ss.Oscillator] = []
    monkeypatch.setattr("stickslip.answers.fits.compare_laws", lambda records, system, **_: asked.append(system))
    written = ss.Oscillator(
        mass=1.0, stiffness=9.0, law=ss.laws.Coulomb(1.0), drive=ss.drives.HarmonicBase(1e-3, frequency=2.5)
    )
    other = {"mass": 2.42, "damping": 0.0, "damper": "base", "contact": "base"}
    for settings, drive in (
        ({}, written.drive),
        (other, written.drive),
        (other, ss.drives.Release()),
        ({"mass": 2.42}, ss.drives.Belt(0.01)),
    ):
        system = written.having(damping=0.3, drive=drive)
        ss.answers.fit_records([ss.datasets.demo()], rig=ss.rig.rig_settings(settings), system=system)
        for name in ("mass", "damping", "damper"):
            assert getattr(asked[-1], name) == settings.get(name, getattr(system, name))
        assert asked[-1].stiffness == 9.0
        contact = getattr(drive, "contact", None)
        assert getattr(asked[-1].drive, "contact", None) == settings.get("contact", contact)
    with pytest.raises(ss.errors.ModelError, match="contact = 'base' under a Belt"):
        ss.answers.fit_records(
            [ss.datasets.demo()], rig=ss.rig.rig_settings(other), system=written.having(drive=ss.drives.Belt(0.01))
        )


def test_laws_are_not_fitted_without_motion() -> None:
    write("pull.csv", force_N=np.sin(0.01 * np.arange(2000)))
    result = fit("pull.csv", *RIG, "--laws", "Coulomb")
    assert result.exit_code == 1
    assert "no motion of the mass (the record has force)" in result.stderr
    assert '--channels "x=COLUMN [mm]"' in result.stderr


def test_a_coefficient_of_friction_is_accepted_and_named() -> None:
    t = np.arange(8000) / 1000
    v = 0.1 * np.sin(2 * np.pi * t)
    write("shear.csv", v=v, mu=0.6 * np.sign(v) + np.random.default_rng(0).normal(0, 0.01, t.size))
    units = ["--units", "v=m/s", "--channels", "v=v"]
    refused = fit("shear.csv", *units, "--channels", "friction=mu [1]", "--curve", "coulomb")
    assert "coefficient=COLUMN [1]" in refused.stderr
    found = fit("shear.csv", *units, "--channels", "coefficient=mu [1]", "--curve", "coulomb")
    assert found.exit_code == 0, found.output
    assert "0.600" in found.stdout
    assert "mN" not in found.stdout


def test_a_clock_with_gaps_is_mended_at_the_first_try() -> None:
    t = np.arange(8000) / 1000
    v = 0.1 * np.sin(2 * np.pi * t)
    lines = [f"{a:.3f},{b:.6g},{c:.3g}" for a, b, c in zip(t, v, np.sign(v), strict=True)]
    lost = set(range(100, 112)) | set(range(3000, 3012))
    rows = ["t [s],v [m/s],friction [N]", *(line for i, line in enumerate(lines) if i not in lost)]
    Path("gaps.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    refused = fit("gaps.csv", "--curve", "coulomb")
    assert "fill the gaps with --repair gaps,missing" in refused.stderr
    assert fit("gaps.csv", "--curve", "coulomb", "--repair", "gaps,missing").exit_code == 0
