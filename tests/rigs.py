"""The thesis's rig, simulated: what its sensors read of a mass on a compliant contact, and what is true of it."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss

CASES = {5.61: (0.6e-3, 1.05), 8.7: (1.1e-3, 1.1), 11.1: (2e-3, 1.1), 2.5: (0.65e-3, 1.1)}
RIG = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.1196}
LAG = 0.0389 / 30.91
SETTLED = 8.0  # s


@cache
def motion(frequency: float, rough: float = 0.0, seconds: float = 1.0) -> ss.solve.Trajectory:
    """The slider at one of the thesis's frequencies, settled for 8 s."""
    amplitude, kinetic = CASES[frequency]
    law: Any = ss.laws.CompliantContact(kinetic, stiffness=192000, damping=23.9)
    if rough:
        law = ss.laws.RoughSurface(law, share=rough, length=2e-4, span=2e-3, seed=4)
    slider = ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(amplitude, frequency=frequency), **RIG)
    return ss.simulate(slider, duration=SETTLED + seconds)


@cache
def measured(
    frequency: float, rough: float = 0.0, seconds: float = 1.0, seed: int = 7
) -> tuple[ss.Record, NDArray[np.float64]]:
    """A record of the thesis's rig, and the true friction."""
    run = motion(frequency, rough, seconds)
    record = ss.Rig().measure(run, fs=4000, rng=seed, start=SETTLED)
    return record, run.sample(np.minimum(SETTLED + record.time, run.duration), ("friction",))[0][0]


def told(record: ss.Record, wrong: bool = False) -> ss.Record:
    """The record with what its user knows of the sensors: rightly, or 2 %, 30 % and 20 us off."""
    for name in ("x", "z"):
        record = record.with_details(name, delay=LAG + 20e-6 * wrong)
    record = record.with_details("a", mount=(127.5, 0.13) if wrong else (125.0, 0.1))
    cell = {"mount": (255.0, 0.065), "inertia": 0.055} if wrong else {"mount": (250.0, 0.05), "inertia": 0.05}
    return record.with_details("load", discharge=50.0, **cell)
