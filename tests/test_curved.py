"""The curved laws against closed forms, and against references of other solvers to the digits those have."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stickslip as ss
from stickslip.laws.base import Exit, Rigid
from stickslip.laws.curved import CurvedMode, asinh, exp, log, sqrt, symbol, tanh
from stickslip.solve import march
from stickslip.solve.tape import tape
from stickslip.solve.taylor import expansion, length

HEAVY = 1e30  # kg: whatever friction does, the mass keeps its speed
LUGRE = ss.laws.LuGre(1.0, 1.5, speed=1e-3, stiffness=1e5, damping=math.sqrt(1e5), viscous=0.4)
ROCK = ss.laws.RateState(5e6, friction=0.6, direct=0.010, evolution=0.015, distance=1e-5, reference=1e-6)
STRIBECK = ss.laws.Stribeck(1.0, 1.5, speed=0.1, exponent=1.0, viscous=0.2)
THESIS = ss.Oscillator(
    mass=2.42,
    stiffness=2310,
    law=ss.laws.SmoothStateVariable(1.1, rate=100.0, steepness=3000.0),
    drive=ss.drives.HarmonicBase(0.6e-3, 2.5),
)


def dragged(law: object, speed: float, duration: float, **options: float) -> ss.solve.Trajectory:
    """A law under a prescribed speed."""
    system = ss.Oscillator(mass=HEAVY, stiffness=0.0, law=law)
    return ss.simulate(system, duration=duration, start={"v": speed}, **options)


def upcrossings(run: ss.solve.Trajectory, name: str, level: float, count: int) -> list[float]:
    """When an entry of the state rises through a level."""
    times = np.linspace(0, run.duration, 20001)
    values = run.sample(times, (name,))[0][0] - level
    rises = np.flatnonzero((values[:-1] < 0) & (values[1:] >= 0))[:count]
    return [brentq(lambda t: run.state(t)[name] - level, times[j], times[j + 1], xtol=1e-14) for j in rises]


@pytest.mark.parametrize(
    ("time", "force"), [(1e-3, 0.70097980308993968), (5e-3, 0.87011348575644943), (1e-2, 0.95804298293237985)]
)
def test_lugre_follows_its_closed_transient_at_constant_speed(time: float, force: float) -> None:
    assert dragged(LUGRE, 0.002, 0.01).state(time)["friction"] == pytest.approx(force, rel=1e-13)


def test_lugre_steady_friction_has_the_printed_curve() -> None:
    known = {1e-5: 1.4999540024999167, 1e-3: 1.1843397205857212, 1e-2: 1.004, 0.1: 1.04,
             0.0029863165817389625: 1.0012614987686114}  # fmt: skip
    for speed, force in known.items():
        assert LUGRE.steady(speed) == pytest.approx(force, rel=1e-14)
    assert dragged(LUGRE, 0.1, 0.02).state(0.02)["friction"] == pytest.approx(1.04, rel=1e-12)


def test_lugre_presliding_is_a_damped_spring() -> None:
    size, w, z = 1e-15, math.sqrt(1e5), 0.50063245553203368
    run = ss.simulate(ss.Oscillator(mass=1, stiffness=0, law=LUGRE), duration=0.02, start={"x": size, "bristle": size})
    times = np.linspace(0, 0.02, 50)
    turn = w * math.sqrt(1 - z * z)
    wave = np.exp(-z * w * times) * (np.cos(turn * times) + z * w / turn * np.sin(turn * times))
    assert np.max(np.abs(run.sample(times, ("x",))[0][0] / size - wave)) < 1e-9


def test_lugre_stick_slip_has_the_reference_period() -> None:
    run = ss.simulate(ss.Oscillator(mass=1, stiffness=2, law=LUGRE, drive=ss.drives.Ramp(0.1)), duration=28)
    known = [7.540397463024532, 13.903117284079828, 20.265837105140747, 26.62855692620443]
    crossings = upcrossings(run, "v", 0.05, 4)
    assert crossings == pytest.approx(known, rel=1e-9)
    assert crossings[3] - crossings[2] == pytest.approx(6.36271982, abs=1e-8)


@pytest.mark.parametrize(
    ("rate", "force"),
    [(1.0, 1.460734471242172), (5.0, 1.379927337908279), (10.0, 1.3070592115581885), (50.0, 0.852414079639229)],
)
def test_lugre_breaks_away_at_the_reference_force(rate: float, force: float) -> None:
    soft = 1e-9  # N/m: the spring's force is that of its end alone
    system = ss.Oscillator(mass=1, stiffness=soft, law=LUGRE, drive=ss.drives.Ramp(rate / soft))
    at = upcrossings(ss.simulate(system, duration=1.6 / rate), "v", 1e-3, 1)[0]
    assert rate * at == pytest.approx(force, rel=1e-8)


def test_dahl_loop_is_the_closed_one() -> None:
    level, stiffness, size = 1.1, 192000.0, 20e-6
    system = ss.Oscillator(
        mass=HEAVY,
        stiffness=0.0,
        law=ss.laws.Dahl(level, stiffness),
        drive=ss.drives.MultiTone([(size, 1.0, 0.0)], on="face"),
    )
    run = ss.simulate(system, cycles=None, duration=4.25)
    turns = [event.time for event in run.events][-3:]
    peaks = [abs(run.state(t)["friction"]) for t in turns]
    assert peaks == pytest.approx([1.0979589461346143] * 3, rel=1e-12)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    work = 0.0
    for begin, end in itertools.pairwise(turns):
        friction, slip = run.sample(begin + (end - begin) * (nodes + 1) / 2, ("friction", "slip"))[0]
        work += float(np.sum(weights * friction * slip)) * (end - begin) / 2
    assert work == pytest.approx(6.2838440817748423e-5, rel=1e-11)


@pytest.mark.parametrize(("exponent", "force"), [(1.0, 1.0664795276239994), (2.0, 0.85506072874493927)])
def test_dahl_loads_as_the_closed_form(exponent: float, force: float) -> None:
    run = dragged(ss.laws.Dahl(1.1, 192000.0, exponent=exponent), 1e-3, 0.02)
    assert run.state(0.02)["friction"] == pytest.approx(force, rel=1e-13)


def test_dahl_with_a_broken_exponent_saturates() -> None:
    level, stiffness, n = 1.1, 192000.0, 0.5
    run = dragged(ss.laws.Dahl(level, stiffness, exponent=n), 1e-3, 0.02)
    way = 5e-6  # (1 - f/f_k)^(1/2) falls in proportion to the way, and reaches zero at 2 f_k / s_0
    assert run.state(way / 1e-3)["friction"] == pytest.approx(level * (1 - (1 - stiffness * way / (2 * level)) ** 2))
    assert run.state(0.02)["friction"] == pytest.approx(level, rel=1e-9)


@pytest.mark.parametrize(
    ("law", "values"),
    [
        ("aging", {0.1: 0.62168278350884353, 1.0: 0.61040432711104689, 3.0: 0.59404069010018018}),
        ("slip", {0.1: 0.6197390517903221, 1.0: 0.60119318029393492, 3.0: 0.59020665895674556}),
    ],
)
def test_rate_and_state_answers_a_velocity_step_as_the_closed_form(law: str, values: dict[float, float]) -> None:
    system = ss.Oscillator(mass=HEAVY, stiffness=0.0, law=ROCK)
    run = ss.simulate(
        system.having(law=ss.laws.RateState(5e6, 0.6, 0.010, 0.015, 1e-5, 1e-6, law=law)),
        duration=60,
        start={"v": 1e-5},
    )
    for time, friction in values.items():
        assert run.state(time)["friction"] / 5e6 == pytest.approx(friction, rel=1e-12)
    assert run.state(0.0)["friction"] / 5e6 == pytest.approx(0.62302585092994046, rel=1e-13)
    assert run.state(60.0)["friction"] / 5e6 == pytest.approx(0.58848707453502977, rel=1e-12)


@pytest.mark.parametrize(
    ("mass", "speed", "stiffness", "turn"),
    [(1e-6, 1e-6, 2.5e9, 0.070710678118654752), (1e3, 0.1, 5.25e10, 7071.0678118654752)],
)
@pytest.mark.parametrize("law", ["aging", "slip"])
def test_rate_and_state_loses_stability_at_the_critical_stiffness(
    law: str, mass: float, speed: float, stiffness: float, turn: float
) -> None:
    rock = ss.laws.RateState(5e6, 0.6, 0.010, 0.015, 1e-5, 1e-6, law=law)
    system = ss.Oscillator(mass=mass, stiffness=stiffness, law=rock, drive=ss.drives.Belt(speed))

    def growth(value: float) -> float:
        return float(ss.solve.steady_sliding(system.having(stiffness=value)).eigenvalues[0].real)

    root = brentq(growth, 0.9 * stiffness, 1.1 * stiffness, rtol=1e-13)
    assert root == pytest.approx(stiffness, rel=1e-6 if mass < 1 else 1e-10)
    fastest = ss.solve.steady_sliding(system).eigenvalues[0]
    assert abs(fastest.imag) == pytest.approx(turn, rel=1e-6 if mass < 1 else 1e-11)


def test_rate_and_state_simulation_turns_at_the_critical_frequency() -> None:
    system = ss.Oscillator(mass=1e3, stiffness=5.25e10, law=ROCK, drive=ss.drives.Belt(0.1))
    rest = ss.solve.steady_sliding(system).state
    run = ss.simulate(system, duration=9e-3, start={**rest, "v": 1e-6})
    rises = upcrossings(run, "v", 0.0, 20)
    assert len(rises) >= 9
    assert 2 * math.pi / np.mean(np.diff(rises[1:])) == pytest.approx(7071.0678118654752, rel=1e-8)


@pytest.mark.parametrize(
    ("exponent", "low", "high", "known"),
    [
        (1.0, 0.1, 0.4, 0.23025850929940457),
        (2.0, 1e-3, 0.02, 0.0050125787690136614),
        (2.0, 0.1, 0.4, 0.19084020979734697),
    ],
)
def test_stribeck_sliding_loses_stability_at_the_threshold(
    exponent: float, low: float, high: float, known: float
) -> None:
    system = ss.Oscillator(mass=1, stiffness=1, law=STRIBECK, damping=0.3).having(exponent=exponent)

    def growth(speed: float) -> float:
        return float(ss.solve.steady_sliding(system.having(drive=ss.drives.Belt(speed))).eigenvalues[0].real)

    assert brentq(growth, low, high, xtol=1e-16) == pytest.approx(known, rel=1e-12)


@pytest.mark.parametrize(
    ("speed", "slip", "restick", "stick", "extrema"),
    [
        (1.0, 4.449285846689756, 0.35373634944617727, 3.6462636505538226, (4.631702308799714, 0.17702658185414405)),
        (0.5, 4.147462124687207, 0.22722196260183694, 7.545556074796326, (4.299432690040165, 0.18858272394502176)),
    ],
)
def test_falling_friction_on_a_belt_has_the_reference_limit_cycle(
    speed: float, slip: float, restick: float, stick: float, extrema: tuple[float, float]
) -> None:
    popp = ss.laws.FrictionCurve(lambda v: 10 * (0.3 / (1 + 1.42 * v) + 0.1 + 0.01 * v * v))
    run = ss.simulate(ss.Oscillator(mass=1, stiffness=1, law=popp, drive=ss.drives.Belt(speed)), duration=60)
    events = [event for event in run.events if event.time > 20]
    first = next(j for j, event in enumerate(events) if event.kind == "slip")
    begin, rest, again = (event.time for event in events[first : first + 3])
    assert rest - begin == pytest.approx(slip, rel=1e-11)
    assert again - rest == pytest.approx(stick, rel=1e-11)
    assert run.state(rest)["x"] == pytest.approx(restick, rel=1e-11)
    path = run.sample(np.linspace(begin, rest, 200001), ("x",))[0][0]
    assert (path.max(), path.min()) == pytest.approx(extrema, rel=1e-9)


@pytest.mark.parametrize(
    ("speed", "known"),
    [(0.05, 0.02426530323049094), (0.1, 0.050238758375514184), (0.2, 0.11682362175901599), (0.4, 0.2908)],
)
def test_dither_smooths_a_cubic_curve_as_the_closed_form(speed: float, known: float) -> None:
    level, low, knee, swing = 0.4, 0.25, 0.5, 0.3
    k1, k3 = 1.5 * (level - low) / knee, 0.5 * (level - low) / knee**3
    cubic = ss.laws.FrictionCurve(lambda v: level - k1 * v + k3 * v**3)
    face = ss.drives.MultiTone([(swing / (2 * math.pi), 1.0, 0.0)], on="face")
    system = ss.Oscillator(mass=HEAVY, stiffness=0.0, law=cubic, drive=face)
    run = ss.simulate(system, duration=2, start={"v": speed})
    assert mean_friction(run, 1.0, 2.0) == pytest.approx(known, rel=1e-10)


@pytest.mark.parametrize(
    ("ratio", "known"),
    [(0.1, 0.063768560858519848), (0.25, 0.16086124651033249), (0.5, 1 / 3), (0.9, 0.71286741374258746), (2.0, 1.0)],
)
def test_dither_smooths_dry_friction_as_the_closed_form(ratio: float, known: float) -> None:
    dry = ss.laws.FrictionCurve(lambda v: 1.0 + 0.0 * v)
    face = ss.drives.MultiTone([(1 / (2 * math.pi), 1.0, 0.0)], on="face")
    system = ss.Oscillator(mass=HEAVY, stiffness=0.0, law=dry, drive=face)
    run = ss.simulate(system, duration=2, start={"v": ratio})
    assert mean_friction(run, 1.0, 2.0) == pytest.approx(known, rel=1e-11)


def mean_friction(run: ss.solve.Trajectory, begin: float, end: float) -> float:
    """Mean over a time, by Gauss's rule from event to event."""
    cuts = [begin, *(event.time for event in run.events if begin < event.time < end), end]
    nodes, weights = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for low, high in itertools.pairwise(cuts):
        if high > low:
            friction = run.sample(low + (high - low) * (nodes + 1) / 2, ("friction",))[0][0]
            total += float(weights @ friction) * (high - low) / 2
    return total / (end - begin)


