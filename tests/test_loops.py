"""Friction loops: closed forms, coverage, invariances, and a rig's record."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from stickslip import datasets
from stickslip.balance.force import friction_force
from stickslip.cycle.loops import DRIFTING, friction_loops
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import kinds
from stickslip.files.read import read_record
from stickslip.record.record import Record

FS, REACH, FREQUENCY = 500.0, 0.01, 2.0
PEAK = 2 * math.pi * FREQUENCY * REACH


def sliding(*, seconds=10.0, fs=FS, slope=0.0, offset=0.0, uneven=0.0, noise=0.02, rho=0.0, seed=0):
    """A sinusoidal motion with friction sign(v) (1.5 + slope |v|) + offset, and correlated noise on the force."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * fs)) / fs
    v = PEAK * np.cos(2 * np.pi * FREQUENCY * t)
    white = rng.standard_normal(t.size + 500)
    error = noise * math.sqrt(1 - rho**2) * lfilter([1], [1, -rho], white)[500:]
    friction = np.sign(v) * (1.5 + slope * np.abs(v)) + uneven * (v > 0) + offset + error
    x = REACH * np.sin(2 * np.pi * FREQUENCY * t) + 1e-6 * rng.standard_normal(t.size)
    return Record.of({"x": x, "friction": friction}, fs=fs)


@pytest.mark.parametrize("grows", [0.2, -0.2, 0.0])
def test_friction_that_changes_along_the_record_is_told(grows: float) -> None:
    time = np.arange(20000) / 1000
    friction = 1.5 * (1 + grows * time / time[-1]) * np.sign(np.cos(2 * np.pi * time))
    noisy = friction + np.random.default_rng(1).normal(0, 0.02, time.size)
    loops = friction_loops(Record.of({"x": 0.01 * np.sin(2 * np.pi * time), "friction": noisy}, fs=1000))
    told = f"friction {'rises' if grows > 0 else 'falls'} by 20 % over the record"
    assert (told in loops.level.status) == (grows != 0)
    assert (DRIFTING in kinds(loops.status)) == (grows != 0)


def test_coulomb_friction_by_closed_form():
    loops = friction_loops(sliding(offset=0.3, uneven=0.2))
    assert loops.level.value == pytest.approx(1.6, abs=0.005)
    assert loops.forward.value == pytest.approx(1.5 + 0.2 + 0.3, abs=0.005)
    assert loops.back.value == pytest.approx(1.5 - 0.3, abs=0.005)
    assert loops.offset.value == pytest.approx(0.3 + 0.1, abs=0.005)
    assert loops.energy_per_cycle.value == pytest.approx(1.6 * 4 * REACH, rel=0.005)
    assert loops.status == "ok"
    assert loops.level.status == "ok"
    assert loops.level.unit == "N"


@pytest.mark.parametrize("slope", [4.0, -4.0])
def test_slope_has_the_sign_and_size_of_the_law(slope):
    loops = friction_loops(sliding(slope=slope))
    assert loops.slope.value == pytest.approx(slope, abs=0.2)
    assert not loops.slope.includes(0)
    assert loops.slope.status == "ok"
    assert loops.slope.unit == "N s/m"
    # energy of Coulomb and viscous friction under x = X sin(w t): 4 F X + pi c w X^2
    energy = 4 * 1.5 * REACH + math.pi * slope * PEAK * REACH
    assert loops.energy_per_cycle.value == pytest.approx(energy, rel=0.005)


# Trials, and the share that is 3 binomial standard deviations below 0.95.
OFTEN = pytest.mark.parametrize(("trials", "least"), [(25, 0.82), pytest.param(100, 0.88, marks=pytest.mark.soak)])


@OFTEN
@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_interval_of_the_slope_holds_the_truth(rho, trials, least):
    slopes = [friction_loops(sliding(slope=4.0, noise=0.1, rho=rho, seed=seed)).slope for seed in range(trials)]
    assert np.mean([slope.includes(4.0) for slope in slopes]) >= least
    spread = np.std([slope.value for slope in slopes])
    assert np.median([slope.interval[1] - slope.value for slope in slopes]) < 6 * spread


@pytest.mark.parametrize("phase", np.arange(8) * math.pi / 4)
@pytest.mark.parametrize("mirrored", [True, False])  # friction that changes with position; a force that does
def test_a_ripple_along_the_way_is_no_slope(phase, mirrored):
    record = datasets.demo()
    friction, x = np.array(record["load"]), record["x"]
    ripple = 0.05 * np.cos(2 * np.pi * x / 0.5e-3 + phase)
    v = np.gradient(x) * record.fs
    rippled = friction + (np.sign(v) * ripple if mirrored else ripple)
    slope = friction_loops(Record.of({"x": x, "friction": rippled}, fs=record.fs)).slope
    assert slope.includes(0) or slope.status != "ok"
    sine = sliding(noise=0.005)
    ripple = 0.05 * np.cos(2 * np.pi * sine["x"] / (0.3 * REACH) + phase)
    sign = np.sign(np.cos(2 * np.pi * FREQUENCY * sine.time)) if mirrored else 1.0
    slope = friction_loops(Record.of({"x": sine["x"], "friction": sine["friction"] + sign * ripple}, fs=FS)).slope
    assert slope.includes(0) or slope.status != "ok"


