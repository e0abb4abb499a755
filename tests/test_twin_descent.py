"""The descent to the rig nearest to a record ends at the floor of a valley, however bent that is."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import stepped
import stickslip as ss
from stickslip.estimate import stands
from stickslip.twin import descent, search
from stickslip.twin.belief import BENT, EXCESS, GIVE, HELD, KINETIC, LATE, LOSS, POWER, RATE, SLOPE, SPEED, Belief

RIG = stepped.Rig("compliant", 0.52, 0.51, 0.0122, 1.02e-3, 0.248, kinetic=2.08e-4, contact=2.556, loss=0.172)


@cache
def nearest() -> Belief:
    """The rig nearest to a record that begins in slip, as its contact relaxes: searched from the true one."""
    record = stepped.record(RIG, np.random.default_rng(11), noise=1.4e-4)
    told = ss.friction_force(record.rows(90, len(record)), **RIG.stated)
    (drive,) = search.possible_drives(told, ss.drives.HarmonicBase(0.0, frequency=1.0))
    simple = search._linear(told, ss.Oscillator(law=search.LinearSlope(0.0, slope=0.0), **RIG.stated), drive)
    loss = RIG.loss / math.sqrt(RIG.contact * RIG.mass)
    true = {GIVE: math.log(RIG.contact), LOSS: loss, BENT: 0.0, KINETIC: RIG.kinetic, SLOPE: 0.0}
    begun = replace(simple.as_stated().at(**true), held=LOSS, fit=None)
    led = search._descended_along(begun, [told.rows(0, samples) for samples in search._horizons(told)])
    return descent.refined(replace(led, record=told, held=""))


def test_a_damped_contact_is_found_from_along_its_valley() -> None:
    """Newton's step halved ended on the valley's side, 87 to 280 of chi-squared above its floor, 5 % too stiff."""
    best = nearest()
    assert best.fit is not None
    for loss in (0.02, 0.05):
        for bent in (-0.1, 0.1):
            along = {LOSS: best.values[LOSS] - loss, GIVE: best.values[GIVE] + 2.9 * loss, BENT: bent}
            end = descent.refined(replace(best.at(**along), fit=None))
            assert best.fit.freedom * math.log(descent.misfit(end) / descent.misfit(best)) < 1
            assert end.contact == pytest.approx(RIG.contact, rel=0.01)


def test_a_descent_goes_on_while_it_tells_laws_apart() -> None:
    """Of a contact whose damping was held far off, with the mass and the spring astray for it: 74 above the floor."""
    rng = np.random.default_rng(np.random.SeedSequence([311101, 3]).spawn(1)[0])
    rig = stepped.drawn("compliant", rng)
    rig = replace(rig, loss=rng.uniform(0, 0.15) * np.sqrt(rig.contact * rig.mass))
    record = stepped.record(rig, rng, noise=10 ** rng.uniform(-4, -2.3), off=0.005)
    record = record.with_details("x", gain_sd=0.005).with_details("z", gain_sd=0.005)
    written = {name: value * (1 + 0.005 * rng.standard_normal()) for name, value in rig.stated.items()}
    told = ss.friction_force(record, **{name: (value, 0.005 * value) for name, value in written.items()})
    (drive,) = search.possible_drives(told, ss.drives.HarmonicBase(0.0, frequency=1.0))
    simple = search._linear(told, ss.Oscillator(law=search.LinearSlope(0.0, slope=0.0), **written), drive)
    astray = {
        "x": -6.5096e-4, "v": 2.33113e-3, "mass": 0.32021, "spring": 0.296247, "damper": 0.0, "gain of x": -5.0927e-3,
        "drive 0": -5.13297e-3, KINETIC: 6.084e-3, SLOPE: -7.4406e-3, GIVE: 6.770135, BENT: 1.124e-3, LOSS: 0.5,
    }  # fmt: skip
    ends = [descent.descended(simple.as_stated().at(**astray), passes)[0] for passes in (20, 100)]
    assert ends[0].fit is not None
    assert ends[0].fit.freedom * math.log(descent.misfit(ends[0]) / descent.misfit(ends[1])) < 1


@pytest.mark.parametrize("static", [None, 2.6])
def test_what_comes_back_to_the_law_it_contains_is_led_no_further(static: float | None) -> None:
    """A stiffness that goes on rising, on a contact that does not give way: where static friction tells x better."""
    law = ss.laws.Coulomb(2.0, static=static)
    slider = ss.Oscillator(mass=2.0, stiffness=800, law=law, drive=ss.drives.HarmonicBase(4e-3, 2.0))
    record = ss.Rig.perfect("x", "z").having("x", white=1e-6).measure(ss.simulate(slider, duration=3), fs=500, rng=1)
    told = ss.friction_force(record, mass=2.0, stiffness=800.0, damping=0.0)
    (drive,) = search.possible_drives(told, slider.drive)
    simple = search._linear(told, slider, drive)
    rigid = descent.refined(simple.at(**{EXCESS: 0.3}))
    stiff = descent.linearised(simple.at(**{GIVE: math.log(4e9), BENT: 0.0}))
    families = [[rigid], [stiff]]
    promising = search._promising(families, simple, None)
    assert promising == (families if static is None else [[rigid]])
    runaway = [[simple.at(**{SLOPE: -1e5})]]  # whose motion outgrows all numbers
    assert search._promising(runaway, simple, None) == runaway


def test_a_memory_without_friction_has_slopes() -> None:
    """Its law is a line's then, and its neighbour's has a memory: the tables of both were built as of one kind."""
    slider = ss.Oscillator(mass=2.0, stiffness=800, law=ss.laws.Coulomb(1.0), drive=ss.drives.HarmonicBase(4e-3, 2.0))
    record = ss.Rig.perfect("x", "z").measure(ss.simulate(slider, duration=3), fs=500, rng=1)
    told = ss.friction_force(record, mass=2.0, stiffness=800.0, damping=0.0)
    (drive,) = search.possible_drives(told, slider.drive)
    still = search._linear(told, slider, drive).at(**{KINETIC: 0.0, SLOPE: 0.0, RATE: 5.0, HELD: 0.0})
    fit = descent.linearised(still).fit
    assert fit is not None
    assert KINETIC in fit.names


def test_values_that_x_does_not_tell_apart_have_a_step_without_noise_too() -> None:
    """A mass, a spring and a friction in one proportion move nothing: without noise no damping held them (singular)."""
    slider = ss.Oscillator(mass=2.0, stiffness=800, law=ss.laws.Coulomb(1.0), drive=ss.drives.HarmonicBase(4e-3, 2.0))
    record = ss.Rig.perfect("x", "z").measure(ss.simulate(slider, duration=3), fs=500, rng=1)
    told = ss.friction_force(record, mass=(2.0, 0.02), stiffness=(800.0, 8.0), damping=(0.0, 0.1))
    (drive,) = search.possible_drives(told, slider.drive)
    simple = search._linear(told, slider, drive)
    still = replace(simple, unsure={"mass": 1e-2, "spring": 1e-2}).at(mass=0.0, spring=0.0)
    with np.errstate(all="raise"):
        fit = descent.linearised(still).fit
        assert fit is not None
        for damping in descent.DAMPINGS:
            assert np.isfinite(descent._damped_step(still, fit, damping)).all()


def test_a_curve_whose_speed_x_does_not_tell_leaves_its_level_told() -> None:
    """Of friction that hardly falls speed and kinetic part go together: by the speed alone a level fell to nothing."""
    belief = nearest()
    fastest, excess = float(np.max(np.abs(belief.record["v"]))), belief.kinetic
    curved = belief.at(**{EXCESS: excess, SPEED: math.log(9 * fastest), POWER: 0.0})
    falls = (curved.at(**{SPEED: curved.values[SPEED] + 1e-4}).kinetic - curved.kinetic) / 1e-4
    assert belief.fit is not None
    root = np.array([[-1.8 * falls], [2.0]])  # a factor of e^2 in its speed, of which the kinetic part takes up 0.9
    low, high = descent.linear_ends(
        replace(curved, fit=replace(belief.fit, names=(KINETIC, SPEED), root=root)), kinetic, 2.0
    )
    assert curved.kinetic - 0.4 * excess < low < curved.kinetic < high < curved.kinetic + 0.4 * excess


def kinetic(rig: Belief) -> float:
    """The sliding friction of a rig [N]."""
    return rig.kinetic


def test_static_friction_of_one_breakaway_is_found_beside_constants_that_are_off() -> None:
    """Led over its beginning, a record from rest ended without any, and a curve at 1.04 times was taken for it."""
    rig = stepped.Rig("static", 0.3115, 71.95, 0.1395, 0.5494e-3, 3.5028, kinetic=0.01269, static=0.01614)
    rng, fs = np.random.default_rng(2), 1000.0
    samples, level = round(20 * fs / rig.frequency), 5e-3 * rig.amplitude
    (x, _, _), *_ = stepped.marched(rig, samples, 0, fs, stepped.STEPS)
    z = rig.amplitude * np.sin(2 * np.pi * rig.frequency * np.arange(samples) / fs)
    noisy = {name: values + level * rng.standard_normal(samples) for name, values in {"x": x, "z": z}.items()}
    record = ss.Record.of(noisy, fs=fs).with_details("x", gain_sd=0.005).with_details("z", gain_sd=0.005)
    mass, stiffness = (0.996 * rig.mass, 0.005 * rig.mass), (1.01 * rig.stiffness, 0.005 * rig.stiffness)
    belief = search.believe(ss.analyze(record, mass=mass, stiffness=stiffness, damping=rig.damping).record)
    assert belief.ratio == pytest.approx(rig.static / rig.kinetic, rel=0.04)


def test_a_load_that_swings_is_named_and_no_constant_that_is_off() -> None:
    """Friction that follows a recorded load led to a command that corrected the spring by 10 %."""
    fs, (m, k, c), level = 500.0, (0.45, 1950.0, 0.36), 1e-4
    t, w = np.arange(2000) / fs, 2 * np.pi * 4.0
    normal = 37.0 * (1 + 0.2 * np.sin(2 * np.pi * 4.33 * t))
    x, v, a = (1e-3 * w**n * np.sin(w * t + n * np.pi / 2) for n in range(3))
    z = x + (m * a + c * v + 0.01 * normal * np.sign(v)) / k
    rng = np.random.default_rng(0)
    noisy = {name: values + level * 1e-3 * rng.standard_normal(t.size) for name, values in {"x": x, "z": z}.items()}
    tried = ss.tried(
        ss.analyze(ss.Record.of({**noisy, "normal": normal}, fs=fs), mass=m, stiffness=k, damping=c), twins=8
    )
    assert "its normal load swings by 14 %" in tried.loops.level.status
    assert not ss.summary(tried).remedies


@pytest.mark.parametrize("amplitude", [2e-3, pytest.param(4e-3, marks=pytest.mark.soak)])
def test_static_friction_of_a_record_that_is_late_is_found_with_the_delay(amplitude: float) -> None:
    """A gain a fifth off and x 5 or 11 ms early were said, without static friction, and a command to mend them."""
    rig = stepped.Rig("static", 2.4, 2500.0, 1.0, amplitude, 2.0, kinetic=1.8, static=2.2)
    rng, fs, samples = np.random.default_rng(4), 1000.0, 4000
    (x, _, _), *_ = stepped.marched(rig, samples, 1000, fs, stepped.STEPS)
    z = rig.amplitude * np.sin(2 * np.pi * rig.frequency * np.arange(samples) / fs)
    late = {"x": x[:-2], "z": z[2:]}
    noisy = {name: values + 2e-6 * rng.standard_normal(samples - 2) for name, values in late.items()}
    believed = search.believe(ss.friction_force(ss.Record.of(noisy, fs=fs), **rig.stated))
    assert believed.slipped == (LATE,)
    assert believed.values[LATE] == pytest.approx(2 / fs, rel=0.05)
    assert (believed.kinetic, believed.ratio) == pytest.approx((rig.kinetic, rig.static / rig.kinetic), rel=0.01)


def test_a_rig_that_is_nowhere_near_bounds_no_friction() -> None:
    """Below 940883 GN was said of a contact that only gives way."""
    fs, w, rng = 500.0, 6 * math.pi, np.random.default_rng(0)
    t = np.arange(4000) / fs
    z, x = 5e-3 * np.sin(w * t), 5e-5 * np.sin(w * t - 0.3) ** 3
    noisy = {"x": x + 1e-7 * rng.standard_normal(t.size), "z": z}
    tried = ss.tried(ss.analyze(ss.Record.of(noisy, fs=fs), mass=1.0, stiffness=3000.0, damping=1.0), twins=8)
    assert tried.trial.belief.left > 0.3
    for estimate in (tried.loops.level, tried.loops.forward, tried.loops.back):
        assert not stands(estimate.status)
        assert max(map(abs, estimate.interval)) < 100.0
