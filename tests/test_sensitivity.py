"""Derivatives of a motion by its parameters, event by event: against central differences of the motion itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.parameters import find
from stickslip.solve.sensitivity import sensitivity

RIG: dict[str, Any] = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.5}
TIME = np.arange(200) / 200
SWEPT = 1e-3 * np.sin(10 * np.pi * TIME) + 0.5e-3 * np.sin(14 * np.pi * TIME)
STEP = 1e-6
DRIVES = [ss.drives.HarmonicBase(0.65e-3, frequency=2.5), ss.drives.Recorded(SWEPT, fs=200.0)]
LAWS = {
    "static": (ss.laws.Coulomb(0.95, static=1.2), ["kinetic", "damping", "stiffness"]),
    "compliant": (ss.laws.CompliantContact(0.95, stiffness=192000, damping=24.0), ["kinetic", "law.stiffness"]),
    "state": (ss.laws.StateVariable(0.95, rate=120.0, steepness=3000.0), ["kinetic", "rate", "damping"]),
}


@pytest.mark.parametrize("drive", DRIVES, ids=["tone", "knots"])
@pytest.mark.parametrize("name", LAWS)
def test_a_motion_changes_as_its_neighbours_differ(name: str, drive: Any) -> None:
    law, free = LAWS[name]
    system = ss.Oscillator(law=law, drive=drive, **RIG)
    start, times = {"x": 2e-4, "v": 0.03}, np.linspace(0.0, 0.79, 400)

    def moved(name: str, share: float) -> ss.Oscillator:
        value: Any = system
        for part in find(system, name)[0]:
            value = getattr(value, part)
        return system.having(**{name: value * (1 + share)})

    run = ss.simulate(system, duration=0.8, start=start)
    told = sensitivity(run, [moved(name, STEP) for name in free], step=STEP, starts={}, scaled=[], outputs=("x", "a"))
    for k, parameter in enumerate(free):
        near = [ss.simulate(moved(parameter, share), duration=0.8, start=start) for share in (-1e-4, 1e-4)]
        for output in ("x", "a"):
            (low, before), (high, after) = (each.sample(times, (output,)) for each in near)
            same = before == after  # a jump that has crossed an instant has no slope
            slope = told.sample(times, output)[k]
            assert np.allclose(slope[same], ((high - low)[0] / 2e-4)[same], atol=1e-4 * np.abs(slope).max(), rtol=0)


BELT, TONE = ss.drives.Belt(0.02), DRIVES[0]
FALLING = ss.laws.Stribeck(0.95, 1.2, speed=0.01)
CURVED = {
    "Stribeck": (FALLING, TONE, ["kinetic", "law.speed", "stiffness", "drive.frequency"]),
    "Stribeck swept": (FALLING, DRIVES[1], ["static", "mass"]),
    "LuGre": (ss.laws.LuGre(0.95, 1.2, 0.01, 2e4, 20.0), BELT, ["static", "law.damping", "drive.speed"]),
    "in series": (ss.laws.InSeries(FALLING, 2e4, 60.0), TONE, ["law.stiffness", "law.damping"]),
}


def _differenced(system: ss.Oscillator, name: str, times: Any, **run: Any) -> tuple[Any, Any, Any]:
    """By runs of neighbours to the fourth order: dx/dp, dv/dp, and by how much events come later."""
    path = find(system, name)[0]
    value: Any = system
    for part in path:
        value = getattr(value, part)
    step = 1e-4 * value
    runs = [ss.simulate(system.having(**{name: value + k * step}), **run) for k in (-2, -1, 1, 2)]
    told = [[one.sample(times, ("x",))[0][0] for one in runs], [one.sample(times, ("v",))[0][0] for one in runs]]
    series = [np.array(rows) for rows in (*told, [one.starts[1:] for one in runs])]
    return tuple((8 * (s[2] - s[1]) - (s[3] - s[0])) / (12 * step) for s in series)  # type: ignore[return-value]


@pytest.mark.parametrize("name", CURVED)
def test_a_curved_motion_changes_as_its_neighbours_differ(name: str) -> None:
    """To what the differences of four runs are true to; between events, where a velocity has a slope."""
    law, drive, free = CURVED[name]
    system = ss.Oscillator(law=law, drive=drive, **RIG)
    run = {"duration": 0.8, "start": {"x": 2e-4, "v": 0.03}}
    by = ss.solve.sensitivities(ss.simulate(system, **run), *free)
    times = np.linspace(0.0, 0.79, 400)
    for k, parameter in enumerate(free):
        place, _, later = _differenced(system, parameter, times, **run)
        assert np.allclose(by.sample(times)[k], place, atol=1e-7 * np.abs(place).max(), rtol=0)
        moved = by.events[k]
        assert np.allclose(moved, later[: len(moved)], atol=1e-6 * np.abs(later).max(), rtol=0)


@pytest.mark.parametrize("law", [ss.laws.Coulomb(0.95, static=1.2), FALLING])
def test_a_start_that_was_not_given_moves_with_the_belt(law: Any) -> None:
    """The mass begins at the belt's speed."""
    system = ss.Oscillator(law=law, drive=BELT, **RIG)
    by = ss.solve.sensitivities(ss.simulate(system, duration=1.0), "drive.speed")
    times = np.linspace(0.0, 0.99, 50)
    place, *_ = _differenced(system, "drive.speed", times, duration=1.0)
    assert np.allclose(by.sample(times)[0], place, atol=1e-7 * np.abs(place).max(), rtol=0)


