"""The engine against closed forms and 40-digit references: every scenario, every known answer."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip import scenarios
from stickslip.solve.energies import energy
from stickslip.solve.periodic import steady_state
from stickslip.solve.simulate import simulate
from stickslip.solve.trajectory import Trajectory


def agree(found: object, known: object, tolerance: float) -> None:
    """Words and counts are equal, numbers within the tolerance; of durations each known one is among those found."""
    if isinstance(known, str | int):
        assert found == known
    elif isinstance(known, float):
        assert found == pytest.approx(known, rel=tolerance)
    else:
        raise AssertionError(f"nothing is known of {known!r}")


@pytest.mark.parametrize("name", scenarios.names())
def test_a_scenario_has_its_known_answers(name: str) -> None:
    scenario = scenarios.get(name)
    for question, found in scenarios.answers(scenario).items():
        known = scenario.known[question]
        if question in ("slips", "sticks"):
            # the reference lists half of a symmetric cycle: each duration occurs, and nothing else does
            scale = max(known)
            for duration in known:
                assert min(abs(duration - other) for other in found) <= 1e-10 * scale, question
            for duration in found:
                assert min(abs(duration - other) for other in known) <= 1e-10 * scale, question
        elif isinstance(known, list) and question != "stops":
            scale = max(map(abs, known))
            assert np.allclose(found[: len(known)], known, rtol=0, atol=scenario.tolerance * scale), question
        elif question == "multiplier":
            # over the half cycle the reference states 9 to 12 digits
            assert found == pytest.approx(known, rel=1e-9), question
        elif isinstance(known, list):
            assert found == known, question
        else:
            agree(found, known, scenario.tolerance)


def test_the_whole_grid_of_stops() -> None:
    grid = scenarios.grid("HL-1")
    for i, ratio in enumerate(grid["ratios"]):
        for j, load in enumerate(grid["loads"]):
            orbit = steady_state(scenarios.forced(ratio, load))
            assert orbit.stops == (grid["normal"][i][j], grid["abnormal"][i][j]), (ratio, load)


@pytest.mark.parametrize("row", scenarios.grid("DH-2")["boundary"], ids=str)
@pytest.mark.parametrize("side", [-1, 1])
def test_the_non_stop_boundary_at_1e_12(row: list[float], side: int) -> None:
    ratio, damping, boundary = row
    system = scenarios.forced(ratio, boundary * (1 + side * 1e-12), damping_ratio=damping)
    if damping == 0 and abs(1 / ratio / 2 - round(1 / ratio / 2)) < 1e-12:
        pytest.skip("a family of orbits: no boundary of its own")
    orbit = steady_state(system, start={"x": 2.0})
    assert sum(orbit.stops) == (2 * orbit.order if side > 0 else 0), (orbit.stops, orbit.status)


def test_the_limits_of_the_boundary() -> None:
    """DH-4: pi/4 at resonance, 1 / sqrt(1 + pi^2/4) at high frequency."""
    for ratio, limit, close in ((1 + 1e-4, math.pi / 4, 1e-3), (50.0, 1 / math.sqrt(1 + math.pi**2 / 4), 1e-3)):
        systems = [scenarios.forced(ratio, limit * (1 + side * close)) for side in (-1, 1)]
        below, above = (steady_state(system, start={"x": 1.0}) for system in systems)
        assert sum(below.stops) == 0
        assert sum(above.stops) > 0 or above.status == "rest"


@pytest.mark.parametrize(
    ("ratio", "static_ratio", "critical"), [(1.3, 1.2, 0.67439793790955632), (0.8, 1.5, 0.72697564257968176)]
)
def test_static_friction_moves_the_boundary(ratio: float, static_ratio: float, critical: float) -> None:
    """SHAW-1: r_c = V / sqrt(U^2 + (rho_s / b^2)^2), from a sliding start (rest attracts as well)."""
    for side in (-1, 1):
        system = scenarios.forced(ratio, critical * (1 + side * 1e-10), static_ratio=static_ratio)
        x0 = math.sqrt((1 / (1 - ratio**2)) ** 2 - (math.tan(math.pi / 2 / ratio) / ratio * critical) ** 2)
        motion = simulate(system, cycles=2000, start=sliding(ratio, critical, x0))
        sticks = sum(event.kind == "stick" for event in motion.events)
        assert (sticks > 0) == (side > 0)


def sliding(ratio: float, load: float, amplitude: float) -> dict[str, float]:
    """A state on the sliding orbit at phase 0: marched there from its turning point by the orbit of lower static."""
    orbit = steady_state(scenarios.forced(ratio, load), start={"x": amplitude})
    state = orbit.orbit.states[0]
    return {"x": float(state[0]), "v": float(state[1])}


def test_negative_damping_loses_stability() -> None:
    """SHAW-3: det J = 1 at zeta_c = -0.0722590314...; beyond it a torus, which turns as the multiplier does there."""
    critical, turns = -0.072259031436387934, list[float]()
    for side, status in ((1, "unique"), (-1, "quasi-periodic")):
        near = scenarios.forced(1.3, 0.4, damping_ratio=critical * (1 - side * 1e-3))
        start = steady_state(scenarios.forced(1.3, 0.4, damping_ratio=-0.05), start={"x": 1.2}).orbit.states[0]
        orbit = steady_state(near, start={"x": float(start[0]), "v": float(start[1])}, transient=1)
        assert orbit.status == status
        turn = orbit.rotation_numbers[0] if orbit.rotation_numbers else np.angle(orbit.multipliers[0]) / (2 * math.pi)
        turns.append(math.cos(2 * math.pi * turn))
    assert turns[0] == pytest.approx(turns[1], abs=0.02)
    law = [
        abs(
            steady_state(
                scenarios.forced(1.3, 0.4, damping_ratio=critical * f), start={"x": 1.2, "v": 0.0}, transient=1
            ).multipliers[0]
        )
        for f in (0.999, 1.0)
    ]
    assert law[0] < 1
    assert law[1] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_fast_belt_is_not_stuck_to_again(side: int) -> None:
    """BS-4: from break-away, with a damper, stick is met again below V_c = 0.549046312057... alone."""
    speed = 0.54904631205793635 * (1 + side * 1e-10)
    system = ss.Oscillator(mass=1, stiffness=1, damping=0.1, law=ss.laws.Coulomb(1.0, 1.5), drive=ss.drives.Belt(speed))
    run = simulate(system, duration=100, start={"x": 1.5 - 0.1 * speed, "v": speed})
    assert any(event.kind == "stick" for event in run.events) == (side < 0)


THESIS = tomllib.loads(Path(__file__).with_name("thesis_events.toml").read_text("utf-8"))


def around(orbit: Trajectory) -> list[tuple[str, float, float, float, float, float]]:
    """Every piece of an orbit, the one that the start of the period cuts put together.

    Kind, start [s], duration [s], way [m], velocity at its end [m/s], place at its start [m].
    """
    modes, period = orbit.table.modes, orbit.table.motion.period
    whole = orbit.modes[0] == orbit.modes[-1] and len(orbit.modes) > 1
    starts, lengths, states = orbit.starts[whole:], orbit.durations[whole:].copy(), orbit.states[whole:]
    lengths[-1] += orbit.durations[0] if whole else 0.0
    after = np.roll(states, -1, axis=0)
    kinds = [modes[m].kind for m in orbit.modes[whole:]]
    ways = after[:, 0] - states[:, 0]
    return list(zip(kinds, starts % period, lengths, ways, after[:, 1], states[:, 0], strict=True))


@pytest.mark.parametrize("name", THESIS)
def test_every_event_of_a_thesis_case(name: str) -> None:
    """Start, duration, way and end velocity of every stick and slip, in both halves of the cycle."""
    steady = steady_state(scenarios.get(name).system)
    found, period = around(steady.orbit), steady.period
    scale = np.array([period, period, steady.amplitude, steady.largest("v")])
    assert len(found) == 2 * len(THESIS[name])
    for kind, start, length, way, speed in THESIS[name]:
        for sign, half in ((1, 0.0), (-1, period / 2)):
            known = np.array([(start + half) % period, length, sign * way, sign * speed])
            gaps = [np.max(np.abs(np.subtract(piece[1:5], known)) / scale) for piece in found if piece[0] == kind]
            assert min(gaps) < 1e-13, (kind, start)


@pytest.mark.parametrize(
    ("name", "share", "phase"),
    [
        ("DH-3 b=0.5084 r=0.7326", 0.25920113385723104, 1.149229742705322),
        ("DH-3 b=0.5 r=0.8", 0.29862263728316468, 1.3481768895364696),
        ("DH-3 b=0.8 r=0.9", 0.50625335423584046, 2.5528771191239934),
        ("DH-3 b=1.2 r=0.8", 0.30081303295030159, 2.3262726425890987),
        ("DH-3 b=0.5 r=0.6", 0.24809218742629285, 1.1403078594673675),
        ("DH-3 b=0.7 r=0.6", 0.033696025069110911, 0.67021886142259415),
        ("DH-3 b=0.25 r=0.9", 0.6436614653800147, 2.1000166872174145),
    ],
)
def test_the_share_of_stick_and_the_phase_of_break_away(name: str, share: float, phase: float) -> None:
    """DH-3: slip breaks away downwards at cos(phase) = x0 - F_s / P."""
    scenario = scenarios.get(name)
    steady = steady_state(scenario.system, start=scenario.start)
    orbit = around(steady.orbit)
    assert sum(p[2] for p in orbit if p[0] == "stick") / steady.period == pytest.approx(share, rel=1e-12)
    phases = [p[1] / steady.period * 2 * math.pi for p in orbit if p[0] == "slip" and p[3] < 0]
    assert phases == [pytest.approx(phase, rel=1e-12)]


@pytest.mark.parametrize(
    ("name", "load", "given", "friction"),
    [
        ("FR-1 z=0.02", 0.3, 48.540035137856002, 18.54029320186995),
        ("FR-1 z=0.05", 0.5, 11.418455648134838, 7.2627716482268195),
        ("FR-1 z=0.1", 0.2, 11.708285431570341, 2.9803517608452448),
    ],
)
def test_the_energy_of_resonance(name: str, load: float, given: float, friction: float) -> None:
    """FR-1: the drive gives what friction, 4 r X, and the damper take over a cycle."""
    steady = steady_state(scenarios.get(name).system)
    balance = energy(steady.orbit)
    assert 4 * load * steady.amplitude == pytest.approx(friction, rel=1e-12)
    assert balance.friction == pytest.approx(friction, rel=1e-12)
    # what the spring and the damper give is in `drive` too: the damper's loss is the rest
    nodes, weights = np.polynomial.legendre.leggauss(30)
    orbit, work = steady.orbit, 0.0
    for begin, length in zip(orbit.starts, orbit.durations, strict=True):
        (force, v), _ = orbit.sample(begin + length * (nodes + 1) / 2, ("force", "v"))
        work += length / 2 * float(weights @ (force * v))
    assert work == pytest.approx(given, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        (
            "BS-2",
            {
                "slip": 0.17156718657531491,
                "stick": 0.034632034632034632,
                "end": 0.00064935064935064935,
                "most": 0.00084326860184054256,
                "least": 0.00010911235054040982,
                "slowest": -0.011341142633122203,
            },
        ),
        (
            "BS-3",
            {
                "slip": 2.6112592541013096,
                "stick": 5.0,
                "end": 0.75,
                "most": 0.75980762113533159,
                "least": 0.24019237886466841,
                "slowest": -0.36742346141747671,
            },
        ),
    ],
)
def test_stick_slip_on_a_belt(name: str, values: dict[str, float]) -> None:
    """BS: lengths of stick and slip, where the stick ends, and the extremes of displacement and velocity."""
    scenario = scenarios.get(name)
    run = simulate(scenario.system, duration=4 * values["slip"] + 4 * values["stick"])
    slips = [p for p in run.pieces[:-1] if p.mode == "back"]
    sticks = [p for p in run.pieces[1:-1] if p.mode == "stuck"]
    assert slips[-1].duration == pytest.approx(values["slip"], rel=1e-12)
    assert sticks[-1].duration == pytest.approx(values["stick"], rel=1e-12)
    assert slips[-1].state["x"] == pytest.approx(values["end"], rel=1e-12)
    # a sine around its middle: the extremes lie where the velocity, or the acceleration, is zero
    middle = scenario.system.law.kinetic / scenario.system.stiffness
    omega = 2 * math.pi * scenario.system.frequency
    radius = math.hypot(slips[-1].state["x"] - middle, slips[-1].state["v"] / omega)
    assert middle + radius == pytest.approx(values["most"], rel=1e-12)
    assert middle - radius == pytest.approx(values["least"], rel=1e-12)
    assert -radius * omega == pytest.approx(values["slowest"], rel=1e-12)
    times = np.linspace(slips[-1].start, slips[-1].start + slips[-1].duration, 4001)
    x, v = run.sample(times, ("x", "v"))[0]
    assert (x.max(), x.min(), v.min()) == pytest.approx((values["most"], values["least"], values["slowest"]), rel=1e-5)


@pytest.mark.parametrize(
    ("name", "places", "misses"),
    [
        ("INERTIAL Xm=20", (2.0312968536160702, 2.7784191644503746), (0.0277637, 0.0292141, 0.00417475)),
        ("INERTIAL Xm=10", (0.31592533919560971, 0.2922294944960769, 0.75095770799205397), ()),
    ],
)
def test_where_the_inertial_contact_stops(name: str, places: tuple[float, ...], misses: tuple[float, ...]) -> None:
    """Equation 4.7: the places of the abnormal stops, and how near the first slip comes to stopping before."""
    steady = steady_state(scenarios.get(name).system)
    sticks = sorted((p for p in around(steady.orbit) if p[0] == "stick"), key=lambda p: p[2])
    short = sorted(abs(p[5]) for p in sticks if p[2] < 5)
    assert short == pytest.approx(sorted(2 * places), rel=1e-9)
    if misses:
        orbit = steady.orbit
        j = max(
            (j for j in range(1, len(orbit.modes) - 1) if orbit.table.modes[orbit.modes[j]].kind == "slip"),
            key=lambda j: orbit.durations[j],
        )
        times = np.linspace(orbit.starts[j], orbit.starts[j] + orbit.durations[j], 400_001)[1:-1]
        speed = np.abs(orbit.sample(times, ("v",))[0][0])
        dips = speed[1:-1][(speed[1:-1] < speed[:-2]) & (speed[1:-1] < speed[2:])]
        assert dips == pytest.approx(misses, rel=2e-6)
