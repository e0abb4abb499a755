"""Steady sliding: thresholds of closed form, what feeds the vibration, and that the exact engine agrees."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import stickslip as ss

W1, W2 = 200 * math.pi, 150 * math.pi


def inclined(friction: float = 0.3, preload: float = 10.0, **law: float) -> ss.Structure:
    """MC-1: two inclined springs and a contact spring on a belt."""
    pad = ss.Contact(
        ss.laws.LinearSlope(friction, **{"slope": 0.0, **law}), [1, 0], normal=[0, 1], stiffness=11.0, preload=preload
    )
    stiffness = [[23.25, 3.8971143170299739], [3.8971143170299739, 7.75]]
    return ss.Structure(np.eye(2), np.zeros((2, 2)), stiffness, contacts=[pad], drive=ss.drives.Belt(1.0))


ROCK = ss.laws.RateState(1.0, 0.6, 0.01, 0.015, distance=1e-3, reference=1e-3)


def block(law: Any, speed: float = 1.0) -> ss.Oscillator:
    return ss.Oscillator(1.0, 1.0, law, ss.drives.Belt(speed), damping=0.3)


def crossed(eta: tuple[float, float] = (0.0, 0.0)) -> ss.Structure:
    """MC-2: two modes that press each other's contacts."""
    pads = [
        ss.Contact(ss.laws.Coulomb(0.1), [1, 0], normal=[0, 1], stiffness=W2**2, preload=1e3),
        ss.Contact(ss.laws.Coulomb(0.1), [0, 1], normal=[1, 0], stiffness=W1**2, preload=1e3, carried=-1.0),
    ]
    damping = np.diag([eta[0] * W1, eta[1] * W2])
    return ss.Structure(np.eye(2), damping, np.zeros((2, 2)), contacts=pads, drive=ss.drives.Belt(1.0))


def test_the_inclined_springs_couple_at_the_closed_form() -> None:
    critical = ss.squeak.critical_value(inclined(), "kinetic", between=(0.05, 1.0))
    assert critical.value == pytest.approx(0.47237749297333017, rel=1e-13)
    assert 2 * math.pi * critical.frequency == pytest.approx(4.58257569495584, rel=1e-13)
    assert (critical.mechanism, critical.stable_below) == ("mode coupling", True)


@pytest.mark.parametrize(
    ("eta", "critical", "frequency"),
    [
        ((0.0, 0.0), 0.29166666666666667, math.sqrt((100**2 + 75**2) / 2)),
        ((0.02, 0.02), 0.2893671255228094, 86.602540378443865),
        ((0.02, 0.06), 0.2717900338224474, 93.026050941906342),
        ((0.001, 0.1), 0.067461045152826729, 99.711755628543196),
    ],
)
def test_damping_may_lower_the_threshold_of_coupling(
    eta: tuple[float, float], critical: float, frequency: float
) -> None:
    found = ss.squeak.critical_value(crossed(eta), "kinetic", between=(0.01, 1.0))
    assert found.value == pytest.approx(critical, rel=1e-12)
    assert found.frequency == pytest.approx(frequency, rel=1e-12)


@pytest.mark.parametrize(
    ("exponent", "band"), [(1.0, (0.0, 0.23025850929940457)), (2.0, (0.0050125787690136614, 0.19084020979734697))]
)
def test_a_falling_curve_feeds_motion_in_its_band(exponent: float, band: tuple[float, float]) -> None:
    """ST-1: c + F'(V) = 0 at its ends."""
    law = ss.laws.Stribeck(1.0, 1.5, speed=0.1, exponent=exponent, viscous=0.2)
    slider = block(law, speed=0.1)
    upper = ss.squeak.critical_value(slider, "drive.speed", between=(0.05, 1.0))
    assert (upper.value, upper.stable_below) == (pytest.approx(band[1], rel=1e-12), False)
    assert upper.mechanism == "falling friction"
    if band[0]:
        lower = ss.squeak.critical_value(slider, "drive.speed", between=(1e-3, 0.05))
        assert (lower.value, lower.stable_below) == (pytest.approx(band[0], rel=1e-12), True)
    same = ss.solve.steady_sliding(slider)
    assert ss.stability(slider).growth == pytest.approx(same.eigenvalues[0].real, rel=1e-12)


