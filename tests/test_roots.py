"""The first root of an exit: at the start, at the end, double, simultaneous, and two where one step would jump."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.solve.assembly import table_of
from stickslip.solve.roots import NOISE, NONE, UNSURE, first_rise, opening_order


def rise(roots: list[float], *, lead: float = 1.0, low: int = 0, limit: float = 1.0) -> float:
    """First rise of lead * product of (u - root), after the `low` zeros at the start are divided out."""
    c = np.zeros(21)
    whole = lead * np.poly(roots)[::-1]
    c[: len(whole)] = whole
    noise = NOISE * np.abs(np.poly(np.abs(roots))[::-1])
    noises = np.full(21, 1e-300)
    noises[: len(noise)] = abs(lead) * noise
    return float(first_rise(c, noises, 21, low, 1.0, 0.0, limit))


def test_no_rise_below_zero_is_left_unproved() -> None:
    """On -1 to 1, without noise, the march came to stand where the numbers are finer: 6 of these cubics were unsure."""
    rng, noise = np.random.default_rng(1), np.zeros(21)
    for _ in range(20_000):
        c = np.zeros(21)
        c[:4] = rng.standard_normal(4)
        if np.polyval(c[3::-1], -1.0) < 0 < np.polyval(c[3::-1], 1.0):
            root = first_rise(c, noise, 21, 0, 1.0, -1.0, 1.0)
            assert -1 < root <= 1, c[:4].tolist()
            assert abs(np.polyval(c[3::-1], root)) < 1e-12


@pytest.mark.parametrize(
    ("roots", "lead", "found", "tolerance"),
    [
        ([0.3], 1.0, 0.3, 1e-15),  # the plain one
        ([0.3, 0.3 + 1e-6], -1.0, 0.3, 1e-8),  # up and down again within a millionth: not jumped over
        ([0.3, 0.3 + 1e-9], -1.0, NONE, 0),  # a crest within the rounding
        ([0.3, 0.30001, 0.9], 1.0, 0.3, 1e-9),  # known to the rounding over the distance of the roots
        ([0.2, 0.5, 0.7], 1.0, 0.2, 1e-14),
        ([0.999999999], 1.0, 0.999999999, 1e-15),
        ([1.0], 1.0, 1.0, 1e-15),  # at the very end of the time: belongs to it
        ([1.0 + 1e-12], 1.0, NONE, 0),
        ([2.0], 1.0, NONE, 0),
        ([0.4, 0.4], -1.0, NONE, 0),  # touches and falls: a tangency is no crossing
        ([0.4, 0.4, 0.8], 1.0, 0.8, 1e-14),  # touches, then crosses
        ([0.4, 0.4, 0.4], 1.0, 0.4, 1e-3),  # a triple root crosses; known to the cube root of the rounding
    ],
)
def test_the_first_rise(roots: list[float], lead: float, found: float, tolerance: float) -> None:
    assert rise(roots, lead=lead) == pytest.approx(found, abs=tolerance)


def test_no_earlier_root_is_jumped_over_in_a_thousand_polynomials() -> None:
    g = np.random.default_rng(7)
    for _ in range(1000):
        roots = list(g.uniform(0.01, 1.6, int(g.integers(1, 7))))
        lead = -1.0 if len(roots) % 2 == 0 else 1.0  # below zero at the start
        ordered = sorted(roots)
        known = ordered[0] if ordered[0] <= 1.0 else NONE
        gap = min(np.diff([*ordered, 9.0]))
        if gap < 1e-4 or abs(ordered[0] - 1.0) < 1e-9:
            continue
        assert rise(roots, lead=lead) == pytest.approx(known, abs=1e-10), roots


def test_a_rise_after_a_fall_is_not_jumped_over() -> None:
    """Above zero at the start, down through it, and up again: with whatever curvature where it falls."""
    g = np.random.default_rng(0)
    for fall, away, *others in [(0.1, 0.2, -0.1), *g.uniform([0.02, 0.06, -3, -3], [0.6, 0.35, 0, 0], (2000, 4))]:
        c = np.zeros(21)
        whole = np.poly([fall, fall + away, *others])[::-1]
        c[: len(whole)] = whole
        noise = np.full(21, NOISE * np.sum(np.abs(c)))
        down = first_rise(c, noise, 21, 0, -1.0, 0.0, 1.0)
        assert down == pytest.approx(fall, abs=1e-9)
        assert first_rise(c, noise, 21, 0, 1.0, down + 1e-12, 1.0) == pytest.approx(fall + away, abs=1e-9)


def test_a_march_that_runs_out_of_steps_says_so() -> None:
    """A touch of the twentieth order, where each step is a tenth of the one left: nothing is proved there."""
    c, noise = np.zeros(21), np.full(21, 1e-300)
    c[:] = [-math.comb(20, k) * (-2.0) ** k for k in range(21)]  # -(1 - 2 u)^20
    assert first_rise(c, noise, 21, 0, 1.0, 0.0, 1.0) in (NONE, UNSURE)


def test_zeros_at_the_start_are_the_way_in() -> None:
    """A double zero at the start, as where a stick is let go, is divided out; what follows is found."""
    c, noise = np.zeros(21), np.full(21, 1e-18)
    c[2:4] = [-1.0, 1.6]  # -u^2 + 1.6 u^3: falls from its double zero, rises at 0.625
    assert opening_order(c, noise, 21) == 2
    assert first_rise(c, noise, 21, 2, 1.0, 0.0, 1.0) == pytest.approx(0.625, rel=1e-15)
    assert opening_order(np.zeros(21), noise, 21) == 21  # on the tie for good


def test_a_stop_of_a_millionth_of_a_period_is_seen() -> None:
    """A stick of 1e-6 periods between two slips: both ends lie in one step of any general solver."""
    period = 2 * math.pi
    for loaded in (1e-2, 1e-6, 1e-10):
        # after a slip to rest at the force's crest, friction falls short by `loaded` until the force has turned
        level = 1.0 - loaded
        system = ss.Oscillator(
            mass=1, stiffness=0, law=ss.laws.Coulomb(0.5, static=level), drive=ss.drives.HarmonicForce(1.0, 1 / period)
        )
        wait = math.acos(level)
        run = ss.simulate(system, duration=period, start={"x": 0.0})
        first = run.pieces[0]
        assert first.mode == "forward"
        late = ss.simulate(
            ss.Oscillator(
                mass=1,
                stiffness=0,
                law=ss.laws.Coulomb(0.5, static=level),
                drive=ss.drives.HarmonicForce(1.0, 1 / period, -wait - 1e-6 * period),
            ),
            duration=period,
        )
        assert late.pieces[0].mode == "stuck"
        assert late.pieces[0].duration == pytest.approx(1e-6 * period, rel=1e-9 if loaded > 1e-9 else 1e-4)
        assert late.pieces[1].mode == "forward"


def test_exits_at_one_instant_follow_the_law_s_order() -> None:
    """Two equal contacts of a symmetric structure break away and stop together, and stay equal."""
    drive = ss.drives.HarmonicForce(1.0, frequency=0.13)
    contacts = [ss.Contact(ss.laws.Coulomb(0.4, static=0.5), row) for row in ([1.0, 0.0], [0.0, 1.0])]
    pair = ss.Structure(
        np.eye(2), 0.02 * np.eye(2), [[2.0, -0.5], [-0.5, 2.0]], contacts=contacts, drive=drive, acts_on=[1.0, 1.0]
    )
    alone = ss.Oscillator(mass=1, stiffness=1.5, damping=0.02, law=ss.laws.Coulomb(0.4, static=0.5), drive=drive)
    run, one = ss.simulate(pair, cycles=5), ss.simulate(alone, cycles=5)
    times = np.linspace(0, run.duration, 2001)
    moved, known = run.sample(times, ("x",))[0], one.sample(times, ("x",))[0]
    assert np.allclose(moved, known, rtol=0, atol=1e-12)
    for contact in (0, 1):
        own = [event for event in run.events if event.contact == contact]
        assert [event.side for event in own] == [event.side for event in one.events]
        assert np.allclose([e.time for e in own], [e.time for e in one.events], rtol=0, atol=1e-12 * run.duration)


def test_stop_and_full_load_at_one_instant() -> None:
    """The mass comes to rest exactly where the spring pulls with the static force: the tie holds it."""
    system = ss.Oscillator(mass=1, stiffness=4, law=ss.laws.Coulomb(1.0))
    run = ss.simulate(system, duration=20, start={"x": 1.25})  # turns at -0.75 and 0.25, where 4 x = 1
    assert [event.kind for event in run.events] == ["reversal", "stick"]
    assert run.status == "at rest"
    # a hair of excess pulls it on, a hair less does not
    for start, sticks_at in ((1.25 * (1 + 1e-13), 3), (1.25 * (1 - 1e-13), 2)):
        assert len(ss.simulate(system, duration=20, start={"x": start}).events) == sticks_at


def test_the_end_of_the_time_on_an_event_keeps_the_event() -> None:
    system = ss.Oscillator(mass=1, stiffness=4, law=ss.laws.Coulomb(1.0))
    run = ss.simulate(system, duration=math.pi / 2, start={"x": 3.0})  # the first reversal
    assert len(run.modes) == 1
    assert run.durations[0] == pytest.approx(math.pi / 2, rel=1e-15)
    assert run.state(run.duration)["v"] == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize("stiffness", [0.0, 1.0])
@pytest.mark.parametrize("damping", [0.0, 1.0, 2.0, 2.0 * (1 + 1e-12)])
def test_repeated_and_zero_eigenvalues_are_exact(stiffness: float, damping: float) -> None:
    """Free, overdamped without a spring, critical, and a hair beside critical, under a pull that grows linearly."""
    speed = 0.3
    system = ss.Oscillator(
        mass=1, stiffness=stiffness, damping=damping, law=ss.laws.Coulomb(0.0), drive=ss.drives.Ramp(speed)
    )
    run = ss.simulate(system, duration=4.0, start={"x": 0.0, "v": 0.5})
    x = run.state(4.0)["x"]
    with np.errstate(all="ignore"):
        if stiffness == 0:
            known = 0.5 * (4.0 if damping == 0 else (1 - math.exp(-4 * damping)) / damping)
        elif damping == 0:
            known = speed * 4 + (0.5 - speed) * math.sin(4.0)
        else:  # critical: x = speed (t - 2) + (2 speed + b t) e^-t with x' = 0.5 at the start
            known = speed * 2 + (2 * speed + 4 * (0.5 + speed)) * math.exp(-4.0) if damping >= 2 else None
    if known is None:
        from scipy.linalg import expm

        flow = table_of(system).flow[run.modes[0]]
        known = float((expm(4.0 * flow) @ run.states[0])[0])
    assert x == pytest.approx(known, rel=1e-11 if damping > 2 else 1e-13)
