"""What the folder of a fit holds."""

from __future__ import annotations

from pathlib import Path

import stickslip as ss


def test_the_law_is_written_for_other_programs(tmp_path: Path) -> None:
    record = ss.friction_force(ss.datasets.demo(), mass=2.42, stiffness=2310)
    found = ss.fit_curve(record, curve="coulomb")
    assert found.law is not None
    folder = ss.publish_fit(found, folder=tmp_path / "fit", records=[record])
    written = {file.name: file.read_text(encoding="utf-8") for file in (folder / "law").iterdir()}
    forms = ("toml", "python", "c", "mujoco", "modelica", "simulink")
    assert sorted(written.values()) == sorted(ss.export_law(found.law, format=form) for form in forms)
    assert "FRICTION_TEST" in written["friction.c"]


def test_a_curve_without_a_law_has_none(tmp_path: Path) -> None:
    record = ss.friction_force(ss.datasets.demo(), mass=2.42, stiffness=2310)
    found = ss.fit_curve(record, curve="asymmetric")
    folder = ss.publish_fit(found, folder=tmp_path / "fit", records=[record])
    assert found.law is None
    assert not (folder / "law").exists()
