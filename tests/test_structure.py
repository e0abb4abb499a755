"""Several degrees of freedom and contacts: against one mass, itself uncoupled, scipy and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from stickslip.drives.kinds import Belt, Drive, HarmonicBase, HarmonicForce, MultiTone, Ramp, Recorded, Release
from stickslip.errors import ModelError
from stickslip.laws.base import Law
from stickslip.laws.compliant import CompliantContact, InertialContact
from stickslip.laws.coulomb import Coulomb, LinearSlope
from stickslip.laws.series import ElastoSlip
from stickslip.laws.state_variable import StateVariable
from stickslip.laws.stribeck import TimeDelay
from stickslip.oscillator import Contact, Oscillator, Structure
from stickslip.solve.energies import energy
from stickslip.solve.periodic import steady_state
from stickslip.solve.simulate import simulate
from stickslip.solve.trajectory import Trajectory

SWELL = np.cumsum(np.random.default_rng(5).normal(size=40)) * 0.4

LAWS: list[Law] = [
    Coulomb(0.5, static=0.7),
    CompliantContact(0.5, stiffness=50.0, damping=0.1),
    CompliantContact(0.5, stiffness=50.0, damping=0.4, rule="consistent"),
    ElastoSlip([20.0, 5.0], [0.3, 0.3]),
    InertialContact(0.5, stiffness=50.0, mass=0.1),
]
DRIVES: list[Drive] = [
    Release(),
    HarmonicForce(1.2, frequency=0.13),
    HarmonicBase(1.2, frequency=0.1, contact="base"),
    MultiTone([(1.0, 0.11, 0.0), (0.3, 0.7, 1.0)]),
    Belt(0.3),
    Ramp(0.2),
    Recorded(SWELL, fs=1.0, contact="base"),
]


def same_events(run: Trajectory, other: Trajectory, *, contact: int = 0) -> None:
    """The events of a contact of a structure are those of an oscillator: sequence first, then times."""
    own = [event for event in run.events if event.contact == contact]
    assert [(e.kind, e.mode, e.side) for e in own] == [(e.kind, e.mode, e.side) for e in other.events]
    assert np.allclose([e.time for e in own], [e.time for e in other.events], rtol=0, atol=1e-12 * run.duration)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("drive", DRIVES, ids=lambda drive: type(drive).__name__)
def test_one_degree_of_freedom_is_the_oscillator(law: Law, drive: Drive) -> None:
    structure = Structure(1.3, 0.03, 1.7, contacts=[Contact(law, [1.0])], drive=drive, damper="base")
    slider = Oscillator(mass=1.3, stiffness=1.7, law=law, drive=drive, damping=0.03, damper="base")
    start: dict[str, float | str] = {"x": 2.0} if isinstance(drive, Release) else {}
    run, other = (simulate(system, duration=39.0, start=start) for system in (structure, slider))
    same_events(run, other)
    assert len(run.events) > 0 or isinstance(drive, Recorded)
    times = np.linspace(0, 39.0, 500)
    far = max(1.0, float(np.max(np.abs(other.sample(times, ("x",))[0]))))
    # a force is a difference of displacements times the contact's stiffness, 50 N/m: it has their rounding
    for name, scale in (("x", far), ("v", far), ("friction", 50 * far)):
        found, known = (r.sample(times, (name,))[0] for r in (run, other))
        assert np.max(np.abs(found - known)) <= 1e-12 * scale, name


@pytest.mark.parametrize("laws", [(LAWS[0], LAWS[0]), (LAWS[0], LAWS[1]), (LAWS[3], LAWS[2])], ids=["rr", "rc", "ec"])
def test_what_is_not_coupled_does_not_know_of_each_other(laws: tuple[Law, Law]) -> None:
    drive = HarmonicForce(1.2, frequency=0.13)
    both = Structure(
        np.diag([1.3, 0.7]),
        np.diag([0.03, 0.05]),
        np.diag([1.7, 2.9]),
        drive=drive,
        contacts=[Contact(laws[0], [1, 0]), Contact(laws[1], [0, 1])],
    )
    run = simulate(both, duration=60)
    for j, (m, c, k) in enumerate(((1.3, 0.03, 1.7), (0.7, 0.05, 2.9))):
        alone = simulate(Oscillator(mass=m, stiffness=k, damping=c, law=laws[j], drive=drive), duration=60)
        times = np.linspace(0, 60, 400)
        found, known = run.sample(times, ("x",))[0][j], alone.sample(times, ("x",))[0][0]
        assert np.allclose(found, known, rtol=0, atol=1e-12)
        own = [event for event in run.events if event.contact == j]
        assert [(e.kind, e.side) for e in own] == [(e.kind, e.side) for e in alone.events]
        assert np.allclose([e.time for e in own], [e.time for e in alone.events], rtol=0, atol=1e-11)


def test_stops_are_counted_at_each_contact() -> None:
    """Two masses that do not know of each other stop as each alone does; of both together there is no one number."""
    drive, laws = (
        HarmonicForce(1.0, frequency=0.1 / (2 * math.pi)),
        (Coulomb(0.4), CompliantContact(0.5, stiffness=50.0)),
    )
    both = Structure(
        np.eye(2),
        np.zeros((2, 2)),
        np.eye(2),
        drive=drive,
        contacts=[Contact(laws[0], [1, 0]), Contact(laws[1], [0, 1])],
    )
    orbit = steady_state(both)
    for contact, law in enumerate(laws):
        alone = steady_state(Oscillator(mass=1, stiffness=1, law=law, drive=drive))
        single = steady_state(Structure(1.0, 0.0, 1.0, contacts=[Contact(law, [1.0])], drive=drive))
        assert orbit.stops_at(contact) == alone.stops == single.stops
        assert alone.stops != (0, 0)
        speeds = [orbit.transition_speed_at(contact), single.transition_speed]
        assert speeds == pytest.approx([alone.transition_speed] * 2, rel=1e-9, nan_ok=True)
    for question in ("stops", "transition_speed"):
        with pytest.raises(ModelError, match=f"ask {question}_at"):
            getattr(orbit, question)
    with pytest.raises(ModelError, match="counted from 0"):
        orbit.stops_at(2)


def some_matrices(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass and stiffness positive definite, damping small, all full."""
    full = rng.normal(size=(3, size, size))
    mass, stiffness = (part @ part.T / size + 0.3 * np.eye(size) for part in full[:2])
    return mass, 0.01 * full[2] @ full[2].T / size, 2 * stiffness


