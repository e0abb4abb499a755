"""A mass that rubs in a plane: against the engine for a line, closed forms, and an integrator of another kind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.drives import (
    Belt,
    Crank,
    Dithered,
    HarmonicBase,
    HarmonicForce,
    Later,
    MultiTone,
    Ramp,
    Recorded,
    Release,
    SpeedProfile,
)
from stickslip.errors import ModelError
from stickslip.laws import CompliantContact, Coulomb, FrictionCurve, LinearSlope, Stribeck, Tabulated
from stickslip.systems import PlanarOscillator

BASE = HarmonicBase(6.5e-4, frequency=2.5)
FORCE = HarmonicForce(1.7, frequency=0.05)


def along(first: Any, direction: float) -> tuple[Any, Any]:
    """A drive along a slanted direction [rad], as one for either axis."""
    size = "speed" if isinstance(first, Belt) else "amplitude"
    parts = math.cos(direction), math.sin(direction)
    one, other = (replace(first, **{size: getattr(first, size) * part}) if part else Release() for part in parts)
    return one, other


def constant(force: float, duration: float) -> Recorded:
    return Recorded([force, force], times=[0.0, duration], on="force", order=0)


def slip_and_friction(run: Any, count: int = 4001) -> tuple[Any, Any, Any]:
    values, piece = run.sample(np.linspace(0, run.duration, count), ("slip", "friction"))
    return values[:2], values[2:], run.modes[piece]


LINES = {
    "thesis": (2.42, 2310.0, Coulomb(1.1), BASE, {}, 8.0),
    "static": (2.42, 2310.0, Coulomb(0.9, static=1.3), BASE, {"damping": 0.5}, 8.0),
    "belt": (1.0, 1.0, Coulomb(1.0, static=1.5), Belt(0.1), {"damping": 0.02}, 100.0),
    "force": (1.0, 1.0, Coulomb(1.0), FORCE, {}, 200.0),
    "Stribeck": (2.42, 2310.0, Stribeck(1.0, 1.3, speed=0.01), BASE, {}, 8.0),
    "slope": (1.0, 1.0, LinearSlope(1.0, slope=-0.2), FORCE, {}, 200.0),
    "curve": (1.0, 1.0, FrictionCurve(lambda v: 0.5 / (1 + v) + 0.5, static=1.2), FORCE, {}, 100.0),
    "damper on the base": (2.42, 2310.0, Coulomb(1.1), BASE, {"damping": 2.0, "damper": "base"}, 8.0),
}


# every line slanted; along an axis, where one part of all is zero, a stuck start, a belt and a curve
@pytest.mark.parametrize(
    ("name", "direction"),
    [
        pytest.param(
            name,
            direction,
            id=f"{name}-{way}",
            marks=() if direction or name in ("thesis", "belt", "Stribeck") else pytest.mark.soak,
        )
        for name in LINES
        for way, direction in (("axis", 0.0), ("slanted", 0.9))
    ],
)
def test_along_a_line_it_is_the_engine_for_a_line(name: str, direction: float) -> None:
    mass, stiffness, law, drive, more, duration = LINES[name]
    line = ss.simulate(ss.Oscillator(mass, stiffness, law, drive, **more), duration=duration)
    plane = ss.simulate(
        PlanarOscillator(mass, stiffness, law, drives=along(drive, direction), **more), duration=duration
    )
    assert len(line.events) > 6
    assert [event.mode == "stuck" for event in plane.events] == [event.mode == "stuck" for event in line.events]
    assert [event.time for event in plane.events] == pytest.approx([event.time for event in line.events], abs=1e-9)
    times = np.linspace(0, duration, 1001)
    x, ways = line.sample(times, ("x",))[0][0], plane.sample(times, ("x",))[0]
    assert ways[0] == pytest.approx(x * math.cos(direction), abs=1e-9 * np.abs(x).max())
    assert ways[1] == pytest.approx(x * math.sin(direction), abs=1e-9 * np.abs(x).max())


@pytest.mark.parametrize(
    "drive",
    [
        SpeedProfile([0.0, 1.0, 3.0, 4.0, 8.0], [0.0, 0.5, -0.5, 0.0, 0.0], on="face"),
        Recorded([0.0, 3.0, 0.0, -2.0, 0.0], times=[0.0, 0.5, 1.5, 2.5, 9.0], on="force", order=0),
        Dithered(Belt(0.1), amplitude=0.01, frequency=2.0),
        Crank(0.5, frequency=0.5, rod=1.5),
        MultiTone([(1.5, 0.3, 0.0), (0.8, 0.7, 1.0)], on="force"),
    ],
    ids=lambda drive: type(drive).__name__,
)
def test_every_drive_moves_it_along_its_axis(drive: Any) -> None:
    line = ss.simulate(ss.Oscillator(1.0, 4.0, Coulomb(1.0, static=1.2), drive), duration=8.0)
    plane = ss.simulate(PlanarOscillator(1.0, 4.0, Coulomb(1.0, static=1.2), drives=(Release(), drive)), duration=8.0)
    assert len(line.events) > 1
    instants = [event.time for event in plane.events]
    assert instants == pytest.approx([event.time for event in line.events], abs=1e-9)
    assert plane.state(8.0)["x2"] == pytest.approx(line.state(8.0)["x"], abs=1e-10)
    assert plane.state(8.0)["x1"] == 0.0


def turned(system: PlanarOscillator, amplitudes: Any, angle: float) -> tuple[PlanarOscillator, Any]:
    """The system under one tone of complex amplitudes, its axes turned."""
    matrix = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    own = matrix @ amplitudes
    drives = [HarmonicForce(abs(a), frequency=0.15, phase=float(np.angle(a))) for a in own]
    return system.having(drives=drives), matrix


@pytest.mark.parametrize("seed", range(12))
def test_the_choice_of_axes_is_free(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kinetic = rng.uniform(0.3, 1.5)
    law = Coulomb(kinetic, static=kinetic * rng.choice([1.0, 1.3]))
    plain = PlanarOscillator(rng.uniform(0.5, 2), rng.uniform(0.5, 3), law, damping=rng.choice([0.0, 0.05]))
    amplitudes = rng.normal(size=2) + 1j * rng.normal(size=2)
    x, v = rng.normal(size=2), rng.normal(size=2)
    times, runs, ways = np.linspace(0, 60, 301), [], []
    for angle in (0.0, 0.7, 2.5):
        system, matrix = turned(plain, amplitudes, angle)
        start = dict(zip(("x1", "x2", "v1", "v2"), (*(matrix @ x), *(matrix @ v)), strict=True))
        runs.append(ss.simulate(system, duration=60.0, start=start))
        ways.append(matrix.T @ runs[-1].sample(times, ("x",))[0])
    for run, way in zip(runs[1:], ways[1:], strict=True):
        instants = [event.time for event in runs[0].events]
        assert [event.time for event in run.events] == pytest.approx(instants, abs=1e-9)
        assert way == pytest.approx(ways[0], abs=1e-9)


def test_friction_across_a_fast_belt_is_viscous() -> None:
    """Of a small velocity across a belt of speed V friction takes F v / V: it dies with the time m V / F."""
    block = PlanarOscillator(1.0, (100.0, 0.0), Coulomb(2.0), drives=(Belt(1.0), Release()))
    run = ss.simulate(block, duration=2.0, start={"x1": 0.02, "v1": 0.0, "v2": 1e-5})
    times = np.linspace(0, 2, 41)
    assert run.sample(times, ("v",))[0][1] == pytest.approx(1e-5 * np.exp(-2.0 * times), rel=1e-9)
    assert not run.events


def hodograph(speed: float, angle: float, later: Any, friction: float, force: float) -> Any:
    """Speed at another angle to a constant force: s sin(a) tan(a / 2) ** -(F / P) stays."""
    return (
        speed
        * (np.sin(angle) / np.sin(later))
        * np.exp(friction / force * (np.log(np.tan(later / 2)) - math.log(math.tan(angle / 2))))
    )


def test_a_disc_thrown_across_a_slope_of_the_angle_of_friction() -> None:
    """v = v0 / (1 + cos a), a to the line of fall, where friction is the slope's own pull: in the end v0 / 2."""
    disc = PlanarOscillator(2.0, 0.0, Coulomb(3.0), drives=(constant(3.0, 400.0), Release()))
    run = ss.simulate(disc, duration=400.0, start={"v2": 1.5})
    v = run.sample(np.linspace(0, 400, 501), ("v",))[0]
    assert np.hypot(*v) == pytest.approx(1.5 / (1 + np.cos(np.arctan2(v[1], v[0]))), rel=1e-10)
    assert v[:, -1] == pytest.approx([0.75, 0.0], abs=1e-9)


