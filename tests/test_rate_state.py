"""Rate-and-state friction that comes to rest and turns: against SciPy's Radau, which is led through each stop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.solve import collocation, taylor
from stickslip.solve.curved import implicit_of, model_of
from stickslip.solve.tape import tape

SLOWEST = 1e-10  # m/s: of the reference, in units of a motion of some m/s


def textbook(ratio: float, law: str, distance: float) -> ss.laws.RateState:
    """The textbook's coefficients, with a larger or smaller direct effect."""
    return ss.laws.RateState(1.0, 0.6, 0.6 / ratio, 0.9 / ratio, distance=distance, reference=1e-3, law=law)


def reference(system: ss.Oscillator, speed: float, end: float) -> dict[str, float]:
    """The state at the end, by the stress q = f/(a N) in the place of the velocity.

    Where the mass has stopped, the reference goes on with the creep that the push makes, or with sliding the other way.
    """
    law, drive, mass = system.law, system.drive, system.mass
    face = drive.speed if isinstance(drive, ss.drives.Belt) else 0.0
    # a law that turns within speeds that SciPy can follow needs no help
    least = SLOWEST * (abs(face) or 1.0) if law.friction > 30 * law.direct else -1.0

    def push(t: float, x: float, v: float) -> float:
        spring = -system.stiffness * x - system.damping * v
        return spring + (0.0 if face else drive.amplitude * math.cos(2 * math.pi * drive.frequency * t))

    def slip(q: float, renewed: float) -> tuple[float, float, float]:
        grip = (law.friction + law.evolution * renewed) / law.direct
        onward, backward = law.reference * math.exp(q - grip), law.reference * math.exp(-q - grip)
        return onward - backward, onward + backward, grip

    def rates(t: float, y: np.ndarray, begun: float) -> list[float]:
        x, q, renewed = y
        s, turn, _ = slip(q, renewed)
        way = abs(s) / law.reference * math.exp(renewed)
        ageing = 1 - way if law.law == "aging" else -way * math.log(way + 1e-300)
        ageing *= law.reference / law.distance * math.exp(-renewed)
        left = push(begun + t, x, face + s) - law.direct * law.normal * q
        return [face + s, left / mass / turn + s / turn * law.evolution / law.direct * ageing, ageing]

    def stops(t: float, y: np.ndarray, begun: float) -> float:
        return abs(slip(y[1], y[2])[0]) - least

    stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]
    q = math.asinh((speed - face) / (2 * law.reference) * math.exp(law.friction / law.direct))
    now, y = 0.0, np.array([0.0, q, 0.0])
    while True:
        small = [
            3e-14,
            3e-12,
            3e-13,
        ]  # at three times as much an age came 2e-8 off, and with it on some processors alone
        solution = solve_ivp(rates, (0, end - now), y, "Radau", rtol=3e-12, atol=small, events=stops, args=(now,))
        now, y = now + solution.t[-1], solution.y[:, -1].copy()
        s, _, grip = slip(y[1], y[2])
        if solution.status != 1:
            assert solution.status == 0, solution.message
            age = law.distance / law.reference * math.exp(y[2])
            return {"x": y[0], "v": face + s, "age": age, "friction": law.direct * law.normal * y[1]}
        held, most = push(now, y[0], face) / (law.direct * law.normal), math.log(least / law.reference) + grip
        y[1] = held if abs(held) < most else math.copysign(most + 1e-3, held)


def forced(ratio: float, law: str, frequency: float) -> tuple[Any, ...]:
    return ratio, law, 1e-2, ss.drives.HarmonicForce(1.2, frequency), 0.1, 1.2 / frequency


def belt(ratio: float, law: str) -> tuple[Any, ...]:
    return ratio, law, 1e-6, ss.drives.Belt(0.1), 0.0, 6.0


# Each with what `reference`, which takes ten seconds a case, came to: x, v, age and friction at the end.
CASES = [
    (forced(20, "aging", 0.1), (1.5583900900653285, -0.7464981322660014, 0.013557821236902173, -0.50130983843432)),
    (forced(60, "slip", 0.15), (1.8558669411005717, 0.3926274818935949, 0.022851080187507374, 0.5685084830495589)),
    (forced(300, "aging", 0.05), (1.002789006544197, -0.0018196633429736825, 5.081962127095128, -0.5991666400337226)),
    (belt(60, "aging"), (0.5913250663057841, 0.0999999984433019, 5.827242159783881, -0.5963250510580688)),
    (belt(300, "slip"), (0.5915651999892123, 0.09999131565264775, 0.00724680123246567, -0.5964492144292536)),
    (forced(60, "aging", 0.05), (1.0365350655938603, -0.00698575331778918, 4.881426523037961, -0.6086815144149612)),
    (forced(100, "slip", 0.05), (1.0071466003444105, -0.007198854323167156, 0.1666393650122256, -0.5749929558793672)),
    (forced(150, "aging", 0.05), (1.010988827431744, -0.0029612019668388886, 5.058350754056294, -0.6002531134186145)),
    (forced(300, "slip", 0.15), (1.7414746644280732, 0.38493703596819046, 0.023319016525265815, 0.5937229460027491)),
    (belt(60, "slip"), (0.5913240416808194, 0.09999780587359147, 0.04633424137964818, -0.596318505603544)),
    (belt(300, "aging"), (0.5915656600258481, 0.0999999995968488, 5.832393485648425, -0.5965656399517724)),
]


def system_of(case: tuple[Any, ...]) -> ss.Oscillator:
    ratio, law, distance, drive, _, _ = case
    return ss.Oscillator(1.0, 1.0, textbook(ratio, law, distance), drive, damping=0.05)


