"""Friction laws fitted to other people's rigs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss

MASS, STIFFNESS, SPEED = 0.0307, 168.0, 1.1e-3  # of the paper slider: kg, N/m, m/s


@pytest.mark.parametrize("every", [12, pytest.param(6, marks=pytest.mark.soak)])
def test_paper_slips_as_often_as_its_law_says(dataset: Callable[[str], Path], every: int) -> None:
    """The force of the spring tells the way; friction differs from slip to slip, and the law is that of the mean.

    It is fitted from one slip to the next, of so many.
    """
    path = dataset("paper_stick_slip") / "k168Nm_v1100.mat"
    record = ss.read_record(path, channels={"load": f"Fnorm * {MASS * 9.81} [N]"})
    found = ss.balance.pulled_slider(record)
    way = SPEED * np.arange(len(record)) / record.fs - record["load"] / STIFFNESS
    rows = np.round((found.slips - record.time[0]) * record.fs).astype(int)
    level = float(np.median(record["load"]))
    slider = ss.Oscillator(
        MASS, STIFFNESS, law=ss.laws.Coulomb(level, static=1.08 * level), drive=ss.drives.Ramp(SPEED)
    )
    excesses = []
    for first, last in zip(rows[:-1:every], rows[1::every], strict=False):
        part = way[first : last + 60]
        alone = ss.Record.of({"x": part - part[0] - level / STIFFNESS}, fs=record.fs)
        fit = ss.fit_law(alone, slider, free=["static"], intervals=False)
        excesses.append(fit.law.static / level - 1)  # type: ignore[union-attr, operator]
    run = ss.simulate(slider.having(static=level * (1 + float(np.mean(excesses)))), duration=6.0)
    slips = [event.time for event in run.events if event.kind == "slip"]
    assert 1 / np.diff(slips)[-1] == pytest.approx(found.frequency.value, rel=0.10)