@pytest.mark.parametrize(
    ("changes", "amplitude", "zeros"),
    [
        ({"printed": True}, 0.0006426127604065683, 6),
        ({}, 0.0005494788871969221, 6),
        ({"rate": 100 / 1.1}, 0.0005409185901804385, 6),
        ({"kinetic": 1.28}, 0.0001964689794010018, 10),
        ({"kinetic": 1.06}, 0.0005882932850948199, 6),
        ({"frequency": 8.7, "amplitude": 1.1e-3}, 0.0005765083739851339, 2),
        ({"frequency": 8.7, "amplitude": 1.1e-3, "printed": True}, 0.000576294304827135, 2),
    ],
)
def test_thesis_state_variable_has_the_reference_amplitudes(
    changes: dict[str, float], amplitude: float, zeros: int
) -> None:
    system = THESIS.having(**changes)
    run = ss.simulate(system, cycles=140, rtol=1e-10)
    period = 1 / system.drive.frequency
    turns = [event.time for event in run.events if event.time > 139 * period]
    assert len(turns) == zeros
    assert max(abs(run.state(t)["x"]) for t in turns) == pytest.approx(amplitude, rel=2e-9)


@pytest.mark.parametrize(
    "law",
    [
        ss.laws.LuGre(1.1, 1.3, speed=1e-3, stiffness=192000, damping=24, viscous=0.4),
        ss.laws.Dahl(1.1, 192000),
        ss.laws.Stribeck(1.1, 1.3, speed=1e-3, viscous=0.4),
        ss.laws.Stribeck(1.1, 1.3, speed=1e-3, exponent=0.7),
        THESIS.law,
    ],
    ids=lambda law: type(law).__name__,
)
def test_tolerance_is_kept_over_a_hundred_cycles(law: object) -> None:
    system = THESIS.having(law=law)
    times = np.linspace(39, 40, 101)
    true = ss.simulate(system, cycles=100, rtol=1e-14)
    worse = 100 if getattr(law, "exponent", 1) < 1 else 1  # the curve's slope at rest is infinite
    for rtol, most in ((1e-6, 1e-7), (1e-9, 1e-9), (1e-12, 2e-12)):
        run = ss.simulate(system, cycles=100, rtol=rtol)
        assert [e.mode for e in run.events] == [e.mode for e in true.events]
        gap = np.abs(run.sample(times, ("x",))[0] - true.sample(times, ("x",))[0])
        assert np.max(gap) < worse * most * 6e-4


