"""Every law of linear modes against scipy's DOP853, which knows its table alone: sequence first, then values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.laws.base import Exit, Law, Mode

LAWS: dict[str, Law] = {
    "rigid": ss.laws.Coulomb(0.4, static=0.5),
    "compliant": ss.laws.CompliantContact(0.4, 60.0),
    "compliant, damped": ss.laws.CompliantContact(0.4, 60.0, damping=0.6, static=0.5),
    "compliant, consistent": ss.laws.CompliantContact(0.4, 60.0, damping=0.6, rule="consistent"),
    "slope": ss.laws.LinearSlope(0.4, slope=-0.05, static=0.5),
    "table": ss.laws.Tabulated([0.0, 0.2, 0.7, 1.5], [0.5, 0.35, 0.3, 0.4]),
    "state variable": ss.laws.StateVariable(0.4, rate=30.0, steepness=40.0),
    "inertial": ss.laws.InertialContact(0.4, 60.0, mass=0.05, damping=0.3, static=0.5),
    "elements": ss.laws.ElastoSlip([20.0, 10.0, 5.0], [0.1, 0.2, 0.15]),
    "position": ss.laws.PositionLoad(0.4, gradient=0.3),
    "in series": ss.laws.InSeries(ss.laws.LinearSlope(0.4, slope=0.05, static=0.5), stiffness=60.0, damping=0.4),
}
FORCE, RATE, PHASE, SPRING, LOSS, MASS = 1.0, 0.7, 0.4, 1.3, 0.05, 1.1
NUDGE = 1e-6  # s: an exit at the very start of a piece is looked at a little later


class Replay:
    """The motion of one law under a harmonic force, from its table, by a general solver."""

    def __init__(self, law: Law) -> None:
        self.memory = tuple(law.memory)
        self.modes = {mode.name: mode for mode in law.modes()}
        self.entry = law.entry[1]

    def pull(self, t: float, y: np.ndarray, order: int = 0) -> float:
        """What friction has to hold, or its rate."""
        drive = FORCE * RATE**order * math.cos(RATE * t + PHASE + order * math.pi / 2)
        return drive - SPRING * y[order] - LOSS * y[1] * (order == 0)

    def value(self, form: Mapping[str, float], t: float, y: np.ndarray, mode: Mode) -> float:
        still = {"1": 1.0, "face_acceleration": 0.0}
        own = {"x": y[0], "v": y[1], **still, **dict(zip(self.memory, y[2:], strict=True))}
        total = sum(factor * own[name] for name, factor in form.items() if name not in ("f", "df"))
        total += form["f"] * self.friction(t, y, mode) if "f" in form else 0.0
        return total + (form["df"] * self.pull(t, y, 1) if "df" in form else 0.0)

    def friction(self, t: float, y: np.ndarray, mode: Mode) -> float:
        return self.pull(t, y) if mode.friction is None else self.value(mode.friction, t, y, mode)

    def rate(self, t: float, y: np.ndarray, mode: Mode) -> np.ndarray:
        held = mode.friction is None
        a = 0.0 if held else (self.pull(t, y) - self.friction(t, y, mode)) / MASS
        return np.array(
            [0.0 if held else y[1], a, *(self.value(mode.rates.get(n, {}), t, y, mode) for n in self.memory)]
        )

    def on(self, t: float, y: np.ndarray, mode: Mode, end: float, **events: Any) -> Any:
        options = {"rtol": 1e-12, "atol": 1e-14, "max_step": 0.03, **events}
        return solve_ivp(self.rate, (t, end), y, "DOP853", args=(mode,), **options)

    def leave(self, t: float, y: np.ndarray, mode: Mode, way: Exit) -> tuple[np.ndarray, Mode]:
        following, after = self.modes[way.to], y.copy()
        for name, form in way.reset.items():
            after[2 + self.memory.index(name)] = self.value(form, t, y, mode)
        if following.friction is None or set(way.quantity) == {"v"}:
            after[1] = 0.0
        return after, following

    def run(self, y: np.ndarray, end: float) -> tuple[list[tuple[float, str]], np.ndarray]:
        t, mode, events, named = 0.0, self.modes[self.entry], [], self.entry
        while True:
            for _ in range(8):
                begun = self.on(t, y, mode, t + NUDGE).y[:, -1]
                due = [e for e in mode.exits if not e.crossing and self.value(e.quantity, t + NUDGE, begun, mode) > 0]
                if not due:
                    break
                y, mode = self.leave(t, y, mode, due[0])
            if mode.name != named and t > 0:
                events.append((t, mode.name))
                named = mode.name
            ways = [lambda s, z, m, e=e: self.value(e.quantity, s, z, m) for e in mode.exits]
            for way in ways:
                way.terminal, way.direction = True, 1  # type: ignore[attr-defined]
            piece = self.on(t + NUDGE, begun, mode, end, events=ways)
            t, y = float(piece.t[-1]), piece.y[:, -1]
            if piece.status != 1:
                return events, y
            way = next(e for e, found in zip(mode.exits, piece.t_events, strict=True) if len(found))
            y, mode = self.leave(t, y, mode, way)
            named = ""


@pytest.mark.parametrize("name", LAWS)
def test_a_law_moves_as_a_general_solver_has_it(name: str) -> None:
    law = LAWS[name]
    drive = ss.drives.HarmonicForce(FORCE, RATE / (2 * math.pi), PHASE)
    system = ss.Oscillator(mass=MASS, stiffness=SPRING, damping=LOSS, law=law, drive=drive)
    end = 25.0
    run = ss.simulate(system, duration=end, start={"x": 0.2})
    opened = np.array([0.2, 0.0, *(run.states[0][2 : run.table.physical])])
    events, last = Replay(law).run(opened, end)
    own = [(event.time, event.mode) for event in run.events]
    assert len(own) >= 7
    assert [mode for _, mode in own] == [mode for _, mode in events]
    assert np.allclose([t for t, _ in own], [t for t, _ in events], rtol=0, atol=1e-9)
    assert np.allclose(run.sample([end], ("state",))[0][:, 0], last, rtol=0, atol=1e-9)
