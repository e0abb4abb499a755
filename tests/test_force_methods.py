"""The thesis's F, F1 and F2, and what can be said of the friction without a channel, a mass or a spring."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from rigs import CASES, RIG, measured, told
from stickslip.errors import EstimateError, ModelError, RecordError
from stickslip.signals.derivatives import five_point_average
from test_fusion import error

# Root mean square errors [N] of the thesis's methods on its own rig, from an independent simulation of six records.
BASELINE = {
    "F": {5.61: 0.238, 8.7: 0.385, 11.1: 0.495, 2.5: 0.135},
    "F1": {5.61: 0.213, 8.7: 0.361, 11.1: 0.470, 2.5: 0.101},
    "F2": {5.61: 0.062, 8.7: 0.148, 11.1: 0.248, 2.5: 0.026},
}


@pytest.mark.parametrize("method", list(BASELINE))
@pytest.mark.parametrize("frequency", list(CASES))
def test_the_thesis_methods_err_as_an_independent_study_found(method: str, frequency: float) -> None:
    record, truth = measured(frequency)
    assert error(told(record), truth, method)[0] == pytest.approx(BASELINE[method][frequency], rel=0.07)


def test_they_are_what_the_thesis_defines() -> None:
    rng = np.random.default_rng(3)
    x, z, a, load = (scale * rng.standard_normal(300) for scale in (1e-3, 2e-3, 3.0, 1.0))
    record = ss.Record.of({"x": x, "z": z, "a": a, "load": load}, fs=1000).with_details("load", inertia=0.05)
    balance = 2310 * z - 2310 * x - 2.42 * a
    rig = {"mass": 2.42, "stiffness": 2310.0}
    assert np.allclose(ss.friction_force(record, method="F", **rig)["friction"], balance)
    assert np.allclose(ss.friction_force(record, method="F1", **rig)["friction"], five_point_average(balance))
    felt = ss.friction_force(record, method="F2")  # needs no constants
    assert np.allclose(felt["friction"], five_point_average(load - 0.05 * a))
    assert felt.history[-1].arguments["mass"] is None
    assert ss.friction_force(record, method="F2", **rig).history[-1].arguments["mass"] == 2.42


@pytest.mark.parametrize("method", list(BASELINE))
def test_the_band_is_that_of_the_noise(method: str) -> None:
    t = np.arange(4000) / 1000
    x = 1e-3 * np.sin(20 * t)
    z = 1.5e-3 * np.sin(20 * t - 0.5)
    clean = {"x": x, "z": z, "a": -400 * x, "load": np.sin(20 * t)}
    sd = {"x": 1e-6, "z": 1e-6, "a": 0.02, "load": 0.01}
    true = 1000 * (z - x) + 2 * 400 * x if method != "F2" else clean["load"] + 0.05 * 400 * x
    rng = np.random.default_rng(1)
    offs, band = [], np.zeros(len(t))
    for _ in range(30):
        noisy = ss.Record.of({n: v + sd[n] * rng.standard_normal(len(t)) for n, v in clean.items()}, fs=1000)
        for name, level in sd.items():
            noisy = noisy.with_details(name, noise=level)
        made = ss.friction_force(noisy.with_details("load", inertia=0.05), mass=2.0, stiffness=1000.0, method=method)
        offs.append(made["friction"] - true)
        band = made["friction_sd"]
    spread = np.sqrt(np.mean(np.square(offs), axis=0))
    assert np.mean(spread**2 / band**2) == pytest.approx(1.0, abs=0.02)
    ends = [0, 1, -2, -1]  # where the average has formulas of its own
    assert np.mean(spread[ends] ** 2 / band[ends] ** 2) == pytest.approx(1.0, abs=0.5)


def test_a_method_without_its_channel_falls_back_and_says_what_is_lost() -> None:
    record = told(measured(8.7)[0])
    for asked, used in (("F2", "F1"), ("load", "motion")):
        few = ss.Record.of({name: record[name] for name in ("x", "z", "a")}, fs=4000)
        made = ss.friction_force(few, method=asked, **RIG)
        step = made.history[-1]
        assert step.arguments["method"] == used
        assert (
            f"without a load cell: the friction is only what is left of the motion ({asked} asked for)" in step.outcome
        )
        assert np.array_equal(made["friction"], ss.friction_force(few, method=used, **RIG)["friction"])
    bare = ss.Record.of({"x": record["x"], "z": record["z"]}, fs=4000)
    assert "without an accelerometer" in ss.friction_force(bare, method="F1", **RIG).history[-1].outcome
    assert "without an accelerometer" in ss.friction_force(bare, method="fusion", **RIG).history[-1].outcome
    alone = ss.Record.of({"load": record["load"]}, fs=4000).with_details("load", inertia=0.05)
    assert "of its flange is left in" in ss.friction_force(alone, method="F2").history[-1].outcome


@pytest.mark.parametrize("frequency", [8.7, 2.5])
@pytest.mark.parametrize("known", [{"stiffness": 2310.0}, {"mass": 2.42}, {}])
def test_without_mass_or_stiffness_the_record_says_what_it_can(frequency: float, known: dict[str, float]) -> None:
    record, truth = measured(frequency)
    made = ss.friction_force(told(record), method="fusion" if known else "motion", **known)
    name = "friction" if known else "friction_per_mass"
    true = truth[round(made.start * 4000) :][: len(made)] / (1 if known else 2.42)
    off = np.abs(made[name] - true)[200:-200]
    assert np.sqrt(np.mean(off**2)) < 0.013
    assert np.mean(off < 2 * made[f"{name}_sd"][200:-200]) > 0.93
    step = made.history[-1]
    assert "from how it slides" in step.outcome
    assert ("per mass is all that can be said" in step.outcome) == (not known)
    if known:
        found = step.arguments["stiffness"] / step.arguments["mass"]
        assert found == pytest.approx(2310 / 2.42, rel=0.03)
    else:
        assert "friction" not in made
        assert step.arguments["mass"] is None


def test_a_damper_is_part_of_the_unknown_balance() -> None:
    drive = ss.drives.HarmonicBase(2e-3, frequency=7.0)
    slider = ss.Oscillator(mass=2.0, stiffness=2000, damping=8.0, law=ss.laws.Coulomb(1.0), drive=drive)
    run = ss.simulate(slider, duration=8.0)
    record = ss.Rig.perfect("x", "z", "a").having("x", white=1e-7).measure(run, fs=2000, rng=1, start=5.0)
    made = ss.friction_force(record, stiffness=2000, damping=8.0, method="F")
    assert made.history[-1].arguments["mass"] == pytest.approx(2.0, rel=0.002)
    with pytest.raises(ModelError, match="give the mass or the stiffness"):
        ss.friction_force(record, damping=8.0)


@pytest.mark.parametrize("known", [{"stiffness": 2310.0}, {"mass": 2.42}])
def test_an_applied_force_is_part_of_the_unknown_balance(known: dict[str, float]) -> None:
    law = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    drive = ss.drives.HarmonicForce(4.0, frequency=6.0)
    run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=law, drive=drive), duration=6.0)
    record = ss.Rig.perfect("x", "a").having("x", white=1e-7).measure(run, fs=4000, rng=1, start=4.0)
    applied = 4.0 * np.cos(2 * np.pi * 6.0 * (4.0 + record.time))
    record = record.with_channel("force", applied, unit="N")
    told = ss.friction_force(record, method="F", **known).history[-1].arguments
    assert told["stiffness"] / told["mass"] == pytest.approx(2310 / 2.42, rel=0.01)
    with pytest.raises(ModelError, match="an applied force without mass and stiffness"):
        ss.friction_force(record)


def test_a_wrong_sign_is_no_mass() -> None:
    record = told(measured(8.7)[0])
    wrong = record.with_channel("a", -record["a"], unit="m/s^2")
    with pytest.raises(EstimateError, match="wrong sign"):
        ss.friction_force(wrong, stiffness=2310, method="F")


def test_what_can_not_be_is_refused() -> None:
    record = measured(8.7)[0]
    with pytest.raises(EstimateError, match="F2"):
        ss.friction_force(record, method="F3", **RIG)
    with pytest.raises(ModelError, match="contact"):
        ss.friction_force(record, method="F2", contact="wall")
    with pytest.raises(RecordError, match="x"):
        ss.friction_force(ss.Record.of({"a": record["a"]}, fs=4000), method="F2", **RIG)


@pytest.mark.parametrize("name", ["a", "load"])
def test_a_sensor_that_does_not_change_is_refused(name: str) -> None:
    record = told(measured(8.7)[0])
    still = record.with_channel(name, np.full(len(record), 0.3), unit=record.channels[name].unit)
    with pytest.raises(RecordError, match=f"channel {name} does not change"):
        ss.friction_force(still, **RIG, method="fusion")


@pytest.mark.parametrize("frequency", list(CASES))
def test_a_load_cell_weighs_mass_and_spring(frequency: float) -> None:
    record, true = measured(frequency, seconds=3.0)
    made = ss.friction_force(told(record), damping=RIG["damping"], method="fusion")
    found = made.history[-1].arguments
    assert found["mass"] == pytest.approx(RIG["mass"], rel=0.005)
    assert found["stiffness"] == pytest.approx(RIG["stiffness"], rel=0.005)
    off = np.abs(made["friction"] - true[round(made.start * 4000) :][: len(made)])[200:-200]
    assert np.sqrt(np.mean(off**2)) < 0.013
    assert np.mean(off < 2 * made["friction_sd"][200:-200]) > 0.9
    turned = told(record).with_channel("z", -record["z"], unit="m")
    with pytest.raises(EstimateError, match="correct signs"):
        ss.friction_force(turned, method="fusion")


@pytest.mark.parametrize("frequency", list(CASES))
def test_a_load_cell_alone_is_heard_through_its_mount(frequency: float) -> None:
    record, true = measured(frequency, seconds=3.0)
    inside = slice(200, -200)
    alone = ss.friction_force(told(record), method="load")
    off = (alone["friction"] - true[round(alone.start * 4000) :][: len(alone)])[inside]
    assert np.std(off) < 0.02 < np.std((record["load"] - true)[inside])
    assert "its mount of 250 Hz" in alone.history[-1].outcome