def test_lugre_agrees_with_a_general_solver() -> None:
    law = ss.laws.LuGre(1.1, 1.3, speed=1e-3, stiffness=192000, damping=24, viscous=0.4)
    run = ss.simulate(THESIS.having(law=law), cycles=2)

    def slope(t: float, s: np.ndarray) -> list[float]:
        x, v, z = s
        yields = 1.1 + 0.2 * math.exp(-((v / 1e-3) ** 2))
        rate = v - 192000 * abs(v) * z / yields
        force = 192000 * z + 24 * rate + 0.4 * v
        return [v, (2310 * (0.6e-3 * math.cos(2 * math.pi * 2.5 * t) - x) - force) / 2.42, rate]

    peer = solve_ivp(slope, (0, 0.8), [0, 0, 0], method="DOP853", rtol=1e-11, atol=1e-15, t_eval=np.linspace(0, 0.8, 9))
    names = ("x", "v", "bristle")
    assert run.sample(peer.t, names)[0] == pytest.approx(peer.y, abs=1e-9 * 6e-4 * 20, rel=1e-7)


def test_stribeck_with_equal_levels_is_coulomb() -> None:
    drive = ss.drives.HarmonicBase(0.65e-3, 2.5)
    base = ss.Oscillator(mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1), drive=drive)
    exact = ss.simulate(base, cycles=20)
    run = ss.simulate(base.having(law=ss.laws.Stribeck(1.1, 1.1, speed=1.0)), cycles=20, rtol=1e-13)
    assert [(e.kind, e.mode) for e in run.events] == [(e.kind, e.mode) for e in exact.events]
    assert [e.time for e in run.events] == pytest.approx([e.time for e in exact.events], rel=1e-11)


