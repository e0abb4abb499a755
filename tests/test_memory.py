"""Which memory friction has, from loops at several frequencies, of known memories and of simulated laws."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip import Record
from stickslip.errors import EstimateError
from stickslip.law import friction_memory

AMPLITUDE, FS = 1e-3, 8000


def loop(kind: str, hz: float, *, noise: float = 0.0, value: float = 0.0, seed: int = 0, cycles: int = 12) -> Record:
    """A sine of displacement and a friction with memory, run in for two cycles."""
    t = np.arange(round((cycles + 2) / hz * FS)) / FS
    x, v = AMPLITUDE * np.sin(2 * np.pi * hz * t), np.cos(2 * np.pi * hz * t)
    if kind == "late":
        f = np.sign(np.cos(2 * np.pi * hz * (t - value)))
    elif kind == "state":
        f = np.zeros_like(t)
        for i in range(1, t.size):  # exact while the sign of v stands
            f[i] = np.sign(v[i]) + (f[i - 1] - np.sign(v[i])) * np.exp(-1 / FS / value)
    elif kind == "way":
        f = np.zeros_like(t)
        for i in range(1, t.size):
            f[i] = np.clip(f[i - 1] + (x[i] - x[i - 1]) / value, -1, 1)
    else:
        f = np.sign(v) * (1 + 0.3 * np.exp(-np.abs(v) / 0.2))
    f = f + np.random.default_rng(seed).normal(0, noise, t.size)
    start = round(2 / hz * FS)
    return Record.of({"x": x[start:], "friction": 1.3 * f[start:]}, fs=FS)


@pytest.mark.parametrize(
    ("kind", "value", "memory", "attribute"),
    [
        ("late", 1e-2, "time delay", "delay"),
        ("state", 1e-2, "state variable", "time"),
        ("way", 5e-5, "way", "give"),
    ],
)
def test_each_memory_is_told_from_the_others(kind: str, value: float, memory: str, attribute: str) -> None:
    found = friction_memory([loop(kind, hz, value=value, noise=0.02) for hz in (2.0, 5.0, 12.0)])
    assert found.memory == memory, found.reason
    assert found.rotation == "anticlockwise"
    estimate = getattr(found, attribute)
    assert estimate.value == pytest.approx(value, rel=0.04)
    assert estimate.includes(value)
    assert min(found.misfit, key=found.misfit.__getitem__) == memory


def test_a_curve_over_the_speed_has_no_memory() -> None:
    memory = friction_memory([loop("curve", hz, noise=0.02) for hz in (2.0, 8.0)])
    assert (memory.memory, memory.rotation) == ("none", "none")
    assert all(abs(phase.value) < 0.02 for phase in memory.phases)


def test_one_frequency_tells_the_rotation_alone() -> None:
    memory = friction_memory(loop("state", 5.0, value=1e-2))
    assert (memory.memory, memory.rotation) == ("undecided", "anticlockwise")
    assert "second frequency" in memory.reason
    assert memory.phases[0].value == pytest.approx(np.arctan(2 * np.pi * 5.0 * 1e-2), rel=0.02)


def test_friction_that_goes_ahead_is_gone_round_clockwise() -> None:
    memory = friction_memory([loop("late", hz, value=-3e-3) for hz in (2.0, 6.0)])
    assert (memory.memory, memory.rotation) == ("undecided", "clockwise")
    assert "clockwise" in memory.reason
    assert memory.delay is None


@pytest.mark.parametrize(
    ("law", "memory"),
    [
        (ss.laws.StateVariable(1.1, rate=30.0), "state variable"),
        (ss.laws.CompliantContact(1.1, stiffness=20000), "way"),
    ],
)
def test_laws_of_the_thesis_are_told(law: object, memory: str) -> None:
    """A slider shaken near and above its resonance, sliding all the time, as the thesis has it (4.4)."""
    records = []
    for hz, base in ((5.6, 0.6e-3), (8.7, 1.2e-3), (11.1, 2.0e-3)):
        slider = ss.Oscillator(mass=2.42, stiffness=2310, law=law, drive=ss.drives.HarmonicBase(base, frequency=hz))
        run = ss.simulate(slider, cycles=60).record(fs=4000)
        records.append(run.rows(len(run) // 2, len(run)))
    found = friction_memory(records)
    assert found.memory == memory, found.reason
    if memory == "way":
        assert found.give.value == pytest.approx(1.1 / 20000, rel=0.03)
    else:
        assert found.time.value == pytest.approx(1 / (1.1 * 30.0), rel=0.03)


def shaken(law: object, hz: float, base: float, *, noise: float = 0.0) -> Record:
    """A slider shaken slowly, where a rigid contact sticks, or fast; 8 cycles, run in."""
    slider = ss.Oscillator(
        mass=2.42, stiffness=2310, damping=0.12, law=law, drive=ss.drives.HarmonicBase(base, frequency=hz)
    )
    run = ss.simulate(slider, cycles=12).record(fs=4000)
    run, rng = run.rows(round(4000 * 4 / hz), len(run)), np.random.default_rng(1)
    x, friction = (run[name] + noise * np.ptp(run[name]) * rng.standard_normal(len(run)) for name in ("x", "friction"))
    return Record.of({"x": x, "friction": friction}, fs=4000)


@pytest.mark.parametrize("noise", [0.0, 0.002])
@pytest.mark.parametrize("law", [ss.laws.Coulomb(1.1), ss.laws.Coulomb(1.1, static=1.4)])
def test_friction_that_sticks_has_no_memory(law: object, noise: float) -> None:
    memory = friction_memory([shaken(law, 2.5, 0.65e-3, noise=noise), shaken(law, 8.7, 1.1e-3, noise=noise)])
    assert (memory.memory, memory.rotation) == ("none", "none"), memory.reason
    assert all(phase.includes(0.0) for phase in memory.phases)
    assert "at 2.5 Hz the contact rests 3" in memory.status
    assert "at 8.7 Hz the contact" not in memory.status


def test_a_state_is_told_though_the_contact_almost_sticks() -> None:
    law = ss.laws.StateVariable(1.1, rate=60.0)
    memory = friction_memory([shaken(law, 2.5, 0.65e-3), shaken(law, 8.7, 1.1e-3)])
    assert memory.memory == "state variable", memory.reason
    assert memory.time.includes(1 / (1.1 * 60.0))
    assert memory.time.value == pytest.approx(1 / (1.1 * 60.0), rel=0.03)


def test_noise_speaks_against_no_memory() -> None:
    memory = friction_memory([loop("curve", hz, noise=30.0) for hz in (2.0, 8.0)])
    assert memory.memory == "undecided"
    assert "less noise" in memory.reason


def test_what_can_not_be_told_is_refused() -> None:
    with pytest.raises(EstimateError, match="no record"):
        friction_memory([])
    t = np.arange(8000) / 1000
    one_way = Record.of({"v": 1 + 0.5 * np.sin(6 * t), "friction": 1 + 0.1 * np.sin(6 * t)}, fs=1000)
    with pytest.raises(EstimateError, match="give a record that reverses"):
        friction_memory(one_way)
