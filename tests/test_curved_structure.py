"""Curved laws at the contacts of structures, under loads that follow the motion, and behind a compliant contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stickslip as ss
from stickslip import drives, laws
from stickslip.solve.assembly import table_of

Array = NDArray[np.float64]
FREQUENCY = 0.12
OMEGA = 2 * math.pi * FREQUENCY
CURVE = laws.Stribeck(0.3, 0.45, speed=0.3)


def _force(speed: float) -> float:
    """Stribeck's curve as the literature prints it (Bo and Pavelescu), of a speed of either sign."""
    return math.copysign(0.3 + 0.15 * math.exp(-((abs(speed) / 0.3) ** 2)), speed)


def test_a_structure_of_one_mass_is_the_oscillator() -> None:
    drive = drives.HarmonicForce(1.0, FREQUENCY)
    one = ss.Oscillator(1.0, 1.0, CURVE, drive, 0.02)
    same = ss.Structure(1.0, 0.02, 1.0, [ss.Contact(CURVE, [1.0])], drive)
    runs = [ss.simulate(system, cycles=6) for system in (one, same)]
    times = np.linspace(0, runs[0].duration, 400)
    a, b = (run.sample(times, ("x", "v", "a", "friction", "slip"))[0] for run in runs)
    np.testing.assert_array_equal(a, b)
    assert [event[:2] for event in runs[0].events] == [event[:2] for event in runs[1].events]
    orbits = [ss.steady_state(system) for system in (one, same)]
    assert orbits[0].amplitude == pytest.approx(orbits[1].amplitude, rel=1e-12)
    assert orbits[1].status == "unique"
    np.testing.assert_allclose(abs(orbits[0].multipliers), abs(orbits[1].multipliers), atol=1e-7)


@pytest.mark.parametrize("law", ["aging", "slip"])
def test_rate_and_state_in_a_structure_on_a_belt_is_as_under_one_mass(law: str) -> None:
    """The mass goes with the belt but for a slip 1e10 times slower, of which friction takes the logarithm."""
    rock, belt = laws.RateState(1.8, 0.6, 0.01, 0.015, distance=1e-6, reference=1e-3, law=law), drives.Belt(0.01)
    one = ss.simulate(ss.Oscillator(1.0, 3000.0, rock, belt, 1.0), duration=0.3)
    contact, still = ss.Contact(rock, [1.0, 0.0]), np.diag([1.0, 0.0])
    two = ss.simulate(ss.Structure(np.eye(2), still, np.diag([3000.0, 1.0]), [contact], belt), duration=0.3)
    times = np.linspace(0, 0.3, 301)
    x = one.sample(times, ("x",))[0][0]
    assert np.ptp(x) > 2e-4
    np.testing.assert_allclose(two.sample(times, ("x",))[0][0], x, atol=1e-9 * np.ptp(x))


def _slid(rates: Callable[[float, Array], list[float]], start: list[float], side: Callable[[Array], float], end: float):  # type: ignore[no-untyped-def]
    """Radau's method through the slips of a system, to where `side` no longer has its sign."""

    def stops(_: float, state: Array) -> float:
        return side(state)

    stops.terminal, stops.direction = True, -math.copysign(1.0, side(np.array(start)))  # type: ignore[attr-defined]
    return solve_ivp(rates, (0.0, end), start, "Radau", events=stops, rtol=1e-9, atol=1e-11, dense_output=True)


def test_stribeck_under_a_load_that_follows_the_motion() -> None:
    """Two motions, the second presses the contact of the first: against Radau, up to the first stop."""
    pad = ss.Contact(CURVE, [1.0, 0.0], normal=[0.0, 1.0], stiffness=2.0, preload=1.0)
    springs = [[3.0, -1.0], [-1.0, 2.0]]
    drive = drives.HarmonicForce(0.5, FREQUENCY)
    system = ss.Structure(np.diag([1.0, 2.0]), 0.05 * np.eye(2), springs, [pad], drive)
    begin = {"x1": -1.0, "v1": 0.5, "x2": 0.1, "v2": 0.0}
    run = ss.simulate(system, duration=6.0, start=begin)

    def rates(t: float, state: Array) -> list[float]:
        x, y, v, w = state
        load, pull = 1.0 + 2.0 * y, 0.5 * math.cos(OMEGA * t)
        return [
            v,
            w,
            pull - 3.0 * x + y - 0.05 * v - load * _force(v),
            (pull + x - 2.0 * y - 0.05 * w - 2.0 * y) / 2.0,
        ]

    truth = _slid(rates, [-1.0, 0.1, 0.5, 0.0], lambda s: float(s[2]), 6.0)
    event = run.events[0]
    assert (event.kind, truth.status) == ("reversal", 1)
    assert event.time == pytest.approx(truth.t[-1], abs=1e-7)
    times = np.linspace(0, truth.t[-1], 50)
    np.testing.assert_allclose(run.sample(times, ("x",))[0], truth.sol(times)[:2], atol=2e-8)
    assert ss.solve.energy(run).residual < 1e-10
    (load,), _ = run.sample(np.linspace(0, 6, 100), ("load",))
    assert np.all((load > 0) == (run.sample(np.linspace(0, 6, 100), ("friction",))[0][0] != 0))  # it lifts for a while
    assert np.min(load) == 0


