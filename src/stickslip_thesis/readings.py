"""Which readings of the printed damping ratios give the printed numbers of micro-slips (sections 4.3 and 5.3).

The thesis gives the damping of the contact as a ratio and not of what, and no friction for the motion at 2.5 Hz; it
prints two micro-slips in each sticking interval at the smaller ratio and none at the larger one.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.figures.style import BLUE, FAINT, INK, styled
from stickslip_thesis.drawing import panels
from stickslip_thesis.printed import Given

FRICTIONS = tuple(float(level) for level in np.round(np.arange(1.06, 1.33, 0.02), 2))  # N: from Table 3.2's least on
LARGEST = 1.28  # N: Table 3.2's
STIFFNESSES = (181e3, 192e3, 201e3)  # N/m: the least, the mean and the largest of Table 3.1
COUNTS = (0, 2)  # micro-slips printed for case 1 and case 2


@dataclass(frozen=True)
class Reading:
    """What a damping ratio may be of: ``c = factor ζ sqrt(m s)``, s the spring, with the contact's or without."""

    factor: float
    coupled: bool

    @property
    def formula(self) -> str:
        """As the page writes it."""
        return f"{self.factor:g}ζ√(m{'(k + K_y)' if self.coupled else 'k'})"

    def damping(self, ratio: float, *, mass: float, spring: float, stiffness: float) -> float:
        """The contact's damping [N s/m]."""
        return self.factor * ratio * math.sqrt(mass * (spring + stiffness * self.coupled))


READINGS = tuple(Reading(factor, coupled) for factor in (2.0, 4.0) for coupled in (False, True))


def damping(given: Given, ratio: float) -> float:
    """The contact's damping under the reading from which the chapters start [N s/m]."""
    told = given["stick_slip"]
    reading = Reading(told["critical"], coupled=True)
    return reading.damping(ratio, mass=told["mass"], spring=told["spring"], stiffness=told["stiffness"])


@functools.lru_cache(2048)
def stick_slip(law: Any, base: float, frequency: float, mass: float, spring: float) -> ss.solve.SteadyState:
    """The steady motion of section 4.3 on a contact."""
    drive = ss.drives.HarmonicBase(base, frequency=frequency)
    return ss.steady_state(ss.Oscillator(mass=mass, stiffness=spring, law=law, drive=drive))


def micro_slips(orbit: ss.solve.SteadyState) -> int:
    """Slips within a macroscopic sticking interval: one less than its microsticks, of which a cycle has two sets."""
    return orbit.orbit.event_counts()["microstick"] // 2 - 1


def counts(told: Mapping[str, Any], reading: Reading, *, stiffness: float, kinetic: float) -> tuple[int, int]:
    """Micro-slips in case 1 and case 2 under a reading."""
    mass, spring = told["mass"], told["spring"]
    case1, case2 = (
        micro_slips(
            stick_slip(
                ss.laws.CompliantContact(
                    kinetic,
                    stiffness=stiffness,
                    damping=reading.damping(told[case], mass=mass, spring=spring, stiffness=stiffness),
                ),
                told["base"],
                told["frequency"],
                mass,
                spring,
            )
        )
        for case in ("case1", "case2")
    )
    return case1, case2


@styled
def drawn(given: Given) -> Any:
    """Counts of both cases against friction, for each reading and contact stiffness."""
    told = given["stick_slip"]
    rows = [(reading, stiffness) for reading in READINGS for stiffness in STIFFNESSES]
    sheet, ax = panels(1, height=4.4)
    ax.axvspan(FRICTIONS[0], LARGEST, color=FAINT, alpha=0.25, linewidth=0)
    for place, (reading, stiffness) in enumerate(rows):
        for kinetic in FRICTIONS:
            pair = counts(told, reading, stiffness=stiffness, kinetic=kinetic)
            as_printed = pair == COUNTS
            ax.text(
                kinetic, place, f"{pair[0]}·{pair[1]}", ha="center", va="center", fontsize=7,
                color=BLUE if as_printed else INK, fontweight="bold" if as_printed else "normal",
            )  # fmt: skip
        label = f"{reading.formula}, {stiffness / 1e3:g} kN/m"
        ax.text(FRICTIONS[0] - 0.02, place, label, ha="right", va="center", fontsize=7)
    ax.set(xlabel="friction f_k [N]", xlim=(FRICTIONS[0] - 0.12, FRICTIONS[-1] + 0.02), ylim=(len(rows) - 0.4, -0.6))
    ax.set(yticks=[], xticks=[1.06, 1.1, 1.15, 1.2, 1.25, 1.3])
    ax.grid(visible=False)
    return sheet