def test_an_elastic_turn_round_is_no_slope():
    """Bouc and Wen's contact under a sine: the force rises over the way after a reversal, then rests at its level."""
    record, level, stiffness = sliding(), 1.5, 1.5 / (0.15 * REACH)
    force = np.zeros(len(record))
    for row, step in enumerate(np.diff(REACH * np.sin(2 * np.pi * FREQUENCY * record.time)), start=1):
        force[row] = np.clip(force[row - 1] + stiffness * step, -level, level)
    force = force + np.random.default_rng(0).normal(0, 0.02, force.size)
    slope = friction_loops(Record.of({"x": record["x"], "friction": force}, fs=FS)).slope
    assert slope.includes(0) or slope.status != "ok"


def test_curve_lies_on_the_law():
    curve = friction_loops(sliding(slope=4.0, seconds=30)).curve
    fast = np.abs(curve.velocity) > 0.15 * PEAK
    law = np.sign(curve.velocity) * (1.5 + 4.0 * np.abs(curve.velocity))
    assert np.max(np.abs(curve.friction - law)[fast]) < 0.03
    # within a bin the law runs over half a bin's width; beyond that the intervals hold it
    play = 4.0 * np.diff(curve.velocity).max() / 2
    assert np.all((curve.low - play <= law)[fast] & (law <= curve.high + play)[fast])
    assert np.all(curve.count[fast] >= 58)


def test_frequency_is_found_and_may_be_given():
    loops = friction_loops(sliding(seconds=7.3))
    assert loops.frequency.value == pytest.approx(FREQUENCY, rel=1e-4)
    assert friction_loops(sliding(), frequency=2.0).frequency.method == "given"
    assert np.diff(loops.cycles) == pytest.approx(1 / FREQUENCY, rel=1e-3)  # the first begins with the record
    assert loops.displacement.max() == pytest.approx(REACH, rel=1e-3)
    assert loops.velocity.max() == pytest.approx(PEAK, rel=1e-2)
    # the noise, less what interpolation between two samples averages away (0.67 to 1 of it)
    assert 0.66 * 0.02 < np.median(loops.scatter) < 1.1 * 0.02


@OFTEN
@pytest.mark.parametrize("rho", [0.0, 0.95])
def test_interval_of_the_level_holds_the_truth(rho, trials, least):
    held = [
        friction_loops(sliding(seconds=6.0, noise=0.2, rho=rho, seed=seed)).level.includes(1.5)
        for seed in range(trials)
    ]
    assert np.mean(held) >= least


@OFTEN
@pytest.mark.parametrize("rho", [0.0, 0.5])
def test_interval_of_a_level_that_wanders_from_cycle_to_cycle_holds_its_mean(rho, trials, least):
    rng, held = np.random.default_rng(5), 0
    record = sliding(seconds=10.0, noise=0.02)
    cycle = np.floor(FREQUENCY * record.time + 0.25).astype(int)  # the level changes at a reversal
    for _ in range(trials):
        level = 0.05 * lfilter([1], [1, -rho], rng.standard_normal(cycle.max() + 501))[500:]
        wandering = record["friction"] + level[cycle] * np.sign(np.cos(2 * np.pi * FREQUENCY * record.time))
        held += friction_loops(Record.of({"x": record["x"], "friction": wandering}, fs=FS)).level.includes(1.5)
    assert held / trials >= least


def test_scale_and_sampling_do_not_matter():
    plain = friction_loops(sliding(fs=2000.0, slope=4.0))
    record = sliding(fs=2000.0, slope=4.0)
    scaled = Record.of({"x": 1e3 * record["x"], "friction": 1e-3 * record["friction"]}, fs=2000.0)
    loops = friction_loops(scaled)
    assert loops.level.value == pytest.approx(1e-3 * plain.level.value, rel=1e-6)
    assert loops.energy_per_cycle.value == pytest.approx(plain.energy_per_cycle.value, rel=1e-6)
    assert loops.slope.value == pytest.approx(1e-6 * plain.slope.value, rel=1e-6)
    thinned = Record.of({"x": record["x"][::5], "friction": record["friction"][::5]}, fs=400.0)
    assert friction_loops(thinned).level.value == pytest.approx(plain.level.value, rel=0.01)


