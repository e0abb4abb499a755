"""The rules of a structure with rigid contacts written out anew, followed by scipy and in extended precision."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import stickslip as ss

STEP, TERMS = 5e-6, 30  # s and number of the Taylor series in extended precision
Modes = tuple[str, ...]
SIDES = {"forward": 1, "back": -1}


@dataclass(frozen=True)
class Mode:
    """Motion while no contact changes: S' = flow S, S = (y, 1, cos wt, sin wt); an exit is due where its row rises."""

    flow: np.ndarray
    exits: tuple[tuple[int, str], ...]  # contact, and what happens there
    rows: np.ndarray


class Rig:
    """The rules of a structure with rigid contacts on a resting face, from its matrices alone."""

    def __init__(self, structure: ss.Structure, dtype: Any = np.float64) -> None:
        self.structure, self.dtype, self.size = structure, dtype, structure.size
        self.omega = 8 * np.arctan(dtype(1)) * dtype(structure.drive.frequency)
        self.known: dict[Modes, Mode] = {}
        self.unit = np.eye(2 * self.size + 3, dtype=dtype)
        self.place, self.speed = self.unit[: self.size], self.unit[self.size : 2 * self.size]
        self.loads = [
            c.preload * self.unit[-3] + dtype(c.stiffness) * (c.normal @ self.place) for c in structure.contacts
        ]
        self.slips = [c.tangent @ self.speed for c in structure.contacts]

    def mode(self, names: Modes) -> Mode:
        if names not in self.known:
            self.known[names] = self.made(names)
        return self.known[names]

    def made(self, names: Modes) -> Mode:
        s = self.structure
        mass, damping, stiffness = (np.asarray(part).astype(self.dtype) for part in (s.mass, s.damping, s.stiffness))
        base = np.outer(s.acts_on, self.dtype(s.drive.amplitude) * self.unit[-2])
        force = -damping @ self.speed - stiffness @ (self.place - base)
        friction: dict[int, np.ndarray] = {}
        for c, (name, contact) in enumerate(zip(names, s.contacts, strict=True)):
            load = self.loads[c] if name != "lifted" else 0 * self.unit[-3]
            force = force - np.outer(contact.normal, load - contact.preload * self.unit[-3])
            if name in SIDES:
                level = SIDES[name] * self.dtype(contact.law.kinetic)
                friction[c] = level * load + self.dtype(contact.law.slope) * contact.preload * self.slips[c]
                force = force - np.outer(contact.tangent, friction[c])
        inverse = np.diag(1 / np.diag(mass))
        held = [c for c, name in enumerate(names) if name == "stuck"]
        if held:
            rows = np.array([s.contacts[c].tangent for c in held]).astype(self.dtype)
            needed = solved(rows @ inverse @ rows.T, rows @ inverse @ force)
            force = force - rows.T @ needed
            friction |= dict(zip(held, needed, strict=True))
        turning = np.zeros((3, len(self.unit)), dtype=self.dtype)
        turning[1], turning[2] = -self.omega * self.unit[-1], self.omega * self.unit[-2]
        exits, out = [], []
        for c, name in enumerate(names):
            if name == "lifted":
                exits.append((c, "close"))
                out.append(self.loads[c])
                continue
            exits.append((c, "lift"))
            out.append(-self.loads[c])
            if name == "stuck":
                level = self.dtype(s.contacts[c].law.breakaway) * self.loads[c]
                exits += [(c, "forward"), (c, "back")]
                out += [friction[c] - level, -friction[c] - level]
            else:
                exits.append((c, "stop"))
                out.append(-SIDES[name] * self.slips[c])
        return Mode(np.vstack([self.speed, inverse @ force, turning]), tuple(exits), np.array(out))

    def after(self, names: Modes, contact: int, what: str, state: np.ndarray) -> tuple[np.ndarray, Modes]:
        """State and modes that follow an exit; what holds has no velocity left."""

        def having(name: str) -> Modes:
            return (*names[:contact], name, *names[contact + 1 :])

        if what == "lift":
            return self.released(having("lifted"), state)
        if what in SIDES:
            return self.released(having(what), state)
        if what == "close":
            slip = float(self.slips[contact] @ state)
            return self.released(having("forward" if slip > 0 else "back"), state)
        state = state.copy()
        tangent = np.asarray(self.structure.contacts[contact].tangent)
        state[self.size + int(np.argmax(np.abs(tangent)))] -= self.slips[contact] @ state
        return self.released(having("stuck"), state)

    def released(self, names: Modes, state: np.ndarray) -> tuple[np.ndarray, Modes]:
        """Contacts that can not hold let go at once."""
        mode = self.mode(names)
        for (contact, what), row in zip(mode.exits, mode.rows, strict=True):
            if what in SIDES and row @ state > 1e-9:
                return self.released((*names[:contact], what, *names[contact + 1 :]), state)
        return state, names


def solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Of one or two rows, in any precision."""
    if len(matrix) == 1:
        return right / matrix[0, 0]
    (a, b), (c, d) = matrix
    return np.array([[d, -b], [-c, a]]) @ right / (a * d - b * c)


def opening(rig: Rig) -> tuple[np.ndarray, Modes]:
    state = np.zeros(len(rig.unit), dtype=rig.dtype)
    state[-3] = state[-2] = 1
    return rig.released(("stuck",) * len(rig.structure.contacts), state)


def dop853(rig: Rig, duration: float, *, rtol: float, longest: float) -> tuple[list[Modes], np.ndarray]:
    """Modes in turn, and the state at the end, by scipy."""
    size, omega = 2 * rig.size, float(rig.omega)
    state, names = opening(rig)
    now, order = 0.0, [names]
    while now < duration:
        mode = rig.mode(names)
        flow, constant, cosine = mode.flow[:size, :size], mode.flow[:size, size], mode.flow[:size, size + 1]

        def rate(t: float, y: np.ndarray, flow: Any = flow, constant: Any = constant, cosine: Any = cosine) -> Any:
            return flow @ y + constant + cosine * math.cos(omega * t)

        def watched(row: np.ndarray) -> Callable[..., float]:
            own, one, c = row[:size], float(row[size]), float(row[size + 1])

            def event(t: float, y: np.ndarray) -> float:
                return float(own @ y) + one + c * math.cos(omega * t)

            event.terminal, event.direction = True, 1  # type: ignore[attr-defined]
            return event

        options = {"method": "DOP853", "rtol": rtol, "atol": rtol * 1e-6}
        # an exit at the very start of a step is the way in: begin a little past it
        begin = min(1e-9, duration - now)
        first = solve_ivp(rate, (now, now + begin), state[:size], **options).y[:, -1]
        solution = solve_ivp(
            rate,
            (now + begin, duration),
            first,
            events=[watched(row) for row in mode.rows],
            max_step=longest,
            **options,
        )
        now = float(solution.t[-1])
        angle = omega * now
        state = np.array([*solution.y[:, -1], 1.0, math.cos(angle), math.sin(angle)])
        if solution.status != 1:
            break
        contact, what = next(e for e, times in zip(mode.exits, solution.t_events, strict=True) if len(times))
        state, names = rig.after(names, contact, what, state)
        order.append(names)
    return order, state


def taylor(rig: Rig, duration: float) -> tuple[list[Modes], np.ndarray]:
    """The same in extended precision: short steps of a long series; an exit is closed in on by Newton's method."""
    extended = np.longdouble
    step, end = extended(STEP), extended(duration)
    state, names = opening(rig)
    now, order = extended(0), [names]
    hops: dict[Modes, np.ndarray] = {}
    while now < end:
        mode = rig.mode(names)
        if names not in hops:
            hops[names] = advanced(mode.flow, np.eye(len(state), dtype=extended), step)
        ahead = hops[names] @ state
        over = mode.rows @ ahead > 0
        if not over.any() and now + step <= end:
            state, now = ahead, now + step
            continue
        times = {e: first_rise(mode, mode.rows[e], state, step) for e in np.flatnonzero(over)}
        e, length = min(times.items(), key=lambda pair: pair[1], default=(-1, end - now))
        if now + length >= end:
            return order, advanced(mode.flow, state, end - now)
        state, now = advanced(mode.flow, state, length), now + length
        state[-2], state[-1] = np.cos(rig.omega * now), np.sin(rig.omega * now)
        state, names = rig.after(names, *mode.exits[e], state)
        order.append(names)
    return order, state


def advanced(flow: np.ndarray, state: np.ndarray, length: np.longdouble) -> np.ndarray:
    total = term = state
    for k in range(1, TERMS):
        term = flow @ term * (length / k)
        total = total + term
    return total


def first_rise(mode: Mode, row: np.ndarray, state: np.ndarray, step: np.longdouble) -> np.longdouble:
    """When an exit that is due within a step is due."""
    length = step
    for _ in range(40):
        there = advanced(mode.flow, state, length)
        change = (row @ there) / (row @ mode.flow @ there)
        length -= change
        if abs(change) <= 1e-18 * step:
            break
    return length