def test_events_do_not_hang_on_the_tolerance() -> None:
    law = ss.laws.Stribeck(0.05, 0.1, speed=0.5)
    run = ss.simulate(ss.Oscillator(mass=1, stiffness=1, law=law), duration=60, start={"x": 1.0}, rtol=1e-6)
    fine = ss.simulate(ss.Oscillator(mass=1, stiffness=1, law=law), duration=60, start={"x": 1.0}, rtol=1e-13)
    assert [e.kind for e in run.events] == [e.kind for e in fine.events]
    assert run.status == "at rest"


def test_a_run_becomes_a_record_and_pieces() -> None:
    run = ss.simulate(THESIS.having(law=ss.laws.Stribeck(1.1, 1.2, speed=1e-3)), cycles=2)
    record = run.record(fs=1000)
    assert set(record.channels) == {"x", "v", "a", "friction", "z"}
    assert record["x"][500] == pytest.approx(run.state(0.5)["x"])
    assert sum(piece.duration for piece in run.pieces) == pytest.approx(0.8)
    stuck = [piece for piece in run.pieces if piece.mode == "stuck"]
    assert stuck
    assert all(piece.state["v"] == 0 for piece in stuck)


@pytest.mark.parametrize(
    "build",
    [
        lambda: ss.laws.Stribeck(1.5, 1.0, speed=0.1),
        lambda: ss.laws.Stribeck(1.0, 1.5, speed=0.0),
        lambda: ss.laws.Stribeck(1.0, 1.5, speed=0.1, exponent=-1.0),
        lambda: ss.laws.Stribeck(math.nan, 1.5, speed=0.1),
        lambda: ss.laws.Dahl(0.0, 1.0),
        lambda: ss.laws.Dahl(1.0, -1.0),
        lambda: ss.laws.LuGre(1.0, 0.5, speed=1.0, stiffness=1.0),
        lambda: ss.laws.LuGre(1.0, 1.5, speed=1.0, stiffness=math.inf),
        lambda: ss.laws.RateState(1, 0.6, 1e-9, 0.1, 1e-5, 1e-6),
        lambda: ss.laws.RateState(1, 0.6, 0.001, 0.1, 1e-5, 1e-6),  # the square of e^600 is no number: it ran into nan
        lambda: ss.laws.RateState(1, 0.6, 0.01, 0.1, 1e-5, 1e-6, law="Ruina"),
        lambda: ss.laws.SmoothStateVariable(1.1, 0.0, 3000.0),
        lambda: ss.laws.FrictionCurve("1 / (1 + v)"),
        lambda: ss.laws.FrictionCurve(lambda v: 1.0),
        lambda: ss.laws.FrictionCurve(lambda v: 1 / (1 + v), static=0.5),
        lambda: ss.simulate(THESIS, cycles=1, rtol=0.0),
        lambda: ss.simulate(THESIS, cycles=1, start={"theta": math.nan}),
        lambda: ss.solve.steady_sliding(THESIS),
        lambda: ss.steady_state(THESIS, orders=0),
        lambda: exp(symbol("v")).at(w=1.0),
    ],
)
def test_bad_input_is_named(build: object) -> None:
    with pytest.raises(ss.errors.ModelError) as error:
        build()  # type: ignore[operator]
    assert all((error.value.value, error.value.rule, error.value.next_step))