@pytest.mark.parametrize("angle", [0.5, 2.0, 3.0, math.pi - 1e-3])
def test_it_comes_to_rest_when_and_where_the_closed_form_says(angle: float) -> None:
    """Under a constant force below friction: t = m (F v + P v cos a) / (F^2 - P^2), the way by the same integrals."""
    mass, friction, force, speed = 2.0, 3.0, 2.0, 1.5
    disc = PlanarOscillator(mass, 0.0, Coulomb(friction), drives=(constant(force, 50.0), Release()))
    along, across = speed * math.cos(angle), speed * math.sin(angle)
    run = ss.simulate(disc, duration=50.0, start={"v1": along, "v2": across})
    (stop,) = run.events
    assert stop.kind == "stick"
    assert stop.time == pytest.approx(mass * (friction * speed + force * along) / (friction**2 - force**2), rel=1e-11)
    way = friction * speed * along + force * (along**2 + speed**2) / 2
    assert run.state(50.0)["x1"] == pytest.approx(mass * way / (2 * (friction**2 - force**2)), rel=1e-9)
    way = speed * across + force / (2 * friction) * along * across
    assert run.state(50.0)["x2"] == pytest.approx(mass * way * 2 * friction / (4 * friction**2 - force**2), rel=1e-9)
    assert run.status == "at rest"