def test_artefacts_at_reversals_have_no_say():
    record = sliding()
    spiked = np.array(record["friction"])
    turning = np.flatnonzero(np.diff(np.sign(np.diff(record["x"]))))
    turning = turning[(turning > 2) & (turning < len(spiked) - 3)]
    for shift in (-1, 0, 1):
        spiked[turning + shift] += 40.0
    loops = friction_loops(Record.of({"x": record["x"], "friction": spiked}, fs=FS))
    assert loops.level.value == pytest.approx(1.5, abs=0.01)


def test_motion_that_does_not_repeat_is_cut_at_its_onsets():
    rng = np.random.default_rng(4)
    legs = rng.uniform(0.3, 1.1, 24)
    v = np.concatenate(
        [(-1) ** i * 0.05 * np.sin(np.pi * np.arange(round(leg * FS)) / (leg * FS)) for i, leg in enumerate(legs)]
    )
    x = np.cumsum(v) / FS + 1e-6 * rng.standard_normal(v.size)
    friction = 2.0 * np.sign(v) + 0.05 * rng.standard_normal(v.size)
    loops = friction_loops(Record.of({"x": x, "friction": friction}, fs=FS))
    assert loops.level.value == pytest.approx(2.0, abs=0.02)
    assert "not periodic" in loops.status
    assert len(loops.cycles) == 10  # 12 legs go forward; 11 of them follow one back; between those lie 10 cycles
    assert loops.frequency.value == pytest.approx(1 / (2 * legs.mean()), rel=0.15)
    assert "10 cycles from one onset of motion" in loops.status
    # the mean cycle is aligned at its reversals: it goes as far as the cycles do on average, at their level
    forward, back = (0.05 * 2 / np.pi * legs[2 + side : 22 + side : 2].mean() for side in (0, 1))
    assert np.ptp(loops.displacement) == pytest.approx(max(forward, back), rel=0.05)
    moving = np.abs(loops.velocity) > 0.3 * np.abs(loops.velocity).max()
    assert np.abs(loops.friction[moving]) == pytest.approx(2.0, abs=0.1)


def test_velocity_alone_or_an_angle_will_do():
    record = sliding()
    t = np.arange(len(record)) / FS
    v = PEAK * np.cos(2 * np.pi * FREQUENCY * t)
    assert friction_loops(Record.of({"v": v, "friction": record["friction"]}, fs=FS)).level.value == pytest.approx(
        1.5, abs=0.01
    )
    turning = Record.of({"theta": record["x"], "friction": record["friction"]}, fs=FS, units={"friction": "N m"})
    assert friction_loops(turning).level.unit == "N m"
    assert friction_loops(turning).slope.unit == "N m s/rad"
    assert friction_loops(turning).unit == "rad"


def test_a_contact_on_the_base_is_measured_against_it():
    record = sliding()
    t = np.arange(len(record)) / FS
    base = 0.02 * np.sin(2 * np.pi * FREQUENCY * t + 1.0)
    carried = Record.of({"x": record["x"] + base, "z": base, "friction": record["friction"]}, fs=FS)
    assert friction_loops(carried, contact="base").level.value == pytest.approx(1.5, abs=0.01)
    work = friction_loops(carried, contact="base").energy_per_cycle.value
    assert work == pytest.approx(4 * 1.5 * REACH, rel=0.01)
    assert friction_loops(carried).energy_per_cycle.value > 1.5 * work  # the ground moves more than the base
    balanced = friction_force(carried, mass=1.0, stiffness=100.0, contact="base")
    loops = friction_loops(balanced)
    assert np.array_equal(loops.displacement, friction_loops(balanced, contact="base").displacement)


@pytest.mark.parametrize("late", ["x", "friction"])
def test_a_stated_delay_is_taken_out(late):
    record, rows = sliding(slope=4.0, seconds=12), 40
    other = "x" if late == "friction" else "friction"
    shifted = Record.of({late: record[late][:-rows], other: record[other][rows:]}, fs=FS)
    assert abs(friction_loops(shifted).level.value - 1.5) > 0.05
    loops = friction_loops(shifted.with_details(late, delay=rows / FS))
    direct = friction_loops(record.rows(rows))
    assert loops.level.value == pytest.approx(direct.level.value, rel=5e-3)
    assert loops.energy_per_cycle.value == pytest.approx(direct.energy_per_cycle.value, rel=5e-3)


@pytest.mark.parametrize(("position", "unit"), [("x", "N m"), ("theta", "N")])
def test_a_torque_with_a_displacement_is_refused(position, unit):
    record = sliding()
    mixed = Record.of({position: record["x"], "friction": record["friction"]}, fs=FS, units={"friction": unit})
    with pytest.raises(RecordError, match=f"friction is in {unit}, the motion in"):
        friction_loops(mixed)


