"""A mass that rubs as a functional mock-up unit, loaded, validated and run by FMPy, against the exact engine."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip.cli.program import main
from stickslip.errors import ModelError
from stickslip.laws import c_code
from test_export import LAWS

RIG = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.5}
OUTPUTS = ["x", "v", "friction", "acceleration", "mode"]
REFUSED = ("RateState", "slip law", "TimeDelay")
KINDS = ("Coulomb", "Tabulated", "Stribeck", "ElastoSlip", "LuGre", "InSeries")  # rigid, compliant, curved
SHORT = [pytest.param(name, marks=() if name in KINDS else pytest.mark.soak) for name in LAWS if name not in REFUSED]


def unit(law: Any, folder: Path, **values: Any) -> Path:
    if c_code.compiler() is None:
        pytest.skip("no C compiler on this machine (cc, gcc or clang)")
    return ss.laws.export_fmu(law, folder / "slider.fmu", **{**RIG, **values})


def run(path: Path, kind: str, **settings: Any) -> Any:
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: it is in the extra dev")
    chosen = {"output_interval": 1e-3, "relative_tolerance": 1e-8, "record_events": False, **settings}
    return fmpy.simulate_fmu(str(path), fmi_type=kind, output=OUTPUTS, **chosen)


@pytest.mark.parametrize("name", SHORT)
def test_a_unit_moves_as_the_engine_does(name: str, tmp_path: Path) -> None:
    """On a belt, from rest, it sticks and slips. Co-simulation steps to 1e-10, FMPy's CVode to 1e-8, as asked."""
    validation = pytest.importorskip("fmpy.validation", reason="FMPy is not installed: it is in the extra dev")
    path = unit(LAWS[name], tmp_path)
    assert validation.validate_fmu(str(path)) == []
    system = ss.Oscillator(**RIG, law=LAWS[name], drive=ss.drives.Belt(0.01))
    record = ss.simulate(system, duration=0.6, start={"x": 0.0, "v": 0.0}).record(fs=1000)
    for kind, near in (("CoSimulation", 1e-7), ("ModelExchange", 2e-5)):
        told = run(path, kind, stop_time=0.6, start_values={"face_speed": 0.01})
        assert np.abs(told["x"] - record["x"]).max() < near * np.ptp(record["x"])
        apart = told["friction"] - record["friction"]
        assert np.sqrt(np.mean(apart**2)) < 10 * near * np.abs(record["friction"]).max()


@pytest.mark.parametrize(("damper", "near"), [("ground", 5e-6), ("base", 3e-5)])
def test_a_unit_follows_the_base_that_a_tool_moves(damper: str, near: float, tmp_path: Path) -> None:
    """Within a step h of 0.1 ms z goes on by its rate: off by z'' h^2/2 at its end, 5e-6 of its amplitude A.

    A damper on the base has the rate itself, which is held: c A w^2 h/2 is 1e-5 of the spring's force.
    """
    law, w, h = LAWS["Stribeck"], 10 * np.pi, 1e-4  # a power of the speed is no number on its other side
    system = ss.Oscillator(**RIG, damper=damper, law=law, drive=ss.drives.HarmonicBase(2e-3, frequency=5.0))
    record = ss.simulate(system, duration=0.5).record(fs=1 / h)
    t, z = record.time, record["z"]
    assert np.allclose(z, 2e-3 * np.cos(w * t), atol=1e-12)
    rate = -2e-3 * w * np.sin(w * t)
    moved = np.array([*zip(t, 0 * t, z, rate, strict=True)], dtype=[(k, float) for k in INPUTS])
    begin = {"x": record["x"][0], "v": record["v"][0]}
    told = run(
        unit(law, tmp_path, damper=damper),
        "CoSimulation",
        stop_time=0.5,
        input=moved,
        start_values=begin,
        output_interval=h,
    )
    assert np.abs(told["x"] - record["x"]).max() < near * np.ptp(record["x"])


INPUTS = ("time", "force", "z", "z_rate")