@pytest.mark.parametrize(("speed", "slip"), [(0.0, 1e-6), (1.0, 1e-6), (10.0, 1e-4), (100.0, 1e-4)])
def test_a_force_just_below_friction_lets_a_slow_slip_end_where_the_closed_form_says(speed: float, slip: float) -> None:
    """What turns the slip into the force's direction is then 1e4 times faster than what slows it down; the velocity
    beside a belt's is known to its tolerance only."""
    friction, force, angle = 1.0, 1.0 - slip, 0.5
    belt = Belt(speed) if speed else Release()
    block = PlanarOscillator(1.0, 0.0, Coulomb(friction), drives=(belt, constant(force, 2.0)))
    start = {"v1": speed + slip * math.sin(angle), "v2": slip * math.cos(angle)}
    run = ss.simulate(block, duration=2.0, start=start)
    (stop,) = run.events
    expected = slip * (friction + force * math.cos(angle)) / (friction**2 - force**2)
    assert stop.kind == "stick"
    assert stop.time == pytest.approx(expected, rel=1e-9 * (1 + speed / slip))


def test_a_slip_that_drifts_to_rest_on_a_shaken_face_keeps_its_energy() -> None:
    """Its last stop comes while the push is 1e-6 below friction: no step of a series is short enough to turn."""
    tones = [(2.63163927281472e-4, 9.472139754297343, 0.0), (1.7926542751055396e-4, 13.395628482742373, 1.0)]
    law = Coulomb(4.479647897702187)
    plate = PlanarOscillator(
        0.17818205661449332,
        (24988.91147005161, 91199.34109886865),
        law,
        drives=(MultiTone(tones, on="face"), Release()),
        damping=1.3345524550636887,
    )
    start = {"x1": 4.1943451514795044e-4, "x2": -4.721263256699014e-4, "v1": 0.11697155716, "v2": 0.01126142289}
    run = ss.simulate(plate, duration=0.2, start=start)
    assert run.event_counts()["stick"] >= 4
    assert len(run.steps.starts) < 2000
    assert ss.solve.energy(run).residual < 1e-11


@pytest.mark.parametrize("off", [0.3, 1e-2, 1e-4, 1e-6])
def test_a_near_miss_turns_and_does_not_stick(off: float) -> None:
    """Thrown nearly straight up a slope steeper than friction: the speed all but vanishes, below static friction."""
    mass, friction, force, speed = 2.0, 3.0, 3.5, 1.5
    disc = PlanarOscillator(mass, 0.0, Coulomb(friction, static=5.0), drives=(constant(force, 20.0), Release()))
    angle = math.pi - off
    run = ss.simulate(disc, duration=20.0, start={"v1": speed * math.cos(angle), "v2": speed * math.sin(angle)})
    assert not run.events
    times = np.linspace(0, 20, 201)
    v = run.sample(times, ("v",))[0]
    speeds, angles = np.hypot(*v), np.arctan2(v[1], v[0])
    energy = friction * speeds + force * v[0]
    start = friction * speed + force * speed * math.cos(angle)
    assert energy == pytest.approx(start + (force**2 - friction**2) * times / mass, rel=1e-9, abs=1e-9)
    seen = (angles > 1e-8) & (speeds > 1e-6)
    assert speeds[seen] == pytest.approx(
        hodograph(speed, angle, angles[seen], friction, force), rel=1e-4 * max(off, 1e-2)
    )