def test_stiff_bristles_move_as_an_implicit_solver_says() -> None:
    stiffness, damping = 1e9, math.sqrt(1e9 * 2.42)
    law = ss.laws.LuGre(1.1, 1.3, speed=1e-3, stiffness=stiffness, damping=damping, viscous=0.4)
    run = ss.simulate(THESIS.having(law=law), cycles=1, rtol=1e-9)
    assert len(run.steps.reach) > 20
    assert len(run.steps.starts) < 5000  # a million for an explicit method

    def slope(t: float, s: np.ndarray) -> list[float]:
        x, v, z = s
        rate = v - stiffness * abs(v) * z / (1.1 + 0.2 * math.exp(-((v / 1e-3) ** 2)))
        force = stiffness * z + damping * rate + 0.4 * v
        return [v, (2310 * (0.6e-3 * math.cos(2 * math.pi * 2.5 * t) - x) - force) / 2.42, rate]

    times = np.linspace(0, 0.4, 21)
    peer = solve_ivp(slope, (0, 0.4), [0, 0, 0], method="Radau", rtol=1e-9, atol=[1e-13, 1e-12, 1e-18], t_eval=times)
    for own, other in zip(run.sample(times, ("x", "v", "bristle"))[0], peer.y, strict=True):
        assert own == pytest.approx(other, abs=3e-8 * np.max(np.abs(other)))


