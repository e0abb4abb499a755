"""Modes that would take turns without end: Filippov's rule makes one of them, which holds the mass or its speed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

import stickslip as ss
from stickslip.laws.base import Exit, Mode, Rigid, Row
from stickslip.laws.curved import CurvedMode, Sliding, either_side, exp, lifted, symbol, with_sliding_modes


@dataclass(frozen=True)
class Sides(Rigid):
    """Coulomb's law by one who forgot that a mass sticks."""

    level: float

    @property
    def entry(self) -> tuple[str, str, str]:
        return "back", "forward", "forward"

    def modes(self) -> tuple[Mode, ...]:
        return (
            Mode("back", "slip", -1, {"1": -self.level}, (Exit({"v": 1.0}, "forward"),)),
            Mode("forward", "slip", 1, {"1": self.level}, (Exit({"v": -1.0}, "back"),)),
        )


@dataclass(frozen=True)
class CurvedSides(Sliding):
    """The same as a curved law, with a memory that moves to where the friction is."""

    level: float

    @property
    def memory(self) -> Mapping[str, Row]:
        return {"trace": {}}

    def rates(self) -> tuple[CurvedMode, ...]:
        level = self.level + 0.0 * exp(symbol("v"))
        return tuple(
            CurvedMode(name, "slip", side, side * level, (turn,), {"trace": side * level - symbol("trace")})
            for name, side, turn in either_side()
        )


@dataclass(frozen=True)
class Step(Rigid):
    """Friction that jumps up at a speed."""

    low: float
    high: float
    speed: float

    @property
    def entry(self) -> tuple[str, str, str]:
        return "slow", "slow", "slow"

    def modes(self) -> tuple[Mode, ...]:
        at = self.speed
        return (
            Mode("slow", "slip", 1, {"1": self.low}, (Exit({"v": 1.0, "1": -at}, "fast"),)),
            Mode("fast", "slip", 1, {"1": self.high}, (Exit({"v": -1.0, "1": at}, "slow"),)),
        )


def _driven(law: object) -> ss.Oscillator:
    drive = ss.drives.HarmonicForce(1.0, frequency=0.5 / (2 * math.pi))
    return ss.Oscillator(mass=1.0, stiffness=1.0, law=law, drive=drive)  # type: ignore[arg-type]


@pytest.mark.parametrize("law", [Sides(0.6), CurvedSides(0.6)])
def test_two_slips_without_a_stick_are_coulombs_law(law: object) -> None:
    run, truth = (ss.simulate(_driven(one), cycles=8) for one in (law, ss.laws.Coulomb(0.6)))
    times = np.linspace(0, run.duration, 500)
    assert "between back and forward" in {event.mode for event in run.events}
    kinds = ([event.kind for event in one.events if event.time > 0] for one in (run, truth))
    assert next(kinds) == next(kinds)
    np.testing.assert_allclose(run.sample(times, ("x",))[0], truth.sample(times, ("x",))[0], atol=1e-10)
    np.testing.assert_allclose(run.sample(times, ("friction",))[0], truth.sample(times, ("friction",))[0], atol=1e-9)


def test_memory_follows_the_mixture() -> None:
    """While the mass sticks, what would follow the friction of either side follows that between them: T' = f - T."""
    run = ss.simulate(_driven(CurvedSides(0.6)), cycles=4)
    times = np.linspace(0, run.duration, 20_001)
    trace, friction = run.sample(times, ("trace", "friction"))[0]
    step = times[1]
    kept = [0.0]
    for f, g in pairwise(friction):
        kept.append(kept[-1] + step * ((f + g) / 2 - kept[-1]) / (1 + step / 2))
    np.testing.assert_allclose(trace, kept, atol=2e-3)


def test_a_jump_of_friction_at_a_speed_holds_that_speed() -> None:
    """A steady pull between both levels: it speeds up evenly, then goes on at the speed of the jump."""
    pull = ss.drives.MultiTone([(1.0, 1e-9, 0.0)], on="force")
    run = ss.simulate(ss.Oscillator(1.0, 0.0, Step(0.5, 2.0, 1.0), pull), duration=5.0)
    (event,) = [event for event in run.events if event.mode.startswith("between")]
    assert event.time == pytest.approx(2.0, abs=1e-9)
    assert event.kind == "slip"
    assert run.state(5.0)["v"] == 1.0
    assert run.state(5.0)["x"] == pytest.approx(1.0 + 3.0, abs=1e-9)
    assert run.state(5.0)["friction"] == pytest.approx(1.0, abs=1e-9)


def test_continuous_friction_needs_no_mode_between() -> None:
    for law in (ss.laws.LuGre(1.0, 1.5, speed=1e-3, stiffness=1e5, damping=300.0), ss.laws.Dahl(1.0, 1e4)):
        assert with_sliding_modes(law.rates()) == law.rates()
    for linear in (ss.laws.Coulomb(1.0), ss.laws.PositionLoad(1.0, 0.5), ss.laws.CompliantContact(1.0, 1e5)):
        assert with_sliding_modes(linear.modes()) == linear.modes()
    assert lifted(1.0).symbols == frozenset()


def test_two_slips_without_a_stick_hold_in_a_structure() -> None:
    contact, truth = (ss.Contact(law, [1.0, 0.0]) for law in (Sides(0.6), ss.laws.Coulomb(0.6)))
    drive = ss.drives.HarmonicForce(2.0, frequency=0.1)
    systems = [
        ss.Structure(np.eye(2), 0.1 * np.eye(2), [[2.0, -1.0], [-1.0, 1.0]], [one], drive, acts_on=[0.0, 1.0])
        for one in (contact, truth)
    ]
    runs = [ss.simulate(system, cycles=6) for system in systems]
    times = np.linspace(0, runs[0].duration, 300)
    x, y = (run.sample(times, ("x",))[0] for run in runs)
    np.testing.assert_allclose(x, y, atol=1e-10)
