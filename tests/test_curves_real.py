"""Friction curves of real rigs, measured by other people, against what they published."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss

Sets = Callable[[str], Path]

SYMMETRIC = {"inertia": 95.1089, "viscous": 203.5034, "coulomb": 20.3935, "offset": -3.1648}
UNEVEN = {"viscous_forward": 166.706, "coulomb_forward": 20.144, "viscous_back": 240.424, "coulomb_back": 20.628}


def emps(dataset: Sets) -> ss.Record:
    channels = {"x": "qm [m]", "force": "vir * 35.1507 [N]"}
    return ss.read_record(dataset("emps") / "DATA_EMPS.mat", channels=channels, fs=1000.0)


@pytest.mark.parametrize(("symmetric", "published", "most"), [(True, SYMMETRIC, 0.0412), (False, UNEVEN, 0.0312)])
def test_emps_as_published(dataset: Sets, symmetric: bool, published: dict[str, float], most: float) -> None:
    regression = ss.cycle.regress_friction(emps(dataset), symmetric=symmetric)
    assert regression.residual <= most
    for name, value in published.items():
        assert getattr(regression, name).value == pytest.approx(value, rel=0.01)
        assert getattr(regression, name).includes(value)


def test_emps_by_its_curves(dataset: Sets) -> None:
    """The mass published, and the friction left of the force by it: sliding samples alone, away from reversals."""
    record = ss.friction_force(emps(dataset), mass=95.1089, stiffness=0)
    even = ss.fit_curve(record, curve="viscous").parameters
    assert even["kinetic"].includes(20.3935)
    assert even["viscous"].includes(203.5034)
    assert even["offset"].includes(-3.1648)
    fit = ss.fit_curve(record, curve="asymmetric")
    for name, published in (("viscous_forward", 166.706), ("viscous_back", 240.424)):
        assert fit.parameters[name].value == pytest.approx(published, rel=0.03)
    for name, published in (("kinetic_forward", 20.144), ("kinetic_back", 20.628)):
        assert fit.parameters[name].value == pytest.approx(published, rel=0.03)
        assert fit.parameters[name].includes(published)
    assert "static and" not in fit.status


@pytest.mark.parametrize(("law", "rows"), [("aging", 2500), ("slip", 2500), ("aging", 5184), ("slip", 5184)])
def test_basalt_after_a_step(dataset: Sets, law: str, rows: int) -> None:
    """a is about 0.009 and b as large; friction in shares of the load."""
    path = dataset("rate_state_step") / "velstep4_BRAVA_expb819_basalt.txt"
    record = ss.read_record(path, channels={"x": "Displ", "friction": "Friction [N]"}, rows=(665, 665 + rows))
    parameters = ss.fit_curve(record, curve=law).parameters
    assert parameters["direct"].value == pytest.approx(0.009, rel=0.05)
    assert abs(parameters["rate_dependence"].value) < 0.001
    assert parameters["rate_dependence"].includes(0.0)
    assert 4e-6 < parameters["distance"].value < 2e-5


def seal(dataset: Sets, bar: int) -> ss.Record:
    """Friction is the force less the pressure on the rod; dropped samples are filled in."""
    area = np.pi * (0.0250 / 2) ** 2
    channels = {"x": "#5 [mm]", "friction": f"(#7 - #6 * 1e5 * {area}) [N]"}
    path = dataset("rubber_seal") / f"O-ring_{bar}bar.csv"
    return ss.signals.fill_missing(
        ss.signals.fill_gaps(ss.read_record(path, channels=channels, time="#1 [ms]", rows=(15, None)))
    )


def test_a_rubber_seal_rubs_more_under_pressure(dataset: Sets) -> None:
    found = {bar: ss.fit_curve(seal(dataset, bar), curve="jenkins").parameters for bar in (1, 3, 5)}
    ranges = {1: 7.83, 3: 10.88, 5: 13.83}  # of the friction, found by eye: twice its level
    for bar, whole in ranges.items():
        assert 2 * found[bar]["kinetic"].value == pytest.approx(whole, rel=0.06)
        assert found[bar]["kinetic"].includes(whole / 2)
        assert 2e4 < found[bar]["stiffness"].value < 1e5  # 11 N come and go over 0.2 to 0.4 mm
        assert found[bar]["stiffness"].interval[0] > 0
    assert found[1]["kinetic"].value < found[3]["kinetic"].value < found[5]["kinetic"].value


def test_a_seals_friction_under_a_third_pressure(dataset: Sets) -> None:
    """Pressure in the place of load: 1 and 5 bar foretell 3 bar, and each pressure the line through the other two."""
    levels = {bar: ss.fit_curve(seal(dataset, bar), curve="coulomb").parameters["kinetic"] for bar in (1, 3, 5)}
    line = ss.law.friction_over_load([levels[1], levels[5]], loads=[1.0, 5.0])
    assert line.friction(3.0).value == pytest.approx(levels[3].value, rel=0.05)
    assert line.friction(3.0).includes(levels[3].value)
    assert line.adhesion.interval[0] > 0  # the seal's own squeeze: no Amontons's law


def test_the_frames_friction_is_nearly_in_proportion_to_the_load(dataset: Sets) -> None:
    """Two loads alone were recorded: what rubs under 250 g foretells 450 g by Amontons's law, some 8 % too low."""
    levels, loads = [], [0.250 * 9.81, 0.450 * 9.81]
    for weight in ("250g", "450g"):
        files = [dataset("frame_base_excited") / f"s_b_{weight}_{side}.mat" for side in "xy"]
        record = ss.read_record(files, channels={"x": "x [mm]", "z": "y [mm]"})
        record = ss.friction_force(record, mass=3.0799, stiffness=1191, damping=0.669, damper="base")
        levels.append(ss.fit_curve(record, curve="coulomb").parameters["kinetic"])
    for level, found in zip((0.68, 1.32), levels, strict=True):
        assert found.value == pytest.approx(level, rel=0.05)
    foretold = levels[0].value * loads[1] / loads[0]
    assert 0.88 < foretold / levels[1].value < 0.97
    line = ss.law.friction_over_load(levels, loads=loads)
    assert line.coefficient.value == pytest.approx(0.3, abs=0.05)
    assert line.line[0] < 0  # where Amontons's law would have none
    assert line.adhesion.value == 0, "a friction without load is none, and not below"