@pytest.mark.parametrize(
    "law",
    [
        ss.laws.LuGre(1.1, 1.3, speed=1e-3, stiffness=1e8, damping=1e4, viscous=0.4),
        ss.laws.Dahl(1.1, 1e8),
    ],
    ids=lambda law: type(law).__name__,
)
def test_leaps_change_no_event(law: object, monkeypatch: pytest.MonkeyPatch) -> None:
    run = ss.simulate(THESIS.having(law=law), cycles=1, rtol=1e-9)
    monkeypatch.setattr(march, "PATIENCE", math.inf)
    small = ss.simulate(THESIS.having(law=law), cycles=1, rtol=1e-9)
    assert len(small.steps.reach) == 0 < len(run.steps.reach)
    assert len(run.steps.starts) < 0.5 * len(small.steps.starts)
    assert [event.mode for event in run.events] == [event.mode for event in small.events]
    assert [e.time for e in run.events] == pytest.approx([e.time for e in small.events], rel=1e-9)
    times = np.linspace(0, 0.4, 301)
    for own, other in zip(run.sample(times, ("x", "v"))[0], small.sample(times, ("x", "v"))[0], strict=True):
        assert own == pytest.approx(other, abs=1e-8 * np.max(np.abs(other)))


def test_a_stiff_creep_comes_to_steady_sliding() -> None:
    light = ss.Oscillator(mass=1.0, stiffness=2.6e9, law=ROCK, drive=ss.drives.Belt(1e-6))
    rest = ss.solve.steady_sliding(light).state
    run = ss.simulate(light, duration=100, start={**rest, "v": 1e-8}, rtol=1e-9)
    assert len(run.steps.starts) < 5000
    assert run.state(100)["x"] == pytest.approx(rest["x"], rel=1e-12)
    assert run.state(100)["age"] == pytest.approx(rest["age"], rel=1e-9)


