"""Curves of friction over velocity: known ones come back, and what a record can not tell is refused or flagged."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from stickslip import Record, fit_curve, friction_loops
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import NORMAL_95
from stickslip.laws import LinearSlope, Stribeck
from stickslip.signals import fill_missing

FS, CYCLES = 1000, 12
STRIBECK = {"kinetic": 1.0, "static": 1.4, "viscous": 0.5, "speed": 0.02, "exponent": 1.3, "offset": 0.05}


def sweep(seed: int = 0, *, noise: float = 0.02, cycles: float = CYCLES, fs: float = FS, peak: float = 0.1, **changes):
    """Friction by Stribeck's curve over a sine of velocity, with noise."""
    truth = STRIBECK | changes
    rng = np.random.default_rng(seed)
    t = np.arange(round(fs * cycles)) / fs
    v = peak * np.sin(2 * np.pi * t + rng.uniform(0, 6))
    law = truth["kinetic"] + (truth["static"] - truth["kinetic"]) * np.exp(
        -((np.abs(v) / truth["speed"]) ** truth["exponent"])
    )
    f = np.sign(v) * law + truth["viscous"] * v + truth["offset"]
    return Record.of({"v": v, "friction": f + rng.normal(0, noise, t.size)}, fs=fs)


def test_a_stribeck_curve_comes_back_to_rounding() -> None:
    fit = fit_curve(sweep(noise=1e-9))
    for name, value in STRIBECK.items():
        assert fit.parameters[name].value == pytest.approx(value, rel=1e-5)
    assert isinstance(fit.law, Stribeck)
    assert fit.law.friction(0.02) == pytest.approx(1.0 + 0.4 / np.e + 0.01, rel=1e-5)
    assert fit.unexplained < 1e-8


def test_intervals_hold_the_truth() -> None:
    held = dict.fromkeys(STRIBECK, 0)
    for seed in range(25):
        fit = fit_curve(sweep(seed, noise=0.01))
        for name, value in STRIBECK.items():
            held[name] += fit.parameters[name].includes(value)
    assert all(count >= 21 for count in held.values()), held
    assert sum(held.values()) >= 0.92 * 25 * len(held)


@pytest.mark.parametrize("factor", [10.0, 1e-4])
def test_units_of_force_change_nothing(factor: float) -> None:
    record = sweep()
    fit = fit_curve(record)
    other = fit_curve(Record.of({"v": record["v"], "friction": factor * record["friction"]}, fs=FS))
    for name, each in fit.parameters.items():
        times = 1.0 if name in ("speed", "exponent") else factor
        assert other.parameters[name].value == pytest.approx(times * each.value, rel=1e-6)
        assert other.parameters[name].interval == pytest.approx(tuple(times * end for end in each.interval), rel=1e-4)


def test_the_sampling_rate_changes_nothing() -> None:
    slow, fast = fit_curve(sweep(noise=1e-9)), fit_curve(sweep(noise=1e-9, fs=4000))
    for name, each in slow.parameters.items():
        assert fast.parameters[name].value == pytest.approx(each.value, rel=1e-4)


def test_coulomb_and_viscous_are_ordinary_least_squares() -> None:
    record = sweep(static=1.0)
    fit = fit_curve(record, curve="viscous")
    assert isinstance(fit.law, LinearSlope)
    for name, value in (("kinetic", 1.0), ("viscous", 0.5), ("offset", 0.05)):
        assert fit.parameters[name].includes(value)
    v, f = fit.at, fit.measured
    by_hand = np.linalg.lstsq(np.column_stack([np.sign(v), v, np.ones_like(v)]), f, rcond=None)[0]
    assert [estimate.value for estimate in fit.estimates] == pytest.approx(by_hand, rel=1e-9)
    flat = fit_curve(sweep(static=1.0, viscous=0.0), curve="coulomb")
    assert flat.parameters["kinetic"].includes(1.0)
    assert flat.law is not None


def test_both_directions_on_their_own() -> None:
    record = sweep(static=1.0, viscous=0.0, offset=0.0)
    v, f = record["v"], record["friction"]
    uneven = np.where(v > 0, f + 0.2 + 3 * v, f + 1 * v)
    fit = fit_curve(Record.of({"v": v, "friction": uneven}, fs=FS), curve="asymmetric")
    truth = {"kinetic_forward": 1.2, "viscous_forward": 3.0, "kinetic_back": 1.0, "viscous_back": 1.0}
    for name, value in truth.items():
        assert fit.parameters[name].value == pytest.approx(value, rel=0.02)
    assert fit.law is None


def test_a_table_falls_all_the_way_though_the_noise_does_not() -> None:
    fit = fit_curve(sweep(noise=0.3, viscous=0.0), curve="tabulated", elements=12)
    forces = [fit.parameters[f"force_{number}"].value for number in range(1, 13)]
    assert all(a >= b - 1e-12 for a, b in pairwise(forces))
    truth = 1 + 0.4 * np.exp(-((fit.law.speeds[6] / 0.02) ** 1.3))
    assert fit.law.forces[6] == pytest.approx(truth, abs=0.03)