def test_without_contact_it_is_the_matrix_exponential() -> None:
    mass, damping, stiffness = some_matrices(np.random.default_rng(1), 4)
    start = np.random.default_rng(2).normal(size=8)
    run = simulate(
        Structure(mass, damping, stiffness),
        duration=50,
        start=dict(zip(["x1", "x2", "x3", "x4", "v1", "v2", "v3", "v4"], start, strict=True)),
    )
    inverse = np.linalg.inv(mass)
    flow = np.block([[np.zeros((4, 4)), np.eye(4)], [-inverse @ stiffness, -inverse @ damping]])
    for time in (0.0, 0.3, 7.0, 50.0):
        assert np.allclose(run.sample([time], ("state",))[0][:, 0], expm(flow * time) @ start, rtol=0, atol=1e-11)
    assert run.events == ()


def some_structure(seed: int) -> Structure:
    """Two or three degrees of freedom with two or three contacts of every kind, driven."""
    rng = np.random.default_rng(seed)
    size, count = int(rng.integers(2, 4)), int(rng.integers(1, 4))
    laws: list[Law] = [Coulomb(0.4, static=0.4 * rng.uniform(1, 1.5)), CompliantContact(0.3, stiffness=40.0)]
    contacts = []
    for j in range(min(count, size)):
        follows = rng.random() < 0.6
        contacts.append(
            Contact(
                laws[int(rng.integers(2))],
                rng.normal(size=size) if rng.random() < 0.5 else np.eye(size)[j],
                normal=rng.normal(size=size) if follows else None,
                stiffness=rng.uniform(0.5, 5) if follows else 0.0,
                preload=rng.uniform(0.2, 1.0),
                carried=rng.uniform(-1, 1),
            )
        )
    drives: list[Drive] = [
        Belt(0.3),
        HarmonicForce(1.0, frequency=0.2),
        HarmonicBase(0.5, frequency=0.2, contact="base"),
    ]
    mass, damping, stiffness = some_matrices(rng, size)
    return Structure(mass, damping, stiffness, contacts=contacts, drive=drives[int(rng.integers(3))])