@pytest.mark.parametrize("friction", [0.3, 0.5, 0.8])
def test_a_sprag_jams_at_its_angle(friction: float) -> None:
    """SP-1: a strut inclined by atan(1/mu) is drawn in, whatever the load."""

    def inclined_by(angle: float) -> ss.Structure:
        law, tangent, normal = ss.laws.Coulomb(friction), [-math.sin(angle)], [-math.cos(angle)]
        pad = ss.Contact(law, tangent, normal=normal, stiffness=1e4, preload=10.0)
        return ss.Structure([[1.0]], [[0.0]], [[0.0]], contacts=[pad], drive=ss.drives.Belt(1.0))

    critical = ss.squeak.critical_value(inclined_by(1.0), inclined_by, between=(0.1, 1.5))
    assert critical.value == pytest.approx(math.atan(1 / friction), rel=1e-12)
    assert (critical.mechanism, critical.frequency) == ("jamming", 0.0)


def test_each_mechanism_is_told_by_switching_it_off() -> None:
    damped = inclined().having(damping=0.05 * np.eye(2))
    falls = {"slope": -0.02}
    assert ss.stability(damped).mechanism == "stable"
    assert ss.stability(damped.having(kinetic=0.6)).mechanism == "mode coupling"
    assert ss.stability(damped.having(**falls)).mechanism == "falling friction"
    assert ss.stability(damped.having(kinetic=0.6, **falls)).mechanism == "mode coupling, and falling friction too"
    near = ss.squeak.critical_value(damped, "kinetic", between=(0.05, 1.0)).value
    both = ss.stability(damped.having(kinetic=0.999 * near, slope=-0.003))
    assert both.mechanism == "mode coupling and falling friction together"
    assert both.without_slope < 0 < both.growth
    assert both.without_coupling < 0


def test_what_nothing_damps_neither_grows_nor_dies_away() -> None:
    """At MC-1 both frequencies meet, and the rounding of a double root is about 1e-10."""
    meeting = ss.stability(ss.scenarios.get("MC-1").system)
    assert meeting.stable
    assert "neither grows nor dies away" in repr(meeting)
    assert "border of stability: a vibration at 0.72934 Hz neither" in ss.summary(meeting).headline[0]