def test_thrown_straight_up_a_steep_slope_it_sticks_below_static_friction_and_turns_above() -> None:
    for static, kinds in ((5.0, ["stick"]), (3.2, ["slip"])):
        disc = PlanarOscillator(2.0, 0.0, Coulomb(3.0, static=static), drives=(constant(3.5, 20.0), Release()))
        run = ss.simulate(disc, duration=20.0, start={"v1": -1.5})
        assert [event.kind for event in run.events] == kinds
        assert run.events[0].time == pytest.approx(2.0 * 1.5 / 6.5, rel=1e-11)


@pytest.mark.parametrize("frequency", [0.4, 2.0])
def test_a_force_that_turns_carries_the_mass_on_a_circle(frequency: float) -> None:
    """P^2 = ((k - m w^2) A)^2 + (c w A + F)^2: friction, tangential, adds to the damper; below F nothing moves.

    Griffin and Menq, J. Vib. Acoust. 113 (1991), beside a damper.
    """
    mass, stiffness, friction, force, damping = 2.0, 50.0, 3.0, 20.0, 2.0
    omega = 2 * math.pi * frequency
    drives = [HarmonicForce(force, frequency=frequency, phase=phase) for phase in (0.0, -math.pi / 2)]
    mill = PlanarOscillator(mass, stiffness, Coulomb(friction), drives=drives, damping=damping)
    run = ss.simulate(mill, cycles=40)
    radius = np.hypot(*run.sample(np.linspace(run.duration - 1 / frequency, run.duration, 101), ("x",))[0])
    a, b = (stiffness - mass * omega**2) ** 2 + (damping * omega) ** 2, damping * omega * friction
    expected = (-b + math.sqrt(b * b + a * (force**2 - friction**2))) / a
    assert radius == pytest.approx(np.full(101, expected), rel=1e-6)
    held = ss.simulate(mill.having(kinetic=20.5), cycles=3)
    assert held.shares() == {"slip": 0.0, "stick": 1.0}


def moreau(system: dict[str, Any], force: Any, state: Sequence[Any], duration: float, count: int) -> tuple[Any, Any]:
    """Time-stepping by Moreau and Jean: the free velocity of a step, less an impulse of the disc h F that stops it, or
    the one of its rim against the velocity it leaves."""
    mass, k, c, friction = (system[name] for name in ("mass", "stiffness", "damping", "friction"))
    h, (x, v) = duration / count, (complex(*part) for part in state)
    ways, sliding = np.empty(count + 1, complex), np.empty(count + 1, bool)
    pushes = force((np.arange(count) + 0.5) * h)
    for j in range(count):
        ways[j], sliding[j] = x, v != 0
        middle = x + h / 2 * v
        free = v + h / mass * (pushes[j] - k * middle - c * v)
        size, most = abs(free), h * friction / mass
        new = 0j if size <= most else free * (1 - most / size)
        x, v = x + h / 2 * (v + new), new
    ways[count], sliding[count] = x, v != 0
    return ways, sliding


