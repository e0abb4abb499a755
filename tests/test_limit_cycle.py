"""Limit cycles: closed forms of stick-slip, averaging of a smooth law, and what a long simulation ends in."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.two_blocks import TwoBlocks

import stickslip as ss

START = {"x1": 0.1, "x2": -0.2}


def sticking(speed: float, damping: float = 0.0) -> ss.Oscillator:
    """BS-1 and BS-4: static friction of 1.5 N over 1 N."""
    return ss.Oscillator(1.0, 1.0, ss.laws.Coulomb(1.0, static=1.5), ss.drives.Belt(speed), damping=damping)


@pytest.mark.parametrize(
    ("speed", "damping", "period"),
    [(0.5, 0.0, 6.7123889803846899), (0.1, 0.1, 12.635457258784897), (0.5, 0.1, 6.4941269476513108)],
)
def test_stick_slip_has_the_period_of_the_closed_form(speed: float, damping: float, period: float) -> None:
    cycle = ss.squeak.limit_cycle(sticking(speed, damping), push=1.5)
    assert cycle.status == "periodic"
    assert 1 / cycle.frequency == pytest.approx(period, rel=1e-12)
    assert abs(cycle.multipliers[0]) < 1e-6, "a stick ends in one state alone"
    if not damping:
        assert cycle.amplitude == pytest.approx(math.hypot(0.5, speed), rel=1e-9)
        assert cycle.stick_share[0] == pytest.approx(2 * 0.5 / speed / period, rel=1e-12)


def test_beside_stable_sliding_stick_slip_lasts_up_to_a_known_speed() -> None:
    """BS-4: above 0.549 the mass does not stick again."""
    speeds = [0.2, 0.54, 0.558]
    cycles = ss.squeak.limit_cycles(sticking(0.5, 0.1), "drive.speed", values=speeds)
    assert [one.status for one in cycles.up] == ["steady sliding"] * 3
    assert [one.status for one in cycles.down] == ["periodic", "periodic", "steady sliding"]
    assert (cycles.both, cycles.threshold, cycles.kind) == ((0.2, 0.54), None, "cannot be told")
    assert "stable at every value" in cycles.evidence


@cache
def smooth() -> ss.squeak.CycleBranches:
    """ST-2: friction that falls with the speed and rises again by a cubic law, as Thomsen and Fidlin have it."""
    law = ss.laws.FrictionCurve(lambda v: 0.4 - 0.225 * (v / 0.5 - (v / 0.5) ** 3 / 3))
    block = ss.Oscillator(1.0, 1.0, law, ss.drives.Belt(0.5), damping=0.1)
    return ss.squeak.limit_cycles(block, "drive.speed", values=[0.42, 0.43, 0.44, 0.45])


def test_a_smooth_law_begins_supercritically_with_the_root_of_the_distance() -> None:
    found = smooth()
    assert found.threshold is not None
    assert found.threshold.value == pytest.approx(0.44095855184409843, rel=1e-12)
    assert found.kind == "supercritical"
    assert found.exponent == pytest.approx(0.5, abs=1e-3)
    assert found.both is None
    # averaging: 2 sqrt(v1^2 - v^2), to the order of the small friction
    known = 2 * np.sqrt(np.maximum(0.0, found.threshold.value**2 - found.values**2))
    assert np.allclose(found.amplitudes(), known, rtol=0.015, atol=0)
    assert np.allclose(found.amplitudes("down"), found.amplitudes(), rtol=1e-6, atol=0)
    assert not any(any(one.stick_share) for one in found.up)


def test_a_falling_law_with_a_stick_begins_subcritically() -> None:
    """ST-1: sliding becomes stable above 0.2303; the stick that bounds the motion does not know of it."""
    law = ss.laws.Stribeck(1.0, 1.5, speed=0.1, exponent=1.0, viscous=0.2)
    block = ss.Oscillator(1.0, 1.0, law, ss.drives.Belt(0.2), damping=0.3)
    cycles = ss.squeak.limit_cycles(block, "drive.speed", values=[0.2, 0.22, 0.25])
    assert cycles.kind == "subcritical"
    assert cycles.both is not None
    assert cycles.both[0] < 0.2304 < cycles.both[1] == 0.25
    assert [one.vibrates for one in cycles.up] == [True, True, True]
    assert [one.vibrates for one in cycles.down] == [True, True, False], "going down the sliding is stable at first"
    assert "until a contact sticks" in cycles.evidence


@cache
def rig(load: float) -> ss.squeak.LimitCycle:
    return ss.squeak.limit_cycle(ss.squeak.squeak_rig("wet", load), speed=-0.1)


def test_an_unstable_cycle_separates_the_vibration_from_stable_sliding() -> None:
    """It begins at the threshold with the root of the distance; within it a vibration dies away, beyond it grows."""
    law = ss.laws.Stribeck(1.0, 1.5, speed=0.1, exponent=1.0, viscous=0.2)
    block = ss.Oscillator(1.0, 1.0, law, ss.drives.Belt(0.2), damping=0.3)
    cycles = ss.squeak.limit_cycles(block, "drive.speed", values=[0.22, 0.2313, 0.2343])
    assert cycles.between[0] is None, "sliding is unstable"
    near, far = cycles.amplitudes("between")[1:]
    assert cycles.threshold is not None
    distance = cycles.values[1:] - cycles.threshold.value
    assert far / near == pytest.approx(math.sqrt(distance[1] / distance[0]), rel=0.02)
    cycle = cycles.between[2]
    assert cycle is not None
    assert cycle.multipliers[0].real > 1
    place, (x, v) = cycle.sliding.place[0], cycle.motion.states[0, :2]
    ends = [
        ss.squeak.limit_cycle(block, speed=0.2343, start={"x": place + s * (x - place), "v": s * v})
        for s in (0.97, 1.03)
    ]
    assert [end.status for end in ends] == ["steady sliding", "periodic"]
    assert "unstable, between" in [
        str(line.get_label()) for line in ss.figures.plot_limit_cycles(cycles).axes[0].get_lines()
    ]


@pytest.mark.parametrize("load", [1.9, 3.0, 6.13])
def test_the_rig_squeaks_by_lifting_a_contact(load: float) -> None:
    found = rig(load)
    assert found.status == "periodic"
    assert abs(found.multipliers[0]) < 1
    assert found.stick_share == (0.0, 0.0)
    assert 0.1 < sum(found.separation_share) < 0.3
    assert found.growth == pytest.approx(found.sliding.growth, rel=1e-8)
    assert found.frequency == pytest.approx(found.sliding.frequency, rel=0.03)


def test_the_steady_state_on_a_belt_is_the_cycle() -> None:
    steady = ss.steady_state(ss.squeak.squeak_rig("wet", 3.0).having(drive=ss.drives.Belt(-0.1)))
    assert steady.status == "unique"
    assert 1 / steady.period == pytest.approx(rig(3.0).frequency, rel=1e-9)
    assert np.allclose(np.abs(steady.multipliers[:-1]), np.abs(rig(3.0).multipliers), rtol=1e-6)


def test_the_cycle_is_what_a_long_simulation_ends_in() -> None:
    found = rig(3.0)
    belt = ss.squeak.squeak_rig("wet", 3.0).having(drive=ss.drives.Belt(-0.1))
    rest = dict(zip(("x1", "x2", "x3"), found.sliding.place, strict=True))
    run = ss.simulate(belt, duration=40.0, start={**rest, "v1": 0.0, "v2": 1e-4, "v3": 0.0})
    times = np.linspace(39.9, 40.0, 20_001)
    late = run.sample(times, ("x",))[0]
    assert np.allclose(np.ptp(late[1:], axis=1) / 2, found.amplitudes[1:], rtol=1e-5, atol=0)
    last = run.starts[[j for j, mode in enumerate(run.modes) if "lifted" in run.table.modes[mode].name][-101:]]
    assert np.mean(np.diff(last)) * found.frequency == pytest.approx(1.0, rel=1e-7)


HOFFMANN = [[23.25, 3.8971143170299739], [3.8971143170299739, 7.75]]


def inclined(law: Any = None, *, speed: float = 1.0) -> ss.Structure:
    """MC-1 with some damping."""
    pad = ss.Contact(law or ss.laws.Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=10.0)
    return ss.Structure(np.eye(2), 0.05 * np.eye(2), HOFFMANN, contacts=[pad], drive=ss.drives.Belt(speed))


@pytest.mark.parametrize("speed", [0.05, 0.3])
@pytest.mark.parametrize(
    "law",
    [
        ss.laws.Coulomb(0.6),
        ss.laws.LinearSlope(0.4, slope=-0.05, static=0.6),
        ss.laws.CompliantContact(0.6, stiffness=300.0),
    ],
    ids=["rigid", "falling", "compliant"],
)
def test_a_cycle_is_repeated_when_it_is_simulated_again(law: Any, speed: float) -> None:
    system = inclined(law, speed=speed)
    cycle = ss.squeak.limit_cycle(system)
    assert cycle.status == "periodic"
    assert cycle.growth == pytest.approx(cycle.sliding.growth, rel=1e-8)
    own = dict(zip(("x1", "x2", "v1", "v2"), map(float, cycle.motion.states[0]), strict=False))
    mode, period = cycle.motion.table.modes[cycle.motion.modes[0]].name, cycle.motion.duration
    run = ss.simulate(system, duration=20 * period, start={**own, "mode": mode})
    late = run.sample(period * (10 + np.arange(320) / 32), ("x", "v"))[0].reshape(4, 10, 32)
    known = cycle.motion.sample(period * np.arange(32) / 32, ("x", "v"))[0]
    assert np.allclose(late, known[:, None], rtol=0, atol=1e-8 * np.ptp(known, axis=1).max())


def test_hoffmanns_model_squeaks_on_below_its_critical_friction() -> None:
    cycles = ss.squeak.limit_cycles(inclined(), "kinetic", values=[0.4, 0.46, 0.5, 0.6])
    assert cycles.kind == "subcritical"
    assert [one.vibrates for one in cycles.up] == [False, False, True, True]
    assert [one.vibrates for one in cycles.down] == [False, True, True, True]
    assert abs(cycles.down[1].multipliers[0]) < 1
    assert cycles.down[1].sliding.stable


def test_friction_feeds_torsion_and_the_contacts_carry_it_to_bending() -> None:
    energy = rig(6.13).energy
    _, bending, torsion = energy.friction + energy.contacts + energy.springs + energy.damping
    assert abs(bending) + abs(torsion) < 1e-9 * energy.friction[2], "over a cycle nothing is stored"
    assert energy.friction[2] > 0
    assert energy.friction[1] == 0
    assert energy.contacts[1] == pytest.approx(-energy.contacts[2], rel=1e-6)
    assert energy.contacts[1] > 0
    assert np.all(energy.damping < 0)
    assert np.max(np.abs(energy.drive)) < 1e-9 * energy.friction[2], "a belt drives by friction alone"


def test_the_rig_begins_and_ends_to_squeak_at_one_load() -> None:
    cycles = ss.squeak.limit_cycles(
        ss.squeak.squeak_rig(), lambda n: ss.squeak.squeak_rig("wet", n), values=[1.5, 1.9, 6.0], speed=-0.1
    )
    assert cycles.threshold is not None
    assert cycles.threshold.value == pytest.approx(1.79657, rel=1e-5)
    assert cycles.kind == "supercritical"
    assert cycles.exponent == pytest.approx(0, abs=0.1), "linear until a contact lifts off: the amplitude jumps"
    assert [one.vibrates for one in cycles.up] == [one.vibrates for one in cycles.down] == [False, True, True]
    assert "until a contact lifts off" in cycles.evidence


def test_energy_of_each_displacement_adds_up_to_that_of_all() -> None:
    run = ss.simulate(ss.squeak.squeak_rig(), duration=0.3)
    flow, whole = ss.solve.energy_flow(run), ss.solve.energy(run)
    assert -flow.friction.sum() == pytest.approx(whole.friction, rel=1e-9)
    assert flow.kinetic.sum() == pytest.approx(whole.kinetic, rel=1e-9)
    assert np.allclose(flow.drive[1:], 0, atol=1e-12 * whole.turnover), "the base moves the mass alone"
    # of the base: k z v over the run
    times = np.linspace(0, 0.3, 300_001)
    z, v = run.sample(times, ("z", "v"))[0][[0, 1]]
    assert flow.drive[0] == pytest.approx(np.trapezoid(2310.0 * z * v, times), rel=1e-6)


def test_the_figures_show_both_ways_and_the_threshold() -> None:
    figure = ss.figures.plot_limit_cycles(smooth(), label="belt speed [m/s]")
    lines = figure.axes[0].get_lines()
    drawn = {line.get_label(): line for line in lines}
    assert np.array_equal(drawn["going up"].get_ydata(), 1e3 * smooth().amplitudes())
    assert "sliding ceases to be stable at 0.441" in drawn
    assert figure.axes[-1].get_xlabel() == "belt speed [m/s]"


def test_the_map_of_the_rig_over_load_and_slope() -> None:
    grid = {"slope": [-3.0, 0.0, 3.0], "load": [1.0, 4.0, 7.0]}
    chart = ss.squeak.stability_map(
        lambda load, slope: ss.squeak.squeak_rig("wet", load).having(slope=slope), grid=grid, speed=-0.1
    )
    assert chart.mechanism.sel(load=7.0, slope=0.0) == "mode coupling"
    assert chart.mechanism.sel(load=1.0, slope=3.0) == "stable"
    figure = ss.figures.plot_stability(chart, labels=("slope [s/m]", "load [N]"))
    named = {text.get_text() for text in figure.axes[0].get_legend().get_texts()}
    assert named == set(np.unique(chart.mechanism.values))
    with pytest.raises(ss.errors.ModelError, match="two parameters"):
        ss.figures.plot_stability(chart.isel(load=0))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: ss.squeak.limit_cycle(sticking(0.5), speed=0.0), "speed = 0"),
        (lambda: ss.squeak.limit_cycle(sticking(0.5), push=0.0), "push = 0"),
        (lambda: ss.squeak.limit_cycle(sticking(0.5), speed="fast"), "speed = 'fast'"),  # type: ignore[arg-type]
        (lambda: ss.squeak.limit_cycle(3), "Oscillator or a Structure"),  # type: ignore[arg-type]
        (lambda: ss.squeak.limit_cycles(sticking(0.5), "drive.speed", values="all"), "finite numbers"),
        (lambda: ss.squeak.limit_cycle(sticking(0.5), patience=3), "patience = 3"),
        (lambda: ss.squeak.limit_cycle(sticking(0.5).having(drive=ss.drives.Release())), "driven by Release"),
        (lambda: ss.squeak.limit_cycle(sticking(0.5).having(stiffness=0.0)), "no spring holds"),
        (lambda: ss.squeak.limit_cycles(sticking(0.5), "drive.speed", values=[0.3, 0.2, 0.4]), "numbers that rise"),
        (lambda: ss.squeak.limit_cycles(sticking(0.5), "drive.speed", values=[0.3, 0.4]), "at least 3"),
        (lambda: ss.squeak.limit_cycles(sticking(0.5), "drive.sped", values=[0.3, 0.4, 0.5]), "sped"),
    ],
)
def test_what_has_no_answer_is_refused(call: Any, words: str) -> None:
    with pytest.raises(ss.errors.ModelError) as refused:
        call()
    assert words in str(refused.value)


def test_the_end_of_one_blocks_stick_does_not_tell_where_the_other_is() -> None:
    """The second block's place comes nearer from return to return, by a factor that scipy's motion tells."""
    blocks = TwoBlocks(1.2, kinetic=(0.8, 1.0), static=(1.0, 1.25), speed=0.02)
    *_, (before, sooner), (_, later) = list(blocks.returns(240.0))
    orbit = ss.steady_state(blocks.system, start=START)
    assert orbit.status == "unique"
    assert abs(orbit.multipliers[0]) == pytest.approx((later - sooner) / (sooner - before), rel=1e-3)
    assert np.allclose(orbit.multipliers[1:], 0.0, atol=1e-9), "but for that one, the stick forgets"
    exponent = ss.solve.lyapunov(blocks.system, cycles=400, start=START)
    low, high = (bound * orbit.period for bound in exponent.interval)
    assert low < math.log(abs(orbit.multipliers[0])) < high


def test_chaos_on_a_belt_has_its_exponent() -> None:
    """Two blocks that differ, as in Huang and Turcotte (1990), against neighbours that scipy follows."""
    blocks = TwoBlocks(3.0, kinetic=(0.8, 1.0), static=(1.0, 1.25), speed=0.02)
    exponent = ss.solve.lyapunov(blocks.system, cycles=100, transient=20, start=START)
    assert exponent.value == pytest.approx(blocks.exponent(laps=100, before=20), abs=2e-3)
    assert exponent.value > 0.01
    motion = ss.steady_state(blocks.system, start=START)
    assert motion.status == "chaotic"
    assert motion.exponent is not None
    assert motion.exponent.interval[0] > 0


def test_a_block_alone_on_a_belt_forgets_all_but_its_phase() -> None:
    assert ss.solve.lyapunov(sticking(0.5), cycles=25).value == -math.inf
    law = ss.laws.FrictionCurve(lambda v: 0.4 - 0.225 * (v / 0.5 - (v / 0.5) ** 3 / 3))
    block = ss.Oscillator(1.0, 1.0, law, ss.drives.Belt(0.42), damping=0.1)
    orbit = ss.steady_state(block)
    exponent = ss.solve.lyapunov(block, cycles=300, transient=40)
    assert exponent.value == pytest.approx(math.log(abs(orbit.multipliers[0])) / orbit.period, rel=1e-2)


def test_nothing_lasts_where_nothing_drives() -> None:
    with pytest.raises(ss.errors.SolveError, match="or a belt"):
        ss.solve.lyapunov(ss.Oscillator(1.0, 1.0, ss.laws.Coulomb(1.0), ss.drives.Release()))


def test_bristles_on_a_belt_may_turn_several_times_before_they_repeat() -> None:
    """Two turns that differ, by scipy's Radau with the law written out."""
    kinetic, static, stribeck, stiffness, damping, belt = 1.0, 1.5, 0.05, 100.0, 1.0, 0.2
    law = ss.laws.LuGre(kinetic, static, speed=stribeck, stiffness=stiffness, damping=damping)
    block = ss.Oscillator(1.0, 1.0, law, ss.drives.Belt(belt), damping=0.02)
    orbit = ss.steady_state(block)
    assert orbit.status == "unique"

    def rates(_: float, y: Any) -> list[float]:
        slip = y[1] - belt
        level = kinetic + (static - kinetic) * math.exp(-((slip / stribeck) ** 2))
        bristle = slip - stiffness * abs(slip) * y[2] / level
        return [y[1], -y[0] - 0.02 * y[1] - stiffness * y[2] - damping * bristle, bristle]

    def turns(_: float, y: Any) -> float:
        return float(y[1])

    turns.direction = 1.0  # type: ignore[attr-defined]
    start = [orbit.orbit.states[0][orbit.orbit.table.names.index(name)] for name in ("x", "v", "bristle")]
    peer = solve_ivp(rates, (0.0, orbit.period), start, "Radau", rtol=1e-10, atol=1e-12, events=turns)
    assert np.allclose(peer.y[:, -1], start, rtol=0, atol=1e-6)
    places = [y[0] for t, y in zip(peer.t_events[0], peer.y_events[0], strict=True) if 0.1 < t < orbit.period - 0.1]
    assert len(places) == 1
    assert abs(places[0] - start[0]) > 0.01
    exponent = ss.solve.lyapunov(block, cycles=100, transient=40)
    low, high = (bound * orbit.period for bound in exponent.interval)
    assert low < math.log(abs(orbit.multipliers[0])) < high