@pytest.mark.parametrize(
    ("damping", "stiffness"),
    [
        ([[-1, 0], [0, 0.1]], [[23, 4], [4, 8]]),
        ([[0, 0.5], [0.5, 0]], [[23, 4], [4, 8]]),
        (np.zeros((2, 2)), [[-23, 0], [0, 8]]),
    ],
)
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_what_grows_without_friction_is_the_structure(damping: Any, stiffness: Any, friction: float) -> None:
    pad = ss.Contact(ss.laws.Coulomb(friction), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
    stability = ss.stability(ss.Structure(np.eye(2), damping, stiffness, contacts=[pad], drive=ss.drives.Belt(1.0)))
    assert not stability.stable
    assert stability.mechanism == "the structure itself"


def test_one_mass_neither_couples_nor_jams() -> None:
    fed = ss.stability(block(ss.laws.Coulomb(1.0)).having(damping=-0.3))
    assert fed.mechanism == "the structure itself"
    steep = ss.stability(block(ss.laws.LinearSlope(10.0, slope=-5.0)))
    assert (steep.frequency, steep.mechanism) == (0.0, "falling friction")
    buckles = lambda k: ss.Structure(np.eye(2), np.zeros((2, 2)), [[k, 0], [0, 8.0]], contacts=inclined().contacts)  # noqa: E731
    critical = ss.squeak.critical_value(buckles(1.0), buckles, between=(-1.0, 1.0), speed=1.0)
    assert (critical.value, critical.frequency) == (pytest.approx(0.0, abs=1e-9), 0.0)


def test_a_slope_counts_with_the_load() -> None:
    damped = inclined(0.0, slope=-0.01).having(damping=0.05 * np.eye(2))
    critical = ss.squeak.critical_value(damped, "preload", between=(0.1, 50.0))
    assert (critical.mechanism, critical.stable_below) == ("falling friction", True)
    heavier = ss.squeak.critical_value(damped.having(slope=-0.005), "preload", between=(0.1, 50.0))
    assert heavier.value == pytest.approx(2 * critical.value, rel=1e-12)


@pytest.mark.parametrize("change", [{"kinetic": 0.6}, {"slope": -0.02}, {"kinetic": 0.6, "slope": 0.01}])
def test_the_exact_engine_grows_as_the_eigenvalue_says(change: dict[str, float]) -> None:
    block = inclined().having(damping=0.05 * np.eye(2), **change)
    stability = ss.stability(block)
    rest = np.array(stability.place)
    start = dict(zip(("x1", "x2", "v1", "v2"), [rest[0] + 1e-6, rest[1], 0.0, 0.0], strict=True))
    period = 1 / stability.frequency
    run = ss.simulate(block, duration=12 * period, start=start)
    assert run.events == ()
    assert stability.loads[0] == pytest.approx(10.0 + 11.0 * rest[1], rel=1e-12)
    early, late = (run.sample([n * period], ("x", "v"))[0][:, 0] - [*rest, 0, 0] for n in (11.0, 12.0))
    grown = complex(*_share(stability, late)) / complex(*_share(stability, early))
    assert math.log(abs(grown)) == pytest.approx(stability.growth * period, abs=1e-6)


def _share(found: ss.squeak.Stability, state: np.ndarray) -> tuple[float, float]:
    """Real and imaginary part of the fastest mode's share in a state."""
    columns = []
    for mode in found.modes:
        value = complex(mode.growth, 2 * math.pi * mode.frequency)
        vector = np.concatenate([mode.shape, value * mode.shape])
        columns += [vector.real, -vector.imag]
    shares = np.linalg.solve(np.array(columns).T, state)
    return float(shares[0]), float(shares[1])


def test_a_map_says_what_ends_the_sliding() -> None:
    block = inclined().having(damping=0.05 * np.eye(2))
    chart = ss.squeak.stability_map(block, grid={"kinetic": [0.3, 0.6], "slope": [-0.02, 0.0, 0.02]})
    assert chart.mechanism.sel(kinetic=0.3, slope=0.0) == "stable"
    assert chart.mechanism.sel(kinetic=0.6, slope=0.0) == "mode coupling"
    assert chart.mechanism.sel(kinetic=0.3, slope=-0.02) == "falling friction"
    assert dict(chart.growth.sizes) == {"kinetic": 2, "slope": 3}
    one = ss.stability(block.having(kinetic=0.6, slope=0.02))
    assert float(chart.growth.sel(kinetic=0.6, slope=0.02)) == one.growth


def test_a_contact_that_would_lift_off_is_named() -> None:
    lifting = inclined()
    pull = ss.Contact(ss.laws.Coulomb(30.0), [0, -1])
    stability = ss.stability(lifting.having(contacts=[*lifting.contacts, pull]))
    assert stability.loads[0] <= 0
    assert stability.status == "contact 1 would lift off before it slides steadily"
    assert "lift off" in repr(stability)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: ss.stability(inclined().having(drive=ss.drives.Release())), "driven by Release"),
        (lambda: ss.stability(inclined(), speed=0.0), "speed = 0"),
        (lambda: ss.stability(ss.Structure([[1.0]], [[0.0]], [[1.0]], drive=ss.drives.Belt(1.0))), "without contacts"),
        (lambda: ss.stability(block(ss.laws.LuGre(1.0, 1.5, speed=0.1, stiffness=1e4))), "LuGre"),
        (lambda: ss.stability(block(ss.laws.StateVariable(1.0, rate=10.0))), "remembers"),
        (lambda: ss.squeak.critical_value(block(ROCK), "evolution", between=(0.001, 0.1)), "RateState, which"),
        (lambda: ss.squeak.critical_value(inclined(), "kinetic", between=(0.1, 0.2)), "stable at 257 values"),
        (lambda: ss.squeak.critical_value(inclined(), "kinetic", between=(0.2, 0.1)), "the lower one first"),
        (lambda: ss.squeak.critical_value(inclined(), "kinetic", between=(0.2,)), "two values"),  # type: ignore[arg-type]
        (lambda: ss.squeak.stability_map(inclined(), grid={"kinetic": ["a"]}), "finite numbers"),  # type: ignore[list-item]
        (lambda: ss.squeak.critical_value(inclined(), "kinetik", between=(0.1, 0.2)), "kinetik"),
        (lambda: ss.squeak.stability_map(inclined(), grid={}), "a map has values"),
        (lambda: ss.squeak.stability_map(inclined(), grid={"kinetic": []}), "a map has values"),
    ],
)
def test_what_has_no_answer_is_refused(call: Any, words: str) -> None:
    with pytest.raises(ss.errors.ModelError) as refused:
        call()
    assert words in str(refused.value)


