"""The friction at breakaway, what a contact does before it slips, and a slider pulled through a spring."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from scipy.signal import butter, lfilter

import stepped
import stickslip as ss
from rigs import CASES, RIG, SETTLED, measured, told
from stickslip.cycle.onset import NOT_ABOVE, NOT_FELT
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import kinds, stands

MASS, STIFFNESS, FS = 3.08, 1191.0, 500.0


def driven(law: ss.laws.Coulomb | ss.laws.CompliantContact, *, noise: float = 2e-6, fs: float = FS) -> ss.Record:
    """A shaken mass that stops twice a cycle, its displacements with noise, its friction balanced from them."""
    slider = ss.Oscillator(MASS, STIFFNESS, law=law, drive=ss.drives.HarmonicBase(3e-3, frequency=1.0))
    run = ss.simulate(slider, cycles=20).record(fs=fs).between(2.0, 20.0)
    rng = np.random.default_rng(3)
    noisy = {name: run[name] + rng.normal(0, noise, len(run)) for name in "xz"}
    return ss.friction_force(ss.Record.of(noisy, fs=fs), mass=MASS, stiffness=STIFFNESS)


@pytest.mark.parametrize("static", [1.0, 1.1, 1.3])
def test_static_friction_is_found_whether_it_is_higher_or_not(static: float) -> None:
    breakaway = ss.cycle.breakaway(driven(ss.laws.Coulomb(1.0, static=static)))
    assert breakaway.forward is not None
    assert breakaway.back is not None
    for each in (breakaway.forward, breakaway.back, breakaway.ratio):
        assert each.value == pytest.approx(static, rel=0.03)
    assert breakaway.ringing_forward is None
    assert breakaway.status == "ok"


@pytest.mark.parametrize("counts", [30, 50])
def test_static_friction_is_told_or_not_of_a_displacement_in_coarse_counts(counts: int) -> None:
    """All of a slip's first travel may lie within one count: no friction that falls with the speed moves that."""
    law = ss.laws.Coulomb(2.0, static=2.6)
    slider = ss.Oscillator(2.0, 800.0, law=law, drive=ss.drives.HarmonicBase(4e-3, frequency=1.0))
    run = ss.simulate(slider, cycles=6).record(fs=2000)
    step = float(np.ptp(run["x"])) / counts
    record = ss.Record.of({"x": np.round(run["x"] / step) * step, "z": run["z"]}, fs=2000)
    found = ss.cycle.breakaway(ss.friction_force(record, mass=2.0, stiffness=800.0))
    assert not found.ratio.known or found.ratio.includes(1.3)


@pytest.mark.parametrize("kind", ["Coulomb", "static", "Stribeck"])
def test_a_contact_that_never_sticks_tells_no_static_friction(kind: str) -> None:
    """By the rigs of another integrator: what pulls as it turns round moves the mass: it is up to 20 times too much."""
    untold = 0
    for draw in range(8):
        rng = np.random.default_rng([701, draw])
        rig = stepped.drawn(kind, rng)
        record = stepped.record(rig, rng)
        if record.truth["stuck share of the time"]:
            continue
        found = ss.cycle.breakaway(ss.friction_force(record, **rig.stated))
        assert not any(e.known for e in (found.forward, found.back, found.ratio) if e is not None)
        assert found.status == NOT_FELT
        untold += 1
    assert untold >= 3


@pytest.mark.parametrize("speed", [0.0, 0.15])
def test_static_friction_holds_whether_it_falls_at_once_or_with_the_speed(speed: float) -> None:
    """The pull at which the slip begins, on the side where rigs of another integrator stick; one of six may be out."""
    held = 0
    for draw in range(6):
        rng = np.random.default_rng([702, draw])
        pull, turn = 1800 * 1.5e-3, 2 * np.pi * 2.5
        rig = stepped.Rig(
            "Stribeck" if speed else "static", 1.5, 1800, 0.9, 1.5e-3, 2.5, kinetic=0.26 * pull * rng.uniform(0.9, 1.1),
            static=0.44 * pull, speed=speed * 1.5e-3 * turn,
        )  # fmt: skip
        static = ss.cycle.breakaway(ss.friction_force(stepped.record(rig, rng), **rig.stated)).forward
        assert static is not None
        assert static.interval[1] - static.interval[0] < 0.4 * rig.static
        held += static.includes(rig.static)
    assert held >= 5