@pytest.mark.parametrize(("short", "crossings"), [(1e-6, 2), (1e-9, 2), (-1e-9, 0), (-1e-12, 0)])
def test_two_crossings_within_a_step_are_two(short: float, crossings: int) -> None:
    fastest = 1e-3 * 2 * math.pi
    system = ss.Oscillator(
        mass=HEAVY,
        stiffness=0.0,
        law=ss.laws.Dahl(1.0, stiffness=100.0),
        drive=ss.drives.MultiTone([(1e-3, 1.0, 0.0)], on="face"),
    )
    run = ss.simulate(system, duration=0.95, start={"v": fastest * (1 - short)})
    assert len(run.events) == crossings
    if crossings:
        apart = run.events[1].time - run.events[0].time
        assert apart == pytest.approx(math.acos(1 - short) / math.pi, rel=1e-4)
        assert np.median(run.steps.lengths) > 20 * apart
        assert [event.mode for event in run.events] == ["back", "forward"]


def test_every_function_moves_as_a_general_solver_says() -> None:
    curve = ss.laws.FrictionCurve(
        lambda v: (
            1
            + 0.1 * tanh(5 * v)
            + 0.2 * log(1 + v)
            - 0.1 * sqrt(1 + v * v)
            + 0.1 * asinh(3 * v)
            + 0.3 * exp(-v)
            + 0.1 / (1 + v) ** 1.5
            + v**3
        )
    )
    run = ss.simulate(ss.Oscillator(mass=1, stiffness=0, law=curve), duration=0.8, start={"v": 2.0}, rtol=1e-9)
    known = solve_ivp(
        lambda t, s: [s[1], -curve.friction(s[1])], (0, 0.8), [0, 2.0], method="DOP853", rtol=1e-12, atol=1e-14
    )
    end = run.state(0.8)
    assert not run.events
    assert (end["x"], end["v"]) == pytest.approx(known.y[:, -1], rel=1e-9)


def test_laws_that_differ_by_numbers_share_their_code() -> None:
    laws = (ss.laws.LuGre(1.0, 1.5, speed=1e-3, stiffness=1e5), ss.laws.LuGre(2.0, 2.5, speed=3e-3, stiffness=2e5))
    codes = [expansion(t.nodes, t.kept, 1)[0] for t in (tape(THESIS.having(law=law)) for law in laws)]
    assert codes[0] is codes[1]


def test_an_expression_differentiates_itself() -> None:
    from stickslip.laws import curved

    v = symbol("v")
    formula = curved.tanh(v) * curved.log(1 + v**2) / curved.sqrt(2 + v) + curved.asinh(v) ** 1.5 - exp(-v)
    step = 1e-6
    wide = (formula.at(v=0.7 + step) - formula.at(v=0.7 - step)) / (2 * step)
    assert formula.slope("v").at(v=0.7) == pytest.approx(wide, rel=1e-9)


FALLING = ss.laws.Stribeck(1.0, 1.5, speed=0.1)
LEVEL = ss.laws.FrictionCurve(lambda v: 0.5 + 0.0 * v, static=0.7)  # Coulomb's law, by way of the curves