def test_what_is_refused_says_what_would_do() -> None:
    def rig(load: float) -> ss.Structure:
        return inclined(preload=load)

    with pytest.raises(ss.errors.ModelError, match=r"grid over lod; .* takes load"):
        ss.squeak.stability_map(rig, grid={"lod": [1, 2]})
    for between, step in (((2, 2), "lowest"), ((2,), "lowest"), ((2, 1), "turn them round")):
        with pytest.raises(ss.errors.ModelError, match=step):
            ss.squeak.critical_value(inclined(), "kinetic", between=between)  # type: ignore[arg-type]
    for values, step in (([6.0], "linspace"), ([], "linspace"), ([[1, 2, 3]], "linspace"), ([1, 3, 2], "sort")):
        with pytest.raises(ss.errors.ModelError, match=step):
            ss.squeak.limit_cycles(inclined(), "kinetic", values=values)


def test_a_threshold_and_what_dies_away_are_told_in_words() -> None:
    rig = ss.squeak.squeak_rig("wet", load=6.13)
    load = ss.squeak.critical_value(rig, lambda n: ss.squeak.squeak_rig("wet", n), between=(1.23, 6.13), speed=-0.1)
    assert repr(load).startswith("Threshold: stable below 1.79")
    assert repr(load).endswith("; beyond, mode coupling at 421 Hz")
    assert " dies away by 0.5" in repr(ss.stability(ss.squeak.squeak_rig("wet", 1.23), speed=-0.1))
    assert " grows by 61.88 " in repr(ss.stability(rig, speed=-0.1))


def test_a_map_that_turns_back_is_refused() -> None:
    with pytest.raises(ss.errors.ModelError, match="sort them, each of them once"):
        ss.squeak.stability_map(lambda load: ss.squeak.squeak_rig("wet", load), grid={"load": [2, 1, 1]}, speed=-0.1)


@pytest.mark.parametrize("power", [1.5, 2.5])
def test_a_load_of_a_power_slides_where_its_forces_balance(power: float) -> None:
    rig = ss.squeak.squeak_rig("wet", 6.13).having(power=power)
    stability = ss.stability(rig, speed=-0.1)
    left = rig.stiffness @ np.array(stability.place)
    for contact, load in zip(rig.contacts, stability.loads, strict=True):
        approach = contact.normal @ np.array(stability.place) * contact.stiffness / (power * contact.preload)
        assert load == pytest.approx(contact.preload * (1 + approach) ** power, rel=1e-12)
        friction = contact.law.kinetic * load + 0.1 * contact.law.slope * contact.preload
        left = left + (load - contact.preload) * np.asarray(contact.normal) + friction * np.asarray(contact.tangent)
    assert np.max(np.abs(left)) < 1e-12 * np.max(stability.loads)


def test_a_vibration_under_a_power_grows_as_its_eigenvalue_says() -> None:
    pad = ss.Contact(ss.laws.Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0, power=1.5)
    springs = [[23.25, 3.9], [3.9, 7.75]]
    mass = ss.Structure(np.eye(2), np.zeros((2, 2)), springs, contacts=[pad], drive=ss.drives.Belt(1.0))
    cycle = ss.squeak.limit_cycle(mass)
    assert cycle.growth == pytest.approx(cycle.sliding.growth, rel=1e-3)


def test_friction_that_rises_is_not_said_to_fall() -> None:
    """What damps the slide alone may let two coupled motions grow: the paradox of destabilising damping."""
    dry = ss.squeak.squeak_rig("dry", 12.0)
    stability = ss.stability(dry, speed=-0.1)
    assert dry.contacts[0].law.slope > 0
    assert stability.mechanism == "mode coupling and rising friction together"
    assert stability.without_slope < 0 < stability.growth


def test_a_power_without_a_preload_is_refused() -> None:
    with pytest.raises(ss.errors.ModelError, match="power = 2 without normal"):
        ss.Contact(ss.laws.Coulomb(0.6), [1, 0], preload=5.0, power=2)