def test_a_static_friction_below_the_sliding_one_bears_a_doubt() -> None:
    """Friction that grows with speed is larger as it slides than at rest: the number stands, and says so."""
    found = ss.cycle.breakaway(driven(ss.laws.LinearSlope(1.0, slope=8.0)))
    for estimate in (found.forward, found.back, found.ratio):
        assert estimate is not None
        assert NOT_ABOVE in kinds(estimate.status)
        assert stands(estimate.status)


def heard(
    frequency: float, law: ss.laws.Coulomb | ss.laws.CompliantContact, names: str = "x z a load", fs: int = 4000
) -> ss.Record:
    """What some sensors of the rig read of a contact, with nothing stated of them."""
    slider = ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(CASES[frequency][0], frequency=frequency), **RIG)
    record = ss.Rig().measure(ss.simulate(slider, duration=SETTLED + 3), fs=4000, rng=3, start=SETTLED)
    return ss.Record.of({name: record[name][:: 4000 // fs] for name in names.split()}, fs=fs)


@pytest.mark.parametrize("names", ["x z", "x z a", "x z a load"])
@pytest.mark.parametrize("method", ["smoother", "fusion"])
@pytest.mark.parametrize("static", [1.0, 1.3])
@pytest.mark.parametrize("rigid", [False, True])
def test_a_rig_of_which_nothing_is_stated_never_bears_less_than_it_slides(
    names: str, method: str, static: float, rigid: bool
) -> None:
    if rigid:
        law: ss.laws.Coulomb | ss.laws.CompliantContact = ss.laws.Coulomb(1.1, static=1.1 * static)
    else:
        law = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9, static=1.1 * static)
    record = ss.friction_force(heard(2.5, law, names), method=method, **RIG)
    refused = ""
    try:
        breakaway = ss.cycle.breakaway(record)
    except EstimateError as error:
        refused = str(error)
    if refused:
        assert "strays" in refused
        return
    assert breakaway.ratio.includes(static)
    sure = breakaway.ratio.interval[1] - breakaway.ratio.interval[0] < 0.15
    assert sure or breakaway.status != "ok"


def test_a_pull_on_a_mass_that_rings_on_its_contact_is_flagged() -> None:
    """The true friction is 1.1 N, at rest as in sliding; what pulls when the mass slips is 9 % less."""
    record = told(measured(2.5)[0])
    pulled = ss.cycle.breakaway(ss.friction_force(record, method="F", **RIG))
    assert "not at rest while it sticks" in pulled.status
    assert pulled.ratio.includes(1.0)
    fused = ss.cycle.breakaway(ss.friction_force(record, method="fusion", **RIG))
    assert fused.status == "ok"
    assert fused.ratio.value == pytest.approx(1.0, abs=0.01)
    assert fused.ratio.includes(1.0)
    assert fused.ratio.interval[1] - fused.ratio.interval[0] < 0.1


def test_a_hold_of_two_samples_tells_nothing() -> None:
    record = heard(8.7, ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9), fs=500)
    with pytest.raises(EstimateError, match="sample faster"):
        ss.cycle.breakaway(ss.friction_force(told(record), method="fusion", **RIG))


def test_a_friction_whose_mounts_ring_tells_nothing_of_its_peak() -> None:
    record = heard(8.7, ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9), "x z a")
    with pytest.raises(EstimateError, match=r"strays by .* state it"):
        ss.cycle.breakaway(ss.friction_force(record, method="fusion", **RIG))