def test_stribeck_behind_a_compliant_contact() -> None:
    """The thesis's chapter 8.2: against Radau, the slider's speed solved from the balance at every instant."""
    stiffness, damping = 50.0, 3.0
    drive = drives.HarmonicForce(1.0, FREQUENCY)
    system = ss.Oscillator(1.0, 1.0, laws.InSeries(CURVE, stiffness, damping), drive, 0.02)
    run = ss.simulate(system, cycles=2)
    events = run.events
    assert [event.kind for event in events[:4]] == ["slip", "microstick", "slip", "microstick"]

    def slider(x: float, v: float, y: float) -> float:
        def balance(w: float) -> float:
            return stiffness * (x - y) + damping * (v - w) - _force(w)

        return float(brentq(balance, 1e-300, 10.0, xtol=1e-15)) if balance(1e-300) > 0 else 0.0

    def rates(t: float, state: Array) -> list[float]:
        x, v, y = state
        w = slider(x, v, y)
        force = stiffness * (x - y) + damping * (v - w)
        return [v, math.cos(OMEGA * (begin + t)) - x - 0.02 * v - force, w]

    begin = events[0].time
    at = run.state(begin)
    middle = begin + 0.2  # past the corner of the balance at no speed
    at = run.state(middle)
    begin = middle
    truth = _slid(rates, [at["x"], at["v"], at["slider"]], lambda s: slider(*s) - 1e-9, events[1].time - middle + 1.0)
    assert truth.t[-1] + middle == pytest.approx(events[1].time, abs=1e-6)
    times = np.linspace(0, truth.t[-1], 50)
    x, y = run.sample(times + middle, ("x", "slider"))[0]
    np.testing.assert_allclose([x, y], truth.sol(times)[[0, 2]], atol=2e-8)
    assert ss.solve.energy(run).residual < 1e-10


def test_a_very_stiff_contact_is_a_rigid_one() -> None:
    drive = drives.HarmonicForce(1.0, FREQUENCY)
    times = np.linspace(0, 10, 200)
    rigid = ss.simulate(ss.Oscillator(1.0, 1.0, CURVE, drive, 0.02), duration=10).sample(times, ("x",))[0]
    apart = []
    for stiffness in (1e3, 1e5):
        law = laws.InSeries(CURVE, stiffness, 5.0)
        x = ss.simulate(ss.Oscillator(1.0, 1.0, law, drive, 0.02), duration=10).sample(times, ("x",))[0]
        apart.append(float(np.max(np.abs(x - rigid))))
    # where the mass turns, it takes sqrt(4 F / (K a)) to bend the contact over: of order one half in the compliance
    assert apart[0] < 0.05
    assert 7 < apart[0] / apart[1] < 14


@pytest.mark.parametrize("damping", [3.0, 0.0])
@pytest.mark.parametrize("law", [laws.Dahl(0.5, 100.0), laws.SmoothStateVariable(0.5, 20.0, 50.0)])
def test_laws_that_remember_in_series_keep_their_balance(law: Any, damping: float) -> None:
    drive = drives.HarmonicForce(1.0, FREQUENCY)
    run = ss.simulate(ss.Oscillator(1.0, 1.0, laws.InSeries(law, 50.0, damping), drive, 0.02), cycles=2, rtol=1e-10)
    memory = next(iter(law.memory))
    x, v, y, w, told, force = run.sample(
        np.linspace(0, run.duration, 300), ("x", "v", "slider", "slider_speed", memory, "friction")
    )[0]
    np.testing.assert_allclose(50.0 * (x - y) + damping * (v - w), force, atol=1e-12)
    np.testing.assert_allclose(force, told, atol=1e-7)  # the slider has no mass: its friction is the spring's force


@pytest.mark.parametrize(
    ("mass", "stiffness", "law"),
    [
        (0.3586819, 161.041, laws.InSeries(laws.Dahl(0.144853479, 4730.717), 874.8763, 7.600167)),
        (0.2, 5000.0, laws.InSeries(laws.Dahl(0.3002404, 1044615.5), 125865.0, 9.084868)),
        (1.0, 1000.0, laws.InSeries(laws.Dahl(1.0, 5000.0), 2000.0, 10.0)),
        (1.0, 1000.0, laws.InSeries(laws.Dahl(1.0, 50000.0), 2000.0, 30.0)),
    ],
)
def test_a_decay_behind_a_compliant_contact_dies_out(mass: float, stiffness: float, law: Any) -> None:
    """In the end the slider turns by rounding alone: to and fro without time, if each turn is believed."""
    system = ss.Oscillator(mass, stiffness, law, damping=0.2 * math.sqrt(mass * stiffness))
    run = ss.simulate(system, cycles=60, start={"x": 3 * law.law.kinetic / stiffness})
    last = run.sample(np.linspace(0.8, 1.0, 50) * run.duration, ("x", "v"))[0]
    assert np.ptp(last[0]) < 1e-14 * law.law.kinetic
    assert np.abs(last[1]).max() < 1e-11 * law.law.kinetic / math.sqrt(mass * stiffness)
    assert ss.solve.energy(run).residual < 1e-11