@pytest.mark.parametrize(("case", "truth"), CASES)
def test_stops_and_reversals_are_those_of_an_implicit_solver(case: tuple[Any, ...], truth: tuple[float, ...]) -> None:
    *_, speed, end = case
    run = ss.simulate(system_of(case), duration=end, start={"v": speed})
    largest = dict(zip(("x", "v", "age"), np.max(np.abs(run.corners), axis=0), strict=False)) | {"friction": 0.6}
    assert len(run.events) >= 2
    for name, value in zip(("x", "v", "age", "friction"), truth, strict=True):
        assert run.state(end)[name] == pytest.approx(value, abs=1e-8 * largest[name]), name


@pytest.mark.soak
@pytest.mark.parametrize(("case", "truth"), CASES)
def test_the_implicit_solver_comes_to_what_is_kept_of_it(case: tuple[Any, ...], truth: tuple[float, ...]) -> None:
    *_, speed, end = case
    again = reference(system_of(case), speed, end)
    assert [again[name] for name in ("x", "v", "age", "friction")] == pytest.approx(truth, rel=1e-8)


@pytest.mark.parametrize("ratio", [60, 200, 300])
@pytest.mark.parametrize("law", ["aging", "slip"])
def test_a_driven_mass_starts_from_rest(law: str, ratio: float) -> None:
    for frequency in (0.05, 0.1, 0.15, 0.2):
        drive = ss.drives.HarmonicForce(1.2, frequency)
        run = ss.simulate(ss.Oscillator(1.0, 1.0, textbook(ratio, law, 1e-2), drive, damping=0.05), cycles=3)
        assert run.status == "complete"
        assert ss.solve.energy(run).residual < 1e-9


def test_a_contact_that_holds_ages_and_creeps_as_the_law_says() -> None:
    law = textbook(60, "aging", 1e-2)
    pulled = 0.5  # N: at the opening age the law creeps by V_0 exp((f - mu_0 N)/(a N))
    system = ss.Oscillator(1.0, 0.0, law, ss.drives.HarmonicForce(pulled, 1e-9))
    run = ss.simulate(system, duration=1.0)
    assert [event.kind for event in run.events] == []
    assert run.state(1.0)["friction"] == pytest.approx(pulled, rel=1e-12)
    begun, passed = law.distance / law.reference, 1.0
    creep = law.reference * math.exp((pulled - 0.6) / 0.01)
    assert run.state(0.0)["v"] == pytest.approx(creep, rel=1e-12)
    # the age grows by the time, the creep falls by age^(b/a)
    power = law.evolution / law.direct
    way = creep * begun / (1 - power) * ((1 + passed / begun) ** (1 - power) - 1)
    assert run.state(1.0)["x"] == pytest.approx(way, rel=1e-9)


def test_a_leap_that_comes_to_no_number_has_failed() -> None:
    """Its NaN had hidden behind larger numbers, and the same leap was tried for ever."""
    table = tape(ss.Oscillator(1.0, 1.0, textbook(60, "slip", 1e-2)))
    implicit, size = implicit_of(table, model_of(table, 1e-12)), len(table.names)
    stages = collocation.room(table.nodes.most, size, table.physical)
    stages.values[:] = math.nan
    assert collocation.settle(implicit, 0, np.zeros(size), 1.0, np.ones(size), stages) == math.inf


def test_a_mass_carried_along_by_a_face_that_shakes_takes_long_steps() -> None:
    """Implicit steps began with a velocity, not with a slip, and failed on such a face: 19 million small ones."""
    law = ss.laws.RateState(20.0, 0.6, 0.063, 0.089, distance=2.4e-5, reference=0.025)
    face = ss.drives.MultiTone([(1.7, 0.0824, 0.0)], on="face")
    run = ss.simulate(ss.Oscillator(4.12, 57.6, law, face, damping=0.308), duration=20.0)
    assert len(run.steps.starts) < 20_000
    assert ss.solve.energy(run).residual < 1e-9


def test_a_series_that_ends_in_no_number_has_no_length() -> None:
    """It passed for a short step, and the refusal spoke of "x = nan"."""
    series = np.array([1.0, 1.0, math.nan, 1.0])
    assert math.isnan(taylor.length(series, 3, np.ones(1), 1e-12))


@pytest.mark.parametrize("law", ["aging", "slip"])
def test_friction_between_the_points_of_a_leap_balances_the_forces(law: str) -> None:
    """Where the mass goes with a shaken face its acceleration is the face's, and friction what that takes of it; the
    slip, of which the law takes the logarithm, is there far below the tolerance of the velocity."""
    rock = ss.laws.RateState(122.0, 0.6, 0.0235, 0.0299, distance=1.6e-3, reference=5.6e-4, law=law)
    face = ss.drives.MultiTone([(0.0528, 3.2333, 0.0)], on="face")
    system = ss.Oscillator(6.209, 2047.1, rock, face, damping=22.55)
    structure = ss.Structure(6.209, 22.55, 2047.1, [ss.Contact(rock, [1.0])], face)
    for made in (system, structure):
        run = ss.simulate(made, duration=1.5)
        times = np.linspace(0, 1.5, 6001)[1:]
        x, v, a, friction, slip = run.sample(times, ("x", "v", "a", "friction", "slip"))[0]
        carried = np.abs(slip) < 1e-10
        assert np.mean(carried & (np.abs(slip) > 1e-12)) > 0.02
        omega = 2 * math.pi * 3.2333
        expected = -(omega**2) * 0.0528 * np.cos(omega * times)
        assert a[carried] == pytest.approx(expected[carried], abs=1e-5)
        balance = -6.209 * a - 22.55 * v - 2047.1 * x
        assert friction == pytest.approx(balance, abs=1e-9)
        assert ss.solve.energy(run).residual < 1e-10