@pytest.mark.parametrize("amplitude", [1e-4, 5e-3])
@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_a_stick_is_left_under_dither_as_on_a_still_belt(amplitude: float, damping: float) -> None:
    """Late in a run the clock has fewer digits than the tone's phase needs: a release must not hang on it."""
    belt = ss.Oscillator(1.0, 1.0, FALLING, ss.drives.Belt(0.05), damping=damping)
    run = ss.simulate(belt.having(drive=ss.drives.Dithered(ss.drives.Belt(0.05), amplitude, 5.0)), duration=60.0)
    assert run.status == "complete"
    assert np.min(run.durations) > 1e-9  # no release that holds no motion


@pytest.mark.parametrize(
    "tones",
    [
        [(0.0332, 0.41119, 1.417), (0.0011056, 3.57349, 0.51495)],
        [(0.00895, 0.24243, 0.00552), (0.01822, 0.77475, 5.60977), (0.59024, 0.16602, 5.93317)],
        [(0.4552, 0.18574, 2.19843), (0.01779, 0.99255, 4.71164)],
        [(0.2950, 0.07014, 2.43059), (0.00166, 2.44166, 4.97279), (0.00263, 0.45670, 1.54885)],
    ],
)
def test_a_level_curve_is_coulomb_on_a_face_of_several_tones(tones: list[tuple[float, float, float]]) -> None:
    system = ss.Oscillator(1.0, 1.0, LEVEL, ss.drives.MultiTone(tones, on="face"))
    run = ss.simulate(system, duration=40.0)
    exact = ss.simulate(system.having(law=ss.laws.Coulomb(0.5, static=0.7)), duration=40.0)
    times = np.linspace(0, 40, 201)
    assert [event.kind for event in run.events] == [event.kind for event in exact.events]
    np.testing.assert_allclose(run.sample(times, ("x",))[0], exact.sample(times, ("x",))[0], rtol=0, atol=1e-10)


@dataclass(frozen=True)
class Flicker(Rigid):
    """Two modes that follow each other every 2e-18 s."""

    memory = {"w": {}}  # noqa: RUF012
    entry = ("up", "up", "up")

    def rates(self) -> tuple[CurvedMode, ...]:
        still = 0.0 * symbol("v")
        return (
            CurvedMode("up", "slip", 1, still, (Exit({"w": 1.0, "1": -1.0}, "down"),), {"w": still + 1e18}),
            CurvedMode("down", "slip", -1, still, (Exit({"w": -1.0, "1": -1.0}, "up"),), {"w": still - 1e18}),
        )


def test_a_run_that_gets_nowhere_is_refused_for_its_events() -> None:
    with pytest.raises(ss.errors.SolveError, match=r"events within .*e-1. s, the last into .* at most 100000 events"):
        ss.simulate(ss.Oscillator(1.0, 1.0, Flicker()), duration=40.0, start={"x": 1.0})


@pytest.mark.parametrize("law", [LEVEL, ss.laws.Coulomb(0.5)])
def test_a_budget_holds_beyond_a_chunk(law: object) -> None:
    system = ss.Oscillator(1.0, 1.0, law, ss.drives.MultiTone([(1.0, 0.5, 0.0)], on="face"))
    assert len(ss.simulate(system, cycles=20, budget=4).events) >= 40
    with pytest.raises(ss.errors.SolveError, match="has at most 1 events"):
        ss.simulate(system, cycles=20, budget=1)


def test_lines_of_a_table_spend_no_events() -> None:
    """A table of a hundred lines passes a hundred of them where its curve has one event."""
    table = ss.laws.Tabulated.of(FALLING.friction, np.linspace(0, 0.5, 101))
    system = ss.Oscillator(1.0, 1.0, table, ss.drives.Belt(0.3))
    run = ss.simulate(system, duration=60.0, budget=20)
    assert len(run.modes) > 20 * 60.0 / (2 * math.pi)


@pytest.mark.parametrize("last", [(math.nan, math.nan), (math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0)])
def test_a_series_that_outgrew_the_numbers_has_no_length(last: tuple[float, float]) -> None:
    def step(*terms: float) -> float:
        series = np.array([[1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.1, *terms]])
        return float(length(series.ravel(), 4, np.ones(2), 1e-12))

    assert step(1e-3, 1e-4) > 0.0
    assert math.isnan(step(*last))