def test_rate_and_state_moves_with_its_distance_as_its_neighbours_do() -> None:
    """Reversing, with steps and leaps of both kinds; the age that it begins with is the distance's."""
    law = ss.laws.RateState(10.0, 0.6, 0.01, 0.015, 1e-3, 1e-3)
    system = ss.Oscillator(1.0, 1.0, law, ss.drives.HarmonicForce(8.0, 0.1), 0.05)
    run = {"duration": 12.0, "start": {"x": 0.0, "v": 0.01}}
    motion: Any = ss.simulate(system, **run)
    assert len(motion.steps.polys) > 0
    times = np.linspace(0.0, 11.9, 200)
    for name in ("direct", "law.distance"):
        place, *_ = _differenced(system, name, times, **run)
        told = ss.solve.sensitivities(motion, name).sample(times)[0]
        assert np.allclose(told, place, atol=1e-6 * np.abs(place).max(), rtol=0)


@pytest.mark.parametrize("law", ["aging", "slip"])
def test_a_motion_that_turns_under_rate_and_state_changes_as_its_neighbours_differ(law: str) -> None:
    """Where the slip turns friction is the logarithm of nothing: no step is short enough for a derivative."""
    rock = ss.laws.RateState(1.54, 0.6, 0.0141, 0.012, distance=5.83e-4, reference=7.7e-3, law=law)
    system = ss.Oscillator(1.1, 31.0, rock, ss.drives.HarmonicForce(1.99, 0.9081, 0.73), damping=0.1)
    run = ss.simulate(system, duration=4.0)
    assert run.event_counts()["reversal"] > 4
    times = np.array([1.1, 2.39, 3.2, 3.9])
    for name, own in zip(
        ("stiffness", "mass"), ss.solve.sensitivities(run, "stiffness", "mass").sample(times), strict=True
    ):
        step = 1e-6 * getattr(system, name)
        near = [ss.simulate(system.having(**{name: getattr(system, name) + s}), duration=4.0) for s in (step, -step)]
        x = [one.sample(times, ("x",))[0][0] for one in near]
        assert own == pytest.approx((x[0] - x[1]) / (2 * step), rel=2e-5)


def test_a_curve_without_a_fall_changes_as_coulomb_friction_does() -> None:
    """One is carried by collocation, the other by closed forms."""
    laws = [ss.laws.Stribeck(0.95, 0.95, speed=0.01), ss.laws.Coulomb(0.95)]
    runs = [
        ss.simulate(ss.Oscillator(law=law, drive=TONE, **RIG), duration=0.8, start={"x": 2e-4, "v": 0.03})
        for law in laws
    ]
    free, times = ("stiffness", "mass", "damping", "drive.amplitude"), np.linspace(0.0, 0.79, 200)
    curved, linear = (ss.solve.sensitivities(run, *free) for run in runs)
    for one, other in ((curved.sample(times), linear.sample(times)), (curved.events, linear.events)):
        assert np.allclose(one, other, atol=1e-7 * np.abs(other).max(axis=1, keepdims=True), rtol=0)


def test_a_lag_is_refused_with_its_reason() -> None:
    system = ss.Oscillator(law=ss.laws.TimeDelay(FALLING, 0.01), drive=TONE, **RIG)
    with pytest.raises(ss.errors.ModelError, match="time lag"):
        ss.solve.sensitivities(ss.simulate(system, duration=0.1), "stiffness")