@pytest.mark.parametrize(
    ("amplitudes", "start"),
    [((1.6, 0.4j), (0.0, 0.0)), ((1.2 + 0.5j, -0.3 + 0.2j), (0.3, -0.8)), ((1.9, 0.5), (0.0, 1.0))],
)
def test_a_time_stepping_scheme_comes_to_the_same_motion(amplitudes: Any, start: Any) -> None:
    """Of first order: at half the step half as far away."""
    frequency, duration = 0.03, 100.0
    drives = [HarmonicForce(abs(a), frequency=frequency, phase=float(np.angle(a))) for a in amplitudes]
    system = PlanarOscillator(1.0, 1.0, Coulomb(1.0), drives=drives, damping=0.1)
    run = ss.simulate(system, duration=duration, start={"v1": start[0], "v2": start[1]})
    numbers = {"mass": 1.0, "stiffness": 1.0, "damping": 0.1, "friction": 1.0}

    def force(times: Any) -> Any:
        turning = np.exp(2j * math.pi * frequency * times)
        return (amplitudes[0] * turning).real + 1j * (amplitudes[1] * turning).real

    errors = []
    for count in (50_000, 100_000):
        ways, sliding = moreau(numbers, force, [(0.0, 0.0), start], duration, count)
        times = np.linspace(0, duration, count + 1)
        x, piece = run.sample(times, ("x",))
        errors.append(np.abs(x[0] + 1j * x[1] - ways).max())
        assert np.mean(sliding != (run.modes[piece] == 0)) < 2e-3
    assert run.event_counts()["stick"] > 2
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.7)


def test_friction_opposes_slip_and_stays_on_its_disc() -> None:
    drives = (HarmonicForce(1.6, frequency=0.03), HarmonicForce(0.8, frequency=0.03, phase=1.2))
    run = ss.simulate(PlanarOscillator(1.0, 1.0, Coulomb(1.0, static=1.3), drives=drives, damping=0.1), duration=300.0)
    slip, friction, modes = slip_and_friction(run)
    sliding = modes == 0
    assert 0.1 < np.mean(sliding) < 0.9
    assert np.hypot(*friction[:, sliding]) == pytest.approx(1.0, rel=1e-12)
    u, f = slip[:, sliding], friction[:, sliding]
    assert np.abs(u[0] * f[1] - u[1] * f[0]).max() < 1e-12
    assert np.all((np.sum(u * f, axis=0) > 0) | (np.hypot(*u) == 0))
    assert np.hypot(*friction[:, ~sliding]).max() <= 1.3 * (1 + 1e-11)
    assert np.abs(slip[:, ~sliding]).max() == 0.0
    released = [event.time for event in run.events if event.kind == "slip"]
    assert len(released) > 5
    for time in released:  # on the rim, and off along the force that held it
        held, begun = (np.array([run.state(at)[f"friction{j}"] for j in (1, 2)]) for at in (time - 1e-9, time))
        moved = np.array([run.state(time + 1e-6)[f"v{j}"] for j in (1, 2)])
        assert np.hypot(*held) == pytest.approx(1.3, rel=1e-8)
        assert moved / np.hypot(*moved) == pytest.approx(held / np.hypot(*held), abs=1e-5)
        assert begun / np.hypot(*begun) == pytest.approx(held / np.hypot(*held), abs=1e-7)


def test_the_energy_balances() -> None:
    drives = (HarmonicBase(0.8, frequency=0.02), Dithered(Belt(0.1), amplitude=0.02, frequency=0.1))
    system = PlanarOscillator(1.0, (1.0, 2.0), Coulomb(1.0, static=1.3), drives=drives, damping=(0.05, 0.1))
    run = ss.simulate(system, duration=100.0)
    balance = ss.solve.energy(run)
    assert run.event_counts()["stick"] > 5
    assert balance.residual < 1e-11
    flow = ss.solve.energy_flow(run)
    assert flow.friction.sum() == pytest.approx(-balance.friction, rel=1e-11)
    assert flow.kinetic.sum() == pytest.approx(balance.kinetic, abs=1e-11 * balance.turnover)


def test_a_run_goes_on_from_its_state_stops_at_a_level_and_becomes_a_record() -> None:
    drives = (HarmonicForce(1.6, frequency=0.03), HarmonicForce(0.8, frequency=0.03, phase=1.2))
    system = PlanarOscillator(1.0, 1.0, Coulomb(1.0, static=1.3), drives=drives)
    run = ss.simulate(system, duration=60.0)
    for time in (7.0, 31.3):
        later = system.having(drives=[Later(drive, time) for drive in drives])
        rest = ss.simulate(later, duration=60.0 - time, start=run.restart(time))
        assert rest.state(rest.duration)["x2"] == pytest.approx(run.state(60.0)["x2"], abs=1e-9)
    first = ss.solve.crossings(run, "x2", level=0.2)[0]
    assert ss.simulate(system, duration=60.0, stop={"x2": 0.2}).duration == pytest.approx(first, rel=1e-12)
    record = run.record(fs=20.0)
    assert {"x1", "x2", "v1", "v2", "friction1", "friction2", "force1", "force2"} <= set(record.channels)
    assert system.having(**{"drives.2.amplitude": 0.3}, kinetic=0.5).drives[1].amplitude == 0.3
    assert run.section().shape == (2, 4)