def stored(structure: Structure, q: np.ndarray, v: np.ndarray) -> float:
    """Kinetic energy, and what springs, closed contacts and the preloads hold, at one instant."""
    total = v @ structure.mass @ v / 2 + q @ structure.stiffness @ q / 2
    for contact in structure.contacts:
        if contact.normal is not None:
            pressed, k, load = contact.normal @ q, contact.stiffness, contact.preload
            total += k * pressed**2 / 2 if load + k * pressed > 0 else -load * pressed - load**2 / (2 * k)
    return float(total)


@pytest.mark.parametrize("seed", range(30))
def test_the_work_of_friction_damping_and_drive_is_what_the_energy_loses(seed: int) -> None:
    structure = some_structure(seed)
    rng = np.random.default_rng(seed + 100)
    names = [f"{name}{j + 1}" for name in "xv" for j in range(structure.size)]
    run = simulate(structure, duration=40.0, start=dict(zip(names, rng.normal(size=len(names)), strict=True)))
    assert energy(run).residual < 1e-12
    # Gauss's rule of 20 points on short stretches between events: exact to rounding
    ends = np.append(run.starts, run.duration)
    edges = np.concatenate([np.linspace(a, b, max(2, int((b - a) / 0.1) + 2))[:-1] for a, b in pairwise(ends)])
    edges = np.append(edges, run.duration)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    widths = np.diff(edges)
    times = np.clip((edges[:-1, None] + widths[:, None] * (nodes + 1) / 2).ravel(), 0, run.duration)
    v, f, slip = (run.sample(times, (name,))[0] for name in ("v", "friction", "slip"))
    z, force = (run.sample(times, (name,))[0][0] for name in ("z", "force"))
    weight = (widths[:, None] * weights / 2).ravel()
    drive = np.sum(np.outer(structure.acts_on, force) * v, axis=0)
    drive += np.sum((structure.stiffness @ np.outer(structure.acts_on, z)) * v, axis=0)
    rates = [drive, -np.sum(v * (structure.damping @ v), axis=0), -np.sum((structure.tangents.T @ f) * v, axis=0)]
    work = sum(float(weight @ rate) for rate in rates)
    turnover = sum(float(weight @ np.abs(rate)) for rate in rates)
    begin, end = (stored(structure, *np.split(run.sample([t], ("x", "v"))[0][:, 0], 2)) for t in (0.0, run.duration))
    assert abs(end - begin - work) <= 1e-12 * (turnover + abs(begin) + abs(end))
    loads = run.sample(times, ("load",))[0]
    levels = np.array([[contact.law.static or contact.law.kinetic] for contact in structure.contacts])
    assert np.all(np.abs(f) <= levels * loads + 1e-9)
    assert np.min(loads) >= -1e-9
    rigid = [j for j, contact in enumerate(structure.contacts) if isinstance(contact.law, Coulomb)]
    assert np.all((f * slip)[rigid] >= -1e-12), "friction takes energy wherever it slides"


def test_contacts_in_series_move_as_one_mass_until_the_weaker_one_slides() -> None:
    """A block on a block: the upper one rides until the force that carries it, m2 a, would exceed its friction."""
    drive = HarmonicForce(3.0, frequency=0.1)
    blocks = {"mass": np.diag([2.0, 0.5]), "damping": np.zeros((2, 2)), "stiffness": np.diag([1.5, 0.0])}

    def pair(upper: float) -> Structure:
        contacts = [Contact(Coulomb(0.8), [1, 0]), Contact(Coulomb(upper), [-1, 1])]
        return Structure(**blocks, contacts=contacts, drive=drive, acts_on=[1, 0])

    one = simulate(Oscillator(mass=2.5, stiffness=1.5, law=Coulomb(0.8), drive=drive), duration=50)
    times = np.linspace(0, 50, 2001)
    needed = np.max(np.abs(0.5 * one.sample(times, ("a",))[0]))
    riding = simulate(pair(1.001 * needed), duration=50)
    assert {event.contact for event in riding.events} == {0}
    assert np.allclose([e.time for e in riding.events], [e.time for e in one.events], rtol=0, atol=1e-12 * 50)
    both, alone = riding.sample(times, ("x",))[0], one.sample(times, ("x",))[0][0]
    assert np.allclose(both, alone, rtol=0, atol=1e-12)
    assert np.allclose(
        riding.sample(times, ("friction",))[0][1], -0.5 * one.sample(times, ("a",))[0][0], rtol=0, atol=1e-11
    )
    sliding_off = simulate(pair(0.9 * needed), duration=50)
    assert {event.contact for event in sliding_off.events} == {0, 1}
    assert np.max(np.abs(sliding_off.sample(times, ("friction",))[0][1])) == pytest.approx(0.9 * needed, rel=1e-12)


