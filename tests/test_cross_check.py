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
STILL = 5e-4  # of the level: what a tremble of 3,000 swings has left; the law holds the mass from there, as it says
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


# ---- without the table: a law as the literature has it, one mass drawn at random


class Drawn:
    """A mass under a harmonic force, and the times and directions (0: held) in which scipy has it go on."""

    def __init__(self, seed: int) -> None:
        self.draw = np.random.default_rng([61, seed])
        self.mass, self.spring, self.level = self.draw.uniform([0.7, 0.7, 0.2], [1.5, 1.5, 0.5])
        self.loss, self.force, self.rate = self.draw.uniform([0.0, 0.8, 0.3], [0.1, 1.6, 1.2])
        self.changes: list[tuple[float, int]] = []

    def pull(self, t: float, y: np.ndarray) -> float:
        return self.force * math.cos(self.rate * t) - self.spring * y[0] - self.loss * y[1]

    def pull_held(self, t: float) -> float:
        return -self.force * self.rate * math.sin(self.rate * t)

    def simulated(self, law: Law, end: float) -> ss.solve.Trajectory:
        drive = ss.drives.HarmonicForce(self.force, self.rate / (2 * math.pi))
        return ss.simulate(ss.Oscillator(self.mass, self.spring, law, drive, self.loss), duration=end)

    def go_on(self, t: float, side: int) -> None:
        if not self.changes or self.changes[-1][1] != side:
            self.changes.append((t, side))


def _to(rates: Any, t: float, end: float, y: np.ndarray, *quantities: Any) -> tuple[float, np.ndarray, int]:
    """March until one of some quantities rises through zero: when, the state, and which (-1: none did)."""
    for quantity in quantities:
        quantity.terminal, quantity.direction = True, 1
    part = solve_ivp(rates, (t, end), y, "DOP853", rtol=1e-12, atol=1e-14, max_step=0.02, events=quantities or None)
    which = next((j for j, times in enumerate(part.t_events or ()) if len(times)), -1)
    return float(part.t[-1]), part.y[:, -1], which


def _table_by_scipy(d: Drawn, speeds: np.ndarray, forces: np.ndarray, static: float, end: float) -> np.ndarray:
    """Slip under F(|v|), a polygon, from bend to bend; held while the pull is below the static level."""
    t, y, side = 0.0, np.zeros(2), 0
    while t < end:
        if side == 0 and abs(d.pull(t, y)) > static * (1 - 1e-12):
            side = 1 if d.pull(t, y) > 0 else -1
        d.go_on(t, side)
        if side == 0:
            over = [lambda s, z, j=j: j * d.pull(s, z) - static for j in (1, -1)]
            t, y, _ = _to(lambda s, z: [0.0, 0.0], t, end, y, *over)
            continue
        line = max(0, int(np.searchsorted(speeds, abs(y[1]) + 1e-9)) - 1)  # the first one where it starts from rest
        while side and t < end:
            slope = np.diff(forces, append=forces[-1])[line] / np.diff(speeds, append=np.inf)[line]

            def friction(z: np.ndarray, side: int = side, line: int = line, slope: float = slope) -> float:
                return side * (forces[line] + slope * (side * z[1] - speeds[line]))

            bends = [lambda s, z, side=side, low=speeds[line]: low - side * z[1]]
            if line + 1 < len(speeds):
                bends.append(lambda s, z, side=side, high=speeds[line + 1]: side * z[1] - high)
            t, y, which = _to(lambda s, z, f=friction: [z[1], (d.pull(s, z) - f(z)) / d.mass], t, end, y, *bends)
            if which == 0 and line == 0:
                y[1], side = 0.0, 0
            line += {0: -1, 1: 1, -1: 0}[which]
    return y