def test_a_sensor_whose_zero_is_off_changes_neither_ratio_nor_presliding() -> None:
    record = driven(ss.laws.CompliantContact(1.0, stiffness=2e4, damping=20), noise=2e-7)
    off = record.with_channel("friction", record["friction"] + 0.3, unit="N")
    right, wrong = ss.cycle.breakaway(record), ss.cycle.breakaway(off)
    assert wrong.ratio.value == pytest.approx(right.ratio.value, rel=2e-3)
    assert wrong.forward is not None
    assert right.forward is not None
    assert wrong.forward.value == pytest.approx(right.forward.value + 0.3, rel=2e-3)
    assert ss.cycle.presliding(off).stiffness.value == pytest.approx(
        ss.cycle.presliding(record).stiffness.value, rel=2e-3
    )  # type: ignore[union-attr]


def test_a_slip_at_the_end_of_its_stroke_has_no_swing() -> None:
    record = told(measured(8.7, 0.0, 3.0)[0])
    breakaway = ss.cycle.breakaway(ss.friction_force(record, method="motion", **RIG))
    for swing in (breakaway.swing_forward, breakaway.swing_back):
        assert swing is None or np.isfinite(swing.value)


def test_breakaway_does_not_hang_on_units_of_motion_or_on_its_sign() -> None:
    record = driven(ss.laws.Coulomb(1.0, static=1.2))
    turned = ss.Record.of({name: -record[name] for name in "xz"}, fs=FS)
    turned = ss.friction_force(turned, mass=MASS, stiffness=STIFFNESS)
    there, here = ss.cycle.breakaway(turned), ss.cycle.breakaway(record)
    assert there.forward is not None
    assert here.back is not None
    assert there.forward.value == pytest.approx(here.back.value, rel=1e-6)
    heavy = ss.Record.of({name: record[name] for name in "xz"}, fs=FS)
    heavy = ss.friction_force(heavy, mass=10 * MASS, stiffness=10 * STIFFNESS)
    assert ss.cycle.breakaway(heavy).ratio.value == pytest.approx(here.ratio.value, rel=1e-6)


@pytest.mark.parametrize("stiffness", [2e4, 2e5])
def test_a_contact_that_gives_way_is_told_with_its_stiffness(stiffness: float) -> None:
    presliding = ss.cycle.presliding(driven(ss.laws.CompliantContact(1.0, stiffness=stiffness, damping=20), noise=2e-7))
    assert presliding.verdict == "gives way"
    assert presliding.stiffness is not None
    assert presliding.stiffness.value == pytest.approx(stiffness, rel=0.15)  # low: smoothing blurs the friction alone
    assert presliding.backlash is not None
    assert abs(presliding.backlash.value) < 0.1 / stiffness * 2


@pytest.mark.parametrize("dry", [0.1, 0.4, 0.7])
def test_a_damper_beside_dry_friction_is_no_contact_that_gives_way(dry: float) -> None:
    """On a rigid contact friction jumps as the motion turns round, and grows from there with the speed."""
    t = np.arange(8000) / 1000
    x, speed = 2e-3 * np.sin(2 * np.pi * t), np.cos(2 * np.pi * t)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        force = dry * np.sign(speed) + (1 - dry) * speed + rng.normal(0, 0.01, t.size)
        verdict = ""
        with contextlib.suppress(EstimateError):  # where the jump has no samples that a line goes through
            verdict = ss.cycle.presliding(ss.Record.of({"x": x, "friction": force}, fs=1000)).verdict
        assert verdict != "gives way"


@pytest.mark.parametrize("seed", range(5))
def test_noise_has_no_static_friction(seed: int) -> None:
    t = np.arange(5000) / 500
    noise = np.random.default_rng(seed).normal(0, 0.02, t.size)
    record = ss.Record.of({"x": 5e-3 * np.sin(2 * np.pi * 1.3 * t), "friction": noise}, fs=500)
    with pytest.raises(EstimateError, match="needs a sliding friction"):
        ss.cycle.breakaway(record)


