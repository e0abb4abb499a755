"""A contact whose load follows the motion: flutter, stick and flight against closed forms and scipy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip.drives.kinds import Belt, Drive
from stickslip.laws.base import Law
from stickslip.laws.compliant import CompliantContact
from stickslip.laws.coulomb import Coulomb, LinearSlope
from stickslip.laws.stribeck import Tabulated
from stickslip.oscillator import Contact, Structure
from stickslip.solve.assembly import table_of
from stickslip.solve.simulate import simulate


def sliding(structure: Structure, *modes: str) -> np.ndarray:
    """A of the modes in which contacts slide, without drive and constant."""
    table = table_of(structure)
    return table.flow[table.index(" + ".join(modes))][: table.physical, : table.physical]


def hoffmann(friction: float, *, drive: Drive | None = None, preload: float = 10.0) -> Structure:
    """MC-1: two inclined springs, a contact spring, a belt."""
    k11, k12, k22, k3 = 23.25, 3.8971143170299739, 18.75, 11.0
    pad = Contact(Coulomb(friction), [1, 0], normal=[0, 1], stiffness=k3, preload=preload)
    return Structure(
        np.eye(2), np.zeros((2, 2)), [[k11, k12], [k12, k22 - k3]], contacts=[pad], drive=drive or Belt(1.0)
    )


def test_mode_coupling_of_two_inclined_springs() -> None:
    """MC-1: flutter above mu_c, where both frequencies meet at omega_c."""
    critical, omega = 0.47237749297333017, 4.58257569495584
    for side, growing in ((-1, False), (1, True)):
        values = np.linalg.eigvals(sliding(hoffmann(critical * (1 + side * 1e-9)), "back"))
        assert np.allclose(np.abs(values.imag), omega, rtol=1e-4)
        assert (np.max(values.real) > 1e-5) == growing
    # at the critical coefficient the product of both squares is omega_c^4: a double root
    assert abs(np.linalg.det(sliding(hoffmann(critical), "back"))) == pytest.approx(omega**4, rel=1e-12)


@pytest.mark.parametrize(
    ("eta", "critical", "frequency"),
    [
        ((0.02, 0.02), 0.2893671255228094, 86.602540378443865),
        ((0.02, 0.06), 0.2717900338224474, 93.026050941906342),
        ((0.001, 0.1), 0.067461045152826729, 99.711755628543196),
    ],
)
def test_mode_coupling_with_damping(eta: tuple[float, float], critical: float, frequency: float) -> None:
    """MC-2: the critical coefficient of two modes that press each other's contacts."""
    w1, w2 = 200 * math.pi, 150 * math.pi

    def slowest(friction: float) -> complex:
        pads = [
            Contact(Coulomb(friction), [1, 0], normal=[0, 1], stiffness=w2**2, preload=1e3),
            Contact(Coulomb(friction), [0, 1], normal=[1, 0], stiffness=w1**2, preload=1e3, carried=-1.0),
        ]
        damping = np.diag([eta[0] * w1, eta[1] * w2])
        values = np.linalg.eigvals(
            sliding(Structure(np.eye(2), damping, np.zeros((2, 2)), contacts=pads, drive=Belt(1.0)), "back", "forward")
        )
        return complex(values[np.argmax(values.real)])

    assert slowest(critical * (1 - 1e-6)).real < 0 < slowest(critical * (1 + 1e-6)).real
    assert abs(slowest(critical).imag) / (2 * math.pi) == pytest.approx(frequency, rel=1e-10)