def _state_variable_by_scipy(d: Drawn, gamma: float, end: float) -> np.ndarray:
    """Equations 4.1 and 4.2 of the thesis with a sign for tanh; held where Filippov's rule has a sign between -1 and 1
    that keeps the mass at rest, told from a tremble that has died down."""
    t, y, side, decay = 0.0, np.zeros(3), 0, d.level * gamma
    while t < end:
        gap = d.pull(t, y) - y[2]
        if side == 0:
            y[2] = d.pull(t, y) if abs(gap) < STILL * d.level else y[2]
            kept = (d.pull_held(t) + decay * y[2]) / (decay * d.level)
            side = (1 if gap > 0 else -1) if abs(gap) >= STILL * d.level else int(np.trunc(kept * (1 + 1e-9)))
            side = max(-1, min(1, side))
        d.go_on(t, side)
        if side == 0:
            over = [lambda s, z, j=j: j * (d.pull_held(s) + decay * z[2]) - decay * d.level for j in (1, -1)]
            t, y, which = _to(lambda s, z: [0.0, 0.0, d.pull_held(s)], t, end, y, *over)
            side = (1, -1, 0)[which]
            continue

        def rates(s: float, z: np.ndarray, side: int = side) -> list[float]:
            return [z[1], (d.pull(s, z) - z[2]) / d.mass, -decay * (z[2] - side * d.level)]

        begun = min(end, t + max(0.1 * abs(gap) / (decay * d.level), NUDGE))  # scipy finds the zero it starts at
        t, y, _ = _to(rates, t, begun, y)
        t, y, which = _to(rates, t, end, y, lambda s, z, side=side: -side * z[1])
        y[1], side = 0.0 if which == 0 else y[1], 0
    return y


def _compared(d: Drawn, law: Law, last: np.ndarray, end: float, *, shortest: float, atol: float) -> int:
    run = d.simulated(law, end)
    own: list[tuple[float, int]] = []
    for start, length, mode in zip(run.starts, run.durations, run.modes, strict=True):
        side = run.table.modes[mode].side if run.table.modes[mode].friction is not None else 0
        if length > 0 and (not own or own[-1][1] != side):
            own.append((float(start), side))
    mine, theirs = (_lasting(changes, end, shortest) for changes in (own, d.changes))
    assert [side for _, side in mine] == [side for _, side in theirs]
    assert np.allclose([t for t, _ in mine], [t for t, _ in theirs], rtol=0, atol=atol)
    assert np.allclose(run.sample([end], ("x", "v"))[0][:, 0], last[:2], rtol=0, atol=atol)
    return len(mine)


def _lasting(changes: list[tuple[float, int]], end: float, shortest: float) -> list[tuple[float, int]]:
    """Without what is over at once, as a tremble is; then also without holds, which begin somewhere in the tremble."""
    ends = [t for t, _ in changes[1:]] + [end]
    kept = [change for change, until in zip(changes, ends, strict=True) if until - change[0] > shortest]
    kept = [change for change in kept if change[1] or not shortest]
    return [change for j, change in enumerate(kept) if j == 0 or change[1] != kept[j - 1][1]]


def _table(seed: int) -> int:
    d = Drawn(seed)
    speeds = np.append(0.0, np.sort(d.draw.uniform(0.05, 0.8, 3)))
    forces = d.level * np.append(1.0, d.draw.uniform(0.6, 1.2, 3))
    static = float(forces[0] * d.draw.uniform(1.0, 1.3))
    law = ss.laws.Tabulated(tuple(speeds), tuple(forces), static)
    return _compared(d, law, _table_by_scipy(d, speeds, forces, static, 25.0), 25.0, shortest=0.0, atol=1e-8)


def _state_variable(seed: int) -> int:
    d = Drawn(seed)
    d.force = d.level * d.draw.uniform(1.0, 1.8)  # so that it is held now and then
    gamma = d.draw.uniform(3.0, 30.0) / d.level
    law = ss.laws.StateVariable(d.level, gamma)
    return _compared(d, law, _state_variable_by_scipy(d, gamma, 25.0), 25.0, shortest=0.05, atol=2e-5)


@pytest.mark.parametrize("law", [_table, _state_variable])
def test_a_law_moves_as_the_literature_has_it(law: Any) -> None:
    assert sum(law(seed) for seed in range(2)) > 8


@pytest.mark.soak
@pytest.mark.parametrize("law", [_table, _state_variable])
def test_twenty_systems_move_as_the_literature_has_them(law: Any) -> None:
    assert sum(law(seed) for seed in range(2, 22)) > 80