def test_loops_are_fitted_by_their_mean_cycle() -> None:
    record = sweep(cycles=20)
    whole, mean = fit_curve(record), fit_curve(friction_loops(record))
    for name in ("kinetic", "static", "offset"):
        assert mean.parameters[name].value == pytest.approx(whole.parameters[name].value, abs=0.05)
        assert mean.parameters[name].sd > 0


def test_a_curve_that_does_not_fit_has_wide_intervals() -> None:
    """Friction that runs behind the speed repeats in every cycle: no scatter shows what Coulomb's law misses."""
    record = sweep(noise=1e-4, static=1.0, viscous=0.0)
    v = record["v"]
    shifted = Record.of({"v": v, "friction": record["friction"] + 0.2 * np.roll(v, FS // 4) / 0.1}, fs=FS)
    found = fit_curve(shifted, curve="coulomb").parameters["kinetic"]
    assert found.includes(1.0)
    assert found.sd > 20 * fit_curve(record, curve="coulomb").parameters["kinetic"].sd
    assert found.interval[1] - found.value >= NORMAL_95 * found.sd


def test_an_angle_has_a_torque() -> None:
    t = np.arange(6000) / 500
    theta = 0.1 * np.sin(2 * np.pi * t)
    torque = 0.4 * np.sign(np.cos(2 * np.pi * t)) + np.random.default_rng(0).normal(0, 0.01, t.size)
    record = Record.of({"theta": theta, "friction": torque}, units={"friction": "N m"}, fs=500)
    fit = fit_curve(record, curve="viscous")
    assert [estimate.unit for estimate in fit.estimates] == ["N m", "N m s/rad", "N m"]
    assert fit.parameters["kinetic"].includes(0.4)


def one_speed(both_ways: bool) -> Record:
    t = np.arange(8000) / 1000
    v = 0.05 * (np.sign(np.sin(2 * np.pi * t + 0.1)) if both_ways else np.ones_like(t))
    return Record.of({"v": v, "friction": 1.0 * np.sign(v) + np.random.default_rng(0).normal(0, 0.01, t.size)}, fs=1000)


def test_what_the_record_can_not_tell_is_refused_with_what_would() -> None:
    for curve in ("viscous", "stribeck", "tabulated", "asymmetric"):
        with pytest.raises(EstimateError, match=r"varies by 0.0 % .*let the speed vary"):
            fit_curve(one_speed(True), curve=curve)
    assert fit_curve(one_speed(True), curve="coulomb").parameters["kinetic"].value == pytest.approx(1.0, abs=0.01)
    t = np.arange(8000) / 1000
    one_way = {"v": 0.05 + 0.03 * np.sin(9 * t), "friction": 1 + 0.1 * np.sin(9 * t)}
    with pytest.raises(EstimateError, match="needs motion both ways"):
        fit_curve(Record.of(one_way, fs=1000), curve="asymmetric")
    assert "let it reverse" in fit_curve(Record.of(one_way, fs=1000), curve="viscous").status
    with pytest.raises(RecordError, match="channel friction is missing"):
        fit_curve(Record.of({"v": one_way["v"]}, fs=1000))
    with pytest.raises(EstimateError, match="friction never changes"):
        fit_curve(Record.of({"v": one_way["v"], "friction": np.zeros_like(t)}, fs=1000), curve="coulomb")
    with pytest.raises(EstimateError, match="never changes"):
        fit_curve(Record.of({"v": 0 * t, "friction": np.sin(t)}, fs=1000))
    with pytest.raises(EstimateError, match=r"curve = 'stribek'.*perhaps stribeck is meant"):
        fit_curve(sweep(), curve="stribek")
    with pytest.raises(EstimateError, match="elements = 1"):
        fit_curve(sweep(), curve="tabulated", elements=1)


def test_what_can_only_just_be_told_is_flagged() -> None:
    assert "cycles for 6 parameters" in fit_curve(sweep(cycles=3.1)).status
    assert "the curve leaves" in fit_curve(sweep(noise=5.0), curve="coulomb").status
    assert "noise is above the friction" in fit_curve(sweep(noise=5.0), curve="coulomb").status
    assert "does not fall" in fit_curve(sweep(static=1.0)).status
    fast = fit_curve(sweep(noise=0.01, peak=1.0, viscous=0.0))  # slides at twice the Stribeck speed at least
    assert "slide slower" in fast.parameters["static"].status
    assert "slide slower" in fast.status


@pytest.mark.parametrize("curve", ["coulomb", "asymmetric"])
def test_friction_that_drives_is_told(curve: str) -> None:
    record = sweep()
    fit = fit_curve(Record.of({"v": record["v"], "friction": -record["friction"]}, fs=FS), curve=curve)
    assert "friction drives the motion" in fit.status
    assert fit.law is None


def test_friction_that_does_not_rise_has_a_law_without_viscosity() -> None:
    kinds = [fit_curve(sweep(seed, viscous=0.0)) for seed in range(6)]
    assert all(kind.law is not None for kind in kinds)
    assert any("viscous" not in kind.parameters for kind in kinds)


def test_a_curve_that_friction_does_not_follow_is_said_so() -> None:
    """What repeats in every cycle is the curve's own error; noise is not, however loud."""
    record = sweep(static=3.0, viscous=0.0)
    fit = fit_curve(record, curve="coulomb")
    assert not fit.follows
    assert fit.model_error == pytest.approx(fit.unexplained, rel=0.1)
    assert "does not follow the curve" in fit.status
    assert {estimate.status for estimate in fit.estimates} == {"of a curve that the friction does not follow"}
    assert fit_curve(record, curve="stribeck").follows
    loud = fit_curve(sweep(static=1.0, viscous=0.0, noise=0.4), curve="coulomb")
    assert loud.follows
    assert loud.unexplained > 0.3
    assert loud.model_error < 0.05


def test_the_curves_error_is_told_of_motion_that_never_repeats() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(20 * FS) / FS
    v = sum(0.05 * np.sin(2 * np.pi * f * t + p) for f, p in zip((0.3, 0.71, 1.13), rng.uniform(0, 6, 3), strict=True))
    even, uneven = np.sign(v), np.sign(v) * (1 + 2 * np.exp(-np.abs(v) / 0.02))
    for friction, follows in ((even, True), (uneven, False)):
        noisy = friction + rng.normal(0, 0.2, t.size)
        assert fit_curve(Record.of({"v": v, "friction": noisy}, fs=FS), curve="coulomb").follows is follows


def test_a_coefficient_is_fitted_as_it_is_or_under_its_load() -> None:
    record = sweep()
    given = {"v": record["v"], "coefficient": record["friction"] / 10}
    wanted = fit_curve(record, curve="viscous")
    alone = fit_curve(Record.of(given, fs=FS), curve="viscous")
    assert (alone.unit, [estimate.unit for estimate in alone.estimates]) == ("1", ["1", "s/m", "1"])
    assert alone.parameters["kinetic"].value == pytest.approx(wanted.parameters["kinetic"].value / 10)
    loaded = fit_curve(Record.of(given, fs=FS), curve="viscous", normal="10 N")
    assert (loaded.unit, loaded.estimates[1].unit) == ("N", "N s/m")
    assert loaded.law.kinetic == pytest.approx(wanted.law.kinetic)


def test_samples_that_were_filled_in_are_told() -> None:
    record = sweep()
    lost = np.where(np.arange(1, len(record) + 1) % 5 > 2, np.nan, record["friction"])
    fit = fit_curve(fill_missing(Record.of({"v": record["v"], "friction": lost}, fs=FS)), curve="coulomb")
    assert "40 % of the samples were not measured" in fit.status
    assert "measured" not in fit_curve(record, curve="coulomb").status


def test_one_speed_one_way_tells_no_curve() -> None:
    t = np.arange(8 * FS) / FS
    rng = np.random.default_rng(0)
    record = Record.of(
        {"x": 5e-3 * t + rng.normal(0, 1e-7, t.size), "friction": 1 + rng.normal(0, 0.02, t.size)}, fs=FS
    )
    fit = fit_curve(record, curve="coulomb")
    assert "let it reverse" in fit.status
    assert "let the speed vary" in fit.status
    assert "constant force is not told" in fit.parameters["kinetic"].status
    for curve in ("stribeck", "viscous", "asymmetric", "dahl", "jenkins"):
        with pytest.raises(EstimateError, match=r"let the speed vary|give a record that reverses"):
            fit_curve(record, curve=curve)


def test_what_is_no_record_of_friction_is_refused() -> None:
    record = sweep(cycles=2)
    with pytest.raises(RecordError, match="needs at least 50"):
        fit_curve(record.rows(0, 1), curve="coulomb")
    lost = Record.of({"v": record["v"], "friction": np.where(record.time == 0.5, np.nan, record["friction"])}, fs=FS)
    with pytest.raises(RecordError, match=r"a value that is no number at row 500.*fill_missing"):
        fit_curve(lost, curve="coulomb")
    loud = fit_curve(sweep(noise=5.0), curve="coulomb")
    assert "noise is above the friction" in loud.status
    assert all("ok" not in estimate.status for estimate in loud.estimates)


def test_loops_know_their_motion_themselves() -> None:
    loops = friction_loops(sweep())
    for told in ({"contact": "base"}, {"frequency": 2.0}, {"normal": 3.0}):
        with pytest.raises(EstimateError, match=f"{next(iter(told))}= of friction_loops' answer"):
            fit_curve(loops, curve="coulomb", **told)