def replay(structure: Structure, start: np.ndarray, duration: float) -> tuple[list[tuple[float, str]], np.ndarray]:
    """One contact of two degrees of freedom on a belt by scipy's DOP853, its rules written out: events, and the end.

    The contact's own stiffness, where it has one, is followed with the slider's place as a fifth state.
    """
    (pad,) = structure.contacts
    law, speed = pad.law, structure.drive.speed  # type: ignore[attr-defined]
    slope = getattr(law, "slope", 0.0)
    tangential = law.stiffness if isinstance(law, CompliantContact) else 0.0  # type: ignore[attr-defined]
    kinetic, static = law.kinetic, law.static or law.kinetic  # type: ignore[attr-defined]
    inverse, damping, stiffness = (
        np.linalg.inv(structure.mass),
        np.asarray(structure.damping),
        np.asarray(structure.stiffness),
    )
    t, n = np.asarray(pad.tangent), np.asarray(pad.normal)

    def load(y: np.ndarray) -> float:
        return float(pad.preload + pad.stiffness * n @ y[:2])

    def force(y: np.ndarray, mode: str) -> np.ndarray:
        pressing = 0.0 if mode == "lifted" else load(y)
        return -stiffness @ y[:2] - damping @ y[2:4] + n * (pad.preload - pressing)

    def friction(y: np.ndarray, mode: str) -> float:
        if mode == "stuck":
            return float(t @ inverse @ force(y, mode) / (t @ inverse @ t))
        if mode == "microstuck":
            return float(tangential * (t @ y[:2] - y[4]))
        if mode == "lifted":
            return 0.0
        return {"forward": 1, "back": -1}[mode] * kinetic * load(y) + slope * pad.preload * float(t @ y[2:4] - speed)

    def rate(_: float, y: np.ndarray, mode: str) -> np.ndarray:
        a = inverse @ (force(y, mode) - t * friction(y, mode))
        return np.concatenate([y[2:4], a, [speed]])

    def slip(y: np.ndarray, mode: str) -> float:
        own = float(t @ y[2:4] - speed)
        if tangential:
            own -= {"forward": 1, "back": -1}[mode] * kinetic * pad.stiffness * float(n @ y[2:4]) / tangential
        return own

    def exits(mode: str) -> dict[str, Any]:
        if mode == "lifted":
            return {"landing": lambda s, y, _: load(y)}
        lift = {"lifted": lambda s, y, _: -load(y)}
        if mode in ("forward", "back"):
            side = 1 if mode == "forward" else -1
            return {"stop": lambda s, y, _: -side * slip(y, mode), **lift}
        return {
            "forward": lambda s, y, _: friction(y, mode) - static * load(y),
            "back": lambda s, y, _: -friction(y, mode) - static * load(y),
            **lift,
        }

    def follow(y: np.ndarray, mode: str, way: str) -> tuple[np.ndarray, str]:
        y = y.copy()
        if way == "stop" and tangential:
            y[4] = t @ y[:2] - friction(y, mode) / tangential
            return y, "microstuck"
        if way == "stop":
            need = friction(y, "stuck")
            return y, "stuck" if abs(need) <= static * load(y) else "forward" if need > 0 else "back"
        if way == "landing" and tangential:
            y[4] = t @ y[:2]
            # the contact starts to slide at once where its spring would load faster than its friction
            own, grown = t @ y[2:4] - speed, static * pad.stiffness * float(n @ y[2:4]) / tangential
            return y, "microstuck" if abs(own) < grown else "forward" if own > 0 else "back"
        if way == "landing":
            return y, "forward" if t @ y[2:4] > speed else "back"
        return y, way

    y = np.concatenate([start, [t @ start[:2]]])
    mode = "microstuck" if tangential else "forward" if t @ start[2:] > speed else "back"
    now, events = 0.0, []
    while now < duration:
        ways = exits(mode)
        checks = list(ways.values())
        for check in checks:
            check.terminal, check.direction = True, 1
        # an exit at the very start of a step is the way in: begin a little past it
        begin = solve_ivp(rate, (now, now + 1e-7), y, "DOP853", rtol=1e-12, atol=1e-14, args=(mode,)).y[:, -1]
        piece = solve_ivp(
            rate,
            (now + 1e-7, duration),
            begin,
            "DOP853",
            rtol=1e-12,
            atol=1e-14,
            args=(mode,),
            events=checks,
            max_step=0.02,
        )
        now, y = float(piece.t[-1]), piece.y[:, -1]
        if piece.status == 1:
            way = next(name for name, found in zip(ways, piece.t_events, strict=True) if len(found))
            y, mode = follow(y, mode, way)
            events.append((now, mode))
    return events, y