def test_a_pulled_chain_breaks_away_block_by_block() -> None:
    """Three blocks on the ground, springs between, the first pulled slowly: each goes when its spring has its force."""
    stiffness = np.array([[20.0, -10.0, 0.0], [-10.0, 20.0, -10.0], [0.0, -10.0, 10.0]])
    contacts = [Contact(Coulomb(level), np.eye(3)[j]) for j, level in enumerate((1.0, 0.7, 0.4))]
    chain = Structure(np.eye(3), 8.0 * np.eye(3), stiffness, contacts=contacts, drive=Ramp(1e-5), acts_on=np.ones(3))
    # K acts_on = (10, 0, 0): the ramp pulls at the first block's spring alone
    run = simulate(chain, duration=4e5)
    first = {}
    for event in run.events:
        first.setdefault(event.contact, event.time)
    assert list(first) == [0, 1, 2]
    assert first[0] == pytest.approx(1.0 / 10 / 1e-5, rel=1e-12)
    # quasi-static: springs in series, the viscous force is 1e-4 N
    assert first[1] == pytest.approx((1.0 / 10 + 2 * 0.7 / 10) / 1e-5, rel=2e-3)
    assert first[2] == pytest.approx((1.0 / 10 + 2 * 0.7 / 10 + 3 * 0.4 / 10) / 1e-5, rel=2e-3)