def test_a_push_below_static_friction_moves_nothing_and_one_above_does(tmp_path: Path) -> None:
    """Without a spring: x = (F - f_k) t^2 / 2m once it has broken away, and rest where the push goes."""
    path = unit(ss.laws.Coulomb(1.0, static=1.5), tmp_path, mass=2.0, stiffness=0.0, damping=0.0, turning=True)
    pushes = [(0.0, 1.4), (0.5, 1.4), (0.5, 2.0), (1.0, 2.0), (1.0, 0.0), (3.0, 0.0)]
    told = run(
        path,
        "CoSimulation",
        stop_time=3.0,
        input=np.array([(t, f, 0.0, 0.0) for t, f in pushes], dtype=[(k, float) for k in INPUTS]),
        output_interval=0.25,
    )
    assert told["x"][:3] == pytest.approx(0.0, abs=1e-15)
    assert told["friction"][:2] == pytest.approx(1.4)
    # 0.5 s with 0.5 m/s^2, then as long with -0.5 m/s^2
    assert told["x"][2:8] == pytest.approx([0.0, 1 / 64, 4 / 64, 7 / 64, 8 / 64, 8 / 64], abs=1e-12)
    assert told["v"][-1] == 0.0


def test_what_a_unit_can_not_hold_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, why in (("RateState", "too small"), ("slip law", "too small"), ("TimeDelay", "lag ago")):
        with pytest.raises(ModelError, match=why):
            ss.laws.export_fmu(LAWS[name], tmp_path / "x.fmu", **RIG)
    rough = ss.laws.RoughSurface(LAWS["Coulomb"], share=0.03, length=1e-4, span=1e-3)
    with pytest.raises(ModelError, match="no formula"):
        ss.laws.export_fmu(rough, tmp_path / "x.fmu", **RIG)
    with pytest.raises(ModelError, match="positive"):
        ss.laws.export_fmu(LAWS["Coulomb"], tmp_path / "x.fmu", mass=0.0)
    with pytest.raises(ModelError, match="ground or the base"):
        ss.laws.export_fmu(LAWS["Coulomb"], tmp_path / "x.fmu", mass=1.0, damper="sky")
    monkeypatch.setattr(c_code, "compiler", lambda: None)
    with pytest.raises(ModelError, match=r"no C compiler .* sources_only=True"):
        ss.laws.export_fmu(LAWS["Coulomb"], tmp_path / "x.fmu", mass=1.0)
    assert not [*tmp_path.iterdir()]


def test_a_file_without_the_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"no FILE\.fmu"):
        ss.laws.export_fmu(ss.laws.Coulomb(1.0), tmp_path / "unit", mass=1.0, sources_only=True)


def test_the_same_law_gives_the_same_sources(tmp_path: Path) -> None:
    """A name that C can not bear becomes one; nothing in the file tells when it was written."""
    paths = [tmp_path / place / "3 sliders.fmu" for place in "ab"]
    for path in paths:
        path.parent.mkdir()
        ss.laws.export_fmu(LAWS["LuGre"], path, **RIG, sources_only=True)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with zipfile.ZipFile(paths[0]) as file:
        assert file.namelist()[2] == "sources/model_3_sliders.c"


def test_a_unit_is_kept_and_taken_back(tmp_path: Path) -> None:
    """A tool that goes back to a state finds the same motion again, byte for byte."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: it is in the extra dev")
    path = str(unit(LAWS["LuGre"], tmp_path))
    description, folder = fmpy.read_model_description(path), fmpy.extract(path)
    made = fmpy.instantiate_fmu(folder, description, "CoSimulation")
    made.enterInitializationMode()
    made.setFloat64([7, 9], [0.01, 0.2])
    made.exitInitializationMode()
    made.enterStepMode()
    made.doStep(0.0, 0.01)
    kept = made.serializeFMUState(made.getFMUState())
    ends = []
    for _ in range(2):
        made.setFMUState(made.deserializeFMUState(kept))
        made.doStep(0.01, 0.02)
        ends.append(made.getFloat64([8, 9, 10, 11]))
    made.terminate()
    made.freeInstance()
    assert ends[0] == ends[1]


def test_the_command_writes_a_unit(tmp_path: Path) -> None:
    if c_code.compiler() is None:
        pytest.skip("no C compiler on this machine (cc, gcc or clang)")
    out, unit_file = tmp_path / "out", tmp_path / "fd.fmu"
    words = ["simulate", "FD-4", "--duration", "1", "--fmu", str(unit_file), "--output", str(out)]
    told = CliRunner().invoke(main, words)
    assert told.exit_code == 0, told.output
    assert "without the drive: force and z are its inputs; to start as here, set x = 1.25 in it" in told.output
    told = run(unit_file, "CoSimulation", stop_time=1.0, start_values={"x": 1.0})
    assert told["x"][0] == 1.0
    several = CliRunner().invoke(main, ["simulate", "MC-1", "--fmu", str(unit_file), "--json"])
    assert several.exit_code == 2
    assert "one mass" in several.output