def test_what_would_jump_is_refused() -> None:
    steep = laws.Stribeck(0.3, 0.45, speed=0.01)
    with pytest.raises(ss.errors.ModelError, match=r"raise damping= above 12\.\d N s/m"):
        laws.InSeries(steep, 50.0, 3.0)
    with pytest.raises(ss.errors.ModelError, match="break-away"):
        laws.InSeries(laws.FrictionCurve(lambda v: 1.0 + 0.1 * v, static=1.5), 50.0, 3.0)
    lagging = laws.TimeDelay(laws.LinearSlope(1.0, 0.1), 0.1)
    with pytest.raises(ss.errors.ModelError, match="SmoothStateVariable"):
        laws.InSeries(lagging, 50.0, 3.0)
    with pytest.raises(ss.errors.ModelError, match="SmoothStateVariable"):
        ss.Contact(lagging, [1.0])


def test_a_file_names_a_curved_contact(tmp_path: Any) -> None:
    text = """
[system]
mass = [[1.0, 0.0], [0.0, 2.0]]
damping = [[0.05, 0.0], [0.0, 0.05]]
stiffness = [[3.0, -1.0], [-1.0, 2.0]]

[[contacts]]
tangent = [1.0, 0.0]
normal = [0.0, 1.0]
stiffness = 2.0
preload = 1.0
law = {name = "Stribeck", kinetic = 0.3, static = 0.45, speed = 0.3}

[drive]
name = "HarmonicForce"
amplitude = 0.5
frequency = 0.12

[run]
duration = 1.0
"""
    path = tmp_path / "pad.toml"
    path.write_text(text)
    case = ss.systems.read_system(path)
    assert isinstance(case.system, ss.Structure)
    assert case.system.contacts[0].law == CURVE


def pressed_by_a_power(power: float) -> ss.Structure:
    """A pad on a belt that couples, whose load grows with a power of its approach."""
    pad = ss.Contact(laws.Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0, power=power)
    return ss.Structure(
        np.eye(2), np.zeros((2, 2)), [[23.25, 3.9], [3.9, 7.75]], contacts=[pad], drive=drives.Belt(0.8)
    )


def motion_under_a_power(power: float, start: list[float], end: float) -> tuple[list[float], Array]:
    """The instants at which that pad stops or starts, and its motion at the end, by scipy."""
    springs, state, now, side, changes = pressed_by_a_power(power).stiffness, np.array(start), 0.0, -1.0, []

    def load(y: Array) -> float:
        return float(5.0 * max(0.0, 1 + 11.0 * y[1] / (5.0 * power)) ** power)

    def rate(_: float, y: Array) -> list[float]:
        force = -np.asarray(springs) @ y[:2] - [side * 0.6 * load(y), load(y) - 5.0]
        return [y[2], y[3], *(force if side else (0.0, force[1]))]

    def change(_: float, y: Array) -> float:
        return float(y[2] - 0.8 if side else abs((springs @ y[:2])[0]) - 0.6 * load(y))

    change.terminal = True  # type: ignore[attr-defined]
    while True:
        options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
        begun = solve_ivp(rate, (now, now + 1e-6), state, **options)
        lap = solve_ivp(rate, (now + 1e-6, end), begun.y[:, -1], events=change, **options)
        now, state = lap.t[-1], lap.y[:, -1]
        if not lap.t_events[0].size:
            return changes, state
        changes.append(now)
        push = -(springs @ state[:2])[0]
        state[2] = 0.8
        side = 0.0 if side and abs(push) < 0.6 * load(state) else float(np.sign(push))


def test_a_load_of_a_power_is_followed_through_lifting() -> None:
    """1.5 is no whole number, of which nothing has no Taylor series."""
    run = ss.simulate(pressed_by_a_power(1.5), duration=9.8, start={"x1": 0.3, "v1": 0.0})
    changes, state = motion_under_a_power(1.5, [0.3, 0.0, 0.0, 0.0], 9.8)
    lifts = [event.time for event in run.events if event.mode == "lifted"]
    assert 8.7 < lifts[0] < 8.8
    own = [event.time for event in run.events if event.mode in ("stuck", "forward", "back") and event.kind != "land"]
    landed = [t for t in own if not np.any(np.abs(np.subtract(changes, t)) < 1e-6)]
    assert len(landed) == len(lifts)
    assert len(own) - len(landed) == len(changes)
    np.testing.assert_allclose(run.sample([9.8], ("x", "v"))[0].ravel(), state, atol=1e-7)


def test_what_asks_for_linear_modes_says_that_the_load_is_curved() -> None:
    with pytest.raises(ss.errors.ModelError, match=r"a load of power 1.5 with curved modes.*leave out power="):
        table_of(pressed_by_a_power(1.5))
