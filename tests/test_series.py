"""A law behind a compliant contact: against the contact that is known, springs in series, the rigid limit, scipy."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip.drives.kinds import Belt, Drive, HarmonicBase, HarmonicForce, Recorded
from stickslip.errors import ModelError
from stickslip.laws.base import Law
from stickslip.laws.compliant import CompliantContact, InertialContact
from stickslip.laws.coulomb import Coulomb, LinearSlope, PositionLoad
from stickslip.laws.series import ElastoSlip, InSeries
from stickslip.laws.state_variable import StateVariable
from stickslip.laws.stribeck import Tabulated, TimeDelay
from stickslip.oscillator import Oscillator
from stickslip.solve.energies import energy
from stickslip.solve.simulate import simulate
from stickslip.solve.trajectory import Trajectory

DRIVES: list[Drive] = [
    HarmonicForce(1.2, frequency=0.13),
    HarmonicBase(1.2, frequency=0.1, contact="base"),
    Belt(0.05),
    Recorded(np.cumsum(np.random.default_rng(5).normal(size=60)) * 0.4, fs=1.0, contact="base"),
]


def slider(law: Law, drive: Drive) -> Oscillator:
    return Oscillator(mass=1.3, stiffness=1.7, damping=0.03, law=law, drive=drive)


def the_same(run: Trajectory, other: Trajectory, tolerance: float) -> None:
    """Event sequence first, then times, then motion and friction."""
    assert [(e.kind, e.side) for e in run.events] == [(e.kind, e.side) for e in other.events]
    assert np.allclose([e.time for e in run.events], [e.time for e in other.events], rtol=0, atol=tolerance)
    times = np.linspace(0, run.duration, 700)
    for name in ("x", "friction"):
        found, known = (r.sample(times, (name,))[0][0] for r in (run, other))
        assert np.allclose(found, known, rtol=0, atol=50 * tolerance)


@pytest.mark.parametrize("drive", DRIVES, ids=lambda drive: type(drive).__name__)
@pytest.mark.parametrize("static", [None, 0.65])
@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_coulomb_in_series_is_the_compliant_contact(drive: Drive, static: float | None, damping: float) -> None:
    known = CompliantContact(0.5, stiffness=50.0, damping=damping, static=static, rule="consistent")
    found = InSeries(Coulomb(0.5, static=static), stiffness=50.0, damping=damping)
    the_same(*(simulate(slider(law, drive), duration=59.0) for law in (found, known)), 1e-11)


@pytest.mark.parametrize(
    "behind",
    [
        CompliantContact(0.5, stiffness=80.0),
        InSeries(Coulomb(0.5), stiffness=80.0),
        ElastoSlip([80.0], [0.5]),
    ],
    ids=["compliant", "series", "jenkins"],
)
def test_springs_in_series_add_their_compliances(behind: Law) -> None:
    drive = HarmonicForce(1.2, frequency=0.13)
    both = simulate(slider(InSeries(behind, stiffness=20.0), drive), duration=60.0)
    one = simulate(slider(CompliantContact(0.5, stiffness=16.0), drive), duration=60.0)
    the_same(both, one, 1e-11)
    assert len(one.events) > 20


@pytest.mark.parametrize(
    ("law", "decade"),
    [
        (LinearSlope(0.5, slope=0.05, static=0.6), 0.5),
        (Tabulated([0.0, 0.2, 1.0], [0.6, 0.5, 0.7]), 0.5),
        (PositionLoad(0.5, gradient=0.1), 0.5),
        (StateVariable(0.5, rate=20.0), 0.13),
        (ElastoSlip([40.0, 10.0], [0.3, 0.2]), 0.13),
        (InertialContact(0.5, stiffness=50.0, mass=0.1, damping=0.3), 0.13),
    ],
    ids=lambda law: type(law).__name__,
)
def test_a_stiffening_contact_leaves_the_law_alone(law: Law, decade: float) -> None:
    """The distance to the law without it vanishes with K_y.

    As 1/K_y where friction is continuous; as its root where it jumps: a reversal then takes the time
    sqrt(m/K_y) that the contact needs to turn over, and the motion after it is late by as much.
    """
    drive = HarmonicForce(1.2, frequency=0.13)
    times = np.linspace(0, 12.0, 300)
    known = simulate(slider(law, drive), duration=12.0).sample(times, ("x",))[0][0]
    runs = [simulate(slider(InSeries(law, k, damping=1.0), drive), duration=12.0) for k in (1e3, 1e4, 1e5)]
    distances = [float(np.max(np.abs(run.sample(times, ("x",))[0][0] - known))) for run in runs]
    assert distances[0] > 1e-3
    assert all(b < a for a, b in pairwise(distances)), distances
    assert distances[2] < decade**2 * distances[0], distances
    assert energy(runs[0]).residual < 1e-12


def test_falling_friction_behind_a_contact_as_scipy_has_it() -> None:
    """m x'' + k x + f = P cos(wt), f = K (x - y) + c (x' - y'); in slip f = f0 s + b y', in stick y' = 0."""
    m, k, kinetic, static, slope, contact, damping = 1.3, 1.7, 0.5, 0.6, -0.1, 50.0, 0.6
    drive = HarmonicForce(1.2, frequency=0.13)
    run = simulate(
        Oscillator(
            mass=m,
            stiffness=k,
            drive=drive,
            law=InSeries(LinearSlope(kinetic, slope=slope, static=static), contact, damping),
        ),
        duration=60.0,
    )

    def slips(y: np.ndarray, side: int) -> float:
        return float((contact * (y[0] - y[2]) + damping * y[1] - side * kinetic) / (slope + damping))

    def force(y: np.ndarray, side: int) -> float:
        return float(contact * (y[0] - y[2]) + damping * (y[1] - (slips(y, side) if side else 0.0)))

    def rate(t: float, y: np.ndarray, side: int) -> list[float]:
        push = 1.2 * math.cos(2 * math.pi * 0.13 * t) - k * y[0] - force(y, side)
        return [y[1], push / m, slips(y, side) if side else 0.0]

    def leaves(sign: int, side: int):  # type: ignore[no-untyped-def]
        def event(t: float, y: np.ndarray, _: int) -> float:
            return sign * slips(y, side) if side else sign * force(y, 0) - static

        event.terminal, event.direction = True, -1 if side else 1  # type: ignore[attr-defined]
        return event

    y, side, now, events = np.zeros(3), 0, 0.0, []
    while now < 60.0:
        ways = [leaves(side, side)] if side else [leaves(1, 0), leaves(-1, 0)]
        options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "args": (side,)}
        y = solve_ivp(rate, (now, now + 1e-7), y, **options).y[:, -1]
        piece = solve_ivp(rate, (now + 1e-7, 60.0), y, events=ways, max_step=0.02, **options)
        now, y = float(piece.t[-1]), piece.y[:, -1]
        if piece.status == 1:
            side = 0 if side else 1 if len(piece.t_events[0]) else -1
            events.append((now, side))
    assert [event.side for event in run.events] == [side for _, side in events]
    assert len(events) > 10
    assert np.allclose([event.time for event in run.events], [t for t, _ in events], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: InSeries(Coulomb(1.0), stiffness=0.0), "stiffness = 0"),
        (lambda: InSeries(Coulomb(1.0), stiffness=1.0, damping=-1.0), "damping = -1"),
        (lambda: InSeries(LinearSlope(1.0, slope=-0.5), stiffness=1e3, damping=0.2), "slope of -0.5"),
        (lambda: InSeries(PositionLoad(1.0, gradient=-5.0), stiffness=3.0), "raise stiffness="),
        (lambda: InSeries(TimeDelay(LinearSlope(1.0, slope=0.1), lag=0.1), stiffness=3.0), "TimeDelay in series"),
    ],
)
def test_what_would_jump_is_refused(call, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ModelError) as refused:
        call()
    assert words in str(refused.value)


def test_elements_that_are_no_list_are_refused_in_a_sentence() -> None:
    with pytest.raises(
        ModelError, match=r"stiffnesses = 2.0; stiffnesses are a list of numbers; write stiffnesses=\[2.0\]"
    ):
        ElastoSlip(2.0, [1.0])  # type: ignore[arg-type]