def test_a_rigid_contact_is_called_rigid() -> None:
    presliding = ss.cycle.presliding(driven(ss.laws.Coulomb(1.0)))
    assert presliding.verdict == "rigid"
    assert presliding.stiffness is None
    assert "would be seen" in presliding.evidence


def test_a_mass_that_moves_against_its_load_leaves_it_open() -> None:
    record = driven(ss.laws.Coulomb(1.0))
    moved = record["x"] - 3e-5 * record["friction"]  # the sensor's foot gives way, not the contact
    presliding = ss.cycle.presliding(ss.Record.of({"x": moved, "friction": record["friction"]}, fs=FS))
    assert presliding.verdict == "can not be told"
    assert "against its load" in presliding.status


def test_play_is_measured() -> None:
    time = np.arange(8000) / 1000
    x = 4e-3 * np.sin(2 * np.pi * time)
    friction, spring, play = np.zeros(time.size), 0.0, 0.0
    for row in range(1, time.size):  # a gap of 1 mm before a spring of 5000 N/m that slips at 2 N
        way = x[row] - x[row - 1]
        if 0 < abs(play + way) < 0.5e-3 and spring == 0:
            play += way
            continue
        before = spring
        spring = float(np.clip(spring + 5000 * way, -2, 2))
        if before * spring < 0:
            spring, play = 0.0, -0.5e-3 * np.sign(way)
        friction[row] = spring
    record = ss.Record.of({"x": x, "friction": friction}, fs=1000)
    presliding = ss.cycle.presliding(record)
    assert presliding.backlash is not None
    assert presliding.backlash.value == pytest.approx(1e-3, rel=0.1)
    assert presliding.stiffness is not None
    assert presliding.stiffness.value == pytest.approx(5000, rel=0.05)


def test_ringing_after_each_breakaway_is_named() -> None:
    time = np.arange(12000) / 1000
    v = np.cos(2 * np.pi * 0.5 * time)
    since = np.mod(time + 0.5, 1.0)  # the velocity changes its sign at 0.5 s, 1.5 s ...
    way = np.sign(v)
    friction = way * (2 + 0.6 * np.exp(-since / 0.1) * np.cos(2 * np.pi * 47 * since))
    friction += np.random.default_rng(0).normal(0, 0.005, time.size)
    breakaway = ss.cycle.breakaway(ss.Record.of({"x": np.sin(np.pi * time) / np.pi, "friction": friction}, fs=1000))
    for each in (breakaway.ringing_forward, breakaway.ringing_back):
        assert each is not None
        assert each.value == pytest.approx(47, rel=0.03)


def test_a_friction_that_swings_all_the_while_is_flagged() -> None:
    time = np.arange(12000) / 1000
    v = np.cos(np.pi * time)
    shaken = np.sign(v) * (2 + 1.5 * np.sin(2 * np.pi * 23 * time) * (v < 0))
    breakaway = ss.cycle.breakaway(ss.Record.of({"x": np.sin(np.pi * time) / np.pi, "friction": shaken}, fs=1000))
    assert breakaway.swing_forward is not None
    assert breakaway.swing_forward.status == "ok" or "cycles" in breakaway.swing_forward.status
    assert breakaway.swing_back is not None
    assert "no steady friction" in breakaway.swing_back.status


def test_strokes_are_needed() -> None:
    time = np.arange(4000) / 1000
    record = ss.Record.of({"x": time, "friction": np.ones(4000)}, fs=1000)
    with pytest.raises(EstimateError, match=r"cycle|stroke"):
        ss.cycle.breakaway(record)
    with pytest.raises(RecordError, match="friction"):
        ss.cycle.presliding(ss.Record.of({"x": np.sin(time)}, fs=1000))


def sawtooth(rate: float, *, period: float = 0.5, noise: float = 1e-3, fs: float = 1000) -> ss.Record:
    time = np.arange(int(20 * fs)) / fs
    force = 0.3 + rate * np.mod(time, period) + np.random.default_rng(1).normal(0, noise, time.size)
    return ss.Record.of({"load": force}, fs=fs)


