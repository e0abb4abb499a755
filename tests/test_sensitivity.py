"""Derivatives of a motion by its parameters, event by event: against central differences of the motion itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.parameters import find
from stickslip.solve.sensitivity import sensitivity

RIG: dict[str, Any] = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.5}
TIME = np.arange(200) / 200
SWEPT = 1e-3 * np.sin(10 * np.pi * TIME) + 0.5e-3 * np.sin(14 * np.pi * TIME)
STEP = 1e-6
DRIVES = [ss.drives.HarmonicBase(0.65e-3, frequency=2.5), ss.drives.Recorded(SWEPT, fs=200.0)]
LAWS = {
    "static": (ss.laws.Coulomb(0.95, static=1.2), ["kinetic", "damping", "stiffness"]),
    "compliant": (ss.laws.CompliantContact(0.95, stiffness=192000, damping=24.0), ["kinetic", "law.stiffness"]),
    "state": (ss.laws.StateVariable(0.95, rate=120.0, steepness=3000.0), ["kinetic", "rate", "damping"]),
}


@pytest.mark.parametrize("drive", DRIVES, ids=["tone", "knots"])
@pytest.mark.parametrize("name", LAWS)
def test_a_motion_changes_as_its_neighbours_differ(name: str, drive: Any) -> None:
    law, free = LAWS[name]
    system = ss.Oscillator(law=law, drive=drive, **RIG)
    start, times = {"x": 2e-4, "v": 0.03}, np.linspace(0.0, 0.79, 400)

    def moved(name: str, share: float) -> ss.Oscillator:
        value: Any = system
        for part in find(system, name)[0]:
            value = getattr(value, part)
        return system.having(**{name: value * (1 + share)})

    run = ss.simulate(system, duration=0.8, start=start)
    told = sensitivity(
        run, [moved(name, STEP) for name in free], step=STEP, starts={}, scaled=[], outputs=("x", "a")
    )  # fmt: skip
    for k, parameter in enumerate(free):
        near = [ss.simulate(moved(parameter, share), duration=0.8, start=start) for share in (-1e-4, 1e-4)]
        for output in ("x", "a"):
            (low, before), (high, after) = (each.sample(times, (output,)) for each in near)
            same = before == after  # a jump that has crossed an instant has no slope
            slope = told.sample(times, output)[k]
            assert np.allclose(slope[same], ((high - low)[0] / 2e-4)[same], atol=1e-4 * np.abs(slope).max(), rtol=0)