def test_wrong_sign_is_said():
    record = sliding()
    turned = Record.of({"x": record["x"], "friction": -record["friction"]}, fs=FS)
    assert "the sign of the force or of the displacement is wrong" in friction_loops(turned).status


def test_few_cycles_are_said():
    loops = friction_loops(sliding(seconds=1.3))
    assert loops.level.status.startswith("only 2 cycles")
    assert loops.level.interval[1] - loops.level.interval[0] > 10 * loops.level.sd  # Student with one degree of freedom
    with pytest.raises(EstimateError, match="no complete cycle"):
        friction_loops(sliding(seconds=0.3))


def test_constant_speed_has_no_slope():
    t = np.arange(5000) / FS
    x = 0.01 * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * t)) + 1e-6 * np.random.default_rng(0).standard_normal(t.size)
    friction = 1.5 * np.sign(np.cos(2 * np.pi * t))
    loops = friction_loops(Record.of({"x": x, "friction": friction}, fs=FS))
    assert "no slope can be told" in loops.slope.status
    assert loops.level.value == pytest.approx(1.5, abs=1e-6)


def test_bad_input_ends_in_a_sentence():
    record = sliding()
    x, friction = np.array(record["x"]), np.array(record["friction"])
    with pytest.raises(RecordError, match="friction is missing"):
        friction_loops(Record.of({"x": x}, fs=FS))
    with pytest.raises(RecordError, match="channel x is missing"):
        friction_loops(Record.of({"friction": friction}, fs=FS))
    with pytest.raises(RecordError, match="channel z is missing"):
        friction_loops(record, contact="base")
    with pytest.raises(EstimateError, match="never changes"):
        friction_loops(Record.of({"x": 0 * x + 1, "friction": friction}, fs=FS))
    with pytest.raises(RecordError, match="10 samples"):
        friction_loops(record.rows(0, 10))
    with pytest.raises(RecordError, match="not numbers"):
        friction_loops(Record.of({"x": np.where(x > 0.009, np.nan, x), "friction": friction}, fs=FS))
    with pytest.raises(EstimateError, match="above its noise"):
        friction_loops(Record.of({"x": np.random.default_rng(0).standard_normal(x.size), "friction": friction}, fs=FS))
    with pytest.raises(EstimateError, match="contact = 'air'"):
        friction_loops(record, contact="air")
    with pytest.raises(EstimateError, match="frequency = -1"):
        friction_loops(record, frequency=-1.0)
    with pytest.raises(EstimateError, match="bins = 1"):
        friction_loops(record, bins=1)
    with pytest.raises(EstimateError, match=r"bins = 2\.5"):
        friction_loops(record, bins=2.5)
    with pytest.raises(RecordError, match="'often'"):
        friction_loops(record, frequency="often")
    with pytest.raises(EstimateError, match="forward, back, and forward again"):
        friction_loops(Record.of({"x": np.arange(5000) * 1e-4, "friction": friction}, fs=FS))


@pytest.mark.parametrize(("weight", "level"), [("250g", 0.682), ("450g", 1.318)])
def test_frame_on_a_shaken_base(dataset, weight, level):
    folder = dataset("frame_base_excited")
    record = read_record(
        [folder / f"s_b_{weight}_x.mat", folder / f"s_b_{weight}_y.mat"], channels={"x": "x [mm]", "z": "y [mm]"}
    )
    loops = friction_loops(friction_force(record, mass=3.0799, stiffness=1191, damping=0.669, damper="base"))
    assert loops.level.value == pytest.approx(level, rel=0.04)
    assert loops.level.interval[0] > 0.9 * level
    assert loops.level.interval[1] < 1.1 * level
    assert loops.frequency.value == pytest.approx(1.0, rel=0.005)
    # the friction-velocity curve is a step: flat within 25 % of the level away from rest
    curve = loops.curve
    fast = np.abs(curve.velocity) > 0.2 * np.abs(curve.velocity).max()
    step = np.sign(curve.velocity) * loops.level.value + loops.offset.value
    assert np.max(np.abs(curve.friction - step)[fast]) < 0.25 * level


def test_demonstration_record_holds_its_truth():
    record = datasets.demo()
    loops = friction_loops(
        friction_force(
            record, mass=record.truth["mass"], stiffness=record.truth["stiffness"], damping=record.truth["damping"]
        )
    )
    assert loops.level.value == pytest.approx(1.1, rel=0.02)
    assert loops.frequency.value == pytest.approx(2.5, rel=1e-4)
    assert loops.energy_per_cycle.value == pytest.approx(record.truth["energy per cycle"], rel=0.02)