@pytest.mark.parametrize(
    "law",
    [
        Coulomb(0.6, static=0.7),
        LinearSlope(0.6, slope=-0.05, static=0.7),
        CompliantContact(0.6, stiffness=300.0),
        CompliantContact(0.6, stiffness=30.0, static=0.8),
    ],
    ids=["rigid", "falling", "stiff", "soft"],
)
@pytest.mark.parametrize("speed", [0.3, 0.8])
def test_flutter_grows_to_stick_and_flight_as_scipy_has_it(law: Law, speed: float) -> None:
    structure = hoffmann(0.6, drive=Belt(speed), preload=5.0).having(law=law)
    start = np.array([0.3, -0.1, 0.0, 0.0])
    run = simulate(structure, duration=25.0, start=dict(zip(("x1", "x2", "v1", "v2"), start, strict=True)))
    events, end = replay(structure, start, 25.0)
    own = [(event.time, event.mode) for event in run.events]
    assert [mode for _, mode in own] == [mode for _, mode in events]
    assert {"lifted", "back"} < {mode for _, mode in own}
    assert np.allclose([t for t, _ in own], [t for t, _ in events], rtol=0, atol=1e-10)
    assert np.allclose(run.sample([25.0], ("x", "v"))[0][:, 0], end[:4], rtol=0, atol=1e-10)
    assert np.min(run.sample(np.linspace(0, 25, 4000), ("load",))[0]) >= -1e-12


def test_a_table_of_coefficients_is_the_line_that_it_was_cut_from() -> None:
    start = {"x1": 0.3, "x2": -0.1, "v1": 0.0}
    line = hoffmann(0.6, drive=Belt(0.8), preload=5.0).having(law=LinearSlope(0.6, slope=-0.05, static=0.7))
    speeds = np.linspace(0, 20, 9)
    table = line.having(law=Tabulated(speeds, 0.6 - 0.05 * np.minimum(speeds, 10), static=0.7))
    runs = [simulate(structure, duration=12.0, start=start) for structure in (line, table)]
    events, same = ([(event.time, event.mode.split()[0]) for event in run.events] for run in runs)
    assert {"back", "stuck", "lifted"} <= {mode for _, mode in events}
    assert [mode for _, mode in events] == [mode for _, mode in same]
    assert np.allclose([t for t, _ in events], [t for t, _ in same], rtol=0, atol=1e-9)


def test_a_structure_sampled_is_a_record() -> None:
    run = simulate(hoffmann(0.6), duration=4.0, start={"x1": 0.3})
    record = run.record(fs=100)
    assert list(record.channels) == ["x1", "x2", "v1", "v2", "a1", "a2", "friction"]
    state = run.state(2.5)
    assert all(record[name][250] == pytest.approx(state[name], rel=1e-12, abs=1e-14) for name in record.channels)
    middle = (record["x2"][2:] - record["x2"][:-2]) / 0.02
    assert np.allclose(middle, record["v2"][1:-1], rtol=0, atol=1e-4 / 6 * 5.0**2 * 2)


def test_a_start_above_the_counter_face_is_flight() -> None:
    run = simulate(hoffmann(0.6), duration=1.0, start={"x2": -2.0})
    assert run.pieces[0].mode == "lifted"
    assert run.events[0].mode in ("back", "forward")


@pytest.mark.parametrize(("excess", "flights"), [(-1e-12, 0), (1e-12, 1), (1e-6, 1)])
def test_a_load_that_just_vanishes(excess: float, flights: int) -> None:
    """The normal motion is A cos(wt) while closed: the load's least value is preload - k_n A."""
    pad = Contact(Coulomb(0.0), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
    structure = Structure(np.eye(2), np.zeros((2, 2)), np.diag([1.0, 3.0]), contacts=[pad])
    amplitude, omega = 5.0 / 11.0 * (1 + excess), math.sqrt(14.0)
    run = simulate(structure, duration=1.5 * math.pi / omega, start={"x2": amplitude, "v1": 1.0})
    lifts = [event.time for event in run.events if event.mode == "lifted"]
    assert len(lifts) == flights
    if flights:
        # the crossing is at acos(-1 / (1 + excess)): its own rounding is that of the excess
        assert lifts[0] * omega == pytest.approx(math.acos(-1 / (1 + excess)), abs=1e-3 * math.sqrt(2 * excess) + 1e-12)


def test_changes_reach_their_owner() -> None:
    changed = hoffmann(0.6).having(kinetic=0.3, speed=0.5, preload=2.0, damping=0.1 * np.eye(2))
    (pad,) = changed.contacts
    assert (pad.law, pad.preload, changed.drive) == (Coulomb(0.3), 2.0, Belt(0.5))
    assert np.array_equal(changed.damping, 0.1 * np.eye(2))
    assert np.array_equal(changed.stiffness, hoffmann(0.6).stiffness)