@pytest.mark.parametrize("rate", [0.1, 3.0])
def test_a_pulled_slider_is_loaded_at_the_rate_of_its_spring(rate: float) -> None:
    slider = ss.balance.pulled_slider(sawtooth(rate, noise=1e-3 * rate))
    assert slider.regime == "stick-slip"
    assert slider.loading_rate.value == pytest.approx(rate, rel=0.02)
    assert slider.frequency.value == pytest.approx(2.0, rel=0.01)
    assert slider.drop.value == pytest.approx(0.5 * rate, rel=0.1)


def test_a_slider_that_swings_is_not_called_stick_slip() -> None:
    time = np.arange(20000) / 1000
    wave = 1 + 0.1 * np.sin(2 * np.pi * 3 * time) + np.random.default_rng(2).normal(0, 1e-3, time.size)
    slider = ss.balance.pulled_slider(ss.Record.of({"load": wave}, fs=1000))
    assert slider.regime == "inertial"
    assert slider.rise_over_fall.value == pytest.approx(1.0, abs=0.1)
    assert "does not stick" in slider.loading_rate.status


def test_a_force_that_does_not_drop_tells_nothing_of_slips() -> None:
    with pytest.raises(EstimateError, match="three slips"):
        ss.balance.pulled_slider(ss.Record.of({"load": np.linspace(0, 1, 5000)}, fs=1000))


def test_a_slip_that_the_end_of_the_record_cuts_is_not_counted() -> None:
    """The last drop is half as far: of a few that would be seen in their mean."""
    time = np.arange(1750) / 1000  # five swings and a quarter beyond the last maximum
    wave = 1 + 0.1 * np.cos(2 * np.pi * 3 * time) + np.random.default_rng(3).normal(0, 1e-4, time.size)
    slider = ss.balance.pulled_slider(ss.Record.of({"load": wave}, fs=1000))
    assert slider.drop.value == pytest.approx(0.2, rel=0.02)
    assert len(slider.slips) == 4


def moved_by_a_crank(seed: int, static: float, *, filtered: bool) -> ss.Record:
    """Friction that is measured on a face moved to and fro, by a cell whose filter overshoots as Butterworth's."""
    rng, over = np.random.default_rng(seed), 10
    fs, pace = float(rng.choice([500, 1000, 2000])), rng.uniform(0.3, 2)
    t = np.arange(int(12 * fs / pace) * over) / (fs * over)
    turn = 2 * np.pi * pace * t + rng.uniform(0, 6)
    friction = np.sign(np.cos(turn)) * (1 + (static - 1) * np.exp(-np.abs(np.cos(turn)) / 0.1))
    if filtered:
        friction = lfilter(*butter(2, rng.uniform(0.05, 0.3) / (over / 2)), friction)
    x, friction = 3e-3 * np.sin(turn)[::over], friction[::over]
    noisy = {
        "x": x + rng.normal(0, 1e-6, x.size),
        "friction": friction + rng.normal(0, rng.uniform(0.003, 0.02), x.size),
    }
    return ss.Record.of(noisy, fs=fs)


@pytest.mark.parametrize("filtered", [False, True], ids=["bare", "filtered"])
def test_a_peak_that_was_measured_is_no_surer_than_its_sensor(filtered: bool) -> None:
    """Without static friction none is claimed, with it the interval holds what is borne at rest."""
    ratios = {
        static: [ss.cycle.breakaway(moved_by_a_crank(seed, static, filtered=filtered)).ratio for seed in range(12)]
        for static in (1.0, 1.3)
    }
    assert not [ratio for ratio in ratios[1.0] if ratio.interval[0] > 1.0]
    assert sum(ratio.includes(1.3) for ratio in ratios[1.3]) >= 11
    assert sum(ratio.interval[0] > 1.0 for ratio in ratios[1.3]) >= (
        3 if filtered else 9
    )  # a filter hides the brief ones