def test_a_mass_in_slow_tow_goes_along_the_tractrix() -> None:
    """Without inertia the spring keeps its length F / k: tan of half its angle falls with the way as exp(-k s / F).
    What inertia and damper leave is in proportion to the speed; the contact is up to 1e5 times faster than the tow."""
    stiffness, friction, angle = 100.0, 1.0, 1.2
    length, errors = friction / stiffness, []
    for speed in (1e-4, 1e-5):
        tow = PlanarOscillator(1.0, stiffness, Coulomb(friction), drives=(Ramp(speed), Release()), damping=2.0)
        start = {"x1": -length * math.cos(angle) * (1 - 1e-9), "x2": -length * math.sin(angle) * (1 - 1e-9)}
        run = ss.simulate(tow, duration=2 * length / speed, start=start)
        times = np.linspace(0, run.duration, 21)
        x1, x2, z1, z2 = run.sample(times, ("x", "z"))[0]
        expected = 2 * np.arctan(math.tan(angle / 2) * np.exp(-speed * times / length))
        errors.append(np.abs(np.arctan2(z2 - x2, z1 - x1) - expected).max())
        assert np.hypot(z2 - x2, z1 - x1) == pytest.approx(length, rel=3 * speed)
        assert len(run.steps.starts) < 1000
    assert errors[1] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"law": CompliantContact(1.0, stiffness=1e4)}, "by one smooth curve"),
        ({"law": Tabulated([0, 1, 2], [1.0, 0.8, 0.7])}, "by one smooth curve"),
        ({"law": Stribeck(1.0, 1.3, speed=0.1, exponent=0.5)}, "on a disc of some radius"),
        ({"law": Coulomb(0.0)}, "on a disc of some radius"),
        ({"drives": (BASE,)}, "each of the two axes has its own"),
        ({"drives": (ss.drives.Imposed(BASE), Release())}, "no motion is imposed"),
        ({"drives": (constant(1.0, 2.0), constant(1.0, 2.0))}, "moves it along one axis"),
        ({"stiffness": (1.0, 2.0, 3.0)}, "one finite number for both axes or two"),
        ({"stiffness": -1.0}, "none negative"),
        ({"damping": math.nan}, "one finite number"),
        ({"mass": math.nan}, "mass is finite and positive"),
    ],
)
def test_what_has_no_meaning_is_refused(changes: dict[str, Any], rule: str) -> None:
    plain: dict[str, Any] = {"mass": 1.0, "stiffness": 4.0, "law": Coulomb(1.0)}
    with pytest.raises(ModelError, match=rule):
        PlanarOscillator(**{**plain, **changes})
    with pytest.raises(ModelError, match="x1"):
        ss.simulate(PlanarOscillator(**plain), duration=1.0, start={"x": 1.0})
    with pytest.raises(ModelError, match="finite"):
        ss.simulate(PlanarOscillator(**plain), duration=1.0, start={"x1": math.nan})


PLANE = PlanarOscillator(1.0, 4.0, Coulomb(1.0, static=1.2), drives=(HarmonicBase(1.0, frequency=0.5), Release()))


@pytest.mark.parametrize(
    "ask",
    [
        lambda: ss.steady_state(PLANE),
        lambda: ss.sweep(PLANE, {"kinetic": [0.5, 1.0]}),
        lambda: ss.basins(PLANE, grid={"x1": [0.0, 1.0], "v1": [0.0, 1.0]}),
        lambda: ss.solve.lyapunov(PLANE),
        lambda: ss.solve.steady_sliding(PLANE),
        lambda: ss.dither(PLANE),
        lambda: ss.fit_law(ss.datasets.demo(), PLANE),
        lambda: ss.compare_laws(ss.datasets.demo(), PLANE),
    ],
)
def test_what_is_asked_of_masses_on_a_line_is_refused_in_a_plane(ask):
    with pytest.raises(ss.errors.ModelError, match=r"a PlanarOscillator; .*along a line.*give an Oscillator"):
        ask()