def test_contacts_that_let_go_at_the_same_instant_all_go() -> None:
    contacts = [Contact(Coulomb(0.5), row) for row in np.eye(3)]
    alike = Structure(
        np.eye(3), np.zeros((3, 3)), np.eye(3), contacts=contacts, drive=HarmonicForce(1.1, frequency=0.1)
    )
    alone = simulate(
        Oscillator(mass=1, stiffness=1, law=Coulomb(0.5), drive=HarmonicForce(1.1, frequency=0.1)), duration=80
    )
    run = simulate(alike, duration=80)
    assert len(alone.events) > 10
    for contact in range(3):
        own = [event for event in run.events if event.contact == contact]
        assert [(e.kind, e.mode) for e in own] == [(e.kind, e.mode) for e in alone.events]
        assert np.allclose([e.time for e in own], [e.time for e in alone.events], rtol=0, atol=1e-11)
    moved = run.sample(np.linspace(0, 80, 300), ("x",))[0]
    assert np.allclose(moved[0], moved[2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_events_keep_when_the_unit_of_force_changes(scale: float) -> None:
    parts = np.eye(2), 0.01 * np.eye(2), np.array([[23.25, 3.897], [3.897, 7.75]])
    pad = Contact(Coulomb(0.6, static=0.7), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
    runs = []
    for s in (1.0, scale):
        contacts = [
            replace(pad, stiffness=11.0 * s, preload=5.0 * s),
            Contact(CompliantContact(0.2 * s, stiffness=40.0 * s), [1, 1]),
        ]
        system = Structure(*(s * part for part in parts), contacts=contacts, drive=Belt(0.8))
        runs.append(simulate(system, duration=40.0, start={"x1": 0.3, "x2": -0.1, "v1": 0.0, "v2": 0.0}))
    assert len(runs[0].events) > 20
    assert [event[1:] for event in runs[0].events] == [event[1:] for event in runs[1].events]
    assert np.allclose([e.time for e in runs[0].events], [e.time for e in runs[1].events], rtol=0, atol=1e-12 * 40)


def test_a_steady_orbit_and_its_multipliers_are_those_of_the_map() -> None:
    """Eigenvalues of the exact derivative, saltation included, against differences of the map over a period."""
    contacts = [Contact(Coulomb(0.3), [1, 0]), Contact(Coulomb(0.2, static=0.25), [0, 1])]
    system = Structure(
        np.diag([1.0, 1.5]),
        0.05 * np.eye(2),
        [[3, -1], [-1, 2]],
        contacts=contacts,
        drive=HarmonicForce(1.2, frequency=0.13),
    )
    steady = steady_state(system)
    assert steady.status == "unique"
    point = steady.orbit.states[0, :4]

    def lap(state: np.ndarray) -> np.ndarray:
        run = simulate(system, cycles=1, start=dict(zip(("x1", "x2", "v1", "v2"), state, strict=True)))
        return np.asarray(run.sample([run.duration], ("state",))[0][:, 0])

    assert np.allclose(lap(point), point, rtol=0, atol=1e-12)
    jacobian = np.array([(lap(point + h) - lap(point - h)) / 2e-6 for h in 1e-6 * np.eye(4)]).T
    known = np.linalg.eigvals(jacobian)
    assert np.allclose(np.sort_complex(steady.multipliers), np.sort_complex(known), rtol=0, atol=1e-7)


def test_rounding_does_not_decide_which_contacts_let_go() -> None:
    """Two rigid contacts that could not both hold at the start, on speeds that differ by a factor of 300.

    The rounding of the fast one in the slow one's velocity would send the contacts back and forth for ever.
    """
    contacts = [
        Contact(Coulomb(0.4, static=1.2), [-1.05671755, -0.00328638], normal=[-0.11354892, -0.45557381],
                stiffness=16.777666, preload=0.69541498, carried=0.0),
        Contact(Coulomb(0.4), [0.0, 1.0], normal=[0.04465903, 0.35865158],
                stiffness=26.42518335, preload=0.68725912, carried=-1.0),
    ]  # fmt: skip
    system = Structure(
        [[0.79583862, -0.88669992], [-0.88669992, 2.43713904]],
        np.zeros((2, 2)),
        [[3.49942177, 1.29017092], [1.29017092, 2.02142097]],
        contacts=contacts,
        drive=MultiTone([(1.0, 0.2, 0.0), (0.3, 3.0, 1.0)], on="face"),
    )
    run = simulate(system, duration=10.0)
    assert run.pieces[0].mode == "stuck + back"
    friction, load, slip = (run.sample([1e-6], (name,))[0][:, 0] for name in ("friction", "load", "slip"))
    assert abs(friction[0]) < 1.2 * load[0]
    assert slip[0] == pytest.approx(0, abs=1e-15)
    assert slip[1] < 0
    assert energy(run).residual < 1e-12


@pytest.mark.parametrize("seed", range(40))
def test_hard_structures_never_hang(seed: int) -> None:
    """Masses over six decades, loads and contacts over four, static up to three times kinetic, negative damping."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 5))
    mass, damping, stiffness = some_matrices(rng, size)
    if seed % 3 == 0:
        mass = np.diag(10.0 ** rng.uniform(-3, 3, size))
    contacts = []
    for j in range(int(rng.integers(1, min(4, size + 1)))):
        ratio = float(rng.choice([1.0, 1.3, 3.0]))
        soft = CompliantContact(
            0.3, stiffness=10 ** rng.uniform(0, 3), damping=float(rng.choice([0, 1])), static=0.3 * ratio
        )
        follows = rng.random() < 0.5
        contacts.append(
            Contact(
                Coulomb(0.4, static=0.4 * ratio) if rng.random() < 0.6 else soft,
                np.eye(size)[j] if rng.random() < 0.3 else rng.normal(size=size),
                normal=rng.normal(size=size) if follows else None,
                stiffness=10 ** rng.uniform(-1, 3) if follows else 0.0,
                preload=rng.uniform(0.1, 2),
                carried=float(rng.choice([0, 1, -1])),
            )
        )
    system = Structure(
        mass, -0.2 * damping if seed % 7 == 0 else damping, stiffness, contacts=contacts, drive=DRIVES[seed % 6]
    )
    run = simulate(system, duration=5.0, budget=2000)
    assert energy(run).residual < 1e-12
    assert np.all(run.durations[:-1] > 0)


GOOD = {"mass": np.eye(2), "damping": np.zeros((2, 2)), "stiffness": np.eye(2)}
STATE = StateVariable(1.1, rate=2.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Structure(**{**GOOD, "mass": [[1.0, 1.0], [1.0, 1.0]]}), "positive definite"),
        (lambda: Structure(**{**GOOD, "mass": [[1.0, 0.0], [0.0, -1.0]]}), "positive definite"),
        (lambda: Structure(**{**GOOD, "mass": [[1.0, 0.5], [0.0, 1.0]]}), "symmetric"),
        (lambda: Structure(**{**GOOD, "mass": [[0.0, 0.0], [0.0, 0.0]]}), "positive definite"),
        (lambda: Structure(**{**GOOD, "mass": [[math.nan, 0.0], [0.0, 1.0]]}), "finite"),
        (lambda: Structure(**{**GOOD, "mass": [[1.0, 0.0]]}), "mass of shape"),
        (lambda: Structure(**{**GOOD, "stiffness": np.eye(3)}), "2 by 2"),
        (lambda: Structure(**{**GOOD, "mass": [1.0, 2.0]}), "2 by 2"),
        (lambda: Structure(**{**GOOD, "stiffness": [[3.0, 2.0], [0.5, 1.0]]}), "springs is symmetric"),
        (lambda: Structure(**{**GOOD, "damping": 1.0}), "2 by 2"),
        (lambda: Structure(**{**GOOD, "mass": [[1.0, 0.0], [0.0]]}), "rows of equal length"),
        (lambda: Structure(**{**GOOD, "stiffness": [["soft", 0.0], [0.0, 1.0]]}), "stiffness = "),
        (lambda: Structure(**GOOD, contacts=Contact(Coulomb(1.0), [1, 0])), "list of Contact"),  # type: ignore[arg-type]
        (lambda: Structure(**GOOD, contacts=[Coulomb(1.0)]), "list of Contact"),  # type: ignore[list-item]
        (lambda: Structure(**GOOD, contacts=[Contact(Coulomb(1.0), [1.0])]), "degree of freedom"),
        (lambda: Structure(**GOOD, contacts=[Contact(Coulomb(1.0), [1, 0], normal=[1], stiffness=1.0)]), "normal of 1"),
        (lambda: Structure(**GOOD, acts_on=[1.0]), "acts_on"),
        (lambda: Structure(**GOOD, damper="wall"), "wall"),
        (lambda: Structure(**GOOD, contacts=[Contact(Coulomb(1.0), row) for row in ([1, 0], [2, 0])]), "tangential"),
        (lambda: Structure(**GOOD).having(masss=np.eye(2)), "masss"),
        (lambda: Contact(Coulomb(1.0), [1, 0], preload=-1.0), "preload = -1.0 N"),
        (lambda: Contact(Coulomb(1.0), [1, 0], preload=math.nan), "preload"),
        (lambda: Contact(Coulomb(1.0), [0, 0]), "not all zero"),
        (lambda: Contact(Coulomb(1.0), [1, math.inf]), "finite"),
        (lambda: Contact(Coulomb(1.0), [1, 0], stiffness=5.0), "without normal"),
        (lambda: Contact(Coulomb(1.0), [1, 0], normal=[0, 1]), "stiffness = 0"),
        (lambda: Contact(Coulomb(1.0), [1, 0], normal=[0, 1], stiffness=-1.0), "stiffness = -1"),
        (lambda: Contact(STATE, [1, 0], normal=[0, 1], stiffness=1.0), "StateVariable under a load that follows"),
        (lambda: Contact(STATE, [1, 0], preload=5.0), "under a preload"),
        (lambda: Contact(TimeDelay(LinearSlope(1.0, slope=0.1), lag=0.1), [1, 0]), "TimeDelay in a structure"),
        (lambda: simulate(Structure(**GOOD), duration=1.0, start={"x3": 1.0}), "x3"),
        (lambda: simulate(Structure(**{**GOOD, "stiffness": np.zeros((2, 2))}), cycles=1), "no cycles"),
    ],
)
def test_what_has_no_meaning_is_refused(call: Any, words: str) -> None:
    with pytest.raises(ModelError) as refused:
        call()
    assert words in str(refused.value)
    assert refused.value.value
    assert refused.value.rule
    assert refused.value.next_step


def test_more_joint_modes_than_fit_are_refused() -> None:
    size = 9
    many = [Contact(Coulomb(1.0), row) for row in np.eye(size)]
    with pytest.raises(ModelError, match="joint modes"):
        simulate(Structure(np.eye(size), np.zeros((size, size)), np.eye(size), contacts=many), duration=1.0)
